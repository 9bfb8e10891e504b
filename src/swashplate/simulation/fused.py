"""Residuals of observations with their derivatives, a block of samples after the other.

What a fit needs of a march: simulated signals at the stamps of what was measured, their residuals
and derivatives by the free parameters, or at once the triangular factor of all that. Nothing grows
with the record's length but what the caller asks for.

States come from the same functions as in `march`, to the last bit. The readable form of the same
derivatives is `sensitivities`, sample by sample; here they are taken apart into what waits for the
sample before (`recurrences`) and what does not (`card_block`, `pump_block`, `observe`).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.simulation.blocks import (
    ASIDE,
    CURRENT,
    CURRENT_MINUS,
    CURRENT_PLUS,
    N_ROWS,
    PRESSURE,
    ROWS_OF_ZEROS,
    STRIDE,
    Columns,
    Tangents,
)
from swashplate.simulation.card_block import march_card
from swashplate.simulation.compilation import kernel
from swashplate.simulation.constants import Channel, Delay, Pump
from swashplate.simulation.march import march_pump
from swashplate.simulation.observe import CURRENT_NEGATIVE, POSITION, observe, observe_columns
from swashplate.simulation.placing import CARRIED, Plan, Sink, low_pass, place, rotate
from swashplate.simulation.pump_block import derive_pressure
from swashplate.simulation.recurrences import ABREAST, integrate_row
from swashplate.simulation.triangle import EIGHTH, absorb, aligned, aligned_room

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class Room(NamedTuple):
    """Memory to work in; d columns, r observations, up to q low passes each."""

    flat: Array
    """The block, see `blocks`."""
    table: Array
    """(N_ROWS, STRIDE) the same."""
    seen: Array
    """(r, d + 2, STRIDE) of each observation its derivatives, the signal, and an idle row."""
    filled: Indices
    """Numbers of these rows, filled up for `recurrences`."""
    passed: Array
    """(r, q, d + 2) outputs of the low passes at the next sample."""
    integrals: Array
    """(r, d + 1, 3) see `integrate_row`."""
    products: Array
    """Room for `absorb`."""


def room_for(derived: int, observations: int, low_passes: int) -> Room:
    """Memory for a march with so many columns, observations and low passes an observation."""
    flat = aligned_room(N_ROWS * STRIDE)
    table = flat.reshape(N_ROWS, STRIDE)
    table[list(ROWS_OF_ZEROS)] = 0.0
    idle = (derived + 1,) * (-(derived + 1) % ABREAST)
    return Room(
        flat,
        table,
        aligned(observations, derived + 2, STRIDE),
        np.array([*range(derived + 1), *idle], dtype=np.int64),
        np.zeros((observations, low_passes, derived + 2)),
        np.zeros((observations, derived + 1, 3)),
        aligned(EIGHTH),
    )


@kernel
def march_observed(
    record: Array,
    by_voltage: bool,
    before: float,
    delay: Delay,
    plus: Channel,
    minus: Channel,
    pump: Pump,
    step: float,
    block: int,
    start: tuple[float, float, float],
    tangents: Tangents,
    columns: Columns,
    plan: Plan,
    sink: Sink,
    room: Room,
) -> float:
    """March a drive over a record and compare it with what was observed.

    Parameters
    ----------
    record : (n,) array
        Voltage [V] or signed current [A] on the grid.
    by_voltage : bool
        Which of the two; with a current, delay and channels mean nothing.
    before, delay, plus, minus, pump, step, start :
        As in `march_drive`.
    block : int
        Samples of a block, at most BLOCK. The result does not depend on it, rounding apart.
    tangents : Tangents
        Derivatives at the start; used up.
    columns : Columns
        The derivatives wanted; without any, residuals alone are computed.
    plan : Plan
        The observations.
    sink : Sink
        Filled.
    room : Room
        Memory from `room_for`, not used before.

    Returns
    -------
    float
        Largest sin²φ met, see `march_drive`; 0 where nothing but currents is observed.
    """
    table, derived = room.table, columns.pressure.size
    currents = np.zeros((2, 3))
    for k in range(3):
        currents[0, k], currents[1, k] = start[0], start[1]
    pumped = False
    for signal in plan.signal:
        pumped = pumped or signal > CURRENT_NEGATIVE
    progress = plan.first.copy()
    pressure, worst, count = start[2], 0.0, 0
    used = int(plan.first[0])  # none, but no literal, which would be compiled for twice
    for first in range(0, record.size, block):
        # what interpolation looks back at, from the end of the block before
        for r in range(plan.signal.size):
            for c in range(derived + 1):
                row = room.seen[r, c]
                row[CARRIED - 2] = row[CARRIED + count - 2]
                row[CARRIED - 1] = row[CARRIED + count - 1]
        count = min(block, record.size - first)
        if by_voltage:
            march_card(
                record,
                first,
                count,
                before,
                delay,
                plus,
                minus,
                step,
                currents,
                columns,
                tangents,
                room.flat,
                table,
            )
        else:
            for m in range(count):
                table[CURRENT, m] = record[first + m]
                table[CURRENT_PLUS, m] = max(record[first + m], 0.0)
                table[CURRENT_MINUS, m] = max(-record[first + m], 0.0)
        if pumped:
            # one place more, for the pressure that the next block begins with
            table[CURRENT, count] = 0.0
            met = march_pump(
                table[CURRENT, : count + 1], pump, step, pressure, table[PRESSURE, : count + 1]
            )
            pressure, worst = table[PRESSURE, count], max(worst, met)
            if derived > 0:
                derive_pressure(count, pump, step, columns, tangents.pressure, room.flat, table)

        base, last = first - CARRIED, first + count == record.size
        for r in range(plan.signal.size):
            signal, rows = plan.signal[r], room.seen[r]
            observe(signal, count, pump, table, rows[derived, CARRIED:])
            if derived > 0:
                observe_columns(signal, count, pump, columns, room.flat, table, CARRIED, rows)
            if signal == POSITION:
                for c in range(derived + 1):
                    integrate_row(rows[c], CARRIED, count, step, room.integrals[r, c])
            for q in range(plan.kept.shape[1]):
                kept = plan.kept[r, q]
                if kept > 0.0:
                    low_pass(
                        kept, first == 0, count, room.filled, table[ASIDE], room.passed[r, q], rows
                    )
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
    if used > 0:
        for c in range(sink.rows.shape[0]):
            for i in range(used, sink.rows.shape[1]):
                sink.rows[c, i] = 0.0
        absorb(sink.rows, sink.factor, room.products)
    return worst
