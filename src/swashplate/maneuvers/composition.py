"""What makes a manoeuvre of others: returns to zero and sums."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from swashplate.errors import InputError
from swashplate.maneuvers.checks import positive
from swashplate.maneuvers.curves import Line, Sum, return_within
from swashplate.maneuvers.pieces import Maneuver, Piece


def superpose(*maneuvers: Maneuver) -> Maneuver:
    """Sum of the voltages of manoeuvres, as long as the longest; its amplitude is theirs added.

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
    amplitude = sum(each.amplitude for each in maneuvers)
    return Maneuver(name, length, (Piece(0.0, together),), amplitude)


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

    It stays within the amplitude of what it is added to: where the slope there would carry it
    beyond, it starts with the steepest slope of that sign that does not, at the amplitude itself
    with none. What states no amplitude is not exceeded beyond the voltage that it ends with.

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
    within = before.amplitude if math.isfinite(before.amplitude) else 0.0
    curve = return_within(within, level, slope, length - before.length)
    return replace(
        before, name=name, length=length, pieces=(*before.pieces, Piece(before.length, curve))
    )


def settled(
    name: str, amplitude: float, pieces: Sequence[Piece], end: float, length: float
) -> Maneuver:
    """Rest, the pieces until `end` [s], and the return if there is time left until `length` [s]."""
    command = Maneuver(name, end, (Piece(0.0, Line()), *pieces), abs(amplitude))
    return returned(command, name, length) if end < length else command
