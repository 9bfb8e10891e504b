"""Many sets of numbers of one model over one input.

Of each set its output, in memory or streamed to files, or only its cost.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import FileError, InputError
from swashplate.executors import Executor, Threads
from swashplate.machine import Definition, Machine, Model, derive
from swashplate.machine.fields import check_mapping, floats_of, nested_from, tuple_from, value_at
from swashplate.machine.marching import (
    LANES,
    CodeForm,
    Command,
    Observation,
    PartNumbers,
    Record,
    Sampling,
    called,
    inputs_of,
    lanes_of,
    output_of,
    outside,
    unstable_step,
)
from swashplate.machine.model import arguments_of, near_names, parameter_paths, state_paths
from swashplate.machine.rules import CheckedRule
from swashplate.results import Result
from swashplate.tables import write_table
from swashplate.units import in_si

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]

SAMPLES_A_FILE = 2**23
"""Samples of all sets of a file, 64 MB, unless a single block of sets has more."""


@dataclass(frozen=True)
class SquaredError(Result):
    """Cost of a set: Σ weight · (output - measured)² over the record's samples."""

    measured: ArrayLike
    """(n,) what was measured, in the output's SI unit."""
    weight: ArrayLike = 1.0
    """(n,) or one number; samples of weight 0 do not count, whatever they are."""
    output: str = "shaft_speed"
    """Signal that is compared; of a drive one of `Simulation`, or ``"current_sum"``."""


@dataclass(frozen=True, eq=False)
class Batch(Result):
    """Results of many sets, in the order of the sets.

    A set that breaks a rule or leaves the model's domain does not stop the others: its cost is
    infinite, its outputs are NaN, and `failures` says why.

    Examples
    --------
    >>> import numpy as np
    >>> from swashplate import Drive, SquaredError, maneuvers
    >>> hoist = Drive.preset("hoist")
    >>> measured = hoist.simulate(maneuvers.step(9.0)).shaft_speed
    >>> gains = hoist["Z8"].value * np.array([0.9, 1.0, 1.1])
    >>> batch = hoist.simulate_many(
    ...     {"Z8": gains},
    ...     voltage=maneuvers.step(9.0),
    ...     cost=SquaredError(measured),
    ... )
    >>> int(np.argmin(batch.cost))
    1
    """

    cost: Array | None
    """(m,) costs, None if outputs were asked for."""
    output: Array | None
    """(m, n) outputs, None if costs were asked for or files written."""
    failures: dict[int, str]
    """Why a set has no result, by its number."""
    files: tuple[Path, ...] = ()
    """Parquet tables of the outputs: the column ``time`` [s], and one for each set that could be
    marched, called by its number."""


def simulate_many(
    machine: Machine,
    changes: Mapping[str, ArrayLike],
    inputs: Mapping[str, ArrayLike | Command],
    rate: float,
    *,
    output: str = "",
    cost: SquaredError | None = None,
    to: str | Path | None = None,
    executor: Executor | None = None,
    **sampling: Unpack[Sampling],
) -> Batch:
    """Simulate many parameter sets of a model over one record, from rest or from given states.

    Parameters
    ----------
    machine, inputs, rate, **sampling :
        As in `swashplate.machine.simulate`; `clip`, `time`, `interpolation`, `substeps`.
    changes : mapping of str to (m,) array_like
        Values of parameters by path, one for each set; the others are those of the machine. The
        last word of a path is enough where it is unique, and a symbol stands for both directions.
        With ``start.`` before its path, a number of the state at the first sample, as `begin` of
        `swashplate.machine.simulate`.
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

    Returns
    -------
    Batch
        Outputs or costs in the order of the sets, and why a set has none.

    Raises
    ------
    InputError
        For what does not fit the model, or outputs that need more memory than there is.
    FileError
        If files cannot be written.

    Examples
    --------
    >>> import numpy as np
    >>> from swashplate import FullOrderDrive, Machine, simulate_many
    >>> from swashplate.models.full_order import Substeps, plant
    >>> numbers = FullOrderDrive.preset("hoist").plant
    >>> batch = simulate_many(
    ...     Machine(plant, numbers, given=Substeps(8.0)),
    ...     {"machine.load_torque": [0.0, 1e3]},
    ...     {"current": np.full(1024, 0.7)},
    ...     512.0,
    ...     output="shaft_speed",
    ... )
    >>> batch.output.shape
    (2, 1024)
    """
    model = machine.model
    records = inputs_of(machine, inputs, rate, **sampling)
    values, count = _set_columns(model, changes)
    if cost is None and not output:
        raise InputError(f"{model.name}: name the output of the sets to return, or give a cost.")
    name = machine.name
    numbers = {path: np.full(count, number) for path, number in _numbers_of(machine).items()}
    numbers |= values
    step = next(iter(records.values())).step
    groups = _option_groups(machine, numbers, values, count)
    rules = chain(
        machine.checked(numbers),
        _rules(model, values),
        _step_rules(machine, numbers, values, groups, step),
    )
    failures: dict[int, str] = {}
    for rule in rules:
        for number in np.flatnonzero(rule.is_broken):
            failures.setdefault(int(number), f"{name}: {rule.sentence(int(number))}")
    blocks: list[Block] = []
    for group in groups:
        members = np.setdiff1d(np.flatnonzero(group.sets), list(failures))
        starts = range(0, members.size, LANES)
        blocks += [Block(members[first : first + LANES], group.options) for first in starts]
    sets = _Sets(
        model=model,
        numbers=numbers,
        records=records,
        output=cost.output if cost else output,
        cost=cost,
        to=to,
    )
    return _march_all(sets, blocks, count, failures, name, executor)


def _paths_of(model: Model, name: str) -> tuple[str, ...]:
    """Paths that a change stands for: parameters, or with ``start.`` a number of the state."""
    if not name.startswith("start."):
        return model.parameters_named(name)
    starts = [f"start.{path}" for path in state_paths(model)]
    if name not in starts:
        raise InputError(f"{model.name} has no state {near_names(name, starts)}.")
    return (name,)


def _numbers_of(instance: Machine) -> dict[str, float]:
    """Parameters by path, and givens by ``"given "`` and their path, as `Lanes` takes them."""
    model = instance.model
    givens = [
        f"given {model.prefix(part_index)}{path}" for part_index, path in model.places("given")
    ]
    paths = (*parameter_paths(model), *givens)
    return dict(zip(paths, (*instance.params, *instance.given), strict=True))


def _rules(model: Model, values: Mapping[str, Array]) -> Iterator[CheckedRule]:
    """What values of a model's parameters must satisfy: their ranges, and that they are finite."""
    taps = [
        (part_index, tap)
        for part_index, part in enumerate(model.parts)
        for tap in part.taps.values()
    ]
    delays = {f"{model.prefix(part_index)}{tap.delay}" for part_index, tap in taps if tap.delay}
    for path, column in values.items():
        if path in model.ranges:
            yield _range_rule(path, model.ranges[path], column)
        yield _size_rule(path, column, is_delay=path in delays)


def _range_rule(path: str, definition: Definition, column: Array) -> CheckedRule:
    """The range of a parameter's `Definition`."""
    return CheckedRule(
        ~definition.holds(column), lambda i: f"{definition.broken(path, column[i])}."
    )


def _size_rule(path: str, column: Array, *, is_delay: bool) -> CheckedRule:
    """Numbers are finite, and delays not negative."""
    rule = "a finite number, at least 0" if is_delay else "a finite number"
    breaks = ~np.isfinite(column) | (is_delay & (column < 0.0))
    return CheckedRule(breaks, lambda i: f"{path} is {column[i]:g}, but must be {rule}.")


def _set_columns(model: Model, changes: Mapping[str, ArrayLike]) -> tuple[dict[str, Array], int]:
    """Values in SI as columns by path, one number a set, and how many sets there are."""
    check_mapping("changes", changes)
    values = dict[str, Array]()
    for name, numbers in changes.items():
        for path in _paths_of(model, name):
            if path in values:
                raise InputError(f"{path} is given twice.")
            definition = model.parameter_definitions.get(path)
            unit = definition.unit if definition else ""
            column = np.asarray(in_si(numbers, unit, name) if unit else numbers)
            if column.ndim != 1 or column.size == 0 or column.dtype.kind not in "fiub":
                raise InputError(f"The values of {name} must be one number per set, in one row.")
            values[path] = column.astype(np.float64)
    sizes = {column.size for column in values.values()}
    if len(sizes) != 1:
        listed = ", ".join(f"{name} {column.size}" for name, column in values.items())
        raise InputError(f"All parameters need the same number of sets, at least one: {listed}.")
    return values, sizes.pop()


class OptionGroup(NamedTuple):
    """Sets with the same options, which kernels are compiled for."""

    sets: Mask
    """(m,) which sets have them."""
    options: tuple[Any, ...]
    """Options of each part of the model."""


# --- options and steps of sets --------------------------------------------------------------------


def _option_groups(
    machine: Machine, numbers: Mapping[str, Array], changed: Collection[str], count: int
) -> list[OptionGroup]:
    """Sets by the options that they share, those that follow from their numbers.

    An option that parameters switch on is on in the sets in which one of them is not 0, if a number
    of it changes; else it is as in the machine.
    """
    model = machine.model
    masks = dict[tuple[int, str], Mask]()
    for (index, option), paths in model.switches.items():
        full = [f"{model.prefix(index)}{path}" for path in paths]
        if any(path in changed for path in full):
            masks[index, option] = np.any([numbers[path] for path in full], axis=0)
    for index, part in enumerate(model.parts):
        for option, equation in part.follows.items() if _changes(model, index, changed) else ():
            arguments = {"p": _numbers_of_part(model, index, numbers)}
            masks[index, option] = _over_sets(part, equation, arguments, count) != 0.0
    if not masks:
        return [OptionGroup(np.ones(count, dtype=np.bool_), machine.options)]
    kinds = np.stack(list(masks.values()), axis=1)
    groups = []
    for kind in np.unique(kinds, axis=0):
        options = list(machine.options)
        for (index, option), acts in zip(masks, kind, strict=True):
            options[index] = options[index]._replace(**{option: True if acts else None})
        groups.append(OptionGroup((kinds == kind).all(axis=1), tuple(options)))
    return groups


def _step_rules(
    machine: Machine,
    numbers: Mapping[str, Array],
    changed: Collection[str],
    groups: Sequence[OptionGroup],
    step: float,
) -> Iterator[CheckedRule]:
    """Sets at which a part does not bear the step [s]."""
    model = machine.model
    for index, part in enumerate(model.parts):
        if part.stable is None:
            continue
        if not _changes(model, index, changed):
            arguments = {"p": machine.parts[index].p, "h": step, "options": machine.options[index]}
            if called(part, part.stable, arguments) > 0.0:
                continue
        for group in groups:
            p = _numbers_of_part(model, index, numbers)
            options = group.options[index]
            arguments = {"p": p, "h": step, "options": options}
            margins = _over_sets(part, part.stable, arguments, group.sets.size)

            def sentence(number: int, index: int = index, options: Any = options) -> str:
                part = model.parts[index]
                of_set = {path: values[number] for path, values in numbers.items()}
                p = _numbers_of_part(model, index, of_set)
                return unstable_step(part, PartNumbers(p, options), step)

            yield CheckedRule(group.sets & ~(margins > 0.0), sentence)


def _changes(model: Model, index: int, changed: Collection[str]) -> bool:
    """Whether some of the changed parameters are those of a part."""
    prefix = model.prefix(index)
    return any(path.startswith(prefix) for path in changed)


def _numbers_of_part(model: Model, index: int, numbers: Mapping[str, Any]) -> Any:
    """Parameters of a part from numbers, or columns of them, by the whole model's paths."""
    return nested_from(model.parts[index].parameters, numbers, model.prefix(index))


def _over_sets(
    part: Model, equation: Any, arguments: Mapping[str, Any], count: int
) -> NDArray[np.float64]:
    """(m,) what an equation of a part gives for columns of parameters."""
    names = arguments_of(equation)
    if part.replacements:  # a user-defined equation may stand for one that this one calls
        kind = part.parameters
        columns = {path: value_at(arguments["p"], path) for path in floats_of(kind)}
        sets = [{path: values[i] for path, values in columns.items()} for i in range(count)]
        results = [called(part, equation, {**arguments, "p": tuple_from(kind, of)}) for of in sets]
        return np.array(results, dtype=np.float64)
    decided = {"options": arguments["options"]} if "options" in names else {}
    (result,) = derive(equation, (), decided).over(*(arguments[name] for name in names))
    return np.broadcast_to(np.asarray(result, dtype=np.float64), (count,))


# --- blocks of sets -------------------------------------------------------------------------------


class Block(NamedTuple):
    """Up to LANES sets that share their options."""

    sets: Indices
    options: tuple[Any, ...]
    """Kernels are compiled for those."""


@dataclass(frozen=True, eq=False)
class _Sets:
    """Sets over one record, and what of them is wanted."""

    model: Model
    numbers: Mapping[str, Array]  # (m,) each, by path; see `Lanes`
    records: Mapping[str, Record]  # external signals on the grid
    output: str
    cost: SquaredError | None
    to: str | Path | None

    @property
    def record(self) -> Record:
        """The first input."""
        return next(iter(self.records.values()))

    def file(self, blocks: Sequence[Block]) -> Path:
        """Where outputs of some blocks go."""
        return Path(self.to or "") / f"{blocks[0].sets[0]:08d}.parquet"

    @cached_property
    def compared(self) -> tuple[Array, Array]:
        """Measured values and weights on the march's grid, zero weight between the samples."""
        # zeros that nobody writes to take no memory
        measured, weight = np.zeros(self.record.values.size), np.zeros(self.record.values.size)
        if self.cost is not None:
            time = self.record.time
            samples = slice(None, None, self.record.substeps)
            observation = Observation(self.cost.output, time, self.cost.measured, self.cost.weight)
            weight[samples] = observation.weight
            measured[samples] = np.where(weight[samples] > 0.0, observation.values, 0.0)
        return measured, weight


class _Marched(NamedTuple):
    """What a block of sets gave."""

    failed: dict[int, float]
    """Worst margins of the sets that failed, by their numbers."""
    sets: Indices
    """Numbers of the sets that have values: none if these are in a file."""
    values: Array
    """Their costs or outputs."""


def _march_blocks(shared: _Sets, blocks: Sequence[Block]) -> list[_Marched]:
    """March blocks of sets; their outputs go into one file if into any."""
    record = shared.record
    keep = shared.cost is None
    measured, weight = shared.compared
    inputs = {name: record.values for name, record in shared.records.items()}
    table = {"time": record.time} if shared.to is not None else {}
    marched = []
    for sets, options in blocks:
        padded = np.resize(sets, LANES)
        size = sets.size
        march = lanes_of(shared.model, CodeForm(tuple(inputs), options), shared.output)
        lanes = march(
            {path: values[padded] for path, values in shared.numbers.items()},
            inputs,
            record.step,
            measured=measured,
            weight=weight,
            keep=keep,
        )
        worst = lanes.worst[:size]
        values = lanes.cost[:size]
        good = np.isfinite(lanes.end[:size]) & (worst > 0.0)
        if keep:
            values = lanes.outputs[:size, :: record.substeps]
        values[~good] = np.nan if keep else np.inf
        if keep and shared.to is not None:
            table |= {str(number): row for number, row in zip(sets, values, strict=True)}
            values = values[:0]
        failed = dict(zip(sets[~good].tolist(), worst[~good].tolist(), strict=True))
        marched.append(_Marched(failed, sets[: len(values)], values))
    if shared.to is not None:
        import polars as pl

        write_table(pl.DataFrame(table), shared.file(blocks))
    return marched


def _march_all(
    shared: _Sets,
    blocks: Sequence[Block],
    count: int,
    failures: dict[int, str],
    name: str,
    executor: Executor | None,
) -> Batch:
    """March all blocks wherever the executor runs them; `name` is for messages."""
    output_of(shared.model, shared.output)
    driver = next(iter(shared.records))
    samples = shared.record.time.size
    keep = shared.cost is None
    blocks_per_file = 1
    values = None if keep else np.full(count, np.inf)
    if shared.to is not None:
        if not keep:
            raise InputError(
                "Outputs are written to files, costs are not: leave out one of to and cost."
            )
        _make_folder(Path(shared.to))
        blocks_per_file = max(SAMPLES_A_FILE // (samples * LANES), 1)
    elif keep:
        values = _outputs(count, samples)
    groups_of_blocks = [
        blocks[first : first + blocks_per_file] for first in range(0, len(blocks), blocks_per_file)
    ]
    for _, marched in (executor or Threads()).run(_march_blocks, shared, groups_of_blocks):
        for block in marched:
            for number, worst in block.failed.items():
                why = f"the numbers overflow under this {driver}."
                if not worst > 0.0:
                    why = outside(shared.model, worst, driver)
                failures[number] = f"{name}: {why}"
            if values is not None:
                values[block.sets] = block.values
    return Batch(
        cost=None if keep else values,
        output=values if keep else None,
        failures=dict(sorted(failures.items())),
        files=tuple(map(shared.file, groups_of_blocks)) if shared.to else (),
    )


def _outputs(count: int, samples: int) -> Array:
    """Room for outputs in memory, refused if the machine has less."""
    size = 8.0 * count * samples
    try:
        if size < float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")):
            return np.full((count, samples), np.nan)
    except (AttributeError, ValueError, OSError):  # not on Windows, which says so by a MemoryError
        return np.full((count, samples), np.nan)
    except MemoryError:
        pass
    raise InputError(
        f"The outputs of {count} sets, {samples} samples each, take {size / 2**30:.3g} GiB, more "
        "than this machine's memory: give a cost, or write them to files with to=FOLDER."
    )


def _make_folder(folder: Path) -> None:
    """A folder without outputs of an earlier batch."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        present = next(folder.glob("*.parquet"), None)
    except OSError as error:
        raise FileError(f"{folder} cannot be created: {error.strerror or error}.") from None
    if present is not None:
        raise FileError(
            f"{folder} already contains {present.name}; name an empty folder for the outputs."
        )
