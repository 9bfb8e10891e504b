"""Edges of two channels become counts; what cannot have happened is listed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate.campaign.quadrature import decode_quadrature
from swashplate.errors import InputError

# a line of the encoder passes (0, 0), (1, 0), (1, 1), (0, 1): A rises before B
LINE = [(0, 0), (1, 0), (1, 1), (0, 1)]


def levels(quarters: list[int]) -> tuple[list[int], list[int]]:
    at = [LINE[quarter % 4] for quarter in quarters]
    return [a for a, _ in at], [b for _, b in at]


def test_forth_back_and_a_skipped_state() -> None:
    # 0 → 1 → 2 → 3 → 4 (a whole line), back to 3, then both channels at once to 5
    decoded = decode_quadrature(*levels([0, 1, 2, 3, 4, 3, 5, 6]))
    np.testing.assert_array_equal(decoded.counts, [0, 1, 2, 3, 4, 3, 3, 4])
    np.testing.assert_array_equal(decoded.illegal, [6])


@given(st.lists(st.sampled_from([-1, 0, 1]), min_size=1, max_size=60), st.integers(0, 3))
def test_any_walk_is_recovered(steps: list[int], first: int) -> None:
    walk = np.concatenate([[0], np.cumsum(steps)])
    decoded = decode_quadrature(*levels([int(first + each) for each in walk]))
    np.testing.assert_array_equal(decoded.counts, walk)
    assert decoded.illegal.size == 0


def test_booleans_are_levels_and_voltages_are_not() -> None:
    volts = np.array([0.1, 4.9, 4.8])
    decoded = decode_quadrature(volts > 2.5, np.zeros(3, dtype=bool))
    np.testing.assert_array_equal(decoded.counts, [0, 1, 1])
    with pytest.raises(InputError, match="a must be 0 or 1 .* row 0 .* is 0.1; compare a voltage"):
        decode_quadrature(volts, np.zeros(3))
    with pytest.raises(InputError, match="as many rows, not 2 and 3"):
        decode_quadrature([0, 1], [0, 1, 1])
