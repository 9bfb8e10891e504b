"""Outcomes of a command: what a drive made of it, for one drive, two or many."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis.capability import saturation
from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.maneuvers import Maneuver, sampled
from swashplate.parameters import FULL_VOLTAGE
from swashplate.results import Result
from swashplate.tables import UNIT, Column, Table
from swashplate.units import DisplayUnit, display_unit, of_shaft

if TYPE_CHECKING:
    from swashplate.drive import Simulation

Array = NDArray[np.float64]

# --- a command to compare drives by ---------------------------------------------------------------

REST = 0.5
"""A command that rests at 0 V this long lets the drive settle at its creep. [s]"""
TURNED = 0.05
"""Share of its range by which a command may turn back and still go one way. [1]"""


@dataclass(frozen=True, eq=False)
class Trial(Result):
    """A command, and the speed that a perfect drive would make of it. Made by `trial_of`."""

    voltage: Array
    """(n,) command. [V]"""
    rate: float
    """Samples a second. [Hz]"""
    reference: Array
    """(n,) speed of the shaft that is compared with. [rad/s]"""

    @property
    def time(self) -> Array:
        """(n,) time stamps. [s]"""
        return np.arange(self.voltage.size) / self.rate

    @cached_property
    def begin(self) -> int:
        """Last sample before the command leaves its first value."""
        return first_move(self.voltage)

    @cached_property
    def last(self) -> int:
        """Last sample at which the command is at its largest, either way."""
        size = np.abs(self.voltage)
        return int(np.flatnonzero(size >= size.max() - 1e-9)[-1])

    @property
    def goes_straight(self) -> bool:
        """Whether the command goes from its first move to its largest without turning back.

        Turning back by less than a twentieth of the way is noise.
        """
        approach = self.voltage[self.begin : self.last + 1] * np.sign(self.voltage[self.last])
        turned_back = (np.maximum.accumulate(approach) - approach).max()
        return bool(turned_back <= TURNED * np.ptp(self.voltage))


def first_move(voltage: Array) -> int:
    """Last sample before a command leaves its first value, 0 if it never does."""
    return max(int(np.argmax(voltage != voltage[0])) - 1, 0)


def trial_of(
    drive: Drive,
    voltage: ArrayLike | Maneuver,
    rate: float = 512.0,
    *,
    reference: ArrayLike | None = None,
) -> Trial:
    """A command to compare drives by.

    Parameters
    ----------
    drive : Drive
        The drive as it is.
    voltage : (n,) array_like or Maneuver
        Command. [V]
    rate : float
        Samples a second. [Hz]
    reference : (n,) array_like, optional
        Speed that a perfect drive would have; by default `proportional_speed` of this drive,
        which stays the reference of its variants. [rad/s]

    Returns
    -------
    Trial
        Command [V] and reference speed [rad/s] at the samples.

    Raises
    ------
    InputError
        If the command is not a row of at least two numbers within ±10 V that changes, or the
        reference speed is not as long.

    Examples
    --------
    >>> from swashplate import Drive, analysis, maneuvers
    >>> hoist = Drive.preset("hoist")
    >>> analysis.trial_of(hoist, maneuvers.step(9.0)).reference.shape
    (5121,)
    """
    volts = np.array(sampled(voltage, rate), dtype=np.float64)
    if volts.ndim != 1 or volts.size < 2 or not (np.abs(volts) <= FULL_VOLTAGE).all():
        raise InputError("A command needs two samples or more, in one row, within ±10 V.")
    if (volts == volts[0]).all():
        raise InputError(
            f"The command stays at {volts[0]:g} V; it must change if drives are compared."
        )
    if reference is None:
        reference = proportional_speed(drive, volts)
    return Trial(volts, float(rate), checked_speed(reference, volts.size))


def checked_speed(speed: ArrayLike, size: int) -> Array:
    """A reference speed, an `InputError` if it is not `size` finite numbers. [rad/s]"""
    reference = np.array(speed, dtype=np.float64)
    if reference.shape != (size,) or not np.isfinite(reference).all():
        raise InputError(f"The reference speed must be {size} finite numbers, one a sample.")
    return reference


def proportional_speed(drive: Drive, voltage: ArrayLike, *, limited: bool = True) -> Array:
    """Speed in proportion to a command (n,) [V] by `speed_per_volt`. [rad/s]

    Up to the drive's speed limits, which nothing but another drive can exceed; or `limited` not.
    """
    volts = np.asarray(voltage, dtype=np.float64)
    plus, minus = speed_per_volt(drive, 1.0), speed_per_volt(drive, -1.0)
    speed: Array = np.where(volts >= 0.0, plus, minus) * volts
    if not limited:
        return speed
    limits = drive.steady_speed([-FULL_VOLTAGE, FULL_VOLTAGE])
    return np.clip(speed, limits.min(), limits.max())


def speed_per_volt(drive: Drive, sign: float) -> float:
    """Speed limit of a direction by the voltage that first reaches it. [(rad/s)/V]"""
    full = float(np.copysign(FULL_VOLTAGE, sign))
    return abs(drive.steady_speed(full) / (saturation(drive, full) or full))


# --- outcomes -------------------------------------------------------------------------------------


Compute = Callable[[Array, Trial], Array]
"""From (m, n) speeds [rad/s] and the command to (m,) numbers, NaN if there is none."""


@dataclass(frozen=True)
class Outcome(Result):
    """One number that describes the response of a drive to a command."""

    name: str
    unit: str
    meaning: str
    compute: Compute
    undefined: str = ""
    """Why it may be undefined, as a half sentence."""

    @property
    def label(self) -> str:
        """Its name with spaces."""
        return self.name.replace("_", " ")

    @property
    def shown_unit(self) -> DisplayUnit:
        """Unit to show it in: that of its quantity, or per cent for a share."""
        return DisplayUnit("%", 100.0) if self.unit == "1" else display_unit(of_shaft(self.unit))

    @property
    def spec(self) -> str:
        """Format of its numbers."""
        return {"s": "z.3f", "1": "z.2%"}.get(self.unit, "z.2f")

    def add_to(self, table: Table, cells: Sequence[float]) -> None:
        """Add a row of its values, SI."""
        unit = "" if self.unit == "1" else of_shaft(self.unit)
        table.add(self.label, *cells, unit=unit, spec=self.spec)


OUTCOMES: dict[str, Outcome] = {}
"""Outcomes by name: name and meaning are those of the functions below."""


def _outcome(unit: str, undefined: str = "") -> Callable[[Compute], Compute]:
    """Register a function as an outcome: its name, and its docstring as the meaning.

    `undefined` is the reason why the outcome may be NaN.
    """

    def register(compute: Compute) -> Compute:
        name = compute.__name__
        meaning = str(compute.__doc__)
        OUTCOMES[name] = Outcome(name, unit, meaning, compute, undefined)
        return compute

    return register


_NEVER = "the shaft does not move while the command is at its largest"
_NO_RISE = f"{_NEVER}, or the command reverses before it gets there"


@_outcome("rad/s")
def final_speed(speed: Array, trial: Trial) -> Array:
    """Speed at the last moment at which the command is at its largest."""
    return np.array(speed[:, trial.last])


@_outcome("rad/s")
def peak_speed(speed: Array, trial: Trial) -> Array:
    """Largest speed, either way."""
    return np.asarray(np.abs(speed).max(axis=1))


@_outcome("s", _NO_RISE)
def rise_time(speed: Array, trial: Trial) -> Array:
    """Time from 10 % to 90 % of the final speed."""
    return _reached(speed, trial, 0.9) - _reached(speed, trial, 0.1)


@_outcome("s", _NO_RISE)
def response_time(speed: Array, trial: Trial) -> Array:
    """Time from the command's first move to 90 % of the final speed."""
    return _reached(speed, trial, 0.9)


@_outcome("rad/s^2")
def largest_acceleration(speed: Array, trial: Trial) -> Array:
    """Largest change of speed from sample to sample, either way."""
    return np.asarray(np.abs(np.diff(speed, axis=1)).max(axis=1) * trial.rate)


@_outcome("1", _NEVER)
def overshoot(speed: Array, trial: Trial) -> Array:
    """How far the speed goes beyond the final one, as a part of it."""
    rising = speed[:, trial.begin : trial.last + 1]
    final = np.where(rising[:, -1:] == 0.0, np.nan, rising[:, -1:])
    return np.asarray((rising / final).max(axis=1) - 1.0)


@_outcome("rad/s")
def tracking_error(speed: Array, trial: Trial) -> Array:
    """Root of the mean squared difference from the reference speed."""
    return np.array([rms_difference(row, trial.reference) for row in speed])


@_outcome("rad/s", "the command does not stay at 0 V long enough at the start")
def creep(speed: Array, trial: Trial) -> Array:
    """Speed just before the command first leaves zero."""
    rests = trial.voltage[0] == 0.0 and trial.begin >= REST * trial.rate
    if not rests:
        return np.full(len(speed), np.nan)
    return np.array(speed[:, trial.begin])


@_outcome("rad")
def travel(speed: Array, trial: Trial) -> Array:
    """How far the shaft has gone at the end."""
    return np.asarray(np.trapezoid(speed, dx=1.0 / trial.rate, axis=1))


def _reached(speed: Array, trial: Trial, share: float) -> Array:
    """(m,) time from the command's first move to a share of the final speed. [s]"""
    if not trial.goes_straight:
        return np.full(len(speed), np.nan)
    rising = speed[:, trial.begin : trial.last + 1]
    final = rising[:, -1]
    excess = rising * np.sign(final)[:, None] - share * np.abs(final)[:, None]
    first_beyond = np.argmax(excess >= 0.0, axis=1)  # the last sample always is
    last_within = np.maximum(first_beyond - 1, 0)
    rows = np.arange(len(speed))
    low, high = excess[rows, last_within], excess[rows, first_beyond]
    rise = np.where(high > low, high - low, 1.0)
    samples = np.where(first_beyond > 0, last_within + np.clip(-low / rise, 0.0, 1.0), 0.0)
    return np.asarray(np.where(final != 0.0, samples / trial.rate, np.nan))


def rms_difference(speed: Array, reference: Array) -> float:
    """Root of the mean squared difference of two speeds, (n,) each. [rad/s]"""
    return float(np.sqrt(np.mean((speed - reference) ** 2)))


def meant(name: str, names: Iterable[str]) -> str:
    """A hint at the name that an unknown one resembles, empty if it resembles none."""
    close = get_close_matches(name, names, n=1)
    return f" (did you mean {close[0]}?)" if close else ""


def find_outcomes(names: Sequence[str]) -> tuple[Outcome, ...]:
    """Outcomes by name; an unknown name, or none at all, is refused in an `InputError`."""
    if not names:
        raise InputError(f"Name at least one outcome: {', '.join(OUTCOMES)}.")
    for name in names:
        if name not in OUTCOMES:
            raise InputError(
                f"There is no outcome '{name}'{meant(name, OUTCOMES)}; the outcomes are "
                f"{', '.join(OUTCOMES)}."
            )
    return tuple(OUTCOMES[name] for name in dict.fromkeys(names))


def outcome_matrix(speed: Array, trial: Trial, outcomes: Sequence[Outcome]) -> Array:
    """(m, K) outcomes, in their units, of (m, n) speeds [rad/s]; NaN if there is none."""
    values = [outcome.compute(speed, trial) for outcome in outcomes]
    return np.array(values).reshape(len(outcomes), len(speed)).T


# --- runs side by side ----------------------------------------------------------------------------


def side_by_side(runs: Mapping[str, Simulation]) -> Table:
    """Outcomes of drives under the same command, by the drives' names.

    Without those that `key_numbers` has of every machine, and one that needs a reference.
    """
    first = next(iter(runs.values()))
    assert first.voltage is not None  # runs by voltage only
    trial = Trial(first.voltage, first.record.rate, first.shaft_speed)
    speeds = np.array([run.shaft_speed for run in runs.values()])
    columns = (Column(name, "z.2f", none="none") for name in runs)
    table = Table("", (Column(""), *columns, UNIT))
    for outcome in OUTCOMES.values():
        if outcome.name not in ("tracking_error", "largest_acceleration", "creep"):
            outcome.add_to(table, outcome.compute(speeds, trial).tolist())
    return table
