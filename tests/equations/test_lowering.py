"""Functions in LLVM's language give what the same text gives in Python, to the last bit."""

import math
from math import nan
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from swashplate.equations import JIT_OFF, plain, root
from swashplate.equations.code_generation import FUNCTIONS
from swashplate.equations.code_generation.loops import blank
from swashplate.equations.code_generation.lowering import definition_in, lowered
from swashplate.equations.code_generation.machine_code import code_of_function

LIBRARY = {**vars(math), **FUNCTIONS}
UNCOMPILED = {
    **vars(math),
    "choose": lambda test, one, two: one if test else two,
    "root": plain(root),
    "blank": plain(blank),
}
KINDS = ("*float", "int", "*float")

pytestmark = pytest.mark.skipif(JIT_OFF, reason="nothing is compiled")


def both(text: str, *numbers: float, count: int = 4, size: int = 4) -> list[NDArray[np.float64]]:
    """What ``function(x, count, out)`` leaves in `out`, compiled and in Python."""
    definition = lambda: definition_in(text, "function", LIBRARY)  # noqa: E731
    code = code_of_function("function", text, KINDS, definition)
    space: dict[str, Any] = dict(UNCOMPILED)
    exec(text, space)
    left = []
    for function in (code, space["function"]):
        x, out = np.array(numbers), np.zeros(size)
        function(x, count, out)
        left.append(out)
    return left


def assert_same(text: str, *numbers: float, count: int = 4) -> None:
    compiled, uncompiled = both(text, *numbers, count=count)
    assert compiled.tobytes() == uncompiled.tobytes(), (compiled, uncompiled)


EXPRESSIONS = [
    "x[0] + x[1] * x[2] - x[3] / 3.0",
    "-x[0] * -2.5",
    "-count + 3",
    "count / 8",
    "(count + 3) // 2",
    "x[0]**2 + x[1]**3 + x[2]**5",
    "x[1]**0 + count**3",
    "x[1]**-2",
    "min(x[0], x[1], 1.5) + max(x[2], 2)",
    "min(x[3], nan)",
    "abs(x[3]) + abs(-count)",
    "floor(x[0] * 10.0) + floor(-0.5)",
    "int(x[1] * 7.0) + float(count)",
    "1.0 if x[0] > x[1] else 2",
    "count if count > 3 and x[0] < 1.0 or not x[1] == 2.0 else x[2]",
    "choose((x[0] > 0.0) & (x[1] > 0.0) | (x[2] < 0.0), 4, 0) | 1",
    "(x[0] != x[0]) + (count >= 4)",
    "sqrt(abs(x[3])) + exp(x[0]) + log(x[1]) + sin(x[2]) + cos(x[3])",
    "tan(x[0]) + atan(x[1]) + tanh(x[2]) + asin(x[0]) + acos(x[0])",
    "atan2(x[0], x[1]) + atan2(x[3], count)",
    "inf - x[0]",
]


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_expressions(expression: str) -> None:
    text = f"def function(x, count, out):\n    out[1] = {expression}\n"
    assert_same(text, 0.3, 1.7, 2.9, -4.1)


BODIES = [
    """
    total = 0
    for n in range(count):
        if n == 2:
            continue
        total += x[n]
    out[0] = total
    """,
    """
    n, total = 0, 1.0
    while True:
        n += 1
        if n > count:
            break
        total *= x[n - 1]
    out[0], out[1] = total, n
    """,
    """
    for n in range(count - 1, -1, -1):
        out[n] = x[n] - n
    for n in range(1, count, 2):
        out[n] += 1.0
    """,
    """
    if x[0] > 5.0:
        value = 1
    elif x[0] > 0.0:
        value = 2.5
    else:
        value = True
    out[0] = value
    """,
    """
    \"\"\"It ends on one way.\"\"\"
    out[0] = 1.0
    if x[0] > 0.0:
        return
    out[1] = 1.0
    """,
    """
    ω = x[0]
    out[0] = ω
    """,
    """
    a, b = x[0], x[1]
    a, b = b, a
    out[0], out[1] = a, b
    room = blank(3)
    for n in range(2):
        room[n] += x[n]
        out[2] += room[n] + room[2]
    """,
]


@pytest.mark.parametrize("body", BODIES)
def test_statements(body: str) -> None:
    assert_same(f"def function(x, count, out):{body}", 0.3, 1.7, 2.9, -4.1)
    assert_same(f"def function(x, count, out):{body}", -0.3, nan, 2.9, 0.0)


CALLS = """
def halved(value):
    return 0.5 * value


def parts(value, more):
    if value > 1.0:
        return halved(value), more
    for _ in range(2):
        value = value + more
    return value, 1


def residual(t, value):
    return t * t - value


def function(x, count, out):
    for n in range(count):
        out[n], more = parts(x[n], n)
        out[n] += more
    out[3] += root(residual, 0.0, 3.0, x[1])
"""


def test_functions_are_written_out_where_they_are_called() -> None:
    assert_same(CALLS, 0.3, 1.7, 2.9, -4.1)


def test_the_hypotenuse_is_that_of_c() -> None:
    """Python's own differs in the last bit."""
    compiled, _ = both("def function(x, count, out):\n    out[0] = hypot(x[0], x[1])\n", 3.1, 4.2)
    assert compiled[0] == np.hypot(3.1, 4.2)


def test_arithmetic_is_strict() -> None:
    """No product is joined with a sum, and sums stay in their order."""
    text = "def function(x, count, out):\n    for n in range(count):\n"
    text += "        out[0] = out[0] + x[n] * x[n]\n"
    assert_same(text, 1.1, 1e8 / 3.0, 1e-9, 7.7)
    assert " fast " not in lowered(definition_in(text, "function", LIBRARY), KINDS, "code")


def test_what_is_not_known_is_refused() -> None:
    for line in ("del count", "out[0] = [1.0][0]", "with x: out[0] = 1.0"):
        text = f"def function(x, count, out):\n    {line}\n"
        with pytest.raises(TypeError, match="LLVM"):
            lowered(definition_in(text, "function", LIBRARY), KINDS, "code")
