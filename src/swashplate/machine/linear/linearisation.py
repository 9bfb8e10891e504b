"""The step of any model, linearised: matrices from the derivatives of its equations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError, InputError
from swashplate.machine import Machine
from swashplate.machine.fields import check_mapping, floats_of, is_real, value_at
from swashplate.machine.linear.model import LinearModel
from swashplate.machine.linear.settling import settle, settles_by_equation
from swashplate.machine.marching import (
    CodeForm,
    InitialStates,
    called,
    check_rate,
    output_of,
    outside,
    step_derivatives,
    taps_of,
)
from swashplate.machine.model import state_paths

Array = NDArray[np.float64]


def linearize(
    instance: Machine,
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
    instance : Machine
        The model with its numbers, see `swashplate.machine.Machine`.
    at : mapping of str to float
        Constant external signals of the operating point.
    rate : float or None
        Steps a second of a sampled model. None if the model is in continuous time: its step then
        returns the rates of its states, and its taps have no delay. [Hz]
    states : sequence, optional
        State of each part; by default the one that the model settles at, see `settle`. In
        continuous time they must be given.
    inputs : sequence of str, optional
        External signals that move, of `at`; by default all of them.
    outputs : sequence of str, optional
        Signals of parts, their states, or links; by default the model's own choice.

    Returns
    -------
    LinearModel
        Whole samples by which all that is read of the first input is late are its `delay`; other
        past samples that the model's taps read, those of signals between parts among them, are
        states, `memory`.

    Raises
    ------
    InputError
        If a signal is unknown, or the equations are unstable at the rate.
    DomainError
        If the point lies outside the model's domain, or nothing settles.

    Examples
    --------
    >>> from swashplate import FullOrderDrive, linearize
    >>> machine = FullOrderDrive.preset("hoist").by_current
    >>> linearize(machine, {"current": 0.5}, 512.0)
    LinearModel('hoist', current to shaft_speed, sampled at 512 Hz)
    """
    if not isinstance(instance, Machine):
        raise InputError(
            f"{instance!r} is not a model with numbers: give swashplate.machine.Machine(model, p)."
        )
    _check_point(instance, at, rate)
    moving = tuple(at if inputs is None else inputs)
    if not moving:
        raise InputError(
            f"{instance.name}: a linear model needs at least one varying input, named in at."
        )
    for name in moving:
        if name not in at or name not in instance.model.external:
            raise InputError(
                f"{instance.name}: '{name}' is not an input at the operating point; there are "
                f"{', '.join(signal for signal in instance.model.external if signal in at)}."
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
    if states is None:
        if rate is None:
            raise InputError(
                f"{instance.name}: a model in continuous time is linearised at given states; give "
                "states=[...], one of each part."
            )
        states = _settled_states(instance, at, rate)
    if rate is not None:
        instance.check_step(h)
    initial = instance.start(at, h, "steady", states)
    last = model.parts[-1]
    usual = tuple(model.outputs) or tuple(map(last.full, last.outputs))
    usual = tuple(signal for signal in usual if signal not in model.integrals)
    requested = tuple(outputs) if outputs is not None else usual or model.last_signals
    if not requested:
        raise InputError(f"{instance.name}: a linear model needs an output.")
    return _linear_model(instance, initial, rate, moving, requested)


def _check_point(instance: Machine, at: Mapping[str, float], rate: float | None) -> None:
    """Refuse a rate out of range, and constant signals that are not finite numbers."""
    if rate is not None:
        check_rate(rate)
    check_mapping("at", at)
    for name, value in at.items():
        if not is_real(value) or not np.isfinite(value):
            raise InputError(f"{instance.name}: {name} is {value!r}, but must be a finite number.")


def _settled_states(instance: Machine, at: Mapping[str, float], rate: float) -> Sequence[Any]:
    """State of each part that the machine settles at; by its equations, one sample later."""
    if not settles_by_equation(instance):
        return settle(instance, at, rate).states
    # what belongs to the first sample alone has passed
    arguments = instance.start(at, 1.0 / rate, "steady").arguments
    return [
        called(part, part.step, arguments_of_part)
        for part, arguments_of_part in zip(instance.model.parts, arguments, strict=True)
    ]


def _are(states: Any, kinds: Sequence[Any]) -> bool:
    """Whether these are states of these types, all of finite numbers."""
    if not isinstance(states, list | tuple) or len(states) != len(kinds):
        return False
    if not all(map(isinstance, states, kinds)):
        return False
    values = [value_at(state, path) for state in states for path in floats_of(type(state))]
    return all(is_real(value) and np.isfinite(value) for value in values)


def _linear_model(
    instance: Machine,
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
    h = 0.0 if rate is None else 1.0 / rate
    _check_domain(instance, initial)
    for name in outputs:
        if name in model.integrals:
            raise InputError(
                f"{instance.name}: '{name}' is an integral of a signal, which a linear model does "
                f"not have; use '{model.integrals[name]}'."
            )
    states = state_paths(model)
    n = len(states)
    step = _step_slopes(instance, initial, h, inputs, outputs)
    slopes, last = step.slopes, n + len(outputs)
    of_states, of_outputs, of_between = slopes[:n], slopes[n:last], slopes[last:]
    column_of = {
        sample: column for column, sample in enumerate(step.samples, n) if slopes[:, column].any()
    }
    ages = {
        name: [s.age for s in column_of if s.input == name and not s.between] or [0]
        for name in inputs
    }
    first = {name: min(ages[name]) if name == inputs[0] else 0 for name in inputs}
    past = [
        InputSample(name, age)
        for name in inputs
        for age in range(first[name] + 1, max(ages[name]) + 1)
    ]
    for name in step.between:
        most = max([s.age for s in column_of if s.input == name and s.between], default=0)
        past += [InputSample(name, age + 1, between=True) for age in range(most)]
    present = [InputSample(name, age) for name, age in first.items()]
    # rows: the model's states, then the past samples; columns: these and the present inputs
    size = n + len(past)
    at = {sample: column for column, sample in enumerate((*past, *present), n)}
    A = np.zeros((size, size + len(inputs)))
    C = np.zeros((len(outputs), size + len(inputs)))
    A[:n, :n] = of_states[:, :n]
    C[:, :n] = of_outputs[:, :n]
    for sample, column in column_of.items():
        A[:n, at[sample]] = of_states[:, column]
        C[:, at[sample]] = of_outputs[:, column]
    for sample in past:
        newer = sample._replace(age=sample.age - 1)
        if newer in at:
            A[at[sample], at[newer]] = 1.0
            continue
        now = of_between[step.between.index(sample.input)]
        A[at[sample], :n] = now[:n]
        for other, column in column_of.items():
            A[at[sample], at[other]] = now[column]
    memory = tuple(f"{sample.input}_{sample.age}" for sample in past)
    definitions = model.definitions
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
        units={name: definitions[name].unit for name in (*inputs, *outputs) if name in definitions},
        at=dict(initial.before),
    )


def _check_domain(instance: Machine, initial: InitialStates) -> None:
    """Refuse an operating point outside the domain of one of the model's parts."""
    for part, arguments in zip(instance.model.parts, initial.arguments, strict=True):
        if part.domain is None:
            continue
        margin = called(part, part.domain, arguments)
        if not margin > 0.0:
            sentence = outside(instance.model, margin, "operating point")
            raise DomainError(f"{instance.name}: {sentence}")


class InputSample(NamedTuple):
    """A sample of an input, or of a signal between parts, that a step reads."""

    input: str
    age: int
    """Samples by which it is older than the present one."""
    between: bool = False
    """Whether it is one of a signal between parts."""


class StepSlopes(NamedTuple):
    """Derivatives of a step."""

    samples: list[InputSample]
    """That the step reads of inputs and of signals between parts; of these none as it is now."""
    slopes: Array
    """Rows are the model's states after the step, then the outputs, then signals between parts;
    columns the states before it, then the samples."""
    between: tuple[str, ...]
    """Signals between parts of which taps read past samples."""


def _step_slopes(
    instance: Machine,
    initial: InitialStates,
    h: float,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
) -> StepSlopes:
    """Derivatives of a step of length h [s] at the states that a march would start with."""
    model = instance.model
    signals = tuple(initial.before)
    stored_outputs = tuple(output_of(model, name)[0] for name in outputs)
    arguments, program, between = step_derivatives(
        model, CodeForm(signals, instance.options), stored_outputs
    )
    delays = instance.tap_delays(signals, h)
    values = []
    for stored in arguments.values():
        if stored.kind == "fraction":
            values.append(float(delays.fraction[int(stored.path)]))
        elif stored.kind == "state":
            values.append(float(value_at(initial.states[stored.part], stored.path)))
        else:
            values.append(instance.number_at(stored, {**initial.before, **initial.between}, h))
    delay_samples = {
        (tap.part, tap.input): int(delays.samples[tap.number]) for tap in taps_of(model, signals)
    }
    varied: list[str | InputSample] = []  # of each derivative the state, or the sample of an input
    for i, kind, path in map(arguments.__getitem__, program.by):
        if kind == "state":
            varied.append(f"{model.prefix(i)}{path}")
            continue
        name, _, sample = path.partition(".")
        age = delay_samples[i, name] + int(sample) if kind == "tap" else 0
        linked = model.link_of(i, name) is not None
        varied.append(InputSample(model.parts[i].tap(name).signal, age, linked))
    states = state_paths(model)
    order = (*inputs, *between)
    samples = sorted(
        {
            source
            for source in varied
            if isinstance(source, InputSample) and (source.between or source.input in inputs)
        },
        key=lambda sample: (sample.between, order.index(sample.input), sample.age),
    )
    column_of = {source: column for column, source in enumerate([*states, *samples])}
    slopes = np.zeros((len(states) + len(outputs) + len(between), len(column_of)))
    for source, by_one in zip(varied, program.slopes(values).T, strict=True):
        column = column_of.get(source)
        if column is not None:
            slopes[:, column] += by_one
    for number, name in reversed([*enumerate(between)]):  # each follows those before it
        column = column_of.get(InputSample(name, 0, between=True))
        if column is not None:
            by_now = slopes[:, column].copy()
            slopes[:, column] = 0.0
            slopes += np.outer(by_now, slopes[len(states) + len(outputs) + number])
    return StepSlopes(samples, slopes, between)
