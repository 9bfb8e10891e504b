"""A long log as a whole: what its signals do in it, and which of its windows are experiments."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.schema import shown_unit
from swashplate.results import Result, figures
from swashplate.tables import Column, Table
from swashplate.units import display_unit

if TYPE_CHECKING:
    from pathlib import Path

    from swashplate.results import Figure


Array = NDArray[np.float64]


class LogWindow(NamedTuple):
    """Rows of a long log in which an input moves, with the rest around them."""

    first: int
    last: int
    """From the first row, counted from 0, to before the last one."""
    begin: float
    end: float
    """About when. [s]"""
    resumes: bool
    """Whether it begins in the midst of a motion."""
    used: bool
    """Whether it is an experiment."""


@dataclass(frozen=True, eq=False)
class BlockRanges(Result):
    """Lowest and highest samples of a signal in each of the blocks of a long log."""

    name: str
    """``"input"`` or the channel's name."""
    axis: str
    kind: str
    unit: str
    """Of `low` and `high`, SI."""
    time: Array
    """(n,) the first stamp of each block. [s]"""
    end: float
    """The last stamp. [s]"""
    low: Array
    high: Array
    """(n,) as recorded: a counter that wraps does so here; NaN in a block without a number.
    [unit]"""
    missing: int
    """Samples that are not a finite number."""
    period: float
    """Usual interval of its stamps. [s]"""
    longest: float
    """Longest interval of its stamps. [s]"""

    @property
    def shown_unit(self) -> str:
        """Its unit as of `swashplate.units.display_unit`, which knows a shaft's angle."""
        return shown_unit(self.kind, self.unit)


@dataclass(frozen=True, eq=False)
class Overview(Result):
    """A log of more rows than one run has: its signals, and its windows with motion."""

    run: str
    rows: int
    signals: tuple[BlockRanges, ...]
    """The input and the channels of each axis."""
    windows: tuple[LogWindow, ...]
    """Those with motion, in the order of time."""
    read_from: Path | None = None
    """The table that stands for the log, if one was written next to it."""

    @property
    def begin(self) -> float:
        """Its first stamp. [s]"""
        return min(float(signal.time[0]) for signal in self.signals)

    @property
    def end(self) -> float:
        """Its last stamp. [s]"""
        return max(signal.end for signal in self.signals)

    @property
    def sentence(self) -> str:
        """How many of its windows, and how many rows, are experiments."""
        used = [window for window in self.windows if window.used]
        rows = sum(window.last - window.first for window in used)
        moving = sum(window.last - window.first for window in self.windows)
        total = len(self.windows)
        text = f"{self.run}: the log has {self.rows:,} rows, {moving:,} of them in "
        text += "one window with motion" if total == 1 else f"{total} windows with motion"
        if len(used) == total:
            text += ", which is used" if total == 1 else ", which are all used"
        else:
            text += f"; {len(used)} of them, {rows:,} rows, spread over the log, "
            text += "is used" if len(used) == 1 else "are used"
        if self.read_from is not None:
            text += f"; its rows are read from {self.read_from.name}, written next to it"
        return f"{text}."

    def table(self) -> Table:
        """What each signal does in the whole log: range, longest interval, missing samples."""
        table = Table(
            f"{self.run}, the whole log: {self.end - self.begin:.4g} s, {self.rows:,} rows",
            (
                Column("axis", of="pf"),
                Column("signal", wrap=True),
                Column("kind"),
                Column("Hz", ".4g"),
                Column("gap", "s"),
                Column("range"),
                Column("missing", ",d"),
            ),
        )
        for signal in self.signals:
            finite = np.isfinite(signal.low)
            range_text = "no number"
            if finite.any():
                low, high = float(signal.low[finite].min()), float(signal.high[finite].max())
                display = display_unit(signal.shown_unit, max(abs(low), abs(high)))
                range_text = (
                    f"{display.factor * low:z.4g} to {display.factor * high:z.4g} {display.name}"
                )
            table.add(
                signal.axis,
                signal.name,
                signal.kind.replace("_", " "),
                1.0 / signal.period,
                f"{1e3 * signal.longest:.3g}" if signal.longest > 1.5 * signal.period else "-",
                range_text.rstrip(),
                signal.missing,
            )
        return table

    def plot(self, *, title: str | None = None) -> Figure:
        """Figure of the whole log, as of `swashplate.report.figures.plot_overview`."""
        return cast("Figure", figures().plot_overview(self, title=title))
