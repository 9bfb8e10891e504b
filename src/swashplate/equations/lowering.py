"""Reading an equation as a program, for arguments of known shapes."""

import ast
from collections.abc import Callable, Sequence
from functools import lru_cache, wraps
from threading import RLock
from types import FunctionType
from typing import Any, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

from swashplate.equations import expressions as ex
from swashplate.equations.expressions import Node
from swashplate.equations.program import (
    Body,
    Choice,
    Fork,
    Item,
    Let,
    Open,
    Program,
    Shape,
    Tuple,
    Value,
    actual,
    argument,
    endings,
    floats,
    leaves,
    path_of,
    paths,
    rebuilt,
    shape,
)
from swashplate.equations.syntax import (
    CHOICES,
    MATH,
    has_return,
    parsed,
    plain,
    whole,
)
from swashplate.equations.terms import Environment, Terms

P = ParamSpec("P")
R = TypeVar("R")

GENERATING = RLock()
"""Held by the one thread that reads equations or writes code, which compares by identity."""
_programs: dict[tuple[FunctionType, tuple[Shape, ...]], Program] = {}
_under_way: list[FunctionType] = []
RULES: "WeakKeyDictionary[FunctionType, Any]" = WeakKeyDictionary()
"""Equations that return the derivatives of others."""


def lower(function: Any, shapes: tuple[Shape, ...]) -> Program:
    """The program of an equation for arguments of some shapes; made once."""
    with GENERATING:
        return _lower(function, shapes)


def _lower(function: Any, shapes: tuple[Shape, ...]) -> Program:
    f = plain(function)
    key = (f, shapes)
    if key not in _programs:
        source = parsed(f)
        if f in _under_way:
            source.refuse(None, "a call of itself", "write a loop over a literal range")
        _under_way.append(f)
        try:
            program = _Lowering(source, shapes, lower).program()
            if f in RULES:
                _ruled(program, RULES[f])
            _programs[key] = program
        finally:
            _under_way.pop()
    return _programs[key]


def declare(function: Any, rule: Any) -> None:
    """Have a rule known for the derivatives of an equation."""
    parsed(rule, typed=False)
    RULES[plain(function)] = rule
    _programs.clear()


def _ruled(program: Program, rule: Any) -> None:
    """Enter a declared rule: what the result follows is what the rule says."""
    lowered = lower(rule, program.shapes)
    by = floats(program)
    rows = [[n for _, n in leaves(end)] for end in endings(lowered.body)]
    count = len(program.moving)
    if any(len(row) != len(by) * count for row in rows):
        lowered.source.refuse(
            None,
            f"a number of derivatives that is not {len(by) * count}",
            f"return those by {', '.join(by)}, in order",
        )
    program.rule = rule
    program.moving = tuple(
        tuple(
            path
            for i, path in enumerate(by)
            if any(not ex.is_number(row[o * len(by) + i], 0.0) for row in rows)
        )
        for o in range(count)
    )


class _Lowering(Terms):
    """Reads statements."""

    def program(self) -> Program:
        names = [a.arg for a in self.source.arguments]
        arguments = tuple((n, argument(s, n)) for n, s in zip(names, self.shapes, strict=True))
        self.taken.update(names, MATH.values(), CHOICES.values(), ("inf",))
        self.taken.update(
            each.id for each in ast.walk(self.source.node) if isinstance(each, ast.Name)
        )
        self.taken -= set(self.source.function.__code__.co_varnames) - set(names)
        statements = self.source.node.body
        body = self.block(statements, dict(arguments), [])
        results = list(endings(body))
        for each in results[1:]:
            if not _alike(shape(each), shape(results[0])):
                self.source.refuse(
                    None, "results of different structure", "return the same tuple on every way"
                )
        kinds = zip(*([n.kind for _, n in leaves(r)] for r in results), strict=True)
        mixed = [k[0] if len(set(k)) == 1 else "float" for k in kinds]
        result = rebuilt(results[0], iter([ex.name("value", k) for k in mixed]))
        return Program(
            self.source,
            self.shapes,
            arguments,
            body,
            result,
            _moving(body, arguments),
            frozenset(self.own),
        )

    # -- statements --------------------------------------------------------------------------------

    def block(self, statements: Sequence[ast.stmt], env: Environment, items: list[Item]) -> Body:
        """Items up to the end of the equation."""
        pending = list(statements)
        while pending:
            each = pending.pop(0)
            if isinstance(each, ast.Return):
                assert each.value is not None
                hint = each.value.id if isinstance(each.value, ast.Name) else "value"
                end = self.value(each.value, env, items, hint)
                if isinstance(end, Open):
                    self.source.refuse(each, "a tuple of unknown length", "return its elements")
                return Body(items, end)
            if isinstance(each, ast.If):
                test = self.test(each.test, env, items)
                if test.op == "number":
                    pending[:0] = each.body if test.value else each.orelse
                elif has_return([each]):
                    then = self.block([*each.body, *pending], dict(env), [])
                    other = self.block([*each.orelse, *pending], dict(env), [])
                    return self.joined(items, test, then, other)
                else:
                    self.merge(test, each, env, items)
            elif isinstance(each, ast.For):
                pending[:0] = self.unrolled(each)
            else:
                self.assignment(each, env, items)
        raise AssertionError("a checked equation ends in a return")

    def straight(self, statements: Sequence[ast.stmt], env: Environment) -> list[Item]:
        """Items of statements without a return."""
        items: list[Item] = []
        pending = list(statements)
        while pending:
            each = pending.pop(0)
            if isinstance(each, ast.If):
                test = self.test(each.test, env, items)
                if test.op == "number":
                    pending[:0] = each.body if test.value else each.orelse
                else:
                    self.merge(test, each, env, items)
            elif isinstance(each, ast.For):
                pending[:0] = self.unrolled(each)
            else:
                self.assignment(each, env, items)
        return items

    def unrolled(self, loop: ast.For) -> list[ast.stmt]:
        """The statements of a loop, once for each number of its range."""
        assert isinstance(loop.iter, ast.Call)
        out: list[ast.stmt] = []
        for i in range(*(whole(a) for a in loop.iter.args)):
            count = ast.copy_location(ast.Constant(i), loop)
            out.append(ast.copy_location(ast.Assign([loop.target], count), loop))
            out += loop.body
        return out

    def assignment(self, each: ast.stmt, env: Environment, items: list[Item]) -> None:
        if isinstance(each, ast.Assign):
            first = each.targets[0]
            hint: Any = first.id if isinstance(first, ast.Name) else None
            if isinstance(first, ast.Tuple):
                hint = [t.id if isinstance(t, ast.Name) else "value" for t in first.elts]
            value = self.value(each.value, env, items, hint)
            for target in each.targets:
                self.bind(target, value, env, items)
        elif isinstance(each, ast.AnnAssign):
            assert isinstance(each.target, ast.Name)
            assert each.value is not None
            value = self.value(each.value, env, items, each.target.id)
            self.bind(each.target, value, env, items)
        elif isinstance(each, ast.AugAssign):
            assert isinstance(each.target, ast.Name)
            left = ast.copy_location(ast.Name(each.target.id, ast.Load()), each)
            whole_term = ast.copy_location(ast.BinOp(left, each.op, each.value), each)
            value = self.value(whole_term, env, items, each.target.id)
            self.bind(each.target, value, env, items)

    def bind(self, target: ast.expr, value: Value, env: Environment, items: list[Item]) -> None:
        if isinstance(target, ast.Tuple):
            if not isinstance(value, Tuple) or len(value.items) != len(target.elts):
                self.source.refuse(
                    target, "an unpacking of something else", "unpack a tuple of as many values"
                )
            for each, item in zip(target.elts, value.items, strict=True):
                self.bind(each, item, env, items)
            return
        assert isinstance(target, ast.Name)
        env[target.id] = self.named(value, target.id, items)

    def merge(self, test: Node, each: ast.If, env: Environment, items: list[Item]) -> None:
        """An if that does not return: what both of its ways set is merged."""
        one, two = dict(env), dict(env)
        then, other = self.straight(each.body, one), self.straight(each.orelse, two)
        choice = Choice(test, then, other, [])
        flat = _cheap(then) and _cheap(other)
        meanings = (_meanings(then), _meanings(other)) if flat else None
        for name in [*one, *(n for n in two if n not in one)]:
            if one.get(name) is two.get(name):
                continue
            if name not in one or name not in two:
                env.pop(name, None)  # without a value one way: refused where it is read
                continue
            env[name] = self.merged(choice, one[name], two[name], name, each, meanings, items)
        if not flat and (choice.merged or then or other):
            items.append(choice)

    def joined(self, items: list[Item], test: Node, then: Body, other: Body) -> Body:
        """Two endings, as one conditional expression where both are cheap."""
        if not (isinstance(then.end, Fork) or isinstance(other.end, Fork)) and (
            _cheap(then.items, [n for _, n in leaves(then.end)])
            and _cheap(other.items, [n for _, n in leaves(other.end)])
            and _alike(shape(then.end), shape(other.end))
        ):
            one, two = _meanings(then.items), _meanings(other.items)
            pairs = zip(leaves(then.end), leaves(other.end), strict=True)
            nodes = [
                ex.choose(test, ex.substitute(a, one), ex.substitute(b, two))
                for (_, a), (_, b) in pairs
            ]
            return Body(items, rebuilt(then.end, iter(nodes)))
        return Body(items, Fork(test, then, other))


def _alike(one: Shape, two: Shape) -> bool:
    """Whether two results can be one: whole numbers are numbers."""
    if isinstance(one, str) and isinstance(two, str):
        return one == two or {one, two} == {"int", "float"}
    if type(one) is not tuple or type(two) is not tuple:
        return bool(one == two)
    return (
        one[0] is two[0]
        and len(one[1]) == len(two[1])
        and all(_alike(a, b) for a, b in zip(one[1], two[1], strict=True))
    )


FEW = 8
"""Operations that may be done in vain, so that a branch becomes a conditional expression."""


def _cheap(items: list[Item], ends: Sequence[Node] = ()) -> bool:
    """Whether items are so few operations that they can be done whatever a test says."""
    nodes = [*(i.node for i in items if isinstance(i, Let)), *ends]
    return (
        all(isinstance(i, Let) for i in items)
        and all(n.cheap for n in nodes)
        and sum(ex.size(n) for n in nodes) <= FEW
        and not any(n.op == "if" for n in ends)
    )


def _meanings(items: list[Item]) -> dict[str, Node]:
    """What the names of cheap items stand for, all told."""
    meanings: dict[str, Node] = {}
    for each in items:
        assert isinstance(each, Let)
        meanings[each.name] = ex.substitute(each.node, meanings)
    return meanings


def _moving(body: Body, arguments: tuple[tuple[str, Value], ...]) -> tuple[tuple[str, ...], ...]:
    """Of each scalar of the result the paths of the arguments that it follows."""
    known: dict[str, frozenset[str]] = {}

    def of(node: Node) -> frozenset[str]:
        return frozenset[str]().union(*(known.get(n, frozenset((n,))) for n in node.moves))

    def pass_through(items: list[Item]) -> None:
        for each in items:
            if isinstance(each, Let):
                known[each.name] = of(each.node)
            elif isinstance(each, Choice):
                pass_through(each.then)
                pass_through(each.other)
                for name, one, two in each.merged:
                    known[name] = of(one) | of(two)
            else:
                for (_, result), moved in zip(leaves(each.result), each.callee.moving, strict=True):
                    nodes = [actual(each, p) for p in moved]
                    known[result.value] = frozenset[str]().union(
                        *(of(n) for n in nodes if n is not None)
                    )

    def outputs(body: Body) -> list[frozenset[str]]:
        pass_through(body.items)
        if isinstance(body.end, Fork):
            both = zip(outputs(body.end.then), outputs(body.end.other), strict=True)
            return [a | b for a, b in both]
        return [of(node) for _, node in leaves(body.end)]

    listed = [[path_of(t) for t in each] for each in outputs(body)]
    order = [p for n, v in arguments for p in paths(n, v)]
    rank = {p: i for i, p in enumerate(order)}
    return tuple(tuple(sorted(each, key=lambda p: (rank.get(p, len(rank)), p))) for each in listed)


def generating(function: Callable[P, R]) -> Callable[P, R]:
    """Remember what a function generates, and let one thread at a time do so."""
    remembered = lru_cache(maxsize=256)(function)

    @wraps(function)
    def alone(*args: P.args, **kwargs: P.kwargs) -> R:
        with GENERATING:
            return remembered(*args, **kwargs)  # type: ignore[arg-type]

    return alone
