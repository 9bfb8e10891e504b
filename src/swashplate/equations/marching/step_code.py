"""Text of one sample, for steppers and for kernels that close loops.

Printed from the graph of the model's equations as Python.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from swashplate.equations import graph
from swashplate.equations.code_generation.printing import function_source
from swashplate.equations.marching.part_code import SignalId
from swashplate.equations.marching.sample_code import CONTEXT_FIELDS, SampleCode, lower
from swashplate.equations.model import Model


def step_source(
    model: Model, signals: Sequence[str], options: Sequence[Any], stored: Sequence[SignalId]
) -> tuple[str, int]:
    """Text of a module of one sample, for steppers and loops, and how many constants it has.

    ``prepare(params, given, h, constants)`` computes constants once. ``step(context)`` shifts the
    newest inputs into the delay lines (a row for each signal, newest first), fills the outputs with
    the numbers of this sample in the order of `stored`, takes the states to the next one, and
    returns the margin of the domain.
    """
    sample_code = SampleCode(model, signals, options, stored)
    row = sample_code.signals.index
    tapped = sorted({row(tap.tap.signal) for part in sample_code.used for tap in part.taps})
    lines = [f"{name} = context.{name}" for name in CONTEXT_FIELDS]
    prepare, ends, count = list[str](), ["worst = inf"], 0
    if tapped:
        lines += ["for j in range(lines.shape[1] - 1, 0, -1):"]
        lines += [f"    lines[{index}, j] = lines[{index}, j - 1]" for index in tapped]
        lines += [f"lines[{index}, 0] = inputs[{index}]" for index in tapped]
    targets = {signal: f"outputs[{index}]" for index, signal in enumerate(stored)}
    for part in sample_code.used:
        ends_of_part = sample_code.ends[part.part]
        ahead, available = sample_code.ahead(part, ends_of_part)
        prepare += ahead
        for node in part.ahead(ends_of_part):
            prepare.append(f"constants[{count}] = {available[node]}")
            lines.append(f"{available[node]} = constants[{count}]")
            count += 1
        sample = sample_code.body(part, targets, available)
        states = sample_code.states(part, sample.following)
        lines += [
            *sample_code.delays(part),
            *sample_code.given(part, sample_code.read(part)),
            *states.load,
        ]
        lines += sample_code.fetched(
            part,
            lambda signal, back: f"lines[{row(signal)}, {back}]",
            lambda signal: f"inputs[{row(signal)}]",
        )
        lines += sample.lines
        if sample.margin:
            lowest = lower(graph.name("worst"), graph.name(sample.margin))
            compared = sample_code.printed(part, [lowest])
            ends += [*compared.lines, f"worst = {compared.texts[0]}"]
        ends += [*states.step, *states.save]
    prepared = function_source(
        "prepare(params, given, h, constants)",
        f"Constants of {model.name}.",
        [*prepare, "return"],
    )
    stepped = function_source(
        "step(context)",
        f"One sample of {model.name}.",
        [*lines, *ends, "return worst"],
        "@inlined",
    )
    return sample_code.module(prepared, stepped), count
