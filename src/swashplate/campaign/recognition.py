"""Maneuvers recognised from nothing but the command that was logged.

`recognise` says which of the package's maneuvers a record is (rest, step, stairs, ramp or sine),
with its numbers, or that it is none of them: `UNNAMED`. It never guesses. The name decides which
windows of a campaign file hold in a run, which runs are dealt into which fold, and what a table of
errors puts together.
"""

from __future__ import annotations

from math import floor, log10
from typing import Literal, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.campaign.samples import increasing, signal
from swashplate.maneuvers import row

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Kind = Literal["rest", "step", "stairs", "ramp", "sine", "unnamed"]

UNNAMED = "unnamed motion"
"""Name of a record that is none of the maneuvers: a joystick, a chirp, several in a row."""
SURE = 6.0
"""Standard deviations that noise exceeds by chance less than once in a hundred million samples."""
SMALLEST_VOLTS = 0.1
"""Smallest voltage that counts as a command: 1 % of full scale. [V]"""
LARGEST_ZERO = 0.5
"""Reading at rest beyond which it is not a zero error of an instrument. [V]"""
SHORTEST = 16
"""Samples below which nothing can be distinguished."""
FEWEST_HELD = 5
"""Samples for which a level is held at least, or that a rise has between 10 % and 80 % of it."""


class Recognised(NamedTuple):
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


class _Record(NamedTuple):
    """A record relative to its value at rest."""

    time: Array
    values: Array
    unit: str
    noise: float
    """Standard deviation from sample to sample. [unit]"""
    tolerance: float
    """Deviation of a single sample that noise does not explain. [unit]"""
    peak: float
    jump: int
    """Samples that a jump may take."""

    def leaves(self, model: Array, first: int) -> int:
        """The first sample from `first` on that is off a model, or the end of the record."""
        off = np.abs(self.values[first:] - model[first:]) > self.tolerance
        return first + (int(off.argmax()) if off.any() else off.size)


class _Candidate(NamedTuple):
    """A maneuver that a record may be."""

    name: str
    model: Array
    """Its curve, up to the sample at which the return to rest begins. [unit]"""
    leaves: int
    """Index of that sample."""
    began: float
    """When the command leaves rest. [s]"""
    jumps: Mask | None = None
    """Samples within jumps, of which nothing is known."""
    frequency: float | None = None


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
        must be within 0.5 V of zero. In V, changes of less than 0.1 V are not a command.

    Returns
    -------
    Recognised
        `UNNAMED` wherever none of the maneuvers fits: its RMS over the record must be below 1 % of
        the peak, noise apart, and below three times that in every fiftieth part.

    Raises
    ------
    InputError
        If the columns differ in length, hold what is not a number, or the time does not increase.

    Notes
    -----
    Step, stairs, ramp and sine are those of `swashplate.maneuvers`. How they return to rest is free
    as long as they do, within three quarters of the time that the command took. A sine may begin at
    any phase, but has a whole period at least, about rest.
    """
    stamps = increasing(time) if np.size(time) > 1 else row("time", time)
    values = signal("input", voltage, stamps.size)
    noise = _noise(stamps, values)
    zero = _value_at_rest(values, noise)
    peak = float(np.abs(values - zero).max())
    smallest = SMALLEST_VOLTS if unit == "V" else 0.0
    if unit == "V" and abs(zero) > LARGEST_ZERO:
        return Recognised(UNNAMED)
    # more noise than that may well be what is commanded
    if peak <= max(smallest, min(SURE * noise, SURE * smallest), 1e-12 * abs(zero)):
        return Recognised("rest")
    if stamps.size >= SHORTEST:
        noise = min(noise, 0.05 * peak)
        jump = max(3, round(0.03 / float(np.median(np.diff(stamps)))))
        tolerance = max(SURE * noise, 0.01 * peak)
        record = _Record(
            time=stamps,
            values=values - zero,
            unit=unit,
            noise=noise,
            tolerance=tolerance,
            peak=peak,
            jump=jump,
        )
        for recognise_shape in (_stairs, _ramp, _sine):
            shape = recognise_shape(record)
            if shape is not None and _fits(record, shape):
                return Recognised(shape.name, shape.frequency)
    return Recognised(UNNAMED)


def _value_at_rest(values: Array, noise: float) -> float:
    """Mean of the beginning of a record, as long as it stays there."""
    zero = float(np.median(values[:3]))
    for _ in range(2):
        away = np.abs(values - zero) > SURE * noise + 1e-12 * abs(zero)
        resting = int(away.argmax()) if away.any() else away.size
        # the second half may hold the beginning of a slow ramp
        zero = float(values[: max(resting // 2, 3)].mean())
    return zero


def _fewest_digits(value: float, uncertainty: float) -> float:
    """The number of fewest significant digits within `uncertainty` of `value`, the nearest of such.

    0.09997 within 0.0001 is 0.1, 6.4935 within 0.013 is 6.5.
    """
    if abs(value) <= uncertainty:
        return 0.0
    exponent = floor(log10(abs(value)))
    tried = (round(value, digits) for digits in range(-exponent, 17 - exponent))
    return next((candidate for candidate in tried if abs(candidate - value) <= uncertainty), value)


def _noise(time: Array, values: Array) -> float:
    """Standard deviation of samples from the straight line between both neighbours.

    The median leaves jumps out; the curvature of a coarsely sampled sine counts as noise. The steps
    of a converter count as well: where they hide the noise, the median is zero.
    """
    if values.size < 3:
        return 0.0
    at = np.unique(np.linspace(1, values.size - 2, 50_000).astype(np.intp))
    share = (time[at] - time[at - 1]) / (time[at + 1] - time[at - 1])
    line = values[at - 1] + share * (values[at + 1] - values[at - 1])
    deviation = (values[at] - line) / np.sqrt(1.0 + share**2 + (1.0 - share) ** 2)
    changes = np.abs(values[at] - values[at - 1])
    smallest = float(np.min(changes, where=changes > 0.0, initial=np.inf))
    # of a command without noise the smallest change is not a converter's step, but a part of it
    quantum = min(0.3 * smallest, 0.002 * float(np.ptp(values)))
    return max(float(np.median(np.abs(deviation))) / 0.6745, quantum)


def _fits(record: _Record, shape: _Candidate) -> bool:
    """Whether a record goes back to rest, and the RMS of its rest less the model is small.

    The command either falls to rest from one sample to the next or returns to it on a curve.
    """
    values, first = record.values, shape.leaves
    moving = np.flatnonzero(np.abs(values[first:]) > record.tolerance)
    last = first + (int(moving[-1]) + 1 if moving.size else 0)
    away_from_jumps = np.ones(values.size, np.bool_) if shape.jumps is None else ~shape.jumps
    if first < values.size:
        is_curve = last - first >= record.jump or last == values.size
        if is_curve and not _returns(record, shape.began, first, last):
            return False
        shape.model[last:] = 0.0
        away_from_jumps[max(first - 1, 0) : last] = False
    squares = (values - shape.model)[away_from_jumps] ** 2
    # one percent of the peak, and noise with a margin for its estimate
    quality = float(np.hypot(0.01 * record.peak, 1.5 * record.noise))
    stretches = np.array_split(squares, max(min(50, squares.size // 8), 1))
    worst = max(float(part.mean()) for part in stretches)
    return bool(squares.mean() <= quality**2 and worst <= (3.0 * quality) ** 2)


def _returns(record: _Record, began: float, first: int, last: int) -> bool:
    """Whether a curve from one sample to before another ends at rest, soon and with one overshoot.

    Soon is within three quarters of the time since the command began [s].
    """
    time, values = record.time, record.values
    start, stop = float(time[first]), float(time[min(last, values.size - 1)])
    curve = values[first:last]
    signs = np.sign(curve[np.abs(curve) > record.tolerance])
    reversals = np.count_nonzero(np.abs(np.diff(signs)) > 1)
    ends_at_rest = abs(values[-1]) <= max(record.tolerance, 0.05 * record.peak)
    return bool(ends_at_rest and stop - start <= 0.75 * (start - began) and reversals <= 1)


def _stairs(record: _Record) -> _Candidate | None:
    """Levels that are held, with jumps of 5 % of the largest or more between them."""
    values, size = record.values, record.values.size
    heights = list[float]()
    least = max(2.0 * record.tolerance, 0.05 * record.peak)
    jumps = np.flatnonzero(np.abs(np.diff(values)) > least)
    groups = np.split(jumps, np.flatnonzero(np.diff(jumps) > FEWEST_HELD) + 1)
    # with so many jumps it is not stairs
    if not jumps.size or len(groups) > 200 or any(np.ptp(group) >= record.jump for group in groups):
        return None
    model = np.zeros(size)
    within_jumps = np.ones(size, np.bool_)
    began = 0.0
    firsts = [0, *(int(group[-1]) + 1 for group in groups)]
    lasts = [*(int(group[0]) + 1 for group in groups), size]
    for first, last in zip(firsts, lasts, strict=True):
        # without the samples next to its jumps, which may be taken while they last
        next_to_jump = min(2, (last - first) // 4)
        if first > 0:
            first += next_to_jump
        if last < size:
            last -= next_to_jump
        level_samples = values[first:last]
        usual = np.median(level_samples[: max(FEWEST_HELD, level_samples.size // 10)])
        level_samples = level_samples[np.abs(level_samples - usual) <= record.tolerance]
        if level_samples.size < (FEWEST_HELD if last < size else 1):
            return None
        level = float(level_samples.mean())
        within_jumps[first:last] = False
        resting = abs(level) <= record.tolerance
        if resting and not heights:
            # of the jump to the first level it is known when it is complete
            within_jumps[max(last - record.jump, 0) : last] = True
            continue
        if not heights:
            began = float(record.time[first])
        model[first:last] = 0.0 if resting else level
        error = record.noise * (1.0 / level_samples.size + 2.0 / firsts[1]) ** 0.5
        heights.append(_fewest_digits(level, max(3.0 * error, 0.002 * record.peak)))
    if not heights:
        return None
    leaves = record.leaves(np.where(within_jumps, values, model), 0)
    # a level that is left is the last one, which is not a rest
    if leaves < size and (leaves < firsts[-1] + FEWEST_HELD or resting):
        return None
    name = f"stairs {'/'.join(f'{height:g}' for height in heights)} {record.unit}"
    if len(heights) == 1 or (len(heights) == 2 and resting and not heights[1]):
        name = f"step {heights[0]:+g} {record.unit}"
    end = firsts[-1] + next_to_jump if resting else size
    return _Candidate(name, model, min(leaves, end), began, within_jumps)


def _ramp(record: _Record) -> _Candidate | None:
    """A straight rise from rest, perhaps to a level that is held."""
    time, values = record.time, record.values
    rising = values * np.sign(values[np.abs(values).argmax()])
    low = int((rising >= 0.1 * record.peak).argmax())
    high = int((rising >= 0.8 * record.peak).argmax())
    if high - low < FEWEST_HELD or time[high] - time[low] < 0.1:
        return None
    leaves = high
    for _ in range(2):  # once more with all that lies on the first line
        middle = float(time[low:leaves].mean())
        since = time[low:leaves] - middle
        slope, height = map(float, np.polyfit(since, values[low:leaves], 1))
        start = middle - height / slope if slope else np.inf
        if not 2.0 * time[0] - time[1] <= start < time[low]:
            return None
        line = slope * np.maximum(time - start, 0.0)
        leaves = record.leaves(line, low)
        if leaves < high:
            return None
    near = values[leaves + 2 : leaves + 2 + FEWEST_HELD]
    level = float(np.median(near)) if near.size == FEWEST_HELD else 0.0
    if abs(level) > 0.5 * record.peak:
        stops = record.leaves(np.full(values.size, level), leaves + 2)
        # a shorter stay at the limit is the crest of its return
        if time[stops - 1] - time[leaves] >= 0.25:
            limit = abs(float(values[leaves + 2 : stops].mean()))
            line = np.clip(line, -limit, limit)
            leaves = stops
    error = record.noise / float(np.linalg.norm(since))
    rate = _fewest_digits(slope, max(3.0 * error, 0.002 * abs(slope)))
    return _Candidate(f"ramp {rate:+g} {record.unit}/s", line, leaves, start)


def _sine(record: _Record) -> _Candidate | None:
    """One frequency, at least a whole period of it in six samples or more."""
    from scipy.optimize import curve_fit

    time, values = record.time, record.values
    # a crossing is a change between 30 % of the peak and as much of the other sign
    beyond = np.flatnonzero(np.abs(values) > 0.3 * record.peak)
    changes = np.flatnonzero(np.diff(np.signbit(values[beyond])))
    if changes.size < 2:
        return None
    crossings = 0.5 * (time[beyond[changes]] + time[beyond[changes + 1]])
    half = float(np.median(np.diff(crossings)))
    uneven = np.abs(np.diff(crossings) / half - 1.0) > 0.15
    regular = int(uneven.argmax()) if uneven.any() else uneven.size
    # the last may be a part of the return
    even = crossings[: min(regular + 1, max(crossings.size - 1, 2))]
    first = record.leaves(np.zeros(time.size), 0)
    certain = int(np.searchsorted(time, even[-1]))
    fewest = 6.0 * float(np.median(np.diff(time)))
    if regular < max(uneven.size - 1, 1) or 2.0 * half < fewest or certain - first < 6:
        return None
    half, crossing = np.polyfit(np.arange(even.size), even, 1)
    # a crossing in the middle hardly correlates with the frequency
    middle = 0.5 * (time[first] + time[certain - 1])
    crossing += 2.0 * half * round((middle - crossing) / half / 2.0)
    leaves = certain

    def tone(t: Array, a: float, crossing: float, mean: float, omega: float) -> Array:
        return np.asarray(mean + a * np.sin(omega * (t - crossing)))

    amplitude = record.peak * np.sign(values[beyond[changes[0] + 1]])
    numbers = np.array([amplitude, crossing, 0.0, np.pi / half])
    for again in (True, False):  # once more with all that lies on the first tone
        try:
            numbers, covariance = curve_fit(tone, time[first:leaves], values[first:leaves], numbers)
        except RuntimeError:
            return None
        model = tone(time, *numbers)
        if again:
            leaves = record.leaves(model, first)
            if leaves < certain:
                return None
    amplitude, crossing, mean, omega = map(float, numbers)
    size = abs(amplitude)
    # time that it takes from the crossing at which it begins to the tolerance
    hidden = np.arcsin(min(record.tolerance / size, 1.0)) / omega if first else 0.0
    start = float(time[first]) - hidden
    model[:first] = 0.0
    goes_on = float(time[min(leaves, time.size - 1)]) - start > 0.99 * 2.0 * np.pi / omega
    if not goes_on or (first and abs(mean) > max(0.02 * size, record.noise)):
        return None
    hertz = omega / (2.0 * np.pi)
    error = float(np.sqrt(covariance[3, 3])) / (2.0 * np.pi)
    frequency = _fewest_digits(hertz, max(3.0 * error, 0.001 * hertz))
    rises = amplitude * float(np.cos(omega * (start - crossing)))
    signed_size = _fewest_digits(size if rises > -1e-9 * size else -size, 0.002 * size)
    name = f"sine {signed_size:g} {record.unit} {frequency:g} Hz"
    return _Candidate(name, model, leaves, start, frequency=frequency)
