"""Every parameter of the drive: symbol, plain name, unit, range, as the models declare them.

The symbols are those of Kruse (2001). A directional parameter has a plus and a minus value, chosen
by the sign of the signal it acts on; both are stored as magnitudes.

A definition stands once, on the field of `swashplate.models.amplifier.Card` or
`swashplate.models.displacement_control.Pump` that holds the value.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from difflib import get_close_matches
from typing import Literal

from swashplate.equations.fields import Definition as Definition
from swashplate.equations.fields import declared_by
from swashplate.errors import ParameterError, UnknownParameterError
from swashplate.models.amplifier import Card
from swashplate.models.displacement_control import Pump

Block = Literal["control_card", "pump_motor", "refinements"]

INPUTS = ("pump_speed",)
"""Fields of the models that no set has: what drives the machine, not what it is."""


def _collected() -> Iterator[Definition]:
    """All parameters in the order of Kruse's tables, the refinements last."""
    for each in declared_by(Card):
        yield replace(each, block="control_card")
    for each in declared_by(Pump):
        if each.symbol not in INPUTS:
            optional = each.default is not None
            yield replace(each, block="refinements" if optional else "pump_motor")


_ALL = tuple(_collected())

CATALOGUE: dict[str, Definition] = {d.symbol: d for d in _ALL if d.block != "refinements"}
"""Definitions of what every set has, by symbol, the card's first."""

REFINEMENTS: dict[str, Definition] = {d.symbol: d for d in _ALL if d.block == "refinements"}
"""Definitions of what a set may leave out, by symbol, along the chain; each has one value."""

COLUMNS: dict[str, str] = {
    column: symbol for symbol, each in CATALOGUE.items() for column in each.columns
}
"""Symbol of every single value that every set has, e.g. ``Z16_plus`` → ``Z16``."""

SWITCHES: dict[str, str] = {each.symbol: each.switch for each in _ALL if each.switch}
"""Option of the pump (`PumpOptions` of `swashplate.models.displacement_control`) that a parameter
belongs to, by symbol; each has one value."""

OPTIONS: tuple[str, ...] = tuple(dict.fromkeys(SWITCHES.values()))
"""Those options, along the chain."""


def is_column(name: str) -> bool:
    """Whether a set can have a value of this name, e.g. ``Z16_plus``."""
    return name in COLUMNS or name in REFINEMENTS or name in OWN


def options_of(numbers: Mapping[str, float]) -> frozenset[str]:
    """Options whose parameters are not all zero; what is not among the numbers is off."""
    return frozenset(each for name, each in SWITCHES.items() if numbers.get(name, 0.0) != 0.0)


OWN: dict[str, Definition] = {}
"""Definitions of what users' own equations brought along, by symbol."""


def declare(kind: type) -> None:
    """Make the parameters of one's own equation known by name.

    Parameters
    ----------
    kind : class of named tuples
        Each field a float with its `Definition`, of one value, and a default.

    Raises
    ------
    ParameterError
        If one has no definition or is called like another one.
    """
    for each in declared_by(kind):
        default = kind._field_defaults.get(each.symbol)  # type: ignore[attr-defined]
        if each.directional or default is None or not each.unit:
            raise ParameterError(
                f"{kind.__name__}.{each.symbol} needs a Definition with a unit, one value and a "
                "default."
            )
        made = replace(each, block="refinements", default=default)
        known = (CATALOGUE | REFINEMENTS | OWN).get(each.symbol, made)
        if known != made:
            raise ParameterError(
                f"{kind.__name__}.{each.symbol}: there is another parameter {each.symbol}, "
                f"{known.name}; give yours a name of its own."
            )
        OWN[each.symbol] = made


def find(name: str) -> Definition:
    """Definition of a symbol (``Z16``, ``spool_friction``) or column (``Z16_plus``).

    Raises
    ------
    ParameterError
        If there is none of that name; the sentence lists the right ones.
    """
    symbol = COLUMNS.get(name, name)
    for known in (CATALOGUE, REFINEMENTS, OWN):
        if symbol in known:
            return known[symbol]
    raise unknown_parameter(name)


def unknown_parameter(name: str) -> UnknownParameterError:
    """Error for a name that no parameter has."""
    close = get_close_matches(str(name), [*CATALOGUE, *COLUMNS, *REFINEMENTS], n=1)
    hint = f" (did you mean {close[0]}?)" if close else ""
    return UnknownParameterError(
        f"There is no parameter '{name}'{hint}; the parameters are {', '.join(CATALOGUE)}, "
        "those with two directions also as e.g. Z16_plus and Z16_minus, and the refinements "
        f"{', '.join(REFINEMENTS)}."
    )


def columns_of(names: Mapping[str, object] | tuple[str, ...] | list[str]) -> list[str]:
    """Columns that a list of symbols and columns stands for, in its order; refuses as `find`."""
    columns: list[str] = []
    for name in names:
        definition = find(name)
        wanted = definition.columns if name == definition.symbol else (name,)
        columns.extend(column for column in wanted if column not in columns)
    return columns
