"""Logs in text, read a piece at a time: comma-separated values and what else goes by that name."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import FileError
from swashplate.logs.dialect import (
    INFINITE,
    NOT_A_NUMBER,
    SIGNS,
    Heading,
    Layout,
    Line,
    TextOptions,
    date_form,
    encoding_of,
    find_layout,
    is_number,
    read_heading,
    shown,
)
from swashplate.logs.log import Log, printable

if TYPE_CHECKING:
    import polars

Array = NDArray[np.float64]

PIECE = 1 << 22
"""Bytes that are read at a time: large enough for every core, small beside a column."""
LONGEST_LINE = 1 << 24
"""A line of more characters is no row of a table."""
_HEAD = 2000  # lines in which the header and the first row of data must be
_SAMPLE = 60  # lines by which delimiter and decimal sign are told, from the start and all over
_SAMPLED = 1 << 20  # letters of them: fewer lines where there are thousands of columns
_SPACES = re.compile(r"[ \t]+")


def open_text(path: Path, options: TextOptions | None = None) -> Log:
    """Look into a text file: encoding, delimiter, decimal sign, names, units, comments.

    Delimiter and decimal sign are those under which most rows have the same number of fields and
    most of their characters are in numbers. Where two are as good as each other, the file is
    refused and `TextOptions` must say.

    Raises
    ------
    FileError
        If it is no text, has no rows of numbers, or can be read in more than one way.
    """
    options = options or TextOptions()
    encoding, mark = encoding_of(path, options.encoding)
    head = next(_pieces(path, encoding, mark), "").split("\n")[:-1]
    some, size = _SAMPLE, sum(map(len, head)) + 1
    if head:
        some = max(4, min(some, _SAMPLED * len(head) // size))
    filled = [each for each in head if each.strip() and not _comments(each, options.marks)]
    sample = filled[:some] + filled[some :: 1 + len(filled) // some]
    if not sample:
        raise FileError(f"{path} has no rows of numbers, only comments and empty lines.")
    layout = find_layout(sample, options, path)
    lines = [Line(number, text) for number, text in enumerate(head[:_HEAD], 1)]
    table = _Table(
        path, encoding, mark, layout, read_heading(lines, layout, options, path), options.marks
    )

    def load(positions: Sequence[int], first: int = 0, last: int | None = None) -> list[Array]:
        pieces = list(table.read(positions)) or [[np.empty(0)] * len(positions)]
        return [np.concatenate([piece.pop(0) for piece in pieces])[first:last] for _ in positions]

    called = {"utf-8": "", "ascii": "", "iso8859-1": ", Latin-1"}
    form = called.get(encoding, f", {encoding.upper().removesuffix('-LE')}")
    columns = table.heading.columns
    rows = (round(path.stat().st_size * len(head) / (size + len(head))),) * len(columns)
    return Log(path, f"{layout}{form}", columns, load, {}, rows, table.read)


def _comments(line: str, marks: tuple[str, ...]) -> bool:
    return bool(marks) and line.lstrip().startswith(marks)


def _pieces(path: Path, encoding: str, mark: int) -> Iterator[str]:
    """A text file in pieces of whole lines, every line ended by a line feed.

    Raises
    ------
    FileError
        For bytes that are no such text, or an endless line.
    """
    # UTF-8 is a guess from the first bytes, and a letter of a comment further down no number
    codec = codecs.getincrementaldecoder(encoding)("replace" if encoding == "utf-8" else "strict")
    decoder = io.IncrementalNewlineDecoder(codec, translate=True)
    rest, last = "", False
    with path.open("rb") as file:
        file.seek(mark)
        while not last:
            block = file.read(PIECE)
            last = len(block) < PIECE
            try:
                text = rest + decoder.decode(block, last)
            except UnicodeError as error:
                raise FileError(f"{path} is no text in {encoding}: {error}.") from None
            if last:
                text = text.rstrip("\x1a")  # old programs end a text so
                text += "" if text.endswith("\n") or not text else "\n"
            cut = text.rfind("\n") + 1
            rest = text[cut:]
            if len(rest) > LONGEST_LINE:
                raise FileError(
                    f"{path} has a line of more than {LONGEST_LINE >> 20} MB; it is no table of "
                    "text."
                )
            if cut:
                yield text[:cut]


@dataclass
class _Clock:
    """A column of dates: its first stamp and the last one, days passed since. [µs]"""

    first: int
    last: int
    ahead: int = 0


class _NoNumber(NamedTuple):
    """The first cell of a column that holds no number."""

    row: int
    """Counted from 0."""
    cell: str


@dataclass(frozen=True)
class _Table:
    """The rows of a text file, whose dialect is known; memory grows with what is kept of them."""

    path: Path
    encoding: str
    mark: int
    layout: Layout
    heading: Heading
    marks: tuple[str, ...]

    @property
    def _delimiter(self) -> str:
        return "\t" if self.layout.delimiter == " " else self.layout.delimiter

    def read(self, positions: Sequence[int]) -> Iterator[list[Array]]:
        """Columns at these positions, piece after piece, in the file's units.

        Raises
        ------
        FileError
            For a row of too many or too few fields, a cell that holds no number, a NUL byte.
        """
        line, count, first = 1, 0, self.heading.first
        clocks: dict[int, _Clock] = {}
        for piece in _pieces(self.path, self.encoding, self.mark):
            begin, line = line, line + piece.count("\n")
            if line <= first:
                continue
            if begin < first:
                piece = piece.split("\n", first - begin)[-1]
                begin = first
            if self.layout.delimiter == " ":
                piece = _SPACES.sub("\t", piece).replace("\t\n", "\n").replace("\n\t", "\n")
                piece = piece.removeprefix("\t")
            cells, lines = list[list[str]](), list(range(begin, line))
            if not self._is_regular(piece, line - begin):
                cells, lines = self._one_by_one(piece, begin, count)
            if lines:
                yield self._numbers(piece, cells, lines, positions, count, clocks)
            count += len(lines)

    def _is_regular(self, piece: str, lines: int) -> bool:
        """Whether each of its lines is a row, and each row has as many fields as it should."""
        if "\0" in piece or '"' in piece:
            return False
        if any(mark[0] in piece for mark in self.marks):
            any_mark = "|".join(map(re.escape, self.marks))
            if re.search(rf"^[ \t]*(?:{any_mark})", piece, re.MULTILINE):
                return False
        width = self.layout.width
        characters = np.frombuffer(piece.encode(), np.uint8)
        ends = characters == ord("\n")
        places = np.flatnonzero(ends | (characters == ord(self._delimiter)))
        return places.size == lines * width and bool(ends[places[width - 1 :: width]].all())

    def _one_by_one(self, piece: str, begin: int, count: int) -> tuple[list[list[str]], list[int]]:
        """Cells of a piece with comments, empty lines or quotes; what is no row is refused."""
        rows: list[list[str]] = []
        lines: list[int] = []
        width = self.layout.width
        for number, text in enumerate(piece.split("\n")[:-1], begin):
            blank = not text.strip() and self.layout.is_blank(text)
            if blank or _comments(text, self.marks):
                continue
            where = f"data row {count + len(lines) + 1} (line {number})"
            if "\0" in text:
                raise FileError(f"{self.path} has a NUL byte in {where}; it is damaged.")
            cells = text.split(self._delimiter)
            if '"' in text:
                tab = self._delimiter
                quoted = csv.reader([text], delimiter=tab, skipinitialspace=True, strict=True)
                try:
                    cells = next(quoted) or [""]
                except csv.Error as error:
                    said = printable(str(error))
                    raise FileError(
                        f"{self.path} has misplaced quotes in {where}: {said}."
                    ) from None
            if len(cells) != width:
                has = f"has {len(cells)} field" + "s" * (len(cells) > 1)
                raise FileError(f"{self.path}: {where} {has} instead of {width}.")
            rows.append(cells)
            lines.append(number)
        return rows, lines

    def _numbers(
        self,
        text: str,
        cells: list[list[str]],
        lines: Sequence[int],
        positions: Sequence[int],
        count: int,
        clocks: dict[int, _Clock],
    ) -> list[Array]:
        """Columns of a piece, as text or as cells, before which there are `count` rows."""
        import polars as pl

        if cells:
            texts = [pl.Series([row[position] for row in cells]) for position in positions]
        else:
            if not clocks and (self.layout.decimal == "." or "." not in text):
                # cell by cell below: spaces behind a number, a text for a missing one, or no number
                with suppress(pl.exceptions.PolarsError):
                    return [each.to_numpy() for each in self._parsed(text, positions, pl.Float64())]
            texts = self._parsed(text, positions, pl.String())
        arrays = []
        for position, each in zip(positions, texts, strict=True):
            found, kind = numbers_of(each, self.layout.decimal), "number"
            if position in clocks or (count == 0 and isinstance(found, _NoNumber)):
                dated = _seconds(each, position, clocks)
                if dated is not None:
                    found, kind = dated, "date like the first one"
            if isinstance(found, _NoNumber):
                name = self.heading.columns[position].name
                other = "," if self.layout.decimal == "." else "."
                if kind == "number" and is_number(found.cell.strip(), other):
                    kind += f" with a decimal {'comma' if other == '.' else 'point'}"
                raise FileError(
                    f"{self.path}: column '{name}' holds '{shown(found.cell)}', which is no "
                    f"{kind}, in data row {count + found.row + 1} (line {lines[found.row]})."
                )
            arrays.append(found)
        return arrays

    def _parsed(
        self, text: str, positions: Sequence[int], kind: polars.DataType
    ) -> list[polars.Series]:
        import polars as pl

        wanted = set(positions)
        table = pl.read_csv(
            text.encode(),
            has_header=False,
            schema={str(i): kind if i in wanted else pl.String() for i in range(self.layout.width)},
            columns=sorted(wanted),
            separator=self._delimiter,
            quote_char=None,
            decimal_comma=self.layout.decimal == "," and self.layout.delimiter != ",",
        )
        return [table[str(position)] for position in positions]


def numbers_of(cells: polars.Series, decimal: str) -> Array | _NoNumber:
    """Numbers of a column of text, or the first cell that is none.

    Parameters
    ----------
    cells : Series of str, length n
        Spaces around a number do not count; an empty or missing cell is NaN.
    decimal : {".", ","}
        Decimal sign; the other one is part of no number.

    Returns
    -------
    array, shape (n,), or the first cell that is no number and its row, counted from 0
    """
    import polars as pl

    text = cells.str.strip_chars()
    plain = text
    if decimal == ",":
        # so that 1.234 is not taken for a number: it may be one thousand in this notation
        plain = text.str.replace_all(".", "?", literal=True).str.replace(",", ".", literal=True)
    numbers = plain.cast(pl.Float64, strict=False)
    unread = numbers.is_null() & text.is_not_null() & (text != "")
    if not unread.any():
        return numbers.to_numpy()
    bare = text.str.strip_chars_start(SIGNS).str.to_lowercase()
    infinite = bare.is_in(INFINITE)
    # loggers write -- or --- for nothing; a single dash may be anything
    missing = bare.is_in(NOT_A_NUMBER) | ((bare == "") & (text.str.len_chars() > 1))
    wrong = unread & ~(missing | infinite)
    if wrong.any():
        row = int(wrong.arg_max() or 0)
        return _NoNumber(row, str(cells[row]))
    values: Array = numbers.to_numpy(writable=True)
    endless = (unread & infinite).to_numpy()
    values[endless] = np.where(text.str.starts_with("-").to_numpy()[endless], -np.inf, np.inf)
    return values


# --- dates ----------------------------------------------------------------------------------------

_DAY = 86_400_000_000
"""[µs]"""


def _seconds(
    cells: polars.Series, position: int, clocks: dict[int, _Clock]
) -> Array | _NoNumber | None:
    """Seconds since the first stamp of a column; None if it holds no dates.

    Stamps count from 1970 in universal time where a zone is written; a clock without a date begins
    anew at midnight. Of a cell of another form than the first one, that cell.
    """
    import polars as pl

    text = cells.str.strip_chars()
    text = text.set(text == "", None)
    filled = text.drop_nulls()
    due = position in clocks
    if filled.is_empty():
        return np.full(len(cells), np.nan) if due else None
    written = date_form(str(filled[0]))
    plain = text.str.replace(",", ".", literal=True)  # of the fraction
    if written is None:
        wrong = text.is_not_null()
        if not due:
            return None
    else:
        if not written.startswith(("%Y", "%m", "%d")):
            plain, written = "1970-01-01 " + plain, f"%Y-%m-%d {written}"
        found = plain.str.to_datetime(written, time_unit="us", strict=False)
        wrong = found.is_null() & text.is_not_null()
    if wrong.any():
        row = int(wrong.arg_max() or 0)
        return _NoNumber(row, str(cells[row]))
    stamps = found.cast(pl.Int64)
    begin = int(stamps.drop_nulls()[0])
    clock = clocks.setdefault(position, _Clock(begin, begin))
    whole = stamps.fill_null(strategy="forward").fill_null(clock.last).to_numpy()
    if clock.first < _DAY:
        back = np.diff(whole, prepend=clock.last) < -_DAY // 2
        stamps = stamps + clock.ahead + _DAY * pl.Series(np.cumsum(back, dtype=np.int64))
        clock.ahead += _DAY * int(back.sum())
    clock.last = int(whole[-1])
    return 1e-6 * (stamps - clock.first).cast(pl.Float64).to_numpy()
