"""Runs predicted from the command alone."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from swashplate import Campaign, Channel, Drive, Experiment, maneuvers
from swashplate.campaign import rig
from swashplate.campaign.experiment import InputSignal, Source
from swashplate.errors import InputError
from swashplate.identification.validation import (
    compared,
    ignored_windows,
    pooled,
    predict,
    with_speeds,
)

FINE = np.arange(0.0, 10.0, 0.01)
LOG = Source(Path("log.csv"), "column")


def measured_step(name: str, maneuver: str, current: np.ndarray) -> Experiment:
    """A command of 4 V from 1 s to 6 s, and a current."""
    voltage = np.where((FINE >= 1.0) & (FINE < 6.0), 4.0, 0.0)
    drive = InputSignal("voltage", "V", FINE, voltage, "previous", LOG)
    channel = Channel("current", "rectified_current", "A", FINE, current, np.ones(FINE.size), LOG)
    return Experiment(
        name, "hoist", name, "validate", "rest", None, drive, {"current": channel}, maneuver
    )


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    tests = rig.run("hoist", [maneuvers.step(4.0)], seed=1, severity="clean")
    return Campaign.from_toml(rig.write(tests, tmp_path_factory.mktemp("rig") / "tests"))


def test_a_prediction_is_the_simulation_of_the_command(campaign: Campaign) -> None:
    drive = Drive.preset("hoist")
    (run,) = campaign
    found = {each.channel: each for each in predict(drive.parameters, [run])}
    simulated = drive.simulate(
        run.input.values, time=run.input.time, interpolation=run.input.interpolation
    )
    both = simulated.fine("current_positive") + simulated.fine("current_negative")
    expected = np.interp(run["current"].time, simulated.time, both)
    assert found["current"].simulated == pytest.approx(expected, abs=2e-3)
    assert found["current"].measures.fit_percent > 95.0


def test_the_zero_of_a_position_is_free(campaign: Campaign) -> None:
    (run,) = campaign
    channel = run["counts"]
    moved = replace(channel, values=channel.values + 100.0)
    parameters = Drive.preset("hoist").parameters
    shifted = replace(run, channels={"counts": moved})
    first, second = (
        {each.channel: each.measures for each in predict(parameters, [each])}
        for each in (run, shifted)
    )
    assert second["counts"].rmse == pytest.approx(first["counts"].rmse, rel=1e-6)


def test_a_speed_stands_beside_its_position(campaign: Campaign) -> None:
    (run,) = campaign
    channel = run["counts"]
    qualities = with_speeds([compared(run, "counts", channel.values + 3.0)])
    assert [each.channel for each in qualities] == ["counts", "speed from counts"]
    assert qualities[0].measures.rmse == pytest.approx(3.0)
    # a constant has no speed
    assert qualities[1].measures.rmse == pytest.approx(0.0, abs=1e-9)
    assert qualities[1].experiment["speed from counts"].unit == "rad/s"


def test_measures_of_several_runs_are_those_of_all_samples() -> None:
    first, second = np.full(FINE.size, 1.0), np.full(FINE.size, 3.0)
    qualities = [
        compared(measured_step("a", "step", first), "current", first + 1.0),
        compared(measured_step("b", "step", second), "current", second - 2.0),
    ]
    found = pooled(qualities)["current"]
    # errors of 1 and 2 in halves; values 1 and 3 about 2
    assert found.rmse == pytest.approx(np.sqrt(2.5))
    assert found.spread == pytest.approx(1.0)


def test_windows_that_do_not_count() -> None:
    run = measured_step("a", "step", np.ones(FINE.size))
    weight = np.where((FINE < 0.495) | (FINE > 9.0), 0.0, 1.0)
    channel = replace(run["current"], weight=weight)
    first, second = ignored_windows(channel)
    assert first == pytest.approx((0.0, 0.49))
    assert second == pytest.approx((9.01, 9.99))
    assert ignored_windows(run["current"]) == ()


def test_a_run_that_no_drive_simulates_is_refused(experiment: Callable[..., Experiment]) -> None:
    run = experiment("bench", 1.0, np.zeros(81))
    with pytest.raises(InputError, match="bench has no channel that a drive has"):
        predict(Drive.preset("hoist").parameters, [run])
