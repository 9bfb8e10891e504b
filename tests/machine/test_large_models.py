"""What grows with the square of a model's states elsewhere: derivatives and linear models."""

from collections.abc import Collection
from math import asin, pi, sin, sqrt

import numpy as np
import pytest
from tests.machine.large_models import (
    AXES,
    SHIP,
    Body,
    State,
    body,
    chain_of,
    crane,
    crane_run,
    numbers_of_crane,
)
from tests.machine.tangents import marched

from swashplate import Drive, InputError
from swashplate.crane.kinematics import Shafts, boom_at, rope_length, tip_of
from swashplate.crane.rope import hanging_load
from swashplate.machine import Machine, sensitivities, simulate
from swashplate.machine.fields import floats_of
from swashplate.machine.linear import linearize
from swashplate.machine.marching import tangents
from swashplate.machine.model import parameter_paths

RATE = 512.0
GRAVITY = 9.80665


@pytest.fixture(scope="module")
def run():
    return crane_run()


@pytest.fixture(scope="module")
def parameters(run) -> Body:
    return Body(run.fixed.geometry, run.fixed.home, run.fixed.hanging)


def inputs(run, size: int) -> dict[str, np.ndarray]:
    speeds = {axis: np.array(run[f"speed_{axis}"][:size]) for axis in ("hoist", "slew", "luff")}
    return speeds | {name: np.zeros(size) for name in SHIP}


def assert_columns(
    found, signal: str, slopes: np.ndarray, paths: list[str], but: Collection[str] = ()
) -> None:
    """That columns are those of tangents, carried node by node."""
    columns = found[signal]
    assert np.abs(columns).max() > 0.0
    for k, name in enumerate(found.names):
        if name in but:
            continue
        expected = slopes[:, paths.index(name)]
        size = np.abs(expected).max()
        assert np.abs(columns[:, k] - expected).max() <= 1e-9 * size, name


def test_a_cranes_body_is_the_crane(run, parameters: Body) -> None:
    size = run["load_x"].size
    found = simulate(Machine(body, parameters), inputs(run, size), RATE)
    for axis in "xyz":
        assert np.array_equal(found[f"hung.load.{axis}"], run[f"load_{axis}"])


@pytest.mark.slow
def test_columns_of_a_cranes_body(run, parameters: Body) -> None:
    given = inputs(run, 400)
    found = sensitivities(Machine(body, parameters), given, RATE)
    instance = Machine(body, parameters)
    values, slopes = marched(instance, given, 1.0 / RATE, "hung.load.x")
    assert np.array_equal(found.run["hung.load.x"], values)
    assert_columns(found, "hung.load.x", slopes, [*floats_of(Body)])


def test_a_hanging_load_swings_as_a_pendulum(parameters: Body) -> None:
    rest = Shafts(0.0, 0.0, 0.0)
    boom = boom_at(0.0, parameters.geometry, parameters.home)
    tip = tip_of(parameters.home.slew, boom, parameters.geometry)
    rope = float(rope_length(rest, parameters.geometry, parameters.home))
    hung = hanging_load(tip, 0.0, 0.0, rope, parameters.hanging)
    state = State(2.0, rest, rest, rope, tip, hung)
    at = dict.fromkeys(("hoist", "slew", "luff", *SHIP), 0.0)
    model = linearize(Machine(body, parameters), at, RATE, states=[state], outputs=["rope"])
    values = np.linalg.eigvals(model.A)
    poles = RATE * np.log(values[np.abs(values) > 1e-6].astype(complex))
    swings = np.sort(poles.imag[poles.imag > 0.1])
    damped = parameters.hanging.swing_damping
    assert damped < 0.01
    # 20 m of rope along two directions, and 4th digits of damping
    assert swings == pytest.approx([sqrt(GRAVITY / rope)] * 2, rel=1e-4)


def voltages(size: int) -> dict[str, np.ndarray]:
    time = np.arange(size) / RATE
    moves = {f"{axis}.voltage": 5.0 * np.sin(0.3 * time + k) for k, axis in enumerate(AXES)}
    return moves | {f"body.{name}": 0.1 * np.sin(0.7 * time) for name in SHIP}


def test_three_drives_and_a_body_are_the_drives_and_the_body(parameters: Body) -> None:
    (p, options), given = numbers_of_crane(parameters), voltages(2000)
    found = simulate(Machine(crane, p, options=options), given, RATE)
    speeds = {
        axis: Drive.preset(axis).simulate(voltage=given[f"{axis}.voltage"], rate=RATE).shaft_speed
        for axis in AXES
    }
    for axis, speed in speeds.items():
        assert np.array_equal(found[f"{axis}.shaft_speed"], speed), axis
    ship = {name: given[f"body.{name}"] for name in SHIP}
    assert np.array_equal(
        found["hung.load.x"],
        simulate(Machine(body, parameters), speeds | ship, RATE)["hung.load.x"],
    )


def test_three_drives_and_a_body_are_the_crane(parameters: Body) -> None:
    """Without the hoist's brake, which is no part of either."""
    run = crane_run(brake=False)
    p, options = numbers_of_crane(parameters)
    given = {f"{axis}.voltage": run[f"voltage_{axis}"] for axis in AXES}
    given |= {f"body.{name}": np.zeros(run["load_x"].size) for name in SHIP}
    found = simulate(Machine(crane, p, options=options), given, RATE)
    for axis in "xyz":
        assert np.array_equal(found[f"hung.load.{axis}"], run[f"load_{axis}"]), axis


@pytest.mark.slow
def test_columns_of_three_drives_and_a_body(parameters: Body) -> None:
    (p, options), given = numbers_of_crane(parameters), voltages(120)
    found = sensitivities(Machine(crane, p, options=options), given, RATE)
    instance = Machine(crane, p, options=options)
    values, slopes = marched(instance, given, 1.0 / RATE, "hung.load.x")
    assert np.array_equal(found.run["hung.load.x"], values)
    assert len(found.names) == 239
    paths = list(parameter_paths(crane))
    off = {
        path
        for path, value in zip(paths, instance.params.tolist(), strict=True)
        if value == 0.0 and not path.startswith("body.")
    }
    """With a derivative to one side that is declared."""
    assert_columns(found, "hung.load.x", slopes, paths, off)


@pytest.fixture(scope="module")
def chain(tmp_path_factory: pytest.TempPathFactory):
    return chain_of(30, tmp_path_factory.mktemp("chain"))


def test_a_chain_of_thirty_masses_has_its_frequencies(chain) -> None:
    """Fixed at one end: ω_k = 2 √(k/m) sin((2 k - 1) π / (4 n + 2)), by a step of h that is
    implicit in the speeds sin(ω' h / 2) = ω h / 2."""
    rate, stiffness = 2000.0, 1e4
    p = chain.Chain(1.0, stiffness, 0.0, 1e-3, 1e6)
    rest = chain.State(*[0.0] * 60)
    model = linearize(Machine(chain.chain, p), {"push": 0.0}, rate, states=[rest])
    found = np.sort(rate * np.abs(np.log(np.linalg.eigvals(model.A)).imag))[::2]
    ideal = [2.0 * sqrt(stiffness) * sin((2 * k - 1) * pi / 122) for k in range(1, 31)]
    expected = [2.0 * rate * asin(0.5 * omega / rate) for omega in ideal]
    assert found == pytest.approx(expected, rel=1e-9)


@pytest.mark.slow
def test_columns_of_a_chain_that_meets_its_stops(chain) -> None:
    rate = 2000.0
    p = chain.Chain(1.0, 1e4, 5.0, 1e-3, 1e6)
    push = 25.0 * np.sin(np.arange(600) / 30.0)
    found = sensitivities(Machine(chain.chain, p), {"push": push}, rate)
    values, slopes = marched(Machine(chain.chain, p), {"push": push}, 1.0 / rate, "end")
    assert np.array_equal(found.run["end"], values)
    assert np.abs(slopes[:, 4]).max() > 0.0, "no stop was met"
    assert_columns(found, "end", slopes, [*floats_of(chain.Chain)])


def test_what_is_too_large_is_refused_with_its_size(chain, monkeypatch) -> None:
    monkeypatch.setattr(tangents, "MOST_OPERATIONS", 1000)
    p = chain.Chain(1.0, 1e4, 4.0, 1e-3, 1e6)
    found = sensitivities(
        Machine(chain.chain, p), {"push": [0.0, 1.0]}, 2000.0, parameters=["mass"]
    )
    with pytest.raises(
        InputError, match=r"chain: .* 1 columns are \d+ operations .* fewer columns"
    ):
        found["end"]
