"""Models as a fit sees them: what any must do, and models of equations with exact derivatives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import CommandJump, Experiment
from swashplate.errors import DomainError, InputError, meant
from swashplate.machine.marching import BoundModel, Observation, ObservedRecord, Record
from swashplate.results import short

Array = NDArray[np.float64]
INSTANT_STEP = 1e-5
"""Step of the differences by the instant of an edge of the command, see `InputSignal.edges`. [s]"""


class MachineModel(Protocol):
    """What a problem simulates; with only `simulate` it is differentiated by central differences.

    One that knows its derivatives has ``linearise(values, experiment, names)`` as well, which gives
    for each channel a `Linearised`. A machine is made one by `measured`, a drive by `DriveModel`.
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
    """What every model of equations has in common; see `MeasuredEquations` and `DriveModel`."""

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
