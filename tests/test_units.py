"""Units at the edge."""

import pytest

from swashplate import InputError
from swashplate.parameters.definitions import CATALOGUE
from swashplate.units import si_exponents, to_si


@pytest.mark.parametrize(
    ("value", "unit", "si", "expected"),
    [
        (1.0, "bar", "Pa", 1e5),
        (180.0, "deg", "rad", 3.141592653589793),
        (60.0, "rpm", "rad/s", 6.283185307179586),
        (2.0, "kHz", "rad/s", 12566.370614359172),
        (1.0, "mm", "m", 1e-3),
        (2.0, "1", "1", 2.0),
        (1.0, "1/bar", "1/Pa", 1e-5),
        (1.0, "sqrt(Pa)/(mm s)", "sqrt(Pa)/(m s)", 1e3),
        (5.0, "percent", "1", 0.05),
    ],
)
def test_conversion(value: float, unit: str, si: str, expected: float) -> None:
    assert to_si(value, unit, si, "it") == pytest.approx(expected, rel=1e-12)


def test_every_unit_of_the_catalogue_is_understood() -> None:
    for definition in CATALOGUE.values():
        hundredth = f"percent * {definition.unit}" if definition.unit != "1" else "percent"
        assert to_si(1.0, hundredth, definition.unit, definition.symbol) == pytest.approx(0.01)


@pytest.mark.parametrize("unit", ["m2", "foo", "bit", "m/", "sqrt(Pa)", "bar"])
def test_units_that_are_no_whole_powers_of_base_units_have_none(unit: str) -> None:
    assert si_exponents("N m") == {"kg": 1, "m": 2, "s": -2}
    assert si_exponents(unit) is None


def test_wrong_and_unknown_units() -> None:
    with pytest.raises(InputError, match="the stop is given in 'V', which does not measure .* rad"):
        to_si(1.0, "V", "rad", "the stop")
    with pytest.raises(InputError, match="unknown unit 'furlongs_per_blink'"):
        to_si(1.0, "furlongs_per_blink", "m/s", "it")


@pytest.mark.parametrize(
    "unit",
    [
        *("V**9**9**9**9", "V^9^9^9^9^9", "9**9**9**9", "V**(9**9)", "V**9999", "<b>V</b>", "V/0"),
        pytest.param("*".join("V" * 5000), id="many factors"),
        pytest.param(f"{'(' * 5000}V{')' * 5000}", id="nested"),
    ],
)
def test_a_unit_that_would_take_for_ever(unit):
    with pytest.raises(InputError, match="column 'u' has the unreadable unit"):
        to_si(1.0, unit, "V", "column 'u'")


@pytest.mark.parametrize(
    ("unit", "si", "value"),
    [("m/s**2", "m/s^2", 1.0), ("m^(-1)", "1/m", 1.0), ("bar**0.5", "sqrt(Pa)", 1e5**0.5)],
)
def test_powers_of_units(unit, si, value):
    assert to_si(1.0, unit, si, "x") == pytest.approx(value, rel=1e-12)
