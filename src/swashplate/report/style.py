"""How figures look: colours, sizes, axes. Nothing here reads or sets matplotlib's global state."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK = "#222222"
GREY = "#767676"
FAINT = "#b5b5b5"
GRID = "#e4e4e4"

# Okabe and Ito's colours, which people with any kind of colour vision can tell apart.
BLUE = "#0072B2"
VERMILION = "#D55E00"
GREEN = "#009E73"
PURPLE = "#CC79A7"
ORANGE = "#E69F00"
SKY = "#56B4E9"
CYCLE = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, INK)


Dashes = Literal["solid", "dashed", "dotted"]


class Stroke(NamedTuple):
    """How the lines of one drive look."""

    color: str
    dashes: Dashes


def strokes(names: Iterable[str]) -> dict[str, Stroke]:
    """Colours for names; once they are used up they come again, dashed and then dotted."""
    dashes: tuple[Dashes, ...] = ("solid", "dashed", "dotted")
    return {
        name: Stroke(CYCLE[index % len(CYCLE)], dashes[index // len(CYCLE) % len(dashes)])
        for index, name in enumerate(names)
    }


SMALL, NORMAL, LARGE = 8.0, 9.0, 11.5
"""Sizes of letters. [pt]"""
THIN, LINE = 0.8, 1.3
"""Widths of lines. [pt]"""
DPI = 150
"""A picture's dots an inch: 8 pt letters stay readable where a page shows it at half its size."""

POINTS_PER_INCH = 72.0


class Margins(NamedTuple):
    """White space around the panels of a figure. [inch]"""

    left: float
    right: float
    bottom: float
    top: float


def new_figure(width: float, height: float) -> Figure:
    """An empty white figure of a size. [inch]"""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=DPI, facecolor="white")


def margins(figure: Figure, around: Margins) -> dict[str, float]:
    """Margins as the fractions of the figure that a grid of panels takes."""
    width, height = figure.get_size_inches()
    return {
        "left": around.left / width,
        "right": 1.0 - around.right / width,
        "bottom": around.bottom / height,
        "top": 1.0 - around.top / height,
    }


def write_title(figure: Figure, title: str, left: float) -> None:
    """Write a title at the top, starting `left` of the edge. [inch]"""
    width, height = figure.get_size_inches()
    figure.text(
        left / width,
        1.0 - 0.14 / height,
        title,
        fontsize=LARGE,
        fontweight="bold",
        color=INK,
        va="top",
    )


def dress(ax: Axes, label: str = "") -> None:
    """Give a panel its light grid, quiet axes and the label of its ordinate."""
    from matplotlib.ticker import MaxNLocator

    ax.set_axisbelow(True)
    ax.grid(True, color=GRID, linewidth=0.6)
    ax.xaxis.set_major_locator(MaxNLocator(8, steps=[1, 2, 5, 10]))
    ax.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    ax.tick_params(length=3.0, width=0.6, color=FAINT, labelsize=SMALL, labelcolor=INK)
    for side, spine in ax.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(FAINT)
        spine.set_linewidth(0.8)
    ax.ticklabel_format(axis="y", scilimits=(-3, 5))
    ax.yaxis.get_offset_text().set_fontsize(SMALL)
    if label:
        ax.set_ylabel(label, fontsize=NORMAL, color=INK)


def line_up_labels(figure: Figure, axes: Iterable[Axes], away: float) -> None:
    """Put the labels of ordinates at one distance from their panels, whatever the ticks. [inch]"""
    for ax in axes:
        inches = ax.get_position().width * figure.get_size_inches()[0]
        ax.yaxis.set_label_coords(-away / inches, 0.5)


def label_below(ax: Axes, label: str) -> None:
    """Label a panel's abscissa."""
    ax.set_xlabel(label, fontsize=NORMAL, color=INK)


def put_legend(figure: Figure, handles: Sequence[Artist], left: float, top: float) -> None:
    """Write a legend on one line or more, its corner at a distance from the figure's. [inch]"""
    width, height = figure.get_size_inches()
    figure.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(left / width, 1.0 - top / height),
        borderaxespad=0.0,
        borderpad=0.0,
        ncols=legend_columns([str(handle.get_label()) for handle in handles], width - left),
        frameon=False,
        fontsize=SMALL,
        labelcolor=INK,
        handlelength=1.6,
        handletextpad=0.5,
        columnspacing=1.4,
        labelspacing=0.35,
    )


def legend_columns(names: Sequence[str], room: float) -> int:
    """Columns of a legend that surely fit into some room, all names on one line if they do."""
    widths = [0.39 + 0.056 * len(name) for name in names]
    return len(names) if sum(widths) <= room else max(1, int(room / max(widths)))


def legend_rows(names: Sequence[str], room: float) -> int:
    """Lines of the legend of these names."""
    return -(-len(names) // legend_columns(names, room)) if names else 0


def zero_line(ax: Axes) -> None:
    """Mark zero a little stronger than the grid."""
    ax.axhline(0.0, color=FAINT, linewidth=0.8, zorder=1.2)


def signed(value: float, decimals: int) -> str:
    """A number with its sign, a true minus, and no sign at zero."""
    text = f"{value:+.{decimals}f}"
    return text[1:] if float(text) == 0.0 else text.replace("-", "−")


class MarginLabel(NamedTuple):
    """Words to the right of a panel, at a height that belongs to its ordinate."""

    height: float
    words: str
    color: str


def label_margin(figure: Figure, ax: Axes, labels: Sequence[MarginLabel]) -> None:
    """Write labels beside a panel, each near its height but never over one another.

    The panel's limits must be final.
    """
    low, high = ax.get_ylim()
    inches = ax.get_position().height * figure.get_size_inches()[1]
    gap = 1.25 * SMALL / POINTS_PER_INCH / inches
    # of two at the same height, hair's breadths apart, the first is above
    heights = [round((label.height - low) / (high - low), 2) for label in labels]
    order = sorted(range(len(labels)), key=lambda index: (heights[index], -index))
    for place, index in zip(spread([heights[i] for i in order], gap), order, strict=True):
        label = labels[index]
        ax.annotate(
            label.words,
            (1.0, place),
            xycoords="axes fraction",
            xytext=(5.0, 0.0),
            textcoords="offset points",
            fontsize=SMALL,
            color=label.color,
            va="center",
            annotation_clip=False,
        )


def spread(wanted: Sequence[float], gap: float) -> list[float]:
    """Places as near to the wanted ones, in rising order, as a gap between neighbours allows.

    Neighbours that come too near form a group, which is centred on what its members want.
    """
    groups: list[list[float]] = []
    for place in wanted:
        groups.append([place])
        while len(groups) > 1 and _bottom(groups[-1], gap) < _top(groups[-2], gap) + gap:
            last = groups.pop()
            groups[-1].extend(last)
    return [_bottom(group, gap) + gap * index for group in groups for index in range(len(group))]


def _bottom(group: Sequence[float], gap: float) -> float:
    return sum(group) / len(group) - 0.5 * gap * (len(group) - 1)


def _top(group: Sequence[float], gap: float) -> float:
    return _bottom(group, gap) + gap * (len(group) - 1)
