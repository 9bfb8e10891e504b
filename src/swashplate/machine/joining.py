"""Models joined: in series, or as named members whose inputs are wired to signals by path."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple, overload

from swashplate.errors import InputError
from swashplate.machine.marching.run import Machine
from swashplate.machine.model import (
    Equation,
    Link,
    Model,
    SignalSource,
    Tap,
    arguments_of,
    full_name,
    near_names,
    packaged,
    source_of,
)


class Late(NamedTuple):
    """A signal a sample later; see `late`."""

    signal: str
    before: str = ""


def late(signal: str, before: str = "") -> Late:
    """A signal as it was a sample before, for a link that closes a loop.

    Parameters
    ----------
    signal : str
        Its path; the part that gives it may stand behind the one that takes it.
    before : str
        What it was before the first sample: path of a parameter of the part that takes it; by
        default it was zero.

    Returns
    -------
    Late
        What `join` takes as a link: ``links={"winch.load_torque": late("load.torque")}``.
    """
    return Late(signal, before)


Wire = str | Late | Equation | tuple[Any, ...]
"""What an input takes: a signal, an equation over signals that its arguments name, or a tuple of an
equation and the paths of its signals."""


@overload
def join(
    name: str,
    *models: Model | Mapping[str, Model],
    links: Mapping[str, Wire] | None = None,
    **changes: Any,
) -> Model: ...


@overload
def join(
    name: str,
    *machines: Mapping[str, Machine],
    links: Mapping[str, Wire] | None = None,
    **changes: Any,
) -> Machine: ...


def join(
    name: str,
    *models: Any,
    links: Mapping[str, Wire] | None = None,
    **changes: Any,
) -> Model | Machine:
    """Models, or machines, as one: in series, or as named members.

    Parameters
    ----------
    name : str
        Name of the whole.
    *models : Model, or one mapping of str to Model or to Machine
        In the order of the flow. In series an input takes the signal of that name of a model before
        it. Members of a mapping know nothing of each other: their inputs are wired by `links`, or
        come from outside, and their parameters, states and signals stand at paths such as
        ``hoist.pump.Z9``, ``hoist.shaft_speed``. The last words of a path are enough where they are
        unique. Members may be joined models themselves, and several may be one model. Of machines
        the whole is a machine with their numbers.
    links : mapping of str, optional
        What an input takes, by its path, such as ``{"load.pull": "winch.shaft_torque"}``: a signal,
        another input, an equation over the signals that its arguments name, or a tuple of an
        equation and the paths of its signals. Any other name becomes a further signal.
    **changes
        `integrals`, `outputs`, `free_start`, `replacements` of the whole. Members keep theirs.

    Returns
    -------
    Model or Machine
        The whole; `Model.parts` are the single models that it consists of.

    Raises
    ------
    InputError
        If two models have the same name, a link names a signal that there is not, or an input needs
        one that is only known after it.

    Notes
    -----
    A signal must be known before it is needed: loops without delay between models are not possible.
    A `late` link takes it as it was a sample before.

    Examples
    --------
    >>> from swashplate import join
    >>> from swashplate.models.amplifier import card
    >>> from swashplate.models.drive import drive
    >>> from swashplate.models.pump import pump
    >>> join("winch", card, pump).external
    ('voltage', 'pump_speed', 'load_torque', 'supply_pressure')
    >>> tug = join("tug", {"port": drive, "starboard": drive})
    >>> tug.external[0], len(tug.parts)
    ('port.voltage', 4)
    """
    members, machines = _members(name, models)
    wires = tuple((links or {}).items())
    try:
        model = _joined_once(name, tuple(members), wires, tuple(changes.items()))
    except TypeError:  # something of a list or a mapping, which has no hash
        model = _joined(name, members, dict(wires), changes)
    if not machines:
        return model
    numbers = tuple(part for machine in machines.values() for part in machine.parts)
    rules = tuple(
        each._replace(member=_path(key, each.member))
        for key, machine in machines.items()
        for each in machine.rules
    )
    return Machine.of_parts(model, numbers, name, rules)


@lru_cache(maxsize=64)
def _joined_once(
    name: str,
    members: tuple[tuple[str, Model], ...],
    wires: tuple[tuple[str, Wire], ...],
    changes: tuple[tuple[str, Any], ...],
) -> Model:
    """The same model again if the same ones are joined in the same way."""
    return _joined(name, members, dict(wires), dict(changes))


def _joined(
    name: str, members: Members, links: Mapping[str, Wire], changes: dict[str, Any]
) -> Model:
    """A model of members."""
    parts = [part for key, model in members for part in _placed(key, model)]
    places = [part.path for part in parts]
    if len(set(places)) != len(places):
        raise InputError(f"Joined models need different names, not {', '.join(places)}.")
    linked = dict(_links_within(members))
    for wanted, wire in links.items():
        inputs = [part.tap(each).signal for part in parts for each in part.input_types]
        at = full_name(wanted, inputs)
        if isinstance(wire, str | Late):
            if at not in inputs:
                raise InputError(f"Model {name}: there is no input {near_names(wanted, inputs)}.")
            others = [] if isinstance(wire, Late) else [each for each in inputs if each != at]
            signal = wire.signal if isinstance(wire, Late) else wire
            source = _signal(name, parts, linked, signal, others)
            parts = [_wired(part, at, source, wire) for part in parts]
        else:
            linked[at] = _link(name, at, parts, wire)

    def gathered(attribute: str) -> Any:
        kinds = {part.path: getattr(part, attribute) for part in parts}
        present = {path: kind for path, kind in kinds.items() if kind}
        return _nested(f"{name.title()}{attribute.title()}", present)

    kinds = {kind: gathered(kind) for kind in ("parameters", "state", "options", "given")}
    for word in ("integrals", "replacements"):
        changes[word] = dict(_carried(members, word)) | {**changes.get(word, {})}
    outputs = [_path(key, each) for key, model in members if key for each in model.outputs]
    changes.setdefault("outputs", tuple(outputs))
    model = Model(name, step=parts[0].step, parts=tuple(parts), links=linked, **kinds, **changes)
    for wrong in _too_late(model):
        raise InputError(wrong)
    return model


# --- members --------------------------------------------------------------------------------------


Members = Sequence[tuple[str, Model]]
"""Models with their names, which are empty in series."""


def _members(name: str, models: Sequence[Any]) -> tuple[Members, dict[str, Machine]]:
    """The members, and the machines that all of them are, if they are machines."""
    named = models[0] if len(models) == 1 and isinstance(models[0], Mapping) else {}
    given = [*named.items()] or [("", each) for each in models]
    machines = {key: each for key, each in given if isinstance(each, Machine)}
    if named and len(machines) == len(given):
        given = [(key, each.model) for key, each in given]
    for key, model in given:
        if not isinstance(model, Model):
            what = f"{key} is {model!r}" if key else repr(model)
            raise InputError(
                f"Model {name} is joined from models, or from one mapping of names to models or to "
                f"machines, and {what} is no model."
            )
        if named and not str(key).isidentifier():
            raise InputError(f"Model {name}: a member's name is one word, not {key!r}.")
    return given, machines


def _path(*words: str) -> str:
    return ".".join(filter(None, words))


def _placed(key: str, model: Model) -> Iterator[Model]:
    """The parts of a model as those of the member of this name."""
    if not key:
        yield from model.parts
        return
    for part in model.parts:
        yield replace(
            part,
            parts=(),
            place=_path(key, part.path) if model.is_joined else key,
            scope=_path(key, part.scope),
            wired={name: _path(key, part.tap(name).signal) for name in part.input_types},
        )


def _links_within(members: Members) -> Iterator[tuple[str, Link]]:
    """Links that named models have already."""
    first = 0
    for key, model in members:
        for name, link in model.links.items() if key else ():
            sources = tuple(SignalSource(first + part, signal) for part, signal in link.sources)
            yield _path(key, name), Link(_path(key, name), sources, link.equation)
        first += len(model.parts)


def _carried(members: Members, word: str) -> Iterator[tuple[Any, Any]]:
    """Integrals or replacements that named models have already."""
    for key, model in members:
        for name, value in getattr(model, word).items() if key else ():
            is_path = isinstance(name, str)
            yield (_path(key, name), _path(key, value)) if is_path else (name, value)


def _nested(title: str, kinds: Mapping[str, Any]) -> Any:
    """A class of named tuples with types at paths."""
    below = dict[str, dict[str, Any]]()
    for path, kind in kinds.items():
        word, _, rest = path.partition(".")
        below.setdefault(word, {})[rest] = kind
    fields = [
        (word, inner[""] if "" in inner else _nested(f"{title}{word.title()}", inner))
        for word, inner in below.items()
    ]
    return NamedTuple(title, fields)


# --- links ----------------------------------------------------------------------------------------


def _wired(part: Model, at: str, signal: str, wire: str | Late) -> Model:
    """A part whose inputs of the name `at` take a signal."""
    inputs = [name for name in part.input_types if part.tap(name).signal == at]
    if not inputs:
        return part
    taps = dict(part.taps)
    if isinstance(wire, Late):
        for name in inputs:
            tap = part.taps.get(name, Tap(name, hold="none"))
            taps[name] = tap._replace(late=tap.late + 1, before=wire.before)
    wired = {**part.wired, **dict.fromkeys(inputs, signal)}
    return replace(part, parts=(), taps=taps, wired=wired)


def _signal(
    name: str,
    parts: Sequence[Model],
    links: Mapping[str, Link],
    wanted: str,
    inputs: Sequence[str] = (),
) -> str:
    """Full name of a signal of some parts, of a link or, if there is none, of some inputs."""
    signals = [*links, *(part.full(each) for part in parts for each in part.signal_names)]
    for names in (signals, inputs):
        found = full_name(wanted, names)
        if found in names:
            return found
    raise InputError(f"Model {name}: there is no signal {near_names(wanted, signals)}.")


def _link(name: str, at: str, parts: Sequence[Model], wire: Any) -> Link:
    """A signal that an equation makes of those of several parts."""
    equation, *paths = wire if isinstance(wire, tuple) else (wire,)
    wanted = paths or arguments_of(equation)
    if len(wanted) != len(arguments_of(equation)):
        raise InputError(
            f"Model {name}: {equation.__name__} takes {', '.join(arguments_of(equation))}, but the "
            f"link {at} names {', '.join(wanted)}."
        )
    sources = [source_of(parts, _signal(name, parts, {}, each)) for each in wanted]
    return Link(at, tuple(source for source in sources if source is not None), equation)


def _too_late(model: Model) -> Iterator[str]:
    """What a part of a joined model would take from outside, although it is known after it."""
    upstream = [set[int]() for _ in model.parts]
    inputs = [(index, name) for index, part in enumerate(model.parts) for name in part.input_types]
    for index, name in inputs:
        link = model.link_of(index, name)
        is_late = model.parts[index].tap(name).late
        for source in link.sources if link and not is_late else ():
            upstream[index] |= {source.part, *upstream[source.part]}
    for index, name in inputs:
        signal = model.parts[index].tap(name).signal
        part = model.parts[index].path
        signal_link = model.links.get(signal)
        later = source_of(model.parts[index + 1 :], signal)
        after = -1
        if signal_link:
            after = signal_link.after
        elif later:
            after = index + 1 + later.part
        own = [model.parts[index].full(each) for each in model.parts[index].signal_names]
        passed_on = signal in own and packaged(model.parts[after])
        if after < index or passed_on or model.link_of(index, name) is not None:
            continue
        giver = model.parts[after].path
        instead = f"put {giver} before {part}"
        if index in {after, *upstream[after]}:
            instead = f"a loop takes a signal a sample late, late('{signal}'), or is one model"
        yield (
            f"Model {model.name}: {part} needs '{signal}', which is known only after {giver}: "
            f"{instead}."
        )
