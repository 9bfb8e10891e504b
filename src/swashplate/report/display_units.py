"""Units that people read measured signals in, chosen by the SI unit and the size."""

from typing import NamedTuple


class DisplayUnit(NamedTuple):
    """A unit for axes, and its size: displayed = factor * SI."""

    name: str
    """Empty for a number without unit."""
    factor: float

    def label(self, words: str) -> str:
        """What an axis shows, with the unit in parentheses if there is one."""
        return f"{words} ({self.name})" if self.name else words


_DEGREES = 57.29577951308232

_UNITS: dict[str, tuple[tuple[float, DisplayUnit], ...]] = {
    "rad": ((0.0, DisplayUnit("deg", _DEGREES)),),
    "rad/s": ((0.0, DisplayUnit("deg/s", _DEGREES)),),
    "m": ((10.0, DisplayUnit("m", 1.0)), (0.0, DisplayUnit("mm", 1e3))),
    "m/s": ((10.0, DisplayUnit("m/s", 1.0)), (0.0, DisplayUnit("mm/s", 1e3))),
    "Pa": ((1e4, DisplayUnit("bar", 1e-5)), (0.0, DisplayUnit("kPa", 1e-3))),
    "A": ((0.1, DisplayUnit("A", 1.0)), (0.0, DisplayUnit("mA", 1e3))),
    "1": ((0.0, DisplayUnit("", 1.0)),),
}
"""By SI unit: the smallest size that each display unit is for, the largest first."""


def display_unit(unit: str, largest: float) -> DisplayUnit:
    """Unit to show a signal in.

    Parameters
    ----------
    unit : str
        The signal's SI unit. Another one, of a signal of kind ``"other"``, is shown as it is.
    largest : float
        Largest magnitude of what is shown, in `unit`.
    """
    for size, shown in _UNITS.get(unit, ()):
        if largest >= size or size == 0.0:
            return shown
    return DisplayUnit(unit, 1.0)
