"""Named tuples of a model: what their fields declare, and their numbers as flat lists.

A parameter is defined once, on the field that holds its value:
``omega: Annotated[float, Definition("natural frequency", "rad/s", above=0.0)]``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cache, cached_property
from math import inf, isfinite
from typing import Any, Final, TypeGuard, get_type_hints

import numpy as np

from swashplate.errors import InputError
from swashplate.machine.language import is_named_tuple

Flag = bool | None
"""An option: None is off, True is on. In compiled code they are two types, and the branch that is
not taken disappears."""
OFF: Final = None


@dataclass(frozen=True)
class Definition:
    """Meaning, unit and range of a parameter, state, signal or input, whatever its value.

    Examples
    --------
    >>> from swashplate.machine import Definition
    >>> lag = Definition("lag of the valve", "s", above=0.0, plausible=(1e-3, 10.0))
    >>> lag.lower
    0.0
    """

    name: str
    """What it is, in words."""
    unit: str
    """SI unit of the value."""
    lower: float = -inf
    """Lowest value, allowed itself unless `above` says so."""
    upper: float = inf
    """Bound that the value must stay below."""
    above: float | None = None
    """Lower bound that the value must exceed; `lower` is then the same number."""
    can_be_off: bool = False
    """Infinity is allowed and switches the limit off."""
    default: float | None = None
    """Its value if a set does not give it; None: every set must."""
    switch: str = ""
    """Option of the model that it belongs to, and that is off if it is zero."""
    least: float | None = None
    """Lowest value that an estimate may take if `lower` itself would switch the term off."""
    plausible: tuple[float, float] | None = None
    """Least and largest size, whatever the sign, of a number that somebody can mean; 0 and infinity
    apart, which stand for "none". None: any size."""
    symmetry: Mapping[str, float] = field(default_factory=dict, hash=False)
    """Power with which it scales along each symmetry of the model, by the symmetry's name."""
    needs: str = ""
    """What must happen in a test for it to matter."""
    stands_for: str = ""
    """Quantities of the machine that it stands for."""
    source: str = ""
    """Number of Kruse's equation."""
    symbol: str = ""
    """Its symbol: the name of the field that declares it, without the direction."""
    fields: tuple[str, ...] = ()
    """Dotted names of its values: one, or those of both directions, plus first."""
    block: str = ""
    """Table of a parameter file that it stands in."""

    def __post_init__(self) -> None:
        if self.above is not None:
            object.__setattr__(self, "lower", self.above)

    @cached_property
    def directional(self) -> bool:
        """Whether it has a value for each direction."""
        return len(self.fields) == 2

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Names of its values by themselves: ``Z1``, or ``Z16_plus`` and ``Z16_minus``."""
        if self.directional:
            return (f"{self.symbol}_plus", f"{self.symbol}_minus")
        return (self.symbol,)

    def holds(self, values: Any) -> Any:
        """Whether a value, or each of an array, lies in the range; NaN does not."""
        strict = self.above is not None or not isfinite(self.lower)
        allowed: Any = values > self.lower if strict else values >= self.lower
        if isfinite(self.upper) or not self.can_be_off:
            allowed = allowed & (values < self.upper)
        return allowed

    def broken(self, column: str, value: float) -> str:
        """What is wrong with a value beyond the range, without the stop."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{column} ({self.name}) is {value:g}{unit}, but must be {self.range}"

    @property
    def range(self) -> str:
        """The allowed range as words, e.g. ``above 0``."""
        low = ""
        if self.lower != -inf:
            low = f"{'at least' if self.above is None else 'above'} {self.lower:g}"
        high = "" if self.upper == inf else f"below {self.upper:g}"
        text = " and ".join(part for part in (low, high) if part) or "any finite number"
        return text + (", or inf for none" if self.can_be_off else "")

    @property
    def span(self) -> str:
        """The range of an input in words, both ends included: ``within ±10``."""
        if self.lower == -self.upper:
            return f"within ±{self.upper:g}"
        if self.upper == inf:
            return f"at least {self.lower:g}"
        if self.lower == -inf:
            return f"at most {self.upper:g}"
        return f"from {self.lower:g} to {self.upper:g}"

    @property
    def plausible_range(self) -> str:
        """The plausible sizes as words, e.g. ``at most 100``; empty if there is no such range."""
        if self.plausible is None:
            return ""
        low, high = self.plausible
        return f"{low:g} to {high:g}" if low > 0.0 else f"at most {high:g}"


class OtherDirection(Enum):
    """Marks the other direction of a parameter with two values."""

    MINUS = "minus"


MINUS = OtherDirection.MINUS
"""On a field ``Z16_minus``: the definition stands on ``Z16_plus``."""


def declared_by(parameters: Any) -> Iterator[Definition]:
    """Parameters that a named tuple declares, in its order, with their symbols and fields.

    Parameters
    ----------
    parameters : type
        A class of named tuples. Two fields ``plus`` and ``minus`` of one other such class hold both
        directions of what that declares; so do two fields ``Z16_plus``, with the definition, and
        ``Z16_minus``, marked `MINUS`. A field without a definition is its own name.
    """
    hints = get_type_hints(parameters, include_extras=True)
    both = hints.get("plus") if hints.get("plus") is hints.get("minus") else None
    for name in parameters._fields:
        hint = hints[name]
        if is_named_tuple(hint):
            directed = name in ("plus", "minus") and both is not None
            prefixes = ("plus", "minus") if directed else (name,)
            if prefixes[0] != name:
                continue
            for inner in declared_by(hint):
                paths = tuple(f"{prefix}.{path}" for prefix in prefixes for path in inner.fields)
                yield replace(inner, fields=paths)
            continue
        definition: Any = next(iter(getattr(hint, "__metadata__", ())), Definition(name, ""))
        if definition is MINUS:
            continue
        symbol = name.removesuffix("_plus")
        minus = f"{symbol}_minus"
        if symbol != name and MINUS in getattr(hints.get(minus), "__metadata__", ()):
            yield replace(definition, symbol=symbol, fields=(name, minus))
        else:
            yield replace(definition, symbol=name, fields=(name,))


def definition_of(hint: Any) -> Definition | None:
    """The definition in the type of a field or an argument, None if it has none."""
    extras = getattr(hint, "__metadata__", ())
    return next((extra for extra in extras if isinstance(extra, Definition)), None)


def definitions_of(kind: Any) -> dict[str, Definition]:
    """Definitions that the fields of a named tuple state, by dotted path."""
    hints = get_type_hints(kind, include_extras=True)
    stated = dict[str, Definition]()
    for name in kind._fields:
        if is_named_tuple(hints[name]):
            inner = definitions_of(hints[name])
            stated |= {f"{name}.{path}": definition for path, definition in inner.items()}
        elif (definition := definition_of(hints[name])) is not None:
            stated[name] = definition
    return stated


def ranges_of(kind: Any) -> dict[str, Definition]:
    """Definitions with a range, of what is possible or plausible, that a named tuple declares.

    By dotted path.
    """
    return {
        path: definition
        for definition in declared_by(kind)
        for path in definition.fields
        if definition.range != Definition("", "").range or definition.plausible is not None
    }


# --- numbers by dotted paths ----------------------------------------------------------------------


def _floats_of(kind: Any) -> tuple[str, ...]:
    """Dotted paths of all floats below a named tuple, e.g. ``plus.V_dz``, in its order."""
    hints = get_type_hints(kind)
    below = {name: floats_of(hints[name]) for name in kind._fields if is_named_tuple(hints[name])}
    floats = {name: ("",) for name in kind._fields if hints[name] is float}
    paths = [(name, path) for name in kind._fields for path in {**below, **floats}.get(name, ())]
    return tuple(f"{name}.{path}".rstrip(".") for name, path in paths)


floats_of: Callable[[Any], tuple[str, ...]] = cache(_floats_of)


def is_real(value: object) -> TypeGuard[float]:
    """Whether something is a real number, finite or not."""
    return isinstance(value, int | float | np.integer | np.floating)


def check_mapping(what: str, mapping: object) -> None:
    """Refuse what is not a mapping of names to values."""
    if not isinstance(mapping, Mapping):
        raise InputError(f"{what} is {mapping!r}, but must be a mapping of names to values.")


def value_at(value: Any, path: str) -> Any:
    """What lies at a dotted path of a nested named tuple."""
    for name in path.split(".") if path else ():
        value = getattr(value, name)
    return value


def member_at(value: Any, path: str) -> Any:
    """What lies at a dotted path; None if nothing does."""
    for name in path.split("."):
        value = getattr(value, name, None)
    return value


def numbers_of(value: Any) -> list[float]:
    """All floats of a nested named tuple, in the order of `floats_of`."""
    numbers: list[float] = []
    for element in value:
        numbers += numbers_of(element) if isinstance(element, tuple) else [float(element)]
    return numbers


_types_of: Callable[[Any], dict[str, Any]] = cache(get_type_hints)
"""Types of the fields of a named tuple, by name."""


def defaults_of(kind: Any) -> dict[str, float]:
    """Defaults of a nested named tuple's numbers by path, as far as there are some.

    The default of a field that is a tuple counts before those of the tuple's own fields.
    """
    defaults: dict[str, float] = {}
    hints = _types_of(kind)
    for name in kind._fields:
        default = kind._field_defaults.get(name)
        if is_named_tuple(hints[name]):
            inner = defaults_of(hints[name])
            if default is not None:
                inner = dict(zip(floats_of(hints[name]), numbers_of(default), strict=True))
            defaults |= {f"{name}.{path}": number for path, number in inner.items()}
        elif default is not None:
            defaults[name] = float(default)
    return defaults


def tuple_from(kind: Any, numbers: Mapping[str, float]) -> Any:
    """A nested named tuple from numbers by path; others keep their defaults."""
    given = {path: float(number) for path, number in numbers.items()}
    return nested_from(kind, defaults_of(kind) | given)


def nested_from(kind: Any, values_by_path: Mapping[str, Any], prefix: str = "") -> Any:
    """A nested named tuple from values by path, numbers or arrays; `prefix` is left out of it."""
    hints = _types_of(kind)
    values = [
        nested_from(hints[name], values_by_path, f"{prefix}{name}.")
        if is_named_tuple(hints[name])
        else values_by_path[f"{prefix}{name}"]
        for name in kind._fields
    ]
    return kind(*values)
