"""Where a record begins: the states there, with their derivatives by parameters."""

from __future__ import annotations

from typing import NamedTuple

from swashplate.machine.code_generation.functions import generating
from swashplate.machine.code_generation.program import Program, names_of, program_of
from swashplate.machine.code_generation.values import leaves
from swashplate.machine.graph import Node
from swashplate.machine.keeping import cached_on_disk, key_of
from swashplate.machine.marching.part_code import SignalId
from swashplate.machine.marching.sample_code import CodeForm, SampleCode, output_of
from swashplate.machine.model import Model

Moved = tuple[SignalId, str]
"""A state, and the path of the parameter that it is derived by."""


class StartCode(NamedTuple):
    """States at the start with their derivatives, as a program."""

    arguments: tuple[SignalId, ...]
    moves: tuple[Moved, ...]
    """What is derived, by which parameter, in the order of the program's `entries`."""
    program: Program


@generating
def start_code_of(model: Model, form: CodeForm, outputs: tuple[str, ...], start: str) -> StartCode:
    """States that some outputs need where a record begins, ``"rest"`` or ``"steady"``."""
    return cached_on_disk(
        f"{model.name}_start",
        (key_of(model), form, outputs, start),
        lambda: _generated(model, form, outputs, start),
    )


def _generated(model: Model, form: CodeForm, outputs: tuple[str, ...], start: str) -> StartCode:
    """The same, made of the equations."""
    observed = [output_of(model, output)[0] for output in outputs]
    sample_code = SampleCode(model, form, observed)
    outside = {
        name: stored for name, stored in sample_code.outside().items() if stored.kind != "state"
    }
    results: dict[SignalId, Node] = {}
    column_of: dict[str, str] = {}
    begins = {**sample_code.stands_for}
    """What names stand for where the record begins."""
    for part in sample_code.used:
        initial = dict(leaves(part.initial_state(start)))
        begins |= {node: initial[path] for path, node in leaves(part.state)}
        results |= {
            SignalId(part.part, "state", path): initial[path]
            for path in sample_code.carried[part.part]
        }
        column_of |= {
            name: f"{model.prefix(part.part)}{path}" for name, path in part.parameters.items()
        }
    names = names_of([*results.values()], begins)
    moving = [name for name in names if name in column_of]
    program = program_of([*results.values()], moving, begins)
    states = [*results]
    return StartCode(
        tuple(outside[name] for name in names),
        tuple((states[result], column_of[moving[by]]) for result, by in program.entries),
        program,
    )


def started_by(model: Model, part: int, column: str) -> tuple[str, ...]:
    """Paths of a part's states that a column such as ``start.pump.pressure`` sets."""
    prefix = f"start.{model.prefix(part)}"
    if not column.startswith(prefix):
        return ()
    name = column.removeprefix(prefix)
    return model.parts[part].free_start.get(name, (name,))
