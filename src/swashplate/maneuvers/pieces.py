"""Maneuvers as objects: curves one after another, to be sampled, scaled, joined and added."""
# ruff: noqa: D102 - what the two methods of every curve return is said once, by Curve

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Protocol

import numpy as np
import numpy.typing as npt

from swashplate.errors import InputError
from swashplate.results import Result

# --- curves ---------------------------------------------------------------------------------------


Array = npt.NDArray[np.float64]

NEAR = 1e-9
"""An instant this little before a jump, or after the end, counts as being there. [s]

Decimal durations do not add up exactly (0.1 + 0.2 > 0.3), and a step must not miss the sample meant
for it.
"""
HALVINGS = 60  # Of the slope of a return until it is found, to the last bits.


def interval(starts: npt.ArrayLike, time: Array) -> npt.NDArray[np.intp]:
    """Index of the last of the `starts` [s], in their order, that each `time` [s] has reached."""
    return np.searchsorted(starts, time + NEAR, side="right") - 1


class Curve(Protocol):
    """What a piece of a maneuver follows; both methods take an array of times [s]."""

    def __call__(self, time: Array, /) -> Array:
        """Voltage [V], in an array of the same shape."""

    def slope(self, time: Array, /) -> Array:
        """Exact dV/dt [V/s], in an array of the same shape; at a kink, of what follows it."""


@dataclass(frozen=True)
class Line:
    """Straight line from `level` [V] on, which rises by `rise` [V/s]."""

    level: float = 0.0
    rise: float = 0.0

    def __call__(self, time: Array) -> Array:
        return self.level + self.rise * time

    def slope(self, time: Array) -> Array:
        return np.full_like(time, self.rise)


@dataclass(frozen=True)
class Hermite:
    """Cubic from voltage `level` [V] and slope `rise` [V/s] to (0, 0) at `duration` [s]."""

    level: float
    rise: float
    duration: float

    def __call__(self, time: Array) -> Array:
        # Written with the time left as a factor, it ends at exactly zero.
        done = time / self.duration
        return (1.0 - done) ** 2 * (self.level * (1.0 + 2.0 * done) + self.rise * time)

    def slope(self, time: Array) -> Array:
        done = time / self.duration
        mean = self.level / self.duration
        return (1.0 - done) * (self.rise * (1.0 - 3.0 * done) - 6.0 * mean * done)

    @property
    def peak(self) -> float:
        """Largest magnitude. [V]"""
        change = self.rise * self.duration
        turn = 3.0 * (2.0 * self.level + change)
        # where its one extremum beside the end lies, as a part of the duration
        part = change / turn if turn else 0.0
        if not 0.0 < part < 1.0:
            return abs(self.level)
        return max(abs(self.level), (1.0 - part) ** 2 * abs(self.level + change / 3.0))


def return_within(amplitude: float, level: float, rise: float, duration: float) -> Hermite:
    """Return from `level` [V] to rest that stays within ±`amplitude` [V], not below ±`level`.

    It starts with the slope `rise` [V/s] where the cubic then stays within, else with the steepest
    slope of that sign with which it does, which is 0 at the amplitude itself.
    """
    whole = Hermite(level, rise, duration)
    bound = max(amplitude, abs(level))
    if whole.peak <= bound:
        return whole
    low, high = 0.0, 1.0 if abs(level) < bound else 0.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if Hermite(level, middle * rise, duration).peak <= bound:
            low = middle
        else:
            high = middle
    return Hermite(level, low * rise, duration)


@dataclass(frozen=True)
class Tone:
    """Sine of `amplitude` [V] and `phase` [rad]; its `frequency` [Hz] grows by `growth` [Hz/s]."""

    amplitude: float
    frequency: float
    growth: float = 0.0
    phase: float = 0.0

    def __call__(self, time: Array) -> Array:
        return self.amplitude * np.sin(self._angle(time))

    def slope(self, time: Array) -> Array:
        speed = 2.0 * np.pi * (self.frequency + self.growth * time)
        return self.amplitude * speed * np.cos(self._angle(time))

    def _angle(self, time: Array) -> Array:
        return 2.0 * np.pi * (self.frequency + 0.5 * self.growth * time) * time + self.phase


@dataclass(frozen=True)
class Scaled:
    """Another curve times `factor` [1]."""

    factor: float
    curve: Curve

    def __call__(self, time: Array) -> Array:
        return self.factor * self.curve(time)

    def slope(self, time: Array) -> Array:
        return self.factor * self.curve.slope(time)


@dataclass(frozen=True)
class Sum:
    """Sum of one or more curves."""

    curves: tuple[Curve, ...]

    def __call__(self, time: Array) -> Array:
        return reduce(np.add, (curve(time) for curve in self.curves))

    def slope(self, time: Array) -> Array:
        return reduce(np.add, (curve.slope(time) for curve in self.curves))


# --- checks ---------------------------------------------------------------------------------------


def finite(name: str, value: float, least: float = -math.inf) -> float:
    """Return `value` as a float, or raise InputError if not finite or below `least`, which is 0."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be a number, not {value!r}.") from None
    if not math.isfinite(number):
        raise InputError(f"{name} must be finite, not {number}.")
    if number < least:
        raise InputError(f"{name} must not be negative, not {number:g}.")
    return number


def positive(name: str, value: float) -> float:
    """Return `value` as a float, or raise InputError if it is not finite and positive."""
    if (number := finite(name, value)) <= 0.0:
        raise InputError(f"{name} must be positive, not {number:g}.")
    return number


def whole(name: str, value: object) -> int:
    """Return `value` as an integer, or raise InputError if it is none or negative."""
    if not isinstance(value, int | np.integer) or value < 0:
        raise InputError(f"{name} must be a whole number from 0 up, not {value!r}.")
    return int(value)


def row(name: str, values: npt.ArrayLike) -> Array:
    """Copy `values` to a row; raise InputError unless it has one or more numbers, all finite."""
    try:
        numbers = np.array(values, dtype=float, ndmin=1)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be numbers, not {values!r}.") from None
    if numbers.ndim != 1 or numbers.size == 0:
        raise InputError(f"{name} must be one row of numbers, not of shape {numbers.shape}.")
    wrong = np.flatnonzero(~np.isfinite(numbers))
    if wrong.size:
        where = f"row {wrong[0]} (the first is 0) is {numbers[wrong[0]]}"
        raise InputError(f"{name} must be finite, but {where}.")
    return numbers


def window(start: float, settle: float | None, length: float) -> tuple[float, float, float]:
    """Start and end of the command between rest and return, and the whole length.

    Parameters
    ----------
    start, settle, length : float
        Rest before the command, return after it (None for none) and the whole. [s]

    Raises
    ------
    InputError
        If one is negative or not finite, or nothing is left for the command.
    """
    start, length = finite("start", start, 0.0), finite("length", length, 0.0)
    settle = finite("settle", settle or 0.0, 0.0)
    if start + settle >= length:
        raise InputError(
            f"start {start:g} s and settle {settle:g} s leave nothing of a length of {length:g} s."
        )
    return start, length - settle, length


# --- pieces ---------------------------------------------------------------------------------------


LONGEST = 100_000_000
"""Samples that a maneuver may have; more is a mistake and would not fit into memory."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A voltage from `start` on, until the next piece starts or the maneuver ends.

    Attributes
    ----------
    start : float
        From the beginning of the maneuver. [s]
    curve : Curve
        Voltage [V] and its slope [V/s] over the time since `start` [s].
    """

    start: float
    curve: Curve


@dataclass(frozen=True, eq=False)
class Maneuver(Result):
    """A voltage command of finite length; call it with times to have the voltage.

    Attributes
    ----------
    name : str
        For people, such as "step 9 V"; `dataclasses.replace(m, name=...)` gives another.
    length : float
        Duration. [s]
    pieces : tuple of Piece
        In the order of their starts, the first at 0. At a jump the later piece holds.
    amplitude : float
        What the maneuver states and its voltage never exceeds, inf where it states none. [V]
    """

    name: str
    length: float
    pieces: tuple[Piece, ...]
    amplitude: float = math.inf

    def __call__(self, time: npt.ArrayLike) -> Array:
        """Voltage [V] at `time` [s] of any shape, zero outside [0, length]."""
        values = self._gather(time, (piece.curve for piece in self.pieces))
        # the curves stay within the amplitude, rounding errors apart
        return np.clip(values, 0.0 - self.amplitude, self.amplitude)

    def slope(self, time: npt.ArrayLike) -> Array:
        """Exact dV/dt [V/s] at `time` [s] of any shape, at a jump or kink of what follows it."""
        return self._gather(time, (piece.curve.slope for piece in self.pieces))

    def time(self, rate: float = 512.0) -> Array:
        """Instants n/rate [s] of the samples, shape (rate·length + 1,).

        Raises
        ------
        InputError
            If `rate` [Hz] is not positive or the length is not a whole number of samples.
        """
        samples = positive("rate", rate) * self.length
        if samples > LONGEST:
            raise InputError(
                f"{self.name} lasts {self.length:g} s, at {rate:g} Hz {samples:.3g} samples, more "
                f"than the {LONGEST:.0e} that are simulated at once."
            )
        if abs(samples - round(samples)) > 1e-6:
            raise InputError(
                f"{self.name} lasts {self.length} s, at {rate:g} Hz {samples:.10g} samples instead "
                "of a whole number: change its length or the rate."
            )
        return np.arange(round(samples) + 1) / rate

    def sample(self, rate: float = 512.0) -> Array:
        """Voltage [V] at the instants of `time(rate)`, which also says what is raised."""
        time = self.time(rate)
        time[-1] = self.length  # its stamp may lie a rounding error before or after the end
        return self(time)

    def __add__(self, after: Maneuver) -> Maneuver:
        if not isinstance(after, Maneuver):
            return NotImplemented
        moved = (replace(piece, start=self.length + piece.start) for piece in after.pieces)
        name, length = f"{self.name} + {after.name}", self.length + after.length
        amplitude = max(self.amplitude, after.amplitude)
        return Maneuver(name, length, (*self.pieces, *moved), amplitude)

    def __mul__(self, factor: float) -> Maneuver:
        factor = finite("factor", factor)
        pieces = (replace(piece, curve=Scaled(factor, piece.curve)) for piece in self.pieces)
        amplitude = abs(factor) * self.amplitude if factor else 0.0
        return Maneuver(f"{factor:g} * ({self.name})", self.length, tuple(pieces), amplitude)

    __rmul__ = __mul__

    def __neg__(self) -> Maneuver:
        return replace(-1.0 * self, name=f"-({self.name})")

    def _gather(self, time: npt.ArrayLike, functions: Iterable[Callable[[Array], Array]]) -> Array:
        """Let each piece's function say what it is at the times at which that piece holds."""
        stamps = np.asarray(time, dtype=float)
        values = np.where(np.isnan(stamps), np.nan, 0.0)
        inside = (stamps >= 0.0) & (stamps <= self.length + NEAR)
        stamps = np.minimum(stamps, self.length)
        holding = np.where(inside, interval([piece.start for piece in self.pieces], stamps), -1)
        for index, (piece, function) in enumerate(zip(self.pieces, functions, strict=True)):
            here = holding == index
            values[here] = function(np.maximum(stamps[here] - piece.start, 0.0))
        return values[()]  # a number for a number


# --- composition ----------------------------------------------------------------------------------


def superpose(*maneuvers: Maneuver) -> Maneuver:
    """Sum of the voltages of maneuvers, as long as the longest; its amplitude is theirs added.

    Raises
    ------
    InputError
        If there is none.
    """
    if not maneuvers:
        raise InputError("superpose needs at least one maneuver.")
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


def returned(before: Maneuver, name: str, length: float) -> Maneuver:
    """Add to a maneuver the return that ends at `length` [s], to the last bit."""
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


def sampled(command: npt.ArrayLike | Maneuver, rate: float) -> npt.ArrayLike:
    """Samples of a maneuver at a rate [Hz], anything else as it is.

    Raises
    ------
    InputError
        For words: a maneuver's are read by `parse`.
    """
    if isinstance(command, str):
        raise InputError(
            f"The voltage is the text '{command}': give samples, or a maneuver such as "
            f"maneuvers.parse('{command}')."
        )
    return command.sample(rate) if isinstance(command, Maneuver) else command
