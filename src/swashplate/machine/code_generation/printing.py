"""The graph printed for people: as statements with names.

Every value that is needed twice, and every one that an equation calls by a name, gets a name where
it is first needed; what nobody needs is left out. The operations stay as the equations have them,
so that what is compiled gives the same bits.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple, Protocol

from swashplate.machine.code_generation.functions import fresh_name
from swashplate.machine.code_generation.scheduling import Conditional, Region, Schedule
from swashplate.machine.graph import LEAVES, Node, plain_value

WIDTH = 96
"""Characters of a line."""
STEMS = {
    "sqrt": "root", "exp": "power", "/": "ratio", "*": "product", "+": "total", "-": "difference",
    "if": "chosen", ">": "above", ">=": "above", "<": "below", "<=": "below",
}  # fmt: skip


# --- expressions ----------------------------------------------------------------------------------

Text = tuple[str, int]
"""An expression, and how tightly it binds: `ATOM` needs no brackets anywhere."""
ATOM = 10


class Language(Protocol):
    """How a block's operations are written; see `printing_c.C`."""

    def number(self, value: Any) -> Text:
        """A literal number."""

    def operation(self, node: Node, operands: Sequence[Text]) -> Text:
        """An operation on texts."""

    def assigned(self, name: str, node: Node, text: str, pad: str, *, new: bool) -> list[str]:
        """Lines of an assignment; a `new` name is declared by it."""

    def called(
        self,
        call: Node,
        targets: Sequence[str],
        arguments: Sequence[str],
        declared: set[str],
        pad: str,
    ) -> list[str]:
        """Lines of a call, whose results get their names; an empty one is not needed.

        Some of them are `declared` already.
        """

    def branch(self, test: str, then: list[str], otherwise: list[str], pad: str) -> list[str]:
        """Lines of an `if` and its `else`."""

    def declared(self, names: Mapping[str, Node], pad: str, *, always: bool) -> list[str]:
        """Lines ahead of a branch that gives some names their values, on both sides `always`."""

    def heading(self, node: Node, pad: str) -> list[str]:
        """Lines ahead of the statement that computes a node."""


def grouped(text: Text, level: int) -> str:
    """A text, in brackets if it binds less tightly than it must."""
    return text[0] if text[1] >= level else f"({text[0]})"


# --- blocks ---------------------------------------------------------------------------------------


class Statement(NamedTuple):
    """Lines that give some names their values."""

    lines: list[str]
    names: tuple[str, ...]
    reads: frozenset[str]
    nodes: tuple[Node, ...]
    """What is computed in it."""


class CodeBlock:
    """Lines that compute some results.

    Parameters
    ----------
    results : sequence of Node
        What is wanted.
    labels : mapping of Node to str
        What equations call a value.
    used_names : set of str
        Names that stand for something else; those of the block are added.
    available : mapping of Node to str, optional
        Values that are there already, with their names.
    language : Language
        How operations are written.

    Attributes
    ----------
    statements : list of Statement
        What is computed, in order.
    lines, texts : list of str
        The lines of these, and the results by the names that they make.
    names : dict of Node to str
        Values that have a name after the block, those of branches left out.
    """

    def __init__(
        self,
        results: Sequence[Node],
        labels: Mapping[Node, str],
        used_names: set[str],
        *,
        available: Mapping[Node, str] | None = None,
        language: Language,
    ) -> None:
        self._labels, self._used_names, self._available = labels, used_names, dict(available or {})
        self._language = language
        self._schedule = Schedule(results, self._available)
        self._reads: set[str] = set()
        self._written_nodes: list[Node] = []
        self._named: dict[tuple[Node, Region], str] = {}
        self._outlive: dict[Conditional | None, dict[str, Node]] = {}
        """Names of each branch that are read after it, while its test is known to hold."""
        self._uses = self._uses_of(results)
        outermost = self._schedule.whole
        self.statements = [*self._steps(outermost, "")]
        self.texts = [self._text(plain_value(node), outermost)[0] for node in results]
        self.names = {
            **self._available,
            **{node: name for (node, region), name in self._named.items() if region is outermost},
        }

    @property
    def lines(self) -> list[str]:
        """Lines of all statements."""
        return [line for statement in self.statements for line in statement.lines]

    # -- names -------------------------------------------------------------------------------------

    def _uses_of(self, results: Sequence[Node]) -> dict[tuple[Node, Region], list[Region]]:
        """From where each value is read, by where it is computed."""
        uses: dict[tuple[Node, Region], list[Region]] = {}

        def read(node: Node, region: Region) -> None:
            node = plain_value(node)
            where = self._schedule.region_of(node, region)
            if where is not None:
                uses.setdefault((node, where), []).append(region)

        def walk(region: Region) -> None:
            for node in region.nodes:
                for operand in node.args if node.op != "ruled" else ():
                    read(operand, region)
            for branch in region.branches:
                read(branch.test, region)
                for index, side in enumerate(branch.sides):
                    for member in branch.members:
                        read(member.args[1 + index], side)
                    walk(side)

        for node in results:
            read(node, self._schedule.whole)
        walk(self._schedule.whole)
        return uses

    def _wants_name(self, node: Node, region: Region) -> bool:
        """Whether a value gets a line of its own."""
        return self._stands_out(node, region) and not self._becomes(node, region)

    def _stands_out(self, node: Node, region: Region) -> bool:
        """Whether a value has a name in the equations, or is needed more than once."""
        uses = self._uses[node, region]
        if node in self._labels or len(uses) > 1 or uses[0] is not region:
            return not _is_trivial(node)
        return False

    def _becomes(self, node: Node, region: Region) -> bool:
        """Whether a value is nothing but that of a choice of its name, on the side of a region."""
        return self._choice(node, region) is not None

    def _choice(self, node: Node, region: Region) -> Node | None:
        """The choice that a value is nothing but one side of, if both have one name."""
        label, uses = self._labels.get(node), self._uses[node, region]
        if region.branch is None or len(uses) != 1 or uses[0] is not region:
            return None
        for member in region.branch.members:
            same = label is None or self._labels.get(member, label) == label
            if plain_value(member.args[1 + region.side]) is node:
                return member if same else None
        return None

    def _has_lines(self, region: Region) -> bool:
        """Whether something in a region takes a line of its own."""
        for branch in region.branches:
            several = len(branch.members) > 1 or any(map(self._has_lines, branch.sides))
            if several or self._stands_out(branch.members[0], region):
                return True
        return any(
            node.op == "call"
            or (node.op not in ("result", "ruled") and self._stands_out(node, region))
            for node in region.nodes
        )

    def _fresh(self, node: Node) -> str:
        stem = self._labels.get(node) or STEMS.get(node.op, "part")
        stem = re.sub(r"\W+", "_", stem)
        return fresh_name(f"value_{stem}" if stem[0].isdigit() else stem, self._used_names)

    # -- lines -------------------------------------------------------------------------------------

    def _region(self, region: Region, pad: str) -> list[str]:
        """Lines of what is computed together."""
        return [line for statement in self._steps(region, pad) for line in statement.lines]

    def _steps(self, region: Region, pad: str) -> Iterator[Statement]:
        """Statements of what is computed together."""
        for step in self._schedule.steps(region):
            if isinstance(step, Conditional):
                write = partial(self._branch, step, region, pad)
                yield from self._statement(step.members[0], write, pad)
            elif step.op == "call":
                yield from self._statement(step, partial(self._call, step, region, pad), pad)
            elif step.op not in ("result", "ruled") and self._wants_name(step, region):
                yield from self._statement(step, partial(self._define, step, region, pad), pad)

    def _statement(
        self, node: Node, write: Callable[[], tuple[list[str], list[str]]], pad: str
    ) -> Iterator[Statement]:
        """A statement with what it reads and computes, first a node; none if it has no lines."""
        outer = self._reads, self._written_nodes
        self._reads, self._written_nodes = set(), []
        lines, names = write()
        reads = frozenset(self._reads.difference(names))
        if lines:
            lines = [*self._language.heading(node, pad), *lines]
            yield Statement(lines, tuple(names), reads, tuple(self._written_nodes))
        self._reads, self._written_nodes = outer[0] | reads, outer[1] + self._written_nodes

    def _define(self, node: Node, region: Region, pad: str) -> tuple[list[str], list[str]]:
        """Lines that give a value a name."""
        text = self._written(node, region)[0]
        name = self._fresh(node)
        outlives = self._name(node, region, name)
        return self._language.assigned(name, node, text, pad, new=not outlives), [name]

    def _name(self, node: Node, region: Region, name: str) -> bool:
        """Remember the name of a value; whether it outlives the branch in which it is computed."""
        self._named[node, region] = name
        outlives = any(region not in use.enclosing for use in self._uses[node, region])
        if outlives:
            self._outlive.setdefault(region.branch, {})[name] = node
        return outlives

    def _call(self, call: Node, region: Region, pad: str) -> tuple[list[str], list[str]]:
        """Lines of a call, whose results are a tuple."""
        targets = [""] * call.value.results
        declared = set[str]()
        for node in region.nodes:
            if node.op == "result" and node.args[0] is call:
                name = targets[node.value] = self._fresh(node)
                if self._name(node, region, name):
                    declared.add(name)
        arguments = [self._text(node, region)[0] for node in call.args]
        self._written_nodes.append(call)
        lines = self._language.called(call, targets, arguments, declared, pad)
        return lines, [target for target in targets if target]

    def _branch(self, branch: Conditional, region: Region, pad: str) -> tuple[list[str], list[str]]:
        """Lines of a branch; none if it is a choice that stands in an expression."""
        if len(branch.members) == 1 and not any(map(self._has_lines, branch.sides)):
            (member,) = branch.members
            if not self._wants_name(member, region):
                return [], []
            return self._define(member, region, pad)
        names, declared = {}, {}
        for member in reversed(branch.members):  # in the order in which they were computed
            around = self._choice(member, region)
            if around is not None:
                assert region.branch is not None
                names[member] = self._named[around, region.branch.region]
                self._named[member, region] = names[member]
                continue
            names[member] = self._fresh(member)
            if not self._name(member, region, names[member]):
                declared[names[member]] = member
        inner = f"{pad}    "
        sides = [self._region(branch.sides[0], inner), self._region(branch.sides[1], inner)]
        for index, side in enumerate(branch.sides):
            for member in names:
                value, name = plain_value(member.args[1 + index]), names[member]
                text = self._text(value, side)[0]
                if text == name:
                    continue
                if (value, side) in self._uses and self._becomes(value, side):
                    sides[index] += self._language.heading(value, inner)
                sides[index] += self._language.assigned(name, member, text, inner, new=False)
        test = self._text(branch.test, region)[0]
        self._written_nodes += branch.members
        ahead = [
            *self._language.declared(self._outlive.pop(branch, {}), pad, always=False),
            *self._language.declared(declared, pad, always=True),
        ]
        return [*ahead, *self._language.branch(test, sides[0], sides[1], pad)], [*names.values()]

    # -- expressions -------------------------------------------------------------------------------

    def _text(self, node: Node, region: Region) -> Text:
        """A value as it is read in a region: by its name, or written out."""
        node = plain_value(node)
        if node in self._available:
            self._reads.add(self._available[node])
            return self._available[node], ATOM
        if node.op in LEAVES:
            return self._written(node, region)
        where = self._schedule.region_of(node, region)
        assert where is not None
        name = self._named.get((node, where))
        if name is None:
            return self._written(node, region)
        self._reads.add(name)
        return name, ATOM

    def _written(self, node: Node, region: Region) -> Text:
        """A value written out."""
        if node.op == "name":
            self._reads.add(node.value)
            return node.value, ATOM
        if node.op == "number":
            return self._language.number(node.value)
        self._written_nodes.append(node)
        where = self._schedule.region_of(node, region)
        branch = None if where is None else self._schedule.branch_of(node, where)
        if branch is None:
            operands = [self._text(operand, region) for operand in node.args]
            return self._language.operation(node, operands)
        operands = [self._text(branch.test, region)]
        sides = zip(node.args[1:], branch.sides, strict=True)
        operands += [self._text(operand, side) for operand, side in sides]
        return self._language.operation(node, operands)


def _is_trivial(node: Node) -> bool:
    return node.op == "neg" and node.args[0].op in LEAVES
