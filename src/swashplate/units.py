"""Units at the edge: what comes in with a unit is turned into SI, or refused by name."""

from functools import cache
from math import pi
from tokenize import TokenError
from typing import Any

from swashplate.errors import InputError


@cache
def _registry() -> Any:
    # loading pint takes longer than most commands need, and SI input does not need it
    from pint import UnitRegistry

    return UnitRegistry()


_A_MINUTE = frozenset(
    "1/min min-1 min**-1 u/min upm umdr/min r/min rev/min rpm tr/min turn/min turns/min".split()  # noqa: SIM905
)
_A_SECOND = frozenset("1/s s-1 s**-1 u/s r/s rev/s rps tr/s turn/s turns/s".split())  # noqa: SIM905
"""Turns a minute and a second, as nameplates and loggers write them; folded by `_folded`."""


def _written_out(unit: str) -> str:
    return unit.replace("sqrt(Pa)", "Pa^0.5")


def _folded(unit: str) -> str:
    plain = unit.lower().translate(str.maketrans("⁻−¹", "--1", "^ "))
    return plain.replace(".", "").replace("(-1)", "-1")


def speed_unit(unit: str) -> str:
    """The unit of a shaft's speed, spelt so that `to_si` reads it: of turns, never of radians.

    1/min, min⁻¹, U/min, r/min and tr/min are turns a minute (rpm), 1/s and r/s turns a second (Hz).
    """
    if _folded(unit) in _A_MINUTE:
        return "rpm"
    return "Hz" if _folded(unit) in _A_SECOND else unit


def to_si(value: float, unit: str, si: str, what: str) -> float:
    """Convert a value to the SI unit that the model computes in.

    An angular frequency in Hz, 1/min or another of a nameplate's turns counts each as 2π.

    Parameters
    ----------
    value : float
        A number in `unit`.
    unit, si : str
        Unit that it comes in and unit wanted, e.g. ``"bar"`` and ``"Pa"``. ``"1"`` is no unit.
    what : str
        What the value is, for the error's sentence.

    Raises
    ------
    InputError
        If `unit` is unknown or measures something else.
    """
    if unit == si:
        return value
    if si == "rad/s" and _folded(unit) in _A_MINUTE:
        return 2.0 * pi / 60.0 * value
    if si == "rad/s" and unit.endswith(("Hz", "hertz")):
        # for pint a hertz is one a second, and so is a radian a second
        return 2.0 * pi * to_si(value, unit, "Hz", what)
    from pint import DimensionalityError, UndefinedUnitError
    from pint.errors import DefinitionSyntaxError

    registry, wanted = _registry(), "rad/s or rpm" if si == "rad/s" else si
    try:
        # offsets (degC) are handled by Quantity, not by a factor
        quantity = registry.Quantity(value, _written_out(unit) if unit != "1" else "")
        return float(quantity.to(_written_out(si) if si != "1" else "").magnitude)
    except UndefinedUnitError:
        raise InputError(f"{what} has the unknown unit '{unit}'; give it in {wanted}.") from None
    except DimensionalityError:
        raise InputError(
            f"{what} is given in '{unit}', which does not measure the same as {si}; "
            f"give it in {wanted}."
        ) from None
    except (
        DefinitionSyntaxError,
        AssertionError,
        AttributeError,
        TokenError,
        TypeError,
        ValueError,
    ):
        # pint's parser meets unreadable text with any of these
        raise InputError(f"{what} has the unreadable unit '{unit}'; give it in {wanted}.") from None
