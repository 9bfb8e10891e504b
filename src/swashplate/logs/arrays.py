"""Logs as arrays of MATLAB (by SciPy; version 7.3 by h5py) and of HDF5 (by h5py)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import ceil, prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from swashplate.errors import FileError
from swashplate.logs.log import Array, Column, Log, check_kind, checked, printable, said, split_unit

_MOST = 4096  # signals in one matrix; one with more of both rows and columns is a picture or a map
_KINDS = {"c": "it holds complex numbers", "S": "it holds text", "U": "it holds text"}
_OTHER = "it is no array of numbers"


class _Signal(NamedTuple):
    """One signal of an array: all of a vector, or a row or a column of a matrix."""

    name: str
    axis: int | None
    """Dimension along which it is chosen, None for a vector."""
    place: int
    """Position along that dimension, from 0."""
    length: int


def _signals(
    name: str, shape: tuple[int, ...], kind: str, *, matlab: bool
) -> tuple[list[_Signal], str]:
    """Signals of an array of a shape in its own language's order, or why there are none.

    The longer dimension is taken for the time.
    """
    if kind not in "iufb":
        return [], _KINDS.get(kind, _OTHER)
    if 0 in shape:
        return [], "it is empty"
    if len(shape) > 2:
        return [], f"it has {len(shape)} dimensions"
    if len(shape) < 2 or 1 in shape:
        return [_Signal(name, None, 0, prod(shape))], ""
    rows, columns = shape
    axis, count = (1, columns) if rows >= columns else (0, rows)
    if count > _MOST:
        return [], f"it is a matrix of {rows} by {columns}"
    first = 1 if matlab else 0
    form = (("({},:)", "(:,{})") if matlab else ("[{},:]", "[:,{}]"))[axis]
    return [
        _Signal(name + form.format(place + first), axis, place, max(shape))
        for place in range(count)
    ], ""


# --- MATLAB ---------------------------------------------------------------------------------------

_LARGEST = 256 << 20
"""A file of MATLAB 4 or 5 is read as a whole; a larger one is refused. [byte]"""


def open_matlab(path: Path) -> Log:
    """Look into a MATLAB file: vectors, matrices and the fields of structures.

    Columns are called as MATLAB writes them: ``x``, ``s.t``, ``x(1,:)``, ``x(:,1)``; of a matrix,
    the longer dimension is taken for the time. Whatever else there is, is left out.

    Raises
    ------
    FileError
        If it is damaged, of another kind, too large for its version, or has no vectors of numbers.
    """
    check_kind(path, "MATLAB", "HDF5")
    with path.open("rb") as file:
        head = file.read(2056)
        size = file.seek(0, 2)
    # HDF5 begins at 0 or, behind MATLAB's own header, at a power of two
    if any(head[place : place + 8] == _HDF5 for place in (0, 512, 1024, 2048)):
        return _open(path, "MATLAB 7.3", _named, matlab=True)
    five = head[126:128] in (b"IM", b"MI")
    if size > _LARGEST:
        raise FileError(
            f"{path} has {size >> 20} MB, and MATLAB files up to version 7 are read as a whole, up "
            f"to {_LARGEST >> 20} MB: save it with -v7.3, or as CSV."
        )
    if five:
        if 2 in head[124:126]:
            raise FileError(f"{path} is MATLAB 7.3 by its header but no HDF5; it is damaged.")
        _check_elements(path, "little" if head[126:128] == b"IM" else "big")
    columns, found, left_out = [], [], {}
    for called, value in _values(path):
        array = np.asarray(value)
        several, reason = _signals(called, array.shape, array.dtype.kind, matlab=True)
        if reason:
            left_out[called] = reason
        for signal in several:
            columns.append(Column(signal.name, split_unit(called)[1]))
            found.append((called, signal))

    def load(positions: Sequence[int], first: int = 0, last: int | None = None) -> list[Array]:
        values, arrays = dict(_values(path)), []
        for position in positions:
            called, signal = found[position]
            value = np.asarray(values[called])
            if signal.axis is not None:
                value = np.take(value, signal.place, axis=signal.axis)
            arrays.append(np.asarray(value, np.float64).ravel()[first:last])
        return arrays

    lengths = tuple(signal.length for _, signal in found)
    form = "MATLAB 5" if five else "MATLAB 4"
    return checked(Log(path, form, tuple(columns), load, left_out, lengths), "vectors")


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


def _values(path: Path) -> Iterator[tuple[str, Any]]:
    """Names and values of the variables and, of structures, of their fields."""
    from scipy.io import loadmat

    def of(called: str, value: Any) -> Iterator[tuple[str, Any]]:
        if isinstance(value, dict):
            for field, inner in value.items():
                yield from of(f"{called}.{printable(field)}", inner)
        else:
            yield called, value

    for name, value in loadmat(path, appendmat=False, simplify_cells=True).items():
        if not name.startswith("__"):
            yield from of(printable(name), value)


def _named(dataset: Any) -> tuple[str | None, str]:
    """What a dataset of version 7.3 is called, and why it cannot be read."""
    parts = dataset.name.strip("/").split("/")
    if parts[0].startswith("#"):  # what cells and objects refer to
        return None, ""
    kind = _text(dataset.attrs.get("MATLAB_class", "double"))
    numbers = kind in ("single", "logical", "double") or kind.lstrip("u").startswith("int")
    reason = "it is empty" if dataset.attrs.get("MATLAB_empty", 0) else ""
    if "MATLAB_object_decode" in dataset.attrs or not numbers:
        reason = f"it is a MATLAB {kind}"
    return ".".join(parts), reason


# --- HDF5 -----------------------------------------------------------------------------------------

_HDF5 = b"\x89HDF\r\n\x1a\n"
_UNITS = ("unit", "units", "Unit", "Units", "UNIT", "UNITS")
_OBJECTS = 100_000  # in one file


class _Place(NamedTuple):
    """Where a column is in the file."""

    dataset: str
    field: str | None
    """Of a compound type."""
    axis: int | None
    """Dimension of the dataset along which a row or column is chosen; None is a vector."""
    place: int
    length: int


def open_hdf5(path: Path) -> Log:
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
    return _open(path, "HDF5", lambda dataset: (f"/{dataset.name.lstrip('/')}", ""), matlab=False)


def _open(
    path: Path, form: str, naming: Callable[[Any], tuple[str | None, str]], *, matlab: bool
) -> Log:
    """A log of the datasets that `naming` gives a name and no reason why they cannot be read."""
    import h5py

    columns: list[tuple[Column, _Place]] = []
    left_out: dict[str, str] = {}
    with h5py.File(path, "r", locking=False) as file:
        names: list[str] = []
        # visits neither soft nor external links, and an object of several names once
        file.visit(names.append)
        if len(names) > _OBJECTS:
            raise FileError(
                f"{path} has {len(names)} objects, more than the {_OBJECTS} that are read."
            )
        for dataset in (item for item in map(file.get, names) if isinstance(item, h5py.Dataset)):
            called, reason = naming(dataset)
            if called is None:
                continue
            try:
                if not dataset.shape:
                    reason = reason or "it is a single value"
                elif dataset.is_virtual or dataset.external:
                    reason = reason or "its numbers are in other files"
                if not reason:
                    columns += _columns(called, dataset, left_out, matlab)
            except (TypeError, ValueError) as error:  # a type that NumPy does not have
                reason = said(error)
            if reason:
                left_out[called] = reason

    def load(positions: Sequence[int], first: int = 0, last: int | None = None) -> list[Array]:
        with h5py.File(path, "r", locking=False) as file:
            return [_dataset(path, file, columns[each][1], first, last) for each in positions]

    lengths = tuple(place.length for _, place in columns)
    named = tuple(column for column, _ in columns)
    return checked(Log(path, form, named, load, left_out, lengths))


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
        several, reason = _signals(whole, shape, kind.kind, matlab=matlab)
        if reason:
            left_out[whole] = reason
            continue
        each = units if len(units) == len(several) else units[:1] * len(several)
        for signal, unit in zip(several, each, strict=False):
            axis = signal.axis if signal.axis is None or not matlab else 1 - signal.axis
            column = Column(signal.name, unit or split_unit(whole)[1])
            place = _Place(dataset.name, field, axis, signal.place, signal.length)
            columns.append((column, place))
    return columns


def _text(value: object) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _dataset(path: Path, file: Any, place: _Place, first: int, last: int | None) -> Array:
    dataset = file[place.dataset]
    _check_stored(path, dataset)
    source = dataset if place.field is None else dataset.fields(place.field)
    rows = slice(first, last)
    if place.axis is None:
        # a vector of n by 1 or 1 by n
        where: Any = tuple(rows if size == place.length else 0 for size in dataset.shape)
        where = where if dataset.ndim == 1 or place.length > 1 else ...
    else:
        where = (place.place, rows) if place.axis == 0 else (rows, place.place)
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
