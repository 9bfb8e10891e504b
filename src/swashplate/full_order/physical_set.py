"""Physical sets: arms, springs, masses, areas, oil and load of one machine, always valid.

The quantities are those that `swashplate.models.machine.Hydrostat` declares. A set is given whole,
or completed from lumped parameters and a few chosen values.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import cache
from importlib.resources import files
from math import pi, sqrt
from typing import Any, NamedTuple

import numpy as np

from swashplate.documents import parse_toml, validated
from swashplate.entries import FormerlyFormat
from swashplate.errors import ParameterError, UnknownParameterError
from swashplate.machine import Definition, Flag
from swashplate.machine.fields import declared_by
from swashplate.machine.rules import CheckedRule, refuse
from swashplate.models import machine as equations
from swashplate.models.machine import Hydrostat
from swashplate.parameters import (
    AXES,
    Change,
    Entries,
    HasParameters,
    Pair,
    Parameter,
    ParameterEntry,
    ParameterRule,
    ParameterSet,
    Value,
    apply_rule,
    check_range,
    meant_value,
    parameter_of,
    set_of,
)
from swashplate.parameters import load_preset as load_parameters
from swashplate.tables import Column, Table
from swashplate.units import chosen_unit, unit_text

QUANTITIES: Mapping[str, Definition] = {
    definition.symbol: definition for definition in declared_by(Hydrostat)
}
"""Quantities by name, from the spool to the load."""
ALTERNATIVE_CHOICE: Mapping[str, str] = {
    "feedback_arm_inertia": "spool_frequency",
    "spool_damping": "spool_damping_ratio",
    "swash_inertia": "swash_frequency",
    "piston_damping": "swash_damping_ratio",
}
"""The quantity that may be chosen instead of an inertia or damping when a set is completed."""
CHOICES: Mapping[str, Definition] = {
    f"{part}_{what}": Definition(
        f"{meaning} of the {words}",
        unit,
        0.0,
        above=above,
        symbol=f"{part}_{what}",
    )
    for part, words in (("spool", "spool"), ("swash", "swash plate at held pressure"))
    for what, meaning, unit, above in (
        ("frequency", "natural frequency", "rad/s", 0.0),
        ("damping_ratio", "damping ratio", "1", None),
    )
}
"""What these are."""
AGREES = 1e-9  # Relative difference up to which a given value agrees with the one that follows.
ARM_TURNS = ParameterRule(
    lambda n: ~(n["arm_sine"] < 1.0),
    "swash_arm/control_arm·tan swash_stop_{side} is {arm_sine:.4g}, but must be below 1: at its "
    "stop the swash plate would turn the feedback arm past 90°.",
)
LOAD_HELD = ParameterRule(
    lambda n: ~(np.abs(n["rest"]) < n["ceiling"]),
    "the load holds a stroking pressure of {rest:.4g} Pa at rest, but it must stay below "
    "{ceiling:.4g} Pa, the smaller of supply_pressure and relief_pressure; check load_torque, "
    "pumping_area and pumping_arm.",
)


@dataclass(frozen=True)
class PhysicalSet(Entries):
    """All physical quantities of a drive, by name; one that has a default may be left out.

    Raises
    ------
    ParameterError
        On creation, if a quantity is missing or breaks a rule; the sentence names it.
    """

    name: str
    title: str
    parameters: Mapping[str, Parameter]
    numbers: Mapping[str, float] = field(init=False, repr=False, compare=False)
    """Every single value by column, e.g. ``swash_stop_plus``."""

    def __post_init__(self) -> None:
        for name in self.parameters:
            quantity_of(name)
        defaults = {
            name: Parameter(quantity, quantity.default, status="assumed")
            for name, quantity in QUANTITIES.items()
            if quantity.default is not None
        }
        parameters = defaults | dict(self.parameters)
        missing = [name for name in QUANTITIES if name not in parameters]
        if missing:
            raise ParameterError(f"{self.name}: no value for {', '.join(missing)}.")
        self._keep({name: parameters[name] for name in QUANTITIES})
        refuse(self.name, _check_rules(self))

    @classmethod
    def preset(cls, name: str) -> PhysicalSet:
        """An assumed set of one of Kruse's axes.

        Parameters
        ----------
        name : {"hoist", "slew", "luff"}
            The axis.

        Returns
        -------
        PhysicalSet
            Completed by `swashplate.full_order.from_lumped` so that it stands for the packaged
            lumps.

        Raises
        ------
        ParameterError
            For another name; the sentence lists those that there are.

        Examples
        --------
        >>> from swashplate import PhysicalSet
        >>> PhysicalSet.preset("hoist")
        PhysicalSet('hoist', 31 quantities)
        """
        title, _ = _assumed(name)
        return replace(from_lumped(load_parameters(name), name), title=title)

    @property
    def machine(self) -> Hydrostat:
        """The quantities as the equations take them."""
        return Hydrostat(**self.numbers)

    @property
    def air(self) -> Flag:
        """Whether there is free air in the oil, as an option of the equations."""
        return _air(self.machine)

    def to_lumped(self, Z6: float | None = None) -> dict[str, Change]:
        """Lumped parameters that the set stands for; Kruse eqs. 6.56-6.70 and table 6.1.

        Z1 to Z16 and Z18 by symbol, pairs (plus, minus) if the directions differ; the solenoids'
        Z17 and Z19 to Z22 are not the pump's geometry. `Z6` is where to move to along the gauge
        Z6↔Z8: away from the stops only Z7/(1+Z6) and Z8/(1+Z6) count; by default the physical
        A_s²B/(k_r V).
        """
        m = self.machine
        rest, stiffness = _rest(m)
        physical_Z6 = m.piston_area**2 * stiffness / m.return_spring_rate
        gauge = 1.0 if Z6 is None else (1.0 + Z6) / (1.0 + physical_Z6)
        accelerating = m.motor_leakage * m.motor_constant * m.pump_flow_gain
        return {
            "Z1": m.piston_area / (m.return_spring_rate * m.swash_arm),
            # K_mf C_g A_p d5/(k_r d4²) - Z1 P0, which the definition of P0 makes zero (erratum 20)
            "Z2": 0.0,
            "Z3": m.swash_arm / m.control_arm,
            "Z4": (m.feedback_spring_rate * m.feedback_spring_arm**2) ** 2,
            "Z5": m.spool_arm,
            "Z6": physical_Z6 if Z6 is None else Z6,
            "Z7": m.piston_leakage * stiffness * gauge,
            "Z8": m.valve_flow_gain * stiffness * gauge,
            "Z9": m.supply_pressure - rest,
            "Z10": m.motor_constant * m.pump_flow_gain,
            "Z11": m.motor_leakage * m.load_torque + 0.0,  # not -0
            "Z12": accelerating * m.load_inertia,
            "Z13": Pair(m.swash_stop_plus, m.swash_stop_minus),
            "Z14": m.spool_stroke,
            "Z15": m.relief_pressure,
            "Z16": Pair(m.orifice_opening_plus, m.orifice_opening_minus),
            "Z18": m.plussing,
        }

    def replace(self, **changes: Change) -> PhysicalSet:
        """A set with other values, marked as the user's.

        Parameters
        ----------
        **changes : float, Pint quantity, or a pair of them
            By name of the quantity, in SI or with a unit: ``load_torque=2e3``.

        Returns
        -------
        PhysicalSet
            A new set; this one stays as it is.

        Raises
        ------
        UnknownParameterError
            For a name that no quantity has.
        ParameterError
            For a value out of its plausible range, or that breaks a rule.

        Examples
        --------
        >>> from swashplate import PhysicalSet
        >>> PhysicalSet.preset("hoist").replace(load_torque=2e3)["load_torque"].value
        2000.0
        """
        changed = {
            name: Parameter(quantity_of(name), meant_value(name, quantity_of(name), change))
            for name, change in changes.items()
        }
        return replace(self, parameters={**self.parameters, **changed})

    def __getitem__(self, name: str) -> Parameter:
        quantity_of(name)
        return self.parameters[name]

    def __repr__(self) -> str:
        return f"PhysicalSet({self.name!r}, {len(self)} quantities)"

    def __hash__(self) -> int:
        return hash((self.name, *self.numbers.values()))


def quantity_of(name: str) -> Definition:
    """Definition of a quantity; refuses an unknown name."""
    if name in QUANTITIES:
        return QUANTITIES[name]
    close = get_close_matches(name, QUANTITIES, n=1)
    hint = f" (did you mean {close[0]}?)" if close else ""
    if name in CHOICES:
        advice = "; it is chosen only if a set is completed from lumped parameters"
    else:
        advice = f"{hint}; the quantities are {', '.join(QUANTITIES)}"
    raise UnknownParameterError(f"A physical set has no quantity '{name}'{advice}.")


def chosen_quantity(name: str) -> Definition:
    """Definition of a name that may be chosen: a quantity's, or one of `CHOICES`."""
    return CHOICES[name] if name in CHOICES else quantity_of(name)


def _air(machine: Hydrostat) -> Flag:
    return True if machine.air_fraction > 0.0 else None


def _rest(machine: Hydrostat) -> tuple[float, float]:
    """P0, which holds the load with the plate upright [Pa], and the oil's B/V there [Pa/m³]."""
    pressure = float(equations.static_pressure(machine))
    modulus = equations.oil_modulus(pressure, machine, _air(machine))
    return pressure, float(modulus) / machine.oil_volume


def _check_rules(parameters: Mapping[str, Parameter]) -> Iterator[CheckedRule]:
    """Rules of single quantities, and those of a whole set."""
    n: dict[str, Any] = {}
    for parameter in parameters.values():
        for column, value in parameter.numbers.items():
            n[column] = np.array([value])
            yield check_range(parameter.definition, column, n[column])
    if not n.keys() >= set(Hydrostat._fields):
        return  # not yet completed
    for side in ("plus", "minus"):
        arm_sine = n["swash_arm"] / n["control_arm"] * np.tan(n[f"swash_stop_{side}"])
        yield apply_rule(ARM_TURNS, {"side": side, "arm_sine": arm_sine})
    rest = equations.static_pressure(Hydrostat(**{k: float(v[0]) for k, v in n.items()}))
    ceiling = np.minimum(n["supply_pressure"], n["relief_pressure"])
    yield apply_rule(LOAD_HELD, {"rest": np.array([rest]), "ceiling": ceiling})


# --- completed from lumps -------------------------------------------------------------------------


def chosen_over(
    assumed: Mapping[str, Parameter], chosen: Mapping[str, Change | Parameter]
) -> dict[str, Parameter]:
    """Values that complete a set: assumed ones, replaced by the user's in SI.

    Names are those of quantities and of `CHOICES`. An inertia or damping also takes the place of
    the frequency or damping ratio that it would otherwise follow from.
    """
    entries = dict(assumed)
    for name, change in chosen.items():
        if not isinstance(change, Parameter):
            quantity = chosen_quantity(name)
            change = Parameter(quantity, meant_value(name, quantity, change))
        entries[name] = change
        if (instead := ALTERNATIVE_CHOICE.get(name)) is not None and instead not in chosen:
            entries.pop(instead, None)
    return entries


def from_lumped(
    lumped: ParameterSet | HasParameters,
    like: str | None = None,
    **chosen: Change | Parameter,
) -> PhysicalSet:
    """Complete a physical set from lumped parameters and a few chosen values.

    Parameters
    ----------
    lumped : ParameterSet or Drive
        The lumped parameters that the set shall have, except Z6.
    like : str, optional
        Packaged set whose assumed values count if nothing is chosen; by default see
        `nearest_set`.
    **chosen : float, (float, float) or Parameter
        Chosen values in SI: those that packaged sets assume, or any other quantity: an inertia or
        damping in place of a frequency or damping ratio, or one that follows from the lumps, which
        must then agree with them.

    Returns
    -------
    PhysicalSet
        Of the parameters' name; everything but what the user chose is marked as assumed.

    Raises
    ------
    ParameterError
        If lumps contradict each other or a chosen value; the sentence names them.
    """
    parameters = set_of(lumped)
    owner = parameters.name
    _, assumed = _assumed(nearest_set(parameters.name) if like is None else like)
    entries = chosen_over(assumed, chosen)
    for quantity, choice in ALTERNATIVE_CHOICE.items():
        if quantity in entries and choice in entries:
            raise ParameterError(
                f"{owner}: {quantity} and {choice} are both given, but each follows from the "
                "other; leave one out."
            )
    refuse(owner, _check_rules(entries))
    quantities = {name: entry for name, entry in entries.items() if name in QUANTITIES}
    numbers = {
        column: value for entry in entries.values() for column, value in entry.numbers.items()
    }
    for symbol, (value_of_lumps, origin) in _completed(owner, parameters.numbers, numbers).items():
        lumped_entry = Parameter(QUANTITIES[symbol], value_of_lumps, f"from {origin}", "assumed")
        entry = quantities.setdefault(symbol, lumped_entry)
        pairs = zip(entry.numbers.items(), lumped_entry.values, strict=True)
        for (column, value), expected in pairs:
            if value != expected and not abs(value - expected) <= AGREES * abs(expected):
                raise ParameterError(
                    f"{owner}: {column} is given as {value:.9g} {entry.unit}, but "
                    f"{expected:.9g} follows {lumped_entry.source}; leave it out or change one of "
                    "these."
                )
    return PhysicalSet(owner, parameters.title, quantities)


class SwingingPart(NamedTuple):
    """A part that turns against a spring, with a mass on an arm; the names of its quantities."""

    inertia: str
    damping: str
    mass: str
    arm_name: str
    arm: float
    """[m]"""
    stiffness: float
    """Of the spring, in the angle. [N m]"""
    origin: str
    """What its inertia follows from."""


def _completed(
    owner: str, Z: Mapping[str, float], chosen: Mapping[str, float]
) -> dict[str, tuple[Value, str]]:
    """Physical quantities that follow from lumped parameters Z and chosen values.

    By symbol: the value, and a text that names the parameters and values that it follows from.
    """
    if Z["Z2"] != 0.0:
        raise ParameterError(
            f"{owner}: Z2 is {Z['Z2']:g}, but a physical set has Z2 = 0, because the pressure is "
            "counted from the one that holds the load (eq. 6.56)."
        )
    # a machine of the chosen values only: fields that are not chosen are 0 and must not be read
    machine = Hydrostat(*(chosen.get(name, 0.0) for name in Hydrostat._fields))
    swash_arm = chosen["swash_arm"]
    area = chosen["piston_area"]
    oil = "oil_volume and bulk_modulus"
    supply = Z["Z9"] + _rest(machine)[0]
    _, stiffness = _rest(machine._replace(supply_pressure=supply))
    spring_rate = area / (Z["Z1"] * swash_arm)
    spring_moment = Z["Z4"] ** 0.5
    # lumped flows over (1 + Z6) are rates of pressure; this makes flows of them
    flow_scale = (1.0 + area**2 * stiffness / spring_rate) / (1.0 + Z["Z6"]) / stiffness
    completed: dict[str, tuple[Value, str]] = {
        "spool_arm": (Z["Z5"], "Z5"),
        "feedback_spring_rate": (
            spring_moment / chosen["feedback_spring_arm"] ** 2,
            "√Z4 and feedback_spring_arm",
        ),
        "control_arm": (swash_arm / Z["Z3"], "Z3 and swash_arm"),
        "plussing": (Z["Z18"], "Z18"),
        "spool_stroke": (Z["Z14"], "Z14"),
        "orifice_opening": (Pair(Z["Z16_plus"], Z["Z16_minus"]), "Z16"),
        "valve_flow_gain": (Z["Z8"] * flow_scale, f"Z8/(1+Z6), {oil}"),
        "piston_leakage": (Z["Z7"] * flow_scale, f"Z7/(1+Z6), {oil}"),
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
    spool = SwingingPart(
        inertia="feedback_arm_inertia",
        damping="spool_damping",
        mass="spool_mass",
        arm_name="spool_arm",
        arm=Z["Z5"],
        stiffness=spring_moment,
        origin="Z4, Z5, spool_frequency and spool_mass",
    )
    swash = SwingingPart(
        inertia="swash_inertia",
        damping="piston_damping",
        mass="piston_mass",
        arm_name="swash_arm",
        arm=swash_arm,
        stiffness=spring_rate * swash_arm**2,
        origin="Z1, swash_frequency, piston_area, swash_arm and piston_mass",
    )
    for part in (spool, swash):
        inertia_of_mass = chosen[part.mass] * part.arm**2
        inertia = chosen.get(part.inertia)
        if inertia is None:
            frequency = ALTERNATIVE_CHOICE[part.inertia]
            total = part.stiffness / chosen[frequency] ** 2
            if inertia_of_mass > total:
                raise ParameterError(
                    f"{owner}: {part.mass} on {part.arm_name} alone has {inertia_of_mass:.4g} "
                    f"kg m², but {frequency} leaves {total:.4g} kg m² for everything that swings "
                    "with it; choose a smaller mass or a lower frequency."
                )
            inertia = total - inertia_of_mass
            completed[part.inertia] = inertia, part.origin
        if part.damping not in chosen:
            ratio = ALTERNATIVE_CHOICE[part.damping]
            critical = sqrt(part.stiffness * (inertia + inertia_of_mass))
            completed[part.damping] = 2.0 * chosen[ratio] * critical / part.arm**2, ratio
    return completed


def _motor_leakage(owner: str, Z: Mapping[str, float], n: Mapping[str, float]) -> float:
    """K_mL from Z11 = K_mL C_g and Z12 = K_mL Z10 C_i, which must agree."""
    losses = {
        "Z11": (n["load_torque"], "load_torque"),
        "Z12": (Z["Z10"] * n["load_inertia"], "load_inertia"),
    }
    leakages = []
    for symbol, (load, cause) in losses.items():
        if load != 0.0:
            leakages.append(Z[symbol] / load)
        elif Z[symbol] != 0.0:
            raise ParameterError(
                f"{owner}: {symbol} is {Z[symbol]:g}, but without {cause} no speed is lost to it; "
                f"choose {cause}, or set {symbol} to 0."
            )
    if len(leakages) == 2 and abs(leakages[0] - leakages[1]) > AGREES * abs(leakages[0]):
        raise ParameterError(
            f"{owner}: Z11 makes motor_leakage {leakages[0]:.6g} rad/(s N m), but Z12 makes it "
            f"{leakages[1]:.6g}; choose load_torque and load_inertia so that both agree, for "
            f"example load_inertia = {Z['Z12'] / (Z['Z10'] * leakages[0]):.12g} kg m²."
        )
    return leakages[0] if leakages else 0.0


# --- packaged sets --------------------------------------------------------------------------------


class PhysicalFile(FormerlyFormat):
    """Assumptions of a packaged set; the rest follows from the parameter set of its name."""

    name: str
    title: str
    physical: dict[str, ParameterEntry]


@cache
def _assumed(name: str) -> tuple[str, Mapping[str, Parameter]]:
    """Title of a packaged set, and the values that it assumes."""
    if name not in AXES:
        raise ParameterError(
            f"There is no packaged physical set '{name}'; there are {', '.join(AXES)}."
        )
    text = files("swashplate.full_order").joinpath("sets", f"{name}.toml").read_text("utf-8")
    contents = validated(parse_toml(text, f"{name}.toml"), PhysicalFile, f"{name}.toml")
    entries = {
        name: parameter_of(chosen_quantity(name), entry)
        for name, entry in contents.physical.items()
    }
    return contents.title, entries


def nearest_set(name: str) -> str:
    """Name of the packaged set that a drive of this name is taken to be like: its own, or hoist."""
    return name if name in AXES else AXES[0]


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
    """Tabulate the values that complete a physical set: assumed ones, and given ones."""
    columns = (Column("Physical value"), Column("", "s"), Column(""), Column(""))
    table = Table("Physical values not given by the drive's parameters", columns)
    entries = chosen_over(_assumed(axis)[1], given)
    for name, entry in entries.items():
        unit, factor = SHOWN.get(entry.unit, (unit_text(entry.unit), 1.0))
        if chosen_unit(entry.unit).factor != 1.0:
            unit, factor = chosen_unit(entry.unit)
        numbers = "/".join(f"{factor * value:.5g}" for value in entry.values)
        table.add(name, numbers, unit, "given" if entry.status == "user" else "assumed")
    assumed = sum(entry.status != "user" for entry in entries.values())
    if assumed:
        table.caption = (
            f"{assumed} of {len(entries)} physical values are assumed, as of the packaged {axis}; "
            "set known ones with --physical"
        )
    return table
