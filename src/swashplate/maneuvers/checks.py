"""Numbers for a manoeuvre, checked: what is wrong raises InputError, by its `name`."""

import math

import numpy as np
import numpy.typing as npt

from swashplate.errors import InputError
from swashplate.maneuvers.curves import Array


def finite(name: str, value: float) -> float:
    """Return `value` as a float, or raise InputError if it is no finite number."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be a number, not {value!r}.") from None
    if not math.isfinite(number):
        raise InputError(f"{name} must be finite, not {number}.")
    return number


def positive(name: str, value: float) -> float:
    """Return `value` as a float, or raise InputError if it is not finite and positive."""
    if (number := finite(name, value)) <= 0.0:
        raise InputError(f"{name} must be positive, not {number:g}.")
    return number


def not_negative(name: str, value: float) -> float:
    """Return `value` as a float, or raise InputError if it is not finite or negative."""
    if (number := finite(name, value)) < 0.0:
        raise InputError(f"{name} must not be negative, not {number:g}.")
    return number


def whole(name: str, value: object) -> int:
    """Return `value` as an integer, or raise InputError if it is none or negative."""
    if not isinstance(value, int | np.integer) or value < 0:
        raise InputError(f"{name} must be a whole number from 0 up, not {value!r}.")
    return int(value)


def row(name: str, values: npt.ArrayLike) -> Array:
    """Copy `values` to a row; raise InputError unless it has one or more numbers, all finite."""
    try:
        numbers = np.array(values, dtype=float, ndmin=1)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be numbers, not {values!r}.") from None
    if numbers.ndim != 1 or numbers.size == 0:
        raise InputError(f"{name} must be one row of numbers, not of shape {numbers.shape}.")
    wrong = np.flatnonzero(~np.isfinite(numbers))
    if wrong.size:
        where = f"row {wrong[0]} (the first is 0) is {numbers[wrong[0]]}"
        raise InputError(f"{name} must be finite, but {where}.")
    return numbers


def window(start: float, settle: float | None, length: float) -> tuple[float, float, float]:
    """Start and end of the command between rest and return, and the whole length.

    Parameters
    ----------
    start, settle, length : float
        Rest before the command, return after it (None for none) and the whole. [s]

    Raises
    ------
    InputError
        If one is negative or not finite, or nothing is left for the command.
    """
    start, length = not_negative("start", start), not_negative("length", length)
    settle = not_negative("settle", settle or 0.0)
    if start + settle >= length:
        raise InputError(
            f"start {start:g} s and settle {settle:g} s leave nothing of a length of {length:g} s."
        )
    return start, length - settle, length
