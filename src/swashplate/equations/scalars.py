"""Equations as straight code over scalars: calls inlined, named tuples apart, options decided.

Kernels are written from this form. It has the operations of the equations in their order, so that
results keep their last bit, and nothing else: what no wanted result needs is left out.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from hashlib import blake2b
from typing import Any

from swashplate.equations import expressions as ex
from swashplate.equations.equation import equation_of_text
from swashplate.equations.expressions import Node
from swashplate.equations.lowering import lower
from swashplate.equations.program import (
    Body,
    Choice,
    Flag,
    Fork,
    Invoke,
    Item,
    Let,
    Open,
    Primitive,
    Program,
    Tuple,
    Value,
    leaves,
    rebuilt,
    shapes_of,
)
from swashplate.equations.syntax import plain
from swashplate.equations.terms import repeated_moving


class Code:
    """Straight code under construction.

    Parameters
    ----------
    ruled : bool
        Whether equations with declared derivatives stay calls.
    """

    def __init__(self, *, ruled: bool = False) -> None:
        self.items: list[Item] = []
        self.ruled = ruled
        self.taken: set[str] = set()
        self.names: dict[str, Any] = {}
        self._called: dict[int, str] = {}

    @property
    def repeats(self) -> bool:
        """Whether there are sub-steps in it."""
        return any(isinstance(each, Invoke) and _is_loop(each.callee) for each in self.items)

    def fresh(self, stem: str) -> str:
        """A name that is not yet taken."""
        stem = stem.replace(".", "_").replace("[", "_").replace("]", "")
        if stem[0].isdigit():  # an item of a tuple without names
            stem = f"value_{stem}"
        name, count = stem, 1
        while name in self.taken:
            count += 1
            name = f"{stem}_{count}"
        self.taken.add(name)
        return name

    def name_of(self, thing: Any) -> str:
        """Name under which the text calls an equation or type."""
        if id(thing) not in self._called:
            self._called[id(thing)] = self.fresh(plain(thing).__name__)
            self.names[self._called[id(thing)]] = thing
        return self._called[id(thing)]

    def called(
        self, equation: Any, given: Mapping[str, Value], options: Any = None, lengths: Any = None
    ) -> Value:
        """Append a call of an equation, inlined, and return its result.

        Parameters
        ----------
        equation : equation
            What is called.
        given : mapping of str to Value
            Its arguments.
        options : mapping, optional
            Values of its options, by path.
        lengths : mapping, optional
            Lengths of tuples of floats, by path.
        """
        program = lower(equation, shapes_of(equation, dict(options or {}), dict(lengths or {})))
        env: dict[str, Node] = {}
        for name, formal in program.arguments:
            if isinstance(formal, Flag) or not list(leaves(formal)):
                continue
            outer = dict(leaves(given[name]))  # it may have more fields than are asked for
            for path, inner in leaves(formal):
                env[inner.value] = outer[path]
        stem = plain(equation).__name__
        return self._named(self._body(program.body, env, self.items), stem, self.items)

    def _named(self, value: Value, stem: str, items: list[Item]) -> Value:
        """A result with a name for each of its scalars, so that none is computed twice."""
        nodes = []
        for path, node in leaves(value):
            if node.op not in ex.LEAVES:
                name = self.fresh(path.replace(".", "_") or stem)
                items.append(Let(name, node))
                node = ex.name(name, node.kind)
            nodes.append(node)
        return rebuilt(value, iter(nodes))

    def _body(self, body: Body, env: dict[str, Node], items: list[Item]) -> Value:
        self._items(body.items, env, items)
        if not isinstance(body.end, Fork):
            return self._value(body.end, env)
        test = ex.substitute(body.end.test, env)
        then: list[Item] = []
        other: list[Item] = []
        one = self._body(body.end.then, dict(env), then)
        two = self._body(body.end.other, dict(env), other)
        choice = Choice(test, then, other, [])
        merged = []
        for (path, a), (_, b) in zip(leaves(one), leaves(two), strict=True):
            if a is b:
                merged.append(a)
                continue
            name = self.fresh(path or "value")
            choice.merged.append((name, a, b))
            merged.append(ex.name(name, ex.make("if", test, a, b).kind))
        items.append(choice)
        return rebuilt(one, iter(merged))

    def _items(self, given: Iterable[Item], env: dict[str, Node], items: list[Item]) -> None:
        for item in given:
            if isinstance(item, Let):
                node = ex.substitute(item.node, env)
                if node.op in ex.LEAVES:
                    env[item.name] = node
                    continue
                name = self.fresh(item.name)
                items.append(Let(name, node))
                env[item.name] = ex.name(name, node.kind)
            elif isinstance(item, Choice):
                test = ex.substitute(item.test, env)
                then: list[Item] = []
                other: list[Item] = []
                one, two = dict(env), dict(env)
                self._items(item.then, one, then)
                self._items(item.other, two, other)
                choice = Choice(test, then, other, [])
                for old, a, b in item.merged:
                    first, second = ex.substitute(a, one), ex.substitute(b, two)
                    name = self.fresh(old)
                    choice.merged.append((name, first, second))
                    env[old] = ex.name(name, ex.make("if", test, first, second).kind)
                items.append(choice)
            else:
                self._invoke(item, env, items)

    def _invoke(self, item: Invoke, env: dict[str, Node], items: list[Item]) -> None:
        arguments = tuple(self._value(each, env) for each in item.arguments)
        callee = item.callee
        if isinstance(callee, Program) and not (self.ruled and callee.rule is not None):
            inner: dict[str, Node] = {}
            for (_, formal), actual in zip(callee.arguments, arguments, strict=True):
                for (_, a), (_, b) in zip(leaves(formal), leaves(actual), strict=True):
                    inner[a.value] = b
            result = self._body(callee.body, inner, items)
            for (_, old), (_, new) in zip(leaves(item.result), leaves(result), strict=True):
                if new.op not in ex.LEAVES:
                    name = self.fresh(old.value)
                    items.append(Let(name, new))
                    new = ex.name(name, new.kind)
                env[old.value] = new
            return
        if _is_loop(callee):
            assert isinstance(callee, Primitive)
            callee, arguments = flattened(callee, arguments, self.ruled)
        named = []
        for _, old in leaves(item.result):
            name = self.fresh(old.value)
            named.append(ex.name(name, old.kind))
            env[old.value] = named[-1]
        items.append(Invoke(callee, arguments, rebuilt(item.result, iter(named))))

    def _value(self, value: Value, env: dict[str, Node]) -> Value:
        if isinstance(value, Node):
            return ex.substitute(value, env)
        if isinstance(value, Tuple):
            return Tuple(value.cls, tuple(self._value(each, env) for each in value.items))
        return value

    # -- text ----------------------------------------------------------------------------------

    def lines(self, wanted: Iterable[Node]) -> list[str]:
        """Text of the items that some results need."""
        return self.written(self.kept(wanted))

    def kept(self, wanted: Iterable[Node]) -> list[Item]:
        """Items that some results need."""
        needed: set[str] = set()
        for node in wanted:
            needed |= node.reads
        return self._live(self.items, needed)

    def written(self, items: Iterable[Item]) -> list[str]:
        """Text of items."""
        return list(self._lines(items))

    def reads(self, wanted: Iterable[Node]) -> set[str]:
        """Names from outside that some results need, decisions included."""
        needed: set[str] = set()
        for node in wanted:
            needed |= node.reads
        self._live(self.items, needed)
        return needed

    def _live(self, items: Sequence[Item], needed: set[str]) -> list[Item]:
        kept: list[Item] = []
        for item in reversed(items):
            if isinstance(item, Let):
                if item.name in needed:
                    needed |= item.node.reads
                    kept.append(item)
            elif isinstance(item, Choice):
                merged = [each for each in item.merged if each[0] in needed]
                if not merged:
                    continue
                one, two = set(needed), set(needed)
                for _, a, b in merged:
                    one |= a.reads
                    two |= b.reads
                then, other = self._live(item.then, one), self._live(item.other, two)
                needed |= one | two | item.test.reads
                kept.append(Choice(item.test, then, other, merged))
            else:
                if any(node.value in needed for _, node in leaves(item.result)):
                    for value in item.arguments:
                        for _, node in leaves(value):
                            needed |= node.reads
                    kept.append(item)
        return kept[::-1]

    def _lines(self, items: Iterable[Item]) -> Iterator[str]:
        for item in items:
            if isinstance(item, Let):
                yield f"{item.name} = {text(item.node)}"
            elif isinstance(item, Choice):
                for word, inner, place in (
                    (f"if {text(item.test)}:", item.then, 1),
                    ("else:", item.other, 2),
                ):
                    yield word
                    yield from (f"    {line}" for line in self._lines(inner))
                    for each in item.merged:
                        result = each[1] if place == 1 else each[2]
                        yield f"    {each[0]} = {text(result)}"
            else:
                targets = ", ".join(node.value for _, node in leaves(item.result))
                arguments = [self._argument(each) for each in item.arguments]
                if _is_loop(item.callee) and not self.ruled:
                    yield from self._loop(item, targets, arguments)
                    continue
                called = self.name_of(item.callee.function)
                if isinstance(item.callee, Primitive) and item.callee.inner is not None:
                    arguments.insert(0, self.name_of(item.callee.inner.function))
                yield f"{targets} = {called}({', '.join(arguments)})"

    def _loop(self, item: Invoke, targets: str, arguments: Sequence[str]) -> Iterator[str]:
        """A loop written out: what `repeated` does, without passing a function."""
        count, state, *rest = arguments
        number = f"{targets.partition(',')[0]}_number"
        assert isinstance(item.callee, Primitive)
        assert item.callee.inner is not None
        assert isinstance(item.callee.result, Tuple)
        called = self.name_of(item.callee.inner.function)
        given = f"{self.name_of(item.callee.result.cls)}({targets}), float({number})"
        yield f"{targets} = {state}"
        yield f"for {number} in range(int({count})):"
        yield f"    {targets} = {called}({', '.join([given, *rest])})"

    def _argument(self, value: Value) -> str:
        if isinstance(value, Node):
            return text(value)
        if isinstance(value, Tuple):
            inner = ", ".join(self._argument(each) for each in value.items)
            return f"{self.name_of(value.cls)}({inner})" if value.cls else f"({inner},)"
        if isinstance(value, Flag):
            return repr(value.value)
        assert isinstance(value, Open)
        return value.text


def _is_loop(callee: Program | Primitive) -> bool:
    return isinstance(callee, Primitive) and callee.kind == "repeated"


def flattened(
    loop: Primitive, arguments: tuple[Value, ...], ruled: bool
) -> tuple[Primitive, tuple[Value, ...]]:
    """A loop whose step is straight code of the scalars that it reads, and its arguments."""
    step = loop.inner
    assert step is not None
    code, env = Code(ruled=ruled), dict[str, Node]()
    formals, actuals = list[str](), list[Value]()
    (state, _), (number, _), *rest = step.arguments
    code.taken = {state, number, *vars(math)}
    for name, value in rest:
        for path, node in leaves(value):
            env[node.value] = ex.name(code.fresh(f"{name}_{path}" if path else name), node.kind)
    result = code._named(code._body(step.body, env, code.items), "value", code.items)
    ends = [node for _, node in leaves(result)]
    read = code.reads(ends)
    for (_, value), given in zip(rest, arguments[2:], strict=True):
        for (_, node), actual in zip(leaves(value), leaves(given), strict=True):
            if env[node.value].value in read:
                formals.append(env[node.value].value)
                actuals.append(actual[1])
    assert isinstance(result, Tuple)
    kind = code.name_of(result.cls)
    typed = ", ".join(f"{each}: float" for each in (number, *formals))
    body = [*code.lines(ends), f"return {kind}({', '.join(text(each) for each in ends)})"]
    lines = "\n".join(f"    {line}" for line in body)
    lines = f"({state}: {kind}, {typed}) -> {kind}:\n{lines}\n"
    name = f"{step.source.name}_{blake2b(lines.encode(), digest_size=4).hexdigest()}"
    made = equation_of_text(f"def {name}{lines}", name, code.names)
    inner = lower(made, shapes_of(made, {}, {}))
    shown = [(n, ex.name(n)) for n in formals]
    flat = (*loop.arguments[:2], *shown)
    moving = repeated_moving(inner)
    return Primitive(loop.kind, loop.function, inner, flat, moving, loop.result), (
        *arguments[:2],
        *actuals,
    )


def text(node: Node) -> str:
    """An expression as Python writes it, constants of modules as their numbers."""
    return ex.render(_numbers(node), lambda each: None)


def _numbers(node: Node) -> Node:
    if node.op == "constant":
        value = node.value[1]
        if value in (float("inf"), float("-inf")):
            infinite = ex.name("inf")
            return infinite if value > 0.0 else ex.make("neg", infinite)
        return ex.number(value)
    if not node.args:
        return node
    return ex.make(node.op, *(_numbers(a) for a in node.args), value=node.value)


def structure(equation: Any, argument: str, options: Any = None, lengths: Any = None) -> Value:
    """Shape of an argument of an equation, as a value of names."""
    program = lower(equation, shapes_of(equation, dict(options or {}), dict(lengths or {})))
    return dict(program.arguments)[argument]
