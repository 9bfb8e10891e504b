"""Values of an equation that is run on symbols: scalars, options, and tuples of them."""

from __future__ import annotations

import types
import typing
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from swashplate.equations import graph
from swashplate.equations.graph import Node
from swashplate.equations.language import Parsed, hints_of, is_named_tuple
from swashplate.errors import EquationError


@dataclass(frozen=True)
class Flag:
    """An option: None (off), True (on), "unknown", or the node that decides it at run time."""

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
        for field, element in zip(value.fields, value.items, strict=True):
            yield from leaves(element, f"{path}.{field}" if path else field)


def rebuilt(value: Value, nodes: Iterator[Node]) -> Value:
    """The same structure with other scalars in it."""
    if isinstance(value, Tuple):
        return Tuple(value.cls, tuple(rebuilt(item, nodes) for item in value.items))
    return next(nodes) if isinstance(value, Node) else value


def alike(first: Value, second: Value) -> bool:
    """Whether two values can be one: whole numbers are numbers."""
    if isinstance(first, Node) and isinstance(second, Node):
        return first.kind == second.kind or {first.kind, second.kind} == {"int", "float"}
    if isinstance(first, Tuple) and isinstance(second, Tuple):
        same = first.cls is second.cls and len(first.items) == len(second.items)
        return same and all(map(alike, first.items, second.items))
    return isinstance(first, Flag) and isinstance(second, Flag) and first.value == second.value


def fixed(value: Any) -> Value | None:
    """The value of something that does not change: options, numbers, tuples of them."""
    if isinstance(value, Node | Flag | Tuple):
        return value
    if value is None or value is True:
        return Flag(value)
    if isinstance(value, int | float):
        return graph.number(value)
    if isinstance(value, tuple):
        elements = [element for element in map(fixed, value) if element is not None]
        kind = type(value) if is_named_tuple(type(value)) else None
        return Tuple(kind, tuple(elements)) if len(elements) == len(value) else None
    return None


# --- arguments of equations -----------------------------------------------------------------------


def arguments(
    source: Parsed, options: Mapping[str, Any] | None, lengths: Mapping[str, int]
) -> dict[str, Value]:
    """Values of an equation's arguments from its annotations, each scalar a name by its path.

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
            fields = getattr(value, "_fields", map(str, range(len(value))))
            yield from _options_by_path(zip(fields, value, strict=True), f"{prefix}{name}.")


def undecided(hint: Any, path: str, text: str) -> Flag:
    """An option that is decided at run time, by a name."""
    if set(typing.get_args(hint)) != {bool, type(None)}:
        raise EquationError(
            f"{path} is of type {getattr(hint, '__name__', hint)}, but an option that is decided "
            "at run time is bool | None."
        )
    return Flag(graph.name(text, "bool"), path)


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
        value = options.get(path, "unknown")
        if value is False or not isinstance(value, bool | int | float | tuple | str | None):
            raise EquationError(
                f"The option {path} is {value!r}: options are None (off) or True (on)."
            )
        (inner,) = (member for member in args if member is not type(None))
        if value is None or value == "unknown" or inner is bool:
            return Flag(value, path)
        return _argument(inner, path, text, options, lengths)
    if origin in (typing.Union, types.UnionType) and all(map(is_named_tuple, args)):
        # whichever has what the equation reads; by itself it takes the first
        return _argument(args[0], path, text, options, lengths)
    if is_named_tuple(hint):
        hints = typing.get_type_hints(hint, include_extras=True)
        below = [
            (hints.get(field, float), f"{path}.{field}", f"{text}.{field}")
            for field in hint._fields
        ]
        return Tuple(hint, tuple(_argument(*member, options, lengths) for member in below))
    if origin is tuple:
        if len(args) == 2 and args[1] is Ellipsis:
            if path not in lengths:
                raise EquationError(
                    f"{path} is a tuple of unknown length: say lengths={{'{path}': 3}}, or how "
                    "many elements it has."
                )
            args = (args[0],) * lengths[path]
        below = [
            (member, f"{path}.{index}", f"{text}[{index}]") for index, member in enumerate(args)
        ]
        return Tuple(None, tuple(_argument(*member, options, lengths) for member in below))
    raise EquationError(
        f"{path} of type {hint} cannot be an argument of an equation: it takes float, int, bool, "
        "bool | None for an option, tuples and named tuples of them."
    )
