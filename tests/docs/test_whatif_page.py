"""What docs/what-if.md shows is right: its Python runs, its commands print what it says."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from swashplate import Drive
from swashplate.analysis import LEVERS, OUTCOMES, speed_per_volt
from swashplate.cli import app

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "what-if.md").read_text("utf-8")
SHOWN = re.findall(r"```console\n\$ swashplate ([^\n]*)\n(.*?)```", PAGE, re.DOTALL)


def test_the_python_runs() -> None:
    names: dict[str, object] = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL):
        exec(compile(block, "what-if.md", "exec"), names)
    result = names["result"]
    assert result.after.values / result.before.values == pytest.approx([2.24], abs=0.005)


@pytest.mark.parametrize(("command", "shown"), SHOWN, ids=[each.split()[0] for each, _ in SHOWN])
def test_commands_print_what_is_shown(
    command: str, shown: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    Path("docs/images").mkdir(parents=True)
    result = CliRunner().invoke(app, shlex.split(command))
    printed = [" ".join(line.split()) for line in result.output.splitlines()]
    wanted = [" ".join(line.split()) for line in shown.splitlines() if line != "..."]
    assert result.exit_code == (2 if wanted[0].startswith("Error") else 0), result.output
    for line in wanted:
        assert line in printed
        printed = printed[printed.index(line) + 1 :]
    made = Path("docs/images/what-if.png")
    if "what-if.png" in command:
        kept = DOCS / "images" / "what-if.png"
        assert made.read_bytes()[:24] == kept.read_bytes()[:24]  # a PNG of the same size


def test_the_tables_name_levers_and_outcomes_that_there_are() -> None:
    levers = set(re.findall(r"`(\w+)`", PAGE.partition("## Levers")[2].partition("Levers of")[0]))
    both = {name for name in LEVERS if not name.endswith(("_plus", "_minus"))}
    assert levers - {"inf"} == both
    named = re.findall(r"^\| `(\w+)` \|", PAGE.partition("## Outcomes")[2], re.MULTILINE)
    assert named == list(OUTCOMES)


def test_the_ratios_of_the_hoist() -> None:
    hoist = Drive.preset("hoist")
    stated = re.search(r"\(([\d.]+) and ([\d.]+) \(deg/s\)/V for the hoist\)", PAGE)
    assert stated is not None
    found = [np.degrees(speed_per_volt(hoist, sign)) for sign in (1.0, -1.0)]
    assert [float(each) for each in stated.groups()] == pytest.approx(found, abs=0.005)
