"""Which reader takes a file, and formats that are read in a process of their own."""

import os
import signal
import sys

import polars as pl
import pytest

from swashplate import FileError
from swashplate.logs import apart, open_log
from swashplate.logs.binary import look


def test_what_is_no_file(tmp_path):
    (tmp_path / "log.csv").mkdir()
    with pytest.raises(FileError, match="log.csv is a folder, not a log"):
        open_log(tmp_path / "log.csv")
    with pytest.raises(FileError, match="is a folder, not a log"):
        open_log(tmp_path)
    with pytest.raises(FileError, match="There is no file"):
        open_log(tmp_path / "none.csv")
    with pytest.raises(FileError, match=r"ends in '\.xyz'; a log is read from \.csv, "):
        open_log(tmp_path / "log.xyz")
    with pytest.raises(FileError, match=r"ends in '\.xlsx'.*: save a spreadsheet as CSV"):
        open_log(tmp_path / "log.xlsx")
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(FileError, match="pipe.csv is no ordinary file"):
        open_log(tmp_path / "pipe.csv")
    (tmp_path / "zero.csv").symlink_to("/dev/zero")
    with pytest.raises(FileError, match="zero.csv is no ordinary file"):
        open_log(tmp_path / "zero.csv")
    with pytest.raises(FileError, match="cannot be read"):
        open_log(tmp_path / ("a" * 300 + ".csv"))


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


def test_a_file_read_apart_may_change_between(table):
    log = open_log(table)
    pl.DataFrame({"time": [5.0, 6.0, 7.0]}).write_parquet(table)
    assert log.read(["time"])["time"].tolist() == [5.0, 6.0, 7.0]


def test_paths_are_relative_to_where_one_is(table, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert open_log("log.parquet").read(["time"])["time"].size == 2
    table.rename(tmp_path / "log.csv")
    with pytest.raises(FileError, match="^log.csv ends in"):
        open_log("log.csv")
