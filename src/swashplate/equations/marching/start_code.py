"""Where a record begins: the states there, with their derivatives by parameters."""

from __future__ import annotations

from typing import Any, NamedTuple

from swashplate.equations import graph
from swashplate.equations.code_generation.functions import generating
from swashplate.equations.code_generation.gradients import Derived, derived_function
from swashplate.equations.code_generation.values import leaves
from swashplate.equations.graph import Node, names_in, rewritten
from swashplate.equations.keeping import cached_on_disk, key_of
from swashplate.equations.marching.part_code import SignalId
from swashplate.equations.marching.sample_code import SampleCode, output_of
from swashplate.equations.model import Model

Moved = tuple[SignalId, str]
"""A state, and the path of the parameter that it is derived by."""


class StartCode(NamedTuple):
    """States at the start with their derivatives, as a function of scalars."""

    arguments: tuple[SignalId, ...]
    moves: tuple[Moved, ...]
    """What is derived, by which parameter: the last numbers that `derived` gives."""
    derived: Derived


@generating
def start_code_of(
    model: Model,
    signals: tuple[str, ...],
    options: tuple[Any, ...],
    outputs: tuple[str, ...],
    start: str,
) -> StartCode:
    """States that some outputs need where a record begins, ``"rest"`` or ``"steady"``."""
    return cached_on_disk(
        f"{model.name}_start",
        (key_of(model), signals, options, outputs, start),
        lambda: _generated(model, signals, options, outputs, start),
    )


def _generated(
    model: Model,
    signals: tuple[str, ...],
    options: tuple[Any, ...],
    outputs: tuple[str, ...],
    start: str,
) -> StartCode:
    """The same, made of the equations."""
    observed = [output_of(model, output)[0] for output in outputs]
    sample_code = SampleCode(model, signals, options, observed)
    outside = {
        name: stored for name, stored in sample_code.outside().items() if stored.kind != "state"
    }
    results: dict[SignalId, Node] = {}
    column_of: dict[str, str] = {}
    begins: dict[Node, Node] = {}
    """What names stand for where the record begins."""
    labels: dict[Node, str] = {}
    for part in sample_code.used:
        prefix = model.prefix(part.part)
        initial = dict(leaves(part.initial_state(start)))
        states = dict(leaves(part.state))
        starts = dict(zip(initial, rewritten(initial.values(), begins), strict=True))
        begins |= {states[path]: node for path, node in starts.items()}
        sources = {
            graph.name(part.source(source)): node
            for source, node in sample_code.sources.items()
            if source.part == part.part
        }
        begins |= dict(zip(sources, rewritten(sources.values(), begins), strict=True))
        results |= {
            SignalId(part.part, "state", path): starts[path]
            for path in sample_code.carried[part.part]
        }
        column_of |= {name: f"{prefix}{path}" for name, path in part.parameters.items()}
        labels |= part.trace.labels
    arguments = sorted(names_in(results.values()) & outside.keys())
    moving = [name for name in arguments if name in column_of]
    derived = derived_function(
        f"{model.name}_start",
        f"States of {model.name} at the start.",
        arguments,
        [("_".join(map(str, key)), node) for key, node in results.items()],
        [(name, name) for name in moving],
        labels,
        chained=True,
    )
    keys = [*results]
    moves = tuple(
        (keys[result], column_of[moving[argument]]) for result, argument in derived.entries
    )
    return StartCode(tuple(outside[name] for name in arguments), moves, derived)


def started_by(model: Model, part: int, column: str) -> tuple[str, ...]:
    """Paths of a part's states that a column such as ``start.pump.pressure`` sets."""
    prefix = f"start.{model.prefix(part)}"
    if not column.startswith(prefix):
        return ()
    name = column.removeprefix(prefix)
    return model.parts[part].free_start.get(name, (name,))
