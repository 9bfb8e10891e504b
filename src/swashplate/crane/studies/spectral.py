"""The crane in waves in the frequency domain: exact for small motion, without a simulation.

The ship's transfer functions move the tip; the tip moves the load, a damped pendulum; a spectrum of
waves gives the variances of all that is linear in them. Control by delayed feedback and ship
compensation is linear as long as the drives follow instantaneously, and so is a crew that answers
the least swing. The result checks every
simulated crane without control, and is the first answer on every sea of a year.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import cos, inf, pi, radians, sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.crane.control import Control, Settings, stages_of
from swashplate.crane.crane import Crane
from swashplate.crane.kinematics import boom_at, reach_rate, tip_of
from swashplate.crane.limits import LIMITED
from swashplate.crane.rope import GRAVITY, Suspension
from swashplate.crane.sea.extremes import THREE_HOURS, largest_of_gaussian
from swashplate.crane.sea.seaway import BAND, Seaway
from swashplate.crane.stages.crew import HumanOperator
from swashplate.crane.stages.steering import largest_sine
from swashplate.errors import InputError
from swashplate.results import Result
from swashplate.tables import Column, Table

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

FINEST = 1e-4
"""Least distance of frequencies. [rad/s]"""
WIDEST = 2e-3
"""Largest distance of frequencies: a hundredth of the lowest one's. [rad/s]"""
PER_RESONANCE = 4.0
"""Frequencies within the half-power width of the load's resonance."""
SPREAD_HEADINGS = 19
"""Headings of a sea whose directions spread."""
DEMANDS = ("slew_speed", "slew_acceleration", "luff_speed", "luff_acceleration", "clip")
"""Demands of control on slew and luff, as shares of what their drives can do, and on its clip, if
it has one, as a share of the clip's size."""


class LinearValue(NamedTuple):
    """A quantity in a sea, in SI."""

    mean: float
    """Without waves: of a list, a trim."""
    rms: float
    """Of what waves add; of a vector the root mean square of its magnitude."""
    period: float
    """Mean time between crossings upwards. [s]"""
    largest: float
    """Most probable largest magnitude in the duration, with the mean."""


@dataclass(frozen=True, eq=False)
class LinearResponse(Result):
    """Response to a sea of a crane whose drives follow instantaneously, and the demand on them."""

    values: Mapping[str, LinearValue]
    """By names of `limits.LIMITED`, saturation apart, and of `DEMANDS`."""
    seaway: Seaway
    duration: float
    """Of the largest values. [s]"""
    crane: Crane = field(repr=False)

    def tables(self) -> list[Table]:
        """Root mean square, period and largest value of each quantity."""
        tables = []
        for unit in ("rad", "m", "m/s", "1"):
            names = [name for name in self.values if _unit(name) == unit]
            spec = ".2f" if unit == "rad" else ".3f"
            title = f"In the frequency domain, largest in {self.duration / 3600.0:g} h"
            shown_unit = "" if unit == "1" else unit
            columns = [Column("quantity", wrap=True), Column("rms", spec, shown_unit)]
            columns += [Column("period", ".1f", "s"), Column("largest", spec, shown_unit)]
            table = Table(title, columns)
            for name in names:
                value = self.values[name]
                table.add(name.replace("_", " "), value.rms, value.period, value.largest)
            tables.append(table)
        return tables


def _unit(name: str) -> str:
    return LIMITED[name].unit if name in LIMITED else "1"


class Waves(NamedTuple):
    """Regular waves whose variances add up to a sea's, on a fine grid of frequencies."""

    frequency: Array
    heading: Array
    encounter: Array
    """Frequency at which the ship meets them. [rad/s]"""
    variance: Array
    """Of the surface. [m²]"""


def linear_response(
    crane: Crane,
    sea: Seaway | None = None,
    control: Control | None = None,
    *,
    slew_deg: float = 90.0,
    boom_deg: float = 45.0,
    rope_m: float = 27.0,
    swing_damping: float | None = None,
    load: float | None = None,
    suspension: Suspension | None = None,
    duration: float = THREE_HOURS,
) -> LinearResponse:
    """Compute the response of a crane at rest to a sea, by transfer functions and spectrum.

    Parameters
    ----------
    crane : Crane
    sea : Seaway
        By default sea state 3 abeam on the packaged hull.
    control : Control, optional
        Delayed feedback, ship compensation and a crew, on drives that follow instantaneously; a
        shaper, a position loop and a clip change nothing as long as the operator's stick rests and
        the clip does not act. The crew is one without threshold and share.
    slew_deg, boom_deg, rope_m, swing_damping, load, suspension
        As of `simulate`.
    duration : float
        For which the largest values are stated. [s]

    Raises
    ------
    InputError
        For a user-defined controller, whose transfer function is not known, for a crew together
        with control of the tip, which its hand then works through, for a damping of 0
        without control, with which the swing has no stationary state, and as of `Crane.home`.

    Notes
    -----
    With the tip's horizontal motion T due only to the ship, the load's position d from the tip
    obeys d (ω₀² - ω² + 2 i ζ ω₀ ω - ω² k e^{-iωτ}) = ω² (1 - c) T, with gain k and delay τ of the
    feedback, and c = 1 if the ship's motion is compensated. ω is the frequency as the ship meets
    the waves. A crew with gain K, return time T_r and D = e^{-iωτ}/(1 + iωT_n) moves the tip by
    F = K D iωT_r/(1 + iωT_r)/(iω + D/T_r) times the swing that it sees, which has the ship's roll
    and pitch in it.
    """
    seaway = Seaway() if sea is None else sea
    settings, controller, _ = stages_of(control)
    if controller is not None:
        raise InputError(
            "The frequency domain supports delayed feedback and ship compensation, not the "
            f"user-defined controller {controller.model.name}: simulate it."
        )
    crewed = settings.crew is not None
    if crewed and settings.path:
        raise InputError(
            "The frequency domain supports a crew or control of the tip, not the crew's hand "
            "through control of the tip: simulate it."
        )
    damping = crane.swing_damping if swing_damping is None else swing_damping
    if damping <= 0.0 and settings.feedback <= 0.0 and not (settings.ship or crewed):
        raise InputError(
            "Without damping the swing in waves grows without bound: swing_damping must be above "
            "0, as 0.005."
        )
    home = crane.home(slew_deg, boom_deg, rope_m)
    g = crane.geometry
    boom = boom_at(0.0, g, home)
    waves = waves_of(seaway, sqrt(GRAVITY / rope_m) * damping)
    arm = np.array(tip_of(home.slew, boom, g))
    motion = seaway.response(waves.frequency, waves.heading)
    tip = tip_motion(motion, arm)
    # a plumb line in the ship's axes, which turn by roll and pitch
    plumb = np.array([motion[4], -motion[3]])
    tip_under_control, load_from_tip = _controlled(
        tip, plumb, waves.encounter, rope_m, damping, settings
    )
    c, s = cos(home.slew), sin(home.slew)
    along = np.array([c, -s])
    across = np.array([-s, -c])
    direction = load_from_tip / rope_m + plumb
    inclined = np.array([radians(seaway.trim_deg), -radians(seaway.list_deg)])
    vertical = 1j * waves.encounter * tip[2]
    mass = crane.safe_load if load is None else load
    lifted = -(waves.encounter**2) * tip[2] / GRAVITY
    lifted = lifted * _bounce(waves.encounter, rope_m, mass, suspension or Suspension())
    hoist = crane.geometry.hoist * min(np.abs(crane.inverse("hoist").limits))
    responses: dict[str, tuple[Complex, float]] = {
        "swing": (load_from_tip / rope_m, 0.0),
        "off_lead": ((along @ direction)[None], float(along @ inclined)),
        "side_lead": ((across @ direction)[None], float(across @ inclined)),
        "dynamic_factor": (lifted[None], 1.0),
        "hook_speed": (vertical[None], 0.0),
        "hoist_demand": (vertical[None] / hoist, 0.0),
        "placement": (tip_under_control + load_from_tip, 0.0),
    }
    demanded = tip_under_control - tip[:2]  # of the drives, in the ship's axes
    reach = g.foot + g.boom * boom.cos
    for axis, rate, part in (
        ("slew", reach, across @ demanded),
        ("luff", float(reach_rate(boom, g)), along @ demanded),
    ):
        inverse = crane.inverse(axis)
        speed = 1j * waves.encounter * part / (rate * min(np.abs(inverse.limits)))
        rise = -(waves.encounter**2) * part / (rate * min(inverse.acceleration))
        responses[f"{axis}_speed"] = (speed[None], 0.0)
        responses[f"{axis}_acceleration"] = (rise[None], 0.0)
    if settings.clip > 0.0 or settings.share > 0.0:
        omega = sqrt(GRAVITY / rope_m)
        inverses = crane.inverse("slew"), crane.inverse("luff")
        rates = reach, float(reach_rate(boom, g))
        sizes = np.array(
            [
                settings.share
                * largest_sine(
                    rate * min(np.abs(drive.limits)), rate * min(drive.acceleration), omega
                )
                for drive, rate in zip(inverses, rates, strict=True)
            ]
        )
        if settings.clip > 0.0:
            sizes[1] = settings.clip
        responses["clip"] = (np.array([across @ demanded, along @ demanded]) / sizes[:, None], 0.0)
    values = {
        name: _value(response, mean, waves, duration / (2.0 if name == "dynamic_factor" else 1.0))
        for name, (response, mean) in responses.items()
    }
    return LinearResponse(values, seaway, duration, crane)


def waves_of(seaway: Seaway, width: float) -> Waves:
    """Waves of a seaway, fine enough for a resonance.

    `width` is the half-width ζω₀ of the resonance that they must resolve. [rad/s]
    """
    step = min(max(2.0 * width / PER_RESONANCE, FINEST), WIDEST)
    omega = np.arange(BAND[0], BAND[1], step) + 0.5 * step
    density = seaway.spectrum.density(omega)
    # the band holds all of the sea's energy, as in a simulated seaway
    variance = density * seaway.spectrum.height**2 / 16.0 / density.sum()
    heading = np.full(omega.size, radians(seaway.heading_deg))
    if seaway.spread:
        angles = (np.arange(SPREAD_HEADINGS) + 0.5) * pi / SPREAD_HEADINGS - 0.5 * pi
        shares = np.cos(angles) ** 2 / np.sum(np.cos(angles) ** 2)
        variance = np.outer(shares, variance).ravel()
        heading = np.add.outer(angles, heading).ravel()
        omega = np.tile(omega, SPREAD_HEADINGS)
    return Waves(omega, heading, seaway.encounter(omega, heading), variance)


def tip_motion(motion: Complex, arm: Array) -> Complex:
    """Motion of a point of the ship, (3, n), by its six motions, (6, n): s + θ × arm."""
    return np.asarray(motion[:3] + np.cross(motion[3:], arm[:, None], axis=0))


def swing_response(omega: Array, rope: float, damping: float) -> Complex:
    """Load less tip over the tip's horizontal motion, ω²/(ω₀² - ω² + 2 i ζ ω₀ ω)."""
    natural = sqrt(GRAVITY / rope)
    return np.asarray(omega**2 / (natural**2 - omega**2 + 2j * damping * natural * omega))


def _controlled(
    tip: Complex, plumb: Complex, omega: Array, rope: float, damping: float, settings: Settings
) -> tuple[Complex, Complex]:
    """The tip's horizontal motion under control, and load less tip, (2, n) each.

    `plumb` is the direction of a plumb line in the ship's axes, which a crew sees as swing. [rad]
    """
    moved = (0.0 if settings.ship else 1.0) * tip[:2]
    natural = sqrt(GRAVITY / rope)
    feedback = settings.feedback * np.exp(-2j * pi * settings.delay * omega / natural)
    if settings.crew is not None:
        feedback = crew_response(omega, settings.crew)
        moved = moved + feedback * rope * plumb
    stiffness = natural**2 - omega**2 * (1.0 + feedback) + 2j * damping * natural * omega
    load = omega**2 * moved / stiffness
    return moved + feedback * load, load


def crew_response(omega: Array, operator: HumanOperator) -> Complex:
    """Offset of the tip over the swing that a crew without threshold sees, on ideal drives."""
    s = 1j * omega
    hand = np.exp(-s * operator.delay) / (1.0 + operator.lag * s)
    beyond_rest = operator.return_time * s / (1.0 + operator.return_time * s)
    return np.asarray(operator.gain * beyond_rest * hand / (s + hand / operator.return_time))


def _bounce(omega: Array, rope: float, mass: float, suspension: Suspension) -> Complex:
    """Transmissibility of an elastic rope; 1 for a rigid one."""
    if suspension.stiffness == inf:
        return np.ones(omega.size, dtype=np.complex128)
    natural = sqrt(suspension.stiffness / (rope * (mass + suspension.hook)))
    damped = 2j * suspension.bounce_damping * natural * omega
    return np.asarray((natural**2 + damped) / (natural**2 - omega**2 + damped))


def _value(response: Complex, mean: float, waves: Waves, duration: float) -> LinearValue:
    """Moments of a quantity whose components have those amplitudes for each metre of wave."""
    covariance = np.real((response * waves.variance) @ response.conj().T)
    squared_rates = waves.variance * waves.encounter**2
    rate_covariance = np.real((response * squared_rates) @ response.conj().T)
    # along the principal axes
    variances, axes = np.linalg.eigh(covariance)
    variances = np.maximum(variances, 0.0)
    rate_variances = np.maximum(np.diagonal(axes.T @ rate_covariance @ axes), 0.0)
    variance = float(variances.sum())
    rate_variance = float(rate_variances.sum())
    largest = float(largest_of_gaussian(variances[None], rate_variances[None], duration)[0])
    return LinearValue(
        mean=mean,
        rms=sqrt(variance),
        period=2.0 * pi * sqrt(variance / rate_variance) if rate_variance > 0.0 else inf,
        largest=abs(mean) + largest,
    )


def stationary_start(
    crane: Crane, seaway: Seaway, *, slew_deg: float, boom_deg: float, rope_m: float, damping: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Load less tip and its rate at time 0 of the stationary swing without control. [m], [m/s]"""
    home = crane.home(slew_deg, boom_deg, rope_m)
    arm = np.array(tip_of(home.slew, boom_at(0.0, crane.geometry, home), crane.geometry))
    waves = seaway.waves
    tip = tip_motion(seaway.response(waves.frequency, waves.heading), arm)[:2] * waves.amplitude
    load = swing_response(waves.encounter, rope_m, damping) * tip
    x, y = load.sum(axis=1).real
    u, v = (1j * waves.encounter * load).sum(axis=1).real
    return (float(x), float(y)), (float(u), float(v))
