"""A problem with one unknown held: what a profile minimises."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swashplate.identification.problem import Problem
from swashplate.identification.solving import Evaluation, solve

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Held:
    """The other unknowns of a problem, for `solving.solve`."""

    problem: Problem
    index: int
    """Of the unknown that is held."""
    number: float
    """Where, in the solver's vector."""
    start: Array
    """(K - 1,) where the others begin."""

    @property
    def bounds(self) -> tuple[Array, Array]:
        """(K - 1,) bounds of the others."""
        low, high = self.problem.bounds
        return np.delete(low, self.index), np.delete(high, self.index)

    def evaluate(self, vector: Array, *, compressed: bool = True) -> Evaluation:
        """As of the problem, without the held unknown's column."""
        whole = self.problem.evaluate(self.whole(vector), compressed=compressed)
        return Evaluation(whole.residuals, np.delete(whole.jacobian, self.index, axis=1))

    def cost(self, vector: Array) -> float:
        """As of the problem."""
        return self.problem.cost(self.whole(vector))

    def whole(self, vector: Array) -> Array:
        """(K,) vector with the held unknown put in."""
        return np.insert(vector, self.index, self.number)


def minimiser(
    problem: Problem, *, tolerance: float = 1e-8, max_evaluations: int = 60
) -> Callable[[int, float, Array], tuple[float, Array]]:
    """What `profiles.profile` asks for: the least cost with one unknown held."""

    def minimise(index: int, number: float, start: Array) -> tuple[float, Array]:
        low, high = problem.bounds
        others = np.delete(np.clip(start, low, high), index)
        if not others.size:
            vector = np.array([number])
            return problem.cost(vector), vector
        held = Held(problem, index, number, others)
        found = solve(held, others, tolerance=tolerance, max_evaluations=max_evaluations)
        return found.cost, held.whole(found.vector)

    return minimise
