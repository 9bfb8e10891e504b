"""Estimates from resampled noise."""

import numpy as np
import pytest
from scipy.signal import lfilter

from swashplate.errors import InputError
from swashplate.identification.bootstrap import Bootstrap, Resampling, refit_bootstrap
from swashplate.identification.linearised import LinearisedFit, LinearisedRun
from swashplate.identification.noise import spectral_covariance
from swashplate.identification.unknowns import Unknowns

N, RUNS = 2048, 4
TIME = np.arange(N) / 512.0
DESIGN = np.column_stack([1.0 - np.exp(-TIME / 0.3), np.sin(2.0 * TIME), TIME * 0.0])


def fit(rho: float, seed: int, **more: object) -> tuple[LinearisedFit, np.ndarray]:
    white = np.random.default_rng(seed).normal(size=(RUNS, N + 400))
    noise = lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], white)[:, 400:]
    some = DESIGN[:, :2]
    estimate = np.zeros(3)
    estimate[:2] = -np.linalg.solve(RUNS * some.T @ some, some.T @ noise.sum(axis=0))
    runs = [
        LinearisedRun(f"run {k}", "speed", TIME, each + DESIGN @ estimate, DESIGN)
        for k, each in enumerate(noise)
    ]
    variables = Unknowns.of("abc", [2.0, 1.0, 1.0], **more)
    return LinearisedFit.of(runs, variables), estimate


def refitted(resampling: Resampling, draws: int) -> Bootstrap:
    """Bootstrap of the regression, each draw solved anew."""
    made, some = resampling.fit, DESIGN[:, :2]

    def refit(draw: int) -> np.ndarray:
        noise = resampling.differences(draw)
        vector = made.variables.vector.copy()
        vector[:2] -= np.linalg.solve(RUNS * some.T @ some, some.T @ np.sum(noise, axis=0))
        return vector

    return refit_bootstrap(resampling, refit, draws)


def test_it_agrees_with_the_covariance() -> None:
    made, _ = fit(0.95, 1)
    found = refitted(Resampling(made, seed=1), 1000)
    expected = spectral_covariance(made).standard_errors[:2]
    # draws come from an autoregression, the covariance from a smoothed spectrum: each knows the
    # noise at the low frequencies of the derivatives to some 10 %
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance))[:2], expected, rtol=0.2)
    assert found.covariance[2, 2] == 0.0


def test_intervals_cover_the_truth() -> None:
    """25 campaigns of two unknowns: 95 % less three standard deviations is 86 %."""
    inside = []
    for seed in range(25):
        made, estimate = fit(0.95, 100 + seed)
        found = refitted(Resampling(made, seed=seed), 100).intervals()
        truth = made.variables.to_values(made.variables.vector - estimate)
        inside += [
            low <= value <= high
            for (low, high), value in zip([found[0], found[1]], truth[:2], strict=True)
        ]
    assert np.mean(inside) >= 0.86


def test_a_positive_unknown_stays_positive() -> None:
    made, _ = fit(0.98, 4, logarithmic=[True, False, False])
    found = refitted(Resampling(made), 200)
    low, high = found.intervals()[0]
    assert low > 0.0
    assert high / 2.0 == pytest.approx(2.0 / low, rel=0.3)


def test_an_undetermined_unknown_has_no_interval() -> None:
    made, _ = fit(0.9, 5)
    assert refitted(Resampling(made), 100).intervals()[2] is None


def test_refits_that_fail_are_counted() -> None:
    made, _ = fit(0.9, 6)
    vector = made.variables.vector
    found = refit_bootstrap(
        Resampling(made), lambda draw: None if draw % 4 == 0 else vector + draw, 40
    )
    assert found.failed == 10
    assert found.vectors.shape == (30, 3)
    assert any("10 of 40 refits did not end" in each for each in found.sentences())


def test_any_pool_may_map() -> None:
    made, _ = fit(0.9, 7)
    seen: list[int] = []

    def backwards(function, numbers):  # type: ignore[no-untyped-def]
        seen.extend(reversed(numbers))
        return [function(number) for number in numbers]

    found = refit_bootstrap(
        Resampling(made), lambda draw: np.full(3, float(draw)), 5, mapped=backwards
    )
    assert seen == [4, 3, 2, 1, 0]
    assert found.vectors[:, 0].tolist() == [0, 1, 2, 3, 4]


def test_quantiles_by_hand() -> None:
    variables = Unknowns.of(["a"], [1.0])
    found = Bootstrap(variables, np.arange(101.0)[:, None], np.ones(1, bool), 0, (0.1,), 0)
    assert found.intervals(0.9)[0] == pytest.approx((5.0, 95.0))


def test_too_few_draws_are_refused() -> None:
    made, _ = fit(0.9, 8)
    with pytest.raises(InputError, match="1 draws do not make a distribution"):
        refitted(Resampling(made), 1)
    with pytest.raises(InputError, match="10 draws do not reach the ends"):
        refitted(Resampling(made), 10).intervals()
    with pytest.raises(InputError, match="0 of 5 refits ended"):
        refit_bootstrap(Resampling(made), lambda draw: None, 5)
    with pytest.raises(InputError, match="between 0 and 1"):
        refitted(Resampling(made), 10).intervals(95.0)
