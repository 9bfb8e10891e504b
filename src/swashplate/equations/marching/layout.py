"""What is done in every block of a Jacobian: rows that are made, recurrences, where results go."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from swashplate.equations.code import generating
from swashplate.equations.marching.graph import PAIR, By, Entry, Graph, Group, Known, PartGraph
from swashplate.equations.marching.rows import (
    ABREAST,
    CALL,
    CARRIED,
    CHAIN,
    COMBINE,
    RECUR,
    STRIDE,
    Program,
    Terms,
)
from swashplate.equations.model import Model

Slot = tuple[Known, str] | int
"""A factor known only with the parameters: a constant by a column, a tap's place by its delay."""


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


Node = tuple[str, int, str]
"""A signal or state of a part: kind, number of the part, path."""


class Layout:
    """A program without the numbers that depend on parameters, and the memory it needs.

    Attributes
    ----------
    program : Program
    pieces : frozenset of int
        Numbers of the pieces that are called.
    slots : list of (int, Slot)
        Terms with a factor of this kind.
    rows : int
    constant : dict of float to int
        Rows that hold just one value.
    tangents : int
        Numbers in the vector of tangents; the first belongs to idle columns.
    places : dict of (int, str) to dict of int to int
        Place of a tangent by part and state, and by the number of the column.
    """

    def __init__(
        self, graph: Graph, columns: tuple[str, ...], observed: tuple[int, ...], start: str
    ) -> None:
        self.graph, self.model, self.columns = graph, graph.model, columns
        derived = graph.starting(start).moves if columns else ()
        self._starts = {(*known[1:], by) for known, by in derived if known[0] == "state"}
        self._moved = {each for each in derived if each[0][0] == "k"}
        self.rows, self.tangents = graph.rows, 1
        self.constant: dict[float, int] = {}
        self._idle = self._row()
        self.places: dict[tuple[int, str], dict[int, int]] = {}
        self._references: dict[Node, dict[int, Reference]] = {}
        self._made: list[tuple[int, list[Term]]] = []  # Rows that are sums of terms.
        self._todo: list[tuple[int, int, int, int]] = [(CALL, 0, 0, 0)]
        self._numbers: list[int] = []
        for part in graph.parts:
            self._part(part)
        seen, width = len(self._made), len(columns) + 2
        self._made += [
            (r * width + c, self._observed(number, c))
            for r, number in enumerate(observed)
            for c in range(len(columns))
        ]
        terms = [term for _, made in self._made for term in made]
        targets = np.array([target for target, _ in self._made], dtype=np.int64) * STRIDE
        targets[seen:] += CARRIED
        self.program = Program(
            len(columns),
            np.array(self._todo, dtype=np.int64),
            Terms(
                targets,
                np.cumsum([0, *(len(made) for _, made in self._made)]).astype(np.int64),
                np.array([term.a for term in terms], dtype=np.int64) * STRIDE,
                np.array([term.b for term in terms], dtype=np.int64) * STRIDE,
                np.array([term.scale for term in terms], dtype=np.float64),
            ),
            seen,
            np.array(self._numbers, dtype=np.int64),
            np.array([self._value_row(number) for number in observed], dtype=np.int64),
            np.array([graph.observed[number][1] for number in observed], dtype=np.bool_),
        )
        self.pieces = frozenset(todo[1] for todo in self._todo if todo[0] in (CALL, CHAIN))
        self.slots = [(k, term.slot) for k, term in enumerate(terms) if term.slot is not None]

    def _row(self) -> int:
        self.rows += 1
        return self.rows - 1

    def _constant(self, value: float) -> int:
        """Row that holds just this value."""
        if value not in self.constant:
            self.constant[value] = self._row()
        return self.constant[value]

    def _combine(self, since: int) -> None:
        """Have the rows made that are new since then."""
        if len(self._made) > since:
            self._todo.append((COMBINE, since, len(self._made), 0))

    def _part(self, part: PartGraph) -> None:
        """What is done for a part: its pieces, its recurrences, and the signals others need."""
        at = len(self._todo)
        moves = [self._group(part, group) for group in part.groups]
        signals = bool(self.columns) and any(each.startswith("signals.") for each in part.entries)
        piece = part.fill if any(moves) or signals else part.signals
        if piece >= 0:
            self._todo.insert(at, (CALL, piece, 0, 0))
        if self.columns:
            self._signals(part)

    def _terms(
        self, part: PartGraph, result: str, c: int, within: Sequence[str] = ()
    ) -> Iterator[Term]:
        """What moves a result with a column, apart from the states of its own group."""
        i, column = part.code.part, self.columns[c]
        prefix = self.model.prefix(i)
        for by, entry in part.entries.get(result, {}).items():
            row, scale = entry.row, 1.0
            if row < 0:
                row, scale = self._constant(1.0), entry.value
            if by.kind == "p":
                if column == f"{prefix}{by.path}":
                    yield Term(row, -1, scale)
            elif by.kind == "k":
                slot = ("k", i, by.path), column
                if slot in self._moved:
                    yield Term(row, -1, scale, slot)
            elif by.kind == "tap":
                tap = next(each for each in part.code.taps if each.number == int(by.path))
                if column == f"{prefix}{tap.tap.delay}":
                    yield Term(row, -1, scale, tap.number)
            elif by.kind == "signal":
                yield from self._through(entry, ("signal", by.part, by.path), c)
            elif by.path not in within:
                yield from self._through(entry, ("state", i, by.path), c)

    def _through(self, entry: Entry, node: Node, c: int) -> Iterator[Term]:
        """A known derivative, multiplied by a partial one."""
        found = self._references.get(node, {}).get(c)
        if found is not None and entry.row < 0:
            yield Term(found.row, -1, entry.value * found.scale)
        elif found is not None:
            yield Term(entry.row, found.row, found.scale)

    def _sum(self, terms: list[Term], whole: bool = False) -> Reference | None:
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
        self._made.append((row, terms))
        return Reference(row, 1.0)

    def _group(self, part: PartGraph, group: Group) -> bool:
        """Columns of a recurrence, and rows that they need; whether there are any."""
        since, i = len(self._made), part.code.part
        found: list[list[tuple[int, int, int]]] = []
        for c, column in enumerate(self.columns):
            results = [f"state.{path}" for path in group.states]
            terms = [list(self._terms(part, result, c, group.states)) for result in results]
            starts = {*started_by(self.model, i, column)}
            starts |= {path for path in group.states if (i, path, column) in self._starts}
            if not any(terms) and starts.isdisjoint(group.states):
                continue
            each = []
            for path, stored, moving in zip(group.states, group.stored, terms, strict=True):
                result = self._row() if stored else self._idle
                made, place = self._sum(moving, whole=True), self.tangents
                self.tangents += 1
                self.places.setdefault((i, path), {})[c] = place
                each.append((made.row if made else self._constant(0.0), result, place))
                if stored:
                    rows = self._references.setdefault(("state", i, path), {})
                    rows[c] = Reference(result, 1.0)
            found.append(each)
        if not found:
            return False
        generated, numbers = group.piece >= 0, list[int]()
        abreast = PAIR if generated else ABREAST
        idle = [(self._constant(0.0), self._idle, 0)] * len(group.states)
        found += [idle] * (-len(found) % abreast)
        if generated:
            numbers.append(len(found))
        else:
            own = By("state", group.states[0])
            entry = part.entries[f"state.{group.states[0]}"].get(own, Entry(-1))
            row = entry.row if entry.row >= 0 else self._constant(entry.value)
            numbers.append(row * STRIDE)
        for k, after in enumerate(group.after):
            numbers += [each[k][0] * STRIDE for each in found]
            numbers += [each[k][1] * STRIDE for each in found]
            numbers += [each[k][2] for each in found]
            numbers += [] if generated else [int(after) for _ in found]
        self._combine(since)
        begin = len(self._numbers)
        self._numbers += numbers
        what, piece = (CHAIN, group.piece) if generated else (RECUR, 0)
        self._todo.append((what, piece, begin, len(self._numbers)))
        return True

    def _signals(self, part: PartGraph) -> None:
        """Derivatives of the signals of a part that others need."""
        since, i = len(self._made), part.code.part
        for signal, path in part.aliases.items():
            self._references["signal", i, signal] = self._references.get(("state", i, path), {})
        for source in self.graph.sampler.sources:
            node = ("signal", i, source.signal)
            if source.part != i or node in self._references:
                continue
            result = f"signals.{source.signal}"
            if result not in part.entries:
                state = ("state", i, source.signal)
                self._references[node] = self._references.get(state, {})
                continue
            sums = (self._sum(list(self._terms(part, result, c))) for c in range(len(self.columns)))
            self._references[node] = {c: made for c, made in enumerate(sums) if made is not None}
        self._combine(since)

    def _observed(self, number: int, c: int) -> list[Term]:
        """What an observed signal's derivative by a column is."""
        place, _ = self.graph.observed[number]
        if place.kind == "link":
            terms = []
            for source in self.model.links[place.path].sources:
                known = self._references.get(("signal", *source), {}).get(c)
                factor = self.graph.links[place.path].get(source.signal, 0.0)
                if known is not None and factor != 0.0:
                    terms.append(Term(known.row, -1, factor * known.scale))
            return terms
        node = ("state" if place.kind == "state" else "signal", place.part, place.path)
        if node in self._references:
            known = self._references[node].get(c)
            return [] if known is None else [Term(known.row, -1, known.scale)]
        part = next(each for each in self.graph.parts if each.code.part == place.part)
        return list(self._terms(part, f"signals.{place.path}", c))

    def _value_row(self, number: int) -> int:
        place, _ = self.graph.observed[number]
        stored = self.graph.stored.get(place)
        return self.graph.values[place.part, place.path] if stored is None else stored


@generating
def layout_of(
    graph: Graph, columns: tuple[str, ...], observed: tuple[int, ...], start: str
) -> Layout:
    """What to do in every block for some columns: paths of parameters, and ``start.`` of a state.

    `observed` says for each observation which of the graph's observed signals it is, and `start`
    where the record begins.
    """
    return Layout(graph, columns, observed, start)


def started_by(model: Model, part: int, column: str) -> tuple[str, ...]:
    """Paths of a part's states that a column such as ``start.pump.pressure`` sets."""
    prefix = f"start.{model.prefix(part)}"
    if not column.startswith(prefix):
        return ()
    name = column.removeprefix(prefix)
    return model.parts[part].free_start.get(name, (name,))
