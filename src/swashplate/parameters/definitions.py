"""Every parameter of the drive: symbol, plain name, unit, range, as the models declare them.

The symbols are those of Kruse (2001). A directional parameter has a plus and a minus value, chosen
by the sign of the signal it acts on; both are stored as magnitudes.

A definition stands once, on the field of `swashplate.models.amplifier.Card` or
`swashplate.models.displacement_control.Pump` that holds the value; those of a user-defined equation
belong to the set that has it.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cached_property, lru_cache
from typing import Literal, NamedTuple

from swashplate.errors import ParameterError, UnknownParameterError
from swashplate.machine import Definition as Definition
from swashplate.machine.fields import declared_by
from swashplate.models.amplifier import Card
from swashplate.models.displacement_control import Pump

Block = Literal["control_card", "pump_motor", "refinements"]

INPUTS = ("pump_speed",)
"""Fields of the models that are not parameters of a set, but inputs of a run."""


class _Declared(NamedTuple):
    """A parameter as a field of a model declares it."""

    definition: Definition
    paths: dict[str, str]
    """Path of its field in a drive's model, by column."""


def _declared_parameters() -> Iterator[_Declared]:
    """All parameters in the order of Kruse's tables, the refinements last."""
    for part_name, part_type in (("card", Card), ("pump", Pump)):
        for definition in declared_by(part_type):
            if definition.symbol in INPUTS:
                continue
            paths = {
                column: f"{part_name}.{field}"
                for column, field in zip(definition.columns, definition.fields, strict=True)
            }
            block: Block = "control_card"
            if part_name == "pump":
                block = "pump_motor" if definition.default is None else "refinements"
            yield _Declared(replace(definition, block=block), paths)


_DECLARED = tuple(_declared_parameters())
_ALL = tuple(declared.definition for declared in _DECLARED)

CATALOGUE: dict[str, Definition] = {d.symbol: d for d in _ALL if d.block != "refinements"}
"""Definitions of the parameters that every set has, by symbol, the card's first."""

REFINEMENTS: dict[str, Definition] = {d.symbol: d for d in _ALL if d.block == "refinements"}
"""Definitions of the parameters that a set may leave out, by symbol, from command to speed; each
has one value."""

COLUMNS: dict[str, str] = {
    column: symbol for symbol, definition in CATALOGUE.items() for column in definition.columns
}
"""Symbol of every single value that every set has, e.g. ``Z16_plus`` → ``Z16``."""

SWITCHES: dict[str, str] = {
    definition.symbol: definition.switch for definition in _ALL if definition.switch
}
"""Option of the pump (`PumpOptions` of `swashplate.models.displacement_control`) that a parameter
belongs to, by symbol; each has one value."""

OPTIONS: tuple[str, ...] = tuple(dict.fromkeys(SWITCHES.values()))
"""Those options, from command to speed."""


def options_of(numbers: Mapping[str, float]) -> frozenset[str]:
    """Options whose parameters are not all zero; a parameter without a number counts as zero."""
    return frozenset(switch for name, switch in SWITCHES.items() if numbers.get(name, 0.0) != 0.0)


# --- names and what they stand for ----------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Definitions:
    """Parameters that a model has, by symbol, and what their public names stand for.

    A symbol such as ``Z16`` stands for all its columns, a column such as ``Z16_plus`` for one
    number of the model. Only here a name becomes a path in the model.
    """

    by_symbol: Mapping[str, Definition]
    paths: Mapping[str, str]
    """Path in the model of every column: ``pump.Z16_plus``."""

    @cached_property
    def columns(self) -> dict[str, str]:
        """Symbol of every column."""
        return {
            column: symbol
            for symbol, definition in self.by_symbol.items()
            for column in definition.columns
        }

    def find(self, name: str) -> Definition:
        """Definition of a symbol (``Z16``, ``spool_friction``) or column (``Z16_plus``).

        Raises
        ------
        UnknownParameterError
            If there is none of that name; the sentence lists the right ones.
        """
        symbol = self.columns.get(name, name)
        if symbol not in self.by_symbol:
            raise self._unknown(name)
        return self.by_symbol[symbol]

    def columns_of(self, names: Iterable[str]) -> list[str]:
        """Columns that symbols and columns stand for, each once, in their order; as `find`."""
        columns: list[str] = []
        for name in names:
            definition = self.find(name)
            meant = definition.columns if name == definition.symbol else (name,)
            columns.extend(column for column in meant if column not in columns)
        return columns

    def path_of(self, column: str) -> str:
        """Path in the model of a column; refuses as `find`."""
        if column not in self.paths:
            raise self._unknown(column)
        return self.paths[column]

    def _unknown(self, name: str) -> UnknownParameterError:
        """Error for a name that no parameter has."""
        close = get_close_matches(str(name), [*self.by_symbol, *self.columns], n=1)
        hint = f" (did you mean {close[0]}?)" if close else ""
        refinements = [
            symbol
            for symbol, definition in self.by_symbol.items()
            if definition.block == "refinements"
        ]
        others = [symbol for symbol in self.by_symbol if symbol not in refinements]
        sentence = f"There is no parameter '{name}'{hint}; the parameters are {', '.join(others)}"
        directional = [
            definition for definition in self.by_symbol.values() if definition.directional
        ]
        if directional:
            plus, minus = directional[0].columns
            sentence += f", those with two directions also as e.g. {plus} and {minus}"
        if refinements:
            sentence += f", and the refinements {', '.join(refinements)}"
        return UnknownParameterError(f"{sentence}.")


DEFINITIONS = Definitions(
    CATALOGUE | REFINEMENTS,
    {column: path for declared in _DECLARED for column, path in declared.paths.items()},
)
"""Definitions of the parameters of a drive with the package's equations."""


@lru_cache(maxsize=64)
def definitions_of(kinds: tuple[type, ...]) -> Definitions:
    """Definitions of the parameters of a drive whose user-defined equations add some.

    Parameters
    ----------
    kinds : tuple of classes of named tuples
        Each field a float with its `Definition`, of one value, and a default.

    Raises
    ------
    ParameterError
        If one has no definition or is called like another one.
    """
    if not kinds:
        return DEFINITIONS
    by_symbol = dict(DEFINITIONS.by_symbol)
    for kind in kinds:
        for declared in declared_by(kind):
            default = kind._field_defaults.get(declared.symbol)  # type: ignore[attr-defined]
            if declared.directional or default is None or not declared.unit:
                raise ParameterError(
                    f"{kind.__name__}.{declared.symbol} needs a Definition with a unit, one value "
                    "and a default."
                )
            definition = replace(declared, block="refinements", default=default)
            earlier = by_symbol.setdefault(declared.symbol, definition)
            if earlier != definition:
                raise ParameterError(
                    f"{kind.__name__}.{declared.symbol}: there is another parameter "
                    f"{declared.symbol}, {earlier.name}; give yours another name."
                )
    added = by_symbol.keys() - DEFINITIONS.by_symbol.keys()
    return Definitions(by_symbol, {**DEFINITIONS.paths, **{name: f"pump.{name}" for name in added}})
