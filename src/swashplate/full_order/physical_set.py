"""A physical set: arms, springs, masses, areas, oil and load of one machine, always valid.

The quantities are those that `swashplate.models.machine.Machine` declares.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from math import inf, isnan, sqrt, tan
from pathlib import Path
from types import MappingProxyType

from swashplate.equations.equation import interpreted
from swashplate.equations.fields import Declared, Definition, Flag, declared_by
from swashplate.errors import ParameterError
from swashplate.models import machine as equations
from swashplate.models.machine import Machine
from swashplate.parameters.parameter_set import Change, Pair, ParameterSet, Status, Value

QUANTITIES: Mapping[str, Declared] = {each.symbol: each for each in declared_by(Machine)}
"""Quantities by name, from the spool to the load."""


def _choice(name: str, symbol: str, meaning: str, unit: str, above: float | None) -> Declared:
    return Declared(name, Definition(meaning, unit, 0.0, above=above, stands_for=symbol), (name,))


CHOICES: Mapping[str, Declared] = {
    each.symbol: each
    for each in (
        _choice("spool_frequency", "ω_sp", "natural frequency of the spool", "rad/s", 0.0),
        _choice("spool_damping_ratio", "ζ_sp", "damping ratio of the spool", "1", None),
        _choice(
            "swash_frequency",
            "ω_sw",
            "natural frequency of the swash plate at held pressure",
            "rad/s",
            0.0,
        ),
        _choice("swash_damping_ratio", "ζ_sw", "damping ratio of the swash plate", "1", None),
    )
}
"""What may be chosen in place of inertias and dampings when a set is completed."""
AGREES = 1e-9
"""Relative difference up to which a given value agrees with the one that follows."""


@dataclass(frozen=True)
class PhysicalValue:
    """One quantity of a set."""

    quantity: Declared
    value: Value
    source: str = ""
    status: Status = "user"

    @property
    def values(self) -> tuple[float, ...]:
        """Its one or two numbers, in the order of ``quantity.columns``."""
        return tuple(self.value) if isinstance(self.value, Pair) else (self.value,)

    @property
    def unit(self) -> str:
        """SI unit of the value."""
        return self.quantity.definition.unit

    def check(self, owner: str) -> None:
        """Refuse a value out of range.

        Raises
        ------
        ParameterError
            Naming owner, quantity, value and range.
        """
        definition = self.quantity.definition
        for column, value in zip(self.quantity.columns, self.values, strict=True):
            low = value < definition.lower or value == definition.above
            high = value >= definition.upper and not (value == inf and definition.can_be_off)
            if low or high or isnan(value) or value == -inf:
                unit = "" if definition.unit == "1" else f" {definition.unit}"
                raise ParameterError(
                    f"{owner}: {column} ({definition.name}) is {value:g}{unit}, but must be "
                    f"{definition.range}."
                )


@dataclass(frozen=True)
class PhysicalSet(Mapping[str, PhysicalValue]):
    """All physical quantities of a drive, by name; one that has a default may be left out.

    Raises
    ------
    ParameterError
        On creation, if a quantity is missing or breaks a rule; the sentence names it.
    """

    name: str
    title: str
    entries: Mapping[str, PhysicalValue]
    numbers: Mapping[str, float] = field(init=False, repr=False, compare=False)
    """Every single value by column, e.g. ``swash_stop_plus``."""

    def __post_init__(self) -> None:
        for name in self.entries:
            quantity_of(name)
        entries = {
            name: PhysicalValue(each, each.definition.default, status="assumed")
            for name, each in QUANTITIES.items()
            if each.definition.default is not None
        } | dict(self.entries)
        missing = [name for name in QUANTITIES if name not in entries]
        if missing:
            raise ParameterError(f"{self.name}: no value for {', '.join(missing)}.")
        ordered = {name: entries[name] for name in QUANTITIES}
        numbers: dict[str, float] = {}
        for entry in ordered.values():
            entry.check(self.name)
            numbers |= zip(entry.quantity.columns, entry.values, strict=True)
        _check_together(self.name, numbers)
        object.__setattr__(self, "entries", MappingProxyType(ordered))
        object.__setattr__(self, "numbers", MappingProxyType(numbers))

    @classmethod
    def preset(cls, name: str) -> PhysicalSet:
        """An assumed set of one of the source's axes: ``"hoist"``, ``"slew"``, ``"luff"``.

        Raises
        ------
        ParameterError
            For another name.
        """
        from swashplate.full_order.completion import load_preset

        return load_preset(name)

    @classmethod
    def from_toml(cls, path: str | Path) -> PhysicalSet:
        """A set from a file.

        Raises
        ------
        FileError
            If the file cannot be read.
        ParameterError
            If an entry is wrong; the sentence names file, quantity and rule.
        """
        from swashplate.documents import read_text
        from swashplate.full_order.completion import read_set

        return read_set(read_text(path), str(path))

    def to_toml(self, path: str | Path) -> None:
        """Store all quantities; `from_toml` gives an equal set back.

        Raises
        ------
        FileError
            If the file cannot be written; an older file of that name then stays as it was.
        """
        from swashplate.full_order.completion import dump_set
        from swashplate.tables import write_text

        write_text(dump_set(self), path)

    @property
    def machine(self) -> Machine:
        """The quantities as the equations take them."""
        return Machine(**self.numbers)

    @property
    def air(self) -> Flag:
        """Whether there is free air in the oil, as an option of the equations."""
        return air_in(self.numbers)

    def to_lumped(self, Z6: float | None = None) -> dict[str, Change]:
        """Lumped parameters that the set stands for.

        Parameters
        ----------
        Z6 : float, optional
            Value to move to along the gauge Z6↔Z8: away from the stops only Z7/(1+Z6) and
            Z8/(1+Z6) count. By default the physical A_s²B/(k_r V), of a bulk modulus at rest.

        Returns
        -------
        dict
            Z1 to Z16 and Z18 by symbol, pairs (plus, minus) where the directions differ; Kruse
            eqs. 6.56-6.70 and table 6.1. The solenoids' Z17 and Z19 to Z22 are not the pump's
            geometry.
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

    def check_lumps(self, parameters: ParameterSet, tolerance: float = AGREES) -> None:
        """Refuse to stand for a drive with other lumps.

        Raises
        ------
        ParameterError
            For the first lump that differs by more than the tolerance, taken at the drive's Z6.
        """
        for symbol, lump in self.to_lumped(parameters.numbers["Z6"]).items():
            values = lump if isinstance(lump, tuple) else (lump,)
            for column, value in zip(parameters[symbol].definition.columns, values, strict=False):
                wanted = parameters.numbers[column]
                if value != wanted and not abs(value - wanted) <= tolerance * abs(wanted):
                    raise ParameterError(
                        f"{self.name}: its quantities make {column} = {value:.9g}, but "
                        f"{parameters.name} has {wanted:.9g} {parameters[symbol].unit}."
                    )

    def __repr__(self) -> str:
        return f"PhysicalSet({self.name!r}, {len(self)} quantities)"

    def __getitem__(self, name: str) -> PhysicalValue:
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
        """A set with other values in SI, e.g. ``replace(load_torque=2e3)``, marked as the user's.

        Raises
        ------
        ParameterError
            For an unknown name or a value that breaks a rule.
        """
        entries = dict(self.entries)
        for name, change in changes.items():
            quantity = quantity_of(name)
            entries[name] = PhysicalValue(quantity, value_of(quantity, change))
        return replace(self, entries=entries)

    def scaled(self, epsilon: float) -> PhysicalSet:
        """The set with inertias times ε and dampings times √ε: the way to the reduced model.

        The frequencies rise by 1/√ε and the damping ratios stay. The load's inertia acts on the
        swash plate's rate, as a damping does, and is scaled like one.

        Raises
        ------
        ParameterError
            Unless ε is above 0.
        """
        if not epsilon > 0.0:
            raise ParameterError(f"epsilon is {epsilon:g}, but must be above 0.")
        n, root = self.numbers, sqrt(epsilon)
        inertias = ("spool_mass", "feedback_arm_inertia", "swash_inertia", "piston_mass")
        dampings = ("spool_damping", "piston_damping", "load_inertia")
        return self.replace(
            **{each: n[each] * epsilon for each in inertias},
            **{each: n[each] * root for each in dampings},
        )


def quantity_of(name: str) -> Declared:
    """What a quantity is.

    Raises
    ------
    ParameterError
        If there is none of that name.
    """
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


def value_of(quantity: Declared, change: Change) -> Value:
    """A value in the form that the quantity has: one number or a pair."""
    name, several = quantity.symbol, len(quantity.fields) > 1
    try:
        numbers = [float(each) for each in (change if isinstance(change, tuple) else (change,))]
    except (TypeError, ValueError):
        raise ParameterError(
            f"{name} must be a number in {quantity.definition.unit}, or a pair of them, not "
            f"{change!r}."
        ) from None
    if len(numbers) > (2 if several else 1):
        kind = "one value or two (plus, minus)" if several else "one value"
        raise ParameterError(f"{name} takes {kind}, not {len(numbers)}.")
    return Pair(numbers[0], numbers[-1]) if several else numbers[0]


def air_in(numbers: Mapping[str, float]) -> Flag:
    """Whether there is free air in the oil."""
    return True if numbers.get("air_fraction", 0.0) > 0.0 else None


def rest_pressure(numbers: Mapping[str, float]) -> float:
    """P0, which holds the load with the plate upright; see `machine.static_pressure`. [Pa]"""
    return float(interpreted(equations.static_pressure)(_known(numbers)))


def rest_modulus(numbers: Mapping[str, float]) -> float:
    """Bulk modulus of the oil at that pressure. [Pa]"""
    pressure, air = rest_pressure(numbers), air_in(numbers)
    return float(interpreted(equations.oil_modulus)(pressure, _known(numbers), air))


def _known(numbers: Mapping[str, float]) -> Machine:
    """A machine of what is known; nothing else may be asked of it."""
    return Machine(*(numbers.get(name, 0.0) for name in Machine._fields))


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
            f"{owner}: the load holds a stroker pressure of {pressure:.4g} Pa at rest, but it must "
            f"stay below {ceiling:.4g} Pa, the smaller of supply_pressure and relief_pressure; "
            "check load_torque, pumping_area and pumping_arm."
        )
