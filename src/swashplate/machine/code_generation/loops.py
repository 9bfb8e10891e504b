"""What equations need beyond arithmetic: tables, roots, and loops whose length is not known."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from math import inf
from typing import Any, Literal, NamedTuple, TypeVar

from swashplate.machine import graph
from swashplate.machine.code_generation.elimination import partials_of
from swashplate.machine.code_generation.functions import FUNCTIONS, RESERVED, fresh_name
from swashplate.machine.code_generation.runner import Callee, Runner
from swashplate.machine.code_generation.symbols import RefusedError
from swashplate.machine.code_generation.values import (
    Option,
    Value,
    alike,
    as_tuple,
    fields,
    leaves,
    node_of,
    rebuilt,
)
from swashplate.machine.declaration import known_equation
from swashplate.machine.graph import ONE, ZERO, Call, DerivativeRule, Node, choose, make, names_in
from swashplate.machine.language import Parsed, is_named_tuple

S = TypeVar("S")

STEPS = 128
"""Most steps of the search for a root; some 10 are usual."""
FEW_KNOTS = 16
"""Longest table of which every segment is looked at; of longer ones one is found by bisection."""
PRECISION = 4.4e-16
TINY = 1e-300


# --- as they are called ---------------------------------------------------------------------------


@known_equation
def root(residual: Callable[..., float], low: float, high: float, *arguments: Any) -> float:
    """Where a residual is zero within a bracket.

    Parameters
    ----------
    residual : equation
        Of the unknown and the arguments; of different signs at both ends.
    low, high : float
        Ends of the bracket.
    *arguments
        What else the residual depends on.

    Returns
    -------
    float
        The root, to the last bits. If the residual has the same sign at both ends, the end at which
        its magnitude is smaller.

    Notes
    -----
    Inverse quadratic interpolation where it is safe, bisection elsewhere (Chandrupatla 1997). By
    the implicit function theorem the derivatives are those of the residual by its arguments over
    that by the unknown, with the other sign; at an end of the bracket they are those of the end,
    and if the residual is flat they count as zero.
    """
    x_1, x_2 = high, low
    f_1, f_2 = residual(high, *arguments), residual(low, *arguments)
    if f_2 == 0.0:
        return low
    if f_1 == 0.0:
        return high
    if (f_1 > 0.0) == (f_2 > 0.0):
        return low if abs(f_2) <= abs(f_1) else high
    t = 0.5
    best = low
    for _ in range(STEPS):
        x = x_1 + t * (x_2 - x_1)
        f = residual(x, *arguments)
        if (f > 0.0) == (f_1 > 0.0):
            x_3, f_3 = x_1, f_1
        else:
            x_3, f_3 = x_2, f_2
            x_2, f_2 = x_1, f_1
        x_1, f_1 = x, f
        best, smallest = (x_1, f_1) if abs(f_1) < abs(f_2) else (x_2, f_2)
        reach = (PRECISION * abs(best) + TINY) / abs(x_2 - x_1)
        if reach > 0.5 or smallest == 0.0:
            break
        xi = (x_1 - x_2) / (x_3 - x_2)
        phi = (f_1 - f_2) / (f_3 - f_2)
        t = 0.5
        if phi * phi < xi and (1.0 - phi) * (1.0 - phi) < 1.0 - xi:
            t = f_1 / (f_2 - f_1) * (f_3 / (f_2 - f_3))
            t += (x_3 - x_1) / (x_2 - x_1) * (f_1 / (f_3 - f_1)) * (f_2 / (f_3 - f_2))
        t = min(max(t, reach), 1.0 - reach)
    return best


@known_equation
def interpolate(x: float, knots: tuple[float, ...], values: tuple[float, ...]) -> float:
    """Piecewise linear interpolation in a table; beyond its ends the last values hold.

    Parameters
    ----------
    x : float
        Where.
    knots, values : tuple of float
        The table, knots ascending. Both may be parameters: there are derivatives by all of them.

    Returns
    -------
    float
        The value. At a knot the derivative by x is the slope to the right of it.
    """
    at = max(min(bisect_right(knots, x), len(knots) - 1) - 1, 0)
    share = (x - knots[at]) / (knots[at + 1] - knots[at])
    return values[at] + min(max(0.0, share), 1.0) * (values[at + 1] - values[at])


@known_equation
def past(history: Any, age: float) -> float:
    """What an input was some time ago, straight between its samples.

    Parameters
    ----------
    history : History
        An input whose `Tap` says how far back it is read.
    age : float
        How long ago, in samples; it may change from sample to sample. Ages below 0 or beyond the
        longest count as these. [samples]

    Returns
    -------
    float
        The value; before the record, what the input was before.
    """
    newest: float = history.newest
    return newest  # as where a record begins: nothing has changed yet


@known_equation
def repeated(step: Callable[..., S], count: float, state: S, *arguments: Any) -> S:
    """State after a step has been done several times.

    Parameters
    ----------
    step : equation
        Of the state, the number of the repetition, from 0.0, and the arguments; returns the next
        state.
    count : float
        How often, 0 or more.
    state : named tuple of floats, or float
        Where it begins.
    *arguments
        What else the step depends on.

    Notes
    -----
    For sub-steps of a march: how many there are is known only when it runs, and the code does not
    grow with them. The derivatives are those of the loop, carried along with the state.
    """
    for number in range(int(count)):
        state = step(state, float(number), *arguments)
    return state


FUNCTIONS["root"] = root


# --- as they are traced ---------------------------------------------------------------------------


class Inner(NamedTuple):
    """An equation that is done many times, with scalars for all that it reads."""

    source: Parsed
    labels: dict[Node, str]
    origins: dict[Node, Parsed]
    used_names: set[str]
    leading: dict[str, str]
    """Kinds of the scalars of its first arguments, which the loop gives."""
    formals: dict[str, str]
    """Kinds of the scalars of the others."""
    actuals: list[Node]
    """What these stand for where it is called."""
    result: Value

    @property
    def name(self) -> str:
        """Name of the equation."""
        return self.source.name


class Loop(NamedTuple):
    """What a call does."""

    kind: Literal["root", "repeated", "once"]
    inner: Inner


def _inner(outer: Runner, callee: Callee, leading: Sequence[Value], rest: Sequence[Value]) -> Inner:
    """An equation whose `leading` arguments the loop gives, the others as where it is called."""
    source = callee.source
    trace = outer.inner(source)
    used_names = {*FUNCTIONS, *RESERVED}
    names = [argument.arg for argument in source.arguments]
    values, stands_for = dict[str, Value](), dict[Node, Node]()

    def formal(value: Value, stem: str, *, always: bool) -> Value:
        """The value with a name for each scalar, and each option that is decided at run time."""
        if isinstance(value, tuple):
            elements = [
                formal(element, f"{stem}_{field}", always=always)
                for field, element in zip(fields(value), value, strict=True)
            ]
            return as_tuple(value, elements)
        if isinstance(value, Option):
            return Option(formal(value.node, stem, always=False), value.path)
        node = node_of(value)
        if node is None or (node.op == "number" and not always):
            return value
        kind = "float" if always and node.kind == "int" else node.kind
        name = graph.name(fresh_name(stem, used_names), kind)
        stands_for[name] = node
        return name

    for index, (name, value) in enumerate(zip(names, [*leading, *rest], strict=True)):
        values[name] = formal(value, name, always=index < len(leading))
    result = trace.run(callee, values)
    if any(node.op == "past" for node in graph.ordered([node for _, node in leaves(result)])):
        what = f"past in {source.name}, which is done again and again"
        raise RefusedError(what, "read the past before, and pass on what it was")
    used = names_in(node for _, node in leaves(result))
    count = sum(1 for value in leading for _ in leaves(value))
    first, others = list(stands_for)[:count], list(stands_for)[count:]
    read = [node for node in others if node.value in used]
    return Inner(
        source=source,
        labels=trace.labels,
        origins=trace.origins,
        used_names=used_names,
        leading={node.value: node.kind for node in first},
        formals={node.value: node.kind for node in read},
        actuals=[stands_for[node] for node in read],
        result=result,
    )


def called_apart(trace: Runner, callee: Callee, values: Sequence[Value]) -> Value:
    """An equation as a call, without derivatives."""
    inner = _inner(trace, callee, [], values)
    count = sum(1 for _ in leaves(inner.result))
    called = Call(count, Loop("once", inner))
    call = make("call", *inner.actuals, value=called)
    results = [trace.make("result", call, value=index) for index in range(count)]
    if count == 1:
        trace.label(results[0], inner.name)
    return rebuilt(inner.result, iter(results))


def solved(trace: Runner, callee: Callee, low: Value, high: Value, rest: Sequence[Value]) -> Value:
    """`root` as a call, with the rule of its derivatives."""
    residual = callee.source
    inner = _inner(trace, callee, [graph.name("x")], rest)
    low, high = node_of(low), node_of(high)
    if low is None or high is None or node_of(inner.result) is None:
        raise RefusedError("a residual or a bracket that is a tuple", "let each be one float")
    called = Call(1, Loop("root", inner))
    call = make("call", low, high, *inner.actuals, value=called)
    x = trace.make("result", call, value=0)
    trace.label(x, "root")
    scalars = list(dict.fromkeys(node for value in rest for _, node in leaves(value)))
    moving = [node for node in scalars if node.op != "number" and node.kind == "float"]
    chain = tuple(trace.under_way)

    def slopes() -> tuple[Node, ...]:
        # the implicit function theorem within the bracket
        names = [argument.arg for argument in residual.arguments]
        with trace.within(chain):
            difference = trace.run(callee, dict(zip(names, [x, *rest], strict=True)))
        partials = partials_of([node for _, node in leaves(difference)], [x, *moving])
        if (0, 0) not in partials:
            residual.refuse(None, f"no derivative by {names[0]}", "use the unknown in it")
        lowest, highest = make("min", low, high), make("max", low, high)
        inside = graph.both(make("<", lowest, x), make("<", x, highest))
        at_low = make("==", x, low)
        divisible = graph.both(inside, make("!=", partials[0, 0], ZERO))
        inverse = make("/", ONE, choose(divisible, partials[0, 0], graph.number(inf)))
        derivatives = [
            choose(inside, ZERO, choose(at_low, ONE, ZERO)),
            choose(inside, ZERO, choose(at_low, ZERO, ONE)),
        ]
        for index in range(1, len(moving) + 1):
            slope = ZERO
            if (0, index) in partials:
                slope = make("*", graph.negative(partials[0, index]), inverse)
            derivatives.append(choose(inside, slope, ZERO))
        return tuple(derivatives)

    return trace.make("ruled", x, value=DerivativeRule((low, high, *moving), slopes))


def repetition(
    trace: Runner, callee: Callee, count: Value, state: Value, rest: Sequence[Value]
) -> Value:
    """`repeated` as a call, with one that carries its derivatives along."""
    step = callee.source
    inner = _inner(trace, callee, [state, graph.name("number")], rest)
    names: tuple[str, ...] = ("state",)
    components: tuple[Value, ...] = (state,)
    if is_named_tuple(type(state)):
        names, components = state._fields, state
    numbers = all(node_of(component) is not None for component in components)
    count = node_of(count)
    if not numbers or count is None or not alike(inner.result, state):
        what = f"repeated of {step.name}, which does not return a state"
        instead = "let it take and return the same named tuple of floats, or a float"
        raise RefusedError(what, instead)
    arguments = (count, *(node for _, node in leaves(state)), *inner.actuals)
    call = _repeated(inner, arguments, _derivatives)
    results = []
    for index, field in enumerate(names):
        results.append(trace.make("result", call, value=index))
        trace.label(results[-1], field)
    return rebuilt(state, iter(results))


def _repeated(
    inner: Inner, arguments: Sequence[Node], derivative: Callable[..., Any] | None = None
) -> Node:
    """A call that repeats an equation: of count, states and formals."""
    count = len(inner.leading) - 1
    called = Call(count, Loop("repeated", inner), derivative)
    return make("call", *arguments, value=called)


def _derivatives(call: Node, moving: tuple[int, ...]) -> tuple[Node, dict[tuple[int, int], Node]]:
    """A loop with the derivatives of its states, carried along step by step.

    Nothing follows the count, which is the argument 0.
    """
    inner: Inner = call.value.loop.inner
    *state_names, number = inner.leading
    size = len(state_names)
    states = [graph.name(name) for name in state_names]
    formals = [graph.name(name, kind) for name, kind in inner.formals.items()]
    following = [node for _, node in leaves(inner.result)]
    partials = partials_of(following, [*states, *formals])
    used_names = {*inner.used_names}
    tangents, begins, becomes = dict[tuple[int, int], Node](), list[Node](), list[Node]()
    moving = tuple(index for index in moving if index > 0)
    for index in moving:
        moved = _moved_by(index - 1, size, partials)
        stem = f"by_{[*state_names, *inner.formals][index - 1]}"
        for state in moved:
            name = fresh_name(f"{state_names[state]}_{stem}", used_names)
            tangents[state, index] = graph.name(name)
        for state in moved:
            direct = ZERO if index <= size else partials.get((state, index - 1), ZERO)
            terms = [
                graph.times(partials[state, other], tangents[other, index])
                for other in moved
                if (state, other) in partials
            ]
            becomes.append(reduce(graph.plus, terms, direct))
            begins.append(ONE if state == index - 1 else ZERO)
    wide = inner._replace(
        used_names=used_names,
        leading={
            **dict.fromkeys([*state_names, *(node.value for node in tangents.values())], "float"),
            number: "float",
        },
        result=(*following, *becomes),
    )
    given = call.args
    again = _repeated(wide, (*given[: 1 + size], *begins, *given[1 + size :]))
    slopes = {
        entry: make("result", again, value=size + place) for place, entry in enumerate(tangents)
    }
    return again, slopes


def _moved_by(argument: int, size: int, partials: Mapping[tuple[int, int], Node]) -> list[int]:
    """States of a loop that an argument, itself a state if it is among the first, moves."""
    moved = {argument} if argument < size else set[int]()
    moved |= {state for state, by in partials if by == argument}
    for _ in range(size):
        moved |= {state for state, by in partials if by in moved and by < size}
    return sorted(moved)
