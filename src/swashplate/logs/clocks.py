"""Clocks of a log: units of its stamps, and calendars that are told by the size of a number.

Loggers count from 1601, 1899, 1904, 1970 or the year 1, in anything from nanoseconds to days. For
machines of this century most of these numbers can be one thing only.
"""

from __future__ import annotations

import re
from math import inf, isclose
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.units import to_si

SINCE_1970 = 1e8
"""Stamps that begin beyond this are a calendar's and are counted from the first. [s]"""
_SINCE = re.compile(r"\s*(\S+)\s+since\b.*", re.DOTALL)
_TICKS = "100 ns"  # of Windows; Pint takes no number in a unit
_DAY = 86_400.0
_FROM, _TO = 946_684_800.0, 2_840_140_800.0  # 2000 and 2060, in seconds since 1970


def second_of(unit: str, what: str) -> float:
    """Size of a unit of time, also of "100 ns" and of "days since 1970-01-01". [s]

    `what` names the clock in the sentence of the error, an `InputError`.
    """
    since = _SINCE.fullmatch(unit)
    plain = since[1] if since else unit
    if plain.replace(" ", "").lower() == _TICKS.replace(" ", ""):
        return 1e-7
    return to_si(1.0, plain, "s", what)


class Calendar(NamedTuple):
    """A way to write a date as a number."""

    unit: str
    size: float
    """Of the unit. [s]"""
    epoch: float
    """Seconds from its zero to 1970."""
    name: str
    longest_step: float
    """Interval of stamps beyond which the number may well be a shorter one since a start. [s]"""
    is_whole: bool | None = None
    """Whether it comes in whole numbers, or never does; None if either."""


CALENDARS = (
    # a slower log of whole numbers may be of milliseconds, microseconds, ... since a start
    Calendar("s", 1.0, 0.0, "seconds since 1970", 0.1),
    Calendar("ms", 1e-3, 0.0, "milliseconds since 1970", 0.1),
    Calendar("us", 1e-6, 0.0, "microseconds since 1970", 0.1),
    Calendar("ns", 1e-9, 0.0, "nanoseconds since 1970", inf),
    Calendar("s", 1.0, 2_082_844_800.0, "seconds since 1904, as of LabVIEW", 0.1),
    Calendar(
        _TICKS, 1e-7, 11_644_473_600.0, "ticks since 1601, as of FILETIME and TwinCAT", inf, True
    ),
    Calendar(_TICKS, 1e-7, 62_135_596_800.0, "ticks since the year 1, as of .NET", 0.1, True),
    # seconds of a day, from 10:09 on, are of this size, but such a log has more than 86 kHz then
    Calendar("d", _DAY, 25_569.0 * _DAY, "days since 1899-12-30, as of Excel", 1.0, False),
    Calendar(
        "microday",
        1e-6 * _DAY,
        25_569.0 * _DAY,
        "days since 1899-12-30 times 1e6, as of WinCC",
        0.1,
        False,
    ),
    Calendar("d", _DAY, 719_529.0 * _DAY, "days since the year 0, as MATLAB's datenum", 1.0, False),
    Calendar("d", _DAY, 2_440_587.5 * _DAY, "Julian days", 1.0, False),
)
"""Calendars whose numbers of the years 2000 to 2060 do not overlap, given their steps."""


class Stamps(NamedTuple):
    """What tells a calendar: first number of a clock and usual interval, in its unit."""

    first: float
    step: float
    are_whole: bool

    @classmethod
    def of(cls, numbers: NDArray[np.float64], first: float | None = None) -> Stamps:
        """Of numbers (n,) of which some may be missing; the clock may begin before them."""
        finite = numbers[np.isfinite(numbers)]
        if finite.size < 2:
            return cls(0.0, 0.0, are_whole=True)
        begin = float(finite[0]) if first is None else first
        return cls(begin, float(np.median(np.diff(finite))), bool(np.all(finite % 1.0 == 0.0)))


def calendar_of(stamps: Stamps) -> Calendar | None:
    """The calendar that stamps can only be of, None if they may be anything."""
    for calendar in CALENDARS:
        if (
            _FROM <= calendar.size * stamps.first - calendar.epoch < _TO
            and 0.0 < calendar.size * stamps.step <= calendar.longest_step
            and calendar.is_whole in (None, stamps.are_whole)
        ):
            return calendar
    return None


def second_of_clock(unit: str, stamps: Stamps, what: str) -> float:
    """Size of a clock's unit [s], refused if its stamps are a calendar's in another unit.

    `what` names the clock in the error's sentence.

    Raises
    ------
    InputError
        If the unit is unknown, or another than the stamps can only have.
    """
    size = second_of(unit, what)
    calendar = calendar_of(stamps)
    if calendar is not None and not isclose(size, calendar.size, rel_tol=1e-6):
        raise InputError(
            f"{what} begins at {stamps.first:.12g}, which is not in '{unit}': such numbers are "
            f'{calendar.name}; write unit = "{calendar.unit}" for it.'
        )
    return size


def seconds_to_1970(first: float, size: float) -> float:
    """Seconds from the zero of a clock to 1970, by its first stamp and its unit of so many s."""
    for calendar in CALENDARS:
        is_in_unit = isclose(size, calendar.size, rel_tol=1e-6)
        if is_in_unit and _FROM <= size * first - calendar.epoch < _TO:
            return calendar.epoch
    return 0.0
