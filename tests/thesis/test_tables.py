"""The packaged sets are tables 4.1-4.4, 7.2-7.4 and 8.1-8.3 (their text: tests/reproduction)."""

import pytest

from swashplate import Drive
from swashplate.parameters import CATALOGUE


@pytest.mark.parametrize("name", ["hoist", "slew", "luff"])
def test_tables_4_1_to_4_4_and_7_2_to_8_3_are_the_packaged_sets(
    name: str, source_parameters: dict
) -> None:
    pump = source_parameters["pump_motor"][name]
    card = source_parameters["control_card"][pump["control_card"]]
    drive = Drive.preset(name)
    assert drive.parameters.card == pump["control_card"]
    facts = {key: value for key, value in {**card, **pump}.items() if key in drive.parameters}
    assert set(facts) == set(drive.parameters)
    for symbol, fact in facts.items():
        parameter = drive[symbol]
        assert parameter.unit == source_parameters["units"][symbol]
        assert list(parameter.values) == (fact if isinstance(fact, list) else [fact]), symbol
        assert parameter.source.startswith("table")


@pytest.mark.parametrize(
    ("name", "symbol", "values", "status"),
    [
        # a few cells by hand, for a checkout without the tables
        ("hoist", "Z1", (4.6441e-07,), "fitted"),
        ("hoist", "Z16", (1.1634e-04, 1.5126e-04), "fitted"),
        ("hoist", "Z22", (0.0, -54.153), "fitted"),
        ("hoist", "lim2", (2.2615, 2.6483), "fitted"),
        ("hoist", "tau", (0.014,), "assumed"),
        ("slew", "V_dz", (0.090948, 0.088321), "fitted"),
        ("slew", "C", (4.8368, 4.8368), "fitted"),
        ("slew", "Z14", (3.6461e-03,), "inactive"),
        ("luff", "Z15", (4.5768e08,), "approximate"),
        ("luff", "Z13", (0.059489, 0.07282), "assumed"),
        ("luff", "Z1", (2.9459e-07,), "approximate"),
    ],
)
def test_cells_and_how_they_were_found(
    name: str, symbol: str, values: tuple[float, ...], status: str
) -> None:
    found = Drive.preset(name)[symbol]
    assert (found.values, found.status) == (values, status)


def test_erratum_05_units_of_g2_and_g3() -> None:
    """Table 8.1 prints A/V for both; 3.3 needs A/V² and A/V³."""
    assert (CATALOGUE["G2"].unit, CATALOGUE["G3"].unit) == ("A/V^2", "A/V^3")
