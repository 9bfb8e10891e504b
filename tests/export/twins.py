"""An equation in C and compiled by Python, both over rows of numbers, for their bits."""

import ctypes
import math
import typing
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from swashplate.equations.c_source import Kind, Unit, c_name, fields_of
from swashplate.equations.language import parsed, plain
from swashplate.equations.marching.run import module

CALLS = 3000
SPECIAL = np.array(
    [math.nan, 0.0, -0.0, math.inf, -math.inf, 5e-324, -5e-324, 1e-310, -2e-308, 1.0, -1.0, 1e300]
)
COUNTS = ("count", "substeps")
"""Arguments that say how often something is done: few times."""


# --- numbers in, numbers out ----------------------------------------------------------------------


def scalars(unit: Unit, kind: Kind, path: str) -> Iterator[tuple[str, str]]:
    """Word and path of every scalar of a kind, in order."""
    if kind.word == "struct":
        for name, hint in fields_of(kind.cls):
            yield from scalars(unit, unit.kind(hint, path), f"{path}.{name}")
    elif kind.word == "tuple":
        for i, item in enumerate(kind.items):
            yield from scalars(unit, item, f"{path}.{i}")
    else:
        yield kind.word, path


def in_c(unit: Unit, kind: Kind, number: Iterator[int]) -> str:
    """A value in C of numbers in a row."""
    if kind.word == "struct":
        inner = [in_c(unit, unit.kind(h, ""), number) for _, h in fields_of(kind.cls)]
        return f"{{{', '.join(inner) or '0'}}}"
    if kind.word == "tuple":
        return f"{{{{{', '.join(in_c(unit, item, number) for item in kind.items)}}}}}"
    word = {"double": "in[{}]", "int": "(long long)in[{}]"}.get(kind.word, "in[{}] != 0.0")
    return word.format(next(number))


def out_c(unit: Unit, kind: Kind, text: str) -> Iterator[str]:
    """The scalars of a value in C."""
    if kind.word == "struct":
        for name, hint in fields_of(kind.cls):
            yield from out_c(unit, unit.kind(hint, ""), f"{text}.{c_name(name)}")
    elif kind.word == "tuple":
        for i, item in enumerate(kind.items):
            array = all(each.word in ("double", "int") for each in kind.items)
            yield from out_c(unit, item, f"{text}.v[{i}]" if array else f"{text}.v{i}")
    else:
        yield f"(double){text}"


def caller(unit: Unit, number: int, name: str, kinds: dict[str, Kind]) -> str:
    """C that calls an equation with numbers in a row."""
    count = iter(range(10_000))
    lines, arguments = [], []
    for i, kind in enumerate([k for n, k in kinds.items() if n != "return"]):
        lines.append(f"    const {unit.declared(kind)} a{i} = {in_c(unit, kind, count)};")
        arguments.append(f"&a{i}" if kind.whole else f"a{i}")
    back = kinds["return"]
    lines.append(f"    const {unit.declared(back)} r = {name}({', '.join(arguments)});")
    lines += [f"    out[{j}] = {each};" for j, each in enumerate(out_c(unit, back, "r"))]
    body = "\n".join([*lines, "    (void)r;"])
    head = f"void call_{number}(const double *in, double *out)"
    return f"{head};\n{head}\n{{\n    (void)in;\n    (void)out;\n{body}\n}}\n"


class Twin:
    """Python of an equation over rows of numbers, with its options decided."""

    def __init__(self, unit: Unit, equation: Any, on: bool) -> None:
        self.unit, self.names, self.on = unit, {"f": equation, "np": np}, on
        source = parsed(equation)
        hints = typing.get_type_hints(source.function)
        self.columns: list[tuple[str, str]] = []
        self.count = 0
        given = [self.value(unit.kind(hints[a.arg], ""), a.arg) for a in source.arguments]
        back = unit.kind(hints["return"], "")
        lines = ["    for i in range(rows.shape[0]):", f"        r = f({', '.join(given)})"]
        out = list(self.scalar(back, "r"))
        self.width = len(out)
        lines += [f"        out[i, {j}] = {each}" for j, each in enumerate(out)]
        self.text = "\n".join(["@kernel", "def rows_of(rows, out):", *lines, ""])

    def value(self, kind: Kind, path: str) -> str:
        if kind.word == "struct":
            self.names[kind.cls.__name__] = kind.cls
            inner = [
                self.value(self.unit.kind(h, ""), f"{path}.{n}") for n, h in fields_of(kind.cls)
            ]
            return f"{kind.cls.__name__}({', '.join(inner)})"
        if kind.word == "tuple":
            inner = [self.value(item, f"{path}.{i}") for i, item in enumerate(kind.items)]
            return f"({', '.join(inner)},)"
        self.columns.append((kind.word, path))
        self.count += 1
        place = f"rows[i, {self.count - 1}]"
        if kind.word == "flag":
            return "True" if self.on else "None"
        return {"double": place, "int": f"int({place})"}.get(kind.word, f"{place} != 0.0")

    def scalar(self, kind: Kind, text: str) -> Iterator[str]:
        if kind.word == "struct":
            for name, hint in fields_of(kind.cls):
                yield from self.scalar(self.unit.kind(hint, ""), f"{text}.{name}")
        elif kind.word == "tuple":
            for i, item in enumerate(kind.items):
                yield from self.scalar(item, f"{text}[{i}]")
        else:
            yield f"1.0 if {text} else 0.0" if kind.word == "bool" else text


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


def kinds_of(unit: Unit, equation: Any) -> dict[str, Kind]:
    """Kinds of what an equation takes and returns."""
    f = plain(equation)
    hints = typing.get_type_hints(f)
    names = [*(each.arg for each in parsed(f).arguments), "return"]
    return {name: unit.kind(hints[name], name) for name in names}


def flagged(equation: Any) -> bool:
    """Whether an equation takes options."""
    unit = Unit()
    kinds = [kind for name, kind in kinds_of(unit, equation).items() if name != "return"]
    return any(word == "flag" for kind in kinds for word, _ in scalars(unit, kind, ""))


class InC:
    """Equations as one source of C, with a function for each that takes numbers in a row."""

    def __init__(self, equations: Mapping[str, Any]) -> None:
        self.equations, self.unit = equations, Unit("t_")
        names = {key: self.unit.add(equation) for key, equation in equations.items()}
        self.numbers = {key: number for number, key in enumerate(names)}
        callers = [
            caller(self.unit, self.numbers[key], name, kinds_of(self.unit, equations[key]))
            for key, name in names.items()
        ]
        structs = [text for _, text in self.unit.structs.values()]
        constants = [text for _, text in self.unit.constants.values()]
        head = "#include <math.h>\n#include <stdbool.h>\n"
        parts = [head, *self.unit.helpers(), *structs, *constants, *self.unit.texts, *callers]
        self.text = "\n\n".join(parts)

    def compare(self, library: ctypes.CDLL, key: str, on: bool) -> None:
        """The same bits from both, for some thousand rows."""
        twin = Twin(self.unit, self.equations[key], on)
        given = rows(twin.columns, on, self.numbers[key])
        wanted, found = np.empty((CALLS, twin.width)), np.empty((CALLS, twin.width))
        made = module(f"twin_{key.replace('.', '_')}", twin.text, twin.names)
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
