"""One step of a model with its derivatives by states and inputs: what a linear model is made of."""

from __future__ import annotations

from typing import Any, NamedTuple

from swashplate.equations import graph
from swashplate.equations.code_generation.functions import generating
from swashplate.equations.code_generation.gradients import Derived, derived_function
from swashplate.equations.code_generation.values import leaves
from swashplate.equations.graph import Node, names_in, rewritten
from swashplate.equations.keeping import cached_on_disk, key_of
from swashplate.equations.marching.part_code import SignalId
from swashplate.equations.marching.sample_code import SampleCode
from swashplate.equations.model import Model


class StepDerivatives(NamedTuple):
    """Next states of a model, then what is outputs of it, with their derivatives."""

    arguments: dict[str, SignalId]
    """What the function takes, by name."""
    derived: Derived
    """By all states and samples of inputs among them."""


@generating
def step_derivatives(
    model: Model, signals: tuple[str, ...], options: tuple[Any, ...], outputs: tuple[SignalId, ...]
) -> StepDerivatives:
    """A model's next states, then its `outputs`, with their derivatives."""
    return cached_on_disk(
        f"{model.name}_linear",
        (key_of(model), signals, options, outputs),
        lambda: _derived(model, signals, options, outputs),
    )


def _derived(
    model: Model, signals: tuple[str, ...], options: tuple[Any, ...], outputs: tuple[SignalId, ...]
) -> StepDerivatives:
    """The same, made of the equations."""
    states = [SignalId(part_index, "state", path) for part_index, path in model.places("state")]
    sample_code = SampleCode(model, signals, options, [*states, *outputs])
    results = list[Node]()
    labels = dict[Node, str]()
    passed: dict[Node, Node] = {}
    """What the names of signals between parts stand for."""
    for part in sample_code.used:
        results += rewritten([node for _, node in leaves(part.following)], passed)
        for source, node in sample_code.sources.items():
            if source.part == part.part:
                passed[graph.name(part.source(source))] = rewritten([node], passed)[0]
        labels |= part.trace.labels
    for signal in outputs:
        part = sample_code.parts[signal.part]
        results += rewritten([sample_code.observed(part, signal)], passed)
    outside = sample_code.outside()
    arguments = {name: outside[name] for name in sorted(names_in(results) & outside.keys())}
    moving = [
        name for name, signal in arguments.items() if signal.kind in ("state", "tap", "input")
    ]
    derived = derived_function(
        f"{model.name}_linear",
        f"Next states and outputs of {model.name}.",
        [*arguments],
        [(str(index), node) for index, node in enumerate(results)],
        [(name, name) for name in moving],
        labels,
        chained=True,
    )
    return StepDerivatives(arguments, derived)
