import numpy as np
import pytest
from swashplate.report.bode_view import plot_bode

from swashplate import Drive, InputError
from swashplate.linear import FrequencyResponse
from swashplate.report.style import BLUE, VERMILION


@pytest.fixture(scope="module")
def swept(hoist: Drive) -> FrequencyResponse:
    return hoist.frequency_response(np.geomspace(0.05, 5.0, 12), [1.0, 9.0])


def test_lines_are_the_response(hoist: Drive, swept: FrequencyResponse) -> None:
    figure = plot_bode(swept)
    gain, phase, distortion = figure.axes
    assert gain.get_ylabel() == "gain ((deg/s)/V)"
    assert phase.get_ylabel() == "phase (deg)"
    assert distortion.get_xlabel() == "frequency (Hz)"
    for row, color in enumerate((BLUE, VERMILION)):
        there = swept.moves[row]
        for ax, expected in (
            (gain, np.degrees(swept.gain[row])),
            (phase, np.degrees(swept.phase[row])),
            (distortion, 100.0 * swept.distortion[row]),
        ):
            line = ax.lines[row]
            assert line.get_color() == color
            np.testing.assert_allclose(line.get_ydata()[there], expected[there])
            assert np.isnan(line.get_ydata()[~there]).all()
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["1 V", "9 V"]
    assert figure.texts[0].get_text() == "hoist: voltage to speed, sines about 0 V"


def test_the_linear_model_beside_it(hoist: Drive, swept: FrequencyResponse) -> None:
    figure = plot_bode(swept, linear=hoist.linearize(4.0), mark=None)
    line = figure.axes[0].lines[2]
    f = line.get_xdata()
    expected = np.degrees(np.abs(hoist.linearize(4.0).response(f)[0]))
    np.testing.assert_allclose(line.get_ydata(), expected)
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words[-1] == "small motions about 4 V"
    with pytest.raises(InputError, match="from current to shaft_speed"):
        plot_bode(swept, linear=hoist.linearize(current=0.45))


def test_a_mark(swept: FrequencyResponse) -> None:
    assert [text.get_text() for text in plot_bode(swept).axes[0].texts] == ["0.3 Hz"]
    assert not list(plot_bode(swept, mark=30.0).axes[0].texts)


def test_other_outputs_have_their_units(hoist: Drive) -> None:
    pressure = hoist.frequency_response([0.3, 1.0], [2.0], output="stroker_pressure")
    assert plot_bode(pressure).axes[0].get_ylabel() == "gain (bar/V)"
    by_current = hoist.frequency_response([0.3, 1.0], [0.05], bias=0.45, input="current")
    figure = plot_bode(by_current, linear=hoist.linearize(current=0.45), title="Pump")
    assert figure.axes[0].get_ylabel() == "gain ((deg/s)/A)"
    assert figure.texts[0].get_text() == "Pump"
    assert figure.legends[0].get_texts()[-1].get_text() == "small motions about 0.45 A"


def test_figures_are_legible(hoist: Drive, swept: FrequencyResponse, assert_legible) -> None:
    assert_legible(plot_bode(swept))
    assert_legible(plot_bode(swept, linear=hoist.linearize(4.0).discrete(0.1)))
    assert_legible(plot_bode(hoist.frequency_response([0.3], [1.0])))
    small = Drive.preset("slew").frequency_response(np.geomspace(0.001, 20.0, 9), [1.0], bias=3.0)
    assert_legible(plot_bode(small))
    many = hoist.frequency_response([0.1, 0.3, 1.0], np.linspace(0.5, 9.5, 14))
    assert_legible(plot_bode(many, linear=hoist.linearize(4.0)))
