"""Inverting a drive's steady map: dead zone, creep and saturation made up for."""

from __future__ import annotations

import numpy as np

from swashplate.analysis.acceleration import starting_acceleration
from swashplate.analysis.inverse import Branch, InverseMap
from swashplate.analysis.steady_edges import dead_zone, saturation
from swashplate.drive import Drive
from swashplate.errors import DomainError, InputError
from swashplate.parameters.rules import FULL_VOLTAGE

__all__ = ["Branch", "InverseMap", "inverse_map"]

FEWEST, MOST = 2, 10_001
"""Points each way."""
LAG_FREQUENCY = 1e-4
"""Frequency at which the lag of small motions is read, far below all of a drive's own. [Hz]"""


def inverse_map(drive: Drive, points: int = 101) -> InverseMap:
    """The inverse of a drive's steady map, exact at its points.

    Parameters
    ----------
    drive : Drive
        The drive.
    points : int
        Points each way, evenly spaced in voltage from the dead zone's edge to saturation. 2 to
        10001.

    Returns
    -------
    InverseMap
        With straight lines between the points, which any controller can follow, and their error.

    Raises
    ------
    InputError
        For another number of points.
    DomainError
        Where there is no inverse: no command moves the drive one way, or a larger command makes it
        slower.
    """
    if not FEWEST <= points <= MOST:
        raise InputError(f"An inverse map takes {FEWEST} to {MOST} points each way, not {points}.")
    plus, minus = (_branch(drive, way, points) for way in (1.0, -1.0))
    creep = float(drive.steady_speed(0.0))
    if not minus.speed[-1] <= creep <= plus.speed[0]:
        raise DomainError(
            f"{drive.name} creeps at {np.degrees(creep):.4g} deg/s at 0 V, but the smallest "
            f"commands make it {np.degrees(minus.speed[-1]):.4g} and "
            f"{np.degrees(plus.speed[0]):.4g} deg/s, so that its steady map has no inverse; check "
            "Z17, Z18 and the card's J."
        )
    acceleration = tuple(abs(starting_acceleration(drive, way)[0]) for way in (1.0, -1.0))
    return InverseMap(
        drive.name,
        minus,
        plus,
        creep,
        (acceleration[0], acceleration[1]),
        _lag(drive, plus, minus),
        max(_error(drive, branch) for branch in (plus, minus)),
    )


def _branch(drive: Drive, way: float, points: int) -> Branch:
    """Points of one way, from the lower voltage to the higher."""
    start = dead_zone(drive, way).outside
    end = saturation(drive, way)
    end = way * FULL_VOLTAGE if end is None else end
    side = "positive" if way > 0.0 else "negative"
    if start is None or start == end:
        raise DomainError(
            f"No {side} command up to {FULL_VOLTAGE:g} V moves {drive.name}, so its steady map has "
            "no inverse; check V_dz, J, G1 to G3 and Z17."
        )
    volts = np.sort(np.linspace(start, end, points))
    speed = drive.steady_speed(volts)
    falls = np.flatnonzero(np.diff(speed) <= 0.0)
    if falls.size:
        n = int(falls[0])
        raise DomainError(
            f"The steady speed of {drive.name} does not rise from {volts[n]:.4g} to "
            f"{volts[n + 1]:.4g} V, so its steady map has no inverse there; check G1, G2 and G3."
        )
    return Branch(speed, volts)


def _error(drive: Drive, branch: Branch) -> float:
    middle = 0.5 * (branch.speed[1:] + branch.speed[:-1])
    volts = 0.5 * (branch.voltage[1:] + branch.voltage[:-1])
    return float(np.abs(drive.steady_speed(volts) - middle).max())


def _lag(drive: Drive, plus: Branch, minus: Branch) -> float:
    """Lag of slow small motions half way up the map, mean of both ways. [s]"""
    lags = []
    for branch in (plus, minus):
        model = drive.linearize(float(0.5 * (branch.voltage[0] + branch.voltage[-1])))
        phase = float(np.angle(model.response([LAG_FREQUENCY])[0, 0]))
        lags.append(-phase / (2.0 * np.pi * LAG_FREQUENCY))
    return 0.5 * sum(lags)
