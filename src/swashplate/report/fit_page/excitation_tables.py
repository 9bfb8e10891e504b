"""Which run exercises which unknown, as a table of shares."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from swashplate.identification.assessment import Assessment
from swashplate.identification.excitation import excitation
from swashplate.report.fit_page.numbers import plain


class Share(NamedTuple):
    """A cell: what part of an unknown's information comes from a run."""

    text: str
    """Per cent, empty below 0.5 %."""
    part: str
    """0 to 1, for the cell's colour."""


class ExcitationRow(NamedTuple):
    """One unknown over all runs."""

    name: str
    change: str
    """Root mean square change of the weighted residuals for 1 % of the unknown, all runs."""
    shares: tuple[Share, ...]
    look: bool
    """Whether no run tells of it, or one alone."""


class ExcitationTable(NamedTuple):
    """The unknowns of a stage that all runs share."""

    stage: str
    runs: tuple[str, ...]
    rows: tuple[ExcitationRow, ...]
    remarks: tuple[str, ...]


def excitation_table(assessment: Assessment) -> ExcitationTable:
    """The table of a stage."""
    found = excitation(assessment.linearised)
    problem = assessment.stage.problem
    shared = [k for k, each in enumerate(problem.unknowns) if each.run is None]
    samples = np.array([run.time.size for run in assessment.linearised.runs], dtype=np.float64)
    # rows of one channel need not name it
    channels = {run.channel for run in assessment.linearised.runs}
    runs = tuple(run.label if len(channels) > 1 else run.name for run in assessment.linearised.runs)
    own = {found.names[k] for k in range(len(found.names)) if k not in shared}
    rows = []
    for k in shared:
        share = found.share[:, k]
        change = np.sqrt(samples @ found.sensitivity[:, k] ** 2 / samples.sum())
        cells = tuple(
            Share(f"{100.0 * part:.0f}" if part >= 0.005 else "", f"{part:.3f}") for part in share
        )
        alone = len(runs) > 1 and float(share.max(initial=0.0)) >= 0.9
        rows.append(
            ExcitationRow(found.names[k], plain(float(change), 2), cells, alone or not share.any())
        )
    remarks = tuple(
        words for words in found.sentences() if not any(words.startswith(f"{n}:") for n in own)
    )
    return ExcitationTable(assessment.stage.stage.name, runs, tuple(rows), remarks)
