"""Lines over time, light enough to draw whatever the record's length."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.typing import ColorType
from numpy.typing import NDArray

from swashplate.report.style import LINE, Dashes

Array = NDArray[np.float64]

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
