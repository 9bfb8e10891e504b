import os
import re
import signal
import subprocess
import sys
import time
import tomllib
from importlib import metadata
from pathlib import Path

import pytest

from swashplate import Drive, __version__
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
    [
        ("--help", HEAVY),
        ("simulate --help", {*HEAVY, "swashplate.cli.fit"}),
        ("simulate hoist step:9", {"matplotlib", "pint", "polars", "swashplate.cli.fit"}),
    ],
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
    [
        ("SOURCE_DATE_EPOCH", "yesterday", "SOURCE_DATE_EPOCH is 'yesterday', no number of sec"),
        ("MPLBACKEND", "no_such_backend", None),
    ],
)
def test_the_surroundings(tmp_path, name, value, said):
    """A wrong date of files is refused; what notebooks draw with is of no concern here."""
    words = ("simulate", "hoist", "rest:1", "--plot", "run.png")
    done = swashplate(*words, cwd=tmp_path, **{name: value}, PYTHONIOENCODING="ascii")
    assert done.stdout.isascii()  # a terminal without our characters
    assert done.returncode == (0 if said is None else 2), done.stderr
    assert (said or "") in done.stderr
    assert (tmp_path / "run.png").exists() == (said is None)


def test_a_folder_that_is_gone(tmp_path):
    words = "import os, sys; os.rmdir(os.getcwd()); sys.argv = ['swashplate', 'axes']; "
    folder = tmp_path / "gone"
    folder.mkdir()
    done = python("-c", f"{words}from swashplate.cli import main; main()", cwd=folder)
    assert done.returncode == 2
    assert done.stderr == "Error: The current folder does not exist any more; go to another.\n"


def test_a_broken_pipe_is_silent(tmp_path):
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "wb") as pipe:
        done = subprocess.run(
            [sys.executable, "-m", "swashplate", "axes"],
            cwd=tmp_path,
            stdout=pipe,
            stderr=subprocess.PIPE,
            check=False,
        )
    assert done.stderr == b""


def test_ctrl_c_leaves_whole_files_only(tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-m", "swashplate", "rig", "hoist", "--out", "virtual"],
        cwd=tmp_path,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )
    deadline = time.monotonic() + 60.0
    # a hidden file is one that is being written
    while not list(tmp_path.rglob(".*.csv")) and time.monotonic() < deadline:
        time.sleep(0.0005)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == 130
    assert said == b""
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert [path for path in files if path.name.startswith(".")] == []
    assert all(path.read_bytes().endswith(b"\n") for path in files)


# --- doctor ---------------------------------------------------------------------------------------


def test_it_prints_versions_extras_cache_and_a_simulated_speed(run) -> None:
    done = run("doctor")
    assert done.exit_code == 0, done.output
    words = " ".join(done.stdout.split())
    assert f"swashplate {__version__}" in words
    assert f"numba {metadata.version('numba')}" in words
    assert "196.0 deg/s, as published" in words
    assert "Compiled kernels:" in words or "cannot be kept" in words
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8"))
    extras = set(project["project"]["optional-dependencies"]) - {"dev"}
    assert set(re.findall(r"^extra (\w+)", done.stdout, re.MULTILINE)) == extras


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
    ends = ("lower 95 %", "upper 95 %", "bootstrap lower 95 %", "bootstrap upper 95 %")
    numbers = [Column(name, ".8g") for name in ("nominal", "estimate", *ends)]
    made = Table("Stage pump", (Column("unknown"), UNIT, *numbers), si=True)
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
