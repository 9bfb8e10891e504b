"""Outcomes of a command: what a drive made of it, for one drive, two or many."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property, partial
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis.capability import saturation
from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.results import Result
from swashplate.simulation.result import Limit
from swashplate.tables import UNIT, Cell, Column, Table
from swashplate.units import DisplayUnit, display_unit

if TYPE_CHECKING:
    from swashplate.simulation.result import Simulation

Array = NDArray[np.float64]

REST = 0.5  # A command that rests at 0 V this long lets the drive settle at its creep. [s]
TURNED = 0.05  # Part of its range by which a command may turn back and still go one way.

# --- a command to judge drives by -----------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Trial(Result):
    """A command, and the speed that a perfect drive would make of it. Make it with `trial`."""

    voltage: Array  # (n,) [V]
    rate: float  # Samples a second. [Hz]
    wanted: Array  # (n,) speed of the shaft. [rad/s]

    @property
    def time(self) -> Array:
        """(n,) time stamps. [s]"""
        return np.arange(self.voltage.size) / self.rate

    @cached_property
    def begin(self) -> int:
        """Sample from which on the command leaves its first value: the last one before it."""
        return first_move(self.voltage)

    @cached_property
    def last(self) -> int:
        """The last sample at which the command is at its largest, either way."""
        size = np.abs(self.voltage)
        return int(np.flatnonzero(size >= size.max() - 1e-9)[-1])

    @property
    def goes_straight(self) -> bool:
        """Whether the command goes from its first move to its largest without turning back.

        Turning back by less than a twentieth of the way is noise.
        """
        way = self.voltage[self.begin : self.last + 1] * np.sign(self.voltage[self.last])
        return bool((np.maximum.accumulate(way) - way).max() <= TURNED * np.ptp(self.voltage))

    @property
    def rests(self) -> bool:
        """Whether the command begins at 0 V and stays there long enough to see the drive creep."""
        return bool(self.voltage[0] == 0.0 and self.begin >= REST * self.rate)


def first_move(voltage: Array) -> int:
    """Last sample before a command leaves its first value, 0 where it never does."""
    return max(int(np.argmax(voltage != voltage[0])) - 1, 0)


def trial(
    drive: Drive, voltage: ArrayLike, rate: float = 512.0, *, wanted: ArrayLike | None = None
) -> Trial:
    """A command to judge drives by.

    Parameters
    ----------
    drive : Drive
        The drive as it is.
    voltage : (n,) array_like
        Command. [V]
    rate : float
        Samples a second. [Hz]
    wanted : (n,) array_like, optional
        Speed that a perfect drive would have; by default `proportional_speed` of this drive,
        which stays what is wanted of its variants. [rad/s]

    Raises
    ------
    InputError
        If the command is no row of at least two numbers within ±10 V that changes, or the wanted
        speed is not as long.
    """
    volts = np.array(voltage, dtype=np.float64)
    if volts.ndim != 1 or volts.size < 2 or not (np.abs(volts) <= FULL_VOLTAGE).all():
        raise InputError("A command needs two samples or more, in one row, within ±10 V.")
    if (volts == volts[0]).all():
        raise InputError(f"The command stays at {volts[0]:g} V; to judge a drive it has to change.")
    speed = proportional_speed(drive, volts) if wanted is None else np.array(wanted, dtype=float)
    if speed.shape != volts.shape or not np.isfinite(speed).all():
        raise InputError(
            f"The wanted speed must be {volts.size} finite numbers, one a sample of the command."
        )
    return Trial(volts, float(rate), speed)


def proportional_speed(drive: Drive, voltage: ArrayLike, *, limited: bool = True) -> Array:
    """Speed in proportion to a command (n,) [V] by `speed_per_volt`. [rad/s]

    Up to the drive's speed limits, which nothing but another drive can exceed; or `limited` not.
    """
    volts = np.asarray(voltage, dtype=np.float64)
    plus, minus = speed_per_volt(drive, 1.0), speed_per_volt(drive, -1.0)
    speed: Array = np.where(volts >= 0.0, plus, minus) * volts
    ends = drive.steady_speed([-FULL_VOLTAGE, FULL_VOLTAGE])
    return np.clip(speed, ends.min(), ends.max()) if limited else speed


def speed_per_volt(drive: Drive, sign: float) -> float:
    """Speed limit of a direction by the voltage that first reaches it. [(rad/s)/V]"""
    saturated = saturation(drive, sign)
    limit = abs(drive.steady_speed(float(np.copysign(FULL_VOLTAGE, sign))))
    return limit / (FULL_VOLTAGE if saturated is None else abs(saturated))


# --- outcomes -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Outcome(Result):
    """One number that says what a drive made of a command."""

    name: str
    unit: str
    meaning: str
    compute: Callable[[Array, Trial], Array]
    """From (m, n) speeds [rad/s] and the command to (m,) numbers, NaN where there is none."""
    undefined: str = ""  # Why there may be none, as a half sentence.

    @property
    def words(self) -> str:
        """Its name as words."""
        return self.name.replace("_", " ")


def outcome_unit(outcome: Outcome) -> DisplayUnit:
    """Unit to show an outcome in: that of its quantity, and per cent for a share."""
    return DisplayUnit("%", 100.0) if outcome.unit == "1" else display_unit(outcome.unit)


def outcome_matrix(speed: Array, trial: Trial, outcomes: Sequence[Outcome]) -> Array:
    """(m, K) outcomes, in their units, of (m, n) speeds [rad/s]; NaN where there is none."""
    return np.column_stack([each.compute(speed, trial) for each in outcomes])


def find_outcomes(names: Sequence[str]) -> tuple[Outcome, ...]:
    """Outcomes by name; an unknown name, or none at all, is refused in an `InputError`."""
    if not names:
        raise InputError(f"Name at least one outcome: {', '.join(OUTCOMES)}.")
    for name in names:
        if name not in OUTCOMES:
            close = get_close_matches(name, OUTCOMES, n=1)
            hint = f" (did you mean {close[0]}?)" if close else ""
            raise InputError(
                f"There is no outcome '{name}'{hint}; the outcomes are {', '.join(OUTCOMES)}."
            )
    return tuple(OUTCOMES[name] for name in dict.fromkeys(names))


def _reached(speed: Array, trial: Trial, part: float) -> Array:
    """(m,) time from the command's first move to a part of the final speed. [s]"""
    if not trial.goes_straight:
        return np.full(len(speed), np.nan)
    rising = speed[:, trial.begin : trial.last + 1]
    final = rising[:, -1]
    share = rising * np.sign(final)[:, None] - part * np.abs(final)[:, None]
    after = np.argmax(share >= 0.0, axis=1)  # the last sample always is
    rows, before = np.arange(len(speed)), np.maximum(after - 1, 0)
    low, high = share[rows, before], share[rows, after]
    rise = np.where(high > low, high - low, 1.0)
    samples = np.where(after > 0, before + np.clip(-low / rise, 0.0, 1.0), 0.0)
    time: Array = np.where(final != 0.0, samples / trial.rate, np.nan)
    return time


def _largest_acceleration(speed: Array, trial: Trial) -> Array:
    change = np.diff(speed, axis=1)
    return np.asarray(np.maximum(change.max(axis=1), -change.min(axis=1)) * trial.rate)


def _overshoot(speed: Array, trial: Trial) -> Array:
    rising = speed[:, trial.begin : trial.last + 1]
    final = rising[:, -1]
    peak, size = np.where(final > 0.0, rising.max(axis=1), -rising.min(axis=1)), np.abs(final)
    return np.where(size > 0.0, peak / np.where(size > 0.0, size, 1.0) - 1.0, np.nan)


def _tracking_error(speed: Array, trial: Trial) -> Array:
    error = speed - trial.wanted
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", error, error) / error.shape[1]))


def _travel(speed: Array, trial: Trial) -> Array:
    inner = speed.sum(axis=1) - 0.5 * (speed[:, 0] + speed[:, -1])
    return np.asarray(inner / trial.rate)


_NEVER = "the shaft stands still while the command is at its largest"
_NO_RISE = f"{_NEVER}, or the command turns back on its way there"
_ALL = (
    Outcome(
        *("final_speed", "rad/s"),
        "Speed at the last moment at which the command is at its largest.",
        lambda speed, trial: np.array(speed[:, trial.last]),
    ),
    Outcome(
        *("peak_speed", "rad/s", "Largest speed, either way."),
        lambda speed, trial: np.asarray(np.maximum(speed.max(axis=1), -speed.min(axis=1))),
    ),
    Outcome(
        *("rise_time", "s", "Time from 10 % to 90 % of the final speed."),
        lambda speed, trial: _reached(speed, trial, 0.9) - _reached(speed, trial, 0.1),
        _NO_RISE,
    ),
    Outcome(
        *("response_time", "s", "Time from the command's first move to 90 % of the final speed."),
        partial(_reached, part=0.9),
        _NO_RISE,
    ),
    Outcome(
        *("largest_acceleration", "rad/s^2"),
        "Largest change of speed from sample to sample, either way.",
        _largest_acceleration,
    ),
    Outcome(
        *("overshoot", "1", "How far the speed goes beyond the final one, as a part of it."),
        _overshoot,
        _NEVER,
    ),
    Outcome(
        *("tracking_error", "rad/s"),
        "Root of the mean squared difference from the wanted speed.",
        _tracking_error,
    ),
    Outcome(
        *("creep", "rad/s", "Speed just before the command first leaves zero."),
        lambda speed, trial: (
            np.array(speed[:, trial.begin]) if trial.rests else np.full(len(speed), np.nan)
        ),
        "the command does not rest at 0 V long enough at its start",
    ),
    Outcome("travel", "rad", "How far the shaft has gone at the end.", _travel),
)

OUTCOMES: Mapping[str, Outcome] = {each.name: each for each in _ALL}  # Outcomes by name.


# --- what a drive can do --------------------------------------------------------------------------

Direction = Literal["both", "positive", "negative"]
STEP_LENGTH, STEP_RATE = 2.0, 512.0  # Of the full step that shows the largest acceleration. [s, Hz]


class Performance(NamedTuple):
    """What a drive can do; of two directions the worse one."""

    speed: float  # That the largest command settles at. [rad/s]
    acceleration: float  # Largest one after a full step from rest. [rad/s²]
    tracking_error: float | None
    """RMS difference from the wanted speed, None where none is wanted. [rad/s]"""


def performance(
    drive: Drive, follow: Trial | None = None, *, direction: Direction = "both"
) -> Performance:
    """What a drive can do.

    Parameters
    ----------
    drive : Drive
        From rest.
    follow : Trial, optional
        Its wanted speed is to be followed. The command is in proportion to it, by the drive's own
        ratio (see `speed_per_volt`), and ends at ±10 V: a larger pump is given less voltage.
    direction : {"both", "positive", "negative"}
        Which speed and acceleration count.

    Raises
    ------
    DomainError
        If the drive leaves the model's domain.
    """
    signs = [
        sign
        for name, sign in (("positive", 1.0), ("negative", -1.0))
        if direction in (name, "both")
    ]
    speed, acceleration = np.inf, np.inf
    for sign in signs:
        voltage = np.full(int(STEP_LENGTH * STEP_RATE) + 1, sign * FULL_VOLTAGE)
        voltage[0] = 0.0
        speed = min(speed, abs(drive.steady_speed(float(voltage[-1]))))
        change = sign * np.diff(drive.simulate(voltage, STEP_RATE).shaft_speed)
        acceleration = min(acceleration, float(change.max() * STEP_RATE))
    error = None
    if follow is not None:
        run = drive.simulate(command_for(drive, follow), follow.rate)
        error = rms_difference(run.shaft_speed, follow.wanted)
    return Performance(speed, acceleration, error)


def command_for(drive: Drive, follow: Trial) -> Array:
    """Voltage in proportion to a wanted speed, by the drive's own ratio, within ±10 V. [V]"""
    plus, minus = (max(speed_per_volt(drive, sign), 1e-300) for sign in (1.0, -1.0))
    volts = follow.wanted / np.where(follow.wanted >= 0.0, plus, minus)
    return np.clip(volts, -FULL_VOLTAGE, FULL_VOLTAGE)


def rms_difference(speed: Array, other: Array) -> float:
    """Root of the mean squared difference of two speeds, (n,) each. [rad/s]"""
    return float(np.sqrt(np.mean((speed - other) ** 2)))


# --- many drives at once --------------------------------------------------------------------------

MOST_SAMPLES = 150_000_000  # Samples of speed that are kept at once: 1.2 GB.


class BatchOutcomes(NamedTuple):
    """Outcomes of many drives over one command."""

    values: Array
    """(m, K); NaN where a drive has no such outcome, and in all of a drive that failed."""
    failures: Mapping[int, str]  # Why a drive could not be simulated, by its number.


def batch_speeds(
    drive: Drive, columns: Mapping[str, Array], voltage: Array, rate: float
) -> tuple[Array, Mapping[int, str]]:
    """Speeds (m, n) of many variants of a drive over a command, and why some failed, by number.

    Parameters
    ----------
    drive : Drive
        What is not varied.
    columns : mapping of str to (m,) array
        Values by symbol or column, one a variant, as `Drive.simulate_many` takes them. [SI]
    voltage : (n,) array
        From rest. [V]
    rate : float
        Samples a second. [Hz]

    Raises
    ------
    InputError
        If the columns do not fit the drive or each other, or the speeds take too much memory.
    """
    count = len(next(iter(columns.values())))
    if voltage.size * count > MOST_SAMPLES:
        raise InputError(
            f"{count} drives over {voltage.size} samples take too much memory: take "
            f"{MOST_SAMPLES // voltage.size} drives at most, or give the command at a lower rate."
        )
    run = drive.simulate_many(columns, voltage=voltage, rate=rate)
    assert run.output is not None
    return run.output, run.failures


def batch_outcomes(
    drive: Drive, columns: Mapping[str, Array], trial: Trial, outcomes: Sequence[Outcome]
) -> BatchOutcomes:
    """Outcomes of many variants of a drive over one command; see `batch_speeds`."""
    speeds, failures = batch_speeds(drive, columns, trial.voltage, trial.rate)
    ran = np.ones(len(speeds), dtype=bool)
    ran[list(failures)] = False
    values = np.full((ran.size, len(outcomes)), np.nan)
    values[ran] = outcome_matrix(speeds[ran], trial, outcomes)
    return BatchOutcomes(values, failures)


# --- runs in words --------------------------------------------------------------------------------


def time_share(run: Simulation, limit: Limit) -> float:
    """Share of a record's samples at which a limit acts, 0 to 1.

    Of the dead zone only samples with a command other than 0 count: at rest nothing is asked that
    it could hold back.
    """
    acts = run.active(limit)
    if limit == Limit.DEAD_ZONE:
        command = run.current if run.voltage is None else run.voltage
        acts = acts & (command != 0.0)
    return float(acts.mean())


def peaks(signal: Array) -> tuple[float, float]:
    """Largest values either way of a signal, in its unit; zero where there is none."""
    return max(float(signal.max()), 0.0), min(float(signal.min()), 0.0)


def _time_to_reach(run: Simulation, settled_speed: float) -> float | None:
    """Time [s] from the command's first move to 90 % of a speed [rad/s], None if never reached."""
    begin = first_move(_voltage(run))
    reached = run.shaft_speed[begin:] * np.sign(settled_speed) >= 0.9 * abs(settled_speed)
    if settled_speed == 0.0 or not reached.any():
        return None
    return float(run.time[begin + np.argmax(reached)] - run.time[begin])


def _voltage(run: Simulation) -> Array:
    assert run.voltage is not None  # runs by voltage only
    return run.voltage


def run_tables(run: Simulation) -> tuple[Table, Table]:
    """What a drive did under a command, and how long each of its limits held it back."""
    did = Table("", (Column("Shaft"), Column("", "z.2f"), UNIT))
    position, ways = float(run.shaft_position[-1]), ("positive", "negative")
    for way, speed in zip(ways, peaks(run.shaft_speed), strict=True):
        did.add(f"peak speed, {way}", speed, unit="rad/s")
    did.add("speed at the end", float(run.shaft_speed[-1]), unit="rad/s")
    did.add("position at the end", position, unit="rad", spec="z.1f")
    if display_unit("rad").name == "deg":
        did.add("", position / (2.0 * np.pi), unit="turns", spec="z.3f")
    for way, current in zip(ways, peaks(run.current), strict=True):
        section = way == "positive"
        did.add(f"peak current, {way}", current, unit="A", spec="z.4f", section=section)
    held = Table("", (Column("Limit"), Column("share of time", ".1%")))
    for limit in Limit:
        words = str(limit.name).lower().replace("_", " ")
        held.add(words, time_share(run, limit) or Cell(0.0, "never"))
    return did, held


def side_by_side(drives: Mapping[str, Drive], runs: Mapping[str, Simulation]) -> Table:
    """Two drives or more under the same command: peaks, settled speed and the time to reach it."""
    voltage = _voltage(next(iter(runs.values())))
    volts = float(voltage[np.argmax(np.abs(voltage))])
    positive, negative = zip(*(peaks(run.shaft_speed) for run in runs.values()), strict=True)
    settled = [float(drive.steady_speed(volts)) for drive in drives.values()]
    times = [_time_to_reach(run, each) for run, each in zip(runs.values(), settled, strict=True)]
    columns = [Column(label, "z.2f", none="never") for label in runs]
    made = Table("", (Column(""), *columns, UNIT))
    made.add("peak speed, positive", *positive, unit="rad/s")
    made.add("peak speed, negative", *negative, unit="rad/s")
    made.add(f"settled speed at {volts:g} V", *settled, unit="rad/s")
    made.add("time to 90 % of it", *times, unit="s", spec=".3f")
    return made
