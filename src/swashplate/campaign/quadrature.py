"""Counts from the two channels of an encoder, logged as levels."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from swashplate.campaign.stamps import Array, Rows
from swashplate.errors import InputError
from swashplate.maneuvers.checks import row


class Quadrature(NamedTuple):
    """Position decoded from two channels."""

    counts: Array
    """Position, 0 at the first row, positive where A leads B. [count]"""
    illegal: Rows
    """Rows at which both channels changed at once: two counts were lost, one way or the other."""


def decode_quadrature(a: ArrayLike, b: ArrayLike) -> Quadrature:
    """Count the edges of both channels of an encoder, four counts a line.

    Parameters
    ----------
    a, b : array_like of bool or of 0 and 1, shape (n,)
        Levels of the channels; of logged voltages, ``a > threshold``.

    Returns
    -------
    Quadrature
        The count goes up where A rises before B. It stands still where both channels change at
        once, and such rows are listed: the true position is then two counts further, either way.

    Raises
    ------
    InputError
        If the lengths differ or a level is neither 0 nor 1.
    """
    levels = []
    for name, channel in (("a", a), ("b", b)):
        level = row(name, channel)
        wrong = np.flatnonzero((level != 0.0) & (level != 1.0))
        if wrong.size:
            raise InputError(
                f"{name} must be 0 or 1 throughout, but row {wrong[0]} (the first is 0) is "
                f"{level[wrong[0]]:g}; compare a voltage with its threshold first."
            )
        levels.append(level.astype(np.int8))
    first, second = levels
    if first.size != second.size:
        raise InputError(f"a and b must have as many rows, not {first.size} and {second.size}.")
    # quarter of the line's period: (0, 0), (1, 0), (1, 1), (0, 1) in the positive direction
    quarter = np.where(first == 1, 1 + second, 3 * second)
    turned = np.diff(quarter) % 4
    counts = np.concatenate([[0.0], np.cumsum((turned == 1).astype(float) - (turned == 3))])
    return Quadrature(counts, np.flatnonzero(turned == 2) + 1)
