"""Solvers: from a start to the nearest optimum within the bounds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Method = Literal["trf", "slsqp"]
Loss = Literal["linear", "soft_l1", "huber", "cauchy", "arctan"]

REFUSED = 1e6
"""A point outside the model's domain costs this many times the start: the step is taken back."""
SPENT = "stopped at the largest number of evaluations; give it more"
"""Why a search stopped."""


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
    evaluations: int = 0
    most_evaluations: int = 0
    """How many it is given."""


def longest_left(progress: Progress) -> float | None:
    """Time that a solver may still take at most, not what it is expected to take. [s]

    All evaluations that it is given, at the pace so far. It ends earlier as a rule, when cost or
    parameters no longer change; how soon cannot be told beforehand.

    Returns
    -------
    float or None
        None before the first evaluation.
    """
    if progress.evaluations <= 0:
        return None
    left = max(progress.most_evaluations - progress.evaluations, 0)
    return progress.seconds / progress.evaluations * left


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
    from swashplate.identification.sqp import slsqp
    from swashplate.identification.trust_region import trust_region

    run = {"trf": trust_region, "slsqp": slsqp}[method]
    low, high = objective.bounds
    first = np.clip(objective.start if start is None else start, low, high)
    return run(objective, first, loss, tolerance, max_evaluations, watch)


def interrupted(
    vector: Array, cost: float, start_cost: float, evaluations: int, seconds: float
) -> Solution:
    """The solution of a search that was stopped from outside."""
    return Solution(
        vector, cost, start_cost, evaluations, False, True, "interrupted: the best so far", seconds
    )
