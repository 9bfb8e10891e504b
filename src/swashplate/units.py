"""Units at the edge: what comes in is turned into SI or refused, what goes out is for people."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from math import isfinite, pi
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol, runtime_checkable

from swashplate.errors import InputError


@cache
def _registry() -> Any:
    # loading pint takes longer than most commands need, and SI input does not need it
    from pint import UnitRegistry

    return UnitRegistry()


_TURN = r"u|umdr|umdrehung(?:en)?|r|revs?|turns?|tr|tours?|omw|omdr|varv|giri|obr|vueltas?"
"""A turn as nameplates of several countries write it; folded by `_folded`."""
_A_MINUTE = re.compile(rf"(?:1|t|{_TURN})?/(?:min|mn)|(?:t|{_TURN})?(?:min|mn)-1|upm|rpm")
_A_SECOND = re.compile(rf"(?:1|t|{_TURN})/(?:s|sec|sek)|(?:t|{_TURN})?(?:s|sec|sek)-1|rps")
"""Turns a minute and a second; "t" is a French tour."""
_SPELLINGS = {
    spelling: spelt
    for spelt, spellings in {
        "deg": "Deg DEG Degs Degree Degrees DEGREES Grad Altgrad grados gradi graden grader graus "
        "degré degrés º ˚",
        "deg/s": "dps DPS",
        "gon": "Gon GON Neugrad gradian gradians",
        "rad": "Rad RAD Radian Radians",
        "V": "Volt Volts VOLT VOLTS VDC Vdc",
        "mV": "mVolt mVolts millivolts mVDC",
        "A": "Amp Amps AMP AMPS amps Ampere",
        "mA": "mAmp mAmps milliamps",
        "s": "Sec Secs SEC SECS Second Seconds SECONDS sek Sek Sekunde Sekunden seconde secondes",
        "ms": "mSec MSEC Millisekunden Milliseconds",
        "us": "uSec µSec Microseconds",
        "ns": "nSec Nanoseconds",
        "min": "Min MIN mn Minuten Minutes",
        "bar": "Bar BAR",
        "mbar": "mBar MBAR",
        "psi": "Psi PSI psig PSIG",
        "mm": "MM",
    }.items()
    for spelling in spellings.split()
}
"""Words that have one meaning beside what a drive's logs measure, by how Pint spells them."""
_GRADE = re.compile(r"[a-zµ]?(?:grads?|grades?)|GRADS?", re.ASCII)
"""Degrees of German logs in lower or upper case, gradians of everybody else's."""
_TURN_WORD = re.compile(_TURN, re.IGNORECASE)
_WORD = re.compile(r"[^\W\d_]+|[°º˚]")
PLAUSIBLE = {
    "rad": (1e-9, 2.0 * pi),
    "rad/s": (1e-9, 2e4 * pi),
    "s": (1e-9, 7.0 * 86400.0),
    "V": (1e-9, 1e3),
    "A": (1e-9, 1e3),
    "m": (1e-9, 2e3),
    "m/s": (1e-9, 1e3),
    "Pa": (0.01, 1e9),
    "Hz": (1e-6, 1e4),
}
"""Sizes of the smallest and of the largest unit in which a quantity is written, in SI: nanoradians
to turns, to kHz, ns to weeks, nV and nA to kV and kA, nm to miles, to km/s, hundredths of a Pa (a
percentage times Pa) to GPa. A unit beyond them is a word that Pint takes for a prefix: "Grad" for
giga, "Ms" for mega."""


LONGEST = 80
"""Letters of a unit."""
_POWER = re.compile(r"(?:\*\*|\^)\s*\(?\s*[+-]?\d{1,2}(?:[./]\d{1,3})?\s*\)?(?!\s*(?:\*\*|\^|\d))")
"""A power as a unit has it: a plain number, no power of a power."""


def _written_out(unit: str) -> str:
    return unit.replace("sqrt(Pa)", "Pa^0.5")


def _folded(unit: str) -> str:
    plain = unit.lower().translate(str.maketrans("⁻−¹", "--1", "^ .·*"))
    return plain.replace("(-1)", "-1")


def speed_unit(unit: str) -> str:
    """The unit of a shaft's speed, spelt so that `to_si` reads it: of turns, never of radians.

    1/min, min⁻¹, U/min, r/min and tr/min are turns a minute (rpm), 1/s and r/s turns a second (Hz).
    """
    folded = _folded(unit)
    if _A_MINUTE.fullmatch(folded):
        return "rpm"
    return "Hz" if _A_SECOND.fullmatch(folded) else unit


def _unmangled(unit: str) -> str:
    """A unit whose UTF-8 was read as Latin-1, "Â°/s", as it was written."""
    for encoding in ("cp1252", "latin-1"):
        try:
            return unit.encode(encoding).decode("utf-8")
        except UnicodeError:
            continue
    return unit


def plain_unit(unit: str) -> str:
    """A unit in the letters of its symbols: ``"V"`` for Volts, ``"deg/s"`` for Grad/s."""
    return _WORD.sub(lambda match: _SPELLINGS.get(match[0], match[0]), _unmangled(unit))


def ambiguous_angle(unit: str) -> tuple[str, ...]:
    """What a unit may stand for that counts an angle in "grad": degrees, gradians; else nothing."""
    word = next((word for word in _WORD.findall(unit) if _GRADE.fullmatch(word)), None)
    return () if word is None else (unit.replace(word, "deg"), unit.replace(word, "gon"))


def _spelt(unit: str, si: str, what: str) -> str:
    """A unit as Pint spells it, from how people and loggers write that of an SI unit.

    "Grad" is a German degree; "grad" and "GRAD", a degree there and a gradian elsewhere, are
    refused.
    """
    unit = _unmangled(unit)
    of_angle = si in ("rad", "rad/s")
    if of_angle and ambiguous_angle(unit):
        degrees, gradians = ambiguous_angle(unit)
        raise InputError(
            f"{what} has the unit '{unit}', which is ambiguous: give it in {degrees} (360 deg a "
            f"turn) or {gradians} (400 gon a turn)."
        )

    def spelt_word(match: re.Match[str]) -> str:
        word = match[0]
        if of_angle and _TURN_WORD.fullmatch(word):
            return "turn"
        if word in ("S", "mS", "MS") and (si == "s" or unit[: match.start()].endswith("/")):
            return word.replace("MS", "mS").replace("S", "s")
        return _SPELLINGS.get(word, word)

    spelt = _WORD.sub(spelt_word, unit)
    # powers as of CF conventions, "rad s-1"
    return re.sub(r"(?<=[a-zA-Z])(-\d)\b", r"**\1", spelt)


def to_si(value: float, unit: str, si: str, what: str) -> float:
    """A value in a unit such as ``"bar"``, in the SI unit that the model computes in.

    An angular frequency in Hz, 1/min or another of a nameplate's turns counts each as 2π; ``"1"``
    is not a unit. `what` names the value in the error's sentence.

    Raises
    ------
    InputError
        If `unit` is unknown or measures something else.
    """
    if unit == si:
        return value
    shown = unit if len(unit) <= LONGEST else f"{unit[:LONGEST]}..."
    powers = _POWER.sub(" ", unit)
    if len(unit) > LONGEST or any(sign in powers for sign in ("**", "^", "<", ">")):
        # a unit is evaluated, and some would take for ever
        raise InputError(
            f"{what} has the unreadable unit '{shown}'; give it in {si}, or in a unit whose "
            "powers are plain numbers."
        )
    if si == "rad/s" and _A_MINUTE.fullmatch(_folded(unit)):
        return 2.0 * pi / 60.0 * value
    if si == "rad/s" and unit.endswith(("Hz", "hertz")):
        # for pint a hertz is one a second, and so is a radian a second
        return 2.0 * pi * to_si(value, unit, "Hz", what)
    spelt = _spelt(unit, si, what)
    from pint import DimensionalityError, UndefinedUnitError

    registry = _registry()
    examples = "rad/s or rpm" if si == "rad/s" else si
    try:
        # offsets (degC) are handled by Quantity, not by a factor
        quantity = registry.Quantity(value, _written_out(spelt) if unit != "1" else "")
        number = float(quantity.to(_written_out(si) if si != "1" else "").magnitude)
        size = registry.get_root_units(quantity.units)
    except UndefinedUnitError:
        raise InputError(f"{what} has the unknown unit '{unit}'; give it in {examples}.") from None
    except DimensionalityError:
        raise InputError(
            f"{what} is given in '{unit}', which does not measure the same as {si}; "
            f"give it in {examples}."
        ) from None
    except Exception:  # Pint evaluates the text, and raises whatever the evaluation does
        raise InputError(
            f"{what} has the unreadable unit '{shown}'; give it in {examples}."
        ) from None
    if si in ("rad", "rad/s") and not _is_of_angle(size[1], unit):
        raise InputError(
            f"{what} is given in '{unit}', which does not measure the same as {si}; "
            f"give it in {examples}."
        )
    if si in PLAUSIBLE:
        smallest, largest = PLAUSIBLE[si]
        factor = size[0] / registry.get_root_units(si)[0]
        if not 0.999 * smallest <= factor <= 1.001 * largest:
            raise InputError(
                f"{what} has the unit '{shown}', which would be {factor:.3g} {si}; nobody measures "
                f"in it: give it in {examples}."
            )
    if isfinite(value) and not isfinite(number):
        raise InputError(f"{what} is {value:g} {unit}, too large a number in {si}; check it.")
    return number


def _is_of_angle(root: Any, unit: str) -> bool:
    """Whether root units, as Pint has them, are of an angle or of its rate.

    For Pint an angle has no dimension, so that per cent and counts would pass for radians; the
    plain number of "1" and "1/s" stays one.
    """
    names = {str(name) for name in root._units}
    return "radian" in names or names == {"second"} or (not names and unit == "1")


def scaling(unit: str, si: str, what: str) -> tuple[float, float]:
    """Factor and zero of a unit, SI = factor x + zero; arguments and errors as of `to_si`."""
    zero = to_si(0.0, unit, si, what)
    return to_si(1.0, unit, si, what) - zero, zero


@runtime_checkable
class Quantity(Protocol):
    """A number or array with a unit, such as Pint's."""

    @property
    def magnitude(self) -> Any:
        """The number or array."""
        ...

    @property
    def units(self) -> Any:
        """Its unit, whose format ``~C`` is one that `to_si` reads, as of Pint."""
        ...


def in_si(value: Any, si: str, what: str) -> Any:
    """The number or array of a quantity, in an SI unit; any other value as it is.

    A quantity's array keeps its shape. `what` the value is stands in the error's sentence.

    Raises
    ------
    InputError
        If the quantity measures something else.
    """
    # a plain number is most often what comes, and is told far sooner than what has these attributes
    if isinstance(value, float | int) or not isinstance(value, Quantity):
        return value
    factor, zero = scaling(f"{value.units:~C}" or "1", si, what)
    return value.magnitude * factor + zero


_BASE = {
    "kilogram": "kg",
    "meter": "m",
    "second": "s",
    "ampere": "A",
    "kelvin": "K",
    "mole": "mol",
    "candela": "cd",
    "radian": "rad",
}
"""Symbols of the base units, by Pint's names."""


@cache
def si_exponents(unit: str) -> dict[str, int] | None:
    """Exponents of the base units that an SI unit is made of, ``"N m"`` → kg 1, m 2, s -2.

    None if one is a fraction, as of √Pa, or where Pint does not know the unit or its base.
    """
    try:
        base = _registry().parse_units(_written_out(unit).replace("^", "**"))
        factor, root = _registry().get_base_units(base)
    except Exception:  # see `to_si`
        return None
    powers = {str(name): float(power) for name, power in root._units.items()}
    if factor != 1.0 or not all(n.is_integer() and k in _BASE for k, n in powers.items()):
        return None
    exponents = {_BASE[name]: int(power) for name, power in powers.items()}
    return {name: exponents[name] for name in _BASE.values() if name in exponents}


# --- units that people read -----------------------------------------------------------------------


class DisplayUnit(NamedTuple):
    """A unit that people read, and its size: displayed = factor * SI."""

    name: str
    """Empty for a number without unit."""
    factor: float

    def label(self, name: str) -> str:
        """Label of an axis, with the unit in parentheses if there is one."""
        return f"{name} ({self.name})" if self.name else name


SHAFT_ANGLE = "rad of the shaft"
"""Unit of a shaft's angle for `display_unit`: shown as its speed is, in turns or metres of rope.

``"rad"`` is any other angle. ``"rad/s"`` and ``"rad/s^2"`` are the shaft's wherever they are shown,
except for parameters, see `chosen_unit`, and for `PLATE_RATE`.
"""
PLATE_RATE = "rad/s of the plate"
"""Unit of the swash plate's angular speed for `display_unit`."""

_USUAL: dict[str, tuple[tuple[float, DisplayUnit], ...]] = {
    "rad": ((0.0, DisplayUnit("deg", 180.0 / pi)),),
    "rad/s": ((0.0, DisplayUnit("deg/s", 180.0 / pi)),),
    PLATE_RATE: ((0.0, DisplayUnit("deg/s", 180.0 / pi)),),
    "rad/s^2": ((0.0, DisplayUnit("deg/s²", 180.0 / pi)),),
    "m": ((10.0, DisplayUnit("m", 1.0)), (0.0, DisplayUnit("mm", 1e3))),
    "m/s": ((10.0, DisplayUnit("m/s", 1.0)), (0.0, DisplayUnit("mm/s", 1e3))),
    "m/s^2": ((10.0, DisplayUnit("m/s²", 1.0)), (0.0, DisplayUnit("mm/s²", 1e3))),
    "Pa": ((1e4, DisplayUnit("bar", 1e-5)), (0.0, DisplayUnit("kPa", 1e-3))),
    "A": ((0.1, DisplayUnit("A", 1.0)), (0.0, DisplayUnit("mA", 1e3))),
    "1": ((0.0, DisplayUnit("", 1.0)),),
}
"""By SI unit: the smallest size that each unit is for, the largest first."""
_TURNS = {
    "rpm": (("rpm", 30.0 / pi), ("turns", 0.5 / pi), ("rpm/s", 30.0 / pi)),
    "Hz": (("turns/s", 0.5 / pi), ("turns", 0.5 / pi), ("turns/s²", 0.5 / pi)),
    "rad/s": (("rad/s", 1.0), ("rad", 1.0), ("rad/s²", 1.0)),
    "deg/s": (("deg/s", 180.0 / pi), ("deg", 180.0 / pi), ("deg/s²", 180.0 / pi)),
}
"""Speed, angle and acceleration of a shaft that go together."""
_OF_SHAFT = ("rad/s", SHAFT_ANGLE, "rad/s^2")
"""Their units, in the same order."""
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_chosen: ContextVar[Mapping[str, DisplayUnit]] = ContextVar(
    "units of choice", default=MappingProxyType({})
)


def units_of_choice(names: Sequence[str], drum: float | None = None) -> dict[str, DisplayUnit]:
    """The units that someone names, ``"rpm"`` or ``"bar"``, by the SI unit each is shown for.

    With the diameter of a drum on the shaft [m], ``"m/min"`` and ``"m/s"`` of its rope stand for
    the shaft's speed. A unit of speed is for the shaft, and its angle and acceleration go with it;
    other angles and frequencies stay as they are.

    Raises
    ------
    InputError
        If a unit is unknown, or measures what no table shows, if two are for one quantity, or if
        the drum has no diameter.
    """
    if drum is not None and not drum > 0.0:
        raise InputError(f"A drum's diameter must be above 0 m, not {drum:g}: --drum 0.4.")
    named: dict[str, str] = {}
    units: dict[str, DisplayUnit] = {}
    turn_units: dict[str, DisplayUnit] = {}
    for word in names:
        shown, turns = _chosen_by(word, drum)
        for si in shown:
            if named.setdefault(si, word) != word:
                raise InputError(
                    f"--units names two units of one quantity, {named[si]} and {word}: give one."
                )
        units |= shown
        turn_units |= turns
    if "rad" in units and turn_units:
        turn_units[SHAFT_ANGLE] = units["rad"]
    return {**turn_units, **units}


def _chosen_by(
    word: str, drum: float | None
) -> tuple[dict[str, DisplayUnit], dict[str, DisplayUnit]]:
    """Units chosen by a word, and those of the shaft that go with it, both by SI unit."""
    turns = _TURNS.get(speed_unit(word))
    rope = {"m/min": 60.0, "m/s": 1.0}
    if word == "m/min" and drum is None:
        raise InputError("A speed in m/min of rope needs the drum's diameter: --drum 0.4.")
    if word in rope and drum is not None:
        radius = 0.5 * drum
        turns = ((word, rope[word] * radius), ("m", radius), ("m/s²", radius))
    if turns is not None:
        units = {si: DisplayUnit(*turn) for si, turn in zip(_OF_SHAFT, turns, strict=True)}
        return {"rad/s": units.pop("rad/s")}, units
    usual = {si: unit for si, units in _USUAL.items() for _, unit in units if unit.name == word}
    if word and usual:
        return usual, {}
    for si in ("Pa", "m", "m/s", "A", "rad"):
        try:
            return {si: DisplayUnit(word, 1.0 / to_si(1.0, word, si, "--units"))}, {}
        except InputError:
            continue
    raise InputError(
        f"No table shows a quantity in '{word}': choose one of speed (rpm, rad/s, deg/s; "
        "m/min of rope with a drum), pressure (bar), length (mm), angle (deg) or current."
    )


@contextmanager
def shown_in(names: Sequence[str], drum: float | None = None) -> Iterator[None]:
    """Show tables, plots and pages in the units named, as of `units_of_choice`, for a while."""
    token = _chosen.set({**_chosen.get(), **units_of_choice(names, drum)})
    try:
        yield
    finally:
        _chosen.reset(token)


def show_rod() -> None:
    """Show what is called a shaft's motion as a rod's, in mm or what was chosen, for that while."""
    choice = _chosen.get()
    for turning, moving in zip(_OF_SHAFT, ("m/s", "m", "m/s^2"), strict=True):
        usual = _USUAL[moving][1][1]
        _chosen.set({turning: choice.get(moving, usual), **_chosen.get()})


def of_shaft(si: str) -> str:
    """Unit of a shaft's quantity for `display_unit`, of its SI unit: an angle is the shaft's."""
    return SHAFT_ANGLE if si == "rad" else si


def display_unit(si: str, largest: float = float("inf")) -> DisplayUnit:
    """Unit to show a quantity in, by its largest magnitude [SI]: the one chosen, else the usual.

    Compounds such as ``"rad/s/V"`` and ``"V/(rad/s)"`` follow the speed's; an unknown one is shown
    as it is, with its exponents raised.
    """
    if si in _chosen.get():
        return _chosen.get()[si]
    if si == SHAFT_ANGLE:
        return display_unit("rad", largest)
    for size, shown in _USUAL.get(si, ()):
        if largest >= size or size == 0.0:
            return shown
    base, slash, of = si.partition("/s/")
    if slash:
        speed = display_unit(f"{base}/s")
        return DisplayUnit(f"{_in_brackets(speed)}/{of}", speed.factor)
    if si.endswith("/(rad/s)"):
        speed = display_unit("rad/s")
        before = si.removesuffix("(rad/s)")
        return DisplayUnit(f"{before}{_in_brackets(speed)}", 1.0 / speed.factor)
    return DisplayUnit(unit_text(si), 1.0)


def _in_brackets(unit: DisplayUnit) -> str:
    """Name of a unit within a fraction."""
    return f"({unit.name})" if "/" in unit.name else unit.name


def chosen_unit(si: str) -> DisplayUnit:
    """Unit to show a parameter in: the one chosen, else SI as its file has it.

    No parameter is a speed of the shaft: one in rad/s or rad/s² stays so.
    """
    shown = None if si in _OF_SHAFT else _chosen.get().get(si)
    return shown or DisplayUnit(unit_text(si), 1.0)


def unit_text(unit: str) -> str:
    """A unit of the parameter files as print shows it: ``A/V^2`` as ``A/V²``, ``1`` as nothing."""
    base, *rest = unit.split("^") if unit != "1" else [""]
    for part in rest:
        length = len(part) - len(part.lstrip("-0123456789"))
        base += part[:length].translate(_RAISED) + part[length:]
    return base.replace("sqrt(Pa)", "√Pa")
