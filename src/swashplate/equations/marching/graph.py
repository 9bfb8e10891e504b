"""Which derivative flows into which: the structure behind a model's Jacobian, and its pieces.

A column of the Jacobian is the derivative of every state by one parameter, over all samples. It
follows the linear recurrence ds[n+1] = A[n] ds[n] + b[n]. The partial derivatives A and b are known
once the states are (`fill` kernels, without a wait between samples); which of them are zero
whatever the numbers is known when the code is generated. So states fall into groups that wait for
each other (`recur` kernels: strongly connected components), each behind those that it needs.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from graphlib import TopologicalSorter
from typing import Any, NamedTuple

from swashplate.equations import expressions as ex
from swashplate.equations.adjoints import Derivatives, Derived, derived_function
from swashplate.equations.code import Code, Let, generating, leaves
from swashplate.equations.expressions import Node
from swashplate.equations.marching.march import Sampler, march_source, output_of
from swashplate.equations.marching.part import PartCode, Stored
from swashplate.equations.marching.pieces import PIECE, Planned, piece
from swashplate.equations.marching.rows import STRIDE
from swashplate.equations.marching.run import module
from swashplate.equations.model import Model, Source, arguments_of
from swashplate.equations.reading import read
from swashplate.equations.writing import Writer, function_source, indented
from swashplate.errors import InputError

PAIR = 2
"""Columns of a generated recurrence side by side."""

Moved = tuple[Stored, str]
"""A number, and the column that it is derived by."""


class Term(NamedTuple):
    """A product of rows of the block and a number: a partial derivative, a derivative, or both."""

    rows: tuple[int, ...] = ()  # First place of each.
    scale: float = 1.0
    slot: Moved | None = None
    """A further factor, known only with the parameters."""

    def times(self, other: Term) -> Term:
        """The product of both."""
        return Term(self.rows + other.rows, self.scale * other.scale, self.slot or other.slot)


class Group(NamedTuple):
    """States of a part that wait for each other, in one recurrence."""

    states: tuple[Stored, ...]
    piece: int | None  # Piece that runs it; None for one state, which a library kernel does.


class PartGraph(NamedTuple):
    """What is done for a part behind the march."""

    fill: int | None  # Piece that fills in its partial derivatives.
    rows: range  # Places of these.
    groups: list[Group]
    needed: list[Stored]  # Signals that other parts or links need.
    behind: dict[Stored, Stored]  # Signals that are a state behind the sample.


class Starting(NamedTuple):
    """Constants and states at the start with their derivatives, as a function of scalars."""

    arguments: tuple[Stored, ...]
    moves: tuple[Moved, ...]
    """What is derived, by which column: the last numbers that `derived` gives."""
    derived: Derived


class Graph:
    """A model's whole structure for some observed signals, and the pieces of its march.

    Attributes
    ----------
    observed : list of (Stored, bool)
        What is observed, and whether as an integral.
    row_of : dict of Stored to int
        First place of each number that the march leaves in the block.
    partials : dict
        Of each result (signal, or state at the next sample) its partial derivatives by parameters
        (``p``), constants (``k``), places of taps (``fraction``), states and signals.
    """

    def __init__(
        self,
        model: Model,
        signals: tuple[str, ...],
        options: tuple[Any, ...],
        observed: tuple[str, ...],
    ) -> None:
        self.model = model
        self.observed = [output_of(model, each) for each in observed]
        places = [place for place, _ in self.observed]
        self.sampler = Sampler(model, signals, options, places, ruled=True)
        self.size = STRIDE  # Of the block; its first row is for what nobody reads.
        self.row_of: dict[Stored, int] = {}
        self._named: dict[str, int] = {}  # Place of each number's row by its name in the code.
        self.partials: dict[Stored, dict[Stored, Term]] = {}
        self.pieces: list[Planned] = []  # The march, made last, comes first.
        # part by part, so that the pieces of the first ones are the same whatever follows
        self.parts = [self._part(part) for part in self.sampler.used]
        for place in places:
            if place.kind == "link":
                self._keep(place)
                self.partials[place] = self._link(place.path)
        kept = {each: f"flat[{row} + n - first]" for each, row in self.row_of.items()}
        self.pieces.insert(0, self._planned("march", *march_source(model, signals, options, kept)))
        self._starting: dict[str, Starting] = {}

    def number_of(self, source: Source) -> Stored:
        """A signal of a part, or of its state."""
        state = source.signal in dict(leaves(self.sampler.parts[source.part].state))
        return Stored(source.part, "state" if state else "signals", source.signal)

    def _planned(self, name: str, text: str, names: Mapping[str, Any]) -> Planned:
        """A piece, in a module of its own."""
        file = f"{self.model.name}_{name}"
        return generating(lambda: module(file, text, {"piece": piece, **names})[name])

    def _piece(
        self, name: str, says: str, lines: Sequence[str], names: Any = None, arguments: str = PIECE
    ) -> int:
        """Number of a new piece."""
        text = function_source(f"{name}({arguments})", says, lines, "@piece")
        self.pieces.append(self._planned(name, text, {**self.sampler.names, **(names or {})}))
        return len(self.pieces)

    def _row(self) -> int:
        self.size += STRIDE
        return self.size - STRIDE

    def _keep(self, stored: Stored, name: str = "") -> None:
        """Have the march leave a number, which has a name in the code."""
        if stored not in self.row_of:
            self.row_of[stored] = self._row()
        if name:
            self._named[name] = self.row_of[stored]

    # -- what flows ----------------------------------------------------------------------------

    def _part(self, part: PartCode) -> PartGraph:
        """Differentiate what is needed of a part, and plan its pieces."""
        i, sampler = part.part, self.sampler
        observed = [place for place, _ in self.observed if place.part == i]
        needed = [self.number_of(source) for source in sampler.sources if source.part == i]
        states = {path: Stored(i, "state", path) for path in sampler.carried[i]}
        following, here = dict(leaves(part.following)), dict(leaves(part.state))
        results = {state: following[path] for path, state in states.items()}
        behind: dict[Stored, Stored] = {}
        for each in dict.fromkeys([*needed, *observed]):
            if each.kind == "signals":
                node = part.signal(each.path)
                same = [state for state in states.values() if results[state] is node]
                behind |= {each: same[0]} if same else {}
                results |= {} if same else {each: node}
                self._keep(each)
        for path, state in states.items():
            self._keep(state, here[path].value)
        for source, number in zip((s for s in sampler.sources if s.part == i), needed, strict=True):
            self._keep(number, part.source(source))
        read = sampler.read(part)
        for name, number in part.outside.items():
            if name in read:
                self._keep(number, name)
        filled, rows = self._fill(part, results)
        flows = {
            state: {by for by in self.partials[state] if by in states.values()}
            for state in states.values()
        }
        groups = [
            Group(each, self._recurrence(part, each) if len(each) > 1 else None)
            for each in _strongly_connected(flows)
        ]
        return PartGraph(filled, rows, groups, needed, behind)

    def _fill(self, part: PartCode, results: Mapping[Stored, Node]) -> tuple[int | None, range]:
        """Piece that writes partial derivatives at known states into rows; places of these."""
        by = {name: Stored(part.part, "p", path) for name, path in part.parameters.items()}
        for name in {name for node in part.constants for name in node.reads} - by.keys():
            by[name] = Stored(part.part, "k", name)
        by |= {node.value: Stored(part.part, "state", path) for path, node in leaves(part.state)}
        for tap in part.taps:
            if tap.tap.delay:
                by[part.fraction(tap)] = Stored(part.part, "fraction", str(tap.number))
        by |= {part.source(source): self.number_of(source) for source in self.sampler.sources}
        active = sorted(part.code.reads(results.values()) & by.keys())
        found, order = Derivatives(part.code, [*results.values()], active), [*results]
        self.partials |= {each: {} for each in order}
        first, wanted = self.size, dict[int, Node]()
        for (out, inp), node in zip(found.entries, found.partials, strict=True):
            term = Term((), float(node.value)) if node.op == "number" else Term((self._row(),))
            self.partials[order[out]][by[active[inp]]] = term
            wanted |= dict.fromkeys(term.rows, node)
        if not wanted:
            return None, range(0)
        taken, nodes = {*part.code.taken, *found.taken}, [*wanted.values()]
        writer = Writer(taken, found.items, nodes, found.hints, straight=True)
        names = set(writer.needed)
        lines = self.sampler.ahead(part, names)
        lines += [
            f"{part.fraction(tap)} = fraction[{tap.number}]"
            for tap in part.taps
            if part.fraction(tap) in names
        ]
        inner = [f"{n} = flat[{self._named[n]} + m]" for n in sorted(names & self._named.keys())]
        # what only one side of a choice makes would carry its value from one sample to the next, as
        # far as a compiler can know, and the loop would not become vector instructions
        inner += [f"{name} = {value}" for name, value in writer.inner.items()]
        inner += writer.lines
        inner += [f"flat[{k} + m] = {t}" for k, t in zip(wanted, writer.texts, strict=True)]
        says = "Partial derivatives at known states."
        lines += ["for m in range(count):", *indented(inner)]
        number = self._piece(f"fill_{part.own.name}", says, lines, writer.functions)
        return number, range(first, self.size)

    def _link(self, name: str) -> dict[Stored, Term]:
        """Partial derivatives of a link: numbers, or refused."""
        link = self.model.links[name]
        assert link.equation is not None
        arguments = arguments_of(link.equation)
        code = Code(arguments, ruled=True)
        made = read(code, link.equation, {each: ex.name(each) for each in arguments})
        assert isinstance(made, Node)
        derived = Derivatives(code, [made], arguments)
        if any(each.op != "number" for each in derived.partials):
            raise InputError(
                f"Model {self.model.name}: the link {name} must be a sum of signals with "
                "constant factors; put anything else into a part's sample."
            )
        known = {source.signal: self.number_of(source) for source in link.sources}
        return {
            known[arguments[inp]]: Term((), float(node.value))
            for (_, inp), node in zip(derived.entries, derived.partials, strict=True)
        }

    def _recurrence(self, part: PartCode, group: Sequence[Stored]) -> int:
        """Piece that runs y[n+1] = A[n] y[n] + g[n] for some columns, PAIR of them side by side.

        Its second argument is the length of `lanes`, which it takes in place of ``whole``: for each
        state and all columns the places of inputs g and results y in ``flat``, and of y in
        ``tangent``; that vector it takes in place of ``params``.
        """
        states, abreast = range(len(group)), range(PAIR)
        ahead, loads, inner, after = [], {}, [], []
        for i in states:
            for j in abreast:
                for k, what in enumerate(("g", "d", "p")):
                    ahead.append(f"{what}{i}_{j} = lanes[{3 * i + k} * width + c + {j}]")
                ahead.append(f"y{i}_{j} = tangent[p{i}_{j}]")
                terms = [f"flat[g{i}_{j} + m]"]
                for l in states:
                    partial = self.partials[group[i]].get(group[l])
                    if partial is not None and partial.rows:
                        loads[f"a{i}_{l}"] = f"a{i}_{l} = flat[{partial.rows[0]} + m]"
                        terms.append(f"a{i}_{l} * y{l}_{j}")
                    elif partial is not None:
                        terms.append(f"{partial.scale!r} * y{l}_{j}")
                inner.append(f"n{i}_{j} = {_sum(terms)}")
                after += [f"flat[d{i}_{j} + count] = y{i}_{j}", f"tangent[p{i}_{j}] = y{i}_{j}"]
        inner += [f"flat[d{i}_{j} + m] = y{i}_{j}" for i in states for j in abreast]
        inner += [f"y{i}_{j} = n{i}_{j}" for i in states for j in abreast]
        body = [*ahead, "for m in range(count):", *indented([*loads.values(), *inner]), *after]
        head = PIECE.replace("first", "size").replace("whole", "lanes")
        return self._piece(
            f"recur_{part.own.name}_{group[0].path.replace('.', '_')}",
            f"Derivatives of {', '.join(state.path for state in group)}.",
            [
                f"width = size // {3 * len(group)}",
                f"for c in range(0, width, {PAIR}):",
                *indented(body),
            ],
            arguments=head.replace("params", "tangent"),
        )

    # -- where it starts -----------------------------------------------------------------------

    def starting(self, start: str) -> Starting:
        """Constants and states where a record begins at rest or settled; call it `generating`."""
        if start not in self._starting:
            self._starting[start] = self._started(start)
        return self._starting[start]

    def _started(self, start: str) -> Starting:
        codes = self.sampler.used
        code = Code(codes[0].code.taken, ruled=True)
        results: dict[Stored, Node] = {}
        by: dict[str, str] = {}
        outside = {"h": Stored(0, "h")}
        for part in codes:
            i, prefix = part.part, self.model.prefix(part.part)
            begun, value = part.begun(start)
            begins, states = dict(leaves(value)), dict(leaves(part.state))
            code.items += [*part.prologue.items, *begun.items]
            code.items += [Let(states[path].value, node) for path, node in begins.items()]
            code.items += part.code.items
            code.items += [
                Let(part.source(source), part.signal(source.signal))
                for source in self.sampler.sources
                if source.part == i
            ]
            for name in self.sampler.constants(part):
                results[Stored(i, "k", name)] = ex.name(name)
            for number in self.partials:
                if number[:2] == (i, "state"):
                    results[number] = begins[number.path]
            by |= {name: f"{prefix}{path}" for name, path in part.parameters.items()}
            outside |= {name: Stored(i, "p", path) for name, path in part.parameters.items()}
            outside |= {node.value: Stored(i, "given", path) for path, node in leaves(part.given)}
            for tap in part.taps:
                read = Stored(i, "input", tap.tap.signal)
                outside |= dict.fromkeys(part.tap_samples(tap), read)
                outside[part.fraction(tap)] = Stored(i, "fraction")
        outside |= {f"x_{name}": Stored(0, "input", name) for name in self.sampler.signals}
        arguments = sorted(code.reads(results.values()) & outside.keys())
        active = [each for each in arguments if each in by]
        derived = derived_function(
            f"{self.model.name}_start",
            f"Constants and states of {self.model.name} at the start.",
            arguments,
            code,
            [(" ".join(map(str, key)), node) for key, node in results.items()],
            [(each, each) for each in active],
            chained=True,
        )
        keys = [*results]
        moves = tuple((keys[out], by[active[inp]]) for out, inp in derived.entries)
        return Starting(tuple(outside[name] for name in arguments), moves, derived)


@generating
def graph_of(
    model: Model, signals: tuple[str, ...], options: tuple[Any, ...], observed: tuple[str, ...]
) -> Graph:
    """A model's structure for some observed signals, made once."""
    return Graph(model, signals, options, observed)


def _sum(terms: Sequence[str]) -> str:
    """Text of a sum, its parts beside each other: none waits for all before it."""
    half = len(terms) // 2
    return terms[0] if not half else f"({_sum(terms[:half])} + {_sum(terms[half:])})"


def _strongly_connected(flows: Mapping[Stored, set[Stored]]) -> Iterable[tuple[Stored, ...]]:
    """States in groups that wait for each other, each group behind those that it needs."""
    reach = {each: {each} for each in flows}
    for _ in flows:  # no way is longer
        for out in flows:
            reach[out].update(*(reach[inp] for inp in flows[out]))
    group = {
        each: tuple(other for other in flows if other in reach[each] and each in reach[other])
        for each in flows
    }
    order: TopologicalSorter[tuple[Stored, ...]] = TopologicalSorter()
    for each in flows:
        order.add(group[each], *({group[i] for i in flows[each]} - {group[each]}))
    return order.static_order()
