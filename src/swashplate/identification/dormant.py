"""Unknowns without effect at a point, though they have one at the nominal values.

A stop that the swash plate no longer reaches has no derivative, and no descent finds back to it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError
from swashplate.identification.solving import Objective

Array = NDArray[np.float64]
NOTHING = 1e-12
"""Share of its nominal effect that rounding may leave of none."""
AWAKE = 0.05
"""Share of its nominal effect at which an unknown counts as awake again."""
STEPS = 24
"""Trials on the way to its nominal value."""


def effects(objective: Objective, vector: Array) -> Array:
    """(K,) length of the change of all residuals for a unit of each number of the vector."""
    return np.asarray(np.linalg.norm(objective.evaluate(vector).jacobian, axis=0))


def nominal_effects(objective: Objective) -> Array:
    """(K,) those at the objective's start; zeros, which demand nothing, if it holds not there."""
    try:
        return effects(objective, objective.start)
    except DomainError:
        return np.zeros(objective.start.size)


def dormant(present: Array, nominal: Array) -> NDArray[np.bool_]:
    """(K,) which unknowns have no effect at all, but have one nominally."""
    asleep: NDArray[np.bool_] = (present <= NOTHING * nominal) & (nominal > 0.0)
    return asleep


def woken(objective: Objective, vector: Array, nominal: Array) -> tuple[Array | None, int]:
    """A point where no unknown is without effect.

    Parameters
    ----------
    objective : Objective
        What is minimised.
    vector : (K,) array
        Where a search ended.
    nominal : (K,) array
        As of `nominal_effects`.

    Returns
    -------
    point : (K,) array or None
        The vector, each unknown without effect moved towards its nominal value until it has one
        again; None if there is no such unknown.
    evaluations : int
        Of the residuals.
    """
    point = vector.copy()
    asleep = dormant(effects(objective, vector), nominal)
    evaluations = 1
    for k in np.flatnonzero(asleep):
        for share in np.arange(1, STEPS + 1) / STEPS:
            point[k] = vector[k] + share * (objective.start[k] - vector[k])
            evaluations += 1
            try:
                present = effects(objective, point)
            except DomainError:
                continue
            if present[k] > AWAKE * nominal[k]:
                break
    return (point if asleep.any() else None), evaluations
