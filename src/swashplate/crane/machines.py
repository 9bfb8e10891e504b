"""A crane as a `Machine`: its three drives, joined with boom, rope and load on a moving ship."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from math import hypot, isfinite, sin
from numbers import Real
from typing import Any, TypedDict, Unpack

import numpy as np

from swashplate.crane.axes import AXES, RATE, check_names
from swashplate.crane.crane import Crane
from swashplate.crane.motion import Body, Brake, Travel
from swashplate.crane.motion import body as body_model
from swashplate.crane.motion import brake as brake_model
from swashplate.crane.rope import AIR, Start, Suspension
from swashplate.crane.stages.carrying import WIRES, carried_load
from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.machine import Machine, join

RIGID = Suspension()
"""A point on a rigid rope."""
WIDEST, STRONGEST = 1e5, 100.0
"""Largest drag area of a load, and largest wind; gusts of hurricanes have 100 m/s. [m²], [m/s]"""
FARTHEST = 0.9
"""Largest offset of the load at the start, as a part of the rope: at 64 degrees."""
FASTEST_START = 100.0
"""Largest velocity of the load at the start. [m/s]"""
SPEED, COMMAND, LOAD = "shaft_speed", "voltage", "load_torque"
"""Signal of a drive that moves the body, input of the hoist that its brake looks at, and input of a
drive that the rope loads."""
QUICKEST = 0.4
"""Largest part of a rope's pull by which a leaking drive may lower it within a sample: at 0.7 they
would swing against each other from sample to sample."""


class Placing(TypedDict, total=False):
    """Where a crane begins and what hangs on it, each optional.

    Parameters
    ----------
    slew_deg : float, default 0, in studies 90
        From forward to starboard.
    boom_deg : float, default 45
        The boom's elevation.
    rope_m : float, default 20, in studies 27
        Rope below the tip.
    load : float, default the crane's safe load, which is also the largest
        Its mass. [kg]
    suspension : Suspension, default a point on a rigid rope
        Elastic rope, hook with slings.
    swing_damping : float, default the crane's
        Damping ratio of the load's swing by air, sheaves and rope, 0 to 0.2.
    load_offset : (float, float), default (0, 0)
        Load less tip at the start, forward and to port, inertial: the load begins there, on its
        taut rope; shorter than 0.9 of the rope. [m]
    load_velocity : (float, float), default (0, 0)
        Of the load relative to the tip at the start, horizontal, likewise. [m/s]
    drag_area : float, default 0
        C_d A of the load, at most 100 000. [m²]
    wind : (float, float), default (0, 0)
        Forward and to port, within 100 on each axis. [m/s]
    """

    slew_deg: float
    boom_deg: float
    rope_m: float
    load: float | None
    suspension: Suspension
    swing_damping: float | None
    load_offset: tuple[float, float]
    load_velocity: tuple[float, float]
    drag_area: float
    wind: tuple[float, float]


def plant(
    crane: Crane,
    *,
    drives: Mapping[str, Machine] | None = None,
    brake: bool = True,
    loaded: bool | None = None,
    **placing: Unpack[Placing],
) -> Machine:
    """A crane as a machine: three drives, boom, rope and load, on a moving ship.

    Parameters
    ----------
    crane : Crane
        The crane with its drives.
    drives : mapping of str to Machine, optional
        By axis what moves it in place of the crane's own drive: one of five states, or any machine
        with a signal ``shaft_speed`` [rad/s].
    brake : bool
        Whether a brake holds the hoist 0.3 s after its voltage has come into the dead zone. A hoist
        of `drives` has its brake in its own equations.
    loaded : bool, default whether a drive feels a load
        Whether the rope loads the drives, as in a run: its tension is a torque on each shaft, which
        they take a sample later as their ``load_torque``. A machine of `drives` with an input of
        that name counts as feeling it.
    **placing
        Where it begins and what hangs on it: see `Placing`.

    Returns
    -------
    Machine
        Members ``hoist``, ``slew``, ``luff``, ``brake`` and ``body``, and ``carried`` if the rope
        loads the drives. Inputs are those of the drives, ``hoist.voltage`` [V], and the ship's
        motion, ``body.surge`` [m] to ``body.yaw`` [rad]. Signals are those of the drives and of the
        `body`. The rope's torques are given out, ``body.torque_hoist``. Drives that it does not
        load have the input ``hoist.load_torque``, for whoever steps the machine.

    Raises
    ------
    InputError
        For an axis that a crane does not have, a machine without a shaft's speed, a start or a load
        that the crane does not allow, and a load on drives that feel none or that give way to it
        within a sample.

    Examples
    --------
    >>> from swashplate import simulate
    >>> from swashplate.crane import Crane, plant
    >>> machine = plant(Crane.preset("tg3637"), rope_m=27.0)
    >>> still = dict.fromkeys(machine.ports.external, 0.0)
    >>> inputs = {name: still[name] for name in still if name.startswith("body.")}
    >>> volts = {"hoist.voltage": 0.0, "slew.voltage": [4.0] * 512, "luff.voltage": 0.0}
    >>> run = simulate(machine, volts | inputs, 512.0)
    >>> round(float(run["body.rope"][-1]), 1)  # m; the hoist creeps until its brake sets
    27.0
    """
    given = dict(drives or {})
    check_names("A crane has no drive", given, AXES, "it has")
    members: dict[str, Machine] = own_drives(crane) | given
    for axis, machine in members.items():
        ports = getattr(machine, "ports", None)
        if ports is None or SPEED not in ports.every_signal:
            raise InputError(
                f"The {axis} of {crane.name} is {machine!r}, but must be a machine with a signal "
                f"'{SPEED}'."
            )
    numbers = body_numbers(crane, **placing)
    links: dict[str, Any] = {f"body.{axis}_speed": f"{axis}.{SPEED}" for axis in AXES}
    if brake and "hoist" not in given:
        lower, upper = _dead_zone(crane)
        members["brake"] = Machine(brake_model, Brake(lower, upper))
        links |= {
            "brake.voltage": f"hoist.{COMMAND}",
            "brake.speed": f"hoist.{SPEED}",
            "body.hoist_speed": "brake.braked_speed",
        }
    if carries_load(crane, members, numbers, loaded):
        links |= {f"carried.{taken}": signal for taken, signal in WIRES.items()}
        for axis in AXES:
            if LOAD in members[axis].ports.external:
                links[f"{axis}.{LOAD}"] = f"carried.load_torque_{axis}"
        members = {"carried": carried_load(numbers), **members}
    members["body"] = Machine(body_model, numbers)
    outputs = [f"{axis}.{SPEED}" for axis in AXES] + [f"body.{name}" for name in body_model.outputs]
    whole: Machine = join(crane.name, members, links=links, outputs=tuple(outputs))
    return whole


def body(crane: Crane, **placing: Unpack[Placing]) -> Machine:
    """Boom, rope and load of a crane, moved by the speeds of its shafts, on a moving ship.

    Parameters
    ----------
    crane : Crane
        Its geometry, limits and damping are used, not its drives.
    **placing
        Where it begins and what hangs on it: see `Placing`.

    Returns
    -------
    Machine
        Inputs ``hoist_speed``, ``slew_speed``, ``luff_speed`` [rad/s], ``surge``, ``sway``,
        ``heave`` [m], ``roll``, ``pitch``, ``yaw`` [rad]. Signals: tip, load and hook [m], slew,
        boom, swing, off-lead and side-lead [rad], rope [m], tension [N], the rope's torques on the
        shafts [N m]. About a load that hangs straight the swing, a size, has no derivative: linear
        models take off-lead and side-lead.

    Raises
    ------
    InputError
        For a start or a load that the crane does not allow.

    Examples
    --------
    >>> from swashplate import linearize
    >>> from swashplate.crane import Crane, body
    >>> machine = body(Crane.preset("tg3637"), rope_m=25.0, swing_damping=0.0)
    >>> at_rest = dict.fromkeys(machine.ports.external, 0.0)
    >>> model = linearize(machine, at_rest, 512.0, inputs=["luff_speed"], outputs=["off_lead"])
    >>> model.poles.size
    25
    """
    return Machine(body_model, body_numbers(crane, **placing))


def own_drives(crane: Crane) -> dict[str, Any]:
    """A crane's own drives, by axis."""
    return {axis: getattr(crane, axis) for axis in AXES}


def carries_load(
    crane: Crane, drives: Mapping[str, Machine], numbers: Body, asked: bool | None
) -> bool:
    """Whether the rope loads the drives: as it is asked, or if one of them feels it.

    Refuses loads on drives that feel none, or that answer them faster than a sample.
    """
    feels = any(map(feels_load, drives.values()))
    if not (feels if asked is None else asked):
        return False
    if not feels:
        raise InputError(
            f"No drive of {crane.name} feels a load: give one a motor_leakage or a "
            "line_stiffness, as crane.hoist.replace(motor_leakage=1e-6), or leave out 'loaded'."
        )
    for axis, arm in (("hoist", crane.geometry.hoist), ("luff", crane.geometry.luff)):
        drive = drives[axis]
        lost = _speed_lost(drive) if isinstance(drive, Drive) else 0.0
        gives = 0.5 * RATE * numbers.mass * arm * arm * lost
        if not numbers.hanging.stiffness > 0.0 and gives > QUICKEST:
            raise InputError(
                f"The {axis} of {crane.name} gives way to {numbers.mass:g} kg on a rigid rope "
                f"within a sample, since its motor_leakage costs {lost:.3g} rad/s per N m: use an "
                "elastic rope, suspension=Suspension(stiffness=6e7)."
            )
    return True


def feels_load(drive: Machine) -> bool:
    """Whether a drive turns in another way if its shaft is loaded."""
    if isinstance(drive, Drive):
        return "line" in drive.parameters.options or _speed_lost(drive) != 0.0
    return LOAD in drive.ports.external


@lru_cache(maxsize=64)
def _speed_lost(drive: Drive) -> float:
    """Speed that a drive loses instantaneously for each N m of load. [rad/s/(N m)]"""
    torque = 1e5
    unloaded = drive.simulate([0.0], load_torque=0.0)
    loaded = drive.simulate([0.0], load_torque=torque)
    return float(unloaded.shaft_speed[0] - loaded.shaft_speed[0]) / torque


def _dead_zone(crane: Crane) -> tuple[float, float]:
    """Voltages between which the hoist's inverse map commands no more than creep. [V]"""
    inverse = crane.inverse("hoist")
    return float(inverse.minus.voltage[-1]), float(inverse.plus.voltage[0])


def body_numbers(
    crane: Crane,
    *,
    slew_deg: float = 0.0,
    boom_deg: float = 45.0,
    rope_m: float = 20.0,
    load: float | None = None,
    suspension: Suspension = RIGID,
    swing_damping: float | None = None,
    load_offset: tuple[float, float] = (0.0, 0.0),
    load_velocity: tuple[float, float] = (0.0, 0.0),
    drag_area: float = 0.0,
    wind: tuple[float, float] = (0.0, 0.0),
) -> Body:
    """Numbers of boom, rope and load; refuses a start and a load that the crane does not allow."""
    load = crane.safe_load if load is None else load
    swing_damping = crane.swing_damping if swing_damping is None else swing_damping
    numbers = {
        "slew_deg": slew_deg,
        "boom_deg": boom_deg,
        "rope_m": rope_m,
        "load": load,
        "drag_area": drag_area,
        "swing_damping": swing_damping,
    }
    for name, value in numbers.items():
        if not isinstance(value, Real):
            raise InputError(f"{name} is {value!r}, but must be a number.")
    if not 0.0 <= drag_area <= WIDEST:
        raise InputError(
            f"drag_area is {drag_area:g} m², but must be at least 0 and at most {WIDEST:g} m²."
        )
    if not isinstance(suspension, Suspension):
        raise InputError(f"suspension is {suspension!r}, but must be a Suspension.")
    wind = _pair("wind", wind, "two speeds, forward and to port, in m/s")
    if max(map(abs, wind)) > STRONGEST:
        raise InputError(f"wind is {wind!r}, but must be within {STRONGEST:g} m/s on each axis.")
    offset = _pair("load_offset", load_offset, "two lengths, forward and to port, in m")
    distance = hypot(*offset)
    if not distance < FARTHEST * rope_m:
        raise InputError(
            f"load_offset is {distance:.4g} m long, but must be shorter than {FARTHEST:g} of "
            f"the rope of {rope_m:g} m."
        )
    velocity = _pair("load_velocity", load_velocity, "two speeds, forward and to port, in m/s")
    if max(map(abs, velocity)) > FASTEST_START:
        raise InputError(
            f"load_velocity is {velocity!r}, but must be within {FASTEST_START:g} m/s on each axis."
        )
    if load > crane.safe_load:
        raise InputError(
            f"The load is {load:g} kg, but {crane.name} lifts {crane.safe_load:g} kg: use a "
            "smaller load, or a crane with another safe_load."
        )
    # the suspension refuses a load of 0
    drag = AIR * drag_area / (2.0 * load) if load > 0.0 else 0.0
    home = crane.home(slew_deg, boom_deg, rope_m)
    shortest, longest = crane.rope_limits
    lowest, highest = crane.boom_limits
    hanging = suspension.hanging(
        load,
        shortest=shortest,
        rate=RATE,
        drag=drag,
        wind=(*wind, 0.0),
        swing_damping=swing_damping,
    )
    return Body(
        geometry=crane.geometry,
        home=home,
        hanging=hanging,
        release=Start(*offset, *velocity),
        mass=float(load + suspension.hook),
        travel=Travel(shortest, longest, sin(lowest), sin(highest)),
    )


def _pair(name: str, value: Any, what: str) -> tuple[float, float]:
    """Two finite numbers; an `InputError` that says what they are."""
    pair = np.array(value, dtype=object)
    if pair.shape != (2,) or not all(isinstance(part, Real) and isfinite(part) for part in pair):
        raise InputError(f"{name} is {value!r}, but must be {what}.")
    return float(pair[0]), float(pair[1])
