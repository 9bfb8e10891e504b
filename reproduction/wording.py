"""What page and PDF both say."""

from __future__ import annotations

import re

from reproduction.content import Figure, Reproduction, Table
from reproduction.errata import ERRATA

TITLE = "Kruse (2001), reproduced"
LEAD = (
    "All figures of chapters 4 and 7, figure 9.1 and the tables of chapters 4, 7 and 8 of "
    "E. E. Kruse, Nonlinear Modeling and Simulation of a Hydrostatic Drive System, Michigan "
    "Technological University, 2001, computed anew with the published parameters."
)
NOT_MEASURED = (
    "Nothing here was measured.",
    "Every curve is simulated. What instruments read is virtual and says so. Kruse's own "
    "measurements are not at hand; of them only the printed error percentages stand here, in "
    "columns of their own.",
)
ABSENT = (
    "The text at hand states neither how a voltage is scaled nor the unit of speeds: it is divided "
    "by 10 beside currents and turret speeds, multiplied by 10 beside winch speeds, in deg/s."
)
_SUBSCRIPT = re.compile(r"_\{([^}]*)\}")


def chapters(reproduction: Reproduction) -> list[tuple[str, str, list[Figure], list[Table]]]:
    """Number, heading, figures and tables of each chapter that has any."""
    headings = {
        "4": "The control card",
        "7": "Pump and motor",
        "8": "All parameters",
        "9": "Extrapolation",
    }
    made = []
    for number, heading in headings.items():
        figures = [each for each in reproduction.figures if each.number.startswith(f"{number}.")]
        tables = [each for each in reproduction.tables if each.number.startswith(f"{number}.")]
        if figures or tables:
            made.append((number, heading, figures, tables))
    return made


def errata_of(reproduction: Reproduction) -> dict[int, str]:
    """The errata that touch something here, in their order."""
    met = {number for figure in reproduction.figures for number in figure.errata}
    met |= {
        int(cell.mark)
        for table in reproduction.tables
        for row in table.rows
        for cell in row
        if cell.mark
    }
    return {number: words for number, words in ERRATA.items() if number in met}


def as_html(text: str) -> str:
    """Text whose subscripts are elements; everything else is escaped."""
    from markupsafe import Markup, escape

    return Markup(_SUBSCRIPT.sub(r"<sub>\1</sub>", str(escape(text))))


def as_mathtext(text: str) -> str:
    """Text whose subscripts matplotlib sets."""
    return _SUBSCRIPT.sub(r"$_{\\mathrm{\1}}$", text)


def length_of(text: str) -> int:
    """Letters of a text as it is seen; of a subscript about two thirds, a minus is a wide one."""
    seen = _SUBSCRIPT.sub(lambda found: found[1][: (2 * len(found[1]) + 2) // 3], text)
    return len(seen) + (seen.count("−") + 1) // 2
