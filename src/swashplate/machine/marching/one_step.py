"""One step of a model with its derivatives by states and inputs: what a linear model is made of."""

from __future__ import annotations

from typing import NamedTuple

from swashplate.machine.code_generation.functions import generating
from swashplate.machine.code_generation.program import Program, names_of, program_of
from swashplate.machine.code_generation.values import leaves
from swashplate.machine.graph import Node
from swashplate.machine.keeping import cached_on_disk, key_of
from swashplate.machine.marching.part_code import SignalId
from swashplate.machine.marching.sample_code import CodeForm, SampleCode
from swashplate.machine.model import Model


class StepDerivatives(NamedTuple):
    """Next states of a model, its outputs, and signals of which taps read past samples, derived."""

    arguments: dict[str, SignalId]
    """What the program takes, by name."""
    program: Program
    """Its derivatives are by all states and samples of inputs among the arguments."""
    between: tuple[str, ...]
    """Signals between parts of which taps read past samples."""


@generating
def step_derivatives(
    model: Model, form: CodeForm, outputs: tuple[SignalId, ...]
) -> StepDerivatives:
    """A model's next states, then its `outputs`, then signals that taps read, derived."""
    return cached_on_disk(
        f"{model.name}_linear",
        (key_of(model), form, outputs),
        lambda: _derived(model, form, outputs),
    )


def _derived(model: Model, form: CodeForm, outputs: tuple[SignalId, ...]) -> StepDerivatives:
    """The same, made of the equations."""
    states = [SignalId(part_index, "state", path) for part_index, path in model.places("state")]
    sample_code = SampleCode(model, form, [*states, *outputs])
    results = list[Node]()
    for part in sample_code.used:
        results += [node for _, node in leaves(part.following)]
    results += [sample_code.observed(sample_code.parts[signal.part], signal) for signal in outputs]
    between = dict[str, Node]()
    for tap in sample_code.late:
        between[tap.tap.signal] = sample_code.parts[tap.part].tapped(tap)
    results += between.values()
    outside = sample_code.outside()
    names = names_of(results, sample_code.stands_for)
    moving = [name for name in names if outside[name].kind in ("state", "tap", "input")]
    program = program_of(results, moving, sample_code.stands_for)
    return StepDerivatives({name: outside[name] for name in names}, program, tuple(between))
