"""Manoeuvres as objects: curves one after another, to be sampled, scaled and joined."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from swashplate.errors import InputError
from swashplate.maneuvers.checks import finite, positive
from swashplate.maneuvers.curves import NEAR, Array, Curve, Scaled, interval

LONGEST = 100_000_000
"""Samples that a manoeuvre may have; more is a mistake and would not fit into memory."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A voltage from `start` on, until the next piece starts or the manoeuvre ends.

    Attributes
    ----------
    start : float
        From the beginning of the manoeuvre. [s]
    curve : Curve
        Voltage [V] and its slope [V/s] over the time since `start` [s].
    """

    start: float
    curve: Curve


@dataclass(frozen=True, eq=False)
class Maneuver:
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
        What the manoeuvre states and its voltage never exceeds, inf where it states none. [V]
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
