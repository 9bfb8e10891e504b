"""Envelope of a drive: what it can do in each direction, and its largest accelerations."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, fields, replace
from math import atan, inf
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.drive import Drive
from swashplate.machine import Machine, with_replacements
from swashplate.machine.marching import SOURCE_RATE, PartNumbers, called
from swashplate.models.displacement_control import PumpOptions, pressure_limits
from swashplate.models.pump import PumpState
from swashplate.parameters import FULL_VOLTAGE
from swashplate.results import Drawn, Result, Tabular
from swashplate.tables import UNIT, Cell, Column, Table, plain
from swashplate.units import display_unit

if TYPE_CHECKING:
    import polars

Array = NDArray[np.float64]

# --- steady edges ---------------------------------------------------------------------------------


class ConditionEdge(NamedTuple):
    """Commands at most 1e-12 V apart, on both sides of the point at which a condition fails."""

    inside: float
    """Last command at which it holds; 0 V if it does not even hold there. [V]"""
    outside: float | None
    """First command at which it does not hold; None if it holds up to the end. [V]"""


GRID = 200
"""Parts into which an interval is cut at each refinement."""
CLOSE = 1e-12
"""Width at which an edge counts as found. [V]"""
NEARLY = 1.0 - 1e-9
"""Share of the largest command above which a drive counts as not saturated: its speed grows up to
it. [1]"""


def edge(holds: Callable[[Array], NDArray[np.bool_]], end: float) -> ConditionEdge:
    """First command on the way from 0 V to `end` [V] at which a condition fails.

    `holds` evaluates the condition for commands [V], element by element.
    """
    low, high = 0.0, end
    grid = np.linspace(low, high, GRID + 1)
    fails = ~holds(grid)
    if not fails.any():
        return ConditionEdge(end, None)
    while abs(high - low) > CLOSE:
        first = int(np.argmax(fails))
        closer = float(grid[max(first - 1, 0)]), float(grid[first])
        if closer == (low, high):  # the numbers end before the width does
            break
        low, high = closer
        grid = np.linspace(low, high, GRID + 1)
        fails = ~holds(grid)
    return ConditionEdge(low, high)


def dead_zone(drive: Drive, direction: float) -> ConditionEdge:
    """Edge of the dead zone in one direction, +1 or -1: up to it the current stays within Z17."""
    dead = drive.parameters.numbers["Z17"]
    return edge(lambda volts: np.abs(drive.steady_current(volts)) <= dead, direction * FULL_VOLTAGE)


def saturation(drive: Drive, largest: float) -> float | None:
    """Command beyond which the steady speed stays as it is up to the largest one. [V]

    None if the speed grows up to there.
    """
    full = drive.steady_speed(largest)
    inside, outside = edge(lambda volts: drive.steady_speed(volts) != full, largest)
    return None if abs(inside) > NEARLY * abs(largest) else outside


# --- limits that may be elsewhere -----------------------------------------------------------------

FEEDBACK_ARM = 0.98
"""Sine of the feedback arm's angle at which a plate without a stop is still held: at 1 the closed
form of the spool ends."""
WIDEST = 1.5
"""Largest angle of a plate without a stop; the model ends at a right angle. [rad]"""


def farthest_stop(drive: Drive) -> float:
    """Angle of the swash plate up to which the model holds without a stop. [rad]"""
    return min(atan(FEEDBACK_ARM / drive.parameters.numbers["Z3"]), WIDEST)


def without_limits(drive: Drive, columns: Iterable[str]) -> Drive:
    """A drive whose limits of these columns lie as far as its model can take."""
    numbers = drive.parameters.numbers
    limits = {}
    for column in columns:
        farthest = farthest_stop(drive) if column.startswith("Z13") else inf
        limits[column] = max(farthest, numbers[column])
    return Drive(drive.parameters.with_numbers(limits))


def largest_commands(drive: Drive) -> tuple[float, float]:
    """Largest command each way that the tests of a drive used, magnitudes; ±10 V without tests. [V]

    Of a way that no test goes it is the other's.
    """
    plus, minus = drive.parameters.tested or (0.0, 0.0)
    usual = max(plus, minus) or FULL_VOLTAGE
    return plus or usual, minus or usual


USUAL_STEP = 9.0
"""Step that drives without tests are compared by. [V]"""


def tested_step(drive: Drive) -> float:
    """Positive step that the tests of a drive cover. [V]"""
    return USUAL_STEP if drive.parameters.tested is None else largest_commands(drive)[0]


# --- acceleration ---------------------------------------------------------------------------------

AcceleratedBy = Literal["valve", "spool stop", "orifice"]
"""Limit of the flow to the stroking piston: the opening that the solenoids can give, the spool's
stop Z14, or the in-line orifice Z16."""

INSIDE = 1e-9
"""Distance of a curve's ends from the ends of the pressure range, as a share of it. [1]"""


@dataclass(frozen=True, eq=False)
class AccelerationCurve(Result):
    """Acceleration over the speed under one held command, (n,) each."""

    speed: Array  # Rising. [rad/s]
    acceleration: Array  # With its sign. [rad/s²]
    by: tuple[AcceleratedBy, ...]  # What sets it.


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
        Command, within ±10 V; 0 if the joystick is released. [V]
    points : int
        Speeds, evenly spaced in stroking pressure between those that ±10 V settle at.

    Returns
    -------
    AccelerationCurve
        The ends lie a hair's breadth inside the range, so that the plate still moves.
    """
    low, high = (_settled_pressure(drive, end) for end in (-FULL_VOLTAGE, FULL_VOLTAGE))
    inside = INSIDE * (high - low)
    return _curve(drive, voltage, np.linspace(low + inside, high - inside, points))


def _settled_pressure(drive: Drive, voltage: float) -> float:
    """Stroking pressure that a command settles at. [Pa]"""
    pump = drive.by_current
    started = pump.start({"current": drive.steady_current(voltage)}, 1.0, "steady")
    return float(started.states[1].pressure)


def speed_limits(drive: Drive) -> tuple[float, float]:
    """Lowest and highest speed that the swash plate's stops, or Z15, allow at all. [rad/s]"""
    instance = drive.by_current
    limits_of = with_replacements(pressure_limits, instance.model.parts[1].replacements)
    limits = limits_of(instance.parts[1].p)
    low, high = _curve(drive, 0.0, np.array([limits.lower, limits.upper])).speed
    return float(low), float(high)


def starting_acceleration(drive: Drive, voltage: float) -> tuple[float, AcceleratedBy]:
    """Acceleration of the plate upright under a command [V], and what sets it. [rad/s²]

    Z10 Z1 Z8 √(Z9/2) x/(1 + Z6) without offset and leakage, x = Z16 if the orifice limits (Kruse
    2001, eqs. 6.67 to 6.71).
    """
    numbers = drive.parameters.numbers
    curve = _curve(drive, voltage, np.array([numbers["Z2"] / numbers["Z1"]]))
    return float(curve.acceleration[0]), curve.by[0]


def _curve(drive: Drive, voltage: float, pressure: Array) -> AccelerationCurve:
    """Speed and acceleration at stroking pressures [Pa] under one command.

    The speed is that of the plate's angle less what leaks under a load that stands still; what
    leaks while it accelerates is left out.
    """
    instance = drive.by_current
    front, (p, options, _) = instance.parts
    # a line at rest leaks as a stiff one does
    leaks = options.leakage if options.line is None else options.line
    forms = PumpOptions(symmetric=options.symmetric, steep=options.steep, leakage=leaks)
    standing_load = PartNumbers(p._replace(Z12=0.0, load_inertia=0.0), forms)
    instance = Machine.of_parts(instance.model, (front, standing_load), instance.name)
    arguments = instance.start({"current": drive.steady_current(voltage)}, 1.0).arguments[1]
    pump: Any = instance.model.parts[1]
    samples = [
        called(pump, pump.sample, {**arguments, "state": PumpState(state)})
        for state in pressure.tolist()
    ]
    speed = np.array([sample.shaft_speed for sample in samples])
    swash_rate = np.array([sample.swash_rate for sample in samples])
    spool = np.array([sample.spool_free for sample in samples])
    orifice = np.where(spool > 0.0, p.Z16_plus, p.Z16_minus)
    by_orifice = np.minimum(np.abs(spool), p.Z14) > orifice
    by_stop = np.abs(spool) > p.Z14
    causes = np.select([by_orifice, by_stop], ["orifice", "spool stop"], "valve")
    return AccelerationCurve(speed, p.Z10 * swash_rate, tuple(causes.tolist()))


# --- envelope -------------------------------------------------------------------------------------

GAIN_POINTS = 401
"""Commands between dead zone and saturation at which the gain is taken."""
LOW, HIGH = 0.1, 0.9
"""Shares of the change of speed between which a rise time counts. [1]"""
DECIDES = 0.01
"""Share of a number that a limit must be able to change to decide it. [1]"""
SHORTEST, LONGEST = 8.0, 256.0
"""A step lasts so long at first, and at most, until the speed has come to stay. [s]"""


def _row(label: str, unit: str, spec: str = "", *, key: bool = False) -> Any:
    """A field that is a row of the table, with its label, unit and format; None if not known.

    `key` is whether `answers.key_numbers` has the number, too.
    """
    return field(default=None, metadata={"row": (label, unit, spec), "key": key})


@dataclass(frozen=True)
class DirectionLimits(Result):
    """Capabilities of a drive in one direction, SI, with its sign; gains are positive."""

    accelerated_by: AcceleratedBy  # What sets the acceleration at rest.
    dead_zone: float = _row("dead zone up to", "V", key=True)  # Largest command that moves nothing.
    smallest_speed: float = _row("smallest speed", "rad/s", key=True)
    """Steady speed just beyond the dead zone: nothing slower can be held, save the creep."""
    gain: float | None = _row("gain, mean", "rad/s/V", key=True)
    """Slope of the steady map from the dead zone to saturation or the largest command."""
    smallest_gain: float | None = _row("gain, smallest", "rad/s/V")
    largest_gain: float | None = _row("gain, largest", "rad/s/V")
    saturation_voltage: float | None = _row("saturation voltage", "V", ".2f")
    """Command beyond which the speed stays; None if it grows up to the largest command."""
    top_speed: float = _row("top speed", "rad/s", key=True)  # Steady, at the largest command.
    speed_limit: float = _row("speed limit", "rad/s")
    """Speed with the swash plate at its stop, or with the pressure held by Z15."""
    acceleration: float = _row("acceleration at rest", "rad/s^2", "z.2f", key=True)
    """Under the largest command."""
    starting_rise: float | None = _row("starting, 10 to 90 %", "s")
    """Time from 10 % to 90 % of a step to the largest command from rest; None if nothing moves."""
    starting_reach: float | None = _row("starting, to 90 %", "s")
    """Time from that command to 90 %."""
    stopping_rise: float | None = _row("stopping, 10 to 90 %", "s")
    """The same two when the command goes back to 0 V."""
    stopping_reach: float | None = _row("stopping, to 90 %", "s")


class OpenRange(NamedTuple):
    """Range of a number that limits decide which no test reached; None if it is undefined."""

    at_test_end: float | None
    """If those limits act just beyond what was tested."""
    unlimited: float | None
    """Without those limits."""


PLUS, MINUS = 0, 1
"""Index of a direction in pairs."""


@dataclass(frozen=True, eq=False)
class Envelope(Tabular, Drawn):
    """Capabilities of a drive in both directions, up to the largest command of its tests."""

    drawn_by: ClassVar[str] = "plot_envelope"

    name: str
    """Name of the drive."""
    creep: float
    """Steady speed at 0 V. [rad/s]"""
    plus: DirectionLimits
    minus: DirectionLimits
    accelerating: tuple[AccelerationCurve, AccelerationCurve]
    """Largest acceleration over the speed under the largest commands."""
    released: AccelerationCurve
    """Acceleration over the speed with the joystick released."""
    largest: tuple[float, float]
    """Largest command each way, magnitudes. [V]"""
    with_limits_at_test_end: tuple[DirectionLimits, DirectionLimits] | None = None
    """Both directions if each limit that no test reached acts just beyond what was tested; None if
    the tests reached all limits."""
    with_limits_removed: tuple[DirectionLimits, DirectionLimits] | None = None
    """Both directions without the limits that no test reached; None if there are none."""
    orifice_unknown: tuple[bool, bool] = (False, False)
    """Whether it is not known how far the tests opened the orifice of a direction."""

    def table(self, *, rest: bool = False) -> Table:
        """Dead zone, gains, limits and times of both directions.

        With `rest` only what `key_numbers` does not have.
        """
        columns = (
            Column("Envelope", key="quantity"),
            Column("positive", "z.3f", none="none", key="plus"),
            Column("negative", "z.3f", none="none", key="minus"),
            UNIT,
        )
        table = Table("", columns)
        for quantity in fields(DirectionLimits):
            name = quantity.name
            if "row" in quantity.metadata and not (rest and quantity.metadata["key"]):
                label, unit, spec = quantity.metadata["row"]
                cells = (self._cell(name, index, unit) for index in (PLUS, MINUS))
                table.add(Cell(name, label), *cells, unit=unit, spec=spec)
            if name == "acceleration":
                causes = (self._accelerated_by(index) for index in (PLUS, MINUS))
                words = "acceleration at rest set by the" if rest else "... set by the"
                table.add(Cell("accelerated_by", words), *causes)
        if rest:
            return table
        creep = Cell("creep", "creep at 0 V")
        table.add(creep, self.creep, Cell(self.creep, ""), unit="rad/s", section=True)
        return table

    def _open_range(self, name: str, index: int) -> OpenRange | None:
        """Range of a number that limits decide which no test reached; None if they do not."""
        if self.with_limits_at_test_end is None or self.with_limits_removed is None:
            return None
        at_test_end = getattr(self.with_limits_at_test_end[index], name)
        unlimited = getattr(self.with_limits_removed[index], name)
        if at_test_end is None or unlimited is None:
            is_open = at_test_end is not unlimited
        else:
            # where such a limit stands is no estimate
            value = getattr((self.plus, self.minus)[index], name)
            others = [unlimited] if value is None else [unlimited, value]
            is_open = any(abs(other - at_test_end) > DECIDES * abs(at_test_end) for other in others)
        return OpenRange(at_test_end, unlimited) if is_open else None

    def _cell(self, name: str, index: int, unit: str) -> float | Cell | None:
        """A number, or its bound if limits decide it which no test reached."""
        open_range = self._open_range(name, index)
        if open_range is None:
            value: float | None = getattr((self.plus, self.minus)[index], name)
            return value
        at_test_end, unlimited = open_range
        if at_test_end is None or unlimited is None or self._orifice_decides(index, name):
            return Cell(None, "not seen")
        relation = "at least" if abs(unlimited) >= abs(at_test_end) else "at most"
        bound = plain(display_unit(unit).factor * at_test_end, 4)
        return Cell(at_test_end, f"{relation} {bound}, not seen")

    def _orifice_decides(self, index: int, name: str) -> bool:
        """Whether a number follows from an orifice whose largest opening the tests do not show."""
        return self.orifice_unknown[index] and name.startswith(("acceleration", "start", "stop"))

    def _accelerated_by(self, index: int) -> Cell:
        if self._open_range("acceleration", index) is not None:
            return Cell(None, "not seen")
        return Cell(None, (self.plus, self.minus)[index].accelerated_by)

    def to_polars(self) -> polars.DataFrame:
        """Table in SI: ``quantity``, ``plus``, ``minus``, ``unit``; null if there is none."""
        import polars as pl

        return self.table().to_polars().filter(pl.col("unit") != "")


def envelope(drive: Drive) -> Envelope:
    """Compute the capabilities of a drive in each direction.

    Dead zone, creep and gains come from the steady map, as do the limits of speed and
    acceleration; the times of a full step come from a simulation. The tests of a fitted or guessed
    drive may not have reached a limit: a number that depends on it is shown as a bound, "at least"
    or "at most", or as not seen.

    Parameters
    ----------
    drive : Drive
        The drive.

    Returns
    -------
    Envelope
        Each number one way and the other: dead zone [V], gains [rad/s/V], speeds [rad/s],
        accelerations [rad/s²] and times [s].

    Examples
    --------
    >>> from swashplate import Drive, analysis
    >>> ability = analysis.envelope(Drive.preset("hoist"))
    >>> round(ability.plus.dead_zone, 2), round(ability.plus.top_speed, 2)
    (0.21, 3.42)
    """
    plus, minus = _both_directions(drive)
    largest = largest_commands(drive)
    capability = Envelope(
        name=drive.name,
        creep=float(drive.steady_speed(0.0)),
        plus=plus,
        minus=minus,
        accelerating=(
            acceleration_curve(drive, largest[0]),
            acceleration_curve(drive, -largest[1]),
        ),
        released=acceleration_curve(drive, 0.0),
        largest=largest,
    )
    unreached = drive.parameters.unreached
    if not unreached:
        return capability
    # 0 stands for an orifice that no test opened by a known amount: its value stays
    test_ends = {column: value for column, value in unreached.items() if value != 0.0}
    limited_at_test_ends = Drive(drive.parameters.with_numbers(test_ends))
    return replace(
        capability,
        with_limits_at_test_end=_both_directions(limited_at_test_ends),
        with_limits_removed=_both_directions(without_limits(drive, unreached)),
        orifice_unknown=(
            unreached.get("Z16_plus") == 0.0,
            unreached.get("Z16_minus") == 0.0,
        ),
    )


def _both_directions(drive: Drive) -> tuple[DirectionLimits, DirectionLimits]:
    low, high = speed_limits(drive)
    plus, minus = largest_commands(drive)
    return _limits_of(drive, plus, high), _limits_of(drive, -minus, low)


def _limits_of(drive: Drive, full: float, speed_limit: float) -> DirectionLimits:
    """Capabilities up to a command."""
    inside, outside = dead_zone(drive, float(np.sign(full)))
    acceleration, accelerated_by = starting_acceleration(drive, full)
    top = float(drive.steady_speed(full))
    limits: dict[str, Any] = {
        "accelerated_by": accelerated_by,
        "acceleration": acceleration,
        "dead_zone": inside,
        "smallest_speed": top,
        "top_speed": top,
        "speed_limit": speed_limit,
    }
    if outside is None or abs(outside) >= abs(full):  # no command moves it
        return DirectionLimits(**limits)
    saturated = saturation(drive, full)
    volts = np.linspace(outside, full if saturated is None else saturated, GAIN_POINTS)
    speeds = drive.steady_speed(volts)
    slopes = np.diff(speeds) / np.diff(volts)
    limits["saturation_voltage"] = saturated
    limits["smallest_speed"] = float(speeds[0])
    limits["gain"] = float((speeds[-1] - speeds[0]) / (volts[-1] - volts[0]))
    limits["smallest_gain"] = float(slopes.min())
    limits["largest_gain"] = float(slopes.max())
    limits["starting_rise"], limits["starting_reach"] = _times(drive, 0.0, full)
    limits["stopping_rise"], limits["stopping_reach"] = _times(drive, full, 0.0)
    return DirectionLimits(**limits)


def _times(drive: Drive, from_volts: float, to_volts: float) -> tuple[float | None, float | None]:
    """Times from 10 % to 90 % and to 90 % of a step between two settled commands. [s]"""
    initial_speed = float(drive.steady_speed(from_volts))
    final_speed = float(drive.steady_speed(to_volts))
    length = SHORTEST
    while initial_speed != final_speed and length <= LONGEST:
        command = np.full(int(length * SOURCE_RATE) + 1, to_volts)
        command[0] = from_volts
        run = drive.simulate(command, start="steady")
        progress = (run.shaft_speed - initial_speed) / (final_speed - initial_speed)
        if progress.max() >= HIGH:
            low = float(run.time[np.argmax(progress >= LOW)])
            high = float(run.time[np.argmax(progress >= HIGH)])
            return high - low, high
        length *= 2.0
    return None, None
