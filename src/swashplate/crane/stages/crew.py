"""A crew that damps the swing by hand: the operator's eyes, delay and arm, at the joysticks.

The operator sees how far the load hangs out, and drives the tip over it. A joystick asks for a
speed, so that the wanted speed of the tip is proportional to the swing, which damps it:

    u = K (d - θₜ L sgn d) for abs(d) > θₜ L, else 0,    T_n dv/dt + v = u(t - τ),

with the swing d [m] as it is seen from the cab, on its way out of rest on the rope L. On ideal
drives, without threshold, d'' + K d'(t - τ) + ω₀² d = 0: a small gain gives the damping ratio
K cos(ω₀ τ)/(2 ω₀), which is negative for delays between a quarter and three quarters of a period.

The structure is that of the crossover model: around and above ω₀ tip speed to swing is an
integrator, and a person in front of an integrator is a gain with a delay (McRuer and Krendel). None
of the numbers was measured on a crane's operator; `Crew` gives where they come from.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import NamedTuple

from swashplate.crane.kinematics import Boom, Geometry, Vector, reach_rate, rotation, to_ship
from swashplate.crane.motion import SHIP, Ship
from swashplate.crane.rope import GRAVITY
from swashplate.crane.stages.steering import Drivable
from swashplate.machine import Model, Tap, equation


class HumanOperator(NamedTuple):
    """Numbers of a `Crew`."""

    gain: float
    """Speed of the tip for each metre of swing. [1/s]"""
    delay: float
    """[s]"""
    threshold: float
    """[rad]"""
    share: float
    """Of what the drives can follow."""
    lag: float
    """[s]"""
    return_time: float
    """[s]"""


class Boomwise(NamedTuple):
    """Components of a horizontal vector, as slew and luff move them."""

    across: float
    """To starboard of a boom that points forward."""
    along: float


@equation
def beyond_threshold(swing: float, threshold: float) -> float:
    """Part of a swing beyond the threshold of perception, 0 below it. [m]"""
    return swing - min(max(swing, -threshold), threshold)


@equation
def followable_speed(speed: float, acceleration: float, omega: float) -> float:
    """Amplitude of a tip's speed at ω [rad/s] that its limits allow, min(v, a/ω). [m/s]"""
    return min(speed, acceleration / omega)


@equation
def boomwise(v: Vector, slew: float) -> Boomwise:
    """Components across the boom and along it, at a slew from forward [rad]."""
    c, s = cos(slew), sin(slew)
    return Boomwise(-v.x * s - v.y * c, v.x * c - v.y * s)


@equation
def arms(boom: Boom, g: Geometry) -> Boomwise:
    """Metres of the tip for each radian of the shafts of slew and luff: boom up is inwards."""
    return Boomwise(g.foot + g.boom * boom.cos, -reach_rate(boom, g))


# --- eye ------------------------------------------------------------------------------------------


class Eye(NamedTuple):
    """The operator, and what the crane can do."""

    operator: HumanOperator
    slew: Drivable
    luff: Drivable
    geometry: Geometry
    ship: Ship = Ship()


class EyeInputs(NamedTuple):
    """Command [rad/s], and view from the cab, which rolls with the ship; as of `seeing.Seen`."""

    reference_slew: float
    reference_luff: float
    swing_x: float
    swing_y: float
    swing_z: float
    rope: float
    slew: float
    boom_cos: float
    boom_sin: float
    shaft_slew: float
    shaft_luff: float
    roll: float
    pitch: float
    yaw: float


class EyeState(NamedTuple):
    """What the operator remembers."""

    samples: float = 0.0
    """1 after the first one."""
    hang: Boomwise = Boomwise(0.0, 0.0)
    """Swing that is taken for rest. [m]"""
    commanded: Boomwise = Boomwise(0.0, 0.0)
    """Shaft angles of slew and luff by the command alone. [rad]"""


class Wanted(NamedTuple):
    """Speeds of the tip that the operator wants, before they reach the hand. [m/s]"""

    wanted_across: float
    wanted_along: float
    hang: Boomwise
    commanded: Boomwise


@equation
def most_speed(arm: float, omega: float, drive: Drivable, p: HumanOperator) -> float:
    """Speed of the tip for which the operator asks at most. [m/s]"""
    full = abs(arm) * min(drive.high, -drive.low)
    return p.share * followable_speed(full, abs(arm) * drive.acceleration, omega)


@equation
def wanted(
    swing: float, hang: float, away: float, most: float, rope: float, p: HumanOperator
) -> float:
    """Speed of the tip in one direction, for a swing and how far it is from its place. [m/s]"""
    out = beyond_threshold(swing - hang, p.threshold * rope)
    speed = p.gain * out - away / p.return_time
    return min(max(speed, -most), most)


@equation
def looked(state: EyeState, inputs: EyeInputs, p: Eye, h: float) -> Wanted:
    """What the operator sees and wants."""
    r = rotation(inputs.roll, inputs.pitch, inputs.yaw)
    swing_vector = Vector(inputs.swing_x, inputs.swing_y, inputs.swing_z)
    swing = boomwise(to_ship(r, swing_vector), inputs.slew)
    plumb = boomwise(to_ship(r, Vector(0.0, 0.0, -inputs.rope)), inputs.slew)
    arm = arms(Boom(inputs.boom_cos, inputs.boom_sin), p.geometry)
    started = state.samples > 0.5
    hang = state.hang if started else plumb
    moves = h if started else 0.0
    commanded = Boomwise(
        state.commanded.across + moves * inputs.reference_slew,
        state.commanded.along + moves * inputs.reference_luff,
    )
    adapts = h / p.operator.return_time
    hang = Boomwise(
        hang.across + adapts * (swing.across - hang.across),
        hang.along + adapts * (swing.along - hang.along),
    )
    omega = sqrt(GRAVITY / inputs.rope)
    return Wanted(
        wanted(
            swing.across,
            hang.across,
            arm.across * (inputs.shaft_slew - commanded.across),
            most_speed(arm.across, omega, p.slew, p.operator),
            inputs.rope,
            p.operator,
        ),
        wanted(
            swing.along,
            hang.along,
            arm.along * (inputs.shaft_luff - commanded.along),
            most_speed(arm.along, omega, p.luff, p.operator),
            inputs.rope,
            p.operator,
        ),
        hang,
        commanded,
    )


@equation
def eye_step(signals: Wanted) -> EyeState:
    """Keep a sample for the next one."""
    return EyeState(1.0, signals.hang, signals.commanded)


eye = Model(
    "eye",
    parameters=Eye,
    state=EyeState,
    step=eye_step,
    sample=looked,
    inputs=EyeInputs,
    defaults={name: SHIP[name] for name in ("roll", "pitch", "yaw")},
)

# --- hand -----------------------------------------------------------------------------------------


class Hand(NamedTuple):
    """The operator's hand, and the drives."""

    delay: float
    """From eye to hand. [s]"""
    lag: float
    """[s]"""
    slew: Drivable
    luff: Drivable
    geometry: Geometry


class HandInputs(NamedTuple):
    """Command [rad/s], what the eye wanted [m/s], and the boom."""

    reference_slew: float
    reference_luff: float
    wanted_across: float
    wanted_along: float
    boom_cos: float
    boom_sin: float


class HandState(NamedTuple):
    """Speed of the tip for which the hand asks. [m/s]"""

    speed: Boomwise = Boomwise(0.0, 0.0)


class Moved(NamedTuple):
    """Reference speeds with what the hand adds. [rad/s]"""

    reference_slew: float
    reference_luff: float
    speed: Boomwise
    """[m/s]"""


@equation
def within(speed: float, drive: Drivable) -> float:
    """Speed of a shaft within its drive's limits. [rad/s]"""
    return min(max(speed, drive.low), drive.high)


@equation
def moved(state: HandState, inputs: HandInputs, p: Hand, h: float) -> Moved:
    """What hand and command ask of slew and luff."""
    arm = arms(Boom(inputs.boom_cos, inputs.boom_sin), p.geometry)
    follows = h / p.lag
    speed = Boomwise(
        state.speed.across + follows * (inputs.wanted_across - state.speed.across),
        state.speed.along + follows * (inputs.wanted_along - state.speed.along),
    )
    return Moved(
        within(inputs.reference_slew + speed.across / arm.across, p.slew),
        within(inputs.reference_luff + speed.along / arm.along, p.luff),
        speed,
    )


@equation
def hand_step(signals: Moved) -> HandState:
    """Keep a sample for the next one."""
    return HandState(signals.speed)


hand = Model(
    "hand",
    parameters=Hand,
    state=HandState,
    step=hand_step,
    sample=moved,
    inputs=HandInputs,
    taps={
        "wanted_across": Tap("wanted_across", delay="delay", hold="none"),
        "wanted_along": Tap("wanted_along", delay="delay", hold="none"),
    },
)
