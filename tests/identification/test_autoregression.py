"""Autoregressive whitening and colouring."""

import numpy as np
import pytest

from swashplate.identification.bootstrap import autoregression
from swashplate.identification.noise import NoiseColour, grid_of


def colour(correlation: np.ndarray, length: int) -> NoiseColour:
    return NoiseColour("speed", (0,), 1.0, correlation, length, 1000)


def second_order(lags: int) -> np.ndarray:
    """Autocorrelation of e_t = 1.5 e_{t-1} - 0.7 e_{t-2} + u_t, from its own recursion."""
    rho = [1.0, 1.5 / 1.7]
    while len(rho) < lags:
        rho.append(1.5 * rho[-1] - 0.7 * rho[-2])
    return np.array(rho)


def test_second_order_noise_is_found_again() -> None:
    process = autoregression(colour(second_order(200), 100), 5000)
    np.testing.assert_allclose(process.coefficients[:2], [1.5, -0.7], atol=1e-6)
    # γ0 (1 - a1 ρ1 - a2 ρ2) is the innovations' variance
    expected = 1.0 - 1.5 * second_order(3)[1] + 0.7 * second_order(3)[2]
    assert process.deviation**2 == pytest.approx(expected, rel=1e-6)


def test_white_noise_has_order_zero() -> None:
    process = autoregression(colour(np.array([1.0]), 0), 100)
    assert process.coefficients.size == 0
    assert process.coloured(np.array([1.0, -1.0])).tolist() == [1.0, -1.0]


def test_colouring_undoes_whitening() -> None:
    process = autoregression(colour(second_order(200), 100), 5000)
    noise = np.random.default_rng(0).normal(size=3000)
    coloured = process.coloured(noise)
    innovations = process.innovations(coloured, grid_of(np.arange(float(coloured.size))))
    expected = noise[process.settling + process.coefficients.size :][: innovations.size]
    assert np.corrcoef(innovations, expected)[0, 1] > 1.0 - 1e-9
    assert innovations.std() == pytest.approx(1.0)


def test_innovations_do_not_reach_over_gaps() -> None:
    process = autoregression(colour(second_order(200), 100), 5000)
    order = process.coefficients.size
    time = np.concatenate([np.arange(100.0), np.arange(150.0, 250.0)])
    noise = np.random.default_rng(0).normal(size=200)
    assert process.innovations(noise, grid_of(time)).size == 2 * (100 - order)


def test_too_short_a_run_has_none() -> None:
    process = autoregression(colour(second_order(200), 100), 5000)
    assert process.innovations(np.zeros(1), grid_of(np.zeros(1))).size == 0


def test_an_impossible_autocorrelation_is_mended() -> None:
    """A flat correlation cut off at once is no process's; the model stays stable."""
    process = autoregression(colour(np.ones(20), 10), 1000)
    assert np.abs(np.roots(np.concatenate([[1.0], -process.coefficients]))).max() < 1.0
