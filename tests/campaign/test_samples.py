"""Stamps, counts with their roll-overs and jumps, the ammeter's sign, and speed from counts."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lsim
from tests.identification.given import run_of

from swashplate.campaign import (
    DIFFERENTIATOR,
    LOW_PASS,
    Channel,
    Encoder,
    find_lost_counts,
    increasing,
    interpolate_counts,
    rolls_over_at,
    signed_by_command,
    speed_from_angle,
    speed_of,
    stamp_statistics,
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
    ("rate", "begin", "step"),
    [
        (100.0, 1e5, 2.0**-7),  # a single float of a day's seconds
        (200.0, 4e4, 2.0**-8),
        (60.0, 0.0, 0.01),
        (512.0, 0.0, 1e-3),
    ],
)
def test_even_stamps_that_are_rounded_coarsely_have_their_rate(rate, begin, step) -> None:
    stamps = np.round((begin + np.arange(801) / rate) / step) * step
    read = stamp_statistics(stamps)
    assert read.rate == pytest.approx(rate, rel=2e-3)
    assert read.rounded == pytest.approx(step, rel=1e-3)
    assert read.missing == 0
    assert read.gaps.size == 0


@pytest.mark.parametrize("lost", [400, 799])
def test_a_sample_that_is_missing_among_rounded_stamps_is_seen(lost) -> None:
    stamps = np.delete(np.round(np.arange(801) / 100.0 / 2.0**-7) * 2.0**-7, lost)
    assert stamp_statistics(stamps).rounded == 0.0


def test_stamps_of_two_intervals_are_not_rounded() -> None:
    # a logger that slows down, and an even one with gaps
    slower = np.cumsum([0.0] + [0.01] * 300 + [0.02] * 300)
    with_gaps = np.delete(np.arange(801) / 100.0, [200, 201, 600])
    assert stamp_statistics(slower).rounded == 0.0
    assert stamp_statistics(with_gaps).missing == 3


# --- counts ---------------------------------------------------------------------------------------


@given(
    st.lists(st.integers(-499, 499), min_size=1, max_size=50),
    st.integers(-(10**6), 10**6),
    st.sampled_from([1000, 1024, 999]),
    st.booleans(),
)
def test_any_motion_slower_than_half_the_range_is_recovered(steps, first, modulus, signed) -> None:
    walk = first + np.concatenate([[0], np.cumsum(steps)])
    low = modulus // 2 if signed else 0
    readings = (walk + low) % modulus - low
    unwrapped = unwrap_counts(readings, modulus=modulus)
    np.testing.assert_array_equal(unwrapped - unwrapped[0], walk - walk[0])
    assert unwrapped[0] == readings[0]


REFUSED = {
    "row 2 .* 1.0 s .* 1.0 s": lambda: increasing([0.0, 1.0, 1.0, 2.0]),
    "time .* finite.* row 1": lambda: increasing([0.0, np.nan, 1.0]),
    "two rows": lambda: increasing([0.0]),
    "one row of numbers": lambda: increasing([[0.0, 1.0]]),
    "half .* 8.* row 2 .* 7": lambda: unwrap_counts([2, 3, 7], 8),
    "0 to 7, .* 8 .* row 1 .* 9": lambda: unwrap_counts([0, 9], 8),
    "-4 to 3, .* signed .* row 1 .* 7": lambda: unwrap_counts([-1, 7], 8),
    "whole .* row 1": lambda: unwrap_counts([0, 0.5], 8),
    "2 to 2.53": lambda: unwrap_counts([0, 1], 2**64),
    "finite.* row 1": lambda: unwrap_counts([0, np.nan], 256),
}


@pytest.mark.parametrize(("said", "use"), REFUSED.items(), ids=REFUSED)
def test_stamps_and_readings_that_no_instrument_gives_are_refused(said: str, use) -> None:
    with pytest.raises(InputError, match=said):
        use()


@pytest.mark.parametrize(
    ("time", "counts", "lines"),
    [
        # changes at rows 2, 5, 7; the first row begins the first line; after row 7 it is held
        (range(9), [5, 5, 6, 6, 6, 8, 8, 7, 7], [5, 5.5, 6, 20 / 3, 22 / 3, 8, 7.5, 7, 7]),
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
        (THERE_AND_BACK, None, 0),  # never wraps
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


# --- speed from counts: the filters of Kruse (2001) in their exact form ---------------------------


H = 1.0 / 512.0


def position(
    time: np.ndarray, values: np.ndarray, encoder: Encoder | None = None, kind: str = "position"
) -> Channel:
    """A channel; of an encoder `values` are counts."""
    channel = run_of("x", time, {kind: values}, time=time)[kind]
    if encoder is None:
        return channel
    angle = values * encoder.angle_per_count
    return replace(channel, kind="encoder_counts", values=angle, encoder=encoder, counts=values)


@pytest.mark.interpreted
@pytest.mark.parametrize("rate", [512.0, 50.0])
def test_exact_path_is_the_continuous_one(rate: float) -> None:
    b = DIFFERENTIATOR
    time = np.arange(400) / rate
    angle = np.random.default_rng(4).normal(size=time.size).cumsum()
    # a b s / ((s + a)(s + b)), straight between samples
    _, speed, _ = lsim(
        ([LOW_PASS * b, 0.0], [1.0, LOW_PASS + b, LOW_PASS * b]), angle - angle[0], time
    )
    found = speed_from_angle(time, angle)
    np.testing.assert_allclose(found, speed, atol=1e-8 * np.abs(speed).max())


def test_a_gap_leaves_its_mean_speed_and_no_overflow() -> None:
    speed = speed_from_angle([0.0, 0.1, 1000.0, 1000.1], [0.0, 0.2, 1000.0, 1000.1])
    assert speed[2] == pytest.approx((1000.0 - 0.2) / (1000.0 - 0.1), rel=1e-12)


def test_the_plain_difference_and_a_measured_speed() -> None:
    time, values = np.array([0.0, 1.0, 3.0]), np.array([1.0, 2.0, 6.0])
    found = speed_of(position(time, values), "difference")
    assert (found.time.tolist(), found.speed.tolist()) == ([1.0, 3.0], [1.0, 2.0])
    assert speed_of(position(time, values, kind="shaft_speed")).speed is values


def test_counts_are_joined_before_they_are_filtered() -> None:
    counts = np.floor(0.3 * np.arange(400.0))
    winch = position(np.arange(400) * H, counts, Encoder(2526.3, 1.0, -1, None))
    found = speed_of(winch)
    # 0.3 counts a sample, backwards: neighbours alone would give 0 or a whole count
    expected = -0.3 * 2.0 * np.pi / 2526.3 / H
    np.testing.assert_allclose(found.speed[200:380], expected, rtol=0.02)
    assert found.delay == pytest.approx(0.02122, abs=1e-5)
