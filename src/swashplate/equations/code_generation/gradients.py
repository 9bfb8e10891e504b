"""Derivatives of what equations say: adjoints, carried backwards over their graph.

What a result follows nowhere is a structural zero: it has no entry.

Conventions where a derivative does not exist:

- Of `min` and `max` at a tie the last argument counts; `abs` at zero counts as rising.
- A conditional expression has the derivative of the side that is taken; decisions and `floor`
  have none.
- If `sqrt`, `asin`, `acos`, `hypot` or `atan2` has an infinite slope or none, it counts as 0.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

from swashplate.equations import graph
from swashplate.equations.code_generation.functions import FUNCTIONS, Function
from swashplate.equations.code_generation.printing import function_text, named_by_text
from swashplate.equations.graph import (
    FALSE,
    ONE,
    TRUE,
    ZERO,
    Call,
    Node,
    choose,
    make,
    minus,
    negative,
    ordered,
    times,
)
from swashplate.errors import EquationError


@dataclass(frozen=True, eq=False, repr=False)
class Derived(Function):
    """A function that returns the values of an equation, then its partial derivatives.

    It takes the arguments of the equation and returns one flat tuple.

    Attributes
    ----------
    outputs, inputs : tuple of str
        Dotted paths of the wanted results and of what they are differentiated by.
    entries : tuple of (int, int)
        Numbers of output and input of each partial derivative that is not structurally zero, in
        the order in which they follow the values.
    """

    outputs: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    entries: tuple[tuple[int, int], ...] = ()


def derived_function(
    name: str,
    docstring: str,
    formals: Sequence[str],
    results: Sequence[tuple[str, Node]],
    by: Sequence[tuple[str, str]],
    labels: Mapping[Node, str],
    *,
    chained: bool = False,
) -> Derived:
    """The function of some results with their derivatives.

    `formals` are its arguments, `results` paths and nodes of what is returned, `by` paths and names
    of what that is differentiated by; `name` may have `UNNAMED` in it.
    """
    values = [node for _, node in results]
    gradients = Gradients(values, [graph.name(argument) for _, argument in by], chained=chained)
    outputs = tuple(path for path, _ in results)
    inputs = tuple(path for path, _ in by)
    hints = {**labels, **gradients.hints(outputs, inputs, labels)}
    text, functions = function_text(
        name,
        docstring,
        formals,
        [*gradients.values, *gradients.partials.values()],
        hints,
        always_tuple=True,
    )
    for argument in formals:
        if argument in FUNCTIONS and re.search(rf"\b{argument}\(", text):
            raise EquationError(
                f"An argument is called {argument}, and so is the function that its derivatives "
                "need: give the argument another name."
            )
    entries = tuple(gradients.partials)
    return Derived(*named_by_text(name, text), dict(functions), outputs, inputs, entries)


def partials_of(
    results: Sequence[Node], by: Sequence[Node], *, chained: bool = False
) -> dict[tuple[int, int], Node]:
    """Partial derivatives of results by some nodes that are not structurally zero.

    By the indices of result and node; see `Gradients`.
    """
    return Gradients(results, by, chained=chained).partials


class Contribution(NamedTuple):
    """An amount of an adjoint, which counts if `test` is true.

    It is `masked` if it is zero already whenever the test is false.
    """

    test: Node
    amount: Node
    masked: bool

    @property
    def zero_elsewhere(self) -> Node:
        """The amount; zero if it does not count."""
        return self.amount if self.masked else _masked(self.test, self.amount)


class Gradients:
    """Derivatives of results with respect to some nodes, whose own operands count as given.

    By adjoints, backwards. With `chained`, if one result depends on another, the sweep ends at that
    one and goes on with its derivatives.

    Attributes
    ----------
    values : list of Node
        The results again: calls in them give their derivatives as well.
    partials : dict of (int, int) to Node
        By the indices of result and node, in their order.
    adjoints : list of dict of Node to Node
        Of each result, the derivatives by all that it follows.
    """

    def __init__(
        self, results: Sequence[Node], by: Sequence[Node], *, chained: bool = False
    ) -> None:
        self._by = dict.fromkeys(by)
        self._order = ordered(results, operands=graph.dependencies)
        self._active = self._active_nodes()
        self._divisors = {
            node.args[1] for node in ordered(results, operands=_always) if node.op == "/"
        }
        """What the results divide by, whatever tests say: a second division does no more harm."""
        self._calls: dict[Node, tuple[Node, dict[tuple[int, int], Node]]] = {}
        """Calls that move something: with derivatives, and these by indices of result and argument.
        """
        self._tame: dict[Node, bool] = {}
        order_of = {node: index for index, node in enumerate(self._order)}
        self._links: dict[Node, dict[Node, Node]] = {}
        self.adjoints: list[dict[Node, Node]] = [{} for _ in results]
        # a result that others follow comes first: their adjoints end at it
        for index in sorted(range(len(results)), key=lambda index: order_of[results[index]]):
            self.adjoints[index] = self._swept(results[index])
            if chained and results[index] not in self._by:
                self._links.setdefault(results[index], self.adjoints[index])
        plain = {node: derived for node, (derived, _) in self._calls.items()}
        entries = [
            (result, argument)
            for result in range(len(results))
            for argument, node in enumerate(by)
            if self.adjoints[result].get(node, ZERO) is not ZERO
        ]
        partials = [self.adjoints[result][by[argument]] for result, argument in entries]
        nodes = graph.rewritten([*results, *partials], plain)
        self.values = nodes[: len(results)]
        self.partials = dict(zip(entries, nodes[len(results) :], strict=True))

    def hints(
        self, outputs: Sequence[str], inputs: Sequence[str], labels: Mapping[Node, str]
    ) -> dict[Node, str]:
        """Names for derivatives, should they need one."""
        names: dict[Node, str] = {}
        computed = {*self._order}
        for (result, argument), node in self.partials.items():
            label = "" if len(outputs) == 1 else f"{word(outputs[result])}_"
            if node not in computed:
                names.setdefault(node, f"d_{label}{word(inputs[argument])}")
        for result, pending in enumerate(self.adjoints):
            label = "" if len(outputs) == 1 else f"{word(outputs[result])}_"
            for node, contribution in pending.items():
                name = labels.get(graph.plain_value(node))
                if name and contribution not in computed:
                    names.setdefault(contribution, f"d_{label}{name}")
        return names

    # -- what moves --------------------------------------------------------------------------------

    def _active_nodes(self) -> set[Node]:
        """Nodes that follow, continuously, what is differentiated by."""
        moves = set(self._by)
        for node in self._order:
            if node not in moves and any(operand in moves for operand in _followed(node)):
                moves.add(node)
        return moves

    # -- backward ----------------------------------------------------------------------------------

    def _swept(self, result: Node) -> dict[Node, Node]:
        """Derivatives of a result by all that it follows."""
        if result in self._links:
            return self._links[result]
        of_itself = Contribution(test=TRUE, amount=ONE, masked=False)
        pending: dict[Node, list[Contribution]] = {result: [of_itself]}
        adjoints: dict[Node, Node] = {}
        for node in reversed(self._order):
            if node not in pending or node not in self._active:
                continue
            total = _total(pending.pop(node))
            adjoints[node] = total.zero_elsewhere
            if adjoints[node] is ZERO or node in self._by:
                continue
            for below, contribution in self._contributions(node, total):
                pending.setdefault(below, []).append(contribution)
        return adjoints

    def _contributions(
        self, node: Node, total: Contribution
    ) -> Iterator[tuple[Node, Contribution]]:
        """What an adjoint gives on, with the nodes that it goes to."""
        if node in self._links:
            for below, slope in self._links[node].items():
                if below in self._by:
                    yield below, Contribution(total.test, times(total.amount, slope), masked=False)
            return
        for argument, push in self._pushed(node):
            if argument in self._active:
                contribution = push(total)
                if contribution.amount is not ZERO:
                    yield argument, contribution

    def _pushed(self, node: Node) -> Iterator[tuple[Node, Callable[[Contribution], Contribution]]]:
        """Operands of a node, each with what an adjoint becomes on the way to it."""
        if node.op in ("min", "max", "if"):
            test, first, second = node.args if node.op == "if" else _sides(node)
            yield first, lambda contribution: _restricted(contribution, test)
            yield second, lambda contribution: _restricted(contribution, _opposite(test))
            return
        for argument, slope in self._slopes(node):
            yield argument, partial(self._multiplied, slope)

    def _multiplied(
        self, slope: Callable[[Node], Node], contribution: Contribution
    ) -> Contribution:
        """A contribution times a derivative, which need not be finite if it does not count."""
        amount = slope(contribution.amount)
        light = contribution.masked and self._stays_finite(slope(ONE))
        return Contribution(contribution.test, amount, light)

    def _stays_finite(self, node: Node) -> bool:
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
        if call not in self._calls:
            moving = tuple(index for index, node in enumerate(call.args) if node in self._active)
            function: Call = call.value
            if not moving or function.derivative is None:
                return {}
            derived = function.derivative(moving)
            count = len(derived.outputs)
            with_derivatives = Call(derived, count + len(derived.entries))
            again = make("call", *call.args, value=with_derivatives)
            partials = {
                (result, moving[argument]): make("result", again, value=count + index)
                for index, (result, argument) in enumerate(derived.entries)
            }
            self._calls[call] = again, partials
        return self._calls[call][1]


TAME = {"number", "name", "+", "-", "*", "neg", "abs", "min", "max", "if", "not"}
TAME |= {*graph.COMPARISONS}
"""Operations that make finite numbers of moderate ones."""


def _followed(node: Node) -> Sequence[Node]:
    """Operands that a value follows continuously: no decision, and nothing in whole numbers."""
    if node.kind != "float" or node.op in ("number", "name"):
        return ()
    if node.op == "ruled":
        return node.value.arguments  # type: ignore[no-any-return]
    return node.args[1:] if node.op == "if" else node.args


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


def _total(pending: Sequence[Contribution]) -> Contribution:
    """All contributions to an adjoint as one."""
    total = pending[0]
    for contribution in pending[1:]:
        if contribution.test is total.test:
            amount = graph.plus(total.amount, contribution.amount)
            total = Contribution(contribution.test, amount, total.masked and contribution.masked)
        else:
            amount = graph.plus(total.zero_elsewhere, contribution.zero_elsewhere)
            total = Contribution(_union(total.test, contribution.test), amount, masked=True)
    return total


def _masked(test: Node, amount: Node) -> Node:
    """An amount if a test is true, else zero; one test after the other, as equations have them."""
    if test.op == "if" and test.args[2] is FALSE:
        return choose(test.args[0], _masked(test.args[1], amount), ZERO)
    if test.op == "if" and test.args[1] is FALSE:
        return choose(test.args[0], ZERO, _masked(test.args[2], amount))
    return choose(test, amount, ZERO)


def _union(first: Node, second: Node) -> Node:
    """Whether one or the other is true."""
    if first is second or first is TRUE:
        return first
    if second is TRUE or _opposite(first) is second:
        return TRUE
    if first.op == "if" == second.op and first.args[0] is second.args[0]:
        test, first_if_true, first_if_false = first.args
        _, second_if_true, second_if_false = second.args
        return choose(
            test, _union(first_if_true, second_if_true), _union(first_if_false, second_if_false)
        )
    return graph.either(first, second)


def _opposite(test: Node) -> Node:
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
"""Derivatives of functions of one number, from its argument, its value and `Gradients._over`."""


def word(path: str) -> str:
    """A path as part of a name."""
    return path.replace(".", "_").replace("[", "_").replace("]", "")


def listed(inputs: Sequence[str]) -> str:
    """Inputs, as far as one wants to read them."""
    return ", ".join(inputs) if len(inputs) <= 6 else f"{len(inputs)} inputs"
