"""What an equation may not use is refused at import, in a sentence with file and line."""

import linecache
import math
from typing import Any, NamedTuple

import numpy as np
import pytest

from swashplate.environment import compiles
from swashplate.errors import EquationError, SwashplateError
from swashplate.machine import derive, equation, interpolate, repeated, root

pytestmark = pytest.mark.interpreted

WORDS = ("a", "b")
TABLE = np.ones(2)


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
        "math": math, "np": np, "Two": Two, "WORDS": WORDS, "TABLE": TABLE, "fine": fine,
        "added": added, "equation": equation, "interpolate": interpolate,
        "repeated": repeated, "root": root,
    }  # fmt: skip
    exec(compile(text, file, "exec"), space)
    return space["f"]


REFUSED = {
    "while x > 0.0: x = x - 1.0": ("a while loop", "range(4)"),
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
    "fine(x)": ("a statement that sets nothing", "leave it out"),
    "t.a = x": ("an assignment to a field", "State(t.a, b)"),
    "y = t.__class__(x, x).a": ("__class__, which is Python's own", "name a field"),
    "y: float": ("a declaration", "assign a value"),
    "y = lambda z: z": ("lambda", "a separate equation"),
    "y = (z := x)": (":=", "separate assignment"),
    "y = x in t": ("`in`", "=="),
    "y = x is True": ("`is` with something other than None", "=="),
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


RUN = {
    "for i in range(x): y = i": ("a count or an index of a number that is known only", "repeated"),
    "for z in x: y = z": ("a number in the place of a tuple", "use a tuple"),
    "y = [x, x]": ("y, which is a list,", "use a tuple"),
    "y = [z for z in t]": ("y, which is a list,", "use a tuple"),
    "y = 1.0 if f'{x}' == '1.0' else 2.0": ("text of a number that is known only", "leave it out"),
    "y = 1.0 if '%s' % x == '1.0' else 2.0": ("text of a number", "leave it out"),
    "y = {x: 1.0}[x]": ("a key or a member of a number", "use a tuple"),
    "y = np.clip(x, 0.0, 1.0)": ("a call of np.clip", "functions of math"),
    "y = interpolate(x, (0.0, 2.0, 1.0), (0.0, 1.0, 2.0))": ("do not ascend", "sort the table"),
    "y = {1: x}": ("y, which is a dict,", "use a tuple"),
    "y = (z for z in t)": ("a value that is a generator", "numbers and tuples"),
    "y = tuple(z for z in t if z > x)": ("where Python decides at once", "write it with if"),
    "y = 'a'": ("a result that is text", "return numbers"),
    "y = x + 'a'": ("arithmetic with a str", "real numbers"),
    "y = x * 1j": ("arithmetic with a complex", "real numbers"),
    "y = x == t": ("a comparison of a tuple", "compare its elements"),
    "y = 1.0 if (x, 1.0) == (2.0, x) else 0.0": ("where Python decides at once", "with if"),
    "y = x // 2.0": ("//", "floor(a / b)"),
    "y = 2.0 % x": ("%", "floor(a / b)"),
    "y = (x > 0.0) & (x < 1.0)": ("&", "`and`"),
    "y = 2 ^ (x > 0.0)": ("^", "`!=` of two tests"),
    "y = ~(x > 0.0)": ("~", "`not`"),
    "y = x ** 0.5": ("a power other than", "sqrt(a)"),
    "y = 2.0 ** x": ("a power other than", "exp(b * log(a))"),
    "y = t[x]": ("an index of a number that is known only", "a whole number"),
    "y = t[2]": ("IndexError", "tuple index out of range"),
    "y = 1.0 / (2 - 2)": ("ZeroDivisionError", "division by zero"),
    "y = math.log(0.0 * 1.0)": ("ValueError", "math domain error"),
    "y = print(x)": ("a call of print", "outside"),
    "y = eval('x')": ("a call of eval", "equations and functions of math"),
    "y = __import__('os').getpid()": ("a call of __import__", "equations and functions of math"),
    "y = open('a')": ("a call of open", "equations and functions of math"),
    "y = x.runner.make('+', x.node)": ("a call of x.runner.make", "functions of math"),
    "y = x.node": ("a value that is a Node", "numbers and tuples"),
    "y = Two": ("Two, which is type", "only numbers"),
    "y = math": ("math, which is module", "only numbers"),
    "y = sum(t)": ("a call of sum", "terms"),
    "y = round(x)": ("a call of round", "floor(x + 0.5)"),
    "y = float(x)": ("a call of float", "1.0 if test else 0.0"),
    "y = sorted(t)": ("a call of sorted", "equations and functions of math"),
    "y = np.sqrt(x)": ("a call of np.sqrt", "sqrt, exp, log"),
    "y = math.cosh(x)": ("a call of math.cosh", "sqrt, exp, log"),
    "y = x(1.0)": ("a call of x, which is of type Symbol", "call an @equation"),
    "y = t.count(x)": ("the method count", "make a new"),
    "y = fine(*t)": ("fine with too many positional arguments", "it takes x"),
    "y = f(x, t)": ("a recursive call", "literal range"),
    "y = fine(x) + missing(x)": ("the unknown name missing", "define or import it"),
    "y = x + WORDS": ("arithmetic with a tuple", "name its elements"),
    "y = x + np.ones(2)[0]": ("a call of np.ones", "functions of math"),
    "y = TABLE": ("TABLE, which is ndarray", "a float or an int of Python"),
    "y = fine": ("a value that is a function", "numbers and tuples"),
    "y = x + t": ("arithmetic with a tuple", "name its elements"),
    "y = t.c": ("the field c, which is unknown", "name a field"),
    "y = fine(x, x)": ("fine with too many positional arguments", "it takes x"),
    "y = math.sqrt(x, x)": ("sqrt of 2 arguments", "give it 1"),
    "y = Two().a": ("TypeError", "missing 1 required positional argument: 'a'"),
    "a, b, c = t": ("an unpacking", "as many values"),
    "if x > 0.0: z = 1.0\n    y = z": ("z without a value on some path", "on every path"),
    "if x > 0.0: z = t\n    else: z = x\n    y = x": ("z of two structures", "same named tuple"),
    "if t > x: y = 2.0": ("a comparison of a tuple", "compare its elements"),
    "y = root(x, 0.0, 1.0)": ("root of something else", "name of an @equation"),
    "y = root(fine, 0.0, 1.0, x)": ("root of fine with other", "the unknown and the rest"),
    "y = repeated(fine, 3.0, t)": ("repeated of fine with other arguments", "the rest"),
    "y = repeated(added, 3.0, t)": ("added, which does not return a state", "same named tuple"),
    "y = interpolate(x, t, (1.0,))": ("interpolate with something else", "one length"),
    "if x > 1.0: return x, y": ("results of different structure", "same tuple"),
}  # fmt: skip


@pytest.mark.parametrize("statement", RUN)
def test_refused_when_run(statement: str) -> None:
    f = defined(
        f"@equation\ndef f(x: float, t: Two) -> float:\n    y = x\n    {statement}\n    return y\n"
    )
    with pytest.raises(EquationError) as raised:
        derive(f, "x")
    for words in (*RUN[statement], "/somewhere/friction.py, line "):
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
    if compiles():
        with pytest.raises(EquationError, match="a call of g in f: make g an @equation"):
            derive(f, "x")
