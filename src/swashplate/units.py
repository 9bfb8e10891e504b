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


def _written_out(unit: str) -> str:
    return unit.replace("sqrt(Pa)", "Pa^0.5")


def to_si(value: float, unit: str, si: str, what: str) -> float:
    """Convert a value to the SI unit that the model computes in.

    An angular frequency in Hz counts its turns as 2π.

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
    if si == "rad/s" and unit.endswith(("Hz", "hertz")):
        # for pint a hertz is one a second, and so is a radian a second
        return 2.0 * pi * to_si(value, unit, "Hz", what)
    from pint import DimensionalityError, UndefinedUnitError
    from pint.errors import DefinitionSyntaxError

    registry = _registry()
    try:
        # offsets (degC) are handled by Quantity, not by a factor
        quantity = registry.Quantity(value, _written_out(unit) if unit != "1" else "")
        return float(quantity.to(_written_out(si) if si != "1" else "").magnitude)
    except UndefinedUnitError:
        raise InputError(f"{what} has the unknown unit '{unit}'; give it in {si}.") from None
    except DimensionalityError:
        raise InputError(
            f"{what} is given in '{unit}', which does not measure the same as {si}; "
            f"give it in {si}."
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
        raise InputError(f"{what} has the unreadable unit '{unit}'; give it in {si}.") from None
