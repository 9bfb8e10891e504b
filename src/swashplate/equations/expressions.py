"""Scalar expressions: each kept once, so that equal ones are the same object.

`make` builds what an equation says, operation by operation and without changing anything, so that
values keep their last bit. `times`, `plus` and their like build derivatives: zeros and ones in them
are structural, and vanish.
"""

from collections.abc import Callable
from math import inf, isfinite
from typing import Any

COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")
LOGIC = ("and", "or", "not")
LEAVES = ("number", "name")
CALLED = (
    *("sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "tanh"),
    *("atan2", "hypot", "floor"),
)
"""Operations that are functions of `math`."""
CHEAP = {*LEAVES, *COMPARISONS, *LOGIC, "+", "-", "*", "neg", "min", "max", "abs", "if"}
"""Operations that can be done for nothing on any numbers: no error, no call of a library."""

_LEVELS = (
    ("if",),
    ("or",),
    ("and",),
    ("not",),
    COMPARISONS,
    ("+", "-"),
    ("*", "/"),
    ("neg",),
    ("**",),
)
_PRECEDENCE = {op: level for level, each in enumerate(_LEVELS, 1) for op in each}
ATOM = 10


class Node:
    """A scalar expression: an operation with its operands, a number, or a name.

    `op` is the operation, "number" or "name" for a leaf; `value` of a number itself, of a name its
    text, of a power its exponent; `kind` "float", "int" or "bool"; `reads` the names in it, `moves`
    those of them that its value follows continuously, not those of a decision; `cheap` says whether
    all of it is `CHEAP`.
    """

    __slots__ = ("_same", "args", "cheap", "kind", "moves", "op", "reads", "serial", "value")

    def __init__(self, op: str, args: "tuple[Node, ...]", value: Any, kind: str) -> None:
        self.op, self.args, self.value, self.kind = op, args, value, kind
        self.serial = len(_known)
        self._same: Node | None = None
        self.reads: frozenset[str] = frozenset((value,) if op == "name" else ())
        self.reads = self.reads.union(*(a.reads for a in args))
        moving = args[1:] if op == "if" else args
        follows = kind == "float" and op not in ("number", "floor")
        moves = frozenset[str]().union(*(a.moves for a in moving)) if moving else self.reads
        self.moves: frozenset[str] = moves if follows else frozenset()
        own = op in CHEAP or (op == "/" and args[1].op == "number" and args[1].value != 0.0)
        self.cheap: bool = own and all(a.cheap for a in args)

    @property
    def same(self) -> "Node":
        """One and the same node for all orders of the factors and summands in it."""
        if self._same is None:
            args = [a.same for a in self.args]
            if self.op in ("+", "*"):
                args.sort(key=lambda a: a.serial)
            again = tuple(args) == self.args
            self._same = self if again else make(self.op, *args, value=self.value)
        return self._same

    def __repr__(self) -> str:
        return text(self)


_known: dict[tuple[Any, ...], Node] = {}


def _kind(op: str, args: tuple[Node, ...]) -> str:
    if op in COMPARISONS or op in LOGIC:
        return "bool"
    kinds = {a.kind for a in (args[1:] if op == "if" else args)}
    if op == "floor" or (kinds == {"int"} and op not in ("/", *CALLED)):
        return "int"
    return "bool" if op == "if" and kinds == {"bool"} else "float"


def make(op: str, *args: Node, value: Any = None, kind: str | None = None) -> Node:
    """The expression of an operation and its operands."""
    text = repr(value) if op == "number" else value
    key = (op, args, text, kind)
    node = _known.get(key)
    if node is None:
        node = _known[key] = Node(op, args, value, kind or _kind(op, args))
    return node


def number(value: float) -> Node:
    """A literal number."""
    kind = {bool: "bool", int: "int"}.get(type(value), "float")
    return make("number", value=value, kind=kind)


def name(text: str, kind: str = "float") -> Node:
    """A variable, or a field of an argument as `p.Z8`."""
    return make("name", value=text, kind=kind)


ZERO, ONE = number(0.0), number(1.0)


def is_number(node: Node, value: float | None = None) -> bool:
    """Whether an expression is a literal number, or that one."""
    return node.op == "number" and (value is None or node.value == value)


def substitute(node: Node, by: dict[str, Node]) -> Node:
    """The expression with other expressions in place of names."""
    if not node.reads & by.keys():
        return node
    if node.op == "name":
        return by[node.value]
    return make(node.op, *(substitute(a, by) for a in node.args), value=node.value)


def size(node: Node) -> int:
    """Number of operations in an expression."""
    return sum(size(a) for a in node.args) + (node.op not in LEAVES)


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
        if a.value in (0.0, 1.0, -1.0):
            return ZERO if not a.value else b if a.value > 0.0 else negative(b)
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


def choose(test: Node, one: Node, two: Node) -> Node:
    """`one if test else two`."""
    if test.op == "number":
        return one if test.value else two
    return one if one is two else make("if", test, one, two)


def masked(guards: "tuple[tuple[Node, bool], ...]", a: Node) -> Node:
    """An amount that counts only where the tests come out as said."""
    for test, wanted in reversed(guards):
        a = choose(test, a, ZERO) if wanted else choose(test, ZERO, a)
    return a


def finite_inverse(a: Node) -> Node:
    """1/a for a ≥ 0, and 0 in place of infinity."""
    return inverse(choose(make(">", a, ZERO), a, number(inf)))


# --- text -----------------------------------------------------------------------------------------


def render(node: Node, known: Callable[[Node], str | None], straight: bool = False) -> str:
    """An expression as Python writes it, with the names that parts of it have.

    In `straight` text a choice between what is `CHEAP` is ``choose(test, one, two)``, and tests are
    joined by ``&`` and ``|``: no branch, which a compiler would take a while to remove.
    """

    def part(a: Node, level: int) -> str:
        text, own = written(a)
        return text if own >= level else f"({text})"

    def written(node: Node) -> tuple[str, int]:
        op, args, given = node.op, node.args, known(node)
        level = _PRECEDENCE.get(op, ATOM)
        if given is not None:
            return given, ATOM
        if op == "name":
            return node.value, ATOM
        if op == "number":
            return repr(node.value), ATOM if repr(node.value)[0] != "-" else _PRECEDENCE["neg"]
        if straight and op in ("and", "or") and node.cheap:
            return f" {'&' if op == 'and' else '|'} ".join(part(a, ATOM) for a in args), level
        if straight and op == "if" and args[1].cheap and args[2].cheap:
            return f"choose({', '.join(part(a, 1) for a in args)})", ATOM
        if op == "if":
            return f"{part(args[1], 2)} if {part(args[0], 2)} else {part(args[2], 1)}", level
        if op in ("and", "or"):
            return f" {op} ".join(part(a, level + 1) for a in args), level
        if op in ("not", "neg"):
            sign, least = ("not ", level) if op == "not" else ("-", level + 1)
            return f"{sign}{part(args[0], least)}", level
        if op == "**":
            return f"{part(args[0], level + 1)}**{node.value!r}", level
        if level < ATOM:
            left = level + 1 if op in COMPARISONS else level
            return f"{part(args[0], left)} {op} {part(args[1], level + 1)}", level
        return f"{op}({', '.join(part(a, 1) for a in args)})", ATOM

    return written(node)[0]


def text(node: Node) -> str:
    """An expression as Python writes it."""
    return render(node, lambda each: None)
