"""Writing of straight code as text: what is live, what gets a name, how lines are broken.

Every expression that is needed twice gets a name where it is first needed; what nobody needs is
left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from hashlib import blake2b
from typing import TYPE_CHECKING

from swashplate.equations import expressions as ex
from swashplate.equations.code import (
    FUNCTIONS,
    Call,
    Choice,
    Code,
    Function,
    Item,
    Let,
    Rule,
    fresh_name,
    live,
)
from swashplate.equations.expressions import Node

if TYPE_CHECKING:
    from swashplate.equations.adjoints import Derivatives

WIDTH = 96
"""Characters of a line."""
TERM = 76
"""Characters of an expression, beyond which parts of it get names."""
STEMS = {
    "sqrt": "root",
    "exp": "power",
    "/": "ratio",
    "*": "product",
    "+": "total",
    "-": "difference",
    "if": "chosen",
    ">": "above",
    ">=": "above",
    "<": "below",
    "<=": "below",
}


class _Region:
    """Items that are done together; `behind` is a region whose names it knows too."""

    def __init__(
        self, items: Iterable[Item], parent: _Region | None = None, behind: _Region | None = None
    ) -> None:
        self.items, self.behind = [*items], behind
        self.around = {self}
        for each in (parent, behind):
            self.around |= each.around if each else set()
        self.sides: dict[int, tuple[_Region, _Region]] = {}
        self.seen: set[Node] = set()
        self.known: dict[Node, str] = {}


def _spread(items: Iterable[Item]) -> Iterator[Item]:
    """Items with what rules consist of in their place."""
    for item in items:
        if isinstance(item, Rule):
            yield from _spread(item.items)
            yield from (Let(name, node) for name, node in item.results)
        elif isinstance(item, Choice):
            yield replace(item, then=[*_spread(item.then)], other=[*_spread(item.other)])
        else:
            yield item


class Writer:
    """Text of some items of straight code and of the results that they lead to.

    `taken` names stand for something else; `hints` are names for expressions, should they need one.
    The items are `lines`, which call `functions` by name, the results `texts` by names that the
    lines make. `inner` are names that only one side of a choice makes, with a number of their type.
    `straight` text has few branches, see `expressions.render`.
    """

    def __init__(
        self,
        taken: set[str],
        items: Sequence[Item],
        results: Sequence[Node],
        hints: Mapping[Node, str] | None = None,
        straight: bool = False,
    ) -> None:
        self.taken, self.hints, self.straight = taken, hints or {}, straight
        self.functions: dict[str, Function] = {}
        self.inner: dict[str, str] = {}
        self.uses: dict[Node, list[_Region]] = {}
        self.sides: dict[int, tuple[_Region, _Region]] = {}
        self.needed = set[str]().union(*(node.reads for node in results))
        top = _Region(live(_spread(items), self.needed))
        self.count(top, set(), results)
        self.lines = self.region(top, "")
        self.texts = self.results(results, top)

    # -- what is shared ----------------------------------------------------------------------------

    def count(self, region: _Region, seen: set[Node], ends: Sequence[Node] = ()) -> None:
        """Count how often expressions are needed, and where."""

        def visit(node: Node) -> None:
            same = node.same
            self.uses.setdefault(same, []).append(region)
            if same not in seen:
                seen.add(same)
                for each in node.args:
                    visit(each)

        for item in region.items:
            if isinstance(item, Let):
                visit(item.node)
            elif isinstance(item, Call):
                for node in item.arguments:
                    visit(node)
            elif isinstance(item, Choice):
                visit(item.test)
                behind = self.sides.get(item.again, (None, None))
                ways = (
                    (item.then, [a for _, a, _ in item.merged]),
                    (
                        item.other,
                        [b for _, _, b in item.merged],
                    ),
                )
                sides = []
                for (items, merged), other in zip(ways, behind, strict=True):
                    side = _Region(items, region, other)
                    self.count(side, seen | (other.seen if other else set()), merged)
                    sides.append(side)
                self.sides[item.number] = sides[0], sides[1]
        for node in ends:
            visit(node)
        region.seen = seen

    def shared(self, node: Node, region: _Region) -> bool:
        """Whether an expression is needed more than once here."""
        return sum(region in each.around for each in self.uses.get(node.same, ())) > 1

    # -- lines -------------------------------------------------------------------------------------

    def text(self, node: Node, region: _Region) -> str:
        """Text of an expression, by the names that are known here."""
        return ex.render(node, lambda each: region.known.get(each.same), self.straight)

    def define(self, node: Node, region: _Region, pad: str, name: str | None = None) -> list[str]:
        """Lines that give an expression a name."""
        if name is None:
            name = fresh_name(self.hints.get(node.same) or STEMS.get(node.op, "part"), self.taken)
        lines: list[str] = []
        text = self.fitted(node, region, pad, lines, len(name))
        if node.op not in ex.LEAVES:
            region.known.setdefault(node.same, name)
        if pad:
            self.inner.setdefault(name, "False" if node.kind == "bool" else "0.0")
        if len(pad) + len(name) + len(text) + 3 > WIDTH:  # names alone are too long
            return [*lines, f"{pad}{name} = (", f"{pad}    {text}", f"{pad})"]
        return [*lines, f"{pad}{name} = {text}"]

    def fitted(self, node: Node, region: _Region, pad: str, lines: list[str], used: int = 0) -> str:
        """Text of an expression; what is in it more than once, or too long, gets names."""
        if node.same not in region.known:
            for each in node.args:
                self.settle(each, region, pad, lines)
        room = max(TERM - used - max(len(pad) - 8, 0), 32)
        text = self.text(node, region)
        while len(text) > room:
            best = self.longest(node, region, room) or self.longest(node, region, TERM)
            if best is None:
                break
            lines += self.define(best, region, pad)
            text = self.text(node, region)
        return text

    def longest(self, node: Node, region: _Region, room: int) -> Node | None:
        """The longest part of an expression that has no name yet and fits into `room`."""
        best: Node | None = None
        longest = 12
        pending = list(node.args)
        while pending:
            each = pending.pop()
            if each.same in region.known or each.op in ex.LEAVES:
                continue
            length = len(self.text(each, region))
            if longest < length <= room:
                best, longest = each, length
            pending += each.args
        return best

    def settle(self, node: Node, region: _Region, pad: str, lines: list[str]) -> None:
        """Names for the parts of an expression that are needed again."""
        if node.op in ex.LEAVES or node.same in region.known:
            return
        for each in node.args:
            self.settle(each, region, pad, lines)
        if not _trivial(node) and self.shared(node, region):
            lines += self.define(node, region, pad)

    def region(self, region: _Region, pad: str) -> list[str]:
        """Lines of items that are done together."""
        lines: list[str] = []
        for item in region.items:
            if isinstance(item, Let):
                lines += self.define(item.node, region, pad, item.name)
            elif isinstance(item, Call):
                lines += self.call(item, region, pad)
            elif isinstance(item, Choice):
                lines += self.choice(item, region, pad)
        return lines

    def call(self, item: Call, region: _Region, pad: str) -> list[str]:
        """Lines of a call."""
        lines: list[str] = []
        self.functions[item.function.name] = item.function
        given = [self.fitted(node, region, pad, lines) for node in item.arguments]
        targets = [name if name in self.needed else "_" for name in item.results]
        if pad:
            self.inner |= dict.fromkeys(targets, "0.0")
        function = f"{item.function.name}("
        left = ", ".join(targets) + ("," if item.derivative is None and len(targets) == 1 else "")
        if len(pad) + len(left) + len(function) + 4 <= WIDTH:
            return [*lines, *listed(f"{left} = {function}", given, ")", pad)]
        tail = listed(function, given, ")", pad)
        head = [f"{pad}(", *filled(targets, pad), f"{pad})"]
        return [*lines, *head[:-1], f"{head[-1]} = {tail[0].strip()}", *tail[1:]]

    def results(self, nodes: Sequence[Node], region: _Region) -> list[str]:
        """Texts of results, with names for those that are long or have one waiting."""
        for node in nodes:
            self.settle(node, region, "", self.lines)
            if node.op in ex.LEAVES or _trivial(node) or node.same in region.known:
                continue
            if node.same in self.hints or len(self.text(node, region)) > 30:
                self.lines += self.define(node, region, "")
        return [self.fitted(node, region, "", self.lines) for node in nodes]

    def choice(self, item: Choice, region: _Region, pad: str) -> list[str]:
        """Lines of an `if` and its `else`."""
        lines: list[str] = []
        self.settle(item.test, region, pad, lines)
        text = self.fitted(item.test, region, pad, lines)
        made = []
        for k, side in enumerate(self.sides[item.number]):
            side.known = {**region.known, **(side.behind.known if side.behind else {})}
            inner = self.region(side, f"{pad}    ")
            for name, *nodes in item.merged:
                inner += self.define(nodes[k], side, f"{pad}    ", name)
            made.append(inner)
        then, other = made
        if not then:
            return [*lines, f"{pad}if not ({text}):", *other]
        return [*lines, f"{pad}if {text}:", *then, *([f"{pad}else:", *other] if other else [])]


def _trivial(node: Node) -> bool:
    return node.op == "neg" and node.args[0].op in ex.LEAVES


def lines_of(code: Code, wanted: Iterable[Node], straight: bool = False) -> list[str]:
    """Text of all that some names in straight code need; `straight` as of `Writer`."""
    writer = Writer(code.taken, code.items, [*wanted], straight=straight)
    code.names |= writer.functions
    return writer.lines


# --- functions ------------------------------------------------------------------------------------


def indented(lines: Iterable[str]) -> list[str]:
    """Lines moved in."""
    return [f"    {line}" for line in lines]


def function_source(head: str, says: str, lines: Iterable[str], mark: str = "@kernel") -> str:
    """Text of a function."""
    head = f"{mark}\ndef {head}:" if mark else f"def {head}:"
    return "\n".join([head, f'    """{says}"""', *indented(lines), ""])


def function_text(
    name: str,
    says: str,
    formals: Sequence[str],
    code: Code,
    results: Sequence[Node],
    swept: Derivatives | None = None,
) -> tuple[str, dict[str, Function]]:
    """Text of a function of straight code, and the generated functions that it calls.

    With `swept` it is that code with its derivatives, whose names are taken as well.
    """
    taken = {*code.taken, *FUNCTIONS, name}
    if swept is None:
        writer = Writer(taken, code.items, results)
    else:
        writer = Writer(taken | swept.taken, swept.items, results, swept.hints)
    inner = [f"    {line}" for line in writer.lines]
    end = "," if len(results) == 1 and swept is not None else ""
    back = f"    return {', '.join(writer.texts) or '()'}{end}"
    if len(back) > WIDTH:
        back = "\n".join(listed("return (", writer.texts, ")", "    "))
    return "\n".join(
        [*listed(f"def {name}(", list(formals), "):", ""), *documented(says), *inner, back, ""]
    ), writer.functions


UNNAMED = "00000000"
"""What stands in a function's name until its text is known."""


def named_by_text(name: str, text: str) -> tuple[str, str]:
    """A name for a function that no other has in place of one with `UNNAMED`, and its text."""
    digest = blake2b(text.encode(), digest_size=4).hexdigest()
    return name.replace(UNNAMED, digest), text.replace(UNNAMED, digest, 1)


def documented(says: str) -> list[str]:
    """A docstring, on as many lines as it takes."""
    if len(says) + 10 <= WIDTH + 4:
        return [f'    """{says}"""']
    head, _, tail = says.rpartition(" (")
    return [f'    """{head}', f'    ({tail}"""'] if head else [f'    """{says[:WIDTH]}"""']


def listed(start: str, parts: Sequence[str], end: str, pad: str) -> list[str]:
    """Parts within brackets, on one line or on as many as it takes."""
    one = f"{pad}{start}{', '.join(parts)}{end}"
    if len(one) <= WIDTH:
        return [one]
    return [f"{pad}{start}", *filled(parts, pad), f"{pad}{end}"]


def filled(parts: Sequence[str], pad: str) -> list[str]:
    """Parts on lines of their own within brackets."""
    lines, line = list[str](), f"{pad}    "
    for part in parts:
        if len(line) + len(part) + 1 > WIDTH and line.strip():
            lines.append(line.rstrip())
            line = f"{pad}    "
        line += f"{part}, "
    return [*lines, line.rstrip()] if line.strip() else lines
