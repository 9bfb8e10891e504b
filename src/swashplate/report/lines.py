"""Signals over time: light at any length, broken at gaps, shaded where limits act, marked."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.drive import Limit
from swashplate.errors import InputError
from swashplate.report.style import LINE, VERMILION, Dashes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch
    from matplotlib.typing import ColorType

Array = NDArray[np.float64]
Rows = NDArray[np.intp]
Mask = NDArray[np.bool_]

# --- lines ---------------------------------------------------------------------------------------

GAP = 5.0
"""A step of the stamps longer than this many median steps is a gap."""
COLUMNS = 8192
"""Stretches of time of which a long line keeps the extremes; twice as many samples, 32 s at 512 Hz,
are drawn as they are."""
COARSE = 1000
"""The same if many panels share a page: two or three a dot of a panel."""
LONG = 131_072
"""A line of more samples is likely to fill its panel, and is drawn thinner."""


def fit_time(ax: Axes, *times: Array) -> None:
    """Let a panel show all of the time stamps and nothing else."""
    first = min(float(time[0]) for time in times)
    last = max(float(time[-1]) for time in times)
    ax.set_xlim(first, last if last > first else first + 1.0)


def rows_within(time: Array, window: tuple[float, float] | None, source: str) -> slice:
    """Rows of stamps [s] within a window, its ends included, two at least; all without one."""
    if window is None:
        return slice(0, time.size)
    first = int(np.searchsorted(time, window[0], side="left"))
    after = int(np.searchsorted(time, window[1], side="right"))
    if after - first < 2:
        raise InputError(
            f"The window from {window[0]:g} s to {window[1]:g} s holds {max(after - first, 0)} "
            f"samples of {source}, which goes from {time[0]:g} s to {time[-1]:g} s; choose one "
            "with at least two."
        )
    return slice(first, after)


def gap_rows(time: Array) -> Rows:
    """Rows after which the stamps [s] have a gap."""
    steps = np.diff(time)
    if not steps.size:
        return np.empty(0, dtype=np.intp)
    return np.flatnonzero(steps > GAP * float(np.median(steps)))


def thinned(time: Array, values: Array, breaks: Rows, columns: int = COLUMNS) -> Rows:
    """Rows that show a signal as all of its samples would, broken after some rows.

    Of up to twice as many samples as columns, which are equal stretches of time, every row. Of
    more, the rows of the lowest and the highest sample of each column on either side of each break,
    and the first and the last row before and after each break: every point drawn is a sample, and
    no extreme is lost.
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
    is_kept = np.zeros(time.size, dtype=np.bool_)
    is_kept[[0, -1]] = True
    is_kept[breaks] = True
    is_kept[breaks + 1] = True
    for extreme in (np.minimum, np.maximum):
        # the first sample of each stretch that is as low, or as high, as any of it
        reached = np.flatnonzero(values == np.repeat(extreme.reduceat(values, starts), sizes))
        stretch = np.searchsorted(starts, reached, side="right")
        is_kept[reached[np.flatnonzero(np.diff(stretch, prepend=0))]] = True
    return np.flatnonzero(is_kept)


def broken(
    time: Array, values: Array, breaks: Rows | None = None, columns: int = COLUMNS
) -> tuple[Array, Array]:
    """Points of a signal's line, thinned out, with a NaN if it is broken.

    Without `breaks`, rows after which the line is broken, it is broken at the gaps of the stamps.
    The NaN has the stamp of the sample before it, so that a staircase ends there too.
    """
    if breaks is None:
        breaks = gap_rows(time)
    rows = thinned(time, values, breaks, columns)
    rows_after = np.searchsorted(rows, breaks, side="right")
    broken_time = np.insert(time[rows], rows_after, time[breaks])
    broken_values = np.insert(values[rows], rows_after, np.nan)
    return broken_time, broken_values


def draw(
    ax: Axes,
    time: Array,
    values: Array,
    color: ColorType,
    *,
    zero_order: bool = False,
    dashes: Dashes = "solid",
    width: float = LINE,
    zorder: float = 2.0,
    label: str | None = None,
    columns: int = COLUMNS,
) -> None:
    """Draw a signal over stamps [s]: no line across a gap, a dot for a sample between two gaps.

    A long signal is drawn by its extremes in so many columns (`thinned`). With
    `zero_order` each sample stays up to the next.
    """
    breaks = gap_rows(time)
    if values.size > LONG:
        width *= 0.6
    style: Literal["default", "steps-post"] = "steps-post" if zero_order else "default"
    keywords: dict[str, Any] = {"color": color, "zorder": zorder}
    joints: dict[str, Any] = {"solid_capstyle": "butt", "solid_joinstyle": "round"}
    drawn_time, drawn_values = broken(time, values, breaks, columns)
    ax.plot(
        drawn_time,
        drawn_values,
        ls=dashes,
        lw=width,
        drawstyle=style,
        label=label,
        **joints,
        **keywords,
    )
    # with a break, or nothing, on both sides no line would show it
    apart = np.ones(time.size + 1, dtype=np.bool_)
    apart[1:-1] = False
    apart[breaks + 1] = True
    if (lonely := apart[1:] & apart[:-1]).any():
        dots: dict[str, Any] = {"marker": ".", "markersize": 2.0 * width, "markeredgewidth": 0.0}
        ax.plot(time[lonely], values[lonely], linestyle="none", **dots, **keywords)


# --- stretches of time ----------------------------------------------------------------------------

MOST_SPANS = 1000
"""More stretches than this on one panel are merged if none could see the gap between them."""


class Shade(NamedTuple):
    """Look of stretches of time of one meaning, and their words in the legend."""

    color: str
    name: str
    edge: str = ""
    hatch: str | None = None
    """A grey print shows it too."""


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
IGNORED = Shade("#ececec", "ignored", "#d2d2d2", "////")


def stretches(time: Array, active: Mask) -> Array:
    """Beginning and end of each stretch of active samples, shape (m, 2). [s]

    Ends reach half a usual step further: a sample stands for its surroundings. Where the step to
    the next sample is shorter than usual, they may reach over it.
    """
    turns = np.flatnonzero(np.diff(active, prepend=False, append=False))
    half = 0.5 * float(np.median(np.diff(time))) if time.size > 1 else 0.0
    return np.stack((time[turns[::2]] - half, time[turns[1::2] - 1] + half), axis=1)


def merged_spans(spans: Array, most: int = MOST_SPANS) -> Array:
    """Join neighbours closer than 1 / `most` of all if there are more than `most` spans."""
    if spans.shape[0] <= most:
        return spans
    apart = spans[1:, 0] - spans[:-1, 1] >= (spans[-1, 1] - spans[0, 0]) / most
    first = np.concatenate(([True], apart))
    last = np.concatenate((apart, [True]))
    return np.stack((spans[first, 0], spans[last, 1]), axis=1)


def shade(ax: Axes, spans: Array, look: Shade) -> None:
    """Shade stretches of time [s], shape (m, 2)."""
    if not spans.size:
        return
    from matplotlib.collections import PolyCollection

    begin, end = merged_spans(spans).T
    x = np.stack((begin, end, end, begin), axis=1)
    y = np.array([0.0, 0.0, 1.0, 1.0])
    ax.add_collection(
        PolyCollection(
            list(np.stack(np.broadcast_arrays(x, y), axis=2)),
            transform=ax.get_xaxis_transform(),
            facecolor=look.color,
            edgecolor=look.edge or look.color,  # thin, so that a single sample can be seen too
            hatch=look.hatch,
            linewidth=0.4,
            zorder=0.3,
            label=look.name,
        ),
        autolim=False,
    )


def shade_handle(look: Shade, label: str = "") -> Patch:
    """Handle for a legend of shaded stretches."""
    from matplotlib.patches import Patch

    style: dict[str, Any] = {"facecolor": look.color, "edgecolor": look.edge or "#00000030"}
    return Patch(hatch=look.hatch, linewidth=0.5, label=label or look.name, **style)


def mark_gaps(ax: Axes, time: Array) -> None:
    """Point from the upper edge at each gap of the stamps [s], however short it is."""
    rows = gap_rows(time)
    if rows.size:
        middles = 0.5 * (time[rows] + time[rows + 1])
        where: dict[str, Any] = {
            "transform": ax.get_xaxis_transform(),
            "clip_on": False,
            "zorder": 4.0,
        }
        ax.plot(middles, np.ones(middles.size), **GAP_MARK, **where)


GAP_MARK: dict[str, Any] = {
    "linestyle": "none",
    "marker": "v",
    "markersize": 3.5,
    "markeredgewidth": 0.0,
    "color": VERMILION,
    "label": "gap in the stamps",
}
