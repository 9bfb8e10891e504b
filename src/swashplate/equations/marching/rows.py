"""From derivatives on the grid to weighted rows of a least-squares problem, and their triangle.

What is here knows no model: routines work on rows of a block of samples that a program names by
their first places.

With [J r] = Q R, the small triangle R holds all that a Gauss-Newton or trust-region step needs: RᵀR
is [J r]ᵀ[J r], and J has the singular values of R's columns. R is made by Householder reflections,
never from the normal equations, whose condition number is squared and which a zero column breaks.
"""

from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.code_generation.functions import generating
from swashplate.equations.marching.kernels import (
    Struct,
    behind,
    call_kernel,
    call_recurrence,
    fields_of,
    routine,
    run_routine,
)

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

BLOCK = 512
"""Most samples of a block."""
STRIDE = BLOCK + 16
"""From one row to the next: not a power of two, so that rows do not share places in a cache; and
room before and behind a row for the samples next to the block."""


# Routines read these named tuples as structs (see `kernels.Struct`), whose arrays do not know their
# shapes.


class Program(NamedTuple):
    """What is done in every block, in order, and what is observed then."""

    steps: int
    """Rows of `todo`: w."""
    todo: Indices
    """(w, 4) in each row one of

    - CALL, number of a kernel: call it;
    - COMBINE, first and end of the sums: make rows of the block;
    - INTEGRATE, place of a row, its number among all: make it its integral;
    - RECUR, number of a kernel, first place and end in `lanes`: run a recurrence.
    """
    target: Indices
    """(t,) rows that are sums; those that are observed last, which have no place."""
    first: Indices
    """(t + 1,) first term of each, and how many there are."""
    a: Indices
    """(s,) row of a term's first factor."""
    b: Indices
    """(s,) row of its second factor, -1 for none."""
    scale: Array
    """(s,) number that multiplies a term."""
    lanes: Indices
    """For each recurrence its `graph.recurrence`'s."""
    first_observed: (
        int  # Number of the first sum that is observed: of each observation one for each column.
    )
    value: Indices
    """(r,) row of each observation's signal."""
    integral_count: int
    """Rows that become integrals."""


CALL, COMBINE, INTEGRATE, RECUR = range(4)


class Plan(NamedTuple):
    """Where all observations look, one after the other; m samples in all, r observations."""

    observations: int
    """How many: r."""
    first: Indices
    """(r + 1,) first sample of each, and m."""
    cell: Indices
    """(m,) point of the grid at or before the stamp, never falling within an observation."""
    fraction: Array
    """(m,) how far behind it the stamp lies, in steps, 0 to 1."""
    measured: Array
    """(m,) measured values."""
    weight: Array
    """(m,)"""
    even: Indices
    """(r,) whether all weights of an observation are 1."""
    regular: Indices
    """(r,) whether its stamps are successive points of the grid."""


class Sink(NamedTuple):
    """Where weighted rows go: all residuals or derivatives of a column each, residuals last."""

    columns: int
    """k + 1, residuals counted."""
    length: int
    """From one row to the next: m, or ROWS for a triangle."""
    rows: Array
    """(k + 1, length) all rows, or as many as are rotated at once."""
    derived: int
    """Derivatives that the march gives: d."""
    to: Indices
    """(d,) rows where they go."""
    own: int
    """First row of those by the observations' own offsets; residuals come behind them."""
    folded: int
    """Whether a triangle is wanted."""
    factor: Array
    """(k + 1, k + 1) triangle, (0, 0) if all rows are wanted."""
    offset: Array
    """(r,) offset that is assumed in the measured values of each observation."""
    offset_row: Indices
    """(r,) row of the derivative by the offset, -1 if not wanted."""


class Room(NamedTuple):
    """Memory that a march writes to."""

    size: int
    """Of the block, in numbers."""
    block: Array
    tangent: Array
    """Derivatives of the states at the first sample, replaced by those behind the last."""
    aside: Array
    """(STRIDE,) a row before it is interpolated."""
    products: Array
    """(EIGHTH,) see `absorb`."""
    integral_states: Array
    """(i, 3) states of integrals, zeros before the first sample."""
    next_sample: Indices
    """(r,) next sample of each observation."""


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


def absorb(sink: int, room: int) -> None:
    """Rotate the rows of a sink into the triangular factor of all rows before it.

    They are used up, and are to be zeros where there are fewer than ROWS.
    """
    columns = fields_of(sink, Sink).columns
    rows = fields_of(sink, Sink).rows
    factor = fields_of(sink, Sink).factor
    products = fields_of(room, Room).products
    for j in range(columns):
        pivot, line = behind(rows, j * ROWS), behind(factor, j * columns)
        square = dot(pivot, pivot, products)
        if square < NOTHING:
            continue  # nothing to rotate, as with a parameter that the block does not depend on
        corner = line[j]
        norm = sqrt(corner * corner + square)
        diagonal = -norm if corner > 0.0 else norm
        lead = corner - diagonal
        # the reflection 1 - v vᵀ · scale with v = [lead, pivot]: no difference of like numbers
        scale = 1.0 / (norm * (norm + abs(corner)))
        line[j] = diagonal
        for k in range(j + 1, columns):
            column = behind(rows, k * ROWS)
            along = scale * (lead * line[k] + dot(pivot, column, products))
            line[k] -= along * lead
            for i in range(ROWS):
                column[i] -= along * pivot[i]


def upright(factor: Array) -> Array:
    """The triangle with rows turned so that no diagonal element is negative."""
    turned = np.where(np.diag(factor) < 0.0, -1.0, 1.0)
    return np.asarray(turned[:, None] * factor)


# --- rows -----------------------------------------------------------------------------------------


def combine(struct: int, flat: Array, t: int, shift: int, count: int, row: Array) -> None:
    """Sum the products of the terms of a program's sum t, from `shift` behind their rows' first."""
    program = fields_of(struct, Program)
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


def place(structs: int, r: int, first: int, size: int, at: int, count: int, to: int) -> None:
    """Weighted rows of the problem at some stamps of an observation.

    `first` and `size` are the block's first sample and how many it has, `at` and `count` the first
    stamp and how many they are; they go into the sink from `to` on.
    """
    march = fields_of(structs, March)
    program = fields_of(march.program, Program)
    plan = fields_of(march.plan, Plan)
    sink = fields_of(march.sink, Sink)
    room = fields_of(march.room, Room)
    flat, aside = room.block, room.aside
    cell = behind(plan.cell, at)
    fraction = behind(plan.fraction, at)
    weight = behind(plan.weight, at)
    measured = behind(plan.measured, at)
    begin = cell[0]
    end, behind_last = first + size, cell[count - 1] + 2
    width = min(behind_last, end) - begin
    for c in range(sink.derived):
        column = behind(sink.rows, sink.to[c] * sink.length + to)
        t = program.first_observed + r * sink.derived + c
        if plan.regular[r]:
            run_routine(march.combine, (march.program, flat, t, begin - first, count, column))
            for i in range(0 if not plan.even[r] else count, count):
                column[i] *= weight[i]
        else:
            run_routine(march.combine, (march.program, flat, t, begin - first, width, aside))
            aside[width] = aside[width - 1]
            for i in range(count):
                n, f = cell[i] - begin, fraction[i]
                column[i] = weight[i] * ((1.0 - f) * aside[n] + f * aside[n + 1])
    for c in range(sink.own, sink.columns - 1):
        column = behind(sink.rows, c * sink.length + to)
        for i in range(count):
            column[i] = weight[i] if c == sink.offset_row[r] else 0.0
    signal, offset = behind(flat, program.value[r] + begin - first), sink.offset[r]
    column = behind(sink.rows, (sink.columns - 1) * sink.length + to)
    for i in range(count):
        n, f = cell[i] - begin, fraction[i]
        simulated = (1.0 - f) * signal[n] + f * signal[n + 1]
        column[i] = weight[i] * (simulated - (measured[i] - offset))


class March(NamedTuple):
    """Addresses of structs, and of routines, which are compiled alone (see `kernels.routine`)."""

    program: int
    plan: int
    sink: int
    room: int
    combine: int
    place: int
    absorb: int


@generating
def routines() -> tuple[Any, ...]:
    """The last fields of a `March`."""
    return routine(combine), routine(place), routine(absorb)


def march_struct(
    program: Struct[Program], plan: Struct[Plan], sink: Struct[Sink], room: Struct[Room]
) -> Struct[March]:
    """What `march_observed` is given, with routines, and structs, which must be kept as well."""
    structs = program.address, plan.address, sink.address, room.address
    return Struct(March(*structs, *routines()))


def march_observed(kernels: Indices, arrays: Indices, size: int, h: float, structs: int) -> None:
    """March block by block, and compare what comes with what was observed.

    `kernels` are addresses, of the march first. `arrays` is what they take from ``records`` on (see
    `kernels.KERNEL_ARGUMENTS`), of a record of `size` samples with step `h`. `structs` is the
    address of a `March`.
    """
    march = fields_of(structs, March)
    program = fields_of(march.program, Program)
    plan = fields_of(march.plan, Plan)
    sink = fields_of(march.sink, Sink)
    room = fields_of(march.room, Room)
    flat = room.block
    used = 0  # Rows that wait in the sink to be rotated.
    look_back = False
    for r in range(plan.observations):
        look_back = look_back or plan.regular[r] == 0
    for first in range(0, size, BLOCK):
        if first > 0 and look_back:
            # what interpolation looks back at, from the end of the block before
            for k in range(STRIDE, room.size, STRIDE):
                flat[k - 1] = flat[k + BLOCK - 1]
        count = min(size - first, BLOCK)
        for step in range(program.steps):
            todo = behind(program.todo, 4 * step)
            what, a, b = todo[0], todo[1], todo[2]
            if what == CALL:
                call_kernel(kernels[a], count, first, h, arrays)
            elif what == COMBINE:
                for t in range(a, b):
                    row = behind(flat, program.target[t])
                    run_routine(march.combine, (march.program, flat, t, 0, count, row))
            elif what == INTEGRATE:
                integrate(behind(flat, a), count, h, behind(room.integral_states, 3 * b))
            else:
                lanes = behind(program.lanes, b)
                call_recurrence(kernels[a], count, lanes, todo[3] - b, room.tangent, arrays)
        for r in range(plan.observations):
            # off the grid the point behind the stamp must be known as well
            known = first + count - (first + count < size and plan.regular[r] == 0)
            row = behind(flat, program.value[r])
            row[count] = row[count - 1]
            at = room.next_sample[r]
            end = at
            while end < plan.first[r + 1] and plan.cell[end] < known:
                end += 1
            room.next_sample[r] = end
            while at < end:
                if sink.folded and plan.weight[at] == 0.0:
                    at += 1
                    continue
                many, left = end - at, sink.length - used
                many = min(many, left)
                for i in range(1, many if sink.folded else 0):
                    if plan.weight[at + i] == 0.0:
                        many = i
                        break
                to = used if sink.folded else at
                run_routine(march.place, (structs, r, first, count, at, many, to))
                at += many
                used += many if sink.folded else 0
                if sink.folded and used == sink.length:
                    run_routine(march.absorb, (march.sink, march.room))
                    used = 0
    if used > 0:
        for c in range(sink.columns):
            column = behind(sink.rows, c * sink.length)
            for i in range(used, sink.length):
                column[i] = 0.0
        run_routine(march.absorb, (march.sink, march.room))


@generating
def compiled_march() -> Any:
    """`march_observed`, compiled."""
    return routine(march_observed)
