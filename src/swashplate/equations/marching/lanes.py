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

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.equations import graph
from swashplate.equations.code_generation.functions import generating
from swashplate.equations.code_generation.printing import (
    CodeBlock,
    Statement,
    function_source,
    indented,
)
from swashplate.equations.code_generation.scheduling import VECTOR, all_vector
from swashplate.equations.code_generation.values import leaves
from swashplate.equations.declaration import JIT_OFF
from swashplate.equations.graph import Node
from swashplate.equations.keeping import cached_on_disk, key_of
from swashplate.equations.marching.kernels import FLOATS, INTS, pointers
from swashplate.equations.marching.march import SampleCode, lower, output_of
from swashplate.equations.marching.part_code import PartCode, SignalId, taps_of
from swashplate.equations.marching.rows import aligned
from swashplate.equations.marching.run import compiled_kernel
from swashplate.equations.model import Model

Array = NDArray[np.float64]

LANES = 16
"""Sets marched side by side: two vectors of eight if the processor has them, else four of four."""


# a root that nobody asks for may be one of a number below zero, which compiled code allows
CALLED: dict[str, Any] = {"sqrt": np.sqrt} if JIT_OFF else {}
"""What the text calls in place of the library's."""

PREPARE_KINDS = ("float", FLOATS)
MARCH = "count, h, length, records, delay_samples, flat, measured, weight, outputs"
"""Arguments of a march: samples, step, length of a row of the outputs, 0 without any, and arrays
without shapes."""
MARCH_KINDS = ("int", "float", "int", f"*{FLOATS}", INTS, *(FLOATS,) * 4)

SHORT = 16
"""Statements that are not worth a loop of their own."""


DIGEST = 8
"""Characters that the name of a generated function ends in."""


def is_vector(statement: Statement) -> bool:
    """Whether a processor can do a statement for many lanes at once: it is not a branch."""
    return len(statement.names) <= 1 and all_vector(statement.nodes)


class Straight:
    """A sample in loops over lanes.

    Every number that one loop leaves to another has a row of a block: row r of lane l is ``flat[r *
    LANES + l]``. With all of it in one array at known distances the compiler need not prove at run
    time that rows do not overlap.
    """

    def __init__(self) -> None:
        self.loops: list[list[Statement]] = [[]]
        self.number: dict[str, int] = {}  # Rows, given out on demand.

    def add(self, statement: Statement) -> None:
        """Append a statement, to another loop if only one of both is made of vectors."""
        if self.loops[-1] and is_vector(self.loops[-1][-1]) != is_vector(statement):
            self.loops.append([])
        self.loops[-1].append(statement)

    def let(self, name: str, text: str, reads: frozenset[str]) -> None:
        """Append a name for a text."""
        self.add(Statement([f"{name} = {text}"], (name,), reads, ()))

    def become(self, name: str, text: str, reads: frozenset[str]) -> None:
        """Append what becomes of a row at the end of a sample."""
        self.add(Statement([f"{self.row(name)} = {text}"], (), reads, ()))

    def cut(self) -> None:
        """Begin another loop over lanes, unless the present one is short.

        While one vector waits for its own results, a processor looks only so far ahead for others.
        """
        if len(self.loops[-1]) > SHORT:
            self.loops.append([])

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
        for index, loop in enumerate(self.loops):
            computed = {name for statement in loop for name in statement.names}
            read = {name for statement in loop for name in statement.reads}
            read_later = {
                name
                for later_loop in self.loops[index + 1 :]
                for statement in later_loop
                for name in statement.reads
            }
            body = self.loads(read - computed - shared)
            for statement in loop:
                body += statement.lines
            body += self.saves(computed & read_later)
            lines += over_lanes(body)
        return lines


def over_lanes(lines: Sequence[str]) -> list[str]:
    """A loop over lanes."""
    return ["for lane in range(LANES):", *indented(lines)] if lines else []


def vectorisation_report(model: Model, output: str | None = None, *, options: Any = None) -> str:
    """What keeps many sets of a model from being marched side by side in vector instructions.

    Parameters
    ----------
    model : Model
        A single model, or a joined one.
    output : str, optional
        Signal to return; by default the last that the model names.
    options : named tuple, optional
        Its options; all off if omitted.

    Returns
    -------
    str
        A line for each operation that is done set by set, with the equation that it stands in, or a
        sentence if there is none. `simulate_many` works in both cases, but slower in the first.
    """
    signals = list[str]()
    options_of_parts = list[Any]()
    calls = dict[str, None]()
    for index, part in enumerate(model.parts):
        outside = [name for name in part.input_types if model.link_of(index, name) is None]
        signals += [part.tap(name).signal for name in outside if name not in part.defaults]
        own_options = options if len(model.parts) == 1 else getattr(options, part.name, None)
        if own_options is None and part.options is not None:
            own_options = part.options()
        options_of_parts.append(own_options)
    names = (*model.outputs, *model.parts[-1].outputs) or model.parts[-1].signal_names
    signal, _ = output_of(model, output or names[-1])
    sample_code = SampleCode(model, signals, options_of_parts, [signal])
    for used in sample_code.used:
        ends = sample_code.ends[used.part]
        _, available = sample_code.ahead(used, ends, constant_names=fractions_of(used))
        block = sample_code.printed(used, ends, available=available, flat=all_vector)
        for statement in block.statements:
            if is_vector(statement):
                continue
            for node in statement.nodes:
                if node.op not in VECTOR:
                    source = used.trace.origins.get(node)
                    where = used.part_model.name if source is None else source.name
                    calls[f"{where} calls {_called(node)}"] = None
    if not calls:
        return f"Nothing keeps {model.name} from vector instructions."
    return "\n".join([f"{model.name} is not all vector instructions:", *calls])


def _called(node: Node) -> str:
    """What a node calls, as a user would say it."""
    if node.op != "call":
        return node.op
    name, mark, digest = node.value.function.name.rpartition("_")
    return name if mark and len(digest) == DIGEST else f"{name}{mark}{digest}"


def fractions_of(part: PartCode) -> list[str]:
    """Names of the fractions in the delays of a part's taps, which do not change during a march."""
    return [part.delay_fraction(tap) for tap in part.taps]


class Marched(NamedTuple):
    """Results of LANES sets."""

    cost: Array
    """(LANES,) sum of weighted squared errors."""
    worst: Array
    """(LANES,) worst margin of the domain, infinite without one."""
    end: Array
    """(LANES,) a sum that is finite if all numbers are."""
    outputs: Array
    """(LANES, n) the output, or (LANES, 0)."""


class LanePart(NamedTuple):
    """Where a part's numbers go: names of rows."""

    part: int
    parameters: dict[str, str]
    """Path of each parameter by the name of its row; `given` likewise."""
    given: dict[str, str]
    fractions: dict[int, str]
    """By the number of a tap, the row of the fraction in its delay."""
    states: dict[str, str]
    """By path, the row of each number of the state that is carried."""


class LaneFacts(NamedTuple):
    """What lanes are generated as: plain data."""

    text: str
    rows: dict[str, int]
    """Row of each number by its name."""
    parts: list[LanePart]


class _Writer:
    """Reads a model's equations, and writes the march of its lanes."""

    def __init__(
        self, model: Model, signals: Sequence[str], options: Sequence[Any], output: str
    ) -> None:
        signal, is_rate = output_of(model, output)
        self._sample_code = SampleCode(model, signals, options, [signal])
        self._straight = Straight()
        self._ahead: list[tuple[PartCode, CodeBlock]] = []
        text = self._sample_code.module(*self._texts(signal, is_rate))
        parts = [self._part_of(part) for part in self._sample_code.used]
        self.facts = LaneFacts(text, self._straight.number, parts)

    def _part_of(self, part: PartCode) -> LanePart:
        states = dict(leaves(part.state))
        return LanePart(
            part.part,
            part.parameters,
            {node.value: path for path, node in leaves(part.given)},
            {tap.number: part.delay_fraction(tap) for tap in part.taps},
            {path: states[path].value for path in self._sample_code.carried[part.part]},
        )

    def _texts(self, signal: SignalId, is_rate: bool) -> list[str]:
        """Texts of both functions."""
        sample_code, straight, model = self._sample_code, self._straight, self._sample_code.model
        following: list[tuple[str, str, frozenset[str]]] = []
        """What rows become at the end of a sample."""
        worst = ""
        for part in sample_code.used:
            straight.cut()
            worst = self._part(part, signal, following, worst)
        if worst:
            following.append(("worst", worst, frozenset((worst,))))
        observed = "value"
        if is_rate:
            following.append(("rate", observed, frozenset((observed,))))
            trapezium = frozenset(("total", "half", "rate", observed))
            straight.let("integral", f"total + half * (rate + {observed})", trapezium)
            observed = "integral"
            following.append(("total", observed, frozenset((observed,))))
        straight.let("error", f"{observed} - target", frozenset((observed, "target")))
        square = frozenset(("cost", "counts", "error"))
        following.append(("cost", "cost + counts * error * error", square))
        following.append(("shown", observed, frozenset((observed,))))
        # what a lane sees of a record at a place of its own is fetched a sample ahead of its use: a
        # row that was just written number by number cannot be read as a whole at once
        first: list[str] = []
        fetched: list[str] = []
        for part in sample_code.used:
            for tap in part.taps:
                record = f"records[{sample_code.signals.index(tap.tap.signal)}]"
                queue = [f"{part.delay_fraction(tap)}_coming", *part.tap_samples(tap)]
                for lines, name, sample in ((first, queue[1], "0"), (fetched, queue[0], "coming")):
                    index = f"{sample} - delay_samples[{tap.number} * LANES + lane]"
                    lines.append(f"at = {index}")
                    lines.append(f"{straight.row(name)} = {record}[at] if at >= 0 else 0.0")
                following += [(old, new, frozenset((new,))) for new, old in pairwise(queue)]
        for name, text, reads in following:
            straight.become(name, text, reads)
        read = {name for loop in straight.loops for statement in loop for name in statement.reads}
        shared = {"target": "measured[n]", "counts": "weight[n]"}
        shared["half"] = "0.5 * h if n > 0 else 0.0"
        shared |= {
            f"x_{name}": f"records[{row}][n]" for row, name in enumerate(sample_code.signals)
        }
        inner = [f"{name} = {text}" for name, text in shared.items() if name in read]
        if fetched:
            inner += ["coming = min(n + 1, last)", *over_lanes(fetched)]
        inner += straight.lines({"h", *shared})
        shown_lines = over_lanes([f"outputs[lane * length + n] = {straight.row('shown')}"])
        inner += ["if length > 0:", *indented(shown_lines)]
        lines = ["last = count - 1", *over_lanes(first)]
        lines += ["for n in range(count):", *indented(inner)]
        return [
            function_source(
                "prepare(h, flat)",
                f"What does not change, and states at rest, of LANES sets of {model.name}.",
                over_lanes(self._prepared(read)),
                "",
            ),
            function_source(
                f"march({MARCH})", f"March LANES sets of {model.name} over one record.", lines, ""
            ),
        ]

    def _part(
        self,
        part: PartCode,
        signal: SignalId,
        following: list[tuple[str, str, frozenset[str]]],
        worst: str,
    ) -> str:
        """Append a part's sample; the name of the worst margin so far."""
        sample_code, straight = self._sample_code, self._straight
        head = sample_code.printed(
            part, part.ahead(sample_code.ends[part.part], fractions_of(part)), named=True
        )
        self._ahead.append((part, head))
        own_sources = [
            (source, node)
            for source, node in sample_code.sources.items()
            if source.part == part.part
        ]
        steps = dict(leaves(part.following))
        results = {part.source(source): node for source, node in own_sources}
        if part.margin is not None:
            worst_so_far = graph.name(worst or "worst")
            worst = part.fresh("lowest")
            results[worst] = lower(worst_so_far, part.margin)
        if signal.part == part.part and signal.kind != "link":
            results["value"] = part.node(signal)
        states = dict(leaves(part.state))
        carried = {states[path].value: steps[path] for path in sample_code.carried[part.part]}
        block = sample_code.printed(
            part, [*results.values(), *carried.values()], available=head.names, flat=all_vector
        )
        for statement in block.statements:
            straight.add(statement)
        texts = iter(block.results)
        for name in results:
            straight.let(name, *next(texts))
        if signal.part == part.part and signal.kind == "link":
            observed = sample_code.printed(
                part, [sample_code.observed(part, signal)], available=block.names
            )
            for statement in observed.statements:
                straight.add(statement)
            straight.let("value", *observed.results[0])
        following += [(name, *next(texts)) for name in carried]
        return worst

    def _prepared(self, read: set[str]) -> list[str]:
        """Lines of a lane ahead of the march, from what is known to what is read in it."""
        sample_code, straight = self._sample_code, self._straight
        lines: list[str] = []
        used = set[str]()
        for part, head in self._ahead:
            lines += head.lines
            computed = {name for statement in head.statements for name in statement.names}
            lines += straight.saves(read & computed)
            used |= {name for statement in head.statements for name in statement.reads} - computed
            states = dict(leaves(part.state))
            initial = dict(leaves(part.initial_state()))
            carried = sample_code.carried[part.part]
            at_rest = sample_code.printed(
                part, [initial[path] for path in carried], available=head.names
            )
            lines += at_rest.lines
            for path, (text, reads) in zip(carried, at_rest.results, strict=True):
                lines.append(f"{straight.row(states[path].value)} = {text}")
                used |= reads
            computed |= {name for statement in at_rest.statements for name in statement.names}
            used |= {name for statement in at_rest.statements for name in statement.reads}
            used -= computed
        return [*straight.loads(used - {"h"}), *lines]


class Lanes:
    """The march of LANES sets of a model over one record, for one output.

    `prepare` computes what does not change, and states at rest, of every lane. `march` marches:
    costs and the worst margins are rows of the block, and its outputs, if there are any, are a row
    for each lane.
    """

    def __init__(self, model: Model, signals: tuple[str, ...], facts: LaneFacts) -> None:
        self._model, self._facts = model, facts
        self._taps = taps_of(model, signals)
        self.text = facts.text
        names, file = {"LANES": LANES, **CALLED}, f"{model.name}_lanes"
        self.prepare = compiled_kernel(file, self.text, "prepare", PREPARE_KINDS, names)
        self.march = compiled_kernel(file, self.text, "march", MARCH_KINDS, names)

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
        rows, model = self._facts.rows, self._model
        block = aligned(len(rows), LANES)
        delay_samples = np.zeros((max(len(self._taps), 1), LANES), dtype=np.int64)
        starts: dict[str, int] = {}
        for part in self._facts.parts:
            prefix = model.prefix(part.part)
            part_model = model.parts[part.part]
            paths = {name: f"{prefix}{path}" for name, path in part.parameters.items()}
            paths |= {name: f"given {prefix}{path}" for name, path in part.given.items()}
            for name, path in paths.items():
                if name in rows and path in numbers:
                    block[rows[name]] = numbers[path]
                elif name in rows:
                    block[rows[name]] = part_model.parameters._field_defaults[part.parameters[name]]
            taps_of_part = [tap for tap in self._taps if tap.part == part.part]
            for tap in taps_of_part:
                late = numbers[f"{prefix}{tap.tap.delay}"] / h if tap.tap.delay else np.zeros(LANES)
                end = np.maximum(late, tap.tap.ahead) - tap.tap.ahead
                delay_samples[tap.number] = np.floor(end)
                fraction = part.fractions[tap.number]
                if fraction in rows:
                    block[rows[fraction]] = end - delay_samples[tap.number]
            for path, name in part.states.items():
                starts[f"start.{prefix}{path}"] = rows[name]
        worst = block[rows["worst"]] if "worst" in rows else np.empty(LANES)
        worst[:] = np.inf
        size = measured.size
        # rows an odd number of cache lines apart, so that they do not share places in a cache
        outputs = np.empty((LANES, (size | 15) + 9 if keep else 0))
        values = tuple(map(np.ascontiguousarray, records.values()))
        measured, weight = np.ascontiguousarray(measured), np.ascontiguousarray(weight)
        with np.errstate(all="ignore"):  # of ways that are not taken there is nothing to say
            self.prepare(h, block.reshape(-1))
            for path in starts.keys() & numbers.keys():
                block[starts[path]] = numbers[path]
            self.march(
                size,
                h,
                outputs.shape[1],
                pointers(values),
                delay_samples.reshape(-1),
                block.reshape(-1),
                measured,
                weight,
                outputs.reshape(-1),
            )
        end = block[[rows["cost"], *starts.values()]].sum(axis=0)
        return Marched(block[rows["cost"]], worst, end, outputs[:, :size])


@generating
def lanes_of(
    model: Model, signals: tuple[str, ...], options: tuple[Any, ...], output: str
) -> Lanes:
    """The compiled lanes of a model for one output."""
    facts = cached_on_disk(
        f"{model.name}_lanes",
        (key_of(model), signals, options, output),
        lambda: _Writer(model, signals, options, output).facts,
    )
    return Lanes(model, signals, facts)
