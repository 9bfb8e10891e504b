"""Noise that differs along the runs: what a stationary estimate misses."""

import numpy as np
from tests.identification.linear import linear_fit, unknowns_of

from swashplate.identification.noise import Covariance, band_score_covariance
from swashplate.identification.problem import LinearisedFit, LinearisedRun

RUNS, N = 6, 5120
TIME = np.arange(N) / 512.0
SHORT = (np.abs(TIME % 1.0 - 0.5) < 0.02).astype(float)
LONG = (np.abs(TIME % 1.0 - 0.5) < 0.15).astype(float)


def fitted(noise: np.ndarray, pulses: np.ndarray) -> tuple[LinearisedFit, np.ndarray]:
    """Regression of noise on the design, the truth being 0."""
    design = np.column_stack([pulses, np.ones(N)])
    total = RUNS * design.T @ design
    estimate = -np.linalg.solve(total, sum(design.T @ each for each in noise))
    runs = [
        LinearisedRun(f"run {k}", "current", TIME, e + design @ estimate, design)
        for k, e in enumerate(noise)
    ]
    return linear_fit(runs, unknowns_of("ab", np.ones(2))), estimate


def scattered(
    kind: str, pulses: np.ndarray, draws: int = 80
) -> tuple[np.ndarray, list[Covariance]]:
    """Scatter of the estimates over draws, and what is said of it."""
    rng = np.random.default_rng(5)
    estimates, found = [], []
    for _ in range(draws):
        noise = rng.normal(size=(RUNS, N))
        if kind == "ripple":
            phase = rng.uniform(0.0, 2.0 * np.pi, (RUNS, 1))
            noise += np.sin(2.0 * np.pi * 12.0 * TIME + phase)
        if kind == "with every pulse":
            noise *= 1.0 + 4.0 * pulses
        fit, estimate = fitted(noise, pulses)
        estimates.append(estimate)
        found.append(band_score_covariance(fit))
    return np.sqrt(np.mean(np.square(estimates), axis=0)), found


def mean_error(found: list[Covariance]) -> np.ndarray:
    return np.sqrt(np.mean([each.standard_errors**2 for each in found], axis=0))


def test_a_ripple_that_meets_every_pulse_at_the_same_phase() -> None:
    """12 Hz come to the same phase every second: the pulses' errors add up, not their squares."""
    scatter, found = scattered("ripple", SHORT)
    # 80 draws tell a standard deviation to 8 %
    assert 0.8 < mean_error(found)[0] / scatter[0] < 1.25


def test_noise_that_comes_with_every_pulse() -> None:
    scatter, found = scattered("with every pulse", LONG)
    assert 0.8 < mean_error(found)[0] / scatter[0] < 1.25
