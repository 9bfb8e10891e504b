import html
import re
import shutil
import subprocess
from base64 import b64encode
from collections.abc import Iterator
from hashlib import sha256
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


POLICY = re.compile(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">')
INJECTED = """<script>document.body.dataset.injected = "script"</script>
<img src="x" onerror="document.body.dataset.injected = 'attribute'">
<iframe srcdoc="<script>parent.document.body.dataset.injected = 'frame'</script>"></iframe>
<script src="https://example.invalid/a.js"></script>
<link rel="stylesheet" href="https://example.invalid/a.css"></body>"""
"""What a name in a page would be, had it not been escaped."""


def policy_of(text: str) -> dict[str, list[str]]:
    """The policy of a page: sources by directive."""
    (policy,) = POLICY.findall(text)
    directives = [directive.split() for directive in html.unescape(policy).split(";")]
    return {name: sources for name, *sources in directives}


def with_script(text: str, script: str) -> str:
    """A page with a script of the test in it, which its policy then allows as well."""
    digest = b64encode(sha256(script.encode()).digest()).decode()
    allowed = text.replace("script-src ", f"script-src 'sha256-{digest}' ", 1)
    assert allowed != text
    return allowed.replace("</body>", f"<script>{script}</script></body>")


def injected(page: Path, folder: Path, browsed) -> str:
    """What a browser makes of a page into which somebody has put scripts: none of them runs."""
    text = page.read_text("utf-8")
    policy = policy_of(text)
    assert policy["default-src"] == policy["base-uri"] == policy["form-action"] == ["'none'"]
    assert policy["img-src"] == ["data:"]
    assert not {"connect-src", "font-src", "frame-src"} & policy.keys()
    hashes = [source for source in policy["script-src"] if source.startswith("'sha256-")]
    assert {*policy["script-src"]} <= {*hashes, "'wasm-unsafe-eval'"}
    spoiled = folder / "injected.html"
    spoiled.write_text(text.replace("</body>", INJECTED), "utf-8")
    made = browsed(spoiled, complaints="Content Security Policy")
    assert "data-injected" not in made
    # without the policy, the same page is taken over: the test would see it
    spoiled.write_text(POLICY.sub("", text).replace("</body>", INJECTED), "utf-8")
    assert "data-injected" in browsed(spoiled, complaints="Failed to load")
    return made


@pytest.fixture
def browsed(tmp_path: Path):
    """Show a page in a browser; what it made of the page.

    It must not complain, or only in lines with some words.
    """
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        pytest.skip("there is no Chromium here; `make browser` installs it where it can")

    def show(page: Path, at: str = "#all", complaints: str = "") -> str:
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
        said = [line for line in said if "setting log level" not in line]
        assert [line for line in said if not complaints or complaints not in line] == []
        return done.stdout

    return show
