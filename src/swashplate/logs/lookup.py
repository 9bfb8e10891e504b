"""Columns by name, and the units that names carry."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from swashplate.errors import InputError
from swashplate.units import to_si

if TYPE_CHECKING:
    from swashplate.logs.log import Column

_BRACKETED = re.compile(r"(.*?)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))\s*", re.DOTALL)
_NO_UNIT = frozenset({"", "-", "–", "−", "1", "none", "None"})
_LISTED = 30


def split_unit(name: str) -> tuple[str, str | None]:
    """A header's name and the unit in brackets behind it: ``time [ms]``, ``time (ms)``."""
    match = _BRACKETED.fullmatch(name)
    if match is None or not match[1]:
        return name, None
    return match[1], (match[2] if match[2] is not None else match[3]).strip()


def find_column(columns: Sequence[Column], wanted: str, path: str | Path) -> int:
    """Position of the column of a name; see `Log.find`.

    Raises
    ------
    InputError
        If there is none or more than one; the sentence lists what there is.
    """
    names = [column.name for column in columns]
    suffixed = re.compile(rf"{re.escape(wanted)}_\w+")
    for matches in (
        lambda column: column.name == wanted,
        lambda column: _without_unit(column) == wanted,
        lambda column: suffixed.fullmatch(column.name),
        lambda column: _last(column.name) == wanted or _last(_without_unit(column)) == wanted,
    ):
        found = [position for position, column in enumerate(columns) if matches(column)]
        if len(found) == 1:
            return found[0]
        if found:
            several = _listed([names[position] for position in found])
            raise InputError(f"{path} has more than one '{wanted}': {several}; name the one.")
    raise InputError(
        f"{path} has no column '{wanted}'; it has {_listed(names)}: name the one to take."
    )


def unit_of(column: Column, wanted: str, si: str) -> str:
    """Unit that a column is in, as far as the log tells, or the SI unit.

    Parameters
    ----------
    column : Column
        What `Log.find` returned.
    wanted : str
        The name that it was asked by.
    si : str
        SI unit of what it shall be. A name like ``time_ms`` means milliseconds where that is a
        unit of the same quantity, and is just a name otherwise.

    Returns
    -------
    str
        Its own unit; or the ending of its name; or `si` where the log has no unit.
    """
    if column.unit is not None:
        return "1" if column.unit in _NO_UNIT else column.unit
    suffixed = re.fullmatch(rf"{re.escape(wanted)}_(\w+)", column.name)
    if suffixed:
        return suffixed[1]
    _, underscore, ending = column.name.rpartition("_")
    if underscore and ending != si and _measures(ending, si):
        return ending
    return si


def _measures(unit: str, si: str) -> bool:
    try:
        to_si(1.0, unit, si, "")
    except InputError:
        return False
    return True


def _without_unit(column: Column) -> str:
    # x(1,:) is a row of a matrix and no x in the unit 1,:
    name, unit = split_unit(column.name)
    return name if unit is not None and unit == column.unit else column.name


def _last(name: str) -> str:
    return name.rpartition("/")[2]


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(repr(each) for each in names[:_LISTED])
    return shown if len(names) <= _LISTED else f"{shown} and {len(names) - _LISTED} more"
