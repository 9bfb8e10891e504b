"""Many parameter sets of a drive over one record: its columns, rules and options for a batch."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.batch import Batch, OptionGroup, SquaredError, march_sets, set_columns
from swashplate.drive.instance import (
    card_options,
    models_of,
    pump_options,
    unstable_filters,
)
from swashplate.drive.signals import check_output
from swashplate.equations import TAN_22_5, check_mapping
from swashplate.equations.marching import Record
from swashplate.errors import InputError
from swashplate.executors import Executor
from swashplate.parameters import SWITCHES, ParameterSet, check_rules
from swashplate.units import in_si

Array = NDArray[np.float64]


def simulate_drives(
    parameters: ParameterSet,
    changes: Mapping[str, ArrayLike],
    records: Mapping[str, Record],
    output: str,
    cost: SquaredError | None,
    to: str | Path | None,
    executor: Executor | None,
) -> Batch:
    """March many sets over one record; see `Drive.simulate_many`."""
    check_mapping("changes", changes)
    definitions = parameters.definitions
    changed_values, count = set_columns(
        {name: in_si(values, definitions.find(name).unit, name) for name, values in changes.items()}
    )
    numbers = {name: np.full(count, value) for name, value in parameters.numbers.items()}
    changed: set[str] = set()
    for name, values in changed_values.items():
        for column in definitions.columns_of([name]):
            if column in changed:
                raise InputError(f"{column} is given twice.")
            changed.add(column)
            numbers[column] = values
    check_output(cost.output if cost else output)
    driver, record = next(iter(records.items()))
    by_voltage = driver == "voltage"
    models = models_of(parameters.equations)
    rules = [*check_rules(numbers, definitions)]
    if by_voltage:
        rules += unstable_filters(numbers, record.step, parameters.rate is None)
    return march_sets(
        models.drive if by_voltage else models.pump_drive,
        {definitions.path_of(column): values for column, values in numbers.items()},
        records,
        name=parameters.name,
        rules=rules,
        groups=_groups(parameters, numbers, changed, by_voltage),
        output=output,
        cost=cost,
        to=to,
        executor=executor,
    )


def _groups(
    parameters: ParameterSet,
    numbers: Mapping[str, Array],
    changed: Collection[str],
    by_voltage: bool,
) -> list[OptionGroup]:
    """Sets by the options that they share: what changes counts in the sets in which it is not 0."""
    stops = np.tan(np.maximum(numbers["Z13_plus"], numbers["Z13_minus"]))
    masks: dict[str, NDArray[np.bool_]] = {"steep": stops >= TAN_22_5}
    for option in sorted({SWITCHES[column] for column in changed if column in SWITCHES}):
        switched_by = [name for name in SWITCHES if SWITCHES[name] == option and name in numbers]
        masks[option] = np.any([numbers[name] for name in switched_by], axis=0)
    kinds = np.stack(list(masks.values()), axis=1)
    base = pump_options(parameters)
    card = card_options(parameters) if by_voltage else None
    groups = []
    for kind in np.unique(kinds, axis=0):
        on = {name: True if acts else None for name, acts in zip(masks, kind, strict=True)}
        groups.append(OptionGroup((kinds == kind).all(axis=1), (card, base._replace(**on))))
    return groups
