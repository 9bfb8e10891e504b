"""Weights of a channel's samples, drawn along the foot of its panel."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from swashplate.report.broken_lines import thinned
from swashplate.report.campaign_marks import MOST_SPANS, WEIGHTED
from swashplate.report.style import POINTS_PER_INCH, SMALL

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

FOOT = 0.16
"""Height of the largest weight. [inch]"""
FACTOR = "#8c3f68"
"""Colour of the factors written on it."""
_LETTER = 0.62
"""Width of a digit, in sizes of letters, on the safe side."""


def usual_weight(weight: Array) -> float:
    """The most frequent weight of those that are not zero; 1 if all are."""
    used = weight[weight > 0.0]
    if not used.size:
        return 1.0
    values, counts = np.unique(used, return_counts=True)
    return float(values[np.argmax(counts)])


def has_weights(weight: Array) -> bool:
    """Whether samples that count, count differently."""
    used = weight[weight > 0.0]
    return bool(used.size and used.max() > used.min())


def mark_weights(ax: Axes, time: Array, weight: Array) -> None:
    """Draw the weights along a panel's foot, the largest `FOOT` high, and write their factors.

    Parameters
    ----------
    ax : Axes
        Its limits must be final.
    time, weight : (m,) arrays
        Stamps [s] and weights of the samples. A stretch of one weight that is at least twice the
        usual one, or at most half of it, has its factor written beside it, ``×10``, as far as
        there is room.
    """
    if not has_weights(weight):
        return
    foot = FOOT / _inches(ax)[1]
    turns = np.flatnonzero(np.diff(weight)) + 1
    stepped = turns.size < MOST_SPANS
    if stepped:
        rows = np.unique(np.r_[0, turns - 1, turns, weight.size - 1])
    else:
        # they follow the input and change from sample to sample
        rows = thinned(time, weight, np.empty(0, dtype=np.intp), MOST_SPANS)
    ax.fill_between(
        time[rows],
        foot * weight[rows] / float(weight.max()),
        transform=ax.get_xaxis_transform(),
        color=WEIGHTED,
        linewidth=0.0,
        zorder=1.0,
        label="weight",
    )
    if stepped:
        _write_factors(ax, time, weight, turns, 0.25 * foot)


def _write_factors(ax: Axes, time: Array, weight: Array, turns: Rows, height: float) -> None:
    """Write beside each stretch of one weight how many times the usual one it is, with room."""
    firsts = np.r_[0, turns]
    starts, ends = time[firsts], time[np.r_[turns - 1, weight.size - 1]]
    factors = weight[firsts] / usual_weight(weight)
    first, last = ax.get_xlim()
    inch = (last - first) / _inches(ax)[0]
    apart = np.flatnonzero((factors > 0.0) & ((factors >= 2.0) | (factors <= 0.5)))
    for index, following in zip(apart, np.append(starts[apart], last)[1:], strict=True):
        words = f"×{factors[index]:.3g}"
        letters = _LETTER * SMALL / POINTS_PER_INCH * (len(words) + 1)
        if following - ends[index] > letters * inch:
            ax.annotate(
                words,
                (float(ends[index]), height),
                xycoords=ax.get_xaxis_transform(),
                xytext=(2.0, 0.0),
                textcoords="offset points",
                fontsize=SMALL,
                color=FACTOR,
                va="bottom",
            )


def _inches(ax: Axes) -> tuple[float, float]:
    """Width and height of a panel."""
    figure = ax.get_figure(root=True)
    assert figure is not None  # a panel of ours is on one
    width, height = figure.get_size_inches()
    box = ax.get_position()
    return box.width * width, box.height * height
