"""Compiled code of the full-order model: rates under holds, and a march with events located.

All of it stands in one file, because the cache of a kernel looks at its own file and at the
components of `swashplate.physics` and `swashplate.simulation`.

A sample's state is one row: the five states, then what has passed through the mechanisms since the
start (`ACCOUNTS`). A limit that holds is -1 or 1, one that does not is 0: the spool at its stroke,
the relief valve open, the swash plate at a stop. Stops are inelastic.
"""

import numpy as np
from numpy.typing import NDArray

from swashplate.physics.component import component
from swashplate.physics.five_states import (
    Machine,
    free_rate_partials,
    free_rates,
    machine_flow,
)
from swashplate.physics.machine_accounts import machine_energies, machine_powers, machine_speed
from swashplate.simulation.chain import pump_force
from swashplate.simulation.compilation import kernel
from swashplate.simulation.constants import Pump

Array = NDArray[np.float64]
Holds = tuple[int, int, int]
"""Spool, relief valve, swash plate."""
Flags = NDArray[np.int8]

ACCOUNTS = (
    "solenoid_work",
    "spool_damping_loss",
    "feedback_work",
    "piston_work",
    "piston_damping_loss",
    "pumping_work",
    "motor_work",
    "valve_volume",
    "leakage_volume",
    "relief_volume",
    "shaft_position",
)
N_STATES = 5
N_ROW = N_STATES + len(ACCOUNTS)
RELIEF_AT = N_STATES + ACCOUNTS.index("relief_volume")
BISECTIONS = 45
"""Halvings that locate an event within a step, to 3e-14 of it."""
MOST_EVENTS = 200
"""Events within one step, beyond which the limits are said to chatter."""


@component
def fill_rates(row: Array, force: float, holds: Holds, machine: Machine, rates: Array) -> None:
    """Rates of a whole row; a state that a limit holds has none."""
    x, v, p, angle, r = row[0], row[1], row[2], row[3], row[4]
    v_rate, p_rate, r_rate = free_rates(x, v, p, angle, r, force, machine)
    rates[0] = v
    rates[1] = 0.0 if holds[0] != 0 else v_rate
    rates[2] = 0.0 if holds[1] != 0 else p_rate
    rates[3] = r
    rates[4] = 0.0 if holds[2] != 0 else r_rate
    powers = machine_powers(x, v, p, angle, r, force, machine)
    for k in range(7):
        rates[5 + k] = powers[k]
    rates[12] = machine_flow(x, p, machine)
    rates[13] = machine.leakage * p
    rates[14] = p_rate * machine.volume / machine.bulk_modulus if holds[1] != 0 else 0.0
    rates[15] = machine_speed(angle, r, machine)


@kernel
def runge_kutta(
    row: Array,
    current: float,
    slope: float,
    step: float,
    holds: Holds,
    machine: Machine,
    pump: Pump,
    work: Array,
    into: Array,
) -> float:
    """One step of the classical Runge-Kutta method; returns the force at its end. [N]

    The current [A] rises along a straight line of the given slope [A/s]; `work` is (2, N_ROW).
    """
    stage, rates = work[0], work[1]
    force = pump_force(current, pump)
    for k in range(N_ROW):
        into[k] = row[k]
        stage[k] = row[k]
    for n in range(4):
        fill_rates(stage, force, holds, machine, rates)
        weight = step / 6.0 if n == 0 or n == 3 else step / 3.0
        reach = step if n == 2 else 0.5 * step
        for k in range(N_ROW):
            into[k] += weight * rates[k]
        if n < 3:
            # rates depend on the states alone, not on the accounts
            for k in range(N_STATES):
                stage[k] = row[k] + reach * rates[k]
            if n != 1:
                force = pump_force(current + slope * reach, pump)
    return force


@kernel
def margin(row: Array, force: float, holds: Holds, machine: Machine) -> float:
    """How far a row is from its next event: negative beyond. [1]

    A free state must stay within its limits; a held one must still be pushed against its limit.
    """
    x, v, p, angle, r = row[0], row[1], row[2], row[3], row[4]
    spool, relief, plate = holds
    least = np.inf
    if spool == 0:
        least = min(least, (machine.stroke - abs(x)) / machine.stroke)
    if relief == 0:
        least = min(least, (machine.upper_pressure - p) / machine.supply_pressure)
        least = min(least, (p - machine.lower_pressure) / machine.supply_pressure)
    if plate == 0:
        least = min(least, machine.upper_angle - angle)
        least = min(least, angle - machine.lower_angle)
    if spool == 0 and relief == 0 and plate == 0:
        return least
    v_rate, p_rate, r_rate = free_rates(x, v, p, angle, r, force, machine)
    if spool != 0:
        least = min(least, spool * v_rate)
    if relief != 0:
        least = min(least, relief * p_rate / machine.bulk_modulus)
    if plate != 0:
        least = min(least, plate * r_rate + machine.grip)
    return least


@kernel
def settle(
    row: Array, force: float, holds: Holds, machine: Machine, losses: Array
) -> tuple[int, int, int]:
    """Which limits hold from here on; what arrives at one is set on it and stops there.

    Parameters
    ----------
    row : (N_ROW,) array
        Changed in place: position and velocity, pressure, angle and swash rate.
    losses : (2,) array
        Energy that the stops of spool and swash plate have taken, added to. [J]
    """
    before = machine_energies(row[0], row[1], row[3], row[4], machine)
    spool = 0
    if abs(row[0]) >= machine.stroke and row[0] * row[1] >= 0.0:
        spool = 1 if row[0] > 0.0 else -1
        row[0], row[1] = spool * machine.stroke, 0.0
    plate = 0
    if row[3] >= machine.upper_angle and row[4] >= 0.0:
        plate = 1
        row[3], row[4] = machine.upper_angle, 0.0
    elif row[3] <= machine.lower_angle and row[4] <= 0.0:
        plate = -1
        row[3], row[4] = machine.lower_angle, 0.0
    after = machine_energies(row[0], row[1], row[3], row[4], machine)
    losses[0] += before[0] - after[0]
    losses[1] += before[1] - after[1]
    relief = 0
    if row[2] >= machine.upper_pressure:
        relief = 1
        row[2] = machine.upper_pressure
    elif row[2] <= machine.lower_pressure:
        relief = -1
        row[2] = machine.lower_pressure
    v_rate, p_rate, r_rate = free_rates(row[0], row[1], row[2], row[3], row[4], force, machine)
    spool = spool if spool * v_rate >= 0.0 else 0
    relief = relief if relief * p_rate >= 0.0 else 0
    if plate != 0 and plate * r_rate < -machine.grip:
        plate = 0
    return spool, relief, plate


@kernel
def march(
    current: Array,
    held: bool,
    step: float,
    substeps: int,
    machine: Machine,
    pump: Pump,
    rows: Array,
    holds_at: Flags,
    losses_at: Array,
) -> int:
    """March the five states over a signed current.

    Parameters
    ----------
    current : (n,) array
        Current at the samples, between them a straight line or, if `held`, constant. [A]
    step : float
        Distance of the samples. [s]
    substeps : int
        Runge-Kutta steps a sample.
    rows : (n, N_ROW) array
        Output; its first row is the start.
    holds_at : (n, 3) array
        Output: limits that hold at the samples.
    losses_at : (n, 2) array
        Output: energy taken so far by the stops of spool and swash plate. [J]

    Returns
    -------
    int
        Events, or -1 - n where limits chatter after sample n, or a state is no number.
    """
    work = np.empty((2, N_ROW))
    row, following = rows[0].copy(), np.empty(N_ROW)
    losses = np.zeros(2)
    holds = settle(row, pump_force(current[0], pump), (0, 0, 0), machine, losses)
    events = 0
    h = step / substeps
    for n in range(current.size):
        for k in range(N_ROW):
            rows[n, k] = row[k]
        for k in range(3):
            holds_at[n, k] = holds[k]
        losses_at[n, 0], losses_at[n, 1] = losses[0], losses[1]
        if n == current.size - 1:
            break
        slope = 0.0 if held else (current[n + 1] - current[n]) / step
        for m in range(substeps):
            begin = current[n] + slope * (m * h)
            remaining, passed = h, 0
            while remaining > 0.0:
                force = runge_kutta(
                    row, begin, slope, remaining, holds, machine, pump, work, following
                )
                if margin(following, force, holds, machine) >= 0.0:
                    row, following = following, row
                    break
                passed += 1
                if passed > MOST_EVENTS:
                    return -1 - n
                low, high = 0.0, remaining
                for _ in range(BISECTIONS):
                    middle = 0.5 * (low + high)
                    force = runge_kutta(
                        row, begin, slope, middle, holds, machine, pump, work, following
                    )
                    if margin(following, force, holds, machine) >= 0.0:
                        low = middle
                    else:
                        high = middle
                force = runge_kutta(row, begin, slope, high, holds, machine, pump, work, following)
                row, following = following, row
                holds = settle(row, force, holds, machine, losses)
                remaining -= high
                begin += slope * high
                events += 1
        if not np.isfinite(row[0] + row[2] + row[3]):
            return -1 - n
    return events


@component
def current_at(time: float, current: Array, held: bool, step: float) -> float:
    """Current at any time of the record. [A]"""
    at = min(max(time / step, 0.0), current.size - 1.0)
    n = max(min(int(at), current.size - 2), 0)
    rise = 0.0 if held else at - n
    return float(current[n] + rise * (current[min(n + 1, current.size - 1)] - current[n]))


@kernel
def rates_at(
    time: float,
    row: Array,
    current: Array,
    held: bool,
    step: float,
    holds: Holds,
    machine: Machine,
    pump: Pump,
) -> Array:
    """Rates of a row at any time of the record: the right-hand side for a library's solver."""
    rates = np.empty(N_ROW)
    force = pump_force(current_at(time, current, held, step), pump)
    fill_rates(row, force, holds, machine, rates)
    return rates


@kernel
def jacobian_at(
    time: float,
    row: Array,
    current: Array,
    held: bool,
    step: float,
    holds: Holds,
    machine: Machine,
    pump: Pump,
) -> Array:
    """Derivatives of the rates by the five states.

    Those of the accounts are left zero: they feed back on nothing, so that an iteration on the
    states settles them as well.
    """
    jacobian = np.zeros((N_ROW, N_ROW))
    force = pump_force(current_at(time, current, held, step), pump)
    by_v, by_p, by_r = free_rate_partials(row[0], row[1], row[2], row[3], row[4], force, machine)
    jacobian[0, 1] = 1.0
    jacobian[3, 4] = 1.0
    if holds[0] == 0:
        jacobian[1, 0], jacobian[1, 1], jacobian[1, 3] = by_v
    if holds[1] == 0:
        jacobian[2, 0], jacobian[2, 2], jacobian[2, 3], jacobian[2, 4] = by_p
    if holds[2] == 0:
        jacobian[4, 2], jacobian[4, 3], jacobian[4, 4] = by_r
    return jacobian


@kernel
def margin_at(
    time: float,
    row: Array,
    current: Array,
    held: bool,
    step: float,
    holds: Holds,
    machine: Machine,
    pump: Pump,
) -> float:
    """`margin` at any time of the record, the event function of a library's solver."""
    force = pump_force(current_at(time, current, held, step), pump)
    return margin(row, force, holds, machine)


@kernel
def first_short(
    times: Array,
    rows: Array,
    least: float,
    current: Array,
    held: bool,
    step: float,
    holds: Holds,
    machine: Machine,
    pump: Pump,
) -> int:
    """First of the rows (m, N_ROW) at times (m,) whose margin is below `least`, or -1."""
    for n in range(times.size):
        if margin_at(times[n], rows[n], current, held, step, holds, machine, pump) < least:
            return n
    return -1


@kernel
def settle_at(
    time: float,
    row: Array,
    current: Array,
    held: bool,
    step: float,
    holds: Holds,
    machine: Machine,
    pump: Pump,
    losses: Array,
) -> tuple[int, int, int]:
    """`settle` at any time of the record."""
    force = pump_force(current_at(time, current, held, step), pump)
    return settle(row, force, holds, machine, losses)
