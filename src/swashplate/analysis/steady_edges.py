"""Where the steady map changes character: ends of the dead zone, and of what a voltage can move."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.drive import Drive
from swashplate.parameters.rules import FULL_VOLTAGE

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

GRID = 200
"""Parts into which an interval is cut at each refinement."""
CLOSE = 1e-12
"""Width at which an edge counts as found. [V]"""
NEARLY_FULL = (1.0 - 1e-9) * FULL_VOLTAGE
"""An edge beyond is none: the speed grows up to full voltage. [V]"""


class Edge(NamedTuple):
    """A voltage up to which something holds on the way from 0 V, and the next one beyond it."""

    inside: float
    """[V]"""
    outside: float | None
    """None where it holds up to full voltage. [V]"""


def edge(holds: Callable[[Array], Mask], end: float) -> Edge:
    """The last command on the way from 0 V to `end` before something first fails to hold.

    Parameters
    ----------
    holds : callable
        Commands [V] to whether it holds, element by element.
    end : float
        Where to stop, with its sign. [V]

    Returns
    -------
    Edge
        Both sides of it, at most 1e-12 V apart; 0 V inside where it does not even hold there.
    """
    low, high, found = 0.0, end, False
    while abs(high - low) > CLOSE:
        grid = np.linspace(low, high, GRID + 1)
        failed = ~holds(grid)
        if not failed.any():
            break
        first, found = int(np.argmax(failed)), True
        if first == 0:
            return Edge(0.0, float(grid[0]))
        if (low, high) == (float(grid[first - 1]), float(grid[first])):
            break
        low, high = float(grid[first - 1]), float(grid[first])
    return Edge(low, high) if found else Edge(end, None)


def dead_zone(drive: Drive, way: float) -> Edge:
    """Commands that leave the current within the solenoids' dead zone Z17, so that no force acts.

    Parameters
    ----------
    drive : Drive
        Whose card and solenoids are meant.
    way : float
        +1 or -1.
    """
    dead = drive.parameters.numbers["Z17"]

    def is_dead(volts: Array) -> Mask:
        return np.asarray(np.abs(drive.steady_current(volts)) <= dead)

    return edge(is_dead, way * FULL_VOLTAGE)


def saturation(drive: Drive, way: float) -> float | None:
    """Command beyond which the steady speed stays as it is, None where it grows up to ±10 V. [V]"""
    full = drive.steady_speed(way * FULL_VOLTAGE)

    def changes(volts: Array) -> Mask:
        return np.asarray(drive.steady_speed(volts) != full)

    found = edge(changes, way * FULL_VOLTAGE)
    if found.outside is None or abs(found.inside) > NEARLY_FULL:
        return None
    return found.outside
