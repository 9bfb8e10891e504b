"""Signals over time: light at any length, broken at gaps, shaded where limits act, marked."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.report.style import (
    GREY,
    LINE,
    THIN,
    Dashes,
    MarginLabel,
    dress,
    label_margin,
    zero_line,
)
from swashplate.simulation.result import Limit, Simulation

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch
    from matplotlib.typing import ColorType

Array = NDArray[np.float64]
Rows = NDArray[np.intp]
Mask = NDArray[np.bool_]

# --- simulated signals ----------------------------------------------------------------------------

MOST_POINTS = 16_384
"""A line of more samples is drawn as its envelope of about as many points: 32 s at 512 Hz."""
LONG = 8 * MOST_POINTS
"""A line of more samples is likely to fill its panel, and is drawn thinner."""


def draw(
    ax: Axes,
    time: Array,
    values: Array,
    color: ColorType,
    *,
    dashes: Dashes = "solid",
    width: float = LINE,
    zorder: float = 2.0,
) -> None:
    """Draw a signal over time; a long one by its envelope, a very long one thinner."""
    stamps, heights = envelope(time, values)
    if values.size > LONG:
        width *= 0.6
    ax.plot(
        stamps,
        heights,
        color=color,
        linestyle=dashes,
        linewidth=width,
        solid_capstyle="butt",
        solid_joinstyle="round",
        zorder=zorder,
    )


def envelope(time: Array, values: Array, most: int = MOST_POINTS) -> tuple[Array, Array]:
    """The lowest and highest sample of each of many short stretches; a short signal as it is.

    Every point returned is a sample, the first and the last among them.
    """
    if values.size <= most:
        return time, values
    stretch = -(-values.size // (most // 2))
    whole = values.size - values.size % stretch
    starts = np.arange(0, whole, stretch)
    rows = values[:whole].reshape(-1, stretch)
    ends = [0, values.size - 1]
    if whole < values.size:
        ends += [whole + int(values[whole:].argmin()), whole + int(values[whole:].argmax())]
    kept = np.unique(np.concatenate((starts + rows.argmin(1), starts + rows.argmax(1), ends)))
    return time[kept], values[kept]


def fit_time(ax: Axes, *times: Array) -> None:
    """Let a panel show all of the time stamps and nothing else."""
    first = min(float(time[0]) for time in times)
    last = max(float(time[-1]) for time in times)
    ax.set_xlim(first, last if last > first else first + 1.0)


def rows_within(time: Array, window: tuple[float, float] | None, what: str) -> slice:
    """Rows of stamps within a window, its ends included; all without one.

    Parameters
    ----------
    time : (n,) array
        Increasing stamps. [s]
    window : (float, float) or None
        First and last instant. [s]
    what : str
        The signal, for the error's sentence.

    Raises
    ------
    InputError
        If fewer than two stamps lie within it.
    """
    if window is None:
        return slice(0, time.size)
    first = int(np.searchsorted(time, window[0], side="left"))
    after = int(np.searchsorted(time, window[1], side="right"))
    if after - first < 2:
        raise InputError(
            f"The window from {window[0]:g} s to {window[1]:g} s holds {max(after - first, 0)} "
            f"samples of {what}, which goes from {time[0]:g} s to {time[-1]:g} s; choose one that "
            "holds two at least."
        )
    return slice(first, after)


# --- measured signals -----------------------------------------------------------------------------
# The envelope above counts samples, which is right for a simulation's even grid. Measured stamps
# are uneven and have gaps, so that stretches of time are taken here.

GAP = 5.0
"""A step of the stamps longer than this many median steps is a gap."""
COLUMNS = 1000
"""Stretches of time of which a long line keeps the extremes: two or three a dot of a panel."""


def gap_rows(time: Array) -> Rows:
    """Rows after which the stamps [s] have a gap."""
    steps = np.diff(time)
    if not steps.size:
        return np.empty(0, dtype=np.intp)
    return np.flatnonzero(steps > GAP * float(np.median(steps)))


def thinned(time: Array, values: Array, breaks: Rows, columns: int = COLUMNS) -> Rows:
    """Rows that show a signal as all of its samples would.

    Parameters
    ----------
    time, values : (n,) arrays
        Increasing stamps [s], and samples.
    breaks : (k,) array
        Rows after which the line is broken.
    columns : int
        Number of equal stretches of time.

    Returns
    -------
    (m,) array
        Of up to twice as many samples as columns every row. Of more, the rows of the lowest and
        the highest sample of each column on either side of each break, and the first and the last
        row before and after each break: every point drawn is a sample, and no extreme is lost.
    """
    if time.size <= 2 * columns:
        return np.arange(time.size)
    column = ((time - time[0]) * (columns / (time[-1] - time[0]))).astype(np.intp)
    first = np.empty(time.size, dtype=np.bool_)
    first[0] = True
    np.not_equal(column[1:], column[:-1], out=first[1:])
    first[breaks + 1] = True
    starts = np.flatnonzero(first)
    sizes = np.diff(starts, append=time.size)
    kept = np.zeros(time.size, dtype=np.bool_)
    kept[[0, -1]] = True
    kept[breaks] = True
    kept[breaks + 1] = True
    for extreme in (np.minimum, np.maximum):
        # the first sample of each stretch that is as low, or as high, as any of it
        reached = np.flatnonzero(values == np.repeat(extreme.reduceat(values, starts), sizes))
        stretch = np.searchsorted(starts, reached, side="right")
        kept[reached[np.flatnonzero(np.diff(stretch, prepend=0))]] = True
    return np.flatnonzero(kept)


def broken(
    time: Array, values: Array, breaks: Rows | None = None, columns: int = COLUMNS
) -> tuple[Array, Array]:
    """Points of a signal's line, thinned out, with a NaN where it is broken.

    Without `breaks`, rows after which the line is broken, it is broken at the gaps of the stamps.
    The NaN has the stamp of the sample before it, so that a staircase ends there too.
    """
    if breaks is None:
        breaks = gap_rows(time)
    rows = thinned(time, values, breaks, columns)
    places = np.searchsorted(rows, breaks, side="right")
    return np.insert(time[rows], places, time[breaks]), np.insert(values[rows], places, np.nan)


def alone(size: int, breaks: Rows) -> Mask:
    """(size,) whether a sample has a break, or nothing, on both sides: no line would show it."""
    apart = np.ones(size + 1, dtype=np.bool_)
    apart[1:-1] = False
    apart[breaks + 1] = True
    return apart[1:] & apart[:-1]


def draw_broken(
    ax: Axes,
    time: Array,
    values: Array,
    color: str,
    *,
    shown: Mask | None = None,
    held: bool = False,
    dashes: Dashes = "solid",
    width: float = LINE,
    zorder: float = 2.0,
    label: str | None = None,
) -> None:
    """Draw a measured signal: no line across a gap, a dot where a sample is alone.

    A long signal is drawn by its extremes (`thinned`).

    Parameters
    ----------
    ax : Axes
        Where to.
    time, values : (n,) arrays
        Stamps [s] and samples in the panel's unit.
    color : str
        Of the line.
    shown : (n,) array of bool, optional
        Samples to draw; the line is broken at the others too.
    held : bool
        Draw a staircase: each sample holds up to the next.
    dashes, width, zorder, label :
        Of the line.
    """
    breaks = gap_rows(time)
    if shown is not None:
        kept = np.flatnonzero(shown)
        apart = np.diff(kept) > 1
        apart |= np.isin(kept[:-1], breaks)
        time, values, breaks = time[kept], values[kept], np.flatnonzero(apart)
    if not time.size:
        return
    style: Literal["default", "steps-post"] = "steps-post" if held else "default"
    ax.plot(
        *broken(time, values, breaks),
        color=color,
        linestyle=dashes,
        linewidth=width,
        drawstyle=style,
        solid_capstyle="butt",
        solid_joinstyle="round",
        zorder=zorder,
        label=label,
    )
    lonely = alone(time.size, breaks)
    if lonely.any():
        ax.plot(
            time[lonely],
            values[lonely],
            color=color,
            linestyle="none",
            marker=".",
            markersize=2.0 * width,
            markeredgewidth=0.0,
            zorder=zorder,
        )


# --- limits that act ------------------------------------------------------------------------------

MOST_RUNS = 2000
"""More stretches than this on one panel are merged where none could see the gap between them."""


class Shade(NamedTuple):
    """Colour of a limit and its name in the legend."""

    color: str
    name: str


# Opaque, so that what is shown is what the legend shows. Where limits act together, the later one
# in this order covers the earlier, which it implies or outweighs.
SHADES = {
    Limit.DEAD_ZONE: Shade("#ededed", "solenoid dead zone"),
    Limit.CURRENT_RATE: Shade("#f9d58b", "current rate"),
    Limit.ORIFICE: Shade("#c3e2f6", "orifice (acceleration)"),
    Limit.SPOOL: Shade("#e3a5c5", "spool stop"),
    Limit.SWASH_STOP: Shade("#b5e0cb", "swash stop (speed)"),
    Limit.RELIEF: Shade("#f3b79b", "relief valve"),
}


def shade_limits(ax: Axes, simulation: Simulation, limits: Iterable[Limit]) -> None:
    """Shade a panel wherever one of the limits acts."""
    for limit in limits:
        shade_stretches(ax, active_spans(simulation, limit), limit)


def shade_stretches(ax: Axes, spans: Array, limit: Limit) -> None:
    """Shade stretches of time, shape (m, 2), in the colour of a limit."""
    if not spans.size:
        return
    color, name = SHADES[limit]
    left, right = spans[:, 0], spans[:, 1]
    corners = np.empty((spans.shape[0], 4, 2))
    corners[:, :, 0] = np.stack((left, right, right, left), axis=1)
    corners[:, :, 1] = (0.0, 0.0, 1.0, 1.0)
    from matplotlib.collections import PolyCollection

    ax.add_collection(
        PolyCollection(
            list(corners),
            transform=ax.get_xaxis_transform(),
            facecolor=color,
            edgecolor=color,  # a thin edge, so that a single sample can be seen too
            linewidth=0.4,
            zorder=0.2 + 0.01 * int(limit).bit_length(),
            label=name,
        ),
        autolim=False,
    )


def active_spans(simulation: Simulation, limit: Limit) -> Array:
    """Beginning and end of each stretch of time in which a limit acts, shape (m, 2). [s]"""
    return stretches(simulation.active(limit), simulation.time, simulation.record.rate)


def stretches(active: NDArray[np.bool_], time: Array, rate: float) -> Array:
    """Beginning and end of each stretch of active samples, shape (m, 2). [s]

    A sample stands for the time up to half way to its neighbours.
    """
    turns = np.flatnonzero(np.diff(active, prepend=False, append=False))
    half = 0.5 / rate
    spans = np.stack((time[turns[::2]] - half, time[turns[1::2] - 1] + half), axis=1)
    return merged(spans, float(time[-1] - time[0]) / MOST_RUNS)


def merged(spans: Array, gap: float, most: int = MOST_RUNS) -> Array:
    """Join neighbours closer than `gap` if there are more than `most` spans."""
    if spans.shape[0] <= most:
        return spans
    apart = spans[1:, 0] - spans[:-1, 1] >= gap
    first = np.concatenate(([True], apart))
    last = np.concatenate((apart, [True]))
    return np.stack((spans[first, 0], spans[last, 1]), axis=1)


def shade_handles(simulation: Simulation) -> list[Patch]:
    """Handles for a legend of the limits that act anywhere in a simulation."""
    return [shade_handle(limit) for limit in SHADES if simulation.active(limit).any()]


def shade_handle(limit: Limit) -> Patch:
    """Handle for a legend of one limit."""
    from matplotlib.patches import Patch

    color, name = SHADES[limit]
    return Patch(facecolor=color, edgecolor="#00000030", linewidth=0.5, label=name)


# --- panels with names in the margin --------------------------------------------------------------

WIDE, NARROW = 1.9, 0.9
"""Widths of two lines that lie on one another for long. [pt]"""

_NEAR = 0.3
"""A line that marks a limit is shown if the signal goes at least this share of the way to it."""


class Trace(NamedTuple):
    """A signal of a panel, in the panel's unit; its name if there is more than one."""

    values: Array
    color: str
    name: str = ""
    width: float = LINE


class Mark(NamedTuple):
    """A level that the signal should be compared with, in the panel's unit."""

    level: float
    words: str


def fill_panel(
    ax: Axes,
    label: str,
    time: Array,
    traces: Sequence[Trace],
    marks: Sequence[Mark] = (),
    *,
    height: float,
    least: float = 0.0,
) -> None:
    """Draw signals over time, from zero on, with the marks that they come near to.

    Parameters
    ----------
    ax : Axes
        Where.
    label : str
        Of the ordinate, with its unit.
    time : (n,) array
        [s]
    traces, marks : sequences
        What to draw, in the unit of the label.
    height : float
        Of the panel. [inch]
    least : float
        Range that is shown at least, so that rounding looks like nothing.
    """
    dress(ax, label)
    zero_line(ax)
    low = min(float(trace.values.min()) for trace in traces)
    high = max(float(trace.values.max()) for trace in traces)
    near = [mark for mark in marks if _within_reach(mark.level, low, high)]
    low, high = min(low, *(m.level for m in near), 0.0), max(high, *(m.level for m in near), 0.0)
    spare = max(0.09 * (high - low), 0.5 * (least - (high - low))) or 1.0
    ax.set_ylim(low - spare, high + spare)
    labels = []
    for mark in near:
        ax.axhline(mark.level, color=GREY, linewidth=THIN, dashes=(5.0, 3.0), zorder=1.5)
        labels.append(MarginLabel(mark.level, mark.words, GREY))
    for trace in traces:
        draw(ax, time, trace.values, trace.color, width=trace.width)
        if trace.name:
            labels.append(MarginLabel(float(trace.values[-1]), trace.name, trace.color))
    label_margin(ax, labels, height)


def _within_reach(level: float, low: float, high: float) -> bool:
    reached = high if level > 0.0 else -low
    return level != 0.0 and reached >= _NEAR * abs(level)
