"""Derivatives of equations: from the source of a value, the source of value and partials."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from hashlib import blake2b
from typing import Any, TypeVar

from swashplate.equations.adjoints import Derived, derived_function, listing
from swashplate.equations.code import GENERATING, Code, arguments, leaves
from swashplate.equations.equation import inlined, module_of
from swashplate.equations.reading import RULES, read
from swashplate.equations.syntax import Parsed, parsed, plain

F = TypeVar("F", bound=Callable[..., Any])

_made: dict[Any, Derived] = {}


def declared(function: Any) -> Callable[[F], F]:
    """Declare the derivatives of an equation, where the generated ones would not do.

    Parameters
    ----------
    function : equation
        Whose derivatives they are.

    Returns
    -------
    decorator
        Of an equation with the same arguments that returns the partials by every float among them,
        in order (for several results one result after the other). A literal 0.0 is a structural
        zero.

    Examples
    --------
    >>> @declared(small_arctangent)  # doctest: +SKIP
    ... def _(t: float) -> float:
    ...     return 1.0 / (1.0 + t * t)
    """

    def decorate(rule: F) -> F:
        parsed(rule)
        compiled: F = inlined(rule)
        RULES[plain(function)] = compiled
        _made.clear()
        return compiled

    return decorate


def derive(
    function: Any,
    by: str | tuple[str, ...],
    outputs: str | tuple[str, ...] | None = None,
    options: Mapping[str, Any] | None = None,
    lengths: Mapping[str, int] | None = None,
) -> Derived:
    """Value and partial derivatives of an equation, as a function made from its source.

    Parameters
    ----------
    function : equation
        What is differentiated.
    by : str or tuple of str
        Dotted paths of arguments; a path to a tuple means all floats below it. Without any, the
        function has the values alone, with the options decided.
    outputs : str or tuple of str, optional
        Dotted paths of the wanted results; all if omitted. A single float is called "value".
    options : mapping, optional
        Of argument paths to None or True, or to a tuple of options. Branches on them are decided
        here, so that the structure of zeros is exact.
    lengths : mapping, optional
        Lengths of arguments of type ``tuple[float, ...]``.

    Returns
    -------
    Derived
        All that the equation calls is written out in it.

    Raises
    ------
    EquationError
        If a path is unknown, an option that is tested has no value, or the equation uses what
        equations may not.
    """
    with GENERATING:
        said = [repr(sorted(each.items())) for each in (options or {}, lengths or {})]
        key = (plain(function), by, outputs, *said)
        if key not in _made:
            _made[key] = _derive(function, by, outputs, options or {}, lengths or {})
        return _made[key]


def _derive(
    function: Any,
    by: str | tuple[str, ...],
    outputs: str | tuple[str, ...] | None,
    options: Mapping[str, Any],
    lengths: Mapping[str, int],
) -> Derived:
    source = parsed(function)
    given = arguments(source, options, lengths)
    floats = {
        f"{name}.{path}" if path else name: node.value
        for name, value in given.items()
        for path, node in leaves(value)
        if node.kind == "float"
    }
    inputs = _below(source, floats, (by,) if isinstance(by, str) else by, [*given])
    code = Code(given, ruled=True)
    result = read(code, function, given)
    known = {path or "value": node for path, node in leaves(result)}
    wanted = list(known)
    if outputs is not None:
        wanted = []
        for path in (outputs,) if isinstance(outputs, str) else outputs:
            found = [p for p in known if p == path or p.startswith(f"{path}.")]
            if not found:
                source.refuse(None, f"no result {path}", f"there are {', '.join(known)}")
            wanted += [p for p in found if p not in wanted]
    says = f"{source.name} with its options decided"
    if inputs:
        says = f"{source.name} with its derivatives by {listing(inputs)}"
    where = f"{module_of(source.function)}, line {source.node.lineno}"
    return derived_function(
        _name(source, inputs, outputs, options),
        f"{says} ({where}).",
        _formals(source),
        code,
        [(path, known[path]) for path in wanted],
        [(path, floats[path]) for path in inputs],
        chained=True,
    )


def _below(
    source: Parsed, floats: Mapping[str, str], by: tuple[str, ...], names: list[str]
) -> tuple[str, ...]:
    """Paths of floats below some paths of arguments."""
    out: list[str] = []
    for path in by:
        below = [p for p in floats if p == path or p.startswith(f"{path}.")]
        if not below:
            first = path.split(".")[0]
            offer = [p for p in floats if p.startswith(f"{first}.")] if first in names else names
            said = ", ".join(offer) or "none below it"
            source.refuse(None, f"no float at {path}", f"there are {said}")
        out += [p for p in below if p not in out]
    return tuple(out)


def _name(source: Parsed, inputs: tuple[str, ...], outputs: Any, options: Any) -> str:
    """Name of a derived function: by what, and a short hash unless that says all."""
    label = "_".join(path.rpartition(".")[2] for path in inputs)
    if inputs and len(label) <= 32 and outputs is None and not options:
        return f"{source.name}_by_{label}"
    digest = blake2b(repr((inputs, outputs, options)).encode(), digest_size=3).hexdigest()
    many = label if 0 < len(label) <= 32 else len(inputs)
    return f"{source.name}_by_{many}_{digest}" if inputs else f"{source.name}_decided_{digest}"


def _formals(source: Parsed) -> list[str]:
    """Arguments with their defaults as far as these are numbers, from the end."""
    formals: list[str] = []
    defaults = source.defaults
    for each in reversed(source.arguments):
        value = defaults.get(each.arg, ...)
        plainly = value is None or isinstance(value, bool | int | float)
        defaults = defaults if plainly else {}
        formals.insert(0, f"{each.arg}={value!r}" if each.arg in defaults else each.arg)
    return formals
