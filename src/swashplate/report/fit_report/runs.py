"""The runs of a report: their channels and units, in words, and their samples for the page."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from zlib import compress

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import Channel, Experiment
from swashplate.identification import (
    Optimum,
    RunQuality,
    ignored_windows,
    ignored_words,
    start_words,
    with_speeds,
)
from swashplate.report.lines import gap_rows, thinned
from swashplate.report.style import in_lines
from swashplate.tables import quantity, write_table
from swashplate.units import DisplayUnit, display_unit

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
MOST_ROWS = 16_384
"""A longer run is shown by the extremes of its signals: five or more for each dot of a screen."""
LEVELS = 65_535
"""Steps into which the range of a signal is rounded."""
FINE = 16
"""Steps in the rms of a residual, and in the interval of uneven stamps."""
LETTERS = {"input": 13, "overlay": 24, "residual": 14}
"""That fit along a panel's axis."""


@dataclass(frozen=True, eq=False)
class ShownChannel:
    """One channel of a run, and the units it is shown in."""

    quality: RunQuality
    unit: DisplayUnit
    """For the signal; of one channel the same in all runs."""
    small: DisplayUnit
    """For its residual."""

    @property
    def channel(self) -> Channel:
        """The measured channel."""
        return self.quality.experiment[self.quality.channel]


@dataclass(frozen=True, eq=False)
class ShownRun:
    """One run with all of its channels that are simulated."""

    name: str
    role: str
    """Whether it was fitted, ``"fit"``, or held out, ``"validate"``."""
    channels: tuple[ShownChannel, ...]

    @property
    def experiment(self) -> Experiment:
        """The run in its role here, with the speeds that were made of its positions."""
        return self.channels[0].quality.experiment

    @property
    def judged(self) -> RunQuality:
        """The channel that it is judged by: the last, of a position its speed."""
        return self.channels[-1].quality

    @property
    def labels(self) -> list[Any]:
        """Labels of the panels in lines: of the input, then of each channel and its residual."""
        names = [channel.quality.channel for channel in self.channels]
        kind = self.experiment.input.kind
        first = self.input_unit.label("input" if kind == "other" else kind)
        panel_labels: list[Any] = [in_lines(first, LETTERS["input"])]
        for channel, name in zip(self.channels, names, strict=True):
            signal = in_lines(channel.unit.label(name), LETTERS["overlay"])
            panel_labels.append(
                (signal, in_lines(channel.small.label("residual"), LETTERS["residual"]))
            )
        return panel_labels

    @property
    def input_unit(self) -> DisplayUnit:
        """Unit that its input is shown in."""
        return display_unit(self.experiment.input.unit, _largest_size(self.experiment.input.values))


def shown_runs(fit: Optimum | None, predicted: Sequence[RunQuality]) -> tuple[ShownRun, ...]:
    """All runs, those that were fitted first; without a fit those that are predicted.

    A position is followed by its speed.
    """
    qualities = [
        replace(speed, experiment=replace(speed.experiment, role="fit"))
        for speed in with_speeds(fit.qualities if fit else ())
    ]
    qualities += with_speeds(predicted)
    units = {
        name: _channel_units([quality for quality in qualities if quality.channel == name])
        for name in {quality.channel for quality in qualities}
    }
    runs = dict[tuple[str, str], list[ShownChannel]]()
    for quality in qualities:
        run = quality.experiment
        unit, small = units[quality.channel]
        channels = runs.setdefault((run.name, run.role), [])
        channels.append(ShownChannel(quality, unit, small))
    return tuple(ShownRun(name, role, tuple(channels)) for (name, role), channels in runs.items())


def _channel_units(qualities: Sequence[RunQuality]) -> tuple[DisplayUnit, DisplayUnit]:
    """Units of a channel and of its residual that suit all of its runs."""
    channels = [quality.experiment[quality.channel] for quality in qualities]
    unit = channels[0].shown_unit
    largest = max(_largest_size(channel.values) for channel in channels)
    largest_residual = max(_largest_size(quality.residual) for quality in qualities)
    return display_unit(unit, largest), display_unit(unit, largest_residual)


def _largest_size(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))


def off_scale(channel: Channel, values: Array) -> Mask:
    """(m,) ignored samples so far from those that count that they would press these flat."""
    used_samples = channel.used
    if not used_samples.any():
        return np.zeros(values.size, dtype=np.bool_)
    low, high = float(values[used_samples].min()), float(values[used_samples].max())
    margin = 0.5 * (high - low)
    far: Mask = ~used_samples & ((values < low - margin) | (values > high + margin))
    return far


def measures_line(quality: RunQuality) -> str:
    """Text that must accompany every fit %: RMSE, initial state, ignored samples."""
    measures = quality.measures
    run = quality.experiment
    channel = run[quality.channel]
    texts = [f"RMSE {quantity(measures.rmse, channel.shown_unit)}"]
    if measures.fit_percent is not None and measures.nrmse is not None:
        texts.insert(0, f"fit {measures.fit_percent:.2f} %")
        texts.append(f"NRMSE {measures.nrmse:.3g}")
    texts.append(f"initial state {start_words(run)}")
    return " · ".join([*texts, f"ignored: {ignored_words(run, channel)}"])


def write_samples(runs: Sequence[ShownRun], path: str | Path) -> None:
    """Write all samples of runs, measured and simulated, as one table, CSV or Parquet, in SI.

    A row is a sample: ``run``, ``role``, ``channel``, ``unit``, ``time`` [s], ``measured``,
    ``simulated``, ``weight``.

    Raises
    ------
    FileError
        If the file cannot be written, or has another ending.
    """
    import polars as pl

    files = []
    for run in runs:
        for measured in run.channels:
            channel = measured.channel
            quality = measured.quality
            columns = {
                "run": run.name,
                "role": run.role,
                "channel": quality.channel,
                "unit": channel.unit,
                "time": channel.time,
                "measured": channel.values,
                "simulated": quality.simulated,
                "weight": channel.weight,
            }
            files.append(pl.DataFrame(columns))
    write_table(pl.concat(files), path)


# --- samples of the page --------------------------------------------------------------------------


def run_data(run: ShownRun) -> dict[str, Any]:
    """Stamps and samples of a run for `page.js`: input, and each channel with its residual.

    Ignored samples that would press the others flat are left out, and lines are broken there and
    at gaps. What was measured is left to the page: simulated less residual. Of runs of more than
    `MOST_ROWS` rows those are kept that show each signal as all of them would. Signals are rounded
    to 1/65,535 of their range, residuals to 1/16 of their rms.
    """
    drive = run.experiment.input
    return {
        "held": drive.interpolation == "previous",
        "input": _packed_signals(drive.time, [(run.input_unit.factor * drive.values, None)]),
        "channels": [_channel_data(channel) for channel in run.channels],
    }


def _channel_data(displayed: ShownChannel) -> dict[str, Any]:
    channel = displayed.channel
    factor = displayed.unit.factor
    small = displayed.small.factor
    residual = small * displayed.quality.residual
    rms = float(np.sqrt(np.mean(np.square(residual[channel.used])))) if channel.used.any() else 0.0
    signals = [(factor * displayed.quality.simulated, None), (residual, rms / FINE or None)]
    return {
        **_packed_signals(channel.time, signals, off_scale(channel, factor * channel.values)),
        "ratio": factor / small,
        "ignored": ignored_windows(channel),
    }


def _packed_signals(
    time: Array, signals: Sequence[tuple[Array, float | None]], hidden: Mask | None = None
) -> dict[str, Any]:
    """Pack signals of one clock, each with the step that it is rounded to if that is known."""
    breaks = gap_rows(time)
    rows = np.arange(time.size)
    if time.size > MOST_ROWS:
        columns = MOST_ROWS // (2 * len(signals))
        rows = np.unique(np.concatenate([thinned(time, v, breaks, columns) for v, _ in signals]))
    if hidden is not None and hidden.any():
        rows = rows[~hidden[rows]]
        breaks = np.union1d(breaks, np.flatnonzero(hidden))
    # the last row shown before each break
    ends = np.unique(np.searchsorted(rows, breaks, side="right")) - 1
    stamps = time[rows]
    interval = float(np.median(np.diff(stamps))) if stamps.size > 1 else 1.0
    return {
        "time": packed_samples(stamps, interval / FINE),
        "breaks": [int(end) for end in ends if 0 <= end < rows.size - 1],
        "signals": [packed_samples(values[rows], step) for values, step in signals],
    }


def packed_samples(values: Array, step: float | None = None) -> dict[str, Any]:
    """Finite numbers as whole multiples of a step, differenced, deflated and in base64.

    ``size``, ``zero`` and ``step``: value = zero + step · number; the step is at least 2⁻²⁸ of
    their range, by default 1/65,535 of it. ``order``: how many times the numbers were differenced.
    ``code``: 0, -1, 1, -2 ... as 0, 1, 2, 3 ... of four bytes each, the lowest bytes of all numbers
    first.
    """
    zero = float(np.median(values)) if values.size else 0.0
    reach = float(np.ptp(values)) if values.size else 0.0
    step = max(step or reach / LEVELS, reach / 2**28) or 1.0
    steps = np.rint((values - zero) / step).astype(np.int64)
    orders = [steps]
    for _ in range(2):
        orders.append(np.diff(orders[-1], prepend=0))
    sizes = [float(np.log2(1.0 + np.abs(order)).sum()) for order in orders]
    order = int(np.argmin(sizes))
    number = np.where(orders[order] < 0, -2 * orders[order] - 1, 2 * orders[order]).astype("<u4")
    planes = number.view(np.uint8).reshape(-1, 4).T.tobytes()
    code = b64encode(compress(planes, 6)).decode("ascii")
    return {"size": values.size, "zero": zero, "step": step, "order": order, "code": code}
