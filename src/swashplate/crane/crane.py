"""Cranes: geometry with source and status, three drives, and the way to a run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from importlib.resources import files
from math import cos, degrees, inf, isfinite, radians, sin
from pathlib import Path
from types import MappingProxyType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Literal,
    NamedTuple,
    Protocol,
    TypedDict,
    Unpack,
    get_args,
)

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from swashplate.analysis.capability import dead_zone
from swashplate.analysis.compensation import InverseMap, inverse_map
from swashplate.crane.control import Control, settings_of
from swashplate.crane.kinematics import Boom, Geometry, Home, Vector, luff_rope
from swashplate.crane.linear import LinearCrane, linearize
from swashplate.crane.loop import BOOM_OUT, DIRECT, FINE, ROPE_OUT, Fixed, Loop
from swashplate.crane.result import CraneRun
from swashplate.crane.rope import AIR, Air, Suspension, too_fast
from swashplate.crane.sea import Seaway
from swashplate.crane.stick import AXES, Stick
from swashplate.documents import parse_toml, read_text, validated
from swashplate.drive import Drive
from swashplate.errors import DomainError, InputError, ParameterError
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.tables import Column, Table
from swashplate.units import to_si

if TYPE_CHECKING:
    from swashplate.analysis.monte_carlo import Draws
    from swashplate.crane.following import Followable
    from swashplate.crane.judgment import Judgment
    from swashplate.crane.study import Sweep

Array = NDArray[np.float64]
Actuation = Literal["ideal", "volts", "inverse"]
"""In the order of `loop.IDEAL` and the others."""

ACTUATIONS = (*get_args(Actuation), "direct")
QUICKEST = 0.4
"""Largest part of a rope's pull by which a leaking drive may lower it within a sample: at 0.7 they
would swing against each other from sample to sample."""


class Fitted(Protocol):
    """What a fit returns, as far as a crane takes it."""

    @property
    def drive(self) -> Drive:
        """The drive that was found."""
        ...


DriveLike = Drive | Fitted | str | Path

RATE = 512.0
"""Samples a second of the loop: the packaged drives' own. [Hz]"""


class Quantity(BaseModel):
    """A length, angle or number of a crane, with where it comes from."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    value: FiniteFloat | list[FiniteFloat]
    unit: str
    status: Literal["published", "measured", "assumed", "user"] = "user"
    source: str = ""


class Quantities(BaseModel):
    """Geometry of a crane."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    boom_length: Quantity
    foot_offset: Quantity
    slew_axis: Quantity
    tower_sheave_distance: Quantity
    tower_sheave_angle: Quantity
    hoist_drum_radius: Quantity
    hoist_falls: Quantity
    luff_drum_radius: Quantity
    luff_falls: Quantity
    rope_coupling: Quantity
    safe_load: Quantity
    boom_limits: Quantity
    rope_limits: Quantity


UNITS: Mapping[str, tuple[str, int]] = {
    **dict.fromkeys(Quantities.model_fields, ("m", 1)),
    "slew_axis": ("m", 3),
    "tower_sheave_angle": ("rad", 1),
    **dict.fromkeys(("hoist_falls", "luff_falls", "rope_coupling"), ("1", 1)),
    "safe_load": ("kg", 1),
    "boom_limits": ("rad", 2),
    "rope_limits": ("m", 2),
}
"""SI unit of each quantity, and how many numbers it has."""
ABOVE_ZERO = (
    *("boom_length", "tower_sheave_distance", "hoist_drum_radius", "hoist_falls"),
    *("luff_drum_radius", "luff_falls", "safe_load"),
)


class CraneFile(BaseModel):
    """A crane's file; drives are names of packaged ones or files beside it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = 1
    name: str
    title: str = ""
    drives: Annotated[dict[Literal["hoist", "slew", "luff"], str], Field(min_length=3)]
    geometry: Quantities


class Pose(NamedTuple):
    """Where a run begins: slew and boom in rad, rope below the tip in m."""

    slew: float
    boom: float
    rope: float


class Setup(TypedDict, total=False):
    """How a run is set up: keywords of `Crane.simulate` and `Crane.stepper`.

    Attributes
    ----------
    control : Control, optional
        Controller, of `swashplate.crane.control`; by default the stick's commands as they are.
    actuation : {"inverse", "volts", "ideal", "direct"}
        What makes speeds of wanted speeds: the real drives behind their inverse maps or behind
        10 V for full speed, or drives that follow at once within their limits of speed. A stepper
        also takes voltages, with "direct".
    slew_deg, boom_deg, rope_m : float
        Where it begins: slew from forward to starboard, boom's elevation, rope below the tip; by
        default 0, 45 and 20.
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

    control: Control | None
    actuation: Actuation | Literal["direct"]
    slew_deg: float
    boom_deg: float
    rope_m: float
    load: float | None
    suspension: Suspension
    loaded: bool
    drag_area: float
    wind: tuple[float, float]
    brake: bool


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


@dataclass(frozen=True, eq=False)
class Crane:
    """A rotary boom crane on a ship, with its three drives. Immutable.

    Examples
    --------
    >>> crane = Crane.preset("tg3637")
    >>> run = crane.simulate(Stick.trapezoid(slew=1.0, until={"slew_deg": 45}))
    >>> run.residual_deg
    """

    name: str
    title: str
    quantities: Mapping[str, Quantity]
    """Geometry by name, each with value, unit, status and source."""
    hoist: Drive
    slew: Drive
    luff: Drive

    def __post_init__(self) -> None:
        _check(self.name, self._si)

    @classmethod
    def preset(cls, name: str) -> Crane:
        """A packaged crane, ``"tg3637"``."""
        return _read(preset_text(name), f"crane {name}", None)

    @classmethod
    def from_toml(cls, path: str | Path) -> Crane:
        """A crane from a file; a `ParameterError` names file, entry and rule."""
        return _read(read_text(path), str(path), Path(path).parent)

    def __repr__(self) -> str:
        drives = ", ".join(f"{axis} {getattr(self, axis).name!r}" for axis in AXES)
        assumed = sum(each.status == "assumed" for each in self.quantities.values())
        return f"Crane({self.name!r}, {drives}; {assumed} of {len(UNITS)} quantities assumed)"

    def __reduce__(self) -> tuple[Any, ...]:
        """Names and numbers, by which another process makes the same crane."""
        drives = {axis: getattr(self, axis) for axis in AXES}
        return _crane_of, (self.name, self.title, dict(self.quantities), drives)

    def with_drive(
        self,
        *,
        hoist: DriveLike | None = None,
        slew: DriveLike | None = None,
        luff: DriveLike | None = None,
    ) -> Crane:
        """The crane with other drives.

        Parameters
        ----------
        hoist, slew, luff : Drive, Fit, str or path, optional
            A drive, ``crane.luff.scale(Z16=1.5)``; the result of a fit; or a place: a packaged
            name, a parameter file, or the folder that a fit wrote.

        Raises
        ------
        FileError, ParameterError
            If there is no such file, or it is no drive's.
        """
        given = {"hoist": hoist, "slew": slew, "luff": luff}
        made: dict[str, Any] = {
            axis: _drive_of(each) for axis, each in given.items() if each is not None
        }
        return replace(self, **made)

    def drawn(
        self,
        *,
        hoist: Draws | None = None,
        slew: Draws | None = None,
        luff: Draws | None = None,
    ) -> tuple[Crane, ...]:
        """Cranes whose drives are drawn from the errors of fits.

        Parameters
        ----------
        hoist, slew, luff : Draws, optional
            Of `analysis.monte_carlo.drives`; axes without keep their drive.

        Returns
        -------
        tuple of Crane
            As many as the shortest of the draws; of several axes the first with the first.

        Raises
        ------
        InputError
            If no draws are given.
        """
        given = {"hoist": hoist, "slew": slew, "luff": luff}
        found = {axis: each.drives for axis, each in given.items() if each is not None}
        if not found:
            raise InputError("Cranes are drawn from the draws of at least one axis.")
        sets: Iterator[dict[str, Any]] = (
            dict(zip(found, each, strict=True)) for each in zip(*found.values(), strict=False)
        )
        return tuple(replace(self, **each) for each in sets)

    def with_geometry(self, **changes: float | tuple[float, ...]) -> Crane:
        """The crane with other quantities, in SI and by name: ``boom_length=38.0``.

        Raises
        ------
        ParameterError
            For an unknown name, or lengths that make no crane.
        """
        made = dict(self.quantities)
        for name, value in changes.items():
            if name not in UNITS:
                raise ParameterError(f"A crane has no {name}; it has {', '.join(UNITS)}.")
            number = float(value) if isinstance(value, int | float) else list(map(float, value))
            made[name] = Quantity(value=number, unit=UNITS[name][0])
        return replace(self, quantities=MappingProxyType(made))

    @cached_property
    def _si(self) -> dict[str, tuple[float, ...]]:
        """Quantities in SI."""
        found = {}
        for name, (unit, count) in UNITS.items():
            entry = self.quantities[name]
            values = entry.value if isinstance(entry.value, list) else [entry.value]
            if len(values) != count:
                raise ParameterError(
                    f"{self.name}: {name} has {len(values)} numbers, but needs {count}."
                )
            what = f"{self.name}: {name}"
            found[name] = tuple(to_si(each, entry.unit, unit, what) for each in values)
        return found

    @cached_property
    def geometry(self) -> Geometry:
        """Lengths as the equations take them, in SI."""
        si = {name: values[0] for name, values in self._si.items()}
        return Geometry(
            si["boom_length"],
            si["foot_offset"],
            Vector(*self._si["slew_axis"]),
            si["tower_sheave_distance"],
            cos(si["tower_sheave_angle"]),
            sin(si["tower_sheave_angle"]),
            si["hoist_drum_radius"] / si["hoist_falls"],
            si["luff_drum_radius"] / si["luff_falls"],
            si["rope_coupling"],
        )

    @property
    def safe_load(self) -> float:
        """Mass that it lifts. [kg]"""
        return self._si["safe_load"][0]

    @property
    def boom_limits(self) -> tuple[float, float]:
        """Lowest and highest elevation of the boom. [rad]"""
        low, high = self._si["boom_limits"]
        return low, high

    @property
    def rope_limits(self) -> tuple[float, float]:
        """Shortest and longest rope below the tip. [m]"""
        low, high = self._si["rope_limits"]
        return low, high

    def inverse(self, axis: str) -> InverseMap:
        """Inverse map of the drive of an axis, ``"hoist"``, ``"slew"`` or ``"luff"``."""
        return _inverse(getattr(self, axis))

    def home(self, pose: Pose) -> Home:
        """A pose as the equations take it.

        Raises
        ------
        InputError
            If boom or rope are beyond the crane's limits.
        """
        low, high = self.boom_limits
        if not low <= pose.boom <= high:
            raise InputError(
                f"The boom of {self.name} stands at {degrees(pose.boom):g} deg, but moves between "
                f"{degrees(low):g} and {degrees(high):g} deg."
            )
        short, long = self.rope_limits
        if not short <= pose.rope <= long:
            raise InputError(
                f"The rope of {self.name} is {pose.rope:g} m, but can be {short:g} to {long:g} m."
            )
        if not isfinite(pose.slew):
            raise InputError("The slew at the start must be a finite angle.")
        boom = Boom(cos(pose.boom), sin(pose.boom))
        return Home(pose.slew, float(luff_rope(boom, self.geometry)), pose.rope)

    def shaft_angle(self, pose: Pose, axis: str, target: float) -> float:
        """Angle by which a shaft turns from a pose to a target: slew, boom [rad] or rope [m]."""
        g, home = self.geometry, self.home(pose)
        if axis == "slew":
            return target - pose.slew
        if axis == "hoist":
            return (pose.rope - target) / g.hoist
        return (home.luff_rope - float(luff_rope(Boom(cos(target), sin(target)), g))) / g.luff

    def simulate(
        self, stick: Stick, *, sea: Seaway | ArrayLike | None = None, **setup: Unpack[Setup]
    ) -> CraneRun:
        """Simulate the whole crane.

        Parameters
        ----------
        stick : Stick
            What the operator asks for; its length is that of the run.
        sea : Seaway or (n, 6) array_like, optional
            A seaway, or the ship's motion at 512 Hz: surge, sway, heave [m], roll, pitch, yaw
            [rad], as `ship_motion` reads it from a log; by default the ship is at rest.
        **setup
            Where it begins, what controls it, what hangs on it: see `Setup`.

        Raises
        ------
        InputError
            For a start beyond the crane's limits, a stick longer than the ship's motion or one that
            does not return, and a tip too fast for the rope.
        DomainError
            If boom or rope meet a limit, or a drive leaves its domain.
        """
        how = DEFAULTS | setup
        loop, pose, halves = self._loop(how)
        commands, end = stick.sample(self, pose, RATE)
        ship = _motion(sea, len(commands))
        out, ended = loop.take(commands, ship)
        if ended != FINE:
            raise self._stopped(loop, ended)
        return CraneRun(
            self, commands, ship, out, RATE, pose, how["actuation"], end, halves, loop.fixed.mass,
            loop.rows,
        )  # fmt: skip

    def stepper(self, **setup: Unpack[Setup]) -> CraneStepper:
        """The crane one sample at a time, for loops that the user writes.

        Parameters are those of `simulate`; with ``actuation="direct"`` the commands are the drives'
        voltages. [V]
        """
        return CraneStepper(self, self._loop(DEFAULTS | setup)[0])

    def linearize(self, boom_deg: float = 45.0, rope_m: float = 20.0) -> LinearCrane:
        """The linear crane at a boom and rope; see `swashplate.crane.linearize`."""
        return linearize(self, boom_deg, rope_m)

    def judge(self, control: Control | Mapping[str, Control], **how: Any) -> Judgment:
        """Judgment of control over many seaways; see `swashplate.crane.judge`."""
        from swashplate.crane.judgment import judge

        return judge(self, control, **how)

    def follow(self, periods: ArrayLike = tuple(range(4, 17)), **how: Any) -> Followable:
        """Largest sines of the tip that each axis can follow; see `swashplate.crane.follow`."""
        from swashplate.crane.following import follow

        return follow(self, periods, **how)

    def sectors(self, control: Control | Mapping[str, Control], **how: Any) -> Sweep:
        """Swing over the bearing of the boom; see `swashplate.crane.sectors`."""
        from swashplate.crane.study import sectors

        return sectors(self, control, **how)

    def operability(self, control: Control | Mapping[str, Control], **how: Any) -> Sweep:
        """Swing over the height of the waves; see `swashplate.crane.operability`."""
        from swashplate.crane.study import operability

        return operability(self, control, **how)

    def _loop(self, how: Setup) -> tuple[Loop, Pose, int]:
        """The loop of a complete setup, where it begins, and half periods of its shaper."""
        strange = [each for each in how if each not in DEFAULTS]
        if strange:
            raise InputError(f"A run has no {strange[0]}; its setup has {', '.join(DEFAULTS)}.")
        pose = Pose(radians(how["slew_deg"]), radians(how["boom_deg"]), how["rope_m"])
        actuation, area, control = how["actuation"], how["drag_area"], how["control"]
        if actuation not in ACTUATIONS:
            raise InputError(f"actuation is '{actuation}'; it is {', '.join(ACTUATIONS[:-1])}.")
        if not (isfinite(area) and area >= 0.0):
            raise InputError(f"drag_area is {area:g} m², but must be at least 0.")
        load = self.safe_load if how["load"] is None else how["load"]
        if not (isfinite(load) and load > 0.0):
            raise InputError(f"The load is {load:g} kg, but must be above 0.")
        suspension = how["suspension"]
        settings, law, halves = settings_of(control)
        mode = ACTUATIONS.index(actuation)
        if mode == DIRECT and control is not None:
            raise InputError("With direct actuation the voltages are given: leave control out.")
        if how["loaded"]:
            self._check_loaded(actuation, load + suspension.hook, suspension)
        edges = _edges(self.hoist)
        low, high = self.boom_limits
        forward, port = how["wind"]
        fixed = Fixed(
            self.geometry,
            self.home(pose),
            Air(AIR * area / (2.0 * load), Vector(float(forward), float(port), 0.0)),
            settings,
            mode,
            bool(how["brake"]),
            (edges[0] or -FULL_VOLTAGE, edges[1] or FULL_VOLTAGE),
            (sin(low), sin(high)),
            self.rope_limits,
            load + suspension.hook,
            bool(how["loaded"]),
            suspension.hanging(load, self.rope_limits[0], RATE),
        )
        drives = (self.hoist, self.slew, self.luff)
        return Loop(drives, tuple(map(_inverse, drives)), fixed, law, RATE), pose, halves

    def _check_loaded(self, actuation: str, mass: float, suspension: Suspension) -> None:
        """Refuse loads on drives that feel none, or that answer them faster than a sample."""
        if actuation == "ideal":
            raise InputError("Ideal drives follow at once, whatever the load: leave out 'loaded'.")
        lost = {axis: _speed_lost(getattr(self, axis)) for axis in AXES}
        if not any(lost.values()) and not any(_has_line(getattr(self, axis)) for axis in AXES):
            raise InputError(
                f"No drive of {self.name} feels a load: give one a motor_leakage or a "
                "line_stiffness, as crane.hoist.replace(motor_leakage=1e-6), or leave out 'loaded'."
            )
        if suspension.stiffness < inf:
            return
        for axis, arm in (("hoist", self.geometry.hoist), ("luff", self.geometry.luff)):
            answer = 0.5 * RATE * mass * arm * arm * lost[axis]
            if answer > QUICKEST:
                raise InputError(
                    f"The {axis} of {self.name} gives way to {mass:g} kg on a rigid rope within a "
                    f"sample, since its motor_leakage costs {lost[axis]:.3g} rad/s for each N m: "
                    "take an elastic rope, suspension=Suspension(stiffness=6e7)."
                )

    def _stopped(self, loop: Loop, ended: int) -> DomainError | InputError:
        """What has stopped a run."""
        state = loop.state
        time = state.sample / loop.rate
        if ended == ROPE_OUT:
            low, high = self.rope_limits
            return DomainError(
                f"{self.name}: at {time:.2f} s the rope is {state.rope:.2f} m long, but can be "
                f"{low:g} to {high:g} m; hoist or lower less, or start elsewhere."
            )
        if ended == BOOM_OUT:
            low, high = map(degrees, self.boom_limits)
            return DomainError(
                f"{self.name}: at {time:.2f} s the boom meets the limits of its travel, {low:g} to "
                f"{high:g} deg; luff less, or start elsewhere."
            )
        return InputError(too_fast(state.rope, time, loop.rate))

    def table(self) -> Table:
        """Geometry with status and source; what is assumed is marked."""
        columns = (
            Column("quantity"),
            Column("value"),
            Column("unit"),
            Column("status"),
            Column("source", wrap=True),
        )
        made = Table(self.title or self.name, columns)
        for name, each in self.quantities.items():
            values = each.value if isinstance(each.value, list) else [each.value]
            text = ", ".join(f"{value:g}" for value in values)
            look = each.status == "assumed"
            made.add(name.replace("_", " "), text, each.unit, each.status, each.source, look=look)
        return made


class CraneStepper:
    """A crane that takes commands and gives signals, the same numbers as `Crane.simulate`."""

    def __init__(self, crane: Crane, loop: Loop) -> None:
        self._crane, self._loop = crane, loop

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
        most = FULL_VOLTAGE if self._loop.fixed.actuation == DIRECT else 1.0
        commands = np.array([command], dtype=np.float64)
        if commands.shape != (1, 3) or not (np.abs(commands) <= most).all():
            raise InputError(f"A crane takes three commands of at most ±{most:g}.")
        motion = np.zeros((1, 1)) if ship is None else np.array([ship], dtype=np.float64)
        if motion.shape not in ((1, 1), (1, 6)) or not np.isfinite(motion).all():
            raise InputError("The ship's motion is six finite numbers.")
        return self.named(self.take(commands, motion)[0])

    def named(self, row: Array) -> dict[str, float]:
        """Signals of a row that `take` returns, by name."""
        return dict(zip(self._loop.rows, row.tolist(), strict=True))

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
        out, ended = self._loop.take(commands, ship)
        if ended != FINE:
            raise self._crane._stopped(self._loop, ended)
        return out


def _crane_of(
    name: str, title: str, quantities: dict[str, Quantity], drives: dict[str, Drive]
) -> Crane:
    return Crane(name, title, MappingProxyType(quantities), **drives)


def _drive_of(given: DriveLike) -> Drive:
    """A drive as it may be given to a crane."""
    if isinstance(given, Drive):
        return given
    if not isinstance(given, str | Path):
        return given.drive
    place = Path(given)
    if place.is_dir():
        return Drive.from_toml(place / "drive.toml")
    return Drive.from_toml(place) if place.suffix == ".toml" else Drive.preset(str(given))


@lru_cache(maxsize=512)
def _inverse(drive: Drive) -> InverseMap:
    return inverse_map(drive)


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


def _has_line(drive: Drive) -> bool:
    return "line" in drive.parameters.options


def preset_text(name: str) -> str:
    """The file of a packaged crane."""
    found = {each.name.removesuffix(".toml"): each for each in _SETS.iterdir()}
    if name not in found:
        raise ParameterError(f"There is no packaged crane '{name}'; there is {', '.join(found)}.")
    return found[name].read_text("utf-8")


_SETS = files("swashplate.crane") / "sets"


def _read(text: str, origin: str, folder: Path | None) -> Crane:
    content = validated(parse_toml(text, origin), CraneFile, origin)
    drives: dict[str, Any] = {}
    for axis, word in content.drives.items():
        own = folder is not None and word.endswith(".toml")
        drives[axis] = Drive.from_toml(folder / word) if own and folder else Drive.preset(word)
    quantities = {name: getattr(content.geometry, name) for name in UNITS}
    return Crane(content.name, content.title, MappingProxyType(quantities), **drives)


def _check(name: str, si: Mapping[str, tuple[float, ...]]) -> None:
    """Refuse lengths that make no crane."""
    for each in ABOVE_ZERO:
        if not si[each][0] > 0.0:
            raise ParameterError(f"{name}: {each} is {si[each][0]:g}, but must be above 0.")
    for each in ("foot_offset", "rope_coupling"):
        if not si[each][0] >= 0.0:
            raise ParameterError(f"{name}: {each} is {si[each][0]:g}, but must be at least 0.")
    low, high = si["boom_limits"]
    angle = si["tower_sheave_angle"][0]
    if not 0.0 <= low < high < radians(90.0):
        raise ParameterError(
            f"{name}: boom_limits are {degrees(low):g} and {degrees(high):g} deg, but must rise "
            "within 0 to 90 deg."
        )
    if not high < angle < low + radians(180.0):
        raise ParameterError(
            f"{name}: tower_sheave_angle is {degrees(angle):g} deg, but the luff rope only lifts a "
            f"boom up to {degrees(high):g} deg from a sheave above that and below "
            f"{degrees(low) + 180.0:g} deg."
        )
    short, long = si["rope_limits"]
    if not 0.0 < short < long:
        raise ParameterError(
            f"{name}: rope_limits are {short:g} and {long:g} m, but must rise from above 0."
        )


def _motion(sea: Seaway | ArrayLike | None, count: int) -> Array:
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
