"""Logs as HDF5 files: every dataset of one or two dimensions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import ceil, prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from swashplate.errors import FileError
from swashplate.logs.damage import (
    HDF5,
    Reading,
    check_any,
    check_kind,
    left_out_notes,
    said,
)
from swashplate.logs.log import Array, Column, Log, signals, split_unit
from swashplate.logs.text import TextOptions

name = "HDF5"
suffixes = (".h5", ".hdf5", ".hdf", ".he5")

_UNITS = ("unit", "units", "Unit", "Units", "UNIT", "UNITS")
_KEPT = 500  # letters of an attribute that are kept as a comment
_MOST = 100_000  # datasets in one file


class Place(NamedTuple):
    """Where a column is in the file."""

    dataset: str
    field: str | None
    """Of a compound type."""
    axis: int | None
    """Dimension of the dataset along which a row or column is chosen; None takes all."""
    place: int


class Found(NamedTuple):
    """What a file has."""

    columns: list[Column]
    places: list[Place]
    left_out: dict[str, str]
    comments: tuple[str, ...]


def open(path: Path, options: TextOptions) -> Log:
    """Look into an HDF5 file.

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
        if file.read(8) != HDF5:
            raise FileError(f"{path} is no HDF5 file.")
    found = look_into(path, lambda dataset: (f"/{dataset.name.lstrip('/')}", None), matlab=False)
    return log_of(path, "HDF5", found)


def look_into(
    path: Path, naming: Callable[[Any], tuple[str | None, str | None]], *, matlab: bool
) -> Found:
    """Columns of a file.

    Parameters
    ----------
    naming : callable
        For a dataset, what it is called, None if it is no data at all, and why it cannot be read,
        None if it can.
    matlab : bool
        As in `signals`; dimensions are then in reverse.
    """
    import h5py

    found = Found([], [], {}, ())
    with Reading(path, "HDF5"), h5py.File(path, "r", locking=False) as file:
        for dataset in _datasets(path, file):
            called, reason = naming(dataset)
            if called is None:
                continue
            try:
                _add(found, called, dataset, reason, matlab)
            except (TypeError, ValueError) as error:  # a type that NumPy does not have
                found.left_out[called] = said(error)
        comments = tuple(_comments(file))
    return found._replace(comments=comments)


def log_of(path: Path, form: str, found: Found) -> Log:
    """A log of what was found, to be read by dataset.

    Raises
    ------
    FileError
        If nothing was found.
    """
    check_any(path, found.columns, "columns", found.left_out)
    notes = left_out_notes(found.left_out)

    def load(positions: Sequence[int]) -> list[Array]:
        import h5py

        with Reading(path, "HDF5"), h5py.File(path, "r", locking=False) as file:
            return [_numbers(path, file, found.places[position]) for position in positions]

    return Log(path, form, tuple(found.columns), load, found.comments, notes, found.left_out)


def _datasets(path: Path, file: Any) -> Iterator[Any]:
    import h5py

    names: list[str] = []
    # visits neither soft nor external links, and an object of several names once
    file.visit(names.append)
    if len(names) > _MOST:
        raise FileError(f"{path} has {len(names)} objects, more than the {_MOST} that are read.")
    for each in names:
        item = file.get(each)
        if isinstance(item, h5py.Dataset):
            yield item


def _add(found: Found, called: str, dataset: Any, reason: str | None, matlab: bool) -> None:
    shape = dataset.shape
    if reason is None and not shape:
        reason = "it is a single value"
    if reason is None and (dataset.is_virtual or dataset.external):
        reason = "its numbers are in other files"
    if reason is not None:
        found.left_out[called] = reason
        return
    units = _units(dataset)
    fields = dataset.dtype.fields or {}
    kinds = {field: kind for field, (kind, *_) in fields.items()} or {None: dataset.dtype}
    for field, kind in kinds.items():
        whole = called if field is None else f"{called}.{field}"
        if kind.kind not in "iufb":
            found.left_out[whole] = _type(kind)
            continue
        several = signals(whole, shape[::-1] if matlab else shape, matlab=matlab)
        if isinstance(several, str):
            found.left_out[whole] = several
            continue
        given = units if len(units) == len(several) else units * len(several)
        for signal, unit in zip(several, given or [None] * len(several), strict=False):
            axis = signal.axis if signal.axis is None or not matlab else 1 - signal.axis
            found.columns.append(Column(signal.name, unit or split_unit(whole)[1]))
            found.places.append(Place(dataset.name, field, axis, signal.place))


def _type(kind: np.dtype[Any]) -> str:
    words = {"c": "complex numbers", "S": "text", "U": "text", "V": "records"}
    return f"it holds {words.get(kind.kind, 'text, references or objects')}"


def _units(dataset: Any) -> list[str | None]:
    for key in _UNITS:
        if key in dataset.attrs:
            unit = dataset.attrs[key]
            each = unit.ravel().tolist() if isinstance(unit, np.ndarray) else [unit]
            return [_text(one) for one in each]
    return []


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


def _numbers(path: Path, file: Any, place: Place) -> Array:
    dataset = file[place.dataset]
    _check_stored(path, dataset)
    source = dataset if place.field is None else dataset.fields(place.field)
    if place.axis is None:
        numbers = source[...]
    elif place.axis == 0:
        numbers = source[place.place, :]
    else:
        numbers = source[:, place.place]
    return np.asarray(numbers, np.float64).ravel()


def _check_stored(path: Path, dataset: Any) -> None:
    """Refuse numbers that are claimed but were never stored: HDF5 would give zeros for them."""
    stored = dataset.id.get_storage_size()
    what = f"'{dataset.name}'"
    if stored == 0:
        raise FileError(f"{path}: {what} claims {prod(dataset.shape)} numbers, but none is stored.")
    if dataset.chunks is not None:
        expected = prod(
            ceil(length / chunk)
            for length, chunk in zip(dataset.shape, dataset.chunks, strict=True)
        )
        count = dataset.id.get_num_chunks()
        if count != expected:
            raise FileError(
                f"{path}: {what} has only {count} of its {expected} blocks; the others were never "
                "written."
            )
