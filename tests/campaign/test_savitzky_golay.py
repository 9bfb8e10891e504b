"""The moving polynomial is exact for polynomials, to the edges, and knows no phase."""

import numpy as np
import pytest

from swashplate.campaign import savitzky_golay_speed
from swashplate.errors import InputError

TIME = np.arange(300) / 512.0


def test_slope_by_hand() -> None:
    # five samples, order 2: (-2 u₋₂ - u₋₁ + u₁ + 2 u₂)/10 per sample
    time, angle = np.arange(7.0) * 0.1, np.array([0.0, 1.0, 0.0, 4.0, 2.0, 1.0, 0.0])
    speed = savitzky_golay_speed(time, angle, window=0.5)
    assert speed[3] == pytest.approx((-2.0 * 1.0 - 0.0 + 2.0 + 2.0 * 1.0) / 10.0 / 0.1)


@pytest.mark.parametrize("order", [2, 3, 4])
def test_polynomials_are_differentiated_exactly_also_at_the_ends(order: int) -> None:
    polynomial = np.polynomial.Polynomial(np.arange(1.0, order + 2.0))
    speed = savitzky_golay_speed(TIME, polynomial(TIME), order=order)
    np.testing.assert_allclose(speed, polynomial.deriv()(TIME), rtol=1e-9)


def test_the_window_is_the_nearest_odd_number_of_samples() -> None:
    angle = np.random.default_rng(0).normal(size=300).cumsum()
    speed = savitzky_golay_speed(TIME, angle, window=10.9 / 512.0)
    eleven = savitzky_golay_speed(TIME, angle, window=11.0 / 512.0)
    np.testing.assert_allclose(speed, eleven, rtol=1e-12)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"window": 0.001}, "more than 2 samples for order 2 .* 0.001 s hold 1"),
        ({"window": 0.999}, "at most the record's 300, but 0.999 s hold 511"),
        ({"order": 0}, "order must be 1 at least"),
        ({"window": -1.0}, "window must be positive"),
    ],
)
def test_impossible_windows_are_refused(options: dict, said: str) -> None:
    with pytest.raises(InputError, match=said):
        savitzky_golay_speed(TIME, TIME, **options)


def test_uneven_stamps_are_refused() -> None:
    with pytest.raises(InputError, match="Savitzky-Golay .* evenly spaced .* resample"):
        savitzky_golay_speed(TIME**1.5, TIME)
