"""Uneven stamps: what they are like, and samples put onto an even grid without inventing any."""

from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from swashplate.campaign.stamps import Array, Rows, increasing, samples, stamps_of
from swashplate.errors import InputError
from swashplate.maneuvers.checks import positive

NEAR = 1e-3
"""A stamp this little off a grid point, in periods of the grid, counts as being there."""


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


class Resampled(NamedTuple):
    """Samples on an even grid; where the record has a gap, rows are left out."""

    time: Array
    """(m,) stamps, whole multiples of the period after the first. [s]"""
    values: Array
    """(m,) or (m, k) samples."""
    segments: tuple[slice, ...]
    """The rows between two gaps: take a filter through each segment by itself."""
    period: float
    """Sample period of the grid. [s]"""


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


def resample(
    time: ArrayLike,
    values: ArrayLike,
    *,
    rate: float,
    interpolation: Literal["previous", "linear"],
    largest_gap: float,
) -> Resampled:
    """Put samples onto an even grid that starts at the first stamp.

    Parameters
    ----------
    time : array_like, shape (n,)
        Stamps. [s]
    values : array_like, shape (n,) or (n, k)
        Samples; of an encoder, interpolated counts rather than raw ones.
    rate : float
        Rate of the grid; far below the record's own, whatever is faster than half of it is folded
        down, so take a low pass before. [Hz]
    interpolation : {"previous", "linear"}
        Between two samples: hold the earlier one, or go straight to the later one.
    largest_gap : float
        Longest interval that is interpolated over. Grid points within a longer one are left out
        and end a segment. [s]

    Returns
    -------
    Resampled
        No value lies outside the two samples around it, and none after the last stamp.

    Raises
    ------
    InputError
        If the stamps do not increase, a number is not finite, or no interpolation is named.
    """
    stamps, _ = stamps_of(time)
    numbers = samples("values", values, stamps.size)
    if interpolation not in ("previous", "linear"):
        raise InputError(f"interpolation must be 'previous' or 'linear', not {interpolation!r}.")
    period, limit = 1.0 / positive("rate", rate), positive("largest_gap", largest_gap)
    # from here on counted in periods, so that grid points are whole numbers
    places = (stamps - stamps[0]) / period
    places = np.where(np.abs(places - np.round(places)) < NEAR, np.round(places), places)
    grid = np.arange(int(places[-1]) + 1, dtype=float)
    before = np.searchsorted(places, grid, side="right") - 1
    after = np.minimum(before + 1, stamps.size - 1)
    exact = places[before] == grid
    kept = exact | (stamps[after] - stamps[before] <= limit)
    grid, before, after, exact = grid[kept], before[kept], after[kept], exact[kept]
    found = numbers[before]
    if interpolation == "linear":
        between = np.where(exact, 1.0, places[after] - places[before])
        share = np.where(exact, 0.0, grid - places[before]) / between
        found += (share * (numbers[after] - found).T).T
    passed = np.searchsorted(places[1:][np.diff(stamps) > limit], grid, side="right")
    bounds = [0, *(np.flatnonzero(np.diff(passed)) + 1), grid.size]
    segments = tuple(slice(int(a), int(b)) for a, b in pairwise(bounds))
    return Resampled(stamps[0] + period * grid, found, segments, period)
