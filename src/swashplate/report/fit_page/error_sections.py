"""The source's error tables for the report: the largest per cent error by kind of test."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from swashplate.identification.validation import ErrorTable, Rule, error_tables
from swashplate.report.fit_page.numbers import listed
from swashplate.report.fit_page.runs import ShownRun


class ErrorSection(NamedTuple):
    """The table of one quantity."""

    quantity: str
    """``"current"``, ``"speed from counts"``."""
    role: str
    """``"fit"`` or ``"validate"``."""
    table: ErrorTable
    remarks: tuple[str, ...]


def error_sections(runs: Sequence[ShownRun], rules: Sequence[Rule]) -> tuple[ErrorSection, ...]:
    """A table for each channel, of the fitted runs and of those held out."""
    keys = dict.fromkeys((run.role, each.stage) for run in runs for each in run.channels)
    sections = []
    for role, stage in keys:
        alike = [
            each.quality
            for run in runs
            for each in run.channels
            if (run.role, each.stage) == (role, stage)
        ]
        sections += [
            ErrorSection(found.channel, role, found, error_remarks(found))
            for found in error_tables(alike, rules)
        ]
    return tuple(sections)


def error_remarks(found: ErrorTable) -> tuple[str, ...]:
    """What must be known of a table besides its rules."""
    remarks = []
    if found.average:
        remarks.append(
            f"Differences of currents are averaged over {found.average:g} s: they dither."
        )
    if found.channel.startswith("speed from "):
        remarks.append("Measured and simulated positions are filtered alike to become speeds.")
    if found.unjudged:
        remarks.append(f"Neither ramp, step nor sine, or too short: {listed([*found.unjudged])}.")
    return tuple(remarks)
