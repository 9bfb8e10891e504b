"""Counts: roll-overs out, staircases filled, jumps found, counters told from other columns."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate.campaign import (
    find_lost_counts,
    interpolate_counts,
    radians_per_count,
    rolls_over_at,
    unwrap_counts,
)
from swashplate.errors import InputError


def test_a_counter_of_three_bits_rolls_over_both_ways() -> None:
    unwrapped = unwrap_counts([6, 7, 1, 2, 1, 0, 6], 8)
    # 7 → 1 is +2 across the end, 0 → 6 is -2 across it
    np.testing.assert_array_equal(unwrapped.counts, [6, 7, 9, 10, 9, 8, 6])
    assert unwrapped.doubtful.size == 0


def test_large_steps_are_doubtful_and_half_the_range_is_refused() -> None:
    unwrapped = unwrap_counts([0, 3, 4], modulus=8)
    np.testing.assert_array_equal(unwrapped.counts, [0, 3, 4])
    np.testing.assert_array_equal(unwrapped.doubtful, [1])
    with pytest.raises(InputError, match="from 3 to 7 at row 2 .* half the range .* up or down"):
        unwrap_counts([2, 3, 7], modulus=8)


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
    np.testing.assert_array_equal(unwrapped.counts - unwrapped.counts[0], walk - walk[0])
    assert unwrapped.counts[0] == readings[0]


@pytest.mark.parametrize(
    ("counts", "modulus", "said"),
    [
        ([0, 9], 8, "hold 9 in row 1 .* outside the 0 to 7 of a counter of 8"),
        ([-1, 7], 8, "hold 7 in row 1 .* the -4 to 3 of a signed counter"),
        ([0, 0.5], 8, "whole numbers, but row 1"),
        ([0, 1], 2**64, "from 2 to 2.53 readings"),
        ([0, 1], 1, "from 2 to 2.53 readings, not 1"),
        ([0, np.nan], 256, "finite, but row 1"),
    ],
)
def test_readings_that_no_such_counter_shows_are_refused(
    counts: list, modulus: int, said: str
) -> None:
    with pytest.raises(InputError, match=said):
        unwrap_counts(counts, modulus)


def test_interpolation_by_hand() -> None:
    counts = [5, 5, 6, 6, 6, 8, 8, 7, 7, 7]
    # changes at rows 2, 5, 7; the first row begins the first line; after row 7 the count is held
    #        0        2                         5      7
    lines = [5, 5.5, 6, 6 + 2 / 3, 6 + 4 / 3, 8, 7.5, 7, 7, 7]
    np.testing.assert_allclose(interpolate_counts(np.arange(10.0), counts), lines, rtol=1e-15)


def test_interpolation_follows_uneven_stamps() -> None:
    time = [0.0, 1.0, 3.0, 4.0, 10.0]
    # changes at 3 s and 10 s
    lines = [0.0, 1 / 3, 1.0, 1 + 1 / 7, 2.0]
    np.testing.assert_allclose(interpolate_counts(time, [0, 0, 1, 1, 2]), lines, rtol=1e-15)


def test_counts_that_never_change_or_always_do_stay() -> None:
    time = np.arange(4.0)
    np.testing.assert_array_equal(interpolate_counts(time, [3, 3, 3, 3]), [3, 3, 3, 3])
    np.testing.assert_array_equal(interpolate_counts(time, [3, 9, 4, 5]), [3, 9, 4, 5])


@given(st.floats(0.02, 30.0), st.floats(0.0, 1.0), st.sampled_from([-1.0, 1.0]))
def test_steady_motion_is_found_to_the_motion_within_one_sample(
    speed: float, first: float, direction: float
) -> None:
    rows = np.arange(2000)
    position = first + direction * speed * rows
    counts = np.floor(position)
    changes = np.flatnonzero(np.diff(counts)) + 1
    inside = slice(changes[0], changes[-1] + 1)
    lines = interpolate_counts(rows, counts)
    # the edge below (forth) or above (back) was passed within the sample before the change
    behind = direction * (position - lines)[inside] + (1.0 if direction < 0.0 else 0.0)
    assert behind.min() >= -1e-9
    assert behind.max() <= min(1.0, speed) + 1e-9


def test_angle_of_the_hoist_winch() -> None:
    # 400 counts a turn geared 120/19 to 1: one turn of the winch is 400·120/19 = 2526.3 counts
    angle = radians_per_count(400.0, 120.0 / 19.0)
    assert angle * 400.0 * 120.0 / 19.0 == pytest.approx(2.0 * np.pi, rel=1e-15)
    assert radians_per_count(400.0, 120.0 / 19.0, sign=-1) == -angle
    with pytest.raises(InputError, match="sign must be 1 or -1, not 0"):
        radians_per_count(400.0, sign=0)
    with pytest.raises(InputError, match="counts_per_turn must be positive"):
        radians_per_count(0.0)


def test_lost_counts_are_found_where_they_are() -> None:
    time = np.arange(1000) / 512.0
    counts = np.floor(300.0 * np.sin(2.0 * np.pi * time))  # at most 1885 counts/s
    counts[400:] += 50.0
    counts[700:] -= 21.0
    np.testing.assert_array_equal(find_lost_counts(time, counts), [400, 700])


def test_stamps_count_and_a_record_must_be_long_enough() -> None:
    time = np.array([0.0, 0.1, 0.2, 1.2, 1.3, 1.4, 1.5])
    # 50 counts in the pause of 1 s are no faster than 5 in 0.1 s; 15 in 0.1 s are
    counts = [0.0, 5.0, 10.0, 60.0, 75.0, 80.0, 85.0]
    np.testing.assert_array_equal(find_lost_counts(time, counts), [4])
    with pytest.raises(InputError, match="5 rows is too short to find lost counts"):
        find_lost_counts(time[:5], counts[:5])


def test_rest_has_no_lost_counts() -> None:
    flicker = np.array([0, 0, 0, 1, 0, 0, 0, 0, 1, 1, 1, 0], dtype=float)
    assert find_lost_counts(np.arange(12.0), flicker).size == 0


# --- columns that are counters --------------------------------------------------------------------


LONG = np.linspace(0.0, 10.0, 2001)
THERE_AND_BACK = np.floor(9000.0 * np.sin(0.6 * LONG))
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
        np.where(LONG % 2.0 < 1.0, 0.0, 1000.0),  # a switch
        np.where(LONG < 8.0, np.floor(400.0 * np.sin(0.3 * LONG)), 0.0),  # set to zero
        np.full(5, np.nan),
        np.zeros(0),
    ],
)
def test_what_is_none(values: np.ndarray) -> None:
    assert rolls_over_at(values) is None
