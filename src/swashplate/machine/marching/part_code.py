"""One sample of a part of a model as a graph, and the state that the part starts from."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from copy import copy
from functools import cached_property, lru_cache
from typing import Any, NamedTuple, get_type_hints

from swashplate.errors import InputError
from swashplate.machine import graph
from swashplate.machine.code_generation.functions import fresh_name
from swashplate.machine.code_generation.tracing import Trace, callee_of
from swashplate.machine.code_generation.values import Value, leaves, node_of, rebuilt
from swashplate.machine.fields import defaults_of, floats_of
from swashplate.machine.graph import LEAVES, Node, names_in, ordered
from swashplate.machine.language import is_named_tuple
from swashplate.machine.model import (
    Equation,
    History,
    Link,
    Model,
    SignalSource,
    Tap,
    Window,
    arguments_of,
    linear,
    mean_over_sample,
    newest,
    previous,
)

HOLDS: dict[str, Equation] = {
    "none": newest,
    "linear": linear,
    "previous": previous,
    "mean": mean_over_sample,
}


class SignalId(NamedTuple):
    """A number of a part: what a march can keep, or what that is derived by."""

    part: int
    kind: str
    """``signals``, ``state``, ``limits``, ``input``, ``link``, ``tap`` for a tap's sample; ``p``,
    ``given`` and ``fraction`` for a parameter, a given and the fraction in a tap's delay; ``k`` for
    what follows from parameters, givens and the step alone."""
    path: str = ""
    """Of the number; name of the input or link; input and number of a tap's sample, ``at.0``;
    number of the tap; name in the code of what follows from parameters."""


class TapOf(NamedTuple):
    """A tap of a part, with its number among all taps of the model."""

    part: int
    input: str
    number: int
    tap: Tap
    between: int = -1
    """Number of its line among those of signals between parts, -1 for a signal from outside."""


@lru_cache(maxsize=256)
def taps_of(model: Model, signals: tuple[str, ...]) -> tuple[TapOf, ...]:
    """All taps, numbered: on signals that are given as records, and on signals between parts."""
    taps: list[TapOf] = []
    between = signals_between(model)
    for index, part in enumerate(model.parts):
        for name in part.input_types:
            tap = part.tap(name)
            if name not in part.taps:
                continue
            if model.link_of(index, name) is not None:
                taps.append(
                    TapOf(index, name, len(taps), tap, between.index(model.line(index, name)))
                )
            elif tap.signal in signals:
                taps.append(TapOf(index, name, len(taps), tap))
    return tuple(taps)


@lru_cache(maxsize=256)
def signals_between(model: Model) -> tuple[str, ...]:
    """Lines of signals between parts of which taps read past samples: a march fills them."""
    linked = [
        model.line(index, name)
        for index, part in enumerate(model.parts)
        for name in part.input_types
        if name in part.taps and model.link_of(index, name) is not None
    ]
    return tuple(dict.fromkeys(linked))


class PartCode:
    """One sample of a part, as nodes of numbers that have names.

    `signals` are the external ones that are given as records; for the others the default parameter
    counts. `used_names` are names that are in use already.
    """

    def __init__(
        self,
        model: Model,
        part: int,
        signals: Sequence[str],
        options: Any,
        used_names: set[str] | None = None,
        trace: Trace | None = None,
    ) -> None:
        self.model, self.part, self.part_model = model, part, model.parts[part]
        self.records, self.options = tuple(signals), options
        self.trace = Trace(replacements=self.part_model.replacements) if trace is None else trace
        self.used_names: set[str] = set() if used_names is None else used_names
        self.prefix = model.prefix(part).replace(".", "_")
        self.used_names.add("h")
        self.taps = [tap for tap in taps_of(model, self.records) if tap.part == part]
        for tap in self.taps:
            self.used_names |= {
                *self.tap_samples(tap),
                self.delay_fraction(tap),
                self.delay_samples(tap),
            }
        part_model = self.part_model
        self.used_names |= {f"x_{part_model.tap(name).signal}" for name in part_model.input_types}
        self.used_names |= {
            self.source(source) for link in model.links.values() for source in link.sources
        }
        self.p = _named(part_model.parameters, self._fresh("p"))
        self.given = _named(part_model.given, self._fresh("given")) if part_model.given else ()
        self.state = _named(part_model.state, self._fresh("s"))
        self.parameters = {node.value: path for path, node in leaves(self.p)}
        """Path of each parameter by the name that stands for it."""
        self.arguments: dict[str, Value] = {"p": self.p, "h": graph.name("h"), "given": self.given}
        self.arguments["state"] = self.state
        self.inputs = {name: self._input(name) for name in part_model.input_types}
        self.arguments |= self.inputs
        if part_model.inputs is not None:
            self.arguments["inputs"] = part_model.inputs(*self.inputs.values())
        if part_model.sample is not None:
            self.arguments["signals"] = self._call(part_model.sample)
        self.following = self._call(part_model.step)
        numbers = tuple(
            path for path, node in leaves(self.following) if node.kind in ("float", "int")
        )
        if type(self.following) is not part_model.state or numbers != floats_of(part_model.state):
            raise InputError(
                f"Model {part_model.name}: {part_model.step.__name__} must return a "
                f"{part_model.state.__name__} of numbers on every path."
            )

    def fresh(self, stem: str) -> str:
        """A name that is not yet taken."""
        return fresh_name(stem.replace(".", "_"), self.used_names)

    def _fresh(self, letter: str) -> Callable[[str], str]:
        """What gives the numbers of a named tuple their names."""
        return lambda path: self.fresh(f"{letter}_{self.prefix}{path}")

    def _call(self, equation: Equation, **inputs: Value) -> Value:
        """What one of the part's equations returns; `inputs` stand in place of the part's own."""
        values = {**self.arguments, **inputs}
        arguments = {name: values[name] for name in arguments_of(equation) if name in values}
        if "options" in arguments_of(equation):
            arguments["options"] = self.options
        returned = self.trace.call(equation, arguments)
        is_number = node_of(returned) is not None
        self.trace.label(returned, equation.__name__ if is_number else "")
        return returned

    def _input(self, name: str) -> Value:
        """An input as a name, a window of names, or what a hold makes of one."""
        tap = self.part_model.tap(name)
        record_taps = {tap.input: tap for tap in self.taps}
        record_tap = record_taps.get(name)
        link = self.model.link_of(self.part, name)
        if record_tap is None and link is not None:
            return self._linked(link)
        if record_tap is None:
            if tap.signal in self.records:
                return graph.name(f"x_{tap.signal}")
            if name not in self.part_model.defaults:
                # refused when the model gets its numbers; until then a constant stands for it
                return graph.ZERO
            return dict(leaves(self.p))[self.part_model.defaults[name]]
        samples = tuple(map(graph.name, self.tap_samples(record_tap)))
        if tap.longest:
            longest = graph.make("/", dict(leaves(self.p))[tap.longest], graph.name("h"))
            return History._make((samples[0], longest))
        fraction = graph.name(self.delay_fraction(record_tap))
        window = Window._make((samples, fraction))
        return window if tap.width else self._call(HOLDS[tap.hold], window=window)

    def _linked(self, link: Link) -> Node:
        """A signal between parts, from the names of its sources."""
        sources = [graph.name(self.source(source)) for source in link.sources]
        return sources[0] if link.equation is None else self.link(link.equation, link.name, sources)

    def link(self, equation: Equation, name: str, sources: Sequence[Node]) -> Node:
        """A signal that an equation makes of several."""
        arguments = dict(zip(arguments_of(equation), sources, strict=True))
        signal = node_of(self.trace.run(callee_of(equation, self.model.replacements), arguments))
        assert signal is not None
        self.trace.label(signal, name)
        return signal

    def source(self, source: SignalSource) -> str:
        """Name of a signal that another part needs."""
        return f"x_{self.model.parts[source.part].path}_{source.signal}".replace(".", "_")

    def tapped(self, tap: TapOf) -> Node:
        """The signal between parts that a tap reads, as it is now."""
        link = self.model.link_of(self.part, tap.input)
        assert link is not None
        return self._linked(link)

    @property
    def between(self) -> list[TapOf]:
        """Its taps on signals between parts."""
        return [tap for tap in self.taps if tap.between >= 0]

    def tap_samples(self, tap: TapOf) -> list[str]:
        """Names of a tap's samples, newest first."""
        return [f"{self.prefix}{tap.input}_{age}" for age in range(tap.tap.samples)]

    def delay_fraction(self, tap: TapOf) -> str:
        """Name of the fraction of a sample in a tap's delay."""
        return f"{self.prefix}{tap.input}_f"

    @property
    def delay_fractions(self) -> list[str]:
        """Names of the fractions in the delays of all taps, which do not change during a march."""
        return [self.delay_fraction(tap) for tap in self.taps]

    def delay_samples(self, tap: TapOf) -> str:
        """Name of the whole samples in a tap's delay."""
        return f"{self.prefix}{tap.input}_whole"

    @cached_property
    def tests(self) -> list[Node]:
        """What parameters and givens decide alone, of all that a march needs."""
        numbers = {node.value for _, node in (*leaves(self.p), *leaves(self.given))}
        ends = [node for _, node in (*leaves(self.following), *leaves(self._signals))]
        ends += [] if self.margin is None else [self.margin]
        fixed, tests = set[Node](), list[Node]()
        for node in ordered(ends):
            is_number = node.op == "number" or (node.op == "name" and node.value in numbers)
            follows = node.args and node.op != "call" and all(each in fixed for each in node.args)
            if is_number or follows:
                fixed.add(node)
                if node.kind == "bool" and follows:
                    tests.append(node)
        return tests

    def decided(self, decisions: Sequence[bool]) -> PartCode:
        """The same where `tests` are known to be as the `decisions` say."""
        known = dict(zip(self.tests, map(graph.number, decisions), strict=True))

        def rewritten(value: Value) -> Value:
            nodes = [node for _, node in leaves(value)]
            return rebuilt(value, iter(graph.rewritten(nodes, known)))

        part = copy(self)
        part.following = rewritten(self.following)
        part.arguments = {**self.arguments, "signals": rewritten(self._signals)}
        part.margin = None if self.margin is None else rewritten(self.margin)
        part.limits = rewritten(self.limits)
        return part

    @property
    def _signals(self) -> Value:
        """What ``sample`` returns; nothing without one."""
        return self.arguments.get("signals", ())

    @cached_property
    def margin(self) -> Node | None:
        """Margin of the domain."""
        if self.part_model.domain is None:
            return None
        margin = node_of(self._call(self.part_model.domain))
        if margin is None:
            domain = self.part_model.domain.__name__
            raise InputError(
                f"Model {self.part_model.name}: {domain} must return one number, the margin."
            )
        return margin

    @cached_property
    def limits(self) -> tuple[Node, ...]:
        """The limits, in their order."""
        if self.part_model.limits is None:
            return ()
        return tuple(node for _, node in leaves(self._call(self.part_model.limits)))

    def ahead(self, ends: Iterable[Node], further_constants: Collection[str] = ()) -> list[Node]:
        """What some ends need that follows from parameters, givens and the step alone.

        The last nodes on the way that do; `further_constants` are more names that do not
        change.
        """
        numbers = {node.value for _, node in (*leaves(self.p), *leaves(self.given))}
        constant_names = {"h", *numbers, *further_constants}
        moves = dict[Node, bool]()
        constants = dict[Node, None]()
        ends = [*ends]
        order = ordered(ends)
        for node in order:
            is_moving_name = node.op == "name" and node.value not in constant_names
            moves[node] = is_moving_name or any(moves[operand] for operand in node.args)
        read_by_moving = [operand for node in order if moves[node] for operand in node.args]
        for node in [*read_by_moving, *ends]:
            is_computed = node.op not in (*LEAVES, "call") and node.kind == "float"
            if is_computed and not moves[node] and names_in([node]):
                constants[graph.plain_value(node)] = None
        return [node for node in constants if node.op not in LEAVES]

    @cached_property
    def outside(self) -> dict[str, SignalId]:
        """Names of what is read of records: samples of taps, and inputs as they come."""
        signals = {}
        for tap in self.taps:
            for age, name in enumerate(self.tap_samples(tap)):
                signals[name] = SignalId(self.part, "tap", f"{tap.input}.{age}")
        for name, node in self.inputs.items():
            if node == graph.name(f"x_{self.part_model.tap(name).signal}"):
                signals[node.value] = SignalId(self.part, "input", name)
        return signals

    @property
    def numbers(self) -> dict[str, SignalId]:
        """Names of its parameters and givens."""
        return {
            node.value: SignalId(self.part, kind, path)
            for kind, numbers in (("p", self.p), ("given", self.given))
            for path, node in leaves(numbers)
        }

    def signal(self, path: str) -> Node:
        """A signal, or a number of the state, by its path."""
        return {**dict(leaves(self.state)), **dict(leaves(self._signals))}[path]

    def node(self, stored: SignalId) -> Node:
        """A number that is kept."""
        if stored.kind in ("tap", "input"):
            return next(
                graph.name(name) for name, signal in self.outside.items() if signal == stored
            )
        if stored.kind == "state":
            return dict(leaves(self.state))[stored.path]
        return self.signal(stored.path)

    def initial_state(self, start: str = "rest") -> Value:
        """State at the start.

        At rest every signal is zero, or what its default parameter is; ``steady`` is the steady
        state under the inputs as they come. A part without an equation for that has no state.
        """
        part_model = self.part_model
        if start == "steady" and part_model.settled is not None:
            held = {tap.input: self._held(tap) for tap in self.between}
            if held and part_model.inputs is not None:
                held["inputs"] = part_model.inputs(*(self.inputs | held).values())
            return self._call(part_model.settled, **held)
        if part_model.rest is None:
            first = defaults_of(part_model.state)
            numbers = (first.get(path, 0.0) for path, _ in leaves(self.state))
            return rebuilt(self.state, (graph.number(float(number)) for number in numbers))
        inputs: dict[str, Value] = {}
        for name in part_model.input_types:
            if name in part_model.defaults:
                inputs[name] = dict(leaves(self.p))[part_model.defaults[name]]
            elif part_model.tap(name).longest:
                inputs[name] = History._make((graph.ZERO, graph.ZERO))
            elif part_model.tap(name).width:
                zeros = (graph.ZERO,) * part_model.tap(name).width
                inputs[name] = Window._make((zeros, graph.ZERO))
            else:
                inputs[name] = graph.ZERO
        if part_model.inputs is not None:
            inputs["inputs"] = part_model.inputs(*inputs.values())
        return self._call(part_model.rest, **inputs)

    def _held(self, tap: TapOf) -> Value:
        """What a tap gives of a signal between parts that does not change."""
        now = self.tapped(tap)
        if tap.tap.longest:
            return History._make((now, graph.ZERO))
        return Window._make(((now,) * tap.tap.width, graph.ZERO)) if tap.tap.width else now


def _named(kind: Any, name_of: Callable[[str], str], path: str = "") -> Value:
    """A named tuple of names; `name_of` gives one for the words of a path."""
    hints = get_type_hints(kind)
    elements: list[Value] = []
    for name in kind._fields:
        if is_named_tuple(hints[name]):
            elements.append(_named(hints[name], name_of, f"{path}{name}_"))
        else:
            elements.append(graph.name(name_of(f"{path}{name}")))
    return kind._make(elements)
