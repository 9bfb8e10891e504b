"""Figure of an inverse steady-state map, and of what it buys."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from swashplate.analysis.compensation import InverseMap
from swashplate.analysis.tracking import Improvement, proportional_command
from swashplate.report.style import (
    FAINT,
    GREEN,
    GREY,
    INK,
    LINE,
    NORMAL,
    ORANGE,
    SMALL,
    VERMILION,
    Margins,
    dress,
    label_below,
    line_up_labels,
    margins,
    new_figure,
    put_legend,
    write_title,
    zero_line,
)
from swashplate.report.traces import draw, fit_time

WIDTH = 8.6
MAP, APART, PANEL, GAP = 2.9, 0.65, 1.7, 0.22
AROUND = Margins(left=0.85, right=0.25, bottom=0.55, top=0.75)
"""Sizes. [inch]"""
COLORS = (VERMILION, ORANGE, GREEN)
"""Of a straight line, the map, and the map with a lead."""
CLOSE_UP = 0.06
"""The panel on the right shows speeds up to this part of the smaller limit, or twice the gap."""
POINTS = 2001
ROOM = 1.25
"""How far the voltage's axis goes beyond the map, for the words there."""


def plot_compensation(
    inverse: InverseMap, improvement: Improvement | None = None, *, title: str | None = None
) -> Figure:
    """Figure of the voltage over the wanted speed, with a close-up at standstill.

    Parameters
    ----------
    inverse : InverseMap
        The map.
    improvement : Improvement, optional
        Runs to show below: the speeds and their errors.
    title : str, optional
        By default it says what is shown.
    """
    below = 0.0 if improvement is None else APART + 2.0 * PANEL + GAP
    figure = new_figure(WIDTH, AROUND.bottom + AROUND.top + MAP + below)
    upper = margins(figure, AROUND._replace(bottom=AROUND.bottom + below))
    grid = figure.add_gridspec(1, 2, **upper, wspace=0.2, width_ratios=(1.5, 1.0))
    whole, close = (figure.add_subplot(grid[0, column]) for column in (0, 1))
    _draw_map(whole, close, inverse)
    handles = [
        Line2D([], [], color=INK, linewidth=2.0, label="inverse map"),
        Line2D([], [], color=GREY, linestyle="dashed", linewidth=2.0, label="straight line"),
    ]
    left = [whole]
    if improvement is not None:
        handles = [
            Line2D([], [], color=INK, linewidth=2.0, label="map, wanted speed"),
            *(
                Line2D([], [], color=color, linewidth=2.0, label=f"with {way.name}")
                for way, color in zip(improvement.ways, COLORS, strict=True)
            ),
        ]
        lower = margins(figure, AROUND._replace(top=AROUND.top + MAP + APART))
        panels = figure.add_gridspec(2, 1, **lower, hspace=GAP / PANEL)
        speed = figure.add_subplot(panels[0])
        error = figure.add_subplot(panels[1], sharex=speed)
        _draw_runs(speed, error, improvement)
        left += [speed, error]
    line_up_labels(figure, left, 0.55)
    words = f"{inverse.name}: voltage for a wanted speed" if title is None else title
    write_title(figure, words, AROUND.left)
    put_legend(figure, handles, AROUND.left, 0.42)
    return figure


def _draw_map(whole: Axes, close: Axes, inverse: InverseMap) -> None:
    low, high = inverse.limits
    narrow = max(CLOSE_UP * min(-low, high), 2.0 * max(map(abs, inverse.gap)))
    for ax, ends in ((whole, (low, high)), (close, (max(low, -narrow), min(high, narrow)))):
        speed = np.union1d(np.linspace(*ends, POINTS), np.clip(inverse.gap, *ends))
        volts = inverse.voltage(speed)
        ax.plot(
            np.degrees(speed),
            proportional_command(inverse, speed),
            color=GREY,
            linestyle="dashed",
            linewidth=1.0,
        )
        ax.plot(np.degrees(speed), volts, color=INK, linewidth=LINE)
        dress(ax)
        zero_line(ax)
        ax.axvline(0.0, color=FAINT, linewidth=0.8, zorder=1.2)
        label_below(ax, "wanted speed (deg/s)")
    low_voltage, high_voltage = (float(inverse.voltage(end)) for end in (low, high))
    whole.set_ylim(ROOM * low_voltage, ROOM * high_voltage)
    whole.set_ylabel("voltage (V)", fontsize=NORMAL, color=INK)
    below, above = np.degrees(inverse.gap)
    close.axvspan(below, above, color="#ededed", linewidth=0.0, zorder=0.5)
    close.annotate(
        "cannot be held",
        (0.5 * (below + above), 0.0),
        xycoords=close.get_xaxis_transform(),
        xytext=(0.0, 4.0),
        textcoords="offset points",
        fontsize=SMALL,
        color=GREY,
        ha="center",
    )
    close.set_title("close-up around standstill", fontsize=SMALL, color=GREY, loc="left", pad=4.0)
    for end, height, side in ((low, low_voltage, "left"), (high, high_voltage, "right")):
        whole.plot([np.degrees(end)], [height], "o", color=INK, markersize=4.5)
        whole.annotate(
            f"{np.degrees(end):.4g} deg/s, {height:.3g} V".replace("-", "−"),
            (np.degrees(end), height),
            xytext=(0.0, -10.0) if side == "left" else (0.0, 10.0),
            textcoords="offset points",
            fontsize=SMALL,
            color=INK,
            ha=side,
            va="center",
        )


def _draw_runs(speed: Axes, error: Axes, improvement: Improvement) -> None:
    dress(speed, "speed (deg/s)")
    dress(error, "error (deg/s)")
    for ax in (speed, error):
        zero_line(ax)
    for way, color in zip(improvement.ways, COLORS, strict=True):
        done = np.degrees(way.run.shaft_speed)
        draw(speed, improvement.time, done, color)
        draw(error, improvement.time, done - np.degrees(improvement.wanted), color)
    draw(speed, improvement.time, np.degrees(improvement.wanted), INK, width=1.0, zorder=3.0)
    fit_time(error, improvement.time)
    speed.tick_params(labelbottom=False)
    label_below(error, "time (s)")
