"""Time stamps of a measured record, checked; what they are like; the samples that go with them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import InputError
from swashplate.maneuvers.pieces import positive, row

Array = NDArray[np.float64]
Rows = NDArray[np.intp]
Mask = NDArray[np.bool_]

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
    shortest: float
    """Shortest interval. [s]"""
    longest: float
    """Longest interval, gap or not. [s]"""
    gaps: Rows
    """Rows that come after a gap."""
    missing: int
    """Samples that the gaps would have held at the median rate."""
    even: bool
    """Whether all stamps lie on an even grid but for their rounding."""


def increasing(time: ArrayLike) -> Array:
    """Copy stamps to a row; they must increase from each of two or more to the next.

    Parameters
    ----------
    time : array_like, shape (n,)
        Stamps. [s]

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
    """Check stamps, and put those that are even but for their rounding onto their grid.

    Parameters
    ----------
    time : array_like, shape (n,)
        Stamps, two or more. [s]

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


def stamp_statistics(time: ArrayLike, *, gap: float = 1.5) -> StampStatistics:
    """Rate, jitter and gaps of stamps.

    Parameters
    ----------
    time : array_like, shape (n,)
        Stamps, two or more. [s]
    gap : float
        An interval of more than this many medians is a gap.

    Raises
    ------
    InputError
        If the stamps do not increase, a number is not finite, or `gap` is not above 1.
    """
    stamps = increasing(time)
    if positive("gap", gap) <= 1.0:
        raise InputError(f"gap must be above 1, in median intervals, not {gap:g}.")
    intervals = np.diff(stamps)
    median = float(np.median(intervals))
    wide = intervals > gap * median
    usual = intervals[~wide]
    return StampStatistics(
        rows=stamps.size,
        rate=1.0 / median,
        period=median,
        jitter=float(np.sqrt(np.mean((usual - median) ** 2))),
        shortest=float(intervals.min()),
        longest=float(intervals.max()),
        gaps=np.flatnonzero(wide) + 1,
        missing=int(np.sum(np.round(intervals[wide] / median) - 1.0)),
        even=stamps_of(stamps).period is not None,
    )


def even_period(time: ArrayLike, what: str) -> float:
    """Sample period of even stamps [s].

    Parameters
    ----------
    time : array_like, shape (n,)
        Stamps, two or more. [s]
    what : str
        Who needs them even, for the error's sentence.

    Raises
    ------
    InputError
        If they are uneven, or as `increasing`.
    """
    period = stamps_of(time).period
    if period is None:
        steps = np.diff(np.asarray(time, dtype=float))
        at = int(np.argmax(np.abs(steps - np.median(steps)))) + 1
        raise InputError(
            f"{what} needs evenly spaced stamps, but row {at} (the first is 0) comes "
            f"{steps[at - 1]:.6g} s after the one before it, where {np.median(steps):.6g} s is "
            "usual; resample the record first."
        )
    return period


def samples(name: str, values: ArrayLike, rows: int) -> Array:
    """Values of a record as an array of one row a stamp, all finite; not copied if they are one.

    Parameters
    ----------
    name : str
        What they are, for the error's sentence.
    values : array_like, shape (rows,) or (rows, k)
        One or more signals side by side.
    rows : int
        Number of stamps.

    Raises
    ------
    InputError
        If the shape is another or a value is not finite; the sentence names its row.
    """
    try:
        numbers = np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be numbers, not {values!r}.") from None
    if numbers.ndim not in (1, 2) or numbers.shape[0] != rows or numbers.size == 0:
        raise InputError(
            f"{name} must have one row for each of the {rows} stamps, not the shape "
            f"{numbers.shape}."
        )
    if not np.isfinite(numbers).all():
        at = tuple(int(index) for index in np.argwhere(~np.isfinite(numbers))[0])
        column = f" of column {at[1]}" if len(at) == 2 else ""
        raise InputError(
            f"{name} must be finite, but row {at[0]}{column} (the first is 0) is {numbers[at]}."
        )
    return numbers


def signal(name: str, values: ArrayLike, rows: int) -> Array:
    """As `samples`, for one signal alone: shape (rows,)."""
    numbers = samples(name, values, rows)
    if numbers.ndim != 1:
        raise InputError(f"{name} must be one signal, not {numbers.shape[1]} side by side.")
    return numbers
