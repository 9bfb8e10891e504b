"""Date and clock stamps in text, as microseconds."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from swashplate.logs.text.numbers import NoNumber

if TYPE_CHECKING:
    import polars

_CLOCK = r"\d{1,2}:\d{2}:\d{2}(?:[.,]\d{1,9})?"
_FORMS = (
    (re.compile(rf"\d{{4}}-\d{{2}}-\d{{2}} {_CLOCK}Z?", re.ASCII), "%Y-%m-%d %H:%M:%S%.f"),
    (re.compile(rf"\d{{4}}-\d{{2}}-\d{{2}}T{_CLOCK}Z?", re.ASCII), "%Y-%m-%dT%H:%M:%S%.f"),
    (re.compile(rf"\d{{4}}/\d{{2}}/\d{{2}} {_CLOCK}", re.ASCII), "%Y/%m/%d %H:%M:%S%.f"),
    (re.compile(rf"\d{{2}}\.\d{{2}}\.\d{{4}} {_CLOCK}", re.ASCII), "%d.%m.%Y %H:%M:%S%.f"),
    (re.compile(_CLOCK, re.ASCII), "%H:%M:%S%.f"),
)
"""Forms that can be read in one way only; 03/04/2026 is none of them."""


def is_date(cell: str) -> bool:
    """Whether a cell, stripped, is a date with a clock time, or a clock time."""
    return any(form.fullmatch(cell) for form, _ in _FORMS)


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
        The first cell of another form than the first one; None if that is no date, and none due.
    """
    import polars as pl

    text = cells.str.strip_chars()
    text = text.set(text == "", None)
    filled = text.drop_nulls()
    if filled.is_empty():
        return text.cast(pl.Int64) if due else None
    written = next((written for form, written in _FORMS if form.fullmatch(str(filled[0]))), None)
    if written is None:
        row = int(text.is_not_null().arg_max() or 0)
        return NoNumber(row, str(cells[row])) if due else None
    # a comma before the fraction, and the Z of universal time, are what is left of local habits
    plain = text.str.replace(",", ".", literal=True).str.strip_suffix("Z")
    if written.startswith("%H"):
        plain, written = "1970-01-01 " + plain, f"%Y-%m-%d {written}"
    found = plain.str.to_datetime(written, time_unit="us", strict=False)
    other = found.is_null() & text.is_not_null()
    if other.any():
        row = int(other.arg_max() or 0)
        return NoNumber(row, str(cells[row]))
    return found.cast(pl.Int64)
