"""Figures of measured tests: a campaign, a long log, a channel closely, one against a model."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from swashplate.errors import InputError
from swashplate.identification import with_speeds
from swashplate.report.lines import (
    COARSE,
    GAP_MARK,
    IGNORED,
    Array,
    Mask,
    Shade,
    draw,
    gap_rows,
    mark_gaps,
    merged_spans,
    rows_within,
    shade,
    shade_handle,
    stretches,
)
from swashplate.report.style import (
    BLUE,
    FOOT,
    HEAD,
    INK,
    LINE,
    ORANGE,
    ROW,
    SMALL,
    THIN,
    VERMILION,
    WIDTH,
    dress,
    handle,
    in_lines,
    label_below,
    new_figure,
    right_axis,
    sheet,
    write_title,
    write_words,
    zero_line,
)
from swashplate.units import DisplayUnit, display_unit

if TYPE_CHECKING:
    from swashplate.campaign import BlockRanges, Channel, Experiment, InputSignal, Overview
    from swashplate.identification import RunQuality

# --- pages of a campaign --------------------------------------------------------------------------

RUNS = 8
"""Runs on a page: with more, panels are too low to read or the page too high to print."""
NARROWEST, BETWEEN = 2.2, 0.55
PANEL, ABOVE = 0.86, 0.5
"""Widths of a panel and of a gap; heights of a panel, and of a run's heading and ticks. [inch]"""
WEIGHTED, WEIGHTS = "#e3b5cf", 0.16
"""Colour of the weights at a panel's foot, and the part of its height that the largest takes."""
_ROOM = 0.08
"""Empty share of a panel above and below its signal."""
_NEAR_ZERO = 0.02
"""A record that begins at less than this share of its length is shown from zero on."""
_ROLES = {"fit": "for the fit", "validate": "for validation"}


class PanelColumn(NamedTuple):
    """Channel of a column of panels, by name and unit; the input has no name."""

    key: tuple[str, str]
    words: str
    """What it shows, with the unit."""
    unit: DisplayUnit
    low: float
    high: float
    """Lowest and highest value of all runs, in the displayed unit. Of a position, whose zero is
    free, half the largest travel of a run, down and up: each run has its own middle."""
    free: bool
    """Whether it is a position."""


def _signals(experiment: Experiment) -> dict[tuple[str, str], InputSignal | Channel]:
    """The input, whose name is empty, and the channels, by name and unit."""
    channels = {
        (name, channel.shown_unit): channel for name, channel in experiment.channels.items()
    }
    return {("", experiment.input.unit): experiment.input, **channels}


def _scale_rows(used: Mask) -> Mask:
    """Mark the samples that set the scale of a panel: those used, or all if none is."""
    return used if used.any() else np.ones_like(used)


def _counted(signal: InputSignal | Channel) -> Array:
    """Samples that are not ignored; all of them of an input, or where none is left."""
    used = getattr(signal, "used", None)
    return signal.values if used is None else signal.values[_scale_rows(used)]


def _column(key: tuple[str, str], signals: Sequence[InputSignal | Channel]) -> PanelColumn:
    """Column of the signals of one name and unit of all runs, with their common scale."""
    # what is ignored may leave the panel: one spike would flatten all runs
    shown = [_counted(signal) for signal in signals]
    low = min(float(samples.min()) for samples in shown)
    high = max(float(samples.max()) for samples in shown)
    kind = signals[0].kind
    _, si = key
    unit = display_unit(si, max(abs(low), abs(high)))
    free = kind in ("position", "encoder_counts")
    if free:
        high = 0.5 * max(float(np.ptp(samples)) for samples in shown)
        low = -high
    words = {"encoder_counts": "encoder's angle", "other": signals[0].source.column}
    label = unit.label(words.get(kind, kind.replace("_", " ")))
    return PanelColumn(key, label, unit, unit.factor * low, unit.factor * high, free)


def plot_campaign(experiments: Iterable[Experiment], *, title: str | None = None) -> list[Figure]:
    """Figures of everything that was measured: a page for each axis and eight of its runs.

    A row is a run: over it its name, maneuver, role, rate and gaps; its input and channels side by
    side. A column has one unit and one scale; positions, whose zero is free, have it about the
    middle of each run. What is ignored is shaded and hatched, weights that differ stand along the
    foot, samples at the end of their instrument's range are barred, gaps in the
    stamps leave the line open and are pointed at.

    Parameters
    ----------
    experiments : iterable of Experiment
        Of one axis or more, in the order of their rows.
    title : str, optional
        The campaign's; the axis and the page are added.

    Returns
    -------
    list of Figure
        Page after page, axis after axis.

    Raises
    ------
    InputError
        If there is no experiment.

    Notes
    -----
    A line of more than 2000 samples is drawn by the lowest and the highest sample in each of 1000
    stretches of time (`lines.thinned`), and as a line also in SVG and PDF.
    """
    axes: dict[str, list[Experiment]] = {}
    for experiment in experiments:
        axes.setdefault(experiment.axis, []).append(experiment)
    if not axes:
        raise InputError("A page of a campaign needs at least one experiment.")
    figures = []
    for axis, of_axis in axes.items():
        signals_of: dict[tuple[str, str], list[InputSignal | Channel]] = {}
        for run in of_axis:
            for key, signal in _signals(run).items():
                signals_of.setdefault(key, []).append(signal)
        columns = [
            _column(key, signals_of[key])
            for key in sorted(signals_of, key=lambda key: key[0] != "")
        ]
        pages = [of_axis[first : first + RUNS] for first in range(0, len(of_axis), RUNS)]
        for number, page in enumerate(pages, start=1):
            words = f"{title or 'Measured tests'}: {axis}"
            if len(pages) > 1:
                words += f", page {number} of {len(pages)}"
            figures.append(_page_figure(page, columns, words))
    return figures


def _page_figure(
    experiments: Sequence[Experiment], columns: Sequence[PanelColumn], title: str
) -> Figure:
    """Figure of a page: a row for each run, its signals side by side."""
    rows = len(experiments)
    across = len(columns)
    width = max(WIDTH, across * (NARROWEST + BETWEEN))
    room = width / across - 1.3 * BETWEEN
    figure = new_figure(width, HEAD + 2.0 * ROW + rows * (PANEL + ABOVE) + FOOT)
    grid = figure.subplots(rows, across, sharex="row", squeeze=False)
    for number, (row, experiment) in enumerate(zip(grid, experiments, strict=True)):
        signals = _signals(experiment)
        first = min(float(signal.time[0]) for signal in signals.values())
        last = max(float(signal.time[-1]) for signal in signals.values())
        if 0.0 < first < _NEAR_ZERO * (last - first):
            first = 0.0
        row[0].set_xlim(first, last if last > first else first + 1.0)
        for ax, column in zip(row, columns, strict=True):
            dress(ax)
            ax.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
            ax.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
            if column.key in signals:
                _draw_signal(ax, column, signals[column.key], experiment)
            else:
                ax.set_yticks([])
                write_words(ax, "not measured", (0.5, 0.5), (0.0, 0.0), ha="center", va="center")
            # room for the heading, and in the first row for the columns' names
            words = " "
            pad = 6.0
            if number == 0:
                name = shorten(column.key[0] or "input", room / 0.085)
                words = f"{name}\n{shorten(column.words, room / 0.066)}"
                pad = 20.0
            ax.set_title(words, loc="left", fontsize=SMALL, color=INK, pad=pad)
        _heading(row[0], experiment)
    for ax in grid[-1]:
        label_below(ax, "time (s)")
    write_title(figure, title)
    _put_page_legend(figure, grid, experiments)
    return figure


def _put_page_legend(figure: Figure, grid: Any, experiments: Sequence[Experiment]) -> None:
    """Explain below a page the marks that are drawn in one of its panels."""
    reasons = list[str]()
    for experiment in experiments:
        for _, _, reason in experiment.ignored:
            if reason and reason not in reasons:
                reasons.append(reason)
    why = "; ".join(reasons)
    handles: dict[str, Patch | Line2D] = {
        "ignored": shade_handle(IGNORED, f"ignored: {why}" if 0 < len(why) <= 60 else ""),
        "weight": Patch(facecolor=WEIGHTED, label="weight, relative to the largest"),
        "clipped": Patch(facecolor=ORANGE, label="at the end of the instrument's range"),
        GAP_MARK["label"]: Line2D([], [], **GAP_MARK),
    }
    labels = set()
    for ax in grid.flat:
        for artist in (*ax.collections, *ax.lines, *ax.patches):
            labels.add(artist.get_label())
    if shown := [handle for key, handle in handles.items() if key in labels]:
        style = {"frameon": False, "fontsize": SMALL, "ncols": 2}
        figure.legend(handles=shown, loc="outside lower left", **style)


def shorten(words: str, letters: float) -> str:
    """Words cut to so many letters."""
    return words if len(words) <= letters else f"{words[: int(letters) - 1]}…"


def _draw_signal(
    ax: Axes, column: PanelColumn, signal: InputSignal | Channel, experiment: Experiment
) -> None:
    """Draw a signal, with marks where it is ignored, weighted, clipped or missing."""
    time = signal.time
    factor = column.unit.factor
    values = factor * signal.values
    counted = factor * _counted(signal)
    zero_line(ax)
    middle = 0.5 * float(counted.min() + counted.max()) if column.free else 0.0
    margin = _ROOM * (column.high - column.low) or 1.0
    ax.set_ylim(middle + column.low - margin, middle + column.high + margin)
    # the input has no weights, and a channel nothing that is held between its samples
    weight = getattr(signal, "weight", None)
    is_zero_order = getattr(signal, "interpolation", "") == "previous"
    if weight is None:
        windows = np.array(sorted(window[:2] for window in experiment.ignored)).reshape(-1, 2)
        inside = np.clip(windows, time[0], time[-1])
        shade(ax, inside[inside[:, 0] < inside[:, 1]], IGNORED)
    else:
        shade(ax, stretches(time, weight == 0.0), IGNORED)
        used = weight[weight > 0.0]
        if used.size and used.max() > used.min():
            turns = np.flatnonzero(np.diff(weight)) + 1
            rows = np.unique(np.r_[0, turns - 1, turns, weight.size - 1])
            foot: dict[str, Any] = {"transform": ax.get_xaxis_transform(), "label": "weight"}
            height = WEIGHTS * weight[rows] / float(weight.max())
            ax.fill_between(time[rows], height, color=WEIGHTED, linewidth=0.0, zorder=1.0, **foot)
    if signal.limits is not None:
        ends = np.array(signal.limits)
        # what a conversion of units rounds away is no distance from the end
        near = np.abs(signal.values - ends[:, None]) <= 1e-9 * (ends[1] - ends[0])
        beyond = np.stack((signal.values < ends[0], signal.values > ends[1]))
        for level, side in zip(factor * ends, near | beyond, strict=True):
            first, last = merged_spans(stretches(time, side)).T
            if first.size:
                bar: dict[str, Any] = {"color": ORANGE, "linewidth": 4.0, "label": "clipped"}
                level = np.full(first.size, level)
                ax.hlines(level, first, last, zorder=1.9, capstyle="projecting", **bar)
    mark_gaps(ax, time)
    color = INK if weight is None else BLUE
    draw(ax, time, values, color, zero_order=is_zero_order, width=THIN, columns=COARSE)


def _heading(ax: Axes, experiment: Experiment) -> None:
    """Name of a run in bold, and what else there is to say of it, above its first panel."""
    words = [experiment.maneuver, _ROLES[experiment.role], *_stamps_in_words(experiment)]
    style: dict[str, Any] = {"fontsize": SMALL, "color": INK, "textcoords": "offset points"}
    # they may reach over the panels on their right
    style |= {"annotation_clip": False, "in_layout": False}
    run = ax.annotate(
        experiment.run, (0.0, 1.0), (0.0, 6.0), "axes fraction", weight="bold", **style
    )
    ax.annotate("  ·  ".join(words), (1.0, 1.0), (7.0, 6.0), (run, "axes fraction"), **style)


def _stamps_in_words(experiment: Experiment) -> list[str]:
    """The rates, from the lowest to the highest, and the gaps of the signal that has most."""
    stamps = [signal.time for signal in _signals(experiment).values()]
    rates = [1.0 / float(np.median(np.diff(time))) for time in stamps]
    ends = [f"{r:.0f}" if r >= 100.0 else f"{r:.3g}" for r in (min(rates), max(rates))]
    # stamps that jitter do not have quite the same rate
    alike = max(rates) < 1.01 * min(rates)
    words = [f"{ends[0]} Hz" if alike else f"{ends[0]} to {ends[1]} Hz"]
    gaps = max((np.diff(time)[gap_rows(time)] for time in stamps), key=np.size)
    if gaps.size:
        longest = f"{float(gaps.max()):.3g} s"
        words.append(
            f"a gap of {longest}" if gaps.size == 1 else f"{gaps.size} gaps, longest {longest}"
        )
    return words


# --- a long log as a whole ------------------------------------------------------------------------

STRETCHES = 4000
"""Stretches of a log of which the extremes are drawn: more than a sheet has dots."""
LABELLED = 16
"""Letters in a line of a panel's label."""
USED = Shade("#b5e0cb", "window that is used")
LEFT_OUT = Shade("#f3f3f3", "window with motion that is left out", "#dadada", "////")


def plot_overview(overview: Overview, *, title: str | None = None) -> Figure:
    """Figure of a whole long log, with its windows: a panel for the input and each channel.

    A signal is drawn from its lowest to its highest sample in each short stretch of time, as
    recorded: a counter that wraps does so here.

    Parameters
    ----------
    overview : Overview
        Of the log, as of ``Campaign.overviews``.
    title : str, optional
        By default the run's name.
    """
    several = len({signal.axis for signal in overview.signals}) > 1
    largest = [_largest(signal) for signal in overview.signals]
    units = [
        display_unit(signal.shown_unit, size)
        for signal, size in zip(overview.signals, largest, strict=True)
    ]
    labels = [
        in_lines(unit.label(f"{signal.axis} {signal.name}" if several else signal.name), LABELLED)
        for signal, unit in zip(overview.signals, units, strict=True)
    ]
    used = np.array([(w.begin, w.end) for w in overview.windows if w.used]).reshape(-1, 2)
    left_out = np.array([(w.begin, w.end) for w in overview.windows if not w.used]).reshape(-1, 2)
    shades = [(used, USED), (left_out, LEFT_OUT)]
    legend = [shade_handle(look) for spans, look in shades if spans.size]
    heights = [1.3] * len(overview.signals)
    words = f"{overview.run}, the whole log" if title is None else title
    figure, axes = sheet(heights, words, labels, "time (s)", legend=legend)
    for ax, ranges, unit in zip(axes, overview.signals, units, strict=True):
        zero_line(ax)
        for spans, look in shades:
            shade(ax, spans, look)
        color = INK if ranges.name == "input" else BLUE
        _draw_ranges(ax, ranges, unit.factor, color)
        mark_gaps(ax, ranges.time)
    axes[-1].set_xlim(overview.begin, overview.end)
    return figure


def _largest(ranges: BlockRanges) -> float:
    """Largest size of a signal, 0 if it has no number. [unit]"""
    finite = np.isfinite(ranges.low)
    ends = np.concatenate((ranges.low[finite], ranges.high[finite]))
    return float(np.abs(ends).max(initial=0.0))


def _draw_ranges(ax: Axes, ranges: BlockRanges, factor: float, color: str) -> None:
    """Draw a signal between its extremes, open where it has none and over gaps of the stamps."""
    first = np.arange(0, ranges.time.size, -(-ranges.time.size // STRETCHES))
    time = ranges.time[first]
    low = np.fmin.reduceat(ranges.low, first)
    high = np.fmax.reduceat(ranges.high, first)
    breaks = gap_rows(time)
    time, low, high = (
        np.insert(values, breaks + 1, filling)
        for values, filling in ((time, time[breaks]), (low, np.nan), (high, np.nan))
    )
    # its edge shows a signal that stays as it is, whose area is nothing
    ax.fill_between(
        time,
        factor * low,
        factor * high,
        facecolor=color,
        edgecolor=color,
        linewidth=0.6 * THIN,
        zorder=2.0,
    )


# --- one channel closely --------------------------------------------------------------------------

ROUGH = "#d2d2d2"
"""Colour of the difference of neighbours, which fills its panel if the count changes often."""


def plot_channel(
    channel: Channel,
    simulated: Array | None = None,
    *,
    window: tuple[float, float] | None = None,
    title: str | None = None,
) -> Figure:
    """Figure of one measured channel: its samples, and below what a glitch shows in best.

    Parameters
    ----------
    channel : Channel
        Any. Below a position, a staircase of its samples, stands its speed: the difference of
        neighbours, and Kruse's filters in their form for any rate, which set the scale.
    simulated : (n,) array, optional
        What a drive predicts for each sample, SI. It is drawn over the samples; below any other
        channel than a position stands measured less simulated, on the scale of what counts.
    window : (float, float), optional
        First and last instant to show [s]. Everything is computed from the whole record.

    Raises
    ------
    InputError
        If the window holds fewer than two samples.
    """
    rows = rows_within(channel.time, window, str(channel.source))
    time = channel.time[rows]
    values = channel.values[rows]
    used = channel.used[rows]
    legend = [handle("measured", INK if channel.is_position else BLUE, width=THIN)]
    if simulated is not None:
        legend.append(handle("simulated", VERMILION))
    lower: list[tuple[Array, Array, str, float]] = []
    if channel.is_position:
        from swashplate.campaign import speed_of

        speeds = [(speed_of(channel, "difference"), ROUGH), (speed_of(channel, "exact"), BLUE)]
        for speed, color in speeds:
            within = (speed.time >= time[0]) & (speed.time <= time[-1])
            lower.append((speed.time[within], speed.speed[within], color, LINE))
        late = 1e3 * speeds[1][0].delay
        legend.append(handle("speed: difference of neighbours", ROUGH))
        legend.append(handle(f"speed: 10 and 30 Hz filters, {late:.1f} ms late", BLUE))
        below = "speed"
        si = f"{channel.unit}/s"
    elif simulated is not None:
        lower.append((time, values - simulated[rows], INK, THIN))
        below = "measured less simulated"
        si = channel.unit
    unit = display_unit(channel.shown_unit, float(np.abs(values).max()))
    labels = [unit.label(channel.kind.replace("_", " ").replace("encoder counts", "angle"))]
    if lower:
        scale = lower[-1][1] if channel.is_position else lower[-1][1][_scale_rows(used)]
        small = display_unit(si, float(np.abs(scale).max()))
        labels.append(small.label(below))
    heights = [2.4, 2.2] if lower else [3.2]
    words = channel.name if title is None else title
    figure, axes = sheet(heights, words, labels, "time (s)", legend=legend)
    style: dict[str, Any] = {"zero_order": channel.is_position, "width": THIN, "zorder": 2.5}
    counted = values[_scale_rows(used)]
    room = 0.12 * float(np.ptp(counted)) or 1.0 / unit.factor
    axes[0].set_ylim(unit.factor * (counted.min() - room), unit.factor * (counted.max() + room))
    draw(axes[0], time, unit.factor * values, INK if channel.is_position else BLUE, **style)
    if simulated is not None:
        draw(axes[0], time, unit.factor * simulated[rows], VERMILION, zorder=3.0)
    if channel.encoder is not None:
        counts = right_axis(
            axes[0], 1.0 / (unit.factor * channel.encoder.angle_per_count), "counts"
        )
        counts.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10], integer=True))
    if lower:
        room = 0.12 * float(np.ptp(scale)) or 1.0 / small.factor
        axes[1].set_ylim(small.factor * (scale.min() - room), small.factor * (scale.max() + room))
        zero_line(axes[1])
        for when, what, color, width in lower:
            draw(axes[1], when, small.factor * what, color, width=width)
    _mark_samples(axes, time, used)
    return figure


def _mark_samples(axes: Sequence[Axes], time: Array, used: Mask) -> None:
    """Mark what is ignored of a record and its gaps in panels over it, from end to end."""
    for ax in axes:
        shade(ax, stretches(time, ~used), IGNORED)
        mark_gaps(ax, time)
    axes[-1].set_xlim(float(time[0]), float(time[-1]))


# --- one channel against a model ------------------------------------------------------------------

WIDE, NARROW = 2.2, 1.3
"""Widths of measured and simulated lines, which lie on one another for long. [pt]"""


def plot_prediction(
    quality: RunQuality,
    *,
    window: tuple[float, float] | None = None,
    title: str | None = None,
) -> Figure:
    """Figure of one channel of a run, measured and simulated, and of the residual it is judged by.

    Parameters
    ----------
    quality : RunQuality
        The channel. Below a position stands the speed, by which it is judged: measured and
        simulated positions go through the same filters. The lowest panel is the residual, simulated
        less measured, of that speed; of a position from which no speed can be computed, and of any
        other channel, its own.
    window : (float, float), optional
        First and last instant to show [s]. Everything is computed from the whole record.

    Raises
    ------
    InputError
        If the window holds fewer than two samples.
    """
    signals = with_speeds((quality,))
    channel = quality.experiment[quality.channel]
    rows = rows_within(channel.time, window, str(channel.source))
    time = channel.time[rows]
    used = channel.used[rows]
    counted = _scale_rows(used)
    panels = [_overlay(signal, rows) for signal in signals]
    judged = signals[-1]
    residual = judged.residual[rows]
    panels.append(Overlay("residual", judged.experiment[judged.channel].unit, [(residual, INK)]))
    largest = [max(float(np.abs(v[counted]).max()) for v, _ in panel.curves) for panel in panels]
    pairs = zip(panels, largest, strict=True)
    units = [display_unit(panel.unit, size or 1.0) for panel, size in pairs]
    labels = [unit.label(panel.words) for panel, unit in zip(panels, units, strict=True)]
    legend = [handle("measured", BLUE, width=WIDE), handle("simulated", VERMILION, width=NARROW)]
    words = f"{quality.experiment.name}, {channel.name}" if title is None else title
    heights = [2.2] * len(signals) + [1.5]
    figure, axes = sheet(heights, words, labels, "time (s)", legend=legend)
    for ax, panel, unit in zip(axes, panels, units, strict=True):
        shown = [unit.factor * values[counted] for values, _ in panel.curves]
        low = min(float(curve.min()) for curve in shown)
        high = max(float(curve.max()) for curve in shown)
        room = 0.1 * (high - low) or 1.0
        ax.set_ylim(low - room, high + room)
        zero_line(ax)
        for values, color in panel.curves:
            width = WIDE if color == BLUE else NARROW
            draw(ax, time, unit.factor * values, color, width=width)
    _mark_samples(axes, time, used)
    return figure


class Overlay(NamedTuple):
    """Curves of one panel, SI, each with its colour."""

    words: str
    unit: str
    curves: list[tuple[Array, str]]


def _overlay(quality: RunQuality, rows: slice) -> Overlay:
    """Measured curve of a channel, and the simulated one on top of it."""
    channel = quality.experiment[quality.channel]
    words = channel.kind.replace("_", " ").replace("encoder counts", "angle")
    curves = [(channel.values[rows], BLUE), (quality.simulated[rows], VERMILION)]
    return Overlay(channel.name if channel.kind == "other" else words, channel.shown_unit, curves)
