"""Values of equations: nodes and numbers, options, and tuples of them."""

from __future__ import annotations

import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from swashplate.errors import EquationError
from swashplate.machine import graph
from swashplate.machine.graph import Node
from swashplate.machine.language import Parsed, hints_of, is_named_tuple

Value = Any
"""A node, a number, an option (None, True, `Option`, `NotGiven`), or a tuple of such."""
LARGEST_WHOLE = 2**63
"""Whole numbers from here on are floats: compiled code has none as large."""


@dataclass(frozen=True)
class Option:
    """An option that is decided when the model runs."""

    node: Node
    path: str


@dataclass(frozen=True)
class NotGiven:
    """An option whose value nobody said."""

    path: str


def node_of(value: Any) -> Node | None:
    """A number as a node; None if it is none."""
    if isinstance(value, Node):
        return value
    if isinstance(value, bool | int | float):
        is_whole = abs(value) < LARGEST_WHOLE
        return graph.number(value if is_whole else float(value))
    return None


def fields(value: tuple[Any, ...]) -> Iterable[str]:
    """Names of a tuple's elements; of one without names their numbers."""
    return getattr(value, "_fields", None) or map(str, range(len(value)))


def leaves(value: Value, path: str = "") -> Iterator[tuple[str, Node]]:
    """All numbers of a value as nodes, with their dotted paths."""
    if isinstance(value, tuple):
        for field, element in zip(fields(value), value, strict=True):
            yield from leaves(element, f"{path}.{field}" if path else field)
    elif (node := node_of(value)) is not None:
        yield path, node


def as_tuple(value: tuple[Any, ...], members: Iterable[Any]) -> tuple[Any, ...]:
    """Other members in a tuple, or a named tuple, like this one."""
    make: Any = getattr(type(value), "_make", tuple)
    made: tuple[Any, ...] = make(members)
    return made


def mapped(function: Callable[[Any], Any], value: Value) -> Value:
    """The same tuples with what a function gives for each member."""
    if not isinstance(value, tuple):
        return function(value)
    return as_tuple(value, (mapped(function, member) for member in value))


def rebuilt(value: Value, nodes: Iterator[Node]) -> Value:
    """The same structure with other numbers in it."""
    return mapped(lambda leaf: leaf if node_of(leaf) is None else next(nodes), value)


def alike(first: Value, second: Value) -> bool:
    """Whether two values can be one: whole numbers are numbers."""
    if isinstance(first, tuple) and isinstance(second, tuple):
        same = type(first) is type(second) and len(first) == len(second)
        return same and all(map(alike, first, second))
    first_node, second_node = node_of(first), node_of(second)
    if first_node is None or second_node is None:
        return first_node is second_node and bool(first == second)
    kinds = {first_node.kind, second_node.kind}
    return len(kinds) == 1 or kinds == {"int", "float"}


# --- arguments of equations -----------------------------------------------------------------------


def arguments(
    source: Parsed, options: Mapping[str, Any] | None, lengths: Mapping[str, int]
) -> dict[str, Value]:
    """Values of an equation's arguments from its annotations, each number a name by its path.

    Without `options` these are decided at run time.
    """
    try:
        hints = hints_of(source.function)
    except NameError as error:
        raise EquationError(
            f"{source.file}, line {source.node.lineno}: the types of {source.name} are not all "
            f"known ({error}): define them above, at the top of the file."
        ) from None
    by_path = None if options is None else dict(_options_by_path(options.items(), ""))
    names = [argument.arg for argument in source.arguments]
    return {name: _argument(hints[name], name, name, by_path, lengths) for name in names}


def _options_by_path(options: Iterable[tuple[str, Any]], prefix: str) -> Iterator[tuple[str, Any]]:
    """Values of options, and of all below those that are tuples, by their paths."""
    for name, value in options:
        yield f"{prefix}{name}", value
        if isinstance(value, tuple):
            yield from _options_by_path(zip(fields(value), value, strict=True), f"{prefix}{name}.")


def undecided(hint: Any, path: str, text: str) -> Option:
    """An option that is decided at run time, by a name."""
    if set(typing.get_args(hint)) != {bool, type(None)}:
        raise EquationError(
            f"{path} is of type {getattr(hint, '__name__', hint)}, but an option that is decided "
            "at run time is bool | None."
        )
    return Option(graph.name(text, "bool"), path)


def _argument(
    hint: Any, path: str, text: str, options: Mapping[str, Any] | None, lengths: Mapping[str, int]
) -> Value:
    """Value of an argument, or of what is at a path below one, called `text` in Python."""
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if hint in (float, int, bool):
        return graph.name(text, hint.__name__)
    if origin is typing.Annotated:
        return _argument(args[0], path, text, options, lengths)
    if origin in (typing.Union, types.UnionType) and type(None) in args:
        if options is None:
            return undecided(hint, path, text)
        if path not in options:
            return NotGiven(path)
        value = options[path]
        if value is False or not isinstance(value, bool | int | float | tuple | str | None):
            raise EquationError(
                f"The option {path} is {value!r}: options are None (off) or True (on)."
            )
        (inner,) = (member for member in args if member is not type(None))
        if value is None or inner is bool:
            return value
        return _argument(inner, path, text, options, lengths)
    if origin in (typing.Union, types.UnionType) and all(map(is_named_tuple, args)):
        # whichever has what the equation reads; by itself it takes the first
        return _argument(args[0], path, text, options, lengths)
    if is_named_tuple(hint):
        hints = typing.get_type_hints(hint, include_extras=True)
        return hint._make(
            _argument(
                hints.get(field, float), f"{path}.{field}", f"{text}.{field}", options, lengths
            )
            for field in hint._fields
        )
    if origin is tuple:
        if len(args) == 2 and args[1] is Ellipsis:
            if path not in lengths:
                raise EquationError(
                    f"{path} is a tuple of unknown length: say lengths={{'{path}': 3}}, or how "
                    "many elements it has."
                )
            args = (args[0],) * lengths[path]
        return tuple(
            _argument(member, f"{path}.{index}", f"{text}[{index}]", options, lengths)
            for index, member in enumerate(args)
        )
    raise EquationError(
        f"{path} of type {hint} cannot be an argument of an equation: it takes float, int, bool, "
        "bool | None for an option, tuples and named tuples of them."
    )
