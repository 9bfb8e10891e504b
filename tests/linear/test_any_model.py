"""The linear model of any model's step against its march."""

from collections.abc import Callable
from math import exp, inf
from typing import NamedTuple

import numpy as np
import pytest

from swashplate import DomainError, Drive, InputError
from swashplate.machine import Machine, Model, Tap, discretised, equation, join
from swashplate.machine.linear import LinearModel, linearize, settle
from swashplate.machine.marching import PartNumbers, SignalId, marched

RATE = 100.0
H = 1.0 / RATE


class Valve(NamedTuple):
    lag: float
    gain: float
    bend: float
    delay: float


class Opening(NamedTuple):
    opening: float


class Flow(NamedTuple):
    flow: float


@equation
def valve_sample(state: Opening, command: float, p: Valve) -> Flow:
    return Flow(p.gain * state.opening + p.bend * state.opening * state.opening + 0.1 * command)


@equation
def valve_step(state: Opening, command: float, p: Valve, h: float) -> Opening:
    share = 1.0 - exp(-h / p.lag)
    return Opening(state.opening + share * (command - state.opening))


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
        settled=valve_settled,
        domain=valve_margin,
        outside="the valve is wide open",
        taps={"command": Tap("command", delay="delay", hold=hold)},
    )


rod = Model("rod", parameters=Rod, state=Place, step=rod_step)
VALVE = Valve(0.05, 2.0, 3.0, 0.0237)


def machine(hold: str = "linear") -> Machine:
    whole = join("machine", valve(hold), rod, links={"doubled": twice})
    return Machine.of_parts(whole, (PartNumbers(VALVE), PartNumbers(Rod(0.5))), "mine")


@pytest.mark.parametrize("hold", ["linear", "previous", "mean"])
def test_a_machine_of_one_s_own(hold: str) -> None:
    instance = machine(hold)
    at = {"command": 0.2, "leak": 1.5}
    flow = 2.0 * 0.2 + 3.0 * 0.2**2 + 0.02
    states = (Opening(0.2), Place(2.0 * flow / 0.5 / 1.5))
    model = linearize(instance, at, RATE, states=states, outputs=("position", "flow", "doubled"))
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
        (SignalId(1, "state", "position"), SignalId(0, "signals", "flow")),
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
    instance = Machine.of_parts(valve("linear"), (PartNumbers(VALVE._replace(delay=0.0)),), "mine")
    model = linearize(instance, {"command": 0.2}, RATE)
    assert model.outputs == ("flow", "opening")
    np.testing.assert_allclose(model.D[:, 0], [0.1, 0.0])
    np.testing.assert_allclose(model.gains, [2.0 + 6.0 * 0.2 + 0.1, 1.0])
    assert model.largest_gain > 0.0
    assert model.to_scipy().dt == H


class Lag(NamedTuple):
    lag: float


class Table(NamedTuple):
    position: float
    speed: float


@equation
def table_rates(state: Table, command: float, p: Lag) -> Table:
    return Table(state.speed, (command - state.speed) / p.lag)


@equation
def table_coasts(state: Table, command: float, p: Lag) -> Table:
    return Table(state.speed, command / p.lag)


def table(rates: Callable[..., Table], lag: float, outputs: tuple[str, ...]) -> LinearModel:
    model = Model("table", parameters=Lag, state=Table, step=discretised(rates, "euler"))
    states = (Table(0.0, 0.0),)
    return linearize(
        Machine(model, Lag(lag)), {"command": 0.0}, RATE, states=states, outputs=outputs
    )


def test_a_position_loop_has_margins() -> None:
    model = table(table_rates, 0.2, ("position", "speed"))
    assert not model.is_stable
    np.testing.assert_allclose(model.gains, [inf, 1.0])
    np.testing.assert_allclose(model.response([0.0])[:, 0].real, [inf, 1.0])
    with pytest.raises(DomainError, match="position .* command, .* bandwidth"):
        print(model.bandwidth)
    # z² - (2 - h/T) z + 1 - h/T + K h²/T has its roots on the circle at K = 1/h
    assert model.largest_gain == pytest.approx(1.0 / H)
    margins = model.margins(2.0)
    assert margins.gain_margin == pytest.approx(0.5 / H)
    # |L| = 1 and the phase there, of K h²/T / ((z - 1) (z - 1 + h/T))
    z = np.exp(2j * np.pi * margins.crossover * H)
    loop = 2.0 * H * H / 0.2 / ((z - 1.0) * (z - 1.0 + H / 0.2))
    assert abs(loop) == pytest.approx(1.0)
    assert margins.phase_margin == pytest.approx(np.pi + np.angle(loop))
    tiny = model.margins(1e-12)  # its crossover lies far below all else
    assert tiny.crossover == pytest.approx(1e-12 / (2.0 * np.pi))
    assert tiny.phase_margin == pytest.approx(np.pi / 2.0)
    with pytest.raises(DomainError, match="closed loop"):
        model.margins(-2.0)
    # the speed alone: its response is that of the lag, whatever the position does
    speed = table(table_rates, 0.2, ("speed",))
    assert speed.gain == pytest.approx(1.0)
    assert speed.largest_gain == pytest.approx(2.0 * 0.2 / H - 1.0)


def test_two_integrators_need_a_lead() -> None:
    model = table(table_coasts, -0.2, ("position",))
    assert model.gain == -inf
    with pytest.raises(DomainError, match="closed loop"):
        model.margins(-1.0)

    gain, lead = 1.0, 0.5 / H  # in samples

    def controller(f: np.ndarray) -> np.ndarray:
        return -gain * (1.0 + lead * (1.0 - np.exp(-2j * np.pi * f * H)))

    # z (z - 1)² + K h²/T ((1 + lead) z - lead) has a root on the circle at the margin
    factor = model.margins(controller).gain_margin * gain * H * H / 0.2
    roots = np.roots([1.0, -2.0, 1.0 + factor * (1.0 + lead), -factor * lead])
    assert np.abs(roots).max() == pytest.approx(1.0)
    assert factor > H * H / 0.2


def test_a_machine_without_an_equation_for_it_settles_by_a_march() -> None:
    """By hand: the leak lets out what flows in; without one the rod goes on at a constant speed."""
    flow = 2.0 * 0.2 + 3.0 * 0.2**2 + 0.02
    point = settle(machine(), {"command": 0.2, "leak": 1.5}, RATE)
    assert not point.by_equation
    np.testing.assert_allclose(point.flat, [0.2, 2.0 * flow / 0.5 / 1.5], rtol=1e-8)
    assert not point.rates.any()
    small = linearize(machine(), {"command": 0.2, "leak": 1.5}, RATE)
    known = linearize(machine(), {"command": 0.2, "leak": 1.5}, RATE, states=point.states)
    assert np.array_equal(small.A, known.A)
    tight = settle(machine(), {"command": 0.2, "leak": 0.0}, RATE, begin={"rod.position": 0.3})
    np.testing.assert_allclose(tight.flat, [0.2, 0.3], rtol=1e-8)
    np.testing.assert_allclose(tight.rates, [0.0, 2.0 * flow / 0.5], rtol=1e-6)
    with pytest.raises(InputError, match=r"'rod.place'; there are"):
        settle(machine(), {"command": 0.2, "leak": 0.0}, RATE, begin={"rod.place": 0.3})


class Swing(NamedTuple):
    angle: float = 0.1
    speed: float = 0.0


@equation
def swing_step(state: Swing, push: float, p: Rod, h: float) -> Swing:
    speed = state.speed + h * (push - state.angle / p.area)
    return Swing(state.angle + h * speed, speed)


def test_what_never_settles_is_said() -> None:
    swing = Machine(Model("swing", Rod, Swing, swing_step), Rod(0.5))
    with pytest.raises(DomainError, match=r"swing does not settle within 1024 s .* states="):
        linearize(swing, {"push": 0.0}, 10.0)


def test_refusals() -> None:
    alone = Machine.of_parts(valve("linear"), (PartNumbers(VALVE),), "mine")
    with pytest.raises(InputError, match="'wind' .* input"):
        linearize(alone, {"command": 0.2}, RATE, inputs=("wind",))
    with pytest.raises(DomainError, match="the valve is wide open under this operating point"):
        linearize(alone, {"command": 1.5}, RATE)


@pytest.mark.parametrize("at", [-3.0, 4.0])
def test_a_drive_as_any_model(hoist: Drive, at: float) -> None:
    own = hoist.linearize(at, outputs=("shaft_speed", "current"), coulomb="tangent").discrete(512.0)
    instance = hoist
    model = linearize(instance, {"voltage": at}, 512.0, outputs=("shaft_speed", "current"))
    f = np.array([0.1, 1.0, 20.0])
    np.testing.assert_allclose(model.response(f), own.response(f), rtol=1e-10)
