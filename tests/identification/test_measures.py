"""RMSE, NRMSE, fit per cent and R² as campaign.md item 8 defines them."""

import numpy as np
import pytest

from swashplate.errors import InputError
from swashplate.identification.assessment import measures, pooled_measures

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
