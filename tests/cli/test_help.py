"""Help texts fit a terminal of 80 columns, and what they show as examples can be run."""

import re
import shlex
import shutil
from pathlib import Path

import pytest
import scipy.io
import typer
from typer.testing import CliRunner

from swashplate import Drive, maneuvers
from swashplate.campaign import rig
from swashplate.cli import EPILOG, app

GROUP = typer.main.get_group(app).commands
COMMANDS = [*GROUP.values(), *GROUP["campaign"].commands.values()]
COMMANDS = [each for each in COMMANDS if not hasattr(each, "commands")]
INSTEAD = {
    "bootstrap 1000": "bootstrap 40 --jobs 1",
    "--starts 50": "--starts 1 --jobs 1",
    "--folds 5": "--folds 2",
    "--out virtual": "--out new",
    "virtual-hoist/": "virtual/",
    "--run hoistr6": "--run hoist_step_4_V",
    "--from 5.8 --to 6.6": "--from 2.8 --to 3.6",
    "logs/*.csv": "logs/hoist_step_4_V.csv",
}
"""Draws, starts and folds, as many as a test has time for, and names that there are."""
FEWER = """
[[stages]]
name = "card"
part = "card"
free.G1 = { relative = [0.5, 2.0] }
free.J = { relative = [0.5, 2.0] }
[[stages]]
name = "pump"
part = "pump"
free.Z8 = { relative = [0.5, 2.0], log = true }
free.Z10 = { relative = [0.5, 2.0], log = true }
"""
ELSEWHERE = ("demo", "valve", "campaign init", "logs/start.toml")
"""Run by tests of their own, or by the page docs/how-to/another-machine.md."""


def examples() -> list[str]:
    """Commands of all examples, without what is said beside them."""
    texts = [EPILOG, *(str(each.epilog) for each in COMMANDS)]
    found = re.findall(r"^  (swashplate .*?)(?:   .*|\s*>.*)?$", "\n".join(texts), re.MULTILINE)
    return list(dict.fromkeys(found))


@pytest.mark.parametrize("command", COMMANDS, ids=lambda each: str(each.name))
def test_each_command_has_an_example_and_short_lines(command):
    """Lines are kept as they are written, and a line has 78 characters between its margins."""
    assert max(map(len, command.help.splitlines())) <= 78
    assert re.search(rf"swashplate (campaign )?{command.name}\b", command.epilog)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with all that the examples name: campaigns, a fit, logs, drives."""
    folder = tmp_path_factory.mktemp("examples")
    tests = (maneuvers.step(4.0, stop=3.0, length=4.0), maneuvers.step(-5.0, stop=3.0, length=4.0))
    for name in ("virtual", "harbour", "logs"):
        what = {"seed": 1, "validate": [] if name == "logs" else ["step +9 V"]}
        rig.write(rig.run("hoist", [*tests, maneuvers.step(9.0)], **what), folder / name)
    (folder / "harbour" / "mine.toml").write_text(FEWER, "utf-8")
    hoist = Drive.preset("hoist")
    for name in ("mine.toml", "worn.toml"):
        hoist.scale(Z10=0.9).to_toml(folder / name)
    run = hoist.simulate(maneuvers.step(4.0, length=8.0).sample())
    run.write(folder / "log.csv")
    scipy.io.savemat(folder / "trial1.mat", {"time": run.time, "voltage": run.voltage})
    names = ("virtual/campaign.toml", "harbour/mine.toml", "fitted")
    campaign, setup, out = (str(folder / name) for name in names)
    words = ["fit", campaign, "--setup", setup, "--out", out, "--no-report"]
    assert CliRunner().invoke(app, words).exit_code in (0, 1)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("example", [e for e in examples() if not any(w in e for w in ELSEWHERE)])
def test_the_examples_can_be_run(place, tmp_path, monkeypatch, example) -> None:
    if "--pdf" in example and not (shutil.which("chromium") or shutil.which("chromium-browser")):
        pytest.skip("there is no Chromium here; `make browser` installs it where it can")
    folder = tmp_path / "examples"
    shutil.copytree(place, folder)
    monkeypatch.chdir(folder)
    if "--setup mine.toml" in example:  # no drive then
        shutil.copy("harbour/mine.toml", "mine.toml")
    if " fit " in example:
        shutil.rmtree("fitted")
    if re.match("swashplate campaign (check|plot)", example) and ".toml" not in example:
        monkeypatch.chdir(folder / "virtual")
    for shown, tried in INSTEAD.items():
        example = example.replace(shown, tried)
    words = shlex.split(example)[1:]
    result = CliRunner().invoke(app, words, prog_name="swashplate")
    # a fit to a few short runs need not be usable: that is exit code 1
    assert result.exit_code in (0, 1), result.output
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
