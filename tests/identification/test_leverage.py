"""What a fit takes from its residuals."""

import numpy as np
import pytest

from swashplate.identification.autocorrelation import grid_of
from swashplate.identification.leverage import (
    corrected_residuals,
    independent_stretches,
    stretches,
)
from swashplate.identification.linearised import LinearisedFit, LinearisedRun
from swashplate.identification.variables import Variables

RNG = np.random.default_rng(2)


def power(matrix: np.ndarray, exponent: float) -> np.ndarray:
    sizes, axes = np.linalg.eigh(matrix)
    return (axes * sizes**exponent) @ axes.T


def fit(*runs: tuple[np.ndarray, np.ndarray]) -> LinearisedFit:
    made = [
        LinearisedRun(f"run {k}", "speed", np.arange(float(r.size)), r, J)
        for k, (r, J) in enumerate(runs)
    ]
    count = runs[0][1].shape[1]
    return LinearisedFit.of(made, Variables.of([f"p{k}" for k in range(count)], np.ones(count)))


def test_stretches_are_alike_and_respect_gaps() -> None:
    assert stretches(grid_of(np.arange(20.0)), 5.0).tolist() == [0, 5, 10, 15, 20]
    assert stretches(grid_of(np.arange(20.0)), 100.0).tolist() == [0, 20]
    # samples 0-9 and 30-39: the two middle quarters are empty and fall away
    gap = np.concatenate([np.arange(10.0), np.arange(30.0, 40.0)])
    assert stretches(grid_of(gap), 10.0).tolist() == [0, 10, 20]


def test_the_correction_is_the_dense_formula() -> None:
    r, J = RNG.normal(size=32), RNG.normal(size=(32, 2))
    made = fit((r, J))
    (found,) = corrected_residuals(made, [grid_of(made.runs[0].time)], [8.0])
    inverse = np.linalg.inv(J.T @ J)
    for first in range(0, 32, 8):
        part = J[first : first + 8]
        hat = part @ inverse @ part.T
        expected = power(np.eye(8) - hat, -0.5) @ r[first : first + 8]
        np.testing.assert_allclose(found[first : first + 8], expected, rtol=1e-9)


def test_a_stretch_that_is_fitted_exactly_stays_finite() -> None:
    J = np.zeros((16, 1))
    J[:4] = 1.0
    made = fit((np.zeros(16), J))
    (found,) = corrected_residuals(made, [grid_of(made.runs[0].time)], [4.0])
    assert np.isfinite(found).all()


def test_stretches_that_tell_of_an_unknown_are_counted() -> None:
    J = np.zeros((40, 2))
    J[:, 0] = 1.0
    J[:10, 1] = 1.0
    J[:10, 0] = 0.0
    made = fit((np.zeros(40), J))
    found = independent_stretches(made, [grid_of(made.runs[0].time)], [10.0])
    # the first is seen in three stretches of ten, the second in one
    np.testing.assert_allclose(found, [3.0, 1.0])


def test_scores_of_independent_stretches_are_not_biased() -> None:
    """Noise that is constant in each stretch: Σ of squared scores has the mean it should have."""
    count, length = 12, 16
    J = np.repeat(RNG.normal(size=(count, 3)), length, axis=0)
    draws = 4000
    noise = np.repeat(RNG.normal(size=(draws, count)), length, axis=1)
    residuals = noise - (noise @ J) @ np.linalg.inv(J.T @ J) @ J.T
    raw, corrected = np.zeros((3, 3)), np.zeros((3, 3))
    template = fit((noise[0], J))
    grids = [grid_of(template.runs[0].time)]
    for residual in residuals[:400]:
        made = fit((residual, J))
        (better,) = corrected_residuals(made, grids, [float(length)])
        for each, total in ((residual, raw), (better, corrected)):
            scores = np.add.reduceat(J * each[:, None], np.arange(0, count * length, length))
            total += scores.T @ scores / 400
    # in truth each stretch's score is length · J times a standard normal number
    expected = length * (J.T @ J)
    size = np.trace(np.linalg.solve(expected, corrected)) / 3.0
    assert size == pytest.approx(1.0, abs=0.06)
    assert np.trace(np.linalg.solve(expected, raw)) / 3.0 < 0.85
