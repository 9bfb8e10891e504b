"""Figure of which limit acts when, under the voltage and the speed."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from swashplate.analysis.limits import LimitTimeline, limit_timeline
from swashplate.errors import InputError
from swashplate.report.shading import MOST_RUNS, SHADES, merged
from swashplate.report.style import (
    BLUE,
    GREY,
    INK,
    SMALL,
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
from swashplate.simulation.result import Simulation

WIDTH = 8.6
COMMAND, SPEED, ROW, GAP = 1.1, 2.2, 0.27, 0.22
AROUND = Margins(left=1.75, right=0.6, bottom=0.55, top=0.72)
"""Sizes; a row for each limit. [inch]"""
BAR = 0.72
"""Height of a bar as part of its row."""


def plot_limit_timeline(
    run: Simulation, *, wanted: ArrayLike | None = None, title: str | None = None
) -> Figure:
    """Figure of voltage and speed over time, and below a row for each limit that acts.

    Parameters
    ----------
    run : Simulation
        What to show.
    wanted : (n,) array_like, optional
        The speed of a drive without limits, or another wanted one, to draw dashed. [rad/s]
    title : str, optional
        By default the name of the drive.

    Raises
    ------
    InputError
        If the wanted speed has another length than the run.
    """
    timeline = limit_timeline(run)
    asked = None if wanted is None else np.asarray(wanted, dtype=np.float64)
    if asked is not None and asked.shape != run.time.shape:
        raise InputError(
            f"The wanted speed has shape {asked.shape}, but the run has {run.time.size} samples."
        )
    heights = (COMMAND, SPEED, ROW * max(len(timeline.limits), 1))
    total = AROUND.bottom + AROUND.top + sum(heights) + GAP * (len(heights) - 1)
    figure = new_figure(WIDTH, total)
    axes = figure.subplots(
        len(heights),
        sharex=True,
        gridspec_kw={
            **margins(figure, AROUND),
            "height_ratios": heights,
            "hspace": GAP * len(heights) / sum(heights),
        },
    )
    command, speed, rows = axes
    volts = run.voltage
    dress(command, "current\n(A)" if volts is None else "voltage\n(V)")
    draw(command, run.time, run.current if volts is None else volts, INK)
    dress(speed, "speed\n(deg/s)")
    handles = [Line2D([], [], color=BLUE, linewidth=2.0, label="speed")]
    if asked is not None:
        draw(speed, run.time, np.degrees(asked), GREY, dashes="dashed")
        handles.append(
            Line2D([], [], color=GREY, linestyle="dashed", linewidth=2.0, label="without limits")
        )
    draw(speed, run.time, np.degrees(run.shaft_speed), BLUE)
    for ax in (command, speed):
        zero_line(ax)
    _bars(rows, timeline, float(run.time[-1] - run.time[0]))
    fit_time(rows, run.time)
    label_below(rows, "time (s)")
    line_up_labels(figure, (command, speed), 0.58)
    write_title(figure, run.name if title is None else title, 0.3)
    put_legend(figure, handles, AROUND.left, 0.42)
    return figure


def _bars(ax: Axes, timeline: LimitTimeline, length: float) -> None:
    dress(ax)
    count = len(timeline.limits)
    ax.set_ylim(max(count, 1) - 0.5, -0.5)
    ax.set_yticks(range(count), [SHADES[limit].name for limit in timeline.limits])
    ax.grid(False, axis="y")
    for row, (limit, spans) in enumerate(zip(timeline.limits, timeline.spans, strict=True)):
        ax.broken_barh(
            [(begin, end - begin) for begin, end in merged(spans, length / MOST_RUNS).tolist()],
            (row - 0.5 * BAR, BAR),
            facecolor=SHADES[limit].color,
            edgecolor=GREY,
            linewidth=0.4,
        )
    for row, share in enumerate(timeline.shares):
        ax.annotate(
            f"{100.0 * share:.1f} %",
            (1.0, row),
            xycoords=ax.get_yaxis_transform(),
            xytext=(5.0, 0.0),
            textcoords="offset points",
            fontsize=SMALL,
            color=INK,
            va="center",
            annotation_clip=False,
        )
    if not count:
        ax.text(0.5, 0.5, "no limit acts", transform=ax.transAxes, fontsize=SMALL, ha="center")
