"""Scatter diagrams: how often each sea comes, by its significant height and peak period."""

from __future__ import annotations

import re
from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.crane.sea.seaway import Spectrum
from swashplate.errors import FileError, InputError
from swashplate.logs import Log, LogColumn, open_log, unit_of
from swashplate.results import Result
from swashplate.units import scaling

Array = NDArray[np.float64]

SYNTHETIC = "synthetic"
"""The packaged diagram, of no place."""
UNITS = {"hs": "m", "tp": "s"}
"""SI units of a file's columns; its shares are divided by their sum, whatever they count."""
NAMES = (*UNITS, "share")
"""Columns of a file."""
MOST_LISTED = 8
"""Columns that a refusal lists."""


@dataclass(frozen=True, eq=False)
class Scatter(Result):
    """Seas of a year, a row for each cell that has some.

    Raises
    ------
    InputError
        For rows of different lengths, none, a height, period or share that is not above 0, a sea
        that `Spectrum` refuses, and two rows of one sea.
    """

    height: Array
    """Significant wave height. [m]"""
    period: Array
    """Of the peak. [s]"""
    share: Array
    """Of the year, adding up to 1."""
    note: str = ""
    """Sentence on its source; empty for a diagram of the user."""

    @classmethod
    def of(cls, height: ArrayLike, period: ArrayLike, share: ArrayLike, note: str = "") -> Scatter:
        """A diagram of columns; shares may be counts or per cent, and are divided by their sum."""
        columns = [np.asarray(values, dtype=np.float64) for values in (height, period, share)]
        if len({values.shape for values in columns}) != 1 or columns[0].ndim != 1:
            raise InputError("A scatter diagram has as many heights as periods and shares.")
        if not columns[0].size:
            raise InputError("A scatter diagram needs at least one row: height, period, share.")
        for name, values in zip(("height", "period", "share"), columns, strict=True):
            wrong = np.flatnonzero(~(np.isfinite(values) & (values >= 0.0)))
            if name != "share":
                wrong = np.flatnonzero(~(np.isfinite(values) & (values > 0.0)))
            if wrong.size:
                raise InputError(
                    f"Row {wrong[0] + 1} of the scatter diagram has a {name} of "
                    f"{values[wrong[0]]:g}, but must have a number above 0."
                )
        seas, rows = np.unique(np.stack(columns[:2], axis=1), axis=0, return_counts=True)
        twice = seas[rows > 1]
        if twice.size:
            raise InputError(
                f"The scatter diagram has the sea of {twice[0][0]:g} m and {twice[0][1]:g} s "
                "twice: add up their shares."
            )
        some = columns[2] > 0.0
        if not some.any():
            raise InputError("All shares of the scatter diagram are 0.")
        heights, periods, shares = (values[some] for values in columns)
        order = np.lexsort((heights, periods))
        last = np.flatnonzero(np.diff(periods[order], append=np.inf) > 0.0)
        # the lowest sea, and the highest of each period, or it is refused
        for row in (int(np.argmin(heights)), *order[last].tolist()):
            Spectrum(float(heights[row]), float(periods[row]))
        shares = shares / shares.max()  # whose sum is finite
        return cls(heights, periods, shares / shares.sum(), note)

    @classmethod
    def from_csv(cls, path: str | Path) -> Scatter:
        """A diagram of a file with the columns hs [m], tp [s] and share, in any order.

        The file is read as a log is: separators, quotes, decimal signs and units are those of the
        file. A `FileError` or `InputError` names file, row and column.
        """
        return _read(open_log(path))

    @classmethod
    def packaged(cls) -> Scatter:
        """A made-up diagram, of no place: for a first look, never for an answer."""
        with as_file(files("swashplate.crane") / "sets" / f"{SYNTHETIC}.csv") as path:
            return _read(
                open_log(path), "The scatter diagram is fictitious: supply one of your site."
            )


def _read(log: Log, note: str = "") -> Scatter:
    """The diagram of a file, in SI."""
    columns = {name: _column_of(log, name) for name in NAMES}
    read = log.read([column.name for column in columns.values()])
    values = {name: read[column.name] for name, column in columns.items()}
    for name, column in columns.items():
        if name in UNITS:
            si = UNITS[name]
            unit = unit_of(column, name, si)
            factor, zero = scaling(unit, si, f"{log.path}: column '{column.name}'")
            values[name] = factor * values[name] + zero
    try:
        return Scatter.of(values["hs"], values["tp"], values["share"], note)
    except InputError as error:
        raise InputError(f"{log.path}: {error}") from None


def _column_of(log: Log, name: str) -> LogColumn:
    """The only column of a name, in capitals or not, with its unit or without it."""
    found = [column for column in log.columns if _is_called(column, name)]
    if not found:
        listed = ", ".join(repr(column.name) for column in log.columns[:MOST_LISTED])
        raise FileError(
            f"{log.path}: a scatter diagram has the columns hs, tp and share in its first line; "
            f"{name} is missing. It has {listed}."
        )
    if len(found) > 1:
        listed = " and ".join(repr(column.name) for column in found)
        raise FileError(f"{log.path} has more than one column of {name}: {listed}; keep one.")
    return found[0]


def _is_called(column: LogColumn, name: str) -> bool:
    """Whether a column has a name, before its unit or number if there is one."""
    bare = re.split(r"[\[(#]", column.name)[0].strip().lower()
    return bare == name or bare.startswith(f"{name}_")
