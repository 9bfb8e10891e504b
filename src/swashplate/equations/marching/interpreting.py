"""Marches without compiled code: each sample's graph is evaluated by Python."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import inf, isnan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swashplate.equations import graph
from swashplate.equations.code_generation.evaluation import evaluated
from swashplate.equations.code_generation.values import leaves
from swashplate.equations.graph import Node
from swashplate.equations.marching.kernels import MarchArrays
from swashplate.equations.marching.part_code import PartCode, SignalId
from swashplate.equations.marching.rows import Plan
from swashplate.equations.marching.sample_code import SampleCode
from swashplate.equations.marching.tangents import Carried
from swashplate.equations.marching.tangents import delay_slope as delay_slope_of

Array = NDArray[np.float64]


class InterpretedMarch:
    """The march of one set, see `march.march_text`."""

    def __init__(
        self,
        sample_code: SampleCode,
        targets: Mapping[SignalId, int],
        further: Mapping[SignalId, int],
    ) -> None:
        self._sample_code, self._targets, self._further = sample_code, targets, further

    def __call__(self, count: int, first: int, h: float, *arrays: Any) -> None:
        """March; the arguments are those of `kernels.KERNEL_ARGUMENTS`."""
        given = MarchArrays(*arrays)
        kept = {**self._targets, **(self._further if given.worst_margin[1] != 0.0 else {})}

        def keep(n: int, known: dict[Node, Any]) -> None:
            for signal, row in kept.items():
                given.flat[row * count + n - first] = self.observed(signal, known)

        self.run(count, first, h, given, keep)

    def run(
        self,
        count: int,
        first: int,
        h: float,
        arrays: MarchArrays,
        keep: Callable[[int, dict[Node, Any]], None],
    ) -> None:
        """March; `keep` is given the number of each sample, and what is known there."""
        sample_code = self._sample_code
        constant: dict[Node, Any] = {graph.name("h"): h}
        places = {kind: sample_code.model.places(kind) for kind in ("parameters", "given", "state")}
        state_at: dict[Node, tuple[int, Node]] = {}
        for part in sample_code.used:
            for numbers, kind, array in (
                (part.p, "parameters", arrays.params),
                (part.given, "given", arrays.given),
            ):
                for path, node in leaves(numbers):
                    constant[node] = float(array[places[kind].index((part.part, path))])
            for tap in part.taps:
                fraction = graph.name(part.delay_fraction(tap))
                constant[fraction] = float(arrays.delay_fraction[tap.number])
            names, following = dict(leaves(part.state)), dict(leaves(part.following))
            for path in sample_code.carried[part.part]:
                place = places["state"].index((part.part, path))
                state_at[names[path]] = (place, following[path])
        state = {node: float(arrays.states[place]) for node, (place, _) in state_at.items()}
        margins: list[float] = []
        for n in range(first, first + count):
            known = constant | state
            for part in sample_code.used:
                known |= self._inputs(part, n, arrays)
                for source, node in sample_code.sources.items():
                    if source.part == part.part:
                        (known[graph.name(part.source(source))],) = evaluated([node], known)
                if part.margin is not None:
                    margins += evaluated([part.margin], known)
            keep(n, known)
            ends = [node for _, node in state_at.values()]
            state = dict(zip(state_at, map(float, evaluated(ends, known)), strict=True))
        for node, (place, _) in state_at.items():
            arrays.states[place] = state[node]
        worst = min((margin for margin in margins if not isnan(margin)), default=inf)
        if worst > 0.0 and any(map(isnan, margins)):
            worst = float("nan")
        if worst < arrays.worst_margin[0] or isnan(worst):
            arrays.worst_margin[0] = worst

    def _inputs(self, part: PartCode, n: int, arrays: MarchArrays) -> dict[Node, float]:
        """What a part reads of records at sample n."""
        signals = self._sample_code.signals
        known = dict[Node, float]()
        for tap in part.taps:
            index = signals.index(tap.tap.signal)
            for age, name in enumerate(part.tap_samples(tap)):
                at = n - int(arrays.delay_samples[tap.number]) - age
                known[graph.name(name)] = float(
                    arrays.records[index][at] if at >= 0 else arrays.before[index]
                )
        for name in part.part_model.input_types:
            signal = part.part_model.tap(name).signal
            if signal in signals:
                known[graph.name(f"x_{signal}")] = float(arrays.records[signals.index(signal)][n])
        return known

    def observed(self, signal: SignalId, known: dict[Node, Any]) -> float:
        """A number of a sample that is kept: limits as a sum of a bit each."""
        part = self._sample_code.parts[signal.part]
        if signal.kind != "limits":
            (value,) = evaluated([self._sample_code.observed(part, signal)], known)
            return float(value)
        tests = evaluated(part.limits, known)
        return float(sum(1 << bit for bit, test in enumerate(tests) if test))


class InterpretedTangents:
    """The march of one set with derivatives, see `tangents.Tangents`: over a whole record at once.

    It carries them through every node.
    """

    def __init__(
        self,
        sample_code: SampleCode,
        outputs: Sequence[tuple[SignalId, bool]],
        columns: Sequence[str],
        begins: Mapping[SignalId, Any],
    ) -> None:
        self._sample_code, self._outputs = sample_code, outputs
        signals = [signal for signal, _ in outputs]
        self._carried = Carried(sample_code, signals, columns, begins, keep_all=True)
        self.states = self._carried.ids

    def __call__(
        self, size: int, h: float, arrays: MarchArrays, delay_slope: Array, tangent: Array
    ) -> tuple[Array, Array]:
        """(n, r) outputs, and (n, r, k) derivatives; `tangent` are those of the states, (s, k)."""
        march, carried = InterpretedMarch(self._sample_code, {}, {}), self._carried
        count = len(self._outputs)
        values = np.empty((size, count))
        derivatives = np.zeros((size, count, tangent.shape[1]))
        slopes = {delay_slope_of(tap): slope for tap, slope in enumerate(delay_slope.tolist())}
        moving = dict(zip(carried.states, tangent, strict=True))

        def keep(n: int, known: dict[Node, Any]) -> None:
            nonlocal moving
            values[n] = [march.observed(signal, known) for signal, _ in self._outputs]
            known = known | slopes
            now = dict(moving)
            for vertex in carried.vertices:
                total = np.zeros(tangent.shape[1])
                for number, amount in carried.direct[vertex].items():
                    (total[number],) = evaluated([amount], known)
                for operand, contribution in carried.flows[vertex].items():
                    (amount,) = evaluated([contribution.zero_elsewhere], known)
                    if amount and operand in now:
                        total += amount * now[operand]
                now[vertex] = total
            for number, output in enumerate(carried.outputs):
                derivatives[n, number] = now.get(output, 0.0)
            none = np.zeros(tangent.shape[1])
            moving = {
                state: now.get(following, none)
                for state, following in zip(carried.states, carried.following, strict=True)
            }

        with np.errstate(all="ignore"):  # what is not taken may be infinite
            march.run(size, 0, h, arrays, keep)
        for number, (_, integral) in enumerate(self._outputs):
            if integral:
                for rates in (values[:, number], derivatives[:, number]):
                    rates[1:] = np.cumsum(0.5 * h * (rates[:-1] + rates[1:]), axis=0)
                    rates[0] = 0.0
        return values, derivatives


def interpreted_rows(
    plan: Plan,
    outputs: Sequence[int],
    simulated: tuple[Array, Array],
    places: Any,
    offsets: Array,
    offset_rows: Any,
    rows: Array,
) -> None:
    """Fill in weighted rows of the problem, residuals last; see `rows.Sink`."""
    values, derivatives = (np.concatenate([each, each[-1:]]) for each in simulated)
    for r, output in enumerate(outputs):
        stamps = slice(int(plan.first[r]), int(plan.first[r + 1]))
        cell, f, weight = plan.cell[stamps], plan.fraction[stamps], plan.weight[stamps]
        column = derivatives[:, output].T
        rows[places, stamps] = weight * ((1.0 - f) * column[:, cell] + f * column[:, cell + 1])
        for number, row in enumerate(offset_rows):
            if row >= 0:
                rows[row, stamps] = weight if number == r else 0.0
        value = values[:, output]
        error = (1.0 - f) * value[cell] + f * value[cell + 1]
        rows[-1, stamps] = weight * (error - (plan.measured[stamps] - offsets[r]))
