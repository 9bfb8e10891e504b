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
    call_kernel,
    call_recurrence,
    fields_of,
    routine,
    row_from,
    run_routine,
)

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

BLOCK = 512
"""Most samples of a block."""
STRIDE = BLOCK + 16
"""From one row to the next: not a power of two, so that rows do not share places in a cache; and
room before and after a row for the samples next to the block."""


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
    first_factor: Indices
    """(s,) row of a term's first factor."""
    second_factor: Indices
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
    """(m,) how far after it the stamp lies, in steps, 0 to 1."""
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
    target: Indices
    """(d,) rows where they go."""
    first_offset_row: int
    """First row of those by the observations' own offsets; residuals come after them."""
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
    """Derivatives of the states at the first sample, replaced by those after the last."""
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

    They are used up, and are to be zeros if there are fewer than ROWS.
    """
    columns = fields_of(sink, Sink).columns
    rows = fields_of(sink, Sink).rows
    factor = fields_of(sink, Sink).factor
    products = fields_of(room, Room).products
    for j in range(columns):
        pivot, line = row_from(rows, j * ROWS), row_from(factor, j * columns)
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
            column = row_from(rows, k * ROWS)
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
    """Sum the products of the terms of a program's sum t, from `shift` after their rows' first."""
    program = fields_of(struct, Program)
    first = program.first[t]
    end = program.first[t + 1]
    if first == end:
        for m in range(count):
            row[m] = 0.0
    for s in range(first, end):
        scale = program.scale[s]
        factor = row_from(flat, program.first_factor[s] + shift)
        if program.second_factor[s] >= 0:
            second = row_from(flat, program.second_factor[s] + shift)
            if s == first:
                for m in range(count):
                    row[m] = scale * (factor[m] * second[m])
            else:
                for m in range(count):
                    row[m] += scale * (factor[m] * second[m])
        elif s == first:
            for m in range(count):
                row[m] = scale * factor[m]
        else:
            for m in range(count):
                row[m] += scale * factor[m]


def integrate(row: Array, count: int, step: float, state: Array) -> None:
    """Replace a rate by its trapezoidal integral over the whole record.

    `state` holds integral and rate at the sample before, and 1.0 once there is one.
    """
    total = state[0]
    last = state[1]
    for n in range(count):
        rate = row[n]
        if state[2] != 0.0:
            total = total + 0.5 * step * (last + rate)
        state[2] = 1.0
        last = rate
        row[n] = total
    state[0] = total
    state[1] = last


def write_rows(structs: int, r: int, first: int, size: int, at: int, count: int, to: int) -> None:
    """Weighted rows of the problem at some stamps of an observation.

    `first` and `size` are the block's first sample and how many it has, `at` and `count` the first
    stamp and how many they are; they go into the sink from `to` on.
    """
    march = fields_of(structs, March)
    program = fields_of(march.program, Program)
    plan = fields_of(march.plan, Plan)
    sink = fields_of(march.sink, Sink)
    room = fields_of(march.room, Room)
    flat = room.block
    aside = room.aside
    cell = row_from(plan.cell, at)
    fraction = row_from(plan.fraction, at)
    weight = row_from(plan.weight, at)
    measured = row_from(plan.measured, at)
    begin = cell[0]
    width = min(first + size, cell[count - 1] + 2) - begin
    for c in range(sink.derived):
        column = row_from(sink.rows, sink.target[c] * sink.length + to)
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
    for c in range(sink.first_offset_row, sink.columns - 1):
        column = row_from(sink.rows, c * sink.length + to)
        for i in range(count):
            column[i] = weight[i] if c == sink.offset_row[r] else 0.0
    signal = row_from(flat, program.value[r] + begin - first)
    offset = sink.offset[r]
    column = row_from(sink.rows, (sink.columns - 1) * sink.length + to)
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
    write_rows: int
    absorb: int


@generating
def routines() -> tuple[Any, ...]:
    """The last fields of a `March`."""
    return routine(combine), routine(write_rows), routine(absorb)


def march_struct(
    program: Struct[Program], plan: Struct[Plan], sink: Struct[Sink], room: Struct[Room]
) -> Struct[March]:
    """What `march_observed` is given, with routines, and structs, which must be kept as well."""
    structs = program.address, plan.address, sink.address, room.address
    return Struct(March(*structs, *routines()))


def run_program(
    march: Any, kernels: Indices, arrays: Indices, first: int, count: int, h: float
) -> None:
    """Do in a block what the program says; arguments as in `march_observed`."""
    program = fields_of(march.program, Program)
    room = fields_of(march.room, Room)
    flat = room.block
    for step in range(program.steps):
        todo = row_from(program.todo, 4 * step)
        what = todo[0]
        if what == CALL:
            call_kernel(kernels[todo[1]], count, first, h, arrays)
        elif what == COMBINE:
            for t in range(todo[1], todo[2]):
                row = row_from(flat, program.target[t])
                run_routine(march.combine, (march.program, flat, t, 0, count, row))
        elif what == INTEGRATE:
            rate = row_from(flat, todo[1])
            integrate(rate, count, h, row_from(room.integral_states, 3 * todo[2]))
        else:
            begin = todo[2]
            lanes = row_from(program.lanes, begin)
            call_recurrence(kernels[todo[1]], count, lanes, todo[3] - begin, room.tangent, arrays)


def write_observation(
    structs: int, march: Any, r: int, first: int, count: int, size: int, waiting: int
) -> int:
    """Write the rows of an observation whose stamps lie in a block, and rotate full sinks.

    `waiting` rows wait in the sink to be rotated; returns how many do so then.
    """
    program = fields_of(march.program, Program)
    plan = fields_of(march.plan, Plan)
    sink = fields_of(march.sink, Sink)
    room = fields_of(march.room, Room)
    # off the grid the point after the stamp must be known as well
    points = first + count
    if points < size and plan.regular[r] == 0:
        points -= 1
    signal = row_from(room.block, program.value[r])
    signal[count] = signal[count - 1]
    stamp = room.next_sample[r]
    end = stamp
    while end < plan.first[r + 1] and plan.cell[end] < points:
        end += 1
    room.next_sample[r] = end
    while stamp < end:
        if sink.folded and plan.weight[stamp] == 0.0:
            stamp += 1
            continue
        many = min(end - stamp, sink.length - waiting)
        for i in range(1, many if sink.folded else 0):
            if plan.weight[stamp + i] == 0.0:
                many = i
                break
        to = waiting if sink.folded else stamp
        run_routine(march.write_rows, (structs, r, first, count, stamp, many, to))
        stamp += many
        waiting += many if sink.folded else 0
        if sink.folded and waiting == sink.length:
            run_routine(march.absorb, (march.sink, march.room))
            waiting = 0
    return waiting


def march_observed(kernels: Indices, arrays: Indices, size: int, h: float, structs: int) -> None:
    """March block by block, and compare what comes with what was observed.

    `kernels` are addresses, of the march first. `arrays` is what they take from ``records`` on (see
    `kernels.KERNEL_ARGUMENTS`), of a record of `size` samples with step `h`. `structs` is the
    address of a `March`.
    """
    march = fields_of(structs, March)
    plan = fields_of(march.plan, Plan)
    sink = fields_of(march.sink, Sink)
    room = fields_of(march.room, Room)
    flat = room.block
    waiting = 0  # Rows in the sink that are to be rotated.
    looks_back = False
    for r in range(plan.observations):
        looks_back = looks_back or plan.regular[r] == 0
    for first in range(0, size, BLOCK):
        if first > 0 and looks_back:
            # what interpolation looks back at, from the end of the block before
            for row in range(STRIDE, room.size, STRIDE):
                flat[row - 1] = flat[row + BLOCK - 1]
        count = min(size - first, BLOCK)
        run_program(march, kernels, arrays, first, count, h)
        for r in range(plan.observations):
            waiting = write_observation(structs, march, r, first, count, size, waiting)
    if waiting > 0:
        for c in range(sink.columns):
            column = row_from(sink.rows, c * sink.length)
            for i in range(waiting, sink.length):
                column[i] = 0.0
        run_routine(march.absorb, (march.sink, march.room))


@generating
def compiled_march() -> Any:
    """`march_observed`, compiled."""
    return routine(march_observed)
