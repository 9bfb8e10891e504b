"""The step of any model, linearised: matrices from the derivatives of its equations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from swashplate.equations.fields import check_mapping, floats_of, is_real, value_at
from swashplate.equations.marching.march import output_of
from swashplate.equations.marching.one_step import step_derivatives
from swashplate.equations.marching.part_code import taps_of
from swashplate.equations.marching.record import check_rate
from swashplate.equations.marching.run import InitialStates, Instance, called, outside
from swashplate.equations.model import state_paths
from swashplate.errors import DomainError, InputError
from swashplate.linear.model import LinearModel


def linearize(
    instance: Instance,
    at: Mapping[str, float],
    rate: float | None,
    *,
    states: Sequence[Any] | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> LinearModel:
    """Linear model of the step of any model with numbers.

    Parameters
    ----------
    instance : Instance
        The model with its numbers, see `swashplate.equations.instance_of`.
    at : mapping of str to float
        Constant external signals of the operating point.
    rate : float or None
        Steps a second of a sampled model. None if the model is in continuous time: its step then
        returns the rates of its states, and its taps have no delay. [Hz]
    states : sequence, optional
        State of each part; by default the one that the model settles at, one sample after the
        start. In continuous time they must be given.
    inputs : sequence of str, optional
        External signals that move, of `at`; by default all of them.
    outputs : sequence of str, optional
        Signals of parts, their states, or links; by default the model's own choice.

    Returns
    -------
    LinearModel
        Whole samples by which all that is read of the first input is late are its `delay`; other
        past samples that the model's taps read are states, `memory`.

    Raises
    ------
    InputError
        If a signal is unknown, or the model cannot settle by itself.
    DomainError
        If the point lies outside the model's domain.

    Examples
    --------
    >>> from swashplate import FullOrderDrive, linear
    >>> machine = FullOrderDrive.preset("hoist").instance(1.0 / 512.0, card=False)
    >>> linear.linearize(machine, {"current": 0.5}, 512.0)
    LinearModel('hoist', current to shaft_speed, sampled at 512 Hz)
    """
    if not isinstance(instance, Instance):
        raise InputError(
            f"{instance!r} is not a model with numbers: give "
            "swashplate.equations.instance_of(model, p)."
        )
    if rate is not None:
        check_rate(rate)
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
                f"{instance.name}: '{name}' is not an input at the operating point; there are "
                f"{', '.join(each for each in instance.model.external if each in at)}."
            )
    model = instance.model
    h = 0.0 if rate is None else 1.0 / rate
    if rate is None and any(part.taps for part in model.parts):
        raise InputError(
            f"{instance.name}: {model.name} reads past samples of its inputs, so it is not a model "
            "in continuous time; give the rate of its steps."
        )
    kinds = [part.state for part in model.parts]
    if states is not None and not _are(states, kinds):
        raise InputError(
            f"{instance.name}: states are {states!r}, but must be a tuple of one "
            f"{' and one '.join(kind.__name__ for kind in kinds)} of finite numbers."
        )
    if states is None and rate is None:
        raise InputError(
            f"{instance.name}: a model in continuous time is linearised at given states; give "
            "states=[...], one of each part."
        )
    if states is None:
        for part in model.parts:
            if part.settled is None and floats_of(part.state):
                each_state = ", ".join(f"{kind.__name__}(...)" for kind in kinds)
                raise InputError(
                    f"{instance.name}: {part.name} has no equation for its steady state "
                    "('settled'); give the states of the operating point: "
                    f"states=[{each_state}]."
                )
        # what belongs to the first sample alone has passed
        known = instance.start(at, h, "steady").arguments
        states = [
            called(part, part.step, each) for part, each in zip(model.parts, known, strict=True)
        ]
    initial = instance.start(at, h, "steady", states)
    named = tuple(model.outputs) or tuple(model.parts[-1].outputs)
    named = tuple(each for each in named if each not in model.integrals)
    requested = tuple(outputs) if outputs is not None else named or model.parts[-1].signal_names
    if not requested:
        raise InputError(f"{instance.name}: a linear model needs an output.")
    return _linear_model(instance, initial, rate, moving, requested)


def _are(states: Any, kinds: Sequence[Any]) -> bool:
    """Whether these are states of these types, all of finite numbers."""
    if not isinstance(states, list | tuple) or len(states) != len(kinds):
        return False
    if not all(map(isinstance, states, kinds)):
        return False
    values = [value_at(each, path) for each in states for path in floats_of(type(each))]
    return all(is_real(value) and np.isfinite(value) for value in values)


def _linear_model(
    instance: Instance,
    initial: InitialStates,
    rate: float | None,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
) -> LinearModel:
    """A model's step, linearised at the states and constant inputs that a march would start with.

    States are the paths of the model's own ones, then the past samples of the inputs that its taps
    read, the memory. The delay is in whole samples: those by which all that is read of the first
    input is late.
    """
    model = instance.model
    signals = tuple(initial.before)
    h = 0.0 if rate is None else 1.0 / rate
    for part, known in zip(model.parts, initial.arguments, strict=True):
        if part.domain is None:
            continue
        margin = called(part, part.domain, known)
        if not margin > 0.0:
            raise DomainError(f"{instance.name}: {outside(model, margin, 'operating point')}")
    for name in outputs:
        if name in model.integrals:
            raise InputError(
                f"{instance.name}: '{name}' is an integral of a signal, which a linear model does "
                f"not have; ask for '{model.integrals[name]}'."
            )
    seen = tuple(output_of(model, name)[0] for name in outputs)
    arguments, derived = step_derivatives(model, signals, instance.options, seen)
    delays = instance.tap_delays(signals, h)
    states = state_paths(model)
    n = len(states)
    values = []
    for stored in arguments.values():
        if stored.kind == "fraction":
            values.append(float(delays.fraction[int(stored.path)]))
        elif stored.kind == "state":
            values.append(float(value_at(initial.states[stored.part], stored.path)))
        else:
            values.append(instance.number_at(stored, initial.before, h))
    delay_samples = {
        (tap.part, tap.input): int(delays.samples[tap.number]) for tap in taps_of(model, signals)
    }
    moved: list[Any] = []  # of each derivative the state, or the input and its age in samples
    for i, kind, path in map(arguments.__getitem__, derived.inputs):
        name, _, sample = path.partition(".")
        late = delay_samples[i, name] + int(sample) if kind == "tap" else 0
        signal = model.parts[i].tap(name).signal
        moved.append(f"{model.prefix(i)}{path}" if kind == "state" else (signal, late))
    ages = {each for each in moved if isinstance(each, tuple) and each[0] in inputs}
    columns = sorted(ages, key=lambda each: (inputs.index(each[0]), each[1]))
    column = {each: k for k, each in enumerate([*states, *columns])}
    slopes = np.zeros((n + len(outputs), n + len(columns)))
    results = derived.python(*values)
    for (row, k), slope in zip(derived.entries, results[len(slopes) :], strict=True):
        if moved[k] in column:
            slopes[row, column[moved[k]]] += slope
    into = slopes[:n]
    out = slopes[n:]
    read = [(*each, k) for k, each in enumerate(columns, n) if slopes[:, k].any()]
    lags = {name: [lag for of, lag, _ in read if of == name] or [0] for name in inputs}
    first = {name: min(lags[name]) if name == inputs[0] else 0 for name in inputs}
    past = [(name, lag) for name in inputs for lag in range(first[name] + 1, max(lags[name]) + 1)]
    # rows: the model's states, then the past samples; columns: these and the present inputs
    size = n + len(past)
    at = {each: k for k, each in enumerate((*past, *first.items()), n)}
    A, C = np.zeros((size, size + len(inputs))), np.zeros((len(out), size + len(inputs)))
    A[:n, :n] = into[:, :n]
    C[:, :n] = out[:, :n]
    for name, lag, k in read:
        A[:n, at[name, lag]] = into[:, k]
        C[:, at[name, lag]] = out[:, k]
    for name, lag in past:
        A[at[name, lag], at[name, lag - 1]] = 1.0
    memory = tuple(f"{name}_{lag}" for name, lag in past)
    known = model.definitions
    return LinearModel(
        name=instance.name,
        A=A[:, :size],
        B=A[:, size:],
        C=C[:, :size],
        D=C[:, size:],
        states=(*states, *memory),
        inputs=inputs,
        outputs=outputs,
        delay=first[inputs[0]] * h,
        rate=rate,
        memory=memory,
        units={name: known[name].unit for name in (*inputs, *outputs) if name in known},
    )
