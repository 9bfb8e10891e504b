"""Figure of the full-order model beside the reduced one."""

import numpy as np
import pytest
from swashplate.report.full_order_view import plot_full_order

from swashplate import Drive, FullOrderDrive, maneuvers
from swashplate.full_order.comparison import Comparison, compare


@pytest.fixture(scope="module")
def found() -> Comparison:
    """Both models of a loaded hoist, at a stop and off again."""
    hoist = FullOrderDrive.preset("hoist").replace(load_torque=2e3)
    step = maneuvers.step(9.0, start=0.25, stop=2.5, length=4.0).sample()
    return compare(hoist, hoist.drive.simulate(step))


def test_panels(found: Comparison) -> None:
    figure = plot_full_order(found)
    assert [ax.get_ylabel().replace("\n", " ") for ax in figure.axes] == [
        "voltage (V)",
        "shaft speed (deg/s)",
        "difference (% of top)",
        "spool (mm)",
        "swash angle (deg)",
        "stroker pres- sure (MPa)",
        "motor pressure drop (MPa)",
    ]
    voltage, speed, difference, spool, swash, stroker, motor = figure.axes

    def drawn(ax, name: int) -> np.ndarray:
        return np.asarray(
            [line for line in ax.lines if len(line.get_xdata()) > 2][name].get_ydata()
        )

    assert drawn(voltage, 0).max() == 9.0
    np.testing.assert_allclose(drawn(speed, 0), np.degrees(found.full.shaft_speed))
    np.testing.assert_allclose(drawn(speed, 1), np.degrees(found.reduced_speed))
    share = 100.0 * (found.reduced_speed - found.full.shaft_speed) / found.full.shaft_speed.max()
    np.testing.assert_allclose(drawn(difference, 0), share, atol=1e-9)
    # the in-line orifices of the published hoist
    assert drawn(spool, 1).max() == pytest.approx(0.11634)
    assert drawn(spool, 1).min() == pytest.approx(-0.15126)
    assert drawn(spool, 0).max() > 1.0
    assert drawn(swash, 0).max() == pytest.approx(np.degrees(0.27596))
    np.testing.assert_allclose(drawn(stroker, 0), 1e-6 * found.full.stroker_pressure)
    # K_mf C_g with 25.1 l a turn
    assert drawn(motor, 0)[0] == pytest.approx(1e-6 * 2.0 * np.pi / 25.1e-3 * 2e3)
    words = [text.get_text() for text in swash.texts]
    assert words == ["stop +15.8°"]  # the other stop is far away


def test_limits_that_hold_are_shaded(found: Comparison) -> None:
    figure = plot_full_order(found)
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == ["swash stop (speed)", "relief valve"]
    (shade,) = figure.axes[4].collections
    (span,) = (path.get_extents() for path in shade.get_paths())
    angle = np.degrees(found.full.swash_angle)
    at_stop = found.time[angle >= np.degrees(0.27596) - 1e-9]
    assert span.x0 == pytest.approx(at_stop[0], abs=1.0 / 512.0)
    assert span.x1 == pytest.approx(at_stop[-1], abs=1.0 / 512.0)


def test_legible(found: Comparison, assert_legible) -> None:
    assert_legible(plot_full_order(found, title="hoist, step 9 V, five states against one"))
    luff = FullOrderDrive.preset("luff")
    sine = maneuvers.sine(9.0, 0.3, settle=None, length=8.0).sample()
    assert_legible(plot_full_order(compare(luff, luff.drive.simulate(sine))))


def test_by_current_and_at_rest(assert_legible) -> None:
    slew = FullOrderDrive.from_drive(Drive.preset("slew"))
    by_current = compare(slew, slew.drive.simulate_current(np.full(64, 0.4)))
    figure = plot_full_order(by_current)
    assert figure.axes[0].get_ylabel() == "current\n(A)"
    assert figure.texts[0].get_text() == "slew"
    still = plot_full_order(compare(slew, slew.drive.simulate(np.zeros(64))))
    assert still.axes[2].get_ylabel() == "difference\n(deg/s)"
    assert not still.legends
    assert_legible(still)
    unlimited = FullOrderDrive.from_drive(Drive.preset("slew").replace(Z16=float("inf")))
    figure = plot_full_order(compare(unlimited, slew.drive.simulate(np.full(256, 5.0))))
    assert {text.get_text() for text in figure.axes[3].texts} == {"position", "opening"}
