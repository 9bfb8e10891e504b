"""A crane under control as one machine: what is seen, crew, control, drives, boom, rope and load."""

from __future__ import annotations

from functools import lru_cache
from math import atan2, pi, sqrt
from typing import Any, NamedTuple

import numpy as np

from swashplate.analysis.compensation import InverseMap
from swashplate.crane import crew
from swashplate.crane.axes import AXES, RATE
from swashplate.crane.closed_loop import seeing, steering
from swashplate.crane.control import GIVES, SEEN, Controller, Settings
from swashplate.crane.crane import Crane
from swashplate.crane.kinematics import Shafts, Vector, boom_at, rope_length, shaft_torques, tip_of
from swashplate.crane.machines import SPEED, Brake
from swashplate.crane.motion import Body, Ship
from swashplate.crane.motion import body as body_model
from swashplate.crane.motion import brake as brake_model
from swashplate.crane.rope import GRAVITY, hanging_load
from swashplate.errors import InputError
from swashplate.machine import Machine, equation, join, late

SHIP = tuple(f"body.{motion}" for motion in Ship._fields)
"""Inputs of the joined machine: motion of the ship."""
STICK = tuple(f"stick.{axis}" for axis in AXES)
"""Inputs: commands of the stick, -1 to 1."""
VOLTAGES = tuple(f"{axis}.voltage" for axis in AXES)
"""Inputs with direct actuation. [V]"""
NOISE = tuple(f"sensors.{name}" for name in seeing.Noise._fields)
"""Inputs with sensors."""


class Loop(NamedTuple):
    """What closes the loop around a crane."""

    settings: Settings
    controller: Controller | None
    actuation: str
    """As of `RunOptions`."""
    loaded: bool
    """Whether the rope's tension loads the drives."""
    brake: bool


@equation
def elevation(boom_sin: float, boom_cos: float) -> float:
    """Elevation of the boom. [rad]"""
    return atan2(boom_sin, boom_cos)


def closed_loop(crane: Crane, numbers: Body, loop: Loop) -> Machine:
    """A crane under control as a machine.

    Its inputs are `STICK`, or `VOLTAGES` with direct actuation, the ship's motion `SHIP`, which may
    be left out, and the `NOISE` of sensors. Control sees the crane a sample late: its links close
    the loop.
    """
    settings = loop.settings
    members: dict[str, Machine] = {}
    links: dict[str, Any] = {}

    def add(name: str, model: Any, numbers: Any, **wires: Any) -> None:
        members[name] = numbers if isinstance(numbers, Machine) else Machine(model, numbers)
        links.update({f"{name}.{taken}": given for taken, given in wires.items()})

    first = _first(numbers, loaded=loop.loaded)
    drivable = {axis: _drivable(crane.inverse(axis)) for axis in AXES}
    slew, luff = drivable["slew"], drivable["luff"]
    add(
        "view",
        seeing.view,
        first,
        **{name: late(f"body.{name}", before) for name, before in seeing.BEFORE.items()},
        **{motion: f"body.{motion}" for motion in Ship._fields},
    )
    references = {axis: f"stick.reference_{axis}" for axis in AXES}
    if loop.actuation != "direct":
        add("stick", steering.stick, steering.Drives(**drivable))
    if settings.crew is not None:
        seen = ("swing_x", "swing_y", "swing_z", "rope", "slew", "boom_cos", "boom_sin")
        seen += ("shaft_slew", "shaft_luff", "roll", "pitch", "yaw")
        command = {f"reference_{axis}": references[axis] for axis in ("slew", "luff")}
        operator = settings.crew
        add(
            "eye",
            crew.eye,
            crew.Eye(operator, slew, luff, numbers.geometry),
            **command,
            **{name: f"view.{name}" for name in seen},
        )
        add(
            "hand",
            crew.hand,
            crew.Hand(operator.delay, operator.lag, slew, luff, numbers.geometry),
            **command,
            wanted_across="eye.wanted_across",
            wanted_along="eye.wanted_along",
            boom_cos="view.boom_cos",
            boom_sin="view.boom_sin",
        )
        references |= {axis: f"hand.reference_{axis}" for axis in ("slew", "luff")}
    if settings.path:
        _add_control(add, members, links, references, numbers, loop, first, slew, luff)
        references |= {axis: f"follower.reference_{axis}" for axis in ("slew", "luff")}
    for axis in AXES:
        reference = {"reference": references[axis]}
        match loop.actuation:
            case "ideal":
                add(axis, steering.ideal, drivable[axis], **reference)
                continue
            case "volts":
                add(f"{axis}_command", steering.straight, drivable[axis], **reference)
            case "inverse":
                inverse = _inverse_machine(crane.inverse(axis))
                add(f"{axis}_command", inverse.model, inverse, **reference)
        if loop.actuation != "direct":
            links[f"{axis}.voltage"] = f"{axis}_command.command"
        members[axis] = getattr(crane, axis)
        if loop.loaded:
            links[f"{axis}.load_torque"] = f"view.torque_{axis}"
    speeds = {axis: f"{axis}.{SPEED}" for axis in AXES}
    if loop.brake and loop.actuation != "ideal":
        inverse = _inverse_numbers(crane.inverse("hoist"))
        given = "hoist.voltage" if loop.actuation == "direct" else "hoist_command.command"
        edges = Brake(inverse.edge_down, inverse.edge_up)
        add("brake", brake_model, edges, voltage=given, speed=speeds["hoist"])
        speeds["hoist"] = "brake.braked_speed"
    add("body", body_model, numbers, **{f"{axis}_speed": speeds[axis] for axis in AXES})
    whole: Machine = join(crane.name, members, links=links)
    return whole


def _add_control(
    add: Any,
    members: dict[str, Machine],
    links: dict[str, Any],
    references: dict[str, str],
    numbers: Body,
    loop: Loop,
    first: seeing.First,
    slew: steering.Drivable,
    luff: steering.Drivable,
) -> None:
    """Add path, sensors, offsets and the loop that follows them."""
    settings = loop.settings
    command = {f"reference_{axis}": references[axis] for axis in ("slew", "luff")}
    longest = 2.0 * pi * sqrt(numbers.travel.longest / GRAVITY) + 4.0 / RATE
    add("path", steering.path, steering.Path(numbers.geometry, numbers.home), **command)
    add(
        "shaper",
        steering.shaper,
        steering.Impulses(*settings.tip, first.tip.x, first.tip.y, longest),
        ahead_x="path.ahead_x",
        ahead_y="path.ahead_y",
        rope="view.rope",
    )
    source = "view"
    if settings.sensing is not None:
        seen = {name: f"view.{name}" for name in seeing.Seen._fields}
        add("sensors", seeing.sensors, settings.sensing, **seen)
        read = {name: f"sensors.{name}" for name in seeing.Seen._fields}
        add("measured", seeing.measured, settings.sensing, **read)
        source = "measured"
    moved = ("swing_x", "swing_y", "height", *Ship._fields)
    tip = {"path_x": "shaper.path_x", "path_y": "shaper.path_y"}
    add(
        "feedback",
        steering.feedback,
        steering.Offsets(
            feedback=settings.feedback,
            delay=settings.delay,
            compensates=float(settings.ship),
            begin_x=first.hook.x - first.tip.x,
            begin_y=first.hook.y - first.tip.y,
            longest=longest,
        ),
        **tip,
        rope="view.rope",
        **{name: f"{source}.{name}" for name in moved},
    )
    extra = dict[str, str]()
    if loop.controller is not None:
        controller = loop.controller
        known = {name: f"{source}.{name}" for name in seeing.Seen._fields}
        known |= {"reference_x": "shaper.path_x", "reference_y": "shaper.path_y"}
        known |= {"boom": (elevation, f"{source}.boom_sin", f"{source}.boom_cos")}
        members["controller"] = Machine(controller.model, controller.values)
        links.update({f"controller.{name}": known[name] for name in controller.model.external})
        extra = dict(zip(("extra_x", "extra_y"), (f"controller.{name}" for name in GIVES)))
    seen = ("rope", "boom_cos", "boom_sin", "shaft_slew", "shaft_luff")
    add(
        "follower",
        steering.follower,
        steering.Following(
            geometry=numbers.geometry,
            home=numbers.home,
            slew=slew,
            luff=luff,
            gain=settings.gain,
            clip=settings.clip,
            share=settings.share,
        ),
        **tip,
        offset_x="feedback.offset_x",
        offset_y="feedback.offset_y",
        **extra,
        **{name: f"view.{name}" for name in seen},
    )


def _first(numbers: Body, *, loaded: bool) -> seeing.First:
    """Crane and load before the first sample: the ship at rest, the load at its offset."""
    g, home, start = numbers.geometry, numbers.home, numbers.start
    boom = boom_at(0.0, g, home)
    tip = tip_of(home.slew, boom, g)
    rope = float(rope_length(Shafts(0.0, 0.0, 0.0), g, home))
    hung = hanging_load(tip, start.offset_x, start.offset_y, rope, numbers.hanging)
    torque = Shafts(0.0, 0.0, 0.0)
    if loaded:
        weight = numbers.mass * GRAVITY
        torque = shaft_torques(Vector(0.0, 0.0, -weight), home.slew, boom, weight, g)
    return seeing.First(tip, hung.hook, rope, boom, torque, home.slew)


@lru_cache(maxsize=64)
def _drivable(inverse: InverseMap) -> steering.Drivable:
    """Limits of a drive's shaft."""
    low, high = inverse.limits
    return steering.Drivable(low, high, float(min(inverse.acceleration)))


@lru_cache(maxsize=64)
def _inverse_machine(inverse: InverseMap) -> Machine:
    """What turns reference speeds into voltages."""
    return Machine(steering.inverse, _inverse_numbers(inverse))


@lru_cache(maxsize=64)
def _inverse_numbers(inverse: InverseMap) -> steering.Inverse:
    """An inverse map as a model takes it."""
    speed, voltage = np.hstack([inverse.minus, inverse.plus])
    if speed.size != steering.POINTS:
        raise InputError(
            f"The inverse map of {inverse.name} has {speed.size} points, but a crane's run takes "
            f"{steering.POINTS}."
        )
    gap = inverse.minus.speed.size - 1
    low, high = inverse.limits
    return steering.Inverse(
        speed=steering.Table(*speed.tolist()),
        voltage=steering.Table(*voltage.tolist()),
        slowest_down=float(speed[gap]),
        slowest_up=float(speed[gap + 1]),
        edge_down=float(voltage[gap]),
        edge_up=float(voltage[gap + 1]),
        creep=float(inverse.creep),
        low=low,
        high=high,
    )
