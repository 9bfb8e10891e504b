"""What docs/own-models.md shows is right: its Python runs and its links lead somewhere."""

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "own-models.md").read_text("utf-8")


def test_the_python_runs_and_prints_what_the_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (block,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    Path("tank.py").write_text(block, "utf-8")  # an equation is read from its file
    exec(compile(block, "tank.py", "exec"), {"__name__": "tank"})
    printed = capsys.readouterr().out.strip()
    assert f"It prints `{printed}`" in PAGE
    assert printed == "7.00 K/kW, 12.0 s"  # what the page's log was made with


def test_links_lead_somewhere() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", PAGE):
        assert (DOCS / target).exists(), target
