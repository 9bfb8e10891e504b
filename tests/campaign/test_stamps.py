"""Stamps and samples are checked, and every refusal names the row."""

import numpy as np
import pytest

from swashplate.campaign.stamps import even_period, increasing, samples, signal, stamps_of
from swashplate.errors import InputError


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


def test_a_pause_is_named_where_even_stamps_are_needed() -> None:
    with pytest.raises(InputError, match="row 3 .* comes 1 s after .* where 0.1 s is usual"):
        even_period([0.0, 0.1, 0.2, 1.2, 1.3], "The filter")


def test_wrong_samples_are_refused_by_row_and_column() -> None:
    values = np.zeros((4, 3))
    values[2, 1] = np.inf
    with pytest.raises(InputError, match="row 2 of column 1 .* is inf"):
        samples("speed", values, 4)
    with pytest.raises(InputError, match="one row for each of the 5 stamps"):
        samples("speed", np.zeros((4, 3)), 5)
    with pytest.raises(InputError, match="must be numbers"):
        samples("speed", ["a", "b"], 2)
    with pytest.raises(InputError, match="one signal, not 3"):
        signal("speed", np.zeros((4, 3)), 4)
