"""Figures of cranes: how runs swing, where they lead, and what limits their drives."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from swashplate.crane import CraneRun
from swashplate.errors import InputError
from swashplate.report.lines import SHADES, draw, fit_time, shade_handle, stretches
from swashplate.report.style import (
    FAINT,
    GREY,
    INK,
    NORMAL,
    SMALL,
    Stroke,
    dress,
    handle,
    label_below,
    put_legend,
    sheet,
    strokes,
)
from swashplate.simulation.result import Limit

MOST_RUNS = 6
"""More lines than that nobody can follow."""
MOVED = 2.0
"""Travel of slew and boom that gets a panel of its own. [deg]"""
ACTING = (Limit.ORIFICE, Limit.SWASH_STOP)
"""Limits that a crane's drives are judged by: of acceleration and of speed."""


def plot_crane(
    runs: CraneRun | Mapping[str, CraneRun],
    *,
    sea: Mapping[str, CraneRun] | None = None,
    title: str | None = None,
) -> Figure:
    """Figure of a run or of several: swing, slew and boom where they move, and when limits act.

    Parameters
    ----------
    runs : CraneRun or mapping of str to CraneRun
        Runs of one length, by their names.
    sea : mapping of str to CraneRun, optional
        The same in a seaway, whose swing gets a panel of its own.
    title : str, optional
        By default the crane's.

    Raises
    ------
    InputError
        For none, or more than six runs.
    """
    named = {runs.actuation: runs} if isinstance(runs, CraneRun) else dict(runs)
    if not 0 < len(named) <= MOST_RUNS:
        raise InputError(f"A figure shows 1 to {MOST_RUNS} runs of a crane, not {len(named)}.")
    first = next(iter(named.values()))
    looks = strokes(named)
    driven = {name: run for name, run in named.items() if run.actuation != "ideal"}
    heads = {"swing_deg": "swing (deg)", "slew_deg": "slew (deg)", "boom_deg": "boom (deg)"}
    for signal in ("slew_deg", "boom_deg"):
        if all(np.ptp(getattr(run, signal)) <= MOVED for run in named.values()):
            del heads[signal]
    legend = [handle(name, *look) for name, look in looks.items()] if len(named) > 1 else []
    sizes = {"swing_deg": 2.1, "slew_deg": 1.5, "boom_deg": 1.2}
    heights = [sizes[each] for each in heads] + ([1.5] if sea else [])
    heights += [0.17 * 2 * len(driven) + 0.25] if driven else []
    figure, axes = sheet(heights, title or first.crane.title, legend=legend, lines=1)
    for ax, (signal, label) in zip(axes, heads.items(), strict=False):
        _lines(ax, named, looks, signal, label)
    axes[0].set_ylim(bottom=0.0)
    if sea:
        _lines(axes[len(heads)], sea, looks, "swing_deg", "in sea (deg)")
        axes[len(heads)].set_ylim(bottom=0.0)
    if driven:
        _acting(axes[-1], driven, looks)
    for ax in axes:
        fit_time(ax, first.time)
        if first.stick_end > 0.0:
            ax.axvline(first.stick_end, color=FAINT, linewidth=0.8, zorder=1.0)
    says = ["grey line: the stick is back at zero"] if first.stick_end > 0.0 else []
    says += [f"{first.crane.assumed} of the crane are assumed"] if first.crane.assumed else []
    axes[0].annotate(
        "; ".join(says),
        (0.0, 1.0),
        xytext=(0.0, 18.0 if legend else 4.0),
        xycoords="axes fraction",
        textcoords="offset points",
        fontsize=SMALL,
        color=GREY,
    )
    label_below(axes[-1], "time (s)")
    return figure


def _lines(
    ax: Axes, runs: Mapping[str, CraneRun], looks: Mapping[str, Stroke], signal: str, label: str
) -> None:
    """A signal of all runs."""
    dress(ax, label)
    for name, run in runs.items():
        look = looks[name]
        draw(ax, run.time, getattr(run, signal), look.color, dashes=look.dashes)


def _acting(ax: Axes, runs: Mapping[str, CraneRun], looks: Mapping[str, Stroke]) -> None:
    """Bars where limits of slew and luff act, a row for each run and axis."""
    rows = [(name, axis) for name in runs for axis in ("slew", "luff")]
    ax.set_ylim(len(rows) - 0.4, -0.6)
    labels = []
    for row, (name, axis) in enumerate(rows):
        run = runs[name].drive(axis)
        for limit in ACTING:
            spans = stretches(run.time, run.active(limit))
            bars = [(start, end - start) for start, end in spans]
            color = SHADES[limit].color
            ax.broken_barh(bars, (row - 0.36, 0.72), facecolors=color, edgecolor="none")
        labels.append(axis)
    dress(ax)
    ax.grid(False, axis="y")
    ax.set_yticks(range(len(rows)), labels, fontsize=SMALL)
    for (name, _), text in zip(rows, ax.get_yticklabels(), strict=True):
        text.set_color(looks[name].color if len(runs) > 1 else INK)
    ax.set_ylabel("limits", fontsize=NORMAL, color=INK)
    put_legend(ax, [shade_handle(SHADES[limit]) for limit in ACTING])
