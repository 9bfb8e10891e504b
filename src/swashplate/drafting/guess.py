"""First guesses of an unknown machine's numbers, read off its logs.

What a drive does between command and speed is, at first sight, a dead zone, a jump at its edge, a
gain, a top speed and a greatest acceleration each way, one delay and one lag, and the creep at
rest. `guess_drive` finds these by least squares on mean speeds, the creep from what moves while the
command rests; `guessed_set` puts them into the drive "neutral"; `fit_configuration` frees them,
with bounds about them. All of it is where a fit begins, not its result.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from math import asin, inf, isfinite, log, sqrt, tan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.campaign import Campaign
from swashplate.campaign.experiment import Channel, Experiment, InputSignal
from swashplate.campaign.quality import spiked
from swashplate.campaign.schema import CURRENTS, ChannelKind
from swashplate.drafting.amplifier import AmplifierGuess, guess_amplifier
from swashplate.drafting.plain_drive import MODEL, Edge, PlainDrive
from swashplate.drive import Drive
from swashplate.equations.marching.derivatives import jacobian, residuals
from swashplate.equations.marching.observation import ObservedRecord, Own, every_sample
from swashplate.equations.marching.record import Record
from swashplate.equations.marching.run import Instance, instance_of
from swashplate.errors import InputError, ParameterError
from swashplate.parameters.parameter_set import ParameterSet, set_of
from swashplate.parameters.rules import SIDES
from swashplate.results import short
from swashplate.tables import UNIT, Cell, Column, Table
from swashplate.units import display_unit

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

STEP = 0.005
"""Step of the march. [s]"""
BEFORE = 10.0
"""Time before a run for which its motion at first has lasted, longer than any delay. [s]"""
WINDOW = 0.05
"""Time over which mean speeds are compared, or two samples where these are farther apart. [s]"""
SHORTEST = 0.005
"""Lag that a drive has at least. [s]"""
TOLD = 0.01
"""Lag that mean speeds tell from a delay: a fifth of their window, two steps of the march. [s]"""
FEW = 10.0
"""Counts in a window at the greatest speed below which an encoder's edges are joined by lines."""
QUIET = 0.05
"""Noise of mean speeds over the greatest one, to which windows of a noisy position are widened."""
FEWEST = 40
"""Mean speeds that tell anything."""
SEEN, NEXT_TO_NOTHING = 1.02, 1e-4
"""A limit is not seen in the logs where the squared error without it is less than this much larger,
nor by less than this share of all that moves. [1]"""
ONE_WAY = 0.05
"""A way that gets less than this share of the command of the other is not exercised. [1]"""
ROUGH = 0.05
"""Error over the greatest speed from which the squares of errors grow as their sizes. [1]"""
OFFSET = 0.1
"""Largest neutral offset of the spool, over its travel at the greatest speed that was seen. [1]"""
REST, RESTS = 0.5, 4
"""Length of the intervals in which a creep is looked for [s], and the fewest of them that tell."""
STILL = 0.01
"""Command that counts as none, over the largest one, whatever the dead zone. [1]"""
LAGS_TO_REST = 5.0
"""Lags after which a motion has come to rest: it has 0.7 % of its speed then. [1]"""
FALSE_ALARM = 1e-3
"""Probability at which noise that is normal passes for a creep. [1]"""
CREEPS = 0.002
"""Creep over the greatest speed that is none: zero errors of tachometers are as large. [1]"""
ANGLE = 0.2
"""Angle of the swash plate at the greatest speed that was seen, at most. [rad]"""
STOP_FIRST, ORIFICE_FIRST = 0.9, 0.8
"""Shares of what the largest command asks for at which a stop and an orifice that were not seen are
put first: there they act, so that a fit can tell whether they are there. A stop farther inside
bends the gain, and a search can end with both. [1]"""
STEEPEST = 30.0
"""Volts that a radian takes at least, so that at 10 V and at the upper bounds of all gains the
solenoids do not overpower the feedback spring. [V/rad]"""
JUMPS = (0.03, 0.12)
"""Jumps from which the search for one begins, over the greatest speed. [1]"""
EDGE = 0.01
"""Command over which a jump is complete, over the largest one: a sudden one would be felt by no
small change of a dead zone, as marches go in steps. [1]"""
FROM_START = np.append(np.zeros(12), 1.0)
"""Of a position's derivatives by the numbers, and the position: what the first speed moves."""
UNLIMITED = 1e30
"""Limit that is none, in the march."""
SEARCHED = [0, 1, 2, 3, 10, 12, 4, 5, 6, 7, 8, 9]
"""Which of the 13 numbers each of what is searched for is of."""
NONE = 30.0
"""Logarithm of a limit, over the greatest speed, that is none. [1]"""
LAGS, DELAYS, DEAD_ZONES = (0.02, 0.06, 0.2, 0.6), (0.0, 0.04, 0.12, 0.3), (0.02, 0.1, 0.25)
"""Where the search begins; dead zones as shares of the largest command each way. [s], [s], [1]"""
LOWEST = np.array([0.0, 0.0, -5.0, -5.0, log(0.002), 0.0, -1.5, -1.5, -2.0, -2.0, 0.0, 0.0])
HIGHEST = np.array([0.95, 0.95, 7.0, 7.0, log(5.0), 1.0, 1.5, 1.5, 6.0, 6.0, 0.5, 0.5])
TYPICAL = np.array([0.05, 0.05, 0.2, 0.2, 0.3, 0.02, 0.1, 0.1, 0.5, 0.5, 0.02, 0.02])
"""Of what is searched for: dead zones over the largest command, logarithms of gains and of the lag,
the delay [s], logarithms of top speeds and accelerations over the greatest speed, and jumps over
it."""


class Guess(NamedTuple):
    """What logs show at first sight; both ways of a pair as magnitudes, plus first."""

    def __repr__(self) -> str:
        return short(self)

    axis: str
    unit: str
    """Of a speed, ``"rad/s"`` or ``"m/s"``."""
    dead_zone: tuple[float, float]
    """[V]"""
    gain: tuple[float, float]
    """Speed for a volt beyond the dead zone. [unit/V]"""
    jump: tuple[float, float]
    """Speed right beyond the dead zone, 0 where none was seen. [unit]"""
    top_speed: tuple[float, float]
    """Infinite where none was reached. [unit]"""
    acceleration: tuple[float, float]
    """Infinite where it limits nothing. [unit/s]"""
    lag: float
    """[s]"""
    delay: float
    """[s]"""
    creep: float | None
    """Speed at rest, with its sign; 0 where the logs show none, None where their rests are too
    short or too few to show one. [unit]"""
    command: tuple[float, float]
    """Largest command; 0 for a way that was not tried, whose numbers are the other's. [V]"""
    speed: float
    """Greatest mean speed. [unit]"""
    fit_percent: float
    """100 (1 - error's RMS over the mean speeds' standard deviation). [%]"""
    amplifier: AmplifierGuess | None = None
    """What the current of the amplifier shows, None if no run measures one."""


class _Course(NamedTuple):
    """A position over time, straight between instants; or several, the last axis being time."""

    time: Array
    """Instants (n,). [s]"""
    values: Array
    """(..., n)"""

    def _cells(self, instants: Array) -> tuple[Any, Array]:
        """Which of the n - 1 pieces instants (m,) lie in, and the rates of change (..., m) there."""
        cells = np.searchsorted(self.time, instants, "right") - 1
        cells = np.clip(cells, 0, self.time.size - 2)
        rises = self.values[..., cells + 1] - self.values[..., cells]
        return cells, rises / (self.time[cells + 1] - self.time[cells])

    def at(self, instants: Array) -> Array:
        """Positions (..., m) at instants (m,); before the first and after the last it stays."""
        cells, rates = self._cells(instants)
        since = np.clip(instants, self.time[0], self.time[-1]) - self.time[cells]
        return np.asarray(self.values[..., cells] + since * rates)

    def rate_at(self, instants: Array) -> Array:
        """Rates of change (..., m) at instants (m,)."""
        moving = (instants > self.time[0]) & (instants < self.time[-1])
        return np.asarray(np.where(moving, self._cells(instants)[1], 0.0))

    def integral(self) -> _Course:
        """Its integral from the first instant on."""
        values = self.values
        steps = values[..., 1:] + values[..., :-1]
        steps *= 0.5 * np.diff(self.time)
        area = np.zeros_like(values)
        np.cumsum(steps, axis=-1, out=area[..., 1:])
        return _Course(self.time, area)


class _Windows(NamedTuple):
    """Windows of time (m,) over which mean speeds are compared."""

    begins: Array
    """[s]"""
    ends: Array
    """[s]"""
    averaged: float = 0.0
    """Time after each end over which a noisy position is averaged, 0 for instants. [s]"""

    @property
    def weights(self) -> Array:
        """Root of the number (m,) of shortest windows that each of them is worth. [1]"""
        return np.sqrt((self.ends - self.begins) / WINDOW)

    def mean_speeds(self, course: _Course) -> Array:
        """Mean speeds (..., m) of a course."""
        if not self.averaged:
            return self._differences(course.at)
        return self._differences(course.integral().at)

    def mean_accelerations(self, course: _Course) -> Array:
        """Rates of change (..., m) of mean speeds if a course is moved forward in time."""
        return self._differences(course.at if self.averaged else course.rate_at)

    def _differences(self, at: Callable[[Array], Array]) -> Array:
        if not self.averaged:
            first, last = at(self.begins), at(self.ends)
        else:
            first, last = (
                (at(instants + self.averaged) - at(instants)) / self.averaged
                for instants in (self.begins, self.ends)
            )
        return np.asarray((last - first) / (self.ends - self.begins))

    def of(self, chosen: Mask) -> _Windows:
        """Some of them."""
        return self._replace(begins=self.begins[chosen], ends=self.ends[chosen])


class _Run(NamedTuple):
    """A run: the march's grid (n,), its command (k,) and mean speeds (m,) of windows."""

    observed: ObservedRecord
    time: Array
    """Stamps of the march's grid, and one long before. [s]"""
    edge: float
    """Command over which a jump is complete. [V]"""
    stamps: Array
    """Those of the command, of a straight line the grid's as well. [s]"""
    command: Array
    """[V]"""
    held: bool
    """Whether the command is held between stamps, or a straight line."""
    start: float
    windows: _Windows
    speeds: Array
    sampled: Array
    """Instants (j,) of the measured samples. [s]"""
    travelled: Array
    """Measured way (j,) since the first of them, of a speed its integral."""
    resolution: float
    """Of the way, 0 if it is fine."""


def _model(run: _Run, numbers: Array) -> tuple[Instance, Own]:
    """The plain drive with numbers, and the speed that it begins with."""
    finite = PlainDrive(*np.minimum(numbers[:12], UNLIMITED).tolist())
    instance = instance_of(MODEL, finite, given=Edge(run.edge))
    return instance, Own({"speed": run.start})


def _delayed(run: _Run, positions: Array, start: Array | float, delay: float) -> _Course:
    """Positions (..., n) on the march's grid, as late as the delay [s], with what was before.

    What comes out is delayed, so that the march meets its steps alike whatever the delay: else
    errors had a minimum at every whole step.
    """
    values = np.empty((*positions.shape[:-1], positions.shape[-1] + 1))
    values[..., 0] = -BEFORE * start
    values[..., 1:] = positions
    return _Course(run.time + delay, values)


def _simulated(run: _Run, numbers: Array) -> _Course:
    """Position of a run; numbers (13,) are those of `PlainDrive`, and the delay."""
    positions = residuals(*_observing(run, numbers))
    return _delayed(run, positions, run.start, numbers[12])


def _observing(run: _Run, numbers: Array) -> tuple[Instance, ObservedRecord, Own]:
    instance, own = _model(run, numbers)
    return instance, run.observed, own


def _errors(runs: Sequence[_Run], numbers: Array) -> Array:
    """Simulated less measured mean speeds of all runs, weighted by their windows' lengths."""
    errors = list[Array]()
    for run in runs:
        simulated = run.windows.mean_speeds(_simulated(run, numbers))
        errors.append(run.windows.weights * (simulated - run.speeds))
    return np.concatenate(errors)


def _linearised(runs: Sequence[_Run], numbers: Array) -> tuple[Array, Array]:
    """The errors (m,), and their derivatives (m, 13) by the numbers."""
    errors, slopes = list[Array](), list[Array]()
    for run in runs:
        instance, own = _model(run, numbers)
        found = jacobian(instance, run.observed, PlainDrive._fields, own)
        course = _delayed(run, found.rows, run.start * FROM_START, numbers[12])
        speeds = run.windows.mean_speeds(course)
        speeds[-1] -= run.speeds
        by_delay = -run.windows.mean_accelerations(course._replace(values=course.values[-1]))
        errors.append(run.windows.weights * speeds[-1])
        slopes.append(run.windows.weights * np.vstack([speeds[:-1], by_delay]))
    return np.concatenate(errors), np.concatenate(slopes, axis=1).T


def _creep(runs: Sequence[_Run], numbers: Array, scale: float) -> float | None:
    """Mean speed at rest beyond that of `numbers` (13,); 0 if it may be none, None without rests.

    From intervals in which the command has lain in the dead zone for so long that a motion has come
    to rest. Each is taken as one observation: the scatter of them has the noise, and what is left
    of motions that end more slowly than the numbers say. The counts of an encoder may hide one at
    both ends of a rest, or show one too many.
    """
    from scipy.special import stdtrit

    dead_zones, accelerations, lag, delay = numbers[:2], numbers[6:8], numbers[10], numbers[12]
    largest = max(float(np.abs(run.command).max()) for run in runs)
    # a creep takes from the dead zone of one way what it gives to the other
    still = max(0.5 * float(dead_zones.min()), STILL * largest)
    settling = delay + LAGS_TO_REST * lag + scale / accelerations.min()
    speeds, rounding = list[Array](), 0.0
    for run in runs:
        simulated = _simulated(run, numbers)
        for begin, end in _rests(run, still, settling):
            ends = begin + REST * np.arange(int((end - begin) / REST) + 1)
            measured = np.interp(ends, run.sampled, run.travelled)
            speeds.append(np.diff(measured - simulated.at(ends)) / REST)
            rounding += run.resolution
    observed = np.concatenate([np.zeros(0), *speeds])
    if observed.size < RESTS:
        return None
    mean = float(observed.mean())
    error = float(observed.std(ddof=1)) / sqrt(observed.size)
    quantile = float(stdtrit(observed.size - 1, 1.0 - 0.5 * FALSE_ALARM))
    doubt = max(quantile * error + rounding / (REST * observed.size), CREEPS * scale)
    return mean if abs(mean) > doubt else 0.0


def _rests(run: _Run, still: float, settling: float) -> Iterable[tuple[float, float]]:
    """Begin and end [s] of stretches at rest that were measured without a gap, settled ones."""
    resting = np.abs(run.command) <= still
    # a command that is held stays up to the next stamp
    until = np.append(run.stamps[1:], run.stamps[-1]) if run.held else run.stamps
    changes = np.flatnonzero(np.diff(np.concatenate([[0], resting.astype(np.int8), [0]])))
    gaps = np.flatnonzero(np.diff(run.sampled) > 3.0 * float(np.median(np.diff(run.sampled))))
    pieces = np.split(run.sampled, gaps + 1)
    for first, last in changes.reshape(-1, 2):
        for piece in pieces:
            begin = max(float(run.stamps[first]) + settling, float(piece[0]))
            end = min(float(until[last - 1]), float(piece[-1]))
            if end - begin >= REST:
                yield begin, end


def guess_drive(tests: Campaign | Sequence[Experiment]) -> Guess:
    """First guess from the runs of one axis, by their commands and their speeds or positions.

    Of a campaign from those with the role ``"fit"``.

    Runs need a voltage as input and a channel of the kind shaft_speed, position or encoder_counts;
    what is ignored does not count.

    Raises
    ------
    InputError
        If no run has such a channel, the input is no voltage, the speed of a run or of all goes
        against the command, a channel has gross spikes, or too little moves.
    """
    experiments = tests.select(role="fit") if isinstance(tests, Campaign) else tuple(tests)
    runs, unit, spoilt = list[_Run](), "", spiked(experiments)
    reversed_runs = list[tuple[str, str]]()
    kinds: tuple[ChannelKind, ...] = ("shaft_speed", "encoder_counts", "position")
    for each in experiments:
        # the channel that tells how it moves: a speed before a position
        moving = (one for kind in kinds for one in each.of_kind(kind) if one.used.sum() > 8)
        channel = next(moving, None)
        if channel is None:
            continue
        if each.input.kind != "voltage":
            raise InputError(
                f"{each.input.source}: the input is of the kind '{each.input.kind}', but a guess "
                'needs a command in V: write kind = "voltage", unit = "V", and a scale that makes '
                "its full range ±10 V; an offset is added after scaling, in V."
            )
        for used in (channel, *each.of_kind(*CURRENTS)):
            sentence, gross = spoilt.get((each.name, used.name), ("", False))
            if gross:
                raise InputError(f"{sentence}.")
        unit = f"{channel.unit}/s" if channel.is_position else channel.unit
        runs.append(_run(each, channel))
        if not _goes_with(runs[-1]):
            reversed_runs.append((each.name, channel.name))
    if 0 < len(reversed_runs) < len(runs):
        run, name = reversed_runs[0]
        raise InputError(
            f"In {run} '{name}' goes against the command, in other runs with it: reverse it with "
            'sign = -1 for this run, or leave the run out with role = "ignore".'
        )
    speeds = np.concatenate([np.zeros(0), *(run.speeds for run in runs)])
    weights = np.concatenate([np.zeros(0), *(run.windows.weights for run in runs)])
    worth = float(np.sum(weights**2))
    moving = (channel for run in experiments for channel in run.of_kind(*kinds))
    if worth < FEWEST and any(channel.used.any() for channel in moving):
        raise InputError(
            f"The runs are too short to guess from: they give {worth:.0f} mean speeds of "
            f"{WINDOW:g} s, and at least {FEWEST} are needed."
        )
    if not speeds.size:
        raise InputError(
            "No run measures a motion that a guess could be read off: it needs a channel of the "
            "kind shaft_speed, position or encoder_counts that is not ignored."
        )
    commands = np.concatenate([run.command for run in runs])
    size = np.maximum([commands.max(), -commands.min()], 0.0)
    size[size < ONE_WAY * size.max()] = 0.0
    scale = float(np.quantile(np.abs(speeds), 0.99))
    if not size.max() > 0.0 or scale == 0.0:
        raise InputError("The command or the speed never leaves rest: there is nothing to guess.")
    found = _searched(runs, weights * speeds, size, scale, 0.0)
    creep = _creep(runs, found, scale)
    if creep:
        # without it one dead zone was too wide, the other too narrow, and the gains made up for it
        found = _searched(runs, weights * speeds, size, scale, creep)
    mean = np.average(speeds, weights=weights**2)
    unexplained = np.sum(_errors(runs, found) ** 2) / np.sum(weights**2 * (speeds - mean) ** 2)
    # numbers of a way that was not tried are the other's
    pairs = found[:10].reshape(5, 2)
    pairs[:, size == 0.0] = pairs[:, size > 0.0][:, :1]
    numbers = [(plus, minus) for plus, minus in [*pairs.tolist(), size.tolist()]]
    dead_zone, gain, top_speed, acceleration, jump, command = numbers
    return Guess(
        *(experiments[0].axis, unit, dead_zone, gain, jump, top_speed, acceleration),
        lag=float(found[10]),
        delay=round(float(found[12]), 6),
        creep=creep,
        command=command,
        speed=scale,
        fit_percent=100.0 * (1.0 - sqrt(unexplained)),
        amplifier=guess_amplifier(experiments),
    )


def _run(experiment: Experiment, channel: Channel) -> _Run:
    drive, used = experiment.input, channel.used
    time, values = channel.time[used], channel.values[used]
    interval = float(np.median(np.diff(time)))
    width = max(WINDOW, 2.0 * interval)
    count = channel.resolution or 0.0
    rows = round(width / interval)
    fastest = np.abs(values[rows:] - values[:-rows]).max(initial=0.0)
    travelled = values - values[0]
    if not channel.is_position:
        steps = 0.5 * (values[1:] + values[:-1]) * np.diff(time)
        travelled = np.concatenate([[0.0], np.cumsum(steps)])
    course = _Course(time, travelled)
    if count and fastest < FEW * count:
        # a slow staircase shows a count in a window or none, whatever the speed between
        course = _edges(time, values, count)
        windows = _windows_between(course.time, width)
    else:
        if channel.kind == "position":
            width = max(width, _quiet_width(time, values, interval))
        begins = np.arange(time[0], time[-1] - 2.0 * width, width)
        # all samples of a noisy position count, which a difference of two of them would lose
        windows = _Windows(begins, begins + width, averaged=width)
    span = windows.begins, windows.ends + windows.averaged
    inside = (span[0] >= drive.time[0]) & (span[1] <= drive.time[-1])
    # windows across ignored samples or a gap tell of no speed
    stamps = channel.time[used]
    for gap in np.flatnonzero(np.diff(stamps) > 3.0 * interval):
        inside &= (span[0] >= stamps[gap + 1]) | (span[1] <= stamps[gap])
    windows = windows.of(inside)
    speeds = windows.mean_speeds(course)
    grid = drive.time[0] + STEP * np.arange(np.ceil((drive.time[-1] - drive.time[0]) / STEP) + 1.0)
    held = drive.interpolation == "previous"
    # a straight line may cross a dead zone between two stamps
    stamps = np.append(drive.time, grid[-1]) if held else np.union1d(drive.time, grid)
    start = 0.0 if experiment.start == "rest" or not speeds.size else float(speeds[0])
    command = drive.at(stamps)
    return _Run(
        observed=_observed(drive, grid, held),
        time=np.append(grid[0] - BEFORE, grid),
        edge=EDGE * float(np.abs(command).max()) or 1.0,
        stamps=stamps,
        command=command,
        held=held,
        start=start,
        windows=windows,
        speeds=speeds,
        sampled=time,
        travelled=travelled,
        resolution=count,
    )


def _observed(drive: InputSignal, grid: Array, held: bool) -> ObservedRecord:
    """The command on the march's grid, of each step its mean."""
    stamps, values = drive.time, drive.values
    middles = 0.5 * (values[1:] + values[:-1])
    pieces = (values[:-1] if held else middles) * np.diff(stamps)
    area = np.concatenate([[0.0], np.cumsum(pieces)])

    def area_at(instants: Array) -> Array:
        before = np.clip(np.searchsorted(stamps, instants, "right") - 1, 0, stamps.size - 1)
        first = values[before]
        last = first if held else np.interp(instants, stamps, values)
        return np.asarray(area[before] + 0.5 * (instants - stamps[before]) * (first + last))

    means = np.diff(area_at(np.append(grid, grid[-1] + STEP))) / STEP
    record = Record(means, float(grid[0]), 1.0 / STEP, 1)
    return every_sample(record, "position", "command", "rest")


def _edges(time: Array, angle: Array, count: float) -> _Course:
    """Instants at which an encoder's reading changed [s], and the angles that it then had.

    A reading of k counts tells that the angle lies between k and k + 1, so that it is known when
    the reading changes, in both directions alike. A run without two changes stood still.
    """
    changed = np.flatnonzero(angle[1:] != angle[:-1])
    if changed.size < 2:
        return _Course(time[[0, -1]], np.zeros(2))
    instants = 0.5 * (time[changed] + time[changed + 1])
    return _Course(instants, 0.5 * (angle[changed] + angle[changed + 1] + count))


def _windows_between(instants: Array, width: float) -> _Windows:
    """Windows from one of the instants to the next that is at least a width later [s]."""
    chosen = [0]
    for index in range(1, instants.size):
        if instants[index] - instants[chosen[-1]] >= width:
            chosen.append(index)
    return _Windows(instants[chosen[:-1]], instants[chosen[1:]])


def _goes_with(run: _Run) -> bool:
    """Whether a motion goes with its command at any of the delays from which the search begins."""
    middle = 0.5 * (run.windows.begins + run.windows.ends + run.windows.averaged)
    commands = (np.interp(middle - late, run.stamps, run.command) for late in DELAYS)
    weighted = run.windows.weights**2 * run.speeds
    return any(float(command @ weighted) >= 0.0 for command in commands)


def _quiet_width(time: Array, position: Array, interval: float) -> float:
    """Windows in which white noise of a position leaves 5 % of its greatest speed. [s]"""
    # 20 = 1 + 9 + 9 + 1, of the squares of a third difference
    noise = float(np.median(np.abs(np.diff(position, 3)))) / (0.6745 * sqrt(20.0))
    rough = max(round(0.5 / interval), 1)
    moved = np.abs(position[rough:] - position[:-rough]) / (time[rough:] - time[:-rough])
    fastest = float(moved.max(initial=0.0))
    # of means over w/h samples the difference over w has the deviation noise √(2 h)/w^1.5
    return (noise * sqrt(2.0 * interval) / (QUIET * fastest)) ** (2.0 / 3.0) if fastest else 0.0


def _searched(
    runs: Sequence[_Run], weighted: Array, size: Array, scale: float, creep: float
) -> Array:
    """Numbers (13,) of least squares: a grid first, on which gains are linear, then all at once.

    From the weighted mean speeds (m,), the largest command each way (2,), the greatest speed and
    the creep, which stays.
    What the logs do not show is taken out in the end, and the rest goes to its optimum: with the
    former in, the squares are so flat that a search ends anywhere along a valley.
    """
    from scipy.optimize import least_squares

    tried, steepness = size > 0.0, scale / size.max()

    def numbers_of(vector: Array) -> Array:
        """From what is searched for (12,)."""
        limits = np.exp(vector[6:10]) * scale
        limits[vector[6:10] >= NONE] = inf
        gain, last = np.exp(vector[2:4]) * steepness, [np.exp(vector[4]), creep, vector[5]]
        return np.concatenate([vector[:2] * size, gain, limits, vector[10:12] * scale, last])

    def errors_of(vector: Array) -> Array:
        return _errors(runs, numbers_of(vector)) / scale

    def linearised(vector: Array) -> tuple[Array, Array]:
        """The errors (m,), and their derivatives (m, 12)."""
        numbers = numbers_of(vector)
        errors, by_number = _linearised(runs, numbers)
        limits = np.where(vector[6:10] < NONE, numbers[4:8], 0.0)
        factors = [size, numbers[2:4], numbers[10:11], np.ones(1), limits, np.full(2, scale)]
        return errors / scale, by_number[:, SEARCHED] * (np.concatenate(factors) / scale)

    def loss_of(vector: Array) -> float:
        """As `least_squares` has it with the loss "soft_l1"."""
        rough = errors_of(vector) / ROUGH
        return ROUGH**2 * float(np.sum(np.sqrt(1.0 + rough**2) - 1.0))

    def descended(start: Array, free: Mask, **how: Any) -> tuple[float, Array]:
        """Loss and numbers after a descent in those that are free (12,)."""
        latest: dict[bytes, Array] = {}

        def errors_at(part: Array) -> Array:
            whole = start.copy()
            whole[free] = part
            errors, slopes = linearised(whole)
            # nearly every step is taken: what is asked for next are the slopes there
            latest.clear()
            latest[part.tobytes()] = slopes[:, free]
            return errors

        def slopes_at(part: Array) -> Array:
            if part.tobytes() not in latest:
                errors_at(part)
            return latest[part.tobytes()]

        solution = least_squares(
            errors_at,
            np.clip(start, LOWEST + 1e-6, HIGHEST - 1e-6)[free],
            bounds=(LOWEST[free], HIGHEST[free]),
            x_scale=TYPICAL[free],
            loss="soft_l1",
            f_scale=ROUGH,
            jac=slopes_at,
            **how,
        )
        end = start.copy()
        end[free] = solution.x
        return float(solution.cost), end

    def best(starts: Iterable[Array], free: Mask) -> tuple[float, Array]:
        """Of many starts a few steps each, and only the best of them farther."""
        begun = [descended(start, free, max_nfev=12) for start in starts]
        begun.sort(key=lambda pair: pair[0])
        return min(
            (descended(vector, free, max_nfev=30) for _, vector in begun[:3]),
            key=lambda pair: pair[0],
        )

    candidates: list[tuple[float, Array, Array]] = []
    for lag, delay, share in product(LAGS, DELAYS, DEAD_ZONES):
        numbers = np.array([*(share * size), 0.0, 0.0, *[inf] * 4, 0.0, 0.0, lag, creep, delay])
        at_rest, slopes = _linearised(runs, numbers)
        gain, left = np.zeros(2), slopes[:, 2:4][:, tried]
        beyond_creep = weighted if creep == 0.0 else -at_rest
        gain[tried] = np.linalg.lstsq(left, beyond_creep, rcond=None)[0]
        cost = float(np.sum((left @ gain[tried] - beyond_creep) ** 2))
        steep = np.log(np.maximum(gain, 1e-3 * steepness) / steepness)
        dead = np.where(tried, share, 0.1)
        vector = np.array([*dead, *steep, log(lag), delay, *[NONE] * 4, 0.0, 0.0])
        candidates.append((cost, vector, gain))
    candidates.sort(key=lambda candidate: candidate[0])
    if (candidates[0][2][tried] <= 0.0).any():
        raise InputError(
            "The speed goes against the command: reverse it with sign = -1 in its channel."
        )
    free = np.concatenate([tried, tried, [True, True], tried, tried, tried])
    _, plain = best((vector for _, vector, _ in candidates[:3]), free & (np.arange(12) < 6))
    # a slow rise may be a lag or a limited acceleration, and less speed than a straight line has a
    # larger dead zone or a top speed: from each of them the search ends at another minimum
    limited = plain.copy()
    limited[6:10] = [0.0, 0.0, *[log(0.7) - plain[4]] * 2]
    moves = [
        *product((0.0,), (0.0, 0.7), (0.0, -1.5, -3.0)),
        *product((0.2,), (0.0, 0.7), (-1.5,)),
    ]
    cost, whole = best(
        (
            limited + np.repeat([wider, steeper, quicker, 0.0], [2, 2, 1, 7])
            for wider, steeper, quicker in moves
        ),
        free & (np.arange(12) < 10),
    )
    # the same line behind a larger dead zone
    back = tried * size.max() / np.maximum(size, size.max() * ONE_WAY) / np.exp(whole[2:4])
    smaller, jumping = best(
        (whole + np.concatenate([jump * back, np.zeros(8), jump * tried]) for jump in JUMPS), free
    )
    if SEEN * smaller < cost:
        cost, whole = smaller, jumping
    # a limit or a jump that makes no difference was not met
    seen = free.copy()
    for index in range(6, 12):
        without = whole.copy()
        without[index] = NONE if index < 10 else 0.0
        nothing = NEXT_TO_NOTHING * float(np.sum((weighted / scale) ** 2))
        if loss_of(without) < SEEN * cost + nothing:
            whole, seen[index] = without, False
    _, whole = descended(whole, seen, xtol=1e-10, ftol=1e-12, gtol=1e-12)
    return numbers_of(whole)


def guessed_set(guess: Guess, source: str) -> ParameterSet:
    """The drive "neutral" with the numbers of a guess.

    The source says in the parameter file where they are from.

    Notes
    -----
    The greatest speed that was seen is given a swash angle of 0.2 rad at most, which sets Z10; no
    measurement of a speed could tell it. With sin φ = Z5 Z19 I/√Z4 and tan α = sin φ/Z3 the gain is
    Z10 Z5 Z19 G1/(√Z4 Z3), and the jump likewise one of J; the lag is 1/(Z1 Z3 Z5 Z8 √(Z9/2)); the
    acceleration beyond which the orifice opens no further is Z10 Z1 Z8 √(Z9/2) Z16. The creep
    without a force sets Z18: sin atan(Z18/Z5) = Z3 tan α.

    A limit that the guess did not see may still be there: a lag that is too short can stand for it.
    It is put a little below what the largest command asks for, where a fit can tell, and the set
    says that no test reached it.
    """
    base = Drive.preset("neutral").parameters
    n = base.numbers
    per_angle = max(guess.speed / ANGLE, STEEPEST * max(guess.gain))
    per_ampere = per_angle * n["Z5"] * n["Z19_plus"] / (sqrt(n["Z4"]) * n["Z3"])
    flow = n["Z1"] * sqrt(0.5 * n["Z9"])
    speed_of_flow = 1.0 / (max(guess.lag, SHORTEST) * flow * n["Z3"] * n["Z5"])
    per_opening = per_angle * flow * speed_of_flow
    stops, openings, unreached = list[float](), list[float](), dict[str, float]()
    for way, side in enumerate(SIDES):
        fastest = _steady(guess, way)
        top, pull = guess.top_speed[way], guess.acceleration[way]
        if not isfinite(top):
            unreached[f"Z13_{side}"] = fastest / per_angle
            top = STOP_FIRST * fastest
        if not isfinite(pull):
            # how fast it accelerated is not known: a lag that is too short may stand for the limit
            unreached[f"Z16_{side}"] = 0.0
            pull = ORIFICE_FIRST * fastest / max(guess.lag, SHORTEST)
        stops.append(top / per_angle)
        openings.append(pull / per_opening)
    changed: dict[str, float | tuple[float, float]]
    if guess.amplifier is None:
        changed = {
            "V_dz": guess.dead_zone,
            "J": (guess.jump[0] / per_ampere, guess.jump[1] / per_ampere),
            "G1": (guess.gain[0] / per_ampere, guess.gain[1] / per_ampere),
            "tau": guess.delay,
        }
    else:
        changed = _with_current(guess, guess.amplifier, per_ampere / n["Z19_plus"])
    changed |= {
        "Z8": speed_of_flow,
        "Z10": per_angle,
        "Z13": (stops[0], stops[1]),
        "Z16": (openings[0], openings[1]),
    }
    if guess.creep:
        changed["Z18"] = n["Z5"] * tan(asin(n["Z3"] * tan(guess.creep / per_angle)))
    try:
        # what is written here is read again as what somebody wrote
        made = base.replace(changed)
    except ParameterError as error:
        raise ParameterError(
            f"The guess of {guess.axis} from {source} fails; look at units and scales of its "
            f"signals: {error}"
        ) from None
    said = {
        symbol: replace(each, source=source, status="approximate")
        if symbol in changed
        else replace(each, source="assumed: no speed determines it")
        for symbol, each in made.parameters.items()
    }
    if not guess.creep:
        said["Z18"] = replace(said["Z18"], source=f"assumed: {_without_creep(guess)}")
    title = f"{guess.axis}: guessed from {source}"
    # of a current that was measured the filter has a meaning of its own, whatever the logs' rate
    rate = made.rate if guess.amplifier is None else None
    card = f"{guess.axis} card"
    return replace(
        made,
        name=guess.axis,
        title=title,
        card=card,
        parameters=said,
        rate=rate,
        unreached=unreached,
    )


def _with_current(
    guess: Guess, amplifier: AmplifierGuess, per_newton: float
) -> dict[str, float | tuple[float, float]]:
    """Numbers of the amplifier and of the solenoids, by symbol; speed per N of force given.

    The machine moves from the current on that the amplifier has at the edge of the dead zone. A
    jump of the speed is then one of the current beyond the solenoids' dead zone.
    """
    begins, forces = list[float](), list[float]()
    for way in range(2):
        per_ampere = guess.gain[way] / amplifier.gain[way]
        edge = max(guess.dead_zone[way], amplifier.dead_zone[way] + 1e-6)
        begins.append(max(amplifier.settled(way, edge) - guess.jump[way] / per_ampere, 0.0))
        forces.append(per_ampere / per_newton)
    tried = [current for current, command in zip(begins, guess.command, strict=True) if command]
    return {
        "V_dz": amplifier.dead_zone,
        "J": amplifier.jump,
        "G1": amplifier.gain,
        **amplifier.dynamics,
        "tau": amplifier.delay,
        "Z17": sum(tried) / len(tried),
        "Z19": (forces[0], forces[1]),
    }


def _steady(guess: Guess, way: int) -> float:
    """Speed that settles under the largest command one way, as a magnitude. [unit]"""
    volts = guess.command[way] or max(guess.command)
    beyond = max(volts - guess.dead_zone[way], 0.0)
    along = (1.0 - 2.0 * way) * (guess.creep or 0.0)
    speed = guess.gain[way] * beyond + guess.jump[way] + along
    return min(speed, guess.top_speed[way]) or guess.speed


CONFIGURATION = """\
# Read off the logs of the axis '{0}' by `swashplate guess`: what they show is
# free, within bounds about the first guess. A limit that the guess did not see is
# free as well, within wide ones: a fit tells it from a lag.
title = "{0}, guessed"
"""
CHAIN = """
[[stages]]
name = "drive"
part = "chain"
channels = ["shaft_speed", "position", "encoder_counts"]

[stages.free]
"""
AMPLIFIER = """
# The amplifier, from the current.
[[stages]]
name = "amplifier"
part = "card"

[stages.free]
"""
PUMP = """
# Pump and motor, driven by the current of the fitted amplifier.
[[stages]]
name = "pump"
part = "pump"
channels = ["shaft_speed", "position", "encoder_counts"]

[stages.free]
"""
NO_CREEP = "# {}: Z18 is 0, fixed"
NOT_TRIED = "# no run goes {}: its numbers are those of the other way, fixed"


def fit_configuration(guess: Guess, start: ParameterSet | Drive) -> str:
    """Text of a fit configuration that frees what was guessed, with bounds about it.

    One stage from the command to the motion, or, if a current was measured, one of the amplifier
    and one of the pump.
    """
    numbers, text = set_of(start).numbers, CONFIGURATION.format(guess.axis)
    longest = max(2.0 * guess.delay, guess.delay + 0.1)
    delay = f"tau = {{ bounds = [0.0, {longest:.4g}] }}    # delay"
    if guess.amplifier is None:
        lines = _command_lines(numbers, guess.command, [each > 0.0 for each in guess.jump])
        creep = (
            _offset_line(guess, numbers) if guess.creep else NO_CREEP.format(_without_creep(guess))
        )
        lines += [*_limit_lines(guess), _lag_line(guess, 5.0), delay, creep]
        return text + CHAIN + "\n".join(lines) + "\n"
    of_current = _command_lines(numbers, guess.amplifier.command, (True, True))
    of_current += [*_dynamics_lines(numbers), delay]
    # the guess's lag is that of amplifier and pump
    of_motion = [*_solenoid_lines(guess, numbers), *_limit_lines(guess), _lag_line(guess, 20.0)]
    text += AMPLIFIER + "\n".join(of_current) + "\n"
    return text + PUMP + "\n".join(of_motion) + "\n"


def _command_lines(
    numbers: Mapping[str, float], command: Sequence[float], jumps: Sequence[bool]
) -> list[str]:
    """Dead zone, jump and gain of the amplifier each way."""
    lines = list[str]()
    for side, largest, jumped in zip(SIDES, command, jumps, strict=True):
        if not largest:
            lines.append(NOT_TRIED.format(side))
            continue
        gain, jump = numbers[f"G1_{side}"], numbers[f"J_{side}"]
        # so that more command never means less current, whatever the gain within its bounds; a gain
        # that grows needs no such care, and a stop must not stand for it
        down, up = 0.2 * gain / largest, 0.6 * gain / largest
        most = 4.0 * jump if jump else 0.5 * gain * largest
        lines.append(f"V_dz_{side} = {{ bounds = [0.0, {0.95 * largest:.4g}] }}")
        if jumped:
            lines.append(f"J_{side} = {{ bounds = [0.0, {most:.4g}] }}    # jump")
        lines += [
            f"G1_{side} = {{ relative = [0.5, 2.0], log = true }}",
            f"G2_{side} = {{ bounds = [{-down:.4g}, {up:.4g}] }}    # how the gain bends",
        ]
    return lines


def _dynamics_lines(numbers: Mapping[str, float]) -> list[str]:
    """Filter and limits of rate of the current; a limit that is off stays off."""
    lines = [
        "zeta = { relative = [0.3, 3.0], log = true }    # damping of the current",
        "omega = { relative = [0.2, 5.0], log = true }    # its natural frequency",
    ]
    limits = {"lim1": "rate away from zero", "lim2": "rate towards zero", "a": "final decay"}
    for symbol, meaning in limits.items():
        if isfinite(numbers[f"{symbol}_plus"]):
            lines.append(f"{symbol} = {{ relative = [0.3, 3.0], log = true }}    # {meaning}")
    if isfinite(numbers["lim1_plus"]) and isfinite(numbers["I_t1_plus"]):
        lines.append("I_t1 = { relative = [0.5, 2.0] }    # current above which lim1 acts")
    return lines


def _solenoid_lines(guess: Guess, numbers: Mapping[str, float]) -> list[str]:
    """Dead zone and force of the solenoids."""
    assert guess.amplifier is not None
    currents = [guess.amplifier.settled(way, guess.command[way]) for way in range(2)]
    begins = numbers["Z17"]
    smallest = min(current for current, volts in zip(currents, guess.command, strict=True) if volts)
    # below the largest current of either way, or nothing would move
    most = min(2.0 * begins if begins else 0.5 * smallest, 0.95 * smallest)
    lines = [f"Z17 = {{ bounds = [0.0, {max(most, 1.05 * begins):.4g}] }}    # dead zone"]
    lines.append(_offset_line(guess, numbers))
    for way, side in enumerate(SIDES):
        if not guess.command[way]:
            lines.append(NOT_TRIED.format(side))
            continue
        bends = 0.5 * numbers[f"Z19_{side}"] / max(currents[way] - begins, 1e-3)
        lines += [
            f"Z19_{side} = {{ relative = [0.5, 2.0], log = true }}    # force for a current",
            f"Z20_{side} = {{ bounds = [{-bends:.4g}, {bends:.4g}] }}    # how it bends",
        ]
    return lines


def _offset_line(guess: Guess, numbers: Mapping[str, float]) -> str:
    """Neutral offset of the spool, either way, with room for that of the creep that was seen."""
    offset = OFFSET * numbers["Z5"] * numbers["Z3"] * guess.speed / numbers["Z10"]
    offset = max(offset, 2.0 * abs(numbers["Z18"]))
    return f"Z18 = {{ bounds = [{-offset:.4g}, {offset:.4g}] }}    # neutral offset: creep at rest"


def _without_creep(guess: Guess) -> str:
    """Why no creep is taken in."""
    if guess.creep is None:
        return "the logs rest too seldom to show a creep"
    return "the logs show no creep at rest"


def _limit_lines(guess: Guess) -> list[str]:
    """Top speed and acceleration of each way that was tried, within wide bounds if not seen."""
    lines = list[str]()
    for way, side in enumerate(SIDES):
        if not guess.command[way]:
            continue
        reach = (0.7, 1.4) if isfinite(guess.top_speed[way]) else (0.7, 3.0)
        lines.append(_limit_line(f"Z13_{side}", reach, "top speed"))
        reach = (0.3, 3.0) if isfinite(guess.acceleration[way]) else (0.1, 10.0)
        lines.append(_limit_line(f"Z16_{side}", reach, "acceleration"))
    return lines


def _lag_line(guess: Guess, widest: float) -> str:
    """The lag, up to so many times faster."""
    if guess.lag > TOLD:
        return f"Z8 = {{ relative = [0.2, {widest}], log = true }}    # lag"
    # the acceleration is that of Z8 times Z16: without a lag nothing tells them apart
    return "# the lag is too short to be seen: Z8 stays fixed"


def _limit_line(column: str, reach: tuple[float, float], words: str) -> str:
    low, high = reach
    return f"{column} = {{ relative = [{low}, {high}], log = true }}    # {words}"


def guess_table(found: Guess) -> Table:
    """What was guessed, each way."""
    columns = (Column(each, ".4g", none="not seen") for each in ("plus", "minus"))
    made = Table(f"Axis {found.axis}, at first sight", (Column(""), *columns, UNIT))
    rows = (
        ("dead zone", found.dead_zone, "V", ".3g"),
        ("gain beyond it", found.gain, f"{found.unit}/V", ""),
        ("jump at its edge", tuple(each or inf for each in found.jump), found.unit, ""),
        ("top speed", found.top_speed, found.unit, ""),
        ("acceleration", found.acceleration, f"{found.unit}^2", ""),
    )
    for name, values, unit, spec in rows:
        cells = list[Cell | float | None]()
        for way, (value, tried) in enumerate(zip(values, found.command, strict=True)):
            if not tried:
                cells.append(Cell(None, "not tried"))
            elif isfinite(value):
                cells.append(value)
            elif name == "top speed":
                factor = display_unit(unit, _steady(found, way)).factor
                speed = f"{factor * _steady(found, way):.3g}"
                cells.append(Cell(None, f"at least {speed}, not seen"))
            else:
                cells.append(None)
        made.add(name, *cells, unit=unit, spec=spec)
    made.add("delay", 1e3 * found.delay, "", unit="ms", spec=".3g")
    made.add("lag", 1e3 * found.lag, "", unit="ms", spec=".3g")
    creep: Cell | float = found.creep or Cell(None, "not seen")
    if found.creep is None:
        creep = Cell(None, "no long rest")
    made.add("creep at rest", creep, "", unit=found.unit, spec=".3g")
    return made
