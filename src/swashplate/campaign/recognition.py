"""Maneuvers recognised from nothing but the command that was logged.

`recognise` says which of the package's maneuvers a record is (rest, step, stairs, ramp or sine),
with its numbers, or that it is none of them: `UNNAMED`. It never guesses. The name decides which
windows of a campaign file hold in a run, which runs are dealt into which fold, and what a table of
errors puts together.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import floor, log10
from typing import Literal, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.campaign.samples import increasing, signal
from swashplate.maneuvers.pieces import row

Array = NDArray[np.float64]
Kind = Literal["rest", "step", "stairs", "ramp", "sine", "unnamed"]

UNNAMED = "unnamed motion"
"""What a record is called that is none of the maneuvers: a joystick, a chirp, several in a row."""

SURE = 6.0
"""Standard deviations that noise exceeds by chance less than once in a hundred million samples."""
SMALLEST_VOLTS = 0.1
"""Smallest voltage that counts as a command: 1 % of full scale. [V]"""
LARGEST_ZERO = 0.5
"""Reading at rest beyond which it is no zero error of an instrument. [V]"""
SHORTEST = 16
"""Samples below which nothing is told apart."""
JUMP_SAMPLES, JUMP_SECONDS = 3, 0.03
"""A jump takes so many samples or seconds at most, whichever is more."""
SMALLEST_JUMP = 0.05
"""Smallest jump, as a share of the largest level. [1]"""
MOST_JUMPS = 200
"""A record with more jumps is not looked at as stairs."""
HELD = 5
"""Samples for which a level is held at least, or that a rise has between 10 % and 80 % of it."""
SHORTEST_HOLD = 0.25
"""For so long a ramp stays at its limit; a shorter stay is the crest of its return. [s]"""
BAND = 0.3
"""A sine's crossing is a change between +BAND and -BAND of the peak. [1]"""
EVEN = 0.15
"""How much half a period may differ from the median half period. [1]"""
COARSEST = 6.0
"""Samples in a period of a sine, at least."""


@dataclass(frozen=True)
class Recognised:
    """The maneuver of a record. Numbers are rounded to what the data support.

    Levels and amplitudes in the name are relative to the input at rest, with their sign in the
    record.
    """

    name: str
    """As `swashplate.maneuvers` names it, ``"sine 6.5 V 0.1 Hz"``; or `UNNAMED`."""
    frequency: float | None = None
    """Frequency of a sine. [Hz]"""

    @property
    def kind(self) -> Kind:
        """The first word of its name."""
        return cast("Kind", self.name.split()[0])


def recognise(time: ArrayLike, voltage: ArrayLike, *, unit: str = "V") -> Recognised:
    """Name of the maneuver of a record, from the command alone.

    Parameters
    ----------
    time : (n,) array_like
        Increasing stamps, even or not. [s]
    voltage : (n,) array_like
        The command, with the noise and steps of its instrument. [unit]
    unit : str
        Its unit, for the name. All levels are relative to what the record begins with, which in V
        must be within 0.5 V of zero. Changes of less than 0.1 V are no command, in other units any.

    Returns
    -------
    Recognised
        `UNNAMED` wherever none of the maneuvers fits: its RMS over the record must be below 1 % of
        the peak, noise apart, and below three times that in every fiftieth part.

    Raises
    ------
    InputError
        If the columns differ in length, hold what is no number, or the time does not increase.

    Notes
    -----
    Step, stairs, ramp and sine are those of `swashplate.maneuvers`. How they return to rest is free
    as long as they do, within three quarters of the time that the command took. A sine may begin at
    any phase, but has a whole period at least, about rest.
    """
    trace = _trace(time, voltage, unit)
    if unit == "V" and abs(trace.rest) > LARGEST_ZERO:
        return Recognised(UNNAMED)
    if trace.peak <= trace.least:
        return Recognised("rest")
    if trace.time.size >= SHORTEST:
        for find in (_stairs, _ramp, _sine):
            found = find(trace, unit)
            if found is not None:
                return found
    return Recognised(UNNAMED)


def roundest(value: float, uncertainty: float) -> float:
    """The number of fewest significant digits within `uncertainty` of `value`.

    Of several with as few digits it is the nearest: 0.09997 within 0.0001 is 0.1, 6.4935 within
    0.013 is 6.5. Both are in the same unit, the uncertainty is not negative.
    """
    if abs(value) <= uncertainty:
        return 0.0
    exponent = floor(log10(abs(value)))
    for digits in range(-exponent, 17 - exponent):
        candidate = round(value, digits)
        if abs(candidate - value) <= uncertainty:
            return candidate
    return value


# --- the record about its rest --------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Trace:
    """A record about its rest."""

    time: Array
    """Increasing stamps. [s]"""
    values: Array
    """Input less its value at rest. [unit]"""
    rest: float
    rest_error: float
    """Standard error of `rest`. [unit]"""
    noise: float
    """Standard deviation from sample to sample. [unit]"""
    least: float
    """Changes up to this are no command. [unit]"""
    peak: float
    """Largest magnitude of `values`. [unit]"""
    spacing: float
    """Median distance of the stamps. [s]"""

    @property
    def tolerance(self) -> float:
        """Deviation of a single sample that noise does not explain. [unit]"""
        return max(SURE * self.noise, 0.01 * self.peak)

    @property
    def jump(self) -> int:
        """Samples that a jump may take."""
        return max(JUMP_SAMPLES, round(JUMP_SECONDS / self.spacing))

    def first(self, mask: NDArray[np.bool_], start: int) -> int:
        """Index of the first true element of a mask that begins at `start`, or the length."""
        return start + int(mask.argmax()) if mask.any() else self.time.size


def _trace(time: ArrayLike, voltage: ArrayLike, unit: str) -> _Trace:
    stamps = increasing(time) if np.size(time) > 1 else row("time", time)
    values = signal("input", voltage, stamps.size)
    noise = _noise(stamps, values)
    # the mean of what the record begins with, as long as it stays there
    zero, count = float(np.median(values[:3])), 3
    for _ in range(2):
        away = np.abs(values - zero) > SURE * noise + 1e-12 * abs(zero)
        stays = int(away.argmax()) if away.any() else values.size
        # the second half may hold the beginning of a slow ramp
        count = max(stays // 2, 3)
        zero = float(values[:count].mean())
    values = values - zero
    peak = float(np.abs(values).max())
    smallest = SMALLEST_VOLTS if unit == "V" else 0.0
    # more noise than that may well be what is commanded
    least = max(smallest, min(SURE * noise, SURE * smallest), 1e-12 * abs(zero))
    spacing = float(np.median(np.diff(stamps))) if stamps.size > 1 else 0.0
    error = noise / count**0.5
    return _Trace(stamps, values, zero, error, min(noise, 0.05 * peak), least, peak, spacing)


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


# --- how a command ends, and whether a model of it will do ----------------------------------------


def _ending(trace: _Trace, first: int, began: float) -> tuple[int, int] | None:
    """Samples `first` to before the second number are neither command nor rest.

    `first` is the first sample off the curve of a command that began at an instant [s]. It falls to
    rest at once or returns to it on a curve of its own; None of what does neither.
    """
    size = trace.time.size
    moving = np.flatnonzero(np.abs(trace.values[first:]) > trace.tolerance)
    last = first + (int(moving[-1]) + 1 if moving.size else 0)
    if first >= size or (last - first < trace.jump and last < size):
        return first, last
    start, stop = float(trace.time[first]), float(trace.time[min(last, size - 1)])
    if abs(trace.values[-1]) > max(trace.tolerance, 0.05 * trace.peak):
        return None
    tail = trace.values[first:last]
    turns = np.count_nonzero(np.abs(np.diff(np.sign(tail[np.abs(tail) > trace.tolerance]))) > 1)
    return None if stop - start > 0.75 * (start - began) or turns > 1 else (first, last)


def _fits(
    trace: _Trace, model: Array, ending: tuple[int, int], jumps: Iterable[tuple[int, int]] = ()
) -> bool:
    """Whether the RMS of record less model is small, as a whole and in every part."""
    kept = np.ones(model.size, dtype=np.bool_)
    if ending[0] < model.size:
        model[ending[1] :] = 0.0
        kept[max(ending[0] - 1, 0) : ending[1]] = False
    for before, after in jumps:
        kept[before:after] = False
    squares = (trace.values - model)[kept] ** 2
    # one percent of the peak, and noise with a margin for its estimate
    quality = float(np.hypot(0.01 * trace.peak, 1.5 * trace.noise))
    edges = np.linspace(0, squares.size, max(min(50, squares.size // 8), 1), endpoint=False)
    starts = edges.astype(np.intp)
    means = np.add.reduceat(squares, starts) / np.diff(starts, append=squares.size)
    return bool(squares.mean() <= quality**2 and means.max() <= (3.0 * quality) ** 2)


# --- steps and stairs -----------------------------------------------------------------------------


def _stairs(trace: _Trace, unit: str) -> Recognised | None:
    """Levels that are held, with jumps between them, None of other records."""
    found = _levels(trace)
    if found is None:
        return None
    levels, ending = found
    model = np.zeros_like(trace.values)
    # of the jump to the first level it is known when it is complete
    jumps, before = [], max(levels[0][0] - trace.jump, 0)
    shown = []
    for first, last in levels:
        height = float(trace.values[first:last].mean())
        model[first:last] = height
        jumps.append((before, first))
        before = last
        error = float(np.hypot(trace.noise / (last - first) ** 0.5, trace.rest_error))
        shown.append(roundest(height, max(3.0 * error, 0.002 * trace.peak)))
    fell = ending[0] == ending[1] < trace.time.size
    if not _fits(trace, model, ending, [*jumps, (before, ending[0])] if fell else jumps):
        return None
    if len(levels) == 1:
        return Recognised(f"step {shown[0]:+g} {unit}")
    shown += [0.0] * (ending[0] < trace.time.size and ending[1] - ending[0] < trace.jump)
    return Recognised(f"stairs {'/'.join(f'{height:g}' for height in shown)} {unit}")


def _levels(trace: _Trace) -> tuple[list[tuple[int, int]], tuple[int, int]] | None:
    """Samples in which a level other than rest is held, from first to before last; the ending."""
    values, least = trace.values, max(2.0 * trace.tolerance, SMALLEST_JUMP * trace.peak)
    jumps = np.flatnonzero(np.abs(np.diff(values)) > least)
    groups = np.split(jumps, np.flatnonzero(np.diff(jumps) > HELD) + 1)
    if jumps.size == 0 or len(groups) > MOST_JUMPS:
        return None
    if any(group[-1] - group[0] >= trace.jump for group in groups):
        return None
    firsts = [0, *(int(group[-1]) + 1 for group in groups)]
    lasts = [*(int(group[0]) + 1 for group in groups), values.size]
    levels: list[tuple[int, int]] = []
    for bounds in zip(firsts, lasts, strict=True):
        first, last = bounds
        final, beside = last == values.size, min(2, (last - first) // 4)
        # without the samples beside its jumps, which may be taken while they last
        first, last = first + beside * (first > 0), last - beside * (not final)
        sure = np.median(values[first : first + max(HELD, (last - first) // 10)])
        leaves = min(trace.first(np.abs(values[first:last] - sure) > trace.tolerance, first), last)
        if leaves - first < (1 if final else HELD):
            return None
        resting = abs(float(values[first:leaves].mean())) <= trace.tolerance
        if leaves < last:
            begun = float(trace.time[levels[0][0] if levels else first])
            ending = None if resting or not final else _ending(trace, leaves, begun)
            if ending is None or ending[0] - first < HELD:
                return None
            return [*levels, (first, leaves)], ending
        if final and resting:
            return (levels, (first, first)) if levels else None
        if levels or not resting:
            levels.append((first, leaves))
    return levels, (values.size, values.size)


# --- ramps ----------------------------------------------------------------------------------------


def _ramp(trace: _Trace, unit: str) -> Recognised | None:
    """A straight rise from rest, perhaps to a level that is held, None of other records."""
    time = trace.time
    values = trace.values * np.sign(trace.values[np.abs(trace.values).argmax()])
    low, high = (int((values >= share * trace.peak).argmax()) for share in (0.1, 0.8))
    if high - low < HELD or time[high] - time[low] < 0.1:
        return None
    leaves = high
    for _ in range(2):  # once more with all that lies on the first line
        slope, start, error = _line(trace, low, leaves)
        if slope == 0.0 or not time[0] - trace.spacing <= start < time[low]:
            return None
        line = slope * np.maximum(time - start, 0.0)
        leaves = trace.first(np.abs(trace.values[low:] - line[low:]) > trace.tolerance, low)
        if leaves < high:
            return None
    ending = _ending(trace, leaves, start)
    near = trace.values[leaves + 2 : leaves + 2 + HELD]
    if (ending is None or ending[1] - ending[0] >= trace.jump) and near.size == HELD:
        away = np.abs(trace.values[leaves + 2 :] - np.median(near)) > trace.tolerance
        stops = trace.first(away, leaves + 2)
        if time[stops - 1] - time[leaves] >= SHORTEST_HOLD:
            limit = float(trace.values[leaves + 2 : stops].mean())
            ending = _ending(trace, stops, start)
            line = np.minimum(line, limit) if limit > 0.0 else np.maximum(line, limit)
    if ending is None or not _fits(trace, line, ending):
        return None
    shown = roundest(slope, max(3.0 * error, 0.002 * abs(slope)))
    return Recognised(f"ramp {shown:+g} {unit}/s")


def _line(trace: _Trace, first: int, last: int) -> tuple[float, float, float]:
    """Slope [unit/s], instant of zero [s] and the slope's standard error, by least squares."""
    time, values = trace.time[first:last], trace.values[first:last]
    middle = time.mean()
    spread = float(((time - middle) ** 2).sum())
    slope = float(((time - middle) @ values) / spread)
    start = float(middle - values.mean() / slope) if slope else float(middle)
    return slope, start, trace.noise / spread**0.5


# --- sines ----------------------------------------------------------------------------------------


def _tone(time: Array, amplitude: float, crossing: float, mean: float, omega: float) -> Array:
    """A sine [unit] by an instant of an upward crossing of its mean [s] and omega [rad/s]."""
    return np.asarray(mean + amplitude * np.sin(omega * (time - crossing)))


def _sine(trace: _Trace, unit: str) -> Recognised | None:
    """One frequency, at least a whole period of it, None of other records."""
    from scipy.optimize import curve_fit

    guess = _guessed(trace)
    if guess is None:
        return None
    numbers, until = guess
    first = trace.first(np.abs(trace.values) > trace.tolerance, 0)
    certain = leaves = int(np.searchsorted(trace.time, until))
    if certain - first < COARSEST:
        return None
    for again in (True, False):  # once more with all that lies on the first tone
        time, values = trace.time[first:leaves], trace.values[first:leaves]
        # a crossing in the middle hardly correlates with the frequency
        half = np.pi / numbers[3]
        turns = 2 * round((0.5 * float(time[0] + time[-1]) - numbers[1]) / (2.0 * half))
        numbers[1] += turns * half
        try:
            numbers, covariance = curve_fit(_tone, time, values, numbers)
        except RuntimeError:
            return None
        model = _tone(trace.time, *numbers)
        if again:
            away = np.abs(trace.values - model)[first:] > trace.tolerance
            leaves = trace.first(away, first)
            if leaves < certain:
                return None
    amplitude, crossing, mean, omega = map(float, numbers)
    size = abs(amplitude)
    # so long it takes from the crossing at which it begins to the tolerance
    hidden = np.arcsin(min(trace.tolerance / size, 1.0)) / omega if first else 0.0
    start = float(trace.time[first]) - hidden
    ending = _ending(trace, leaves, start)
    model[:first] = 0.0
    whole = float(trace.time[min(leaves, trace.time.size - 1)]) - start > 0.99 * 2.0 * np.pi / omega
    centred = not first or abs(mean) <= max(0.02 * size, trace.noise)
    if not (whole and centred) or ending is None or not _fits(trace, model, ending):
        return None
    hertz = omega / (2.0 * np.pi)
    error = float(np.sqrt(covariance[3, 3])) / (2.0 * np.pi)
    frequency = roundest(hertz, max(3.0 * error, 0.001 * hertz))
    rises = amplitude * float(np.cos(omega * (start - crossing)))
    shown = roundest(size if rises > -1e-9 * size else -size, 0.002 * size)
    return Recognised(f"sine {shown:g} {unit} {frequency:g} Hz", frequency)


def _guessed(trace: _Trace) -> tuple[list[float], float] | None:
    """Numbers of a tone by the changes of sign, and the instant up to which they are a sine's."""
    beyond = np.flatnonzero(np.abs(trace.values) > BAND * trace.peak)
    changes = np.flatnonzero(np.diff(np.signbit(trace.values[beyond])))
    if changes.size < 2:
        return None
    before, after = beyond[changes], beyond[changes + 1]
    crossings = 0.5 * (trace.time[before] + trace.time[after])
    halves = np.diff(crossings)
    half = float(np.median(halves))
    uneven = np.abs(halves - half) > EVEN * half
    regular = int(uneven.argmax()) if uneven.any() else halves.size
    if regular < max(halves.size - 1, 1) or 2.0 * half < COARSEST * trace.spacing:
        return None
    # the last may be a part of the return
    even = crossings[: min(regular + 1, max(crossings.size - 1, 2))]
    half, first = np.polynomial.Polynomial.fit(np.arange(even.size), even, 1).convert().coef[::-1]
    sign = 1.0 if trace.values[after[0]] > 0.0 else -1.0
    return [sign * trace.peak, float(first), 0.0, float(np.pi / half)], float(even[-1])
