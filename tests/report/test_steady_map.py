import numpy as np
import pytest
from swashplate.report.steady_values import last_holding, steady_values

from swashplate import Drive, InputError
from swashplate.report.figures import plot_steady_map


def test_curves_are_the_steady_states(hoist: Drive) -> None:
    figure = plot_steady_map({"hoist": hoist})
    current, _, speed, close = figure.axes
    assert current.get_ylabel() == "steady current (A)"
    assert speed.get_ylabel() == "steady speed (deg/s)"
    assert speed.get_xlabel() == close.get_xlabel() == "command (V)"
    assert speed.get_xlim() == (-10.0, 10.0)
    (curve,) = (line for line in current.lines if len(line.get_xdata()) > 1000)
    np.testing.assert_array_equal(curve.get_ydata(), hoist.steady_current(curve.get_xdata()))
    (curve,) = (line for line in speed.lines if len(line.get_xdata()) > 1000)
    expected = hoist.steady_speed(curve.get_xdata()) * (180.0 / np.pi)
    np.testing.assert_allclose(curve.get_ydata(), expected, rtol=1e-14)


def test_the_current_jumps_upright(hoist: Drive) -> None:
    values = steady_values(hoist)
    jump = np.argmax(np.diff(values.current))
    assert values.voltage[jump + 1] - values.voltage[jump] < 1e-12
    assert values.current[jump + 1] - values.current[jump] > 0.27


def test_dead_zone_saturation_and_creep_of_the_hoist(hoist: Drive) -> None:
    values = steady_values(hoist)
    low, high = values.dead_zone
    # down, the jump of 0.2951 A crosses the solenoids' 0.27867 A at once; up, 0.27473 A does not
    assert low == pytest.approx(-0.097857, abs=2e-6)
    assert high == pytest.approx(0.12663 + (0.27867 - 0.27473) / 0.049315, abs=2e-4)
    assert hoist.steady_current(high) <= 0.27867 < hoist.steady_current(high + 2e-6)
    below, above = values.saturation
    full = hoist.steady_speed(10.0)
    assert full == pytest.approx(12.396 * 0.27596)
    assert hoist.steady_speed(above - 1e-3) < hoist.steady_speed(above + 1e-3) == full
    assert hoist.steady_speed(below + 1e-3) > hoist.steady_speed(below - 1e-3)
    assert hoist.steady_speed(below - 1e-3) == pytest.approx(-12.396 * 0.26047)
    assert values.creep_deg_s == pytest.approx(np.degrees(hoist.steady_speed(0.0)))


def test_what_is_marked_is_what_the_values_say(hoist: Drive) -> None:
    values = steady_values(hoist)
    _, close_current, speed, close_speed = plot_steady_map({"hoist": hoist}).axes
    for ax in (close_current, close_speed):
        (bar,) = (line for line in ax.lines if line.get_label() == "dead zone hoist")
        assert tuple(bar.get_xdata()) == values.dead_zone
    dots = [line.get_xdata()[0] for line in speed.lines if line.get_marker() == "o"]
    assert dots == list(values.saturation)
    (creep,) = (line for line in close_speed.lines if line.get_marker() == "o")
    assert (creep.get_xdata()[0], creep.get_ydata()[0]) == (0.0, values.creep_deg_s)
    assert [text.get_text() for text in close_speed.texts] == ["creep +3.1 deg/s"]
    assert {text.get_text() for text in speed.texts} == {"−7.41 V", "+7.87 V"}


def test_the_table_says_the_same_in_numbers() -> None:
    drives = {name: Drive.preset(name) for name in ("hoist", "luff", "neutral")}
    words = [text.get_text() for text in plot_steady_map(drives).texts]
    for cell in ("−0.10 to +0.21", "−7.41 and +7.87", "−185.0 and +196.0", "+3.1"):
        assert cell in words
    assert words.count("not within ±10") == 2
    assert "none" in words


def test_drives_of_other_speeds_have_panels_of_their_own() -> None:
    drives = {name: Drive.preset(name) for name in ("hoist", "slew", "luff")}
    axes = plot_steady_map(drives).axes
    assert len(axes) == 2 * 3
    wide = [[line for line in ax.lines if len(line.get_xdata()) > 1000] for ax in axes[2::2]]
    assert [len(lines) for lines in wide] == [2, 1]
    assert np.abs(wide[1][0].get_ydata()).max() < 5.0


@pytest.mark.parametrize("end", [-10.0, 10.0])
def test_the_last_command_at_which_something_holds_is_found(end: float) -> None:
    assert last_holding(lambda volts: abs(volts) <= 3.21, end) == pytest.approx(
        np.copysign(3.21, end), abs=2e-6
    )
    assert last_holding(lambda volts: abs(volts) < np.inf, end) == end
    assert last_holding(lambda volts: abs(volts) < 0.0, end) == 0.0


def test_nothing_to_map_is_refused() -> None:
    with pytest.raises(InputError, match="at least one drive"):
        plot_steady_map({})


def test_figures_are_legible(hoist, assert_legible) -> None:
    assert_legible(plot_steady_map({"hoist": hoist}, title="Hoist"))
    assert_legible(plot_steady_map({"hoist": hoist, "leaky": hoist.replace(Z7=0.3, Z18=4e-5)}))
    names = ("hoist", "slew", "luff", "neutral")
    assert_legible(plot_steady_map({name: Drive.preset(name) for name in names}))
    assert_legible(plot_steady_map({"a name that is longer than its column": hoist}))
