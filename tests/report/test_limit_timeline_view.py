"""Figure of which limit acts when."""

import numpy as np
import pytest
from swashplate.report.limit_timeline_view import plot_limit_timeline

from swashplate import Drive, InputError, Simulation


def test_rows_are_the_limits_that_act(step: Simulation) -> None:
    figure = plot_limit_timeline(step)
    command, speed, rows = figure.axes
    labels = [text.get_text() for text in rows.get_yticklabels()]
    assert labels == [
        "solenoid dead zone",
        "current rate",
        "orifice (acceleration)",
        "swash stop (speed)",
    ]
    bars = rows.collections[3].get_paths()
    (stop,) = (path.get_extents() for path in bars)
    assert stop.x0 == pytest.approx(2.5, abs=0.1)
    assert stop.x1 == pytest.approx(6.05, abs=0.1)
    assert [text.get_text() for text in rows.texts][3] == "35.4 %"
    assert command.get_ylabel() == "voltage\n(V)"
    np.testing.assert_allclose(speed.lines[0].get_ydata(), np.degrees(step.shaft_speed))


def test_legible(step: Simulation, all_limits: Simulation, assert_legible) -> None:
    assert_legible(plot_limit_timeline(step, wanted=1.1 * step.shaft_speed))
    assert_legible(plot_limit_timeline(all_limits))
    quiet = Drive.preset("neutral").simulate(np.full(64, 2.0), start="steady")
    assert_legible(plot_limit_timeline(quiet))


def test_by_current_and_with_a_title(hoist: Drive) -> None:
    run = hoist.simulate_current(np.full(64, 0.5))
    figure = plot_limit_timeline(run, title="mine")
    assert figure.axes[0].get_ylabel() == "current\n(A)"
    assert figure.texts[0].get_text() == "mine"


def test_a_wanted_speed_of_another_length(step: Simulation) -> None:
    with pytest.raises(InputError, match="has shape"):
        plot_limit_timeline(step, wanted=[1.0, 2.0])
