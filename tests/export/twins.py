"""An equation in C and in LLVM's language, both over rows of numbers, for their bits."""

import ctypes
import math
import re
import typing
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from swashplate.export.c_source import EquationInC, equation_in_c
from swashplate.machine.code_generation import Loops, Trace, arguments, helpers_in, leaves
from swashplate.machine.code_generation.llvm import Code
from swashplate.machine.code_generation.machine_code import code_of_text
from swashplate.machine.graph import ZERO, ordered
from swashplate.machine.language import is_named_tuple, parsed
from swashplate.machine.marching.kernels import FLOATS

CALLS = 3000
MODERATE = 1e4
"""What numbers stay below, and one over them too, that whole numbers are made of."""
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
    """An equation in LLVM's language over rows of numbers, with its options decided."""

    def __init__(self, equation: Any, on: bool) -> None:
        hints = hints_of(equation)
        del hints["return"]
        self.on = on
        self.columns = [each for name, hint in hints.items() for each in scalars(hint, name)]
        lengths = {k: v for n, h in hints.items() for k, v in open_lengths(h, n)}
        given = arguments(parsed(equation), None, lengths)
        self.results = [node for _, node in leaves(Trace().call(equation, given))]
        self.width = len(self.results)

    @property
    def counts(self) -> bool:
        """Whether it makes whole numbers, which C has not of what is none, or is huge."""
        nodes = ordered(self.results)
        return any(node.op in ("floor", "call") for node in nodes)

    def over(self, rows: np.ndarray) -> np.ndarray:
        """What the compiled equation gives for rows, a column for each argument."""
        places = {path: place for place, (_, path) in enumerate(self.columns)}
        code = Code([("i64", "count"), ("ptr", "rows"), ("ptr", "out")])
        with code.loop("0", "%count") as at:
            row = code.put(f"mul i64 {at}, {len(self.columns)}")
            known = {}
            for node in ordered(self.results):
                if node.op == "name":
                    place = places[re.sub(r"\[(\d+)\]", r".\1", node.value)]
                    text = code.load("%rows", code.put(f"add i64 {row}, {place}"))
                    known[node] = code.as_test(ZERO, text) if node.kind == "bool" else text
            out = code.put(f"mul i64 {at}, {self.width}")
            for place, text in enumerate(code.floats(self.results, known)):
                code.store(text, "%out", code.put(f"add i64 {out}, {place}"))
        results = np.empty((len(rows), self.width))
        code_of_text("twin", code.text, ("int", FLOATS, FLOATS))(len(rows), rows, results)
        return results


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
        if twin.counts:
            size = np.abs(given)
            given = np.where((size > 1.0 / MODERATE) & (size < MODERATE), size, 1.0)
        wanted = twin.over(given)
        found = np.empty((CALLS, twin.width))
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
