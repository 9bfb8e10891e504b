"""Which derivative flows into which: the structure behind a model's Jacobian, and its pieces.

A column of the Jacobian is the derivative of every state by one parameter, over all samples. It
follows the linear recurrence ds[n+1] = A[n] ds[n] + b[n]. The partial derivatives A and b are known
once the states are (`fill` kernels, without a wait between samples); which of them are zero
whatever the numbers is known when the code is generated. So states fall into groups that wait for
each other (`recur` kernels: strongly connected components), each behind those that it needs.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from graphlib import TopologicalSorter
from typing import Any, NamedTuple

from swashplate.equations import expressions as ex
from swashplate.equations.adjoints import Derivatives, Derived, derived_function
from swashplate.equations.code import Code, Let, generating, leaves
from swashplate.equations.expressions import Node, text
from swashplate.equations.marching.march import Sampler, march_source, output_of
from swashplate.equations.marching.part import PartCode, Start, Stored, rest_of, settled_of
from swashplate.equations.marching.pieces import PIECE, Planned, piece
from swashplate.equations.marching.rows import STRIDE
from swashplate.equations.marching.run import module
from swashplate.equations.model import Model, Source, arguments_of
from swashplate.equations.reading import read
from swashplate.equations.writing import Writer, function_source, indented, lines_of
from swashplate.errors import InputError

PAIR = 2
"""Columns of a generated recurrence side by side."""
WORD = re.compile(r"\b[A-Za-z_]\w*")


class Entry(NamedTuple):
    """A partial derivative: a row of the block, or a number that is the same at every sample."""

    row: int
    value: float = 0.0


class By(NamedTuple):
    """What something is differentiated by."""

    kind: str  # ``p``, ``k``, ``state``, ``tap`` or ``signal``.
    path: str  # Of parameter or state; name of a constant; number of a tap; signal of another part.
    part: int = -1  # The other part.


@dataclass
class Group:
    """States of a part that wait for each other, in one recurrence."""

    states: tuple[str, ...]
    after: tuple[bool, ...]
    """Whether a state's row holds the derivative behind the sample, as its signal needs it."""
    stored: tuple[bool, ...]  # Whether anyone reads a state's row.
    piece: int = -1  # Piece that runs the recurrence; -1 where a kernel does, for one state.


@dataclass
class Component:
    """States of a part that share no derivative with its others: one piece fills them in."""

    piece: int
    groups: list[Group]
    signals: bool = False  # Whether the piece fills in signals and their derivatives as well.


@dataclass
class PartGraph:
    """A part: its partial derivatives and the order in which they are used."""

    part: int
    entries: dict[tuple[str, By], Entry] = field(default_factory=dict)
    """By result (``state.x``, ``signals.y``) and what it is derived by."""
    components: list[Component] = field(default_factory=list)
    signal_piece: int = -1  # Piece that fills in the derivatives of signals, -1 for none.
    value_piece: int = -1
    """Piece that computes signals which the march does not leave, -1 for none."""
    aliases: dict[str, str] = field(default_factory=dict)
    """Signals that are a state behind the sample, as far as derivatives go."""
    constants: set[tuple[str, str]] = field(default_factory=set)
    """Constant and parameter that it depends on."""
    delays: dict[int, str] = field(default_factory=dict)  # Path of the delay of each tap.
    started: set[tuple[str, str]] = field(default_factory=set)
    """State and parameter that it depends on at the start."""


class Starting(NamedTuple):
    """What is known of a part at the start, with its derivatives, as a function of scalars.

    Results are the constants that a sample reads (``k``), the states (``state``), and the signals
    that other parts need (``signal``).
    """

    results: tuple[tuple[str, str], ...]  # Kind and name of each.
    arguments: tuple[str, ...]
    by: tuple[By, ...]
    """What each input of `derived` is: a parameter, or a signal of a part before."""
    derived: Derived

    def entries(self) -> Iterator[tuple[tuple[str, str], By]]:
        """Results, each with what it is differentiated by."""
        for out, inp in self.derived.entries:
            yield self.results[out], self.by[inp]


@dataclass(eq=False)
class Graph:
    """A model's whole structure."""

    parts: list[PartGraph]
    stored: dict[Stored, int]  # Rows of the numbers that the march leaves in the block.
    rows: int  # Rows of numbers and partial derivatives together.
    links: dict[str, dict[str, float]]  # Partial derivatives of observed links by their sources.
    observed: list[tuple[Stored, bool]]  # What is observed, and whether as an integral.
    values: dict[tuple[int, str], int]
    """Row of each signal that the march does not leave, by part and path."""
    sources: list[Source]  # Signals that other parts or observed links need.
    starts: list[dict[str, Starting]]
    """What is known of each part where it starts at rest and, if it can, settled."""
    codes: list[PartCode]  # The parts' code.
    signals: tuple[str, ...]  # External signals that are given as records.
    pieces: tuple[Planned, ...]  # The march, and what the parts' graphs name by number.


@generating
def graph_of(
    model: Model, signals: tuple[str, ...], options: tuple[Any, ...], observed: tuple[str, ...]
) -> Graph:
    """A model's structure for some observed signals, and the pieces of its march."""
    return _Builder(model, signals, options, observed).build()


class _Builder:
    def __init__(
        self,
        model: Model,
        signals: tuple[str, ...],
        options: tuple[Any, ...],
        observed: tuple[str, ...],
    ) -> None:
        self.model, self.signals, self.options = model, signals, options
        self.observed = [output_of(model, each) for each in observed]
        self.sampler = Sampler(
            model, signals, options, [place for place, _ in self.observed], ruled=True
        )
        self.parts = self.sampler.used()
        self.pieces: list[Planned] = []  # The march, made last, comes first.
        self.stored: dict[Stored, int] = {}
        self.row_of: dict[str, int] = {}  # Row of each number by its name in the code.
        self.rows = 0
        self.graphs: list[PartGraph] = []
        self.starts: list[dict[str, Starting]] = []
        self.found: list[tuple[Derivatives, dict[tuple[str, By], Node]]] = []
        """What was differentiated of each part, and its partial derivatives."""
        self.values: dict[tuple[int, str], int] = {}

    def build(self) -> Graph:
        for part in self.parts:
            self._begin(part)
        # part by part, so that the pieces of the first ones are the same whatever follows
        for graph, part in zip(self.graphs, self.parts, strict=True):
            self._keep(graph, part)
            self._values(graph, part)
            self._part(graph, part)
        for place, _ in self.observed:
            if place.kind == "link":
                self._row_for(place)
        rows = {each: _place(row, "n - first") for each, row in self.stored.items()}
        text, names = march_source(self.model, self.signals, self.options, rows)
        march = self._planned("march", text, names)
        return Graph(
            self.graphs,
            self.stored,
            self.rows,
            self._links(),
            self.observed,
            self.values,
            list(self.sampler.sources),
            self.starts,
            self.parts,
            self.signals,
            (march, *self.pieces),
        )

    def _planned(self, name: str, text: str, names: Mapping[str, Any]) -> Planned:
        """A piece, in a module of its own."""
        file = f"{self.model.name}_{name}"
        return Planned(lambda: module(file, text, {"piece": piece, **names})[name])

    def _piece(
        self,
        name: str,
        says: str,
        lines: Sequence[str],
        names: Mapping[str, Any],
        arguments: str = PIECE,
    ) -> int:
        """Number of a new piece."""
        text = function_source(f"{name}({arguments})", says, lines, "@piece")
        self.pieces.append(self._planned(name, text, {**self.sampler.names, **names}))
        return len(self.pieces)

    def _new_row(self) -> int:
        self.rows += 1
        return self.rows - 1

    def _row_for(self, stored: Stored) -> int:
        """Row in which the march leaves a number."""
        if stored not in self.stored:
            self.stored[stored] = self._new_row()
        return self.stored[stored]

    # -- scalar functions ----------------------------------------------------------------------

    def _observed(self, part: PartCode, kind: str) -> list[str]:
        """What of a part is observed."""
        places = [place for place, _ in self.observed if place.part == part.part]
        return [place.path for place in places if place.kind == kind]

    def _signals(self, part: PartCode) -> list[str]:
        """Signals of a part whose derivatives somebody needs."""
        needed = [s.signal for s in self.sampler.sources if s.part == part.part]
        return list(dict.fromkeys([*needed, *self._observed(part, "signals")]))

    def _results(self, part: PartCode) -> dict[str, Node]:
        """States behind the sample and signals that are needed, by result."""
        following = dict(leaves(part.following))
        made = {f"state.{path}": following[path] for path in self._states(part)}
        for signal in self._signals(part):
            if f"state.{signal}" not in made or signal not in dict(leaves(part.state)):
                made[f"signals.{signal}"] = part.signal(signal)
        return made

    def _states(self, part: PartCode) -> list[str]:
        carried = self.sampler.carried[part.part]
        return list(dict.fromkeys([*carried, *self._observed(part, "state")]))

    def _by(self, part: PartCode) -> dict[str, By]:
        """What a part's results may be differentiated by, by the name in its code."""
        found = {name: By("p", path) for name, path in part.parameters.items()}
        if "k" in part.known:
            every = {each for _, node in leaves(part.known["k"]) for each in node.reads}
            found |= {name: By("k", name) for name in every if name not in found}
        found |= {node.value: By("state", path) for path, node in leaves(part.state)}
        for tap in part.taps:
            if tap.tap.delay:
                found[part.fraction(tap)] = By("tap", str(tap.number))
        for source in self.sampler.sources:
            found[part.source(source)] = By("signal", source.signal, source.part)
        return found

    def _arguments(self, part: PartCode, read: Iterable[str]) -> tuple[list[str], list[str]]:
        """Lines ahead of a loop over known samples, and those at the head of its body."""
        names = set(read)
        lines = self.sampler.ahead([part])
        made = [line for line in lines if "= params[" not in line and "= given[" not in line]
        wanted = names | {name for line in made for name in WORD.findall(line)}
        ahead = [
            line
            for line in lines
            if (line in made or line.split(" = ")[0] in wanted)
            and line.split(" = ")[0] not in self.row_of
        ]
        ahead += [
            f"{part.fraction(tap)} = fraction[{tap.number}]"
            for tap in part.taps
            if part.fraction(tap) in names
        ]
        rows = [
            f"{name} = {_place(self.row_of[name], 'm')}"
            for name in sorted(names)
            if name in self.row_of
        ]
        return ahead, rows

    # -- what flows ----------------------------------------------------------------------------

    def _begin(self, part: PartCode) -> None:
        """Differentiate what is needed of a part, and find its aliases."""
        graph = PartGraph(part.part)
        self.graphs.append(graph)
        graph.delays = {tap.number: tap.tap.delay for tap in part.taps if tap.tap.delay}
        results, known = self._results(part), self._by(part)
        nodes, order = [*results.values()], [*results]
        active = sorted(part.code.reads(nodes) & known.keys())
        found = Derivatives(part.code, nodes, active)
        keys = [(order[out], known[active[inp]]) for out, inp in found.entries]
        self.found.append((found, dict(zip(keys, found.partials, strict=True))))
        states = [each for each in results if each.startswith("state.")]
        for signal in [each for each in results if each.startswith("signals.")]:
            for state in states:
                if results[signal] is results[state]:
                    graph.aliases[signal.removeprefix("signals.")] = state.removeprefix("state.")

    def _keep(self, graph: PartGraph, part: PartCode) -> None:
        """Numbers of a part that the march leaves: states, inputs as they come, known signals."""
        names = dict(leaves(part.state))
        for path in self._states(part):
            self._store(Stored(part.part, "state", path), names[path].value)
        read = self.sampler.read(part)
        for tap in part.taps:
            for j, name in enumerate(part.tap_samples(tap)):
                if name in read:
                    self._store(Stored(part.part, "tap", f"{tap.input}.{j}"), name)
        for name in part.own.input_types:
            signal = part.own.tap(name).signal
            if f"x_{signal}" in read and signal in self.signals:
                self._store(Stored(part.part, "input", name), f"x_{signal}")
        for source in self.sampler.sources:
            if source.part == part.part:
                stored = Stored(part.part, "signals", source.signal)
                if source.signal in names:
                    stored = stored._replace(kind="state")
                self._store(stored, part.source(source))
        for signal in self._signals(part):
            # what sub-steps lead to is not computed again
            known = signal in graph.aliases or part.code.repeats
            if known and (part.part, signal) not in self.values:
                stored = Stored(part.part, "signals", signal)
                if stored not in self.stored:
                    self._store(stored, f"signal {part.part} {signal}")

    def _store(self, stored: Stored, name: str) -> None:
        self.row_of[name] = self._row_for(stored)

    def _values(self, graph: PartGraph, part: PartCode) -> None:
        """Piece that computes signals which the march does not leave, at known states."""
        asked = dict.fromkeys(self._observed(part, "signals"))
        late = [each for each in asked if Stored(part.part, "signals", each) not in self.stored]
        if not late:
            return
        nodes = [part.signal(signal) for signal in late]
        ahead, rows = self._arguments(part, part.code.reads(nodes))
        inner = [*rows, *lines_of(part.code, nodes, straight=True)]
        for signal, node in zip(late, nodes, strict=True):
            self.values[part.part, signal] = self._new_row()
            inner.append(f"{_place(self.values[part.part, signal], 'm')} = {text(node)}")
        graph.value_piece = self._piece(
            f"values_{part.own.name}",
            f"Signals of {part.own.name} at known states.",
            [*ahead, "for m in range(count):", *indented(inner)],
            {},
        )

    def _part(self, graph: PartGraph, part: PartCode) -> None:
        own = part.own.name
        derivatives, partials = self.found[self.graphs.index(graph)]

        def fill(name: str, outs: Iterable[str], values: Mapping[int, Node]) -> int:
            wanted = {*outs}
            some = {key: node for key, node in partials.items() if key[0] in wanted}
            return self._fill(graph, part, name, derivatives, some, values)

        signals = [
            each
            for each in self._results(part)
            if each.startswith("signals.") and each.removeprefix("signals.") not in graph.aliases
        ]
        states = list(dict.fromkeys(out for out, _ in partials if out.startswith("state.")))
        flows = {
            out: {f"state.{by.path}" for each, by in partials if each == out and by.kind == "state"}
            & {*states}
            for out in states
        }
        components = _weakly_connected(states, flows)
        # what leads to states leads to signals, sub-steps above all: once for both
        together = part.code.repeats or (bool(signals) and len(components) == 1)
        if together:
            components = [states]
            values = {
                row: part.signal(path)
                for (number, path), row in self.values.items()
                if number == part.part
            }
            filled = fill(own, [*states, *signals], values)
        elif signals:
            graph.signal_piece = fill(f"{own}_signals", signals, {})
        at_sample = {
            by.path
            for out, by in graph.entries
            if out.startswith("signals.") and by.kind == "state"
        } | {*self._observed(part, "state")}
        at_sample |= {s.signal for s in self.sampler.sources if s.part == part.part}
        graph.aliases = {s: path for s, path in graph.aliases.items() if path not in at_sample}
        for c, outs in enumerate(components):
            name = f"{own}_{c}" if len(outs) < len(states) else own
            if not together:
                filled = fill(name, outs, {})
            groups = []
            for members in _strongly_connected(outs, flows):
                bare = tuple(each.removeprefix("state.") for each in members)
                elsewhere = {
                    path
                    for path in bare
                    if any(f"state.{path}" in flows[out] for out in outs if out not in members)
                }
                after = tuple(
                    path in graph.aliases.values() and path not in elsewhere for path in bare
                )
                stored = tuple(
                    path in at_sample or path in elsewhere or behind
                    for path, behind in zip(bare, after, strict=True)
                )
                groups.append(Group(bare, after, stored))
                if len(bare) > 1:
                    groups[-1].piece = self._recurrence(graph, f"{own}_{bare[0]}", groups[-1])
            graph.components.append(Component(filled, groups, together))
        starts = {"rest": self._starting(part, rest_of(part))}
        settled = settled_of(part)
        if settled is not None:
            starts["steady"] = self._starting(part, settled)
        self.starts.append(starts)
        for each in starts.values():
            for (kind, name), by in each.entries():
                if kind == "k":
                    graph.constants.add((name, by.path))
                elif kind == "state" and by.kind == "p":
                    graph.started.add((name, by.path))

    def _starting(self, part: PartCode, start: Start) -> Starting:
        """Constants, states and signals of a part at the start, with their derivatives."""
        begins, states = dict(leaves(start.value)), dict(leaves(part.state))
        code = Code(part.code.taken, ruled=True)
        code.items = [*part.prologue.items, *start.code.items]
        code.items += [Let(states[path].value, node) for path, node in begins.items()]
        code.items += part.code.items
        results = {("k", name): ex.name(name) for name in self.sampler.constants(part)}
        results |= {("state", path): begins[path] for path in self._states(part)}
        results |= {
            ("signal", s.signal): part.signal(s.signal)
            for s in self.sampler.sources
            if s.part == part.part
        }
        known = {name: by for name, by in self._by(part).items() if by.kind in ("p", "signal")}
        given = {"h", *map(part.fraction, part.taps), *(n.value for _, n in leaves(part.given))}
        outside = given.union(known, *map(part.tap_samples, part.taps))
        read = code.reads(results.values())
        arguments = sorted(each for each in read if each in outside or each.startswith("x_"))
        active = [each for each in arguments if each in known]
        named = [(f"{kind} {name}", node) for (kind, name), node in results.items()]
        name = f"{part.own.name}_start"
        says = f"Constants, states and signals of {part.own.name} at the start."
        by = [(each, each) for each in active]
        derived = derived_function(name, says, arguments, code, named, by, chained=True)
        return Starting((*results,), (*arguments,), tuple(known[a] for a in active), derived)

    def _links(self) -> dict[str, dict[str, float]]:
        """Partial derivatives of observed links: numbers, or refused."""
        found: dict[str, dict[str, float]] = {}
        for place, _ in self.observed:
            if place.kind != "link":
                continue
            link = self.model.links[place.path]
            assert link.equation is not None
            arguments = arguments_of(link.equation)
            code = Code(arguments, ruled=True)
            made = read(code, link.equation, {each: ex.name(each) for each in arguments})
            assert isinstance(made, Node)
            derived = Derivatives(code, [made], arguments)
            if any(each.op != "number" for each in derived.partials):
                raise InputError(
                    f"Model {self.model.name}: the link {link.name} must be a sum of signals with "
                    "constant factors; put anything else into a part's sample."
                )
            found[link.name] = {
                arguments[inp]: float(each.value)
                for (_, inp), each in zip(derived.entries, derived.partials, strict=True)
            }
        return found

    # -- pieces --------------------------------------------------------------------------------

    def _recurrence(self, graph: PartGraph, name: str, group: Group) -> int:
        """Piece that runs y[n+1] = A[n] y[n] + g[n] for some columns, PAIR of them side by side.

        Its second argument is the number of columns. In place of ``whole`` it takes, for each state
        and all columns, the places of inputs g and results in ``flat`` and of y in ``tangent``; and
        that vector in place of ``params``.
        """
        states, abreast = range(len(group.states)), range(PAIR)
        ahead, inner, behind, loads = [], [], [], {}
        for i in states:
            for j in abreast:
                for k, what in enumerate(("g", "d", "p")):
                    if what != "d" or group.stored[i]:
                        ahead.append(f"{what}{i}_{j} = columns[{3 * i + k} * width + c + {j}]")
                ahead.append(f"y{i}_{j} = tangent[p{i}_{j}]")
                behind.append(f"tangent[p{i}_{j}] = y{i}_{j}")
                terms = [f"flat[g{i}_{j} + m]"]
                for l in states:
                    by = By("state", group.states[l])
                    entry = graph.entries.get((f"state.{group.states[i]}", by))
                    if entry is not None and entry.row >= 0:
                        loads[f"a{i}_{l}"] = f"a{i}_{l} = {_place(entry.row, 'm')}"
                        terms.append(f"a{i}_{l} * y{l}_{j}")
                    elif entry is not None:
                        terms.append(f"{entry.value!r} * y{l}_{j}")
                inner.append(f"n{i}_{j} = {_sum(terms)}")
        for i in (i for i in states if group.stored[i]):
            shown = "n" if group.after[i] else "y"
            inner += [f"flat[d{i}_{j} + m] = {shown}{i}_{j}" for j in abreast]
        inner += [f"y{i}_{j} = n{i}_{j}" for i in states for j in abreast]
        head = PIECE.replace("first", "width").replace("whole", "columns")
        return self._piece(
            f"recur_{name.replace('.', '_')}",
            f"Derivatives of {', '.join(group.states)}.",
            [
                f"for c in range(0, width, {PAIR}):",
                *indented([*ahead, "for m in range(count):", *indented([*loads.values(), *inner])]),
                *indented(behind),
            ],
            {},
            head.replace("params", "tangent"),
        )

    def _fill(
        self,
        graph: PartGraph,
        part: PartCode,
        name: str,
        derivatives: Derivatives,
        partials: Mapping[tuple[str, By], Node],
        values: Mapping[int, Node],
    ) -> int:
        """Piece that writes partial derivatives, and values, at known states into rows."""
        rows = {}
        # what moves constants, too, last: it is summed up elsewhere, the others lie side by side
        constants = [ex.name(name) for name in self.sampler.constants(part)]
        twice = {part.parameters.get(name, "") for name in part.prologue.reads(constants)}
        for key, partial in sorted(partials.items(), key=lambda each: each[0][1].path in twice):
            if partial.op == "number":
                graph.entries[key] = Entry(-1, float(partial.value))
            else:
                rows[key] = self._new_row()
                graph.entries[key] = Entry(rows[key])
        if not rows and not values:
            return -1
        wanted = [*(partials[key] for key in rows), *values.values()]
        taken = {*part.code.taken, *derivatives.taken}
        writer = Writer(taken, derivatives.items, wanted, derivatives.hints, straight=True)
        ahead, loads = self._arguments(part, writer.needed)
        # what only one side of a choice makes would carry its value from one sample to the next, as
        # far as a compiler can know, and the loop would not become vector instructions
        begun = [f"{name} = {value}" for name, value in writer.inner.items()]
        stores = [
            f"{_place(row, 'm')} = {made}"
            for row, made in zip([*rows.values(), *values], writer.texts, strict=True)
        ]
        return self._piece(
            f"fill_{name}",
            "Partial derivatives at known states.",
            [
                *ahead,
                "for m in range(count):",
                *indented([*loads, *begun, *writer.lines, *stores]),
            ],
            writer.functions,
        )


def _place(row: int, at: str) -> str:
    """Text of a number in a row of the block."""
    return f"flat[{row * STRIDE} + {at}]"


def _sum(terms: Sequence[str]) -> str:
    """Text of a sum, its parts beside each other: none waits for all before it."""
    half = len(terms) // 2
    return terms[0] if not half else f"({_sum(terms[:half])} + {_sum(terms[half:])})"


def _weakly_connected(states: Sequence[str], flows: Mapping[str, set[str]]) -> list[list[str]]:
    """States in groups that share no derivative."""
    group = {each: frozenset((each,)) for each in states}
    for out, inputs in flows.items():
        for inp in inputs:
            merged = group[out] | group[inp]
            group |= dict.fromkeys(merged, merged)
    return [[each for each in states if each in some] for some in dict.fromkeys(group.values())]


def _strongly_connected(states: Sequence[str], flows: Mapping[str, set[str]]) -> list[list[str]]:
    """States in groups that wait for each other, each group behind those that it needs."""
    reach = {each: {each} for each in states}
    for _ in states:  # no way is longer
        for out in states:
            reach[out].update(*(reach[inp] for inp in flows[out] if inp in reach))
    group = {
        each: tuple(other for other in states if other in reach[each] and each in reach[other])
        for each in states
    }
    order: TopologicalSorter[tuple[str, ...]] = TopologicalSorter()
    for each in states:
        order.add(group[each], *({group[i] for i in flows[each] if i in group} - {group[each]}))
    return [list(members) for members in order.static_order()]
