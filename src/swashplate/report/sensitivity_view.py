"""Figures of sensitivities: a tornado of single levers, and Sobol's indices as bars."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from swashplate.analysis.sensitivity import OneAtATime, SobolIndices
from swashplate.errors import InputError
from swashplate.report.outcome_units import outcome_text, outcome_unit, outcome_words
from swashplate.report.style import (
    BLUE,
    FAINT,
    INK,
    NORMAL,
    SKY,
    SMALL,
    VERMILION,
    dress,
    new_figure,
    put_legend,
    write_title,
)

WIDTH, LEFT, RIGHT, BETWEEN = 8.6, 1.45, 0.3, 1.45
BAR, HEAD, FOOT, TOP = 0.22, 0.4, 0.3, 0.75
"""Sizes: height of a lever's bar, of a panel's title and ticks, of the figure's title. [inch]"""
COLUMNS = 2
THICK = 0.72
NOTHING = 1e-9
"""Swings below this part of the largest are not drawn."""


def plot_tornado(result: OneAtATime, *, title: str | None = None) -> Figure:
    """Figure of what each lever does by itself, a panel an outcome, the strongest at the top.

    Parameters
    ----------
    result : OneAtATime
        See `analysis.sensitivity.one_at_a_time`.
    title : str, optional
        By default it says what is shown.

    Raises
    ------
    InputError
        If no outcome is defined.
    """
    shown = [k for k in range(len(result.outcomes)) if np.isfinite(result.base[k])]
    if not shown:
        raise InputError("None of the outcomes is defined for this command: nothing to draw.")
    figure, panels = _panels(len(shown), len(result.levers))
    for ax, k in zip(panels, shown, strict=True):
        outcome, swings = result.outcomes[k], np.nan_to_num(result.swings[:, k])
        order = np.argsort(swings, kind="stable")
        factor = outcome_unit(outcome).factor
        base = factor * result.base[k]
        for place, lever in enumerate(order):
            for values, color in ((result.low, BLUE), (result.high, VERMILION)):
                change = factor * values[lever, k] - base
                if np.isfinite(change):
                    ax.barh(place, change, THICK, left=base, color=color, zorder=2.0)
        if not (swings > NOTHING * abs(result.base[k])).any():
            half = max(abs(base), 1.0) * 0.1
            ax.set_xlim(base - half, base + half)
        ax.axvline(base, color=INK, linewidth=0.8, zorder=3.0)
        _name(ax, [result.levers[lever] for lever in order])
        value = outcome_text(outcome, result.base[k])
        _head(ax, f"{outcome_words(outcome)}, {value} {outcome_unit(outcome).name}")
    write_title(figure, "Each lever by itself" if title is None else title, 0.3)
    put_legend(
        figure,
        [
            Patch(color=BLUE, label=_ends(result, 0, "lower")),
            Patch(color=VERMILION, label=_ends(result, 1, "upper")),
        ],
        0.3,
        0.42,
    )
    return figure


def plot_sobol(result: SobolIndices, *, title: str | None = None) -> Figure:
    """Figure of Sobol's indices, a panel an outcome: in total, and of first order within.

    Parameters
    ----------
    result : SobolIndices
        See `analysis.sobol.sobol`; outcomes without indices are left out.
    title : str, optional
        By default it says what is shown.

    Raises
    ------
    InputError
        If no outcome has indices.
    """
    shown = [k for k in range(len(result.outcomes)) if np.isfinite(result.total[:, k]).all()]
    if not shown:
        raise InputError("No outcome has Sobol indices: nothing to draw.")
    figure, panels = _panels(len(shown), len(result.levers))
    for ax, k in zip(panels, shown, strict=True):
        order = np.argsort(result.total[:, k], kind="stable")
        places = np.arange(order.size)
        ax.barh(places, result.total[order, k], THICK, color=SKY, zorder=2.0)
        ax.barh(places, np.maximum(result.first[order, k], 0.0), 0.4, color=BLUE, zorder=2.1)
        ax.errorbar(
            result.total[order, k],
            places,
            xerr=result.total_error[order, k],
            fmt="none",
            ecolor=INK,
            elinewidth=0.8,
            capsize=2.0,
            zorder=3.0,
        )
        ends = result.total[:, k] + result.total_error[:, k]
        ax.set_xlim(0.0, max(1.0, 1.03 * float(ends.max())))
        _name(ax, [result.levers[lever] for lever in order])
        outcome = result.outcomes[k]
        mean = outcome_text(outcome, result.mean[k])
        spread = outcome_text(outcome, result.deviation[k])
        _head(ax, f"{outcome_words(outcome)}, {mean} ± {spread} {outcome_unit(outcome).name}")
    words = f"Shares of the variance, {result.runs} runs" if title is None else title
    write_title(figure, words, 0.3)
    put_legend(
        figure,
        [
            Patch(color=SKY, label="in total"),
            Patch(color=BLUE, label="by itself"),
            Line2D([], [], color=INK, linewidth=0.8, label="95 % interval"),
        ],
        0.3,
        0.42,
    )
    return figure


def _panels(count: int, levers: int) -> tuple[Figure, list[Axes]]:
    """A figure with a panel an outcome, two beside each other."""
    columns = min(count, COLUMNS)
    rows = -(-count // columns)
    panel = levers * BAR + 0.1
    height = TOP + rows * (panel + HEAD + FOOT)
    figure = new_figure(WIDTH, height)
    width = (WIDTH - LEFT - RIGHT - BETWEEN * (columns - 1)) / columns
    panels = []
    for number in range(count):
        row, column = divmod(number, columns)
        left = LEFT + column * (width + BETWEEN)
        bottom = height - TOP - row * (panel + HEAD + FOOT) - HEAD - panel + 0.15
        ax = figure.add_axes((left / WIDTH, bottom / height, width / WIDTH, panel / height))
        dress(ax)
        panels.append(ax)
    return figure, panels


def _name(ax: Axes, levers: list[str]) -> None:
    ax.set_yticks(range(len(levers)), labels=[each.replace("_", " ") for each in levers])
    ax.set_ylim(-0.6, len(levers) - 0.4)
    ax.grid(False, axis="y")
    ax.spines["left"].set_color(FAINT)
    ax.tick_params(axis="y", length=0.0, labelsize=SMALL)


def _head(ax: Axes, words: str) -> None:
    ax.set_title(words, loc="left", fontsize=NORMAL, color=INK, pad=5.0)


def _ends(result: OneAtATime, index: int, words: str) -> str:
    """The factor of that end, if it is the same for all levers."""
    factors = {pair[index] for pair in result.ranges.values()}
    return f"factor {factors.pop():g}" if len(factors) == 1 else f"{words} factor"
