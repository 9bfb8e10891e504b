"""Steppers: a crane with its setup, one sample after the other or many at once."""

from __future__ import annotations

from functools import lru_cache
from math import degrees, inf, isfinite, pi, radians, sin, sqrt
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypedDict, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis.capability import dead_zone
from swashplate.crane.control import GIVES, SEEN, Control, settings_of
from swashplate.crane.kinematics import Shafts, Vector, boom_at, shaft_torques, tip_of
from swashplate.crane.loop import (
    DIRECT,
    FINE,
    HOOK,
    ROPE_OUT,
    ROWS,
    TOO_FAST,
    TORQUES,
    Fixed,
    Plant,
    State,
    inverse_of,
    loop_of,
)
from swashplate.crane.rope import AIR, GRAVITY, Air, Hung, Suspension, too_fast
from swashplate.crane.sea import Seaway
from swashplate.crane.stick import AXES
from swashplate.drive import Drive
from swashplate.equations import compiled_step
from swashplate.errors import DomainError, InputError
from swashplate.parameters.rules import FULL_VOLTAGE

if TYPE_CHECKING:
    from swashplate.crane.crane import Crane

Array = NDArray[np.float64]
Actuation = Literal["ideal", "volts", "inverse"]
"""In the order of `loop.IDEAL` and the others."""
ACTUATIONS = (*get_args(Actuation), "direct")
RATE = 512.0
"""Samples a second of the loop: the packaged drives' own. [Hz]"""
QUICKEST = 0.4
"""Largest part of a rope's pull by which a leaking drive may lower it within a sample: at 0.7 they
would swing against each other from sample to sample."""


class Pose(NamedTuple):
    """Where a run begins: slew and boom in rad, rope below the tip in m."""

    slew: float
    boom: float
    rope: float


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


def pose_of(where: Start) -> Pose:
    """The pose of these keywords."""
    return Pose(radians(where["slew_deg"]), radians(where["boom_deg"]), where["rope_m"])


class CraneStepper:
    """A crane that takes commands and gives signals, the same numbers as `Crane.simulate`.

    Made by `Crane.stepper`.
    """

    def __init__(self, crane: Crane, setup: Setup) -> None:
        strange = [each for each in setup if each not in DEFAULTS]
        if strange:
            raise InputError(f"A run has no {strange[0]}; its setup has {', '.join(DEFAULTS)}.")
        how = DEFAULTS | setup
        self._crane, self.pose = crane, pose_of(how)
        self.actuation = how["actuation"]
        settings, law, self.halves = settings_of(how["control"])
        fixed = _fixed(crane, how, settings)
        self.mass = fixed.mass
        self._fixed, self._h = fixed, 1.0 / RATE
        given = ("voltage", "load_torque") if fixed.loaded else ("voltage",)
        self._steps = [
            getattr(crane, axis).compiled_step(("shaft_speed", "limits"), inputs=given, rate=RATE)
            for axis in AXES
        ]
        hoist, slew, luff = (each.machine() for each in self._steps)
        own, picks = hoist, np.zeros(0, dtype=np.int64)
        if law is not None:
            seen = law.model.external
            self._steps.append(compiled_step(law.model, law.values, seen, GIVES, RATE))
            own = self._steps[3].machine()
            picks = np.array([SEEN.index(each) for each in seen], dtype=np.int64)
        hooked = fixed.hanging.sling > 0.0
        one, two, three, *last = (each.step for each in self._steps)
        self._loop = loop_of(one, two, three, last[0] if last else None, fixed.loaded, hooked)
        self.rows = ROWS + (TORQUES if fixed.loaded else ()) + (HOOK if hooked else ())
        g, home = fixed.geometry, fixed.home
        zero, boom = Shafts(0.0, 0.0, 0.0), boom_at(0.0, g, home)
        tip = tip_of(home.slew, boom, g)
        weight = fixed.mass * GRAVITY
        torques = shaft_torques(Vector(0.0, 0.0, -weight), home.slew, boom, weight, g)
        self._state = State(
            0, zero, zero, zero, zero, zero, boom, home.rope, tip, tip,
            Hung(tip, tip, tip, tip, 0.0, 0.0), torques, 0.0, 0.0,
        )  # fmt: skip
        longest = 2.0 * pi * sqrt(fixed.ropes[1] / GRAVITY) * RATE + 4.0
        memory = np.zeros((7, 1 << int(longest).bit_length()))
        memory[3:5] = [[tip.x], [tip.y]]
        a, b, c = (inverse_of(crane.inverse(axis)) for axis in AXES)
        self._plant = Plant(
            (a, b, c), (hoist, slew, luff), own, picks, memory, np.full(4, np.inf)
        )  # fmt: skip

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
        most = FULL_VOLTAGE if self._fixed.actuation == DIRECT else 1.0
        commands = np.array([command], dtype=np.float64)
        if commands.shape != (1, 3) or not (np.abs(commands) <= most).all():
            raise InputError(f"A crane takes three commands of at most ±{most:g}.")
        motion = np.zeros((1, 1)) if ship is None else np.array([ship], dtype=np.float64)
        if motion.shape not in ((1, 1), (1, 6)) or not np.isfinite(motion).all():
            raise InputError("The ship's motion is six finite numbers.")
        return self.named(self.take(commands, motion)[0])

    def named(self, row: Array) -> dict[str, float]:
        """Signals of a row that `take` returns, by name."""
        return dict(zip(self.rows, row.tolist(), strict=True))

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
        (n, 24) array
            Signals, a column for each that `step` returns.

        Raises
        ------
        InputError, DomainError
            As `Crane.simulate`.
        """
        out = np.empty((len(commands), len(self.rows)))
        plant = self._plant
        self._state, ended = self._loop(
            self._h, self._fixed, self._state, plant, commands, ship, out
        )
        for step, machine, worst in zip(
            self._steps, (*plant.drives, plant.law), plant.margins.tolist(), strict=False
        ):
            step.check(machine, worst, "command")
        if ended != FINE:
            raise self._stopped(ended)
        return out

    def _stopped(self, ended: int) -> DomainError | InputError:
        """What has stopped a run."""
        name, rope, time = self._crane.name, self._state.rope, self._state.sample / RATE
        if ended == TOO_FAST:
            return InputError(too_fast(rope, time, RATE))
        if ended == ROPE_OUT:
            low, high = self._crane.rope_limits
            return DomainError(
                f"{name}: at {time:.2f} s the rope is {rope:.2f} m long, but can be {low:g} to "
                f"{high:g} m; hoist or lower less, or start elsewhere."
            )
        low, high = map(degrees, self._crane.boom_limits)
        return DomainError(
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
    if not (isfinite(load) and load > 0.0):
        raise InputError(f"The load is {load:g} kg, but must be above 0.")
    if how["loaded"]:
        _check_loaded(crane, actuation, load + suspension.hook, suspension)
    edges = _edges(crane.hoist)
    low, high = crane.boom_limits
    forward, port = how["wind"]
    return Fixed(
        crane.geometry,
        crane.home(pose_of(how)),
        Air(AIR * area / (2.0 * load), Vector(float(forward), float(port), 0.0)),
        settings,
        ACTUATIONS.index(actuation),
        bool(how["brake"]),
        (edges[0] or -FULL_VOLTAGE, edges[1] or FULL_VOLTAGE),
        (sin(low), sin(high)),
        crane.rope_limits,
        load + suspension.hook,
        suspension.hanging(load, crane.rope_limits[0], RATE),
        bool(how["loaded"]),
    )


def _check_loaded(crane: Crane, actuation: str, mass: float, suspension: Suspension) -> None:
    """Refuse loads on drives that feel none, or that answer them faster than a sample."""
    if actuation == "ideal":
        raise InputError("Ideal drives follow at once, whatever the load: leave out 'loaded'.")
    drives = [getattr(crane, axis) for axis in AXES]
    lost = dict(zip(AXES, map(_speed_lost, drives), strict=True))
    if not any(lost.values()) and not any("line" in each.parameters.options for each in drives):
        raise InputError(
            f"No drive of {crane.name} feels a load: give one a motor_leakage or a "
            "line_stiffness, as crane.hoist.replace(motor_leakage=1e-6), or leave out 'loaded'."
        )
    if suspension.stiffness < inf:
        return
    for axis, arm in (("hoist", crane.geometry.hoist), ("luff", crane.geometry.luff)):
        if 0.5 * RATE * mass * arm * arm * lost[axis] > QUICKEST:
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
    still, pulled = (
        float(drive.simulate([0.0], load_torque=torque).shaft_speed[0]) for torque in (0.0, 1e5)
    )
    return (still - pulled) / 1e5


def motion_of(sea: Seaway | ArrayLike | None, count: int) -> Array:
    """The ship's motion over so many samples; one column if it is at rest."""
    if sea is None:
        return np.zeros((count, 1))
    if isinstance(sea, Seaway):
        return sea.motion(count, RATE)
    made = np.ascontiguousarray(sea, dtype=np.float64)
    if made.ndim != 2 or made.shape[1] != 6 or not np.isfinite(made).all():
        raise InputError(
            "The ship's motion has rows of six finite numbers: surge, sway, heave [m], roll, "
            "pitch, yaw [rad]."
        )
    if len(made) < count:
        raise InputError(
            f"The stick is {(count - 1) / RATE:g} s long, but the ship's motion only "
            f"{(len(made) - 1) / RATE:g} s at {RATE:g} Hz."
        )
    return made[:count]
