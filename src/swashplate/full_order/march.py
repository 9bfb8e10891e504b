"""Compiled code of the full-order model: rates under holds, and a march with events located.

All of it stands in one file, because the cache of a kernel looks at its own file and at the
components of `swashplate.physics` and `swashplate.simulation`.

A sample's state is one row: the five states, then what has passed through the mechanisms since the
start (`ACCOUNTS`). A limit that holds is -1 or 1, one that does not is 0: the spool at its stroke,
the relief valve open, the swash plate at a stop. Stops are inelastic.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.cache import kernel
from swashplate.equations.definition import Flag
from swashplate.equations.derivatives import derive
from swashplate.equations.equation import inlined
from swashplate.equations.run import module
from swashplate.full_order.machine import Plate
from swashplate.models.full_order import (
    Motion,
    free_rates,
    machine_energies,
    machine_powers,
    machine_speed,
)
from swashplate.models.pump import Pump, solenoid_force

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


@inlined
def fill_rates(row: Array, force: float, holds: Holds, machine: Plate, rates: Array) -> None:
    """Rates of a whole row; a state that a limit holds has none."""
    state = Motion(row[0], row[1], row[2], row[3], row[4])
    v_rate, p_rate, r_rate = free_rates(state, force, machine.p, machine.symmetric)
    rates[0] = row[1]
    rates[1] = 0.0 if holds[0] != 0 else v_rate
    rates[2] = 0.0 if holds[1] != 0 else p_rate
    rates[3] = row[4]
    rates[4] = 0.0 if holds[2] != 0 else r_rate
    powers = machine_powers(state, force, machine.p, machine.symmetric)
    for k in range(9):
        rates[5 + k] = powers[k]
    softness = machine.p.oil_volume / machine.p.bulk_modulus
    rates[14] = p_rate * softness if holds[1] != 0 else 0.0
    rates[15] = machine_speed(row[3], row[4], machine.p)


@kernel
def runge_kutta(
    row: Array,
    current: float,
    slope: float,
    step: float,
    holds: Holds,
    machine: Plate,
    pump: Pump,
    work: Array,
    into: Array,
) -> float:
    """One step of the classical Runge-Kutta method; returns the force at its end. [N]

    The current [A] rises along a straight line of the given slope [A/s]; `work` is (2, N_ROW).
    """
    stage, rates = work[0], work[1]
    force = solenoid_force(current, pump)
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
                force = solenoid_force(current + slope * reach, pump)
    return force


@kernel
def margin(row: Array, force: float, holds: Holds, machine: Plate) -> float:
    """How far a row is from its next event: negative beyond. [1]

    A free state must stay within its limits; a held one must still be pushed against its limit.
    """
    state = Motion(row[0], row[1], row[2], row[3], row[4])
    m, k = machine.p, machine.k
    spool, relief, plate = holds
    least = np.inf
    if spool == 0:
        least = min(least, (m.spool_stroke - abs(row[0])) / m.spool_stroke)
    if relief == 0:
        least = min(least, (k.upper - row[2]) / m.supply_pressure)
        least = min(least, (row[2] - k.lower) / m.supply_pressure)
    if plate == 0:
        least = min(least, m.swash_stop_plus - row[3])
        least = min(least, row[3] + m.swash_stop_minus)
    if spool == 0 and relief == 0 and plate == 0:
        return least
    v_rate, p_rate, r_rate = free_rates(state, force, m, machine.symmetric)
    if spool != 0:
        least = min(least, spool * v_rate)
    if relief != 0:
        least = min(least, relief * p_rate / m.bulk_modulus)
    if plate != 0:
        least = min(least, plate * r_rate + k.grip)
    return least


@kernel
def settle(
    row: Array, force: float, holds: Holds, machine: Plate, losses: Array
) -> tuple[int, int, int]:
    """Which limits hold from here on; what arrives at one is set on it and stops there.

    Parameters
    ----------
    row : (N_ROW,) array
        Changed in place: position and velocity, pressure, angle and swash rate.
    losses : (2,) array
        Energy that the stops of spool and swash plate have taken, added to. [J]
    """
    m, k = machine.p, machine.k
    before = machine_energies(Motion(row[0], row[1], row[2], row[3], row[4]), m)
    spool = 0
    if abs(row[0]) >= m.spool_stroke and row[0] * row[1] >= 0.0:
        spool = 1 if row[0] > 0.0 else -1
        row[0], row[1] = spool * m.spool_stroke, 0.0
    plate = 0
    if row[3] >= m.swash_stop_plus and row[4] >= 0.0:
        plate = 1
        row[3], row[4] = m.swash_stop_plus, 0.0
    elif row[3] <= -m.swash_stop_minus and row[4] <= 0.0:
        plate = -1
        row[3], row[4] = -m.swash_stop_minus, 0.0
    after = machine_energies(Motion(row[0], row[1], row[2], row[3], row[4]), m)
    losses[0] += before[0] - after[0]
    losses[1] += before[1] - after[1]
    relief = 0
    if row[2] >= k.upper:
        relief = 1
        row[2] = k.upper
    elif row[2] <= k.lower:
        relief = -1
        row[2] = k.lower
    state = Motion(row[0], row[1], row[2], row[3], row[4])
    v_rate, p_rate, r_rate = free_rates(state, force, m, machine.symmetric)
    spool = spool if spool * v_rate >= 0.0 else 0
    relief = relief if relief * p_rate >= 0.0 else 0
    if plate != 0 and plate * r_rate < -k.grip:
        plate = 0
    return spool, relief, plate


@kernel
def march(
    current: Array,
    held: bool,
    step: float,
    substeps: int,
    machine: Plate,
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
    holds = settle(row, solenoid_force(current[0], pump), (0, 0, 0), machine, losses)
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


@inlined
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
    machine: Plate,
    pump: Pump,
) -> Array:
    """Rates of a row at any time of the record: the right-hand side for a library's solver."""
    rates = np.empty(N_ROW)
    force = solenoid_force(current_at(time, current, held, step), pump)
    fill_rates(row, force, holds, machine, rates)
    return rates


@lru_cache(maxsize=2)
def rates_with_slopes(symmetric: Flag) -> Callable[..., None]:
    """The compiled rates' derivatives by the five states, as rows of a matrix."""
    made = derive(free_rates, by="state", options={"symmetric": symmetric})
    text = "\n\n".join(f"@inlined\n{each}" for each in made.texts.values())
    count = len(made.outputs)
    lines = [
        f"matrix[{(1, 2, 4)[row]}, {column}] = found[{count + place}]"
        for place, (row, column) in enumerate(made.entries)
    ]
    text += "\n\n@kernel\ndef slopes(state, force, p, matrix):\n"
    text += f"    found = {made.name}(state, force, p, {symmetric})\n    "
    text += "\n    ".join(lines) + "\n"
    return module("full_order_slopes", text, made.names)["slopes"]  # type: ignore[no-any-return]


def jacobian_at(
    time: float,
    row: Array,
    current: Array,
    held: bool,
    step: float,
    holds: Holds,
    machine: Plate,
    pump: Pump,
) -> Array:
    """Derivatives of the rates by the five states.

    Those of the accounts are left zero: they feed back on nothing, so that an iteration on the
    states settles them as well.
    """
    jacobian = np.zeros((N_ROW, N_ROW))
    force = force_at(time, current, held, step, pump)
    rates_with_slopes(machine.symmetric)(Motion(*row[:N_STATES]), force, machine.p, jacobian)
    jacobian[0, 1] = 1.0
    jacobian[3, 4] = 1.0
    for hold, at in zip(holds, (1, 2, 4), strict=True):
        if hold != 0:
            jacobian[at] = 0.0
    return jacobian


@kernel
def force_at(time: float, current: Array, held: bool, step: float, pump: Pump) -> float:
    """Net solenoid force at any time of the record. [N]"""
    return solenoid_force(current_at(time, current, held, step), pump)


@kernel
def margin_at(
    time: float,
    row: Array,
    current: Array,
    held: bool,
    step: float,
    holds: Holds,
    machine: Plate,
    pump: Pump,
) -> float:
    """`margin` at any time of the record, the event function of a library's solver."""
    force = solenoid_force(current_at(time, current, held, step), pump)
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
    machine: Plate,
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
    machine: Plate,
    pump: Pump,
    losses: Array,
) -> tuple[int, int, int]:
    """`settle` at any time of the record."""
    force = solenoid_force(current_at(time, current, held, step), pump)
    return settle(row, force, holds, machine, losses)
