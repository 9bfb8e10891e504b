"""Ends of intervals held against the cost itself: where it does not rise, there is no end."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError
from swashplate.identification.held import minimiser
from swashplate.identification.linearised import LinearisedFit
from swashplate.identification.problem import Problem
from swashplate.identification.profile_side import Point, ProfileSide

Array = NDArray[np.float64]

SHALLOW = 0.25
"""Part of the linearised rise of the cost below which an interval's end is looked for anew."""
FURTHEST = 8
"""Most points of the profile on such a side."""
TRIES = 20
"""Evaluations of a fit without a limit: one that is not needed is let go of in ten."""


class CheckedEnd(NamedTuple):
    """One side of an unknown on which the linearised interval does not hold."""

    number: int
    """Of the unknown."""
    upper: bool
    distance: float
    """From the estimate to where the cost has risen enough, in the solver's vector; inf if it never
    does."""
    better: float | None = None
    """A lower cost that was met on the way."""


def checked_ends(
    problem: Problem,
    vector: Array,
    linearised: LinearisedFit,
    reach: Array,
    limits: Collection[int] = (),
) -> tuple[CheckedEnd, ...]:
    """Sides on which the cost does not rise as the linearised fit says, and how it does.

    Parameters
    ----------
    problem : Problem
        What was fitted.
    vector : (K,) array
        The optimum.
    linearised : LinearisedFit
        The fit there.
    reach : (K,) array
        Half width of each interval in the solver's vector; 0 for unknowns without one.
    limits : collection of int
        Numbers of the unknowns that limit something, such as a stop.

    Notes
    -----
    A stop that a drive just touches, or a threshold between two samples, has derivatives on one
    side only: the linearised interval is narrow on both. So the cost is taken at both ends, the
    other unknowns moved along as linear theory says. Where it has risen by less than a quarter of
    what it should, the profile is followed on that side, to a true end or to none.

    A level that a drive keeps may be a stop, or the balance of its forces: two optima far apart. So
    each limit is also put out of the way, at its upper bound, and all else fitted again; if that
    costs less than the interval's end would, the data do not need the limit, and it has no upper
    end.
    """
    inverse = linearised.whitening @ linearised.whitening.T
    low, high = problem.bounds
    cost = problem.cost(vector)
    found = []
    for index in np.flatnonzero(reach > 0.0):
        direction = inverse[index] / inverse[index, index]
        rise = 0.5 * reach[index] ** 2 / inverse[index, index]
        if index in limits and _unneeded(problem, vector, int(index), cost + rise):
            found.append(CheckedEnd(int(index), True, np.inf))
            continue
        for sign in (-1.0, 1.0):
            end = np.clip(vector + sign * reach[index] * direction, low, high)
            try:
                risen = problem.cost(end) - cost
            except DomainError:
                continue  # beyond the model's domain nothing is possible
            if risen >= SHALLOW * rise:
                continue
            bound = float(high[index] if sign > 0.0 else low[index])
            side = ProfileSide(
                minimiser(problem, tolerance=1e-6, max_evaluations=TRIES),
                Point(float(vector[index]), cost, vector),
                int(index),
                rise,
                sign,
                float(reach[index]),
                bound,
                FURTHEST,
            )
            side.march()
            distance = np.inf if side.end is None else abs(side.end - float(vector[index]))
            better = side.better.cost if side.better is not None else None
            found.append(CheckedEnd(int(index), sign > 0.0, float(distance), better))
    return tuple(found)


def _unneeded(problem: Problem, vector: Array, index: int, allowed: float) -> bool:
    """Whether a fit with a limit out of the way is as good."""
    start = vector.copy()
    start[index] = problem.bounds[1][index]
    try:
        cost, _ = minimiser(problem, tolerance=1e-6, max_evaluations=TRIES)(
            index, float(start[index]), start
        )
    except DomainError:
        return False
    return cost < allowed
