"""Many parameter sets over one input: outputs of each, or only its cost."""

import os
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import InputError
from swashplate.parameters.parameter_set import ParameterSet, columns_of
from swashplate.parameters.rules import broken_rules
from swashplate.physics.card_dynamics import decay_factor
from swashplate.physics.component import uncompiled
from swashplate.physics.stroker import pressure_limits
from swashplate.physics.swash import TAN_22_5
from swashplate.simulation import side_by_side as lanes
from swashplate.simulation.build import build_delay
from swashplate.simulation.constants import CHANNEL_PARAMETERS, PUMP_PARAMETERS
from swashplate.simulation.record import Record

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

OBSERVED = {
    "shaft_speed": lanes.SPEED,
    "shaft_position": lanes.POSITION,
    "current": lanes.CURRENT,
}
"""Signals that a batch can return or be compared by."""


@dataclass(frozen=True)
class SquaredError:
    """Cost of a set: Σ weight · (output - measured)² over the record's samples."""

    measured: ArrayLike
    """(n,) what was measured, in the output's SI unit."""
    weight: ArrayLike = 1.0
    """(n,) or one number; samples of weight 0 do not count, whatever they are."""
    output: str = "shaft_speed"
    """``"shaft_speed"``, ``"shaft_position"`` or ``"current"``."""


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
    parameters.refuse_refinements("Many sets at once")
    numbers, count = _columns(parameters, changes)
    failures = _failures(parameters.name, numbers, record.step, by_voltage)
    observed = _observed(cost.output if cost is not None else output)
    samples = (record.values.size - 1) // record.substeps + 1
    measured, weight = _comparison(cost, samples, record)
    costs = np.full(count, np.inf) if cost is not None else None
    outputs = np.full((count, samples), np.nan) if cost is None else None
    literal = True if parameters.coulomb_sign == "literal" else None
    split = True if parameters.card_switch == "split" else None
    symmetric = True if parameters.pressure_root == "symmetric" else None

    def march(job: tuple[NDArray[np.intp], tuple[bool | None, ...]]) -> None:
        chosen, (leaky, loaded, steep) = job
        padded = np.resize(chosen, lanes.LANES)
        sets = {column: values[padded] for column, values in numbers.items()}
        block, whole, share_whole = _block(sets, record.step)
        kept = np.empty((record.values.size if cost is None else 0, lanes.LANES))
        options = (leaky, loaded, steep, symmetric)
        compare = (observed, measured, weight, kept)
        flat = block.reshape(-1)
        if by_voltage:
            lanes.march_drives(
                record.values,
                whole,
                share_whole,
                literal,
                split,
                *options,
                record.step,
                flat,
                *compare,
            )
        else:
            lanes.march_pumps(record.values, *options, record.step, flat, *compare)
        good = block[lanes.WORST, : chosen.size] < 1.0
        for number in chosen[~good]:
            failures[int(number)] = (
                f"{parameters.name}: Z5·F/√Z4 reaches 1 under this input: the solenoid "
                "overpowers the feedback spring."
            )
        if costs is not None:
            costs[chosen[good]] = block[lanes.COST, : chosen.size][good]
        if outputs is not None:
            outputs[chosen[good]] = kept[:: record.substeps, : chosen.size].T[good]

    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        # each job writes its own sets' places, so the result does not depend on who is first
        list(pool.map(march, _jobs(numbers, failures, count)))
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
        column: given.get(column, np.full(count, value))
        for column, value in parameters.numbers.items()
    }, count


def _failures(
    name: str, numbers: Mapping[str, Array], step: float, by_voltage: bool
) -> dict[int, str]:
    """Sets that cannot be marched at all."""
    failures: dict[int, str] = {}
    for mask, sentence in broken_rules(numbers):
        for i in np.flatnonzero(mask):
            failures.setdefault(int(i), f"{name}: {sentence(int(i))}")
    for side in ("plus", "minus") if by_voltage else ():
        zeta, w = numbers[f"zeta_{side}"], numbers[f"omega_{side}"] * step
        for i in np.flatnonzero(~((w < 2.0) & (zeta * w < 1.0 + 0.25 * w * w))):
            failures.setdefault(
                int(i),
                f"{name}: the current filter of the {side} channel is unstable at this step.",
            )
    return failures


def _observed(output: str) -> int:
    if output not in OBSERVED:
        raise InputError(f"A batch has no output '{output}'; it has {', '.join(OBSERVED)}.")
    return OBSERVED[output]


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
    numbers: Mapping[str, Array], failures: Mapping[int, str], count: int
) -> Iterator[tuple[NDArray[np.intp], tuple[bool | None, ...]]]:
    """Blocks of sets that share the options which the kernels are compiled for."""
    good = np.ones(count, dtype=bool)
    good[list(failures)] = False
    leaky, loaded = numbers["Z7"] != 0.0, numbers["Z12"] != 0.0
    steep = np.tan(np.maximum(numbers["Z13_plus"], numbers["Z13_minus"])) >= TAN_22_5
    kind = leaky + 2 * loaded + 4 * steep
    for each in np.unique(kind[good]):
        members = np.flatnonzero(good & (kind == each))
        options = tuple(True if each & bit else None for bit in (1, 2, 4))
        for first in range(0, members.size, lanes.LANES):
            yield members[first : first + lanes.LANES], options


def _block(sets: Mapping[str, Array], step: float) -> tuple[Array, Indices, Indices]:
    """Parameters and states at rest of LANES sets, a row for each number, and whole delays."""
    block = np.zeros((lanes.N_ROWS, lanes.LANES))
    block[lanes.PRESSURE] = sets["Z2"] / sets["Z1"]
    for first, side in ((lanes.PLUS, "plus"), (lanes.MINUS, "minus")):
        for k, name in enumerate(CHANNEL_PARAMETERS):
            block[first + k] = sets[f"{name}_{side}"]
        block[first + len(CHANNEL_PARAMETERS)] = [
            uncompiled(decay_factor)(a, step) for a in sets[f"a_{side}"]
        ]
    for k, name in enumerate(PUMP_PARAMETERS):
        block[lanes.PUMP + k] = sets[name]
    limited = zip(
        *(sets[name] for name in ("Z1", "Z2", "Z13_plus", "Z13_minus", "Z15")), strict=True
    )
    limits = [uncompiled(pressure_limits)(*each) for each in limited]
    block[lanes.PUMP + len(PUMP_PARAMETERS) :] = np.transpose(limits)
    delays = [build_delay(tau, step) for tau in sets["tau"]]
    block[lanes.FRACTION] = [delay.fraction for delay in delays]
    block[lanes.SHARE_FRACTION] = [delay.share_fraction for delay in delays]
    whole = np.array([delay.whole for delay in delays], dtype=np.int64)
    share_whole = np.array([delay.share_whole for delay in delays], dtype=np.int64)
    return block, whole, share_whole
