"""Assessment of a stage: what its data tell, errors of the estimates, quality of each run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Experiment
from swashplate.errors import InputError
from swashplate.identification.fitting import StageFit
from swashplate.identification.identifiability import Identifiability, identifiability
from swashplate.identification.lack_of_fit import ResidualTest, residual_test
from swashplate.identification.linearised import LinearisedFit, linearised_fit
from swashplate.identification.problem import Problem
from swashplate.identification.profile import checked_ends
from swashplate.identification.uncertainty import (
    Handed,
    Uncertainty,
    prior_sentences,
    reach,
    released,
    slopes_by_earlier,
    uncertainty,
)

Array = NDArray[np.float64]


class Measures(NamedTuple):
    """Measures of one channel of one run, or of several together."""

    samples: int
    """Samples that count."""
    rmse: float
    """Root of the mean squared difference, in the channel's unit."""
    spread: float
    """Standard deviation of what was measured, in the channel's unit."""

    @property
    def nrmse(self) -> float | None:
        """RMSE over the measured standard deviation; None where nothing moved."""
        return self.rmse / self.spread if self.spread > 0.0 else None

    @property
    def fit_percent(self) -> float | None:
        """100 (1 - NRMSE); 100 is perfect, 0 no better than the measured mean. [%]"""
        return None if self.nrmse is None else 100.0 * (1.0 - self.nrmse)

    @property
    def r_squared(self) -> float | None:
        """1 - NRMSE²."""
        return None if self.nrmse is None else 1.0 - self.nrmse**2

    @property
    def sentence(self) -> str:
        """The verdict for a table's cell or a line of text."""
        if self.fit_percent is None:
            return f"RMSE {self.rmse:.4g}; what was measured is constant, so there is no fit %"
        return f"RMSE {self.rmse:.4g}, fit {self.fit_percent:.1f} %, R² {self.r_squared:.4f}"


def measures(
    measured: Array, simulated: Array, weight: Array | None = None, *, weighted: bool = False
) -> Measures:
    """Measures of one channel of one run.

    Parameters
    ----------
    measured, simulated : (n,) arrays
        In the channel's unit.
    weight : (n,) array, optional
        Factors on the squared errors; samples with 0 are ignored.
    weighted : bool
        Whether the factors weigh mean, error and spread as well. By default they only say which
        samples count: a window of weight ten would otherwise pass for the whole run.

    Raises
    ------
    InputError
        If lengths differ, no sample counts, one that does is not finite, or a weight is negative.
    """
    return pooled_measures([(measured, simulated, weight)], weighted=weighted)


def pooled_measures(
    runs: list[tuple[Array, Array, Array | None]], *, weighted: bool = False
) -> Measures:
    """Measures of one channel over several runs, each about the mean of all.

    Parameters
    ----------
    runs : list of (measured, simulated, weight)
        As of `measures`.
    weighted : bool
        See there.

    Raises
    ------
    InputError
        As `measures`.
    """
    parts = [_counting(*run) for run in runs]
    measured, simulated, factor = (np.concatenate(column) for column in zip(*parts, strict=True))
    if not measured.size:
        raise InputError("No sample counts: all are ignored or have weight 0.")
    if not weighted:
        factor = np.ones(measured.size)
    total = float(factor.sum())
    mean = float(factor @ measured) / total
    squares = float(factor @ (simulated - measured) ** 2) / total
    # a constant channel's own mean is off by rounding
    about = measured - mean
    about[np.abs(about) <= 4.0 * np.finfo(np.float64).eps * abs(mean)] = 0.0
    return Measures(
        measured.size, float(np.sqrt(squares)), float(np.sqrt(factor @ about**2 / total))
    )


def _counting(
    measured: Array, simulated: Array, weight: Array | None
) -> tuple[Array, Array, Array]:
    """The samples that count, and their factors."""
    factor = np.ones(measured.shape) if weight is None else weight
    if measured.shape != simulated.shape or measured.shape != factor.shape:
        raise InputError(
            f"{measured.size} measured and {simulated.size} simulated samples with {factor.size} "
            "weights cannot be compared; simulate at the measurement's stamps."
        )
    if not (factor >= 0.0).all():
        raise InputError(
            "A weight is negative or not a number; a factor on a squared error is 0 or more."
        )
    used = factor > 0.0
    for what, samples in (("measured", measured), ("simulated", simulated)):
        if not np.isfinite(samples[used]).all():
            row = int(np.flatnonzero(used & ~np.isfinite(samples))[0])
            raise InputError(f"Sample {row + 1} of what was {what} is not finite; ignore it.")
    return measured[used], simulated[used], factor[used]


LIMITS = ("Z13", "Z14", "Z15", "Z16")
"""Parameters that limit something: stops, strokes, relief, orifices."""


@dataclass(frozen=True, eq=False)
class RunQuality:
    """How well one channel of one run is simulated."""

    experiment: Experiment
    channel: str
    simulated: Array
    """(m,) at the channel's stamps, its free zero included. [unit of the channel]"""
    measures: Measures
    test: ResidualTest | None
    """None where there are too few samples."""

    @property
    def residual(self) -> Array:
        """(m,) simulated less measured."""
        return self.simulated - self.experiment[self.channel].values


@dataclass(frozen=True, eq=False)
class Assessment:
    """What a stage's data tell of its unknowns, and how good the fit is."""

    stage: StageFit
    earlier: tuple[Assessment, ...] = ()
    """Of the stages before, whose results this one takes for granted."""

    @property
    def _vector(self) -> Array:
        return self.stage.solution.vector

    @cached_property
    def linearised(self) -> LinearisedFit:
        """Residuals and derivatives at the optimum."""
        return linearised_fit(self.stage.problem, self._vector)

    @cached_property
    def identifiability(self) -> Identifiability:
        """Which unknowns the tests determine."""
        problem = self.stage.problem
        fixed = {
            name: value
            for name, value in self.stage.parameters.numbers.items()
            if name not in problem.unknowns.names
        }
        try:
            covariance = self.uncertainty.quoted.matrix
        except InputError:  # too few samples to tell the noise from
            covariance = None
        return identifiability(
            self.linearised.triangle,
            self.linearised.variables,
            covariance=covariance,
            tolerance=self.linearised.tolerance,
            fixed=fixed,
        )

    @cached_property
    def uncertainty(self) -> Uncertainty:
        """Errors of the estimates, for coloured residuals, those of earlier stages taken in."""
        handed = []
        for each in self.earlier:
            slopes = slopes_by_earlier(self.stage, each.stage, self.linearised)
            if slopes is not None:
                handed.append(Handed(each.uncertainty.quoted, slopes))
        found = uncertainty(self.linearised, handed=handed)
        said = prior_sentences(self.stage.problem.unknowns, self._vector, found.quoted)
        found = replace(found, priors=said)
        if not found.noisy:
            return found
        half = reach(found.own, found.level)
        limits = [
            number
            for number, unknown in enumerate(self.stage.problem.unknowns)
            if unknown.targets[0].startswith(LIMITS)
        ]
        fit = released(self.linearised)
        ends = checked_ends(self.stage.problem, self._vector, fit, half, limits)
        return replace(found, ends=ends)

    @cached_property
    def runs(self) -> tuple[RunQuality, ...]:
        """Quality of each channel of each run that was fitted."""
        return run_qualities(self.stage.problem, self._vector)


def run_qualities(problem: Problem, vector: Array) -> tuple[RunQuality, ...]:
    """Quality of each channel of each run of a problem at a point."""
    return tuple(
        compared(experiment, name, simulated)
        for number, experiment in enumerate(problem.experiments)
        for name, simulated in problem.outputs(vector, number).items()
        if experiment[name].used.any()
    )


def compared(experiment: Experiment, name: str, simulated: Array) -> RunQuality:
    """Quality of one channel of one run, simulated at its stamps."""
    channel = experiment[name]
    used = channel.used
    return RunQuality(
        experiment,
        name,
        simulated,
        measures(channel.values, simulated, channel.weight),
        _tested(experiment, channel.time[used], (simulated - channel.values)[used]),
    )


def _tested(experiment: Experiment, time: Array, residual: Array) -> ResidualTest | None:
    if time.size < 8:
        return None
    return residual_test(time, residual, experiment.input.at(time))


def assess(stages: Sequence[StageFit]) -> tuple[Assessment, ...]:
    """The assessment of each stage of a fit."""
    made: list[Assessment] = []
    for each in stages:
        made.append(Assessment(each, tuple(made)))
    return tuple(made)
