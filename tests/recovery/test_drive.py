"""Known drives are found again from clean virtual tests, staged and joint."""

from pathlib import Path

import numpy as np
import pytest
from tests.identification.given import virtual

from swashplate import Campaign, Drive
from swashplate.identification.fitting import Fit, StageFit, drawn, fit
from swashplate.identification.setup import load_setup

AXES = ("hoist", "slew", "luff")


def measured(axis: str, truth: Drive, path: Path) -> Campaign:
    channels = ("rectified_current", "shaft_speed")
    return virtual(path, axis, severity="clean", truth=truth, channels=channels)


def found(result: Fit) -> dict[str, float]:
    return {
        name: value
        for stage in result.stages
        for name, value in stage.values.items()
        if "(" not in name
    }


def determined(stage: StageFit) -> list[str]:
    names = np.array(stage.linearised.variables.names)
    return list(names[stage.linearised.determined])


@pytest.mark.parametrize("joint", [False, True], ids=["staged", "joint"])
@pytest.mark.parametrize("seed", [0, pytest.param(4, marks=pytest.mark.slow)])
@pytest.mark.parametrize("axis", AXES)
def test_the_truth_is_recovered(axis: str, seed: int, joint: bool, tmp_path: Path) -> None:
    setup = load_setup(axis)
    truth = drawn(Drive.preset(axis), setup, seed)
    campaign = measured(axis, truth, tmp_path)
    plan = setup.joint() if joint else setup
    # at 1e-14 the cost of slew, seed 4, 6e-15 already, creeps on along a stop that is not reached
    result = fit(campaign.drive(axis).parameters, campaign.experiments, plan, tolerance=1e-12)
    expected = dict(truth.parameters.numbers)
    for stage in result.stages:
        forces = stage.problem.model.forces
        if forces is not None:
            expected |= forces.values(truth.parameters)
    told = [name for each in result.stages for name in determined(each)]
    # with seed 4 the slew drive does not reach its stop downwards, and the fit says so
    assert len(told) >= len(found(result)) - (1 if (axis, seed) == ("slew", 4) else 0)
    for name in told:
        assert found(result)[name] == pytest.approx(expected[name], rel=1e-6), name
    assert all(each.solution.converged for each in result.stages)


def test_counts_and_noise_leave_small_errors(tmp_path: Path) -> None:
    setup = load_setup("hoist")
    truth = drawn(Drive.preset("hoist"), setup, seed=5)
    campaign = virtual(tmp_path, "hoist", severity="realistic", truth=truth, seed=2)
    result = fit(campaign.drive("hoist").parameters, campaign.select(role="fit"), setup)
    fitted, true = Drive(result.parameters), truth
    for volts in (-9.0, -6.5, -2.0, 2.0, 4.0, 9.0):
        assert fitted.steady_speed(volts) == pytest.approx(true.steady_speed(volts), rel=2e-3)


@pytest.mark.parametrize("seed", [1, *(pytest.param(n, marks=pytest.mark.slow) for n in (39, 77))])
def test_a_stop_that_the_search_loses_is_found_again(seed: int, tmp_path: Path) -> None:
    """From the published values a descent leaves these machines' stop, and finds none back."""
    axis, setup = "slew", load_setup("slew")
    truth = drawn(Drive.preset(axis), setup, seed)
    campaign = virtual(tmp_path, axis, severity="realistic", truth=truth, seed=seed)
    values = fit(Drive.preset(axis), campaign, setup, threads=1).stages[-1].values
    for name in ("Z13_plus", "Z13_minus"):
        assert values[name] == pytest.approx(truth.parameters.numbers[name], rel=2e-3)
