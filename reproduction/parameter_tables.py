"""Tables 4.1 to 4.4, 7.1 to 7.4 and 8.1 to 8.3 from the package's parameter sets.

The sets store magnitudes; the tables carry Kruse's signs, in his order and notation. A cell
whose content differs from what Kruse (2001) prints bears the number of the erratum.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

from reproduction.content import Cell, Table
from swashplate.drive import Drive
from swashplate.rig import COUNTS_PER_TURN

AXES = ("hoist", "slew", "luff")
ENCODER_COUNTS = {"hoist": 400.0, "slew": 81_000.0, "luff": 635.0 * 4.0}
"""Counts in a turn of the encoder itself, erratum 24 resolved."""
MAGNITUDES = "Minus values are signed as Kruse (2001) prints them; the package stores magnitudes."


class Symbol(NamedTuple):
    """A parameter as in Kruse's tables."""

    name: str
    """In the package's sets."""
    label: str
    unit: str
    printed: str = ""
    """Erratum of the unit, where Kruse (2001) prints another."""


_SYMBOLS = {
    each.name: each
    for each in (
        Symbol("tau", "τ_{td}", "s"),
        Symbol("zeta", "ζ", "n.d."),
        Symbol("omega", "ω_{n}", "rad/s"),
        Symbol("C", "C", "A/s²", "3"),
        Symbol("lim1", "İ_{lim1}", "A/s"),
        Symbol("lim2", "İ_{lim2}", "A/s"),
        Symbol("I_t1", "I_{t,1}", "A"),
        Symbol("I_t2", "I_{t,2}", "A"),
        Symbol("a", "a", "1/s"),
        Symbol("J", "J", "A"),
        Symbol("V_dz", "V_{dz}", "V"),
        Symbol("G1", "G_{1}", "A/V"),
        Symbol("G2", "G_{2}", "A/V²"),
        Symbol("G3", "G_{3}", "A/V³"),
    )
}
_STATIC = ("J", "V_dz", "G1", "G2", "G3")
_DYNAMIC = ("tau", "zeta", "omega", "C", "lim1", "lim2", "I_t1", "I_t2", "a")
_NEGATIVE = {"J", "V_dz", "I_t1", "I_t2"}
"""Minus values that Kruse (2001) prints as negative numbers, tables 4.3 and 4.4."""
_SIGNS = {
    **dict.fromkeys((*_NEGATIVE, "lim1", "Z13", "Z16"), (1.0, -1.0)),
    "lim2": (-1.0, 1.0),
}
"""Signs of the plus and the minus value in tables 7.2 to 7.4 and 8.1 to 8.3."""
_CARD_GRID = (
    ("V_dz", "G1", "I_t1"),
    ("J", "G2", "I_t2"),
    ("zeta", "G3", "lim1"),
    ("omega", "tau", "lim2"),
    ("C", "a", ""),
)
_PUMP_GRID = (*((f"Z{n}", f"Z{n + 7}", f"Z{n + 14}") for n in range(1, 8)), ("", "", "Z22"))


def card_table(number: str) -> Table:
    """Tables 4.1 to 4.4: one channel of both cards, steady or dynamic parameters."""
    static, plus = number in ("4.1", "4.3"), number in ("4.1", "4.2")
    drives = {axis: Drive.preset(axis) for axis in ("hoist", "slew")}
    rows = []
    for name in _STATIC if static else _DYNAMIC:
        symbol = _SYMBOLS[name]
        cells = []
        for axis, drive in drives.items():
            values = drive[name].values
            sign = -1.0 if not plus and name in _NEGATIVE else 1.0
            wrong = (number, name, axis) == ("4.3", "V_dz", "slew") or (number, name) == (
                "4.4",
                "a",
            )
            cells.append(Cell(_number(sign * values[0 if plus else -1]), "5" if wrong else ""))
        rows.append((Cell(f"{symbol.label} ({symbol.unit})", symbol.printed), *cells))
    notes = [] if plus else [MAGNITUDES]
    if number == "4.3":
        notes.append("Printed for slew: V_{dz} 0.088321.")
    if number == "4.4":
        notes.append("Printed: a −21.379 s, and a text that calls the channel positive.")
    if not static:
        notes.append("Printed: C in A.")
    side, what = "positive" if plus else "negative", "steady" if static else "dynamic"
    title = f"Control card, {side} channel, {what} parameters"
    return Table(number, title, ("", "hoist", "slew and luff"), tuple(rows), tuple(notes))


def gear_table() -> Table:
    """Table 7.1: gear ratios of the encoders, which Kruse (2001) prints with two axes exchanged."""
    printed = {"slew": "7", "luff": "120/19", "hoist": "1"}
    rows = []
    for axis, ratio in printed.items():
        own, turn = ENCODER_COUNTS[axis], COUNTS_PER_TURN[axis]
        found = str(Fraction(turn / own).limit_denominator(100))
        rows.append(
            (
                Cell(axis),
                Cell(f"{own:,.0f}"),
                Cell(found, "24" if found != ratio else ""),
                Cell(f"{turn:,.1f}"),
                Cell(ratio),
            )
        )
    columns = ("axis", "counts a turn, encoder", "N", "counts a turn, output", "N as printed")
    note = "The package keeps counts a turn of the output; for luff both readings are possible."
    return Table("7.1", "Encoders and their gear ratios N", columns, tuple(rows), (note,))


def pump_table(number: str) -> Table:
    """Tables 7.2 to 7.4: pump and motor of an axis."""
    axis = AXES[int(number[-1]) - 2]
    title = f"Pump and motor, {axis}" + (", approximate" if axis == "luff" else "")
    return Table(number, title, _columns(), _grid(axis, _PUMP_GRID, number), (MAGNITUDES,))


def summary_table(number: str) -> Table:
    """Tables 8.1 to 8.3: everything of an axis."""
    axis = AXES[int(number[-1]) - 1]
    notes = [MAGNITUDES, "Printed: C in A."]
    if number == "8.1":
        notes.append("Printed: G_{2} and G_{3} in A/V.")
    if number == "8.3":
        notes.append(
            "Printed with the other signs: −2.2148/2.2733 and 2.2615/−2.6483; it is the card of "
            "table 8.2."
        )
    title = f"All parameters, {axis}" + (", approximate" if axis == "luff" else "")
    rows = (*_grid(axis, _CARD_GRID, number), *_grid(axis, _PUMP_GRID, number))
    return Table(number, title, _columns(), rows, tuple(notes))


def parameter_table(number: str) -> Table:
    """Any of them, by its number."""
    if number == "7.1":
        return gear_table()
    make = {"4": card_table, "7": pump_table, "8": summary_table}[number[0]]
    return make(number)


def _columns() -> tuple[str, ...]:
    return ("parameter", "value", "parameter", "value", "parameter", "value")


def _grid(
    axis: str, grid: tuple[tuple[str, ...], ...], number: str
) -> tuple[tuple[Cell, ...], ...]:
    drive = Drive.preset(axis)
    rows = []
    for names in grid:
        cells: list[Cell] = []
        for name in names:
            cells += _pair(drive, name, number) if name else [Cell(""), Cell("")]
        rows.append(tuple(cells))
    return tuple(rows)


def _pair(drive: Drive, name: str, number: str) -> list[Cell]:
    """A parameter's label and its one or two values."""
    values = drive[name].values
    signs = _SIGNS.get(name, (1.0, 1.0))
    single = len(values) == 1 or (name in _SYMBOLS and not any(values))
    words = " / ".join(
        _number(sign * value, raised=name == "Z16")
        for sign, value in zip(signs, values[:1] if single else values, strict=False)
    )
    both = "" if len(values) == 1 else " +/−"
    if name not in _SYMBOLS:
        return [Cell(f"Z_{{{name[1:]}}}{both}"), Cell(words)]
    symbol = _SYMBOLS[name]
    unit = symbol.printed or ("5" if number == "8.1" and name in ("G2", "G3") else "")
    sign = "6" if number == "8.3" and name in ("lim1", "lim2") else ""
    return [Cell(f"{symbol.label}{both} ({symbol.unit})", unit), Cell(words, sign)]


def _number(value: float, *, raised: bool = False) -> str:
    """As Kruse (2001) prints it: five significant digits, a power of ten where it is far from 1."""
    return (f"{value:.4e}" if raised else f"{value:.5g}").replace("-", "−")
