"""Logs in text: comma-separated values and what else goes by that name.

The beginning of a file says how it is written. With that known, Polars reads the rows, a piece of
the file at a time, so that memory grows with the columns that are kept.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, get_args

import numpy as np

from swashplate.errors import FileError
from swashplate.logs.dialect import (
    INFINITE,
    MAY_BE_THOUSANDS,
    NOT_A_NUMBER,
    SIGNS,
    TextLayout,
    TextOptions,
    Thousands,
    ambiguous_thousands,
    date_form,
    encoding_of,
    find_layout,
    grouped_number,
    is_number_text,
    read_heading,
    short_cell,
    without_thousands,
)
from swashplate.logs.log import Array, Log, LogColumn, printable

if TYPE_CHECKING:
    import polars

PIECE = 1 << 20
"""Bytes that are read at a time."""
LONGEST_LINE = 1 << 24
"""A line of more characters is not a row of a table."""
_HEAD = 2000  # lines in which the header and the first row of data must be
_SAMPLE = 60  # lines that decide on delimiter and decimal sign, from the start and all over
_SAMPLED = 1 << 20  # letters of them: fewer lines if there are thousands of columns


def open_text(path: Path, options: TextOptions | None = None) -> Log:
    """Look into a text file: encoding, delimiter, decimal sign, names, units, comments."""
    options = options or TextOptions()
    encoding, skipped = encoding_of(path, options.encoding)
    head = next(_pieces(path, encoding, skipped), "").split("\n")[:-1]
    size = sum(map(len, head)) + len(head)
    marks = options.marks
    filled = [line for line in head if (text := line.lstrip()) and not text.startswith(marks)]
    if not filled:
        raise FileError(f"{path} has no rows of numbers, only comments and empty lines.")
    count = max(4, min(_SAMPLE, _SAMPLED * len(head) // size))
    sample = filled[:count] + filled[count :: 1 + len(filled) // count]
    layout = find_layout(sample, options, path)
    columns, first = read_heading(head[:_HEAD], layout, options, path)
    zeros = _zeros(head[first - 1 :], layout, marks)
    table = _Table(path, encoding, skipped, layout, columns, first, marks, zeros)

    def load(positions: Sequence[int], begin: int = 0, end: int | None = None) -> list[Array]:
        pieces = list(table.read(positions)) or [[np.empty(0)] * len(positions)]
        return [np.concatenate([piece.pop(0) for piece in pieces])[begin:end] for _ in positions]

    form = {"utf-8": "", "ascii": "", "iso8859-1": ", Latin-1"}.get(
        encoding, f", {encoding.upper().removesuffix('-LE')}"
    )
    rows = (round(path.stat().st_size * len(head) / size),) * len(columns)
    return Log(path, f"CSV, {layout}{form}", columns, load, {}, rows, table.read)


def _pieces(path: Path, encoding: str, skipped: int) -> Iterator[str]:
    """A text file in pieces of whole lines, every line ended by a line feed."""
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
                        f"{path} has a line of more than {megabytes} MB; it is not a table of text."
                    )
                text += rest
                # old programs end a text with a mark
                yield text if text.endswith("\n") else text.rstrip("\x1a") + "\n"
        except UnicodeError as error:
            # the error's position is within the bytes that were read last
            why = getattr(error, "reason", error)
            raise FileError(f"{path} is not text in {encoding}: {why}.") from None


# --- rows -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Table:
    """The rows of a text file whose dialect is known."""

    path: Path
    encoding: str
    skipped: int
    layout: TextLayout
    columns: tuple[LogColumn, ...]
    first: int
    marks: tuple[str, ...]
    zeros: Mapping[bool, int]
    """Stamps from which clocks with a date (true), and without one, count. [µs]"""

    def read(self, positions: Sequence[int]) -> Iterator[list[Array]]:
        """Columns at these positions, piece after piece, in the file's units."""
        begin, count, clocks = 1, 0, dict[int, _Clock]()
        doubts = {position: _Doubt() for position in positions if not self.layout.is_sure}
        for piece in _pieces(self.path, self.encoding, self.skipped):
            lines, cells = self._at_once(piece, begin) or self._line_by_line(piece, begin, count)
            begin += piece.count("\n")
            for position, doubt in doubts.items():
                doubt.take(cells[str(position)], self.layout.decimal, lines, count)
            if lines:
                yield [
                    self._piece_of_column(cells[str(position)], lines, position, count, clocks)
                    for position in positions
                ]
            count += len(lines)
        for position, doubt in doubts.items():
            if doubt.remains:
                what = f"{self.path}: column '{self.columns[position].name}' holds {doubt.where}"
                raise ambiguous_thousands(what, self.layout.decimal)

    def _at_once(self, piece: str, begin: int) -> tuple[Sequence[int], polars.DataFrame] | None:
        """Numbers of a piece's lines, and their cells; None if some may not be plain rows."""
        import polars as pl

        text = piece.split("\n", max(self.first - begin, 0))[-1]
        delimiter, width = self.layout.delimiter, self.layout.width
        if not text or any(mark in text for mark in ('"', "\0", *self.marks)):
            return None
        if delimiter == " ":
            text, delimiter = "\n".join("\t".join(row.split()) for row in text.split("\n")), "\t"
        try:
            cells = pl.read_csv(
                text.encode(),
                has_header=False,
                separator=delimiter,
                quote_char=None,
                schema={str(position): pl.String for position in range(width)},
            )
        except pl.exceptions.PolarsError:
            return None
        # Polars refuses a row of too many fields, and fills one of too few, or a blank one
        filled = cells[:, -1].null_count() == 0
        if not filled and text.count(delimiter) != len(cells) * (width - 1):
            return None
        return range(max(begin, self.first), max(begin, self.first) + len(cells)), cells

    def _line_by_line(
        self, piece: str, begin: int, count: int
    ) -> tuple[Sequence[int], polars.DataFrame]:
        """Numbers of the lines of a piece that are rows, and their cells; `count` are before."""
        import polars as pl

        lines, rows = list[int](), list[list[str]]()
        for line, text in enumerate(piece.split("\n")[:-1], begin):
            comment = text.lstrip().startswith(self.marks)
            if line < self.first or comment or self.layout.is_blank(text):
                continue
            where = f"data row {count + len(rows) + 1} (line {line})"
            if "\0" in text:
                raise FileError(f"{self.path} has a NUL byte in {where}; it is damaged.")
            try:
                cells = self.layout.cells(text, strict=True)
            except csv.Error as error:
                why = f"{where}: {printable(str(error))}"
                raise FileError(f"{self.path} has misplaced quotes in {why}.") from None
            if len(cells) != self.layout.width:
                has = f"{len(cells)} field{'s' * (len(cells) > 1)} instead of {self.layout.width}"
                raise FileError(f"{self.path}: {where} has {has}.")
            lines.append(line)
            rows.append(cells)
        names = [str(where) for where in range(self.layout.width)]
        return lines, pl.DataFrame(rows, dict.fromkeys(names, pl.String), orient="row")

    def _piece_of_column(
        self,
        cells: polars.Series,
        lines: Sequence[int],
        position: int,
        count: int,
        clocks: dict[int, _Clock],
    ) -> Array:
        """A column of a piece, before which there are `count` rows."""
        text = cells.str.strip_chars().fill_null("")
        decimal, thousands = self.layout.decimal, self.layout.thousands
        is_clock = position in clocks
        read = clocks[position].seconds(text) if is_clock else _numbers_of(text, decimal, thousands)
        if count == 0 and isinstance(read, int) and (form := date_form(text[read])):
            clocks[position] = _Clock(form, self.zeros)
            read = clocks[position].seconds(text)
        if not isinstance(read, int):
            return read
        row = read
        other_mark = "," if decimal == "." else "."
        kind = "number"
        if position in clocks:
            kind = "date like the first one"
        elif is_number_text(text[row], other_mark):
            kind = f"number with a decimal {'comma' if other_mark == '.' else 'point'}"
        hint = "" if thousands is not None else _hint_of_thousands(text[row])
        raise FileError(
            f"{self.path}: column '{self.columns[position].name}' holds "
            f"'{short_cell(text[row])}', which is not a {kind}, in data row {count + row + 1} "
            f"(line {lines[row]}){hint}."
        )


class _Doubt:
    """Numbers of a column that may be thousands, in a file of whole numbers as far as was seen."""

    def __init__(self) -> None:
        self.where = ""
        self.is_settled = False

    @property
    def remains(self) -> bool:
        """Whether there are such numbers, and none that settles what their sign means."""
        return bool(self.where) and not self.is_settled

    def take(self, cells: polars.Series, decimal: str, lines: Sequence[int], count: int) -> None:
        """Take in the cells of a piece, before which there are `count` rows."""
        text = cells.str.strip_chars().fill_null("")
        marked = text.str.contains(decimal, literal=True)
        if self.is_settled or not marked.any():
            return
        may_be = text.str.contains(MAY_BE_THOUSANDS)
        self.is_settled = bool((marked & ~may_be).any())
        if not self.where and may_be.any():
            row = int((marked & may_be).arg_max() or 0)
            self.where = (
                f"'{short_cell(text[row])}' in data row {count + row + 1} (line {lines[row]})"
            )


def _hint_of_thousands(cell: str) -> str:
    """What to do about a cell that is a number with separators of thousands, or empty."""
    for thousands in get_args(Thousands):
        decimals = [mark for mark in (".", ",") if mark != thousands]
        if any(re.match(grouped_number(thousands, decimal), cell) for decimal in decimals):
            return f'; give thousands = "{thousands}" as an option if these are thousands'
    return ""


def _numbers_of(text: polars.Series, decimal: str, thousands: str | None = None) -> Array | int:
    """Numbers of a column, an empty cell as NaN; or the row of the first cell that holds none."""
    import polars as pl

    if thousands is not None:
        grouped = text.str.contains(grouped_number(thousands, decimal))
        bare_numbers = text.str.replace_all(without_thousands(thousands), "")
        text = bare_numbers.zip_with(grouped, text)
    plain = text
    if decimal == ",":
        # so that 1.234 is not taken for a number: it may be one thousand in this notation
        plain = text.str.replace_all(".", "?", literal=True).str.replace(",", ".", literal=True)
    numbers = plain.cast(pl.Float64, strict=False)
    unread = numbers.is_null() & (text != "")
    if not unread.any():
        return numbers.to_numpy()
    bare = text.str.strip_chars_start(SIGNS).str.to_lowercase()
    infinite = bare.is_in(INFINITE)
    # loggers write -- or --- for nothing; a single dash may be anything
    missing = bare.is_in(NOT_A_NUMBER) | ((bare == "") & (text.str.len_chars() > 1))
    wrong = unread & ~(missing | infinite)
    if wrong.any():
        return int(wrong.arg_max() or 0)
    values: Array = numbers.to_numpy(writable=True)
    endless = (unread & infinite).to_numpy()
    values[endless] = np.where(text.str.starts_with("-").to_numpy()[endless], -np.inf, np.inf)
    return values


_DAY = 86_400_000_000
"""[µs]"""


def _zeros(lines: Sequence[str], layout: TextLayout, marks: tuple[str, ...]) -> dict[bool, int]:
    """Stamps from which the clocks of some rows count, by whether they have a date. [µs]

    It is the earliest first stamp of all columns, as clocks that begin at different instants would
    shift their signals against each other if each counted from its own.
    """
    import polars as pl

    first_stamps: dict[bool, list[int]] = {True: [], False: []}
    awaited = set(range(layout.width))
    for line in lines:
        if not awaited:
            break
        if line.lstrip().startswith(marks):
            continue
        cells = layout.cells(line)
        for position in [*awaited]:
            cell = cells[position] if position < len(cells) else ""
            if not cell:
                continue
            awaited.discard(position)
            form = date_form(cell)
            clock = None if form is None else _Clock(form, {})
            stamps = None if clock is None else clock.stamps(pl.Series([cell]))
            if clock is not None and stamps is not None and stamps[0] is not None:
                first_stamps[clock.dated].append(int(stamps[0]))
    zeros = {dated: min(stamps) for dated, stamps in first_stamps.items() if stamps}
    of_day = first_stamps[False]
    if of_day and max(of_day) - min(of_day) > _DAY // 2:
        # midnight is between them: the earliest one is still of the day before
        zeros[False] = min(stamp for stamp in of_day if stamp > max(of_day) - _DAY // 2)
    return zeros


class _Clock:
    """A column of dates of one form, read piece after piece.

    Stamps count from 1970 in universal time if a zone is written; a clock without a date begins
    again at midnight.
    """

    def __init__(self, form: str, zeros: Mapping[bool, int]) -> None:
        self.dated = form.startswith(("%Y", "%m", "%d"))
        self.form = form if self.dated else f"%Y-%m-%d {form}"
        self.zero = zeros.get(self.dated)  # stamp from which it counts [µs]
        self.begins = False
        self.last = self.ahead = 0  # the stamp before, and days passed since the zero [µs]

    def stamps(self, text: polars.Series) -> polars.Series:
        """Stamps [µs], null for a cell that is none."""
        import polars as pl

        plain = text.str.replace(",", ".", literal=True)  # of the fraction
        plain = plain if self.dated else "1970-01-01 " + plain
        return plain.str.to_datetime(self.form, time_unit="us", strict=False).cast(pl.Int64)

    def seconds(self, text: polars.Series) -> Array | int:
        """Seconds since the log's zero, or the row of the first cell that is no such date."""
        import polars as pl

        text = text.set(text == "", None)
        stamps = self.stamps(text)
        wrong = stamps.is_null() & text.is_not_null()
        if wrong.any():
            return int(wrong.arg_max() or 0)
        if stamps.null_count() == len(stamps):
            return np.full(len(text), np.nan)
        if not self.begins:
            self.begins, self.last = True, int(stamps.drop_nulls()[0])
            if self.zero is None:
                self.zero = self.last
            elif not self.dated and self.last < self.zero - _DAY // 2:
                self.ahead = _DAY
        filled = stamps.fill_null(strategy="forward").fill_null(self.last).to_numpy()
        if not self.dated:
            back = np.diff(filled, prepend=self.last) < -_DAY // 2
            stamps = stamps + self.ahead + _DAY * pl.Series(np.cumsum(back, dtype=np.int64))
            self.ahead += _DAY * int(back.sum())
        self.last = int(filled[-1])
        return 1e-6 * (stamps - self.zero).cast(pl.Float64).to_numpy()
