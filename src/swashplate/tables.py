"""Tables of numbers with names and units, and files that are written whole or not at all.

A `Table` is made once, by the result that it shows. The terminal, the report's page and a CSV
or Parquet file render it: people get their units and as many digits as mean something, files all
digits in SI.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from html import escape
from math import floor, isfinite, isnan, log10
from pathlib import Path
from secrets import token_hex
from stat import S_IMODE, S_IWUSR
from typing import TYPE_CHECKING, Any, NamedTuple

from swashplate.errors import FileError
from swashplate.stopping import Stopped, undone
from swashplate.units import SHAFT_ANGLE, chosen_unit, display_unit

if TYPE_CHECKING:
    import polars


class Form(NamedTuple):
    """A sort of file, and the endings that its names may have."""

    what: str
    """In words, with an article: ``"a table"``."""
    endings: tuple[str, ...] = ()
    """Any, if there are none."""


class Cell(NamedTuple):
    """A value with words of its own: a file gets the value, people get the words."""

    value: str | float | None
    text: str


@dataclass(frozen=True)
class Column:
    """A column of a `Table`: its name, and how its numbers are shown."""

    name: str
    spec: str = ""
    """Of numbers, as of `format`: ``".2f"``, ``".3g"``, ``".1%"``. Empty: words."""
    unit: str = ""
    """Unit of its numbers as of `display_unit`, which people get converted and named after the
    name; ``"1"`` for pure numbers in rows that have a unit of their own."""
    none: str = ""
    """What stands for no number."""
    wrap: bool = False
    """Whether it is the one broken into lines if the terminal is narrow."""
    of: str = "tpf"
    """Where it is shown: ``t`` terminal, ``p`` page, ``f`` file."""
    key: str = ""
    """Its name in a file, if that is another."""

    @property
    def pure(self) -> bool:
        """Whether its numbers are not in their row's unit."""
        return bool(self.unit) or self.spec.endswith("%")


UNIT = Column("unit")
"""The column of the rows' own units."""


class Row(NamedTuple):
    """Values of a row, one a column."""

    cells: tuple[Any, ...]
    unit: str
    """Unit of all its numbers as of `display_unit`, if they have one of their own."""
    spec: str
    look: bool
    """Whether someone should look at it."""
    section: bool
    """Whether a line is drawn above it."""
    total: bool = False
    """Whether it sums up the others; a file leaves it out."""


@dataclass
class Table:
    """A result as numbers with names and units, for the terminal, a page or a file."""

    title: str
    columns: Sequence[Column]
    caption: str = ""
    rows: list[Row] = field(default_factory=list)
    si: bool = False
    """Whether rows with a unit are of parameters, which are shown in SI unless a unit is chosen."""

    def add(
        self,
        *cells: str | float | Cell | None,
        unit: str = "",
        spec: str = "",
        look: bool = False,
        section: bool = False,
        total: bool = False,
    ) -> None:
        """Add a row; see `Row`. NaN counts as no number."""
        count = sum(column is not UNIT for column in self.columns)
        assert len(cells) == count, f"{len(cells)} cells for {count} columns of {self.title}"
        values = iter(cells)
        si = "rad" if unit == SHAFT_ANGLE else unit
        all_cells = tuple(si if column is UNIT else next(values) for column in self.columns)
        self.rows.append(Row(all_cells, unit, spec, look, section or total, total))

    def of(self, medium: str) -> Table:
        """The table with the columns of a medium: ``"t"`` terminal, ``"p"`` page, ``"f"`` file."""
        kept = [k for k, column in enumerate(self.columns) if medium in column.of]
        rows = [row._replace(cells=tuple(row.cells[k] for k in kept)) for row in self.rows]
        return Table(self.title, [self.columns[k] for k in kept], self.caption, rows, self.si)

    def headings(self) -> list[str]:
        """The columns' names with their units, for people."""
        return [
            f"{column.name} {display_unit(column.unit).name if column.unit else ''}".strip()
            for column in self.columns
        ]

    def texts(self, row: Row) -> list[str]:
        """A row's cells as texts for people."""
        pairs = list(zip(self.columns, row.cells, strict=True))
        in_row_unit = [
            (column, value) for column, value in pairs if not (column is UNIT or column.pure)
        ]
        # numbers of fixed decimals keep the large unit: 0.0450 A, but 45 mA
        fixed = any(
            (row.spec or column.spec).endswith("f") for column, _ in in_row_unit if column.spec
        )
        size = float("inf") if fixed else largest([value for _, value in in_row_unit])
        row_unit = chosen_unit(row.unit) if self.si else display_unit(row.unit, size)
        texts = []
        for column, value in pairs:
            unit = display_unit(column.unit) if column.unit else row_unit
            spec = column.spec if column.pure else row.spec or column.spec
            is_unit = column is UNIT
            texts.append(row_unit.name if is_unit else _text(value, spec, column, unit.factor))
        return texts

    def to_polars(self) -> polars.DataFrame:
        """The numbers of the file's columns, SI, each row's own unit in the column ``unit``."""
        import polars as pl

        table = self.of("f")
        names = [column.key or column.name for column in table.columns]
        records = [
            dict(zip(names, map(_number, row.cells), strict=True))
            for row in table.rows
            if not row.total
        ]
        return pl.DataFrame(records, infer_schema_length=None)

    def write(self, path: str | Path) -> None:
        """Write the table of `to_polars` as CSV or Parquet, by the path's ending."""
        write_table(self.to_polars(), path)

    def __str__(self) -> str:
        """The table as plain text, numbers to the right."""
        table = self.of("t")
        headings = [[line.strip() for line in name.split("\n")] for name in table.headings()]
        height = max(map(len, headings), default=1)
        # a heading of fewer lines stands right above its column
        stacked = [[""] * (height - len(lines)) + lines for lines in headings]
        lines = [*zip(*stacked, strict=True), *map(table.texts, table.rows)]
        sizes = [max(map(len, cells)) for cells in zip(*lines, strict=True)]
        right = [">" if column.spec else "<" for column in table.columns]
        text = [
            "  ".join(f"{c:{r}{s}}" for c, r, s in zip(line, right, sizes, strict=True)).rstrip()
            for line in lines
        ]
        return "\n".join(line for line in (self.title, *text, self.caption) if line)

    def _repr_html_(self) -> str:
        table = self.of("t")
        sides = ["right" if column.spec else "left" for column in table.columns]
        pieces = ["<table>"]
        if self.title:
            pieces.append(f'<caption style="{_CAPTION}">{escape(self.title)}</caption>')
        pieces += ["<thead>", _html_row("th", table.headings(), sides), "</thead>", "<tbody>"]
        for row in table.rows:
            # between sections a line that is seen on light and on dark pages
            line = "border-top: 1px solid #888; " if row.section else ""
            pieces.append(_html_row("td", table.texts(row), sides, line))
        pieces += ["</tbody>", "</table>"]
        if self.caption:
            pieces.append(f"<p>{escape(self.caption)}</p>")
        return "".join(pieces)


_CAPTION = "caption-side: top; text-align: left; font-weight: bold; white-space: nowrap"


def _html_row(tag: str, cells: Sequence[str], sides: Sequence[str], style: str = "") -> str:
    """A row of a table in HTML, each cell at its column's side; Jupyter's own is the right one."""
    cells_html = [
        f'<{tag} style="{style}text-align: {side}">{escape(cell)}</{tag}>'
        for cell, side in zip(cells, sides, strict=True)
    ]
    return f"<tr>{''.join(cells_html)}</tr>"


def share_cell(share: float | None) -> Cell:
    """A share of time as people read it: ``"12.5 %"``, ``"never"``."""
    if share is None:
        return Cell(share, "")
    return Cell(share, f"{100.0 * share:.1f} %" if share else "never")


def joined(tables: Sequence[Table]) -> Table:
    """One table of the rows of several that have the same columns."""
    return Table("", tables[0].columns, rows=[row for table in tables for row in table.rows])


def largest(cells: Sequence[Any]) -> float:
    """The largest magnitude of some cells' numbers, by which their unit is chosen."""
    values = [cell.value if isinstance(cell, Cell) else cell for cell in cells]
    sizes = [abs(value) for value in values if isinstance(value, float) and isfinite(value)]
    return max(sizes, default=0.0) or float("inf")


def _number(value: Any) -> Any:
    value = value.value if isinstance(value, Cell) else value
    return None if isinstance(value, float) and isnan(value) else value


def _text(value: Any, spec: str, column: Column, factor: float) -> str:
    if isinstance(value, Cell):
        return value.text
    if value is None or (isinstance(value, float) and isnan(value)):
        return column.none
    if isinstance(value, str) or not spec:
        return str(value)
    if spec.endswith("%"):
        return format(value, spec).replace("%", " %")
    return format(factor * value if factor != 1.0 else value, spec)


# --- numbers as an engineer's table shows them ----------------------------------------------------

NONE = "–"
"""Stands for a number that a table does not have."""


def plain(value: float, digits: int = 5) -> str:
    """A number of some significant digits, trailing zeros kept."""
    if not isfinite(value):
        return "none" if value == float("inf") else NONE
    return "0" if value == 0.0 else f"{value:#.{digits}g}".rstrip(".").replace(".e", "e")


def spread(value: float, lower: float, upper: float) -> tuple[str, str, str]:
    """A value and the ends of its interval, all to two digits of its half width.

    Of an uneven one that is its narrower side, or a hundredth of the half width if that is more.
    """
    half = 0.5 * (upper - lower)
    half = max(min(half, value - lower, upper - value), 0.01 * half)
    if not (isfinite(half) and half > 0.0):
        return plain(value), plain(lower), plain(upper)
    power = floor(log10(max(abs(value), half)) + 1e-3)
    power = 0 if -5 < power < 5 else power
    decimals = min(max(1 - floor(log10(half / 10.0**power)), 0), 12)
    tail = f"e{power:+03d}" if power else ""
    middle, low, high = (
        f"{number / 10.0**power:.{decimals}f}{tail}" for number in (value, lower, upper)
    )
    return middle, low, high


def percent(part: float, total: float, *, sign: bool = False) -> str:
    """A part of a total in per cent, two significant digits."""
    if total == 0.0 or not isfinite(part / total):
        return NONE
    number = 100.0 * part / abs(total)
    size = abs(number)
    if size >= 10.0:
        decimals = 0
    elif size >= 1.0:
        decimals = 1
    elif size >= 0.1:
        decimals = 2
    else:
        decimals = 3
    return f"{number:+.{decimals}f} %" if sign else f"{number:.{decimals}f} %"


def quantity(value: float, unit: str, digits: int = 3, spec: str = "") -> str:
    """A number with the unit that people read it in: ``"7.60 mA"``; `spec` as of `format`."""
    shown = display_unit(unit, abs(value))
    number = shown.factor * value
    return f"{format(number, spec) if spec else plain(number, digits)} {shown.name}".rstrip()


def listed(items: Sequence[str]) -> str:
    """``a, b and c``; empty for none."""
    if len(items) < 2:
        return "".join(items)
    return f"{', '.join(items[:-1])} and {items[-1]}"


def ended(sentence: str) -> str:
    """Words with a stop at their end, unless they ask."""
    return sentence if sentence.endswith("?") else f"{sentence}."


def count(number: int, what: str, several: str = "") -> str:
    """``1 run``, ``13 runs``, ``110,605 samples``."""
    return f"{number:,} {what if number == 1 else several or what + 's'}"


# --- files ----------------------------------------------------------------------------------------


TABLE = Form("a table", (".csv", ".parquet"))
FIGURE = Form("a figure", (".png", ".svg", ".pdf"))
PAGE = Form("a page", (".html",))
PRINTED = Form("a printed report", (".pdf",))


def ending(path: str | Path, form: Form) -> str:
    """Ending of a path in small letters, with its dot; a `FileError` if the form has it not."""
    suffix = Path(path).suffix
    if form.endings and suffix.lower() not in form.endings:
        endings = " or ".join(filter(None, (", ".join(form.endings[:-1]), form.endings[-1])))
        raise FileError(f"{path} ends in '{suffix}'; {form.what} is written as {endings}.")
    return suffix.lower()


def check_place(path: str | Path) -> None:
    """Refuse a path at which a file certainly cannot be written."""
    target = Path(path)
    reason = None
    folder = target.parent
    try:
        if not folder.exists():
            reason = f"folder {folder} does not exist"
        elif not folder.is_dir():
            reason = f"{folder} is not a folder"
        elif target.is_dir():
            reason = "it is a folder"
        elif not os.access(folder, os.W_OK):
            reason = f"folder {folder} is not writable"
    except OSError as error:  # such as a name that is too long
        reason = error.strerror or str(error)
    if reason is not None:
        raise FileError(f"{target} cannot be written: {reason}.")


def made_folder(folder: Path) -> Path:
    """A folder, made if it is missing."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{folder} cannot be created: {error.strerror or error}.") from None
    return folder


def check_folder(folder: Path) -> None:
    """See to it, before long work, that a folder can be made and written to; none is made yet."""
    there = next(
        parent for parent in (folder.absolute(), *folder.absolute().parents) if parent.exists()
    )
    if not there.is_dir():
        raise FileError(f"{folder} cannot be created: {there} is not a folder.")
    if not os.access(there, os.W_OK | os.X_OK):
        raise FileError(f"{folder} cannot be written to: {there} is read-only or another user's.")


def write_whole(path: str | Path, write: Callable[[Path], object]) -> None:
    """Have a file written under another name in its folder, and renamed when it is complete.

    It has the permissions of the file that it replaces. A link in its place is replaced as a file
    would be: what it points to stays as it is.

    Raises
    ------
    FileError
        If it cannot be written; nothing is left and an older file stays.
    """
    target = Path(path)
    check_place(target)
    temporary = target.parent / f".{target.stem}-{token_hex(4)}{target.suffix}"
    try:
        with undone(temporary.unlink), _removed(temporary):
            temporary.touch(exist_ok=False)
            mode = _permissions(target)
            # before anybody else can read it, and again, as a library may have made another file
            if mode is not None:
                temporary.chmod(mode | S_IWUSR)
            write(temporary)
            if mode is not None:
                temporary.chmod(mode)
            with temporary.open("rb") as written:  # a power cut leaves the old file or the new one
                os.fsync(written.fileno())
            temporary.replace(target)
    except FileError:
        raise
    except OSError as error:
        raise FileError(f"{target} cannot be written: {error.strerror or error}.") from None
    except Exception as error:  # libraries raise what they like; what is not the disk's goes on
        reason = _disk_message(error)
        if reason is None:
            raise
        raise FileError(f"{target} cannot be written: {reason}.") from None


@contextmanager
def _removed(temporary: Path) -> Iterator[None]:
    """Remove a file in the end, if it is still there."""
    try:
        yield
    finally:
        try:
            temporary.unlink(missing_ok=True)
        except (KeyboardInterrupt, Stopped):
            # on Ctrl-C Polars raises one of its own and leaves Python's to come: it comes here
            temporary.unlink(missing_ok=True)
            raise


def _permissions(path: Path) -> int | None:
    """Permissions of a file, None if there is none."""
    try:
        return S_IMODE(path.stat().st_mode)
    except OSError:
        return None


def _disk_message(error: BaseException) -> str | None:
    """Message of the operating system inside a library's error; None if it has none."""
    if "(os error " in str(error):
        return str(error).partition(" (os error ")[0].rpartition(": ")[2]
    before = error.__cause__ or error.__context__
    if isinstance(before, OSError):
        return before.strerror or str(before)
    return None if before is None else _disk_message(before)


def write_bytes(content: bytes, path: str | Path) -> None:
    """Write bytes, whole or not at all."""
    write_whole(path, lambda temporary: temporary.write_bytes(content))


def write_text(text: str, path: str | Path) -> None:
    """Write UTF-8 text, whole or not at all.

    Parameters
    ----------
    text : str
        The content.
    path : path
        The file; an older one is replaced.

    Raises
    ------
    FileError
        If the file cannot be written; an older one stays as it was.

    Examples
    --------
    >>> from pathlib import Path
    >>> from swashplate.tables import write_text
    >>> write_text("Z16 is fitted.", "notes.txt")
    >>> Path("notes.txt").read_text("utf-8")
    'Z16 is fitted.'
    """
    write_whole(path, lambda temporary: temporary.write_text(text, "utf-8"))


def write_table(table: polars.DataFrame, path: str | Path) -> None:
    """Write a table as CSV or Parquet, by the path's ending.

    A text that a spreadsheet would take for a formula, such as a run called ``=1+1``, has an
    apostrophe before it in CSV.

    Raises
    ------
    FileError
        For another ending or a place that cannot be written.
    """
    import polars as pl

    if ending(path, TABLE) == ".csv":
        formula = r"^([=@\t\r]|[+-][^\d.])"
        plain = table.with_columns(pl.col(pl.String).str.replace(formula, "'${1}"))
        plain = plain.rename({name: re.sub(formula, r"'\1", name) for name in table.columns})
        write_whole(path, lambda temporary: plain.write_csv(temporary))
    else:
        write_whole(path, lambda temporary: table.write_parquet(temporary))
