"""Assessment of a stage: what its data tell, errors of the estimates, quality of each run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from swashplate.campaign.experiment import Experiment
from swashplate.errors import InputError
from swashplate.identification.fitting import StageFit
from swashplate.identification.identifiability import Identifiability, identifiability
from swashplate.identification.linearised import LinearisedFit, linearised_fit
from swashplate.identification.noise import LONGEST, Grid, correlation_length, grid_of, pair_sums
from swashplate.identification.problem import Problem
from swashplate.identification.profile import checked_ends
from swashplate.identification.uncertainty import (
    Handed,
    Uncertainty,
    prior_sentences,
    reach,
    released,
    slopes_by_earlier,
    slopes_by_fixed,
    uncertainty,
)
from swashplate.results import Result

if TYPE_CHECKING:
    from swashplate.tables import Table

Array = NDArray[np.float64]


LONGEST_SHOWN = 2.0
"""Largest lag of the curves. [s]"""

DEVIATIONS = 1.96
"""Half width of the bands, in standard deviations: 95 %."""

CHANCE = 0.05
"""Probability that unrelated signals are said to be related, all lags together."""


@dataclass(frozen=True, eq=False)
class ResidualTest(Result):
    """Whiteness of the residuals of one channel of one run, and independence of the input."""

    lags: Array
    """(m,) from 0. [s]"""
    autocorrelation: Array
    """(m,) of the residuals."""
    white_band: float
    """Half width of the 95 % band of white noise."""
    cross_lags: Array
    """(2 m - 1,) positive where the residual comes after the input. [s]"""
    cross_correlation: Array
    """(2 m - 1,) of the residuals with the input."""
    cross_band: float
    """Half width of the 95 % band of residuals, coloured as these are, without relation to the
    input."""
    duration: float
    """Time over which the residuals stay correlated; 0 if they are white. [s]"""
    verdict: str
    """In words."""

    @property
    def white(self) -> bool:
        """Whether nothing but white noise is left."""
        return self.duration == 0.0

    @property
    def peak(self) -> tuple[float, float]:
        """Lag of the largest cross-correlation [s], and its value."""
        place = int(np.argmax(np.abs(self.cross_correlation)))
        return float(self.cross_lags[place]), float(self.cross_correlation[place])


def residual_test(
    time: Array, residual: Array, command: Array, *, longest: float = LONGEST_SHOWN
) -> ResidualTest:
    """Test the residuals of one channel of one run.

    Parameters
    ----------
    time : (n,) array
        Stamps of the samples that count; gaps are respected. [s]
    residual, command : (n,) arrays
        Simulated less measured, weights left out, and the input at the same stamps.
    longest : float
        Largest lag of the curves; at most a quarter of the run is shown. [s]

    Raises
    ------
    InputError
        If lengths differ, a number is not finite, or there are fewer than 8 samples.

    Notes
    -----
    The band of the cross-correlation is 1.96 √(Σ ρ_r ρ_u/n): two coloured signals without any
    relation show large correlations by chance (Bartlett's formula), and a band of 1.96/√n would
    call every one of them a finding.
    """
    if not time.shape == residual.shape == command.shape:
        raise InputError(
            f"{time.size} stamps, {residual.size} residuals and {command.size} samples of the "
            "input do not belong together."
        )
    if time.size < 8:
        raise InputError(f"{time.size} samples tell nothing of correlation; 8 are the least.")
    first = float(residual[0])
    if not (np.isfinite(residual).all() and np.isfinite(command).all()):
        raise InputError("Residuals and input must be finite; leave the other samples out.")
    grid = grid_of(time)
    most = max(int(LONGEST * grid.size), 1)
    shown = min(most, max(int(longest / grid.step), 1))
    residual, command = residual - residual.mean(), command - command.mean()
    own, counts = _autocorrelation(residual, grid, most)
    length = correlation_length(own, counts)
    # beyond the residuals' own length their estimated correlation is chance
    kept = slice(1, max(length, 1) + 1)
    theirs = _autocorrelation(command, grid, most)[0]
    inflation = max(1.0, 1.0 + 2.0 * float(own[kept] @ theirs[kept]))
    band = min(DEVIATIONS * float(np.sqrt(inflation / time.size)), 1.0)
    cross = np.zeros(2 * shown + 1)
    scale = float(np.linalg.norm(residual) * np.linalg.norm(command))
    if scale > 0.0:
        size = next_fast_len(grid.size + shown, real=True)
        spectra = rfft(grid.spread(command), size).conj() * rfft(grid.spread(residual), size)
        products = irfft(spectra, size)
        cross = np.concatenate([products[size - shown :], products[: shown + 1]]) / scale
    lags: Array = np.arange(shown + 1.0) * grid.step
    both = np.concatenate([-lags[:0:-1], lags])
    white = DEVIATIONS / float(np.sqrt(time.size))
    duration = length * grid.step
    made = ResidualTest(lags, own[: shown + 1], white, both, cross, band, duration, "")
    return replace(made, verdict=_in_words(made, first))


def _in_words(test: ResidualTest, first: float) -> str:
    """The verdict of a test; `first` is the first residual."""
    if not test.autocorrelation[1:].any():
        what = "exactly zero" if first == 0.0 else f"{first:.4g} throughout"
        return f"The residuals are {what}: there is no noise to test."
    colour = (
        "The residuals are white"
        if test.white
        else f"The residuals stay correlated over {test.duration:.2g} s"
    )
    if not test.cross_correlation.any():
        return f"{colour}; the input is constant and explains nothing."
    from scipy.special import ndtri

    # neighbouring lags say the same: as many looks as correlation lengths fit
    looks = max(test.cross_lags.size / max(test.duration / test.lags[1], 1.0), 1.0)
    limit = -float(ndtri(0.5 * CHANCE / looks)) / DEVIATIONS * test.cross_band
    lag, value = test.peak
    if abs(value) <= limit:
        return f"{colour} and have no relation to the input."
    when = (
        f"{abs(lag):.2g} s {'after' if lag > 0.0 else 'before'} it" if lag else "at the same time"
    )
    return (
        f"{colour} and follow the input (correlation {value:+.2f} {when}): the model leaves out "
        "something that the input causes."
    )


def _autocorrelation(samples: Array, grid: Grid, lags: int) -> tuple[Array, Array]:
    sums, counts = pair_sums(samples, grid, lags)
    means = sums / np.maximum(counts, 1.0)
    if not means[0] > 0.0:
        return np.where(np.arange(lags + 1) == 0, 1.0, 0.0), counts
    return np.clip(means / means[0], -1.0, 1.0), counts


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


def measures(measured: Array, simulated: Array, weight: Array | None = None) -> Measures:
    """Measures of one channel of one run.

    Parameters
    ----------
    measured, simulated : (n,) arrays
        In the channel's unit.
    weight : (n,) array, optional
        Factors on the squared errors, of which those that are 0 say which samples do not count. The
        others weigh nothing here: a window of weight ten would otherwise pass for the whole run.

    Raises
    ------
    InputError
        If lengths differ, no sample counts, one that does is not finite, or a weight is negative.
    """
    return pooled_measures([(measured, simulated, weight)])


def pooled_measures(runs: list[tuple[Array, Array, Array | None]]) -> Measures:
    """Measures of one channel over several runs, each about the mean of all; else as `measures`."""
    parts = [_counting(*run) for run in runs]
    measured, simulated = (np.concatenate(column) for column in zip(*parts, strict=True))
    if not measured.size:
        raise InputError("No sample counts: all are ignored or have weight 0.")
    mean = float(measured.mean())
    # a constant channel's own mean is off by rounding
    about = measured - mean
    about[np.abs(about) <= 4.0 * np.finfo(np.float64).eps * abs(mean)] = 0.0
    rmse, spread = (float(np.sqrt(np.mean(each**2))) for each in (simulated - measured, about))
    return Measures(measured.size, rmse, spread)


def _counting(measured: Array, simulated: Array, weight: Array | None) -> tuple[Array, Array]:
    """The samples that count."""
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
    return measured[used], simulated[used]


LIMITS = ("Z13", "Z14", "Z15", "Z16")
"""Parameters that limit something: stops, strokes, relief, orifices."""


@dataclass(frozen=True, eq=False)
class RunQuality(Result):
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
class Assessment(Result):
    """What a stage's data tell of its unknowns, and how good the fit is."""

    stage: StageFit
    earlier: tuple[Assessment, ...] = ()
    """Of the stages before, whose results this one takes for granted."""

    def tables(self) -> list[Table]:
        """Estimates with their intervals, then the errors of each run."""
        from swashplate.identification.tables import estimates_table, runs_tables

        return [estimates_table(self), *runs_tables(self.runs)]

    @property
    def _vector(self) -> Array:
        return self.stage.solution.vector

    @cached_property
    def linearised(self) -> LinearisedFit:
        """Residuals and derivatives at the optimum."""
        return linearised_fit(self.stage.problem, self._vector, self.stage.solution.loss)

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
        fixed = slopes_by_fixed(self.stage, self.linearised)
        for each in self.earlier:
            slopes = slopes_by_earlier(self.stage, each.stage, self.linearised)
            if slopes is not None:
                before = each.uncertainty
                handed.append(Handed(before.sampled, slopes))
                # a fixed number acts on this stage by itself, and through what it does to others
                fixed = fixed + slopes @ before.fixed
        found = uncertainty(self.linearised, handed=handed, fixed=fixed)
        said = prior_sentences(self.stage.problem.unknowns, self._vector, found.quoted)
        found = replace(found, priors=said)
        if not found.noisy:
            return found
        half, fit = reach(found.own, found.level), released(self.linearised)
        unknowns = enumerate(self.stage.problem.unknowns)
        limits = [number for number, each in unknowns if each.targets[0].startswith(LIMITS)]
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
    used, test = channel.used, None
    if np.count_nonzero(used) >= 8:
        time, residual = channel.time[used], (simulated - channel.values)[used]
        test = residual_test(time, residual, experiment.input.at(time))
    found = measures(channel.values, simulated, channel.weight)
    return RunQuality(experiment, name, simulated, found, test)


def assess(stages: Sequence[StageFit]) -> tuple[Assessment, ...]:
    """The assessment of each stage of a fit."""
    made: list[Assessment] = []
    for each in stages:
        made.append(Assessment(each, tuple(made)))
    return tuple(made)
