"""Time stamps and one signal of a log, in SI."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from swashplate.errors import FileError
from swashplate.logs.log import Array, Log
from swashplate.logs.lookup import unit_of
from swashplate.logs.opening import open_log
from swashplate.logs.stamps import check_finite, check_stamps
from swashplate.logs.text.options import TextOptions
from swashplate.units import speed_unit, to_si


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
