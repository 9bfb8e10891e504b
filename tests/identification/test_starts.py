"""Where searches begin, and what they find again."""

from dataclasses import dataclass

import numpy as np
import pytest

from swashplate.errors import DomainError, InputError
from swashplate.identification.problem import Evaluation
from swashplate.identification.solving import sobol_starts, solve_from


@dataclass(frozen=True)
class Forces:
    """Three logarithms and a number; quadratic about a truth."""

    forbidden: float = np.inf

    @property
    def start(self) -> np.ndarray:
        return np.array([np.log(1.0), np.log(2.0), np.log(4.0), 0.5])

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        reach = np.array([np.log(2.0)] * 3 + [0.4])
        return self.start - reach, self.start + reach

    def evaluate(self, vector: np.ndarray, *, compressed: bool = True) -> Evaluation:
        if vector[3] > self.forbidden:
            raise DomainError("too much")
        truth = np.array([np.log(1.2), np.log(2.1), np.log(3.7), 0.45])
        return Evaluation(vector - truth, np.eye(4))

    def cost(self, vector: np.ndarray) -> float:
        return 0.5 * float(np.sum(self.evaluate(vector).residuals ** 2))


def test_points_outside_the_domain_are_drawn_again() -> None:
    starts = np.array(list(sobol_starts(Forces(forbidden=0.6), 32, seed=0)))
    assert starts.shape == (32, 4)
    assert (starts[:, 3] <= 0.6).all()
    with pytest.raises(InputError, match="narrow the bounds"):
        list(sobol_starts(Forces(forbidden=0.1001), 8, seed=0))


@dataclass(frozen=True)
class Stop:
    """A speed of 2 that a stop at x cuts off where x is below it; 1.5 was measured."""

    bounds: tuple[np.ndarray, np.ndarray] = (np.array([0.5]), np.array([6.0]))
    start = np.ones(1)

    def evaluate(self, vector: np.ndarray, *, compressed: bool = True) -> Evaluation:
        x = float(vector[0])
        return Evaluation(np.array([min(2.0, x) - 1.5]), np.array([[1.0 if x < 2.0 else 0.0]]))

    def cost(self, vector: np.ndarray) -> float:
        return 0.5 * float(self.evaluate(vector).residuals[0] ** 2)


def test_a_search_that_lost_the_stop_finds_it_again() -> None:
    (result,) = solve_from(Stop(), [np.full(1, 5.0)])
    np.testing.assert_allclose(result.vector, [1.5])
