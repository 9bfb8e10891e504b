"""Steppers: a crane with its setup, one sample after the other or a whole run at once."""

from __future__ import annotations

from functools import lru_cache
from math import degrees, inf, isfinite, pi, sin, sqrt
from typing import TYPE_CHECKING, Any, Literal, TypedDict, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis.capability import dead_zone
from swashplate.analysis.compensation import InverseMap
from swashplate.crane.control import GIVES, SEEN, Control, settings_of
from swashplate.crane.kinematics import Shafts, Vector, boom_at, rope_length, shaft_torques, tip_of
from swashplate.crane.loop import (
    DIRECT,
    FINE,
    INVERSE,
    MARCHED,
    ROPE_OUT,
    ROWS,
    TOO_FAST,
    VOLTS,
    Fixed,
    Inverse,
    Plant,
    State,
    loop_of,
    open_voltages,
)
from swashplate.crane.rope import AIR, GRAVITY, Hung, Suspension, too_fast
from swashplate.crane.stick import AXES
from swashplate.drive import Drive
from swashplate.equations import compiled_step
from swashplate.equations.marching.run import marched
from swashplate.equations.marching.stepping import stored_of
from swashplate.errors import DomainError, InputError
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.simulation.instance import instance_of

if TYPE_CHECKING:
    from swashplate.crane.crane import Crane

Array = NDArray[np.float64]
Actuation = Literal["ideal", "volts", "inverse"]
"""In the order of `loop.IDEAL` and the others."""
ACTUATIONS = (*get_args(Actuation), "direct")
RATE = 512.0
"""Samples a second of the loop: the packaged drives' own. [Hz]"""
OUTPUTS = ("shaft_speed", "limits")
"""What the loop takes of each drive."""
QUICKEST = 0.4
"""Largest part of a rope's pull by which a leaking drive may lower it within a sample: at 0.7 they
would swing against each other from sample to sample."""


class Start(TypedDict, total=False):
    """Where a run begins and what hangs on the crane: keywords of runs and studies.

    Attributes
    ----------
    slew_deg, boom_deg, rope_m : float
        Slew from forward to starboard, boom's elevation, rope below the tip; by default 0, 45
        and 20.
    load : float, optional
        Its mass, by default the safe load. [kg]
    suspension : Suspension, optional
        Elastic rope, hook with slings; by default a point on a rigid rope.
    loaded : bool
        Whether the rope loads the drives: its tension is a torque on each shaft, by virtual work,
        which they take a sample later as their ``load_torque``. Off by default, as their tests were
        without load; drives feel it by their ``motor_leakage`` and ``line_stiffness``. What the
        boom weighs is not in it.
    drag_area : float
        C_d A of the load. [m²]
    wind : (float, float)
        Forward and to port. [m/s]
    brake : bool
        Whether a brake holds the hoist 0.3 s after its command has returned to the dead zone; on by
        default.
    """

    slew_deg: float
    boom_deg: float
    rope_m: float
    load: float | None
    suspension: Suspension
    loaded: bool
    drag_area: float
    wind: tuple[float, float]
    brake: bool


class Setup(Start, total=False):
    """How a run is set up: keywords of `Crane.simulate` and `Crane.stepper`, with those of `Start`.

    Attributes
    ----------
    control : Control, optional
        Controller, of `swashplate.crane.control`; by default the stick's commands as they are.
    actuation : {"inverse", "volts", "ideal", "direct"}
        What makes speeds of wanted speeds: the real drives behind their inverse maps or behind
        10 V for full speed, or drives that follow at once within their limits of speed. A stepper
        also takes voltages, with "direct".
    """

    control: Control | None
    actuation: Actuation | Literal["direct"]


DEFAULTS: Setup = {
    "control": None,
    "actuation": "inverse",
    "slew_deg": 0.0,
    "boom_deg": 45.0,
    "rope_m": 20.0,
    "load": None,
    "suspension": Suspension(),
    "loaded": False,
    "drag_area": 0.0,
    "wind": (0.0, 0.0),
    "brake": True,
}


class CraneStepper:
    """A crane that takes commands and gives signals, the same numbers as `Crane.simulate`.

    Made by `Crane.stepper`.
    """

    def __init__(self, crane: Crane, setup: Setup) -> None:
        strange = [each for each in setup if each not in DEFAULTS]
        if strange:
            raise InputError(f"A run has no {strange[0]}; its setup has {', '.join(DEFAULTS)}.")
        how = DEFAULTS | setup
        self._crane, self.actuation = crane, how["actuation"]
        settings, law = settings_of(how["control"])
        self.fixed = fixed = _fixed(crane, how, settings)
        given = ("voltage", "load_torque") if fixed.loaded else ("voltage",)
        drives = [getattr(crane, axis) for axis in AXES]
        self._steps = [each.compiled_step(OUTPUTS, inputs=given, rate=RATE) for each in drives]
        hoist, slew, luff = (each.machine() for each in self._steps)
        own, picks = hoist, np.zeros(0, dtype=np.int64)
        if law is not None:
            seen = law.model.external
            self._steps.append(compiled_step(law.model, law.values, seen, GIVES, RATE))
            own = self._steps[3].machine()
            picks = np.array([SEEN.index(each) for each in seen], dtype=np.int64)
        # in open loop nothing acts back on the drives
        self._open = how["control"] is None and not fixed.loaded
        self._open &= fixed.actuation in (VOLTS, INVERSE)
        one, two, three, *last = (each.step for each in self._steps)
        self._loop = loop_of(one, two, three, last[0] if last else None)
        g, home = fixed.geometry, fixed.home
        zero, boom = Shafts(0.0, 0.0, 0.0), boom_at(0.0, g, home)
        tip, torques = tip_of(home.slew, boom, g), zero
        if fixed.loaded:
            weight = fixed.mass * GRAVITY
            torques = shaft_torques(Vector(0.0, 0.0, -weight), home.slew, boom, weight, g)
        hung = Hung(tip, tip, tip, tip, 0.0, 0.0)
        self._state = State(0, zero, zero, zero, zero, zero, tip, hung, torques, 0.0, 0.0)
        longest = 2.0 * pi * sqrt(fixed.ropes[1] / GRAVITY) * RATE + 4.0
        memory = np.zeros((7, 1 << int(longest).bit_length()))
        memory[3:5] = [[tip.x], [tip.y]]
        self._plant = Plant((hoist, slew, luff), own, picks, memory, np.full(4, np.inf))

    def step(
        self, command: tuple[float, float, float], ship: ArrayLike | None = None
    ) -> dict[str, float]:
        """Advance by one sample; the first call gives the sample at time zero.

        Parameters
        ----------
        command : (float, float, float)
            Of hoist, slew and luff, -1 to 1, or voltages with direct actuation. [V]
        ship : (6,) array_like, optional
            Surge, sway, heave [m], roll, pitch, yaw [rad].

        Returns
        -------
        dict
            Signals by name, SI: voltages, speeds and angles of the shafts, tip, load, pull, rope.

        Raises
        ------
        InputError, DomainError
            As `Crane.simulate`, and for a command out of range.
        """
        most = FULL_VOLTAGE if self.fixed.actuation == DIRECT else 1.0
        commands = np.array([command], dtype=np.float64)
        if commands.shape != (1, 3) or not (np.abs(commands) <= most).all():
            raise InputError(f"A crane takes three commands of at most ±{most:g}.")
        motion = np.zeros((1, 1)) if ship is None else np.array([ship], dtype=np.float64)
        if motion.shape not in ((1, 1), (1, 6)) or not np.isfinite(motion).all():
            raise InputError("The ship's motion is six finite numbers.")
        return self.named(self.take(commands, motion)[0])

    def named(self, row: Array) -> dict[str, float]:
        """Signals of a row that `take` returns, by name."""
        return dict(zip(ROWS, row.tolist(), strict=True))

    def take(self, commands: Array, ship: Array) -> Array:
        """Advance by many samples at once.

        Parameters
        ----------
        commands : (n, 3) array
            As of `step`.
        ship : (n, 6) array
            Motion of the ship [m], [rad]; (n, 1) if it does not move.

        Returns
        -------
        (n, 30) array
            Signals, a column for each that `step` returns.

        Raises
        ------
        InputError, DomainError
            As `Crane.simulate`.
        """
        out = np.empty((len(commands), len(ROWS)))
        self._pass(self.fixed, commands, ship, out)
        for step, machine, worst in zip(
            self._steps,
            (*self._plant.drives, self._plant.law),
            self._plant.margins.tolist(),
            strict=False,
        ):
            step.check(machine, worst, "command")
        return out

    def run(self, commands: Array, ship: Array) -> Array:
        """A whole run from the start, as `take`; the stepper itself is then of no more use."""
        if not self._open:
            return self.take(commands, ship)
        out = np.empty((len(commands), len(ROWS)))
        for i, axis in enumerate(AXES):
            instance = instance_of(getattr(self._crane, axis).parameters, by_voltage=True)
            begun = instance.start({"voltage": 0.0}, 1.0 / RATE, "rest")
            stick = np.ascontiguousarray(commands[:, i])
            out[:, i] = open_voltages(stick, self.fixed.inverses[i], self.fixed.actuation)
            out[:, 3 + i], out[:, 6 + i] = marched(
                instance,
                {"voltage": out[:, i]},
                1.0 / RATE,
                begun,
                stored_of(instance.model, OUTPUTS),
                "command",
            )
        self._pass(self.fixed._replace(actuation=MARCHED), commands, ship, out)
        return out

    def _pass(self, fixed: Fixed, commands: Array, ship: Array, out: Array) -> None:
        """Run the loop; refuse what stops it."""
        self._state, ended = self._loop(
            1.0 / RATE, fixed, self._state, self._plant, commands, ship, out
        )
        if ended == FINE:
            return
        name, time = self._crane.name, self._state.sample / RATE
        rope = float(rope_length(self._state.shafts, fixed.geometry, fixed.home))
        if ended == TOO_FAST:
            raise InputError(too_fast(rope, time, RATE))
        if ended == ROPE_OUT:
            low, high = self._crane.rope_limits
            raise DomainError(
                f"{name}: at {time:.2f} s the rope is {rope:.2f} m long, but can be {low:g} to "
                f"{high:g} m; hoist or lower less, or start elsewhere."
            )
        low, high = map(degrees, self._crane.boom_limits)
        raise DomainError(
            f"{name}: at {time:.2f} s the boom meets the limits of its travel, {low:g} to "
            f"{high:g} deg; luff less, or start elsewhere."
        )


def _fixed(crane: Crane, how: Setup, settings: Any) -> Fixed:
    """What stays as it is during a run; refuses a setup that cannot be."""
    actuation, area, suspension = how["actuation"], how["drag_area"], how["suspension"]
    if actuation not in ACTUATIONS:
        raise InputError(f"actuation is '{actuation}'; it is {', '.join(ACTUATIONS[:-1])}.")
    if actuation == "direct" and how["control"] is not None:
        raise InputError("With direct actuation the voltages are given: leave control out.")
    if not (isfinite(area) and area >= 0.0):
        raise InputError(f"drag_area is {area:g} m², but must be at least 0.")
    load = crane.safe_load if how["load"] is None else how["load"]
    drag = AIR * area / (2.0 * load) if load > 0.0 else 0.0  # which the suspension refuses
    wind = (*how["wind"], 0.0)
    if how["loaded"]:
        _check_loaded(crane, actuation, load + suspension.hook, suspension)
    below, above = _edges(crane.hoist)
    low, high = crane.boom_limits
    hoist, slew, luff = (_inverse(crane.inverse(axis)) for axis in AXES)
    return Fixed(
        crane.geometry,
        crane.home(how["slew_deg"], how["boom_deg"], how["rope_m"]),
        settings,
        ACTUATIONS.index(actuation),
        bool(how["brake"]),
        (below or -FULL_VOLTAGE, above or FULL_VOLTAGE),
        (sin(low), sin(high)),
        crane.rope_limits,
        load + suspension.hook,
        suspension.hanging(load, crane.rope_limits[0], RATE, drag, wind),
        bool(how["loaded"]),
        (hoist, slew, luff),
    )


def _check_loaded(crane: Crane, actuation: str, mass: float, suspension: Suspension) -> None:
    """Refuse loads on drives that feel none, or that answer them faster than a sample."""
    if actuation == "ideal":
        raise InputError("Ideal drives follow at once, whatever the load: leave out 'loaded'.")
    drives = {axis: getattr(crane, axis) for axis in AXES}
    lost = {axis: _speed_lost(drive) for axis, drive in drives.items()}
    if not any(lost.values()) and not any("line" in d.parameters.options for d in drives.values()):
        raise InputError(
            f"No drive of {crane.name} feels a load: give one a motor_leakage or a "
            "line_stiffness, as crane.hoist.replace(motor_leakage=1e-6), or leave out 'loaded'."
        )
    for axis, arm in (("hoist", crane.geometry.hoist), ("luff", crane.geometry.luff)):
        gives = 0.5 * RATE * mass * arm * arm * lost[axis]
        if suspension.stiffness == inf and gives > QUICKEST:
            raise InputError(
                f"The {axis} of {crane.name} gives way to {mass:g} kg on a rigid rope within a "
                f"sample, since its motor_leakage costs {lost[axis]:.3g} rad/s for each N m: "
                "take an elastic rope, suspension=Suspension(stiffness=6e7)."
            )


@lru_cache(maxsize=64)
def _edges(drive: Drive) -> tuple[float | None, float | None]:
    """Voltages of a drive's dead zone, negative and positive. [V]"""
    return dead_zone(drive, -1.0)[1], dead_zone(drive, 1.0)[1]


@lru_cache(maxsize=64)
def _speed_lost(drive: Drive) -> float:
    """Speed that a drive loses at once for each N m of load. [rad/s/(N m)]"""
    still, pulled = (drive.simulate([0.0], load_torque=torque) for torque in (0.0, 1e5))
    return float(still.shaft_speed[0] - pulled.shaft_speed[0]) / 1e5


def _inverse(inverse: InverseMap) -> Inverse:
    """An inverse map as the loop takes it."""
    branches = (*inverse.minus, *inverse.plus)
    a, b, c, d = (np.ascontiguousarray(each, dtype=np.float64) for each in branches)
    low, high = inverse.limits
    return Inverse(a, b, c, d, inverse.creep, low, high, min(inverse.acceleration))
