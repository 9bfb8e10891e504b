"""What a simulation with five states returns: the states and everything that follows from them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.cache import kernel
from swashplate.equations.marching.record import Record
from swashplate.full_order.stiff import Case
from swashplate.models.full_order import Motion, PlantSignals, plant_signals
from swashplate.simulation.result import read_only

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
class FullOrderSimulation:
    """Signals of one record, read-only arrays of the record's length, all SI.

    Signs are those of `swashplate.Simulation`. The motor's pressure drop is positive where the
    load resists positive speed.
    """

    name: str
    """Name of the physical set."""
    method: str
    """How it was integrated: ``"march"`` or ``"radau"``."""
    record: Record
    """The signed current, on the grid that was marched. [A]"""
    case: Case
    """The machine."""
    states: Array
    """(n, 5) the states on that grid, in the order of `swashplate.models.full_order.Motion`."""

    def __repr__(self) -> str:
        return f"FullOrderSimulation({self.name!r}, {self.time.size} samples, {self.method})"

    @cached_property
    def _signals(self) -> dict[str, Array]:
        """All signals on the grid that was marched."""
        out = np.empty((self.states.shape[0], len(PlantSignals._fields)))
        observe(self.states, self.record.values, self.case, out)
        return {
            name: np.ascontiguousarray(out[:, c]) for c, name in enumerate(PlantSignals._fields)
        }

    def _sampled(self, fine: Array) -> Array:
        return read_only(np.ascontiguousarray(fine[:: self.record.substeps]))

    @cached_property
    def time(self) -> Array:
        """Time stamps. [s]"""
        return self.record.time

    @cached_property
    def current(self) -> Array:
        """Signed current. [A]"""
        return self._sampled(self.record.values)

    @cached_property
    def solenoid_force(self) -> Array:
        """Net force of both solenoids on the spool. [N]"""
        return self._sampled(self._signals["solenoid_force"])

    @cached_property
    def spool_position(self) -> Array:
        """Displacement of the spool. [m]"""
        return self._sampled(self._signals["spool_position"])

    @cached_property
    def spool_velocity(self) -> Array:
        """Velocity of the spool. [m/s]"""
        return self._sampled(self._signals["spool_velocity"])

    @cached_property
    def orifice_opening(self) -> Array:
        """Effective opening, what the orifices leave of the spool's displacement. [m]"""
        return self._sampled(self._signals["orifice_opening"])

    @cached_property
    def valve_flow(self) -> Array:
        """Flow through the valve towards the stroking piston. [m³/s]"""
        return self._sampled(self._signals["valve_flow"])

    @cached_property
    def stroker_pressure(self) -> Array:
        """Stroking pressure δP about the one that holds the load at rest. [Pa]"""
        return self._sampled(self._signals["stroker_pressure"])

    @cached_property
    def swash_angle(self) -> Array:
        """Angle of the swash plate. [rad]"""
        return self._sampled(self._signals["swash_angle"])

    @cached_property
    def swash_rate(self) -> Array:
        """Rate of the swash plate. [rad/s]"""
        return self._sampled(self._signals["swash_rate"])

    @cached_property
    def shaft_speed(self) -> Array:
        """Speed of the shaft, of the turret for slew. [rad/s]"""
        return self._sampled(self._signals["shaft_speed"])

    @cached_property
    def shaft_position(self) -> Array:
        """Angle of the shaft, zero at the start: the trapezoidal integral of its speed. [rad]"""
        speed = self._signals["shaft_speed"]
        turned = np.zeros_like(speed)
        np.cumsum(0.5 * self.record.step * (speed[:-1] + speed[1:]), out=turned[1:])
        return self._sampled(turned)

    @cached_property
    def motor_pressure_drop(self) -> Array:
        """Pressure drop across the motor, P_hi - P_lo, under load inertia and gravity. [Pa]"""
        return self._sampled(self._signals["motor_pressure_drop"])

    @cached_property
    def pump_flow(self) -> Array:
        """Flow of the pump to the motor. [m³/s]"""
        return self._sampled(self._signals["pump_flow"])

    @property
    def spool_hold(self) -> Flags:
        """1 or -1 where the spool is at its stroke."""
        stroke = self.case.p.machine.spool_stroke
        return _beyond(self.spool_position, -stroke, stroke)

    @property
    def relief_hold(self) -> Flags:
        """1 or -1 where the relief valve holds the stroker pressure."""
        pressure = self._sampled(self._signals["piston_pressure"])
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

    def write(self, path: str | Path) -> None:
        """Write the table of `to_polars` as CSV or Parquet, by the path's ending.

        Raises
        ------
        FileError
            For another ending, or a folder that cannot be written.
        """
        from swashplate.tables import write_table

        write_table(self.to_polars(), path)


HOLDS = ("spool_hold", "relief_hold", "plate_hold")
"""Limits that can hold."""


def _beyond(values: Array, lower: float, upper: float) -> Flags:
    return (values >= upper).astype(np.int8) - (values <= lower).astype(np.int8)
