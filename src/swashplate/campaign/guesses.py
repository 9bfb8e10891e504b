"""What a log's column may be, from its name, its unit and its numbers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.counters import rolls_over_at
from swashplate.campaign.kinds import ChannelKind, InputKind
from swashplate.logs import Column

Array = NDArray[np.float64]

_TIME = r"time|zeit|stamp|timestamp|clock|t|seconds?|exp time"
_VOLTAGE = r"volts?|voltage|joystick voltage|u|spannung"
_COMMAND = r"cmd|command|duty|setpoint|valve|stick|joystick"
_ROD = r"ms|displacement|stroke|cylinder|rod|extension"
_CHANNELS: tuple[tuple[ChannelKind, str], ...] = (
    ("encoder_counts", r"counts?|encoder|enc|ticks|pulses"),
    ("current_plus", r"current (?:plus|positive|a|up)|i plus"),
    ("current_minus", r"current (?:minus|negative|b|down)|i minus"),
    ("rectified_current", r"currents?|amps?|ammeter|strom|i"),
    ("stroker_pressure", r"stroker pressure|delta p|dp|servo pressure"),
    ("swash_angle", r"swash angle|swash|alpha"),
    ("spool_position", r"spool position|spool"),
    ("shaft_speed", r"speed|rpm|omega|velocity|drehzahl"),
    ("position", r"position|pos|angle|pos fb"),
    ("position", _ROD),
)
_UNITS: Mapping[str, ChannelKind] = {
    "A": "rectified_current",
    "mA": "rectified_current",
    "counts": "encoder_counts",
    "count": "encoder_counts",
    "rad/s": "shaft_speed",
    "deg/s": "shaft_speed",
    "rpm": "shaft_speed",
    "m/s": "shaft_speed",
    "mm/s": "shaft_speed",
}


class Guess(NamedTuple):
    """What a column may be."""

    column: Column
    role: str
    """``"time"``, ``"input"``, ``"channel"`` or ``"unknown"``."""
    kind: InputKind | ChannelKind | None
    axis: str
    """What stands before the word in its name, such as the "boom" of "Boom Cmd", or empty."""
    linear: bool = False
    """Whether its name is that of a rod's displacement and not of a shaft's angle."""
    rolls_over_at: int | None = None
    """Counts after which an encoder's counter begins anew, where its numbers show it."""


def guess(column: Column) -> Guess:
    """What a column's name and unit say."""
    name = re.sub(r"[\[(].*[\])]", "", column.name)
    name = re.sub(r"(?<=[a-z])(?=[A-Z])|[_./\-\s]+", " ", name).strip().lower()
    if re.fullmatch(_TIME, name):
        return Guess(column, "time", None, "")
    if column.unit in ("V", "mV") or _ends(name, _VOLTAGE) is not None:
        return Guess(column, "input", "voltage", _ends(name, f"{_VOLTAGE}|{_COMMAND}") or "")
    before = _ends(name, _COMMAND)
    if before is not None:
        return Guess(column, "input", "other", before)
    for kind, words in _CHANNELS:
        before = _ends(name, words)
        if before is not None:
            return Guess(column, "channel", kind, before, words == _ROD)
    if column.unit is not None and column.unit in _UNITS:
        return Guess(column, "channel", _UNITS[column.unit], "")
    return Guess(column, "unknown", None, "")


def _ends(name: str, words: str) -> str | None:
    """What stands before one of the words, None where the name ends otherwise."""
    match = re.fullmatch(rf"(?:(.*) )?(?:{words})", name)
    return (match[1] or "") if match else None


def refined(guessed: Guess, values: Array, counts_per_turn: float | None = None) -> Guess:
    """The same with what its numbers say.

    A current that turns negative has a sign; whole numbers that begin anew at their end are an
    encoder's, whatever their name.
    """
    nameless = guessed.role == "unknown" and guessed.column.unit is None
    if nameless or guessed.kind == "encoder_counts":
        size = rolls_over_at(values, counts_per_turn)
        if size is not None:
            return guessed._replace(role="channel", kind="encoder_counts", rolls_over_at=size)
    if (
        guessed.kind == "rectified_current"
        and values.size
        and np.nanmin(values) < -0.02 * np.ptp(values[np.isfinite(values)])
    ):
        return guessed._replace(kind="signed_current")
    return guessed


def by_axis(guesses: Iterable[Guess]) -> dict[str, list[Guess]]:
    """Inputs and channels under the axis that their names begin with.

    An axis needs an input and a channel; columns without a prefix belong to the only axis.
    """
    useful = [each for each in guesses if each.role in ("input", "channel")]
    prefixes = dict.fromkeys(each.axis for each in useful if each.role == "input")
    named = [p for p in prefixes if p and any(c.axis == p and c.role == "channel" for c in useful)]
    if len(named) > 1:
        return {axis: [each for each in useful if each.axis == axis] for axis in named}
    return {"": useful}
