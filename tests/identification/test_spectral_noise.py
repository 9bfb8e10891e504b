"""Errors under coloured noise from the smoothed spectrum of the residuals."""

import numpy as np
import pytest
from scipy.signal import lfilter
from tests.identification.linear import linear_fit, unknowns_of

from swashplate.errors import InputError
from swashplate.identification.noise import (
    band_score_covariance,
    coloured_noise_covariance,
    spectral_covariance,
)
from swashplate.identification.problem import LinearisedFit, LinearisedRun

N, RUNS = 4096, 4
TIME = np.arange(N) / 512.0
DESIGN = np.column_stack(
    [1.0 - np.exp(-TIME / 0.3), np.sin(1.7 * TIME), np.exp(-((TIME - 2.0) ** 2) / 0.02)]
)


def fitted(noise: np.ndarray, weight: np.ndarray | None = None) -> tuple[LinearisedFit, np.ndarray]:
    """Weighted regression of noise (runs, N) on the design, the truth being 0."""
    w = np.ones(N) if weight is None else weight
    rows = w[:, None] * DESIGN
    total = len(noise) * rows.T @ rows
    estimate = -np.linalg.solve(total, sum(rows.T @ (w * each) for each in noise))
    runs = [
        LinearisedRun(f"run {k}", "y", TIME, w * (e + DESIGN @ estimate), rows, weight)
        for k, e in enumerate(noise)
    ]
    return linear_fit(runs, unknowns_of("abc", np.ones(3))), estimate


def first_order(rho: float, rng: np.random.Generator, runs: int = RUNS) -> np.ndarray:
    drawn = rng.normal(size=(runs, N + 400))
    return lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], drawn)[:, 400:]


def by_hand(rho: float, weight: np.ndarray | None = None) -> np.ndarray:
    """Standard errors from the known autocovariance ρ^|k|."""
    w = np.ones(N) if weight is None else weight
    columns = (w**2)[:, None] * DESIGN
    lags = np.abs(np.subtract.outer(np.arange(N), np.arange(N)))
    inner = RUNS * columns.T @ (rho**lags @ columns)
    inverse = np.linalg.inv(RUNS * DESIGN.T @ columns)
    return np.sqrt(np.diag(inverse @ inner @ inverse))


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("rho", [0.0, 0.95])
def test_errors_are_those_of_the_true_noise(rho: float, weighted: bool) -> None:
    rng = np.random.default_rng(1)
    weight = np.where(TIME < 4.0, 2.0, 1.0) if weighted else None
    found = [
        spectral_covariance(fitted(first_order(rho, rng), weight)[0]).standard_errors
        for _ in range(20)
    ]
    # each from 4 runs of 8 s: about 20 independent frequencies, 20 campaigns
    np.testing.assert_allclose(
        np.sqrt(np.mean(np.square(found), axis=0)), by_hand(rho, weight), rtol=0.15
    )


def test_runs_have_levels_of_their_own() -> None:
    rng = np.random.default_rng(3)
    loud = first_order(0.5, rng) * np.array([[5.0], [1.0], [1.0], [1.0]])
    quiet = first_order(0.5, rng)
    errors = [spectral_covariance(fitted(each)[0]).standard_errors for each in (loud, quiet)]
    # (25 + 3)/4 of the variance
    np.testing.assert_allclose(errors[0] / errors[1], np.sqrt(7.0), rtol=0.35)


def test_the_larger_of_both_is_quoted() -> None:
    bump = DESIGN[:, 2]
    noise = np.random.default_rng(4).normal(size=(12, N)) * np.where(bump > 0.01, 10.0, 1.0)
    fit, _ = fitted(noise)
    both = np.maximum(
        spectral_covariance(fit).standard_errors, band_score_covariance(fit).standard_errors
    )
    np.testing.assert_allclose(coloured_noise_covariance(fit).standard_errors, both)
    # where the noise is loud, an error of noise that is alike everywhere misses it
    assert both[2] > 1.5 * spectral_covariance(fit).standard_errors[2]


def test_no_residual_has_no_error_and_too_few_samples_are_refused() -> None:
    fit, _ = fitted(np.zeros((2, N)))
    assert spectral_covariance(fit).standard_errors.tolist() == [0.0, 0.0, 0.0]
    run = LinearisedRun("run", "y", TIME[:3], np.ones(3), DESIGN[:3] + np.eye(3))
    few = linear_fit([run], unknowns_of("abc", np.ones(3)))
    with pytest.raises(InputError, match="3 samples for 3 parameters"):
        spectral_covariance(few)
