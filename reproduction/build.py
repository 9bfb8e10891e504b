"""All figures and tables, or a part of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection
from importlib.metadata import version
from platform import python_version

from reproduction.bench import SEVERITY, Bench
from reproduction.catalogue import ERROR_TABLES, FIGURES, TABLES, Shown
from reproduction.content import Figure, Reproduction, Table
from reproduction.curves import (
    current_figure,
    inside_figure,
    larger_figure,
    other_card_figure,
    speed_figure,
)
from reproduction.diagrams import DIAGRAMS
from reproduction.parameter_tables import parameter_table
from reproduction.virtual_errors import ErrorTables
from reproduction.virtual_figures import encoder_figure, measured_current_figure
from swashplate.__about__ import __version__
from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.parameters import AXES

ALL = (*(f"figure {each.number}" for each in FIGURES), *(f"table {number}" for number in TABLES))
"""Names of all that can be reproduced, in the order in which it is made."""


def reproduce(
    *,
    seed: int = 1,
    only: Collection[str] | None = None,
    begin: Callable[[str], None] | None = None,
) -> Reproduction:
    """Reproduce Kruse's figures and tables.

    Parameters
    ----------
    seed : int
        Of the virtual tests' noise and of the fits' starts; not negative.
    only : collection of str, optional
        Names in `ALL`, such as ``"figure 4.3"`` and ``"table 7.5"``; by default all.
    begin : callable, optional
        Told the name of each before it is made.

    Raises
    ------
    InputError
        For an unknown name, or a seed that is negative.
    """
    if seed < 0:
        raise InputError(f"seed must not be negative, not {seed}.")
    wanted = ALL if only is None else only
    for name in wanted:
        if name not in ALL:
            raise InputError(f"There is no {name} to reproduce; there are {', '.join(ALL)}.")
    bench = Bench(seed)
    errors = ErrorTables(bench)
    figures, tables = list[Figure](), list[Table]()
    for shown in FIGURES:
        name = f"figure {shown.number}"
        if name in wanted:
            if begin is not None:
                begin(name)
            figures.append(_figure(shown, bench))
    for number in TABLES:
        name = f"table {number}"
        if name in wanted:
            if begin is not None:
                begin(name)
            made = errors.table(number) if number in ERROR_TABLES else parameter_table(number)
            tables.append(made)
    return Reproduction(tuple(figures), tuple(tables), seed, _provenance(seed))


def _figure(shown: Shown, bench: Bench) -> Figure:
    match shown.kind:
        case "diagram":
            return DIAGRAMS[shown.number]
        case "current":
            return current_figure(shown)
        case "speed":
            return speed_figure(shown)
        case "inside":
            return inside_figure(shown)
        case "other card":
            return other_card_figure(shown)
        case "larger":
            return larger_figure(shown)
        case "encoder":
            return encoder_figure(shown, bench)
        case "measured current":
            return measured_current_figure(shown, bench)


def _provenance(seed: int) -> tuple[tuple[str, str], ...]:
    rows = [
        (
            "source",
            "E. E. Kruse, Nonlinear Modeling and Simulation of a Hydrostatic Drive System, MS "
            "thesis, Michigan Technological University, 2001",
        )
    ]
    for axis in AXES:
        parameters = Drive.preset(axis).parameters
        counted = Counter(each.status for each in parameters.values())
        statuses = ", ".join(f"{number} {status}" for status, number in sorted(counted.items()))
        tables = sorted(
            {
                number
                for each in parameters.values()
                for number in each.source.removeprefix("tables ").removeprefix("table ").split(", ")
            }
        )
        rows.append(
            (
                f"parameters, {axis}",
                f"packaged set, card {parameters.card}; tables {', '.join(tables)}; {statuses}",
            )
        )
    rows.append(("virtual tests", f"instruments {SEVERITY}, seed {seed}"))
    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "llvmlite", "scipy"))
    rows.append(("versions", f"swashplate {__version__}, Python {python_version()}, {packages}"))
    return tuple(rows)
