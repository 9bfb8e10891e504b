"""Generated functions: their texts, and what makes and remembers them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from functools import cached_property, lru_cache, wraps
from threading import RLock
from time import perf_counter
from typing import Any, ParamSpec, TypeVar

from swashplate.equations.declaration import inlined, interpreted, remember_text
from swashplate.equations.language import CHOICES, MATH

P = ParamSpec("P")
R = TypeVar("R")

GENERATING = RLock()
"""Held while equations are read or code is written: nodes are compared by identity."""


FUNCTIONS: dict[str, Any] = {name: function for function, name in [*MATH.items(), *CHOICES.items()]}
"""Functions that generated texts call, by name."""
RESERVED = {*FUNCTIONS, "inf", "nan", "range", "int", "float", "None", "True", "False"}
"""Names that generated texts must not give to values."""


_clock = {"depth": 0.0, "seconds": 0.0}
_memories: list[Any] = []
"""What remembers things that were generated."""


def generating(function: Callable[P, R]) -> Callable[P, R]:
    """Remember what a function generates, and let one thread at a time do so."""
    remembered = lru_cache(maxsize=256)(function)
    _memories.append(remembered)

    @wraps(function)
    def locked(*args: P.args, **kwargs: P.kwargs) -> R:
        with GENERATING:
            start = perf_counter()
            _clock["depth"] += 1.0
            try:
                return remembered(*args, **kwargs)  # type: ignore[arg-type]
            finally:
                _clock["depth"] -= 1.0
                if not _clock["depth"]:
                    _clock["seconds"] += perf_counter() - start

    return locked


def forget_generated() -> None:
    """Have everything generated anew when it is next asked for."""
    with GENERATING:
        for memory in _memories:
            memory.cache_clear()


def generating_time() -> float:
    """Time for which this process read equations, wrote code, and loaded or compiled it. [s]"""
    return _clock["seconds"]


@dataclass(frozen=True, eq=False, repr=False)
class Function:
    """A generated function: its name, its text, and what that refers to."""

    name: str
    source: str
    names: dict[str, Function] = field(default_factory=dict)
    """Generated functions that it calls."""

    def __reduce__(self) -> tuple[Any, ...]:
        """As it was made, without what is compiled."""
        return type(self), tuple(getattr(self, attribute.name) for attribute in fields(self))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r})"

    @property
    def texts(self) -> dict[str, str]:
        """Texts of this function and of all that it calls, those first, by name."""
        texts: dict[str, str] = {}
        for function in self.names.values():
            texts |= function.texts
        return texts | {self.name: self.source}

    @cached_property
    def python(self) -> Callable[..., Any]:
        """The function, as plain Python throughout."""
        library = {name: interpreted(function) for name, function in FUNCTIONS.items()}
        called = {name: function.python for name, function in self.names.items()}
        function: Callable[..., Any] = self._executed({**library, **called})
        return function

    @cached_property
    def compiled(self) -> Any:
        """The function, compiled so that callers inline it."""
        called = {name: function.compiled for name, function in self.names.items()}
        return inlined(self._executed({**FUNCTIONS, **called}))

    def _executed(self, space: dict[str, Any]) -> Any:
        file = remember_text(self.name, self.source)
        space |= {"inf": math.inf, "nan": math.nan}
        exec(compile(self.source, file, "exec"), space)
        return space[self.name]


def fresh_name(stem: str, used_names: set[str]) -> str:
    """A name that is not yet taken, and is from now on."""
    name, times = stem, 1
    while name in used_names:
        times += 1
        name = f"{stem}_{times}"
    used_names.add(name)
    return name
