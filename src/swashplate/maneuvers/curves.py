"""Curves: voltages [V] and their slopes [V/s] as functions of the time since they began [s]."""
# ruff: noqa: D102 - what the two methods of every curve return is said once, by Curve

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from typing import Protocol

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

NEAR = 1e-9
"""An instant this little before a jump, or after the end, counts as being there. [s]

Decimal durations do not add up exactly (0.1 + 0.2 > 0.3), and a step must not miss the sample meant
for it.
"""
HALVINGS = 60
"""Of the slope of a return until it is found, to the last bits."""


def interval(starts: npt.ArrayLike, time: Array) -> npt.NDArray[np.intp]:
    """Index of the last of the `starts` [s], in their order, that each `time` [s] has reached."""
    return np.searchsorted(starts, time + NEAR, side="right") - 1


class Curve(Protocol):
    """What a piece of a manoeuvre follows; both methods take an array of times [s]."""

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
