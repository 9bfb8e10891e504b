"""One ammeter around both leads: rectified, masked about zero, and signed."""

import numpy as np
import pytest

from swashplate.campaign import signed_by_command, zero_crossings
from swashplate.errors import InputError

TIME = np.arange(11) * 0.1


def test_a_crossing_between_two_samples() -> None:
    # from +3 at 0.4 s to -1 at 0.5 s: zero at 0.475 s; 0.26 s around: 0.345 to 0.605 s
    signal = np.array([3.0, 3.0, 3.0, 3.0, 3.0, -1.0, -1.0, -1.0, -1.0, -1.0, -1.0])
    found = zero_crossings(TIME, signal, width=0.26)
    np.testing.assert_allclose(found.instants, [0.475])
    np.testing.assert_array_equal(np.flatnonzero(found.masked), [4, 5, 6])


def test_a_stay_at_zero_is_masked_at_both_ends() -> None:
    signal = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, -1.0, -1.0])
    found = zero_crossings(TIME, signal, width=0.22)
    np.testing.assert_allclose(found.instants, [0.1, 0.8])
    np.testing.assert_array_equal(np.flatnonzero(found.masked), [0, 1, 2, 7, 8, 9])


def test_rest_and_the_return_to_it_are_no_crossings() -> None:
    signal = np.array([0.0, 0.0, 1.0, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    found = zero_crossings(TIME, signal, width=0.2)
    assert found.instants.size == 0


def test_noise_below_the_level_has_no_sign() -> None:
    signal = np.array([2.0, 2.0, 0.01, -0.01, 0.01, -0.01, 2.0, 2.0, 2.0, 2.0, 2.0])
    assert zero_crossings(TIME, signal, width=0.1).instants.size == 4
    assert zero_crossings(TIME, signal, width=0.1, level=0.05).instants.size == 0


def test_sign_of_a_current_on_its_way_to_zero() -> None:
    command = np.array([0.0, -5.0, -5.0, 0.0, 0.0, 0.0, 4.0, 4.0, 4.0, 4.0, 4.0])
    reading = np.array([0.0, 0.1, 0.4, 0.3, 0.1, 0.0, 0.0, 0.2, 0.3, 0.4, 0.4])
    expected = [0.0, -0.1, -0.4, -0.3, -0.1, 0.0, 0.0, 0.2, 0.3, 0.4, 0.4]
    np.testing.assert_allclose(signed_by_command(reading, command), expected)


def test_wrong_readings_are_refused() -> None:
    with pytest.raises(InputError, match="rectified must not be negative, but row 3"):
        signed_by_command(np.where(np.arange(11) == 3, -0.1, 0.1), TIME)
    with pytest.raises(InputError, match="width must be positive"):
        zero_crossings(TIME, TIME, width=0.0)
    with pytest.raises(InputError, match="level must not be negative"):
        zero_crossings(TIME, TIME, width=0.1, level=-1.0)
