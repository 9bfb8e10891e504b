"""The closed loop: stick, control, actuation, three drives, kinematics and rope in one pass.

One sample after the other, at the drives' own rate:

1. what control sees is the last sample, as a controller's computer has it;
2. the stick's commands become wanted speeds of the shafts, through the path of the tip if control
   asks for it, and these become speeds (ideal drives) or voltages;
3. each drive takes its voltage by the engine's compiled step;
4. shafts move the tip, the ship moves the crane, the tip leads the load.

A stepper is the same kernel over one sample. In open loop nothing of a sample acts on the drives:
they are marched before.
"""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, inf, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.crane.control import Settings
from swashplate.crane.kinematics import (
    Boom,
    Geometry,
    Home,
    Shafts,
    Vector,
    boom_at,
    moved,
    reach_rate,
    rope_length,
    rotation,
    shaft_torques,
    shafts_for,
    size,
    tip_of,
    to_inertial,
    to_ship,
)
from swashplate.crane.rope import GRAVITY, Hanging, Hung, hanging_load, rope_step
from swashplate.equations import Machine, equation, inlined, kernel
from swashplate.equations.code import generating
from swashplate.parameters.rules import FULL_VOLTAGE

Array = NDArray[np.float64]

IDEAL, VOLTS, INVERSE, DIRECT, MARCHED = range(5)
"""Actuation: speeds at once; 10 V for full speed; the inverse map's voltage; voltages as given;
drives that were marched before, whose voltages, speeds and limits stand in the rows already."""
ROWS = (
    *("voltage_hoist", "voltage_slew", "voltage_luff"),
    *("speed_hoist", "speed_slew", "speed_luff"),
    *("limits_hoist", "limits_slew", "limits_luff"),
    *("shaft_hoist", "shaft_slew", "shaft_luff"),
    *("tip_x", "tip_y", "tip_z", "load_x", "load_y", "load_z", "hook_x", "hook_y", "hook_z"),
    *("pull", "rope", "boom_cos", "boom_sin"),
    *("torque_hoist", "torque_slew", "torque_luff"),
)
"""What the loop leaves of each sample, SI; the torques are those that the drives have taken."""
FINE, TOO_FAST, BOOM_OUT, ROPE_OUT, NO_NUMBER = range(5)
"""How a pass ended."""
ANGLE, SPEED, OPERATOR, WISH, AIM, TORQUE = range(6)
"""Shafts' angles and speeds; angles to which the stick alone would have brought them, and its
wanted speeds; angles that control wants; torques of the rope. [rad], [rad/s], [N m]"""
BRAKE_WAITS, BRAKE_TAKES = 0.3, 0.2
"""Time at rest before the hoist's brake falls in, and time in which it stops the drum. [s]"""


class Inverse(NamedTuple):
    """An `InverseMap` as the loop takes it."""

    speed: Array
    voltage: Array
    """Points of both branches, rising. [rad/s], [V]"""
    gap: int
    """Last point of the lower branch; to the next it is the dead zone, with only the creep."""
    creep: float
    low: float
    high: float
    acceleration: float
    """The smaller one of both ways. [rad/s²]"""


class Fixed(NamedTuple):
    """What stays as it is during a run."""

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
    loaded: bool
    """Whether the rope's tension loads the drives."""
    inverses: tuple[Inverse, Inverse, Inverse]


class Plant(NamedTuple):
    """What the loop drives, and what is remembered of it in arrays."""

    drives: tuple[Machine, Machine, Machine]
    law: Machine
    picks: NDArray[np.int64]
    """Which of `SEEN` the law takes."""
    memory: Array
    """Delayed signals, a row each: three commands, wanted tip x and y, swing x and y."""
    margins: Array
    """Worst margins of the domains of the drives and the law."""


class State(NamedTuple):
    """What one sample passes to the next, delayed signals and the drives' states apart."""

    sample: int
    axes: Array
    """(6, 3) of hoist, slew and luff: `ANGLE`, `SPEED`, `OPERATOR`, `WISH`, `AIM`, `TORQUE`."""
    tip: Vector
    hung: Hung
    still: float
    """Time for which the hoist's command has been within the dead zone. [s]"""
    brake: float
    """How far the brake has fallen in, 0 to 1."""


# --- pieces of a sample ---------------------------------------------------------------------------


@inlined
def delayed(memory: Array, row: int, sample: int, delay: float) -> float:
    """A remembered signal so many samples ago, straight between samples."""
    whole = int(delay)
    part = delay - whole
    last = memory.shape[1] - 1  # lengths are powers of two
    newer: float = memory[row, (sample - whole) & last]
    older: float = memory[row, (sample - whole - 1) & last]
    return newer + part * (older - newer)


@inlined
def shaped(
    memory: Array, row: int, sample: int, half: float, impulses: tuple[float, float, float]
) -> float:
    """A remembered signal through a shaper whose impulses are `half` samples apart."""
    made = 0.0
    for k in range(3):
        if impulses[k] > 0.0:
            made += impulses[k] * delayed(memory, row, sample, k * half)
    return made


@inlined
def voltage_for(wanted: float, inverse: Inverse, actuation: int) -> float:
    """Command of a drive for a wanted speed of its shaft, by `InverseMap.voltage`, clipped. [V]"""
    if actuation == VOLTS:
        full = inverse.high if wanted > 0.0 else -inverse.low
        return min(max(FULL_VOLTAGE * wanted / full, -FULL_VOLTAGE), FULL_VOLTAGE)
    speed, voltage, gap = inverse.speed, inverse.voltage, inverse.gap
    below, above = wanted - speed[gap], speed[gap + 1] - wanted
    if below >= 0.0 and above >= 0.0:
        at_rest = abs(wanted - inverse.creep)
        if at_rest <= below and at_rest <= above:
            return 0.0
        edge: float = voltage[gap] if below <= above else voltage[gap + 1]
        return edge
    inside = min(max(wanted, inverse.low), inverse.high)
    n = min(int(np.searchsorted(speed, inside, side="right")), speed.size - 1)
    share = (inside - speed[n - 1]) / (speed[n] - speed[n - 1])
    made: float = voltage[n - 1] + share * (voltage[n] - voltage[n - 1])
    return made


@equation
def largest_sine(speed: float, acceleration: float, omega: float) -> float:
    """Largest sine at ω [rad/s] that a speed and an acceleration allow, min(v/ω, a/ω²). [m]"""
    return min(speed / omega, acceleration / (omega * omega))


@inlined
def clipped_offset(
    offset: tuple[float, float], path: tuple[float, float], boom: Boom, rope: float, fixed: Fixed
) -> tuple[float, float]:
    """Offset of the tip held, along the boom and across it, within what the drives can follow."""
    omega = sqrt(GRAVITY / rope)
    g, settings = fixed.geometry, fixed.settings
    e_x, e_y = path[0] - g.axis.x, path[1] - g.axis.y
    reach = sqrt(e_x * e_x + e_y * e_y)
    e_x, e_y = e_x / reach, e_y / reach
    rate, (_, slew, luff), (x, y) = reach_rate(boom, g), fixed.inverses, offset
    speed, turning = rate * min(luff.high, -luff.low), reach * min(slew.high, -slew.low)
    along = settings.share * largest_sine(speed, rate * luff.acceleration, omega)
    along = settings.clip if settings.clip > 0.0 else along
    across = settings.share * largest_sine(turning, reach * slew.acceleration, omega)
    out = min(max(x * e_x + y * e_y, -along), along)
    turn = min(max(y * e_x - x * e_y, -across), across)
    return out * e_x - turn * e_y, out * e_y + turn * e_x


@inlined
def advance(axes: Array, angle: int, speed: int, new: Array, h: float, moves: bool) -> None:
    """Angles of the shafts one step later, by the trapezoidal rule, and the speeds behind it."""
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
    """Wanted speed for a stick's fraction of the full speed that way. [rad/s]"""
    return u * inverse.high if u > 0.0 else -u * inverse.low


@kernel
def open_voltages(stick: Array, inverse: Inverse, actuation: int) -> Array:
    """Voltages of a drive under the stick alone. [V]"""
    made = np.empty(stick.size)
    for m in range(stick.size):
        made[m] = voltage_for(limited(stick[m], inverse), inverse, actuation)
    return made


# --- the loop -------------------------------------------------------------------------------------


def _no_law(*_: Any) -> float:
    return inf


@generating
def loop_of(hoist: Any, slew: Any, luff: Any, law: Any) -> Callable[..., tuple[State, int]]:
    """The compiled loop over given steps of three drives and of a law, None for no law."""
    own = law is not None
    advance_law = law if own else inlined(_no_law)

    @kernel
    def loop(
        h: float, fixed: Fixed, state: State, plant: Plant, stick: Array, ship: Array, out: Array
    ) -> tuple[State, int]:
        """Take the stick's samples; the state behind the last, and how the pass ended."""
        inverses, settings, actuation = fixed.inverses, fixed.settings, fixed.actuation
        laws, picks, memory, margins = plant.law, plant.picks, plant.memory, plant.margins
        a, b, c = plant.drives
        edge = inverses[0].gap
        slowest = inverses[0].voltage[edge], inverses[0].voltage[edge + 1]
        g, home, loaded = fixed.geometry, fixed.home, fixed.loaded
        moving = ship.shape[1] > 1
        last = memory.shape[1] - 1
        sample, axes, tip, hung, still, brake = state
        shafts = shafts_of(axes, ANGLE)
        boom, rope = boom_at(shafts.luff, g, home), rope_length(shafts, g, home)
        wanted, seen = np.zeros(3), np.zeros(13)
        r, shift = rotation(0.0, 0.0, 0.0), Vector(0.0, 0.0, 0.0)
        ended = FINE
        for m in range(len(stick)):
            row = out[m]
            volts, omega, limits = row[0:3], row[3:6], row[6:9]
            half = pi * sqrt(rope / GRAVITY) / h
            if moving:
                shift = Vector(ship[m, 0], ship[m, 1], ship[m, 2])
                r = rotation(ship[m, 3], ship[m, 4], ship[m, 5])
            # the stick's commands
            for i in range(3):
                memory[i, sample & last] = stick[m, i]
                u = stick[m, i]
                if settings.joint[1] > 0.0:
                    u = shaped(memory, i, sample, half, settings.joint)
                wanted[i] = limited(u, inverses[i])
            if settings.path:
                advance(axes, OPERATOR, WISH, wanted, h, sample > 0)
                lead = boom_at(axes[OPERATOR, 2], g, home)
                ahead = tip_of(home.slew + axes[OPERATOR, 1], lead, g)
                memory[3, sample & last] = ahead.x
                memory[4, sample & last] = ahead.y
                path_x = shaped(memory, 3, sample, half, settings.tip)
                path_y = shaped(memory, 4, sample, half, settings.tip)
                # offsets: the direction of the rope, the ship, a law of one's own
                swing_x, swing_y = hung.hook.x - tip.x, hung.hook.y - tip.y
                memory[5, sample & last] = swing_x
                memory[6, sample & last] = swing_y
                x, y = 0.0, 0.0
                if settings.feedback > 0.0:
                    back = 2.0 * half * settings.delay
                    x = settings.feedback * delayed(memory, 5, sample, back)
                    y = settings.feedback * delayed(memory, 6, sample, back)
                    turned = to_ship(r, Vector(x, y, 0.0))
                    x, y = turned.x, turned.y
                if settings.ship:
                    # over its place on the sea, at the tip's own height
                    over = Vector(path_x - shift.x, path_y - shift.y, tip.z - shift.z)
                    place = to_ship(r, over)
                    x += place.x - path_x
                    y += place.y - path_y
                if own:
                    seen[0], seen[1], seen[2] = swing_x, swing_y, rope
                    seen[3], seen[4] = home.slew + shafts.slew, atan2(boom.sin, boom.cos)
                    seen[5], seen[6] = path_x, path_y
                    if moving:
                        seen[7:13] = ship[m]
                    for i in range(picks.size):
                        laws.inputs[i] = seen[picks[i]]
                    margin = advance_law(laws)
                    # what is no number would pass through every limit as one
                    if not abs(laws.outputs[0]) + abs(laws.outputs[1]) < inf:
                        ended = NO_NUMBER
                        break
                    margins[3] = min(margins[3], margin)
                    x += laws.outputs[0]
                    y += laws.outputs[1]
                if settings.clip > 0.0 or settings.share > 0.0:
                    x, y = clipped_offset((x, y), (path_x, path_y), boom, rope, fixed)
                target = shafts_for(path_x + x, path_y + y, shafts_of(axes, AIM), g, home)
                for i, aim in ((1, target.slew), (2, target.luff)):
                    behind = settings.gain * (aim - axes[ANGLE, i])
                    wanted[i] = (aim - axes[AIM, i]) / h * (sample > 0) + behind
                    axes[AIM, i] = aim
            # actuation
            if actuation == IDEAL:
                for i in range(3):
                    omega[i] = min(max(wanted[i], inverses[i].low), inverses[i].high)
                    volts[i], limits[i] = 0.0, 0.0
            elif actuation != MARCHED:
                for i in range(3):
                    volts[i] = stick[m, i]
                    if actuation != DIRECT:
                        volts[i] = voltage_for(wanted[i], inverses[i], actuation)
                a.inputs[0], b.inputs[0], c.inputs[0] = volts[0], volts[1], volts[2]
                if loaded:
                    a.inputs[1], b.inputs[1] = axes[TORQUE, 0], axes[TORQUE, 1]
                    c.inputs[1] = axes[TORQUE, 2]
                margins[0] = min(margins[0], hoist(a))
                margins[1] = min(margins[1], slew(b))
                margins[2] = min(margins[2], luff(c))
                omega[0], omega[1], omega[2] = a.outputs[0], b.outputs[0], c.outputs[0]
                limits[0], limits[1], limits[2] = a.outputs[1], b.outputs[1], c.outputs[1]
            if fixed.brake and actuation != IDEAL:
                within_zone = slowest[0] < volts[0] < slowest[1]
                still = still + h if within_zone else 0.0
                falls = h / BRAKE_TAKES if still >= BRAKE_WAITS else -h / BRAKE_TAKES
                brake = min(max(brake + falls, 0.0), 1.0)
                omega[0] = omega[0] * (1.0 - brake)
            # kinematics and rope
            advance(axes, ANGLE, SPEED, omega, h, sample > 0)
            shafts, shorter = shafts_of(axes, ANGLE), rope
            boom, rope = boom_at(shafts.luff, g, home), rope_length(shafts, g, home)
            shorter -= rope
            in_ship = tip_of(home.slew + shafts.slew, boom, g)
            following = to_inertial(r, in_ship, shift)
            if not (fixed.ropes[0] <= rope <= fixed.ropes[1]):
                ended = ROPE_OUT
                break
            if not (fixed.boom[0] <= boom.sin <= fixed.boom[1] and boom.cos > 0.0):
                ended = BOOM_OUT
                break
            square = h * h
            if sample == 0:
                hung = hanging_load(following, Vector(0.0, 0.0, 0.0), rope, fixed.hanging, h)
            elif sample == 1:  # it has moved with the tip
                square = 0.5 * square
                led = moved(following, -1.0, tip)
                led = Vector(led.x, led.y, led.z + shorter)
                hung = Hung(
                    hung.load, moved(hung.load, -1.0, led), hung.hook, moved(hung.hook, -1.0, led),
                    hung.pull, hung.stretch,
                )  # fmt: skip
            if sample > 0:
                hung = rope_step(hung, tip, following, rope, fixed.hanging, h, square)
            if hung.pull < 0.0:
                ended = TOO_FAST
                break
            tip = following
            for i in range(3):
                row[9 + i], row[25 + i] = axes[ANGLE, i], axes[TORQUE, i]
            row[12], row[13], row[14] = tip
            row[15], row[16], row[17] = hung.load
            row[18], row[19], row[20] = hung.hook
            row[21], row[22], row[23], row[24] = hung.pull, rope, boom.cos, boom.sin
            if loaded:
                tension = fixed.mass * hung.pull
                along = moved(hung.hook, -1.0, tip)
                pulled = moved(Vector(0.0, 0.0, 0.0), tension / size(along), along)
                force = to_ship(r, pulled)
                felt = shaft_torques(force, home.slew + shafts.slew, boom, tension, g)
                axes[TORQUE, 0], axes[TORQUE, 1], axes[TORQUE, 2] = felt
            sample += 1
        return State(sample, axes, tip, hung, still, brake), ended

    return loop
