"""Limits that act, as coloured stretches of time behind a signal."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.patches import Patch
from numpy.typing import NDArray

from swashplate.simulation.result import Limit, Simulation

Array = NDArray[np.float64]

MOST_RUNS = 2000
"""More stretches than this on one panel are merged where none could see the gap between them."""


class Shade(NamedTuple):
    """Colour of a limit and its name in the legend."""

    color: str
    name: str


# Opaque, so that what is shown is what the legend shows. Where limits act together, the later one
# in this order covers the earlier, which it implies or outweighs.
SHADES = {
    Limit.DEAD_ZONE: Shade("#ededed", "solenoid dead zone"),
    Limit.CURRENT_RATE: Shade("#f9d58b", "current rate"),
    Limit.ORIFICE: Shade("#c3e2f6", "orifice (acceleration)"),
    Limit.SPOOL: Shade("#e3a5c5", "spool stop"),
    Limit.SWASH_STOP: Shade("#b5e0cb", "swash stop (speed)"),
    Limit.RELIEF: Shade("#f3b79b", "relief valve"),
}


def shade_limits(ax: Axes, simulation: Simulation, limits: Iterable[Limit]) -> None:
    """Shade a panel wherever one of the limits acts."""
    for limit in limits:
        shade_stretches(ax, active_spans(simulation, limit), limit)


def shade_stretches(ax: Axes, spans: Array, limit: Limit) -> None:
    """Shade stretches of time, shape (m, 2), in the colour of a limit."""
    if not spans.size:
        return
    color, name = SHADES[limit]
    left, right = spans[:, 0], spans[:, 1]
    corners = np.empty((spans.shape[0], 4, 2))
    corners[:, :, 0] = np.stack((left, right, right, left), axis=1)
    corners[:, :, 1] = (0.0, 0.0, 1.0, 1.0)
    ax.add_collection(
        PolyCollection(
            list(corners),
            transform=ax.get_xaxis_transform(),
            facecolor=color,
            edgecolor=color,  # a thin edge, so that a single sample can be seen too
            linewidth=0.4,
            zorder=0.2 + 0.01 * int(limit).bit_length(),
            label=name,
        ),
        autolim=False,
    )


def active_spans(simulation: Simulation, limit: Limit) -> Array:
    """Beginning and end of each stretch of time in which a limit acts, shape (m, 2). [s]"""
    return stretches(simulation.active(limit), simulation.time, simulation.record.rate)


def stretches(active: NDArray[np.bool_], time: Array, rate: float) -> Array:
    """Beginning and end of each stretch of active samples, shape (m, 2). [s]

    A sample stands for the time up to half way to its neighbours.
    """
    turns = np.flatnonzero(np.diff(active, prepend=False, append=False))
    half = 0.5 / rate
    spans = np.stack((time[turns[::2]] - half, time[turns[1::2] - 1] + half), axis=1)
    return merged(spans, float(time[-1] - time[0]) / MOST_RUNS)


def merged(spans: Array, gap: float, most: int = MOST_RUNS) -> Array:
    """Join neighbours closer than `gap` if there are more than `most` spans."""
    if spans.shape[0] <= most:
        return spans
    apart = spans[1:, 0] - spans[:-1, 1] >= gap
    first = np.concatenate(([True], apart))
    last = np.concatenate((apart, [True]))
    return np.stack((spans[first, 0], spans[last, 1]), axis=1)


def shade_handles(simulation: Simulation) -> list[Patch]:
    """Handles for a legend of the limits that act anywhere in a simulation."""
    return [shade_handle(limit) for limit in SHADES if simulation.active(limit).any()]


def shade_handle(limit: Limit) -> Patch:
    """Handle for a legend of one limit."""
    color, name = SHADES[limit]
    return Patch(facecolor=color, edgecolor="#00000030", linewidth=0.5, label=name)
