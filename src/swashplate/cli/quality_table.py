"""The tables of ``swashplate campaign check``."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import degrees, isnan
from typing import TYPE_CHECKING

from swashplate.cli.terminal import table

if TYPE_CHECKING:
    from rich.table import Table

    from swashplate.campaign import Campaign, Experiment, Quality

LINE, BETWEEN = 80, 2
"""Characters of a line, and those between two columns."""
COLUMNS = ("signal", ">Hz", ">jitter", ">gap", "range", ">clip", ">stuck", ">lost")

LEGEND = (
    "jitter and longest gap in ms; clip: % of the samples at the ends of the instrument's range;\n"
    "stuck: longest standstill of a noisy signal in s; lost: jumps that no motion explains"
)


def widths_of(runs: Iterable[Sequence[Quality]]) -> list[int]:
    """Widths of the columns that fit all runs, so that they stand one above the other.

    The first is at most what the others leave of a line.
    """
    rows = [[head.removeprefix(">") for head in COLUMNS]]
    rows += [_cells(each) for found in runs for each in found]
    names, *others = (max(map(len, column)) for column in zip(*rows, strict=True))
    left = LINE - sum(others) - BETWEEN * len(others)
    return [max(min(names, left), len(COLUMNS[0])), *others]


def quality_table(
    experiment: Experiment, qualities: Sequence[Quality], widths: Sequence[int]
) -> Table:
    """The signals of one experiment, in columns of the widths of `widths_of`."""
    stamps = qualities[0].stamps
    made = table(
        f"{experiment.name}: {experiment.maneuver}, to {experiment.role}, "
        f"{experiment.duration:.4g} s, {stamps.rows} samples",
        *COLUMNS,
        wrap="signal",
    )
    for column, width in zip(made.columns, widths, strict=True):
        column.width = width
    made.columns[0].overflow = "fold"  # a name that is too long goes on in the next line
    for each in qualities:
        made.add_row(*_cells(each))
    return made


def _cells(quality: Quality) -> list[str]:
    stamps = quality.stamps
    return [
        quality.signal,
        f"{stamps.rate:.4g}",
        _milliseconds(stamps.jitter),
        _milliseconds(stamps.longest) if stamps.gaps.size else "-",
        _range(quality),
        "" if isnan(quality.clipped) else f"{100.0 * quality.clipped:.2g}",
        "" if quality.stuck is None else f"{quality.stuck:.2f}",
        "" if quality.lost_counts is None else f"{quality.lost_counts}",
    ]


def _milliseconds(seconds: float) -> str:
    return f"{round(1e3 * seconds, 4):.3g}"


def _range(quality: Quality) -> str:
    low, high, unit = quality.low, quality.high, quality.unit
    if unit in ("rad", "rad/s"):
        low, high, unit = degrees(low), degrees(high), unit.replace("rad", "deg")
    elif unit == "Pa":
        low, high, unit = low / 1e5, high / 1e5, "bar"
    elif unit in ("m", "m/s"):
        low, high, unit = 1e3 * low, 1e3 * high, "m" + unit
    return f"{low:z.4g} to {high:z.4g} {unit}".removesuffix(" 1")


def heading(campaign: Campaign) -> str:
    """Title, number of experiments and their roles."""
    roles = [each.role for each in campaign]
    counted = ", ".join(f"{roles.count(role)} to {role}" for role in dict.fromkeys(roles))
    virtual = " (virtual)" if campaign.virtual else ""
    return f"{campaign.title}{virtual}: {len(campaign)} experiments ({counted})"
