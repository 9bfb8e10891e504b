import numpy as np
import pytest
from matplotlib.colors import to_hex

from swashplate import Drive, InputError, Simulation, maneuvers
from swashplate.report.figures import plot_maneuvers_overview

Runs = dict[str, dict[str, Simulation]]


@pytest.fixture(scope="module")
def runs() -> Runs:
    drives = {axis: Drive.preset(axis) for axis in ("hoist", "slew", "luff")}
    return {
        axis: {
            name: drive.simulate(test.sample())
            for name, test in maneuvers.source_tests(axis).items()
        }
        for axis, drive in drives.items()
    }


def curves(ax) -> list:
    return [line for line in ax.lines if len(line.get_xdata()) > 2]


def test_rows_are_axes_and_columns_kinds(runs: Runs) -> None:
    axes = plot_maneuvers_overview(runs).axes[:9]
    assert [ax.get_title() for ax in axes[:3]] == ["ramp", "step", "sine"]
    assert [ax.get_ylabel() for ax in axes[::3]] == ["speed (deg/s)"] * 3
    assert [ax.texts[0].get_text() for ax in axes[::3]] == ["hoist", "slew", "luff"]
    assert [ax.get_xlabel() for ax in axes[6:]] == ["time (s)"] * 3
    # a speed and a command each
    assert [len(curves(ax)) for ax in axes] == [4, 12, 10, 2, 2, 6, 2, 6, 6]


def test_lines_are_speeds_over_commands_to_the_scale_on_the_right(runs: Runs) -> None:
    figure = plot_maneuvers_overview({"slew": {"step": runs["slew"]["step +2 V"]}})
    (ax,) = (ax for ax in figure.axes if ax.get_title() == "step")
    run = runs["slew"]["step +2 V"]
    command, speed = curves(ax)
    np.testing.assert_allclose(speed.get_ydata(), run.shaft_speed * (180.0 / np.pi), rtol=1e-14)
    (volts,) = ax.child_axes
    assert volts.get_ylabel() == "command (V)"
    figure.draw_without_rendering()
    per_volt = ax.get_ylim()[1] / volts.get_ylim()[1]
    np.testing.assert_allclose(command.get_ydata(), per_volt * run.voltage, rtol=1e-12)
    assert volts.get_ylim()[1] > 10.0


def test_equal_commands_have_one_colour_and_the_second_a_thinner_line(runs: Runs) -> None:
    hoist = runs["hoist"]
    names = ("sine 9 V 0.1 Hz", "sine 9 V 0.3 Hz", "sine 4 V 0.1 Hz")
    figure = plot_maneuvers_overview({"hoist": {name: hoist[name] for name in names}})
    slow, fast, small = curves(figure.axes[0])[1::2]
    assert to_hex(slow.get_color()) == to_hex(fast.get_color()) != to_hex(small.get_color())
    assert fast.get_linewidth() < slow.get_linewidth() == small.get_linewidth()


def test_other_kinds_follow_and_missing_ones_leave_a_cell_empty(step: Simulation) -> None:
    figure = plot_maneuvers_overview({"a": {"chirp 3 V": step}, "b": {"step 9 V": step}, "c": {}})
    assert [ax.get_title() for ax in figure.axes[:2]] == ["step", "chirp"]
    assert [len(curves(ax)) for ax in figure.axes[:4]] == [0, 2, 2, 0]


def test_runs_driven_by_current_have_no_command(hoist: Drive) -> None:
    run = hoist.simulate_current(np.full(512, 0.4))
    assert len(curves(plot_maneuvers_overview({"hoist": {"step": run}}).axes[0])) == 1


def test_nothing_to_show_is_refused() -> None:
    with pytest.raises(InputError, match="at least one run"):
        plot_maneuvers_overview({"hoist": {}})


def test_it_is_as_large_as_a_readme_wants_and_legible(runs: Runs, assert_legible) -> None:
    figure = plot_maneuvers_overview(runs, title="Three axes of a crane, simulated")
    assert tuple(figure.bbox.size) == pytest.approx((1400, 900))
    assert_legible(figure)
