"""Kinematics of a rotary boom crane: from shaft angles to the boom's tip, and back.

Axes are right-handed with z up: x forward, y to port. Joints have the drives' signs: a positive
command hoists, slews to starboard (right), lifts the boom. All in closed form and without angles of
the boom: its cosine and sine follow from the luff rope's length by the law of cosines.
"""

from collections.abc import Iterable
from math import atan2, cos, sin, sqrt
from typing import NamedTuple

from swashplate.machine import equation


class Vector(NamedTuple):
    """A position or velocity, x forward, y to port, z up. [m] or [m/s]"""

    x: float
    y: float
    z: float


def vector_of(numbers: Iterable[float]) -> Vector:
    """Vector of three numbers."""
    x, y, z = map(float, numbers)
    return Vector(x, y, z)


class Geometry(NamedTuple):
    """Lengths of a crane; `Crane` has them with source and status."""

    boom: float
    """B, foot to tip. [m]"""
    foot: float
    """a, slew axis to the boom's foot. [m]"""
    axis: Vector
    """c, slew axis at the height of the foot, in the ship's frame. [m]"""
    sheave: float
    """D, foot to the sheave on the tower's top. [m]"""
    sheave_cos: float
    """Cosine of γ, the elevation of that sheave from the foot. [1]"""
    sheave_sin: float
    """Sine of γ. [1]"""
    hoist: float
    """r_h/n_h, hoisted height for each radian of the hoist's shaft. [m]"""
    luff: float
    """r_l/n_l, luff rope taken in for each radian of the luff's shaft. [m]"""
    coupling: float
    """κ, hook's descent for each metre that the luff rope shortens."""


class Home(NamedTuple):
    """Pose of the crane while all shafts are at zero."""

    slew: float
    """ψ₀, 0 forward, positive to starboard. [rad]"""
    luff_rope: float
    """ℓ(β₀). [m]"""
    rope: float
    """L₀, tip to load. [m]"""


class Shafts(NamedTuple):
    """Angles of the three shafts from home; the slew's is the turret's own. [rad]"""

    hoist: float
    slew: float
    luff: float


class Boom(NamedTuple):
    """Cosine and sine of the boom's elevation β."""

    cos: float
    sin: float


class Rotation(NamedTuple):
    """The ship's axes in the inertial frame, columns of the matrix from one to the other."""

    forward: Vector
    port: Vector
    up: Vector


@equation
def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@equation
def norm(a: Vector) -> float:
    """Length of a vector."""
    return sqrt(dot(a, a))


@equation
def add_scaled(a: Vector, share: float, b: Vector) -> Vector:
    """The vector a + share b."""
    return Vector(a.x + share * b.x, a.y + share * b.y, a.z + share * b.z)


@equation
def rotation(roll: float, pitch: float, yaw: float) -> Rotation:
    """R = Rz(yaw) Ry(pitch) Rx(roll); roll lifts port, pitch lowers the bow, yaw turns to port.

    Parameters
    ----------
    roll, pitch, yaw : float
        Angles of the ship. [rad]

    Returns
    -------
    Rotation
        The ship's axes in the inertial frame.
    """
    return axes_of((cos(roll), sin(roll)), (cos(pitch), sin(pitch)), (cos(yaw), sin(yaw)))


@equation
def axes_of(
    roll: tuple[float, float], pitch: tuple[float, float], yaw: tuple[float, float]
) -> Rotation:
    """R of cosine and sine of each angle of the ship."""
    cf, sf = roll
    ct, st = pitch
    cy, sy = yaw
    return Rotation(
        Vector(cy * ct, sy * ct, -st),
        Vector(cy * st * sf - sy * cf, sy * st * sf + cy * cf, ct * sf),
        Vector(cy * st * cf + sy * sf, sy * st * cf - cy * sf, ct * cf),
    )


@equation
def to_inertial(r: Rotation, p: Vector, shift: Vector) -> Vector:
    """Position in the inertial frame of a point of the ship, R p + s. [m]

    Parameters
    ----------
    r : Rotation
        The ship's axes R.
    p : Vector
        The point p in the ship's frame. [m]
    shift : Vector
        Surge, sway and heave s of the ship. [m]

    Returns
    -------
    Vector
        Position in the inertial frame. [m]
    """
    return add_scaled(add_scaled(add_scaled(shift, p.x, r.forward), p.y, r.port), p.z, r.up)


@equation
def to_ship(r: Rotation, v: Vector) -> Vector:
    """Components along the ship's axes of an inertial vector, Rᵀ v."""
    return Vector(dot(r.forward, v), dot(r.port, v), dot(r.up, v))


@equation
def luff_rope(boom: Boom, g: Geometry) -> float:
    """Luff rope between tower and boom, ℓ = √(B² + D² - 2 B D cos(γ - β)). [m]"""
    cosine = g.sheave_cos * boom.cos + g.sheave_sin * boom.sin
    return sqrt(g.boom * g.boom + g.sheave * g.sheave - 2.0 * g.boom * g.sheave * cosine)


@equation
def boom_of(rope: float, g: Geometry) -> Boom:
    """Boom whose luff rope is that long, β = γ - acos((B² + D² - ℓ²)/(2 B D))."""
    sides = g.boom * g.boom + g.sheave * g.sheave
    c = min(max((sides - rope * rope) / (2.0 * g.boom * g.sheave), -1.0), 1.0)
    s = sqrt(1.0 - c * c)
    return Boom(g.sheave_cos * c + g.sheave_sin * s, g.sheave_sin * c - g.sheave_cos * s)


@equation
def boom_at(shaft: float, g: Geometry, home: Home) -> Boom:
    """Boom at an angle of the luff's shaft [rad], positive lifts."""
    return boom_of(home.luff_rope - g.luff * shaft, g)


@equation
def tip_of(slew: float, boom: Boom, g: Geometry) -> Vector:
    """Tip in the ship's frame, c + (ρ cos ψ, -ρ sin ψ, B sin β) with ρ = a + B cos β. [m]

    Parameters
    ----------
    slew : float
        Slew angle ψ, 0 forward, positive to starboard. [rad]
    boom : Boom
        Elevation β of the boom.
    g : Geometry
        Lengths of the crane, `Crane.geometry`.

    Returns
    -------
    Vector
        Position of the tip. [m]
    """
    reach = g.foot + g.boom * boom.cos
    return Vector(
        g.axis.x + reach * cos(slew), g.axis.y - reach * sin(slew), g.axis.z + g.boom * boom.sin
    )


@equation
def rope_length(shafts: Shafts, g: Geometry, home: Home) -> float:
    """Rope below the tip, L = L₀ - r_h θ_h/n_h - κ (ℓ(β) - ℓ(β₀)). [m]"""
    return home.rope - g.hoist * shafts.hoist + g.coupling * g.luff * shafts.luff


@equation
def shafts_for(x: float, y: float, now: Shafts, g: Geometry, home: Home) -> Shafts:
    """Shaft angles that put the tip over a point of the deck's plane, the slew by the nearer way.

    The point is in the ship's frame [m]; beyond the boom's reach it is the nearest reach. The
    hoist's angle stays as it is.
    """
    e_x = x - g.axis.x
    e_y = y - g.axis.y
    c = min(max((sqrt(e_x * e_x + e_y * e_y) - g.foot) / g.boom, 0.0), 1.0)
    rope = luff_rope(Boom(c, sqrt(1.0 - c * c)), g)
    slew = home.slew + now.slew
    # the turn from the present angle, within ±180 degrees: no jump when it passes the stern
    cross = -e_y * cos(slew) - e_x * sin(slew)
    along = e_x * cos(slew) - e_y * sin(slew)
    return Shafts(now.hoist, now.slew + atan2(cross, along), (home.luff_rope - rope) / g.luff)


@equation
def boom_rate(boom: Boom, g: Geometry) -> float:
    """Rise of the boom for each radian of the luff's shaft, ∂β/∂θ_l, by ∂ℓ/∂β = -B D sin(γ-β)/ℓ."""
    sine = g.sheave_sin * boom.cos - g.sheave_cos * boom.sin
    return g.luff * luff_rope(boom, g) / (g.boom * g.sheave * sine)


@equation
def reach_rate(boom: Boom, g: Geometry) -> float:
    """Loss of reach for each radian of the luff's shaft, -∂ρ/∂θ_l = B sin β ∂β/∂θ_l. [m]

    Parameters
    ----------
    boom : Boom
        Elevation β of the boom.
    g : Geometry
        Lengths of the crane, `Crane.geometry`.

    Returns
    -------
    float
        Loss of reach. [m/rad]
    """
    return g.boom * boom.sin * boom_rate(boom, g)


@equation
def shaft_torques(force: Vector, slew: float, boom: Boom, tension: float, g: Geometry) -> Shafts:
    """Torques of the hoist rope on the three shafts, positive against positive speed. [N m]

    By virtual work C = -T ∂L/∂θ - F·∂p/∂θ for each shaft θ, with the rope's force F on the tip,
    along the ship's axes [N], where the rope L shortens by r_h/n_h with the hoist's and lengthens
    by κ r_l/n_l with the luff's.
    """
    rise = boom_rate(boom, g)
    reach = g.foot + g.boom * boom.cos
    along = -g.boom * boom.sin * rise
    c, s = cos(slew), sin(slew)
    return Shafts(
        tension * g.hoist,
        reach * (force.x * s + force.y * c),
        along * (force.y * s - force.x * c)
        - force.z * g.boom * boom.cos * rise
        - tension * g.coupling * g.luff,
    )
