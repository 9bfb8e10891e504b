"""Numbers as an engineer's table shows them: as many digits as are known, a unit that reads."""

from __future__ import annotations

from math import floor, isfinite, log10

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
DIGITS = 5
"""Significant digits of a number of which no error is known."""
NONE = "–"
"""Stands where a table has no number."""


def plain(value: float, digits: int = DIGITS) -> str:
    """A number of some significant digits, with a power of ten where it needs one."""
    if not isfinite(value):
        return "none" if value == float("inf") else NONE
    if value == 0.0:
        return "0"
    power = _power(value)
    scaled = value / 10.0**power
    decimals = max(digits - 1 - floor(log10(abs(scaled)) + 1e-12), 0)
    return _times(f"{scaled:.{decimals}f}", power)


def spread(value: float, lower: float, upper: float) -> tuple[str, str]:
    """A value and its interval, both to two digits of the interval's half width.

    Returns
    -------
    (str, str)
        ``("0.12730", "0.12696 … 0.12763")``.
    """
    half = 0.5 * (upper - lower)
    if not (isfinite(half) and half > 0.0):
        return plain(value), f"{plain(lower)} … {plain(upper)}"
    power = _power(max(abs(value), half))
    decimals = min(max(1 - floor(log10(half / 10.0**power)), 0), 12)
    low, middle, high = (f"{each / 10.0**power:.{decimals}f}" for each in (lower, value, upper))
    return _times(middle, power), _times(f"{_minus(low)} … {_minus(high)}", power)


def percent(part: float, whole: float, *, sign: bool = False) -> str:
    """A part of a whole in per cent, two significant digits."""
    if whole == 0.0 or not isfinite(part / whole):
        return NONE
    number = 100.0 * part / abs(whole)
    size = abs(number)
    decimals = 0 if size >= 10.0 else 1 if size >= 1.0 else 2 if size >= 0.1 else 3
    text = f"{number:+.{decimals}f}" if sign else f"{number:.{decimals}f}"
    return f"{_minus(text)} %"


def fixed(value: float | None, decimals: int) -> str:
    """A number of some decimals, or a dash where there is none."""
    return NONE if value is None else _minus(f"{value:.{decimals}f}")


def seconds(value: float) -> str:
    """An instant or a time in seconds, without idle zeros."""
    return _minus(f"{value:.3f}".rstrip("0").rstrip("."))


def unit_text(unit: str) -> str:
    """A unit of the parameter files as print shows it: ``A/V^2`` as ``A/V²``."""
    if unit == "1":
        return ""
    base, *rest = unit.split("^")
    for part in rest:
        length = len(part) - len(part.lstrip("-0123456789"))
        base += part[:length].translate(_RAISED) + part[length:]
    return base.replace("sqrt(Pa)", "√Pa")


def listed(words: list[str]) -> str:
    """``a, b and c``."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def count(number: int, what: str) -> str:
    """``1 run``, ``13 runs``, ``110,605 samples``."""
    return f"{number:,} {what}{'' if number == 1 else 's'}"


def _power(value: float) -> int:
    """The power of ten to write apart, 0 for numbers that read without."""
    power = floor(log10(abs(value)) + 1e-12)
    return 0 if -3 <= power < 5 else power


def _times(text: str, power: int) -> str:
    text = _minus(text) if "…" not in text else text
    return f"{text} ·10{str(power).translate(_RAISED)}" if power else text


def _minus(text: str) -> str:
    return text.replace("-", "−")
