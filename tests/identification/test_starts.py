"""Where searches begin, and how long they take."""

from dataclasses import dataclass

import numpy as np
import pytest

from swashplate.errors import DomainError, InputError
from swashplate.identification.solving import Evaluation, Progress, longest_left
from swashplate.identification.starts import by_increments, sobol_starts, solve_from, time_left


@dataclass(frozen=True)
class Forces:
    """Three logarithms of numbers that rise, and a number; quadratic about a truth."""

    rising: tuple[tuple[int, ...], ...] = ((0, 1, 2),)
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


def test_the_same_seed_gives_the_same_starts_however_many() -> None:
    few, many = (np.array(list(sobol_starts(Forces(), n, seed=3))) for n in (5, 20))
    np.testing.assert_array_equal(few, many[:5])
    assert not np.array_equal(few, np.array(list(sobol_starts(Forces(), 5, seed=4))))


def test_starts_rise_and_lie_within_the_bounds() -> None:
    starts = np.array(list(sobol_starts(Forces(), 64, seed=0)))
    low, high = Forces().bounds
    assert ((starts >= low) & (starts <= high)).all()
    assert (np.diff(starts[:, :3], axis=1) > 0.0).all()
    # spread over the bounds: a 64 point Sobol set is in every eighth of an interval
    share = (starts[:, 3] - low[3]) / (high[3] - low[3])
    assert set(np.floor(8.0 * share).astype(int)) == set(range(8))


def test_what_is_not_known_to_rise_may_cross() -> None:
    starts = np.array(list(sobol_starts(Forces(rising=()), 64, seed=0)))
    assert (np.diff(starts[:, :3], axis=1) < 0.0).any()


def test_points_outside_the_domain_are_drawn_again() -> None:
    starts = np.array(list(sobol_starts(Forces(forbidden=0.6), 32, seed=0)))
    assert starts.shape == (32, 4)
    assert (starts[:, 3] <= 0.6).all()
    with pytest.raises(InputError, match="narrow the bounds"):
        list(sobol_starts(Forces(forbidden=0.1001), 8, seed=0))


def test_increments_and_their_derivatives() -> None:
    """ln(d1 + d2) by ln d2 is d2 over the sum; checked by differences of the residuals."""
    form = by_increments(Forces())
    at = form.to_search(np.array([np.log(1.1), np.log(2.4), np.log(3.0), 0.4]))
    np.testing.assert_allclose(np.exp(at[:3]), [1.1, 1.3, 0.6])
    found = form.evaluate(at).jacobian
    for k in range(4):
        step = 1e-6 * np.eye(4)[k]
        above, below = (form.evaluate(at + sign * step).residuals for sign in (1.0, -1.0))
        np.testing.assert_allclose(found[:, k], (above - below) / 2e-6, atol=1e-8)


def test_every_start_finds_the_truth() -> None:
    results = solve_from(Forces(), list(sobol_starts(Forces(), 6, seed=1)))
    assert [each.number for each in results] == list(range(6))
    for each in results:
        assert each.cost < 1e-12


def test_time_left_by_hand() -> None:
    assert time_left(0, 10, 3.0) is None
    assert time_left(4, 6, 8.0) == 12.0
    assert longest_left(Progress(1, 5.0, np.zeros(1), 2.0, 4, 20)) == 8.0
    assert longest_left(Progress(0, 5.0, np.zeros(1), 0.0)) is None
