"""Figure of an encoder: its staircase against what is made of it, and the speeds that follow."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from swashplate.errors import InputError
from swashplate.report.broken_lines import draw_broken
from swashplate.report.campaign_marks import mark_gaps
from swashplate.report.display_units import DisplayUnit, display_unit
from swashplate.report.speed_lines import (
    ROOM,
    cut,
    draw_speed,
    reach_of,
    speed_handles,
    usable_methods,
)
from swashplate.report.style import (
    BLUE,
    FAINT,
    GREY,
    INK,
    NORMAL,
    SMALL,
    THIN,
    Margins,
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
from swashplate.report.windows import rows_within

if TYPE_CHECKING:
    from swashplate.campaign import Channel, Encoder, Method


WIDTH = 8.6
HEIGHTS, GAP, ROW = (1.9, 2.4), 0.28, 0.17
AROUND = Margins(left=0.95, right=0.85, bottom=0.55, top=0.72)
"""Sizes; the rows of the speeds' legend add to the gap above them. [inch]"""
WIDE = 2.0
"""Width of the line that lies under the staircase and must show on both sides of it. [pt]"""


def plot_encoder(
    channel: Channel,
    *,
    methods: Sequence[Method] | None = None,
    window: tuple[float, float] | None = None,
    title: str | None = None,
) -> Figure:
    """Figure of a measured position, raw and interpolated, over the speeds that follow from it.

    Parameters
    ----------
    channel : Channel
        An encoder, or another position.
    methods : sequence of Method, optional
        How the speed is made (`campaign.speed_of`). By default all that the stamps and the
        channel allow: the plain difference; the source's filters, in their exact form where the
        stamps are uneven or not at 512 Hz; Savitzky and Golay's where they are even. The legend
        names them.
    window : (float, float), optional
        First and last instant to show [s]. Everything is computed from the whole record.
    title : str, optional
        By default the channel's name.

    Returns
    -------
    Figure
        Above, the staircase of the position (each sample held up to the next) and, of an encoder,
        the line between the changes of the count, with the counts on the right. Below, the speeds,
        with a band of two standard deviations on either side where the method tells them. The
        scale is that of the smooth speeds: how far the plain difference goes beyond it stands in
        the legend.

    Raises
    ------
    InputError
        If the channel measures no position, a method cannot be used with it, or the window holds
        fewer than two samples.
    """
    if not channel.is_position:
        raise InputError(
            f"{channel.source} is a {channel.kind}; this figure shows an encoder or a position."
        )
    rows = rows_within(channel.time, window, str(channel.source))
    from swashplate.campaign import speed_of

    chosen = usable_methods(channel) if methods is None else tuple(methods)
    speeds = {method: speed_of(channel, method) for method in chosen}
    shown = {method: cut(speed, channel.time[rows]) for method, speed in speeds.items()}
    low, high = reach_of(shown)
    unit = display_unit(f"{channel.unit}/s", max(abs(low), abs(high)))
    handles = speed_handles(shown, unit, (low, high))
    room = WIDTH - AROUND.left
    gap = GAP + ROW * legend_rows([str(each.get_label()) for each in handles], room)
    # the counts on the right take room
    around = AROUND if channel.encoder is not None else AROUND._replace(right=0.25)
    figure = new_figure(WIDTH, AROUND.bottom + AROUND.top + sum(HEIGHTS) + gap)
    upper, lower = figure.subplots(
        2,
        sharex=True,
        gridspec_kw={
            **margins(figure, around),
            "height_ratios": HEIGHTS,
            "hspace": 2.0 * gap / sum(HEIGHTS),
        },
    )
    time = channel.time[rows]
    lower.set_xlim(float(time[0]), float(time[-1]))
    _draw_position(upper, channel, rows)
    dress(lower, unit.label("speed"))
    zero_line(lower)
    margin = unit.factor * ROOM * (high - low) or 1.0
    lower.set_ylim(unit.factor * low - margin, unit.factor * high + margin)
    for method, speed in shown.items():
        draw_speed(lower, method, speed, unit)
    label_below(lower, "time (s)")
    line_up_labels(figure, (upper, lower), 0.62)
    write_title(figure, channel.name if title is None else title, AROUND.left)
    put_legend(figure, _position_handles(channel), AROUND.left, 0.42)
    put_legend(figure, handles, AROUND.left, AROUND.top + HEIGHTS[0] + 0.6 * GAP)
    return figure


def _draw_position(ax: Axes, channel: Channel, rows: slice) -> None:
    time, position = channel.time[rows], channel.values[rows]
    unit = display_unit(channel.unit, float(np.abs(position).max()))
    dress(ax, unit.label("angle" if channel.unit == "rad" else "position"))
    low, high = unit.factor * float(position.min()), unit.factor * float(position.max())
    margin = ROOM * (high - low) or 1.0
    ax.set_ylim(low - margin, high + margin)
    mark_gaps(ax, time)
    draw_broken(
        ax, time, unit.factor * position, INK, held=True, width=THIN, zorder=2.5, label="raw"
    )
    if channel.counts is None or channel.encoder is None:
        return
    from swashplate.campaign import interpolate_counts

    between = interpolate_counts(channel.time, channel.counts)[rows]
    angle = channel.encoder.angle_per_count * between
    draw_broken(ax, time, unit.factor * angle, BLUE, width=WIDE, label="interpolated")
    _count_axis(ax, channel.encoder, unit)


def _count_axis(ax: Axes, encoder: Encoder, unit: DisplayUnit) -> None:
    """The counts, on the right."""
    shown_per_count = unit.factor * encoder.angle_per_count
    counts = ax.secondary_yaxis(
        "right",
        functions=(
            lambda y: np.asarray(y) / shown_per_count,
            lambda c: np.asarray(c) * shown_per_count,
        ),
    )
    counts.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10], integer=True))
    counts.tick_params(length=3.0, width=0.6, color=FAINT, labelsize=SMALL, labelcolor=GREY)
    counts.spines["right"].set_color(FAINT)
    counts.set_ylabel("counts", fontsize=NORMAL, color=GREY)


def _position_handles(channel: Channel) -> list[Line2D | Patch]:
    raw = "counts" if channel.encoder is not None else "position"
    handles: list[Line2D | Patch] = [Line2D([], [], color=INK, linewidth=THIN, label=raw)]
    if channel.encoder is not None:
        words = "interpolated between changes of the count"
        handles.append(Line2D([], [], color=BLUE, linewidth=WIDE, label=words))
    return handles
