"""What an equation may not use is refused at import, in a sentence with file and line."""

import linecache
import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import config

from swashplate.equations import derive, equation, interpolate, repeated, root
from swashplate.errors import EquationError, SwashplateError

pytestmark = pytest.mark.interpreted

WORDS = ("a", "b")


class Two(NamedTuple):
    a: float
    b: float = 1.0


@equation
def fine(x: float) -> float:
    return x


@equation
def added(t: Two, number: float) -> float:
    return t.a + number


def defined(text: str, file: str = "/somewhere/friction.py") -> Any:
    """The function that a text defines, as if it stood in a file."""
    linecache.cache[file] = (len(text), None, text.splitlines(True), file)
    space = {
        "math": math, "np": np, "Two": Two, "WORDS": WORDS, "fine": fine, "added": added,
        "equation": equation, "interpolate": interpolate, "repeated": repeated, "root": root,
    }  # fmt: skip
    exec(compile(text, file, "exec"), space)
    return space["f"]


REFUSED = {
    "while x > 0.0: x = x - 1.0": ("a while loop", "literal number of steps"),
    "for i in range(x): y = i": ("something other than a literal range", "range(4)"),
    "for i in range(3):\n        if x > 0.0: break": ("break", "use if within the loop"),
    "for i in range(3):\n        if x > 0.0: continue": ("continue", "use if within the loop"),
    "try:\n        y = x\n    except ValueError:\n        y = 1.0": ("try", "with if"),
    "with x: y = 1.0": ("with", "only computes"),
    "raise ValueError": ("raise", "return a value"),
    "assert x > 0.0": ("assert", "domain"),
    "def g(z: float) -> float: return z": ("within an equation", "next to it"),
    "class C: pass": ("a class within", "next to"),
    "import os": ("an import within", "top of the file"),
    "global z": ("global", "its arguments"),
    "del x": ("del", "alone"),
    "match x:\n        case 1.0: y = 2.0": ("match", "if and elif"),
    "fine(x)": ("without effect", "leave it out"),
    "t.a = x": ("an assignment to a field", "State(t.a, b)"),
    "y: float": ("a declaration", "assign a value"),
    "y = lambda z: z": ("lambda", "a separate equation"),
    "y = [x, x]": ("a list", "tuple"),
    "y = {1: x}": ("a dictionary", "named tuple"),
    "y = [z for z in t]": ("a comprehension", "write the terms out"),
    "y = 'a'": ("a string", "options"),
    "y = 1j": ("1j", "real numbers"),
    "y = (z := x)": (":=", "separate assignment"),
    "y = (*t, x)": ("with *", "write the elements out"),
    "y = x // 2.0": ("//", "floor(a / b)"),
    "y = x % 2.0": ("%", "floor(a / b)"),
    "y = (x > 0.0) & (x < 1.0)": ("&", "`and`"),
    "y = x ^ 2": ("^", "**"),
    "y = x ** 0.5": ("a power other than", "sqrt(a)"),
    "y = x ** x": ("a power other than", "exp(b * log(a))"),
    "y = x in t": ("`in`", "=="),
    "y = x is True": ("`is` with something other than None", "=="),
    "y = t[x]": ("an index that is not a whole number", "s[0]"),
    "y = print(x)": ("a call of print", "outside"),
    "y = sum(t)": ("a call of sum", "terms"),
    "y = round(x)": ("a call of round", "floor(x + 0.5)"),
    "y = sorted(t)": ("a call of sorted", "equations and functions of math"),
    "y = np.sqrt(x)": ("a call of np.sqrt", "sqrt, exp, log"),
    "y = x(1.0)": ("a call of the argument x", "by their names"),
    "y = t.count(x)": ("the method count", "make a new"),
    "y = fine(*t)": ("with *", "write the elements out"),
    "y = f(x, t)": ("a recursive call", "literal range"),
    "return": ("a return without a value", "return a value"),
}


@pytest.mark.parametrize("statement", REFUSED)
def test_refused_at_import(statement: str) -> None:
    text = (
        f"@equation\ndef f(x: float, t: Two) -> float:\n    y = x\n    {statement}\n    return y\n"
    )
    with pytest.raises(EquationError) as raised:
        defined(text)
    for words in (*REFUSED[statement], "/somewhere/friction.py, line ", " in f: "):
        assert words in str(raised.value)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("def f(*x: float) -> float:\n    return x[0]", "an argument with"),
        ("def f(**x: float) -> float:\n    return 1.0", "an argument with"),
        ("def f(x) -> float:\n    return x", "x .* type"),
        ("def f(x: float) -> float:\n    y = x", "end without return"),
        ("def f(x: float) -> float:\n    if x > 0.0:\n        return x", "end without return"),
    ],
)
def test_refused_heads_and_ends(text: str, what: str) -> None:
    with pytest.raises(EquationError, match=what):
        defined(f"@equation\n{text}\n")


DERIVED = {
    "y = fine(x) + missing(x)": ("the unknown name missing", "define or import it"),
    "y = x + WORDS": ("WORDS, which is tuple", "only numbers"),
    "y = x + t": ("arithmetic with a tuple", "name its elements"),
    "y = t.c": ("the field c, which is unknown", "name a field"),
    "y = fine(x, x)": ("fine with too many positional arguments", "it takes x"),
    "y = math.sqrt(x, x)": ("sqrt of 2 arguments", "give it 1"),
    "y = Two(x).a": ("missing a required argument: 'b'", "it takes a, b"),
    "a, b, c = t": ("an unpacking", "as many values"),
    "if x > 0.0: z = 1.0\n    y = z": ("z without a value on some path", "on every path"),
    "if x > 0.0: z = t\n    else: z = x\n    y = x": ("z of two structures", "same kind"),
    "if t > x: y = 2.0": ("a comparison of a tuple", "compare its elements"),
    "y = root(x, 0.0, 1.0)": ("root of something else", "name of an @equation"),
    "y = root(fine, 0.0, 1.0, x)": ("root of fine with other", "the unknown and the rest"),
    "y = repeated(fine, 3.0, t)": ("repeated of fine with other arguments", "the rest"),
    "y = repeated(added, 3.0, t)": ("added, which does not return a state", "same named tuple"),
    "y = interpolate(x, t, (1.0,))": ("interpolate with something else", "one length"),
    "if x > 1.0: return x, y": ("results of different structure", "same tuple"),
}  # fmt: skip


@pytest.mark.parametrize("statement", DERIVED)
def test_refused_when_read(statement: str) -> None:
    f = defined(
        f"@equation\ndef f(x: float, t: Two) -> float:\n    y = x\n    {statement}\n    return y\n"
    )
    with pytest.raises(EquationError) as raised:
        derive(f, "x")
    for words in (*DERIVED[statement], "/somewhere/friction.py, line "):
        assert words in str(raised.value)


def test_a_function_without_a_file_is_refused() -> None:
    space: dict[str, Any] = {"equation": equation}
    with pytest.raises(EquationError, match="source of f cannot be read.*bare prompt"):
        exec("@equation\ndef f(x: float) -> float:\n    return x\n", space)
    with pytest.raises(EquationError, match="not a function that can be an equation"):
        equation(math.sqrt)
    assert issubclass(EquationError, SwashplateError)


def test_a_notebooks_cell_is_a_source() -> None:
    text = "@equation\ndef f(x: float) -> float:\n    return x * x\n"
    f = defined(text, "/tmp/ipykernel_123/456.py")
    assert derive(f, "x")(3.0) == (9.0, 6.0)


def test_two_equations_that_call_each_other_are_refused() -> None:
    f = defined(
        "@equation\ndef g(x: float) -> float:\n    return f(x)\n\n"
        "@equation\ndef f(x: float) -> float:\n    return g(x)\n"
    )
    with pytest.raises(EquationError, match="a recursive call in f"):
        derive(f, "x")


def test_a_plain_function_is_no_equation() -> None:
    text = "def g(x: float) -> float:\n    return x\n\n"
    text += "@equation\ndef f(x: float) -> float:\n    return g(x)\n"
    f = defined(text)
    if not config.DISABLE_JIT:
        with pytest.raises(EquationError, match="a call of g in f: make g an @equation"):
            derive(f, "x")
