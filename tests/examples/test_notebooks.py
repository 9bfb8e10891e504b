"""Every example is a notebook, too: converted by jupytext and back, its code is the same."""

from pathlib import Path

import jupytext
import pytest

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.py"))
SCRIPTS = {"actuator", "excavator", "crane_gymnasium", "crane_mujoco"}
"""Which need data or packages that are not here; their first cell is code."""


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_to_a_notebook_and_back(path: Path, tmp_path: Path) -> None:
    book = jupytext.read(path)
    assert book.metadata["jupytext"]["text_representation"]["format_name"] == "percent"
    jupytext.write(book, tmp_path / "example.ipynb")
    jupytext.write(
        jupytext.read(tmp_path / "example.ipynb"), tmp_path / "back.py", fmt="py:percent"
    )
    back = jupytext.read(tmp_path / "back.py")
    assert [(each.cell_type, each.source) for each in back.cells] == [
        (each.cell_type, each.source) for each in book.cells
    ]
    assert sum(each.cell_type == "code" for each in book.cells) >= 5


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_a_title_and_how_to_run_it(path: Path) -> None:
    text = path.read_text("utf-8")
    assert f".venv/bin/python examples/{path.name}" in text
    if path.stem not in SCRIPTS:
        first = jupytext.read(path).cells[0]
        assert first.cell_type == "markdown"
        assert first.source.startswith("# ")
