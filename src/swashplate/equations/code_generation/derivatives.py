"""Derivatives of equations: from the source of a value, the source of value and partials."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from hashlib import blake2b
from typing import Any, TypeVar

from swashplate.equations.code_generation.functions import GENERATING
from swashplate.equations.code_generation.gradients import Derived, derived_function, listed
from swashplate.equations.code_generation.tracing import Trace
from swashplate.equations.code_generation.values import Value, arguments, leaves
from swashplate.equations.declaration import RULES, closure_hash, inlined, module_of
from swashplate.equations.language import parsed, plain

F = TypeVar("F", bound=Callable[..., Any])

_derived_functions: dict[Any, Derived] = {}


def declared(function: Any) -> Callable[[F], F]:
    """Declare the derivatives of an equation, if the generated ones do not do.

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
        _derived_functions.clear()
        return compiled

    return decorate


def derive(
    function: Any,
    by: str | tuple[str, ...],
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
    by = (by,) if isinstance(by, str) else by
    options, lengths = dict(options or {}), dict(lengths or {})
    with GENERATING:
        settings = repr((by, sorted(options.items()), sorted(lengths.items())))
        key = (plain(function), settings, closure_hash(function))
        if key not in _derived_functions:
            values = arguments(parsed(function), options, lengths)
            digest = blake2b(settings.encode(), digest_size=3).hexdigest()
            _derived_functions[key] = _derived(
                function, by, values, f"_{digest}" if options else ""
            )
        return _derived_functions[key]


def _derived(function: Any, by: tuple[str, ...], values: Mapping[str, Value], mark: str) -> Derived:
    """What `derive` makes for some arguments; `mark` ends its name."""
    source = parsed(function)
    floats = {
        f"{name}.{path}" if path else name: node.value
        for name, argument in values.items()
        for path, node in leaves(argument)
        if node.kind == "float"
    }
    inputs: dict[str, str] = {}
    for path in by:
        below = {
            below_path: below_name
            for below_path, below_name in floats.items()
            if below_path == path or below_path.startswith(f"{path}.")
        }
        if not below:
            first = path.split(".")[0]
            offer = [*values]
            if first in values:
                offer = [candidate for candidate in floats if candidate.startswith(f"{first}.")]
            offered = ", ".join(offer) or "none below it"
            source.refuse(None, f"no float at {path}", f"there are {offered}")
        inputs |= below
    trace = Trace()
    results = [(path or "value", node) for path, node in leaves(trace.call(function, values))]
    label = "_".join(path.rpartition(".")[2] for path in inputs)
    label = label if len(label) <= 32 else f"{len(inputs)}"
    name = f"{source.name}_by_{label}{mark}" if inputs else f"{source.name}_decided{mark}"
    says = f"derivatives by {listed([*inputs])}" if inputs else "options decided"
    return derived_function(
        name,
        f"{source.name} with its {says} ({module_of(source.function)}, line {source.node.lineno}).",
        [argument.arg for argument in source.arguments],
        results,
        [*inputs.items()],
        trace.labels,
        chained=True,
    )
