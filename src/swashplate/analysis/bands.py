"""Bands: where the speed lies at each instant, given what the tests left open."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis.draws import Draws
from swashplate.errors import DomainError, InputError

Array = NDArray[np.float64]

MOST_SAMPLES = 150_000_000
"""Samples of speed that a band may take: 1.2 GB."""


@dataclass(frozen=True, eq=False)
class Bands:
    """Where the speed lies at each instant."""

    time: Array
    """(n,) [s]"""
    lower: Array
    """(n,) [rad/s]"""
    median: Array
    """(n,) [rad/s]"""
    upper: Array
    """(n,) [rad/s]"""
    level: float
    """Part of the drives between lower and upper, instant by instant."""
    draws: int
    """Drives that it is taken from."""

    @property
    def widest(self) -> tuple[float, float]:
        """Largest width [rad/s] and when. [s]"""
        width = self.upper - self.lower
        at = int(np.argmax(width))
        return float(width[at]), float(self.time[at])


def bands(drawn: Draws, voltage: ArrayLike, rate: float = 512.0, *, level: float = 0.95) -> Bands:
    """Band of the shaft's speed over drawn drives, instant by instant.

    Parameters
    ----------
    drawn : Draws
        See `monte_carlo.drives`.
    voltage : (n,) array_like
        Command, from rest. [V]
    rate : float
        Samples a second. [Hz]
    level : float
        Part of the drives within the band, between 0 and 1.

    Raises
    ------
    InputError
        If the level is none, or the record is too long for so many drives.
    DomainError
        If a drive leaves the model's domain under the command.
    """
    if not 0.0 < level < 1.0:
        raise InputError(f"The level {level:g} of a band must lie between 0 and 1.")
    volts = np.asarray(voltage, dtype=np.float64)
    count = len(drawn.drives)
    if volts.size * count > MOST_SAMPLES:
        raise InputError(
            f"A band of {count} drives over {volts.size} samples takes too much memory: draw "
            f"{MOST_SAMPLES // volts.size} drives at most, or give the command at a lower rate."
        )
    run = drawn.drives[0].simulate_many(drawn.columns, voltage=volts, rate=rate)
    if run.failures:
        raise DomainError(f"A drawn drive cannot be simulated: {next(iter(run.failures.values()))}")
    assert run.output is not None
    run.output.sort(axis=0)
    tail = 0.5 * (1.0 - level)
    lower, median, upper = (_quantile(run.output, part) for part in (tail, 0.5, 1.0 - tail))
    return Bands(np.arange(volts.size) / rate, lower, median, upper, level, count)


def _quantile(ordered: Array, part: float) -> Array:
    """(n,) quantile of each column of sorted (m, n) values, between neighbours in proportion."""
    place = part * (len(ordered) - 1)
    below = int(place)
    above = min(below + 1, len(ordered) - 1)
    between: Array = ordered[below] + (place - below) * (ordered[above] - ordered[below])
    return between
