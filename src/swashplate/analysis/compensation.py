"""Inverse of a drive's steady map: dead zone, creep and saturation made up for, what it buys."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, cast, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis.capability import dead_zone, saturation, starting_acceleration
from swashplate.analysis.outcomes import rms_difference
from swashplate.drive import Drive
from swashplate.errors import DomainError, InputError
from swashplate.machine.marching import SOURCE_RATE
from swashplate.parameters import FULL_VOLTAGE, LoggedCommand
from swashplate.results import GivenAxes, Result, figures, short
from swashplate.tables import (
    UNIT,
    Column,
    Form,
    Table,
    ending,
    quantity,
    write_table,
    write_text,
)

if TYPE_CHECKING:
    import polars

    from swashplate.drive import Simulation
    from swashplate.results import Axes, Figure

Array = NDArray[np.float64]

# --- the map --------------------------------------------------------------------------------------

FEWEST, MOST = 2, 10_001
"""Points in each direction that a map may have."""
MOST_SHOWN = 5
"""Points in each direction that a table shows."""
INVERSE_MAP = Form("an inverse map", (".toml", ".csv", ".parquet"))
COMMENTS = """\
# swashplate inverse steady-state map: the voltage for a reference speed; SI units
# plus and minus: straight lines between the points; beyond their ends hold the end
# between minus and plus: the nearest of minus' last point, rest and plus' first point
"""
ROUNDING = 1e-9
"""Part of the range of speeds by which a reference may exceed it and still count as the limit."""


class MapBranch(NamedTuple):
    """The map in one direction: both rise, with straight lines between the points."""

    def __repr__(self) -> str:
        return short(self)

    speed: Array  # [rad/s]
    voltage: Array  # [V]


@dataclass(frozen=True, eq=False)
class InverseMap(Result):
    """Voltage for a reference speed; positive voltage and positive speed go together.

    Between the slowest speeds that can be held each way there is nothing but the creep at 0 V. A
    reference speed in this gap gets whichever of the three is nearest, 0 V if two are.
    """

    name: str
    """Name of the drive."""
    minus: MapBranch
    """From the speed limit to the dead zone's edge."""
    plus: MapBranch
    """From the dead zone's edge to the speed limit."""
    creep: float
    """Speed at 0 V. [rad/s]"""
    acceleration: tuple[float, float]
    """Largest acceleration from rest, plus and minus, magnitudes. A reference speed that changes
    faster is not followed, whatever the voltage. [rad/s²]"""
    lag: float
    """Time by which the speed follows a slow change of the command, see `command`. [s]"""
    error: float
    """Largest interpolation error: steady speed less reference speed half way between two
    points. [rad/s]"""
    logged: LoggedCommand | None = None
    """How the logs of the drive's fit hold the command, if not as the voltage at the card."""

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest speed that a voltage settles at. [rad/s]"""
        return float(self.minus.speed[0]), float(self.plus.speed[-1])

    @property
    def gap(self) -> tuple[float, float]:
        """Speeds between which only the creep can be held. [rad/s]"""
        return float(self.minus.speed[-1]), float(self.plus.speed[0])

    @overload
    def plot(
        self,
        improvement: Improvement | None = None,
        *,
        ax: None = None,
        title: str | None = None,
    ) -> Figure: ...

    @overload
    def plot(self, *, ax: GivenAxes, title: str | None = None) -> GivenAxes: ...

    def plot(
        self,
        improvement: Improvement | None = None,
        *,
        ax: Axes | Sequence[Axes] | None = None,
        title: str | None = None,
    ) -> Figure | Axes | Sequence[Axes]:
        """Figure of the voltage over the reference speed, with a close-up at standstill.

        By default a new figure, with the runs of an `improvement` below; with `ax` the map is drawn
        there, in a second one its close-up, and `ax` returned. See
        `swashplate.report.figures.plot_compensation`.
        """
        draw = figures().plot_compensation
        return cast("Figure", draw(self, improvement, ax=ax, title=title))

    def voltage(self, speed: ArrayLike, *, clip: bool = False) -> Array:
        """Voltage for reference speeds, element by element; it never falls if the speed rises.

        Parameters
        ----------
        speed : array_like of any shape
            Reference speeds. [rad/s]
        clip : bool
            Take the limit for a speed beyond it instead of refusing it.

        Returns
        -------
        array of the same shape
            Commands. [V]

        Raises
        ------
        InputError
            For a reference speed that is not finite, or beyond the limits without `clip`.

        Examples
        --------
        >>> from swashplate import Drive, analysis
        >>> inverse = analysis.inverse_map(Drive.preset("hoist"))
        >>> inverse.voltage([-1.0, 1.0]).round(2).shape
        (2,)
        """
        try:
            reference = np.asarray(speed, dtype=np.float64)
        except (TypeError, ValueError):
            raise InputError(
                "The reference speed must be a number or a sequence of numbers."
            ) from None
        if not np.isfinite(reference).all():
            raise InputError("The reference speed must be finite everywhere.")
        low, high = self.limits
        gap_start, gap_end = self.gap
        inside = np.clip(reference, low, high)
        beyond = reference[np.abs(reference - inside) > ROUNDING * (high - low)]
        if beyond.size and not clip:
            worst = quantity(float(beyond[np.abs(beyond).argmax()]), "rad/s", spec=".6g")
            least = quantity(low, "rad/s", spec=".6g")
            most = quantity(high, "rad/s", spec=".6g")
            raise InputError(
                f"{self.name} cannot settle at {worst}: its speeds reach from {least} to {most}."
            )
        # the creep comes first, so that it wins a tie
        slowest = np.array([self.creep, gap_start, gap_end])
        slowest_voltages = np.array([0.0, self.minus.voltage[-1], self.plus.voltage[0]])
        nearest = np.argmin(np.abs(inside[..., np.newaxis] - slowest), axis=-1)
        upwards = np.interp(inside, self.plus.speed, self.plus.voltage)
        downwards = np.interp(inside, self.minus.speed, self.minus.voltage)
        voltage = np.where(inside > gap_end, upwards, slowest_voltages[nearest])
        return np.asarray(np.where(inside < gap_start, downwards, voltage))

    def command(self, speed: ArrayLike, rate: float) -> Array:
        """Voltage over time for a reference speed over time, with the drive's lag made up for.

        Parameters
        ----------
        speed : (n,) array_like
            Reference speed, n ≥ 2, without noise. [rad/s]
        rate : float
            Its samples a second. [Hz]

        Returns
        -------
        (n,) array
            Voltage for reference + lag · d(reference)/dt, clipped to the speed limits. [V]

        Raises
        ------
        InputError
            For a reference speed beyond the limits, or a rate out of range.
        """
        self.voltage(speed)  # refuses what cannot be
        reference = np.asarray(speed, dtype=np.float64)
        if reference.ndim != 1 or reference.size < 2:
            raise InputError(
                "A command needs two or more samples of the reference speed in one row."
            )
        if not (np.isfinite(rate) and rate > 0.0):
            raise InputError(f"A command needs a rate above 0 Hz, not {rate:g} Hz.")
        return self.voltage(reference + self.lag * np.gradient(reference, 1.0 / rate), clip=True)

    def to_polars(self) -> polars.DataFrame:
        """Table of the points, voltage rising: ``speed`` [rad/s] and ``voltage`` [V], SI.

        If logs of the drive hold other numbers, these as a column by the name of theirs.
        """
        return self._points(MOST).to_polars()

    def _points(self, most: int) -> Table:
        """The map at some points each way, and at rest."""
        columns = (Column("speed", "z.3f", "rad/s"), Column("voltage", "z.4f", "V"))
        table = Table("", (*columns, *self._logged_column()))
        rest = MapBranch(np.array([self.creep]), np.zeros(1))
        for branch in (self.minus, rest, self.plus):
            size = branch.speed.size
            spread = np.linspace(0, size - 1, min(most, size))
            for index in np.unique(spread.round().astype(int)):
                speed, voltage = float(branch.speed[index]), float(branch.voltage[index])
                table.add(speed, voltage, *self._logged_numbers(voltage))
        return table

    def _logged_column(self) -> tuple[Column, ...]:
        """A column for the numbers that a log of the drive would hold, if they are others."""
        return () if self.logged is None else (Column(f"{self.logged.column}, as logged", "z.4f"),)

    def _logged_numbers(self, voltage: float) -> tuple[float, ...]:
        """The number in a log of the drive for a voltage at the card, if it is another."""
        return () if self.logged is None else (float(self.logged.numbers(np.array(voltage))),)

    def tables(self, speeds: Sequence[float] = ()) -> list[Table]:
        """Voltages of reference speeds [rad/s]; the map at a few points; where it holds."""
        columns = (
            Column("reference speed", "g", "rad/s"),
            Column("voltage", "z.4f", "V"),
            Column("settles at", "z.3f", "rad/s"),
            *self._logged_column(),
        )
        voltages_table = Table("", columns)
        voltages = self.voltage(speeds)
        # the map the other way round: in the gap the drive creeps, or goes at its slowest
        map_voltages = np.concatenate([self.minus.voltage, [0.0], self.plus.voltage])
        map_speeds = np.concatenate([self.minus.speed, [self.creep], self.plus.speed])
        settled = np.interp(voltages, map_voltages, map_speeds)
        for row in zip(speeds, voltages, settled, strict=True):
            voltages_table.add(*map(float, row), *self._logged_numbers(float(row[1])))
        gap_start, gap_end = self.gap
        if any(gap_start < speed < gap_end for speed in speeds):
            low, high = (quantity(edge, "rad/s", spec="z.3f") for edge in (gap_start, gap_end))
            voltages_table.caption = f"between {low} and {high} only the creep at 0 V can be held"
        points = self._points(MOST_SHOWN)
        total = self.minus.speed.size + self.plus.speed.size + 1
        if len(points.rows) < total:
            points.caption = f"{len(points.rows)} of {total} points shown"
        plus, minus = self.acceleration
        limits = Table(
            "", (Column("Limit"), Column("negative", ".3f"), Column("positive", ".3f"), UNIT)
        )
        lowest, highest = self.limits
        limits.add("speed", lowest, highest, unit="rad/s")
        limits.add("slowest that can be held", gap_start, gap_end, unit="rad/s", spec="z.3f")
        limits.add(
            "acceleration at rest",
            -minus,
            plus,
            unit="rad/s^2",
            spec=".2f",
        )
        limits.add("lag", "", 1e3 * self.lag, unit="ms", spec=".1f")
        limits.add("interpolation error", "", self.error, unit="rad/s", spec=".2g")
        return [voltages_table, points, limits] if speeds else [points, limits]

    def write(self, path: str | Path) -> None:
        """Write the map as .toml for a controller, or as a table (`to_polars`) .csv or .parquet.

        Raises
        ------
        FileError
            For another ending or a place that cannot be written.
        """
        from tomlkit import dumps

        if ending(path, INVERSE_MAP) != ".toml":
            write_table(self.to_polars(), path)
            return
        content = {
            "format": 1,
            "drive": self.name,
            "speed_unit": "rad/s",
            "voltage_unit": "V",
            "acceleration": list(self.acceleration),
            "lag": self.lag,
            "error": self.error,
            "minus": {name: each.tolist() for name, each in self.minus._asdict().items()},
            "rest": {"speed": self.creep},
            "plus": {name: each.tolist() for name, each in self.plus._asdict().items()},
        }
        if self.logged is not None:
            content["command"] = self.logged._asdict()
        write_text(COMMENTS + dumps(content), path)


# --- of a drive -----------------------------------------------------------------------------------

LAG_FREQUENCY = 1e-4
"""Frequency at which the lag of small motions is read, far below all of a drive's own. [Hz]"""


def inverse_map(drive: Drive, points: int = 101) -> InverseMap:
    """The inverse of a drive's steady map, exact at its points.

    Parameters
    ----------
    drive : Drive
        The drive.
    points : int
        Points each way, evenly spaced in voltage from the dead zone's edge to saturation. 2 to
        10001.

    Returns
    -------
    InverseMap
        With straight lines between the points, which any controller can follow, and their error.

    Raises
    ------
    InputError
        For another number of points.
    DomainError
        If there is no inverse: no command moves the drive one way, or a larger command makes it
        slower.

    Examples
    --------
    >>> from swashplate import Drive, analysis
    >>> inverse = analysis.inverse_map(Drive.preset("hoist"))
    >>> round(float(inverse.voltage(1.0)), 2)
    2.41
    """
    if not FEWEST <= points <= MOST:
        raise InputError(
            f"An inverse map takes {FEWEST} to {MOST} points per direction, not {points}."
        )
    plus = _branch(drive, 1.0, points)
    minus = _branch(drive, -1.0, points)
    creep = float(drive.steady_speed(0.0))
    if not minus.speed[-1] <= creep <= plus.speed[0]:
        low, at, high = np.degrees([minus.speed[-1], creep, plus.speed[0]])
        raise DomainError(
            f"{drive.name} creeps at {at:.4g} deg/s at 0 V, but the smallest commands give "
            f"{low:.4g} and {high:.4g} deg/s, so its steady map has no inverse; check Z17, Z18 and "
            "the card's J."
        )
    upwards, _ = starting_acceleration(drive, FULL_VOLTAGE)
    downwards, _ = starting_acceleration(drive, -FULL_VOLTAGE)
    errors = list[float]()
    lags = list[float]()
    for branch in (plus, minus):
        speed = 0.5 * (branch.speed[1:] + branch.speed[:-1])
        voltage = 0.5 * (branch.voltage[1:] + branch.voltage[:-1])
        errors.append(float(np.abs(drive.steady_speed(voltage) - speed).max()))
        # of slow small motions half way up the map
        model = drive.linearize(float(0.5 * (branch.voltage[0] + branch.voltage[-1])))
        phase = float(np.angle(model.response([LAG_FREQUENCY])[0, 0]))
        lags.append(-phase / (2.0 * np.pi * LAG_FREQUENCY))
    return InverseMap(
        name=drive.name,
        minus=minus,
        plus=plus,
        creep=creep,
        acceleration=(abs(upwards), abs(downwards)),
        lag=0.5 * sum(lags),
        error=max(errors),
        logged=drive.parameters.command,
    )


def _branch(drive: Drive, direction: float, points: int) -> MapBranch:
    """Points of one direction, from the lower voltage to the higher."""
    start = dead_zone(drive, direction).outside
    saturated = saturation(drive, direction * FULL_VOLTAGE)
    end = direction * FULL_VOLTAGE if saturated is None else saturated
    if start is None or start == end:
        side = "positive" if direction > 0.0 else "negative"
        raise DomainError(
            f"No {side} command up to {FULL_VOLTAGE:g} V moves {drive.name}, so its steady map has "
            "no inverse; check V_dz, J, G1 to G3 and Z17."
        )
    volts = np.sort(np.linspace(start, end, points))
    speed = drive.steady_speed(volts)
    falls = np.flatnonzero(np.diff(speed) <= 0.0)
    if falls.size:
        n = int(falls[0])
        raise DomainError(
            f"The steady speed of {drive.name} does not rise from {volts[n]:.4g} to "
            f"{volts[n + 1]:.4g} V, so its steady map has no inverse there; check G1, G2 and G3."
        )
    return MapBranch(speed, volts)


# --- what the map buys ----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Improvement(Result):
    """A reference speed commanded in several ways, the plainest first."""

    name: str
    """Name of the drive."""
    reference: Array
    """(n,) reference speed. [rad/s]"""
    runs: Mapping[str, Simulation]
    """``"straight line"``, ``"inverse map"`` and ``"inverse map and lead"``."""

    @property
    def rms(self) -> dict[str, float]:
        """Rms of speed less reference speed, by controller. [rad/s]"""
        return {
            name: rms_difference(run.shaft_speed, self.reference) for name, run in self.runs.items()
        }

    def table(self) -> Table:
        """Errors of the speed, controller by controller."""
        columns = (
            Column("Controller"),
            Column("rms", ".3f", "rad/s"),
            Column("largest", ".3f", "rad/s"),
            Column("rms", ".1%"),
        )
        table = Table("Error of the speed", columns)
        rms = self.rms
        for name, run in self.runs.items():
            largest = float(np.abs(run.shaft_speed - self.reference).max())
            table.add(name, rms[name], largest, rms[name] / rms["straight line"])
        return table


def proportional_command(inverse: InverseMap, reference: ArrayLike) -> Array:
    """Voltage of a controller that knows only the drive's full speed in each direction. [V]

    A straight line in each direction from 0 V at standstill to the saturation voltage at the limit.
    """
    speed = np.asarray(reference, dtype=np.float64)
    low, high = inverse.limits
    positive_gain = inverse.plus.voltage[-1] / high
    negative_gain = inverse.minus.voltage[0] / low
    return np.asarray(np.where(speed >= 0.0, positive_gain * speed, negative_gain * speed))


def speed_of_command(inverse: InverseMap, voltage: ArrayLike) -> Array:
    """Speed that a command asks for: in proportion, ±10 V for the full speed.

    Parameters
    ----------
    inverse : InverseMap
        Of the drive; its `limits` are the full speeds.
    voltage : float or (n,) array_like
        Command. [V]

    Returns
    -------
    () or (n,) array
        Speed of the shaft. [rad/s]
    """
    volts = np.asarray(voltage, dtype=np.float64)
    low, high = inverse.limits
    return np.asarray(np.where(volts >= 0.0, 0.1 * high * volts, -0.1 * low * volts))


def improvement(
    drive: Drive,
    reference_speed: ArrayLike,
    rate: float = SOURCE_RATE,
    *,
    inverse: InverseMap | None = None,
) -> Improvement:
    """Simulate a reference speed with and without the inverse map, to compare their errors.

    Parameters
    ----------
    drive : Drive
        What is driven.
    reference_speed : (n,) array_like
        [rad/s]
    rate : float
        Its samples a second. [Hz]
    inverse : InverseMap, optional
        The map to use, of another drive perhaps, to see what a wrong one does; by default this
        drive's own.

    Returns
    -------
    Improvement
        Runs by `proportional_command`, `InverseMap.voltage` and `InverseMap.command`.

    Raises
    ------
    InputError
        For a reference speed beyond the drive's limits, one of standstill only, or a record that
        cannot be simulated.
    """
    inverse_used = inverse_map(drive) if inverse is None else inverse
    with_lead = inverse_used.command(reference_speed, rate)
    reference = np.array(reference_speed, dtype=np.float64)
    if not reference.any():
        raise InputError(
            "The reference speed is standstill throughout; use one that moves the drive."
        )
    commands = {
        "straight line": proportional_command(inverse_used, reference),
        "inverse map": inverse_used.voltage(reference),
        "inverse map and lead": with_lead,
    }
    runs = {name: drive.simulate(voltage, rate) for name, voltage in commands.items()}
    return Improvement(drive.name, reference, runs)
