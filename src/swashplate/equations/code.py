"""Straight code: what equations say, as scalars that each get one value.

Named tuples have come apart, calls are written out, loops are unrolled, options decided. What is
left are definitions, choices, and calls of loops that are run, with the operations of the equations
in their order: results keep their last bit. Derivatives and kernels are made from it.
"""

from __future__ import annotations

import math
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, wraps
from itertools import count
from threading import RLock
from time import perf_counter
from typing import Any, ParamSpec, TypeVar

from swashplate.equations import expressions as ex
from swashplate.equations.declaration import inlined, interpreted, remember_text
from swashplate.equations.expressions import Node
from swashplate.equations.syntax import CHOICES, MATH, Parsed, hints_of, is_named_tuple
from swashplate.errors import EquationError

P = ParamSpec("P")
R = TypeVar("R")

GENERATING = RLock()
"""Held by the one thread that reads equations or writes code, which compares by identity."""
FUNCTIONS: dict[str, Any] = {name: each for each, name in [*MATH.items(), *CHOICES.items()]}
RESERVED = {*FUNCTIONS, "inf", "nan", "range", "int", "float", "None", "True", "False"}
"""Names that texts use themselves."""


_clock = {"depth": 0.0, "seconds": 0.0}


def generating(function: Callable[P, R]) -> Callable[P, R]:
    """Remember what a function generates, and let one thread at a time do so."""
    remembered = lru_cache(maxsize=256)(function)

    @wraps(function)
    def alone(*args: P.args, **kwargs: P.kwargs) -> R:
        with GENERATING:
            begun, _clock["depth"] = perf_counter(), _clock["depth"] + 1.0
            try:
                return remembered(*args, **kwargs)  # type: ignore[arg-type]
            finally:
                _clock["depth"] -= 1.0
                if not _clock["depth"]:
                    _clock["seconds"] += perf_counter() - begun

    return alone


def generating_time() -> float:
    """Time for which this process read equations, wrote code, and loaded or compiled it. [s]"""
    return _clock["seconds"]


# --- values ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Flag:
    """An option: None (off), True (on), or "unknown"."""

    value: Any
    text: str = ""


@dataclass(frozen=True)
class Tuple:
    """A tuple or named tuple of values."""

    cls: Any
    items: tuple[Value, ...]

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the items; of a tuple without names their numbers."""
        return self.cls._fields if self.cls else tuple(map(str, range(len(self.items))))


Value = Node | Flag | Tuple


def leaves(value: Value, path: str = "") -> Iterator[tuple[str, Node]]:
    """All scalars of a value with their dotted paths."""
    if isinstance(value, Node):
        yield path, value
    elif isinstance(value, Tuple):
        for each, item in zip(value.fields, value.items, strict=True):
            yield from leaves(item, f"{path}.{each}" if path else each)


def rebuilt(value: Value, nodes: Iterator[Node]) -> Value:
    """The same structure with other scalars in it."""
    if isinstance(value, Tuple):
        return Tuple(value.cls, tuple(rebuilt(each, nodes) for each in value.items))
    return next(nodes) if isinstance(value, Node) else value


def alike(one: Value, two: Value) -> bool:
    """Whether two values can be one: whole numbers are numbers."""
    if isinstance(one, Node) and isinstance(two, Node):
        return one.kind == two.kind or {one.kind, two.kind} == {"int", "float"}
    if isinstance(one, Tuple) and isinstance(two, Tuple):
        same = one.cls is two.cls and len(one.items) == len(two.items)
        return same and all(map(alike, one.items, two.items))
    return isinstance(one, Flag) and isinstance(two, Flag) and one.value == two.value


def fixed(value: Any) -> Value | None:
    """The value of something that does not change: options, numbers, tuples of them."""
    if value is None or value is True:
        return Flag(value)
    if isinstance(value, int | float):
        return ex.number(value)
    if isinstance(value, tuple):
        items = [each for each in map(fixed, value) if each is not None]
        cls = type(value) if is_named_tuple(type(value)) else None
        return Tuple(cls, tuple(items)) if len(items) == len(value) else None
    return None


# --- items ----------------------------------------------------------------------------------------


@dataclass(eq=False)
class Let:
    """A name gets its one value."""

    name: str
    node: Node


@dataclass(eq=False)
class Choice:
    """One of two lists of items is done, and names get their values from it."""

    test: Node
    then: list[Item]
    other: list[Item]
    merged: list[tuple[str, Node, Node]]
    number: int = field(default_factory=count(1).__next__)
    again: int = 0
    """Number of an earlier choice of the same test: each side may read what that side has made."""


@dataclass(eq=False)
class Rule:
    """Items that lead to results whose derivatives are declared."""

    items: list[Item]
    results: tuple[str, ...]
    slopes: list[list[tuple[Node, Node]]]
    """Of each result the arguments that move it, with the derivatives by them."""


@dataclass(eq=False)
class Call:
    """A call of a generated function; each of its results gets a name."""

    function: Function
    arguments: tuple[Node, ...]
    results: tuple[str, ...]
    derivative: Callable[[tuple[int, ...]], Any] | None = None
    """The function with its derivatives by some of its arguments, by their numbers."""


Item = Let | Choice | Rule | Call


@dataclass(frozen=True, eq=False, repr=False)
class Function:
    """A generated function: its name, its text, and what that refers to."""

    name: str
    source: str
    names: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r})"

    @property
    def texts(self) -> dict[str, str]:
        """Texts of this function and of all that it calls, those first, by name."""
        inner = [each.texts for each in self.names.values() if isinstance(each, Function)]
        return {k: v for each in [*inner, {self.name: self.source}] for k, v in each.items()}

    @cached_property
    def python(self) -> Callable[..., Any]:
        """The function, as plain Python throughout."""
        names = self.names.items()
        made: Callable[..., Any] = self._made(
            {k: v.python if isinstance(v, Function) else interpreted(v) for k, v in names}
        )
        return made

    @cached_property
    def compiled(self) -> Any:
        """The function, compiled so that callers inline it."""
        return inlined(self._made(compiled_names(self.names)))

    def _made(self, space: dict[str, Any]) -> Any:
        file = remember_text(self.name, self.source)
        space |= {**FUNCTIONS, "inf": math.inf, "nan": math.nan}
        exec(compile(self.source, file, "exec"), space)
        return space[self.name]


def compiled_names(names: Mapping[str, Any]) -> dict[str, Any]:
    """What a text refers to, with generated functions compiled."""
    return {k: v.compiled if isinstance(v, Function) else v for k, v in names.items()}


def _reads(nodes: Iterable[Node]) -> set[str]:
    return set().union(*(node.reads for node in nodes))


def live(items: Iterable[Item], needed: set[str]) -> list[Item]:
    """Items that some names need; what these need is added to them."""
    kept: list[Item] = []
    for item in reversed([*items]):
        if isinstance(item, Choice):
            merged = [each for each in item.merged if each[0] in needed]
            one = needed | _reads(a for _, a, _ in merged)
            two = needed | _reads(b for _, _, b in merged)
            then, other = live(item.then, one), live(item.other, two)
            if not (merged or then or other):
                continue
            needed |= one | two | item.test.reads
            item = replace(item, then=then, other=other, merged=merged)
        elif isinstance(item, Let):
            if item.name not in needed:
                continue
            needed |= item.node.reads
        elif needed.isdisjoint(item.results):
            continue
        elif isinstance(item, Rule):
            needed |= _reads(node for each in item.slopes for pair in each for node in pair)
            live(item.items, needed)
        else:
            needed |= _reads(item.arguments)
        kept.append(item)
    return kept[::-1]


def fresh_name(stem: str, taken: set[str]) -> str:
    """A name that is not yet taken, and is from now on."""
    name, times = stem, 1
    while name in taken:
        times += 1
        name = f"{stem}_{times}"
    taken.add(name)
    return name


class Code:
    """Straight code under construction.

    `taken` names stand for something else; a set is shared. In `ruled` code equations with declared
    derivatives stay together, as differentiation needs it.
    """

    def __init__(self, taken: Iterable[str] = (), *, ruled: bool = False) -> None:
        self.items: list[Item] = []
        self.taken: set[str] = taken if isinstance(taken, set) else {*taken, *RESERVED}
        self.ruled = ruled
        self.names: dict[str, Function] = {}  # Generated functions that texts of it call.
        self.origins: dict[str, str] = {}  # Equation that each name comes from.
        self.under_way: list[Parsed] = []  # Equations that are being read.

    def fresh(self, stem: str) -> str:
        """A name that is not yet taken."""
        stem = stem.replace(".", "_")
        name = fresh_name(f"value_{stem}" if stem[0].isdigit() else stem, self.taken)
        if self.under_way:
            self.origins[name] = self.under_way[-1].name
        return name

    def named(self, value: Value, stem: str) -> Value:
        """A value with a name for each of its scalars that is more than a name or a number."""
        nodes = []
        for path, node in leaves(value):
            if node.op not in ex.LEAVES:
                name = self.fresh("_".join(filter(None, (stem, path))) or "value")
                self.items.append(Let(name, node))
                node = ex.name(name, node.kind)
            nodes.append(node)
        return rebuilt(value, iter(nodes))

    def aside(self, read: Callable[[], R]) -> tuple[list[Item], R]:
        """What is read, with the items that it takes, which are not done here."""
        outer, self.items = self.items, []
        try:
            value = read()
            return self.items, value
        finally:
            self.items = outer

    def kept(self, wanted: Iterable[Node]) -> list[Item]:
        """Items that some results need."""
        return live(self.items, _reads(wanted))

    def reads(self, wanted: Iterable[Node]) -> set[str]:
        """Names from outside that some results need, decisions included."""
        needed = _reads(wanted)
        live(self.items, needed)
        return needed


# --- arguments of equations -----------------------------------------------------------------------


def arguments(
    source: Parsed, options: Mapping[str, Any], lengths: Mapping[str, int]
) -> dict[str, Value]:
    """Values of an equation's arguments from its annotations, each scalar a name by its path."""
    try:
        hints = hints_of(source.function)
    except NameError as error:
        raise EquationError(
            f"{source.file}, line {source.node.lineno}: the types of {source.name} are not all "
            f"known ({error}): define them above, at the top of the file."
        ) from None
    said = dict(_said(options.items(), ""))
    names = [each.arg for each in source.arguments]
    return {name: _argument(hints[name], name, name, said, lengths) for name in names}


def _said(options: Iterable[tuple[str, Any]], prefix: str) -> Iterator[tuple[str, Any]]:
    """Values of options, and of all below those that are tuples, by their paths."""
    for name, value in options:
        yield f"{prefix}{name}", value
        if isinstance(value, tuple):
            fields = getattr(value, "_fields", map(str, range(len(value))))
            yield from _said(zip(fields, value, strict=True), f"{prefix}{name}.")


def _argument(
    hint: Any, path: str, text: str, options: Mapping[str, Any], lengths: Mapping[str, int]
) -> Value:
    """Value of an argument, or of what is at a path below one, called `text` in Python."""
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if hint in (float, int, bool):
        return ex.name(text, hint.__name__)
    if origin is typing.Annotated:
        return _argument(args[0], path, text, options, lengths)
    if origin in (typing.Union, types.UnionType) and type(None) in args:
        value = options.get(path, "unknown")
        if value is False or not isinstance(value, bool | int | float | tuple | str | None):
            raise EquationError(
                f"The option {path} is {value!r}: options are None (off) or True (on)."
            )
        (inner,) = (each for each in args if each is not type(None))
        if value is None or value == "unknown" or inner is bool:
            return Flag(value, path)
        return _argument(inner, path, text, options, lengths)
    if is_named_tuple(hint):
        hints = typing.get_type_hints(hint, include_extras=True)
        below = [(hints.get(f, float), f"{path}.{f}", f"{text}.{f}") for f in hint._fields]
        return Tuple(hint, tuple(_argument(*each, options, lengths) for each in below))
    if origin is tuple:
        if len(args) == 2 and args[1] is Ellipsis:
            if path not in lengths:
                raise EquationError(
                    f"{path} is a tuple of unknown length: say lengths={{'{path}': 3}}, or how "
                    "many elements it has."
                )
            args = (args[0],) * lengths[path]
        below = [(each, f"{path}.{i}", f"{text}[{i}]") for i, each in enumerate(args)]
        return Tuple(None, tuple(_argument(*each, options, lengths) for each in below))
    raise EquationError(
        f"{path} of type {hint} cannot be an argument of an equation: it takes float, int, bool, "
        "bool | None for an option, tuples and named tuples of them."
    )
