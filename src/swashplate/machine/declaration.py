"""Equations: pure functions that are compiled into whatever calls them, and known by hashes.

Two equations are the same if their code is, and that of all they call. That hash, not the time of
a file, decides whether machine code kept on disk still holds.
"""

import inspect
import linecache
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from hashlib import blake2b
from itertools import chain, count
from types import CellType, CodeType, FunctionType, MappingProxyType, ModuleType, SimpleNamespace
from typing import Any, TypeVar, get_args
from weakref import WeakKeyDictionary

from swashplate.environment import compiles
from swashplate.errors import EquationError
from swashplate.machine.language import is_named_tuple, parsed, resolved

F = TypeVar("F", bound=Callable[..., Any])

Replacements = Mapping[Any, tuple[Any, ...]]
"""Equations that stand for others, by the plain functions of those: the first of each tuple, and
within it the next."""
NO_REPLACEMENTS: Replacements = MappingProxyType({})

JIT_OFF = not compiles()
"""Whether nothing is compiled: ``SWASHPLATE_COMPILE=0``."""
RULES: WeakKeyDictionary[FunctionType, Any] = WeakKeyDictionary()
"""Equations that return the derivatives of others, see `declared`."""
_NOTHING = object()

_equations: dict[Any, None] = {}


def known_equation(function: F) -> F:
    """Let equations call a function; its text is not looked at."""
    _equations[function] = None
    return function


def equation(function: F) -> F:
    """Make an equation of a pure function of floats and named tuples.

    Parameters
    ----------
    function : callable
        Python runs it once with symbols in the place of numbers: whatever it does with them that
        needs no number, and decisions by them (`if`, `and`, `or`, `not`, conditional expressions).
        It calls other equations, `root`, `interpolate` and `repeated`, `min`, `max`, `abs`,
        functions of `math`, and what of Python counts and orders: `len`, `range`, `zip`,
        `enumerate`, `reversed`, `tuple`. From outside it reads constants. Its arguments have types.

    Returns
    -------
    callable
        The function itself. Models that use it compile it into themselves.

    Raises
    ------
    EquationError
        If it contains a statement that only does something, a loop without a known length or a
        function of its own, or its source cannot be read. Other calls and decisions are refused
        when it is first used.
    """
    if not str(getattr(function, "__module__", "")).startswith("swashplate."):
        parsed(function)  # the package's own are read when they are needed, and all by its tests
    return known_equation(function)


def source(function: Any) -> str:
    """Text of an equation, as it stands in its file.

    Examples
    --------
    >>> from swashplate.machine import source
    >>> from swashplate.machine.library import soft_threshold
    >>> "def soft_threshold" in source(soft_threshold)
    True
    """
    try:
        return inspect.getsource(function)
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
    while chain := replacements.get(function):
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


_with_replacements: dict[tuple[Any, ...], Any] = {}


def with_replacements(function: Any, replacements: Replacements) -> Any:
    """An equation that calls what stands for others, as does all that it calls."""
    function, replacements = standing(function, replacements)
    changed = [(old, chain) for old, chain in replacements.items() if chain]
    if not changed:
        return function
    key = (function, *changed)
    if key not in _with_replacements:
        space = dict(function.__globals__)
        cells = tuple(CellType() for _ in function.__closure__ or ())
        copy = FunctionType(
            function.__code__, space, function.__name__, function.__defaults__, cells or None
        )
        copy.__kwdefaults__ = function.__kwdefaults__
        _with_replacements[key] = copy
        names = dict.fromkeys(_names(function.__code__))
        for name in names:
            if name in space:
                space[name] = _member(space[name], names, replacements)
        for cell, original in zip(cells, function.__closure__ or (), strict=True):
            cell.cell_contents = _member(original.cell_contents, names, replacements)
    return _with_replacements[key]


def forget_replacements() -> None:
    """Have functions with replacements made anew when they are next asked for."""
    _with_replacements.clear()


def _member(member: Any, names: Iterable[str], replacements: Replacements) -> Any:
    """What a function names, with all equations of these names replaced."""
    if is_function(member):
        return with_replacements(member, replacements)
    if not isinstance(member, ModuleType):
        return member
    members = {name: getattr(member, name) for name in names if hasattr(member, name)}
    equations = {
        name: with_replacements(function, replacements)
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
    return isinstance(thing, FunctionType) and thing in _equations


def _reached(thing: Any) -> Any:
    """What of something decides what code does that names it; nothing of most things."""
    known = is_function(thing) or is_named_tuple(thing) or _is_constant(thing)
    return thing if known or isinstance(thing, ModuleType) else _NOTHING


def _referenced(function: Any) -> Iterator[tuple[str, Any]]:
    """Functions, classes of named tuples and constants that a function refers to, by name.

    Those that its code names, and those that the types of its arguments or fields name.
    """
    names: list[str] = []
    if not is_named_tuple(function):
        names = list(dict.fromkeys(_names(function.__code__)))
    for name in names:
        try:
            member = _reached(resolved(function, name))
        except NameError:
            continue
        if isinstance(member, ModuleType):
            yield from _referenced_in(member, names, {member})
        elif member is not _NOTHING:
            yield name, member
    yield from _types_named(function)


def _referenced_in(
    module: ModuleType, names: Iterable[str], visited: set[ModuleType]
) -> Iterator[tuple[str, Any]]:
    """What of these names a module has, or one within it."""
    for name in names:
        value = _reached(getattr(module, name, _NOTHING))
        if isinstance(value, ModuleType):
            if value not in visited:
                yield from _referenced_in(value, names, visited | {value})
        elif value is not _NOTHING:
            yield (name if callable(value) else f"{module.__name__}.{name}"), value


def _types_named(function: Any) -> Iterator[tuple[str, Any]]:
    """Classes of named tuples that types of arguments or fields name, by their names."""
    for hint in function.__annotations__.values():
        if isinstance(hint, str) and not is_named_tuple(function):
            try:
                hint = resolved(function, hint)
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
    members: dict[str, Any] = {function.__name__: function}
    visited = {function}
    pending = [function]
    while pending:
        referring = pending.pop()
        for name, member in _referenced(referring):
            is_constant = not callable(member)
            if not is_constant and member in visited:
                continue
            if name in members:
                if is_constant and _fingerprint(members[name]) == _fingerprint(member):
                    continue
                module = getattr(member, "__module__", None) or referring.__module__
                name = _unused(f"{module}.{name}", members)
            members[name] = member
            if not is_constant:
                visited.add(member)
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
        state = (function, *((old, chain) for old, chain in within.items() if chain))
        if state not in visited:
            visited.add(state)
            plain_functions.add(function)
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
    if isinstance(thing, FunctionType) or is_named_tuple(thing):
        hints = {
            name: getattr(hint, "__name__", str(hint))
            for name, hint in thing.__annotations__.items()
        }
    if is_named_tuple(thing):
        return repr((thing.__name__, thing._fields, thing._field_defaults, hints))
    if isinstance(thing, FunctionType):
        code = _code(thing.__code__, thing.__doc__)
        return repr((code, thing.__defaults__, thing.__kwdefaults__, hints))
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
