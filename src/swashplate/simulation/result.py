"""What a simulation returns: every signal of the chain, computed when it is first asked for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.simulation.constants import Pump
from swashplate.simulation.limits import Limit
from swashplate.simulation.march import (
    integrate,
    observe_inside,
    observe_limits,
    observe_speed,
)
from swashplate.simulation.record import Record

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


def read_only(array: NDArray[T]) -> NDArray[T]:
    """A view that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view


class CardSignals(NamedTuple):
    """What the card's march leaves on its grid."""

    current_positive: Array
    current_negative: Array
    rate_limited: Flags


class Inside(NamedTuple):
    """Signals inside the pump, one pass computes all of them."""

    solenoid_force: Array
    spool_position: Array
    orifice_opening: Array
    swash_angle: Array


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
    pump: Pump
    pressure: Array
    """δP on the march's grid. [Pa]"""
    card: CardSignals | None = None
    """The card's signals on the march's grid, None where a current was given."""

    def _sampled(self, fine: NDArray[T]) -> NDArray[T]:
        """Samples of the record out of the march's grid."""
        return np.ascontiguousarray(fine[:: self.record.substeps])

    def __repr__(self) -> str:
        samples = (self.record.values.size - 1) // self.record.substeps + 1
        return f"Simulation({self.name!r}, {samples} samples at {self.record.rate:g} Hz)"

    @property
    def driven_by_voltage(self) -> bool:
        """Whether the record is a voltage that went through the card."""
        return self.card is not None

    @cached_property
    def time(self) -> Array:
        """Time stamps. [s]"""
        return self.record.time

    @cached_property
    def voltage(self) -> Array | None:
        """Command, None where a current was given instead. [V]"""
        return read_only(self._sampled(self.record.values)) if self.driven_by_voltage else None

    @cached_property
    def current_positive(self) -> Array:
        """Current of the solenoid towards positive speed, never negative. [A]"""
        if self.card is None:
            return read_only(np.maximum(self.current, 0.0))
        return read_only(self._sampled(self.card.current_positive))

    @cached_property
    def current_negative(self) -> Array:
        """Current of the other solenoid, never negative. [A]"""
        if self.card is None:
            return read_only(np.maximum(-self.current, 0.0))
        return read_only(self._sampled(self.card.current_negative))

    @cached_property
    def _fine_current(self) -> Array:
        if self.card is None:
            return self.record.values
        return self.card.current_positive - self.card.current_negative

    @cached_property
    def current(self) -> Array:
        """Signed current, positive less negative; an ammeter reads the sum of both. [A]"""
        return read_only(self._sampled(self._fine_current))

    @cached_property
    def stroker_pressure(self) -> Array:
        """Stroking pressure δP about its equilibrium. [Pa]"""
        return read_only(self._sampled(self.pressure))

    @cached_property
    def _fine_speed(self) -> Array:
        speed = np.empty_like(self.pressure)
        # without Z12 the speed does not depend on the current, which then need not be made
        current = self._fine_current if self.pump.loaded else self.pressure
        observe_speed(current, self.pressure, self.pump, speed)
        return speed

    @cached_property
    def shaft_speed(self) -> Array:
        """Speed of the shaft, of the turret for slew. [rad/s]"""
        return read_only(self._sampled(self._fine_speed))

    @cached_property
    def shaft_position(self) -> Array:
        """Trapezoidal integral of the speed on the march's grid, zero at the start. [rad]"""
        position = np.empty_like(self._fine_speed)
        integrate(self._fine_speed, self.record.step, 0.0, position)
        return read_only(self._sampled(position))

    @cached_property
    def _inside(self) -> Inside:
        current, pressure = self._sampled(self._fine_current), self._sampled(self.pressure)
        signals = Inside(*(np.empty_like(pressure) for _ in Inside._fields))
        observe_inside(current, pressure, self.pump, *signals)
        return Inside(*(read_only(signal) for signal in signals))

    @property
    def solenoid_force(self) -> Array:
        """Net force of both solenoids on the spool. [N]"""
        return self._inside.solenoid_force

    @property
    def spool_position(self) -> Array:
        """Displacement of the spool, within its stroke. [m]"""
        return self._inside.spool_position

    @property
    def orifice_opening(self) -> Array:
        """Effective opening, what the orifices leave of the spool's displacement. [m]"""
        return self._inside.orifice_opening

    @property
    def swash_angle(self) -> Array:
        """Angle of the swash plate. [rad]"""
        return self._inside.swash_angle

    @cached_property
    def limits(self) -> Flags:
        """Limits that act at each sample, bits of `Limit`."""
        current, pressure = self._sampled(self._fine_current), self._sampled(self.pressure)
        flags, rate_limited = (np.zeros(pressure.size, dtype=np.uint8) for _ in range(2))
        if self.card is not None:
            rate_limited = self._sampled(self.card.rate_limited)
        observe_limits(current, pressure, rate_limited, self.pump, flags)
        return read_only(flags)

    def active(self, limit: Limit) -> NDArray[np.bool_]:
        """Samples at which a limit, or any of several, acts."""
        return np.asarray((self.limits & int(limit)) != 0)

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
        """Table of time, all signals and a true/false column for each limit."""
        import polars as pl

        columns: dict[str, NDArray[np.generic]] = {"time": self.time}
        for signal in SIGNALS:
            values = getattr(self, signal)
            if values is not None:
                columns[signal] = values
        for limit in Limit:
            columns[f"limit_{str(limit.name).lower()}"] = self.active(limit)
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
