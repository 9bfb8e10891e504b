"""What a named tuple declares of its parameters."""

import copy
import pickle
from math import inf
from typing import Annotated, NamedTuple

import pytest

from swashplate.equations.fields import MINUS, Definition, declared_by


class Way(NamedTuple):
    gain: Annotated[float, Definition("gain of a way", "m/V", above=0.0)]
    lag: float


class Load(NamedTuple):
    mass: Annotated[float, Definition("mass of the load", "kg", 0.0)]


class Valve(NamedTuple):
    plus: Way
    minus: Way
    load: Load
    slope_plus: Annotated[float, Definition("slope of the load", "1/m")]
    slope_minus: Annotated[float, MINUS]
    left_plus: float


def test_directions_are_one_parameter() -> None:
    found = {each.symbol: each for each in declared_by(Valve)}
    assert list(found) == ["gain", "lag", "mass", "slope", "left_plus"]
    assert found["gain"].fields == ("plus.gain", "minus.gain")
    assert found["gain"].columns == ("gain_plus", "gain_minus")
    assert found["gain"].definition.name == "gain of a way"
    assert found["slope"].fields == ("slope_plus", "slope_minus")
    assert found["mass"].fields == ("load.mass",)
    assert found["mass"].columns == ("mass",)


def test_a_field_without_definition_is_its_own_name() -> None:
    found = {each.symbol: each for each in declared_by(Valve)}
    assert found["lag"].definition == Definition("lag", "")
    assert found["left_plus"].fields == ("left_plus",)


@pytest.mark.parametrize(
    ("definition", "words"),
    [
        (Definition("a", "1"), "any finite number"),
        (Definition("a", "1", 0.0), "at least 0"),
        (Definition("a", "1", above=0.0, upper=2.0), "above 0 and below 2"),
        (Definition("a", "1", above=0.0, can_be_off=True), "above 0, or inf for none"),
    ],
)
def test_ranges_are_words(definition: Definition, words: str) -> None:
    assert definition.range == words


def test_definitions_are_values() -> None:
    one = Definition("a", "1", above=0.0, symmetry={"size": 2.0})
    assert (one.lower, one.upper) == (0.0, inf)
    assert one == copy.deepcopy(one) == pickle.loads(pickle.dumps(one))
    assert hash(one) == hash(copy.deepcopy(one))
