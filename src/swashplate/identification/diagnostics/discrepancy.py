"""How far a prediction may be off in a maneuver that no test has, by class of motion.

A model is judged by runs that it was not fitted to: those that were held out, and each fitted run
as if all runs of its maneuver had been left out. How large their errors are over short windows
depends on the signal and on how fast it changes; how much a maneuver differs from this is the error
of a new one. Nothing is asked of the instruments: what is noise shows in the errors themselves.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from types import MappingProxyType
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.ndimage import maximum_filter1d
from scipy.optimize import nnls
from scipy.special import stdtrit

from swashplate.campaign import UNNAMED, Experiment
from swashplate.identification.estimation.posterior import mean_square_bound
from swashplate.identification.estimation.problem import LinearisedFit, LinearisedRun
from swashplate.identification.optimum import Optimum, once_per_fit
from swashplate.identification.validation import RunQuality
from swashplate.results import Result

Array = NDArray[np.float64]
MotionClass = Literal["large", "small", "fast"]

WINDOWS: Mapping[MotionClass, float] = {"large": 0.5, "small": 0.5, "fast": 0.12}
"""Time over which an error is taken in each class. [s]"""
TIME = 0.1
"""Time in which a change of the signal counts as large as the signal. [s]"""
FAST = 0.04
"""Part of its range by which a signal changes within `TIME` where it is fast. [1]"""
SMALL = 0.06
"""Part of its range below which a signal is small. [1]"""
NEAR = 0.25
"""Time before and after a fast change that belongs to it. [s]"""
COMMANDED = 0.01
"""Part of the largest command from which there is one. [1]"""
OWN = 0.01
"""Of 1 less the leverage of a maneuver and of priors: directions that no other one determines stay
fitted, as one step says little of where they would be without it."""
OTHERS = 0.5
"""The same if something is known beforehand: others must determine half of a direction. What they
leave open of it is stated by what is known, and must not be stated twice."""
BOUND_LEVEL = 0.9
"""Probability with which the error of a new maneuver lies below the stated one."""
USUAL_SPREAD, WORTH = 1.3, 20.0
"""Standard deviation of the logarithm of a maneuver's squared error over the variance function, and
how many maneuvers that knowledge is worth (Smyth 2004): measured on machines with 13 maneuvers, as
five that a campaign repeats do not tell it (docs/calibration.md)."""


# --- maneuvers as if they had been left out -------------------------------------------------------


def left_out(
    fit: LinearisedFit, maneuvers: Mapping[str, str]
) -> Iterator[tuple[LinearisedRun, Array]]:
    """Each channel of each run, with the differences (n,) if its maneuver had been left out.

    Parameters
    ----------
    fit : LinearisedFit
    maneuvers : mapping of str to str
        Maneuver of each run: a second run of one says nothing of a new maneuver.

    Notes
    -----
    To first order, without a fit. With W whitening JᵀJ and D = J W of the runs of one maneuver,
    their residuals are (I - D Dᵀ)⁻¹ r (Cook and Weisberg 1982, section 3.2; for a group of rows).
    """
    shifts = _shifts(fit, maneuvers)
    for run, jacobian in fit.jacobians():
        yield run, _shifted(fit, run, jacobian, shifts[maneuvers[run.name]])


def without_runs(
    fit: LinearisedFit, names: Collection[str]
) -> Iterator[tuple[LinearisedRun, Array]]:
    """Each channel of each run, with the differences (n,) if some runs had been left out."""
    groups = {run.name: "left out" for run in fit.runs if run.name in names}
    shifts = _shifts(fit, groups)
    for run, jacobian in fit.jacobians():
        yield run, _shifted(fit, run, jacobian, shifts["left out"])


class _Shift(NamedTuple):
    """How far a whitened vector moves if the runs of a group are left out."""

    directions: NDArray[np.intp]
    """(d,) numbers of the directions that these runs have a part in."""
    size: Array
    """(d,)"""


class _RunPart(NamedTuple):
    """What one channel of a run adds to the shift of its group."""

    directions: NDArray[np.intp]
    product: Array
    """(d, d) of its derivatives along these directions."""
    along: Array
    """(d,) of these derivatives and the residuals."""


def _shifts(fit: LinearisedFit, groups: Mapping[str, str]) -> dict[str, _Shift]:
    """Of each group of runs; only products are kept of them."""
    parts = defaultdict[str, list[_RunPart]](list)
    for run, jacobian in fit.jacobians():
        if run.name in groups:
            directions, whitening = fit.inverse.of_run(run.name)
            by = jacobian @ whitening
            parts[groups[run.name]].append(_RunPart(directions, by.T @ by, by.T @ run.residual))
    shifts = dict[str, _Shift]()
    of_priors = fit.prior @ fit.whitening
    for group, run_parts in parts.items():
        moved = np.unique(np.concatenate([part.directions for part in run_parts]))
        products = np.zeros((moved.size, moved.size))
        along = np.zeros(moved.size)
        for part in run_parts:
            positions = np.searchsorted(moved, part.directions)
            products[np.ix_(positions, positions)] += part.product
            along[positions] += part.along
        leverages, axes = np.linalg.eigh(products)
        spare = 1.0 - np.minimum(leverages, 1.0)
        # what is known beforehand is no other maneuver that would tell
        known = np.sum((of_priors[:, moved] @ axes) ** 2, axis=0)
        shared = spare - known > (OTHERS if of_priors.size else OWN)
        gain = np.where(shared, 1.0 / np.where(shared, spare, 1.0), 0.0)
        shifts[group] = _Shift(moved, axes @ (gain * (axes.T @ along)))
    return shifts


def _shifted(fit: LinearisedFit, run: LinearisedRun, jacobian: Array, shift: _Shift) -> Array:
    """(n,) differences of a run, simulated less measured, after a shift. [unit]"""
    directions, whitening = fit.inverse.of_run(run.name)
    _, of_run, of_shift = np.intersect1d(directions, shift.directions, return_indices=True)
    shifted = run.residual + jacobian @ (whitening[:, of_run] @ shift.size[of_shift])
    return np.asarray(shifted if run.weight is None else shifted / run.weight)


# --- errors over windows --------------------------------------------------------------------------


class ChannelErrors(NamedTuple):
    """One channel of one run, on an even grid, with the error of its simulation."""

    run: str
    maneuver: str
    held_out: bool
    start: float
    """Of the grid. [s]"""
    step: float
    """[s]"""
    measured: Array
    """(n,) [unit]"""
    error: Array
    """(n,) simulated less measured. [unit]"""
    noise: float
    """Standard deviation of what in it is independent from sample to sample. [unit]"""
    rounding: Array
    """(n,) what rounding to an encoder's counts makes of what is simulated; else 0. [unit]"""
    signal: Array
    """(n,) what is simulated; of a position its speed. [unit, or unit/s]"""
    rate: Array
    """(n,) its change within `TIME`. [unit, or unit/s]"""
    command: Array
    """(n,)"""
    is_position: bool
    left_open: Array | None = None
    """(n, s) errors that the numbers of the machine leave open, see `Posterior.errors_of`; None if
    nothing is known of these. [unit]"""


def channel_errors(
    quality: RunQuality, error: Array | None = None, *, held_out: bool = False
) -> ChannelErrors | None:
    """One channel of one run; None if fewer than four samples count.

    Parameters
    ----------
    quality : RunQuality
    error : (m,) array, optional
        Simulated less measured of the samples that count; by default that of the quality.
    held_out : bool
        Whether the run was held out of the fit.
    """
    experiment, channel = quality.experiment, quality.experiment[quality.channel]
    time = channel.time[channel.used]
    error = quality.residual[channel.used] if error is None else error
    if time.size < 4:
        return None
    step = float(np.median(np.diff(time)))
    grid = np.arange(time[0], time[-1] + 0.5 * step, step)
    signal = np.interp(grid, channel.time, quality.simulated)
    rounding = np.zeros(grid.size)
    step_of_counts = channel.resolution
    if step_of_counts:
        # at constant speed it is slow, and not independent from sample to sample
        rounding = step_of_counts * np.round(signal / step_of_counts) - signal
    if channel.is_position:
        signal = np.gradient(signal, step)
    return ChannelErrors(
        run=experiment.name,
        maneuver=maneuver_of(experiment),
        held_out=held_out,
        start=float(time[0]),
        step=step,
        measured=np.interp(grid, time, channel.values[channel.used]),
        error=np.interp(grid, time, error),
        noise=white_noise(error, channel.values[channel.used]),
        rounding=rounding,
        signal=signal,
        rate=TIME * np.gradient(signal, step),
        command=experiment.input.at(grid),
        is_position=channel.is_position,
        left_open=_on_grid(grid, channel.time, quality.left_open),
    )


def _on_grid(grid: Array, time: Array, columns: Array | None) -> Array | None:
    """(n, s) samples (m, s) at other instants."""
    if columns is None:
        return None
    return np.column_stack([np.interp(grid, time, column) for column in columns.T])


@dataclass(frozen=True)
class ErrorsOfRuns(Result):
    """One channel of several runs, one record after another: those of many runs are large."""

    parts: tuple[tuple[RunQuality, Array | None, bool], ...]
    """Arguments of `channel_errors`: the quality, the error, and whether the run was held out."""

    def __iter__(self) -> Iterator[ChannelErrors]:
        for quality, error, held_out in self.parts:
            record = channel_errors(quality, error, held_out=held_out)
            if record is not None:
                yield record


def maneuver_of(experiment: Experiment) -> str:
    """The maneuver of a run; of one that is not known the run, which is like no other."""
    unknown = experiment.maneuver in ("", UNNAMED)
    return experiment.name if unknown else experiment.maneuver


def white_noise(error: Array, values: Array) -> float:
    """Standard deviation of what in an error is independent from sample to sample.

    From third differences, which leave nothing of what is smooth, in their median, in which spikes
    count little; at least the rounding of the smallest step between two readings.
    """
    if error.size < 4:
        return 0.0
    # 20 = 1 + 9 + 9 + 1, and the median of a normal magnitude is 0.6745 standard deviations
    white = float(np.median(np.abs(np.diff(error, 3)))) / (0.6745 * np.sqrt(20.0))
    steps = np.abs(np.diff(values))
    steps = steps[steps > 0.0]
    rounding = float(steps.min()) / np.sqrt(12.0) if steps.size else 0.0
    return float(max(white, rounding))


def over_window(record: ChannelErrors, window: float) -> tuple[Array, float]:
    """Errors (n,) over a window about each sample, NaN at both ends, and their noise's variance.

    Of a position the slope of the straight line through it, of anything else the mean.
    """
    weights = window_weights(record, window)
    return windowed(record.error, weights), record.noise**2 * float(weights @ weights)


def window_weights(record: ChannelErrors, window: float) -> Array:
    """Odd number of weights of a slope, or of a mean, to be convolved with samples."""
    half = int(0.5 * window / record.step)
    if not record.is_position:
        return np.full(2 * half + 1, 1.0 / (2 * half + 1))
    offsets = np.arange(-max(half, 1), max(half, 1) + 1.0)
    return np.asarray(offsets[::-1] / (np.sum(offsets**2) * record.step))


def windowed(values: Array, weights: Array) -> Array:
    """(n,) weighted sums about each of (n,) samples, NaN if a part of the window is missing."""
    half = weights.size // 2
    sums = np.full(values.size, np.nan)
    if values.size > weights.size:
        # about the first sample: a position may begin far from 0
        from_first = _convolved(values - values[0], weights)
        sums[half : values.size - half] = from_first + values[0] * weights.sum()
    return sums


def _convolved(values: Array, weights: Array) -> Array:
    """(n - w + 1,) sums of values (n,) times weights (w,), where these overlap entirely.

    As scipy.signal.fftconvolve, whose package takes a second to load.
    """
    size = next_fast_len(values.size + weights.size - 1, real=True)
    product = rfft(values, size) * rfft(weights, size)
    return np.asarray(irfft(product, size)[weights.size - 1 : values.size])


def left_open_over(record: ChannelErrors, window: float, rows: NDArray[np.intp]) -> Array:
    """(m, s) errors that are left open over a window about some samples; s is 0 if none is."""
    if record.left_open is None or not record.left_open.size:
        return np.zeros((rows.size, 0))
    weights = window_weights(record, window)[::-1]
    half = weights.size // 2
    stretches = record.left_open[rows[:, None] + np.arange(-half, half + 1)]
    return np.asarray(np.einsum("w,mws->ms", weights, stretches))


def _rows_of(record: ChannelErrors, window: float, inside: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Samples about which windows next to each other lie, none of them at an end of the record."""
    half = window_weights(record, window).size // 2
    rows = np.flatnonzero(inside)
    rows = rows[(rows >= half) & (rows < record.signal.size - half)]
    return rows[:: max(int(window / record.step), 1)]


def classes_of(
    record: ChannelErrors, reach: float, largest: float
) -> dict[MotionClass, NDArray[np.bool_]]:
    """Samples of each class, by what the model itself does: known before a run is made.

    Parameters
    ----------
    record : ChannelErrors
    reach : float
        Range of the signal over all runs. [unit]
    largest : float
        Largest command of all runs.
    """
    near = 2 * int(NEAR / record.step) + 1
    fast = maximum_filter1d(np.abs(record.rate) > FAST * reach, near)
    commanded = maximum_filter1d(np.abs(record.command) > COMMANDED * largest, near)
    slow = np.abs(record.signal) < SMALL * reach
    return {"large": ~fast & ~slow, "small": ~fast & slow & commanded, "fast": fast}


class WindowCell(NamedTuple):
    """Windows of one class in one run, next to each other, over the range of the signal."""

    run: str
    maneuver: str
    held_out: bool
    motion: MotionClass
    squares: Array
    """(m,) squared errors less their noise. [1]"""
    noise: float
    """Variance of the noise in each. [1]"""
    terms: Array
    """(m, 3) of the variance function: 1, the signal's square, that of its rate. [1]"""
    left_open: Array
    """(m, s) errors that the numbers of the machine leave open, over the range. [1]"""


def cells_of(records: Iterable[ChannelErrors]) -> tuple[list[WindowCell], float]:
    """All windows, by run and class, and the range of what was measured. [unit]

    Goes through the records twice. Beside fitted runs, one that was held out counts with the range
    that is simulated: a dropout in its log must not widen what its error is divided by.
    """
    low, high, largest = np.inf, -np.inf, 0.0
    any_fitted = any(not record.held_out for record in records)
    for record in records:
        values = record.signal
        if not (any_fitted and record.held_out):
            values = windowed(record.measured, window_weights(record, WINDOWS["fast"]))
        low = min(low, float(np.nanmin(values, initial=np.inf)))
        high = max(high, float(np.nanmax(values, initial=-np.inf)))
        largest = max(largest, float(np.abs(record.command).max()))
    reach = high - low
    cells = list[WindowCell]()
    for record in records if reach > 0.0 else ():
        for motion, inside in classes_of(record, reach, largest).items():
            errors, noise = over_window(record, WINDOWS[motion])
            rows = np.flatnonzero(inside & np.isfinite(errors))
            rows = rows[:: max(int(WINDOWS[motion] / record.step), 1)]
            if rows.size < 2:
                continue
            rounded = windowed(record.rounding, window_weights(record, WINDOWS[motion]))
            noise = max(noise, float(np.mean(rounded[rows] ** 2)))
            squares = (errors[rows] ** 2 - noise) / reach**2
            terms = variance_terms(record.signal[rows] / reach, record.rate[rows] / reach)
            cells.append(
                WindowCell(
                    run=record.run,
                    maneuver=record.maneuver,
                    held_out=record.held_out,
                    motion=motion,
                    squares=squares,
                    noise=noise / reach**2,
                    terms=terms,
                    left_open=left_open_over(record, WINDOWS[motion], rows) / reach,
                )
            )
    return cells, max(reach, 0.0)


def variance_terms(signal: Array, rate: Array) -> Array:
    """(m, 3) terms of the variance function, of a signal and its change over the range. [1]"""
    return np.column_stack([np.ones(signal.size), signal**2, rate**2])


# --- the stated error -----------------------------------------------------------------------------


class ClassError(NamedTuple):
    """The stated error of one class of motion."""

    motion: MotionClass
    error: float
    """Root mean square that nine of ten new maneuvers do not exceed, over the range; never less
    than what runs that were held out show. [1]"""
    fitted: int
    """Fitted runs with such a motion."""
    held_out: int
    """Runs with such a motion that were held out."""
    left_open: float = 0.0
    """Part of the error that the numbers of the machine leave open in reference motions. [1]"""


class BeyondTests(NamedTuple):
    """What is left open of a motion that is faster than any test."""

    motion: str
    """Such as ``"a sine of 0.5 Hz"``."""
    error: float
    """Root mean square that it stays below with nine of ten, over the range. [1]"""


@dataclass(frozen=True)
class PredictionError(Result):
    """How far a prediction of one channel may be off in a new maneuver."""

    channel: str
    unit: str
    """Of the signal: of a position that of its speed."""
    reach: float
    """Range that was measured of the signal, of a position that of its speed. [unit]"""
    coefficients: tuple[float, float, float]
    """Of the variance of the error over the squared range: 1, (signal/range)², (its change within
    0.1 s / range)²."""
    classes: tuple[ClassError, ...]
    """Those that some run has."""

    of_position: bool = False
    """Whether the channel is a position, of which the speed is judged."""
    beyond: tuple[BeyondTests, ...] = ()
    """Of motions faster than any test; none if the tests are as fast, or nothing is left open."""

    @property
    def worst(self) -> ClassError:
        """The class with the largest error."""
        return max(self.classes, key=lambda stated: stated.error)

    @property
    def signal(self) -> str:
        """What is predicted, in words."""
        return f"speed from {self.channel}" if self.of_position else self.channel

    def squares(self, signal: Array, rate: Array) -> Array:
        """(n,) mean square that the model's own error does not exceed in nine of ten maneuvers.

        [unit²], for what is predicted and its rate of change, (n,) each, of a position those of its
        speed. [unit, unit/s]
        """
        terms = variance_terms(signal / self.reach, TIME * rate / self.reach)
        return np.asarray(self.reach**2 * (terms @ self.coefficients))


def prediction_errors(
    fit: Optimum | None,
    predicted: Sequence[RunQuality],
    unexplained: Collection[str] = (),
    motions: Mapping[str, Sequence[LeftOpen]] = MappingProxyType({}),
) -> tuple[PredictionError, ...]:
    """How far predictions of each channel may be off; channels that never move are left out.

    Parameters
    ----------
    fit : Optimum or None
        None for a drive that is only compared with runs.
    predicted : sequence of RunQuality
        Of runs that were held out, as `validation.predict` gives them.
    unexplained : collection of str
        Those of them that noise and discrepancy do not explain: the variance function is that of
        all others, as long as there are others.
    motions : mapping
        Of each channel what the numbers of the machine leave open in reference motions.

    Notes
    -----
    E e² = a₀ + a₁ s² + a₂ (0.1 s · ds/dt)², a ≥ 0, by quasi-likelihood (Davidian and Carroll 1987):
    non-negative least squares, weighted by the inverse of the squared mean. The logarithms of
    observed over fitted squares of the maneuvers have a mean m and a deviation d; a new one stays
    below exp(m + t d √(1 + 1/k)), the bound of a prediction. What the instrument's gain may be off
    is an error of the motion that no run of it shows. The square of what the posterior leaves open
    of reference motions of a class is added: tests say nothing of what they do not contain. Of a
    class the error is at least the one that
    n runs that were held out show, unexplained ones too: the ⌈0.9 (n + 1)⌉-th smallest, which a new
    one exceeds with a probability of a tenth at most, whatever the distribution (Vovk, Gammerman
    and Shafer 2005, section 2.2), and of fewer than ten the largest.
    """
    channels = fit.problem.channels if fit else [quality.channel for quality in predicted]
    qualities = [*(fit.qualities if fit else ()), *predicted]
    errors = list[PredictionError]()
    for name in dict.fromkeys(channels):
        measured = next(
            quality.experiment[name] for quality in qualities if quality.channel == name
        )
        cells, reach = cells_of(errors_of_runs(name, fit, predicted))
        if not cells:
            continue
        explained = [cell for cell in cells if cell.run not in unexplained]
        coefficients = bound_of_variance(explained or cells)
        coefficients[1] += measured.instrument.gain**2 / 3.0
        constant, by_signal, by_rate = coefficients.tolist()
        of_channel = motions.get(name, ())
        largest = max((_largest_command(part.record) for part in of_channel), default=0.0)
        errors.append(
            PredictionError(
                channel=name,
                unit=f"{measured.unit}/s" if measured.is_position else measured.unit,
                reach=reach,
                coefficients=(constant, by_signal, by_rate),
                classes=tuple(
                    _class_errors(cells, coefficients, _open_by_class(of_channel, reach, largest))
                ),
                of_position=measured.is_position,
                beyond=tuple(_beyond_tests(of_channel, reach)),
            )
        )
    return tuple(errors)


class LeftOpen(NamedTuple):
    """One channel of a motion, and what the numbers of the machine leave open of it."""

    record: ChannelErrors
    beyond: str = ""
    """The motion in words if it is faster than any test."""


def _largest_command(record: ChannelErrors) -> float:
    """Largest command of a record."""
    return float(np.abs(record.command).max())


def _open_by_class(
    motions: Sequence[LeftOpen], reach: float, largest: float
) -> dict[MotionClass, float]:
    """Mean square that is left open of the motions of each class, none faster than the tests."""
    windows = defaultdict[MotionClass, list[Array]](list)
    for part in motions:
        if part.beyond:
            continue
        for motion, inside in classes_of(part.record, reach, largest).items():
            rows = _rows_of(part.record, WINDOWS[motion], inside)
            windows[motion].append(left_open_over(part.record, WINDOWS[motion], rows) / reach)
    return {
        motion: mean_square_bound(np.vstack(parts), BOUND_LEVEL)
        for motion, parts in windows.items()
    }


def _beyond_tests(motions: Sequence[LeftOpen], reach: float) -> Iterator[BeyondTests]:
    """What is left open of the motions that are faster than any test."""
    for part in motions:
        if part.beyond:
            everywhere = np.ones(part.record.signal.size, np.bool_)
            rows = _rows_of(part.record, WINDOWS["fast"], everywhere)
            errors = left_open_over(part.record, WINDOWS["fast"], rows) / reach
            square = mean_square_bound(errors, BOUND_LEVEL)
            yield BeyondTests(part.beyond, float(np.sqrt(square)))


def _class_errors(
    cells: Sequence[WindowCell], coefficients: Array, left_open: Mapping[MotionClass, float]
) -> Iterator[ClassError]:
    """The stated error of each class of motion that some window has.

    `left_open` are mean squares of reference motions, by class.
    """
    for motion in get_args(MotionClass):
        of_class = [cell for cell in cells if cell.motion == motion]
        if of_class:
            terms = np.vstack([cell.terms for cell in of_class])
            square = left_open.get(motion, 0.0)
            modelled = float(np.sqrt(np.mean(terms @ coefficients) + square))
            yield ClassError(
                motion=motion,
                error=max(modelled, _shown_error(of_class)),
                fitted=sum(not cell.held_out for cell in of_class),
                held_out=sum(cell.held_out for cell in of_class),
                left_open=float(np.sqrt(square)),
            )


def _shown_error(cells: Iterable[WindowCell]) -> float:
    """Error that nine of ten runs that were held out do not exceed, of few the largest. [1]"""
    squares = sorted(max(float(cell.squares.mean()), 0.0) for cell in cells if cell.held_out)
    if not squares:
        return 0.0
    rank = min(ceil(BOUND_LEVEL * (len(squares) + 1)), len(squares))
    return float(np.sqrt(squares[rank - 1]))


def errors_of_runs(
    channel: str, fit: Optimum | None, predicted: Sequence[RunQuality]
) -> ErrorsOfRuns:
    """A channel of all runs, as if the maneuver of each had been left out, or held out.

    The linearised fit is computed if it is not there yet.
    """
    parts = list[tuple[RunQuality, Array | None, bool]]()
    if fit is not None and channel in fit.problem.channels:
        errors = _errors_left_out(fit)
        parts += [
            (quality, errors[quality.experiment.name, channel], False)
            for quality in fit.qualities
            if quality.channel == channel
        ]
    parts += [(quality, None, True) for quality in predicted if quality.channel == channel]
    return ErrorsOfRuns(tuple(parts))


@once_per_fit
def _errors_left_out(fit: Optimum) -> dict[tuple[str, str], Array]:
    """By run and channel the differences (n,) if the maneuver of the run had been left out."""
    maneuvers = {run.name: maneuver_of(run) for run in fit.problem.experiments}
    found = left_out(fit.linearised, maneuvers)
    return {(run.name, run.channel): errors for run, errors in found}


def variance_function(cells: Sequence[WindowCell]) -> Array:
    """(3,) coefficients of the mean squared error, over the squared range."""
    terms = np.vstack([cell.terms for cell in cells])
    squares = np.concatenate([cell.squares for cell in cells])
    noise = np.concatenate([np.full(cell.squares.size, cell.noise) for cell in cells])
    coefficients = np.array([max(float(squares.mean()), 1e-12), 0.0, 0.0])
    for _ in range(12):
        spread = np.maximum(terms @ coefficients, 1e-3 * coefficients.sum()) + noise + 1e-14
        coefficients = nnls(terms / spread[:, None], squares / spread)[0]
    # what the noise's own scatter leaves open is at least two standard errors of its mean
    coefficients[0] += 2.0 * float(np.sqrt(2.0 * np.mean(noise**2) / noise.size))
    return np.asarray(coefficients)


def bound_of_variance(cells: Sequence[WindowCell], level: float = BOUND_LEVEL) -> Array:
    """(3,) the same for the squared error that a new maneuver does not exceed.

    `level` is the probability of that.
    """
    coefficients = variance_function(cells)
    maneuvers = defaultdict[str, list[WindowCell]](list)
    for cell in cells:
        maneuvers[cell.maneuver].append(cell)
    ratios = np.array([log_ratio(of_maneuver, coefficients) for of_maneuver in maneuvers.values()])
    deviation, freedom = spread_of(ratios)
    bound = float(stdtrit(freedom, level)) * deviation * np.sqrt(1.0 + 1.0 / ratios.size)
    return coefficients * float(np.exp(ratios.mean() + bound))


def raised(prediction: PredictionError, reach: float, level: float) -> Array:
    """(3,) of a stated error, the coefficients for another probability, over another range.

    A fit does not keep the deviation of its maneuvers: the usual one stands for it.
    """
    coefficients = np.array(prediction.coefficients)
    coefficients[0] *= (prediction.reach / reach) ** 2
    further = float(stdtrit(WORTH, level) - stdtrit(WORTH, BOUND_LEVEL))
    return np.asarray(coefficients * np.exp(USUAL_SPREAD * further))


def log_ratio(
    cells: Sequence[WindowCell], coefficients: Array, level: float | None = None
) -> float:
    """Logarithm of the observed over the fitted squares of some windows.

    Observed are at least what the noise's own scatter leaves open. With a `level` the fitted ones
    contain what the numbers of the machine leave open with that probability.
    """
    fitted = sum(float(np.sum(cell.terms @ coefficients)) for cell in cells)
    if level is not None:
        fitted += sum(
            len(cell.left_open) * mean_square_bound(cell.left_open, level) for cell in cells
        )
    observed = sum(float(np.sum(cell.squares)) for cell in cells)
    noise = sum(cell.noise * cell.squares.size for cell in cells)
    count = sum(cell.squares.size for cell in cells)
    return float(np.log(max(observed, noise * np.sqrt(2.0 / count), 1e-300) / fitted))


def spread_of(ratios: Array) -> tuple[float, float]:
    """Standard deviation of logarithms of some maneuvers, and its degrees of freedom."""
    freedom = ratios.size - 1.0
    squares = float(np.sum((ratios - ratios.mean()) ** 2)) + WORTH * USUAL_SPREAD**2
    return float(np.sqrt(squares / (freedom + WORTH))), freedom + WORTH
