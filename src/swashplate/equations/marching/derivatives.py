"""Residuals of what was observed, their Jacobian and its triangular factor, for any model."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.equations.code_generation.functions import generating
from swashplate.equations.marching.kernels import Struct, addresses, pointers
from swashplate.equations.marching.layout import JacobianLayout, layout_of, started_by
from swashplate.equations.marching.observation import ObservedRecord, RunValues
from swashplate.equations.marching.rows import (
    ROWS,
    Program,
    Sink,
    aligned,
    compiled_march,
    march_of,
    upright,
)
from swashplate.equations.marching.run import (
    NO_NUMBER,
    Instance,
    Start,
    arrays_of,
    begun,
    check_domain,
)
from swashplate.equations.marching.structure import Moved, Structure, structure_of
from swashplate.errors import DomainError, InputError

Array = NDArray[np.float64]


def _slopes(
    structure: Structure, instance: Instance, first: Mapping[str, float], h: float, start: Start
) -> dict[Moved, float]:
    """Derivatives of constants and of states at the start by all parameters that move them."""
    starting, before = structure.starting(start), dict.fromkeys(first, 0.0)
    if start == "steady":
        before.update(first)
    values = [instance.number_at(each, before, h) for each in starting.arguments]
    try:
        found = starting.derived.python(*values)
    except NO_NUMBER as error:
        raise DomainError(
            f"{instance.name}: what follows from the parameters alone cannot be computed for these "
            f"numbers ({error})."
        ) from None
    return dict(zip(starting.moves, found[len(found) - len(starting.moves) :], strict=True))


def _begun(
    layout: JacobianLayout,
    instance: Instance,
    first: Mapping[str, float],
    h: float,
    start: Start,
    own: Collection[str],
) -> tuple[Struct[Program], Array]:
    """The layout's program with its numbers, and derivatives of the states at the first sample.

    `own` are paths of states that the run starts from as its own unknowns: nothing else moves them.
    """
    structure, slopes = layout.structure, dict[Moved, float]()
    if layout.columns:
        slopes = _slopes(structure, instance, first, h, start)
    tangent = np.zeros(layout.tangents)
    for (state, column), at in layout.places.items():
        if f"{structure.model.prefix(state.part)}{state.path}" in own:
            tangent[at] = state.path in started_by(structure.model, state.part, column)
        else:
            tangent[at] = slopes.get((state, column), 0.0)
    places, scale = instance.places(structure.signals, h), layout.program.scale.copy()
    for at, slot in layout.slots:
        is_tap = slot[0].kind == "fraction"
        scale[at] *= places.slope[int(slot[0].path)] if is_tap else slopes[slot]
    return Struct(layout.program._replace(scale=scale)), tangent


@generating
def _at_rest(
    layout: JacobianLayout, instance: Instance, h: float, own: tuple[str, ...]
) -> tuple[Struct[Program], Array]:
    """Those of a start at rest, which depends on no record."""
    return _begun(layout, instance, {}, h, "rest", own)


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


NOTHING_OWN = RunValues()


def residuals(instance: Instance, observed: ObservedRecord, own: RunValues = NOTHING_OWN) -> Array:
    """(m,) weighted residuals of all observations, one after the other, 0 where the weight is.

    Of each weight · (simulated + offset - measured) in its signal's SI unit; `own` are values of
    the experiment's own unknowns.
    """
    rows = np.empty((1, observed.rows))
    _march(instance, observed, own, (), (), rows, 0)
    return np.asarray(rows[0])


def jacobian(
    instance: Instance,
    observed: ObservedRecord,
    columns: Sequence[str],
    own: RunValues = NOTHING_OWN,
    *,
    moved: Sequence[bool] | None = None,
    out: Array | None = None,
) -> Jacobian:
    """The same residuals with their exact derivatives by columns.

    Columns are paths of parameters, and ``start.`` with the path of a state; `moved` says whether
    the record may depend on each at all: the others give zeros. `out` is (k + 1, m) memory to write
    to, the `rows` of an earlier call for example: new memory takes longer to get than the march.
    """
    to = np.flatnonzero(np.ones(len(columns)) if moved is None else moved)
    names = (*columns, *observed.own_columns)
    shape = (len(names) + 1, observed.rows)
    if out is None:
        out = np.empty(shape)
    elif out.shape != shape or out.dtype != np.float64 or not out.flags.carray:
        raise InputError(f"out must be a plain array of floats of shape {shape}.")
    for c in set(range(len(columns))).difference(to):
        out[c] = 0.0
    _march(instance, observed, own, [columns[c] for c in to.tolist()], to, out, len(columns))
    return Jacobian(names, out)


def triangle(
    instance: Instance,
    observed: ObservedRecord,
    columns: Sequence[str],
    own: RunValues = NOTHING_OWN,
    *,
    moved: Sequence[bool] | None = None,
) -> Triangle:
    """Triangular factor of [J r]; arguments as in `jacobian`, which is never held.

    Memory does not grow with the record, apart from the record and the observations themselves.
    """
    to = np.flatnonzero(np.ones(len(columns)) if moved is None else moved)
    names = (*columns, *observed.own_columns)
    places = np.concatenate([to, np.arange(len(columns), len(names) + 1)])
    rows, some = aligned(places.size, ROWS), np.zeros((places.size, places.size))
    asked = [columns[c] for c in to.tolist()]
    _march(instance, observed, own, asked, range(to.size), rows, to.size, some)
    factor = np.zeros((len(names) + 1, len(names) + 1))
    factor[np.ix_(places, places)] = upright(some)
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
    own: RunValues,
    columns: Sequence[str],
    to: ArrayLike,
    rows: Array,
    before: int,
    factor: Array = NO_FACTOR,
) -> None:
    """March, and fill rows, or fold them into a `factor`.

    `to` are the places of the columns' rows; those of free offsets are behind the first `before`.
    """
    records, h, start = observed.records, observed.record.step, observed.start
    signals, seen = tuple(records), tuple(dict.fromkeys(o.signal for o in observed.observations))
    missing = [c for c in columns if c.startswith("start.") and c[6:] not in own.start]
    if missing:
        raise InputError(f"{missing[0]} is a column, so RunValues needs a value of it.")
    structure = structure_of(instance.model, signals, instance.options, seen)
    plan, offsets = observed.plan, observed.offsets(own.offsets)
    numbers = tuple(seen.index(each.signal) for each in observed.observations)
    layout = layout_of(structure, tuple(columns), numbers, start)
    first = {name: float(values[0]) for name, values in records.items()}
    started = instance.start(first, h, start)
    states, places = begun(instance, started, own.start), instance.places(signals, h)
    if start == "rest":
        program, tangent = _at_rest(layout, instance, h, tuple(own.start))
    else:
        program, tangent = _begun(layout, instance, first, h, start, own.start)
    fields = Sink(
        columns=len(rows),
        length=rows.shape[1],
        rows=rows,
        derived=len(columns),
        to=np.array(to, dtype=np.int64),
        own=before,
        folded=int(factor.size > 0),
        factor=factor,
        offset=offsets,
        offset_row=observed.offset_rows(before),
    )
    sink, room = Struct(fields), layout.taken()
    room.fields.tangent[:] = tangent
    room.fields.integrals[:] = 0.0
    room.fields.progress[:] = plan.fields.first[:-1]
    values, met = tuple(records.values()), np.array([np.inf])
    arrays = arrays_of(instance, values, started, places, states, met, room.fields.block)
    pieces = addresses(structure.facts.pieces, layout.pieces)
    structs = march_of(program, plan, sink, room)
    march = compiled_march()
    march(pieces, pointers(arrays), values[0].size, h, structs.address)
    layout.give_back(room)
    check_domain(instance, states, float(met[0]), observed.driven_by)


# --- a model with numbers, differentiated ---------------------------------------------------------


class BoundModel(NamedTuple):
    """A model with numbers, and what it is differentiated by."""

    instance: Instance
    own: RunValues = NOTHING_OWN
    """Values of the experiment's own unknowns."""
    paths: Sequence[str] = ()
    """Columns of derivatives."""
    moved: Sequence[bool] | None = None
    """Whether the record may depend on each column at all; by default it may."""

    def residuals(self, observed: ObservedRecord) -> Array:
        """(m,) weighted residuals of all observations; see `residuals`."""
        return residuals(self.instance, observed, self.own)

    def jacobian(self, observed: ObservedRecord, out: Array | None = None) -> Jacobian:
        """The same residuals with their exact derivatives; see `jacobian`."""
        return jacobian(self.instance, observed, self.paths, self.own, moved=self.moved, out=out)

    def triangle(self, observed: ObservedRecord) -> Triangle:
        """Triangular factor of [J r]; see `triangle`."""
        return triangle(self.instance, observed, self.paths, self.own, moved=self.moved)
