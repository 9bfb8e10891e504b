"""Cells of text: what is a number or a date, and whole columns of them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.logs.damage import printable

if TYPE_CHECKING:
    import polars

Array = NDArray[np.float64]

_EXPONENT = r"(?:[eE][+-]?\d+)?"
_POINT = re.compile(rf"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+){_EXPONENT}", re.ASCII)
_COMMA = re.compile(rf"[+-]?[0-9]+(?:,[0-9]+)?{_EXPONENT}", re.ASCII)
_SIGNS = "+-"

NOT_A_NUMBER = ("nan", "na", "n/a", "#n/a", "null", "nan(ind)", "1.#qnan", "1.#ind", "1.#nan")
"""Texts for a missing number, lower case and without sign: NaN as several programs write it."""

INFINITE = ("inf", "infinity", "1.#inf")


class NoNumber(NamedTuple):
    """The first cell of a column that holds no number."""

    row: int
    """Counted from 0."""
    cell: str


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell, stripped, is a number or a text for a missing one."""
    if (_POINT if decimal == "." else _COMMA).fullmatch(cell):
        return True
    bare = cell.lstrip(_SIGNS).lower()
    return bare in NOT_A_NUMBER or bare in INFINITE or (not bare and len(cell) > 1)


def numbers_of(cells: polars.Series, decimal: str) -> Array | NoNumber:
    """Numbers of a column of text, or the first cell that is none.

    Parameters
    ----------
    cells : Series of str, length n
        Spaces around a number do not count; an empty or missing cell is NaN.
    decimal : {".", ","}
        Decimal sign; the other one is part of no number.

    Returns
    -------
    array, shape (n,), or NoNumber
    """
    import polars as pl

    text = cells.str.strip_chars()
    plain = text
    if decimal == ",":
        # so that 1.234 is not taken for a number: it may be one thousand in this notation
        plain = text.str.replace_all(".", "?", literal=True).str.replace(",", ".", literal=True)
    numbers = plain.cast(pl.Float64, strict=False)
    unread = numbers.is_null() & text.is_not_null() & (text != "")
    if unread.any():
        bare = text.str.strip_chars_start(_SIGNS).str.to_lowercase()
        negative = text.str.starts_with("-")
        infinite = bare.is_in(INFINITE)
        # loggers write -- or --- for nothing; a single dash may be anything
        missing = bare.is_in(NOT_A_NUMBER) | ((bare == "") & (text.str.len_chars() > 1))
        wrong = unread & ~(missing | infinite)
        if wrong.any():
            row = int(wrong.arg_max() or 0)
            return NoNumber(row, str(cells[row]))
        values: Array = numbers.to_numpy(writable=True)
        endless = (unread & infinite).to_numpy()
        values[endless] = np.where(negative.to_numpy()[endless], -np.inf, np.inf)
        return values
    return numbers.to_numpy()


def shown(cell: str) -> str:
    """A cell for a sentence: short and printable."""
    text = printable(cell.strip())
    return text if len(text) <= 40 else f"{text[:37]}..."


# --- dates ----------------------------------------------------------------------------------------

DAY = 86_400_000_000
"""[µs]"""
_CLOCK = r"\d{1,2}:\d{2}:\d{2}(?:[.,]\d{1,9})?"
_ZONE = r"(?: ?(?:Z|[+-]\d{2}:?\d{2}))?"
_HALF = r" ?[AaPp]\.?[Mm]\.?"
_FORMS = (
    (rf"\d{{4}}-\d{{2}}-\d{{2}} {_CLOCK}(?:{_HALF})?{_ZONE}", "%Y-%m-%d %H:%M:%S%.f"),
    (rf"\d{{4}}-\d{{2}}-\d{{2}}T{_CLOCK}{_ZONE}", "%Y-%m-%dT%H:%M:%S%.f"),
    (rf"\d{{4}}/\d{{2}}/\d{{2}} {_CLOCK}(?:{_HALF})?", "%Y/%m/%d %H:%M:%S%.f"),
    (rf"\d{{2}}\.\d{{2}}\.\d{{4}} {_CLOCK}", "%d.%m.%Y %H:%M:%S%.f"),
    # who writes AM and PM writes the month first
    (rf"\d{{1,2}}/\d{{1,2}}/\d{{4}} {_CLOCK}{_HALF}", "%m/%d/%Y %H:%M:%S%.f"),
    (rf"{_CLOCK}(?:{_HALF})?", "%H:%M:%S%.f"),
)
"""Forms that can be read in one way only; 03/04/2026 is none of them."""


def is_date(cell: str) -> bool:
    """Whether a cell, stripped, is a date with a clock time, or a clock time."""
    return _form(cell) is not None


def _form(cell: str) -> str | None:
    return next((way for form, way in _FORMS if re.fullmatch(form, cell, re.ASCII)), None)


def microseconds_of(cells: polars.Series, *, due: bool) -> polars.Series | NoNumber | None:
    """Stamps of a column of text [µs], from 1970 on or from midnight; null where a cell is empty.

    Parameters
    ----------
    cells : Series of str, length n
    due : bool
        Whether rows before these held dates.

    Returns
    -------
    Series of int, length n, or NoNumber, or None
        In universal time where a zone is written. The first cell of another form than the first
        one; None if that is no date, and none due.
    """
    import polars as pl

    text = cells.str.strip_chars()
    text = text.set(text == "", None)
    filled = text.drop_nulls()
    if filled.is_empty():
        return text.cast(pl.Int64) if due else None
    written = _form(str(filled[0]))
    if written is None:
        row = int(text.is_not_null().arg_max() or 0)
        return NoNumber(row, str(cells[row])) if due else None
    # a comma before the fraction, a zone and a half of the day are what is left of local habits
    plain = text.str.replace(",", ".", literal=True)
    zone = plain.str.extract(r" ?(Z|[+-]\d{2}:?\d{2})$")
    if written[:2] == "%Y" and zone.is_not_null().any():
        plain = plain.str.replace(r" ?(Z|[+-]\d{2}:?\d{2})$", "")
        hours = zone.str.extract(r"^([+-]\d{2})").cast(pl.Int64).fill_null(0)
        minutes = zone.str.extract(r"(\d{2})$").cast(pl.Int64).fill_null(0)
        sign = 1 - 2 * zone.str.starts_with("-").fill_null(False).cast(pl.Int64)
        ahead = (hours.abs() * 60 + minutes) * sign * 60_000_000
    else:
        ahead = pl.Series([0])
    half = plain.str.extract(r"(?i) ?([ap])\.?m\.?$").str.to_lowercase()
    if half.is_not_null().any():
        plain = plain.str.replace(r"(?i) ?[ap]\.?m\.?$", "")
        noon = plain.str.extract(r"(\d{1,2}):\d{2}:\d{2}").cast(pl.Int64) == 12
        shift = ((half == "p") & ~noon).cast(pl.Int64) - ((half == "a") & noon).cast(pl.Int64)
        ahead = ahead - shift.fill_null(0) * (DAY // 2)
    if written.startswith("%H"):
        plain, written = "1970-01-01 " + plain, f"%Y-%m-%d {written}"
    found = plain.str.to_datetime(written, time_unit="us", strict=False)
    other = found.is_null() & text.is_not_null()
    if other.any():
        row = int(other.arg_max() or 0)
        return NoNumber(row, str(cells[row]))
    return found.cast(pl.Int64) - ahead
