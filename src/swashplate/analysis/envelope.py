"""Envelope of a drive: what it can do each way, and the largest acceleration at every speed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.drive import Drive
from swashplate.equations.marching.part import Stored
from swashplate.equations.marching.record import SOURCE_RATE
from swashplate.equations.marching.run import Instance, Part, observe_kernel
from swashplate.models.displacement_control import PumpOptions
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.simulation.instance import instance_of
from swashplate.simulation.run import pressure_limits, settled_state
from swashplate.tables import UNIT, Cell, Column, Table
from swashplate.units import display_unit

if TYPE_CHECKING:
    import polars

# --- steady edges ---------------------------------------------------------------------------------


Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

GRID = 200
"""Parts into which an interval is cut at each refinement."""
CLOSE = 1e-12
"""Width at which an edge counts as found. [V]"""
NEARLY_FULL = (1.0 - 1e-9) * FULL_VOLTAGE
"""An edge beyond is none: the speed grows up to full voltage. [V]"""


class Edge(NamedTuple):
    """A voltage up to which something holds on the way from 0 V, and the next one beyond it."""

    inside: float
    """[V]"""
    outside: float | None
    """None where it holds up to full voltage. [V]"""


def edge(holds: Callable[[Array], Mask], end: float) -> Edge:
    """The last command on the way from 0 V to `end` before something first fails to hold.

    Parameters
    ----------
    holds : callable
        Commands [V] to whether it holds, element by element.
    end : float
        Where to stop, with its sign. [V]

    Returns
    -------
    Edge
        Both sides of it, at most 1e-12 V apart; 0 V inside where it does not even hold there.
    """
    low, high, found = 0.0, end, False
    while abs(high - low) > CLOSE:
        grid = np.linspace(low, high, GRID + 1)
        failed = ~holds(grid)
        if not failed.any():
            break
        first, found = int(np.argmax(failed)), True
        if first == 0:
            return Edge(0.0, float(grid[0]))
        if (low, high) == (float(grid[first - 1]), float(grid[first])):
            break
        low, high = float(grid[first - 1]), float(grid[first])
    return Edge(low, high) if found else Edge(end, None)


def dead_zone(drive: Drive, way: float) -> Edge:
    """Commands that leave the current within the solenoids' dead zone Z17, so that no force acts.

    Parameters
    ----------
    drive : Drive
        Whose card and solenoids are meant.
    way : float
        +1 or -1.
    """
    dead = drive.parameters.numbers["Z17"]

    def is_dead(volts: Array) -> Mask:
        return np.asarray(np.abs(drive.steady_current(volts)) <= dead)

    return edge(is_dead, way * FULL_VOLTAGE)


def saturation(drive: Drive, way: float) -> float | None:
    """Command beyond which the steady speed stays as it is, None where it grows up to ±10 V. [V]"""
    full = drive.steady_speed(way * FULL_VOLTAGE)

    def changes(volts: Array) -> Mask:
        return np.asarray(drive.steady_speed(volts) != full)

    found = edge(changes, way * FULL_VOLTAGE)
    if found.outside is None or abs(found.inside) > NEARLY_FULL:
        return None
    return found.outside


# --- acceleration ---------------------------------------------------------------------------------


AcceleratedBy = Literal["valve", "spool stop", "orifice"]

CODES: tuple[AcceleratedBy, ...] = ("valve", "spool stop", "orifice")
"""What sets the flow to the stroking piston: the opening that the solenoids can give, the spool's
stop Z14, or the in-line orifice Z16."""

INSIDE = 1e-9
"""Part of the range of pressure by which a curve ends before it."""


class AccelerationCurve(NamedTuple):
    """Acceleration over the speed under one held command, (n,) each."""

    speed: Array
    """Rising. [rad/s]"""
    acceleration: Array
    """With its sign. [rad/s²]"""
    by: tuple[AcceleratedBy, ...]
    """What sets it."""


def acceleration_curve(drive: Drive, voltage: float, points: int = 201) -> AccelerationCurve:
    """Acceleration at every speed while a command has been held long enough for its current.

    With refinements it is that of the plate's mean motion: in the middle of what friction and
    hysteresis leave open, without the lag of a damped plate, the swing of a line or the ripple of a
    turn.

    Parameters
    ----------
    drive : Drive
        The drive.
    voltage : float
        Command, within ±10 V; 0 is the stick let go. [V]
    points : int
        Speeds, evenly spaced in stroking pressure between those that ±10 V settle at.

    Returns
    -------
    AccelerationCurve
        The ends lie a hair's breadth inside, where the plate still moves.
    """
    instance = instance_of(drive.parameters, False)
    low, high = (
        settled_state(instance, drive.steady_current(way * FULL_VOLTAGE)).pressure
        for way in (-1.0, 1.0)
    )
    inside = INSIDE * (high - low)
    return _curve(drive, voltage, np.linspace(low + inside, high - inside, points))


def speed_limits(drive: Drive) -> tuple[float, float]:
    """Lowest and highest speed that the swash plate's stops, or Z15, allow at all. [rad/s]"""
    k = pressure_limits(instance_of(drive.parameters, False))
    low, high = _curve(drive, 0.0, np.array([k.lower, k.upper])).speed
    return float(low), float(high)


def starting_acceleration(drive: Drive, way: float) -> tuple[float, AcceleratedBy]:
    """Acceleration of the plate upright under the full command, and what sets it. [rad/s²]

    Z10 Z1 Z8 √(Z9/2) x/(1 + Z6) without offset and leakage, x = Z16 where the orifice limits.
    """
    numbers = drive.parameters.numbers
    curve = _curve(drive, way * FULL_VOLTAGE, np.array([numbers["Z2"] / numbers["Z1"]]))
    return float(curve.acceleration[0]), curve.by[0]


def _curve(drive: Drive, voltage: float, pressure: Array) -> AccelerationCurve:
    """Speed and acceleration at stroking pressures [Pa] under one command.

    The speed is that of the plate's angle less what leaks under a load that stands still; what
    leaks while it accelerates is left out.
    """
    instance = instance_of(drive.parameters, False)
    front, (p, options, _) = instance.parts
    # a line at rest leaks as a stiff one does
    leaks = options.leakage if options.line is None else options.line
    forms = PumpOptions(symmetric=options.symmetric, steep=options.steep, leakage=leaks)
    still = Part(p._replace(Z12=0.0, load_inertia=0.0), forms)
    instance = Instance(instance.model, (front, still), instance.name)
    kept = (Stored(0, "signals", "current"), Stored(1, "state", "pressure"))
    wanted = tuple(Stored(1, "signals", s) for s in ("shaft_speed", "swash_rate", "spool_free"))
    rows = np.stack([np.full_like(pressure, drive.steady_current(voltage)), pressure])
    out = np.empty((3, pressure.size))
    observe = observe_kernel(instance.model, 1, ("current",), instance.options, kept, wanted)
    observe(instance.params, instance.given, 1.0, rows, out)
    speed, rate, free = out
    orifice = np.where(free > 0.0, p.Z16_plus, p.Z16_minus)
    limited = np.minimum(np.abs(free), p.Z14) > orifice
    code = np.where(limited, 2, np.where(np.abs(free) > p.Z14, 1, 0))
    return AccelerationCurve(speed, p.Z10 * rate, tuple(CODES[each] for each in code))


# --- envelope -------------------------------------------------------------------------------------


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


def envelope_table(found: Envelope) -> Table:
    """Dead zone, gains, limits and times of both ways."""
    ways = (found.plus, found.minus)
    made = Table(
        "",
        (
            Column("Envelope"),
            Column("positive", "z.3f", none="none"),
            Column("negative", "z.3f", none="none"),
            UNIT,
        ),
    )
    gain = display_unit("rad/s/V").factor

    def range_of(way: Way) -> Cell:
        if way.gain_range is None:
            return Cell(None, "none")
        return Cell(None, " to ".join(f"{gain * each:.3f}" for each in way.gain_range))

    made.add("dead zone up to", *(way.dead_zone for way in ways), unit="V")
    made.add("smallest speed", *(way.smallest_speed for way in ways), unit="rad/s")
    made.add("gain, mean", *(way.gain for way in ways), unit="rad/s/V")
    made.add("gain, range", *map(range_of, ways), unit="rad/s/V")
    saturation = (way.saturation_voltage for way in ways)
    made.add("saturation voltage", *saturation, unit="V", spec=".2f")
    made.add("speed at full voltage", *(way.top_speed for way in ways), unit="rad/s")
    made.add("speed limit", *(way.speed_limit for way in ways), unit="rad/s")
    acceleration = (way.acceleration for way in ways)
    made.add("acceleration at rest", *acceleration, unit="rad/s^2", spec="z.2f")
    made.add("... set by the", *(way.accelerated_by for way in ways))
    for step in ("starting", "stopping"):
        times: list[Times | None] = [getattr(way, step) for way in ways]
        made.add(f"{step}, 10 to 90 %", *(t and t.rise for t in times), unit="s")
        made.add(f"{step}, to 90 %", *(t and t.reach for t in times), unit="s")
    made.add("creep at 0 V", found.creep, "", unit="rad/s", section=True)
    return made
