"""Encoder counts: roll-overs taken out, staircases filled, jumps found, angles made of them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from swashplate.campaign.counters import CounterRangeError
from swashplate.campaign.stamps import Array, Rows, increasing, signal
from swashplate.errors import InputError
from swashplate.maneuvers.pieces import positive, row, whole

WIDEST = 53
"""Widest counter that a float64 holds to the count. [bit]"""
SUSTAINED = 5
"""A speed lasts if the median of this many neighbouring intervals has it."""
MARGIN = 1.5
"""A jump is this much faster than anything that lasts."""


class Unwrapped(NamedTuple):
    """A counter's position without its roll-overs."""

    counts: Array
    """Position from the first row's reading on. [count]"""
    rollovers: Rows
    """Rows at which the counter passed its end, either way."""
    doubtful: Rows
    """Rows whose step is so large that a roll-over more or less may be what happened."""


class LostCounts(NamedTuple):
    """Jumps that no motion explains."""

    rows: Rows
    """Rows that the jumps lead to."""
    steps: Array
    """Change of the count at each of them. [count]"""
    max_speed: float
    """The speed above which a change counts as a jump. [count/s]"""


def unwrap_counts(
    counts: ArrayLike,
    *,
    bits: int | None = None,
    modulus: int | None = None,
    doubtful_share: float = 0.25,
) -> Unwrapped:
    """Take the roll-overs out of a counter's readings: each step is the shortest way round.

    Parameters
    ----------
    counts : array_like, shape (n,)
        Readings, whole numbers from 0 up or, of a signed counter, from -modulus/2 up. [count]
    bits, modulus : int
        Width of the counter, or how many readings it has: one of the two.
    doubtful_share : float
        Steps larger than this share of the modulus are reported as doubtful. [1]

    Raises
    ------
    InputError
        If a reading is no whole number or outside the counter, or a step is exactly half the
        modulus, so that neither way round is the shorter.
    """
    readings = _whole_counts(counts)
    size = _modulus(bits, modulus)
    _check_range(readings, size)
    steps = np.diff(readings)
    short = steps - size * np.floor(steps / size + 0.5)
    ambiguous = np.flatnonzero(short == -0.5 * size)
    if ambiguous.size:
        at = int(ambiguous[0]) + 1
        raise InputError(
            f"counts go from {readings[at - 1]:.0f} to {readings[at]:.0f} at row {at} (the first "
            f"is 0), half the range of a counter of {size}, which may be up or down; cut the "
            "record there."
        )
    position = np.empty_like(readings)
    position[0] = readings[0]
    np.cumsum(short, out=position[1:])
    position[1:] += readings[0]
    return Unwrapped(
        position,
        np.flatnonzero(short != steps) + 1,
        np.flatnonzero(np.abs(short) > positive("doubtful_share", doubtful_share) * size) + 1,
    )


def _whole_counts(counts: ArrayLike) -> Array:
    readings = row("counts", counts)
    broken = np.flatnonzero(np.floor(readings) != readings)
    if broken.size:
        raise InputError(
            f"counts must be whole numbers, but row {broken[0]} (the first is 0) is "
            f"{readings[broken[0]]}."
        )
    return readings


def _modulus(bits: int | None, modulus: int | None) -> int:
    if (bits is None) == (modulus is None):
        raise InputError("Give either the bits of the counter or its modulus, one of the two.")
    size = (
        2 ** min(whole("bits", bits), WIDEST + 1) if bits is not None else whole("modulus", modulus)
    )
    if not 2 <= size <= 2**WIDEST:
        raise InputError(
            f"A counter must have from 1 to {WIDEST} bits, not "
            f"{f'{bits} bits' if bits is not None else f'a modulus of {modulus}'}."
        )
    return size


def _check_range(readings: Array, size: int) -> None:
    signed = readings.min() < 0.0
    low, high = (-(size // 2), (size - 1) // 2) if signed else (0, size - 1)
    outside = np.flatnonzero((readings < low) | (readings > high))
    if outside.size:
        raise CounterRangeError(
            f"counts hold {readings[outside[0]]:.0f} in row {outside[0]} (the first is 0), outside "
            f"the {low} to {high} of a {'signed ' if signed else ''}counter of {size} readings"
        )


def interpolate_counts(time: ArrayLike, counts: ArrayLike) -> Array:
    """Fill the samples that share a count: the source's smoothing of an encoder's staircase.

    Parameters
    ----------
    time : array_like, shape (n,)
        Stamps, even or not. [s]
    counts : array_like, shape (n,)
        Position without roll-overs, either direction. [count]

    Returns
    -------
    array, shape (n,)
        Position on straight lines from each row at which the count changed to the next such row.
        The first row counts as one: up to the first change the line starts there, because a step
        of a whole count within one sample would be a spike of speed. From the last change on the
        count is held. [count]

    Raises
    ------
    InputError
        If the stamps do not increase or a number is not finite.

    Notes
    -----
    Kruse (2001), section 7.2. Two properties of it stay: a line knows a change before it happens,
    so it is no causal filter; and the row of a change carries its new count in both directions, so
    that a reversal, whose two changes pass the same edge, moves the position by one count.
    """
    stamps = increasing(time)
    return interpolated(stamps, signal("counts", counts, stamps.size))


def interpolated(time: Array, counts: Array) -> Array:
    """`interpolate_counts` of arrays that are already checked."""
    knots = np.concatenate([[0], np.flatnonzero(counts[1:] != counts[:-1]) + 1])
    if knots.size == counts.size:
        return counts.copy()
    filled: Array = np.interp(time, time[knots], counts[knots])
    return filled


def radians_per_count(counts_per_turn: float, gear_ratio: float = 1.0, sign: int = 1) -> float:
    """Angle of the shaft for one count, negative where the count runs the other way. [rad]

    Parameters
    ----------
    counts_per_turn : float
        Counts in one turn of the encoder.
    gear_ratio : float
        Turns of the encoder in one turn of the shaft.
    sign : {1, -1}
        -1 if the counter goes down where the shaft's speed is positive.

    Raises
    ------
    InputError
        If a ratio is not positive or the sign another.

    Notes
    -----
    Kruse (2001), eqs. 7.2-7.4 before their derivative, with the 2π that they leave out.
    """
    if sign not in (1, -1):
        raise InputError(f"sign must be 1 or -1, not {sign!r}.")
    turn = positive("counts_per_turn", counts_per_turn) * positive("gear_ratio", gear_ratio)
    return sign * 2.0 * np.pi / turn


def find_lost_counts(
    time: ArrayLike, counts: ArrayLike, *, max_speed: float | None = None
) -> LostCounts:
    """Find changes of the count that are faster than the shaft can turn.

    Parameters
    ----------
    time : array_like, shape (n,)
        Stamps, even or not. [s]
    counts : array_like, shape (n,)
        Position without roll-overs. [count]
    max_speed : float, optional
        Greatest speed of the encoder. Without it, 1.5 times the greatest speed that lasts: the
        median over five neighbouring intervals, which isolated jumps do not reach. [count/s]

    Returns
    -------
    LostCounts
        Rows at which the count changed by more than `max_speed` allows, one count of rounding
        granted. A loss that is no larger than the motion within a sample is not seen.

    Raises
    ------
    InputError
        If the stamps do not increase, a number is not finite, or the record is too short for an
        estimate.
    """
    from scipy.ndimage import median_filter

    stamps = increasing(time)
    steps = np.diff(signal("counts", counts, stamps.size))
    intervals = np.diff(stamps)
    if max_speed is not None:
        limit = positive("max_speed", max_speed)
    elif steps.size < SUSTAINED:
        raise InputError(
            f"A record of {stamps.size} rows is too short to estimate the greatest speed; give "
            "max_speed."
        )
    else:
        lasting = median_filter(np.abs(steps) / intervals, size=SUSTAINED, mode="nearest")
        limit = MARGIN * float(lasting.max())
    jumps = np.flatnonzero(np.abs(steps) > limit * intervals + 1.0)
    return LostCounts(jumps + 1, steps[jumps], limit)
