"""One sample of a whole model: the code of its parts, and what of it is needed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from swashplate.equations import graph
from swashplate.equations.code_generation.functions import Function, fresh_name
from swashplate.equations.code_generation.printing import (
    BRANCHING,
    PYTHON,
    CodeBlock,
    assigned,
)
from swashplate.equations.code_generation.scheduling import Flat
from swashplate.equations.code_generation.values import Value, leaves
from swashplate.equations.fields import floats_of
from swashplate.equations.graph import Node, names_in
from swashplate.equations.marching.part_code import PartCode, SignalId
from swashplate.equations.model import Model, SignalSource
from swashplate.errors import InputError

_OWN = """
n m j c lane first last worst h half value error total count size used progress values lines
delay_samples delay_fraction params given constants states out flags records before measured weight
outputs flat inputs table kept tangent lanes columns program plan sink room block
worst_margin lower context volts current speed at everything voltage target counts coming cost rate
integral shown choose width length
"""
RESERVED = {*_OWN.split(), *(name for name in vars(math) if not name.startswith("_"))}
"""Names that the kernels use themselves."""
CONTEXT_FIELDS = [
    "inputs",
    "lines",
    "delay_samples",
    "delay_fraction",
    "params",
    "given",
    "h",
    "constants",
    "states",
    "outputs",
]
"""What a step takes from a `StepContext`."""


class SampleCode:
    """One sample of a whole model: the code of its parts, and what of it is needed.

    `outputs` are numbers that are kept at every sample; parts that none of them needs are left out.

    Attributes
    ----------
    parts, used : list of PartCode
        All parts, and those that are needed.
    ends, carried : list
        Of each part the results that are needed, and the paths of the states.
    sources : dict of SignalSource to Node
        Signals that other parts or links need.
    functions : dict of str to Function
        Generated functions that what was printed calls.
    records, before : dict of str to str
        Names of a signal's record, and of its value before that.
    """

    def __init__(
        self,
        model: Model,
        signals: Sequence[str],
        options: Sequence[Any],
        outputs: Sequence[SignalId],
    ) -> None:
        self.model = model
        self.signals = tuple(signals)
        used_names = {*RESERVED}
        self.records = {signal: fresh_name(signal, used_names) for signal in self.signals}
        self.before = {
            signal: fresh_name(f"{signal}_before", used_names) for signal in self.signals
        }
        self.parts = [
            PartCode(model, index, signals, options_of_part, used_names)
            for index, options_of_part in enumerate(options)
        ]
        self.ends: list[list[Node]] = [[] for _ in self.parts]
        self.carried: list[list[str]] = [[] for _ in self.parts]
        self.sources: dict[SignalSource, Node] = {}
        self.functions: dict[str, Function] = {}
        for output in outputs:
            part = self.parts[output.part]
            if output.kind == "link":
                self._need(model.links[output.path].sources)
            elif output.kind == "limits":
                self.ends[output.part] += part.limits
            else:
                self.ends[output.part].append(part.node(output))
        for part in reversed(self.parts):
            if self.ends[part.part]:
                self._settle(part)
        self.used = [part for part in self.parts if self.ends[part.part]]

    def _settle(self, part: PartCode) -> None:
        """Find out what a part's results follow from: its states, and signals of other parts."""
        ends, carried = self.ends[part.part], set[str]()
        ends += [] if part.margin is None else [part.margin]
        state, following = dict(leaves(part.state)), dict(leaves(part.following))
        while True:
            read = names_in(ends)
            new = {path for path, node in state.items() if node.value in read} - carried
            if not new:
                break
            carried |= new
            ends += [following[path] for path in state if path in new]
        self.carried[part.part] = [path for path in state if path in carried]
        for name in part.part_model.input_types:
            link = self.model.link_of(part.part, name)
            if link is not None and any(part.source(source) in read for source in link.sources):
                self._need(link.sources)

    def _need(self, sources: Sequence[SignalSource]) -> None:
        for source in sources:
            if source not in self.sources:
                node = self.parts[source.part].signal(source.signal)
                self.sources[source] = node
                self.ends[source.part].append(node)

    @property
    def stands_for(self) -> dict[Node, Node]:
        """What the names of signals between parts stand for."""
        return {
            graph.name(self.parts[source.part].source(source)): node
            for source, node in self.sources.items()
        }

    def outside(self) -> dict[str, SignalId]:
        """What is known ahead of a sample, by name: numbers, the state, delays and records."""
        ids = {"h": SignalId(0, "h")}
        for part in self.used:
            part_index = part.part
            for kind, numbers in (("p", part.p), ("given", part.given), ("state", part.state)):
                ids |= {
                    node.value: SignalId(part_index, kind, path) for path, node in leaves(numbers)
                }
            ids |= part.outside
            for tap in part.taps:
                ids[part.delay_fraction(tap)] = SignalId(part_index, "fraction", str(tap.number))
        return ids

    def module(self, *texts: str) -> str:
        """Text of a module of some functions, with the generated ones that they call."""
        called: dict[str, str] = {}
        for function in self.functions.values():
            if any(f"{function.name}(" in text for text in texts):
                called |= function.texts
        inlined = [f"@inlined\n{text}" for text in called.values()]
        return "\n\n".join([*inlined, *texts])

    def read(self, part: PartCode) -> set[str]:
        """Names from outside that a part needs."""
        return names_in(self.ends[part.part])

    def printed(
        self,
        part: PartCode,
        results: Sequence[Node],
        *,
        available: Mapping[Node, str] | None = None,
        hints: Mapping[Node, str] | None = None,
        named: bool = False,
        flat: Flat | None = None,
        branches: bool = True,
    ) -> CodeBlock:
        """Lines that compute some nodes of a part; `hints` are names for some, see `CodeBlock`.

        Choices are not branches with `flat`, for loops of vector instructions, or if there are to
        be none but those that save work.
        """
        labels = {**part.trace.labels, **(hints or {})}
        language = BRANCHING if branches and flat is None else PYTHON
        block = CodeBlock(
            results,
            labels,
            part.used_names,
            available=available,
            named=named,
            flat=flat,
            language=language,
        )
        self.functions |= block.functions
        return block

    def ahead(self, part: PartCode, ends: Sequence[Node]) -> tuple[list[str], dict[Node, str]]:
        """Lines ahead of a loop that computes some nodes, and the names that they give.

        They take the parameters and givens that are read, and compute what follows from these and
        the step alone.
        """
        block = self.printed(part, part.ahead(ends), named=True)
        lines = [*self.given(part, names_in(ends)), *block.lines]
        return lines, block.names

    def given(self, part: PartCode, read: set[str]) -> list[str]:
        """Lines that take a part's parameters and givens, as far as they are read, from arrays."""
        return [
            f"{node.value} = {array}[{paths.index((part.part, path))}]"
            for names, array, paths in (
                (part.p, "params", self.model.places("parameters")),
                (part.given, "given", self.model.places("given")),
            )
            for path, node in leaves(names)
            if node.value in read
        ]

    def delays(self, part: PartCode) -> list[str]:
        """Lines that take the delays of a part's taps from arrays."""
        return [
            f"{name} = {array}[{tap.number}]"
            for tap in part.taps
            for name, array in (
                (part.delay_samples(tap), "delay_samples"),
                (part.delay_fraction(tap), "delay_fraction"),
            )
        ]

    def fetched(
        self, part: PartCode, past: Callable[[str, str], str], now: Callable[[str], str]
    ) -> list[str]:
        """Lines that read a part's inputs: what a signal was some samples ago, and what it is."""
        lines = []
        read = self.read(part)
        for tap in part.taps:
            for age, name in enumerate(part.tap_samples(tap)):
                if name in read:
                    back = f"{part.delay_samples(tap)} + {age}" if age else part.delay_samples(tap)
                    lines.append(f"{name} = {past(tap.tap.signal, back)}")
        inputs = [part.part_model.tap(name).signal for name in part.part_model.input_types]
        lines += [
            f"x_{signal} = {now(signal)}"
            for signal in dict.fromkeys(inputs)
            if signal in self.signals and f"x_{signal}" in read
        ]
        return lines

    def body(
        self,
        part: PartCode,
        targets: Mapping[SignalId, str],
        available: Mapping[Node, str],
    ) -> Sampled:
        """A part's sample, with signals that other parts need and what is kept.

        `targets` are the texts of where numbers are kept; limits are one number, a bit for each.
        `available` nodes have names already.
        """
        sources = {
            source: node for source, node in self.sources.items() if source.part == part.part
        }
        steps = dict(leaves(part.following))
        margin = [] if part.margin is None else [part.margin]
        outputs = [
            output for output in targets if output.part == part.part and output.kind != "link"
        ]
        results = [*sources.values(), *margin]
        results += [node for output in outputs for node in self.kept_nodes(part, output)]
        results += [steps[path] for path in self.carried[part.part]]
        block = self.printed(part, results, available=available)
        texts = iter(block.texts)
        lines = block.lines
        lines += [f"{part.source(source)} = {next(texts)}" for source in sources]
        margin_name = part.fresh("margin") if margin else ""
        if margin:
            lines += assigned(margin_name, next(texts))
        for output in outputs:
            lines += self.stored(part, output, targets[output], texts)
        following = [*texts]
        available = {**available, **block.names}
        links = [output for output in targets if output.part == part.part and output.kind == "link"]
        lines += self.kept_lines(part, links, targets, available)
        return Sampled(lines, margin_name, following)

    def kept_lines(
        self,
        part: PartCode,
        outputs: Sequence[SignalId],
        targets: Mapping[SignalId, str],
        available: Mapping[Node, str],
    ) -> list[str]:
        """Lines that keep some numbers of a part, after its sample."""
        nodes = [node for output in outputs for node in self.kept_nodes(part, output)]
        # nothing waits for these, and branches take long to compile
        block = self.printed(part, nodes, available=available, branches=False)
        lines = block.lines
        texts = iter(block.texts)
        for output in outputs:
            lines += self.stored(part, output, targets[output], texts)
        return lines

    def kept_nodes(self, part: PartCode, stored: SignalId) -> list[Node]:
        """What a number that is kept is made of: limits of a bit each."""
        return part.limits if stored.kind == "limits" else [self.observed(part, stored)]

    def stored(
        self, part: PartCode, stored: SignalId, target: str, texts: Iterator[str]
    ) -> list[str]:
        """Lines that keep a number, from the texts of what it is made of."""
        if stored.kind != "limits":
            return assigned(target, next(texts))
        bits = [f"choose({next(texts)}, {1 << bit}, 0)" for bit in range(len(part.limits))]
        return assigned(target, " | ".join(bits))

    def observed(self, part: PartCode, stored: SignalId) -> Node:
        """A number that is kept, of what is known at its part's end."""
        if stored.kind != "link":
            return part.node(stored)
        link = self.model.links[stored.path]
        sources: dict[str, Value] = {
            source.signal: graph.name(part.source(source)) for source in link.sources
        }
        assert link.equation is not None
        return part.link(link.equation, link.name, sources)

    def states(self, part: PartCode, steps: Sequence[str]) -> States:
        """How a part's state is taken out of a flat array, to the next sample, and back."""
        carried = self.carried[part.part]
        paths = self.model.places("state")
        nodes = dict(leaves(part.state))
        names = [nodes[path].value for path in carried]
        flat = [f"states[{paths.index((part.part, path))}]" for path in carried]
        pairs = [*zip(names, flat, strict=True)]
        return States(
            load=[f"{name} = {element}" for name, element in pairs],
            step=assigned(", ".join(names), ", ".join(steps)) if carried else [],
            save=[f"{element} = {name}" for name, element in pairs],
        )


class Sampled(NamedTuple):
    """Text of one sample of a part."""

    lines: list[str]
    margin: str
    """Name of the margin of its domain; empty without one."""
    following: list[str]
    """What the states that are carried become."""


class States(NamedTuple):
    """Lines around the states of a part."""

    load: list[str]
    step: list[str]
    save: list[str]


def lower(first: Node, second: Node) -> Node:
    """The lower of two margins; not a number if one of them is not."""
    test = graph.either(graph.make("<=", first, second), graph.make("!=", first, first))
    return graph.choose(test, first, second)


def output_of(model: Model, output: str) -> tuple[SignalId, bool]:
    """Where a signal comes from, and whether it is that signal's integral."""
    integral = output in model.integrals
    name = model.integrals[output] if integral else output
    if name in model.links:
        return SignalId(model.links[name].after, "link", name), integral
    for index in range(len(model.parts) - 1, -1, -1):
        part = model.parts[index]
        if part.signals is not None and name in floats_of(part.signals):
            return SignalId(index, "signals", name), integral
        if name in floats_of(part.state):
            return SignalId(index, "state", name), integral
    signals = [name for part in model.parts for name in part.signal_names]
    raise InputError(
        f"{model.name} has no signal '{output}'; it has "
        f"{', '.join([*signals, *model.links, *model.integrals])}."
    )
