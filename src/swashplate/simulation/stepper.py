"""A drive one sample at a time, for loops that the user writes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.code import generating
from swashplate.equations.marching.march import advance_source
from swashplate.equations.marching.part import Stored
from swashplate.equations.marching.record import Interpolation, least_substeps
from swashplate.equations.marching.run import Start, check_domain, check_start, module
from swashplate.equations.model import Model
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
DRIVER = '''


@kernel
def steps(last, voltage, held, substeps, begun, h, machine, states, lines, out):
    """Advance by one sample of a record, or take the first one."""
    whole, fraction, params, given, constants = machine
    values = np.empty(1)
    worst = inf
    for j in range(substeps if begun else 1):
        values[0] = voltage
        if begun and j < substeps - 1:
            values[0] = last if held else last + (j + 1) / substeps * (voltage - last)
        before = out[7]
        margin = advance(values, lines, whole, fraction, params, given, h, constants, states, out)
        worst = min(worst, margin)
        if begun:
            out[8] = out[8] + 0.5 * h * (before + out[7])
    return worst
'''


@generating
def _kernels(
    model: Model, options: tuple[Any, ...]
) -> tuple[Callable[..., int], Callable[..., float]]:
    """The compiled constants and steps of a drive."""
    text, names = advance_source(model, ("voltage",), options, SHOWN)
    made = module("drive_step", text + DRIVER, {**names, "np": np})
    return made["prepare"], made["steps"]


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
        self._substeps = least_substeps(rate)
        self._held = interpolation == "previous"
        self._step = 1.0 / (rate * self._substeps)
        check_filter_stability(parameters, self._step)
        self._instance = instance_of(parameters, True)
        self._start = start
        prepare, self._steps = _kernels(self._instance.model, self._instance.options)
        places = self._instance.places(("voltage",), self._step)
        constants = np.zeros(64)
        params, given = self._instance.params, self._instance.given
        prepare(params, given, self._step, constants)
        self._machine = (places.whole, places.fraction, params, given, constants)
        self._states = self._instance.start({"voltage": 0.0}, self._step).flat
        self._lines = np.zeros((1, int(places.whole.max()) + 3))
        self._out = np.zeros(len(SHOWN) + 1)
        self._last, self._begun = 0.0, False

    @property
    def state(self) -> StepperState:
        """A copy of the present state; assign it to return to that instant."""
        numbers = np.concatenate([self._states, self._out, [self._last, float(self._begun)]])
        line = self._lines[0].copy()
        numbers.flags.writeable = line.flags.writeable = False
        return StepperState(numbers, line)

    @state.setter
    def state(self, state: StepperState) -> None:
        size = self._states.size + self._out.size + 2
        if state.line.shape != self._lines[0].shape or state.numbers.size != size:
            raise InputError("This state belongs to a stepper of another drive, delay or rate.")
        self._states[:] = state.numbers[: self._states.size]
        self._out[:] = state.numbers[self._states.size : -2]
        self._last, self._begun = float(state.numbers[-2]), bool(state.numbers[-1])
        self._lines[0] = state.line

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
        if self._start == "steady" and not self._begun:
            self._states[:] = self._instance.start({"voltage": voltage}, self._step, "steady").flat
            self._lines[0] = voltage
        worst = self._steps(
            self._last,
            voltage,
            self._held,
            self._substeps,
            self._begun,
            self._step,
            self._machine,
            self._states,
            self._lines,
            self._out,
        )
        check_domain(self._instance, self._states, worst, "voltage")
        self._last, self._begun = voltage, True
        plus, minus, *inside, position = self._out.tolist()
        return Sample._make([voltage, plus, minus, plus - minus, *inside, position])
