"""Scatter diagrams: how often each sea comes, by its significant height and peak period."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.documents import read_text
from swashplate.errors import InputError
from swashplate.results import Result

Array = NDArray[np.float64]

SYNTHETIC = "synthetic"
"""The packaged diagram, of no place."""
NAMES = {"hs": "height", "tp": "period", "share": "share"}
"""Columns of a file."""


@dataclass(frozen=True, eq=False)
class Scatter(Result):
    """Seas of a year, a row for each cell that has some.

    Raises
    ------
    InputError
        For rows of different lengths, none, a height, period or share that is not above 0, and two
        rows of one sea.
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
        seas = list(zip(columns[0].tolist(), columns[1].tolist(), strict=True))
        twice = [sea for row, sea in enumerate(seas) if sea in seas[:row]]
        if twice:
            raise InputError(
                f"The scatter diagram has the sea of {twice[0][0]:g} m and {twice[0][1]:g} s "
                "twice: add up their shares."
            )
        some = columns[2] > 0.0
        if not some.any():
            raise InputError("All shares of the scatter diagram are 0.")
        heights, periods, shares = (values[some] for values in columns)
        return cls(heights, periods, shares / shares.sum(), note)

    @classmethod
    def from_csv(cls, path: str | Path) -> Scatter:
        """A diagram of a file with the columns hs [m], tp [s] and share, in any order.

        A `FileError` or `InputError` names file, row and column.
        """
        return _parsed(read_text(path), str(path))

    @classmethod
    def packaged(cls) -> Scatter:
        """A made-up diagram, of no place: for a first look, never for an answer."""
        text = (files("swashplate.crane") / "sets" / f"{SYNTHETIC}.csv").read_text("utf-8")
        return _parsed(
            text, SYNTHETIC, "The scatter diagram is fictitious: supply one of your site."
        )


def _parsed(text: str, origin: str, note: str = "") -> Scatter:
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.startswith("#")
    ]
    first = lines[0][1].split(",") if lines else []
    names = [head.split("[")[0].strip().lower() for head in first]
    lacks = [name for name in NAMES if name not in names]
    if lacks:
        raise InputError(
            f"{origin}: a scatter diagram has the columns hs, tp and share in its first line; "
            f"{lacks[0]} is missing."
        )
    columns: dict[str, list[float]] = {name: [] for name in NAMES}
    for number, line in lines[1:]:
        entries = line.split(",")
        if len(entries) != len(names):
            raise InputError(
                f"{origin}: line {number} has {len(entries)} entries, but the first has "
                f"{len(names)}."
            )
        for name in NAMES:
            entry = entries[names.index(name)]
            try:
                columns[name].append(float(entry))
            except ValueError:
                raise InputError(
                    f"{origin}: line {number}: {name} is '{entry.strip()}', but must be a number."
                ) from None
    try:
        return Scatter.of(columns["hs"], columns["tp"], columns["share"], note)
    except InputError as error:
        raise InputError(f"{origin}: {error}") from None
