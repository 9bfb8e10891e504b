"""Parameters by name: symbols, columns of one direction, refinements."""

from collections.abc import Mapping
from difflib import get_close_matches

from swashplate.errors import ParameterError
from swashplate.parameters.catalogue import CATALOGUE, COLUMNS, Definition
from swashplate.parameters.refinements import REFINEMENTS


def find(name: str) -> Definition:
    """Definition of a symbol (``Z16``, ``spool_friction``) or column (``Z16_plus``).

    Raises
    ------
    ParameterError
        If there is none of that name; the sentence lists the right ones.
    """
    if name in CATALOGUE:
        return CATALOGUE[name]
    if name in COLUMNS:
        return CATALOGUE[COLUMNS[name]]
    if name in REFINEMENTS:
        return REFINEMENTS[name]
    raise unknown_parameter(name)


def unknown_parameter(name: str) -> ParameterError:
    """Error for a name that no parameter has."""
    close = get_close_matches(name, [*CATALOGUE, *COLUMNS, *REFINEMENTS], n=1)
    hint = f" (did you mean {close[0]}?)" if close else ""
    return ParameterError(
        f"There is no parameter '{name}'{hint}; the parameters are {', '.join(CATALOGUE)}, "
        "those with two directions also as e.g. Z16_plus and Z16_minus, and the refinements "
        f"{', '.join(REFINEMENTS)}."
    )


def columns_of(names: Mapping[str, object] | tuple[str, ...] | list[str]) -> list[str]:
    """Columns that a list of symbols and columns stands for, in its order.

    Raises
    ------
    ParameterError
        For a name that no parameter has, or a refinement's, which only `Drive.simulate` knows.
    """
    columns: list[str] = []
    for name in names:
        if name in REFINEMENTS:
            raise ParameterError(
                f"{name} is a refinement, which only a plain simulation knows: neither derivatives "
                "nor many sets at once are to be had by it."
            )
        definition = find(name)
        wanted = definition.columns if name == definition.symbol else (name,)
        columns.extend(column for column in wanted if column not in columns)
    return columns
