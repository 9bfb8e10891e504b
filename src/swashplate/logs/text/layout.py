"""Delimiter and decimal sign of a text file, given or told from its rows of numbers."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

from swashplate.errors import FileError, InputError
from swashplate.logs.text.cells import is_number, shown

_NAMED = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " ", "spaces": " ", "bar": "|"}


@dataclass(frozen=True)
class TextOptions:
    """Layout of a text log; what is None is told from the file. Other formats take no notice.

    Parameters
    ----------
    delimiter : str, optional
        One character, or ``"comma"``, ``"semicolon"``, ``"tab"``, ``"bar"``, ``"space"`` (any
        number of spaces and tabs), or ``"none"`` for a single column.
    decimal : {".", ","}, optional
        Decimal sign.
    comment : str, optional
        What lines begin with that are skipped; ``""`` if there are none. Told from the file, it
        is any of ``#``, ``%`` and ``//``.
    header_row : int, optional
        Line of the column names, the first is 1; 0 if there is none, the columns are then called
        ``column 1``, ``column 2`` and so on. Data begin below.
    encoding : str, optional
        Such as ``"latin-1"`` or ``"utf-16"``.

    Raises
    ------
    InputError
        If one of them makes no sense.
    """

    delimiter: str | None = None
    decimal: Literal[".", ","] | None = None
    comment: str | None = None
    header_row: int | None = None
    encoding: str | None = None

    # pydantic, where this is a part of a larger schema: a misspelt key is refused
    __pydantic_config__: ClassVar[Any] = {"extra": "forbid"}

    def __post_init__(self) -> None:
        """Check them."""
        delimiter = self.delimiter
        if delimiter is not None and delimiter != "none" and delimiter not in _NAMED:
            if len(delimiter) != 1 or not delimiter.isascii() or delimiter in '\r\n"\0':
                raise InputError(
                    f"delimiter must be one character, 'tab', 'space' or 'none', not {delimiter!r}."
                )
            if delimiter.isalnum() or delimiter in "+-.":
                raise InputError(f"delimiter {delimiter!r} is a part of numbers; name another.")
        if self.decimal not in (None, ".", ","):
            raise InputError(f"decimal must be '.' or ',', not {self.decimal!r}.")
        if self.header_row is not None and self.header_row < 0:
            raise InputError(
                f"header_row must be the line of the header, or 0, not {self.header_row!r}."
            )
        if self.encoding is not None:
            try:
                "".encode(self.encoding)  # zlib and the like are codecs, too, but not of text
            except (LookupError, UnicodeError, ValueError):
                raise InputError(
                    f"encoding {self.encoding!r} is unknown; take 'utf-8', 'latin-1' or 'utf-16'."
                ) from None

    @property
    def delimiters(self) -> tuple[str | None, ...]:
        """Delimiters that may be: the one given, or all that are looked for; None is no one."""
        if self.delimiter == "none":
            return (None,)
        if self.delimiter is not None:
            return (_NAMED.get(self.delimiter, self.delimiter),)
        return (",", ";", "\t", " ", "|", None)


_SAID = {
    ",": "commas",
    ";": "semicolons",
    "\t": "tabs",
    " ": "spaces",
    "|": "bars",
    None: "one column",
}
_THREE = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")
_HEADED = 0.5
"""Added to a score if the line of text above the rows, the header, has as many fields as they."""
_DELIMITED = 0.25
"""Added if it has several, but another number of them."""


@dataclass(frozen=True)
class Layout:
    """How the rows of a text file are to be taken apart."""

    delimiter: str | None
    """One character; a space stands for any number of spaces and tabs; None is one column."""
    decimal: str
    width: int
    """Fields in a row."""
    numeric: tuple[bool, ...]
    """Which of them are numbers, as far as a sample of rows shows."""

    def split(self, line: str) -> list[str]:
        """Cells of a line, stripped."""
        return split(line, self.delimiter)

    def is_blank(self, line: str) -> bool:
        """Whether a line is no row; one of nothing but delimiters is a row of empty cells."""
        if self.delimiter == "\t" and len(self.split(line)) == self.width:
            return False
        return not line.strip()

    def fits(self, cells: Sequence[str]) -> bool:
        """Whether there are numbers wherever the sample has, and as many cells."""
        if len(cells) != self.width:
            return False
        numbers = [cell for cell, numeric in zip(cells, self.numeric, strict=True) if numeric]
        return any(numbers) and all(is_number(cell, self.decimal) for cell in numbers if cell)

    def __str__(self) -> str:
        """What it is, for people."""
        delimiter = _SAID.get(self.delimiter, f"'{self.delimiter}'")
        return f"CSV, {delimiter}, decimal {'comma' if self.decimal == ',' else 'point'}"


@dataclass(frozen=True)
class _Trial:
    layout: Layout
    rows: int
    """Rows that fit."""
    score: float
    """Their share times the share of their characters in numbers; more with a header."""


def split(line: str, delimiter: str | None) -> list[str]:
    """Cells of a line, stripped; quotes hold a cell together."""
    if delimiter is None:
        return [line.strip().strip('"')]
    if delimiter == " ":
        line = line.replace("\t", " ").strip()
    if '"' in line:
        try:
            cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
            return [cell.strip() for cell in cells]
        except (csv.Error, StopIteration):
            pass
    return line.split() if delimiter == " " else [cell.strip() for cell in line.split(delimiter)]


def find_layout(lines: Sequence[str], options: TextOptions, path: Path) -> Layout:
    """Delimiter and decimal sign under which the lines make most sense as rows of numbers.

    Parameters
    ----------
    lines : sequence of str
        A sample of lines, no comments and none of them blank; header lines may be among them.
    options : TextOptions
        Delimiter and decimal sign, if the user gave them.

    Raises
    ------
    FileError
        If there are no rows of numbers, or if two readings are as good as each other.
    """
    decimals = (options.decimal,) if options.decimal else (".", ",")
    quoted = any('"' in line for line in lines)
    trials = []
    for delimiter in options.delimiters:
        for decimal in decimals:
            if delimiter == decimal and not quoted and None in (options.delimiter, options.decimal):
                continue
            trial = _tried(lines, delimiter, decimal, alone=options.delimiter is not None)
            if trial is not None:
                trials.append(trial)
    if not trials:
        count = f"{len(lines)} line" + "s" * (len(lines) > 1)
        raise FileError(f"{path} has no rows of numbers{_given(options)}, only {count} of text.")
    tabbed = max((trial.rows for trial in trials if trial.layout.delimiter == "\t"), default=0)
    # a tab between numbers delimits them, whatever spaces there are in names
    trials = [each for each in trials if each.layout.delimiter != " " or each.rows > tabbed]
    best = max(trial.score for trial in trials)
    chosen = _chosen([trial for trial in trials if trial.score > best - 1e-9], lines, path)
    if options.decimal is None and chosen.delimiter != ",":
        _check_decimals(lines, chosen, [trial.layout for trial in trials], path)
    return chosen


def _given(options: TextOptions) -> str:
    given = [
        f"{name} {value!r}"
        for name, value in (("delimiter", options.delimiter), ("decimal", options.decimal))
        if value is not None
    ]
    return f" with {' and '.join(given)}" if given else ""


def _tried(lines: Sequence[str], delimiter: str | None, decimal: str, alone: bool) -> _Trial | None:
    rows = [split(line, delimiter) for line in lines]
    marks = [[cell != "" and is_number(cell, decimal) for cell in row] for row in rows]
    counts = Counter(len(row) for row, mark in zip(rows, marks, strict=True) if any(mark))
    if not counts:
        return None
    texts = {len(row) for row, mark in zip(rows, marks, strict=True) if not any(mark)}
    # as many fields as most rows have; among equals, as many as a header has, then as the first
    width = max(counts, key=lambda each: (counts[each], each in texts))
    if width == 1 and delimiter is not None and not alone:
        return None
    fitting = [
        (row, mark)
        for row, mark in zip(rows, marks, strict=True)
        if len(row) == width and any(mark)
    ]
    number = sum(len(cell) for row, mark in fitting for cell, m in zip(row, mark, strict=True) if m)
    total = sum(len(cell) for row, _ in fitting for cell in row)
    numeric = tuple(_mostly([(row[i], mark[i]) for row, mark in fitting]) for i in range(width))
    if not any(numeric):
        return None
    layout = Layout(delimiter, decimal, width, numeric)
    begin = next((place for place, row in enumerate(rows) if layout.fits(row)), None)
    if begin is None:
        return None
    score = len(fitting) / (len(rows) - begin) * number / total
    header = next((len(rows[i]) for i in reversed(range(begin)) if not any(marks[i])), 0)
    if header > 1:
        score += _HEADED if header == width else _DELIMITED
    return _Trial(layout, len(fitting), score)


def _mostly(cells: Sequence[tuple[str, bool]]) -> bool:
    filled = [number for cell, number in cells if cell]
    return bool(filled) and 2 * sum(filled) >= len(filled)


def _chosen(trials: Sequence[_Trial], lines: Sequence[str], path: Path) -> Layout:
    delimiters = {trial.layout.delimiter for trial in trials}
    if len(delimiters) == 1:
        # the decimal point comes first: with two readings alike, there are whole numbers alone
        return next(each.layout for each in trials if each.layout.delimiter in delimiters)
    row = next((line for line in lines if "," in line), lines[0])
    readings = " or as ".join(str(trial.layout).removeprefix("CSV, ") for trial in trials)
    raise FileError(
        f"{path} can be read in more than one way, '{shown(row)}' as {readings}; "
        "give 'delimiter' or 'decimal' as an option."
    )


def _check_decimals(
    lines: Sequence[str], chosen: Layout, layouts: Sequence[Layout], path: Path
) -> None:
    """Refuse numbers that the other decimal sign would make other numbers."""
    for other in layouts:
        if (other.delimiter, other.width) == (chosen.delimiter, chosen.width) and any(
            theirs and not ours for theirs, ours in zip(other.numeric, chosen.numeric, strict=True)
        ):
            raise FileError(
                f"{path} has decimal points in some columns and decimal commas in others; "
                "give 'decimal' as an option."
            )
    cells = [
        cell
        for line in lines
        for cell, numeric in zip(chosen.split(line), chosen.numeric, strict=False)
        if numeric and "," in cell and is_number(cell, ",")
    ]
    if chosen.decimal == "," and cells and all(_THREE.fullmatch(cell) for cell in cells):
        raise FileError(
            f"{path} has numbers like '{cells[0]}', where the comma may be a decimal sign or "
            "separate thousands; give 'decimal' as an option."
        )
