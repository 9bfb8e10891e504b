"""What a simulation with five states returns: the states and everything that follows from them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.cache import kernel
from swashplate.full_order.continuous import Case
from swashplate.models.full_order import Motion, PlantSignals, plant_signals
from swashplate.simulation.result import Signal, Signals

if TYPE_CHECKING:
    import polars

Array = NDArray[np.float64]
Flags = NDArray[np.int8]

SIGNALS = (
    "current",
    "solenoid_force",
    "spool_position",
    "spool_velocity",
    "orifice_opening",
    "valve_flow",
    "stroker_pressure",
    "swash_angle",
    "swash_rate",
    "shaft_speed",
    "shaft_position",
    "motor_pressure_drop",
    "pump_flow",
)
"""Signals in the order of the chain."""


@kernel
def observe(states: Array, current: Array, case: Case, out: Array) -> None:
    """Every signal of `PlantSignals`, a column each, at known states (n, 5)."""
    for n in range(current.size):
        motion = Motion(states[n, 0], states[n, 1], states[n, 2], states[n, 3], states[n, 4])
        found = plant_signals(motion, current[n], case.p, case.k, case.options)
        for c in range(len(found)):
            out[n, c] = found[c]


@dataclass(frozen=True, eq=False)
class FullOrderSimulation(Signals):
    """Signals of one record, read-only arrays of the record's length, all SI.

    Signs are those of `swashplate.Simulation`. The record is the signed current. The motor's
    pressure drop is positive where the load resists positive speed.
    """

    method: str
    """How it was integrated: ``"march"`` or ``"radau"``."""
    case: Case
    """The machine."""
    states: Array
    """(n, 5) the states on that grid, in the order of `swashplate.models.full_order.Motion`."""

    def __repr__(self) -> str:
        return f"FullOrderSimulation({self.name!r}, {self.time.size} samples, {self.method})"

    @cached_property
    def _fine(self) -> dict[str, Array]:
        """All signals on the grid that was marched."""
        out = np.empty((len(PlantSignals._fields), self.states.shape[0]))
        observe(self.states, self.record.values, self.case, out.T)
        return {"current": self.record.values, **dict(zip(PlantSignals._fields, out, strict=True))}

    def fine(self, signal: str) -> Array:
        """A signal on the march's grid: one of `SIGNALS`, or the ``"piston_pressure"``."""
        return self.turned() if signal == "shaft_position" else self._fine[signal]

    current = Signal()
    """Signed current. [A]"""
    solenoid_force = Signal()
    """Net force of both solenoids on the spool. [N]"""
    spool_position = Signal()
    """Displacement of the spool. [m]"""
    spool_velocity = Signal()
    """Velocity of the spool. [m/s]"""
    orifice_opening = Signal()
    """Effective opening, what the orifices leave of the spool's displacement. [m]"""
    valve_flow = Signal()
    """Flow through the valve towards the stroking piston. [m³/s]"""
    stroker_pressure = Signal()
    """Stroking pressure δP about the one that holds the load at rest. [Pa]"""
    swash_angle = Signal()
    """Angle of the swash plate. [rad]"""
    swash_rate = Signal()
    """Rate of the swash plate. [rad/s]"""
    shaft_speed = Signal()
    """Speed of the shaft, of the turret for slew. [rad/s]"""
    shaft_position = Signal()
    """Angle of the shaft, zero at the start: the trapezoidal integral of its speed. [rad]"""
    motor_pressure_drop = Signal()
    """Pressure drop across the motor, P_hi - P_lo, under load inertia and gravity. [Pa]"""
    pump_flow = Signal()
    """Flow of the pump to the motor. [m³/s]"""

    @property
    def spool_hold(self) -> Flags:
        """1 or -1 where the spool is at its stroke."""
        stroke = self.case.p.machine.spool_stroke
        return _beyond(self.spool_position, -stroke, stroke)

    @property
    def relief_hold(self) -> Flags:
        """1 or -1 where the relief valve holds the stroker pressure."""
        pressure = self.sampled(self.fine("piston_pressure"))
        return _beyond(pressure, self.case.k.lower, self.case.k.upper)

    @property
    def plate_hold(self) -> Flags:
        """1 or -1 where the swash plate rests on a stop."""
        m = self.case.p.machine
        return _beyond(self.swash_angle, -m.swash_stop_minus, m.swash_stop_plus)

    def to_polars(self) -> polars.DataFrame:
        """Table of time, all signals and the limits that hold."""
        import polars as pl

        columns: dict[str, NDArray[np.generic]] = {"time": self.time}
        columns.update((signal, getattr(self, signal)) for signal in SIGNALS)
        columns.update((limit, getattr(self, limit)) for limit in HOLDS)
        return pl.DataFrame(columns)


HOLDS = ("spool_hold", "relief_hold", "plate_hold")
"""Limits that can hold."""


def _beyond(values: Array, lower: float, upper: float) -> Flags:
    return (values >= upper).astype(np.int8) - (values <= lower).astype(np.int8)
