"""Units as people write them, and what looks like a unit and is none."""

from math import isfinite, pi

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from swashplate import InputError
from swashplate.units import si_exponents, to_si

PIECES = (
    *("V", "mV", "m", "s", "rad", "bar", "Pa", "degC", "dB", "pH", "ppm", "%", "°", "µ", "Ω", "²"),
    *("1", "0", "-0", "1e400", "1e-400", "1.5", "1j", "nan", "inf", "**", "^", "**-0", "^0", "*"),
    *("/", "-", "+", "(", ")", "[", "]", " ", ".", "~", "!", "'", "#", "\\", "\n", "{", "=", "@"),
    *("per", "squared", "cubic", "to", "and", "if", "lambda", "_", "sqrt", "dimensionless"),
)


@pytest.mark.slow
@settings(max_examples=300, deadline=2000)
@given(st.lists(st.sampled_from(PIECES), min_size=1, max_size=7).map("".join))
@example("V**-0")
@example("V^0")
@example("V**0/s")
@example("1e400 V")
@example("0 V")
@example("nan*V")
def test_whatever_a_header_has_for_a_unit(unit):
    """A finite number that is not 0, or one sentence that names the signal and the SI unit."""
    try:
        size = to_si(1.0, unit, "V", "column 'u'") - to_si(0.0, unit, "V", "column 'u'")
    except InputError as error:
        sentence = str(error)
        size = None
    if size is None:
        assert "column 'u'" in sentence
        assert sentence.endswith("give it in V.") or "powers are plain numbers" in sentence
    else:
        assert isfinite(size)
        assert size != 0.0
    exponents = si_exponents(unit)
    assert exponents is None or all(isinstance(power, int) for power in exponents.values())


def test_a_number_too_large_in_si():
    with pytest.raises(InputError, match="stroke .* 1e.308 km, .* in m"):
        to_si(1e308, "km", "m", "the stroke")


@pytest.mark.parametrize(
    ("value", "unit", "si", "number"),
    [(-273.15, "degC", "K", 0.0), (0.0, "bar", "Pa", 0.0), (2.0, "m**2/m", "m", 2.0)],
)
def test_zeros_that_are_right(value, unit, si, number):
    assert to_si(value, unit, si, "it") == pytest.approx(number, abs=1e-12)


@pytest.mark.parametrize(
    ("unit", "si", "size"),
    [
        *((unit, "rad", pi / 180.0) for unit in ("Grad", "º", "Â°", "Deg", "degrés", "grados")),
        *((unit, "rad", pi / 200.0) for unit in ("gon", "Neugrad", "gradian")),
        *((unit, "rad", 2.0 * pi) for unit in ("U", "tr", "rev", "turns")),
        *((unit, "rad/s", pi / 180.0) for unit in ("Grad/s", "deg s-1", "°/Sec", "dps")),
        *((unit, "rad/s", pi / 30.0) for unit in ("t/min", "tr/mn", "U min-1", "giri/min", "Upm")),
        *((unit, "s", 1e-3) for unit in ("mS", "MS", "mSec")),
        ("Sec", "s", 1.0),
        ("VDC", "V", 1.0),
        ("Amps", "A", 1.0),
        ("PSI", "Pa", 6894.757),
    ],
)
def test_a_unit_as_people_and_loggers_write_it(unit: str, si: str, size: float) -> None:
    assert to_si(1.0, unit, si, "x") == pytest.approx(size, rel=1e-6)


@pytest.mark.parametrize(
    ("unit", "si"),
    [
        *((unit, "rad") for unit in ("Prad", "Mrad", "%", "ppm", "counts", "yrad")),
        *((unit, "rad/s") for unit in ("Mrad/s", "counts/s", "Bq", "%")),
        *((unit, "s") for unit in ("Ms", "as", "Ps")),
        *((unit, "V") for unit in ("MV", "GV")),
        *((unit, "Pa") for unit in ("mPa", "Mbar")),
        ("Mm", "m"),
    ],
)
def test_a_unit_that_nobody_means_is_refused(unit: str, si: str) -> None:
    with pytest.raises(InputError, match=f"^x .*'{unit}'.* give it in {si}"):
        to_si(1.0, unit, si, "x")


@pytest.mark.parametrize("unit", ["grad", "GRAD", "grade", "mgrad", "grad/s"])
def test_an_angle_in_grad_is_refused_with_the_choices(unit: str) -> None:
    with pytest.raises(InputError, match=r"ambiguous: give it in deg.* or gon"):
        to_si(1.0, unit, "rad/s" if "/" in unit else "rad", "x")
