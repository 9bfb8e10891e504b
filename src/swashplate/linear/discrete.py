"""The discrete step of any model, linearised: matrices from the derivatives of its equations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.derivatives import derive
from swashplate.equations.fields import check_mapping, floats_of, is_real, value_at
from swashplate.equations.marching.part import HOLDS, taps_of
from swashplate.equations.marching.record import check_rate
from swashplate.equations.marching.run import Instance, Started, called, outside
from swashplate.equations.model import Link, Window, arguments_of, state_paths
from swashplate.errors import DomainError, InputError
from swashplate.linear.model import LinearModel, Matrices

Array = NDArray[np.float64]
Rows = dict[str, Array]
"""Derivatives of numbers by all that moves, by the numbers' paths."""


def linearize(
    instance: Instance,
    at: Mapping[str, float],
    h: float,
    *,
    states: Sequence[Any] | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> LinearModel:
    """Linear model of the discrete step of any model with numbers.

    Parameters
    ----------
    instance, h : Instance, float
        The model with its numbers, and its step. [s]
    at : mapping of str to float
        Constant external signals of the operating point.
    states : sequence, optional
        State of each part; by default the one that the model settles at, one sample after the
        start.
    inputs : sequence of str, optional
        External signals that move, of `at`; by default all of them.
    outputs : sequence of str, optional
        Signals of parts, their states, or links; by default the model's own choice.

    Returns
    -------
    LinearModel
        Sampled. Whole samples by which all that is read of the first input is late are its `delay`;
        other past samples that the model's taps read are states, `memory`.

    Raises
    ------
    InputError
        If a signal is unknown, or the model cannot settle by itself.
    DomainError
        If the point lies outside the model's domain.
    """
    if not isinstance(instance, Instance):
        raise InputError(
            f"{instance!r} is no model with numbers: give swashplate.equations.instance_of(model, "
            "p)."
        )
    check_rate(h, "step", "s")
    check_mapping("at", at)
    for name, value in at.items():
        if not is_real(value) or not np.isfinite(value):
            raise InputError(f"{instance.name}: {name} is {value!r}, but must be a finite number.")
    moving = tuple(at if inputs is None else inputs)
    if not moving:
        raise InputError(f"{instance.name}: a linear model needs an input that moves, of at.")
    for name in moving:
        if name not in at or name not in instance.model.external:
            raise InputError(
                f"{instance.name}: '{name}' is no input at the operating point; there are "
                f"{', '.join(each for each in instance.model.external if each in at)}."
            )
    model = instance.model
    kinds = [part.state for part in model.parts]
    if states is not None and not _are(states, kinds):
        raise InputError(
            f"{instance.name}: states are {states!r}, but must be a tuple of one "
            f"{' and one '.join(kind.__name__ for kind in kinds)} of finite numbers."
        )
    if states is None:
        # what belongs to the first sample alone has passed
        known = instance.start(at, h, "steady").arguments
        states = [called(part.step, each) for part, each in zip(model.parts, known, strict=True)]
    started = instance.start(at, h, "steady", states)
    named = tuple(model.outputs) or tuple(model.parts[-1].outputs)
    named = tuple(each for each in named if each not in model.integrals)
    wanted = (named or model.parts[-1].signal_names) if outputs is None else tuple(outputs)
    if not wanted:
        raise InputError(f"{instance.name}: a linear model needs an output.")
    matrices, names, memory, whole = recurrence(instance, started, h, moving, wanted)
    return LinearModel(*matrices, names, moving, wanted, whole * h, h, instance.name, memory)


def _are(states: Any, kinds: Sequence[Any]) -> bool:
    """Whether these are states of these types, all of finite numbers."""
    if not isinstance(states, list | tuple) or len(states) != len(kinds):
        return False
    if not all(map(isinstance, states, kinds)):
        return False
    values = [value_at(each, path) for each in states for path in floats_of(type(each))]
    return all(is_real(value) and np.isfinite(value) for value in values)


def recurrence(
    instance: Instance,
    started: Started,
    h: float,
    inputs: tuple[str, ...],
    outputs: Sequence[str],
) -> tuple[Matrices, tuple[str, ...], tuple[str, ...], int]:
    """Matrices of a model's step at a point, its states, its memory, and the first input's delay.

    The point is given by the states and constant inputs that a march would start with. Behind the
    paths of the model's own states stand the past samples of the inputs that its taps read, the
    memory. The delay is in whole samples: those by which all that is read of the first input is
    late.
    """
    model, places = instance.model, instance.places(inputs, h)
    states = state_paths(model)
    taps = {(each.part, each.input): each for each in taps_of(model, inputs)}
    late = {(name, 0) for name in inputs}
    for tap in taps.values():
        whole = int(places.whole[tap.number])
        late |= {(tap.tap.signal, whole + j) for j in range(tap.tap.samples)}
    columns = sorted(late, key=lambda each: (inputs.index(each[0]), each[1]))
    n = len(states)
    units: dict[Any, Array] = dict(zip([*states, *columns], np.eye(n + len(columns)), strict=True))
    none = np.zeros(n + len(columns))
    parts: list[Rows] = []  # of each part: signals and states

    def link_row(link: Link) -> Array:
        values, rows = [], []
        for part, signal in link.sources:
            kind = "signals" if f"signals.{signal}" in parts[part] else "state"
            rows.append(parts[part].get(f"{kind}.{signal}", none))
            values.append(value_at(started.arguments[part][kind], signal))
        if link.equation is None:
            return rows[0]
        names = arguments_of(link.equation)
        known = dict(zip(names, values, strict=True))
        return _through(link.equation, known, dict(zip(names, rows, strict=True)))["value"]

    def input_rows(i: int, name: str, known: dict[str, Any]) -> Rows:
        """Rows of what a part takes, its windows read where the taps are."""
        part, tap = model.parts[i], taps.get((i, name))
        if (link := model.link_of(i, name)) is not None:
            return {name: link_row(link)}
        if tap is None:
            still = part.input_types[name] is Window
            return {} if still else {name: units.get((part.tap(name).signal, 0), none)}
        signal, first = tap.tap.signal, int(places.whole[tap.number])
        fraction = float(places.fraction[tap.number])
        read = [units[signal, first + j] for j in range(tap.tap.samples)]
        if part.input_types[name] is Window:
            known[name] = known[name]._replace(f=fraction)
            return {f"{name}.s.{j}": row for j, row in enumerate(read)}
        window = Window((started.before[signal],) * len(read), fraction)
        rows = {f"window.s.{j}": row for j, row in enumerate(read)}
        held = _through(HOLDS[tap.tap.hold], {"window": window}, rows, {"window.s": len(read)})
        return {name: held["value"]}

    following = []
    for i, part in enumerate(model.parts):
        known = dict(started.arguments[i])
        rows = {
            f"state.{path}": units[f"{model.prefix(i)}{path}"] for path in floats_of(part.state)
        }
        lengths: dict[str, int] = {}
        for name in part.input_types:
            taken = input_rows(i, name, known)
            rows |= taken | {f"inputs.{path}": row for path, row in taken.items()}
            if part.tap(name).width:
                lengths |= dict.fromkeys((f"{name}.s", f"inputs.{name}.s"), part.tap(name).width)
        if part.inputs is not None:
            known["inputs"] = part.inputs(*(known[name] for name in part.input_types))
        if part.sample is not None:
            signals = _through(part.sample, known, rows, lengths)
            rows |= {f"signals.{path}": row for path, row in signals.items()}
        if part.domain is not None and not (margin := called(part.domain, known)) > 0.0:
            raise DomainError(f"{instance.name}: {outside(model, margin, 'operating point')}")
        parts.append(rows)
        found = _through(part.step, known, rows, lengths)
        following += [found.get(path, none) for path in floats_of(part.state)]

    def output_row(name: str) -> Array:
        for part, rows in zip(reversed(model.parts), reversed(parts), strict=True):
            if name in part.signal_names:
                return rows.get(f"signals.{name}", rows.get(f"state.{name}", none))
        if name in model.links:
            return link_row(model.links[name])
        if name in model.integrals:
            raise InputError(
                f"{instance.name}: '{name}' is an integral of a signal, which a linear model does "
                f"not have; ask for '{model.integrals[name]}'."
            )
        there = dict.fromkeys(each for part in model.parts for each in part.signal_names)
        raise InputError(
            f"{instance.name}: there is no signal '{name}'; there are "
            f"{', '.join((*there, *model.links))}."
        )

    into, out = np.array(following).reshape(n, none.size), np.array(list(map(output_row, outputs)))
    read = [(*each, k) for k, each in enumerate(columns, n) if into[:, k].any() or out[:, k].any()]
    lags = {name: [lag for of, lag, _ in read if of == name] or [0] for name in inputs}
    first = {name: min(lags[name]) if name == inputs[0] else 0 for name in inputs}
    past = [(name, lag) for name in inputs for lag in range(first[name] + 1, max(lags[name]) + 1)]
    # rows: the model's states, then the past samples; columns: these and the present inputs
    size = n + len(past)
    at = {each: k for k, each in enumerate((*past, *first.items()), n)}
    A, C = np.zeros((size, size + len(inputs))), np.zeros((len(out), size + len(inputs)))
    A[:n, :n], C[:, :n] = into[:, :n], out[:, :n]
    for name, lag, k in read:
        A[:n, at[name, lag]], C[:, at[name, lag]] = into[:, k], out[:, k]
    for name, lag in past:
        A[at[name, lag], at[name, lag - 1]] = 1.0
    matrices = A[:, :size], A[:, size:], C[:, :size], C[:, size:]
    memory = tuple(f"{name}_{lag}" for name, lag in past)
    return matrices, (*states, *memory), memory, first[inputs[0]]


def _through(
    equation: Any, known: Mapping[str, Any], rows: Rows, lengths: Mapping[str, int] | None = None
) -> Rows:
    """Rows of an equation's results, from what is known by its arguments' names and their rows."""
    taken = arguments_of(equation)
    moving = {path.partition(".")[0] for path in rows}
    by = tuple(name for name in taken if name in moving)
    if not by:
        return {}
    options = {"options": known["options"]} if "options" in taken else {}
    derived = derive(equation, by=by, options=options, lengths=lengths)
    values = derived.python(*(known[name] for name in taken))
    slopes = np.zeros((len(derived.outputs), len(derived.inputs)))
    if derived.entries:
        slopes[tuple(np.transpose(derived.entries))] = values[len(derived.outputs) :]
    # constants and the places of windows do not move
    still = np.zeros(next(iter(rows.values())).size)
    into = np.array([rows.get(path, still) for path in derived.inputs])
    return dict(zip(derived.outputs, slopes @ into, strict=True))
