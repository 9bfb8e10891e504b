"""Which reader takes a file, formats read in a process of their own, and memory."""

import os
import signal
import subprocess
import sys

import numpy as np
import polars as pl
import pytest
from tests.logs.writing import write_log

from swashplate import FileError
from swashplate.logs import apart, open_log
from swashplate.logs.binary import look

NO_FILES = {
    "log.csv": "log.csv is a folder, not a log",
    ".": "is a folder, not a log",
    "none.csv": "There is no file",
    "log.xyz": r"ends in '\.xyz'; a log is read from \.csv, ",
    "log.xlsx": r"ends in '\.xlsx'.*: save a spreadsheet as CSV",
    "pipe.csv": "pipe.csv is no ordinary file",
    "zero.csv": "zero.csv is no ordinary file",
    "a" * 300 + ".csv": "cannot be read",
}


def test_what_is_no_file(tmp_path):
    (tmp_path / "log.csv").mkdir()
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "zero.csv").symlink_to("/dev/zero")
    for name, said in NO_FILES.items():
        with pytest.raises(FileError, match=said):
            open_log(tmp_path / name)


@pytest.mark.parametrize(
    ("content", "library", "extra"),
    [
        (b"TDSm" + bytes(24), "npTDMS", "tdms"),
        (b"MDF     4.10    ".ljust(64, b"\0"), "asammdf", "mdf"),
    ],
)
def test_an_extra_that_is_not_installed(tmp_path, monkeypatch, content, library, extra):
    path = tmp_path / f"log.{extra}"
    path.write_bytes(content)
    for name in ("nptdms", "asammdf"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(FileError, match=rf"needs the library {library}.*'swashplate\[{extra}\]'"):
        look(extra.upper(), path)


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "log.parquet"
    pl.DataFrame({"time": [0.0, 1.0], "empty": [None, None]}).cast(pl.Float64).write_parquet(path)
    return path


def test_a_process_that_ends_or_hangs_is_replaced(table, monkeypatch):
    log = open_log(table)
    other = apart._Other.running
    os.kill(other._process.pid, signal.SIGKILL)
    with pytest.raises(FileError, match="log.parquet is damaged so that reading it breaks off"):
        log.read(["time"])
    assert log.read(["time"])["time"].tolist() == [0.0, 1.0]
    monkeypatch.setattr(apart, "_PATIENCE", 0.2)
    other = apart._Other.running
    os.kill(other._process.pid, signal.SIGSTOP)
    with pytest.raises(FileError, match="log.parquet could not be read within 0 s"):
        log.read(["time"])
    assert other._process.poll() is not None
    monkeypatch.undo()
    assert log.read(["time"])["time"].tolist() == [0.0, 1.0]


def test_files_may_change_and_paths_are_relative(table, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    log = open_log("log.parquet")
    pl.DataFrame({"time": [5.0, 6.0, 7.0]}).write_parquet(table)
    assert log.read(["time"])["time"].tolist() == [5.0, 6.0, 7.0]
    table.rename(tmp_path / "log.csv")
    with pytest.raises(FileError, match="^log.csv ends in"):
        open_log("log.csv")


COLUMNS = 40
ROWS = 100_000

# high-water marks; that of the process in which formats are read apart counts, too
READ = """
import sys
from pathlib import Path
from swashplate.logs import apart, open_log

def peak():
    other = apart._Other.running
    processes = ["self"] + ([str(other._process.pid)] if other else [])
    status = [Path(f"/proc/{each}/status").read_text() for each in processes]
    return sum(int(each.split("VmHWM:")[1].split()[0]) for each in status) * 1024

small, large, column, count = sys.argv[1:]
open_log(small).read([column])  # what is imported needs memory as well
log = open_log(large)
before = peak()
assert log.read([column])[column].size == int(count)
print(peak() - before)
"""


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".h5", ".tdms"])
def test_one_column_of_many_takes_the_memory_of_one(tmp_path, suffix):
    random = np.random.default_rng(1)
    small, large = tmp_path / f"small{suffix}", tmp_path / f"large{suffix}"
    for path, rows in ((small, 30), (large, ROWS)):
        columns = {f"c{i}": random.normal(size=rows) for i in range(COLUMNS)}
        write_log(path, {"run": columns}, segments=4)
    words = [sys.executable, "-c", READ, str(small), str(large), "c7", str(ROWS)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert int(done.stdout) < 0.5 * large.stat().st_size
