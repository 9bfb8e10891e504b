"""Pages of a campaign's measured signals: a row a run, a column a signal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from swashplate.errors import InputError
from swashplate.report.campaign_columns import Column, columns_of
from swashplate.report.campaign_marks import mark_handles
from swashplate.report.campaign_row import PANEL, fill_row
from swashplate.report.style import (
    INK,
    NORMAL,
    SMALL,
    Margins,
    label_below,
    margins,
    new_figure,
    put_legend,
    write_title,
)

if TYPE_CHECKING:
    from swashplate.campaign import Experiment

RUNS = 8
"""Runs on a page: with more, panels are too low to read or the page too high to print."""
WIDTH, NARROWEST = 8.6, 1.75
GAP, BETWEEN = 0.47, 0.55
AROUND = Margins(left=0.65, right=0.25, bottom=0.5, top=1.25)
"""Sizes: of the page and its panels, the gaps below and beside them, and the margins. [inch]"""


def plot_campaign(experiments: Iterable[Experiment], *, title: str | None = None) -> list[Figure]:
    """Figures of everything that was measured: a page for each axis and eight of its runs.

    A row is a run: over it its name, manoeuvre, role, rate and gaps; its input and channels side by
    side. A column has one unit and one scale; positions, whose zero is free, have it about the
    middle of each run. What is ignored is shaded and hatched, weights that differ stand along the
    foot with their factors, samples at the end of their instrument's range are barred, gaps in the
    stamps leave the line open and are pointed at.

    Parameters
    ----------
    experiments : iterable of Experiment
        Of one axis or more, in the order of their rows.
    title : str, optional
        The campaign's; the axis and the page are added.

    Returns
    -------
    list of Figure
        Page after page, axis after axis.

    Raises
    ------
    InputError
        If there is no experiment.

    Notes
    -----
    A line of more than 2000 samples is drawn by the lowest and the highest sample in each of 1000
    stretches of time (`broken_lines.thinned`), and as a line also in SVG and PDF.
    """
    axes: dict[str, list[Experiment]] = {}
    for each in experiments:
        axes.setdefault(each.axis, []).append(each)
    if not axes:
        raise InputError("A page of a campaign needs at least one experiment.")
    figures = []
    for axis, of_axis in axes.items():
        columns = columns_of(of_axis)
        pages = [of_axis[first : first + RUNS] for first in range(0, len(of_axis), RUNS)]
        for number, page in enumerate(pages, start=1):
            words = f"{title or 'Measured tests'}: {axis}"
            if len(pages) > 1:
                words += f", page {number} of {len(pages)}"
            figures.append(_page(page, columns, words))
    return figures


def _page(experiments: Sequence[Experiment], columns: Sequence[Column], title: str) -> Figure:
    rows, across = len(experiments), len(columns)
    least = AROUND.left + AROUND.right + across * (NARROWEST + BETWEEN) - BETWEEN
    width = max(WIDTH, least)
    height = AROUND.bottom + AROUND.top + rows * (PANEL + GAP) - GAP
    panel = (width - AROUND.left - AROUND.right + BETWEEN) / across - BETWEEN
    figure = new_figure(width, height)
    grid = figure.subplots(
        rows,
        across,
        sharex="row",
        squeeze=False,
        gridspec_kw={**margins(figure, AROUND), "hspace": GAP / PANEL, "wspace": BETWEEN / panel},
    )
    for row, experiment in zip(grid, experiments, strict=True):
        fill_row(list(row), columns, experiment)
    for ax, column in zip(grid[0], columns, strict=True):
        _head(ax, column, panel + 0.8 * BETWEEN)
    for ax in grid[-1]:
        label_below(ax, "time (s)")
    write_title(figure, title, 0.2)
    reasons = [why for each in experiments for _, _, why in each.ignored]
    handles = mark_handles(list(grid.flat), reasons)
    if handles:
        put_legend(figure, handles, 0.2, 0.44)
    return figure


def _head(ax: Axes, column: Column, room: float) -> None:
    """Write the name of a column and what it shows above the heading of the first run.

    Both are cut to the room they have [inch].
    """
    for text, lift, weight, size, letter in (
        (column.name, 36.0, "bold", NORMAL, 0.085),
        (column.words, 25.0, "normal", SMALL, 0.066),
    ):
        most = int(room / letter)
        ax.annotate(
            text if len(text) <= most else f"{text[: most - 1]}…",
            (0.0, 1.0),
            xycoords="axes fraction",
            xytext=(0.0, lift),
            textcoords="offset points",
            fontsize=size,
            fontweight=weight,
            color=INK,
            va="baseline",
        )
