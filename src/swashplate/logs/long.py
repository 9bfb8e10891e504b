"""Logs of more rows than are held at once: text is converted once to Parquet, read in parts."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swashplate.errors import FileError
from swashplate.logs.apart import open_apart
from swashplate.logs.log import Log, said

if TYPE_CHECKING:
    import polars

LONG = 2_000_000
"""Rows beyond which a log is not held whole."""
_GROUP = 1 << 18  # rows that are stored together, and found without those before them
_KEY = "swashplate"


def in_parts(log: Log, names: Sequence[str]) -> Log:
    """A log whose rows can be read in parts if it is long; a short one as it is.

    A long text log is converted to Parquet once, piece after piece: ``log.csv.parquet`` beside it
    holds the columns asked for, and serves until the log changes. Formats that cannot be read in
    parts stay as they are.

    Parameters
    ----------
    log : Log
        As `open_log` gives it.
    names : sequence of str
        Columns that will be read, as in `Log.find`.

    Raises
    ------
    FileError
        If a cell holds no number, or the table cannot be written.
    """
    if log.rows is None or log.rows <= LONG or log.stream is None:
        return log
    table = log.path.with_name(f"{log.path.name}.parquet")
    columns = list(dict.fromkeys(log.columns.index(log.find(name)) for name in names))
    stat = log.path.stat()
    stamp = [stat.st_size, stat.st_mtime_ns, log.format]
    held = _held(table)
    if held is None or held[:3] != stamp or not {*columns} <= {*held[3]}:
        columns = sorted({*columns, *(held[3] if held is not None and held[:3] == stamp else [])})
        _convert(log, columns, table, json.dumps([*stamp, columns]))
        held = [*stamp, columns]
    stored = open_apart("channels.PARQUET", table)
    note = f"Its {stored.rows} rows are read from {table.name}, written beside it."
    kept = tuple(log.columns[position] for position in held[3])
    return replace(
        stored, path=log.path, columns=kept, comments=log.comments, notes=(*log.notes, note)
    )


def _held(table: Path) -> list[Any] | None:
    """Size, time and format of the log that a table was made of, and positions of its columns."""
    import polars as pl

    if not table.is_file():
        return None
    try:
        held = json.loads(pl.read_parquet_metadata(table).get(_KEY, "null"))
    except (pl.exceptions.PolarsError, ValueError, OSError):
        return None
    if held is None:
        raise FileError(f"{table} stands where the table of a long log belongs; rename it.")
    return list(held)


def _convert(log: Log, columns: Sequence[int], table: Path, stamp: str) -> None:
    import polars as pl
    from polars.io.plugins import register_io_source

    stream, names = log.stream, [str(position) for position in columns]
    failed: list[FileError] = []

    def pieces(
        wanted: list[str] | None, predicate: object, count: object, size: object
    ) -> Iterator[polars.DataFrame]:
        assert stream is not None
        try:
            for arrays in stream(columns):
                yield pl.DataFrame(dict(zip(names, arrays, strict=True)))
        except FileError as error:  # Polars would tell of it in words of its own
            failed.append(error)
            raise

    partial = table.with_name(f"{table.name}.part")
    source = register_io_source(pieces, schema=dict.fromkeys(names, pl.Float64()))
    try:
        source.sink_parquet(partial, row_group_size=_GROUP, metadata={_KEY: stamp})
        partial.replace(table)
    except (pl.exceptions.PolarsError, OSError) as error:
        raise (
            failed[0]
            if failed
            else FileError(
                f"{log.path} has about {log.rows} rows, more than are held at once, and its table "
                f"{table.name} cannot be written beside it: {said(error)}."
            )
        ) from None
    finally:
        partial.unlink(missing_ok=True)
