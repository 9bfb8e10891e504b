"""A drive and its set are mappings of parameters, by symbol and by one direction."""

import pytest

from swashplate import Drive, InputError, Pair, ParameterError
from swashplate.parameters import COLUMNS, DEFINITIONS

HOIST = Drive.preset("hoist")


@pytest.mark.parametrize("mapping", [HOIST, HOIST.parameters], ids=["drive", "set"])
def test_the_contract_of_a_mapping(mapping) -> None:
    assert "Z16" in mapping
    assert "Z16_plus" in mapping
    assert "Z8_plus" not in mapping  # has no directions
    assert "Z99" not in mapping
    assert 0 not in mapping
    assert mapping.get("Z99") is None
    assert mapping.get("Z99", 3.0) == 3.0
    assert mapping.get("Z16") is mapping["Z16"]
    assert list(mapping) == list(mapping.keys()) == [each.symbol for each in mapping.values()]
    assert len(mapping) == len(list(mapping)) == 36
    assert dict(mapping)["Z8"].value == mapping["Z8"].value


@pytest.mark.parametrize("column", COLUMNS)
def test_what_replace_takes_can_be_asked_for(column: str) -> None:
    (before,) = HOIST[column].values
    assert HOIST[column].numbers == {column: before}
    assert HOIST[column].unit == DEFINITIONS.find(column).unit
    changed = HOIST.replace(**{column: 0.99 * before})
    assert changed[column].value == 0.99 * before
    assert changed[column].status == "user"


def test_one_direction_says_which_it_is() -> None:
    drive = HOIST.replace(Z16=(1.2e-4, 1.5e-4))
    assert drive["Z16"].value == Pair(1.2e-4, 1.5e-4)
    assert (drive["Z16_plus"].value, drive["Z16_minus"].value) == (1.2e-4, 1.5e-4)
    assert drive["Z16_plus"].name.endswith("positive")
    assert drive["Z16_minus"].name.endswith("negative")
    assert drive["Z16_plus"].symbol == "Z16_plus"
    assert not drive["Z16_plus"].definition.directional


def test_a_refinement_that_is_not_given_is_off() -> None:
    assert "spool_friction" not in HOIST
    assert HOIST["spool_friction"].status == "inactive"
    assert "spool_friction" in HOIST.replace(spool_friction=2.0)


def test_equality_and_hash_are_those_of_the_parameters() -> None:
    assert Drive.preset("hoist") == HOIST
    assert hash(HOIST) == hash(Drive.preset("hoist"))
    assert HOIST.replace(Z8=1e6) != HOIST


@pytest.mark.parametrize(
    ("given", "instead"),
    [
        ("hoist", 'Drive.preset("hoist")'),
        ("fitted/drive.toml", 'Drive.from_toml("fitted/drive.toml")'),
        (3.0, "takes a ParameterSet"),
    ],
)
def test_what_a_drive_is_not_made_of(given, instead: str) -> None:
    with pytest.raises(InputError) as caught:
        Drive(given)
    assert instead in str(caught.value)


def test_a_name_that_is_nearly_right() -> None:
    with pytest.raises(ParameterError, match="mean Z16_plus"):
        HOIST["Z16_pluss"]
