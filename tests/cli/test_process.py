"""What only a process of its own shows: speed, pipes, signals."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from swashplate import __version__

HEAVY = {"matplotlib", "numba", "numpy", "pint", "polars", "scipy"}


def swashplate(*words: str, cwd: Path, **more: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "swashplate", *words],
        cwd=cwd,
        env={**os.environ, **more},
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=120,
        check=False,
    )


@pytest.mark.parametrize("word", ["--help", "-h"])
def test_help_is_a_page_with_examples(tmp_path, word):
    done = swashplate(word, cwd=tmp_path, COLUMNS="80")
    assert done.returncode == 0
    assert done.stderr == ""
    for words in ("sine:6.5,0.1", "swashplate simulate hoist step:9", "tour", "exit code 2"):
        assert words in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 80
    assert "\x1b" not in done.stdout


def test_version(tmp_path):
    assert swashplate("--version", cwd=tmp_path).stdout == f"swashplate {__version__}\n"


def test_help_imports_nothing_heavy(tmp_path):
    words = (
        "import sys; from swashplate.cli import app; "
        "app(['simulate', '--help'], standalone_mode=False); "
        f"print(sorted({HEAVY} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", words], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "[]"


def test_simulating_imports_no_tables_figures_or_units(tmp_path):
    words = (
        "import sys; from swashplate.cli import app; "
        "app(['simulate', 'hoist', 'step:9'], standalone_mode=False); "
        "print(sorted({'matplotlib', 'pint', 'polars'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", words], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "[]"


def test_an_error_is_one_sentence_and_no_traceback(tmp_path):
    done = swashplate("simulate", "hoist", "step:11", "--out", "run.csv", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr == (
        "Error: The voltage is 11 V at 1 s, but the card takes ±10 V; check its unit, or clip it.\n"
    )
    assert list(tmp_path.iterdir()) == []


def test_a_terminal_without_our_characters(tmp_path):
    done = swashplate("simulate", "hoist", "step:9", cwd=tmp_path, PYTHONIOENCODING="ascii")
    assert done.returncode == 0, done.stderr
    assert done.stdout.isascii()


@pytest.mark.parametrize("words", [("show", "hoist"), ("show", "hoist", "--toml"), ("--help",)])
def test_a_broken_pipe_is_silent(tmp_path, words):
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "wb") as pipe:
        done = subprocess.run(
            [sys.executable, "-m", "swashplate", *words],
            cwd=tmp_path,
            stdout=pipe,
            stderr=subprocess.PIPE,
            check=False,
        )
    assert done.stderr == b""


@pytest.mark.parametrize("kind", ["ramp", "step", "sine"])
def test_ctrl_c_leaves_whole_files_only(tmp_path, kind):
    process = subprocess.Popen(
        [sys.executable, "-m", "swashplate", "tour"],
        cwd=tmp_path,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )
    deadline = time.monotonic() + 60.0
    # a hidden file is one that is being written
    while not list(tmp_path.rglob(f".{kind}*.csv")) and time.monotonic() < deadline:
        time.sleep(0.001)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == 130
    assert said == b""
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert [path for path in files if path.name.startswith(".")] == []
    for path in files:
        rows = {"ramp": 6657, "step": 5121}.get(path.name.split()[0])
        assert rows is None or path.read_bytes().count(b"\n") == rows + 1
