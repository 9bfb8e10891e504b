"""Time stamps and inputs that can be computed with, or a sentence about the first that cannot."""

from __future__ import annotations

import numpy as np

from swashplate.errors import FileError
from swashplate.logs.log import Array, Log


def check_stamps(log: Log, column: str, stamps: Array) -> None:
    """Refuse time stamps that are missing, not finite, or do not increase.

    Parameters
    ----------
    log : Log
        Where they are from.
    column : str
        Its name, for the sentence.
    stamps : array, shape (n,)
        In the file's own unit; there must be at least one.

    Raises
    ------
    FileError
        The sentence names file, column and data row; the first row is 1.
    """
    check_finite(log, column, stamps)
    late = np.flatnonzero(np.diff(stamps) <= 0.0)
    if not late.size:
        return
    row = int(late[0])
    before, after = float(stamps[row]), float(stamps[row + 1])
    what = (
        f"has {before!r} twice, in data rows {row + 1} and {row + 2}"
        if before == after
        else f"goes back from {before!r} to {after!r} in data row {row + 2}"
    )
    others = f", the first of {late.size} such rows" if late.size > 1 else ""
    raise FileError(f"{log.path}: column '{column}' {what}{others}; time stamps must increase.")


def check_finite(log: Log, column: str, values: Array) -> None:
    """Refuse a column with a number missing, or not finite.

    Parameters
    ----------
    log : Log
        Where it is from.
    column : str
        Its name, for the sentence.
    values : array, shape (n,)
        There must be at least one.

    Raises
    ------
    FileError
        The sentence names file, column and data row; the first row is 1.
    """
    if not values.size:
        raise FileError(f"{log.path}: column '{column}' has no rows.")
    missing = np.flatnonzero(np.isnan(values))
    if missing.size:
        raise FileError(
            f"{log.path}: column '{column}' is empty or NaN in {_rows(missing)}; "
            "a number must be in every row."
        )
    infinite = np.flatnonzero(np.isinf(values))
    if infinite.size:
        raise FileError(
            f"{log.path}: column '{column}' holds {float(values[infinite[0]])!r} in "
            f"{_rows(infinite)}; numbers must be finite."
        )


def _rows(wrong: np.ndarray[tuple[int, ...], np.dtype[np.intp]]) -> str:
    """The first run of rows, and how many there are besides."""
    first = int(wrong[0])
    gaps = np.flatnonzero(np.diff(wrong) > 1)
    run = int(gaps[0]) + 1 if gaps.size else wrong.size
    rows = f"data row {first + 1}" if run == 1 else f"data rows {first + 1} to {first + run}"
    return rows if run == wrong.size else f"{rows} and {wrong.size - run} more"
