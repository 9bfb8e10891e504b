"""Equations as a list of steps, which Python does number by number: values, then derivatives.

For what is computed once, such as where a record begins and a linear model: the list is plain data,
kept on disk, and nothing is compiled. Derivatives are carried through every node, all columns side
by side.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Collection, Mapping, Sequence
from operator import add, eq, ge, gt, le, lt, mul, ne, neg, sub
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.machine.code_generation.elimination import Elimination
from swashplate.machine.code_generation.loops import Inner, Loop, root
from swashplate.machine.code_generation.values import leaves
from swashplate.machine.graph import MATH_FUNCTIONS, Node, name, ordered, plain_value

Array = NDArray[np.float64]


class Line(float):
    """A sample that knows those before it."""

    at: Callable[[int], float]
    """What the value was so many samples ago."""

    def ago(self, age: float) -> float:
        """The value at an age in samples, straight between them."""
        whole = int(age)
        newer, older = self.at(whole), self.at(whole + 1)
        return newer + (age - whole) * (older - newer)


class Step(NamedTuple):
    """A number that is computed."""

    op: str
    operands: tuple[int, ...]
    """Numbers of the steps that it is computed from."""
    value: Any = None
    """Of a number itself, of a power its exponent, of a result its index; of an equation that is
    called apart its `Program`."""


class Program(NamedTuple):
    """What computes some results, and their derivatives.

    Attributes
    ----------
    arguments : tuple of str
        Names of the numbers that it takes; they come before the steps.
    results : tuple of int
        Steps that are wanted.
    by : tuple of str
        Arguments that results are differentiated by.
    flows : tuple of (int, tuple of (int, int))
        What carries derivatives, in order: for each of what it follows the place among all that
        carry them, arguments first, and the step that is the derivative by it.
    carriers : tuple of int
        Place of each result among all that carry derivatives, -1 if it has none.
    """

    arguments: tuple[str, ...]
    steps: tuple[Step, ...]
    results: tuple[int, ...]
    by: tuple[str, ...] = ()
    flows: tuple[tuple[tuple[int, int], ...], ...] = ()
    carriers: tuple[int, ...] = ()

    def values(self, given: Sequence[Any]) -> list[Any]:
        """Results for some arguments."""
        numbers = self._numbers(given)
        return [numbers[result] for result in self.results]

    def over(self, given: Sequence[Array]) -> list[Array]:
        """Results for arrays of arguments, element by element; there must be no loop in it."""
        numbers: list[Any] = [*given]
        with np.errstate(all="ignore"):
            for step in self.steps:
                operands = [numbers[operand] for operand in step.operands]
                numbers.append(_done_over(step, operands))
        return [numbers[result] for result in self.results]

    def only_value(self, *given: Any) -> Any:
        """The one result for some arguments."""
        (value,) = self.values(given)
        return value

    def slopes(self, given: Sequence[float]) -> Array:
        """(r, k) derivatives of the results by the arguments in `by`."""
        numbers = self._numbers(given)
        carried = [*np.eye(len(self.by))]
        with np.errstate(all="ignore"):
            for flow in self.flows:
                total = np.zeros(len(self.by))
                for operand, amount in flow:
                    if numbers[amount]:  # what is not taken may be infinite
                        total += numbers[amount] * carried[operand]
                carried.append(total)
        none = np.zeros(len(self.by))
        rows = [none if place < 0 else carried[place] for place in self.carriers]
        return np.array(rows).reshape(len(self.results), len(self.by))

    @property
    def entries(self) -> list[tuple[int, int]]:
        """Numbers of result and argument of each derivative that is not zero for all numbers."""
        reached = [{k} for k in range(len(self.by))]
        for flow in self.flows:
            reached.append({argument for operand, _ in flow for argument in reached[operand]})
        return [
            (result, argument)
            for result, place in enumerate(self.carriers)
            if place >= 0
            for argument in sorted(reached[place])
        ]

    def _numbers(self, given: Sequence[Any]) -> list[Any]:
        """The arguments, then what each step gives."""
        numbers = [*given]
        for step in self.steps:
            numbers.append(_done(step, [numbers[operand] for operand in step.operands]))
        return numbers


def _done(step: Step, operands: list[Any]) -> Any:
    match step.op:
        case "number":
            return step.value
        case "name":
            return operands[0]
        case "if":
            return operands[1] if operands[0] else operands[2]
        case "element":
            return operands[1 + int(operands[0])]
        case "segment":
            x, *knots = operands
            return float(max(bisect_right(knots, x, hi=len(knots) - 1) - 1, 0))
        case "past":
            newest, age = operands
            return newest.ago(age) if isinstance(newest, Line) else newest
        case "result":
            return operands[0][step.value]
        case "**":
            return power(operands[0], step.value)
        case "once":
            return step.value.values(operands)
        case "root":
            return [root(step.value.only_value, *operands)]
        case "repeated":
            size = len(step.value.results)
            state, others = operands[1 : 1 + size], operands[1 + size :]
            for number in range(int(operands[0])):
                state = step.value.values([*state, float(number), *others])
            return state
    return OPERATIONS[step.op](*operands)


def _done_over(step: Step, operands: list[Any]) -> Any:
    match step.op:
        case "number":
            return step.value
        case "element":
            place, *elements = np.broadcast_arrays(*operands)
            return np.take_along_axis(np.array(elements), place[None].astype(int), 0)[0]
        case "segment":
            x, *knots = operands
            return np.sum([x >= knot for knot in knots[1:-1]], axis=0, dtype=np.float64)
        case "**" if step.value < 0:
            return np.divide(1.0, power(operands[0], -step.value))
        case "**":
            return power(operands[0], step.value)
    return OPERATIONS_OVER[step.op](*operands)


def names_of(
    results: Sequence[Node], stands_for: Mapping[Node, Node] = MappingProxyType({})
) -> list[str]:
    """Names that some results are computed from, sorted, but those that stand for other nodes."""
    order = ordered(results, (), lambda node: _computed_from(node, stands_for))
    return sorted(node.value for node in order if node.op == "name" and node not in stands_for)


def _computed_from(node: Node, stands_for: Mapping[Node, Node]) -> Sequence[Node]:
    if node in stands_for:
        return (plain_value(stands_for[node]),)
    return [*map(plain_value, node.args)]


def program_of(
    results: Sequence[Node],
    by: Collection[str] = (),
    stands_for: Mapping[Node, Node] = MappingProxyType({}),
    arguments: Sequence[str] | None = None,
) -> Program:
    """The program of some results, and of their derivatives by some names.

    `stands_for` are nodes that names among them stand for; `arguments` are by default all other
    names.
    """
    arguments = names_of(results, stands_for) if arguments is None else arguments
    columns = [name(each) for each in by]
    elimination = Elimination(results, (), columns, len(columns), stands_for, keep="all")
    edges = elimination.edges if columns else {}
    amounts = [each.zero_elsewhere for flow in edges.values() for each in flow.values()]
    place_of = {name(argument): place for place, argument in enumerate(arguments)}
    for kind in ("int", "bool"):
        place_of |= {name(argument, kind): place for place, argument in enumerate(arguments)}
    ends = [*map(plain_value, results), *map(plain_value, amounts)]
    steps = list[Step]()
    for node in ordered(ends, place_of, lambda node: _computed_from(node, stands_for)):
        operands = tuple(place_of[each] for each in _computed_from(node, stands_for))
        steps.append(_step(node, operands))
        place_of[node] = len(arguments) + len(steps) - 1
    carrier = {column: place for place, column in enumerate(columns)}
    flows = list[tuple[tuple[int, int], ...]]()
    for vertex, flow in edges.items():
        flows.append(
            tuple(
                (carrier[operand], place_of[plain_value(each.zero_elsewhere)])
                for operand, each in flow.items()
            )
        )
        carrier[vertex] = len(columns) + len(flows) - 1
    return Program(
        arguments=tuple(arguments),
        steps=tuple(steps),
        results=tuple(place_of[plain_value(result)] for result in results),
        by=tuple(by),
        flows=tuple(flows),
        carriers=tuple(carrier.get(result, -1) for result in results),
    )


def _step(node: Node, operands: tuple[int, ...]) -> Step:
    if node.op != "call":
        return Step(node.op, operands, node.value)
    loop: Loop = node.value.loop
    return Step(loop.kind, operands, _inner(loop.inner))


def _inner(inner: Inner) -> Program:
    """The program of an equation that is called apart, for numbers that stand for its arguments."""
    results = [node for _, node in leaves(inner.result)]
    return program_of(results, arguments=[*inner.leading, *inner.formals])


# --- operations, as processors do them ------------------------------------------------------------


def power(base: float, exponent: int) -> float:
    """By squaring, as compilers do."""
    product, remaining = 1.0, abs(exponent)
    while remaining:
        if remaining % 2:
            product *= base
        base, remaining = base * base, remaining // 2
    return product if exponent >= 0 else _over(1.0, product)


def _over(a: float, b: float) -> float:
    """a / b, as processors do it."""
    if b != 0.0:
        return a / b
    if a == 0.0 or a != a:
        return math.nan
    return math.copysign(math.inf, a) * math.copysign(1.0, b)


def _as_compiled(function: Callable[..., float]) -> Callable[..., float]:
    """A function of `math` that is not a number, or infinite, where Python raises."""

    def called(*arguments: float) -> float:
        try:
            return function(*arguments)
        except ValueError:
            return -math.inf if function is math.log and arguments[0] == 0.0 else math.nan
        except OverflowError:
            return math.inf

    return called


OPERATIONS: dict[str, Callable[..., Any]] = {
    **{"+": add, "-": sub, "*": mul, "/": _over, "neg": neg, "abs": abs, "min": min, "max": max},
    **{"<": lt, "<=": le, ">": gt, ">=": ge, "==": eq, "!=": ne, "not": lambda test: not test},
    **{name: _as_compiled(getattr(math, name)) for name in MATH_FUNCTIONS},
}
OPERATIONS_OVER: dict[str, Callable[..., Any]] = {
    **{"+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "neg": np.negative},
    **{"<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal},
    **{"==": np.equal, "!=": np.not_equal, "not": np.logical_not, "if": np.where, "abs": np.abs},
    "min": lambda a, b: np.where(b < a, b, a),
    "max": lambda a, b: np.where(b > a, b, a),
    **{name: getattr(np, name.replace("a", "arc", name[0] == "a")) for name in MATH_FUNCTIONS},
}
"""The same for arrays."""
