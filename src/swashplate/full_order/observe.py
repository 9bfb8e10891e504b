"""Signals that follow from the rows of a full-order march, each sample for itself."""

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.cache import kernel
from swashplate.equations.definition import Flag
from swashplate.models.full_order import (
    Machine,
    Motion,
    machine_energies,
    machine_speed,
    valve_flow,
    valve_opening,
)
from swashplate.models.pump import Pump, solenoid_force

Array = NDArray[np.float64]


@kernel
def observe_speeds(rows: Array, machine: Machine, speed: Array) -> None:
    """Shaft speed of each row. [rad/s]"""
    for n in range(rows.shape[0]):
        speed[n] = machine_speed(rows[n, 3], rows[n, 4], machine)


@kernel
def observe_flows(
    rows: Array, machine: Machine, symmetric: Flag, opening: Array, flow: Array
) -> None:
    """Effective opening [m] and flow through the valve [m³/s] of each row."""
    for n in range(rows.shape[0]):
        opening[n] = valve_opening(rows[n, 0], machine)
        flow[n] = valve_flow(rows[n, 0], rows[n, 2], machine, symmetric)


@kernel
def stored_energies(rows: Array, machine: Machine, stored: Array) -> None:
    """`machine_energies` of each row. (n, 3) [J]"""
    for n in range(rows.shape[0]):
        state = Motion(rows[n, 0], rows[n, 1], rows[n, 2], rows[n, 3], rows[n, 4])
        stored[n, 0], stored[n, 1], stored[n, 2] = machine_energies(state, machine)


@kernel
def observe_force(current: Array, pump: Pump, force: Array) -> None:
    """Net solenoid force at each sample. [N]"""
    for n in range(current.size):
        force[n] = solenoid_force(current[n], pump)
