"""Covariances by hand, and what refuses to be one."""

import numpy as np
from tests.identification.linear import linear_fit, unknowns_of

from swashplate.identification.noise import white_noise_covariance
from swashplate.identification.problem import LinearisedFit, LinearisedRun

RNG = np.random.default_rng(3)


def run(name: str, n: int, columns: int = 2, time: np.ndarray | None = None) -> LinearisedRun:
    stamps = np.arange(float(n)) if time is None else time
    return LinearisedRun(name, "speed", stamps, RNG.normal(size=n), RNG.normal(size=(n, columns)))


def fit(*runs: LinearisedRun, **more: object) -> LinearisedFit:
    count = runs[0].jacobian.shape[1]
    return linear_fit(runs, unknowns_of([f"p{k}" for k in range(count)], np.ones(count)), **more)


def test_white_noise_errors_are_the_textbooks() -> None:
    """Anscombe's first set: intercept 3.000 ± 1.125, slope 0.5001 ± 0.1179."""
    x = np.array([10, 8, 13, 9, 11, 14, 6, 4, 12, 7, 5.0])
    y = np.array([8.04, 6.95, 7.58, 8.81, 8.33, 9.96, 7.24, 4.26, 10.84, 4.82, 5.68])
    J = np.column_stack([np.ones(11), x])
    estimate = np.linalg.lstsq(J, y, rcond=None)[0]
    made = fit(LinearisedRun("a", "y", np.arange(11.0), J @ estimate - y, J))
    found = white_noise_covariance(made)
    np.testing.assert_allclose(found.standard_errors, [1.1247, 0.1179], atol=5e-5)
    assert found.degrees_of_freedom.tolist() == [9.0, 9.0]
