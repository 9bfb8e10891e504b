"""Logs as arrays of MATLAB (by SciPy; version 7.3 by h5py) and of HDF5 (by h5py)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import ceil, prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from swashplate.errors import FileError
from swashplate.logs.dialect import TextOptions
from swashplate.logs.log import (
    Array,
    Column,
    Log,
    check_kind,
    checked,
    printable,
    said,
    split_unit,
)

_MOST = 4096  # signals in one matrix; one with more of both rows and columns is a picture or a map
_COMPLEX = "it holds complex numbers"


class _Signal(NamedTuple):
    """One signal of an array: all of a vector, or a row or a column of a matrix."""

    name: str
    axis: int | None
    """Dimension along which it is chosen, None for a vector."""
    place: int
    """Position along that dimension, from 0."""


def _signals(name: str, shape: tuple[int, ...], *, matlab: bool) -> list[_Signal] | str:
    """Signals of an array of a shape in its own language's order, or why there are none.

    The longer dimension is taken for the time.
    """
    if 0 in shape:
        return "it is empty"
    if len(shape) > 2:
        return f"it has {len(shape)} dimensions"
    if len(shape) < 2 or 1 in shape:
        return [_Signal(name, None, 0)]
    rows, columns = shape
    axis, count = (1, columns) if rows >= columns else (0, rows)
    if count > _MOST:
        return f"it is a matrix of {rows} by {columns}"
    first = 1 if matlab else 0
    form = (("({},:)", "(:,{})") if matlab else ("[{},:]", "[:,{}]"))[axis]
    return [_Signal(name + form.format(place + first), axis, place) for place in range(count)]


# --- MATLAB ---------------------------------------------------------------------------------------

_NUMBERS = frozenset(
    ["double", "single", "logical"]
    + [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
)
_WORDS = {"char": "text", "sparse": "sparse matrix", "opaque": "object"}
_DEEPEST = 16  # structures within structures


def open_matlab(path: Path, options: TextOptions) -> Log:
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
    if any(head[place : place + 8] == _HDF5 for place in (0, 512, 1024, 2048)):
        return _open(path, "MATLAB 7.3", _named, matlab=True)
    order = head[126:128]
    if order in (b"IM", b"MI"):
        if 2 in head[124:126]:
            raise FileError(f"{path} is MATLAB 7.3 by its header but no HDF5; it is damaged.")
        _check_elements(path, "little" if order == b"IM" else "big")
    columns, found, left_out = [], [], {}
    for called, shape, kind in _variables(path):
        several = _signals(called, shape, matlab=True) if kind in _NUMBERS else _why_not(kind)
        if isinstance(several, str):
            left_out[called] = several
            continue
        for signal in several:
            columns.append(Column(signal.name, split_unit(called)[1]))
            found.append((called, signal))

    def load(positions: Sequence[int]) -> list[Array]:
        return [_variable(path, *found[position]) for position in positions]

    five = order in (b"IM", b"MI")
    comments = (head[:116].decode("latin-1").strip(" \0"),) if five else ()
    form = "MATLAB 5" if five else "MATLAB 4"
    return checked(Log(path, form, tuple(columns), load, comments, left_out=left_out), "vectors")


def _check_elements(path: Path, order: Any) -> None:
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

    for variable, shape, kind in whosmat(path, appendmat=False):
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
    elif value.size != 1:
        yield called, value.shape, "array of structures"
    else:
        for field in value.dtype.names:
            inner = value[field].ravel()[0]
            if isinstance(inner, np.ndarray):
                yield from _fields(f"{called}.{field}", inner, depth + 1)
            else:
                yield f"{called}.{field}", (), "object"


def _why_not(kind: str) -> str:
    return _COMPLEX if kind == "complex" else f"it is a MATLAB {_WORDS.get(kind, kind)}"


def _variable(path: Path, called: str, signal: _Signal) -> Array:
    variable, *fields = called.split(".")
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
    kind = _text(dataset.attrs.get("MATLAB_class", "double"))
    if "MATLAB_object_decode" in dataset.attrs or kind not in _NUMBERS:
        return ".".join(parts), _why_not(kind)
    return ".".join(parts), "it is empty" if dataset.attrs.get("MATLAB_empty", 0) else None


# --- HDF5 -----------------------------------------------------------------------------------------

_HDF5 = b"\x89HDF\r\n\x1a\n"
_UNITS = ("unit", "units", "Unit", "Units", "UNIT", "UNITS")
_KEPT = 500  # letters of an attribute that are kept as a comment
_OBJECTS = 100_000  # in one file


class _Place(NamedTuple):
    """Where a column is in the file."""

    dataset: str
    field: str | None
    """Of a compound type."""
    axis: int | None
    """Dimension of the dataset along which a row or column is chosen; None takes all."""
    place: int


def open_hdf5(path: Path, options: TextOptions) -> Log:
    """Look into an HDF5 file: every dataset of one or two dimensions.

    Columns are called ``/group/data``, those of a matrix ``/group/data[:,0]`` or
    ``/group/data[0,:]``, along its longer dimension, and those of a compound type
    ``/group/table.field``. Units are from attributes. Links to other files are not followed.

    Raises
    ------
    FileError
        If it is damaged, of another kind, or has no datasets of numbers.
    """
    check_kind(path, "HDF5")
    with path.open("rb") as file:
        if file.read(8) != _HDF5:
            raise FileError(f"{path} is no HDF5 file.")
    return _open(path, "HDF5", lambda dataset: (f"/{dataset.name.lstrip('/')}", None), matlab=False)


def _open(
    path: Path,
    form: str,
    naming: Callable[[Any], tuple[str | None, str | None]],
    *,
    matlab: bool,
) -> Log:
    """A log of the datasets that `naming` gives a name and no reason why they cannot be read."""
    import h5py

    columns: list[tuple[Column, _Place]] = []
    left_out: dict[str, str] = {}
    with h5py.File(path, "r", locking=False) as file:
        for dataset in _datasets(path, file):
            called, reason = naming(dataset)
            if called is None:
                continue
            try:
                reason = reason or _why_not_read(dataset)
                if reason is None:
                    columns += _columns(called, dataset, left_out, matlab)
            except (TypeError, ValueError) as error:  # a type that NumPy does not have
                reason = said(error)
            if reason is not None:
                left_out[called] = reason
        comments = tuple(_comments(file))

    def load(positions: Sequence[int]) -> list[Array]:
        with h5py.File(path, "r", locking=False) as file:
            return [_dataset(path, file, columns[position][1]) for position in positions]

    names = tuple(column for column, _ in columns)
    return checked(Log(path, form, names, load, comments, left_out=left_out))


def _datasets(path: Path, file: Any) -> Iterator[Any]:
    import h5py

    names: list[str] = []
    # visits neither soft nor external links, and an object of several names once
    file.visit(names.append)
    if len(names) > _OBJECTS:
        raise FileError(f"{path} has {len(names)} objects, more than the {_OBJECTS} that are read.")
    items = (file.get(each) for each in names)
    return (item for item in items if isinstance(item, h5py.Dataset))


def _why_not_read(dataset: Any) -> str | None:
    if not dataset.shape:
        return "it is a single value"
    elsewhere = dataset.is_virtual or dataset.external
    return "its numbers are in other files" if elsewhere else None


def _columns(
    called: str, dataset: Any, left_out: dict[str, str], matlab: bool
) -> list[tuple[Column, _Place]]:
    shape = dataset.shape[::-1] if matlab else dataset.shape
    given = next((dataset.attrs[key] for key in _UNITS if key in dataset.attrs), None)
    units = [None] if given is None else [_text(each) for each in np.ravel(given).tolist()]
    fields = {field: kind for field, (kind, *_) in (dataset.dtype.fields or {}).items()}
    columns: list[tuple[Column, _Place]] = []
    for field, kind in (fields or {None: dataset.dtype}).items():
        whole = called if field is None else f"{called}.{field}"
        words = {"c": "complex numbers", "S": "text", "U": "text", "V": "records"}
        several: list[_Signal] | str = (
            _signals(whole, shape, matlab=matlab)
            if kind.kind in "iufb"
            else f"it holds {words.get(kind.kind, 'text, references or objects')}"
        )
        if isinstance(several, str):
            left_out[whole] = several
            continue
        each = units if len(units) == len(several) else units[:1] * len(several)
        for signal, unit in zip(several, each, strict=False):
            axis = signal.axis if signal.axis is None or not matlab else 1 - signal.axis
            column = Column(signal.name, unit or split_unit(whole)[1])
            columns.append((column, _Place(dataset.name, field, axis, signal.place)))
    return columns


def _comments(file: Any) -> Iterator[str]:
    for key in file.attrs:
        try:
            value = file.attrs[key]
        except (TypeError, ValueError, OSError):
            continue  # an attribute of a type that NumPy does not have
        if np.ndim(value) == 0 and len(str(value)) <= _KEPT:
            yield f"{key}: {_text(value)}"


def _text(value: object) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _dataset(path: Path, file: Any, place: _Place) -> Array:
    dataset = file[place.dataset]
    _check_stored(path, dataset)
    source = dataset if place.field is None else dataset.fields(place.field)
    where = {None: ..., 0: (place.place, slice(None)), 1: (slice(None), place.place)}[place.axis]
    return np.asarray(source[where], np.float64).ravel()


def _check_stored(path: Path, dataset: Any) -> None:
    """Refuse numbers that are claimed but were never stored: HDF5 would give zeros for them."""
    what = f"'{dataset.name}'"
    if dataset.id.get_storage_size() == 0:
        raise FileError(f"{path}: {what} claims {prod(dataset.shape)} numbers, but none is stored.")
    if dataset.chunks is not None:
        sides = zip(dataset.shape, dataset.chunks, strict=True)
        expected = prod(ceil(length / chunk) for length, chunk in sides)
        count = dataset.id.get_num_chunks()
        if count != expected:
            raise FileError(
                f"{path}: {what} has only {count} of its {expected} blocks; the others were never "
                "written."
            )
