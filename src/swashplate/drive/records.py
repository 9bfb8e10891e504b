"""What drives a drive, on the march's grid: its command and measured inputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.drive.signals import MEASURED, UNITS
from swashplate.equations import Definition, is_real
from swashplate.equations.marching import Interpolation, Record, least_substeps, on_grid
from swashplate.errors import InputError, ParameterError
from swashplate.maneuvers import Maneuver, sampled
from swashplate.parameters import FULL_VOLTAGE, check_plausible
from swashplate.units import in_si

Array = NDArray[np.float64]


class RunKeywords(TypedDict, total=False):
    """Inputs, and signals measured in addition to the command; see `Drive.simulate`."""

    clip: bool
    time: ArrayLike | None
    interpolation: Interpolation | None
    substeps: int | None
    load_torque: ArrayLike | None
    pump_speed: ArrayLike | None
    supply_pressure: ArrayLike | None


def _input(name: str, lower: float, upper: float, plausible: tuple[float, float]) -> Definition:
    unit, meaning = MEASURED[name]
    return Definition(meaning, unit, lower, upper, plausible=plausible, symbol=name)


INPUTS: Mapping[str, Definition] = {
    "load_torque": _input("load_torque", -1e12, 1e12, (0.0, 1e10)),
    "supply_pressure": _input("supply_pressure", 1.0, 1e9, (1e4, 1e9)),
    "pump_speed": _input("pump_speed", 0.0, 10.0, (0.0, 10.0)),
}
"""What each measured input is. The range is that of a sample, beyond any machine: what lies outside
is in another unit or no measurement. What is plausible is the largest size in a record."""
INPUT_RANGES: Mapping[str, tuple[float, float]] = {
    name: (definition.lower, definition.upper) for name, definition in INPUTS.items()
}
"""Least and largest sample of each, as a stepper and exported code take it."""


def drive_records(
    driver: str,
    command: ArrayLike | Maneuver,
    rate: float,
    *,
    clip: bool = False,
    time: ArrayLike | None = None,
    interpolation: Interpolation | None = None,
    substeps: int | None = None,
    **measured: ArrayLike | None,
) -> dict[str, Record]:
    """A drive's command and its measured inputs on the march's grid, checked.

    What was measured is a straight line between samples, whatever the command is. Pint quantities
    are turned into SI.
    """
    command = in_si(command, UNITS[driver], f"The {driver}")
    rate = in_si(rate, "Hz", "The rate")
    time = in_si(time, "s", "The time")
    if is_real(command):
        instead = f", or a maneuver such as maneuvers.step({command:g})"
        raise InputError(
            f"The {driver} is a single number, {command:g}: give an array with a number for each "
            f"sample{instead if driver == 'voltage' else ''}."
        )
    measured_inputs = {
        name: in_si(values, UNITS[name], f"The {name}")
        for name, values in measured.items()
        if values is not None
    }
    between: dict[str, Interpolation | None] = {driver: interpolation}
    between |= dict.fromkeys(measured_inputs, "linear")
    steps = least_substeps(rate, substeps)
    inputs = {driver: sampled(command, rate), **measured_inputs}
    records = on_grid(inputs, rate, time=time, interpolation=between, substeps=steps)
    if driver == "voltage":
        records["voltage"] = check_voltage(records["voltage"], clip)
    for name in measured_inputs:
        _check_measured(name, records[name].values)
    return records


def _check_measured(name: str, values: Array) -> None:
    """Refuse a record with a sample that no machine has, or whose size can hardly be meant."""
    definition = INPUTS[name]
    least, most = INPUT_RANGES[name]
    low, high = float(values.min()), float(values.max())
    try:
        check_plausible(name, definition, max(low, high, key=abs))
    except ParameterError as error:
        raise InputError(str(error)) from None
    if not (low >= least and high <= most):
        reached = f"falls to {low:g}" if low < least else f"rises to {high:g}"
        unit = f" {definition.unit}".removesuffix(" 1")
        raise InputError(
            f"The {name} {reached}{unit}, but must be from {least:g} to {most:g}{unit}: it is the "
            f"{definition.name}."
        )


def check_voltage(record: Record, clip: bool) -> Record:
    """Refuse, or on request clip, a command beyond ±10 V; the first such sample is named."""
    low, high = float(record.values.min()), float(record.values.max())
    if low >= -FULL_VOLTAGE and high <= FULL_VOLTAGE:
        return record
    if clip:
        return replace(record, values=np.clip(record.values, -FULL_VOLTAGE, FULL_VOLTAGE))
    first = int(np.argmax(np.abs(record.values) > FULL_VOLTAGE))
    raise InputError(
        f"The voltage is {record.values[first]:g} V at {record.start + first * record.step:g} s, "
        f"but the card takes ±{FULL_VOLTAGE:g} V; check its unit, or clip it."
    )
