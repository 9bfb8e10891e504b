"""Cross-validation over experiments: each part of the runs predicted by a fit to the others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Experiment
from swashplate.errors import DomainError, InputError
from swashplate.executors import Executor, Serial
from swashplate.identification.assessment import Measures, RunQuality
from swashplate.identification.fitting import Fit, Search, fit, smooth
from swashplate.identification.setup import Setup
from swashplate.identification.solving import Loss
from swashplate.identification.staging import Parameters, stage_problem
from swashplate.identification.validation import predict, with_speeds
from swashplate.results import Result

Array = NDArray[np.float64]

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
class Fold(Result):
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
class CrossValidation(Result):
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
        made = []
        for key, values in found.items():
            told, error = np.array(values or [np.nan]), None
            if len(values) > 1:
                error = float(np.sqrt((told.size - 1) * told.var()))
            ends = float(told.mean()), float(told.min()), float(told.max())
            made.append(Spread(*key, len(values), *ends, error))
        return tuple(made)

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


LEFT = 0.01
"""Share of what all runs tell of an unknown, below which the runs left in a fold do not tell it."""
ONE_WAY = 0.25
"""A command whose smaller extreme is below this part of the larger one goes one way."""


def cross_validate(
    experiments: Sequence[Experiment],
    nominal: Parameters,
    setup: Setup,
    *,
    folds: int = 5,
    seed: int = 0,
    executor: Executor | None = None,
    loss: Loss = "linear",
    watch: Callable[[Fold, int], None] | None = None,
) -> CrossValidation:
    """Fit to all runs but some, predict those from the command alone, and so on for each part.

    Parameters
    ----------
    experiments : sequence of Experiment
        The runs of the fit.
    nominal : ParameterSet or ModelParameters
        Where each fit begins: not at the fit to all runs, which has seen those that are held out.
    setup : Setup
        Stages and free parameters.
    folds : int
        Parts, at least 2 and at most as many as there are runs: then each run is one.
    seed : int
        Of the dealing; the same seed, the same folds.
    executor : Executor, optional
        Where the fits run; here, one after another, by default. The results do not depend on it.
    loss : Loss
        As of `fit.fit`.
    watch : callable, optional
        Told of each fold and how many there are by now. Ctrl-C ends it; folds that are done are
        returned.

    Raises
    ------
    InputError
        If there are fewer runs than folds, or fewer than 2 folds.
    """
    parts = deal(experiments, folds, seed)
    here = executor or Serial()
    # fits run side by side elsewhere, so each of them runs on one thread
    shared = tuple(experiments), nominal, setup, loss, None if isinstance(here, Serial) else 1
    done: dict[int, Fold] = {}
    try:
        for _, fold in here.run(_fold, shared, list(enumerate(parts))):
            done[fold.number] = fold
            if watch is not None:
                watch(fold, len(done))
    except KeyboardInterrupt:
        if not done:
            raise
    return CrossValidation(seed, len(parts), tuple(done[number] for number in sorted(done)))


def deal(experiments: Sequence[Experiment], folds: int, seed: int) -> tuple[tuple[int, ...], ...]:
    """Deal runs into folds, those of a kind and direction apart as far as there are folds.

    Places of each fold's runs, increasing; folds differ by at most one run. The seed is that of the
    order within each kind.

    Raises
    ------
    InputError
        If there are fewer runs than folds, or fewer than 2 folds.
    """
    if folds < 2:
        raise InputError(f"Cross-validation needs at least 2 folds, not {folds}.")
    if folds > len(experiments):
        raise InputError(
            f"{folds} folds need at least as many runs; there are {len(experiments)} to fit."
        )
    strata: dict[tuple[str, str], list[int]] = {}
    for place, each in enumerate(experiments):
        strata.setdefault((each.maneuver.split(" ")[0], _direction(each)), []).append(place)
    random = np.random.default_rng(seed)
    parts: list[list[int]] = [[] for _ in range(folds)]
    order = random.permutation(folds)
    dealt = 0
    for _, places in sorted(strata.items()):
        for place in random.permutation(places):
            parts[order[dealt % folds]].append(int(place))
            dealt += 1
    return tuple(tuple(sorted(part)) for part in parts)


def _direction(experiment: Experiment) -> str:
    values = experiment.input.values
    high, low = max(float(values.max()), 0.0), max(-float(values.min()), 0.0)
    if min(high, low) > ONE_WAY * max(high, low):
        return "both"
    return "plus" if high >= low else "minus"


def _fold(
    shared: tuple[tuple[Experiment, ...], Parameters, Setup, Loss, int | None],
    item: tuple[int, tuple[int, ...]],
) -> Fold:
    (experiments, nominal, setup, loss, threads), (number, part) = shared, item
    held = [experiments[place] for place in part]
    others = [each for place, each in enumerate(experiments) if place not in part]
    names = tuple(each.name for each in held)
    try:
        result = fit(nominal, others, setup, loss=loss, threads=threads, search=Search(0))
        if result.stages[-1].solution.interrupted:
            raise KeyboardInterrupt
        runs = tuple(HeldRun.of(each) for each in with_speeds(predict(result.parameters, held)))
    except (InputError, DomainError) as error:
        return Fold(number, names, (), (), (), False, str(error))
    estimates = tuple(
        FoldEstimate(each.stage.name, unknown.name, unknown.unit, each.values[unknown.name])
        for each in result.stages
        for unknown in each.problem.unknowns
        if unknown.run is None
    )
    converged = all(each.solution.converged for each in result.stages)
    return Fold(number, names, estimates, _lost(result, held, threads), runs, converged, "")


def _lost(result: Fit, held: Sequence[Experiment], threads: int | None) -> tuple[str, ...]:
    """Unknowns that the runs held out tell, and those left in do not."""
    lost, before = [], smooth(result.nominal)
    for stage in result.stages:
        try:
            apart = stage_problem(stage.stage, before, held, threads=threads)
            # in the units of all runs: information in other units cannot be compared
            apart = replace(apart, scales=stage.problem.scales)
        except InputError:  # none of them has a channel of this stage
            before = stage.parameters
            continue
        before = stage.parameters
        left, there = (
            np.sum(problem.evaluate(vector).jacobian ** 2, axis=0)
            for problem, vector in (
                (stage.problem, stage.solution.vector),
                (apart, apart.unknowns.vector_of(stage.values)),
            )
        )
        told = dict(zip(apart.unknowns.names, there, strict=True))
        lost += [
            unknown.name
            for unknown, kept in zip(stage.problem.unknowns, left, strict=True)
            if unknown.run is None and kept < LEFT * (kept + told.get(unknown.name, 0.0))
        ]
    return tuple(lost)
