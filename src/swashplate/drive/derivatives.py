"""Derivatives of a drive: residuals of an experiment, their Jacobian, sensitivities of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.drive.instance import (
    PATHS,
    PRESSURE,
    START,
    check_filter_stability,
    instance_of,
    path_of,
)
from swashplate.drive.march import simulate_drive, start_states
from swashplate.drive.simulation import Named, Simulation, check_output
from swashplate.equations.marching import derivatives as engine
from swashplate.equations.marching.observation import ObservedRecord, Own, every_sample
from swashplate.equations.marching.record import Record
from swashplate.equations.marching.run import Instance, Start
from swashplate.errors import InputError
from swashplate.parameters.definitions import SWITCHES, columns_of
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.results import Result
from swashplate.tables import count

Array = NDArray[np.float64]

CURRENTS = ("current", "current_sum", "current_positive", "current_negative")
NOTHING_OWN = Own()


class Ready(NamedTuple):
    """A model with numbers, and what of it is asked for, in the engine's words."""

    instance: Instance
    own: Own
    paths: Sequence[str] = ()  # Columns of derivatives.
    moved: Sequence[bool] | None = None  # Whether the record may depend on a column at all.

    def residuals(self, observed: ObservedRecord) -> Array:
        """(m,) weighted residuals of all observations; see the engine's."""
        return engine.residuals(self.instance, observed, self.own)

    def jacobian(self, observed: ObservedRecord, out: Array | None = None) -> engine.Jacobian:
        """The same residuals with their exact derivatives; see the engine's."""
        moved = self.moved
        return engine.jacobian(self.instance, observed, self.paths, self.own, moved=moved, out=out)

    def triangle(self, observed: ObservedRecord) -> engine.Triangle:
        """Triangular factor of [J r]; see the engine's."""
        return engine.triangle(self.instance, observed, self.paths, self.own, moved=self.moved)


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


def made_ready(
    parameters: ParameterSet,
    observed: ObservedRecord,
    columns: Sequence[str] = (),
    own: Own = NOTHING_OWN,
) -> Ready:
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
    instance = instance_of(_switched_on(parameters, asked), by_voltage)
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
    return Ready(
        instance, own._replace(start=start), paths, [moved[p.rpartition(".")[0]] for p in paths]
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


@dataclass(frozen=True, eq=False)
class Sensitivities(Result):
    """Derivatives of the outputs by parameters, one column for each of `names`.

    The unit of a column is the output's over the parameter's, both SI. At a switch (the edge of a
    dead zone, a limit just reached) they are the one-sided derivatives that the equations declare.
    """

    parameters: ParameterSet
    records: Mapping[str, Record]
    """Inputs on the march's grid."""
    start: Start
    names: tuple[str, ...]
    """Columns such as ``Z16_plus``, in the order asked for."""
    found: dict[str, Array] = field(default_factory=dict, repr=False)
    """Derivatives that were asked for."""

    def __repr__(self) -> str:
        return f"Sensitivities({self.simulation!r}, by {count(len(self.names), 'parameter')})"

    @cached_property
    def simulation(self) -> Simulation:
        """The plain simulation, the same to the last bit as without sensitivities."""
        return simulate_drive(self.parameters, self.records, self.start)

    def __getitem__(self, signal: str) -> Array:
        """(n, k) derivatives of any signal of the simulation behind its input, by its name."""
        (driver, record), *others = self.records.items()
        beside = {name: each.values for name, each in others}
        observed = every_sample(record, signal, driver, self.start, beside)
        made = made_ready(self.parameters, observed, self.names).jacobian(observed)
        return self.found.setdefault(signal, made.columns)

    current_positive = Named()
    """(n, k) derivatives of the positive channel's current. [A/...]"""
    current_negative = Named()
    """(n, k) derivatives of the negative channel's current, a magnitude. [A/...]"""
    current = Named()
    """(n, k) derivatives of the signed current. [A/...]"""
    shaft_speed = Named()
    """(n, k) derivatives of the speed. [(rad/s)/...]"""
    shaft_position = Named()
    """(n, k) derivatives of the position. [rad/...]"""


def sensitivities(
    parameters: ParameterSet,
    records: Mapping[str, Record],
    start: Start,
    names: Sequence[str] | None,
) -> Sensitivities:
    """Derivatives by some columns; see `Drive.sensitivities` and `Drive.sensitivities_current`."""
    by_voltage = "voltage" in records
    chosen = ALL_COLUMNS if by_voltage else PUMP_COLUMNS
    if names is not None:
        if isinstance(names, str) or not names:
            raise InputError("Name at least one parameter to differentiate by, in a list.")
        chosen = tuple(columns_of(list(names)))
    foreign = [] if by_voltage else [n for n in chosen if path_of(n).startswith("card.")]
    if foreign:
        raise InputError(
            f"{foreign[0]} belongs to the card, which a given current does not go through."
        )
    return Sensitivities(parameters, records, start, chosen)
