"""The drive as a model to be fitted: card, pump and motor, or the whole chain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Experiment
from swashplate.campaign.kinds import ChannelKind
from swashplate.equations.marching.observation import ObservedRecord
from swashplate.equations.marching.record import Record
from swashplate.errors import DomainError, InputError, ParameterError
from swashplate.identification.drives import voltage_record
from swashplate.identification.equation_model import EquationModel
from swashplate.identification.forces import Forces
from swashplate.parameters.definitions import COLUMNS, REFINEMENTS
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.simulation.instance import START_PRESSURE
from swashplate.simulation.residuals import Own, Ready, made_ready

Array = NDArray[np.float64]
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
class DriveModel(EquationModel):
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
    _last: dict[str, tuple[tuple[tuple[str, float], ...], ParameterSet]] = field(
        default_factory=dict, repr=False, init=False
    )

    def __getstate__(self) -> dict[str, object]:
        """Without what can be made again."""
        return {**super().__getstate__(), "_last": {}}

    def signals_of(self, experiment: Experiment) -> Mapping[str, str]:
        """Signal for each channel that this part of the drive gives."""
        return {
            name: SIGNALS[channel.kind]
            for name, channel in experiment.channels.items()
            if channel.kind in SIGNALS
            and (self.part == "chain" or (channel.kind in CURRENTS) == (self.part == "card"))
        }

    def driven(self, experiment: Experiment) -> tuple[str, Record, Mapping[str, Array]]:
        """The experiment's voltage, or the current that drives the pump."""
        if self.part != "pump":
            return "voltage", voltage_record(experiment), {}
        if experiment.name not in self.currents:
            raise InputError(f"{experiment.name} has no current to drive the pump.")
        return "current", self.currents[experiment.name], {}

    def ready(
        self,
        values: Mapping[str, float],
        experiment: Experiment,
        observed: ObservedRecord,
        columns: Sequence[str],
        shifts: tuple[Sequence[float], Sequence[float]],
    ) -> Ready:
        """The drive with numbers; see `EquationModel.ready`."""
        own = Own(values.get(START_PRESSURE), *shifts)
        try:
            return made_ready(self.parameters_at(values), observed, columns, own)
        except InputError as error:  # a filter that is unstable at this step
            raise DomainError(str(error)) from None

    def moves(self, name: str) -> Mapping[str, float]:
        """Derivatives by a name of the columns that it moves: of coefficients by a force."""
        if self.forces is not None and name in self.forces.names:
            return self.forces.slopes(name)
        known = name in COLUMNS or name in REFINEMENTS or name == START_PRESSURE
        return {name: 1.0} if known else {}

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
