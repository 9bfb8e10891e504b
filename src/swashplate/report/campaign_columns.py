"""Columns of a campaign's page: a signal of all runs, its unit and its scale."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.report.display_units import DisplayUnit, display_unit

if TYPE_CHECKING:
    from swashplate.campaign.experiment import Channel, Experiment, InputSignal

Array = NDArray[np.float64]


class Column(NamedTuple):
    """What a column of panels shows."""

    key: tuple[str, str]
    """Name and SI unit of a channel; the input has no name."""
    name: str
    words: str
    """What it shows, with the unit."""
    unit: DisplayUnit
    low: float
    high: float
    """Lowest and highest value of all runs, in the displayed unit. Of a position, whose zero is
    free, half the largest travel of a run, down and up: each run has its own middle."""
    free: bool
    """Whether it is a position."""

    def limits(self, values: Array) -> tuple[float, float]:
        """Lowest and highest value to show of a run, in the displayed unit."""
        middle = 0.5 * float(values.min() + values.max()) if self.free else 0.0
        return middle + self.low, middle + self.high


def signals_of(experiment: Experiment) -> dict[tuple[str, str], InputSignal | Channel]:
    """The input, whose name is empty, and the channels, by name and unit."""
    signals: dict[tuple[str, str], InputSignal | Channel] = {
        ("", experiment.input.unit): experiment.input
    }
    for name, channel in experiment.channels.items():
        signals[(name, channel.unit)] = channel
    return signals


def columns_of(experiments: Sequence[Experiment]) -> list[Column]:
    """The columns that some runs of one axis need together, the input first."""
    met: dict[tuple[str, str], list[InputSignal | Channel]] = {}
    for experiment in experiments:
        for key, signal in signals_of(experiment).items():
            met.setdefault(key, []).append(signal)
    inputs_first = sorted(met, key=lambda key: key[0] != "")
    return [_column(key, met[key]) for key in inputs_first]


def _column(key: tuple[str, str], signals: Sequence[InputSignal | Channel]) -> Column:
    name, si = key
    low = min(float(signal.values.min()) for signal in signals)
    high = max(float(signal.values.max()) for signal in signals)
    kind = signals[0].kind
    unit = display_unit(si, max(abs(low), abs(high)))
    free = kind in ("position", "encoder_counts")
    if free:
        high = 0.5 * max(float(np.ptp(signal.values)) for signal in signals)
        low = -high
    shown = {"encoder_counts": "encoder's angle", "other": signals[0].source.column}
    return Column(
        key,
        name or "input",
        unit.label(shown.get(kind, kind.replace("_", " "))),
        unit,
        unit.factor * low,
        unit.factor * high,
        free,
    )
