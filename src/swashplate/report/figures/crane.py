"""Figures of cranes: runs and what limits their drives; judgment, sweeps, what axes can follow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, overload

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator
from numpy.typing import NDArray

from swashplate.crane import Crane, CraneRun, Followable, Judgment, Seaway, Sweep
from swashplate.crane.judgment import mean_of
from swashplate.errors import InputError
from swashplate.report import style
from swashplate.report.lines import SHADES, draw, fit_time, shade_handle, stretches
from swashplate.results import GivenAxes
from swashplate.simulation.result import Limit
from swashplate.tables import count

Array = NDArray[np.float64]

MOST_RUNS = 6
"""More lines than that nobody can follow."""
MOVED = 2.0
"""Travel of slew and boom that gets a panel of its own. [deg]"""
ACTING = (Limit.ORIFICE, Limit.SWASH_STOP)
"""Limits that a crane's drives are judged by: of acceleration and of speed."""
LEAST = 0.01
"""Least swing on a logarithmic scale. [deg]"""


def assumed(crane: Crane) -> str:
    """How much of a crane's geometry is assumed, as a remark."""
    return f"{crane.assumed} of the crane are assumed" if crane.assumed else ""


def seaway_words(sea: Seaway | None, height: bool = True) -> str:
    """A seaway in a few words, with the height of its waves or without."""
    if sea is None:
        return "calm sea"
    what = str(sea.sea)
    if not isinstance(sea.sea, str):
        what = f"{sea.sea.height:g} m, " * height + f"peak at {sea.sea.period:g} s"
    return f"{what}, waves at {sea.heading_deg:g}°"


def remark(ax: Axes, *said: str, rows: int = 0, right: bool = False) -> None:
    """Write grey words above a panel, over so many rows of a legend."""
    words, shift = "; ".join(filter(None, said)), (0.0, 5.0 + 13.0 * rows)
    side = "right" if right else "left"
    style.write(ax, words, (float(right), 1.0), shift, color=style.GREY, ha=side)


def _panels(
    heights: list[float],
    labels: Sequence[str],
    below: str,
    title: str,
    looks: Mapping[str, style.Stroke],
    *said: str,
) -> tuple[Figure, list[Axes]]:
    """Panels with a legend of lines, where there are several, and a remark."""
    legend = [style.handle(name, *look) for name, look in looks.items()] if len(looks) > 1 else []
    figure, axes = style.sheet(heights, title, labels, below, legend=legend, lines=1)
    remark(axes[0], *said, rows=style.legend_rows(legend) if legend else 0)
    return figure, axes


def _logarithmic(ax: Axes, low: float, high: float) -> None:
    """A logarithmic ordinate with plain numbers."""
    ax.set_yscale("log")
    ax.set_ylim(low, high)
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.yaxis.set_minor_locator(NullLocator())


# --- runs -----------------------------------------------------------------------------------------


def plot_crane(
    runs: CraneRun | Mapping[str, CraneRun],
    *,
    sea: Mapping[str, CraneRun] | None = None,
    title: str | None = None,
) -> Figure:
    """Figure of a run or of several: swing, slew and boom where they move, and when limits act.

    Parameters
    ----------
    runs : CraneRun or mapping of str to CraneRun
        Up to six of one length, by their names.
    sea : mapping of str to CraneRun, optional
        The same in a seaway, whose swing gets a panel of its own.
    """
    named = {runs.actuation: runs} if isinstance(runs, CraneRun) else dict(runs)
    if not 0 < len(named) <= MOST_RUNS:
        raise InputError(f"A figure shows 1 to {MOST_RUNS} runs of a crane, not {len(named)}.")
    first, looks = next(iter(named.values())), style.strokes(named)
    driven = {name: run for name, run in named.items() if run.actuation != "ideal"}
    shown = [("swing_deg", "swing (deg)", 2.1, named)]
    for signal, label, height in (("slew_deg", "slew (deg)", 1.5), ("boom_deg", "boom (deg)", 1.2)):
        if any(np.ptp(getattr(run, signal)) > MOVED for run in named.values()):
            shown.append((signal, label, height, named))
    shown += [("swing_deg", "in sea (deg)", 1.5, dict(sea))] if sea else []
    heights = [height for _, _, height, _ in shown]
    heights += [0.17 * 2 * len(driven) + 0.25] if driven else []
    labels = [label for _, label, _, _ in shown] + ["limits"] * bool(driven)
    back = "grey line: the stick is back at zero" if first.stick_end > 0.0 else ""
    said, title = (back, assumed(first.crane)), title or first.crane.title
    figure, axes = _panels(heights, labels, "time (s)", title, looks, *said)
    for ax, (signal, _, _, lines) in zip(axes, shown, strict=False):
        for name, run in lines.items():
            draw(ax, run.time, getattr(run, signal), looks[name].color, dashes=looks[name].dashes)
        if signal == "swing_deg":
            ax.set_ylim(bottom=0.0)
    if driven:
        _acting(axes[-1], driven, looks)
    for ax in axes:
        fit_time(ax, first.time)
        if first.stick_end > 0.0:
            ax.axvline(first.stick_end, color=style.FAINT, linewidth=0.8, zorder=1.0)
    return figure


def _acting(ax: Axes, runs: Mapping[str, CraneRun], looks: Mapping[str, style.Stroke]) -> None:
    """Bars where limits of slew and luff act, a row for each run and axis."""
    rows = [(name, axis) for name in runs for axis in ("slew", "luff")]
    ax.set_ylim(len(rows) - 0.4, -0.6)
    for row, (name, axis) in enumerate(rows):
        for limit in ACTING:
            spans = stretches(runs[name].time, runs[name].active(axis, limit))
            bars = [(start, end - start) for start, end in spans]
            color = SHADES[limit].color
            ax.broken_barh(bars, (row - 0.36, 0.72), facecolors=color, edgecolor="none")
    ax.grid(False, axis="y")
    ax.set_yticks(range(len(rows)), [axis for _, axis in rows], fontsize=style.SMALL)
    for (name, _), text in zip(rows, ax.get_yticklabels(), strict=True):
        text.set_color(looks[name].color if len(runs) > 1 else style.INK)
    style.put_legend(ax, [shade_handle(SHADES[limit]) for limit in ACTING])


# --- studies --------------------------------------------------------------------------------------


LOOKS = {
    "bearing": ("Swing over the bearing of the boom", "RMS, mean of {}", "", ""),
    "height": (
        *("Seaways in which the load swings less than {:g}°", "{} a height"),
        *("share of seaways (%)", "significant height of the waves (m)"),
    ),
    "orifice": (
        *("Swing over the size of the luff drive's orifice", "mean of {} with its 95 % interval"),
        *("swing, RMS (deg)", "orifice of the luff drive, to the identified one"),
    ),
    "stick": (
        *("Residual swing after a slew", ""),
        *("residual swing (deg)", "stick, part of the full speed"),
    ),
}
"""Title of a sweep over a quantity, remark on its seaways, ordinate, abscissa."""


def plot_sweep(result: Sweep, *, limit_deg: float = 3.0, title: str = "") -> Figure:
    """Figure of the swing over a quantity, for several variants.

    Over the bearing of the boom it is polar, with a logarithmic radius; over the waves' height it
    shows the share of seaways in which the largest swing stays below a limit; over the stick the
    residual swing, and where the slew ends.
    """
    looks, points = style.strokes(result.names), result.points
    usual, seaways, label, below = LOOKS[result.over]
    words = title or usual.format(limit_deg)
    sea = seaway_words(result.sea, result.over != "height")
    said = (sea, seaways.format(count(len(result.values), "seaway")), assumed(result.crane))
    if result.over == "bearing":
        return _polar(result, words, looks, *said)
    stick = result.over == "stick"
    heights, labels = ([2.7, 1.4] if stick else [3.0]), (label, "slew reached (deg)")
    figure, (ax, *ends) = _panels(heights, labels, below, words, looks, *said)
    values, shares = np.degrees(result.values), 100.0 * result.below(limit_deg)
    for k, (color, dashes) in enumerate(looks.values()):
        how: dict[str, Any] = {"color": color, "linestyle": dashes, "linewidth": 1.4}
        if result.over == "height":
            ax.plot(points, shares[:, k], marker="o", ms=3.5, clip_on=False, **how)
        elif stick:
            ax.plot(points, np.maximum(values[0, :, k, 1], LEAST), marker="o", ms=3.0, **how)
            ends[0].plot(points, values[0, :, k, 2], marker="o", ms=3.0, **how)
        else:
            found = np.array([mean_of(values[:, n, k, 0], 0.0) for n in range(points.size)])
            middle, low, high = np.maximum(found, LEAST).T
            ax.fill_between(points, low, high, color=color, alpha=0.15, linewidth=0.0)
            ax.plot(points, middle, **how)
    if result.over == "height":
        ax.set_ylim(0.0, 100.0)
        ax.set_xlim(left=0.0)
    elif stick:
        _logarithmic(ax, LEAST, 1.3 * float(np.nanmax(values[..., 1])))
    else:
        mean = values[..., 0].mean(axis=0)
        low = max(LEAST, 0.5 * float(np.nanmin(mean)))
        _logarithmic(ax, low, 1.6 * float(np.nanmax(mean)))
        ax.axvline(1.0, color=style.FAINT, linewidth=0.8, zorder=1.0)
        style.write(ax, "as built", (1.0, low), (4.0, 4.0), coords="data", color=style.GREY)
        ax.set_xlim(points[0], points[-1])
    return figure


def _polar(result: Sweep, title: str, looks: dict[str, style.Stroke], *said: str) -> Figure:
    """Swing over the bearing around the ship."""
    legend = [style.handle(name, *look) for name, look in looks.items()]
    rows = style.legend_rows(legend)
    above = style.HEAD + style.ROW * (rows + 1)
    figure = style.new_figure(style.WIDTH, above + 5.4 + style.FOOT, layout="none")
    style.write_title(figure, title)
    top = 1.0 - (above + 0.05) / float(figure.get_figheight())
    ax: Any = figure.add_axes((0.16, 0.06, 0.68, top - 0.11), projection="polar")
    ax.set_theta_zero_location("N")
    ax.set_theta_direction(-1)
    mean, floor = np.degrees(result.mean()[..., 0]), np.log10(0.05)
    # closed where the bearings go all the way around, not where they are part of a circle
    again = result.points[:1] + 2.0 * np.pi
    gap = again - result.points[-1]
    again = again[gap <= 1.5 * np.diff(result.points).max(initial=0.0)]
    around = np.append(result.points, again)
    for values, (color, dashes) in zip(mean.T, looks.values(), strict=True):
        radius = np.log10(np.maximum(np.append(values, values[: again.size]), 0.05)) - floor
        ax.plot(around, radius, color=color, linestyle=dashes, linewidth=1.4)
    shown = [each for each in (0.1, 0.3, 1.0, 3.0, 10.0, 30.0) if each <= 1.3 * np.nanmax(mean)]
    ax.set_ylim(0.0, np.log10(1.3 * np.nanmax(mean)) - floor)
    ax.set_yticks(np.log10(shown) - floor, [f"{each:g}°" for each in shown])
    ax.set_rlabel_position(52.5)  # lines cross it straight on
    names = {0: "bow", 90: "starboard", 180: "stern", 270: "port"}
    angles = range(0, 360, 30)
    ax.set_xticks(np.radians(angles), [names.get(each, f"{each}°") for each in angles])
    ax.tick_params(labelsize=style.SMALL, labelcolor=style.INK)
    ax.tick_params(axis="x", pad=8.0)
    for angle, text in zip(angles, ax.get_xticklabels(), strict=True):
        side = "left" if angle < 180 else "right"
        text.set_horizontalalignment("center" if angle % 180 == 0 else side)
    ax.grid(True, color=style.GRID, linewidth=0.6)
    ax.spines["polar"].set_color(style.FAINT)
    head = figure.add_axes((0.012, top + 0.01, 0.9, 0.001))
    head.set_axis_off()
    style.put_legend(head, legend)
    remark(head, *said, rows=rows)
    return figure


@overload
def plot_follow(result: Followable, *, ax: None = None, title: str = "") -> Figure: ...


@overload
def plot_follow(result: Followable, *, ax: GivenAxes, title: str = "") -> GivenAxes: ...


def plot_follow(
    result: Followable, *, ax: Axes | Sequence[Axes] | None = None, title: str = ""
) -> Figure | Axes | Sequence[Axes]:
    """Figure of the amplitude that each axis can follow over the period, with seas as points.

    By default a new figure; with `ax` it is drawn there, without the remark above, and `ax`
    returned.
    """
    looks = style.strokes(("hoist, up", "slew, across the boom", "luff, along the boom"))
    said = f"boom at {result.boom_deg:.0f}°; points: what holding the tip asks of the luff"
    words = title or "What the axes can follow"
    labels = ("amplitude (m)",), "period (s)"
    if ax is None:
        figure, (panel,) = _panels([3.3], *labels, words, looks, said, assumed(result.crane))
    else:
        legend = [style.handle(name, *look) for name, look in looks.items()]
        (panel,) = style.dress_given(ax, title, *labels, what="panel", legend=legend)
    for (color, dashes), values in zip(looks.values(), result.amplitude.T, strict=True):
        panel.plot(result.periods, values, color=color, linestyle=dashes, linewidth=1.4)
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}
    for name, each in result.seas.items():
        place = each.period, each.amplitude[2]
        panel.plot(*place, "D", color=style.INK, ms=4.5)
        style.write(panel, name, place, (6.0, -3.0), coords="data", bbox=box)
    every = [*result.amplitude.ravel(), *(each.amplitude[2] for each in result.seas.values())]
    _logarithmic(panel, 0.8 * min(every), 1.25 * max(every))
    panel.set_xlim(result.periods[0], result.periods[-1])
    return figure if ax is None else ax


@overload
def plot_judgment(result: Judgment, *, ax: None = None, title: str = "") -> Figure: ...


@overload
def plot_judgment(result: Judgment, *, ax: GivenAxes, title: str = "") -> GivenAxes: ...


def plot_judgment(
    result: Judgment, *, ax: Axes | Sequence[Axes] | None = None, title: str = ""
) -> Figure | Axes | Sequence[Axes]:
    """Figure of a judgment: swing of every variant in every seaway, its mean and interval.

    By default a new figure; with `ax` it is drawn there, without the remark above, and `ax`
    returned.
    """
    names, study = list(reversed(result.names)), result.study
    words = title or f"Swing in {count(len(study.seeds), 'seaway')}"
    below = "swing, RMS of a seaway (deg)"
    if ax is None:
        figure, (panel,) = style.sheet([0.42 * len(names) + 0.3], words, below=below, lines=1)
        said = "bars: mean with its 95 % interval"
        remark(panel, seaway_words(study.sea), said, assumed(study.crane), right=True)
    else:
        (panel,) = style.dress_given(ax, title, [""], below, what="panel")
    random = np.random.default_rng(0)
    labels, edge = [], 0.0
    for row, name in enumerate(names):
        values = np.degrees(result.counted(name))
        known = values[np.isfinite(values)]
        edge = max(edge, float(known.max(initial=0.0)))
        share = result.worse(name).value if name in result.names[1:] else 0.0
        color = style.VERMILION if share > result.allowed else style.BLUE
        spread = row + random.uniform(-0.25, 0.25, known.size)
        panel.plot(known, spread, "o", color=color, ms=3.2, alpha=0.45, mew=0.0)
        mean = mean_of(known, 0.0)
        panel.hlines(row, mean.low, mean.high, color=style.INK, linewidth=3.0)
        panel.vlines(mean.value, row - 0.3, row + 0.3, color=style.INK, linewidth=1.6)
        of = f"{round(share * values.size)} of {values.size}"
        worse = f"\nworse than none: {of}" if name in result.names[1:] else ""
        labels.append(name + worse)
    panel.grid(False, axis="y")
    panel.set_yticks(range(len(names)), labels, fontsize=style.NORMAL)
    panel.set_ylim(-0.6, len(names) - 0.4)
    panel.set_xlim(0.0, 1.05 * edge)
    return figure if ax is None else ax
