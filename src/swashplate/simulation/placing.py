"""From signals on the march's grid to weighted rows of a least-squares problem."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.simulation.compilation import kernel
from swashplate.simulation.recurrences import follow
from swashplate.simulation.triangle import absorb

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

CARRIED = 8
"""Places of an observation's rows before the block's: the last two are the samples before it, the
others only keep the block's first sample at the beginning of a cache line."""


class Plan(NamedTuple):
    """Where all observations look, one after the other; m samples in all, r observations."""

    signal: Indices
    """(r,) places in `OBSERVABLE`."""
    first: Indices
    """(r + 1,) first sample of each, and m."""
    cell: Indices
    """(m,) point of the grid at or before the stamp, never falling within an observation."""
    fraction: Array
    """(m,) how far behind it the stamp lies, in steps, 0 to 1."""
    back: Array
    """(m,) weight of the slope before the point in the derivative by time; empty if not wanted."""
    ahead: Array
    """(m,) weight of the slope behind it. [1/s]"""
    measured: Array
    """(m,) measured values, less the offset that is assumed in them."""
    weight: Array
    """(m,)"""
    regular: NDArray[np.bool_]
    """(r,) whether an observation has its stamps on successive points of the grid."""
    kept: Array
    """(r, q) what a step leaves of a value that passes a low pass; 0 where there is none."""
    offset_column: Indices
    """(r,) column of the derivative by the offset, -1 if not wanted."""
    clock_column: Indices
    """(r,) column of the derivative by the clock offset, -1 if not wanted."""


class Sink(NamedTuple):
    """Where weighted rows go: all residuals or derivatives of a column each, residuals last."""

    rows: Array
    """(k + 1, m) all rows, or (k + 1, ROWS) where a triangle is wanted."""
    to: Indices
    """(d,) where the derivatives go that the drive's march gives."""
    own: Indices
    """(k - d,) where those by the observations' own unknowns go."""
    factor: Array
    """(k + 1, k + 1) triangle, (0, 0) where all rows are wanted."""
    squares: Array
    """(r,) sum of squared residuals of each observation."""


@kernel
def low_pass(
    kept: float, fresh: bool, count: int, filled: Indices, factor: Array, state: Array, rows: Array
) -> None:
    """Replace the rows of an observation by what a first-order low pass makes of them.

    Parameters
    ----------
    kept : float
        What a step leaves of the output, the input held: exp(-pole · h).
    fresh : bool
        Whether the record begins here: the output begins with the input.
    factor : (m,) array
        Room for `follow`, whose arguments the others are.
    """
    gain = 1.0 - kept
    for m in range(count):
        factor[m] = kept
    for c in range(rows.shape[0]):
        row = rows[c]
        if fresh:
            state[c] = row[CARRIED]
        for m in range(count):
            row[CARRIED + m] = gain * row[CARRIED + m]
    follow(factor, rows, filled, CARRIED, count, state)


@kernel
def place(
    seen: Array, base: int, plan: Plan, r: int, at: int, count: int, sink: Sink, to: int
) -> None:
    """Weighted rows of the problem at some stamps of an observation, from its rows on the grid.

    Parameters
    ----------
    seen : (d + 2, q) array
        On the grid: derivatives by the d columns that the drive's march gives, and the signal.
    base : int
        Point of the grid at place 0 of `seen`.
    r, at, count : int
        The observation, the first of its stamps and how many.
    sink, to :
        What to fill, and from which place of its rows on.
    """
    derived, end = sink.to.size, at + count
    # slices, because a place that may be negative to the compiler keeps it from vectorising
    cell, fraction, weight = plan.cell[at:end], plan.fraction[at:end], plan.weight[at:end]
    begin = cell[0] - base
    for c in range(derived):
        column = sink.rows[sink.to[c], to : to + count]
        if plan.regular[r]:
            row = seen[c, begin : begin + count]
            for i in range(count):
                column[i] = weight[i] * row[i]
        else:
            row = seen[c]
            for i in range(count):
                n, f = cell[i] - base, fraction[i]
                column[i] = weight[i] * ((1.0 - f) * row[n] + f * row[n + 1])
    signal = seen[derived]
    for c in sink.own:
        column = sink.rows[c, to : to + count]
        for i in range(count):
            column[i] = weight[i] if c == plan.offset_column[r] else 0.0
        if c == plan.clock_column[r]:
            back, ahead = plan.back[at:end], plan.ahead[at:end]
            for i in range(count):
                n = cell[i] - base
                before, behind = signal[n] - signal[n - 1], signal[n + 1] - signal[n]
                column[i] = weight[i] * (back[i] * before + ahead[i] * behind)
    squares = 0.0
    measured = plan.measured[at:end]
    column = sink.rows[sink.rows.shape[0] - 1, to : to + count]
    for i in range(count):
        n, f = cell[i] - base, fraction[i]
        residual = weight[i] * ((1.0 - f) * signal[n] + f * signal[n + 1] - measured[i])
        column[i] = residual
        squares += residual * residual
    sink.squares[r] += squares


@kernel
def rotate(
    seen: Array,
    base: int,
    plan: Plan,
    r: int,
    at: int,
    end: int,
    sink: Sink,
    used: int,
    products: Array,
) -> int:
    """Weighted rows into the triangle, those of weight 0 left out.

    Parameters
    ----------
    seen, base, plan, r, at, sink :
        As in `place`.
    end : int
        The stamp behind the last.
    used : int
        Rows that wait in the sink to be rotated.
    products : array
        Room for `absorb`.

    Returns
    -------
    int
        Rows that wait now.
    """
    while at < end:
        if plan.weight[at] == 0.0:
            at += 1
            continue
        count = 1
        while (
            at + count < end
            and used + count < sink.rows.shape[1]
            and plan.weight[at + count] != 0.0
        ):
            count += 1
        place(seen, base, plan, r, at, count, sink, used)
        at, used = at + count, used + count
        if used == sink.rows.shape[1]:
            absorb(sink.rows, sink.factor, products)
            used = 0
    return used
