"""Definitions as the models declare them, and rules that evaluate the models."""

import numpy as np
import pytest

from swashplate import Drive
from swashplate.parameters import REFINEMENTS, check_rules


def test_what_is_switched_on_can_be_estimated() -> None:
    """At zero it is another model: an estimate stays above."""
    for symbol, each in REFINEMENTS.items():
        if each.lower == 0.0:
            assert each.least is not None, symbol
            assert 0.0 < each.least < each.upper
        if each.switch:
            assert each.default == 0.0


@pytest.mark.parametrize(
    ("column", "value", "part"),
    [
        ("G3_plus", -0.01, "the steady current of the plus channel falls to"),
        ("Z19_minus", 1e3, "within 10 V (minus), but must be below 1"),
        ("Z4", np.nan, "Z4"),
    ],
)
def test_a_thousand_sets_are_checked_as_one(
    hoist: Drive, column: str, value: float, part: str
) -> None:
    sets = {name: np.full(1000, number) for name, number in hoist.parameters.numbers.items()}
    sets[column][123] = value
    found = {int(i): s(int(i)) for mask, s in check_rules(sets) for i in np.flatnonzero(mask)}
    assert list(found) == [123]
    alone = {name: values[123:124] for name, values in sets.items()}
    sentences = [sentence(0) for mask, sentence in check_rules(alone) if mask[0]]
    assert found[123] in sentences
    assert any(part in each for each in sentences)
