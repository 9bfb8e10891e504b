"""One sample of a model, compiled, for kernels that close loops around models.

Examples
--------
>>> valve = compiled_step(model, Valve(0.05, 0.1), ("command",), ("position",), rate=512.0)
>>> step = valve.step
>>> @kernel
... def positioned(context, target, path):
...     worst = inf
...     for n in range(path.size):
...         context.inputs[0] = 5.0 * (target - context.outputs[0])
...         worst = min(worst, step(context))
...         path[n] = context.outputs[0]
...     return worst
>>> context = valve.context()
>>> valve.check(context, positioned(context, 0.2, path))
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.code_generation.functions import generating
from swashplate.equations.keeping import cached_on_disk, key_of
from swashplate.equations.marching.part_code import SignalId
from swashplate.equations.marching.record import check_rate
from swashplate.equations.marching.run import (
    Instance,
    Start,
    check_domain,
    check_outputs,
    instance_of,
    module,
)
from swashplate.equations.marching.sample_code import output_of
from swashplate.equations.marching.step_code import step_source
from swashplate.equations.model import Model
from swashplate.errors import InputError

Array = NDArray[np.float64]


class StepContext(NamedTuple):
    """What a compiled step takes in a loop: a model's numbers, and all that it remembers."""

    inputs: Array
    """Newest sample of each input; the loop sets them before each step."""
    outputs: Array
    """Outputs at that sample, filled by the step."""
    states: Array
    lines: Array
    """Past samples of the inputs, newest first, for the delays."""
    delay_samples: NDArray[np.int64]
    """Whole samples of each tap's delay."""
    delay_fraction: Array
    """What its delay has besides, as a fraction of a sample."""
    params: Array
    given: Array
    constants: Array
    h: float
    """[s]"""

    def copied(self) -> StepContext:
        """A copy that remembers for itself: both go on from here independently."""
        return self._replace(
            inputs=self.inputs.copy(),
            outputs=self.outputs.copy(),
            states=self.states.copy(),
            lines=self.lines.copy(),
        )


@generating
def _kernels(
    model: Model, inputs: tuple[str, ...], options: tuple[Any, ...], stored: tuple[SignalId, ...]
) -> tuple[Callable[..., None], Callable[[StepContext], float], int]:
    """Compiled constants of a model, its step, and how many constants there are."""
    text, count = cached_on_disk(
        f"{model.name}_step",
        (key_of(model), inputs, options, stored),
        lambda: step_source(model, inputs, options, stored),
    )
    functions = module(f"{model.name}_step", text)
    return functions["prepare"], functions["step"], count


class CompiledStep:
    """A model's compiled step: one sample, for kernels that close loops around it.

    Made by `compiled_step`, and for drives by `Drive.compiled_step`.

    Attributes
    ----------
    step : callable
        ``step(context) -> margin``: reads ``context.inputs``, fills ``context.outputs`` with the
        same sample, takes the state to the next one, and returns the margin of the model's domain.
        A `kernel` that calls it inlines it; numbers are those of `simulate` to the last bit.
    inputs, outputs : tuple of str
        Names, in the arrays' order.
    """

    def __init__(
        self, instance: Instance, inputs: Sequence[str], stored: Sequence[SignalId], h: float
    ) -> None:
        self._instance = instance
        self._h = h
        self._stored = tuple(stored)
        self.inputs = tuple(inputs)
        self.outputs = tuple(signal.path or signal.kind for signal in stored)
        instance.check_inputs(self.inputs)
        self._prepare, self.step, self._count = _kernels(
            instance.model, self.inputs, instance.options, tuple(stored)
        )

    def __repr__(self) -> str:
        return (
            f"CompiledStep({self._instance.name!r}, {', '.join(self.inputs)} -> "
            f"{', '.join(self.outputs)}, {1.0 / self._h:g} Hz)"
        )

    def context(
        self, first: Mapping[str, float] | None = None, start: Start = "rest"
    ) -> StepContext:
        """A context at its start: at rest, or settled under the `first` inputs (default: 0)."""
        instance = self._instance
        first = first or {}
        values = {name: float(first.get(name, 0.0)) for name in self.inputs}
        newest = np.array([*values.values()])
        delays = instance.tap_delays(self.inputs, self._h)
        constants = np.zeros(self._count)
        self._prepare(instance.params, instance.given, self._h, constants)
        longest = int(delays.samples.max(initial=0))
        lines = np.zeros((len(self.inputs), longest + 3))
        if start == "steady":
            lines[:] = newest[:, None]
        return StepContext(
            inputs=newest,
            outputs=np.zeros(len(self.outputs)),
            states=instance.start(values, self._h, start).flat,
            lines=lines,
            delay_samples=delays.samples,
            delay_fraction=delays.fraction,
            params=instance.params,
            given=instance.given,
            constants=constants,
            h=self._h,
        )

    def check(self, context: StepContext, margin: float, cause: str = "input") -> None:
        """Refuse what a loop has computed outside the model's equations.

        `context` is as the loop has left it, `margin` the least that the steps have returned, and
        `cause` what has driven the model, for the sentence.

        Raises
        ------
        DomainError
            If the margin is not above 0, or a number of the state or of the newest outputs is not
            finite.
        """
        check_domain(self._instance, context.states, margin, cause)
        check_outputs(self._instance, self._stored, context.outputs, self._h, cause)


def compiled_step(
    model: Model,
    p: Any,
    inputs: Sequence[str],
    outputs: Sequence[str],
    rate: float,
    *,
    options: Any = None,
    given: Any = None,
) -> CompiledStep:
    """Compiled step of a user-defined model, for kernels that close loops around it.

    Parameters
    ----------
    model, p, options, given :
        As in `simulate`.
    inputs, outputs : sequence of str
        Signals that the loop gives and takes; inputs with a default parameter may be left out.
        ``"limits"`` as an output are the acting limits of the last part that has any, a bit each.
    rate : float
        Samples a second. [Hz]

    Raises
    ------
    InputError
        For numbers that do not fit the model, and signals that it does not have.
    """
    check_rate(rate)
    instance = instance_of(model, p, options=options, given=given)
    return CompiledStep(instance, inputs, stored_of(model, outputs), 1.0 / rate)


def stored_of(model: Model, outputs: Sequence[str]) -> tuple[SignalId, ...]:
    """Where the outputs of a step come from; ``"limits"`` of the last part that has any."""
    ids = []
    limited = [index for index, part in enumerate(model.parts) if part.limits is not None]
    for output in outputs:
        if output == "limits" and limited:
            ids.append(SignalId(limited[-1], "limits"))
            continue
        stored, integral = output_of(model, output)
        if integral:
            raise InputError(
                f"{output} is the integral of {stored.path}, which is not known within a step: use "
                f"{stored.path} and integrate it in the loop."
            )
        ids.append(stored)
    return tuple(ids)
