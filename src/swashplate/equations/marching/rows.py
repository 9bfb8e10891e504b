"""From derivatives on the grid to weighted rows of a least-squares problem: library kernels.

What is here knows no model: it works on rows of a block of samples that a plan names by number.
"""

from collections import deque
from contextlib import suppress
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.cache import kernel, pasted, subroutine
from swashplate.equations.marching.pieces import behind, call
from swashplate.equations.marching.triangle import EIGHTH, absorb, aligned, aligned_room

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

BLOCK = 512
"""Most samples of a block."""
STRIDE = BLOCK + 16
"""From one row to the next: not a power of two, so that rows do not share places in a cache."""
CARRIED = 8
"""Places of an observation's rows before the block's: the last two are the samples before it, the
others only keep the block's first sample at the beginning of a cache line."""
ABREAST = 8
"""Columns of a recurrence side by side: they fill the time that each waits for its last number."""


class Terms(NamedTuple):
    """Rows that are sums of products of other rows, each known by its first place in the block."""

    target: Indices  # (t,) rows to be made.
    first: Indices  # (t + 1,) first term of each, and how many there are.
    a: Indices  # (s,) row of a term's first factor.
    b: Indices  # (s,) row of its second factor, -1 for none.
    scale: Array  # (s,) number that multiplies a term.


class Program(NamedTuple):
    """What is done in every block, in order."""

    derived: int  # Columns.
    todo: Indices
    """(w, 4) in each row one of

    - CALL, number of a piece: call it;
    - COMBINE, first and end of the terms' targets: make rows of the block;
    - RECUR, 0, first place and end in `columns`: run a recurrence of one state;
    - CHAIN, number of a piece, first place and end in `columns`: run one of several states.
    """
    terms: Terms  # Of all rows that are made, those of the observations behind the others.
    seen: int  # First target that is a row of the observations.
    columns: Indices
    """For each recurrence what runs it takes: the place of its factor, then the `columns` of
    `follow`; or the number of columns, then theirs."""
    value: Indices  # (r,) row of each observation's signal.
    integral: NDArray[np.bool_]  # (r,) whether an observation is its signal's integral.


CALL, COMBINE, RECUR, CHAIN = 0, 1, 2, 3


class Plan(NamedTuple):
    """Where all observations look, one after the other; m samples in all, r observations."""

    first: Indices  # (r + 1,) first sample of each, and m.
    cell: Indices
    """(m,) point of the grid at or before the stamp, never falling within an observation."""
    fraction: Array  # (m,) how far behind it the stamp lies, in steps, 0 to 1.
    back: Array
    """(m,) weight of the slope before the point in the derivative by time; empty if not wanted."""
    ahead: Array  # (m,) weight of the slope behind it. [1/s]
    measured: Array  # (m,) measured values, less the offset that is assumed in them.
    weight: Array  # (m,)
    regular: NDArray[np.bool_]
    """(r,) whether an observation has its stamps on successive points of the grid."""
    kept: Array
    """(r, q) what a step leaves of a value that passes a low pass; 0 where there is none."""
    offset_column: Indices  # (r,) column of the derivative by the offset, -1 if not wanted.
    clock_column: Indices  # (r,) column of the derivative by the clock offset, -1 if not wanted.


class Sink(NamedTuple):
    """Where weighted rows go: all residuals or derivatives of a column each, residuals last."""

    rows: Array  # (k + 1, m) all rows, or (k + 1, ROWS) where a triangle is wanted.
    to: Indices  # (d,) where the derivatives go that the march gives.
    own: Indices  # (k - d,) where those by the observations' own unknowns go.
    factor: Array  # (k + 1, k + 1) triangle, (0, 0) where all rows are wanted.
    squares: Array  # (r,) sum of squared residuals of each observation.


class Room(NamedTuple):
    """Memory to work in; d columns, r observations, up to q low passes each."""

    flat: Array  # The block.
    seen: Array
    """(r, d + 2, STRIDE) of each observation its derivatives, the signal, and an idle row."""
    flat_seen: Array  # The same.
    columns: Indices  # (r, 4, j) these rows of each observation, for `follow`.
    passed: Array  # (r, q, d + 2) outputs of the low passes at the next sample.
    integrals: Array  # (r, d + 1, 3) see `integrate_row`.
    aside: Array  # (STRIDE,) room for a row that is needed for a moment.
    products: Array  # Room for `absorb`.
    progress: Indices  # (r,) first stamp of each observation that is not yet dealt with.


@lru_cache(maxsize=16)
def rooms(layout: Any, kept: tuple[int, int]) -> deque[Room]:
    """Memory of marches that have ended: new memory takes longer to get than a short march."""
    return deque(maxlen=8)


def room_for(spare: deque[Room], layout: Any, plan: Plan) -> Room:
    """Memory for a march of some columns, a room of earlier ones if there is any."""
    if spare:
        with suppress(IndexError):  # another thread was faster
            room = spare.pop()
            room.seen[:, :, :CARRIED] = room.passed[:] = room.integrals[:] = 0.0
            return room._replace(progress=plan.first[:-1].copy())
    flat = aligned_room(layout.rows * STRIDE)
    table = flat.reshape(layout.rows, STRIDE)
    for value, row in layout.constant.items():
        table[row] = value
    (observations, low_passes), derived = plan.kept.shape, layout.program.derived
    seen = aligned(observations, derived + 2, STRIDE)
    return Room(
        flat,
        seen,
        seen.reshape(-1),
        _columns(observations, derived),
        np.zeros((observations, low_passes, derived + 2)),
        np.zeros((observations, derived + 1, 3)),
        np.empty(STRIDE),
        aligned(EIGHTH),
        plan.first[:-1].copy(),
    )


@lru_cache(maxsize=256)
def _columns(observations: int, derived: int) -> Indices:
    """Rows of each observation, for `follow`."""
    idle = (derived + 1,) * (-(derived + 1) % ABREAST)
    own = np.array([*range(derived + 1), *idle], dtype=np.int64)
    columns = np.zeros((observations, 4, own.size), dtype=np.int64)
    for r in range(observations):
        columns[r, :2] = (r * (derived + 2) + own) * STRIDE + CARRIED
        columns[r, 2] = own
    return columns


@subroutine
def combine(
    flat: Array, terms: Terms, first: int, end: int, count: int, into: Array, shift: int
) -> None:
    """Make rows of `into`, `shift` behind their places, from rows of `flat`."""
    for t in range(first, end):
        row = behind(into, terms.target[t] + shift)
        if terms.first[t] == terms.first[t + 1]:
            for m in range(count):
                row[m] = 0.0
        for s in range(terms.first[t], terms.first[t + 1]):
            a, scale = behind(flat, terms.a[s]), terms.scale[s]
            fresh = s == terms.first[t]
            if terms.b[s] >= 0:
                b = behind(flat, terms.b[s])
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


@subroutine
def follow(a: Array, columns: Indices, width: int, flat: Array, count: int, tangent: Array) -> None:
    """Run y[n+1] = a[n] y[n] + g[n], several columns side by side.

    `columns` are, `width` each, the places of the inputs g and of the results in `flat`, which may
    be the same, of y in `tangent`, and whether the result at n is y[n+1], not y[n].
    """
    last = columns[3 * width] != 0
    for c in range(0, width, ABREAST):
        to, at = behind(columns, c + width), behind(columns, c + 2 * width)
        y0, y1, y2, y3 = tangent[at[0]], tangent[at[1]], tangent[at[2]], tangent[at[3]]
        y4, y5, y6, y7 = tangent[at[4]], tangent[at[5]], tangent[at[6]], tangent[at[7]]
        g0, g1 = behind(flat, columns[c]), behind(flat, columns[c + 1])
        g2, g3 = behind(flat, columns[c + 2]), behind(flat, columns[c + 3])
        g4, g5 = behind(flat, columns[c + 4]), behind(flat, columns[c + 5])
        g6, g7 = behind(flat, columns[c + 6]), behind(flat, columns[c + 7])
        d0, d1, d2, d3 = (
            behind(flat, to[0]),
            behind(flat, to[1]),
            behind(flat, to[2]),
            behind(flat, to[3]),
        )
        d4, d5, d6, d7 = (
            behind(flat, to[4]),
            behind(flat, to[5]),
            behind(flat, to[6]),
            behind(flat, to[7]),
        )
        for m in range(count):
            f = a[m]
            n0, n1, n2, n3 = f * y0 + g0[m], f * y1 + g1[m], f * y2 + g2[m], f * y3 + g3[m]
            n4, n5, n6, n7 = f * y4 + g4[m], f * y5 + g5[m], f * y6 + g6[m], f * y7 + g7[m]
            if last:
                d0[m], d1[m], d2[m], d3[m] = n0, n1, n2, n3
                d4[m], d5[m], d6[m], d7[m] = n4, n5, n6, n7
            else:
                d0[m], d1[m], d2[m], d3[m] = y0, y1, y2, y3
                d4[m], d5[m], d6[m], d7[m] = y4, y5, y6, y7
            y0, y1, y2, y3, y4, y5, y6, y7 = n0, n1, n2, n3, n4, n5, n6, n7
        tangent[at[0]], tangent[at[1]], tangent[at[2]], tangent[at[3]] = y0, y1, y2, y3
        tangent[at[4]], tangent[at[5]], tangent[at[6]], tangent[at[7]] = y4, y5, y6, y7


@pasted
def integrate_row(row: Array, count: int, step: float, state: Array) -> None:
    """Replace a rate, in `count` places, by its trapezoidal integral over the whole record.

    `state` holds integral and rate at the sample before, and 1.0 once there is one.
    """
    total, last = state[0], state[1]
    for n in range(count):
        rate = row[n]
        if state[2] != 0.0:
            total = total + 0.5 * step * (last + rate)
        state[2] = 1.0
        last = rate
        row[n] = total
    state[0], state[1] = total, last


@pasted
def low_pass(kept: float, fresh: bool, count: int, room: Room, r: int, q: int) -> None:
    """Replace the rows of an observation by what one of its first-order low passes makes of them.

    `kept` is what a step leaves of the output, exp(-pole · h); a `fresh` record begins with the
    input.
    """
    gain, size = 1.0 - kept, room.seen.shape[1] - 1
    rows, state = behind(room.seen, r * (size + 1) * STRIDE + CARRIED), room.passed[r, q]
    for m in range(count):
        room.aside[m] = kept
    for c in range(size + 1):
        row = behind(rows, c * STRIDE)
        if fresh:
            state[c] = row[0]
        for m in range(count):
            row[m] = gain * row[m]
    columns, width = behind(room.columns, r * 4 * room.columns.shape[2]), room.columns.shape[2]
    follow(behind(room.aside, 0), columns, width, room.flat_seen, count, state)


@subroutine
def place(
    seen: Array,
    base: int,
    plan: Plan,
    r: int,
    where: tuple[int, int, int],
    sink: Sink,
    done: bool,
) -> None:
    """Weighted rows of the problem at some stamps of an observation, from its rows on the grid.

    `seen` holds the derivatives that the march gives, and the signal, from the grid's point `base`
    on; `where` is the first of the stamps, how many there are, and the first place in the rows of
    the sink. Are derivatives `done`, only what does not come from the march is left.
    """
    at, count, to = where
    derived, long = sink.to.size, sink.rows.shape[1]
    cell, fraction, weight = (
        behind(plan.cell, at),
        behind(plan.fraction, at),
        behind(plan.weight, at),
    )
    begin = cell[0] - base
    for c in range(0 if not done else derived, derived):
        column, row = behind(sink.rows, sink.to[c] * long + to), behind(seen, c * STRIDE)
        if plan.regular[r]:
            row = behind(row, begin)
            for i in range(count):
                column[i] = weight[i] * row[i]
        else:
            for i in range(count):
                n, f = cell[i] - base, fraction[i]
                column[i] = weight[i] * ((1.0 - f) * row[n] + f * row[n + 1])
    signal = behind(seen, derived * STRIDE)
    for c in sink.own:
        column = behind(sink.rows, c * long + to)
        for i in range(count):
            column[i] = weight[i] if c == plan.offset_column[r] else 0.0
        if c == plan.clock_column[r]:
            back, ahead = behind(plan.back, at), behind(plan.ahead, at)
            for i in range(count):
                n = cell[i] - base
                before, after = signal[n] - signal[n - 1], signal[n + 1] - signal[n]
                column[i] = weight[i] * (back[i] * before + ahead[i] * after)
    squares = 0.0
    measured = behind(plan.measured, at)
    column = behind(sink.rows, (sink.rows.shape[0] - 1) * long + to)
    for i in range(count):
        n, f = cell[i] - base, fraction[i]
        residual = weight[i] * ((1.0 - f) * signal[n] + f * signal[n + 1] - measured[i])
        column[i] = residual
        squares += residual * residual
    sink.squares[r] += squares


@pasted
def rotate(
    seen: Array,
    base: int,
    plan: Plan,
    r: int,
    stamps: tuple[int, int],
    sink: Sink,
    used: int,
    products: Array,
) -> int:
    """Weighted rows into the triangle, those of weight 0 left out; arguments as in `place`.

    `stamps` are the first one and the one behind the last; `used` rows wait in the sink to be
    rotated, and as many as are returned wait now.
    """
    at, end = stamps
    long = sink.rows.shape[1]
    while at < end:
        if plan.weight[at] == 0.0:
            at += 1
            continue
        count = 1
        while at + count < end and used + count < long and plan.weight[at + count] != 0.0:
            count += 1
        place(seen, base, plan, r, (at, count, used), sink, False)
        at, used = at + count, used + count
        if used == long:
            absorb(sink.rows, sink.factor, products)
            used = 0
    return used


@pasted
def deliver(
    program: Program,
    plan: Plan,
    sink: Sink,
    room: Room,
    used: int,
    span: tuple[int, int, int],
    step: float,
) -> int:
    """What a block adds to the problem, once signals and derivatives of it are known.

    `span` is the first sample of the block, how many it has, and how many the record has; `used`
    rows wait in the sink to be rotated, and as many as are returned wait now.
    """
    first, count, size = span
    derived = program.derived
    terms, flat, seen = program.terms, behind(room.flat, 0), behind(room.flat_seen, 0)
    out, long = behind(sink.rows, 0), sink.rows.shape[1]
    base, last = first - CARRIED, first + count == size
    for r in range(plan.first.size - 1):
        rows = behind(room.seen, r * (derived + 2) * STRIDE)
        signal = behind(rows, derived * STRIDE + CARRIED)
        value = behind(flat, program.value[r] * STRIDE)
        for m in range(count):
            signal[m] = value[m]
        first_term = program.seen + r * derived
        # where nothing stands between a signal and its residuals, derivatives go there at once
        straight = sink.factor.size == 0 and plan.regular[r] and plan.clock_column[r] < 0
        straight = straight and not program.integral[r] and not plan.kept[r].any()
        if not straight:
            combine(flat, terms, first_term, first_term + derived, count, seen, 0)
        if program.integral[r]:
            for c in range(derived + 1):
                row = behind(rows, c * STRIDE + CARRIED)
                integrate_row(row, count, step, room.integrals[r, c])
        for q in range(plan.kept.shape[1]):
            if plan.kept[r, q] > 0.0:
                low_pass(plan.kept[r, q], first == 0, count, room, r, q)
        # off the grid, and for a slope, the point behind the stamp must be known as well
        alone = last or (plan.regular[r] and plan.clock_column[r] < 0)
        known = first + count if alone else first + count - 1
        at = room.progress[r]
        end = at
        while end < plan.first[r + 1] and plan.cell[end] < known:
            end += 1
        room.progress[r] = end
        if sink.factor.size > 0:
            used = rotate(rows, base, plan, r, (at, end), sink, used, room.products)
        elif end > at:
            if straight:
                begin, weight, even = plan.cell[at] - first, behind(plan.weight, at), True
                for i in range(end - at):
                    even = even and weight[i] == 1.0
                for c in range(derived):
                    t, to = first_term + c, sink.to[c] * long + at
                    shift = to - terms.target[t]
                    combine(behind(flat, begin), terms, t, t + 1, end - at, out, shift)
                    column = behind(out, to)
                    for i in range(0 if not even else end - at, end - at):
                        column[i] *= weight[i]
            place(rows, base, plan, r, (at, end - at, at), sink, straight)
    return used


@kernel
def march_observed(
    pieces: Any,
    arrays: tuple[Any, ...],
    grid: tuple[int, float],
    tangent: Array,
    program: Program,
    plan: Plan,
    sink: Sink,
    room: Room,
) -> None:
    """March block by block, and compare what comes with what was observed.

    `pieces` are addresses, of the march first, and `arrays` what they take from ``records`` on (see
    `pieces.PIECE`). `grid` says how many samples the record has, and the step.
    `tangent` holds the derivatives of the states at the first sample, replaced by those behind the
    last.
    """
    size, h = grid
    used, count, flat, start = plan.first[0], 0, room.flat, behind(room.flat, 0)
    for first in range(0, size, BLOCK):
        for k in range(0, room.flat_seen.size, STRIDE):
            # what interpolation looks back at, from the end of the block before
            row = behind(room.flat_seen, k + CARRIED - 2)
            row[0], row[1] = row[count], row[count + 1]
        count = BLOCK if size - first > BLOCK else size - first
        for step in range(program.todo.shape[0]):
            what, a, b = program.todo[step, 0], program.todo[step, 1], program.todo[step, 2]
            taken, many = behind(program.columns, b + 1), program.todo[step, 3] - b - 1
            if what == CALL:
                call(pieces[a], count, first, h, arrays)
            elif what == COMBINE:
                combine(start, program.terms, a, b, count, start, 0)
            elif what == RECUR:
                factor = behind(flat, program.columns[b])
                follow(factor, taken, many // 4, flat, count, tangent)
            else:
                given = (arrays[0], arrays[1], taken, arrays[3], tangent, *arrays[5:])
                call(pieces[a], count, program.columns[b], h, given)
        used = deliver(program, plan, sink, room, used, (first, count, size), h)
    if used > 0 and sink.factor.size > 0:
        for c in range(sink.rows.shape[0]):
            for i in range(used, sink.rows.shape[1]):
                sink.rows[c, i] = 0.0
        absorb(sink.rows, sink.factor, room.products)
