"""A physical set: arms, springs, masses, areas, oil and load of one machine, always valid."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from math import sqrt, tan
from pathlib import Path
from types import MappingProxyType

from swashplate.errors import ParameterError
from swashplate.full_order.quantities import CHOICES, QUANTITIES, Quantity
from swashplate.parameters.parameter_set import Change, Pair, ParameterSet, Status, Value


@dataclass(frozen=True)
class PhysicalValue:
    """One quantity of a set."""

    quantity: Quantity
    value: Value
    source: str = ""
    status: Status = "user"

    @property
    def values(self) -> tuple[float, ...]:
        """Its one or two numbers, in the order of ``quantity.columns``."""
        return tuple(self.value) if isinstance(self.value, Pair) else (self.value,)


@dataclass(frozen=True)
class PhysicalSet(Mapping[str, PhysicalValue]):
    """All physical quantities of a drive, by name.

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
        missing = [name for name in QUANTITIES if name not in self.entries]
        if missing:
            raise ParameterError(f"{self.name}: no value for {', '.join(missing)}.")
        ordered = {name: self.entries[name] for name in QUANTITIES}
        numbers: dict[str, float] = {}
        for entry in ordered.values():
            for column, value in zip(entry.quantity.columns, entry.values, strict=True):
                entry.quantity.check(self.name, column, value)
                numbers[column] = value
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
        from swashplate.full_order.files import load_preset

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
        from swashplate.full_order.files import load_set

        return load_set(path)

    def to_toml(self, path: str | Path) -> None:
        """Store all quantities; `from_toml` gives an equal set back.

        Raises
        ------
        FileError
            If the file cannot be written; an older file of that name then stays as it was.
        """
        from swashplate.full_order.files import dump_set
        from swashplate.tables import write_text

        write_text(dump_set(self), path)

    def to_lumped(self, Z6: float | None = None) -> dict[str, Change]:
        """The lumped parameters that follow; see `swashplate.full_order.lumps.lumped`."""
        from swashplate.full_order.lumps import lumped

        return lumped(self, Z6)

    def check_lumps(self, parameters: ParameterSet, tolerance: float = 1e-9) -> None:
        """Refuse to stand for a drive with other lumps; see `swashplate.full_order.lumps`."""
        from swashplate.full_order.lumps import check_lumps

        check_lumps(self, parameters, tolerance)

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


def quantity_of(name: str) -> Quantity:
    """Definition of a quantity.

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


def value_of(quantity: Quantity, change: Change) -> Value:
    """A value in the form that the quantity has: one number or a pair."""
    try:
        numbers = [float(each) for each in (change if isinstance(change, tuple) else (change,))]
    except (TypeError, ValueError):
        raise ParameterError(
            f"{quantity.name} must be a number in {quantity.unit}, or a pair of them, not "
            f"{change!r}."
        ) from None
    if len(numbers) > (2 if quantity.directional else 1):
        kind = "one value or two (plus, minus)" if quantity.directional else "one value"
        raise ParameterError(f"{quantity.name} takes {kind}, not {len(numbers)}.")
    if not quantity.directional:
        return numbers[0]
    return Pair(numbers[0], numbers[-1])


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
    load = numbers["motor_constant"] * numbers["load_torque"]
    moment = numbers["pumping_area"] * numbers["pumping_arm"]
    pressure = load * moment / (numbers["piston_area"] * numbers["swash_arm"])
    ceiling = min(numbers["supply_pressure"], numbers["relief_pressure"])
    if not abs(pressure) < ceiling:
        raise ParameterError(
            f"{owner}: the load holds a stroker pressure of {pressure:.4g} Pa at rest, but it must "
            f"stay below {ceiling:.4g} Pa, the smaller of supply_pressure and relief_pressure; "
            "check load_torque, pumping_area and pumping_arm."
        )
