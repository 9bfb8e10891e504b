"""Dialect of a text log: encoding, delimiter, decimal sign, names, units and first row of data."""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal, NamedTuple

from swashplate.errors import FileError, InputError
from swashplate.logs.log import LogColumn, check_kind, printable, split_unit
from swashplate.units import speed_unit

Thousands = Literal[",", ".", "'", "space"]
_NAMED = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " ", "spaces": " ", "bar": "|"}
_COMMENTS = ("#", "%", "//")
_THOUSANDS = {",": ",", ".": ".", "'": "'\u2019", "space": " \u00a0\u202f\u2009"}
"""Signs between thousands, by their name in the options."""


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
    thousands : {",", ".", "'", "space"}, optional
        Sign between groups of three digits, as in ``1,480.5``; by default there is none. ``"'"``
        stands for a typographic apostrophe, too, ``"space"`` for any kind of space.
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
    thousands: Thousands | None = None
    comment: str | None = None
    header_row: int | None = None
    encoding: str | None = None

    # pydantic, if this is a part of a larger schema: a misspelt key is refused
    __pydantic_config__: ClassVar[Any] = {"extra": "forbid"}

    def __post_init__(self) -> None:
        """Refuse options that make no sense."""
        mark = "," if self.delimiter is None else _NAMED.get(self.delimiter, self.delimiter)
        wrong = ""
        if len(mark) != 1 or not mark.isascii() or mark in '\r\n"\0':
            wrong = f"delimiter must be one character, 'tab' or 'space', not {mark!r}"
        elif mark.isalnum() or mark in "+-.":
            wrong = f"delimiter {mark!r} is a part of numbers; name another"
        elif self.decimal not in (None, ".", ","):
            wrong = f"decimal must be '.' or ',', not {self.decimal!r}"
        elif self.thousands not in (None, *_THOUSANDS):
            wrong = f"thousands must be one of {', '.join(_THOUSANDS)}, not {self.thousands!r}"
        elif self.thousands is not None and self.thousands == self.decimal:
            wrong = f"decimal and thousands cannot both be {self.decimal!r}"
        elif (self.header_row or 0) < 0:
            wrong = f"header_row must be the line of the header, or 0, not {self.header_row!r}"
        try:
            "".encode(self.encoding or "utf-8")  # zlib and the like are codecs, but not of text
        except (LookupError, UnicodeError, ValueError):
            wrong = f"encoding {self.encoding!r} is unknown; use 'utf-8', 'latin-1' or 'utf-16'"
        if wrong:
            raise InputError(f"{wrong}.")

    @property
    def marks(self) -> tuple[str, ...]:
        """Beginnings of comment lines."""
        if self.comment is None:
            return _COMMENTS
        return (self.comment,) if self.comment else ()


# --- encoding -------------------------------------------------------------------------------------

_BYTE_ORDER = {
    codecs.BOM_UTF8: "utf-8",
    codecs.BOM_UTF16_LE: "utf-16-le",
    codecs.BOM_UTF16_BE: "utf-16-be",
}
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x19\x1b-\x1f\x7f]")


def encoding_of(path: Path, stated: str | None) -> tuple[str, int]:
    """Name of a text file's encoding, and the bytes of its byte-order mark.

    By default it is that of the byte-order mark, or UTF-8, or else Latin-1.
    """
    with path.open("rb") as file:
        head = file.read(1 << 16)
    mark = next((mark for mark in _BYTE_ORDER if head.startswith(mark)), b"")
    names = [_BYTE_ORDER[mark]] if mark else ["utf-8", "iso8859-1"]
    if stated is not None:
        name = codecs.lookup(stated).name.removesuffix("-sig")
        names = [_BYTE_ORDER.get(mark, "utf-16-le") if name == "utf-16" else name]
    for name in names:
        try:
            text = codecs.getincrementaldecoder(name)("strict").decode(head[len(mark) :])
            break
        except UnicodeError as error:
            why = f"is not text in {name}: {error}"
    else:
        check_kind(path)
        raise FileError(f"{path} {why}.")
    if control := _CONTROL.search(text):
        check_kind(path)
        line = len(re.findall(r"\r\n|\n|\r", text[: control.start()])) + 1
        what = "a NUL byte" if control[0] == "\0" else f"the byte {ord(control[0]):#04x}"
        raise FileError(f"{path} has {what} in line {line}; it is damaged or not a text file.")
    return name, len(mark)


# --- cells ----------------------------------------------------------------------------------------

_EXPONENT = r"(?:[eE][+-]?\d+)?"
_NUMBER = {
    ".": re.compile(rf"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+){_EXPONENT}", re.ASCII),
    ",": re.compile(rf"[+-]?[0-9]+(?:,[0-9]+)?{_EXPONENT}", re.ASCII),
}
SIGNS = "+-"
NOT_A_NUMBER = ("nan", "na", "n/a", "#n/a", "null", "nan(ind)", "1.#qnan", "1.#ind", "1.#nan")
"""Texts for a missing number, lower case and without sign: NaN as several programs write it."""
INFINITE = ("inf", "infinity", "1.#inf")

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


def grouped_number(thousands: str, decimal: str) -> str:
    """Pattern of a number whose digits before the decimal sign are in groups of three.

    It is read by Python and by Polars. The thousands are one of `TextOptions`.
    """
    signs = f"[{re.escape(_THOUSANDS[thousands])}]"
    return rf"^[+-]?[1-9][0-9]{{0,2}}(?:{signs}[0-9]{{3}})+(?:\{decimal}[0-9]*)?$"


def without_thousands(thousands: str) -> str:
    """Pattern of the signs that are to be taken out of such a number."""
    return f"[{re.escape(_THOUSANDS[thousands])}]"


def is_number_text(cell: str, decimal: str, thousands: str | None = None) -> bool:
    """Whether a cell, stripped, is a number or a text for a missing one."""
    if _NUMBER[decimal].fullmatch(cell):
        return True
    if thousands is not None and re.match(grouped_number(thousands, decimal), cell):
        return True
    bare = cell.lstrip(SIGNS).lower()
    return bare in NOT_A_NUMBER or bare in INFINITE or (not bare and len(cell) > 1)


def date_form(cell: str) -> str | None:
    """Format of a cell, stripped, that is a date with a clock time, or a clock time."""
    for pattern, date in _CALENDAR:
        day = re.match(pattern, cell, re.ASCII)
        clock = _CLOCK.fullmatch(cell, day.end()) if day else None
        if clock is None or bool(clock["between"]) != bool(date):
            continue
        half, zone = clock["half"], clock["zone"]
        if half is None:
            form = f"{date}{clock['between']}%H:%M:%S%.f"
        else:
            form = f"{date}{clock['between']}%I:%M:%S%.f{half}%p"
        if zone is not None and date:
            form += f"{zone}%#z"
        return form
    return None


def short_cell(cell: str) -> str:
    """A cell for a sentence: short and printable."""
    text = printable(cell.strip())
    return text if len(text) <= 40 else f"{text[:37]}..."


# --- delimiter and decimal sign -------------------------------------------------------------------

_NAMES = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "spaces", "|": "bars"}
MAY_BE_THOUSANDS = r"^[+-]?[1-9][0-9]{0,2}(?:[.,][0-9]{3})+$"
"""Pattern of a number whose decimal sign may as well separate thousands."""


class TextLayout(NamedTuple):
    """Layout of the rows of a text file."""

    delimiter: str
    """One character; a space stands for any number of spaces and tabs."""
    decimal: str
    width: int = 0
    """Fields in a row."""
    numeric: tuple[bool, ...] = ()
    """Which of them are numbers, as far as a sample of rows shows."""
    thousands: str | None = None
    """As of `TextOptions`."""
    is_sure: bool = True
    """Whether its decimal sign is stated, or is no separator of thousands in a sample of rows."""

    def __str__(self) -> str:
        point = "comma" if self.decimal == "," else "point"
        thousands = "" if self.thousands is None else f", thousands {self.thousands}"
        return f"{_NAMES.get(self.delimiter, repr(self.delimiter))}, decimal {point}{thousands}"

    def cells(self, line: str, *, strict: bool = False) -> list[str]:
        """Cells of a line, stripped; `strict` refuses misplaced quotes in a `csv.Error`."""
        mark = self.delimiter
        if mark == " ":
            line = line.replace("\t", " ").strip()
        if '"' in line:
            quoted = csv.reader([line], delimiter=mark, skipinitialspace=True, strict=strict)
            try:
                return [cell.strip() for cell in next(quoted)]
            except StopIteration:
                pass
            except csv.Error:
                if strict:
                    raise
        cells = line.split() if mark == " " else line.split(mark)
        return [cell.strip() for cell in cells]

    def names(self, line: str) -> list[str]:
        """Cells of a header; if spaces delimit, the one before a unit does not."""
        if self.delimiter == " ":
            line = re.sub(r"[ \t]+([\[(])", "\0\\1", line)
        return [cell.replace("\0", " ") for cell in self.cells(line)]

    def numbers_in(self, cells: Sequence[str]) -> list[bool]:
        """Of the cells in columns of numbers that are not empty, which are numbers."""
        filled = [
            cell for cell, numeric in zip(cells, self.numeric, strict=False) if numeric and cell
        ]
        return [is_number_text(cell, self.decimal, self.thousands) for cell in filled]

    def fits(self, cells: Sequence[str]) -> bool:
        """Whether there are numbers wherever the sample has, and as many cells."""
        numbers = self.numbers_in(cells)
        return len(cells) == self.width and bool(numbers) and all(numbers)

    def is_blank(self, line: str) -> bool:
        """Whether a line is not a row; one of nothing but tabs is a row of empty cells."""
        if line.strip():
            return False
        return self.delimiter != "\t" or len(self.cells(line)) != self.width


def find_layout(lines: Sequence[str], options: TextOptions, path: Path) -> TextLayout:
    """Delimiter and decimal sign under which a sample of lines makes most sense as rows of numbers.

    Comments and blank lines must not be among the lines; header lines may. Two readings that are as
    good as each other are refused.
    """
    trials = _trials(lines, options)
    if not trials:
        stated = {"delimiter": options.delimiter, "decimal": options.decimal}
        settings = " and ".join(f"{key} {value!r}" for key, value in stated.items() if value)
        under = f" with {settings}" if settings else ""
        count = f"{len(lines)} line{'s' if len(lines) > 1 else ''}"
        raise FileError(f"{path} has no rows of two or more numbers{under}, only {count} of text.")
    # a tab between numbers delimits them, whatever spaces there are in names
    tabbed = max((trial.rows for trial in trials if trial.layout.delimiter == "\t"), default=0)
    trials = [trial for trial in trials if trial.layout.delimiter != " " or trial.rows > tabbed]
    best = max(trial.score for trial in trials)
    equal = [trial.layout for trial in trials if trial.score > best - 1e-9]
    if len({layout.delimiter for layout in equal}) > 1:
        row = next((line for line in lines if "," in line), lines[0])
        readings = " or as ".join(map(str, equal))
        raise FileError(
            f"{path} can be read in more than one way, '{short_cell(row)}' as {readings}; "
            "give 'delimiter' or 'decimal' as an option."
        )
    layout = equal[0]  # with a point: if both signs are alike, there are whole numbers only
    if options.decimal is not None or options.thousands is not None:
        return layout
    return _checked_thousands(lines, layout, path)


def _checked_thousands(lines: Sequence[str], layout: TextLayout, path: Path) -> TextLayout:
    """A layout, and whether its decimal sign is sure; refused if it may separate thousands.

    It is sure if one number of the sample is no thousand. A point between commas is a decimal sign
    as such files are written, unless whole numbers are beside it in its column.
    """
    columns: list[list[str]] = [[] for _ in layout.numeric]
    for line in lines:
        for position, (cell, numeric) in enumerate(
            zip(layout.cells(line), layout.numeric, strict=False)
        ):
            if numeric and is_number_text(cell, layout.decimal):
                columns[position].append(cell)
    marked = [[cell for cell in column if layout.decimal in cell] for column in columns]
    fractions = [cell for column in marked for cell in column]
    if any(not re.match(MAY_BE_THOUSANDS, cell) for cell in fractions):
        return layout
    is_mixed = any(
        0 < len(some) < len(column) for some, column in zip(marked, columns, strict=True)
    )
    usual = layout.decimal == "." and layout.delimiter == ","
    if fractions and (is_mixed or not usual):
        raise ambiguous_thousands(f"{path} has numbers like '{fractions[0]}'", layout.decimal)
    return layout._replace(is_sure=bool(fractions))


def ambiguous_thousands(what: str, mark: str) -> FileError:
    """Refusal of numbers in which a mark may be either sign; `what` begins the sentence."""
    name = "comma" if mark == "," else "point"
    return FileError(
        f"{what}, in which the {name} may be a decimal sign or a thousands separator; give "
        f"'decimal' or 'thousands' as an option, decimal = \"{mark}\" or thousands = \"{mark}\"."
    )


class _ScoredLayout(NamedTuple):
    """Score of a layout for a sample of lines."""

    score: float
    """Share of the rows that fit times the share of their characters in numbers, and for a header
    of as many fields a half."""
    rows: int
    """Rows that fit."""
    layout: TextLayout


def _trials(lines: Sequence[str], options: TextOptions) -> list[_ScoredLayout]:
    """Layouts that are stated or possible, and under which there are rows of numbers."""
    delimiters, decimals = [",", ";", "\t", " ", "|"], [".", ","]
    if options.delimiter:
        delimiters = [_NAMED.get(options.delimiter, options.delimiter)]
    if options.decimal:
        decimals = [options.decimal]
    elif options.thousands in decimals:
        decimals.remove(options.thousands)
    # a decimal comma between commas needs quotes, or somebody who states both
    is_stated = options.delimiter is not None and options.decimal is not None
    may_be_equal = is_stated or any('"' in line for line in lines)
    trials = list[_ScoredLayout]()
    for delimiter in delimiters:
        for decimal in decimals:
            if delimiter != decimal or may_be_equal:
                layout = TextLayout(delimiter, decimal, thousands=options.thousands)
                trial = _try_layout(lines, layout)
                if trial is not None:
                    trials.append(trial)
    return trials


def _try_layout(lines: Sequence[str], layout: TextLayout) -> _ScoredLayout | None:
    """Try a layout, and complete it by its width and its columns of numbers.

    A log of one column has no time and gives nothing.
    """
    rows = [layout.cells(line) for line in lines]
    marks = [
        [is_number_text(cell, layout.decimal, layout.thousands) for cell in row] for row in rows
    ]
    counts = Counter(len(row) for row, mark in zip(rows, marks, strict=True) if any(mark))
    texts = {len(row) for row, mark in zip(rows, marks, strict=True) if not any(mark)}
    # as many fields as most rows have; among equals, as many as a header has, then as the first
    width = max(counts, key=lambda cells: (counts[cells], cells in texts), default=0)
    full_rows = [
        list(zip(row, mark, strict=True))
        for row, mark in zip(rows, marks, strict=True)
        if len(row) == width > 1 and any(mark)
    ]
    numeric = list[bool]()
    for column in zip(*full_rows, strict=True):
        numbers = sum(is_number for _, is_number in column)
        filled = sum(cell != "" for cell, _ in column)
        numeric.append(numbers > 0 and 2 * numbers >= filled)
    layout = layout._replace(width=width, numeric=tuple(numeric))
    begin = next((index for index, row in enumerate(rows) if layout.fits(row)), None)
    if begin is None:
        return None
    characters, in_numbers = 0, 0
    for row in full_rows:
        for cell, is_number in row:
            characters += len(cell)
            if is_number:
                in_numbers += len(cell)
    score = len(full_rows) / (len(rows) - begin) * (in_numbers / characters)
    # the line of text above the rows, the header, should have as many fields as they
    header_width = 0
    for index in range(begin):
        if not any(marks[index]):
            header_width = len(rows[index])
    if header_width > 1:
        score += 0.5 if header_width == width else 0.25
    return _ScoredLayout(score, len(full_rows), layout)


# --- names and units, above the rows --------------------------------------------------------------

_Units = list[str | None]


class _NumberedLine(NamedTuple):
    """A line of the file."""

    number: int
    """The first is 1."""
    text: str


class _Heading(NamedTuple):
    """Names and units above the rows, and the first row."""

    names: list[str]
    units: _Units | None
    first_row: _NumberedLine


def read_heading(
    head: Sequence[str], layout: TextLayout, options: TextOptions, path: Path
) -> tuple[tuple[LogColumn, ...], int]:
    """Columns by the first lines of a file, and the line of the first row; the first line is 1."""
    comments, plain = list[_NumberedLine](), list[_NumberedLine]()
    marks = "|".join(map(re.escape, options.marks))
    for number, text in enumerate(head, 1):
        if layout.is_blank(text):
            continue
        if text.lstrip().startswith(options.marks):
            # without its mark, as NumPy writes names into one
            comments.append(_NumberedLine(number, re.sub(rf"^\s*(?:{marks})", "", text)))
        else:
            plain.append(_NumberedLine(number, text))
    if options.header_row:
        heading = _stated_heading(head, options.header_row, comments, plain, layout, path)
    else:
        first = _first_row(plain, layout, path)
        heading = _Heading([], None, plain[first])
        if options.header_row is None:
            heading = _recognised_heading(comments, plain[:first], plain[first], layout, path)
    columns = _columns(heading.names, heading.units, layout, layout.cells(heading.first_row.text))
    return tuple(columns), heading.first_row.number


def _stated_heading(
    head: Sequence[str],
    number: int,
    comments: Sequence[_NumberedLine],
    plain: Sequence[_NumberedLine],
    layout: TextLayout,
    path: Path,
) -> _Heading:
    """Heading in a line whose number is stated; a row of units may follow it."""
    below = [line for line in plain if line.number > number]
    header = head[number - 1] if number <= len(head) else ""
    for comment in comments:
        if comment.number == number:
            header = comment.text
    if layout.is_blank(header) or not below:
        raise FileError(f"{path} has no header in line {number}, or no rows below it.")
    names, _ = _names_and_units([header], layout)
    if not names:
        raise _wrong_header(number, header, layout, path)
    units = _units_of(layout.cells(below[0].text))
    if units is None:
        return _Heading(names, None, below[0])
    if len(below) == 1:
        raise FileError(f"{path} has no rows below line {number}.")
    return _Heading(names, units, below[1])


def _first_row(plain: Sequence[_NumberedLine], layout: TextLayout, path: Path) -> int:
    """Index of the first row among the lines that are not comments."""
    rows = list[list[str]]()
    for line in plain:
        rows.append(layout.cells(line.text))
        if layout.fits(rows[-1]):
            break
    else:
        raise FileError(f"{path} has no rows of numbers in its first {len(plain)} lines.")
    first = len(rows) - 1
    # a damaged row is a row all the same: it must be refused, not taken for the names
    while first > 1 and any(layout.numbers_in(rows[first - 1])):
        names_above = layout.names(plain[first - 2].text)
        if _units_of(rows[first - 1]) or len(names_above) < len(rows[0]):
            break
        first -= 1
    return first


def _recognised_heading(
    comments: Sequence[_NumberedLine],
    above: Sequence[_NumberedLine],
    first_row: _NumberedLine,
    layout: TextLayout,
    path: Path,
) -> _Heading:
    """Heading in the last lines above the first row, or in the last comments above it."""
    filled = [line for line in above if any(layout.cells(line.text))]
    names, units = _names_and_units([line.text for line in filled], layout)
    if names:
        return _Heading(names, units, first_row)
    if filled:
        title = filled[-1].text.rstrip()
        if len(layout.names(title)) > 1 and not title.endswith((":", ".")):
            raise _wrong_header(filled[-1].number, filled[-1].text, layout, path)
    notes = [comment.text for comment in comments if comment.number < first_row.number]
    names, units = _names_and_units(notes, layout)
    if units is None and (not all(names) or any(layout.numbers_in(names))):
        names = []
    return _Heading(names, units, first_row)


def _names_and_units(above: Sequence[str], layout: TextLayout) -> tuple[list[str], _Units | None]:
    """Names and units in the last one or two of some lines; no names if they hold none."""
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
    if units is not None and len(above) > 1:
        names_before = layout.names(above[-2])
        if len(names_before) == layout.width:
            return names_before, units
    return names, None


def _wrong_header(number: int, line: str, layout: TextLayout, path: Path) -> FileError:
    """Refusal of a header with another number of names than the rows have fields."""
    count = len(layout.names(line))
    hint = ""
    if layout.delimiter == "," and layout.width >= 2 * count - 1:
        hint = " Are decimal commas mixed with commas between columns? Export it with semicolons."
    return FileError(
        f"{path} has {count} names in line {number}, but {layout.width} fields in the rows "
        f"below.{hint}"
    )


def _columns(
    names: Sequence[str], units: _Units | None, layout: TextLayout, cells: Sequence[str]
) -> Iterator[LogColumn]:
    """Columns by unique names and units; a column whose first cell is a date is in seconds."""
    header = list(names) if names else [""] * layout.width
    if names and not names[-1] and not layout.numeric[-1] and not cells[-1]:
        header.pop()  # a delimiter at the end of each line
    full_names = [name or f"column {position}" for position, name in enumerate(header, 1)]
    counts = Counter(full_names)
    so_far = Counter[str]()
    for position, name in enumerate(full_names):
        so_far[name] += 1
        unit = split_unit(name)[1] or None
        if not unit and units:
            unit = units[position]
        if position < len(cells) and date_form(cells[position]):
            unit = "s"
        unique = f"{name} #{so_far[name]}" if counts[name] > 1 else name
        yield LogColumn(printable(unique), unit)


_KNOWN_UNITS = frozenset(
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
_LONGEST_UNKNOWN_UNIT = 4
"""Most letters of an unknown word that counts as a unit because known units are next to it."""
_PARTS = re.compile(r"[\s*/·.()^²³0-9-]+")
_BRACKETS = re.compile(r"\[.*\]|\(.*\)")


def _units_of(cells: Sequence[str]) -> _Units | None:
    """Units in a row of a table, None for an empty cell; None if it is not a row of units."""
    filled = [cell for cell in cells if cell]
    # a short word of another language may be among units, such as Imp for pulses
    unknown_words = [cell for cell in filled if not _is_unit(cell)]
    if 2 * len(unknown_words) >= len(filled):
        return None
    if any(len(word) > _LONGEST_UNKNOWN_UNIT for word in unknown_words):
        return None
    units: _Units = []
    for cell in cells:
        if _BRACKETS.fullmatch(cell):
            units.append(cell[1:-1].strip())
        else:
            units.append(cell or None)
    return units


def _is_unit(cell: str) -> bool:
    """Whether a cell is a unit: in brackets, or made of known ones."""
    if _BRACKETS.fullmatch(cell) or cell.lower() in _KNOWN_UNITS or speed_unit(cell) != cell:
        return True
    words = [part for part in _PARTS.split(cell.lower()) if part]
    return bool(words) and all(part in _KNOWN_UNITS for part in words)
