"""Search for the smallest change of a few factors that satisfies inequalities."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Slack = Callable[[Array], Array]
"""From (L,) factors to (r,) slacks, all 0 or more where the factors satisfy."""

SCANNED = 5
"""ln₂ of the points of a Sobol sequence that are tried besides the corners."""
MOST_CORNERS = 64
FINEST = 1e-9
"""Part of the way to which an end is bisected."""
ALONG = 33
"""Points along a single factor's range."""


def smallest_change(slack: Slack, low: Array, high: Array) -> Array | None:
    """Factors with the least Σ (factor - 1)² of those that satisfy, None if none was found.

    Parameters
    ----------
    slack : callable
        The inequalities, as `Slack`.
    low, high : (L,) array
        Range of each factor, 1 within.

    Returns
    -------
    (L,) array or None
        Satisfies exactly: the last step is a bisection that ends on the right side.

    Notes
    -----
    The box is scanned (corners and a Sobol sequence); from the best points on, SLSQP minimises the
    change under the inequalities, with derivatives by differences; what it finds is drawn towards
    1, as a whole and factor by factor, as far as the inequalities allow.
    """
    unchanged = np.ones(low.size)
    if _met(slack, unchanged):
        return unchanged
    points = [unchanged, *_scan(low, high)]
    singles = [smallest_alone(slack, low, high, k) for k in range(low.size)]
    for k, factor in enumerate(singles):
        if factor is not None:
            points.append(_with(unchanged, k, factor))
    best = max(points, key=lambda point: float(slack(point).min()))
    if not _met(slack, best):
        best = _most_nearly(slack, best, low, high)
        if not _met(slack, best):
            return None
    good = sorted((point for point in [*points, best] if _met(slack, point)), key=_change)
    found = [_drawn_in(slack, each) for each in good[:2]]
    for start in list(found):
        moved = _constrained(slack, start, low, high)
        for each in (moved, start + 1.0001 * (moved - start), _beyond(moved, low, high)):
            if _met(slack, each):
                found.append(_drawn_in(slack, each))
                break
    return min(found, key=_change)


def smallest_alone(slack: Slack, low: Array, high: Array, index: int) -> float | None:
    """The factor nearest to 1 that satisfies by itself, None if none does.

    Parameters
    ----------
    slack, low, high :
        As of `smallest_change`.
    index : int
        Which factor; the others are 1.
    """
    unchanged = np.ones(low.size)
    if _met(slack, unchanged):
        return 1.0
    ends = []
    for end in (float(low[index]), float(high[index])):
        before = 1.0
        for factor in np.linspace(1.0, end, ALONG)[1:] if end != 1.0 else ():
            if _met(slack, _with(unchanged, index, factor)):
                base = _with(unchanged, index, before)
                goal = _with(unchanged, index, factor)
                ends.append(float(_bisected(slack, base, goal)[index]))
                break
            before = float(factor)
    return min(ends, key=lambda factor: abs(factor - 1.0), default=None)


def _scan(low: Array, high: Array) -> list[Array]:
    from scipy.stats.qmc import Sobol

    points = list(Sobol(low.size, scramble=False).random_base2(SCANNED))
    if 2**low.size <= MOST_CORNERS:
        points += [np.array(corner, dtype=float) for corner in product((0, 1), repeat=low.size)]
    return [low + point * (high - low) for point in points]


def _most_nearly(slack: Slack, start: Array, low: Array, high: Array) -> Array:
    """The point whose worst slack is largest, by raising a level below all slacks."""
    from scipy.optimize import minimize

    found = minimize(
        lambda x: -x[-1],
        [*start, float(slack(start).min())],
        method="SLSQP",
        bounds=[*zip(low, high, strict=True), (None, None)],
        constraints={
            "type": "ineq",
            "fun": lambda x: slack(np.clip(x[:-1], low, high)) - x[-1],
        },
        options={"maxiter": 60, "ftol": 1e-8, "eps": 1e-5},
    )
    point: Array = np.clip(found.x[:-1], low, high)
    return max((start, point), key=lambda each: float(slack(each).min()))


def _constrained(slack: Slack, start: Array, low: Array, high: Array) -> Array:
    from scipy.optimize import minimize

    found = minimize(
        lambda x: float(np.sum((x - 1.0) ** 2)),
        start,
        jac=lambda x: 2.0 * (x - 1.0),
        method="SLSQP",
        bounds=list(zip(low, high, strict=True)),
        constraints={"type": "ineq", "fun": lambda x: slack(np.clip(x, low, high))},
        options={"maxiter": 60, "ftol": 1e-10, "eps": 1e-5},
    )
    point: Array = np.clip(found.x, low, high)
    return point


def _drawn_in(slack: Slack, point: Array) -> Array:
    """A point that satisfies, moved towards 1 as a whole and then factor by factor."""
    drawn = _bisected(slack, np.ones(point.size), point)
    for k in range(point.size):
        alone = _with(drawn, k, 1.0)
        drawn = alone if _met(slack, alone) else _bisected(slack, alone, drawn)
    return drawn


def _bisected(slack: Slack, bad: Array, good: Array) -> Array:
    """The end of what satisfies, on the way from a point that does to one that does not."""
    low, high = 0.0, 1.0
    while high - low > FINEST:
        middle = 0.5 * (low + high)
        if _met(slack, bad + middle * (good - bad)):
            high = middle
        else:
            low = middle
    return good if high == 1.0 else bad + high * (good - bad)


def _beyond(point: Array, low: Array, high: Array) -> Array:
    """A little farther from 1, where SLSQP has stopped on the wrong side."""
    return np.asarray(np.clip(1.0 + 1.001 * (point - 1.0), low, high))


def _with(point: Array, index: int, factor: float) -> Array:
    moved = point.copy()
    moved[index] = factor
    return moved


def _met(slack: Slack, point: Array) -> bool:
    return bool(slack(point).min() >= 0.0)


def _change(point: Array) -> float:
    return float(np.sum((point - 1.0) ** 2))
