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
from swashplate.maneuvers.pieces import not_negative, positive


class ZeroCrossings(NamedTuple):
    """Where a signal changes its sign, and what lies around it."""

    instants: Array
    """Instants of the crossings; of a stay at zero, when it begins and ends. [s]"""
    masked: Mask
    """True for samples within half the width of an instant: leave them out."""


class SignedCurrent(NamedTuple):
    """A rectified current with the command's sign."""

    current: Array
    """Positive where the command is. [A]"""
    masked: Mask
    """True where the sign is a guess: leave these samples out."""


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


def signed_by_command(
    time: ArrayLike,
    rectified: ArrayLike,
    command: ArrayLike,
    *,
    width: float,
    level: float = 0.0,
) -> SignedCurrent:
    """Give a rectified current the sign of the command; the mask belongs to the answer.

    Parameters
    ----------
    time : array_like, shape (n,)
        Stamps. [s]
    rectified : array_like, shape (n,)
        Reading of the ammeter, not negative. [A]
    command : array_like, shape (n,)
        Voltage, or any signal with the current's sign. [V]
    width : float
        Length of the mask around each crossing: twice the time by which the current lags the
        command, at least. [s]
    level : float
        A command no larger than this has no sign of its own. [V]

    Returns
    -------
    SignedCurrent
        While the command has no sign the last one it had holds, because the current is still on
        its way to zero; before the first, the sign is positive and masked.

    Raises
    ------
    InputError
        As `zero_crossings`, or if a reading is negative: it would have its sign already.

    Notes
    -----
    The true current passes zero smoothly; this one jumps where the command does, by twice the
    reading. Its derivative, and that of a cost through it, mean nothing there.
    """
    crossings = zero_crossings(time, command, width=width, level=level)
    rows = crossings.masked.size
    reading, drive = signal("rectified", rectified, rows), signal("command", command, rows)
    below = np.flatnonzero(reading < 0.0)
    if below.size:
        raise InputError(
            f"rectified must not be negative, but row {below[0]} (the first is 0) is "
            f"{reading[below[0]]:g} A; take off the ammeter's offset first, or keep the sign."
        )
    known = np.abs(drive) > level
    # row of the last command that had a sign, -1 before the first
    last = np.maximum.accumulate(np.where(known, np.arange(rows), -1))
    sign = np.where(last < 0, 1.0, np.sign(drive[last]))
    masked = crossings.masked | (last < 0)
    return SignedCurrent(sign * reading, masked)
