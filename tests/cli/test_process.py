import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
import scipy.io
import typer
from tests.cli.conftest import freeing, without_resource_warnings
from tests.marks import rest_slow
from typer.testing import CliRunner

from swashplate import Drive, __version__, maneuvers, rig
from swashplate.cli import EPILOG, app
from swashplate.cli.terminal import show
from swashplate.tables import UNIT, Column, Table

# --- process --------------------------------------------------------------------------------------

HEAVY = {"matplotlib", "numba", "numpy", "pint", "polars", "scipy"}


def python(*words: str, cwd: Path, **more: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *words],
        cwd=cwd,
        env={**os.environ, **more},
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=120,
        check=False,
    )


def swashplate(*words: str, cwd: Path, **more: str) -> subprocess.CompletedProcess[str]:
    return python("-m", "swashplate", *words, cwd=cwd, **more)


def test_help_is_a_page_with_examples(tmp_path):
    done = swashplate("-h", cwd=tmp_path, COLUMNS="80")
    assert done.returncode == 0
    assert done.stderr == ""
    for words in ("sine:6.5,0.1", "swashplate simulate hoist step:9", "doctor", "exit code 2"):
        assert words in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 80
    assert "\x1b" not in done.stdout


@pytest.mark.parametrize(
    ("typed", "without"),
    rest_slow(
        [
            ("--help", HEAVY),
            ("simulate --help", {*HEAVY, "swashplate.cli.identify"}),
            ("simulate hoist step:9", {"matplotlib", "pint", "polars", "swashplate.cli.identify"}),
        ]
    ),
)
def test_what_a_command_does_not_import(tmp_path, typed, without):
    """Nobody waits for libraries that a command does not use."""
    words = (
        "import sys; from swashplate.cli import app; "
        f"app({typed.split()}, standalone_mode=False); "
        f"print(sorted({without} & set(sys.modules)))"
    )
    done = python("-c", words, cwd=tmp_path)
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    ("name", "value", "said"),
    rest_slow(
        [
            (
                "SOURCE_DATE_EPOCH",
                "yesterday",
                "SOURCE_DATE_EPOCH is 'yesterday', which is not a number",
            ),
            ("MPLBACKEND", "no_such_backend", None),
        ]
    ),
)
def test_the_surroundings(tmp_path, name, value, said):
    """A wrong date of files is refused; what notebooks draw with is of no concern here."""
    words = ("simulate", "hoist", "rest:1", "--plot", "run.png")
    done = swashplate(*words, cwd=tmp_path, **{name: value}, PYTHONIOENCODING="ascii")
    assert done.stdout.isascii()  # a terminal without our characters
    assert done.returncode == (0 if said is None else 2), done.stderr
    assert (said or "") in done.stderr
    assert said is None or done.stderr.count("\n") == 1
    assert (tmp_path / "run.png").exists() == (said is None)


@pytest.mark.skipif(sys.platform == "win32", reason="keeps the folder that a process is in")
def test_a_folder_that_is_gone(tmp_path):
    folder = tmp_path / "gone"
    folder.mkdir()
    words = 'rmdir "$PWD"; exec "$0" -m swashplate show'
    done = subprocess.run(
        ["sh", "-c", words, sys.executable], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stderr == "Error: The current folder no longer exists; change to another.\n"


@pytest.mark.parametrize(
    "typed",
    rest_slow(
        [
            "show",
            "show hoist --toml",
            "simulate hoist step:9",
            "--help",
            "crane run --help",
            "--version",
        ]
    ),
)
def test_a_closed_pipe_is_silent(tmp_path, typed):
    """Whoever prints: rich, typer's help, or the command itself."""
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "wb") as pipe:
        done = subprocess.run(
            [sys.executable, "-m", "swashplate", *typed.split()],
            cwd=tmp_path,
            stdout=pipe,
            stderr=subprocess.PIPE,
            check=False,
        )
    assert done.stderr == b""
    assert done.returncode == 141  # as a shell reports SIGPIPE; 1 is a verdict


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash here")
@pytest.mark.parametrize(
    ("typed", "codes"),
    rest_slow(
        [
            ("simulate hoist step:9 | head -1", {0, 141}),  # 0 if all was written before it stopped
            ("simulate hoist hop 2>&1 | true", {141}),
        ]
    ),
)
def test_a_reader_that_stops_early(tmp_path, typed, codes):
    """The error of a command, too, may have nobody who reads it."""
    words = f"{shlex.quote(sys.executable)} -m swashplate {typed}; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", words], cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode in codes
    assert done.stderr == b""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full disk here")
def test_a_full_disk_is_an_error(tmp_path):
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [sys.executable, "-m", "swashplate", "show"],
            cwd=tmp_path,
            stdout=full,
            stderr=subprocess.PIPE,
            check=False,
        )
    assert done.returncode == 2
    assert done.stderr == b"Error: The output cannot be written: No space left on device.\n"


@pytest.mark.slow
def test_ctrl_c_leaves_whole_files_only(tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-m", "swashplate", "rig", "hoist", "--out", "virtual"],
        cwd=tmp_path,
        env=without_resource_warnings(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )
    deadline = time.monotonic() + 60.0
    # a hidden file is one that is being written; polars is imported for the first of them, and what
    # Python says of an interrupted import is its own matter: one file is whole before Ctrl-C
    logs = tmp_path / "virtual"
    while time.monotonic() < deadline:
        if list(logs.glob("[!.]*.csv")) and list(logs.glob(".*.csv")):
            break
        time.sleep(0.0005)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == 130
    assert said == b""
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert files
    assert [path for path in files if path.name.startswith(".")] == []
    assert all(path.read_bytes().endswith(b"\n") for path in files)


@pytest.mark.parametrize("maneuver", rest_slow(["step:1e308", "sine:1e308,0.1", "stairs:1e308/0"]))
def test_a_number_beyond_any_use_is_one_sentence(tmp_path, maneuver):
    """NumPy's warnings of an overflow do not come before it."""
    done = swashplate("simulate", "hoist", maneuver, cwd=tmp_path)
    assert done.returncode == 2
    assert re.fullmatch(r"Error: .*1e\+308.*\n", done.stderr)


# --- doctor ---------------------------------------------------------------------------------------


def test_it_prints_versions_extras_cache_and_a_simulated_speed(run) -> None:
    done = run("doctor")
    assert done.exit_code == 0, done.output
    words = " ".join(done.stdout.split())
    assert f"swashplate {__version__}" in words
    assert f"llvmlite {metadata.version('llvmlite')}" in words
    assert "196.0 deg/s, as published" in words
    assert "Compiled code:" in words or "cannot be stored" in words
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8"))
    extras = set(project["project"]["optional-dependencies"]) - {"dev"}
    assert set(re.findall(r"^extra (\w+)", done.stdout, re.MULTILINE)) == extras


@pytest.mark.slow
@pytest.mark.parametrize("kept", [True, False])
def test_byte_code_that_is_not_kept_is_said(tmp_path: Path, kept: bool) -> None:
    """An image whose installer compiles nothing, and whose environment lets nobody do it."""
    # where byte code is looked for: in its place, or in a folder without any
    elsewhere = {} if kept else {"PYTHONPYCACHEPREFIX": str(tmp_path)}
    python("-m", "swashplate", "doctor", cwd=tmp_path, PYTHONDONTWRITEBYTECODE="")
    done = swashplate("doctor", cwd=tmp_path, PYTHONDONTWRITEBYTECODE="1", **elsewhere)
    assert done.returncode == 0, done.stderr
    words = " ".join(done.stdout.split())
    assert ("byte code" in words) is not kept
    assert ("compileall" in words and "unset PYTHONDONTWRITEBYTECODE" in words) is not kept


def test_a_wrong_speed_is_said_and_ends_with_code_1(run, monkeypatch: pytest.MonkeyPatch) -> None:
    slow = Drive.preset("hoist").scale(Z10=0.75)
    monkeypatch.setattr(Drive, "preset", lambda name: slow)
    done = run("doctor")
    assert done.exit_code == 1
    assert "147.0 deg/s, but 196.0 deg/s is published" in " ".join(done.stdout.split())


# --- 80 columns -----------------------------------------------------------------------------------


def test_every_end_of_an_interval_is_whole(monkeypatch, capsys) -> None:
    """A table of more numbers than a line holds goes on below, each block with the names."""
    monkeypatch.setenv("COLUMNS", "80")
    ends = ("lower 95 %", "upper 95 %", "profile lower 95 %", "profile upper 95 %")
    numbers = [Column(name, ".8g") for name in ("nominal", "estimate", *ends)]
    made = Table("Estimates", (Column("unknown"), UNIT, *numbers), si=True)
    values = [1651412.3, 1653987.6, 1621034.5, 1685123.4, 1633245.6, 1669765.4]
    made.add("Z8", *values, unit="m")
    made.add("an_offset_of_a_run_with_a_long_name", *(1e-6 * each for each in values), unit="m")
    show(made)
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80
    shown = re.findall(r"(?<![\w.])\d[\d.]*(?:e[+-]\d+)?(?!\w)", text)
    assert {float(each) for each in shown} >= set(values)
    assert text.count("Z8  ") > 1
    # no name is cut, however long
    assert re.search(r"an_offset_of_a_run_with_a_long .*\n_name +\n", text)


# --- help -----------------------------------------------------------------------------------------


GROUP = typer.main.get_group(app).commands
COMMANDS = [*GROUP.values(), *GROUP["campaign"].commands.values()]
COMMANDS = [each for each in COMMANDS if not hasattr(each, "commands")]
OF_CRANES = [*GROUP["crane"].commands.values()]
"""Their examples take minutes; tests/crane runs such commands."""
INSTEAD = {
    "--starts 50": "--starts 1 --jobs 1",
    "--profile Z16_plus": "--profile Z16_plus --jobs 1",
    "--out virtual": "--out new",
    "virtual-hoist/": "virtual/",
    "--run hoistr6": "--run hoist_step_4_V",
    "--from 5.8 --to 6.6": "--from 2.8 --to 3.6",
    "logs/*.csv": "logs/hoist_step_4_V.csv",
}
"""Draws and starts, as many as a test has time for, and names that there are."""
ELSEWHERE = ("demo", "valve", "campaign init", "logs/start.toml")
"""Run by tests of their own, or by the page docs/how-to/another-machine.md."""


def examples() -> list[str]:
    """Commands of all examples, without what is said beside them."""
    texts = [EPILOG, *(str(each.epilog) for each in COMMANDS)]
    found = re.findall(r"^  (swashplate .*?)(?:   .*|\s*>.*)?$", "\n".join(texts), re.MULTILINE)
    # a fit that another example writes elsewhere is made once
    elsewhere = {each.partition(" --out ")[0] for each in found if " --out " in each}
    return [each for each in dict.fromkeys(found) if " fit " not in each or each not in elsewhere]


@pytest.mark.parametrize("command", [*COMMANDS, *OF_CRANES], ids=lambda each: str(each.name))
def test_each_command_has_an_example_and_short_lines(command):
    """Lines are kept as they are written, and a line has 78 characters between its margins."""
    assert max(map(len, command.help.splitlines())) <= 78
    assert re.search(rf"swashplate (campaign |crane )?{command.name}\b", command.epilog)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with all that the examples name: campaigns, a fit, logs, drives."""
    folder = tmp_path_factory.mktemp("examples")
    tests = (maneuvers.step(4.0, stop=3.0, length=4.0), maneuvers.step(-5.0, stop=3.0, length=4.0))
    for name in ("virtual", "harbour", "logs"):
        what = {"seed": 1, "validate": [] if name == "logs" else ["step 9 V"]}
        rig.write(rig.run("hoist", [*tests, maneuvers.step(9.0)], **what), folder / name)
    (folder / "harbour" / "mine.toml").write_text(freeing("G1 J Z8 Z10"), "utf-8")
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
