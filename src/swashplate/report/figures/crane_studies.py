"""Figures of a crane's studies: over stick, period, bearing, wave height, orifice; its judgment."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from swashplate.crane import Crane, Followable, Judgment, Residuals, Seaway, Sweep
from swashplate.crane.judgment import mean_of
from swashplate.report.style import (
    BLUE,
    FAINT,
    FOOT,
    GREY,
    GRID,
    HEAD,
    INK,
    NORMAL,
    ROW,
    SMALL,
    VERMILION,
    WIDTH,
    Stroke,
    dress,
    handle,
    label_below,
    legend_rows,
    new_figure,
    put_legend,
    sheet,
    strokes,
    write,
    write_title,
)

Array = NDArray[np.float64]
LEAST = 0.01
"""Least swing on a logarithmic scale. [deg]"""
HEIGHT = 3.3
"""Of a single panel. [inch]"""


def assumed(crane: Crane) -> str:
    """A crane's name, and how much of its geometry is assumed."""
    return f"{crane.name}, {crane.assumed} assumed" if crane.assumed else crane.name


def seaway_words(sea: Seaway) -> str:
    """A seaway in a few words."""
    what = sea.sea if isinstance(sea.sea, str) else f"{sea.sea.height:g} m, {sea.sea.period:g} s"
    return f"{what}, waves at {sea.heading_deg:g}°"


def remark(ax: Axes, *said: str, rows: int = 0, right: bool = False) -> None:
    """Write grey words above a panel, over so many rows of a legend."""
    words, side = "; ".join(said), 1.0 if right else 0.0
    how = {"fontsize": SMALL, "color": GREY, "ha": "right" if right else "left"}
    place = {"xycoords": "axes fraction", "textcoords": "offset points"}
    ax.annotate(words, (side, 1.0), xytext=(0.0, 5.0 + 13.0 * rows), **place, **how)  # type: ignore[arg-type]


def _panel(
    crane: Crane, title: str, looks: dict[str, Stroke], *said: str, height: float = HEIGHT
) -> tuple[Figure, Axes]:
    """One panel with a legend of lines, and what is assumed."""
    legend = [handle(name, *look) for name, look in looks.items()]
    figure, (ax,) = sheet([height], title, legend=legend, lines=1)
    remark(ax, *said, assumed(crane), rows=legend_rows(legend))
    return figure, ax


def _logarithmic(ax: Axes, low: float, high: float) -> None:
    """A logarithmic ordinate with plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    ax.set_yscale("log")
    ax.set_ylim(low, high)
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.yaxis.set_minor_locator(NullLocator())


def plot_residuals(result: Residuals, *, title: str = "") -> Figure:
    """Figure of the residual swing over the stick, and of where the slew ends."""
    looks = strokes(result.names)
    legend = [handle(name, *look) for name, look in looks.items()]
    words = title or f"Residual swing after a slew of {np.degrees(result.target):g}°"
    figure, (swing, ends) = sheet([2.7, 1.4], words, legend=legend, lines=1)
    remark(swing, assumed(result.crane), rows=legend_rows(legend))
    for k, (color, dashes) in enumerate(looks.values()):
        how: dict[str, Any] = {"color": color, "linestyle": dashes, "marker": "o", "ms": 3.0}
        values = np.maximum(np.degrees(result.values[:, k]), LEAST)
        swing.plot(result.sticks, values, **how)
        ends.plot(result.sticks, np.degrees(result.reached[:, k]), **how)
    dress(swing, "residual swing (deg)")
    _logarithmic(swing, LEAST, 1.3 * float(np.degrees(result.values.max())))
    dress(ends, "slew reached (deg)")
    ends.axhline(np.degrees(result.target), color=FAINT, linewidth=0.8, zorder=1.0)
    label_below(ends, "stick, part of the full speed")
    return figure


def _mean_lines(ax: Axes, result: Sweep, looks: dict[str, Stroke]) -> None:
    """Means of the swing with their intervals."""
    for k, (color, dashes) in enumerate(looks.values()):
        values = np.degrees(result.values[:, :, k, 0])
        found = np.array([mean_of(values[:, n]) for n in range(result.grid.size)])
        middle, low, high = np.maximum(found, LEAST).T
        if len(values) > 1:
            ax.fill_between(result.grid, low, high, color=color, alpha=0.15, linewidth=0.0)
        ax.plot(result.grid, middle, color=color, linestyle=dashes, linewidth=1.4)


def plot_orifice(result: Sweep, *, title: str = "") -> Figure:
    """Figure of the swing over the size of the luff drive's orifice."""
    looks = strokes(result.names)
    said = f"mean of {len(result.values)} seaways with its 95 % interval"
    words = title or "Swing over the size of the luff drive's orifice"
    figure, ax = _panel(result.crane, words, looks, seaway_words(result.sea), said)
    _mean_lines(ax, result, looks)
    dress(ax, "swing, RMS (deg)")
    mean = np.degrees(result.mean())
    low = max(LEAST, 0.5 * float(np.nanmin(mean)))
    _logarithmic(ax, low, 1.6 * float(np.nanmax(mean)))
    ax.axvline(1.0, color=FAINT, linewidth=0.8, zorder=1.0)
    write(ax, "as built", (1.0, low), (4.0, 4.0), coords="data", color=GREY)
    ax.set_xlim(result.grid[0], result.grid[-1])
    label_below(ax, "orifice of the luff drive, to the identified one")
    return figure


def plot_operability(result: Sweep, *, limit_deg: float = 3.0, title: str = "") -> Figure:
    """Figure of the share of seaways in which the swing stays below a limit, over wave height."""
    looks = strokes(result.names)
    words = title or f"Seaways in which the load swings less than {limit_deg:g}°"
    said = f"{len(result.values)} seaways a height, peak at {result.sea.spectrum.period:g} s"
    figure, ax = _panel(result.crane, words, looks, said, height=2.6)
    shares = 100.0 * result.below(limit_deg)
    for k, (color, dashes) in enumerate(looks.values()):
        ax.plot(
            result.grid, shares[:, k], color=color, linestyle=dashes, linewidth=1.4, marker="o",
            ms=3.5, clip_on=False,
        )  # fmt: skip
    dress(ax, "share of seaways (%)")
    ax.set_ylim(0.0, 100.0)
    ax.set_xlim(left=0.0)
    label_below(ax, "significant height of the waves (m)")
    return figure


def plot_follow(result: Followable, *, title: str = "") -> Figure:
    """Figure of the amplitude that each axis can follow over the period, with seas as points."""
    looks = strokes(("hoist, up", "slew, across the boom", "luff, along the boom"))
    pose = result.pose
    said = f"boom at {np.degrees(pose.boom):.0f}°; points: what holding the tip asks of the luff"
    figure, ax = _panel(result.crane, title or "What the axes can follow", looks, said)
    for (color, dashes), values in zip(looks.values(), result.amplitude.T, strict=True):
        ax.plot(result.periods, values, color=color, linestyle=dashes, linewidth=1.4)
    for name, each in result.seas.items():
        ax.plot(each.period, each.amplitude[2], "D", color=INK, ms=4.5)
        box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}
        place = each.period, each.amplitude[2]
        write(ax, name, place, (6.0, -3.0), coords="data", bbox=box)
    dress(ax, "amplitude (m)")
    every = [*result.amplitude.ravel(), *(each.amplitude[2] for each in result.seas.values())]
    _logarithmic(ax, 0.8 * min(every), 1.25 * max(every))
    ax.set_xlim(result.periods[0], result.periods[-1])
    label_below(ax, "period (s)")
    return figure


def plot_sectors(result: Sweep, *, title: str = "") -> Figure:
    """Polar figure of the swing over the bearing of the boom, the radius logarithmic."""
    looks = strokes(result.names)
    legend = [handle(name, *look) for name, look in looks.items()]
    rows = legend_rows(legend)
    figure = new_figure(WIDTH, HEAD + ROW * (rows + 1) + 5.4 + FOOT, layout="none")
    write_title(figure, title or "Swing over the bearing of the boom")
    height = float(figure.get_figheight())
    top = 1.0 - (HEAD + ROW * (rows + 1) + 0.05) / height
    ax = figure.add_axes((0.16, 0.06, 0.68, top - 0.11), projection="polar")
    ax.set_theta_zero_location("N")  # type: ignore[attr-defined]
    ax.set_theta_direction(-1)  # type: ignore[attr-defined]
    mean = np.degrees(result.mean())
    floor, decades = np.log10(0.05), np.array([0.1, 0.3, 1.0, 3.0, 10.0, 30.0])
    around = np.append(result.grid, result.grid[0] + 2.0 * np.pi)
    for k, (color, dashes) in enumerate(looks.values()):
        radius = np.log10(np.maximum(np.append(mean[:, k], mean[0, k]), 0.05)) - floor
        ax.plot(around, radius, color=color, linestyle=dashes, linewidth=1.4)
    shown = decades[decades <= 1.3 * np.nanmax(mean)]
    ax.set_ylim(0.0, np.log10(1.3 * np.nanmax(mean)) - floor)
    ax.set_yticks(np.log10(shown) - floor, [f"{each:g}°" for each in shown])
    ax.set_rlabel_position(22.5)  # type: ignore[attr-defined]
    names = {0: "bow", 90: "starboard", 180: "stern", 270: "port"}
    angles = np.arange(0, 360, 30)
    ax.set_xticks(np.radians(angles), [names.get(int(each), f"{each}°") for each in angles])
    ax.tick_params(labelsize=SMALL, labelcolor=INK)
    ax.tick_params(axis="x", pad=8.0)
    for angle, text in zip(angles, ax.get_xticklabels(), strict=True):
        where: Literal["center", "left", "right"] = "left" if angle < 180 else "right"
        text.set_horizontalalignment("center" if angle % 180 == 0 else where)
    ax.grid(True, color=GRID, linewidth=0.6)
    ax.spines["polar"].set_color(FAINT)
    side = figure.add_axes((0.012, top + 0.01, 0.9, 0.001))
    side.set_axis_off()
    put_legend(side, legend)
    said = f"RMS, mean of {len(result.values)} seaways"
    remark(side, seaway_words(result.sea), said, assumed(result.crane), rows=rows)
    return figure


def plot_judgment(result: Judgment, *, title: str = "") -> Figure:
    """Figure of a judgment: swing of every variant in every seaway, and what limits its drives."""
    names = list(reversed(result.names))
    words = title or f"Swing in {len(result.study.seeds)} seaways"
    figure, (ax,) = sheet([0.42 * len(names) + 0.3], words, lines=1)
    said = "bars: mean with its 95 % interval"
    study = result.study
    remark(ax, seaway_words(study.sea), said, assumed(study.crane), right=True)
    edge = 1.05 * float(np.degrees(np.nanmax(result.values[..., 0])))
    random = np.random.default_rng(0)
    labels: list[str] = []
    for row, name in enumerate(names):
        values = np.degrees(result.rms(name))
        known = values[np.isfinite(values)]
        share = result.worse(name) if name in result.names[1:] else 0.0
        color = VERMILION if share > result.allowed else BLUE
        spread = row + random.uniform(-0.25, 0.25, known.size)
        ax.plot(known, spread, "o", color=color, ms=2.6, alpha=0.35, mew=0.0)
        mean = mean_of(known)
        ax.plot([mean.low, mean.high], [row, row], color=INK, linewidth=3.0, solid_capstyle="butt")
        ax.plot([mean.value] * 2, [row - 0.3, row + 0.3], color=INK, linewidth=1.6)
        worse = f"\nworse than none: {100.0 * share:.0f} %" if name in result.names[1:] else ""
        labels.append(name + worse)
    dress(ax)
    ax.grid(False, axis="y")
    ax.set_yticks(range(len(names)), labels, fontsize=NORMAL)
    ax.set_ylim(-0.6, len(names) - 0.4)
    ax.set_xlim(0.0, edge)
    label_below(ax, "swing, RMS of a seaway (deg)")
    return figure
