"""Many parameter sets of a drive over one record: its columns and rules for a batch."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from swashplate.batch import Batch, SquaredError, march_sets, set_columns
from swashplate.drive.instance import drive_instance
from swashplate.drive.signals import check_output
from swashplate.equations import check_mapping
from swashplate.equations.marching import Record
from swashplate.errors import InputError
from swashplate.executors import Executor
from swashplate.parameters import ParameterSet, check_rules
from swashplate.units import in_si


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
    changed = dict[str, np.ndarray]()
    for name, values in changed_values.items():
        for column in definitions.columns_of([name]):
            if column in changed:
                raise InputError(f"{column} is given twice.")
            changed[column] = values
    check_output(cost.output if cost else output)
    driver = next(iter(records))
    machine = drive_instance(parameters, by_voltage=driver == "voltage")
    marched = {definitions.path_of(column): values for column, values in changed.items()}
    return march_sets(
        machine,
        marched,
        count,
        records,
        rules=check_rules(numbers | changed, definitions),
        output=output,
        cost=cost,
        to=to,
        executor=executor,
    )
