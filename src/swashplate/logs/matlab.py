"""Logs as MATLAB files, of whichever version."""

from __future__ import annotations

from pathlib import Path

from swashplate.errors import FileError
from swashplate.logs.apart import open_apart
from swashplate.logs.damage import Reading
from swashplate.logs.log import Log
from swashplate.logs.magic import HDF5, check_kind
from swashplate.logs.matlab4 import open_matlab4
from swashplate.logs.matlab5 import open_matlab5
from swashplate.logs.text.options import TextOptions

name = "MATLAB"
suffixes = (".mat",)

_ORDERS = {b"IM": "<", b"MI": ">"}


def open(path: Path, options: TextOptions) -> Log:
    """Look into a MATLAB file: vectors, matrices and the fields of structures.

    Columns are called as MATLAB writes them: ``x``, ``s.t``, ``x(1,:)``, ``x(:,1)``; of a matrix,
    the longer dimension is taken for the time. Cells, texts, functions, tables and objects are
    left out; nothing of them is ever built.

    Raises
    ------
    FileError
        If it is damaged, of another kind, or has no vectors of numbers.
    """
    check_kind(path, "MATLAB", "HDF5")
    with path.open("rb") as file:
        head = file.read(2056)
    # HDF5 begins at 0 or, behind MATLAB's own header, at a power of two
    if any(head[place : place + 8] == HDF5 for place in (0, 512, 1024, 2048)):
        return open_apart("matlab73", path)
    order = _ORDERS.get(head[126:128])
    with Reading(path, "MATLAB"):
        if order is None:
            return open_matlab4(path)
        version = int.from_bytes(head[124:126], "little" if order == "<" else "big")
        if version == 0x0200:
            raise FileError(f"{path} is MATLAB 7.3 by its header but no HDF5; it is damaged.")
        if version != 0x0100:
            raise FileError(f"{path} is a MATLAB file of unknown version {version:#06x}.")
        return open_matlab5(path, order)
