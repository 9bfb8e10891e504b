"""Columns of whole numbers that begin anew are counters, and of which size."""

import numpy as np
import pytest

from swashplate.campaign import rolls_over_at

TIME = np.linspace(0.0, 10.0, 2001)
THERE_AND_BACK = np.floor(9000.0 * np.sin(0.6 * TIME))
"""Up to 9000 counts and back, at most 27 in a sample."""


@pytest.mark.parametrize("size", [1000, 3600, 4096])
def test_a_counter_that_begins_anew(size: int) -> None:
    assert rolls_over_at(THERE_AND_BACK % size) == size


def test_the_counts_of_a_turn_are_likely() -> None:
    seen = THERE_AND_BACK % 3990
    assert rolls_over_at(seen) == 4000
    assert rolls_over_at(seen, 3990.0) == 3990


def test_a_signed_counter() -> None:
    assert rolls_over_at((THERE_AND_BACK + 2048) % 4096 - 2048) == 4096


@pytest.mark.parametrize(
    "values",
    [
        THERE_AND_BACK,  # never begins anew
        np.arange(2001.0) % 256,  # counts the samples
        THERE_AND_BACK % 4096 + 0.5,
        np.where(TIME % 2.0 < 1.0, 0.0, 1000.0),  # a switch
        np.where(TIME < 8.0, np.floor(400.0 * np.sin(0.3 * TIME)), 0.0),  # set to zero
        np.full(5, np.nan),
        np.zeros(0),
    ],
)
def test_what_is_none(values: np.ndarray) -> None:
    assert rolls_over_at(values) is None
