"""A model that can be followed by hand, experiments that it made, and a short campaign."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from swashplate import Campaign, Channel, Drive, Experiment, maneuvers
from swashplate.campaign import rig
from swashplate.campaign.experiment import InputSignal, Source

TIME = np.linspace(0.0, 4.0, 81)
SOURCE = Source(Path("log.csv"), "y")


class Rise:
    """y = gain · input level · (1 - exp(-t/lag))."""

    def simulate(
        self, values: Mapping[str, float], experiment: Experiment
    ) -> Mapping[str, np.ndarray]:
        level = experiment.input.values[-1]
        time = experiment["y"].time
        return {"y": values["gain"] * level * (1.0 - np.exp(-time / values["lag"]))}


@pytest.fixture
def rise() -> Rise:
    return Rise()


@pytest.fixture
def experiment() -> Callable[..., Experiment]:
    """An experiment at an input level, with given samples of y."""

    def make(name: str, level: float, y: np.ndarray, weight: float = 1.0) -> Experiment:
        drive = InputSignal("other", "1", TIME, np.full(TIME.size, level), "previous", SOURCE)
        channel = Channel("y", "other", "1", TIME, y, np.full(TIME.size, weight), SOURCE)
        return Experiment(name, "bench", name, "fit", "rest", None, drive, {"y": channel})

    return make


@pytest.fixture
def measured() -> Callable[[float, float, float], np.ndarray]:
    """y for a level, gain and lag."""
    return lambda level, gain, lag: gain * level * (1.0 - np.exp(-TIME / lag))


@pytest.fixture(scope="session")
def short_campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """Three short steps up and one down, for a fit of `TWO_STAGES`."""
    levels = (3.0, 4.0, 5.0, -4.0)
    commands = [maneuvers.step(level, start=0.5, stop=2.5, length=4.0) for level in levels]
    truth = Drive.preset("hoist").replace(J=(0.26, 0.31), Z10=13.0)
    tests = rig.run("hoist", commands, seed=2, truth=truth, severity="clean")
    path = rig.write(tests, tmp_path_factory.mktemp("rig") / "tests")
    text = path.read_text("utf-8").replace('role = "validate"', 'role = "fit"')
    path.write_text(text, "utf-8")
    return Campaign.from_toml(path)
