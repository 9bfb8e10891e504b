"""Program of a Jacobian for each block of samples: computed rows, recurrences, results."""

from __future__ import annotations

from collections import deque
from contextlib import suppress
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.code_generation.functions import generating
from swashplate.equations.fields import floats_of
from swashplate.equations.marching.kernels import Struct, addresses
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

    Attributes
    ----------
    program : Program
        What is done in every block.
    factors : list of (int, Moved)
        Terms with a factor that is known only with the parameters, and which factor that is.
    tangents : int
        Length of the vector of tangents, of which the first belongs to idle columns.
    tangent_of : dict of Moved to int
        Index in that vector of the derivative of a state by a column.
    """

    def __init__(
        self, structure: Structure, columns: tuple[str, ...], observed: tuple[int, ...], start: str
    ) -> None:
        self.structure = structure
        self.columns = columns
        self.tangents = 1
        self._size = structure.facts.size
        self._constant: dict[float, int] = {}
        """Rows that hold just one value."""
        self._observations = len(observed)
        self._spare: deque[Struct[Room]] = deque(maxlen=8)
        self.tangent_of: dict[Moved, int] = {}
        self._by: dict[SignalId, dict[int, Term]] = {}
        """Derivatives of what is known, by the number of each column that moves it."""
        self._start_moves: set[Moved] = set()
        """States that a column moves at the first sample."""
        self._sums: list[tuple[int, list[Term]]] = []
        """Rows that are computed, and of what."""
        self._lanes: list[int] = []
        self._seed(start)
        todo_of_parts = [(part, self._part(part)) for part in structure.facts.parts]
        integrals: list[Todo] = []
        observations = [self._observed(number, integrals) for number in observed]
        first_observed = len(self._sums)
        for _, derivatives in observations:
            self._sums += [(0, summands) for summands in derivatives]
        read = {row for _, summands in self._sums for term in summands for row in term.rows}
        todo: list[Todo] = [(CALL, 0, 0, 0)]
        for part, todo_of_part in todo_of_parts:
            is_read = bool(todo_of_part) or any(row in part.factor_rows for row in read)
            if part.fill_kernel is not None and is_read:
                todo.append((CALL, part.fill_kernel, 0, 0))
            todo += todo_of_part
        todo += integrals
        terms = [term for _, summands in self._sums for term in summands]
        ones = self._value(1.0)
        pairs = [(*term.rows, *(ones, -1)[len(term.rows) :]) for term in terms]
        self.program = Program(
            steps=len(todo),
            todo=np.array(todo, dtype=np.int64),
            target=np.array([row for row, _ in self._sums], dtype=np.int64),
            first=np.cumsum([0, *(len(summands) for _, summands in self._sums)]).astype(np.int64),
            first_factor=np.array([pair[0] for pair in pairs], dtype=np.int64),
            second_factor=np.array([pair[1] for pair in pairs], dtype=np.int64),
            scale=np.array([term.scale for term in terms], dtype=np.float64),
            lanes=np.array(self._lanes, dtype=np.int64),
            first_observed=first_observed,
            value=np.array([row for row, _ in observations], dtype=np.int64),
            integral_count=sum(what == INTEGRATE for what, *_ in todo),
        )
        self._called = {kernel for what, kernel, *_ in todo if what in (CALL, RECUR)}
        """Numbers of the kernels that the program calls."""
        self.factors = [
            (index, term.factor) for index, term in enumerate(terms) if term.factor is not None
        ]

    @cached_property
    def kernels(self) -> Any:
        """What `rows.march_observed` is given of the kernels, which are compiled for that."""
        return addresses(self.structure.kernels, self._called)

    def take_room(self) -> Struct[Room]:
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
            integral_states=np.zeros((self.program.integral_count, 3)),
            next_sample=np.zeros(self._observations, dtype=np.int64),
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
        """Note what the columns move directly: parameters, constants, delays, starts."""
        model = self.structure.model
        column_index = {column: index for index, column in enumerate(self.columns)}
        moves = self.structure.start_code(start).moves if self.columns else ()
        for moved_id, column in moves:
            if moved_id.kind == "state":
                self._start_moves.add((moved_id, column))
            elif column in column_index:
                terms = self._by.setdefault(moved_id, {})
                terms[column_index[column]] = Term(factor=(moved_id, column))
        taps = taps_of(model, self.structure.signals)
        for part in self.structure.facts.parts:
            part_index, prefix = part.part, model.prefix(part.part)
            for path in floats_of(model.parts[part_index].parameters):
                if f"{prefix}{path}" in column_index:
                    self._by[SignalId(part_index, "p", path)] = {
                        column_index[f"{prefix}{path}"]: Term()
                    }
            for tap in taps:
                column = f"{prefix}{tap.tap.delay}"
                if tap.part == part_index and tap.tap.delay and column in column_index:
                    fraction = SignalId(part_index, "fraction", str(tap.number))
                    self._by[fraction] = {column_index[column]: Term(factor=(fraction, column))}
            for column in self.columns:
                for path in started_by(model, part_index, column):
                    self._start_moves.add((SignalId(part_index, "state", path), column))

    def _terms(self, result: SignalId, c: int) -> list[Term]:
        """What a derivative by a column is the sum of."""
        if result in self._by:
            return [self._by[result][c]] if c in self._by[result] else []
        return [
            partial.times(self._by[by][c])
            for by, partial in self.structure.facts.partials.get(result, {}).items()
            if c in self._by.get(by, ())
        ]

    def _sum(self, terms: list[Term], as_row: bool = False) -> Term:
        """A sum of terms as one term: the only one itself if it will do, or a new row.

        With `as_row` it is a row without a number that multiplies it.
        """
        if len(terms) == 1 and terms[0].factor is None:
            term = terms[0]
            is_row = len(term.rows) == 1 and term.scale == 1.0
            if is_row or (len(term.rows) < 2 and not as_row):
                return term
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
        for signal, state in part.next_state_of.items():
            by = self._by[state].items()
            self._by[signal] = {c: Term((term.rows[0] + 1,)) for c, term in by}
        since = len(self._sums)
        for signal in part.needed:
            derivatives = {c: self._terms(signal, c) for c in range(len(self.columns))}
            self._by[signal] = {c: self._sum(terms) for c, terms in derivatives.items() if terms}
        return todo + self._combined(since)

    def _combined(self, since: int) -> list[Todo]:
        """Have the rows computed that are new since then."""
        if len(self._sums) == since:
            return []
        return [(COMBINE, since, len(self._sums), 0)]

    def _group(self, group: Group) -> list[Todo]:
        """Columns of a recurrence, and rows that they need, if there are any."""
        since = len(self._sums)
        begin = len(self._lanes)
        columns: list[list[tuple[int, int, int]]] = []
        """Of each column and state: rows of input and result, and the index of the tangent."""
        derivatives: dict[SignalId, dict[int, Term]] = {state: {} for state in group.states}
        for c, column in enumerate(self.columns):
            inputs = [self._terms(state, c) for state in group.states]
            if any(inputs) or any((state, column) in self._start_moves for state in group.states):
                columns.append([])
                for state, terms in zip(group.states, inputs, strict=True):
                    row = self._sum(terms, as_row=True).rows[0]
                    result = self._row()
                    self.tangent_of[state, column] = self.tangents
                    columns[-1].append((row, result, self.tangents))
                    derivatives[state][c] = Term((result,))
                    self.tangents += 1
        self._by |= derivatives
        if not columns:
            return []
        idle = [(self._value(0.0), 0, 0)] * len(group.states)
        columns += [idle] * (-len(columns) % interleaved(len(group.states)))
        self._lanes += group.factors
        for lanes in zip(*columns, strict=True):
            for offsets in zip(*lanes, strict=True):
                self._lanes += offsets
        return [*self._combined(since), (RECUR, group.kernel, begin, len(self._lanes))]

    def _observed(self, number: int, integrals: list[Todo]) -> tuple[int, list[list[Term]]]:
        """Row of an observed signal, and what its derivatives are."""
        signal, is_integral = self.structure.observed[number]
        value = self.structure.facts.row_of[signal]
        derivatives = [self._terms(signal, c) for c in range(len(self.columns))]
        if not is_integral:
            return value, derivatives
        since = len(self._sums)
        earlier = sum(what == INTEGRATE for what, *_ in integrals)
        rows = [self._make(terms) if terms else 0 for terms in ([Term((value,))], *derivatives)]
        integrals += self._combined(since)
        integrals += [
            (INTEGRATE, row, earlier + index, 0) for index, row in enumerate(filter(None, rows))
        ]
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
