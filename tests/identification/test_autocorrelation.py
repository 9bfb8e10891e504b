"""Correlation of residuals over time, across gaps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter
from tests.identification.linear import linear_fit, unknowns_of

from swashplate.identification.noise import (
    NoiseColour,
    grid_of,
    noise_colours,
    pair_sums,
)
from swashplate.identification.problem import LinearisedRun


def first_order(n: int, rho: float, seed: int) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(size=n + 1000)
    return lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], noise)[1000:]


def colour(*residuals: np.ndarray, time: np.ndarray | None = None) -> NoiseColour:
    runs = [
        LinearisedRun(
            f"run {k}",
            "speed",
            np.arange(each.size) / 512.0 if time is None else time,
            each,
            np.ones((each.size, 1)),
        )
        for k, each in enumerate(residuals)
    ]
    return noise_colours(linear_fit(runs, unknowns_of(["p"], [1.0])))[0]


def test_a_day_without_samples_costs_no_memory() -> None:
    grid = grid_of(np.concatenate([np.arange(100) / 512.0, 86400.0 + np.arange(100) / 512.0]))
    assert grid.size < 5000


def test_jitter_loses_no_sample() -> None:
    time = np.arange(50) * 0.01 + np.random.default_rng(0).uniform(-0.004, 0.004, 50)
    assert np.all(np.diff(grid_of(time).places) >= 1)


@given(
    st.lists(st.tuples(st.integers(1, 4), st.floats(-5, 5)), min_size=1, max_size=30),
    st.integers(0, 12),
)
def test_pair_sums_are_those_of_a_double_loop(steps: list, lags: int) -> None:
    places = np.cumsum([step for step, _ in steps])
    samples = np.array([value for _, value in steps])
    if places.size > 1 and np.median(np.diff(places)) != 1.0:
        places = np.arange(places.size)  # the grid's step is the median distance
    sums, counts = pair_sums(samples, grid_of(places.astype(float)), lags)
    for lag in range(lags + 1):
        pairs = [
            samples[i] * samples[k]
            for i in range(places.size)
            for k in range(i, places.size)
            if places[k] - places[i] == lag
        ]
        assert counts[lag] == len(pairs)
        assert sums[lag] == pytest.approx(sum(pairs), abs=1e-10)


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9, 0.98])
def test_inflation_by_first_order_noise(rho: float) -> None:
    n = 100_000
    found = colour(*[first_order(n, rho, seed) for seed in range(2)])
    assert found.inflation == pytest.approx((1.0 + rho) / (1.0 - rho), rel=0.1)


def test_a_gap_does_not_change_the_colour() -> None:
    noise = first_order(100_000, 0.9, 3)
    kept = np.ones(noise.size, bool)
    kept[20_000:50_000] = False
    kept[::7] = False
    found = colour(noise[kept], time=(np.arange(noise.size) / 512.0)[kept])
    assert found.inflation == pytest.approx(19.0, rel=0.15)


def test_slow_noise_under_white_noise_is_seen() -> None:
    """A first-order plug-in from lag one would see ρ = 0.1 and an inflation of 1.2."""
    white = np.random.default_rng(5).normal(size=100_000)
    mixed = np.sqrt(0.9) * white + np.sqrt(0.1) * first_order(white.size, 0.99, 6)
    assert colour(mixed).inflation == pytest.approx(0.9 + 0.1 * 199.0, rel=0.25)


def test_a_drift_is_called_so() -> None:
    assert colour(np.linspace(-1.0, 1.0, 2000)).drifting
    assert not colour(first_order(4000, 0.5, 1)).drifting


def test_one_sample_and_no_residual_are_worth_what_they_are() -> None:
    assert colour(np.array([0.3])).inflation == 1.0
    assert colour(np.zeros(100)).inflation == 1.0


def test_channels_and_steps_have_their_own_colours() -> None:
    jacobian, residual = np.ones((100, 1)), first_order(100, 0.5, 1)
    runs = [
        LinearisedRun("a", "speed", np.arange(100) / 512.0, residual, jacobian),
        LinearisedRun("a", "current", np.arange(100) / 512.0, residual, jacobian),
        LinearisedRun("b", "speed", np.arange(100) / 100.0, residual, jacobian),
        LinearisedRun("c", "speed", np.arange(100) / 512.0, residual, jacobian),
    ]
    found = noise_colours(linear_fit(runs, unknowns_of(["p"], [1.0])))
    assert [(each.channel, each.members) for each in found] == [
        ("speed", (0, 3)),
        ("current", (1,)),
        ("speed", (2,)),
    ]


def test_weights_do_not_colour_the_noise() -> None:
    noise = first_order(4000, 0.8, 2)
    weight = np.where(np.arange(4000) < 400, 10.0, 1.0)
    run = LinearisedRun("a", "v", np.arange(4000.0), weight * noise, np.ones((4000, 1)), weight)
    found = noise_colours(linear_fit([run], unknowns_of(["p"], [1.0])))[0]
    np.testing.assert_allclose(found.correlation, colour(noise).correlation, rtol=1e-12)
