"""Residuals of an experiment, their Jacobian and its triangular factor, for one parameter set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.marching import jacobian as engine
from swashplate.equations.marching.jacobian import Jacobian as Jacobian
from swashplate.equations.marching.jacobian import Triangle as Triangle
from swashplate.equations.marching.observation import ObservedRecord
from swashplate.equations.marching.observation import Own as EngineOwn
from swashplate.equations.marching.rows import BLOCK
from swashplate.equations.marching.run import Instance
from swashplate.errors import InputError
from swashplate.parameters.definitions import SWITCHES, columns_of
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.simulation.instance import (
    START_PRESSURE,
    check_filter_stability,
    instance_of,
    path_of,
)
from swashplate.simulation.run import start_states, started_at

Array = NDArray[np.float64]

CURRENTS = ("current", "current_sum", "current_positive", "current_negative")
OBSERVABLE = (
    *CURRENTS,
    "shaft_speed",
    "shaft_position",
    "stroker_pressure",
    "swash_angle",
    "spool_position",
)
"""Signals that can be observed."""


class Own(NamedTuple):
    """Values of what belongs to one experiment alone, not to the drive."""

    start_pressure: float | None = None
    """δP at the first sample; None for that which belongs to the start. [Pa]"""
    offsets: Sequence[float] = ()
    """Offset of each observation, in its signal's unit; none given means none."""
    clock_offsets: Sequence[float] = ()
    """By how much the record's clock is ahead of each observation's; none given means none. [s]"""


NOTHING_OWN = Own()


class Ready(NamedTuple):
    """A model with numbers, and what of it is asked for, in the engine's words."""

    instance: Instance
    own: EngineOwn
    paths: Sequence[str] = ()  # Columns of derivatives.
    moved: Sequence[bool] | None = None  # Whether the record may depend on a column at all.


def residuals(
    parameters: ParameterSet,
    observed: ObservedRecord,
    own: Own = NOTHING_OWN,
    *,
    block: int = BLOCK,
) -> Array:
    """Weighted residuals of all observations, one after the other; see `jacobian.residuals`."""
    ready = made_ready(parameters, observed, (), own)
    return engine.residuals(ready.instance, observed, ready.own, block=block)


def jacobian(
    parameters: ParameterSet,
    observed: ObservedRecord,
    columns: Sequence[str],
    own: Own = NOTHING_OWN,
    *,
    out: Array | None = None,
    block: int = BLOCK,
) -> Jacobian:
    """The same residuals with their exact derivatives; see the engine's `jacobian`.

    Columns are symbols (``"Z16"`` stands for both directions), columns (``"Z16_plus"``) and
    ``"start_pressure"``. What the record does not depend on gives zeros.
    """
    names = wanted_columns(columns)
    instance, inner, paths, moved = made_ready(parameters, observed, names, own)
    found = engine.jacobian(instance, observed, paths, inner, moved=moved, out=out, block=block)
    return found._replace(names=(*names, *observed.own_columns))


def triangle(
    parameters: ParameterSet,
    observed: ObservedRecord,
    columns: Sequence[str],
    own: Own = NOTHING_OWN,
    *,
    block: int = BLOCK,
) -> Triangle:
    """Triangular factor of [J r]; arguments as in `jacobian`, which is never held."""
    names = wanted_columns(columns)
    instance, inner, paths, moved = made_ready(parameters, observed, names, own)
    found = engine.triangle(instance, observed, paths, inner, moved=moved, block=block)
    return found._replace(names=(*names, *observed.own_columns))


def wanted_columns(columns: Sequence[str]) -> tuple[str, ...]:
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
    low, high = observed.extremes
    by_voltage = observed.driven_by == "voltage"
    driven = {
        "plus": by_voltage and high > parameters.numbers["V_dz_plus"],
        "minus": by_voltage and -low > parameters.numbers["V_dz_minus"],
    }
    moved = {"card.plus": driven["plus"], "card.minus": driven["minus"]}
    moved["card"] = any(driven.values())
    pump = any(each.signal not in CURRENTS for each in observed.observations)
    return [moved.get(path_of(name).rpartition(".")[0], pump) for name in names]


def made_ready(
    parameters: ParameterSet, observed: ObservedRecord, names: Sequence[str], own: Own
) -> Ready:
    """The drive's model with its numbers, for some columns."""
    by_voltage = observed.driven_by == "voltage"
    for each in observed.observations:
        if each.signal not in OBSERVABLE:
            raise InputError(
                f"'{each.signal}' cannot be observed; signals are {', '.join(OBSERVABLE)}."
            )
    if by_voltage:
        check_filter_stability(parameters, observed.record.step)
    # what is differentiated by counts, at 0 as well; at Z7 = 0 there are derivatives for that
    asked = frozenset(SWITCHES[name] for name in names if name in SWITCHES) - {"leaky"}
    instance = instance_of(_switched_on(parameters, asked), by_voltage)
    start: dict[str, float] = {}
    if own.start_pressure is not None:
        started = started_at(instance, observed.records, observed.record.step, observed.start)
        states = start_states(instance, own.start_pressure, started)
        start = {f"pump.{path}": pressure for path, pressure in states.items()}
    elif START_PRESSURE in names:
        raise InputError(f"{START_PRESSURE} is a column, so Own needs a value of it.")
    return Ready(
        instance,
        EngineOwn(start, own.offsets, own.clock_offsets),
        [path_of(name) for name in names],
        moved_by(parameters, observed, names),
    )


@lru_cache(maxsize=64)
def _switched_on(parameters: ParameterSet, asked: frozenset[str]) -> ParameterSet:
    """The set with some options on, itself where they are."""
    if asked <= parameters.options:
        return parameters
    return replace(parameters, options=parameters.options | asked)
