"""Marches without compiled code: each sample is a list of steps that Python does."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import inf, isnan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swashplate.machine.code_generation.program import Line, names_of, program_of
from swashplate.machine.code_generation.values import leaves
from swashplate.machine.graph import Node
from swashplate.machine.marching.kernels import MarchArrays
from swashplate.machine.marching.part_code import SignalId, taps_of
from swashplate.machine.marching.rows import Plan
from swashplate.machine.marching.sample_code import SampleCode

Array = NDArray[np.float64]


class _SampleProgram:
    """One sample of a model as a program, and where what it takes is found.

    Its results are the states that follow, the margins, and further ones.
    """

    def __init__(
        self, sample_code: SampleCode, further: Sequence[Node], by: Sequence[str] = ()
    ) -> None:
        self.ids = sample_code.carried_ids
        following = [dict(leaves(sample_code.parts[i].following))[path] for i, _, path in self.ids]
        margins = [part.margin for part in sample_code.used if part.margin is not None]
        self.model, self._signals = sample_code.model, sample_code.signals
        self.states, self.margins = len(following), len(margins)
        late = [sample_code.parts[tap.part].tapped(tap) for tap in sample_code.late]
        self._late = [tap.between for tap in sample_code.late]
        results = [*following, *margins, *further, *late]
        self.arguments = names_of(results, sample_code.stands_for)
        names = [name for name in by if name in self.arguments]
        self.program = program_of(results, names, sample_code.stands_for)
        outside = sample_code.outside()
        self._ids = [outside[name] for name in self.arguments]
        self._taps = {(tap.part, tap.input): tap for tap in taps_of(self.model, self._signals)}
        self.further = self.states + self.margins
        self.ends = self.further + len(further)
        """Where further results begin and end; signals that taps read later come after them."""

    def given(self, h: float, arrays: MarchArrays) -> list[float]:
        """What the program takes, as far as it does not change."""
        return [self._constant(stored, h, arrays) for stored in self._ids]

    def _constant(self, stored: SignalId, h: float, arrays: MarchArrays) -> float:
        part, kind, path = stored
        match kind:
            case "h":
                return h
            case "p" | "given":
                word = "parameters" if kind == "p" else "given"
                array = arrays.params if kind == "p" else arrays.given
                return float(array[self.model.places(word).index((part, path))])
            case "fraction":
                return float(arrays.delay_fraction[int(path)])
        return 0.0

    def moving(self, arrays: MarchArrays) -> list[tuple[int, Callable[[int], float]]]:
        """Place of each number that changes, and what gives it at a sample; states apart."""
        found = list[tuple[int, Callable[[int], float]]]()
        for place, (part, kind, path) in enumerate(self._ids):
            if kind in ("tap", "input"):
                name, _, age = path.partition(".")
                tap = self._taps.get((part, name))
                if tap and tap.between >= 0:
                    signal = len(self._signals) + tap.between
                else:
                    signal = self._signals.index(self.model.parts[part].tap(name).signal)
                back = int(arrays.delay_samples[tap.number]) + int(age) if tap and age else 0
                record, before = arrays.records[signal], arrays.before[signal]
                read = _reader(record, float(before), back)
                found.append((place, _with_past(read) if tap and tap.tap.longest else read))
        return found

    def values(
        self,
        given: list[float],
        n: int,
        arrays: MarchArrays,
        moving: Sequence[tuple[int, Callable[[int], float]]],
    ) -> list[float]:
        """What the program gives at sample n, of which it keeps what taps read later.

        A signal between parts that a tap reads as it is now must be known first: the program runs
        once for each, and once more.
        """
        results: list[float] = []
        for _ in range(len(self._late) + 1):
            for place, read in moving:
                given[place] = read(n)
            results = self.program.values(given)
            for between, value in zip(self._late, results[self.ends :], strict=True):
                arrays.records[len(self._signals) + between][n] = value
        return results

    @property
    def state_places(self) -> list[tuple[int, int]]:
        """Of each argument that is a state its place, and its number among the carried ones."""
        return [
            (place, self.ids.index(stored))
            for place, stored in enumerate(self._ids)
            if stored.kind == "state"
        ]


def _with_past(read: Callable[[int], float]) -> Callable[[int], float]:
    """What gives a record's value that knows those before it."""

    def sample(n: int) -> Line:
        line = Line(read(n))
        line.at = lambda age: read(n - age)
        return line

    return sample


def _reader(record: Any, before: float, back: int) -> Callable[[int], float]:
    """What gives a record's value some samples before, or what it was before its start."""
    return lambda n: float(record[n - back]) if n >= back else before


class InterpretedMarch:
    """The march of one set, see `march.march_text`."""

    def __init__(
        self,
        sample_code: SampleCode,
        targets: Mapping[SignalId, int],
        further: Mapping[SignalId, int],
    ) -> None:
        nodes = list[Node]()
        self._kept = list[tuple[int, int, int, bool]]()
        """Row, first and end of its results, whether it is kept only if everything is."""
        for rows, everything in ((targets, False), (further, True)):
            for signal, row in rows.items():
                part = sample_code.parts[signal.part]
                limits = signal.kind == "limits"
                found = part.limits if limits else [sample_code.observed(part, signal)]
                self._kept.append((row, len(nodes), len(nodes) + len(found), everything))
                nodes += found
        self._limits = {
            row for rows in (targets, further) for s, row in rows.items() if s.kind == "limits"
        }
        self._sample = _SampleProgram(sample_code, nodes)

    def __call__(self, count: int, first: int, h: float, *arrays: Any) -> None:
        """March; the arguments are those of `kernels.KERNEL_ARGUMENTS`."""
        given = MarchArrays(*arrays)
        everything = given.worst_margin[1] != 0.0

        def keep(n: int, numbers: Sequence[float], _: Sequence[float]) -> None:
            for row, begin, end, only in self._kept:
                if not only or everything:
                    values = numbers[begin:end]
                    if row in self._limits:
                        values = [sum(1 << bit for bit, test in enumerate(values) if test)]
                    given.flat[row * count + n - first] = float(values[0])

        marched(self._sample, count, first, h, given, keep)


def marched(
    sample: _SampleProgram,
    count: int,
    first: int,
    h: float,
    arrays: MarchArrays,
    keep: Callable[[int, Sequence[float], Sequence[float]], None],
) -> None:
    """March; `keep` is given each sample's number, its further results, and what it took."""
    model = sample.model
    places = [model.places("state").index((part, path)) for part, _, path in sample.ids]
    given = sample.given(h, arrays)
    moving, state_places = sample.moving(arrays), sample.state_places
    states = [float(arrays.states[place]) for place in places]
    margins: list[float] = []
    for n in range(first, first + count):
        for place, number in state_places:
            given[place] = states[number]
        results = sample.values(given, n, arrays, moving)
        margins += results[sample.states : sample.further]
        keep(n, results[sample.further : sample.ends], given)
        states = [float(state) for state in results[: sample.states]]
    for place, state in zip(places, states, strict=True):
        arrays.states[place] = state
    worst = min((margin for margin in margins if not isnan(margin)), default=inf)
    if worst > 0.0 and any(map(isnan, margins)):
        worst = float("nan")
    if worst < arrays.worst_margin[0] or isnan(worst):
        arrays.worst_margin[0] = worst


class InterpretedTangents:
    """The march of one set with derivatives, see `tangents.Tangents`: over a whole record at once.

    They are carried through every node.
    """

    def __init__(
        self,
        sample_code: SampleCode,
        outputs: Sequence[tuple[SignalId, bool]],
        columns: Sequence[str],
    ) -> None:
        self._outputs = outputs
        nodes = [
            sample_code.observed(sample_code.parts[signal.part], signal) for signal, _ in outputs
        ]
        number_of = {column: number for number, column in enumerate(columns)}
        by = dict[str, tuple[int, int | None]]()
        """Of names the number of the column that they move by, and of the tap whose delay it is."""
        for part in sample_code.used:
            prefix = sample_code.model.prefix(part.part)
            for path, node in leaves(part.p):
                if f"{prefix}{path}" in number_of:
                    by[node.value] = number_of[f"{prefix}{path}"], None
            for tap in part.taps:
                if f"{prefix}{tap.tap.delay}" in number_of:
                    column = number_of[f"{prefix}{tap.tap.delay}"]
                    by[part.delay_fraction(tap)] = column, tap.number
        self.states = sample_code.carried_ids
        names = [dict(leaves(sample_code.parts[i].state))[path].value for i, _, path in self.states]
        self._past = {
            name: (tap, age, number)
            for number, tap in enumerate(sample_code.late)
            for age, name in enumerate(sample_code.parts[tap.part].tap_samples(tap))
        }
        """Of names of past samples their tap, their age, and the number of the signal."""
        self._sample = _SampleProgram(sample_code, nodes, [*names, *by, *self._past])
        self._state_of = {name: number for number, name in enumerate(names)}
        self._column_of = by

    def __call__(
        self,
        size: int,
        h: float,
        arrays: MarchArrays,
        delay_slope: Array,
        tangent: Array,
        start: str,
    ) -> tuple[Array, Array]:
        """(n, r) outputs, and (n, r, k) derivatives; `tangent` are those of the states, (s, k)."""
        sample, count = self._sample, len(self._outputs)
        values = np.empty((size, count))
        derivatives = np.zeros((size, count, tangent.shape[1]))
        moving = tangent.copy()
        by = sample.program.by
        late = len({number for _, _, number in self._past.values()})
        lines = np.zeros((late, size, tangent.shape[1]))

        def past(name: str, n: int) -> Array:
            tap, age, number = self._past[name]
            at = n - int(arrays.delay_samples[tap.number]) - age
            counts = at >= 0 or start == "steady"
            return np.asarray(lines[number, max(at, 0)] if counts else lines[number, 0] * 0.0)

        def keep(n: int, numbers: Sequence[float], given: Sequence[float]) -> None:
            nonlocal moving
            values[n] = numbers
            slopes = sample.program.slopes(given)
            total = np.zeros((len(slopes), tangent.shape[1]))
            for _ in range(late + 1):  # what is read as it is now must be known first
                total[:] = 0.0
                for slope, name in zip(slopes.T, by, strict=True):
                    if name in self._state_of:
                        total += slope[:, None] * moving[self._state_of[name]]
                    elif name in self._past:
                        total += slope[:, None] * past(name, n)
                    else:
                        column, number = self._column_of[name]
                        total[:, column] += slope * (1.0 if number is None else delay_slope[number])
                lines[:, n] = total[sample.ends :]
            moving = total[: sample.states]
            derivatives[n] = total[sample.further : sample.ends]

        with np.errstate(all="ignore"):  # what is not taken may be infinite
            marched(sample, size, 0, h, arrays, keep)
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
        simulated_here = (1.0 - f) * value[cell] + f * value[cell + 1]
        rows[-1, stamps] = weight * (simulated_here - (plan.measured[stamps] - offsets[r]))
