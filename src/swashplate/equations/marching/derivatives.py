"""Residuals of what was observed, their Jacobian and its triangular factor, for any model."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.equations.code_generation.functions import generating
from swashplate.equations.marching.kernels import Struct, pointers
from swashplate.equations.marching.layout import JacobianLayout, layout_of, started_by
from swashplate.equations.marching.observation import ObservedRecord, RunValues
from swashplate.equations.marching.rows import (
    ROWS,
    Program,
    Sink,
    aligned,
    compiled_march,
    march_struct,
    upright,
)
from swashplate.equations.marching.run import (
    NO_NUMBER,
    Instance,
    Start,
    arrays_of,
    check_domain,
    initial_states,
)
from swashplate.equations.marching.structure import Moved, Structure, structure_of
from swashplate.errors import DomainError, InputError

Array = NDArray[np.float64]


def _slopes(
    structure: Structure, instance: Instance, first: Mapping[str, float], h: float, start: Start
) -> dict[Moved, float]:
    """Derivatives of constants and of states at the start by all parameters that move them."""
    code = structure.start_code(start)
    signals_before = dict.fromkeys(first, 0.0)
    if start == "steady":
        signals_before.update(first)
    values = [instance.number_at(argument, signals_before, h) for argument in code.arguments]
    try:
        results = code.derived.python(*values)
    except NO_NUMBER as error:
        raise DomainError(
            f"{instance.name}: what follows from the parameters alone cannot be computed for these "
            f"numbers ({error})."
        ) from None
    return dict(zip(code.moves, results[len(results) - len(code.moves) :], strict=True))


def _initialised(
    layout: JacobianLayout,
    instance: Instance,
    first: Mapping[str, float],
    h: float,
    start: Start,
    started: Collection[str],
) -> tuple[Struct[Program], Array]:
    """The layout's program with its numbers, and derivatives of the states at the first sample.

    `started` are paths of states that the run starts from as its own unknowns: nothing else moves
    them. The code that computes the derivatives is generated when it is first needed.
    """
    structure = layout.structure
    slopes = dict[Moved, float]()
    if layout.columns:
        slopes = _slopes(structure, instance, first, h, start)
    tangent = np.zeros(layout.tangents)
    for (state, column), index in layout.tangent_of.items():
        if f"{structure.model.prefix(state.part)}{state.path}" in started:
            tangent[index] = state.path in started_by(structure.model, state.part, column)
        else:
            tangent[index] = slopes.get((state, column), 0.0)
    delays = instance.tap_delays(structure.signals, h)
    scale = layout.program.scale.copy()
    for term, factor in layout.factors:
        factor_id, _ = factor
        if factor_id.kind == "fraction":
            scale[term] *= delays.slope[int(factor_id.path)]
        else:
            scale[term] *= slopes[factor]
    return Struct(layout.program._replace(scale=scale)), tangent


@generating
def _at_rest(
    layout: JacobianLayout, instance: Instance, h: float, started: tuple[str, ...]
) -> tuple[Struct[Program], Array]:
    """Those of a start at rest, which depends on no record."""
    return _initialised(layout, instance, {}, h, "rest", started)


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
    instance: Instance, observed: ObservedRecord, run_values: RunValues = NO_RUN_VALUES
) -> Array:
    """(m,) weighted residuals of all observations, one after the other; 0 if the weight is 0.

    Each is weight · (simulated + offset - measured) in its signal's SI unit; `run_values` are
    values of the run's own unknowns.
    """
    rows = np.empty((1, observed.rows))
    _march(instance, observed, run_values, columns=(), row_places=(), rows=rows, offset_start=0)
    return np.asarray(rows[0])


def jacobian(
    instance: Instance,
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
    instance: Instance,
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
    instance: Instance,
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
    structure = structure_of(instance.model, signals, instance.options, outputs)
    plan = observed.plan
    numbers = tuple(outputs.index(observation.signal) for observation in observed.observations)
    layout = layout_of(structure, tuple(columns), numbers, start)
    first = {name: float(values[0]) for name, values in records.items()}
    initial = instance.start(first, h, start)
    states = initial_states(instance, initial, run_values.start)
    if start == "rest":
        program, tangent = _at_rest(layout, instance, h, tuple(run_values.start))
    else:
        program, tangent = _initialised(layout, instance, first, h, start, run_values.start)
    fields = Sink(
        columns=len(rows),
        length=rows.shape[1],
        rows=rows,
        derived=len(columns),
        target=np.array(row_places, dtype=np.int64),
        first_offset_row=offset_start,
        folded=int(factor.size > 0),
        factor=factor,
        offset=observed.offsets(run_values.offsets),
        offset_row=observed.offset_rows(offset_start),
    )
    sink = Struct(fields)
    room = layout.take_room()
    room.fields.tangent[:] = tangent
    room.fields.integral_states[:] = 0.0
    room.fields.next_sample[:] = plan.fields.first[:-1]
    values = tuple(records.values())
    worst_margin = np.array([np.inf])
    arrays = arrays_of(
        instance,
        values,
        initial,
        instance.tap_delays(signals, h),
        states,
        worst_margin,
        room.fields.block,
    )
    structs = march_struct(program, plan, sink, room)
    march = compiled_march()
    march(layout.kernels, pointers(arrays), values[0].size, h, structs.address)
    layout.give_back(room)
    check_domain(instance, states, float(worst_margin[0]), observed.driven_by)


# --- a model with numbers, differentiated ---------------------------------------------------------


class BoundModel(NamedTuple):
    """A model with numbers, and what it is differentiated by."""

    instance: Instance
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
