"""Simulation of a drive: from a parameter set and a record to a result."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.code import generating
from swashplate.equations.marching.march import Sampler, Stored
from swashplate.equations.marching.record import Record
from swashplate.equations.marching.run import Instance, Start, Started, check_start, marched
from swashplate.equations.model import Model
from swashplate.errors import DomainError, InputError
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.simulation.instance import check_filter_stability, instance_of
from swashplate.simulation.result import Simulation

Array = NDArray[np.float64]
Driver = Literal["voltage", "current"]
MEASURED = ("pump_speed", "load_torque", "supply_pressure")
"""Inputs beside the command that may be given as signals; otherwise a parameter stands for them."""


def check_voltage(record: Record, clip: bool) -> Record:
    """Refuse, or on request clip, a command beyond ±10 V.

    Raises
    ------
    InputError
        Naming the first sample out of range.
    """
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


@generating
def kept_of(model: Model, signals: tuple[str, ...], options: tuple[Any, ...]) -> tuple[Stored, ...]:
    """What a march leaves: currents, and the states from which all else follows."""
    pump = model.parts[1]
    inside = [Stored(1, "signals", path) for path in pump.signal_names if path in _inside(model)]
    sampler = Sampler(model, signals, options, [*inside, Stored(1, "limits")])
    kept = [Stored(0, "signals", "current_positive"), Stored(0, "signals", "current_negative")]
    kept += [Stored(1, "state", path) for path in sampler.carried[1]]
    if model.parts[0].limits is None:
        kept.append(Stored(0, "signals", "current"))
    if model.parts[0].limits is not None:
        kept.append(Stored(0, "limits"))
    return tuple(kept)


def _inside(model: Model) -> tuple[str, ...]:
    made = model.parts[1].signals
    assert made is not None
    return tuple(made._fields)


def simulate_drive(
    parameters: ParameterSet,
    record: Record,
    start: Start,
    start_pressure: float | None = None,
    measured: Mapping[str, Array] | None = None,
) -> Simulation:
    """March card and pump over a voltage record; see `Drive.simulate`.

    With `start_pressure` the pump begins there [Pa] and only the card's state is that of `start`.
    """
    check_filter_stability(parameters, record.step)
    return _simulate(parameters, record, "voltage", start, start_pressure, measured or {})


def simulate_pump(
    parameters: ParameterSet,
    record: Record,
    start: Start,
    start_pressure: float | None = None,
    measured: Mapping[str, Array] | None = None,
) -> Simulation:
    """March the pump alone over a signed current; see `Drive.simulate_current`."""
    return _simulate(parameters, record, "current", start, start_pressure, measured or {})


def _simulate(
    parameters: ParameterSet,
    record: Record,
    driver: Driver,
    start: Start,
    start_pressure: float | None,
    measured: Mapping[str, Array],
) -> Simulation:
    instance = instance_of(parameters, driver == "voltage")
    records = {driver: record.values, **measured}
    started = started_at(instance, records, record.step, start, start_pressure)
    kept = kept_of(instance.model, tuple(records), instance.options)
    out, flags = marched(instance, records, record.step, started, kept, driver)
    return Simulation(parameters.name, record, instance, driver, kept, out, flags, measured)


def started_at(
    instance: Instance,
    records: Mapping[str, Array],
    step: float,
    start: Start,
    start_pressure: float | None = None,
) -> Started:
    """Where a record begins.

    Raises
    ------
    DomainError
        If the pressure at the start lies beyond a stop of the swash plate or Z15.
    """
    check_start(start)
    started = instance.start({name: float(v[0]) for name, v in records.items()}, step, start)
    if start_pressure is None:
        return started
    pressure = check_start_pressure(instance, start_pressure, started)
    card, pump = started.states
    pump = pump._replace(pressure=pressure)
    if instance.parts[1].options.damping is not None:
        pump = pump._replace(plate_pressure=pressure)
    return started._replace(states=(card, pump))


def check_start_pressure(instance: Instance, pressure: float, started: Started) -> float:
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
    k = started.arguments[1]["k"]
    if not k.lower <= pressure <= k.upper:
        raise DomainError(
            f"{instance.name}: the pressure at the start is {pressure:.6g} Pa, but the stops of "
            f"the swash plate and Z15 keep it between {k.lower:.6g} and {k.upper:.6g} Pa."
        )
    return float(pressure)


def measured_records(record: Record, given: Mapping[str, object]) -> dict[str, Array]:
    """Inputs beside the command, on the march's grid.

    Parameters
    ----------
    record : Record
        The command.
    given : mapping
        Of `MEASURED` to a number or to as many samples as the command has; None is left out.

    Raises
    ------
    InputError
        For another name, length, or a sample that is not finite.
    """
    found: dict[str, Array] = {}
    for name, values in given.items():
        if values is None:
            continue
        if name not in MEASURED:
            raise InputError(f"There is no input '{name}'; there are {', '.join(MEASURED)}.")
        samples = np.asarray(values, dtype=np.float64)
        grid = np.arange(record.values.size)
        size = (record.values.size - 1) // record.substeps + 1
        if samples.ndim == 0:
            samples = np.full(size, float(samples))
        if samples.shape != (size,):
            raise InputError(f"{name} has {samples.size} samples, but the command has {size}.")
        if not np.isfinite(samples).all():
            bad = int(np.argmax(~np.isfinite(samples)))
            raise InputError(f"{name} is {samples[bad]} at sample {bad}; it must be finite.")
        found[name] = np.interp(grid, grid[:: record.substeps], samples)
    return found
