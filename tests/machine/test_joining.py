"""Models joined: named members, wires and links by path, models of models."""

from typing import NamedTuple

import numpy as np
import pytest

from swashplate import InputError
from swashplate.errors import UnknownNameError
from swashplate.machine import (
    Machine,
    Model,
    Tap,
    equation,
    join,
    replaced,
    sensitivities,
    simulate,
    stepper,
)
from swashplate.machine.linear import linearize
from swashplate.machine.model import parameter_paths, state_paths

RATE = 100.0
TIME = np.arange(200) / RATE


class Lag(NamedTuple):
    time: float
    gain: float = 1.0
    delay: float = 0.0


class Level(NamedTuple):
    level: float = 0.0


class Flow(NamedTuple):
    flow: float


class Full(NamedTuple):
    full: bool


@equation
def share(h: float, time: float) -> float:
    return h / (time + h)


@equation
def flowing(state: Level, p: Lag) -> Flow:
    return Flow(p.gain * state.level)


@equation
def following(state: Level, command: float, p: Lag, h: float) -> Level:
    return Level(state.level + share(h, p.time) * (command - state.level))


@equation
def is_full(state: Level) -> Full:
    return Full(state.level > 0.5)


tank = Model(
    "tank",
    Lag,
    Level,
    following,
    flowing,
    taps={"command": Tap("command", "delay")},
    limits=is_full,
    integrals={"stored": "flow"},
    outputs=("flow",),
)


class Ratio(NamedTuple):
    ratio: float = 0.25


class Sum(NamedTuple):
    total: float = 0.0


class Load(NamedTuple):
    load: float


@equation
def loaded(supply: float, p: Ratio) -> Load:
    return Load(p.ratio * supply)


@equation
def summed(state: Sum, signals: Load, h: float) -> Sum:
    return Sum(state.total + h * signals.load)


@equation
def difference(first: float, second: float) -> float:
    return first - second


sink = Model("sink", Ratio, Sum, summed, loaded)
two = join(
    "two",
    {"left": tank, "right": tank, "sink": sink},
    links={"sink.supply": (difference, "left.flow", "right.flow")},
    integrals={"volume": "left.flow"},
)
P = two.parameters(left=Lag(0.3, 2.0, 0.013), right=Lag(0.1), sink=Ratio())
INPUTS = {"left.command": np.sin(3.0 * TIME), "right.command": np.cos(5.0 * TIME)}


def test_members_are_what_they_are_alone() -> None:
    run = simulate(Machine(two, P), INPUTS, RATE)
    alone = {
        side: simulate(
            Machine(tank, getattr(P, side)), {"command": INPUTS[f"{side}.command"]}, RATE
        )
        for side in ("left", "right")
    }
    for side, member in alone.items():
        for name in ("level", "flow"):
            assert np.array_equal(run[f"{side}.{name}"], member[name])
        assert np.array_equal(run.active(f"{side}.full"), member.active("full"))
    supply = alone["left"]["flow"] - alone["right"]["flow"]
    assert np.array_equal(run["sink.load"], 0.25 * supply)
    assert np.array_equal(run["sink.supply"], supply)
    mean = 0.5 * (alone["left"]["flow"][1:] + alone["left"]["flow"][:-1]) / RATE
    assert run["volume"][1:] == pytest.approx(np.cumsum(mean), rel=1e-12)
    assert np.array_equal(run["volume"], run["left.stored"])
    assert two.outputs == ("left.flow", "right.flow")


def test_names_are_paths_whose_last_words_do_if_they_are_unique() -> None:
    assert two.external == ("left.command", "right.command")
    assert parameter_paths(two)[:2] == ("left.time", "left.gain")
    assert state_paths(two) == ("left.level", "right.level", "sink.total")
    run = simulate(Machine(two, P), INPUTS, RATE)
    assert np.array_equal(run["total"], run["sink.total"])
    with pytest.raises(UnknownNameError, match=r"several signals 'flow': left\.flow, right\.flow"):
        run["flow"]
    slopes = sensitivities(Machine(two, P), INPUTS, RATE, parameters=["ratio", "left.gain"])
    assert slopes.names == ("sink.ratio", "left.gain")
    assert slopes["load"][:, 0] == pytest.approx(4.0 * run["load"], rel=1e-12, abs=1e-12)
    with pytest.raises(InputError, match="no parameter 'gain'"):
        sensitivities(Machine(two, P), INPUTS, RATE, parameters=["gain"])
    one = join("one", {"tank": tank})
    numbers = one.parameters(tank=Lag(0.3))
    assert (
        simulate(Machine(one, numbers), {"command": INPUTS["left.command"]}, RATE)["level"].size
        == 200
    )


def test_a_stepper_and_a_linear_model_are_of_the_whole() -> None:
    run = simulate(Machine(two, P), INPUTS, RATE)
    single = stepper(Machine(two, P), [*INPUTS], ["left.flow", "total", "left.full"], rate=RATE)
    for n in range(60):
        sample = single.step(*(float(record[n]) for record in INPUTS.values()))
        assert sample["left.flow"] == run["left.flow"][n]
        assert sample["total"] == run["total"][n]
    at = dict.fromkeys(two.external, 0.0)
    rest = [Level(), Level(), Sum()]
    whole = linearize(Machine(two, P), at, RATE, states=rest, outputs=["sink.load"])
    poles = np.sort(np.linalg.eigvals(whole.A).real)
    # of each lag, and of the sum; the samples that a delay keeps are at zero
    expected = [1.0 - share(1.0 / RATE, 0.1), 1.0 - share(1.0 / RATE, 0.3), 1.0]
    assert poles[-3:] == pytest.approx(expected, rel=1e-9)


def test_an_input_may_take_what_another_one_takes() -> None:
    pair = join("pair", {"left": tank, "right": tank}, links={"right.command": "left.command"})
    assert pair.external == ("left.command",)
    left, right = P.left, P.right._replace(delay=0.0)
    numbers = pair.parameters(left=left, right=right)
    command = np.sin(TIME)
    run = simulate(Machine(pair, numbers), {"left.command": command}, RATE)
    for side, own in (("left", left), ("right", right)):
        alone = simulate(Machine(tank, own), {"command": command}, RATE)
        assert np.array_equal(run[f"{side}.level"], alone["level"])
    assert np.ptp(run["left.level"]) > 0.1


def test_members_may_be_joined_models() -> None:
    fleet = join(
        "fleet",
        {"first": two, "second": two, "sink": sink},
        links={"sink.supply": "first.sink.load"},
    )
    assert "first.left.gain" in parameter_paths(fleet)
    assert fleet.parameters._fields == ("first", "second", "sink")
    inputs = {f"{name}.{at}": each for name in ("first", "second") for at, each in INPUTS.items()}
    found = simulate(Machine(fleet, fleet.parameters(P, P, Ratio(0.5))), inputs, RATE)
    alone = simulate(Machine(two, P), INPUTS, RATE)
    for name in ("left.flow", "sink.load", "sink.supply"):
        assert np.array_equal(found[f"first.{name}"], alone[name])
        assert np.array_equal(found[f"second.{name}"], alone[name])
    assert np.array_equal(found["first.volume"], alone["volume"])
    assert np.array_equal(found["sink.load"], 0.5 * alone["sink.load"])


def test_machines_joined_are_a_machine_with_their_numbers() -> None:
    left, right = Machine(tank, Lag(0.3, 2.0, 0.013)), Machine(tank, Lag(0.1))
    tanks = {"left": left, "right": right, "sink": Machine(sink, Ratio())}
    links = {"sink.supply": (difference, "left.flow", "right.flow")}
    joined = join("two", tanks, links=links)
    found = simulate(joined, INPUTS, RATE)
    assert np.array_equal(found["total"], simulate(Machine(two, P), INPUTS, RATE)["total"])
    again = join("pair", {"first": joined, "second": joined})
    assert again.params.tolist() == 2 * joined.params.tolist()
    with pytest.raises(InputError, match="left is Machine.* is no model"):
        join("two", {**tanks, "right": tank}, links=links)


@equation
def slower(h: float, time: float) -> float:
    return h / (2.0 * time + h)


@equation
def sum_of(first: float, second: float) -> float:
    return first + second


def test_an_equation_is_replaced_in_all_members() -> None:
    slow = replaced(two, share, slower)
    twice = P._replace(left=P.left._replace(time=0.6), right=P.right._replace(time=0.2))
    found = simulate(Machine(slow, P), INPUTS, RATE)
    assert np.array_equal(found["total"], simulate(Machine(two, twice), INPUTS, RATE)["total"])
    assert slow.integrals == two.integrals
    assert found.to_pandas()["right.stored"].size == TIME.size
    added = simulate(Machine(replaced(two, difference, sum_of), P), INPUTS, RATE)
    assert np.array_equal(added["supply"], added["left.flow"] + added["right.flow"])


@pytest.mark.parametrize(
    ("members", "links", "said"),
    [
        ({"a": tank, "b": tank}, {"b.order": "a.flow"}, r"no input 'b.order'; there are a.com"),
        ({"a": tank, "b": tank}, {"b.command": "a.flov"}, r"no signal 'a.flov'; there are a.flow"),
        ({"a": tank, "b": tank}, {"a.command": "flow"}, r"no signal 'flow'; there are a.flow, b.f"),
        ({"a": tank, "b": tank}, {"a.command": "b.flow"}, r"known only after b: put b before a"),
        ({"a": tank}, {"x": (difference, "a.flow")}, r"takes first, second, but the link x names"),
        ({"a b": tank}, {}, r"a member's name is one word, not 'a b'"),
        ({"a": 3.0}, {}, r"one mapping of names to models or to machines, and a is 3.0"),
    ],
)
def test_what_cannot_be_joined_is_said(members, links, said: str) -> None:
    with pytest.raises(InputError, match=said):
        join("both", members, links=links)
