"""Time stamps of a measured record, checked; what they are like; the samples that go with them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import InputError
from swashplate.maneuvers.pieces import row

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


class Stamps(NamedTuple):
    """Stamps, and how far they are apart if that is the same throughout."""

    time: Array
    """Stamps; where they are even, those of the even grid. [s]"""
    period: float | None
    """Sample period, None for uneven stamps. [s]"""


class StampStatistics(NamedTuple):
    """What the stamps of a record are like."""

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
    even: bool
    """Whether all stamps lie on an even grid but for their rounding."""


def increasing(time: ArrayLike) -> Array:
    """Copy stamps [s] to a row; they must increase from each of two or more to the next.

    Raises
    ------
    InputError
        If one is not finite or not later than the one before it; the sentence names its row.
    """
    stamps = row("time", time)
    if stamps.size < 2:
        raise InputError("time must have two rows at least, not 1.")
    wrong = np.flatnonzero(stamps[1:] <= stamps[:-1])
    if wrong.size:
        at = int(wrong[0]) + 1
        raise InputError(
            f"time must increase, but row {at} (the first is 0) has {stamps[at]} s after "
            f"{stamps[at - 1]} s."
        )
    return stamps


def stamps_of(time: ArrayLike) -> Stamps:
    """Check two stamps [s] or more; those that are even but for their rounding go onto their grid.

    Raises
    ------
    InputError
        As `increasing`.
    """
    stamps = increasing(time)
    period = float(stamps[-1] - stamps[0]) / (stamps.size - 1)
    grid = stamps[0] + period * np.arange(stamps.size)
    if np.max(np.abs(stamps - grid)) > TOLERANCE * period:
        return Stamps(stamps, None)
    return Stamps(grid, period)


def stamp_statistics(time: ArrayLike) -> StampStatistics:
    """Rate, jitter and gaps of two stamps [s] or more.

    Raises
    ------
    InputError
        As `increasing`.
    """
    stamps = increasing(time)
    intervals = np.diff(stamps)
    median = float(np.median(intervals))
    wide = intervals > GAP * median
    usual = intervals[~wide]
    return StampStatistics(
        rows=stamps.size,
        rate=1.0 / median,
        period=median,
        jitter=float(np.sqrt(np.mean((usual - median) ** 2))),
        longest=float(intervals.max()),
        gaps=np.flatnonzero(wide) + 1,
        missing=int(np.sum(np.round(intervals[wide] / median) - 1.0)),
        even=stamps_of(stamps).period is not None,
    )


def signal(name: str, values: ArrayLike, rows: int) -> Array:
    """Samples of a signal, one for each of so many stamps, all finite; an array is not copied.

    Raises
    ------
    InputError
        If the shape is another or a value is not finite; the sentence names its row.
    """
    try:
        numbers = np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be numbers, not {values!r}.") from None
    if numbers.shape != (rows,):
        raise InputError(
            f"{name} must be one signal with one row for each of the {rows} stamps, not of the "
            f"shape {numbers.shape}."
        )
    wrong = np.flatnonzero(~np.isfinite(numbers))
    if wrong.size:
        raise InputError(
            f"{name} must be finite, but row {wrong[0]} (the first is 0) is {numbers[wrong[0]]}."
        )
    return numbers
