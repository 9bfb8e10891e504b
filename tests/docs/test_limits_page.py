"""What docs/limits.md shows is right: its Python prints what it says, its commands run."""

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from swashplate import Drive, maneuvers
from swashplate.analysis import inverse_map, limit_shares
from swashplate.cli import app

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "limits.md").read_text("utf-8")


def test_the_python_prints_what_the_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    blocks = re.findall(r"```python\n(.*?)```\n\n```text\n(.*?)```", PAGE, re.DOTALL)
    assert len(blocks) == PAGE.count("```python") == 5
    for block, printed in blocks:
        exec(compile(block, "limits.md", "exec"), names)
        assert capsys.readouterr().out == printed


def test_the_commands_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    commands = re.findall(r"^    swashplate (.*)$", PAGE, re.MULTILINE)
    assert len(commands) == 3
    for command in commands:
        result = CliRunner().invoke(app, shlex.split(command.split("#")[0]))
        assert result.exit_code == 0, result.output
    assert (tmp_path / "timeline.png").exists()
    assert (tmp_path / "inverse.toml").exists()


@pytest.mark.parametrize("figure", ["envelope", "limit-timeline", "inverse-map"])
def test_the_figures_are_made_as_the_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, figure: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (command,) = re.findall(rf"`swashplate ([^`]*docs/images/{figure}\.png)`", PAGE)
    assert f"](images/{figure}.png)" in PAGE
    Path("docs/images").mkdir(parents=True)
    result = CliRunner().invoke(app, shlex.split(command))
    assert result.exit_code == 0, result.output
    made, kept = (each / f"{figure}.png" for each in (Path("docs/images"), DOCS / "images"))
    assert made.read_bytes()[:24] == kept.read_bytes()[:24]  # a PNG of the same size


def test_the_numbers_in_its_prose() -> None:
    hoist = Drive.preset("hoist")
    by = {each.limit: each for each in limit_shares(hoist, maneuvers.step(9.0).sample()).shares}
    assert round(100.0 * by["orifice"].error_share) == 57
    assert round(100.0 * by["swash stop"].error_share) == -4
    inverse = inverse_map(hoist)
    assert round(1e3 * inverse.lag) == 160
    assert inverse.error < 0.003 * 3.1416 / 180.0
