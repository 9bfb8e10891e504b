"""Sequential quadratic programming with difference gradients: how the source fitted its models."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError
from swashplate.identification.solving import (
    REFUSED,
    SPENT,
    Loss,
    Objective,
    Progress,
    Solution,
    interrupted,
)

Array = NDArray[np.float64]
OF_START = 1e-6
"""The tolerance refers to the cost at the end, which is as much smaller than at the start."""


class _SpentError(Exception):
    """All evaluations are spent."""


def slsqp(
    objective: Objective,
    start: Array,
    loss: Loss,
    tolerance: float,
    max_evaluations: int,
    watch: Callable[[Progress], None] | None,
) -> Solution:
    """Minimise as `solving.solve` does, which checks and explains the arguments."""
    from scipy.optimize import Bounds, minimize

    if loss != "linear":
        raise ValueError("SLSQP minimises squares; take trf for a robust loss.")
    begun = perf_counter()
    evaluations, iteration = 0, 0
    start_cost = objective.cost(start)
    best = (start_cost, start.copy())
    # SLSQP takes numbers of the order of 1 for granted, in its steps and in where it stops
    unit = start_cost or 1.0

    def cost(vector: Array) -> float:
        nonlocal evaluations, best
        if evaluations >= max_evaluations:
            raise _SpentError
        evaluations += 1
        try:
            value = objective.cost(vector)
        except DomainError:
            return REFUSED
        if value < best[0]:
            best = (value, vector.copy())
        return value / unit

    def told(vector: Array) -> None:
        nonlocal iteration
        iteration += 1
        if watch is not None:
            seconds = perf_counter() - begun
            watch(
                Progress(iteration, best[0], best[1].copy(), seconds, evaluations, max_evaluations)
            )

    low, high = objective.bounds
    try:
        found = minimize(
            cost,
            start,
            method="SLSQP",
            bounds=Bounds(low, high, keep_feasible=True),
            callback=told,
            options={"maxiter": max_evaluations, "ftol": OF_START * tolerance},
        )
        converged, message = bool(found.success), str(found.message)
    except _SpentError:
        converged, message = False, SPENT
    except KeyboardInterrupt:
        return interrupted(best[1], best[0], start_cost, evaluations, perf_counter() - begun)
    return Solution(
        best[1],
        best[0],
        start_cost,
        evaluations,
        converged,
        False,
        message,
        perf_counter() - begun,
    )
