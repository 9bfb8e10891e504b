"""Many sets of one model side by side: LANES of them in one march of wide numbers.

Each set's numbers are the same to the last bit as in the march of it alone, whatever its neighbours
are.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.machine import graph
from swashplate.machine.code_generation.functions import generating
from swashplate.machine.code_generation.llvm import Code, computed_from
from swashplate.machine.code_generation.machine_code import code_of_text
from swashplate.machine.code_generation.program import program_of
from swashplate.machine.code_generation.scheduling import VECTOR
from swashplate.machine.code_generation.values import leaves
from swashplate.machine.declaration import JIT_OFF
from swashplate.machine.fields import member_at
from swashplate.machine.graph import Node, names_in
from swashplate.machine.keeping import cached_on_disk, key_of
from swashplate.machine.marching.interpreting import InterpretedMarch
from swashplate.machine.marching.kernels import FLOATS, INTS, pointers
from swashplate.machine.marching.march import HALF, ZERO, March, numbers_known
from swashplate.machine.marching.part_code import SignalId, signals_between, taps_of
from swashplate.machine.marching.sample_code import CodeForm, SampleCode, output_of
from swashplate.machine.model import Model

Array = NDArray[np.float64]

LANES = 16
"""Sets marched side by side: two vectors of eight if the processor has them, else four of four."""

REST = (("double", "h"), ("ptr", "params"), ("ptr", "given"), ("ptr", "states"))
"""Arguments of what computes states at rest; arrays have a number for each lane."""
REST_KINDS = ("float", FLOATS, FLOATS, FLOATS)
MARCH = (
    ("i64", "count"),
    ("double", "h"),
    ("i64", "length"),
    ("ptr", "records"),
    ("ptr", "delay_samples"),
    ("ptr", "delay_fraction"),
    ("ptr", "params"),
    ("ptr", "given"),
    ("ptr", "states"),
    ("ptr", "measured"),
    ("ptr", "weight"),
    ("ptr", "worst"),
    ("ptr", "cost"),
    ("ptr", "outputs"),
)
"""Of a march: samples, step, length of a row of the outputs, 0 without any, and arrays."""
MARCH_KINDS = ("int", "float", "int", f"*{FLOATS}", INTS, *(FLOATS,) * 9)


def vectorisation_report(model: Model, output: str | None = None, *, options: Any = None) -> str:
    """What keeps many sets of a model from being marched side by side in vector instructions.

    Parameters
    ----------
    model : Model
        A single model, or a joined one.
    output : str, optional
        Signal to return; by default the last that the model names.
    options : named tuple, optional
        Its options; all off if omitted.

    Returns
    -------
    str
        A line for each operation that is done set by set, with the equation that it stands in, or a
        sentence if there is none. `simulate_many` works in both cases, but slower in the first.
    """
    signals = list[str]()
    options_of_parts = list[Any]()
    calls = dict[str, None]()
    for index, part in enumerate(model.parts):
        outside = [name for name in part.input_types if model.link_of(index, name) is None]
        signals += [part.tap(name).signal for name in outside if name not in part.defaults]
        own_options = member_at(options, part.path) if model.is_joined else options
        if own_options is None and part.options is not None:
            own_options = part.options()
        options_of_parts.append(own_options)
    last = model.parts[-1]
    names = (*model.outputs, *map(last.full, last.outputs)) or model.last_signals
    signal, _ = output_of(model, output or names[-1])
    sample_code = SampleCode(model, CodeForm(tuple(signals), tuple(options_of_parts)), [signal])
    for used in sample_code.used:
        ends = sample_code.ends[used.part]
        constant = {*used.ahead(ends, used.delay_fractions)}
        for node in graph.ordered(ends, constant, computed_from):
            if node.op not in VECTOR:
                source = used.trace.origins.get(node)
                where = used.part_model.name if source is None else source.name
                calls[f"{where} calls {_called(node)}"] = None
    if not calls:
        return f"Nothing keeps {model.name} from vector instructions."
    return "\n".join([f"{model.name} is not all vector instructions:", *calls])


def _called(node: Node) -> str:
    """What a node calls, as a user would say it."""
    if node.op != "call":
        return node.op
    word = {"root": "root_of_", "repeated": "repeated_"}.get(node.value.loop.kind, "")
    return f"{word}{node.value.loop.inner.name}"


class Marched(NamedTuple):
    """Results of LANES sets."""

    cost: Array
    """(LANES,) sum of weighted squared errors."""
    worst: Array
    """(LANES,) worst margin of the domain, infinite without one."""
    end: Array
    """(LANES,) a sum that is finite if all numbers are."""
    outputs: Array
    """(LANES, n) the output, or (LANES, 0)."""


def rest_text(sample_code: SampleCode) -> str:
    """Text of what computes states at rest."""
    code = Code(REST, LANES)
    places = sample_code.model.places("state")
    initial = {
        places.index((part.part, path)): node
        for part in sample_code.used
        for path, node in leaves(part.initial_state())
        if path in sample_code.carried[part.part]
    }
    read = names_in(initial.values())
    known = numbers_known(sample_code, code, lambda _: read)
    for place, text in zip(initial, code.floats(initial.values(), known), strict=True):
        code.store(text, "%states", place * LANES)
    return code.text


def lanes_text(sample_code: SampleCode, signal: SignalId, *, integral: bool) -> str:
    """Text of the march of LANES sets over one record, for one signal or its integral."""
    code = Code(MARCH, LANES)
    march = March(sample_code, code, first="0")
    zero = code.constant(0.0)
    cost, rate, total = (code.variable(zero) for _ in range(3))
    with code.loop("0", "%count") as n:
        known = march.sample(n)
        value = march.observed(signal, known)
        if integral:
            inside = code.put(f"icmp sgt i64 {n}, 0")
            half = code.put(f"fmul double {HALF}, %h")
            half = code.put(f"select i1 {inside}, double {half}, double {ZERO}")
            both = code.put(f"fadd {code.number} {code.load(rate)}, {value}")
            added = code.put(f"fmul {code.number} {code.in_all_lanes(half)}, {both}")
            code.store(value, rate)
            value = code.put(f"fadd {code.number} {code.load(total)}, {added}")
            code.store(value, total)
        target = code.in_all_lanes(code.load("%measured", n, "double"))
        counts = code.in_all_lanes(code.load("%weight", n, "double"))
        error = code.put(f"fsub {code.number} {value}, {target}")
        square = code.put(f"fmul {code.number} {counts}, {error}")
        square = code.put(f"fmul {code.number} {square}, {error}")
        code.store(code.put(f"fadd {code.number} {code.load(cost)}, {square}"), cost)
        with code.only_if(code.put("icmp sgt i64 %length, 0")):
            for lane in range(LANES):
                place = code.put(f"mul i64 %length, {lane}")
                place = code.put(f"add i64 {place}, {n}")
                code.store(code.element(value, lane), "%outputs", place, "double")
        march.step(known)
    code.store(march.end(), "%worst")
    code.store(code.load(cost), "%cost")
    return code.text


class Lanes:
    """The march of LANES sets of a model over one record, for one output."""

    def __init__(self, model: Model, form: CodeForm, output: str) -> None:
        self._model = model
        self._taps = taps_of(model, form.signals)
        self._signal, self._integral = output_of(model, output)
        if JIT_OFF:
            self._interpreted = SampleCode(model, form, [self._signal])
            return

        def texts() -> tuple[str, str]:
            sample_code = SampleCode(model, form, [self._signal])
            return rest_text(sample_code), self._text(sample_code)

        key = (key_of(model), form, output)
        rest, march = cached_on_disk(f"{model.name}_lanes", key, texts)
        self._rest = code_of_text(f"{model.name}_rest", rest, REST_KINDS)
        self._march = code_of_text(f"{model.name}_lanes", march, MARCH_KINDS)

    def __call__(
        self,
        numbers: Mapping[str, Array],
        records: Mapping[str, Array],
        h: float,
        *,
        measured: Array,
        weight: Array,
        keep: bool,
    ) -> Marched:
        """March LANES sets over one record, from rest but for what the numbers say.

        `numbers` has (LANES,) values of every parameter by its path, and every given, ``"given "``
        before it; parameters that a type has a default for may be left out. States at the first
        sample, ``"start."`` before their paths, where they are not those at rest. The output is
        compared with (n,) `measured` values under the `weight` of each squared error.
        """
        params, given = (self._numbers(kind, numbers) for kind in ("parameters", "given"))
        delay_samples, delay_fraction = self._delays(numbers, h)
        state_places = self._model.places("state")
        states = np.zeros((len(state_places), LANES))
        starts = {
            row: numbers[name]
            for row, (part, path) in enumerate(state_places)
            if (name := f"start.{self._model.prefix(part)}{path}") in numbers
        }
        worst, cost = np.empty(LANES), np.zeros(LANES)
        size = measured.size
        # rows an odd number of cache lines apart, so that they do not share places in a cache
        outputs = np.empty((LANES, (size | 15) + 9 if keep else 0))
        values = tuple(map(np.ascontiguousarray, records.values()))
        values += tuple(np.empty(size * LANES) for _ in signals_between(self._model))
        measured, weight = np.ascontiguousarray(measured), np.ascontiguousarray(weight)
        rest, march = self._functions
        rest(h, params, given, states)
        for row, start in starts.items():
            states[row] = start
        march(
            size,
            h,
            outputs.shape[1],
            pointers(values),
            delay_samples,
            delay_fraction,
            params,
            given,
            states,
            measured,
            weight,
            worst,
            cost,
            outputs,
        )
        return Marched(cost, worst, cost + states.sum(axis=0), outputs[:, :size])

    def _text(self, sample_code: SampleCode) -> str:
        return lanes_text(sample_code, self._signal, integral=self._integral)

    def _numbers(self, kind: str, numbers: Mapping[str, Array]) -> Array:
        """(r, LANES) parameters or givens."""
        places, word = self._model.places(kind), "given " if kind == "given" else ""
        rows = np.zeros((len(places), LANES))
        for row, (index, path) in zip(rows, places, strict=True):
            part = self._model.parts[index]
            name = f"{word}{self._model.prefix(index)}{path}"
            if name in numbers:
                row[:] = numbers[name]
            elif kind == "parameters":
                row[:] = part.parameters._field_defaults.get(path, np.nan)
        return rows

    def _delays(self, numbers: Mapping[str, Array], h: float) -> tuple[NDArray[np.int64], Array]:
        """(t, LANES) whole samples and fractions of the delays of all taps."""
        samples = np.zeros((len(self._taps), LANES), dtype=np.int64)
        fraction = np.zeros((len(self._taps), LANES))
        for tap in self._taps:
            delay = tap.tap.delay
            path = f"{self._model.prefix(tap.part)}{delay}"
            steps = numbers[path] / h if delay else np.zeros(LANES)
            end = np.maximum(steps, tap.tap.ahead) - tap.tap.ahead
            samples[tap.number] = np.floor(end) + tap.tap.late
            fraction[tap.number] = end - np.floor(end)
        return samples, fraction

    @property
    def _functions(self) -> tuple[Any, Any]:
        if JIT_OFF:
            return self._interpreted_rest, self._interpreted_march
        return self._rest, self._march

    # -- without compiled code ---------------------------------------------------------------------

    def _interpreted_rest(self, h: float, params: Array, given: Array, states: Array) -> None:
        sample_code, places = self._interpreted, self._model.places("state")
        begins = {
            (part.part, path): node
            for part in sample_code.used
            for path, node in leaves(part.initial_state())
            if path in sample_code.carried[part.part]
        }
        program = program_of([*begins.values()])
        outside = sample_code.outside()
        for lane in range(LANES):
            numbers = [
                self._number(outside[name], h, params[:, lane], given[:, lane])
                for name in program.arguments
            ]
            for place, value in zip(begins, program.values(numbers), strict=True):
                states[places.index(place), lane] = value

    def _number(self, stored: SignalId, h: float, params: Array, given: Array) -> float:
        if stored.kind == "h":
            return h
        kind, array = ("parameters", params) if stored.kind == "p" else ("given", given)
        return float(array[self._model.places(kind).index((stored.part, stored.path))])

    def _interpreted_march(self, count: int, h: float, *others: Any) -> None:
        names = [name for _, name in MARCH[2:]]
        x = SimpleNamespace(**dict(zip(names, others, strict=True)))
        march = InterpretedMarch(self._interpreted, {self._signal: 0}, {})
        before = np.zeros(len(x.records))
        with_before = [tap for tap in self._taps if tap.tap.before]
        between = len(signals_between(self._model))
        records = (*x.records[: len(x.records) - between], *np.empty((between, count)))
        for lane in range(LANES):
            row, margin, state = np.empty(count), np.array([np.inf, 0.0]), x.states[:, lane].copy()
            numbers = (x.delay_samples, x.delay_fraction, x.params, x.given)
            for tap in with_before:
                place = self._model.places("parameters").index((tap.part, tap.tap.before))
                before[len(before) - between + tap.between] = x.params[place, lane]
            of_lane = (each[:, lane] for each in numbers)
            march(count, 0, h, records, before, *of_lane, state, margin, row)
            x.states[:, lane], x.worst[lane] = state, margin[0]
            total = rate = 0.0
            for n, value in enumerate(row.tolist()):
                if self._integral:
                    total, rate = total + (0.5 * h if n else 0.0) * (rate + value), value
                    value = total
                error = value - float(x.measured[n])
                x.cost[lane] += float(x.weight[n]) * error * error
                if x.length:
                    x.outputs[lane, n] = value


@generating
def lanes_of(model: Model, form: CodeForm, output: str) -> Lanes:
    """The compiled lanes of a model for one output."""
    return Lanes(model, form, output)
