"""Directions in words."""

import numpy as np
import pytest

from swashplate.identification.identifiability import (
    GAUGES,
    Direction,
    Space,
    faint_directions,
    null_directions,
)
from swashplate.identification.unknowns import Unknowns


def space(derivatives: np.ndarray) -> Space:
    lengths = np.linalg.norm(derivatives, axis=0)
    return Space(derivatives / lengths, lengths, np.arange(lengths.size))


def test_sentences() -> None:
    pair = {"Z3": -0.7, "Z9": 1.0}
    assert Direction(pair, 0.0, None, "Z9").sentence == (
        "Z3 -0.7 %, Z9 +1 % together change nothing. Hold Z9."
    )
    assert Direction({"Z14": 1.0}, 0.0, None, "Z14").sentence == (
        "Z14 +1 % changes nothing. Hold Z14."
    )
    assert Direction(pair, 5e-4, None, "Z3").sentence == (
        "Faint: Z3 -0.7 %, Z9 +1 % move together and change the residuals 2,000 times less than "
        "the clearest direction; hold one of them only if you know it, or make a test that tells "
        "them apart."
    )
    gauge = next(each for each in GAUGES if "Z6" in each.moves)
    assert Direction({"Z8": 1.0, "Z6": 0.9}, 1e-5, gauge, "Z6").sentence == (
        "Faint: Z6 and Z8 move together all but unseen (piston motion against flow gain): only "
        "Z8/(1+Z6) is determined; hold one of them only if you know it, or make a test that tells "
        "them apart."
    )
    assert Direction({"Z8": 1.0, "Z6": 0.9}, 0.0, gauge, "Z6").sentence == (
        "Z6 and Z8 can move together unseen (piston motion against flow gain): only Z8/(1+Z6) is "
        "determined. Hold Z6."
    )


def test_long_directions_are_cut() -> None:
    many = {f"Z{k}": 1.0 for k in range(9)}
    assert (
        "Z5 +1 % and 3 others together change nothing" in Direction(many, 0.0, None, "Z1").sentence
    )


def test_the_largest_change_is_one_per_cent() -> None:
    """Columns 1 and -4 of one shape: the first must move four times as far."""
    shape = np.random.default_rng(0).normal(size=(20, 1))
    (found,) = null_directions(
        space(shape * [1.0, -4.0]), Unknowns.of("ab", np.ones(2)), [], {}, 1e-10
    )
    assert found.changes["a"] == pytest.approx(1.0)
    assert found.changes["b"] == pytest.approx(0.25)


def test_of_a_faint_direction_the_cheaper_unknown_is_held() -> None:
    """b has to move four times as far as a for the same effect: holding it costs less."""
    rng = np.random.default_rng(1)
    shape, other, third = rng.normal(size=(3, 200))
    columns = np.column_stack([4.0 * shape, shape + 1e-5 * other, third])
    (found,) = faint_directions(space(columns), Unknowns.of("abc", np.ones(3)), [], {}, 1e-3)
    assert found.hold == "b"
    assert 1e-6 < found.sharpness < 1e-4


def test_an_empty_space_has_no_directions() -> None:
    empty = Space(np.zeros((3, 0)), np.zeros(0), np.zeros(0, np.intp))
    assert faint_directions(empty, Unknowns.of("a", [1.0]), [], {}, 1e-3) == []
