"""What docs/linear-models.md shows is right: its Python runs, its commands and numbers too."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from swashplate import Drive
from swashplate.cli import app

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "linear-models.md").read_text("utf-8")


def test_the_python_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL):
        exec(compile(block, "linear-models.md", "exec"), names)
    assert (tmp_path / "hoist.toml").exists()
    assert (tmp_path / "bode.csv").exists()


def test_the_commands_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    commands = re.findall(r"^    swashplate (.*)$", PAGE, re.MULTILINE)
    assert len(commands) == 4
    for command in commands:
        result = CliRunner().invoke(app, shlex.split(command.split("#")[0]))
        assert result.exit_code == 0, result.output
    assert (tmp_path / "bode.png").exists()
    assert (tmp_path / "slew.toml").exists()


def test_the_figure_is_made_as_the_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (command,) = re.findall(r"`swashplate (bode [^`]*docs/images/bode\.png)`", PAGE)
    Path("docs/images").mkdir(parents=True)
    result = CliRunner().invoke(app, shlex.split(command))
    assert result.exit_code == 0, result.output
    made, kept = Path("docs/images/bode.png").read_bytes(), DOCS / "images" / "bode.png"
    assert made[:24] == kept.read_bytes()[:24]  # a PNG of the same size


def test_the_numbers_at_2_volts() -> None:
    for name in ("hoist", "slew", "luff"):
        (row,) = re.findall(rf"^\| {name} \| ([\d.]+) \| (.*) \|$", PAGE, re.MULTILINE)
        gain, (lag, bandwidth, phase) = float(row[0]), map(float, row[1].split("|"))
        model = Drive.preset(name).linearize(2.0)
        assert gain == pytest.approx(np.degrees(model.gain), abs=6e-4)
        assert lag == pytest.approx(model.time_constant, abs=6e-5)
        assert bandwidth == pytest.approx(model.bandwidth, abs=6e-4)
        assert phase == pytest.approx(np.angle(model.response(0.3)[0], deg=True), abs=0.06)


def test_the_phases_at_0_3_hz() -> None:
    for name in ("hoist", "slew", "luff"):
        (row,) = re.findall(rf"^\| {name} \| (-.*°) \|$", PAGE, re.MULTILINE)
        stated = [float(cell.strip(" °")) for cell in row.split("|")]
        swept = Drive.preset(name).frequency_response([0.3], [1.0, 4.0, 6.5, 9.0])
        np.testing.assert_allclose(np.degrees(swept.phase[:, 0]), stated, atol=0.06)
