"""Style of figures: colours, sheets of panels, axes, legends. Matplotlib's global state is left."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from swashplate.errors import InputError
from swashplate.tables import FIGURE, ending, write_whole

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

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

SMALL, NORMAL, LARGE = 8.0, 9.0, 11.5
"""Sizes of letters. [pt]"""
THIN, LINE = 0.8, 1.3
"""Widths of lines. [pt]"""
DPI = 150
"""A picture's dots an inch: 8 pt letters stay readable if a page shows it at half its size."""
POINTS_PER_INCH = 72.0
WIDTH = 8.6
"""Of a sheet. [inch]"""
ROOM = WIDTH - 1.2
"""Space for a legend next to a panel's ordinate. [inch]"""
GAP, HEAD, FOOT, ROW = 0.24, 0.38, 0.42, 0.18
"""Between panels, for the title, for the abscissa, for a row of a legend. [inch]"""

Dashes = Literal["solid", "dashed", "dotted"]


class Stroke(NamedTuple):
    """Look of the lines of one drive."""

    color: str
    dashes: Dashes


def strokes(names: Iterable[str]) -> dict[str, Stroke]:
    """Colours for names; once they are used up they come again, dashed and then dotted."""
    dashes: tuple[Dashes, ...] = ("solid", "dashed", "dotted")
    return {
        name: Stroke(CYCLE[index % len(CYCLE)], dashes[index // len(CYCLE) % len(dashes)])
        for index, name in enumerate(names)
    }


def new_figure(
    width: float, height: float, *, layout: Literal["constrained", "none"] = "constrained"
) -> Figure:
    """An empty white figure of a size [inch], whose panels find their places by themselves."""
    from swashplate.report.figure import PlainFigure

    figure = PlainFigure(figsize=(width, height), dpi=DPI, facecolor="white")
    if layout == "constrained":
        figure.set_layout_engine("constrained", w_pad=0.06, h_pad=0.04, hspace=0.02, wspace=0.02)
    return figure


def sheet(
    heights: Sequence[float],
    title: str,
    labels: Sequence[str] = (),
    below: str = "",
    *,
    legend: Sequence[Artist] = (),
    lines: int = 0,
    columns: int = 1,
) -> tuple[Figure, list[Axes]]:
    """A figure of panels over one abscissa, dressed: labels of ordinates and of what is below.

    Heights [inch] are from the top. Above the first panel stand the handles of a legend, and so
    many lines of words besides. Several columns come one after another, each from the top.
    """
    rows = lines + (legend_rows(legend) if legend else 0)
    inside = sum(heights) + GAP * (len(heights) - 1)
    figure = new_figure(WIDTH, HEAD + ROW * rows + inside + FOOT)
    ratios = {"height_ratios": heights}
    grid = figure.subplots(len(heights), columns, sharex=True, squeeze=False, gridspec_kw=ratios)
    axes = list(grid.T.ravel())
    for index, ax in enumerate(axes):
        dress(ax, labels[index] if index < len(labels) else "")
    if below:
        label_below(axes[-1], below)
    write_title(figure, title)
    if legend:
        put_legend(axes[0], legend)
    figure.align_ylabels(axes)
    return figure, axes


def given_axes(ax: Axes | Sequence[Axes], count: int, what: str) -> list[Axes]:
    """The axes of a caller, one for each of so many things, also of ``pyplot.subplots``.

    Raises
    ------
    InputError
        If there are more or fewer.
    """
    import numpy as np

    axes = list(np.ravel(np.asarray(ax, dtype=object)))
    if len(axes) != count:
        raise InputError(f"There are {len(axes)} axes for {count} {what}: give one for each.")
    return axes


def dress_given(
    ax: Axes | Sequence[Axes],
    title: str | None,
    labels: Sequence[str],
    below: str,
    *,
    what: str = "panels",
    legend: Sequence[Artist] = (),
    legend_at: str = "best",
) -> list[Axes]:
    """Dress a caller's axes as `sheet` does its panels; the title and legend are within the first.

    Without a title they get none: the caller's figure may have one. `legend_at` is a location as
    of `matplotlib.axes.Axes.legend`.
    """
    axes = given_axes(ax, len(labels), what)
    for panel, label in zip(axes, labels, strict=True):
        dress(panel, label)
    label_below(axes[-1], below)
    if title:
        axes[0].set_title(title, loc="left", fontsize=NORMAL, color=INK)
    if legend:
        legend_within(axes[0], legend, legend_at)
    return axes


def legend_within(ax: Axes, handles: Sequence[Artist], location: Any = "best") -> None:
    """Write a legend into a caller's panel, on white: lines may pass under it."""
    ax.legend(
        handles=handles,
        loc=location,
        fontsize=SMALL,
        labelcolor=INK,
        facecolor="white",
        edgecolor="none",
        framealpha=0.85,
    )


def write_title(figure: Figure, title: str) -> None:
    """Write a title at the top left."""
    style = {"fontsize": LARGE, "fontweight": "bold", "color": INK}
    figure.suptitle(title, x=0.012, ha="left", **style)


def dress(ax: Axes, label: str = "", below: str = "") -> None:
    """Give a panel its light grid, quiet axes and the labels of ordinate and abscissa."""
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
    ax.ticklabel_format(axis="y", scilimits=(-3, 5), useOffset=False)
    ax.yaxis.get_offset_text().set_fontsize(SMALL)
    if label:
        ax.set_ylabel(label, fontsize=NORMAL, color=INK)
    if below:
        label_below(ax, below)


def label_below(ax: Axes, label: str) -> None:
    """Label a panel's abscissa."""
    ax.set_xlabel(label, fontsize=NORMAL, color=INK)


def right_axis(ax: Axes, factor: float, label: str) -> Any:
    """A second ordinate on the right, on which values are a factor of those on the left."""
    import numpy as np

    functions = (lambda y: factor * np.asarray(y), lambda v: np.asarray(v) / factor)
    axis = ax.secondary_yaxis("right", functions=functions)
    axis.tick_params(length=3.0, width=0.6, color=FAINT, labelsize=SMALL, labelcolor=GREY)
    axis.spines["right"].set_color(FAINT)
    axis.set_ylabel(label, fontsize=NORMAL, color=GREY)
    return axis


def in_lines(label: str, letters: int) -> str:
    """A label in up to three lines of so many letters: broken after words and underscores.

    The last word, which is the unit, is never left out.
    """
    lines = wrap(label.replace("_", "_ "), max(letters, 8), break_on_hyphens=False)
    if len(lines) > 3:
        lines = [lines[0], f"{lines[1].rstrip('_')}…", lines[-1]]
    return "\n".join(line.replace("_ ", "_") for line in lines)


def handle(name: str, color: str, dashes: Dashes = "solid", width: float = 2.0) -> Line2D:
    """A line's handle for a legend."""
    from matplotlib.lines import Line2D

    return Line2D([], [], color=color, linestyle=dashes, linewidth=width, label=name)


def stroke_handles(strokes: Mapping[str, Stroke]) -> list[Line2D]:
    """Handles for a legend of lines by their names."""
    return [handle(name, stroke.color, stroke.dashes) for name, stroke in strokes.items()]


def put_legend(
    ax: Axes, handles: Sequence[Artist], *, beyond: bool = False, room: float = ROOM
) -> None:
    """Write a legend above a panel, on one line or more, `beyond` its right end if need be."""
    legend = ax.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(0.0, 1.01),
        borderaxespad=0.0,
        borderpad=0.2,
        ncols=legend_columns([str(handle.get_label()) for handle in handles], room),
        frameon=False,
        fontsize=SMALL,
        labelcolor=INK,
        handlelength=1.6,
        handletextpad=0.5,
        columnspacing=1.4,
        labelspacing=0.35,
    )
    legend.set_in_layout(not beyond)


def legend_columns(names: Sequence[str], room: float = ROOM) -> int:
    """Columns of a legend that surely fit into some room [inch], all on one line if they do."""
    widths = [0.39 + 0.056 * len(name) for name in names]
    return len(names) if sum(widths) <= room else max(1, int(room / max(widths)))


def legend_rows(handles: Sequence[Artist], room: float = ROOM) -> int:
    """Lines of the legend of these handles in some room [inch]."""
    names = [str(handle.get_label()) for handle in handles]
    return -(-len(names) // legend_columns(names, room))


def zero_line(ax: Axes, *, upright: bool = False) -> None:
    """Mark zero a little stronger than the grid."""
    ax.axhline(0.0, color=FAINT, linewidth=0.8, zorder=1.2)
    if upright:
        ax.axvline(0.0, color=FAINT, linewidth=0.8, zorder=1.2)


def put_text(
    ax: Axes,
    text: str,
    position: tuple[float, float],
    shift: tuple[float, float] = (4.0, 3.0),
    *,
    coords: Any = "axes fraction",
    color: str = INK,
    ha: str = "left",
    va: str = "baseline",
    **how: Any,
) -> None:
    """Write small words at a position, shifted by some points."""
    ax.annotate(
        text,
        position,
        xycoords=coords,
        xytext=shift,
        textcoords="offset points",
        fontsize=SMALL,
        color=color,
        ha=ha,
        va=va,
        **how,
    )


def signed(number: float, decimals: int) -> str:
    """A number with its sign, a true minus, and no sign at zero."""
    text = f"{number:+.{decimals}f}"
    return text[1:] if float(text) == 0.0 else text.replace("-", "−")


class MarginLabel(NamedTuple):
    """Words to the right of a panel, at a height that belongs to its ordinate."""

    height: float
    words: str
    color: str


def label_margin(ax: Axes, labels: Sequence[MarginLabel], inches: float) -> None:
    """Write labels next to a panel of a height, each near its place but never over one another.

    The panel's limits must be final.
    """
    low, high = ax.get_ylim()
    gap = 1.25 * SMALL / POINTS_PER_INCH / inches
    # of two at the same height, hair's breadths apart, the first is above
    heights = [round((label.height - low) / (high - low), 2) for label in labels]
    order = sorted(range(len(labels)), key=lambda index: (heights[index], -index))
    for position, index in zip(spread_out([heights[i] for i in order], gap), order, strict=True):
        label = labels[index]
        style: dict[str, Any] = {"va": "center", "annotation_clip": False}
        put_text(ax, label.words, (1.0, position), (5.0, 0.0), color=label.color, **style)


def spread_out(positions: Sequence[float], gap: float) -> list[float]:
    """Places as near to the wanted ones, in rising order, as a gap between neighbours allows.

    Neighbours that come too near form a group, which is centred on what its members want.
    """
    groups: list[list[float]] = []

    def bottom(group: Sequence[float]) -> float:
        return sum(group) / len(group) - 0.5 * gap * (len(group) - 1)

    for position in positions:
        groups.append([position])
        while len(groups) > 1 and bottom(groups[-1]) < bottom(groups[-2]) + gap * len(groups[-2]):
            last = groups.pop()
            groups[-1].extend(last)
    return [bottom(group) + gap * index for group in groups for index in range(len(group))]


_METADATA: dict[str, dict[str, None]] = {
    "png": {},
    "svg": {"Date": None},
    "pdf": {"CreationDate": None},
}
"""Metadata to leave out, because they would differ between two runs on the same figure."""


def save_figure(figure: Figure, path: str | Path) -> None:
    """Write a figure as PNG, SVG or PDF, by the path's ending: whole or not at all.

    The same figure gives the same bytes.

    Parameters
    ----------
    figure : Figure
        The figure.
    path : path
        File that ends in ``.png``, ``.svg`` or ``.pdf``.

    Raises
    ------
    FileError
        For another ending, or a folder that cannot be written.

    Examples
    --------
    >>> from swashplate import maneuvers
    >>> from swashplate.report.figures import save_figure
    >>> save_figure(maneuvers.step(9.0).plot(), "step.png")
    """
    import matplotlib

    kind = ending(path, FIGURE).removeprefix(".")

    def write_file(temporary: Path) -> None:
        # without a salt of its own, an SVG's clip paths get random names
        with matplotlib.rc_context({"svg.hashsalt": "swashplate"}):
            figure.savefig(temporary, format=kind, metadata=_METADATA[kind])

    write_whole(path, write_file)
