"""The load: a point mass on a rope that can only pull, by Störmer and Verlet's step.

The step needs nothing but positions of the boom's tip: no angles, which are singular where the rope
lies level, and no accelerations of the tip, which drives with jumps do not have. The rope's pull is
the multiplier that puts the load back on the sphere around the new tip; it follows from a quadratic
in closed form, is zero where the rope is slack, and there is no drift.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.crane.kinematics import Vector
from swashplate.equations import equation, kernel
from swashplate.errors import InputError

Array = NDArray[np.float64]

GRAVITY = 9.80665
"""Standard acceleration of free fall. [m/s²]"""
AIR = 1.225
"""Density of air at 15 °C and sea level. [kg/m³]"""
TOO_FAST = -1.0
"""Pull that says that the tip moves through the rope's length within a step."""


class Air(NamedTuple):
    """What the air does to the load."""

    drag: float
    """k = ρ C_d A/(2 m): deceleration for each (m/s)² against the air. [1/m]"""
    wind: Vector
    """Velocity of the air. [m/s]"""


class Load(NamedTuple):
    """The load after a step."""

    position: Vector
    """[m]"""
    pull: float
    """Tension of the rope over this step for each kilogram of load, 0 where it is slack. [N/kg]"""


@equation
def air_drag(vx: float, vy: float, vz: float, air: Air) -> Vector:
    """Deceleration by the air at a velocity of the load, -k |v - w| (v - w). [m/s²]"""
    x, y, z = vx - air.wind.x, vy - air.wind.y, vz - air.wind.z
    share = -air.drag * sqrt(x * x + y * y + z * z)
    return Vector(share * x, share * y, share * z)


@equation
def held(free: Vector, along: Vector, tip: Vector, length: float, pulls: float) -> Load:
    """The load on or within the sphere around its tip.

    Parameters
    ----------
    free : Vector
        e, where an unconstrained step ends, seen from the new tip. [m]
    along : Vector
        d, from the old tip to the load, along which the rope has pulled. [m]
    tip, length :
        p and L at the step's end. [m]
    pulls : float
        What the pull is for each μ |d|: 1/h², 2/h² in the first step. [1/s²]

    Notes
    -----
    |e - μ d| = L is a quadratic in μ; its small root, written so that nothing cancels, is
    μ = o/(e·d + √((e·d)² - d·d o)) with o = e·e - L².
    """
    o = free.x * free.x + free.y * free.y + free.z * free.z - length * length
    ed = free.x * along.x + free.y * along.y + free.z * along.z
    dd = along.x * along.x + along.y * along.y + along.z * along.z
    root = ed * ed - dd * o
    bad = o > 0.0 and (root < 0.0 or ed <= 0.0)
    taut = o > 0.0 and not bad
    multiplier = o / (ed + sqrt(root)) if taut else 0.0
    position = Vector(
        tip.x + free.x - multiplier * along.x,
        tip.y + free.y - multiplier * along.y,
        tip.z + free.z - multiplier * along.z,
    )
    return Load(position, TOO_FAST if bad else multiplier * sqrt(dd) * pulls)


@equation
def rope_step(
    now: Vector, before: Vector, tip: Vector, following: Vector, length: float, air: Air, h: float
) -> Load:
    """The load one step later.

    Parameters
    ----------
    now, before : Vector
        Load at n and n - 1. [m]
    tip, following : Vector
        Tip at n and n + 1. [m]
    length : float
        Rope at n + 1. [m]
    air : Air
        Drag and wind.
    h : float
        Step. [s]
    """
    dx, dy, dz = now.x - before.x, now.y - before.y, now.z - before.z
    without = Vector(0.0, 0.0, 0.0)
    drag = air_drag(dx / h, dy / h, dz / h, air) if air.drag > 0.0 else without
    free = Vector(
        now.x + dx + h * h * drag.x - following.x,
        now.y + dy + h * h * drag.y - following.y,
        now.z + dz + h * h * (drag.z - GRAVITY) - following.z,
    )
    along = Vector(now.x - tip.x, now.y - tip.y, now.z - tip.z)
    return held(free, along, following, length, 1.0 / (h * h))


@equation
def first_step(
    start: Vector, v: Vector, tip: Vector, following: Vector, length: float, air: Air, h: float
) -> Load:
    """The load after the first step, from its place and velocity [m/s]; else as `rope_step`."""
    drag = air_drag(v.x, v.y, v.z, air)
    free = Vector(
        start.x + h * v.x + 0.5 * h * h * drag.x - following.x,
        start.y + h * v.y + 0.5 * h * h * drag.y - following.y,
        start.z + h * v.z + 0.5 * h * h * (drag.z - GRAVITY) - following.z,
    )
    along = Vector(start.x - tip.x, start.y - tip.y, start.z - tip.z)
    return held(free, along, following, length, 2.0 / (h * h))


# --- march ----------------------------------------------------------------------------------------


@kernel
def _march(
    tip: Array, length: Array, v: Vector, air: Air, h: float, load: Array, pull: Array
) -> int:
    """Fill the paths of load and pull behind their first sample; the sample that failed, or 0."""
    before = Vector(load[0, 0], load[0, 1], load[0, 2])
    now = before
    at = Vector(tip[0, 0], tip[0, 1], tip[0, 2])
    for n in range(1, tip.shape[0]):
        following = Vector(tip[n, 0], tip[n, 1], tip[n, 2])
        if n == 1:
            made = first_step(now, v, at, following, length[n], air, h)
        else:
            made = rope_step(now, before, at, following, length[n], air, h)
        if made.pull < 0.0:
            return n
        before, now, at = now, made.position, following
        load[n, 0], load[n, 1], load[n, 2] = now.x, now.y, now.z
        pull[n] = made.pull
    return 0


class LoadMotion(NamedTuple):
    """Path of a load."""

    position: Array
    """(n, 3), as the tip's. [m]"""
    pull: Array
    """(n,) tension for each kilogram of load over the step that ends here; 0 is slack. [N/kg]"""


def load_motion(
    tip: ArrayLike,
    length: ArrayLike,
    rate: float = 512.0,
    *,
    start: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    drag: float = 0.0,
    wind: ArrayLike = (0.0, 0.0, 0.0),
) -> LoadMotion:
    """Path of a load whose rope's upper end moves along a given path.

    Parameters
    ----------
    tip : (n, 3) array_like
        Path of the upper end, z up, inertial. [m]
    length : (n,) array_like or float
        Length of the rope. [m]
    rate : float
        Samples a second. [Hz]
    start, velocity : (3,) array_like, optional
        Of the load; by default it hangs below the tip and moves with it. [m], [m/s]
    drag : float
        ρ C_d A/(2 m). [1/m]
    wind : (3,) array_like
        Velocity of the air. [m/s]

    Raises
    ------
    InputError
        For paths that do not fit together, and where the tip moves, within a step, by the order of
        the rope's length.
    """
    path = np.ascontiguousarray(tip, dtype=np.float64)
    if path.ndim != 2 or path.shape[1] != 3 or len(path) < 2:
        raise InputError("The tip's path needs two or more rows of x, y and z.")
    rope = np.ascontiguousarray(np.broadcast_to(np.asarray(length, dtype=np.float64), len(path)))
    if not (np.isfinite(path).all() and np.isfinite(rope).all() and rope.min() > 0.0):
        raise InputError("Tip and rope must be finite everywhere, and the rope longer than 0 m.")
    load, pull = np.empty_like(path), np.full(len(path), GRAVITY)
    load[0] = path[0] - (0.0, 0.0, rope[0]) if start is None else start
    # second-order difference of the first samples
    slope = (4.0 * path[1] - 3.0 * path[0] - path[min(2, len(path) - 1)]) * rate / 2.0
    v = slope if velocity is None else np.asarray(velocity, dtype=np.float64)
    air = Air(float(drag), Vector(*map(float, np.asarray(wind))))
    failed = _march(path, rope, Vector(*map(float, v)), air, 1.0 / rate, load, pull)
    if failed:
        raise InputError(too_fast(float(rope[failed]), failed / rate, rate))
    pull[0] = pull[1]
    return LoadMotion(load, pull)


def too_fast(length: float, time: float, rate: float) -> str:
    """Sentence for a rope that is too short for the step."""
    return (
        f"At {time:g} s the boom's tip moves within one sample by more than a rope of "
        f"{length:.3g} m lets the load follow: take a longer rope, a smoother path or more than "
        f"{rate:g} samples a second."
    )
