"""Numbers that say what a simulation did, in the units of people."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.limits import time_share
from swashplate.simulation.result import Limit

if TYPE_CHECKING:
    from swashplate.simulation.result import Simulation

Array = NDArray[np.float64]

REACHED = 0.9
"""Part of the settled speed that counts as reached."""


class Peaks(NamedTuple):
    """Largest values either way; zero where there is none."""

    positive: float
    negative: float


def degrees(radians: float) -> float:
    """An angle or speed in degrees, for a table."""
    return float(np.degrees(radians))


def peaks(signal: Array) -> Peaks:
    """Peaks of a signal, in its unit."""
    return Peaks(max(float(signal.max()), 0.0), min(float(signal.min()), 0.0))


def peak_speeds_deg_s(run: Simulation) -> Peaks:
    """Peaks of the shaft's speed. [deg/s]"""
    return peaks(np.degrees(run.shaft_speed))


def limit_shares(run: Simulation) -> dict[str, float]:
    """Share of the samples at which each limit acts, see `analysis.limits.time_share`, by name."""
    return {str(limit.name).lower().replace("_", " "): time_share(run, limit) for limit in Limit}


def largest_command(run: Simulation) -> float:
    """The largest voltage either way, with its sign. [V]"""
    voltage = _voltage(run)
    return float(voltage[np.argmax(np.abs(voltage))])


def time_to_reach(run: Simulation, settled_speed: float) -> float | None:
    """Time from the command's first move to 90 % of a speed, None if it is never reached.

    Parameters
    ----------
    run : Simulation
        A run by voltage.
    settled_speed : float
        The speed meant. [rad/s]

    Returns
    -------
    float or None
        Counted from the last sample before the command leaves its first value. [s]
    """
    voltage = _voltage(run)
    begin = max(int(np.argmax(voltage != voltage[0])) - 1, 0)
    part = run.shaft_speed[begin:] * np.sign(settled_speed)
    reached = part >= REACHED * abs(settled_speed)
    if settled_speed == 0.0 or not reached.any():
        return None
    return float(run.time[begin + np.argmax(reached)] - run.time[begin])


def rms_difference_deg_s(run: Simulation, other: Simulation) -> float:
    """Root of the mean squared difference of two speeds. [deg/s]"""
    difference = np.degrees(run.shaft_speed - other.shaft_speed)
    return float(np.sqrt(np.mean(difference**2)))


def _voltage(run: Simulation) -> Array:
    assert run.voltage is not None  # the command line simulates voltages only
    return run.voltage
