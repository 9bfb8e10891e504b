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
    """The sample before: points [m], shafts [rad]; and the ship now."""

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
    shaft_luff: float
    surge: float
    sway: float
    heave: float
    roll: float
    pitch: float
    yaw: float


BEFORE = {
    **{f"tip_{axis}": f"tip.{axis}" for axis in "xyz"},
    **{f"hook_{axis}": f"hook.{axis}" for axis in "xyz"},
    **{"rope": "rope", "boom_cos": "boom.cos", "boom_sin": "boom.sin"},
    **{"shaft_slew": "", "shaft_luff": ""},
}
"""Signals of the body that are known a sample late, each with what it is before the first one."""


class Seen(NamedTuple):
    """Crane and ship as they are seen."""

    swing_x: float
    swing_y: float
    """Load, or hook, less tip, horizontal and inertial. [m]"""
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


class View(NamedTuple):
    """What is known of the sample before."""

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
    """[m]"""
    shaft_slew: float
    shaft_luff: float
    """[rad]"""
    surge: float
    sway: float
    heave: float
    roll: float
    pitch: float
    yaw: float


@equation
def seen_now(inputs: LastSample, p: First) -> View:
    """The sample before, as crew and control look at it."""
    return View(
        swing_x=inputs.hook_x - inputs.tip_x,
        swing_y=inputs.hook_y - inputs.tip_y,
        swing_z=inputs.hook_z - inputs.tip_z,
        rope=inputs.rope,
        slew=p.home_slew + inputs.shaft_slew,
        boom_cos=inputs.boom_cos,
        boom_sin=inputs.boom_sin,
        height=inputs.tip_z - inputs.heave,
        shaft_slew=inputs.shaft_slew,
        shaft_luff=inputs.shaft_luff,
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


class Noise(NamedTuple):
    """Noise of root mean square 1, of the rope's direction, of roll and of pitch."""

    noise_x: float
    noise_y: float
    noise_roll: float
    noise_pitch: float


class Sensed(NamedTuple):
    """True values and the noise of a measurement of them, which counts if there is one now."""

    swing_x: float
    swing_y: float
    rope: float
    slew: float
    boom_cos: float
    boom_sin: float
    height: float
    surge: float
    sway: float
    heave: float
    roll: float
    pitch: float
    yaw: float
    noise_x: float
    noise_y: float
    noise_roll: float
    noise_pitch: float


@equation
def sensed(inputs: Sensed, p: Sensing) -> Seen:
    """What sensors would read at this sample."""
    return Seen(
        swing_x=inputs.swing_x + p.rope_angle * inputs.rope * inputs.noise_x,
        swing_y=inputs.swing_y + p.rope_angle * inputs.rope * inputs.noise_y,
        rope=inputs.rope,
        slew=inputs.slew,
        boom_cos=inputs.boom_cos,
        boom_sin=inputs.boom_sin,
        height=inputs.height,
        surge=inputs.surge,
        sway=inputs.sway,
        heave=inputs.heave,
        roll=inputs.roll + p.motion * inputs.noise_roll,
        pitch=inputs.pitch + p.motion * inputs.noise_pitch,
        yaw=inputs.yaw,
    )


sensors = Model(
    "sensors", parameters=Sensing, state=Stateless, step=stateless, sample=sensed, inputs=Sensed
)


class Samples(NamedTuple):
    """How many samples there have been."""

    number: float = 0.0


@equation
def counted(state: Samples) -> Samples:
    """Count a sample."""
    return Samples(state.number + 1.0)


class Past(NamedTuple):
    """Readings of the sensors with those before."""

    swing_x: History
    swing_y: History
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
    """The last measurement that has arrived."""
    arrived = measurement_at(state.number - p.delay, p.rate)
    age = state.number - sample_of(arrived, p.rate)
    return Seen(
        swing_x=past(inputs.swing_x, age),
        swing_y=past(inputs.swing_y, age),
        rope=past(inputs.rope, age),
        slew=past(inputs.slew, age),
        boom_cos=past(inputs.boom_cos, age),
        boom_sin=past(inputs.boom_sin, age),
        height=past(inputs.height, age),
        surge=past(inputs.surge, age),
        sway=past(inputs.sway, age),
        heave=past(inputs.heave, age),
        roll=past(inputs.roll, age),
        pitch=past(inputs.pitch, age),
        yaw=past(inputs.yaw, age),
    )


measured = Model(
    "measured",
    parameters=Sensing,
    state=Samples,
    step=counted,
    sample=last_measured,
    inputs=Past,
    taps={name: Tap(name, longest="longest") for name in Past._fields},
)
