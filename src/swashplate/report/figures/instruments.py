"""Figures of single instruments: an ammeter beside its simulation, an encoder and its speeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from swashplate.errors import InputError
from swashplate.report.lines import (
    IGNORED,
    MASKED,
    Array,
    Mask,
    draw,
    mark_gaps,
    rows_within,
    shade,
    shade_handle,
    stretches,
)
from swashplate.report.style import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    LINE,
    THIN,
    VERMILION,
    Dashes,
    dress,
    handle,
    label_below,
    put_legend,
    right_axis,
    sheet,
    write,
    zero_line,
)
from swashplate.units import DisplayUnit, display_unit

if TYPE_CHECKING:
    from swashplate.campaign import Channel, InputSignal, Method, Speed
    from swashplate.simulation.result import Simulation

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
        shade(ax, stretches(run.time, run.ignored), IGNORED)
        shade(ax, stretches(run.time, run.masked), MASKED)
        mark_gaps(ax, run.time)
    draw(upper, run.time, unit.factor * run.measured, BLUE, width=THIN, label="measured")
    how: dict[str, Any] = {"dashes": "dashed", "zorder": 2.5, "label": "simulated"}
    draw(upper, run.time, unit.factor * run.simulated, VERMILION, **how)
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
    draw(ax, run.time, difference, FAINT, width=THIN, zorder=1.8, label="all")
    if not counted.any():
        return
    draw(ax, run.time, difference, INK, shown=counted, width=THIN, label="counted")
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
        shade_handle(MASKED, f"masked around zero crossings ({share:.2g} % of the samples)"),
    ]
    if run.ignored.any():
        share = 100.0 * float(np.mean(run.ignored))
        handles.append(shade_handle(IGNORED, f"ignored ({share:.2g} %)"))
    return handles


# --- any other channel ----------------------------------------------------------------------------


def plot_channel(
    channel: Channel,
    given: InputSignal,
    simulated: Array | None = None,
    *,
    window: tuple[float, float] | None = None,
    title: str | None = None,
) -> Figure:
    """Figure of a measured channel, and perhaps what a drive would do, over the input.

    Parameters
    ----------
    channel : Channel
        Any.
    given : InputSignal
        Input of the same run.
    simulated : (m,) array, optional
        What a drive does at the channel's samples. [unit of the channel]
    window : (float, float), optional
        First and last instant to show [s].
    title : str, optional
        By default the channel's name.

    Raises
    ------
    InputError
        If fewer than two samples lie in the window.
    """
    rows = rows_within(channel.time, window, str(channel.source))
    time, measured = channel.time[rows], channel.values[rows]
    unit = display_unit(channel.unit, float(np.abs(measured).max()))
    legend = [handle("measured", BLUE, width=THIN)]
    if simulated is not None:
        legend.append(handle("the axis's drive", VERMILION, "dashed", LINE))
    words = channel.name if title is None else title
    figure, (upper, lower) = sheet([2.6, 1.2], words, legend=legend)
    dress(upper, unit.label(channel.kind.replace("_", " ")))
    draw(upper, time, unit.factor * measured, BLUE, width=THIN)
    if simulated is not None:
        draw(upper, time, unit.factor * simulated[rows], VERMILION, dashes="dashed", zorder=2.5)
    shade(upper, stretches(time, channel.weight[rows] == 0.0), IGNORED)
    mark_gaps(upper, time)
    driving = display_unit(given.unit, float(np.abs(given.values).max()))
    dress(lower, driving.label(f"input, {given.kind}"))
    held = given.interpolation == "previous"
    draw(lower, given.time, driving.factor * given.values, INK, held=held)
    for ax in (upper, lower):
        zero_line(ax)
    lower.set_xlim(float(time[0]), float(time[-1]))
    label_below(lower, "time (s)")
    return figure


# --- an encoder or a position ---------------------------------------------------------------------

SOURCE_RATE = 512.0
"""Rate that Kruse's explicit filters are made for. [Hz]"""
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
        channel allow: the plain difference; Kruse's filters, in their exact form where the
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
        look = LOOKS[method]
        how: dict[str, Any] = look._asdict() | {"label": method}
        del how["words"], how["color"]
        draw(lower, speed.time, unit.factor * speed.speed, look.color, **how)
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
    draw(ax, time, unit.factor * position, INK, **how)
    if channel.counts is None or channel.encoder is None:
        return
    from swashplate.campaign import interpolate_counts

    between = interpolate_counts(channel.time, channel.counts)[rows]
    angle = channel.encoder.angle_per_count * between
    draw(ax, time, unit.factor * angle, BLUE, width=WIDE, label="interpolated")
    counts = right_axis(ax, 1.0 / (unit.factor * channel.encoder.angle_per_count), "counts")
    counts.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10], integer=True))


def _position_handles(channel: Channel) -> list[Line2D]:
    raw = "counts" if channel.encoder is not None else "position"
    handles = [handle(raw, INK, width=THIN)]
    if channel.encoder is not None:
        handles.append(handle("interpolated between changes of the count", BLUE, width=WIDE))
    return handles
