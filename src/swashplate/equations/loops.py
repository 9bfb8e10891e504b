"""What equations need beyond arithmetic: tables, roots, and loops whose length is not known."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from swashplate.equations import expressions as ex
from swashplate.equations.adjoints import Derived, derived_function, listing
from swashplate.equations.code import Call, Code, Function, Tuple, Value, leaves, rebuilt
from swashplate.equations.equation import inlined
from swashplate.equations.expressions import ONE, ZERO, Node, make
from swashplate.equations.syntax import Parsed
from swashplate.equations.writing import UNNAMED, function_source, function_text, named_by_text

S = TypeVar("S")
Read = Callable[[Code, Any, Mapping[str, Value]], Value]

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
        The root, to the last bits. Where the residual has one sign in all of the bracket, the end
        at which it is smaller.

    Notes
    -----
    Inverse quadratic interpolation where it is safe, bisection elsewhere (Chandrupatla 1997). By
    the implicit function theorem the derivatives are those of the residual by its arguments over
    that by the unknown, with the other sign; at an end of the bracket they are those of the end,
    and where the residual is flat they count as zero.
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
    state : named tuple of floats
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


# --- as they are read -----------------------------------------------------------------------------


def interpolated(code: Code, x: Node, knots: Sequence[Node], values: Sequence[Node]) -> Node:
    """`interpolate` as straight code."""
    ends = [knots[0], knots[1], values[0], values[1]]
    for i in range(1, len(knots) - 1):
        beyond = make(">=", x, knots[i])
        now = knots[i], knots[i + 1], values[i], values[i + 1]
        ends = [
            _named(code, ex.choose(beyond, b, a), name)
            for a, b, name in zip(ends, now, ("left", "right", "low", "high"), strict=True)
        ]
    left, right, low, high = ends
    share = _named(code, make("/", make("-", x, left), make("-", right, left)), "share")
    inside = make("min", make("max", ZERO, share), ONE)
    return make("+", low, make("*", inside, make("-", high, low)))


def _named(code: Code, node: Node, stem: str) -> Node:
    named = code.named(node, stem)
    assert isinstance(named, Node)
    return named


@dataclass(eq=False)
class _Inner:
    """An equation that is done many times: straight code of the scalars that it reads."""

    source: Parsed
    code: Code
    leading: list[str]  # Scalars of its first arguments.
    formals: list[str]  # Scalars of the others.
    actuals: list[Node]  # What these stand for where it is called.
    result: Value

    @property
    def results(self) -> list[tuple[str, Node]]:
        """Scalars that it returns, by path."""
        return [(path or "value", node) for path, node in leaves(self.result)]

    @cached_property
    def function(self) -> Function:
        """The equation as a function of scalars."""
        nodes = [node for _, node in self.results]
        says = f"{self.source.name} of scalars."
        given = [*self.leading, *self.formals]
        name = f"{self.source.name}_{UNNAMED}"
        text, names = function_text(name, says, given, self.code, nodes)
        return Function(*named_by_text(name, text), dict(names))

    def derived(self, by: Sequence[str]) -> Derived:
        """The same with its derivatives by some of these scalars."""
        says = f"{self.source.name} of scalars with its derivatives by {listing(by)}."
        given, named = [*self.leading, *self.formals], [(each, each) for each in by]
        return derived_function(
            f"{self.source.name}_{UNNAMED}",
            says,
            given,
            self.code,
            self.results,
            named,
            chained=True,
        )


def _inner(
    outer: Code, source: Parsed, leading: Sequence[Value], rest: Sequence[Value], read: Read
) -> _Inner:
    code = Code(ruled=outer.ruled)
    code.under_way = [*outer.under_way]
    names = [each.arg for each in source.arguments]
    given, stands_for = {}, dict[str, Node]()
    for k, (name, value) in enumerate(zip(names, [*leading, *rest], strict=True)):
        nodes = []
        for path, node in leaves(value):
            if k >= len(leading) and node.op == "number":
                nodes.append(node)
                continue
            formal = code.fresh(f"{name}_{path}" if path else name)
            stands_for[formal] = node
            nodes.append(ex.name(formal, node.kind))
        given[name] = rebuilt(value, iter(nodes))
    result = read(code, source.function, given)
    used = code.reads([node for _, node in leaves(result)])
    count = sum(1 for value in leading for _ in leaves(value))
    first, others = list(stands_for)[:count], list(stands_for)[count:]
    formals = [name for name in others if name in used]
    return _Inner(source, code, first, formals, [stands_for[n] for n in formals], result)


def solved(
    code: Code, residual: Parsed, low: Node, high: Node, rest: Sequence[Value], read: Read
) -> Node | None:
    """`root` as a call of a generated function; nothing if the residual is no number."""
    inner = _inner(code, residual, [ex.name("x")], rest, read)
    if not isinstance(inner.result, Node):
        return None
    ends = [inner.code.fresh(each) for each in ("low", "high")]
    given = ", ".join([*ends, *inner.formals])
    name = f"root_of_{inner.function.name}"
    line = f"return root({inner.function.name}, {given})"
    text = function_source(f"{name}({given})", f"Root of {residual.name}.", [line], "")
    function = Function(name, text, {"root": root, inner.function.name: inner.function})
    result = code.fresh("root")
    arguments = (low, high, *inner.actuals)
    code.items.append(Call(function, arguments, (result,), _root_derivative(inner, function, ends)))
    return ex.name(result)


def _root_derivative(
    inner: _Inner, function: Function, ends: Sequence[str]
) -> Callable[[tuple[int, ...]], Derived]:
    """Derivatives of a root: the implicit function theorem within the bracket."""
    names = [*ends, *inner.formals]
    low, high = ends
    (x,) = inner.leading

    def derivative(by: tuple[int, ...]) -> Derived:
        derived = inner.derived([x, *(names[k] for k in by if k > 1)])
        code = inner.code
        partials = {
            derived.inputs[i]: code.fresh(f"r_{derived.inputs[i]}") for _, i in derived.entries
        }
        if x not in partials:
            inner.source.refuse(None, f"no derivative by {x}", "use the unknown in it")
        slope, given = partials[x], ", ".join([*ends, *inner.formals])
        lines = [
            f"{x} = {function.name}({given})",
            f"_, {', '.join(partials.values())} = {derived.name}({', '.join([x, *inner.formals])})",
            f"inside = {low} < {x} < {high}",
            f"inverse = 1.0 / ({slope} if inside and {slope} != 0.0 else inf)",
        ]
        entries, values = [], []
        ways = {low: f"1.0 if {x} <= {low} else 0.0", high: f"1.0 if {x} >= {high} else 0.0"}
        ways |= {n: f"-{partial} * inverse if inside else 0.0" for n, partial in partials.items()}
        for i, k in enumerate(by):
            if names[k] in ways:
                entries.append((0, i))
                values.append(ways[names[k]])
        made = [f"d_{k}" for k in range(len(values))]
        lines += [f"{name} = {value}" for name, value in zip(made, values, strict=True)]
        lines.append(f"return {', '.join([x, *made])}")
        inputs = tuple(names[k] for k in by)
        says = f"Root of {inner.source.name} with its derivatives by {listing(inputs)}."
        name = f"{function.name}_{UNNAMED}"
        name, text = named_by_text(name, function_source(f"{name}({given})", says, lines, ""))
        references = {function.name: function, derived.name: derived}
        return Derived(name, text, references, ("value",), inputs, tuple(entries))

    return derivative


def repetition(
    code: Code, step: Parsed, count: Node, state: Value, rest: Sequence[Value], read: Read
) -> Value | None:
    """`repeated` as a call of a generated function; nothing if the step returns no state."""
    if not (
        isinstance(state, Tuple) and state.cls and all(isinstance(s, Node) for s in state.items)
    ):
        return None
    inner = _inner(code, step, [state, ex.name("number")], rest, read)
    if not isinstance(inner.result, Tuple) or inner.result.cls is not state.cls:
        return None
    *now, number = inner.leading
    times = inner.code.fresh("count")
    given = ", ".join([times, *now, *inner.formals])
    states = ", ".join(now) + ("," if len(now) == 1 else "")
    called = ", ".join([*now, f"float({number})", *inner.formals])
    lines = [
        f"for {number} in range(int({times})):",
        f"    {states} = {inner.function.name}({called})",
        f"return {states}",
    ]
    name = f"repeated_{inner.function.name}"
    text = function_source(f"{name}({given})", f"{step.name}, repeated.", lines, "")
    function = Function(name, text, {inner.function.name: inner.function})
    results = tuple(code.fresh(each) for each in state.fields)
    nodes = [node for _, node in leaves(state)]
    derivative = _repeated_derivative(inner, function, times)
    code.items.append(Call(function, (count, *nodes, *inner.actuals), results, derivative))
    return rebuilt(state, iter([ex.name(each) for each in results]))


def _repeated_derivative(
    inner: _Inner, function: Function, times: str
) -> Callable[[tuple[int, ...]], Derived]:
    """Derivatives of a loop: those of the state by every input, carried along step by step."""
    *now, number = inner.leading
    names = [times, *now, *inner.formals]

    def derivative(by: tuple[int, ...]) -> Derived:
        inputs, code = [names[k] for k in by if k > 0], inner.code
        derived = inner.derived([*now, *(each for each in inputs if each not in now)])
        width = len(inputs)
        fresh = [code.fresh(each) for each in ("slopes", "c")]
        slopes, c = fresh
        new = [code.fresh(f"new_{each}") for each in now]
        before = [code.fresh(f"by_{each}") for each in now]
        partials = [code.fresh(f"d_{new[o]}_{derived.inputs[i]}") for o, i in derived.entries]
        carried, direct = [list[str]() for _ in now], []
        reach = [{i} for i in range(len(now))]
        follows = [set[str]() for _ in now]
        for partial, (o, i) in zip(partials, derived.entries, strict=True):
            path = derived.inputs[i]
            if path in now:
                carried[o].append(f"{partial} * {before[now.index(path)]}")
                reach[o].add(now.index(path))
            else:
                direct.append(f"{slopes}[{o * width + inputs.index(path)}] += {partial}")
                follows[o].add(path)
        for _ in now:
            reach = [set[int]().union(*(reach[k] for k in each)) for each in reach]
        followed = [{now[k] for k in each}.union(*(follows[k] for k in each)) for each in reach]
        entries = [
            (o, by.index(names.index(path)))
            for o in range(len(now))
            for path in inputs
            if path in followed[o]
        ]
        called = [*now, f"float({number})", *inner.formals]
        lines = [
            f"{slopes} = blank({len(now) * width})",
            *(
                f"{slopes}[{k * width + inputs.index(each)}] = 1.0"
                for k, each in enumerate(now)
                if each in inputs
            ),
            f"for {number} in range(int({times})):",
            f"    {', '.join([*new, *partials])}, = {derived.name}({', '.join(called)})",
            f"    for {c} in range({width}):",
            *(f"        {each} = {slopes}[{k * width} + {c}]" for k, each in enumerate(before)),
            *(
                f"        {slopes}[{k * width} + {c}] = {' + '.join(terms) or '0.0'}"
                for k, terms in enumerate(carried)
            ),
            *(f"    {line}" for line in direct),
            f"    {', '.join(now)}, = {', '.join(new)},",
            "return "
            + ", ".join(
                [*now, *(f"{slopes}[{o * width + inputs.index(names[by[i]])}]" for o, i in entries)]
            )
            + ",",
        ]
        given = [names[k] for k in by]
        says = f"{inner.source.name}, repeated, with its derivatives by {listing(given)}."
        name = f"{function.name}_{UNNAMED}"
        name, text = named_by_text(
            name, function_source(f"{name}({', '.join(names)})", says, lines, "")
        )
        references = {"blank": blank, derived.name: derived}
        return Derived(name, text, references, tuple(now), tuple(given), tuple(entries))

    return derivative
