"""Telling a row of units from a row of names."""

from __future__ import annotations

import re
from collections.abc import Sequence

_KNOWN = frozenset(
    """
    s sec secs second seconds ms msec us µs μs min minute minutes h hr hour hours
    hz khz mhz 1/s v mv kv volt volts a ma amp amps ampere amperes ohm ω
    pa hpa kpa mpa bar mbar psi atm n kn mn lbf nm knm j kj w kw hp ps
    m mm cm km um µm μm in inch inches ft rad mrad deg degree degrees ° grad gon
    rev revs revolution revolutions turn turns rpm l ml cc g kg t lb
    k c °c degc celsius f °f degf kelvin
    % percent ppm count counts cts inc incs adc bit bits lsb digit digits pulse pulses
    - – − 1 none n/a dimensionless
    """.split()  # noqa: SIM905 - a list of so many strings is unreadable
)
_SHORT = 4
"""Letters that a word may have that is taken for a unit because of its neighbours."""
_PARTS = re.compile(r"[\s*/·.()^²³0-9-]+")
_BRACKETS = re.compile(r"\[.*\]|\(.*\)")


def is_unit(cell: str) -> bool:
    """Whether a cell is a unit: in brackets, or made of the units of such logs."""
    if _BRACKETS.fullmatch(cell) or cell.lower() in _KNOWN:
        return True
    parts = [part for part in _PARTS.split(cell.lower()) if part]
    return bool(parts) and all(part in _KNOWN for part in parts)


def units_of(cells: Sequence[str]) -> tuple[str | None, ...] | None:
    """Units of a row of them, None where a cell is empty; or None if it is no such row."""
    filled = [cell for cell in cells if cell]
    known = sum(is_unit(cell) for cell in filled)
    # a short word of another language may stand among units, such as Imp for pulses
    others = [cell for cell in filled if not is_unit(cell)]
    if not known or 2 * known <= len(filled) or any(len(cell) > _SHORT for cell in others):
        return None
    return tuple(
        cell[1:-1].strip() if _BRACKETS.fullmatch(cell) else cell or None for cell in cells
    )


def labview_units(lines: Sequence[str], width: int) -> tuple[str | None, ...] | None:
    """Units in the header of LabVIEW's measurement files, whose first column is the time."""
    for line in lines:
        label, *units = line.rstrip().split("\t")
        if label == "Y_Unit_Label" and len(units) < width:
            padded = [*units, *[""] * (width - 1 - len(units))]
            return ("s", *(unit or None for unit in padded))
    return None
