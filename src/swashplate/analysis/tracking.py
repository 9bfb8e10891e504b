"""Tracking of a wanted speed: its measures, and the largest sine that is followed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import ceil, log
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis.compensation import InverseMap, inverse_map
from swashplate.analysis.outcomes import rms_difference
from swashplate.drive import Drive
from swashplate.equations.marching.record import SOURCE_RATE
from swashplate.errors import InputError
from swashplate.linear import FEWEST_STEPS, SLOWEST_CYCLE, slowest_lag
from swashplate.results import Result
from swashplate.tables import Cell, Column, Table

if TYPE_CHECKING:
    from swashplate.simulation.result import Simulation

Array = NDArray[np.float64]

# --- what the inverse map buys --------------------------------------------------------------------


class TrackingError(NamedTuple):
    """Speed less the wanted speed over a record. [rad/s]"""

    rms: float
    largest: float  # Magnitude.


@dataclass(frozen=True, eq=False)
class Tracked(Result):
    """One way to command a wanted speed, and how the drive then follows."""

    name: str
    run: Simulation
    error: TrackingError


@dataclass(frozen=True, eq=False)
class Improvement(Result):
    """A wanted speed commanded in several ways, the plainest first."""

    name: str  # Name of the drive.
    time: Array  # (n,). [s]
    wanted: Array  # (n,). [rad/s]
    ways: tuple[Tracked, ...]


def proportional_command(inverse: InverseMap, wanted: ArrayLike) -> Array:
    """Voltage of a controller that knows nothing of the drive but its full speed each way. [V]

    A straight line each way from 0 V at standstill to the saturation voltage at the limit.
    """
    speed, (low, high) = np.asarray(wanted, dtype=np.float64), inverse.limits
    up, down = inverse.plus.voltage[-1] / high, inverse.minus.voltage[0] / low
    return np.asarray(np.where(speed >= 0.0, up * speed, down * speed))


def wanted_of_stick(inverse: InverseMap, voltage: ArrayLike) -> Array:
    """Speed that a stick asks for: in proportion, ±10 V for the full speed of that way. [rad/s]"""
    volts, (low, high) = np.asarray(voltage, dtype=np.float64), inverse.limits
    return np.asarray(np.where(volts >= 0.0, 0.1 * high * volts, -0.1 * low * volts))


def improvement(
    drive: Drive,
    wanted_speed: ArrayLike,
    rate: float = SOURCE_RATE,
    *,
    inverse: InverseMap | None = None,
) -> Improvement:
    """What the inverse map buys: a wanted speed simulated with and without it.

    Parameters
    ----------
    drive : Drive
        What is driven.
    wanted_speed : (n,) array_like
        [rad/s]
    rate : float
        Its samples a second. [Hz]
    inverse : InverseMap, optional
        The map to use, of another drive perhaps, to see what a wrong one does; by default this
        drive's own.

    Returns
    -------
    Improvement
        Three ways: ``"straight line"`` (`proportional_command`), ``"inverse map"``
        (`InverseMap.voltage`), ``"inverse map and lead"`` (`InverseMap.command`).

    Raises
    ------
    InputError
        For a wanted speed beyond the drive's limits, or a record that cannot be simulated.
    """
    chosen = inverse_map(drive) if inverse is None else inverse
    led = chosen.command(wanted_speed, rate)
    wanted = np.array(wanted_speed, dtype=np.float64)
    commands = {
        "straight line": proportional_command(chosen, wanted),
        "inverse map": chosen.voltage(wanted),
        "inverse map and lead": led,
    }
    ways = []
    for name, voltage in commands.items():
        run = drive.simulate(voltage, rate)
        largest = float(np.abs(run.shaft_speed - wanted).max())
        error = TrackingError(rms_difference(run.shaft_speed, wanted), largest)
        ways.append(Tracked(name, run, error))
    return Improvement(drive.name, ways[0].run.time, wanted, tuple(ways))


# --- largest sine ---------------------------------------------------------------------------------

AMPLITUDES = 40  # Amplitudes that are tried from the top speed down before one is refined.
SMALLEST = 1e-2  # Smallest amplitude tried, as part of the top speed.
CLOSE = 1e-3  # Relative width at which an amplitude counts as found.
FORGOTTEN = 8.0  # Lags that a simulation lasts before the cycle that is looked at.


@dataclass(frozen=True, eq=False)
class LargestSine(Result):
    """Largest amplitude of speed followed at each frequency, (f,); 0 where none is.

    The error is the rms of speed less wanted speed over a cycle, by the rms of the wanted sine.
    """

    name: str  # Name of the drive.
    error: float  # The chosen error. [1]
    frequencies: Array  # [Hz]
    shifted: Array
    """Amplitude with the lag forgiven: against the wanted sine shifted in time by as much as suits
    the drive best. For a command that is known ahead, or where being late does no harm. [rad/s]"""
    in_time: Array  # Amplitude with the lag counted: against the wanted sine itself. [rad/s]

    def table(self) -> Table:
        """The largest sine at each frequency."""
        made = Table(
            f"Largest sine followed within {100.0 * self.error:g} %",
            (
                Column("frequency", "g", "Hz"),
                Column("with time shift", ".2f", "rad/s"),
                Column("without", ".2f", "rad/s"),
            ),
        )
        for frequency, *amplitudes in zip(
            self.frequencies, self.shifted, self.in_time, strict=True
        ):
            made.add(frequency, *(a if a > 0.0 else Cell(0.0, "none") for a in amplitudes))
        return made


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
    top = min(map(abs, inverse.limits))

    @cache
    def errors(amplitude: float) -> tuple[float, float]:
        return sine_errors(drive, inverse, amplitude, frequency, settling)

    grid = np.geomspace(top, SMALLEST * top, AMPLITUDES).tolist()
    found = [0.0, 0.0]
    for which in (0, 1):
        followed = next((n for n, a in enumerate(grid) if errors(a)[which] <= error), None)
        if followed is None:
            continue
        good, bad = grid[followed], grid[max(followed - 1, 0)]
        while log(bad / good) > CLOSE:
            middle = (good * bad) ** 0.5
            if errors(middle)[which] <= error:
                good = middle
            else:
                bad = middle
        found[which] = good
    return found[0], found[1]


def sine_errors(
    drive: Drive, inverse: InverseMap, amplitude: float, frequency: float, settling: float
) -> tuple[float, float]:
    """Errors of a sine of speed by its rms, the lag forgiven and counted. [1]

    Of an amplitude [rad/s] and a frequency [Hz], after a time to settle [s].

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
    forgiven, counted = (float(np.sqrt(other + each)) / amplitude for each in (shifted, in_time))
    return forgiven, counted


def improvement_table(bought: Improvement, name: str) -> Table:
    """Errors of the speed under a command, controller by controller.

    Raises
    ------
    InputError
        If the command asks for standstill only.
    """
    plainest = bought.ways[0].error.rms
    if plainest == 0.0:
        raise InputError(f"{name} asks for nothing but standstill; take one that moves the drive.")
    made = Table(
        f"Error of the speed under {name}",
        (
            Column("Controller"),
            Column("rms", ".3f", "rad/s"),
            Column("largest", ".3f", "rad/s"),
            Column("rms", ".1%"),
        ),
    )
    for way in bought.ways:
        made.add(way.name, way.error.rms, way.error.largest, way.error.rms / plainest)
    return made
