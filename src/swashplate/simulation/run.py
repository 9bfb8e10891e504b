"""Plain simulation: from a parameter set and a record to a result."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError, InputError
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.simulation.build import build, build_pump
from swashplate.simulation.constants import Channel, Pump
from swashplate.simulation.march import march_drive, march_pump
from swashplate.simulation.record import Record
from swashplate.simulation.result import CardSignals, Simulation
from swashplate.simulation.steady import steady_pump_start, steady_start

Array = NDArray[np.float64]
Start = Literal["rest", "steady"]


def check_start(start: str) -> None:
    """Refuse a start that is neither ``"rest"`` nor ``"steady"``."""
    if start not in ("rest", "steady"):
        raise InputError(f"start is '{start}'; it is 'rest' or 'steady'.")


def rest_pressure(pump: Pump) -> float:
    """δP at which the swash plate stands upright, Z2/Z1. [Pa]"""
    return pump.Z2 / pump.Z1


def drive_start(
    command: Array, plus: Channel, minus: Channel, pump: Pump, start: Start
) -> tuple[float, tuple[float, float, float]]:
    """Command before the record [V]; currents of both channels [A] and δP [Pa] at its start."""
    check_start(start)
    if start == "rest":
        return 0.0, (0.0, 0.0, rest_pressure(pump))
    before = float(command[0])
    return before, steady_start(before, plus, minus, pump)


def pump_start(current: Array, pump: Pump, start: Start) -> float:
    """δP at the start of a current record. [Pa]"""
    check_start(start)
    return rest_pressure(pump) if start == "rest" else steady_pump_start(float(current[0]), pump)


def check_domain(name: str, worst: float, drive: str) -> None:
    """Refuse what was computed outside the model's equations.

    Raises
    ------
    DomainError
        If sin²φ reached 1: the solenoid overpowered the feedback spring.
    """
    if not worst < 1.0:
        raise DomainError(
            f"{name}: Z5·F/√Z4 reaches {np.sqrt(worst):.4g} under this {drive}, but must stay "
            "below 1, where the solenoid overpowers the feedback spring; check Z19 to Z22, Z4, Z5 "
            f"and the {drive}'s size."
        )


def check_start_pressure(name: str, pressure: float, pump: Pump) -> float:
    """A pressure to start with, refused where the drive cannot have it. [Pa]

    Raises
    ------
    InputError
        If it is no finite number.
    DomainError
        If it lies beyond a stop of the swash plate or Z15.
    """
    if not np.isfinite(pressure):
        raise InputError(f"The pressure at the start must be a finite number, not {pressure}.")
    if not pump.lower <= pressure <= pump.upper:
        raise DomainError(
            f"{name}: the pressure at the start is {pressure:.6g} Pa, but the stops of the swash "
            f"plate and Z15 keep it between {pump.lower:.6g} and {pump.upper:.6g} Pa."
        )
    return float(pressure)


def simulate_drive(
    parameters: ParameterSet, record: Record, start: Start, start_pressure: float | None = None
) -> Simulation:
    """March card and pump over a voltage record; see `Drive.simulate`.

    With `start_pressure` the pump begins there [Pa] and only the card's state is that of `start`.
    """
    delay, plus, minus, pump, step = build(parameters, record.step)
    command = record.values
    before, state = drive_start(command, plus, minus, pump, start)
    if start_pressure is not None:
        state = (*state[:2], check_start_pressure(parameters.name, start_pressure, pump))
    current_plus, current_minus, pressure = (np.empty_like(command) for _ in range(3))
    flags = np.empty(command.size, dtype=np.uint8)
    worst = march_drive(
        command,
        before,
        delay,
        plus,
        minus,
        pump,
        step,
        state,
        current_plus,
        current_minus,
        pressure,
        flags,
    )
    check_domain(parameters.name, worst, "voltage")
    card = CardSignals(current_plus, current_minus, flags)
    return Simulation(parameters.name, record, pump, pressure, card)


def simulate_pump(
    parameters: ParameterSet, record: Record, start: Start, start_pressure: float | None = None
) -> Simulation:
    """March the pump alone over a signed current; see `Drive.simulate_current`."""
    pump = build_pump(parameters)
    current = record.values
    pressure = np.empty_like(current)
    state = pump_start(current, pump, start)
    if start_pressure is not None:
        state = check_start_pressure(parameters.name, start_pressure, pump)
    worst = march_pump(current, pump, record.step, state, pressure)
    check_domain(parameters.name, worst, "current")
    return Simulation(parameters.name, record, pump, pressure)
