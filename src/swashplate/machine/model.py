"""Models: what one's own machine and the package's drives are to the engine.

A model is a value: types of parameters, state and inputs, and equations over them. At every sample
the engine calls, in this order,

    sample(state, inputs, p, h) -> signals      all that is known at n, computed once
    step(state, signals, inputs, p, h) -> state          from n to n + 1

What follows from ``p``, ``given`` and ``h`` alone, such as ``exp(-h / p.lag)``, is written where it
is used: the engine finds it and computes it once, before the first sample.

Equations name the arguments that they need; the names mean

| argument | what the engine passes |
|---|---|
| ``state`` | the state at n, a named tuple |
| ``signals`` | what ``sample`` returned at n |
| ``inputs`` | all inputs as a named tuple, or an input's own name for one of them |
| ``p`` | parameters |
| ``h`` | step of the grid [s] |
| ``options`` | options, None (off) or True (on): branches on them cost nothing |
| ``given`` | numbers that belong to a run, not to the machine: a load, a rod's middle |
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cached_property
from importlib import import_module
from math import inf
from operator import attrgetter
from types import FunctionType, ModuleType
from typing import Any, Literal, NamedTuple, get_args, get_type_hints

from swashplate.errors import InputError, UnknownParameterError
from swashplate.machine.declaration import Replacements, equation, equation_of_text
from swashplate.machine.fields import (
    Definition,
    declared_by,
    definition_of,
    definitions_of,
    floats_of,
    ranges_of,
)
from swashplate.machine.language import is_named_tuple, type_of

Equation = Callable[..., Any]
Hold = Literal["linear", "previous", "mean", "none"]

ARGUMENTS = ("state", "signals", "inputs", "p", "h", "options", "given")
"""Names that mean what the table above says; any other argument is an input."""


# --- windows: the samples of an input that an equation sees ---------------------------------------


class Window(NamedTuple):
    """Neighbouring samples of an input, seen from between two of them."""

    s: tuple[float, ...]
    """Samples, newest first."""
    f: float
    """Age of the instant that is read, relative to the newest sample, in samples, 0 to 1."""


class History(NamedTuple):
    """An input with its past, as far back as its `Tap` says; `past` reads it."""

    newest: float
    """The sample now."""
    longest: float
    """How far back it can be read. [samples]"""


@equation
def newest(window: Window) -> float:
    """The newest sample."""
    return window.s[0]


@equation
def linear(window: Window) -> float:
    """Signal at the instant looked at, straight between samples."""
    return window.s[0] + window.f * (window.s[1] - window.s[0])


@equation
def previous(window: Window) -> float:
    """Last sample at or before the instant looked at."""
    return window.s[1] if window.f > 0.0 else window.s[0]


@equation
def mean_over_sample(window: Window) -> float:
    """Mean over the sample interval before the instant looked at, straight between samples."""
    f = window.f
    newest, middle, oldest = window.s[0], window.s[1], window.s[2]
    last = newest + f * (middle - newest)
    first = middle + f * (oldest - middle)
    return (1.0 - f) * (0.5 * (last + middle)) + f * (0.5 * (middle + first))


# --- models ---------------------------------------------------------------------------------------


class Tap(NamedTuple):
    """How a model looks at a signal that comes from outside or from another model.

    Examples
    --------
    >>> from swashplate.machine import Tap
    >>> Tap("command", delay="delay", hold="mean").samples
    3
    """

    signal: str
    """Name of the signal."""
    delay: str = ""
    """Path of the parameter that delays it [s]; none if empty."""
    ahead: float = 0.0
    """Samples by which the window ends later than the delay says; never later than now."""
    width: int = 0
    """Samples of a `Window`; 0 passes the value itself, as `hold` makes it."""
    hold: Hold = "linear"
    """What the signal is between samples: a straight line, its last value, or, as the mean over the
    last interval, what a logger or a controller averaged. ``"none"`` reads the newest sample."""
    longest: str = ""
    """Path of the parameter [s] up to which `past` reads back; the input is a `History` then."""
    late: int = 0
    """Samples by which a signal of another part comes later, see `swashplate.machine.late`."""
    before: str = ""
    """Path of the parameter that a signal of another part was before the record, unless it has
    settled; by default zero."""

    @property
    def samples(self) -> int:
        """Samples that are read."""
        if self.width:
            return self.width
        if self.longest or self.hold == "none":
            return 1
        return 3 if self.hold == "mean" else 2

    @property
    def passed_on(self) -> bool:
        """Whether nothing is read but the sample before, which one sample passes on to the next."""
        plain = self.hold == "none" and not (self.width or self.longest or self.delay)
        return plain and self.late == 1


def type_of_input(tap: Tap) -> type[Any]:
    """What an equation is given of a signal that is looked at in this way."""
    if tap.longest:
        return History
    return Window if tap.width else float


class TapDelay(NamedTuple):
    """Where a tap reads at one step."""

    samples: int
    """Whole samples back."""
    fraction: float
    """Further back by this fraction of a sample."""
    slope: float
    """d(fraction)/d(delay). [1/s]"""


class SignalSource(NamedTuple):
    """A signal of a part, or of its state."""

    part: int
    signal: str


class Link(NamedTuple):
    """A signal between parts: that of one part, or an equation over signals of several."""

    name: str
    sources: tuple[SignalSource, ...]
    equation: Equation | None = None

    @property
    def after(self) -> int:
        """The part after which it is known."""
        return max(source.part for source in self.sources)


class AtRest(NamedTuple):
    """What states at rest follow from."""

    inputs: frozenset[str]
    """Inputs of the part."""
    gives: bool
    """Whether signals of the part are among it."""


@dataclass(frozen=True, eq=False)
class Model:
    """A machine as equations over named tuples of floats; see the module's text.

    Examples
    --------
    >>> from swashplate.models.full_order import plant
    >>> plant
    Model('plant', 42 parameters)
    >>> plant.external
    ('current',)
    """

    name: str
    parameters: type[Any]
    state: type[Any]
    step: Equation
    sample: Equation | None = None
    rest: Equation | None = None
    """State at rest, of ``inputs, p, h, options, given``; by default the state type's defaults or
    zeros."""
    settled: Equation | None = None
    """Steady state under constant inputs, of the same arguments."""
    inputs: type[Any] | None = None
    taps: Mapping[str, Tap] = field(default_factory=dict)
    """How each input is looked at; one that is not listed is read at n."""
    defaults: Mapping[str, str] = field(default_factory=dict)
    """Path of the parameter that stands for an input if no signal is given."""
    options: type[Any] | None = None
    given: type[Any] | None = None
    limits: Equation | None = None
    """Named tuple of bool: which limits act."""
    domain: Equation | None = None
    """Margin that is above 0 if the equations hold."""
    outside: str | Callable[[float, str], str] = "the model's equations do not hold"
    """What has happened if the margin is not above 0, for the message."""
    stable: Equation | None = None
    """Margin, of ``p, h, options``, that is above 0 if the equations bear a step of h."""
    unstable: Callable[[Any, float, Any], str] | None = None
    """What is wrong with such a step and what would be right, of ``p, h, options``."""
    longest_step: float = inf
    """Longest step of the grid; so many steps a sample are taken by default. [s]"""
    any_step: str = ""
    """Option without which the equations are for one step only; none if empty."""
    follows: Mapping[str, Equation] = field(default_factory=dict)
    """Options that follow from the parameters: whether each is on, of ``p``. Those that a
    parameter's `Definition` names as its switch are not listed."""
    outputs: Sequence[str] = ()
    """Signals of most use; by default all."""
    integrals: Mapping[str, str] = field(default_factory=dict)
    """Signals that are trapezoidal integrals of others, zero at the start."""
    free_start: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Numbers that a run may start from as its own unknowns, each with the paths of the states
    that it sets; a path of the state that is not listed stands for itself."""
    parts: tuple[Model, ...] = ()
    """Models in series; only this one if it is not joined."""
    links: Mapping[str, Link] = field(default_factory=dict)
    """Signals that are equations over the parts' signals, by name."""
    replacements: Replacements = field(default_factory=dict)
    """Equations that stand for others wherever those are called, see `replaced`; of a joined model
    in its links."""
    place: str = ""
    """Where it stands in a joined model, such as ``hoist.pump``; by default its name."""
    scope: str = ""
    """What the names of its signals begin with there, such as ``hoist``."""
    wired: Mapping[str, str] = field(default_factory=dict)
    """Full names of the signals that its inputs take there."""
    recipe: tuple[Any, ...] = ()
    """A function and its arguments that make the model again in another process; by default it is
    looked up by its name."""

    def __post_init__(self) -> None:
        if not self.parts:
            object.__setattr__(self, "parts", (self,))
            for wrong in _wrong(self):
                raise InputError(wrong)

    def __repr__(self) -> str:
        return f"Model({self.name!r}, {len(floats_of(self.parameters))} parameters)"

    def __hash__(self) -> int:
        return id(self)

    def __reduce__(self) -> tuple[Any, ...]:
        """By its recipe, or its name in a module, from which another process imports it.

        The name is the model's own, or that of an object with the model in an attribute, as a
        `Machine` has.
        """
        if self.recipe:
            return self.recipe
        address = _address(self)
        if address is None:
            raise InputError(
                f"The model {self.name} cannot be sent to another process: assign it to a name of "
                "a module that can be imported, or use one process (--jobs 1)."
            )
        return _imported, address

    @cached_property
    def input_types(self) -> dict[str, type[Any]]:
        """Inputs of a single model with their types, float or Window."""
        if self.inputs is not None:
            return dict(get_type_hints(self.inputs))
        names = [name for equation in self.equations for name in arguments_of(equation)]
        kinds = {name: type_of_input(tap) for name, tap in self.taps.items()}
        return {name: kinds.get(name, float) for name in names if name not in ARGUMENTS}

    @cached_property
    def signals(self) -> type[Any] | None:
        """Type of what ``sample`` returns."""
        if self.sample is None:
            return None
        returned = get_type_hints(self.sample).get("return")
        if not is_named_tuple(returned):
            raise InputError(
                f"Model {self.name}: {self.sample.__name__} must return a named tuple, and "
                "say so, as in '-> Signals'."
            )
        return returned

    @cached_property
    def signal_names(self) -> tuple[str, ...]:
        """Signals that a simulation of a single model has, integrals apart."""
        signals = floats_of(self.signals) if self.signals is not None else ()
        return tuple(dict.fromkeys((*signals, *floats_of(self.state))))

    @property
    def last_signals(self) -> tuple[str, ...]:
        """Signals of the last part, integrals apart."""
        last = self.parts[-1]
        return tuple(map(last.full, last.signal_names))

    @cached_property
    def every_signal(self) -> tuple[str, ...]:
        """Signals of all parts, numbers of their states, and links; integrals apart."""
        signals = [part.full(name) for part in self.parts for name in part.signal_names]
        return tuple(dict.fromkeys([*signals, *self.links]))

    @cached_property
    def limit_bits(self) -> dict[str, tuple[int, int]]:
        """Part and bit of every limit, by its name."""
        bits: dict[str, tuple[int, int]] = {}
        for i, part in enumerate(self.parts):
            if part.limits is not None:
                fields = get_type_hints(part.limits)["return"]._fields
                bits |= {part.full(name): (i, bit) for bit, name in enumerate(fields)}
        return bits

    @cached_property
    def limit_meanings(self) -> dict[str, str]:
        """What each limit means, by its name; empty where the model does not say it."""
        meanings = dict[str, str]()
        for name, (index, _) in self.limit_bits.items():
            returned = get_type_hints(self.parts[index].limits)["return"]
            hints = get_type_hints(returned, include_extras=True)
            definition = definition_of(hints[name.rpartition(".")[2]])
            meanings[name] = definition.name if definition else ""
        return meanings

    @cached_property
    def input_parameters(self) -> dict[str, str]:
        """Inputs that may be left out, with the path of the parameter that then stands for each."""
        replaceable = dict[str, str]()
        for index, part in enumerate(self.parts):
            for name in part.input_types:
                if self.link_of(index, name) is None and name in part.defaults:
                    path = f"{self.prefix(index)}{part.defaults[name]}"
                    replaceable[part.tap(name).signal] = path
        return replaceable

    @cached_property
    def external(self) -> tuple[str, ...]:
        """Signals that come from outside, in the order of the parts' inputs."""
        inputs = [(i, name) for i, part in enumerate(self.parts) for name in part.input_types]
        outside = [self.parts[i].tap(name) for i, name in inputs if self.link_of(i, name) is None]
        return tuple(dict.fromkeys(tap.signal for tap in outside))

    def link_of(self, part: int, name: str) -> Link | None:
        """Where an input of a part comes from, None if from outside."""
        return self._links_of[part, name]

    @cached_property
    def _links_of(self) -> dict[tuple[int, str], Link | None]:
        """Where each input of each part comes from, None if from outside."""
        found = dict[tuple[int, str], Link | None]()
        before = dict[str, SignalSource]()
        for index, part in enumerate(self.parts):
            for name in part.input_types:
                signal = part.tap(name).signal
                link = self.links.get(signal)
                if part.tap(name).late:
                    late = source_of(self.parts, signal)
                    found[index, name] = link or (Link(signal, (late,)) if late else None)
                    continue
                if link is None or link.after >= index:
                    source = before.get(signal)
                    link = Link(signal, (source,)) if source else None
                found[index, name] = link
            for name in part.signal_names:
                before[part.full(name)] = SignalSource(index, name)
        return found

    @cached_property
    def at_rest(self) -> tuple[AtRest, ...]:
        """Of each part what states at rest follow from, its own or another part's."""
        needed = [AtRest(frozenset(), gives=False) for _ in self.parts]
        for index in range(len(self.parts) - 1, -1, -1):
            part, gives = self.parts[index], needed[index].gives
            read = arguments_of(part.rest) if part.rest is not None else ()
            everything = gives or "inputs" in read
            inputs = frozenset(n for n in part.input_types if everything or n in read)
            needed[index] = AtRest(inputs, gives=gives)
            for name in inputs:
                link = self.link_of(index, name)
                for source in link.sources if link is not None else ():
                    needed[source.part] = needed[source.part]._replace(gives=True)
        return tuple(needed)

    def line(self, part: int, name: str) -> str:
        """Name of the line in which the past of a signal between parts is kept for an input.

        Inputs with values of their own before the record have lines of their own.
        """
        tap = self.parts[part].tap(name)
        return f"{tap.signal} {self.prefix(part)}{tap.before}" if tap.before else tap.signal

    def prefix(self, part: int) -> str:
        """What stands before a part's paths: where it stands and a dot, in a joined model."""
        return f"{self.parts[part].path}." if self.is_joined else ""

    @property
    def is_joined(self) -> bool:
        """Whether it consists of several models, or of one by a name of its own."""
        return len(self.parts) > 1 or (self.parts[0] is not self and self.parts[0].place != "")

    @property
    def path(self) -> str:
        """Where it stands in a joined model: its parameters and states are found there."""
        return self.place or self.name

    def full(self, signal: str) -> str:
        """Name of a signal of a part in the whole."""
        return f"{self.scope}.{signal}" if self.scope else signal

    def places(self, kind: str) -> tuple[tuple[int, str], ...]:
        """Part and path of every number of its parameters, given or state, in flat order."""
        kinds = [getattr(part, kind) for part in self.parts]
        return tuple((i, path) for i, kind in enumerate(kinds) if kind for path in floats_of(kind))

    @cached_property
    def state_signals(self) -> tuple[str, ...]:
        """Signals that are numbers of the state."""
        return tuple(self.parts[index].full(path) for index, path in self.places("state"))

    @cached_property
    def starts(self) -> dict[str, str]:
        """Signal that each number of the state at the first sample is of, by ``start.PATH``."""
        return {
            f"start.{self.prefix(index)}{path}": part.full(path)
            for index, part in enumerate(self.parts)
            for path in (*floats_of(part.state), *part.free_start)
        }

    @cached_property
    def ranges(self) -> dict[str, Definition]:
        """Definitions of the parameters that have a range, by path."""
        return {
            f"{self.prefix(i)}{path}": definition
            for i, part in enumerate(self.parts)
            for path, definition in ranges_of(part.parameters).items()
        }

    @cached_property
    def definitions(self) -> dict[str, Definition]:
        """Definitions of inputs, states and signals by name, as far as the model declares them.

        An input declares its own on the argument of an equation, or on the field of `inputs`.
        """
        declared = dict(self.input_definitions)
        for part in self.parts:
            for kind in filter(None, (part.state, part.signals)):
                declared |= {part.full(name): each for name, each in definitions_of(kind).items()}
        for name, link in self.links.items():
            definition = definition_of(type_of(link.equation, "return")) if link.equation else None
            if definition is not None:
                declared[name] = definition
        for name, rate in self.integrals.items():
            if rate in declared:
                declared[name] = _integral(rate, declared[rate])
        return declared

    @cached_property
    def input_definitions(self) -> dict[str, Definition]:
        """Definitions of the signals that the inputs of its parts take, by name."""
        declared = dict[str, Definition]()
        for part in self.parts:
            for name in part.input_types:
                types = [type_of(equation, name) for equation in part.equations]
                if part.inputs is not None:
                    types.append(get_type_hints(part.inputs, include_extras=True)[name])
                for kind in types:
                    definition = definition_of(kind)
                    if definition is not None:
                        declared.setdefault(part.tap(name).signal, definition)
        return declared

    @cached_property
    def input_ranges(self) -> dict[str, tuple[float, float]]:
        """Least and largest value of the external signals that have a range, by name."""
        definitions = self.input_definitions
        stated = {name: definitions[name] for name in self.external if name in definitions}
        ranges = {name: (each.lower, each.upper) for name, each in stated.items()}
        return {name: ends for name, ends in ranges.items() if ends != (-inf, inf)}

    @cached_property
    def parameter_definitions(self) -> dict[str, Definition]:
        """Definition of each parameter, by path; one that its type does not state has no unit."""
        return {
            f"{self.prefix(index)}{path}": definition
            for index, part in enumerate(self.parts)
            for definition in declared_by(part.parameters)
            for path in definition.fields
        }

    @cached_property
    def parameter_names(self) -> dict[str, tuple[str, ...]]:
        """Paths of the parameters that each name stands for, in the whole model.

        A path stands for itself. A parameter with a value for each direction has its symbol for
        both, ``hoist.pump.Z16``, and a name for each, ``hoist.card.J_plus`` for
        ``hoist.card.plus.J``.
        """
        names: dict[str, tuple[str, ...]] = {path: (path,) for path in parameter_paths(self)}
        for index, part in enumerate(self.parts):
            prefix = self.prefix(index)
            for definition in declared_by(part.parameters):
                paths = tuple(f"{prefix}{path}" for path in definition.fields)
                names.setdefault(f"{prefix}{definition.symbol}", paths)
                for column, path in zip(definition.columns, paths, strict=True):
                    names.setdefault(f"{prefix}{column}", (path,))
        return names

    def parameters_named(self, name: str) -> tuple[str, ...]:
        """Paths of the parameters that a name stands for.

        Its last word is enough if one parameter ends in it, be it one with a value for each
        direction; words between may be left out: ``hoist.Z16`` for ``hoist.pump.Z16``.

        Raises
        ------
        UnknownParameterError
            If there is none; the sentence has the names that are near.
        """
        names = self.parameter_names
        if name in names:
            return names[name]
        meant = [names[full] for full in names_meant(name, names)]
        for paths in meant:
            if all(set(paths) >= set(others) for others in meant):
                return paths
        raise UnknownParameterError(f"{self.name} has no parameter {near_names(name, names)}.")

    @cached_property
    def switches(self) -> dict[tuple[int, str], tuple[str, ...]]:
        """Paths, within the part, of the parameters that switch an option on unless all are 0.

        By part and option, as the parameters' definitions state it.
        """
        paths = dict[tuple[int, str], tuple[str, ...]]()
        for index, part in enumerate(self.parts):
            for definition in declared_by(part.parameters) if part.options else ():
                option = definition.switch
                if option in getattr(part.options, "_fields", ()):
                    key = index, option
                    paths[key] = (*paths.get(key, ()), *definition.fields)
        return paths

    @cached_property
    def longest(self) -> float:
        """Longest step that all parts allow. [s]"""
        return min(part.longest_step for part in self.parts)

    def tap(self, name: str) -> Tap:
        """How an input is looked at."""
        if name not in self._taps:
            tap = self.taps.get(name, Tap(name))
            wired = name in self.wired
            self._taps[name] = tap._replace(signal=self.wired[name]) if wired else tap
        return self._taps[name]

    @cached_property
    def _taps(self) -> dict[str, Tap]:
        """How inputs are looked at, as far as it was asked."""
        return {}

    @property
    def equations(self) -> tuple[Equation, ...]:
        """Its equations that may ask for inputs."""
        all_of_them = (self.sample, self.step, self.limits, self.domain, self.rest, self.settled)
        return tuple(equation for equation in all_of_them if equation is not None)


def _wrong(model: Model) -> Iterator[str]:
    """What keeps a single model from being marched, in sentences."""
    prefix = f"Model {model.name}: "
    if not str(model.name).isidentifier():
        yield f"The name of a model is one word, such as 'valve', not {model.name!r}."
    for type_ in (model.parameters, model.state, model.inputs, model.options, model.given):
        if type_ is not None and not is_named_tuple(type_):
            yield (
                f"{prefix}{type_!r} must be a named tuple, as in "
                "'class State(NamedTuple): position: float'."
            )
    for type_ in (model.parameters, model.state, model.given):
        for field_, kind in _no_floats(type_) if type_ is not None else ():
            must = "but must be a float or a named tuple of floats"
            yield f"{prefix}{field_} is of type {kind}, {must}."
    for word in ("step", "sample", "rest", "settled", "limits", "domain", "stable"):
        member = getattr(model, word)
        is_left_out = member is None and word != "step"
        if not isinstance(member, FunctionType) and not is_left_out:
            yield f"{prefix}{word} must be an equation, not {member!r}."
    input_names = [*model.input_types]
    parameters = floats_of(model.parameters)
    for asking in model.equations:
        for name in arguments_of(asking):
            if name not in (*ARGUMENTS, *input_names):
                choice = ", ".join((*ARGUMENTS, *input_names))
                name_of = asking.__name__
                yield f"{prefix}{name_of} needs '{name}', which is not one of {choice}."
    for name, tap in model.taps.items():
        if name not in input_names:
            yield f"{prefix}there is a tap on '{name}', but no input."
        if tap.hold not in get_args(Hold):
            choice = ", ".join(get_args(Hold))
            yield f"{prefix}'{name}' has the hold '{tap.hold}'; there are {choice}."
        for word in ("delay", "longest", "before"):
            path = getattr(tap, word)
            if path and path not in parameters:
                what = {"delay": "delay", "longest": "longest delay"}.get(word, "value before")
                has = ", ".join(parameters)
                yield f"{prefix}the {what} of '{name}' is '{path}', but the parameters are {has}."
    states = floats_of(model.state)
    for name in [path for paths in model.free_start.values() for path in paths]:
        if name not in states:
            yield f"{prefix}free_start names '{name}', but the state has {', '.join(states)}."
    inputs = {model.tap(name).signal for name in input_names}
    if "time" in inputs:
        yield f"{prefix}an input cannot be called 'time', the name of the time stamps: rename it."
    for name, where in _own_names(model):
        if name in inputs:
            yield f"{prefix}'{name}' is both an input and in {where}: rename one of them."
        if name == "time":
            yield f"{prefix}'time' is in {where}, but means the time stamps: rename it."


def _integral(rate: str, definition: Definition) -> Definition:
    """What the integral over time of a signal is."""
    unit = definition.unit
    of_time = unit.removesuffix("/s") if unit.endswith("/s") else f"{unit} s".removeprefix("1 ")
    return Definition(f"integral of {rate}, zero at the start", of_time or "1")


def _own_names(model: Model) -> Iterator[tuple[str, str]]:
    """Names of a single model's states, signals and integrals, with what they are in."""
    yield from ((name, "the integrals") for name in model.integrals)
    if not packaged(model):
        for type_ in filter(None, (model.state, model.signals)):
            yield from ((name, type_.__name__) for name in floats_of(type_))


def packaged(model: Model) -> bool:
    """Whether a single model is the package's: some pass an input on, or keep it, by its name."""
    return bool(model.state.__module__.startswith("swashplate."))


def _no_floats(type_: type[Any]) -> Iterator[tuple[str, str]]:
    """Fields that are not numbers, with their types' names."""
    for name, hint in get_type_hints(type_).items():
        if is_named_tuple(hint):
            yield from _no_floats(hint)
        elif hint is not float:
            yield f"{type_.__name__}.{name}", getattr(hint, "__name__", str(hint))


def _address(model: Model) -> tuple[str, str] | None:
    """Module in which a model has a name, and this name, dotted for an attribute of an object."""
    # the main module last: that of another process may be another one
    modules = sorted(sys.modules, key=lambda name: name == "__main__")
    objects = [
        (module, name, value)
        for module in modules
        for name, value in list(getattr(sys.modules[module], "__dict__", {}).items())
    ]
    for module, name, value in objects:
        if value is model:
            return module, name
    for module, name, owner in objects:
        if isinstance(owner, ModuleType | type):
            continue
        for attribute, value in _attributes(owner):
            if value is model:
                return module, f"{name}.{attribute}"
    return None


def _attributes(owner: Any) -> list[tuple[str, Any]]:
    """Attributes that an object itself stores; no code of the object is executed."""
    try:
        return list(object.__getattribute__(owner, "__dict__").items())
    except AttributeError:
        return []


def _imported(module: str, name: str) -> Model:
    """A model by its name in a module, as of `_address`."""
    model: Model = attrgetter(name)(import_module(module))
    return model


def source_of(parts: Sequence[Model], signal: str) -> SignalSource | None:
    """Where a signal of some parts comes from, by its full name: of the last that has it."""
    for index in range(len(parts) - 1, -1, -1):
        for name in parts[index].signal_names:
            if parts[index].full(name) == signal:
                return SignalSource(index, name)
    return None


def full_name(name: str, names: Iterable[str]) -> str:
    """The one of some names that this one means, itself if that is none or more than one."""
    names = [*names]
    if name in names:
        return name
    meant = names_meant(name, names)
    return meant[0] if len(meant) == 1 else name


def names_meant(name: str, names: Iterable[str]) -> list[str]:
    """Paths that end in a name; if there is none, those that have its words in their order."""
    names = [*names]
    return [each for each in names if each.endswith(f".{name}")] or [
        each for each in names if _has_words_of(name.split("."), each.split("."))
    ]


def _has_words_of(name: Sequence[str], path: Sequence[str]) -> bool:
    """Whether a path has the words of a name in their order, and ends in its last."""
    rest = iter(path)
    return path[-1] == name[-1] and all(word in rest for word in name)


def near_names(wanted: str, names: Iterable[str]) -> str:
    """A name that is none of these, with those that may be meant."""
    names = [*dict.fromkeys(names)]
    last = wanted.rpartition(".")[2]
    ends = [each for each in names if each.rpartition(".")[2] == last]
    near = ends or get_close_matches(wanted, names, 5) or names
    return f"'{wanted}'; there are {', '.join(near)}"


def parameter_paths(model: Model) -> tuple[str, ...]:
    """Paths of all parameters, in the order of the flat array."""
    return tuple(f"{model.prefix(i)}{path}" for i, path in model.places("parameters"))


def state_paths(model: Model) -> tuple[str, ...]:
    """Paths of all states, in the order of the flat array."""
    return tuple(f"{model.prefix(i)}{path}" for i, path in model.places("state"))


def tap_delay(tap: Tap, delay: float, h: float) -> TapDelay:
    """Where a tap reads at a step of `h` for a delay [s]."""
    steps = delay / h
    back = max(steps, tap.ahead) - tap.ahead
    samples = int(back // 1.0)
    slope = 1.0 / h if steps >= tap.ahead else 0.0
    return TapDelay(samples + tap.late, back - samples, slope)


def arguments_of(equation: Equation) -> tuple[str, ...]:
    """Names of an equation's arguments."""
    code = equation.__code__
    names: tuple[str, ...] = code.co_varnames[: code.co_argcount]
    return names


# --- continuous equations on the grid -------------------------------------------------------------

Method = Literal["euler", "heun", "midpoint", "rk4"]


class Tableau(NamedTuple):
    """Explicit Runge-Kutta method (Hairer, Nørsett and Wanner 1993, II.1)."""

    stages: tuple[tuple[float, ...], ...]
    """Of each slope after the first, the weights of those before it."""
    weights: tuple[float, ...]
    """Of the slopes, in the step."""


TABLEAUS: dict[str, Tableau] = {
    "euler": Tableau((), (1.0,)),
    "heun": Tableau(((1.0,),), (0.5, 0.5)),
    "midpoint": Tableau(((0.5,),), (0.0, 1.0)),
    "rk4": Tableau(((0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
}


def discretised(
    rates: Equation, method: Method = "rk4", *, substeps: int = 1, project: Equation | None = None
) -> Equation:
    """Step of a model whose equation gives the rates of change of its state.

    Parameters
    ----------
    rates : equation
        d(state)/dt of ``state`` and of inputs, ``p``, ``options`` and ``given`` as a step has
        them. It returns the type of the state, each number in its unit per second.
    method : {"euler", "heun", "midpoint", "rk4"}
        Explicit Runge-Kutta method, of order 1, 2, 2 and 4.
    substeps : int
        Steps of the method from one sample to the next, of equal length. They are written out, so
        that many take long to compile; those of `simulate` and of a fit do not.
    project : equation, optional
        Of the same arguments: the state within its bounds, such as end stops, done to the state at
        the end of each sub-step.

    Returns
    -------
    equation
        The `step` of a `Model`; `source` shows its text. Derivatives are those of this step, not
        of the differential equation.

    Raises
    ------
    InputError
        For another method, fewer sub-steps than 1, or equations that cannot be a right-hand side.

    Notes
    -----
    Inputs are held over the step at what their taps give at its beginning. An input that is
    straight between samples keeps the method's order on a finer grid only, or with a tap that has
    a delay of a step at least: ``Tap("command", "delay", ahead=1.0, hold="mean")`` is its mean over
    the step.

    Examples
    --------
    >>> from swashplate.machine import discretised
    >>> from swashplate.models.full_order import plant_rates
    >>> discretised(plant_rates, "heun", substeps=2).__name__
    'plant_rates_heun'
    """
    if method not in TABLEAUS:
        raise InputError(f"There is no method '{method}'; there are {', '.join(get_args(Method))}.")
    if type(substeps) is not int or substeps < 1:
        raise InputError(f"substeps is {substeps!r}, but must be a whole number, at least 1.")
    kind = _state_of(rates)
    names: dict[str, Any] = {"rates": rates, "project": project}
    hints = get_type_hints(rates, include_extras=True)
    if project is not None:
        if _state_of(project) is not kind:
            raise InputError(
                f"{project.__name__} must return a {kind.__name__}, as {rates.__name__} does."
            )
        hints = {**get_type_hints(project, include_extras=True), **hints}
    del hints["return"]
    names |= {f"{name}_type": hint for name, hint in hints.items()}

    def state(weights: tuple[float, ...], kind: Any = kind, path: str = "") -> str:
        """Text of the state at the beginning of a sub-step, moved by weighted slopes."""
        if not is_named_tuple(kind):
            factors = ["" if weight == 1.0 else f"{weight!r} * " for weight in weights]
            moves = zip(factors, weights, range(1, len(weights) + 1), strict=True)
            terms = [
                f" + sub_step * {field}slope_{stage}{path}"
                for field, weight, stage in moves
                if weight != 0.0
            ]
            return f"state{path}{''.join(terms)}"
        word = f"{kind.__name__}_at{path.replace('.', '_')}"
        names[word] = kind
        inner = get_type_hints(kind)
        fields = [state(weights, inner[field], f"{path}.{field}") for field in kind._fields]
        return f"{word}({', '.join(fields)})"

    def call(word: str, equation: Equation, at: str) -> str:
        passed = [at if name == "state" else name for name in arguments_of(equation)]
        return f"{word}({', '.join(passed)})"

    tableau = TABLEAUS[method]
    lines = [f"slope_1 = {call('rates', rates, 'state')}"]
    for stage, row in enumerate(tableau.stages):
        lines.append(f"slope_{stage + 2} = {call('rates', rates, state(row))}")
    lines.append(f"state = {state(tableau.weights)}")
    if project is not None:
        lines.append(f"state = {call('project', project, 'state')}")
    name = f"{rates.__name__}_{method}"
    arguments = [*(f"{name}: {name}_type" for name in hints), "h: float"]
    text = [
        f"def {name}({', '.join(arguments)}) -> state_type:",
        f'    """Step of {rates.__name__}: {method}, {substeps} a sample."""',
        f"    sub_step = h / {float(substeps)!r}",
        f"    for _ in range({substeps}):",
        *(f"        {line}" for line in lines),
        "    return state",
        "",
    ]
    step: Equation = equation_of_text("\n".join(text), name, names)
    return step


def _state_of(equation: Equation) -> type[Any]:
    """Type of the state that an equation takes and returns."""
    name, arguments = equation.__name__, arguments_of(equation)
    hints: dict[str, type[Any]] = get_type_hints(equation)
    kind = hints.get("return")
    if kind is None or not is_named_tuple(kind) or hints.get("state") is not kind:
        raise InputError(
            f"{name} must take the state and return its type, as in 'def {name}(state: State, ...) "
            "-> State'."
        )
    for argument in ("h", "signals"):
        if argument in arguments:
            raise InputError(
                f"{name} asks for '{argument}', which is known only at samples: a rate of change "
                "depends on the state at any instant."
            )
    for argument in arguments:
        if argument == "sub_step" or argument.startswith("slope_"):
            raise InputError(f"{name}: the name '{argument}' is taken; rename the argument.")
    return kind
