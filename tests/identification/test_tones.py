"""Tones in residuals: found where no unknown depends on them, and not counted as slow noise."""

import numpy as np
import pytest

from swashplate.identification.linearised import LinearisedFit, LinearisedRun
from swashplate.identification.spectral_lines import separated
from swashplate.identification.uncertainty import uncertainty
from swashplate.identification.unknowns import Unknowns

RUNS, N, RATE = 4, 4096, 512.0
TIME = np.arange(N) / RATE
LEVEL = np.clip((TIME - 1.0) / 0.2, 0.0, 1.0) - np.clip((TIME - 6.0) / 0.2, 0.0, 1.0)
DESIGN = np.column_stack([LEVEL, np.ones(N), np.sin(2.0 * np.pi * 0.3 * TIME)])


def fitted(noise: np.ndarray, weight: np.ndarray | None = None) -> tuple[LinearisedFit, np.ndarray]:
    """Regression of noise on the design, the truth being 0."""
    w = np.ones(N) if weight is None else weight
    rows = w[:, None] * DESIGN
    total = RUNS * rows.T @ rows
    estimate = -np.linalg.solve(total, sum(rows.T @ (w * each) for each in noise))
    runs = [
        LinearisedRun(f"run {k}", "current", TIME, w * (e + DESIGN @ estimate), rows, weight)
        for k, e in enumerate(noise)
    ]
    return LinearisedFit.of(runs, Unknowns.of("abc", np.ones(3))), estimate


def ripple(rng: np.random.Generator) -> np.ndarray:
    """A 100 Hz ripple that goes with the level, far above white noise."""
    phase = rng.uniform(0.0, 2.0 * np.pi, (RUNS, 1))
    return 8.0 * LEVEL * np.sin(2.0 * np.pi * 100.03 * TIME + phase)


def test_a_ripple_is_found_and_taken_out() -> None:
    rng = np.random.default_rng(1)
    noise = rng.normal(size=(RUNS, N))
    fit, _ = fitted(noise + ripple(rng))
    clean = separated(fit)
    tone = max(clean.tones, key=lambda each: each.share)
    assert tone.channel == "current"
    assert tone.low < 100.0 < tone.high
    assert tone.frequency == pytest.approx(100.0, abs=2.0)
    # the ripple has 8²/2 where the level is 1, about 5 of 8 s
    power = 32.0 * np.mean(LEVEL**2)
    assert tone.share == pytest.approx(power / (power + 1.0), rel=0.05)
    left = np.concatenate([run.residual for run in clean.fit.runs])
    assert np.var(left) == pytest.approx(1.0, abs=0.15)


def test_shares_are_of_all_runs_of_a_channel() -> None:
    """Two of four runs sampled half as often: their tones are a part of all, not of themselves."""
    rng = np.random.default_rng(8)
    fit, _ = fitted(rng.normal(size=(RUNS, N)) + ripple(rng))
    runs = [
        run._replace(time=run.time[::2], residual=run.residual[::2], jacobian=run.jacobian[::2])
        if k < 2
        else run
        for k, run in enumerate(fit.runs)
    ]
    tones = separated(LinearisedFit.of(runs, Unknowns.of("abc", np.ones(3)))).tones
    # a third of the samples, two thirds: each with the same part of ripple
    power = 32.0 * np.mean(LEVEL**2)
    assert sum(each.share for each in tones) == pytest.approx(power / (power + 1.0), rel=0.05)


def test_errors_are_those_of_the_noise_under_a_ripple() -> None:
    """Estimates scatter by the noise alone, as the ripple averages out; errors say so."""
    rng = np.random.default_rng(2)
    estimates, errors, white = [], [], []
    for _ in range(60):
        fit, estimate = fitted(rng.normal(size=(RUNS, N)) + ripple(rng))
        found = uncertainty(fit)
        estimates.append(estimate)
        errors.append(found.quoted.standard_errors)
        white.append(found.white.standard_errors)
    scatter = np.sqrt(np.mean(np.square(estimates), axis=0))
    # 60 draws tell a standard deviation to 9 %
    np.testing.assert_allclose(np.mean(errors, axis=0), scatter, rtol=0.3)
    assert (np.mean(white, axis=0) > 3.0 * scatter).all()


def test_weights_are_taken_off_before_tones_are_sought() -> None:
    rng = np.random.default_rng(3)
    weight = np.where(TIME < 2.0, 3.0, 1.0)
    fit, _ = fitted(rng.normal(size=(RUNS, N)) + ripple(rng), weight)
    clean = separated(fit)
    left = np.concatenate([run.residual / run.weight for run in clean.fit.runs])
    assert np.var(left) == pytest.approx(1.0, abs=0.15)


def test_a_model_error_at_the_tests_frequency_is_no_tone() -> None:
    rng = np.random.default_rng(4)
    noise = rng.normal(size=(RUNS, N)) + 3.0 * np.cos(2.0 * np.pi * 0.3 * TIME)
    fit, _ = fitted(noise)
    assert separated(fit).tones == ()
    assert separated(fit).fit is fit


def test_white_noise_and_short_runs_have_no_tones() -> None:
    fit, _ = fitted(np.random.default_rng(5).normal(size=(RUNS, N)))
    assert separated(fit).tones == ()
    short = LinearisedRun("short", "current", TIME[:100], np.ones(100), DESIGN[:100])
    assert separated(LinearisedFit.of([short], Unknowns.of("abc", np.ones(3)))).tones == ()


def test_the_tone_is_named() -> None:
    rng = np.random.default_rng(6)
    fit, _ = fitted(rng.normal(size=(RUNS, N)) + ripple(rng))
    assert any("A tone at" in each and "Hz" in each for each in uncertainty(fit).sentences())
