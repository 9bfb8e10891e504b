"""The tables of ``swashplate campaign check``."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, isnan
from typing import TYPE_CHECKING

from swashplate.cli.terminal import table

if TYPE_CHECKING:
    from rich.table import Table

    from swashplate.campaign.campaign import Campaign
    from swashplate.campaign.experiment import Experiment
    from swashplate.campaign.quality import Quality

WIDTHS = {
    "signal": 13,
    ">Hz": 6,
    ">jitter": 6,
    ">gap": 6,
    "range": 20,
    ">clip": 5,
    ">stuck": 5,
    ">lost": 4,
}
"""Columns of the check, the same in each run's table, so that all stand one above the other."""


LEGEND = (
    "jitter and longest gap in ms; clip: % of the samples at the ends of the instrument's range;\n"
    "stuck: longest standstill of a noisy signal in s; lost: jumps that no motion explains"
)


def quality_table(experiment: Experiment, qualities: Sequence[Quality], *, header: bool) -> Table:
    """The signals of one experiment; all tables have the same widths."""
    stamps = qualities[0].stamps
    made = table(
        f"{experiment.name}: {experiment.maneuver}, to {experiment.role}, "
        f"{experiment.duration:.4g} s, {stamps.rows} samples",
        *WIDTHS,
        wrap="signal",
    )
    made.show_header = header
    for column, width in zip(made.columns, WIDTHS.values(), strict=True):
        column.width = width
    for each in qualities:
        made.add_row(
            each.signal,
            f"{each.stamps.rate:.4g}",
            _milliseconds(each.stamps.jitter),
            _milliseconds(each.stamps.longest) if each.stamps.gaps.size else "-",
            _range(each),
            "" if isnan(each.clipped) else f"{100.0 * each.clipped:.2g}",
            "" if each.stuck is None else f"{each.stuck:.2f}",
            "" if each.lost_counts is None else f"{each.lost_counts}",
        )
    return made


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
