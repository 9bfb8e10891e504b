"""What is done in every block of a Jacobian: rows that are made, recurrences, where results go."""

from __future__ import annotations

from collections import deque
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.code_generation.functions import generating
from swashplate.equations.fields import floats_of
from swashplate.equations.marching.kernels import Struct
from swashplate.equations.marching.part_code import SignalId, taps_of
from swashplate.equations.marching.rows import (
    CALL,
    COMBINE,
    EIGHTH,
    INTEGRATE,
    RECUR,
    STRIDE,
    Program,
    Room,
    aligned,
    aligned_room,
)
from swashplate.equations.marching.structure import (
    Group,
    Moved,
    PartStructure,
    Structure,
    Term,
    interleaved,
)
from swashplate.equations.model import Model

Array = NDArray[np.float64]
Todo = tuple[int, int, int, int]
"""A row of `Program.todo`."""


class JacobianLayout:
    """A program without the numbers that depend on parameters, and the memory it needs.

    `pieces` are the numbers of those that are called, `slots` the numbers of terms with a factor of
    their kind, `tangents` counts the vector of tangents, of which the first belongs to idle
    columns, and `places` has the place of the tangent of a state by a column.
    """

    def __init__(
        self, structure: Structure, columns: tuple[str, ...], observed: tuple[int, ...], start: str
    ) -> None:
        self.structure, self.columns = structure, columns
        self._size, self.tangents = structure.facts.size, 1
        self._constant: dict[float, int] = {}  # Rows that hold just one value.
        self._observations = len(observed)
        self._spare: deque[Struct[Room]] = deque(maxlen=8)
        self.places: dict[Moved, int] = {}
        self._by: dict[SignalId, dict[int, Term]] = {}
        """Derivatives of what is known, by the number of each column that moves it."""
        self._begun: set[Moved] = set()  # States that a column moves at the first sample.
        self._sums: list[tuple[int, list[Term]]] = []  # Rows that are made, and of what.
        self._lanes: list[int] = []
        self._seed(start)
        done = [(part, self._part(part)) for part in structure.facts.parts]
        integrals: list[Todo] = []
        values, seen = zip(*(self._observed(each, integrals) for each in observed), strict=True)
        made, todo = len(self._sums), [(CALL, 0, 0, 0)]
        self._sums += [(0, terms) for each in seen for terms in each]
        read = {row for _, terms in self._sums for term in terms for row in term.rows}
        for part, own in done:
            if part.fill is not None and (own or any(row in part.rows for row in read)):
                todo.append((CALL, part.fill, 0, 0))
            todo += own
        todo += integrals
        terms = [term for _, each in self._sums for term in each]
        ones = self._value(1.0)
        pairs = [(*term.rows, *(ones, -1)[len(term.rows) :]) for term in terms]
        self.program = Program(
            steps=len(todo),
            todo=np.array(todo, dtype=np.int64),
            target=np.array([row for row, _ in self._sums], dtype=np.int64),
            first=np.cumsum([0, *(len(each) for _, each in self._sums)]).astype(np.int64),
            a=np.array([pair[0] for pair in pairs], dtype=np.int64),
            b=np.array([pair[1] for pair in pairs], dtype=np.int64),
            scale=np.array([term.scale for term in terms], dtype=np.float64),
            lanes=np.array(self._lanes, dtype=np.int64),
            seen=made,
            value=np.array(values, dtype=np.int64),
            integrals=sum(what == INTEGRATE for what, *_ in todo),
        )
        self.pieces = {piece for what, piece, *_ in todo if what in (CALL, RECUR)}
        self.slots = [(k, term.slot) for k, term in enumerate(terms) if term.slot is not None]

    def taken(self) -> Struct[Room]:
        """Memory for a march, of an earlier one if it can be: new memory takes longer to get."""
        with suppress(IndexError):  # another thread may be faster
            return self._spare.pop()
        block = aligned_room(self._size)
        for value, row in self._constant.items():
            block[row : row + STRIDE] = value
        room = Room(
            size=self._size,
            block=block,
            tangent=np.zeros(self.tangents),
            aside=aligned(STRIDE),
            products=aligned(EIGHTH),
            integrals=np.zeros((self.program.integrals, 3)),
            progress=np.zeros(self._observations, dtype=np.int64),
        )
        return Struct(room)

    def give_back(self, room: Struct[Room]) -> None:
        """Keep the memory of a march that has ended."""
        self._spare.append(room)

    def _row(self) -> int:
        self._size += STRIDE
        return self._size - STRIDE

    def _value(self, value: float) -> int:
        """Row that holds just this value."""
        if value not in self._constant:
            self._constant[value] = self._row()
        return self._constant[value]

    def _seed(self, start: str) -> None:
        """What the columns move at once: parameters, constants, places of taps, starts."""
        model, number = self.structure.model, {column: c for c, column in enumerate(self.columns)}
        moves = self.structure.starting(start).moves if self.columns else ()
        for known, column in moves:
            if known.kind == "state":
                self._begun.add((known, column))
            elif column in number:
                by = self._by.setdefault(known, {})
                by[number[column]] = Term(slot=(known, column))
        taps = taps_of(model, self.structure.signals)
        for part in self.structure.facts.parts:
            i, prefix = part.part, model.prefix(part.part)
            for path in floats_of(model.parts[i].parameters):
                if f"{prefix}{path}" in number:
                    self._by[SignalId(i, "p", path)] = {number[f"{prefix}{path}"]: Term()}
            for tap in (each for each in taps if each.part == i):
                column, known = f"{prefix}{tap.tap.delay}", SignalId(i, "fraction", str(tap.number))
                if tap.tap.delay and column in number:
                    self._by[known] = {number[column]: Term(slot=(known, column))}
            for column in self.columns:
                for path in started_by(model, i, column):
                    self._begun.add((SignalId(i, "state", path), column))

    def _terms(self, result: SignalId, c: int) -> list[Term]:
        """What a derivative by a column is the sum of."""
        if result in self._by:
            return [self._by[result][c]] if c in self._by[result] else []
        return [
            partial.times(self._by[by][c])
            for by, partial in self.structure.facts.partials.get(result, {}).items()
            if c in self._by.get(by, ())
        ]

    def _sum(self, terms: list[Term], whole: bool = False) -> Term:
        """A sum of terms as one that needs no slot: there already, or of a row that is made.

        With `whole` it is a row without a factor.
        """
        if len(terms) == 1 and terms[0].slot is None:
            rows, scale, _ = only = terms[0]
            if len(rows) < 2 and (not whole or (rows and scale == 1.0)):
                return only
        if not terms or terms == [Term((), terms[0].scale)]:
            return Term((self._value(terms[0].scale if terms else 0.0),))
        return Term((self._make(terms),))

    def _make(self, terms: list[Term]) -> int:
        """A new row that is a sum of terms."""
        row = self._row()
        self._sums.append((row, terms))
        return row

    def _part(self, part: PartStructure) -> list[Todo]:
        """What is done for a part: its recurrences, and the signals that others need."""
        todo: list[Todo] = []
        for group in part.groups:
            todo += self._group(group)
        for signal, state in part.behind.items():
            by = self._by[state].items()
            self._by[signal] = {c: Term((term.rows[0] + 1,)) for c, term in by}
        since = len(self._sums)
        for signal in part.needed:
            found = {c: self._terms(signal, c) for c in range(len(self.columns))}
            self._by[signal] = {c: self._sum(terms) for c, terms in found.items() if terms}
        return todo + self._made(since)

    def _made(self, since: int) -> list[Todo]:
        """Have the rows made that are new since then."""
        return [(COMBINE, since, len(self._sums), 0)] if len(self._sums) > since else []

    def _group(self, group: Group) -> list[Todo]:
        """Columns of a recurrence, and rows that they need, if there are any."""
        since, begin = len(self._sums), len(self._lanes)
        found: list[list[tuple[int, int, int]]] = []
        made: dict[SignalId, dict[int, Term]] = {state: {} for state in group.states}
        for c, column in enumerate(self.columns):
            terms = [self._terms(state, c) for state in group.states]
            if any(terms) or any((state, column) in self._begun for state in group.states):
                found.append([])
                for state, each in zip(group.states, terms, strict=True):
                    row, taken = self._sum(each, whole=True).rows[0], self._row()
                    self.places[state, column] = self.tangents
                    found[-1].append((row, taken, self.tangents))
                    made[state][c] = Term((taken,))
                    self.tangents += 1
        self._by |= made
        if not found:
            return []
        idle = [(self._value(0.0), 0, 0)] * len(group.states)
        found += [idle] * (-len(found) % interleaved(len(group.states)))
        self._lanes += group.factors
        for lanes in zip(*found, strict=True):
            self._lanes += [place for each in zip(*lanes, strict=True) for place in each]
        return [*self._made(since), (RECUR, group.piece, begin, len(self._lanes))]

    def _observed(self, number: int, integrals: list[Todo]) -> tuple[int, list[list[Term]]]:
        """Row of an observed signal, and what its derivatives are."""
        place, integral = self.structure.observed[number]
        value = self.structure.facts.row_of[place]
        seen = [self._terms(place, c) for c in range(len(self.columns))]
        if not integral:
            return value, seen
        since, begun = len(self._sums), sum(what == INTEGRATE for what, *_ in integrals)
        rows = [self._make(terms) if terms else 0 for terms in ([Term((value,))], *seen)]
        integrals += self._made(since)
        integrals += [(INTEGRATE, row, begun + k, 0) for k, row in enumerate(filter(None, rows))]
        return rows[0], [[Term((row,))] if row else [] for row in rows[1:]]


@generating
def layout_of(
    structure: Structure, columns: tuple[str, ...], observed: tuple[int, ...], start: str
) -> JacobianLayout:
    """What to do in every block for some columns: paths of parameters, and ``start.`` of a state.

    `observed` says for each observation which of the structure's observed signals it is, and
    `start` where the record begins.
    """
    return JacobianLayout(structure, columns, observed, start)


def started_by(model: Model, part: int, column: str) -> tuple[str, ...]:
    """Paths of a part's states that a column such as ``start.pump.pressure`` sets."""
    prefix = f"start.{model.prefix(part)}"
    if not column.startswith(prefix):
        return ()
    name = column.removeprefix(prefix)
    return model.parts[part].free_start.get(name, (name,))
