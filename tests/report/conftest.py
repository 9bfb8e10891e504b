import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from swashplate import Drive, Simulation, maneuvers


@pytest.fixture(scope="session")
def step(hoist: Drive) -> Simulation:
    """The hoist under a step of 9 V: all but the spool's stop and the relief valve act."""
    return hoist.simulate(maneuvers.step(9.0).sample())


@pytest.fixture(scope="session")
def all_limits(hoist: Drive) -> Simulation:
    """A run in which every limit acts somewhere."""
    weak = hoist.replace(Z15=0.6e6, Z14=2e-4)
    return weak.simulate(maneuvers.sine(9.0, 0.1).sample())


def texts(figure: Figure) -> Iterator[Text]:
    """Every text that is seen, ticks only as far as they are within their axis."""
    figure.draw_without_rendering()
    for text in figure.findobj(Text):
        if text.get_visible() and text.get_text().strip() and is_drawn(text, figure):
            yield text


def is_drawn(text: Text, figure: Figure) -> bool:
    for ax in (each for own in figure.axes for each in (own, *own.child_axes)):
        for axis in (ax.xaxis, ax.yaxis):
            for tick in axis.get_major_ticks():
                if text in (tick.label1, tick.label2):
                    low, high = sorted(axis.get_view_interval())
                    return low <= tick.get_loc() <= high and axis.get_visible()
    return True


@pytest.fixture(scope="session")
def assert_legible():
    """Every text is at least 8 pt, within the figure, and none lies over another."""

    def check(figure: Figure) -> None:
        boxes = []
        for text in texts(figure):
            box = text.get_window_extent()
            assert text.get_fontsize() >= 8.0, text
            assert figure.bbox.x0 <= box.x0 < box.x1 <= figure.bbox.x1, text
            assert figure.bbox.y0 <= box.y0 < box.y1 <= figure.bbox.y1, text
            for other, other_box in boxes:
                # a text's box is a little higher than its letters
                assert not box.padded(-1.5).overlaps(other_box.padded(-1.5)), (text, other)
            boxes.append((text, box))

    return check


@pytest.fixture
def browsed(tmp_path: Path):
    """Show a page in a browser, which must not complain; what it made of the page."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        pytest.skip("there is no Chromium here; `make browser` installs it where it can")

    def show(page: Path, at: str = "#all") -> str:
        options = ("--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr")
        more = ("--virtual-time-budget=20000", f"--user-data-dir={tmp_path / 'profile'}")
        words = [browser, *options, *more, "--window-size=1280,1000", "--dump-dom"]
        done = subprocess.run(
            [*words, f"{page.as_uri()}{at}"],
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        said = [line for line in done.stderr.splitlines() if ":CONSOLE" in line]
        assert [line for line in said if "setting log level" not in line] == []
        return done.stdout

    return show
