"""Mean speeds of a run, as they were measured and as a plain drive with a delay has them.

The constants are judgement. A guess depends on them, and through it the start and the bounds of a
first fit; a fit itself compares samples and uses none of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import Channel, Experiment, InputSignal
from swashplate.drafting.plain_drive import MODEL, JumpWidth, PlainDrive
from swashplate.machine import Machine
from swashplate.machine.marching import (
    ObservedRecord,
    Record,
    RunValues,
    every_sample,
    jacobian,
    residuals,
)

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

STEP = 0.005
"""Step of the march. [s]"""
BEFORE = 10.0
"""Time before a run for which its motion at first has lasted, longer than any delay. [s]"""
WINDOW = 0.05
"""Time over which mean speeds are compared, or two samples if these are farther apart. [s]"""
FEW_COUNTS = 10.0
"""Counts in a window at the greatest speed below which an encoder's edges are joined by lines."""
QUIET = 0.05
"""Noise of mean speeds over the greatest one, to which windows of a noisy position are widened."""
SPEED_OVER = 0.5
"""Time over which the greatest speed of a noisy position is taken. [s]"""
EDGE = 0.01
"""Command over which a jump is complete, over the largest one: a sudden one would be felt by no
small change of a dead zone, as marches go in steps. [1]"""
FROM_START = np.append(np.zeros(12), 1.0)
"""Of a position's derivatives by the first 12 numbers and of the position, which stands last, the
one that the first speed moves: what was before the run goes into that one only."""
GAP = 3.0
"""Median intervals between two samples from which on they are a gap. [1]"""
UNLIMITED = 1e30
"""Limit that is none, in the march."""

# Positions of a drive's numbers (13,): the fields of `PlainDrive`, pairs plus first, and the delay.
DEAD_ZONE = slice(0, 2)
GAIN = slice(2, 4)
TOP_SPEED = slice(4, 6)
ACCELERATION = slice(6, 8)
JUMP = slice(8, 10)
LAG = 10
CREEP = 11
DELAY = 12


class Course(NamedTuple):
    """A position over time, straight between instants; or several, the last axis being time."""

    time: Array
    """Instants (n,). [s]"""
    values: Array
    """(..., n)"""

    def _pieces(self, instants: Array) -> tuple[Any, Array]:
        """Index of the piece, of n - 1, that each instant (m,) lies in, and its rate of change."""
        pieces = np.searchsorted(self.time, instants, "right") - 1
        pieces = np.clip(pieces, 0, self.time.size - 2)
        rises = self.values[..., pieces + 1] - self.values[..., pieces]
        return pieces, rises / (self.time[pieces + 1] - self.time[pieces])

    def at(self, instants: Array) -> Array:
        """Positions (..., m) at instants (m,); constant before the first and after the last."""
        pieces, rates = self._pieces(instants)
        since = np.clip(instants, self.time[0], self.time[-1]) - self.time[pieces]
        return np.asarray(self.values[..., pieces] + since * rates)

    def rate_at(self, instants: Array) -> Array:
        """Rates of change (..., m) at instants (m,)."""
        moving = (instants > self.time[0]) & (instants < self.time[-1])
        return np.asarray(np.where(moving, self._pieces(instants)[1], 0.0))

    def integral(self) -> Course:
        """Its integral from the first instant on."""
        values = self.values
        steps = values[..., 1:] + values[..., :-1]
        steps *= 0.5 * np.diff(self.time)
        area = np.zeros_like(values)
        np.cumsum(steps, axis=-1, out=area[..., 1:])
        return Course(self.time, area)


class Windows(NamedTuple):
    """Windows of time (m,) over which mean speeds are compared."""

    begins: Array
    """[s]"""
    ends: Array
    """[s]"""
    averaging_time: float = 0.0
    """Time after each end over which a noisy position is averaged, 0 for instants. [s]"""

    @property
    def weights(self) -> Array:
        """Root of the number (m,) of shortest windows that each of them is worth. [1]"""
        return np.sqrt((self.ends - self.begins) / WINDOW)

    def mean_speeds(self, course: Course) -> Array:
        """Mean speeds (..., m) of a course."""
        if self.averaging_time:
            return self._mean_rates(course.integral().at)
        return self._mean_rates(course.at)

    def mean_accelerations(self, course: Course) -> Array:
        """Rates of change (..., m) of mean speeds if a course is shifted forward in time."""
        if self.averaging_time:
            return self._mean_rates(course.at)
        return self._mean_rates(course.rate_at)

    def _mean_rates(self, quantity_at: Callable[[Array], Array]) -> Array:
        """Mean rates of change (..., m) of a quantity over the windows.

        With an `averaging_time` the function gives the quantity's integral, from which its mean
        after each end of a window is taken.
        """

        def value_from(instants: Array) -> Array:
            if not self.averaging_time:
                return quantity_at(instants)
            rise = quantity_at(instants + self.averaging_time) - quantity_at(instants)
            return rise / self.averaging_time

        first = value_from(self.begins)
        last = value_from(self.ends)
        return np.asarray((last - first) / (self.ends - self.begins))

    def selected(self, mask: Mask) -> Windows:
        """Those windows that a mask (m,) keeps."""
        return self._replace(begins=self.begins[mask], ends=self.ends[mask])


class MovingRun(NamedTuple):
    """A run: the march's grid (n,), its command (k,) and mean speeds (m,) of windows."""

    observed: ObservedRecord
    time: Array
    """Stamps of the march's grid, and one long before. [s]"""
    edge: float
    """Command over which a jump is complete. [V]"""
    stamps: Array
    """Those of the command; if it is a straight line between them, those of the grid, too. [s]"""
    command: Array
    """[V]"""
    is_held: bool
    """Whether the command is held between stamps, or a straight line."""
    start: float
    """Speed that it begins with."""
    windows: Windows
    speeds: Array
    """Measured mean speeds (m,) of the windows."""
    sampled: Array
    """Instants (j,) of the measured samples. [s]"""
    travelled: Array
    """Measured way (j,) since the first of them; of a measured speed its integral."""
    resolution: float
    """Resolution of the way, 0 if it is fine."""


def _model(run: MovingRun, numbers: Array) -> tuple[Machine, RunValues]:
    """The plain drive with numbers, and the speed that it begins with."""
    finite = PlainDrive(*np.minimum(numbers[:DELAY], UNLIMITED).tolist())
    instance = Machine(MODEL, finite, given=JumpWidth(run.edge))
    return instance, RunValues({"speed": run.start})


def _delayed(run: MovingRun, positions: Array, start: Array | float, delay: float) -> Course:
    """Positions (..., n) on the march's grid, later by the delay [s], with the motion before it.

    The output is delayed, not the command, so that the march treats the command's steps the same
    way whatever the delay: otherwise errors would have a minimum at every whole step.
    """
    values = np.empty((*positions.shape[:-1], positions.shape[-1] + 1))
    values[..., 0] = -BEFORE * start
    values[..., 1:] = positions
    return Course(run.time + delay, values)


def simulated_course(run: MovingRun, numbers: Array) -> Course:
    """Position of a run; numbers (13,) are those of `PlainDrive`, and the delay."""
    instance, run_values = _model(run, numbers)
    positions = residuals(instance, run.observed, run_values)
    return _delayed(run, positions, run.start, numbers[DELAY])


def speed_errors(runs: Sequence[MovingRun], numbers: Array) -> Array:
    """Simulated less measured mean speeds of all runs, weighted by their windows' lengths."""
    errors = list[Array]()
    for run in runs:
        simulated = run.windows.mean_speeds(simulated_course(run, numbers))
        errors.append(run.windows.weights * (simulated - run.speeds))
    return np.concatenate(errors)


def linearised_errors(runs: Sequence[MovingRun], numbers: Array) -> tuple[Array, Array]:
    """The errors (m,), and their derivatives (m, 13) by the numbers."""
    errors, slopes = list[Array](), list[Array]()
    for run in runs:
        instance, run_values = _model(run, numbers)
        derivatives = jacobian(instance, run.observed, PlainDrive._fields, run_values)
        course = _delayed(run, derivatives.rows, run.start * FROM_START, numbers[DELAY])
        speeds = run.windows.mean_speeds(course)
        speeds[-1] -= run.speeds
        by_delay = -run.windows.mean_accelerations(course._replace(values=course.values[-1]))
        errors.append(run.windows.weights * speeds[-1])
        slopes.append(run.windows.weights * np.vstack([speeds[:-1], by_delay]))
    return np.concatenate(errors), np.concatenate(slopes, axis=1).T


def moving_run(experiment: Experiment, channel: Channel) -> MovingRun:
    """Command of a run, and the mean speeds that a channel measures."""
    drive, used = experiment.input, channel.used
    time, values = channel.time[used], channel.values[used]
    travelled = _travelled(channel, time, values)
    course, windows = _course_and_windows(channel, time, values, travelled)
    windows = windows.selected(_inside(windows, drive, time))
    speeds = windows.mean_speeds(course)
    grid = drive.time[0] + STEP * np.arange(np.ceil((drive.time[-1] - drive.time[0]) / STEP) + 1.0)
    is_held = drive.interpolation == "previous"
    # a straight line may cross a dead zone between two stamps
    stamps = np.append(drive.time, grid[-1]) if is_held else np.union1d(drive.time, grid)
    command = drive.at(stamps)
    begins_at_rest = experiment.start == "rest" or not speeds.size
    return MovingRun(
        observed=_observed(drive, grid, is_held),
        time=np.append(grid[0] - BEFORE, grid),
        edge=EDGE * float(np.abs(command).max()) or 1.0,
        stamps=stamps,
        command=command,
        is_held=is_held,
        start=0.0 if begins_at_rest else float(speeds[0]),
        windows=windows,
        speeds=speeds,
        sampled=time,
        travelled=travelled,
        resolution=channel.resolution or 0.0,
    )


def _travelled(channel: Channel, time: Array, values: Array) -> Array:
    """Way (j,) since the first sample, of a speed its integral."""
    if channel.is_position:
        return np.asarray(values - values[0])
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(time)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _course_and_windows(
    channel: Channel, time: Array, values: Array, travelled: Array
) -> tuple[Course, Windows]:
    """Measured way over time, and all windows in which its mean speeds are compared."""
    interval = float(np.median(np.diff(time)))
    width = max(WINDOW, 2.0 * interval)
    count = channel.resolution or 0.0
    rows = round(width / interval)
    farthest = np.abs(values[rows:] - values[:-rows]).max(initial=0.0)
    if count and farthest < FEW_COUNTS * count:
        # a slow staircase shows a count in a window or none, whatever the speed between
        edges = _edges(time, values, count)
        return edges, _windows_between(edges.time, width)
    if channel.kind == "position":
        width = max(width, _quiet_width(time, values, interval))
    begins = np.arange(time[0], time[-1] - 2.0 * width, width)
    # all samples of a noisy position count, which a difference of two of them would lose
    return Course(time, travelled), Windows(begins, begins + width, averaging_time=width)


def _inside(windows: Windows, drive: InputSignal, time: Array) -> Mask:
    """Which windows (m,) lie within the command and are not across a gap of the samples.

    Windows across ignored samples or a gap tell of no speed.
    """
    begins, ends = windows.begins, windows.ends + windows.averaging_time
    inside = (begins >= drive.time[0]) & (ends <= drive.time[-1])
    intervals = np.diff(time)
    for gap in np.flatnonzero(intervals > GAP * float(np.median(intervals))):
        inside &= (begins >= time[gap + 1]) | (ends <= time[gap])
    return np.asarray(inside)


def _observed(drive: InputSignal, grid: Array, is_held: bool) -> ObservedRecord:
    """Mean command over each step of the march's grid."""
    stamps, values = drive.time, drive.values
    means_between = values[:-1] if is_held else 0.5 * (values[1:] + values[:-1])
    area = np.concatenate([[0.0], np.cumsum(means_between * np.diff(stamps))])

    def area_at(instants: Array) -> Array:
        index = np.clip(np.searchsorted(stamps, instants, "right") - 1, 0, stamps.size - 1)
        first = values[index]
        last = first if is_held else np.interp(instants, stamps, values)
        return np.asarray(area[index] + 0.5 * (instants - stamps[index]) * (first + last))

    means = np.diff(area_at(np.append(grid, grid[-1] + STEP))) / STEP
    record = Record(means, float(grid[0]), 1.0 / STEP, 1)
    return every_sample(record, "position", "command", "rest")


def _edges(time: Array, angle: Array, count: float) -> Course:
    """Instants at which an encoder's reading changed [s], and the angle at each of them.

    A reading of k counts tells that the angle lies between k and k + 1, so that it is known when
    the reading changes, in both directions alike. A run without two changes stood still.
    """
    changed = np.flatnonzero(angle[1:] != angle[:-1])
    if changed.size < 2:
        return Course(time[[0, -1]], np.zeros(2))
    instants = 0.5 * (time[changed] + time[changed + 1])
    return Course(instants, 0.5 * (angle[changed] + angle[changed + 1] + count))


def _windows_between(instants: Array, width: float) -> Windows:
    """Windows from one of the instants to the next that is at least a width later [s]."""
    edges = [0]
    for index in range(1, instants.size):
        if instants[index] - instants[edges[-1]] >= width:
            edges.append(index)
    return Windows(instants[edges[:-1]], instants[edges[1:]])


def _quiet_width(time: Array, position: Array, interval: float) -> float:
    """Width of windows in which white noise of a position is 5 % of its greatest speed. [s]"""
    # 20 = 1 + 9 + 9 + 1, of the squares of a third difference
    noise = float(np.median(np.abs(np.diff(position, 3)))) / (0.6745 * sqrt(20.0))
    rows = max(round(SPEED_OVER / interval), 1)
    speeds = np.abs(position[rows:] - position[:-rows]) / (time[rows:] - time[:-rows])
    fastest = float(speeds.max(initial=0.0))
    if not fastest:
        return 0.0
    # of means over w/h samples the difference over w has the deviation noise √(2 h)/w^1.5
    return float((noise * sqrt(2.0 * interval) / (QUIET * fastest)) ** (2.0 / 3.0))
