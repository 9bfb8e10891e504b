import pytest

from swashplate import Drive
from swashplate.parameters.definitions import CATALOGUE
from swashplate.parameters.files import preset_names


def test_axes_lists_speeds(done, number):
    text = done("axes")
    for name in preset_names():
        assert f"\n{name} " in text
    hoist = next(line for line in text.splitlines() if line.startswith("hoist "))
    assert [float(word) for word in hoist.split()[-3:]] == [-185.00, 3.09, 196.00]
    assert "rexroth_mdsd_1k_2x_4" in text
    assert max(map(len, text.splitlines())) <= 80


@pytest.mark.parametrize("name", preset_names())
def test_show_lists_every_parameter_in_80_columns(done, name):
    text = done("show", name)
    first_words = [line.split()[0] for line in text.splitlines() if line.strip()]
    assert set(CATALOGUE) <= set(first_words)
    assert max(map(len, text.splitlines())) <= 80
    assert "…" not in text


def test_show_has_values_units_status_and_source(done):
    lines = done("show", "hoist").splitlines()
    (row,) = [line for line in lines if line.startswith("Z16 ")]
    assert row.split()[-4:] == ["0.00011634", "0.00015126", "m", "fitted"]
    assert row.split()[1:3] == ["opening", "at"]
    sources = [line.strip() for line in lines if line.strip().endswith(":")]
    assert sources == ["tables 4.1, 4.3:", "tables 4.2, 4.4:", "table 7.2:"]


def test_toml_starts_an_own_set(done, tmp_path):
    (tmp_path / "mine.toml").write_text(done("show", "hoist", "--toml"), "utf-8")
    mine, hoist = Drive.from_toml(tmp_path / "mine.toml"), Drive.preset("hoist")
    assert mine == hoist
    assert done("show", "mine.toml") == done("show", "hoist")


def test_toml_holds_the_card_too(done):
    assert "[control_card]" in done("show", "slew", "--toml")


def test_show_refuses_an_unknown_name(refused):
    assert "packaged are hoist, slew, luff, neutral" in refused("show", "crane")
