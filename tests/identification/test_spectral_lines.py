"""Spectral lines in residuals: found by their frequency, removed, and no more than there are."""

import numpy as np
import pytest
from tests.identification.linear import linear_fit, unknowns_of

from swashplate.identification.intervals import uncertainty
from swashplate.identification.noise import SpectralLine, line_sentences, without_lines
from swashplate.identification.problem import LinearisedFit, LinearisedRun

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
    return linear_fit(runs, unknowns_of("abc", np.ones(3))), estimate


def ripple(rng: np.random.Generator, level: np.ndarray | float = 1.0) -> np.ndarray:
    """A 100 Hz ripple far above white noise, of another phase in each run."""
    phase = rng.uniform(0.0, 2.0 * np.pi, (RUNS, 1))
    return 8.0 * level * np.sin(2.0 * np.pi * 100.03 * TIME + phase)


def test_a_ripple_is_found_and_removed() -> None:
    rng = np.random.default_rng(1)
    fit, _ = fitted(rng.normal(size=(RUNS, N)) + ripple(rng))
    clean, (line, *others) = without_lines(fit)
    assert line.channel == "current"
    assert line.frequency == pytest.approx(100.03, abs=0.05)
    assert not others
    assert line.share == pytest.approx(32.0 / 33.0, rel=0.01)
    left = np.concatenate([run.residual for run in clean.runs])
    assert np.var(left) == pytest.approx(1.0, abs=0.15)


def test_shares_never_exceed_what_there_is() -> None:
    rng = np.random.default_rng(2)
    slow = 20.0 * np.sin(2.0 * np.pi * 0.2 * TIME)
    fit, _ = fitted(rng.normal(size=(RUNS, N)) + ripple(rng, LEVEL) + slow)
    _, lines = without_lines(fit)
    assert lines
    assert 0.0 < sum(each.share for each in lines) < 1.0
    assert all(each.share >= 0.0 for each in lines)


def test_slow_model_errors_are_no_lines() -> None:
    rng = np.random.default_rng(4)
    # the lowest bins are those of the tests: four half bandwidths of 8 s are 2 Hz
    for frequency in (0.1, 0.3, 1.0, 1.9):
        noise = rng.normal(size=(RUNS, N)) + 3.0 * np.cos(2.0 * np.pi * frequency * TIME)
        fit, _ = fitted(noise)
        clean, lines = without_lines(fit)
        assert lines == ()
        assert clean is fit


def test_white_noise_and_short_runs_have_no_lines() -> None:
    found = [
        without_lines(fitted(np.random.default_rng(seed).normal(size=(RUNS, N)))[0])[1]
        for seed in range(20)
    ]
    # one campaign in a hundred may have one by chance
    assert sum(len(each) for each in found) <= 1
    short = LinearisedRun("short", "current", TIME[:100], np.ones(100), DESIGN[:100])
    assert without_lines(linear_fit([short], unknowns_of("abc", np.ones(3))))[1] == ()


def test_errors_are_those_of_the_noise_under_a_ripple() -> None:
    """Estimates scatter by the noise alone, as the ripple averages out; errors say so."""
    rng = np.random.default_rng(2)
    estimates, errors, white = [], [], []
    for _ in range(60):
        fit, estimate = fitted(rng.normal(size=(RUNS, N)) + ripple(rng, LEVEL))
        found = uncertainty(fit)
        estimates.append(estimate)
        errors.append(found.quoted.standard_errors)
        white.append(found.white.standard_errors)
    scatter = np.sqrt(np.mean(np.square(estimates), axis=0))
    # 60 draws tell a standard deviation to 9 %
    np.testing.assert_allclose(np.mean(errors, axis=0), scatter, rtol=0.3)
    assert (np.mean(white, axis=0) > 3.0 * scatter).all()


def test_weights_are_taken_off_before_lines_are_sought() -> None:
    rng = np.random.default_rng(3)
    weight = np.where(TIME < 2.0, 3.0, 1.0)
    fit, _ = fitted(rng.normal(size=(RUNS, N)) + ripple(rng), weight)
    clean, _ = without_lines(fit)
    left = np.concatenate([run.residual / run.weight for run in clean.runs])
    assert np.var(left) == pytest.approx(1.0, abs=0.15)


def test_lines_are_told_channel_by_channel() -> None:
    rng = np.random.default_rng(6)
    fit, _ = fitted(rng.normal(size=(RUNS, N)) + ripple(rng))
    said = uncertainty(fit).sentences()
    assert said[0] == "A spectral line at 100 Hz makes 97 % of the residuals' variance of current."
    several = [
        SpectralLine("counts", 21.5, 0.089),
        SpectralLine("current", 98.0, 0.9),
        SpectralLine("counts", 255.0, 0.004),
    ]
    assert line_sentences(several)[0] == (
        "2 spectral lines between 21.5 and 255 Hz make 9.3 % of the residuals' variance of counts, "
        "the largest 8.9 % at 21.5 Hz."
    )
    assert line_sentences([]) == ()
