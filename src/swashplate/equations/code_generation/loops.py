"""What equations need beyond arithmetic: tables, roots, and loops whose length is not known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from swashplate.equations import graph
from swashplate.equations.code_generation.functions import FUNCTIONS, RESERVED, Function, fresh_name
from swashplate.equations.code_generation.gradients import (
    Derived,
    derived_function,
    listed,
    partials_of,
)
from swashplate.equations.code_generation.lowering import Lowering, Operand, lowers
from swashplate.equations.code_generation.printing import (
    UNNAMED,
    function_source,
    function_text,
    named_by_text,
)
from swashplate.equations.code_generation.runner import Callee, Runner
from swashplate.equations.code_generation.values import Flag, Tuple, Value, alike, leaves, rebuilt
from swashplate.equations.declaration import inlined
from swashplate.equations.graph import ONE, ZERO, Call, Node, Rule, choose, make, names_in
from swashplate.equations.language import Parsed

S = TypeVar("S")

STEPS = 128
"""Most steps of the search for a root; some 10 are usual."""
PRECISION = 4.4e-16
TINY = 1e-300


# --- as they are called ---------------------------------------------------------------------------


@inlined
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


@inlined
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
    at = 0
    for i in range(1, len(knots) - 1):
        if x >= knots[i]:
            at = i
    share = (x - knots[at]) / (knots[at + 1] - knots[at])
    return values[at] + min(max(0.0, share), 1.0) * (values[at + 1] - values[at])


@inlined
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


@inlined
def blank(size: int) -> NDArray[np.float64]:
    """Derivatives that are carried along, all zero."""
    return np.zeros(size)


FUNCTIONS |= {"root": root, "blank": blank}


@lowers(blank)
def _blank(code: Lowering, size: Operand) -> Operand:
    return code.room(int(size.text))


# --- as they are traced ---------------------------------------------------------------------------


class Inner(NamedTuple):
    """An equation that is done many times, with scalars for all that it reads."""

    source: Parsed
    labels: dict[Node, str]
    origins: dict[Node, Parsed]
    taken: set[str]
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

    def function(self, *, flat: bool = False) -> Function:
        """The equation as a function of scalars, which returns a tuple if it is to be `flat`."""
        nodes = [node for _, node in leaves(self.result)]
        given = [*self.leading, *self.formals]
        name = f"{self.name}_{UNNAMED}"
        says = f"{self.name} of scalars."
        text, names = function_text(name, says, given, nodes, self.labels, flat=flat)
        return Function(*named_by_text(name, text), dict(names))


class Loop(NamedTuple):
    """What a generated call does, for other languages."""

    name: str
    """Name of the generated function."""
    kind: Literal["root", "repeated", "once"]
    inner: Inner


def _inner(outer: Runner, callee: Callee, leading: Sequence[Value], rest: Sequence[Value]) -> Inner:
    """An equation whose `leading` arguments the loop gives, the others as where it is called."""
    source = callee.source
    trace = outer.inner(source)
    taken = {*FUNCTIONS, *RESERVED}
    names = [each.arg for each in source.arguments]
    given, stands_for = dict[str, Value](), dict[Node, Node]()

    def formal(value: Value, stem: str, *, always: bool) -> Value:
        """The value with a name for each scalar, and each option that is decided at run time."""
        if isinstance(value, Tuple):
            pairs = zip(value.fields, value.items, strict=True)
            items = [formal(each, f"{stem}_{field}", always=always) for field, each in pairs]
            return Tuple(value.cls, tuple(items))
        if isinstance(value, Flag):
            symbolic = isinstance(value.value, Node)
            return Flag(formal(value.value, stem, always=False), value.text) if symbolic else value
        if value.op == "number" and not always:
            return value
        kind = "float" if always and value.kind == "int" else value.kind
        node = graph.name(fresh_name(stem, taken), kind)
        stands_for[node] = value
        return node

    for k, (name, value) in enumerate(zip(names, [*leading, *rest], strict=True)):
        given[name] = formal(value, name, always=k < len(leading))
    result = trace.run(callee, given)
    used = names_in(node for _, node in leaves(result))
    count = sum(1 for value in leading for _ in leaves(value))
    first, others = list(stands_for)[:count], list(stands_for)[count:]
    read = [node for node in others if node.value in used]
    return Inner(
        source,
        trace.labels,
        trace.origins,
        taken,
        {node.value: node.kind for node in first},
        {node.value: node.kind for node in read},
        [stands_for[node] for node in read],
        result,
    )


def called_apart(trace: Runner, callee: Callee, values: Sequence[Value]) -> Value:
    """An equation as a call of a generated function, without derivatives."""
    inner = _inner(trace, callee, [], values)
    function = inner.function(flat=True)
    count = sum(1 for _ in leaves(inner.result))
    value = Call(function, count, loop=Loop(function.name, "once", inner))
    call = make("call", *inner.actuals, value=value)
    results = [trace.make("result", call, value=k) for k in range(count)]
    if count == 1:
        trace.label(results[0], inner.name)
    return rebuilt(inner.result, iter(results))


def solved(trace: Runner, callee: Callee, low: Value, high: Value, rest: Sequence[Value]) -> Value:
    """`root` as a call of a generated function, with the rule of its derivatives."""
    residual = callee.source
    inner = _inner(trace, callee, [graph.name("x")], rest)
    if not (isinstance(inner.result, Node) and isinstance(low, Node) and isinstance(high, Node)):
        trace.under_way[-1].source.refuse(
            None, "a residual or a bracket that is a tuple", "let each be one float"
        )
    function = inner.function()
    ends = [fresh_name(each, inner.taken) for each in ("low", "high")]
    given = ", ".join([*ends, *inner.formals])
    name = f"root_of_{function.name}"
    line = f"return (root({function.name}, {given}),)"
    text = function_source(f"{name}({given})", f"Root of {residual.name}.", [line], "")
    solver = Function(name, text, {function.name: function})
    value = Call(solver, 1, loop=Loop(name, "root", inner))
    call = make("call", low, high, *inner.actuals, value=value)
    x = trace.make("result", call, value=0)
    trace.label(x, "root")
    by = list(dict.fromkeys(node for value in rest for _, node in leaves(value)))
    moving = [node for node in by if node.op != "number" and node.kind == "float"]
    chain = tuple(trace.under_way)

    def slopes() -> tuple[Node, ...]:
        # the implicit function theorem within the bracket
        names = [each.arg for each in residual.arguments]
        with trace.within(chain):
            value = trace.run(callee, dict(zip(names, [x, *rest], strict=True)))
        assert isinstance(value, Node)
        partials = partials_of([value], [x, *moving])
        if (0, 0) not in partials:
            residual.refuse(None, f"no derivative by {names[0]}", "use the unknown in it")
        lowest, highest = make("min", low, high), make("max", low, high)
        inside = graph.both(make("<", lowest, x), make("<", x, highest))
        at_low = make("==", x, low)
        divisible = graph.both(inside, make("!=", partials[0, 0], ZERO))
        inverse = make("/", ONE, choose(divisible, partials[0, 0], graph.number(inf)))
        found = [
            choose(inside, ZERO, choose(at_low, ONE, ZERO)),
            choose(inside, ZERO, choose(at_low, ZERO, ONE)),
        ]
        for i in range(1, len(moving) + 1):
            slope = ZERO
            if (0, i) in partials:
                slope = make("*", graph.negative(partials[0, i]), inverse)
            found.append(choose(inside, slope, ZERO))
        return tuple(found)

    return trace.make("ruled", x, value=Rule((low, high, *moving), slopes))


def repetition(
    trace: Runner, callee: Callee, count: Value, state: Value, rest: Sequence[Value]
) -> Value:
    """`repeated` as a call of a generated function, with one that carries its derivatives along."""
    step = callee.source
    inner = _inner(trace, callee, [state, graph.name("number")], rest)
    names: tuple[str, ...] = ("state",)
    items: tuple[Value, ...] = (state,)
    if isinstance(state, Tuple) and state.cls:
        names, items = state.fields, state.items
    numbers = all(isinstance(each, Node) for each in items)
    if not (numbers and isinstance(count, Node) and alike(inner.result, state)):
        what = f"repeated of {step.name}, which does not return a state"
        instead = "let it take and return the same named tuple of floats, or a float"
        trace.under_way[-1].source.refuse(None, what, instead)
    *now, number = inner.leading
    count_name = fresh_name("count", inner.taken)
    given = [count_name, *now, *inner.formals]
    states = ", ".join(now)
    called = ", ".join([*now, f"float({number})", *inner.formals])
    function = inner.function()
    lines = [
        f"for {number} in range(int({count_name})):",
        f"    {states} = {function.name}({called})",
        f"return {states},",
    ]
    name = f"repeated_{function.name}"
    text = function_source(f"{name}({', '.join(given)})", f"{step.name}, repeated.", lines, "")
    loop = Function(name, text, {function.name: function})

    def derivative(by: tuple[int, ...]) -> Derived:
        return _tangent_loop(inner, name, given, called, [given[k] for k in by if k > 0], by)

    arguments = (count, *(node for _, node in leaves(state)), *inner.actuals)
    value = Call(loop, len(names), derivative, Loop(name, "repeated", inner))
    call = make("call", *arguments, value=value)
    results = []
    for index, word in enumerate(names):
        results.append(trace.make("result", call, value=index))
        trace.label(results[-1], word)
    return rebuilt(state, iter(results))


def _tangent_loop(
    inner: Inner,
    loop: str,
    given: list[str],
    called: str,
    inputs: list[str],
    by: tuple[int, ...],
) -> Derived:
    """A loop with the derivatives of its state by some inputs, carried along step by step.

    `given` are the loop's arguments, `called` those of its step, and `by` the numbers of the
    `inputs` among them.
    """
    *now, number = inner.leading
    width, taken = len(inputs), {*inner.taken}
    every = [*now, *(each for each in inputs if each not in now)]
    step = derived_function(
        f"{inner.name}_{UNNAMED}",
        f"{inner.name} of scalars with its derivatives by {listed(every)}.",
        [*inner.leading, *inner.formals],
        [*leaves(inner.result)],
        [(each, each) for each in every],
        inner.labels,
        chained=True,
    )
    slopes, c = fresh_name("slopes", taken), fresh_name("c", taken)
    new = [fresh_name(f"new_{each}", taken) for each in now]
    before = [fresh_name(f"by_{each}", taken) for each in now]
    partials = [fresh_name(f"d_{new[o]}_{every[i]}", taken) for o, i in step.entries]
    place = {
        (o, each): f"{slopes}[{o * width + k}"
        for o in range(len(now))
        for k, each in enumerate(inputs)
    }
    carried, direct = [list[str]() for _ in now], []
    follows = [{each} for each in now]  # Inputs that a state follows, at first itself.
    for partial, (o, i) in zip(partials, step.entries, strict=True):
        if i < len(now):
            carried[o].append(f"{partial} * {before[i]}")
        else:
            direct.append(f"{place[o, every[i]]}] += {partial}")
        follows[o].add(every[i])
    for _ in now:
        follows = [
            each.union(*(follows[now.index(s)] for s in each if s in now)) for each in follows
        ]
    entries = [(o, each) for o in range(len(now)) for each in inputs if each in follows[o]]
    lines = [
        f"{slopes} = blank({len(now) * width})",
        *(f"{place[k, each]}] = 1.0" for k, each in enumerate(now) if each in inputs),
        f"for {number} in range(int({given[0]})):",
        f"    {', '.join([*new, *partials])}, = {step.name}({called})",
        f"    for {c} in range({width}):",
        *(f"        {each} = {slopes}[{k * width} + {c}]" for k, each in enumerate(before)),
        *(
            f"        {slopes}[{k * width} + {c}] = {' + '.join(terms) or '0.0'}"
            for k, terms in enumerate(carried)
        ),
        *(f"    {line}" for line in direct),
        f"    {', '.join(now)}, = {', '.join(new)},",
        f"return {', '.join([*now, *(f'{place[each]}]' for each in entries)])},",
    ]
    moved = [given[k] for k in by]
    says = f"{inner.name}, repeated, with its derivatives by {listed(moved)}."
    name = f"{loop}_{UNNAMED}"
    text = function_source(f"{name}({', '.join(given)})", says, lines, "")
    return Derived(
        *named_by_text(name, text),
        {step.name: step},
        tuple(now),
        tuple(moved),
        tuple((o, moved.index(each)) for o, each in entries),
    )
