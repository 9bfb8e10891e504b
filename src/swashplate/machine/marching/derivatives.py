"""Residuals of what was observed, their Jacobian and its triangular factor, for any model."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import DomainError, InputError
from swashplate.machine.code_generation.functions import generating
from swashplate.machine.code_generation.machine_code import code_of_text
from swashplate.machine.declaration import JIT_OFF
from swashplate.machine.keeping import cached_on_disk, key_of
from swashplate.machine.marching.interpreting import InterpretedTangents, interpreted_rows
from swashplate.machine.marching.kernels import FLOATS, INTS, KERNEL_KINDS, Struct, pointers
from swashplate.machine.marching.observation import ObservedRecord, RunValues
from swashplate.machine.marching.part_code import SignalId
from swashplate.machine.marching.rows import (
    ROWS,
    BlockRun,
    Room,
    Sink,
    aligned,
    routines,
    upright,
)
from swashplate.machine.marching.run import (
    Machine,
    Start,
    arrays_of,
    check_domain,
    initial_states,
)
from swashplate.machine.marching.sample_code import CodeForm, SampleCode, output_of
from swashplate.machine.marching.start_code import start_code_of, started_by
from swashplate.machine.marching.tangents import Tangents, padded, tangents_of
from swashplate.machine.model import Model

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

OLDEST = 3
"""Samples that a tap looks back at most beside its delay."""
TANGENT_KINDS = (*KERNEL_KINDS, *(FLOATS,) * 4, INTS)
"""Kinds of the arguments of a march with derivatives, see `tangents.TANGENT_ARGUMENTS`."""


class ObservedMarch:
    """The march that gives some signals and their derivatives by some columns, for any numbers.

    Attributes
    ----------
    tangents : Tangents
        Its text, and where its numbers are.
    """

    def __init__(
        self,
        model: Model,
        form: CodeForm,
        outputs: tuple[str, ...],
        columns: tuple[str, ...],
        start: Start,
    ) -> None:
        self._model, self._columns, self._start = model, columns, start
        self._spare: deque[tuple[Array, ...]] = deque(maxlen=8)
        self._refuse_before()
        self._start_code = start_code_of(model, form, outputs, start)
        begins: dict[SignalId, list[int]] = {}
        for number, column in enumerate(columns):
            for signal in self._started_by(column):
                begins.setdefault(signal, []).append(number)
        for signal, column in self._start_code.moves:
            if column in columns:
                begins.setdefault(signal, []).append(columns.index(column))
        arguments = (model, form, outputs, columns, begins)
        if JIT_OFF:
            observed = [output_of(model, output) for output in outputs]
            sample_code = SampleCode(model, form, [signal for signal, _ in observed])
            self.interpreted = InterpretedTangents(sample_code, observed, columns)
            self._set_states(self.interpreted.states)
            return
        name = f"{model.name}_tangents" if columns else f"{model.name}_residuals"
        self.tangents: Tangents = cached_on_disk(
            name,
            (key_of(model), form, outputs, columns, tuple(begins.items())),
            lambda: tangents_of(*arguments),
        )
        self._set_states(self.tangents.states)
        self._codes = [
            code_of_text(name, text, TANGENT_KINDS, pack=not columns)
            for text in self.tangents.texts
        ]
        self.codes = np.array([code.address for code in self._codes], dtype=np.int64)

    def _refuse_before(self) -> None:
        """Refuse columns that are what signals were before the record."""
        for index, part in enumerate(self._model.parts):
            for tap in part.taps.values():
                path = f"{self._model.prefix(index)}{tap.before}"
                if tap.before and path in self._columns:
                    raise InputError(
                        f"{path} is what a signal was before the record: there are no derivatives "
                        "by it."
                    )

    def _set_states(self, states: Sequence[SignalId]) -> None:
        """Find out which states the columns move where a record begins."""
        self.states = tuple(states)
        row_of = {signal: row for row, signal in enumerate(states)}
        number_of = {column: number for number, column in enumerate(self._columns)}
        self._paths = [f"{self._model.prefix(s.part)}{s.path}" for s in states]
        code = self._start_code
        self._moves = [
            (row_of[signal], number_of[column], entry)
            for (signal, column), entry in zip(code.moves, code.program.entries, strict=True)
            if signal in row_of and column in number_of
        ]
        self._starts = [
            (row_of[signal], number)
            for number, column in enumerate(self._columns)
            for signal in self._started_by(column)
            if signal in row_of
        ]

    def _started_by(self, column: str) -> list[SignalId]:
        """States that a column such as ``start.pump.pressure`` sets."""
        return [
            SignalId(part, "state", path)
            for part in range(len(self._model.parts))
            for path in started_by(self._model, part, column)
        ]

    def begin(
        self, instance: Machine, first: Mapping[str, float], h: float, started: Collection[str]
    ) -> Array:
        """(s, w) derivatives of the states at the first sample by the columns, and by idle ones.

        `started` are paths of states that the run starts from as its own unknowns: nothing else
        moves them.
        """
        tangent = np.zeros((len(self.states), padded(len(self._columns))))
        slopes = self._slopes(instance, first, h) if self._moves else tangent
        for state, column, entry in self._moves:
            tangent[state, column] = slopes[entry]
        if not np.isfinite(tangent).all():
            raise DomainError(
                f"{instance.name}: what follows from the parameters alone cannot be computed for "
                "these numbers."
            )
        for state, path in enumerate(self._paths):
            if path in started:
                tangent[state] = 0.0
        for state, column in self._starts:
            if self._paths[state] in started:
                tangent[state, column] = 1.0
        return tangent

    def _slopes(self, instance: Machine, first: Mapping[str, float], h: float) -> Array:
        """Derivatives of states at the start by all parameters that move them."""
        code = self._start_code
        signals_before = dict.fromkeys(first, 0.0)
        if self._start == "steady":
            signals_before.update(first)
        values = [instance.number_at(argument, signals_before, h) for argument in code.arguments]
        return code.program.slopes(values)

    def take_room(self) -> tuple[Array, ...]:
        """Memory for a march, of an earlier one if it can be: new memory takes longer to get."""
        with suppress(IndexError):  # another thread may be faster
            return self._spare.pop()
        sizes = self.tangents
        return (
            aligned((sizes.block + 2) * sizes.row),
            aligned(sizes.block * sizes.room),
            aligned(max(sizes.tangents, 1)),
        )

    def give_back(self, room: tuple[Array, ...]) -> None:
        """Keep the memory of a march that has ended."""
        self._spare.append(room)


@generating
def _begin_at_rest(
    march: ObservedMarch, instance: Machine, h: float, started: tuple[str, ...]
) -> Array:
    """Those of a start at rest, which depend on no record."""
    return march.begin(instance, {}, h, started)


@generating
def observed_march(
    model: Model, form: CodeForm, outputs: tuple[str, ...], columns: tuple[str, ...], start: Start
) -> ObservedMarch:
    """The march of a model that gives some outputs, and derivatives of them, made once."""
    return ObservedMarch(model, form, outputs, columns, start)


# --- what a fit asks for --------------------------------------------------------------------------


class Jacobian(NamedTuple):
    """Weighted residuals and their derivatives."""

    names: tuple[str, ...]
    """Columns: those asked for, then the observations' free offsets."""
    rows: Array
    """(k + 1, m): the columns one after the other, each over all m samples, residuals last."""

    @property
    def columns(self) -> Array:
        """(m, k) derivatives of the residuals, a view. [weighted signal/...]"""
        return np.asarray(self.rows[:-1].T)

    @property
    def residuals(self) -> Array:
        """(m,) weight · (simulated + offset - measured), a view."""
        return np.asarray(self.rows[-1])


class Triangle(NamedTuple):
    """The same problem in k + 1 rows."""

    names: tuple[str, ...]
    """Columns, as in `Jacobian`."""
    factor: Array
    """(k + 1, k + 1) upper triangle R of [J r], with RᵀR = [J r]ᵀ[J r]; no diagonal element is
    negative."""


NO_RUN_VALUES = RunValues()


def residuals(
    instance: Machine, observed: ObservedRecord, run_values: RunValues = NO_RUN_VALUES
) -> Array:
    """(m,) weighted residuals of all observations, one after the other; 0 if the weight is 0.

    Each is weight · (simulated + offset - measured) in its signal's SI unit; `run_values` are
    values of the run's own unknowns.
    """
    rows = np.empty((1, observed.rows))
    _march(instance, observed, run_values, columns=(), row_places=(), rows=rows, offset_start=0)
    return np.asarray(rows[0])


def jacobian(
    instance: Machine,
    observed: ObservedRecord,
    columns: Sequence[str],
    run_values: RunValues = NO_RUN_VALUES,
    *,
    can_depend: Sequence[bool] | None = None,
    out: Array | None = None,
) -> Jacobian:
    """The same residuals with their exact derivatives by columns.

    Columns are paths of parameters, and ``start.`` with the path of a state; `can_depend` says
    whether the record may depend on each at all: the others give zeros. `out` is (k + 1, m) memory
    to write to, the `rows` of an earlier call for example: new memory takes longer to get than the
    march.
    """
    dependent = np.flatnonzero(np.ones(len(columns)) if can_depend is None else can_depend)
    names = (*columns, *observed.own_columns)
    shape = (len(names) + 1, observed.rows)
    if out is None:
        out = np.empty(shape)
    elif out.shape != shape or out.dtype != np.float64 or not out.flags.carray:
        raise InputError(f"out must be a plain array of floats of shape {shape}.")
    for c in set(range(len(columns))).difference(dependent):
        out[c] = 0.0
    _march(
        instance,
        observed,
        run_values,
        columns=[columns[c] for c in dependent.tolist()],
        row_places=dependent,
        rows=out,
        offset_start=len(columns),
    )
    return Jacobian(names, out)


def triangle(
    instance: Machine,
    observed: ObservedRecord,
    columns: Sequence[str],
    run_values: RunValues = NO_RUN_VALUES,
    *,
    can_depend: Sequence[bool] | None = None,
) -> Triangle:
    """Triangular factor of [J r]; arguments as in `jacobian`, which is never held.

    Memory does not grow with the record, apart from the record and the observations themselves.
    """
    dependent = np.flatnonzero(np.ones(len(columns)) if can_depend is None else can_depend)
    names = (*columns, *observed.own_columns)
    used = np.concatenate([dependent, np.arange(len(columns), len(names) + 1)])
    factor_of_used = np.zeros((used.size, used.size))
    _march(
        instance,
        observed,
        run_values,
        columns=[columns[c] for c in dependent.tolist()],
        row_places=range(dependent.size),
        rows=aligned(used.size, ROWS),
        offset_start=dependent.size,
        factor=factor_of_used,
    )
    factor = np.zeros((len(names) + 1, len(names) + 1))
    factor[np.ix_(used, used)] = upright(factor_of_used)
    if not np.isfinite(factor).all():
        overflown = np.asarray(~np.isfinite(factor)).any(axis=0)
        bad = [*names, "the residuals"][int(np.argmax(overflown))]
        raise DomainError(
            f"{instance.name}: {bad}: the derivatives are too large for a least-squares problem; "
            "check the size of the parameters and weights."
        )
    return Triangle(names, factor)


NO_FACTOR = np.zeros((0, 0))


def _march(
    instance: Machine,
    observed: ObservedRecord,
    run_values: RunValues,
    *,
    columns: Sequence[str],
    row_places: ArrayLike,
    rows: Array,
    offset_start: int,
    factor: Array = NO_FACTOR,
) -> None:
    """Fill `rows` with observations and derivatives, or update the QR factor `factor` with them.

    ``row_places[i]`` is the row of column i. Rows of free offsets begin at row `offset_start`.
    """
    records = observed.records
    h = observed.record.step
    start = observed.start
    signals = tuple(records)
    outputs = tuple(dict.fromkeys(observation.signal for observation in observed.observations))
    missing = [
        column
        for column in columns
        if column.startswith("start.") and column[6:] not in run_values.start
    ]
    if missing:
        raise InputError(f"{missing[0]} is a column, so RunValues needs a value of it.")
    march = observed_march(instance.model, instance.form(signals), outputs, tuple(columns), start)
    plan = observed.plan
    numbers = [outputs.index(observation.signal) for observation in observed.observations]
    first = {name: float(values[0]) for name, values in records.items()}
    initial = instance.start(first, h, start)
    states = initial_states(instance, initial, run_values.start)
    delays = instance.tap_delays(signals, h)
    values = (*records.values(), *(np.empty(observed.record.values.size) for _ in initial.between))
    worst_margin = np.array([np.inf, 0.0])
    places = np.array(row_places, dtype=np.int64)
    offsets = observed.offsets(run_values.offsets)
    offset_rows = observed.offset_rows(offset_start)
    if start == "rest":
        begin = _begin_at_rest(march, instance, h, tuple(run_values.start))
    else:
        begin = march.begin(instance, first, h, run_values.start)
    if JIT_OFF:
        arrays = arrays_of(instance, values, initial, delays, states, worst_margin, states)
        tangent = begin[:, : len(columns)]
        simulated = march.interpreted(values[0].size, h, arrays, delays.slope, tangent, start)
        interpreted_rows(plan.fields, numbers, simulated, places, offsets, offset_rows, rows)
        if factor.size:
            factor[:] = np.linalg.qr(rows.T, mode="r")
        check_domain(instance, states, float(worst_margin[0]), observed.driven_by)
        return
    sizes = march.tangents
    flat, room, tangent = march.take_room()
    tangent[: begin.size] = begin.reshape(-1)
    tangent[begin.size :] = 0.0
    sink = Sink(
        columns=len(rows),
        length=rows.shape[1],
        rows=rows,
        target=np.concatenate([places, np.full(sizes.width - places.size, len(rows) - 1)]),
        first_offset_row=offset_start,
        folded=int(factor.size > 0),
        factor=factor,
        offset=offsets,
        offset_row=offset_rows,
    )
    left = Room(
        block=sizes.block,
        row=sizes.row,
        width=sizes.width,
        flat=flat,
        value=np.array(numbers, dtype=np.int64),
        column=np.array(
            [sizes.first_column + number * sizes.width for number in numbers], dtype=np.int64
        ),
        next_stamp=plan.fields.first[:-1].copy(),
    )
    given = (
        *arrays_of(instance, values, initial, delays, states, worst_margin, flat[sizes.row :]),
        delays.slope,
        tangent,
        room,
        *_ring(sizes, delays.samples, start),
    )
    run, write_rows, absorb = routines()
    struct = Struct(
        BlockRun(
            len(march.codes),
            march.codes,
            pointers(given),
            plan,
            Struct(sink),
            Struct(left),
            write_rows,
            absorb,
        )
    )
    run(values[0].size, h, struct.words)
    march.give_back((flat, room, tangent))
    check_domain(instance, states, float(worst_margin[0]), observed.driven_by)


def _ring(sizes: Tangents, delay_samples: Indices, start: Start) -> tuple[Array, Indices]:
    """``past`` and ``ring``, see `tangents.TANGENT_ARGUMENTS`."""
    samples = 1 << int(delay_samples.max(initial=0) + OLDEST).bit_length()
    past = aligned(samples * sizes.past) if sizes.past else np.zeros(0)
    return past, np.array([samples - 1, start == "steady"], dtype=np.int64)


# --- a model with numbers, differentiated ---------------------------------------------------------


class BoundModel(NamedTuple):
    """A model with numbers, and what it is differentiated by."""

    instance: Machine
    run_values: RunValues = NO_RUN_VALUES
    """Values of the run's own unknowns."""
    paths: Sequence[str] = ()
    """Columns of derivatives."""
    can_depend: Sequence[bool] | None = None
    """Whether the record may depend on each column at all; by default it may."""

    def residuals(self, observed: ObservedRecord) -> Array:
        """(m,) weighted residuals of all observations; see `residuals`."""
        return residuals(self.instance, observed, self.run_values)

    def jacobian(self, observed: ObservedRecord, out: Array | None = None) -> Jacobian:
        """The same residuals with their exact derivatives; see `jacobian`."""
        return jacobian(
            self.instance,
            observed,
            self.paths,
            self.run_values,
            can_depend=self.can_depend,
            out=out,
        )

    def triangle(self, observed: ObservedRecord) -> Triangle:
        """Triangular factor of [J r]; see `triangle`."""
        return triangle(
            self.instance, observed, self.paths, self.run_values, can_depend=self.can_depend
        )
