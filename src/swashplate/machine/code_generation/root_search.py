"""Search for a root as a graph: inverse quadratic interpolation, or bisection (Chandrupatla 1997).

The steps are those of `loops.root`, with what it does next as states of a loop.
"""

from __future__ import annotations

from typing import NamedTuple

from swashplate.machine import graph
from swashplate.machine.code_generation.loops import PRECISION, STEPS, TINY
from swashplate.machine.graph import Node, both, choose, either, make, number


class RootSearch(NamedTuple):
    """Names and nodes of a search."""

    low: Node
    high: Node
    at_low: Node
    """The residual there; likewise `at_high`."""
    at_high: Node
    states: tuple[Node, ...]
    """Names of what the loop carries."""
    begin: tuple[Node, ...]
    """What they begin with, of the names above."""
    going: Node
    """Whether another step is done, of the states."""
    next_x: Node
    """Where the residual is asked for."""
    residual: Node
    """Name of the residual there."""
    following: tuple[Node, ...]
    """What the states become."""
    root: Node
    """The root, of the states and the names above."""


def _root_search() -> RootSearch:
    def name(text: str) -> Node:
        return graph.name(f"root${text}")  # which is no name in Python

    def plus(a: Node, b: Node) -> Node:
        return make("+", a, b)

    def minus(a: Node, b: Node) -> Node:
        return make("-", a, b)

    def times(a: Node, b: Node) -> Node:
        return make("*", a, b)

    def over(a: Node, b: Node) -> Node:
        return make("/", a, b)

    def positive(a: Node) -> Node:
        return make(">", a, graph.ZERO)

    def zero(a: Node) -> Node:
        return make("==", a, graph.ZERO)

    low, high, at_low, at_high = map(name, ("low", "high", "at_low", "at_high"))
    same_sign = make("==", positive(at_high), positive(at_low))
    decided = either(either(zero(at_low), zero(at_high)), same_sign)
    half, one = number(0.5), graph.ONE
    states = x_1, f_1, x_2, f_2, t, best, left = tuple(
        map(name, ("x_1", "f_1", "x_2", "f_2", "t", "best", "left"))
    )
    begin = (
        high,
        at_high,
        low,
        at_low,
        half,
        low,
        choose(decided, graph.ZERO, number(float(STEPS))),
    )
    x = plus(x_1, times(t, minus(x_2, x_1)))
    f = name("f")
    same = make("==", positive(f), positive(f_1))
    x_3, f_3 = choose(same, x_1, x_2), choose(same, f_1, f_2)
    new_x_2, new_f_2 = choose(same, x_2, x_1), choose(same, f_2, f_1)
    nearer = make("<", make("abs", f), make("abs", new_f_2))
    new_best, smallest = choose(nearer, x, new_x_2), choose(nearer, f, new_f_2)
    precision = plus(times(number(PRECISION), make("abs", new_best)), number(TINY))
    reach = over(precision, make("abs", minus(new_x_2, x)))
    ends = either(make(">", reach, half), zero(smallest))
    xi = over(minus(x, new_x_2), minus(x_3, new_x_2))
    phi = over(minus(f, new_f_2), minus(f_3, new_f_2))
    rest = minus(one, phi)
    interpolates = both(
        make("<", times(phi, phi), xi), make("<", times(rest, rest), minus(one, xi))
    )
    first = times(over(f, minus(new_f_2, f)), over(f_3, minus(new_f_2, f_3)))
    second = times(
        times(over(minus(x_3, x), minus(new_x_2, x)), over(f, minus(f_3, f))),
        over(new_f_2, minus(f_3, new_f_2)),
    )
    share = choose(interpolates, plus(first, second), half)
    share = make("min", make("max", share, reach), minus(one, reach))
    return RootSearch(
        low=low,
        high=high,
        at_low=at_low,
        at_high=at_high,
        states=states,
        begin=begin,
        going=make(">", left, graph.ZERO),
        next_x=x,
        residual=f,
        following=(
            x,
            f,
            new_x_2,
            new_f_2,
            share,
            new_best,
            choose(ends, graph.ZERO, minus(left, one)),
        ),
        root=choose(
            zero(at_low),
            low,
            choose(
                zero(at_high),
                high,
                choose(
                    same_sign,
                    choose(make("<=", make("abs", at_low), make("abs", at_high)), low, high),
                    best,
                ),
            ),
        ),
    )


ROOT_SEARCH = _root_search()
