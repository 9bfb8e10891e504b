"""The graph evaluated by Python, number by number: what compiled code is held against.

Of a decision only the way that is taken is computed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from operator import add, eq, ge, gt, le, lt, mul, ne, neg, sub
from typing import Any

from swashplate.equations import graph
from swashplate.equations.code_generation.loops import Inner, Loop, root
from swashplate.equations.code_generation.values import leaves
from swashplate.equations.declaration import interpreted
from swashplate.equations.graph import MATH_FUNCTIONS, Node, plain_value


def evaluated(ends: Iterable[Node], known: dict[Node, Any]) -> list[Any]:
    """Values of some nodes; `known` has those of names, and gets all others."""
    ends = [plain_value(end) for end in ends]
    stack = ends[::-1]
    while stack:
        node = stack[-1]
        waiting = () if node in known else _waiting(node, known)
        if waiting:
            stack += waiting
            continue
        if node not in known:
            known[node] = _value(node, known)
        stack.pop()
    return [known[end] for end in ends]


def _waiting(node: Node, known: Mapping[Node, Any]) -> list[Node]:
    """Operands that must be known first."""
    operands = [plain_value(operand) for operand in node.args]
    if node.op == "if" and operands[0] in known:
        operands = [operands[1] if known[operands[0]] else operands[2]]
    elif node.op == "if":
        operands = operands[:1]
    return [operand for operand in operands if operand not in known]


def _value(node: Node, known: Mapping[Node, Any]) -> Any:
    if node.op == "number":
        return node.value
    if node.op == "if":
        test, if_true, if_false = map(plain_value, node.args)
        return known[if_true if known[test] else if_false]
    operands = [known[plain_value(operand)] for operand in node.args]
    if node.op == "result":
        return operands[0][node.value]
    if node.op == "call":
        return _called(node.value.loop, operands)
    if node.op == "**":
        return power(operands[0], node.value)
    return OPERATIONS[node.op](*operands)


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


def _called(loop: Loop, operands: Sequence[Any]) -> tuple[Any, ...]:
    """Results of an equation that is called once, or in a loop."""
    inner = loop.inner
    if loop.kind == "once":
        return _inner(inner, operands)
    if loop.kind == "root":
        return (interpreted(root)(lambda *given: _inner(inner, given)[0], *operands),)
    size = len(inner.leading) - 1
    state, others = tuple(operands[1 : 1 + size]), operands[1 + size :]
    for number in range(int(operands[0])):
        state = _inner(inner, [*state, float(number), *others])
    return state


def _inner(inner: Inner, arguments: Sequence[Any]) -> tuple[Any, ...]:
    """What an equation returns for numbers that stand for its arguments."""
    formals = {**inner.leading, **inner.formals}
    known = {
        graph.name(name, kind): argument
        for (name, kind), argument in zip(formals.items(), arguments, strict=True)
    }
    return tuple(evaluated([node for _, node in leaves(inner.result)], known))


OPERATIONS: dict[str, Callable[..., Any]] = {
    **{"+": add, "-": sub, "*": mul, "/": _over, "neg": neg, "abs": abs, "min": min, "max": max},
    **{"<": lt, "<=": le, ">": gt, ">=": ge, "==": eq, "!=": ne, "not": lambda test: not test},
    **{name: _as_compiled(getattr(math, name)) for name in MATH_FUNCTIONS},
}
