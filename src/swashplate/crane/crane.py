"""Cranes: geometry with source and status, three drives, and what the controller knows of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from importlib.resources import files
from math import cos, degrees, radians, sin
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

from pydantic import ConfigDict, Field

from swashplate.analysis import InverseMap, inverse_map
from swashplate.crane.axes import AXES, check_names
from swashplate.crane.drives import DriveLike, DriveSource, drives_of
from swashplate.crane.kinematics import Boom, Geometry, Home, luff_rope, vector_of
from swashplate.crane.limits import DEFINITIONS, LIMITED, limits_of
from swashplate.crane.quantities import (
    DEFAULTS,
    GEOMETRY,
    MAY_LACK,
    CraneQuantity,
    check_sources,
    quantities_in_si,
    user_quantity,
)
from swashplate.documents import parse_toml, read_text, validated
from swashplate.drive import Drive
from swashplate.entries import FormerlyFormat
from swashplate.errors import InputError, ParameterError
from swashplate.tables import Column, Table


class Deck(NamedTuple):
    """The ship's deck, as high and as wide all along the ship."""

    height: float
    """Above the origin that the ship's motion is given for. [m]"""
    half_breadth: float
    """From the plane of symmetry to the side. [m]"""


class CraneFile(FormerlyFormat):
    """A crane's file; drives are packaged names, or files and folders of fits next to it."""

    model_config = ConfigDict(strict=True)

    name: str
    title: str = ""
    drives: Annotated[dict[Literal["hoist", "slew", "luff"], str], Field(min_length=3)]
    geometry: dict[str, CraneQuantity]
    limits: dict[str, CraneQuantity] = Field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Crane:
    """A rotary boom crane on a ship, with its three drives. Immutable.

    Examples
    --------
    >>> from swashplate.crane import Crane, OperatorCommand, simulate
    >>> crane = Crane.preset("tg3637")
    >>> run = simulate(crane, OperatorCommand.trapezoid(slew=1.0, until={"slew_deg": 45.0}))
    >>> round(run.residual_deg, 1)
    7.4
    """

    name: str
    title: str
    quantities: Mapping[str, CraneQuantity]
    """Geometry by name."""
    hoist: Drive
    slew: Drive
    luff: Drive
    known_to_controller: Mapping[str, Drive] = field(default_factory=dict)
    """Drives that the controller counts on, by axis, if they are not those that move the crane."""
    sources: Mapping[str, DriveSource] = field(default_factory=dict)
    """Sources of drives that are neither packaged nor made in Python, by axis."""
    limits: Mapping[str, CraneQuantity] = field(default_factory=dict)
    """Limits of an operation, by names of `swashplate.crane.LIMITED`."""

    def __post_init__(self) -> None:
        _ = self._si, self.limits_si

    @classmethod
    def preset(cls, name: str) -> Crane:
        """A packaged crane by its name.

        Parameters
        ----------
        name : {"tg3637"}
            The Hägglunds crane of a T-ACS crane ship, with Kruse's three drives.

        Returns
        -------
        Crane
            With its geometry, limits and drives.

        Raises
        ------
        ParameterError
            For another name; the sentence lists those that there are.

        Examples
        --------
        >>> from swashplate.crane import Crane
        >>> Crane.preset("tg3637").safe_load  # kg
        35000.0
        """
        return _read(preset_text(name), f"crane {name}", Path())

    @classmethod
    def from_toml(cls, path: str | Path) -> Crane:
        """A crane from a file.

        Parameters
        ----------
        path : path
            The file. Paths of drives in it count from its folder.

        Returns
        -------
        Crane
            With the geometry, limits and drives of the file.

        Raises
        ------
        FileError
            If there is no such file, or it cannot be read.
        ParameterError
            If an entry is wrong; the sentence names file, entry and rule.

        Examples
        --------
        >>> from pathlib import Path
        >>> from swashplate.crane import Crane
        >>> from swashplate.crane.crane import preset_text
        >>> text = preset_text("tg3637").replace("tg3637", "mine")
        >>> Path("crane.toml").write_text(text, "utf-8") > 0
        True
        >>> Crane.from_toml("crane.toml").name
        'mine'
        """
        crane = _read(read_text(path), str(path), Path(path).parent)
        for name in packaged_names():
            packaged = cls.preset(name)
            checked = (
                (crane.quantities, packaged.quantities, GEOMETRY),
                (crane.limits, packaged.limits, DEFINITIONS),
            )
            for quantities, packaged_quantities, definitions in checked:
                check_sources(quantities, packaged_quantities, definitions, str(path), name)
        return crane

    def __repr__(self) -> str:
        drives = ", ".join(f"{axis} {getattr(self, axis).name!r}" for axis in AXES)
        return f"Crane({self.name!r}, {drives}; {self.assumed or 'no quantities'} assumed)"

    @property
    def assumed(self) -> str:
        """Assumed part of the geometry: ``"12 of 13 quantities"``, empty if nothing is assumed."""
        count = sum(quantity.status == "assumed" for quantity in self.quantities.values())
        return f"{count} of {len(self.quantities)} quantities" if count else ""

    def provenance(self) -> tuple[str, ...]:
        """State the origin of the drives, and what their tests left open, in sentences.

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

        Limits that were given another value since then are left out.
        """
        drive: Drive = getattr(self, axis)
        return drive.parameters.unreached_sentence(f"the {axis}'s drive")

    def with_drive(self, *, known_to_controller: bool = True, **drives: DriveLike) -> Crane:
        """The crane with other drives by axis.

        Parameters
        ----------
        known_to_controller : bool
            Whether the controller knows the new drives, as after a redesign. If not, it counts on
            the present drives, as if a drive has worn: inverse maps, the stick's full speed and the
            clip are theirs.
        **drives
            Each is a drive, ``luff=crane.luff.scale(Z16=1.5)``; the result of a fit; a packaged
            name; a parameter file; or the folder that a fit wrote. The verdict on a fit stands in
            `sources`; a drive that is not usable is taken, and assessments say so.

        Returns
        -------
        Crane
            A new crane; this one stays as it is.

        Raises
        ------
        InputError
            For an axis that a crane does not have.
        FileError, ParameterError
            If a drive's file cannot be read or a packaged name is unknown.

        Examples
        --------
        >>> from swashplate.crane import Crane
        >>> crane = Crane.preset("tg3637")
        >>> changed = crane.with_drive(luff=crane.luff.scale(Z16=1.5))
        >>> changed.luff == crane.luff.scale(Z16=1.5)
        True
        """
        check_names("A crane has no drive", drives, AXES, "it has")
        replacements, new_sources = drives_of(drives, Path())
        counted_on = {
            axis: drive
            for axis, drive in self.known_to_controller.items()
            if axis not in replacements
        }
        if not known_to_controller:
            for axis, drive in replacements.items():
                counted_drive = self.controller_drive(axis)
                if counted_drive != drive:
                    counted_on[axis] = counted_drive
        sources = {
            axis: source for axis, source in self.sources.items() if axis not in replacements
        }
        return replace(
            self,
            known_to_controller=counted_on,
            sources=sources | new_sources,
            **replacements,
        )

    def controller_drive(self, axis: str) -> Drive:
        """The drive of an axis that the controller counts on."""
        drive: Drive = self.known_to_controller.get(axis, getattr(self, axis))
        return drive

    def with_geometry(self, **changes: float | tuple[float, ...]) -> Crane:
        """The crane with other quantities.

        Parameters
        ----------
        **changes : float or tuple of float
            By name and in SI: ``boom_length=38.0``.

        Returns
        -------
        Crane
            A new crane, whose changed quantities are marked as the user's.

        Raises
        ------
        ParameterError
            For an unknown name, a value out of its plausible range, or lengths that make no crane.

        Examples
        --------
        >>> from swashplate.crane import Crane
        >>> Crane.preset("tg3637").with_geometry(boom_length=38.0).geometry.boom
        38.0
        """
        quantities = dict(self.quantities)
        for name, value in changes.items():
            if name not in GEOMETRY:
                raise ParameterError(f"A crane has no {name}; it has {', '.join(GEOMETRY)}.")
            quantities[name] = user_quantity(name, value)
        return replace(self, quantities=quantities)

    def with_limits(self, **limits: float) -> Crane:
        """The crane with other limits.

        Parameters
        ----------
        **limits : float
            By name of `swashplate.crane.LIMITED` and in SI: ``side_lead=0.07``.

        Returns
        -------
        Crane
            A new crane, whose other limits stay as they are.

        Raises
        ------
        ParameterError
            For an unknown name, or a value out of its plausible range.

        Examples
        --------
        >>> from swashplate.crane import Crane
        >>> Crane.preset("tg3637").with_limits(side_lead=0.07).limits_si["side_lead"]
        0.07
        """
        quantities = {
            name: CraneQuantity(
                value=float(value), unit=LIMITED[name].unit if name in LIMITED else "1"
            )
            for name, value in limits.items()
        }
        return replace(self, limits={**self.limits, **quantities})

    @cached_property
    def _si(self) -> dict[str, tuple[float, ...]]:
        """Quantities in SI; a `ParameterError` for those that make no crane."""
        return quantities_in_si(self.quantities, self.name)

    @cached_property
    def geometry(self) -> Geometry:
        """Lengths as the equations take them, in SI."""
        si = {name: values[0] for name, values in self._si.items()}
        return Geometry(
            boom=si["boom_length"],
            foot=si["foot_offset"],
            axis=vector_of(self._si["slew_axis"]),
            sheave=si["tower_sheave_distance"],
            sheave_cos=cos(si["tower_sheave_angle"]),
            sheave_sin=sin(si["tower_sheave_angle"]),
            hoist=si["hoist_drum_radius"] / si["hoist_falls"],
            luff=si["luff_drum_radius"] / si["luff_falls"],
            coupling=si["rope_coupling"],
        )

    @cached_property
    def limits_si(self) -> dict[str, float]:
        """Limits in SI, by name; a `ParameterError` for one that no crane has."""
        return limits_of(self.limits, self.name)

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

    @property
    def deck(self) -> Deck | None:
        """The ship's deck, if the crane's file has it."""
        values = self._si.get("deck")
        return None if values is None else Deck(*values)

    def inverse(self, axis: str) -> InverseMap:
        """Inverse map of the controller's drive of ``"hoist"``, ``"slew"`` or ``"luff"``."""
        return _inverse(self.controller_drive(axis))

    def home(self, slew_deg: float = 0.0, boom_deg: float = 45.0, rope_m: float = 20.0) -> Home:
        """Pose of the crane at the start of a run.

        Parameters
        ----------
        slew_deg : float
            From forward to starboard, within 720. [deg]
        boom_deg : float
            Elevation of the boom. [deg]
        rope_m : float
            Rope below the tip. [m]

        Returns
        -------
        Home
            Slew [rad], rope of the luff [m] and rope below the tip [m].

        Raises
        ------
        InputError
            If slew, boom or rope are beyond the crane's limits.

        Examples
        --------
        >>> from swashplate.crane import Crane
        >>> Crane.preset("tg3637").home(rope_m=25.0).rope
        25.0
        """
        low, high = map(degrees, self.boom_limits)
        if not low - 1e-9 <= boom_deg <= high + 1e-9:
            raise InputError(
                f"The boom of {self.name} is at {boom_deg:g} deg, but moves between {low:g} and "
                f"{high:g} deg."
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

    def table(self) -> Table:
        """Geometry with status and source; what is assumed is marked."""
        names = {name: name.replace("_", " ") for name in self.quantities}
        return _table(self.title or self.name, self.quantities, names)

    def limit_table(self) -> Table:
        """Limits with status and source; what is assumed is marked."""
        names = {name: limited.label for name, limited in LIMITED.items()}
        return _table("Limits of an operation", self.limits, names)


def _table(title: str, quantities: Mapping[str, CraneQuantity], names: Mapping[str, str]) -> Table:
    """Quantities with unit, status and source; the rows of assumed ones are marked.

    `names` are the names to show, by the keys of the quantities.
    """
    columns = (
        Column("quantity"),
        Column("value"),
        Column("unit"),
        Column("status"),
        Column("source", wrap=True),
    )
    table = Table(title, columns)
    for key, quantity in quantities.items():
        table.add(
            names[key],
            ", ".join(f"{number:g}" for number in quantity.values),
            quantity.unit,
            quantity.status,
            quantity.source,
            look=quantity.status == "assumed",
        )
    return table


@lru_cache(maxsize=512)
def _inverse(drive: Drive) -> InverseMap:
    return inverse_map(drive)


SETS = files("swashplate.crane") / "sets"


def packaged_names() -> list[str]:
    """Names of the packaged cranes."""
    names = (entry.name for entry in SETS.iterdir())
    return sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))


def preset_text(name: str) -> str:
    """The file of a packaged crane."""
    names = packaged_names()
    if name not in names:
        raise ParameterError(f"There is no packaged crane '{name}'; there is {', '.join(names)}.")
    return (SETS / f"{name}.toml").read_text("utf-8")


def _geometry_of(content: CraneFile, origin: str) -> dict[str, CraneQuantity]:
    """All quantities of a crane's file; refuses a name that is missing or unknown."""
    quantities = {**DEFAULTS, **content.geometry}
    missing = [name for name in GEOMETRY if name not in quantities and name not in MAY_LACK]
    unknown = [name for name in content.geometry if name not in GEOMETRY]
    if missing or unknown:
        extra = f", and has no entry '{unknown[0]}'" if unknown else ""
        need = f"needs an entry '{missing[0]}'" if missing else f"has {len(GEOMETRY)} quantities"
        raise ParameterError(f"{origin}: geometry {need}{extra}.")
    return {name: quantities[name] for name in GEOMETRY if name in quantities}


def _read(text: str, origin: str, folder: Path) -> Crane:
    """A crane of a file's text; paths of its drives count from a folder."""
    content = validated(parse_toml(text, origin), CraneFile, origin)
    quantities = _geometry_of(content, origin)
    quantities_in_si(quantities, origin)
    limits_of(content.limits, origin)
    drives, sources = drives_of(content.drives, folder)
    return Crane(
        name=content.name,
        title=content.title,
        quantities=quantities,
        **drives,
        sources=sources,
        limits=content.limits,
    )
