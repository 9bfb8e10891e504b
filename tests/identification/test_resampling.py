"""Noise that might have been as well."""

import numpy as np
import pytest
from scipy.signal import lfilter

from swashplate.errors import InputError
from swashplate.identification.bootstrap import Resampling, politis_white_length
from swashplate.identification.linearised import LinearisedFit, LinearisedRun
from swashplate.identification.noise import NoiseColour
from swashplate.identification.unknowns import Unknowns

N = 4000
TIME = np.arange(N) / 512.0


def noise(rho: float, seed: int, runs: int = 3) -> np.ndarray:
    white = np.random.default_rng(seed).normal(size=(runs, N + 400))
    return lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], white)[:, 400:]


def fit(residuals: np.ndarray, **more: object) -> LinearisedFit:
    runs = [
        LinearisedRun(f"run {k}", "speed", TIME, each, np.ones((N, 1)))._replace(**more)
        for k, each in enumerate(residuals)
    ]
    return LinearisedFit.of(runs, Unknowns.of(["p"], [1.0]))


def test_a_draw_is_the_same_whenever_it_is_drawn() -> None:
    made = fit(noise(0.9, 1))
    first = Resampling(made, seed=7)
    later = Resampling(made, seed=7)
    later.differences(0), later.differences(3)
    for a, b in zip(first.differences(3), later.differences(3), strict=True):
        np.testing.assert_array_equal(a, b)
    assert not np.array_equal(first.differences(3)[0], first.differences(4)[0])
    assert not np.array_equal(first.differences(3)[0], first.differences(3)[1])
    assert not np.array_equal(first.differences(3)[0], Resampling(made, seed=8).differences(3)[0])


@pytest.mark.parametrize("rho", [0.0, 0.9, 0.98])
def test_draws_have_the_colour_and_size_of_the_noise(rho: float) -> None:
    resampling = Resampling(fit(noise(rho, 2, runs=8)), seed=1)
    draws = np.concatenate([each for k in range(10) for each in resampling.differences(k)])
    assert draws.std() == pytest.approx(1.0, rel=0.1)
    assert np.mean(draws[1:] * draws[:-1]) / np.mean(draws**2) == pytest.approx(rho, abs=0.01)


def test_innovations_keep_their_shape() -> None:
    """Noise of two values stays so: nothing normal is put in its place."""
    coin = np.where(np.random.default_rng(3).random((2, N)) < 0.5, -1.0, 1.0)
    drawn = np.abs(Resampling(fit(coin), block=1 / 512).differences(0)[0])
    assert drawn.std() < 0.05
    assert drawn.mean() == pytest.approx(1.0, abs=0.05)


def test_weights_are_put_back_where_noise_lands() -> None:
    weight = np.where(TIME < 1.0, 10.0, 1.0)
    residuals = noise(0.5, 4) * weight
    made = fit(residuals, weight=weight)
    resampling = Resampling(made)
    for difference, residual in zip(
        resampling.differences(0), resampling.residuals(0), strict=True
    ):
        np.testing.assert_allclose(residual, weight * difference)
    assert np.std(resampling.differences(0)[0]) == pytest.approx(1.0, rel=0.15)


def test_gaps_stay_gaps() -> None:
    kept = np.ones(N, bool)
    kept[1000:2000] = False
    runs = [
        LinearisedRun("a", "speed", TIME[kept], each[kept], np.ones((kept.sum(), 1)))
        for each in noise(0.95, 5)
    ]
    drawn = Resampling(LinearisedFit.of(runs, Unknowns.of(["p"], [1.0]))).differences(0)[0]
    assert drawn.size == 3000
    # neighbours over the gap are a second apart: hardly related, unlike others
    jumps = np.abs(np.diff(drawn))
    assert np.median(jumps) < 0.5


def test_politis_and_white_by_hand() -> None:
    # γ = 1, 1/2: g = 2, Σ|k| γ = 1, (1.5 · (1/2)² · 1000)^(1/3) = 375^(1/3)
    colour = NoiseColour("speed", (0,), 1.0, np.array([1.0, 0.5]), 1, 10)
    assert politis_white_length(colour, 1000) == pytest.approx(7.2112, abs=1e-4)


def test_a_given_block_is_taken() -> None:
    assert Resampling(fit(noise(0.5, 6)), block=0.25).blocks == pytest.approx((0.25,) * 3)


def test_a_run_too_short_for_its_own_borrows_innovations() -> None:
    long = LinearisedRun("long", "speed", TIME, noise(0.9, 7)[0], np.ones((N, 1)))
    short = LinearisedRun("short", "speed", TIME[:5], np.ones(5), np.ones((5, 1)))
    made = LinearisedFit.of([long, short], Unknowns.of(["p"], [1.0]))
    drawn = [Resampling(made).differences(k)[1] for k in range(3)]
    assert np.isfinite(drawn).all()
    assert not np.array_equal(drawn[0], drawn[1])


def test_no_residual_draws_nothing() -> None:
    assert not np.concatenate(Resampling(fit(np.zeros((2, N)))).differences(0)).any()


@pytest.mark.parametrize("block", [0.0, -1.0, np.nan])
def test_a_block_has_a_length(block: float) -> None:
    with pytest.raises(InputError, match="give a positive length"):
        Resampling(fit(noise(0.5, 1)), block=block)
