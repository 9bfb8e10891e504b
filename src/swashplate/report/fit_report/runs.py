"""The runs of a report: their channels and units, in words, and their samples for the page."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import Channel
from swashplate.identification.assessment import Assessment
from swashplate.identification.tables import ignored_words, start_words
from swashplate.identification.validation import RunQuality, ignored_windows, with_speeds
from swashplate.report.lines import gap_rows
from swashplate.tables import quantity
from swashplate.units import DisplayUnit, display_unit

Array = NDArray[np.float64]
FINE = 0.01
"""Single precision is enough for stamps if its steps are below this part of their interval."""


@dataclass(frozen=True, eq=False)
class Shown:
    """One channel of a run, and the stage that fits it."""

    quality: RunQuality
    stage: str
    """Name of the stage; empty for a run that was held out."""
    unit: DisplayUnit
    """For the signal; of one channel the same in all runs."""
    small: DisplayUnit
    """For its residual."""

    @property
    def channel(self) -> Channel:
        """What was measured."""
        return self.quality.experiment[self.quality.channel]


@dataclass(frozen=True, eq=False)
class ShownRun:
    """One run with all of its channels that are simulated."""

    name: str
    validates: bool
    """Whether it was held out of the fit."""
    channels: tuple[Shown, ...]

    @property
    def experiment(self) -> Any:
        """The run, with the speeds that were made of its positions."""
        return self.channels[0].quality.experiment

    @property
    def role(self) -> Literal["fit", "validate"]:
        """Whether it was fitted or held out."""
        return "validate" if self.validates else "fit"

    @property
    def input_unit(self) -> DisplayUnit:
        """Unit that its input is shown in."""
        drive = self.experiment.input
        return display_unit(drive.unit, float(np.abs(drive.values).max(initial=0.0)))

    @property
    def input_label(self) -> str:
        """Label of its input's panel."""
        kind = self.experiment.input.kind
        return self.input_unit.label(kind if kind != "other" else "input")


def shown_runs(
    assessments: Sequence[Assessment], validation: Sequence[RunQuality]
) -> tuple[ShownRun, ...]:
    """All runs, those that were fitted first, each with its channels in the order of the stages.

    A position is followed by its speed.
    """
    found = [(each, a.stage.stage.name, False) for a in assessments for each in with_speeds(a.runs)]
    return _gathered(found + [(each, "", True) for each in with_speeds(validation)])


def predicted_runs(predicted: Sequence[RunQuality]) -> tuple[ShownRun, ...]:
    """Runs that a drive was held against, those with the role 'validate' marked as such."""
    return _gathered(
        [(each, "", each.experiment.role == "validate") for each in with_speeds(predicted)]
    )


def _gathered(found: Sequence[tuple[RunQuality, str, bool]]) -> tuple[ShownRun, ...]:
    """Run by run, from qualities with their stage and whether they were held out."""
    units = {}
    for name in dict.fromkeys(each.channel for each, _, _ in found):
        alike = [each for each, _, _ in found if each.channel == name]
        channels = [each.experiment[name] for each in alike]
        largest = max(float(np.abs(each.values).max(initial=0.0)) for each in channels)
        residual = max(float(np.abs(each.residual).max(initial=0.0)) for each in alike)
        si = channels[0].unit
        units[name] = (display_unit(si, largest), display_unit(si, residual))
    runs = []
    for held, name in dict.fromkeys((held, each.experiment.name) for each, _, held in found):
        channels_of = tuple(
            Shown(each, stage, *units[each.channel])
            for each, stage, out in found
            if out == held and each.experiment.name == name
        )
        runs.append(ShownRun(name, held, channels_of))
    return tuple(runs)


def off_scale(channel: Channel, values: Array) -> NDArray[np.bool_]:
    """(m,) ignored samples so far from those that count that they would press these flat."""
    used = channel.used
    if not used.any():
        return np.zeros(values.size, dtype=np.bool_)
    low, high = float(values[used].min()), float(values[used].max())
    room = 0.5 * (high - low)
    far: NDArray[np.bool_] = ~used & ((values < low - room) | (values > high + room))
    return far


def run_words(quality: RunQuality) -> str:
    """What must stand beside every fit %: RMSE, initial state, what is ignored."""
    found, run = quality.measures, quality.experiment
    channel = run[quality.channel]
    parts = [f"RMSE {quantity(found.rmse, channel.unit)}"]
    if found.fit_percent is not None and found.nrmse is not None and found.r_squared is not None:
        parts.insert(0, f"fit {found.fit_percent:.2f} %")
        parts += [f"NRMSE {found.nrmse:.3g}", f"R² {found.r_squared:.5f}"]
    parts.append(f"initial state {start_words(run)}")
    return " · ".join([*parts, f"ignored: {ignored_words(run, channel)}"])


# --- samples --------------------------------------------------------------------------------------


def run_data(run: ShownRun) -> dict[str, Any]:
    """Stamps and samples of a run for `page.js`: input, and each channel with its residual.

    Ignored samples that would press the others flat are left out. Lines are broken by a NaN where
    the stamps have a gap. A clock that several signals share is given once.
    """
    clocks: list[Array] = []
    drive = run.experiment.input
    given = {"values": run.input_unit.factor * drive.values}
    return {
        "input": _signals(clocks, drive.time, given),
        "channels": [_channel(clocks, each) for each in run.channels],
        "held": drive.interpolation == "previous",
        "clocks": [packed(_broken(time, time, stamps=True), stamps=True) for time in clocks],
    }


def packed(values: Array, *, stamps: bool = False) -> dict[str, str]:
    """Numbers as base64 of little-endian floats, single precision unless stamps need double.

    Returns
    -------
    dict
        ``"type"``: ``"float32"`` or ``"float64"``; ``"data"``: the text.
    """
    double = False
    if stamps and values.size > 1:
        step = float(np.median(np.diff(values)))
        double = bool(np.spacing(np.float32(np.abs(values).max())) > FINE * step)
    kind = "<f8" if double else "<f4"
    text = b64encode(values.astype(kind).tobytes()).decode("ascii")
    return {"type": "float64" if double else "float32", "data": text}


def _channel(clocks: list[Array], shown: Shown) -> dict[str, Any]:
    channel, factor = shown.channel, shown.unit.factor

    def on_scale(values: Array) -> Array:
        return np.where(off_scale(channel, values), np.nan, values)

    lines = {
        "measured": on_scale(factor * channel.values),
        "simulated": factor * shown.quality.simulated,
        "residual": on_scale(shown.small.factor * shown.quality.residual),
    }
    return {**_signals(clocks, channel.time, lines), "ignored": ignored_windows(channel)}


def _signals(clocks: list[Array], time: Array, signals: dict[str, Array]) -> dict[str, Any]:
    number = next((k for k, each in enumerate(clocks) if np.array_equal(each, time)), len(clocks))
    if number == len(clocks):
        clocks.append(time)
    return {"clock": number, **{k: packed(_broken(time, v)) for k, v in signals.items()}}


def _broken(time: Array, values: Array, *, stamps: bool = False) -> Array:
    """With a NaN after each row that a gap follows; of stamps that row's own once more."""
    breaks = gap_rows(time)
    return np.insert(values, breaks + 1, values[breaks] if stamps else np.nan)
