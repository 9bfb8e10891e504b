"""A command's record prepared for recognition: its rest, its noise, what counts as a change."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import InputError

Array = NDArray[np.float64]

SURE = 6.0
"""Standard deviations that noise exceeds by chance less than once in a hundred million samples."""
SMALLEST_VOLTS = 0.1
"""Smallest voltage that counts as a command: 1 % of full scale. [V]"""
ENOUGH = 20_000
"""Samples that a curve is fitted to; more do not make it better where noise is small."""


@dataclass(frozen=True, eq=False)
class Trace:
    """A record about its rest."""

    time: Array
    """Increasing stamps. [s]"""
    values: Array
    """Input less its value at rest. [unit]"""
    rest: float
    """Input at rest. [unit]"""
    rest_error: float
    """Standard error of `rest`, 0 where it was given. [unit]"""
    noise: float
    """Standard deviation from sample to sample. [unit]"""
    least: float
    """Changes up to this are no command. [unit]"""
    peak: float
    """Largest magnitude of `values`. [unit]"""
    spacing: float
    """Median distance of the stamps. [s]"""

    @property
    def idle(self) -> bool:
        """Whether nothing is commanded."""
        return self.peak <= self.least

    @property
    def tolerance(self) -> float:
        """Deviation of a single sample that noise does not explain. [unit]"""
        return max(SURE * self.noise, 0.01 * self.peak)

    @property
    def quality(self) -> float:
        """RMS of a residual up to which a manoeuvre counts as recognised. [unit]

        One percent of the peak, and noise with a margin for its estimate.
        """
        return float(np.hypot(0.01 * self.peak, 1.5 * self.noise))

    def first(self, mask: NDArray[np.bool_], start: int) -> int:
        """Index of the first true element of a mask that begins at `start`, or the length."""
        return start + int(mask.argmax()) if mask.any() else self.time.size

    def picked(self, start: int, stop: int) -> NDArray[np.intp]:
        """Indices from `start` to before `stop`: all, or `ENOUGH` spread unevenly over them.

        Evenly picked ones would hide what happens between two, at their own rhythm.
        """
        if stop - start <= ENOUGH:
            return np.arange(start, stop)
        golden = 0.6180339887498949
        steps = np.arange(ENOUGH)
        share = (steps + np.mod(steps * golden, 1.0)) / ENOUGH
        chosen: NDArray[np.intp] = start + (share * (stop - start)).astype(np.intp)
        return chosen


def trace_of(
    time: ArrayLike, voltage: ArrayLike, unit: str, rest: float | None, smallest: float | None
) -> Trace:
    """Check a record and find its rest and noise; the arguments are those of `recognise`.

    Raises
    ------
    InputError
        If the columns are not two of one length, hold what is no number, or the time does not
        increase.
    """
    stamps, values = _row(time, "time"), _row(voltage, "input")
    if stamps.size != values.size:
        raise InputError(f"There are {stamps.size} time stamps for {values.size} input samples.")
    steps = np.diff(stamps)
    if steps.size and steps.min() <= 0.0:
        late = int(np.argmax(steps <= 0.0)) + 1
        raise InputError(
            f"The time must increase, but row {late} (the first is 0) has {stamps[late]:g} s "
            f"after {stamps[late - 1]:g} s."
        )
    noise = _noise(stamps, values)
    zero, error = _rest(values, noise) if rest is None else (float(rest), 0.0)
    values = values - zero
    peak = float(max(values.max(), -values.min()))
    if smallest is None:
        smallest = SMALLEST_VOLTS if unit == "V" else 0.0
    # more noise than that may well be what is commanded
    least = max(smallest, min(SURE * noise, SURE * smallest), 1e-12 * abs(zero))
    spacing = float(np.median(steps)) if steps.size else 0.0
    return Trace(stamps, values, zero, error, min(noise, 0.05 * peak), least, peak, spacing)


def _row(values: ArrayLike, what: str) -> Array:
    data = np.asarray(values, dtype=np.float64)
    if data.ndim != 1 or data.size == 0:
        raise InputError(f"The {what} must be one row of numbers, not of shape {data.shape}.")
    # one pass: a sum is finite if and only if no sample is NaN or infinite, overflow apart
    if not np.isfinite(data.sum()):
        wrong = np.flatnonzero(~np.isfinite(data))
        if wrong.size:
            raise InputError(
                f"The {what} is {data[wrong[0]]} in row {wrong[0]} (the first is 0); leave out the "
                "rows without a number."
            )
    return data


def _noise(time: Array, values: Array) -> float:
    """Standard deviation of what a straight line between both neighbours does not explain.

    The median leaves jumps out; the curvature of a coarsely sampled sine counts as noise. The steps
    of a converter count as well: where they hide the noise, the median is zero.
    """
    if values.size < 3:
        return 0.0
    middle = np.unique(np.linspace(1, values.size - 2, 50_000).astype(np.intp))
    before, after = time[middle] - time[middle - 1], time[middle + 1] - time[middle]
    share = before / (before + after)
    line = values[middle - 1] + share * (values[middle + 1] - values[middle - 1])
    deviation = (values[middle] - line) / np.sqrt(1.0 + share**2 + (1.0 - share) ** 2)
    changes = np.abs(values[middle] - values[middle - 1])
    smallest = float(np.min(changes, where=changes > 0.0, initial=np.inf))
    # of a command without noise the smallest change is no converter's step, but a part of it
    quantum = min(0.3 * smallest, 0.002 * float(np.ptp(values)))
    return max(float(np.median(np.abs(deviation))) / 0.6745, quantum)


def _rest(values: Array, noise: float) -> tuple[float, float]:
    """Mean of what the record begins with, as long as it stays there, and its standard error."""
    zero, samples = float(np.median(values[:3])), 3
    for _ in range(2):
        away = np.abs(values - zero) > SURE * noise + 1e-12 * abs(zero)
        stays = int(away.argmax()) if away.any() else values.size
        # the second half may hold the beginning of a slow ramp
        samples = max(stays // 2, 3)
        zero = float(values[:samples].mean())
    return zero, noise / float(np.sqrt(samples))
