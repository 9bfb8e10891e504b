"""What a panel of a measured signal says beside its line: left out, weighted, clipped, missing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from swashplate.report.broken_lines import gap_rows
from swashplate.report.shading import merged
from swashplate.report.style import ORANGE, VERMILION

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


class Hatching(NamedTuple):
    """How stretches of time of one meaning look, and what the legend calls them."""

    face: str
    edge: str
    hatch: str
    name: str


IGNORED = Hatching("#ececec", "#d2d2d2", "////", "ignored")
MASKED = Hatching("#fbe6c6", "#eccb94", "\\\\\\\\", "masked")
WEIGHTED = "#e3b5cf"
"""Colour of the weights at a panel's foot."""
MOST_SPANS = 500
"""More stretches than this on one panel are merged where none could see the gap between them."""


def spans_of(time: Array, active: Mask) -> Array:
    """First and last stamp of each stretch of samples that are `active`, shape (m, 2). [s]"""
    turns = np.flatnonzero(np.diff(active, prepend=False, append=False))
    return np.stack((time[turns[::2]], time[turns[1::2] - 1]), axis=1)


def widened(time: Array, spans: Array) -> Array:
    """Stretches whose ends reach half a usual step further: a sample stands for its surroundings.

    Where the step to the next sample is shorter than usual, they may reach over it.
    """
    half = 0.5 * float(np.median(np.diff(time))) if time.size > 1 else 0.0
    wide: Array = spans + np.array([-half, half])
    return wide


def shade(ax: Axes, spans: Array, look: Hatching) -> None:
    """Shade stretches of time [s], shape (m, 2), and hatch them: a grey print shows it too."""
    if not spans.size:
        return
    shown = merged(spans, float(spans[-1, 1] - spans[0, 0]) / MOST_SPANS, MOST_SPANS)
    left, right = shown[:, 0], shown[:, 1]
    corners = np.empty((shown.shape[0], 4, 2))
    corners[:, :, 0] = np.stack((left, right, right, left), axis=1)
    corners[:, :, 1] = (0.0, 0.0, 1.0, 1.0)
    ax.add_collection(
        PolyCollection(
            list(corners),
            transform=ax.get_xaxis_transform(),
            facecolor=look.face,
            edgecolor=look.edge,
            hatch=look.hatch,
            linewidth=0.4,
            zorder=0.3,
            label=look.name,
        ),
        autolim=False,
    )


def hatched_patch(look: Hatching, words: str) -> Patch:
    """Handle for a legend of shaded stretches."""
    return Patch(
        facecolor=look.face, edgecolor=look.edge, hatch=look.hatch, linewidth=0.5, label=words
    )


def clipped(values: Array, limits: tuple[float, float] | None) -> Mask:
    """(n,) whether a sample is at the end of its instrument's range, or beyond."""
    if limits is None:
        return np.zeros(values.shape, dtype=np.bool_)
    low, high = limits
    # what a conversion of units rounds away is no distance from the end
    near = 1e-9 * (high - low)
    return (values <= low + near) | (values >= high - near)


def mark_clipped(ax: Axes, time: Array, values: Array, limits: tuple[float, float] | None) -> None:
    """Draw over clipped samples with a bar; all three in the panel's unit."""
    if limits is None:
        return
    active = clipped(values, limits)
    upper = values > 0.5 * (limits[0] + limits[1])
    width = float(time[-1] - time[0]) / MOST_SPANS
    for level, side in zip(limits, (active & ~upper, active & upper), strict=True):
        spans = merged(widened(time, spans_of(time, side)), width, MOST_SPANS)
        if spans.size:
            ax.hlines(
                np.full(spans.shape[0], level),
                spans[:, 0],
                spans[:, 1],
                color=ORANGE,
                linewidth=4.0,
                capstyle="projecting",
                zorder=1.9,
                label="clipped",
            )


def mark_gaps(ax: Axes, time: Array) -> None:
    """Point from the upper edge at each gap of the stamps [s], however short it is."""
    rows = gap_rows(time)
    if not rows.size:
        return
    middles = 0.5 * (time[rows] + time[rows + 1])
    ax.plot(
        middles,
        np.ones(middles.size),
        transform=ax.get_xaxis_transform(),
        linestyle="none",
        marker="v",
        markersize=3.5,
        markeredgewidth=0.0,
        color=VERMILION,
        clip_on=False,
        zorder=4.0,
        label="gap",
    )


def mark_handles(axes: Sequence[Axes], reasons: Sequence[str]) -> list[Patch | Line2D]:
    """Handles for a legend of the marks that are anywhere on these panels.

    Parameters
    ----------
    axes : sequence of Axes
        The panels.
    reasons : sequence of str
        Why stretches are ignored; named if they are few.
    """
    met = {
        artist.get_label() for ax in axes for artist in (*ax.collections, *ax.lines, *ax.patches)
    }
    why = "; ".join(dict.fromkeys(reason for reason in reasons if reason))
    handles: dict[str, Patch | Line2D] = {
        "ignored": hatched_patch(IGNORED, f"ignored: {why}" if 0 < len(why) <= 60 else "ignored"),
        "weight": Patch(facecolor=WEIGHTED, label="weight, relative to the largest"),
        "clipped": Patch(facecolor=ORANGE, label="at the end of the instrument's range"),
        "gap": Line2D(
            [],
            [],
            linestyle="none",
            marker="v",
            markersize=4.0,
            markeredgewidth=0.0,
            color=VERMILION,
            label="gap in the stamps",
        ),
    }
    return [handle for key, handle in handles.items() if key in met]
