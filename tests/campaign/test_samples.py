"""Stamps and samples checked; counts, their roll-overs and jumps; one ammeter and its sign."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate.campaign import (
    find_lost_counts,
    increasing,
    interpolate_counts,
    rolls_over_at,
    signed_by_command,
    stamps_of,
    unwrap_counts,
)
from swashplate.errors import InputError


def test_rounded_stamps_are_put_back_onto_their_grid() -> None:
    grid = np.arange(600) / 512.0
    time, period = stamps_of(np.round(grid, 4))
    # the last stamp's own rounding, at most 5e-5 s, is spread over the record
    assert period == pytest.approx(1.0 / 512.0, abs=5e-5 / 599.0)
    np.testing.assert_allclose(time, grid, atol=5e-5)
    assert np.ptp(np.diff(time)) < 1e-12


@pytest.mark.parametrize(
    ("time", "said"),
    [
        ([0.0, 1.0, 1.0, 2.0], "row 2 (the first is 0) has 1.0 s after 1.0 s"),
        ([0.0, np.nan, 1.0], "time must be finite, but row 1"),
        ([0.0], "two rows at least"),
        ([[0.0, 1.0]], "one row of numbers"),
    ],
)
def test_wrong_stamps_are_refused(time: list, said: str) -> None:
    with pytest.raises(InputError) as refused:
        increasing(time)
    assert said in str(refused.value)


# --- counts ---------------------------------------------------------------------------------------


@given(
    st.lists(st.integers(-499, 499), min_size=1, max_size=50),
    st.integers(-(10**6), 10**6),
    st.sampled_from([1000, 1024, 999]),
    st.booleans(),
)
def test_any_motion_slower_than_half_the_range_is_recovered(
    steps: list[int], first: int, modulus: int, signed: bool
) -> None:
    walk = first + np.concatenate([[0], np.cumsum(steps)])
    low = modulus // 2 if signed else 0
    readings = (walk + low) % modulus - low
    unwrapped = unwrap_counts(readings, modulus=modulus)
    np.testing.assert_array_equal(unwrapped - unwrapped[0], walk - walk[0])
    assert unwrapped[0] == readings[0]


@pytest.mark.parametrize(
    ("counts", "modulus", "said"),
    [
        ([2, 3, 7], 8, "half the range of a counter of 8.*row 2 .* is 7"),
        ([0, 9], 8, "from 0 to 7, as of a counter of 8 .* row 1 .* is 9"),
        ([-1, 7], 8, "from -4 to 3, as of a signed counter of 8 .* row 1 .* is 7"),
        ([0, 0.5], 8, "whole numbers, but row 1"),
        ([0, 1], 2**64, "from 2 to 2.53 readings"),
        ([0, np.nan], 256, "finite, but row 1"),
    ],
)
def test_readings_that_no_such_counter_shows_are_refused(
    counts: list, modulus: int, said: str
) -> None:
    with pytest.raises(InputError, match=said):
        unwrap_counts(counts, modulus)


@pytest.mark.parametrize(
    ("time", "counts", "lines"),
    [
        # changes at rows 2, 5, 7; the first row begins the first line; after row 7 it is held
        (
            range(10),
            [5, 5, 6, 6, 6, 8, 8, 7, 7, 7],
            [5, 5.5, 6, 6 + 2 / 3, 6 + 4 / 3, 8, 7.5, 7, 7, 7],
        ),
        ([0.0, 1.0, 3.0, 4.0, 10.0], [0, 0, 1, 1, 2], [0.0, 1 / 3, 1.0, 1 + 1 / 7, 2.0]),
    ],
)
def test_interpolation_by_hand(time: list, counts: list, lines: list) -> None:
    np.testing.assert_allclose(interpolate_counts(time, counts), lines, rtol=1e-15)


def test_lost_counts_are_found_where_they_are() -> None:
    time = np.arange(1000) / 512.0
    counts = np.floor(300.0 * np.sin(2.0 * np.pi * time))  # at most 1885 counts/s
    counts[400:] += 50.0
    counts[700:] -= 21.0
    np.testing.assert_array_equal(find_lost_counts(time, counts), [400, 700])


# --- columns that are counters --------------------------------------------------------------------


LONG = np.linspace(0.0, 10.0, 2001)
THERE_AND_BACK = np.floor(9000.0 * np.sin(0.6 * LONG))
"""Up to 9000 counts and back, at most 27 in a sample."""


@pytest.mark.parametrize(
    ("values", "turn", "size"),
    [
        (THERE_AND_BACK % 3600, None, 3600),
        (THERE_AND_BACK % 3990, None, 4000),
        (THERE_AND_BACK % 3990, 3990.0, 3990),  # the counts of a turn are likely
        ((THERE_AND_BACK + 2048) % 4096 - 2048, None, 4096),  # signed
        (THERE_AND_BACK, None, 0),  # never begins anew
        (np.arange(2001.0) % 256, None, 0),  # counts the samples
        (THERE_AND_BACK % 4096 + 0.5, None, 0),
        (np.where(LONG % 2.0 < 1.0, 0.0, 1000.0), None, 0),  # a switch
        (np.where(LONG < 8.0, np.floor(400.0 * np.sin(0.3 * LONG)), 0.0), None, 0),  # set to 0
        (np.zeros(0), None, 0),
    ],
)
def test_columns_that_are_counters(values: np.ndarray, turn: float | None, size: int) -> None:
    assert rolls_over_at(values, turn) == size


# --- the ammeter ----------------------------------------------------------------------------------


TIME = np.arange(11) * 0.1


def test_sign_of_a_current_on_its_way_to_zero() -> None:
    command = np.array([0.0, -5.0, -5.0, 0.0, 0.0, 0.0, 4.0, 4.0, 4.0, 4.0, 4.0])
    reading = np.array([0.0, 0.1, 0.4, 0.3, 0.1, 0.0, 0.0, 0.2, 0.3, 0.4, 0.4])
    expected = [0.0, -0.1, -0.4, -0.3, -0.1, 0.0, 0.0, 0.2, 0.3, 0.4, 0.4]
    np.testing.assert_allclose(signed_by_command(reading, command), expected)
