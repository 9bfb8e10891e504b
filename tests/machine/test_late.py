"""Loops of parts that take signals a sample late, and the past at an age that changes."""

from math import sin
from typing import NamedTuple

import numpy as np
import pytest

from swashplate import InputError, join, linearize, simulate, simulate_many
from swashplate.errors import EquationError
from swashplate.machine import (
    History,
    Machine,
    Model,
    Tap,
    equation,
    late,
    past,
    root,
    sensitivities,
    stepper,
)

pytestmark = pytest.mark.interpreted

RATE = 512.0
TARGET = np.sin(np.arange(300) * 0.03)


class Law(NamedTuple):
    gain: float = 1.3
    first: float = 0.7
    memory: float = 0.1


class Count(NamedTuple):
    n: float = 0.0


class Push(NamedTuple):
    push: float


@equation
def counted(state: Count) -> Count:
    return Count(state.n + 1.0)


@equation
def looking_back(state: Count, target: float, level: float, history: History, p: Law) -> Push:
    before = past(history, 3.0 + 2.0 * sin(state.n))
    return Push(p.gain * (target - level) + 0.1 * before)


@equation
def plain(target: float, level: float, p: Law) -> Push:
    return Push(p.gain * (target - level))


@equation
def at_rest() -> Count:
    return Count(0.0)


class Tank(NamedTuple):
    inflow: float = 5.0


class Level(NamedTuple):
    height: float = 0.5


class Seen(NamedTuple):
    level: float


@equation
def seen(state: Level, push: float) -> Seen:
    return Seen(state.height + 0.1 * push)


@equation
def filled(state: Level, push: float, p: Tank, h: float) -> Level:
    return Level(state.height + p.inflow * push * h)


@equation
def settled(push: float) -> Level:
    return Level(0.3 - 0.5 * push)


class Gauge(NamedTuple):
    first: float


class Read(NamedTuple):
    seen: float


@equation
def read(level: float, p: Gauge) -> Read:
    return Read(level)


gauge = Model("gauge", Gauge, Count, counted, read, settled=at_rest)
tank = Model("tank", Tank, Level, filled, seen, settled=settled)
remembering = Model(
    "law", Law, Count, counted, looking_back, taps={"history": Tap("history", longest="memory")}
)
forgetful = Model("law", Law, Count, counted, plain, settled=at_rest)
LEVEL = late("tank.level", "first")


def closed(law: Model, **links) -> Machine:
    members = {"law": Machine(law, Law()), "tank": Machine(tank, Tank())}
    return join("loop", members, links={"tank.push": "law.push", "law.level": LEVEL, **links})


def by_hand(target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Levels and pushes, sample by sample."""
    height, levels, pushes = 0.5, [], []

    def level_at(n):
        return levels[n] if n >= 0 else 0.7

    for n, wanted in enumerate(target):
        age = 3.0 + 2.0 * np.sin(n)
        whole = int(age)
        newer, older = level_at(n - 1 - whole), level_at(n - 2 - whole)
        before = newer + (age - whole) * (older - newer)
        push = 1.3 * (wanted - level_at(n - 1)) + 0.1 * before
        levels.append(height + 0.1 * push)
        pushes.append(push)
        height += 5.0 * push / RATE
    return np.array(levels), np.array(pushes)


def test_a_loop_has_the_numbers_of_one_written_by_hand():
    run = simulate(closed(remembering, **{"law.history": LEVEL}), {"law.target": TARGET}, RATE)
    levels, pushes = by_hand(TARGET)
    np.testing.assert_array_equal(run["tank.level"], levels)
    np.testing.assert_array_equal(run["law.push"], pushes)


def test_a_past_needs_no_hold():
    taps = {"history": Tap("history", longest="memory", hold="none")}
    law = Model("law", Law, Count, counted, looking_back, taps=taps)
    run = simulate(closed(law, **{"law.history": LEVEL}), {"law.target": TARGET}, RATE)
    np.testing.assert_array_equal(run["tank.level"], by_hand(TARGET)[0])


def test_each_part_has_its_own_value_before():
    """One signal comes late to two parts, which state different values before the record."""
    members = {
        "law": Machine(forgetful, Law()),
        "gauge": Machine(gauge, Gauge(-2.0)),
        "tank": Machine(tank, Tank()),
    }
    links = {"tank.push": "law.push", "law.level": LEVEL, "gauge.level": LEVEL}
    run = simulate(join("loop", members, links=links), {"law.target": TARGET}, RATE)
    level = run["tank.level"][:-1]
    np.testing.assert_array_equal(run["gauge.seen"], [-2.0, *level])
    np.testing.assert_array_equal(run["law.push"], 1.3 * (TARGET - [0.7, *level]))


def test_a_stepper_has_the_numbers_of_the_whole_run():
    machine = closed(remembering, **{"law.history": LEVEL})
    target = np.tile(TARGET, 5)
    run = simulate(machine, {"law.target": target}, RATE)
    made = stepper(machine, ["law.target"], ["tank.level"], rate=RATE)
    stepped = [made.step(each)["tank.level"] for each in target.tolist()]
    np.testing.assert_array_equal(stepped, run["tank.level"])


def test_many_sets_at_once_have_the_numbers_of_each():
    machine = closed(remembering, **{"law.history": LEVEL})
    gains = [1.3, 0.9, 1.1, 0.2, 1.7]
    batch = simulate_many(
        machine, {"law.gain": gains}, {"law.target": TARGET}, RATE, output="tank.level"
    )
    for gain, levels in zip(gains, batch.output, strict=True):
        alone = simulate(machine.replace({"law.gain": gain}), {"law.target": TARGET}, RATE)
        np.testing.assert_array_equal(levels, alone["tank.level"])


def test_derivatives_go_round_the_loop():
    machine, inputs = closed(forgetful), {"law.target": TARGET}
    exact = sensitivities(machine, inputs, RATE, parameters=["law.gain", "tank.inflow"])
    for k, name in enumerate(("law.gain", "tank.inflow")):
        value, step = machine.numbers[name], 1e-6
        up, down = (
            simulate(machine.replace({name: value + sign * step}), inputs, RATE)["tank.level"]
            for sign in (1.0, -1.0)
        )
        np.testing.assert_allclose(
            exact["tank.level"][:, k], (up - down) / (2.0 * step), atol=1e-8, rtol=1e-6
        )


def test_a_loop_settles_where_nothing_changes_any_more():
    machine = closed(forgetful)
    run = simulate(machine, {"law.target": np.ones(2)}, RATE, start="steady")
    # height 0.3 - push/2, level = height + push/10 and push = 1.3 (1 - level) together
    push = 1.3 * 0.7 / (1.0 - 1.3 * 0.4)
    assert run["law.push"][0] == pytest.approx(push, rel=1e-12)


def test_a_linear_model_keeps_what_comes_late():
    model = linearize(
        closed(forgetful), {"law.target": 0.0}, RATE, inputs=["law.target"], outputs=["tank.level"]
    )
    assert model.states == ("law.n", "tank.height", "tank.level_1")
    # level' = height + 0.1 push with push = 1.3 (target - level)
    np.testing.assert_allclose(model.A[2], [0.0, 1.0, -0.13])
    # height' = height - 6.5 h level: what the loop remembers is no delay that may be left out
    looped = np.roots([1.0, -0.87, 6.5 / RATE - 0.13])
    np.testing.assert_allclose(model.poles, [1.0, looped.max(), looped.min()], rtol=1e-9)
    assert model.groups_of(("law", "tank")) == [("law",), ("tank",)]


def test_what_has_no_derivatives_says_so():
    machine = closed(remembering, **{"law.history": LEVEL})
    with pytest.raises(InputError, match="age that changes, .* no derivatives: .* not fitted"):
        sensitivities(machine, {"law.target": TARGET}, RATE, parameters=["law.gain"])["law.push"]
    with pytest.raises(InputError, match=r"law\.first is what a signal was before the record"):
        sensitivities(closed(forgetful), {"law.target": TARGET}, RATE)["law.push"]


def test_a_memory_is_a_parameter():
    with pytest.raises(InputError, match="longest delay of 'history' is 'long', .* gain, first"):
        Model(
            "law",
            Law,
            Count,
            counted,
            looking_back,
            taps={"history": Tap("history", longest="long")},
        )


@equation
def misses(x: float, history: History) -> float:
    return x - past(history, 3.0)


@equation
def searched(history: History) -> Push:
    return Push(root(misses, -9.0, 9.0, history))


def test_a_loop_within_an_equation_has_no_past():
    taps = {"history": Tap("history", longest="memory")}
    law = Model("law", Law, Count, counted, searched, taps=taps)
    with pytest.raises(EquationError, match="past in misses, .* read the past before"):
        simulate(Machine(law, Law()), {"history": TARGET}, RATE)


@equation
def confused(target: float, p: Law) -> Push:
    return Push(past(target, p.gain))


def test_only_an_input_with_a_past_has_one():
    law = Model("law", Law, Count, counted, confused)
    with pytest.raises(EquationError, match="past of something else .* type the input History"):
        simulate(Machine(law, Law()), {"target": TARGET}, RATE)
