"""Numbers in text: what is one, in either decimal sign, and whole columns of them."""

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
