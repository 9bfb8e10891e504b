"""Cranes: geometry with source and status, three drives, and the way to a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from importlib.resources import files
from math import cos, degrees, radians, sin
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Unpack

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field

from swashplate.analysis.compensation import InverseMap, inverse_map
from swashplate.analysis.whatif import pulled
from swashplate.crane.axes import AXES, RATE, check_names
from swashplate.crane.control import linearize
from swashplate.crane.drives import DriveLike, DriveSource, drives_of
from swashplate.crane.kinematics import Boom, Geometry, Home, Vector, luff_rope
from swashplate.crane.loop import DIRECT, IDEAL
from swashplate.crane.quantities import (
    GEOMETRY,
    OPTIONAL,
    Quantity,
    check_sources,
    in_si,
    quantity_of,
)
from swashplate.crane.result import CraneRun
from swashplate.crane.sea import Seaway, motion_of
from swashplate.crane.stepper import CraneStepper, Setup
from swashplate.crane.stick import Array, Stick
from swashplate.documents import parse_toml, read_text, validated
from swashplate.drive import Drive
from swashplate.errors import InputError, ParameterError
from swashplate.tables import Column, Table

if TYPE_CHECKING:
    from swashplate.analysis.monte_carlo import Draws
    from swashplate.crane.judgment import Followable, Judgment
    from swashplate.crane.study import Laws, Sweep
    from swashplate.linear import LinearModel


class CraneFile(BaseModel):
    """A crane's file; drives are packaged names, or files and folders of fits beside it."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    format: Literal[1] = 1
    name: str
    title: str = ""
    drives: Annotated[dict[Literal["hoist", "slew", "luff"], str], Field(min_length=3)]
    geometry: dict[str, Quantity]


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
    """Geometry by name."""
    hoist: Drive
    slew: Drive
    luff: Drive
    known: Mapping[str, Drive] = field(default_factory=dict)
    """Drives that control knows, by axis, where they are not those that move the crane."""
    sources: Mapping[str, DriveSource] = field(default_factory=dict)
    """Where drives come from that are neither packaged nor made in Python, by axis."""

    def __post_init__(self) -> None:
        _ = self._si

    @classmethod
    def preset(cls, name: str) -> Crane:
        """A packaged crane, ``"tg3637"``."""
        return _read(preset_text(name), f"crane {name}", Path())

    @classmethod
    def from_toml(cls, path: str | Path) -> Crane:
        """A crane from a file; a `ParameterError` names file, entry and rule."""
        crane = _read(read_text(path), str(path), Path(path).parent)
        for name in packaged_names():
            check_sources(crane.quantities, cls.preset(name).quantities, str(path), name)
        return crane

    def __repr__(self) -> str:
        drives = ", ".join(f"{axis} {getattr(self, axis).name!r}" for axis in AXES)
        return f"Crane({self.name!r}, {drives}; {self.assumed or 'no quantities'} assumed)"

    @property
    def assumed(self) -> str:
        """How much of the geometry is assumed: ``"12 of 13 quantities"``, empty if nothing is."""
        count = sum(each.status == "assumed" for each in self.quantities.values())
        return f"{count} of {len(self.quantities)} quantities" if count else ""

    @property
    def fits(self) -> dict[str, Path]:
        """Folders of the fits that its drives come from, by axis."""
        return {axis: source.fit for axis, source in self.sources.items() if source.fit is not None}

    def provenance(self) -> tuple[str, ...]:
        """Where drives come from, and what their tests left open, in sentences.

        Of each drive in `sources` its file, the verdict on its fit and what that holds for; of any
        drive the limits that no test of it reached.
        """
        sentences = list[str]()
        for axis in AXES:
            if axis in self.sources:
                sentences.append(self.sources[axis].sentence(axis))
            sentences.append(self.unreached_sentence(axis))
        return tuple(filter(None, sentences))

    def unreached_sentence(self, axis: str) -> str:
        """The limits that no test of an axis's drive reached, in a sentence; empty if it has none.

        Limits that were given another value since are none of them.
        """
        drive: Drive = getattr(self, axis)
        return drive.parameters.unreached_sentence(f"the {axis}'s drive")

    def with_drive(self, *, told: bool = True, **drives: DriveLike) -> Crane:
        """The crane with other drives by axis.

        Parameters
        ----------
        told : bool
            Whether control knows the new drives, as after a redesign. If not, it counts on those
            before, as where a drive has worn: inverse maps, the stick's full speed and the clip
            are theirs.
        **drives
            Each is a drive, ``luff=crane.luff.scale(Z16=1.5)``; the result of a fit; or a place: a
            packaged name, a parameter file, or the folder that a fit wrote. The verdict on a fit
            stands in `sources`; a drive that is not usable is taken, and judgments say so.
        """
        check_names("A crane has no drive", drives, AXES, "it has")
        made, sources = drives_of(drives, Path())
        known = {axis: drive for axis, drive in self.known.items() if axis not in made}
        if not told:
            known |= {axis: self.known_drive(axis) for axis in made}
        kept = {axis: source for axis, source in self.sources.items() if axis not in made}
        return replace(self, known=known, sources=kept | sources, **made)

    def known_drive(self, axis: str) -> Drive:
        """The drive of an axis as control knows it: its own, unless `known` has another."""
        drive: Drive = self.known.get(axis, getattr(self, axis))
        return drive

    def upgraded(self, axis: str, levers: Mapping[str, float]) -> Crane:
        """The crane with levers moved on the drive of an axis, which control knows, as redesigned.

        Where control knows another drive of that axis, they are moved on that, too.
        """
        known = dict(self.known)
        if axis in known:
            known[axis] = pulled(known[axis], levers)
        sources = dict(self.sources)
        if axis in sources:  # the verdict stays that of what was changed, draws do not
            sources[axis] = sources[axis]._replace(fit=None)
        made: dict[str, Any] = {axis: pulled(getattr(self, axis), levers), "known": known}
        return replace(self, sources=sources, **made)

    def drawn(self, **draws: Draws) -> tuple[Crane, ...]:
        """Cranes whose drives are drawn from the errors of fits, by axis; others keep their drive.

        Control knows none of the draws: it counts on this crane's drives, which should be the
        fitted ones. Draws are those of `analysis.monte_carlo.drives`, by default of the fits that
        the drives come from: as many cranes as the shortest has. Those of each axis are shuffled by
        themselves, so that draws of two axes from the same seed are not paired.
        """
        from swashplate.analysis.monte_carlo import stored_draws

        check_names("A crane has no drive", draws, AXES, "it has")
        draws = draws or {
            axis: stored_draws(place, drive=getattr(self, axis))
            for axis, place in self.fits.items()
        }
        if not draws:
            raise InputError(
                "Cranes are drawn from the draws of at least one axis, but no drive of "
                f"{self.name} comes from the folder of a fit, as luff=FOLDER."
            )
        shuffled: dict[str, Any] = {}
        for axis, each in draws.items():
            order = np.random.default_rng(AXES.index(axis)).permutation(len(each.drives))
            shuffled[axis] = [each.drives[k] for k in order]
        sources = {
            axis: source._replace(fit=None) if axis in shuffled else source
            for axis, source in self.sources.items()
        }
        sets = zip(*shuffled.values(), strict=False)
        return tuple(
            replace(
                self.with_drive(told=False, **dict(zip(shuffled, each, strict=True))),
                sources=sources,
            )
            for each in sets
        )

    def with_geometry(self, **changes: float | tuple[float, ...]) -> Crane:
        """The crane with other quantities, in SI and by name: ``boom_length=38.0``.

        A `ParameterError` for an unknown name, a value out of its plausible range, or lengths that
        make no crane.
        """
        quantities = dict(self.quantities)
        for name, value in changes.items():
            if name not in GEOMETRY:
                raise ParameterError(f"A crane has no {name}; it has {', '.join(GEOMETRY)}.")
            quantities[name] = quantity_of(name, value)
        return replace(self, quantities=quantities)

    @cached_property
    def _si(self) -> dict[str, tuple[float, ...]]:
        """Quantities in SI; a `ParameterError` for those that make no crane."""
        return in_si(self.quantities, self.name)

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
    def swing_damping(self) -> float:
        """Damping ratio of the load's swing by air, sheaves and rope."""
        return self._si["swing_damping"][0]

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
        """Inverse map of the drive that control knows of ``"hoist"``, ``"slew"`` or ``"luff"``."""
        return _inverse(self.known_drive(axis))

    def home(self, slew_deg: float = 0.0, boom_deg: float = 45.0, rope_m: float = 20.0) -> Home:
        """Where a run starts; an `InputError` if boom or rope are beyond the crane's limits."""
        low, high = map(degrees, self.boom_limits)
        if not low - 1e-9 <= boom_deg <= high + 1e-9:
            raise InputError(
                f"The boom of {self.name} stands at {boom_deg:g} deg, but moves between {low:g} "
                f"and {high:g} deg."
            )
        short, long = self.rope_limits
        if not short <= rope_m <= long:
            raise InputError(
                f"The rope of {self.name} is {rope_m:g} m, but can be {short:g} to {long:g} m."
            )
        if not abs(slew_deg) <= 720.0:
            raise InputError(
                f"The slew at the start is {slew_deg:g} deg, but must be within 720 deg."
            )
        boom = Boom(cos(radians(boom_deg)), sin(radians(boom_deg)))
        return Home(radians(slew_deg), float(luff_rope(boom, self.geometry)), rope_m)

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
            For a start beyond the crane's limits, a stick longer than the ship's motion, one that
            does not return, or that begins at full speed on ideal drives, direct actuation, and a
            tip too fast for the rope.
        DomainError
            If boom or rope meet a limit, or a drive leaves its domain.
        """
        stepper, commands, end = begun(self, stick, setup)
        ship = motion_of(sea, len(commands), RATE)
        return CraneRun(self, commands, ship, stepper.run(commands, ship), stepper.fixed, end)

    def stepper(self, **setup: Unpack[Setup]) -> CraneStepper:
        """The crane one sample at a time, set up as `simulate`, for loops that the user writes."""
        return CraneStepper(self, **setup)

    def linearize(self, boom_deg: float = 45.0, rope_m: float = 20.0) -> LinearModel:
        """The linear crane about a load at rest, see `swashplate.crane.control.linearize`."""
        return linearize(self, boom_deg, rope_m)

    def judge(self, control: Laws, **how: Any) -> Judgment:
        """Judgment of control over many seaways; see `swashplate.crane.judge`."""
        from swashplate.crane.judgment import judge

        return judge(self, control, **how)

    def sweep(self, over: str, control: Laws, **how: Any) -> Sweep:
        """Swing over a quantity; see `swashplate.crane.sweep`."""
        from swashplate.crane.study import sweep

        return sweep(self, over, control, **how)

    def sectors(self, control: Laws, **how: Any) -> Sweep:
        """Swing over the bearing of the boom: `sweep` over ``"bearing"``."""
        return self.sweep("bearing", control, **how)

    def follow(self, periods: ArrayLike = tuple(range(4, 17)), **how: Any) -> Followable:
        """Largest sines of the tip that each axis can follow; see `swashplate.crane.follow`."""
        from swashplate.crane.judgment import follow

        return follow(self, periods, **how)

    def table(self) -> Table:
        """Geometry with status and source; what is assumed is marked."""
        heads = ("quantity", "value", "unit", "status")
        made = Table(self.title or self.name, (*map(Column, heads), Column("source", wrap=True)))
        for name, each in self.quantities.items():
            text = ", ".join(f"{value:g}" for value in each.values)
            look = each.status == "assumed"
            made.add(name.replace("_", " "), text, each.unit, each.status, each.source, look=look)
        return made


@lru_cache(maxsize=512)
def _inverse(drive: Drive) -> InverseMap:
    return inverse_map(drive)


def begun(crane: Crane, stick: Stick, setup: Setup) -> tuple[CraneStepper, Array, float]:
    """A run at its start: stepper, commands, and when the last one ends; as `simulate` refuses."""
    stepper = CraneStepper(crane, **setup)
    if stepper.fixed.actuation == DIRECT:
        raise InputError(
            "With direct actuation commands are voltages, but a stick gives parts of the full "
            "speed: take Crane.stepper, or actuation='volts'."
        )
    if not isinstance(stick, Stick):
        raise InputError(f"The stick is {stick!r}, but must be a Stick, as Stick.rest(60).")
    commands, end = stick.sample(crane, stepper.fixed.home, RATE)
    if stepper.fixed.actuation == IDEAL and commands[0].any():
        raise InputError(
            "Ideal drives follow at once, and the crane starts at rest: a recorded stick must "
            "begin at zero, so put a row of zeros before it."
        )
    return stepper, commands, end


SETS = files("swashplate.crane") / "sets"


def packaged_names() -> list[str]:
    """Names of the packaged cranes."""
    return sorted(each.name.removesuffix(".toml") for each in SETS.iterdir())


def preset_text(name: str) -> str:
    """The file of a packaged crane."""
    names = packaged_names()
    if name not in names:
        raise ParameterError(f"There is no packaged crane '{name}'; there is {', '.join(names)}.")
    return (SETS / f"{name}.toml").read_text("utf-8")


def _geometry_of(content: CraneFile, origin: str) -> dict[str, Quantity]:
    """All quantities of a crane's file; refuses a name that is missing or unknown."""
    given = {**OPTIONAL, **content.geometry}
    lacks = [name for name in GEOMETRY if name not in given]
    strange = [name for name in content.geometry if name not in GEOMETRY]
    if lacks or strange:
        extra = f", and knows no '{strange[0]}'" if strange else ""
        need = f"needs an entry '{lacks[0]}'" if lacks else f"has {len(GEOMETRY)} quantities"
        raise ParameterError(f"{origin}: geometry {need}{extra}.")
    return {name: given[name] for name in GEOMETRY}


def _read(text: str, origin: str, folder: Path) -> Crane:
    """A crane of a file's text, its drives beside it."""
    content = validated(parse_toml(text, origin), CraneFile, origin)
    quantities = _geometry_of(content, origin)
    in_si(quantities, origin)
    drives, sources = drives_of(content.drives, folder)
    return Crane(content.name, content.title, quantities, **drives, sources=sources)
