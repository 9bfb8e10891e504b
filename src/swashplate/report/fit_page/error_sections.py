"""The source's error tables for the report: the largest per cent error by kind of test."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, get_args

from swashplate.identification.error_tables import ErrorTable, error_table
from swashplate.identification.exclusions import ComparedRun, Kind, Quantity
from swashplate.report.fit_page.numbers import listed
from swashplate.report.fit_page.runs import Shown, ShownRun

DITHER_MEAN = 0.1
"""Width of the moving mean over a current's differences, against the dither. [s]"""


class ErrorSection(NamedTuple):
    """The table of one quantity."""

    quantity: str
    """``"current"``, ``"speed from counts"``."""
    role: str
    """``"fit"`` or ``"validate"``."""
    table: ErrorTable
    remarks: tuple[str, ...]


def error_sections(runs: Sequence[ShownRun]) -> tuple[ErrorSection, ...]:
    """A table for each channel, of the fitted runs and of those held out."""
    keys = dict.fromkeys(
        (run.role, each.stage, each.quality.channel)
        for run in runs
        for each in run.channels
        # a per cent of a position, whose zero is free, means nothing
        if not each.channel.is_position
    )
    sections = []
    for role, stage, channel in keys:
        alike = [
            (run, each)
            for run in runs
            for each in run.channels
            if (run.role, each.stage, each.quality.channel) == (role, stage, channel)
        ]
        section = _section(role, channel, alike)
        if section is not None:
            sections.append(section)
    return tuple(sections)


def _section(role: str, name: str, alike: Sequence[tuple[ShownRun, Shown]]) -> ErrorSection | None:
    compared, unjudged = [], []
    for run, shown in alike:
        made = _compared(run, shown)
        if made is None:
            unjudged.append(run.experiment.name)
        else:
            compared.append(made)
    if not compared:
        return None
    channel = alike[0][1].channel
    remarks = []
    average = DITHER_MEAN if channel.unit == "A" else 0.0
    if average:
        remarks.append(f"Differences of currents are averaged over {average:g} s: they dither.")
    if name.startswith("speed from "):
        remarks.append("Measured and simulated positions are filtered alike to become speeds.")
    if unjudged:
        remarks.append(f"Neither ramp, step nor sine, or too short: {listed(unjudged)}.")
    table = error_table(compared, average=average)
    return ErrorSection(name, role, table, tuple(remarks))


def _compared(run: ShownRun, shown: Shown) -> ComparedRun | None:
    """A run as the table takes it, None if it belongs to none of its kinds."""
    recognised, channel = run.experiment.recognised, shown.channel
    word = run.experiment.maneuver.split(" ")[0]
    kind = next((each for each in get_args(Kind) if each == word), None)
    if kind is None or channel.time.size < 8:
        return None
    quantity: Quantity = "other"
    if channel.kind in ("rectified_current", "shaft_speed"):
        quantity = "rectified_current" if channel.kind == "rectified_current" else "shaft_speed"
    used = channel.used
    if not used.any():
        return None
    time = channel.time[used]
    return ComparedRun(
        run.experiment.name,
        kind,
        quantity,
        time,
        run.experiment.input.at(time),
        channel.values[used],
        shown.quality.simulated[used],
        recognised.frequency if recognised is not None else None,
    )
