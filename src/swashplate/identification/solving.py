"""Solvers: from a start to the nearest optimum within the bounds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError

Array = NDArray[np.float64]
Method = Literal["trf", "slsqp"]
Loss = Literal["linear", "soft_l1", "huber", "cauchy", "arctan"]

REFUSED = 1e6
"""A point outside the model's domain costs this many times the start: the step is taken back."""


class Evaluation(NamedTuple):
    """Residuals and their derivatives by the solver's vector at one point."""

    residuals: Array
    """(m,) residuals, or any vector of which sum of squares and gradient are the same."""
    jacobian: Array
    """(m, K)"""


class Objective(Protocol):
    """What a solver minimises: half the sum of squares."""

    @property
    def start(self) -> Array:
        """(K,) where to begin."""
        ...

    @property
    def bounds(self) -> tuple[Array, Array]:
        """(K,) lower and upper bounds."""
        ...

    def evaluate(self, vector: Array, *, compressed: bool = True) -> Evaluation:
        """Residuals and Jacobian; compressed, as a triangular factor of a few rows.

        Raises
        ------
        DomainError
            If the model does not hold there.
        """
        ...

    def cost(self, vector: Array) -> float:
        """Half the sum of squares alone, which is quicker."""
        ...


class Progress(NamedTuple):
    """Where a solver is."""

    iteration: int
    cost: float
    vector: Array
    seconds: float


@dataclass(frozen=True, eq=False)
class Solution:
    """The optimum that a solver reached."""

    vector: Array
    cost: float
    """Half the weighted sum of squares; with a robust loss, of the loss."""
    start_cost: float
    evaluations: int
    """Of the residuals; each but those of SLSQP's differences with Jacobian."""
    converged: bool
    interrupted: bool
    message: str
    """Why it stopped, in words."""
    seconds: float


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


def solve(
    objective: Objective,
    start: Array | None = None,
    *,
    method: Method = "trf",
    loss: Loss = "linear",
    tolerance: float = 1e-10,
    max_evaluations: int = 300,
    watch: Callable[[Progress], None] | None = None,
) -> Solution:
    """Minimise half the sum of squares within the bounds.

    Parameters
    ----------
    objective : Objective
        What to minimise.
    start : (K,) array, optional
        Where to begin instead of at the objective's start.
    method : {"trf", "slsqp"}
        SciPy's trust region for least squares on exact derivatives; or sequential quadratic
        programming with difference gradients, as the source did it.
    loss : Loss
        Robust loss on each residual, with ``"trf"`` alone.
    tolerance : float
        Relative change of cost and vector, and scaled gradient, at which to stop.
    max_evaluations : int
        Of the residuals.
    watch : callable, optional
        Told of each iteration. Ctrl-C ends the search with the best point so far.

    Raises
    ------
    DomainError
        If the model does not hold at the start.
    """
    run = {"trf": _trf, "slsqp": _slsqp}[method]
    low, high = objective.bounds
    first = np.clip(objective.start if start is None else start, low, high)
    return run(objective, first, loss, tolerance, max_evaluations, watch)


def _trf(
    objective: Objective,
    start: Array,
    loss: Loss,
    tolerance: float,
    max_evaluations: int,
    watch: Callable[[Progress], None] | None,
) -> Solution:
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
            now = intermediate_result
            watch(Progress(iteration, float(now.cost), now.x.copy(), perf_counter() - begun))

    try:
        found = least_squares(
            lambda vector: memory(vector).residuals,
            start,
            jac=lambda vector: memory(vector).jacobian,
            bounds=objective.bounds,
            method="trf",
            x_scale="jac",
            loss=loss,
            ftol=tolerance,
            xtol=tolerance,
            gtol=1e-14,
            max_nfev=max_evaluations,
            callback=told,
        )
    except KeyboardInterrupt:
        if memory.best is None:
            raise
        cost, vector = memory.best
        return _interrupted(vector, cost, start_cost, memory.evaluations, perf_counter() - begun)
    return Solution(
        np.asarray(found.x, dtype=np.float64),
        float(found.cost),
        start_cost,
        memory.evaluations,
        bool(found.status > 0),
        False,
        _ENDINGS.get(int(found.status), str(found.message)),
        perf_counter() - begun,
    )


_ENDINGS = {
    0: "stopped at the largest number of evaluations; give it more",
    1: "the gradient vanished",
    2: "the cost no longer changed",
    3: "the parameters no longer changed",
    4: "neither cost nor parameters changed any more",
}


def _slsqp(
    objective: Objective,
    start: Array,
    loss: Loss,
    tolerance: float,
    max_evaluations: int,
    watch: Callable[[Progress], None] | None,
) -> Solution:
    from scipy.optimize import Bounds, minimize

    if loss != "linear":
        raise ValueError("SLSQP minimises squares; take trf for a robust loss.")
    begun = perf_counter()
    evaluations, iteration = 0, 0
    start_cost = objective.cost(start)
    best = (start_cost, start.copy())

    def cost(vector: Array) -> float:
        nonlocal evaluations, best
        evaluations += 1
        try:
            value = objective.cost(vector)
        except DomainError:
            return REFUSED * start_cost
        if value < best[0]:
            best = (value, vector.copy())
        return value

    def told(vector: Array) -> None:
        nonlocal iteration
        iteration += 1
        if watch is not None:
            watch(Progress(iteration, best[0], best[1].copy(), perf_counter() - begun))

    low, high = objective.bounds
    try:
        found = minimize(
            cost,
            start,
            method="SLSQP",
            bounds=Bounds(low, high, keep_feasible=True),
            callback=told,
            options={"maxiter": max(max_evaluations // (start.size + 1), 1), "ftol": tolerance},
        )
    except KeyboardInterrupt:
        return _interrupted(best[1], best[0], start_cost, evaluations, perf_counter() - begun)
    return Solution(
        best[1],
        best[0],
        start_cost,
        evaluations,
        bool(found.success),
        False,
        str(found.message),
        perf_counter() - begun,
    )


def _interrupted(
    vector: Array, cost: float, start_cost: float, evaluations: int, seconds: float
) -> Solution:
    return Solution(
        vector, cost, start_cost, evaluations, False, True, "interrupted: the best so far", seconds
    )
