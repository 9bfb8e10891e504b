"""Figures of analyses: envelope, limits over time, what-ifs, bands, sensitivities, inverse maps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, overload

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.typing import ColorType
from numpy.typing import ArrayLike

from swashplate.analysis import (
    AS_IS,
    CHANGED,
    AcceleratedBy,
    Bands,
    DirectionLimits,
    Envelope,
    Improvement,
    InverseMap,
    OneAtATime,
    WhatIf,
    proportional_command,
)
from swashplate.drive import Limit, Simulation
from swashplate.errors import InputError
from swashplate.report.lines import (
    COLUMNS,
    SHADES,
    Array,
    draw,
    fit_time,
    merged_spans,
    stretches,
)
from swashplate.report.style import (
    BLUE,
    FAINT,
    FOOT,
    GREEN,
    GREY,
    HEAD,
    INK,
    LINE,
    NORMAL,
    ORANGE,
    PURPLE,
    ROW,
    SKY,
    SMALL,
    VERMILION,
    WIDTH,
    Dashes,
    Stroke,
    dress,
    dress_given,
    given_axes,
    handle,
    legend_within,
    new_figure,
    put_legend,
    put_text,
    sheet,
    signed,
    stroke_handles,
    write_title,
    zero_line,
)
from swashplate.results import GivenAxes
from swashplate.tables import share_cell
from swashplate.units import display_unit

# --- envelope -------------------------------------------------------------------------------------

ROOM = 1.12
"""Size of the axes over the range of the speeds."""
ENVELOPE_COLORS = (BLUE, VERMILION, FAINT)
"""Of the two largest commands and of the released joystick."""
DASHES: dict[AcceleratedBy, Dashes] = {
    "orifice": "solid",
    "spool stop": "dashed",
    "valve": "dotted",
}
LIMITATIONS: dict[AcceleratedBy, str] = {
    "orifice": "limited by the orifice",
    "spool stop": "limited by the spool's stop",
    "valve": "limited by the valve's opening",
}


@overload
def plot_envelope(envelope: Envelope, *, ax: None = None, title: str | None = None) -> Figure: ...


@overload
def plot_envelope(envelope: Envelope, *, ax: GivenAxes, title: str | None = None) -> GivenAxes: ...


def plot_envelope(
    envelope: Envelope,
    *,
    ax: Axes | Sequence[Axes] | None = None,
    title: str | None = None,
) -> Figure | Axes | Sequence[Axes]:
    """Figure of acceleration over speed with the limits labelled.

    The upper line is what +10 V gives, the lower one -10 V; between them everything can be
    reached. How a line is drawn says what limits it. The grey one is the stick let go.

    Parameters
    ----------
    envelope : Envelope
        What to show.
    ax : matplotlib axes, optional
        Where to draw, with a legend of only the colours; by default in a new figure.

    Returns
    -------
    Figure, or `ax` as it was given

    Examples
    --------
    >>> from swashplate import Drive, analysis
    >>> from swashplate.report.figures import plot_envelope
    >>> plot_envelope(analysis.envelope(Drive.preset("hoist"))).savefig("envelope.png")
    """
    plus, minus = envelope.largest
    names = (f"+{plus:.3g} V", f"−{minus:.3g} V", "let go")
    colors = [handle(name, color) for name, color in zip(names, ENVELOPE_COLORS, strict=True)]
    curves = (*envelope.accelerating, envelope.released)
    drawn = set[str]()
    for curve in curves:
        drawn.update(curve.by)
    dashes = [
        handle(LIMITATIONS[by], INK, pattern, LINE) for by, pattern in DASHES.items() if by in drawn
    ]
    y_label = display_unit("rad/s^2").label("acceleration")
    x_label = display_unit("rad/s").label("speed")
    if ax is None:
        default_title = f"{envelope.name}: acceleration that each speed allows"
        figure, (panel,) = sheet(
            [3.8],
            default_title if title is None else title,
            [y_label],
            x_label,
            legend=[*colors, *dashes],
        )
        _draw_envelope(panel, envelope)
        return figure
    # the curves leave only the left end of the middle free
    (panel,) = dress_given(
        ax, title, [y_label], x_label, what="panel", legend=colors, legend_at="center left"
    )
    _draw_envelope(panel, envelope)
    return ax


def _draw_envelope(ax: Axes, envelope: Envelope) -> None:
    speed = display_unit("rad/s")
    acceleration = display_unit("rad/s^2")
    zero_line(ax, upright=True)
    low, high = (speed.factor * limits.top_speed for limits in (envelope.minus, envelope.plus))
    span = (high - low) or 1.0
    ax.set_xlim(low - (ROOM - 1.0) * span, high + (ROOM - 1.0) * span)
    largest = []
    curves = zip((*envelope.accelerating, envelope.released), ENVELOPE_COLORS, strict=True)
    for (curve, color), direction in zip(curves, (1.0, -1.0, 0.0), strict=True):
        x = speed.factor * curve.speed
        y = acceleration.factor * curve.acceleration
        if direction:  # of a full command only the acceleration in its direction is drawn
            y = direction * np.maximum(direction * y, 0.0)
            ax.fill_between(x, y, color=color, alpha=0.08, linewidth=0.0)
        largest.append(float(np.abs(y).max()))
        # the grey line of the released joystick is wider: others cover a part of it
        width, order = (LINE, 2.0) if direction else (3.0, 1.7)
        count = len(curve.by)
        starts = [0]
        starts += [index for index in range(1, count) if curve.by[index] != curve.by[index - 1]]
        for start, stop in zip(starts, [*starts[1:], count], strict=True):
            part = slice(start, stop + 1)  # with the first point of the next part
            dashes = DASHES[curve.by[start]]
            ax.plot(x[part], y[part], color=color, ls=dashes, lw=width, zorder=order)
    height = 1.3 * max(largest[:2]) or 1.0
    ax.set_ylim(-height, height)
    _mark_direction(ax, envelope.plus, envelope.largest[0], BLUE, height)
    _mark_direction(ax, envelope.minus, envelope.largest[1], VERMILION, height)


def _mark_direction(
    ax: Axes, limits: DirectionLimits, volts: float, color: str, height: float
) -> None:
    """Mark the top speed of a direction under its largest command, and its acceleration at rest."""
    speed_unit = display_unit("rad/s")
    acceleration_unit = display_unit("rad/s^2")
    speed = speed_unit.factor * limits.top_speed
    acceleration = acceleration_unit.factor * limits.acceleration
    is_positive = limits.acceleration > 0.0
    is_at_swash_stop = limits.top_speed == limits.speed_limit
    sign = "+" if is_positive else "−"
    cause = "swash stop" if is_at_swash_stop else f"at {sign}{volts:.3g} V"
    speed_text = signed(speed, 3 if abs(speed) < 10.0 else 1)
    line = "solid" if is_at_swash_stop else "dotted"
    ax.axvline(speed, color=color, linewidth=1.0, linestyle=line)
    put_text(
        ax,
        f"{cause}\n{speed_text} {speed_unit.name}",
        (speed, -0.96 * height if is_positive else 0.96 * height),
        (-4.0 if is_positive else 4.0, 0.0),
        coords="data",
        color=color,
        ha="right" if is_positive else "left",
        va="bottom" if is_positive else "top",
    )
    ax.plot([0.0], [acceleration], "o", color=color, markersize=4.5)
    acceleration_text = signed(acceleration, 2 if abs(acceleration) < 10.0 else 1)
    put_text(
        ax,
        f"{limits.accelerated_by}, at rest\n{acceleration_text} {acceleration_unit.name}",
        (0.0, acceleration),
        (5.0, 6.0) if is_positive else (-5.0, -6.0),  # on the side to which the curve does not fall
        coords="data",
        color=color,
        ha="left" if is_positive else "right",
        va="bottom" if is_positive else "top",
    )


# --- limits over time -----------------------------------------------------------------------------

BAR = 0.72
"""Height of a bar as part of its row."""


def plot_limit_timeline(
    run: Simulation, *, reference: ArrayLike | None = None, title: str | None = None
) -> Figure:
    """Figure of voltage and speed over time, and below a row for each limit that acts.

    Parameters
    ----------
    run : Simulation
        What to show.
    reference : (n,) array_like, optional
        The speed of a drive without limits, or another reference, to draw dashed. [rad/s]

    Raises
    ------
    InputError
        If the reference speed has another length than the run.
    """
    acting = [limit for limit in Limit if run.held_back(limit).any()]
    unit = display_unit("rad/s")
    requested = None if reference is None else np.asarray(reference, dtype=np.float64)
    if requested is not None and requested.shape != run.time.shape:
        raise InputError(
            f"The reference speed has shape {requested.shape}, but the run has {run.time.size} "
            "samples."
        )
    legend = [handle("speed", BLUE)]
    if requested is not None:
        legend.append(handle("without limits", GREY, "dashed"))
    heights = [1.1, 2.2, 0.27 * max(len(acting), 1)]
    labels = ("current (A)" if run.voltage is None else "voltage (V)", unit.label("speed"))
    sheet_title = run.name if title is None else title
    figure, axes = sheet(heights, sheet_title, labels, "time (s)", legend=legend)
    command, speed, rows = axes
    draw(command, run.time, run.current if run.voltage is None else run.voltage, INK)
    if requested is not None:
        draw(speed, run.time, unit.factor * requested, GREY, dashes="dashed")
    draw(speed, run.time, unit.factor * run.shaft_speed, BLUE)
    for ax in (command, speed):
        zero_line(ax)
    _bars(rows, run, acting)
    fit_time(rows, run.time)
    return figure


def _bars(ax: Axes, run: Simulation, acting: list[Limit]) -> None:
    count = len(acting)
    ax.set_ylim(max(count, 1) - 0.5, -0.5)
    ax.set_yticks(range(count), [SHADES[limit].name for limit in acting])
    ax.grid(False, axis="y")
    for row, limit in enumerate(acting):
        spans = merged_spans(stretches(run.time, run.held_back(limit)))
        ax.broken_barh(
            [(begin, end - begin) for begin, end in spans.tolist()],
            (row - 0.5 * BAR, BAR),
            facecolor=SHADES[limit].color,
            edgecolor=GREY,
            linewidth=0.4,
        )
        put_text(
            ax,
            share_cell(run.time_share(limit)).text,
            (1.0, row),
            (5.0, 0.0),
            coords=ax.get_yaxis_transform(),
            va="center",
            annotation_clip=False,
        )
    if not count:
        ax.text(0.5, 0.5, "no limit acts", transform=ax.transAxes, fontsize=SMALL, ha="center")


# --- what-ifs and bands ---------------------------------------------------------------------------

MOST_SINGLE_CHANGES = 5
"""Design variables whose single change is drawn, too; more would hide the answer."""
NO_BANDS: Mapping[str, Bands] = MappingProxyType({})


def plot_whatif(
    result: WhatIf, *, bands: Mapping[str, Bands] = NO_BANDS, title: str | None = None
) -> Figure:
    """Figure of the command, the speeds and the accelerations of a drive before and after.

    Parameters
    ----------
    result : WhatIf
        A result of `analysis.whatif.what_if`. The reference speed is drawn dotted, the speed limits
        before and after as thin lines.
    bands : mapping of str to Bands, optional
        Band of the speed by variant (``"as it is"``, ``"changed"``); an additional panel shows it
        enlarged, about its median.
    """
    single_changes = [name for name in result.variants if name not in (AS_IS, CHANGED)]
    colors = (GREEN, PURPLE, ORANGE, SKY, FAINT)
    strokes = {AS_IS: Stroke(BLUE, "solid")}
    for name, color in zip(single_changes[:MOST_SINGLE_CHANGES], colors, strict=False):
        strokes[name] = Stroke(color, "dashed")
    strokes[CHANGED] = Stroke(VERMILION, "solid")
    legend = stroke_handles(strokes)
    legend.append(handle("reference", GREY, "dotted"))
    changes = ", ".join(f"{name} x {factor:g}" for name, factor in result.factors.items())
    sheet_title = f"{result.before.drive.name}: {changes}" if title is None else title
    heights = [1.2, 2.8, 1.8, 1.3] if bands else [1.2, 2.8, 1.8]
    speed = display_unit("rad/s")
    acceleration = display_unit("rad/s^2")
    labels = ["voltage (V)", speed.label("shaft speed"), acceleration.label("acceleration")]
    labels.append(speed.label("about the median"))
    figure, axes = sheet(heights, sheet_title, labels, "time (s)", legend=legend)
    for ax in axes:
        zero_line(ax)
    time = result.before.run.time
    draw(axes[0], time, result.trial.voltage, INK, zorder=3.0)
    _draw_speed_limits(axes[1], result, strokes)
    for name, band in bands.items():
        shade_band(axes[1], band, strokes[name].color)
        shade_band(axes[3], band, strokes[name].color, about=band.median)
    draw(axes[1], time, speed.factor * result.trial.reference, GREY, dashes="dotted", zorder=1.9)
    midpoints = 0.5 * (time[1:] + time[:-1])
    for name, stroke in strokes.items():
        shaft_speed = result.variants[name].run.shaft_speed
        acceleration_of_run = acceleration.factor * np.diff(shaft_speed) * result.trial.rate
        style: dict[str, Any] = {
            "dashes": stroke.dashes,
            "zorder": 3.0 if name in (AS_IS, CHANGED) else 2.0,
        }
        draw(axes[1], time, speed.factor * shaft_speed, stroke.color, **style)
        draw(axes[2], midpoints, acceleration_of_run, stroke.color, **style)
    fit_time(axes[-1], time)
    return figure


def _draw_speed_limits(ax: Axes, result: WhatIf, strokes: Mapping[str, Stroke]) -> None:
    """Draw the speed limits of the two drives in the directions that the command has."""
    voltage = result.trial.voltage
    factor = display_unit("rad/s").factor
    for name in (AS_IS, CHANGED):
        positive, negative = result.variants[name].speed_limits
        style: dict[str, Any] = {"color": strokes[name].color, "linewidth": 0.6, "alpha": 0.5}
        if (voltage > 0.0).any():
            ax.axhline(factor * positive, **style)
        if (voltage < 0.0).any():
            ax.axhline(factor * negative, **style)


def shade_band(ax: Axes, band: Bands, color: ColorType, *, about: Array | float = 0.0) -> None:
    """Shade a band of speeds; a long one by every so many samples."""
    step = max(-(-band.time.size // (2 * COLUMNS)), 1)
    factor = display_unit("rad/s").factor
    lower, upper = (factor * (edge - about)[::step] for edge in (band.lower, band.upper))
    ax.fill_between(
        band.time[::step], lower, upper, color=color, alpha=0.25, linewidth=0.0, zorder=1.6
    )


# --- sensitivities --------------------------------------------------------------------------------

THICK = 0.72
NO_SWING = 1e-9
"""Swing up to which a design variable has no effect, as a share of the base value. [1]"""


@overload
def plot_tornado(result: OneAtATime, *, ax: None = None, title: str | None = None) -> Figure: ...


@overload
def plot_tornado(result: OneAtATime, *, ax: GivenAxes, title: str | None = None) -> GivenAxes: ...


def plot_tornado(
    result: OneAtATime,
    *,
    ax: Axes | Sequence[Axes] | None = None,
    title: str | None = None,
) -> Figure | Axes | Sequence[Axes]:
    """Figure of the effect of each design variable by itself, with a panel for each outcome.

    In a panel the variable with the strongest effect is at the top.

    Parameters
    ----------
    result : OneAtATime
        See `analysis.one_at_a_time`.
    ax : matplotlib axes or sequence of them, optional
        Where to draw, one for each outcome that is defined; by default in a new figure. The title,
        if there is one, goes only above a new figure.

    Returns
    -------
    Figure, or `ax` as it was given

    Raises
    ------
    InputError
        If no outcome is defined, or there is another number of axes.
    """
    defined = [k for k in range(len(result.outcomes)) if np.isfinite(result.base[k])]
    if not defined:
        raise InputError("None of the outcomes is defined for this command: nothing to draw.")
    lower_factors, upper_factors = zip(*result.ranges.values(), strict=True)
    legend = [
        Patch(color=BLUE, label=_factor_label("lower", lower_factors)),
        Patch(color=VERMILION, label=_factor_label("upper", upper_factors)),
    ]
    if ax is not None:
        axes = given_axes(ax, len(defined), "outcomes")
        _draw_swings(axes, result, defined)
        legend_within(axes[0], legend)
        return ax
    columns = min(len(defined), 2)
    rows = -(-len(defined) // columns)
    panel_height = 0.22 * len(result.ranges) + 0.75
    figure = new_figure(WIDTH, HEAD + ROW + rows * panel_height + 0.5 * FOOT)
    write_title(figure, "Each design variable alone" if title is None else title)
    figure.legend(handles=legend, loc="outside lower left", ncols=3, frameon=False, fontsize=SMALL)
    panels = list(figure.subplots(rows, columns, squeeze=False).flat)
    for empty in panels[len(defined) :]:
        empty.axis("off")
    _draw_swings(panels[: len(defined)], result, defined)
    return figure


def _factor_label(end: str, factors: Sequence[float]) -> str:
    """Label of the bars of all lower or upper factors: the factor, if it is the same for all."""
    return f"factor {factors[0]:g}" if len(set(factors)) == 1 else f"{end} factor"


def _draw_swings(panels: Sequence[Axes], result: OneAtATime, defined: Sequence[int]) -> None:
    """Draw the swings of the outcomes of these indices, one in each panel."""
    variables = list(result.ranges)
    for ax, k in zip(panels, defined, strict=True):
        outcome = result.outcomes[k]
        swings = np.nan_to_num(result.swings[:, k])
        order = np.argsort(swings, kind="stable")
        unit = outcome.shown_unit
        base = unit.factor * result.base[k]
        dress(ax, "", unit.label(outcome.label))
        for position, index in enumerate(order):
            for values, color in ((result.low, BLUE), (result.high, VERMILION)):
                change = unit.factor * values[index, k] - base
                if np.isfinite(change):
                    ax.barh(position, change, THICK, left=base, color=color, zorder=2.0)
        if not (swings > NO_SWING * abs(result.base[k])).any():
            half = max(abs(base), 1.0) * 0.1
            ax.set_xlim(base - half, base + half)
            remark = "no design variable changes it"
            ax.text(0.5, 0.5, remark, transform=ax.transAxes, fontsize=SMALL)
        ax.axvline(base, color=INK, linewidth=0.8, zorder=3.0)
        names = [variables[index].replace("_", " ") for index in order]
        ax.set_yticks(range(len(names)), labels=names)
        ax.set_ylim(-0.6, len(names) - 0.4)
        ax.grid(False, axis="y")
        ax.tick_params(axis="y", length=0.0, labelsize=SMALL)
        decimals = 3 if outcome.unit == "s" else 2
        panel_title = f"{outcome.label}, {base:z.{decimals}f} {unit.name}"
        ax.set_title(panel_title, loc="left", fontsize=NORMAL, color=INK)


# --- inverse map ----------------------------------------------------------------------------------

COLORS = (VERMILION, ORANGE, GREEN)
"""Of a straight line, the map, and the map with a lead."""
CLOSE_UP = 0.06
"""The panel on the right shows speeds up to this part of the smaller limit, or twice the gap."""
POINTS = 2001
MAP, RUNS = 2.9, 1.7
"""Heights. [inch]"""


@overload
def plot_compensation(
    inverse: InverseMap,
    improvement: Improvement | None = None,
    *,
    ax: None = None,
    title: str | None = None,
) -> Figure: ...


@overload
def plot_compensation(
    inverse: InverseMap, *, ax: GivenAxes, title: str | None = None
) -> GivenAxes: ...


def plot_compensation(
    inverse: InverseMap,
    improvement: Improvement | None = None,
    *,
    ax: Axes | Sequence[Axes] | None = None,
    title: str | None = None,
) -> Figure | Axes | Sequence[Axes]:
    """Figure of the voltage over the reference speed, with a close-up at standstill.

    Parameters
    ----------
    inverse : InverseMap
        The map.
    improvement : Improvement, optional
        Runs to show below: the speeds and their errors; a figure of its own is needed.
    ax : matplotlib axes or two of them, optional
        Where to draw the map, in the second one its close-up; by default in a new figure.

    Returns
    -------
    Figure, or `ax` as it was given

    Raises
    ------
    InputError
        For more than two axes, or for axes and runs.
    """
    legend = [handle("inverse map", INK), handle("straight line", GREY, "dashed")]
    if ax is not None:
        if improvement is not None:
            raise InputError("The runs of an improvement need a separate figure: leave out ax.")
        axes = given_axes(ax, min(max(np.size(np.asarray(ax, dtype=object)), 1), 2), "panels")
        _draw_map(inverse, axes[0], axes[1] if len(axes) > 1 else None)
        legend_within(axes[0], legend)
        if title:
            axes[0].set_title(title, loc="left", fontsize=NORMAL, color=INK)
        return ax
    heights = [MAP] if improvement is None else [MAP, RUNS, RUNS]
    figure = new_figure(WIDTH, HEAD + ROW + sum(heights) + 2.0 * FOOT)
    proportions = {"width_ratios": (1.5, 1.0), "height_ratios": heights}
    grid = figure.add_gridspec(len(heights), 2, **proportions)
    full_range, close_up = (figure.add_subplot(grid[0, column]) for column in (0, 1))
    _draw_map(inverse, full_range, close_up)
    if improvement is not None:
        pairs = zip(improvement.runs, COLORS, strict=True)
        legend = [handle("map, reference speed", INK)]
        legend += [handle(f"with {name}", color) for name, color in pairs]
        speed = figure.add_subplot(grid[1, :])
        error = figure.add_subplot(grid[2, :], sharex=speed)
        _draw_improvement(speed, error, improvement)
        figure.align_ylabels([full_range, speed, error])
    default_title = f"{inverse.name}: voltage for a reference speed"
    write_title(figure, default_title if title is None else title)
    put_legend(full_range, legend, beyond=True)
    full_range.set_title(" ", fontsize=NORMAL, pad=8.0)
    return figure


def _draw_map(inverse: InverseMap, full_range: Axes, close_up: Axes | None = None) -> None:
    unit = display_unit("rad/s")
    low, high = inverse.limits
    narrow = max(CLOSE_UP * min(-low, high), 2.0 * max(map(abs, inverse.gap)))
    panels = [(full_range, (low, high))]
    if close_up is not None:
        panels.append((close_up, (max(low, -narrow), min(high, narrow))))
    for ax, (first, last) in panels:
        even = np.linspace(first, last, POINTS)
        speed = np.union1d(even, np.clip(inverse.gap, first, last))
        straight = proportional_command(inverse, speed)
        across = unit.factor * speed
        ax.plot(across, straight, color=GREY, linestyle="dashed", linewidth=1.0)
        ax.plot(across, inverse.voltage(speed), color=INK, linewidth=LINE)
        dress(ax, "", unit.label("reference speed"))
        zero_line(ax, upright=True)
    volts = [float(inverse.voltage(end)) for end in (low, high)]
    full_range.set_ylim(1.25 * volts[0], 1.25 * volts[1])  # room for the words there
    full_range.set_ylabel("voltage (V)", fontsize=NORMAL, color=INK)
    for end, height, side, shift in zip(
        (low, high), volts, ("left", "right"), (-10.0, 10.0), strict=True
    ):
        point = (unit.factor * end, height)
        full_range.plot([point[0]], [point[1]], "o", color=INK, markersize=4.5)
        text = f"{point[0]:.4g} {unit.name}, {height:.3g} V".replace("-", "−")
        put_text(full_range, text, point, (0.0, shift), coords="data", ha=side, va="center")
    if close_up is None:
        return
    below, above = (unit.factor * edge for edge in inverse.gap)
    close_up.axvspan(below, above, color="#ededed", linewidth=0.0, zorder=0.5)
    put_text(
        close_up,
        "cannot be held",
        (0.5 * (below + above), 0.0),
        (0.0, 4.0),
        coords=close_up.get_xaxis_transform(),
        color=GREY,
        ha="center",
    )
    put_text(close_up, "close-up around standstill", (0.0, 1.0), (4.0, -10.0), color=GREY)


def _draw_improvement(speed: Axes, error: Axes, improvement: Improvement) -> None:
    unit = display_unit("rad/s")
    runs = list(improvement.runs.values())
    time = runs[0].time
    dress(speed, unit.label("speed"))
    dress(error, unit.label("error"), "time (s)")
    for ax in (speed, error):
        zero_line(ax)
    for run, color in zip(runs, COLORS, strict=True):
        done = run.shaft_speed
        draw(speed, time, unit.factor * done, color)
        draw(error, time, unit.factor * (done - improvement.reference), color)
    draw(speed, time, unit.factor * improvement.reference, INK, width=1.0, zorder=3.0)
    fit_time(error, time)
    speed.tick_params(labelbottom=False)
