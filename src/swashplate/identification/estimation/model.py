"""Models as a fit sees them: what any must do, and models of equations with exact derivatives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import CommandJump, Experiment
from swashplate.errors import DomainError, InputError, meant
from swashplate.machine import Machine
from swashplate.machine import Model as Equations
from swashplate.machine.fields import tuple_from
from swashplate.machine.marching import (
    BoundModel,
    Observation,
    ObservedRecord,
    Record,
    RunValues,
    even_rate,
    on_grid,
    started_by,
)
from swashplate.machine.model import parameter_paths, state_paths
from swashplate.results import Result, short

Array = NDArray[np.float64]
INSTANT_STEP = 1e-5
"""Step of the differences by the instant of an edge of the command, see `InputSignal.edges`. [s]"""


class MachineModel(Protocol):
    """A model of the machine; with only `simulate` it is differentiated by central differences.

    One that knows its derivatives has ``linearise(values, experiment, names)`` as well, which gives
    for each channel a `Linearised`.

    Examples
    --------
    >>> import numpy as np
    >>> class Gain:
    ...     def simulate(self, values, experiment):
    ...         command, speed = experiment.input, experiment["speed"]
    ...         volts = np.interp(speed.time, command.time, command.values)
    ...         return {"speed": values["gain"] * volts}
    """

    def simulate(self, values: Mapping[str, float], experiment: Experiment) -> Mapping[str, Array]:
        """Simulate what an experiment measured.

        Parameters
        ----------
        values : mapping
            The unknowns by name, in their units.
        experiment : Experiment
            Its input drives the model; the model does not look at what was measured.

        Returns
        -------
        mapping of str to (m,) array
            For each channel that the model has, its samples at the channel's time stamps, SI.

        Raises
        ------
        DomainError
            If the model does not hold for these values; the fit takes the step back.
        """
        ...


class Linearised(NamedTuple):
    """A channel's simulated samples and their derivatives."""

    def __repr__(self) -> str:
        return short(self)

    values: Array
    """(m,)"""
    by: Array
    """(m, k) derivatives by the names asked for, in their order."""


RELATIVE_STEP = 1e-6
"""Step of the central differences, in units of each number's size."""


def simulated(
    model: MachineModel, values: Mapping[str, float], experiment: Experiment
) -> Mapping[str, Array]:
    """What a model simulates; a `DomainError` names a sample that is not finite.

    Anything but one real number a sample for each channel is refused in an `InputError`.
    """
    outputs = model.simulate(values, experiment)
    _check_outputs(outputs, experiment)
    for name, output in outputs.items():
        if not np.isfinite(output).all():
            row = int(np.argmax(~np.isfinite(output)))
            raise DomainError(
                f"{experiment.name}: the model gives {output[row]} for {name} at "
                f"{experiment[name].time[row]:g} s."
            )
    return outputs


def linearised(
    model: MachineModel, values: Mapping[str, float], experiment: Experiment, names: Sequence[str]
) -> Mapping[str, Linearised]:
    """Simulation with derivatives by names, its own or differences; raises as `simulated`."""
    linearise = getattr(model, "linearise", None)
    if linearise:
        of_model: Mapping[str, Linearised] = linearise(values, experiment, names)
        _check_outputs(of_model, experiment, len(names))
        return of_model
    outputs = simulated(model, values, experiment)
    by_channel = {
        channel: Linearised(output, np.empty((output.size, len(names))))
        for channel, output in outputs.items()
    }
    for k, name in enumerate(names):
        step = RELATIVE_STEP * max(abs(values[name]), 1e-3)
        above = simulated(model, {**values, name: values[name] + step}, experiment)
        below = simulated(model, {**values, name: values[name] - step}, experiment)
        for channel, part in by_channel.items():
            part.by[:, k] = (above[channel] - below[channel]) / (2.0 * step)
    return by_channel


def _type_words(returned: object) -> str:
    """Type of what a model returned, for a sentence."""
    if returned is None:
        return "None (is a return missing?)"
    if isinstance(returned, np.ndarray):
        return f"an array of {returned.dtype.name}"
    return f"a {type(returned).__name__}"


def _check_outputs(outputs: object, experiment: Experiment, names: int | None = None) -> None:
    """Refuse outputs that are not arrays by channel, or with `names` Linearised by so many."""
    method, of_channel = "linearise", "a Linearised"
    if names is None:
        method, of_channel = "simulate", "an array of floats"

    def refused(must: str, returned: object) -> InputError:
        type_name = _type_words(returned)
        return InputError(f"{experiment.name}: {method} must return {must}, not {type_name}.")

    if not isinstance(outputs, Mapping):
        first = next(iter(experiment.channels), "speed")
        raise refused(
            f"a mapping of channel names to {of_channel}, such as {{'{first}': ...}}", outputs
        )
    for name, part in outputs.items():
        if names is not None and not isinstance(part, Linearised):
            raise refused(f"a Linearised for {name}", part)
        for k, array in enumerate((part,) if names is None else part):
            if not isinstance(array, np.ndarray) or array.dtype.kind not in "fiu":
                raise refused(f"a NumPy array of real numbers for {name}", array)
            shape = experiment[name].time.shape + ((names,) if k else ())
            if array.shape != shape:
                columns = ", and a column for each requested name" if k else ""
                raise InputError(
                    f"{experiment.name}: {method} returns an array of shape {array.shape} for "
                    f"{name}, but must return {shape}: a row for each of the channel's own time "
                    f"stamps{columns}."
                )


Output = TypeVar("Output")


def part_of(outputs: Mapping[str, Output], experiment: Experiment, channel: str) -> Output:
    """Output of a model for a channel; an `InputError` if it gives none."""
    if channel not in outputs:
        names = ", ".join(outputs)
        raise InputError(
            f"{experiment.name}: the model gives no '{channel}'{meant(channel, outputs)}; it gives "
            f"{names}."
        )
    return outputs[channel]


class SimulationRequest(NamedTuple):
    """Request to a model: an experiment as the march sees it, and derivatives by columns."""

    observed: ObservedRecord
    columns: Sequence[str] = ()
    offsets: Sequence[float] = ()
    """Of the observations, if they are free."""


@dataclass(frozen=True, eq=False)
class EquationModel(ABC):
    """What every model of equations has in common; see `UserModel` and `DriveModel`."""

    @abstractmethod
    def signals_of(self, experiment: Experiment) -> Mapping[str, str]:
        """Signal of the model for each channel that it gives."""

    @abstractmethod
    def driven(
        self, experiment: Experiment, values: Mapping[str, float] = MappingProxyType({})
    ) -> tuple[str, Record, Mapping[str, Array]]:
        """Signal that drives the model, its record, and other external signals on its grid."""

    @abstractmethod
    def ready(
        self, values: Mapping[str, float], experiment: Experiment, request: SimulationRequest
    ) -> BoundModel:
        """The model with numbers; columns as the engine names them."""

    def instants_of(self, experiment: Experiment) -> Mapping[str, CommandJump]:
        """Edges of the command whose instants the model takes, by the names of these."""
        return {}

    def moves(self, name: str) -> Mapping[str, float]:
        """Derivatives by a name of the columns that it moves."""
        return {name: 1.0}

    def columns(self, names: Sequence[str]) -> tuple[list[str], Array]:
        """Columns that some names move, and (columns, names) their derivatives by these."""
        derivatives_of_names = [self.moves(name) for name in names]
        columns = list(
            dict.fromkeys(column for derivatives in derivatives_of_names for column in derivatives)
        )
        rows = [
            [derivatives.get(column, 0.0) for derivatives in derivatives_of_names]
            for column in columns
        ]
        return columns, np.array(rows).reshape(len(columns), len(names))

    def observed(
        self,
        experiment: Experiment,
        weights: Mapping[str, Array] | None = None,
        offsets: Collection[str] = (),
        values: Mapping[str, float] = MappingProxyType({}),
    ) -> ObservedRecord:
        """An experiment as the march sees it, with the edges of its command where `values` say.

        With factors (m,) on the residuals of the channels that count, against what was measured;
        without, all channels that the model gives, against zero. `offsets` are the
        channels whose zero is free.
        """
        signals = self.signals_of(experiment)
        observations = []
        for name in signals if weights is None else weights:
            signal, channel = part_of(signals, experiment, name), experiment[name]
            measured = np.zeros(channel.time.size)
            factors: Array | float = 1.0
            if weights is not None:
                measured = channel.values
                factors = weights[name]
            observations.append(
                Observation(signal, channel.time, measured, factors, name in offsets)
            )
        by, record, others = self.driven(experiment, values)
        return ObservedRecord(record, observations, by, experiment.begins, others)

    def simulate(self, values: Mapping[str, float], experiment: Experiment) -> Mapping[str, Array]:
        """Simulate the measured channels; see `MachineModel`."""
        observed = self.observed(experiment, values=values)
        signals = enumerate(self.signals_of(experiment))
        flat = self.ready(values, experiment, SimulationRequest(observed)).residuals(observed)
        return {name: flat[observed.rows_of(k)] for k, name in signals}

    def linearise(
        self, values: Mapping[str, float], experiment: Experiment, names: Sequence[str]
    ) -> Mapping[str, Linearised]:
        """Simulate with derivatives, those by edges by differences; see `MachineModel`."""
        observed = self.observed(experiment, values=values)
        columns, chain = self.columns(names)
        model = self.ready(values, experiment, SimulationRequest(observed, columns))
        jacobian = model.jacobian(observed)
        by_names = jacobian.columns @ chain
        outputs = dict[str, Linearised]()
        for number, channel in enumerate(self.signals_of(experiment)):
            rows = observed.rows_of(number)
            outputs[channel] = Linearised(jacobian.residuals[rows], by_names[rows])
        instants = self.instants_of(experiment)
        for column, name in enumerate(names):
            if name in instants:
                later = self.simulate({**values, name: values[name] + INSTANT_STEP}, experiment)
                for channel, output in outputs.items():
                    output.by[:, column] = (later[channel] - output.values) / INSTANT_STEP
        return outputs


def states_started_by(model: Equations, name: str) -> list[str]:
    """Paths of the states that a name such as ``"start.PATH"`` sets; none if it is none such."""
    return [
        f"{model.prefix(part)}{state}"
        for part in range(len(model.parts))
        for state in started_by(model, part, name)
    ]


@dataclass(frozen=True, eq=False)
class UserModel(Result, EquationModel):
    """A model of equations whose parameters, by their paths, are the unknowns.

    ``"start.PATH"`` is a number of the state at the first sample, by its path or as `free_start` of
    the model has it: an unknown of each run.

    A channel is compared with the signal of its name. Of the model's external signals those that
    are channels of an experiment are taken from there; the one that is left is its input.

    Examples
    --------
    >>> from swashplate.identification import UserModel
    >>> from swashplate.models.full_order import plant
    >>> UserModel(plant, rate=512.0).signals[:2]
    ['solenoid_force', 'spool_position']
    """

    model: Equations
    rate: float | None = None
    """Samples a second; by default the input's. Needed if its stamps are not even. [Hz]"""
    options: Any = None
    given: Any = None
    """The model's givens, or a mapping of them by the experiments' names."""
    begin: Mapping[str, str] = field(default_factory=dict)
    """Channel that says where a number of the state begins, by its path: at the first sample that
    counts."""
    substeps: int | None = None
    """Steps of the model a sample; by default one."""

    @property
    def signals(self) -> list[str]:
        """Names of the signals that it gives."""
        names = [name for part in self.model.parts for name in part.signal_names]
        return [*names, *self.model.links, *self.model.integrals]

    def signals_of(self, experiment: Experiment) -> Mapping[str, str]:
        """Signal of the model for each channel that it gives; one of none is refused."""
        signals = self.signals
        signal_of = {name: name for name in experiment.channels if name in signals}
        if not signal_of:
            raise InputError(
                f"{experiment.name} has the channels {', '.join(experiment.channels)}, of which "
                f"{self.model.name} gives none; it gives {', '.join(signals)}."
            )
        return signal_of

    def driven(
        self, experiment: Experiment, values: Mapping[str, float] = MappingProxyType({})
    ) -> tuple[str, Record, Mapping[str, Array]]:
        """The experiment's input on the grid, and external signals that are channels.

        Refused if stamps are uneven and no rate is given, or if it is not clear which signal the
        input is.
        """
        model = self.model
        command = experiment.input
        defaults = {p.tap(name).signal for p in model.parts for name in p.defaults}
        others = [experiment[name] for name in model.external if name in experiment.channels]
        inputs = [name for name in model.external if name not in experiment.channels]
        inputs = [name for name in inputs if name not in defaults] or inputs
        if len(inputs) != 1:
            raise InputError(
                f"{model.name} needs the signals {', '.join(model.external)}; {experiment.name} "
                "has one input, for one of them, and the channels "
                f"{', '.join(experiment.channels)}."
            )
        even = even_rate(command.time)
        rate = self.rate or even
        if rate is None:
            raise InputError(
                f"{experiment.name}: the stamps of its input are not even, so the model needs a "
                f"rate, as in UserModel({model.name}, rate=100.0)."
            )
        record = on_grid(
            {inputs[0]: command.values},
            rate,
            time=None if rate == even else command.time,
            interpolation="previous" if command.is_held else "linear",
            substeps=self.substeps,
        )[inputs[0]]
        record = replace(record, start=float(command.time[0]))
        return inputs[0], record, {signal.name: signal.at(record.points) for signal in others}

    def ready(
        self, values: Mapping[str, float], experiment: Experiment, request: SimulationRequest
    ) -> BoundModel:
        """The model with numbers; a name that is not known, or no value of one, is refused."""
        model, given = self.model, self.given
        paths, states, begin = parameter_paths(model), state_paths(model), dict[str, float]()
        for path, channel in self.begin.items():
            measured = experiment[channel]
            begin[path] = float(measured.values[int(np.argmax(measured.used))])
        for name, value in values.items():
            started = states_started_by(model, name)
            begin |= dict.fromkeys(started, value)
            if name not in paths and not started:
                parameters = ", ".join(paths)
                raise InputError(f"{model.name} has no parameter '{name}'; it has {parameters}.")
        for path in begin:
            if path not in states:
                raise InputError(
                    f"{model.name} has no state '{path}' to begin at; it has {', '.join(states)}."
                )
        try:
            p = tuple_from(
                model.parameters, {name: values[name] for name in values if name in paths}
            )
        except KeyError as error:
            raise InputError(
                f"{model.name} has no value of {error.args[0]}: let it be free, or fix it."
            ) from None
        if isinstance(given, Mapping):
            if experiment.name not in given:
                raise InputError(f"{model.name} has no given numbers for {experiment.name}.")
            given = given[experiment.name]
        instance = Machine(model, p, options=self.options, given=given)
        return BoundModel(instance, RunValues(begin, request.offsets), request.columns)
