"""Statistics of stamps, and an even grid that invents nothing."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate.campaign.resampling import resample, stamp_statistics
from swashplate.errors import InputError

SHARED = Path(__file__).parents[3] / "shared"


def test_statistics_by_hand() -> None:
    # intervals 0.1 0.12 0.08 0.1 0.5 0.1: median 0.1, the fifth a gap of four samples
    found = stamp_statistics([0.0, 0.1, 0.22, 0.3, 0.4, 0.9, 1.0])
    assert found.rows == 7
    assert found.rate == pytest.approx(10.0)
    assert found.jitter == pytest.approx(np.sqrt(2 * 0.02**2 / 5))
    assert (found.shortest, found.longest) == pytest.approx((0.08, 0.5))
    np.testing.assert_array_equal(found.gaps, [5])
    assert found.missing == 4
    assert not found.even


def test_rounded_stamps_of_an_even_logger_are_even() -> None:
    found = stamp_statistics(np.round(np.arange(1000) / 512.0, 4))
    assert found.even
    assert found.gaps.size == 0
    assert found.missing == 0
    with pytest.raises(InputError, match="gap must be above 1"):
        stamp_statistics([0.0, 1.0], gap=1.0)


def test_gap_ends_a_segment() -> None:
    # a grid of 0.5 s; 1.5, 2.0 and 2.5 s lie within the pause from 1.2 to 2.8 s
    time, values = [0.0, 0.4, 0.8, 1.2, 2.8, 3.3], [0.0, 4.0, 8.0, 2.0, 5.0, 10.0]
    linear = resample(time, values, rate=2.0, interpolation="linear", largest_gap=0.5)
    np.testing.assert_allclose(linear.time, [0.0, 0.5, 1.0, 3.0])
    np.testing.assert_allclose(linear.values, [0.0, 5.0, 5.0, 7.0])
    assert linear.segments == (slice(0, 3), slice(3, 4))
    held = resample(time, values, rate=2.0, interpolation="previous", largest_gap=0.5)
    np.testing.assert_allclose(held.values, [0.0, 4.0, 8.0, 5.0])
    over = resample(time, values, rate=2.0, interpolation="linear", largest_gap=2.0)
    assert over.segments == (slice(0, 7),)


def test_a_gap_between_two_grid_points_ends_a_segment_too() -> None:
    time = np.array([0.0, 0.1, 0.2, 0.7, 0.8, 0.9, 1.0, 1.1])
    found = resample(time, time, rate=1.0, interpolation="linear", largest_gap=0.3)
    np.testing.assert_allclose(found.time, [0.0, 1.0])
    assert found.segments == (slice(0, 1), slice(1, 2))


def test_the_same_grid_changes_nothing() -> None:
    time = np.arange(4097) / 512.0  # ends at 8 s, which printing does not round
    values = np.random.default_rng(0).normal(size=(4097, 2))
    for interpolation in ("linear", "previous"):
        found = resample(
            np.round(time, 4), values, rate=512.0, interpolation=interpolation, largest_gap=0.01
        )
        np.testing.assert_array_equal(found.values, values)
        assert found.segments == (slice(0, 4097),)


@given(
    st.lists(st.floats(0.01, 1.0), min_size=1, max_size=40),
    st.floats(0.5, 60.0),
    st.floats(0.02, 2.0),
)
def test_nothing_is_invented(intervals: list[float], rate: float, largest_gap: float) -> None:
    time = 3.0 + np.concatenate([[0.0], np.cumsum(intervals)])
    found = resample(time, 2.0 * time, rate=rate, interpolation="linear", largest_gap=largest_gap)
    # stamps that are even but for 5 % are taken as even: 0.05 of their period
    slack = 0.1 * np.diff(time).max() + 2e-3 / rate
    np.testing.assert_allclose(found.values, 2.0 * found.time, atol=2.0 * slack)
    assert found.time[0] == time[0]
    assert found.time[-1] <= time[-1] + slack
    steps = np.round((found.time - time[0]) * rate)
    np.testing.assert_allclose((found.time - time[0]) * rate, steps, atol=1e-6)
    wide = np.flatnonzero(np.diff(time) > largest_gap + 2.0 * slack)
    for first, last in zip(time[wide], time[wide + 1], strict=True):
        assert not np.any((found.time > first + slack) & (found.time < last - slack))
    joined = np.concatenate([np.arange(each.start, each.stop) for each in found.segments])
    np.testing.assert_array_equal(joined, np.arange(found.time.size))
    for each in found.segments:
        assert np.all(np.diff(steps[each]) == 1.0)


def test_wrong_arguments_are_refused() -> None:
    time = np.arange(5.0)
    with pytest.raises(InputError, match="'previous' or 'linear', not 'cubic'"):
        resample(time, time, rate=1.0, interpolation="cubic", largest_gap=1.0)
    with pytest.raises(InputError, match="rate must be positive"):
        resample(time, time, rate=0.0, interpolation="linear", largest_gap=1.0)
    with pytest.raises(InputError, match="largest_gap must be positive"):
        resample(time, time, rate=1.0, interpolation="linear", largest_gap=-1.0)


def test_a_real_log_with_a_pause() -> None:
    folder = SHARED / "data" / "excavator"
    if not folder.exists():
        pytest.skip("the excavator's measured data are not beside this checkout")
    import polars as pl

    path = sorted(folder.glob("steps_*.csv"))[0]
    time = pl.read_csv(path)["Time"].to_numpy().astype(float)
    found = stamp_statistics(time)
    assert found.rate == pytest.approx(52.0, abs=2.0)
    assert found.longest == pytest.approx(1.0, abs=0.2)
    assert found.missing > 40
    even = resample(time, time, rate=50.0, interpolation="linear", largest_gap=0.1)
    assert len(even.segments) == 1 + np.sum(np.diff(time) > 0.1)
