"""Figures of the envelope and of the inverse map."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from swashplate.report.compensation_view import plot_compensation
from swashplate.report.envelope_view import plot_envelope

from swashplate import Drive, maneuvers
from swashplate.analysis.compensation import inverse_map
from swashplate.analysis.envelope import envelope
from swashplate.analysis.tracking import improvement, wanted_of_stick


def words(figure: Figure) -> str:
    return "\n".join(text.get_text() for ax in figure.axes for text in ax.texts)


@pytest.mark.parametrize("name", ["hoist", "slew", "luff", "neutral"])
def test_every_envelope_is_legible(name: str, assert_legible) -> None:
    assert_legible(plot_envelope(envelope(Drive.preset(name))))


def test_the_envelope_s_labels(hoist: Drive) -> None:
    figure = plot_envelope(envelope(hoist))
    for said in ("swash stop\n+196.0 deg/s", "swash stop\n−185.0 deg/s"):
        assert said in words(figure)
    for said in ("orifice, at rest\n+136.8 deg/s²", "orifice, at rest\n−177.8 deg/s²"):
        assert said in words(figure)
    assert "at +10 V\n+148.6 deg/s" in words(plot_envelope(envelope(Drive.preset("luff"))))
    assert figure.axes[0].get_xlabel() == "speed (deg/s)"
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels[:3] == ["+10 V", "−10 V", "let go"]
    assert "limited by the orifice" in labels


def test_the_envelope_s_lines(hoist: Drive) -> None:
    """At 0 deg/s the uppermost line is at 136.8, the lowest at -177.8 deg/s²."""
    lines = [
        line for line in plot_envelope(envelope(hoist)).axes[0].lines if len(line.get_xdata()) > 2
    ]
    at_rest = [np.interp(0.0, line.get_xdata(), line.get_ydata()) for line in lines]
    assert max(at_rest) == pytest.approx(136.8, abs=0.1)
    assert min(at_rest) == pytest.approx(-177.8, abs=0.1)


def test_a_drive_that_does_not_move_is_drawn(hoist: Drive) -> None:
    plot_envelope(envelope(hoist.replace(Z17=5.0))).draw_without_rendering()


@pytest.mark.parametrize("name", ["hoist", "slew", "luff", "neutral"])
def test_every_inverse_map_is_legible(name: str, assert_legible) -> None:
    drive = Drive.preset(name)
    inverse = inverse_map(drive)
    assert_legible(plot_compensation(inverse))
    wanted = wanted_of_stick(inverse, maneuvers.sine(4.0, 0.2, length=10.0).sample())
    assert_legible(plot_compensation(inverse, improvement(drive, wanted)))


def test_the_inverse_map_s_lines(hoist: Drive) -> None:
    inverse = inverse_map(hoist)
    figure = plot_compensation(inverse)
    assert "196 deg/s, 7.87 V" in words(figure)
    assert "−185 deg/s, −7.41 V" in words(figure)
    line = figure.axes[0].lines[1]
    speed, volts = line.get_xdata(), line.get_ydata()
    # the static table: 97.75 deg/s at 4 V
    assert np.interp(97.75, speed, volts) == pytest.approx(4.0, abs=1e-3)


def test_the_runs_below(hoist: Drive) -> None:
    inverse = inverse_map(hoist)
    wanted = wanted_of_stick(inverse, maneuvers.sine(4.0, 0.2, length=10.0).sample())
    found = improvement(hoist, wanted)
    figure = plot_compensation(inverse, found, title="mine")
    assert figure.texts[0].get_text() == "mine"
    speed, error = figure.axes[2:]
    way = found.ways[0].run.shaft_speed
    drawn = [line for line in error.lines if len(line.get_xdata()) == wanted.size]
    np.testing.assert_allclose(drawn[0].get_ydata(), np.degrees(way - wanted))
    drawn = [line for line in speed.lines if len(line.get_xdata()) == wanted.size]
    np.testing.assert_allclose(drawn[-1].get_ydata(), np.degrees(wanted))
