"""Limited quantities of an operation, such as swing, off-lead, hook load and place.

A crane's file gives limits in its table ``[limits]``, each with unit, status and source as its
geometry; what it does not give is not assessed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from swashplate.crane.quantities import CraneQuantity, QuantityDefinition, values_in_si
from swashplate.errors import ParameterError


class Limited(NamedTuple):
    """A quantity that an operation may have to stay within."""

    label: str
    """As it stands in a table."""
    unit: str
    """SI."""
    meaning: str
    """In a sentence's words."""
    low: float
    high: float
    """Range of plausible limits; of an angle in degrees."""


LIMITED: Mapping[str, Limited] = {
    "swing": Limited("swing", "rad", "angle between rope and plumb line", 0.1, 30.0),
    "off_lead": Limited(
        "off-lead", "rad", "angle of the rope in the boom's plane, from the crane's axis", 0.1, 30.0
    ),
    "side_lead": Limited(
        "side-lead", "rad", "angle of the rope across the boom, from the crane's axis", 0.1, 30.0
    ),
    "dynamic_factor": Limited(
        "dynamic factor", "1", "tension of the rope over the weight at rest", 1.001, 5.0
    ),
    "hook_speed": Limited("hook speed", "m/s", "vertical speed of the hook", 0.01, 20.0),
    "hoist_demand": Limited(
        "hoist demand", "1", "vertical speed of the hook over the hoist's full speed", 0.01, 10.0
    ),
    "placement": Limited(
        "place", "m", "horizontal distance of the load from its target", 0.01, 100.0
    ),
    "saturation": Limited(
        "saturation", "1", "share of time for which a drive is at one of its limits", 0.0, 1.0
    ),
}
"""Quantities that have a limit, by name. All but `saturation` are assessed by their most probable
largest value in three hours."""


DEFINITIONS: Mapping[str, QuantityDefinition] = {
    name: QuantityDefinition(limited.unit, 1, limited.low, limited.high)
    for name, limited in LIMITED.items()
}
"""The same as quantities of a crane's file."""


def limits_of(limits: Mapping[str, CraneQuantity], origin: str) -> dict[str, float]:
    """Limits in SI by name.

    Parameters
    ----------
    limits : mapping of str to CraneQuantity
        The table ``[limits]`` of a crane's file.
    origin : str
        File or crane, as errors name it.

    Raises
    ------
    ParameterError
        For a name that is not in `LIMITED`, more than one number, and a number that no crane has.
    """
    unknown = [name for name in limits if name not in LIMITED]
    if unknown:
        raise ParameterError(
            f"{origin}: limits has no entry '{unknown[0]}'; it has {', '.join(LIMITED)}."
        )
    values = {}
    for name, quantity in limits.items():
        values[name] = values_in_si(name, quantity, DEFINITIONS[name], origin)[0]
    return values
