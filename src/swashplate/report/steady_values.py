"""What a drive settles at over its whole range of commands, and where its character changes."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.drive import Drive
from swashplate.parameters.rules import FULL_VOLTAGE

Array = NDArray[np.float64]

POINTS = 2001
"""Commands of a curve, besides those on both sides of the card's dead zone."""


class SteadyValues(NamedTuple):
    """Steady state over the command; as for a person, the angles are in degrees."""

    voltage: Array
    """[V]"""
    current: Array
    """Signed. [A]"""
    speed_deg_s: Array
    dead_zone: tuple[float, float]
    """Commands between which the current stays within the solenoids' dead zone. [V]"""
    saturation: tuple[float | None, float | None]
    """Commands beyond which the speed stays as it is, None where it changes up to ±10 V. [V]"""
    creep_deg_s: float
    """Speed at 0 V."""


def steady_values(drive: Drive) -> SteadyValues:
    """Steady states of a drive from -10 to 10 V."""
    voltage = _commands(drive)
    dead = drive.parameters.numbers["Z17"]
    full = {way: drive.steady_speed(way * FULL_VOLTAGE) for way in (-1.0, 1.0)}

    def is_dead(volts: Array) -> NDArray[np.bool_]:
        return np.asarray(np.abs(drive.steady_current(volts)) <= dead)

    def still_changes(volts: Array) -> NDArray[np.bool_]:
        final = full[float(np.sign(volts[-1]))]
        return np.asarray(~np.isclose(drive.steady_speed(volts), final, rtol=1e-9, atol=0.0))

    ends = (-FULL_VOLTAGE, FULL_VOLTAGE)
    low, high = (last_holding(is_dead, end) for end in ends)
    saturation = tuple(last_holding(still_changes, end) for end in ends)
    below, above = (None if abs(volts) > 0.999 * FULL_VOLTAGE else volts for volts in saturation)
    return SteadyValues(
        voltage,
        drive.steady_current(voltage),
        np.degrees(drive.steady_speed(voltage)),
        (low, high),
        (below, above),
        float(np.degrees(drive.steady_speed(0.0))),
    )


def _commands(drive: Drive) -> Array:
    """Commands close together, with the jump of the current as upright as it is."""
    numbers = drive.parameters.numbers
    plus, minus = numbers["V_dz_plus"], numbers["V_dz_minus"]
    jumps = (plus, np.nextafter(plus, np.inf), -minus, np.nextafter(-minus, -np.inf))
    even = np.linspace(-FULL_VOLTAGE, FULL_VOLTAGE, POINTS)
    return np.unique(np.clip(np.concatenate((even, jumps)), -FULL_VOLTAGE, FULL_VOLTAGE))


def last_holding(holds: Callable[[Array], NDArray[np.bool_]], end: float) -> float:
    """The last command on the way from 0 V to an end before something first fails to hold. [V]

    It is found to a millionth of a volt; 0 if it does not even hold there.
    """
    low, high = 0.0, end
    while abs(high - low) > 1e-6:
        grid = np.linspace(low, high, 201)
        failed = ~holds(grid)
        if not failed.any():
            return high
        first = int(np.argmax(failed))
        if first == 0:
            return low
        low, high = float(grid[first - 1]), float(grid[first])
    return low
