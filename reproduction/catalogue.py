"""Which figure of Kruse (2001) shows which maneuver of which axis."""

from __future__ import annotations

from typing import Literal, NamedTuple

Kind = Literal[
    "diagram",
    "current",
    "speed",
    "inside",
    "encoder",
    "measured current",
    "other card",
    "larger",
]
"""What a figure shows: a block diagram, the card's current, the shaft's speed, all signals inside,
counts of an encoder, a speed driven by a measured-type current, speeds with the other card, or a
drive with larger orifices and pump."""


class Shown(NamedTuple):
    """A figure of Kruse (2001)."""

    number: str
    kind: Kind
    axis: str = ""
    tests: tuple[str, ...] = ()
    """Names in `maneuvers.source_tests`."""
    logs: str = ""
    """Files that its caption names."""


_HOIST = (
    ("ramp +1 V/s", "hoistr3.dat"),
    ("step +4 V", "hoistr6.dat"),
    ("step +6.5 V", "hoistr8.dat"),
    ("step +9 V", "hoistr10.dat"),
    ("sine 4 V 0.1 Hz", "hoistr13.dat"),
    ("sine 6.5 V 0.1 Hz", "hoistr20.dat"),
    ("sine 6.5 V 0.3 Hz", "hoistr22.dat"),
    ("sine 9 V 0.1 Hz", "hoistr27.dat"),
    ("sine 9 V 0.3 Hz", "hoistr29.dat"),
)
_SLEW = (
    ("ramp +1 V/s", "slewr2.dat"),
    ("step +2 V", "slewr10.dat"),
    ("sine 4 V 0.05 Hz", "slewr4.dat"),
    ("sine 4 V 0.1 Hz", "slewr5.dat"),
    ("sine 6 V 0.05 Hz", "slewr8.dat"),
)
_LUFF = (
    ("ramp +1 V/s", "luffh2.dat and luff9.dat"),
    ("step +4 V", "luffh3.dat and luff12.dat"),
    ("step +6.5 V", "luffh5.dat and luff14.dat"),
    ("step +9 V", "luffh7.dat and luff16.dat"),
    ("sine 4 V 0.1 Hz", "luffh9.dat and luff19.dat"),
    ("sine 6.5 V 0.1 Hz", "luffh17.dat and luff26.dat"),
    ("sine 9 V 0.05 Hz", "luffh22.dat and luff31.dat"),
)


def _series(
    chapter: int, first: int, kind: Kind, axis: str, runs: tuple[tuple[str, str], ...]
) -> list[Shown]:
    return [
        Shown(f"{chapter}.{first + index}", kind, axis, (test,), log)
        for index, (test, log) in enumerate(runs)
    ]


FIGURES: tuple[Shown, ...] = (
    Shown("4.1", "diagram"),
    Shown("4.2", "diagram"),
    *_series(4, 3, "current", "hoist", _HOIST),
    *_series(4, 12, "current", "slew", _SLEW),
    Shown("7.1", "diagram"),
    Shown("7.2", "encoder", "hoist", ("ramp +1 V/s",)),
    Shown("7.3", "diagram"),
    Shown("7.4", "diagram"),
    *_series(7, 5, "speed", "hoist", _HOIST),
    Shown("7.14", "inside", "hoist", ("sine 9 V 0.1 Hz",), "hoistr27.dat"),
    *_series(7, 15, "speed", "slew", _SLEW),
    Shown("7.20", "inside", "slew", ("sine 6 V 0.05 Hz",), "slewr8.dat"),
    *_series(7, 21, "measured current", "luff", _LUFF),
    Shown("7.28", "other card", "luff", tuple(test for test, _ in _LUFF[:4])),
    Shown("7.29", "other card", "luff", tuple(test for test, _ in _LUFF[4:])),
    Shown("9.1", "larger", "hoist", ("sine 9 V 0.1 Hz",), "hoistr27.dat"),
)
"""All figures of chapters 4 and 7, and figure 9.1, in Kruse's order."""

ERROR_TABLES = ("4.5", "4.6", "7.5", "7.6")
TABLES = (
    "4.1", "4.2", "4.3", "4.4", "4.5", "4.6",
    "7.1", "7.2", "7.3", "7.4", "7.5", "7.6",
    "8.1", "8.2", "8.3",
)  # fmt: skip
"""All tables of those chapters and of chapter 8."""
