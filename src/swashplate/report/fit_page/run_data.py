"""A run's samples as text for the page: every one of them, as base64 of little-endian floats."""

from __future__ import annotations

from base64 import b64encode
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import Channel
from swashplate.identification.validation import ignored_windows
from swashplate.report.broken_lines import gap_rows
from swashplate.report.display_units import display_unit
from swashplate.report.fit_page.runs import Shown, ShownRun, off_scale

Array = NDArray[np.float64]
FINE = 0.01
"""Single precision is enough for stamps if its steps are below this part of their interval."""


def run_data(run: ShownRun) -> dict[str, Any]:
    """Stamps and samples of a run for `page.js`: input, and each channel with its residual.

    Ignored samples that would press the others flat are left out. Lines are broken by a NaN where
    the stamps have a gap. A clock that several signals share is given once.
    """
    clocks: list[Array] = []
    drive = run.experiment.input
    unit = display_unit(drive.unit, float(np.abs(drive.values).max(initial=0.0)))
    return {
        "input": _signals(clocks, drive.time, {"values": unit.factor * drive.values}),
        "channels": [_channel(clocks, each) for each in run.channels],
        "held": drive.interpolation == "previous",
        "clocks": [packed(_broken(time, time, stamps=True), stamps=True) for time in clocks],
    }


def packed(values: Array, *, stamps: bool = False) -> dict[str, str]:
    """Numbers as base64, single precision unless stamps need double.

    Returns
    -------
    dict
        ``"type"``: ``"float32"`` or ``"float64"``; ``"data"``: the text.
    """
    kind = "<f4"
    if stamps and values.size > 1:
        step = float(np.median(np.diff(values)))
        if np.spacing(np.float32(np.abs(values).max())) > FINE * step:
            kind = "<f8"
    return {
        "type": "float32" if kind == "<f4" else "float64",
        "data": b64encode(values.astype(kind).tobytes()).decode("ascii"),
    }


def _channel(clocks: list[Array], shown: Shown) -> dict[str, Any]:
    channel, factor = shown.channel, shown.unit.factor
    residual = shown.quality.residual
    made = _signals(
        clocks,
        channel.time,
        {
            "measured": _on_scale(channel, factor * channel.values),
            "simulated": factor * shown.quality.simulated,
            "residual": _on_scale(channel, shown.small.factor * residual),
        },
    )
    return {**made, "ignored": ignored_windows(channel)}


def _on_scale(channel: Channel, values: Array) -> Array:
    return np.where(off_scale(channel, values), np.nan, values)


def _signals(clocks: list[Array], time: Array, signals: dict[str, Array]) -> dict[str, Any]:
    number = next((k for k, each in enumerate(clocks) if np.array_equal(each, time)), len(clocks))
    if number == len(clocks):
        clocks.append(time)
    return {"clock": number, **{k: packed(_broken(time, v)) for k, v in signals.items()}}


def _broken(time: Array, values: Array, *, stamps: bool = False) -> Array:
    """With a NaN after each row that a gap follows; of stamps that row's own once more."""
    breaks = gap_rows(time)
    return np.insert(values, breaks + 1, values[breaks] if stamps else np.nan)
