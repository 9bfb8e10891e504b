"""Logs as Parquet tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from swashplate.errors import FileError
from swashplate.logs.damage import PARQUET, Reading, check_kind, left_out_notes
from swashplate.logs.log import Array, Column, Log, split_unit
from swashplate.logs.text import TextOptions
from swashplate.logs.text.cells import NoNumber, numbers_of, shown

if TYPE_CHECKING:
    import polars

name = "Parquet"
suffixes = (".parquet", ".pq")

_KEPT = 500  # letters of an entry of the metadata that are kept as a comment


def open(path: Path, options: TextOptions) -> Log:
    """Look into a Parquet file: its columns of numbers, dates, durations and text.

    Dates and times become seconds since the first of the column, durations seconds.

    Raises
    ------
    FileError
        If it is damaged, of another kind, or has no columns of numbers.
    """
    import polars as pl

    check_kind(path, "Parquet")
    _check_ends(path)
    with Reading(path, "Parquet", _errors()):
        schema = pl.read_parquet_schema(path)
        metadata = pl.read_parquet_metadata(path)
    columns, left_out = [], {}
    for column, kind in schema.items():
        if kind.is_numeric() or kind.is_temporal() or kind in (pl.Boolean, pl.String):
            seconds = kind.is_temporal()
            columns.append(Column(column, "s" if seconds else split_unit(column)[1]))
        else:
            left_out[column] = f"it is of the type {kind}"
    if not columns:
        raise FileError(f"{path} has no columns of numbers.")
    dated = [each for each, kind in schema.items() if kind in (pl.Date, pl.Datetime)]
    notes = [f"'{each}' holds dates, read as seconds since the first." for each in dated]
    notes += left_out_notes(left_out)
    comments = tuple(
        f"{key}: {value}"
        for key, value in metadata.items()
        if len(value) <= _KEPT and not key.startswith("ARROW:")
    )

    def load(positions: Sequence[int]) -> list[Array]:
        # one column after the other: none that is done waits in the form that Polars reads it in
        return [_numbers(path, columns[position].name) for position in positions]

    return Log(path, "Parquet", tuple(columns), load, comments, tuple(notes), left_out)


def _errors() -> tuple[type[BaseException], ...]:
    import polars as pl

    # Polars panics at some damage; that is an exception beside all others
    return pl.exceptions.PolarsError, pl.exceptions.PanicException


def _check_ends(path: Path) -> None:
    with path.open("rb") as file:
        first = file.read(4)
        size = file.seek(0, 2)
        file.seek(max(size - 8, 0))
        last = file.read(8)
    if first != PARQUET:
        raise FileError(f"{path} is no Parquet file.")
    footer = int.from_bytes(last[:4], "little")
    if last[4:] != PARQUET or footer > size - 12:
        raise FileError(f"{path} has no end; it was cut off.")


def _numbers(path: Path, column: str) -> Array:
    import polars as pl

    with Reading(path, "Parquet", _errors()):
        cells = pl.scan_parquet(path).select(column).collect()[column]
        if cells.dtype == pl.String:
            numbers = numbers_of(cells, ".")
            if isinstance(numbers, NoNumber):
                raise FileError(
                    f"{path}: column '{column}' holds '{shown(numbers.cell)}', which is no number, "
                    f"in data row {numbers.row + 1}."
                )
            return numbers
        if cells.dtype.is_temporal():
            return _seconds(cells)
        return cells.cast(pl.Float64).to_numpy()


def _seconds(cells: polars.Series) -> Array:
    import polars as pl

    if cells.dtype == pl.Duration:
        ticks, first = cells.dt.total_nanoseconds(), 0
    elif cells.dtype == pl.Time:
        ticks, first = cells.cast(pl.Int64), 0
    else:
        ticks = cells.cast(pl.Datetime("ns")).dt.epoch("ns")
        first = next(iter(ticks.drop_nulls().head(1)), 0)
    # subtracted as integers: a double of nanoseconds since 1970 would be 256 ns coarse
    seconds = (ticks - first).cast(pl.Float64) / 1e9
    return np.asarray(seconds.to_numpy(), np.float64)
