"""The covariance under stationary coloured noise."""

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from swashplate.identification.linearised import LinearisedFit, LinearisedRun
from swashplate.identification.noise import (
    NoiseColour,
    coloured_noise_covariance,
    noise_model,
    white_noise_covariance,
)
from swashplate.identification.unknowns import Unknowns

N = 3000
TIME = np.arange(N) / 512.0
SHAPES = np.column_stack(
    [np.sin(0.7 * TIME), 1.0 - np.exp(-TIME / 0.3), np.exp(-((TIME - 2.0) ** 2) / 0.02)]
)


def first_order(rho: float, seed: int, runs: int, n: int = N) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(size=(runs, n + 500))
    return lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], noise)[:, 500:]


def fit(noise: np.ndarray, weight: np.ndarray | None = None) -> LinearisedFit:
    factor = np.ones(N) if weight is None else weight
    jacobian = SHAPES * factor[:, None]
    total = len(noise) * jacobian.T @ jacobian
    step = -np.linalg.solve(total, sum(jacobian.T @ (factor * each) for each in noise))
    runs = [
        LinearisedRun(f"run {k}", "speed", TIME, factor * each + jacobian @ step, jacobian, weight)
        for k, each in enumerate(noise)
    ]
    return LinearisedFit.of(runs, Unknowns.of("abc", np.ones(3)))


def exact(rho: float, runs: int, weight: np.ndarray | None = None) -> np.ndarray:
    """Standard errors from the noise's own Toeplitz matrix."""
    factor = np.ones(N) if weight is None else weight
    jacobian, twice = SHAPES * factor[:, None], SHAPES * factor[:, None] ** 2
    inverse = np.linalg.inv(runs * jacobian.T @ jacobian)
    middle = runs * twice.T @ toeplitz(rho ** np.arange(N)) @ twice
    return np.sqrt(np.diag(inverse @ middle @ inverse))


@pytest.mark.parametrize("rho", [0.0, 0.9, 0.98])
def test_errors_are_those_of_the_true_noise(rho: float) -> None:
    expected = exact(rho, 30)
    found = coloured_noise_covariance(fit(first_order(rho, 4, 30))).standard_errors
    np.testing.assert_allclose(found, expected, rtol=0.08)


def test_white_noise_errors_are_seven_to_ten_times_too_small() -> None:
    """Residuals of ρ = 0.98 (campaign.md: 7–9 times; nearly 10 for derivatives that are slow)."""
    made = fit(first_order(0.98, 5, 30))
    ratio = exact(0.98, 30) / white_noise_covariance(made).standard_errors
    assert ((ratio > 6.5) & (ratio < 10.5)).all()


def test_weights_enter_twice() -> None:
    weight = np.where((TIME > 1.0) & (TIME < 1.5), 10.0, 1.0)
    found = coloured_noise_covariance(fit(first_order(0.95, 6, 30), weight)).standard_errors
    np.testing.assert_allclose(found, exact(0.95, 30, weight), rtol=0.08)


def test_what_the_fit_took_is_given_back() -> None:
    """Three runs of 41 independent samples and three unknowns: raw residuals lose a tenth."""
    ratios, raw = [], []
    for seed in range(40):
        noise = first_order(0.98, 100 + seed, 3)
        made = fit(noise)
        model = noise_model(made)
        ratios.append(np.mean(list(model.levels.values())))
        raw.append(np.mean([each.residual @ each.residual for each in made.runs]) / N)
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.06)
    assert np.mean(raw) < np.mean(ratios) - 0.03


def test_runs_have_levels_of_their_own() -> None:
    noise = first_order(0.9, 7, 6)
    noise[0] *= 5.0
    levels = noise_model(fit(noise)).levels
    assert levels[0] == pytest.approx(25.0, rel=0.25)
    assert levels[1] == pytest.approx(1.0, rel=0.35)


def test_a_given_colour_is_the_first_guess() -> None:
    made = fit(first_order(0.9, 8, 10))
    white = NoiseColour("speed", tuple(range(10)), 1 / 512, np.array([1.0]), 0, 700)
    found = coloured_noise_covariance(made, colours=[white]).standard_errors
    np.testing.assert_allclose(found, exact(0.9, 10), rtol=0.2)


def test_zero_residuals_have_zero_errors() -> None:
    found = coloured_noise_covariance(fit(np.zeros((2, N))))
    np.testing.assert_allclose(found.standard_errors, 0.0, atol=1e-15)
    assert np.isfinite(found.degrees_of_freedom).all() or np.isinf(found.degrees_of_freedom).all()


def test_gaps_and_several_channels() -> None:
    """A quarter of each run missing, a second channel without noise: still the true errors."""
    some = np.ones(N, bool)
    some[1200:1950] = False
    part, places = SHAPES[some], np.flatnonzero(some)
    noise = first_order(0.95, 9, 20)[:, some]
    inverse = np.linalg.inv(20 * part.T @ part)
    dense = 20 * part.T @ (0.95 ** np.abs(np.subtract.outer(places, places)) @ part)
    step = -inverse @ sum(part.T @ each for each in noise)
    runs = [
        LinearisedRun(f"run {k}", "speed", TIME[some], each + part @ step, part)
        for k, each in enumerate(noise)
    ]
    silent = LinearisedRun("run 0", "current", TIME, np.zeros(N), np.zeros((N, 3)))
    made = LinearisedFit.of([*runs, silent], Unknowns.of("abc", np.ones(3)))
    expected = np.sqrt(np.diag(inverse @ dense @ inverse))
    found = coloured_noise_covariance(made).standard_errors
    np.testing.assert_allclose(found, expected, rtol=0.1)
