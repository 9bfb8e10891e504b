"""Logs of which parts are read: held in memory, or converted to a Parquet table once."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from swashplate.errors import FileError
from swashplate.logs.log import Array, Log, first_sentence
from swashplate.logs.subprocess_reader import open_in_subprocess

if TYPE_CHECKING:
    import polars

MOST_HELD = 4_000_000
"""Rows of a text log beyond which its columns are not held whole while parts of it are read: 32 MB
for each column, two hours at 512 Hz."""
_GROUP = 1 << 18  # rows that are stored together, and found without those before them
_KEY = "swashplate"
_ZERO = "one zero"
"""From where the dates of a table count; those of older tables count from each column's first."""


def in_parts(log: Log, names: Sequence[str]) -> Log:
    """A log whose rows can be read in parts, each without reading the others again.

    Of a text log, the columns of these names (as in `Log.find`). They are held in memory; of one
    of more rows than `MOST_HELD` they are converted to Parquet once, piece after piece:
    ``log.csv.parquet`` next to it serves until the log changes. Other formats are as they are.
    """
    import polars as pl

    if log.stream is None:
        return log
    if max(log.lengths, default=0) <= MOST_HELD:
        return _held(log, names)
    table = log.path.with_name(f"{log.path.name}.parquet")
    columns = {log.columns.index(log.find(name)) for name in names}
    stat = log.path.stat()
    stamp, made_of = [stat.st_size, stat.st_mtime_ns, log.format, _ZERO], []
    with suppress(pl.exceptions.PolarsError, ValueError, OSError):
        # size, time and format of the log that a table was made of, and places of its columns
        made_of = json.loads(pl.read_parquet_metadata(table).get(_KEY, "null"))
    if made_of is None:
        raise FileError(f"{table} has the name of the table of a long log; rename it.")
    stored: list[int] = made_of[-1] if made_of[:-1] == stamp else []
    if not columns <= {*stored}:
        stored = sorted(columns.union(stored))
        _convert(log, stored, table, json.dumps([*stamp, stored]))
    stored_columns = tuple(log.columns[position] for position in stored)
    return replace(
        open_in_subprocess("Parquet", table), path=log.path, columns=stored_columns, table=table
    )


def _held(log: Log, names: Sequence[str]) -> Log:
    """A log of the columns of some names only, which are in memory."""
    columns = tuple(dict.fromkeys(log.find(name) for name in names))
    arrays = [*log.read([column.name for column in columns]).values()]

    def load(positions: Sequence[int], first: int = 0, last: int | None = None) -> list[Array]:
        blocks = [arrays[position][first:last] for position in positions]
        # a part must not keep all the rest in memory
        return [part if part.size == arrays[0].size else part.copy() for part in blocks]

    return replace(
        log,
        columns=columns,
        load=load,
        lengths=tuple(array.size for array in arrays),
        stream=None,
    )


def _convert(log: Log, columns: Sequence[int], table: Path, stamp: str) -> None:
    import polars as pl
    from polars.io.plugins import register_io_source

    stream, names = log.stream, [str(position) for position in columns]
    failed: list[FileError] = []

    def pieces(*_: object) -> Iterator[polars.DataFrame]:
        assert stream is not None
        try:
            for arrays in stream(columns):
                yield pl.DataFrame(dict(zip(names, arrays, strict=True)))
        except FileError as error:  # Polars would report it in words of its own
            failed.append(error)
            raise

    partial = table.with_name(f"{table.name}.part")
    source = register_io_source(pieces, schema=dict.fromkeys(names, pl.Float64()))
    try:
        source.sink_parquet(partial, row_group_size=_GROUP, metadata={_KEY: stamp})
        partial.replace(table)
    except (pl.exceptions.PolarsError, OSError) as error:
        if failed:
            raise failed[0] from None
        raise FileError(
            f"{log.path} has about {max(log.lengths)} rows, more than are kept in memory, and its "
            f"table {table.name} cannot be written next to it: {first_sentence(error)}."
        ) from None
    finally:
        partial.unlink(missing_ok=True)
