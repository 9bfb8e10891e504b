"""Counters that begin anew at their end, told by their numbers."""

from __future__ import annotations

from math import ceil, log2

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError

Array = NDArray[np.float64]

_FEWEST = 32
"""Readings that a counter shows at least; fewer may be those of a switch."""
_NEAR = 1.05
"""The counts of a turn are the size where they are at most this much more than the range."""


class CounterRangeError(InputError):
    """A reading outside its counter; `said` leaves out what would be right."""

    def __init__(self, said: str) -> None:
        super().__init__(f"{said}; give the right bits or modulus.")
        self.said = said


def rolls_over_at(values: Array, counts_per_turn: float | None = None) -> int | None:
    """Counts after which a counter begins anew, None where the numbers are not such a counter's.

    Parameters
    ----------
    values : (n,) array
        Of a column.
    counts_per_turn : float, optional
        Of its encoder: a likely size.

    Notes
    -----
    The numbers are whole and many, and some steps go over more than half of their range, which
    become as small as the others when they are taken the other way round. Numbers that only go up
    by the same step each time count the samples.
    """
    if values.size < 2 or not np.isfinite(values).all() or np.any(values != np.floor(values)):
        return None
    if np.unique(values).size < _FEWEST:
        return None
    low, high = float(values.min()), float(values.max())
    span = high + 1.0 if low >= 0.0 else 2.0 * max(-low, high + 1.0)
    size = _round_size(span, counts_per_turn)
    steps = np.diff(values)
    short = steps - size * np.floor(steps / size + 0.5)
    over = short != steps
    if not over.any() or np.ptp(short) == 0.0:
        return None
    ordinary = float(np.abs(steps[~over]).max(initial=0.0))
    # the counter's size is known to what the largest reading leaves open
    small = float(np.abs(short[over]).max()) <= 2.0 * ordinary + (size - span)
    return size if small and ordinary < 0.25 * size else None


def _round_size(span: float, counts_per_turn: float | None) -> int:
    """A size that counters have, a little above what a column's numbers take up."""
    turn = 0.0 if counts_per_turn is None else float(counts_per_turn)
    if turn.is_integer() and span <= turn <= _NEAR * span:
        return int(turn)
    return min(1 << ceil(log2(span)), 100 * ceil(span / 100.0))
