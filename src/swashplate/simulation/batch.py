"""Many parameter sets over one input, of a drive or a model of one's own.

Of each set its output, in memory or streamed to files, or only its cost.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.equations import Model, instance_of, parameter_paths
from swashplate.equations.fields import floats_of
from swashplate.equations.library import TAN_22_5
from swashplate.equations.marching.lanes import LANES, march_lanes
from swashplate.equations.marching.march import output_of
from swashplate.equations.marching.record import Record
from swashplate.equations.marching.run import outside
from swashplate.equations.marching.use import records_of
from swashplate.errors import FileError, InputError
from swashplate.executors import Executor, Threads
from swashplate.models.pump import PumpOptions
from swashplate.parameters.definitions import SWITCHES, columns_of
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import broken_rules
from swashplate.simulation.instance import (
    PATHS,
    SIDES,
    card_options,
    model_of,
    pump_options,
    step_limit,
)
from swashplate.tables import write_whole

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

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
"""Signals that a batch of drives can return or be compared by."""
SAMPLES_A_FILE = 2**23
"""Samples of all sets of a file, 64 MB, unless a single block of sets has more."""


@dataclass(frozen=True)
class SquaredError:
    """Cost of a set: Σ weight · (output - measured)² over the record's samples."""

    measured: ArrayLike
    """(n,) what was measured, in the output's SI unit."""
    weight: ArrayLike = 1.0
    """(n,) or one number; samples of weight 0 do not count, whatever they are."""
    output: str = "shaft_speed"
    """Signal that is compared; of a drive one of `OUTPUTS`."""


@dataclass(frozen=True, eq=False)
class Batch:
    """Results of many sets, in the order of the sets.

    A set that breaks a rule or leaves the model's domain does not stop the others: its cost is
    infinite, its outputs are NaN, and `failures` says why.
    """

    cost: Array | None
    """(m,) costs, None where outputs were asked for."""
    output: Array | None
    """(m, n) outputs, None where costs were asked for or files written."""
    failures: dict[int, str]
    """Why a set has no result, by its number."""
    files: tuple[Path, ...] = ()
    """Parquet tables of the outputs: the column ``time`` [s], and one for each set that could be
    marched, called by its number."""


class _Block(NamedTuple):
    """Up to LANES sets that share the options which the kernels are compiled for."""

    sets: Indices
    options: tuple[Any, ...]


class _Marched(NamedTuple):
    """What is told of a block's sets."""

    sets: Indices
    values: Array | None
    """Costs or outputs, None where the outputs are in their place already."""
    end: Array
    """Finite where all numbers are."""
    worst: Array
    """Worst margin of the domain."""


@dataclass(frozen=True, eq=False)
class _Sets:
    """Sets over one record, and what of them is wanted."""

    model: Model
    numbers: Mapping[str, Array]
    """(m,) each, by path; see `march_lanes`."""
    record: Record
    driver: str
    others: Mapping[str, Array]
    output: str
    measured: Array
    weight: Array
    keep: bool
    """Whether outputs are wanted, not costs."""
    to: Path | None = None
    place: Array | None = field(default=None, repr=False)
    """(m, n) where outputs go, within this process."""

    def __getstate__(self) -> dict[str, Any]:
        """Without what other processes have no use for."""
        return {**self.__dict__, "place": None}


def _march(shared: _Sets, blocks: Sequence[_Block]) -> list[_Marched]:
    """March blocks of sets; their outputs go into one file if into any."""
    made, record = [], shared.record
    table: dict[str, Array] = {}
    for sets, options in blocks:
        padded, size = np.resize(sets, LANES), sets.size
        found = march_lanes(
            shared.model,
            options,
            {path: values[padded] for path, values in shared.numbers.items()},
            {shared.driver: record.values, **shared.others},
            record.step,
            shared.output,
            shared.measured,
            shared.weight,
            shared.keep,
        )
        end, worst = found.end[:size], found.worst[:size]
        bad = ~(np.isfinite(end) & (worst > 0.0))
        values: Array | None = np.where(bad, np.inf, found.cost[:size])
        if shared.keep:
            values = found.outputs[:size, :: record.substeps]
            values[bad] = np.nan
            if shared.to is not None:
                table |= {str(number): row for number, row in zip(sets, values, strict=True)}
                values = None
            elif shared.place is not None:
                shared.place[sets] = values
                values = None
        made.append(_Marched(sets, values, end, worst))
    if shared.to is not None:
        _write(shared.to / f"{blocks[0].sets[0]:08d}.parquet", {"time": record.time, **table})
    return made


def _write(path: Path, columns: Mapping[str, Array]) -> None:
    """Write a table beside its place, have it on the disk, and rename it."""
    import polars as pl

    def write(beside: Path) -> None:
        pl.DataFrame(dict(columns)).write_parquet(beside)
        with beside.open("rb+") as file:
            os.fsync(file.fileno())

    write_whole(path, write)


def _run(
    shared: _Sets,
    blocks: Sequence[_Block],
    count: int,
    failures: dict[int, str],
    why: Callable[[float], str],
    executor: Executor | None,
) -> Batch:
    """March all blocks wherever the executor runs them."""
    samples = shared.record.time.size
    costs = None if shared.keep else np.full(count, np.inf)
    outputs = _outputs(count, samples) if shared.keep and shared.to is None else None
    if shared.to is not None:
        _make_folder(shared.to)
    several = max(SAMPLES_A_FILE // (samples * LANES), 1) if shared.to is not None else 1
    items = [blocks[k : k + several] for k in range(0, len(blocks), several)]
    shared = replace(shared, place=outputs)
    # each block writes its own sets' places, so the result does not depend on who is first
    for _, made in (executor or Threads()).run(_march, shared, items):
        for sets, values, end, worst in made:
            for number, last, margin in zip(sets, end, worst, strict=True):
                if not (np.isfinite(last) and margin > 0.0):
                    failures[int(number)] = why(float(margin))
            if values is not None:
                target = outputs if costs is None else costs
                assert target is not None
                target[sets] = values
    files = (
        tuple(shared.to / f"{each[0].sets[0]:08d}.parquet" for each in items) if shared.to else ()
    )
    return Batch(costs, outputs, dict(sorted(failures.items())), files)


def _outputs(count: int, samples: int) -> Array:
    """Room for outputs in memory.

    Raises
    ------
    InputError
        If the machine has less.
    """
    size = 8.0 * count * samples
    try:
        memory = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):  # not on Windows
        memory = np.inf
    try:
        if size < memory:
            return np.full((count, samples), np.nan)
    except MemoryError:
        pass
    raise InputError(
        f"The outputs of {count} sets, {samples} samples each, take {size / 2**30:.3g} GiB, more "
        "than this machine's memory: ask for a cost, or have them written to files with to=FOLDER."
    )


def _make_folder(folder: Path) -> None:
    """A folder without outputs of an earlier batch."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        there = next(folder.glob("*.parquet"), None)
    except OSError as error:
        raise FileError(f"{folder} cannot be made: {error.strerror or error}.") from None
    if there is not None:
        raise FileError(
            f"{folder} holds {there.name} already; name an empty folder for the outputs."
        )


# --- models of one's own --------------------------------------------------------------------------


def simulate_many(
    model: Model,
    p: Any,
    changes: Mapping[str, ArrayLike],
    inputs: Mapping[str, ArrayLike],
    rate: float,
    *,
    output: str = "",
    cost: SquaredError | None = None,
    to: str | Path | None = None,
    options: Any = None,
    given: Any = None,
    executor: Executor | None = None,
) -> Batch:
    """Simulate many parameter sets of a model over one record, from rest.

    Parameters
    ----------
    model, p, inputs, rate, options, given :
        As in `swashplate.equations.simulate`.
    changes : mapping of str to (m,) array_like
        Values of parameters by path, one for each set; the others are those of `p`.
    output : str
        The signal to return; with `cost` it is not needed.
    cost : SquaredError, optional
        Reduce each set to one number on the fly, so that memory does not grow with the record.
    to : path, optional
        Empty folder that outputs are written to instead, file by file as they are ready, so that
        memory does not grow with the number of sets: see `Batch.files`.
    executor : Executor, optional
        Where: by default `swashplate.executors.Threads`, one a core; or ``Processes``, ``Dask`` or
        ``Serial``. The numbers do not depend on it. For other processes the model must stand in a
        module, and on other machines the folder must be a common one.

    Raises
    ------
    InputError
        For what does not fit the model, or outputs that need more memory than there is.
    FileError
        If files cannot be written.
    """
    instance = instance_of(model, p, options=options, given=given)
    records = records_of(instance, inputs, rate)
    paths, several = parameter_paths(model), len(model.parts) > 1
    values, count = _given_sets(changes)
    for path in values:
        if path not in paths:
            raise InputError(f"{model.name} has no parameter '{path}'; it has {', '.join(paths)}.")
    observed = cost.output if cost is not None else output
    if not observed:
        raise InputError(f"{model.name}: say which output of the sets is wanted, or give a cost.")
    output_of(model, observed)
    held = dict(zip(paths, instance.params, strict=True))
    givens = [
        f"given {part.name}.{path}" if several else f"given {path}"
        for part in model.parts
        if part.given is not None
        for path in floats_of(part.given)
    ]
    held |= dict(zip(givens, instance.given, strict=True))
    numbers = {path: values.get(path, np.full(count, number)) for path, number in held.items()}
    failures: dict[int, str] = {}
    for path, column in values.items():
        delays = any(
            path == (f"{part.name}.{tap.delay}" if several else tap.delay)
            for part in model.parts
            for tap in part.taps.values()
        )
        for i in np.flatnonzero(~np.isfinite(column) | (delays & (column < 0.0))):
            rule = "a finite number, at least 0" if delays else "a finite number"
            failures[int(i)] = f"{model.name}: {path} is {column[i]:g}, but must be {rule}."
    good = np.setdiff1d(np.arange(count), list(failures))
    driver, *others = records
    size = records[driver].size
    record = Record(records[driver], 0.0, float(rate), 1)
    shared = _Sets(
        model,
        numbers,
        record,
        driver,
        {name: records[name] for name in others},
        observed,
        *_comparison(cost, size, record),
        cost is None,
        _folder(to, cost),
    )

    def why(worst: float) -> str:
        if worst > 0.0:
            return f"{model.name}: the numbers grow beyond all bounds under this input."
        return f"{model.name}: {outside(model, worst, 'input')}"

    blocks = [_Block(good[k : k + LANES], instance.options) for k in range(0, good.size, LANES)]
    return _run(shared, blocks, count, failures, why, executor)


def _given_sets(changes: Mapping[str, ArrayLike]) -> tuple[dict[str, Array], int]:
    """Values as columns, and how many sets there are."""
    values: dict[str, Array] = {}
    for name, given in changes.items():
        column = np.asarray(given)
        if column.ndim != 1 or column.size == 0 or column.dtype.kind not in "fiub":
            raise InputError(f"The values of {name} must be one number a set, in one row.")
        values[name] = column.astype(np.float64)
    sizes = {each.size for each in values.values()}
    if len(sizes) != 1:
        listed = ", ".join(f"{name} {each.size}" for name, each in values.items())
        raise InputError(f"All parameters need the same number of sets, at least one: {listed}.")
    return values, sizes.pop()


# --- drives ---------------------------------------------------------------------------------------


def simulate_drives(
    parameters: ParameterSet,
    changes: Mapping[str, ArrayLike],
    record: Record,
    *,
    by_voltage: bool,
    cost: SquaredError | None,
    output: str,
    to: str | Path | None,
    executor: Executor | None,
) -> Batch:
    """March many sets over one record; see `Drive.simulate_many`."""
    numbers, count = _columns(parameters, changes)
    failures = _failures(parameters, numbers, record.step, by_voltage)
    observed = cost.output if cost is not None else output
    if observed not in OUTPUTS:
        raise InputError(f"A batch has no output '{observed}'; it has {', '.join(OUTPUTS)}.")
    card = card_options(parameters) if by_voltage else None
    shared = _Sets(
        model_of(by_voltage),
        {PATHS[column]: values for column, values in numbers.items()},
        record,
        "voltage" if by_voltage else "current",
        {},
        observed,
        *_comparison(cost, record.time.size, record),
        cost is None,
        _folder(to, cost),
    )
    blocks = [
        _Block(sets, (card, chosen))
        for sets, chosen in _jobs(parameters, numbers, failures, count, tuple(changes))
    ]

    def why(worst: float) -> str:
        return f"{parameters.name}: {OVERFLOW if worst > 0.0 else OVERPOWERED}"

    return _run(shared, blocks, count, failures, why, executor)


def _columns(
    parameters: ParameterSet, changes: Mapping[str, ArrayLike]
) -> tuple[dict[str, Array], int]:
    """Every value of every set, and how many sets there are."""
    values, count = _given_sets(changes)
    given: dict[str, Array] = {}
    for name, each in values.items():
        for column in columns_of([name]):
            if column in given:
                raise InputError(f"{column} is given twice.")
            given[column] = each
    return {
        **{
            column: given.get(column, np.full(count, value))
            for column, value in parameters.numbers.items()
        },
        **given,
    }, count


def _failures(
    parameters: ParameterSet, numbers: Mapping[str, Array], step: float, by_voltage: bool
) -> dict[int, str]:
    """Sets that cannot be marched at all."""
    name, failures = parameters.name, dict[int, str]()
    for mask, sentence in broken_rules(numbers):
        for i in np.flatnonzero(mask):
            failures.setdefault(int(i), f"{name}: {sentence(int(i))}")
    for side in SIDES if by_voltage else ():
        limit = step_limit(numbers[f"zeta_{side}"], parameters.rate is None)
        for i in np.flatnonzero(~(numbers[f"omega_{side}"] * step < limit)):
            failures.setdefault(
                int(i),
                f"{name}: the current filter of the {side} channel "
                f"{'swings too fast for' if parameters.rate is None else 'is unstable at'} this "
                "step.",
            )
    return failures


def _folder(to: str | Path | None, cost: SquaredError | None) -> Path | None:
    """Where outputs go."""
    if to is not None and cost is not None:
        raise InputError(
            "Outputs are written to files, costs are not: leave out one of to and cost."
        )
    return None if to is None else Path(to)


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
) -> Iterator[tuple[Indices, PumpOptions]]:
    """Blocks of sets that share the options which the kernels are compiled for."""
    good = np.ones(count, dtype=bool)
    good[list(failures)] = False
    base = pump_options(parameters)
    masks: dict[str, NDArray[np.bool_]] = {
        "steep": np.tan(np.maximum(numbers["Z13_plus"], numbers["Z13_minus"])) >= TAN_22_5
    }
    for option in {SWITCHES[column] for column in changed if column in SWITCHES}:
        own = [numbers[each] for each in SWITCHES if SWITCHES[each] == option and each in numbers]
        masks[option] = np.any(own, axis=0)
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
