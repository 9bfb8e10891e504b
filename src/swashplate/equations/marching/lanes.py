"""Many sets of one model side by side: LANES of them in the innermost loop of one march.

The equations stand in that loop as straight code, which the compiler turns into vector instructions
if there is nothing in it but arithmetic on rows of neighbouring numbers. Hence

- a decision is not a branch: both ways are computed, and one result is taken;
- what does not change over the march is computed once, ahead of it: the compiler moves it out of a
  loop over samples by itself, but not out of one over lanes within;
- a call of a library has a loop of its own, between those that become vectors.

Arithmetic is as strict as in the plain march, so that each set's numbers are the same to the last
bit, whatever its neighbours are.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import reduce
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.equations import expressions as ex
from swashplate.equations.code import Choice, Code, Item, Let, Rule, generating, leaves
from swashplate.equations.declaration import JIT_OFF
from swashplate.equations.expressions import Node, text
from swashplate.equations.marching.march import Sampler, lower, output_of
from swashplate.equations.marching.part import Stored, choose
from swashplate.equations.marching.rows import aligned
from swashplate.equations.marching.run import module
from swashplate.equations.model import Model
from swashplate.equations.writing import function_source, indented, lines_of

Array = NDArray[np.float64]

LANES = 16
"""Sets marched side by side: two vectors of eight where the processor has them, else four of 4."""


CALLED: dict[str, Any] = {"choose": choose}
"""What the text calls."""
if JIT_OFF:
    # a root that nobody asks for may be one of a number below zero, which compiled code allows
    CALLED |= {"sqrt": np.sqrt}

SHORT = 16
"""Statements that are not worth a loop of their own."""
VECTOR = {*ex.CHEAP, "choose", "/", "sqrt", "**"}
"""Operations that processors have for many numbers at once."""
CALLS = re.compile(r"([A-Za-z_]\w*)\(")
CALLED_ONCE = re.compile(r"_[0-9a-f]{8}$")
"""What a generated function's name ends in."""


def is_vector(node: Node) -> bool:
    """Whether a processor can compute an expression for many lanes at once."""
    return node.op in VECTOR and all(map(is_vector, node.args))


def is_flat(item: Item) -> bool:
    """Whether all of an item can be computed for many lanes at once, whatever its tests say."""
    if isinstance(item, Choice):
        merged = [node for each in item.merged for node in each[1:]]
        return all(map(is_flat, (*item.then, *item.other))) and all(map(is_vector, merged))
    return isinstance(item, Let) and is_vector(item.node)


class Statement(NamedTuple):
    """Lines that give some names their values."""

    names: tuple[str, ...]
    lines: list[str]
    reads: frozenset[str]
    vector: bool  # Whether a processor can do it for many lanes at once.


class Straight:
    """A sample without branches in loops over lanes, and what can be computed ahead of the march.

    What follows nothing but parameters, givens, constants and places of taps is `ahead`. Every
    number that one loop leaves to another has a row of a block: row r of lane l is ``flat[r * LANES
    + l]``. With all of it in one array at known distances the compiler need not prove at run time
    that rows do not overlap.
    """

    def __init__(self, sampler: Sampler) -> None:
        parts = sampler.used
        self.known = {
            node.value for part in parts for _, node in (*leaves(part.p), *leaves(part.given))
        }
        self.known |= {part.fraction(tap) for part in parts for tap in part.taps}
        constants = {name for part in parts for name in sampler.constants(part)}
        self.still, self.fresh = {"h", *self.known, *constants}, parts[0].code.fresh
        self.ahead: list[Statement] = []
        self.loops: list[list[Statement]] = [[]]
        self.number: dict[str, int] = {}  # Rows, given out on demand.
        self._moved: dict[Node, Node] = {}

    def add(self, code: Code, items: Iterable[Item]) -> None:
        """Append items of some code."""
        for item in items:
            if isinstance(item, Let):
                self.let(item.name, item.node)
            elif isinstance(item, Choice) and is_flat(item):
                self.add(code, (*item.then, *item.other))
                for name, one, two in item.merged:
                    self.let(name, ex.make("if", item.test, one, two))
            else:
                assert not isinstance(item, Rule)
                if isinstance(item, Choice):
                    names = tuple(name for name, _, _ in item.merged)
                else:
                    names = item.results
                alone = Code(code.taken)
                alone.items = [item]
                made = [*map(ex.name, names)]
                reads = frozenset(alone.reads(made))
                self._append(Statement(names, lines_of(alone, made), reads, False))
                code.names |= alone.names

    def let(self, name: str, node: Node) -> None:
        """Append a name and what it stands for."""
        made = node if node.reads <= self.still else self._branchless(node)
        self._append(Statement((name,), [f"{name} = {text(made)}"], made.reads, is_vector(made)))

    def become(self, name: str, node: Node) -> None:
        """Append what becomes of a row at the end of a sample."""
        made = self._branchless(node)
        self._append(Statement((), [f"{self.row(name)} = {text(made)}"], made.reads, True))

    def _append(self, statement: Statement) -> None:
        if statement.names and statement.reads <= self.still:
            self.still.update(statement.names)
            self.ahead.append(statement)
        else:
            if self.loops[-1] and self.loops[-1][-1].vector != statement.vector:
                self.loops.append([])
            self.loops[-1].append(statement)

    def cut(self) -> None:
        """Begin another loop over lanes, unless the present one is short.

        While one vector waits for its own results, a processor looks only so far ahead for others.
        """
        if len(self.loops[-1]) > SHORT:
            self.loops.append([])

    def _branchless(self, node: Node) -> Node:
        """An expression without branches, and without what can be computed ahead of the march."""
        if node.op in ex.LEAVES:
            return node
        if node.reads and node.reads <= self.still:
            if node not in self._moved:
                name = self.fresh("still")
                self.let(name, node)
                self._moved[node] = ex.name(name, node.kind)
            return self._moved[node]
        args = [self._branchless(each) for each in node.args]
        if node.op == "if" and node.kind != "int":
            return ex.make("choose", *args, kind=node.kind)
        if node.op == "and":
            return reduce(lambda a, b: ex.make("choose", a, b, ex.number(False), kind="bool"), args)
        if node.op == "or":
            return reduce(lambda a, b: ex.make("choose", a, ex.number(True), b, kind="bool"), args)
        return ex.make(node.op, *args, value=node.value)

    def row(self, name: str) -> str:
        """Text of a lane's number in the row of a name."""
        return f"flat[{self.number.setdefault(name, len(self.number))} * LANES + lane]"

    def loads(self, names: Iterable[str]) -> list[str]:
        """Lines that take numbers out of their rows."""
        return [f"{name} = {self.row(name)}" for name in sorted(names)]

    def saves(self, names: Iterable[str]) -> list[str]:
        """Lines that put numbers into their rows."""
        return [f"{self.row(name)} = {name}" for name in sorted(names)]

    def lines(self, shared: set[str]) -> list[str]:
        """Text of the loops over lanes; the names in `shared` are the same for all lanes."""
        lines: list[str] = []
        for k, loop in enumerate(self.loops):
            made = {name for each in loop for name in each.names}
            read = {name for each in loop for name in each.reads}
            later = {name for after in self.loops[k + 1 :] for each in after for name in each.reads}
            body = [line for each in loop for line in each.lines]
            loads, saves = self.loads(read - made - shared), self.saves(made & later)
            lines += over_lanes([*loads, *body, *saves])
        return lines


def over_lanes(lines: Sequence[str]) -> list[str]:
    """A loop over lanes."""
    return ["for lane in range(LANES):", *indented(lines)] if lines else []


def report(model: Model, output: str | None = None, *, options: Any = None) -> str:
    """What keeps many sets of a model from being marched side by side in vector instructions.

    Parameters
    ----------
    model : Model
        A single model, or a joined one.
    output : str, optional
        Signal that is wanted; by default the last that the model names.
    options : named tuple, optional
        Its options; all off if omitted.

    Returns
    -------
    str
        A line for each operation that is done set by set, with the equation that it stands in; or
        that there is none. `simulate_many` works either way, and slower in the first.
    """
    signals, chosen, found = list[str](), list[Any](), dict[str, None]()
    for i, part in enumerate(model.parts):
        outside = [name for name in part.input_types if model.link_of(i, name) is None]
        signals += [part.tap(name).signal for name in outside if name not in part.defaults]
        own = options if len(model.parts) == 1 else getattr(options, part.name, None)
        chosen.append(part.options() if own is None and part.options is not None else own)
    names = (*model.outputs, *model.parts[-1].outputs) or model.parts[-1].signal_names
    sampler = Sampler(model, signals, chosen, [output_of(model, output or names[-1])[0]])
    for each in sampler.used:
        straight = Straight(sampler)
        straight.add(each.code, each.code.kept(sampler.ends[each.part]))
        for statement in [made for loop in straight.loops for made in loop if not made.vector]:
            where = each.code.origins.get(statement.names[0], each.own.name)
            called = {word for line in statement.lines for word in CALLS.findall(line)}
            slow = sorted(CALLED_ONCE.sub("", word) for word in called - {*VECTOR, *CALLED})
            found[f"{where} calls {', '.join(slow)}"] = None
    if not found:
        return f"Nothing keeps {model.name} from vector instructions."
    return "\n".join([f"{model.name} is not all vector instructions:", *found])


class Marched(NamedTuple):
    """What LANES sets leave."""

    cost: Array  # (LANES,) sum of weighted squared errors.
    worst: Array  # (LANES,) worst margin of the domain, infinite without one.
    end: Array  # (LANES,) a sum that is finite where all numbers are.
    outputs: Array  # (LANES, n) the output, or (LANES, 0).


class Lanes:
    """The march of LANES sets of a model over one record, for one output.

    ``prepare(h, flat)`` computes what does not change, and states at rest, of every lane.
    ``march(records, whole, h, flat, measured, weight, outputs)`` marches: costs and the worst
    margins are rows of the block, and ``outputs``, unless empty, are a row for each lane.
    """

    def __init__(
        self, model: Model, signals: Sequence[str], options: Sequence[Any], output: str
    ) -> None:
        place, is_rate = output_of(model, output)
        self._sampler = Sampler(model, signals, options, [place])
        self._straight = Straight(self._sampler)
        text = "\n\n".join(self._texts(place, is_rate))
        names = {**self._sampler.names, **CALLED, "LANES": LANES}
        made = module(f"{model.name}_lanes", text, names)
        self.prepare: Callable[..., None] = made["prepare"]
        self.march: Callable[..., None] = made["march"]

    def _texts(self, place: Stored, is_rate: bool) -> list[str]:
        """Texts of both kernels."""
        sampler, straight, model = self._sampler, self._straight, self._sampler.model
        # what rows become at the end of a sample
        following: dict[str, Node] = {}
        shown = ex.name("value")
        for part in sampler.used:
            straight.cut()
            straight.add(part.code, part.code.kept(sampler.ends[part.part]))
            for source, node in sampler.sources.items():
                if source.part == part.part:
                    straight.let(part.source(source), node)
            if part.margin is not None:
                worst = following.get("worst", ex.name("worst"))
                following["worst"] = lower(worst, part.margin)
            if place.part == part.part:
                code, node = sampler.observed(part, place)
                straight.add(code, code.kept([node]))
                straight.let("value", node)
            state, step = dict(leaves(part.state)), dict(leaves(part.following))
            following |= {state[path].value: step[path] for path in sampler.carried[part.part]}
        if is_rate:
            trapezium = ex.make("*", ex.name("half"), ex.make("+", ex.name("rate"), shown))
            following["rate"] = shown
            straight.let("integral", ex.make("+", ex.name("total"), trapezium))
            following["total"] = shown = ex.name("integral")
        straight.let("error", ex.make("-", shown, ex.name("target")))
        square = ex.make("*", ex.make("*", ex.name("counts"), ex.name("error")), ex.name("error"))
        following |= {"cost": ex.make("+", ex.name("cost"), square), "shown": shown}
        # what a lane sees of a record at a place of its own is fetched a sample ahead of its use: a
        # row that was just written number by number cannot be read as a whole at once
        first: list[str] = []
        fetched: list[str] = []
        for part in sampler.used:
            for tap in part.taps:
                record = f"records[{sampler.signals.index(tap.tap.signal)}]"
                queue = [f"{part.fraction(tap)}_coming", *part.tap_samples(tap)]
                for lines, name, n in ((first, queue[1], "0"), (fetched, queue[0], "coming")):
                    index = f"{n} - whole[{tap.number}, lane]"
                    lines.append(f"{straight.row(name)} = sample_at({record}, {index}, 0.0)")
                following |= {older: ex.name(newer) for newer, older in pairwise(queue)}
        for name, node in following.items():
            straight.become(name, node)
        read = {name for loop in straight.loops for each in loop for name in each.reads}
        shared = {"target": "measured[n]", "counts": "weight[n]"}
        shared["half"] = "0.5 * h if n > 0 else 0.0"
        shared |= {f"x_{name}": f"records[{k}][n]" for k, name in enumerate(sampler.signals)}
        inner = [f"{name} = {value}" for name, value in shared.items() if name in read]
        if fetched:
            inner += ["coming = min(n + 1, last)", *over_lanes(fetched)]
        inner += straight.lines({"h", *shared})
        kept = over_lanes([f"outputs[lane, n] = {straight.row('shown')}"])
        inner += ["if outputs.size > 0:", *indented(kept)]
        lines = ["last = measured.size - 1", *over_lanes(first)]
        lines += ["for n in range(measured.size):", *indented(inner)]
        return [
            function_source(
                "prepare(h, flat)",
                f"What does not change, and states at rest, of LANES sets of {model.name}.",
                over_lanes(self._prepared(read)),
            ),
            function_source(
                "march(records, whole, h, flat, measured, weight, outputs)",
                f"March LANES sets of {model.name} over one record.",
                lines,
            ),
        ]

    def _prepared(self, read: set[str]) -> list[str]:
        """Lines of a lane ahead of the march, from what is known to what is read in it."""
        sampler, straight = self._sampler, self._straight
        lines = [line for each in straight.ahead for line in each.lines]
        lines += straight.saves(read & straight.still - straight.known - {"h"})
        used = {name for each in straight.ahead for name in each.reads}
        for part in sampler.used:
            code, value = part.begun()
            state, nodes = dict(leaves(part.state)), dict(leaves(value))
            at_rest = {state[path].value: nodes[path] for path in sampler.carried[part.part]}
            lines += lines_of(code, at_rest.values())
            lines += [f"{straight.row(name)} = {text(node)}" for name, node in at_rest.items()]
            reads = {*sampler.constants(part), *code.reads(at_rest.values())}
            needed = [ex.name(name) for name in reads]
            lines[:0] = lines_of(part.prologue, needed)
            used |= part.prologue.reads(needed)
        return [*straight.loads(used & straight.known), *lines]

    def __call__(
        self,
        numbers: Mapping[str, Array],
        records: Mapping[str, Array],
        h: float,
        *,
        measured: Array,
        weight: Array,
        keep: bool,
    ) -> Marched:
        """March LANES sets over one record, from rest but for what the numbers say.

        `numbers` has (LANES,) values of every parameter by its path, and every given, ``"given "``
        before it; parameters that a type has a default for may be left out. States at the first
        sample, ``"start."`` before their paths, where they are not those at rest. The output is
        compared with (n,) `measured` values under the `weight` of each squared error.
        """
        rows, model, parts = self._straight.number, self._sampler.model, self._sampler.used
        block = aligned(len(rows), LANES)
        taps = [tap for part in parts for tap in part.taps]
        whole = np.zeros((max((tap.number for tap in taps), default=0) + 1, LANES), dtype=np.int64)
        starts: dict[str, int] = {}
        for part in parts:
            prefix, states = model.prefix(part.part), dict(leaves(part.state))
            known = {name: f"{prefix}{path}" for name, path in part.parameters.items()}
            known |= {node.value: f"given {prefix}{path}" for path, node in leaves(part.given)}
            for name, path in known.items():
                if name in rows and path in numbers:
                    block[rows[name]] = numbers[path]
                elif name in rows:
                    default = part.own.parameters._field_defaults
                    block[rows[name]] = default[part.parameters[name]]
            for tap in part.taps:
                late = numbers[f"{prefix}{tap.tap.delay}"] / h if tap.tap.delay else np.zeros(LANES)
                end = np.maximum(late, tap.tap.ahead) - tap.tap.ahead
                whole[tap.number] = np.floor(end)
                if part.fraction(tap) in rows:
                    block[rows[part.fraction(tap)]] = end - whole[tap.number]
            for path in self._sampler.carried[part.part]:
                starts[f"start.{prefix}{path}"] = rows[states[path].value]
        worst = block[rows["worst"]] if "worst" in rows else np.empty(LANES)
        worst[:] = np.inf
        size = measured.size
        # rows an odd number of cache lines apart, so that they do not share places in a cache
        outputs = np.empty((LANES, (size | 15) + 9 if keep else 0))
        values = tuple(np.require(each, np.float64, ["C", "W"]) for each in records.values())
        with np.errstate(all="ignore"):  # of ways that are not taken there is nothing to say
            self.prepare(h, block.reshape(-1))
            for path in starts.keys() & numbers.keys():
                block[starts[path]] = numbers[path]
            self.march(values, whole, h, block.reshape(-1), measured, weight, outputs)
        end = block[[rows["cost"], *starts.values()]].sum(axis=0)
        return Marched(block[rows["cost"]], worst, end, outputs[:, :size])


@generating
def lanes_of(
    model: Model, signals: tuple[str, ...], options: tuple[Any, ...], output: str
) -> Lanes:
    """The compiled lanes of a model for one output."""
    return Lanes(model, signals, options, output)
