"""Figure of a what-if: the speeds before and after, their bands, and the accelerations."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from swashplate.analysis.monte_carlo import Bands
from swashplate.analysis.whatif import AS_IS, CHANGED, WhatIf
from swashplate.report.bands_view import shade_band
from swashplate.report.style import (
    BLUE,
    FAINT,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    Margins,
    Stroke,
    dress,
    label_below,
    legend_rows,
    line_up_labels,
    margins,
    new_figure,
    put_legend,
    write_title,
    zero_line,
)
from swashplate.report.traces import draw, fit_time

WIDTH = 8.6
HEIGHTS, GAP, ROW = (1.2, 2.8, 1.8), 0.3, 0.17
BAND_HEIGHT = 1.3
AROUND = Margins(left=0.95, right=0.25, bottom=0.55, top=0.57)
"""Sizes; the legend's rows add to the margin at the top. [inch]"""

LABELS = (
    "voltage (V)",
    "shaft speed (deg/s)",
    "acceleration (deg/s²)",
    "about the median (deg/s)",
)
MOST_ALONE = 5
"""Levers that are drawn by themselves, too; more would hide the answer."""
NO_BANDS: Mapping[str, Bands] = MappingProxyType({})


def plot_whatif(
    result: WhatIf, *, bands: Mapping[str, Bands] = NO_BANDS, title: str | None = None
) -> Figure:
    """Figure of the command, the speeds and the accelerations of a drive before and after.

    Parameters
    ----------
    result : WhatIf
        What `analysis.whatif.what_if` found. The wanted speed is drawn dotted, the speed limits
        before and after as thin lines.
    bands : mapping of str to Bands, optional
        By variant (``"as it is"``, ``"changed"``) the band that its speed lies in; a panel more
        shows it enlarged, about its median.
    title : str, optional
        By default it says what was moved.
    """
    looks = _looks(result)
    words = [*looks, "wanted"]
    around = AROUND._replace(top=AROUND.top + ROW * legend_rows(words, WIDTH - AROUND.left))
    heights = (*HEIGHTS, BAND_HEIGHT) if bands else HEIGHTS
    total = around.bottom + around.top + sum(heights) + GAP * (len(heights) - 1)
    figure = new_figure(WIDTH, total)
    axes = figure.subplots(
        len(heights),
        sharex=True,
        gridspec_kw={
            **margins(figure, around),
            "height_ratios": heights,
            "hspace": GAP * len(heights) / sum(heights),
        },
    )
    for ax, label in zip(axes, LABELS, strict=False):
        dress(ax, label)
        zero_line(ax)
    time = result.before.run.time
    draw(axes[0], time, result.trial.voltage, INK, zorder=3.0)
    _limits(axes[1], result, looks)
    for name, band in bands.items():
        shade_band(axes[1], band, looks[name].color)
        shade_band(axes[3], band, looks[name].color, about=band.median)
    draw(axes[1], time, np.degrees(result.trial.wanted), GREY, dashes="dotted", zorder=1.9)
    for name, look in looks.items():
        speed = np.degrees(result.variants[name].run.shaft_speed)
        middle = 0.5 * (time[1:] + time[:-1])
        acceleration = np.diff(speed) * result.trial.rate
        order = 3.0 if name in (AS_IS, CHANGED) else 2.0
        draw(axes[1], time, speed, look.color, dashes=look.dashes, zorder=order)
        draw(axes[2], middle, acceleration, look.color, dashes=look.dashes, zorder=order)
    fit_time(axes[-1], time)
    label_below(axes[-1], "time (s)")
    line_up_labels(figure, axes, 0.62)
    moved = ", ".join(f"{name} x {factor:g}" for name, factor in result.factors.items())
    write_title(figure, f"{result.before.drive.name}: {moved}" if title is None else title, 0.95)
    handles = [
        *(_handle(name, look) for name, look in looks.items()),
        _handle("wanted", Stroke(GREY, "dotted")),
    ]
    put_legend(figure, handles, AROUND.left, 0.42)
    return figure


def _handle(name: str, look: Stroke) -> Line2D:
    return Line2D([], [], color=look.color, linestyle=look.dashes, linewidth=2.0, label=name)


def _looks(result: WhatIf) -> dict[str, Stroke]:
    """The drive as it is and changed in strong colours, single levers dashed."""
    alone = [name for name in result.variants if name not in (AS_IS, CHANGED)][:MOST_ALONE]
    colors = (GREEN, PURPLE, ORANGE, SKY, FAINT)
    return {
        AS_IS: Stroke(BLUE, "solid"),
        **{name: Stroke(color, "dashed") for name, color in zip(alone, colors, strict=False)},
        CHANGED: Stroke(VERMILION, "solid"),
    }


def _limits(ax: Axes, result: WhatIf, looks: Mapping[str, Stroke]) -> None:
    """Speed limits of the two drives, as far as the command's direction goes."""
    voltage = result.trial.voltage
    for name in (AS_IS, CHANGED):
        up, down = result.variants[name].speed_limits
        for limit, used in ((up, (voltage > 0.0).any()), (down, (voltage < 0.0).any())):
            if used:
                ax.axhline(np.degrees(limit), color=looks[name].color, linewidth=0.6, alpha=0.5)
