"""Past an edge of the cost, at which a trust region shrinks to nothing.

Where a step just reaches the swash plate's stop, the derivatives of both sides differ: a region
that looks no further than the edge finds nothing, a longer step along its floor does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError
from swashplate.identification.solving import Objective

Array = NDArray[np.float64]
SHARES = (1.0, 0.5, 0.25, 0.12, 0.06, 0.03, 0.015)
"""Of the Gauss-Newton step."""
SINGULAR = 1e-10
"""Singular values below this share of the largest make no step."""
GAINED = 1e-6
"""Relative gain from which a search goes on."""
NOTHING = 1e-20
"""Share of the cost at the start that is left of it by rounding alone."""


def past_edge(objective: Objective, vector: Array, start_cost: float) -> tuple[Array | None, int]:
    """A lower point along the Gauss-Newton step.

    Parameters
    ----------
    objective : Objective
        What is minimised.
    vector : (K,) array
        Where a search ended.
    start_cost : float
        Where it began.

    Returns
    -------
    point : (K,) array or None
        The lowest of some shares of the step, cut at the bounds; None if none of them gains.
    evaluations : int
        Of the residuals.
    """
    residuals, jacobian = objective.evaluate(vector)
    lowest = 0.5 * float(residuals @ residuals)
    if lowest <= NOTHING * start_cost:
        return None, 1
    step = np.linalg.lstsq(jacobian, -residuals, rcond=SINGULAR)[0]
    point, enough = None, lowest * (1.0 - GAINED)
    for share in SHARES:
        trial = np.clip(vector + share * step, *objective.bounds)
        try:
            cost = objective.cost(trial)
        except DomainError:
            continue
        if cost < enough:
            point, enough = trial, cost
    return point, 1 + len(SHARES)
