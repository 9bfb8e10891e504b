"""Tables 4.1-4.4, 7.1-7.4, 8.1-8.3: the packaged sets, and their text where it is at hand."""

import re

import pytest

from swashplate import Drive
from swashplate.parameters import CATALOGUE

Cells = dict[str, list[str]]

NAMES = {
    "V_dz": "V_dz", "J": "J", "G_1": "G1", "G_2": "G2", "G_3": "G3", "zeta": "zeta",
    "zeta_n": "zeta", "omega_n": "omega", "C": "C", "a": "a", "tau_td": "tau", "I_t1": "I_t1",
    "I_t2": "I_t2", "dI_lim1": "lim1", "dI_lim2": "lim2",
}  # fmt: skip


@pytest.fixture
def text(source_text: str) -> str:
    return source_text


def table(text: str, number: str) -> Cells:
    """Cells of a table by symbol: the text of each value, several where several columns are."""
    part = text.split(f"\nTable {number} ", 1)[1]
    rows = part.split("\n\n")[1].splitlines()
    cells: Cells = {}
    for row in rows:
        fields = [each.strip() for each in row.split("\t")]
        step = len(fields) if number.startswith("4.") else 2
        for at in range(0, len(fields) - 1, step):
            symbol = plain(fields[at])
            if symbol in NAMES or re.fullmatch(r"Z\d+", symbol):
                cells[NAMES.get(symbol, symbol)] = fields[at + 1 : at + step]
    return cells


def plain(symbol: str) -> str:
    """A symbol of the tables without its typesetting and unit."""
    symbol = symbol.split("(")[0].replace("+/-", "").replace("$", "").strip()
    symbol = symbol.replace("\\dot{I}", "dI").replace("\\zeta", "zeta").replace("\\omega", "omega")
    symbol = symbol.replace("\\tau", "tau").replace("ζ", "zeta").replace("ω", "omega")
    symbol = symbol.replace("τ", "tau").replace("{", "").replace("}", "").replace(",", "")
    symbol = re.sub(r"\s", "", symbol)
    return symbol.replace("Z_", "Z")


def numbers(cell: str) -> list[float]:
    return [float(each) for each in re.findall(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?", cell)]


@pytest.mark.parametrize(
    ("axis", "own", "summary"),
    [("hoist", "7.2", "8.1"), ("slew", "7.3", "8.2"), ("luff", "7.4", "8.3")],
)
def test_tables_7_2_to_7_4_and_8_1_to_8_3_pump_and_motor(
    text: str, axis: str, own: str, summary: str
) -> None:
    drive = Drive.preset(axis)
    for number in (own, summary):
        cells = {key: value for key, value in table(text, number).items() if key[0] == "Z"}
        assert set(cells) == {f"Z{n}" for n in range(1, 23)}
        for symbol, (cell,) in cells.items():
            printed = numbers(cell)
            # Z13 and Z16 are printed with a sign in the other direction; magnitudes are stored
            if symbol in ("Z13", "Z16"):
                assert printed[1] < 0.0
                printed = [abs(each) for each in printed]
            assert list(drive[symbol].values) == printed, (number, symbol)


@pytest.mark.parametrize(("axis", "column"), [("hoist", 0), ("slew", 1), ("luff", 1)])
def test_tables_4_1_to_4_4_card(text: str, axis: str, column: int) -> None:
    drive = Drive.preset(axis)
    for side, tables in (("plus", ("4.1", "4.2")), ("minus", ("4.3", "4.4"))):
        cells = table(text, tables[0]) | table(text, tables[1])
        assert set(cells) == {each.symbol for each in CATALOGUE.values() if each.symbol[0] != "Z"}
        for symbol, values in cells.items():
            stored = drive[symbol].value
            magnitude = getattr(stored, side) if symbol != "tau" else stored
            # all are magnitudes but the polynomial's gains, whose sign is theirs
            (printed,) = numbers(values[column])
            assert magnitude == (printed if symbol[0] == "G" else abs(printed)), symbol


@pytest.mark.parametrize("number", ["8.1", "8.2", "8.3"])
def test_tables_8_1_to_8_3_card(text: str, number: str) -> None:
    drive = Drive.preset({"8.1": "hoist", "8.2": "slew", "8.3": "luff"}[number])
    cells = {key: value for key, value in table(text, number).items() if key[0] != "Z"}
    assert len(cells) == 14
    for symbol, (cell,) in cells.items():
        printed = numbers(cell)
        stored = list(drive[symbol].values)
        if symbol[0] != "G":
            printed = [abs(each) for each in printed]
        assert stored in (printed, 2 * printed), symbol


def test_erratum_05_signs_of_tables_4_3_and_4_4(text: str) -> None:
    """The hoist's dead zone is printed below zero, the slew's above; 8.2 has it below as well."""
    static, dynamic = table(text, "4.3"), table(text, "4.4")
    assert [numbers(each)[0] for each in static["V_dz"]] == [-0.097857, 0.088321]
    assert numbers(table(text, "8.2")["V_dz"][0]) == [0.090948, -0.088321]
    assert [numbers(each)[0] for each in dynamic["a"]] == [-21.379, -21.379]
    assert numbers(table(text, "8.1")["a"][0]) == [19.131, 21.379]
    assert "positive channel of the card" in text.split("Table 4.4 ")[0].rsplit("\n\n", 2)[1]


def test_erratum_05_units_of_g2_and_g3(text: str) -> None:
    """Table 8.1 prints A/V for both; 3.3 needs A/V² and A/V³."""
    part = text.split("\nTable 8.1 ", 1)[1].split("\nTable 8.2 ")[0]
    assert "$G_2 +/-$ (A/V)" in part
    assert (CATALOGUE["G2"].unit, CATALOGUE["G3"].unit) == ("A/V^2", "A/V^3")


def test_erratum_06_signs_of_the_luffs_rate_limits(text: str) -> None:
    """The same card as the slew's, with the opposite signs."""
    slew, luff = table(text, "8.2"), table(text, "8.3")
    for symbol in ("lim1", "lim2"):
        assert [-each for each in numbers(luff[symbol][0])] == numbers(slew[symbol][0])
        assert Drive.preset("luff")[symbol].values == Drive.preset("slew")[symbol].values
        assert min(Drive.preset("luff")[symbol].values) > 0.0


def test_table_7_1_gear_ratios(text: str) -> None:
    part = text.split("Table 7.1 Axis Dependent Gear Ratios", 1)[1][:60].split()
    assert part[:8] == ["Axis", "N", "slew", "7", "luff", "120/19", "hoist", "1"]


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
