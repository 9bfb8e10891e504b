"""Which derivative flows into which: the structure of a model's Jacobian, and its kernels.

A column of the Jacobian is the derivative of every state by one parameter, over all samples. It
follows the linear recurrence ds[n+1] = A[n] ds[n] + b[n]. The partial derivatives A and b are known
once the states are (`fill` kernels, without a wait between samples); which of them are zero
whatever the numbers is known when the code is generated. So states fall into groups that wait for
each other (strongly connected components, a `recurrence` each), after those that they need.
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
from swashplate.equations.keeping import cached_on_disk, key_of
from swashplate.equations.marching.kernels import KERNEL_ARGUMENTS, PlannedCode
from swashplate.equations.marching.part_code import PartCode, SignalId
from swashplate.equations.marching.rows import STRIDE
from swashplate.equations.marching.run import PlannedKernel, PlannedMarch
from swashplate.equations.marching.sample_code import SampleCode, output_of
from swashplate.equations.model import Model, SignalSource
from swashplate.errors import InputError

Moved = tuple[SignalId, str]
"""A number, and the column that it is derived by."""


class Term(NamedTuple):
    """A product of rows of the block and a number: a partial derivative, a derivative, or both."""

    rows: tuple[int, ...] = ()
    """First place of each."""
    scale: float = 1.0
    factor: Moved | None = None
    """A further factor, known only with the parameters."""

    def times(self, other: Term) -> Term:
        """The product of both."""
        assert self.factor is None or other.factor is None
        return Term(self.rows + other.rows, self.scale * other.scale, self.factor or other.factor)


class Group(NamedTuple):
    """States of a part that wait for each other, in one recurrence."""

    states: tuple[SignalId, ...]
    factors: list[int]
    """First places of the rows of their partial derivatives by each other."""
    kernel: int
    """Number of its kernel, see `recurrence`."""


class PartStructure(NamedTuple):
    """What is done for a part after the march."""

    part: int
    fill_kernel: int | None
    """Number of the kernel that fills in its partial derivatives, None if there are none."""
    factor_rows: range
    """First places of the rows of these."""
    groups: list[Group]
    needed: list[SignalId]
    """Signals that other parts or links need."""
    next_state_of: dict[SignalId, SignalId]
    """Of each signal that equals a state at the next sample that state."""


class StartCode(NamedTuple):
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
    kernels: list[PlannedKernel]
    """Those of parts; the march, which comes first, is not among them."""
    parts: list[PartStructure]
    """Parts that are needed."""


@dataclass(frozen=True, eq=False)
class Structure:
    """A model's whole structure for some observed signals, and the kernels of its march."""

    model: Model
    signals: tuple[str, ...]
    """External ones that are given as records."""
    options: tuple[Any, ...]
    outputs: tuple[str, ...]
    """Signals that are observed."""
    facts: Facts

    @property
    def kernels(self) -> list[PlannedCode]:
        """The march over a block, and the kernels of parts."""
        rows = tuple(self.facts.row_of.items())
        march = PlannedMarch(self.model, self.signals, self.options, rows, whole=False)
        return [march, *self.facts.kernels]

    @cached_property
    def observed(self) -> list[tuple[SignalId, bool]]:
        """What is observed, and whether as an integral."""
        return [output_of(self.model, output) for output in self.outputs]

    def start_code(self, start: str) -> StartCode:
        """Constants and states where a record begins, ``"rest"`` or ``"steady"``.

        Generated, written to the cache folder and kept in the structure when it is first asked for;
        to be called within `generating`.
        """
        if start not in self._start_codes:
            self._start_codes[start] = cached_on_disk(
                f"{self.model.name}_start",
                (key_of(self.model), self.signals, self.options, self.outputs, start),
                lambda: self._generated_start(start),
            )
        return self._start_codes[start]

    def _generated_start(self, start: str) -> StartCode:
        structuring = _structured(self.model, self.signals, self.options, self.outputs)
        return structuring.start_code(start)

    @cached_property
    def _start_codes(self) -> dict[str, StartCode]:
        return {}


@generating
def structure_of(
    model: Model, signals: tuple[str, ...], options: tuple[Any, ...], observed: tuple[str, ...]
) -> Structure:
    """A model's structure for some observed signals, made once."""
    facts = cached_on_disk(
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
        self.observed = [output_of(model, output)[0] for output in observed]
        self.sample_code = SampleCode(model, signals, options, self.observed)
        self.size = STRIDE
        self.row_of: dict[SignalId, int] = {}
        self._named: dict[str, int] = {}  # Place of each number's row by its name in the code.
        self.partials: dict[SignalId, dict[SignalId, Term]] = {}
        self.kernels: list[PlannedKernel] = []
        self._constants: dict[int, dict[Node, str]] = {}
        """By part, what follows from parameters only, with its names."""
        # part by part, so that the kernels of the first ones are the same whatever follows
        self.parts = [self._part(part) for part in self.sample_code.used]
        for signal in self.observed:
            if signal.kind == "link":
                self._keep(signal)
                self.partials[signal] = self._link(signal)

    @property
    def facts(self) -> Facts:
        """What was found out."""
        return Facts(self.size, self.row_of, self.partials, self.kernels, self.parts)

    def signal_id_of(self, source: SignalSource) -> SignalId:
        """A signal of a part, or of its state."""
        state = source.signal in dict(leaves(self.sample_code.parts[source.part].state))
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
        """Differentiate what is needed of a part, and plan its kernels."""
        part_index = part.part
        sample_code = self.sample_code
        observed = [signal for signal in self.observed if signal.part == part_index]
        sources = [source for source in sample_code.sources if source.part == part_index]
        needed = [self.signal_id_of(source) for source in sources]
        states = {
            path: SignalId(part_index, "state", path) for path in sample_code.carried[part_index]
        }
        following = dict(leaves(part.following))
        names = dict(leaves(part.state))
        results = {state: following[path] for path, state in states.items()}
        next_state_of: dict[SignalId, SignalId] = {}
        for signal in dict.fromkeys([*needed, *observed]):
            if signal.kind == "signals":
                node = part.signal(signal.path)
                same = [state for state in states.values() if results[state] is node]
                if same:
                    next_state_of[signal] = same[0]
                else:
                    results[signal] = node
                self._keep(signal)
        for path, state in states.items():
            self._keep(state, names[path].value)
        for source, signal in zip(sources, needed, strict=True):
            self._keep(signal, part.source(source))
        read = sample_code.read(part)
        for name, signal in part.outside.items():
            if name in read:
                self._keep(signal, name)
        fill_kernel, factor_rows = self._plan_fill(part, results)
        flows = {
            state: [by for by in self.partials[state] if by in states.values()]
            for state in states.values()
        }
        groups = []
        for group in _strongly_connected(flows):
            zero = Term((), 0.0)
            terms = [[self.partials[into].get(by, zero) for by in group] for into in group]
            pattern = tuple(
                tuple(None if term.rows else term.scale for term in row) for row in terms
            )
            factors = [first for row in terms for term in row for first in term.rows]
            number = self._plan(recurrence(pattern))
            groups.append(Group(group, factors, number))
        return PartStructure(
            part=part_index,
            fill_kernel=fill_kernel,
            factor_rows=factor_rows,
            groups=groups,
            needed=needed,
            next_state_of=next_state_of,
        )

    def _plan(self, kernel: PlannedKernel) -> int:
        """Add a kernel; its number among all, once the march stands before them as number 0."""
        self.kernels.append(kernel)
        return len(self.kernels)

    def _plan_fill(
        self, part: PartCode, results: Mapping[SignalId, Node]
    ) -> tuple[int | None, range]:
        """Plan the kernel that writes partial derivatives at known states into rows.

        Returns its number, None if nothing is to be written, and the first places of these rows.
        """
        part_index = part.part
        ends = [*results.values()]
        ids: dict[Node, SignalId] = {
            graph.name(name): SignalId(part_index, "p", path)
            for name, path in part.parameters.items()
        }
        _, names_ahead = self.sample_code.ahead(part, ends)
        self._constants[part_index] = {node: names_ahead[node] for node in part.ahead(ends)}
        ids |= {
            node: SignalId(part_index, "k", name)
            for node, name in self._constants[part_index].items()
        }
        ids |= {node: SignalId(part_index, "state", path) for path, node in leaves(part.state)}
        for tap in part.taps:
            if tap.tap.delay:
                ids[graph.name(part.delay_fraction(tap))] = SignalId(
                    part_index, "fraction", str(tap.number)
                )
        for source in self.sample_code.sources:
            ids[graph.name(part.source(source))] = self.signal_id_of(source)
        gradients = Gradients(ends, [*ids])
        order = [*results]
        moving = [*ids.values()]
        self.partials |= {result: {} for result in order}
        first = self.size
        node_of_row = dict[int, Node]()
        for (result, argument), node in gradients.partials.items():
            term = Term((), float(node.value)) if node.op == "number" else Term((self._row(),))
            self.partials[order[result]][moving[argument]] = term
            node_of_row |= dict.fromkeys(term.rows, node)
        if not node_of_row:
            return None, range(0)
        nodes = [*node_of_row.values()]
        ahead, names_ahead = self.sample_code.ahead(part, nodes)
        hints = gradients.hints(
            [into.path for into in order], [source.path for source in moving], {}
        )
        # a loop without branches becomes vector instructions; plain Python refuses roots and
        # quotients that nobody asks for
        flat = None if JIT_OFF else all_vector
        block = self.sample_code.printed(part, nodes, available=names_ahead, hints=hints, flat=flat)
        read = names_in(nodes)
        lines = ahead
        lines += [
            f"{part.delay_fraction(tap)} = delay_fraction[{tap.number}]"
            for tap in part.taps
            if part.delay_fraction(tap) in read
        ]
        inner = [
            f"{name} = flat[{self._named[name]} + m]" for name in sorted(read & self._named.keys())
        ]
        inner += block.lines
        inner += [
            f"flat[{row} + m] = {text}" for row, text in zip(node_of_row, block.texts, strict=True)
        ]
        lines += ["for m in range(count):", *indented(inner)]
        name = f"fill_{part.part_model.name}"
        text = function_source(
            f"{name}({KERNEL_ARGUMENTS})", "Partial derivatives at known states.", lines, ""
        )
        file = f"{self.model.name}_{name}"
        number = self._plan(PlannedKernel(file, name, self.sample_code.module(text)))
        return number, range(first, self.size)

    def _link(self, signal: SignalId) -> dict[SignalId, Term]:
        """Partial derivatives of a link: numbers, or refused."""
        part = self.sample_code.parts[signal.part]
        link = self.model.links[signal.path]
        node = self.sample_code.observed(part, signal)
        by = {graph.name(part.source(source)): self.signal_id_of(source) for source in link.sources}
        partials = Gradients([node], [*by]).partials
        if any(node.op != "number" for node in partials.values()):
            raise InputError(
                f"Model {self.model.name}: the link {link.name} must be a sum of signals with "
                "constant factors; put anything else into a part's sample."
            )
        sources = [*by.values()]
        return {
            sources[argument]: Term((), float(node.value))
            for (_, argument), node in partials.items()
        }

    # -- where it starts -----------------------------------------------------------------------

    def start_code(self, start: str) -> StartCode:
        """Constants and states where a record begins, with their derivatives."""
        sample_code = self.sample_code
        outside = {
            name: stored for name, stored in sample_code.outside().items() if stored.kind != "state"
        }
        results: dict[SignalId, Node] = {}
        column_of: dict[str, str] = {}
        begins: dict[Node, Node] = {}
        """What names stand for where the record begins."""
        labels: dict[Node, str] = {}
        for part in sample_code.used:
            part_index = part.part
            prefix = self.model.prefix(part_index)
            initial = dict(leaves(part.initial_state(start)))
            states = dict(leaves(part.state))
            starts = dict(zip(initial, rewritten(initial.values(), begins), strict=True))
            begins |= {states[path]: node for path, node in starts.items()}
            own_sources = [
                (source, node)
                for source, node in sample_code.sources.items()
                if source.part == part_index
            ]
            signals = rewritten([node for _, node in own_sources], begins)
            begins |= {
                graph.name(part.source(source)): node
                for (source, _), node in zip(own_sources, signals, strict=True)
            }
            results |= {
                SignalId(part_index, "k", name): node
                for node, name in self._constants[part_index].items()
            }
            carried = [stored for stored in self.partials if stored[:2] == (part_index, "state")]
            results |= {state: starts[state.path] for state in carried}
            column_of |= {name: f"{prefix}{path}" for name, path in part.parameters.items()}
            labels |= part.trace.labels
        arguments = sorted(names_in(results.values()) & outside.keys())
        moving = [name for name in arguments if name in column_of]
        derived = derived_function(
            f"{self.model.name}_start",
            f"Constants and states of {self.model.name} at the start.",
            arguments,
            [("_".join(map(str, key)), node) for key, node in results.items()],
            [(name, name) for name in moving],
            labels,
            chained=True,
        )
        keys = [*results]
        moves = tuple(
            (keys[result], column_of[moving[argument]]) for result, argument in derived.entries
        )
        return StartCode(tuple(outside[name] for name in arguments), moves, derived)


def interleaved(states: int) -> int:
    """Columns of a recurrence side by side: they fill the time that one waits for itself."""
    return 8 if states == 1 else 2


@generating
def recurrence(pattern: tuple[tuple[float | None, ...], ...]) -> PlannedKernel:
    """Kernel that runs y[n+1] = A[n] y[n] + g[n] for some columns, a few side by side.

    `pattern` holds the entries of A that do not change, and None for the others. ``size`` is the
    length of ``lanes``: offsets into ``flat``, first of the changing entries of A, row by row;
    then, for each state and all columns, of its input g and its result y, from the block's first
    sample to the one after it, and of y in ``tangent``. These three arguments stand in place of
    ``first``, ``delay_samples`` and ``params``. The number of columns is a multiple of
    `interleaved`.
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
    name = f"recurrence_{size}"
    docstring = f"Derivatives of {size} states that wait for each other."
    head = KERNEL_ARGUMENTS
    for argument, instead in (("first", "size"), ("delay_samples", "lanes"), ("params", "tangent")):
        head = head.replace(argument, instead)
    return PlannedKernel(name, name, function_source(f"{name}({head})", docstring, lines, ""))


def _sum(terms: Sequence[str]) -> str:
    """Text of a sum, its parts next to each other: none waits for all earlier ones."""
    half = len(terms) // 2
    return terms[0] if not half else f"({_sum(terms[:half])} + {_sum(terms[half:])})"


def _strongly_connected(flows: Mapping[SignalId, list[SignalId]]) -> Iterable[tuple[SignalId, ...]]:
    """States in groups that wait for each other, each group after those that it needs."""
    reach = {state: {state} for state in flows}
    for _ in flows:  # no way is longer
        for state, sources in flows.items():
            reach[state].update(*(reach[source] for source in sources))
    group = {
        state: tuple(other for other in flows if other in reach[state] and state in reach[other])
        for state in flows
    }
    order: TopologicalSorter[tuple[SignalId, ...]] = TopologicalSorter()
    for state in flows:
        others = dict.fromkeys(group[source] for source in flows[state])
        order.add(group[state], *(other for other in others if other != group[state]))
    return order.static_order()
