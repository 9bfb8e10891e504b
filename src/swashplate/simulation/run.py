"""Simulation of a drive: from a parameter set and a record to a result, and its steady states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.equations.marching.part import Stored
from swashplate.equations.marching.record import Record, column
from swashplate.equations.marching.run import Instance, Start, Started, called, marched
from swashplate.errors import DomainError, InputError
from swashplate.models.displacement_control import PumpConstants
from swashplate.models.pump import PumpInputs, PumpState
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.simulation.instance import (
    check_filter_stability,
    instance_of,
    models_of,
    without_ripple,
)
from swashplate.simulation.result import KEPT, Simulation

Array = NDArray[np.float64]
Driver = Literal["voltage", "current"]


def check_voltage(record: Record, clip: bool) -> Record:
    """Refuse, or on request clip, a command beyond ±10 V; the first such sample is named."""
    low, high = float(record.values.min()), float(record.values.max())
    if low >= -FULL_VOLTAGE and high <= FULL_VOLTAGE:
        return record
    if clip:
        clipped = np.clip(record.values, -FULL_VOLTAGE, FULL_VOLTAGE)
        return Record(clipped, record.start, record.rate, record.substeps)
    first = int(np.argmax(np.abs(record.values) > FULL_VOLTAGE))
    raise InputError(
        f"The voltage is {record.values[first]:g} V at {record.start + first * record.step:g} s, "
        f"but the card takes ±{FULL_VOLTAGE:g} V; check its unit, or clip it."
    )


def simulate_drive(
    parameters: ParameterSet,
    record: Record,
    start: Start,
    start_pressure: float | None = None,
    measured: Mapping[str, Array] | None = None,
    *,
    driver: Driver = "voltage",
) -> Simulation:
    """March card and pump over a voltage record; see `Drive.simulate`.

    With `start_pressure` the pump begins there [Pa] and only the card's state is that of `start`.
    """
    if driver == "voltage":
        check_filter_stability(parameters, record.step)
    instance = instance_of(parameters, driver == "voltage")
    others = measured or {}
    records = {driver: record.values, **others}
    started = started_at(instance, records, record.step, start, start_pressure)
    out = marched(instance, records, record.step, started, KEPT, driver)
    return Simulation(parameters.name, record, instance, driver, started, out, others)


simulate_pump = partial(simulate_drive, driver="current")
"""March the pump alone over a signed current; see `Drive.simulate_current`."""


def started_at(
    instance: Instance,
    records: Mapping[str, Array],
    step: float,
    start: Start,
    start_pressure: float | None = None,
) -> Started:
    """Where a record begins, with the pump at a pressure of its own if one is given. [Pa]"""
    started = instance.start({name: float(v[0]) for name, v in records.items()}, step, start)
    if start_pressure is None:
        return started
    card, pump = started.states
    pump = pump._replace(**start_states(instance, start_pressure, started))
    return started._replace(states=(card, pump))


def start_states(instance: Instance, pressure: float, started: Started) -> dict[str, float]:
    """Numbers of the pump's state that a pressure at the start sets. [Pa]

    Raises
    ------
    InputError
        If it is no finite number.
    DomainError
        If it lies beyond a stop of the swash plate or Z15.
    """
    if not np.isfinite(pressure):
        raise InputError(f"The pressure at the start must be a finite number, not {pressure}.")
    k = started.arguments[1]["k"]
    if not k.lower <= pressure <= k.upper:
        raise DomainError(
            f"{instance.name}: the pressure at the start is {pressure:.6g} Pa, but the stops of "
            f"the swash plate and Z15 keep it between {k.lower:.6g} and {k.upper:.6g} Pa."
        )
    return dict.fromkeys(instance.model.parts[1].free_start["pressure"], float(pressure))


def measured_records(
    record: Record,
    load_torque: ArrayLike | None,
    pump_speed: ArrayLike | None,
    supply_pressure: ArrayLike | None,
) -> dict[str, Array]:
    """Inputs beside the command, on the march's grid.

    Each is None, a number, or as many finite samples as the command has.
    """
    given = {
        "load_torque": load_torque,
        "pump_speed": pump_speed,
        "supply_pressure": supply_pressure,
    }
    found: dict[str, Array] = {}
    fine = np.arange(record.values.size)
    grid = fine[:: record.substeps]
    for name, values in given.items():
        if values is None:
            continue
        samples = column(np.full(grid.size, values) if np.ndim(values) == 0 else values, name)
        if samples.size != grid.size:
            raise InputError(f"{name} has {samples.size} samples, but the command has {grid.size}.")
        found[name] = np.interp(fine, grid, samples)
    return found


# --- steady states --------------------------------------------------------------------------------


def steady_states(parameters: ParameterSet, voltage: Array) -> tuple[Array, Array]:
    """Signed current [A] and speed [rad/s] that each of many constant voltages settles at."""
    whole = without_ripple(instance_of(parameters, True))
    settled = replace(whole, model=models_of(parameters.equations).settled_drive)
    wanted = (Stored(0, "signals", "current"), Stored(1, "signals", "shaft_speed"))
    begun = Started((), {"voltage": 0.0}, ())
    current, speed = marched(settled, {"voltage": voltage}, 1.0, begun, wanted)
    return current, speed


def pump_arguments(instance: Instance, current: float, step: float = 1.0) -> dict[str, Any]:
    """What the pump's equations take under a constant current, by the arguments' names."""
    p, options, _ = instance.parts[1]
    known: dict[str, Any] = {"p": p, "options": options, "h": step}
    pump: Any = instance.model.parts[1]
    known["k"] = called(pump.constants, known)
    known["inputs"] = PumpInputs(current, p.pump_speed, p.load_torque, p.Z9)
    return known


def settled_state(instance: Instance, current: float) -> PumpState:
    """State of the pump that a constant signed current settles at."""
    pump: Any = instance.model.parts[1]
    made: PumpState = called(pump.settled, pump_arguments(instance, current))
    return made


def pressure_limits(instance: Instance) -> PumpConstants:
    """Pressures at which stops and relief valve act, with the other constants. [Pa]"""
    made: PumpConstants = pump_arguments(instance, 0.0)["k"]
    return made
