"""Quantities of a crane: their units and plausible ranges, status and source of each value."""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees, isclose, isfinite
from typing import Any, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, FiniteFloat, model_validator

from swashplate.errors import ParameterError
from swashplate.tables import listed
from swashplate.units import to_si


class CraneQuantity(BaseModel):
    """A length, angle or number of a crane, with its source."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    value: FiniteFloat | list[FiniteFloat]
    unit: str
    status: Literal["published", "measured", "assumed", "user"] = "user"
    source: str = ""

    @model_validator(mode="after")
    def _published_somewhere(self) -> CraneQuantity:
        if self.status == "published" and not self.source.strip():
            raise ValueError("a published value needs its source, or another status")
        return self

    @property
    def values(self) -> list[float]:
        """Its numbers, in its own unit."""
        return self.value if isinstance(self.value, list) else [self.value]


class QuantityDefinition(NamedTuple):
    """Definition of a quantity: SI unit, count of numbers, and their plausible range."""

    unit: str
    size: int
    low: float
    high: float
    """In SI, as `low`; an angle's are in degrees."""


GEOMETRY: Mapping[str, QuantityDefinition] = {
    # from a knuckle boom on a small lorry to the longest booms of crawler cranes, about 200 m
    "boom_length": QuantityDefinition("m", 1, 1.0, 300.0),
    # boom foot from the slew axis: 10 to 20 m on cranes of 5000 t
    "foot_offset": QuantityDefinition("m", 1, 0.0, 50.0),
    # forward, port and up from the ship's origin, which may stand at its stern: ships reach 400 m
    "slew_axis": QuantityDefinition("m", 3, -450.0, 450.0),
    # a mast next to the boom's foot; A-frames of heavy-lift cranes are about 60 m high
    "tower_sheave_distance": QuantityDefinition("m", 1, 0.1, 150.0),
    "tower_sheave_angle": QuantityDefinition("rad", 1, 0.0, 180.0),
    # a hand winch's drum has 30 mm, those of deep-water winches 1 to 3 m
    "hoist_drum_radius": QuantityDefinition("m", 1, 0.01, 5.0),
    # hooks of 5000 t hang on about 50 to 100 parts of rope
    "hoist_falls": QuantityDefinition("1", 1, 1.0, 250.0),
    "luff_drum_radius": QuantityDefinition("m", 1, 0.01, 5.0),
    "luff_falls": QuantityDefinition("1", 1, 1.0, 250.0),
    # parts of rope from tower to tip over the falls: 1 with one of each
    "rope_coupling": QuantityDefinition("1", 1, 0.0, 4.0),
    # the heaviest cranes at sea lift 10 000 t with one hook, gantries on land 20 000 t
    "safe_load": QuantityDefinition("kg", 1, 1.0, 3e7),
    "boom_limits": QuantityDefinition("rad", 2, 0.0, 90.0),
    # cranes that lower to the sea bed have 3000 to 4000 m
    "rope_limits": QuantityDefinition("m", 2, 0.05, 6000.0),
    # 0.2 to 1 % by air, sheaves and rope; an anti-sway device in the rope may have more
    "swing_damping": QuantityDefinition("1", 1, 0.0, 0.2),
    # height above the ship's origin, and half of its breadth: the widest ships have 124 m
    "deck": QuantityDefinition("m", 2, 0.0, 100.0),
}
"""Quantities of a crane by name, with ranges that every crane lies well within."""
MAY_LACK = ("deck",)
"""Quantities that a crane may be without; what depends on them is then left out."""
DEFAULTS: Mapping[str, CraneQuantity] = {
    "swing_damping": CraneQuantity(
        value=0.005,
        unit="1",
        status="assumed",
        source="not given; loads on ropes have a damping ratio of 0.2 to 1 % (air, sheaves, rope)",
    )
}
"""Quantities that a file may leave out, with the values that then count."""
ROUNDING = 1e-9
"""By which a number may lie beyond its range."""
SAME = 1e-9
"""Relative difference up to which two values are the same one."""


def user_quantity(name: str, value: Any) -> CraneQuantity:
    """A value in SI as a quantity whose source is the user.

    Parameters
    ----------
    name : str
        Of the quantity, a key of `GEOMETRY`.
    value : float or sequence of float
        As many as `GEOMETRY` has of this name.

    Raises
    ------
    ParameterError
        If it is not made of numbers.
    """
    numbers = value if isinstance(value, tuple | list) else [value]
    try:
        if any(isinstance(number, bool | str) for number in numbers):
            raise TypeError
        floats = [float(number) for number in numbers]
    except (TypeError, ValueError, OverflowError):
        raise ParameterError(
            f"{name} is {value!r:.60}, but must be {_shape(GEOMETRY[name])}."
        ) from None
    if not all(map(isfinite, floats)):
        raise ParameterError(f"{name} is {value!r:.60}, but must be finite.")
    return CraneQuantity(value=floats if len(floats) > 1 else floats[0], unit=GEOMETRY[name].unit)


def _shape(definition: QuantityDefinition) -> str:
    """Count of a quantity's numbers, in words."""
    return "one number" if definition.size == 1 else f"a list of {definition.size} numbers"


def values_in_si(
    name: str, quantity: CraneQuantity, definition: QuantityDefinition, origin: str
) -> tuple[float, ...]:
    """A quantity in SI; a `ParameterError` if it is out of its plausible range."""
    numbers = quantity.values
    if len(numbers) != definition.size:
        raise ParameterError(f"{origin}: {name} must be {_shape(definition)}, not {len(numbers)}.")
    subject = f"{origin}: {name}"
    values = [to_si(number, quantity.unit, definition.unit, subject) for number in numbers]
    in_degrees = definition.unit == "rad"
    for number, value in zip(numbers, values, strict=True):
        displayed = degrees(value) if in_degrees else value
        # an angle in degrees may come back a rounding beyond its end
        if not definition.low - ROUNDING <= displayed <= definition.high + ROUNDING:
            unit = "deg" if in_degrees else definition.unit.replace("1", "")
            written = f"{number:g} {quantity.unit}".removesuffix(" 1")
            raise ParameterError(
                f"{origin}: {name} is {written}, but on a crane it is {definition.low:g} to "
                f"{definition.high:g} {unit}".rstrip()
                + ": check the number and its unit."
            )
    return tuple(values)


def quantities_in_si(
    quantities: Mapping[str, CraneQuantity], origin: str
) -> dict[str, tuple[float, ...]]:
    """All quantities in SI, angles in rad; `origin`, a file or a crane, names them in errors.

    Raises
    ------
    ParameterError
        For a quantity out of its plausible range, and limits or angles that make no crane.
    InputError
        For a unit that does not measure the quantity.
    """
    complete = {**DEFAULTS, **quantities}
    si = {
        name: values_in_si(name, complete[name], definition, origin)
        for name, definition in GEOMETRY.items()
        if name in complete or name not in MAY_LACK
    }
    low, high = map(degrees, si["boom_limits"])
    if not 0.0 <= low < high < 90.0:
        raise ParameterError(
            f"{origin}: boom_limits are {low:g} and {high:g} deg, but must rise within 0 to 90 deg."
        )
    angle = degrees(si["tower_sheave_angle"][0])
    if not high < angle < low + 180.0:
        raise ParameterError(
            f"{origin}: tower_sheave_angle is {angle:g} deg, but the luff rope only lifts a boom "
            f"up to {high:g} deg from a sheave above that and below {low + 180.0:g} deg."
        )
    short, long = si["rope_limits"]
    if not short < long:
        raise ParameterError(
            f"{origin}: rope_limits are {short:g} and {long:g} m, but the second must be larger."
        )
    return si


def check_sources(
    quantities: Mapping[str, CraneQuantity],
    packaged: Mapping[str, CraneQuantity],
    definitions: Mapping[str, QuantityDefinition],
    origin: str,
    name: str,
) -> None:
    """Refuse a source that was written for another value.

    Parameters
    ----------
    quantities : mapping of str to CraneQuantity
        Of a crane whose file began as a copy of a packaged one.
    packaged : mapping of str to CraneQuantity
        The packaged crane's.
    definitions : mapping of str to QuantityDefinition
        `GEOMETRY`, or those of limits.
    origin, name : str
        The file, and the packaged crane, as errors name them.

    Raises
    ------
    ParameterError
        If values differ from the packaged ones but still have their sources; it names them all.
    """
    changed = [
        quantity
        for quantity, definition in definitions.items()
        if quantity in quantities and quantity in packaged
        if quantities[quantity].source
        and quantities[quantity].source == packaged[quantity].source
        and not _same(
            values_in_si(quantity, quantities[quantity], definition, origin),
            values_in_si(quantity, packaged[quantity], definition, name),
        )
    ]
    if changed:
        raise ParameterError(
            f"{origin}: {listed(changed)} {'has' if len(changed) == 1 else 'have'} another value "
            f"than {name}, but the same source: give the source of the new value and its status, "
            "or delete both."
        )


def _same(values: tuple[float, ...], others: tuple[float, ...]) -> bool:
    """Whether two quantities have the same values, in whatever units they were written."""
    return all(
        isclose(value, other, rel_tol=SAME, abs_tol=SAME)
        for value, other in zip(values, others, strict=True)
    )
