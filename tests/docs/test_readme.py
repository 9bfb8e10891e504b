"""The README's Python runs, its links lead somewhere, its calls and commands exist."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from swashplate import Drive
from swashplate.cli import app

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text("utf-8")


def test_python_block_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (block,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    exec(compile(block, "README.md", "exec"), {})
    peak, share = map(float, capsys.readouterr().out.split())
    assert np.rad2deg(peak) == pytest.approx(196.0, abs=0.05)
    assert 0.0 < share < 1.0


def test_calls_of_the_table_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    calls = re.findall(r"^\| [^|]+ \| (`.*`) \|$", README, re.MULTILINE)
    names = {
        "drive": Drive.preset("hoist"),
        "Drive": Drive,
        "volts": np.ones(20),
        "amperes": np.full(20, 0.4),
        "stamps": np.arange(20) / 19.0,
        "values": np.array([1e-4, 2e-4]),
        "torques": np.full(20, 500.0),
        "ratios": np.full(20, 0.98),
    }
    ran = 0
    for call in calls:
        for code in re.findall(r"`([^`]*\(.*?\).*?)`", call):
            exec(code, names)
            ran += 1
    assert ran == 10


def test_commands_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Drive.preset("slew").to_toml("mine.toml")
    Path("log.csv").write_text("time [ms],voltage [mV]\n0,0\n100,5000\n400,0\n", "utf-8")
    commands = re.findall(r"^    swashplate (.*)$", README, re.MULTILINE)
    assert len(commands) == 23
    for command in commands:
        words = shlex.split(command.split("#")[0].split(">")[0])
        # a shell would have replaced the pattern by the files
        arguments = [
            name
            for word in words
            for name in (sorted(map(str, Path().glob(word))) if "*" in word else [word])
        ]
        result = CliRunner().invoke(app, arguments)
        assert result.exit_code == 0, result.output
    assert Path("step.png").exists()
    assert Path("run.parquet").exists()


def test_links_lead_somewhere() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert (ROOT / target).exists(), target
