"""Kinds of signal that a test of a drive can carry."""

from __future__ import annotations

from typing import Literal, NamedTuple, get_args

from swashplate.errors import InputError
from swashplate.units import to_si

InputKind = Literal["voltage", "current", "other"]
ChannelKind = Literal[
    "signed_current",
    "rectified_current",
    "current_plus",
    "current_minus",
    "shaft_speed",
    "position",
    "encoder_counts",
    "stroker_pressure",
    "swash_angle",
    "spool_position",
    "other",
]


class Kind(NamedTuple):
    """What a kind of signal is."""

    units: tuple[str, ...]
    """SI units that it may have; the first is meant where none is given. None: as written."""
    meaning: str
    """In words, with its sign convention."""


KINDS: dict[str, Kind] = {
    "voltage": Kind(("V",), "the card's command, positive towards positive speed"),
    "current": Kind(("A",), "signed current that drives the pump without a card"),
    "signed_current": Kind(("A",), "positive solenoid's current less the negative one's"),
    "rectified_current": Kind(("A",), "|I+| + |I-|, one ammeter around both leads"),
    "current_plus": Kind(("A",), "current of the positive solenoid, a magnitude"),
    "current_minus": Kind(("A",), "current of the negative solenoid, a magnitude"),
    "shaft_speed": Kind(("rad/s", "m/s"), "speed of the shaft, or of a cylinder's rod"),
    "position": Kind(("rad", "m"), "integral of the speed from a free zero"),
    "encoder_counts": Kind(("rad",), "counts of an encoder; an angle from a free zero"),
    "stroker_pressure": Kind(("Pa",), "stroking pressure about its equilibrium"),
    "swash_angle": Kind(("rad",), "angle of the swash plate, positive with the speed"),
    "spool_position": Kind(("m",), "displacement of the spool, positive with the force"),
    "other": Kind((), "anything else, kept in the unit that it is written in"),
}
"""Every kind of input and channel, by its name in a campaign file."""

CHANNEL_KINDS: tuple[ChannelKind, ...] = get_args(ChannelKind)


def si_unit(kind: str, unit: str | None, what: str) -> str:
    """The SI unit in which a signal of a kind is kept.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    unit : str or None
        Unit that it comes in; None stands for the kind's first one.
    what : str
        The signal, for the error's sentence.

    Raises
    ------
    InputError
        If the unit is unknown or measures something else than the kind.
    """
    units = KINDS[kind].units
    if not units:
        return unit or "1"
    if unit is None or kind == "encoder_counts":
        return units[0]
    for si in units[1:]:
        try:
            to_si(1.0, unit, si, what)
        except InputError:
            continue
        return si
    to_si(1.0, unit, units[0], what)
    return units[0]
