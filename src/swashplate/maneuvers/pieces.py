"""Maneuvers as objects: curves one after another, to be sampled, scaled, joined and added."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from swashplate.errors import InputError
from swashplate.results import Result

Array = npt.NDArray[np.float64]
Curve = Callable[[Array], tuple[Array, Array]]
"""What a piece follows: voltage [V] and exact slope [V/s], at a kink of what follows it, over the
time since its start [s]."""
Piece = tuple[float, Curve]
"""Start of a curve, from the beginning of the maneuver [s], which holds until the next starts."""

NEAR = 1e-9
"""An instant this little before a jump, or after the end, counts as being there. [s]

Decimal durations do not add up exactly (0.1 + 0.2 > 0.3), and a step must not miss the sample meant
for it.
"""
HALVINGS = 60  # Of the slope of a return until it is found, to the last bits.
LONGEST = 100_000_000
"""Samples that a maneuver may have; more is a mistake and would not fit into memory."""

# --- curves ---------------------------------------------------------------------------------------


def line(time: Array, level: float = 0.0, rise: float = 0.0) -> tuple[Array, Array]:
    """Straight line from `level` [V] on, which rises by `rise` [V/s]."""
    return level + rise * time, np.full_like(time, rise)


def tone(
    time: Array, amplitude: float, frequency: float, growth: float = 0.0, phase: float = 0.0
) -> tuple[Array, Array]:
    """Sine of `amplitude` [V] and `phase` [rad]; its `frequency` [Hz] grows by `growth` [Hz/s]."""
    angle = 2.0 * np.pi * (frequency + 0.5 * growth * time) * time + phase
    speed = 2.0 * np.pi * (frequency + growth * time)
    return amplitude * np.sin(angle), amplitude * speed * np.cos(angle)


def homeward(time: Array, level: float, rise: float, duration: float) -> tuple[Array, Array]:
    """Cubic from voltage `level` [V] and slope `rise` [V/s] to (0, 0) at `duration` [s]."""
    done = time / duration
    # written with the time left as a factor, it ends at exactly zero
    return (
        (1.0 - done) ** 2 * (level * (1.0 + 2.0 * done) + rise * time),
        (1.0 - done) * (rise * (1.0 - 3.0 * done) - 6.0 * (level / duration) * done),
    )


def joined(time: Array, times: Array, volts: Array) -> tuple[Array, Array]:
    """Rows of a log joined by straight lines."""
    # at the last row there is no line that follows: keep to the one before
    slopes = np.diff(volts) / np.diff(times)
    return np.interp(time, times, volts), slopes[interval(times[:-1], time)]


def kept(time: Array, times: Array, volts: Array) -> tuple[Array, Array]:
    """Rows of a log, each until the next."""
    return volts[interval(times, time)], np.zeros_like(time)


def scaled(time: Array, factor: float, curve: Curve) -> tuple[Array, Array]:
    """Another curve times `factor` [1]."""
    voltage, slope = curve(time)
    return factor * voltage, factor * slope


def summed(time: Array, curves: Sequence[Curve]) -> tuple[Array, Array]:
    """Sum of one or more curves."""
    voltages, slopes = zip(*(curve(time) for curve in curves), strict=True)
    return sum(voltages[1:], voltages[0]), sum(slopes[1:], slopes[0])


def interval(starts: npt.ArrayLike, time: Array) -> npt.NDArray[np.intp]:
    """Index of the last of the `starts` [s], in their order, that each `time` [s] has reached."""
    return np.searchsorted(starts, time + NEAR, side="right") - 1


def return_within(amplitude: float, level: float, rise: float, duration: float) -> Curve:
    """Return from `level` [V] to rest that stays within ±`amplitude` [V], not below ±`level`.

    It starts with the slope `rise` [V/s] where the cubic then stays within, else with the steepest
    slope of that sign with which it does, which is 0 at the amplitude itself.
    """
    bound = max(amplitude, abs(level))

    def stays(part: float) -> bool:
        change = part * rise * duration
        turn = 3.0 * (2.0 * level + change)
        # where its one extremum beside the end lies, as a part of the duration
        at = change / turn if turn else 0.0
        return not 0.0 < at < 1.0 or (1.0 - at) ** 2 * abs(level + change / 3.0) <= bound

    low, high = 0.0, 1.0 if abs(level) < bound else 0.0
    if stays(1.0):
        low = high = 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stays(middle) else (low, middle)
    return partial(homeward, level=level, rise=low * rise, duration=duration)


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


# --- maneuvers ------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Maneuver(Result):
    """A voltage command of finite length; call it with times to have the voltage.

    Attributes
    ----------
    name : str
        For people, such as "step 9 V"; `dataclasses.replace(m, name=...)` gives another.
    length : float
        Duration. [s]
    pieces : tuple of (float, callable)
        Starts [s], the first at 0, and curves in their order. At a jump the later piece holds.
    amplitude : float
        What the maneuver states and its voltage never exceeds, inf where it states none. [V]
    """

    name: str
    length: float
    pieces: tuple[Piece, ...]
    amplitude: float = math.inf

    def __call__(self, time: npt.ArrayLike) -> Array:
        """Voltage [V] at `time` [s] of any shape, zero outside [0, length]."""
        return self._at(time)[0]

    def slope(self, time: npt.ArrayLike) -> Array:
        """Exact dV/dt [V/s] at `time` [s] of any shape, at a jump or kink of what follows it."""
        return self._at(time)[1]

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
        moved = ((self.length + start, curve) for start, curve in after.pieces)
        name, length = f"{self.name} + {after.name}", self.length + after.length
        amplitude = max(self.amplitude, after.amplitude)
        return Maneuver(name, length, (*self.pieces, *moved), amplitude)

    def __mul__(self, factor: float) -> Maneuver:
        factor = finite("factor", factor)
        pieces = ((start, partial(scaled, factor=factor, curve=c)) for start, c in self.pieces)
        amplitude = abs(factor) * self.amplitude if factor else 0.0
        return Maneuver(f"{factor:g} * ({self.name})", self.length, tuple(pieces), amplitude)

    __rmul__ = __mul__

    def __neg__(self) -> Maneuver:
        return replace(-1.0 * self, name=f"-({self.name})")

    def _at(self, time: npt.ArrayLike) -> tuple[Array, Array]:
        """Voltage and slope: of each time by the piece that holds there."""
        stamps = np.asarray(time, dtype=float)
        nothing = np.where(np.isnan(stamps), np.nan, 0.0)
        voltage, slope = nothing, nothing.copy()
        inside = (stamps >= 0.0) & (stamps <= self.length + NEAR)
        stamps = np.minimum(stamps, self.length)
        holding = np.where(inside, interval([start for start, _ in self.pieces], stamps), -1)
        for index, (start, curve) in enumerate(self.pieces):
            here = holding == index
            voltage[here], slope[here] = curve(np.maximum(stamps[here] - start, 0.0))
        # the curves stay within the amplitude, rounding errors apart; a number for a number
        return np.clip(voltage, 0.0 - self.amplitude, self.amplitude)[()], slope[()]


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
    # a shorter one rests from its end on, the end included, as after any jump
    longer = (each if each.length == length else returned(each, length) for each in maneuvers)
    together = partial(summed, curves=[each._at for each in longer])
    amplitude = sum(each.amplitude for each in maneuvers)
    return Maneuver(" with ".join(m.name for m in maneuvers), length, ((0.0, together),), amplitude)


def returned(before: Maneuver, length: float, curve: Curve = line) -> Maneuver:
    """A maneuver with a curve from its end on until `length` [s], to the last bit."""
    return replace(before, length=length, pieces=(*before.pieces, (before.length, curve)))


def settled(
    name: str, amplitude: float, pieces: Sequence[Piece], end: float, length: float
) -> Maneuver:
    """Rest, the pieces until `end` [s], and the return if there is time left until `length` [s]."""
    command = Maneuver(name, end, ((0.0, line), *pieces), abs(amplitude))
    if not end < length:
        return command
    level, slope = float(command(end)), float(command.slope(end))
    return returned(command, length, return_within(abs(amplitude), level, slope, length - end))


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
