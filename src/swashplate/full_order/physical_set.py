"""Physical sets: arms, springs, masses, areas, oil and load of one machine, always valid.

The quantities are those that `swashplate.models.machine.Machine` declares. A set is given whole, or
completed from lumped parameters and a few chosen values; TOML files have either.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import cache
from importlib.resources import files
from math import pi, sqrt, tan
from pathlib import Path
from types import MappingProxyType
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict

from swashplate.documents import parse_toml, read_text, validated
from swashplate.equations.equation import interpreted
from swashplate.equations.fields import Flag, declared_by
from swashplate.errors import InputError, ParameterError
from swashplate.models import machine as equations
from swashplate.models.machine import Machine
from swashplate.parameters.definitions import Definition, definition_of
from swashplate.parameters.files import AXES, Entry, parameter_of, written
from swashplate.parameters.files import load_preset as load_parameters
from swashplate.parameters.parameter_set import (
    Change,
    HasParameters,
    Pair,
    Parameter,
    ParameterSet,
    Value,
    set_of,
    value_of,
)
from swashplate.parameters.rules import out_of_range, range_sentence
from swashplate.tables import Column, Table
from swashplate.units import chosen_unit, unit_text

QUANTITIES: Mapping[str, Definition] = {
    each.symbol: definition_of(each, "physical") for each in declared_by(Machine)
}
"""Quantities by name, from the spool to the load."""
CHOICES: Mapping[str, Definition] = {
    name: Definition(
        meaning, unit, 0.0, above=above, stands_for=stands_for, symbol=name, block="physical"
    )
    for name, stands_for, meaning, unit, above in (
        ("spool_frequency", "ω_sp", "natural frequency of the spool", "rad/s", 0.0),
        ("spool_damping_ratio", "ζ_sp", "damping ratio of the spool", "1", None),
        (
            *("swash_frequency", "ω_sw"),
            *("natural frequency of the swash plate at held pressure", "rad/s", 0.0),
        ),
        ("swash_damping_ratio", "ζ_sw", "damping ratio of the swash plate", "1", None),
    )
}
"""What may be chosen in place of inertias and dampings when a set is completed."""
IN_PLACE_OF: Mapping[str, str] = {
    "feedback_arm_inertia": "spool_frequency",
    "spool_damping": "spool_damping_ratio",
    "swash_inertia": "swash_frequency",
    "piston_damping": "swash_damping_ratio",
}
"""Quantities that may be chosen in place of a frequency or a damping ratio."""
AGREES = 1e-9  # Relative difference up to which a given value agrees with the one that follows.


@dataclass(frozen=True)
class PhysicalSet(Mapping[str, Parameter]):
    """All physical quantities of a drive, by name; one that has a default may be left out.

    Raises
    ------
    ParameterError
        On creation, if a quantity is missing or breaks a rule; the sentence names it.
    """

    name: str
    title: str
    entries: Mapping[str, Parameter]
    numbers: Mapping[str, float] = field(init=False, repr=False, compare=False)
    """Every single value by column, e.g. ``swash_stop_plus``."""

    def __post_init__(self) -> None:
        for name in self.entries:
            quantity_of(name)
        entries = {
            name: Parameter(each, each.default, status="assumed")
            for name, each in QUANTITIES.items()
            if each.default is not None
        } | dict(self.entries)
        missing = [name for name in QUANTITIES if name not in entries]
        if missing:
            raise ParameterError(f"{self.name}: no value for {', '.join(missing)}.")
        ordered = {name: entries[name] for name in QUANTITIES}
        numbers: dict[str, float] = {}
        for entry in ordered.values():
            _check_range(self.name, entry)
            numbers |= zip(entry.definition.columns, entry.values, strict=True)
        _check_together(self.name, numbers)
        object.__setattr__(self, "entries", MappingProxyType(ordered))
        object.__setattr__(self, "numbers", MappingProxyType(numbers))

    @classmethod
    def preset(cls, name: str) -> PhysicalSet:
        """An assumed set of one of Kruse's axes: ``"hoist"``, ``"slew"``, ``"luff"``."""
        return _set_of(_packaged(name), f"{name}.toml")

    @classmethod
    def from_toml(cls, path: str | Path) -> PhysicalSet:
        """A set from a file; a `ParameterError` names file, quantity and rule."""
        origin = str(path)
        return _set_of(validated(parse_toml(read_text(path), origin), PhysicalFile, origin), origin)

    def to_toml(self, path: str | Path) -> None:
        """Store all quantities; `from_toml` gives an equal set back.

        If the file cannot be written (`FileError`), an older one stays as it was.
        """
        from tomlkit import comment, document, dumps, table

        from swashplate.tables import write_text

        text, entries = document(), table()
        text.add(comment("swashplate physical set; SI units; [plus, minus] as magnitudes"))
        for name, value in (("format", 1), ("name", self.name), ("title", self.title)):
            text.add(name, value)
        for name, each in self.items():
            entries.add(name, written(each))
        text.add("physical", entries)
        write_text(dumps(text), path)

    @property
    def machine(self) -> Machine:
        """The quantities as the equations take them."""
        return Machine(**self.numbers)

    @property
    def air(self) -> Flag:
        """Whether there is free air in the oil, as an option of the equations."""
        return air_in(self.numbers)

    def to_lumped(self, Z6: float | None = None) -> dict[str, Change]:
        """Lumped parameters that the set stands for; Kruse eqs. 6.56-6.70 and table 6.1.

        Z1 to Z16 and Z18 by symbol, pairs (plus, minus) where the directions differ; the solenoids'
        Z17 and Z19 to Z22 are not the pump's geometry. `Z6` is where to move to along the gauge
        Z6↔Z8: away from the stops only Z7/(1+Z6) and Z8/(1+Z6) count; by default the physical
        A_s²B/(k_r V).
        """
        n, P0 = self.numbers, rest_pressure(self.numbers)
        stiffness = rest_modulus(n) / n["oil_volume"]
        own = n["piston_area"] ** 2 * stiffness / n["return_spring_rate"]
        gauge = 1.0 if Z6 is None else (1.0 + Z6) / (1.0 + own)
        spring_moment = n["feedback_spring_rate"] * n["feedback_spring_arm"] ** 2
        accelerating = n["motor_leakage"] * n["motor_constant"] * n["pump_flow_gain"]
        return {
            "Z1": n["piston_area"] / (n["return_spring_rate"] * n["swash_arm"]),
            # K_mf C_g A_p d5/(k_r d4²) - Z1 P0, which the definition of P0 makes zero (erratum 20)
            "Z2": 0.0,
            "Z3": n["swash_arm"] / n["control_arm"],
            "Z4": spring_moment**2,
            "Z5": n["spool_arm"],
            "Z6": own if Z6 is None else Z6,
            "Z7": n["piston_leakage"] * stiffness * gauge,
            "Z8": n["valve_flow_gain"] * stiffness * gauge,
            "Z9": n["supply_pressure"] - P0,
            "Z10": n["motor_constant"] * n["pump_flow_gain"],
            "Z11": n["motor_leakage"] * n["load_torque"] + 0.0,  # not -0
            "Z12": accelerating * n["load_inertia"],
            "Z13": Pair(n["swash_stop_plus"], n["swash_stop_minus"]),
            "Z14": n["spool_stroke"],
            "Z15": n["relief_pressure"],
            "Z16": Pair(n["orifice_opening_plus"], n["orifice_opening_minus"]),
            "Z18": n["plussing"],
        }

    def __repr__(self) -> str:
        return f"PhysicalSet({self.name!r}, {len(self)} quantities)"

    def __getitem__(self, name: str) -> Parameter:
        quantity_of(name)
        return self.entries[name]

    def __contains__(self, name: object) -> bool:
        return name in self.entries

    def __iter__(self) -> Iterator[str]:
        return iter(self.entries)

    def __len__(self) -> int:
        return len(self.entries)

    def __hash__(self) -> int:
        return hash((self.name, *self.numbers.values()))

    def __reduce__(self) -> tuple[object, ...]:
        # read-only views cannot be pickled, so a copy in another process is built anew
        return PhysicalSet, (self.name, self.title, dict(self.entries))

    def replace(self, **changes: Change) -> PhysicalSet:
        """A set with other values in SI, ``replace(load_torque=2e3)``, marked as the user's."""
        entries = dict(self.entries)
        for name, change in changes.items():
            quantity = quantity_of(name)
            entries[name] = Parameter(quantity, value_of(name, quantity, change))
        return replace(self, entries=entries)


def quantity_of(name: str) -> Definition:
    """What a quantity is; a name that none has is refused."""
    if name in QUANTITIES:
        return QUANTITIES[name]
    close = get_close_matches(name, QUANTITIES, n=1)
    hint = f" (did you mean {close[0]}?)" if close else ""
    choice = (
        "; it is chosen only where a set is completed from lumped parameters"
        if name in CHOICES
        else f"{hint}; the quantities are {', '.join(QUANTITIES)}"
    )
    raise ParameterError(f"A physical set has no quantity '{name}'{choice}.")


def air_in(numbers: Mapping[str, float]) -> Flag:
    """Whether there is free air in the oil."""
    return True if numbers.get("air_fraction", 0.0) > 0.0 else None


def rest_pressure(numbers: Mapping[str, float]) -> float:
    """P0, which holds the load with the plate upright; see `machine.static_pressure`. [Pa]"""
    return float(interpreted(equations.static_pressure)(_machine_of(numbers)))


def rest_modulus(numbers: Mapping[str, float]) -> float:
    """Bulk modulus of the oil at that pressure. [Pa]"""
    machine, air = _machine_of(numbers), air_in(numbers)
    return float(interpreted(equations.oil_modulus)(rest_pressure(numbers), machine, air))


def _machine_of(numbers: Mapping[str, float]) -> Machine:
    """A machine of what is known; nothing else may be asked of it."""
    return Machine(*(numbers.get(name, 0.0) for name in Machine._fields))


def _check_range(owner: str, entry: Parameter) -> None:
    for column, value in zip(entry.definition.columns, entry.values, strict=True):
        if out_of_range(entry.definition, np.array([value]))[0]:
            said = range_sentence(column, entry.definition, np.array([value]), 0)
            raise ParameterError(f"{owner}: {said}")


def _check_together(owner: str, numbers: Mapping[str, float]) -> None:
    """What quantities must satisfy together."""
    for side in ("plus", "minus"):
        stop = numbers[f"swash_stop_{side}"]
        sine = numbers["swash_arm"] / numbers["control_arm"] * tan(stop)
        if not sine < 1.0:
            raise ParameterError(
                f"{owner}: swash_arm/control_arm·tan swash_stop_{side} is {sine:.4g}, but must be "
                "below 1: at its stop the swash plate would turn the feedback arm past 90°."
            )
    pressure = rest_pressure(numbers)
    ceiling = min(numbers["supply_pressure"], numbers["relief_pressure"])
    if not abs(pressure) < ceiling:
        raise ParameterError(
            f"{owner}: the load holds a stroking pressure of {pressure:.4g} Pa at rest, but it "
            f"must stay below {ceiling:.4g} Pa, the smaller of supply_pressure and "
            "relief_pressure; check load_torque, pumping_area and pumping_arm."
        )


# --- completed from lumps -------------------------------------------------------------------------


def chosen_over(
    assumed: Mapping[str, Parameter], chosen: Mapping[str, Change | Parameter]
) -> dict[str, Parameter]:
    """What a set is completed from: assumed values, and the user's in SI in their place.

    Names are those of quantities and of `CHOICES`. An inertia or damping also takes the place of
    the frequency or damping ratio that it would otherwise follow from.
    """
    entries = dict(assumed)
    for name, change in chosen.items():
        if not isinstance(change, Parameter):
            quantity = chosen_quantity(name)
            change = Parameter(quantity, value_of(name, quantity, change))
        entries[name] = change
        instead = IN_PLACE_OF.get(name)
        if instead is not None and instead not in chosen:
            entries.pop(instead, None)
    return entries


def chosen_quantity(name: str) -> Definition:
    """What may be chosen by a name: a quantity, or one of `CHOICES`."""
    return CHOICES[name] if name in CHOICES else quantity_of(name)


def from_lumped(
    lumped: ParameterSet | HasParameters,
    like: str | None = None,
    *,
    name: str | None = None,
    title: str = "",
    entries: Mapping[str, Change | Parameter] | None = None,
    **chosen: Change,
) -> PhysicalSet:
    """Complete a physical set from lumped parameters and a few chosen values.

    Parameters
    ----------
    lumped : ParameterSet or Drive
        The lumped parameters that the set shall have, Z6 apart.
    like : str, optional
        Packaged set whose assumed values count where nothing is chosen; by default see
        `nearest_set`.
    name, title : str, optional
        Of the set; by default the parameters' name.
    **chosen : float or (float, float)
        Chosen values in SI: those that packaged sets assume, or any other quantity: an inertia or
        damping in place of a frequency or damping ratio, or one that follows from the lumps, which
        must then agree with them.
    entries : mapping, optional
        The same, also with source and status.

    Returns
    -------
    PhysicalSet
        Everything but what the user chose is marked as assumed.

    Raises
    ------
    ParameterError
        If lumps contradict each other or a chosen value; the sentence names them.
    """
    parameters = set_of(lumped)
    owner = parameters.name if name is None else name
    assumed = _entries(_packaged(nearest_set(parameters.name) if like is None else like))
    given = chosen_over(assumed, {**(entries or {}), **chosen})
    for made_from, choice in IN_PLACE_OF.items():
        if made_from in given and choice in given:
            raise ParameterError(
                f"{owner}: {made_from} and {choice} are both given, but either follows from the "
                "other; leave one out."
            )
    numbers: dict[str, float] = {}
    for entry in given.values():
        _check_range(owner, entry)
        numbers |= zip(entry.definition.columns, entry.values, strict=True)
    following = _completed(owner, parameters.numbers, numbers, set(given))
    complete = {}
    for symbol, (follows, origin) in following.items():
        made = Parameter(QUANTITIES[symbol], follows, f"from {origin}", "assumed")
        if symbol in given:
            _check_agreement(owner, given[symbol], made)
        complete[symbol] = given.get(symbol, made)
    rest = {symbol: entry for symbol, entry in given.items() if symbol in QUANTITIES}
    return PhysicalSet(owner, title, {**rest, **complete})


def _completed(
    owner: str, Z: Mapping[str, float], chosen: dict[str, float], given: set[str]
) -> dict[str, tuple[Value, str]]:
    """Quantities that follow from the lumps and what is chosen, and from which."""
    if Z["Z2"] != 0.0:
        raise ParameterError(
            f"{owner}: Z2 is {Z['Z2']:g}, but a physical set has Z2 = 0, because the pressure is "
            "counted from the one that holds the load (eq. 6.56)."
        )
    arm, area = chosen["swash_arm"], chosen["piston_area"]
    supply = Z["Z9"] + rest_pressure(chosen)
    stiffness = rest_modulus({**chosen, "supply_pressure": supply}) / chosen["oil_volume"]
    spring_rate = area / (Z["Z1"] * arm)
    gauge = (1.0 + area**2 * stiffness / spring_rate) / (1.0 + Z["Z6"]) / stiffness
    spring_moment, oil = Z["Z4"] ** 0.5, "oil_volume and bulk_modulus"
    made: dict[str, tuple[Value, str]] = {
        "spool_arm": (Z["Z5"], "Z5"),
        "feedback_spring_rate": (
            spring_moment / chosen["feedback_spring_arm"] ** 2,
            "√Z4 and feedback_spring_arm",
        ),
        "control_arm": (arm / Z["Z3"], "Z3 and swash_arm"),
        "plussing": (Z["Z18"], "Z18"),
        "spool_stroke": (Z["Z14"], "Z14"),
        "orifice_opening": (Pair(Z["Z16_plus"], Z["Z16_minus"]), "Z16"),
        "valve_flow_gain": (Z["Z8"] * gauge, f"Z8/(1+Z6), {oil}"),
        "piston_leakage": (Z["Z7"] * gauge, f"Z7/(1+Z6), {oil}"),
        "supply_pressure": (supply, "Z9 and load_torque"),
        "relief_pressure": (Z["Z15"], "Z15"),
        "return_spring_rate": (spring_rate, "Z1, piston_area and swash_arm"),
        "swash_stop": (Pair(Z["Z13_plus"], Z["Z13_minus"]), "Z13"),
        "pump_flow_gain": (Z["Z10"] / chosen["motor_constant"], "Z10 and motor_constant"),
        "motor_leakage": (
            _motor_leakage(owner, Z, chosen),
            "Z11 and Z12, load_torque and load_inertia",
        ),
    }
    # of both modes: inertia, damping, mass at an arm, stiffness of the spring in the angle
    for inertia, damping, mass, at, spring, origin in (
        (
            *("feedback_arm_inertia", "spool_damping", "spool_mass on spool_arm"),
            *(Z["Z5"], spring_moment, "Z4, Z5, spool_frequency and spool_mass"),
        ),
        (
            *("swash_inertia", "piston_damping", "piston_mass on swash_arm"),
            *(arm, spring_rate * arm**2),
            "Z1, swash_frequency, piston_area, swash_arm and piston_mass",
        ),
    ):
        lever = chosen[mass.partition(" ")[0]] * at**2
        if inertia not in given:
            frequency = IN_PLACE_OF[inertia]
            total = spring / chosen[frequency] ** 2
            if lever > total:
                raise ParameterError(
                    f"{owner}: {mass} alone has {lever:.4g} kg m², but {frequency} leaves "
                    f"{total:.4g} kg m² for everything that swings with it; choose a smaller mass "
                    "or a lower frequency."
                )
            chosen[inertia] = total - lever
            made[inertia] = total - lever, origin
        if damping not in given:
            swinging = sqrt(spring * (chosen[inertia] + lever))
            ratio = IN_PLACE_OF[damping]
            made[damping] = 2.0 * chosen[ratio] * swinging / at**2, ratio
    return made


def _motor_leakage(owner: str, Z: Mapping[str, float], chosen: Mapping[str, float]) -> float:
    """K_mL from Z11 = K_mL C_g and Z12 = K_mL Z10 C_i, which must agree."""
    losses = {
        "Z11": (Z["Z11"], chosen["load_torque"], "load_torque"),
        "Z12": (Z["Z12"], Z["Z10"] * chosen["load_inertia"], "load_inertia"),
    }
    leakages = []
    for symbol, (loss, load, cause) in losses.items():
        if load != 0.0:
            leakages.append(loss / load)
        elif loss != 0.0:
            raise ParameterError(
                f"{owner}: {symbol} is {loss:g}, but without {cause} no speed is lost to it; "
                f"choose {cause}, or set {symbol} to 0."
            )
    if len(leakages) == 2 and abs(leakages[0] - leakages[1]) > AGREES * abs(leakages[0]):
        raise ParameterError(
            f"{owner}: Z11 makes motor_leakage {leakages[0]:.6g} 1/(N m s), but Z12 makes it "
            f"{leakages[1]:.6g}; choose load_torque and load_inertia so that both agree, for "
            f"example load_inertia = {Z['Z12'] / (Z['Z10'] * leakages[0]):.12g} kg m²."
        )
    return leakages[0] if leakages else 0.0


def _check_agreement(owner: str, entry: Parameter, made: Parameter) -> None:
    columns = entry.definition.columns
    for column, value, follows in zip(columns, entry.values, made.values, strict=True):
        if value != follows and not abs(value - follows) <= AGREES * abs(follows):
            raise ParameterError(
                f"{owner}: {column} is given as {value:.9g} {entry.unit}, but "
                f"{follows:.9g} follows {made.source}; leave it out or change one of these."
            )


# --- files ----------------------------------------------------------------------------------------


class PhysicalFile(BaseModel):
    """A physical set; with `lumps`, what is not given follows from a packaged parameter set."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = 1
    name: str
    title: str = ""
    lumps: str | None = None
    physical: dict[str, Entry]


@cache
def _packaged(name: str) -> PhysicalFile:
    if name not in AXES:
        raise ParameterError(
            f"There is no packaged physical set '{name}'; there are {', '.join(AXES)}."
        )
    text = files("swashplate.full_order").joinpath("sets", f"{name}.toml").read_text("utf-8")
    return validated(parse_toml(text, f"{name}.toml"), PhysicalFile, f"{name}.toml")


def nearest_set(name: str) -> str:
    """Name of the packaged set that a drive of this name is taken to be like: its own, or hoist."""
    return name if name in AXES else AXES[0]


def _set_of(contents: PhysicalFile, origin: str) -> PhysicalSet:
    try:
        entries = _entries(contents)
        if contents.lumps is None:
            return PhysicalSet(contents.name, contents.title, entries)
        parameters = load_parameters(contents.lumps)
        return from_lumped(parameters, name=contents.name, title=contents.title, entries=entries)
    except (ParameterError, InputError) as error:
        raise ParameterError(f"{origin}: {error}") from None


def _entries(contents: PhysicalFile) -> dict[str, Parameter]:
    known = quantity_of if contents.lumps is None else chosen_quantity
    for name, entry in contents.physical.items():
        if entry.bounds is not None:
            raise ParameterError(f"{name} has bounds; leave them out, a fit is given its own.")
    return {name: parameter_of(known(name), entry) for name, entry in contents.physical.items()}


# --- for people -----------------------------------------------------------------------------------

SHOWN = {
    "kg": ("g", 1e3),
    "m": ("mm", 1e3),
    "m^2": ("cm²", 1e4),
    "m^3": ("cm³", 1e6),
    "Pa": ("MPa", 1e-6),
    "rad/s": ("Hz", 0.5 / pi),
}
"""Unit that people read a physical value in and the factor to it, by SI unit, unless chosen."""


def choices_table(axis: str, given: Mapping[str, Change]) -> Table:
    """What a physical set is completed from: assumed values, and given ones, counted."""
    columns = (Column("Physical value"), Column("", "s"), Column(""), Column(""))
    made = Table("What the drive's parameters do not say", columns)
    entries = chosen_over(_entries(_packaged(axis)), given)
    for name, entry in entries.items():
        unit, factor = SHOWN.get(entry.unit, (unit_text(entry.unit), 1.0))
        if chosen_unit(entry.unit).factor != 1.0:
            unit, factor = chosen_unit(entry.unit)
        numbers = "/".join(f"{factor * value:.5g}" for value in entry.values)
        made.add(name, numbers, unit, "given" if entry.status == "user" else "assumed")
    assumed = sum(entry.status != "user" for entry in entries.values())
    if assumed:
        made.caption = (
            f"{assumed} of {len(entries)} physical values are assumed, as of the packaged {axis}; "
            "--physical gives what you know"
        )
    return made
