"""A log from its file: which reader takes it; and one signal of it in SI."""

from __future__ import annotations

from importlib import import_module, metadata
from pathlib import Path
from typing import NamedTuple

from swashplate.errors import FileError
from swashplate.logs.apart import open_apart
from swashplate.logs.damage import check_file
from swashplate.logs.log import Array, Log, Reader, check_finite, check_stamps, unit_of
from swashplate.logs.text import TextOptions
from swashplate.units import speed_unit, to_si

_READERS = {
    "text": (".csv", ".tsv", ".txt", ".dat", ".asc", ".lvm", ".log"),
    "parquet": (".parquet", ".pq"),
    "matlab": (".mat",),
    "hdf5": (".h5", ".hdf5", ".hdf", ".he5"),
    "tdms": (".tdms",),
    "mdf": (".mf4", ".mdf"),
}
"""Module of each format and the endings of its files: they are imported when one is opened."""

_APART = ("parquet", "matlab", "hdf5", "tdms", "mdf")
"""Modules whose libraries cannot be trusted with a damaged file: see `apart`."""

SUFFIXES = tuple(suffix for suffixes in _READERS.values() for suffix in suffixes)
"""Endings of files that swashplate reads itself."""

GROUP = "swashplate.readers"
"""Entry points by which other packages offer readers for more endings."""


def open_log(path: str | Path, *, options: TextOptions | None = None) -> Log:
    """Look into a log file; columns are read when they are asked for.

    Parameters
    ----------
    path : path
        Its ending says what it is: text (CSV and its kin), Parquet, MATLAB (all versions), HDF5,
        TDMS, MDF 4, or what an installed package reads.
    options : TextOptions, optional
        How a text file is written, where that cannot be told from it.

    Returns
    -------
    Log
        Its columns by name, and `Log.read`.

    Raises
    ------
    FileError
        If it is missing, empty, of an unknown or another kind, damaged, or needs an extra that is
        not installed; one sentence, which names the file.
    """
    source = Path(path)
    suffix = source.suffix.lower()
    module = next((name for name, suffixes in _READERS.items() if suffix in suffixes), None)
    if module is None:
        reader = _other(source)
        check_file(source)
        return reader.open(source, options or TextOptions())
    check_file(source)
    if module in _APART:
        return open_apart(module, source)
    own: Reader = import_module(f"swashplate.logs.{module}")
    return own.open(source, options or TextOptions())


def _other(path: Path) -> Reader:
    suffix = path.suffix.lower()
    others = _others()
    for other in others:
        if suffix in other.suffixes:
            return other
    if path.is_dir():
        raise FileError(f"{path} is a folder, not a log.")
    known = ", ".join((*SUFFIXES, *(each for other in others for each in other.suffixes)))
    raise FileError(f"{path} ends in '{path.suffix}'; a log is read from {known}.")


def _others() -> list[Reader]:
    readers = []
    for entry in metadata.entry_points(group=GROUP):
        try:
            reader = entry.load()
        except (ImportError, AttributeError) as error:
            raise FileError(
                f"The reader '{entry.name}' of {entry.value} cannot be loaded: {error}."
            ) from None
        if not isinstance(reader, Reader):
            raise FileError(
                f"The reader '{entry.name}' of {entry.value} is none: it needs name, suffixes and "
                "open."
            )
        readers.append(reader)
    return readers


class Series(NamedTuple):
    """A time series read from a file, SI."""

    time: Array
    values: Array


def read_series(
    path: str | Path,
    column: str,
    unit: str,
    *,
    time_column: str = "time",
    options: TextOptions | None = None,
) -> Series:
    """Read time stamps and one column of a log, in SI.

    Parameters
    ----------
    path : path
        A log as `open_log` reads it. A column may carry its unit: ``time [ms]``, ``voltage_mV``,
        in a row of units or in an attribute.
    column, unit : str
        Column wanted, with or without its unit, and the SI unit wanted.
    time_column : str
        Column of the time stamps.
    options : TextOptions, optional
        As in `open_log`.

    Returns
    -------
    Series
        Time [s], increasing, and values, all finite, each of shape (n,).

    Raises
    ------
    FileError
        If the file cannot be read, a cell is no number, a number is missing or not finite, or time
        stamps do not increase; the sentence names file, column and row.
    InputError
        If a column is missing or its unit wrong; the sentence lists what there is.
    """
    log = open_log(path, options=options)
    read = log.read([time_column, column])
    time, values = read[time_column], read[column]
    if time.size != values.size:
        raise FileError(
            f"{log.path}: '{time_column}' has {time.size} rows and '{column}' has {values.size}; "
            "they must have as many."
        )
    check_stamps(log, time_column, time)
    check_finite(log, column, values)
    return Series(_si(log, time_column, "s", time), _si(log, column, unit, values))


def _si(log: Log, wanted: str, si: str, values: Array) -> Array:
    found = log.find(wanted)
    unit = unit_of(found, wanted, si)
    unit = speed_unit(unit) if si == "rad/s" else unit
    what = f"{log.path}: column '{found.name}'"
    zero, one = (to_si(value, unit, si, what) for value in (0.0, 1.0))
    return values * one if zero == 0.0 else values * (one - zero) + zero
