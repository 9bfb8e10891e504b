"""Measures as campaign.md item 8 defines them, and what is left in residuals."""

import numpy as np
import pytest
from scipy.signal import lfilter

from swashplate.errors import InputError
from swashplate.identification.validation import measures, pooled_measures, residual_test

MEASURED = np.array([0.0, 2.0, 4.0, 6.0])
SIMULATED = np.array([1.0, 2.0, 4.0, 5.0])


def test_by_hand() -> None:
    found = measures(MEASURED, SIMULATED)
    assert found.rmse == pytest.approx(np.sqrt(0.5))
    assert found.spread == pytest.approx(np.sqrt(5.0))
    assert found.nrmse == pytest.approx(np.sqrt(0.1))
    assert found.fit_percent == pytest.approx(68.377223)
    assert found.r_squared == pytest.approx(0.9)
    assert found.sentence == "RMSE 0.7071, fit 68.4 %, R² 0.9000"


def test_ignored_samples_do_not_count() -> None:
    found = measures(MEASURED, np.array([1.0, 2.0, np.nan, 5.0]), np.array([1.0, 9.0, 0.0, 1.0]))
    assert found.samples == 3
    assert found.rmse == pytest.approx(np.sqrt(2.0 / 3.0))


def test_runs_are_pooled_about_one_mean() -> None:
    found = pooled_measures(
        [(MEASURED[:2], SIMULATED[:2], None), (MEASURED[2:], SIMULATED[2:], np.ones(2))]
    )
    assert found == measures(MEASURED, SIMULATED)


@pytest.mark.parametrize("level", [0.0, 0.1, 1e6 / 3.0])
def test_a_constant_has_no_fit(level: float) -> None:
    found = measures(np.full(7, level), np.full(7, level) + 1.0)
    assert (found.nrmse, found.fit_percent, found.r_squared) == (None, None, None)
    assert found.rmse == pytest.approx(1.0)
    assert "what was measured is constant" in found.sentence


def test_one_sample_is_constant() -> None:
    assert measures(np.array([3.0]), np.array([2.0])).fit_percent is None


def test_the_mean_of_the_measurement_fits_by_zero_per_cent() -> None:
    assert measures(MEASURED, np.full(4, 3.0)).fit_percent == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((MEASURED, SIMULATED[:3]), "4 measured and 3 simulated"),
        ((MEASURED, SIMULATED, np.zeros(4)), "No sample counts"),
        ((MEASURED, np.full(4, np.nan)), "Sample 1 of what was simulated is not finite"),
        ((MEASURED, SIMULATED, np.full(4, -1.0)), "negative or not a number"),
    ],
)
def test_what_cannot_be_measured_is_refused(arguments: tuple, said: str) -> None:
    with pytest.raises(InputError, match=said):
        measures(*arguments)


# --- residuals ------------------------------------------------------------------------------------


N = 4000
TIME = np.arange(N) / 512.0
RNG = np.random.default_rng(7)
WHITE = RNG.normal(size=N)
COMMAND = np.sin(2.0 * np.pi * 0.5 * TIME) + lfilter([0.05], [1, -0.95], RNG.normal(size=N))


def first_order(rho: float, seed: int, n: int = N) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(size=n + 500)
    return lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], noise)[500:]


def test_white_noise_passes() -> None:
    found = residual_test(TIME, WHITE, COMMAND)
    assert found.white
    assert not found.follows
    assert found.verdict.startswith("The residuals are white and do not follow the input")
    assert found.autocorrelation[0] == 1.0
    assert found.white_band == pytest.approx(1.96 / np.sqrt(N))
    assert np.mean(np.abs(found.autocorrelation[1:]) < found.white_band) > 0.9


def test_coloured_noise_is_said_to_be_so() -> None:
    found = residual_test(TIME, first_order(0.95, 1), COMMAND)
    assert not found.white
    assert 0.02 < found.duration < 0.4
    assert "stay correlated over" in found.verdict
    assert not found.follows


def test_a_missed_delay_is_found_where_it_is() -> None:
    late = np.interp(TIME - 0.1, TIME, COMMAND)
    found = residual_test(TIME, 0.5 * late + 0.2 * WHITE, COMMAND)
    assert found.peak[0] == pytest.approx(0.1, abs=0.01)
    assert "follow the input" in found.verdict
    assert "0.1 s after it" in found.verdict


def test_unrelated_slow_signals_are_rarely_called_related() -> None:
    """With the band of white noise nearly every one would be."""
    related = sum(
        residual_test(TIME, first_order(0.98, s), first_order(0.98, 500 + s)).follows
        for s in range(60)
    )
    assert related <= 9  # 5 % of 60 is 3, and its deviation 1.7
    naive = sum(
        np.abs(residual_test(TIME, first_order(0.98, s), first_order(0.98, 500 + s)).peak[1])
        > 1.96 / np.sqrt(N)
        for s in range(10)
    )
    assert naive == 10


def test_lags_across_a_gap_are_true() -> None:
    kept = np.ones(N, bool)
    kept[1000:1500] = False
    late = np.interp(TIME - 0.1, TIME, COMMAND)
    found = residual_test(TIME[kept], (late + 0.1 * WHITE)[kept], COMMAND[kept])
    assert found.peak[0] == pytest.approx(0.1, abs=0.01)


def test_cross_correlation_by_hand() -> None:
    residual = np.array([0.0, 0, 0, 3, 0, 0, 0, -3, 0, 0, 0, 0])
    command = np.array([0.0, 1, 0, 0, 0, -1, 0, 0, 0, 0, 0, 0])
    found = residual_test(np.arange(12.0), residual, command, longest=3.0)
    # the residual is the command two samples later: 6/(√18 √2) = 1
    assert dict(zip(found.cross_lags, found.cross_correlation, strict=True))[2.0] == pytest.approx(
        1.0
    )
    assert found.cross_lags.tolist() == [-3, -2, -1, 0, 1, 2, 3]


@pytest.mark.parametrize(
    ("residual", "command", "said"),
    [
        (np.zeros(N), COMMAND, "exactly zero"),
        (np.full(N, 0.5), COMMAND, "0.5 throughout"),
        (WHITE, np.full(N, 3.0), "the input is constant and explains nothing"),
    ],
)
def test_constants_are_verdicts(residual: np.ndarray, command: np.ndarray, said: str) -> None:
    found = residual_test(TIME, residual, command)
    assert said in found.verdict
    assert np.isfinite(found.autocorrelation).all()
    assert np.isfinite(found.cross_correlation).all()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((TIME[:3], WHITE[:3], COMMAND[:3]), "3 samples show no correlation"),
    ],
)
def test_what_cannot_be_tested_is_refused(arguments: tuple, said: str) -> None:
    with pytest.raises(InputError, match=said):
        residual_test(*arguments)
