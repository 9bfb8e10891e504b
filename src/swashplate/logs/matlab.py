"""Logs as MATLAB files, of whichever version: SciPy reads 4 to 7, `hdf5` those of 7.3."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from swashplate.errors import FileError
from swashplate.logs.damage import HDF5, Reading, check_any, check_kind, left_out_notes, printable
from swashplate.logs.hdf5 import log_of, look_into
from swashplate.logs.log import Array, Column, Log, Signal, signals, split_unit
from swashplate.logs.text import TextOptions

name = "MATLAB"
suffixes = (".mat",)

_NUMBERS = frozenset(
    ["double", "single", "logical"]
    + [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
)
_WORDS = {"char": "text", "sparse": "sparse matrix", "opaque": "object"}
_COMPLEX = "it holds complex numbers"
_DEEPEST = 16  # structures within structures


def open(path: Path, options: TextOptions) -> Log:
    """Look into a MATLAB file: vectors, matrices and the fields of structures.

    Columns are called as MATLAB writes them: ``x``, ``s.t``, ``x(1,:)``, ``x(:,1)``; of a matrix,
    the longer dimension is taken for the time. Cells, texts, functions, tables and objects are
    left out.

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
        return log_of(path, "MATLAB 7.3", look_into(path, _named, matlab=True))
    if head[126:128] in (b"IM", b"MI") and 2 in head[124:126]:
        raise FileError(f"{path} is MATLAB 7.3 by its header but no HDF5; it is damaged.")
    if head[126:128] in (b"IM", b"MI"):
        _check_elements(path, "little" if head[126:128] == b"IM" else "big")
    left_out: dict[str, str] = {}
    columns: list[Column] = []
    found: list[tuple[str, Signal]] = []
    for called, shape, kind in _variables(path):
        several = signals(called, shape, matlab=True) if kind in _NUMBERS else _why_not(kind)
        if isinstance(several, str):
            left_out[called] = several
            continue
        for signal in several:
            columns.append(Column(signal.name, split_unit(called)[1]))
            found.append((called, signal))
    check_any(path, columns, "vectors", left_out)

    def load(positions: Sequence[int]) -> list[Array]:
        return [_numbers(path, *found[position]) for position in positions]

    form = "MATLAB 5" if head[126:128] in (b"IM", b"MI") else "MATLAB 4"
    comments = (head[:116].decode("latin-1").strip(" \0"),) if form == "MATLAB 5" else ()
    notes = left_out_notes(left_out)
    return Log(path, form, tuple(columns), load, comments, notes, left_out)


def _check_elements(path: Path, order: Literal["little", "big"]) -> None:
    """Follow the variables to the end: SciPy stops without a word at one that is too long."""
    begin, size = 128, path.stat().st_size
    with path.open("rb") as file:
        while begin < size:
            file.seek(begin + 4)
            length = int.from_bytes(file.read(4), order)
            if begin + 8 + length > size:
                raise FileError(
                    f"{path}: the variable at byte {begin} claims {length} bytes, but only "
                    f"{max(size - begin - 8, 0)} are left; the file was cut off or is damaged."
                )
            begin += 8 + length


def _loaded(path: Path, variable: str) -> Any:
    from scipy.io import loadmat

    # one variable after the other: no neighbour waits in memory
    return loadmat(path, variable_names=[variable], appendmat=False).get(variable)


def _variables(path: Path) -> Iterator[tuple[str, tuple[int, ...], str]]:
    """Name, shape and class of each variable; of a structure of each of its fields."""
    from scipy.io import whosmat
    from scipy.io.matlab import MatReadError

    with Reading(path, "MATLAB", (MatReadError,)):
        listed = whosmat(path, appendmat=False)
        for variable, shape, kind in listed:
            if kind == "struct":
                yield from _fields(printable(variable), _loaded(path, variable), 0)
            elif kind != "function" or variable:
                yield printable(variable), tuple(shape), kind


def _fields(called: str, value: Any, depth: int) -> Iterator[tuple[str, tuple[int, ...], str]]:
    if depth > _DEEPEST:
        raise ValueError(f"'{called}' holds structures in more than {_DEEPEST} levels")
    if value.dtype.names is None:
        kinds = {"O": "cell", "U": "char", "S": "char", "c": "complex"}
        yield called, value.shape, kinds.get(value.dtype.kind, "double")
        return
    if value.size != 1:
        yield called, value.shape, "array of structures"
        return
    for field in value.dtype.names:
        inner = value[field].ravel()[0]
        if isinstance(inner, np.ndarray):
            yield from _fields(f"{called}.{field}", inner, depth + 1)
        else:
            yield f"{called}.{field}", (), "object"


def _why_not(kind: str) -> str:
    if kind == "complex":
        return _COMPLEX
    return f"it is a MATLAB {_WORDS.get(kind, kind)}"


def _numbers(path: Path, called: str, signal: Signal) -> Array:
    variable, *fields = called.split(".")
    with Reading(path, "MATLAB"):
        value = _loaded(path, variable)
        for field in fields:
            value = value[field].ravel()[0]
        if value.dtype.kind == "c":
            raise FileError(f"{path}: '{called}' cannot be read as numbers: {_COMPLEX}.")
        if signal.axis is not None:
            value = np.take(value, signal.place, axis=signal.axis)
        return np.asarray(value, np.float64).ravel(order="F")


def _named(dataset: Any) -> tuple[str | None, str | None]:
    """What a dataset of version 7.3 is called, and why it cannot be read."""
    parts = dataset.name.strip("/").split("/")
    if parts[0].startswith("#"):  # what cells and objects refer to
        return None, None
    called = ".".join(parts)
    kind = dataset.attrs.get("MATLAB_class", b"double")
    kind = kind.decode("latin-1") if isinstance(kind, bytes) else str(kind)
    if "MATLAB_object_decode" in dataset.attrs or kind not in _NUMBERS:
        return called, _why_not(kind)
    return called, "it is empty" if dataset.attrs.get("MATLAB_empty", 0) else None
