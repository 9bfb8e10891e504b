"""Logs in text: comma-separated values and what else goes by that name.

The beginning of a file says how it is written. With that known, Polars reads the rows, a piece of
the file at a time, so that memory grows with the columns that are kept.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from swashplate.errors import FileError
from swashplate.logs.dialect import (
    INFINITE,
    NOT_A_NUMBER,
    SIGNS,
    Layout,
    TextOptions,
    date_form,
    encoding_of,
    find_layout,
    is_comment,
    is_number,
    read_heading,
    shown,
)
from swashplate.logs.log import Array, Column, Log, printable

if TYPE_CHECKING:
    import polars

PIECE = 1 << 20
"""Bytes that are read at a time."""
LONGEST_LINE = 1 << 24
"""A line of more characters is no row of a table."""
_HEAD = 2000  # lines in which the header and the first row of data must be
_SAMPLE = 60  # lines that decide on delimiter and decimal sign, from the start and all over
_SAMPLED = 1 << 20  # letters of them: fewer lines where there are thousands of columns


def open_text(path: Path, options: TextOptions | None = None) -> Log:
    """Look into a text file: encoding, delimiter, decimal sign, names, units, comments.

    Delimiter and decimal sign are those under which most rows have the same number of fields and
    most of their characters are in numbers.

    Raises
    ------
    FileError
        If it is no text, has no rows of numbers, or can be read in more than one way: `TextOptions`
        must say then.
    """
    options = options or TextOptions()
    encoding, skipped = encoding_of(path, options.encoding)
    head = next(_pieces(path, encoding, skipped), "").split("\n")[:-1]
    size = sum(map(len, head)) + len(head)
    filled = [line for line in head if line.strip() and not is_comment(line, options.marks)]
    if not filled:
        raise FileError(f"{path} has no rows of numbers, only comments and empty lines.")
    some = max(4, min(_SAMPLE, _SAMPLED * len(head) // size))
    layout = find_layout(filled[:some] + filled[some :: 1 + len(filled) // some], options, path)
    columns, first = read_heading(head[:_HEAD], layout, options, path)
    table = _Table(path, encoding, skipped, layout, columns, first, options.marks)

    def load(positions: Sequence[int], begin: int = 0, end: int | None = None) -> list[Array]:
        pieces = list(table.read(positions)) or [[np.empty(0)] * len(positions)]
        return [np.concatenate([piece.pop(0) for piece in pieces])[begin:end] for _ in positions]

    form = {"utf-8": "", "ascii": "", "iso8859-1": ", Latin-1"}.get(
        encoding, f", {encoding.upper().removesuffix('-LE')}"
    )
    rows = (round(path.stat().st_size * len(head) / size),) * len(columns)
    return Log(path, f"CSV, {layout}{form}", columns, load, {}, rows, table.read)


def _pieces(path: Path, encoding: str, skipped: int) -> Iterator[str]:
    """A text file in pieces of whole lines, every line ended by a line feed.

    Raises
    ------
    FileError
        For bytes that are no such text, or an endless line.
    """
    # UTF-8 is a guess from the first bytes, and a letter of a comment further down no number
    errors = "replace" if encoding == "utf-8" else "strict"
    with path.open("rb") as raw:
        raw.seek(skipped)
        file = io.TextIOWrapper(raw, encoding, errors)
        try:
            while text := file.read(PIECE):
                rest = file.readline(LONGEST_LINE)
                if len(rest) == LONGEST_LINE:
                    megabytes = LONGEST_LINE >> 20
                    raise FileError(
                        f"{path} has a line of more than {megabytes} MB; it is no table of text."
                    )
                text += rest
                # old programs end a text with a mark
                yield text if text.endswith("\n") else text.rstrip("\x1a") + "\n"
        except UnicodeError as error:
            # the error's position is within the bytes that were read last
            why = getattr(error, "reason", error)
            raise FileError(f"{path} is no text in {encoding}: {why}.") from None


# --- rows -----------------------------------------------------------------------------------------

_SEPARATOR = "\x1f"  # delimits cells whose quotes were taken off: no text has it


class _NoNumber(NamedTuple):
    """The first cell of a column that holds no number, and its row in the piece, from 0."""

    row: int
    cell: str


@dataclass(frozen=True)
class _Table:
    """The rows of a text file whose dialect is known."""

    path: Path
    encoding: str
    skipped: int
    layout: Layout
    columns: tuple[Column, ...]
    first: int
    marks: tuple[str, ...]

    def read(self, positions: Sequence[int]) -> Iterator[list[Array]]:
        """Columns at these positions, piece after piece, in the file's units.

        Raises
        ------
        FileError
            For a row of too many or too few fields, a cell that holds no number, a NUL byte.
        """
        begin, count, clocks = 1, 0, dict[int, _Clock]()
        for piece in _pieces(self.path, self.encoding, self.skipped):
            end, header = begin + piece.count("\n"), max(self.first - begin, 0)
            lines: Sequence[int] = range(begin + header, end)
            numbers = [each for each in positions if each not in clocks]
            cells = self._plain_cells(piece.split("\n", header)[-1], len(lines), numbers)
            if cells is None:
                rows = self._rows(piece, begin)
                cells, lines = self._cells(rows, count), rows["line"].to_list()
            begin = end
            if lines:
                yield [
                    self._numbers(cells[f"field_{each}"], lines, each, count, clocks)
                    for each in positions
                ]
            count += len(lines)

    def _plain_cells(
        self, text: str, lines: int, numbers: Sequence[int]
    ) -> polars.DataFrame | None:
        """Cells of lines that are rows, of plain numbers in the columns `numbers`; None if not."""
        import polars as pl

        delimiter, width, comma = self.layout.delimiter, self.layout.width, self.layout.decimal
        # a point may mark thousands where commas are decimal
        special = ('"', "\0", *self.marks, *("." if comma == "," else ""))
        if delimiter == " " or lines < 1 or any(each in text for each in special):
            return None
        kinds = [pl.Float64 if i in numbers else pl.String for i in range(width)]
        try:
            cells = pl.read_csv(
                text.encode(),
                has_header=False,
                separator=delimiter,
                quote_char=None,
                decimal_comma=comma == ",",
                schema={f"field_{i}": kind for i, kind in enumerate(kinds)},
            )
        except pl.exceptions.PolarsError:
            return None
        # Polars refuses a row of too many fields, and fills one of too few, or a blank one
        filled = cells[:, -1].null_count() == 0
        return cells if filled or text.count(delimiter) == lines * (width - 1) else None

    def _rows(self, piece: str, begin: int) -> polars.DataFrame:
        """Lines of a piece that are rows, with their numbers; `begin` is that of the first line."""
        import polars as pl

        texts = pl.Series("text", [piece[:-1]]).str.split("\n").explode()
        lines = pl.DataFrame([texts]).with_row_index("line", begin)
        return lines.filter((pl.col("line") >= self.first) & self._holds_a_row())

    def _holds_a_row(self) -> polars.Expr:
        """Whether a line is neither comment nor blank; one of nothing but tabs has empty cells."""
        import polars as pl

        text = pl.col("text").str.strip_chars()
        filled = text != ""
        if self.layout.delimiter == "\t":
            filled |= pl.col("text").str.count_matches("\t") == self.layout.width - 1
        comment = "|".join(map(re.escape, self.marks))
        return filled & ~text.str.contains(f"^(?:{comment})") if comment else filled

    def _cells(self, rows: polars.DataFrame, count: int) -> polars.DataFrame:
        """Rows taken apart into ``field_0``, ``field_1`` ..., before which there are `count`."""
        import polars as pl

        texts, delimiter, width = rows["text"], self.layout.delimiter, self.layout.width

        def place(row: int) -> str:
            return f"data row {count + row + 1} (line {rows['line'][row]})"

        nul = texts.str.contains("\0", literal=True)
        if nul.any():
            where = place(int(nul.arg_max() or 0))
            raise FileError(f"{self.path} has a NUL byte in {where}; it is damaged.")
        if delimiter == " ":
            texts, delimiter = texts.str.strip_chars().str.replace_all("[ \t]+", "\t"), "\t"
        if texts.str.contains('"', literal=True).any():
            unquoted = []
            for row, text in enumerate(texts):
                quoted = csv.reader([text], delimiter=delimiter, skipinitialspace=True, strict=True)
                try:
                    unquoted.append(_SEPARATOR.join(next(quoted)))
                except csv.Error as error:
                    said = printable(str(error))
                    raise FileError(
                        f"{self.path} has misplaced quotes in {place(row)}: {said}."
                    ) from None
            texts, delimiter = pl.Series(unquoted, dtype=pl.String), _SEPARATOR
        cells = texts.str.split_exact(delimiter, width).struct.unnest()
        wrong = cells[f"field_{width - 1}"].is_null() | cells[f"field_{width}"].is_not_null()
        if wrong.any():
            row = int(wrong.arg_max() or 0)
            has = len(texts[row].split(delimiter))
            raise FileError(
                f"{self.path}: {place(row)} has {has} field{'s' * (has > 1)} instead of {width}."
            )
        return cells

    def _numbers(
        self,
        texts: polars.Series,
        lines: Sequence[int],
        position: int,
        count: int,
        clocks: dict[int, _Clock],
    ) -> Array:
        """A column of a piece, before which there are `count` rows."""
        if texts.dtype.is_float():
            return texts.to_numpy()
        found, kind = _numbers_of(texts, self.layout.decimal), "number"
        if count == 0 and isinstance(found, _NoNumber):
            form = date_form(found.cell.strip())
            clocks |= {position: _Clock(form)} if form else {}
        if position in clocks:
            found, kind = clocks[position].seconds(texts), "date like the first one"
        if isinstance(found, _NoNumber):
            other = "," if self.layout.decimal == "." else "."
            if kind == "number" and is_number(found.cell.strip(), other):
                kind += f" with a decimal {'comma' if other == '.' else 'point'}"
            raise FileError(
                f"{self.path}: column '{self.columns[position].name}' holds "
                f"'{shown(found.cell)}', which is no {kind}, in data row "
                f"{count + found.row + 1} (line {lines[found.row]})."
            )
        return found


def _numbers_of(cells: polars.Series, decimal: str) -> Array | _NoNumber:
    """Numbers of a column of text, an empty cell as NaN; or the first cell that holds none."""
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


_DAY = 86_400_000_000
"""[µs]"""


class _Clock:
    """A column of dates of one form, read piece after piece.

    Stamps count from 1970 in universal time where a zone is written; a clock without a date begins
    anew at midnight.
    """

    def __init__(self, form: str) -> None:
        self.dated = form.startswith(("%Y", "%m", "%d"))
        self.form = form if self.dated else f"%Y-%m-%d {form}"
        self.first: int | None = None  # stamp [µs]
        self.last = self.ahead = 0  # the stamp before, and days passed since the first [µs]

    def seconds(self, cells: polars.Series) -> Array | _NoNumber:
        """Seconds since the column's first stamp, or the first cell of another form."""
        import polars as pl

        text = cells.str.strip_chars()
        text = text.set(text == "", None)
        plain = text.str.replace(",", ".", literal=True)  # of the fraction
        plain = plain if self.dated else "1970-01-01 " + plain
        found = plain.str.to_datetime(self.form, time_unit="us", strict=False)
        wrong = found.is_null() & text.is_not_null()
        if wrong.any():
            row = int(wrong.arg_max() or 0)
            return _NoNumber(row, str(cells[row]))
        stamps = found.cast(pl.Int64)
        if stamps.null_count() == len(stamps):
            return np.full(len(cells), np.nan)
        if self.first is None:
            self.first = self.last = int(stamps.drop_nulls()[0])
        whole = stamps.fill_null(strategy="forward").fill_null(self.last).to_numpy()
        if not self.dated:
            back = np.diff(whole, prepend=self.last) < -_DAY // 2
            stamps = stamps + self.ahead + _DAY * pl.Series(np.cumsum(back, dtype=np.int64))
            self.ahead += _DAY * int(back.sum())
        self.last = int(whole[-1])
        return 1e-6 * (stamps - self.first).cast(pl.Float64).to_numpy()
