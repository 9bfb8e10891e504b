"""Many sets of one model side by side: LANES of them in the innermost loop of one march.

The compiler turns the loop over lanes into vector instructions, because the equations stand in it
as straight code. Arithmetic is as strict as in the plain march, so that each set's numbers are the
same to the last bit, whatever its neighbours are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.equations import expressions as ex
from swashplate.equations.fields import floats_of
from swashplate.equations.lowering import generating
from swashplate.equations.march import (
    PartCode,
    Sampler,
    function_source,
    indented,
    output_of,
    rest_of,
    taps_of,
)
from swashplate.equations.model import Model
from swashplate.equations.program import leaves
from swashplate.equations.run import module
from swashplate.equations.scalars import text

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

LANES = 16
"""Sets marched side by side: two vectors of eight where the processor has them, else four of 4."""


class Rows:
    """Numbers of the rows of a block of lanes, given out on demand."""

    def __init__(self) -> None:
        self.number: dict[str, int] = {}

    def text(self, name: str) -> str:
        """Text of a lane's number in the row of a name."""
        return f"flat[{self.number.setdefault(name, len(self.number))} * LANES + lane]"


def lanes_source(
    model: Model, signals: Sequence[str], options: Sequence[Any], output: str
) -> tuple[str, dict[str, Any], dict[str, int], Sampler]:
    """Text of the march of LANES sets over one record, its names, and the rows of its block.

    A block is one flat array: row r of lane l is ``flat[r * LANES + l]``. With everything in one
    array at known distances the compiler need not prove at run time that rows do not overlap, and
    vectorises. Two kernels:

    - ``prepare(h, flat)`` computes constants and states at rest of every lane;
    - ``march(records, before, whole, h, flat, measured, weight, outputs)`` marches, and returns
      nothing: costs and the worst margins are rows of the block.
    """
    place, is_rate = output_of(model, output)
    sampler = Sampler(model, signals, options, [place])
    rows = Rows()
    parts = sampler.used()

    def loads(names: Iterable[str]) -> list[str]:
        return [f"{name} = {rows.text(name)}" for name in names]

    def saves(names: Iterable[str]) -> list[str]:
        return [f"{rows.text(name)} = {name}" for name in names]

    def outside(part: PartCode, read: set[str]) -> list[str]:
        every = [*leaves(part.p), *leaves(part.given)]
        return [node.value for _, node in every if node.value in read]

    def states(part: PartCode) -> list[str]:
        names = dict(leaves(part.state))
        return [names[path].value for path in sampler.carried[part.part]]

    prepare: list[str] = []
    for part in parts:
        constants = sampler.constants(part)
        made = [ex.name(name) for name in constants]
        rest = rest_of(part)
        at_rest = [dict(leaves(rest.value))[path] for path in sampler.carried[part.part]]
        read = part.prologue.reads([*made, *at_rest]) | rest.code.reads(at_rest)
        needed = [ex.name(each) for each in read]
        lines = [
            *loads(outside(part, read | part.prologue.reads(needed))),
            *part.prologue.lines([*made, *needed]),
            *saves(constants),
            *rest.code.lines(at_rest),
        ]
        for name, node in zip(states(part), at_rest, strict=True):
            lines.append(f"{rows.text(name)} = {text(node)}")
        prepare += ["for lane in range(LANES):", *indented(lines or ["pass"])]

    inner: list[str] = []
    taps = [(part, tap) for part in parts for tap in part.taps]
    if taps:
        shift, fetch = [], []
        for part, tap in taps:
            samples = part.tap_samples(tap)
            for newer, older in reversed(list(pairwise(samples))):
                shift.append(f"{rows.text(older)} = {rows.text(newer)}")
            row = sampler.signals.index(tap.tap.signal)
            fetch.append(
                f"{rows.text(samples[0])} = sample_at(records[{row}], n - whole[{tap.number}, "
                f"lane], before[{row}])"
            )
        inner += ["for lane in range(LANES):", *indented(shift)]
        # apart, because a loop that reads at computed places is not vectorised
        inner += ["for lane in range(LANES):", *indented(fetch)]
    for part in parts:
        read = sampler.read(part)
        known = [*outside(part, read), *sampler.constants(part), *states(part)]
        known += [name for tap in part.taps for name in part.tap_samples(tap) if name in read]
        known += [part.fraction(tap) for tap in part.taps if part.fraction(tap) in read]
        known += [part.source(s) for s in sampler.sources if part.source(s) in read]
        lines = loads(dict.fromkeys(known))
        for signal in sampler.signals:
            if f"x_{signal}" in read:
                inner.append(f"x_{signal} = records[{sampler.signals.index(signal)}][n]")
        lines += sampler.body(part)
        lines += saves(part.source(s) for s in sampler.sources if s.part == part.part)
        if part.margin is not None:
            worst = rows.text("worst")
            lines.append(f"{worst} = min({worst}, {text(part.margin)})")
        if place.part == part.part:
            shown = sampler.stored(part, [place], "n")
            value = shown[-1].removeprefix("out[0, n] = ")
            lines += [*shown[:-1], f"value = {value}"]
            if is_rate:
                total, rate = rows.text("integral"), rows.text("rate")
                lines += [
                    f"total = {total} + half * ({rate} + value)",
                    f"{rate} = value",
                    f"{total} = total",
                    "value = total",
                ]
            cost = rows.text("cost")
            lines += [
                "error = value - target",
                f"{rows.text('observed')} = value",
                f"{cost} = {cost} + counts * error * error",
            ]
        lines += sampler.step(part)
        lines += saves(states(part))
        inner += ["for lane in range(LANES):", *indented(lines)]
    # read here, where no store between can have changed them
    inner[:0] = ["target = measured[n]", "counts = weight[n]"]
    if is_rate:
        inner.insert(0, "half = 0.5 * h if n > 0 else 0.0")
    inner += [
        "if outputs.shape[0] > 0:",
        "    for lane in range(LANES):",
        f"        outputs[n, lane] = {rows.text('observed')}",
    ]
    texts = [
        function_source(
            "prepare(h, flat)",
            f"Constants and states at rest of LANES sets of {model.name}.",
            prepare,
        ),
        function_source(
            "march(records, before, whole, h, flat, measured, weight, outputs)",
            f"March LANES sets of {model.name} over one record.",
            ["for n in range(records[0].size):", *indented(inner)],
        ),
    ]
    return "\n\n".join(texts), {**sampler.names, "LANES": LANES}, rows.number, sampler


@dataclass(frozen=True, eq=False)
class Lanes:
    """Kernels of LANES sets side by side, and the rows of their block."""

    prepare: Callable[..., None]
    march: Callable[..., None]
    rows: Mapping[str, int]
    columns: Mapping[str, str]
    """Name in the kernels of each parameter and given, as `march_lanes` takes them."""
    fractions: Mapping[int, str]
    """Name of each tap's fraction."""
    states: tuple[str, ...]
    """Names of the states."""


@generating
def lanes_of(
    model: Model, signals: tuple[str, ...], options: tuple[Any, ...], output: str
) -> Lanes:
    """The compiled lanes of a model for one output."""
    source, names, rows, sampler = lanes_source(model, signals, options, output)
    made = module(f"{model.name}_lanes", source, names)
    columns: dict[str, str] = {}
    fractions: dict[int, str] = {}
    states: list[str] = []
    for part in sampler.parts:
        prefix = f"{part.own.name}." if len(model.parts) > 1 else ""
        columns |= {f"{prefix}{path}": name for name, path in part.parameters.items()}
        columns |= {f"given {prefix}{path}": node.value for path, node in leaves(part.given)}
        fractions |= {tap.number: part.fraction(tap) for tap in part.taps}
        own = dict(leaves(part.state))
        states += [own[path].value for path in sampler.carried[part.part]]
    return Lanes(made["prepare"], made["march"], rows, columns, fractions, tuple(states))


class Marched(NamedTuple):
    """What LANES sets leave."""

    cost: Array
    """(LANES,) sum of weighted squared errors."""
    worst: Array
    """(LANES,) worst margin of the domain, infinite without one."""
    end: Array
    """(LANES,) a sum that is finite where all numbers are."""
    outputs: Array
    """(n, LANES) the output, or (0, LANES)."""


def march_lanes(
    model: Model,
    options: tuple[Any, ...],
    numbers: Mapping[str, Array],
    records: Mapping[str, Array],
    h: float,
    output: str,
    measured: Array,
    weight: Array,
    keep: bool,
) -> Marched:
    """March LANES sets over one record, from rest.

    Parameters
    ----------
    numbers : mapping of str to (LANES,) array
        Every parameter by its path, and every given, ``"given "`` before it; parameters that a type
        has a default for may be left out.
    records : mapping of str to (n,) array
        External signals, zero before.
    h : float
        Step. [s]
    output : str
        Signal that is kept or compared.
    measured, weight : (n,) arrays
        What it is compared with, and the weight of each squared error.
    keep : bool
        Whether the output is kept.
    """
    signals = tuple(records)
    lanes = lanes_of(model, signals, options, output)
    block = np.zeros((len(lanes.rows), LANES))
    if "worst" in lanes.rows:
        block[lanes.rows["worst"]] = np.inf
    for path, name in lanes.columns.items():
        if name in lanes.rows:
            block[lanes.rows[name]] = numbers[path] if path in numbers else default_of(model, path)
    taps = taps_of(model, signals)
    whole = np.zeros((max(len(taps), 1), LANES), dtype=np.int64)
    for each in taps:
        prefix = f"{model.parts[each.part].name}." if len(model.parts) > 1 else ""
        delay = numbers[f"{prefix}{each.tap.delay}"] / h if each.tap.delay else np.zeros(LANES)
        end = np.maximum(delay, each.tap.ahead) - each.tap.ahead
        whole[each.number] = np.floor(end).astype(np.int64)
        if lanes.fractions[each.number] in lanes.rows:
            block[lanes.rows[lanes.fractions[each.number]]] = end - whole[each.number]
    size = next(iter(records.values())).size
    outputs = np.empty((size if keep else 0, LANES))
    flat = block.reshape(-1)
    values = tuple(np.require(each, np.float64, ["C", "W"]) for each in records.values())
    lanes.prepare(h, flat)
    lanes.march(values, (0.0,) * len(values), whole, h, flat, measured, weight, outputs)
    worst = block[lanes.rows["worst"]] if "worst" in lanes.rows else np.full(LANES, np.inf)
    ends = [block[lanes.rows[name]] for name in (*lanes.states, "cost") if name in lanes.rows]
    return Marched(block[lanes.rows["cost"]], worst, np.sum(ends, axis=0), outputs)


def default_of(model: Model, path: str) -> float:
    """What a parameter is where nobody gives it."""
    first, _, rest = path.partition(".")
    for part in model.parts:
        if len(model.parts) == 1 or part.name == first:
            name = path if len(model.parts) == 1 else rest
            if name in part.parameters._field_defaults:
                return float(part.parameters._field_defaults[name])
            if name in floats_of(part.parameters):
                break
    raise KeyError(path)
