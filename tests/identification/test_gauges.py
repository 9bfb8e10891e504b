"""The gauge freedoms, walked along with the drive itself."""

import numpy as np
import pytest

from swashplate import Drive, maneuvers
from swashplate.identification.identifiability import GAUGES, Gauge, symbol_of
from swashplate.identification.unknowns import Unknowns

BY_NAME = {gauge.name: gauge for gauge in GAUGES}
EXACT = ("scale of pressure", "zero of pressure", "scale of spool travel", "scale of force")


def walked(drive: Drive, gauge: Gauge, t: float) -> Drive:
    numbers = dict(drive.parameters.numbers)
    known = {symbol_of(name): value for name, value in numbers.items()}
    moved = {
        name: gauge.moves[symbol_of(name)](value, t, known)
        for name, value in numbers.items()
        if symbol_of(name) in gauge.moves
    }
    return drive.replace(**moved)


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


def test_tangents_by_hand() -> None:
    names = ["Z1", "Z8", "Z9", "Z6", "Z2", "Z16_plus", "force_minus_2"]
    values = np.array([4e-7, 1.6e6, 1e7, 0.25, 0.0, 1e-4, 2.0])
    variables = Unknowns.of(
        names, values, scales=[1e-7, 1.0, 1e7, 0.5, 0.1, 1e-4, 4.0],
        logarithmic=[False, True, False, False, False, False, False],
    )  # fmt: skip
    pressure = BY_NAME["scale of pressure"].tangent(variables)
    np.testing.assert_allclose(pressure, [-4.0, 0.5, 1.0, 0.0, 0.0, 0.0, 0.0], atol=1e-11)
    zero = BY_NAME["zero of pressure"].tangent(variables)
    # Z2 moves by Z1·Z9 = 4 for t = 1, in units of 0.1
    np.testing.assert_allclose(zero, [0.0, 0.0, 1.0, 0.0, 40.0, 0.0, 0.0], atol=1e-10)
    motion = BY_NAME["piston motion against flow gain"].tangent(variables)
    np.testing.assert_allclose(motion, [0.0, 1.0, 0.0, 2.5, 0.0, 0.0, 0.0], atol=1e-11)
    force = BY_NAME["scale of force"].tangent(variables)
    np.testing.assert_allclose(force, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5], atol=1e-11)


def test_a_gauge_that_needs_a_held_value_is_told_it() -> None:
    variables = Unknowns.of(["Z2", "Z9"], [0.0, 2.0], scales=[1.0, 2.0])
    gauge = BY_NAME["zero of pressure"]
    assert not gauge.tangent(variables).any()
    np.testing.assert_allclose(gauge.tangent(variables, {"Z1": 0.5}), [1.0, 1.0], atol=1e-11)


@pytest.mark.parametrize(
    ("name", "symbol"),
    [
        ("Z4", "Z4"),
        ("Z16_minus", "Z16"),
        ("force_plus_2", "force"),
        ("initial pressure (hoistr6)", "initial pressure"),
        ("pump.Z1", "Z1"),
    ],
)
def test_symbols(name: str, symbol: str) -> None:
    assert symbol_of(name) == symbol
