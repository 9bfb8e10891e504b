"""Figure of a measured current against a simulated one, and where the two cannot be compared."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.report.broken_lines import draw_broken
from swashplate.report.campaign_marks import (
    IGNORED,
    MASKED,
    hatched_patch,
    mark_gaps,
    shade,
    spans_of,
    widened,
)
from swashplate.report.display_units import display_unit
from swashplate.report.style import (
    BLUE,
    FAINT,
    INK,
    LINE,
    SMALL,
    THIN,
    VERMILION,
    Margins,
    dress,
    label_below,
    legend_rows,
    line_up_labels,
    margins,
    new_figure,
    put_legend,
    write_title,
    zero_line,
)
from swashplate.report.windows import rows_within

if TYPE_CHECKING:
    from swashplate.campaign import Channel
    from swashplate.simulation.result import Simulation

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

WIDTH = 8.6
HEIGHTS, GAP, ROW = (2.6, 1.6), 0.32, 0.17
AROUND = Margins(left=0.95, right=0.25, bottom=0.55, top=0.57)
"""Sizes; the legend's rows add to the margin at the top. [inch]"""
CROSSING = 0.1
"""Usual length of the mask around a zero crossing. [s]"""
_ROOM = 1.12
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
        zero, as in `campaign.ammeter.zero_crossings`.
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
    handles = _handles(channel, run)
    around = AROUND._replace(
        top=AROUND.top
        + ROW * legend_rows([str(each.get_label()) for each in handles], WIDTH - AROUND.left)
    )
    figure = new_figure(WIDTH, around.bottom + around.top + sum(HEIGHTS) + GAP)
    upper, lower = figure.subplots(
        2,
        sharex=True,
        gridspec_kw={
            **margins(figure, around),
            "height_ratios": HEIGHTS,
            "hspace": 2.0 * GAP / sum(HEIGHTS),
        },
    )
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
    line_up_labels(figure, (upper, lower), 0.62)
    words = f"{channel.name}, measured and simulated ({simulation.name})"
    write_title(figure, words if title is None else title, AROUND.left)
    put_legend(figure, handles, AROUND.left, 0.42)
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
    bound = _ROOM * unit.factor * largest or 1.0
    ax.set_ylim(-bound, bound)
    rms = float(np.sqrt(np.mean(np.square(difference[counted]))))
    words = f"measured less simulated, RMS {rms:.3g} {unit.name}"
    ax.annotate(
        words if counted.all() else f"{words} outside of what is shaded",
        (0.0, 1.0),
        xycoords="axes fraction",
        xytext=(4.0, 3.0),
        textcoords="offset points",
        fontsize=SMALL,
        color=INK,
    )


def _handles(channel: Channel, run: Compared) -> list[Line2D | Patch]:
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=BLUE, linewidth=THIN, label="measured"),
        Line2D(
            [], [], color=VERMILION, linestyle="dashed", linewidth=LINE, label="simulated I₊ + I₋"
        ),
    ]
    share = 100.0 * float(np.mean(run.masked))
    words = f"masked around zero crossings ({share:.2g} % of the samples)"
    handles.append(hatched_patch(MASKED, words))
    if run.ignored.any():
        share = 100.0 * float(np.mean(run.ignored))
        handles.append(hatched_patch(IGNORED, f"ignored ({share:.2g} %)"))
    return handles
