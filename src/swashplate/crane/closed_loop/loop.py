"""The closed loop: stick, control, actuation, three drives, kinematics and rope in one pass.

One sample after the other, at the drives' own rate:

1. what control sees is the last sample, as a controller's computer has it, or what sensors say;
2. the stick's commands, with what a crew adds, become reference speeds of the shafts; if the tip is
   controlled, through its path, the offsets and the clip;
3. reference speeds become speeds: instantaneously (ideal drives), or by voltages, which each drive
   takes by the engine's compiled step;
4. shafts move the tip, the ship moves the crane, the tip leads the load.

A stepper is the same kernel over one sample. In open loop nothing of a sample acts on the drives:
they are marched before.
"""

from __future__ import annotations

from math import atan2, cos, floor, inf, pi, sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.crane.closed_loop.signals import ABSENT, LOAD, PULL, SHAFT, SPEED, TIP, Columns
from swashplate.crane.control import SEEN, Sensing, Settings
from swashplate.crane.crew import CrewMemory, Drivable, catch_swing, view_of
from swashplate.crane.kinematics import (
    Boom,
    Geometry,
    Home,
    Rotation,
    Shafts,
    Vector,
    add_scaled,
    boom_at,
    reach_rate,
    rope_length,
    rotation,
    shafts_for,
    tip_of,
    to_inertial,
    to_ship,
)
from swashplate.crane.motion import BrakeState, UpperEnd, braked, led_load, rope_torques
from swashplate.crane.rope import (
    GRAVITY,
    Hanging,
    Hung,
    Start,
)
from swashplate.machine import equation, inlined, kernel
from swashplate.machine.marching import StepContext, step
from swashplate.parameters import FULL_VOLTAGE

Array = NDArray[np.float64]

IDEAL, VOLTS, INVERSE, DIRECT, MARCHED = range(5)
"""Actuation: instantaneous speeds; 10 V for full speed; the inverse map's voltage; voltages as
given; drives that were simulated before."""
FINE, TOO_FAST, BOOM_OUT, ROPE_OUT, NO_NUMBER = range(5)
"""End of a pass."""
ANGLE, SHAFT_SPEED, OPERATOR_ANGLE, OPERATOR_SPEED, REFERENCE_ANGLE, TORQUE = range(6)
"""Shafts' angles and speeds; angles to which only the stick would have brought them, and its
speeds; reference angles of control; torques of the rope. [rad], [rad/s], [N m]"""
PATH, SWING = 0, 2
"""Rows of the memory of delayed signals, of each its x and y."""
ROUNDING = 1e-9
"""By which a measurement may come before its sample."""


class Inverse(NamedTuple):
    """An `InverseMap` as the loop takes it."""

    speed: Array
    voltage: Array
    """Points of both branches, both rising. [rad/s], [V]"""
    gap: int
    """Last point of the lower branch; to the next it is the dead zone, with only the creep."""
    creep: float
    low: float
    high: float
    acceleration: float
    """The smaller one of both ways. [rad/s²]"""


class Fixed(NamedTuple):
    """Quantities that stay constant during a run."""

    geometry: Geometry
    home: Home
    settings: Settings
    actuation: int
    brake: bool
    boom: tuple[float, float]
    """Sines of the boom's limits."""
    ropes: tuple[float, float]
    """Limits of the rope. [m]"""
    mass: float
    """Of load and hook. [kg]"""
    hanging: Hanging
    start: Start
    loaded: bool
    """Whether the rope's tension loads the drives."""
    inverses: tuple[Inverse, Inverse, Inverse]
    columns: Columns


class LoopArrays(NamedTuple):
    """Arrays that the loop changes: states of drives and controller, memories, margins."""

    drives: tuple[StepContext, StepContext, StepContext]
    controller: StepContext
    controlled: bool
    """Whether there is a controller; else its arrays are not used."""
    picks: NDArray[np.int64]
    """Which of `SEEN` the controller takes."""
    memory: Array
    """Delayed signals, a row each: the operator's tip x and y, swing x and y."""
    readings: Array
    """Measurements that are on their way, a row each: numbers of `Seen`."""
    noise: Array
    """(n, 4) of each measurement to come, of root mean square 1: rope x and y, roll, pitch."""
    crew: CrewMemory
    margins: Array
    """Worst margins of the domains of the drives and the controller."""
    marched: tuple[Array, ...]
    """Three voltages, three speeds, three limits of drives that were simulated before."""


class State(NamedTuple):
    """State from one sample to the next, without delayed signals and the drives' states."""

    sample: int
    axes: Array
    """(6, 3) of hoist, slew and luff: rows `ANGLE` to `TORQUE`."""
    tip: Vector
    hung: Hung
    brake: BrakeState


class Seen(NamedTuple):
    """Measurements of crane and ship that reach the control."""

    swing_x: float
    swing_y: float
    """Load, or hook, less tip, horizontal and inertial. [m]"""
    rope: float
    """[m]"""
    slew: float
    """From forward. [rad]"""
    boom: Boom
    height: float
    """Of the tip over the point of the ship whose motion is given. [m]"""
    shift: Vector
    """Surge, sway, heave. [m]"""
    angles: Vector
    """Roll, pitch, yaw. [rad]"""


READINGS, NOISY = 13, 4
"""Numbers of `Seen`, and those of them that have noise."""

# --- what control sees ----------------------------------------------------------------------------


@inlined
def measurement_at(sample: float, rate: float) -> int:
    """Number of the last measurement at a sample of the loop; 0, the start's, also before it."""
    return max(int(floor(sample * rate + ROUNDING)), 0)  # noqa: RUF046  # a float if compiled


@inlined
def measured(
    true: Seen, sample: int, first: int, sensing: Sensing, readings: Array, noise: Array
) -> Seen:
    """Pass true values through the sensors at a sample; `noise` begins at measurement `first`."""
    last = len(readings) - 1  # lengths are powers of two
    number = measurement_at(sample, sensing.rate)
    if sample == 0 or number > measurement_at(sample - 1, sensing.rate):
        row = readings[number & last]
        error = noise[number - first]
        row[0] = true.swing_x + sensing.rope_angle * true.rope * error[0]
        row[1] = true.swing_y + sensing.rope_angle * true.rope * error[1]
        row[2] = true.rope
        row[3] = true.slew
        row[4] = true.boom.cos
        row[5] = true.boom.sin
        row[6] = true.height
        row[7], row[8], row[9] = true.shift
        row[10] = true.angles.x + sensing.motion * error[2]
        row[11] = true.angles.y + sensing.motion * error[3]
        row[12] = true.angles.z
    row = readings[measurement_at(sample - sensing.delay, sensing.rate) & last]
    return Seen(
        swing_x=row[0],
        swing_y=row[1],
        rope=row[2],
        slew=row[3],
        boom=Boom(row[4], row[5]),
        height=row[6],
        shift=Vector(row[7], row[8], row[9]),
        angles=Vector(row[10], row[11], row[12]),
    )


# --- control: path, offsets, clip, inverse kinematics ---------------------------------------------


@inlined
def delayed(memory: Array, row: int, sample: int, delay: float) -> float:
    """A remembered signal a delay [samples] ago, straight between samples."""
    delay_samples = int(delay)
    delay_fraction = delay - delay_samples
    last = memory.shape[1] - 1  # lengths are powers of two
    newer: float = memory[row, (sample - delay_samples) & last]
    older: float = memory[row, (sample - delay_samples - 1) & last]
    return newer + delay_fraction * (older - newer)


@inlined
def shaped(
    memory: Array, row: int, sample: int, half: float, impulses: tuple[float, float, float]
) -> float:
    """A remembered signal through a shaper whose impulses are `half` samples apart."""
    total = 0.0
    for k in range(3):
        if impulses[k] > 0.0:
            total += impulses[k] * delayed(memory, row, sample, k * half)
    return total


@inlined
def operator_path(
    reference: Array, axes: Array, memory: Array, sample: int, half: float, h: float, fixed: Fixed
) -> tuple[float, float]:
    """Position of the tip by only the operator's speeds, shaped, in the ship's frame. [m]

    `half` is half a period of the load. [samples]
    """
    last = memory.shape[1] - 1
    advance(axes, OPERATOR_ANGLE, OPERATOR_SPEED, reference, h, sample > 0)
    boom = boom_at(axes[OPERATOR_ANGLE, 2], fixed.geometry, fixed.home)
    ahead = tip_of(fixed.home.slew + axes[OPERATOR_ANGLE, 1], boom, fixed.geometry)
    memory[PATH, sample & last] = ahead.x
    memory[PATH + 1, sample & last] = ahead.y
    impulses = fixed.settings.tip
    path_x = shaped(memory, PATH, sample, half, impulses)
    path_y = shaped(memory, PATH + 1, sample, half, impulses)
    return path_x, path_y


@inlined
def tip_offset(
    path: tuple[float, float],
    seen: Seen,
    r: Rotation,
    memory: Array,
    sample: int,
    half: float,
    settings: Settings,
) -> tuple[float, float]:
    """Offset of the path by delayed feedback and ship compensation, in the ship's frame. [m]"""
    last = memory.shape[1] - 1
    memory[SWING, sample & last] = seen.swing_x
    memory[SWING + 1, sample & last] = seen.swing_y
    x = 0.0
    y = 0.0
    if settings.feedback > 0.0:
        back = 2.0 * half * settings.delay
        x = settings.feedback * delayed(memory, SWING, sample, back)
        y = settings.feedback * delayed(memory, SWING + 1, sample, back)
        turned = to_ship(r, Vector(x, y, 0.0))
        x = turned.x
        y = turned.y
    if settings.ship:
        # the point of the path over the sea, at the tip's own height
        over_sea = Vector(path[0] - seen.shift.x, path[1] - seen.shift.y, seen.height)
        compensated = to_ship(r, over_sea)
        x += compensated.x - path[0]
        y += compensated.y - path[1]
    return x, y


@equation
def largest_sine(speed: float, acceleration: float, omega: float) -> float:
    """Largest sine at ω [rad/s] that a speed and an acceleration allow, min(v/ω, a/ω²). [m]"""
    return min(speed / omega, acceleration / (omega * omega))


@inlined
def clipped_offset(
    offset: tuple[float, float], path: tuple[float, float], boom: Boom, rope: float, fixed: Fixed
) -> tuple[float, float]:
    """Offset of the tip, limited along the boom and across it to what the drives can follow."""
    omega = sqrt(GRAVITY / rope)
    g = fixed.geometry
    settings = fixed.settings
    _, slew, luff = fixed.inverses
    x, y = offset
    e_x = path[0] - g.axis.x
    e_y = path[1] - g.axis.y
    reach = sqrt(e_x * e_x + e_y * e_y)
    e_x = e_x / reach
    e_y = e_y / reach
    rate = reach_rate(boom, g)
    speed_along = rate * min(luff.high, -luff.low)
    speed_across = reach * min(slew.high, -slew.low)
    most_along = settings.share * largest_sine(speed_along, rate * luff.acceleration, omega)
    if settings.clip > 0.0:
        most_along = settings.clip
    most_across = settings.share * largest_sine(speed_across, reach * slew.acceleration, omega)
    along = min(max(x * e_x + y * e_y, -most_along), most_along)
    across = min(max(y * e_x - x * e_y, -most_across), most_across)
    return along * e_x - across * e_y, along * e_y + across * e_x


@inlined
def follow_path(
    x: float, y: float, axes: Array, reference: Array, sample: int, h: float, fixed: Fixed
) -> None:
    """Reference speeds of slew and luff that bring the tip to (x, y) in the ship's frame.

    Their sum with the position loop's correction. [m], [rad/s]
    """
    target = shafts_for(x, y, shafts_of(axes, REFERENCE_ANGLE), fixed.geometry, fixed.home)
    for i, angle in ((1, target.slew), (2, target.luff)):
        correction = fixed.settings.gain * (angle - axes[ANGLE, i])
        reference[i] = (angle - axes[REFERENCE_ANGLE, i]) / h * (sample > 0) + correction
        axes[REFERENCE_ANGLE, i] = angle


# --- actuation and motion -------------------------------------------------------------------------


@inlined
def voltage_for(reference: float, inverse: Inverse, actuation: int) -> float:
    """Command of a drive for a speed of its shaft, by `InverseMap.voltage`, clipped. [V]"""
    if actuation == VOLTS:
        full = inverse.high if reference > 0.0 else -inverse.low
        return min(max(FULL_VOLTAGE * reference / full, -FULL_VOLTAGE), FULL_VOLTAGE)
    speed = inverse.speed
    voltage = inverse.voltage
    gap = inverse.gap
    below = reference - speed[gap]
    above = speed[gap + 1] - reference
    if below >= 0.0 and above >= 0.0:
        at_rest = abs(reference - inverse.creep)
        if at_rest <= below and at_rest <= above:
            return 0.0
        edge: float = voltage[gap] if below <= above else voltage[gap + 1]
        return edge
    inside = min(max(reference, inverse.low), inverse.high)
    n = min(int(np.searchsorted(speed, inside, side="right")), speed.size - 1)
    share = (inside - speed[n - 1]) / (speed[n] - speed[n - 1])
    between: float = voltage[n - 1] + share * (voltage[n] - voltage[n - 1])
    return between


@inlined
def advance(axes: Array, angle: int, speed: int, new: Array, h: float, moves: bool) -> None:
    """Angles of the shafts one step later, by the trapezoidal rule, and their new speeds."""
    for i in range(3):
        if moves:
            axes[angle, i] += 0.5 * h * (axes[speed, i] + new[i])
        axes[speed, i] = new[i]


@inlined
def shafts_of(axes: Array, row: int) -> Shafts:
    """A row of `State.axes`."""
    return Shafts(axes[row, 0], axes[row, 1], axes[row, 2])


@inlined
def limited(u: float, inverse: Inverse) -> float:
    """Speed for a stick's fraction of the full speed in its direction. [rad/s]"""
    return u * inverse.high if u > 0.0 else -u * inverse.low


@inlined
def store(
    row: Array,
    volts: Array,
    omega: Array,
    limits: Array,
    axes: Array,
    tip: Vector,
    hung: Hung,
    columns: Columns,
) -> None:
    """Store a sample's signals in a row, by `Columns`."""
    for i in range(3):
        row[SPEED + i] = omega[i]
        row[SHAFT + i] = axes[ANGLE, i]
        if columns.voltage != ABSENT:
            row[columns.voltage + i] = volts[i]
            row[columns.limits + i] = limits[i]
        if columns.torque != ABSENT:
            row[columns.torque + i] = axes[TORQUE, i]
    row[TIP], row[TIP + 1], row[TIP + 2] = tip
    row[LOAD], row[LOAD + 1], row[LOAD + 2] = hung.load
    row[PULL] = hung.pull
    if columns.hook != ABSENT:
        hook = columns.hook
        row[hook], row[hook + 1], row[hook + 2] = hung.hook


@kernel
def open_voltages(stick: Array, inverse: Inverse, actuation: int) -> Array:
    """Voltages of a drive without control of the tip. [V]"""
    voltages = np.empty(stick.size)
    for m in range(stick.size):
        voltages[m] = voltage_for(limited(stick[m], inverse), inverse, actuation)
    return voltages


# --- the loop -------------------------------------------------------------------------------------


@kernel
def advance_crane(
    h: float,
    fixed: Fixed,
    state: State,
    arrays: LoopArrays,
    stick: Array,
    ship: Array,
    out: Array,
) -> tuple[State, int]:
    """Take the stick's samples; the state after the last, and how the pass ended."""
    inverses = fixed.inverses
    settings = fixed.settings
    sensing = settings.sensing
    actuation = fixed.actuation
    loaded = fixed.loaded
    columns = fixed.columns
    g = fixed.geometry
    home = fixed.home
    a, b, c = arrays.drives
    user = arrays.controller
    picks = arrays.picks
    memory = arrays.memory
    margins = arrays.margins
    marched = arrays.marched
    drivable = (
        Drivable(inverses[1].low, inverses[1].high, inverses[1].acceleration),
        Drivable(inverses[2].low, inverses[2].high, inverses[2].acceleration),
    )
    moving = ship.shape[1] > 1
    sample, axes, tip, hung, brake = state
    shafts = shafts_of(axes, ANGLE)
    boom = boom_at(shafts.luff, g, home)
    rope = rope_length(shafts, g, home)
    reference = np.zeros(3)
    volts = np.zeros(3)
    omega = np.zeros(3)
    limits = np.zeros(3)
    inputs = np.zeros(len(SEEN))
    r = rotation(0.0, 0.0, 0.0)
    shift = Vector(0.0, 0.0, 0.0)
    angles = Vector(0.0, 0.0, 0.0)
    first = measurement_at(sample - 1, sensing.rate) + 1 if sample > 0 else 0
    ended = FINE
    for m in range(len(stick)):
        if moving:
            shift = Vector(ship[m, 0], ship[m, 1], ship[m, 2])
            angles = Vector(ship[m, 3], ship[m, 4], ship[m, 5])
            r = rotation(angles.x, angles.y, angles.z)
        for i in range(3):
            reference[i] = limited(stick[m, i], inverses[i])
        if settings.crew.gain > 0.0:
            slew = home.slew + shafts.slew
            swing = add_scaled(hung.hook, -1.0, tip)
            view = view_of(
                (to_ship(r, swing), to_ship(r, Vector(0.0, 0.0, -rope))),
                rope,
                (cos(slew), sin(slew)),
                boom,
                (shafts.slew, shafts.luff),
                g,
            )
            catch_swing(reference, view, drivable, arrays.crew, settings.crew, sample, h)
        if settings.path:
            # 1. what control sees
            swing = add_scaled(hung.hook, -1.0, tip)
            slew = home.slew + shafts.slew
            seen = Seen(swing.x, swing.y, rope, slew, boom, tip.z - shift.z, shift, angles)
            seen_r = r
            if sensing.rate > 0.0:
                seen = measured(seen, sample, first, sensing, arrays.readings, arrays.noise)
                seen_r = rotation(seen.angles.x, seen.angles.y, seen.angles.z)
            # 2. path, offsets, clip, reference speeds
            half = pi * sqrt(rope / GRAVITY) / h
            path = operator_path(reference, axes, memory, sample, half, h, fixed)
            x, y = tip_offset(path, seen, seen_r, memory, sample, half, settings)
            if arrays.controlled:
                inputs[0] = seen.swing_x
                inputs[1] = seen.swing_y
                inputs[2] = seen.rope
                inputs[3] = seen.slew
                inputs[4] = atan2(seen.boom.sin, seen.boom.cos)
                inputs[5], inputs[6] = path
                inputs[7], inputs[8], inputs[9] = seen.shift
                inputs[10], inputs[11], inputs[12] = seen.angles
                for i in range(picks.size):
                    user.inputs[i] = inputs[picks[i]]
                margin = step(user)
                # what is not a number would pass through every limit as one
                if not abs(user.outputs[0]) + abs(user.outputs[1]) < inf:
                    ended = NO_NUMBER
                    break
                margins[3] = min(margins[3], margin)
                x += user.outputs[0]
                y += user.outputs[1]
            if settings.clip > 0.0 or settings.share > 0.0:
                x, y = clipped_offset((x, y), path, boom, rope, fixed)
            follow_path(path[0] + x, path[1] + y, axes, reference, sample, h, fixed)
        # 3. speeds
        if actuation == IDEAL:
            for i in range(3):
                omega[i] = min(max(reference[i], inverses[i].low), inverses[i].high)
        elif actuation == MARCHED:
            volts[0], volts[1], volts[2] = marched[0][m], marched[1][m], marched[2][m]
            omega[0], omega[1], omega[2] = marched[3][m], marched[4][m], marched[5][m]
            limits[0], limits[1], limits[2] = marched[6][m], marched[7][m], marched[8][m]
        else:
            for i in range(3):
                volts[i] = stick[m, i]
                if actuation != DIRECT:
                    volts[i] = voltage_for(reference[i], inverses[i], actuation)
            a.inputs[0] = volts[0]
            b.inputs[0] = volts[1]
            c.inputs[0] = volts[2]
            if loaded:
                a.inputs[1] = axes[TORQUE, 0]
                b.inputs[1] = axes[TORQUE, 1]
                c.inputs[1] = axes[TORQUE, 2]
            margins[0] = min(margins[0], step(a))
            margins[1] = min(margins[1], step(b))
            margins[2] = min(margins[2], step(c))
            omega[0], omega[1], omega[2] = a.outputs[0], b.outputs[0], c.outputs[0]
            limits[0], limits[1], limits[2] = a.outputs[1], b.outputs[1], c.outputs[1]
        if fixed.brake and actuation != IDEAL:
            gap = inverses[0].gap
            edges = inverses[0].voltage
            brake = braked(brake, volts[0], edges[gap], edges[gap + 1], h)
            omega[0] = omega[0] * (1.0 - brake.share)
        # 4. kinematics and rope
        advance(axes, ANGLE, SHAFT_SPEED, omega, h, sample > 0)
        shafts = shafts_of(axes, ANGLE)
        previous_rope = rope
        boom = boom_at(shafts.luff, g, home)
        rope = rope_length(shafts, g, home)
        following = to_inertial(r, tip_of(home.slew + shafts.slew, boom, g), shift)
        if not (fixed.ropes[0] <= rope <= fixed.ropes[1]):
            ended = ROPE_OUT
            break
        if not (fixed.boom[0] <= boom.sin <= fixed.boom[1] and boom.cos > 0.0):
            ended = BOOM_OUT
            break
        hung = led_load(
            hung,
            UpperEnd(tip, previous_rope),
            UpperEnd(following, rope),
            float(sample),
            fixed.start,
            fixed.hanging,
            h,
        )
        if hung.pull < 0.0:
            ended = TOO_FAST
            break
        tip = following
        store(out[m], volts, omega, limits, axes, tip, hung, columns)
        if loaded:
            slew = home.slew + shafts.slew
            torques = rope_torques(hung, tip, r, slew, boom, fixed.mass, g)
            axes[TORQUE, 0], axes[TORQUE, 1], axes[TORQUE, 2] = torques
        sample += 1
    return State(sample, axes, tip, hung, brake), ended
