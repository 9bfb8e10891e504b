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
    put_text,
    right_axis,
    sheet,
    write_title,
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
    label: str
    """Label of its axis, with the unit."""
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


def _scale_values(signal: InputSignal | Channel) -> Array:
    """Samples that set the scale of a panel; all of them of an input."""
    used = getattr(signal, "used", None)
    return signal.values if used is None else signal.values[_scale_rows(used)]


OF_LOADS = ("swing_angle", "hook_position")
"""Kinds of channel of which an axis has several, told apart by their names."""


def _column(key: tuple[str, str], signals: Sequence[InputSignal | Channel]) -> PanelColumn:
    """Column of the signals of one name and unit of all runs, with their common scale."""
    # ignored samples may leave the panel: one spike would flatten all runs
    values_of_runs = [_scale_values(signal) for signal in signals]
    low = min(float(values.min()) for values in values_of_runs)
    high = max(float(values.max()) for values in values_of_runs)
    kind = signals[0].kind
    name, si = key
    unit = display_unit(si, max(abs(low), abs(high)))
    free = kind in ("position", "encoder_counts")
    if free:
        high = 0.5 * max(float(np.ptp(values)) for values in values_of_runs)
        low = -high
    special_names = {"encoder_counts": "encoder's angle", "other": signals[0].source.column}
    special_names |= dict.fromkeys(OF_LOADS, name)
    label = unit.label(special_names.get(kind, kind.replace("_", " ")))
    return PanelColumn(key, label, unit, unit.factor * low, unit.factor * high, free)


def plot_campaign(experiments: Iterable[Experiment], *, title: str | None = None) -> list[Figure]:
    """Figures of all measured signals, with a page for each axis and eight of its runs.

    A row is a run, with its input and channels side by side, and its name, maneuver, role, rate and
    gaps above. A column has one unit and one scale; for positions, whose zero is free, the scale is
    about the middle of each run. Ignored samples are shaded and hatched, weights that differ are
    drawn along the foot, samples at the end of their instrument's range have a bar, gaps in the
    time stamps leave the line open and have an arrow.

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
            page_title = f"{title or 'Measured tests'}: {axis}"
            if len(pages) > 1:
                page_title += f", page {number} of {len(pages)}"
            figures.append(_page_figure(page, columns, page_title))
    return figures


def _page_figure(
    experiments: Sequence[Experiment], columns: Sequence[PanelColumn], title: str
) -> Figure:
    """Figure of a page: a row for each run, its signals side by side."""
    rows = len(experiments)
    column_count = len(columns)
    width = max(WIDTH, column_count * (NARROWEST + BETWEEN))
    column_width = width / column_count - 1.3 * BETWEEN
    figure = new_figure(width, HEAD + 2.0 * ROW + rows * (PANEL + ABOVE) + FOOT)
    grid = figure.subplots(rows, column_count, sharex="row", squeeze=False)
    for number, (row, experiment) in enumerate(zip(grid, experiments, strict=True)):
        signals = _signals(experiment)
        begin = min(float(signal.time[0]) for signal in signals.values())
        end = max(float(signal.time[-1]) for signal in signals.values())
        if 0.0 < begin < _NEAR_ZERO * (end - begin):
            begin = 0.0
        row[0].set_xlim(begin, end if end > begin else begin + 1.0)
        for ax, column in zip(row, columns, strict=True):
            dress(ax)
            ax.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
            ax.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
            if column.key in signals:
                _draw_signal(ax, column, signals[column.key], experiment)
            else:
                ax.set_yticks([])
                put_text(ax, "not measured", (0.5, 0.5), (0.0, 0.0), ha="center", va="center")
            # space for the heading, and in the first row for the columns' names
            column_title = " "
            pad = 6.0
            if number == 0:
                name = shorten(column.key[0] or "input", column_width / 0.085)
                column_title = f"{name}\n{shorten(column.label, column_width / 0.066)}"
                pad = 20.0
            ax.set_title(column_title, loc="left", fontsize=SMALL, color=INK, pad=pad)
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
    all_reasons = "; ".join(reasons)
    ignored_label = f"ignored: {all_reasons}" if 0 < len(all_reasons) <= 60 else ""
    handles: dict[str, Patch | Line2D] = {
        "ignored": shade_handle(IGNORED, ignored_label),
        "weight": Patch(facecolor=WEIGHTED, label="weight, relative to the largest"),
        "clipped": Patch(facecolor=ORANGE, label="at the end of the instrument's range"),
        GAP_MARK["label"]: Line2D([], [], **GAP_MARK),
    }
    labels = set()
    for ax in grid.flat:
        for artist in (*ax.collections, *ax.lines, *ax.patches):
            labels.add(artist.get_label())
    present = [handle for key, handle in handles.items() if key in labels]
    if present:
        style = {"frameon": False, "fontsize": SMALL, "ncols": 2}
        figure.legend(handles=present, loc="outside lower left", **style)


def shorten(text: str, letters: float) -> str:
    """Cut a text to a number of letters."""
    return text if len(text) <= letters else f"{text[: int(letters) - 1]}…"


def _draw_signal(
    ax: Axes, column: PanelColumn, signal: InputSignal | Channel, experiment: Experiment
) -> None:
    """Draw a signal, with marks for ignored, weighted, clipped and missing samples."""
    time = signal.time
    factor = column.unit.factor
    values = factor * signal.values
    scale_values = factor * _scale_values(signal)
    zero_line(ax)
    middle = 0.0
    if column.free:
        middle = 0.5 * float(scale_values.min() + scale_values.max())
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
        positive = weight[weight > 0.0]
        if positive.size and positive.max() > positive.min():
            turns = np.flatnonzero(np.diff(weight)) + 1
            rows = np.unique(np.r_[0, turns - 1, turns, weight.size - 1])
            foot: dict[str, Any] = {"transform": ax.get_xaxis_transform(), "label": "weight"}
            height = WEIGHTS * weight[rows] / float(weight.max())
            ax.fill_between(time[rows], height, color=WEIGHTED, linewidth=0.0, zorder=1.0, **foot)
    if signal.limits is not None:
        ends = np.array(signal.limits)
        # a value that differs from the end by the rounding of a conversion is at the end
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
    """Write the name of a run in bold, its maneuver, role, rates and gaps above its first panel."""
    properties = [experiment.maneuver, _ROLES[experiment.role], *_rates_and_gaps(experiment)]
    style: dict[str, Any] = {"fontsize": SMALL, "color": INK, "textcoords": "offset points"}
    # they may reach over the panels on their right
    style |= {"annotation_clip": False, "in_layout": False}
    run = ax.annotate(
        experiment.run, (0.0, 1.0), (0.0, 6.0), "axes fraction", weight="bold", **style
    )
    line = "  ·  ".join(properties)
    ax.annotate(line, (1.0, 1.0), (7.0, 6.0), (run, "axes fraction"), **style)


def _rates_and_gaps(experiment: Experiment) -> list[str]:
    """Lowest and highest rate of a run's signals, and the gaps of the signal that has most."""
    stamps = [signal.time for signal in _signals(experiment).values()]
    rates = [1.0 / float(np.median(np.diff(time))) for time in stamps]
    ends = [f"{r:.0f}" if r >= 100.0 else f"{r:.3g}" for r in (min(rates), max(rates))]
    # stamps that jitter do not have quite the same rate
    alike = max(rates) < 1.01 * min(rates)
    texts = [f"{ends[0]} Hz" if alike else f"{ends[0]} to {ends[1]} Hz"]
    gaps = max((np.diff(time)[gap_rows(time)] for time in stamps), key=np.size)
    if gaps.size:
        longest = f"{float(gaps.max()):.3g} s"
        texts.append(
            f"a gap of {longest}" if gaps.size == 1 else f"{gaps.size} gaps, longest {longest}"
        )
    return texts


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
    used = [(window.begin, window.end) for window in overview.windows if window.used]
    left_out = [(window.begin, window.end) for window in overview.windows if not window.used]
    shaded_windows = [
        (np.array(used).reshape(-1, 2), USED),
        (np.array(left_out).reshape(-1, 2), LEFT_OUT),
    ]
    legend = [shade_handle(window_shade) for spans, window_shade in shaded_windows if spans.size]
    heights = [1.3] * len(overview.signals)
    sheet_title = f"{overview.run}, the whole log" if title is None else title
    figure, axes = sheet(heights, sheet_title, labels, "time (s)", legend=legend)
    for ax, ranges, unit in zip(axes, overview.signals, units, strict=True):
        zero_line(ax)
        for spans, window_shade in shaded_windows:
            shade(ax, spans, window_shade)
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
    """Draw a signal between its extremes, open over missing numbers and gaps of the stamps."""
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
    """Figure of the samples of one measured channel, with a lower panel that shows glitches best.

    Parameters
    ----------
    channel : Channel
        A position is drawn as a staircase. The lower panel has its speed, by the difference of
        neighbouring samples and by Kruse's filters in their form for any rate; the filtered speed
        sets the scale.
    simulated : (n,) array, optional
        Prediction of a drive for each sample, SI. It is drawn over the samples. Of a channel other
        than a position, the lower panel has measured less simulated; the samples that are not
        ignored set its scale.
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
    lower = None
    if channel.is_position:
        lower = _speed_panel(channel, float(time[0]), float(time[-1]))
    elif simulated is not None:
        lower = _difference_panel(channel.unit, time, values - simulated[rows], used)
    unit = display_unit(channel.shown_unit, float(np.abs(values).max()))
    heights = [3.2]
    labels = [unit.label(channel.kind.replace("_", " ").replace("encoder counts", "angle"))]
    if lower is not None:
        heights = [2.4, 2.2]
        labels.append(lower.unit.label(lower.label))
        legend += lower.legend
    sheet_title = channel.name if title is None else title
    figure, axes = sheet(heights, sheet_title, labels, "time (s)", legend=legend)
    style: dict[str, Any] = {"zero_order": channel.is_position, "width": THIN, "zorder": 2.5}
    _set_scale(axes[0], values[_scale_rows(used)], unit)
    draw(axes[0], time, unit.factor * values, INK if channel.is_position else BLUE, **style)
    if simulated is not None:
        draw(axes[0], time, unit.factor * simulated[rows], VERMILION, zorder=3.0)
    if channel.encoder is not None:
        counts = right_axis(
            axes[0], 1.0 / (unit.factor * channel.encoder.angle_per_count), "counts"
        )
        counts.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10], integer=True))
    if lower is not None:
        _set_scale(axes[1], lower.scale_values, lower.unit)
        zero_line(axes[1])
        for curve in lower.curves:
            draw(
                axes[1],
                curve.time,
                lower.unit.factor * curve.values,
                curve.color,
                width=curve.width,
            )
    _mark_samples(axes, time, used)
    return figure


class _Curve(NamedTuple):
    time: Array
    values: Array
    """SI."""
    color: str
    width: float
    """[pt]"""


class _LowerPanel(NamedTuple):
    """Panel below the samples of a channel."""

    label: str
    unit: DisplayUnit
    curves: list[_Curve]
    scale_values: Array
    """Values that set the scale, SI."""
    legend: list[Line2D]


def _speed_panel(channel: Channel, begin: float, end: float) -> _LowerPanel:
    """Speed of a position from an instant to another, by differences and by filters."""
    from swashplate.campaign import speed_of

    difference = speed_of(channel, "difference")
    filtered = speed_of(channel, "exact")
    curves = []
    for speed, color in ((difference, ROUGH), (filtered, BLUE)):
        rows = (speed.time >= begin) & (speed.time <= end)
        curves.append(_Curve(speed.time[rows], speed.speed[rows], color, LINE))
    scale_values = curves[1].values
    delay_ms = 1e3 * filtered.delay
    return _LowerPanel(
        label="speed",
        unit=display_unit(f"{channel.unit}/s", float(np.abs(scale_values).max())),
        curves=curves,
        scale_values=scale_values,
        legend=[
            handle("speed: difference of neighbours", ROUGH),
            handle(f"speed: 10 and 30 Hz filters, {delay_ms:.1f} ms late", BLUE),
        ],
    )


def _difference_panel(unit: str, time: Array, difference: Array, used: Mask) -> _LowerPanel:
    """Measured less simulated values of a channel."""
    scale_values = difference[_scale_rows(used)]
    return _LowerPanel(
        label="measured less simulated",
        unit=display_unit(unit, float(np.abs(scale_values).max())),
        curves=[_Curve(time, difference, INK, THIN)],
        scale_values=scale_values,
        legend=[],
    )


def _set_scale(ax: Axes, values: Array, unit: DisplayUnit) -> None:
    """Let a panel show values, SI, with a margin above and below."""
    margin = 0.12 * float(np.ptp(values)) or 1.0 / unit.factor
    ax.set_ylim(unit.factor * (values.min() - margin), unit.factor * (values.max() + margin))


def _mark_samples(axes: Sequence[Axes], time: Array, used: Mask) -> None:
    """Mark ignored samples and gaps of a record in panels, and let these show all of it."""
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
    """Figure of one channel of a run, measured and simulated, with the assessed residual.

    Parameters
    ----------
    quality : RunQuality
        The channel. A position is assessed by its speed, which has a panel of its own: measured
        and simulated positions go through the same filters. The lowest panel is the residual,
        simulated less measured: of that speed, or of the channel itself if it is not a position or
        no speed can be computed from it.
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
    scale_rows = _scale_rows(used)
    panels = [_overlay(signal, rows) for signal in signals]
    assessed = signals[-1]
    residual_unit = assessed.experiment[assessed.channel].unit
    panels.append(Overlay("residual", residual_unit, [(assessed.residual[rows], INK)]))
    units = []
    labels = []
    for panel in panels:
        largest = max(float(np.abs(values[scale_rows]).max()) for values, _ in panel.curves)
        unit = display_unit(panel.unit, largest or 1.0)
        units.append(unit)
        labels.append(unit.label(panel.label))
    legend = [handle("measured", BLUE, width=WIDE), handle("simulated", VERMILION, width=NARROW)]
    sheet_title = f"{quality.experiment.name}, {channel.name}" if title is None else title
    heights = [2.2] * len(signals) + [1.5]
    figure, axes = sheet(heights, sheet_title, labels, "time (s)", legend=legend)
    for ax, panel, unit in zip(axes, panels, units, strict=True):
        scale_curves = [unit.factor * values[scale_rows] for values, _ in panel.curves]
        low = min(float(curve.min()) for curve in scale_curves)
        high = max(float(curve.max()) for curve in scale_curves)
        margin = 0.1 * (high - low) or 1.0
        ax.set_ylim(low - margin, high + margin)
        zero_line(ax)
        for values, color in panel.curves:
            width = WIDE if color == BLUE else NARROW
            draw(ax, time, unit.factor * values, color, width=width)
    _mark_samples(axes, time, used)
    return figure


class Overlay(NamedTuple):
    """Curves of one panel, SI, each with its colour."""

    label: str
    unit: str
    curves: list[tuple[Array, str]]


def _overlay(quality: RunQuality, rows: slice) -> Overlay:
    """Measured curve of a channel, and the simulated one on top of it."""
    channel = quality.experiment[quality.channel]
    label = channel.kind.replace("_", " ").replace("encoder counts", "angle")
    if channel.kind in ("other", *OF_LOADS):
        label = channel.name
    curves = [(channel.values[rows], BLUE), (quality.simulated[rows], VERMILION)]
    return Overlay(label, channel.shown_unit, curves)
