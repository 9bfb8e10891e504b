"""What the axes of a crane can follow: the largest sines of its tip, and what seas ask for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import cos, pi, radians, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.crane.crane import Crane
from swashplate.crane.kinematics import boom_at, reach_rate, tip_of
from swashplate.crane.loop import largest_sine
from swashplate.crane.sea import BAND, SEA_STATES, Seaway
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
    boom_deg: float

    figure = "plot_follow"

    def tables(self) -> list[Table]:
        """Amplitudes over the period, and what seas ask for."""
        heads = [Column("period", ".1f", "s"), *(Column(each, ".3f", "m") for each in AXES)]
        made = Table("Largest sine an axis can follow", heads)
        for period, amplitudes in zip(self.periods.tolist(), self.amplitude.tolist(), strict=True):
            made.add(period, *amplitudes)
        asked = Table("What seas ask, significant amplitudes", [Column("sea"), *heads])
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
    g, home = crane.geometry, crane.home(slew_deg, boom_deg, rope_m)
    boom = boom_at(0.0, g, home)
    rates = (g.hoist, g.foot + g.boom * boom.cos, float(reach_rate(boom, g)))
    amplitude = np.zeros((times.size, 3))
    for i, (axis, rate) in enumerate(zip(AXES, rates, strict=True)):
        (low, high), inverse = crane.inverse(axis).limits, crane.inverse(axis)
        speed, acceleration = rate * min(high, -low), rate * min(inverse.acceleration)
        amplitude[:, i] = [largest_sine(speed, acceleration, w) for w in 2.0 * pi / times]
    # motion of the tip, linear in the ship's: up, across the boom, along it
    base, omega = seaway or Seaway(), np.linspace(*BAND, 1000)
    heading = np.full(omega.size, radians(base.heading_deg))
    motion = base.ship.response(omega, heading, base.speed)
    arm = np.array(tip_of(home.slew, boom, g))[:, None]
    forward, port, up = motion[:3] + np.cross(motion[3:], arm, axis=0)
    c, s = cos(home.slew), sin(home.slew)
    powers = np.abs([up, s * forward + c * port, c * forward - s * port]) ** 2
    asked = {}
    for name in seas:
        spectra = replace(base, sea=name).spectrum.density(omega) * powers
        zeroth = np.trapezoid(spectra, omega, axis=1)
        second = np.trapezoid(spectra[2] * omega**2, omega)
        height, across, along = (2.0 * np.sqrt(zeroth)).tolist()
        period = 2.0 * pi * float(np.sqrt(zeroth[2] / second))
        asked[name] = Demand(period, (height, across, along))
    return Followable(times, amplitude, asked, crane, boom_deg)
