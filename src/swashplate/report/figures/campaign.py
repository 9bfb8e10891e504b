"""Figures of measured tests: pages of a campaign, a close look at an encoder or an ammeter."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.offsetbox import AnnotationBbox, HPacker, TextArea
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from swashplate.errors import InputError
from swashplate.report.lines import (
    Array,
    Mask,
    Rows,
    draw_broken,
    gap_rows,
    merged,
    rows_within,
    thinned,
)
from swashplate.report.style import (
    BLUE,
    FAINT,
    FOOT,
    GREEN,
    HEAD,
    INK,
    LINE,
    ORANGE,
    POINTS_PER_INCH,
    ROW,
    SMALL,
    THIN,
    VERMILION,
    WIDTH,
    Dashes,
    dress,
    handle,
    label_below,
    new_figure,
    put_legend,
    right_axis,
    sheet,
    write,
    write_title,
    zero_line,
)
from swashplate.units import DisplayUnit, display_unit

if TYPE_CHECKING:
    from swashplate.campaign import Channel, Experiment, InputSignal, Method, Speed
    from swashplate.simulation.result import Simulation

# --- marks beside a measured signal ---------------------------------------------------------------


class Hatching(NamedTuple):
    """How stretches of time of one meaning look, and what the legend calls them."""

    face: str
    edge: str
    hatch: str
    name: str


IGNORED = Hatching("#ececec", "#d2d2d2", "////", "ignored")
MASKED = Hatching("#fbe6c6", "#eccb94", "\\\\\\\\", "masked")
WEIGHTED = "#e3b5cf"
"""Colour of the weights at a panel's foot."""
MOST_SPANS = 500
"""More stretches than this on one panel are merged where none could see the gap between them."""


def spans_of(time: Array, active: Mask) -> Array:
    """First and last stamp of each stretch of samples that are `active`, shape (m, 2). [s]"""
    turns = np.flatnonzero(np.diff(active, prepend=False, append=False))
    return np.stack((time[turns[::2]], time[turns[1::2] - 1]), axis=1)


def widened(time: Array, spans: Array) -> Array:
    """Stretches whose ends reach half a usual step further: a sample stands for its surroundings.

    Where the step to the next sample is shorter than usual, they may reach over it.
    """
    half = 0.5 * float(np.median(np.diff(time))) if time.size > 1 else 0.0
    wide: Array = spans + np.array([-half, half])
    return wide


def shade(ax: Axes, spans: Array, look: Hatching) -> None:
    """Shade stretches of time [s], shape (m, 2), and hatch them: a grey print shows it too."""
    if not spans.size:
        return
    shown = merged(spans, float(spans[-1, 1] - spans[0, 0]) / MOST_SPANS, MOST_SPANS)
    left, right = shown[:, 0], shown[:, 1]
    corners = np.empty((shown.shape[0], 4, 2))
    corners[:, :, 0] = np.stack((left, right, right, left), axis=1)
    corners[:, :, 1] = (0.0, 0.0, 1.0, 1.0)
    ax.add_collection(
        PolyCollection(
            list(corners),
            transform=ax.get_xaxis_transform(),
            facecolor=look.face,
            edgecolor=look.edge,
            hatch=look.hatch,
            linewidth=0.4,
            zorder=0.3,
            label=look.name,
        ),
        autolim=False,
    )


def hatched_patch(look: Hatching, words: str) -> Patch:
    """Handle for a legend of shaded stretches."""
    return Patch(
        facecolor=look.face, edgecolor=look.edge, hatch=look.hatch, linewidth=0.5, label=words
    )


def clipped(values: Array, limits: tuple[float, float] | None) -> Mask:
    """(n,) whether a sample is at the end of its instrument's range, or beyond."""
    if limits is None:
        return np.zeros(values.shape, dtype=np.bool_)
    low, high = limits
    # what a conversion of units rounds away is no distance from the end
    near = 1e-9 * (high - low)
    return (values <= low + near) | (values >= high - near)


def mark_clipped(ax: Axes, time: Array, values: Array, limits: tuple[float, float] | None) -> None:
    """Draw over clipped samples with a bar; all three in the panel's unit."""
    if limits is None:
        return
    active = clipped(values, limits)
    upper = values > 0.5 * (limits[0] + limits[1])
    width = float(time[-1] - time[0]) / MOST_SPANS
    for level, side in zip(limits, (active & ~upper, active & upper), strict=True):
        spans = merged(widened(time, spans_of(time, side)), width, MOST_SPANS)
        if spans.size:
            ax.hlines(
                np.full(spans.shape[0], level),
                spans[:, 0],
                spans[:, 1],
                color=ORANGE,
                linewidth=4.0,
                capstyle="projecting",
                zorder=1.9,
                label="clipped",
            )


def mark_gaps(ax: Axes, time: Array) -> None:
    """Point from the upper edge at each gap of the stamps [s], however short it is."""
    rows = gap_rows(time)
    if not rows.size:
        return
    middles = 0.5 * (time[rows] + time[rows + 1])
    ax.plot(
        middles,
        np.ones(middles.size),
        transform=ax.get_xaxis_transform(),
        linestyle="none",
        marker="v",
        markersize=3.5,
        markeredgewidth=0.0,
        color=VERMILION,
        clip_on=False,
        zorder=4.0,
        label="gap",
    )


def mark_handles(axes: Sequence[Axes], reasons: Sequence[str]) -> list[Patch | Line2D]:
    """Handles for a legend of the marks that are anywhere on these panels.

    Parameters
    ----------
    axes : sequence of Axes
        The panels.
    reasons : sequence of str
        Why stretches are ignored; named if they are few.
    """
    met = {
        artist.get_label() for ax in axes for artist in (*ax.collections, *ax.lines, *ax.patches)
    }
    why = "; ".join(dict.fromkeys(reason for reason in reasons if reason))
    handles: dict[str, Patch | Line2D] = {
        "ignored": hatched_patch(IGNORED, f"ignored: {why}" if 0 < len(why) <= 60 else "ignored"),
        "weight": Patch(facecolor=WEIGHTED, label="weight, relative to the largest"),
        "clipped": Patch(facecolor=ORANGE, label="at the end of the instrument's range"),
        "gap": Line2D(
            [],
            [],
            linestyle="none",
            marker="v",
            markersize=4.0,
            markeredgewidth=0.0,
            color=VERMILION,
            label="gap in the stamps",
        ),
    }
    return [handle for key, handle in handles.items() if key in met]


# --- weights along a panel's foot -----------------------------------------------------------------

WEIGHTS = 0.16
"""Height of the largest weight. [inch]"""
FACTOR = "#8c3f68"
"""Colour of the factors written on it."""
_LETTER = 0.62
"""Width of a digit, in sizes of letters, on the safe side."""


def usual_weight(weight: Array) -> float:
    """The most frequent weight of those that are not zero; 1 if all are."""
    used = weight[weight > 0.0]
    if not used.size:
        return 1.0
    values, counts = np.unique(used, return_counts=True)
    return float(values[np.argmax(counts)])


def has_weights(weight: Array) -> bool:
    """Whether samples that count, count differently."""
    used = weight[weight > 0.0]
    return bool(used.size and used.max() > used.min())


def mark_weights(ax: Axes, time: Array, weight: Array, wide: float) -> None:
    """Draw the weights along a panel's foot, the largest `WEIGHTS` high, and write their factors.

    Parameters
    ----------
    ax : Axes
        Its limits must be final.
    time, weight : (m,) arrays
        Stamps [s] and weights of the samples. A stretch of one weight that is at least twice the
        usual one, or at most half of it, has its factor written beside it, ``×10``, as far as
        there is room.
    wide : float
        Width of the panel. [inch]
    """
    if not has_weights(weight):
        return
    foot = WEIGHTS / PANEL
    turns = np.flatnonzero(np.diff(weight)) + 1
    stepped = turns.size < MOST_SPANS
    if stepped:
        rows = np.unique(np.r_[0, turns - 1, turns, weight.size - 1])
    else:
        # they follow the input and change from sample to sample
        rows = thinned(time, weight, np.empty(0, dtype=np.intp), MOST_SPANS)
    ax.fill_between(
        time[rows],
        foot * weight[rows] / float(weight.max()),
        transform=ax.get_xaxis_transform(),
        color=WEIGHTED,
        linewidth=0.0,
        zorder=1.0,
        label="weight",
    )
    if stepped:
        _write_factors(ax, time, weight, turns, 0.25 * foot, wide)


def _write_factors(
    ax: Axes, time: Array, weight: Array, turns: Rows, height: float, wide: float
) -> None:
    """Write beside each stretch of one weight how many times the usual one it is, with room."""
    firsts = np.r_[0, turns]
    starts, ends = time[firsts], time[np.r_[turns - 1, weight.size - 1]]
    factors = weight[firsts] / usual_weight(weight)
    first, last = ax.get_xlim()
    inch = (last - first) / wide
    apart = np.flatnonzero((factors > 0.0) & ((factors >= 2.0) | (factors <= 0.5)))
    for index, following in zip(apart, np.append(starts[apart], last)[1:], strict=True):
        words = f"×{factors[index]:.3g}"
        letters = _LETTER * SMALL / POINTS_PER_INCH * (len(words) + 1)
        if following - ends[index] > letters * inch:
            write(
                ax,
                words,
                (float(ends[index]), height),
                (2.0, 0.0),
                coords=ax.get_xaxis_transform(),
                color=FACTOR,
                va="bottom",
            )


# --- pages of a campaign --------------------------------------------------------------------------

RUNS = 8
"""Runs on a page: with more, panels are too low to read or the page too high to print."""
NARROWEST, BETWEEN = 2.2, 0.55
PANEL, ABOVE = 0.86, 0.5
"""Widths of a panel and of a gap; heights of a panel, and of a run's heading and ticks. [inch]"""


class Column(NamedTuple):
    """What a column of panels shows."""

    key: tuple[str, str]
    """Name and SI unit of a channel; the input has no name."""
    name: str
    words: str
    """What it shows, with the unit."""
    unit: DisplayUnit
    low: float
    high: float
    """Lowest and highest value of all runs, in the displayed unit. Of a position, whose zero is
    free, half the largest travel of a run, down and up: each run has its own middle."""
    free: bool
    """Whether it is a position."""

    def limits(self, values: Array) -> tuple[float, float]:
        """Lowest and highest value to show of a run, in the displayed unit."""
        middle = 0.5 * float(values.min() + values.max()) if self.free else 0.0
        return middle + self.low, middle + self.high


def signals_of(experiment: Experiment) -> dict[tuple[str, str], InputSignal | Channel]:
    """The input, whose name is empty, and the channels, by name and unit."""
    signals: dict[tuple[str, str], InputSignal | Channel] = {
        ("", experiment.input.unit): experiment.input
    }
    for name, channel in experiment.channels.items():
        signals[(name, channel.unit)] = channel
    return signals


def columns_of(experiments: Sequence[Experiment]) -> list[Column]:
    """The columns that some runs of one axis need together, the input first."""
    met: dict[tuple[str, str], list[InputSignal | Channel]] = {}
    for experiment in experiments:
        for key, signal in signals_of(experiment).items():
            met.setdefault(key, []).append(signal)
    inputs_first = sorted(met, key=lambda key: key[0] != "")
    return [_column(key, met[key]) for key in inputs_first]


def counted(signal: InputSignal | Channel) -> Array:
    """Samples that are not ignored; all of them of an input, or where none is left."""
    used = getattr(signal, "used", None)
    return signal.values if used is None or not used.any() else signal.values[used]


def _column(key: tuple[str, str], signals: Sequence[InputSignal | Channel]) -> Column:
    name, si = key
    # what is ignored may leave the panel: one spike would flatten all runs
    shown = [counted(signal) for signal in signals]
    low, high = min(float(each.min()) for each in shown), max(float(each.max()) for each in shown)
    kind = signals[0].kind
    unit = display_unit(si, max(abs(low), abs(high)))
    free = kind in ("position", "encoder_counts")
    if free:
        high = 0.5 * max(float(np.ptp(each)) for each in shown)
        low = -high
    words = {"encoder_counts": "encoder's angle", "other": signals[0].source.column}
    return Column(
        key,
        name or "input",
        unit.label(words.get(kind, kind.replace("_", " "))),
        unit,
        unit.factor * low,
        unit.factor * high,
        free,
    )


def plot_campaign(experiments: Iterable[Experiment], *, title: str | None = None) -> list[Figure]:
    """Figures of everything that was measured: a page for each axis and eight of its runs.

    A row is a run: over it its name, manoeuvre, role, rate and gaps; its input and channels side by
    side. A column has one unit and one scale; positions, whose zero is free, have it about the
    middle of each run. What is ignored is shaded and hatched, weights that differ stand along the
    foot with their factors, samples at the end of their instrument's range are barred, gaps in the
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
    for each in experiments:
        axes.setdefault(each.axis, []).append(each)
    if not axes:
        raise InputError("A page of a campaign needs at least one experiment.")
    figures = []
    for axis, of_axis in axes.items():
        columns = columns_of(of_axis)
        pages = [of_axis[first : first + RUNS] for first in range(0, len(of_axis), RUNS)]
        for number, page in enumerate(pages, start=1):
            words = f"{title or 'Measured tests'}: {axis}"
            if len(pages) > 1:
                words += f", page {number} of {len(pages)}"
            figures.append(_page(page, columns, words))
    return figures


def _page(experiments: Sequence[Experiment], columns: Sequence[Column], title: str) -> Figure:
    rows, across = len(experiments), len(columns)
    width = max(WIDTH, across * (NARROWEST + BETWEEN))
    panel = width / across - 1.3 * BETWEEN
    figure = new_figure(width, HEAD + 2.0 * ROW + rows * (PANEL + ABOVE) + FOOT)
    grid = figure.subplots(rows, across, sharex="row", squeeze=False)
    for number, (row, experiment) in enumerate(zip(grid, experiments, strict=True)):
        fill_row(list(row), columns, experiment, panel)
        # room for the heading, and in the first row for the columns' names
        for ax, column in zip(row, columns, strict=True):
            heads = (_cut(column.name, panel, 0.085), _cut(column.words, panel, 0.066))
            words, pad = ("\n".join(heads), 20.0) if number == 0 else (" ", 6.0)
            ax.set_title(words, loc="left", fontsize=SMALL, color=INK, pad=pad)
    for ax in grid[-1]:
        label_below(ax, "time (s)")
    reasons = [why for each in experiments for _, _, why in each.ignored]
    handles = mark_handles(list(grid.flat), reasons)
    write_title(figure, title)
    if handles:
        how = {"frameon": False, "fontsize": SMALL, "ncols": 2}
        figure.legend(handles=handles, loc="outside lower left", **how)
    return figure


def _cut(words: str, room: float, letter: float) -> str:
    """Words cut to a room. [inch]"""
    most = int(room / letter)
    return words if len(words) <= most else f"{words[: most - 1]}…"


_ROOM = 0.08
"""Empty share of a panel above and below its signal."""
_NEAR_ZERO = 0.02
"""A record that begins at less than this share of its length is shown from zero on."""
_ROLES = {"fit": "for the fit", "validate": "for validation"}


def fill_row(
    row: Sequence[Axes], columns: Sequence[Column], experiment: Experiment, wide: float
) -> None:
    """Draw a run into a row of panels of a width [inch] that share their abscissa."""
    signals = signals_of(experiment)
    first = min(float(signal.time[0]) for signal in signals.values())
    last = max(float(signal.time[-1]) for signal in signals.values())
    if 0.0 < first < _NEAR_ZERO * (last - first):
        first = 0.0
    row[0].set_xlim(first, last if last > first else first + 1.0)
    for ax, column in zip(row, columns, strict=True):
        dress(ax)
        ax.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
        ax.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
        signal = signals.get(column.key)
        if signal is None:
            ax.set_yticks([])
            ax.text(
                0.5,
                0.5,
                "not measured",
                transform=ax.transAxes,
                fontsize=SMALL,
                ha="center",
                va="center",
            )
            continue
        _fill(ax, column, signal, experiment, wide)
    row[0].add_artist(_heading(row[0], experiment))


def _fill(
    ax: Axes, column: Column, signal: InputSignal | Channel, experiment: Experiment, wide: float
) -> None:
    from swashplate.campaign import Channel

    factor = column.unit.factor
    values = factor * signal.values
    # the input has no weights, and a channel nothing that holds between its samples
    weight, held = None, False
    if isinstance(signal, Channel):
        weight = signal.weight
    else:
        held = signal.interpolation == "previous"
    zero_line(ax)
    low, high = column.limits(factor * counted(signal))
    margin = _ROOM * (high - low) or 1.0
    below = 0.0
    if weight is not None and has_weights(weight):
        # the weights at the foot have their own room
        below = (high - low + 2.0 * margin) * WEIGHTS / (PANEL - WEIGHTS)
    ax.set_ylim(low - margin - below, high + margin)
    if weight is None:
        shade(ax, _ignored(experiment, signal.time), IGNORED)
    else:
        shade(ax, widened(signal.time, spans_of(signal.time, weight == 0.0)), IGNORED)
        mark_weights(ax, signal.time, weight, wide)
    if signal.limits is not None:
        mark_clipped(
            ax, signal.time, values, (factor * signal.limits[0], factor * signal.limits[1])
        )
    mark_gaps(ax, signal.time)
    color = INK if weight is None else BLUE
    draw_broken(ax, signal.time, values, color, held=held, width=THIN)


def _ignored(experiment: Experiment, time: Array) -> Array:
    """Windows that are left out of every channel, as far as there are stamps."""
    windows = [
        (max(start, float(time[0])), min(stop, float(time[-1])))
        for start, stop, _ in experiment.ignored
    ]
    return np.array(sorted(w for w in windows if w[0] < w[1])).reshape(-1, 2)


def _heading(ax: Axes, experiment: Experiment) -> AnnotationBbox:
    """Name of a run in bold, and what else there is to say of it, above its first panel."""
    letters = {"fontsize": SMALL, "color": INK}
    words = [experiment.maneuver, _ROLES[experiment.role], *_stamps_in_words(experiment)]
    line = HPacker(
        children=[
            TextArea(experiment.run, textprops={**letters, "fontweight": "bold"}),
            TextArea("  ·  ".join(words), textprops=letters),
        ],
        pad=0.0,
        sep=7.0,
        align="baseline",
    )
    made = AnnotationBbox(
        line,
        (0.0, 1.0),
        xycoords="axes fraction",
        xybox=(0.0, 6.0),
        boxcoords="offset points",
        box_alignment=(0.0, 0.0),
        frameon=False,
        pad=0.0,
        annotation_clip=False,
    )
    made.set_in_layout(False)  # it may reach over the panels on its right
    return made


def _stamps_in_words(experiment: Experiment) -> list[str]:
    """The rates, and the gaps of the signal that has most."""
    stamps = {name or "input": each.time for (name, _), each in signals_of(experiment).items()}
    words = _rates_in_words(
        {name: 1.0 / float(np.median(np.diff(time))) for name, time in stamps.items()}
    )
    gaps = max((np.diff(time)[gap_rows(time)] for time in stamps.values()), key=np.size)
    if gaps.size:
        longest = f"{float(gaps.max()):.3g} s"
        words.append(
            f"a gap of {longest}" if gaps.size == 1 else f"{gaps.size} gaps, longest {longest}"
        )
    return words


def _rates_in_words(rates: Mapping[str, float]) -> list[str]:
    """The rate of all signals, or of each of two groups, or from which to which rates go. [Hz]"""
    groups: dict[float, list[str]] = {}
    for name, rate in rates.items():
        # stamps that jitter do not have quite the same rate
        same = (known for known in groups if abs(rate - known) < 0.01 * known)
        groups.setdefault(next(same, rate), []).append(name)
    written = {f"{rate:.0f}" if rate >= 100.0 else f"{rate:.3g}": rate for rate in groups}
    if len(groups) == 1:
        return [f"{next(iter(written))} Hz"]
    if len(groups) == 2:
        return [f"{', '.join(groups[rate])} {words} Hz" for words, rate in written.items()]
    return [f"{min(written, key=float)} to {max(written, key=float)} Hz"]


# --- a rectified current --------------------------------------------------------------------------

CROSSING = 0.1
"""Usual length of the mask around a zero crossing. [s]"""
_ABOVE = 1.12
"""The scale of the difference reaches this much beyond its largest sample that counts."""


def plot_current(
    channel: Channel,
    simulation: Simulation,
    *,
    mask_width: float = CROSSING,
    level: float = 0.0,
    window: tuple[float, float] | None = None,
    title: str | None = None,
) -> Figure:
    """Figure of a rectified current, measured and simulated, over their difference.

    Parameters
    ----------
    channel : Channel
        Reading of one ammeter around both leads, of kind ``"rectified_current"``.
    simulation : Simulation
        Of the same run, on the same clock. Its I₊ + I₋ is what the ammeter should read; its signed
        current I₊ - I₋, which lags the command as the measured one does, tells the zero crossings.
    mask_width, level : float
        Length of the mask around each crossing [s], and the signed current [A] that counts as
        zero, as in `campaign.zero_crossings`.
    window : (float, float), optional
        First and last instant to show [s].
    title : str, optional
        By default the channel's and the simulation's names.

    Returns
    -------
    Figure
        Masked and ignored samples are shaded, and the difference is faint there. Fraction masked
        and RMS are those of the window; the RMS is over the samples that are neither masked nor
        ignored.

    Raises
    ------
    InputError
        If the channel is of another kind, or fewer than two of its samples lie in the window and
        within the simulation.
    """
    if channel.kind != "rectified_current":
        raise InputError(
            f"{channel.source} is a {channel.kind}; this figure compares a rectified_current."
        )
    both = (float(simulation.time[0]), float(simulation.time[-1]))
    if window is not None:
        both = (max(both[0], window[0]), min(both[1], window[1]))
    rows = rows_within(channel.time, both, str(channel.source))
    run = _compared(channel, simulation, rows, mask_width, level)
    unit = display_unit("A", float(max(np.abs(run.measured).max(), np.abs(run.simulated).max())))
    words = f"{channel.name}, measured and simulated ({simulation.name})"
    legend = _handles(run)
    figure, (upper, lower) = sheet([2.6, 1.6], words if title is None else title, legend=legend)
    lower.set_xlim(float(run.time[0]), float(run.time[-1]))
    dress(upper, unit.label("|I₊| + |I₋|"))
    _draw_difference(lower, run)
    for ax in (upper, lower):
        zero_line(ax)
        shade(ax, widened(run.time, spans_of(run.time, run.ignored)), IGNORED)
        shade(ax, widened(run.time, spans_of(run.time, run.masked)), MASKED)
        mark_gaps(ax, run.time)
    draw_broken(upper, run.time, unit.factor * run.measured, BLUE, width=THIN, label="measured")
    draw_broken(
        upper,
        run.time,
        unit.factor * run.simulated,
        VERMILION,
        dashes="dashed",
        zorder=2.5,
        label="simulated",
    )
    label_below(lower, "time (s)")
    return figure


class Compared(NamedTuple):
    """What is shown, (n,) arrays of the channel's samples within the window."""

    time: Array
    measured: Array
    simulated: Array
    masked: Mask
    ignored: Mask

    @property
    def counted(self) -> Mask:
        """Samples that say something about the model."""
        return ~(self.masked | self.ignored)


def _compared(
    channel: Channel, simulation: Simulation, rows: slice, mask_width: float, level: float
) -> Compared:
    from swashplate.campaign import zero_crossings

    time = channel.time[rows]
    # of the whole record, so that a crossing just outside the window masks what lies within
    crossings = zero_crossings(
        channel.time, simulation.at(channel.time, "current"), width=mask_width, level=level
    )
    return Compared(
        time,
        channel.values[rows],
        np.abs(simulation.at(time, "current_positive"))
        + np.abs(simulation.at(time, "current_negative")),
        crossings.masked[rows],
        channel.weight[rows] == 0.0,
    )


def _draw_difference(ax: Axes, run: Compared) -> None:
    """The difference, faint throughout and strong where it counts; its scale is that of the latter.

    The masked samples may be far off, and would press the others flat.
    """
    difference = run.measured - run.simulated
    counted = run.counted
    largest = float(np.abs(difference[counted] if counted.any() else difference).max())
    unit = display_unit("A", largest)
    dress(ax, unit.label("difference"))
    difference *= unit.factor
    draw_broken(ax, run.time, difference, FAINT, width=THIN, zorder=1.8, label="all")
    if not counted.any():
        return
    draw_broken(ax, run.time, difference, INK, shown=counted, width=THIN, label="counted")
    bound = _ABOVE * unit.factor * largest or 1.0
    ax.set_ylim(-bound, bound)
    rms = float(np.sqrt(np.mean(np.square(difference[counted]))))
    words = f"measured less simulated, RMS {rms:.3g} {unit.name}"
    write(ax, words if counted.all() else f"{words} outside of what is shaded", (0.0, 1.0))


def _handles(run: Compared) -> list[Line2D | Patch]:
    share = 100.0 * float(np.mean(run.masked))
    handles: list[Line2D | Patch] = [
        handle("measured", BLUE, width=THIN),
        handle("simulated I₊ + I₋", VERMILION, "dashed", LINE),
        hatched_patch(MASKED, f"masked around zero crossings ({share:.2g} % of the samples)"),
    ]
    if run.ignored.any():
        share = 100.0 * float(np.mean(run.ignored))
        handles.append(hatched_patch(IGNORED, f"ignored ({share:.2g} %)"))
    return handles


# --- an encoder or a position ---------------------------------------------------------------------

SOURCE_RATE = 512.0
"""Rate that the source's explicit filters are made for. [Hz]"""
WIDE = 2.0
"""Width of the line that lies under the staircase and must show on both sides of it. [pt]"""
ROUGH = "#d2d2d2"
"""Colour of the plain difference, which fills its panel where the count changes often."""
ROOM = 0.12
"""Empty share of a panel above and below."""


class Look(NamedTuple):
    """How a method's line looks, and its name."""

    color: str
    dashes: Dashes
    width: float
    zorder: float
    words: str


LOOKS: dict[Method, Look] = {
    "difference": Look(ROUGH, "solid", THIN, 1.3, "plain difference"),
    "source": Look(BLUE, "solid", LINE, 2.0, "10 and 30 Hz filters"),
    "exact": Look(BLUE, "solid", LINE, 2.0, "10 and 30 Hz filters, exact form"),
    "savitzky_golay": Look(GREEN, "dashed", LINE, 2.2, "Savitzky-Golay"),
}


def usable_methods(channel: Channel) -> tuple[Method, ...]:
    """The methods that a channel's stamps allow."""
    from swashplate.campaign import stamps_of

    period = stamps_of(channel.time).period
    methods: list[Method] = ["difference"]
    if period is not None and abs(period * SOURCE_RATE - 1.0) < 1e-3:
        methods.append("source")
    else:
        methods.append("exact")
    if period is not None:
        methods.append("savitzky_golay")
    return tuple(methods)


def cut(speed: Speed, time: Array) -> Speed:
    """The part of a speed between the first and the last of some stamps."""
    rows = slice(
        int(np.searchsorted(speed.time, time[0], side="left")),
        int(np.searchsorted(speed.time, time[-1], side="right")),
    )
    return speed._replace(time=speed.time[rows], speed=speed.speed[rows])


def reach_of(speeds: Mapping[Method, Speed]) -> tuple[float, float]:
    """Lowest and highest speed of all but the plain difference, if there is another."""
    smooth = [speed for method, speed in speeds.items() if method != "difference"]
    shown = [speed.speed for speed in smooth or speeds.values()]
    return min(float(each.min()) for each in shown), max(float(each.max()) for each in shown)


def draw_speed(ax: Axes, method: Method, speed: Speed, unit: DisplayUnit) -> None:
    """Draw a speed."""
    color, dashes, width, zorder, _ = LOOKS[method]
    draw_broken(
        ax,
        speed.time,
        unit.factor * speed.speed,
        color,
        dashes=dashes,
        width=width,
        zorder=zorder,
        label=method,
    )


def speed_handles(
    speeds: Mapping[Method, Speed], unit: DisplayUnit, reach: tuple[float, float]
) -> list[Line2D | Patch]:
    """Handles for a legend: names and delays, and how far a line goes beyond the panel.

    Parameters
    ----------
    speeds : mapping
        As they are shown, by their method.
    unit : DisplayUnit
        The panel's.
    reach : (float, float)
        Lowest and highest speed that the panel is made for, SI.
    """
    handles: list[Line2D | Patch] = []
    for method, speed in speeds.items():
        look = LOOKS[method]
        words = look.words
        low, high = float(speed.speed.min()), float(speed.speed.max())
        room = ROOM * (reach[1] - reach[0])
        if low < reach[0] - room or high > reach[1] + room:
            ends = f"{unit.factor * low:.4g} to {unit.factor * high:.4g}".replace("-", "−")
            words += f", from {ends} {unit.name}"
        if speed.delay > 0.0 and method != "difference":
            words += f", {1e3 * speed.delay:.1f} ms late"
        handles.append(handle(words, look.color, look.dashes, look.width))
    return handles


def plot_encoder(
    channel: Channel,
    *,
    methods: Sequence[Method] | None = None,
    window: tuple[float, float] | None = None,
    title: str | None = None,
) -> Figure:
    """Figure of a measured position, raw and interpolated, over the speeds that follow from it.

    Parameters
    ----------
    channel : Channel
        An encoder, or another position.
    methods : sequence of Method, optional
        How the speed is made (`campaign.speed_of`). By default all that the stamps and the
        channel allow: the plain difference; the source's filters, in their exact form where the
        stamps are uneven or not at 512 Hz; Savitzky and Golay's where they are even. The legend
        names them.
    window : (float, float), optional
        First and last instant to show [s]. Everything is computed from the whole record.
    title : str, optional
        By default the channel's name.

    Returns
    -------
    Figure
        Above, the staircase of the position (each sample held up to the next) and, of an encoder,
        the line between the changes of the count, with the counts on the right. Below, the speeds,
        with a band of two standard deviations on either side where the method tells them. The
        scale is that of the smooth speeds: how far the plain difference goes beyond it stands in
        the legend.

    Raises
    ------
    InputError
        If the channel measures no position, a method cannot be used with it, or the window holds
        fewer than two samples.
    """
    if not channel.is_position:
        raise InputError(
            f"{channel.source} is a {channel.kind}; this figure shows an encoder or a position."
        )
    rows = rows_within(channel.time, window, str(channel.source))
    from swashplate.campaign import speed_of

    chosen = usable_methods(channel) if methods is None else tuple(methods)
    speeds = {method: speed_of(channel, method) for method in chosen}
    shown = {method: cut(speed, channel.time[rows]) for method, speed in speeds.items()}
    low, high = reach_of(shown)
    unit = display_unit(f"{channel.unit}/s", max(abs(low), abs(high)))
    handles = speed_handles(shown, unit, (low, high))
    figure, (upper, lower) = sheet(
        [1.9, 2.4], channel.name if title is None else title, lines=1 + len(handles) // 2
    )
    time = channel.time[rows]
    lower.set_xlim(float(time[0]), float(time[-1]))
    _draw_position(upper, channel, rows)
    dress(lower, unit.label("speed"))
    zero_line(lower)
    margin = unit.factor * ROOM * (high - low) or 1.0
    lower.set_ylim(unit.factor * low - margin, unit.factor * high + margin)
    for method, speed in shown.items():
        draw_speed(lower, method, speed, unit)
    label_below(lower, "time (s)")
    put_legend(upper, _position_handles(channel))
    put_legend(lower, handles)
    return figure


def _draw_position(ax: Axes, channel: Channel, rows: slice) -> None:
    time, position = channel.time[rows], channel.values[rows]
    unit = display_unit(channel.unit, float(np.abs(position).max()))
    dress(ax, unit.label("angle" if channel.unit == "rad" else "position"))
    low, high = unit.factor * float(position.min()), unit.factor * float(position.max())
    margin = ROOM * (high - low) or 1.0
    ax.set_ylim(low - margin, high + margin)
    mark_gaps(ax, time)
    how: dict[str, Any] = {"held": True, "width": THIN, "zorder": 2.5, "label": "raw"}
    draw_broken(ax, time, unit.factor * position, INK, **how)
    if channel.counts is None or channel.encoder is None:
        return
    from swashplate.campaign import interpolate_counts

    between = interpolate_counts(channel.time, channel.counts)[rows]
    angle = channel.encoder.angle_per_count * between
    draw_broken(ax, time, unit.factor * angle, BLUE, width=WIDE, label="interpolated")
    counts = right_axis(ax, 1.0 / (unit.factor * channel.encoder.angle_per_count), "counts")
    counts.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10], integer=True))


def _position_handles(channel: Channel) -> list[Line2D]:
    raw = "counts" if channel.encoder is not None else "position"
    handles = [handle(raw, INK, width=THIN)]
    if channel.encoder is not None:
        handles.append(handle("interpolated between changes of the count", BLUE, width=WIDE))
    return handles
