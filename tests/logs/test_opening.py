"""Which reader takes a file, formats read in a process of their own, and memory."""

import os
import signal
import struct
import subprocess
import sys
import threading
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import polars as pl
import pytest
from tests.fuzz.seeds import TIME, VOLTS, hdf5, matlab5, mdf, parquet, tdms
from tests.logs.writing import write_log

from swashplate import FileError, SwashplateError
from swashplate.logs import open_log, subprocess_reader
from swashplate.logs.binary import look

NO_FILES = {
    "log.csv": "log.csv .* folder",
    ".": "folder",
    "none.csv": r"none\.csv",
    "log.xyz": r"'\.xyz'; .* \.csv, ",
    "log.xlsx": r"'\.xlsx'.* CSV",
    "pipe.csv": "pipe.csv .* ordinary file",
    "zero.csv": "zero.csv .* ordinary file",
    "a" * 300 + ".csv": r"a{300}\.csv",
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
    with pytest.raises(FileError, match=rf"library {library}.*'swashplate\[{extra}\]'"):
        look(extra.upper(), path)


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "log.parquet"
    pl.DataFrame({"time": [0.0, 1.0], "empty": [None, None]}).cast(pl.Float64).write_parquet(path)
    return path


@pytest.mark.slow
def test_a_process_that_ends_or_hangs_is_replaced(table, monkeypatch):
    log = open_log(table)
    other = subprocess_reader._ReaderProcess.running
    os.kill(other._process.pid, signal.SIGKILL)
    with pytest.raises(FileError, match="log.parquet .* damaged"):
        log.read(["time"])
    assert log.read(["time"])["time"].tolist() == [0.0, 1.0]
    monkeypatch.setattr(subprocess_reader, "_PATIENCE", 0.2)
    other = subprocess_reader._ReaderProcess.running
    os.kill(other._process.pid, signal.SIGSTOP)
    with pytest.raises(FileError, match="log.parquet .* 0 s"):
        log.read(["time"])
    assert other._process.poll() is not None
    monkeypatch.undo()
    assert log.read(["time"])["time"].tolist() == [0.0, 1.0]


@pytest.mark.slow
def test_an_interrupt_leaves_no_clock_that_python_waits_for(table):
    log = open_log(table)
    other = subprocess_reader._ReaderProcess.running
    os.kill(other._process.pid, signal.SIGSTOP)
    interrupt = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
    interrupt.start()
    with pytest.raises(KeyboardInterrupt):
        log.read(["time"])
    interrupt.join()
    assert other._process.poll() is not None
    assert not [each for each in threading.enumerate() if isinstance(each, threading.Timer)]
    assert log.read(["time"])["time"].tolist() == [0.0, 1.0]


def test_files_may_change_and_paths_are_relative(table, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    log = open_log("log.parquet")
    pl.DataFrame({"time": [5.0, 6.0, 7.0]}).write_parquet(table)
    assert log.read(["time"])["time"].tolist() == [5.0, 6.0, 7.0]
    table.rename(tmp_path / "log.csv")
    with pytest.raises(FileError, match="^log.csv "):
        open_log("log.csv")


COLUMNS = 40
ROWS = 100_000

# high-water marks; that of the process in which formats are read apart counts, too
READ = """
import sys
from pathlib import Path
from swashplate.logs import open_log, subprocess_reader

def peak():
    other = subprocess_reader._ReaderProcess.running
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


# --- damaged and hostile files --------------------------------------------------------------------


def text(content: str | bytes) -> Callable[[Path], None]:
    raw = content if isinstance(content, bytes) else content.encode()
    return lambda path: path.write_bytes(raw) and None


def rows(*more: str) -> Callable[[Path], None]:
    """A plain table of a hundred rows, these lines in place of the rows from the third on."""
    lines = ["time,voltage", *(f"{t},{u}" for t, u in zip(TIME, VOLTS, strict=True))]
    lines[3 : 3 + len(more)] = more
    return text("\n".join(lines) + "\n")


def cut(write: Callable[[Path], None], share: float) -> Callable[[Path], None]:
    def damage(path: Path) -> None:
        write(path)
        content = path.read_bytes()
        path.write_bytes(content[: int(share * len(content))])

    return damage


def claims(numbers: int) -> Callable[[Path], None]:
    """HDF5 that says it has so many numbers, and stores none."""

    def write(path: Path) -> None:
        with h5py.File(path, "w") as file:
            file.create_dataset("voltage", (numbers,), "f8", chunks=(1000,))

    return write


def disguised(path: Path) -> None:
    """Parquet by another ending."""
    parquet(path.with_name("other.parquet"))
    path.with_name("other.parquet").rename(path)


def changed(
    write: Callable[[Path], None], place: int | bytes, new: bytes
) -> Callable[[Path], None]:
    """Bytes overwritten, at a place or behind a mark."""

    def damage(path: Path) -> None:
        write(path)
        content = bytearray(path.read_bytes())
        at = place if isinstance(place, int) else content.index(place) + len(place)
        at = at if at >= 0 else len(content) + at
        content[at : at + len(new)] = new
        path.write_bytes(content)

    return damage


def bomb(path: Path) -> None:
    """A compressed variable that claims a million times what is stored."""
    inner = struct.pack("<II", 14, 1 << 31)
    inner += struct.pack("<IIIIII", 6, 8, 6, 0, 5, 8) + struct.pack("<ii", 1, 1 << 28)
    packed = zlib.compress(inner + bytes(1000))
    header = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    path.write_bytes(header + struct.pack("<II", 15, len(packed)) + packed)


def external(path: Path) -> None:
    """Numbers that are said to be in another file."""
    secret = path.with_name("secret.bin")
    secret.write_bytes(bytes(800))
    with h5py.File(path, "w") as file:
        file["time"] = TIME
        file.create_dataset("voltage", (100,), "f8", external=[(str(secret), 0, 800)])


def linked(path: Path) -> None:
    with h5py.File(path.with_name("secret.h5"), "w") as file:
        file["voltage"] = VOLTS
    with h5py.File(path, "w") as file:
        file["time"] = TIME
        file["voltage"] = h5py.ExternalLink("secret.h5", "voltage")


def unwritten(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["time"] = TIME
        file.create_dataset("voltage", (100,), "f8", chunks=(30,))[:30] = 1.0


# name of the file, how it is made, what the sentence says
DAMAGED = [
    # text
    ("empty.csv", text(""), "empty.csv ... empty"),
    ("comments.csv", text("# a\n% b\n"), "only comments and empty lines"),
    ("header.csv", text("time,voltage\n"), "only 1 line of text"),
    ("word.csv", rows("0.25,x"), "'voltage' ... 'x', ... row 3 (line 4)"),
    ("first.csv", text("time,voltage\nx,1\n1,2\n2,3\n"), "'x', ... row 1 (line 2)"),
    ("mixed.csv", text("time,u\n10:00:00,1\n11,2\n"), "'11', ... date ... row 2 (line 3)"),
    (
        "late.csv",
        text("time,u\n" + "10:00:00.5,1\n" * 200_000 + "7,1\n8,1\n"),
        "'7', ... date ... row 200001 (line 200002)",
    ),
    ("control.csv", rows("0.25,\x1b[2J"), "control.csv ... 0x1b ... line 4"),
    ("short.csv", rows("0.25"), "row 3 (line 4) ... 1 field ... 2"),
    ("gap.txt", text("a b c\n1 2 3\n1   3\n"), "row 2 (line 3) ... 2 fields ... 3"),
    ("names.csv", text("time,a,b\n0,1\n1,2\n2,3\n"), "3 names in line 1, ... 2 fields"),
    (
        "nuls.csv",
        text("time,u\n" + "0,1\n" * 20000 + "\0" * 50),
        "NUL ... row 20001 (line ",
    ),
    (
        "thousands.csv",
        text("a;b\n1,234;5\n2,345;6\n"),
        "'1,234', ... comma",
    ),
    ("either.csv", text("voltage\n0,5\n1,5\n"), "'voltage'; ... 'column 1',"),
    ("open.csv", text('a,b\n1,"2\n3,4\n'), "quotes in data row 1 (line 2)"),
    ("wide.csv", text("time,u\n0,1\n".encode("utf-16")[:-1]), "utf-16-le"),
    ("excel.csv", text(b"PK\x03\x04" + bytes(50)), "'.csv' ... Excel or zip"),
    ("parquet.csv", disguised, "'.csv' ... Parquet"),
    # Parquet
    ("text.parquet", text("time,voltage\n0,1\n"), "as Parquet"),
    ("cut.parquet", cut(parquet, 0.6), "cut.parquet"),
    ("note.parquet", parquet, "'note' ... String"),
    # MATLAB
    ("text.mat", text("time,voltage\n0,1\n"), "as MATLAB"),
    ("head.mat", text(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"), "no vectors of numbers"),
    ("five.mat", cut(matlab5, 0.5), "five.mat"),
    ("bomb.mat", bomb, "as MATLAB"),
    ("cell.mat", matlab5, "'cell' ... text"),
    ("complex.mat", matlab5, "'z' ... complex numbers"),
    # HDF5
    ("text.h5", text("time,voltage\n0,1\n"), "as HDF5"),
    ("cut.h5", cut(hdf5, 0.7), "cut.h5 ... HDF5... damaged ...truncated"),
    ("block.h5", changed(hdf5, b"x^", b"\xff" * 20), "block.h5 ... HDF5"),
    ("larger.h5", claims(10**12), "1000000000000 ... 1 requested"),
    ("huge.h5", claims(10**7), "'/voltage' ... 10000000 ... none"),
    ("unwritten.h5", unwritten, "'/voltage' ... 1 of its 4 blocks"),
    ("external.h5", external, "'/voltage' ... numbers are in"),
    ("linked.h5", linked, "linked.h5 ... 'voltage'; ... '/time'"),
    # TDMS
    ("text.tdms", text("time,voltage\n0,1\n"), "as TDMS"),
    ("cut.tdms", cut(tdms, 0.9), "as TDMS, it is ...: Last segment of file has less data"),
    ("open.tdms", changed(tdms, 12, b"\xff" * 8), "Last segment of file has less data"),
    ("note.tdms", tdms, "note' ... text"),
    # MDF
    ("text.mf4", text("time,voltage\n0,1\n"), "text.mf4 ... MDF"),
    ("three.mf4", text(b"MDF     3.30    ".ljust(64, b"\0")), "MDF '3.30'; ... MDF 4"),
    ("unfinished.mf4", text(b"UnFinMF 4.10    ".ljust(64, b"\0")), "not finished"),
    ("cut.mf4", cut(mdf, 0.5), "cut.mf4"),
]


def read(path: Path, wanted: list[str]) -> None:
    """All columns of a file and those that it may have left out."""
    log = open_log(path)
    log.read([column.name for column in log.columns] + wanted)


@pytest.mark.parametrize(("name", "write", "said"), DAMAGED, ids=[each[0] for each in DAMAGED])
def test_a_damaged_file_ends_in_one_sentence(tmp_path, name, write, said):
    path = tmp_path / name
    write(path)
    with pytest.raises(SwashplateError) as caught:
        read(path, [each for each in ("voltage", "note", "cell", "z") if each in said])
    sentence = str(caught.value)
    assert name in sentence
    for part in said.split("..."):
        assert part in sentence
    assert sentence.isprintable()
    assert sentence.endswith(".")
    assert ". " not in sentence, "more than one sentence"


@pytest.mark.slow
def test_nothing_is_left_behind_of_a_damaged_file(tmp_path):
    path, spare = tmp_path / "log.mf4", tmp_path / "spare"
    spare.mkdir()
    mdf(path)
    content = path.read_bytes()
    # not finished, so that its library repairs a copy first, and cut, so that it cannot
    path.write_bytes(content[:60] + b"\1\0" + content[62:300])
    reading = f"from swashplate.logs import open_log; open_log({str(path)!r})"
    environment = os.environ | dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(spare))
    ended = subprocess.run(
        [sys.executable, "-c", reading], env=environment, capture_output=True, text=True
    )
    assert "as MDF" in ended.stderr
    assert not list(spare.iterdir())
