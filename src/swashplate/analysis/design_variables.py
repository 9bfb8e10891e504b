"""Design variables: what a factor can be put on, in the words of those who build the machine."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import inf, isnan
from typing import NamedTuple

from swashplate.analysis.outcomes import meant
from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.parameters import CATALOGUE, COLUMNS, REFINEMENTS
from swashplate.tables import Column, Table

FactorRange = tuple[float, float]
"""Lowest and highest factor on a design variable. [1]"""


class DesignVariable(NamedTuple):
    """Something of a machine that can be made larger or smaller."""

    powers: Mapping[str, float]
    """Parameters by symbol, each multiplied by the factor to this power."""
    meaning: str
    """What it is, and what the model takes it for."""


MACHINE: Mapping[str, DesignVariable] = {
    "orifice": DesignVariable(
        {"Z16": 1.0},
        "Opening area of the in-line orifices, as the spool displacement of equal area: the "
        "acceleration limit.",
    ),
    "orifice_diameter": DesignVariable(
        {"Z16": 2.0},
        "Bore of the in-line orifices; their area, and with it the opening, scales with its "
        "square.",
    ),
    "pump": DesignVariable(
        {"Z10": 1.0, "Z12": 1.0},
        "Displacement of the pump: flow, and speed of the shaft, at the same swash angle.",
    ),
    "drive_speed": DesignVariable(
        {"Z10": 1.0, "Z12": 1.0},
        "Speed of the motor that drives the pump. Flow is proportional to it, as to the "
        "displacement; the control pressure does not change, because a relief valve sets it.",
    ),
    "supply_pressure": DesignVariable(
        {"Z9": 1.0},
        "Control pressure that moves the stroking piston; its flow scales with the square root.",
    ),
    "rate_limits": DesignVariable(
        {"lim1": 1.0, "lim2": 1.0}, "Both rate limits of the card's ramps."
    ),
    "rate_limit_up": DesignVariable({"lim1": 1.0}, "Rate limit of the current away from zero."),
    "rate_limit_down": DesignVariable({"lim2": 1.0}, "Rate limit of the current towards zero."),
    "dead_zone": DesignVariable(
        {"V_dz": 1.0},
        "Dead zone of the card's input; 0 means fully compensated.",
    ),
    "spool_stroke": DesignVariable(
        {"Z14": 1.0}, "Stroke of the spool: the limit that remains without orifices."
    ),
    "relief": DesignVariable({"Z15": 1.0}, "Relief pressure of the stroking piston."),
    "spool_offset": DesignVariable(
        {"Z18": 1.0}, "Displacement of the spool at rest, which makes the shaft creep."
    ),
}
"""All of them by name."""


def _with_directions() -> Iterator[tuple[str, Mapping[str, float]]]:
    for side in ("", "_plus", "_minus"):
        for name, variable in MACHINE.items():
            columns = {f"{symbol}{side}": power for symbol, power in variable.powers.items()}
            if not side or all(column in COLUMNS for column in columns):
                yield f"{name}{side}", columns


DESIGN_VARIABLES: Mapping[str, Mapping[str, float]] = dict(_with_directions())
"""Powers by symbol or column of each design variable, by its name; of parameters with two
directions also for each direction, as ``orifice_plus``."""


def powers_of(name: str) -> Mapping[str, float]:
    """Powers of a design variable, or of a parameter by symbol or column.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    if name in DESIGN_VARIABLES:
        return DESIGN_VARIABLES[name]
    if name in CATALOGUE or name in COLUMNS or name in REFINEMENTS:
        return {name: 1.0}
    hint = meant(name, [*DESIGN_VARIABLES, *CATALOGUE, *COLUMNS])
    raise InputError(
        f"There is no design variable '{name}'{hint}; there are {', '.join(MACHINE)}, those with "
        "two directions also as e.g. orifice_plus, and every parameter by its symbol."
    )


def design_variables_table() -> Table:
    """The design variables, which parameters each multiplies, and what it is."""
    table = Table(
        "",
        (Column("design variable"), Column("multiplies"), Column("what it is", wrap=True)),
    )
    suffixes = {1.0: "", 2.0: " by its square"}
    for name, variable in MACHINE.items():
        multiplied = [symbol + suffixes[power] for symbol, power in variable.powers.items()]
        directions = " _plus _minus" if f"{name}_plus" in DESIGN_VARIABLES else ""
        table.add(name + directions, ", ".join(multiplied), variable.meaning)
    return table


def check_ranges(ranges: Mapping[str, FactorRange], around: float | None = None) -> None:
    """Refuse ranges of factors that cannot be tried.

    Parameters
    ----------
    ranges : mapping of str to (float, float)
        Lowest and highest factor by design variable. [1]
    around : float, optional
        A factor that must lie in each range.

    Raises
    ------
    InputError
        If there is no design variable, an unknown one, or a range that does not rise from 0 on.
    """
    if not ranges:
        raise InputError("Name at least one design variable, such as orifice.")
    for name, (low, high) in ranges.items():
        powers_of(name)
        contains = around is None or low <= around <= high
        if not (contains and 0.0 <= low < high < inf):
            between = "" if around is None else f" and have {around:g} between them"
            raise InputError(
                f"The factors on {name} must rise from 0 or more{between}, not {low:g} to {high:g}."
            )


def with_factors(drive: Drive, factors: Mapping[str, float]) -> Drive:
    """The drive with design variables scaled, e.g. by ``{"orifice": 1.5, "pump": 1.5}``.

    Factors on the same parameter multiply.

    Parameters
    ----------
    drive : Drive
        As it is.
    factors : mapping of str to float
        By design variable, parameter or column. [1]

    Raises
    ------
    InputError
        For an unknown design variable, a refinement without a value, a factor that is negative or
        not a number, or 0 times infinity.
    ParameterError
        If the result breaks a rule of the parameters.
    """
    numbers = drive.parameters.numbers
    scaled = dict[str, float]()
    for name, factor in factors.items():
        powers = powers_of(name)
        if isinstance(factor, str):
            raise InputError(f"The factor on {name} is the text {factor!r}, but must be a number.")
        if not factor >= 0.0:
            raise InputError(f"The factor on {name} is {factor:g}, but must be 0 or more.")
        for symbol, power in powers.items():
            for column in drive.parameters.definitions.columns_of([symbol]):
                if column not in numbers:
                    raise InputError(f"{column} has no value here that a factor could change.")
                scaled[column] = scaled.get(column, numbers[column]) * factor**power
                if isnan(scaled[column]):  # 0 times inf
                    raise InputError(
                        f"{column} is {numbers[column]:g}, which the factor {factor:g} cannot "
                        "change."
                    )
    return drive.replace(**scaled)
