"""Nested named tuples of floats as flat lists of dotted paths, and back."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from operator import attrgetter
from typing import Any, get_type_hints

import numpy as np

from swashplate.equations.syntax import is_named_tuple

_known: dict[Any, tuple[str, ...]] = {}


def floats_of(kind: type[Any]) -> tuple[str, ...]:
    """Dotted paths of all floats below a named tuple, e.g. ``plus.V_dz``, in its order."""
    if kind not in _known:
        _known[kind] = tuple(_paths(kind, ""))
    return _known[kind]


def _paths(kind: type[Any], prefix: str) -> Iterator[str]:
    hints = get_type_hints(kind)
    for name in kind._fields:
        inner = hints[name]
        if is_named_tuple(inner):
            yield from _paths(inner, f"{prefix}{name}.")
        elif inner is float:
            yield f"{prefix}{name}"


def is_real(value: object) -> bool:
    """Whether something is a real number, finite or not."""
    return isinstance(value, int | float | np.integer | np.floating)


def value_at(value: Any, path: str) -> Any:
    """What lies at a dotted path of a nested named tuple."""
    for name in path.split(".") if path else ():
        value = getattr(value, name)
    return value


def numbers_of(value: Any) -> list[float]:
    """All floats of a nested named tuple, in the order of `floats_of`."""
    kind: Any = type(value)
    return [float(each) for each in _reader(kind)(value)]


@cache
def _reader(kind: Any) -> Callable[[Any], tuple[Any, ...]]:
    paths = floats_of(kind)
    if len(paths) < 2:
        return lambda value: tuple(value_at(value, path) for path in paths)
    return attrgetter(*paths)


def made(kind: type[Any], numbers: Mapping[str, float]) -> Any:
    """A nested named tuple from numbers by path; others keep the type's defaults."""
    return _made(kind, numbers, "")


def _made(kind: type[Any], numbers: Mapping[str, float], prefix: str) -> Any:
    hints = get_type_hints(kind)
    defaults = getattr(kind, "_field_defaults", {})
    values = []
    for name in kind._fields:
        path = f"{prefix}{name}"
        if is_named_tuple(hints[name]):
            values.append(_made(hints[name], numbers, f"{path}."))
        elif path in numbers:
            values.append(float(numbers[path]))
        else:
            values.append(defaults[name])
    return kind(*values)
