"""What a full-order simulation returns: the five states and everything that follows from them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.record import Record
from swashplate.full_order.machine import Plate
from swashplate.full_order.march import ACCOUNTS, N_STATES
from swashplate.full_order.observe import observe_flows, observe_speeds
from swashplate.simulation.result import read_only

if TYPE_CHECKING:
    import polars

    from swashplate.full_order.balances import Balances

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


@dataclass(frozen=True, eq=False)
class FullOrderSimulation:
    """Signals of one record, read-only arrays of the record's length, all SI.

    Signs are those of `swashplate.Simulation`. The motor's pressure drop is positive where the
    load resists positive speed.
    """

    name: str
    """Name of the physical set."""
    method: str
    """How it was integrated: ``"march"``, ``"radau"`` or ``"lsoda"``."""
    record: Record
    """The signed current, on the grid that was marched. [A]"""
    machine: Plate
    force: Array
    """Net solenoid force on that grid. [N]"""
    rows: Array
    """States and accounts on that grid, a row a sample; see `swashplate.full_order.march`."""
    holds: Flags
    """Limits that hold on that grid: spool at its stroke, relief valve, swash plate at a stop."""
    losses: Array
    """Energy that the stops of spool and swash plate have taken so far, on that grid. [J]"""
    events: int
    """How often a limit began or ceased to hold."""
    rest_pressure: float
    """Stroker pressure P0 that holds the load at rest. [Pa]"""

    def __repr__(self) -> str:
        return f"FullOrderSimulation({self.name!r}, {self.time.size} samples, {self.method})"

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
        return self._sampled(self.force)

    @cached_property
    def spool_position(self) -> Array:
        """Displacement of the spool. [m]"""
        return self._sampled(self.rows[:, 0])

    @cached_property
    def spool_velocity(self) -> Array:
        """Velocity of the spool. [m/s]"""
        return self._sampled(self.rows[:, 1])

    @cached_property
    def stroker_pressure(self) -> Array:
        """Stroking pressure δP about the one that holds the load at rest. [Pa]"""
        return self._sampled(self.rows[:, 2] - self.rest_pressure)

    @cached_property
    def swash_angle(self) -> Array:
        """Angle of the swash plate. [rad]"""
        return self._sampled(self.rows[:, 3])

    @cached_property
    def swash_rate(self) -> Array:
        """Rate of the swash plate. [rad/s]"""
        return self._sampled(self.rows[:, 4])

    @cached_property
    def shaft_speed(self) -> Array:
        """Speed of the shaft, of the turret for slew. [rad/s]"""
        speed = np.empty(self.rows.shape[0])
        observe_speeds(self.rows, self.machine.p, speed)
        return self._sampled(speed)

    @cached_property
    def shaft_position(self) -> Array:
        """Angle of the shaft, zero at the start. [rad]"""
        return self.account("shaft_position")

    @cached_property
    def _flows(self) -> tuple[Array, Array]:
        opening, flow = np.empty((2, self.rows.shape[0]))
        observe_flows(self.rows, self.machine.p, self.machine.symmetric, opening, flow)
        return self._sampled(opening), self._sampled(flow)

    @property
    def orifice_opening(self) -> Array:
        """Effective opening, what the orifices leave of the spool's displacement. [m]"""
        return self._flows[0]

    @property
    def valve_flow(self) -> Array:
        """Flow through the valve towards the stroking piston. [m³/s]"""
        return self._flows[1]

    @cached_property
    def motor_pressure_drop(self) -> Array:
        """Pressure drop across the motor, P_hi - P_lo, under load inertia and gravity. [Pa]"""
        m = self.machine.p
        torque = (
            m.load_inertia * m.motor_constant * m.pump_flow_gain * self.swash_rate + m.load_torque
        )
        return read_only(m.motor_constant * torque)

    @cached_property
    def pump_flow(self) -> Array:
        """Flow of the pump to the motor. [m³/s]"""
        return read_only(self.machine.p.pump_flow_gain * self.swash_angle)

    def account(self, name: str) -> Array:
        """What has passed since the start, one of `swashplate.full_order.march.ACCOUNTS`."""
        return self._sampled(self.rows[:, N_STATES + ACCOUNTS.index(name)])

    @property
    def plate_hold(self) -> Flags:
        """1 or -1 where the swash plate rests on a stop."""
        return self.holds[:: self.record.substeps, 2]

    @property
    def relief_hold(self) -> Flags:
        """1 or -1 where the relief valve holds the stroker pressure."""
        return self.holds[:: self.record.substeps, 1]

    @property
    def spool_hold(self) -> Flags:
        """1 or -1 where the spool is at its stroke."""
        return self.holds[:: self.record.substeps, 0]

    def balances(self) -> Balances:
        """Energy and flow balances; see `swashplate.full_order.balances`."""
        from swashplate.full_order.balances import balances_of

        return balances_of(self)

    def to_polars(self) -> polars.DataFrame:
        """Table of time, all signals and the limits that hold."""
        import polars as pl

        columns: dict[str, NDArray[np.generic]] = {"time": self.time}
        columns.update((signal, getattr(self, signal)) for signal in SIGNALS)
        for limit in ("spool_hold", "relief_hold", "plate_hold"):
            columns[limit] = np.ascontiguousarray(getattr(self, limit))
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
