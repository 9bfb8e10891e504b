"""The page on identification: its Python runs, its set-up is one, its commands exist."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from swashplate.cli import app
from swashplate.documents import parse_toml, validated
from swashplate.identification.setup import Setup

PAGE = (Path(__file__).parents[2] / "docs" / "identification.md").read_text("utf-8")


def test_the_python_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(compile(code, "identification.md", "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0] for line in lines] == ["Z1", "Z3", "Z8"]
    assert (tmp_path / "hoist-3.toml").exists()


def test_the_set_up_is_one() -> None:
    blocks = re.findall(r"(?:^    .*\n|^\n)+", PAGE, re.MULTILINE)
    (text,) = [
        re.sub(r"^    ", "", each, flags=re.MULTILINE) for each in blocks if "free.V_dz" in each
    ]
    setup = validated(parse_toml(text, "page"), Setup, "page")
    assert [stage.part for stage in setup.stages] == ["card", "pump"]
    assert setup.stages[0].free["C"].tied


@pytest.mark.parametrize("command", sorted(set(re.findall(r"^    swashplate (\w+)", PAGE, re.M))))
def test_the_commands_exist(command: str) -> None:
    assert CliRunner().invoke(app, [command, "--help"]).exit_code == 0


def test_options_that_are_named_exist() -> None:
    text = CliRunner().invoke(app, ["fit", "--help"], env={"COLUMNS": "200"}).output
    text += CliRunner().invoke(app, ["excitation", "--help"], env={"COLUMNS": "200"}).output
    for option in set(re.findall(r"`[^`]*?(--[a-z]+)", PAGE)):
        assert option in text or option in {"--drive", "--out", "--perturb"}, option
