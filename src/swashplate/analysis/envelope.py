"""The envelope of a drive: what it can do each way, from the dead zone to the speed limit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from swashplate.analysis.acceleration import (
    AcceleratedBy,
    AccelerationCurve,
    acceleration_curve,
    speed_limits,
    starting_acceleration,
)
from swashplate.analysis.steady_edges import dead_zone, saturation
from swashplate.drive import Drive
from swashplate.equations.marching.record import SOURCE_RATE
from swashplate.parameters.rules import FULL_VOLTAGE

if TYPE_CHECKING:
    import polars


GAIN_POINTS = 401
"""Commands between dead zone and saturation at which the gain is taken."""
LOW, HIGH = 0.1, 0.9
"""Parts of the change of speed between which a rise time counts."""
SHORTEST, LONGEST = 8.0, 256.0
"""A step lasts so long at first, and at most, until the speed has come to stay. [s]"""


class Times(NamedTuple):
    """How fast a full step is answered. [s]"""

    rise: float
    """From 10 % to 90 % of the change of speed."""
    reach: float
    """From the command to 90 % of the change."""


@dataclass(frozen=True)
class Way:
    """What a drive can do one way; everything carries that way's sign, gains are positive. SI."""

    dead_zone: float
    """Largest command that moves nothing. [V]"""
    smallest_speed: float
    """Steady speed just beyond it: nothing slower can be held, save the creep. [rad/s]"""
    gain: float | None
    """Mean slope of the steady map from the dead zone to saturation or ±10 V. [rad/(s V)]"""
    gain_range: tuple[float, float] | None
    """Smallest and largest slope there. [rad/(s V)]"""
    saturation_voltage: float | None
    """Command beyond which the speed stays; None where it grows up to ±10 V. [V]"""
    top_speed: float
    """Steady speed at ±10 V. [rad/s]"""
    speed_limit: float
    """Speed with the swash plate at its stop, or where Z15 holds the pressure. [rad/s]"""
    acceleration: float
    """At rest, under ±10 V. [rad/s²]"""
    accelerated_by: AcceleratedBy
    """What sets it."""
    starting: Times | None
    """From rest under a step to ±10 V; None where nothing moves."""
    stopping: Times | None
    """From there after the command is gone."""


@dataclass(frozen=True, eq=False)
class Envelope:
    """What a drive can do."""

    name: str
    """Name of the drive."""
    creep: float
    """Steady speed at 0 V. [rad/s]"""
    plus: Way
    minus: Way
    accelerating: tuple[AccelerationCurve, AccelerationCurve]
    """Largest acceleration over the speed under +10 V and -10 V."""
    released: AccelerationCurve
    """Acceleration over the speed with the stick let go."""

    def to_polars(self) -> polars.DataFrame:
        """Table in SI: ``quantity``, ``unit``, ``plus``, ``minus``; null where there is none."""
        import polars as pl

        rows = [
            (quantity, unit, *(read(way) for way in (self.plus, self.minus)))
            for quantity, unit, read in QUANTITIES
        ]
        rows.insert(0, ("creep", "rad/s", self.creep, self.creep))
        names = dict.fromkeys(("quantity", "unit"), pl.String)
        return pl.DataFrame(
            rows, schema=names | dict.fromkeys(("plus", "minus"), pl.Float64), orient="row"
        )

    def write(self, path: str | Path) -> None:
        """Write the table of `to_polars` as CSV or Parquet, by the path's ending.

        Raises
        ------
        FileError
            For another ending or a place that cannot be written.
        """
        from swashplate.tables import write_table

        write_table(self.to_polars(), path)


def _time_of(
    step: Literal["starting", "stopping"], which: Literal["rise", "reach"]
) -> Callable[[Way], float | None]:
    def read(way: Way) -> float | None:
        times = way.starting if step == "starting" else way.stopping
        if times is None:
            return None
        return times.rise if which == "rise" else times.reach

    return read


QUANTITIES: tuple[tuple[str, str, Callable[[Way], float | None]], ...] = (
    ("dead_zone", "V", lambda way: way.dead_zone),
    ("smallest_speed", "rad/s", lambda way: way.smallest_speed),
    ("gain", "rad/(s V)", lambda way: way.gain),
    ("smallest_gain", "rad/(s V)", lambda way: way.gain_range and way.gain_range[0]),
    ("largest_gain", "rad/(s V)", lambda way: way.gain_range and way.gain_range[1]),
    ("saturation_voltage", "V", lambda way: way.saturation_voltage),
    ("top_speed", "rad/s", lambda way: way.top_speed),
    ("speed_limit", "rad/s", lambda way: way.speed_limit),
    ("acceleration", "rad/s^2", lambda way: way.acceleration),
    ("starting_rise", "s", _time_of("starting", "rise")),
    ("starting_reach", "s", _time_of("starting", "reach")),
    ("stopping_rise", "s", _time_of("stopping", "rise")),
    ("stopping_reach", "s", _time_of("stopping", "reach")),
)
"""Rows of the table: name, unit and where the value is."""


def envelope(drive: Drive) -> Envelope:
    """What a drive can do each way.

    Parameters
    ----------
    drive : Drive
        The drive.

    Returns
    -------
    Envelope
        Dead zone, creep, gains, limits of speed and acceleration, times of a full step.

    Notes
    -----
    Steady values come from the steady map, the acceleration at rest is
    Z10 Z1 Z8 √(Z9/2) Z16/(1 + Z6) where the orifice limits it (Kruse 2001, eqs. 6.67 to 6.71), and
    the times are those of a simulated step.
    """
    curves = (
        acceleration_curve(drive, FULL_VOLTAGE),
        acceleration_curve(drive, -FULL_VOLTAGE),
    )
    low, high = speed_limits(drive)
    return Envelope(
        drive.name,
        float(drive.steady_speed(0.0)),
        _way(drive, 1.0, high),
        _way(drive, -1.0, low),
        curves,
        acceleration_curve(drive, 0.0),
    )


def _way(drive: Drive, way: float, limit: float) -> Way:
    dead, full = dead_zone(drive, way), way * FULL_VOLTAGE
    top = float(drive.steady_speed(full))
    acceleration, by = starting_acceleration(drive, way)
    if dead.outside is None:  # no command moves it
        return Way(dead.inside, top, None, None, None, top, limit, acceleration, by, None, None)
    saturated = saturation(drive, way)
    end = full if saturated is None else saturated
    volts = np.linspace(dead.outside, end, GAIN_POINTS)
    speeds = drive.steady_speed(volts)
    slopes = np.diff(speeds) / np.diff(volts)
    return Way(
        dead.inside,
        float(speeds[0]),
        float((speeds[-1] - speeds[0]) / (volts[-1] - volts[0])),
        (float(slopes.min()), float(slopes.max())),
        saturated,
        top,
        limit,
        acceleration,
        by,
        _times(drive, 0.0, full),
        _times(drive, full, 0.0),
    )


def _times(drive: Drive, before: float, after: float) -> Times | None:
    """Times of a step between two commands that are both settled."""
    first, last = (float(drive.steady_speed(volts)) for volts in (before, after))
    if first == last:
        return None
    length = SHORTEST
    while length <= LONGEST:
        command = np.full(int(length * SOURCE_RATE) + 1, after)
        command[0] = before
        run = drive.simulate(command, start="steady")
        done = (run.shaft_speed - first) / (last - first)
        if done.max() >= HIGH:
            low, high = (float(run.time[np.argmax(done >= part)]) for part in (LOW, HIGH))
            return Times(high - low, high)
        length *= 2.0
    return None
