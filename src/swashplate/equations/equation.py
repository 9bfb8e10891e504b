"""Equations: pure functions that are compiled into whatever calls them, and known by hashes.

Two equations are the same if their code is, and that of all they call. That hash, not the time of
a file, decides whether machine code kept on disk still holds.
"""

import inspect
import linecache
import math
from collections.abc import Callable, Iterator
from hashlib import blake2b
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, TypeVar

from numba import config, njit

from swashplate.equations.syntax import is_named_tuple, parsed, plain, resolved
from swashplate.errors import EquationError

F = TypeVar("F", bound=Callable[..., Any])

# numba makes its settings from the environment, so that a type checker sees none of them
JIT_OFF = bool(config.DISABLE_JIT)  # type: ignore[attr-defined]
"""Whether nothing is compiled: ``NUMBA_DISABLE_JIT=1``."""
known: dict[Any, None] = {}
"""Plain functions that were given to `inlined`, for when nothing is compiled."""


def inlined(function: F) -> F:
    """Compile a function so that its callers inline it: strict arithmetic, no exceptions.

    Under ``NUMBA_DISABLE_JIT=1`` it is the plain function.
    """
    known[plain(function)] = None
    compiled: Any = njit(forceinline=True, error_model="numpy")(function)
    return compiled  # type: ignore[no-any-return]


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
        The compiled function, inlined by its callers; the plain one is its ``.py_func``. Under
        ``NUMBA_DISABLE_JIT=1`` it is the plain function.

    Raises
    ------
    EquationError
        If there is anything else in it, or its source cannot be read.
    """
    if not str(getattr(function, "__module__", "")).startswith("swashplate."):
        parsed(function)  # the package's own are read when they are needed, and all by its tests
    return inlined(function)


def module_of(function: FunctionType) -> str:
    """Name of a function's module, or of its file where that says more."""
    module = function.__module__ or ""
    return Path(function.__code__.co_filename).name if module == "__main__" else module


def source(function: Any) -> str:
    """Text of an equation, or of a function that was derived from one.

    Parameters
    ----------
    function : equation, Derived or callable
        Whose text.

    Returns
    -------
    str
        Python.
    """
    text = getattr(function, "source", None)
    if isinstance(text, str):
        return text
    try:
        return inspect.getsource(plain(function))
    except (OSError, TypeError):
        raise EquationError(f"{function!r} has no source that could be read.") from None


def remember_text(name: str, text: str) -> str:
    """File name of a generated text under which tracebacks and `inspect` find it."""
    file = f"<derived {name} {blake2b(text.encode(), digest_size=4).hexdigest()}>"
    linecache.cache[file] = (len(text), None, text.splitlines(True), file)
    return file


def equation_of_text(text: str, name: str, names: dict[str, Any]) -> Any:
    """An equation that is known by the text of one function alone, and by what that refers to."""
    file = remember_text(name, text)
    space = {**vars(math), **names}
    exec(compile(text, file, "exec"), space)
    return equation(space[name])


_uncompiled: dict[Any, Any] = {}


def interpreted(function: Any) -> Any:
    """A function and all that it calls as plain Python, for one call where compiling costs more."""
    f = plain(function)
    if not isinstance(f, FunctionType):
        return function
    if f not in _uncompiled:
        space = dict(f.__globals__)
        made = FunctionType(f.__code__, space, f.__name__, f.__defaults__, f.__closure__)
        _uncompiled[f] = made
        for name in dict.fromkeys(_names(f.__code__)):
            if is_function(space.get(name)):
                space[name] = interpreted(space[name])
    return _uncompiled[f]


# --- what a function reaches ----------------------------------------------------------------------


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    yield from code.co_freevars
    for each in code.co_consts:
        if isinstance(each, CodeType):
            yield from _names(each)


def _is_number(thing: Any) -> bool:
    if isinstance(thing, tuple):
        return all(_is_number(each) for each in thing)
    return thing is None or isinstance(thing, bool | int | float | complex | str)


def _is_constant(thing: Any) -> bool:
    return _is_number(thing) or (hasattr(thing, "tobytes") and hasattr(thing, "dtype"))


def is_function(thing: Any) -> bool:
    """Whether something is a function that compiled code can call."""
    return isinstance(plain(thing), FunctionType) and (plain(thing) is not thing or thing in known)


def _reached(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """What a function's own code reads from outside."""
    names = dict.fromkeys(_names(function.__code__))
    for name in names:
        try:
            found = resolved(function, name)
        except NameError:
            continue
        if isinstance(found, ModuleType):
            for attribute in names:
                inner = getattr(found, attribute, None)
                if inner is not None and (is_function(inner) or isinstance(inner, int | float)):
                    yield attribute, inner
        elif is_function(found) or is_named_tuple(found) or _is_constant(found):
            yield name, found
    for hint in function.__annotations__.values():
        if isinstance(hint, str):
            try:
                hint = resolved(function, hint)
            except NameError:
                continue
        if is_named_tuple(hint):
            yield hint.__name__, hint


def closure(function: Any) -> dict[str, Any]:
    """All equations, classes of named tuples and constants that a function reaches, by name.

    Parameters
    ----------
    function : callable
        An equation or a kernel; it is the first entry.

    Returns
    -------
    dict
        Of two things of one name, the second has its module's name before its own.
    """
    found: dict[str, Any] = {plain(function).__name__: function}
    pending: list[Any] = [function]
    while pending:
        thing = pending.pop()
        if is_named_tuple(thing):
            inner = [(h.__name__, h) for h in thing.__annotations__.values() if is_named_tuple(h)]
        else:
            inner = list(_reached(plain(thing)))
        for name, each in inner:
            if any(plain(each) is plain(v) for v in found.values()) and not _is_number(each):
                continue
            if name in found:
                if _is_number(each) and repr(found[name]) == repr(each):
                    continue
                name = f"{getattr(each, '__module__', None) or plain(thing).__module__}.{name}"
            found[name] = each
            if is_function(each) or is_named_tuple(each):
                pending.append(each)
    return found


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
    if is_named_tuple(thing):
        hints = {k: getattr(v, "__name__", str(v)) for k, v in thing.__annotations__.items()}
        return repr((thing.__name__, thing._fields, thing._field_defaults, hints))
    f = plain(thing)
    if isinstance(f, FunctionType):
        options = sorted(map(str, getattr(thing, "targetoptions", {}).items()))
        hints = {k: getattr(v, "__name__", str(v)) for k, v in f.__annotations__.items()}
        return repr(
            (_code(f.__code__, f.__doc__), f.__defaults__, f.__kwdefaults__, options, hints)
        )
    if hasattr(thing, "tobytes"):
        return repr((thing.dtype, thing.shape, blake2b(thing.tobytes()).hexdigest()))
    return repr(thing)


def _code(code: CodeType, doc: str | None) -> tuple[Any, ...]:
    """All of a code object but where it stands and what is said about it."""
    constants = [
        _code(c, None)
        if isinstance(c, CodeType)
        else repr(sorted(map(repr, c)))
        if isinstance(c, frozenset)
        else repr(c)
        for c in code.co_consts
    ]
    if doc is not None and code.co_consts and code.co_consts[0] == doc:
        constants[0] = "None"
    return (
        code.co_code,
        tuple(constants),
        code.co_names,
        code.co_varnames,
        code.co_freevars,
        code.co_argcount,
        code.co_kwonlyargcount,
    )
