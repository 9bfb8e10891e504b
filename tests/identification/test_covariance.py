"""Covariances: by hand, by brute force, and what refuses to be one."""

import numpy as np
import pytest

from swashplate.errors import InputError
from swashplate.identification.autocorrelation import grid_of
from swashplate.identification.covariance import (
    cluster_covariance,
    hac_covariance,
    parzen,
    spectrum,
    white_noise_covariance,
    windowed_products,
)
from swashplate.identification.linearised import LinearisedFit, LinearisedRun
from swashplate.identification.variables import Variables

RNG = np.random.default_rng(3)


def run(name: str, n: int, columns: int = 2, time: np.ndarray | None = None) -> LinearisedRun:
    stamps = np.arange(float(n)) if time is None else time
    return LinearisedRun(name, "speed", stamps, RNG.normal(size=n), RNG.normal(size=(n, columns)))


def fit(*runs: LinearisedRun, **more: object) -> LinearisedFit:
    count = runs[0].jacobian.shape[1]
    return LinearisedFit.of(
        runs, Variables.of([f"p{k}" for k in range(count)], np.ones(count)), **more
    )


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
    assert "too small" in found.label


def test_parzens_window_by_hand() -> None:
    # 1 - 6x² + 6x³ up to 1/2, then 2(1 - x)³
    np.testing.assert_allclose(parzen(4.0), [1.0, 0.71875, 0.25, 0.03125])
    assert parzen(1.0).tolist() == [1.0]
    assert parzen(0.2).tolist() == [1.0]


@pytest.mark.parametrize("size", [9, 10])
def test_a_spectrum_is_the_cosine_sum(size: int) -> None:
    window = np.array([3.0, 2.0, 1.0])
    angle = 2.0 * np.pi * np.arange(size // 2 + 1) / size
    expected = 3.0 + 4.0 * np.cos(angle) + 2.0 * np.cos(2.0 * angle)
    np.testing.assert_allclose(spectrum(window, size), expected, atol=1e-12)


def test_windowed_products_are_a_double_sum_over_true_distances() -> None:
    places = np.array([0, 1, 2, 3, 7, 8, 9, 12, 13, 14])
    columns, window = RNG.normal(size=(10, 3)), parzen(5.0)
    expected = np.zeros((3, 3))
    for i in range(10):
        for k in range(10):
            distance = abs(places[i] - places[k])
            if distance < window.size:
                expected += window[distance] * np.outer(columns[i], columns[k])
    found = windowed_products(columns, grid_of(places.astype(float)), window)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_hac_is_the_dense_sandwich() -> None:
    made = fit(run("a", 32), run("b", 16))
    found = hac_covariance(made, bandwidths={"speed": 8.0})
    inverse = np.linalg.inv(sum(each.jacobian.T @ each.jacobian for each in made.runs))
    middle = np.zeros((2, 2))
    for each in made.runs:
        corrected = np.zeros(each.time.size)
        for first in range(0, each.time.size, 8):
            part = each.jacobian[first : first + 8]
            sizes, axes = np.linalg.eigh(np.eye(8) - part @ inverse @ part.T)
            corrected[first : first + 8] = (
                (axes / np.sqrt(sizes)) @ axes.T @ each.residual[first : first + 8]
            )
        scores = each.jacobian * corrected[:, None]
        distance = np.abs(np.subtract.outer(each.time, each.time)) / 8.0
        window = np.where(
            distance <= 0.5,
            1.0 - 6.0 * distance**2 + 6.0 * distance**3,
            2.0 * np.clip(1.0 - distance, 0.0, None) ** 3,
        )
        middle += scores.T @ window @ scores
    np.testing.assert_allclose(found.matrix, inverse @ middle @ inverse, rtol=1e-10)


def test_errors_by_run_by_hand() -> None:
    # one unknown, J = 1: scores 3 and -1 of two runs of two samples, (JᵀJ) = 4
    ones = np.ones((2, 1))
    made = fit(
        LinearisedRun("a", "y", np.arange(2.0), np.array([1.0, 2.0]), ones),
        LinearisedRun("b", "y", np.arange(2.0), np.array([-1.0, 0.0]), ones),
    )
    found = cluster_covariance(made)
    # 2/(2-1) · (9 + 1)/16
    assert found.matrix[0, 0] == pytest.approx(1.25)
    assert found.degrees_of_freedom.tolist() == [1.0]


def test_channels_of_one_experiment_are_one_cluster() -> None:
    first, second = run("a", 20), run("b", 20)
    made = fit(first, first._replace(channel="current"), second)
    twice = np.concatenate([first.jacobian, first.jacobian])
    joined = LinearisedRun("a", "both", np.arange(40.0), np.tile(first.residual, 2), twice)
    np.testing.assert_allclose(
        cluster_covariance(made).matrix, cluster_covariance(fit(joined, second)).matrix, rtol=1e-10
    )


def test_one_run_is_no_cluster() -> None:
    with pytest.raises(InputError, match="at least two experiments"):
        cluster_covariance(fit(run("a", 20), run("a", 20)))


@pytest.mark.parametrize("covariance", [white_noise_covariance, hac_covariance])
def test_undetermined_and_bounded_unknowns_have_no_number(covariance: object) -> None:
    base = run("a", 60, columns=4)
    base.jacobian[:, 1] = base.jacobian[:, 0]
    variables = Variables.of("abcd", np.ones(4), at_bound=[0, 0, 1, 0])
    found = covariance(LinearisedFit.of([base], variables))  # type: ignore[operator]
    assert np.isinf(found.standard_errors[:2]).all()
    assert found.standard_errors[2] == 0.0
    assert 0.0 < found.standard_errors[3] < 1.0
    assert np.isfinite(found.correlation).all()


@pytest.mark.parametrize("covariance", [white_noise_covariance, hac_covariance])
def test_too_few_samples_tell_no_errors(covariance: object) -> None:
    with pytest.raises(InputError, match="leave nothing to tell the noise from"):
        covariance(fit(run("a", 2)))  # type: ignore[operator]


def test_no_residual_has_no_error() -> None:
    base = run("a", 50)
    made = fit(base._replace(residual=np.zeros(50)))
    assert hac_covariance(made).standard_errors.tolist() == [0.0, 0.0]


def test_a_prior_counts_as_one_observation() -> None:
    base = run("a", 400)
    strong = fit(base, prior=np.array([[1e6, 0.0]]))
    # the first is known from its prior alone: deviation 1e-6
    assert hac_covariance(strong).standard_errors[0] == pytest.approx(1e-6, rel=1e-3)


def test_a_missing_bandwidth_is_named() -> None:
    with pytest.raises(InputError, match="bandwidth of channel speed is missing"):
        hac_covariance(fit(run("a", 20)), bandwidths={"current": 1.0})
