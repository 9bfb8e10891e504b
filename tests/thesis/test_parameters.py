"""The packaged sets hold Kruse's tables, digit for digit."""

import pytest

from swashplate import Drive

BOTH = ("hoist", "slew", "luff")


@pytest.mark.parametrize("name", BOTH)
def test_sets_equal_the_tables(name: str, source_parameters: dict) -> None:
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
    ("name", "symbol", "values"),
    [
        # a few cells by hand, for a checkout without the tables
        ("hoist", "Z1", (4.6441e-07,)),
        ("hoist", "Z16", (1.1634e-04, 1.5126e-04)),
        ("hoist", "Z22", (0.0, -54.153)),
        ("hoist", "lim2", (2.2615, 2.6483)),
        ("slew", "V_dz", (0.090948, 0.088321)),
        ("slew", "C", (4.8368, 4.8368)),
        ("luff", "Z15", (4.5768e08,)),
        ("luff", "Z13", (0.059489, 0.07282)),
    ],
)
def test_cells(name: str, symbol: str, values: tuple) -> None:
    assert Drive.preset(name)[symbol].values == values


def test_statuses() -> None:
    assert Drive.preset("hoist")["tau"].status == "assumed"
    assert Drive.preset("hoist")["Z1"].status == "fitted"
    assert Drive.preset("luff")["Z1"].status == "approximate"
    assert Drive.preset("luff")["Z13"].status == "assumed"
    assert Drive.preset("slew")["Z14"].status == "inactive"
