"""Equations that stand for others in a model, in whatever runs the model's equations."""

import pickle
import sys
from typing import NamedTuple

import numpy as np
import pytest

from swashplate import InputError
from swashplate.machine import (
    Machine,
    Model,
    declared,
    equation,
    join,
    repeated,
    replaced,
    root,
    sensitivities,
    simulate,
    stepper,
)
from swashplate.machine.linear import linearize

pytestmark = pytest.mark.interpreted

this = sys.modules[__name__]
"""For an equation that calls another by its module."""


class Gain(NamedTuple):
    gain: float


class Level(NamedTuple):
    level: float


class Read(NamedTuple):
    reading: float


@equation
def twice(x: float) -> float:
    return 2.0 * x


@equation
def one_more(x: float) -> float:
    return twice(x) + 1.0


@equation
def following(state: Level, command: float, p: Gain) -> Level:
    return Level(p.gain * one_more(command))


@equation
def first_level(p: Gain) -> Level:
    return Level(this.twice(p.gain))


@equation
def read(state: Level) -> Read:
    return Read(twice(state.level))


tank = Model("tank", Gain, Level, following, sample=read, rest=first_level, settled=first_level)
COMMAND = np.array([0.0, 1.0, 2.0, 3.0])


def level_of(model: Model, gain: float = 1.0) -> np.ndarray:
    return simulate(Machine(model, Gain(gain)), {"command": COMMAND}, 1.0)["level"]


@equation
def ten_times(x: float) -> float:
    return 10.0 * twice(x)


@equation
def shifted(x: float) -> float:
    return twice(x) + 4.0


@equation
def three_times(x: float) -> float:
    return 3.0 * twice(x)


@equation
def around(x: float) -> float:
    return one_more(x) + 5.0


def test_a_replacement_may_call_the_original() -> None:
    model = replaced(tank, twice, ten_times)
    run = simulate(Machine(model, Gain(0.5)), {"command": COMMAND}, 1.0)
    assert run["level"].tolist() == [10.0, *(0.5 * (20.0 * COMMAND[:3] + 1.0))]
    assert run["reading"].tolist() == [20.0 * level for level in run["level"]]
    step_by_step = stepper(Machine(model, Gain(0.5)), ["command"], rate=1.0)
    assert [step_by_step.step(each)["level"] for each in COMMAND] == run["level"].tolist()
    assert level_of(tank)[0] == 2.0


@pytest.mark.parametrize("first", [0, 1])
def test_a_replacement_may_call_what_another_one_replaces(first: int) -> None:
    model = tank
    pairs = [(twice, ten_times), (one_more, three_times)]
    for old, new in (pairs[first], pairs[1 - first]):
        model = replaced(model, old, new)
    assert level_of(model).tolist() == [20.0, *(3.0 * 20.0 * COMMAND[:3])]


def test_models_of_the_same_equations_differ_by_what_these_stand_for() -> None:
    one = replaced(replaced(tank, twice, ten_times), one_more, shifted)
    other = replaced(replaced(tank, one_more, ten_times), twice, shifted)
    assert level_of(one).tolist() == [20.0, *(20.0 * COMMAND[:3] + 4.0)]
    assert level_of(other).tolist() == [6.0, *(20.0 * COMMAND[:3] + 40.0)]


def test_a_replacement_may_call_what_calls_the_original() -> None:
    # one_more calls around, in which one_more calls twice as it is
    model = replaced(tank, twice, around)
    assert level_of(model).tolist() == [2.0 + 6.0, *(2.0 * COMMAND[:3] + 7.0)]


def test_an_equation_is_replaced_again() -> None:
    again = replaced(replaced(tank, twice, ten_times), twice, shifted)
    assert level_of(again).tolist() == [60.0, *(10.0 * (2.0 * COMMAND[:3] + 4.0) + 1.0)]
    other = replaced(replaced(tank, twice, ten_times), ten_times, three_times)
    assert level_of(other).tolist() == [6.0, *(6.0 * COMMAND[:3] + 1.0)]
    with pytest.raises(InputError, match="one_more"):
        replaced(replaced(tank, one_more, shifted), one_more, around)


@equation
def emptied(state: Level, command: float, p: Gain) -> Level:
    return Level(-following(state, command, p).level)


@equation
def filled(state: Level, command: float, p: Gain) -> Level:
    return Level(3.0 * following(state, command, p).level)


def test_an_equation_of_the_model_itself_is_replaced() -> None:
    model = replaced(tank, following, emptied)
    changed = replaced(model, twice, ten_times)
    assert level_of(changed).tolist() == [20.0, *(-20.0 * COMMAND[:3] - 1.0)]
    other = replaced(model, emptied, filled)
    assert level_of(other).tolist() == [2.0, *(3.0 * (2.0 * COMMAND[:3] + 1.0))]


@equation
def away(x: float, target: float) -> float:
    return twice(x) - target


@equation
def further(x: float, target: float) -> float:
    return away(x, target) + twice(1.0)


@equation
def halved(target: float) -> float:
    return root(away, -100.0, 100.0, target)


@equation
def moved(level: float, number: float, by: float) -> float:
    return level + twice(by)


@equation
def moved_back(level: float, number: float, by: float) -> float:
    return moved(level, number, -by)


@equation
def counting(state: Level, command: float, p: Gain) -> Level:
    return Level(repeated(moved, 3.0, halved(command), p.gain))


@equation
def root_first(p: Gain) -> Level:
    return Level(halved(p.gain))


def test_equations_of_roots_and_loops_are_replaced() -> None:
    model = Model("tank", Gain, Level, counting, rest=root_first)
    plain = [0.5, *(0.5 * COMMAND[:3] + 6.0)]
    np.testing.assert_allclose(level_of(model), plain, rtol=1e-12)
    for old, new, expected in (
        (away, further, [-0.5, *(0.5 * COMMAND[:3] - 1.0 + 6.0)]),
        (moved, moved_back, [0.5, *(0.5 * COMMAND[:3] - 6.0)]),
        (twice, ten_times, [0.05, *(0.05 * COMMAND[:3] + 60.0)]),
    ):
        changed = replaced(model, old, new)
        np.testing.assert_allclose(level_of(changed), expected, rtol=1e-12)
        by = sensitivities(Machine(changed, Gain(1.0)), {"command": COMMAND}, 1.0)["level"]
        difference = (level_of(changed, 1.001) - level_of(changed, 0.999)) / 0.002
        np.testing.assert_allclose(by[:, 0], difference, rtol=1e-8, atol=1e-8)


@equation
def squared(x: float) -> float:
    return twice(x) * twice(x)


@declared(squared)
def _squared(x: float) -> tuple[float]:
    return (8.0 * x,)


@equation
def squared_level(state: Level, command: float, p: Gain) -> Level:
    return Level(squared(p.gain * command))


def test_derivatives_that_are_declared_of_the_original_do_not_count() -> None:
    model = replaced(Model("tank", Gain, Level, squared_level), twice, ten_times)
    by = sensitivities(Machine(model, Gain(0.5)), {"command": COMMAND}, 1.0)["level"]
    np.testing.assert_allclose(by[1:, 0], 2.0 * 400.0 * 0.5 * COMMAND[:3] ** 2, rtol=1e-12)


def started_by(inner):  # type: ignore[no-untyped-def]
    """An equation that knows another by the function around it."""

    @equation
    def first(p: Gain) -> Level:
        return Level(inner(p.gain))

    return first


def test_equations_of_functions_are_replaced() -> None:
    model = Model("tank", Gain, Level, following, rest=started_by(twice))
    assert (
        level_of(replaced(model, twice, ten_times)).tolist()
        == level_of(replaced(tank, twice, ten_times)).tolist()
    )


@equation
def tripled(level: float) -> float:
    return doubled(level) + level


class Nothing(NamedTuple):
    pass


class Depth(NamedTuple):
    depth: float = 0.0


@equation
def doubled(level: float) -> float:
    return twice(level)


@equation
def kept_depth(state: Depth, deep: float) -> Depth:
    return Depth(deep)


pond = Model("pond", Nothing, Depth, kept_depth)


def test_the_equation_of_a_link_is_replaced() -> None:
    both = join("both", tank, pond, links={"deep": doubled})
    numbers = both.parameters(Gain(1.0), Nothing())
    inputs = {"command": COMMAND}
    for model, factor in (
        (replaced(both, twice, ten_times), 20.0),
        (replaced(both, doubled, tripled), 3.0),
    ):
        run = simulate(Machine(model, numbers), inputs, 1.0)
        assert run["deep"].tolist() == [factor * each for each in run["level"]]
        assert run["depth"][1:].tolist() == run["deep"][:-1].tolist()
    with pytest.raises(InputError, match="doubled .* link"):
        replaced(both, doubled, tripled, Gain)


MODEL = replaced(replaced(tank, twice, ten_times), one_more, three_times)


@pytest.mark.slow
def test_another_process_makes_the_model_again() -> None:
    again = pickle.loads(pickle.dumps(MODEL))
    assert level_of(again).tolist() == level_of(MODEL).tolist()
    part = replaced(join("one", tank, pond, links={"deep": doubled}), twice, ten_times).parts[0]
    assert level_of(pickle.loads(pickle.dumps(part))).tolist() == level_of(part).tolist()


def test_its_linear_model_is_that_of_the_replacements() -> None:
    instance = Machine(replaced(tank, twice, ten_times), Gain(0.5))
    made = linearize(instance, {"command": 1.0}, 1.0, outputs=["level"])
    assert made.B[0, 0] == pytest.approx(10.0)
