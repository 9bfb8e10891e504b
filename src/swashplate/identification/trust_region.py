"""SciPy's trust region for bounded least squares, begun anew where it gets stuck at an edge."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError
from swashplate.identification.solving import (
    REFUSED,
    SPENT,
    Evaluation,
    Loss,
    Objective,
    Progress,
    Solution,
    interrupted,
)

Array = NDArray[np.float64]

LEG = 30
"""Evaluations after which the region is made as wide as at first. Where the cost has an edge, such
as a step that just reaches the swash plate's stop, it shrinks to nothing."""
GAINED = 1e-6
"""Relative gain of a leg from which another one is worth it."""
UNCHANGED = 2
_ENDINGS = {
    0: SPENT,
    1: "the gradient vanished",
    UNCHANGED: "the cost no longer changed",
    3: "the parameters no longer changed",
    4: "neither cost nor parameters changed any more",
}


class _Memory:
    """Evaluates, remembers the last point and the best one, and refuses what is out of domain."""

    def __init__(self, objective: Objective, compressed: bool) -> None:
        self.objective, self.compressed = objective, compressed
        self.evaluations = 0
        self.best: tuple[float, Array] | None = None
        self._vector: Array | None = None
        self._evaluation: Evaluation | None = None
        self._scale = 1.0

    def __call__(self, vector: Array) -> Evaluation:
        if self._vector is not None and np.array_equal(vector, self._vector):
            assert self._evaluation is not None
            return self._evaluation
        self.evaluations += 1
        try:
            evaluation = self.objective.evaluate(vector, compressed=self.compressed)
        except DomainError:
            if self._evaluation is None:
                raise  # the start itself: there is nothing to go back to
            evaluation = Evaluation(
                np.full_like(self._evaluation.residuals, self._scale), self._evaluation.jacobian
            )
        else:
            cost = 0.5 * float(evaluation.residuals @ evaluation.residuals)
            if self.best is None:
                self._scale = float(np.sqrt(REFUSED * (2.0 * cost + 1e-300)))
            if self.best is None or cost < self.best[0]:
                self.best = (cost, vector.copy())
        self._vector, self._evaluation = vector.copy(), evaluation
        return evaluation


def trust_region(
    objective: Objective,
    start: Array,
    loss: Loss,
    tolerance: float,
    max_evaluations: int,
    watch: Callable[[Progress], None] | None,
) -> Solution:
    """Minimise as `solving.solve` does, which checks and explains the arguments."""
    from scipy.optimize import least_squares

    begun = perf_counter()
    # a robust loss looks at each residual, which the triangular factor has mixed
    memory = _Memory(objective, compressed=loss == "linear")
    start_cost = objective.cost(start)
    iteration = 0

    def told(intermediate_result) -> None:  # type: ignore[no-untyped-def]
        nonlocal iteration
        iteration += 1
        if watch is not None:
            now, seconds = intermediate_result, perf_counter() - begun
            watch(
                Progress(
                    iteration,
                    float(now.cost),
                    now.x.copy(),
                    seconds,
                    memory.evaluations,
                    max_evaluations,
                )
            )

    vector, before, spent = start, np.inf, 0
    try:
        while True:
            found = least_squares(
                lambda vector: memory(vector).residuals,
                vector,
                jac=lambda vector: memory(vector).jacobian,
                bounds=objective.bounds,
                method="trf",
                x_scale="jac",
                loss=loss,
                ftol=tolerance,
                xtol=tolerance,
                gtol=1e-14,
                max_nfev=min(LEG, max_evaluations - spent),
                callback=told,
            )
            first, gained = spent == 0, before - found.cost > GAINED * found.cost
            # steps that round to nothing are counted by SciPy alone
            spent += int(found.nfev)
            vector, before, ending = found.x, float(found.cost), int(found.status)
            if not first and not gained:
                ending = ending or UNCHANGED
                break
            if (first and ending > 0) or spent >= max_evaluations:
                break
    except KeyboardInterrupt:
        if memory.best is None:
            raise
        cost, vector = memory.best
        return interrupted(vector, cost, start_cost, memory.evaluations, perf_counter() - begun)
    return Solution(
        np.asarray(found.x, dtype=np.float64),
        float(found.cost),
        start_cost,
        memory.evaluations,
        ending > 0,
        False,
        _ENDINGS.get(ending, str(found.message)),
        perf_counter() - begun,
    )
