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

from swashplate import __version__
from swashplate.cli import doctor
from swashplate.cli.terminal import long_work, show, waiting
from swashplate.tables import UNIT, Column, Table, count

# --- process --------------------------------------------------------------------------------------


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


# --- terminal -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(None, ""), (0.4, "about 0 s left"), (12.0, "about 12 s left"), (600.0, "about 10 min left")],
)
def test_time_left_in_words(seconds: float | None, words: str) -> None:
    assert waiting(seconds) == words


def test_an_upper_bound_is_called_one() -> None:
    assert waiting(30.0, "at most") == "at most 30 s left"


def test_what_is_count() -> None:
    assert [count(number, "finding", "findings") for number in (0, 1, 2)] == [
        "0 findings",
        "1 finding",
        "2 findings",
    ]


def test_a_pipe_gets_no_bar(capsys: pytest.CaptureFixture[str]) -> None:
    with long_work("Fitting") as shown:
        shown("card: iteration 3, cost 12", 0.5, "about 2 s left")
    assert capsys.readouterr() == ("", "")


# --- doctor ---------------------------------------------------------------------------------------


PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8"))


def test_it_prints_versions_extras_cache_and_a_simulated_speed(run) -> None:
    done = run("doctor")
    assert done.exit_code == 0, done.output
    words = " ".join(done.stdout.split())
    assert f"swashplate {__version__}" in words
    assert f"numba {metadata.version('numba')}" in words
    assert "196.0 deg/s, as published" in words
    assert "Compiled kernels:" in words or "cannot be kept" in words


def test_its_extras_are_those_of_the_package() -> None:
    extras = PROJECT["project"]["optional-dependencies"]
    named = {each.name: each.library.lower() for each in doctor.EXTRAS}
    assert set(named) == set(extras) - {"dev"}
    for name, library in named.items():
        assert [each.split(">")[0].lower() for each in extras[name]] == [library]


def test_an_extra_that_is_missing_has_no_version(run, monkeypatch: pytest.MonkeyPatch) -> None:
    there = metadata.version

    def version(library: str) -> str:
        if library == "npTDMS":
            raise metadata.PackageNotFoundError(library)
        return there(library)

    monkeypatch.setattr(doctor.metadata, "version", version)
    lines = [line.split() for line in run("doctor").stdout.splitlines()]
    assert ["tdms", "-", "logs", "in", "National", "Instruments'", "TDMS"] in lines


def test_a_wrong_speed_is_said_and_ends_with_code_1(run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "_simulated", lambda: (150.0, 0.1))
    done = run("doctor")
    assert done.exit_code == 1
    assert "150.0 deg/s, but 196.0 deg/s is published" in " ".join(done.stdout.split())


# --- 80 columns -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "typed",
    [
        "limits hoist",
        "limits hoist sine:9,0.1",
        "sensitivity hoist --lever pump --lever orifice --span 0.2",
        "compensate slew sine:2,0.1",
        "size hoist --speed-deg-s 250",
        "linearize hoist --at 4 --loop-gain 0.01",
        "bode hoist --points 3",
        "full-order hoist step:4",
        "compare hoist slew",
        "excitation virtual/campaign.toml",
        "campaign check virtual/campaign.toml",
        "validate hoist virtual/campaign.toml --role all",
        "advise hoist --top 2 --maneuver step:9 --maneuver step:-9",
    ],
)
@pytest.mark.usefixtures("virtual")
def test_no_table_is_cut_or_wider_than_a_terminal(done, typed):
    text = done(*typed.split())
    assert "…" not in text
    rules = [len(line) for line in text.splitlines() if set(line) == {"─"}]
    assert max(rules) <= 80


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
