"""User-defined models with any names, and numbers of every kind, against loops of plain Python."""

import linecache
import math
import os
from itertools import count
from typing import Any, NamedTuple

import numpy as np
import pytest
from tests.marks import rest_slow

from swashplate.errors import EquationError
from swashplate.machine import (
    Machine,
    Model,
    derive,
    equation,
    interpolate,
    sensitivities,
    simulate,
    stepper,
)

RATE, SIZE = 100.0, 40
FIRST = 2.0 * np.sin(0.7 * np.arange(SIZE))
SECOND = 1.5 * np.cos(1.1 * np.arange(SIZE) + 0.3)
FILES = count()


class Gain(NamedTuple):
    gain: float


class Level(NamedTuple):
    level: float = 0.25


def defined(text: str, **names: Any) -> Any:
    """The function `f` of a text, as if it stood in a file."""
    file = f"/somewhere/equations_{next(FILES)}.py"
    linecache.cache[file] = (len(text), None, text.splitlines(True), file)
    space = {
        **{name: getattr(math, name) for name in ("floor", "sqrt")},
        **{"equation": equation, "interpolate": interpolate, "Gain": Gain, "Level": Level},
        **names,
    }
    exec(compile(text, file, "exec"), space)
    return space["f"]


def step_of(body: str, first: str = "u", second: str = "v", **names: Any) -> Any:
    """A step whose body sets `x`, which is added to the level."""
    lines = "\n".join(f"    {line}" for line in body.splitlines())
    head = f"def f(state: Level, {first}: float, {second}: float, p: Gain, h: float) -> Level:"
    return defined(
        f"@equation\n{head}\n{lines}\n    return Level(0.5 * state.level + x)\n", **names
    )


# Names that the march, lanes and C use themselves, and some that look like them.
NAMES = (
    *("flat", "states", "params", "n", "m", "c", "first", "last", "count", "records"),
    *("before", "delay_samples", "delay_fraction", "worst_margin", "constants", "inputs_", "lane"),
    *("context", "outputs", "lines", "total", "everything", "table", "size", "width", "tangent"),
    *("sqrt", "inf", "nan", "choose", "kernel", "np", "x_u", "u_before", "late_u"),
)


@pytest.mark.parametrize("name", rest_slow(NAMES, 4))
def test_an_input_may_have_any_name(name: str) -> None:
    step = step_of(f"x = p.gain * {name} - v", first=name)
    model = Model("named", parameters=Gain, state=Level, step=step, outputs=("level",))
    found = simulate(Machine(model, Gain(0.7)), {name: FIRST, "v": SECOND}, RATE)["level"]
    level, expected = 0.25, []
    for first, second in zip(FIRST.tolist(), SECOND.tolist(), strict=True):
        expected.append(level)
        level = 0.5 * level + (0.7 * first - second)
    assert found.tolist() == expected
    single = stepper(Machine(model, Gain(0.7)), [name, "v"], rate=RATE)
    for first, second, right in zip(FIRST, SECOND, expected, strict=True):
        assert single.step(float(first), float(second))["level"] == right
    slope = sensitivities(Machine(model, Gain(0.7)), {name: FIRST, "v": SECOND}, RATE)["level"][
        :, 0
    ]
    rising = 0.0
    for first, right in zip(FIRST.tolist(), slope.tolist(), strict=True):
        assert right == pytest.approx(rising, rel=1e-14, abs=1e-14)
        rising = 0.5 * rising + first


def test_a_variable_may_be_called_what_the_march_calls_an_input() -> None:
    step = step_of("x_u = 3.0 * u\nx = x_u + u\nx_v = x + v\nx = x_v - x_u")
    model = Model("named", parameters=Gain, state=Level, step=step, outputs=("level",))
    found = simulate(Machine(model, Gain(0.0)), {"u": FIRST, "v": SECOND}, RATE)["level"]
    level = 0.25
    for n in range(SIZE):
        assert found[n] == pytest.approx(level, rel=1e-14, abs=1e-14)
        level = 0.5 * level + (FIRST[n] + SECOND[n])


@equation
def helper(function: float, text: float) -> float:
    return 2.0 * function + text


# What an equation says, and the same in plain Python.
KINDS = {
    "max of two tests": ("x = max(u > 0.0, v > 0.0) + 1.0", lambda u, v: max(u > 0, v > 0) + 1.0),
    "min of two tests": ("x = min(u > 0.0, v > 0.0) + 1.0", lambda u, v: min(u > 0, v > 0) + 1.0),
    "order of two tests": (
        "x = 2.0 if (u > 0.0) < (v > 0.0) else 1.0",
        lambda u, v: 2.0 if (u > 0) < (v > 0) else 1.0,
    ),
    "a number as a test": ("x = 2.0 if u else 1.0", lambda u, v: 2.0 if u else 1.0),
    "a test of a number": ("x = 1.0 * (True if u else False)", lambda u, v: float(bool(u))),
    "not of a number": ("x = 2.0 if not u else 1.0", lambda u, v: 2.0 if not u else 1.0),
    "whole numbers to negative powers": (
        "x = 0.0\nfor i in range(1, 4):\n    x = x + u * i**-1",
        lambda u, v: 0.0 + u * 1**-1 + u * 2**-1 + u * 3**-1,
    ),
    "names that calls have": (
        "self = u\ntext = helper(function=self, text=v)\narguments = named = text\n"
        "x = named + arguments if self > 0.0 else helper(text, self)",
        lambda u, v: 2.0 * (2.0 * u + v) if u > 0 else 2.0 * (2.0 * u + v) + u,
    ),
    "keywords of C and names of math": (
        "double = u\nint_ = v\nregister = double - int_\nexp = sin = register * 0.5\n"
        "return_ = max(exp, sin)\n__init__ = return_\nx = __init__ + double",
        lambda u, v: (u - v) * 0.5 + u,
    ),
    "names of Python's own": (
        "len = u\nrange_ = (v, u)\nmin_ = range_[0]\nprint = min_ * len\nx = print",
        lambda u, v: v * u,
    ),
    "a value that a loop sets": (
        "total = 0.0\nfor weight, each in zip((2.0, 3.0), (u, v)):\n"
        "    if each < 0.0:\n        last = -each\n        continue\n    last = each\n"
        "    total = total + weight * each\nx = total + last",
        lambda u, v: (2.0 * u if u >= 0 else 0.0) + (3.0 * v if v >= 0 else 0.0) + abs(v),
    ),
    "a literal beyond 64 bits": (
        "x = u * 1000000000000000000000 * 1e-21",
        lambda u, v: u * 1000000000000000000000 * 1e-21,
    ),
}


@pytest.mark.parametrize(("body", "right"), rest_slow([*KINDS.values()], 6), ids=KINDS)
def test_numbers_of_every_kind(body: str, right: Any) -> None:
    step = step_of(body, helper=helper)
    model = Model("kinds", parameters=Gain, state=Level, step=step, outputs=("level",))
    first = np.where(np.arange(SIZE) % 3 == 0, 0.0, FIRST)
    found = simulate(Machine(model, Gain(0.0)), {"u": first, "v": SECOND}, RATE)["level"]
    single = stepper(Machine(model, Gain(0.0)), ["u", "v"], rate=RATE)
    level = 0.25
    for n in range(SIZE):
        assert found[n] == level
        assert single.step(float(first[n]), float(SECOND[n]))["level"] == level
        level = 0.5 * level + right(float(first[n]), float(SECOND[n]))


@pytest.mark.parametrize("word", ["and", "or"])
def test_and_and_or_of_numbers_are_refused(word: str) -> None:
    """In Python they are one of the two numbers, which nobody means."""
    with pytest.raises(EquationError, match=rf"{word} of the number u .*u != 0\.0"):
        derive(step_of(f"x = u {word} v"), "state")


def test_returns_that_would_take_exponential_time_are_refused() -> None:
    ways = "\n".join(
        f"if u > {number}.0:\n    if v > {number}.0:\n        return Level(u)\nx = v + {number}.0"
        for number in range(10)
    )
    with pytest.raises(EquationError, match="ways to a return .*set a variable"):
        derive(step_of(ways), "state")


class Pair(NamedTuple):
    one: float = 0.5
    two: float = 1.0


class Nested(NamedTuple):
    pair: Pair = Pair(two=3.0)
    level: float = 2.0


@equation
def nested_step(state: Nested, u: float, p: Gain) -> Nested:
    pair = Pair(state.pair.one + p.gain * u, state.pair.two)
    return Nested(pair, 0.5 * state.level + state.pair.two)


def test_a_nested_state_begins_at_its_defaults() -> None:
    model = Model("nested", parameters=Gain, state=Nested, step=nested_step)
    slopes = sensitivities(Machine(model, Gain(0.3)), {"u": np.ones(4)}, RATE)
    run = simulate(Machine(model, Gain(0.3)), {"u": np.ones(4)}, RATE)
    assert run["pair.one"] == pytest.approx([0.5, 0.8, 1.1, 1.4])
    assert run["pair.two"].tolist() == [3.0] * 4
    assert run["level"].tolist() == [2.0, 4.0, 5.0, 5.5]
    assert slopes["pair.one"][:, 0] == pytest.approx([0.0, 1.0, 2.0, 3.0])


REFUSED = {
    "x = WORDS(u)": "list",
    "x = TABLE(u)": "ndarray",
    "x = 1.0\nfor i in range(0, 5, 0):\n    x = x + u": "must not be zero",
    "x = 1.0\nfor i in range():\n    x = x + u": "at least 1 argument",
    "x = os.path.join(u)": r"make os.path.join an @equation",
    "x = u * SINGLE": "make it a float or an int of Python",
    "x = NUMBER(u)": "NUMBER, which is of type float",
}


@pytest.mark.parametrize(("body", "said"), REFUSED.items())
def test_what_is_refused_is_said_in_a_sentence(body: str, said: str) -> None:
    names = {
        "TABLE": np.ones(2),
        "SINGLE": np.float32(2.0),
        "NUMBER": 2.0,
        "WORDS": [1.0],
        "os": os,
    }
    with pytest.raises(EquationError, match=said):
        derive(step_of(body, **names), "state")
