"""An equation in C and compiled by Python, both over rows of numbers, for their bits."""

import ctypes
import math
import typing
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from swashplate.export.c_source import EquationInC, equation_in_c
from swashplate.machine import kernel
from swashplate.machine.code_generation import Loops, helpers_in
from swashplate.machine.declaration import remember_text
from swashplate.machine.language import is_named_tuple, parsed

CALLS = 3000
SPECIAL = np.array(
    [math.nan, 0.0, -0.0, math.inf, -math.inf, 5e-324, -5e-324, 1e-310, -2e-308, 1.0, -1.0, 1e300]
)
COUNTS = ("count", "substeps")
"""Arguments that say how often something is done: few times."""


WINDOW = 3
"""Elements of tuples whose length the types leave open."""


# --- numbers in, numbers out ----------------------------------------------------------------------


def items_of(hint: Any, path: str) -> list[tuple[str, Any]] | None:
    """Paths and types of what is in a tuple; None of a scalar."""
    args = typing.get_args(hint)
    if typing.get_origin(hint) is typing.Annotated:
        return items_of(args[0], path)
    if is_named_tuple(hint):
        hints = typing.get_type_hints(hint)
        return [(f"{path}.{name}", hints.get(name, float)) for name in hint._fields]
    if typing.get_origin(hint) is tuple:
        args = (args[0],) * WINDOW if args[-1] is Ellipsis else args
        return [(f"{path}.{i}", each) for i, each in enumerate(args)]
    return None


def scalars(hint: Any, path: str) -> Iterator[tuple[str, str]]:
    """Word and path of every scalar of a type, in order."""
    items = items_of(hint, path)
    if items is not None:
        for below, each in items:
            yield from scalars(each, below)
    elif type(None) in typing.get_args(hint):
        yield "flag", path
    else:
        yield {float: "double", int: "int", bool: "bool"}[hint], path


def open_lengths(hint: Any, path: str) -> Iterator[tuple[str, int]]:
    """Lengths of tuples whose types leave them open, by path."""
    if typing.get_origin(hint) is tuple and Ellipsis in typing.get_args(hint):
        yield path, WINDOW
    for below, each in items_of(hint, path) or ():
        yield from open_lengths(each, below)


def caller(number: int, made: EquationInC, columns: list[str]) -> str:
    """C that calls an equation with numbers in a row, a column for each argument."""
    word = {"float": "in[{}]", "int": "(long long)in[{}]", "bool": "in[{}] != 0.0"}
    arguments = [word[kind].format(columns.index(path)) for path, kind in made.formals.items()]
    kinds = ["bool" if kind == "bool" else "double" for kind in made.results.values()]
    if len(kinds) == 1:
        lines = [f"    const {kinds[0]} r0 = {made.name}({', '.join(arguments)});"]
    else:
        arguments += [f"&r{i}" for i in range(len(kinds))]
        lines = [f"    {kind} r{i};" for i, kind in enumerate(kinds)]
        lines.append(f"    {made.name}({', '.join(arguments)});")
    lines += [f"    out[{i}] = (double)r{i};" for i in range(len(kinds))]
    body = "\n".join(lines)
    head = f"void call_{number}(const double *in, double *out)"
    return f"{head};\n{head}\n{{\n    (void)in;\n    (void)out;\n{body}\n}}\n"


class Twin:
    """Python of an equation over rows of numbers, with its options decided."""

    def __init__(self, equation: Any, on: bool) -> None:
        self.names, self.on = {"f": equation, "np": np}, on
        hints = hints_of(equation)
        back = hints.pop("return")
        self.columns = [each for name, hint in hints.items() for each in scalars(hint, name)]
        self.count = 0
        given = [self.value(hint, name) for name, hint in hints.items()]
        lines = ["    for i in range(rows.shape[0]):", f"        r = f({', '.join(given)})"]
        out = list(self.scalar(back, "r"))
        self.width = len(out)
        lines += [f"        out[i, {j}] = {each}" for j, each in enumerate(out)]
        self.text = "\n".join(["@kernel", "def rows_of(rows, out):", *lines, ""])

    def value(self, hint: Any, path: str) -> str:
        items = items_of(hint, path)
        if items is not None:
            inner = ", ".join(self.value(each, below) for below, each in items)
            if not is_named_tuple(hint):
                return f"({inner},)"
            self.names[hint.__name__] = hint
            return f"{hint.__name__}({inner})"
        ((word, _),) = scalars(hint, path)
        place = f"rows[i, {self.count}]"
        self.count += 1
        if word == "flag":
            return "True" if self.on else "None"
        return {"double": place, "int": f"int({place})"}.get(word, f"{place} != 0.0")

    def scalar(self, hint: Any, text: str) -> Iterator[str]:
        items = items_of(hint, "")
        if items is None:
            yield f"1.0 if {text} else 0.0" if hint is bool else text
        for below, each in items or ():
            name = below.removeprefix(".")
            own = f"{text}.{name}" if is_named_tuple(hint) else f"{text}[{name}]"
            yield from self.scalar(each, own)


def rows(columns: list[tuple[str, str]], on: bool, seed: int) -> np.ndarray:
    """Numbers of all sizes, some of them none, ties among them."""
    rng = np.random.default_rng(seed)
    shape = (CALLS, max(len(columns), 1))
    made = rng.choice([-1.0, 1.0], shape) * 10.0 ** rng.uniform(-6.0, 6.0, shape)
    near = rng.uniform(0.0, 1.0, shape)
    third = np.arange(CALLS) % 3
    made[third == 0] = near[third == 0]
    tied = rng.random(shape) < 0.05
    made[tied] = np.broadcast_to(made[:, :1], shape)[tied]
    odd = (rng.random(shape) < 0.1) & (third == 1)[:, None]
    made[odd] = rng.choice(SPECIAL, int(odd.sum()))
    for j, (word, path) in enumerate(columns):
        if word == "flag":
            made[:, j] = float(on)
        elif word == "bool":
            made[:, j] = rng.integers(0, 2, CALLS)
        elif word == "int" or path.rpartition(".")[2] in COUNTS:
            made[:, j] = rng.integers(0, 4, CALLS)
    return np.ascontiguousarray(made)


# --- comparison -----------------------------------------------------------------------------------


def hints_of(equation: Any) -> dict[str, Any]:
    """Types of what an equation takes and returns."""
    f = equation
    hints = typing.get_type_hints(f)
    names = [*(each.arg for each in parsed(f).arguments), "return"]
    return {name: by_itself(hints[name]) for name in names}


def by_itself(hint: Any) -> Any:
    """The type of an argument of an equation by itself: of several named tuples the first."""
    kinds = typing.get_args(hint)
    return kinds[0] if kinds and all(map(is_named_tuple, kinds)) and "|" in str(hint) else hint


def flagged(equation: Any) -> bool:
    """Whether an equation takes options."""
    hints = hints_of(equation)
    del hints["return"]
    return any(word == "flag" for name, h in hints.items() for word, _ in scalars(h, name))


def compiled(text: str, names: Mapping[str, Any]) -> dict[str, Any]:
    """A module of kernels, executed."""
    space = {**vars(math), "kernel": kernel, **names}
    exec(compile(text, remember_text("twin", text), "exec"), space)
    return space


class InC:
    """Equations as one source of C, with a function for each that takes numbers in a row."""

    def __init__(self, equations: Mapping[str, Any]) -> None:
        self.equations, functions = equations, Loops()
        texts, callers = [], []
        self.numbers = {key: number for number, key in enumerate(equations)}
        for key, equation in equations.items():
            lengths = {k: v for n, h in hints_of(equation).items() for k, v in open_lengths(h, n)}
            made = equation_in_c(equation, functions, lengths)
            texts.append(made.text)
            columns = [path for _, path in Twin(equation, False).columns]
            callers.append(caller(self.numbers[key], made, columns))
        body = "\n\n".join([*functions.texts, *texts, *callers])
        head = "#include <math.h>\n#include <stdbool.h>\n"
        self.text = "\n\n".join([head, *helpers_in(body), body])

    def compare(self, library: ctypes.CDLL, key: str, on: bool) -> None:
        """The same bits from both, for some thousand rows."""
        twin = Twin(self.equations[key], on)
        given = rows(twin.columns, on, self.numbers[key])
        wanted, found = np.empty((CALLS, twin.width)), np.empty((CALLS, twin.width))
        made = compiled(twin.text, twin.names)
        try:
            made["rows_of"](given, wanted)
        except ZeroDivisionError:  # 0 to a negative power, where C goes on with infinity
            given[given == 0.0] = 1.0
            made["rows_of"](given, wanted)
        call = getattr(library, f"call_{self.numbers[key]}")
        double = ctypes.POINTER(ctypes.c_double)
        for i in range(CALLS):
            call(given[i].ctypes.data_as(double), found[i].ctypes.data_as(double))
        differ = np.argwhere(bits(wanted) != bits(found))
        assert differ.size == 0, (
            f"{key}: {differ.shape[0]} differ, first {wanted[tuple(differ[0])]!r} and "
            f"{found[tuple(differ[0])]!r} of {given[differ[0][0]]}"
        )


def bits(values: np.ndarray) -> np.ndarray:
    """Bits of numbers, those that are none all alike."""
    return np.where(np.isnan(values), np.nan, values).view(np.int64)
