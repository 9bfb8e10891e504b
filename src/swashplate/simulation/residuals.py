"""Derivatives of a drive: residuals of an experiment, their Jacobian, sensitivities of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.marching import jacobian as engine
from swashplate.equations.marching.jacobian import Jacobian as Jacobian
from swashplate.equations.marching.jacobian import Triangle as Triangle
from swashplate.equations.marching.observation import ObservedRecord, every_sample
from swashplate.equations.marching.observation import Own as EngineOwn
from swashplate.equations.marching.record import Record
from swashplate.equations.marching.run import Instance, Start
from swashplate.errors import InputError
from swashplate.parameters.definitions import SWITCHES, columns_of
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.results import Result
from swashplate.simulation.instance import (
    PATHS,
    START_PRESSURE,
    check_filter_stability,
    instance_of,
    path_of,
)
from swashplate.simulation.result import Named, Simulation, check_output
from swashplate.simulation.run import Driver, simulate_drive, start_states, started_at
from swashplate.tables import count

Array = NDArray[np.float64]

CURRENTS = ("current", "current_sum", "current_positive", "current_negative")


class Own(NamedTuple):
    """Values of what belongs to one experiment alone, not to the drive."""

    start_pressure: float | None = None
    """δP at the first sample; None for that which belongs to the start. [Pa]"""
    offsets: Sequence[float] = ()
    """Offset of each observation, in its signal's unit; none given means none."""
    states: Mapping[str, float] = MappingProxyType({})
    """Numbers of the card's state at the first sample, by path; others are those of the start."""


NOTHING_OWN = Own()


class Ready(NamedTuple):
    """A model with numbers, and what of it is asked for, in the engine's words."""

    instance: Instance
    own: EngineOwn
    paths: Sequence[str] = ()  # Columns of derivatives.
    moved: Sequence[bool] | None = None  # Whether the record may depend on a column at all.


def residuals(parameters: ParameterSet, observed: ObservedRecord, own: Own = NOTHING_OWN) -> Array:
    """(m,) weighted residuals of all observations, one after the other; see the engine's."""
    ready = made_ready(parameters, observed, (), own)
    return engine.residuals(ready.instance, observed, ready.own)


def jacobian(
    parameters: ParameterSet,
    observed: ObservedRecord,
    columns: Sequence[str],
    own: Own = NOTHING_OWN,
    *,
    out: Array | None = None,
) -> Jacobian:
    """The same residuals with their exact derivatives; see the engine's `jacobian`.

    Columns are symbols (``"Z16"`` stands for both directions), columns (``"Z16_plus"``) and
    ``"start_pressure"``. What the record does not depend on gives zeros.
    """
    names = wanted_columns(tuple(columns))
    instance, inner, paths, moved = made_ready(parameters, observed, names, own)
    found = engine.jacobian(instance, observed, paths, inner, moved=moved, out=out)
    return found._replace(names=(*names, *observed.own_columns))


def triangle(
    parameters: ParameterSet,
    observed: ObservedRecord,
    columns: Sequence[str],
    own: Own = NOTHING_OWN,
) -> Triangle:
    """Triangular factor of [J r]; arguments as in `jacobian`, which is never held."""
    names = wanted_columns(tuple(columns))
    instance, inner, paths, moved = made_ready(parameters, observed, names, own)
    found = engine.triangle(instance, observed, paths, inner, moved=moved)
    return found._replace(names=(*names, *observed.own_columns))


@lru_cache(maxsize=256)
def wanted_columns(columns: tuple[str, ...]) -> tuple[str, ...]:
    """Columns that are asked for, symbols taken apart; refused where one is asked for twice."""
    names: list[str] = []
    for name in columns:
        names += [name] if name == START_PRESSURE else columns_of([name])
    for k, name in enumerate(names):
        if name in names[:k]:
            raise InputError(f"{name} is asked for twice.")
    return tuple(names)


def moved_by(
    parameters: ParameterSet, observed: ObservedRecord, names: Sequence[str]
) -> list[bool]:
    """Whether anything observed can depend on each column: on a driven channel, on the pump."""
    low, high = observed.extremes if observed.driven_by == "voltage" else (0.0, 0.0)
    moved = {
        "card.plus": high > parameters.numbers["V_dz_plus"],
        "card.minus": -low > parameters.numbers["V_dz_minus"],
    }
    moved["card"] = any(moved.values())
    moved["pump"] = any(each.signal not in CURRENTS for each in observed.observations)
    moved |= {"start.card.plus": True, "start.card.minus": True, "start.pump": moved["pump"]}
    return [moved[path.rpartition(".")[0]] for path in _paths(tuple(names))]


@lru_cache(maxsize=256)
def _paths(names: tuple[str, ...]) -> list[str]:
    """Path in the model of each column."""
    return [path_of(name) for name in names]


def made_ready(
    parameters: ParameterSet, observed: ObservedRecord, names: Sequence[str], own: Own
) -> Ready:
    """The drive's model with its numbers, for some columns."""
    by_voltage = observed.driven_by == "voltage"
    for each in observed.observations:
        check_output(each.signal)
    if by_voltage:
        check_filter_stability(parameters, observed.record.step)
    # what is differentiated by counts, at 0 as well, unless equations have derivatives for that
    asked = frozenset(SWITCHES[name] for name in names if name in SWITCHES) - {"leaky", "loaded"}
    instance = instance_of(_switched_on(parameters, asked), by_voltage)
    start = dict(own.states)
    if own.start_pressure is not None:
        started = started_at(instance, observed.records, observed.record.step, observed.start)
        states = start_states(instance, own.start_pressure, started)
        start |= {f"pump.{path}": pressure for path, pressure in states.items()}
    elif START_PRESSURE in names:
        raise InputError(f"{START_PRESSURE} is a column, so Own needs a value of it.")
    return Ready(
        instance,
        EngineOwn(start, own.offsets),
        _paths(tuple(names)),
        moved_by(parameters, observed, names),
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


def _columns(found: Sensitivities, signal: str) -> Array:
    """The Jacobian of unit weights: every sample observed as zero."""
    observed = every_sample(found.record, signal, found.driven_by, found.start)
    return jacobian(found.parameters, observed, found.names).columns


@dataclass(frozen=True, eq=False)
class Sensitivities(Result):
    """Derivatives of the outputs by parameters, one column for each of `names`.

    The unit of a column is the output's over the parameter's, both SI. At a switch (the edge of a
    dead zone, a limit just reached) they are the one-sided derivatives that the equations declare.
    """

    parameters: ParameterSet
    record: Record
    """The input on the march's grid."""
    driven_by: Driver
    start: Start
    names: tuple[str, ...]
    """Columns such as ``Z16_plus``, in the order asked for."""

    def __repr__(self) -> str:
        return f"Sensitivities({self.simulation!r}, by {count(len(self.names), 'parameter')})"

    @cached_property
    def simulation(self) -> Simulation:
        """The plain simulation, the same to the last bit as without sensitivities."""
        return simulate_drive(self.parameters, self.record, self.start, driver=self.driven_by)

    current_positive = Named(_columns)
    """(n, k) derivatives of the positive channel's current. [A/...]"""
    current_negative = Named(_columns)
    """(n, k) derivatives of the negative channel's current, a magnitude. [A/...]"""
    shaft_speed = Named(_columns)
    """(n, k) derivatives of the speed. [(rad/s)/...]"""
    shaft_position = Named(_columns)
    """(n, k) derivatives of the position. [rad/...]"""

    @property
    def current(self) -> Array:
        """(n, k) derivatives of the signed current. [A/...]"""
        return self.current_positive - self.current_negative


def sensitivities(
    parameters: ParameterSet,
    record: Record,
    driver: Driver,
    start: Start,
    names: Sequence[str] | None,
) -> Sensitivities:
    """Derivatives by some columns; see `Drive.sensitivities` and `Drive.sensitivities_current`."""
    chosen = ALL_COLUMNS if driver == "voltage" else PUMP_COLUMNS
    if names is not None:
        if isinstance(names, str) or not names:
            raise InputError("Name at least one parameter to differentiate by, in a list.")
        chosen = tuple(columns_of(list(names)))
    foreign = [name for name in chosen if PATHS[name].startswith("card.")]
    if foreign and driver == "current":
        raise InputError(
            f"{foreign[0]} belongs to the card, which a given current does not go through."
        )
    return Sensitivities(parameters, record, driver, start, chosen)
