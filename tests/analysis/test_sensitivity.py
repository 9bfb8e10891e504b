import sys

import numpy as np
import pytest

from swashplate import InputError, maneuvers
from swashplate.analysis.outcomes import trial
from swashplate.analysis.sensitivity import one_at_a_time, ranges_of, sobol


@pytest.fixture(scope="module")
def task(hoist):
    return trial(hoist, maneuvers.step(9.0, stop=4.0, length=5.0).sample())


def test_the_speed_limit_goes_with_the_pump_alone(hoist, task):
    result = one_at_a_time(
        hoist, ranges_of(["orifice", "pump"], 0.1), task, outcomes=["final_speed"]
    )
    final = np.radians(196.0)
    assert result.base == pytest.approx([final], rel=1e-4)
    np.testing.assert_allclose(result.low[:, 0], [final, 0.9 * final], rtol=1e-4)
    np.testing.assert_allclose(result.high[:, 0], [final, 1.1 * final], rtol=1e-4)
    np.testing.assert_allclose(result.swings[:, 0], [0.0, 0.2 * final], rtol=1e-4, atol=1e-9)
    assert result.sentences == ()


def test_a_variant_that_cannot_run_is_said(hoist, task):
    """A feedback spring too weak for the solenoid: Z5 F/√Z4 reaches 1."""
    result = one_at_a_time(hoist, {"Z4": (0.01, 1.1)}, task, outcomes=["final_speed"])
    assert np.isnan(result.low[0, 0])
    assert np.isfinite(result.high[0, 0])
    (sentence,) = result.sentences
    assert sentence.startswith("Z4 x 0.01 cannot be simulated: hoist: ")


def test_sobol_of_a_product_in_closed_form(hoist, task):
    """Creep goes with pump times plussing, nearly: of a product of two uniform factors of 1 ± s
    each causes s²/3 of the variance (1 + s²/3)² - 1 by itself."""
    s = 0.5
    ranges = ranges_of(["pump", "plussing", "relief"], s)
    result = sobol(hoist, ranges, task, outcomes=["creep", "overshoot"], samples=256, seed=1)
    part = s**2 / 3.0
    by_itself = part / ((1.0 + part) ** 2 - 1.0)
    assert result.runs == 256 * 5
    # 256 base samples are good to a few hundredths
    np.testing.assert_allclose(result.first[:2, 0], by_itself, atol=0.06)
    np.testing.assert_allclose(result.total[:2, 0], 1.0 - by_itself, atol=0.06)
    np.testing.assert_allclose([result.first[2, 0], result.total[2, 0]], 0.0, atol=1e-6)
    assert result.mean[0] == pytest.approx(np.radians(3.09), rel=0.02)
    assert np.isnan(result.total[:, 1]).all()
    assert result.sentences == ("None of the levers moves overshoot.",)


def test_the_seed_decides_and_threads_do_not(hoist, task):
    ranges = ranges_of(["orifice", "pump"])
    first, again, other = (
        sobol(hoist, ranges, task, outcomes=["rise_time"], samples=16, seed=seed, threads=threads)
        for seed, threads in ((0, 1), (0, 2), (2, 1))
    )
    np.testing.assert_array_equal(first.total, again.total)
    np.testing.assert_array_equal(first.total_error, again.total_error)
    assert (first.total != other.total).any()


def test_undefined_outcomes_have_no_indices(hoist):
    at_once = trial(hoist, maneuvers.step(9.0, start=0.1, stop=1.0, length=2.0).sample())
    result = sobol(hoist, ranges_of(["pump"]), at_once, outcomes=["creep"], samples=16)
    assert np.isnan(result.first).all()
    assert "48 of 48 variants have no creep" in result.sentences[0]


def test_refusals(hoist, task, monkeypatch):
    ranges = ranges_of(["orifice"])
    with pytest.raises(InputError, match="100, but must be a power of 2 from 16"):
        sobol(hoist, ranges, task, outcomes=["creep"], samples=100)
    with pytest.raises(InputError, match="of 48 variants cannot be simulated, the first because"):
        sobol(hoist, {"Z4": (0.01, 1.1)}, task, outcomes=["creep"], samples=16)
    with pytest.raises(InputError, match="span 1.5 of the factors"):
        ranges_of(["orifice"], 1.5)
    with pytest.raises(InputError, match="Name at least one lever"):
        ranges_of([])
    with pytest.raises(InputError, match="must rise from 0 or more, not 2 to 1"):
        one_at_a_time(hoist, {"pump": (2.0, 1.0)}, task, outcomes=["creep"])
    monkeypatch.setitem(sys.modules, "SALib.sample.sobol", None)
    with pytest.raises(InputError, match=r"pip install 'swashplate\[sensitivity\]'"):
        sobol(hoist, ranges, task, outcomes=["creep"], samples=16)
