"""Speeds made from a position, method by method: which can be used, how their lines look."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from swashplate.report.broken_lines import draw_broken
from swashplate.report.display_units import DisplayUnit
from swashplate.report.style import BLUE, GREEN, LINE, THIN, Dashes

if TYPE_CHECKING:
    from swashplate.campaign import Channel, Method, Speed

Array = NDArray[np.float64]

SOURCE_RATE = 512.0
"""Rate that the source's explicit filters are made for. [Hz]"""
ROUGH = "#d2d2d2"
"""Colour of the plain difference, which fills its panel where the count changes often."""
ROOM = 0.12
"""Empty share of a panel above and below."""


class Look(NamedTuple):
    """How a method's line looks, and its name."""

    color: str
    dashes: Dashes
    width: float
    zorder: float
    words: str


LOOKS: dict[Method, Look] = {
    "difference": Look(ROUGH, "solid", THIN, 1.3, "plain difference"),
    "source": Look(BLUE, "solid", LINE, 2.0, "10 and 30 Hz filters"),
    "exact": Look(BLUE, "solid", LINE, 2.0, "10 and 30 Hz filters, exact form"),
    "savitzky_golay": Look(GREEN, "dashed", LINE, 2.2, "Savitzky-Golay"),
}


def usable_methods(channel: Channel) -> tuple[Method, ...]:
    """The methods that a channel's stamps allow."""
    from swashplate.campaign import stamps_of

    period = stamps_of(channel.time).period
    methods: list[Method] = ["difference"]
    if period is not None and abs(period * SOURCE_RATE - 1.0) < 1e-3:
        methods.append("source")
    else:
        methods.append("exact")
    if period is not None:
        methods.append("savitzky_golay")
    return tuple(methods)


def cut(speed: Speed, time: Array) -> Speed:
    """The part of a speed between the first and the last of some stamps."""
    rows = slice(
        int(np.searchsorted(speed.time, time[0], side="left")),
        int(np.searchsorted(speed.time, time[-1], side="right")),
    )
    return speed._replace(time=speed.time[rows], speed=speed.speed[rows])


def reach_of(speeds: Mapping[Method, Speed]) -> tuple[float, float]:
    """Lowest and highest speed of all but the plain difference, if there is another."""
    smooth = [speed for method, speed in speeds.items() if method != "difference"]
    shown = [speed.speed for speed in smooth or speeds.values()]
    return min(float(each.min()) for each in shown), max(float(each.max()) for each in shown)


def draw_speed(ax: Axes, method: Method, speed: Speed, unit: DisplayUnit) -> None:
    """Draw a speed."""
    look = LOOKS[method]
    values = unit.factor * speed.speed
    draw_broken(
        ax,
        speed.time,
        values,
        look.color,
        dashes=look.dashes,
        width=look.width,
        zorder=look.zorder,
        label=method,
    )


def speed_handles(
    speeds: Mapping[Method, Speed], unit: DisplayUnit, reach: tuple[float, float]
) -> list[Line2D | Patch]:
    """Handles for a legend: names and delays, and how far a line goes beyond the panel.

    Parameters
    ----------
    speeds : mapping
        As they are shown, by their method.
    unit : DisplayUnit
        The panel's.
    reach : (float, float)
        Lowest and highest speed that the panel is made for, SI.
    """
    handles: list[Line2D | Patch] = []
    for method, speed in speeds.items():
        look = LOOKS[method]
        words = look.words
        low, high = float(speed.speed.min()), float(speed.speed.max())
        room = ROOM * (reach[1] - reach[0])
        if low < reach[0] - room or high > reach[1] + room:
            ends = f"{unit.factor * low:.4g} to {unit.factor * high:.4g}".replace("-", "−")
            words += f", from {ends} {unit.name}"
        if speed.delay > 0.0 and method != "difference":
            words += f", {1e3 * speed.delay:.1f} ms late"
        handles.append(
            Line2D(
                [], [], color=look.color, linestyle=look.dashes, linewidth=look.width, label=words
            )
        )
    return handles
