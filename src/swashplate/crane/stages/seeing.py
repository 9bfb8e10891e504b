"""What crew and control know of crane and ship: the sample before, or what sensors say of it."""

from __future__ import annotations

from math import floor
from typing import NamedTuple

from swashplate.crane.kinematics import Boom, Vector
from swashplate.crane.motion import SHIP, Ship
from swashplate.machine import History, Model, Tap, equation, past

ROUNDING = 1e-9
"""By which a measurement may come before its sample."""


class Stateless(NamedTuple):
    """State of what remembers nothing."""


@equation
def stateless() -> Stateless:
    """Remember nothing."""
    return Stateless()


# --- the sample before ----------------------------------------------------------------------------


class First(NamedTuple):
    """Crane and load before the first sample."""

    tip: Vector
    hook: Vector
    """End of the rope. [m]"""
    rope: float
    """[m]"""
    boom: Boom
    home_slew: float
    """[rad]"""
    ship: Ship = Ship()


class LastSample(NamedTuple):
    """The sample before: points [m], angle of the slew from home [rad]; and the ship now."""

    tip_x: float
    tip_y: float
    tip_z: float
    hook_x: float
    hook_y: float
    hook_z: float
    rope: float
    boom_cos: float
    boom_sin: float
    shaft_slew: float
    surge: float
    sway: float
    heave: float
    roll: float
    pitch: float
    yaw: float


BEFORE = {
    **{f"tip_{axis}": f"tip.{axis}" for axis in "xyz"},
    **{f"hook_{axis}": f"hook.{axis}" for axis in "xyz"},
    **{"rope": "rope", "boom_cos": "boom.cos", "boom_sin": "boom.sin", "shaft_slew": ""},
}
"""Signals of the body that are known a sample late, each with what it is before the first one."""


class Seen(NamedTuple):
    """Crane and ship as they are seen."""

    swing_x: float
    swing_y: float
    swing_z: float
    """End of the rope less tip, inertial. [m]"""
    rope: float
    """[m]"""
    slew: float
    """From forward. [rad]"""
    boom_cos: float
    boom_sin: float
    height: float
    """Of the tip over the point of the ship whose motion is given. [m]"""
    surge: float
    sway: float
    heave: float
    """[m]"""
    roll: float
    pitch: float
    yaw: float
    """[rad]"""


@equation
def seen_now(inputs: LastSample, p: First) -> Seen:
    """The sample before, as crew and control look at it."""
    return Seen(
        swing_x=inputs.hook_x - inputs.tip_x,
        swing_y=inputs.hook_y - inputs.tip_y,
        swing_z=inputs.hook_z - inputs.tip_z,
        rope=inputs.rope,
        slew=p.home_slew + inputs.shaft_slew,
        boom_cos=inputs.boom_cos,
        boom_sin=inputs.boom_sin,
        height=inputs.tip_z - inputs.heave,
        surge=inputs.surge,
        sway=inputs.sway,
        heave=inputs.heave,
        roll=inputs.roll,
        pitch=inputs.pitch,
        yaw=inputs.yaw,
    )


view = Model(
    "view",
    parameters=First,
    state=Stateless,
    step=stateless,
    sample=seen_now,
    inputs=LastSample,
    defaults=SHIP,
)

# --- sensors --------------------------------------------------------------------------------------


class Sensing(NamedTuple):
    """Numbers of `Sensors`."""

    rate: float
    """Measurements a sample."""
    delay: float
    """[samples]"""
    rope_angle: float
    motion: float
    """Root mean square noise. [rad]"""
    longest: float
    """Longest time that a measurement is held, with its delay. [s]"""


class Samples(NamedTuple):
    """How many samples there have been."""

    number: float = 0.0


@equation
def counted(state: Samples) -> Samples:
    """Count a sample."""
    return Samples(state.number + 1.0)


class Past(NamedTuple):
    """What is `Seen`, and the noise of a measurement of it, with their past."""

    swing_x: History
    swing_y: History
    swing_z: History
    rope: History
    slew: History
    boom_cos: History
    boom_sin: History
    height: History
    surge: History
    sway: History
    heave: History
    roll: History
    pitch: History
    yaw: History
    noise_x: History
    noise_y: History
    """Of the rope's direction; the noise has a root mean square of 1."""
    noise_roll: History
    noise_pitch: History


READINGS = len(Seen._fields)
NOISE = Past._fields[READINGS:]
"""Inputs that are the noise of a measurement."""


@equation
def measurement_at(sample: float, rate: float) -> float:
    """Number of the last measurement at a sample; 0, the start's, also before it."""
    return max(floor(sample * rate + ROUNDING), 0.0)


@equation
def sample_of(measurement: float, rate: float) -> float:
    """Sample of a measurement: the first one whose last measurement it is."""
    first = max(floor(measurement / rate) - 1.0, 0.0)
    for _ in range(3):
        first = first if measurement_at(first, rate) >= measurement else first + 1.0
    return first


@equation
def last_measured(state: Samples, inputs: Past, p: Sensing) -> Seen:
    """The last measurement that has arrived, with its noise."""
    arrived = measurement_at(state.number - p.delay, p.rate)
    age = state.number - sample_of(arrived, p.rate)
    true = Seen(*[past(each, age) for each in inputs[:READINGS]])
    return true._replace(
        swing_x=true.swing_x + p.rope_angle * true.rope * past(inputs.noise_x, age),
        swing_y=true.swing_y + p.rope_angle * true.rope * past(inputs.noise_y, age),
        roll=true.roll + p.motion * past(inputs.noise_roll, age),
        pitch=true.pitch + p.motion * past(inputs.noise_pitch, age),
    )


sensors = Model(
    "sensors",
    parameters=Sensing,
    state=Samples,
    step=counted,
    sample=last_measured,
    inputs=Past,
    taps={name: Tap(name, longest="longest") for name in Past._fields},
)
