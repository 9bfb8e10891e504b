"""Past edges of a cost, and back from where an unknown has no effect."""

from dataclasses import dataclass

import numpy as np

from swashplate.errors import DomainError
from swashplate.identification.solving import Evaluation
from swashplate.identification.starts import dormant, nominal_effects, past_edge, solve_from, woken

BOUNDS = (np.array([-20.0]), np.array([20.0]))


@dataclass(frozen=True)
class Ridge:
    """x - 10, with a ridge over (0, 1) that a short step from 0 only climbs."""

    height: float = 5.0
    bounds: tuple[np.ndarray, np.ndarray] = BOUNDS
    forbidden: float = np.inf
    start = np.zeros(1)

    def evaluate(self, vector: np.ndarray, *, compressed: bool = True) -> Evaluation:
        x = float(vector[0])
        if x > self.forbidden:
            raise DomainError("too far")
        ridge = self.height if 0.0 < x < 1.0 else 0.0
        return Evaluation(np.array([x - 10.0 - ridge]), np.eye(1))

    def cost(self, vector: np.ndarray) -> float:
        return 0.5 * float(self.evaluate(vector).residuals[0] ** 2)


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


def test_a_longer_step_passes_a_ridge() -> None:
    """The whole step ends at 10, where nothing is left; 0.06 and less of it are on the ridge."""
    point, evaluations = past_edge(Ridge(), np.zeros(1), start_cost=50.0)
    assert point is not None
    np.testing.assert_allclose(point, [10.0])
    assert evaluations == 8


def test_the_step_is_cut_at_the_bounds_and_stays_in_the_domain() -> None:
    point, _ = past_edge(Ridge(bounds=(np.zeros(1), np.full(1, 4.0))), np.zeros(1), 50.0)
    np.testing.assert_allclose(point, [4.0])
    # of 1, 0.5, 0.25, 0.12 the last two of 10 lie below 4.9, and 2.5 is the better one
    point, _ = past_edge(Ridge(forbidden=4.9), np.zeros(1), 50.0)
    np.testing.assert_allclose(point, [2.5])


def test_where_nothing_gains_there_is_no_point() -> None:
    """A ridge all the way to the bound; and an optimum, whose rest is rounding."""
    assert past_edge(Ridge(bounds=(np.zeros(1), np.full(1, 0.9))), np.zeros(1), 50.0)[0] is None
    assert past_edge(Ridge(), np.full(1, 10.0 + 1e-12), 50.0)[0] is None


def test_a_search_from_before_the_ridge_ends_behind_it() -> None:
    (result,) = solve_from(Ridge(), [np.zeros(1)])
    assert result.cost < 1e-20
    np.testing.assert_allclose(result.vector, [10.0])


def test_an_unknown_without_effect_is_woken() -> None:
    """At 5 the stop is not reached; on the way to 1 it is from below 2 on: 24 steps of 1/6."""
    nominal = nominal_effects(Stop())
    np.testing.assert_allclose(nominal, [1.0])
    assert dormant(np.zeros(1), nominal).all()
    assert not dormant(np.full(1, 1e-3), nominal).any()
    point, _ = woken(Stop(), np.full(1, 5.0), nominal)
    assert point is not None
    np.testing.assert_allclose(point, [5.0 - 19.0 / 6.0])
    assert woken(Stop(), np.full(1, 1.2), nominal)[0] is None


def test_a_search_that_lost_the_stop_finds_it_again() -> None:
    (result,) = solve_from(Stop(), [np.full(1, 5.0)])
    np.testing.assert_allclose(result.vector, [1.5])
