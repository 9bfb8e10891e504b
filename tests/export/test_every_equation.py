"""Every equation in C against its compiled twin, bit for bit, on numbers of all kinds.

Equations are found by looking, so that a new one is compared or fails by its name; those of the
constructs' test show every construct that an equation may use.
"""

import ctypes
from functools import cache
from math import floor
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from tests.export.twins import InC, flagged
from tests.machine import test_constructs
from tests.machine.test_all_equations import EQUATIONS, equations_of

from swashplate.errors import EquationError
from swashplate.export.c_source import equation_in_c
from swashplate.machine import equation, repeated, root
from swashplate.machine.code_generation import Loops, helpers_in

REFUSED = ("rubbing", "rubbed")
"""Constructs of which there are none in C: an option that is a tuple of numbers, or None."""
CONSTRUCTS = equations_of(vars(test_constructs))


# --- what is read otherwise in C ------------------------------------------------------------------


class Register(NamedTuple):
    double: float
    short: float = 2.0


@equation
def promoted(x: float) -> float:
    total = 0
    for i in range(4):
        total = total + i * x
    return total / 3


@equation
def swapped(x: float, y: float) -> tuple[float, float]:
    a, b = x, y
    for _ in range(3):
        a, b = b, a + b
    return a, b


@equation
def keywords(double: float, register: Register, ω: float) -> Register:
    exp = double - -ω
    index, time = register.short, -(-register.double)  # noqa: B002
    return Register(short=exp * index, double=(1.0 + exp * exp) ** -3 - time**0)


@equation
def larger(one: Register, two: Register) -> float:
    return one.double if not one.short <= two.short else two.double


@equation
def ways(x: float, y: float, p: Register) -> float:
    if x < y < p.double or x != x:
        found = -0.0
    elif larger(keywords(x, p, y), p) > 0.0 and (x > 0.0) != (y > 0.0):
        found = 1.0 if x > 0.0 else (2.0 if y > 1.0 else -x)
    else:
        p_next = keywords(y, p, x)
        found = larger(p_next if x > y else p, p)
    return min(found, x, y) - max(y, 0, x)


@equation
def turned(p: Register, x: float) -> Register:
    for i in range(2):
        p = Register(p.short + i, p.double * x)
    values = (x, p.double, p.short)
    total = values[-1]
    for i in range(3):
        total += values[i]
    return Register(total, values[0])


@equation
def counted(state: float, number: float, steps: float) -> float:
    return state + steps * number


@equation
def beyond(x: float, steps: float, on: bool | None) -> float:
    return x * x * x - steps if on is None else x - steps


@equation
def looped(x: float, on: bool | None) -> float:
    """Whole numbers among what loops begin with and are given, and an option."""
    steps = floor(min(max(x, -1e6), 1e6))
    return repeated(counted, 3.0, 0, steps) + root(beyond, -200, 200.0, steps, on)


SETS = {
    "packaged": EQUATIONS,
    "constructs": {name: each for name, each in CONSTRUCTS.items() if name not in REFUSED},
    "own": equations_of(globals()),
}
CASES = [
    pytest.param(
        word,
        key,
        on,
        id=f"{key}-{'on' if on else 'off'}",
        # a compiled twin of each: the model's C as a whole is compared by the quick tests
        marks=[pytest.mark.slow] if word == "packaged" else [],
    )
    for word, equations in SETS.items()
    for key, each in equations.items()
    for on in ((False, True) if flagged(each) else (False,))
]


@cache
def translated(word: str) -> InC:
    """One of the sets as C."""
    return InC(SETS[word])


@pytest.fixture(scope="session")
def libraries(compiled: Any) -> dict[str, ctypes.CDLL]:
    """A library of each set."""
    return {word: ctypes.CDLL(str(compiled({"all.c": translated(word).text}))) for word in SETS}


@pytest.mark.parametrize(("word", "key", "on"), CASES)
def test_an_equation_in_c_has_the_bits_of_the_compiled_one(
    word: str, key: str, on: bool, libraries: dict[str, ctypes.CDLL]
) -> None:
    translated(word).compare(libraries[word], key, on)


@pytest.mark.parametrize("name", REFUSED)
def test_what_has_no_counterpart_in_c_is_refused_by_name(name: str) -> None:
    with pytest.raises(EquationError, match=r"constructs.py, line \d+: rub.* p\.friction .*None"):
        equation_in_c(CONSTRUCTS[name], Loops())


def test_four_functions_read_as_they_were_reviewed() -> None:
    """And what they call: golden.c is reviewed when it changes."""
    functions = Loops()
    texts = [
        equation_in_c(EQUATIONS[name], functions).text
        for name in (
            "amplifier.limited_current",
            "displacement_control.pressure_limits",
            "displacement_control.solenoid_force",
            "pump.settled_pressure",
        )
    ]
    body = "\n\n".join([*functions.texts, *texts])
    made = "\n".join([*helpers_in(body), body])
    assert f"{made}\n" == (Path(__file__).parent / "golden.c").read_text("utf-8")
