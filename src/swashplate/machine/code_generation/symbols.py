"""Numbers that are known only when a model runs, as Python's operators see them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NoReturn

from swashplate.machine import graph
from swashplate.machine.code_generation.runner import Runner
from swashplate.machine.code_generation.values import NotGiven, Option, node_of
from swashplate.machine.graph import Node


class RefusedError(Exception):
    """What an equation cannot do, and what to write in its place; its line is added later."""

    def __init__(self, what: str, instead: str) -> None:
        self.what, self.instead = what, instead
        super().__init__(f"{what}: {instead}")


def operand(value: Any, doing: str = "arithmetic with", instead: str = "name its elements") -> Node:
    """A symbol or a number as a node."""
    if isinstance(value, Symbol):
        return value.node
    node = node_of(value)
    if node is not None:
        return node
    if value is None or isinstance(value, Option | NotGiven):
        raise RefusedError(f"{doing} an option", "test it with `is None`")
    if isinstance(value, tuple):
        raise RefusedError(f"{doing} a tuple", instead)
    raise RefusedError(f"{doing} a {type(value).__name__}", "use real numbers")


def _arithmetic(op: str, *, swapped: bool = False) -> Callable[[Any, Any], Any]:
    """An operation with another number, exactly as written."""

    def operate(symbol: Symbol, other: Any) -> Symbol:
        left, right = symbol.node, operand(other)
        if swapped:
            left, right = right, left
        if op == "*" and left.kind == right.kind == "float":  # a factor that is known to be one
            for factor, rest in ((left, right), (right, left)):
                if graph.is_number(factor, 1.0):
                    return symbol.of(rest)
        return symbol.of(symbol.runner.make(op, left, right))

    return operate


def _comparison(op: str) -> Callable[[Any, Any], Any]:
    """A comparison with another number."""

    def compare(symbol: Symbol, other: Any) -> Symbol:
        right = operand(other, "a comparison of", "compare its elements")
        return symbol.of(symbol.runner.make(op, symbol.node, right))

    return compare


def _refused(what: str, instead: str) -> Callable[..., Any]:
    """Something that a symbol does not do."""

    def refuse(symbol: Symbol, *_: Any) -> NoReturn:
        raise RefusedError(what, instead)

    return refuse


_UNKNOWN = "of a number that is known only when the model runs"


class Symbol:
    """A number that is known only when the model runs: a node, and what runs the equation."""

    __slots__ = ("node", "runner")

    def __init__(self, node: Node, runner: Runner) -> None:
        self.node, self.runner = node, runner

    def of(self, node: Node) -> Symbol:
        """Another number of the same run."""
        return Symbol(node, self.runner)

    __add__, __radd__ = _arithmetic("+"), _arithmetic("+", swapped=True)
    __sub__, __rsub__ = _arithmetic("-"), _arithmetic("-", swapped=True)
    __mul__, __rmul__ = _arithmetic("*"), _arithmetic("*", swapped=True)
    __truediv__, __rtruediv__ = _arithmetic("/"), _arithmetic("/", swapped=True)
    __lt__, __le__ = _comparison("<"), _comparison("<=")
    __gt__, __ge__ = _comparison(">"), _comparison(">=")
    __eq__, __ne__ = _comparison("=="), _comparison("!=")

    def __pos__(self) -> Symbol:
        return self

    def __neg__(self) -> Symbol:
        if self.node.op == "number":
            return self.of(graph.number(-self.node.value))
        return self.of(self.runner.make("neg", self.node))

    def __pow__(self, power: Any) -> Symbol:
        if not isinstance(power, int | float) or isinstance(power, bool) or power != int(power):
            self.__rpow__(power)
        return self.of(self.runner.make("**", self.node, value=int(power)))

    __rpow__ = _refused("a power other than a whole number", "write sqrt(a), or exp(b * log(a))")
    __floordiv__ = __rfloordiv__ = _refused("//", "write floor(a / b)")
    __mod__ = __rmod__ = _refused("%", "write a - b * floor(a / b)")
    __matmul__ = __rmatmul__ = _refused("@", "write the products out")
    __and__ = __rand__ = _refused("&", "write `and`")
    __or__ = __ror__ = _refused("|", "write `or`")
    __xor__ = __rxor__ = _refused("^", "write `!=` of two tests, or ** for a power")
    __lshift__ = __rlshift__ = _refused("<<", "multiply")
    __rshift__ = __rrshift__ = _refused(">>", "divide")
    __invert__ = _refused("~", "write `not`")
    __bool__ = _refused(
        f"a decision {_UNKNOWN}, where Python decides at once", "write it with if, and, or, not"
    )
    __float__ = _refused(f"float {_UNKNOWN}", "leave it out")
    __int__ = _refused(f"int {_UNKNOWN}", "write floor(x), which rounds down")
    __round__ = _refused(f"round {_UNKNOWN}", "write floor(x + 0.5), which rounds halves up")
    __format__ = __str__ = __repr__ = _refused(f"text {_UNKNOWN}", "leave it out")
    __hash__ = _refused(f"a key or a member {_UNKNOWN}", "use a tuple and its elements")
    __index__ = _refused(
        f"a count or an index {_UNKNOWN}", "write a whole number, or use repeated for a loop"
    )
    __iter__ = __len__ = __getitem__ = __contains__ = _refused(
        "a number in the place of a tuple", "use a tuple"
    )


class Unset(Symbol):
    """A name that has no value yet: whatever is done with it is refused."""

    __slots__ = ("name",)

    def __init__(self, name: str) -> None:
        self.name = name

    def __getattribute__(self, attribute: str) -> Any:
        if attribute == "__class__":
            return Unset
        name = object.__getattribute__(self, "name")
        raise RefusedError(f"{name} without a value on some path", "give it a value on every path")
