"""Stamps and samples are checked, and every refusal names the row."""

from pathlib import Path

import numpy as np
import pytest

from swashplate.campaign import (
    increasing,
    signal,
    stamp_statistics,
    stamps_of,
)
from swashplate.errors import InputError

SHARED = Path(__file__).parents[3] / "shared"


def test_rounded_stamps_are_put_back_onto_their_grid() -> None:
    grid = np.arange(600) / 512.0
    stamps = stamps_of(np.round(grid, 4))
    assert stamps.period is not None
    # the last stamp's own rounding, at most 5e-5 s, is spread over the record
    assert stamps.period == pytest.approx(1.0 / 512.0, abs=5e-5 / 599.0)
    np.testing.assert_allclose(stamps.time, grid, atol=5e-5)
    assert np.ptp(np.diff(stamps.time)) < 1e-12


def test_uneven_stamps_stay_as_they_are() -> None:
    time = np.array([0.0, 1.0, 2.2, 3.0])
    stamps = stamps_of(time)
    assert stamps.period is None
    np.testing.assert_array_equal(stamps.time, time)


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


def test_wrong_samples_are_refused_by_row() -> None:
    with pytest.raises(InputError, match="speed must be finite, but row 2 .* is inf"):
        signal("speed", [0.0, 1.0, np.inf, 2.0], 4)
    with pytest.raises(InputError, match="one row for each of the 5 stamps"):
        signal("speed", np.zeros(4), 5)
    with pytest.raises(InputError, match="must be numbers"):
        signal("speed", ["a", "b"], 2)
    with pytest.raises(InputError, match="one signal .* not of the shape"):
        signal("speed", np.zeros((4, 3)), 4)


def test_statistics_by_hand() -> None:
    # intervals 0.1 0.12 0.08 0.1 0.5 0.1: median 0.1, the fifth a gap of four samples
    found = stamp_statistics([0.0, 0.1, 0.22, 0.3, 0.4, 0.9, 1.0])
    assert found.rows == 7
    assert found.rate == pytest.approx(10.0)
    assert found.jitter == pytest.approx(np.sqrt(2 * 0.02**2 / 5))
    assert found.longest == pytest.approx(0.5)
    np.testing.assert_array_equal(found.gaps, [5])
    assert found.missing == 4
    assert not found.even


def test_rounded_stamps_of_an_even_logger_are_even() -> None:
    found = stamp_statistics(np.round(np.arange(1000) / 512.0, 4))
    assert found.even
    assert found.gaps.size == 0
    assert found.missing == 0


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
