"""Derivatives of a drive: what it is differentiated by, and sensitivities of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

from swashplate.drive.instance import (
    PRESSURE_PATH,
    START,
    drive_instance,
)
from swashplate.drive.march import start_states
from swashplate.drive.signals import check_output
from swashplate.drive.simulation import Simulation
from swashplate.errors import InputError
from swashplate.machine import Sensitivities
from swashplate.machine.marching import (
    NO_RUN_VALUES,
    BoundModel,
    ObservedRecord,
    Record,
    RunValues,
    Start,
)
from swashplate.parameters import DEFINITIONS, SWITCHES, Definitions, ParameterSet

CURRENTS = ("current", "current_sum", "current_positive", "current_negative")


@lru_cache(maxsize=256)
def requested_columns(definitions: Definitions, names: tuple[str, ...]) -> tuple[str, ...]:
    """Columns that names stand for, symbols taken apart; refused if one is requested twice."""
    columns: list[str] = []
    for name in names:
        for column in [name] if name.startswith(START) else definitions.columns_of([name]):
            if column in columns:
                raise InputError(f"{column} is requested twice.")
            columns.append(column)
    return tuple(columns)


class _ModelPaths(NamedTuple):
    """Where columns lie in the model."""

    paths: list[str]
    """Of each column; a state at the start is its own path."""
    parts: list[str]
    """The part that each path leads to, ``card.plus`` for example."""


@lru_cache(maxsize=256)
def _model_paths(definitions: Definitions, columns: tuple[str, ...]) -> _ModelPaths:
    """Where columns lie in the model."""
    paths = [name if name.startswith(START) else definitions.path_of(name) for name in columns]
    return _ModelPaths(paths, [path.rpartition(".")[0] for path in paths])


def bound_drive(
    parameters: ParameterSet,
    observed: ObservedRecord,
    columns: Sequence[str] = (),
    run_values: RunValues = NO_RUN_VALUES,
) -> BoundModel:
    """The drive's model with its numbers, for some columns.

    These are symbols (``"Z16"`` stands for both directions), columns (``"Z16_plus"``) and states
    at the first sample, ``"start.pump.pressure"`` [Pa]. Keys of ``run_values.start`` are paths
    without ``start.``; it has a value for each of these states.
    """
    for observation in observed.observations:
        check_output(observation.signal)
    by_voltage = observed.driven_by == "voltage"
    return _bound(
        parameters,
        requested_columns(parameters.definitions, tuple(columns)),
        by_voltage=by_voltage,
        step=observed.record.step,
        extremes=observed.extremes if by_voltage else (0.0, 0.0),
        pump_is_observed=any(o.signal not in CURRENTS for o in observed.observations),
        run_values=run_values,
    )


def _bound(
    parameters: ParameterSet,
    names: tuple[str, ...],
    *,
    by_voltage: bool,
    step: float,
    extremes: tuple[float, float],
    pump_is_observed: bool = True,
    run_values: RunValues = NO_RUN_VALUES,
) -> BoundModel:
    """The model with numbers for some columns, under a command between two extremes."""
    # a refinement whose parameter is a column is switched on even if the parameter is 0;
    # the equations of "leaky" and "loaded" have derivatives while they are off
    switches = frozenset(SWITCHES[name] for name in names if name in SWITCHES)
    switched = _switched_on(parameters, switches - {"leaky", "loaded"})
    instance = drive_instance(switched, by_voltage=by_voltage)
    instance.check_step(step)
    start = dict(run_values.start)
    if PRESSURE_PATH in start:
        start |= start_states(instance, start[PRESSURE_PATH])
    # what is observed does not depend on a channel without a command beyond its dead zone
    low, high = extremes
    can_move = {
        "card.plus": high > parameters.numbers["V_dz_plus"],
        "card.minus": -low > parameters.numbers["V_dz_minus"],
        "pump": pump_is_observed,
        "start.card.plus": True,
        "start.card.minus": True,
        "start.pump": pump_is_observed,
    }
    can_move["card"] = can_move["card.plus"] or can_move["card.minus"]
    paths, parts = _model_paths(parameters.definitions, names)
    return BoundModel(
        instance,
        run_values._replace(start=start),
        paths,
        [can_move[part] for part in parts],
    )


@lru_cache(maxsize=64)
def _switched_on(parameters: ParameterSet, options: frozenset[str]) -> ParameterSet:
    """The set with some options on, itself if they are."""
    if options <= parameters.options:
        return parameters
    return replace(parameters, options=parameters.options | options)


# --- over a whole run -----------------------------------------------------------------------------

PUMP_COLUMNS = tuple(name for name, path in DEFINITIONS.paths.items() if path.startswith("pump.Z"))
"""Columns of the pump and motor of Kruse (2001)."""
ALL_COLUMNS = (
    *PUMP_COLUMNS,
    *(name for name in DEFINITIONS.paths if name.endswith("_plus") and name not in PUMP_COLUMNS),
    *(name for name in DEFINITIONS.paths if name.endswith("_minus") and name not in PUMP_COLUMNS),
    "tau",
)
"""Columns of card, pump and motor, refinements apart, in their order."""


def drive_sensitivities(
    parameters: ParameterSet,
    records: Mapping[str, Record],
    start: Start,
    names: Sequence[str] | None,
) -> Sensitivities[Simulation]:
    """Derivatives by some columns; see `Drive.sensitivities` and `Drive.sensitivities_current`."""
    by_voltage = "voltage" in records
    definitions = parameters.definitions
    columns = ALL_COLUMNS if by_voltage else PUMP_COLUMNS
    if names is not None:
        if isinstance(names, str) or not names:
            raise InputError("Name at least one parameter to differentiate by, in a list.")
        columns = tuple(definitions.columns_of(names))
    for column in columns:
        if not by_voltage and definitions.path_of(column).startswith("card."):
            raise InputError(
                f"{column} belongs to the card, which a given current does not go through."
            )
    record = next(iter(records.values()))
    bound = _bound(
        parameters,
        columns,
        by_voltage=by_voltage,
        step=record.step,
        extremes=(float(record.values.min()), float(record.values.max())),
    )
    run = Simulation(drive_instance(parameters, by_voltage=by_voltage), records, start)
    return Sensitivities(run, columns, bound)
