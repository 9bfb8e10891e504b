"""What is observed of a drive over a block of samples: a signal and its derivatives."""

import numpy as np
from numpy.typing import NDArray

from swashplate.physics.spool import (
    arm_sine_partials,
    opening_partials,
    spool_partials,
    stopped_spool,
)
from swashplate.physics.swash import (
    swash_angle,
    swash_angle_partials,
    swash_tangent,
    swash_tangent_partials,
)
from swashplate.simulation.blocks import (
    ASIDE,
    CURRENT,
    CURRENT_MINUS,
    CURRENT_PLUS,
    D_PRESSURE,
    OPENING,
    OPENING_BY,
    OPENING_BY_CURRENT,
    OPENING_BY_PRESSURE,
    PLUS_AT,
    PRESSURE,
    SIGNAL_BY,
    SIGNAL_BY_CURRENT,
    SIGNAL_BY_OPENING,
    SIGNAL_BY_PRESSURE,
    STRIDE,
    TAU_AT,
    Columns,
)
from swashplate.simulation.chain import pump_force, pump_speed, pump_spool
from swashplate.simulation.compilation import kernel
from swashplate.simulation.constants import Pump
from swashplate.simulation.pump_block import fill_current
from swashplate.simulation.tangent import (
    N_PUMP,
    Z1,
    Z2,
    Z3,
    Z4,
    Z5,
    Z6,
    Z7,
    Z8,
    Z9,
    Z10,
    Z11,
    Z12,
    Z13_MINUS,
    Z13_PLUS,
    Z14,
    Z16_MINUS,
    Z16_PLUS,
    Z17,
    Z18,
    Z19_PLUS,
    pump_force_partials,
    speed_partials,
    write_direct,
)

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

OBSERVABLE = (
    "current",
    "current_sum",
    "current_positive",
    "current_negative",
    "shaft_speed",
    "shaft_position",
    "stroker_pressure",
    "swash_angle",
    "spool_position",
)
"""Signals that can be observed; the kernels know them by their places here."""

(CURRENT_SIGNED, CURRENT_SUM, CURRENT_POSITIVE, CURRENT_NEGATIVE) = range(4)
(SPEED, POSITION, STROKER_PRESSURE, SWASH_ANGLE, SPOOL_POSITION) = range(4, 9)

SPEED_DEPENDS_ON = (Z1, Z2, Z6, Z7, Z8, Z9, Z10, Z11, Z12, Z13_PLUS, Z13_MINUS)
"""Directly, not by way of the pressure."""
ANGLE_DEPENDS_ON = (Z1, Z2, Z13_PLUS, Z13_MINUS)
SPOOL_DEPENDS_ON = (
    Z1,
    Z2,
    Z3,
    Z4,
    Z5,
    Z14,
    Z16_PLUS,
    Z16_MINUS,
    Z17,
    Z18,
    *range(Z19_PLUS, N_PUMP),
)


@kernel
def observe(signal: int, count: int, pump: Pump, table: Array, into: Array) -> None:
    """A signal over a block, by the same functions as in `Simulation`; a position as its rate."""
    pressure, current = table[PRESSURE], table[CURRENT]
    plus, minus = table[CURRENT_PLUS], table[CURRENT_MINUS]
    if signal == CURRENT_SUM:
        for m in range(count):
            into[m] = plus[m] + minus[m]
    elif signal == SWASH_ANGLE:
        for m in range(count):
            tangent = swash_tangent(pressure[m], pump.Z1, pump.Z2)
            into[m] = swash_angle(tangent, pump.Z13_plus, pump.Z13_minus, pump.steep)
    elif signal == SPOOL_POSITION:
        for m in range(count):
            free = pump_spool(pump_force(current[m], pump), pressure[m], pump)
            into[m] = stopped_spool(free, pump.Z14)
    elif signal in (SPEED, POSITION):
        for m in range(count):
            into[m] = pump_speed(pressure[m], current[m], pump)
    else:
        row = plus if signal == CURRENT_POSITIVE else minus
        row = current if signal == CURRENT_SIGNED else row
        row = pressure if signal == STROKER_PRESSURE else row
        for m in range(count):
            into[m] = row[m]


@kernel
def fill_speed(count: int, pump: Pump, flat: Array, marked: Flags) -> None:
    """Partial derivatives of the shaft speed."""
    for m in range(count):
        _, by_pressure, by_opening, direct = speed_partials(
            flat[PRESSURE * STRIDE + m],
            flat[OPENING * STRIDE + m],
            flat[OPENING_BY_PRESSURE * STRIDE + m],
            pump,
        )
        flat[SIGNAL_BY_PRESSURE * STRIDE + m] = by_pressure
        flat[SIGNAL_BY_CURRENT * STRIDE + m] = by_opening * flat[OPENING_BY_CURRENT * STRIDE + m]
        flat[SIGNAL_BY_OPENING * STRIDE + m] = by_opening
        flat[(SIGNAL_BY + Z6) * STRIDE + m] = direct[1]
        flat[(SIGNAL_BY + Z7) * STRIDE + m] = direct[2]
        flat[(SIGNAL_BY + Z8) * STRIDE + m] = direct[3]
        flat[(SIGNAL_BY + Z9) * STRIDE + m] = direct[4]
        flat[(SIGNAL_BY + Z1) * STRIDE + m] = direct[0] + direct[5]
        flat[(SIGNAL_BY + Z2) * STRIDE + m] = direct[6]
        flat[(SIGNAL_BY + Z10) * STRIDE + m] = direct[7]
        flat[(SIGNAL_BY + Z11) * STRIDE + m] = direct[8]
        flat[(SIGNAL_BY + Z12) * STRIDE + m] = direct[9]
        flat[(SIGNAL_BY + Z13_PLUS) * STRIDE + m] = direct[10]
        flat[(SIGNAL_BY + Z13_MINUS) * STRIDE + m] = direct[11]
    for k in SPEED_DEPENDS_ON:
        marked[k] = True
    if pump.loaded is not None:
        for k in range(N_PUMP):
            for m in range(count):
                through = flat[SIGNAL_BY_OPENING * STRIDE + m] * flat[(OPENING_BY + k) * STRIDE + m]
                alone = flat[(SIGNAL_BY + k) * STRIDE + m] if marked[k] else 0.0
                flat[(SIGNAL_BY + k) * STRIDE + m] = alone + through
            marked[k] = True


@kernel
def fill_angle(count: int, pump: Pump, flat: Array, marked: Flags) -> None:
    """Partial derivatives of the swash plate's angle."""
    for m in range(count):
        tangent, t_p, t_1, t_2 = swash_tangent_partials(
            flat[PRESSURE * STRIDE + m], pump.Z1, pump.Z2
        )
        _, a_t, a_13p, a_13m = swash_angle_partials(
            tangent, pump.Z13_plus, pump.Z13_minus, pump.steep
        )
        flat[SIGNAL_BY_PRESSURE * STRIDE + m] = a_t * t_p
        flat[(SIGNAL_BY + Z1) * STRIDE + m] = a_t * t_1
        flat[(SIGNAL_BY + Z2) * STRIDE + m] = a_t * t_2
        flat[(SIGNAL_BY + Z13_PLUS) * STRIDE + m] = a_13p
        flat[(SIGNAL_BY + Z13_MINUS) * STRIDE + m] = a_13m
    for k in ANGLE_DEPENDS_ON:
        marked[k] = True


@kernel
def fill_spool(count: int, pump: Pump, flat: Array, marked: Flags) -> None:
    """Partial derivatives of the spool's displacement within its stroke."""
    for m in range(count):
        force_by = pump_force_partials(flat[CURRENT * STRIDE + m], pump)
        arm_by = arm_sine_partials(flat[PRESSURE * STRIDE + m], pump.Z1, pump.Z2, pump.Z3)
        spool_by = spool_partials(force_by[0], arm_by[0], pump.Z4, pump.Z5, pump.Z18)
        # a stroke is an opening that no orifice limits
        stop_by = opening_partials(spool_by[0], pump.Z14, np.inf, np.inf)
        write_direct(1.0, force_by, arm_by, spool_by, stop_by, flat, SIGNAL_BY * STRIDE + m, STRIDE)
        flat[SIGNAL_BY_PRESSURE * STRIDE + m] = stop_by[1] * spool_by[2] * arm_by[1]
        flat[SIGNAL_BY_CURRENT * STRIDE + m] = stop_by[1] * spool_by[1] * force_by[1]
    for k in SPOOL_DEPENDS_ON:
        marked[k] = True


@kernel
def observe_columns(
    signal: int,
    count: int,
    pump: Pump,
    columns: Columns,
    flat: Array,
    table: Array,
    start: int,
    into: Array,
) -> None:
    """Derivatives of a signal over a block, of a position those of its rate.

    Parameters
    ----------
    signal : int
        Place in `OBSERVABLE`.
    columns : Columns
        The derivatives wanted.
    flat, table : arrays
        The block, with the derivatives of currents and δP.
    start : int
        Place in the rows of `into` from which on they are filled.
    into : (k or more, m) array
        A row for each column.
    """
    if signal <= CURRENT_NEGATIVE:
        plus = 0.0 if signal == CURRENT_NEGATIVE else 1.0
        minus = 0.0 if signal == CURRENT_POSITIVE else 1.0
        minus = -1.0 if signal == CURRENT_SIGNED else minus
        for c in range(columns.pressure.size):
            column = into[c, start : start + count]
            fill_current(table, columns.pressure[c], count, plus, minus, column)
        return
    marked = np.zeros(N_PUMP, dtype=np.bool_)
    through_current = False
    if signal == SWASH_ANGLE:
        fill_angle(count, pump, flat, marked)
    elif signal == SPOOL_POSITION:
        fill_spool(count, pump, flat, marked)
        through_current = True
    elif signal == STROKER_PRESSURE:
        for m in range(count):
            table[SIGNAL_BY_PRESSURE, m] = 1.0
    else:
        fill_speed(count, pump, flat, marked)
        through_current = pump.loaded is not None
    by_pressure, by_current = table[SIGNAL_BY_PRESSURE], table[SIGNAL_BY_CURRENT]
    for c in range(columns.pressure.size):
        row = columns.pressure[c]
        column, d_pressure = into[c, start : start + count], table[D_PRESSURE + row]
        for m in range(count):
            column[m] = by_pressure[m] * d_pressure[m]
        if row < PLUS_AT and marked[row]:
            direct = table[SIGNAL_BY + row]
            for m in range(count):
                column[m] += direct[m]
        elif through_current and PLUS_AT <= row <= TAU_AT:
            d_current = table[ASIDE]
            fill_current(table, row, count, 1.0, -1.0, d_current)
            for m in range(count):
                column[m] += by_current[m] * d_current[m]
