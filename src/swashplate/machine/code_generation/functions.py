"""What generates code: names of functions, a lock, and a memory of what was made."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, wraps
from threading import RLock
from time import perf_counter
from typing import Any, ParamSpec, TypeVar

from swashplate.machine.language import CHOICES, MATH

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


def fresh_name(stem: str, used_names: set[str]) -> str:
    """A name that is not yet taken, and is from now on."""
    name, times = stem, 1
    while name in used_names:
        times += 1
        name = f"{stem}_{times}"
    used_names.add(name)
    return name
