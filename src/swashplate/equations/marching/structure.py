"""Which derivative flows into which: the structure behind a model's Jacobian, and its pieces.

A column of the Jacobian is the derivative of every state by one parameter, over all samples. It
follows the linear recurrence ds[n+1] = A[n] ds[n] + b[n]. The partial derivatives A and b are known
once the states are (`fill` kernels, without a wait between samples); which of them are zero
whatever the numbers is known when the code is generated. So states fall into groups that wait for
each other (strongly connected components, a `recurrence` each), behind those that they need.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from graphlib import TopologicalSorter
from itertools import product
from typing import Any, NamedTuple

from swashplate.equations import graph
from swashplate.equations.code_generation.functions import generating
from swashplate.equations.code_generation.gradients import Derived, Gradients, derived_function
from swashplate.equations.code_generation.printing import function_source, indented
from swashplate.equations.code_generation.scheduling import all_vector
from swashplate.equations.code_generation.values import leaves
from swashplate.equations.declaration import JIT_OFF
from swashplate.equations.graph import Node, names_in, rewritten
from swashplate.equations.keeping import kept, key_of
from swashplate.equations.marching.kernels import PIECE
from swashplate.equations.marching.march import Sampler, march_source, output_of
from swashplate.equations.marching.part_code import PartCode, SignalId
from swashplate.equations.marching.rows import STRIDE
from swashplate.equations.marching.run import PlannedPiece
from swashplate.equations.model import Model, SignalSource
from swashplate.errors import InputError

Moved = tuple[SignalId, str]
"""A number, and the column that it is derived by."""


class Term(NamedTuple):
    """A product of rows of the block and a number: a partial derivative, a derivative, or both."""

    rows: tuple[int, ...] = ()  # First place of each.
    scale: float = 1.0
    slot: Moved | None = None
    """A further factor, known only with the parameters."""

    def times(self, other: Term) -> Term:
        """The product of both."""
        assert self.slot is None or other.slot is None
        return Term(self.rows + other.rows, self.scale * other.scale, self.slot or other.slot)


class Group(NamedTuple):
    """States of a part that wait for each other, in one recurrence."""

    states: tuple[SignalId, ...]
    factors: list[int]  # Places of their partial derivatives by each other.
    piece: int  # See `recurrence`.


class PartStructure(NamedTuple):
    """What is done for a part behind the march."""

    part: int
    fill: int | None  # Piece that fills in its partial derivatives.
    rows: range  # Places of these.
    groups: list[Group]
    needed: list[SignalId]  # Signals that other parts or links need.
    behind: dict[SignalId, SignalId]  # Signals that equal a state at the next sample.


class Starting(NamedTuple):
    """Constants and states at the start with their derivatives, as a function of scalars."""

    arguments: tuple[SignalId, ...]
    moves: tuple[Moved, ...]
    """What is derived, by which column: the last numbers that `derived` gives."""
    derived: Derived


class Facts(NamedTuple):
    """What follows from a model's equations for some observed signals: plain data."""

    size: int
    """Of the block; its first row is for what nobody reads."""
    row_of: dict[SignalId, int]
    """First place of each number that the march leaves in the block."""
    partials: dict[SignalId, dict[SignalId, Term]]
    """Of each result (signal, or state at the next sample) its partial derivatives by parameters
    (``p``), constants (``k``), places of taps (``fraction``), states and signals."""
    pieces: list[PlannedPiece]
    """The march comes first."""
    parts: list[PartStructure]
    """Parts that are needed."""


@dataclass(frozen=True, eq=False)
class Structure:
    """A model's whole structure for some observed signals, and the pieces of its march."""

    model: Model
    signals: tuple[str, ...]
    """External ones that are given as records."""
    options: tuple[Any, ...]
    outputs: tuple[str, ...]
    """Signals that are observed."""
    facts: Facts

    @cached_property
    def observed(self) -> list[tuple[SignalId, bool]]:
        """What is observed, and whether as an integral."""
        return [output_of(self.model, each) for each in self.outputs]

    def starting(self, start: str) -> Starting:
        """Constants and states where a record begins at rest or settled; within `generating`."""
        if start not in self._starting:
            model, asked = self.model, (self.signals, self.options, self.outputs)
            self._starting[start] = kept(
                f"{model.name}_start",
                (key_of(model), *asked, start),
                lambda: _structured(model, *asked).started(start),
            )
        return self._starting[start]

    @cached_property
    def _starting(self) -> dict[str, Starting]:
        return {}


@generating
def structure_of(
    model: Model, signals: tuple[str, ...], options: tuple[Any, ...], observed: tuple[str, ...]
) -> Structure:
    """A model's structure for some observed signals, made once."""
    facts = kept(
        f"{model.name}_jacobian",
        (key_of(model), signals, options, observed),
        lambda: _structured(model, signals, options, observed).facts,
    )
    return Structure(model, signals, options, observed, facts)


@generating
def _structured(
    model: Model, signals: tuple[str, ...], options: tuple[Any, ...], observed: tuple[str, ...]
) -> _Structuring:
    """The equations of a model, read and differentiated."""
    return _Structuring(model, signals, options, observed)


class _Structuring:
    """Reads a model's equations, and finds out what flows into what."""

    def __init__(
        self,
        model: Model,
        signals: tuple[str, ...],
        options: tuple[Any, ...],
        observed: tuple[str, ...],
    ) -> None:
        self.model = model
        self.observed = [output_of(model, each)[0] for each in observed]
        self.sampler = Sampler(model, signals, options, self.observed)
        self.size = STRIDE
        self.row_of: dict[SignalId, int] = {}
        self._named: dict[str, int] = {}  # Place of each number's row by its name in the code.
        self.partials: dict[SignalId, dict[SignalId, Term]] = {}
        self.pieces: list[PlannedPiece] = []
        self._constants: dict[int, dict[Node, str]] = {}
        """By part, what follows from parameters alone, with its names."""
        # part by part, so that the pieces of the first ones are the same whatever follows
        self.parts = [self._part(part) for part in self.sampler.used]
        for place in self.observed:
            if place.kind == "link":
                self._keep(place)
                self.partials[place] = self._link(place)
        left = {each: f"flat[{row} + n - first]" for each, row in self.row_of.items()}
        text = march_source(model, signals, options, left)
        self.pieces.insert(0, PlannedPiece(f"{model.name}_march", "march", text))

    @property
    def facts(self) -> Facts:
        """What was found out."""
        return Facts(self.size, self.row_of, self.partials, self.pieces, self.parts)

    def signal_id_of(self, source: SignalSource) -> SignalId:
        """A signal of a part, or of its state."""
        state = source.signal in dict(leaves(self.sampler.parts[source.part].state))
        return SignalId(source.part, "state" if state else "signals", source.signal)

    def _row(self) -> int:
        self.size += STRIDE
        return self.size - STRIDE

    def _keep(self, stored: SignalId, name: str = "") -> None:
        """Have the march leave a number, which has a name in the code."""
        if stored not in self.row_of:
            self.row_of[stored] = self._row()
        if name:
            self._named[name] = self.row_of[stored]

    # -- what flows ----------------------------------------------------------------------------

    def _part(self, part: PartCode) -> PartStructure:
        """Differentiate what is needed of a part, and plan its pieces."""
        i, sampler = part.part, self.sampler
        observed = [place for place in self.observed if place.part == i]
        needed = [self.signal_id_of(source) for source in sampler.sources if source.part == i]
        states = {path: SignalId(i, "state", path) for path in sampler.carried[i]}
        following, here = dict(leaves(part.following)), dict(leaves(part.state))
        results = {state: following[path] for path, state in states.items()}
        behind: dict[SignalId, SignalId] = {}
        for each in dict.fromkeys([*needed, *observed]):
            if each.kind == "signals":
                node = part.signal(each.path)
                same = [state for state in states.values() if results[state] is node]
                if same:
                    behind[each] = same[0]
                else:
                    results[each] = node
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
            state: [by for by in self.partials[state] if by in states.values()]
            for state in states.values()
        }
        groups = []
        for group in _strongly_connected(flows):
            none = Term((), 0.0)
            own = [[self.partials[into].get(by, none) for by in group] for into in group]
            pattern = tuple(tuple(None if t.rows else t.scale for t in row) for row in own)
            factors = [place for row in own for term in row for place in term.rows]
            self.pieces.append(recurrence(pattern))
            groups.append(Group(group, factors, len(self.pieces)))
        return PartStructure(i, filled, rows, groups, needed, behind)

    def _fill(self, part: PartCode, results: Mapping[SignalId, Node]) -> tuple[int | None, range]:
        """Piece that writes partial derivatives at known states into rows; places of these."""
        i, ends = part.part, [*results.values()]
        by: dict[Node, SignalId] = {
            graph.name(name): SignalId(i, "p", path) for name, path in part.parameters.items()
        }
        _, known = self.sampler.ahead(part, ends)
        self._constants[i] = {node: known[node] for node in part.ahead(ends)}
        by |= {node: SignalId(i, "k", name) for node, name in self._constants[i].items()}
        by |= {node: SignalId(i, "state", path) for path, node in leaves(part.state)}
        for tap in part.taps:
            if tap.tap.delay:
                by[graph.name(part.fraction(tap))] = SignalId(i, "fraction", str(tap.number))
        for source in self.sampler.sources:
            by[graph.name(part.source(source))] = self.signal_id_of(source)
        found, order, moving = Gradients(ends, [*by]), [*results], [*by.values()]
        self.partials |= {each: {} for each in order}
        first, wanted = self.size, dict[int, Node]()
        for (out, inp), node in found.partials.items():
            term = Term((), float(node.value)) if node.op == "number" else Term((self._row(),))
            self.partials[order[out]][moving[inp]] = term
            wanted |= dict.fromkeys(term.rows, node)
        if not wanted:
            return None, range(0)
        nodes = [*wanted.values()]
        ahead, known = self.sampler.ahead(part, nodes)
        hints = found.hints([each.path for each in order], [each.path for each in moving], {})
        # a loop without branches becomes vector instructions; plain Python refuses roots and
        # quotients that nobody asks for
        flat = None if JIT_OFF else all_vector
        block = self.sampler.printed(part, nodes, known=known, hints=hints, flat=flat)
        read = names_in(nodes)
        lines = ahead
        lines += [
            f"{part.fraction(tap)} = fraction[{tap.number}]"
            for tap in part.taps
            if part.fraction(tap) in read
        ]
        inner = [f"{n} = flat[{self._named[n]} + m]" for n in sorted(read & self._named.keys())]
        inner += block.lines
        inner += [f"flat[{k} + m] = {t}" for k, t in zip(wanted, block.texts, strict=True)]
        says = "Partial derivatives at known states."
        lines += ["for m in range(count):", *indented(inner)]
        name = f"fill_{part.own.name}"
        text = function_source(f"{name}({PIECE})", says, lines, "")
        file = f"{self.model.name}_{name}"
        self.pieces.append(PlannedPiece(file, name, self.sampler.module(text)))
        return len(self.pieces), range(first, self.size)

    def _link(self, place: SignalId) -> dict[SignalId, Term]:
        """Partial derivatives of a link: numbers, or refused."""
        part, link = self.sampler.parts[place.part], self.model.links[place.path]
        made = self.sampler.observed(part, place)
        by = {graph.name(part.source(each)): self.signal_id_of(each) for each in link.sources}
        partials = Gradients([made], [*by]).partials
        if any(node.op != "number" for node in partials.values()):
            raise InputError(
                f"Model {self.model.name}: the link {link.name} must be a sum of signals with "
                "constant factors; put anything else into a part's sample."
            )
        known = [*by.values()]
        return {known[inp]: Term((), float(node.value)) for (_, inp), node in partials.items()}

    # -- where it starts -----------------------------------------------------------------------

    def started(self, start: str) -> Starting:
        """Constants and states where a record begins, with their derivatives."""
        sampler = self.sampler
        outside = {n: each for n, each in sampler.outside().items() if each.kind != "state"}
        results: dict[SignalId, Node] = {}
        by: dict[str, str] = {}
        begins: dict[Node, Node] = {}
        """What names stand for where the record begins."""
        labels: dict[Node, str] = {}
        for part in sampler.used:
            i, prefix = part.part, self.model.prefix(part.part)
            begun = dict(leaves(part.begun(start)))
            states = dict(leaves(part.state))
            starts = dict(zip(begun, rewritten(begun.values(), begins), strict=True))
            begins |= {states[path]: node for path, node in starts.items()}
            own = [(source, n) for source, n in sampler.sources.items() if source.part == i]
            signals = rewritten([node for _, node in own], begins)
            begins |= {
                graph.name(part.source(source)): node
                for (source, _), node in zip(own, signals, strict=True)
            }
            results |= {SignalId(i, "k", name): node for node, name in self._constants[i].items()}
            carried = [each for each in self.partials if each[:2] == (i, "state")]
            results |= {state: starts[state.path] for state in carried}
            by |= {name: f"{prefix}{path}" for name, path in part.parameters.items()}
            labels |= part.trace.labels
        arguments = sorted(names_in(results.values()) & outside.keys())
        active = [each for each in arguments if each in by]
        derived = derived_function(
            f"{self.model.name}_start",
            f"Constants and states of {self.model.name} at the start.",
            arguments,
            [("_".join(map(str, key)), node) for key, node in results.items()],
            [(each, each) for each in active],
            labels,
            chained=True,
        )
        keys = [*results]
        moves = tuple((keys[out], by[active[inp]]) for out, inp in derived.entries)
        return Starting(tuple(outside[name] for name in arguments), moves, derived)


def interleaved(states: int) -> int:
    """Columns of a recurrence side by side: they fill the time that one waits for itself."""
    return 8 if states == 1 else 2


@generating
def recurrence(pattern: tuple[tuple[float | None, ...], ...]) -> PlannedPiece:
    """Piece that runs y[n+1] = A[n] y[n] + g[n] for some columns, a few side by side.

    `pattern` holds the entries of A that do not change, and None for the others. The second
    argument is the length of `lanes`, which stand in place of ``whole``: offsets into ``flat``,
    first of the changing entries of A, row by row; then, for each state and all columns, of its
    input g and its result y, from the block's first sample to the one after it, and of y in
    ``tangent``, in place of ``params``. There are a multiple of `interleaved` columns.
    """
    size, together = len(pattern), range(interleaved(len(pattern)))
    changing = [(i, l) for i in range(size) for l in range(size) if pattern[i][l] is None]
    lines = [f"at{i}_{l} = lanes[{k}]" for k, (i, l) in enumerate(changing)]
    ahead, after = list[str](), list[str]()
    inner = [f"a{i}_{l} = flat[at{i}_{l} + m]" for i, l in changing]
    for i, j in product(range(size), together):
        for k, what in enumerate(("g", "d", "p")):
            place = f"{len(changing)} + {3 * i + k} * width + c + {j}"
            ahead.append(f"{what}{i}_{j} = lanes[{place}]")
        ahead.append(f"y{i}_{j} = tangent[p{i}_{j}]")
        terms = [f"flat[g{i}_{j} + m]"]
        for l, each in enumerate(pattern[i]):
            if each != 0.0:
                terms.append(f"{f'a{i}_{l}' if each is None else repr(each)} * y{l}_{j}")
        inner.append(f"n{i}_{j} = {_sum(terms)}")
        after += [f"flat[d{i}_{j} + count] = y{i}_{j}", f"tangent[p{i}_{j}] = y{i}_{j}"]
    inner += [f"flat[d{i}_{j} + m] = y{i}_{j}" for i, j in product(range(size), together)]
    inner += [f"y{i}_{j} = n{i}_{j}" for i, j in product(range(size), together)]
    lines += [f"width = (size - {len(changing)}) // {3 * size}"]
    lines += [f"for c in range(0, width, {len(together)}):"]
    lines += indented([*ahead, "for m in range(count):", *indented(inner), *after])
    name, says = f"recurrence_{size}", f"Derivatives of {size} states that wait for each other."
    head = PIECE.replace("first", "size").replace("whole", "lanes").replace("params", "tangent")
    return PlannedPiece(name, name, function_source(f"{name}({head})", says, lines, ""))


def _sum(terms: Sequence[str]) -> str:
    """Text of a sum, its parts beside each other: none waits for all before it."""
    half = len(terms) // 2
    return terms[0] if not half else f"({_sum(terms[:half])} + {_sum(terms[half:])})"


def _strongly_connected(flows: Mapping[SignalId, list[SignalId]]) -> Iterable[tuple[SignalId, ...]]:
    """States in groups that wait for each other, each group behind those that it needs."""
    reach = {each: {each} for each in flows}
    for _ in flows:  # no way is longer
        for out in flows:
            reach[out].update(*(reach[inp] for inp in flows[out]))
    group = {
        each: tuple(other for other in flows if other in reach[each] and each in reach[other])
        for each in flows
    }
    order: TopologicalSorter[tuple[SignalId, ...]] = TopologicalSorter()
    for each in flows:
        others = dict.fromkeys(group[i] for i in flows[each])
        order.add(group[each], *(other for other in others if other != group[each]))
    return order.static_order()
