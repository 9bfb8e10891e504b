"""A crane under control as one machine: view, crew, control, drives, boom, rope and load."""

from __future__ import annotations

from functools import lru_cache
from math import atan2, pi, sqrt
from typing import Any, NamedTuple

import numpy as np

from swashplate.analysis import InverseMap
from swashplate.crane.axes import AXES, RATE
from swashplate.crane.control import Controller, Settings
from swashplate.crane.crane import Crane
from swashplate.crane.kinematics import Shafts, add_scaled, boom_at, rope_length, tip_of
from swashplate.crane.machines import LOAD, SPEED
from swashplate.crane.motion import Body, Brake, Ship
from swashplate.crane.motion import body as body_model
from swashplate.crane.motion import brake as brake_model
from swashplate.crane.rope import GRAVITY, hanging_load
from swashplate.crane.stages import carrying, crew, seeing, steering
from swashplate.errors import InputError
from swashplate.machine import Machine, equation, join, late

SHIP = tuple(f"body.{motion}" for motion in Ship._fields)
"""Inputs of the joined machine: motion of the ship."""
STICK = tuple(f"stick.{axis}" for axis in AXES)
"""Inputs: commands of the stick, -1 to 1."""
VOLTAGES = tuple(f"{axis}.voltage" for axis in AXES)
"""Inputs with direct actuation. [V]"""
NOISE = tuple(f"sensors.{name}" for name in seeing.NOISE)
"""Inputs with sensors."""


class ControlLoop(NamedTuple):
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


def closed_loop(crane: Crane, numbers: Body, loop: ControlLoop) -> Machine:
    """A crane under control as a machine.

    Its inputs are `STICK`, or `VOLTAGES` with direct actuation, the ship's motion `SHIP`, which may
    be left out, and the `NOISE` of sensors. Control sees the crane a sample late: its links close
    the loop.
    """
    parts = _Parts(crane, numbers, loop)
    parts.add_view()
    if loop.actuation != "direct":
        parts.add("stick", Machine(steering.stick, steering.Drives(**parts.drivable)))
    if loop.settings.crew is not None:
        parts.add_crew(loop.settings.crew)
    if loop.settings.path:
        parts.add_control()
    parts.add_drives()
    whole: Machine = join(crane.name, parts.members, links=parts.links)
    return whole


class _Parts:
    """Members of a crane under control, and their links, in the order of the flow."""

    def __init__(self, crane: Crane, numbers: Body, loop: ControlLoop) -> None:
        self.crane, self.numbers, self.loop = crane, numbers, loop
        self.members: dict[str, Machine] = {}
        self.links: dict[str, Any] = {}
        self.drivable = {axis: _drivable(crane.inverse(axis)) for axis in AXES}
        self.first = _first(numbers)
        self.references = {axis: f"stick.reference_{axis}" for axis in AXES}
        """Reference speed of each shaft so far."""

    def add(self, name: str, machine: Machine, **wires: Any) -> None:
        """Add a member; `wires` are what its inputs take."""
        self.members[name] = machine
        self.links.update({f"{name}.{taken}": given for taken, given in wires.items()})

    def add_view(self) -> None:
        """Add what is known of the sample before."""
        known = {name: late(f"body.{name}", before) for name, before in seeing.BEFORE.items()}
        ship = {motion: f"body.{motion}" for motion in Ship._fields}
        self.add("view", Machine(seeing.view, self.first), **known, **ship)

    @property
    def _command(self) -> dict[str, str]:
        """Reference speeds of slew and luff so far."""
        return {f"reference_{axis}": self.references[axis] for axis in ("slew", "luff")}

    @property
    def _shafts(self) -> dict[str, Any]:
        """Angles of slew and luff a sample before."""
        return {f"shaft_{axis}": late(f"body.shaft_{axis}") for axis in ("slew", "luff")}

    def add_crew(self, operator: crew.HumanOperator) -> None:
        """Add eye and hand of a crew."""
        g, slew, luff = self.numbers.geometry, self.drivable["slew"], self.drivable["luff"]
        eye = Machine(crew.eye, crew.Eye(operator, slew, luff, g))
        seen = {
            name: f"view.{name}" for name in crew.EyeInputs._fields if name in seeing.Seen._fields
        }
        self.add("eye", eye, **self._command, **seen, **self._shafts)
        hand = Machine(crew.hand, crew.Hand(operator.delay, operator.lag, slew, luff, g))
        wanted = {name: f"eye.{name}" for name in ("wanted_across", "wanted_along")}
        boom = {name: f"view.{name}" for name in ("boom_cos", "boom_sin")}
        self.add("hand", hand, **self._command, **wanted, **boom)
        self.references |= {axis: f"hand.reference_{axis}" for axis in ("slew", "luff")}

    def add_control(self) -> None:
        """Add path, shaper, sensors, offsets and the loop that follows them."""
        settings, numbers, tip = self.loop.settings, self.numbers, self.first.tip
        longest = 2.0 * pi * sqrt(numbers.travel.longest / GRAVITY) + 4.0 / RATE
        path = Machine(steering.path, steering.Path(numbers.geometry, numbers.home))
        self.add("path", path, **self._command)
        impulses = steering.Impulses(*settings.tip, tip.x, tip.y, longest)
        ahead = {name: f"path.{name}" for name in ("ahead_x", "ahead_y")}
        self.add("shaper", Machine(steering.shaper, impulses), **ahead, rope="view.rope")
        source = "view" if settings.sensing is None else self._add_sensors(settings.sensing)
        shaped = {name: f"shaper.{name}" for name in ("path_x", "path_y")}
        swing = add_scaled(self.first.hook, -1.0, tip)
        offsets = steering.Offsets(
            feedback=settings.feedback,
            delay=settings.delay,
            compensates=float(settings.ship),
            begin_x=swing.x,
            begin_y=swing.y,
            longest=longest,
        )
        moved = ("swing_x", "swing_y", "height", *Ship._fields)
        self.add(
            "feedback",
            Machine(steering.feedback, offsets),
            **shaped,
            rope="view.rope",
            **{name: f"{source}.{name}" for name in moved},
        )
        following = steering.Following(
            geometry=numbers.geometry,
            home=numbers.home,
            slew=self.drivable["slew"],
            luff=self.drivable["luff"],
            gain=settings.gain,
            clip=settings.clip,
            share=settings.share,
        )
        posed = ("rope", "boom_cos", "boom_sin")
        self.add(
            "follower",
            Machine(steering.follower, following),
            **shaped,
            **{name: f"feedback.{name}" for name in ("offset_x", "offset_y")},
            **self._add_controller(source),
            **{name: f"view.{name}" for name in posed},
            **self._shafts,
        )
        self.references |= {axis: f"follower.reference_{axis}" for axis in ("slew", "luff")}

    def _add_sensors(self, sensing: seeing.Sensing) -> str:
        """Add sensors; the member from which control takes what it sees."""
        seen = {name: f"view.{name}" for name in seeing.Seen._fields}
        self.add("sensors", Machine(seeing.sensors, sensing), **seen)
        return "sensors"

    def _add_controller(self, source: str) -> dict[str, str]:
        """Add a user-defined controller; what the follower takes of it."""
        controller = self.loop.controller
        if controller is None:
            return {}
        known: dict[str, Any] = {name: f"{source}.{name}" for name in seeing.Seen._fields}
        known |= {"reference_x": "shaper.path_x", "reference_y": "shaper.path_y"}
        known["boom"] = (elevation, f"{source}.boom_sin", f"{source}.boom_cos")
        wires = {name: known[name] for name in controller.model.external}
        self.add("controller", Machine(controller.model, controller.values), **wires)
        return {f"extra_{axis}": f"controller.tip_{axis}" for axis in "xy"}

    def add_drives(self) -> None:
        """Add what turns reference speeds into speeds, and the body that these move."""
        if self.loop.loaded:
            self.add("carried", carrying.carried_load(self.numbers), **carrying.WIRES)
        for axis in AXES:
            if self.loop.actuation == "ideal":
                ideal = Machine(steering.ideal, self.drivable[axis])
                self.add(axis, ideal, reference=self.references[axis])
            else:
                self._add_drive(axis)
        speeds = {f"{axis}_speed": f"{axis}.{SPEED}" for axis in AXES}
        if self.loop.brake and self.loop.actuation != "ideal":
            inverse = _inverse_numbers(self.crane.inverse("hoist"))
            brake = Machine(brake_model, Brake(inverse.edge_down, inverse.edge_up))
            given = self.links.get("hoist.voltage", "hoist.voltage")
            self.add("brake", brake, voltage=given, speed=speeds["hoist_speed"])
            speeds["hoist_speed"] = "brake.braked_speed"
        self.add("body", Machine(body_model, self.numbers), **speeds)

    def _add_drive(self, axis: str) -> None:
        """Add a drive with what commands it."""
        command = f"{axis}_command"
        wires = {"voltage": f"{command}.command"}
        if self.loop.actuation == "direct":
            wires = {}
        elif self.loop.actuation == "volts":
            straight = Machine(steering.straight, self.drivable[axis])
            self.add(command, straight, reference=self.references[axis])
        else:
            inverse = _inverse_machine(self.crane.inverse(axis))
            self.add(command, inverse, reference=self.references[axis])
        if self.loop.loaded:
            wires[LOAD] = f"carried.load_torque_{axis}"
        self.add(axis, getattr(self.crane, axis), **wires)


def _first(numbers: Body) -> seeing.First:
    """Crane and load before the first sample: the ship at rest, the load at its offset."""
    g, home, start = numbers.geometry, numbers.home, numbers.release
    boom = boom_at(0.0, g, home)
    tip = tip_of(home.slew, boom, g)
    rope = float(rope_length(Shafts(0.0, 0.0, 0.0), g, home))
    hung = hanging_load(tip, start.offset_x, start.offset_y, rope, numbers.hanging)
    return seeing.First(tip, hung.hook, rope, boom, home.slew)


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
