"""The figure of a fit at a glance."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from swashplate import Channel, Experiment
from swashplate.campaign import InputSignal, Source
from swashplate.errors import InputError
from swashplate.identification.assessment import Assessment
from swashplate.identification.fitting import StageFit
from swashplate.identification.problem import Problem
from swashplate.identification.setup import Free, Stage
from swashplate.identification.solving import solve
from swashplate.identification.unknowns import Unknown, Unknowns
from swashplate.parameters.files import load_preset
from swashplate.report.figures import plot_fit, save_figure

TIME = np.linspace(0.0, 4.0, 81)
SOURCE = Source(Path("log.csv"), "y")


class Line:
    """y = slope · t + level."""

    def simulate(
        self, values: Mapping[str, float], experiment: Experiment
    ) -> Mapping[str, np.ndarray]:
        return {"y": values["slope"] * experiment["y"].time + values["level"]}


@pytest.fixture(scope="module")
def assessed() -> Assessment:
    y = 2.0 * TIME + 1.0 + 0.1 * np.random.default_rng(7).normal(size=TIME.size)
    drive = InputSignal("voltage", "V", TIME, np.ones(TIME.size), "previous", SOURCE)
    channel = Channel("y", "shaft_speed", "rad/s", TIME, y, np.ones(TIME.size), SOURCE)
    run = Experiment("up", "bench", "up", "fit", "rest", None, drive, {"y": channel})
    unknowns = Unknowns((Unknown("slope", 1.5, 0.0, 4.0), Unknown("level", 0.5, -3.0, 3.0)))
    problem = Problem(Line(), (run,), unknowns, ("y",), {"y": 0.1})
    stage = Stage(name="line", part="chain", free={"J": Free(relative=(0.5, 2.0))})
    return Assessment(StageFit(stage, problem, solve(problem), load_preset("neutral")))


def test_measured_and_simulated_in_degrees(assessed: Assessment, tmp_path: Path) -> None:
    figure = plot_fit(assessed.runs[0], [assessed])
    speed, command, _ = figure.axes
    measured, simulated = speed.lines
    assert speed.get_ylabel() == "speed (deg/s)"
    assert measured.get_ydata()[-1] == pytest.approx(np.degrees(9.0), abs=np.degrees(0.4))
    assert simulated.get_ydata()[-1] == pytest.approx(np.degrees(9.0), abs=np.degrees(0.1))
    assert command.get_ylabel() == "voltage (V)"
    save_figure(figure, tmp_path / "result.png")
    assert (tmp_path / "result.png").stat().st_size > 10_000


def test_intervals_that_miss_the_truth_stand_out(assessed: Assessment) -> None:
    estimates = plot_fit(assessed.runs[0], [assessed], {"slope": 2.0, "level": 3.0}).axes[2]
    bars = [line for line in estimates.lines if len(line.get_xdata()) == 2][:2]
    assert [text.get_text() for text in estimates.get_yticklabels()] == ["slope", "level"]
    low, high = bars[0].get_xdata()
    assert low < 0.0 < high
    # the level is 1, two thirds below a truth of 3
    assert np.mean(bars[1].get_xdata()) == pytest.approx(-66.7, abs=3.0)
    assert bars[0].get_color() != bars[1].get_color()


def test_nothing_to_draw_is_said(assessed: Assessment) -> None:
    with pytest.raises(InputError, match="nothing to draw"):
        plot_fit(assessed.runs[0], [assessed], {})
