"""Which derivatives a request needs: columns to rows of a block."""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.parameters.parameter_set import ParameterSet, columns_of
from swashplate.simulation.blocks import (
    IDLE_AT,
    IDLE_CHANNEL_AT,
    MINUS_AT,
    PLUS_AT,
    START_AT,
    TAU_AT,
    Columns,
)
from swashplate.simulation.build import ALL_PARAMETERS
from swashplate.simulation.observation import ObservedRecord
from swashplate.simulation.observe import CURRENT_NEGATIVE, OBSERVABLE
from swashplate.simulation.recurrences import ABREAST
from swashplate.simulation.tangent import TAU, C

Indices = NDArray[np.int64]

START_PRESSURE = "start_pressure"
"""Column of δP at the first sample, where it is an unknown of the experiment."""


class Wanted(NamedTuple):
    """Columns of a request, and rows of a block that they need."""

    names: tuple[str, ...]
    columns: Columns
    to: Indices
    """Place among the names of each column that the record depends on."""


def wanted_columns(
    parameters: ParameterSet, observed: ObservedRecord, columns: tuple[str, ...]
) -> Wanted:
    """What is to be derived for these columns: symbols, single values, ``"start_pressure"``.

    Raises
    ------
    InputError
        If a column is asked for twice.
    ParameterError
        If there is no such parameter.
    """
    low, high = observed.extremes
    by_voltage = observed.driven_by == "voltage"
    return wanted_rows(
        columns,
        by_voltage and high > parameters.numbers["V_dz_plus"],
        by_voltage and -low > parameters.numbers["V_dz_minus"],
        any(OBSERVABLE.index(each.signal) > CURRENT_NEGATIVE for each in observed.observations),
    )


@lru_cache(maxsize=256)
def wanted_rows(columns: tuple[str, ...], plus: bool, minus: bool, pump: bool) -> Wanted:
    """Rows of the columns that anything depends on: driven channels, and the pump if observed."""
    own = [name for name in columns if name == START_PRESSURE]
    if len(own) > 1:
        raise InputError(f"{START_PRESSURE} is asked for {len(own)} times.")
    names = tuple(
        each
        for name in columns
        for each in ((name,) if name == START_PRESSURE else columns_of([name]))
    )
    if len(set(names)) != len(names):
        twice = next(name for k, name in enumerate(names) if name in names[:k])
        raise InputError(f"{twice} is asked for twice.")
    row_of = {**{name: k for k, name in enumerate(ALL_PARAMETERS)}, START_PRESSURE: START_AT}
    moved = [
        (row_of[name], place)
        for place, name in enumerate(names)
        if (pump and (row_of[name] < PLUS_AT or row_of[name] == START_AT))
        or (plus and PLUS_AT <= row_of[name] < MINUS_AT)
        or (minus and MINUS_AT <= row_of[name] < TAU_AT)
        or ((plus or minus) and row_of[name] == TAU_AT)
    ]
    rows = [row for row, _ in sorted(moved)]
    delay = [TAU] if TAU_AT in rows else []
    of_plus = [row - PLUS_AT for row in rows if PLUS_AT <= row < MINUS_AT] + delay
    of_minus = [row - MINUS_AT for row in rows if MINUS_AT <= row < TAU_AT] + delay
    return Wanted(
        names,
        Columns(
            _numbers(rows),
            _filled(rows, IDLE_AT),
            _filled([k for k in of_plus if k <= C or k == TAU], IDLE_CHANNEL_AT),
            _filled(of_plus, IDLE_CHANNEL_AT),
            _filled([k for k in of_minus if k <= C or k == TAU], IDLE_CHANNEL_AT),
            _filled(of_minus, IDLE_CHANNEL_AT),
        ),
        _numbers([place for _, place in sorted(moved)]),
    )


def _numbers(rows: Sequence[int]) -> Indices:
    return np.array(rows, dtype=np.int64)


def _filled(rows: Sequence[int], idle: int) -> Indices:
    return _numbers([*rows, *(idle,) * (-len(rows) % ABREAST)])
