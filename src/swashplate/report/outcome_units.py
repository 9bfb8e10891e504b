"""How outcomes of the analysis are shown to people: words, unit, factor."""

from __future__ import annotations

from math import isnan

from swashplate.analysis.outcomes import Outcome
from swashplate.report.display_units import DisplayUnit

_DEGREES = 57.29577951308232

_UNITS = {
    "rad": DisplayUnit("deg", _DEGREES),
    "rad/s": DisplayUnit("deg/s", _DEGREES),
    "rad/s^2": DisplayUnit("deg/s²", _DEGREES),
    "s": DisplayUnit("s", 1.0),
    "1": DisplayUnit("%", 100.0),
}


def outcome_unit(outcome: Outcome) -> DisplayUnit:
    """Unit to show an outcome in; displayed = factor * SI."""
    return _UNITS[outcome.unit]


def outcome_words(outcome: Outcome) -> str:
    """Its name as words."""
    return outcome.name.replace("_", " ")


def outcome_text(outcome: Outcome, value: float) -> str:
    """A value as text in the unit of `outcome_unit`, ``"none"`` where there is none."""
    if isnan(value):
        return "none"
    return f"{outcome_unit(outcome).factor * value:z.{3 if outcome.unit == 's' else 2}f}"
