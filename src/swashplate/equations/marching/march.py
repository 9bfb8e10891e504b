"""Marches: one model over its inputs, a sample after the other, for one set or many at once.

Every march is generated as readable source in which the model's equations stand as straight code
over scalars (`scalars`). `PartCode` has one sample of a part, and the functions below wrap it as

- `march_source`: the march, over whole records or a block of them for the Jacobian,
- `advance_source`: one sample, for steppers and for kernels that close loops.

Many sets side by side are in `lanes`.

Arithmetic is strict and in the order of the equations, so that all of them give the same bits.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain
from typing import Any

from swashplate.equations import expressions as ex
from swashplate.equations.code import Code, Value, leaves
from swashplate.equations.equation import inlined
from swashplate.equations.expressions import Node, text
from swashplate.equations.fields import floats_of
from swashplate.equations.marching.part import PartCode, Stored, choose
from swashplate.equations.marching.pieces import PIECE
from swashplate.equations.model import Model, Source
from swashplate.equations.reading import read
from swashplate.equations.writing import function_source, indented, lines_of
from swashplate.errors import InputError

_OWN = """
n m j c lane first last worst h half value error total count span used progress values lines
whole fraction params given constants states out flags records before measured weight outputs flat
table kept tangent columns program plan sink room block met machine volts current speed voltage
target counts coming cost rate integral shown choose
"""
RESERVED = {*_OWN.split(), *(name for name in vars(math) if not name.startswith("_"))}
"""Names that the kernels use themselves."""


@inlined
def sample_at(record: Any, index: int, before: float) -> float:
    """Sample of a record, or what it was before the record began."""
    return record[index] if index >= 0 else before


class Sampler:
    """One sample of a whole model: the code of its parts, and what of it is needed.

    `wanted` are numbers that are kept at every sample; parts that none of them needs are left out.
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
            PartCode(model, i, signals, options[i], taken, ruled=ruled)
            for i in range(len(model.parts))
        ]
        self.wanted = tuple(wanted)
        self.ends: list[list[Node]] = [[] for _ in self.parts]
        """Results of each part that are needed."""
        self.carried: list[list[str]] = [[] for _ in self.parts]
        """Paths of the states that are needed."""
        self.sources: dict[Source, Node] = {}
        self._settle()

    def _settle(self) -> None:
        """Find out what is needed: what is kept, what it follows from, and their margins."""
        for part in self.parts:
            for each in self.wanted:
                if each.part == part.part and each.kind not in ("link", "limits"):
                    self.ends[part.part].append(part.node(each))
                if each.part == part.part and each.kind == "limits":
                    self.ends[part.part] += part.limits
        for each in self.wanted:
            if each.kind == "link":
                self._need(self.model.links[each.path].sources)
        for i in range(len(self.parts) - 1, -1, -1):
            part = self.parts[i]
            if not self.ends[i]:
                continue
            if part.margin is not None:
                self.ends[i].append(part.margin)
            state, following = dict(leaves(part.state)), dict(leaves(part.following))
            name_of = {node.value: path for path, node in state.items()}
            while True:
                read = part.code.reads(self.ends[i])
                new = [
                    path
                    for name, path in name_of.items()
                    if name in read and path not in self.carried[i]
                ]
                if not new:
                    break
                self.carried[i] += new
                self.ends[i] += [following[path] for path in new]
            self.carried[i] = [path for path in state if path in self.carried[i]]
            for name in part.own.input_types:
                link = self.model.link_of(i, name)
                if link is not None and any(part.source(s) in read for s in link.sources):
                    self._need(link.sources)

    def _need(self, sources: Iterable[Source]) -> None:
        for source in sources:
            if source not in self.sources:
                node = self.parts[source.part].signal(source.signal)
                self.sources[source] = node
                self.ends[source.part].append(node)

    @property
    def names(self) -> dict[str, Any]:
        """What the text refers to."""
        found: dict[str, Any] = {"sample_at": sample_at, "choose": choose}
        for part in self.parts:
            found |= part.code.names | part.prologue.names
        return found

    def used(self) -> list[PartCode]:
        """Parts that are needed."""
        return [part for part in self.parts if self.ends[part.part]]

    def read(self, part: PartCode) -> set[str]:
        """Names from outside that a part needs."""
        return part.code.reads(self.ends[part.part])

    def ahead(
        self, parts: Iterable[PartCode] | None = None, needed: set[str] | None = None
    ) -> list[str]:
        """Lines ahead of a loop: parameters, givens and constants that are needed."""
        lines = []
        for part in parts if parts is not None else self.used():
            read = self.read(part) if needed is None else needed
            constants = [node for _, node in leaves(part.known["k"])] if "k" in part.known else []
            wanted = [node for node in constants if node.reads & read]
            lines += self.given(part, read | part.prologue.reads(wanted))
            lines += lines_of(part.prologue, wanted)
        return lines

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
        if "k" not in part.known:
            return []
        read = self.read(part)
        found: dict[str, None] = {}
        for _, node in leaves(part.known["k"]):
            found |= dict.fromkeys(sorted(node.reads & read))
        own = {node.value for _, node in leaves(part.p)}
        return [name for name in found if name not in own]

    def places(self) -> list[str]:
        """Lines that unpack records and the taps' places."""
        lines = []
        for k, signal in enumerate(self.signals):
            lines += [f"{signal} = records[{k}]", f"{signal}_before = before[{k}]"]
        for part in self.used():
            for tap in part.taps:
                lines.append(f"{part.whole(tap)} = whole[{tap.number}]")
                lines.append(f"{part.fraction(tap)} = fraction[{tap.number}]")
        return lines

    def fetched(self, part: PartCode) -> list[str]:
        """Lines that read a part's inputs from the records at sample n."""
        lines, read = [], self.read(part)
        for tap in part.taps:
            for j, name in enumerate(part.tap_samples(tap)):
                if name in read:
                    back = f" - {j}" if j else ""
                    lines.append(
                        f"{name} = sample_at({tap.tap.signal}, n - {part.whole(tap)}{back}, "
                        f"{tap.tap.signal}_before)"
                    )
        for name in part.own.input_types:
            signal = part.own.tap(name).signal
            if f"x_{signal}" in read and signal in self.signals:
                lines.append(f"x_{signal} = {signal}[n]")
        return lines

    def body(self, part: PartCode) -> list[str]:
        """Lines of a part's sample, and of the signals that other parts need of it."""
        lines = lines_of(part.code, self.ends[part.part])
        for source, node in self.sources.items():
            if source.part == part.part:
                lines.append(f"{part.source(source)} = {text(node)}")
        return lines

    def stored(
        self, part: PartCode, stored: Sequence[Stored], into: Callable[[int], str]
    ) -> list[str]:
        """Lines that write what is kept of a part; `into` says where, by the place in `stored`.

        Limits are one number, a bit for each.
        """
        lines = []
        for row, each in enumerate(stored):
            if each.part != part.part:
                continue
            if each.kind == "limits":
                bits = (f"({1 << k} if {text(n)} else 0)" for k, n in enumerate(part.limits))
                lines.append(f"{into(row)} = {' | '.join(bits)}")
            else:
                code, made = self.observed(part, each)
                lines += [*lines_of(code, [made]), f"{into(row)} = {text(made)}"]
        return lines

    def observed(self, part: PartCode, stored: Stored) -> tuple[Code, Node]:
        """A number that is kept, and the code that makes it of what is known at its part's end."""
        code = Code(part.code.taken)
        if stored.kind != "link":
            return code, part.node(stored)
        link = self.model.links[stored.path]
        sources: dict[str, Value] = {s.signal: ex.name(part.source(s)) for s in link.sources}
        assert link.equation is not None
        made = code.named(read(code, link.equation, sources), link.name)
        assert isinstance(made, Node)
        return code, made

    def _flat(self, part: PartCode) -> list[tuple[str, str]]:
        """Names of a part's states, each with its place in a flat array."""
        names, places = dict(leaves(part.state)), self.model.places("state")
        carried = self.carried[part.part]
        return [(names[p].value, f"states[{places.index((part.part, p))}]") for p in carried]

    def load(self, part: PartCode) -> list[str]:
        """Lines that take a part's state out of the flat array."""
        return [f"{name} = {place}" for name, place in self._flat(part)]

    def save(self, part: PartCode) -> list[str]:
        """Lines that put it back."""
        return [f"{place} = {name}" for name, place in self._flat(part)]

    def step(self, part: PartCode) -> list[str]:
        """Lines that take a part's state to the next sample, all of it at once."""
        names, following = dict(leaves(part.state)), dict(leaves(part.following))
        if not self.carried[part.part]:
            return []
        left = ", ".join(names[path].value for path in self.carried[part.part])
        right = ", ".join(text(following[path]) for path in self.carried[part.part])
        return [f"{left} = {right}"]


def lower(one: Node, two: Node) -> Node:
    """The lower of two margins; not a number once one of them was none."""
    test = ex.make("or", ex.make("<=", one, two), ex.make("!=", one, one))
    return ex.choose(test, one, two)


def march_source(
    model: Model, signals: Sequence[str], options: Sequence[Any], rows: Mapping[Stored, str]
) -> tuple[str, dict[str, Any]]:
    """Text of the march over samples as a `piece`, and what its names mean.

    Parameters
    ----------
    rows : mapping of Stored to str
        What is kept, and where it goes at sample ``n - first``.
    """
    stored, places = tuple(rows), tuple(rows.values())
    sampler = Sampler(model, signals, options, stored)
    parts = sampler.used()
    lines = ["last = first + count", *sampler.places(), *sampler.ahead()]
    samples: list[list[str]] = []
    for part in parts:
        lines += sampler.load(part)
        inner = [*sampler.fetched(part), *sampler.body(part)]
        inner += sampler.stored(part, stored, lambda row: places[row])
        if part.margin is not None:
            margin = text(part.margin)
            inner += [f"worst = {margin} if {margin} < worst else worst", f"total += {margin}"]
        samples.append([*inner, *sampler.step(part)])
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
    for part in parts:
        lines += sampler.save(part)
    if margins:
        # a sum is no number once a margin was none
        lines += [
            "worst = worst if total == total or worst <= 0.0 else total",
            "met[0] = worst if worst < met[0] or worst != worst else met[0]",
        ]
    says = f"March {model.name} over its inputs."
    return function_source(f"march({PIECE})", says, lines, "@piece"), sampler.names


def advance_source(
    model: Model, signals: Sequence[str], options: Sequence[Any], stored: Sequence[Stored]
) -> tuple[str, dict[str, Any]]:
    """Text of one sample, for steppers and for kernels that close loops, and what its names mean.

    ``prepare(params, given, h, constants)`` computes constants once and returns how many there are.
    ``advance(values, lines, whole, fraction, params, given, h, constants, states, out)`` shifts the
    newest values into the delay lines (a row for each signal, newest first), fills ``out`` with the
    numbers of this sample in the order of `stored`, takes ``states`` to the next one, and returns
    the margin of the domain.
    """
    sampler = Sampler(model, signals, options, stored)
    parts = sampler.used()
    tapped = {tap.tap.signal for part in parts for tap in part.taps}
    lines, shifted = [], []
    for k, signal in enumerate(sampler.signals):
        if signal in tapped:
            shifted.append(f"lines[{k}, j] = lines[{k}, j - 1]")
            lines.append(f"lines[{k}, 0] = values[{k}]")
    if shifted:
        lines = ["for j in range(lines.shape[1] - 1, 0, -1):", *indented(shifted), *lines]
    prepare: list[str] = []
    count = 0
    for part in parts:
        read = sampler.read(part)
        prepare += sampler.ahead([part])
        for name in sampler.constants(part):
            prepare.append(f"constants[{count}] = {name}")
            lines.append(f"{name} = constants[{count}]")
            count += 1
        lines += [*sampler.given(part, read), *sampler.load(part)]
        for tap in part.taps:
            lines.append(f"{part.fraction(tap)} = fraction[{tap.number}]")
            row = sampler.signals.index(tap.tap.signal)
            for j, name in enumerate(part.tap_samples(tap)):
                if name in read:
                    lines.append(f"{name} = lines[{row}, whole[{tap.number}] + {j}]")
        for k, signal in enumerate(sampler.signals):
            if f"x_{signal}" in read:
                lines.append(f"x_{signal} = values[{k}]")
        lines += sampler.body(part)
        lines += sampler.stored(part, stored, lambda row: f"out[{row}]")
    lines.append("worst = inf")
    for part in parts:
        if part.margin is not None:
            lines.append(f"worst = {text(lower(ex.name('worst'), part.margin))}")
        lines += [*sampler.step(part), *sampler.save(part)]
    lines.append("return worst")
    texts = [
        function_source(
            "prepare(params, given, h, constants)",
            f"Constants of {model.name}.",
            [*prepare, f"return {count}"],
        ),
        function_source(
            "advance(values, lines, whole, fraction, params, given, h, constants, states, out)",
            f"One sample of {model.name}.",
            lines,
            "@inlined",
        ),
    ]
    return "\n\n".join(texts), sampler.names


def output_of(model: Model, output: str) -> tuple[Stored, bool]:
    """Where a signal comes from, and whether it is that signal's integral.

    Raises
    ------
    InputError
        If the model has no such signal.
    """
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
