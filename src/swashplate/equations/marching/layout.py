"""What is done in every block of a Jacobian: rows that are made, recurrences, where results go."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from swashplate.equations.code import generating
from swashplate.equations.marching.graph import PAIR, By, Entry, Graph, Group, PartGraph
from swashplate.equations.marching.rows import (
    ABREAST,
    ADD,
    CALL,
    CARRIED,
    CHAIN,
    COMBINE,
    DONE,
    FOLLOW,
    OUTWARDS,
    RECUR,
    SET,
    STRIDE,
    Indices,
    Program,
    Terms,
)
from swashplate.equations.model import Model


class Slot(NamedTuple):
    """A factor that is known only with the parameters: by a constant, or by a tap's delay."""

    kind: str
    part: int
    first: str
    second: str = ""


class Term(NamedTuple):
    """A product of one or two rows and a number."""

    a: int
    b: int
    scale: float
    slot: Slot | None = None


class Reference(NamedTuple):
    """A row that holds a derivative, but for a factor."""

    row: int
    scale: float


@dataclass(frozen=True, eq=False)
class Layout:
    """A program without the numbers that depend on parameters, and the memory it needs."""

    program: Program
    way: Indices  # (r, d) see `Plan.way`.
    pieces: frozenset[int]  # Numbers of the pieces that are called.
    slots: tuple[tuple[int, Slot], ...]  # Terms with a factor of this kind.
    rows: int
    constant: Mapping[int, float]  # Rows that hold just one value.
    tangents: int  # Numbers in the vector of tangents.
    columns: Mapping[str, int]  # Number of each column by its path.
    places: Mapping[tuple[int, str], Mapping[int, int]]
    """Place of a tangent by part and state, and by the number of the column."""


@generating
def layout_of(
    graph: Any,
    model: Model,
    columns: tuple[str, ...],
    observed: tuple[int, ...],
    whole: tuple[bool, ...],
) -> Layout:
    """What to do in every block for some columns: paths of parameters, and ``start.`` of a state.

    `observed` says for each observation which of the graph's observed signals it is, and `whole`
    whether it sees every sample of the record, and all of its rows are kept.
    """
    return _Planner(graph, model, columns).layout(observed, whole)


class _Chain(NamedTuple):
    """A recurrence of one state."""

    todo: tuple[int, int, int, int]
    factor: int  # Place of what a step leaves of it.
    columns: list[tuple[int, int, int, int]]
    """Of each column its number, the rows of input and result, and its place among the tangents."""


class _Planner:
    def __init__(self, graph: Graph, model: Model, columns: tuple[str, ...]) -> None:
        self.graph, self.model, self.columns = graph, model, columns
        self.rows = graph.rows
        self.constant: dict[float, int] = {}
        self.idle = self._row()
        self.tangents = 1  # the first belongs to idle columns
        self.places: dict[tuple[int, str], dict[int, int]] = {}
        self.references: dict[tuple[str, int, str], dict[int, Reference]] = {}
        self.made: list[tuple[int, list[Term]]] = []  # Rows that are sums of terms.
        self.todo: list[tuple[int, int, int, int]] = []
        self.chains: list[_Chain] = []
        self.columns_of: list[Indices] = [np.zeros(0, dtype=np.int64)]
        self.linked = set(graph.sources)

    def layout(self, observed: tuple[int, ...], whole: tuple[bool, ...]) -> Layout:
        pieces = [0]
        for part in self.graph.parts:
            filled = self.columns and any(each.signals for each in part.components)
            pieces += [] if filled else [part.value_piece]
        self.todo += [(CALL, each, 0, 0) for each in pieces if each >= 0]
        for part in self.graph.parts if self.columns else ():
            by_result = _by_result(part)
            for component in part.components:
                at = len(self.todo)
                early = component.signals
                some = [self._group(part, group, by_result, early) for group in component.groups]
                if (any(some) or component.signals) and component.piece >= 0:
                    self.todo.insert(at, (CALL, component.piece, 0, 0))
            if part.signal_piece >= 0:
                self.todo.append((CALL, part.signal_piece, 0, 0))
            self._signals(part, by_result)
        shown = {
            (r, c): self._observed(number, c)
            for r, number in enumerate(observed)
            for c in range(len(self.columns))
        }
        way = self._outwards(shown, whole)
        seen, width = len(self.made), len(self.columns) + 2
        self.made += [(r * width + c, terms) for (r, c), terms in shown.items()]
        terms = [term for _, made in self.made for term in made]
        program = Program(
            len(self.columns),
            np.array(self.todo, dtype=np.int64),
            Terms(
                np.array([target for target, _ in self.made], dtype=np.int64) * STRIDE
                + np.where(np.arange(len(self.made)) < seen, 0, CARRIED),
                np.cumsum([0, *(len(made) for _, made in self.made)]).astype(np.int64),
                np.array([term.a for term in terms], dtype=np.int64) * STRIDE,
                np.array([term.b for term in terms], dtype=np.int64) * STRIDE,
                np.array([term.scale for term in terms], dtype=np.float64),
            ),
            seen,
            np.concatenate(self.columns_of),
            np.array([self._value_row(number) for number in observed], dtype=np.int64),
            np.array([self.graph.observed[number][1] for number in observed], dtype=np.bool_),
        )
        return Layout(
            program,
            way,
            frozenset(todo[1] for todo in self.todo if todo[0] in (CALL, CHAIN)),
            tuple((k, term.slot) for k, term in enumerate(terms) if term.slot is not None),
            self.rows,
            {row: value for value, row in self.constant.items()},
            self.tangents,
            {column: c for c, column in enumerate(self.columns)},
            self.places,
        )

    def _constant(self, value: float) -> int:
        """Row that holds just this value."""
        if value not in self.constant:
            self.constant[value] = self._row()
        return self.constant[value]

    def _combine(self, since: int) -> None:
        """Have the rows made that are new since then."""
        if len(self.made) > since:
            self.todo.append((COMBINE, since, len(self.made), 0))

    def _row(self) -> int:
        self.rows += 1
        return self.rows - 1

    def _terms(
        self, part: PartGraph, entries: Mapping[By, Entry], c: int, within: Sequence[str] = ()
    ) -> Iterator[Term]:
        """What moves a result with a column, apart from the states of its own group."""
        prefix, column = self.model.prefix(part.part), self.columns[c]
        name = column.removeprefix(prefix) if column.startswith(prefix) else ""
        for by, entry in entries.items():
            constant = entry.row < 0
            row, scale = (self._constant(1.0), entry.value) if constant else (entry.row, 1.0)
            if by.kind == "p":
                if by.path == name:
                    yield Term(row, -1, scale)
            elif by.kind == "k":
                if (by.path, name) in part.constants:
                    yield Term(row, -1, scale, Slot("k", part.part, by.path, name))
            elif by.kind == "tap":
                if part.delays[int(by.path)] == name:
                    yield Term(row, -1, scale, Slot("tap", part.part, by.path))
            elif by.kind == "signal":
                yield from self._through(entry, ("signal", by.part, by.path), c)
            elif by.path not in within:
                yield from self._through(entry, ("state", part.part, by.path), c)

    def _through(self, entry: Entry, node: tuple[str, int, str], c: int) -> Iterator[Term]:
        """A known derivative, multiplied by a partial one."""
        found = self.references.get(node, {}).get(c)
        if found is None:
            return
        if entry.row < 0:
            yield Term(found.row, -1, entry.value * found.scale)
        else:
            yield Term(entry.row, found.row, found.scale)

    def _made(self, terms: list[Term], whole: bool = False) -> Reference | None:
        """Row that holds a sum of terms: one that is there already, or a new one.

        With `whole` the row needs no factor any more.
        """
        if not terms:
            return None
        only = terms[0]
        alone = len(terms) == 1 and only.b < 0 and only.slot is None
        if alone and (not whole or only.scale == 1.0):
            return Reference(only.a, only.scale)
        row = self._row()
        self.made.append((row, terms))
        return Reference(row, 1.0)

    def _group(
        self,
        part: PartGraph,
        group: Group,
        by_result: Mapping[str, Mapping[By, Entry]],
        early: bool,
    ) -> bool:
        """Columns of a recurrence, and rows that they need.

        `early` says whether the derivatives of signals are there before it.
        """
        since, whose = len(self.made), list[int]()
        found: list[list[tuple[int, int, int]]] = []
        prefix = self.model.prefix(part.part)
        for c, column in enumerate(self.columns):
            terms = [
                list(self._terms(part, by_result.get(f"state.{path}", {}), c, group.states))
                for path in group.states
            ]
            own = column.removeprefix(prefix) if column.startswith(prefix) else ""
            starts = any(
                path in started_by(self.model, part.part, column) or (path, own) in part.started
                for path in group.states
            )
            if not (any(terms) or starts):
                continue
            each = []
            for i, path in enumerate(group.states):
                result = self._row() if group.stored[i] else self.idle
                made = self._made(terms[i], whole=True)
                place = self.tangents
                self.tangents += 1
                self.places.setdefault((part.part, path), {})[c] = place
                each.append((made.row if made else self._constant(0.0), result, place))
                if group.stored[i]:
                    rows = self.references.setdefault(("state", part.part, path), {})
                    rows[c] = Reference(result, 1.0)
            found.append(each)
            whose.append(c)
        if not found:
            return False
        k, generated = len(group.states), group.piece >= 0
        abreast = PAIR if generated else ABREAST
        found += [[(self._constant(0.0), self.idle, 0)] * k] * (-len(found) % abreast)
        states = group.states
        numbers = [len(found)]
        if not generated:
            entry = by_result.get(f"state.{states[0]}", {}).get(By("state", states[0]), Entry(-1))
            row = entry.row if entry.row >= 0 else self._constant(entry.value)
            numbers = [row * STRIDE]
        for i, after in enumerate(group.after):
            numbers += [each[i][0] * STRIDE for each in found]
            numbers += [each[i][1] * STRIDE for each in found]
            numbers += [each[i][2] for each in found]
            numbers += [] if generated else [int(after) for _ in found]
        begin = sum(each.size for each in self.columns_of)
        self.columns_of.append(np.array(numbers, dtype=np.int64))
        self._combine(since)
        if generated:
            self.todo.append((CHAIN, group.piece, begin, begin + len(numbers)))
        else:
            self.todo.append((RECUR, 0, begin, begin + len(numbers)))
        if k == 1 and early and not group.after[0]:
            columns = [(c, *each[0]) for c, each in zip(whose, found, strict=False)]
            self.chains.append(_Chain(self.todo[-1], numbers[0], columns))
        return True

    def _outwards(self, shown: dict[tuple[int, int], list[Term]], whole: Sequence[bool]) -> Indices:
        """Let recurrences whose results one observation alone needs go there at once."""
        way = np.full((len(whole), len(self.columns)), SET)
        uses: dict[int, list[tuple[int, int, Term | None]]] = {}
        for terms in (terms for _, terms in self.made):
            for row in (row for term in terms for row in (term.a, term.b)):
                uses.setdefault(row, []).append((-1, -1, None))
        for (r, c), terms in shown.items():
            for term in terms:
                for row in {term.a, term.b}:
                    uses.setdefault(row, []).append((r, c, term))
        for chain in self.chains:
            found = [uses.get(result, [])[:2] for _, _, result, _ in chain.columns]
            if any(len(each) != 1 for each in found):
                continue
            users = [each[0] for each in found]
            r, _, first = users[0]
            # the same factor times the result, all of them in one observation
            wanted = [
                (r, None if first is None else Term(first.a, result, 1.0))
                for _, _, result, _ in chain.columns
            ]
            if first is None or not whole[r] or [(user, t) for user, _, t in users] != wanted:
                continue
            self._follow(chain, r, first.a)
            for _, c, used in users:
                shown[r, c] = [each for each in shown[r, c] if each is not used]
                way[r, c] = ADD if shown[r, c] else DONE
                if not shown[r, c]:
                    del shown[r, c]
        return way

    def _follow(self, chain: _Chain, r: int, through: int) -> None:
        """Put a recurrence that ends in an observation in the place of one that ends in rows."""
        since, numbers = len(self.made), [through * STRIDE, chain.factor]
        for some in _abreast(sorted(chain.columns, key=lambda each: each[1])):
            rows = [row for _, row, _, _ in some]
            if rows != list(range(rows[0], rows[0] + OUTWARDS)):
                rows = [self._row() for _ in some]
                pairs = zip(rows, some, strict=True)
                self.made += [(to, [Term(row, -1, 1.0)]) for to, (_, row, _, _) in pairs]
            numbers += [rows[0] * STRIDE, *(at for *_, at in some), *(c for c, *_ in some)]
        begin = sum(each.size for each in self.columns_of)
        self.columns_of.append(np.array(numbers, dtype=np.int64))
        at = self.todo.index(chain.todo)
        self.todo[at : at + 1] = [
            (COMBINE, since, len(self.made), 0),
            (FOLLOW, r, begin, begin + len(numbers)),
        ]

    def _signals(self, part: PartGraph, by_result: Mapping[str, Mapping[By, Entry]]) -> None:
        """Derivatives of the signals of a part that others need."""
        since = len(self.made)
        for signal, path in part.aliases.items():
            rows = self.references.get(("state", part.part, path), {})
            self.references["signal", part.part, signal] = rows
        for source in self.linked:
            node = ("signal", source.part, source.signal)
            if source.part != part.part or node in self.references:
                continue
            entries = by_result.get(f"signals.{source.signal}")
            if entries is None:
                rows = self.references.get(("state", source.part, source.signal), {})
                self.references[node] = rows
                continue
            found = self.references.setdefault(node, {})
            for c in range(len(self.columns)):
                made = self._made(list(self._terms(part, entries, c)))
                if made is not None:
                    found[c] = made
        self._combine(since)

    def _observed(self, number: int, c: int) -> list[Term]:
        """What an observed signal's derivative by a column is."""
        place, _ = self.graph.observed[number]
        if place.kind == "link":
            terms = []
            for source in self.model.links[place.path].sources:
                known = self.references.get(("signal", *source), {}).get(c)
                factor = self.graph.links[place.path].get(source.signal, 0.0)
                if known is not None and factor != 0.0:
                    terms.append(Term(known.row, -1, factor * known.scale))
            return terms
        kind = "state" if place.kind == "state" else "signal"
        node = (kind, place.part, place.path)
        if node in self.references:
            known = self.references[node].get(c)
            return [] if known is None else [Term(known.row, -1, known.scale)]
        part = next(each for each in self.graph.parts if each.part == place.part)
        return list(self._terms(part, _by_result(part).get(f"signals.{place.path}", {}), c))

    def _value_row(self, number: int) -> int:
        place, _ = self.graph.observed[number]
        if place in self.graph.stored:
            return self.graph.stored[place]
        return self.graph.values[place.part, place.path]


def _abreast(columns: list[tuple[int, int, int, int]]) -> Iterator[list[tuple[int, int, int, int]]]:
    """Columns by OUTWARDS: first those whose inputs lie in neighbouring rows, which stay there."""
    rest, k = [], 0
    while k < len(columns):
        some = columns[k : k + OUTWARDS]
        if some[-1][1] - some[0][1] == OUTWARDS - 1 == len(some) - 1:
            yield some
            k += OUTWARDS
        else:
            rest.append(columns[k])
            k += 1
    for k in range(0, len(rest), OUTWARDS):
        some = rest[k : k + OUTWARDS]
        yield some + some[-1:] * (OUTWARDS - len(some))


def _by_result(part: PartGraph) -> dict[str, dict[By, Entry]]:
    found: dict[str, dict[By, Entry]] = {}
    for (out, by), entry in part.entries.items():
        found.setdefault(out, {})[by] = entry
    return found


def started_by(model: Model, part: int, column: str) -> tuple[str, ...]:
    """Paths of a part's states that a column such as ``start.pump.pressure`` sets."""
    prefix = f"start.{model.prefix(part)}"
    if not column.startswith(prefix):
        return ()
    name = column.removeprefix(prefix)
    return model.parts[part].free_start.get(name, (name,))
