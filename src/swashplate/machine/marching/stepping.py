"""One sample of a model, compiled, for loops in Python."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from ctypes import CFUNCTYPE, c_void_p
from functools import partial
from math import ceil
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.machine.code_generation.functions import generating
from swashplate.machine.code_generation.machine_code import address_of, code_of_text
from swashplate.machine.declaration import JIT_OFF
from swashplate.machine.keeping import cached_on_disk, key_of
from swashplate.machine.marching.derivatives import OLDEST
from swashplate.machine.marching.interpreting import InterpretedMarch
from swashplate.machine.marching.kernels import FLOATS, INTS
from swashplate.machine.marching.march import step_texts
from swashplate.machine.marching.part_code import SignalId
from swashplate.machine.marching.run import (
    Machine,
    Start,
    check_domain,
    check_outputs,
)
from swashplate.machine.marching.sample_code import CodeForm, SampleCode, output_of
from swashplate.machine.model import Model, full_name

Array = NDArray[np.float64]


class StepContext(NamedTuple):
    """What a step takes in a loop: a model's numbers, and all that it remembers."""

    inputs: Array
    """Newest sample of each input; the loop sets them before each step."""
    outputs: Array
    """Outputs at that sample, filled by the step."""
    states: Array
    lines: Array
    """Past samples of the inputs, a row each, then of signals between parts, for the delays."""
    position: NDArray[np.int64]
    """Where the next one goes, and how many samples delays look back."""
    records: NDArray[np.int64]
    """Addresses of the rows of these."""
    before: Array
    delay_samples: NDArray[np.int64]
    """Whole samples of each tap's delay."""
    delay_fraction: Array
    """What its delay has besides, as a fraction of a sample."""
    params: Array
    given: Array
    constants: Array
    margin: Array
    """Margin of the model's domain at the newest sample, first."""
    h: float
    """[s]"""
    code: Any
    """Address of the step; without compiled code the step itself."""

    words: NDArray[np.int64]
    """All that the step takes, as words: numbers and addresses of the arrays."""

    def copied(self) -> StepContext:
        """A copy that remembers for itself: both go on from here independently."""
        lines = self.lines.copy()
        return self._replace(
            inputs=self.inputs.copy(),
            outputs=self.outputs.copy(),
            states=self.states.copy(),
            lines=lines,
            position=self.position.copy(),
            records=_rows_of(lines),
            margin=self.margin.copy(),
        ).bound()

    def bound(self) -> StepContext:
        """The context with the words of its own arrays."""
        numbers = [self.lines.shape[1], 0, int(np.float64(self.h).view(np.int64))]
        addresses = [getattr(self, name).ctypes.data for name in STEP_ARRAYS]
        return self._replace(words=np.array([*numbers, *addresses], dtype=np.int64))


def _rows_of(lines: Array) -> NDArray[np.int64]:
    """Addresses of the rows."""
    first, row = lines.ctypes.data, lines.strides[0]
    return np.array([first + row * number for number in range(len(lines))], dtype=np.int64)


STEP_ARRAYS = (
    *("records", "before", "delay_samples", "delay_fraction", "params", "given", "states"),
    *("margin", "outputs", "inputs", "constants", "position"),
)
"""Fields of a context that a step is given after its step, see `march.STEP_ARGUMENTS`."""
PREPARE_KINDS = ("float", *(FLOATS,) * 4)
"""Kinds of the arguments of `march.PREPARE_ARGUMENTS`."""
_STEP = CFUNCTYPE(None, c_void_p)
ROOM = 500
"""Least number of samples that are put behind each other before they are moved."""


def bound_step(context: StepContext) -> Callable[[], None]:
    """What runs the step of a context again and again, which must be kept meanwhile."""
    if not isinstance(context.code, int):
        return partial(context.code, context)
    return partial(_STEP(context.code), address_of(context.words))


class _InterpretedStep:
    """A step without compiled code."""

    def __init__(self, sample_code: SampleCode, stored: Sequence[SignalId]) -> None:
        targets = {signal: place for place, signal in enumerate(stored)}
        self._march = InterpretedMarch(sample_code, targets, {})

    def __call__(self, context: StepContext) -> None:
        """Take the model to the next sample."""
        at, longest = context.position
        if at == context.lines.shape[1]:
            context.lines[:, :longest] = context.lines[:, at - longest :]
            at = longest
        context.lines[: context.inputs.size, at] = context.inputs
        context.position[0] = at + 1
        margin = np.array([np.inf, 0.0])
        self._march(
            1,
            int(at),
            context.h,
            context.lines,
            context.before,
            context.delay_samples,
            context.delay_fraction,
            context.params,
            context.given,
            context.states,
            margin,
            context.outputs,
        )
        context.margin[0] = margin[0]


@generating
def _step_of(model: Model, form: CodeForm, stored: tuple[SignalId, ...]) -> tuple[Any, Any, int]:
    """What computes a model's constants, its step, and how many constants there are."""
    if JIT_OFF:
        sample_code = SampleCode(model, form, stored)
        return lambda *_: None, _InterpretedStep(sample_code, stored), 0
    prepare, text, count = cached_on_disk(
        f"{model.name}_step",
        (key_of(model), form, stored),
        lambda: step_texts(model, form, stored),
    )
    constants = code_of_text(f"{model.name}_constants", prepare, PREPARE_KINDS)
    # what comes from memory is not there in pairs: packed, a step takes 1.6 times as long
    code = code_of_text(f"{model.name}_step", text, (INTS,), pack=False)
    return constants, code.address, count


class CompiledStep:
    """A model's compiled step: one sample, with the numbers of `simulate` to the last bit.

    Attributes
    ----------
    inputs, outputs : tuple of str
        Names, in the arrays' order.
    """

    def __init__(
        self, instance: Machine, inputs: Sequence[str], stored: Sequence[SignalId], h: float
    ) -> None:
        instance.check_step(h)
        self._instance = instance
        self._h = h
        self._stored = tuple(stored)
        self.inputs = tuple(full_name(name, instance.model.external) for name in inputs)
        self.outputs = tuple(signal.path or signal.kind for signal in stored)
        instance.check_inputs(self.inputs)
        self._prepare, self._code, self._count = _step_of(
            instance.model, instance.form(self.inputs), tuple(stored)
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
        self._prepare(self._h, delays.fraction, instance.params, instance.given, constants)
        longest = int(delays.samples.max(initial=0)) + OLDEST
        longest += ceil(instance.longest_past(self.inputs) / self._h)
        initial = instance.start(values, self._h, start)
        before = np.array([*initial.before.values(), *initial.between.values()])
        lines = np.tile(before[:, None], longest + max(ROOM, longest))
        return StepContext(
            inputs=newest,
            outputs=np.zeros(len(self.outputs)),
            states=initial.flat,
            lines=lines,
            position=np.array([longest, longest]),
            records=_rows_of(lines),
            before=np.zeros(len(before)),
            delay_samples=delays.samples,
            delay_fraction=delays.fraction,
            params=instance.params,
            given=instance.given,
            constants=constants,
            margin=np.full(2, np.inf),
            h=self._h,
            code=self._code,
            words=np.zeros(0, dtype=np.int64),
        ).bound()

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


def stored_of(model: Model, outputs: Sequence[str]) -> tuple[SignalId, ...]:
    """Where the outputs of a step come from.

    ``"limits"`` are of the last part that has any, ``"hoist.limits"`` of the last one of a member.
    """
    ids = []
    limited = [index for index, part in enumerate(model.parts) if part.limits is not None]
    for output in outputs:
        member, _, last = f".{output}".rpartition(".")
        has_limits = [
            index for index in limited if f".{model.parts[index].path}.".startswith(f"{member}.")
        ]
        if last == "limits" and has_limits:
            ids.append(SignalId(has_limits[-1], "limits"))
            continue
        stored, integral = output_of(model, output)
        if integral:
            raise InputError(
                f"{output} is the integral of {stored.path}, which is not known within a step: use "
                f"{stored.path} and integrate it in the loop."
            )
        ids.append(stored)
    return tuple(ids)
