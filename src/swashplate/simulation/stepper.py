"""A drive one sample at a time, for loops that the user writes."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.cache import kernel
from swashplate.equations.code import generating
from swashplate.equations.marching.part import Stored
from swashplate.equations.marching.record import Interpolation, least_substeps
from swashplate.equations.marching.run import Start, check_start
from swashplate.equations.marching.stepping import CompiledStep, Machine
from swashplate.errors import InputError
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.simulation.instance import check_filter_stability, instance_of

Array = NDArray[np.float64]


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


SHOWN = (
    Stored(0, "signals", "current_positive"),
    Stored(0, "signals", "current_negative"),
    *(Stored(1, "signals", name) for name in Sample._fields[4:10]),
)
"""What one sample leaves, in this order; the rest follows from it."""


@generating
def _steps(step: Callable[[Machine], float]) -> Callable[..., float]:
    """The compiled march over the steps of one sample."""

    @kernel
    def steps(
        last: float, voltage: float, held: bool, substeps: int, begun: bool, machine: Machine,
        position: Array,
    ) -> float:  # fmt: skip
        """Advance by one sample of a record, or take the first one."""
        worst = inf
        for j in range(substeps if begun else 1):
            machine.inputs[0] = voltage
            if begun and j < substeps - 1:
                machine.inputs[0] = last if held else last + (j + 1) / substeps * (voltage - last)
            before = machine.outputs[7]
            worst = min(worst, step(machine))
            if begun:
                position[0] = position[0] + 0.5 * machine.h * (before + machine.outputs[7])
        return worst

    return steps


class StepperState(NamedTuple):
    """All that a stepper remembers, good to keep and to return to."""

    machine: Machine
    position: float
    """[rad]"""
    last: float | None
    """Command of the sample before, None if there was none. [V]"""


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
        self._substeps = least_substeps(rate)
        self._held = interpolation == "previous"
        self._step = 1.0 / (rate * self._substeps)
        check_filter_stability(parameters, self._step)
        self._instance = instance_of(parameters, True)
        self._start = start
        self._compiled = CompiledStep(self._instance, ("voltage",), SHOWN, self._step)
        self._steps = _steps(self._compiled.step)
        self._machine = self._compiled.machine()
        self._position = np.zeros(1)
        self._last: float | None = None

    @property
    def state(self) -> StepperState:
        """A copy of the present state; assign it to return to that instant."""
        return StepperState(self._machine.copied(), float(self._position[0]), self._last)

    @state.setter
    def state(self, state: StepperState) -> None:
        own, given = self._machine, state.machine.copied()
        if given.lines.shape != own.lines.shape or given.states.size != own.states.size:
            raise InputError("This state belongs to a stepper of another drive, delay or rate.")
        self._machine = own._replace(
            states=given.states, outputs=given.outputs, lines=given.lines, inputs=given.inputs
        )
        self._position[0], self._last = state.position, state.last

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
        voltage = float(voltage)
        if not -FULL_VOLTAGE <= voltage <= FULL_VOLTAGE:
            raise InputError(f"The voltage is {voltage:g} V, but the card takes ±10 V.")
        begun = self._last is not None
        if self._start == "steady" and not begun:
            self._machine = self._compiled.machine({"voltage": voltage}, "steady")
        last = 0.0 if self._last is None else self._last
        worst = self._steps(
            last, voltage, self._held, self._substeps, begun, self._machine, self._position
        )
        self._compiled.check(self._machine, worst, "voltage")
        self._last = voltage
        plus, minus, *inside = self._machine.outputs.tolist()
        return Sample._make([voltage, plus, minus, plus - minus, *inside, float(self._position[0])])
