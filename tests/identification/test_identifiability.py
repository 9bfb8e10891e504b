"""Verdicts on what tests can tell, and the gauge freedoms, walked along with the drive itself."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests.identification.given import unknowns_of

from swashplate import Drive, maneuvers
from swashplate.identification.identifiability import (
    GAUGES,
    Gauge,
    Identifiability,
    identifiability,
    symbol_of,
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


@pytest.fixture(scope="module")
def hoist_columns() -> tuple[list[str], np.ndarray, np.ndarray]:
    drive = Drive.preset("hoist")
    voltages = [step(9.0), step(-6.5), sine(9.0, 0.1, length=20.0)]
    found = [drive.sensitivities(each.sample(128.0), 128.0, parameters=PUMP) for each in voltages]
    names = list(found[0].names)
    values = np.array([drive.parameters.numbers[name] for name in names])
    return names, values, np.vstack([each.shaft_speed for each in found])


def hoist(parts: tuple, leave: set[str], **more: object) -> Identifiability:
    names, values, derivatives = parts
    kept = [k for k, name in enumerate(names) if name not in leave]
    scales = np.where(values == 0.0, 1.0, np.abs(values))[kept]
    variables = unknowns_of([names[k] for k in kept], values[kept], scales=scales)
    return identifiability(derivatives[:, kept] * scales, variables, **more)


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


def test_the_gauges_of_the_hoist(hoist_columns: tuple) -> None:
    found = hoist(hoist_columns, set())
    assert found.unexcited == ("Z14", "Z15")
    names = [each.gauge.name for each in found.null if each.gauge]
    assert names == [
        "scale of pressure",
        "zero of pressure",
        "scale of spool travel",
        "scale of force",
    ]
    assert len(found.null) == 4
    assert found.to_fix == ("Z14", "Z15", "Z1", "Z2", "Z5", "Z4")


def test_two_gauges_tied_by_a_held_member_are_one_direction(hoist_columns: tuple) -> None:
    """With Z8 held, pressure and spool travel can only scale together."""
    found = hoist(hoist_columns, {"Z14", "Z15", "Z2", "Z7", "Z11", "Z12", "Z8", "Z4"})
    (direction,) = [each for each in found.null if each.gauge is None]
    assert {"Z1", "Z5", "Z9", "Z16_plus", "Z16_minus", "Z18"} <= set(direction.changes)
    assert direction.changes["Z1"] / direction.changes["Z5"] == pytest.approx(-2.0, rel=1e-6)


# --- gauges ---------------------------------------------------------------------------------------


BY_NAME = {gauge.name: gauge for gauge in GAUGES}
EXACT = ("scale of pressure", "zero of pressure", "scale of spool travel", "scale of force")


def walked(drive: Drive, gauge: Gauge, t: float) -> Drive:
    """A drive moved by t along a gauge."""
    start = drive.parameters.numbers
    moved = [name for name in start if symbol_of(name) in gauge.moves]

    def slope(_: float, values: np.ndarray) -> list[float]:
        known = {symbol_of(name): value for name, value in start.items()}
        known |= {symbol_of(name): value for name, value in zip(moved, values, strict=True)}
        pairs = zip(moved, values, strict=True)
        return [gauge.moves[symbol_of(name)](value, known) for name, value in pairs]

    begin = [start[name] for name in moved]
    end = solve_ivp(slope, (0.0, t), begin, method="DOP853", rtol=1e-13, atol=1e-30).y[:, -1]
    return drive.replace(**dict(zip(moved, end.tolist(), strict=True)))


def speeds(drive: Drive) -> np.ndarray:
    voltage = (maneuvers.step(9.0, start=0.2, stop=4.0) + maneuvers.sine(4.0, 0.3)).sample(512.0)
    return drive.simulate(voltage).shaft_speed


@pytest.mark.parametrize("name", EXACT)
def test_no_speed_tells_an_exact_gauge(axis: Drive, name: str) -> None:
    before = speeds(axis)
    after = speeds(walked(axis, BY_NAME[name], 0.05))
    np.testing.assert_allclose(after, before, rtol=0.0, atol=1e-11 * np.abs(before).max())


@pytest.mark.parametrize("name", sorted(set(BY_NAME) - set(EXACT)))
def test_speeds_hardly_tell_the_others(hoist: Drive, name: str) -> None:
    """A tenth of every value changes the speed by less than a hundredth, but changes it."""
    before = speeds(hoist)
    change = np.abs(speeds(walked(hoist, BY_NAME[name], 0.1)) - before).max()
    assert 1e-9 < change / np.abs(before).max() < 0.01
