import numpy as np
import pytest
from swashplate.report.sensitivity_view import plot_sobol, plot_tornado

from swashplate import InputError, maneuvers
from swashplate.analysis.outcomes import trial
from swashplate.analysis.sensitivity import one_at_a_time, ranges_of, sobol

LEVERS = ("orifice", "pump", "relief")
OUTCOMES = ("final_speed", "rise_time", "overshoot")


@pytest.fixture(scope="module")
def task(hoist):
    return trial(hoist, maneuvers.step(9.0, stop=4.0, length=5.0).sample())


def test_the_strongest_lever_is_at_the_top(hoist, task):
    figure = plot_tornado(one_at_a_time(hoist, ranges_of(LEVERS), task, outcomes=OUTCOMES))
    speed, rise, still = figure.axes
    assert speed.get_yticklabels()[-1].get_text() == "pump"
    assert rise.get_yticklabels()[-1].get_text() == "orifice"
    assert speed.get_title("left") == "final speed, 196.00 deg/s"
    ends = sorted(bar.get_x() + bar.get_width() for bar in speed.patches)
    assert ends[0] == pytest.approx(176.4, abs=0.05)
    assert ends[-1] == pytest.approx(215.6, abs=0.05)
    low, high = still.get_xlim()
    assert low < 0.0 < high
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["factor 0.9", "factor 1.1"]


def test_indices_as_bars(hoist, task):
    result = sobol(hoist, ranges_of(LEVERS), task, outcomes=OUTCOMES, samples=32)
    figure = plot_sobol(result)
    assert len(figure.axes) == 2  # nothing moves the overshoot
    speed = figure.axes[0]
    assert speed.get_yticklabels()[-1].get_text() == "pump"
    widths = np.sort([bar.get_width() for bar in speed.patches])
    np.testing.assert_allclose(widths[-2:], np.sort([result.first[1, 0], result.total[1, 0]]))
    assert figure.texts[0].get_text() == "Shares of the variance, 160 runs"


def test_nothing_to_draw(hoist):
    at_once = trial(hoist, maneuvers.step(9.0, start=0.1, stop=1.0, length=2.0).sample())
    ranges = ranges_of(["pump"])
    with pytest.raises(InputError, match="None of the outcomes is defined"):
        plot_tornado(one_at_a_time(hoist, ranges, at_once, outcomes=["creep"]))
    with pytest.raises(InputError, match="No outcome has Sobol indices"):
        plot_sobol(sobol(hoist, ranges, at_once, outcomes=["creep"], samples=16))
