"""What a log file is to its readers: named columns, read on demand."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import FileError, InputError
from swashplate.logs.damage import printable
from swashplate.logs.lookup import find_column

if TYPE_CHECKING:
    from swashplate.logs.text.options import TextOptions

Array = NDArray[np.float64]


class Column(NamedTuple):
    """A column of a log."""

    name: str
    """As the file has it, a unit in brackets included."""
    unit: str | None = None
    """As written in the header, in a row of units or in an attribute; None where there is none."""


@dataclass(frozen=True, eq=False)
class Log:
    """A log file that was looked into; its numbers stay in the file until they are asked for.

    Parameters
    ----------
    path : Path
        The file.
    format : str
        What it was read as, for people: ``CSV, semicolons, decimal comma``.
    columns : tuple of Column
        The columns that hold numbers; in text, all columns.
    load : callable
        Given positions in `columns`, each once, reads those columns, in that order.
    comments : tuple of str
        Comment lines, lines before the header, attributes of the file.
    notes : tuple of str
        What was assumed or skipped, one sentence each.
    left_out : mapping of str to str
        What the file has besides and cannot be read as numbers: name and reason.
    """

    path: Path
    format: str
    columns: tuple[Column, ...]
    load: Callable[[Sequence[int]], Sequence[Array]] = field(repr=False)
    comments: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    left_out: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Make all that may get into a sentence printable: names are what a file says they are."""
        columns = tuple(
            Column(printable(name), unit and printable(unit)) for name, unit in self.columns
        )
        left_out = {printable(name): printable(why) for name, why in self.left_out.items()}
        object.__setattr__(self, "columns", columns)
        object.__setattr__(self, "left_out", left_out)
        object.__setattr__(self, "comments", tuple(map(printable, self.comments)))
        object.__setattr__(self, "notes", tuple(map(printable, self.notes)))

    def find(self, wanted: str) -> Column:
        """The column of a name.

        Parameters
        ----------
        wanted : str
            As in the file; or without its unit (``time`` for ``time [ms]``, ``time (ms)`` and
            ``time_ms``); or without its group, where no other column has the same last part.

        Raises
        ------
        InputError
            If there is none or more than one; the sentence lists what there is.
        """
        return self.columns[self._position(wanted)]

    def read(self, names: Sequence[str]) -> dict[str, Array]:
        """Read columns, in the file's own units.

        Parameters
        ----------
        names : sequence of str
            Names as in `find`.

        Returns
        -------
        dict of str to array, shape (n,)
            By the names that were asked for. An empty cell or the text NaN is NaN; a whole number
            or a decimal fraction is the nearest double. Columns of one file may differ in length,
            except in text and Parquet.

        Raises
        ------
        FileError
            If the file is damaged or a cell holds no number; it names file, column and row.
        InputError
            If a column is missing.
        """
        names = (names,) if isinstance(names, str) else names
        positions = {name: self._position(name) for name in names}
        unique = list(dict.fromkeys(positions.values()))
        if not unique:
            return {}
        arrays = dict(zip(unique, self.load(unique), strict=True))
        return {name: arrays[position] for name, position in positions.items()}

    def _position(self, wanted: str) -> int:
        try:
            return find_column(self.columns, wanted, self.path)
        except InputError:
            for name, reason in self.left_out.items():
                if wanted in (name, name.rpartition("/")[2]):
                    raise FileError(
                        f"{self.path}: '{name}' cannot be read as numbers: {reason}."
                    ) from None
            raise


@runtime_checkable
class Reader(Protocol):
    """What reads one format; a module or an object that has these three.

    A package of your own offers one as an entry point of the group ``swashplate.readers``; it then
    serves the endings that swashplate itself does not know.
    """

    name: str
    """Of the format, for people."""
    suffixes: tuple[str, ...]
    """Endings of its files, lower case: ``(".csv", ".tsv")``."""

    def open(self, path: Path, options: TextOptions) -> Log:
        """Look into a file that exists and is not empty, without reading its columns.

        Raises
        ------
        FileError
            If it is not of this format or damaged.
        """
        ...
