"""Taps on signals between parts: past samples of what another part gives, and of an equation."""

from math import exp
from typing import Annotated, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from swashplate.machine import (
    Definition,
    Machine,
    Model,
    Tap,
    Window,
    equation,
    join,
    sensitivities,
    simulate,
    simulate_many,
    stepper,
)
from swashplate.machine.linear import linearize, settle
from swashplate.machine.model import parameter_paths

Array = NDArray[np.float64]
RATE = 100.0
H = 1.0 / RATE


class Feed(NamedTuple):
    lag: Annotated[float, Definition("time constant", "s", above=0.0)] = 0.05
    gain: Annotated[float, Definition("gain", "1")] = 2.0


class Filled(NamedTuple):
    fill: float = 0.0


class Flow(NamedTuple):
    flow: float


@equation
def feed_sample(state: Filled, command: float, p: Feed) -> Flow:
    return Flow(p.gain * state.fill + 0.2 * command)


@equation
def feed_step(state: Filled, command: float, p: Feed, h: float) -> Filled:
    return Filled(state.fill + (1.0 - exp(-h / p.lag)) * (command - state.fill))


@equation
def feed_settled(command: float) -> Filled:
    return Filled(command)


class Pipe(NamedTuple):
    first: Annotated[float, Definition("delay of the flow", "s", lower=0.0)] = 0.123
    second: Annotated[float, Definition("delay of its square", "s", lower=0.0)] = 0.004


class Level(NamedTuple):
    level: float = 0.0


class Out(NamedTuple):
    out: float


@equation
def squared(flow: float) -> float:
    """Of the flow."""
    return flow * flow


@equation
def pipe_sample(state: Level, flow: float, held: float, mean: float, seen: Window) -> Out:
    return Out(state.level + flow + 2.0 * held + 3.0 * mean + seen.s[2] + seen.f)


@equation
def pipe_step(state: Level, flow: float, mean: float, h: float) -> Level:
    return Level(state.level + h * (flow + mean - 5.0 * state.level))


@equation
def pipe_settled(flow: float, mean: float) -> Level:
    return Level((flow + mean) / 5.0)


feed = Model("feed", Feed, Filled, feed_step, feed_sample, settled=feed_settled)
pipe = Model(
    "pipe",
    Pipe,
    Level,
    pipe_step,
    pipe_sample,
    settled=pipe_settled,
    taps={
        "flow": Tap("flow", delay="first"),
        "held": Tap("flow", delay="first", hold="previous"),
        "mean": Tap("square", delay="second", hold="mean"),
        "seen": Tap("square", delay="second", ahead=1.0, width=3),
    },
)
line = join("line", feed, pipe, links={"square": squared})


def machine(first: float = 0.123, second: float = 0.004) -> Machine:
    return Machine(line, line.parameters(Feed(), Pipe(first, second)))


def expected(command: Array, first: float, second: float, start: str) -> Array:
    """The same by hand: the whole of the feed, then the pipe behind it."""
    steady = start == "steady"
    fill, flow = (command[0] if steady else 0.0), np.empty(command.size)
    for n, value in enumerate(command):
        flow[n] = 2.0 * fill + 0.2 * value
        fill += (1.0 - np.exp(-H / 0.05)) * (value - fill)

    def at(signal: Array, n: int) -> float:
        return float(signal[min(n, signal.size - 1)]) if n >= 0 else float(steady * signal[0])

    def straight(signal: Array, steps: float) -> float:
        whole, rest = int(steps // 1.0), steps % 1.0
        return (1.0 - rest) * at(signal, whole) + rest * at(signal, whole + 1)

    square, level = flow * flow, 0.0
    if steady:
        level = (flow[0] + square[0]) / 5.0
    out = np.empty(command.size)
    for n in range(command.size):
        late, later = n - first / H, n - second / H
        delayed = straight(flow, late)
        held = at(flow, int(late // 1.0))
        ends = [straight(square, later - 1.0), straight(square, later)]
        inner = int(later // 1.0)
        share = later - inner
        mean = share * 0.5 * (ends[1] + at(square, inner))
        mean += (1.0 - share) * 0.5 * (at(square, inner) + ends[0])
        back = max(second / H, 1.0) - 1.0
        oldest = at(square, n - int(back // 1.0) - 2)
        out[n] = level + delayed + 2.0 * held + 3.0 * mean + oldest + back % 1.0
        level += H * (delayed + mean - 5.0 * level)
    return out


COMMAND = np.concatenate([np.zeros(3), np.sin(np.arange(1, 300) / 9.0)])


@pytest.mark.parametrize(("first", "second"), [(0.123, 0.004), (0.0, 0.0), (0.055, 0.0313)])
@pytest.mark.parametrize("start", ["rest", "steady"])
@pytest.mark.interpreted
def test_they_read_what_was(first: float, second: float, start: str) -> None:
    command = COMMAND + (0.7 if start == "steady" else 0.0)
    own = machine(first, second)
    run = simulate(own, {"command": command}, RATE, start=start)
    wanted = expected(command, first, second, start)
    np.testing.assert_allclose(run["out"], wanted, rtol=1e-12, atol=1e-12)
    walker = stepper(own, ["command"], ["out"], rate=RATE, start=start)
    assert np.array_equal([walker.step(value)["out"] for value in command], run["out"])


def test_many_sets_and_derivatives_by_all_numbers() -> None:
    own, given = machine(), {"command": COMMAND}
    names = ("pipe.first", "pipe.second", "feed.gain", "feed.lag")
    found = sensitivities(own, given, RATE, outputs=["out"], parameters=names)["out"]
    values = dict(zip(parameter_paths(line), own.params.tolist(), strict=True))
    for column, name in zip(found.T, names, strict=True):
        value = values[name]
        ends = [value * (1.0 - 1e-6), value * (1.0 + 1e-6)]
        batch = simulate_many(own, {name: ends}, given, RATE, output="out")
        for output, end in zip(batch.output, ends, strict=True):
            assert np.array_equal(output, simulate(own.replace({name: end}), given, RATE)["out"])
        difference = (batch.output[1] - batch.output[0]) / (ends[1] - ends[0])
        assert np.abs(column - difference).max() < 1e-6 * np.abs(difference).max(), name


def test_a_linear_model_has_their_past_as_states() -> None:
    own = machine()
    model = linearize(own, {"command": 0.7}, RATE, outputs=["flow", "out"])
    assert set(model.memory) >= {"flow_13", "square_1"}
    u = 1e-6 * np.sin(np.arange(200) / 7.0)
    run = simulate(own, {"command": 0.7 + u}, RATE, start="steady")
    x, y = np.zeros(len(model.states)), []
    for value in u:
        y.append(model.C @ x + model.D[:, 0] * value)
        x = model.A @ x + model.B[:, 0] * value
    for k, name in enumerate(("flow", "out")):
        moved = run[name] - run[name][0]
        assert np.abs(moved - np.array(y)[:, k]).max() < 1e-4 * np.abs(moved).max()


def test_it_settles_and_starts_settled() -> None:
    own = machine()
    point = settle(own, {"command": 0.7}, RATE)
    assert point.by_equation
    flow = 2.2 * 0.7
    assert point.states[1].level == pytest.approx((flow + flow * flow) / 5.0)
    run = simulate(own, {"command": np.full(50, 0.7)}, RATE, start="steady")
    assert np.ptp(run["out"]) < 1e-12
