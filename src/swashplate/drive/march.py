"""Simulate a drive over records, and one sample at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from swashplate.drive.instance import drive_instance
from swashplate.drive.simulation import Simulation
from swashplate.errors import DomainError, InputError
from swashplate.machine import Machine, Stepper, with_replacements
from swashplate.machine.marching import Interpolation, Record, Start
from swashplate.models.displacement_control import pressure_limits
from swashplate.parameters import ParameterSet


def simulate_drive(
    parameters: ParameterSet,
    records: Mapping[str, Record],
    start: Start,
    start_pressure: float | None = None,
) -> Simulation:
    """March card and pump over a voltage, or the pump alone over a current; see `Drive.simulate`.

    With `start_pressure` [Pa] the pump begins at that pressure; `start` then sets only the card's
    state.
    """
    driver = next(iter(records))
    machine = drive_instance(parameters, by_voltage=driver == "voltage")
    run = Simulation(machine, records, start)
    if start_pressure is not None:
        run = replace(run, begin=start_states(run.instance, start_pressure))
    return run.marched()


def start_states(instance: Machine, pressure: float) -> dict[str, float]:
    """Initial values of the pump's states that a pressure at the start determines, by path. [Pa]"""
    if not np.isfinite(pressure):
        raise InputError(f"The pressure at the start must be a finite number, not {pressure}.")
    limits_of = with_replacements(pressure_limits, instance.model.parts[1].replacements)
    limits = limits_of(instance.parts[1].p)
    if not limits.lower <= pressure <= limits.upper:
        raise DomainError(
            f"{instance.name}: the pressure at the start is {pressure:.6g} Pa, but the stops of "
            f"the swash plate and Z15 keep it between {limits.lower:.6g} and {limits.upper:.6g} Pa."
        )
    paths = instance.model.parts[1].free_start["pressure"]
    return {f"pump.{path}": float(pressure) for path in paths}


class Sample(NamedTuple):
    """Signals at one sample, named and signed as in `Simulation`, SI."""

    voltage: float
    current_positive: float
    current_negative: float
    current: float
    solenoid_force: float
    spool_position: float
    orifice_opening: float
    stroker_pressure: float
    swash_angle: float
    shaft_speed: float
    shaft_position: float


def drive_stepper(
    parameters: ParameterSet,
    rate: float,
    interpolation: Interpolation,
    start: Start,
    measured: Sequence[str],
) -> Stepper[Sample]:
    """The drive one sample at a time; see `Drive.stepper`.

    `measured` are the inputs other than the voltage.
    """

    def sample_of(values: Sequence[float]) -> Sample:
        """Inputs come first in the stepper's values; of these a sample shows only the voltage."""
        outputs = values[1 + len(measured) :]
        return Sample(values[0], *outputs)

    interpolation_of: dict[str, Interpolation] = {"voltage": interpolation}
    for name in measured:
        interpolation_of[name] = "linear"
    return Stepper(
        drive_instance(parameters, by_voltage=True),
        ("voltage", *measured),
        Sample._fields[1:],
        rate,
        sample_of,
        start,
        interpolation=interpolation_of,
    )
