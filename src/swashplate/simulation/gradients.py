"""Simulation with sensitivities: outputs and their exact derivatives by chosen parameters."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import InputError
from swashplate.parameters.parameter_set import ParameterSet, columns_of
from swashplate.simulation.build import ALL_PARAMETERS, build, build_pump
from swashplate.simulation.constants import CHANNEL_PARAMETERS, PUMP_PARAMETERS, Pump
from swashplate.simulation.record import Record
from swashplate.simulation.result import CardSignals, Simulation
from swashplate.simulation.run import Start, check_domain, drive_start, pump_start
from swashplate.simulation.sensitivities import (
    integrate_rows,
    march_drive_sensitivities,
    march_pump_sensitivities,
    steady_pump_tangent,
    steady_tangent,
)
from swashplate.simulation.tangent import N_ALL, N_CHANNEL, N_PUMP, TAU, Z1, Z2

Array = NDArray[np.float64]

OUTPUTS = ("current", "current_positive", "current_negative", "shaft_speed", "shaft_position")
"""Signals that have sensitivities."""


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Derivatives of the outputs by parameters, one column for each of `names`.

    The unit of a column is the output's over the parameter's, both SI. At a switch (the edge of a
    dead zone, a limit just reached) they are the one-sided derivatives that the components declare.
    """

    simulation: Simulation
    """The plain simulation, the same to the last bit as without sensitivities."""
    names: tuple[str, ...]
    """Columns such as ``Z16_plus``, in the order asked for."""
    by_speed: Array
    """Columns of the speed, on the march's grid."""
    by_currents: tuple[Array, Array] | None = None
    """Columns of the channels' currents, on the march's grid; None where a current was given."""

    def __repr__(self) -> str:
        return f"Sensitivities({self.simulation!r}, by {', '.join(self.names)})"

    def _wanted(self, columns: Array) -> Array:
        """The columns asked for, without a copy where they are neighbours."""
        chosen = [ALL_PARAMETERS.index(name) for name in self.names]
        if chosen == list(range(chosen[0], chosen[0] + len(chosen))):
            return columns[:, chosen[0] : chosen[0] + len(chosen)]
        return np.take(columns, chosen, axis=1)

    def _channel(self, side: str) -> Array:
        chosen = np.zeros((self.simulation.time.size, len(self.names)))
        if self.by_currents is None:
            return chosen
        columns = self.by_currents[0 if side == "plus" else 1]
        for j, name in enumerate(self.names):
            symbol = name.removesuffix(f"_{side}")
            if name == "tau":
                chosen[:, j] = columns[:: self.simulation.record.substeps, TAU]
            elif symbol != name and symbol in CHANNEL_PARAMETERS:
                k = CHANNEL_PARAMETERS.index(symbol)
                chosen[:, j] = columns[:: self.simulation.record.substeps, k]
        return chosen

    @cached_property
    def current_positive(self) -> Array:
        """(n, k) derivatives of the positive channel's current. [A/...]"""
        return self._channel("plus")

    @cached_property
    def current_negative(self) -> Array:
        """(n, k) derivatives of the negative channel's current, a magnitude. [A/...]"""
        return self._channel("minus")

    @cached_property
    def current(self) -> Array:
        """(n, k) derivatives of the signed current. [A/...]"""
        return self.current_positive - self.current_negative

    @cached_property
    def shaft_speed(self) -> Array:
        """(n, k) derivatives of the speed. [(rad/s)/...]"""
        return self._wanted(self.by_speed[:: self.simulation.record.substeps])

    @cached_property
    def shaft_position(self) -> Array:
        """(n, k) derivatives of the position. [rad/...]"""
        rate = np.ascontiguousarray(self._wanted(self.by_speed))
        integral = np.zeros_like(rate)
        integrate_rows(rate, self.simulation.record.step, integral)
        return integral[:: self.simulation.record.substeps]

    def at(self, time: ArrayLike, output: str) -> Array:
        """(m, k) derivatives of an output at other time stamps, by linear interpolation.

        Parameters
        ----------
        time : (m,) array_like
            Time stamps. [s]
        output : str
            One of `OUTPUTS`.
        """
        rows = getattr(self, output)
        stamps = np.asarray(time, dtype=np.float64)
        return np.column_stack(
            [np.interp(stamps, self.simulation.time, column) for column in rows.T]
        )


def drive_sensitivities(
    parameters: ParameterSet, record: Record, start: Start, names: Sequence[str] | None
) -> Sensitivities:
    """Card and pump with derivatives; see `Drive.sensitivities`."""
    chosen = _chosen(names, ALL_PARAMETERS)
    delay, plus, minus, pump, step = build(parameters, record.step)
    command = record.values
    d_plus, d_minus = np.zeros(N_CHANNEL + 1), np.zeros(N_CHANNEL + 1)
    before, state = drive_start(command, plus, minus, pump, start)
    d_pressure = rest_tangent(pump, N_ALL)
    if start == "steady":
        steady_tangent(before, plus, minus, pump, step, state, d_plus, d_minus, d_pressure)
    n = command.size
    current_plus, current_minus, pressure, speed = (np.empty(n) for _ in range(4))
    by_currents = (np.empty((n, N_CHANNEL + 1)), np.empty((n, N_CHANNEL + 1)))
    by_speed = np.empty((n, N_ALL))
    flags = np.empty(n, dtype=np.uint8)
    worst = march_drive_sensitivities(
        command,
        before,
        delay,
        plus,
        minus,
        pump,
        step,
        state,
        d_plus,
        d_minus,
        d_pressure,
        current_plus,
        current_minus,
        pressure,
        speed,
        flags,
        *by_currents,
        by_speed,
    )
    check_domain(parameters.name, worst, "voltage")
    card = CardSignals(current_plus, current_minus, flags)
    simulation = Simulation(parameters.name, record, pump, pressure, card)
    return Sensitivities(simulation, chosen, by_speed, by_currents)


def pump_sensitivities(
    parameters: ParameterSet, record: Record, start: Start, names: Sequence[str] | None
) -> Sensitivities:
    """Pump alone with derivatives; see `Drive.sensitivities_current`."""
    chosen = _chosen(names, PUMP_PARAMETERS)
    foreign = [name for name in chosen if name not in PUMP_PARAMETERS]
    if foreign:
        raise InputError(
            f"A current drives the pump alone, which does not depend on {', '.join(foreign)}."
        )
    pump = build_pump(parameters)
    current = record.values
    state, d_pressure = pump_start(current, pump, start), rest_tangent(pump, N_PUMP)
    if start == "steady":
        steady_pump_tangent(float(current[0]), pump, record.step, state, d_pressure)
    pressure, speed = np.empty_like(current), np.empty_like(current)
    by_speed = np.empty((current.size, N_PUMP))
    worst = march_pump_sensitivities(
        current, pump, record.step, state, d_pressure, pressure, speed, by_speed
    )
    check_domain(parameters.name, worst, "current")
    simulation = Simulation(parameters.name, record, pump, pressure)
    return Sensitivities(simulation, chosen, by_speed)


def _chosen(names: Sequence[str] | None, everything: tuple[str, ...]) -> tuple[str, ...]:
    if names is None:
        return everything
    if isinstance(names, str) or not names:
        raise InputError("Name at least one parameter to differentiate by, in a list.")
    return tuple(columns_of(list(names)))


def rest_tangent(pump: Pump, size: int) -> Array:
    """Derivatives of the pressure at rest, Z2/Z1."""
    tangent = np.zeros(size)
    tangent[Z1] = -pump.Z2 / (pump.Z1 * pump.Z1)
    tangent[Z2] = 1.0 / pump.Z1
    return tangent
