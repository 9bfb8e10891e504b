"""What cross-validation found: held-out errors by channel, the spread of each estimate."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple

import numpy as np

from swashplate.identification.assessment import RunQuality
from swashplate.identification.measures import Measures

VARIES = 0.1
"""Jackknife error over the estimate from which an unknown is said to depend on the runs."""


class HeldRun(NamedTuple):
    """How well one channel of a run is predicted by a fit that did not see it."""

    run: str
    maneuver: str
    channel: str
    unit: str
    measures: Measures
    mean: float
    """Of what was measured. [unit]"""

    @classmethod
    def of(cls, quality: RunQuality) -> HeldRun:
        """From a prediction."""
        experiment, channel = quality.experiment, quality.experiment[quality.channel]
        return cls(
            experiment.name,
            experiment.maneuver,
            quality.channel,
            channel.unit,
            quality.measures,
            float(channel.values[channel.used].mean()),
        )


class FoldEstimate(NamedTuple):
    """An unknown as one fold's fit found it."""

    stage: str
    name: str
    unit: str
    value: float


@dataclass(frozen=True)
class Fold:
    """One part of the runs, and the fit to the others."""

    number: int
    """From 0."""
    held: tuple[str, ...]
    """Names of the runs that were held out."""
    estimates: tuple[FoldEstimate, ...]
    lost: tuple[str, ...]
    """Unknowns that only the runs held out tell of: their estimates here mean nothing."""
    runs: tuple[HeldRun, ...]
    converged: bool
    failure: str
    """Why there is no fit, or empty."""


class Spread(NamedTuple):
    """How an estimate varies with the runs it comes from."""

    stage: str
    name: str
    unit: str
    folds: int
    """That tell of it."""
    mean: float
    lowest: float
    highest: float
    error: float | None
    """Delete-a-group jackknife standard error; None from less than 2 folds."""


@dataclass(frozen=True)
class CrossValidation:
    """The folds of a campaign."""

    seed: int
    planned: int
    """How many folds there were to be."""
    folds: tuple[Fold, ...]

    @property
    def measures(self) -> dict[str, Measures]:
        """Measures of each channel over all runs, each predicted by a fit that did not see it."""
        runs = [run for fold in self.folds for run in fold.runs]
        return {
            name: _pooled([run for run in runs if run.channel == name])
            for name in dict.fromkeys(run.channel for run in runs)
        }

    @property
    def units(self) -> dict[str, str]:
        """SI unit of each channel."""
        return {run.channel: run.unit for fold in self.folds for run in fold.runs}

    @property
    def spreads(self) -> tuple[Spread, ...]:
        """How each unknown varies over the folds that tell of it.

        Notes
        -----
        The jackknife's error √((k-1)/k Σ(θ_i - mean)²) holds for any colour of the noise and takes
        in that the model is not exact; from a few folds it is itself known to a third or so.
        """
        found: dict[tuple[str, str, str], list[float]] = {}
        for fold in self.folds:
            for each in fold.estimates:
                values = found.setdefault(each[:3], [])
                if each.name not in fold.lost:
                    values.append(each.value)
        return tuple(_spread(key, values) for key, values in found.items())

    def sentences(self) -> tuple[str, ...]:
        """What must be known besides the numbers."""
        said = []
        if len(self.folds) < self.planned:
            said.append(f"Interrupted: {len(self.folds)} of {self.planned} folds were fitted.")
        for fold in self.folds:
            name = f"Fold {fold.number + 1} (without {', '.join(fold.held)})"
            if fold.failure:
                said.append(f"{name} could not be fitted: {fold.failure}")
            elif not fold.converged:
                said.append(f"{name} did not converge.")
            if fold.lost:
                said.append(
                    f"{name} loses {', '.join(fold.lost)}: only the runs held out tell of "
                    f"{'them' if len(fold.lost) > 1 else 'it'}, so no prediction of theirs can be "
                    "good where it counts."
                )
        varying = [
            f"{each.name} ±{100.0 * each.error / abs(each.mean):.2g} %"
            for each in self.spreads
            if each.error is not None and each.error > VARIES * abs(each.mean) > 0.0
        ]
        if varying:
            said.append(
                f"Estimates that depend on which runs they come from (jackknife standard error "
                f"beyond {100.0 * VARIES:.0f} %): {', '.join(varying)}."
            )
        return tuple(said)


def _pooled(runs: list[HeldRun]) -> Measures:
    """As if all samples were of one run: about the mean of all."""
    samples = np.array([run.measures.samples for run in runs], dtype=np.float64)
    share = samples / samples.sum()
    means = np.array([run.mean for run in runs])
    squares = float(share @ np.array([run.measures.rmse for run in runs]) ** 2)
    within = np.array([run.measures.spread for run in runs]) ** 2
    variance = float(share @ (within + (means - share @ means) ** 2))
    return Measures(int(samples.sum()), sqrt(squares), sqrt(variance))


def _spread(key: tuple[str, str, str], values: list[float]) -> Spread:
    if not values:
        return Spread(*key, 0, float("nan"), float("nan"), float("nan"), None)
    found = np.array(values)
    error = None
    if found.size > 1:
        deviations = found - found.mean()
        error = float(np.sqrt((found.size - 1) / found.size * np.sum(deviations**2)))
    return Spread(
        *key, found.size, float(found.mean()), float(found.min()), float(found.max()), error
    )
