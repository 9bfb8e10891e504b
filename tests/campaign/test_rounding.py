"""What a count says of the position: by hand, and that the truth is where it says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate.campaign.rounding import rounded_positions


def test_slow_up_and_down_by_hand() -> None:
    # runs of 3, 2 and 4 rows; the change up at row 3 has u = 1/2, that down at row 5 too
    read = rounded_positions([7, 7, 7, 8, 8, 7, 7, 7, 7])
    np.testing.assert_allclose(read.position, [7.5, 7.5, 7.5, 8.25, 8.5, 7.75, 7.5, 7.5, 7.5])
    twelfths = [3, 3, 3, 1 / 4, 2, 1 / 4, 4, 4, 4]
    np.testing.assert_allclose(12.0 * read.variance, twelfths)


def test_a_count_that_is_new_in_every_row_stands_for_its_middle() -> None:
    read = rounded_positions([0, 3, 7, 5])
    np.testing.assert_array_equal(read.position, [0.5, 3.5, 7.5, 5.5])
    np.testing.assert_allclose(read.variance, 1.0 / 12.0)


def test_counts_that_never_change() -> None:
    read = rounded_positions(np.full(10, 4.0))
    np.testing.assert_array_equal(read.position, 4.5)
    np.testing.assert_allclose(read.variance, 10.0 / 12.0)


@given(st.floats(0.01, 0.9), st.floats(0.0, 1.0), st.sampled_from([1.0, -1.0]))
def test_at_a_change_the_truth_is_within_the_stated_distance(
    speed: float, first: float, direction: float
) -> None:
    truth = first + direction * speed * np.arange(1000.0)
    counts = np.floor(truth)
    read = rounded_positions(counts)
    changes = np.flatnonzero(np.diff(counts)) + 1
    inner = changes[1:-1]  # beside the first and last run, which the record cuts short
    half = np.sqrt(3.0 * read.variance[inner])
    error = np.abs(truth - read.position)[inner]
    assert np.all(error <= half + 1e-6)
    # never sharper than a steady motion of this speed allows
    assert np.all(2.0 * half >= min(1.0, speed) * (1.0 - speed) - 1e-6)


def test_the_middle_of_a_run_weighs_as_much_as_one_row() -> None:
    read = rounded_positions(np.full(50, 2.0))
    assert np.sum(1.0 / read.variance) == pytest.approx(12.0)
