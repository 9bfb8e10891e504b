"""Rows of a text file as columns of numbers, a piece of the file at a time."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import FileError
from swashplate.logs.damage import printable
from swashplate.logs.text.cells import (
    DAY,
    NoNumber,
    is_number,
    microseconds_of,
    numbers_of,
    shown,
)
from swashplate.logs.text.encoding import TextSource
from swashplate.logs.text.header import Heading
from swashplate.logs.text.layout import Layout

if TYPE_CHECKING:
    import polars

Array = NDArray[np.float64]

_SPACES = re.compile(rb"[ \t]+")
_BLANK = re.compile(rb"^[ \t]*$(?=\n)", re.MULTILINE)


@dataclass(frozen=True)
class _Rows:
    """Rows one after another, each of as many fields as the layout says."""

    text: bytes
    """Empty if `cells` holds them."""
    cells: list[list[str]]
    lines: range | list[int]
    """Line of each row in the file; the first line is 1."""


class RowReader:
    """Reads columns of a text file; memory grows with the columns, not with the file.

    Parameters
    ----------
    source, layout, heading : TextSource, Layout, Heading
        The file, how its rows are taken apart, and where they begin.
    marks : tuple of str
        What comment lines begin with.
    """

    def __init__(
        self, source: TextSource, layout: Layout, heading: Heading, marks: tuple[str, ...]
    ) -> None:
        self.source = source
        self.layout = layout
        self.heading = heading
        self._marks = tuple(mark.encode() for mark in marks)
        any_mark = b"|".join(re.escape(mark) for mark in self._marks)
        self._comment = re.compile(rb"^[ \t]*(?:" + any_mark + rb")", re.MULTILINE)
        delimiter = "\t" if layout.delimiter == " " else layout.delimiter
        # one column has no delimiter; Polars needs one all the same
        self._delimiter = (delimiter or "\x1f").encode()

    def __call__(self, positions: Sequence[int]) -> list[Array]:
        """Columns at these positions, each of shape (n,), in the file's units.

        Raises
        ------
        FileError
            For a row of too many or too few fields, a cell that holds no number, a NUL byte.
        """
        found: list[list[Array]] = [[] for _ in positions]
        count = 0
        first: dict[int, int] = {}
        for rows in self._pieces():
            read = self._numbers(rows, positions, count, first)
            for pieces, numbers in zip(found, read, strict=True):
                pieces.append(numbers)
            count += len(rows.lines)
        arrays = []
        for position, pieces in zip(positions, found, strict=True):
            values = np.concatenate(pieces) if pieces else np.empty(0)
            pieces.clear()
            if first.get(position, DAY) < DAY and values.size:
                # a clock without a date begins anew at midnight
                passed = np.diff(values, prepend=values[0]) < -0.5e-6 * DAY
                values = values + 1e-6 * DAY * np.cumsum(passed)
            arrays.append(values)
        return arrays

    def _pieces(self) -> Iterator[_Rows]:
        line = 1
        count = 0
        empty: list[int] = []  # lines of empty cells in a single column, as yet at its end
        for piece in self.source.pieces():
            begin, line = line, line + piece.count(b"\n")
            if line <= self.heading.first:
                continue
            for _ in range(begin, self.heading.first):
                piece = piece[piece.index(b"\n") + 1 :]
            begin = max(begin, self.heading.first)
            if self.layout.delimiter == " ":
                piece = _SPACES.sub(b"\t", piece).replace(b"\t\n", b"\n").replace(b"\n\t", b"\n")
                piece = piece.removeprefix(b"\t")
            if not empty and self._is_regular(piece, line - begin):
                rows = _Rows(piece, [], range(begin, line))
            else:
                rows = self._one_by_one(piece, begin, count, empty)
            count += len(rows.lines)
            yield rows

    def _is_regular(self, piece: bytes, lines: int) -> bool:
        """Whether each of its lines is a row, and each row has as many fields as it should."""
        if b"\0" in piece or b'"' in piece:
            return False
        if any(mark[:1] in piece for mark in self._marks) and self._comment.search(piece):
            return False
        width = self.layout.width
        if width == 1:
            return self._delimiter not in piece and _BLANK.search(piece) is None
        characters = np.frombuffer(piece, np.uint8)
        ends = characters == ord("\n")
        places = np.flatnonzero(ends | (characters == ord(self._delimiter)))
        return places.size == lines * width and bool(ends[places[width - 1 :: width]].all())

    def _one_by_one(self, piece: bytes, begin: int, count: int, empty: list[int]) -> _Rows:
        """Rows of a piece with comments, empty lines or quotes; what is no row is refused."""
        width = self.layout.width
        quoted = b'"' in piece
        kept: list[bytes] = []
        lines: list[int] = []
        for number, text in enumerate(piece.split(b"\n")[:-1], begin):
            bare = text.strip()
            if not bare and self.layout.is_blank(text.decode("latin-1")):
                if width == 1:
                    empty.append(number)
                continue
            if self._marks and bare.startswith(self._marks):
                continue
            kept += [b""] * len(empty)
            lines += empty
            empty.clear()
            where = f"data row {count + len(lines) + 1} (line {number})"
            if b"\0" in text:
                raise FileError(f"{self.source.path} has a NUL byte in {where}; it is damaged.")
            if not quoted:
                self._check_width(text.count(self._delimiter) + 1, where)
            elif text.count(b'"') % 2:
                raise FileError(f"{self.source.path} has a quote without its partner in {where}.")
            kept.append(text)
            lines.append(number)
        if quoted:
            return _Rows(b"", self._unquoted(kept, lines, count), lines)
        return _Rows(b"".join(text + b"\n" for text in kept), [], lines)

    def _unquoted(self, kept: list[bytes], lines: list[int], count: int) -> list[list[str]]:
        delimiter = self._delimiter.decode()
        texts = (self.source.text(text) for text in kept)
        cells: list[list[str]] = []
        rows = csv.reader(texts, delimiter=delimiter, skipinitialspace=True, strict=True)
        number = 0
        try:
            for row in rows:
                where = f"data row {count + number + 1} (line {lines[number]})"
                if rows.line_num != number + 1:
                    raise csv.Error("a cell goes on in the next line")
                self._check_width(max(len(row), 1), where)
                cells.append(row or [""])
                number += 1
        except csv.Error as error:
            where = f"data row {count + number + 1} (line {lines[number]})"
            raise FileError(
                f"{self.source.path} has misplaced quotes in {where}: {printable(str(error))}."
            ) from None
        return cells

    def _check_width(self, fields: int, where: str) -> None:
        width = self.layout.width
        if fields != width:
            has = f"has {fields} field" + "s" * (fields > 1)
            raise FileError(f"{self.source.path}: {where} {has} instead of {width}.")

    def _numbers(
        self, rows: _Rows, positions: Sequence[int], count: int, first: dict[int, int]
    ) -> list[Array]:
        """Columns of a piece; `first` keeps the first date [µs] of those that hold dates."""
        import polars as pl

        if rows.cells:
            texts = [pl.Series([row[position] for row in rows.cells]) for position in positions]
        else:
            if not first and (self.layout.decimal == "." or b"." not in rows.text):
                try:
                    table = self._table(rows.text, positions, pl.Float64())
                    return [table[str(position)].to_numpy() for position in positions]
                except pl.exceptions.PolarsError:
                    pass  # spaces behind a number, a text for a missing one, or no number at all
            table = self._table(rows.text, positions, pl.String())
            texts = [table[str(position)] for position in positions]
        arrays = []
        for position, text in zip(positions, texts, strict=True):
            numbers = numbers_of(text, self.layout.decimal)
            kind = "number"
            if position in first or (count == 0 and isinstance(numbers, NoNumber)):
                stamps = microseconds_of(text, due=position in first)
                if isinstance(stamps, pl.Series):
                    if position not in first:
                        first[position] = int(stamps.drop_nulls()[0])
                    arrays.append(1e-6 * (stamps - first[position]).cast(pl.Float64).to_numpy())
                    continue
                if stamps is not None:
                    numbers, kind = stamps, "date like the first one"
            if isinstance(numbers, NoNumber):
                line = rows.lines[numbers.row]
                raise self._refusal(position, numbers, kind, count + numbers.row + 1, line)
            arrays.append(numbers)
        return arrays

    def _refusal(self, position: int, found: NoNumber, kind: str, row: int, line: int) -> FileError:
        """What is said of a cell that is not what it should be."""
        name, hint = self.heading.columns[position].name, ""
        other = "," if self.layout.decimal == "." else "."
        if kind == "number" and is_number(found.cell.strip(), other):
            hint = f" with a decimal {'comma' if other == '.' else 'point'}"
        return FileError(
            f"{self.source.path}: column '{name}' holds '{shown(found.cell)}', which is no "
            f"{kind}{hint}, in data row {row} (line {line})."
        )

    def _table(
        self, text: bytes, positions: Sequence[int], kind: polars.DataType
    ) -> polars.DataFrame:
        import polars as pl

        unread = pl.String()
        wanted = set(positions)
        return pl.read_csv(
            text,
            has_header=False,
            schema={str(i): kind if i in wanted else unread for i in range(self.layout.width)},
            columns=sorted(wanted),
            separator=self._delimiter.decode(),
            quote_char=None,
            encoding="utf8-lossy",
            decimal_comma=self.layout.decimal == "," and self.layout.delimiter != ",",
        )
