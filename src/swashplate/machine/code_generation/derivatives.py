"""Derivatives of single equations, and rules that stand in their place."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from swashplate.machine.code_generation.functions import GENERATING
from swashplate.machine.code_generation.program import Program, program_of
from swashplate.machine.code_generation.tracing import Trace
from swashplate.machine.code_generation.values import Value, arguments, leaves
from swashplate.machine.declaration import RULES, closure_hash, known_equation
from swashplate.machine.language import parsed

F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True, eq=False, repr=False)
class Derived:
    """An equation that gives its values, then its partial derivatives, as one flat tuple.

    Attributes
    ----------
    outputs, inputs : tuple of str
        Dotted paths of the results, and of what they are differentiated by.
    entries : tuple of (int, int)
        Numbers of output and input of each partial derivative that is not structurally zero, in
        the order in which they follow the values.
    """

    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    entries: tuple[tuple[int, int], ...]
    names: tuple[str, ...]
    """The equation's arguments."""
    places: tuple[tuple[str, str], ...]
    """Argument and path of each number that the program takes."""
    program: Program

    def __call__(self, *arguments: Any) -> tuple[Any, ...]:
        """Values and derivatives for some arguments of the equation."""
        given = dict(zip(self.names, arguments, strict=True))
        numbers = [_at(given[name], path) for name, path in self.places]
        slopes = self.program.slopes(numbers) if self.entries else None
        partials = () if slopes is None else (float(slopes[entry]) for entry in self.entries)
        return (*self.program.values(numbers), *partials)

    def over(self, *arguments: Any) -> tuple[Any, ...]:
        """Values for arguments that are arrays where the equation has numbers, broadcast."""
        given = dict(zip(self.names, arguments, strict=True))
        return tuple(self.program.over([_at(given[name], path) for name, path in self.places]))


def _at(value: Any, path: str) -> Any:
    """What lies at a dotted path of nested tuples, with names or numbers."""
    for word in path.split(".") if path else ():
        value = value[int(word)] if word.isdigit() else getattr(value, word)
    return value


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
        compiled: F = known_equation(rule)
        RULES[function] = compiled
        _derived_functions.clear()
        return compiled

    return decorate


def derive(
    function: Any,
    by: str | tuple[str, ...],
    options: Mapping[str, Any] | None = None,
    lengths: Mapping[str, int] | None = None,
) -> Derived:
    """Value and partial derivatives of an equation.

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
        It is called as the equation is, and gives one flat tuple.

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
        key = (function, settings, closure_hash(function))
        if key not in _derived_functions:
            values = arguments(parsed(function), options, lengths)
            _derived_functions[key] = _derived(function, by, values)
        return _derived_functions[key]


def _derived(function: Any, by: tuple[str, ...], values: Mapping[str, Value]) -> Derived:
    """What `derive` makes for some arguments."""
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
    nodes = [node for _, node in results]
    places = {
        node.value: (name, path)
        for name, value in values.items()
        for path, node in leaves(value)
        if node.op == "name"
    }
    arguments = sorted(places)
    program = program_of(nodes, [*inputs.values()], arguments=arguments)
    return Derived(
        outputs=tuple(path for path, _ in results),
        inputs=tuple(inputs),
        entries=tuple(program.entries),
        names=tuple(values),
        places=tuple(places[argument] for argument in arguments),
        program=program,
    )
