"""Log files opened by their ending, and a time series read from one."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from swashplate.errors import FileError, MissingFileError
from swashplate.logs.clocks import Stamps, second_of_clock
from swashplate.logs.dialect import TextOptions
from swashplate.logs.log import (
    Array,
    Log,
    check_duration,
    check_finite,
    check_stamps,
    first_sentence,
    unit_of,
)
from swashplate.logs.subprocess_reader import open_in_subprocess
from swashplate.logs.text import open_text
from swashplate.units import scaling, speed_unit

ENDINGS = {
    "CSV": (".csv", ".tsv", ".txt", ".dat", ".asc", ".log"),
    "Parquet": (".parquet", ".pq"),
    "MATLAB": (".mat",),
    "HDF5": (".h5", ".hdf5", ".hdf", ".he5"),
    "TDMS": (".tdms",),
    "MDF": (".mf4", ".mdf"),
}
"""Endings of the files of each format."""
SUFFIXES = tuple(suffix for suffixes in ENDINGS.values() for suffix in suffixes)
"""Endings of files that swashplate reads itself."""


def open_log(path: str | Path, *, options: TextOptions | None = None) -> Log:
    """Look into a log file; columns are read when they are asked for.

    Parameters
    ----------
    path : path
        Its ending says what it is: text (CSV and its kin), Parquet, MATLAB (all versions), HDF5,
        TDMS or MDF 4.
    options : TextOptions, optional
        How a text file is written, if that cannot be recognised from it.

    Returns
    -------
    Log
        Its columns by name, and `Log.read`.

    Raises
    ------
    FileError
        If it is missing, empty, of an unknown or another kind, damaged, or needs an extra that is
        not installed; one sentence, which names the file.

    Examples
    --------
    >>> from swashplate import logs, maneuvers, rig
    >>> file = rig.write(rig.run("hoist", {"step": maneuvers.step(9.0)}), "tests")
    >>> log = logs.open_log("tests/hoist_step.csv")
    >>> [column.name for column in log.columns]
    ['time', 'voltage', 'current', 'counts']
    """
    source = Path(path)
    suffix = source.suffix.lower()
    name = next((name for name, suffixes in ENDINGS.items() if suffix in suffixes), "")
    why = "" if name else f"ends in '{source.suffix}'; a log is read from {', '.join(SUFFIXES)}"
    if suffix.startswith(".xls"):
        why += ": save a spreadsheet as CSV"
    _check_readable(source, why)
    if name != "CSV":
        return open_as(name, source)
    return open_text(source, options)


def open_as(format: str, path: str | Path) -> Log:
    """Look into a binary file of a format, whatever its ending, in a process of its own.

    Parameters
    ----------
    format : str
        One of `ENDINGS`, but CSV; or ``"Capytaine"``, whose columns are ``wave_direction`` [rad],
        ``omega`` [rad/s], ``motion`` (1 to 6, surge to yaw), ``re`` and ``im``, a row for each.
    path : path
        The file; a `FileError` as of `open_log`.
    """
    source = Path(path)
    _check_readable(source)
    return open_in_subprocess(format, source)


def _check_readable(source: Path, why: str = "") -> None:
    """Refuse a folder, a file of an unsuitable name, and what is not an ordinary, full file."""
    try:
        if source.is_dir():
            why = "is a folder, not a log"
        elif not why and source.exists() and not source.is_file():
            why = "is not an ordinary file"
        elif not why:
            with source.open("rb") as file:
                why = "" if file.read(1) else "is empty"
    except FileNotFoundError:
        raise MissingFileError(f"There is no file {source}.") from None
    except (OSError, ValueError) as error:
        why = f"cannot be read: {getattr(error, 'strerror', None) or first_sentence(error)}"
    if why:
        raise FileError(f"{source} {why}.")


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
    r"""Read time stamps and one column of a log, in SI.

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
        If the file cannot be read, a cell is not a number, a number is missing or not finite, or
        time stamps do not increase; the sentence names file, column and row.
    InputError
        If a column is missing or its unit wrong; the sentence lists what there is.

    Examples
    --------
    >>> from pathlib import Path
    >>> from swashplate import logs
    >>> Path("log.csv").write_text("time [s],pressure [bar]\n0.0,20\n0.1,25\n", "utf-8") > 0
    True
    >>> logs.read_series("log.csv", "pressure", "Pa").values
    array([2000000., 2500000.])
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
    series = []
    for name, si in ((time_column, "s"), (column, unit)):
        log_column = log.find(name)
        stated_unit, what = unit_of(log_column, name, si), f"{log.path}: column '{log_column.name}'"
        stated_unit = speed_unit(stated_unit) if si == "rad/s" else stated_unit
        if name == time_column:
            factor, zero = second_of_clock(stated_unit, Stamps.of(time), what), 0.0
        else:
            factor, zero = scaling(stated_unit, si, what)
        series.append(factor * read[name] + zero)
    return Series(check_duration(log, f"column '{time_column}'", series[0]), series[1])
