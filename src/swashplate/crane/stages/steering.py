"""From the stick to reference speeds of the shafts: path of the tip, offsets, clip, position loop.

One sample after the other, each as a model that `swashplate.join` puts in front of the drives:

1. `stick`: fractions of full speed become reference speeds;
2. `path`: where these alone would bring the tip; `shaper`: that path, shaped;
3. `feedback`: offsets of it by delayed feedback and compensation of the ship;
4. `follower`: the offsets are clipped, and the shafts follow the path with them;
5. `inverse` or `straight`: reference speeds become voltages, or `ideal` limits them.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import Any, NamedTuple

from swashplate.crane.kinematics import (
    Boom,
    Geometry,
    Home,
    Shafts,
    Vector,
    boom_at,
    reach_rate,
    rotation,
    shafts_for,
    tip_of,
    to_ship,
)
from swashplate.crane.motion import SHIP, Ship
from swashplate.crane.rope import GRAVITY
from swashplate.crane.stages.seeing import Stateless, stateless
from swashplate.machine import History, Model, Tap, equation, interpolate, past
from swashplate.parameters import FULL_VOLTAGE

POINTS = 202
"""Points of an `InverseMap` in both branches together."""


class Drivable(NamedTuple):
    """Limits of a drive's shaft."""

    low: float
    high: float
    """[rad/s]"""
    acceleration: float
    """The smaller one of both ways. [rad/s²]"""


# --- stick and path -------------------------------------------------------------------------------


class Drives(NamedTuple):
    """Limits of the three drives."""

    hoist: Drivable
    slew: Drivable
    luff: Drivable


class Reference(NamedTuple):
    """Reference speeds of the shafts. [rad/s]"""

    reference_hoist: float
    reference_slew: float
    reference_luff: float


@equation
def full_speed(u: float, drive: Drivable) -> float:
    """Speed for a stick's fraction of the full speed in its direction. [rad/s]"""
    return u * drive.high if u > 0.0 else -u * drive.low


@equation
def asked(hoist: float, slew: float, luff: float, p: Drives) -> Reference:
    """Speeds that the stick asks for, of commands from -1 to 1."""
    return Reference(full_speed(hoist, p.hoist), full_speed(slew, p.slew), full_speed(luff, p.luff))


stick = Model("stick", parameters=Drives, state=Stateless, step=stateless, sample=asked)


class Path(NamedTuple):
    """Crane at home."""

    geometry: Geometry
    home: Home


class Angles(NamedTuple):
    """Where the stick alone would have brought slew and luff."""

    samples: float = 0.0
    """1 after the first one."""
    slew: float = 0.0
    luff: float = 0.0
    """[rad]"""
    slew_speed: float = 0.0
    luff_speed: float = 0.0
    """[rad/s]"""


class Ahead(NamedTuple):
    """Tip by the stick alone, in the ship's frame. [m]"""

    ahead_x: float
    ahead_y: float
    angle_slew: float
    angle_luff: float
    """[rad]"""


@equation
def tip_ahead(
    state: Angles, reference_slew: float, reference_luff: float, p: Path, h: float
) -> Ahead:
    """Where the operator's speeds alone bring the tip, shafts by the trapezoidal rule."""
    half = 0.5 * h if state.samples > 0.5 else 0.0
    slew = state.slew + half * (state.slew_speed + reference_slew)
    luff = state.luff + half * (state.luff_speed + reference_luff)
    tip = tip_of(p.home.slew + slew, boom_at(luff, p.geometry, p.home), p.geometry)
    return Ahead(tip.x, tip.y, slew, luff)


@equation
def path_step(signals: Ahead, reference_slew: float, reference_luff: float) -> Angles:
    """Keep a sample for the next one."""
    return Angles(1.0, signals.angle_slew, signals.angle_luff, reference_slew, reference_luff)


path = Model("path", parameters=Path, state=Angles, step=path_step, sample=tip_ahead)


class Impulses(NamedTuple):
    """Of a shaper, half a period of the load apart; and where the path begins."""

    first: float
    second: float
    third: float
    begin_x: float
    begin_y: float
    """[m]"""
    longest: float
    """Period of the load on the longest rope. [s]"""


class Shaped(NamedTuple):
    """Path of the tip, in the ship's frame. [m]"""

    path_x: float
    path_y: float


@equation
def shaped(line: History, half: float, p: Impulses) -> float:
    """A signal through impulses that are `half` samples apart."""
    total = 0.0
    if p.first > 0.0:
        total += p.first * line.newest
    if p.second > 0.0:
        total += p.second * past(line, half)
    if p.third > 0.0:
        total += p.third * past(line, 2.0 * half)
    return total


@equation
def half_period(rope: float, h: float) -> float:
    """Half a period of the load. [samples]"""
    return pi * sqrt(rope / GRAVITY) / h


@equation
def shaped_path(ahead_x: History, ahead_y: History, rope: float, p: Impulses, h: float) -> Shaped:
    """The tip's path through the shaper, for the present rope."""
    half = half_period(rope, h)
    return Shaped(shaped(ahead_x, half, p), shaped(ahead_y, half, p))


shaper = Model(
    "shaper",
    parameters=Impulses,
    state=Stateless,
    step=stateless,
    sample=shaped_path,
    taps={
        "ahead_x": Tap("ahead_x", longest="longest", before="begin_x"),
        "ahead_y": Tap("ahead_y", longest="longest", before="begin_y"),
    },
)

# --- offsets --------------------------------------------------------------------------------------


class Offsets(NamedTuple):
    """Numbers of delayed feedback and of the ship's compensation."""

    feedback: float
    """Part of the swing that is added to the path; 0 without."""
    delay: float
    """[periods of the load]"""
    compensates: float
    """1 if the ship's motion is compensated, else 0."""
    begin_x: float
    begin_y: float
    """Swing before the first sample. [m]"""
    longest: float
    """[s]"""
    ship: Ship = Ship()


class Offset(NamedTuple):
    """What is added to the path, in the ship's frame. [m]"""

    offset_x: float
    offset_y: float


class FeedbackInputs(NamedTuple):
    """Path of the tip [m], the true rope [m], and what is seen: swing, height, ship [m], [rad]."""

    path_x: float
    path_y: float
    rope: float
    swing_x: History
    swing_y: History
    height: float
    surge: float
    sway: float
    heave: float
    roll: float
    pitch: float
    yaw: float


@equation
def offsets(inputs: FeedbackInputs, p: Offsets, h: float) -> Offset:
    """Offset of the path by delayed feedback and ship compensation."""
    r = rotation(inputs.roll, inputs.pitch, inputs.yaw)
    x = 0.0
    y = 0.0
    if p.feedback > 0.0:
        back = 2.0 * half_period(inputs.rope, h) * p.delay
        x = p.feedback * past(inputs.swing_x, back)
        y = p.feedback * past(inputs.swing_y, back)
        turned = to_ship(r, Vector(x, y, 0.0))
        x = turned.x
        y = turned.y
    if p.compensates > 0.0:
        # the point of the path over the sea, at the tip's own height
        over_sea = Vector(inputs.path_x - inputs.surge, inputs.path_y - inputs.sway, inputs.height)
        compensated = to_ship(r, over_sea)
        x += compensated.x - inputs.path_x
        y += compensated.y - inputs.path_y
    return Offset(x, y)


feedback = Model(
    "feedback",
    parameters=Offsets,
    state=Stateless,
    step=stateless,
    sample=offsets,
    inputs=FeedbackInputs,
    taps={
        "swing_x": Tap("swing_x", longest="longest", before="begin_x"),
        "swing_y": Tap("swing_y", longest="longest", before="begin_y"),
    },
    defaults=SHIP,
)

# --- clip, inverse kinematics, position loop ------------------------------------------------------


class Following(NamedTuple):
    """Crane, drives, clip and position loop."""

    geometry: Geometry
    home: Home
    slew: Drivable
    luff: Drivable
    gain: float
    """Of the position loop. [1/s]"""
    clip: float
    """[m]; 0: from the drives' limits, by `share`; no clip if that is 0, too."""
    share: float
    extra: float = 0.0
    """What a user-defined controller adds if there is none. [m]"""


class FollowerInputs(NamedTuple):
    """Path and offsets of the tip [m]; boom, rope [m] and shafts [rad] of the sample before."""

    path_x: float
    path_y: float
    offset_x: float
    offset_y: float
    extra_x: float
    extra_y: float
    rope: float
    boom_cos: float
    boom_sin: float
    shaft_slew: float
    shaft_luff: float


class ReferenceAngles(NamedTuple):
    """Angles of slew and luff that put the tip where it should be. [rad]"""

    samples: float = 0.0
    """1 after the first one."""
    slew: float = 0.0
    luff: float = 0.0


class Followed(NamedTuple):
    """Reference speeds [rad/s] and angles [rad] of slew and luff."""

    reference_slew: float
    reference_luff: float
    target_slew: float
    target_luff: float


@equation
def largest_sine(speed: float, acceleration: float, omega: float) -> float:
    """Largest sine at ω [rad/s] that a speed and an acceleration allow, min(v/ω, a/ω²). [m]"""
    return min(speed / omega, acceleration / (omega * omega))


@equation
def clipped(x: float, y: float, inputs: FollowerInputs, p: Following) -> Offset:
    """Offset of the tip, limited along the boom and across it to what the drives can follow."""
    omega = sqrt(GRAVITY / inputs.rope)
    g = p.geometry
    boom = Boom(inputs.boom_cos, inputs.boom_sin)
    e_x = inputs.path_x - g.axis.x
    e_y = inputs.path_y - g.axis.y
    reach = sqrt(e_x * e_x + e_y * e_y)
    e_x = e_x / reach
    e_y = e_y / reach
    rate = reach_rate(boom, g)
    speed_along = rate * min(p.luff.high, -p.luff.low)
    speed_across = reach * min(p.slew.high, -p.slew.low)
    most_along = p.share * largest_sine(speed_along, rate * p.luff.acceleration, omega)
    if p.clip > 0.0:
        most_along = p.clip
    most_across = p.share * largest_sine(speed_across, reach * p.slew.acceleration, omega)
    along = min(max(x * e_x + y * e_y, -most_along), most_along)
    across = min(max(y * e_x - x * e_y, -most_across), most_across)
    return Offset(along * e_x - across * e_y, along * e_y + across * e_x)


@equation
def followed(state: ReferenceAngles, inputs: FollowerInputs, p: Following, h: float) -> Followed:
    """Speeds that bring the tip to its path and its offset, with the position loop's correction."""
    x = inputs.offset_x + inputs.extra_x
    y = inputs.offset_y + inputs.extra_y
    if p.clip > 0.0 or p.share > 0.0:
        offset = clipped(x, y, inputs, p)
        x = offset.offset_x
        y = offset.offset_y
    now = Shafts(0.0, state.slew, state.luff)
    target = shafts_for(inputs.path_x + x, inputs.path_y + y, now, p.geometry, p.home)
    moves = 1.0 if state.samples > 0.5 else 0.0
    slew = (target.slew - state.slew) / h * moves + p.gain * (target.slew - inputs.shaft_slew)
    luff = (target.luff - state.luff) / h * moves + p.gain * (target.luff - inputs.shaft_luff)
    return Followed(slew, luff, target.slew, target.luff)


@equation
def follower_step(signals: Followed) -> ReferenceAngles:
    """Keep a sample for the next one."""
    return ReferenceAngles(1.0, signals.target_slew, signals.target_luff)


follower = Model(
    "follower",
    parameters=Following,
    state=ReferenceAngles,
    step=follower_step,
    sample=followed,
    inputs=FollowerInputs,
    defaults={"extra_x": "extra", "extra_y": "extra"},
)

# --- actuation ------------------------------------------------------------------------------------


class DriveCommand(NamedTuple):
    """Of a drive. [V]"""

    command: float


@equation
def straight_command(reference: float, p: Drivable) -> DriveCommand:
    """10 V for full speed, clipped."""
    full = p.high if reference > 0.0 else -p.low
    return DriveCommand(min(max(FULL_VOLTAGE * reference / full, -FULL_VOLTAGE), FULL_VOLTAGE))


straight = Model(
    "straight", parameters=Drivable, state=Stateless, step=stateless, sample=straight_command
)


class Shaft(NamedTuple):
    """Of a drive that follows instantaneously. [rad/s]"""

    shaft_speed: float


@equation
def ideal_speed(reference: float, p: Drivable) -> Shaft:
    """The reference speed within the drive's limits."""
    return Shaft(min(max(reference, p.low), p.high))


ideal = Model("ideal", parameters=Drivable, state=Stateless, step=stateless, sample=ideal_speed)


# mypy knows only named tuples whose fields are written out
Table: Any = NamedTuple("Table", [(f"at_{number}", float) for number in range(POINTS)])  # type: ignore[misc]
"""Numbers at all points of an inverse map."""


class Inverse(NamedTuple):
    """An `InverseMap`: both branches, both rising, and the dead zone between them."""

    speed: Table
    """[rad/s]"""
    voltage: Table
    """[V]"""
    slowest_down: float
    slowest_up: float
    """Speeds at the edges of the dead zone, between which there is only the creep. [rad/s]"""
    edge_down: float
    edge_up: float
    """[V]"""
    creep: float
    low: float
    high: float
    """[rad/s]"""


@equation
def inverse_command(reference: float, p: Inverse) -> DriveCommand:
    """DriveCommand of a drive for a speed of its shaft, by `InverseMap.voltage`, clipped."""
    below = reference - p.slowest_down
    above = p.slowest_up - reference
    at_rest = abs(reference - p.creep)
    edge = p.edge_down if below <= above else p.edge_up
    still = 0.0 if at_rest <= below and at_rest <= above else edge
    moving = interpolate(min(max(reference, p.low), p.high), p.speed, p.voltage)
    return DriveCommand(still if below >= 0.0 and above >= 0.0 else moving)


inverse = Model(
    "inverse", parameters=Inverse, state=Stateless, step=stateless, sample=inverse_command
)
