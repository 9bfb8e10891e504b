"""Equations: pure functions that are compiled into whatever calls them, and known by hashes.

Two equations are the same if their code is, and that of all they call. That hash, not the time of
a file, decides whether machine code kept on disk still holds.
"""

import inspect
import linecache
import math
import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from hashlib import blake2b
from itertools import chain, count
from pathlib import Path
from types import CellType, CodeType, FunctionType, MappingProxyType, ModuleType, SimpleNamespace
from typing import Any, TypeVar, get_args
from weakref import WeakKeyDictionary

from swashplate.equations.language import is_named_tuple, parsed, plain, resolved
from swashplate.errors import EquationError

F = TypeVar("F", bound=Callable[..., Any])

Replacements = Mapping[Any, tuple[Any, ...]]
"""Equations that stand for others, by the plain functions of those: the first of each tuple, and
within it the next."""
NO_REPLACEMENTS: Replacements = MappingProxyType({})

JIT_OFF = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
"""Whether nothing is compiled: ``SWASHPLATE_COMPILE=0``."""
RULES: WeakKeyDictionary[FunctionType, Any] = WeakKeyDictionary()
"""Equations that return the derivatives of others, see `declared`."""
compiled_functions: dict[Any, None] = {}
"""Plain functions that were given to `inlined`, for when nothing is compiled."""


TEACHING: list[Callable[[], None]] = []
"""What tells Numba of functions of ours, once it is imported."""


def inlined(function: F) -> F:
    """Have kernels compile a function into themselves: strict arithmetic, no exceptions."""
    compiled_functions[function] = None
    return function


def equation(function: F) -> F:
    """Make an equation of a pure function of floats and named tuples.

    Parameters
    ----------
    function : callable
        Assignments, `if`, loops over a literal range, `return`; arithmetic, comparisons,
        conditional expressions, `min`, `max`, `abs`, functions of `math`, powers with whole
        numbers; fields of named tuples and elements of tuples; other equations, `root`,
        `interpolate` and `repeated`; constants of the module that are numbers. Its arguments have
        types.

    Returns
    -------
    callable
        The function itself. Models and kernels that use it compile it into themselves.

    Raises
    ------
    EquationError
        If there is anything else in it, or its source cannot be read.
    """
    if not str(getattr(function, "__module__", "")).startswith("swashplate."):
        parsed(function)  # the package's own are read when they are needed, and all by its tests
    return inlined(function)


def module_of(function: FunctionType) -> str:
    """Name of a function's module, or of its file if that says more."""
    module = function.__module__ or ""
    return Path(function.__code__.co_filename).name if module == "__main__" else module


def source(function: Any) -> str:
    """Text of an equation, as it stands in its file.

    Examples
    --------
    >>> from swashplate.equations import soft_threshold, source
    >>> "def soft_threshold" in source(soft_threshold)
    True
    """
    try:
        return inspect.getsource(plain(function))
    except (OSError, TypeError):
        raise EquationError(f"{function!r} has no source that can be read.") from None


def remember_text(name: str, text: str) -> str:
    """File name of a generated text under which tracebacks and `inspect` find it."""
    file = f"<derived {name} {blake2b(text.encode(), digest_size=4).hexdigest()}>"
    linecache.cache[file] = (len(text), None, text.splitlines(True), file)
    return file


def equation_of_text(text: str, name: str, names: dict[str, Any]) -> Any:
    """An equation that is known by the text of one function only, and by what that refers to."""
    file = remember_text(name, text)
    space = {**vars(math), **names}
    exec(compile(text, file, "exec"), space)
    return equation(space[name])


# --- equations that stand for others --------------------------------------------------------------


def standing(function: Any, replacements: Replacements) -> tuple[Any, Replacements]:
    """What stands for an equation, itself if nothing does, and the replacements within that.

    An equation does not stand for anything while it is run: it may call what it replaces.
    """
    replacements = _without(function, replacements)
    while chain := replacements.get(plain(function)):
        function = chain[0]
        replacements = _without(function, replacements)
    return function, replacements


def _without(function: Any, replacements: Replacements) -> Replacements:
    """Replacements less those by one equation."""
    if not any(function in chain for chain in replacements.values()):
        return replacements
    return {
        old: tuple(new for new in chain if new is not function)
        for old, chain in replacements.items()
    }


_uncompiled: dict[tuple[Any, ...], Any] = {}


def interpreted(function: Any, replacements: Replacements = NO_REPLACEMENTS) -> Any:
    """A function and all that it calls as plain Python, if compiling would take longer."""
    function, replacements = standing(function, replacements)
    python_function = plain(function)
    if not isinstance(python_function, FunctionType):
        return function
    changed = [(old, chain) for old, chain in replacements.items() if chain]
    key = (python_function, *changed)
    if key not in _uncompiled:
        space = dict(python_function.__globals__)
        cells = tuple(CellType() for _ in python_function.__closure__ or ())
        uncompiled = FunctionType(
            python_function.__code__,
            space,
            python_function.__name__,
            python_function.__defaults__,
            cells or None,
        )
        uncompiled.__kwdefaults__ = python_function.__kwdefaults__
        _uncompiled[key] = uncompiled
        names = dict.fromkeys(_names(python_function.__code__))
        for name in names:
            if name in space:
                space[name] = _interpreted(space[name], names, replacements)
        for cell, original in zip(cells, python_function.__closure__ or (), strict=True):
            cell.cell_contents = _interpreted(original.cell_contents, names, replacements)
    return _uncompiled[key]


def forget_interpreted() -> None:
    """Have functions made anew as plain Python when they are next asked for."""
    _uncompiled.clear()


def _interpreted(member: Any, names: Iterable[str], replacements: Replacements) -> Any:
    """What a function names, with all equations of these names as plain Python."""
    if is_function(member):
        return interpreted(member, replacements)
    if not isinstance(member, ModuleType):
        return member
    members = {name: getattr(member, name) for name in names if hasattr(member, name)}
    equations = {
        name: interpreted(function, replacements)
        for name, function in members.items()
        if is_function(function)
    }
    return SimpleNamespace(**{**vars(member), **equations}) if equations else member


# --- what a function refers to --------------------------------------------------------------------


def _names(code: CodeType) -> Iterator[str]:
    yield from (*code.co_names, *code.co_freevars)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _is_constant(thing: Any) -> bool:
    if isinstance(thing, tuple):
        return all(map(_is_constant, thing))
    number = thing is None or isinstance(thing, bool | int | float | complex | str)
    return number or (hasattr(thing, "tobytes") and hasattr(thing, "dtype"))


def is_function(thing: Any) -> bool:
    """Whether something is a function that compiled code can call."""
    if not isinstance(plain(thing), FunctionType):
        return False
    return plain(thing) is not thing or thing in compiled_functions


def _referenced(function: Any) -> Iterator[tuple[str, Any]]:
    """Functions, classes of named tuples and constants that a function refers to, by name.

    Those that its code names, and those that the types of its arguments or fields name.
    """
    python_function = plain(function)
    names: list[str] = []
    if not is_named_tuple(python_function):
        names = list(dict.fromkeys(_names(python_function.__code__)))
    for name in names:
        try:
            member = resolved(python_function, name)
        except NameError:
            continue
        if isinstance(member, ModuleType):
            for attribute in names:
                value = getattr(member, attribute, member)
                if is_function(value) or is_named_tuple(value):
                    yield attribute, value
                elif _is_constant(value):
                    yield f"{member.__name__}.{attribute}", value
        elif is_function(member) or is_named_tuple(member) or _is_constant(member):
            yield name, member
    yield from _types_named(python_function)


def _types_named(python_function: Any) -> Iterator[tuple[str, Any]]:
    """Classes of named tuples that types of arguments or fields name, by their names."""
    for hint in python_function.__annotations__.values():
        if isinstance(hint, str) and not is_named_tuple(python_function):
            try:
                hint = resolved(python_function, hint)
            except NameError:
                continue
        for kind in (hint, *get_args(hint)):
            if is_named_tuple(kind):
                yield kind.__name__, kind


def closure(function: Any) -> dict[str, Any]:
    """All equations, classes of named tuples and constants that a function reaches, by name.

    The function is the first entry. If two things have the same name, the second has its module's
    name in front.
    """
    members: dict[str, Any] = {plain(function).__name__: function}
    visited = {plain(function)}
    pending = [function]
    while pending:
        referring = pending.pop()
        for name, member in _referenced(referring):
            is_constant = not (is_function(member) or is_named_tuple(member))
            if not is_constant and plain(member) in visited:
                continue
            if name in members:
                if is_constant and _fingerprint(members[name]) == _fingerprint(member):
                    continue
                module = getattr(member, "__module__", None) or plain(referring).__module__
                name = _unused(f"{module}.{name}", members)
            members[name] = member
            if not is_constant:
                visited.add(plain(member))
                pending.append(member)
    return members


def _unused(name: str, members: Collection[str]) -> str:
    """A name that no member has, by a number behind it."""
    names = chain([name], (f"{name} {number}" for number in count(2)))
    return next(unused for unused in names if unused not in members)


def functions_run(functions: Iterable[Any], replacements: Replacements) -> set[FunctionType]:
    """Plain functions of all equations that are run if some are called, these included."""
    plain_functions: set[FunctionType] = set()
    visited = set()
    pending = [(function, replacements) for function in functions]
    while pending:
        function, within = standing(*pending.pop())
        state = (plain(function), *((old, chain) for old, chain in within.items() if chain))
        if state not in visited:
            visited.add(state)
            plain_functions.add(plain(function))
            called = [member for _, member in _referenced(function) if is_function(member)]
            pending += [(member, within) for member in called]
    return plain_functions


def closure_hash(function: Any) -> str:
    """Hash of a function and of all that it reaches; comments and docstrings do not count."""
    return hash_of(closure(function))


def hash_of(things: dict[str, Any]) -> str:
    """Hash of things by name: functions' own code, fields of named tuples, numbers."""
    digest = blake2b(digest_size=16)
    for name in sorted(things):
        digest.update(f"{name}\0{_fingerprint(things[name])}\0".encode())
    return digest.hexdigest()


def _fingerprint(thing: Any) -> str:
    """What of one thing matters to compiled code."""
    python_function = plain(thing)
    if isinstance(python_function, FunctionType) or is_named_tuple(python_function):
        hints = {
            name: getattr(hint, "__name__", str(hint))
            for name, hint in python_function.__annotations__.items()
        }
    if is_named_tuple(python_function):
        kind = python_function
        return repr((kind.__name__, kind._fields, kind._field_defaults, hints))
    if isinstance(python_function, FunctionType):
        options = sorted(map(str, getattr(thing, "targetoptions", {}).items()))
        code = _code(python_function.__code__, python_function.__doc__)
        return repr(
            (code, python_function.__defaults__, python_function.__kwdefaults__, options, hints)
        )
    if hasattr(thing, "tobytes"):
        return repr((thing.dtype, thing.shape, blake2b(thing.tobytes()).hexdigest()))
    return repr(thing)


def _code(code: CodeType, doc: str | None) -> tuple[Any, ...]:
    """All of a code object apart from its place in the file and its docstring."""

    def comparable(constant: Any) -> Any:
        if isinstance(constant, CodeType):
            return _code(constant, None)
        if isinstance(constant, frozenset):
            return repr(sorted(map(repr, constant)))
        return repr(constant)

    constants = [*map(comparable, code.co_consts)]
    if doc is not None and code.co_consts and code.co_consts[0] == doc:
        constants[0] = "None"
    counts = code.co_argcount, code.co_kwonlyargcount
    names = code.co_names, code.co_varnames, code.co_freevars
    return (code.co_code, tuple(constants), *names, *counts)
