"""The largest sine of the tip that an axis can follow, computed from its drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import cos, pi, radians, sin
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.crane.axes import AXES
from swashplate.crane.crane import Crane
from swashplate.crane.kinematics import boom_at, reach_rate, tip_of
from swashplate.crane.sea.seaway import SEA_STATES, Seaway, Spectrum
from swashplate.crane.stages.steering import largest_sine
from swashplate.crane.studies.spectral import tip_motion
from swashplate.errors import InputError
from swashplate.results import Drawn
from swashplate.tables import Column, Table

Array = NDArray[np.float64]

SLOWEST = 3600.0
"""Longest period that an axis is asked to follow; a tide has more, a swell 25 s. [s]"""


class Demand(NamedTuple):
    """Demand of a sea on the tip of a boom that shall stand still over the sea."""

    period: float
    """Mean time between crossings of zero of the motion along the boom. [s]"""
    amplitude: tuple[float, float, float]
    """Significant single amplitude: up, across the boom, along it. [m]"""


@dataclass(frozen=True, eq=False)
class Followable(Drawn):
    """Largest sines that the axes of a crane can follow."""

    drawn_by: ClassVar[str] = "plot_follow"

    periods: Array
    """(n,) [s]"""
    amplitude: Array
    """(n, 3) min(v/ω, a/ω²) of the hook's height by the hoist, of the tip across the boom by the
    slew, and along it by the luff. [m]"""
    seas: Mapping[str, Demand]
    crane: Crane = field(repr=False)
    boom_deg: float

    def tables(self) -> list[Table]:
        """Amplitudes over the period, and what seas ask for."""
        columns = [Column("period", ".1f", "s"), *(Column(axis, ".3f", "m") for axis in AXES)]
        largest = Table("Largest sine an axis can follow", columns)
        for period, amplitudes in zip(self.periods.tolist(), self.amplitude.tolist(), strict=True):
            largest.add(period, *amplitudes)
        demands = Table("Demand of the seas, significant amplitudes", [Column("sea"), *columns])
        for name, demand in self.seas.items():
            demands.add(name, demand.period, *demand.amplitude)
        return [largest, demands]


def follow(
    crane: Crane,
    periods: ArrayLike = tuple(range(4, 17)),
    *,
    seas: Sequence[str | Spectrum] = tuple(SEA_STATES),
    seaway: Seaway | None = None,
    slew_deg: float = 90.0,
    boom_deg: float = 45.0,
    rope_m: float = 27.0,
) -> Followable:
    """Largest amplitudes of the tip that each axis can follow over periods [s]; what seas ask for.

    They are of the drives that the controller knows, see `Crane.with_drive`.

    Seas are names of `SEA_STATES` or spectra; ship and heading are those of the seaway, by default
    the crane ship's hull in beam waves.

    Examples
    --------
    >>> from swashplate.crane import Crane, follow
    >>> followable = follow(Crane.preset("tg3637"), [6.0, 9.0], seas=("ss3",))
    >>> followable.periods  # s
    array([6., 9.])
    """
    times = np.atleast_1d(np.asarray(periods, dtype=np.float64))
    if not (((times > 0.0) & (times <= SLOWEST)).all() and times.size):
        raise InputError(f"Periods to follow must be above 0 s and at most {SLOWEST:g} s.")
    g = crane.geometry
    home = crane.home(slew_deg, boom_deg, rope_m)
    boom = boom_at(0.0, g, home)
    rates = (g.hoist, g.foot + g.boom * boom.cos, float(reach_rate(boom, g)))
    amplitude = np.zeros((times.size, 3))
    for i, (inverse, rate) in enumerate(zip(map(crane.inverse, AXES), rates, strict=True)):
        speed = rate * min(np.abs(inverse.limits))
        acceleration = rate * min(inverse.acceleration)
        amplitude[:, i] = [largest_sine(speed, acceleration, w) for w in 2.0 * pi / times]
    # motion of the tip, linear in the ship's: up, across the boom, along it
    base = seaway or Seaway()
    omega = base.bins.frequency
    heading = np.full(omega.size, radians(base.heading_deg))
    arm = np.array(tip_of(home.slew, boom, g))
    forward, port, up = tip_motion(base.response(omega, heading), arm)
    c, s = cos(home.slew), sin(home.slew)
    powers = np.abs([up, s * forward + c * port, c * forward - s * port]) ** 2
    demands = {}
    for sea in seas:
        of_sea = replace(base, sea=sea)
        variances = powers * of_sea.bins.variance
        zeroth = variances.sum(axis=1)
        second = float((variances[2] * base.encounter(omega, heading) ** 2).sum())
        height, across, along = (2.0 * np.sqrt(zeroth)).tolist()
        period = 2.0 * pi * float(np.sqrt(zeroth[2] / second))
        demands[of_sea.title] = Demand(period, (height, across, along))
    return Followable(times, amplitude, demands, crane, boom_deg)
