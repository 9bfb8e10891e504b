"""What makes a manoeuvre of others: returns to zero and sums."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from swashplate.errors import InputError
from swashplate.maneuvers.checks import positive
from swashplate.maneuvers.curves import Hermite, Line, Sum
from swashplate.maneuvers.pieces import Maneuver, Piece


def superpose(*maneuvers: Maneuver) -> Maneuver:
    """Sum of the voltages of manoeuvres, as long as the longest.

    Raises
    ------
    InputError
        If there is none.
    """
    if not maneuvers:
        raise InputError("superpose needs at least one manoeuvre.")
    length = max(each.length for each in maneuvers)
    name = " with ".join(each.name for each in maneuvers)
    together = Sum(tuple(_padded(each, length) for each in maneuvers))
    return Maneuver(name, length, (Piece(0.0, together),))


def _padded(short: Maneuver, length: float) -> Maneuver:
    """Let it rest from its end on, the end included, as after any jump."""
    if short.length == length:
        return short
    return replace(short, length=length, pieces=(*short.pieces, Piece(short.length, Line())))


@dataclass(frozen=True)
class SplineReturn:
    """What `spline_return` makes: an end, `duration` [s] long, for the manoeuvre it is added to."""

    duration: float

    def __radd__(self, before: Maneuver) -> Maneuver:
        if not isinstance(before, Maneuver):
            return NotImplemented
        name = f"{before.name} + return {self.duration:g} s"
        return returned(before, name, before.length + self.duration)


def spline_return(duration: float) -> SplineReturn:
    """Cubic Hermite from the voltage and slope at the end of what it is added to, to (0, 0).

    It first follows the slope that it finds: a steep one can carry it beyond the voltages before.

    Parameters
    ----------
    duration : float
        Positive. [s]

    Raises
    ------
    InputError
        If it is not.
    """
    return SplineReturn(positive("duration", duration))


def returned(before: Maneuver, name: str, length: float) -> Maneuver:
    """Add to a manoeuvre the return that ends at `length` [s], to the last bit."""
    level, slope = float(before(before.length)), float(before.slope(before.length))
    curve = Hermite(level, slope, length - before.length)
    return Maneuver(name, length, (*before.pieces, Piece(before.length, curve)))


def settled(name: str, pieces: Sequence[Piece], end: float, length: float) -> Maneuver:
    """Rest, the pieces until `end` [s], and the return if there is time left until `length` [s]."""
    command = Maneuver(name, end, (Piece(0.0, Line()), *pieces))
    return returned(command, name, length) if end < length else command
