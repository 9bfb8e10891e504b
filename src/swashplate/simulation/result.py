"""What a simulation returns: every signal of the chain, computed when it is first asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntFlag
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.equations.marching.march import Stored
from swashplate.equations.marching.record import Record
from swashplate.equations.marching.run import Instance, observe_kernel
from swashplate.models.pump import Pump

if TYPE_CHECKING:
    import polars
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Flags = NDArray[np.uint8]
T = TypeVar("T", bound=np.generic)

SIGNALS = (
    "voltage",
    "current",
    "current_positive",
    "current_negative",
    "solenoid_force",
    "spool_position",
    "orifice_opening",
    "stroker_pressure",
    "swash_angle",
    "shaft_speed",
    "shaft_position",
)
"""Signals of a simulation in the order of the chain."""
INSIDE = ("solenoid_force", "spool_position", "orifice_opening", "swash_angle")
"""Signals inside the pump that are computed in one pass."""
MOTOR = ("motor_torque", "motor_pressure_drop")


class Limit(IntFlag):
    """What holds the drive back; several can act at once."""

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


def read_only(array: NDArray[T]) -> NDArray[T]:
    """A view that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view


@dataclass(frozen=True, eq=False)
class Simulation:
    """Signals of one simulated record, read-only arrays of the record's length, all SI.

    Signs: positive voltage, current, force, opening, angle and speed go together; positive speed
    hoists, slews right, lifts the boom.
    """

    name: str
    """Name of the parameter set."""
    record: Record
    """The input on the march's grid: a voltage, or without a card a signed current."""
    instance: Instance = field(repr=False)
    """The model with its numbers."""
    driven_by: str
    """``"voltage"`` or ``"current"``."""
    kept: tuple[Stored, ...] = field(repr=False)
    """What the march left on its grid, in the order of `out`."""
    out: Array = field(repr=False)
    flags: Flags = field(repr=False)
    measured: Mapping[str, Array] = field(default_factory=dict, repr=False)
    """Further inputs that were given as signals, on the march's grid."""

    def _sampled(self, fine: NDArray[T]) -> NDArray[T]:
        """Samples of the record out of the march's grid."""
        return np.ascontiguousarray(fine[:: self.record.substeps])

    def __repr__(self) -> str:
        samples = (self.record.values.size - 1) // self.record.substeps + 1
        return f"Simulation({self.name!r}, {samples} samples at {self.record.rate:g} Hz)"

    @property
    def driven_by_voltage(self) -> bool:
        """Whether the record is a voltage that went through the card."""
        return self.driven_by == "voltage"

    @property
    def pump(self) -> Pump:
        """Numbers of pump and motor."""
        made: Pump = self.instance.parts[1].p
        return made

    @property
    def refined(self) -> bool:
        """Whether an option beyond the source's equations is on."""
        options = self.instance.parts[1].options
        names = ("friction", "hysteresis", "ripple", "damping", "leakage", "line")
        return any(getattr(options, name) is not None for name in names) or self.knows_pressure

    @property
    def knows_pressure(self) -> bool:
        """Whether a motor_constant is given, which makes a pressure drop of the torque."""
        return self.pump.motor_constant > 0.0

    @cached_property
    def time(self) -> Array:
        """Time stamps. [s]"""
        return self.record.time

    @cached_property
    def voltage(self) -> Array | None:
        """Command, None where a current was given instead. [V]"""
        return read_only(self._sampled(self.record.values)) if self.driven_by_voltage else None

    @cached_property
    def _fine(self) -> dict[str, Array]:
        """Signals on the march's grid, as far as they were asked for."""
        return {
            "current_positive": self.out[0],
            "current_negative": self.out[1],
        }

    def fine(self, signal: str) -> Array:
        """A signal on the march's grid, `substeps` points a sample.

        Parameters
        ----------
        signal : str
            One of `SIGNALS` from the current on, of the pump's further signals, or
            ``"current_sum"``.
        """
        found = self._fine
        if signal not in found:
            if signal == "current":
                found[signal] = (
                    found["current_positive"] - found["current_negative"]
                    if self.driven_by_voltage
                    else self.record.values
                )
            elif signal == "current_sum":
                found[signal] = found["current_positive"] + found["current_negative"]
            elif signal == "stroker_pressure":
                found[signal] = self.out[self.kept.index(Stored(1, "state", "pressure"))]
            elif signal == "shaft_position":
                speed = self.fine("shaft_speed")
                position = np.zeros_like(speed)
                np.cumsum(0.5 * self.record.step * (speed[:-1] + speed[1:]), out=position[1:])
                found[signal] = position
            else:
                group = next((each for each in (INSIDE, MOTOR) if signal in each), (signal,))
                out, _ = self._observed(tuple(Stored(1, "signals", each) for each in group))
                found |= dict(zip(group, out, strict=True))
        return found[signal]

    def _observed(self, wanted: tuple[Stored, ...]) -> tuple[Array, Flags]:
        """Signals of the pump at the states that the march left."""
        packed = sum(each.kind == "limits" for each in wanted)
        size = self.out.shape[1]
        out = np.empty((len(wanted) - packed, size))
        flags = np.empty((packed, size), dtype=np.uint8)
        kept, rows = self.kept, self.out
        if self.measured:
            kept = (*kept, *(Stored(1, "input", name) for name in self.measured))
            rows = np.vstack([rows, *self.measured.values()])
        kept = tuple(each for each in kept if each.kind != "limits")
        signals = (self.driven_by, *self.measured)
        instance = self.instance
        observe_kernel(instance.model, 1, signals, instance.options, kept, wanted)(
            instance.params, instance.given, self.record.step, rows, out, flags
        )
        return out, flags

    def _signal(self, name: str) -> Array:
        return read_only(self._sampled(self.fine(name)))

    @cached_property
    def current_positive(self) -> Array:
        """Current of the solenoid towards positive speed, never negative. [A]"""
        return self._signal("current_positive")

    @cached_property
    def current_negative(self) -> Array:
        """Current of the other solenoid, never negative. [A]"""
        return self._signal("current_negative")

    @cached_property
    def current(self) -> Array:
        """Signed current, positive less negative; an ammeter reads the sum of both. [A]"""
        return self._signal("current")

    @cached_property
    def solenoid_force(self) -> Array:
        """Net force of both solenoids on the spool. [N]"""
        return self._signal("solenoid_force")

    @cached_property
    def spool_position(self) -> Array:
        """Displacement of the spool, within its stroke. [m]"""
        return self._signal("spool_position")

    @cached_property
    def orifice_opening(self) -> Array:
        """Effective opening, what the orifices leave of the spool's displacement. [m]"""
        return self._signal("orifice_opening")

    @cached_property
    def stroker_pressure(self) -> Array:
        """Stroking pressure δP about its equilibrium. [Pa]"""
        return self._signal("stroker_pressure")

    @cached_property
    def swash_angle(self) -> Array:
        """Angle of the swash plate. [rad]"""
        return self._signal("swash_angle")

    @cached_property
    def shaft_speed(self) -> Array:
        """Speed of the shaft, of the turret for slew. [rad/s]"""
        return self._signal("shaft_speed")

    @cached_property
    def shaft_position(self) -> Array:
        """Trapezoidal integral of the speed on the march's grid, zero at the start. [rad]"""
        return self._signal("shaft_position")

    @cached_property
    def motor_torque(self) -> Array:
        """Torque that the motor bears, positive where it drives towards positive speed. [N m]"""
        return self._signal("motor_torque")

    @cached_property
    def motor_pressure_drop(self) -> Array | None:
        """P_hi - P_lo over the motor, None where no motor_constant is given. [Pa]"""
        return self._signal("motor_pressure_drop") if self.knows_pressure else None

    @cached_property
    def limits(self) -> Flags:
        """Limits that act at each sample, bits of `Limit`."""
        _, flags = self._observed((Stored(1, "limits"),))
        # the pump's limits in their order, with the card's between the first and the second
        pump = flags[0]
        bits = (pump & 1) | ((pump & 0b11110) << 1)
        if self.driven_by_voltage:
            bits = bits | (self.flags[0] << 1)
        return read_only(self._sampled(bits.astype(np.uint8)))

    def active(self, limit: Limit) -> NDArray[np.bool_]:
        """Samples at which a limit, or any of several, acts."""
        return np.asarray((self.limits & int(limit)) != 0)

    def rate_limited(self) -> NDArray[np.bool_]:
        """Points of the march's grid at which a rate limit of the card sets a current."""
        return np.asarray(self.flags[0] > 0)

    def at(self, time: ArrayLike, signal: str) -> Array:
        """A signal at other time stamps, by linear interpolation.

        Parameters
        ----------
        time : (m,) array_like
            Time stamps; outside the record its first or last value is held. [s]
        signal : str
            One of `SIGNALS`.
        """
        stamps = np.asarray(time, dtype=np.float64)
        return np.asarray(np.interp(stamps, self.time, getattr(self, signal)))

    def to_polars(self) -> polars.DataFrame:
        """Table of time, all signals and a true/false column for each limit.

        With refinements the motor's torque and, if known, its pressure drop follow.
        """
        import polars as pl

        columns: dict[str, NDArray[np.generic]] = {"time": self.time}
        for signal in SIGNALS:
            values = getattr(self, signal)
            if values is not None:
                columns[signal] = values
        for limit in Limit:
            columns[f"limit_{str(limit.name).lower()}"] = self.active(limit)
        if self.refined:
            columns["motor_torque"] = self.motor_torque
            if self.motor_pressure_drop is not None:
                columns["motor_pressure_drop"] = self.motor_pressure_drop
        return pl.DataFrame(columns)

    def write(self, path: str | Path) -> None:
        """Write the table of `to_polars` as CSV or Parquet, by the path's ending.

        The file appears whole or not at all: it is written beside and renamed.

        Raises
        ------
        FileError
            For another ending, or a folder that cannot be written.
        """
        from swashplate.tables import write_table

        write_table(self.to_polars(), path)

    def plot(self) -> Figure:
        """Figure of the chain's signals with the active limits shaded."""
        from swashplate.report.figures import plot_simulation

        return plot_simulation(self)
