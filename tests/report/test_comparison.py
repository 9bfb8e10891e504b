import numpy as np
import pytest

from swashplate import Drive, InputError, maneuvers
from swashplate.report.figures import plot_comparison
from swashplate.report.style import BLUE, GREEN, INK, VERMILION


def test_speeds_and_their_differences(hoist: Drive) -> None:
    command = maneuvers.step(6.5).sample()
    first, second = hoist.simulate(command), hoist.scale(Z16=1.5).simulate(command)
    figure = plot_comparison({"fitted": first, "quicker": second}, title="Two orifices")
    voltage, speed, difference = figure.axes
    assert voltage.get_ylabel() == "voltage (V)"
    assert speed.get_ylabel() == "shaft speed (deg/s)"
    assert difference.get_ylabel() == "difference (deg/s)"
    assert difference.get_xlabel() == "time (s)"
    np.testing.assert_array_equal(voltage.lines[-1].get_ydata(), command)
    degree = 180.0 / np.pi
    for line, run in zip(speed.lines[-2:], (first, second), strict=True):
        np.testing.assert_allclose(line.get_ydata(), degree * run.shaft_speed, rtol=1e-14)
    expected = degree * (second.shaft_speed - first.shaft_speed)
    np.testing.assert_allclose(difference.lines[-1].get_ydata(), expected, rtol=0.0, atol=1e-12)
    assert [line.get_color() for line in speed.lines[-2:]] == [BLUE, VERMILION]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["fitted", "quicker"]
    assert [text.get_text() for text in difference.texts] == ["speed less that of fitted"]


def test_a_shared_command_is_drawn_once_and_another_one_in_its_colour(hoist: Drive) -> None:
    same, other = maneuvers.step(6.5).sample(), maneuvers.step(4.0).sample()
    runs = {name: hoist.simulate(v) for name, v in {"a": same, "b": same, "c": other}.items()}
    command = plot_comparison(runs).axes[0]
    assert [line.get_color() for line in command.lines[1:]] == [INK, GREEN]


def test_records_of_other_rates_and_lengths_are_compared_where_both_are(hoist: Drive) -> None:
    long = hoist.simulate(np.full(5121, 4.0))
    short = hoist.simulate(np.full(201, 4.0), rate=100.0)
    difference = plot_comparison({"long": long, "short": short}).axes[2].lines[-1]
    assert difference.get_xdata()[-1] == 2.0
    assert np.abs(difference.get_ydata()).max() < 2.0


def test_a_record_apart_in_time_has_no_difference(hoist: Drive) -> None:
    late = hoist.simulate(
        [0.0, 1.0], time=[100.0, 101.0], interpolation="linear"
    )  # samples from 100 to 101 s
    figure = plot_comparison({"early": hoist.simulate(np.zeros(512)), "late": late})
    assert len(figure.axes[2].lines) == 1
    assert figure.axes[2].get_xlim() == (0.0, 101.0)


def test_current_is_the_command_where_one_was_driven_by_it(hoist: Drive) -> None:
    runs = {"v": hoist.simulate(np.full(512, 4.0)), "i": hoist.simulate_current(np.full(512, 0.4))}
    figure = plot_comparison(runs)
    assert figure.axes[0].get_ylabel() == "current (A)"
    np.testing.assert_array_equal(figure.axes[0].lines[1].get_ydata(), runs["v"].current)


def test_one_alone_has_no_difference(step) -> None:
    assert len(plot_comparison({"only": step}).axes) == 2


def test_nothing_to_compare_is_refused() -> None:
    with pytest.raises(InputError, match="at least one simulation"):
        plot_comparison({})


def test_figures_are_legible(step, assert_legible) -> None:
    assert_legible(plot_comparison({"only": step}))
    assert_legible(plot_comparison({"fitted": step, "again": step}))
    many = plot_comparison({f"a drive with a name, number {n}": step for n in range(16)})
    assert_legible(many)
    looks = {(line.get_color(), line.get_linestyle()) for line in many.axes[1].lines[1:]}
    assert len(looks) == 16
