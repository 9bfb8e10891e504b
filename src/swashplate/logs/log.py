"""Logs: files of named columns with units, read on demand and checked."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import FileError, InputError
from swashplate.units import to_si

Array = NDArray[np.float64]


class LogColumn(NamedTuple):
    """A column of a log."""

    name: str
    """Name in the file, a unit in brackets included."""
    unit: str | None = None
    """As written in the header, in a row of units or in an attribute; None if there is none."""


@dataclass(frozen=True, eq=False)
class Log:
    """A log file that was looked into; its numbers stay in the file until they are asked for."""

    path: Path
    format: str
    """Description of its format: ``CSV, semicolons, decimal comma``."""
    columns: tuple[LogColumn, ...]
    """The columns that hold numbers; in text, all columns."""
    load: Callable[[Sequence[int], int, int | None], Sequence[Array]] = field(repr=False)
    """Columns at some positions, each once, from a row to before a last one (None: to the end)."""
    left_out: Mapping[str, str] = field(default_factory=dict)
    """Other contents of the file, which are not numbers: name and reason."""
    lengths: tuple[int, ...] = field(default=(), repr=False)
    """Rows of each column; of text, about."""
    stream: Callable[[Sequence[int]], Iterator[list[Array]]] | None = field(
        default=None, repr=False
    )
    """Of text: columns at some positions, piece after piece."""
    table: Path | None = None
    """File that its rows are read from instead."""
    first: int = 0
    last: int | None = None
    """Rows that `read` gives, from the first to before the last one; None is the end."""

    def __post_init__(self) -> None:
        """Make all that may get into a sentence printable: names are what a file says they are."""
        columns = (
            LogColumn(printable(name), unit and printable(unit)) for name, unit in self.columns
        )
        left_out = {printable(name): printable(why) for name, why in self.left_out.items()}
        object.__setattr__(self, "columns", tuple(columns))
        object.__setattr__(self, "left_out", left_out)

    def find(self, requested: str) -> LogColumn:
        """The column of a name.

        Parameters
        ----------
        requested : str
            As in the file; or without its unit (``time`` for ``time [ms]``, ``time (ms)`` and
            ``time_ms``); or without its group, if no other column has the same last part.

        Raises
        ------
        InputError
            If there is none or more than one; the sentence lists what there is.
        FileError
            If it is there, but holds no numbers.
        """
        names = {column.name: _without_unit(column) for column in self.columns}
        suffixed = re.compile(rf"{re.escape(requested)}_\w+")
        matches: list[str] = []
        for candidates in (
            [name for name in names if name == requested],
            [name for name in names if name.lstrip("/") == requested.lstrip("/")],
            [name for name, bare in names.items() if bare == requested],
            [name for name in names if suffixed.fullmatch(name)],
            [
                name
                for name, bare in names.items()
                if requested in (_last_part(name), _last_part(bare))
            ],
        ):
            matches = matches or candidates
        for name, reason in self.left_out.items():
            if not matches and requested in (name, _last_part(name)):
                raise FileError(f"{self.path}: '{name}' cannot be read as numbers: {reason}.")
        listed = ", ".join(map(repr, (matches or list(names))[:_LISTED]))
        listed += f" and {len(names) - _LISTED} more" if len(matches or names) > _LISTED else ""
        if not matches:
            raise InputError(
                f"{self.path} has no column '{requested}'; it has {listed}: name the one to take."
            )
        if len(matches) > 1:
            raise InputError(
                f"{self.path} has more than one '{requested}': {listed}; name the one."
            )
        return next(column for column in self.columns if column.name == matches[0])

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
            If the file is damaged, a cell holds no number (it names file, column and row), or the
            columns together are larger than `MOST`.
        InputError
            If a column is missing.
        """
        positions = {name: self.columns.index(self.find(name)) for name in names}
        unique = list(dict.fromkeys(positions.values()))
        if not unique:
            return {}
        count = sum(self.lengths[position] for position in unique) if self.lengths else 0
        if self.last is None and count > MOST:
            raise FileError(
                f"{self.path} has {count} numbers in the {len(unique)} requested columns, more "
                f"than the {MOST} that are read at once; cut it into shorter logs, or sample it "
                "more slowly."
            )
        arrays = dict(zip(unique, self.load(unique, self.first, self.last), strict=True))
        return {name: arrays[position] for name, position in positions.items()}

    def rows_of(self, names: Iterable[str]) -> int | None:
        """Rows of some columns, None if they differ in length or it is not known."""
        positions = [self.columns.index(self.find(name)) for name in names if self.lengths]
        counts = {self.lengths[position] for position in positions}
        return counts.pop() if len(counts) == 1 else None


MOST = 100_000_000
"""Numbers that are read at once, 0.8 GB."""


# --- files ----------------------------------------------------------------------------------------


def printable(text: str) -> str:
    """A text for a sentence: what cannot be printed is replaced."""
    return "".join(character if character.isprintable() else "�" for character in text)


def first_sentence(error: BaseException) -> str:
    """The first sentence of an error's message, or what it is."""
    if isinstance(error, MemoryError):
        return "it needs more memory than there is"
    lines = str(error).strip().splitlines()
    first = printable(lines[0]) if lines else ""
    sentence = re.split(r"[.!?;](?:\s|$)", first, maxsplit=1)[0].strip()[:200]
    return sentence or type(error).__name__


_KINDS = {
    b"\x89HDF\r\n\x1a\n": "HDF5",
    b"PAR1": "Parquet",
    b"TDSm": "TDMS",
    b"MDF     ": "MDF",
    b"UnFinMF ": "MDF",
    b"MATLAB 5.0 MAT-file": "MATLAB",
    b"MATLAB 7.3 MAT-file": "MATLAB",
    b"PK\x03\x04": "Excel or zip",
    b"\xd0\xcf\x11\xe0": "Excel",
    b"\x1f\x8b": "gzip",
}


def check_kind(path: Path, *expected: str) -> None:
    """Refuse a file whose first bytes are those of a known kind but the `expected` ones."""
    with path.open("rb") as file:
        first = file.read(32)
    for magic, kind in _KINDS.items():
        if first.startswith(magic) and kind not in expected:
            raise FileError(
                f"{path} ends in '{path.suffix}' but holds {kind}; rename or convert it."
            )


# --- columns by name, and their units -------------------------------------------------------------

_BRACKETED = re.compile(r"(.*?)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))\s*", re.DOTALL)
_NO_UNIT = frozenset({"", "-", "–", "−", "1", "none", "None"})
_LISTED = 30


def split_unit(name: str) -> tuple[str, str | None]:
    """A header's name and the unit in brackets after it: ``time [ms]``, ``time (ms)``."""
    match = _BRACKETED.fullmatch(name)
    if match is None or not match[1]:
        return name, None
    return match[1], (match[2] if match[2] is not None else match[3]).strip()


def unit_of(column: LogColumn, requested: str, si: str) -> str:
    """Unit of a column that `Log.find` returned: its own, the ending of its name, or else `si`.

    A name like ``time_ms`` means milliseconds if that is a unit of the same quantity, or if
    it was asked for as ``time``, and is just a name otherwise.
    """
    if column.unit is not None:
        return "1" if column.unit in _NO_UNIT else column.unit
    suffixed = re.fullmatch(rf"{re.escape(requested)}_(\w+)", column.name)
    if suffixed:
        return suffixed[1]
    words = column.name.split("_")
    # "speed_deg_s" has a fraction at its end, "time_ms" a single word
    endings = ["/".join(words[-2:])] if len(words) > 2 else []
    endings += words[-1:] if len(words) > 1 else []
    for ending in endings:
        try:
            to_si(1.0, ending, si, "")
        except InputError:
            continue
        return ending
    return si


def _without_unit(column: LogColumn) -> str:
    # x(1,:) is a row of a matrix and no x in the unit 1,:
    name, unit = split_unit(column.name)
    return name if unit is not None and unit == column.unit else column.name


def _last_part(name: str) -> str:
    """The name without its groups."""
    return name.rpartition("/")[2]


# --- numbers that can be computed with ------------------------------------------------------------


def check_stamps(log: Log, column: str, stamps: Array) -> None:
    """Refuse time stamps (n,) of a column that are missing, not finite, or do not increase.

    The sentence names file, column and data row; the first row is 1.
    """
    check_finite(log, column, stamps)
    late = np.flatnonzero(np.diff(stamps) <= 0.0)
    if not late.size:
        return
    earlier, later = map(float, stamps[late[0] : late[0] + 2])
    row = log.first + int(late[0])
    what = f"goes back from {earlier!r} to {later!r} in data row {row + 2}"
    if earlier == later:
        what = f"has {earlier!r} twice, in data rows {row + 1} and {row + 2}"
    others = f", the first of {late.size} such rows" if late.size > 1 else ""
    remedy = ""
    if late.size > ROUNDED * stamps.size and np.all(np.diff(stamps) >= 0.0):
        remedy = (
            "; so coarsely rounded stamps of an even log are better left out: write time = { rate "
            "= ... } with its samples a second instead of their column"
        )
    raise FileError(
        f"{log.path}: column '{column}' {what}{others}; time stamps must increase{remedy}."
    )


ROUNDED = 0.05
"""Share of stamps that are there twice from which all are rounded: events are few. [1]"""
SHORTEST = 1e-6
"""A record lasts longer: below it the unit of its stamps is wrong. [s]"""
LONGEST = 1e10
"""A record lasts less: three centuries. [s]"""


def check_duration(log: Log, source: str, time: Array) -> Array:
    """Increasing time stamps [s] by some source, refused unless they span what a record lasts."""
    span = float(time[-1]) - float(time[0]) if time.size > 1 else 1.0
    if not SHORTEST < span < LONGEST:
        raise FileError(
            f"{log.path}: its {time.size} rows last {span:.3g} s by {source}; check the unit or "
            "the rate."
        )
    return time


def check_finite(log: Log, column: str, values: Array) -> None:
    """Refuse a column (n,) without rows, with a number missing, or one that is not finite."""
    wrong = np.flatnonzero(np.isnan(values))
    what, right = "is empty or NaN", "a number must be in every row"
    if not wrong.size:
        wrong = np.flatnonzero(np.isinf(values))
        what, right = f"holds {values[wrong[:1]].sum()}", "numbers must be finite"
    if not values.size:
        raise FileError(f"{log.path}: column '{column}' has no rows.")
    if wrong.size:
        # the first run of rows, and how many there are besides
        first = log.first + int(wrong[0]) + 1
        gaps = np.flatnonzero(np.diff(wrong) > 1)
        run = int(gaps[0]) + 1 if gaps.size else wrong.size
        rows = f"row {first}" if run == 1 else f"rows {first} to {first + run - 1}"
        rows += f" and {wrong.size - run} more" if run < wrong.size else ""
        raise FileError(f"{log.path}: column '{column}' {what} in data {rows}; {right}.")
