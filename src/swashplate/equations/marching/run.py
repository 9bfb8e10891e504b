"""A model with numbers: its start, its march, and what lies inside."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.cache import generated, kernel
from swashplate.equations.code import compiled_names, generating
from swashplate.equations.equation import inlined, interpreted
from swashplate.equations.fields import floats_of, is_real, made, numbers_of, value_at
from swashplate.equations.marching.march import march_source
from swashplate.equations.marching.part import Stored, taps_of
from swashplate.equations.marching.pieces import Planned, addresses, piece, pointers, run_once
from swashplate.equations.model import Link, Model, Place, Window, arguments_of, place, state_paths
from swashplate.equations.syntax import plain
from swashplate.errors import DomainError, InputError

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Start = Literal["rest", "steady"]

K = TypeVar("K")
T = TypeVar("T")

STARTS = ("rest", "steady")


def check_start(start: str) -> None:
    """Refuse a start that is neither ``"rest"`` nor ``"steady"``."""
    if start not in STARTS:
        raise InputError(f"start is '{start}'; it is 'rest' or 'steady'.")


class Part(NamedTuple):
    """Numbers of a part of a model."""

    p: Any
    options: Any = None
    given: Any = None


class Started(NamedTuple):
    """States of all parts at the first sample, and what they follow from."""

    states: tuple[Any, ...]
    before: Mapping[str, float]  # External signals before the record.
    arguments: tuple[Mapping[str, Any], ...]
    """Of each part what its equations take, by the arguments' names."""

    @property
    def flat(self) -> Array:
        """All states as numbers."""
        return np.array([number for state in self.states for number in numbers_of(state)])


class Places(NamedTuple):
    """Where the taps read, all of them."""

    whole: Indices
    fraction: Array
    slope: Array


@dataclass(frozen=True)
class Instance:
    """A model with its numbers."""

    model: Model
    parts: tuple[Part, ...]
    name: str

    @cached_property
    def options(self) -> tuple[Any, ...]:
        """Options of each part."""
        return tuple(part.options for part in self.parts)

    @cached_property
    def params(self) -> Array:
        """All parameters as numbers, in the order of `Model.places`."""
        return np.array([number for part in self.parts for number in numbers_of(part.p)])

    @cached_property
    def given(self) -> Array:
        """All givens as numbers."""
        found = [part.given for part in self.parts if part.given is not None]
        return np.array([number for each in found for number in numbers_of(each)])

    def places(self, signals: Sequence[str], h: float) -> Places:
        """Where every tap reads at a step of `h`."""
        key = (tuple(signals), h)
        if key in self._places:
            return self._places[key]
        found: list[Place] = []
        for each in taps_of(self.model, tuple(signals)):
            name, p = each.tap.delay, self.parts[each.part].p
            delay = float(value_at(p, name)) if name else 0.0
            if not 0.0 <= delay < math.inf:
                raise InputError(f"{self.name}: {name} is {delay:g} s, but a delay is at least 0.")
            found.append(place(each.tap, delay, h))
        places = Places(
            np.array([each.whole for each in found], dtype=np.int64),
            np.array([each.fraction for each in found]),
            np.array([each.slope for each in found]),
        )
        return _remembered(self._places, key, places)

    def check_inputs(self, signals: Collection[str]) -> None:
        """Refuse external signals that the model does not know, and the lack of those it needs."""
        known = self.model.external
        for signal in signals:
            if signal not in known:
                raise InputError(f"{self.name} has no input '{signal}'; it has {', '.join(known)}.")
        for i, part in enumerate(self.model.parts):
            for name in part.input_types:
                signal = part.tap(name).signal
                outside = self.model.link_of(i, name) is None and name not in part.defaults
                if outside and signal not in signals:
                    raise InputError(f"{self.name}: {part.name} needs the signal '{signal}'.")

    def start(
        self,
        first: Mapping[str, float],
        h: float,
        start: Start = "rest",
        chosen: Sequence[Any] | None = None,
    ) -> Started:
        """States at the first sample.

        Parameters
        ----------
        first : mapping of str to float
            External signals at the first sample.
        h : float
            Step. [s]
        start : {"rest", "steady"}
            At rest, where signals that are read through taps were zero before; or settled at the
            first values, which then held before, too.
        chosen : sequence, optional
            State of each part, in place of the one that `start` says.

        Raises
        ------
        InputError
            If a signal is missing or unknown, or the model cannot start settled.
        DomainError
            If constants or the state cannot be computed for these numbers.
        """
        key = (tuple(first.items()), h, start)
        if chosen is None and key in self._starts:
            return self._starts[key]
        check_start(start)
        self.check_inputs(first)
        before = {name: value if start == "steady" else 0.0 for name, value in first.items()}
        states: list[Any] = []
        found: list[Mapping[str, Any]] = []
        for i, (part, own) in enumerate(zip(self.model.parts, self.parts, strict=True)):
            known: dict[str, Any] = {"p": own.p, "options": own.options, "given": own.given}
            known["h"] = h
            if part.constants is not None:
                known["k"] = self._called(part.constants, known)
            for name in part.input_types:
                known[name] = self._input(i, name, first, before, states, found)
            if part.inputs is not None:
                known["inputs"] = part.inputs(*(known[name] for name in part.input_types))
            known["state"] = self._state(part, known, start) if chosen is None else chosen[i]
            states.append(known["state"])
            if part.sample is not None:
                known["signals"] = _sampled(part, known)
            found.append(known)
        made_now = Started(tuple(states), before, tuple(found))
        return made_now if chosen is not None else _remembered(self._starts, key, made_now)

    # what was found lately: a fit asks for the same with every set
    @cached_property
    def _places(self) -> dict[tuple[tuple[str, ...], float], Places]:
        return {}

    @cached_property
    def _starts(self) -> dict[tuple[tuple[tuple[str, float], ...], float, Start], Started]:
        return {}

    def _state(self, part: Model, known: Mapping[str, Any], start: Start) -> Any:
        equation = part.rest if start == "rest" else part.settled
        if equation is not None:
            found = self._called(equation, known)
            if not isinstance(found, part.state):
                raise InputError(
                    f"{self.name}: {plain(equation).__name__} must return a "
                    f"{part.state.__name__}, not {found!r}."
                )
            return found
        if start == "steady" and floats_of(part.state):
            raise InputError(
                f"{self.name}: {part.name} has no equation for its steady state ('settled'), so "
                "it cannot start settled."
            )
        defaults = part.state._field_defaults
        empty = [path for path in floats_of(part.state) if path.split(".")[0] not in defaults]
        return made(part.state, dict.fromkeys(empty, 0.0))

    def _called(self, equation: Callable[..., Any], known: Mapping[str, Any]) -> Any:
        try:
            return called(equation, known)
        except (ValueError, ZeroDivisionError, OverflowError) as error:
            raise DomainError(
                f"{self.name}: {plain(equation).__name__} cannot be computed for these numbers "
                f"({error})."
            ) from None

    def _input(
        self,
        part: int,
        name: str,
        first: Mapping[str, float],
        before: Mapping[str, float],
        states: Sequence[Any],
        found: Sequence[Mapping[str, Any]],
    ) -> Any:
        own = self.model.parts[part]
        link = self.model.link_of(part, name)
        if link is not None:
            return linked(link, states, found)
        tap = own.tap(name)
        if tap.signal in first:
            value = before[tap.signal] if own.looked_at(name) else first[tap.signal]
        else:
            value = float(value_at(self.parts[part].p, own.defaults[name]))
        return Window((value,) * tap.width, 0.0) if tap.width else value


def called(equation: Callable[..., Any], known: Mapping[str, Any]) -> Any:
    """What an equation gives for what is known by the names of its arguments."""
    return interpreted(equation)(*(known[name] for name in arguments_of(equation)))


def _remembered(known: dict[K, T], key: K, value: T) -> T:
    """Keep a value, of few at a time."""
    if len(known) > 64:
        known.clear()
    known[key] = value
    return value


def _sampled(part: Model, known: Mapping[str, Any]) -> Any:
    """Signals of a part at its start; none of them a number outside the part's domain.

    The march, which computes them again and asks for the domain's margin, says what is wrong.
    """
    assert part.sample is not None
    assert part.signals is not None
    try:
        return called(part.sample, known)
    except (ValueError, ZeroDivisionError, OverflowError):
        return made(part.signals, dict.fromkeys(floats_of(part.signals), math.nan))


def linked(link: Link, states: Sequence[Any], found: Sequence[Mapping[str, Any]]) -> float:
    """A signal between parts, from the states and signals of those before."""
    values = []
    for source in link.sources:
        signals = found[source.part].get("signals")
        inside = signals is not None and source.signal in floats_of(type(signals))
        values.append(value_at(signals if inside else states[source.part], source.signal))
    if link.equation is None:
        return float(values[0])
    return float(interpreted(link.equation)(*values))


# --- kernels --------------------------------------------------------------------------------------


def module(name: str, text: str, names: Mapping[str, Any]) -> dict[str, Any]:
    """A generated module with what every one of them needs."""
    mathematics = {k: v for k, v in vars(math).items() if not k.startswith("_")}
    used = compiled_names(names)
    return generated(name, text, {**mathematics, "kernel": kernel, "inlined": inlined, **used})


@generating
def march_of(
    model: Model, signals: tuple[str, ...], options: tuple[Any, ...], stored: tuple[Stored, ...]
) -> Planned:
    """The march over whole records, a row for each number that is kept."""
    rows = {each: f"flat[{row} * count + n]" for row, each in enumerate(stored)}
    text, names = march_source(model, signals, options, rows)
    names["piece"] = piece
    return generating(lambda: module(f"{model.name}_march", text, names)["march"])


def marched(
    instance: Instance,
    records: Mapping[str, Array],
    h: float,
    started: Started,
    stored: tuple[Stored, ...],
    cause: str = "input",
    begin: Mapping[str, float] = MappingProxyType({}),
) -> Array:
    """March over whole records from where it begins, or from states by path.

    Returns
    -------
    (r, n) array
        What is kept, in the order of `stored`; limits as the sum of their bits.

    Raises
    ------
    DomainError
        If the model leaves its domain, or a number overflows; `cause` is what drives the model.
    """
    signals, size = tuple(records), next(iter(records.values())).size
    planned = march_of(instance.model, signals, instance.options, stored)
    table, met = np.empty((len(stored), size)), np.array([np.inf])
    states = begun(instance, started, begin)
    values = tuple(np.ascontiguousarray(each, dtype=np.float64) for each in records.values())
    places = instance.places(signals, h)
    arrays = arrays_of(instance, values, started, places, states, met, table.reshape(-1))
    run_once(addresses((planned,), (0,)), arrays, size, h)
    check_domain(instance, states, float(met[0]), cause)
    return table


def begun(instance: Instance, started: Started, begin: Mapping[str, float]) -> Array:
    """States as numbers, some of them as given by path."""
    states = started.flat
    known = state_paths(instance.model) if begin else ()
    for path, value in begin.items():
        if path not in known:
            raise InputError(
                f"{instance.name} has no state '{path}' to start from; it has {', '.join(known)}."
            )
        if not is_real(value) or not np.isfinite(value):
            raise InputError(f"{path} begins at {value!r}, but must be a finite number.")
        states[known.index(path)] = value
    return states


def arrays_of(
    instance: Instance,
    values: tuple[Array, ...],
    started: Started,
    places: Places,
    states: Array,
    met: Array,
    flat: Array,
) -> tuple[Any, ...]:
    """What pieces take from ``records`` on (see `pieces.PIECE`); `values` must be kept as well."""
    return (
        pointers(values),
        np.array([*started.before.values()]),
        places.whole,
        places.fraction,
        instance.params,
        instance.given,
        states,
        met,
        flat,
    )


def check_domain(instance: Instance, states: Array, worst: float, cause: str) -> None:
    """Refuse what was computed outside the model's equations.

    Raises
    ------
    DomainError
        If the worst margin is not above 0, or a state is not finite.
    """
    if not worst > 0.0:
        raise DomainError(f"{instance.name}: {outside(instance.model, worst, cause)}")
    if np.isfinite(states).all():
        return
    names = [
        f"{part.name}'s {path}" for part in instance.model.parts for path in floats_of(part.state)
    ]
    bad = int(np.argmax(~np.isfinite(states)))
    raise DomainError(
        f"{instance.name}: {names[bad]} is {states[bad]} at the end of the record: the numbers "
        f"overflow under this {cause}; check the size of the parameters."
    )


def outside(model: Model, worst: float, cause: str) -> str:
    """What has happened where the margin is not above 0."""
    parts = [part for part in model.parts if part.domain is not None]
    said = [
        each.outside(worst, cause)
        if callable(each.outside)
        else f"{each.outside} under this {cause}."
        for each in parts or [model]
    ]
    return " Or: ".join(said)
