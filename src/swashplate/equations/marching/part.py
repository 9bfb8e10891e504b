"""One sample of a part of a model as straight code, and where the part starts."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import cached_property, lru_cache
from typing import Any, NamedTuple, get_type_hints

from numba import types
from numba.extending import intrinsic

from swashplate.equations import expressions as ex
from swashplate.equations.code import (
    Code,
    Flag,
    Tuple,
    Value,
    fixed,
    leaves,
    rebuilt,
)
from swashplate.equations.equation import JIT_OFF
from swashplate.equations.expressions import Node
from swashplate.equations.fields import floats_of
from swashplate.equations.model import (
    Equation,
    Link,
    Model,
    Source,
    Tap,
    Window,
    arguments_of,
    linear,
    mean_over_sample,
    previous,
)
from swashplate.equations.reading import read
from swashplate.equations.syntax import plain
from swashplate.errors import InputError

HOLDS: dict[str, Equation] = {
    "linear": linear,
    "previous": previous,
    "mean": mean_over_sample,
}


class Stored(NamedTuple):
    """A number of a part that is kept."""

    part: int
    kind: str
    """``signals``, ``state``, ``limits``, ``input``, ``link``, or ``tap`` for a tap's sample."""
    path: str = ""
    """Of the number; name of the input or link; input and number of a tap's sample, ``at.0``."""


class TapOf(NamedTuple):
    """A tap of a part, with the number of its place among all taps of the model."""

    part: int
    input: str
    number: int
    tap: Tap


@lru_cache(maxsize=256)
def taps_of(model: Model, signals: tuple[str, ...]) -> tuple[TapOf, ...]:
    """All taps on signals that are given as records, numbered."""
    found: list[TapOf] = []
    for i, part in enumerate(model.parts):
        for name in part.input_types:
            tap = part.tap(name)
            outside = model.link_of(i, name) is None and tap.signal in signals
            if outside and part.looked_at(name):
                found.append(TapOf(i, name, len(found), tap))
    return tuple(found)


class PartCode:
    """One sample of a part as straight code.

    `signals` are the external ones that are given as records; for the others the default parameter
    counts. `taken` are names that are in use already; `ruled` code is to be differentiated.
    """

    def __init__(
        self,
        model: Model,
        part: int,
        signals: Sequence[str],
        options: Any,
        taken: set[str] | None = None,
        *,
        ruled: bool = False,
    ) -> None:
        self.model, self.part, self.own = model, part, model.parts[part]
        self.records, self.options = tuple(signals), options
        self.prologue = Code(set() if taken is None else taken, ruled=ruled)
        self.code = Code(self.prologue.taken, ruled=ruled)
        self.prefix = f"{self.own.name}_" if len(model.parts) > 1 else ""
        self.code.taken.add("h")
        self.taps = [each for each in taps_of(model, self.records) if each.part == part]
        for tap in self.taps:
            self.code.taken |= {*self.tap_samples(tap), self.fraction(tap), self.whole(tap)}
        self.p = self._names(self.own.parameters, "p")
        self.given = self._names(self.own.given, "given") if self.own.given else Tuple(None, ())
        self.state = self._names(self.own.state, "s")
        self.known: dict[str, Value] = {"p": self.p, "h": ex.name("h"), "given": self.given}
        self.known["state"] = self.state
        if self.own.constants is not None:
            self.known["k"] = self._call(self.prologue, self.own.constants)
        self.inputs: dict[str, Value] = {}
        for name in self.own.input_types:
            self.inputs[name] = self._input(name)
        self.known |= self.inputs
        self.entry = list(self.code.items)  # Items that make the inputs; a start needs them, too.
        if self.own.inputs is not None:
            self.known["inputs"] = Tuple(self.own.inputs, tuple(self.inputs.values()))
        if self.own.sample is not None:
            self.known["signals"] = self._call(self.code, self.own.sample)
        self.following = self._call(self.code, self.own.step)
        self._check_type(self.own.step, self.following, self.own.state)

    def _check_type(self, equation: Equation, made: Value, kind: type[Any]) -> None:
        """Refuse what an equation returns unless it is of a type, and all of it numbers."""
        cls = made.cls if isinstance(made, Tuple) else None
        numbers = tuple(path for path, node in leaves(made) if node.kind in ("float", "int"))
        if cls is not kind or numbers != floats_of(kind):
            raise InputError(
                f"Model {self.own.name}: {plain(equation).__name__} must return a {kind.__name__} "
                "of numbers on every way."
            )

    def _names(self, kind: Any, letter: str) -> Value:
        hints = get_type_hints(kind)

        def made(kind: Any, hints: Mapping[str, Any], path: str) -> Value:
            items: list[Value] = []
            for name in kind._fields:
                inner = hints[name]
                below = f"{path}{name}"
                if isinstance(inner, type) and hasattr(inner, "_fields"):
                    items.append(made(inner, get_type_hints(inner), f"{below}_"))
                else:
                    taken = self.code.fresh(f"{letter}_{self.prefix}{below}")
                    items.append(ex.name(taken))
            return Tuple(kind, tuple(items))

        return made(kind, hints, "")

    def _call(self, code: Code, equation: Equation, **more: Value) -> Value:
        return self.call(code, equation, {**self.known, **more})

    def call(self, code: Code, equation: Equation, known: Mapping[str, Value]) -> Value:
        """Append a call of one of the part's equations, of what is known by argument."""
        given = {name: known[name] for name in arguments_of(equation) if name in known}
        if "options" in arguments_of(equation):
            given["options"] = fixed(self.options) or Flag("unknown", "options")
        made, name = read(code, equation, given), plain(equation).__name__
        before = {*code.taken}
        made = code.named(made, name if isinstance(made, Node) else "")
        code.origins |= dict.fromkeys(code.taken - before, name)
        return made

    def _input(self, name: str) -> Value:
        """An input as a name, a window of names, or what a hold makes of one."""
        link = self.model.link_of(self.part, name)
        if link is not None:
            return self.linked(link)
        tap = self.own.tap(name)
        found = next((each for each in self.taps if each.input == name), None)
        if found is None:
            if tap.signal in self.records:
                return ex.name(f"x_{tap.signal}")
            if name not in self.own.defaults:
                # refused where the model is given its numbers; a constant keeps the code whole
                return ex.ZERO
            return dict(leaves(self.p))[self.own.defaults[name]]
        samples = [ex.name(each) for each in self.tap_samples(found)]
        fraction = ex.name(self.fraction(found))
        window = Tuple(Window, (Tuple(None, tuple(samples)), fraction))
        if tap.width:
            return window
        return self._call(self.code, HOLDS[tap.hold], window=window)

    def linked(self, link: Link) -> Node:
        """A signal between parts, from the names of its sources."""
        sources = {each.signal: ex.name(self.source(each)) for each in link.sources}
        if link.equation is None:
            return next(iter(sources.values()))
        made = self.code.named(read(self.code, link.equation, sources), link.name)
        assert isinstance(made, Node)
        return made

    def source(self, source: Source) -> str:
        """Name of a signal that another part needs."""
        return f"x_{self.model.parts[source.part].name}_{source.signal.replace('.', '_')}"

    def tap_samples(self, tap: TapOf) -> list[str]:
        """Names of a tap's samples, newest first."""
        return [f"{self.prefix}{tap.input}_{j}" for j in range(tap.tap.samples)]

    def fraction(self, tap: TapOf) -> str:
        """Name of the rest of a tap's place."""
        return f"{self.prefix}{tap.input}_f"

    def whole(self, tap: TapOf) -> str:
        """Name of the whole samples of a tap's place."""
        return f"{self.prefix}{tap.input}_whole"

    @cached_property
    def margin(self) -> Node | None:
        """Margin of the domain."""
        if self.own.domain is None:
            return None
        made = self._call(self.code, self.own.domain)
        if not isinstance(made, Node):
            raise InputError(
                f"Model {self.own.name}: {plain(self.own.domain).__name__} must return one number, "
                "the margin."
            )
        return made

    @cached_property
    def limits(self) -> list[Node]:
        """The limits, in their order."""
        if self.own.limits is None:
            return []
        return [node for _, node in leaves(self._call(self.code, self.own.limits))]

    def outside(self, signals: Collection[str]) -> dict[str, Stored]:
        """Names of what a part reads of records: samples of taps, and inputs as they come."""
        found = {}
        for tap in self.taps:
            for j, name in enumerate(self.tap_samples(tap)):
                found[name] = Stored(self.part, "tap", f"{tap.input}.{j}")
        for name in self.own.input_types:
            signal = self.own.tap(name).signal
            if signal in signals:
                found[f"x_{signal}"] = Stored(self.part, "input", name)
        return found

    def signal(self, path: str) -> Node:
        """A signal, or a number of the state, by its path."""
        signals = self.known.get("signals", Tuple(None, ()))
        return {**dict(leaves(self.state)), **dict(leaves(signals))}[path]

    def node(self, stored: Stored) -> Node:
        """A number that is kept."""
        if stored.kind == "tap":
            name, number = stored.path.split(".")
            tap = next(each for each in self.taps if each.input == name)
            return ex.name(self.tap_samples(tap)[int(number)])
        if stored.kind == "input":
            made = self.inputs[stored.path]
            assert isinstance(made, Node)
            return made
        if stored.kind == "state":
            return dict(leaves(self.state))[stored.path]
        return self.signal(stored.path)

    @cached_property
    def parameters(self) -> dict[str, str]:
        """Path of each parameter by the name that stands for it."""
        return {node.value: path for path, node in leaves(self.p)}


class Start(NamedTuple):
    """A part's state at the start as straight code."""

    code: Code
    value: Value


def rest_of(part: PartCode) -> Start:
    """State at rest: every signal is zero, or what its default parameter is."""
    code = Code(part.code.taken, ruled=part.code.ruled)
    own = part.own
    if own.rest is None:
        defaults = own.state._field_defaults
        nodes = [
            ex.number(float(defaults.get(path.split(".")[0], 0.0)))
            for path, _ in leaves(part.state)
        ]
        return Start(code, rebuilt(part.state, iter(nodes)))
    inputs: dict[str, Value] = {}
    for name in own.input_types:
        if name in own.defaults:
            inputs[name] = dict(leaves(part.p))[own.defaults[name]]
        elif own.tap(name).width:
            zeros = (ex.ZERO,) * own.tap(name).width
            inputs[name] = Tuple(Window, (Tuple(None, zeros), ex.ZERO))
        else:
            inputs[name] = ex.ZERO
    known = {**part.known, **inputs}
    if own.inputs is not None:
        known["inputs"] = Tuple(own.inputs, tuple(inputs.values()))
    return Start(code, part.call(code, own.rest, known))


def settled_of(part: PartCode) -> Start | None:
    """Steady state under the inputs as they come, None where the part has no equation for it."""
    if part.own.settled is None:
        return None
    code = Code(part.code.taken, ruled=part.code.ruled)
    code.items = list(part.entry)
    return Start(code, part.call(code, part.own.settled, part.known))


# --- without branches -----------------------------------------------------------------------------


def _choose(test: bool, one: Any, two: Any) -> Any:
    return one if test else two


def _selected(typing: Any, test: Any, one: Any, two: Any) -> Any:
    kind = typing.unify_types(one, two)

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        sides = (context.cast(builder, values[k], signature.args[k], kind) for k in (1, 2))
        return builder.select(values[0], *sides)

    return kind(types.boolean, one, two), generate


choose: Any = _choose if JIT_OFF else intrinsic(_selected)
"""``choose(test, a, b)`` is one of two numbers that both have been computed: from ``a if test else
b`` the compiler makes branches, or a choice between two addresses, and gathers."""
