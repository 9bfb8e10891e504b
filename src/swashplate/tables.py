"""Tables out: CSV and Parquet, whole or not at all."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from secrets import token_hex
from typing import TYPE_CHECKING

from swashplate.errors import FileError

if TYPE_CHECKING:
    import polars


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
