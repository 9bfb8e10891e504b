"""Marches: one model over its inputs, a sample after the other, for one set or many at once.

Every march is generated as readable source in which the model's equations stand as straight code
over scalars (`code`). `PartCode` has one sample of a part, and the functions below wrap it as

- `march_source`: the march, over whole records or a block of them for the Jacobian,
- `step_source`: one sample, for steppers and for kernels that close loops.

Many sets side by side are in `lanes`.

Arithmetic is strict and in the order of the equations, so that all of them give the same bits.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from typing import Any

from swashplate.equations import expressions as ex
from swashplate.equations.code import Code, Item, Let, Value, leaves
from swashplate.equations.declaration import inlined
from swashplate.equations.expressions import Node, text
from swashplate.equations.fields import floats_of
from swashplate.equations.marching.part import PartCode, Stored, choose
from swashplate.equations.marching.pieces import PIECE
from swashplate.equations.model import Model, Source
from swashplate.equations.reading import read
from swashplate.equations.writing import function_source, indented, lines_of
from swashplate.errors import InputError

_OWN = """
n m j c lane first last worst h half value error total count size used progress values lines
whole fraction params given constants states out flags records before measured weight outputs flat
inputs table kept tangent lanes columns program plan sink room block met machine volts current speed
voltage target counts coming cost rate integral shown choose width
"""
RESERVED = {*_OWN.split(), *(name for name in vars(math) if not name.startswith("_"))}
"""Names that the kernels use themselves."""
MACHINE = [
    "inputs",
    "lines",
    "whole",
    "fraction",
    "params",
    "given",
    "h",
    "constants",
    "states",
    "outputs",
]
"""What a step takes from a `Machine`."""


@inlined
def sample_at(record: Any, index: int, before: float) -> float:
    """Sample of a record, or what it was before the record began."""
    return record[index] if index >= 0 else before


class Sampler:
    """One sample of a whole model: the code of its parts, and what of it is needed.

    `wanted` are numbers that are kept at every sample; parts that none of them needs are left out.

    Attributes
    ----------
    parts, used : list of PartCode
        All parts, and those that are needed.
    ends, carried : list
        Of each part the results that are needed, and the paths of the states.
    sources : dict of Source to Node
        Signals that other parts or links need.
    """

    def __init__(
        self,
        model: Model,
        signals: Sequence[str],
        options: Sequence[Any],
        wanted: Sequence[Stored],
        *,
        ruled: bool = False,
    ) -> None:
        self.model, self.signals = model, tuple(signals)
        taken = {*RESERVED, *self.signals, *(f"{each}_before" for each in self.signals)}
        self.parts = [
            PartCode(model, i, signals, each, taken, ruled=ruled) for i, each in enumerate(options)
        ]
        self.ends: list[list[Node]] = [[] for _ in self.parts]
        self.carried: list[list[str]] = [[] for _ in self.parts]
        self.sources: dict[Source, Node] = {}
        for each in wanted:
            if each.kind == "link":
                self._need(model.links[each.path].sources)
            else:
                part = self.parts[each.part]
                self.ends[each.part] += part.limits if each.kind == "limits" else [part.node(each)]
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
            read = part.code.reads(ends)
            new = {path for path, node in state.items() if node.value in read} - carried
            if not new:
                break
            carried |= new
            ends += [following[path] for path in state if path in new]
        self.carried[part.part] = [path for path in state if path in carried]
        for name in part.own.input_types:
            link = self.model.link_of(part.part, name)
            if link is not None and any(part.source(each) in read for each in link.sources):
                self._need(link.sources)

    def _need(self, sources: Sequence[Source]) -> None:
        for source in (each for each in sources if each not in self.sources):
            node = self.sources[source] = self.parts[source.part].signal(source.signal)
            self.ends[source.part].append(node)

    def items(self, part: PartCode) -> list[Item]:
        """A part's sample, and the signals of it that other parts or links need."""
        own = [(source, node) for source, node in self.sources.items() if source.part == part.part]
        return [*part.code.items, *(Let(part.source(source), node) for source, node in own)]

    def outside(self) -> dict[str, Stored]:
        """What is known ahead of a sample, by name: numbers, the state, places and records."""
        known = {"h": Stored(0, "h")}
        for part in self.used:
            i = part.part
            for kind, value in (("p", part.p), ("given", part.given), ("state", part.state)):
                known |= {node.value: Stored(i, kind, path) for path, node in leaves(value)}
            known |= part.outside
            for tap in part.taps:
                known[part.fraction(tap)] = Stored(i, "fraction", str(tap.number))
        return known

    @property
    def names(self) -> dict[str, Any]:
        """What the text refers to."""
        found: dict[str, Any] = {"sample_at": sample_at, "choose": choose}
        for part in self.parts:
            found |= part.code.names | part.prologue.names
        return found

    def read(self, part: PartCode) -> set[str]:
        """Names from outside that a part needs."""
        return part.code.reads(self.ends[part.part])

    def ahead(self, part: PartCode, read: set[str]) -> list[str]:
        """Lines ahead of a loop: a part's parameters, givens and constants that are read in it."""
        wanted = [node for node in part.constants if node.reads & read]
        lines = lines_of(part.prologue, wanted)
        return [*self.given(part, read | part.prologue.reads(wanted)), *lines]

    def given(self, part: PartCode, read: set[str]) -> list[str]:
        """Lines that take a part's parameters and givens, as far as they are read, from arrays."""
        return [
            f"{node.value} = {array}[{places.index((part.part, path))}]"
            for names, array, places in (
                (part.p, "params", self.model.places("parameters")),
                (part.given, "given", self.model.places("given")),
            )
            for path, node in leaves(names)
            if node.value in read
        ]

    def constants(self, part: PartCode) -> list[str]:
        """Names of a part's constants that its sample reads."""
        found = dict.fromkeys(name for node in part.constants for name in sorted(node.reads))
        read = self.read(part) - part.parameters.keys()
        return [name for name in found if name in read]

    def places(self, part: PartCode) -> list[str]:
        """Lines that take the places of a part's taps from arrays."""
        return [
            f"{name} = {array}[{tap.number}]"
            for tap in part.taps
            for name, array in ((part.whole(tap), "whole"), (part.fraction(tap), "fraction"))
        ]

    def fetched(
        self, part: PartCode, past: Callable[[str, str], str], now: Callable[[str], str]
    ) -> list[str]:
        """Lines that read a part's inputs: what a signal was some samples ago, and what it is."""
        lines, read = [], self.read(part)
        for tap in part.taps:
            for j, name in enumerate(part.tap_samples(tap)):
                if name in read:
                    back = f"{part.whole(tap)} + {j}" if j else part.whole(tap)
                    lines.append(f"{name} = {past(tap.tap.signal, back)}")
        inputs = [part.own.tap(name).signal for name in part.own.input_types]
        known = [each for each in dict.fromkeys(inputs) if each in self.signals]
        return lines + [f"x_{each} = {now(each)}" for each in known if f"x_{each}" in read]

    def body(self, part: PartCode, places: Mapping[Stored, str]) -> list[str]:
        """Lines of a part's sample, of signals that other parts need, and of what is kept.

        `places` are the texts of where numbers are kept; limits are one, a bit for each.
        """
        lines = lines_of(part.code, self.ends[part.part])
        for source, node in self.sources.items():
            if source.part == part.part:
                lines.append(f"{part.source(source)} = {text(node)}")
        for each in (each for each in places if each.part == part.part):
            if each.kind == "limits":
                bits = (f"({1 << k} if {text(n)} else 0)" for k, n in enumerate(part.limits))
                lines.append(f"{places[each]} = {' | '.join(bits)}")
            else:
                code, made = self.observed(part, each)
                lines += [*lines_of(code, [made]), f"{places[each]} = {text(made)}"]
        return lines

    def observed(self, part: PartCode, stored: Stored) -> tuple[Code, Node]:
        """A number that is kept, and the code that makes it of what is known at its part's end."""
        code = Code(part.code.taken, ruled=part.code.ruled)
        if stored.kind != "link":
            return code, part.node(stored)
        link = self.model.links[stored.path]
        sources: dict[str, Value] = {s.signal: ex.name(part.source(s)) for s in link.sources}
        assert link.equation is not None
        made = code.named(read(code, link.equation, sources), link.name)
        assert isinstance(made, Node)
        return code, made

    def states(self, part: PartCode) -> tuple[list[str], list[str], list[str]]:
        """Lines that take a part's state out of a flat array, to the next sample, and back."""
        carried, places = self.carried[part.part], self.model.places("state")
        names, following = dict(leaves(part.state)), dict(leaves(part.following))
        own = [names[path].value for path in carried]
        flat = [f"states[{places.index((part.part, path))}]" for path in carried]
        step = f"{', '.join(own)} = {', '.join(text(following[path]) for path in carried)}"
        pairs = [*zip(own, flat, strict=True)]
        load, save = [f"{a} = {b}" for a, b in pairs], [f"{b} = {a}" for a, b in pairs]
        return load, [step] if carried else [], save


def lower(one: Node, two: Node) -> Node:
    """The lower of two margins; not a number once one of them was none."""
    test = ex.make("or", ex.make("<=", one, two), ex.make("!=", one, one))
    return ex.choose(test, one, two)


def march_source(
    model: Model, signals: Sequence[str], options: Sequence[Any], places: Mapping[Stored, str]
) -> tuple[str, dict[str, Any]]:
    """Text of the march over samples as a `piece`, and what its names mean.

    `places` says what is kept, and where it goes at sample ``n``.
    """
    sampler = Sampler(model, signals, options, [*places])
    parts = sampler.used
    lines, saved, samples = ["last = first + count"], list[str](), list[list[str]]()
    for k, signal in enumerate(sampler.signals):
        lines += [f"{signal} = records[{k}]", f"{signal}_before = before[{k}]"]
    for part in parts:
        load, step, save = sampler.states(part)
        lines += [*sampler.places(part), *sampler.ahead(part, sampler.read(part)), *load]
        saved += save
        fetched = sampler.fetched(
            part,
            lambda signal, back: f"sample_at({signal}, n - ({back}), {signal}_before)",
            lambda signal: f"{signal}[n]",
        )
        inner = [*fetched, *sampler.body(part, places)]
        if part.margin is not None:
            margin = text(part.margin)
            inner += [f"worst = {margin} if {margin} < worst else worst", f"total += {margin}"]
        samples.append([*inner, *step])
    margins = any(part.margin is not None for part in parts)
    lines += ["worst, total = inf, 0.0"] if margins else []
    passed = [parts[-1].source(each) for each in sampler.sources if each.part != parts[-1].part]
    if passed and any(sampler.carried[part.part] for part in parts[:-1]):
        # the last part is a sample behind the others, so that neither waits for the other
        late = re.compile(rf"\b({'|'.join(passed)})\b")
        lines += [*(f"{name} = 0.0" for name in passed), "for m in range(first, last + 1):"]
        lines += indented([f"late_{name} = {name}" for name in passed])
        lines += indented(["if m < last:", "    n = m", *indented(chain(*samples[:-1]))])
        following = [late.sub(r"late_\1", line) for line in samples[-1]]
        lines += indented(["if m > first:", "    n = m - 1", *indented(following)])
    else:
        lines += ["for n in range(first, last):", *indented(chain(*samples))]
    lines += saved
    if margins:
        # a sum is no number once a margin was none
        lines += [
            "worst = worst if total == total or worst <= 0.0 else total",
            "met[0] = worst if worst < met[0] or worst != worst else met[0]",
        ]
    says = f"March {model.name} over its inputs."
    return function_source(f"march({PIECE})", says, lines, "@piece"), sampler.names


def step_source(
    model: Model, signals: Sequence[str], options: Sequence[Any], stored: Sequence[Stored]
) -> tuple[str, dict[str, Any], int]:
    """Text of one sample, for steppers and loops, what it refers to, and how many constants it has.

    ``prepare(params, given, h, constants)`` computes constants once. ``step(machine)`` shifts the
    newest inputs into the delay lines (a row for each signal, newest first), fills the outputs with
    the numbers of this sample in the order of `stored`, takes the states to the next one, and
    returns the margin of the domain.
    """
    sampler = Sampler(model, signals, options, stored)
    row = sampler.signals.index
    tapped = sorted({row(tap.tap.signal) for part in sampler.used for tap in part.taps})
    lines = [f"{each} = machine.{each}" for each in MACHINE]
    prepare, ends, count = list[str](), ["worst = inf"], 0
    if tapped:
        lines += ["for j in range(lines.shape[1] - 1, 0, -1):"]
        lines += [f"    lines[{k}, j] = lines[{k}, j - 1]" for k in tapped]
        lines += [f"lines[{k}, 0] = inputs[{k}]" for k in tapped]
    places = {each: f"outputs[{k}]" for k, each in enumerate(stored)}
    for part in sampler.used:
        read, (load, step, save) = sampler.read(part), sampler.states(part)
        prepare += sampler.ahead(part, read)
        for name in sampler.constants(part):
            prepare.append(f"constants[{count}] = {name}")
            lines.append(f"{name} = constants[{count}]")
            count += 1
        lines += [*sampler.places(part), *sampler.given(part, read), *load]
        lines += sampler.fetched(
            part,
            lambda signal, back: f"lines[{row(signal)}, {back}]",
            lambda signal: f"inputs[{row(signal)}]",
        )
        lines += sampler.body(part, places)
        if part.margin is not None:
            ends.append(f"worst = {text(lower(ex.name('worst'), part.margin))}")
        ends += [*step, *save]
    head, says = "prepare(params, given, h, constants)", f"Constants of {model.name}."
    prepared = function_source(head, says, [*prepare, "return"])
    says, lines = f"One sample of {model.name}.", [*lines, *ends, "return worst"]
    stepped = function_source("step(machine)", says, lines, "@inlined")
    return f"{prepared}\n\n{stepped}", sampler.names, count


def output_of(model: Model, output: str) -> tuple[Stored, bool]:
    """Where a signal comes from, and whether it is that signal's integral."""
    integral = output in model.integrals
    name = model.integrals[output] if integral else output
    if name in model.links:
        return Stored(model.links[name].after, "link", name), integral
    for i in range(len(model.parts) - 1, -1, -1):
        own = model.parts[i]
        if own.signals is not None and name in floats_of(own.signals):
            return Stored(i, "signals", name), integral
        if name in floats_of(own.state):
            return Stored(i, "state", name), integral
    known = [name for part in model.parts for name in part.signal_names]
    raise InputError(
        f"{model.name} has no signal '{output}'; it has "
        f"{', '.join([*known, *model.links, *model.integrals])}."
    )
