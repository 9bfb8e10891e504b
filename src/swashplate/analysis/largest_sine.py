"""The largest sine of speed that a drive follows at each frequency, within an error."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, log
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis.compensation import inverse_map
from swashplate.analysis.inverse import InverseMap
from swashplate.drive import Drive
from swashplate.equations.marching.record import SOURCE_RATE
from swashplate.errors import InputError
from swashplate.linear import FEWEST_STEPS, SLOWEST_CYCLE, slowest_lag

if TYPE_CHECKING:
    import polars

Array = NDArray[np.float64]

AMPLITUDES = 40
"""Amplitudes that are tried from the top speed down before one is refined."""
SMALLEST = 1e-2
"""Smallest amplitude tried, as part of the top speed."""
CLOSE = 1e-3
"""Relative width at which an amplitude counts as found."""
FORGOTTEN = 8.0
"""Lags that a simulation lasts before the cycle that is looked at."""


@dataclass(frozen=True, eq=False)
class LargestSine:
    """Largest amplitude of speed followed at each frequency, (f,); 0 where none is.

    The error is the rms of speed less wanted speed over a cycle, by the rms of the wanted sine.
    """

    name: str
    """Name of the drive."""
    error: float
    """The chosen error. [1]"""
    frequencies: Array
    """[Hz]"""
    shifted: Array
    """Amplitude with the lag forgiven: against the wanted sine shifted in time by as much as suits
    the drive best. For a command that is known ahead, or where being late does no harm. [rad/s]"""
    in_time: Array
    """Amplitude with the lag counted: against the wanted sine itself. [rad/s]"""

    def to_polars(self) -> polars.DataFrame:
        """Table in SI, a row a frequency."""
        import polars as pl

        return pl.DataFrame(
            {"frequency": self.frequencies, "shifted": self.shifted, "in_time": self.in_time}
        )


def largest_sine(drive: Drive, frequencies: ArrayLike, error: float = 0.1) -> LargestSine:
    """Largest sine of speed about standstill that a drive follows, commanded by its inverse map.

    Parameters
    ----------
    drive : Drive
        The drive.
    frequencies : (f,) array_like
        From 1 mHz to 64 Hz, an eighth of the steps a second. [Hz]
    error : float
        Chosen error, rms by rms, above 0 and below 1. [1]

    Returns
    -------
    LargestSine
        The amplitudes to 0.1 %; the smaller of the speed limits is the largest of them, and what
        is followed only below a hundredth of it counts as none.

    Raises
    ------
    InputError
        For an error or frequencies out of range.
    DomainError
        If the steady map has no inverse.
    """
    try:
        f = np.atleast_1d(np.array(frequencies, dtype=np.float64))
    except (TypeError, ValueError):
        raise InputError("The frequencies must be a sequence of numbers.") from None
    highest = SOURCE_RATE / FEWEST_STEPS
    if f.ndim != 1 or f.size == 0 or not ((f >= SLOWEST_CYCLE) & (f <= highest)).all():
        raise InputError(
            f"The frequencies must be numbers from {SLOWEST_CYCLE:g} to {highest:g} Hz: above, a "
            f"cycle has fewer than {FEWEST_STEPS} of the {SOURCE_RATE:g} steps a second."
        )
    if not 0.0 < error < 1.0:
        raise InputError(
            f"The error is {error:g}, but must be above 0 and below 1: no drive follows a sine "
            "without error, and standing still is an error of 1."
        )
    inverse = inverse_map(drive)
    settling = FORGOTTEN * slowest_lag(drive.parameters)
    shifted, in_time = np.zeros_like(f), np.zeros_like(f)
    for n, frequency in enumerate(f.tolist()):
        shifted[n], in_time[n] = _at(drive, inverse, frequency, settling, error)
    return LargestSine(drive.name, float(error), f, shifted, in_time)


def _at(
    drive: Drive, inverse: InverseMap, frequency: float, settling: float, error: float
) -> tuple[float, float]:
    """Amplitudes with the lag forgiven and counted. [rad/s]"""
    low, high = inverse.limits
    top = min(-low, high)
    known: dict[float, tuple[float, float]] = {}

    def errors(amplitude: float) -> tuple[float, float]:
        if amplitude not in known:
            known[amplitude] = sine_errors(drive, inverse, amplitude, frequency, settling)
        return known[amplitude]

    grid = np.geomspace(top, SMALLEST * top, AMPLITUDES).tolist()
    found = []
    for which in (0, 1):
        followed = next((n for n, a in enumerate(grid) if errors(a)[which] <= error), None)
        if followed is None:
            found.append(0.0)
            continue
        good, bad = grid[followed], grid[max(followed - 1, 0)]
        while log(bad / good) > CLOSE:
            middle = (good * bad) ** 0.5
            if errors(middle)[which] <= error:
                good = middle
            else:
                bad = middle
        found.append(good)
    return found[0], found[1]


def sine_errors(
    drive: Drive, inverse: InverseMap, amplitude: float, frequency: float, settling: float
) -> tuple[float, float]:
    """Errors of a sine of speed by its rms, the lag forgiven and counted.

    Parameters
    ----------
    drive : Drive
        The drive.
    inverse : InverseMap
        Makes the voltage of the wanted speed.
    amplitude, frequency : float
        Of the wanted speed. [rad/s, Hz]
    settling : float
        Time before the cycle that counts. [s]

    Notes
    -----
    Over whole cycles the error's square is the sum of those of mean, first harmonic and the rest;
    a shift in time turns the first harmonic and leaves all else, so that the best one leaves the
    difference of the amplitudes.
    """
    steps = ceil(SOURCE_RATE / frequency * (1.0 - 1e-12))
    turn = 2.0 * np.pi * np.arange(steps) / steps
    cycle = inverse.voltage(amplitude * np.sin(turn), clip=True)
    count = ceil(settling * frequency) + 1
    run = drive.simulate(np.tile(cycle, count), steps * frequency)
    speed = run.shaft_speed[-steps:]
    mean = float(speed.mean())
    first = 2j / steps * complex((speed - mean) @ np.exp(-1j * turn))
    rest = speed - mean - np.imag(first * np.exp(1j * turn))
    other = 2.0 * float(mean**2 + np.mean(rest**2))
    shifted, in_time = (abs(first) - amplitude) ** 2, abs(first - amplitude) ** 2
    return (
        float(np.sqrt(other + shifted)) / amplitude,
        float(np.sqrt(other + in_time)) / amplitude,
    )
