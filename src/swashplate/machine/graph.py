"""One graph of scalars: each expression is kept once, so that equal ones are the same node.

`make` builds what an equation says, operation by operation and without changing anything, so that
values keep their last bit. `times`, `plus` and their like build derivatives: zeros and ones in them
are structural, and vanish.

Besides arithmetic there are

- "if": one of two values, by a test; `and` and `or` are choices with a literal side;
- "past": what a value was, of the value now and its age in samples, which changes;
- "element": one of several values, by its number from 0, which is the first operand;
- "segment": the number of the last of several rising values that is not above the first operand,
  but not of the last value of all, 0 if there is none;
- "ruled": a value whose derivatives are declared, by the `DerivativeRule` in the node's `value`;
- "call" of an equation apart, and "result", one of the numbers that it returns.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from math import inf, isfinite
from typing import Any

COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")
LEAVES = ("number", "name")
MATH_FUNCTIONS = (
    *("sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "tanh"),
    *("atan2", "hypot", "floor"),
)
"""Operations that are functions of `math`."""
CHOSEN = ("if", "element")
"""Operations whose value is one of their operands after the first."""
CHEAP = {*LEAVES, *COMPARISONS, "not", "+", "-", "*", "neg", "min", "max", "abs", "if", "ruled"}
CHEAP |= {"element"}
"""Operations that cost next to nothing on any numbers: no error, no call of a library."""


class Node:
    """A scalar expression: an operation with its operands, a number, or a name.

    Attributes
    ----------
    op : str
        The operation; "number" or "name" for a leaf.
    args : tuple of Node
        What its value is computed from.
    value : object
        Of a number itself, of a name its text, of a power its exponent, of a result its index; of a
        ruled value its `DerivativeRule`, of a call its `Call`.
    kind : str
        "float", "int" or "bool".
    """

    __slots__ = ("args", "kind", "op", "value")

    def __init__(self, op: str, operands: tuple[Node, ...], value: Any, kind: str) -> None:
        self.op, self.args, self.value, self.kind = op, operands, value, kind

    def __repr__(self) -> str:
        printed = ", ".join(map(repr, self.args))
        return f"{self.op}({printed})" if self.args else str(self.value)


class DerivativeRule:
    """Declared derivatives of a value.

    `arguments` are all floats that it may follow; `slopes` gives the derivative by each of them,
    when it is first asked for.
    """

    def __init__(self, arguments: tuple[Node, ...], slopes: Callable[[], tuple[Node, ...]]) -> None:
        self.arguments, self._trace = arguments, slopes
        self._slopes: tuple[Node, ...] | None = None

    @property
    def slopes(self) -> tuple[Node, ...]:
        """The derivative by each argument."""
        if self._slopes is None:
            self._slopes = self._trace()
        return self._slopes


class Call:
    """An equation that is called apart, and how its derivatives are had.

    `results` is how many numbers it returns, `loop` says what it does. `derivative` takes a node
    that calls it and indices of arguments that move; it gives a call that returns the same numbers
    first, and nodes of their derivatives by the indices of result and argument. None if nothing
    flows through it.
    """

    def __init__(
        self,
        results: int,
        loop: Any,
        derivative: Callable[[Node, tuple[int, ...]], tuple[Node, dict[tuple[int, int], Node]]]
        | None = None,
    ) -> None:
        self.results, self.loop, self.derivative = results, loop, derivative


_nodes: dict[tuple[Any, ...], Node] = {}


def _kind(op: str, operands: tuple[Node, ...]) -> str:
    if op in COMPARISONS or op == "not":
        return "bool"
    if op == "ruled":
        return operands[0].kind
    if op in ("call", "result", "segment"):
        return "float"
    kinds = {operand.kind for operand in (operands[1:] if op in CHOSEN else operands)}
    if op == "floor" or (kinds == {"int"} and op not in ("/", *MATH_FUNCTIONS)):
        return "int"
    return "bool" if op == "if" and kinds == {"bool"} else "float"


def make(op: str, *operands: Node, value: Any = None, kind: str | None = None) -> Node:
    """The expression of an operation and its operands."""
    text = repr(value) if op == "number" else value
    if op == "**" and value < 0:
        kind = "float"
    kind = kind or _kind(op, operands)
    key = (op, operands, text, kind)
    node = _nodes.get(key)
    if node is None:
        node = _nodes[key] = Node(op, operands, value, kind)
    return node


def number(value: float) -> Node:
    """A literal number."""
    kind = {bool: "bool", int: "int"}.get(type(value), "float")
    # what NumPy has made of a number is written otherwise
    return make("number", value=float(value) if kind == "float" else value, kind=kind)


def name(text: str, kind: str = "float") -> Node:
    """A variable, or a field of an argument as `p.Z8`."""
    return make("name", value=text, kind=kind)


ZERO, ONE = number(0.0), number(1.0)
TRUE, FALSE = number(True), number(False)


def is_number(node: Node, expected: float | None = None) -> bool:
    """Whether an expression is a literal number, or that one."""
    return node.op == "number" and (expected is None or node.value == expected)


# --- walks ----------------------------------------------------------------------------------------


def operands_of(node: Node) -> Sequence[Node]:
    """Operands of a node."""
    return node.args


def ordered(
    ends: Iterable[Node],
    available: Collection[Node] = (),
    operands: Callable[[Node], Sequence[Node]] = operands_of,
) -> list[Node]:
    """Nodes that some ends are computed from, each after its operands.

    Those that are `available`, and what only they need, are left out.
    """
    done, order = set(available), list[Node]()
    stack = [*ends][::-1]
    while stack:
        node = stack[-1]
        if node in done:
            stack.pop()
            continue
        waiting = [operand for operand in operands(node) if operand not in done]
        if waiting:
            stack += waiting[::-1]
            continue
        done.add(node)
        order.append(node)
        stack.pop()
    return order


def names_in(ends: Iterable[Node], available: Collection[Node] = ()) -> set[str]:
    """Names that some ends are computed from."""
    return {node.value for node in ordered(ends, available) if node.op == "name"}


def dependencies(node: Node) -> Sequence[Node]:
    """Operands of a node, and what else its declared derivatives are by."""
    return (*node.args, *node.value.arguments) if node.op == "ruled" else node.args


def rewritten(ends: Iterable[Node], replacements: Mapping[Node, Node]) -> list[Node]:
    """The ends with other nodes in place of some; what that decides is decided."""
    ends = [*ends]
    replaced = dict(replacements)
    for node in ordered(ends, replacements, dependencies):
        operands = tuple(replaced[operand] for operand in node.args)
        value = node.value
        unchanged = operands == node.args
        if node.op == "ruled":
            arguments = tuple(replaced[operand] for operand in value.arguments)
            unchanged = unchanged and arguments == value.arguments
            value = _rewritten_rule(value, arguments, replacements)
        if unchanged:
            replaced[node] = node
        elif node.op == "if":
            replaced[node] = choose(*operands)
        else:
            replaced[node] = make(node.op, *operands, value=value, kind=node.kind)
    return [replaced[node] for node in ends]


def _rewritten_rule(
    rule: DerivativeRule, arguments: tuple[Node, ...], replacements: Mapping[Node, Node]
) -> DerivativeRule:
    return DerivativeRule(arguments, lambda: tuple(rewritten(rule.slopes, replacements)))


def plain_value(node: Node) -> Node:
    """A value without the rule of its derivatives."""
    while node.op == "ruled":
        (node,) = node.args
    return node


# --- choices --------------------------------------------------------------------------------------


def choose(test: Node, if_true: Node, if_false: Node) -> Node:
    """`one if test else two`."""
    if test.op == "number":
        return if_true if test.value else if_false
    if if_true is TRUE and if_false is FALSE:
        return test
    if test.op == "not":
        return choose(test.args[0], if_false, if_true)
    return if_true if if_true is if_false else make("if", test, if_true, if_false)


def both(first: Node, second: Node) -> Node:
    """`one and two`."""
    return choose(first, second, FALSE)


def either(first: Node, second: Node) -> Node:
    """`one or two`."""
    return choose(first, TRUE, second)


# --- derivatives: zeros and ones are structural ---------------------------------------------------


def negative(a: Node) -> Node:
    """-a."""
    if a.op == "number":
        return number(-a.value) if a.value else ZERO
    if a.op == "neg":
        return a.args[0]
    if a.op == "-":
        return make("-", a.args[1], a.args[0])
    return make("neg", a)


def plus(a: Node, b: Node) -> Node:
    """a + b."""
    if is_number(a, 0.0) or is_number(b, 0.0):
        return b if is_number(a, 0.0) else a
    if is_number(a) and is_number(b):
        return number(a.value + b.value)
    if b.op == "neg":
        return minus(a, b.args[0])
    if a.op == "neg":
        return minus(b, a.args[0])
    if a is b:
        return times(number(2.0), a)
    if a.op == "+" and a.args[1] is b:
        return plus(a.args[0], times(number(2.0), b))
    if a.op == "if" == b.op and a.args[0] is b.args[0]:
        test, a_if_true, a_if_false = a.args
        _, b_if_true, b_if_false = b.args
        if ZERO in (a_if_true, b_if_true) and ZERO in (
            a_if_false,
            b_if_false,
        ):  # the two halves of one choice
            return choose(test, plus(a_if_true, b_if_true), plus(a_if_false, b_if_false))
    return make("+", a, b)


def minus(a: Node, b: Node) -> Node:
    """a - b."""
    if is_number(b, 0.0):
        return a
    if is_number(a, 0.0):
        return negative(b)
    if is_number(a) and is_number(b):
        return number(a.value - b.value)
    if b.op == "neg":
        return plus(a, b.args[0])
    if a.op == "-" and a.args[1] is b:
        return minus(a.args[0], times(number(2.0), b))
    return make("-", a, b)


def times(a: Node, b: Node) -> Node:
    """a b."""
    if is_number(b):
        a, b = b, a
    if is_number(a):
        if a.value == 0.0:
            return ZERO
        if a.value in (1.0, -1.0):
            return b if a.value > 0.0 else negative(b)
        if is_number(b) and isfinite(a.value * b.value):
            return number(float(a.value * b.value))
        if b.op == "*" and is_number(b.args[0]):
            return times(number(float(a.value * b.args[0].value)), b.args[1])
        if b.op == "if" and (is_number(b.args[1]) or is_number(b.args[2])):
            return choose(b.args[0], times(a, b.args[1]), times(a, b.args[2]))
    if a.op == "neg":
        return negative(times(a.args[0], b))
    if b.op == "neg":
        return negative(times(a, b.args[0]))
    if b.op == "*" and is_number(b.args[0]) and not is_number(a):  # numbers to the front
        return times(b.args[0], times(a, b.args[1]))
    return make("*", a, b)


def inverse(a: Node) -> Node:
    """1/a."""
    if is_number(a):
        return number(1.0 / a.value)
    if a.op == "/" and is_number(a.args[0], 1.0):
        return a.args[1]
    if a.op == "neg":
        return negative(inverse(a.args[0]))
    return make("/", ONE, a)


def finite_inverse(a: Node) -> Node:
    """1/a for a > 0, and 0 for a = 0."""
    return inverse(choose(make(">", a, ZERO), a, number(inf)))
