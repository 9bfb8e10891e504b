"""What a log file is: named columns with units, read on demand, and checked before use."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import FileError, InputError
from swashplate.logs.damage import printable
from swashplate.units import to_si

if TYPE_CHECKING:
    from swashplate.logs.text import TextOptions

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


# --- columns by name, and their units -------------------------------------------------------------

_BRACKETED = re.compile(r"(.*?)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))\s*", re.DOTALL)
_NO_UNIT = frozenset({"", "-", "–", "−", "1", "none", "None"})
_LISTED = 30


def split_unit(name: str) -> tuple[str, str | None]:
    """A header's name and the unit in brackets behind it: ``time [ms]``, ``time (ms)``."""
    match = _BRACKETED.fullmatch(name)
    if match is None or not match[1]:
        return name, None
    return match[1], (match[2] if match[2] is not None else match[3]).strip()


def find_column(columns: Sequence[Column], wanted: str, path: str | Path) -> int:
    """Position of the column of a name; see `Log.find`.

    Raises
    ------
    InputError
        If there is none or more than one; the sentence lists what there is.
    """
    names = [column.name for column in columns]
    suffixed = re.compile(rf"{re.escape(wanted)}_\w+")
    for matches in (
        lambda column: column.name == wanted,
        lambda column: _without_unit(column) == wanted,
        lambda column: suffixed.fullmatch(column.name),
        lambda column: _last(column.name) == wanted or _last(_without_unit(column)) == wanted,
    ):
        found = [position for position, column in enumerate(columns) if matches(column)]
        if len(found) == 1:
            return found[0]
        if found:
            several = _listed([names[position] for position in found])
            raise InputError(f"{path} has more than one '{wanted}': {several}; name the one.")
    raise InputError(
        f"{path} has no column '{wanted}'; it has {_listed(names)}: name the one to take."
    )


def unit_of(column: Column, wanted: str, si: str) -> str:
    """Unit that a column is in, as far as the log tells, or the SI unit.

    Parameters
    ----------
    column : Column
        What `Log.find` returned.
    wanted : str
        The name that it was asked by.
    si : str
        SI unit of what it shall be. A name like ``time_ms`` means milliseconds where that is a
        unit of the same quantity, and is just a name otherwise.

    Returns
    -------
    str
        Its own unit; or the ending of its name; or `si` where the log has no unit.
    """
    if column.unit is not None:
        return "1" if column.unit in _NO_UNIT else column.unit
    suffixed = re.fullmatch(rf"{re.escape(wanted)}_(\w+)", column.name)
    if suffixed:
        return suffixed[1]
    _, underscore, ending = column.name.rpartition("_")
    if underscore and ending != si and _measures(ending, si):
        return ending
    return si


def _measures(unit: str, si: str) -> bool:
    try:
        to_si(1.0, unit, si, "")
    except InputError:
        return False
    return True


def _without_unit(column: Column) -> str:
    # x(1,:) is a row of a matrix and no x in the unit 1,:
    name, unit = split_unit(column.name)
    return name if unit is not None and unit == column.unit else column.name


def _last(name: str) -> str:
    return name.rpartition("/")[2]


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(repr(each) for each in names[:_LISTED])
    return shown if len(names) <= _LISTED else f"{shown} and {len(names) - _LISTED} more"


# --- numbers that can be computed with ------------------------------------------------------------


def check_stamps(log: Log, column: str, stamps: Array) -> None:
    """Refuse time stamps that are missing, not finite, or do not increase.

    Parameters
    ----------
    log : Log
        Where they are from.
    column : str
        Its name, for the sentence.
    stamps : array, shape (n,)
        In the file's own unit; there must be at least one.

    Raises
    ------
    FileError
        The sentence names file, column and data row; the first row is 1.
    """
    check_finite(log, column, stamps)
    late = np.flatnonzero(np.diff(stamps) <= 0.0)
    if not late.size:
        return
    row = int(late[0])
    before, after = float(stamps[row]), float(stamps[row + 1])
    what = (
        f"has {before!r} twice, in data rows {row + 1} and {row + 2}"
        if before == after
        else f"goes back from {before!r} to {after!r} in data row {row + 2}"
    )
    others = f", the first of {late.size} such rows" if late.size > 1 else ""
    raise FileError(f"{log.path}: column '{column}' {what}{others}; time stamps must increase.")


def check_finite(log: Log, column: str, values: Array) -> None:
    """Refuse a column with a number missing, or not finite.

    Parameters
    ----------
    log : Log
        Where it is from.
    column : str
        Its name, for the sentence.
    values : array, shape (n,)
        There must be at least one.

    Raises
    ------
    FileError
        The sentence names file, column and data row; the first row is 1.
    """
    if not values.size:
        raise FileError(f"{log.path}: column '{column}' has no rows.")
    missing = np.flatnonzero(np.isnan(values))
    if missing.size:
        raise FileError(
            f"{log.path}: column '{column}' is empty or NaN in {_rows(missing)}; "
            "a number must be in every row."
        )
    infinite = np.flatnonzero(np.isinf(values))
    if infinite.size:
        raise FileError(
            f"{log.path}: column '{column}' holds {float(values[infinite[0]])!r} in "
            f"{_rows(infinite)}; numbers must be finite."
        )


def _rows(wrong: np.ndarray[tuple[int, ...], np.dtype[np.intp]]) -> str:
    """The first run of rows, and how many there are besides."""
    first = int(wrong[0])
    gaps = np.flatnonzero(np.diff(wrong) > 1)
    run = int(gaps[0]) + 1 if gaps.size else wrong.size
    rows = f"data row {first + 1}" if run == 1 else f"data rows {first + 1} to {first + run}"
    return rows if run == wrong.size else f"{rows} and {wrong.size - run} more"


# --- signals of arrays ----------------------------------------------------------------------------

MOST = 4096
"""Signals in one matrix; one with more of both rows and columns is a picture or a map."""


class Signal(NamedTuple):
    """One signal of an array: all of a vector, or a row or a column of a matrix."""

    name: str
    axis: int | None
    """Dimension along which it is chosen, None for a vector."""
    place: int
    """Position along that dimension, from 0."""


def signals(name: str, shape: tuple[int, ...], *, matlab: bool) -> list[Signal] | str:
    """Signals of an array, or why there are none.

    Parameters
    ----------
    name : str
        Of the array.
    shape : tuple of int
        In the order of its own language. The longer dimension is taken for the time.
    matlab : bool
        Whether signals are called ``x(1,:)`` and ``x(:,1)`` as in MATLAB or ``x[0,:]`` and
        ``x[:,0]`` as in Python.
    """
    if 0 in shape:
        return "it is empty"
    if len(shape) > 2:
        return f"it has {len(shape)} dimensions"
    if len(shape) < 2 or 1 in shape:
        return [Signal(name, None, 0)]
    rows, columns = shape
    axis, count = (1, columns) if rows >= columns else (0, rows)
    if count > MOST:
        return f"it is a matrix of {rows} by {columns}"
    first = 1 if matlab else 0
    form = ("({},:)", "(:,{})") if matlab else ("[{},:]", "[:,{}]")
    return [Signal(name + form[axis].format(place + first), axis, place) for place in range(count)]
