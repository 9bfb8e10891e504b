"""Figure of what drives settle at: steady current and speed over the command."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from swashplate.analysis import dead_zone, saturation
from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.report.style import (
    FOOT,
    GAP,
    GREY,
    HEAD,
    INK,
    LINE,
    NORMAL,
    SMALL,
    WIDTH,
    Stroke,
    dress,
    label_below,
    new_figure,
    signed,
    strokes,
    write,
    write_title,
    zero_line,
)
from swashplate.units import display_unit

Array = NDArray[np.float64]

POINTS = 2001
"""Commands of a curve, besides those on both sides of the card's dead zone."""


class SteadyValues(NamedTuple):
    """Steady state over the command."""

    voltage: Array
    """[V]"""
    current: Array
    """Signed. [A]"""
    speed: Array
    """[rad/s]"""
    dead_zone: tuple[float, float]
    """Commands between which the current stays within the solenoids' dead zone. [V]"""
    saturation: tuple[float | None, float | None]
    """Commands beyond which the speed stays as it is, None where it changes up to ±10 V. [V]"""
    creep: float
    """Speed at 0 V. [rad/s]"""


def steady_values(drive: Drive) -> SteadyValues:
    """Steady states of a drive from -10 to 10 V."""
    voltage = _commands(drive)
    return SteadyValues(
        voltage,
        drive.steady_current(voltage),
        drive.steady_speed(voltage),
        (dead_zone(drive, -1.0).inside, dead_zone(drive, 1.0).inside),
        (saturation(drive, -1.0), saturation(drive, 1.0)),
        float(drive.steady_speed(0.0)),
    )


def _commands(drive: Drive) -> Array:
    """Commands close together, with the jump of the current as upright as it is."""
    numbers = drive.parameters.numbers
    plus, minus = numbers["V_dz_plus"], numbers["V_dz_minus"]
    jumps = (plus, np.nextafter(plus, np.inf), -minus, np.nextafter(-minus, -np.inf))
    even = np.linspace(-FULL_VOLTAGE, FULL_VOLTAGE, POINTS)
    return np.unique(np.clip(np.concatenate((even, jumps)), -FULL_VOLTAGE, FULL_VOLTAGE))


# --- figure ---------------------------------------------------------------------------------------

PANEL, TABLE_ROW = 2.2, 0.2
"""Heights of a panel and of a row of the table. [inch]"""
LONGEST = 26
"""Letters of a name that there is room for."""
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
    looks, speed = strokes(drives), display_unit("rad/s")
    groups = of_similar_speed(values)
    rows = 1 + len(groups)
    table = TABLE_ROW * (len(drives) + 1) + 0.1
    figure = new_figure(WIDTH, HEAD + table + rows * (PANEL + GAP) + FOOT)
    heights = [table, *([PANEL] * rows)]
    how = {"height_ratios": heights, "width_ratios": (1.75, 1.0)}
    grid = figure.add_gridspec(rows + 1, 2, **how)
    axes = np.empty((rows, 2), dtype=object)
    for row in range(rows):
        for column in range(2):
            shared = axes[0, column] if row else None
            axes[row, column] = figure.add_subplot(grid[row + 1, column], sharex=shared)
            dress(axes[row, column])
            zero_line(axes[row, column], upright=True)
            axes[row, column].tick_params(labelbottom=row == rows - 1)
    _fill(axes[0], "steady current (A)", {n: (v, v.current) for n, v in values.items()}, looks)
    for panels, names in zip(axes[1:], groups, strict=True):
        curves = {name: (values[name], speed.factor * values[name].speed) for name in names}
        _fill(panels, speed.label("steady speed"), curves, looks)
        _mark_speeds(panels, names, values, looks)
    _name_dead_zones(axes[0, 1], values.values())
    axes[0, 0].set_xlim(-FULL_VOLTAGE, FULL_VOLTAGE)
    axes[0, 1].set_xlim(-CLOSE_UP, CLOSE_UP)
    axes[0, 1].set_title("close-up around 0 V", fontsize=SMALL, color=GREY, loc="left", pad=4.0)
    for ax in axes[-1]:
        label_below(ax, "command (V)")
    figure.align_ylabels(list(axes[:, 0]))
    write_title(figure, "Steady current and speed over the command" if title is None else title)
    _write_table(figure.add_subplot(grid[0, :]), values, looks)
    return figure


def _write_table(ax: Axes, values: Values, looks: Mapping[str, Stroke]) -> None:
    """What the dots and bars show, in numbers; its first column is the legend."""
    ax.axis("off")
    unit = display_unit("rad/s").name
    heads = (
        "",
        "▬ dead zone (V)",
        "● speed saturates at (V)",
        f"full speed ({unit})",
        f"● creep at 0 V ({unit})",
    )
    places = (0.04, 0.27, 0.44, 0.66, 0.83)
    rows = [heads, *(_cells(name, each) for name, each in values.items())]
    for number, row in enumerate(rows):
        height = 1.0 - (number + 0.5) / len(rows)
        for place, words in zip(places, row, strict=True):
            color = INK if number else GREY
            write(ax, words, (place, height), (0.0, 0.0), color=color, va="center")
        if number:
            color, dashes = looks[list(values)[number - 1]]
            how: dict[str, Any] = {"color": color, "linestyle": dashes, "linewidth": 2.0}
            ax.plot([0.0, 0.03], [height] * 2, transform=ax.transAxes, **how)


def _cells(name: str, values: SteadyValues) -> tuple[str, ...]:
    decimals, factor = _decimals(values), display_unit("rad/s").factor
    below, above = ("never" if v is None else signed(v, 2) for v in values.saturation)
    low, high = values.dead_zone
    ends = (signed(factor * values.speed[place], decimals) for place in (0, -1))
    return (
        name if len(name) <= LONGEST else name[: LONGEST - 1] + "…",
        f"{signed(low, 2)} to {signed(high, 2)}" if low < high else "none",
        "not within ±10" if below == above == "never" else f"{below} and {above}",
        " and ".join(ends),
        creep_words(values),
    )


def _decimals(values: SteadyValues) -> int:
    return 1 if display_unit("rad/s").factor * full_speed(values) >= 20.0 else 2


def creep_words(values: SteadyValues) -> str:
    """The creep as the table writes it."""
    return signed(display_unit("rad/s").factor * values.creep, _decimals(values))


def full_speed(values: SteadyValues) -> float:
    """The largest speed either way, 1 for a drive that never moves. [rad/s]"""
    return float(np.abs(values.speed).max()) or 1.0


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
            how: dict[str, Any] = {
                "color": look.color,
                "linestyle": look.dashes,
                "linewidth": width,
            }
            ax.plot(values.voltage, heights, **how)
        bar: dict[str, Any] = {"color": look.color, "linewidth": 3.0, "solid_capstyle": "butt"}
        foot = row[1].get_xaxis_transform()
        row[1].plot(values.dead_zone, [0.04 + 0.045 * index] * 2, transform=foot, **bar)
        wide = max(wide, float(np.abs(heights).max()))
        inside = np.abs(values.voltage) <= CLOSE_UP
        close = max(close, float(np.abs(heights[inside]).max()))
    row[0].set_ylim(-1.08 * (wide or 1.0), 1.08 * (wide or 1.0))
    row[1].set_ylim(-1.3 * (close or 1.0), 1.15 * (close or 1.0))


def _name_dead_zones(ax: Axes, values: Iterable[SteadyValues]) -> None:
    zones = [each.dead_zone for each in values]
    widest = max(high for _, high in zones)
    if any(low < high for low, high in zones) and widest < 0.5 * CLOSE_UP:
        how: dict[str, Any] = {"coords": ax.get_xaxis_transform(), "color": GREY, "va": "center"}
        box = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
        write(ax, "dead zone", (widest, 0.04), (5.0, 0.0), bbox=box, **how)


def _mark_speeds(
    row: Sequence[Axes], names: Sequence[str], all_values: Values, looks: Mapping[str, Stroke]
) -> None:
    """Dots where speeds saturate and, in the close-up, at the creep; numbers where there is room.

    A number is written for the one drive that saturates on a side and for the one that creeps
    most; the table has all.
    """
    values, unit = {name: all_values[name] for name in names}, display_unit("rad/s")
    for side in (0, 1):
        saturated = {n: v.saturation[side] for n, v in values.items()}
        only = sum(volts is not None for volts in saturated.values()) == 1
        for name, volts in saturated.items():
            if volts is None:
                continue
            color = looks[name].color
            speed = unit.factor * float(np.interp(volts, values[name].voltage, values[name].speed))
            row[0].plot([volts], [speed], "o", color=color, markersize=DOT)
            if only:
                place = (FULL_VOLTAGE if side else -FULL_VOLTAGE, speed)
                shift, ha, va = (
                    ((-3.0, -5.0), "right", "top") if side else ((3.0, 5.0), "left", "bottom")
                )
                words = f"{signed(volts, 2)} V"
                write(row[0], words, place, shift, coords="data", color=color, ha=ha, va=va)
    most = max(values, key=lambda name: abs(values[name].creep))
    for name, each in values.items():
        color, creep = looks[name].color, unit.factor * each.creep
        row[1].plot([0.0], [creep], "o", color=color, markersize=DOT)
        if name == most and creep != 0.0:
            words, how = f"creep {creep_words(each)} {unit.name}", {"ha": "right", "va": "bottom"}
            write(row[1], words, (0.0, creep), (-3.0, 5.0), coords="data", color=color, **how)
