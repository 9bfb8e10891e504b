"""Outcomes of a command: what a drive made of it, one number each, for one drive or many."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property, partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.drive import Drive
from swashplate.equations.marching.lanes import LANES
from swashplate.errors import InputError
from swashplate.executors import Serial, available_cores
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.units import DisplayUnit, display_unit

# --- trial ----------------------------------------------------------------------------------------


Array = NDArray[np.float64]

REST = 0.5
"""A command that rests at 0 V this long lets the drive settle at its creep. [s]"""
STOPPED = 1.0 - 1e-9
"""Part of the speed limit from which the plate counts as at its stop."""


@dataclass(frozen=True, eq=False)
class Trial:
    """A command, and the speed that a perfect drive would make of it. Make it with `trial`."""

    voltage: Array
    """(n,) [V]"""
    rate: float
    """Samples a second. [Hz]"""
    wanted: Array
    """(n,) speed of the shaft. [rad/s]"""

    @property
    def time(self) -> Array:
        """(n,) time stamps. [s]"""
        return np.arange(self.voltage.size) / self.rate

    @cached_property
    def begin(self) -> int:
        """Sample from which on the command leaves its first value: the last one before it."""
        return max(int(np.argmax(self.voltage != self.voltage[0])) - 1, 0)

    @cached_property
    def held(self) -> int:
        """The last sample at which the command is at its largest, either way."""
        size = np.abs(self.voltage)
        return int(np.flatnonzero(size >= size.max() - 1e-9)[-1])

    @property
    def rests(self) -> bool:
        """Whether the command begins at 0 V and stays there long enough to see the drive creep."""
        return bool(self.voltage[0] == 0.0 and self.begin >= REST * self.rate)


def trial(
    drive: Drive,
    voltage: ArrayLike,
    rate: float = 512.0,
    *,
    wanted: ArrayLike | None = None,
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
    if wanted is None:
        speed = proportional_speed(drive, volts)
    else:
        speed = np.array(wanted, dtype=np.float64)
        if speed.shape != volts.shape or not np.isfinite(speed).all():
            raise InputError(
                f"The wanted speed must be {volts.size} finite numbers, one a sample of the "
                "command."
            )
    return Trial(volts, float(rate), speed)


def proportional_speed(drive: Drive, voltage: ArrayLike) -> Array:
    """Speed in proportion to the command, each way at the drive's own ratio. [rad/s]

    Parameters
    ----------
    drive : Drive
        Its speed limit by the voltage that first reaches it is the ratio, beyond the limit, too.
    voltage : (n,) array_like
        Command. [V]
    """
    volts = np.asarray(voltage, dtype=np.float64)
    plus, minus = speed_per_volt(drive, 1.0), speed_per_volt(drive, -1.0)
    return np.where(volts >= 0.0, plus, minus) * volts


def speed_per_volt(drive: Drive, sign: float) -> float:
    """Speed limit by the voltage that first reaches it. [(rad/s)/V]

    Parameters
    ----------
    drive : Drive
        The drive.
    sign : float
        Positive or negative direction.
    """
    low, high = 0.0, FULL_VOLTAGE
    limit = abs(drive.steady_speed(float(np.copysign(FULL_VOLTAGE, sign))))
    for _ in range(4):  # each pass narrows the place a hundredfold
        volts = np.linspace(low, high, 101)
        stopped = np.abs(drive.steady_speed(np.copysign(volts, sign))) >= STOPPED * limit
        first = max(int(np.argmax(stopped)), 1)
        low, high = float(volts[first - 1]), float(volts[first])
    return limit / high


# --- outcomes -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Outcome:
    """One number that says what a drive made of a command."""

    name: str
    unit: str
    meaning: str
    undefined: str
    """Why there may be none, as a half sentence."""
    compute: Callable[[Array, Trial], Array]

    @property
    def words(self) -> str:
        """Its name as words."""
        return self.name.replace("_", " ")

    """From (m, n) speeds [rad/s] and the command to (m,) numbers, NaN where there is none."""


def outcome_unit(outcome: Outcome) -> DisplayUnit:
    """Unit to show an outcome in: that of its quantity, and per cent for a share."""
    return DisplayUnit("%", 100.0) if outcome.unit == "1" else display_unit(outcome.unit)


def outcome_matrix(speed: Array, trial: Trial, outcomes: Sequence[Outcome]) -> Array:
    """Outcomes of some drives.

    Parameters
    ----------
    speed : (m, n) array
        Of the shaft under the trial's command, one drive a row. [rad/s]
    trial : Trial
        The command.
    outcomes : sequence of Outcome
        K of them.

    Returns
    -------
    (m, K) array
        In the outcomes' units; NaN where there is none; `Outcome.undefined` says why.
    """
    return np.column_stack([each.compute(speed, trial) for each in outcomes])


def find_outcomes(names: Sequence[str]) -> tuple[Outcome, ...]:
    """Outcomes by name.

    Raises
    ------
    InputError
        If there is none of a name, or none is named.
    """
    if not names:
        raise InputError(f"Name at least one outcome: {', '.join(OUTCOMES)}.")
    return tuple(_find(name) for name in dict.fromkeys(names))


def _find(name: str) -> Outcome:
    if name not in OUTCOMES:
        close = get_close_matches(name, OUTCOMES, n=1)
        hint = f" (did you mean {close[0]}?)" if close else ""
        raise InputError(
            f"There is no outcome '{name}'{hint}; the outcomes are {', '.join(OUTCOMES)}."
        )
    return OUTCOMES[name]


def _final_speed(speed: Array, trial: Trial) -> Array:
    return np.array(speed[:, trial.held])


def _peak_speed(speed: Array, trial: Trial) -> Array:
    peak: Array = np.maximum(speed.max(axis=1), -speed.min(axis=1))
    return peak


def _rise_time(speed: Array, trial: Trial) -> Array:
    late, early = _reached(speed, trial, 0.9), _reached(speed, trial, 0.1)
    return late - early


def _response_time(speed: Array, trial: Trial) -> Array:
    return _reached(speed, trial, 0.9)


def _reached(speed: Array, trial: Trial, part: float) -> Array:
    """(m,) time from the command's first move to a part of the final speed. [s]"""
    rising = speed[:, trial.begin : trial.held + 1]
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
    largest: Array = np.maximum(change.max(axis=1), -change.min(axis=1)) * trial.rate
    return largest


def _overshoot(speed: Array, trial: Trial) -> Array:
    rising = speed[:, trial.begin : trial.held + 1]
    final = rising[:, -1]
    peak = np.where(final > 0.0, rising.max(axis=1), -rising.min(axis=1))
    size = np.abs(final)
    beyond: Array = np.where(size > 0.0, peak / np.where(size > 0.0, size, 1.0) - 1.0, np.nan)
    return beyond


def _tracking_error(speed: Array, trial: Trial) -> Array:
    error = speed - trial.wanted
    rms: Array = np.sqrt(np.einsum("ij,ij->i", error, error) / error.shape[1])
    return rms


def _creep(speed: Array, trial: Trial) -> Array:
    if not trial.rests:
        return np.full(len(speed), np.nan)
    return np.array(speed[:, trial.begin])


def _travel(speed: Array, trial: Trial) -> Array:
    inner = speed.sum(axis=1) - 0.5 * (speed[:, 0] + speed[:, -1])
    travel: Array = inner / trial.rate
    return travel


_NEVER = "the shaft stands still while the command is at its largest"
_ALL = (
    Outcome(
        "final_speed",
        "rad/s",
        "Speed at the last moment at which the command is at its largest.",
        "",
        _final_speed,
    ),
    Outcome("peak_speed", "rad/s", "Largest speed, either way.", "", _peak_speed),
    Outcome(
        "rise_time",
        "s",
        "Time from 10 % to 90 % of the final speed.",
        _NEVER,
        _rise_time,
    ),
    Outcome(
        "response_time",
        "s",
        "Time from the command's first move to 90 % of the final speed.",
        _NEVER,
        _response_time,
    ),
    Outcome(
        "largest_acceleration",
        "rad/s^2",
        "Largest change of speed from sample to sample, either way.",
        "",
        _largest_acceleration,
    ),
    Outcome(
        "overshoot",
        "1",
        "How far the speed goes beyond the final one, as a part of it.",
        _NEVER,
        _overshoot,
    ),
    Outcome(
        "tracking_error",
        "rad/s",
        "Root of the mean squared difference from the wanted speed.",
        "",
        _tracking_error,
    ),
    Outcome(
        "creep",
        "rad/s",
        "Speed just before the command first leaves zero.",
        "the command does not rest at 0 V long enough at its start",
        _creep,
    ),
    Outcome("travel", "rad", "How far the shaft has gone at the end.", "", _travel),
)

OUTCOMES: Mapping[str, Outcome] = {each.name: each for each in _ALL}
"""Outcomes by name."""


# --- performance ----------------------------------------------------------------------------------


Direction = Literal["both", "positive", "negative"]

SIGNS: Mapping[Direction, tuple[float, ...]] = {
    "both": (1.0, -1.0),
    "positive": (1.0,),
    "negative": (-1.0,),
}
STEP_LENGTH = 2.0
"""Of the full step that shows the largest acceleration. [s]"""
STEP_RATE = 512.0


class Performance(NamedTuple):
    """What a drive can do; of two directions the worse one."""

    speed: float
    """That the largest command settles at. [rad/s]"""
    acceleration: float
    """Largest one after a full step from rest. [rad/s²]"""
    tracking_error: float | None
    """RMS difference from the wanted speed, None where none is wanted. [rad/s]"""


@dataclass(frozen=True, eq=False)
class Wanted:
    """A speed to follow. Make it with `wanted`, which checks."""

    speed: Array
    """(n,) [rad/s]"""
    rate: float
    """Samples a second. [Hz]"""


def wanted(speed: ArrayLike, rate: float = 512.0) -> Wanted:
    """A speed to follow.

    Parameters
    ----------
    speed : (n,) array_like
        [rad/s]
    rate : float
        Samples a second. [Hz]

    Raises
    ------
    InputError
        If it is no row of two finite numbers or more.
    """
    profile = np.array(speed, dtype=np.float64)
    if profile.ndim != 1 or profile.size < 2 or not np.isfinite(profile).all():
        raise InputError("The wanted speed must be two finite numbers or more, in one row.")
    return Wanted(profile, float(rate))


def performance(
    drive: Drive, follow: Wanted | None = None, *, direction: Direction = "both"
) -> Performance:
    """What a drive can do.

    Parameters
    ----------
    drive : Drive
        From rest.
    follow : Wanted, optional
        A speed to follow. The command is in proportion to it, by the drive's own ratio (see
        `trial.speed_per_volt`), and ends at ±10 V: a larger pump is given less voltage.
    direction : {"both", "positive", "negative"}
        Which speed and acceleration count.

    Raises
    ------
    DomainError
        If the drive leaves the model's domain.
    """
    signs = SIGNS[direction]
    speed = min(abs(drive.steady_speed(sign * FULL_VOLTAGE)) for sign in signs)
    acceleration = min(_acceleration(drive, sign) for sign in signs)
    error = None
    if follow is not None:
        run = drive.simulate(command_for(drive, follow), follow.rate)
        error = float(np.sqrt(np.mean((run.shaft_speed - follow.speed) ** 2)))
    return Performance(float(speed), acceleration, error)


def command_for(drive: Drive, follow: Wanted) -> Array:
    """Voltage in proportion to a wanted speed, by the drive's own ratio, within ±10 V. [V]"""
    ratio = np.where(
        follow.speed >= 0.0,
        max(speed_per_volt(drive, 1.0), 1e-300),
        max(speed_per_volt(drive, -1.0), 1e-300),
    )
    return np.clip(follow.speed / ratio, -FULL_VOLTAGE, FULL_VOLTAGE)


def _acceleration(drive: Drive, sign: float) -> float:
    """Largest acceleration in a direction after a full step. [rad/s²]"""
    voltage = np.full(int(STEP_LENGTH * STEP_RATE) + 1, sign * FULL_VOLTAGE)
    voltage[0] = 0.0
    change = np.diff(drive.simulate(voltage, STEP_RATE).shaft_speed)
    return float((sign * change).max() * STEP_RATE)


# --- outcome batch --------------------------------------------------------------------------------


SAMPLES_AT_ONCE = 2**20
"""Samples of speed that a block of drives holds: 8 MB, whatever the number of drives."""


@dataclass(frozen=True, eq=False)
class BatchOutcomes:
    """Outcomes of many drives over one command."""

    outcomes: tuple[Outcome, ...]
    values: Array
    """(m, K); NaN where a drive has no such outcome, and in all of a drive that failed."""
    failures: Mapping[int, str]
    """Why a drive could not be simulated, by its number."""

    def undefined(self, number: int) -> int:
        """How many of the drives that ran have no such outcome."""
        failed = np.zeros(len(self.values), dtype=bool)
        failed[list(self.failures)] = True
        return int((np.isnan(self.values[:, number]) & ~failed).sum())


def batch_outcomes(
    drive: Drive,
    columns: Mapping[str, Array],
    trial: Trial,
    outcomes: Sequence[Outcome],
    *,
    threads: int | None = None,
) -> BatchOutcomes:
    """Simulate many variants of a drive over one command and keep only their outcomes.

    Parameters
    ----------
    drive : Drive
        What is not varied.
    columns : mapping of str to (m,) array
        Values by symbol or column, one a variant, as `Drive.simulate_many` takes them. [SI]
    trial : Trial
        The command, from rest.
    outcomes : sequence of Outcome
        What to keep.
    threads : int, optional
        Blocks at once, one a core by default. The numbers do not depend on it.

    Raises
    ------
    InputError
        If the columns do not fit the drive or each other.

    Notes
    -----
    Speeds are made block by block and dropped, so that memory grows with the outcomes alone.
    """
    count = len(next(iter(columns.values())))

    def block(first: int, size: int) -> tuple[Array, dict[int, str]]:
        part = {name: values[first : first + size] for name, values in columns.items()}
        run = drive.simulate_many(part, voltage=trial.voltage, rate=trial.rate, executor=Serial())
        assert run.output is not None
        ran = np.ones(len(run.output), dtype=bool)
        ran[list(run.failures)] = False
        kept = np.full((ran.size, len(outcomes)), np.nan)
        kept[ran] = outcome_matrix(run.output[ran], trial, outcomes)
        return kept, {first + k: why for k, why in run.failures.items()}

    # whole blocks of what the batch marches side by side
    size = max(SAMPLES_AT_ONCE // trial.voltage.size // LANES * LANES, LANES)
    with ThreadPoolExecutor(threads or available_cores()) as pool:
        done = list(pool.map(partial(block, size=size), range(0, count, size)))
    return BatchOutcomes(
        tuple(outcomes),
        np.concatenate([kept for kept, _ in done]),
        {k: why for _, failures in done for k, why in failures.items()},
    )


def undefined_sentences(found: BatchOutcomes) -> Iterator[str]:
    """What some of the drives have not, and why."""
    for number, each in enumerate(found.outcomes):
        missing = found.undefined(number)
        if missing:
            yield (
                f"{missing} of {len(found.values)} variants have no {each.name}: {each.undefined}."
            )
