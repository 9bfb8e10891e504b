"""Damaged and hostile files: each ends in one sentence that names the file and the place."""

import os
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import pytest
from tests.fuzz.seeds import TIME, VOLTS, hdf5, matlab5, mdf, parquet, tdms

from swashplate import SwashplateError
from swashplate.logs import open_log


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
    ("empty.csv", text(""), "empty.csv is empty"),
    ("comments.csv", text("# a\n% b\n"), "only comments and empty lines"),
    ("header.csv", text("time,voltage\n"), "only 1 line of text"),
    ("word.csv", rows("0.25,x"), "'voltage' holds 'x', which is no number, in data row 3 (line 4)"),
    ("first.csv", text("time,voltage\nx,1\n1,2\n2,3\n"), "holds 'x', ... in data row 1 (line 2)"),
    ("mixed.csv", text("time,u\n10:00:00,1\n11,2\n"), "'11', which is no date ... row 2 (line 3)"),
    (
        "late.csv",
        text("time,u\n" + "10:00:00.5,1\n" * 200_000 + "7,1\n8,1\n"),
        "'7', which is no date ... row 200001 (line 200002)",
    ),
    ("control.csv", rows("0.25,\x1b[2J"), "control.csv has the byte 0x1b in line 4"),
    ("short.csv", rows("0.25"), "data row 3 (line 4) has 1 field instead of 2"),
    ("gap.txt", text("a b c\n1 2 3\n1   3\n"), "data row 2 (line 3) has 2 fields instead of 3"),
    ("names.csv", text("time,a,b\n0,1\n1,2\n2,3\n"), "3 names in line 1, but 2 fields in the rows"),
    (
        "nuls.csv",
        text("time,u\n" + "0,1\n" * 20000 + "\0" * 50),
        "NUL byte in data row 20001 (line ",
    ),
    ("thousands.csv", text("a;b\n1,234;5\n2,345;6\n"), "'1,234', where the comma may be a decimal"),
    ("either.csv", text("voltage\n0,5\n1,5\n"), "has no column 'voltage'; it has 'column 1',"),
    ("open.csv", text('a,b\n1,"2\n3,4\n'), "misplaced quotes in data row 1 (line 2)"),
    ("wide.csv", text("time,u\n0,1\n".encode("utf-16")[:-1]), "is no text in utf-16-le"),
    ("excel.csv", text(b"PK\x03\x04" + bytes(50)), "ends in '.csv' but holds Excel or zip"),
    ("parquet.csv", disguised, "ends in '.csv' but holds Parquet"),
    # Parquet
    ("text.parquet", text("time,voltage\n0,1\n"), "cannot be read as Parquet"),
    ("cut.parquet", cut(parquet, 0.6), "cut.parquet"),
    ("note.parquet", parquet, "'note' cannot be read as numbers: it is of the type String"),
    # MATLAB
    ("text.mat", text("time,voltage\n0,1\n"), "cannot be read as MATLAB"),
    ("head.mat", text(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"), "no vectors of numbers"),
    ("five.mat", cut(matlab5, 0.5), "five.mat"),
    ("bomb.mat", bomb, "cannot be read as MATLAB"),
    ("cell.mat", matlab5, "'cell' cannot be read as numbers: it holds text"),
    ("complex.mat", matlab5, "'z' cannot be read as numbers: it holds complex numbers"),
    # HDF5
    ("text.h5", text("time,voltage\n0,1\n"), "cannot be read as HDF5"),
    ("cut.h5", cut(hdf5, 0.7), "cut.h5 cannot be read as HDF5, it is damaged ...truncated"),
    ("block.h5", changed(hdf5, b"x^", b"\xff" * 20), "block.h5 cannot be read as HDF5"),
    ("larger.h5", claims(10**12), "has 1000000000000 numbers in the 1 columns that are wanted"),
    ("huge.h5", claims(10**7), "'/voltage' claims 10000000 numbers, but none is stored"),
    ("unwritten.h5", unwritten, "'/voltage' has only 1 of its 4 blocks"),
    ("external.h5", external, "'/voltage' cannot be read as numbers: its numbers are in"),
    ("linked.h5", linked, "linked.h5 has no column 'voltage'; it has '/time'"),
    # TDMS
    ("text.tdms", text("time,voltage\n0,1\n"), "cannot be read as TDMS"),
    ("cut.tdms", cut(tdms, 0.9), "as TDMS, it is ...: Last segment of file has less data"),
    ("open.tdms", changed(tdms, 12, b"\xff" * 8), "Last segment of file has less data"),
    ("note.tdms", tdms, "note' cannot be read as numbers: it holds text"),
    # MDF
    ("text.mf4", text("time,voltage\n0,1\n"), "text.mf4 is no MDF file"),
    ("three.mf4", text(b"MDF     3.30    ".ljust(64, b"\0")), "is MDF '3.30'; convert it to MDF 4"),
    ("unfinished.mf4", text(b"UnFinMF 4.10    ".ljust(64, b"\0")), "was not finished by"),
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
    assert "cannot be read as MDF" in ended.stderr
    assert not list(spare.iterdir())
