"""One graph of scalars: each expression is kept once, so that equal ones are the same node.

`make` builds what an equation says, operation by operation and without changing anything, so that
values keep their last bit. `times`, `plus` and their like build derivatives: zeros and ones in them
are structural, and vanish.

Besides arithmetic there are

- "if": one of two values, by a test; `and` and `or` are choices with a literal side;
- "ruled": a value whose derivatives are declared, by the `Rule` that is the node's `value`;
- "call" of a generated function, and "result", one of the numbers that it returns.
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
CHEAP = {*LEAVES, *COMPARISONS, "not", "+", "-", "*", "neg", "min", "max", "abs", "if", "ruled"}
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
        ruled value its `Rule`, of a call its `Call`.
    kind : str
        "float", "int" or "bool".
    """

    __slots__ = ("args", "kind", "op", "value")

    def __init__(self, op: str, args: tuple[Node, ...], value: Any, kind: str) -> None:
        self.op, self.args, self.value, self.kind = op, args, value, kind

    def __repr__(self) -> str:
        operands = ", ".join(map(repr, self.args))
        return f"{self.op}({operands})" if self.args else str(self.value)


class Rule:
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
    """A generated function that is called, and how its derivatives are had.

    `results` is how many numbers the function returns. `derivative` makes the function that returns
    the same numbers and their derivatives by some of its arguments, which are given by their
    indices; None if nothing flows through it. `loop` says what the function does, from which other
    languages print theirs.
    """

    def __init__(
        self,
        function: Any,
        results: int,
        derivative: Callable[[tuple[int, ...]], Any] | None = None,
        loop: Any = None,
    ) -> None:
        self.function, self.results, self.derivative = function, results, derivative
        self.loop = loop


_known: dict[tuple[Any, ...], Node] = {}


def _kind(op: str, args: tuple[Node, ...]) -> str:
    if op in COMPARISONS or op == "not":
        return "bool"
    if op == "ruled":
        return args[0].kind
    if op in ("call", "result"):
        return "float"
    kinds = {a.kind for a in (args[1:] if op == "if" else args)}
    if op == "floor" or (kinds == {"int"} and op not in ("/", *MATH_FUNCTIONS)):
        return "int"
    return "bool" if op == "if" and kinds == {"bool"} else "float"


def make(op: str, *args: Node, value: Any = None, kind: str | None = None) -> Node:
    """The expression of an operation and its operands."""
    text = repr(value) if op == "number" else value
    kind = kind or _kind(op, args)
    key = (op, args, text, kind)
    node = _known.get(key)
    if node is None:
        node = _known[key] = Node(op, args, value, kind)
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


def is_number(node: Node, value: float | None = None) -> bool:
    """Whether an expression is a literal number, or that one."""
    return node.op == "number" and (value is None or node.value == value)


# --- walks ----------------------------------------------------------------------------------------


def operands_of(node: Node) -> Sequence[Node]:
    """Operands of a node."""
    return node.args


def ordered(
    ends: Iterable[Node],
    known: Collection[Node] = (),
    operands: Callable[[Node], Sequence[Node]] = operands_of,
) -> list[Node]:
    """Nodes that some ends are computed from, each after its operands; none below `known` ones."""
    done, order = set(known), list[Node]()
    stack = [*ends][::-1]
    while stack:
        node = stack[-1]
        if node in done:
            stack.pop()
            continue
        waiting = [a for a in operands(node) if a not in done]
        if waiting:
            stack += waiting[::-1]
            continue
        done.add(node)
        order.append(node)
        stack.pop()
    return order


def names_in(ends: Iterable[Node], known: Collection[Node] = ()) -> set[str]:
    """Names that some ends are computed from."""
    return {node.value for node in ordered(ends, known) if node.op == "name"}


def dependencies(node: Node) -> Sequence[Node]:
    """Operands of a node, and what else its declared derivatives are by."""
    return (*node.args, *node.value.arguments) if node.op == "ruled" else node.args


def rewritten(ends: Iterable[Node], by: Mapping[Node, Node]) -> list[Node]:
    """The ends with other nodes in place of some."""
    ends = [*ends]
    made = dict(by)
    for node in ordered(ends, by, dependencies):
        args, value = tuple(made[a] for a in node.args), node.value
        again = args == node.args
        if node.op == "ruled":
            arguments = tuple(made[a] for a in value.arguments)
            again = again and arguments == value.arguments
            value = _rewritten_rule(value, arguments, by)
        made[node] = node if again else make(node.op, *args, value=value, kind=node.kind)
    return [made[node] for node in ends]


def _rewritten_rule(rule: Rule, arguments: tuple[Node, ...], by: Mapping[Node, Node]) -> Rule:
    return Rule(arguments, lambda: tuple(rewritten(rule.slopes, by)))


def plain_value(node: Node) -> Node:
    """A value without the rule of its derivatives."""
    while node.op == "ruled":
        (node,) = node.args
    return node


# --- choices --------------------------------------------------------------------------------------


def choose(test: Node, one: Node, two: Node) -> Node:
    """`one if test else two`."""
    if test.op == "number":
        return one if test.value else two
    if one is TRUE and two is FALSE:
        return test
    if test.op == "not":
        return choose(test.args[0], two, one)
    return one if one is two else make("if", test, one, two)


def both(one: Node, two: Node) -> Node:
    """`one and two`."""
    return choose(one, two, FALSE)


def either(one: Node, two: Node) -> Node:
    """`one or two`."""
    return choose(one, TRUE, two)


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
        test, one, two = a.args
        _, three, four = b.args
        if ZERO in (one, three) and ZERO in (two, four):  # the two halves of one choice
            return choose(test, plus(one, three), plus(two, four))
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
