"""Table above the steady map: the legend, and what dots and bars show, in numbers."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from swashplate.report.steady_values import SteadyValues
from swashplate.report.style import GREY, INK, SMALL, Stroke, signed

LEFT, TOP, ROW_HEIGHT = 0.85, 0.45, 0.18
"""Place and size. [inch]"""
LONGEST = 26
"""Letters of a name that there is room for."""

COLUMNS = (
    ("▬ dead zone (V)", 2.75),
    ("● speed saturates at (V)", 4.05),
    ("full speed (deg/s)", 5.75),
    ("● creep at 0 V (deg/s)", 7.05),
)
"""Heads of the table's columns and where they begin. [inch]"""


def write_table(
    figure: Figure, values: Mapping[str, SteadyValues], looks: Mapping[str, Stroke]
) -> None:
    """What the dots and bars show, in numbers; its first column is the legend."""
    width, height = figure.get_size_inches()
    for head, left in COLUMNS:
        figure.text(left / width, 1 - TOP / height, head, fontsize=SMALL, color=GREY, va="top")
    for index, (name, each) in enumerate(values.items()):
        middle = 1.0 - (TOP + ROW_HEIGHT * (index + 1) + 0.06) / height
        look = looks[name]
        figure.add_artist(
            Line2D(
                [LEFT / width, (LEFT + 0.22) / width],
                [middle, middle],
                color=look.color,
                linestyle=look.dashes,
                linewidth=2.0,
            )
        )
        lefts = [LEFT + 0.3, *(left for _, left in COLUMNS)]
        for left, cell in zip(lefts, _cells(name, each), strict=True):
            figure.text(left / width, middle, cell, fontsize=SMALL, color=INK, va="center")


def _cells(name: str, values: SteadyValues) -> list[str]:
    slowest, fastest = values.speed_deg_s[0], values.speed_deg_s[-1]
    decimals = _decimals(values)
    below, above = ("never" if v is None else signed(v, 2) for v in values.saturation)
    low, high = values.dead_zone
    return [
        name if len(name) <= LONGEST else name[: LONGEST - 1] + "…",
        f"{signed(low, 2)} to {signed(high, 2)}" if low < high else "none",
        "not within ±10" if below == above == "never" else f"{below} and {above}",
        f"{signed(slowest, decimals)} and {signed(fastest, decimals)}",
        creep_words(values),
    ]


def _decimals(values: SteadyValues) -> int:
    return 1 if full_speed(values) >= 20.0 else 2


def creep_words(values: SteadyValues) -> str:
    """The creep as the table writes it."""
    return signed(values.creep_deg_s, _decimals(values))


def full_speed(values: SteadyValues) -> float:
    """The largest speed either way, 1 for a drive that never moves. [deg/s]"""
    return float(np.abs(values.speed_deg_s).max()) or 1.0
