"""Which reader takes a file, readers of other packages, and formats that are read apart."""

import os
import signal
import sys
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest

from swashplate import FileError
from swashplate.logs import Column, Log, TextOptions, apart, log, open_log


class Lines:
    """A reader of a user's own: one number a line."""

    name = "lines"
    suffixes = (".lines",)

    def open(self, path: Path, options: TextOptions) -> Log:
        return Log(path, self.name, (Column("u"),), lambda _: [np.loadtxt(path)])


@pytest.fixture
def offered(monkeypatch):
    """Offer objects as entry points of another package."""

    def offer(**readers: object) -> None:
        def load(reader: object) -> object:
            if isinstance(reader, Exception):
                raise reader
            return reader

        entries = [
            SimpleNamespace(name=name, value=f"own:{name}", load=lambda reader=reader: load(reader))
            for name, reader in readers.items()
        ]
        monkeypatch.setattr(
            metadata, "entry_points", lambda group: entries if group == "swashplate.readers" else []
        )

    return offer


def test_a_reader_of_another_package(offered, tmp_path):
    offered(lines=Lines())
    (tmp_path / "log.LINES").write_text("1.5\n2.5\n")
    log = open_log(tmp_path / "log.LINES")
    assert log.format == "lines"
    assert log.read(["u"])["u"].tolist() == [1.5, 2.5]
    with pytest.raises(FileError, match="There is no file"):
        open_log(tmp_path / "none.lines")
    with pytest.raises(
        FileError, match=r"ends in '\.xyz'; a log is read from \.csv, .*, \.lines\."
    ):
        open_log(tmp_path / "log.xyz")


def test_a_reader_that_is_none(offered, tmp_path):
    (tmp_path / "log.lines").write_text("1\n")
    offered(broken=ImportError("No module named 'own'"))
    with pytest.raises(
        FileError, match="reader 'broken' of own:broken cannot be loaded: No module"
    ):
        open_log(tmp_path / "log.lines")
    offered(half=SimpleNamespace(name="half"))
    with pytest.raises(
        FileError, match="reader 'half' of own:half is none: it needs name, suffixes"
    ):
        open_log(tmp_path / "log.lines")


def test_own_endings_need_no_other_package(offered, tmp_path):
    offered(broken=ImportError("never asked for"))
    (tmp_path / "log.csv").write_text("a,b\n1,2\n")
    assert open_log(tmp_path / "log.csv").format == "CSV, commas, decimal point"


def test_what_is_no_file(tmp_path):
    (tmp_path / "log.csv").mkdir()
    with pytest.raises(FileError, match="log.csv is a folder, not a log"):
        open_log(tmp_path / "log.csv")
    with pytest.raises(FileError, match="is a folder, not a log"):
        open_log(tmp_path)
    with pytest.raises(FileError, match="There is no file"):
        open_log(tmp_path / "none.csv")
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(FileError, match="pipe.csv is no ordinary file"):
        open_log(tmp_path / "pipe.csv")
    (tmp_path / "zero.csv").symlink_to("/dev/zero")
    with pytest.raises(FileError, match="zero.csv is no ordinary file"):
        open_log(tmp_path / "zero.csv")
    with pytest.raises(FileError, match="cannot be read"):
        open_log(tmp_path / ("a" * 300 + ".csv"))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_file_that_must_not_be_read(tmp_path):
    (tmp_path / "log.csv").write_text("a,b\n1,2\n")
    (tmp_path / "log.csv").chmod(0)
    with pytest.raises(FileError, match="cannot be read: Permission denied"):
        open_log(tmp_path / "log.csv")


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
        log.opener(extra.upper())(path, TextOptions())


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


def test_every_byte_of_a_small_table_may_be_damaged(table):
    """Polars aborts its process at some of these."""
    content = table.read_bytes()
    kinds = set()
    for place in range(4, len(content) - 8, 23):
        table.write_bytes(content[:place] + b"\xff\xff\xff\x7f" + content[place + 4 :])
        sentence = "log.parquet."
        try:
            read = open_log(table).read(["time"])["time"]
            kinds.add(read.dtype)
        except FileError as error:
            sentence = str(error)
        assert "log.parquet" in sentence
        assert sentence.endswith(".")
    assert kinds == {np.dtype(np.float64)}
