"""Figure of what drives settle at: steady current and speed over the command."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.report.steady_table import LEFT, ROW_HEIGHT, creep_words, full_speed, write_table
from swashplate.report.steady_values import Array, SteadyValues, steady_values
from swashplate.report.style import (
    FAINT,
    GREY,
    INK,
    LINE,
    NORMAL,
    SMALL,
    Margins,
    Stroke,
    dress,
    label_below,
    line_up_labels,
    margins,
    new_figure,
    signed,
    strokes,
    write_title,
    zero_line,
)

WIDTH = 8.6
PANEL, GAP = 2.2, 0.25
AROUND = Margins(left=LEFT, right=0.2, bottom=0.5, top=0.95)
"""Sizes; the rows of the table add to the margin at the top. [inch]"""

CLOSE_UP = 1.0
"""The panels on the right show the map between minus and plus this command. [V]"""

WIDER, WIDEST = 0.7, 3.4
"""How much wider than the next one a curve is drawn, and the limit to that. [pt]"""
DOT = 4.5
"""Size of a dot. [pt]"""

_SAME_SCALE = 5.0
"""Drives share a panel of speed if their full speeds differ by no more than this factor."""

Values = Mapping[str, SteadyValues]
"""What drives settle at, by name."""


def plot_steady_map(drives: Mapping[str, Drive], *, title: str | None = None) -> Figure:
    """Figure of steady current and steady speed from -10 to 10 V, with a close-up around 0 V.

    Bars span the dead zones, dots mark where the speed saturates and the creep at 0 V; a table
    says the same in numbers. Drives whose speeds are of another size have panels of their own.

    Parameters
    ----------
    drives : mapping
        Name to drive.
    title : str, optional
        By default it says what is shown.

    Raises
    ------
    InputError
        If there is no drive.
    """
    if not drives:
        raise InputError("A steady map needs at least one drive.")
    values = {name: steady_values(drive) for name, drive in drives.items()}
    looks = strokes(drives)
    groups = of_similar_speed(values)
    rows = 1 + len(groups)
    around = AROUND._replace(top=AROUND.top + ROW_HEIGHT * len(drives))
    figure = new_figure(WIDTH, around.bottom + around.top + rows * (PANEL + GAP) - GAP)
    axes = figure.subplots(
        rows,
        2,
        sharex="col",
        squeeze=False,
        gridspec_kw={
            **margins(figure, around),
            "hspace": GAP / PANEL,
            "wspace": 0.2,
            "width_ratios": (1.75, 1.0),
        },
    )
    for ax in axes.flat:
        dress(ax)
        zero_line(ax)
        ax.axvline(0.0, color=FAINT, linewidth=0.8, zorder=1.2)
    _fill(axes[0], "steady current (A)", {n: (v, v.current) for n, v in values.items()}, looks)
    for row, names in zip(axes[1:], groups, strict=True):
        curves = {name: (values[name], values[name].speed_deg_s) for name in names}
        _fill(row, "steady speed (deg/s)", curves, looks)
        _mark_speeds(row, names, values, looks)
    _name_dead_zones(axes[0, 1], values.values())
    axes[0, 0].set_xlim(-FULL_VOLTAGE, FULL_VOLTAGE)
    axes[0, 1].set_xlim(-CLOSE_UP, CLOSE_UP)
    axes[0, 1].set_title("close-up around 0 V", fontsize=SMALL, color=GREY, loc="left", pad=4.0)
    for ax in axes[-1]:
        label_below(ax, "command (V)")
    line_up_labels(figure, axes[:, 0], 0.52)
    words = "Steady current and speed over the command" if title is None else title
    write_title(figure, words, AROUND.left)
    write_table(figure, values, looks)
    return figure


def of_similar_speed(values: Values) -> list[list[str]]:
    """Names in groups, each with the first group whose first drive is about as fast."""
    groups: list[list[str]] = []
    for name, each in values.items():
        for group in groups:
            ratio = full_speed(each) / full_speed(values[group[0]])
            if 1.0 / _SAME_SCALE <= ratio <= _SAME_SCALE:
                group.append(name)
                break
        else:
            groups.append([name])
    return groups


def _fill(
    row: Sequence[Axes],
    label: str,
    curves: Mapping[str, tuple[SteadyValues, Array]],
    looks: Mapping[str, Stroke],
) -> None:
    """Draw the curves in both panels of a row, and the dead zones along the bottom of one."""
    row[0].set_ylabel(label, fontsize=NORMAL, color=INK)
    wide, close = 0.0, 0.0
    for index, (name, (values, heights)) in enumerate(curves.items()):
        look = looks[name]
        # the wider first, so that curves which lie on one another can be told
        width = min(LINE + WIDER * (len(curves) - 1 - index), WIDEST)
        for ax in row:
            ax.plot(
                values.voltage, heights, color=look.color, linestyle=look.dashes, linewidth=width
            )
        row[1].plot(
            values.dead_zone,
            [0.04 + 0.045 * index] * 2,
            transform=row[1].get_xaxis_transform(),
            color=look.color,
            linewidth=3.0,
            solid_capstyle="butt",
            label=f"dead zone {name}",
        )
        wide = max(wide, float(np.abs(heights).max()))
        inside = np.abs(values.voltage) <= CLOSE_UP
        close = max(close, float(np.abs(heights[inside]).max()))
    row[0].set_ylim(-1.08 * (wide or 1.0), 1.08 * (wide or 1.0))
    row[1].set_ylim(-1.3 * (close or 1.0), 1.15 * (close or 1.0))


def _name_dead_zones(ax: Axes, values: Iterable[SteadyValues]) -> None:
    zones = [each.dead_zone for each in values]
    widest = max(high for _, high in zones)
    if any(low < high for low, high in zones) and widest < 0.5 * CLOSE_UP:
        ax.annotate(
            "dead zone",
            (widest, 0.04),
            xycoords=ax.get_xaxis_transform(),
            xytext=(5.0, 0.0),
            textcoords="offset points",
            fontsize=SMALL,
            color=GREY,
            va="center",
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
        )


def _mark_speeds(
    row: Sequence[Axes], names: Sequence[str], all_values: Values, looks: Mapping[str, Stroke]
) -> None:
    """Dots where speeds saturate and, in the close-up, at the creep; numbers where there is room.

    A number is written for the one drive that saturates on a side and for the one that creeps
    most; the table has all.
    """
    values = {name: all_values[name] for name in names}
    for side in (0, 1):
        saturated = {n: v.saturation[side] for n, v in values.items()}
        only = sum(volts is not None for volts in saturated.values()) == 1
        for name, volts in saturated.items():
            if volts is None:
                continue
            color = looks[name].color
            speed = float(np.interp(volts, values[name].voltage, values[name].speed_deg_s))
            row[0].plot([volts], [speed], "o", color=color, markersize=DOT)
            if only:
                place = (FULL_VOLTAGE if side else -FULL_VOLTAGE, speed)
                _write(row[0], f"{signed(volts, 2)} V", place, -5.0 if side else 5.0, color)
    most = max(values, key=lambda name: abs(values[name].creep_deg_s))
    for name, each in values.items():
        color = looks[name].color
        row[1].plot([0.0], [each.creep_deg_s], "o", color=color, markersize=DOT)
        if name == most and each.creep_deg_s != 0.0:
            words = f"creep {creep_words(each)} deg/s"
            _write(row[1], words, (0.0, each.creep_deg_s), 5.0, color, right=True)


def _write(
    ax: Axes,
    words: str,
    place: tuple[float, float],
    above: float,
    color: str,
    *,
    right: bool | None = None,
) -> None:
    """Write words some points above or below a place, ending there if it is on the right."""
    right = place[0] > 0.0 if right is None else right
    ax.annotate(
        words,
        place,
        xytext=(-3.0 if right else 3.0, above),
        textcoords="offset points",
        ha="right" if right else "left",
        va="bottom" if above > 0.0 else "top",
        fontsize=SMALL,
        color=color,
    )
