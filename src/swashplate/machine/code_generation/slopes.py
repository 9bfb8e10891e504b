"""Slopes of a graph's nodes: the derivative of each by its own operands.

Conventions where a derivative does not exist:

- Of `min` and `max` at a tie the last argument counts; `abs` at zero counts as rising.
- A conditional expression has the derivative of the side that is taken; decisions and `floor`
  have none.
- If `sqrt`, `asin`, `acos`, `hypot` or `atan2` has an infinite slope or none, it counts as 0.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

from swashplate.errors import InputError
from swashplate.machine import graph
from swashplate.machine.graph import (
    FALSE,
    ONE,
    TRUE,
    ZERO,
    Call,
    DerivativeRule,
    Node,
    choose,
    make,
    minus,
    negative,
    ordered,
    times,
)


class Contribution(NamedTuple):
    """An amount of a derivative, which counts if `test` is true.

    It is `masked` if it is zero already whenever the test is false.
    """

    test: Node
    amount: Node
    masked: bool

    @property
    def zero_elsewhere(self) -> Node:
        """The amount; zero if it does not count."""
        return self.amount if self.masked else masked_amount(self.test, self.amount)


OF_ITSELF = Contribution(test=TRUE, amount=ONE, masked=False)
"""The derivative of a value by itself."""


class Slopes:
    """Derivatives of all nodes that some results follow, by their own operands.

    Parameters
    ----------
    results : sequence of Node
        What is differentiated.
    by : sequence of Node
        By what; their own operands count as given.
    stands_for : mapping of Node to Node
        Nodes that names among the operands stand for.

    Attributes
    ----------
    order : list of Node
        All nodes, each after its operands.
    active : dict of Node to None
        Those that follow, continuously, what is differentiated by.
    calls : dict of Node to Node
        Calls that something moves through, with those that give their derivatives as well.
    """

    def __init__(
        self,
        results: Sequence[Node],
        by: Collection[Node],
        stands_for: Mapping[Node, Node] = MappingProxyType({}),
    ) -> None:
        self._stands_for = stands_for
        self.order = ordered(results, operands=self._operands)
        self.active = dict.fromkeys(by)
        for node in self.order:
            if node not in self.active and any(x in self.active for x in self._followed(node)):
                self.active[node] = None
        self._divisors = {
            node.args[1] for node in ordered(results, operands=_always) if node.op == "/"
        }
        """What the results divide by, whatever tests say: a second division does no more harm."""
        self.calls: dict[Node, Node] = {}
        self._slopes_of_calls: dict[Node, dict[tuple[int, int], Node]] = {}
        self._tame: dict[Node, bool] = {}

    def _operands(self, node: Node) -> Sequence[Node]:
        """Operands of a node, what its declared derivatives are by, and what a name stands for."""
        return (self._stands_for[node],) if node in self._stands_for else graph.dependencies(node)

    def _followed(self, node: Node) -> Sequence[Node]:
        """Operands that a value follows continuously: no decision, and nothing in whole numbers."""
        if node in self._stands_for:
            return (self._stands_for[node],)
        if node.kind != "float" or node.op in ("number", "name", "segment"):
            return ()
        if node.op == "ruled":
            rule: DerivativeRule = node.value
            return rule.arguments
        return node.args[1:] if node.op in graph.CHOSEN else node.args

    def of(self, node: Node) -> Iterator[tuple[Node, Contribution]]:
        """Operands that move a node, each with the derivative by it."""
        if node in self._stands_for:
            yield self._stands_for[node], OF_ITSELF
            return
        for operand, contribution in self.pushed(node, OF_ITSELF):
            if operand in self.active and contribution.amount is not ZERO:
                yield operand, contribution

    def pushed(self, node: Node, contribution: Contribution) -> Iterator[tuple[Node, Contribution]]:
        """Operands that move a node, each with what a contribution to it becomes on the way."""
        if node.op in ("min", "max", "if"):
            test, first, second = node.args if node.op == "if" else _sides(node)
            for operand, side in ((first, test), (second, opposite(test))):
                if operand in self.active:
                    yield operand, _restricted(contribution, side)
            return
        if node.op == "past":
            raise InputError(
                "An equation reads the past at an age that changes, so that there are no "
                "derivatives: the model can be simulated and stepped, but not fitted or linearised."
            )
        if node.op == "element":
            place, *elements = node.args
            for number, operand in enumerate(elements):
                if operand in self.active:
                    test = make("==", place, graph.number(float(number)))
                    yield operand, _restricted(contribution, test)
            return
        for operand, slope in self._slopes(node):
            if operand in self.active:
                yield operand, self._multiplied(slope, contribution)

    def _multiplied(
        self, slope: Callable[[Node], Node], contribution: Contribution
    ) -> Contribution:
        """A contribution times a derivative, which need not be finite if it does not count."""
        amount = slope(contribution.amount)
        light = contribution.masked and self.stays_finite(slope(ONE))
        return Contribution(contribution.test, amount, light)

    def stays_finite(self, node: Node) -> bool:
        """Whether a node is finite wherever the names in it are moderate."""
        for operand in ordered([node], self._tame):
            tame = operand.op in TAME and all(self._tame[argument] for argument in operand.args)
            self._tame[operand] = tame
        return self._tame[node]

    def _slopes(self, node: Node) -> Iterator[tuple[Node, Callable[[Node], Node]]]:
        """Operands of an operation, each with what a weight becomes on the way to it."""
        op, operands = node.op, node.args
        if op == "ruled":
            for argument, slope in zip(node.value.arguments, node.value.slopes, strict=True):
                if slope is not ZERO and not graph.is_number(slope, 0.0):
                    yield argument, partial(times, slope)
        elif op == "result":
            call = operands[0]
            for (result, index), slope in self._derivatives_of(call).items():
                if result == node.value:
                    yield call.args[index], partial(times, slope)
        elif op == "neg":
            yield operands[0], negative
        elif op in ("+", "-"):
            yield operands[0], lambda weight: weight
            yield operands[1], (lambda weight: weight) if op == "+" else negative
        elif op == "*" and operands[0] is operands[1]:
            yield operands[0], lambda weight: times(graph.number(2.0), times(weight, operands[0]))
        elif op == "*":
            yield operands[0], lambda weight: times(weight, operands[1])
            yield operands[1], lambda weight: times(weight, operands[0])
        elif op == "/":
            inverse = graph.inverse(operands[1])
            yield operands[0], lambda weight: times(weight, inverse)
            yield operands[1], lambda weight: negative(times(times(weight, inverse), node))
        elif op == "**" and node.value:
            exponent = graph.number(float(node.value))
            yield operands[0], lambda weight: times(times(exponent, weight), _power(node))
        elif op == "abs":
            test = make(">=", operands[0], ZERO)
            yield operands[0], lambda weight: choose(test, weight, negative(weight))
        elif op == "atan2":
            squares = [make("*", operand, operand) for operand in operands]
            inverse = self._over(graph.plus(squares[0], squares[1]))
            yield operands[0], lambda weight: times(weight, times(operands[1], inverse))
            yield operands[1], lambda weight: negative(times(weight, times(operands[0], inverse)))
        elif op == "hypot":
            inverse = self._over(node)
            yield operands[0], lambda weight: times(weight, times(operands[0], inverse))
            yield operands[1], lambda weight: times(weight, times(operands[1], inverse))
        elif op in ELEMENTARY:
            slope = ELEMENTARY[op](operands[0], node, self._over)
            yield operands[0], lambda weight: times(weight, slope)

    def _over(self, node: Node) -> Node:
        """1 over something not negative; 0 where it is zero, if it can be."""
        return graph.inverse(node) if node in self._divisors else graph.finite_inverse(node)

    def _derivatives_of(self, call: Node) -> dict[tuple[int, int], Node]:
        """Derivatives of a call's results by its arguments that move, by their indices."""
        if call not in self._slopes_of_calls:
            moving = tuple(index for index, node in enumerate(call.args) if node in self.active)
            function: Call = call.value
            if not moving or function.derivative is None:
                return {}
            self.calls[call], self._slopes_of_calls[call] = function.derivative(call, moving)
        return self._slopes_of_calls[call]


TAME = {"number", "name", "+", "-", "*", "neg", "abs", "min", "max", "if", "element", "not"}
TAME |= {*graph.COMPARISONS}
"""Operations that make finite numbers of moderate ones."""


def _always(node: Node) -> Sequence[Node]:
    """Operands that are computed whenever a node is: of a choice the test alone."""
    return node.args[:1] if node.op == "if" else node.args


def _sides(node: Node) -> tuple[Node, Node, Node]:
    """`min` or `max` as a choice: at a tie the last operand counts."""
    first, second = node.args
    return make("<" if node.op == "min" else ">", first, second), first, second


def _restricted(contribution: Contribution, test: Node) -> Contribution:
    """A contribution that only counts on one side of a choice."""
    return Contribution(graph.both(contribution.test, test), contribution.amount, masked=False)


def total_of(pending: Sequence[Contribution]) -> Contribution:
    """All contributions to a derivative as one."""
    total = pending[0]
    for contribution in pending[1:]:
        if contribution.test is total.test:
            amount = graph.plus(total.amount, contribution.amount)
            total = Contribution(contribution.test, amount, total.masked and contribution.masked)
        else:
            amount = graph.plus(total.zero_elsewhere, contribution.zero_elsewhere)
            total = Contribution(union(total.test, contribution.test), amount, masked=True)
    return total


def masked_amount(test: Node, amount: Node) -> Node:
    """An amount if a test is true, else zero; one test after the other, as equations have them."""
    if test.op == "if" and test.args[2] is FALSE:
        return choose(test.args[0], masked_amount(test.args[1], amount), ZERO)
    if test.op == "if" and test.args[1] is FALSE:
        return choose(test.args[0], ZERO, masked_amount(test.args[2], amount))
    return choose(test, amount, ZERO)


def union(first: Node, second: Node) -> Node:
    """Whether one or the other is true."""
    if first is second or first is TRUE:
        return first
    if second is TRUE or opposite(first) is second:
        return TRUE
    if first.op == "if" == second.op and first.args[0] is second.args[0]:
        test, first_if_true, first_if_false = first.args
        _, second_if_true, second_if_false = second.args
        return choose(
            test, union(first_if_true, second_if_true), union(first_if_false, second_if_false)
        )
    return graph.either(first, second)


def opposite(test: Node) -> Node:
    """`not` of a test."""
    return test.args[0] if test.op == "not" else make("not", test)


def _power(node: Node) -> Node:
    """A power with an exponent that is less by one."""
    base, exponent = node.args[0], node.value
    if exponent == 1:
        return ONE
    if exponent == 2:
        return base
    return make("**", base, value=exponent - 1)


def _arc(argument: Node, over: Callable[[Node], Node]) -> Node:
    """Derivative of the inverse sine."""
    return over(make("sqrt", minus(ONE, make("*", argument, argument))))


ELEMENTARY: dict[str, Callable[[Node, Node, Callable[[Node], Node]], Node]] = {
    "sqrt": lambda argument, value, over: times(graph.number(0.5), over(value)),
    "exp": lambda argument, value, over: value,
    "log": lambda argument, value, over: graph.inverse(argument),
    "sin": lambda argument, value, over: make("cos", argument),
    "cos": lambda argument, value, over: negative(make("sin", argument)),
    "tan": lambda argument, value, over: graph.plus(ONE, make("*", value, value)),
    "atan": lambda argument, value, over: graph.inverse(
        graph.plus(ONE, make("*", argument, argument))
    ),
    "tanh": lambda argument, value, over: minus(ONE, make("*", value, value)),
    "asin": lambda argument, value, over: _arc(argument, over),
    "acos": lambda argument, value, over: negative(_arc(argument, over)),
}
"""Derivatives of functions of one number, from its argument, its value and `Slopes._over`."""
