"""A notebook, executed as a user's is: figures are seen, a verdict is read, no warning is printed.

It begins with nothing compiled, as on a new machine.
"""

import base64
import io
import re
from html import escape
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient
from PIL import Image
from tests.identification.given import FEW, virtual

from swashplate import maneuvers
from swashplate.identification.estimation.setup import setup_text

pytestmark = pytest.mark.slow  # a kernel is started, and compiles all that a fit needs

TESTS = {
    "first": maneuvers.step(4.0, stop=3.0, length=4.0),
    "second": maneuvers.step(-5.0, stop=3.0, length=4.0),
    "third": maneuvers.step(9.0, stop=3.0, length=4.0),
    "last": maneuvers.step(6.0, stop=3.0, length=4.0),
}
CELLS = {
    "simulate": """\
import swashplate
from swashplate import Drive, maneuvers
from swashplate.analysis import limit_shares

hoist = Drive.preset("hoist")
run = hoist.simulate(maneuvers.parse("step:9"))
run""",
    "plot the run": "run.plot()",
    "fit": """\
result = swashplate.identify("virtual/campaign.toml", hoist, "setup.toml")""",
    "result": "result",
    "verdict": "result.verdict",
    "headline": 'print(result.verdict.headline, end="")',
    "plot a prediction": "result.predicted[0].plot()",
    "limits": 'limits = limit_shares(hoist, run["voltage"])',
    "plot the limits": "limits.plot()",
    "plot into axes": """\
import matplotlib.pyplot as plt

figure, axes = plt.subplots()
run.plot(ax=axes)""",
    "plot beside pyplot": 'run.plot("shaft_speed")',
    "show": "run.plot().show()",
}
PLOTS = [
    "plot the run",
    "plot a prediction",
    "plot the limits",
    "plot into axes",
    "plot beside pyplot",
    "show",
]


@pytest.fixture(scope="module")
def notebook(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Any]]:
    """What each cell put out, by its name."""
    folder = tmp_path_factory.mktemp("notebook")
    virtual(folder, "hoist", TESTS, seed=1, validate=["last"])
    (folder / "setup.toml").write_text(setup_text(FEW), "utf-8")
    cells = [nbformat.v4.new_code_cell(text) for text in CELLS.values()]
    book = nbformat.v4.new_notebook(cells=cells)
    client = NotebookClient(book, timeout=400, kernel_name="python3", resources={})
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SWASHPLATE_CACHE_DIR", str(folder / "cache"))
        patch.setenv("IPYTHONDIR", str(folder / "ipython"))
        client.execute(cwd=str(folder))
    return {name: cell.outputs for name, cell in zip(CELLS, book.cells, strict=True)}


def pictures(outputs: list[Any]) -> list[Image.Image]:
    """The pictures that a cell shows."""
    data = [output.data for output in outputs if "data" in output]
    encoded = [each["image/png"] for each in data if "image/png" in each]
    return [Image.open(io.BytesIO(base64.b64decode(each))) for each in encoded]


def shown(outputs: list[Any], kind: str = "text/html") -> str:
    """What a cell shows in some form."""
    return "\n".join(output.data.get(kind, "") for output in outputs if "data" in output)


def test_nothing_is_complained_of(notebook) -> None:
    streams = [output for outputs in notebook.values() for output in outputs if "name" in output]
    assert [stream.text for stream in streams if stream.name == "stderr"] == []


@pytest.mark.parametrize("cell", PLOTS)
def test_a_figure_is_shown_once(notebook, cell: str) -> None:
    (picture,) = pictures(notebook[cell])
    width, height = picture.size
    assert 500 <= width <= 2000
    assert 300 <= height <= 2500
    colors = picture.convert("RGB").getcolors(1 << 24)
    assert len(colors) > 50
    white = max(number for number, color in colors if color == (255, 255, 255))
    assert 0.5 < white / (width * height) < 0.99


def test_a_figure_has_the_size_of_a_page(notebook) -> None:
    (output,) = notebook["plot the run"]
    (picture,) = pictures([output])
    size = output.metadata["image/png"]
    assert picture.size == (pytest.approx(2 * size["width"], abs=2), 2 * size["height"])
    assert size["width"] < 900


def test_a_run_is_a_summary_and_not_all_its_columns(notebook) -> None:
    html = shown(notebook["simulate"])
    assert "peak speed, positive" in html
    assert "swash stop" in html
    assert "limit_dead_zone" not in html


def test_the_verdict_comes_first(notebook) -> None:
    headline = notebook["headline"][0].text
    assert headline.startswith(("Usable", "Not usable"))
    for cell in ("result", "verdict"):
        result = notebook[cell][-1].data
        assert result["text/html"].startswith(f"<p><strong>{escape(headline)}</strong></p>")
        assert len(result["text/plain"]) < 400


def test_a_wait_says_what_it_is_for_in_one_line(notebook) -> None:
    first = shown(notebook["simulate"], "text/plain").splitlines()[0]
    assert re.fullmatch(r"Compiling equations, once on this machine: \d+\.\d s", first)
    (fitting,) = shown(notebook["fit"], "text/plain").splitlines()
    assert re.search(r"Fitting hoist: \d+\.\d s$", fitting)
    waited = shown(notebook["result"], "text/plain").splitlines()[0]
    assert re.search(r"(Judging the fit|Computing the numbers that matter): \d+\.\d s", waited)
