"""Units as people write them, and what looks like a unit and is none."""

from math import isfinite

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
