"""Tables in and out: CSV and Parquet, whole or not at all."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from secrets import token_hex
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import FileError, InputError
from swashplate.units import to_si

if TYPE_CHECKING:
    import polars

Array = NDArray[np.float64]


class Series(NamedTuple):
    """A time series read from a file, SI."""

    time: Array
    values: Array


def write_whole(path: str | Path, write: Callable[[Path], None]) -> None:
    """Have a file written beside its place and renamed when it is complete.

    Parameters
    ----------
    path : path
        Where the file shall be.
    write : callable
        Writes the file at the path that it is given, which has the same ending.

    Raises
    ------
    FileError
        If it cannot be written; nothing is left behind and an older file stays.
    """
    target = Path(path)
    beside = target.parent / f".{target.stem}-{token_hex(4)}{target.suffix}"
    try:
        try:
            beside.touch(exist_ok=False)
            write(beside)
            beside.replace(target)
        finally:
            try:
                beside.unlink(missing_ok=True)
            except KeyboardInterrupt:
                # on Ctrl-C Polars raises one of its own and leaves Python's to come: it comes here
                beside.unlink(missing_ok=True)
                raise
    except OSError as error:
        raise FileError(f"{target} cannot be written: {error.strerror or error}.") from None


def write_text(text: str, path: str | Path) -> None:
    """Write UTF-8 text, whole or not at all."""

    def write(beside: Path) -> None:
        beside.write_text(text, "utf-8")

    write_whole(path, write)


def write_table(table: polars.DataFrame, path: str | Path) -> None:
    """Write a table as CSV or Parquet, by the path's ending.

    Raises
    ------
    FileError
        For another ending or a place that cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".csv":
        write_whole(path, lambda beside: table.write_csv(beside))
    elif suffix in (".parquet", ".pq"):
        write_whole(path, lambda beside: table.write_parquet(beside))
    else:
        raise FileError(f"{path} ends in '{suffix}'; a table is written as .csv or .parquet.")


def read_table(path: str | Path) -> polars.DataFrame:
    """Read a CSV table, all columns as text, or a Parquet table.

    Raises
    ------
    FileError
        If it is missing, empty, of another kind, or malformed; the sentence names the file.
    """
    import polars as pl

    source = Path(path)
    suffix = source.suffix.lower()
    if suffix not in (".csv", ".parquet", ".pq"):
        raise FileError(f"{source} ends in '{suffix}'; a record is read from .csv or .parquet.")
    if source.is_dir():
        raise FileError(f"{source} is a folder, not a table.")
    try:
        if suffix == ".csv":
            # as text: a column that begins with whole numbers may well go on with others, and
            # only the columns that are asked for need to be numbers
            table = pl.read_csv(source, infer_schema=False)
            if table.width == 1 and ";" in table.columns[0]:
                raise FileError(f"{source} is separated by semicolons; separate by commas.")
            return table
        return pl.read_parquet(source)
    except FileNotFoundError:
        raise FileError(f"There is no file {source}.") from None
    except pl.exceptions.NoDataError:
        raise FileError(f"{source} is empty.") from None
    except (OSError, pl.exceptions.PolarsError) as error:
        first = str(error).splitlines()[0].rstrip(".")
        if "more fields than defined" in first:
            first = "a row has more fields than the header, or decimals are written with commas"
        raise FileError(f"{source} cannot be read as a table: {first}.") from None


def read_series(path: str | Path, column: str, unit: str, *, time_column: str = "time") -> Series:
    """Read time stamps and one column of a table, in SI.

    Parameters
    ----------
    path : path
        CSV or Parquet with a header. A column may carry its unit: ``time [ms]``, ``voltage_mV``.
    column, unit : str
        Column wanted, with or without its unit, and the SI unit wanted.
    time_column : str
        Column of the time stamps.

    Raises
    ------
    FileError
        If the file cannot be read, or a cell is not a number; the sentence names file and row.
    InputError
        If a column is missing or its unit wrong; the sentence lists what there is.
    """
    table = read_table(path)
    return Series(
        _column(table, path, time_column, "s"),
        _column(table, path, column, unit),
    )


def _column(table: polars.DataFrame, path: str | Path, wanted: str, si: str) -> Array:
    import polars as pl

    name, unit = _find(table.columns, wanted, si, path)
    cells = table[name]
    text = cells.dtype == pl.String
    numbers = (cells.str.strip_chars() if text else cells).cast(pl.Float64, strict=False)
    missing = numbers.is_null()
    if missing.any():
        row = int(missing.arg_max() or 0)
        cell = cells[row]
        said = "is empty" if cell is None else f"holds '{cell}', which is no number"
        raise FileError(f"{path}: column '{name}' {said} in data row {row + 1}.")
    factor = to_si(1.0, unit, si, f"{path}: column '{name}'")
    values: Array = numbers.to_numpy() * factor
    return values


def _find(columns: list[str], wanted: str, si: str, path: str | Path) -> tuple[str, str]:
    """The column of a name, and its unit: as asked, or ``name [unit]``, or ``name_unit``."""
    if wanted in columns:
        match = re.fullmatch(r".*\[(.+)\]\s*", wanted)
        return wanted, match.group(1).strip() if match else si
    for name in columns:
        match = re.fullmatch(rf"{re.escape(wanted)}(?:\s*\[(.+)\]\s*|_(\w+))", name)
        if match:
            return name, (match.group(1) or match.group(2)).strip()
    raise InputError(
        f"{path} has no column '{wanted}'; it has {', '.join(repr(each) for each in columns)}. "
        "Name the one to take."
    )
