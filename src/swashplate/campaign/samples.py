"""Samples and their time stamps, checked; an encoder's counts; one ammeter around both leads."""

from collections.abc import Collection
from math import ceil, log2
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import InputError
from swashplate.maneuvers import row, whole

Array = NDArray[np.float64]
Rows = NDArray[np.intp]
Mask = NDArray[np.bool_]

GAP = 1.5
"""An interval of more than this many usual ones is a gap."""
TOLERANCE = 0.05
"""How far off an even grid stamps may lie and still count as even, in sample periods.

Stamps of an even logger are off by what their printing rounds away: 1/512 s in steps of 0.1 ms by
2.6 % of a period. Differences of such stamps would put the rounding into the speed.
"""
LEAST_ROUNDED = 32
"""Stamps from which on a line through them tells rounding from a gap."""
ROUNDING = 0.6
"""Share of a step that even stamps which are rounded to it lie off a line at most: half of it, and
a little for the line."""


class StampStatistics(NamedTuple):
    """Rate, jitter and gaps of the stamps of a record."""

    rows: int
    rate: float
    """One over the median interval. [Hz]"""
    period: float
    """Median interval. [s]"""
    jitter: float
    """Standard deviation of the intervals about their median, gaps left out. [s]"""
    longest: float
    """Longest interval, gap or not. [s]"""
    gaps: Rows
    """Rows that come after a gap."""
    missing: int
    """Samples that the gaps would have held at the median rate."""
    rounded: float = 0.0
    """What the stamps of an even record are rounded to, if coarsely; else 0. [s]"""


def increasing(time: ArrayLike) -> Array:
    """Stamps [s] as a row, two or more, each later than the one before it.

    Raises
    ------
    InputError
        If they are not; the sentence names the row.
    """
    stamps = row("time", time)
    if stamps.size < 2:
        raise InputError("time must have at least two rows, not 1.")
    wrong = np.flatnonzero(stamps[1:] <= stamps[:-1]) + 1
    if wrong.size:
        at = int(wrong[0])
        raise InputError(
            f"time must increase, but row {at} (the first is 0) has {stamps[at]} s after "
            f"{stamps[at - 1]} s."
        )
    return stamps


def stamps_of(time: ArrayLike) -> tuple[Array, float | None]:
    """Increasing stamps and their period [s]; even ones go onto their grid, uneven ones have None.

    Raises
    ------
    InputError
        As `increasing`.
    """
    stamps = increasing(time)
    period = float(stamps[-1] - stamps[0]) / (stamps.size - 1)
    grid = stamps[0] + period * np.arange(stamps.size)
    even = np.max(np.abs(stamps - grid)) <= TOLERANCE * period
    return (grid, period) if even else (stamps, None)


def stamp_statistics(stamps: Array) -> StampStatistics:
    """Rate, jitter and gaps of two increasing stamps [s] or more."""
    intervals = np.diff(stamps)
    median = float(np.median(intervals))
    rounded = _rounded_to(stamps)
    if rounded > 0.0:
        # the median is that of the rounding, and so are intervals of twice as much
        period = float(stamps[-1] - stamps[0]) / intervals.size
        jitter = float(np.sqrt(np.mean((intervals - period) ** 2)))
        longest, none = float(intervals.max()), np.zeros(0, np.intp)
        return StampStatistics(stamps.size, 1.0 / period, period, jitter, longest, none, 0, rounded)
    wide = intervals > GAP * median
    jitter = float(np.sqrt(np.mean((intervals[~wide] - median) ** 2)))
    missing = int(np.sum(np.round(intervals[wide] / median) - 1.0))
    gaps = np.flatnonzero(wide) + 1
    longest = float(intervals.max())
    return StampStatistics(stamps.size, 1.0 / median, median, jitter, longest, gaps, missing)


def _rounded_to(stamps: Array) -> float:
    """What even stamps are rounded to, if more coarsely than `TOLERANCE`; 0 for any others. [s]

    All their intervals are one or more of the smallest, and a straight line passes all of them by
    no more than half of it: a missing sample would be off by half a period or more.
    """
    intervals = np.diff(stamps)
    step = float(intervals.min())
    multiples = intervals / step
    period = float(stamps[-1] - stamps[0]) / intervals.size
    of_steps = bool(np.all(np.abs(multiples - np.round(multiples)) < 1e-3))
    if stamps.size < LEAST_ROUNDED or not of_steps or multiples.max() < GAP:
        return 0.0
    rows = np.arange(stamps.size) - 0.5 * (stamps.size - 1)
    from_middle = stamps - stamps.mean()
    line = rows * float(rows @ from_middle) / float(rows @ rows)
    is_even = float(np.max(np.abs(from_middle - line))) <= ROUNDING * step
    return step if is_even and step > TOLERANCE * period else 0.0


def signal(name: str, values: ArrayLike, rows: int) -> Array:
    """Samples of a signal, one for each of so many stamps, all finite.

    Raises
    ------
    InputError
        If there are more or fewer, or a value is not finite; the sentence names its row.
    """
    numbers = row(name, values)
    if numbers.size != rows:
        raise InputError(f"{name} must have one row for each of the {rows} stamps.")
    return numbers


# --- an encoder's counts, and angles that wrap ----------------------------------------------------

SUSTAINED = 5
"""A speed lasts if the median of this many neighbouring intervals has it."""
MARGIN = 1.5
"""A jump is this much faster than anything that lasts."""
LARGEST_SPAN = 1.05
"""Largest span of the readings of an angle that wraps [turn]: noise takes them beyond one."""


def unwrap_counts(counts: ArrayLike, modulus: int) -> Array:
    """Counts without the roll-overs of a counter: each step is the shortest way round.

    Parameters
    ----------
    counts : array_like, shape (n,)
        Readings, whole numbers from 0 up or, of a signed counter, from -modulus/2 up. [count]
    modulus : int
        How many readings the counter has: 65536 for 16 bits.

    Returns
    -------
    array, shape (n,)
        Position from the first row's reading on. [count]

    Raises
    ------
    InputError
        If a reading is not a whole number or is outside the counter, or a step is exactly half the
        modulus, so that neither way round is the shorter.
    """
    readings, size = row("counts", counts), whole("modulus", modulus)
    if not 2 <= size <= 2**53:  # to which a float64 counts
        raise InputError(f"A counter must have from 2 to 2^53 readings, not {size}.")
    signed = "signed " if readings.min() < 0.0 else ""
    low, high = (-(size // 2), (size - 1) // 2) if signed else (0, size - 1)
    short = _shortest(np.diff(readings), size)
    wrong = {
        "counts must be whole numbers": np.floor(readings) != readings,
        f"counts must be from {low} to {high}, the range of a {signed}counter of {size} readings "
        "(give its actual size, in a campaign file as rolls_over_at)": (readings < low)
        | (readings > high),
        f"counts must not step by half the range of a counter of {size}, whose direction is then "
        "ambiguous (cut "
        "the record there)": np.concatenate([[False], short == -0.5 * size]),
    }
    for sentence, rows in wrong.items():
        if rows.any():
            at = int(rows.argmax())
            raise InputError(f"{sentence}, but row {at} (the first is 0) is {readings[at]:g}.")
    return np.asarray(readings[0] + np.concatenate([[0.0], np.cumsum(short)]))


def unwrap_position(position: Array, size: float) -> Array:
    """Position (n,) of a sensor that wraps after `size`, by the short way at each step.

    A single sample about halfway between two near ones, taken while the sensor went back, does not
    turn the shaft; it stays what it is, half a turn off.

    Raises
    ------
    InputError
        If the readings reach further than `size` and noise do.
    """
    if (reach := float(np.ptp(position))) > LARGEST_SPAN * size:
        raise InputError(
            f"the readings span {reach / size:.4g} times rolls_over_at, but a position that wraps "
            "stays within it; correct rolls_over_at, or leave it out."
        )
    steps = _shortest(np.diff(position), size)
    far = np.concatenate([[False], np.abs(steps) > 0.25 * size, [False]])
    past = _shortest(position[2:] - position[:-2], size)
    lone = far[1:-2] & far[2:-1] & ~far[:-3] & ~far[3:] & (np.abs(past) < 0.25 * size)
    steps[1:][lone] = (past - steps[:-1])[lone]
    return np.asarray(position[0] + np.concatenate([[0.0], np.cumsum(steps)]))


def _shortest(steps: Array, modulus: float) -> Array:
    """Steps of a counter by the shorter way round, down if both are as long. [count]"""
    return np.asarray(steps - modulus * np.floor(steps / modulus + 0.5))


def ambiguous_gaps(time: Array, readings: Array, modulus: float) -> Rows:
    """Rows after a gap so long that a counter of `modulus` may have gone round in it unseen.

    A shaft that goes on at 1.5 times its greatest lasting speed passes half the counter within the
    gap: the shortest way round need not be the one that it took. [row]
    """
    intervals = np.diff(time)
    gaps = np.flatnonzero(intervals > GAP * np.median(intervals))
    if not gaps.size or readings.size < 2 * SUSTAINED:
        return np.zeros(0, dtype=np.intp)
    # across a gap the shortest way round says nothing of the speed
    usual = np.delete(np.arange(intervals.size), gaps)
    fastest = MARGIN * _lasting(_shortest(np.diff(readings), modulus)[usual], intervals[usual])
    return gaps[fastest * intervals[gaps] >= 0.5 * modulus] + 1


def _lasting(steps: Array, intervals: Array) -> float:
    """Greatest speed that lasts: the median over a few neighbouring intervals. [count/s]"""
    from scipy.ndimage import median_filter

    speeds = np.abs(steps) / intervals
    return float(median_filter(speeds, size=SUSTAINED, mode="nearest").max())


def interpolate_counts(time: ArrayLike, counts: ArrayLike) -> Array:
    """Fill the samples that share a count: Kruse's smoothing of an encoder's staircase.

    Positions (n,) without roll-overs [count] at increasing stamps (n,) [s] become positions on
    straight lines from each row at which the count changed to the next such row. The first row
    counts as one: a step of a whole count within one sample would be a spike of speed. From the
    last change on the count is held. [count]

    Notes
    -----
    Kruse (2001), section 7.2. A line knows a change before it happens, so it is not a causal
    filter. The row of a change carries its new count in both directions, so that a reversal, whose
    two changes pass the same edge, moves the position by one count.
    """
    stamps, edges = np.asarray(time, np.float64), np.asarray(counts, np.float64)
    knots = np.concatenate([[0], np.flatnonzero(edges[1:] != edges[:-1]) + 1])
    filled: Array = np.interp(stamps, stamps[knots], edges[knots])
    return filled


def find_lost_counts(time: Array, counts: Array) -> Rows:
    """Rows at which the count (n,) changed faster than the shaft can turn. Stamps (n,) in s.

    Faster than 1.5 times the greatest speed that lasts (the median over five neighbouring
    intervals, which isolated jumps do not reach), one count of rounding granted. A loss that is no
    larger than the motion within a sample is not seen, nor any in fewer than eight samples.
    """
    if counts.size < 8:
        return np.zeros(0, dtype=np.intp)
    steps, intervals = np.diff(counts), np.diff(time)
    limit = MARGIN * _lasting(steps, intervals)
    return np.flatnonzero(np.abs(steps) > limit * intervals + 1.0) + 1


def rolls_over_at(values: Array, counts_per_turn: float | None = None) -> int:
    """Counts after which a counter wraps, 0 if the numbers are not such a counter's.

    The numbers of a counter are whole and many. Some of their steps go over more than half of the
    range, and become as small as the others when they are taken the other way round. Numbers that
    go up by the same step each time count the samples. The counts of a turn are a likely size.
    """
    if values.size < 2 or not np.isfinite(values).all() or np.any(values != np.floor(values)):
        return 0
    low = float(values.min())
    high = float(values.max())
    turn = float(counts_per_turn or 0.0)
    span = high + 1.0 if low >= 0.0 else 2.0 * max(-low, high + 1.0)
    sizes = {1 << ceil(log2(span)), 100 * ceil(span / 100.0)}
    if turn.is_integer() and span <= turn <= LARGEST_SPAN * span:
        sizes = {int(turn)}
    return int(_wrap_size(values, span, sizes))


def turns_over(position: Array, turn: float) -> bool:
    """Whether a position (n,) of one unit jumps by about a `turn`, where its angle wraps."""
    values = position[np.isfinite(position)]
    reach = float(np.ptp(values)) if values.size else 0.0
    within = 0.5 * turn < reach < LARGEST_SPAN * turn
    return within and bool(_wrap_size(values, reach, {turn}))


def _wrap_size(values: Array, span: float, sizes: Collection[float]) -> float:
    """Size, of some, after which the values wrap; 0 if they do not wrap.

    A step over more than half of the span is a roll-over if, less the size, it is as short as the
    other steps.
    """
    steps = np.diff(values)
    is_long = np.abs(steps) > 0.5 * span
    # fewer numbers may be those of a switch
    if np.unique(values).size < 32 or not is_long.any() or is_long.all():
        return 0
    short_steps = steps[~is_long]
    # the few larger ones lead across gaps
    largest_short = float(np.quantile(np.abs(short_steps), 0.998))
    # the step across a roll-over, less the size, is as large as those just before and after it
    expected = np.interp(np.flatnonzero(is_long), np.flatnonzero(~is_long), short_steps)
    unwrapped = {
        size: steps[is_long] - size * np.round(steps[is_long] / size) for size in sorted(sizes)
    }
    best = min(unwrapped, key=lambda size: float(np.median(np.abs(unwrapped[size] - expected))))
    # half of the steps must fit, as one across a gap may have any length; the size itself is
    # uncertain by what lies between the span of the readings and it
    tolerance = 2.0 * largest_short + max(best - span, 0.0)
    fits = np.mean(np.abs(unwrapped[best]) <= tolerance) >= 0.5
    # samples that are numbered: the same step each time
    counts_samples = np.ptp(np.concatenate([short_steps, unwrapped[best]])) == 0.0
    if not fits or counts_samples or largest_short >= 0.25 * best:
        return 0
    return best


# --- the ammeter ----------------------------------------------------------------------------------


def signed_by_command(rectified: Array, command: Array, level: float = 0.0) -> Array:
    """Rectified current (n,) with the sign of the command (n,), or of any signal that has it. [A]

    A command no larger than `level` has no sign of its own: the last one it had holds, because the
    current is still on its way to zero; before the first it is positive.

    The true current passes zero smoothly; this one jumps where the command does, by twice the
    reading, where its derivative means nothing. Better compare sums of magnitudes.
    """
    signed = np.abs(command) > level
    last = np.maximum.accumulate(np.where(signed, np.arange(command.size), 0))
    return np.where(signed[last] & (command[last] < 0.0), -rectified, rectified)
