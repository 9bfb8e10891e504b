"""Figure of many runs of several axes: a row an axis, a column a kind of manoeuvre."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.typing import ColorType

from swashplate.errors import InputError
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.report.style import (
    FAINT,
    GREY,
    INK,
    LINE,
    NORMAL,
    SMALL,
    THIN,
    Margins,
    dress,
    label_below,
    line_up_labels,
    margins,
    new_figure,
    write_title,
    zero_line,
)
from swashplate.report.traces import draw, fit_time
from swashplate.simulation.result import Simulation

WIDTH = 28.0 / 3.0
PANEL, GAP = 1.45, 0.2
AROUND = Margins(left=1.0, right=0.65, bottom=0.5, top=0.75)
"""Sizes. [inch]"""

KINDS = ("ramp", "step", "sine")
"""Kinds of manoeuvre in the order of their columns; others follow as they come."""

Cells = Mapping[str, Mapping[str, Sequence[Simulation]]]
"""Runs by axis and kind."""

_ROOM = 1.12
"""The ordinate reaches this much beyond the largest speed, and beyond ±10 V."""
_SCALE = LinearSegmentedColormap.from_list(
    "command", ("#f0b429", "#e0631a", "#b0205b", "#5b1a7a", "#1a1446")
)


def plot_maneuvers_overview(
    runs: Mapping[str, Mapping[str, Simulation]], *, title: str | None = None
) -> Figure:
    """Figure of the speeds of several axes, over thin lines of the commands.

    Parameters
    ----------
    runs : mapping
        Name of an axis to its runs, by names whose first word is the kind of manoeuvre: ``"step"``
        of ``"step +9 V"``. Runs of one kind are drawn over one another, each in the colour of its
        largest command; all commands are drawn to one scale.
    title : str, optional
        By default it says what is shown.

    Raises
    ------
    InputError
        If there is no run.
    """
    cells = {axis: _by_kind(of_axis) for axis, of_axis in runs.items() if of_axis}
    if not cells:
        raise InputError("An overview needs at least one run.")
    met = list(dict.fromkeys(kind for of_axis in cells.values() for kind in of_axis))
    kinds = [kind for kind in KINDS if kind in met] + [kind for kind in met if kind not in KINDS]
    height = AROUND.bottom + AROUND.top + len(cells) * (PANEL + GAP) - GAP
    figure = new_figure(WIDTH, height)
    lengths = [max(run.time[-1] - run.time[0] for run in _column(cells, kind)) for kind in kinds]
    width = (WIDTH - AROUND.left - AROUND.right + GAP) / len(kinds) - GAP
    axes = figure.subplots(
        len(cells),
        len(kinds),
        sharex="col",
        sharey="row",
        squeeze=False,
        gridspec_kw={
            **margins(figure, AROUND),
            "hspace": GAP / PANEL,
            "wspace": GAP / width,
            "width_ratios": np.sqrt(np.maximum(lengths, 1.0)),
        },
    )
    for row, (axis, of_axis) in zip(axes, cells.items(), strict=True):
        _fill_row(list(row), kinds, axis, of_axis)
    for column, kind in zip(axes.T, kinds, strict=True):
        column[0].set_title(kind, fontsize=NORMAL, fontweight="bold", color=INK, pad=6.0)
        label_below(column[-1], "time (s)")
        fit_time(column[-1], *(run.time for run in _column(cells, kind)))
    line_up_labels(figure, axes[:, 0], 0.45)
    write_title(figure, "Simulated shaft speed" if title is None else title, AROUND.left)
    _explain_colors(figure)
    return figure


def _by_kind(runs: Mapping[str, Simulation]) -> dict[str, list[Simulation]]:
    kinds: dict[str, list[Simulation]] = {}
    for name, run in runs.items():
        kinds.setdefault(name.split()[0] if name.split() else "", []).append(run)
    return kinds


def _column(cells: Cells, kind: str) -> list[Simulation]:
    return [run for of_axis in cells.values() for run in of_axis.get(kind, ())]


def _fill_row(
    row: Sequence[Axes], kinds: Sequence[str], axis: str, runs: Mapping[str, Sequence[Simulation]]
) -> None:
    """Draw the runs of one axis, all to the same scales of speed and voltage."""
    fastest = max(float(np.abs(run.shaft_speed).max()) for each in runs.values() for run in each)
    bound = _ROOM * (float(np.degrees(fastest)) or 1.0)
    speed_per_volt = bound / (_ROOM * FULL_VOLTAGE)
    for ax, kind in zip(row, kinds, strict=True):
        dress(ax)
        zero_line(ax)
        ax.set_ylim(-bound, bound)
        for run, width in _widths(runs.get(kind, ())):
            if run.voltage is not None:
                draw(ax, run.time, speed_per_volt * run.voltage, FAINT, width=0.7, zorder=1.8)
            draw(ax, run.time, np.degrees(run.shaft_speed), _color(run), width=width)
    row[0].set_ylabel("speed (deg/s)", fontsize=NORMAL, color=INK)
    row[0].annotate(
        axis,
        (0.0, 0.5),
        xycoords="axes fraction",
        xytext=(-0.78 * 72.0, 0.0),
        textcoords="offset points",
        rotation=90.0,
        ha="center",
        va="center",
        fontsize=NORMAL,
        fontweight="bold",
        color=INK,
    )
    volts = row[-1].secondary_yaxis(
        "right",
        functions=(
            lambda y: np.asarray(y) / speed_per_volt,
            lambda v: np.asarray(v) * speed_per_volt,
        ),
    )
    volts.set_yticks([-FULL_VOLTAGE, 0.0, FULL_VOLTAGE])
    volts.tick_params(length=3.0, width=0.6, color=FAINT, labelsize=SMALL, labelcolor=GREY)
    volts.spines["right"].set_color(FAINT)
    volts.set_ylabel("command (V)", fontsize=NORMAL, color=GREY)


def _widths(runs: Sequence[Simulation]) -> list[tuple[Simulation, float]]:
    """The runs with the widths of their lines, the largest command first.

    So what is smaller lies over it and stays visible. A run of the same extremes as one before it,
    such as a sine of another frequency, has the same colour and is therefore drawn thinner.
    """
    widths = []
    met: set[tuple[float, float]] = set()
    for run in runs:
        volts = np.zeros(1) if run.voltage is None else run.voltage
        extremes = (round(float(volts.min()), 1), round(float(volts.max()), 1))
        widths.append((run, THIN if extremes in met else LINE))
        met.add(extremes)
    return sorted(widths, key=lambda pair: _largest_command(pair[0]), reverse=True)


def _largest_command(run: Simulation) -> float:
    """The largest voltage either way; that of a run driven by current counts as none. [V]"""
    return 0.0 if run.voltage is None else float(np.abs(run.voltage).max())


def _color(run: Simulation) -> ColorType:
    return _SCALE(_largest_command(run) / FULL_VOLTAGE)


def _explain_colors(figure: Figure) -> None:
    """A bar of the colours, in the upper right corner."""
    width, height = figure.get_size_inches()
    left = width - AROUND.right - 1.6
    ax = figure.add_axes((left / width, 1.0 - 0.25 / height, 1.6 / width, 0.09 / height))
    bar = figure.colorbar(
        ScalarMappable(Normalize(0.0, FULL_VOLTAGE), _SCALE), cax=ax, orientation="horizontal"
    )
    bar.set_ticks([0.0, 2.0, 4.0, 6.0, 8.0, 10.0])
    bar.outline.set_visible(False)
    ax.tick_params(length=2.0, width=0.6, color=FAINT, labelsize=SMALL, labelcolor=INK, pad=1.5)
    ax.annotate(
        "line colour: largest command (V)",
        (0.0, 0.5),
        xycoords="axes fraction",
        xytext=(-6.0, 0.0),
        textcoords="offset points",
        ha="right",
        va="center",
        fontsize=SMALL,
        color=INK,
    )
