"""The numbers of a plain drive with a delay that follow mean speeds best.

The search goes from a coarse grid to the optimum. Its constants are judgement: they decide from
where it starts and which limits pass as seen. A fit that starts from the result depends on them
only if the search ends in another minimum.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from math import inf, log
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.drafting.mean_speeds import (
    ACCELERATION,
    CREEP,
    DEAD_ZONE,
    DELAY,
    GAIN,
    JUMP,
    LAG,
    TOP_SPEED,
    MovingRun,
    linearised_errors,
    speed_errors,
)
from swashplate.errors import InputError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SEEN, NEXT_TO_NOTHING = 1.02, 1e-4
"""A limit is not seen in the logs if the squared error without it is less than this many times as
large, or larger by less than this share of the squares of all speeds. [1]"""
ONE_WAY = 0.05
"""A way that gets less than this share of the command of the other is not exercised. [1]"""
ROUGH = 0.05
"""Error over the greatest speed from which the squares of errors grow as their sizes. [1]"""
JUMPS = (0.03, 0.12)
"""Jumps from which the search for one begins, over the greatest speed. [1]"""
UNLIMITED_LOG = 30.0
"""Logarithm, over the greatest speed, that stands for no limit. [1]"""
LAGS = (0.02, 0.06, 0.2, 0.6)
"""Lags from which the search begins: those of hydrostatic drives, within a factor of 2. [s]"""
DELAYS = (0.0, 0.04, 0.12, 0.3)
"""Delays from which the search begins. [s]"""
DEAD_ZONES = (0.02, 0.1, 0.25)
"""Dead zones from which the search begins, over the largest command each way. [1]"""

# Positions in the vector of unknowns (12,); each pair plus first.
X_DEAD_ZONE = slice(0, 2)
"""Over the largest command each way. [1]"""
X_GAIN = slice(2, 4)
"""Logarithms, over the greatest speed for the largest command. [1]"""
X_LAG = 4
"""Logarithm of seconds."""
X_DELAY = 5
"""[s]"""
X_LIMITS = slice(6, 10)
"""Logarithms of top speeds, then of accelerations, over the greatest speed."""
X_JUMP = slice(10, 12)
"""Over the greatest speed. [1]"""
UNKNOWNS = 12
LIMITS = slice(TOP_SPEED.start, ACCELERATION.stop)
"""Where the numbers (13,) of a drive have what `X_LIMITS` are logarithms of."""
NUMBER_OF_UNKNOWN = [0, 1, 2, 3, LAG, DELAY, 4, 5, 6, 7, 8, 9]
"""Index in the numbers (13,) of a drive that each unknown is of."""
LOWEST = np.array([0.0, 0.0, -5.0, -5.0, log(0.002), 0.0, -1.5, -1.5, -2.0, -2.0, 0.0, 0.0])
"""Lower bounds of the unknowns."""
HIGHEST = np.array([0.95, 0.95, 7.0, 7.0, log(5.0), 1.0, 1.5, 1.5, 6.0, 6.0, 0.5, 0.5])
"""Upper bounds of the unknowns."""
TYPICAL = np.array([0.05, 0.05, 0.2, 0.2, 0.3, 0.02, 0.1, 0.1, 0.5, 0.5, 0.02, 0.02])
"""Sizes of the unknowns' steps, by which the search scales them."""


class _Detour(NamedTuple):
    """Change of the unlimited drive from which the search for limits begins."""

    dead_zone: float
    """Over the largest command. [1]"""
    gain: float
    """Logarithm of a factor. [1]"""
    lag: float
    """Logarithm of a factor. [1]"""


DETOURS = (
    _Detour(dead_zone=0.0, gain=0.0, lag=0.0),
    _Detour(dead_zone=0.0, gain=0.0, lag=-1.5),
    _Detour(dead_zone=0.0, gain=0.0, lag=-3.0),
    _Detour(dead_zone=0.0, gain=0.7, lag=0.0),
    _Detour(dead_zone=0.0, gain=0.7, lag=-1.5),
    _Detour(dead_zone=0.0, gain=0.7, lag=-3.0),
    _Detour(dead_zone=0.2, gain=0.0, lag=-1.5),
    _Detour(dead_zone=0.2, gain=0.7, lag=-1.5),
)
"""A slow rise may be a lag or a limited acceleration, and less speed than a straight line has a
larger dead zone or a top speed: from each of them the search ends at another minimum."""


class _Descent(NamedTuple):
    """End of a descent."""

    loss: float
    unknowns: Array
    """(12,)"""


class _GridPoint(NamedTuple):
    """Gains of least squares at a lag, a delay and a dead zone."""

    squared_error: float
    unknowns: Array
    """(12,)"""
    gain: Array
    """(2,) [speed/V]"""


@dataclass(frozen=True)
class _Search:
    """Errors over the greatest speed, as functions of the vector of unknowns."""

    runs: Sequence[MovingRun]
    weighted: Array
    """Weighted mean speeds (m,)."""
    command: Array
    """Largest command each way (2,), 0 for a way that is not exercised. [V]"""
    speed: float
    """The greatest one."""
    creep: float
    """Speed at rest, which stays."""

    @property
    def tried(self) -> Mask:
        """Which ways (2,) are exercised."""
        return np.asarray(self.command > 0.0)

    @property
    def steepness(self) -> float:
        """The greatest speed for the largest command. [speed/V]"""
        return float(self.speed / self.command.max())

    def numbers(self, unknowns: Array) -> Array:
        """Numbers (13,) of the drive."""
        limits = np.exp(unknowns[X_LIMITS]) * self.speed
        limits[unknowns[X_LIMITS] >= UNLIMITED_LOG] = inf
        numbers = np.empty(13)
        numbers[DEAD_ZONE] = unknowns[X_DEAD_ZONE] * self.command
        numbers[GAIN] = np.exp(unknowns[X_GAIN]) * self.steepness
        numbers[LIMITS] = limits
        numbers[JUMP] = unknowns[X_JUMP] * self.speed
        numbers[LAG] = np.exp(unknowns[X_LAG])
        numbers[CREEP] = self.creep
        numbers[DELAY] = unknowns[X_DELAY]
        return numbers

    def linearised(self, unknowns: Array) -> tuple[Array, Array]:
        """The errors (m,), and their derivatives (m, 12)."""
        numbers = self.numbers(unknowns)
        errors, by_number = linearised_errors(self.runs, numbers)
        number_by_unknown = np.empty(UNKNOWNS)
        number_by_unknown[X_DEAD_ZONE] = self.command
        number_by_unknown[X_GAIN] = numbers[GAIN]
        number_by_unknown[X_LAG] = numbers[LAG]
        number_by_unknown[X_DELAY] = 1.0
        is_limited = unknowns[X_LIMITS] < UNLIMITED_LOG
        number_by_unknown[X_LIMITS] = np.where(is_limited, numbers[LIMITS], 0.0)
        number_by_unknown[X_JUMP] = self.speed
        slopes = by_number[:, NUMBER_OF_UNKNOWN] * (number_by_unknown / self.speed)
        return errors / self.speed, slopes

    def loss(self, unknowns: Array) -> float:
        """The loss "soft_l1" of `least_squares`."""
        errors = speed_errors(self.runs, self.numbers(unknowns)) / self.speed
        rough = errors / ROUGH
        return ROUGH**2 * float(np.sum(np.sqrt(1.0 + rough**2) - 1.0))

    def descend(self, start: Array, free: Mask, **options: Any) -> _Descent:
        """Descend from a start (12,) in the unknowns that are free (12,)."""
        from scipy.optimize import least_squares

        latest: dict[bytes, Array] = {}

        def errors_at(part: Array) -> Array:
            unknowns = start.copy()
            unknowns[free] = part
            errors, slopes = self.linearised(unknowns)
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
            **options,
        )
        end = start.copy()
        end[free] = solution.x
        return _Descent(float(solution.cost), end)

    def best_from(self, starts: Iterable[Array], free: Mask) -> _Descent:
        """Descend from many starts a few steps each, and farther from the best three only."""
        first_legs = [self.descend(start, free, max_nfev=12) for start in starts]
        first_legs.sort(key=lambda descent: descent.loss)
        second_legs = [self.descend(leg.unknowns, free, max_nfev=30) for leg in first_legs[:3]]
        return min(second_legs, key=lambda descent: descent.loss)


def goes_with_command(run: MovingRun) -> bool:
    """Whether a motion goes with its command at any of the delays from which the search begins."""
    middle = 0.5 * (run.windows.begins + run.windows.ends + run.windows.averaging_time)
    commands = (np.interp(middle - delay, run.stamps, run.command) for delay in DELAYS)
    weighted = run.windows.weights**2 * run.speeds
    return any(float(command @ weighted) >= 0.0 for command in commands)


def searched_numbers(
    runs: Sequence[MovingRun], weighted: Array, command: Array, speed: float, creep: float
) -> Array:
    """Numbers (13,) of least squares: a grid first, on which gains are linear, then all at once.

    From the weighted mean speeds (m,), the largest command each way (2,), the greatest speed and
    the creep, which stays.
    What the logs do not show is taken out in the end, and the rest goes to its optimum: with the
    former in, the squares are so flat that a search ends anywhere along a valley.
    """
    search = _Search(runs, weighted, command, speed, creep)
    free = np.ones(UNKNOWNS, dtype=bool)
    for pair in (X_DEAD_ZONE, X_GAIN, slice(6, 8), slice(8, 10), X_JUMP):
        free[pair] = search.tried
    free_without_jump = free.copy()
    free_without_jump[X_JUMP] = False
    free_without_limits = free_without_jump.copy()
    free_without_limits[X_LIMITS] = False

    grid = _grid_points(search)
    if (grid[0].gain[search.tried] <= 0.0).any():
        raise InputError(
            "The speed is opposite to the command: reverse it with sign = -1 in its channel, or in "
            "the input if that was logged the wrong way round."
        )
    unlimited = search.best_from((point.unknowns for point in grid[:3]), free_without_limits)
    best = search.best_from(_limited_starts(unlimited.unknowns), free_without_jump)
    jumping = search.best_from(_jumping_starts(search, best.unknowns), free)
    if SEEN * jumping.loss < best.loss:
        best = jumping
    seen, unknowns = _without_unseen(search, best, free)
    optimum = search.descend(unknowns, seen, xtol=1e-10, ftol=1e-12, gtol=1e-12)
    return search.numbers(optimum.unknowns)


def _grid_points(search: _Search) -> list[_GridPoint]:
    """Points of the grid, that of the least squared error first."""
    points = list[_GridPoint]()
    tried, steepness = search.tried, search.steepness
    for lag, delay, share in product(LAGS, DELAYS, DEAD_ZONES):
        numbers = np.zeros(13)
        numbers[DEAD_ZONE] = share * search.command
        numbers[LIMITS] = inf
        numbers[LAG] = lag
        numbers[CREEP] = search.creep
        numbers[DELAY] = delay
        at_rest, slopes = linearised_errors(search.runs, numbers)
        by_gain = slopes[:, GAIN][:, tried]
        beyond_creep = search.weighted if search.creep == 0.0 else -at_rest
        gain = np.zeros(2)
        gain[tried] = np.linalg.lstsq(by_gain, beyond_creep, rcond=None)[0]
        squared_error = float(np.sum((by_gain @ gain[tried] - beyond_creep) ** 2))
        unknowns = np.zeros(UNKNOWNS)
        unknowns[X_DEAD_ZONE] = np.where(tried, share, 0.1)
        unknowns[X_GAIN] = np.log(np.maximum(gain, 1e-3 * steepness) / steepness)
        unknowns[X_LAG] = log(lag)
        unknowns[X_DELAY] = delay
        unknowns[X_LIMITS] = UNLIMITED_LOG
        points.append(_GridPoint(squared_error, unknowns, gain))
    points.sort(key=lambda point: point.squared_error)
    return points


def _limited_starts(unlimited: Array) -> list[Array]:
    """Starts (12,) of the search for top speeds and accelerations, from the best without them."""
    starts = list[Array]()
    for detour in DETOURS:
        start = unlimited.copy()
        # the greatest speed was just reached, and 0.7 of the acceleration that the lag had
        start[X_LIMITS] = [0.0, 0.0, log(0.7) - unlimited[X_LAG], log(0.7) - unlimited[X_LAG]]
        start[X_DEAD_ZONE] += detour.dead_zone
        start[X_GAIN] += detour.gain
        start[X_LAG] += detour.lag
        starts.append(start)
    return starts


def _jumping_starts(search: _Search, smooth: Array) -> list[Array]:
    """Starts (12,) of the search for jumps: the same line beyond a larger dead zone."""
    largest = search.command.max()
    command = np.maximum(search.command, largest * ONE_WAY)
    dead_zone_by_jump = search.tried * largest / command / np.exp(smooth[X_GAIN])
    starts = list[Array]()
    for jump in JUMPS:
        start = smooth.copy()
        start[X_DEAD_ZONE] += jump * dead_zone_by_jump
        start[X_JUMP] += jump * search.tried
        starts.append(start)
    return starts


def _without_unseen(search: _Search, best: _Descent, free: Mask) -> tuple[Mask, Array]:
    """Which unknowns (12,) stay free, and their values (12,) with limits and jumps only if seen.

    A limit or a jump that makes no difference was not met.
    """
    seen, unknowns = free.copy(), best.unknowns
    next_to_nothing = NEXT_TO_NOTHING * float(np.sum((search.weighted / search.speed) ** 2))
    for index in range(X_LIMITS.start, X_JUMP.stop):
        without = unknowns.copy()
        without[index] = UNLIMITED_LOG if index < X_LIMITS.stop else 0.0
        if search.loss(without) < SEEN * best.loss + next_to_nothing:
            unknowns = without
            seen[index] = False
    return seen, unknowns
