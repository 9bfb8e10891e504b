"""A panel of signals over time: lines with their names in the margin, levels to compare with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from swashplate.report.style import (
    GREY,
    LINE,
    THIN,
    MarginLabel,
    dress,
    label_margin,
    zero_line,
)
from swashplate.report.traces import draw

Array = NDArray[np.float64]

WIDE, NARROW = 1.9, 0.9
"""Widths of two lines that lie on one another for long. [pt]"""

_NEAR = 0.3
"""A line that marks a limit is shown if the signal goes at least this share of the way to it."""


class Trace(NamedTuple):
    """A signal of a panel, in the panel's unit; its name if there is more than one."""

    values: Array
    color: str
    name: str = ""
    width: float = LINE


class Mark(NamedTuple):
    """A level that the signal should be compared with, in the panel's unit."""

    level: float
    words: str


def fill_panel(
    figure: Figure,
    ax: Axes,
    label: str,
    time: Array,
    traces: Sequence[Trace],
    marks: Sequence[Mark] = (),
    *,
    least: float = 0.0,
) -> None:
    """Draw signals over time, from zero on, with the marks that they come near to.

    Parameters
    ----------
    figure, ax : Figure, Axes
        Where.
    label : str
        Of the ordinate, with its unit.
    time : (n,) array
        [s]
    traces, marks : sequences
        What to draw, in the unit of the label.
    least : float
        Range that is shown at least, so that rounding looks like nothing.
    """
    dress(ax, label)
    zero_line(ax)
    low = min(float(trace.values.min()) for trace in traces)
    high = max(float(trace.values.max()) for trace in traces)
    near = [mark for mark in marks if _within_reach(mark.level, low, high)]
    low, high = min(low, *(m.level for m in near), 0.0), max(high, *(m.level for m in near), 0.0)
    spare = max(0.09 * (high - low), 0.5 * (least - (high - low))) or 1.0
    ax.set_ylim(low - spare, high + spare)
    labels = []
    for mark in near:
        ax.axhline(mark.level, color=GREY, linewidth=THIN, dashes=(5.0, 3.0), zorder=1.5)
        labels.append(MarginLabel(mark.level, mark.words, GREY))
    for trace in traces:
        draw(ax, time, trace.values, trace.color, width=trace.width)
        if trace.name:
            labels.append(MarginLabel(float(trace.values[-1]), trace.name, trace.color))
    label_margin(figure, ax, labels)


def _within_reach(level: float, low: float, high: float) -> bool:
    reached = high if level > 0.0 else -low
    return level != 0.0 and reached >= _NEAR * abs(level)
