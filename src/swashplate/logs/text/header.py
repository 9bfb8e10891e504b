"""What stands above the rows of numbers: comments, preamble, names and units."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from swashplate.errors import FileError
from swashplate.logs.damage import printable
from swashplate.logs.log import Column, split_unit
from swashplate.logs.text.cells import is_date, is_number
from swashplate.logs.text.layout import Layout, TextOptions

COMMENTS = ("#", "%", "//")
"""What comment lines begin with where the user does not say."""

MARKER = "***End_of_Header***"
"""LabVIEW ends both of its headers so."""
_KEPT = 200  # lines before the data that are kept as comments


class Line(NamedTuple):
    """A line of the file."""

    number: int
    """The first is 1."""
    text: str


@dataclass(frozen=True)
class Heading:
    """What the first lines of a file say."""

    columns: tuple[Column, ...]
    first: int
    """Line of the first row of data; the first line of the file is 1."""
    comments: tuple[str, ...]
    notes: tuple[str, ...]


def comment_marks(options: TextOptions) -> tuple[str, ...]:
    """What comment lines begin with."""
    if options.comment is None:
        return COMMENTS
    return (options.comment,) if options.comment else ()


def read_heading(
    lines: Sequence[Line], layout: Layout, options: TextOptions, path: Path
) -> Heading:
    """Find the names, the units and the first row of data.

    Parameters
    ----------
    lines : sequence of Line
        The first lines of the file, all of them.
    layout : Layout
        How rows are taken apart.

    Raises
    ------
    FileError
        If there is no row of numbers, or the header has another number of fields than the rows.
    """
    marks = comment_marks(options)
    filled = [line for line in lines if not layout.is_blank(line.text)]
    comments = [line for line in filled if _is_comment(line, marks)]
    plain = [line for line in filled if not _is_comment(line, marks)]
    if options.header_row:
        plain, names, units = _below(options.header_row, filled, marks, layout, path)
        first, used = 0, 0
    else:
        names, units, used = [], None, 0
        first = _first_row(plain, layout, path)
        if options.header_row is None:
            names, units, used = _names_and_units(plain[:first], layout, path)
    preamble = plain[: first - used]
    said = [line for line in comments if line.number < plain[first].number]
    notes = []
    if not names and options.header_row is None:
        names, units, number = _commented_names(said, marks, layout)
        if names:
            notes.append(f"The names of the columns are from the comment in line {number}.")
        else:
            notes.append("There is no header; the columns are called by their positions.")
    if preamble:
        numbers = ", ".join(str(line.number) for line in preamble[:20])
        notes.append(f"Taken as text above the table: line {numbers}.")
    units = units or labview_units([line.text for line in preamble], layout.width)
    columns = _columns(names, units, layout, plain[first])
    cells = layout.split(plain[first].text)
    for place, (column, cell) in enumerate(zip(columns, cells, strict=False)):
        if is_date(cell):
            columns = (*columns[:place], column._replace(unit="s"), *columns[place + 1 :])
            notes.append(f"'{column.name}' holds dates, read as seconds since the first.")
    if any(count > 1 for count in Counter(names).values()):
        notes.append("Columns of the same name are numbered: 'name #1', 'name #2'.")
    told = sorted([*preamble, *said])[:_KEPT]
    return Heading(
        columns,
        plain[first].number,
        tuple(line.text.strip().rstrip("\t;, ") for line in told),
        tuple(notes),
    )


def _is_comment(line: Line, marks: tuple[str, ...]) -> bool:
    return line.text.lstrip().startswith(marks) if marks else False


def _first_row(plain: Sequence[Line], layout: Layout, path: Path) -> int:
    """Position of the first row of data among the lines that are neither empty nor comments."""
    rows = [layout.split(line.text) for line in plain]
    first = next((place for place, row in enumerate(rows) if layout.fits(row)), None)
    if first is None:
        raise FileError(f"{path} has no rows of numbers in its first {len(plain)} lines.")
    # a damaged row above it is a row all the same: it must be refused, not taken for a title
    top = first
    while top and (_has_number(rows[top - 1], layout) or not any(rows[top - 1])):
        top -= 1
    if top == first or len(rows[top]) != layout.width:
        return top
    if top and _may_be_names(plain[top - 1], layout):
        return top + 1 if units_of(rows[top]) is not None else top
    # names that are numbers, such as those of channels
    named = any(cell and not is_number(cell, layout.decimal) for cell in rows[top])
    return top + 1 if named else top


def _has_number(row: Sequence[str], layout: Layout) -> bool:
    return any(
        numeric and is_number(cell, layout.decimal)
        for cell, numeric in zip(row, layout.numeric, strict=False)
    )


def _may_be_names(line: Line, layout: Layout) -> bool:
    if not line.text.strip() or line.text.startswith(MARKER):
        return False
    return len(_names(line.text, layout)) == layout.width


def _names(text: str, layout: Layout) -> list[str]:
    """Cells of a header; where spaces delimit, the one before a unit does not."""
    if layout.delimiter == " ":
        text = re.sub(r"[ \t]+([\[(])", "\0\\1", text)
    return [cell.replace("\0", " ") for cell in layout.split(text)]


def _names_and_units(
    above: Sequence[Line], layout: Layout, path: Path
) -> tuple[list[str], tuple[str | None, ...] | None, int]:
    """Names, units and how many of the lines directly above the data are these."""
    if not above or above[-1].text.startswith(MARKER):
        return [], None, 0
    names = _names(above[-1].text, layout)
    if len(above) > 1 and _may_be_names(above[-2], layout) and len(names) == layout.width:
        units = units_of(names)
        if units is not None:
            return _names(above[-2].text, layout), units, 2
    if len(names) == layout.width:
        return names, None, 1
    trimmed = _as_wide(names, layout)
    if trimmed is not None:
        return trimmed, None, 1
    if len(names) == 1 or above[-1].text.rstrip().endswith((":", ".")):
        return [], None, 0  # a title
    hint = ""
    if layout.delimiter == "," and layout.width >= 2 * len(names) - 1:
        hint = " Do decimal commas stand between commas? Export it with semicolons."
    raise FileError(
        f"{path} has {len(names)} names in line {above[-1].number}, but {layout.width} fields in "
        f"the rows below.{hint}"
    )


def _as_wide(names: list[str], layout: Layout) -> list[str] | None:
    """Names for as many fields as the rows have, if a harmless difference is all there is."""
    if len(names) == layout.width + 1 and names[-1] in ("", "Comment"):
        return names[:-1]  # LabVIEW leaves room for a comment
    if len(names) == layout.width - 1 and not layout.numeric[-1]:
        return [*names, ""]  # a delimiter at the end of each row
    return None


def _below(
    number: int,
    filled: Sequence[Line],
    marks: tuple[str, ...],
    layout: Layout,
    path: Path,
) -> tuple[list[Line], list[str], tuple[str | None, ...] | None]:
    """Rows, names and units where the user said in which line the names are."""
    header = next((line for line in filled if line.number == number), None)
    if header is None:
        raise FileError(f"{path} has no header in line {number}: it is empty or too far down.")
    text = header.text.lstrip()
    for mark in marks:
        text = text.removeprefix(mark)
    names = _names(text, layout)
    names = names if len(names) == layout.width else _as_wide(names, layout) or names
    if len(names) != layout.width:
        raise FileError(
            f"{path} has {len(names)} names in line {number}, but {layout.width} fields in "
            "the rows."
        )
    rows = [line for line in filled if line.number > number and not _is_comment(line, marks)]
    units = units_of(layout.split(rows[0].text)) if rows else None
    rows = rows[1:] if units else rows
    if not rows:
        raise FileError(f"{path} has no rows below line {number}.")
    return rows, names, units


def _commented_names(
    comments: Sequence[Line], marks: tuple[str, ...], layout: Layout
) -> tuple[list[str], tuple[str | None, ...] | None, int]:
    """Names in the last comment above the data, as NumPy writes them, units and line; or none."""
    if not comments or layout.width == 1:
        return [], None, 0
    texts = [line.text.lstrip() for line in comments[-2:]]
    for mark in marks:
        texts = [text.removeprefix(mark) for text in texts]
    rows = [_names(text, layout) for text in texts]
    units = units_of(rows[-1]) if len(rows[-1]) == layout.width else None
    if units is not None and len(rows) > 1 and len(rows[0]) == layout.width:
        return rows[0], units, comments[-2].number
    names = rows[-1]
    named = len(names) == layout.width and all(names) and not _has_number(names, layout)
    return (names, None, comments[-1].number) if named else ([], None, 0)


def _columns(
    names: Sequence[str],
    units: Sequence[str | None] | None,
    layout: Layout,
    sample: Line,
) -> tuple[Column, ...]:
    called = [name or f"column {place}" for place, name in enumerate(names, 1)] or [
        f"column {place}" for place in range(1, layout.width + 1)
    ]
    if names and not names[-1] and not layout.numeric[-1] and not layout.split(sample.text)[-1]:
        called.pop()  # a delimiter at the end of each line
    counts = Counter(called)
    seen: Counter[str] = Counter()
    columns = []
    for place, name in enumerate(called):
        seen[name] += 1
        unique = printable(f"{name} #{seen[name]}" if counts[name] > 1 else name)
        columns.append(Column(unique, split_unit(name)[1] or (units[place] if units else None)))
    return tuple(columns)


# --- rows of units --------------------------------------------------------------------------------

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


def is_unit(cell: str) -> bool:
    """Whether a cell is a unit: in brackets, or made of the units of such logs."""
    if _BRACKETS.fullmatch(cell) or cell.lower() in _KNOWN:
        return True
    parts = [part for part in _PARTS.split(cell.lower()) if part]
    return bool(parts) and all(part in _KNOWN for part in parts)


def units_of(cells: Sequence[str]) -> tuple[str | None, ...] | None:
    """Units of a row of them, None where a cell is empty; or None if it is no such row."""
    filled = [cell for cell in cells if cell]
    known = sum(is_unit(cell) for cell in filled)
    # a short word of another language may stand among units, such as Imp for pulses
    others = [cell for cell in filled if not is_unit(cell)]
    if not known or 2 * known <= len(filled) or any(len(cell) > _SHORT for cell in others):
        return None
    return tuple(
        cell[1:-1].strip() if _BRACKETS.fullmatch(cell) else cell or None for cell in cells
    )


def labview_units(lines: Sequence[str], width: int) -> tuple[str | None, ...] | None:
    """Units in the header of LabVIEW's measurement files, whose first column is the time."""
    for line in lines:
        label, *units = line.rstrip().split("\t")
        if label == "Y_Unit_Label" and len(units) < width:
            padded = [*units, *[""] * (width - 1 - len(units))]
            return ("s", *(unit or None for unit in padded))
    return None
