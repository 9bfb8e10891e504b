"""Figure of several simulations of one command: speeds over one another, and what differs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from swashplate.errors import InputError
from swashplate.report.style import (
    INK,
    SMALL,
    Margins,
    Stroke,
    dress,
    label_below,
    legend_rows,
    line_up_labels,
    margins,
    new_figure,
    put_legend,
    strokes,
    write_title,
    zero_line,
)
from swashplate.report.traces import Array, draw, fit_time
from swashplate.simulation.result import Simulation

WIDTH = 8.6
HEIGHTS, GAP, ROW = (1.2, 2.6, 1.6), 0.3, 0.17
AROUND = Margins(left=0.95, right=0.25, bottom=0.55, top=0.57)
"""Sizes; the legend's rows add to the margin at the top. [inch]"""


def plot_comparison(simulations: Mapping[str, Simulation], *, title: str | None = None) -> Figure:
    """Figure of the speeds of several drives under the same command, and of their differences.

    Parameters
    ----------
    simulations : mapping
        Name to simulation. The first is what the others are compared with. A command that is not
        the first one's is drawn in the colour of its simulation.
    title : str, optional
        By default it says what is shown.

    Raises
    ------
    InputError
        If there is no simulation.
    """
    if not simulations:
        raise InputError("A comparison needs at least one simulation.")
    names = list(simulations)
    around = AROUND._replace(
        top=AROUND.top + ROW * legend_rows(names, WIDTH - AROUND.left),
    )
    heights = HEIGHTS if len(simulations) > 1 else HEIGHTS[:2]
    total = around.bottom + around.top + sum(heights) + GAP * (len(heights) - 1)
    figure = new_figure(WIDTH, total)
    axes = figure.subplots(
        len(heights),
        sharex=True,
        gridspec_kw={
            **margins(figure, around),
            "height_ratios": heights,
            "hspace": GAP * len(heights) / sum(heights),
        },
    )
    looks = strokes(names)
    _commands(axes[0], simulations, looks)
    dress(axes[1], "shaft speed (deg/s)")
    zero_line(axes[1])
    for name, simulation in simulations.items():
        speed = np.degrees(simulation.shaft_speed)
        draw(axes[1], simulation.time, speed, looks[name].color, dashes=looks[name].dashes)
    if len(simulations) > 1:
        _differences(axes[2], simulations, looks)
    fit_time(axes[-1], *(simulation.time for simulation in simulations.values()))
    label_below(axes[-1], "time (s)")
    line_up_labels(figure, axes, 0.58)
    words = "Shaft speed under the same command" if title is None else title
    write_title(figure, words, AROUND.left)
    put_legend(figure, _handles(looks), AROUND.left, 0.42)
    return figure


def _handles(looks: Mapping[str, Stroke]) -> list[Line2D]:
    return [
        Line2D([], [], color=look.color, linestyle=look.dashes, linewidth=2.0, label=name)
        for name, look in looks.items()
    ]


def _commands(ax: Axes, simulations: Mapping[str, Simulation], looks: Mapping[str, Stroke]) -> None:
    """The voltage, or the current where not all were driven by voltage."""
    volts = all(simulation.driven_by_voltage for simulation in simulations.values())
    dress(ax, "voltage (V)" if volts else "current (A)")
    zero_line(ax)
    first: Array | None = None
    for name, simulation in simulations.items():
        voltage = simulation.voltage if volts else None
        command = simulation.current if voltage is None else voltage
        if first is None:
            first = command
            draw(ax, simulation.time, command, INK, zorder=3.0)
        elif not np.array_equal(first, command):
            look = looks[name]
            draw(ax, simulation.time, command, look.color, dashes=look.dashes)


def _differences(
    ax: Axes, simulations: Mapping[str, Simulation], looks: Mapping[str, Stroke]
) -> None:
    """Speeds less the first one's, where both records have samples."""
    (reference, first), *others = simulations.items()
    dress(ax, "difference (deg/s)")
    zero_line(ax)
    ax.annotate(
        f"speed less that of {reference}",
        (0.0, 1.0),
        xycoords="axes fraction",
        xytext=(4.0, 3.0),
        textcoords="offset points",
        fontsize=SMALL,
        color=looks[reference].color,
    )
    for name, other in others:
        both = (first.time >= other.time[0]) & (first.time <= other.time[-1])
        time = first.time[both]
        if time.size:
            difference = other.at(time, "shaft_speed") - first.shaft_speed[both]
            draw(ax, time, np.degrees(difference), looks[name].color, dashes=looks[name].dashes)
