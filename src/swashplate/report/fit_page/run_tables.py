"""Tables of runs: how good each one is simulated, and what its data are like."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from swashplate.campaign import Experiment, Quality, examine
from swashplate.report.display_units import display_unit
from swashplate.report.fit_page.numbers import NONE, fixed, plain, seconds
from swashplate.report.fit_page.runs import (
    Shown,
    ShownRun,
    ignored_words,
    start_words,
)


class QualityRow(NamedTuple):
    """How good one channel of one run is simulated, as text."""

    run: str
    maneuver: str
    role: str
    stage: str
    channel: str
    samples: str
    rmse: str
    nrmse: str
    fit: str
    r_squared: str
    start: str
    ignored: str


class DataRow(NamedTuple):
    """What one signal of one run is like, as text."""

    run: str
    signal: str
    kind: str
    samples: str
    rate: str
    low: str
    high: str
    clipped: str
    longest_gap: str
    ignored: str
    findings: tuple[str, ...]


def quality_rows(runs: Sequence[ShownRun]) -> tuple[QualityRow, ...]:
    """A row for each channel of each run, channel by channel."""
    rows = [quality_row(run, each) for run in runs for each in run.channels]
    order = list(dict.fromkeys((row.role, row.channel, row.stage) for row in rows))
    return tuple(sorted(rows, key=lambda row: order.index((row.role, row.channel, row.stage))))


def quality_row(run: ShownRun, shown: Shown) -> QualityRow:
    """The row of one channel of one run."""
    found = shown.quality.measures
    unit = display_unit(shown.channel.unit, found.rmse)
    return QualityRow(
        run.experiment.name,
        run.experiment.maneuver,
        run.role,
        shown.stage,
        shown.quality.channel,
        f"{found.samples:,}",
        f"{plain(unit.factor * found.rmse, 3)} {unit.name}".rstrip(),
        NONE if found.nrmse is None else plain(found.nrmse, 3),
        f"{fixed(found.fit_percent, 2)}",
        fixed(found.r_squared, 5),
        start_words(run.experiment),
        ignored_words(run.experiment, shown.channel),
    )


def data_rows(experiments: Sequence[Experiment]) -> tuple[DataRow, ...]:
    """A row for each signal of each run."""
    return tuple(_data_row(each) for run in experiments for each in examine(run))


def _data_row(quality: Quality) -> DataRow:
    unit = display_unit(quality.unit, max(abs(quality.low), abs(quality.high)))
    low, high = (
        f"{plain(unit.factor * each, 4)} {unit.name}".rstrip()
        for each in (quality.low, quality.high)
    )
    return DataRow(
        quality.experiment,
        quality.signal,
        quality.kind.replace("_", " "),
        f"{quality.stamps.rows:,}",
        f"{quality.stamps.rate:.4g} Hz",
        low,
        high,
        # not a number where no range is known
        f"{100.0 * quality.clipped:.2g} %" if quality.clipped == quality.clipped else NONE,
        f"{seconds(quality.stamps.longest)} s",
        f"{100.0 * quality.ignored:.3g} %",
        quality.findings,
    )
