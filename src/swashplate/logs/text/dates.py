"""Date and clock stamps in text, as microseconds."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from swashplate.logs.text.numbers import NoNumber

if TYPE_CHECKING:
    import polars

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
