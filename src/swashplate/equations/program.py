"""An equation as a program: scalars of one value each, options decided, calls resolved.

Named tuples have come apart into scalars, loops are unrolled, a second value of a name has a
name of its own, and branches on options are gone. What is left are definitions, calls, choices that
merge and forks that do not; derivatives are made from it, and any other language can be.
"""

import types
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from swashplate.equations import expressions as ex
from swashplate.equations.expressions import Node
from swashplate.equations.syntax import Parsed, called, is_named_tuple, parsed
from swashplate.errors import EquationError

# --- values ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Flag:
    """An option: None (off), True (on), or "unknown"."""

    value: Any
    text: str = ""


@dataclass(frozen=True)
class Tuple:
    """A tuple or named tuple of values; `text` where it has a name of its own."""

    cls: Any
    items: "tuple[Value, ...]"
    text: str | None = None

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the items; of a tuple without names their numbers."""
        return self.cls._fields if self.cls else tuple(map(str, range(len(self.items))))


@dataclass(frozen=True)
class Open:
    """A tuple of floats of unknown length."""

    text: str


Value = Node | Flag | Tuple | Open
Shape = Any
"""Hashable: a kind, `Flag`, "open", or a class (or None) with the shapes of its items."""


def shape(value: Value) -> Shape:
    """What a compiler has to know of a value."""
    if isinstance(value, Node):
        return value.kind
    if isinstance(value, Flag):
        return Flag(value.value)
    if isinstance(value, Open):
        return "open"
    return value.cls, tuple(shape(each) for each in value.items)


def argument(of: Shape, path: str) -> Value:
    """A value of a shape that is found at a path."""
    if isinstance(of, str):
        return Open(path) if of == "open" else ex.name(path, of)
    if isinstance(of, Flag):
        return Flag(of.value, path)
    cls, shapes = of
    where = [f"{path}.{f}" for f in cls._fields] if cls else []
    where = where or [f"{path}[{i}]" for i in range(len(shapes))]
    return Tuple(cls, tuple(argument(s, w) for s, w in zip(shapes, where, strict=True)), path)


def leaves(value: Value, path: str = "") -> Iterator[tuple[str, Node]]:
    """All scalars of a value with their dotted paths."""
    if isinstance(value, Node):
        yield path, value
    elif isinstance(value, Tuple):
        for each, item in zip(value.fields, value.items, strict=True):
            yield from leaves(item, f"{path}.{each}" if path else each)


def rebuilt(value: Value, nodes: Iterator[Node]) -> Value:
    """The same structure with other scalars in it."""
    if isinstance(value, Node):
        return next(nodes)
    if isinstance(value, Tuple):
        return Tuple(value.cls, tuple(rebuilt(each, nodes) for each in value.items))
    return value


# --- programs -------------------------------------------------------------------------------------


@dataclass(eq=False)
class Let:
    """A name gets its one value."""

    name: str
    node: Node


@dataclass(eq=False)
class Invoke:
    """Another equation, or a primitive, is called; each scalar of its result gets a name."""

    callee: "Program | Primitive"
    arguments: tuple[Value, ...]
    result: Value
    """Of names."""


@dataclass(eq=False)
class Choice:
    """One of two lists of items is done, and names get their values from it."""

    test: Node
    then: "list[Item]"
    other: "list[Item]"
    merged: list[tuple[str, Node, Node]]


Item = Let | Invoke | Choice


@dataclass(eq=False)
class Fork:
    """The program ends in one of two ways."""

    test: Node
    then: "Body"
    other: "Body"


@dataclass(eq=False)
class Body:
    """Items, then a result or a fork."""

    items: list[Item]
    end: Value | Fork


@dataclass(eq=False)
class Primitive:
    """A function that is known by its rule of differentiation instead of its source.

    Attributes
    ----------
    kind : str
        "root", "interpolate" or "repeated".
    function : object
        What is called.
    inner : Program, optional
        Residual of a root, or what is repeated; its function is then the first argument of the
        call.
    moving : tuple of tuple of str
        Of each scalar of the result the paths of the arguments that it follows.
    result : Value
        Structure of the result.
    """

    kind: str
    function: Any
    inner: "Program | None"
    arguments: tuple[tuple[str, Value], ...]
    moving: tuple[tuple[str, ...], ...] = ()
    result: Value = ex.ONE


@dataclass(eq=False)
class Program:
    """An equation for arguments of known shapes.

    Attributes
    ----------
    source : Parsed
        The equation.
    shapes : tuple
        Of the arguments.
    arguments : tuple of (str, Value)
        Names and values of the arguments, in order.
    body : Body
    result : Value
        Structure of the result.
    moving : tuple of tuple of str
        Of each scalar of the result the paths of the arguments that it follows.
    taken : frozenset of str
        Names of its own.
    rule : equation, optional
        Declared for its derivatives.
    """

    source: Parsed
    shapes: tuple[Shape, ...]
    arguments: tuple[tuple[str, Value], ...]
    body: Body
    result: Value
    moving: tuple[tuple[str, ...], ...] = ()
    taken: frozenset[str] = frozenset()
    rule: Any = None

    @property
    def function(self) -> Any:
        """What is called."""
        return called(self.source.function)


def endings(body: Body) -> Iterator[Value]:
    """All results that a body can end in."""
    if isinstance(body.end, Fork):
        yield from endings(body.end.then)
        yield from endings(body.end.other)
    else:
        yield body.end


def paths(name: str, value: Value) -> list[str]:
    """Dotted paths of an argument's scalars, as `leaves` finds them."""
    return [f"{name}.{p}" if p else name for p, _ in leaves(value)]


def path_of(text: str) -> str:
    """Dotted path of an argument's scalar as equations write it: s[0] is s.0."""
    return text.replace("[", ".").replace("]", "")


def actual(call: "Invoke", path: str) -> Node | None:
    """What a call gives for the scalar at a path of the callee's arguments."""
    first, *rest = path.split(".")
    names = [n for n, _ in call.callee.arguments]
    value: Value = call.arguments[names.index(first)]
    for each in rest:
        if isinstance(value, Open):
            return ex.name(f"{value.text}[{each}]")
        assert isinstance(value, Tuple)
        value = value.items[value.fields.index(each)]
    return value if isinstance(value, Node) else None


def floats(program: Program) -> list[str]:
    """Paths of all floats among a program's arguments."""
    return [
        p
        for n, v in program.arguments
        for p, (_, node) in zip(paths(n, v), leaves(v), strict=True)
        if node.kind == "float"
    ]


# --- shapes of arguments --------------------------------------------------------------------------


def shape_of(hint: Any, path: str, options: dict[str, Any], lengths: dict[str, int]) -> Shape:
    """Shape of an argument from its annotation."""
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if origin is typing.Annotated:
        return shape_of(args[0], path, options, lengths)
    if hint in (float, int, bool):
        return hint.__name__
    if origin in (typing.Union, types.UnionType) and type(None) in args:
        value = _option(path, options)
        inner = [a for a in args if a is not type(None)]
        if value is None or value == "unknown" or inner == [bool]:
            return Flag(value)
        return shape_of(inner[0], path, options, lengths)
    if is_named_tuple(hint):
        hints = typing.get_type_hints(hint, include_extras=True)
        return hint, tuple(
            shape_of(hints.get(f, float), f"{path}.{f}", options, lengths) for f in hint._fields
        )
    if origin is tuple:
        if len(args) == 2 and args[1] is Ellipsis:
            if path not in lengths:
                return "open"
            args = (args[0],) * lengths[path]
        return None, tuple(shape_of(a, f"{path}.{i}", options, lengths) for i, a in enumerate(args))
    raise EquationError(
        f"{path} of type {hint} cannot be an argument of an equation: it takes float, int, bool, "
        "bool | None for an option, tuples and named tuples of them."
    )


def _option(path: str, options: dict[str, Any]) -> Any:
    """Value of an option, said for it or for a tuple that holds it; "unknown" if neither."""
    if path in options:
        return _checked(path, options[path])
    parts = path.split(".")
    for n in range(len(parts) - 1, 0, -1):
        value = options.get(".".join(parts[:n]), "unknown")
        if isinstance(value, str):
            continue
        for each in parts[n:]:
            value = value[int(each)] if each.isdigit() else getattr(value, each)
        return _checked(path, value)
    return "unknown"


def _checked(path: str, value: Any) -> Any:
    if value is None or value is True or type(value) in (float, int) or isinstance(value, tuple):
        return value
    raise EquationError(f"The option {path} is {value!r}: options are None (off) or True (on).")


def shapes_of(function: Any, options: dict[str, Any], lengths: dict[str, int]) -> tuple[Shape, ...]:
    """Shapes of a function's arguments from its annotations."""
    source = parsed(function)
    f = source.function
    free = {
        n: c.cell_contents
        for n, c in zip(f.__code__.co_freevars, f.__closure__ or (), strict=False)
    }
    try:
        hints = typing.get_type_hints(f, None, free or None, include_extras=True)
    except NameError as error:
        raise EquationError(
            f"{source.file}, line {source.node.lineno}: the types of {source.name} are not all "
            f"known ({error}): define them above, at the top of the file."
        ) from None
    return tuple(shape_of(hints[a.arg], a.arg, options, lengths) for a in source.arguments)
