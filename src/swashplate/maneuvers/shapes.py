"""Manoeuvres of straight lines: rest, step, ramp, stairs.

What `start`, `settle` and `length` [s] are, the package says.
"""

import math
from collections.abc import Sequence

from swashplate.errors import InputError
from swashplate.maneuvers.checks import finite, not_negative, positive, row, window
from swashplate.maneuvers.composition import settled
from swashplate.maneuvers.curves import Line
from swashplate.maneuvers.pieces import Maneuver, Piece


def rest(duration: float) -> Maneuver:
    """Nothing, 0 V, for `duration` [s]; it raises InputError if that is negative."""
    duration = not_negative("duration", duration)
    return Maneuver(f"rest {duration:g} s", duration, (Piece(0.0, Line()),), 0.0)


def step(
    amplitude: float, *, start: float = 1.0, stop: float = 6.0, length: float = 10.0
) -> Maneuver:
    """Step of `amplitude` [V], on at `start` and off at `stop` [s].

    Raises
    ------
    InputError
        Unless 0 <= start < stop <= length.
    """
    amplitude, length = finite("amplitude", amplitude), finite("length", length)
    start, stop = finite("start", start), finite("stop", stop)
    if not 0.0 <= start < stop <= length:
        raise InputError(
            f"a step needs 0 <= start < stop <= length, not {start:g}, {stop:g}, {length:g} s."
        )
    pieces = [Piece(start, Line(amplitude)), Piece(stop, Line())]
    return settled(f"step {amplitude:g} V", amplitude, pieces, length, length)


def ramp(
    slope: float,
    *,
    limit: float = 10.0,
    start: float = 1.0,
    settle: float | None = 2.5,
    length: float = 13.0,
) -> Maneuver:
    """Ramp that stays at `limit` once there, cut short by the return if time runs out.

    Parameters
    ----------
    slope : float
        Negative for a ramp downwards. [V/s]
    limit : float
        Largest magnitude, positive. [V]

    Raises
    ------
    InputError
        If `limit` is not positive, or `start` and `settle` leave nothing of `length`.
    """
    slope, limit = finite("slope", slope), positive("limit", limit)
    start, end, length = window(start, settle, length)
    pieces = [Piece(start, Line(rise=slope))]
    if abs(slope) * (end - start) > limit:
        pieces.append(Piece(start + limit / abs(slope), Line(math.copysign(limit, slope))))
    return settled(f"ramp {slope:g} V/s", limit, pieces, end, length)


def stairs(
    levels: Sequence[float], dwell: float = 2.0, *, start: float = 1.0, settle: float | None = 2.5
) -> Maneuver:
    """Hold one voltage after another; a return follows unless the last is zero.

    Parameters
    ----------
    levels : sequence of float
        At least one. [V]
    dwell : float
        How long each is held, positive. [s]

    Raises
    ------
    InputError
        If there is no level, or a time is out of its range.
    """
    volts, dwell = row("levels", levels).tolist(), positive("dwell", dwell)
    start, settle = not_negative("start", start), not_negative("settle", settle or 0.0)
    pieces = [Piece(start + dwell * index, Line(level)) for index, level in enumerate(volts)]
    end = start + dwell * len(pieces)
    name = f"stairs {'/'.join(f'{level:g}' for level in volts)} V"
    amplitude = max(abs(level) for level in volts)
    return settled(name, amplitude, pieces, end, end + settle if volts[-1] != 0.0 else end)
