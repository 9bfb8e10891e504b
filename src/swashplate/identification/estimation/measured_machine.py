"""Machines as experiments drive and measure them, which is how a fit simulates them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import isfinite
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import Channel, Experiment
from swashplate.errors import DomainError, InputError, ParameterError, UnknownParameterError, meant
from swashplate.identification.estimation.model import EquationModel, SimulationRequest
from swashplate.machine import BlackBox, Machine, Ports
from swashplate.machine import Model as Equations
from swashplate.machine.fields import check_mapping, is_real, tuple_from
from swashplate.machine.marching import (
    BoundModel,
    Record,
    RunValues,
    even_rate,
    on_grid,
    started_by,
    substeps_of,
)
from swashplate.machine.model import full_name, parameter_paths, state_paths
from swashplate.results import Result

Array = NDArray[np.float64]
T = TypeVar("T", bound=Machine)
NOTHING: Mapping[str, Any] = MappingProxyType({})


class InputsOfRun(NamedTuple):
    """Inputs of a machine in an experiment."""

    driven: str
    """The one that the experiment's input is; of an experiment without an input one that stays."""
    others: Mapping[str, Channel]
    """Channels that others are, by the inputs' names."""
    constants: Mapping[str, float]
    """What those stay at that are neither."""


@dataclass(frozen=True, eq=False)
class MeasuredMachine(Result, ABC):
    """A machine in experiments: what both kinds of it have in common, see `measured`.

    A channel is compared with the signal of its name. Of the machine's inputs those that are
    channels of an experiment are taken from there; the one that is left is the experiment's input.
    Where names are paths, the last word is enough if it is unique.
    """

    ports: Ports
    numbers: Mapping[str, float]
    """Its parameters, which hold unless a fit says otherwise; none of a model without numbers."""
    rate: float | None
    """Samples a second; by default the input's. [Hz]"""
    inputs: Mapping[str, float]
    """What an input stays at in runs without a channel of it."""

    @property
    @abstractmethod
    def equations(self) -> Equations | None:
        """The model of its equations; None of a black box."""

    @abstractmethod
    def starts(self, name: str) -> bool:
        """Whether a name is a number of where a run begins, which each run has for itself."""

    def states_of(self, name: str) -> list[str]:
        """Paths of the states that such a name sets; none of a black box, whose number it is."""
        return [] if self.equations is None else states_started_by(self.equations, name)

    @property
    @abstractmethod
    def name(self) -> str:
        """Of the machine's numbers, or of the model without numbers."""

    @property
    def threads_help(self) -> bool:
        """Whether it releases the interpreter's lock while it simulates."""
        return False

    @property
    def origin(self) -> str:
        """All that its samples depend on besides its numbers, for a fingerprint."""
        return f"{self!r} {self.rate}"

    @property
    def signals(self) -> list[str]:
        """Names of the signals that it gives."""
        return [*self.ports.every_signal, *self.ports.integrals]

    def takes(self, channel: str) -> bool:
        """Whether a channel of this name is an input of it, or says where a state begins."""
        return full_name(channel, self.ports.external) in self.ports.external

    def signals_of(self, experiment: Experiment) -> Mapping[str, str]:
        """Signal of the machine for each channel that it gives; one of none is refused."""
        signals = self.signals
        full = {name: full_name(name, signals) for name in experiment.channels}
        signal_of = {name: signal for name, signal in full.items() if signal in signals}
        if not signal_of:
            raise InputError(
                f"{experiment.name} has the channels {', '.join(experiment.channels)}, of which "
                f"{self.ports.name} gives none; it gives {', '.join(signals)}."
            )
        return signal_of

    def inputs_of(self, experiment: Experiment) -> InputsOfRun:
        """Which input the experiment's is, and where the others come from; refused if unclear."""
        ports = self.ports
        full = {full_name(name, ports.external): each for name, each in experiment.channels.items()}
        others = {name: full[name] for name in ports.external if name in full}
        constants = {name: value for name, value in self.inputs.items() if name not in others}
        inputs = [name for name in ports.external if name not in full | constants]
        inputs = [name for name in inputs if name not in ports.input_parameters] or inputs
        if not inputs and constants and experiment.input.kind == "none":
            return InputsOfRun(next(iter(constants)), others, constants)
        if len(inputs) != 1 or experiment.input.kind == "none":
            raise InputError(
                f"{ports.name} needs the signals {', '.join(ports.external)}; {experiment.name} "
                f"has {'no' if experiment.input.kind == 'none' else 'one'} input, for one of them, "
                f"and the channels {', '.join(experiment.channels)}; inputs = {{NAME: VALUE}} "
                "beside the machine states those that stay at a value."
            )
        return InputsOfRun(inputs[0], others, constants)

    def record_of(
        self, experiment: Experiment, driven: str, rate: float, substeps: int | None = None
    ) -> Record:
        """The experiment's input on a grid."""
        command = experiment.input
        record = on_grid(
            {driven: command.values},
            rate,
            time=None if rate == even_rate(command.time) else command.time,
            interpolation="previous" if command.is_held else "linear",
            substeps=substeps,
        )[driven]
        return replace(record, start=float(command.time[0]))


@dataclass(frozen=True, eq=False)
class MeasuredEquations(MeasuredMachine, EquationModel):
    """A machine of equations in experiments, or a model whose numbers are all a fit's own.

    ``"start.PATH"`` is a number of the state at the first sample, by its path or as `free_start` of
    the model has it.
    """

    model: Equations
    machine: Machine | None
    """The model with numbers, options and givens, which hold in all runs."""
    substeps: int | None
    """Steps of the model a sample; by default one."""
    begin: Mapping[str, str]
    """Channel that says where a number of the state begins, by its path: at the first sample that
    counts."""
    given: Any
    """The model's givens in all runs, or a mapping of them by the experiments' names."""

    @property
    def name(self) -> str:
        """See `MeasuredMachine`."""
        return self.model.name if self.machine is None else self.machine.name

    @property
    def threads_help(self) -> bool:
        """True: a march releases the lock."""
        return True

    @property
    def origin(self) -> str:
        """See `MeasuredMachine`."""
        machine = self.machine
        kept = (machine.options, machine.given.tolist()) if machine is not None else ()
        how = (self.rate, self.substeps, sorted(self.begin.items()), self.given, kept)
        return f"{self.model!r} {how}"

    def starts(self, name: str) -> bool:
        """Whether a name sets states at the first sample."""
        return bool(self.states_of(name))

    @property
    def equations(self) -> Equations:
        """The model of its equations."""
        return self.model

    def takes(self, channel: str) -> bool:
        """See `MeasuredMachine`."""
        return super().takes(channel) or channel in self.begin.values()

    def driven(
        self, experiment: Experiment, values: Mapping[str, float] = NOTHING
    ) -> tuple[str, Record, Mapping[str, Array]]:
        """The experiment's input on the grid, and inputs that are channels.

        Refused if stamps are uneven and no rate is given.
        """
        del values
        driven, others, constants = self.inputs_of(experiment)
        rate = self.rate or even_rate(experiment.input.time)
        if rate is None:
            raise InputError(
                f"{experiment.name}: the stamps of its input are not even, so {self.ports.name} "
                "needs a rate: rate = 100.0 in its file, or ModelSetup(..., rate=100.0)."
            )
        substeps = substeps_of(self.model, rate, self.substeps)
        record = self.record_of(experiment, driven, rate, substeps)
        external = {name: each.at(record.points) for name, each in others.items()}
        for name, value in constants.items():
            external[name] = np.full(record.points.size, value)
        if driven in external:
            record = replace(record, values=external.pop(driven))
        return driven, record, external

    def ready(
        self, values: Mapping[str, float], experiment: Experiment, request: SimulationRequest
    ) -> BoundModel:
        """The model with numbers; a name that is not known, or no value of one, is refused."""
        model = self.model
        paths, states, begin = self.ports.parameter_definitions, state_paths(model), {}
        for path, channel in self.begin.items():
            measured = experiment[channel]
            begin[path] = float(measured.values[int(np.argmax(measured.used))])
        for name, value in values.items():
            started = self.states_of(name)
            begin |= dict.fromkeys(started, value)
            if name not in paths and not started:
                parameters = ", ".join(parameter_paths(model))
                raise InputError(f"{model.name} has no parameter '{name}'; it has {parameters}.")
        for path in begin:
            if path not in states:
                raise InputError(
                    f"{model.name} has no state '{path}' to begin at; it has {', '.join(states)}."
                )
        of_model = {name: value for name, value in values.items() if name in paths}
        machine = self._machine(of_model, self._given_of(experiment))
        return BoundModel(machine, RunValues(begin, request.offsets), request.columns)

    def _given_of(self, experiment: Experiment) -> Any:
        if not isinstance(self.given, Mapping):
            return self.given
        if experiment.name not in self.given:
            raise InputError(f"{self.model.name} has no given numbers for {experiment.name}.")
        return self.given[experiment.name]

    def _machine(self, values: Mapping[str, float], given: Any) -> Machine:
        """The model with these numbers, by path."""
        if self.machine is not None:
            machine = self.machine if given is None else self.machine.with_given(given)
            return _replaced(machine, self.numbers, values)
        try:
            p = tuple_from(self.model.parameters, values)
        except KeyError as error:
            raise InputError(
                f"{self.model.name} has no value of {error.args[0]}: let it be free, or fix it."
            ) from None
        return Machine(self.model, p, given=given)


@dataclass(frozen=True, eq=False)
class MeasuredBlackBox(MeasuredMachine):
    """A black box in experiments, which is differentiated by central differences.

    Its program gets the stamps of the experiment's input, or with a rate an even grid.
    """

    machine: BlackBox

    @property
    def name(self) -> str:
        """See `MeasuredMachine`."""
        return self.machine.name

    @property
    def equations(self) -> None:
        """None."""

    @property
    def origin(self) -> str:
        """See `MeasuredMachine`."""
        function = self.machine.function
        named = (getattr(function, word, "") for word in ("__module__", "__qualname__"))
        return f"{self.ports!r} {self.rate} {'.'.join(named)}"

    def starts(self, name: str) -> bool:
        """Whether a number of it is called as where a run begins."""
        return name.startswith("start.") and name in self.numbers

    def simulate(self, values: Mapping[str, float], experiment: Experiment) -> Mapping[str, Array]:
        """Simulate the measured channels; see `MachineModel`."""
        driven, others, constants = self.inputs_of(experiment)
        time, command = experiment.input.time, experiment.input.values
        if self.rate is not None:
            record = self.record_of(experiment, driven, self.rate)
            time, command = record.points, record.values
        inputs = {driven: command, **{name: each.at(time) for name, each in others.items()}}
        inputs |= {name: np.full(time.size, value) for name, value in constants.items()}
        outputs = _replaced(self.machine, self.numbers, values).outputs(time, inputs)
        return {
            name: np.interp(experiment[name].time, time, outputs[signal])
            for name, signal in self.signals_of(experiment).items()
        }


def _replaced(machine: T, numbers: Mapping[str, float], values: Mapping[str, float]) -> T:
    """A machine with other values; a `DomainError` if they break a rule of its numbers."""
    changes = {name: value for name, value in values.items() if value != numbers.get(name)}
    try:
        return cast("T", machine.replace(changes))
    except ParameterError as error:
        if isinstance(error, UnknownParameterError):
            raise
        raise DomainError(str(error)) from None


def measured(
    model: Any,
    *,
    rate: float | None = None,
    substeps: int | None = None,
    inputs: Mapping[str, float] | None = None,
    begin: Mapping[str, str] | None = None,
    given: Any = None,
) -> MeasuredEquations | MeasuredBlackBox:
    """A machine, or a model without numbers, as experiments drive and measure it.

    Raises
    ------
    InputError
        If it is neither, or a black box is told what only equations know.
    """
    if rate is not None and not (is_real(rate) and 0.0 < rate < np.inf):
        raise InputError(f"rate is {rate!r}, but must be a number of samples a second, above 0.")
    begin, inputs = begin or {}, inputs or {}
    check_mapping("begin", begin)
    stays = _constants(model, inputs)
    if isinstance(model, Equations):
        return MeasuredEquations(model, {}, rate, stays, model, None, substeps, begin, given)
    if isinstance(model, BlackBox):
        stated = {"substeps": substeps, "begin": begin, "given": given}
        for word, entry in stated.items():
            if entry:
                raise InputError(
                    f"{model.name} is a black box, which knows of no {word}: leave it out."
                )
        return MeasuredBlackBox(model.ports, model.numbers, rate, stays, model)
    if isinstance(model, Machine):
        equations, numbers = model.model, model.numbers
        return MeasuredEquations(
            equations, numbers, rate, stays, equations, model, substeps, begin, given
        )
    raise InputError(
        f"A {type(model).__name__} is not a machine: give a Machine, a Model of equations, or of "
        "a program of your own a BlackBox."
    )


def _constants(model: Any, inputs: Mapping[str, float]) -> Mapping[str, float]:
    """Values of inputs by their full names; one that the machine does not have is refused."""
    check_mapping("inputs", inputs)
    external = getattr(getattr(model, "ports", model), "external", ())
    constants = {full_name(name, external): value for name, value in inputs.items()}
    for name, value in constants.items():
        if name not in external:
            raise InputError(
                f"inputs names '{name}'{meant(name, external)}, but the inputs of {model.name} are "
                f"{', '.join(external)}."
            )
        if not (is_real(value) and isfinite(value)):
            raise InputError(f"The input {name} stays at {value!r}, but must be a finite number.")
    return constants


def states_started_by(model: Equations, name: str) -> list[str]:
    """Paths of the states that a name such as ``"start.PATH"`` sets; none if it is none such."""
    return [
        f"{model.prefix(part)}{state}"
        for part in range(len(model.parts))
        for state in started_by(model, part, name)
    ]
