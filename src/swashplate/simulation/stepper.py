"""A drive one sample at a time, for loops that the user writes."""

from __future__ import annotations

from typing import NamedTuple

from swashplate.equations.marching.record import Interpolation, least_substeps
from swashplate.equations.marching.run import Start
from swashplate.equations.marching.use import Stepper as ModelStepper
from swashplate.equations.marching.use import StepperState
from swashplate.errors import InputError
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.simulation.instance import check_filter_stability, instance_of


class Sample(NamedTuple):
    """Signals at one sample, named and signed as in `Simulation`, SI."""

    voltage: float
    current_positive: float
    current_negative: float
    current: float
    solenoid_force: float
    spool_position: float
    orifice_opening: float
    stroker_pressure: float
    swash_angle: float
    shaft_speed: float
    shaft_position: float


class Stepper:
    """A drive that takes a command and gives a sample, the same numbers as `Drive.simulate`.

    Created by `Drive.stepper`. The first step gives the sample at time zero.
    """

    def __init__(
        self, parameters: ParameterSet, h: float, interpolation: Interpolation, start: Start
    ) -> None:
        if not h > 0.0:
            raise InputError(f"The sample interval is {h:g} s, but must be above 0.")
        rate = 1.0 / h
        if abs(rate - round(rate)) < 1e-9 * rate:
            rate = float(round(rate))  # 1/(1/49) is not 49, but the user means 49 Hz
        substeps = least_substeps(rate)
        check_filter_stability(parameters, 1.0 / (rate * substeps))
        self._stepper = ModelStepper(
            instance_of(parameters, True),
            ("voltage",),
            Sample._fields[1:],
            rate,
            start,
            interpolation=interpolation,
            substeps=substeps,
            cause="voltage",
        )

    @property
    def state(self) -> StepperState:
        """A copy of the present state; assign it to return to that instant."""
        return self._stepper.state

    @state.setter
    def state(self, state: StepperState) -> None:
        self._stepper.state = state

    def step(self, voltage: float) -> Sample:
        """Advance by one sample interval.

        Parameters
        ----------
        voltage : float
            Command at the new sample. [V]

        Returns
        -------
        Sample
            All signals at the new sample; at the first call, those at time zero.

        Raises
        ------
        InputError
            For a command that is not finite or beyond ±10 V; the state stays as it was.
        DomainError
            If the solenoid overpowers the feedback spring, or a number grows beyond all bounds.
        """
        if not -FULL_VOLTAGE <= voltage <= FULL_VOLTAGE:
            raise InputError(f"The voltage is {voltage:g} V, but the card takes ±10 V.")
        return Sample(**self._stepper.step(voltage))
