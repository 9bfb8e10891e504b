"""Tables out: CSV and Parquet, whole or not at all."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from secrets import token_hex
from typing import TYPE_CHECKING, NamedTuple

from swashplate.errors import FileError

if TYPE_CHECKING:
    import polars


class Form(NamedTuple):
    """A sort of file, and the endings that its names may have."""

    what: str
    """In words, with an article: ``"a table"``."""
    endings: tuple[str, ...]
    also: tuple[str, ...] = ()
    """Endings that are taken without being offered."""


class Tabular(ABC):
    """A result that is a table."""

    @abstractmethod
    def to_polars(self) -> polars.DataFrame:
        """The table, SI."""

    def write(self, path: str | Path) -> None:
        """Write the table of `to_polars` as CSV or Parquet, by the path's ending.

        The file appears whole or not at all: it is written beside and renamed.

        Raises
        ------
        FileError
            For another ending, or a folder that cannot be written.
        """
        write_table(self.to_polars(), path)


TABLE = Form("a table", (".csv", ".parquet"), (".pq",))
FIGURE = Form("a figure", (".png", ".svg", ".pdf"))


def ending(path: str | Path, form: Form) -> str:
    """Ending of a path in small letters, with its dot.

    Raises
    ------
    FileError
        If the form has no such ending.
    """
    suffix = Path(path).suffix
    if suffix.lower() not in (*form.endings, *form.also):
        known = f"{', '.join(form.endings[:-1])} or {form.endings[-1]}"
        raise FileError(f"{path} ends in '{suffix}'; {form.what} is written as {known}.")
    return suffix.lower()


def check_place(path: str | Path) -> None:
    """See to it that a file can be where it shall be, as far as that shows beforehand.

    Raises
    ------
    FileError
        If its folder does not exist, or a folder has its name.
    """
    target = Path(path)
    folder = target.parent
    reason = None
    try:
        if not folder.exists():
            reason = f"folder {folder} does not exist"
        elif not folder.is_dir():
            reason = f"{folder} is no folder"
        elif target.is_dir():
            reason = "it is a folder"
        elif not os.access(folder, os.W_OK):
            reason = f"folder {folder} may not be written to"
    except OSError as error:  # such as a name that is too long
        reason = error.strerror or str(error)
    if reason is not None:
        raise FileError(f"{target} cannot be written: {reason}.")


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
    check_place(target)
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
    if ending(path, TABLE) == ".csv":
        write_whole(path, lambda beside: table.write_csv(beside))
    else:
        write_whole(path, lambda beside: table.write_parquet(beside))
