"""Figures of what is decided on a crane: assessment of its control, operability over a year."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import isfinite
from typing import Any, overload

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon, Rectangle
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullLocator
from numpy.typing import NDArray

from swashplate.crane import LIMITED, AssessedQuantity, Assessment, Hull, Operability
from swashplate.crane.sea import rms_of
from swashplate.crane.studies import NO_CONTROL, UNDECIDED, WORKABLE, label_of
from swashplate.report import style
from swashplate.report.figures.crane import assumed, remark, remarks, seaway_label
from swashplate.results import GivenAxes
from swashplate.tables import count

Array = NDArray[np.float64]

# --- assessment -----------------------------------------------------------------------------------

SWING = "swing, RMS of a seaway (deg)"
NAME, ROOM = 30, style.WIDTH - 2.4
"""Letters of a line of a variant's name; room for a legend next to such names. [inch]"""
# positions on the axis, in parts of the largest swing
END = 1.03
"""End of the axis if no run left the model."""
BREAK = 1.06
"""Break of the axis if runs left the model."""
DEPARTURES = 1.11
"""Tick of the runs that left the model."""
END_WITH_DEPARTURES = 1.16
"""End of the axis if runs left the model."""
WIDEST = 2.0
"""Part of the largest swing up to which an interval is shown whole."""
LEAST_SHARE, MOST_SHARE = 0.1, 20.0
"""Shares of a limit at which an axis ends; a triangle stands for what lies beyond."""
WITHIN = {"yes": "within its limit", "no": "beyond its limit", "not decided": "not decided"}
FACES = {"yes": style.BLUE, "no": style.VERMILION, "not decided": "white"}
"""Colours of a quantity by whether it stays within its limit."""


@overload
def plot_assessment(result: Assessment, *, ax: None = None, title: str | None = None) -> Figure: ...


@overload
def plot_assessment(
    result: Assessment, *, ax: GivenAxes, title: str | None = None
) -> GivenAxes: ...


def plot_assessment(
    result: Assessment, *, ax: Axes | Sequence[Axes] | None = None, title: str | None = None
) -> Figure | Axes | Sequence[Axes]:
    """Figure of an assessment: swing of each variant in each seaway, and the limited quantities.

    The first panel has a point for each seaway and a diamond as wide as the 95 % interval of their
    root mean square; runs that left the model are counted beyond a break of the axis. The second
    one has the most probable largest values in three hours as shares of their limits.

    By default a new figure; with `ax`, of one panel, only the swing is drawn there, without the
    remark above, and `ax` returned.
    """
    if ax is not None:
        (panel,) = style.dress_given(ax, title, [""], SWING, what="panel")
        _draw_swings(panel, result)
        return ax
    study = result.study
    limited = result.limited(result.assessed_variant)
    legends = [_swing_legend(result)]
    heights = [0.46 * len(result.names) + 0.2]
    if limited:
        legends.append(_limit_legend(result, limited))
        heights.append(0.36 * len(limited) + 0.2)
    lines = sum(style.legend_rows(legend, ROOM) + 1 for legend in legends)
    height = style.HEAD + sum(heights) + style.ROW * lines + len(legends) * (style.FOOT + 0.1)
    figure = style.new_figure(style.WIDTH, height)
    grid = figure.subplots(len(heights), 1, squeeze=False, gridspec_kw={"height_ratios": heights})
    panels = list(grid[:, 0])
    seaways = f"{count(len(study.seeds), 'seaway')} of {study.length / 60.0:g} min"
    style.write_title(figure, title or f"{seaways}, {seaway_label(study.seaway)}")
    remarks_above = [
        assumed(study.crane),
        f"'{result.assessed_variant}' and its limits; bars: 95 % intervals",
    ]
    for panel, legend, remark_above in zip(panels, legends, remarks_above, strict=False):
        style.dress(panel)
        style.put_legend(panel, legend, room=ROOM)
        remark(panel, remark_above, style.legend_rows(legend, ROOM))
    style.label_below(panels[0], SWING)
    _draw_swings(panels[0], result)
    if limited:
        _draw_limits(panels[1], result, limited)
    return figure


def _mark(name: str, marker: str, color: str, *, face: str = "", size: float = 5.0) -> Line2D:
    """A marker's handle for a legend."""
    return Line2D(
        [],
        [],
        color=color,
        marker=marker,
        markersize=size,
        markerfacecolor=face or color,
        linestyle="none",
        label=name,
    )


def _swing_legend(result: Assessment) -> list[Line2D]:
    handles = [
        _mark("a seaway", "o", style.BLUE, size=4.0),
        _mark("more swing than without control", "o", style.VERMILION, size=4.0),
        _mark("RMS over seaways, as wide as its 95 % interval", "d", style.INK),
    ]
    if result.linear is not None:
        handles.append(style.handle("by its spectrum alone", style.INK, width=1.0))
    if any(result.departures(name) for name in result.names):
        handles.append(_mark("left the model, not in the RMS", "x", style.INK))
    return handles


def _draw_swings(ax: Axes, result: Assessment) -> None:
    """Draw a row for each variant: its seaways, their mean, how many left the model."""
    names = list(reversed(result.names))
    swings = {name: np.degrees(result.swing(name)) for name in names}
    edge = _largest_swing(result, list(swings.values()))
    random = np.random.default_rng(0)
    labels = []
    for row, (name, swing) in enumerate(swings.items()):
        rows = row + random.uniform(0.0, 0.34, swing.size)
        colors = np.where(swing > swings[NO_CONTROL], style.VERMILION, style.BLUE)
        ax.scatter(swing, rows, s=10.0, c=colors, alpha=0.55, linewidths=0.0, zorder=2.0)
        _diamond(ax, row - 0.16, swing)
        departures = sum(result.departures(name).values())
        if departures:
            point = (DEPARTURES * edge, row)
            ax.plot(*point, "x", color=style.INK, ms=6.0)
            style.put_text(ax, f"{departures}", point, (7.0, -3.0), coords="data")
        label = style.in_lines(name, NAME)
        if name != NO_CONTROL:
            worse = round(result.share_worse(name).value * swing.size)
            label += f"\nworse than none: {worse} of {swing.size}"
        labels.append(label)
    if result.linear is not None:
        by_spectrum = np.degrees(result.linear.values["swing"].rms)
        row = names.index(NO_CONTROL)
        ax.vlines(by_spectrum, row - 0.4, row + 0.4, color=style.INK, linewidth=1.0, zorder=4.0)
    with_departures = any(result.departures(name) for name in names)
    _swing_axis(ax, edge, with_departures=with_departures)
    ax.grid(False, axis="y")
    ax.set_yticks(range(len(names)), labels, fontsize=style.SMALL)
    ax.set_ylim(-0.5, len(names) - 0.5)


def _largest_swing(result: Assessment, swings: Sequence[Array]) -> float:
    """Largest number of a panel of swings [deg]; 1 if all runs left the model."""
    largest = max(float(np.nanmax(np.append(swing, 0.0))) for swing in swings)
    ends = [rms_of(swing).high for swing in swings]
    # of very few seaways the interval is wider than a panel can show
    edge = max([largest, *(min(end, WIDEST * largest) for end in ends if isfinite(end))])
    if result.linear is not None:
        edge = max(edge, float(np.degrees(result.linear.values["swing"].rms)))
    return edge or 1.0


def _swing_axis(ax: Axes, largest_swing: float, *, with_departures: bool) -> None:
    """Set an abscissa up to a swing [deg]; after a break the tick of runs that left the model."""
    locator = MaxNLocator(8, steps=[1, 2, 5, 10])
    ticks = [
        tick for tick in locator.tick_values(0.0, largest_swing) if 0.0 <= tick <= largest_swing
    ]
    labels = [f"{tick:g}" for tick in ticks]
    end = END * largest_swing
    if with_departures:
        break_at = BREAK * largest_swing
        ax.axvline(break_at, color=style.FAINT, linewidth=1.0, linestyle=(0, (2, 2)))
        ticks.append(DEPARTURES * largest_swing)
        labels.append("left the\nmodel")
        end = END_WITH_DEPARTURES * largest_swing
    ax.set_xticks(ticks, labels)
    ax.set_xlim(0.0, end)


def _diamond(ax: Axes, row: float, swing: Array) -> None:
    """The mean of a row as a diamond as wide as its interval; nothing if all left the model."""
    mean = rms_of(swing)
    if not isfinite(mean.value):
        return
    low, high = mean.low, mean.high
    if not isfinite(low):  # of one seaway there is no interval
        low = high = mean.value
    corners = [(low, row), (mean.value, row + 0.12), (high, row), (mean.value, row - 0.12)]
    ax.add_patch(Polygon(corners, facecolor=style.INK, edgecolor=style.INK, lw=0.8, zorder=3.0))


def _limit_legend(result: Assessment, limited: Sequence[AssessedQuantity]) -> list[Line2D]:
    occurring = {quantity.within for quantity in limited}
    decisions = [decision for decision in WITHIN if decision in occurring]
    handles = []
    for decision in decisions:
        color = FACES[decision] if decision != "not decided" else style.INK
        handles.append(_mark(WITHIN[decision], "o", color, face=FACES[decision], size=6.0))
    handles.append(_mark("no control", "s", style.FAINT, face="white", size=4.5))
    others = result.names[1:-1]
    if others:
        label = f"'{others[0]}'" if len(others) == 1 else "other variants"
        handles.append(_mark(label, "o", style.FAINT, face="white", size=4.5))
    return handles


def _draw_limits(ax: Axes, result: Assessment, limited: Sequence[AssessedQuantity]) -> None:
    """Draw a row for each quantity with a limit: its largest value as a share of the limit.

    In colour the assessed variant, with the interval of its value; in grey the others.
    """
    others = {name: result.limited(name) for name in result.names[:-1]}
    shares = [_share(quantity.largest.high, quantity.limit) for quantity in limited]
    for quantities in others.values():
        shares += [_share(quantity.largest.value, quantity.limit) for quantity in quantities]
    finite_shares = [share for share in shares if isfinite(share)]
    axis_end = min(max(2.0, 1.25 * max(finite_shares, default=0.0)), MOST_SHARE)
    names = [quantity.name for quantity in reversed(limited)]
    ax.axvspan(1.0, axis_end, color=style.VERMILION, alpha=0.07, linewidth=0.0, zorder=0.5)
    ax.axvline(1.0, color=style.VERMILION, linewidth=1.0, zorder=1.5)
    for variant, quantities in others.items():
        marker = "s" if variant == NO_CONTROL else "o"
        for quantity in quantities:
            if quantity.name in names:
                row = names.index(quantity.name) + 0.18
                share = _share(quantity.largest.value, quantity.limit)
                _draw_share(ax, share, row, axis_end, marker, style.FAINT, face="white", ms=4.5)
    labels = []
    for row, quantity in enumerate(reversed(limited)):
        color = FACES[quantity.within] if quantity.within != "not decided" else style.INK
        low = _share(quantity.largest.low, quantity.limit)
        high = _share(quantity.largest.high, quantity.limit)
        if isfinite(low) and isfinite(high):
            low = min(max(low, LEAST_SHARE), axis_end)
            high = min(max(high, LEAST_SHARE), axis_end)
            ax.hlines(row, low, high, color=color, linewidth=2.0, zorder=2.5)
        share = _share(quantity.largest.value, quantity.limit)
        _draw_share(ax, share, row, axis_end, "o", color, face=FACES[quantity.within], ms=6.5)
        unit, factor = quantity.shown_unit
        number = "–"
        if isfinite(share):
            # a side-lead without waves across the boom is 0, not a millionth of a degree
            number = f"{round(factor * quantity.largest.value, 3):.3g}"
        value_and_limit = f"{number} of {factor * quantity.limit:.3g} {unit}".rstrip()
        labels.append(f"{LIMITED[quantity.name].label}\n{value_and_limit}")
    ax.set_xscale("log")
    ax.set_xlim(LEAST_SHARE, axis_end)
    ax.xaxis.set_major_locator(FixedLocator([0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0]))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda share, _: f"{share:g}"))
    style.label_below(ax, "most probable largest value in 3 h (saturation: mean), over its limit")
    ax.grid(False, axis="y")
    ax.set_yticks(range(len(labels)), labels, fontsize=style.SMALL)
    ax.set_ylim(-0.5, len(labels) - 0.5)


def _share(largest: float, limit: float) -> float:
    """A largest value over its limit, which may be 0 for the saturation of drives."""
    if limit > 0.0:
        return largest / limit
    return MOST_SHARE if largest > 0.0 else 0.0


def _draw_share(
    ax: Axes, share: float, row: float, axis_end: float, marker: str, color: str, **style: Any
) -> None:
    """Draw a share of a limit: a triangle at the axis's end if it is beyond, nothing for NaN."""
    if not isfinite(share):
        return
    if share < LEAST_SHARE:
        marker = "<"
    elif share > axis_end:
        marker = ">"
    face = style.pop("face")
    within_axis = min(max(share, LEAST_SHARE), axis_end)
    ax.plot(within_axis, row, marker, color=color, mfc=face, zorder=3.0, clip_on=False, **style)


# --- operability ----------------------------------------------------------------------------------

LIMIT_COLORS = (
    style.BLUE,
    style.VERMILION,
    style.GREEN,
    style.PURPLE,
    style.ORANGE,
    style.INK,
    style.SKY,
)
"""Colours of limits, the most frequent first; the first five can be distinguished if pale."""
PALEST = 0.3
"""Strength of the colour of a cell that only one heading spoils."""
ABREAST = 3
"""Panels side by side."""


def plot_operability(result: Operability, *, title: str | None = None) -> Figure:
    """Figure of operability: what limits each sea of the scatter diagram, a panel for each variant.

    A cell has the colour of what limits it first at most of the headings, the stronger the more
    headings cannot be worked; it is white if all can.
    """
    weights = _weights(result)
    limits = [limit for limit in weights if limit not in (WORKABLE, UNDECIDED)]
    colors = dict(zip(limits, LIMIT_COLORS, strict=False))
    legend: list[Any] = [
        Patch(facecolor=color, label=label_of(limit)) for limit, color in colors.items()
    ]
    if len(limits) > len(LIMIT_COLORS):
        legend.append(Patch(facecolor=style.FAINT, label="others"))
    if UNDECIDED in weights:
        colors[UNDECIDED] = style.GREY
        legend.append(Patch(facecolor=style.GREY, label="undecided"))
    legend.append(Patch(facecolor="white", edgecolor=style.FAINT, label="can be worked"))
    names = result.names
    columns = min(len(names), ABREAST)
    rows = -(-len(names) // columns)
    lines = style.legend_rows(legend) + 3
    height = style.HEAD + style.ROW * lines + rows * 2.7 + style.FOOT
    figure = style.new_figure(style.WIDTH, height)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    panels = list(grid.ravel())
    style.write_title(figure, title or "Share of the year that can be worked, and what limits it")
    for panel, name in zip(panels, names, strict=False):
        style.dress(panel)
        _draw_cells(panel, result, name, colors)
        worked = f"{100.0 * result.workable(name):.0f} % of the year"
        panel_title = f"{style.in_lines(name, NAME)}: {worked}"
        panel.set_title(panel_title, loc="left", fontsize=style.NORMAL, color=style.INK)
    for panel in panels[len(names) :]:
        panel.set_axis_off()
    for panel in panels[max(len(names) - columns, 0) : len(names)]:  # the lowest of each column
        style.label_below(panel, "peak period (s)")
        panel.tick_params(labelbottom=True)
    for panel in grid[:, 0]:
        panel.set_ylabel("significant height (m)", fontsize=style.NORMAL, color=style.INK)
    seaway = result.seaway
    ship = f"roll {seaway.ship.roll_period:g} s" if isinstance(seaway.ship, Hull) else ""
    of_headings = f"the more of {count(len(result.headings), 'heading')} cannot be worked"
    shades = f"the stronger a colour, {of_headings}"
    if len(result.headings) == 1:
        shades = f"waves from {result.headings[0]:g} deg"
    note = result.scatter.note.removesuffix(".")
    texts = [
        shades,
        ship,
        note[:1].lower() + note[1:],
        assumed(result.crane),
    ]
    drawn_legend = figure.legend(
        title=remarks(texts),
        title_fontproperties={"size": style.SMALL},
        alignment="left",
        handles=legend,
        loc="outside lower left",
        ncols=style.legend_columns([str(handle.get_label()) for handle in legend]),
        frameon=False,
        fontsize=style.SMALL,
        labelcolor=style.INK,
    )
    drawn_legend.get_title().set_color(style.GREY)
    return figure


def _weights(result: Operability) -> dict[str, float]:
    """Share of the year by what limits it, over all variants, the largest first."""
    weights: dict[str, float] = {}
    for name in result.names:
        for limit, share in result.shares(name).items():
            weights[limit] = weights.get(limit, 0.0) + share
    return dict(sorted(weights.items(), key=lambda entry: -entry[1]))


def _draw_cells(ax: Axes, result: Operability, name: str, colors: Mapping[str, str]) -> None:
    """Draw the cells of the scatter diagram, each in its colour."""
    scatter = result.scatter
    cells = result.cells[name]
    periods = _edges(scatter.period)
    heights = _edges(scatter.height)
    for row, (period, height) in enumerate(
        zip(scatter.period.tolist(), scatter.height.tolist(), strict=True)
    ):
        limits = [cells[row, heading].limited_by for heading in result.headings]
        spoiled = [limit for limit in limits if limit != WORKABLE]
        color: Any = "white"
        if spoiled:
            most = max(dict.fromkeys(spoiled), key=spoiled.count)
            strength = PALEST + (1.0 - PALEST) * len(spoiled) / len(limits)
            full = np.array(to_rgb(colors.get(most, style.FAINT)))
            color = tuple(1.0 - strength * (1.0 - full))
        left, right = periods[period]
        low, high = heights[height]
        cell = Rectangle(
            (left, low),
            right - left,
            high - low,
            facecolor=color,
            edgecolor=style.FAINT,
            linewidth=0.6,
        )
        ax.add_patch(cell)
    ax.set_xlim(min(low for low, _ in periods.values()), max(high for _, high in periods.values()))
    ax.set_ylim(0.0, max(high for _, high in heights.values()))
    ax.grid(False)


def _edges(coordinates: Array) -> dict[float, tuple[float, float]]:
    """Ends of the cells of a scatter diagram by their middles, half way to the neighbours."""
    middles = np.unique(coordinates)
    if middles.size == 1:
        half = 0.25 * middles
        return {float(middles[0]): (float(middles[0] - half[0]), float(middles[0] + half[0]))}
    between = 0.5 * (middles[1:] + middles[:-1])
    first, last = 2.0 * middles[0] - between[0], 2.0 * middles[-1] - between[-1]
    ends = np.concatenate([[max(first, 0.0)], between, [last]]).tolist()
    return dict(zip(middles.tolist(), pairwise(ends), strict=True))
