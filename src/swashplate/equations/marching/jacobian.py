"""Residuals of what was observed, their Jacobian and its triangular factor, for any model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.equations.code import generating, leaves
from swashplate.equations.fields import value_at
from swashplate.equations.marching.graph import Graph, graph_of
from swashplate.equations.marching.layout import Layout, Slot, layout_of, started_by
from swashplate.equations.marching.observation import ObservedRecord, Own
from swashplate.equations.marching.pieces import addresses
from swashplate.equations.marching.rows import (
    BLOCK,
    Plan,
    Program,
    Sink,
    march_observed,
    room_for,
    rooms,
)
from swashplate.equations.marching.run import (
    Instance,
    Places,
    Start,
    arrays_of,
    begun,
    check_domain,
)
from swashplate.equations.marching.triangle import ROWS, aligned, upright
from swashplate.equations.model import Model, Source
from swashplate.errors import DomainError, InputError

Array = NDArray[np.float64]


# --- numbers --------------------------------------------------------------------------------------


Slopes = dict[str, float]
"""Derivatives by the paths of columns."""


class StartSlopes(NamedTuple):
    """Derivatives at the start, of all parts."""

    constants: dict[Slot, float]  # Of constants by parameters.
    states: dict[tuple[int, str], Slopes]  # Of states by parameters, by part and path.


@generating
def rest_slopes(graph: Graph, instance: Instance, h: float) -> StartSlopes:
    """Derivatives of a start at rest, which depends on no record."""
    return start_slopes(graph, instance, dict.fromkeys(graph.signals, 0.0), h, "rest")


def start_slopes(
    graph: Graph, instance: Instance, first: Mapping[str, float], h: float, start: Start
) -> StartSlopes:
    """Derivatives of the state at the start by all parameters, at signals as they were before."""
    model = instance.model
    constants: dict[Slot, float] = {}
    states: dict[tuple[int, str], Slopes] = {}
    signals: dict[tuple[int, str], tuple[float, Slopes]] = {}
    for code, starts in zip(graph.codes, graph.starts, strict=True):
        i, own = code.part, instance.parts[code.part]
        values: dict[str, float] = {"h": h}
        values |= {node.value: value_at(own.p, path) for path, node in leaves(code.p)}
        values |= {node.value: value_at(own.given, path) for path, node in leaves(code.given)}
        for tap in code.taps:
            values |= dict.fromkeys(code.tap_samples(tap), first.get(tap.tap.signal, 0.0))
            values[code.fraction(tap)] = 0.0
        values |= {f"x_{name}": value for name, value in first.items()}
        for (part, name), (value, _) in signals.items():
            values[code.source(Source(part, name))] = value
        starting = starts.get(start, starts["rest"])  # what has no state is always settled
        found = starting.derived.python(*(values[name] for name in starting.arguments))
        made: dict[tuple[str, str], Slopes] = {key: {} for key in starting.results}
        partials = found[len(starting.results) :]
        for (key, by), slope in zip(starting.entries(), partials, strict=True):
            if key[0] == "k":
                constants[Slot("k", i, key[1], by.path)] = slope
                continue
            own_column = {f"{model.prefix(i)}{by.path}": 1.0}
            inner = own_column if by.kind == "p" else signals[by.part, by.path][1]
            for column, factor in inner.items():
                made[key][column] = made[key].get(column, 0.0) + slope * factor
        for ((kind, name), slopes), value in zip(made.items(), found, strict=False):
            if kind == "state":
                states[i, name] = slopes
            elif kind == "signal":
                signals[i, name] = value, slopes
    return StartSlopes(constants, states)


def tangents_of(
    layout: Layout, slopes: StartSlopes, model: Model, columns: Sequence[str], own: Iterable[str]
) -> Array:
    """Derivatives of the states at the first sample, in their places.

    `own` are paths of states that the run starts from as its own unknowns: nothing else moves them.
    """
    tangent = np.zeros(layout.tangents)
    free = set(own)
    for (part, path), found in layout.places.items():
        if f"{model.prefix(part)}{path}" in free:
            for c, at in found.items():
                tangent[at] = 1.0 if path in started_by(model, part, columns[c]) else 0.0
        else:
            known = slopes.states.get((part, path), {})
            for column in known.keys() & layout.columns.keys():
                at = found.get(layout.columns[column], 0)
                tangent[at] = known[column] if at else 0.0
    return tangent


# --- what a fit asks for --------------------------------------------------------------------------


class Jacobian(NamedTuple):
    """Weighted residuals and their derivatives."""

    names: tuple[str, ...]
    """Columns: those asked for, then the observations' own unknowns."""
    rows: Array
    """(k + 1, m): the columns one after the other, each over all m samples, residuals last."""
    squares: Array
    """Sum of squared residuals of each observation."""

    @property
    def columns(self) -> Array:
        """(m, k) derivatives of the residuals, a view. [weighted signal/...]"""
        return np.asarray(self.rows[:-1].T)

    @property
    def residuals(self) -> Array:
        """(m,) weight · (simulated - measured), a view."""
        return np.asarray(self.rows[-1])


class Triangle(NamedTuple):
    """The same problem in k + 1 rows."""

    names: tuple[str, ...]
    """Columns, as in `Jacobian`."""
    factor: Array
    """(k + 1, k + 1) upper triangle R of [J r], with RᵀR = [J r]ᵀ[J r]; no diagonal element is
    negative."""
    squares: Array
    """Sum of squared residuals of each observation."""


NOTHING_OWN = Own()


def residuals(
    instance: Instance, observed: ObservedRecord, own: Own = NOTHING_OWN, *, block: int = BLOCK
) -> Array:
    """(m,) weighted residuals of all observations, one after the other, 0 where the weight is.

    Of each weight · (simulated - measured) in its signal's SI unit; `own` are values of the
    experiment's own unknowns, `block` the samples marched at a time, 2 to 512.

    Raises
    ------
    DomainError
        If the model leaves its domain.
    InputError
        If the own unknowns do not fit.
    """
    sink = _all_rows(np.empty((1, observed.rows)), 0, (), observed)
    _march(instance, observed, own, (), sink, block)
    return np.asarray(sink.rows[0])


def jacobian(
    instance: Instance,
    observed: ObservedRecord,
    columns: Sequence[str],
    own: Own = NOTHING_OWN,
    *,
    moved: Sequence[bool] | None = None,
    out: Array | None = None,
    block: int = BLOCK,
) -> Jacobian:
    """The same residuals with their exact derivatives.

    Parameters
    ----------
    instance, observed, own, block :
        As in `residuals`.
    columns : sequence of str
        Paths of parameters, and ``start.`` with the path of a state.
    moved : sequence of bool, optional
        Whether the record may depend on a column at all; the others give zeros.
    out : (k + 1, m) array, optional
        Where to write; the `rows` of an earlier call, for example. New memory takes longer to get
        than the whole march.
    """
    count = len(columns)
    places = np.flatnonzero(np.ones(count, dtype=bool) if moved is None else np.asarray(moved))
    k = count + len(observed.own_columns)
    shape = (k + 1, observed.rows)
    if out is None:
        out = np.empty(shape)
    elif out.shape != shape or out.dtype != np.float64 or not out.flags.carray:
        raise InputError(f"out must be a plain array of floats of shape {shape}.")
    if places.size < count:
        out[:count][~np.isin(np.arange(count), places)] = 0.0
    sink = _all_rows(out, count, places, observed)
    moving = tuple(columns[c] for c in places.tolist())
    _march(instance, observed, own, moving, sink, block, count)
    return Jacobian((*columns, *observed.own_columns), out, sink.squares)


def triangle(
    instance: Instance,
    observed: ObservedRecord,
    columns: Sequence[str],
    own: Own = NOTHING_OWN,
    *,
    moved: Sequence[bool] | None = None,
    block: int = BLOCK,
) -> Triangle:
    """Triangular factor of [J r]; arguments as in `jacobian`, which is never held.

    Memory does not grow with the record, apart from the record and the observations themselves.

    Raises
    ------
    DomainError
        Also if a derivative is so large that its square overflows.
    """
    count = len(columns)
    to = np.flatnonzero(np.ones(count, dtype=bool) if moved is None else np.asarray(moved))
    derived, own_count = to.size, len(observed.own_columns)
    size = derived + own_count + 1
    sink = Sink(
        rows=aligned(size, ROWS),
        to=np.arange(derived),
        own=derived + np.arange(own_count),
        factor=np.zeros((size, size)),
        squares=np.zeros(len(observed.observations)),
    )
    _march(instance, observed, own, tuple(columns[int(c)] for c in to), sink, block)
    names = (*columns, *observed.own_columns)
    places = np.concatenate([to, np.arange(count, len(names) + 1)])
    factor = np.zeros((len(names) + 1, len(names) + 1))
    factor[np.ix_(places, places)] = sink.factor
    if not np.isfinite(factor).all():
        overflown = np.asarray(~np.isfinite(factor)).any(axis=0)
        bad = [*names, "the residuals"][int(np.argmax(overflown))]
        raise DomainError(
            f"{instance.name}: {bad}: the derivatives are too large for a least-squares problem; "
            "check the size of the parameters and weights."
        )
    return Triangle(names, upright(factor), sink.squares)


def _all_rows(rows: Array, count: int, to: ArrayLike, observed: ObservedRecord) -> Sink:
    """A sink that keeps all rows."""
    return Sink(
        rows=rows,
        to=np.asarray(to, dtype=np.int64),
        own=np.arange(count, rows.shape[0] - 1),
        factor=np.zeros((0, 0)),
        squares=np.zeros(len(observed.observations)),
    )


def _march(
    instance: Instance,
    observed: ObservedRecord,
    own: Own,
    columns: tuple[str, ...],
    sink: Sink,
    block: int,
    first_own: int | None = None,
) -> None:
    """March, and fill the sink."""
    if not 2 <= block <= BLOCK:
        raise InputError(f"block is {block}, but must be 2 to {BLOCK} samples.")
    records, h = observed.records, observed.record.step
    signals, seen = tuple(records), tuple(dict.fromkeys(o.signal for o in observed.observations))
    graph = graph_of(instance.model, signals, instance.options, seen)
    plan = observed.plan(own, len(columns) if first_own is None else first_own)
    numbers = tuple(seen.index(each.signal) for each in observed.observations)
    whole = _whole(graph, plan, numbers, observed, sink)
    layout = layout_of(graph, instance.model, columns, numbers, whole)
    first = {name: float(values[0]) for name, values in records.items()}
    started = instance.start(first, h, observed.start)
    missing = [c for c in columns if c.startswith("start.") and c[6:] not in own.start]
    if missing:
        raise InputError(f"{missing[0]} is a column, so Own needs a value of it.")
    states = begun(instance, started, own.start)
    if observed.start == "rest":
        slopes = rest_slopes(graph, instance, h)
    else:
        slopes = start_slopes(graph, instance, first, h, observed.start)
    tangent = tangents_of(layout, slopes, instance.model, columns, own.start)
    places = instance.places(signals, h)
    plan = plan._replace(way=layout.way)
    program = _with_numbers(layout, slopes.constants, places)
    marched = tuple(np.ascontiguousarray(each, dtype=np.float64) for each in records.values())
    met = np.array([np.inf])
    spare = rooms(layout.rows, tuple(layout.constant.items()), len(columns), plan.kept.shape)
    room = room_for(spare, layout, len(columns), plan)
    arrays = arrays_of(instance, marched, started, places, states, met, room.flat)
    pieces, grid = addresses(graph.pieces, layout.pieces), (marched[0].size, block, h)
    march_observed(pieces, arrays, grid, tangent, program, plan, sink, room)
    check_domain(instance, states, float(met[0]), observed.driven_by)
    spare.append(room)


def _whole(
    graph: Graph, plan: Plan, numbers: Sequence[int], observed: ObservedRecord, sink: Sink
) -> tuple[bool, ...]:
    """Which observations see every sample of the record as it is, if all rows are kept."""
    return tuple(
        not sink.factor.size
        and bool(plan.regular[r])
        and plan.clock_column[r] < 0
        and not plan.kept[r].any()
        and not graph.observed[number][1]
        and plan.first[r + 1] - plan.first[r] == observed.record.values.size
        for r, number in enumerate(numbers)
    )


def _with_numbers(layout: Layout, constants: Mapping[Slot, float], places: Places) -> Program:
    """The program with the factors that depend on parameters."""
    program = layout.program
    if not layout.slots:
        return program
    scale = program.terms.scale.copy()
    for at, slot in layout.slots:
        tap = slot.kind == "tap"
        scale[at] *= places.slope[int(slot.first)] if tap else constants[slot]
    return program._replace(terms=program.terms._replace(scale=scale))
