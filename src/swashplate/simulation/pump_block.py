"""The pump over a block of samples: derivatives of the stroking pressure."""

import numpy as np
from numpy.typing import NDArray

from swashplate.simulation.blocks import (
    BY_CURRENT,
    BY_PRESSURE,
    CURRENT,
    D_MINUS,
    D_PLUS,
    D_PRESSURE,
    MINUS_AT,
    N_PRESSURE_ROWS,
    OPENING,
    OPENING_BY,
    OPENING_BY_CURRENT,
    OPENING_BY_PRESSURE,
    PLUS_AT,
    PRESSURE,
    START_AT,
    STRIDE,
    TAU_AT,
    Columns,
)
from swashplate.simulation.compilation import kernel
from swashplate.simulation.constants import Pump
from swashplate.simulation.recurrences import follow
from swashplate.simulation.tangent import (
    TAU,
    LimitPartials,
    limits_by_parameters,
    pump_partials,
)

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@kernel
def fill_partials(
    count: int, pump: Pump, limits_by: LimitPartials, step: float, flat: Array
) -> None:
    """Partial derivatives of the next pressure at known states, in loops without a wait."""
    for m in range(count):
        _, by_pressure, by_current, opening, opening_by_pressure, opening_by_current = (
            pump_partials(
                flat[PRESSURE * STRIDE + m],
                flat[CURRENT * STRIDE + m],
                pump,
                limits_by,
                step,
                flat,
                D_PRESSURE * STRIDE + m,
                OPENING_BY * STRIDE + m,
                STRIDE,
            )
        )
        flat[BY_PRESSURE * STRIDE + m] = by_pressure
        flat[BY_CURRENT * STRIDE + m] = by_current
        flat[OPENING * STRIDE + m] = opening
        flat[OPENING_BY_PRESSURE * STRIDE + m] = opening_by_pressure
        flat[OPENING_BY_CURRENT * STRIDE + m] = opening_by_current


@kernel
def fill_current(
    table: Array, row: int, count: int, plus: float, minus: float, into: Array
) -> None:
    """Derivative of plus · I₊ + minus · I₋ by the parameter of a row of δP's derivatives.

    Zero for parameters that are not the card's.
    """
    if row == TAU_AT:
        by_plus, by_minus = table[D_PLUS + TAU], table[D_MINUS + TAU]
        for m in range(count):
            into[m] = plus * by_plus[m] + minus * by_minus[m]
    elif PLUS_AT <= row < TAU_AT:
        by = table[D_PLUS + row - PLUS_AT if row < MINUS_AT else D_MINUS + row - MINUS_AT]
        sign = plus if row < MINUS_AT else minus
        for m in range(count):
            into[m] = sign * by[m]
    else:
        for m in range(count):
            into[m] = 0.0


@kernel
def derive_pressure(
    count: int,
    pump: Pump,
    step: float,
    columns: Columns,
    tangent: Array,
    flat: Array,
    table: Array,
) -> None:
    """Derivatives of δP over a block whose states and derivatives of the current are known.

    Parameters
    ----------
    columns : Columns
        What is wanted.
    tangent : (N_PRESSURE_ROWS,) array
        Derivatives at the first sample, replaced by those behind the last. [Pa/...]
    flat, table : arrays
        The block.
    """
    fill_partials(count, pump, limits_by_parameters(pump), step, flat)
    rows = table[D_PRESSURE : D_PRESSURE + N_PRESSURE_ROWS]
    for m in range(count):
        rows[START_AT, m] = 0.0
    for row in columns.pressure:
        if PLUS_AT <= row <= TAU_AT:
            direct, by_current = rows[row], table[BY_CURRENT]
            fill_current(table, row, count, 1.0, -1.0, direct)
            for m in range(count):
                direct[m] = by_current[m] * direct[m]
    follow(table[BY_PRESSURE], rows, columns.pressure_filled, 0, count, tangent)
