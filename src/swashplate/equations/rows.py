"""From derivatives on the grid to weighted rows of a least-squares problem: library kernels.

What is here knows no model: it works on rows of a block of samples that a plan names by number.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.cache import kernel
from swashplate.equations.triangle import EIGHTH, absorb, aligned, aligned_room

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

BLOCK = 512
"""Most samples of a block."""
STRIDE = BLOCK + 16
"""From one row to the next: not a power of two, so that rows do not share places in a cache."""
CARRIED = 8
"""Places of an observation's rows before the block's: the last two are the samples before it, the
others only keep the block's first sample at the beginning of a cache line."""
ABREAST = 4
"""Columns of a recurrence side by side: they fill the time that each waits for its last number."""


class Terms(NamedTuple):
    """Rows that are sums of products of other rows."""

    target: Indices
    """(t,) rows to be made."""
    first: Indices
    """(t + 1,) first term of each, and how many there are."""
    a: Indices
    """(s,) row of a term's first factor."""
    b: Indices
    """(s,) row of its second factor, -1 for none."""
    scale: Array
    """(s,) number that multiplies a term."""


class Program(NamedTuple):
    """What is to be derived in every block."""

    derived: int
    """Columns."""
    active: NDArray[np.bool_]
    """Which of the fill kernels anything needs."""
    terms: tuple[Terms, ...]
    """Rows to make ahead of each recurrence, and behind each part."""
    columns: tuple[Indices, ...]
    """For each recurrence (3 k, 4 j): rows of the inputs, rows of the results, places of the
    tangents, of each of its k states."""
    seen: Terms
    """Rows of the observations' derivatives."""
    value: Indices
    """(r,) row of each observation's signal."""
    integral: NDArray[np.bool_]
    """(r,) whether an observation is its signal's integral."""


class Plan(NamedTuple):
    """Where all observations look, one after the other; m samples in all, r observations."""

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
    """(d,) where the derivatives go that the march gives."""
    own: Indices
    """(k - d,) where those by the observations' own unknowns go."""
    factor: Array
    """(k + 1, k + 1) triangle, (0, 0) where all rows are wanted."""
    squares: Array
    """(r,) sum of squared residuals of each observation."""


class Room(NamedTuple):
    """Memory to work in; d columns, r observations, up to q low passes each."""

    flat: Array
    """The block."""
    table: Array
    """(rows, STRIDE) the same."""
    flags: NDArray[np.uint8]
    """(0, 0): the march keeps no limits here."""
    seen: Array
    """(r, d + 2, STRIDE) of each observation its derivatives, the signal, and an idle row."""
    flat_seen: Array
    """(r (d + 2), STRIDE) the same."""
    filled: Indices
    """Numbers of these rows, filled up for `follow`."""
    passed: Array
    """(r, q, d + 2) outputs of the low passes at the next sample."""
    integrals: Array
    """(r, d + 1, 3) see `integrate_row`."""
    aside: Array
    """(STRIDE,) room for a row that is needed for a moment."""
    products: Array
    """Room for `absorb`."""


def room_for(rows: int, zeros: int, ones: int, derived: int, plan: Plan) -> Room:
    """Memory for a march with so many rows, columns and observations.

    `zeros` and `ones` are the numbers of two rows that hold just these.
    """
    flat = aligned_room(rows * STRIDE)
    table = flat.reshape(rows, STRIDE)
    table[zeros], table[ones] = 0.0, 1.0
    observations, low_passes = plan.kept.shape
    idle = (derived + 1,) * (-(derived + 1) % ABREAST)
    seen = aligned(observations, derived + 2, STRIDE)
    return Room(
        flat,
        table,
        np.zeros((0, 0), dtype=np.uint8),
        seen,
        seen.reshape(-1, STRIDE),
        np.array([*range(derived + 1), *idle], dtype=np.int64),
        np.zeros((observations, low_passes, derived + 2)),
        np.zeros((observations, derived + 1, 3)),
        np.empty(STRIDE),
        aligned(EIGHTH),
    )


@kernel
def combine(table: Array, terms: Terms, count: int, into: Array, start: int) -> None:
    """Make rows of `into`, from place `start` on, from rows of `table`."""
    for t in range(terms.target.size):
        row = into[terms.target[t], start : start + count]
        if terms.first[t] == terms.first[t + 1]:
            for m in range(count):
                row[m] = 0.0
        for s in range(terms.first[t], terms.first[t + 1]):
            a, scale = table[terms.a[s], :count], terms.scale[s]
            fresh = s == terms.first[t]
            if terms.b[s] >= 0:
                b = table[terms.b[s], :count]
                if fresh:
                    for m in range(count):
                        row[m] = scale * (a[m] * b[m])
                else:
                    for m in range(count):
                        row[m] += scale * (a[m] * b[m])
            elif fresh:
                for m in range(count):
                    row[m] = scale * a[m]
            else:
                for m in range(count):
                    row[m] += scale * a[m]


@kernel
def follow(
    factor: Array, rows: Array, chosen: Indices, start: int, count: int, state: Array
) -> None:
    """Replace g by y with y[n+1] = factor[n] y[n] + g[n], in each chosen row.

    Parameters
    ----------
    factor : (m,) array
        What a step leaves of y.
    rows : (r, m) array
        Inputs g, replaced by y, which begins with the state.
    chosen : (4 j,) array
        Numbers of the rows to march.
    start, count : int
        First place of a row's samples, and how many there are.
    state : (r,) array
        y at the first sample, a number for each row; replaced by that behind the last one.
    """
    for first in range(0, chosen.size, ABREAST):
        c0, c1, c2, c3 = chosen[first], chosen[first + 1], chosen[first + 2], chosen[first + 3]
        r0, r1, r2, r3 = rows[c0], rows[c1], rows[c2], rows[c3]
        y0, y1, y2, y3 = state[c0], state[c1], state[c2], state[c3]
        for n in range(start, start + count):
            a = factor[n - start]
            g0, g1, g2, g3 = r0[n], r1[n], r2[n], r3[n]
            r0[n], r1[n], r2[n], r3[n] = y0, y1, y2, y3
            y0, y1, y2, y3 = a * y0 + g0, a * y1 + g1, a * y2 + g2, a * y3 + g3
        state[c0], state[c1], state[c2], state[c3] = y0, y1, y2, y3


@kernel
def integrate_row(row: Array, first: int, count: int, step: float, state: Array) -> None:
    """Replace a rate by its trapezoidal integral over the whole record.

    Parameters
    ----------
    row : (m,) array
        Rate in `count` places from `first` on, replaced.
    state : (3,) array
        Integral and rate at the sample before, and 1.0 once there is one.
    """
    total, last = state[0], state[1]
    for n in range(first, first + count):
        rate = row[n]
        if state[2] != 0.0:
            total = total + 0.5 * step * (last + rate)
        state[2] = 1.0
        last = rate
        row[n] = total
    state[0], state[1] = total, last


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


@kernel
def carry(room: Room, count: int) -> None:
    """Keep what interpolation looks back at, from the end of the block before."""
    for r in range(room.seen.shape[0]):
        for c in range(room.seen.shape[1] - 1):
            row = room.seen[r, c]
            row[CARRIED - 2] = row[CARRIED + count - 2]
            row[CARRIED - 1] = row[CARRIED + count - 1]


@kernel
def deliver(
    program: Program,
    plan: Plan,
    sink: Sink,
    room: Room,
    progress: Indices,
    used: int,
    span: tuple[int, int, int],
    step: float,
) -> int:
    """What a block adds to the problem, once signals and derivatives of it are known.

    Parameters
    ----------
    progress : (r,) array
        First stamp of each observation that is not yet dealt with; moved on.
    used : int
        Rows that wait in the sink to be rotated.
    span : (int, int, int)
        First sample of the block, how many it has, and how many the record has.
    step : float
        h. [s]

    Returns
    -------
    int
        Rows that wait now.
    """
    first, count, size = span
    derived = program.derived
    combine(room.table, program.seen, count, room.flat_seen, CARRIED)
    base, last = first - CARRIED, first + count == size
    for r in range(plan.first.size - 1):
        rows = room.seen[r]
        signal, value = rows[derived, CARRIED:], room.table[program.value[r]]
        for m in range(count):
            signal[m] = value[m]
        if program.integral[r]:
            for c in range(derived + 1):
                integrate_row(rows[c], CARRIED, count, step, room.integrals[r, c])
        for q in range(plan.kept.shape[1]):
            kept = plan.kept[r, q]
            if kept > 0.0:
                low_pass(kept, first == 0, count, room.filled, room.aside, room.passed[r, q], rows)
        # off the grid, and for a slope, the point behind the stamp must be known as well
        alone = last or (plan.regular[r] and plan.clock_column[r] < 0)
        known = first + count if alone else first + count - 1
        at = progress[r]
        end = at
        while end < plan.first[r + 1] and plan.cell[end] < known:
            end += 1
        progress[r] = end
        if sink.factor.size > 0:
            used = rotate(rows, base, plan, r, at, end, sink, used, room.products)
        elif end > at:
            place(rows, base, plan, r, at, end - at, sink, at)
    return used


@kernel
def finish(sink: Sink, room: Room, used: int) -> None:
    """Rotate the rows that still wait."""
    if used > 0 and sink.factor.size > 0:
        for c in range(sink.rows.shape[0]):
            for i in range(used, sink.rows.shape[1]):
                sink.rows[c, i] = 0.0
        absorb(sink.rows, sink.factor, room.products)
