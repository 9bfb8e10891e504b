"""Recurrences over blocks, against loops written out and SciPy's filters."""

import numpy as np
import pytest
from scipy.signal import lfilter

from swashplate.simulation.recurrences import follow, follow_second_order, integrate_row, settle

pytestmark = pytest.mark.traced

ROWS, COUNT = 6, 37
CHOSEN = np.array([4, 0, 1, 5])
"""Row 5 is the idle one."""


@pytest.fixture
def rows() -> np.ndarray:
    values = np.random.default_rng(0).normal(size=(ROWS, COUNT + 5))
    values[5] = 0.0
    return values


@pytest.fixture
def factors() -> np.ndarray:
    return np.random.default_rng(1).uniform(0.0, 1.0, (2, COUNT + 5))


def test_follow(rows: np.ndarray, factors: np.ndarray) -> None:
    state = np.array([1.0, -2.0, 3.0, 4.0, 0.5, 0.0])
    before, begin = rows.copy(), state.copy()
    follow(factors[0], rows, CHOSEN, 3, COUNT, state)
    for row in (0, 1, 4):
        y = begin[row]
        for n in range(COUNT):
            assert rows[row, 3 + n] == y
            y = factors[0, n] * y + before[row, 3 + n]
        assert state[row] == y
    assert np.array_equal(rows[[2, 3, 5]], before[[2, 3, 5]])
    assert np.array_equal(rows[:, :3], before[:, :3])
    assert np.array_equal(rows[:, 3 + COUNT :], before[:, 3 + COUNT :])


def test_settle(rows: np.ndarray, factors: np.ndarray) -> None:
    state = np.array([1.0, -2.0, 3.0, 4.0, 0.5, 0.0])
    before, begin = rows.copy(), state.copy()
    settle(factors[0], rows, CHOSEN, COUNT, state)
    for row in (0, 1, 4):
        y = begin[row]
        for n in range(COUNT):
            y = factors[0, n] * y + before[row, n]
            assert rows[row, n] == y
        assert state[row] == y


def test_second_order(rows: np.ndarray, factors: np.ndarray) -> None:
    state, previous = np.arange(6.0), np.arange(6.0) - 3.0
    state[5] = previous[5] = 0.0
    before, y_begin, z_begin = rows.copy(), state.copy(), previous.copy()
    follow_second_order(factors[0], factors[1], rows, CHOSEN, COUNT, state, previous)
    for row in (0, 1, 4):
        y, z = y_begin[row], z_begin[row]
        for n in range(COUNT):
            assert rows[row, n] == y
            following = factors[0, n] * y + (factors[1, n] * z + before[row, n])
            z, y = y, following
        assert (state[row], previous[row]) == (y, z)


def test_blocks_join(rows: np.ndarray, factors: np.ndarray) -> None:
    whole, state = rows.copy(), np.zeros(6)
    follow(factors[0], whole, CHOSEN, 0, COUNT, state)
    first, second, joined = rows[:, :20].copy(), rows[:, 20:COUNT].copy(), np.zeros(6)
    follow(factors[0], first, CHOSEN, 0, 20, joined)
    follow(factors[0, 20:], second, CHOSEN, 0, COUNT - 20, joined)
    assert np.array_equal(np.hstack([first, second])[[0, 1, 4]], whole[[0, 1, 4], :COUNT])
    assert np.array_equal(joined, state)


def test_constant_factor_is_a_first_order_filter(rows: np.ndarray) -> None:
    expected = lfilter([0.0, 1.0], [1.0, -0.8], rows[0, :COUNT])
    follow(np.full(COUNT, 0.8), rows, CHOSEN, 0, COUNT, np.zeros(6))
    np.testing.assert_allclose(rows[0, :COUNT], expected, rtol=0.0, atol=1e-14)


def test_integral_over_two_blocks() -> None:
    rate = np.random.default_rng(3).normal(size=50)
    expected = np.concatenate([[0.0], np.cumsum(0.5 * 0.1 * (rate[1:] + rate[:-1]))])
    row, state = rate.copy(), np.zeros(3)
    integrate_row(row, 0, 20, 0.1, state)
    integrate_row(row, 20, 30, 0.1, state)
    np.testing.assert_allclose(row, expected, rtol=0.0, atol=1e-14)
