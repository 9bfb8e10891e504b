"""The march of one set that leaves derivatives, block by block: all columns side by side.

With x the states, y the observed signals and p the columns,

    x[n+1] = f(x[n], p),  y[n] = g(x[n], p),
    dx[n+1]/dp = A[n] dx[n]/dp + B[n],  dy[n]/dp = C[n] dx[n]/dp + D[n].

A march over a block leaves values; what A, B, C and D are made of is computed from these, eight
samples at a time; then the columns are carried, eight at a time. Through which nodes of a sample
they are carried is found by `elimination`. The three are functions apart, so that none takes the
registers of another.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from swashplate.errors import InputError
from swashplate.machine import graph
from swashplate.machine.code_generation.elimination import SIDE_BY_SIDE, Elimination
from swashplate.machine.code_generation.llvm import Code, computed_from
from swashplate.machine.code_generation.slopes import Contribution, opposite
from swashplate.machine.code_generation.values import leaves
from swashplate.machine.graph import ONE, TRUE, ZERO, Node, names_in, ordered, times
from swashplate.machine.marching.march import ARGUMENTS, HALF, March, known_ahead
from swashplate.machine.marching.part_code import PartCode, SignalId
from swashplate.machine.marching.sample_code import CodeForm, SampleCode, output_of
from swashplate.machine.model import Model

MOST_OPERATIONS = 400_000
"""Of what is done with a block: compiled in a minute or so."""
MOST_IN_ROOM = 1 << 15
"""Numbers that a block leaves at most, so that they stay in a fast cache."""
MOST_SAMPLES = 256
"""Of a block."""
APART = 8
"""Numbers between rows of the room, so that they do not share places in a cache."""
QUICK = {*graph.CHEAP, "**", "call"}
"""Operations that are computed again rather than kept; what a call returns is kept."""
VECTOR = f"<{SIDE_BY_SIDE} x double>"
MINUS_ONE = graph.number(-1.0)
TANGENT_ARGUMENTS = (
    *ARGUMENTS,
    *(("ptr", name) for name in ("delay_slope", "tangent", "room", "past", "ring")),
)
"""Of a march with derivatives: what a march takes, with rows of values and columns in ``flat``.

``delay_slope`` samples that each delay grows by a second; ``tangent`` derivatives of the states at
the first sample, replaced by those after the last, then memory of integrals; ``room`` what the
march leaves for the columns, zeros at first; ``past`` derivatives of the signals between parts
that taps read, a ring for each; ``ring`` its samples, a power of 2, less 1, and whether the first
sample's derivatives are those before it, too, as in a steady start: else they are zero.
"""


class Tangents(NamedTuple):
    """A march with derivatives: its texts, and where its numbers are."""

    texts: tuple[str, ...]
    """Of what is done with each block in turn."""
    block: int
    """Most samples of a block."""
    room: int
    """Numbers that a block leaves."""
    row: int
    """From one sample in ``flat`` to the next: values, then the columns of each output."""
    first_column: int
    """Of a row: the first output's first column."""
    width: int
    """Columns of a state or an output, idle ones counted."""
    tangents: int
    """Numbers of ``tangent``."""
    past: int
    """Numbers of a sample in ``past``."""
    states: tuple[SignalId, ...]
    """States in the order in which ``tangent`` has them, `width` numbers each."""


def padded(count: int) -> int:
    """Numbers that a few vectors hold."""
    return -(-count // SIDE_BY_SIDE) * SIDE_BY_SIDE


class Carried:
    """Through which nodes of a sample derivatives by some columns are carried.

    Parameters
    ----------
    sample_code : SampleCode
        One sample.
    outputs : sequence of SignalId
        Signals that are differentiated.
    columns : sequence of str
        Paths of parameters, and ``start.`` with the path of a state.
    begins : mapping of SignalId to collection of int
        States that columns move where the record begins, by the numbers of these.

    Attributes
    ----------
    states, following : list of Node
        States, and what they become.
    outputs : list of Node
        The signals.
    past : dict of Node to tuple
        Of each past sample of a signal between parts its tap, its age, and the signal's number.
    between : list of Node
        Those signals now.
    vertices : list of Node
        What carries derivatives, each after what it follows.
    flows : dict of Node to dict of Node to Contribution
        Of each its derivatives by states and others of them.
    direct : dict of Node to dict of int to Node
        Of each its derivatives by columns, by their numbers.
    groups : dict of Node to set of int
        Of states and vertices the groups of columns in which they have derivatives at all.
    """

    def __init__(
        self,
        sample_code: SampleCode,
        outputs: Sequence[SignalId],
        columns: Sequence[str],
        begins: Mapping[SignalId, Any],
    ) -> None:
        model = sample_code.model
        number_of = {column: number for number, column in enumerate(columns)}
        column_of = dict[Node, int]()
        slope_of = dict[Node, Node]()
        """Of the fraction in a delay, how it grows with that."""
        self.states, self.following = list[Node](), list[Node]()
        self.ids = sample_code.carried_ids
        for part in sample_code.used:
            prefix = model.prefix(part.part)
            for path, node in leaves(part.p):
                if f"{prefix}{path}" in number_of:
                    column_of[node] = number_of[f"{prefix}{path}"]
            for tap in part.taps:
                if f"{prefix}{tap.tap.delay}" in number_of:
                    fraction = graph.name(part.delay_fraction(tap))
                    column_of[fraction] = number_of[f"{prefix}{tap.tap.delay}"]
                    slope_of[fraction] = delay_slope(tap.number)
            names, following = dict(leaves(part.state)), dict(leaves(part.following))
            for path in sample_code.carried[part.part]:
                self.states.append(names[path])
                self.following.append(following[path])
        self.moving = {*self.states}
        self.outputs = [
            sample_code.observed(sample_code.parts[signal.part], signal) for signal in outputs
        ]
        late = sample_code.late
        self.between = [sample_code.parts[tap.part].tapped(tap) for tap in late]
        self.past = {
            graph.name(name): (tap, age, number)
            for number, tap in enumerate(late)
            for age, name in enumerate(sample_code.parts[tap.part].tap_samples(tap))
        }
        self.moving |= {*self.past}
        results = [*self.following, *self.outputs, *self.between]
        elimination = Elimination(
            results,
            [*self.states, *self.past],
            [*column_of],
            len(columns),
            sample_code.stands_for,
        )
        self.flows: dict[Node, dict[Node, Contribution]] = {}
        self.direct: dict[Node, dict[int, Node]] = {}
        for column in dict.fromkeys(results):
            if column in column_of:  # a parameter itself
                self.flows[column], self.direct[column] = {}, {column_of[column]: ONE}
        for vertex, edges in elimination.edges.items():
            flows = self.flows[vertex] = {}
            direct = self.direct[vertex] = {}
            for operand, contribution in edges.items():
                if operand not in column_of:
                    flows[operand] = contribution
                    continue
                amount = times(contribution.zero_elsewhere, slope_of.get(operand, ONE))
                number = column_of[operand]
                direct[number] = graph.plus(direct.get(number, ZERO), amount)
        self._find_groups(begins)
        self.vertices = [vertex for vertex in self._in_order() if self.groups[vertex]]

    def _find_groups(self, begins: Mapping[SignalId, Any]) -> None:
        """Find out which columns reach which states and vertices."""
        self.groups: dict[Node, set[int]] = {
            state: {number // SIDE_BY_SIDE for number in begins.get(signal, ())}
            for state, signal in zip(self.states, self.ids, strict=True)
        }
        for vertex, direct in self.direct.items():
            self.groups[vertex] = {number // SIDE_BY_SIDE for number in direct}
        for node in self.past:
            self.groups[node] = set()
        before = -1
        while before != (now := sum(map(len, self.groups.values()))):
            before = now
            for vertex, flows in self.flows.items():
                for operand in flows:
                    self.groups[vertex] |= self.groups.get(operand, set())
            for state, following in zip(self.states, self.following, strict=True):
                self.groups[state] |= self.groups.get(following, set())
            for node, (_, _, number) in self.past.items():
                self.groups[node] |= self.groups.get(self.between[number], set())

    def _in_order(self) -> list[Node]:
        """All vertices; a signal between parts comes before what reads it as it is now."""

        def followed(node: Node) -> list[Node]:
            if node in self.past:
                tap, _, number = self.past[node]
                return [] if tap.tap.late else [self.between[number]]
            return [*self.flows.get(node, ())]

        if not self.past:
            return [*self.flows]
        return [node for node in ordered([*self.flows], operands=followed) if node in self.flows]


def delay_slope(tap: int) -> Node:
    """By how many samples a tap's delay grows with its seconds."""
    return graph.name(f"delay$slope${tap}")


class _Block:
    """What is done with a block of samples, and where its numbers are.

    Attributes
    ----------
    amounts : dict of Node to int
        Row of the room of each derivative that a vertex is carried with.
    rows : dict of (Node, int) to int
        First row for a vertex and a group of columns: its derivatives by these, side by side.
    literals : dict of (Node, int) to list of float
        The same where these are all literal numbers.
    kept : dict of Node to int
        Row of each number of a sample that derivatives are computed from.
    """

    def __init__(
        self,
        sample_code: SampleCode,
        outputs: Sequence[tuple[SignalId, bool]],
        columns: Sequence[str],
        begins: Mapping[SignalId, Any],
    ) -> None:
        self.sample_code, self.outputs = sample_code, outputs
        self._columns = len(columns)
        self.width = padded(len(columns))
        self.first_column = padded(len(outputs))
        self.row = self.first_column + len(outputs) * self.width
        signals = [signal for signal, _ in outputs]
        self.carried = Carried(sample_code, signals, columns, begins)
        self._first_integral = len(self.carried.states) * self.width
        self.amounts: dict[Node, int] = {}
        self.rows: dict[tuple[Node, int], int] = {}
        self.literals: dict[tuple[Node, int], list[float]] = {}
        self._lay_out()

    def _lay_out(self) -> None:
        """Give amounts, derivatives by columns, and what they are computed from their rows."""
        carried = self.carried
        for vertex in carried.vertices:
            for operand, contribution in carried.flows[vertex].items():
                amount = contribution.zero_elsewhere
                if carried.groups.get(operand) and amount.op != "number":
                    self.amounts.setdefault(amount, len(self.amounts))
        count = len(self.amounts)
        for vertex in carried.vertices:
            for group in sorted({number // SIDE_BY_SIDE for number in carried.direct[vertex]}):
                derivatives = self.direct(vertex, group)
                if all(each.op == "number" for each in derivatives):
                    self.literals[vertex, group] = [float(each.value) for each in derivatives]
                else:
                    self.rows[vertex, group] = count
                    count += SIDE_BY_SIDE
        direct = [each for row in self.rows for each in self.direct(*row)]
        self.ends = [
            graph.plain_value(end) for end in [*self.amounts, *direct] if end.op != "number"
        ]
        self.kept = {node: count + place for place, node in enumerate(self._needed())}
        rows = max(count + len(self.kept), 1)
        most = MOST_IN_ROOM // rows // SIDE_BY_SIDE * SIDE_BY_SIDE - APART
        self.block = max(SIDE_BY_SIDE, min(MOST_SAMPLES, most))
        self.stride = self.block + APART
        self.room = rows * self.stride

    def _needed(self) -> list[Node]:
        """What changes from sample to sample and is kept; what takes long is not computed twice."""
        sample_code = self.sample_code
        constants = {delay_slope(tap.number) for part in sample_code.used for tap in part.taps}
        constants |= {graph.name("h")}
        for part in sample_code.used:
            constants |= {node for _, node in (*leaves(part.p), *leaves(part.given))}
            constants |= {graph.name(name) for name in part.delay_fractions}
        still = {*constants, *_ahead(self.ends, constants)}
        ends = [end for part in sample_code.used for end in sample_code.ends[part.part]]
        of_march = {*ordered(map(graph.plain_value, ends), (), computed_from)}

        def is_kept(node: Node) -> bool:
            return node.op == "name" or (
                node.op not in QUICK and node.kind == "float" and node in of_march
            )

        def operands(node: Node) -> Sequence[Node]:
            return () if is_kept(node) else computed_from(node)

        return [node for node in ordered(self.ends, still, operands) if is_kept(node)]

    def direct(self, vertex: Node, group: int) -> list[Node]:
        """Derivatives of a vertex by the columns of a group."""
        direct, first = self.carried.direct[vertex], group * SIDE_BY_SIDE
        return [direct.get(first + number, ZERO) for number in range(SIDE_BY_SIDE)]

    def finished(self) -> Tangents:
        """The texts, and where their numbers are."""
        integrals = sum(integral for _, integral in self.outputs)
        texts = [self._values_text()]
        if self.ends:
            texts.append(self._amounts_text())
        if self.width:
            texts.append(self._columns_text())
        self._check_size(texts)
        return Tangents(
            texts=tuple(texts),
            block=self.block,
            room=self.room,
            row=self.row,
            first_column=self.first_column,
            width=self.width,
            tangents=self._first_integral + 2 * integrals * (SIDE_BY_SIDE + self.width),
            past=len(self.carried.between) * self.width,
            states=tuple(self.carried.ids),
        )

    def _check_size(self, texts: Sequence[str]) -> None:
        """Refuse what would be compiled for minutes."""
        operations = sum(text.count("\n") for text in texts)
        if operations > MOST_OPERATIONS:
            raise InputError(
                f"{self.sample_code.model.name}: the derivatives by {self._columns} columns are "
                f"{operations} operations a sample, more than the {MOST_OPERATIONS} that are "
                "compiled (a minute): ask for fewer columns at a time, or for those of a part."
            )

    # -- values, and what derivatives are made of --------------------------------------------------

    def _values_text(self) -> str:
        """Text of the march that leaves values, and what derivatives are computed from."""
        code = Code(TANGENT_ARGUMENTS)
        march = March(self.sample_code, code, names_in(self.kept))

        def keep(known: dict[Node, str], at: str, parts: Sequence[PartCode]) -> None:
            for number, (signal, integral) in enumerate(self.outputs):
                if any(part.part == signal.part for part in parts):
                    value = march.observed(signal, known)
                    if integral:
                        value = self._integrated(code, value, number, 0, "double", at)
                    code.store(value, "%flat", _place(code, at, self.row, number))
            to = code.address("%room", at)
            for row, text in zip(self.kept.values(), code.floats(self.kept, known), strict=True):
                code.store(text, to, row * self.stride)

        march.run(keep, together=self._columns > 0)
        return code.text

    def _amounts_text(self) -> str:
        """Text of what computes, eight samples at a time, what derivatives are made of."""
        code = Code(TANGENT_ARGUMENTS)
        everywhere = known_ahead(self.sample_code, code, names_in(self.ends))
        for part in self.sample_code.used:
            for tap in part.taps:
                everywhere[delay_slope(tap.number)] = code.load("%delay_slope", tap.number)
        code.values(_ahead(self.ends, everywhere), everywhere)
        read = {*ordered(self.ends, self.kept, computed_from)}
        with code.side_by_side(SIDE_BY_SIDE):
            still = {
                node: code.in_all_lanes(text)
                for node, text in everywhere.items()
                if node in read and node.kind != "bool" and node.op != "call"
            }
            end = code.put(f"and i64 {code.put(f'add i64 %count, {SIDE_BY_SIDE - 1}')}, -8")
            with code.loop("0", end, SIDE_BY_SIDE) as at:
                room = code.address("%room", at)
                known = still | {
                    node: code.load(room, row * self.stride) for node, row in self.kept.items()
                }
                for row, text in zip(
                    self.amounts.values(), code.floats(self.amounts, known), strict=True
                ):
                    code.store(text, room, row * self.stride)
                to = code.address("%room", code.put(f"mul i64 {at}, {SIDE_BY_SIDE}"))
                for (vertex, group), row in self.rows.items():
                    texts = code.floats(self.direct(vertex, group), known)
                    for sample, text in enumerate(code.transposed(texts)):
                        code.store(text, to, row * self.stride + sample * SIDE_BY_SIDE)
        return code.text

    def _integrated(
        self, code: Code, rate: str, output: int, place: int, kind: str, at: str
    ) -> str:
        """The trapezoidal integral of a rate up to sample `at` of the block, 0 at the first one."""
        earlier = sum(integral for _, integral in self.outputs[:output])
        size = SIDE_BY_SIDE + self.width
        total, last = (
            self._first_integral + (2 * earlier + which) * size + place for which in range(2)
        )
        n = code.put(f"add i64 %first, {at}")
        inside = code.put(f"icmp sgt i64 {n}, 0")
        half = code.put(f"fmul double {HALF}, %h")
        half = code.put(f"select i1 {inside}, double {half}, double 0.0")
        half = code.vector(half, SIDE_BY_SIDE) if kind == VECTOR else half
        both = code.put(f"fadd {kind} {code.load('%tangent', last, kind)}, {rate}")
        added = code.put(f"fmul {kind} {half}, {both}")
        value = code.put(f"fadd {kind} {code.load('%tangent', total, kind)}, {added}")
        code.store(value, "%tangent", total, kind)
        code.store(rate, "%tangent", last, kind)
        return value

    # -- columns -----------------------------------------------------------------------------------

    def _columns_text(self) -> str:
        """Text of what carries the columns over the block, a group after the other."""
        code = Code(TANGENT_ARGUMENTS)
        for group in range(self.width // SIDE_BY_SIDE):
            self._carry(code, group)
        return code.text

    def _carry(self, code: Code, group: int) -> None:
        """The loop that carries a group of columns."""
        carried = self.carried
        places = {
            state: place * self.width + group * SIDE_BY_SIDE
            for place, state in enumerate(carried.states)
            if group in carried.groups[state]
        }
        variables = {
            state: code.variable(code.load("%tangent", place, VECTOR), VECTOR)
            for state, place in places.items()
        }
        following = dict(zip(carried.states, carried.following, strict=True))
        with code.loop("0", "%count") as at:
            sample = _Sample(self, code, at, group)
            now = {state: code.load(variable, 0, VECTOR) for state, variable in variables.items()}
            for vertex in carried.vertices:
                if group in carried.groups[vertex]:
                    for node in carried.flows[vertex]:
                        if node not in now and group in carried.groups.get(node, ()):
                            now[node] = self._past(code, node, at, group)
                    now[vertex] = sample.sum_of(vertex, now)
                    self._keep(code, vertex, now[vertex], at, group)
            for state, variable in variables.items():
                text = now.get(following[state], "zeroinitializer")
                code.store(text, variable, 0, VECTOR)
            for number, (output, (_, integral)) in enumerate(
                zip(carried.outputs, self.outputs, strict=True)
            ):
                if output in now:
                    text, first = now[output], group * SIDE_BY_SIDE
                    if integral:
                        place = SIDE_BY_SIDE + first
                        text = self._integrated(code, text, number, place, VECTOR, at)
                    place = self.first_column + number * self.width + first
                    code.store(text, "%flat", _place(code, at, self.row, place), VECTOR)
        for state, place in places.items():
            code.store(code.load(variables[state], 0, VECTOR), "%tangent", place, VECTOR)

    def _past(self, code: Code, node: Node, at: str, group: int) -> str:
        """Derivatives of a past sample of a signal between parts by a group of columns."""
        tap, age, number = self.carried.past[node]
        n = code.put(f"add i64 %first, {at}")
        delay = code.load("%delay_samples", tap.number, "i64")
        n = code.put(f"sub i64 {code.put(f'sub i64 {n}, {delay}')}, {age}")
        inside = code.put(f"icmp sge i64 {n}, 0")
        n = code.put(f"select i1 {inside}, i64 {n}, i64 0")
        steady = code.put(f"icmp ne i64 {code.load('%ring', 1, 'i64')}, 0")
        counts = code.put(f"or i1 {inside}, {steady}")
        vector = code.load("%past", self._place_in_ring(code, n, number, group), VECTOR)
        return code.put(f"select i1 {counts}, {VECTOR} {vector}, {VECTOR} zeroinitializer")

    def _keep(self, code: Code, vertex: Node, vector: str, at: str, group: int) -> None:
        """Keep derivatives of a signal between parts."""
        for number, node in enumerate(self.carried.between):
            if node is vertex:
                n = code.put(f"add i64 %first, {at}")
                code.store(vector, "%past", self._place_in_ring(code, n, number, group), VECTOR)

    def _place_in_ring(self, code: Code, n: str, number: int, group: int) -> str:
        slot = code.put(f"and i64 {n}, {code.load('%ring', 0, 'i64')}")
        row = code.put(f"mul i64 {slot}, {len(self.carried.between) * self.width}")
        return code.put(f"add i64 {row}, {number * self.width + group * SIDE_BY_SIDE}")


class _Sample:
    """What derivatives by a group of columns are made of at a sample, loaded when it is needed."""

    def __init__(self, block: _Block, code: Code, at: str, group: int) -> None:
        self._block, self._code, self._group = block, code, group
        self._room = code.address("%room", at)
        self._rows = code.address("%room", code.put(f"mul i64 {at}, {SIDE_BY_SIDE}"))
        self._scalars = dict[Node, str]()
        self._vectors = dict[Node, str]()
        self._tests = dict[Node, str]()

    def _scalar(self, amount: Node) -> str:
        if amount not in self._scalars:
            place = self._block.amounts[amount] * self._block.stride
            self._scalars[amount] = self._code.load(self._room, place, "double")
        return self._scalars[amount]

    def _vector(self, amount: Node) -> str:
        if amount not in self._vectors:
            if amount.op == "number":
                vector = _literal([float(amount.value)] * SIDE_BY_SIDE)
            else:
                vector = self._code.vector(self._scalar(amount), SIDE_BY_SIDE)
            self._vectors[amount] = vector
        return self._vectors[amount]

    def _counts(self, amount: Node) -> str:
        """Whether an amount is not zero."""
        if amount not in self._tests:
            scalar = self._scalar(amount)
            self._tests[amount] = self._code.put(f"fcmp une double {scalar}, 0.0")
        return self._tests[amount]

    def _by_columns(self, vertex: Node) -> list[str]:
        """A vertex's own derivatives by the columns; empty if it has none."""
        place = vertex, self._group
        if place in self._block.rows:
            row = self._block.rows[place] * self._block.stride
            return [self._code.load(self._rows, row, VECTOR)]
        if place in self._block.literals:
            return [_literal(self._block.literals[place])]
        return []

    def sum_of(self, vertex: Node, now: Mapping[Node, str]) -> str:
        """A vertex's derivatives by the columns, from those of what it follows."""
        code = self._code
        terms, subtracted = self._by_columns(vertex), list[str]()
        flows = {
            operand: contribution
            for operand, contribution in self._block.carried.flows[vertex].items()
            if operand in now
        }
        if len(flows) == 2 and not terms:
            (one, first), (other, second) = flows.items()
            if first.amount is ONE is second.amount and first.test is opposite(second.test):
                test = self._counts(first.zero_elsewhere)
                return code.put(f"select i1 {test}, {VECTOR} {now[one]}, {VECTOR} {now[other]}")
        for operand, contribution in flows.items():
            amount = contribution.zero_elsewhere
            if amount is ONE:
                terms.append(now[operand])
            elif amount is MINUS_ONE:
                subtracted.append(now[operand])
            else:
                terms.append(self._term(amount, contribution, operand, now[operand]))
        total = summed(code, terms, VECTOR) if terms else "zeroinitializer"
        for text in subtracted:
            total = code.put(f"fsub {VECTOR} {total}, {text}")
        return total

    def _term(self, amount: Node, contribution: Contribution, operand: Node, text: str) -> str:
        """What an operand gives to a vertex."""
        code = self._code
        chosen = contribution.test is not TRUE and amount.op != "number"
        if not chosen or contribution.amount is not ONE:
            text = code.put(f"fmul {VECTOR} {self._vector(amount)}, {text}")
            # states are finite; what is not taken may be anything
            chosen = chosen and operand not in self._block.carried.moving
        if not chosen:
            return text
        test = self._counts(amount)
        return code.put(f"select i1 {test}, {VECTOR} {text}, {VECTOR} zeroinitializer")


def _place(code: Code, sample: str, size: int, place: int) -> str:
    """Place of a number in a sample's row."""
    at = code.put(f"mul i64 {sample}, {size}")
    return code.put(f"add i64 {at}, {place}") if place else at


def _literal(numbers: Sequence[float]) -> str:
    bits = (struct.unpack("<Q", struct.pack("<d", number))[0] for number in numbers)
    return f"<{', '.join(f'double 0x{each:016X}' for each in bits)}>"


def summed(code: Code, terms: list[str], kind: str) -> str:
    """A sum in pairs: none waits for all earlier ones."""
    while len(terms) > 1:
        pairs = [
            code.put(f"fadd {kind} {one}, {other}")
            for one, other in zip(terms[::2], terms[1::2], strict=False)
        ]
        terms = pairs + terms[len(pairs) * 2 :]
    return terms[0]


def _ahead(ends: Iterable[Node], known: Collection[Node]) -> list[Node]:
    """What some ends need that follows from what is known before the march."""
    still = dict[Node, None]()
    for node in ordered(map(graph.plain_value, ends), known, computed_from):
        operands = computed_from(node)
        if (
            node.kind != "bool"
            and operands
            and all(each in still or each in known or each.op == "number" for each in operands)
        ):
            still[node] = None
    return [*still]


def tangents_of(
    model: Model,
    form: CodeForm,
    outputs: Sequence[str],
    columns: Sequence[str],
    begins: Mapping[SignalId, Any],
) -> Tangents:
    """The march of a model with the derivatives of some signals, or their integrals, by columns."""
    found = [output_of(model, output) for output in outputs]
    sample_code = SampleCode(model, form, [signal for signal, _ in found])
    return _Block(sample_code, found, columns, begins).finished()
