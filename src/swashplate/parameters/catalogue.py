"""Every parameter of the model: symbol, plain name, unit, range.

The symbols are those of Kruse (2001). A directional parameter has a plus and a minus value, chosen
by the sign of the signal it acts on; both are stored as magnitudes. Those of the refinements, which
no published set has, stand apart in `swashplate.parameters.refinements`.
"""

from dataclasses import dataclass
from math import inf, pi
from typing import Literal, TypedDict, Unpack

Block = Literal["control_card", "pump_motor", "refinements"]


@dataclass(frozen=True)
class Definition:
    """What a parameter is, whatever its value."""

    symbol: str
    name: str
    unit: str
    block: Block
    directional: bool = False
    lower: float = -inf
    upper: float = inf
    above: bool = False
    """The lower bound itself is excluded."""
    can_be_off: bool = False
    """Infinity is allowed and switches the limit off."""

    @property
    def range(self) -> str:
        """The allowed range as words, e.g. ``above 0``."""
        low = (
            "" if self.lower == -inf else f"{'above' if self.above else 'at least'} {self.lower:g}"
        )
        high = "" if self.upper == inf else f"below {self.upper:g}"
        words = " and ".join(part for part in (low, high) if part) or "any finite number"
        return words + (", or inf for none" if self.can_be_off else "")

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of its values: one, or one for each direction."""
        if self.directional:
            return (f"{self.symbol}_plus", f"{self.symbol}_minus")
        return (self.symbol,)


class Rules(TypedDict, total=False):
    """What a definition may say besides symbol, name and unit."""

    lower: float
    upper: float
    above: bool
    can_be_off: bool


def _card(
    symbol: str, name: str, unit: str, *, directional: bool = True, **rules: Unpack[Rules]
) -> Definition:
    return Definition(symbol, name, unit, "control_card", directional, **rules)


def _pump(
    symbol: str, name: str, unit: str, *, directional: bool = False, **rules: Unpack[Rules]
) -> Definition:
    return Definition(symbol, name, unit, "pump_motor", directional, **rules)


_DEFINITIONS = (
    _card("V_dz", "dead zone of the card", "V", lower=0.0, upper=10.0),
    _card("J", "current jump at the edge of the dead zone", "A", lower=0.0),
    _card("G1", "linear gain", "A/V"),
    _card("G2", "quadratic gain", "A/V^2"),
    _card("G3", "cubic gain", "A/V^3"),
    _card("zeta", "damping ratio of the current filter", "1", lower=0.0, above=True),
    _card("omega", "natural frequency of the current filter", "rad/s", lower=0.0, above=True),
    _card("C", "Coulomb-like term of the current filter", "A/s^2", lower=0.0),
    _card("lim1", "rate limit away from zero", "A/s", lower=0.0, above=True, can_be_off=True),
    _card("lim2", "rate limit towards zero", "A/s", lower=0.0, above=True, can_be_off=True),
    _card("I_t1", "current above which lim1 acts", "A", lower=0.0, can_be_off=True),
    _card("I_t2", "current below which the decay acts", "A", lower=0.0),
    _card("a", "rate of the final decay", "1/s", lower=0.0, can_be_off=True),
    _card("tau", "delay", "s", lower=0.0, upper=10.0, directional=False),
    _pump("Z1", "pressure to swash plate tangent", "1/Pa", lower=0.0, above=True),
    _pump("Z2", "offset of the swash plate tangent", "1"),
    _pump("Z3", "arm ratio of the feedback", "1", lower=0.0, above=True),
    _pump("Z4", "squared moment of the feedback spring", "N^2 m^2", lower=0.0, above=True),
    _pump("Z5", "arm of the spool", "m", lower=0.0, above=True),
    _pump("Z6", "piston motion against oil stiffness", "1", lower=0.0),
    _pump("Z7", "leakage around the stroking piston", "1/s", lower=0.0),
    _pump("Z8", "flow gain of the valve", "sqrt(Pa)/(m s)", lower=0.0, above=True),
    _pump("Z9", "supply pressure less static pressure", "Pa", lower=0.0, above=True),
    _pump("Z10", "swash plate angle to shaft speed", "1/s", lower=0.0, above=True),
    _pump("Z11", "speed lost to static load", "rad/s"),
    _pump("Z12", "speed lost to accelerating load", "1"),
    _pump(
        "Z13",
        "stop of the swash plate",
        "rad",
        directional=True,
        lower=0.0,
        upper=pi / 2,
        above=True,
    ),
    _pump("Z14", "stroke of the spool", "m", lower=0.0, above=True, can_be_off=True),
    _pump("Z15", "largest stroking pressure", "Pa", lower=0.0, above=True, can_be_off=True),
    _pump(
        "Z16",
        "opening at which the orifice limits the flow",
        "m",
        directional=True,
        lower=0.0,
        above=True,
        can_be_off=True,
    ),
    _pump("Z17", "dead zone of the solenoids", "A", lower=0.0),
    _pump("Z18", "plussing: spool displacement at rest", "m"),
    _pump("Z19", "solenoid force, linear", "N/A", directional=True),
    _pump("Z20", "solenoid force, quadratic", "N/A^2", directional=True),
    _pump("Z21", "solenoid force, cubic", "N/A^3", directional=True),
    _pump("Z22", "solenoid force, quartic", "N/A^4", directional=True),
)

CATALOGUE: dict[str, Definition] = {each.symbol: each for each in _DEFINITIONS}
"""Definitions by symbol, the card's first, in the order of the source's tables."""

COLUMNS: dict[str, str] = {column: each.symbol for each in _DEFINITIONS for column in each.columns}
"""Symbol of every single value, e.g. ``Z16_plus`` → ``Z16``."""
