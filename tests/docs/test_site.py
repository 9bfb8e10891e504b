"""The documentation builds without a warning, and leaves out nothing that it should have."""

import importlib
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import typer.main

import swashplate
from swashplate.cli import app

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *DOCS.glob("*.md"), *DOCS.glob("*/*.md")]
OBJECTS = [
    name
    for page in tomllib.loads((DOCS / "api.toml").read_text("utf-8"))["page"]
    for name in page["objects"]
]


KEYS = {"campaign-file": "counts_per_turn", "parameter-file": "pump_motor", "set-up-file": "tied"}


@pytest.mark.slow
def test_the_site_builds(tmp_path: Path) -> None:
    """A broken link, a page that none leads to, a wrong docstring: each is a warning, and fails."""
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", DOCS, tmp_path],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    theory = (tmp_path / "theory" / "stroker.html").read_text("utf-8")
    # equations need no network
    (script,) = set(re.findall(r'src="([^"]*mathjax[^"?]*)', theory))
    assert not script.startswith("http")
    assert (tmp_path / "theory" / script).resolve().exists()
    page = (tmp_path / "generated" / "command-line.html").read_text("utf-8")
    for name in typer.main.get_command(app).commands:
        assert f'id="swashplate-{name}' in page, name
    for name, key in KEYS.items():
        assert f">{key}<" in (tmp_path / "generated" / f"{name}.html").read_text("utf-8")


def test_the_reference_has_all_that_the_package_exports() -> None:
    exported = {f"swashplate.{name}" for name in swashplate.__all__}
    assert exported - set(OBJECTS) == {"swashplate.__version__", "swashplate.maneuvers"}
    assert len(OBJECTS) == len(set(OBJECTS))


@pytest.mark.parametrize("module", ["swashplate.maneuvers", "swashplate.report.figures"])
def test_the_reference_has_whole_modules(module: str) -> None:
    found = importlib.import_module(module)
    names = getattr(found, "__all__", vars(found))
    public = {name for name in names if callable(getattr(found, name)) and name[0] != "_"}
    # what only takes part in the making of a manoeuvre
    parts = {"Curve", "Piece", "SplineReturn"}
    assert public - parts == {
        name.rpartition(".")[2] for name in OBJECTS if name.rpartition(".")[0] == module
    }


def test_every_figure_can_be_made_again() -> None:
    sys.path.insert(0, str(DOCS))
    try:
        figures = importlib.import_module("figures")
    finally:
        sys.path.remove(str(DOCS))
    shown = {
        Path(target).name
        for page in PAGES
        if "_build" not in page.parts
        for target in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page.read_text("utf-8"))
    }
    assert shown == set(figures.FIGURES)
    assert {each.name for each in figures.IMAGES.iterdir()} == shown
