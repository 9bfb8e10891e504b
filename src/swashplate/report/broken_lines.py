"""Measured signals over time: lines that are broken at gaps, and light at any length.

The envelope of `traces` counts samples, which is right for a simulation's even grid. Measured
stamps are uneven and have gaps, so that stretches of time are taken here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from swashplate.report.style import LINE, Dashes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
Rows = NDArray[np.intp]
Mask = NDArray[np.bool_]

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
