import numpy as np
import pytest
from swashplate.report.bands_view import plot_bands
from swashplate.report.whatif_view import plot_whatif

from swashplate import maneuvers
from swashplate.analysis.monte_carlo import bands, independent_drives
from swashplate.analysis.outcomes import trial
from swashplate.analysis.whatif import what_if


@pytest.fixture(scope="module")
def task(hoist):
    return trial(hoist, maneuvers.step(9.0, stop=4.0, length=5.0).sample())


def test_speeds_before_and_after(hoist, task):
    result = what_if(hoist, {"orifice": 1.5, "pump": 1.5}, task)
    figure = plot_whatif(result)
    voltage, speed, acceleration = figure.axes
    tops = sorted(float(np.max(line.get_ydata())) for line in speed.lines)
    assert tops[-1] == pytest.approx(294.0, abs=0.05)
    assert acceleration.get_ylabel() == "acceleration (deg/s²)"
    assert voltage.lines[-1].get_ydata().max() == 9.0
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["as it is", "orifice x 1.5", "pump x 1.5", "changed", "wanted"]
    assert figure.texts[0].get_text() == "hoist: orifice x 1.5, pump x 1.5"


def test_bands_about_them(hoist, task):
    drawn = independent_drives(hoist, {"Z10": 0.2}, 30)
    band = bands(drawn, task.voltage)
    result = what_if(hoist, {"pump": 1.2}, task)
    figure = plot_whatif(result, bands={"as it is": band})
    (shaded,) = figure.axes[1].collections
    (enlarged,) = figure.axes[3].collections
    width = np.ptp(enlarged.get_paths()[0].vertices[:, 1])
    assert width == pytest.approx(np.degrees(band.widest[0]), rel=0.3)
    heights = shaded.get_paths()[0].vertices[:, 1]
    assert heights.max() == pytest.approx(np.degrees(band.upper.max()), rel=1e-9)


def test_a_band_alone(hoist, task):
    band = bands(independent_drives(hoist, {"Z10": 0.2}, 30), task.voltage)
    figure = plot_bands(band, title="A band")
    above, below = figure.axes
    assert below.get_ylim()[1] < 0.2 * above.get_ylim()[1]
    assert "95 % of 30 drives" in below.texts[0].get_text()
    assert figure.texts[0].get_text() == "A band"
