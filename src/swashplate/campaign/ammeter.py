"""One ammeter around both solenoid leads: what it reads, and where it cannot be trusted.

It reads the sum of magnitudes, never negative. Compare it with the same of the simulation, and
leave out what lies around the zero crossings. A sign that is put back is
a guess there: never take derivatives through it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from swashplate.campaign.stamps import Array, Mask, increasing, signal
from swashplate.errors import InputError
from swashplate.maneuvers.pieces import not_negative, positive, row


class ZeroCrossings(NamedTuple):
    """Where a signal changes its sign, and what lies around it."""

    instants: Array
    """Instants of the crossings; of a stay at zero, when it begins and ends. [s]"""
    masked: Mask
    """True for samples within half the width of an instant: leave them out."""


def zero_crossings(
    time: ArrayLike, values: ArrayLike, *, width: float, level: float = 0.0
) -> ZeroCrossings:
    """Find where a signal changes its sign and mask the samples around.

    Parameters
    ----------
    time : array_like, shape (n,)
        Stamps. [s]
    values : array_like, shape (n,)
        The command, or better the simulated signed current, which lags like the measured one.
    width : float
        Length of the mask around each crossing, half before and half after. [s]
    level : float
        What is no larger than this counts as zero, in the unit of `values`.

    Returns
    -------
    ZeroCrossings
        A stay at zero between both signs is masked at both of its ends, and within if it is no
        longer than the width. Leaving zero and coming back with the same sign is no crossing.

    Raises
    ------
    InputError
        If the stamps do not increase, a number is not finite, or the width is not positive.
    """
    stamps = increasing(time)
    numbers = signal("values", values, stamps.size)
    half = 0.5 * positive("width", width)
    band = not_negative("level", level)
    sure = np.flatnonzero(np.abs(numbers) > band)
    turns = np.flatnonzero(np.sign(numbers[sure[1:]]) != np.sign(numbers[sure[:-1]]))
    before, after = sure[turns], sure[turns + 1]
    direct = after == before + 1
    share = numbers[before] / (numbers[before] - numbers[after])
    crossed = stamps[before] + share * (stamps[after] - stamps[before])
    instants = np.unique(
        np.concatenate([crossed[direct], stamps[before[~direct]], stamps[after[~direct]]])
    )
    masked = np.zeros(stamps.size, dtype=np.bool_)
    for first, last in zip(
        np.searchsorted(stamps, instants - half, side="left"),
        np.searchsorted(stamps, instants + half, side="right"),
        strict=True,
    ):
        masked[first:last] = True
    return ZeroCrossings(instants, masked)


def signed_by_command(rectified: ArrayLike, command: ArrayLike, *, level: float = 0.0) -> Array:
    """Give a rectified current the sign of the command.

    Parameters
    ----------
    rectified : array_like, shape (n,)
        Reading of the ammeter, not negative. [A]
    command : array_like, shape (n,)
        Voltage, or any signal with the current's sign. [V]
    level : float
        A command no larger than this has no sign of its own. [V]

    Returns
    -------
    array, shape (n,)
        Current, positive where the command is. While the command has no sign the last one it had
        holds, because the current is still on its way to zero; before the first it is positive. [A]

    Raises
    ------
    InputError
        If a number is not finite, the lengths differ, or a reading is negative: it would have its
        sign already.

    Notes
    -----
    The true current passes zero smoothly; this one jumps where the command does, by twice the
    reading. Its derivative, and that of a cost through it, mean nothing there.
    """
    numbers = row("command", command)
    readings = signal("rectified", rectified, numbers.size)
    negative = np.flatnonzero(readings < 0.0)
    if negative.size:
        raise InputError(
            f"rectified must not be negative, but row {negative[0]} (the first is 0) is "
            f"{readings[negative[0]]} A."
        )
    signs = np.where(np.abs(numbers) > level, np.sign(numbers), 0.0)
    last = np.maximum.accumulate(np.where(signs != 0.0, np.arange(signs.size), 0))
    return np.where(signs[last] < 0.0, -readings, readings)
