"""Where a run is an operation, and the direction of its rope in the crane's axes.

The load is a point on a free rope. Beyond some 30 degrees of swing nobody operates, the rope slips
off its sheave, boom and deck are in the way, and a number that the model gives is not one to use.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.crane.axes import RATE
from swashplate.crane.result import CraneRun
from swashplate.crane.rope import swing_of

Array = NDArray[np.float64]

EDGE_DEG = 30.0
"""Swing beyond which a run is not an operation: off-leads of crane codes are below 10 degrees, and
from here on the rope leaves the sheave's groove. [deg]"""
EVERY = 32
"""Samples from one that is looked at to the next; a slack rope is looked for at every sample."""


class Left(NamedTuple):
    """When and why a run has left the model."""

    time: float
    """[s]"""
    reason: str


def leads_of(load: Array, tip: Array, ship: Array, slew: Array) -> tuple[Array, Array]:
    """Off-lead and side-lead: angles of the rope in the crane's own axes. [rad]

    Parameters
    ----------
    load, tip : (n, 3) array
        Inertial. [m]
    ship : (n, 6) or (n, 1) array
        Its motion; one column if it is at rest.
    slew : (n,) array
        From forward to starboard. [rad]

    Returns
    -------
    tuple of (n,) array
        In the boom's plane, positive outwards, and across it, positive to starboard of the boom.
        Both have the ship's roll, pitch and list in them, as a crane's structure has.
    """
    along = load - tip
    if ship.shape[1] > 1:
        along = _to_ship(along, ship[:, 3], ship[:, 4], ship[:, 5])
    c, s = np.cos(slew), np.sin(slew)
    down = -along[:, 2]
    out = along[:, 0] * c - along[:, 1] * s
    across = -along[:, 0] * s - along[:, 1] * c
    return np.arctan2(out, down), np.arctan2(across, down)


def _to_ship(v: Array, roll: Array, pitch: Array, yaw: Array) -> Array:
    """Components along the ship's axes, Rᵀ v with R = Rz(yaw) Ry(pitch) Rx(roll)."""
    c, s = np.cos(yaw), np.sin(yaw)
    x, y, z = c * v[:, 0] + s * v[:, 1], c * v[:, 1] - s * v[:, 0], v[:, 2]
    c, s = np.cos(pitch), np.sin(pitch)
    x, z = c * x - s * z, s * x + c * z
    c, s = np.cos(roll), np.sin(roll)
    return np.stack([x, c * y + s * z, c * z - s * y], axis=1)


def left_model(run: CraneRun) -> Left | None:
    """When and why a run is not an operation any more; None if it is one to its end.

    The first of: a swing beyond `EDGE_DEG`, a slack rope, a rope that lies on the boom, a load in
    the water, below z = 0.
    """
    some = slice(None, None, EVERY)
    load, tip = run.load[some], run.tip[some]
    out, _ = leads_of(load, tip, run.ship[some], run["shaft_slew"][some] + run.fixed.home.slew)
    boom = np.arctan2(run["boom_sin"][some], run["boom_cos"][some])
    # the first sample has no step behind it
    slack = np.flatnonzero(run["pull"][2:] <= 0.0) + 2
    reasons = {
        f"its swing exceeds {EDGE_DEG:g} deg": _first(np.degrees(swing_of(load, tip)) > EDGE_DEG),
        "the rope is slack": slack[0] / RATE if slack.size else np.inf,
        "the rope lies on the boom": _first(out <= boom - 0.5 * np.pi),
        "the load is in the water": _first(load[:, 2] < 0.0),
    }
    reason = min(reasons, key=lambda name: reasons[name])
    return Left(reasons[reason], reason) if np.isfinite(reasons[reason]) else None


def _first(beyond: NDArray[np.bool_]) -> float:
    """Time of the first of the samples that are looked at. [s]"""
    found = np.flatnonzero(beyond)
    return float(found[0] * EVERY / RATE) if found.size else np.inf
