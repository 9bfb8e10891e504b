"""One equation as a function of C."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from swashplate.errors import EquationError
from swashplate.machine.code_generation import (
    Loops,
    Option,
    Trace,
    Value,
    arguments,
    leaves,
    scalar_function,
)
from swashplate.machine.graph import Node, names_in
from swashplate.machine.language import parsed


class EquationInC(NamedTuple):
    """A C function of scalars, made from an equation.

    It returns a single result; several go to where its last arguments point.
    """

    name: str
    text: str
    formals: dict[str, str]
    """Kinds of the arguments that it reads, by path: "float", "int", or "bool", as options are."""
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
        values = arguments(source, None, lengths)
    except EquationError as error:
        where = f"{source.file}, line {source.node.lineno}: {source.name}"
        raise EquationError(f"{where} cannot be written in C: {error}") from None
    returned = trace.call(equation, values)
    read = names_in(node for _, node in leaves(returned))
    names = [node_name for argument in values.values() for node_name in _names(argument)]
    formals = {node.value: node.kind for node in names if node.value in read}
    nodes = [(path, node) for path, node in leaves(returned)]
    name = functions.fresh(source.name)
    targets = [
        (f"result_{path.replace('.', '_')}" if path else "result", node) for path, node in nodes
    ]
    text = scalar_function(functions, name, source, trace.origins, trace.labels, formals, targets)
    paths = {re.sub(r"\[(\d+)\]", r".\1", node_name): kind for node_name, kind in formals.items()}
    return EquationInC(name, text, paths, {path: node.kind for path, node in nodes})


def _names(value: Value) -> list[Node]:
    """All names of an argument, options among them."""
    if isinstance(value, tuple):
        return [node for element in value for node in _names(element)]
    return [value.node if isinstance(value, Option) else value]
