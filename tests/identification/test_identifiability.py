"""Verdicts on what tests can tell, and the gauge freedoms, walked along with the drive itself."""

from functools import cache

import numpy as np
import pytest
from tests.identification.given import unknowns_of

from swashplate import Drive
from swashplate.identification.identifiability import (
    Identifiability,
    identifiability,
)
from swashplate.maneuvers import sine, step

RNG = np.random.default_rng(4)
PUMP = [f"Z{k}" for k in range(1, 23)]


def columns(*null: tuple[float, ...], rows: int = 50) -> np.ndarray:
    """Derivatives that vanish along given directions."""
    count = len(null[0])
    basis = np.linalg.qr(np.array(null).T, mode="complete")[0][:, len(null) :]
    return RNG.normal(size=(rows, count - len(null))) @ basis.T


def judged(derivatives: np.ndarray, names: str | list[str], **more: object) -> Identifiability:
    return identifiability(derivatives, unknowns_of(list(names), np.ones(len(names))), **more)


@cache
def pump_columns(axis: str) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Names and values of a pump's parameters, and how the speed depends on them."""
    drive = Drive.preset(axis)
    voltages = [step(9.0), step(-6.5), sine(9.0, 0.1, length=20.0)]
    found = [drive.sensitivities(each.sample(128.0), 128.0, parameters=PUMP) for each in voltages]
    names = list(found[0].names)
    values = np.array([drive.parameters.numbers[name] for name in names])
    return names, values, np.vstack([each.shaft_speed for each in found])


def pump(axis: str, leave: set[str] = frozenset()) -> Identifiability:
    """What the tests of a pump tell, without some of its parameters."""
    names, values, derivatives = pump_columns(axis)
    kept = [k for k, name in enumerate(names) if name not in leave]
    scales = np.where(values == 0.0, 1.0, np.abs(values))[kept]
    variables = unknowns_of([names[k] for k in kept], values[kept], scales=scales)
    return identifiability(derivatives[:, kept] * scales, variables)


def test_a_null_direction_is_written_by_name() -> None:
    found = judged(columns((0.0, -0.7, 0.0, 0.7)), ["Z1", "Z3", "Z8", "Z9"])
    (direction,) = found.null
    assert direction.changes["Z3"] == pytest.approx(-direction.changes["Z9"])
    assert set(direction.changes) == {"Z3", "Z9"}
    assert "together change nothing. Fix Z" in direction.sentence
    assert direction.gauge is None
    assert found.rank == 3


def test_two_null_directions_come_apart() -> None:
    """Any mixture of two null directions is null too: the sparse ones are wanted."""
    found = judged(columns((1.0, 1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0, -2.0)), "abcde")
    assert {frozenset(each.changes) for each in found.null} == {frozenset("ab"), frozenset("de")}
    assert len({each.fix for each in found.null}) == 2


def test_a_weak_unknown_is_named_with_what_follows_it() -> None:
    """b differs from a by little: both are known to ±20 % only, their sum well."""
    base = np.linalg.qr(RNG.normal(size=(100, 3)))[0] * 1e3
    base[:, 1] = base[:, 0] + 1e-2 * base[:, 1]
    found = judged(base, "abc")
    assert found.complete
    (direction,) = found.weak
    # along (1, -1) only 1e-2 of the second column of length 1e3 is seen
    assert direction.half_width == pytest.approx(1.96 / 10.0, rel=1e-3)
    assert set(direction.changes) == {"a", "b"}
    assert direction.changes["a"] == pytest.approx(-direction.changes["b"], rel=1e-3)
    assert f"{direction.fix} is known to ±19.6 % only" in direction.sentence


def test_weak_is_what_the_given_covariance_says() -> None:
    given = np.diag([0.06**2, 0.01**2, 0.04**2])
    (direction,) = judged(RNG.normal(size=(10, 3)), "abc", covariance=given).weak
    assert direction.fix == "a"
    assert "a is known to ±11.8 % only" in direction.sentence
    wider = judged(RNG.normal(size=(10, 3)), "abc", covariance=9.0 * given).sentences()
    assert sum("Weak" in each for each in wider) == 1
    assert "Weak, each with those before it fixed: a to ±35.3 % and c to ±23.5 %." in wider[-1]


EXACT = ["scale of pressure", "zero of pressure", "scale of spool travel", "scale of force"]
FIXED = ["Z1", "Z2", "Z5", "Z4"]


@pytest.mark.parametrize("axis", ["hoist", "slew", "luff"])
def test_no_speed_tells_the_gauges_of_a_pump(axis: str) -> None:
    found = pump(axis)
    stop = ["Z13_plus", "Z13_minus"] if axis == "luff" else []
    assert {*found.unexcited} == {*stop, "Z14", "Z15"}
    # away from the swash plate's stops one more
    names = EXACT + ["piston motion against flow gain"] * bool(stop)
    assert [each.gauge.name for each in found.null if each.gauge] == names
    assert len(found.null) == len(names)
    assert [*found.to_fix] == [*found.unexcited, *FIXED] + ["Z6"] * bool(stop)


def test_two_gauges_tied_by_a_held_member_are_one_direction() -> None:
    """With Z8 held, pressure and spool travel can only scale together."""
    found = pump("hoist", {"Z14", "Z15", "Z2", "Z7", "Z11", "Z12", "Z8", "Z4"})
    (direction,) = [each for each in found.null if each.gauge is None]
    assert {"Z1", "Z5", "Z9", "Z16_plus", "Z16_minus", "Z18"} <= set(direction.changes)
    assert direction.changes["Z1"] / direction.changes["Z5"] == pytest.approx(-2.0, rel=1e-6)
