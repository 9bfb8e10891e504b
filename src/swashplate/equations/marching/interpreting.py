"""Marches without compiled code: each sample's graph is evaluated by Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, isnan
from typing import Any

from swashplate.equations import graph
from swashplate.equations.code_generation.evaluation import evaluated
from swashplate.equations.code_generation.values import leaves
from swashplate.equations.graph import Node
from swashplate.equations.marching.part_code import PartCode, SignalId
from swashplate.equations.marching.sample_code import SampleCode


class InterpretedMarch:
    """The march of one set, see `march.march_text`."""

    def __init__(
        self,
        sample_code: SampleCode,
        targets: Mapping[SignalId, int],
        further: Mapping[SignalId, int],
        *,
        whole: bool,
    ) -> None:
        self._sample_code, self._targets, self._further = sample_code, targets, further
        self._whole = whole

    def __call__(
        self,
        count: int,
        first: int,
        h: float,
        records: Sequence[Any],
        before: Any,
        delay_samples: Any,
        delay_fraction: Any,
        params: Any,
        given: Any,
        states: Any,
        worst_margin: Any,
        flat: Any,
    ) -> None:
        """March; the arguments are those of `kernels.KERNEL_ARGUMENTS`."""
        sample_code = self._sample_code
        constant: dict[Node, Any] = {graph.name("h"): h}
        places = {kind: sample_code.model.places(kind) for kind in ("parameters", "given", "state")}
        state_at: dict[Node, tuple[int, Node]] = {}
        for part in sample_code.used:
            for numbers, kind, array in (
                (part.p, "parameters", params),
                (part.given, "given", given),
            ):
                for path, node in leaves(numbers):
                    constant[node] = float(array[places[kind].index((part.part, path))])
            for tap in part.taps:
                fraction = graph.name(part.delay_fraction(tap))
                constant[fraction] = float(delay_fraction[tap.number])
            names, following = dict(leaves(part.state)), dict(leaves(part.following))
            for path in sample_code.carried[part.part]:
                place = places["state"].index((part.part, path))
                state_at[names[path]] = (place, following[path])
        kept = {**self._targets, **(self._further if worst_margin[1] != 0.0 else {})}
        state = {node: float(states[place]) for node, (place, _) in state_at.items()}
        margins: list[float] = []
        for n in range(first, first + count):
            known = constant | state
            for part in sample_code.used:
                known |= self._inputs(part, n, records, before, delay_samples)
                for source, node in sample_code.sources.items():
                    if source.part == part.part:
                        (known[graph.name(part.source(source))],) = evaluated([node], known)
                if part.margin is not None:
                    margins += evaluated([part.margin], known)
            for signal, row in kept.items():
                place = row * count + n - first if self._whole else row + n - first
                flat[place] = self._observed(signal, known)
            ends = [node for _, node in state_at.values()]
            state = dict(zip(state_at, map(float, evaluated(ends, known)), strict=True))
        for node, (place, _) in state_at.items():
            states[place] = state[node]
        worst = min((margin for margin in margins if not isnan(margin)), default=inf)
        if worst > 0.0 and any(map(isnan, margins)):
            worst = float("nan")
        if worst < worst_margin[0] or isnan(worst):
            worst_margin[0] = worst

    def _inputs(
        self, part: PartCode, n: int, records: Sequence[Any], before: Any, delay_samples: Any
    ) -> dict[Node, float]:
        """What a part reads of records at sample n."""
        signals = self._sample_code.signals
        known = dict[Node, float]()
        for tap in part.taps:
            index = signals.index(tap.tap.signal)
            for age, name in enumerate(part.tap_samples(tap)):
                at = n - int(delay_samples[tap.number]) - age
                known[graph.name(name)] = float(records[index][at] if at >= 0 else before[index])
        for name in part.part_model.input_types:
            signal = part.part_model.tap(name).signal
            if signal in signals:
                known[graph.name(f"x_{signal}")] = float(records[signals.index(signal)][n])
        return known

    def _observed(self, signal: SignalId, known: dict[Node, Any]) -> float:
        part = self._sample_code.parts[signal.part]
        if signal.kind != "limits":
            (value,) = evaluated([self._sample_code.observed(part, signal)], known)
            return float(value)
        tests = evaluated(part.limits, known)
        return float(sum(1 << bit for bit, test in enumerate(tests) if test))
