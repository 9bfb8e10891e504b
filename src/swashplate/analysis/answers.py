"""The numbers that matter of a machine, computed here for everything that shows them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.capability import dead_zone, largest_commands, saturation, without_limits
from swashplate.analysis.limits import limit_shares
from swashplate.analysis.propagation import (
    ERROR_OF_ASSUMED,
    assumed_parameters,
    spread_of,
)
from swashplate.drive import (
    AT_BOUND,
    FIXED,
    NOT_SEEN,
    ActingLimit,
    Direction,
    Drive,
    FirstChange,
    KeyNumber,
    KeyNumbers,
    Simulation,
    command_unit,
)
from swashplate.errors import InputError, SwashplateError
from swashplate.identification import (
    Fit,
    Identification,
    Optimum,
    PredictionError,
    error_of_motion,
    prediction_errors,
    tested_commands,
)
from swashplate.identification.estimation import limits_unreached
from swashplate.identification.statistics import unseen_limits
from swashplate.machine.marching import SOURCE_RATE
from swashplate.parameters import LoggedCommand

Array = NDArray[np.float64]

SECONDS = 8.0
"""Length of the full step that the numbers are read from. [s]"""
MOVES, MOST_OF_IT = 0.02, 0.63
"""Parts of the top speed at which the delay ends, and the lag."""
NO_JUMP = 1e-9
"""Jump of the speed over the top speed up to which it is rounding. [1]"""
OPEN = 0.1
"""Share of a number by which limits that no test shows can move it, from which it has one end
alone; what moves it by less is taken into its interval. [1]"""
DECIDES = 0.01
"""The same of a drive without a fit, which has no interval to take it into. [1]"""
SHOWN_LIMITS = 3
"""Limits that act longest and are named."""


class _Kind(NamedTuple):
    """A number that a drive has each way, in the order of the rows of `_Values.of`."""

    name: str
    unit: str
    of_command: int = 0
    """Power of the command's unit in it."""


DEAD_ZONE, GAIN, JUMP, TOP_SPEED, ACCELERATION, DELAY, LAG, CREEP = range(8)
KINDS = (
    _Kind("dead_zone", "V", 1),
    _Kind("gain", "rad/s/V", -1),
    _Kind("jump", "rad/s"),
    _Kind("top_speed", "rad/s"),
    _Kind("acceleration", "rad/s^2"),
    _Kind("delay", "s"),
    _Kind("lag", "s"),
    _Kind("creep", "rad/s"),
)
UNSIGNED = (GAIN, DELAY, LAG)
"""Rows that are positive both ways."""


def key_numbers(machine: Drive | Fit | Identification) -> KeyNumbers:
    """The numbers that matter of a machine: what it does, how fast, how late, and what limits it.

    Parameters
    ----------
    machine : Drive, Fit or Identification
        A drive, or a fit of one, which adds 95 % intervals.

    Returns
    -------
    KeyNumbers
        Each way the edge of the dead zone [V], the gain beyond it up to the largest command or to
        saturation [rad/s/V], the jump of the steady speed at the edge [rad/s]; of a step from rest
        to the largest command the steady speed [rad/s], the largest acceleration [rad/s²], the
        delay up to 2 % of the change of speed and the lag from there to 63 % [s]; the creep at rest
        [rad/s]. Commands are in the stick's own volts, from its rest. The largest command is that
        of the drive's tests, ±10 V at the card for a drive without any. A drive that has none of
        these numbers says why in the remarks.

    Raises
    ------
    InputError
        For the fit of a user-defined model.

    Examples
    --------
    >>> from swashplate import Drive, analysis
    >>> numbers = analysis.key_numbers(Drive.preset("hoist"))
    >>> round(numbers["dead_zone_plus"].value, 3), round(numbers["creep"].value, 3)
    (0.206, 0.054)
    """
    if isinstance(machine, Identification):
        if machine.key_numbers is None:
            raise InputError(f"{machine.fit.parameters.name} is a user-defined model, not a drive.")
        return machine.key_numbers
    if isinstance(machine, Fit):
        parameters = replace(
            machine.drive.parameters,
            unreached=limits_unreached(machine.runs, machine.drive.parameters),
            tested=tested_commands(machine.runs),
        )
        return numbers_of_fit(Drive(parameters), machine, prediction_errors(machine, ()))
    values = _Values(machine)
    try:
        found = _without_fit(machine, values)
    except SwashplateError as error:
        return values.none(error)
    return values.shown(found, _limits_of(machine, values))


def numbers_of_fit(
    drive: Drive, fit: Optimum, predictions: Iterable[PredictionError]
) -> KeyNumbers:
    """The numbers of a fitted drive with their intervals; see `key_numbers`.

    The drive knows what its tests reached, and how its logs hold the command. What is stated of
    predictions widens delay and lag: h² = (1.96 σ)² + (e / a)², with the model's own error e of the
    speed (`Band`) and the acceleration a at the instants at which they end.
    """
    values = _Values(drive)
    try:
        found, remarks = _with_fit(drive, fit, values, error_of_motion(predictions))
        limits = _limits_of(drive, values, unseen_limits(fit))
    except SwashplateError as error:
        return values.none(error)
    numbers = values.shown(found, limits)
    return replace(numbers, fitted=True, remarks=(*numbers.remarks, *remarks))


@dataclass(frozen=True)
class _Found:
    """Numbers (8, 2) each way, with the ends of their intervals."""

    values: Array
    lower: Array
    """NaN if there is no end."""
    upper: Array
    notes: NDArray[np.object_]


def _open_ends(values: Array) -> _Found:
    """Numbers without intervals."""
    nothing = np.full(values.shape, np.nan)
    return _Found(values, nothing, nothing.copy(), np.full(values.shape, "", dtype=object))


class _Values:
    """How the numbers of a drive are read off it, and how they are shown."""

    def __init__(self, drive: Drive) -> None:
        self.drive = drive
        self.tested = drive.parameters.tested
        self.largest = largest_commands(drive)

    def of(self, drive: Drive) -> Array:
        """Numbers of a drive like this one, (8, 2): each way, plus first; NaN where it has none."""
        rate = drive.parameters.rate
        if rate not in (None, SOURCE_RATE):
            drive = drive.at_every_rate()
        numbers = np.full((len(KINDS), 2), np.nan)
        numbers[CREEP] = rest = float(drive.steady_speed(0.0))
        for side, direction in enumerate((1.0, -1.0)):
            volts = direction * self.largest[side]
            final = float(drive.steady_speed(volts))
            numbers[TOP_SPEED, side] = final
            inside, outside = dead_zone(drive, direction)
            numbers[DEAD_ZONE, side] = inside
            if outside is not None and abs(outside) < abs(volts):
                begins = float(drive.steady_speed(outside))
                numbers[JUMP, side] = (
                    begins - rest if abs(begins - rest) > NO_JUMP * abs(final) else 0.0
                )
                saturated = saturation(drive, volts)
                end = volts if saturated is None else saturated
                if end != outside:
                    numbers[GAIN, side] = (final - begins) / (end - outside)
            if final != rest:
                numbers[ACCELERATION : LAG + 1, side] = self._of_step(drive, volts, rest, final)
        return numbers

    def _of_step(self, drive: Drive, volts: float, rest: float, final: float) -> Array:
        """Acceleration, delay and lag (3,) of a step from rest."""
        run = _step(drive, volts)
        direction = np.sign(volts)
        acceleration = direction * SOURCE_RATE * float((direction * np.diff(run.shaft_speed)).max())
        change = np.maximum.accumulate((run.shaft_speed - rest) / (final - rest))
        if change[-1] < MOST_OF_IT:
            return np.array([acceleration, np.nan, np.nan])
        begin, end = np.interp((MOVES, MOST_OF_IT), change, run.time)
        return np.array([acceleration, begin, end - begin])

    def own_error(self, numbers: Array, stated: PredictionError) -> Array:
        """By how much the model's own error moves each of the numbers (8, 2): delay and lag.

        Where the speed is off by e and grows with a, the instant at which it gets there is off by
        e/a. A lag has two such instants, which shift together in part: the larger of both counts.
        """
        moved = np.zeros(numbers.shape)
        drive = self.drive
        if drive.parameters.rate not in (None, SOURCE_RATE):
            drive = drive.at_every_rate()
        for side, direction in enumerate((1.0, -1.0)):
            ends = numbers[DELAY, side], numbers[DELAY, side] + numbers[LAG, side]
            if not np.isfinite(ends).all():
                continue
            run = _step(drive, direction * self.largest[side])
            speed = np.interp(ends, run.time, run.shaft_speed)
            rate = np.interp(ends, run.time, np.gradient(run.shaft_speed, run.time))
            late = np.sqrt(stated.squares(speed, rate)) / np.abs(rate)
            moved[DELAY, side], moved[LAG, side] = late[0], late.max()
        return moved

    def shown(self, found: _Found, limits: _Limits) -> KeyNumbers:
        """The record of the numbers, in the stick's own volts."""
        stick = self.drive.parameters.command
        per_volt = _logged_per_volt(stick)
        numbers = list[KeyNumber]()
        directions: tuple[Direction, Direction] = ("plus", "minus")
        for row, kind in enumerate(KINDS):
            factor, unit = 1.0, kind.unit
            if self.drive.parameters.motion == "rod":
                unit = unit.replace("rad", "m")
            if kind.of_command:
                factor = per_volt**kind.of_command
                factor = abs(factor) if row in UNSIGNED else factor
                unit = unit.replace("V", command_unit(stick))
            for side, direction in enumerate(directions):
                if row == CREEP and side:
                    continue
                ends = [
                    None if not np.isfinite(end) else factor * float(end)
                    for end in (found.lower[row, side], found.upper[row, side])
                ]
                value = found.values[row, side]
                numbers.append(
                    KeyNumber(
                        name=kind.name,
                        direction="" if row == CREEP else direction,
                        unit=unit,
                        value=factor * float(value) if np.isfinite(value) else None,
                        lower=ends[0] if factor > 0.0 else ends[1],
                        upper=ends[1] if factor > 0.0 else ends[0],
                        note=str(found.notes[row, side]),
                    )
                )
        return replace(
            self._record(),
            numbers=tuple(numbers),
            limits=limits.acting,
            change_first=limits.change_first,
            remarks=(limits.failure,) if limits.failure else (),
        )

    def _record(self) -> KeyNumbers:
        stick = self.drive.parameters.command
        plus, minus = (abs(_logged_per_volt(stick)) * volts for volts in self.largest)
        tested = self.tested is not None
        return KeyNumbers(self.drive.name, (plus, minus), (), tested=tested, stick=stick)

    def none(self, error: SwashplateError) -> KeyNumbers:
        """The record of a drive that has no such numbers."""
        return replace(self._record(), remarks=(f"This drive has none: {error}",))


def _step(drive: Drive, volts: float) -> Simulation:
    """A step from rest, from the first sample on."""
    command = np.full(int(SECONDS * SOURCE_RATE) + 1, volts)
    command[0] = 0.0
    return drive.simulate(command, SOURCE_RATE, start="steady")


def _logged_per_volt(stick: LoggedCommand | None) -> float:
    """What a volt at the card is in a log, in the unit of `command_unit`."""
    if stick is None:
        return 1.0
    if command_unit(stick) == "V" and stick.scale == 1.0:
        return float(stick.sign)
    return float(np.diff(stick.numbers(np.array([0.0, 1.0])))[0])


def _notes(values: _Values, found: _Found) -> None:
    """Note what was not tried, and a jump or creep that tests have not shown."""
    if values.tested is None:
        return
    for side, volts in enumerate(values.tested):
        if volts == 0.0:
            found.notes[:CREEP, side] = "not tested"
            found.lower[:CREEP, side] = found.upper[:CREEP, side] = np.nan
    for row in (JUMP, CREEP):
        absent = (found.values[row] == 0.0) & (found.notes[row] != "not tested")
        found.notes[row, absent] = NOT_SEEN
        found.lower[row, absent] = found.upper[row, absent] = np.nan


def _one_sided(found: _Found, near: Array, far: Array, open_mask: NDArray[np.bool_]) -> None:
    """Leave numbers that depend on unseen limits the end `near`, at which these just act."""
    grows = np.where(far == near, found.values >= 0.0, far > near)
    found.lower[open_mask] = np.where(grows, near, np.nan)[open_mask]
    found.upper[open_mask] = np.where(grows, np.nan, near)[open_mask]


def _without_fit(drive: Drive, values: _Values) -> _Found:
    """Numbers of a drive whose tests, if any, may have left limits open."""
    found = _open_ends(values.of(drive))
    unreached = drive.parameters.unreached
    if unreached:
        # 0 stands for an orifice that no test opened by a known amount: its value stays
        ends = {column: end for column, end in unreached.items() if end != 0.0}
        near = values.of(Drive(drive.parameters.with_numbers(ends)))
        far = values.of(without_limits(drive, unreached))
        # where such a limit stands is no estimate
        moved = np.fmax(np.abs(far - near), np.abs(found.values - near))
        left_open = moved > DECIDES * np.abs(near)
        _one_sided(found, near, far, left_open)
        for side, column in enumerate(("Z16_plus", "Z16_minus")):
            if unreached.get(column) == 0.0:
                rows = np.arange(len(KINDS))[ACCELERATION : LAG + 1]
                found.lower[rows, side] = found.upper[rows, side] = np.nan
                left_open[rows, side] = True
        found.notes[left_open] = NOT_SEEN
    _notes(values, found)
    return found


def _with_fit(
    drive: Drive, fit: Optimum, values: _Values, stated: PredictionError | None
) -> tuple[_Found, list[str]]:
    """Numbers of a fitted drive with their 95 % intervals, and what these leave out."""
    numbers = values.of(drive)
    shape = numbers.shape
    unseen = unseen_limits(fit)

    def flat(varied: Drive) -> Array:
        return values.of(varied).ravel()

    try:
        spread = spread_of(fit, flat, tuple(unseen))
    except SwashplateError as error:
        found = _open_ends(numbers)
        _notes(values, found)
        return found, [f"There are no intervals: {error}"]
    half, below, above = (each.reshape(shape) for each in (spread.half, spread.below, spread.above))
    if stated is not None:
        half = np.hypot(half, values.own_error(numbers, stated))
    near = values.of(_at_limits(drive, unseen))
    far = values.of(without_limits(drive, unseen))
    moved = np.nanmax(np.abs([near - numbers, far - numbers]), axis=0)
    left_open = np.abs(far - near) > OPEN * np.abs(near)
    moved = np.where(left_open, 0.0, np.nan_to_num(moved))
    found = _Found(
        numbers,
        numbers - half - moved - below,
        numbers + half + moved + above,
        np.full(shape, "", dtype=object),
    )
    _keep_signs(found)
    fixed = (half + moved + below + above <= 1e-9 * np.abs(numbers)) & (numbers != 0.0)
    found.notes[fixed] = FIXED
    for name, leaning in spread.at_bounds.items():
        found.notes[leaning.reshape(shape)] = f"{name} {AT_BOUND}"
    found.notes[np.isinf(below) | np.isinf(above)] = "not determined"
    if left_open.any():
        at_ends = spread_of(fit, lambda varied: flat(_at_limits(varied, unseen)), tuple(unseen))
        cautious = at_ends.half.reshape(shape) * np.where(far > near, -1.0, 1.0)
        _one_sided(found, near + cautious, far, left_open)
        # what depends only on an estimate without an upper end has a value all the same
        found.notes[left_open] = ""
        found.notes[left_open & _decided_by_unreached(drive, values)] = NOT_SEEN
    _doubt_lag(found, fit, unseen)
    _notes(values, found)
    if not assumed_parameters(fit):
        return found, []
    known = f"{100.0 * ERROR_OF_ASSUMED:.0f} % (standard deviation)"
    return found, [f"Assumed parameters are taken as known to {known}."]


def _decided_by_unreached(drive: Drive, values: _Values) -> NDArray[np.bool_]:
    """Numbers (8, 2) that limits decide which no test reached."""
    never = drive.parameters.unreached
    near, far = values.of(_at_limits(drive, never)), values.of(without_limits(drive, never))
    decided: NDArray[np.bool_] = np.abs(far - near) > OPEN * np.abs(near)
    return decided


def _doubt_lag(found: _Found, fit: Optimum, unseen: Mapping[str, float]) -> None:
    """Leave what an orifice decides without an interval if a lag may stand for it."""
    for side, column in enumerate(("Z16_plus", "Z16_minus")):
        if not _mistaken_for_a_lag(column, fit, unseen):
            continue
        # the lag is the same both ways, and the delay follows it
        places = [(ACCELERATION, side), *((row, way) for row in (DELAY, LAG) for way in (0, 1))]
        for place in places:
            found.notes[place] = f"{column} fixed"
            found.lower[place] = found.upper[place] = np.nan


def _keep_signs(found: _Found) -> None:
    """No interval of a number that has a sign crosses 0; a creep may go either way."""
    rows = slice(0, CREEP)
    values = found.values[rows]
    found.lower[rows] = np.where(
        values >= 0.0, np.maximum(found.lower[rows], 0.0), found.lower[rows]
    )
    found.upper[rows] = np.where(
        values < 0.0, np.minimum(found.upper[rows], 0.0), found.upper[rows]
    )


def _at_limits(drive: Drive, limits: Mapping[str, float]) -> Drive:
    """A drive whose limits lie where the tests went, by column."""
    return Drive(drive.parameters.with_numbers(limits))


def _mistaken_for_a_lag(column: str, fit: Optimum, unseen: Mapping[str, float]) -> bool:
    """Whether an orifice that is not estimated may have been mistaken for an estimated lag.

    Of a limited acceleration a fit without the limit makes a longer lag, and says nothing.
    """
    free = {target for unknown in fit.problem.unknowns for target in unknown.targets}
    return column in unseen and column not in free and "Z8" in free


class _Limits(NamedTuple):
    """What limits a drive in steps to the largest commands and back."""

    acting: tuple[ActingLimit, ...] = ()
    change_first: FirstChange | None = None
    failure: str = ""
    """Why that cannot be told."""


def _limits_of(drive: Drive, values: _Values, without_end: Collection[str] = ()) -> _Limits:
    """Limits that act in steps to the largest commands and back, and what to change first.

    A limit that no test reached does not count: its value only marks how far the tests went. One
    that acted in them does, whether its estimate has an upper end or not.
    """
    length = int(2.0 * SOURCE_RATE)
    plus, minus = values.largest
    command = np.repeat((0.0, plus, 0.0, -minus, 0.0), length)
    limited = without_limits(drive, drive.parameters.unreached)
    if limited.parameters.rate not in (None, SOURCE_RATE):
        limited = limited.at_every_rate()
    try:
        shares = limit_shares(limited, command, SOURCE_RATE, interpolation="previous")
    except SwashplateError as error:
        return _Limits(failure=f"What limits it cannot be told: {error}")
    acting = [ActingLimit(each.limit, each.time_share) for each in shares.shares if each.time_share]
    acting.sort(key=lambda limit: -limit.time_share)
    first, change = shares.first, None
    if first is not None and first.error_share is not None:
        columns = drive.parameters.definitions.columns_of(first.changes)
        unsure = tuple(column for column in columns if column in without_end)
        change = FirstChange(first.component, first.error_share, unsure)
    return _Limits(tuple(acting[:SHOWN_LIMITS]), change)
