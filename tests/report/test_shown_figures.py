"""How a figure shows itself: in a notebook, in a window, as a file; and that it travels."""

import io
import pickle
import sys
import types
from pathlib import Path

import matplotlib
import pytest
from matplotlib.backend_bases import FigureCanvasBase, FigureManagerBase
from matplotlib.figure import Figure
from PIL import Image

from swashplate import Drive, maneuvers
from swashplate.report import figure as figures


@pytest.fixture(scope="module")
def speed() -> Figure:
    return Drive.preset("hoist").simulate(maneuvers.parse("step:9")).plot("shaft_speed")


def test_a_notebook_gets_a_sharp_picture_of_the_figures_size(speed) -> None:
    picture, size = speed._repr_png_()
    inches = speed.get_size_inches()
    assert (size["width"], size["height"]) == pytest.approx(96.0 * inches, abs=0.5)
    with Image.open(io.BytesIO(picture)) as image:
        assert image.size == pytest.approx(192.0 * inches, abs=1.0)
        assert len(image.convert("L").getcolors()) > 10  # not an empty sheet


def test_a_figure_can_be_pickled(speed) -> None:
    again = pickle.loads(pickle.dumps(speed))
    assert type(again) is type(speed)
    assert again._repr_png_() == speed._repr_png_()


def test_without_windows_it_is_a_file_that_is_named(speed, capsys, monkeypatch) -> None:
    opened = []
    monkeypatch.setattr(figures.webbrowser, "open", opened.append)
    monkeypatch.setattr(figures, "_has_screen", lambda: True)
    speed.show()
    path = Path(capsys.readouterr().out.removeprefix("Figure: ").strip())
    assert opened == [path.as_uri()]
    with Image.open(path) as image:
        assert image.format == "PNG"
    path.unlink()
    path.parent.rmdir()


shown_in_windows: list[Figure] = []


class Manager(FigureManagerBase):
    """Opens no window, and says what is shown."""

    def show(self) -> None:
        shown_in_windows.append(self.canvas.figure)


class Canvas(FigureCanvasBase):
    """A canvas whose backend has windows."""

    required_interactive_framework = "headless"  # the one that Matplotlib takes without a screen
    manager_class = Manager


def test_with_windows_it_is_shown_in_one(speed, monkeypatch, capsys) -> None:
    from matplotlib import pyplot

    backend = types.ModuleType("backend_of_tests")
    backend.FigureCanvas, backend.FigureManager = Canvas, Manager
    monkeypatch.setitem(sys.modules, backend.__name__, backend)
    before = matplotlib.get_backend()
    pyplot.switch_backend(f"module://{backend.__name__}")
    try:
        speed.show()
        speed.show()  # in the window that is open
        assert shown_in_windows == [speed, speed]
        assert pyplot.get_fignums() == [1]
    finally:
        pyplot.close("all")
        pyplot.switch_backend(before)
    assert not capsys.readouterr().out
    assert speed._repr_png_()  # still good for a notebook or a file
