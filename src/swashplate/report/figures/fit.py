"""Figure of a fit at a glance: a run that it predicts, and its estimates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from swashplate.errors import InputError
from swashplate.identification.assessment import Assessment
from swashplate.identification.validation import RunQuality
from swashplate.report.style import (
    BLUE,
    FAINT,
    GREY,
    GRID,
    INK,
    LINE,
    SMALL,
    VERMILION,
    dress,
    label_below,
    new_figure,
)
from swashplate.units import display_unit


def plot_fit(
    run: RunQuality,
    assessments: Sequence[Assessment],
    truth: Mapping[str, float] | None = None,
) -> Figure:
    """Figure of one run, measured and simulated, beside the estimates relative to a reference.

    Parameters
    ----------
    run : RunQuality
        The run to show, a speed as a rule.
    assessments : sequence of Assessment
        Of the stages; unknowns of single runs are left out.
    truth : mapping of str to float, optional
        True values by the unknowns' names; without it intervals stand about the estimates.

    Raises
    ------
    InputError
        If no unknown has an interval with two ends.
    """
    figure = new_figure(10.0, 5.6)
    grid = figure.add_gridspec(3, 2, width_ratios=(1.5, 1.0))
    speed = figure.add_subplot(grid[:2, 0])
    command = figure.add_subplot(grid[2, 0], sharex=speed)
    _run(speed, command, run)
    _estimates(figure.add_subplot(grid[:, 1]), assessments, truth)
    return figure


def _run(ax: Axes, below: Axes, run: RunQuality) -> None:
    channel = run.experiment[run.channel]
    unit = display_unit(channel.unit)
    ax.plot(channel.time, unit.factor * channel.values, color=FAINT, lw=2.6, label="measured")
    ax.plot(channel.time, unit.factor * run.simulated, color=BLUE, lw=LINE, label="simulated")
    dress(ax, unit.label("speed"))
    ax.tick_params(labelbottom=False)
    ax.legend(loc="lower left", frameon=False, fontsize=SMALL)
    percent = run.measures.fit_percent
    said = "" if percent is None else f", fit {percent:.1f} %"
    ax.set_title(
        f"{run.experiment.run}: held out, predicted from the voltage{said}",
        loc="left",
        fontsize=SMALL,
        color=INK,
    )
    source = run.experiment.input
    below.plot(source.time, source.values, color=GREY, lw=LINE)
    dress(below, f"{source.kind} ({source.unit})")
    label_below(below, "time (s)")


def _estimates(
    ax: Axes, assessments: Sequence[Assessment], truth: Mapping[str, float] | None
) -> None:
    rows = [
        (each, each.value if truth is None else truth[each.name])
        for assessment in assessments
        for each, unknown in zip(
            assessment.uncertainty.estimates, assessment.stage.problem.unknowns, strict=True
        )
        if unknown.run is None and (truth is None or each.name in truth)
    ]
    shown = [(each, about) for each, about in rows if None not in (each.lower, each.upper)]
    if not shown:
        raise InputError("No parameter has an interval with two ends: there is nothing to draw.")
    reach: list[float] = []
    for place, (each, about) in enumerate(shown):
        assert each.lower is not None
        assert each.upper is not None
        ends = sorted(100.0 * (end / about - 1.0) for end in (each.lower, each.upper))
        reach.append(max(abs(end) for end in ends))
        holds = ends[0] <= 0.0 <= ends[1]
        color = BLUE if holds else VERMILION
        ax.plot(ends, [place, place], color=color, lw=2.0, solid_capstyle="butt")
        ax.plot(100.0 * (each.value / about - 1.0), place, "o", color=color, ms=3.0)
    ax.axvline(0.0, color=GREY, lw=0.8)
    ax.set_yticks(range(len(shown)), [each.name for each, _ in shown], fontsize=SMALL - 1.5)
    ax.set_ylim(len(shown) - 0.4, -0.6)
    # a few wide ones must not make all others points
    straight = max(float(np.quantile(reach, 0.8)), 1e-9)
    ax.set_xscale("symlog", linthresh=straight, linscale=2.0)
    ticks = [0.5 * straight, straight, *(straight * 10.0**k for k in range(1, 3))]
    ticks = [float(f"{tick:.1g}") for tick in ticks if tick <= max(reach) or tick <= straight]
    ax.set_xticks([*(-tick for tick in reversed(ticks)), 0.0, *ticks])
    ax.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    ax.xaxis.set_minor_locator(NullLocator())
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(axis="x", color=GRID, lw=0.6)
    ax.set_axisbelow(True)
    about_what = "the truth" if truth is not None else "the estimate"
    label_below(ax, f"95 % interval about {about_what} (%)")
    ax.set_title("estimates", loc="left", fontsize=SMALL, color=INK)
