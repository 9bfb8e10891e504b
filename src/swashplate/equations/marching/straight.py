"""Decisions as a processor likes them: without branches for many sets, well guessed for one.

Many sets side by side: straight code. The compiler turns a loop into vector instructions if there
is nothing in it but arithmetic on rows of neighbouring numbers. Hence

- a decision is not a branch: both ways are computed, and one result is taken;
- what does not change over the march is computed once, ahead of it: the compiler moves it out of a
  loop over samples by itself, but not out of one over lanes within;
- a call of a library has a loop of its own, between those that become vectors.

One set alone: each sample waits for the one before it, and a choice for what it chooses between. A
limit, whose value is known ahead of the march, is therefore a branch: the processor guesses that it
acts as it did at the last sample, and goes on.

The operations and their order stay as they are, and so does the last bit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.extending import intrinsic

from swashplate.equations import expressions as ex
from swashplate.equations.code import Call, Choice, Code, Item, Let, Rule
from swashplate.equations.expressions import Node, text
from swashplate.equations.writing import lines_of


def _choose(test: bool, one: Any, two: Any) -> Any:
    return one if test else two


def _selected(typing: Any, test: Any, one: Any, two: Any) -> Any:
    kind = types.boolean if one == two == types.boolean else types.float64

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.select(*values)

    return kind(types.boolean, kind, kind), generate


def _expected(typing: Any, test: Any) -> Any:
    bit = ir.IntType(1)

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        kind = ir.FunctionType(bit, [bit, bit])
        inserted: Any = cgutils.get_or_insert_function
        expect = inserted(builder.module, kind, "llvm.expect.i1")
        return builder.call(expect, [values[0], ir.Constant(bit, 0)])

    return types.boolean(types.boolean), generate


CALLED: dict[str, Any] = {"choose": intrinsic(_selected)}
"""What the text calls. ``choose(test, a, b)`` is one of two numbers that both have been computed:
from ``a if test else b`` the compiler makes a choice between two addresses, and gathers."""
GUESSED: dict[str, Any] = {"rarely": intrinsic(_expected)}
"""What the text of one set calls. ``rarely(test)`` is the test, for which there is a branch."""
if config.DISABLE_JIT:  # type: ignore[attr-defined]
    # a root that nobody asks for may be one of a number below zero, which compiled code allows
    CALLED = {"choose": _choose, "sqrt": np.sqrt}
    GUESSED = {"rarely": bool}

SHORT = 16
"""Statements that are not worth a loop of their own."""
VECTOR = {*ex.CHEAP, "choose", "/", "sqrt", "**"}
"""Operations that processors have for many numbers at once."""


def is_vector(node: Node) -> bool:
    """Whether a processor can compute an expression for many lanes at once."""
    return node.op in VECTOR and all(map(is_vector, node.args))


def is_flat(item: Item) -> bool:
    """Whether all of an item can be computed for many lanes at once, whatever its tests say."""
    if isinstance(item, Choice):
        merged = [node for each in item.merged for node in each[1:]]
        return all(map(is_flat, (*item.then, *item.other))) and all(map(is_vector, merged))
    return isinstance(item, Let) and is_vector(item.node)


def made_by(item: Choice | Call) -> tuple[str, ...]:
    """Names that an item gives their values."""
    return tuple(name for name, _, _ in item.merged) if isinstance(item, Choice) else item.results


class Statement(NamedTuple):
    """Lines that give some names their values."""

    names: tuple[str, ...]
    lines: list[str]
    reads: frozenset[str]
    vector: bool
    """Whether a processor can do it for many lanes at once."""


class Straight:
    """Code of a sample without branches, and what can be computed ahead of the march.

    Parameters
    ----------
    still : iterable of str
        Names of numbers that do not change over the march.
    fresh : callable
        Gives a name that is not taken.

    Attributes
    ----------
    ahead : list of Statement
        What follows nothing but still numbers.
    loops : list of list of Statement
        The rest, cut into loops over lanes.
    """

    def __init__(self, still: Iterable[str], fresh: Callable[[str], str]) -> None:
        self.still, self.fresh = {"h", *still}, fresh
        self.ahead: list[Statement] = []
        self.loops: list[list[Statement]] = [[]]
        self._moved: dict[Node, Node] = {}

    def add(self, code: Code, items: Iterable[Item]) -> None:
        """Append items of some code."""
        for item in items:
            if isinstance(item, Let):
                self.let(item.name, item.node)
            elif isinstance(item, Choice) and is_flat(item):
                self.add(code, (*item.then, *item.other))
                for name, one, two in item.merged:
                    self.let(name, ex.make("if", item.test, one, two))
            else:
                assert not isinstance(item, Rule)
                names = made_by(item)
                alone = Code(code.taken)
                alone.items = [item]
                made = [*map(ex.name, names)]
                reads = frozenset(alone.reads(made))
                self._append(Statement(names, lines_of(alone, made), reads, False))
                code.names |= alone.names

    def let(self, name: str, node: Node) -> None:
        """Append a name and what it stands for."""
        made = node if node.reads <= self.still else self.node(node)
        self._append(Statement((name,), [f"{name} = {text(made)}"], made.reads, is_vector(made)))

    def _append(self, statement: Statement) -> None:
        if statement.names and statement.reads <= self.still:
            self.still.update(statement.names)
            self.ahead.append(statement)
        else:
            if self.loops[-1] and self.loops[-1][-1].vector != statement.vector:
                self.loops.append([])
            self.loops[-1].append(statement)

    def cut(self) -> None:
        """Begin another loop over lanes, unless the present one is short.

        While one vector waits for its own results, a processor looks only so far ahead for others.
        """
        if len(self.loops[-1]) > SHORT:
            self.loops.append([])

    def become(self, row: str, node: Node) -> None:
        """Append what becomes of a row."""
        made = self.node(node)
        self._append(Statement((), [f"{row} = {text(made)}"], made.reads, True))

    def node(self, node: Node) -> Node:
        """An expression without branches, and without what can be computed ahead of the march."""
        if node.op in ex.LEAVES:
            return node
        if node.reads and node.reads <= self.still:
            if node not in self._moved:
                name = self.fresh("still")
                self.let(name, node)
                self._moved[node] = ex.name(name, node.kind)
            return self._moved[node]
        args = [self.node(each) for each in node.args]
        if node.op == "if" and node.kind != "int":
            return ex.make("choose", *args, kind=node.kind)
        if node.op == "and":
            return reduce(lambda a, b: ex.make("choose", a, b, ex.number(False), kind="bool"), args)
        if node.op == "or":
            return reduce(lambda a, b: ex.make("choose", a, ex.number(True), b, kind="bool"), args)
        return ex.make(node.op, *args, value=node.value)


# --- one set --------------------------------------------------------------------------------------


def reads_of(items: Iterable[Item]) -> Iterator[tuple[tuple[str, ...], frozenset[str]]]:
    """Names that items make, in their order, and what each of them is made of."""
    for item in items:
        if isinstance(item, Let):
            yield (item.name,), item.node.reads
        elif isinstance(item, Choice):
            yield from reads_of((*item.then, *item.other))
            for name, one, two in item.merged:
                yield (name,), one.reads | two.reads | item.test.reads
        else:
            assert not isinstance(item, Rule)
            yield item.results, frozenset[str]().union(*(node.reads for node in item.arguments))


class Guessed:
    """A sample of one set, with a branch for each limit that the next sample waits for.

    Parameters
    ----------
    code : Code
        The sample.
    wanted : iterable of Node
        What is wanted of it.
    states, still : iterable of str
        Names of the states, and of numbers that do not change over the march.
    following : iterable of Node
        States behind the sample.

    Attributes
    ----------
    code : Code
        The same sample.
    ahead : Code
        What of it is computed ahead of the march.
    """

    def __init__(
        self,
        code: Code,
        wanted: Iterable[Node],
        states: Iterable[str],
        following: Iterable[Node],
        still: Iterable[str],
    ) -> None:
        items = code.kept(wanted)
        made = [*reads_of(items)]
        self.still, self.moved = {"h", *still}, {*states}
        for names, reads in made:
            if reads & self.moved:
                self.moved.update(names)
        self.waits = set[str]().union(*(node.reads for node in following))
        for names, reads in reversed(made):
            if not self.waits.isdisjoint(names):
                self.waits |= reads
        self.choices: dict[str, Node] = {}
        self.code, self.ahead = Code(code.taken), Code(code.taken)
        self.code.names = self.ahead.names = code.names
        self.code.items = self._items(items)

    def _items(self, items: Iterable[Item]) -> list[Item]:
        found: list[Item] = []
        for item in items:
            if isinstance(item, Let) and item.name in self.moved & self.waits:
                found.append(Let(item.name, self._node(self._chosen(item.node))))
                if item.node.op == "if" and all(map(self._still, item.node.args[1:])):
                    self.choices[item.name] = item.node
            elif isinstance(item, Choice):
                then, other = self._items(item.then), self._items(item.other)
                found.append(replace(item, then=then, other=other))
            else:
                found.append(item)
        return found

    def _still(self, node: Node) -> bool:
        return node.reads <= self.still

    def _chosen(self, node: Node) -> Node:
        """A choice between two numbers that are known ahead, in place of what follows from one."""
        moving = [*(node.reads - self.still)]
        if len(moving) != 1 or moving[0] not in self.choices:
            return node
        test, *sides = self.choices[moving[0]].args
        found = []
        for side in sides:
            ahead = Let(self.code.fresh("still"), ex.substitute(node, {moving[0]: side}))
            self.ahead.items.append(ahead)
            self.still.add(ahead.name)
            found.append(ex.name(ahead.name))
        return ex.choose(test, *found)

    def _node(self, node: Node) -> Node:
        """An expression with its limits as branches."""
        if not node.reads & self.moved:
            return node
        args = [self._node(each) for each in node.args]
        if node.op in ("min", "max") and len(args) == 2:
            # the second counts where it is the smaller, or the larger, and else the first
            one, two = args
            test = ex.make("<" if node.op == "min" else ">", two, one)
            if self._still(two):
                return ex.choose(_rarely(test), two, one)
            if self._still(one):
                return ex.choose(_rarely(ex.make("not", test)), one, two)
        if node.op == "if" and node.kind == "float":
            test, one, two = args
            if self._still(one) and not self._still(two):
                return ex.choose(_rarely(test), one, two)
            if self._still(two) and not self._still(one):
                return ex.choose(_rarely(ex.make("not", test)), two, one)
        return ex.make(node.op, *args, value=node.value) if args else node


def _rarely(test: Node) -> Node:
    return ex.make("rarely", test, kind="bool")
