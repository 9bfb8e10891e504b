"""A model with numbers: its start and its march."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, fields
from functools import cached_property, lru_cache
from itertools import count
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError, InputError, ParameterError
from swashplate.machine.code_generation.functions import generating
from swashplate.machine.code_generation.machine_code import code_of_text
from swashplate.machine.declaration import JIT_OFF, Replacements, with_replacements
from swashplate.machine.fields import (
    check_mapping,
    defaults_of,
    floats_of,
    is_real,
    member_at,
    nested_from,
    numbers_of,
    tuple_from,
    value_at,
)
from swashplate.machine.keeping import cached_on_disk, key_of
from swashplate.machine.marching.interpreting import InterpretedMarch
from swashplate.machine.marching.kernels import KERNEL_KINDS, Kernel, MarchArrays, pointers
from swashplate.machine.marching.march import march_text
from swashplate.machine.marching.part_code import SignalId, taps_of
from swashplate.machine.marching.record import Record
from swashplate.machine.marching.sample_code import (
    CodeForm,
    SampleCode,
    decisions_of,
    output_of,
)
from swashplate.machine.model import (
    History,
    Link,
    Model,
    Tap,
    Window,
    arguments_of,
    parameter_paths,
    state_paths,
    tap_delay,
)
from swashplate.machine.ports import Ports
from swashplate.machine.renewal import renew
from swashplate.machine.rules import CheckedRule, MemberRules, refuse
from swashplate.units import in_si

Array = NDArray[np.float64]
Start = Literal["rest", "steady"]
T = TypeVar("T")

MOST_PASSES = 200
"""Passes over the parts until what comes late of those behind has settled."""
SETTLED = 1e-14
"""Change over a pass, of the largest value, that counts as none."""
MOST_CACHED = 128
"""Results that an instance keeps before it forgets all."""
NO_NUMBER = (ValueError, ZeroDivisionError, OverflowError)
"""What an equation raises if it gives no number."""


def check_start(start: str) -> None:
    """Refuse a start that is neither ``"rest"`` nor ``"steady"``."""
    if start not in ("rest", "steady"):
        raise InputError(f"start is '{start}'; it is 'rest' or 'steady'.")


class PartNumbers(NamedTuple):
    """Numbers of a part of a model."""

    p: Any
    options: Any = None
    given: Any = None


class InitialStates(NamedTuple):
    """States of all parts at the first sample, and what they follow from."""

    states: tuple[Any, ...]
    before: Mapping[str, float]
    """External signals before the record."""
    arguments: tuple[Mapping[str, Any], ...]
    """Of each part what its equations take, by the arguments' names."""
    between: Mapping[str, float] = MappingProxyType({})
    """Signals between parts that taps read, before the record."""

    @property
    def flat(self) -> Array:
        """All states as numbers."""
        return np.array([number for state in self.states for number in numbers_of(state)])


class TapDelays(NamedTuple):
    """Where the taps read, as one array for each field of `TapDelay`, an element for each tap."""

    samples: NDArray[np.int64]
    """Whole samples of the delay."""
    fraction: Array
    """Rest of the delay, in samples."""
    slope: Array
    """Derivative of the fraction by the delay. [1/s]"""


@dataclass(frozen=True, init=False)
class Machine:
    """A model with its numbers: what is simulated, stepped, linearised, fitted and exported.

    Parameters
    ----------
    model : Model
        A single model, or a joined one.
    p, options, given : named tuple
        Its parameters, options and what belongs to a run. Of a joined model each has a field for
        every member that has any.

    Raises
    ------
    InputError
        If a tuple has not the type that the model declares.
    ParameterError
        If a parameter lies beyond the range of its `Definition`.
    """

    model: Model
    parts: tuple[PartNumbers, ...]
    name: str
    """Of the numbers: a parameter set's, or the model's own."""
    rules: tuple[MemberRules, ...] = field(default=(), compare=False, repr=False)
    """What the numbers must satisfy together, by the member of a joined machine that says it."""

    def __init__(self, model: Model, p: Any, *, options: Any = None, given: Any = None) -> None:
        renew(model)
        self._set(model, _checked_parts(model, p, options, given), model.name)
        for path, definition in model.ranges.items():
            if not definition.holds(self.numbers[path]):
                raise ParameterError(f"{self.name}: {definition.broken(path, self.numbers[path])}.")

    @classmethod
    def of_parts(
        cls,
        model: Model,
        parts: tuple[PartNumbers, ...],
        name: str,
        rules: tuple[MemberRules, ...] = (),
    ) -> Machine:
        """A machine whose numbers are known to be those of the model's parts."""
        machine = object.__new__(cls)
        machine._set(model, parts, name, rules)
        return machine

    def _set(
        self,
        model: Model,
        parts: tuple[PartNumbers, ...],
        name: str,
        rules: tuple[MemberRules, ...] = (),
    ) -> None:
        given = {"model": model, "parts": parts, "name": name, "rules": rules}
        for word, value in given.items():
            object.__setattr__(self, word, value)

    def replace(self, changes: Mapping[str, Any] | None = None, /, **by_name: Any) -> Machine:
        """A machine with other numbers; this one stays as it is.

        Parameters
        ----------
        changes : mapping, optional
            Numbers by path, ``{"hoist.pump.Z16_plus": 1.2e-4}``; the last word is enough where it
            is unique. The symbol of a parameter with a value for each direction takes one number
            for both, or a pair, plus and minus.
        **by_name : float, Pint quantity, or a pair of them
            The same by last words alone. In SI, or with a unit.

        Returns
        -------
        Machine
            Terms that a parameter switches on are on unless it is 0.

        Raises
        ------
        InputError
            For a name that no parameter has; the sentence names the near ones.
        ParameterError
            For a number beyond the range of its `Definition`, or numbers that break a rule.

        Examples
        --------
        >>> from swashplate import Drive
        >>> from swashplate.machine import join
        >>> hoist = Drive.preset("hoist")
        >>> pair = join("pair", {"left": hoist, "right": hoist})
        >>> wider = pair.replace({"left.pump.Z16": 2e-4})
        >>> [part.p.Z16_plus for part in wider.parts if part.p._fields[0] == "Z1"]
        [0.0002, 0.00011634]
        """
        numbers = dict(self.numbers)
        changed = dict[str, float]()
        for name, change in {**(changes or {}), **by_name}.items():
            changed |= self._changes(name, change)
        numbers |= changed
        refuse(self.name, self.checked({path: np.array([n]) for path, n in numbers.items()}))
        parts = list(self.parts)
        for index, part in enumerate(self.model.parts):
            prefix = self.model.prefix(index)
            touched = {path.removeprefix(prefix) for path in changed if path.startswith(prefix)}
            p = nested_from(part.parameters, numbers, prefix)
            if touched:
                options = options_of(part, p, parts[index].options, touched)
                parts[index] = parts[index]._replace(p=p, options=options)
        return Machine.of_parts(self.model, tuple(parts), self.name, self.rules)

    def checked(self, numbers: Mapping[str, Array]) -> Iterator[CheckedRule]:
        """Its rules applied to (m,) values of all its parameters, by path."""
        for rules in self.rules:
            yield from rules.checked(numbers)

    def _changes(self, name: str, change: Any) -> dict[str, float]:
        """Numbers in SI by path, for a name and its change; refused beyond their range."""
        paths = self.model.parameters_named(name)
        values = change if isinstance(change, tuple) else (change,) * len(paths)
        if len(values) != len(paths):
            raise InputError(f"{self.name}: {name} takes {len(paths)} numbers, not {len(values)}.")
        changed = dict[str, float]()
        for path, value in zip(paths, values, strict=True):
            definition = self.model.parameter_definitions[path]
            number = in_si(value, definition.unit, name) if definition.unit else value
            if not is_real(number):
                raise InputError(f"{self.name}: {path} is {value!r}, but must be a number.")
            if not definition.holds(number):
                raise ParameterError(f"{self.name}: {definition.broken(path, number)}.")
            changed[path] = float(number)
        return changed

    @property
    def title(self) -> str:
        """What it is, in words; empty unless its numbers say it."""
        return ""

    def at_step(self, h: float) -> Machine:
        """The machine whose numbers mean the same at a step [s], itself if they do."""
        del h
        return self

    @property
    def ports(self) -> Ports:
        """What it takes, gives and is set by, by name."""
        return self.model

    @cached_property
    def numbers(self) -> Mapping[str, float]:
        """Its parameters by path."""
        return dict(zip(parameter_paths(self.model), self.params.tolist(), strict=True))

    def with_given(self, given: Any) -> Machine:
        """The machine with other givens, as of a run of its own.

        Raises
        ------
        InputError
            If they have not the type that the model declares.
        """
        parts = []
        for part, numbers in zip(self.model.parts, self.parts, strict=True):
            of_part = member_at(given, part.path) if self.model.is_joined else given
            if part.given is not None and not isinstance(of_part, part.given):
                raise InputError(_not_of_type(self.model, part, "given", part.given, of_part))
            parts.append(numbers if part.given is None else numbers._replace(given=of_part))
        return Machine.of_parts(self.model, tuple(parts), self.name, self.rules)

    @cached_property
    def options(self) -> tuple[Any, ...]:
        """Options of each part."""
        return tuple(part.options for part in self.parts)

    def form(self, signals: Sequence[str]) -> CodeForm:
        """For what its code is made if these signals are given as records."""
        return self._cached(("form", *signals), lambda: self._form(tuple(signals)))

    def _form(self, signals: tuple[str, ...]) -> CodeForm:
        arguments, program = decisions_of(self.model, signals, self.options)
        values = program.values([self.number_at(argument, {}, 0.0) for argument in arguments])
        return CodeForm(signals, self.options, tuple(map(bool, values)))

    @cached_property
    def params(self) -> Array:
        """All parameters as numbers, in the order of `Model.places`."""
        return np.array([number for part in self.parts for number in numbers_of(part.p)])

    @cached_property
    def given(self) -> Array:
        """All givens as numbers."""
        givens = [part.given for part in self.parts if part.given is not None]
        return np.array([number for given in givens for number in numbers_of(given)])

    @cached_property
    def _cache(self) -> dict[Any, Any]:
        """Recent results: a fit asks for the same ones with every set."""
        return {}

    def _cached(self, key: tuple[Any, ...], compute: Callable[[], T]) -> T:
        if key not in self._cache:
            if len(self._cache) > MOST_CACHED:
                self._cache.clear()
            self._cache[key] = compute()
        cached: T = self._cache[key]
        return cached

    def tap_delays(self, signals: Sequence[str], h: float) -> TapDelays:
        """Where every tap reads at a step of `h`."""
        return self._cached(("taps", *signals, h), lambda: self._tap_delays(tuple(signals), h))

    def _tap_delays(self, signals: tuple[str, ...], h: float) -> TapDelays:
        delays = []
        for tapped in taps_of(self.model, signals):
            name = tapped.tap.delay
            delay = 0.0
            if name:
                parameters = self.parts[tapped.part].p
                delay = float(value_at(parameters, name))
            if not 0.0 <= delay < math.inf:
                raise InputError(f"{self.name}: {name} is {delay:g} s, but a delay is at least 0.")
            delays.append(tap_delay(tapped.tap, delay, h))
        return TapDelays(
            samples=np.array([delay.samples for delay in delays], dtype=np.int64),
            fraction=np.array([delay.fraction for delay in delays], dtype=np.float64),
            slope=np.array([delay.slope for delay in delays], dtype=np.float64),
        )

    def longest_past(self, signals: Sequence[str]) -> float:
        """How far back equations read the past of an input at an age that changes. [s]"""
        taps = [tap for tap in taps_of(self.model, tuple(signals)) if tap.tap.longest]
        return max((value_at(self.parts[tap.part].p, tap.tap.longest) for tap in taps), default=0.0)

    def number_at(self, stored: SignalId, signals_before: Mapping[str, float], h: float) -> float:
        """Number that is known ahead of a sample, of constant records; 0 for a tap's fraction."""
        numbers = self.parts[stored.part]
        kind = stored.kind
        if kind == "p":
            return float(value_at(numbers.p, stored.path))
        if kind == "given":
            return float(value_at(numbers.given, stored.path))
        if kind in ("tap", "input"):
            name, _, _ = stored.path.partition(".")
            names = (
                self.model.line(stored.part, name),
                self.model.parts[stored.part].tap(name).signal,
            )
            return next((signals_before[each] for each in names if each in signals_before), 0.0)
        return h if kind == "h" else 0.0

    def check_inputs(self, signals: Collection[str]) -> None:
        """Refuse external signals that the model does not know, and the lack of those it needs."""
        self._check_known(signals)
        for index, part in enumerate(self.model.parts):
            for name in part.input_types:
                signal = part.tap(name).signal
                outside = self.model.link_of(index, name) is None and name not in part.defaults
                if outside and signal not in signals:
                    raise InputError(f"{self.name}: {part.name} needs the signal '{signal}'.")

    def _check_known(self, signals: Collection[str]) -> None:
        inputs = self.ports.external
        for signal in signals:
            if signal not in inputs:
                has = ", ".join(inputs) or "none"
                raise InputError(f"{self.name} has no input '{signal}'; it has {has}.")

    def check_step(self, h: float) -> None:
        """Refuse a step [s] at which the equations of a part are not stable."""
        self._cached(("stable", h), lambda: self._check_step(h))

    def _check_step(self, h: float) -> None:
        for part, numbers in zip(self.model.parts, self.parts, strict=True):
            if part.stable is None:
                continue
            arguments = {"p": numbers.p, "h": h, "options": numbers.options}
            if not called(part, part.stable, arguments) > 0.0:
                raise InputError(f"{self.name}: {unstable_step(part, numbers, h)}")

    def start(
        self,
        first: Mapping[str, float],
        h: float,
        start: Start = "rest",
        states: Sequence[Any] | None = None,
    ) -> InitialStates:
        """States at the first sample, under the `first` values of the external signals.

        At rest signals that are read through taps were zero before, those between parts, too;
        ``"steady"`` is settled at the first values, which then held before. `states` are those of
        the parts if they are known already.
        """
        if states is not None:
            return self._start(first, h, start, states)
        return self._cached((*first.items(), h, start), lambda: self._start(first, h, start, None))

    def _start(
        self, first: Mapping[str, float], h: float, start: Start, states_given: Sequence[Any] | None
    ) -> InitialStates:
        check_start(start)
        self.check_inputs(first)
        late = self._before()
        if start == "rest":
            return self._pass(first, h, start, states_given, late)
        largest = dict.fromkeys(late, 0.0)
        for _ in range(MOST_PASSES):
            initial = self._pass(first, h, start, states_given, late)
            settled = self._late(initial)
            largest = {at: max(largest[at], abs(settled[at])) for at in late}
            if all(abs(settled[at] - late[at]) <= SETTLED * largest[at] for at in late):
                return initial
            late = settled
        raise DomainError(
            f"{self.name}: its parts act back on each other, and do not settle under these "
            "inputs; start at rest."
        )

    def _before(self) -> dict[tuple[int, str], float]:
        """What each signal that comes late was before the record, by part and input."""
        before = dict[tuple[int, str], float]()
        for index, part in enumerate(self.model.parts):
            for name, tap in part.taps.items():
                if tap.late:
                    p = self.parts[index].p
                    before[index, name] = float(value_at(p, tap.before)) if tap.before else 0.0
        return before

    def _late(self, initial: InitialStates) -> dict[tuple[int, str], float]:
        """What each signal that comes late is at a start."""
        now = dict[tuple[int, str], float]()
        for index, name in self._before():
            link = self.model.link_of(index, name)
            if link is not None:
                now[index, name] = linked(
                    link, initial.states, initial.arguments, self.model.replacements
                )
        return now

    def _pass(
        self,
        first: Mapping[str, float],
        h: float,
        start: Start,
        states_given: Sequence[Any] | None,
        late: Mapping[tuple[int, str], float],
    ) -> InitialStates:
        """A start, with what comes late of parts behind."""
        signals_before = {
            name: value if start == "steady" else 0.0 for name, value in first.items()
        }
        states: list[Any] = []
        arguments_of_parts: list[Mapping[str, Any]] = []
        between = dict[str, float]()
        for index, (part, numbers) in enumerate(zip(self.model.parts, self.parts, strict=True)):
            arguments: dict[str, Any] = {
                "p": numbers.p,
                "options": numbers.options,
                "given": numbers.given,
                "h": h,
            }
            needed, gives = self.model.at_rest[index]
            for name in part.input_types:
                tap = part.tap(name)
                link = self.model.link_of(index, name)
                if link is not None and tap.late:
                    value = late[index, name]
                    between[self.model.line(index, name)] = value
                elif link is not None:
                    value = 0.0
                    if start == "steady" or name in needed:
                        value = linked(link, states, arguments_of_parts, self.model.replacements)
                    if name in part.taps:
                        rest = float(value_at(numbers.p, tap.before)) if tap.before else 0.0
                        value = value if start == "steady" else rest
                        between[self.model.line(index, name)] = value
                elif tap.signal in first:
                    value = (signals_before if name in part.taps else first)[tap.signal]
                else:
                    value = float(value_at(numbers.p, part.defaults[name]))
                arguments[name] = held_input(tap, value, numbers.p, h)
            if part.inputs is not None:
                arguments["inputs"] = part.inputs(*(arguments[name] for name in part.input_types))
            if states_given is None:
                arguments["state"] = self._state(part, arguments, start)
            else:
                arguments["state"] = states_given[index]
            states.append(arguments["state"])
            if part.sample is not None and (start == "steady" or gives):
                try:
                    arguments["signals"] = called(part, part.sample, arguments)
                except NO_NUMBER:
                    # outside the domain; the march, which asks for its margin, says what is wrong
                    none = dict.fromkeys(floats_of(part.signals or tuple), math.nan)
                    arguments["signals"] = tuple_from(part.signals or tuple, none)
            arguments_of_parts.append(arguments)
        return InitialStates(tuple(states), signals_before, tuple(arguments_of_parts), between)

    def signals_under(
        self,
        records: Mapping[str, Record],
        start: Start,
        begin: Mapping[str, float],
        *,
        first: tuple[str, ...] = (),
        states: bool = True,
        everything: bool = False,
    ) -> dict[str, Array]:
        """Signals under inputs, on the grid of these, by name.

        Those named `first` or, if none is named, all; if everything is wanted the others as well,
        and limits as sums of bits. Numbers of the state are among them with `states`.
        """
        record = next(iter(records.values()))
        self.check_step(record.step)
        outputs = march_outputs(self.model, first, states=states)
        table = marched(
            self,
            {name: each.values for name, each in records.items()},
            record.step,
            self.start(
                {n: float(each.values[0]) for n, each in records.items()}, record.step, start
            ),
            tuple(outputs.first.values()),
            next(iter(records)),
            begin,
            further=tuple(outputs.further.values()),
            everything=everything,
        )
        names = [*outputs.first]
        if everything:
            names += outputs.further
        return dict(zip(names, table, strict=True))

    def _state(self, part: Model, arguments: Mapping[str, Any], start: Start) -> Any:
        equation = part.rest if start == "rest" else part.settled
        if equation is not None:
            state = self._called(part, equation, arguments)
            if not isinstance(state, part.state):
                raise InputError(
                    f"{self.name}: {equation.__name__} must return a "
                    f"{part.state.__name__}, not {state!r}."
                )
            return state
        if start == "steady" and floats_of(part.state):
            raise InputError(
                f"{self.name}: {part.name} has no equation for its steady state ('settled'), so "
                "it cannot start settled."
            )
        zeros = dict.fromkeys(floats_of(part.state), 0.0)
        return tuple_from(part.state, zeros | defaults_of(part.state))

    def _called(
        self, part: Model, equation: Callable[..., Any], arguments: Mapping[str, Any]
    ) -> Any:
        try:
            return called(part, equation, arguments)
        except NO_NUMBER as error:
            raise DomainError(
                f"{self.name}: {equation.__name__} cannot be computed for these numbers ({error})."
            ) from None


def held_input(tap: Tap, value: float, p: Any, h: float) -> float | Window | History:
    """What an equation is given of an input that has always had one value."""
    if tap.longest:
        return History(value, float(value_at(p, tap.longest)) / h)
    return Window((value,) * tap.width, 0.0) if tap.width else value


def options_of(part: Model, p: Any, options: Any, touched: Set[str] | None = None) -> Any:
    """Options of a part as its parameters have them.

    What a parameter switches on is on if one of its parameters is not 0; with `touched`, paths of
    changed parameters, only of those.
    """
    on = dict[str, Any]()
    for (_, option), paths in part.switches.items():
        if touched is None or not touched.isdisjoint(paths):
            on[option] = any(value_at(p, path) != 0.0 for path in paths)
    for option, equation in part.follows.items():
        on[option] = bool(called(part, equation, {"p": p}))
    return options._replace(**{name: acts or None for name, acts in on.items()}) if on else options


def unstable_step(part: Model, numbers: PartNumbers, h: float) -> str:
    """What is wrong with a step [s] that a part does not bear, as a sentence."""
    if part.unstable is not None:
        return part.unstable(numbers.p, h, numbers.options)
    return (
        f"{part.path} is unstable at a step of 1/{1.0 / h:g} s; simulate with more substeps or a "
        "higher rate."
    )


def called(part: Model, equation: Callable[..., Any], arguments: Mapping[str, Any]) -> Any:
    """What an equation of a part returns; it takes those of the arguments that it names."""
    values = (arguments[name] for name in arguments_of(equation))
    return with_replacements(equation, part.replacements)(*values)


def linked(
    link: Link,
    states: Sequence[Any],
    arguments: Sequence[Mapping[str, Any]],
    replacements: Replacements,
) -> float:
    """A signal between parts, from the states and the equations' `arguments` of those before."""
    values = []
    for source in link.sources:
        signals = arguments[source.part].get("signals")
        inside = signals is not None and source.signal in floats_of(type(signals))
        values.append(value_at(signals if inside else states[source.part], source.signal))
    if link.equation is None:
        return float(values[0])
    return float(with_replacements(link.equation, replacements)(*values))


def _not_of_type(model: Model, part: Model, what: str, kind: type[Any], value: Any) -> str:
    """What is wrong with numbers of a part that have not the type which it declares."""
    hint = ""
    if model.is_joined:
        fields = ", ".join(f"{field}=..." for field in getattr(model, what)._fields)
        hint = f": those of {model.name} are its {what}({fields})"
    return f"Model {part.name}: its {what} must be a {kind.__name__}, not {value!r}{hint}."


def _checked_parts(model: Model, p: Any, options: Any, given: Any) -> tuple[PartNumbers, ...]:
    """Numbers of each part, of the types that the model declares."""
    parts = []
    for part in model.parts:
        numbers = PartNumbers(p, options, given)
        if model.is_joined:
            numbers = PartNumbers(
                p=member_at(p, part.path),
                options=member_at(options, part.path),
                given=member_at(given, part.path),
            )
        stated = numbers.options is not None
        if part.options is not None and not stated:
            numbers = numbers._replace(options=part.options())
        kinds = {"parameters": part.parameters, "options": part.options, "given": part.given}
        for (what, kind), value in zip(kinds.items(), numbers, strict=True):
            if kind is None:
                if value is not None and not model.is_joined:
                    raise InputError(f"Model {part.name} has no {what}, but is passed {value!r}.")
                continue
            if not isinstance(value, kind):
                raise InputError(_not_of_type(model, part, what, kind, value))
            if what == "options" and any(option not in (None, True, False) for option in value):
                raise InputError(
                    f"Model {part.name}: its options are None or False (off) or True (on), not "
                    f"{value!r}."
                )
            for path in () if what == "options" else floats_of(kind):
                number = value_at(value, path)
                if not is_real(number):
                    raise InputError(
                        f"Model {part.name}: {path} is {number!r}, but must be a real number."
                    )
        if numbers.options is not None:  # off is None, so that code is made for one form of it
            forms = [option or None for option in numbers.options]
            chosen = type(numbers.options)(*forms)
            touched = frozenset[str]() if stated else None
            numbers = numbers._replace(options=options_of(part, numbers.p, chosen, touched))
        parts.append(numbers)
    return tuple(parts)


# --- marching -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class PlannedMarch:
    """The march of one set, which is compiled when it is first called for."""

    model: Model
    form: CodeForm
    targets: tuple[tuple[SignalId, int], ...]
    """What is kept, and its row of the block."""
    further: tuple[tuple[SignalId, int], ...] = ()
    """What is kept if everything is wanted."""

    def __call__(self) -> Kernel:
        """The march, compiled."""
        return _march_of(self)


@generating
def _march_of(planned: PlannedMarch) -> Kernel:
    model, form, targets, further = (getattr(planned, each.name) for each in fields(planned))
    if JIT_OFF:
        sample_code = SampleCode(model, form, [each for each, _ in targets + further])
        return InterpretedMarch(sample_code, dict(targets), dict(further))
    text = cached_on_disk(
        f"{model.name}_march",
        (key_of(model), form, targets, further),
        lambda: march_text(model, form, dict(targets), dict(further)),
    )
    return code_of_text(f"{model.name}_march", text, KERNEL_KINDS)


class MarchOutputs(NamedTuple):
    """What a march computes, by name."""

    first: dict[str, SignalId]
    """Signals of the first march."""
    further: dict[str, SignalId]
    """Other signals, and limits, if it is to compute everything."""


@lru_cache(maxsize=256)
def march_outputs(
    model: Model, first_signals: tuple[str, ...], *, states: bool = True
) -> MarchOutputs:
    """What the marches of a model compute; the first one all signals if none is named.

    Numbers of the state are among them with `states`.
    """
    names = model.every_signal
    if not states:
        names = tuple(name for name in names if output_of(model, name)[0].kind != "state")
    first = {name: output_of(model, name)[0] for name in first_signals or names}
    further = {name: output_of(model, name)[0] for name in names if name not in first}
    limited = dict.fromkeys(part for part, _ in model.limit_bits.values())
    further |= {f"limits {part}": SignalId(part, "limits") for part in limited}
    return MarchOutputs(first, further)


def marched(
    instance: Machine,
    records: Mapping[str, Array],
    h: float,
    initial: InitialStates,
    stored: tuple[SignalId, ...],
    cause: str = "input",
    begin: Mapping[str, float] = MappingProxyType({}),
    *,
    further: tuple[SignalId, ...] = (),
    everything: bool = False,
) -> Array:
    """(r, n) numbers in the order of `stored`, marched over whole records; limits as sums of bits.

    The march starts from `initial`, apart from the states that `begin` gives by path. `cause` is
    what drives the model, for the message if it leaves its domain or a number overflows. The same
    march computes `further` numbers if `everything` is wanted; they follow in the table.
    """
    table, check = unchecked_march(
        instance, records, h, initial, stored, cause, begin, further=further, everything=everything
    )
    check()
    return table


def unchecked_march(
    instance: Machine,
    records: Mapping[str, Array],
    h: float,
    initial: InitialStates,
    stored: tuple[SignalId, ...],
    cause: str = "input",
    begin: Mapping[str, float] = MappingProxyType({}),
    *,
    further: tuple[SignalId, ...] = (),
    everything: bool = False,
) -> tuple[Array, Callable[[], None]]:
    """The table of `marched`, and what refuses it if it leaves the domain or is not finite."""
    signals = tuple(records)
    size = next(iter(records.values())).size
    rows = [*zip((*stored, *further), count(), strict=False)]
    planned = PlannedMarch(
        instance.model,
        instance.form(signals),
        tuple(rows[: len(stored)]),
        tuple(rows[len(stored) :]),
    )
    stored = (*stored, *further) if everything else stored
    table = np.empty((len(stored), size))
    worst_margin = np.array([np.inf, float(everything)])
    states = initial_states(instance, initial, begin)
    values = tuple(np.ascontiguousarray(record, dtype=np.float64) for record in records.values())
    values += tuple(np.empty(size) for _ in initial.between)
    arrays = arrays_of(
        instance,
        values,
        initial,
        instance.tap_delays(signals, h),
        states,
        worst_margin,
        table.reshape(-1),
    )
    planned()(size, 0, h, *arrays)

    def check() -> None:
        check_domain(instance, states, float(worst_margin[0]), cause)
        check_outputs(instance, stored, table, h, cause)

    return table, check


def check_outputs(
    instance: Machine, stored: Sequence[SignalId], table: Array, h: float, cause: str
) -> None:
    """Refuse samples that are not finite; of (r, n) or (r,) numbers the first one is named."""
    with np.errstate(all="ignore"):
        if math.isfinite(table.sum()):  # a sum of finite numbers may overflow: see below
            return
    samples = table.reshape(len(stored), -1)
    bad = ~np.isfinite(samples)
    if not bad.any():
        return
    first = int(np.argmax(bad.any(axis=0)))
    row = int(np.argmax(bad[:, first]))
    when = f" at {first * h:g} s" if table.ndim > 1 else ""
    raise DomainError(
        f"{instance.name}: {stored[row].path} is {samples[row, first]}{when}: a number overflows "
        f"under this {cause}; check the size of the parameters and of what was measured."
    )


def initial_states(instance: Machine, initial: InitialStates, begin: Mapping[str, float]) -> Array:
    """States as numbers, some of them as given by path."""
    check_mapping("begin", begin)
    states = initial.flat
    paths = state_paths(instance.model) if begin else ()
    for path, value in begin.items():
        if path not in paths:
            has = ", ".join(paths) or "none"
            raise InputError(f"{instance.name} has no state '{path}' to start from; it has {has}.")
        if not is_real(value) or not np.isfinite(value):
            raise InputError(f"{path} begins at {value!r}, but must be a finite number.")
        states[paths.index(path)] = value
    return states


def arrays_of(
    instance: Machine,
    values: tuple[Array, ...],
    initial: InitialStates,
    delays: TapDelays,
    states: Array,
    worst_margin: Array,
    flat: Array,
) -> MarchArrays:
    """What kernels take from ``records`` on (see `kernels.KERNEL_ARGUMENTS`).

    `values` are the records, then room for the signals between parts that taps read. The caller
    must keep them as well: what is made of them are addresses.
    """
    return MarchArrays(
        pointers(values),
        np.array([*initial.before.values(), *initial.between.values()]),
        delays.samples,
        delays.fraction,
        instance.params,
        instance.given,
        states,
        worst_margin,
        flat,
    )


def check_domain(instance: Machine, states: Array, worst: float, cause: str) -> None:
    """Refuse what was computed outside the model's equations, or is not a finite state."""
    if not worst > 0.0:
        raise DomainError(f"{instance.name}: {outside(instance.model, worst, cause)}")
    if np.isfinite(states).all():
        return
    bad = int(np.argmax(~np.isfinite(states)))
    part, path = instance.model.places("state")[bad]
    whose = f"{instance.name}: {instance.model.parts[part].name}'s"
    raise DomainError(
        f"{whose} {path} is {states[bad]} at the end of the record: the numbers overflow under "
        f"this {cause}; check the size of the parameters."
    )


def outside(model: Model, worst: float, cause: str) -> str:
    """What has happened if the margin is not above 0."""
    parts = [part for part in model.parts if part.domain is not None]
    sentences: list[str] = []
    for part in parts or [model]:
        if callable(part.outside):
            sentences.append(part.outside(worst, cause))
        else:
            sentences.append(f"{part.outside} under this {cause}.")
    return " Or: ".join(dict.fromkeys(sentences))
