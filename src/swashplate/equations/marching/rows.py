"""From derivatives on the grid to weighted rows of a least-squares problem, and their triangle.

What is here knows no model: library kernels work on rows of a block of samples that a program names
by their first places.

With [J r] = Q R, the small triangle R holds all that a Gauss-Newton or trust-region step needs: RᵀR
is [J r]ᵀ[J r], and J has the singular values of R's columns. R is made by Householder reflections,
never from the normal equations, whose condition number is squared and which a zero column breaks.
"""

from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.cache import kernel, pasted, subroutine
from swashplate.equations.declaration import inlined
from swashplate.equations.marching.pieces import behind, call

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

BLOCK = 512
"""Most samples of a block."""
STRIDE = BLOCK + 16
"""From one row to the next: not a power of two, so that rows do not share places in a cache; and
room before and behind a row for the samples next to the block."""


class Program(NamedTuple):
    """What is done in every block, in order, and what is observed then."""

    todo: Indices
    """(w, 4) in each row one of

    - CALL, number of a piece: call it;
    - COMBINE, first and end of the sums: make rows of the block;
    - INTEGRATE, place of a row, its number among all: make it its integral;
    - RECUR, number of a piece, first place and end in `lanes`: run a recurrence.
    """
    target: Indices  # (t,) rows that are sums; those that are observed last, which have no place.
    first: Indices  # (t + 1,) first term of each, and how many there are.
    a: Indices  # (s,) row of a term's first factor.
    b: Indices  # (s,) row of its second factor, -1 for none.
    scale: Array  # (s,) number that multiplies a term.
    lanes: Indices  # For each recurrence its `graph.recurrence`'s.
    seen: int  # Number of the first sum that is observed: of each observation one for each column.
    value: Indices  # (r,) row of each observation's signal.
    integrals: int  # Rows that become integrals.


CALL, COMBINE, INTEGRATE, RECUR = range(4)


class Plan(NamedTuple):
    """Where all observations look, one after the other; m samples in all, r observations."""

    first: Indices  # (r + 1,) first sample of each, and m.
    cell: Indices
    """(m,) point of the grid at or before the stamp, never falling within an observation."""
    fraction: Array  # (m,) how far behind it the stamp lies, in steps, 0 to 1.
    measured: Array  # (m,) measured values, less the offset that is assumed in them.
    weight: Array  # (m,)
    even: NDArray[np.bool_]  # (r,) whether all weights of an observation are 1.
    regular: NDArray[np.bool_]
    """(r,) whether an observation has its stamps on successive points of the grid."""
    offset_column: Indices  # (r,) column of the derivative by the offset, -1 if not wanted.


class Sink(NamedTuple):
    """Where weighted rows go: all residuals or derivatives of a column each, residuals last."""

    rows: Array  # (k + 1, m) all rows, or (k + 1, ROWS) where a triangle is wanted.
    to: Indices  # (d,) where the derivatives go that the march gives.
    own: Indices  # (k - d,) where those by the observations' own offsets go.
    factor: Array  # (k + 1, k + 1) triangle, (0, 0) where all rows are wanted.


# --- the triangle ---------------------------------------------------------------------------------

ROWS = 512
"""Rows of a block: known to the compiler, and few enough for a fast cache."""
EIGHTH = ROWS // 8
NOTHING = 1e-290
"""Square of a column's norm that counts as none: the reflection divides by numbers of its size."""
CACHE_LINE = 64
"""Bytes. Vectors that lie across two lines take twice as long to load."""


def aligned_room(size: int) -> Array:
    """Memory, as it is, that begins with a cache line."""
    room = np.empty(size + CACHE_LINE // 8)
    skipped = -room.ctypes.data % CACHE_LINE // 8
    return room[skipped : skipped + size]


def aligned(*shape: int) -> Array:
    """Zeros that begin with a cache line."""
    room = aligned_room(int(np.prod(shape))).reshape(shape)
    room[:] = 0.0
    return room


@inlined
def dot(a: Array, b: Array, room: Array) -> float:
    """Scalar product of two columns of ROWS numbers, folded in eighths.

    Summed from left to right, one addition would wait for the other; folded, it vectorises without
    leave to reorder sums (docs/decisions/0002), and rounds less.
    """
    for i in range(EIGHTH):
        j, k, l = i + 2 * EIGHTH, i + 4 * EIGHTH, i + 6 * EIGHTH
        room[i] = (
            (a[i] * b[i] + a[i + EIGHTH] * b[i + EIGHTH])
            + (a[j] * b[j] + a[j + EIGHTH] * b[j + EIGHTH])
        ) + (
            (a[k] * b[k] + a[k + EIGHTH] * b[k + EIGHTH])
            + (a[l] * b[l] + a[l + EIGHTH] * b[l + EIGHTH])
        )
    for i in range(8):
        room[i] = ((room[i] + room[i + 8]) + (room[i + 16] + room[i + 24])) + (
            (room[i + 32] + room[i + 40]) + (room[i + 48] + room[i + 56])
        )
    total: float = ((room[0] + room[1]) + (room[2] + room[3])) + (
        (room[4] + room[5]) + (room[6] + room[7])
    )
    return total


@kernel
def absorb(rows: Array, factor: Array, room: Array) -> None:
    """Rotate a block of rows into the triangular factor of all rows before it.

    (k, ROWS) `rows` column by column, zeros where it lacks some, are used up; the (k, k) upper
    triangle `factor`, zeros before the first block, is replaced; `room` has EIGHTH places.
    """
    for j in range(rows.shape[0]):
        pivot = behind(rows, j * ROWS)
        square = dot(pivot, pivot, room)
        if square < NOTHING:
            continue  # nothing to rotate, as with a parameter that the block does not depend on
        corner = factor[j, j]
        norm = sqrt(corner * corner + square)
        diagonal = -norm if corner > 0.0 else norm
        lead = corner - diagonal
        # the reflection 1 - v vᵀ · scale with v = [lead, pivot]: no difference of like numbers
        scale = 1.0 / (norm * (norm + abs(corner)))
        factor[j, j] = diagonal
        for k in range(j + 1, rows.shape[0]):
            column = behind(rows, k * ROWS)
            along = scale * (lead * factor[j, k] + dot(pivot, column, room))
            factor[j, k] -= along * lead
            for i in range(ROWS):
                column[i] -= along * pivot[i]


def upright(factor: Array) -> Array:
    """The triangle with rows turned so that no diagonal element is negative."""
    turned = np.where(np.diag(factor) < 0.0, -1.0, 1.0)
    return np.asarray(turned[:, None] * factor)


# --- rows -----------------------------------------------------------------------------------------


@subroutine
def combine(flat: Array, program: Program, t: int, shift: int, count: int, row: Array) -> None:
    """Sum the products of a sum's terms, from places `shift` behind their rows' first."""
    first, end = program.first[t], program.first[t + 1]
    if first == end:
        for m in range(count):
            row[m] = 0.0
    for s in range(first, end):
        a, scale = behind(flat, program.a[s] + shift), program.scale[s]
        if program.b[s] >= 0:
            b = behind(flat, program.b[s] + shift)
            if s == first:
                for m in range(count):
                    row[m] = scale * (a[m] * b[m])
            else:
                for m in range(count):
                    row[m] += scale * (a[m] * b[m])
        elif s == first:
            for m in range(count):
                row[m] = scale * a[m]
        else:
            for m in range(count):
                row[m] += scale * a[m]


@pasted
def integrate(row: Array, count: int, step: float, state: Array) -> None:
    """Replace a rate by its trapezoidal integral over the whole record.

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


@subroutine
def place(
    flat: Array,
    program: Program,
    plan: Plan,
    r: int,
    block: tuple[int, int],
    stamps: tuple[int, int, int],
    sink: Sink,
    aside: Array,
) -> None:
    """Weighted rows of the problem at some stamps of an observation.

    `block` is its first sample and how many it has, `stamps` the first one, how many they are, and
    from where on they go into the sink; `aside` is room for a row.
    """
    (first, size), (at, count, to) = block, stamps
    derived, long = sink.to.size, sink.rows.shape[1]
    cell, fraction, weight = (
        behind(plan.cell, at),
        behind(plan.fraction, at),
        behind(plan.weight, at),
    )
    begin = cell[0]
    width = min(cell[count - 1] + 2, first + size) - begin
    for c in range(derived):
        column, t = behind(sink.rows, sink.to[c] * long + to), program.seen + r * derived + c
        if plan.regular[r]:
            combine(flat, program, t, begin - first, count, column)
            for i in range(0 if not plan.even[r] else count, count):
                column[i] *= weight[i]
        else:
            combine(flat, program, t, begin - first, width, aside)
            aside[width] = aside[width - 1]
            for i in range(count):
                n, f = cell[i] - begin, fraction[i]
                column[i] = weight[i] * ((1.0 - f) * aside[n] + f * aside[n + 1])
    for c in sink.own:
        column = behind(sink.rows, c * long + to)
        for i in range(count):
            column[i] = weight[i] if c == plan.offset_column[r] else 0.0
    signal, measured = behind(flat, program.value[r] + begin - first), behind(plan.measured, at)
    column = behind(sink.rows, (sink.rows.shape[0] - 1) * long + to)
    for i in range(count):
        n, f = cell[i] - begin, fraction[i]
        column[i] = weight[i] * ((1.0 - f) * signal[n] + f * signal[n + 1] - measured[i])


@kernel
def march_observed(
    pieces: Any,
    arrays: tuple[Any, ...],
    grid: tuple[int, float],
    tangent: Array,
    program: Program,
    plan: Plan,
    sink: Sink,
    room: tuple[Array, Array, Array, Array, Indices],
) -> None:
    """March block by block, and compare what comes with what was observed.

    `pieces` are addresses, of the march first, and `arrays` what they take from ``records`` on (see
    `pieces.PIECE`). `grid` says how many samples the record has, and the step.
    `tangent` holds the derivatives of the states at the first sample, replaced by those behind the
    last. `room` are the block, a row aside, room for `absorb`, (i, 3) zeros for integrals, and the
    first stamp of each observation.
    """
    (size, h), (block, aside, products, integrals, progress) = grid, room
    flat, folded, long = behind(block, 0), sink.factor.size > 0, sink.rows.shape[1]
    used = 0  # Rows that wait in the sink to be rotated.
    look_back = False
    for r in range(progress.size):
        look_back = look_back or not plan.regular[r]
    for first in range(0, size, BLOCK):
        if first > 0 and look_back:
            # what interpolation looks back at, from the end of the block before
            for k in range(STRIDE, block.size, STRIDE):
                block[k - 1] = block[k + BLOCK - 1]
        count = min(BLOCK, size - first)
        for step in range(program.todo.shape[0]):
            what, a, b = program.todo[step, 0], program.todo[step, 1], program.todo[step, 2]
            if what == CALL:
                call(pieces[a], count, first, h, arrays)
            elif what == COMBINE:
                for t in range(a, b):
                    combine(flat, program, t, 0, count, behind(flat, program.target[t]))
            elif what == INTEGRATE:
                integrate(behind(flat, a), count, h, integrals[b])
            else:
                lanes = behind(program.lanes, b)
                given = (arrays[0], arrays[1], lanes, arrays[3], tangent, *arrays[5:])
                call(pieces[a], count, program.todo[step, 3] - b, h, given)
        for r in range(progress.size):
            # off the grid the point behind the stamp must be known as well
            known = first + count - (first + count < size and not plan.regular[r])
            row = behind(flat, program.value[r])
            row[count] = row[count - 1]
            at = progress[r]
            end = at
            while end < plan.first[r + 1] and plan.cell[end] < known:
                end += 1
            progress[r] = end
            while at < end:
                if folded and plan.weight[at] == 0.0:
                    at += 1
                    continue
                many = min(end - at, long - used)
                for i in range(1, many if folded else 0):
                    if plan.weight[at + i] == 0.0:
                        many = i
                        break
                to = used if folded else at
                place(flat, program, plan, r, (first, count), (at, many, to), sink, aside)
                at += many
                used += many if folded else 0
                if folded and used == long:
                    absorb(sink.rows, sink.factor, products)
                    used = 0
    if used > 0:
        for c in range(sink.rows.shape[0]):
            for i in range(used, long):
                sink.rows[c, i] = 0.0
        absorb(sink.rows, sink.factor, products)
