"""Derivatives of a drive: what it is differentiated by, and sensitivities of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

from swashplate.drive.instance import (
    PATHS,
    PRESSURE,
    START,
    check_filter_stability,
    drive_instance,
    path_of,
)
from swashplate.drive.march import start_states
from swashplate.drive.signals import check_output
from swashplate.drive.simulation import Simulation
from swashplate.equations.marching.derivatives import NOTHING_OWN, BoundModel
from swashplate.equations.marching.observation import ObservedRecord, Own, every_sample
from swashplate.equations.marching.record import Record
from swashplate.equations.marching.run import Start
from swashplate.equations.marching.sensitivity import Sensitivities
from swashplate.errors import InputError
from swashplate.parameters.definitions import SWITCHES, columns_of
from swashplate.parameters.parameter_set import ParameterSet

CURRENTS = ("current", "current_sum", "current_positive", "current_negative")


@lru_cache(maxsize=256)
def wanted_columns(columns: tuple[str, ...]) -> tuple[str, ...]:
    """Columns that are asked for, symbols taken apart; refused where one is asked for twice."""
    names: list[str] = []
    for name in columns:
        for each in [name] if name.startswith(START) else columns_of([name]):
            if each in names:
                raise InputError(f"{each} is asked for twice.")
            names.append(each)
    return tuple(names)


@lru_cache(maxsize=256)
def _paths(names: tuple[str, ...]) -> list[str]:
    """Path in the model of each column."""
    return [path_of(name) for name in names]


def bound_drive(
    parameters: ParameterSet,
    observed: ObservedRecord,
    columns: Sequence[str] = (),
    own: Own = NOTHING_OWN,
) -> BoundModel:
    """The drive's model with its numbers, for some columns.

    These are symbols (``"Z16"`` stands for both directions), columns (``"Z16_plus"``) and states
    at the first sample whose values are among the starts of `own`, ``"start.pump.pressure"``. [Pa]
    """
    names = wanted_columns(tuple(columns))
    by_voltage = observed.driven_by == "voltage"
    for each in observed.observations:
        check_output(each.signal)
    if by_voltage:
        check_filter_stability(parameters, observed.record.step)
    # what is differentiated by counts, at 0 as well, unless equations have derivatives for that
    asked = frozenset(SWITCHES[name] for name in names if name in SWITCHES) - {"leaky", "loaded"}
    instance = drive_instance(_switched_on(parameters, asked), by_voltage)
    start = dict(own.start)
    if PRESSURE in start:
        start |= start_states(instance, start[PRESSURE])
    # whether anything observed can depend on a column: on a driven channel, on the pump
    low, high = observed.extremes if by_voltage else (0.0, 0.0)
    moved = {
        "card.plus": high > parameters.numbers["V_dz_plus"],
        "card.minus": -low > parameters.numbers["V_dz_minus"],
        "pump": any(each.signal not in CURRENTS for each in observed.observations),
        "start.card.plus": True,
        "start.card.minus": True,
    }
    moved |= {"card": moved["card.plus"] or moved["card.minus"], "start.pump": moved["pump"]}
    paths = _paths(names)
    return BoundModel(
        instance,
        own._replace(start=start),
        paths,
        [moved[path.rpartition(".")[0]] for path in paths],
    )


@lru_cache(maxsize=64)
def _switched_on(parameters: ParameterSet, asked: frozenset[str]) -> ParameterSet:
    """The set with some options on, itself where they are."""
    if asked <= parameters.options:
        return parameters
    return replace(parameters, options=parameters.options | asked)


# --- over a whole run -----------------------------------------------------------------------------

PUMP_COLUMNS = tuple(name for name, path in PATHS.items() if path.startswith("pump.Z"))
"""Columns of the pump and motor of Kruse (2001)."""
ALL_COLUMNS = (
    *PUMP_COLUMNS,
    *(name for name in PATHS if name.endswith("_plus") and name not in PUMP_COLUMNS),
    *(name for name in PATHS if name.endswith("_minus") and name not in PUMP_COLUMNS),
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
    columns = ALL_COLUMNS if by_voltage else PUMP_COLUMNS
    if names is not None:
        if isinstance(names, str) or not names:
            raise InputError("Name at least one parameter to differentiate by, in a list.")
        columns = tuple(columns_of(list(names)))
    foreign = [] if by_voltage else [n for n in columns if path_of(n).startswith("card.")]
    if foreign:
        raise InputError(
            f"{foreign[0]} belongs to the card, which a given current does not go through."
        )
    (driver, record), *others = records.items()
    beside = {name: each.values for name, each in others}
    observed = every_sample(record, "shaft_speed", driver, start, beside)
    bound = bound_drive(parameters, observed, columns)
    run = Simulation(drive_instance(parameters, by_voltage), records, start)
    return Sensitivities(run, columns, bound)
