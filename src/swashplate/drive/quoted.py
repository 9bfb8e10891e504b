"""Numbers that people quote of a machine, and the one way in which they are shown.

They are computed by `analysis.key_numbers`. The table, its digits and its words are made here, so
that the terminal, a report, a notebook and a page show the same text.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import ceil, copysign, floor, log10
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from swashplate.errors import UnknownNameError
from swashplate.parameters import LoggedCommand
from swashplate.results import Tabular, short
from swashplate.tables import NONE, Column, Table, listed, percent, plain
from swashplate.units import display_unit

if TYPE_CHECKING:
    import polars

Direction = Literal["plus", "minus", ""]
"""Of motion; empty for a number that is the same both ways."""
DIRECTIONS: tuple[Direction, Direction] = ("plus", "minus")

NOT_SEEN, FIXED = "not seen", "fixed"
"""Notes of a number that tests did not show, and of one that no stage of the fit moved."""
AT_BOUND, MARK = "at its bound", "*"
"""End of the note of a number that an estimate at its bound decides, and what stands next to it."""
MEANINGS = {
    NOT_SEEN: "Not seen: no test shows it, or reached the limit that decides it.",
    "not tested": "Not tested: no run moves in that direction.",
    "not determined": "Not determined: it depends on parameters that the tests do not determine.",
    FIXED: "Fixed: it depends on parameters that were not fitted.",
    "Z16_": "Z16 fixed: the fit did not estimate an orifice, which can be mistaken for a lag.",
}
"""Meaning of the words that are shown next to a number."""
INTERVALS = "With 95 % intervals of the fit, rounded up, which do not cover unmodelled effects."
EXACT = 1e-9
"""Half width over the value up to which an interval counts as none. [1]"""
AS_GOOD_AS_NONE = 0.01
"""Value over the half width of its interval up to which it counts as 0. [1]"""
LOPSIDED = 1.2
"""Ratio of an interval's two sides from which both of its ends are shown."""


class KeyNumber(NamedTuple):
    """One number of a machine, with its 95 % interval if tests tell one."""

    def __repr__(self) -> str:
        return short(self)

    name: str
    """Such as ``top_speed``."""
    direction: Direction
    unit: str
    """SI; the name of the log's column in quotes for a command that is not logged in V."""
    value: float | None
    """Of plus and minus with its sign, but gains, delays and lags; None if there is none."""
    lower: float | None = None
    """End of the interval nearer to minus infinity; None if there is no end."""
    upper: float | None = None
    note: str = ""
    """Why an end is missing, or what the interval leaves out."""

    @property
    def label(self) -> str:
        """Name with the direction: ``top_speed_plus``."""
        return f"{self.name}_{self.direction}" if self.direction else self.name

    @property
    def interval(self) -> tuple[float | None, float | None]:
        """Both ends of the 95 % interval; None if there is no end."""
        return self.lower, self.upper

    @property
    def unseen(self) -> bool:
        """Whether its interval contains 0, so that nobody can tell it from none."""
        if self.lower is None or self.upper is None or self.lower == self.upper:
            return False
        return self.lower <= 0.0 <= self.upper

    @property
    def shown(self) -> str:
        """The number with its unit, as its row of the table has it."""
        unit = display_unit(self.unit, abs(self.value or 0.0) or float("inf"))
        return f"{self.text(unit.factor)} {unit.name}"

    def text(self, factor: float = 1.0) -> str:
        """The number as it is shown, times a factor: with its interval, or as an end."""
        if self.value is None:
            return self.note or NONE
        value = factor * self.value
        ends = [None if end is None else factor * end for end in self.interval]
        words, note = self._words(value, *ends)
        return f"{words}{note}"

    def _words(self, value: float, lower: float | None, upper: float | None) -> tuple[str, str]:
        """The number in words, and its note."""
        alone = "0" if value == 0.0 else plain(value, 4)
        if lower is None and upper is None:
            return (self.note, "") if self.note == NOT_SEEN and value else (alone, self._behind())
        if lower is None or upper is None:
            # one end is of the size, whatever the direction
            at_least = (upper is None) == (value >= 0.0)
            end = lower if upper is None else upper
            assert end is not None
            words = f"at {'least' if at_least else 'most'} {_rounded(end, towards_zero=at_least)}"
            if self.note == NOT_SEEN:
                return words, f", {NOT_SEEN}"
            return f"{alone} ({words})", self._behind()
        below, above = value - lower, upper - value
        half = max(below, above)
        if half <= EXACT * abs(value):
            return alone, self._behind()
        decimals = _decimals(value, half)
        if self.name == "creep" and self.unseen:
            return f"0, {NOT_SEEN}", f" ({_down(lower, decimals)} to {_up(upper, decimals)})"
        shown = _unsigned_zero(f"{value:.{decimals}f}")
        if half <= LOPSIDED * min(below, above):
            return f"{shown} ± {_up(half, decimals)}", self._behind()
        return f"{shown} ({_down(lower, decimals)} to {_up(upper, decimals)})", self._behind()

    def _behind(self) -> str:
        if self.note.endswith(AT_BOUND):
            return f" {MARK}"
        return f" ({self.note})" if self.note else ""


class ActingLimit(NamedTuple):
    """A limit that acts in steps to the largest commands and back."""

    name: str
    time_share: float
    """Share of the time of these steps. [1]"""


class FirstChange(NamedTuple):
    """The component whose change makes these steps follow best."""

    component: str
    """With the change, in words."""
    error_share: float
    """By how much of itself the rms error of the speed falls without its limit, against a drive
    without limits. [1]"""
    without_end: tuple[str, ...] = ()
    """Its columns whose estimates have no upper end, so that it may limit less."""

    @property
    def sentences(self) -> list[str]:
        """What to change first, and how sure that is."""
        share = f"{100.0 * self.error_share:.1f} %"
        first = (
            f"Change first: {self.component}. Without this limit the rms error of the speed, "
            f"against a drive without limits, falls by {share}."
        )
        if not self.without_end:
            return [first]
        unsure = f"The tests give {listed(self.without_end)} no upper end: it may limit less."
        return [first, unsure]


ROWS = {
    "dead_zone": "Dead zone",
    "gain": "Gain beyond it",
    "jump": "Jump there",
    "top_speed": "Top speed",
    "acceleration": "Acceleration",
    "delay": "Delay, to 2 %",
    "lag": "Lag, to 63 %",
    "creep": "Creep at rest",
}
"""Labels of the numbers by name."""


@dataclass(frozen=True)
class KeyNumbers(Tabular):
    """The numbers that matter of a machine, and what limits it.

    Examples
    --------
    >>> from swashplate import Drive, analysis
    >>> numbers = analysis.key_numbers(Drive.preset("hoist"))
    >>> round(numbers["top_speed_plus"].value, 2)
    3.42
    >>> numbers.limits[0].name
    'orifice'
    """

    name: str
    """Name of the machine."""
    commands: tuple[float, float]
    """Largest command each way, magnitudes: those of its tests, ±10 V at the card without any. In
    the stick's own volts, from its rest."""
    numbers: tuple[KeyNumber, ...]
    limits: tuple[ActingLimit, ...] = ()
    """Those that act longest in steps to the largest commands and back, the longest first."""
    change_first: FirstChange | None = None
    """What to change first; None if no single change makes the error smaller."""
    tested: bool = False
    """Whether the commands are those of tests."""
    fitted: bool = False
    """Whether intervals are those of a fit."""
    stick: LoggedCommand | None = None
    """How logs hold the command, if not as volts at the card."""
    remarks: tuple[str, ...] = ()
    """What the numbers rest on, and why some are missing."""

    def __getitem__(self, label: str) -> KeyNumber:
        """A number by its name with the direction, such as ``acceleration_minus``, or ``creep``.

        Raises
        ------
        UnknownNameError
            If there is no such number.
        """
        for number in self.numbers:
            if number.label == label:
                return number
        known = listed([number.label for number in self.numbers])
        raise UnknownNameError(f"{self.name} has no number '{label}'; there are {known or 'none'}.")

    @property
    def commands_text(self) -> str:
        """The largest commands in words."""
        plus, minus = self.commands
        unit = command_unit(self.stick)
        return f"±{plus:.3g} {unit}" if plus == minus else f"{plus:.3g} and -{minus:.3g} {unit}"

    def _rows(self) -> Iterable[tuple[str, tuple[KeyNumber, ...]]]:
        """Numbers of the same name together, plus first, by their label."""
        for name, label in ROWS.items():
            together = tuple(number for number in self.numbers if number.name == name)
            if together:
                yield label, together

    def table(self) -> Table:
        """Each number one way and the other, in the units that people read."""
        head = (
            Column("quantity"),
            Column("positive", "s"),
            Column("negative", "s"),
            Column("unit"),
        )
        table = Table("", head)
        for label, together in self._rows():
            size = max((abs(number.value or 0.0) for number in together), default=0.0)
            shown = display_unit(together[0].unit, size or float("inf"))
            texts = [number.text(shown.factor) for number in together]
            table.add(label, texts[0], texts[1] if len(texts) > 1 else "", shown.name)
        return table

    def to_polars(self) -> polars.DataFrame:
        """Every number, SI: ``number``, ``unit``, ``value``, ``lower``, ``upper`` and ``note``."""
        import polars as pl

        return pl.DataFrame(
            [
                {
                    "number": number.label,
                    "unit": number.unit,
                    "value": number.value,
                    "lower": number.lower,
                    "upper": number.upper,
                    "note": number.note,
                }
                for number in self.numbers
            ],
            schema_overrides=dict.fromkeys(("value", "lower", "upper"), pl.Float64),
        )

    @property
    def basis(self) -> list[str]:
        """What the numbers rest on, and the meanings of the words next to them."""
        if not self.numbers:
            return [*self.remarks]
        sentences = [
            "Top speed, largest acceleration, delay and lag are those of steps from rest to "
            f"{self.commands_text}{', the largest commands of the tests' if self.tested else ''}."
        ]
        sentences += [INTERVALS] if self.fitted else []
        if self.stick is not None:
            at_rest = quantity_at_rest(self.stick)
            sentences.append(
                f"Commands are those of '{self.stick.column}', counted from {at_rest} at rest."
            )
        if bounded := dict.fromkeys(
            number.note.removesuffix(AT_BOUND).strip()
            for number in self.numbers
            if number.note.endswith(AT_BOUND)
        ):
            sentences.append(
                f"{MARK} Decided by {listed([*bounded])}, at a bound of the search: the error may "
                "be larger."
            )
        notes = [number.text() for number in self.numbers]
        for word, meaning in MEANINGS.items():
            if any(word in note for note in notes):
                sentences.append(meaning)
        return [*sentences, *self.remarks]

    @property
    def what_limits(self) -> list[str]:
        """Which limits act in steps to the largest commands, and which to change first."""
        if not self.numbers:
            return []
        shares = [f"{limit.name} {percent(limit.time_share, 1.0)}" for limit in self.limits]
        heading = f"Share of the time of steps from rest to {self.commands_text} and back"
        acting = f"{heading}: {', '.join(shares) or 'nothing acts'}."
        if self.change_first is None:
            return [acting]
        return [acting, *self.change_first.sentences]

    @property
    def sentences(self) -> list[str]:
        """What limits the machine, then what its numbers rest on."""
        return [*self.what_limits, *self.basis]


# --- the stick ------------------------------------------------------------------------------------


LONGEST = 12
"""Characters of a column's name that may stand in the place of a unit."""


def command_unit(stick: LoggedCommand | None) -> str:
    """Unit of a command as logs hold it: V, or the column's name if it is scaled from another."""
    if stick is None or stick.scale == 1.0 or not stick.unit:
        return "V"
    return f"'{stick.column}'" if len(stick.column) <= LONGEST else "logged"


def quantity_at_rest(stick: LoggedCommand) -> str:
    """What a log holds while the command rests, in words."""
    unit = command_unit(stick)
    number = float(stick.numbers(np.zeros(1))[0])
    return f"{number + 0.0:.4g} {stick.unit or unit}" if unit == "V" else f"{number + 0.0:.4g}"


# --- digits ---------------------------------------------------------------------------------------


def _decimals(value: float, half: float) -> int:
    """As many as an interval gives sense to, and no more than an engineer would write down."""
    decimals = 1 - floor(log10(half))
    decimals = min(decimals, 3 - floor(log10(max(abs(value), half))))
    # of a number that is hardly known its size remains, but of one that is as good as 0
    known = abs(value) > AS_GOOD_AS_NONE * half
    return max(decimals, 1 - floor(log10(abs(value))) if known else 0, 0)


def _unsigned_zero(number: str) -> str:
    """A number as it is printed, a zero without a sign."""
    return number if float(number) else number.removeprefix("-")


def _up(number: float, decimals: int) -> str:
    scale = 10.0**decimals
    return _unsigned_zero(f"{ceil(number * scale - 1e-9) / scale:.{decimals}f}")


def _down(number: float, decimals: int) -> str:
    scale = 10.0**decimals
    return _unsigned_zero(f"{floor(number * scale + 1e-9) / scale:.{decimals}f}")


def _rounded(number: float, *, towards_zero: bool) -> str:
    """A number rounded to three digits, towards 0 or away from it."""
    if number == 0.0:
        return "0"
    decimals = 2 - floor(log10(abs(number)))
    digits = abs(number) * 10.0**decimals
    size = (floor(digits + 1e-9) if towards_zero else ceil(digits - 1e-9)) / 10.0**decimals
    return f"{copysign(size, number):.{max(decimals, 0)}f}"
