"""The numbers of a plain drive with a delay that follow mean speeds best."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product
from math import inf, log
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swashplate.drafting.mean_speeds import (
    MovingRun,
    linearised_errors,
    speed_errors,
)
from swashplate.errors import InputError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SEEN, NEXT_TO_NOTHING = 1.02, 1e-4
"""A limit is not seen in the logs where the squared error without it is less than this much larger,
nor by less than this share of all that moves. [1]"""
ONE_WAY = 0.05
"""A way that gets less than this share of the command of the other is not exercised. [1]"""
ROUGH = 0.05
"""Error over the greatest speed from which the squares of errors grow as their sizes. [1]"""
JUMPS = (0.03, 0.12)
"""Jumps from which the search for one begins, over the greatest speed. [1]"""
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


def goes_with_command(run: MovingRun) -> bool:
    """Whether a motion goes with its command at any of the delays from which the search begins."""
    middle = 0.5 * (run.windows.begins + run.windows.ends + run.windows.averaged)
    commands = (np.interp(middle - late, run.stamps, run.command) for late in DELAYS)
    weighted = run.windows.weights**2 * run.speeds
    return any(float(command @ weighted) >= 0.0 for command in commands)


def searched_numbers(
    runs: Sequence[MovingRun], weighted: Array, size: Array, scale: float, creep: float
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
        return speed_errors(runs, numbers_of(vector)) / scale

    def linearised(vector: Array) -> tuple[Array, Array]:
        """The errors (m,), and their derivatives (m, 12)."""
        numbers = numbers_of(vector)
        errors, by_number = linearised_errors(runs, numbers)
        limits = np.where(vector[6:10] < NONE, numbers[4:8], 0.0)
        factors = [size, numbers[2:4], numbers[10:11], np.ones(1), limits, np.full(2, scale)]
        return errors / scale, by_number[:, SEARCHED] * (np.concatenate(factors) / scale)

    def loss_of(vector: Array) -> float:
        """As `least_squares` has it with the loss "soft_l1"."""
        rough = errors_of(vector) / ROUGH
        return ROUGH**2 * float(np.sum(np.sqrt(1.0 + rough**2) - 1.0))

    def descended(start: Array, free: Mask, **options: Any) -> tuple[float, Array]:
        """Loss and numbers after a descent in those that are free (12,)."""
        latest: dict[bytes, Array] = {}

        def errors_at(part: Array) -> Array:
            searched = start.copy()
            searched[free] = part
            errors, slopes = linearised(searched)
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
        return float(solution.cost), end

    def best(starts: Iterable[Array], free: Mask) -> tuple[float, Array]:
        """Of many starts a few steps each, and only the best of them farther."""
        first_legs = [descended(start, free, max_nfev=12) for start in starts]
        first_legs.sort(key=lambda pair: pair[0])
        return min(
            (descended(vector, free, max_nfev=30) for _, vector in first_legs[:3]),
            key=lambda pair: pair[0],
        )

    candidates: list[tuple[float, Array, Array]] = []
    for lag, delay, share in product(LAGS, DELAYS, DEAD_ZONES):
        numbers = np.array([*(share * size), 0.0, 0.0, *[inf] * 4, 0.0, 0.0, lag, creep, delay])
        at_rest, slopes = linearised_errors(runs, numbers)
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
            "The speed is opposite to the command: reverse it with sign = -1 in its channel."
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
    cost, searched = best(
        (
            limited + np.repeat([wider, steeper, quicker, 0.0], [2, 2, 1, 7])
            for wider, steeper, quicker in moves
        ),
        free & (np.arange(12) < 10),
    )
    # the same line behind a larger dead zone
    back = tried * size.max() / np.maximum(size, size.max() * ONE_WAY) / np.exp(searched[2:4])
    smaller, jumping = best(
        (searched + np.concatenate([jump * back, np.zeros(8), jump * tried]) for jump in JUMPS),
        free,
    )
    if SEEN * smaller < cost:
        cost, searched = smaller, jumping
    # a limit or a jump that makes no difference was not met
    seen = free.copy()
    for index in range(6, 12):
        without = searched.copy()
        without[index] = NONE if index < 10 else 0.0
        nothing = NEXT_TO_NOTHING * float(np.sum((weighted / scale) ** 2))
        if loss_of(without) < SEEN * cost + nothing:
            searched, seen[index] = without, False
    _, searched = descended(searched, seen, xtol=1e-10, ftol=1e-12, gtol=1e-12)
    return numbers_of(searched)
