"""A drive one sample at a time, for loops that the user writes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.physics.control_card import interpolated
from swashplate.physics.spool import orifice_opening, stopped_spool
from swashplate.physics.swash import swash_angle, swash_tangent
from swashplate.simulation.build import build
from swashplate.simulation.chain import (
    channel_sample,
    channel_steady,
    moment_squared,
    pump_force,
    pump_speed,
    pump_spool,
    pump_step,
)
from swashplate.simulation.compilation import kernel
from swashplate.simulation.constants import Channel, Delay, Pump
from swashplate.simulation.record import Interpolation, least_substeps
from swashplate.simulation.run import Start, check_domain, check_start, rest_pressure
from swashplate.simulation.steady import steady_start

Array = NDArray[np.float64]

(PRESSURE, STATE_P, PREVIOUS_P, OUTPUT_P, STATE_M, PREVIOUS_M, OUTPUT_M) = range(7)
(SPEED, POSITION, BEGUN, LAST) = range(7, 11)
N_STATES = 11


@kernel
def step_drive(
    voltage: float,
    held: bool,
    substeps: int,
    delay: Delay,
    plus: Channel,
    minus: Channel,
    pump: Pump,
    step: float,
    state: Array,
    line: Array,
    sample: Array,
) -> float:
    """Advance a drive by one sample.

    Parameters
    ----------
    voltage : float
        Command at the new sample. [V]
    held : bool
        Whether the command held its last value until now, or went in a straight line.
    substeps : int
        Steps of the march a sample.
    state : (N_STATES,) array
        Advanced in place.
    line : (m,) array
        The delay line, newest command first; shifted in place. [V]
    sample : (9,) array
        Filled with what `Sample` holds from `current_positive` on.

    Returns
    -------
    float
        Largest sin²φ met.
    """
    first = state[BEGUN] == 0.0
    state[BEGUN] = 1.0
    last = state[LAST]
    worst = 0.0
    for j in range(1 if first else substeps):
        if not first:
            current = state[OUTPUT_P] - state[OUTPUT_M]
            state[PRESSURE] = pump_step(state[PRESSURE], current, pump, step)
        for k in range(line.size - 1, 0, -1):
            line[k] = line[k - 1]
        if first or j == substeps - 1:
            line[0] = voltage
        elif held:
            line[0] = last
        else:
            line[0] = interpolated(last, voltage, (j + 1) / substeps)
        delayed = interpolated(line[delay.whole], line[delay.whole + 1], delay.fraction)
        at = delay.share_whole
        f = delay.share_fraction
        steady = channel_steady(1.0, delayed, line[at], line[at + 1], line[at + 2], f, plus)
        output, following, _ = channel_sample(
            steady, state[STATE_P], state[PREVIOUS_P], state[OUTPUT_P], plus, step
        )
        state[PREVIOUS_P], state[STATE_P], state[OUTPUT_P] = state[STATE_P], following, output
        steady = channel_steady(-1.0, delayed, line[at], line[at + 1], line[at + 2], f, minus)
        output, following, _ = channel_sample(
            steady, state[STATE_M], state[PREVIOUS_M], state[OUTPUT_M], minus, step
        )
        state[PREVIOUS_M], state[STATE_M], state[OUTPUT_M] = state[STATE_M], following, output
        current = state[OUTPUT_P] - state[OUTPUT_M]
        worst = max(worst, moment_squared(current, pump))
        speed = pump_speed(state[PRESSURE], current, pump)
        if not first:
            state[POSITION] = state[POSITION] + 0.5 * step * (state[SPEED] + speed)
        state[SPEED] = speed
    state[LAST] = voltage

    current = state[OUTPUT_P] - state[OUTPUT_M]
    force = pump_force(current, pump)
    free = pump_spool(force, state[PRESSURE], pump)
    tangent = swash_tangent(state[PRESSURE], pump.Z1, pump.Z2)
    sample[0] = state[OUTPUT_P]
    sample[1] = state[OUTPUT_M]
    sample[2] = current
    sample[3] = force
    sample[4] = stopped_spool(free, pump.Z14)
    sample[5] = orifice_opening(free, pump.Z14, pump.Z16_plus, pump.Z16_minus)
    sample[6] = state[PRESSURE]
    sample[7] = swash_angle(tangent, pump.Z13_plus, pump.Z13_minus, pump.steep)
    sample[8] = state[SPEED]
    return worst


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


class StepperState(NamedTuple):
    """All that a stepper remembers; read-only, good to keep and to return to."""

    numbers: Array
    line: Array


class Stepper:
    """A drive that takes a command and gives a sample, the same numbers as `Drive.simulate`.

    Created by `Drive.stepper`. The first step gives the sample at time zero.
    """

    def __init__(
        self, parameters: ParameterSet, h: float, interpolation: Interpolation, start: Start
    ) -> None:
        if not h > 0.0:
            raise InputError(f"The sample interval is {h:g} s, but must be above 0.")
        if interpolation not in ("linear", "previous"):
            raise InputError(f"interpolation is '{interpolation}'; it is 'linear' or 'previous'.")
        check_start(start)
        rate = 1.0 / h
        if abs(rate - round(rate)) < 1e-9 * rate:
            rate = float(round(rate))  # 1/(1/49) is not 49, but the user means 49 Hz
        self._name = parameters.name
        self._substeps = least_substeps(rate)
        self._held = interpolation == "previous"
        self._constants = build(parameters, 1.0 / (rate * self._substeps))
        self._start = start
        delay, _, _, pump, _ = self._constants
        self._numbers = np.zeros(N_STATES)
        self._numbers[PRESSURE] = rest_pressure(pump)
        self._line = np.zeros(max(delay.whole + 2, delay.share_whole + 3))
        self._sample = np.empty(9)

    @property
    def state(self) -> StepperState:
        """A copy of the present state; assign it to return to that instant."""
        numbers, line = self._numbers.copy(), self._line.copy()
        numbers.flags.writeable = line.flags.writeable = False
        return StepperState(numbers, line)

    @state.setter
    def state(self, state: StepperState) -> None:
        if state.line.shape != self._line.shape:
            raise InputError("This state belongs to a stepper of another delay or rate.")
        self._numbers[:] = state.numbers
        self._line[:] = state.line

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
            If the solenoid overpowers the feedback spring.
        """
        voltage = float(voltage)
        if not -FULL_VOLTAGE <= voltage <= FULL_VOLTAGE:
            raise InputError(f"The voltage is {voltage:g} V, but the card takes ±10 V.")
        delay, plus, minus, pump, step = self._constants
        if self._start == "steady" and self._numbers[BEGUN] == 0.0:
            self._settle(voltage)
        worst = step_drive(
            voltage,
            self._held,
            self._substeps,
            delay,
            plus,
            minus,
            pump,
            step,
            self._numbers,
            self._line,
            self._sample,
        )
        check_domain(self._name, worst, "voltage")
        return Sample._make([voltage, *self._sample.tolist(), float(self._numbers[POSITION])])

    def _settle(self, voltage: float) -> None:
        _, plus, minus, pump, _ = self._constants
        current_plus, current_minus, pressure = steady_start(voltage, plus, minus, pump)
        self._numbers[[STATE_P, PREVIOUS_P, OUTPUT_P]] = current_plus
        self._numbers[[STATE_M, PREVIOUS_M, OUTPUT_M]] = current_minus
        self._numbers[PRESSURE] = pressure
        self._line[:] = voltage
