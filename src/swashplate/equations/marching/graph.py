"""Which derivative flows into which: the structure behind a model's Jacobian, and its pieces.

A column of the Jacobian is the derivative of every state by one parameter, over all samples. It
follows the linear recurrence ds[n+1] = A[n] ds[n] + b[n]. The partial derivatives A and b are known
once the states are (`fill` kernels, without a wait between samples); which of them are zero
whatever the numbers is known when the code is generated. So states fall into groups that wait for
each other (`recur` kernels: strongly connected components), each behind those that it needs.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from graphlib import TopologicalSorter
from typing import Any, NamedTuple

from swashplate.equations import expressions as ex
from swashplate.equations.adjoints import Derivatives, Derived, derived_function
from swashplate.equations.code import Code, Let, generating, leaves
from swashplate.equations.expressions import Node, text
from swashplate.equations.marching.march import Sampler, march_source, output_of
from swashplate.equations.marching.part import PartCode, Stored, rest_of, settled_of
from swashplate.equations.marching.pieces import PIECE, Planned, piece
from swashplate.equations.marching.rows import STRIDE
from swashplate.equations.marching.run import module
from swashplate.equations.model import Model, arguments_of
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


class PartGraph(NamedTuple):
    """A part: its partial derivatives and the order in which they are used."""

    code: PartCode
    entries: dict[str, dict[By, Entry]]
    """By result (``state.x``, ``signals.y``) and what it is derived by."""
    groups: list[Group]
    fill: int  # Piece that fills in partial derivatives and signals, -1 for none.
    signals: int  # Piece that computes signals alone which the march does not leave, -1 for none.
    aliases: dict[str, str]
    """Signals that are a state behind the sample, as far as derivatives go."""


Known = tuple[str, int, str]
"""Constant (``k``) or state (``state``) of a part, by its name or path."""


class Starting(NamedTuple):
    """Constants and states at the start with their derivatives, as a function of scalars."""

    arguments: tuple[tuple[str, int, str], ...]
    """What each argument is: kind, part, and path or signal."""
    moves: tuple[tuple[Known, str], ...]
    """What is derived, by which column: the last numbers that `derived` gives."""
    derived: Derived


class Graph:
    """A model's whole structure for some observed signals, and the pieces of its march."""

    def __init__(
        self,
        model: Model,
        signals: tuple[str, ...],
        options: tuple[Any, ...],
        observed: tuple[str, ...],
    ) -> None:
        self.model = model
        self.observed = [output_of(model, each) for each in observed]
        """What is observed, and whether as an integral."""
        self.sampler = Sampler(
            model, signals, options, [place for place, _ in self.observed], ruled=True
        )
        self.rows = 0  # Of numbers and partial derivatives together.
        self.stored: dict[Stored, int] = {}  # Rows of the numbers that the march leaves.
        self.values: dict[tuple[int, str], int] = {}
        """Row of each signal that the march does not leave, by part and path."""
        self._row_of: dict[str, int] = {}  # Row of each number by its name in the code.
        self.pieces: list[Planned] = []  # The march, made last, comes first.
        # part by part, so that the pieces of the first ones are the same whatever follows
        self.parts = [self._part(part) for part in self.sampler.used()]
        links = [place for place, _ in self.observed if place.kind == "link"]
        for place in links:
            self._row_for(place)
        rows = {each: _place(row, "n - first") for each, row in self.stored.items()}
        self.pieces.insert(0, self._planned("march", *march_source(model, signals, options, rows)))
        self.links = {place.path: self._factors(place.path) for place in links}
        """Partial derivatives of observed links by their sources."""
        self._starting: dict[str, Starting] = {}

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

    def _new_row(self) -> int:
        self.rows += 1
        return self.rows - 1

    def _row_for(self, stored: Stored, name: str = "") -> None:
        """Have the march leave a number, which has a name in the code."""
        if stored not in self.stored:
            self.stored[stored] = self._new_row()
        if name:
            self._row_of[name] = self.stored[stored]

    # -- scalar functions ----------------------------------------------------------------------

    def _observed(self, part: PartCode, kind: str) -> list[str]:
        """What of a part is observed."""
        places = [place for place, _ in self.observed if place.part == part.part]
        return [place.path for place in places if place.kind == kind]

    def _needed(self, part: PartCode) -> list[str]:
        """Signals of a part that other parts or links need."""
        return [s.signal for s in self.sampler.sources if s.part == part.part]

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
        found |= {part.fraction(t): By("tap", str(t.number)) for t in part.taps if t.tap.delay}
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
            and line.split(" = ")[0] not in self._row_of
        ]
        ahead += [
            f"{part.fraction(tap)} = fraction[{tap.number}]"
            for tap in part.taps
            if part.fraction(tap) in names
        ]
        here = sorted(names & self._row_of.keys())
        return ahead, [f"{name} = {_place(self._row_of[name], 'm')}" for name in here]

    # -- what flows ----------------------------------------------------------------------------

    def _part(self, part: PartCode) -> PartGraph:
        """Differentiate what is needed of a part, and plan its pieces."""
        following, here = dict(leaves(part.following)), dict(leaves(part.state))
        results = {f"state.{path}": following[path] for path in self._states(part)}
        states = [*results]
        watched = self._observed(part, "signals")
        wanted = dict.fromkeys([*self._needed(part), *watched])
        for signal in wanted:
            if f"state.{signal}" not in results or signal not in here:
                results[f"signals.{signal}"] = part.signal(signal)
        known = self._by(part)
        active = sorted(part.code.reads(results.values()) & known.keys())
        found, order = Derivatives(part.code, [*results.values()], active), [*results]
        keys = [(order[out], known[active[inp]]) for out, inp in found.entries]
        partials = dict(zip(keys, found.partials, strict=True))
        aliases = {
            signal: state.removeprefix("state.")
            for signal in wanted
            for state in states
            if results.get(f"signals.{signal}") is results[state]
        }
        self._keep(part, wanted, aliases)
        alone = self._values(part, list(dict.fromkeys(watched)))
        at_sample = {
            by.path
            for out, by in partials
            if by.kind == "state" and out.startswith("signals.") and out[8:] not in aliases
        }.union(self._observed(part, "state"), self._needed(part))
        aliases = {s: path for s, path in aliases.items() if path not in at_sample}
        for signal in aliases:
            partials = {k: node for k, node in partials.items() if k[0] != f"signals.{signal}"}
        entries: dict[str, dict[By, Entry]] = {}
        filled = self._fill(part, found, partials, entries)
        flows = {
            path: {by.path for by in entries.get(f"state.{path}", {}) if by.kind == "state"}
            for path in self._states(part)
            if f"state.{path}" in entries
        }
        groups = []
        for members in _strongly_connected(flows):
            others = [into for path, into in flows.items() if path not in members]
            elsewhere = [any(path in into for into in others) for path in members]
            after = tuple(
                path in aliases.values() and not read
                for path, read in zip(members, elsewhere, strict=True)
            )
            stored = tuple(
                path in at_sample or read or behind
                for path, read, behind in zip(members, elsewhere, after, strict=True)
            )
            group = Group(members, after, stored)
            if len(members) > 1:
                group.piece = self._recurrence(part, entries, group)
            groups.append(group)
        return PartGraph(part, entries, groups, filled, alone, aliases)

    def _keep(self, part: PartCode, wanted: Iterable[str], aliases: Mapping[str, str]) -> None:
        """Numbers of a part that the march leaves: states, inputs as they come, known signals."""
        names, read = dict(leaves(part.state)), self.sampler.read(part)
        for path in self._states(part):
            self._row_for(Stored(part.part, "state", path), names[path].value)
        for tap in part.taps:
            for j, name in enumerate(part.tap_samples(tap)):
                if name in read:
                    self._row_for(Stored(part.part, "tap", f"{tap.input}.{j}"), name)
        for name in part.own.input_types:
            signal = part.own.tap(name).signal
            if f"x_{signal}" in read and signal in self.sampler.signals:
                self._row_for(Stored(part.part, "input", name), f"x_{signal}")
        for source in self.sampler.sources:
            if source.part == part.part:
                kind = "state" if source.signal in names else "signals"
                self._row_for(Stored(part.part, kind, source.signal), part.source(source))
        for signal in wanted:
            # what sub-steps lead to is not computed again
            if signal in aliases or part.code.repeats:
                self._row_for(Stored(part.part, "signals", signal))

    def _values(self, part: PartCode, observed: Sequence[str]) -> int:
        """Piece that computes signals which the march does not leave, at known states."""
        late = [each for each in observed if Stored(part.part, "signals", each) not in self.stored]
        if not late:
            return -1
        nodes = [part.signal(signal) for signal in late]
        ahead, rows = self._arguments(part, part.code.reads(nodes))
        inner = [*rows, *lines_of(part.code, nodes, straight=True)]
        for signal, node in zip(late, nodes, strict=True):
            self.values[part.part, signal] = self._new_row()
            inner.append(f"{_place(self.values[part.part, signal], 'm')} = {text(node)}")
        return self._piece(
            f"values_{part.own.name}",
            f"Signals of {part.own.name} at known states.",
            [*ahead, "for m in range(count):", *indented(inner)],
        )

    def _factors(self, name: str) -> dict[str, float]:
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
        pairs = zip(derived.entries, derived.partials, strict=True)
        return {arguments[inp]: float(each.value) for (_, inp), each in pairs}

    def starting(self, start: str) -> Starting:
        """Constants and states where a record begins at rest or settled; call it `generating`."""
        if start not in self._starting:
            self._starting[start] = self._started(start)
        return self._starting[start]

    def _started(self, start: str) -> Starting:
        codes = [graph.code for graph in self.parts]
        code = Code(codes[0].code.taken, ruled=True)
        results: dict[Known, Node] = {}
        by: dict[str, str] = {}
        outside: dict[str, tuple[str, int, str]] = {"h": ("h", 0, "")}
        for part in codes:
            # what has no equation for a steady state has no state, and is always settled
            begun = (settled_of(part) if start == "steady" else None) or rest_of(part)
            begins, states = dict(leaves(begun.value)), dict(leaves(part.state))
            code.items += [*part.prologue.items, *begun.code.items]
            code.items += [Let(states[path].value, node) for path, node in begins.items()]
            code.items += part.code.items
            code.items += [
                Let(part.source(s), part.signal(s.signal))
                for s in self.sampler.sources
                if s.part == part.part
            ]
            results |= {
                ("k", part.part, name): ex.name(name) for name in self.sampler.constants(part)
            }
            results |= {("state", part.part, path): begins[path] for path in self._states(part)}
            prefix = self.model.prefix(part.part)
            by |= {name: f"{prefix}{path}" for name, path in part.parameters.items()}
            outside |= {name: ("p", part.part, path) for name, path in part.parameters.items()}
            for path, node in leaves(part.given):
                outside[node.value] = ("given", part.part, path)
            for tap in part.taps:
                found = ("signal", part.part, tap.tap.signal)
                outside |= dict.fromkeys(part.tap_samples(tap), found)
                outside[part.fraction(tap)] = ("zero", part.part, "")
        outside |= {f"x_{name}": ("signal", 0, name) for name in self.sampler.signals}
        arguments = sorted(code.reads(results.values()) & outside.keys())
        active = [each for each in arguments if each in by]
        named = [(" ".join(map(str, key)), node) for key, node in results.items()]
        derived = derived_function(
            f"{self.model.name}_start",
            f"Constants and states of {self.model.name} at the start.",
            arguments,
            code,
            named,
            [(each, each) for each in active],
            chained=True,
        )
        keys = [*results]
        moves = tuple((keys[out], by[active[inp]]) for out, inp in derived.entries)
        return Starting(tuple(outside[name] for name in arguments), moves, derived)

    # -- pieces --------------------------------------------------------------------------------

    def _recurrence(
        self, part: PartCode, entries: Mapping[str, Mapping[By, Entry]], group: Group
    ) -> int:
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
                    entry = entries[f"state.{group.states[i]}"].get(By("state", group.states[l]))
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
            f"recur_{part.own.name}_{group.states[0].replace('.', '_')}",
            f"Derivatives of {', '.join(group.states)}.",
            [
                f"for c in range(0, width, {PAIR}):",
                *indented([*ahead, "for m in range(count):", *indented([*loads.values(), *inner])]),
                *indented(behind),
            ],
            arguments=head.replace("params", "tangent"),
        )

    def _fill(
        self,
        part: PartCode,
        derivatives: Derivatives,
        partials: Mapping[tuple[str, By], Node],
        entries: dict[str, dict[By, Entry]],
    ) -> int:
        """Piece that writes partial derivatives, and signals, at known states into rows."""
        wanted: dict[int, Node] = {}
        # what moves constants, too, last: it is summed up elsewhere, the others lie side by side
        constants = [ex.name(name) for name in self.sampler.constants(part)]
        twice = {part.parameters.get(name, "") for name in part.prologue.reads(constants)}
        for key, partial in sorted(partials.items(), key=lambda each: each[0][1].path in twice):
            if partial.op == "number":
                entry = Entry(-1, float(partial.value))
            else:
                entry = Entry(self._new_row())
                wanted[entry.row] = partial
            entries.setdefault(key[0], {})[key[1]] = entry
        for (number, path), row in self.values.items():
            if number == part.part:
                wanted[row] = part.signal(path)
        if not wanted:
            return -1
        taken = {*part.code.taken, *derivatives.taken}
        nodes = [*wanted.values()]
        writer = Writer(taken, derivatives.items, nodes, derivatives.hints, straight=True)
        ahead, loads = self._arguments(part, writer.needed)
        # what only one side of a choice makes would carry its value from one sample to the next, as
        # far as a compiler can know, and the loop would not become vector instructions
        begun = [f"{name} = {value}" for name, value in writer.inner.items()]
        pairs = zip(wanted, writer.texts, strict=True)
        stores = [f"{_place(row, 'm')} = {made}" for row, made in pairs]
        return self._piece(
            f"fill_{part.own.name}",
            "Partial derivatives at known states.",
            [
                *ahead,
                "for m in range(count):",
                *indented([*loads, *begun, *writer.lines, *stores]),
            ],
            writer.functions,
        )


@generating
def graph_of(
    model: Model, signals: tuple[str, ...], options: tuple[Any, ...], observed: tuple[str, ...]
) -> Graph:
    """A model's structure for some observed signals, made once."""
    return Graph(model, signals, options, observed)


def _place(row: int, at: str) -> str:
    """Text of a number in a row of the block."""
    return f"flat[{row * STRIDE} + {at}]"


def _sum(terms: Sequence[str]) -> str:
    """Text of a sum, its parts beside each other: none waits for all before it."""
    half = len(terms) // 2
    return terms[0] if not half else f"({_sum(terms[:half])} + {_sum(terms[half:])})"


def _strongly_connected(flows: Mapping[str, set[str]]) -> list[tuple[str, ...]]:
    """States in groups that wait for each other, each group behind those that it needs."""
    reach = {each: {each} for each in flows}
    for _ in flows:  # no way is longer
        for out in flows:
            reach[out].update(*(reach[inp] for inp in flows[out] if inp in reach))
    group = {
        each: tuple(other for other in flows if other in reach[each] and each in reach[other])
        for each in flows
    }
    order: TopologicalSorter[tuple[str, ...]] = TopologicalSorter()
    for each in flows:
        order.add(group[each], *({group[i] for i in flows[each] if i in group} - {group[each]}))
    return list(order.static_order())
