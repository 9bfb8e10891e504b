"""A model that can be followed by hand: exponential rise, and experiments that it made."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from swashplate import Channel, Experiment
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
