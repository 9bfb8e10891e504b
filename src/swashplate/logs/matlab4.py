"""MATLAB files of version 4: headers of 20 bytes, names and plain matrices, one after another."""

from __future__ import annotations

import re
import struct
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np

from swashplate.errors import FileError
from swashplate.logs.log import Log
from swashplate.logs.matrices import Matrix, log_of_matrices

_TYPES = ("f8", "f4", "i4", "i2", "u2", "u1")
_CLASSES = ("numbers", "text", "sparse matrix")
_NAME = re.compile(rb"[A-Za-z]\w{0,62}\0")


class _Variable(NamedTuple):
    matrix: Matrix
    reason: str
    """Why it cannot be read; empty if it can."""
    end: int


def open_matlab4(path: Path) -> Log:
    """Look into a file of version 4, which has no mark to be known by; see `matlab.open`."""
    matrices, left_out = [], {}
    end, size = 0, path.stat().st_size
    with path.open("rb") as file:
        while end < size:
            begin = end
            variable = _variable(file, begin)
            if variable is None:
                what = f"is damaged at byte {begin}" if begin else "is no MATLAB file"
                raise FileError(f"{path} {what}.")
            matrix, reason, end = variable
            if end > size:
                raise FileError(
                    f"{path}: '{matrix.name}' claims {end - matrix.begin} bytes, but only "
                    f"{size - matrix.begin} are left; the file was cut off or is damaged."
                )
            if reason:
                left_out[matrix.name] = reason
            else:
                matrices.append(matrix)
    return log_of_matrices(path, "MATLAB 4", matrices, left_out)


def _variable(file: BinaryIO, begin: int) -> _Variable | None:
    file.seek(begin)
    head = file.read(20)
    if len(head) < 20:
        return None
    order = "<" if int.from_bytes(head[:4], "little") < 5000 else ">"
    code, rows, columns, imaginary, length = struct.unpack(f"{order}5i", head)
    machine, rest = divmod(code, 1000)
    reserved, rest = divmod(rest, 100)
    kind, shape = divmod(rest, 10)
    name = file.read(64) if 2 <= length <= 64 else b""
    if (
        (machine, reserved) != ("<>".index(order), 0)
        or kind >= len(_TYPES)
        or shape >= len(_CLASSES)
        or min(rows, columns) < 0
        or imaginary not in (0, 1)
        or not _NAME.fullmatch(name[:length])
    ):
        return None
    data = begin + 20 + length
    stored = np.dtype(order + _TYPES[kind])
    matrix = Matrix(name[: length - 1].decode("ascii"), (rows, columns), stored, data)
    reason = f"it is a MATLAB {_CLASSES[shape]}" if shape else ""
    if imaginary:
        reason = reason or "it holds complex numbers"
    return _Variable(matrix, reason, data + matrix.size * (1 + imaginary))
