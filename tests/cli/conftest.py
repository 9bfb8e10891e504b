import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from rich.console import Console
from rich.live import Live
from typer.testing import CliRunner, Result

from swashplate.cli import app

STEPS = tuple(
    word
    for volts in (4, -5)
    for word in ("--maneuver", f"step:{volts},start=0.5,stop=2.5,length=4")
)
"""Two short tests, as options of 'rig'."""


def freeing(names: str, part: str = "chain") -> str:
    """A fit setup of a part of the drive, as TOML, with the parameters to estimate in words."""
    lines = [f'part = "{part}"']
    lines += [f"free.{name} = {{ relative = [0.5, 2.0], log = true }}" for name in names.split()]
    return "\n".join(lines) + "\n"


def without_resource_warnings() -> dict[str, str]:
    """Environment of a command that is to be interrupted.

    Users are not warned of a file that is open at the signal, as all of these tests are.
    """
    return {**os.environ, "PYTHONWARNINGS": "ignore::ResourceWarning"}


@pytest.fixture(autouse=True)
def one_spinner_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Refuse a spinner or a bar inside another, as rich before 14.1 does."""
    start, stop, running = Console.set_live, Console.clear_live, list[Live]()

    def set_live(console: Console, live: Live) -> bool | None:
        assert not running, "a spinner is shown inside another"
        running.append(live)
        return start(console, live)

    def clear_live(console: Console) -> None:
        running.clear()
        stop(console)

    monkeypatch.setattr(Console, "set_live", set_live)
    monkeypatch.setattr(Console, "clear_live", clear_live)


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The published hoist's virtual tests, in a folder that tests copy from."""
    folder = tmp_path_factory.mktemp("made")
    words = ["rig", "hoist", "--out", str(folder / "virtual"), *STEPS]
    assert CliRunner().invoke(app, words).exit_code == 0
    return folder


@pytest.fixture
def virtual(made: Path, tmp_path: Path) -> Path:
    """The campaign file of two steps of the published hoist, in the folder virtual."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    return tmp_path / "virtual" / "campaign.toml"


@pytest.fixture
def held_out(virtual: Path) -> Path:
    """The same, the second run held back."""
    before, _, after = virtual.read_text("utf-8").rpartition('role = "fit"')
    virtual.write_text(f'{before}role = "validate"{after}', "utf-8")
    return virtual


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """Run the command line in an empty folder; what it is called with are its words."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")

    def call(*words: str) -> Result:
        return CliRunner().invoke(app, list(words), prog_name="swashplate")

    return call


@pytest.fixture
def done(run: Callable[..., Result]) -> Callable[..., str]:
    """Run what must succeed and return what it printed: no table is cut or wider than 80."""

    def call(*words: str) -> str:
        result = run(*words)
        assert result.exit_code == 0, result.output
        assert result.stderr == ""
        assert "…" not in result.stdout
        rules = [len(line) for line in result.stdout.splitlines() if set(line) == {"─"}]
        assert max(rules, default=0) <= 80
        return result.stdout

    return call


@pytest.fixture
def refused(run: Callable[..., Result], tmp_path: Path) -> Callable[..., str]:
    """Run what must be refused, in one sentence and without a trace on disk; return it.

    With exit code 2, or 1 of data that are not sound.
    """

    def call(*words: str, code: int = 2) -> str:
        before = sorted(tmp_path.rglob("*"))
        result = run(*words)
        assert isinstance(result.exception, SystemExit), result.exception
        assert result.exit_code == code
        assert result.stdout == ""
        lead = {1: "Not usable, as the data are not sound", 2: "Error"}[code]
        assert re.fullmatch(lead + r": [^\n]+[^.\n]\.\n", result.stderr), result.stderr
        assert sorted(tmp_path.rglob("*")) == before
        return result.stderr

    return call


@pytest.fixture
def number() -> Callable[..., float]:
    """Find the number in a table's row, by the row's first words and the number's place."""

    def find(text: str, row: str, place: int = 0) -> float:
        (line,) = re.findall(rf"^ *{re.escape(row)}  +(.*)$", text, re.MULTILINE)
        return float(line.split()[place])

    return find
