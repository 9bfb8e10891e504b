"""What an axis can follow: the largest sine of the tip, known beforehand from its drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import cos, pi, radians, sin
from typing import TYPE_CHECKING, NamedTuple, cast, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.crane.axes import AXES
from swashplate.crane.crane import Crane
from swashplate.crane.kinematics import boom_at, reach_rate, tip_of
from swashplate.crane.loop import largest_sine
from swashplate.crane.sea import SEA_STATES, Seaway, Spectrum
from swashplate.crane.spectral import tip_motion
from swashplate.errors import InputError
from swashplate.results import GivenAxes, Result, figures
from swashplate.tables import Column, Table

if TYPE_CHECKING:
    from swashplate.results import Axes, Figure
Array = NDArray[np.float64]

SLOWEST = 3600.0
"""Longest period that an axis is asked to follow; a tide has more, a swell 25 s. [s]"""


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

    @overload
    def plot(self, *, ax: None = None, title: str = "") -> Figure: ...

    @overload
    def plot(self, *, ax: GivenAxes, title: str = "") -> GivenAxes: ...

    def plot(
        self, *, ax: Axes | Sequence[Axes] | None = None, title: str = ""
    ) -> Figure | Axes | Sequence[Axes]:
        """Figure of the amplitudes over the period, with what seas ask for as points.

        By default a new figure; with `ax` it is drawn there, and `ax` returned.
        """
        return cast("Figure", figures().plot_follow(self, ax=ax, title=title))

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
    """
    times = np.atleast_1d(np.asarray(periods, dtype=np.float64))
    if not (((times > 0.0) & (times <= SLOWEST)).all() and times.size):
        raise InputError(f"Periods to follow must be above 0 s and at most {SLOWEST:g} s.")
    g, home = crane.geometry, crane.home(slew_deg, boom_deg, rope_m)
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
    asked = {}
    for sea in seas:
        of_sea = replace(base, sea=sea)
        variances = powers * of_sea.bins.variance
        zeroth = variances.sum(axis=1)
        second = float((variances[2] * base.encounter(omega, heading) ** 2).sum())
        height, across, along = (2.0 * np.sqrt(zeroth)).tolist()
        period = 2.0 * pi * float(np.sqrt(zeroth[2] / second))
        asked[of_sea.title] = Demand(period, (height, across, along))
    return Followable(times, amplitude, asked, crane, boom_deg)
