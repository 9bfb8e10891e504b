"""Physical sets from lumped parameters and a few chosen values, and from and to TOML files."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from math import sqrt
from types import MappingProxyType
from typing import Literal

from pydantic import BaseModel, ConfigDict

from swashplate.documents import parse_toml, validated
from swashplate.equations.fields import Declared
from swashplate.errors import InputError, ParameterError
from swashplate.full_order.physical_set import (
    AGREES,
    CHOICES,
    QUANTITIES,
    PhysicalSet,
    PhysicalValue,
    quantity_of,
    rest_modulus,
    rest_pressure,
    value_of,
)
from swashplate.parameters.files import AXES
from swashplate.parameters.files import load_preset as load_parameters
from swashplate.parameters.parameter_set import Change, Pair, ParameterSet, Value
from swashplate.parameters.schema import Entry
from swashplate.units import to_si

ASSUMED: Mapping[str, float] = {
    "feedback_spring_arm": 0.03,
    "spool_mass": 0.01,
    "spool_frequency": 251.32741228718345,  # 40 Hz, which the source states for both modes
    "spool_damping_ratio": 0.3,
    "oil_volume": 2e-4,
    "bulk_modulus": 1e9,
    "piston_area": 2.8274333882308137e-3,  # 60 mm across
    "swash_arm": 0.08,
    "piston_mass": 0.4,
    "swash_frequency": 251.32741228718345,
    "swash_damping_ratio": 0.3,
    "pumping_area": 5e-4,
    "pumping_arm": 0.002,
    "motor_constant": 250.3261078557604,  # 25.1 l a turn
    "load_inertia": 0.0,
    "load_torque": 0.0,
}
"""What `from_lumped` chooses where nothing else is given."""

IN_PLACE_OF: Mapping[str, str] = {
    "feedback_arm_inertia": "spool_frequency",
    "spool_damping": "spool_damping_ratio",
    "swash_inertia": "swash_frequency",
    "piston_damping": "swash_damping_ratio",
}
"""Quantities that may be chosen in place of a frequency or a damping ratio."""


def chosen_quantity(name: str) -> Declared:
    """What may be chosen by a name: a quantity, or one of `CHOICES`."""
    return CHOICES[name] if name in CHOICES else quantity_of(name)


def chosen_over(
    assumed: Mapping[str, PhysicalValue], chosen: Mapping[str, Change]
) -> dict[str, PhysicalValue]:
    """What a set is completed from: assumed values, and the user's in their place.

    Parameters
    ----------
    assumed : mapping
        Values by the names that `from_lumped` takes.
    chosen : mapping of str to float or (float, float)
        The user's values in SI, by the same names. An inertia or damping also takes the place of
        the frequency or damping ratio that it would otherwise follow from.

    Raises
    ------
    ParameterError
        For an unknown name or a value of another form.
    """
    entries = dict(assumed)
    for name, change in chosen.items():
        quantity = chosen_quantity(name)
        entries[name] = PhysicalValue(quantity, value_of(quantity, change))
        instead = IN_PLACE_OF.get(name)
        if instead is not None and instead not in chosen:
            entries.pop(instead, None)
    return entries


def from_lumped(
    parameters: ParameterSet,
    *,
    name: str | None = None,
    title: str = "",
    entries: Mapping[str, PhysicalValue] | None = None,
    **chosen: Change,
) -> PhysicalSet:
    """Complete a physical set from lumped parameters and a few chosen values.

    Parameters
    ----------
    parameters : ParameterSet
        The lumped parameters that the set shall have, Z6 apart.
    name, title : str, optional
        Of the set; by default the parameters' name.
    entries : mapping, optional
        Chosen values with source and status.
    **chosen : float or (float, float)
        Chosen values in SI by name. Names are those of `ASSUMED`, whose values count where nothing
        is given, or any other quantity: an inertia or damping in place of a frequency or damping
        ratio, or one that follows from the lumps, which must then agree with them.

    Returns
    -------
    PhysicalSet
        Everything but what the user chose is marked as assumed.

    Raises
    ------
    ParameterError
        If lumps contradict each other or a chosen value; the sentence names them.
    """
    owner = parameters.name if name is None else name
    given = chosen_over(entries or {}, chosen)
    for made_from, choice in IN_PLACE_OF.items():
        if made_from in given and choice in given:
            raise ParameterError(
                f"{owner}: {made_from} and {choice} are both given, but either follows from the "
                "other; leave one out."
            )
    numbers = {**ASSUMED}
    for entry in given.values():
        entry.check(owner)
        numbers |= zip(entry.quantity.columns, entry.values, strict=True)
    following = _completed(owner, parameters.numbers, numbers, set(given))
    complete = {}
    for symbol, quantity in QUANTITIES.items():
        columns = quantity.columns
        if all(column in following for column in columns):
            made, why = [following[column] for column in columns], f"from {_ORIGINS[symbol]}"
        elif columns[0] not in numbers:  # left out, as its default has it
            continue
        else:
            made, why = [numbers[column] for column in columns], "assumed"
        if symbol in given:
            _check_agreement(owner, given[symbol], made, why)
            complete[symbol] = given[symbol]
        else:
            follows: Value = Pair(*made) if len(made) > 1 else made[0]
            complete[symbol] = PhysicalValue(quantity, follows, why, "assumed")
    return PhysicalSet(owner, title, complete)


_ORIGINS = {
    "spool_arm": "Z5",
    "feedback_spring_rate": "√Z4 and feedback_spring_arm",
    "control_arm": "Z3 and swash_arm",
    "plussing": "Z18",
    "spool_stroke": "Z14",
    "orifice_opening": "Z16",
    "valve_flow_gain": "Z8/(1+Z6), oil_volume and bulk_modulus",
    "piston_leakage": "Z7/(1+Z6), oil_volume and bulk_modulus",
    "supply_pressure": "Z9 and load_torque",
    "relief_pressure": "Z15",
    "return_spring_rate": "Z1, piston_area and swash_arm",
    "swash_stop": "Z13",
    "pump_flow_gain": "Z10 and motor_constant",
    "motor_leakage": "Z11 and Z12, load_torque and load_inertia",
    "feedback_arm_inertia": "Z4, Z5, spool_frequency and spool_mass",
    "spool_damping": "spool_damping_ratio",
    "swash_inertia": "Z1, swash_frequency, piston_area, swash_arm and piston_mass",
    "piston_damping": "swash_damping_ratio",
}


def _completed(
    owner: str, Z: Mapping[str, float], chosen: dict[str, float], given: set[str]
) -> dict[str, float]:
    """Quantities that follow from the lumps and what is chosen."""
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
    made = {
        "spool_arm": Z["Z5"],
        "feedback_spring_rate": Z["Z4"] ** 0.5 / chosen["feedback_spring_arm"] ** 2,
        "control_arm": arm / Z["Z3"],
        "plussing": Z["Z18"],
        "spool_stroke": Z["Z14"],
        "orifice_opening_plus": Z["Z16_plus"],
        "orifice_opening_minus": Z["Z16_minus"],
        "valve_flow_gain": Z["Z8"] * gauge,
        "piston_leakage": Z["Z7"] * gauge,
        "supply_pressure": supply,
        "relief_pressure": Z["Z15"],
        "return_spring_rate": spring_rate,
        "swash_stop_plus": Z["Z13_plus"],
        "swash_stop_minus": Z["Z13_minus"],
        "pump_flow_gain": Z["Z10"] / chosen["motor_constant"],
        "motor_leakage": _motor_leakage(owner, Z, chosen),
    }
    spring_moment, lever = Z["Z4"] ** 0.5, chosen["spool_mass"] * Z["Z5"] ** 2
    if "feedback_arm_inertia" not in given:
        chosen["feedback_arm_inertia"] = made["feedback_arm_inertia"] = _remaining_inertia(
            owner,
            spring_moment / chosen["spool_frequency"] ** 2,
            lever,
            "spool_mass on spool_arm",
            "spool_frequency",
        )
    if "spool_damping" not in given:
        swinging = sqrt(spring_moment * (chosen["feedback_arm_inertia"] + lever))
        made["spool_damping"] = 2.0 * chosen["spool_damping_ratio"] * swinging / Z["Z5"] ** 2
    plate_spring, lever = spring_rate * arm**2, chosen["piston_mass"] * arm**2
    if "swash_inertia" not in given:
        chosen["swash_inertia"] = made["swash_inertia"] = _remaining_inertia(
            owner,
            plate_spring / chosen["swash_frequency"] ** 2,
            lever,
            "piston_mass on swash_arm",
            "swash_frequency",
        )
    if "piston_damping" not in given:
        swinging = sqrt(plate_spring * (chosen["swash_inertia"] + lever))
        made["piston_damping"] = 2.0 * chosen["swash_damping_ratio"] * swinging / arm**2
    return made


def _remaining_inertia(owner: str, total: float, part: float, what: str, frequency: str) -> float:
    if part > total:
        raise ParameterError(
            f"{owner}: {what} alone has {part:.4g} kg m², but {frequency} leaves {total:.4g} kg m² "
            "for everything that swings with it; choose a smaller mass or a lower frequency."
        )
    return total - part


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


def _check_agreement(owner: str, entry: PhysicalValue, made: list[float], why: str) -> None:
    for column, value, follows in zip(entry.quantity.columns, entry.values, made, strict=True):
        if value != follows and not abs(value - follows) <= AGREES * abs(follows):
            raise ParameterError(
                f"{owner}: {column} is given as {value:.9g} {entry.unit}, but "
                f"{follows:.9g} follows {why}; leave it out or change one of these."
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
def load_preset(name: str) -> PhysicalSet:
    """A packaged set.

    Raises
    ------
    ParameterError
        For an unknown name; the sentence lists the right ones.
    """
    return read_set(_packaged(name), f"{name}.toml")


@cache
def load_choices(name: str) -> Mapping[str, PhysicalValue]:
    """What a packaged set assumes; everything else in it follows from the lumps.

    Raises
    ------
    ParameterError
        For an unknown name; the sentence lists the right ones.
    """
    origin = f"{name}.toml"
    contents = validated(parse_toml(_packaged(name), origin), PhysicalFile, origin)
    return MappingProxyType(_entries(contents))


def nearest_set(name: str) -> str:
    """Name of the packaged set that a drive of this name is taken to be like: its own, or hoist."""
    return name if name in AXES else AXES[0]


def _packaged(name: str) -> str:
    if name not in AXES:
        raise ParameterError(
            f"There is no packaged physical set '{name}'; there are {', '.join(AXES)}."
        )
    return files("swashplate.full_order").joinpath("sets", f"{name}.toml").read_text("utf-8")


def read_set(text: str, origin: str) -> PhysicalSet:
    """A physical set from TOML text; `origin` names it in errors."""
    contents = validated(parse_toml(text, origin), PhysicalFile, origin)
    try:
        entries = _entries(contents)
        if contents.lumps is None:
            return PhysicalSet(contents.name, contents.title, entries)
        parameters = load_parameters(contents.lumps)
        return from_lumped(parameters, name=contents.name, title=contents.title, entries=entries)
    except (ParameterError, InputError) as error:
        raise ParameterError(f"{origin}: {error}") from None


def dump_set(physical: PhysicalSet) -> str:
    """A physical set as TOML text that `read_set` turns back into an equal set."""
    from tomlkit import comment, document, dumps, inline_table, table

    text = document()
    text.add(comment("swashplate physical set; SI units; [plus, minus] as magnitudes"))
    text.add("format", 1)
    text.add("name", physical.name)
    text.add("title", physical.title)
    entries = table()
    for name, each in physical.items():
        entry = inline_table()
        pair = isinstance(each.value, Pair)
        entry.append("value", list(each.values) if pair else each.value)
        entry.append("unit", each.unit)
        if each.source:
            entry.append("source", each.source)
        entry.append("status", each.status)
        entries.add(name, entry)
    text.add("physical", entries)
    return dumps(text)


def si_value(quantity: Declared, number: float, unit: str) -> float:
    """A quantity's number in SI.

    Raises
    ------
    InputError
        If the unit is unknown or measures something else.
    """
    definition = quantity.definition
    return to_si(number, unit, definition.unit, f"{quantity.symbol} ({definition.name})")


def _entries(contents: PhysicalFile) -> dict[str, PhysicalValue]:
    completed = contents.lumps is not None
    return {name: _value(name, entry, completed) for name, entry in contents.physical.items()}


def _value(name: str, entry: Entry, completed: bool) -> PhysicalValue:
    """One entry of a file, in SI."""
    quantity = chosen_quantity(name) if completed else quantity_of(name)
    several = len(quantity.fields) > 1
    if entry.bounds is not None:
        raise ParameterError(f"{name} has bounds; leave them out, a fit is given its own.")
    given = entry.value if isinstance(entry.value, list) else [entry.value]
    if len(given) == 2 and not several:
        raise ParameterError(f"{name} has one value, not a plus and a minus one.")
    numbers = [si_value(quantity, number, entry.unit) for number in given]
    value = Pair(numbers[0], numbers[-1]) if several else numbers[0]
    return PhysicalValue(quantity, value, entry.source, entry.status)
