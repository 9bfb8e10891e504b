"""One equation as a function of C."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from swashplate.equations.language import parsed
from swashplate.equations.printing_c import Loops, scalar_function
from swashplate.equations.tracing import Trace
from swashplate.equations.values import Flag, Tuple, Value, arguments, leaves
from swashplate.errors import EquationError


class EquationInC(NamedTuple):
    """A C function of scalars, made from an equation.

    It returns a single result; several go to where its last arguments point.
    """

    name: str
    text: str
    formals: dict[str, str]
    """Kinds of its arguments, "float", "int" or "bool", by path; options are "bool"."""
    results: dict[str, str]
    """Kinds of its results by path; of a single number the path is empty."""


def equation_in_c(
    equation: Any, functions: Loops, lengths: Mapping[str, int] = MappingProxyType({})
) -> EquationInC:
    """An equation as a function of C, with its options as arguments.

    Parameters
    ----------
    equation : equation
        What is printed.
    functions : Loops
        Where functions go that it calls.
    lengths : mapping of str to int, optional
        Lengths of tuples whose types leave them open, by path.

    Raises
    ------
    EquationError
        If the equation has no counterpart in C.
    """
    source, trace = parsed(equation), Trace()
    try:
        given = arguments(source, None, lengths)
    except EquationError as error:
        where = f"{source.file}, line {source.node.lineno}: {source.name}"
        raise EquationError(f"{where} cannot be written in C: {error}") from None
    formals = {text: kind for name, value in given.items() for text, kind in _names(value)}
    result = trace.call(equation, given)
    nodes = [(path, node) for path, node in leaves(result)]
    name = functions.fresh(source.name)
    targets = [(f"result_{path.replace('.', '_')}" if path else "result", n) for path, n in nodes]
    text = scalar_function(functions, name, source, trace.origins, trace.labels, formals, targets)
    return EquationInC(name, text, formals, {path: node.kind for path, node in nodes})


def _names(value: Value) -> list[tuple[str, str]]:
    """Texts and kinds of all names of an argument, options among them."""
    if isinstance(value, Tuple):
        return [each for item in value.items for each in _names(item)]
    node = value.value if isinstance(value, Flag) else value
    return [(node.value, node.kind)]
