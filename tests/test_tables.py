"""Tables: numbers for people in units of choice, and for files in SI."""

import os
import re
import stat
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate import FileError, InputError
from swashplate.parameters import CATALOGUE
from swashplate.tables import UNIT, Cell, Column, Table, joined, spread, write_table, write_whole
from swashplate.units import (
    PLATE_RATE,
    SHAFT_ANGLE,
    chosen_unit,
    display_unit,
    shown_in,
    si_exponents,
    to_si,
    unit_text,
    units_of_choice,
)


@pytest.fixture
def table() -> Table:
    made = Table(
        "Runs",
        (
            Column("run"),
            Column("speed", ".2f", "rad/s", none="never"),
            Column("error", ".3g"),
            UNIT,
            Column("share", ".1%"),
            Column("samples", ",d", "1", key="n", of="pf"),
        ),
    )
    made.add("a", 1.0, 0.005, 0.25, 5000, unit="A")
    made.add("b", float("nan"), Cell(2.0, "two"), None, 10, unit="A", look=True)
    made.add("all", 2.0, 1.5, 1.0, 5010, unit="A", total=True)
    return made


def test_people_get_their_units_and_words(table: Table) -> None:
    assert table.headings() == ["run", "speed deg/s", "error", "unit", "share", "samples"]
    assert [table.texts(row) for row in table.rows] == [
        ["a", "57.30", "5", "mA", "25.0 %", "5,000"],
        ["b", "never", "two", "A", "", "10"],
        ["all", "114.59", "1.5", "A", "100.0 %", "5,010"],
    ]
    with shown_in(["rpm"]):
        assert table.headings()[1] == "speed rpm"
        assert table.texts(table.rows[0])[1] == "9.55"
    assert table.of("t").headings()[-1] == "share"


def test_files_get_all_digits_in_si(table: Table, tmp_path: Path) -> None:
    table.write(tmp_path / "runs.csv")
    read = pl.read_csv(tmp_path / "runs.csv")
    assert read.columns == ["run", "speed", "error", "unit", "share", "n"]
    assert read.rows() == [("a", 1.0, 0.005, "A", 0.25, 5000), ("b", None, 2.0, "A", None, 10)]
    assert joined([table, table]).to_polars().height == 4


def test_fixed_decimals_keep_the_large_unit() -> None:
    made = Table("", (Column("what"), Column("", ".4f"), UNIT))
    made.add("current", 0.0123, unit="A")
    assert made.texts(made.rows[0]) == ["current", "0.0123", "A"]


def test_parameters_are_in_si_unless_a_unit_is_chosen() -> None:
    made = Table("", (Column("what"), Column("", ".4g"), UNIT), si=True)
    made.add("opening", 1.2e-4, unit="m")
    made.add("gain", 0.05, unit="A/V^2")
    assert [made.texts(row)[1:] for row in made.rows] == [["0.00012", "m"], ["0.05", "A/V²"]]
    with shown_in(["mm"]):
        assert made.texts(made.rows[0])[1:] == ["0.12", "mm"]


@pytest.mark.parametrize(
    ("words", "drum", "si", "name", "factor"),
    [
        (["rpm"], None, "rad/s", "rpm", 9.5492966),
        (["1/min"], None, "rad/s^2", "rpm/s", 9.5492966),
        (["rpm"], None, "rad/s/V", "rpm/V", 9.5492966),
        (["rpm"], None, "V/(rad/s)", "V/rpm", 0.10471976),
        (["m/min"], 0.4, "rad/s/V", "(m/min)/V", 12.0),
        (["rpm"], None, SHAFT_ANGLE, "turns", 0.15915494),
        (["m/min"], 0.4, "rad/s", "m/min", 12.0),
        (["m/min"], 0.4, SHAFT_ANGLE, "m", 0.2),
        (["rpm", "deg"], None, SHAFT_ANGLE, "deg", 57.29578),
        (["bar", "mm"], None, "Pa", "bar", 1e-5),
        (["rad/s"], None, "V/(rad/s)", "V/(rad/s)", 1.0),
        # what is not the shaft's stays as it is
        (["m/min"], 0.4, "rad", "deg", 57.29578),
        (["rpm"], None, PLATE_RATE, "deg/s", 57.29578),
        (["rpm", "rad"], None, "rad", "rad", 1.0),
    ],
)
def test_units_of_choice(words, drum, si, name, factor) -> None:
    with shown_in(words, drum):
        shown = display_unit(si)
    assert shown.name == name
    assert shown.factor == pytest.approx(factor)
    assert display_unit("rad/s").name == "deg/s"
    assert display_unit(SHAFT_ANGLE).name == "deg"


@pytest.mark.parametrize(
    ("words", "drum", "said"),
    [
        (["m/min"], None, "m/min.* drum"),
        (["m/min"], 0.0, "diameter .* 0 m, .* 0"),
        (["kelvin"], None, "'kelvin'"),
        (["rpm", "deg/s"], None, "rpm and deg/s"),
        (["bar", "MPa"], None, "bar and MPa"),
    ],
)
def test_units_that_are_refused(words, drum, said) -> None:
    with pytest.raises(InputError, match=said):
        units_of_choice(words, drum)


@pytest.mark.parametrize("si", ["rad", "rad/s", "rad/s^2", "Pa"])
def test_a_parameter_keeps_its_unit_whatever_the_shaft_is_shown_in(si: str) -> None:
    with shown_in(["rpm"]):
        assert chosen_unit(si) == (unit_text(si), 1.0)


def test_a_file_knows_no_unit_but_si() -> None:
    made = Table("", (Column("what"), Column("", ".1f"), UNIT))
    made.add("position", 6.2831853, unit=SHAFT_ANGLE)
    assert made.to_polars()["unit"].to_list() == ["rad"]
    with shown_in(["rpm"]):
        assert made.texts(made.rows[0]) == ["position", "1.0", "turns"]


@pytest.mark.parametrize(
    ("unit", "largest", "name"),
    [
        ("A", 0.05, "mA"),
        ("A", 0.5, "A"),
        ("m", 2.0, "mm"),
        ("m", 20.0, "m"),
        ("Pa", 500.0, "kPa"),
        ("Pa", 1e6, "bar"),
        ("1", 3.0, ""),
        ("kg m^2", 3.0, "kg m²"),
    ],
)
def test_usual_units_go_by_the_size(unit: str, largest: float, name: str) -> None:
    assert display_unit(unit, largest).name == name


@given(st.floats(1e-9, 1e9), st.floats(1e-6, 1.0))
def test_an_interval_is_shown_to_two_digits_of_its_half_width(value: float, share: float) -> None:
    half = share * value
    shown = spread(value, value - half, value + half)
    for text, exact in zip(shown, (value, value - half, value + half), strict=True):
        assert float(text) == pytest.approx(exact, abs=0.06 * half)


def test_an_uneven_interval_leaves_its_value_two_digits() -> None:
    assert spread(0.0348, 0.0006, 2.1) == ("0.035", "0.001", "2.100")
    assert spread(5.0, 5.0, 6.0) == ("5.0000", "5.0000", "6.0000")


@pytest.mark.parametrize("text", ["=1+1", "@sum(a)", "+cmd|' /C calc'!A0", "-a"])
def test_no_text_of_a_csv_is_a_formula_to_a_spreadsheet(tmp_path: Path, text: str) -> None:
    path = tmp_path / "runs.csv"
    write_table(pl.DataFrame({"run": [text, "-4 V", "a=b"], text: [-1.5, 0.0, 1.0]}), path)
    read = pl.read_csv(path)
    assert read.columns == ["run", f"'{text}"]
    assert read["run"].to_list() == [f"'{text}", "-4 V", "a=b"]
    assert read[f"'{text}"].to_list() == [-1.5, 0.0, 1.0]


def test_a_table_as_text_and_for_a_notebook() -> None:
    made = Table("Speeds <b>", (Column("run"), Column("speed", ".1f", "rad/s")))
    made.add("step", 1.0)
    made.add("a & b", 2.0)
    assert str(made).splitlines() == [
        "Speeds <b>",
        "run    speed deg/s",
        "step          57.3",
        "a & b        114.6",
    ]
    html = made._repr_html_()
    assert re.search(r"<caption[^>]*>Speeds &lt;b&gt;</caption>", html)
    # words at the left, numbers at the right, whatever a notebook does by itself
    assert re.search(r"<td[^>]*left[^>]*>a &amp; b</td><td[^>]*right[^>]*>114\.6</td>", html)


def test_a_caption_is_shown_wherever_its_table_is() -> None:
    made = Table("", (Column("lever"),), "not moved by <others>")
    made.add("pump")
    assert str(made).splitlines() == ["lever", "pump", "not moved by <others>"]
    html = made._repr_html_()
    assert "<caption" not in html
    assert html.endswith("</table><p>not moved by &lt;others&gt;</p>")


def no_room(*_: object) -> None:
    raise pl.exceptions.ComputeError("writing failed: No space left on device (os error 28)")


def stumbling(*_: object) -> None:
    try:
        raise OSError(28, "No space left on device")
    except OSError:
        raise AttributeError("a library's clean-up") from None


def half_written(beside: Path) -> None:
    beside.write_text("half")
    raise OSError(28, "No space left on device")


@pytest.mark.parametrize("write", [no_room, stumbling, half_written])
def test_a_full_disk_is_a_sentence(tmp_path: Path, write: Callable[..., None]) -> None:
    (tmp_path / "a.csv").write_text("old")
    with pytest.raises(FileError, match=r"a\.csv .*No space left on device"):
        write_whole(tmp_path / "a.csv", write)
    assert [each.read_text() for each in tmp_path.iterdir()] == ["old"]


def test_a_librarys_own_error_passes(tmp_path: Path) -> None:
    def broken(_: Path) -> None:
        raise AttributeError("nothing of the disk")

    with pytest.raises(AttributeError, match="nothing of the disk"):
        write_whole(tmp_path / "a.csv", broken)


# --- units at the edge ----------------------------------------------------------------------------


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
    with pytest.raises(InputError, match="stop .* 'V', .* rad"):
        to_si(1.0, "V", "rad", "the stop")
    with pytest.raises(InputError, match="'furlongs_per_blink'"):
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
    with pytest.raises(InputError, match="column 'u' .* unit"):
        to_si(1.0, unit, "V", "column 'u'")


@pytest.mark.parametrize(
    ("unit", "si", "value"),
    [("m/s**2", "m/s^2", 1.0), ("m^(-1)", "1/m", 1.0), ("bar**0.5", "sqrt(Pa)", 1e5**0.5)],
)
def test_powers_of_units(unit, si, value):
    assert to_si(1.0, unit, si, "x") == pytest.approx(value, rel=1e-12)


@pytest.mark.skipif(os.name == "nt", reason="permissions are those of POSIX")
@pytest.mark.parametrize("mode", [0o600, 0o640, 0o444])
def test_a_file_that_is_replaced_keeps_its_permissions(tmp_path, mode):
    target = tmp_path / "drive.toml"
    target.write_text("old")
    target.chmod(mode)
    seen = []

    def write(beside):
        seen.append(stat.S_IMODE(beside.stat().st_mode))
        beside.write_text("new")

    write_whole(target, write)
    assert target.read_text() == "new"
    assert stat.S_IMODE(target.stat().st_mode) == mode
    assert seen == [mode | stat.S_IWUSR]  # nobody else reads it while it is written either


@pytest.mark.skipif(os.name == "nt", reason="links need rights there")
def test_a_link_is_replaced_and_what_it_points_to_stays(tmp_path):
    (tmp_path / "elsewhere.csv").write_text("old")
    (tmp_path / "elsewhere.csv").chmod(0o600)
    (tmp_path / "a.csv").symlink_to("elsewhere.csv")
    write_whole(tmp_path / "a.csv", lambda beside: beside.write_text("new"))
    assert not (tmp_path / "a.csv").is_symlink()
    assert (tmp_path / "elsewhere.csv").read_text() == "old"
    assert stat.S_IMODE((tmp_path / "a.csv").stat().st_mode) == 0o600


def test_a_head_of_two_lines_stands_above_its_column_as_text() -> None:
    table = Table(
        "", (Column("limit"), Column("error without it\n", ".3f", "rad/s"), Column("share", ".0%"))
    )
    table.add("orifice", 0.5, 0.25)
    first, second, row = str(table).splitlines()
    assert first.split() == ["error", "without", "it"]
    assert second.split() == ["limit", "deg/s", "share"]
    assert len(first) <= len(second) <= len(row)
    assert first.endswith("error without it")
