"""Figures of cranes: runs and what limits their drives, sweeps, what axes can follow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import wrap
from typing import Any, Literal, NamedTuple, overload

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator
from numpy.typing import NDArray

from swashplate.crane import Crane, CraneRun, Followable, Hull, Seaway, Sweep, named_runs
from swashplate.crane.sea import rms_of
from swashplate.drive import Limit
from swashplate.report import style
from swashplate.report.lines import SHADES, draw, fit_time, shade_handle, stretches
from swashplate.results import GivenAxes
from swashplate.tables import count

Array = NDArray[np.float64]

MOST_RUNS = 6
"""More lines than that nobody can follow."""
MOVED = 2.0
"""Travel of slew and boom that gets a panel of its own. [deg]"""
ACTING = (Limit.ORIFICE, Limit.SWASH_STOP)
"""Limits that a crane's drives are assessed by: of acceleration and of speed."""
LEAST = 0.01
"""Least swing on a logarithmic scale. [deg]"""
LETTERS = 118
"""Letters of a line above a panel."""


def assumed(crane: Crane) -> str:
    """Remark on the assumed part of a crane's geometry."""
    return f"{crane.assumed} of the crane are assumed" if crane.assumed else ""


HEADINGS = {
    0.0: "following",
    90.0: "abeam from starboard",
    180.0: "head sea",
    270.0: "abeam from port",
}
"""Names of headings of the waves. [deg]"""


def seaway_label(sea: Seaway, height: bool = True) -> str:
    """A seaway in a few words, with the height of its waves or without.

    ``"ss3 0.88 m, 7.5 s, abeam from starboard, roll 13 s"``
    """
    spectrum = sea.spectrum
    first = f"{spectrum.height:g} m, {spectrum.period:g} s"
    if not height:
        first = f"peak at {spectrum.period:g} s"
    elif isinstance(sea.sea, str):
        first = f"{sea.sea} {first}"
    heading = HEADINGS.get(sea.heading_deg % 360.0, f"waves at {sea.heading_deg:g}°")
    texts = [first, heading]
    if spectrum.peak_factor != 1.0:
        texts.insert(1, f"γ {spectrum.peak_factor:g}")
    if isinstance(sea.ship, Hull):
        texts.append(f"roll {sea.ship.roll_period:g} s")
    return ", ".join(texts)


def remarks(texts: Sequence[str]) -> str:
    """Join remarks, of which some may be empty, in lines that fit above a panel."""
    return "\n".join(wrap("; ".join(filter(None, texts)), LETTERS))


def remark(ax: Axes, text: str, rows: int = 0) -> None:
    """Write grey words above a panel, over so many rows of a legend."""
    style.put_text(ax, text, (0.0, 1.0), (0.0, 3.0 + 13.0 * rows), color=style.GREY, va="bottom")


def _panels(
    heights: list[float],
    labels: Sequence[str],
    x_label: str,
    title: str,
    strokes: Mapping[str, style.Stroke],
    texts: Sequence[str],
) -> tuple[Figure, list[Axes]]:
    """Make panels with a legend of lines, if there are several, and remarks above them."""
    legend = []
    if len(strokes) > 1:
        legend = style.stroke_handles(strokes)
    joined_remarks = remarks(texts)
    lines = 1 + joined_remarks.count("\n")
    figure, axes = style.sheet(heights, title, labels, x_label, legend=legend, lines=lines)
    remark(axes[0], joined_remarks, style.legend_rows(legend) if legend else 0)
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
    """Figure of a run or of several: swing, slew and boom if they move, and when limits act.

    Parameters
    ----------
    runs : CraneRun or mapping of str to CraneRun
        Up to six of one length, by their names.
    sea : mapping of str to CraneRun, optional
        The same in a seaway, whose swing gets a panel of its own.
    """
    named = named_runs(runs, MOST_RUNS, "A figure")
    first = next(iter(named.values()))
    strokes = style.strokes(named)
    driven = {name: run for name, run in named.items() if run.actuation != "ideal"}
    panels = _signal_panels(named, sea or {})
    heights = [panel.height for panel in panels]
    labels = [panel.label for panel in panels]
    if driven:
        heights.append(0.17 * 2 * len(driven) + 0.25)
        labels.append("limits")
    stick_moves = first.stick_end > 0.0
    stick_remark = "grey line: the stick is back at zero" if stick_moves else ""
    figure, axes = _panels(
        heights,
        labels,
        "time (s)",
        title or first.crane.title,
        strokes,
        texts=(stick_remark, assumed(first.crane)),
    )
    for ax, panel in zip(axes, panels, strict=False):
        _draw_signal(ax, panel, strokes)
    if driven:
        _draw_limits(axes[-1], driven, strokes)
    for ax in axes:
        fit_time(ax, first.time)
        if stick_moves:
            ax.axvline(first.stick_end, color=style.FAINT, linewidth=0.8, zorder=1.0)
    return figure


class SignalPanel(NamedTuple):
    """A panel of one signal of several runs."""

    signal: str
    """Name of the signal of a `CraneRun`."""
    label: str
    height: float
    """[inch]"""
    runs: Mapping[str, CraneRun]


def _signal_panels(
    runs: Mapping[str, CraneRun], runs_at_sea: Mapping[str, CraneRun]
) -> list[SignalPanel]:
    """Panels of swing, slew and boom if one of them moves, and swing at sea if it was simulated."""
    panels = [SignalPanel("swing_deg", "swing (deg)", 2.1, runs)]
    slew = SignalPanel("slew_deg", "slew (deg)", 1.5, runs)
    boom = SignalPanel("boom_deg", "boom (deg)", 1.2, runs)
    panels += [panel for panel in (slew, boom) if _moves(panel)]
    if runs_at_sea:
        panels.append(SignalPanel("swing_deg", "in sea (deg)", 1.5, dict(runs_at_sea)))
    return panels


def _moves(panel: SignalPanel) -> bool:
    """Whether the angle of a panel moves in any of its runs, so far that it is worth a panel."""
    return any(np.ptp(getattr(run, panel.signal)) > MOVED for run in panel.runs.values())


def _draw_signal(ax: Axes, panel: SignalPanel, strokes: Mapping[str, style.Stroke]) -> None:
    """Draw the signal of a panel, a line for each run."""
    for name, run in panel.runs.items():
        stroke = strokes[name]
        draw(ax, run.time, getattr(run, panel.signal), stroke.color, dashes=stroke.dashes)
    if panel.signal == "swing_deg":
        ax.set_ylim(bottom=0.0)


def _draw_limits(
    ax: Axes, runs: Mapping[str, CraneRun], strokes: Mapping[str, style.Stroke]
) -> None:
    """Draw bars while limits of slew and luff act, a row for each run and axis."""
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
        text.set_color(strokes[name].color if len(runs) > 1 else style.INK)
    style.put_legend(ax, [shade_handle(SHADES[limit]) for limit in ACTING])


# --- sweeps ---------------------------------------------------------------------------------------


LOOKS = {
    "bearing": ("Swing over the bearing of the boom", ""),
    "height": ("Swing over the height of the waves", "significant height of the waves (m)"),
    "orifice": (
        "Swing over the size of the luff drive's orifice",
        "orifice of the luff drive, to the identified one",
    ),
}
"""Title of a sweep over a quantity, and its abscissa."""
RADII = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
"""Circles of a polar figure. [deg]"""
DIAMETER = 5.0
"""Diameter of a polar figure. [inch]"""
AROUND = 0.46
"""Space for the names of bearings around it. [inch]"""
CENTRE = 0.05
"""Swing at the centre of a polar figure, whose radius is logarithmic. [deg]"""


def plot_sweep(result: Sweep, *, title: str | None = None) -> Figure:
    """Figure of the swing over a quantity, for several variants: mean and 95 % interval.

    Over the bearing of the boom it is polar, with a logarithmic radius, half a circle if the
    bearings are on one side of the ship. If one of the runs at a point left the model, the line has
    a gap there, and a cross marks it.
    """
    strokes = style.strokes(result.names)
    default_title, x_label = LOOKS[result.over]
    means = "over {} with its 95 % interval"
    if result.over == "bearing":
        means = "RMS over {}"
    some_left = bool(np.isnan(result.rms()).any())
    texts = (
        seaway_label(result.seaway, result.over != "height"),
        means.format(count(len(result.values), "seaway")),
        "" if result.over == "bearing" else "thin line: no control, by its spectrum",
        "×: a run left the model" if some_left else "",
        assumed(result.crane),
    )
    if result.over == "bearing":
        return _polar(result, title or default_title, strokes, texts)
    labels = ("swing, RMS (deg)",)
    figure, (ax,) = _panels([3.0], labels, x_label, title or default_title, strokes, texts)
    swings = np.degrees(result.values)
    points = result.points
    highest = LEAST
    for variant, (color, dashes) in enumerate(strokes.values()):
        of_variant = swings[:, :, variant].T
        estimates = np.array([rms_of(seaways) for seaways in of_variant])
        left_model = np.isnan(of_variant).any(axis=1)
        estimates[left_model] = np.nan  # a mean of those that stayed would be too small
        middle, low, high = np.maximum(estimates, LEAST).T
        ax.fill_between(points, low, high, color=color, alpha=0.12, linewidth=0.0)
        ax.plot(points, middle, color=color, linestyle=dashes, linewidth=1.4, marker="o", ms=3.0)
        # crosses of several variants at a point stand below one another
        height = np.full(int(left_model.sum()), 0.97 - 0.05 * variant)
        x = ax.get_xaxis_transform()
        ax.plot(points[left_model], height, "x", color=color, ms=5.0, transform=x, clip_on=False)
        highest = max(highest, float(np.nanmax(np.append(middle, LEAST))))
    ax.plot(points, np.degrees(result.spectrum), color=style.GREY, linewidth=0.8, zorder=1.5)
    if result.over == "height":
        ax.set_ylim(0.0, 1.25 * highest)
        ax.set_xlim(0.0, 1.02 * float(points.max()))
    else:
        finite = swings[np.isfinite(swings)]
        low = max(LEAST, 0.5 * float(finite.min(initial=highest)))
        _logarithmic(ax, low, 2.0 * highest)
        ax.axvline(1.0, color=style.FAINT, linewidth=0.8, zorder=1.0)
        style.put_text(ax, "as built", (1.0, low), (4.0, 4.0), coords="data", color=style.GREY)
    return figure


Side = Literal["starboard", "port"]
SIDES: dict[Side, float] = {"starboard": 0.0, "port": np.pi}
"""Sides of the ship, with the first bearing of each. [rad]"""


def _side_of(bearings: Array) -> Side | None:
    """Side of the ship that all bearings [rad] lie on; None if they are on both."""
    for side, first in SIDES.items():
        if bearings.size and (bearings >= first).all() and (bearings <= first + np.pi).all():
            return side
    return None


def _polar(
    result: Sweep, title: str, strokes: dict[str, style.Stroke], texts: Sequence[str]
) -> Figure:
    """Swing over the bearing around the ship, or over the half of it that the bearings are on."""
    legend = style.stroke_handles(strokes)
    rows = style.legend_rows(legend)
    joined_remarks = remarks(texts)
    header_height = style.HEAD + style.ROW * (rows + 1 + joined_remarks.count("\n"))
    side = _side_of(result.points)
    plot_height = DIAMETER if side is None else 0.5 * DIAMETER
    height = header_height + plot_height + 2.0 * AROUND
    figure = style.new_figure(style.WIDTH, height, layout="none")
    style.write_title(figure, title)
    # the axes are a square, of which half a circle takes the middle
    left = 0.5 * (style.WIDTH - DIAMETER)
    bottom = AROUND + 0.5 * (plot_height - DIAMETER)
    square = (left / style.WIDTH, bottom / height, DIAMETER / style.WIDTH, DIAMETER / height)
    ax: Any = figure.add_axes(square, projection="polar")
    if side is None:
        _dress_circle(ax)
    else:
        _dress_half_circle(ax, SIDES[side])
    _draw_polar(ax, result, strokes)
    header = figure.add_axes((0.012, 1.0 - (header_height + 0.02) / height, 0.9, 0.001))
    header.set_axis_off()
    style.put_legend(header, legend)
    remark(header, joined_remarks, rows)
    return figure


BEARINGS = {0: "bow", 90: "starboard", 180: "stern", 270: "port"}
"""Names of bearings, clockwise from the bow. [deg]"""


def _dress_circle(ax: Any) -> None:
    """Turn polar axes so that the bow is at the top, and name the bearings around them."""
    angles = range(0, 360, 30)
    ax.set_theta_offset(0.5 * np.pi)
    _dress_bearings(ax, angles)
    for angle, text in zip(angles, ax.get_xticklabels(), strict=True):
        alignment = "left" if angle < 180 else "right"
        text.set_horizontalalignment("center" if angle % 180 == 0 else alignment)


def _dress_half_circle(ax: Any, first_bearing: float) -> None:
    """Show half a circle from a bearing [rad] on, with its diameter level and named bearings."""
    first_deg = np.degrees(first_bearing)
    ax.set_theta_offset(first_bearing + np.pi)
    ax.set_thetamin(first_deg)
    ax.set_thetamax(first_deg + 180.0)
    ax.spines["start"].set_color(style.FAINT)
    ax.spines["end"].set_color(style.FAINT)
    _dress_bearings(ax, range(round(first_deg), round(first_deg) + 181, 30))


def _dress_bearings(ax: Any, angles: range) -> None:
    """Dress polar axes, with names of bearings [deg], clockwise."""
    ax.set_theta_direction(-1)
    labels = [BEARINGS.get(angle % 360, f"{angle}°") for angle in angles]
    ax.set_xticks(np.radians(angles), labels)
    ax.tick_params(labelsize=style.SMALL, labelcolor=style.INK)
    ax.tick_params(axis="x", pad=8.0)
    ax.grid(True, color=style.GRID, linewidth=0.6)
    ax.spines["polar"].set_color(style.FAINT)


def _draw_polar(ax: Any, result: Sweep, strokes: Mapping[str, style.Stroke]) -> None:
    """Draw the swing of each variant over the bearing, on a logarithmic radius."""
    mean = np.degrees(result.rms())
    largest = float(np.nanmax(np.append(mean, RADII[1])))
    # closed if the bearings go all the way around, not if they are part of a circle
    closing_bearing = result.points[:1] + 2.0 * np.pi
    gap = closing_bearing - result.points[-1]
    closing_bearing = closing_bearing[gap <= 1.5 * np.diff(result.points).max(initial=0.0)]
    bearings = np.append(result.points, closing_bearing)
    outer_radius = float(np.log10(1.3 * largest / CENTRE))
    for swing, (color, dashes) in zip(mean.T, strokes.values(), strict=True):
        closed_swing = np.append(swing, swing[: closing_bearing.size])
        radius = np.log10(np.maximum(closed_swing, CENTRE) / CENTRE)
        ax.plot(bearings, radius, color=color, linestyle=dashes, linewidth=1.4, marker="o", ms=2.5)
        left_model = result.points[np.isnan(swing)]
        rim = np.full(left_model.size, outer_radius)
        ax.plot(left_model, rim, "x", color=color, ms=6.0, clip_on=False)
    circles = [radius for radius in RADII if radius <= 1.3 * largest]
    ax.set_ylim(0.0, outer_radius)
    ax.set_yticks(np.log10(np.array(circles) / CENTRE), [f"{radius:g}°" for radius in circles])
    if _side_of(result.points) is None:
        ax.set_rlabel_position(52.5)  # lines cross it straight on


# --- what axes can follow -------------------------------------------------------------------------


AXIS_LINES = ("hoist, up", "slew, across the boom", "luff, along the boom")
DEMANDED = "diamonds: demand on each for holding the tip, filled if it exceeds the limit"
APART = 0.006
"""Distance of the diamonds of the three axes, in parts of the abscissa."""
LOWEST_DEMAND = 0.2
"""Least amplitude shown, over the least that an axis can follow; a triangle stands for less."""


@overload
def plot_follow(result: Followable, *, ax: None = None, title: str | None = None) -> Figure: ...


@overload
def plot_follow(result: Followable, *, ax: GivenAxes, title: str | None = None) -> GivenAxes: ...


def plot_follow(
    result: Followable, *, ax: Axes | Sequence[Axes] | None = None, title: str | None = None
) -> Figure | Axes | Sequence[Axes]:
    """Figure of the amplitude that each axis can follow over the period, and of the seas' demands.

    The demand of a sea is a diamond in the axis's colour, filled if the axis cannot follow it. If
    it is below the ordinate, it is a triangle at the lower end.

    By default a new figure; with `ax` it is drawn there, without the remark above, and `ax`
    returned.
    """
    strokes = style.strokes(AXIS_LINES)
    label = "amplitude (m)"
    x_label = "period (s)"
    if ax is None:
        figure, (panel,) = _panels(
            heights=[3.6],
            labels=[label],
            x_label=x_label,
            title=title or "What the axes can follow",
            strokes=strokes,
            texts=(f"boom at {result.boom_deg:.0f}°", DEMANDED, assumed(result.crane)),
        )
    else:
        legend = style.stroke_handles(strokes)
        (panel,) = style.dress_given(ax, title, [label], x_label, what="panel", legend=legend)
    lines = list(zip(strokes.values(), result.amplitude.T, strict=True))
    for (color, dashes), amplitudes in lines:
        panel.plot(result.periods, amplitudes, color=color, linestyle=dashes, linewidth=1.4)
    first = float(result.periods[0])
    last = float(result.periods[-1])
    seas = {name: sea for name, sea in result.seas.items() if first <= sea.period <= last}
    demands = [demand for sea in seas.values() for demand in sea.amplitude]
    low = LOWEST_DEMAND * float(result.amplitude.min())
    _logarithmic(panel, low, 1.8 * max([float(result.amplitude.max()), *demands]))
    panel.set_xlim(first, last)
    for sea in seas.values():
        for axis, demand in enumerate(sea.amplitude):
            (color, _), amplitudes = lines[axis]
            beyond = demand > np.interp(sea.period, result.periods, amplitudes)
            panel.plot(
                sea.period + (axis - 1) * APART * (last - first),
                max(demand, low),
                "D" if demand > low else "v",
                color=color,
                mfc=color if beyond else "white",
                ms=5.0,
                zorder=3.0,
                clip_on=False,
            )
    _name_seas(panel, {name: (sea.period, max(sea.amplitude)) for name, sea in seas.items()})
    return figure if ax is None else ax


def _name_seas(ax: Axes, tops: Mapping[str, tuple[float, float]]) -> None:
    """Names of seas above their highest diamonds, moved up if they would meet another name."""
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.85}
    low, high = np.log(ax.get_ylim())
    first, last = ax.get_xlim()
    names: list[tuple[float, float, float]] = []
    for name, (period, top) in sorted(tops.items(), key=lambda entry: entry[1]):
        x = (period - first) / (last - first)
        y = (np.log(top) - low) / (high - low)
        width = 0.012 * len(name)
        while any(
            abs(x - named_across) < 0.5 * (width + named_width) and abs(y - named_up) < 0.06
            for named_across, named_up, named_width in names
        ):
            y += 0.01
        names.append((x, y, width))
        style.put_text(ax, name, (x, y), (0.0, 6.0), ha="center", bbox=box)
