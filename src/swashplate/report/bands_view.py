"""Figure of a band: where the speed lies, given what the tests left open."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.typing import ColorType

from swashplate.analysis.monte_carlo import Bands
from swashplate.report.style import (
    BLUE,
    INK,
    SMALL,
    Margins,
    dress,
    label_below,
    line_up_labels,
    margins,
    new_figure,
    write_title,
    zero_line,
)
from swashplate.report.traces import MOST_POINTS, Array, draw, fit_time

WIDTH = 8.6
HEIGHTS, GAP = (2.8, 1.4), 0.3
AROUND = Margins(left=0.95, right=0.25, bottom=0.55, top=0.62)
SHADE = 0.25
"""Opacity of a band."""


def plot_bands(band: Bands, *, title: str | None = None) -> Figure:
    """Figure of the median speed with its band, and of the band about the median, enlarged.

    Parameters
    ----------
    band : Bands
        See `analysis.bands.bands`.
    title : str, optional
        By default it says what is shown.
    """
    total = AROUND.bottom + AROUND.top + sum(HEIGHTS) + GAP
    figure = new_figure(WIDTH, total)
    axes = figure.subplots(
        2,
        sharex=True,
        gridspec_kw={
            **margins(figure, AROUND),
            "height_ratios": HEIGHTS,
            "hspace": GAP * 2 / sum(HEIGHTS),
        },
    )
    dress(axes[0], "shaft speed (deg/s)")
    dress(axes[1], "about the median (deg/s)")
    for ax in axes:
        zero_line(ax)
    shade_band(axes[0], band, BLUE)
    draw(axes[0], band.time, np.degrees(band.median), BLUE)
    shade_band(axes[1], band, BLUE, about=band.median)
    width, when = band.widest
    axes[1].annotate(
        f"{100.0 * band.level:g} % of {band.draws} drives; widest {np.degrees(width):.3g} deg/s at "
        f"{when:.3g} s",
        (0.0, 1.0),
        xycoords="axes fraction",
        xytext=(4.0, 3.0),
        textcoords="offset points",
        fontsize=SMALL,
        color=INK,
    )
    fit_time(axes[-1], band.time)
    label_below(axes[-1], "time (s)")
    line_up_labels(figure, axes, 0.62)
    words = "Shaft speed that the tests allow" if title is None else title
    write_title(figure, words, AROUND.left)
    return figure


def shade_band(ax: Axes, band: Bands, color: ColorType, *, about: Array | float = 0.0) -> None:
    """Shade a band in degrees a second; a long one by every so many samples."""
    step = max(-(-band.time.size // MOST_POINTS), 1)
    lower, upper = (np.degrees(each - about)[::step] for each in (band.lower, band.upper))
    ax.fill_between(
        band.time[::step], lower, upper, color=color, alpha=SHADE, linewidth=0.0, zorder=1.6
    )
