"""Many sets at once: what is refused, and what a bad set does to its neighbours."""

import re

import numpy as np
import pytest
from numba import config, njit

from swashplate import Drive, InputError, ParameterError, SquaredError
from swashplate.equations.marching.lanes import lanes_of
from swashplate.models.displacement_control import PumpOptions
from swashplate.models.drive import pump_drive


@pytest.mark.traced
def test_bad_sets_do_not_stop_the_others(hoist: Drive) -> None:
    voltage = np.full(300, 5.0)
    changes = {"Z16_plus": [1.2e-4, -1.0, 1.3e-4], "Z19_plus": [12.0, 12.0, 1200.0]}
    batch = hoist.simulate_many(changes, voltage=voltage, cost=SquaredError(np.zeros(300)))
    assert np.isfinite(batch.cost[0])
    assert list(np.isinf(batch.cost)) == [False, True, True]
    assert "Z16_plus" in batch.failures[1]
    assert "above 0" in batch.failures[1]
    assert "Z5·F/√Z4" in batch.failures[2]
    outputs = hoist.simulate_many(changes, voltage=voltage).output
    assert np.isfinite(outputs[0]).all()
    assert np.isnan(outputs[1:]).all()


def test_a_current_beyond_the_domain_fails_only_its_set(hoist: Drive) -> None:
    batch = hoist.simulate_many({"Z4": [0.0536, 0.02]}, current=np.full(50, 1.8))
    assert list(batch.failures) == [1]
    assert "overpowers" in batch.failures[1]
    assert np.isfinite(batch.output[0]).all()


@pytest.mark.parametrize(
    ("zeta", "omega"), [(0.3, 409.6), (0.3, 307.0), (0.9, 950.0), (2.0, 275.0)]
)
def test_a_batch_refuses_the_filters_that_simulate_refuses(hoist: Drive, zeta, omega) -> None:
    changes = {"zeta": [zeta, 1.0], "omega": [omega, 56.0]}
    batch = hoist.simulate_many(changes, voltage=np.ones(50))
    try:
        hoist.replace(zeta=zeta, omega=omega).simulate(np.ones(50))
    except InputError:
        assert list(batch.failures) == [0]
        assert "unstable" in batch.failures[0]
        assert np.isnan(batch.output[0]).all()
    else:
        assert not batch.failures


def test_overflow_fails_only_its_set(hoist: Drive) -> None:
    for record in ({"voltage": np.full(600, 5.0)}, {"current": np.full(600, 0.5)}):
        for cost in (None, SquaredError(np.zeros(600))):
            batch = hoist.simulate_many({"Z7": [0.0, 1e150, 1e-3]}, cost=cost, **record)
            assert list(batch.failures) == [1]
            assert "beyond all bounds" in batch.failures[1]
            results = batch.output if cost is None else batch.cost
            assert np.isfinite(results[[0, 2]]).all()
            assert not np.isfinite(results[1]).any()


@pytest.mark.parametrize(
    ("changes", "options", "sentence"),
    [
        ({"Z16": [1e-4], "Z16_plus": [1e-4]}, {"voltage": [0.0]}, "Z16_plus is given twice"),
        ({"Z10": [3.0]}, {}, "either a voltage or a current"),
        ({"Z10": [3.0]}, {"voltage": [0.0], "current": [0.0]}, "either a voltage or a current"),
        ({"Z10": [3.0]}, {"voltage": [0.0], "output": "torque"}, "no signal 'torque'"),
        (
            {"Z10": [3.0]},
            {"voltage": [0.0, 1.0], "cost": SquaredError([0.0, np.nan])},
            "not finite, or the weight negative, at sample 1",
        ),
    ],
)
def test_bad_batches_are_refused(hoist: Drive, changes, options, sentence) -> None:
    with pytest.raises(InputError, match=sentence):
        hoist.simulate_many(changes, **options)


@pytest.mark.traced
def test_samples_without_weight_may_be_missing(hoist: Drive) -> None:
    cost = SquaredError([0.0, np.nan, 1.0], [1.0, 0.0, 1.0])
    batch = hoist.simulate_many({"Z10": [12.396]}, voltage=[0.0, 0.0, 0.0], cost=cost)
    speed = hoist.simulate([0.0, 0.0, 0.0]).shaft_speed
    assert batch.cost[0] == pytest.approx(speed[0] ** 2 + (speed[2] - 1.0) ** 2, rel=1e-14)


def test_unknown_parameter(hoist: Drive) -> None:
    with pytest.raises(ParameterError, match="did you mean Z16"):
        hoist.simulate_many({"Z_16": [1.0]}, voltage=[0.0])


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="nothing is compiled")
def test_the_sets_are_marched_as_vectors() -> None:
    lanes = lanes_of(pump_drive, ("current",), (None, PumpOptions()), "shaft_speed")
    march = njit(error_model="numpy")(lanes.march.py_func)  # not from the cache, which has no text
    row, table = "float64[::1]", "float64[:, ::1]"
    march.compile(f"(UniTuple({row}, 1), int64[:, ::1], float64, {row}, {row}, {row}, {table})")
    (text,) = march.inspect_llvm().values()
    assert re.search(r"<\d+ x double> @llvm\.sqrt", text)
    assert not re.search(r"gather|call double @llvm\.sqrt", text)
