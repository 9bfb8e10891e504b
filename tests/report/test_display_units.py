import pytest
from swashplate.report.display_units import display_unit


@pytest.mark.parametrize(
    ("unit", "largest", "name", "shown"),
    [
        ("rad", 3.141592653589793, "deg", 180.0),
        ("rad/s", 1.7453292519943295, "deg/s", 100.0),
        ("m", 0.15, "mm", 150.0),
        ("m", 25.0, "m", 25.0),
        ("m/s", 0.02, "mm/s", 20.0),
        ("Pa", 6e5, "bar", 6.0),
        ("Pa", 800.0, "kPa", 0.8),
        ("A", 0.5, "A", 0.5),
        ("A", 0.02, "mA", 20.0),
        ("V", 9.0, "V", 9.0),
        ("%", 2.5, "%", 2.5),
    ],
)
def test_si_is_shown_as_people_read_it(unit: str, largest: float, name: str, shown: float) -> None:
    found = display_unit(unit, largest)
    assert found.name == name
    assert found.factor * largest == pytest.approx(shown, rel=1e-14)
    assert found.label("signal") == f"signal ({name})"


def test_a_number_without_unit_has_no_parentheses() -> None:
    assert display_unit("1", 3.0).label("load") == "load"
