"""The drive as a model to be fitted: card, pump and motor, or the whole chain."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Experiment
from swashplate.campaign.kinds import ChannelKind
from swashplate.equations.observation import Observation, ObservedRecord
from swashplate.equations.record import Record
from swashplate.equations.run import Start
from swashplate.errors import DomainError, InputError, ParameterError
from swashplate.identification.drives import voltage_record
from swashplate.identification.forces import Forces
from swashplate.identification.model import Linearised, Reduced
from swashplate.parameters.definitions import COLUMNS, REFINEMENTS
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.simulation.instance import START_PRESSURE
from swashplate.simulation.residuals import Own, jacobian, residuals, triangle

Array = NDArray[np.float64]
Result = TypeVar("Result")
_Key = tuple[str, tuple[int, ...], tuple[str, ...]]
Part = Literal["card", "pump", "chain"]
"""What of the drive is simulated: the card alone, pump and motor over a current, or all."""

SIGNALS: Mapping[ChannelKind, str] = {
    "signed_current": "current",
    "rectified_current": "current_sum",
    "current_plus": "current_positive",
    "current_minus": "current_negative",
    "shaft_speed": "shaft_speed",
    "position": "shaft_position",
    "encoder_counts": "shaft_position",
    "stroker_pressure": "stroker_pressure",
    "swash_angle": "swash_angle",
    "spool_position": "spool_position",
}
CURRENTS: tuple[ChannelKind, ...] = (
    "signed_current",
    "rectified_current",
    "current_plus",
    "current_minus",
)


@dataclass(frozen=True, eq=False)
class DriveModel:
    """A drive whose parameters are the unknowns, by columns such as ``"Z16_plus"``.

    Besides columns it knows ``"force_plus_1"`` ... (see `Forces`), ``"start_pressure"`` of an
    experiment [Pa], and of each channel ``"offset NAME"`` (its free zero) and ``"clock NAME"``
    (by how much the input's clock is ahead of the channel's [s]).

    Derivatives are exact, those by refinements as well.
    """

    parameters: ParameterSet
    """Values of what is not unknown."""
    part: Part = "chain"
    currents: Mapping[str, Record] = field(default_factory=dict)
    """For the pump alone, the signed current of each experiment by its name. [A]"""
    forces: Forces | None = None
    """The forces that stand for the solenoids' coefficients."""
    _observed: dict[_Key, tuple[Mapping[str, Array | None], ObservedRecord]] = field(
        default_factory=dict, repr=False
    )

    _last: dict[str, tuple[tuple[tuple[str, float], ...], ParameterSet]] = field(
        default_factory=dict, repr=False
    )

    def __getstate__(self) -> dict[str, object]:
        """Without what can be made again."""
        return {**self.__dict__, "_observed": {}, "_last": {}}

    def simulate(self, values: Mapping[str, float], experiment: Experiment) -> Mapping[str, Array]:
        """Simulate the measured channels; see `model.Model`."""
        names = self._channels(experiment)
        observed = self._record(experiment, dict.fromkeys(names), ())
        flat = self._computed(residuals, values, observed, self._own(values, names))
        return {name: flat[observed.rows_of(k)] for k, name in enumerate(names)}

    def linearise(
        self, values: Mapping[str, float], experiment: Experiment, names: Sequence[str]
    ) -> Mapping[str, Linearised]:
        """Simulate with derivatives; see `model.Differentiable`."""
        channels = self._channels(experiment)
        observed = self._record(experiment, dict.fromkeys(channels), tuple(names))
        columns, chain = self._chain(names, channels, observed)
        found = self._computed(
            lambda p, o, own: jacobian(p, o, columns, own),
            values,
            observed,
            self._own(values, channels),
        )
        by = found.columns @ chain
        return {
            name: Linearised(found.residuals[observed.rows_of(k)], by[observed.rows_of(k)])
            for k, name in enumerate(channels)
        }

    def reduce(
        self,
        values: Mapping[str, float],
        experiment: Experiment,
        names: Sequence[str],
        weights: Mapping[str, Array],
    ) -> Reduced:
        """Triangular factor of weighted residuals and derivatives; see `model.Reducing`."""
        channels = [name for name in weights if name in self._channels(experiment)]
        observed = self._record(
            experiment, {name: weights[name] for name in channels}, tuple(names)
        )
        columns, chain = self._chain(names, channels, observed)
        found = self._computed(
            lambda p, o, own: triangle(p, o, columns, own),
            values,
            observed,
            self._own(values, channels, offsets=True),
        )
        return Reduced(np.column_stack([found.factor[:, :-1] @ chain, found.factor[:, -1]]))

    def parameters_at(self, values: Mapping[str, float]) -> ParameterSet:
        """The parameter set for some values of the unknowns.

        Raises
        ------
        DomainError
            If a value breaks a rule.
        """
        own = {name: value for name, value in values.items() if self._is_parameter(name)}
        key = tuple(own.items())
        # runs of one evaluation share their parameters, and checking a set takes a while
        last = self._last.get("set")
        if last is not None and last[0] == key:
            return last[1]
        changes = {name: v for name, v in own.items() if name in COLUMNS or name in REFINEMENTS}
        if self.forces is not None:
            changes |= self.forces.coefficients(own, self.parameters)
        try:
            # whatever the values, the equations stay those that the fit began with
            made = self.parameters.replace(changes, self.parameters.options)
        except ParameterError as error:
            raise DomainError(str(error)) from None
        self._last["set"] = (key, made)
        return made

    def _is_parameter(self, name: str) -> bool:
        known = name in COLUMNS or name in REFINEMENTS
        return known or (self.forces is not None and name in self.forces.names)

    def _computed(
        self,
        compute: Callable[[ParameterSet, ObservedRecord, Own], Result],
        values: Mapping[str, float],
        observed: ObservedRecord,
        own: Own,
    ) -> Result:
        parameters = self.parameters_at(values)
        try:
            return compute(parameters, observed, own)
        except InputError as error:  # a filter that is unstable at this step
            raise DomainError(str(error)) from None

    def _channels(self, experiment: Experiment) -> list[str]:
        """Channels that this part of the drive gives."""
        return [
            name
            for name, channel in experiment.channels.items()
            if channel.kind in SIGNALS
            and (self.part == "chain" or (channel.kind in CURRENTS) == (self.part == "card"))
        ]

    @staticmethod
    def _own(values: Mapping[str, float], channels: Sequence[str], *, offsets: bool = False) -> Own:
        return Own(
            values.get(START_PRESSURE),
            [values.get(f"offset {name}", 0.0) for name in channels] if offsets else (),
            [values.get(f"clock {name}", 0.0) for name in channels],
        )

    def _chain(
        self, names: Sequence[str], channels: Sequence[str], observed: ObservedRecord
    ) -> tuple[list[str], Array]:
        """Columns to ask for, and their derivatives by the names."""
        forces = self.forces.columns if self.forces is not None else ()
        asked = [
            name
            for name in names
            if name in COLUMNS or name in REFINEMENTS or name == START_PRESSURE
        ]
        if self.forces is not None and any(name in self.forces.names for name in names):
            asked += [column for column in forces if column not in asked]
        own = []
        for name, each in zip(channels, observed.observations, strict=True):
            own += [f"offset {name}" for unknown in each.unknown if unknown == "offset"]
            own += [f"clock {name}" for unknown in each.unknown if unknown == "clock_offset"]
        rows = [*asked, *own]
        chain = np.zeros((len(rows), len(names)))
        for k, name in enumerate(names):
            if name in rows:
                chain[rows.index(name), k] = 1.0
            elif self.forces is not None and name in self.forces.names:
                for column, slope in self.forces.slopes(name).items():
                    chain[rows.index(column), k] = slope
        return asked, chain

    def _record(
        self,
        experiment: Experiment,
        weights: Mapping[str, Array | None],
        names: tuple[str, ...],
    ) -> ObservedRecord:
        """The experiment as the march sees it; made once."""
        own = tuple(name for name in names if name.startswith(("offset ", "clock ")))
        key = (experiment.name, tuple(id(each) for each in weights.values()), own)
        if key not in self._observed:
            # the weights are kept as well, so that no others can have their identity
            self._observed[key] = (dict(weights), self._made(experiment, weights, own))
        return self._observed[key][1]

    def _made(
        self, experiment: Experiment, weights: Mapping[str, Array | None], own: Sequence[str]
    ) -> ObservedRecord:
        observations = []
        for name, weight in weights.items():
            channel = experiment[name]
            unknown: list[Literal["offset", "clock_offset"]] = []
            if f"offset {name}" in own:
                unknown.append("offset")
            if f"clock {name}" in own:
                unknown.append("clock_offset")
            observations.append(
                Observation(
                    SIGNALS[channel.kind],
                    channel.time,
                    channel.values if weight is not None else np.zeros_like(channel.values),
                    1.0 if weight is None else weight,
                    unknown=tuple(unknown),
                )
            )
        start: Start = "steady" if experiment.start == "steady" else "rest"
        if self.part == "pump":
            if experiment.name not in self.currents:
                raise InputError(f"{experiment.name} has no current to drive the pump.")
            return ObservedRecord(self.currents[experiment.name], observations, "current", start)
        return ObservedRecord(voltage_record(experiment), observations, "voltage", start)
