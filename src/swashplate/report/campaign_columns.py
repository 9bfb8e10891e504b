"""Columns of a campaign's page: a signal of all runs, its unit and its scale."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.report.display_units import DisplayUnit, display_unit

if TYPE_CHECKING:
    from swashplate.campaign import Channel, Experiment, InputSignal

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


def counted(signal: InputSignal | Channel) -> Array:
    """Samples that are not ignored; all of them of an input, or where none is left."""
    used = getattr(signal, "used", None)
    return signal.values if used is None or not used.any() else signal.values[used]


def _column(key: tuple[str, str], signals: Sequence[InputSignal | Channel]) -> Column:
    name, si = key
    # what is ignored may leave the panel: one spike would flatten all runs
    shown = [counted(signal) for signal in signals]
    low, high = min(float(each.min()) for each in shown), max(float(each.max()) for each in shown)
    kind = signals[0].kind
    unit = display_unit(si, max(abs(low), abs(high)))
    free = kind in ("position", "encoder_counts")
    if free:
        high = 0.5 * max(float(np.ptp(each)) for each in shown)
        low = -high
    words = {"encoder_counts": "encoder's angle", "other": signals[0].source.column}
    return Column(
        key,
        name or "input",
        unit.label(words.get(kind, kind.replace("_", " "))),
        unit,
        unit.factor * low,
        unit.factor * high,
        free,
    )
