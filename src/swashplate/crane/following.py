"""What the axes of a crane can follow: the largest sines of its tip, and what seas ask for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import cos, pi, radians, sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.crane.crane import Crane
from swashplate.crane.kinematics import Boom, Vector, reach_rate, tip_of
from swashplate.crane.loop import half_clip
from swashplate.crane.sea import BAND, SEA_STATES, Seaway
from swashplate.crane.stepper import Pose
from swashplate.crane.stick import AXES
from swashplate.errors import InputError
from swashplate.results import Result
from swashplate.tables import Column, Table

Array = NDArray[np.float64]


class Demand(NamedTuple):
    """What a sea asks of the tip of a boom that shall stand still over the sea."""

    period: float
    """Mean time between crossings of zero of the motion along the boom. [s]"""
    amplitude: tuple[float, float, float]
    """Significant single amplitude: up, across the boom, along it. [m]"""


@dataclass(frozen=True, eq=False)
class Followable(Result):
    """Largest sines that the axes of a crane can follow."""

    periods: Array
    """(n,) [s]"""
    amplitude: Array
    """(n, 3) min(v/ω, a/ω²) of the hook's height by the hoist, of the tip across the boom by the
    slew, and along it by the luff. [m]"""
    seas: Mapping[str, Demand]
    crane: Crane = field(repr=False)
    pose: Pose

    figure = "plot_follow"

    def tables(self) -> list[Table]:
        """Amplitudes over the period, and what seas ask for."""
        heads = [Column(each, ".3f", "m") for each in AXES]
        made = Table("Largest sine an axis can follow", [Column("period", ".1f", "s"), *heads])
        for period, amplitudes in zip(self.periods, self.amplitude, strict=True):
            made.add(float(period), *map(float, amplitudes))
        columns = (Column("sea"), Column("period", ".1f", "s"), *heads)
        asked = Table("What seas ask, significant amplitudes", columns)
        for name, each in self.seas.items():
            asked.add(name, each.period, *each.amplitude)
        return [made, asked]


def follow(
    crane: Crane,
    periods: ArrayLike = tuple(range(4, 17)),
    *,
    seas: Sequence[str] = tuple(SEA_STATES),
    seaway: Seaway | None = None,
    slew_deg: float = 90.0,
    boom_deg: float = 45.0,
    rope_m: float = 27.0,
) -> Followable:
    """Largest amplitudes of the tip that each axis can follow, and what seas ask for.

    Parameters
    ----------
    crane : Crane
    periods : (n,) array_like
        [s]
    seas : sequence of str
        Names of `SEA_STATES`.
    seaway : Seaway, optional
        Ship and heading; by default the crane ship's hull in beam waves.
    slew_deg, boom_deg, rope_m : float
        Pose.

    Raises
    ------
    InputError
        For a period that is not above 0, or a pose beyond the crane's limits.
    """
    times = np.atleast_1d(np.asarray(periods, dtype=np.float64))
    if not (np.isfinite(times).all() and (times > 0.0).all() and times.size):
        raise InputError("Periods to follow must be above 0 s.")
    pose = Pose(radians(slew_deg), radians(boom_deg), rope_m)
    crane.home(pose)
    boom, g = Boom(cos(pose.boom), sin(pose.boom)), crane.geometry
    rates = (g.hoist, g.foot + g.boom * boom.cos, float(reach_rate(boom, g)))
    amplitude = np.array(
        [[_largest(crane, axis, rate, 2.0 * pi / t) for axis, rate in zip(AXES, rates, strict=True)]
         for t in times]
    )  # fmt: skip
    base = seaway or Seaway()
    asked = {name: demand(crane, pose, replace(base, sea=name)) for name in seas}
    return Followable(times, amplitude, asked, crane, pose)


def _largest(crane: Crane, axis: str, rate: float, omega: float) -> float:
    """Amplitude of the tip that an axis can follow at a frequency, by its limits. [m]"""
    inverse = crane.inverse(axis)
    low, high = inverse.limits
    speed, acceleration = rate * min(high, -low), rate * min(inverse.acceleration)
    return float(half_clip(0.0, speed, acceleration, 1.0, omega))


def demand(crane: Crane, pose: Pose, seaway: Seaway) -> Demand:
    """What a seaway asks of a tip that shall stand still over the sea, linear in the motions."""
    g = crane.geometry
    p: Vector = tip_of(pose.slew, Boom(cos(pose.boom), sin(pose.boom)), g)
    omega = np.linspace(*BAND, 1000)
    surge, sway, heave, roll, pitch, yaw = seaway.ship.response(
        omega, np.full(omega.size, radians(seaway.heading_deg)), seaway.speed
    )
    x, y, z = (
        surge + pitch * p.z - yaw * p.y,
        sway - roll * p.z + yaw * p.x,
        heave + roll * p.y - pitch * p.x,
    )
    c, s = cos(pose.slew), sin(pose.slew)
    density = seaway.spectrum.density(omega)
    across, along = s * x + c * y, c * x - s * y
    zeroth = [
        float(np.trapezoid(density * np.abs(each) ** 2, omega)) for each in (z, across, along)
    ]
    second = float(np.trapezoid(density * np.abs(along) ** 2 * omega**2, omega))
    up, turn, out = (2.0 * sqrt(each) for each in zeroth)
    return Demand(2.0 * pi * sqrt(zeroth[2] / second), (up, turn, out))
