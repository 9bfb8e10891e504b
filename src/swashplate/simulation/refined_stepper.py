"""A drive with refinements one sample at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.physics.component import uncompiled
from swashplate.physics.control_card import interpolated
from swashplate.physics.spool import orifice_opening, stopped_spool
from swashplate.simulation.record import Interpolation
from swashplate.simulation.refined import build_refined
from swashplate.simulation.refined_march import (
    BEGUN,
    TURNED,
    RefinedSignals,
    march_refined,
    rest_state,
)
from swashplate.simulation.run import Start, check_domain, drive_start
from swashplate.simulation.stepper import Sample, Stepper, StepperState

Array = NDArray[np.float64]


class RefinedStepper(Stepper):
    """As `Stepper`, with refinements; the numbers of `Drive.simulate`.

    A plain stepper at the march's own step makes the current, the refined march the rest.
    """

    def __init__(
        self, parameters: ParameterSet, h: float, interpolation: Interpolation, start: Start
    ) -> None:
        super().__init__(parameters.plain, h, interpolation, start)
        self._h = self._constants.step
        self._card = Stepper(parameters.plain, self._h, interpolation, start)
        self._pump, self._refined = build_refined(parameters, self._h)
        self._signals = RefinedSignals(*(np.zeros(1) for _ in RefinedSignals._fields))
        self._memory = rest_state(0.0, 0.0, self._refined)
        self._last = 0.0

    @property
    def state(self) -> StepperState:
        """A copy of the present state; assign it to return to that instant."""
        card = self._card.state
        numbers = np.concatenate([card.numbers, self._memory, [self._last]])
        numbers.flags.writeable = False
        return StepperState(numbers, card.line)

    @state.setter
    def state(self, state: StepperState) -> None:
        own = self._memory.size + 1
        self._card.state = StepperState(state.numbers[:-own], state.line)
        self._memory[:] = state.numbers[-own:-1]
        self._last = float(state.numbers[-1])

    def step(self, voltage: float) -> Sample:
        """Advance by one sample interval; as `Stepper.step`."""
        voltage = float(voltage)
        if not -FULL_VOLTAGE <= voltage <= FULL_VOLTAGE:
            raise InputError(f"The voltage is {voltage:g} V, but the card takes ±10 V.")
        if self._memory[BEGUN] == 0.0:
            made = self._card.step(voltage)
            _, plus, minus, plain, _ = self._constants
            _, state = drive_start(np.array([voltage]), plus, minus, plain, self._start)
            self._memory[:] = rest_state(state[0] - state[1], state[2], self._refined)
            self._march(made.current)
        else:
            for j in range(self._substeps):
                made = self._card.step(self._between(voltage, j + 1))
                self._march(made.current)
        self._last = voltage
        return self._sample_of(made, voltage)

    def _between(self, voltage: float, j: int) -> float:
        """Command at a point of the march on the way to the new sample. [V]"""
        if j == self._substeps:
            return voltage
        if self._held:
            return self._last
        return uncompiled(interpolated)(self._last, voltage, j / self._substeps)

    def _march(self, current: float) -> None:
        worst = march_refined(
            np.array([current]), self._pump, self._refined, self._h, self._memory, self._signals
        )
        check_domain(self._name, worst, "voltage")

    def _sample_of(self, card: Sample, voltage: float) -> Sample:
        pump, inner = self._pump, self._signals
        free = float(inner.position[0])
        return card._replace(
            voltage=voltage,
            solenoid_force=float(inner.force[0]),
            spool_position=uncompiled(stopped_spool)(free, pump.Z14),
            orifice_opening=uncompiled(orifice_opening)(
                free, pump.Z14, pump.Z16_plus, pump.Z16_minus
            ),
            stroker_pressure=float(inner.pressure[0]),
            swash_angle=float(inner.angle[0]),
            shaft_speed=float(inner.speed[0]),
            shaft_position=float(self._memory[TURNED]),
        )
