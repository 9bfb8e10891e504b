"""Logs in text: comma-separated values and what else goes by that name.

The beginning of a file says how it is written: encoding, delimiter, decimal sign, names, units,
comments. With that known, Polars reads the rows, a piece of the file at a time, so that memory
grows with the columns that are kept.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple

import numpy as np

from swashplate.errors import FileError, InputError
from swashplate.logs.log import Array, Column, Log, check_kind, printable, split_unit

if TYPE_CHECKING:
    import polars

_DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " ", "bar": "|"}
_COMMENTS = ("#", "%", "//")

PIECE = 1 << 20
"""Bytes that are read at a time."""
LONGEST_LINE = 1 << 24
"""A line of more characters is no row of a table."""
_HEAD = 2000  # lines in which the header and the first row of data must be
_SAMPLE = 60  # lines that decide on delimiter and decimal sign, from the start and all over
_SAMPLED = 1 << 20  # letters of them: fewer lines where there are thousands of columns


@dataclass(frozen=True)
class TextOptions:
    """Layout of a text log; what is None is recognised from the file. Other formats ignore it.

    Parameters
    ----------
    delimiter : str, optional
        One character, or ``"comma"``, ``"semicolon"``, ``"tab"``, ``"bar"`` or ``"space"`` (any
        number of spaces and tabs).
    decimal : {".", ","}, optional
        Decimal sign.
    comment : str, optional
        What lines begin with that are skipped; ``""`` if there are none. By default any of ``#``,
        ``%`` and ``//``.
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
        mark = _DELIMITERS.get(self.delimiter or "comma", self.delimiter) or ""
        wrong = ""
        if len(mark) != 1 or not mark.isascii() or mark in '\r\n"\0':
            wrong = f"delimiter must be one character, 'tab' or 'space', not {mark!r}"
        elif mark.isalnum() or mark in "+-.":
            wrong = f"delimiter {mark!r} is a part of numbers; name another"
        elif self.decimal not in (None, ".", ","):
            wrong = f"decimal must be '.' or ',', not {self.decimal!r}"
        elif (self.header_row or 0) < 0:
            wrong = f"header_row must be the line of the header, or 0, not {self.header_row!r}"
        try:
            "".encode(self.encoding or "utf-8")  # zlib and the like are codecs, but not of text
        except (LookupError, UnicodeError, ValueError):
            wrong = f"encoding {self.encoding!r} is unknown; take 'utf-8', 'latin-1' or 'utf-16'"
        if wrong:
            raise InputError(f"{wrong}.")

    @property
    def marks(self) -> tuple[str, ...]:
        """What comment lines begin with."""
        return _COMMENTS if self.comment is None else tuple(filter(None, [self.comment]))


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
    encoding, skipped = _encoding_of(path, options.encoding)
    head = next(_pieces(path, encoding, skipped), "").split("\n")[:-1]
    size = sum(map(len, head)) + len(head)
    filled = [line for line in head if line.strip() and not _comments(line, options.marks)]
    if not filled:
        raise FileError(f"{path} has no rows of numbers, only comments and empty lines.")
    some = max(4, min(_SAMPLE, _SAMPLED * len(head) // size))
    layout = _layout(filled[:some] + filled[some :: 1 + len(filled) // some], options, path)
    columns, first = _heading(head[:_HEAD], layout, options, path)
    table = _Table(path, encoding, skipped, layout, columns, first, options.marks)

    def load(positions: Sequence[int], begin: int = 0, end: int | None = None) -> list[Array]:
        pieces = list(table.read(positions)) or [[np.empty(0)] * len(positions)]
        return [np.concatenate([piece.pop(0) for piece in pieces])[begin:end] for _ in positions]

    form = {"utf-8": "", "ascii": "", "iso8859-1": ", Latin-1"}.get(
        encoding, f", {encoding.upper().removesuffix('-LE')}"
    )
    rows = (round(path.stat().st_size * len(head) / size),) * len(columns)
    return Log(path, f"CSV, {layout}{form}", columns, load, {}, rows, table.read)


# --- encoding -------------------------------------------------------------------------------------

_BYTE_ORDER = {
    codecs.BOM_UTF8: "utf-8",
    codecs.BOM_UTF16_LE: "utf-16-le",
    codecs.BOM_UTF16_BE: "utf-16-be",
}
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x19\x1b-\x1f\x7f]")


def _encoding_of(path: Path, given: str | None) -> tuple[str, int]:
    """Name of a text file's encoding, and the bytes of its byte-order mark.

    By default it is what a byte-order mark says, or UTF-8, or else Latin-1.
    """
    with path.open("rb") as file:
        head = file.read(1 << 16)
    mark = next((mark for mark in _BYTE_ORDER if head.startswith(mark)), b"")
    names = [_BYTE_ORDER[mark]] if mark else ["utf-8", "iso8859-1"]
    if given is not None:
        name = codecs.lookup(given).name.removesuffix("-sig")
        names = [_BYTE_ORDER.get(mark, "utf-16-le") if name == "utf-16" else name]
    for name in names:
        try:
            text = codecs.getincrementaldecoder(name)("strict").decode(head[len(mark) :])
            break
        except UnicodeError as error:
            why = f"is no text in {name}: {error}"
    else:
        check_kind(path)
        raise FileError(f"{path} {why}.")
    if control := _CONTROL.search(text):
        check_kind(path)
        line = len(re.findall(r"\r\n|\n|\r", text[: control.start()])) + 1
        what = "a NUL byte" if control[0] == "\0" else f"the byte {ord(control[0]):#04x}"
        raise FileError(f"{path} has {what} in line {line}; it is damaged or no text file.")
    return name, len(mark)


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
            raise FileError(f"{path} is no text in {encoding}: {error}.") from None


def _comments(line: str, marks: tuple[str, ...]) -> bool:
    return bool(marks) and line.lstrip().startswith(marks)


# --- cells ----------------------------------------------------------------------------------------

_EXPONENT = r"(?:[eE][+-]?\d+)?"
_NUMBER = {
    ".": re.compile(rf"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+){_EXPONENT}", re.ASCII),
    ",": re.compile(rf"[+-]?[0-9]+(?:,[0-9]+)?{_EXPONENT}", re.ASCII),
}
_SIGNS = "+-"
_NOT_A_NUMBER = ("nan", "na", "n/a", "#n/a", "null", "nan(ind)", "1.#qnan", "1.#ind", "1.#nan")
"""Texts for a missing number, lower case and without sign: NaN as several programs write it."""
_INFINITE = ("inf", "infinity", "1.#inf")

_CALENDAR = (
    (r"\d{4}-\d{2}-\d{2}", "%Y-%m-%d"),
    (r"\d{4}/\d{2}/\d{2}", "%Y/%m/%d"),
    (r"\d{2}\.\d{2}\.\d{4}", "%d.%m.%Y"),
    # who writes AM and PM writes the month first
    (r"\d{1,2}/\d{1,2}/\d{4}(?=.*[AaPp][Mm])", "%m/%d/%Y"),
    ("", ""),
)
"""Dates that can be read in one way only; 03/04/2026 without AM or PM is none of them."""
_CLOCK = re.compile(
    r"(?P<between>[ T]?)\d{1,2}:\d{2}:\d{2}(?:[.,]\d{1,9})?"
    r"(?:(?P<half> ?)[AaPp][Mm])?(?:(?P<zone> ?)(?:Z|[+-]\d{2}:?\d{2}))?",
    re.ASCII,
)


def _is_number(cell: str, decimal: str) -> bool:
    """Whether a cell, stripped, is a number or a text for a missing one."""
    if _NUMBER[decimal].fullmatch(cell):
        return True
    bare = cell.lstrip(_SIGNS).lower()
    return bare in _NOT_A_NUMBER or bare in _INFINITE or (not bare and len(cell) > 1)


def _date_form(cell: str) -> str | None:
    """Format of a cell, stripped, that is a date with a clock time, or a clock time."""
    for pattern, date in _CALENDAR:
        day = re.match(pattern, cell, re.ASCII)
        clock = _CLOCK.fullmatch(cell, day.end()) if day else None
        if clock is None or bool(clock["between"]) != bool(date):
            continue
        half, zone = clock["half"], clock["zone"]
        form = f"{date}{clock['between']}{'%H' if half is None else '%I'}:%M:%S%.f"
        form += "" if half is None else f"{half}%p"
        return form + (f"{zone}%#z" if zone is not None and date else "")
    return None


def _shown(cell: str) -> str:
    """A cell for a sentence: short and printable."""
    text = printable(cell.strip())
    return text if len(text) <= 40 else f"{text[:37]}..."


# --- delimiter and decimal sign -------------------------------------------------------------------

_NAMES = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "spaces", "|": "bars"}
_THREE = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")


class _Layout(NamedTuple):
    """How the rows of a text file are to be taken apart."""

    delimiter: str
    """One character; a space stands for any number of spaces and tabs."""
    decimal: str
    width: int = 0
    """Fields in a row."""
    numeric: tuple[bool, ...] = ()
    """Which of them are numbers, as far as a sample of rows shows."""

    def __str__(self) -> str:
        point = "comma" if self.decimal == "," else "point"
        return f"{_NAMES.get(self.delimiter, repr(self.delimiter))}, decimal {point}"

    def cells(self, line: str) -> list[str]:
        """Cells of a line, stripped."""
        if self.delimiter == " ":
            line = line.replace("\t", " ").strip()
        parts = line.split() if self.delimiter == " " else line.split(self.delimiter)
        if '"' in line:
            with suppress(csv.Error, StopIteration):
                parts = next(csv.reader([line], delimiter=self.delimiter, skipinitialspace=True))
        return [cell.strip() for cell in parts]

    def names(self, line: str) -> list[str]:
        """Cells of a header; where spaces delimit, the one before a unit does not."""
        if self.delimiter == " ":
            line = re.sub(r"[ \t]+([\[(])", "\0\\1", line)
        return [cell.replace("\0", " ") for cell in self.cells(line)]

    def numbers_in(self, cells: Sequence[str]) -> list[bool]:
        """Of the cells in columns of numbers that are not empty, which are numbers."""
        filled = [cell for cell, one in zip(cells, self.numeric, strict=False) if one and cell]
        return [_is_number(cell, self.decimal) for cell in filled]

    def fits(self, cells: Sequence[str]) -> bool:
        """Whether there are numbers wherever the sample has, and as many cells."""
        found = self.numbers_in(cells)
        return len(cells) == self.width and bool(found) and all(found)

    def is_blank(self, line: str) -> bool:
        """Whether a line is no row; one of nothing but tabs is a row of empty cells."""
        if line.strip():
            return False
        return self.delimiter != "\t" or len(self.cells(line)) != self.width


def _layout(lines: Sequence[str], options: TextOptions, path: Path) -> _Layout:
    """Delimiter and decimal sign under which a sample of lines makes most sense as rows of numbers.

    Comments and blank lines must not be among the lines; header lines may.

    Raises
    ------
    FileError
        If there are no rows of numbers, or if two readings are as good as each other.
    """
    quoted = any('"' in line for line in lines)
    given = {key: getattr(options, key) for key in ("delimiter", "decimal")}
    mark = options.delimiter and _DELIMITERS.get(options.delimiter, options.delimiter)
    trials = [
        trial
        for delimiter in ([mark] if mark else [",", ";", "\t", " ", "|"])
        for decimal in ([options.decimal] if options.decimal else [".", ","])
        if delimiter != decimal or quoted or None not in given.values()
        for trial in _tried(lines, _Layout(delimiter, decimal))
    ]
    if not trials:
        said = " and ".join(f"{key} {value!r}" for key, value in given.items() if value)
        count = f"{len(lines)} line" + "s" * (len(lines) > 1)
        raise FileError(
            f"{path} has no rows of two or more numbers{said and f' with {said}'}, only {count} of "
            "text."
        )
    # a tab between numbers delimits them, whatever spaces there are in names
    tabbed = max((rows for _, rows, trial in trials if trial.delimiter == "\t"), default=0)
    trials = [each for each in trials if each[2].delimiter != " " or each[1] > tabbed]
    best = max(score for score, _, _ in trials)
    equal = [trial for score, _, trial in trials if score > best - 1e-9]
    if len({trial.delimiter for trial in equal}) > 1:
        row = next((line for line in lines if "," in line), lines[0])
        readings = " or as ".join(map(str, equal))
        raise FileError(
            f"{path} can be read in more than one way, '{_shown(row)}' as {readings}; "
            "give 'delimiter' or 'decimal' as an option."
        )
    chosen = equal[0]  # with a point: where both signs are alike, there are whole numbers alone
    if options.decimal is None and chosen.delimiter != "," and chosen.decimal == ",":
        rows = (zip(chosen.cells(line), chosen.numeric, strict=False) for line in lines)
        cells = [cell for row in rows for cell, one in row if one and "," in cell]
        cells = [cell for cell in cells if _is_number(cell, ",")]
        if cells and all(_THREE.fullmatch(cell) for cell in cells):
            raise FileError(
                f"{path} has numbers like '{cells[0]}', where the comma may be a decimal sign or "
                "separate thousands; give 'decimal' as an option."
            )
    return chosen


def _tried(lines: Sequence[str], layout: _Layout) -> Iterator[tuple[float, int, _Layout]]:
    """A layout with its width and columns of numbers, behind its score and its number of rows.

    The score is the share of rows that fit times the share of their characters in numbers; a header
    of as many fields adds a half. A log of one column has no time and gives nothing.
    """
    rows = [layout.cells(line) for line in lines]
    marks = [[_is_number(cell, layout.decimal) for cell in row] for row in rows]
    counts = Counter(len(row) for row, mark in zip(rows, marks, strict=True) if any(mark))
    texts = {len(row) for row, mark in zip(rows, marks, strict=True) if not any(mark)}
    # as many fields as most rows have; among equals, as many as a header has, then as the first
    width = max(counts, key=lambda each: (counts[each], each in texts), default=0)
    kept = [
        list(zip(row, mark, strict=True))
        for row, mark in zip(rows, marks, strict=True)
        if len(row) == width > 1 and any(mark)
    ]
    columns = zip(*kept, strict=True)
    numeric = [
        2 * sum(one for _, one in each) >= sum(cell != "" for cell, _ in each)
        and any(one for _, one in each)
        for each in columns
    ]
    layout = layout._replace(width=width, numeric=tuple(numeric))
    begin = next((place for place, row in enumerate(rows) if layout.fits(row)), None)
    if begin is None:
        return
    letters = sum(len(cell) for row in kept for cell, _ in row)
    share = sum(len(cell) for row in kept for cell, one in row if one) / letters
    score = len(kept) / (len(rows) - begin) * share
    # the line of text above the rows, the header, should have as many fields as they
    header = next((len(rows[i]) for i in reversed(range(begin)) if not any(marks[i])), 0)
    if header > 1:
        score += 0.5 if header == width else 0.25
    yield score, len(kept), layout


# --- names and units, above the rows --------------------------------------------------------------

_Units = list[str | None]


def _heading(
    head: Sequence[str], layout: _Layout, options: TextOptions, path: Path
) -> tuple[tuple[Column, ...], int]:
    """Columns by the first lines of a file, and the line of the first row; the first line is 1.

    Raises
    ------
    FileError
        If there is no row of numbers, or the header has another number of fields than the rows.
    """
    numbered = [each for each in enumerate(head, 1) if not layout.is_blank(each[1])]
    marks = "|".join(map(re.escape, options.marks))
    # comments without their marks, as NumPy writes names into one
    comments = {
        number: re.sub(rf"^\s*(?:{marks})", "", line)
        for number, line in numbered
        if _comments(line, options.marks)
    }
    plain = [each for each in numbered if each[0] not in comments]
    names: list[str] = []
    units: _Units | None = None
    if options.header_row:
        number = options.header_row
        plain = [each for each in plain if each[0] > number]
        header = comments.get(number, head[number - 1] if number <= len(head) else "")
        if layout.is_blank(header) or not plain:
            raise FileError(f"{path} has no header in line {number}, or no rows below it.")
        names, _ = _names_and_units([header], layout)
        if not names:
            raise _wrong_header(number, header, layout, path)
        units = _units_of(layout.cells(plain[0][1]))
        first = 0 if units is None else 1
        if first == len(plain):
            raise FileError(f"{path} has no rows below line {number}.")
    else:
        rows = [layout.cells(line) for _, line in plain]
        first = next((place for place, row in enumerate(rows) if layout.fits(row)), len(rows))
        if first == len(rows):
            raise FileError(f"{path} has no rows of numbers in its first {len(plain)} lines.")
        # a damaged row is a row all the same: it must be refused, not taken for the names
        while first > 1 and any(layout.numbers_in(rows[first - 1])):
            above = layout.names(plain[first - 2][1])
            if _units_of(rows[first - 1]) or len(above) < len(rows[0]):
                break
            first -= 1
    if options.header_row is None:
        filled = [each for each in plain[:first] if any(layout.cells(each[1]))]
        names, units = _names_and_units([line for _, line in filled], layout)
        if filled and not names:
            title = filled[-1][1].rstrip()
            if len(layout.names(title)) > 1 and not title.endswith((":", ".")):
                raise _wrong_header(*filled[-1], layout, path)
        if not names:
            said = [line for number, line in comments.items() if number < plain[first][0]]
            names, units = _names_and_units(said, layout)
            if units is None and (not all(names) or any(layout.numbers_in(names))):
                names = []
    begin, row = plain[first]
    return tuple(_columns(names, units, layout, layout.cells(row))), begin


def _names_and_units(above: Sequence[str], layout: _Layout) -> tuple[list[str], _Units | None]:
    """Names and units in the last one or two of some lines; no names where these are none."""
    if not above:
        return [], None
    names = layout.names(above[-1])
    if len(names) == layout.width + 1 and names[-1] == "":
        names.pop()
    elif len(names) == layout.width - 1 and not layout.numeric[-1]:
        names.append("")  # a delimiter at the end of each row
    if len(names) != layout.width:
        return [], None
    units = _units_of(names)
    before = layout.names(above[-2]) if units is not None and len(above) > 1 else []
    return (before, units) if len(before) == layout.width else (names, None)


def _wrong_header(number: int, line: str, layout: _Layout, path: Path) -> FileError:
    count, hint = len(layout.names(line)), ""
    if layout.delimiter == "," and layout.width >= 2 * count - 1:
        hint = " Do decimal commas stand between commas? Export it with semicolons."
    return FileError(
        f"{path} has {count} names in line {number}, but {layout.width} fields in the rows "
        f"below.{hint}"
    )


def _columns(
    names: Sequence[str], units: _Units | None, layout: _Layout, cells: Sequence[str]
) -> Iterator[Column]:
    """Columns by names, each its own, and units; a first cell that is a date makes it seconds."""
    named = [*names] or [""] * layout.width
    if names and not names[-1] and not layout.numeric[-1] and not cells[-1]:
        named.pop()  # a delimiter at the end of each line
    called = [name or f"column {place}" for place, name in enumerate(named, 1)]
    counts, seen = Counter(called), Counter[str]()
    for place, name in enumerate(called):
        seen[name] += 1
        unit = split_unit(name)[1] or (units[place] if units else None)
        if place < len(cells) and _date_form(cells[place]):
            unit = "s"
        yield Column(printable(f"{name} #{seen[name]}" if counts[name] > 1 else name), unit)


_KNOWN = frozenset(
    """
    s sec secs second seconds ms msec us µs μs min minute minutes h hr hour hours
    hz khz mhz 1/s v mv kv volt volts a ma amp amps ampere amperes ohm ω
    pa hpa kpa mpa bar mbar psi atm n kn mn lbf nm knm j kj w kw hp ps
    m mm cm km um µm μm in inch inches ft rad mrad deg degree degrees ° grad gon
    rev revs revolution revolutions turn turns rpm l ml cc g kg t lb
    k c °c degc celsius f °f degf kelvin
    % percent ppm count counts cts inc incs adc bit bits lsb digit digits pulse pulses
    - – − 1 none n/a dimensionless
    """.split()  # noqa: SIM905 - a list of so many strings is unreadable
)
_SHORT = 4
"""Letters that a word may have that is taken for a unit because of its neighbours."""
_PARTS = re.compile(r"[\s*/·.()^²³0-9-]+")
_BRACKETS = re.compile(r"\[.*\]|\(.*\)")


def _units_of(cells: Sequence[str]) -> _Units | None:
    """Units of a row of them, None where a cell is empty; or None if it is no such row."""
    filled = [cell for cell in cells if cell]
    # a short word of another language may stand among units, such as Imp for pulses
    others = [cell for cell in filled if not _is_unit(cell)]
    if 2 * len(others) >= len(filled) or any(len(cell) > _SHORT for cell in others):
        return None
    return [cell[1:-1].strip() if _BRACKETS.fullmatch(cell) else cell or None for cell in cells]


def _is_unit(cell: str) -> bool:
    if _BRACKETS.fullmatch(cell) or cell.lower() in _KNOWN:
        return True
    parts = [part for part in _PARTS.split(cell.lower()) if part]
    return bool(parts) and all(part in _KNOWN for part in parts)


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
    layout: _Layout
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
        import polars as pl

        begin, count, clocks = 1, 0, dict[int, _Clock]()
        for piece in _pieces(self.path, self.encoding, self.skipped):
            texts = pl.Series("text", [piece[:-1]]).str.split("\n").explode()
            lines = pl.DataFrame([texts]).with_row_index("line", begin)
            begin += len(texts)
            rows = lines.filter((pl.col("line") >= self.first) & self._holds_a_row())
            if rows.height:
                cells = self._cells(rows, count)
                yield [
                    self._numbers(cells, rows["line"], each, count, clocks) for each in positions
                ]
            count += rows.height

    def _holds_a_row(self) -> polars.Expr:
        """Whether a line is neither comment nor blank; one of nothing but tabs has empty cells."""
        import polars as pl

        text = pl.col("text").str.strip_chars()
        filled = text != ""
        if self.layout.delimiter == "\t":
            filled |= pl.col("text").str.count_matches("\t") == self.layout.width - 1
        comment = "|".join(map(re.escape, self.marks))
        return filled & ~text.str.contains(f"^(?:{comment})") if comment else filled

    def _cells(self, rows: polars.DataFrame, count: int) -> polars.Series:
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
        cells = texts.str.split_exact(delimiter, width)
        last, more = (cells.struct.field(f"field_{i}") for i in (width - 1, width))
        wrong = last.is_null() | more.is_not_null()
        if wrong.any():
            row = int(wrong.arg_max() or 0)
            has = len(texts[row].split(delimiter))
            raise FileError(
                f"{self.path}: {place(row)} has {has} field{'s' * (has > 1)} instead of {width}."
            )
        return cells

    def _numbers(
        self,
        cells: polars.Series,
        lines: polars.Series,
        position: int,
        count: int,
        clocks: dict[int, _Clock],
    ) -> Array:
        """A column of a piece, before which there are `count` rows."""
        texts = cells.struct.field(f"field_{position}")
        found, kind = _numbers_of(texts, self.layout.decimal), "number"
        if count == 0 and isinstance(found, _NoNumber):
            form = _date_form(found.cell.strip())
            clocks |= {position: _Clock(form)} if form else {}
        if position in clocks:
            found, kind = clocks[position].seconds(texts), "date like the first one"
        if isinstance(found, _NoNumber):
            other = "," if self.layout.decimal == "." else "."
            if kind == "number" and _is_number(found.cell.strip(), other):
                kind += f" with a decimal {'comma' if other == '.' else 'point'}"
            raise FileError(
                f"{self.path}: column '{self.columns[position].name}' holds "
                f"'{_shown(found.cell)}', which is no {kind}, in data row "
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
    bare = text.str.strip_chars_start(_SIGNS).str.to_lowercase()
    infinite = bare.is_in(_INFINITE)
    # loggers write -- or --- for nothing; a single dash may be anything
    missing = bare.is_in(_NOT_A_NUMBER) | ((bare == "") & (text.str.len_chars() > 1))
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
