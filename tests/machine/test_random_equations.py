"""Equations made at random: value and derivatives against Richardson-extrapolated differences."""

import linecache
from functools import cache
from typing import Any, NamedTuple

import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from tests.machine.differences import compared
from tests.machine.printed import assert_printed

from swashplate.machine import derive, equation

pytestmark = [pytest.mark.interpreted, pytest.mark.slow]


class Gains(NamedTuple):
    k: float
    l: float


NAMES = ["x", "y", "p.k", "p.l"]
numbers = st.sampled_from(["0.5", "2.0", "1.5", "-0.75"])


@cache
def expressions(names: tuple[str, ...]) -> st.SearchStrategy[str]:
    """Texts of expressions that are finite for moderate values."""
    leaf = st.one_of(st.sampled_from(names), numbers)

    def grown(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
        two = st.tuples(inner, inner)
        test = st.builds("({0[0]} {1} {0[1]})".format, two, st.sampled_from(["<", ">="]))
        return st.one_of(
            st.builds("({0[0]} {1} {0[1]})".format, two, st.sampled_from(["+", "-", "*"])),
            st.builds("({0[0]} / (1.0 + {0[1]} * {0[1]}))".format, two),
            st.builds("({}({}))".format, st.sampled_from(["sin", "cos", "atan", "-"]), inner),
            st.builds("sqrt(0.5 + {0} * {0})".format, inner),
            st.builds("exp(-abs({}))".format, inner),
            st.builds("{1}({0[0]}, {0[1]})".format, two, st.sampled_from(["min", "max"])),
            st.builds("({0[0]} if {1} else {0[1]})".format, two, test),
            st.builds("({})**{}".format, inner, st.sampled_from([2, 3])),
            st.builds("helper({0[0]}, {0[1]})".format, two),
        )

    return st.recursive(leaf, grown, max_leaves=6)


@st.composite
def bodies(draw: st.DrawFn) -> str:
    """Statements with names of their own, second values, branches that merge or return."""
    names, lines = list(NAMES), []
    for i in range(draw(st.integers(1, 4))):
        name = draw(st.sampled_from([f"v{i}", *[n for n in names if "." not in n]]))
        kind = draw(st.sampled_from(["set", "set", "if", "return"]))
        one, two = draw(expressions(tuple(names))), draw(expressions(tuple(names)))
        test = f"{draw(st.sampled_from(names))} > {draw(numbers)}"
        if kind == "set":
            lines.append(f"{name} = {one}")
        elif kind == "if":
            lines += [f"if {test}:", f"    {name} = {one}", "else:", f"    {name} = {two}"]
        else:
            lines += [f"if {test}:", f"    return {one}, {two}"]
            continue
        if name not in names:
            names.append(name)
    lines.append(f"return {draw(expressions(tuple(names)))}, {draw(expressions(tuple(names)))}")
    return "\n".join(f"    {line}" for line in lines)


HEAD = """
from math import atan, cos, exp, sin, sqrt

@equation
def helper(a: float, b: float) -> float:
    c = a * b
    if a > b:
        return c + a
    return c - sin(b)

@equation
def f(x: float, y: float, p: Gains) -> tuple[float, float]:
"""
count = 0


def made(body: str) -> Any:
    global count
    count += 1
    text, file = HEAD + body + "\n", f"/random/equation_{count}.py"
    linecache.cache[file] = (len(text), None, text.splitlines(True), file)
    space = {"equation": equation, "Gains": Gains}
    exec(compile(text, file, "exec"), space)
    return space["f"]


values = st.floats(-2.0, 2.0).filter(lambda x: abs(x) > 1e-3)


@given(bodies(), st.tuples(values, values, values, values))
@example(  # what both ways set to the same value once stayed what it was before
    "    if x > 0.5:\n        x = 1.5\n    else:\n        x = 1.5\n    return x, x",
    (1.0, 1.0, 1.0, 1.0),
)
@example(  # a second value of an adjoint was once named as the adjoint of a second value
    "    x = sqrt(0.5 + helper(x, x) * helper(x, x))\n    return (x + x), (x / (1.0 + y * y))",
    (1.0, 1.0, 1.0, 1.0),
)
@example(  # a name that both ways set to the same value once kept the value from before
    "    if x > 0.5:\n        x = 1.5\n    else:\n        x = 1.5\n    return x, y",
    (1.0, 1.0, 1.0, 1.0),
)
@settings(max_examples=200)
def test_random_equations(body: str, at: tuple[float, ...]) -> None:
    f = made(body)
    derived = derive(f, ("x", "y", "p"))
    assert set(derived.inputs) == {"x", "y", "p.k", "p.l"}
    arguments = {"x": at[0], "y": at[1], "p": Gains(*at[2:])}
    assume(compared(getattr(f, "py_func", f), derived, arguments))
    assert_printed(f, derived, arguments)
