"""Units at the edge."""

import pytest

from swashplate import InputError
from swashplate.parameters.definitions import CATALOGUE
from swashplate.units import to_si


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


def test_wrong_and_unknown_units() -> None:
    with pytest.raises(InputError, match="the stop is given in 'V', which does not measure .* rad"):
        to_si(1.0, "V", "rad", "the stop")
    with pytest.raises(InputError, match="unknown unit 'furlongs_per_blink'"):
        to_si(1.0, "furlongs_per_blink", "m/s", "it")
