"""What a simulation of a drive returns: a run whose signals have names and units."""

from __future__ import annotations

from enum import IntFlag
from functools import cached_property
from math import inf
from typing import TYPE_CHECKING, Literal, cast

import numpy as np
from numpy.typing import NDArray

from swashplate.drive.signals import FIRST_SIGNALS, MOTOR, SIGNALS, UNITS
from swashplate.errors import InputError
from swashplate.machine import Run
from swashplate.machine.marching import read_only
from swashplate.models.displacement_control import PUBLISHED_FORMS, Pump
from swashplate.results import Named, figures
from swashplate.tables import UNIT, Column, Table, share_cell
from swashplate.units import SHAFT_ANGLE, display_unit

if TYPE_CHECKING:
    import polars

    from swashplate.results import Figure

Array = NDArray[np.float64]
Flags = NDArray[np.uint8]


class Limit(IntFlag):
    """Limits that hold the drive back; several can act at once."""

    DEAD_ZONE = 1
    """The current is within the solenoids' dead zone: no force."""
    CURRENT_RATE = 2
    """A rate limit of the card sets the current."""
    ORIFICE = 4
    """The in-line orifice, not the spool, limits the flow, and the plate moves: the acceleration
    limit."""
    SPOOL = 8
    """The spool is at its stop."""
    SWASH_STOP = 16
    """The swash plate is at a stop: the speed limit."""
    RELIEF = 32
    """The relief valve holds the stroking pressure at ±Z15."""


SPOOL_STROKE = 0.01
"""What lengths of a run are at most, by which their unit is chosen. [m]"""


def _displayed(column: polars.Series) -> polars.Series:
    """A column of a run's table in the unit that people read, which its name then has."""
    name = column.name
    if name == "time":
        return column.alias("time [s]")
    if name not in UNITS:
        return column
    si = SHAFT_ANGLE if name == "shaft_position" else UNITS[name]
    # not by the numbers of the run: the same column has the same unit in every table
    unit = display_unit(si, SPOOL_STROKE if si == "m" else inf)
    return (column * unit.factor).alias(f"{name} [{unit.name}]" if unit.name else name)


class Simulation(Run):
    """Signals of one simulated record, read-only arrays of the record's length, all SI.

    Signs: positive voltage, current, force, opening, angle and speed go together; positive speed
    hoists, slews right, lifts the boom. The record is a voltage, or without a card a current.

    Examples
    --------
    >>> from swashplate import Drive, maneuvers
    >>> run = Drive.preset("hoist").simulate(maneuvers.step(9.0))
    >>> run.shaft_speed.shape  # rad/s, 10 s at 512 Hz
    (5121,)
    >>> frame = run.to_polars()
    >>> "shaft_speed" in frame.columns
    True
    """

    first_signals = FIRST_SIGNALS
    has_states = False
    plotted = ("shaft_speed",)

    limit_names = tuple(str(limit.name).lower() for limit in Limit)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The signals that it has: `SIGNALS`, with refinements the motor's, after ``"time"``."""
        signals = SIGNALS if self.driven_by == "voltage" else SIGNALS[1:]
        motor_signals: tuple[str, ...] = MOTOR
        if not self.refined:
            motor_signals = ()
        elif not self.pump.motor_constant > 0.0:
            motor_signals = motor_signals[:1]
        return ("time", *signals, *motor_signals)

    @property
    def pump(self) -> Pump:
        """Numbers of pump and motor."""
        pump: Pump = self.instance.parts[1].p
        return pump

    @property
    def refined(self) -> bool:
        """Whether an option beyond Kruse's equations is on, or the motor's constant known."""
        if self.pump.motor_constant > 0.0:
            return True
        options = self.instance.parts[1].options
        refinements = [name for name in options._fields if name not in PUBLISHED_FORMS]
        return any(getattr(options, name) is not None for name in refinements)

    @property
    def voltage(self) -> Array | None:
        """Command, None if a current was given instead. [V]"""
        return self["voltage"] if self.driven_by == "voltage" else None

    current_positive = Named()
    """Current of the solenoid towards positive speed, never negative. [A]"""
    current_negative = Named()
    """Current of the other solenoid, never negative. [A]"""
    current = Named()
    """Signed current, positive less negative; an ammeter reads the sum of both. [A]"""
    solenoid_force = Named()
    """Net force of both solenoids on the spool. [N]"""
    spool_position = Named()
    """Displacement of the spool, within its stroke. [m]"""
    orifice_opening = Named()
    """Effective opening, what the orifices leave of the spool's displacement. [m]"""
    stroker_pressure = Named()
    """Stroking pressure δP about its equilibrium. [Pa]"""
    swash_angle = Named()
    """Angle of the swash plate. [rad]"""
    shaft_speed = Named()
    """Speed of the shaft, of the turret for slew. [rad/s]"""
    shaft_position = Named()
    """Trapezoidal integral of the speed on the march's grid, zero at the start. [rad]"""

    @property
    def motor_torque(self) -> Array:
        """Torque that the motor bears, positive if it drives towards positive speed. [N m]"""
        return self.sampled(self.fine("motor_torque"))

    @property
    def motor_pressure_drop(self) -> Array | None:
        """P_hi - P_lo over the motor, None if no motor_constant is given. [Pa]"""
        return self["motor_pressure_drop"] if self.pump.motor_constant > 0.0 else None

    @cached_property
    def limits(self) -> Flags:
        """Limits that act at each sample, bits of `Limit`."""
        bits = np.zeros(self.time.size, dtype=np.uint8)
        for name in self.instance.model.limit_bits:
            bits |= super().active(name).astype(np.uint8) * np.uint8(Limit[name.upper()])
        return read_only(bits)

    def active(self, limit: Limit | str, *, fine: bool = False) -> NDArray[np.bool_]:
        """Samples at which a limit, or any of several, acts; also by name, ``"orifice"``.

        With `fine` points of the march's grid, for a limit by its name.

        Raises
        ------
        InputError
            If there is no such limit.
        """
        if fine:
            return super().active(str(limit), fine=True)
        if isinstance(limit, str):
            if limit.lower() not in self.limit_names:
                names = ", ".join(self.limit_names)
                raise InputError(f"There is no limit '{limit}'; there are {names}.")
            limit = Limit[limit.upper()]
        return np.asarray((self.limits & int(limit)) != 0)

    def held_back(self, limit: Limit) -> NDArray[np.bool_]:
        """(n,) samples at which a limit acts.

        Of the dead zone only samples with a command other than 0 count: at rest nothing is asked
        that it could hold back.
        """
        acts = self.active(limit)
        if limit == Limit.DEAD_ZONE:
            command = self.current if self.voltage is None else self.voltage
            acts = acts & (command != 0.0)
        return acts

    def time_share(self, limit: Limit) -> float:
        """Share of the samples at which a limit acts, 0 to 1; see `held_back`."""
        return float(self.held_back(limit).mean())

    def tables(self) -> tuple[Table, Table]:
        """Tabulate the motion of the drive, and how long each of its limits held it back."""
        did = Table("", (Column("Shaft"), Column("", "z.2f"), UNIT))
        position = float(self.shaft_position[-1])
        did.add("peak speed, positive", max(float(self.shaft_speed.max()), 0.0), unit="rad/s")
        did.add("peak speed, negative", min(float(self.shaft_speed.min()), 0.0), unit="rad/s")
        did.add("speed at the end", float(self.shaft_speed[-1]), unit="rad/s")
        did.add("position at the end", position, unit=SHAFT_ANGLE, spec="z.1f")
        if display_unit(SHAFT_ANGLE).name == "deg":
            did.add("", position / (2.0 * np.pi), unit="turns", spec="z.3f")
        peaks = {"positive": max(self.current.max(), 0.0), "negative": min(self.current.min(), 0.0)}
        for way, current in peaks.items():
            section = way == "positive"
            did.add(f"peak current, {way}", float(current), unit="A", spec="z.4f", section=section)
        limits = Table("", (Column("Limit"), Column("share of time", ".1%")))
        for limit in Limit:
            name = str(limit.name).lower().replace("_", " ")
            limits.add(name, share_cell(self.time_share(limit)))
        return did, limits

    def to_polars(self, units: Literal["SI", "display"] = "SI") -> polars.DataFrame:
        """Table of time, all signals and a true/false column ``limit_NAME`` for each limit.

        Parameters
        ----------
        units : {"SI", "display"}
            SI, or the units that the terminal shows: ``"shaft_speed [deg/s]"``, each named in its
            column's name.
        """
        frame = super().to_polars()
        if units == "SI":
            return frame
        if units != "display":
            raise InputError(f"units is {units!r}; it is 'SI' or 'display'.")
        return frame.select(map(_displayed, frame.iter_columns()))

    def _overview(
        self, *, label: str, window: tuple[float, float] | None, title: str | None
    ) -> Figure:
        """Figure of the chain with its active limits shaded."""
        return cast("Figure", figures().plot_simulation(self, window=window, title=title))
