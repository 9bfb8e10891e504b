"""Many parameter sets over one input: outputs of each, or only its cost."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.equations.lanes import LANES, march_lanes
from swashplate.equations.library import TAN_22_5
from swashplate.equations.record import Record
from swashplate.errors import InputError
from swashplate.models.pump import PumpOptions
from swashplate.parameters.definitions import columns_of
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import broken_rules
from swashplate.simulation.instance import (
    OPTION_OF,
    PATHS,
    SIDES,
    card_options,
    model_of,
    pump_options,
    stability_limit,
)

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

OVERPOWERED = "Z5·F/√Z4 reaches 1 under this input: the solenoid overpowers the feedback spring."
OVERFLOW = (
    "the numbers grow beyond all bounds under this input: a parameter is far larger or smaller "
    "than any real drive's; compare the set with a packaged one."
)
OUTPUTS = (
    "shaft_speed",
    "shaft_position",
    "current",
    "current_sum",
    "stroker_pressure",
    "swash_angle",
    "spool_position",
    "orifice_opening",
)
"""Signals that a batch can return or be compared by."""


@dataclass(frozen=True)
class SquaredError:
    """Cost of a set: Σ weight · (output - measured)² over the record's samples."""

    measured: ArrayLike
    """(n,) what was measured, in the output's SI unit."""
    weight: ArrayLike = 1.0
    """(n,) or one number; samples of weight 0 do not count, whatever they are."""
    output: str = "shaft_speed"
    """One of `OUTPUTS`."""


@dataclass(frozen=True, eq=False)
class Batch:
    """Results of many sets, in the order of the sets.

    A set that breaks a rule or leaves the model's domain does not stop the others: its cost is
    infinite, its outputs are NaN, and `failures` says why.
    """

    cost: Array | None
    """(m,) costs, None where outputs were asked for."""
    output: Array | None
    """(m, n) outputs, None where only costs were asked for."""
    failures: dict[int, str]
    """Why a set has no result, by its number."""


def simulate_many(
    parameters: ParameterSet,
    changes: Mapping[str, ArrayLike],
    record: Record,
    *,
    by_voltage: bool,
    cost: SquaredError | None,
    output: str,
    threads: int | None,
) -> Batch:
    """March many sets over one record; see `Drive.simulate_many`."""
    numbers, count = _columns(parameters, changes)
    failures = _failures(parameters.name, numbers, record.step, by_voltage)
    observed = _observed(cost.output if cost is not None else output)
    samples = (record.values.size - 1) // record.substeps + 1
    measured, weight = _comparison(cost, samples, record)
    costs = np.full(count, np.inf) if cost is not None else None
    outputs = np.full((count, samples), np.nan) if cost is None else None
    driver = "voltage" if by_voltage else "current"
    model = model_of(by_voltage)
    card = card_options(parameters) if by_voltage else None

    def march(job: tuple[NDArray[np.intp], PumpOptions]) -> None:
        chosen, options = job
        padded, size = np.resize(chosen, LANES), chosen.size
        found = march_lanes(
            model,
            (card, options),
            {PATHS[column]: values[padded] for column, values in numbers.items()},
            {driver: record.values},
            record.step,
            observed,
            measured,
            weight,
            cost is None,
        )
        good = np.isfinite(found.end[:size])
        inside = found.worst[:size] > 0.0
        for number, within in zip(chosen[~(good & inside)], inside[~(good & inside)], strict=True):
            sentence = OVERFLOW if within else OVERPOWERED
            failures[int(number)] = f"{parameters.name}: {sentence}"
        good &= inside
        if costs is not None:
            costs[chosen[good]] = found.cost[:size][good]
        if outputs is not None:
            outputs[chosen[good]] = found.outputs[:size, :: record.substeps][good]

    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        # each job writes its own sets' places, so the result does not depend on who is first
        list(pool.map(march, list(_jobs(parameters, numbers, failures, count, tuple(changes)))))
    return Batch(costs, outputs, dict(sorted(failures.items())))


def _columns(
    parameters: ParameterSet, changes: Mapping[str, ArrayLike]
) -> tuple[dict[str, Array], int]:
    """Every value of every set, and how many sets there are."""
    given: dict[str, Array] = {}
    for name, values in changes.items():
        column_values = np.asarray(values, dtype=np.float64)
        if column_values.ndim != 1 or column_values.size == 0:
            raise InputError(f"The values of {name} must be one number a set, in one row.")
        for column in columns_of([name]):
            if column in given:
                raise InputError(f"{column} is given twice.")
            given[column] = column_values
    sizes = {values.size for values in given.values()}
    if len(sizes) != 1:
        listed = ", ".join(f"{name} {np.size(values)}" for name, values in changes.items())
        raise InputError(f"All parameters need the same number of sets, at least one: {listed}.")
    count = sizes.pop()
    return {
        **{
            column: given.get(column, np.full(count, value))
            for column, value in parameters.numbers.items()
        },
        **given,
    }, count


def _failures(
    name: str, numbers: Mapping[str, Array], step: float, by_voltage: bool
) -> dict[int, str]:
    """Sets that cannot be marched at all."""
    failures: dict[int, str] = {}
    for mask, sentence in broken_rules(numbers):
        for i in np.flatnonzero(mask):
            failures.setdefault(int(i), f"{name}: {sentence(int(i))}")
    for side in SIDES if by_voltage else ():
        limit = stability_limit(numbers[f"zeta_{side}"])
        for i in np.flatnonzero(~(numbers[f"omega_{side}"] * step < limit)):
            failures.setdefault(
                int(i),
                f"{name}: the current filter of the {side} channel is unstable at this step.",
            )
    return failures


def _observed(output: str) -> str:
    if output not in OUTPUTS:
        raise InputError(f"A batch has no output '{output}'; it has {', '.join(OUTPUTS)}.")
    return output


def _comparison(cost: SquaredError | None, samples: int, record: Record) -> tuple[Array, Array]:
    """Measured values and weights on the march's grid, zero weight between the samples."""
    # zeros that nobody writes to take no memory
    measured, weight = np.zeros(record.values.size), np.zeros(record.values.size)
    if cost is None:
        return measured, weight
    given = np.asarray(cost.measured, dtype=np.float64)
    if given.shape != (samples,):
        raise InputError(f"The record has {samples} samples, but {given.size} were measured.")
    try:
        weights = np.broadcast_to(np.asarray(cost.weight, dtype=np.float64), (samples,))
    except ValueError:
        raise InputError(f"The weight must be one number or {samples}.") from None
    bad = ~np.isfinite(weights) | (weights < 0.0) | ((weights > 0.0) & ~np.isfinite(given))
    if bad.any():
        raise InputError(
            f"Measured value or weight is not finite, or the weight negative, at sample "
            f"{int(np.argmax(bad))}; give weight 0 to samples that are not to count."
        )
    counted = np.where(weights > 0.0, given, 0.0) if (weights == 0.0).any() else given
    if record.substeps == 1:
        # the kernels are compiled for arrays that can be written to
        return np.require(counted, requirements=["C", "W"]), np.require(
            weights, requirements=["C", "W"]
        )
    measured[:: record.substeps] = counted
    weight[:: record.substeps] = weights
    return measured, weight


def _jobs(
    parameters: ParameterSet,
    numbers: Mapping[str, Array],
    failures: Mapping[int, str],
    count: int,
    changed: Sequence[str],
) -> Iterator[tuple[NDArray[np.intp], PumpOptions]]:
    """Blocks of sets that share the options which the kernels are compiled for."""
    good = np.ones(count, dtype=bool)
    good[list(failures)] = False
    base = pump_options(parameters)
    masks: dict[str, NDArray[np.bool_]] = {
        "steep": np.tan(np.maximum(numbers["Z13_plus"], numbers["Z13_minus"])) >= TAN_22_5
    }
    for column in changed:
        option = OPTION_OF.get(column)
        if option is not None:
            on = numbers[column] != 0.0
            masks[option] = masks[option] | on if option in masks else on
    names = list(masks)
    kind = sum(
        (masks[name].astype(np.int64) << k for k, name in enumerate(names)),
        np.zeros(count, np.int64),
    )
    for each in np.unique(kind[good]):
        members = np.flatnonzero(good & (kind == each))
        options = base._replace(
            **{name: True if each >> k & 1 else None for k, name in enumerate(names)}
        )
        for first in range(0, members.size, LANES):
            yield members[first : first + LANES], options
