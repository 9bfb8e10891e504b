"""A reproduced figure on axes: curves over time, or a block diagram."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.patches import FancyBboxPatch

from reproduction.content import Diagram, Figure, Panel, Role
from swashplate.report.lines import draw, fit_time
from swashplate.report.style import (
    BLUE,
    CYCLE,
    GREY,
    INK,
    LINE,
    ORANGE,
    SMALL,
    THIN,
    VERMILION,
    MarginLabel,
    dress,
    label_below,
    label_margin,
    new_figure,
    zero_line,
)


class Margins(NamedTuple):
    """White space around the panels of a figure. [inch]"""

    left: float
    right: float
    bottom: float
    top: float


WIDTH, WIDE = 5.6, 8.6
SINGLE, STACKED = 1.85, 1.15
"""Widths of a figure of one panel and of several, heights of such panels. [inch]"""
AROUND = Margins(left=0.84, right=0.12, bottom=0.44, top=0.28)
BESIDE = 0.55
"""Room for words beside a panel that has levels. [inch]"""
ROW, BOX_HEIGHT, LETTER = 0.78, 0.42, 0.064
"""Distance of a diagram's rows, height of a box, width of a letter in it. [inch]"""

_COLORS: dict[Role, str] = {
    "command": GREY,
    "simulated": BLUE,
    "other": ORANGE,
    "virtual": VERMILION,
}
_WIDTHS: dict[Role, float] = {"command": THIN, "simulated": LINE, "other": LINE, "virtual": LINE}


def is_wide(figure: Figure) -> bool:
    """Whether it has several panels, for which a page gives its whole width."""
    return not isinstance(figure.content, Diagram) and len(figure.content) > 1


def height_of(figure: Figure) -> float:
    """Height that a figure needs, without its caption. [inch]"""
    if isinstance(figure.content, Diagram):
        rows = [node.row for node in figure.content.nodes]
        return ROW * (max(rows) - min(rows) + 1.0)
    count = len(figure.content)
    each = SINGLE if count == 1 else STACKED
    return AROUND.bottom + count * (each + AROUND.top)


def draw_figure(canvas: Canvas, figure: Figure, left: float, top: float, width: float) -> None:
    """Draw a figure of Kruse (2001) onto a page.

    Parameters
    ----------
    canvas : Figure of matplotlib
        The page.
    figure : Figure
        What to draw.
    left, top : float
        Distances of its upper left corner from the page's. [inch]
    width : float
        Of what is drawn, labels included. [inch]
    """
    if isinstance(figure.content, Diagram):
        ax = _axes(canvas, left, top, width, height_of(figure))
        draw_diagram(canvas, ax, figure.content)
        return
    panels = figure.content
    tall = SINGLE if len(panels) == 1 else STACKED
    beside = BESIDE if any(panel.levels for panel in panels) else 0.0
    axes = []
    for index, panel in enumerate(panels):
        ax = _axes(
            canvas,
            left + AROUND.left,
            top + AROUND.top + index * (tall + AROUND.top),
            width - AROUND.left - AROUND.right - beside,
            tall,
        )
        draw_panel(ax, panel, tall)
        ax.tick_params(labelbottom=index == len(panels) - 1)
        axes.append(ax)
    label_below(axes[-1], "time (s)")
    for ax in axes:
        inches = ax.get_position().width * canvas.get_size_inches()[0]
        ax.yaxis.set_label_coords(-0.44 / inches, 0.5)


def own_canvas(figure: Figure) -> Canvas:
    """A figure of Kruse (2001) by itself."""
    width = WIDE if is_wide(figure) else WIDTH
    canvas = new_figure(width, height_of(figure), layout="none")
    draw_figure(canvas, figure, 0.0, 0.0, width)
    return canvas


def draw_panel(ax: Axes, panel: Panel, tall: float) -> None:
    """Draw the curves of one pair of axes, their names above."""
    dress(ax, panel.ordinate)
    lows, highs = zip(
        *((each.values.min(), each.values.max()) for each in panel.curves), strict=True
    )
    if min(lows) <= 0.0 <= max(highs):
        zero_line(ax)
    colors = _colors(panel)
    for curve, color in zip(panel.curves, colors, strict=True):
        width = _WIDTHS[curve.role]
        if curve.held:
            draw(ax, curve.time, curve.values, color, zero_order=True, width=width)
        else:
            draw(ax, curve.time, curve.values, color, width=width)
    for level in panel.levels:
        ax.axhline(level.height, color=GREY, linewidth=THIN, dashes=(5.0, 3.0), zorder=1.5)
    fit_time(ax, *(curve.time for curve in panel.curves))
    labels = [MarginLabel(each.height, each.words, GREY) for each in panel.levels]
    label_margin(ax, labels, tall)
    handles = [
        Line2D([], [], color=color, linewidth=_WIDTHS[curve.role], label=curve.name)
        for curve, color in zip(panel.curves, colors, strict=True)
    ]
    ax.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        borderaxespad=0.0,
        borderpad=0.15,
        ncols=len(handles),
        frameon=False,
        fontsize=SMALL,
        labelcolor=INK,
        handlelength=1.6,
        handletextpad=0.5,
        columnspacing=1.3,
    )


def draw_diagram(canvas: Canvas, ax: Axes, diagram: Diagram) -> None:
    """Draw blocks and the arrows between them."""
    columns = [node.column for node in diagram.nodes]
    rows = [node.row for node in diagram.nodes]
    ax.set_xlim(min(columns) - 0.5, max(columns) + 0.5)
    ax.set_ylim(max(rows) + 0.5, min(rows) - 0.5)
    ax.axis("off")
    boxes = {}
    column = ax.get_position().width * canvas.get_size_inches()[0] / np.ptp(ax.get_xlim())
    height = BOX_HEIGHT / ROW
    for node in diagram.nodes:
        width = (LETTER * max(map(len, node.words.split("\n"))) + 0.14) / column
        box = FancyBboxPatch(
            (node.column - 0.5 * width, node.row - 0.5 * height),
            width,
            height,
            boxstyle="square,pad=0",
            facecolor="none" if node.plain else "white",
            edgecolor="none" if node.plain else INK,
            linewidth=THIN,
        )
        ax.add_patch(box)
        boxes[node.key] = box
        ax.text(
            node.column, node.row, node.words, ha="center", va="center", fontsize=SMALL, color=INK
        )
    places = {node.key: (node.column, node.row) for node in diagram.nodes}
    for arrow in diagram.arrows:
        start, end = places[arrow.start], places[arrow.end]
        ax.annotate(
            "",
            xy=end,
            xytext=start,
            arrowprops={
                "arrowstyle": "-|>",
                "color": INK,
                "linewidth": THIN,
                "patchA": boxes[arrow.start],
                "patchB": boxes[arrow.end],
                "shrinkA": 0.0,
                "shrinkB": 0.0,
            },
        )
        if arrow.words:
            middle = (0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]))
            above = start[1] == end[1] or start[1] < end[1]
            ax.annotate(
                arrow.words,
                middle,
                xytext=(0.0, 3.0 if above else -3.0),
                textcoords="offset points",
                ha="center",
                va="bottom" if above else "top",
                fontsize=SMALL,
                color=GREY,
            )


def _colors(panel: Panel) -> list[str]:
    """Of the curves by their roles; several simulated ones take the house's cycle."""
    if all(curve.role == "simulated" for curve in panel.curves):
        return [CYCLE[index % len(CYCLE)] for index in range(len(panel.curves))]
    return [_COLORS[curve.role] for curve in panel.curves]


def _axes(canvas: Canvas, left: float, top: float, width: float, height: float) -> Axes:
    """Axes at a place given in inches from the page's upper left corner."""
    wide, tall = canvas.get_size_inches()
    place = (left / wide, 1.0 - (top + height) / tall, width / wide, height / tall)
    return canvas.add_axes(place)
