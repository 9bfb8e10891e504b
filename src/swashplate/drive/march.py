"""A drive run: over records, one sample at a time, and where it settles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.drive.instance import (
    check_filter_stability,
    instance_of,
    models_of,
    without_ripple,
)
from swashplate.drive.simulation import MEASURED, UNITS, Simulation
from swashplate.equations.declaration import interpreted
from swashplate.equations.fields import Definition, is_real
from swashplate.equations.marching.part import Stored
from swashplate.equations.marching.record import (
    Interpolation,
    Record,
    check_rate,
    least_substeps,
    on_grid,
)
from swashplate.equations.marching.run import Instance, Start, Started, marched
from swashplate.equations.marching.use import Stepper
from swashplate.errors import DomainError, InputError, ParameterError
from swashplate.maneuvers import Maneuver, sampled
from swashplate.models.displacement_control import pressure_limits
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.plausible import check_plausible
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.units import in_si

Array = NDArray[np.float64]


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
RANGES: Mapping[str, tuple[float, float]] = {
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
    """A drive's command and what was measured beside it on the march's grid, checked.

    What was measured is a straight line between samples, whatever the command is. Pint quantities
    are turned into SI.
    """
    command = in_si(command, UNITS[driver], f"The {driver}")
    rate, time = in_si(rate, "Hz", "The rate"), in_si(time, "s", "The time")
    if is_real(command):
        instead = f", or a maneuver such as maneuvers.step({command:g})"
        raise InputError(
            f"The {driver} is a single number, {command:g}: give an array with a number for each "
            f"sample{instead if driver == 'voltage' else ''}."
        )
    beside = {
        name: in_si(values, UNITS[name], f"The {name}")
        for name, values in measured.items()
        if values is not None
    }
    between: dict[str, Interpolation | None] = {driver: interpolation}
    between |= dict.fromkeys(beside, "linear")
    steps = least_substeps(rate, substeps)
    inputs = {driver: sampled(command, rate), **beside}
    found = on_grid(inputs, rate, time=time, interpolation=between, substeps=steps)
    if driver == "voltage":
        found["voltage"] = check_voltage(found["voltage"], clip)
    for name in beside:
        _check_measured(name, found[name].values)
    return found


def _check_measured(name: str, values: Array) -> None:
    """Refuse a record with a sample that no machine has, or whose size can hardly be meant."""
    definition, (least, most) = INPUTS[name], RANGES[name]
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


def simulate_drive(
    parameters: ParameterSet,
    records: Mapping[str, Record],
    start: Start,
    start_pressure: float | None = None,
) -> Simulation:
    """March card and pump over a voltage, or the pump alone over a current; see `Drive.simulate`.

    With `start_pressure` the pump begins there [Pa] and only the card's state is that of `start`.
    """
    driver, record = next(iter(records.items()))
    if driver == "voltage":
        check_filter_stability(parameters, record.step)
    run = Simulation(instance_of(parameters, driver == "voltage"), records, start)
    if start_pressure is not None:
        run = replace(run, begin=start_states(run.instance, start_pressure))
    return run.marched()


def start_states(instance: Instance, pressure: float) -> dict[str, float]:
    """Numbers of the pump's state that a pressure at the start sets, by path. [Pa]"""
    if not np.isfinite(pressure):
        raise InputError(f"The pressure at the start must be a finite number, not {pressure}.")
    limits_of = interpreted(pressure_limits, instance.model.parts[1].replacements)
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
    h: float,
    interpolation: Interpolation,
    start: Start,
    measured: Sequence[str],
) -> Stepper[Sample]:
    """The drive one sample at a time; see `Drive.stepper`."""
    check_rate(h, "sample interval", "s")
    rate = 1.0 / h
    if abs(rate - round(rate)) < 1e-9 * rate:
        rate = float(round(rate))  # 1/(1/49) is not 49, but the user means 49 Hz
    substeps = least_substeps(rate)
    check_filter_stability(parameters, 1.0 / (rate * substeps))
    return Stepper(
        instance_of(parameters, True),
        ("voltage", *measured),
        Sample._fields[1:],
        rate,
        lambda values: Sample(values[0], *values[1 + len(measured) :]),
        start,
        interpolation={"voltage": interpolation, **dict.fromkeys(measured, "linear")},
        substeps=substeps,
        ranges={
            "voltage": (-FULL_VOLTAGE, FULL_VOLTAGE),
            **RANGES,
        },
    )


# --- steady states --------------------------------------------------------------------------------


def steady_states(parameters: ParameterSet, voltage: Array) -> tuple[Array, Array]:
    """Signed current [A] and speed [rad/s] that each of many constant voltages settles at."""
    whole = without_ripple(instance_of(parameters, True))
    settled = replace(whole, model=models_of(parameters.equations).settled_drive)
    wanted = (Stored(0, "signals", "current"), Stored(1, "signals", "shaft_speed"))
    begun = Started((), {"voltage": 0.0}, ())
    current, speed = marched(settled, {"voltage": voltage}, 1.0, begun, wanted)
    return current, speed
