"""The linear model of any model's step against its march."""

from math import exp
from typing import NamedTuple

import numpy as np
import pytest

from swashplate import DomainError, Drive, InputError
from swashplate.equations.equation import equation
from swashplate.equations.marching.part import Stored
from swashplate.equations.marching.run import Instance, Part, marched
from swashplate.equations.model import Model, Tap, join
from swashplate.linear import linearize
from swashplate.simulation.instance import instance_of

H = 0.01


class Valve(NamedTuple):
    lag: float
    gain: float
    bend: float
    delay: float


class Opening(NamedTuple):
    opening: float


class Share(NamedTuple):
    share: float


class Flow(NamedTuple):
    flow: float


@equation
def valve_share(p: Valve, h: float) -> Share:
    return Share(1.0 - exp(-h / p.lag))


@equation
def valve_sample(state: Opening, command: float, p: Valve) -> Flow:
    return Flow(p.gain * state.opening + p.bend * state.opening * state.opening + 0.1 * command)


@equation
def valve_step(state: Opening, command: float, k: Share) -> Opening:
    return Opening(state.opening + k.share * (command - state.opening))


@equation
def valve_settled(command: float) -> Opening:
    return Opening(command)


@equation
def valve_margin(state: Opening) -> float:
    return 1.0 - state.opening


class Rod(NamedTuple):
    area: float


class Place(NamedTuple):
    position: float


@equation
def rod_step(state: Place, doubled: float, leak: float, p: Rod, h: float) -> Place:
    return Place(state.position + h * (doubled / p.area - leak * state.position))


@equation
def twice(flow: float) -> float:
    return 2.0 * flow


def valve(hold: str) -> Model:
    return Model(
        "valve",
        parameters=Valve,
        state=Opening,
        step=valve_step,
        sample=valve_sample,
        constants=valve_share,
        settled=valve_settled,
        domain=valve_margin,
        outside="the valve is wide open",
        taps={"command": Tap("command", delay="delay", hold=hold)},
    )


rod = Model("rod", parameters=Rod, state=Place, step=rod_step)
VALVE = Valve(0.05, 2.0, 3.0, 0.0237)


def machine(hold: str = "linear") -> Instance:
    whole = join("machine", valve(hold), rod, links={"doubled": twice})
    return Instance(whole, (Part(VALVE), Part(Rod(0.5))), "mine")


@pytest.mark.parametrize("hold", ["linear", "previous", "mean"])
def test_a_machine_of_one_s_own(hold: str) -> None:
    instance = machine(hold)
    at = {"command": 0.2, "leak": 1.5}
    flow = 2.0 * 0.2 + 3.0 * 0.2**2 + 0.02
    states = (Opening(0.2), Place(2.0 * flow / 0.5 / 1.5))
    model = linearize(instance, at, H, states=states, outputs=("position", "flow", "doubled"))
    assert model.inputs == ("command", "leak")
    assert model.states[:2] == ("valve.opening", "rod.position")
    assert set(model.states[2:]) == set(model.memory)
    late = round(model.delay / H)  # of the command
    assert late >= 2
    moved = 1e-6 * np.random.default_rng(1).standard_normal((200, 2))
    moved[0] = 0.0
    records = {"command": at["command"] + moved[:, 0], "leak": at["leak"] + moved[:, 1]}
    started = instance.start({k: float(v[0]) for k, v in records.items()}, H, "steady", states)
    out = marched(
        instance,
        records,
        H,
        started,
        (Stored(1, "state", "position"), Stored(0, "signals", "flow")),
    )
    x, y = np.zeros(model.A.shape[0]), np.empty((200, 3))
    command = np.concatenate((np.zeros(late), moved[:, 0]))[:200]
    for n, u in enumerate(np.column_stack((command, moved[:, 1]))):
        y[n] = model.C @ x + model.D @ u
        x = model.A @ x + model.B @ u
    for k in range(2):
        found = out[k] - out[k, 0]
        np.testing.assert_allclose(y[:, k], found, atol=2e-5 * np.abs(found).max())
    np.testing.assert_allclose(y[:, 2], 2.0 * y[:, 1])
    assert model.is_stable
    assert model.poles.size == 2
    np.testing.assert_allclose(sorted(model.poles.real), [exp(-H / 0.05), 1.0 - 1.5 * H])


def test_feedthrough_and_the_settled_state() -> None:
    instance = Instance(valve("linear"), (Part(VALVE._replace(delay=0.0)),), "mine")
    model = linearize(instance, {"command": 0.2}, H)
    assert model.outputs == ("flow", "opening")
    np.testing.assert_allclose(model.D[:, 0], [0.1, 0.0])
    np.testing.assert_allclose(model.gains, [2.0 + 6.0 * 0.2 + 0.1, 1.0])
    assert model.largest_gain > 0.0
    assert model.to_scipy().dt == H


def test_refusals() -> None:
    alone = Instance(valve("linear"), (Part(VALVE),), "mine")
    with pytest.raises(InputError, match="'wind' is no input"):
        linearize(alone, {"command": 0.2}, H, inputs=("wind",))
    with pytest.raises(DomainError, match="the valve is wide open under this operating point"):
        linearize(alone, {"command": 1.5}, H)
    with pytest.raises(InputError, match="rod has no equation for its steady state"):
        linearize(machine(), {"command": 0.2, "leak": 1.0}, H)


@pytest.mark.parametrize("at", [-3.0, 4.0])
def test_a_drive_as_any_model(hoist: Drive, at: float) -> None:
    h = 1.0 / 512.0
    own = hoist.linearize(at, outputs=("shaft_speed", "current"), coulomb="tangent").discrete(h)
    instance = instance_of(hoist.parameters, True)
    model = linearize(instance, {"voltage": at}, h, outputs=("shaft_speed", "current"))
    f = np.array([0.1, 1.0, 20.0])
    np.testing.assert_allclose(model.response(f), own.response(f), rtol=1e-10)
