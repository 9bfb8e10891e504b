"""The load: a point mass on a rope that can only pull, by Störmer and Verlet's step.

The step needs nothing but positions of the boom's tip: no angles, which are singular if the rope
lies level, and no accelerations of the tip, which drives with jumps do not have. The rope's pull is
the multiplier that puts the load back on the sphere around the new tip; it follows from a quadratic
in closed form, is zero if the rope is slack, and there is no drift.

Two options (`Suspension`) leave the single multiplier: an elastic rope, whose pull follows from its
stretch, and a hook with the load on slings below it, a double pendulum with a multiplier for each
of its two quadratics.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite, pi, sqrt
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.crane.kinematics import Vector, add_scaled, axes_of, dot, norm, vector_of
from swashplate.errors import InputError
from swashplate.machine import Definition, Machine, Model, equation, simulate
from swashplate.results import Result

Array = NDArray[np.float64]

GRAVITY = 9.80665
"""Standard acceleration of free fall. [m/s²]"""
AIR = 1.225
"""Density of air at 15 °C and sea level. [kg/m³]"""
FASTEST = 0.3
"""Angle of an elastic bounce over one sample beyond which it is not computed. [rad]"""
SOFTEST, STIFFEST = 1e3, 1e12
"""Stiffness EA of ropes: of a thin cord, and beyond that of a hundred thick ropes together. [N]"""
LIGHTEST = 0.1
"""Least load: a lighter one does not pull a rope taut. [kg]"""
MOST_DAMPED = 0.2
"""Largest damping ratio of the swing: forty times that of loads on ropes."""
TOO_FAST = -1.0
"""Pull that says that the tip moves through the rope's length within a step."""


@equation
def multiplier_of(free: Vector, along: Vector, length: float) -> float:
    """Multiplier μ ≥ 0 that leaves |e - μ d| at most L; below 0 if none does.

    |e - μ d| = L is a quadratic in μ; its small root, written so that nothing cancels, is
    μ = o/(e·d + √((e·d)² - d·d o)) with o = e·e - L².
    """
    o = dot(free, free) - length * length
    if not o > 0.0:
        return 0.0
    ed = dot(free, along)
    root = ed * ed - dot(along, along) * o
    if root < 0.0 or ed <= 0.0:
        return TOO_FAST
    return o / (ed + sqrt(root))


# --- elastic rope, hook and slings ----------------------------------------------------------------


@dataclass(frozen=True)
class Suspension(Result):
    """Suspension of the load: elastic rope, hook with slings; by default neither."""

    stiffness: float = inf
    """EA, force for a strain of one of the rope's parts together, 1 kN to 1 TN; infinite for a
    rigid rope. What lies between the tip and the drum does not stretch. [N]"""
    bounce_damping: float = 0.02
    """Damping ratio of the load's bounce on the elastic rope, at most 1."""
    hook: float = 0.0
    """Mass of the hook block, at most 1000 t; 0 for a load that hangs on the rope itself. [kg]"""
    sling: float = 0.0
    """From the hook to the load, at most 200 m. [m]"""

    def __post_init__(self) -> None:
        if not (self.stiffness == inf or SOFTEST <= self.stiffness <= STIFFEST):
            raise InputError(
                f"The rope's stiffness is {self.stiffness:g} N, but must be {SOFTEST:g} to "
                f"{STIFFEST:g} N, or inf for a rigid rope."
            )
        for name, most in (("bounce_damping", 1.0), ("hook", 1e6), ("sling", 200.0)):
            value = getattr(self, name)
            if not 0.0 <= value <= most:
                raise InputError(
                    f"The suspension's {name} is {value:g}, but must be at least 0 and at most "
                    f"{most:g}."
                )
        if (self.hook > 0.0) != (self.sling > 0.0):
            raise InputError(
                f"A hook of {self.hook:g} kg with slings of {self.sling:g} m: both are above 0, or "
                "both 0 for a load on the rope itself."
            )

    def hanging(
        self,
        load: float,
        *,
        shortest: float,
        rate: float,
        drag: float,
        wind: ArrayLike,
        swing_damping: float,
    ) -> Hanging:
        """Numbers with a load [kg], on a rope of at least a length [m], at a rate [Hz].

        An `InputError` if the load bounces too fast for the rate, and for a damping ratio of the
        swing beyond its range.
        """
        if not 0.0 <= swing_damping <= MOST_DAMPED:
            raise InputError(
                f"swing_damping is {swing_damping:g}, but must be at least 0 and at most "
                f"{MOST_DAMPED:g}; loads on ropes have 0.002 to 0.01."
            )
        if not (isfinite(load) and load >= LIGHTEST):
            raise InputError(f"The load is {load:g} kg, but must be at least {LIGHTEST:g} kg.")
        mass = load + self.hook
        pulls = 0.0 if self.stiffness == inf else self.stiffness / mass
        ratio = load / self.hook if self.hook > 0.0 else 0.0
        fastest = sqrt(pulls * (1.0 + ratio) / shortest)
        if fastest > FASTEST * rate:
            raise InputError(
                f"{self.hook or load:g} kg on {shortest:g} m of rope with {self.stiffness:g} N "
                f"bounce at {fastest / (2.0 * pi):.3g} Hz, too fast for {rate:g} samples a second: "
                "use a rigid rope."
            )
        along, across, up = map(float, np.asarray(wind))
        return Hanging(
            stiffness=pulls,
            bounce_damping=self.bounce_damping,
            swing_damping=float(swing_damping),
            sling=self.sling,
            ratio=ratio,
            drag=drag,
            wind=Vector(along, across, up),
        )


class Hanging(NamedTuple):
    """Numbers of a `Suspension` with its load."""

    stiffness: float
    """EA for each kilogram of load and hook; 0 for a rigid rope. [N/kg]"""
    bounce_damping: float
    """Damping ratio of the bounce on an elastic rope."""
    swing_damping: float
    """ζ, damping ratio of the swing."""
    sling: float
    """[m]; 0 for a load on the rope itself."""
    ratio: float
    """q, mass of the load over that of the hook."""
    drag: float
    """k = ρ C_d A/(2 m): deceleration k |v - w| (v - w) by the air. [1/m]"""
    wind: Vector
    """w, velocity of the air. [m/s]"""


class Hung(NamedTuple):
    """Load and hook after a step."""

    load: Vector
    previous_load: Vector
    """The load one step earlier. [m]"""
    hook: Vector
    """End of the rope: the hook, or the load if there is no hook. [m]"""
    previous_hook: Vector
    """The same one step earlier. [m]"""
    pull: float
    """Tension of the rope for each kilogram of load and hook. [N/kg]"""
    stretch: float
    """[m]"""


@equation
def coasting(now: Vector, previous: Vector, square: float, a: Vector) -> Vector:
    """Position of a body one step later under an acceleration, 2 x - x' + h² a. [m]"""
    return add_scaled(add_scaled(now, 1.0, add_scaled(now, -1.0, previous)), square, a)


@equation
def damped_position(
    undamped: Vector, body_step: Vector, tip_step: Vector, rope: Vector, share: float
) -> Vector:
    """A body's next position less a share of its motion across the rope, relative to the tip. [m]

    The steps are the motions of body and tip within a time step. Motion along the rope, such as
    that of a hoist, is not damped.
    """
    relative = add_scaled(body_step, -1.0, tip_step)
    across = add_scaled(relative, -dot(relative, rope) / dot(rope, rope), rope)
    return add_scaled(undamped, -share, across)


@equation
def elastic_pull(stretch: float, previous: float, length: float, s: Hanging, h: float) -> float:
    """Pull of a stretched rope, EA ε + 2 ζ √(EA m/L) ε̇ L, never below 0. [N/kg]

    `previous` is the stretch one step earlier. [m]
    """
    damping = 2.0 * s.bounce_damping * sqrt(s.stiffness / length) * (stretch - previous) / h
    return max(s.stiffness * stretch / length + damping, 0.0) if stretch > 0.0 else 0.0


class Multipliers(NamedTuple):
    """Lagrange multipliers of rope and slings over a step; 0 if slack. [1]"""

    rope: float
    """u: the rope's pull moves the hook by -u d, with d from the tip to the hook."""
    sling: float
    """w: the slings' pull moves the load by -w b, with b from the hook to the load."""


@equation
def both_taut(
    rope: Vector, sling: Vector, d: Vector, b: Vector, length: float, s: Hanging
) -> Multipliers:
    """Multipliers u of the rope and w of the slings if both are taut, by Newton's method.

    The unknowns satisfy |rope - u d + q w b| = L and |sling + u d - (1 + q) w b| = l, with the
    ratio of masses q. `rope` is the vector from the tip to the hook at the end of the step if
    nothing pulled, `sling` that from the hook to the load; d and b are the same vectors at the
    beginning of the step, along which rope and slings pull. [m]
    """
    u = 0.0
    w = 0.0
    for _ in range(4):
        rope_line = add_scaled(add_scaled(rope, -u, d), s.ratio * w, b)
        sling_line = add_scaled(add_scaled(sling, u, d), -(1.0 + s.ratio) * w, b)
        f = dot(rope_line, rope_line) - length * length
        g = dot(sling_line, sling_line) - s.sling * s.sling
        f_u = -2.0 * dot(rope_line, d)
        f_w = 2.0 * s.ratio * dot(rope_line, b)
        g_u = 2.0 * dot(sling_line, d)
        g_w = -2.0 * (1.0 + s.ratio) * dot(sling_line, b)
        determinant = f_u * g_w - f_w * g_u
        u = u - (f * g_w - f_w * g) / determinant
        w = w - (f_u * g - f * g_u) / determinant
    return Multipliers(u, w)


@equation
def hook_pulls(
    rope: Vector, sling: Vector, d: Vector, b: Vector, length: float, s: Hanging
) -> Multipliers:
    """Multipliers of a rope and slings that may be slack; arguments as of `both_taut`.

    Tried in turn: both taut; only the rope taut, if the slings are not longer than they can be
    then; only the slings taut. A multiplier below 0 means that none of these is possible.
    """
    taut = both_taut(rope, sling, d, b, length, s)
    if taut.rope >= 0.0 and taut.sling >= 0.0:
        return taut
    rope_only = multiplier_of(rope, d, length)
    overshoot = norm(add_scaled(sling, rope_only, d)) - s.sling
    if rope_only < 0.0 or overshoot <= 0.0:
        return Multipliers(rope_only, 0.0)
    sling_only = multiplier_of(sling, b, s.sling) / (1.0 + s.ratio)
    return Multipliers(0.0, sling_only)


@equation
def rope_step(
    now: Hung, tip: Vector, next_tip: Vector, length: float, s: Hanging, h: float, square: float
) -> Hung:
    """Load and hook one step later, with the tip at n and n + 1 and the rope at n + 1. [m]

    x = 2 x_n - x_(n-1) + h² a - μ d, with the rope's multiplier μ. An elastic rope pulls by its
    stretch at n, so that the step stays explicit and, undamped, symplectic. The swing is damped by
    the acceleration -2 ζ √(g/(L + l)) v of load and hook, v their velocity relative to the tip and
    across the rope. `square` is h², half of it in the first step. [s²]
    """
    weight = Vector(0.0, 0.0, -GRAVITY)
    load_step = add_scaled(now.load, -1.0, now.previous_load)
    hook_step = add_scaled(now.hook, -1.0, now.previous_hook)
    load = coasting(now.load, now.previous_load, square, weight)
    if s.drag > 0.0:
        step_in_air = add_scaled(load_step, -h, s.wind)
        load = add_scaled(load, -square * s.drag * norm(step_in_air) / (h * h), step_in_air)
    hooked = s.sling > 0.0
    elastic = s.stiffness > 0.0
    hook = coasting(now.hook, now.previous_hook, square, weight) if hooked else load
    d = add_scaled(now.hook, -1.0, tip)
    b = add_scaled(now.load, -1.0, now.hook)
    if s.swing_damping > 0.0:
        rate = 1.0 / h
        share = 2.0 * s.swing_damping * sqrt(GRAVITY / (length + s.sling)) * (square * rate)
        tip_step = add_scaled(next_tip, -1.0, tip)
        load = damped_position(load, load_step, tip_step, d, share)
        hook = damped_position(hook, hook_step, tip_step, d, share) if hooked else load
    if elastic:
        hook = add_scaled(hook, -square * now.pull * (1.0 + s.ratio) / norm(d), d)
    rope = add_scaled(hook, -1.0, next_tip)
    sling = add_scaled(load, -1.0, hook)
    u = 0.0
    w = 0.0
    if hooked and elastic:
        w = multiplier_of(sling, b, s.sling) / (1.0 + s.ratio)
    elif hooked:
        multipliers = hook_pulls(rope, sling, d, b, length, s)
        u = multipliers.rope
        w = multipliers.sling
    elif not elastic:
        u = multiplier_of(rope, d, length)
    hook = add_scaled(add_scaled(hook, -u, d), s.ratio * w, b)
    load = add_scaled(load, -w, b) if hooked else hook
    stretch = 0.0
    pull = u * norm(d) / (square * (1.0 + s.ratio))
    if elastic:
        stretch = norm(add_scaled(hook, -1.0, next_tip)) - length
        pull = elastic_pull(stretch, now.stretch, length, s, h)
    if u < 0.0 or w < 0.0:
        pull = TOO_FAST
    return Hung(load, now.load, hook, now.hook, pull, stretch)


class Start(NamedTuple):
    """Initial offset and velocity of the load relative to the tip, horizontal and inertial."""

    offset_x: Annotated[float, Definition("load ahead of the tip at the start", "m")] = 0.0
    offset_y: Annotated[float, Definition("load to port of the tip at the start", "m")] = 0.0
    velocity_x: Annotated[float, Definition("velocity of the load forward at the start", "m/s")] = (
        0.0
    )
    velocity_y: Annotated[float, Definition("velocity of the load to port at the start", "m/s")] = (
        0.0
    )


@equation
def hanging_load(tip: Vector, offset_x: float, offset_y: float, length: float, s: Hanging) -> Hung:
    """Load and hook at rest at an offset of the load from the tip, straight on a taut rope. [m]"""
    horizontal = offset_x * offset_x + offset_y * offset_y
    straight = length + s.sling
    pull = GRAVITY * sqrt(1.0 - horizontal / (straight * straight))
    stretch = pull * length / s.stiffness if s.stiffness > 0.0 else 0.0
    stretched = straight + stretch
    line = Vector(offset_x, offset_y, -sqrt(stretched * stretched - horizontal))
    load = add_scaled(tip, 1.0, line)
    hook = add_scaled(tip, (length + stretch) / stretched, line) if s.sling > 0.0 else load
    return Hung(load, load, hook, hook, pull, stretch)


@equation
def set_off(
    hung: Hung,
    tip: Vector,
    tip_step: Vector,
    lowered: float,
    velocity_x: float,
    velocity_y: float,
    h: float,
) -> Hung:
    """A load at rest, with the positions one step earlier that give it its first velocity.

    Within the step it moves with the tip by `tip_step` [m] and away from it along the rope by
    `lowered` [m]. Its velocity relative to the tip has the given horizontal part [m/s]; the
    vertical part keeps the rope taut.
    """
    line = add_scaled(hung.load, -1.0, tip)
    rise = -(velocity_x * line.x + velocity_y * line.y) / line.z
    swing = Vector(velocity_x, velocity_y, rise)
    tip_and_hoist = add_scaled(tip_step, lowered / norm(line), line)
    hook_share = norm(add_scaled(hung.hook, -1.0, tip)) / norm(line)
    previous_load = add_scaled(hung.load, -1.0, add_scaled(tip_and_hoist, h, swing))
    previous_hook = add_scaled(hung.hook, -1.0, add_scaled(tip_and_hoist, h * hook_share, swing))
    return Hung(hung.load, previous_load, hung.hook, previous_hook, hung.pull, hung.stretch)


# --- path of a load -------------------------------------------------------------------------------


ORIGIN = Vector(0.0, 0.0, 0.0)


class LedLoad(NamedTuple):
    """Load and rope, and where they are at the first sample."""

    hanging: Hanging
    first: Hung


class Led(NamedTuple):
    """Load and upper end of the rope at the sample before."""

    samples: float = 0.0
    """Samples so far, 2 if they are more: the first two are not like the others."""
    hung: Hung = Hung(ORIGIN, ORIGIN, ORIGIN, ORIGIN, 0.0, 0.0)
    tip: Vector = ORIGIN


@equation
def led_now(
    state: Led, tip_x: float, tip_y: float, tip_z: float, rope: float, p: LedLoad, h: float
) -> Hung:
    """Load and hook at a sample; the first step is half a step from a given velocity."""
    hung = p.first
    if state.samples > 0.5:
        square = 0.5 * h * h if state.samples < 1.5 else h * h
        tip = Vector(tip_x, tip_y, tip_z)
        hung = rope_step(state.hung, state.tip, tip, rope, p.hanging, h, square)
    return hung


@equation
def led_step(state: Led, signals: Hung, tip_x: float, tip_y: float, tip_z: float) -> Led:
    """Keep a sample for the next one."""
    return Led(min(state.samples + 1.0, 2.0), signals, Vector(tip_x, tip_y, tip_z))


load_on_path = Model("load_on_path", parameters=LedLoad, state=Led, step=led_step, sample=led_now)


class LoadMotion(NamedTuple):
    """Path of a load."""

    position: Array
    """(n, 3), as the tip's. [m]"""
    pull: Array
    """(n,) tension for each kilogram of load and hook over the step that ends here; 0 is slack.
    [N/kg]"""
    hook: Array | None = None
    """(n, 3) the hook, if there is one. [m]"""


def load_motion(
    tip: ArrayLike,
    length: ArrayLike,
    rate: float = 512.0,
    *,
    start: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    drag: float = 0.0,
    wind: ArrayLike = (0.0, 0.0, 0.0),
    suspension: Suspension | None = None,
    mass: float = 1.0,
    swing_damping: float = 0.0,
) -> LoadMotion:
    """Path of a load whose rope's upper end moves along a given path.

    Parameters
    ----------
    tip : (n, 3) array_like
        Path of the upper end, z up, inertial. [m]
    length : (n,) array_like or float
        Of the rope. [m]
    rate : float
        Samples a second. [Hz]
    start, velocity : (3,) array_like, optional
        Of the load; by default it hangs below the tip and moves with it. [m], [m/s]
    drag, wind
        ρ C_d A/(2 m) [1/m], and velocity of the air, (3,) [m/s].
    suspension, mass
        Elastic rope, hook with slings, and mass of the load, which then counts [kg]; a hook starts
        straight between tip and load.
    swing_damping
        Damping ratio ζ of the swing, 0 to 0.2.

    Raises
    ------
    InputError
        For paths that do not fit together, a damping ratio beyond its range, and if the tip moves
        by the order of the rope's length within a step.
    """
    tips = np.ascontiguousarray(tip, dtype=np.float64)
    if tips.ndim != 2 or tips.shape[1] != 3 or len(tips) < 2:
        raise InputError("The tip's path needs two or more rows of x, y and z.")
    rope = np.ascontiguousarray(np.broadcast_to(np.asarray(length, dtype=np.float64), len(tips)))
    if not (np.isfinite(tips).all() and np.isfinite(rope).all() and rope.min() > 0.0):
        raise InputError("Tip and rope must be finite everywhere, and the rope longer than 0 m.")
    # second-order difference of the first samples
    slope = (4.0 * tips[1] - 3.0 * tips[0] - tips[min(2, len(tips) - 1)]) * rate / 2.0
    v = slope if velocity is None else np.asarray(velocity, dtype=np.float64)
    h = 1.0 / rate
    s = (suspension or Suspension()).hanging(
        mass,
        shortest=float(rope.min()),
        rate=rate,
        drag=float(drag),
        wind=wind,
        swing_damping=swing_damping,
    )
    now = hanging_load(vector_of(tips[0]), 0.0, 0.0, float(rope[0]), s)
    now = now._replace(
        previous_load=vector_of(np.array(now.load) - v * h),
        previous_hook=vector_of(np.array(now.hook) - v * h),
    )
    if start is not None:
        load = np.asarray(start, dtype=np.float64)
        line = load - tips[0]
        distance = float(np.linalg.norm(line))
        if not distance > s.sling:
            raise InputError(
                f"The load starts {distance:g} m from the tip, but hangs on slings of "
                f"{s.sling:g} m."
            )
        hook = load - s.sling / distance * line
        stretch = distance - s.sling - float(rope[0])
        now = Hung(
            load=vector_of(load),
            previous_load=vector_of(load - v * h),
            hook=vector_of(hook),
            previous_hook=vector_of(hook - v * h),
            pull=float(elastic_pull(stretch, stretch, float(rope[0]), s, h)),
            stretch=stretch,
        )
    out = _led(LedLoad(s, now), tips, rope, rate)
    failed = int(np.argmax(out[6] < 0.0))
    if out[6, failed] < 0.0:
        raise InputError(too_fast_sentence(float(rope[failed]), failed / rate, rate))
    if not s.stiffness > 0.0:
        out[6, 0] = out[6, 1]
    return LoadMotion(out[:3].T, out[6], out[3:6].T if s.sling > 0.0 else None)


def _led(numbers: LedLoad, tips: Array, rope: Array, rate: float) -> Array:
    """(7, n) load, hook and pull of a load that is led along a path."""
    inputs = {f"tip_{axis}": tips[:, i] for i, axis in enumerate("xyz")}
    run = simulate(Machine(load_on_path, numbers), inputs | {"rope": rope}, rate)
    names = [f"{point}.{axis}" for point in ("load", "hook") for axis in "xyz"]
    return np.stack([run[name] for name in (*names, "pull")])


def swing_of(load: Array, tip: Array) -> Array:
    """Angle between rope and plumb line. [rad]"""
    x, y, z = (load - tip).T
    return np.asarray(np.arctan2(np.hypot(x, y), -z))


def rope_leads(line: Array, slew: Array, ship: Array) -> Array:
    """Angles of a rope in the crane's own axes: outwards and to starboard of the boom. [rad]

    Parameters
    ----------
    line : (n, 3) array
        Rope's end less tip, inertial. [m]
    slew : (n,) array
        From forward, positive to starboard. [rad]
    ship : (n, 6) or (n, 1) array
        Motion of the ship [m], [rad]; one column if it is at rest.

    Returns
    -------
    (n, 2) array
    """
    c, s = np.cos(slew), np.sin(slew)
    x, y, z = _along_ship(line, ship)
    outwards = np.arctan2(x * c - y * s, -z)
    return np.stack([outwards, np.arctan2(-x * s - y * c, -z)], axis=1)


def _along_ship(vectors: Array, ship: Array) -> Array:
    """(3, n) components along the ship's axes of (n, 3) inertial vectors, as `to_ship`."""
    if ship.shape[1] == 1:
        return vectors.T
    cosines, sines = np.cos(ship[:, 3:]).T, np.sin(ship[:, 3:]).T
    roll, pitch, yaw = zip(cosines, sines, strict=True)
    axes = axes_of(roll, pitch, yaw)
    return np.stack([np.asarray(dot(axis, Vector(*vectors.T))) for axis in axes])


def in_ship_axes(points: Array, ship: Array) -> Array:
    """Points as coordinates along the ship's axes, from its origin. [m]

    Parameters
    ----------
    points : (n, 3) array
        Inertial. [m]
    ship : (n, 6) or (n, 1) array
        Motion of the ship [m], [rad]; one column if it is at rest.

    Returns
    -------
    (n, 3) array
    """
    if ship.shape[1] == 1:
        return points
    return _along_ship(points - ship[:, :3], ship).T


def too_fast_sentence(length: float, time: float, rate: float) -> str:
    """Sentence for a rope that is too short for the step."""
    return (
        f"At {time:g} s the boom's tip moves within one sample by more than a rope of {length:.3g} "
        f"m lets the load follow: use a longer rope, a smoother path or more than {rate:g} samples "
        "a second."
    )
