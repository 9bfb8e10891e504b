"""Writing of straight code as text: what is live, what gets a name, how lines are broken.

Every expression that is needed twice gets a name where it is first needed; what nobody needs is
left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from hashlib import blake2b
from textwrap import TextWrapper
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
SHORT = 30
"""Characters of a result, beyond which it gets a name."""
STEMS = {
    "sqrt": "root", "exp": "power", "/": "ratio", "*": "product", "+": "total", "-": "difference",
    "if": "chosen", ">": "above", ">=": "above", "<": "below", "<=": "below",
}  # fmt: skip


class _Region:
    """Items that are done together; `behind` is a region whose names it knows too."""

    def __init__(
        self, items: Iterable[Item], parent: _Region | None = None, behind: _Region | None = None
    ) -> None:
        self.items, self.behind = [*items], behind
        self.around: set[_Region] = {self}.union(
            *(each.around for each in (parent, behind) if each)
        )
        self.seen: set[Node] = set()
        self.known: dict[Node, str] = {}


def _spread(items: Iterable[Item]) -> Iterator[Item]:
    """Items with what rules consist of in their place."""
    for item in items:
        if isinstance(item, Rule):
            yield from _spread(item.items)
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
        self.sides: dict[int, list[_Region]] = {}
        self.needed = set[str]().union(*(node.reads for node in results))
        top = _Region(live(_spread(items), self.needed))
        self.count(top, set(), results)
        self.lines = self.region(top, "")
        self.texts = [self.result(node, top) for node in results]

    def count(self, region: _Region, seen: set[Node], ends: Iterable[Node]) -> None:
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
                ways = zip((item.then, item.other), behind, strict=True)
                sides = [_Region(items, region, other) for items, other in ways]
                one, two = [a for _, a, _ in item.merged], [b for _, _, b in item.merged]
                for side, merged in zip(sides, (one, two), strict=True):
                    known = side.behind.seen if side.behind else set()
                    self.count(side, seen | known, merged)
                self.sides[item.number] = sides
        for node in ends:
            visit(node)
        region.seen = seen

    # -- lines -------------------------------------------------------------------------------------

    def text(self, node: Node, region: _Region) -> str:
        """Text of an expression, by the names that are known here."""
        return ex.render(node, lambda each: region.known.get(each.same), self.straight)

    def settle(self, node: Node, region: _Region, pad: str) -> list[str]:
        """Lines that give names to the parts of an expression that are needed again."""
        if node.op in ex.LEAVES or node.same in region.known:
            return []
        lines = [line for each in node.args for line in self.settle(each, region, pad)]
        again = sum(region in each.around for each in self.uses.get(node.same, ())) > 1
        return lines + self.define(node, region, pad) if again and not _trivial(node) else lines

    def define(self, node: Node, region: _Region, pad: str, name: str = "") -> list[str]:
        """Lines that give an expression a name."""
        lines: list[str] = []
        if node.same not in region.known:
            lines = [line for each in node.args for line in self.settle(each, region, pad)]
        name = name or fresh_name(
            self.hints.get(node.same) or STEMS.get(node.op, "part"), self.taken
        )
        text = self.text(node, region)
        if node.op not in ex.LEAVES:
            region.known.setdefault(node.same, name)
        if pad:
            self.inner.setdefault(name, "False" if node.kind == "bool" else "0.0")
        return [*lines, *assigned(name, text, pad)]

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
        """Lines of a call, whose results are a tuple."""
        self.functions[item.function.name] = item.function
        lines = [line for each in item.arguments for line in self.settle(each, region, pad)]
        given = ", ".join(self.text(node, region) for node in item.arguments)
        targets = [name if name in self.needed else "_" for name in item.results]
        if pad:
            self.inner |= dict.fromkeys(targets, "0.0")
        left = ", ".join(targets) + ("," if len(targets) == 1 else "")
        return [*lines, *assigned(left, f"{item.function.name}({given})", pad)]

    def result(self, node: Node, region: _Region) -> str:
        """Text of a result, by a name where it is long or has one waiting."""
        self.lines += self.settle(node, region, "")
        text = self.text(node, region)
        known = node.op in ex.LEAVES or _trivial(node) or node.same in region.known
        if not known and (node.same in self.hints or len(text) > SHORT):
            self.lines += self.define(node, region, "")
        return self.text(node, region)

    def choice(self, item: Choice, region: _Region, pad: str) -> list[str]:
        """Lines of an `if` and its `else`."""
        lines = self.settle(item.test, region, pad)
        text = self.text(item.test, region)
        made = []
        for k, side in enumerate(self.sides[item.number]):
            side.known = {**region.known, **(side.behind.known if side.behind else {})}
            inner = self.region(side, f"{pad}    ")
            for name, *nodes in item.merged:
                inner += self.define(nodes[k], side, f"{pad}    ", name)
            made.append(inner)
        then, other = made
        if not then:
            return [*lines, *bracketed("if not (", text, "):", pad), *other]
        fits = len(pad) + len(text) < WIDTH - 4
        head = [f"{pad}if {text}:"] if fits else bracketed("if (", text, "):", pad)
        return [*lines, *head, *then, *([f"{pad}else:", *other] if other else [])]


def _trivial(node: Node) -> bool:
    return node.op == "neg" and node.args[0].op in ex.LEAVES


def lines_of(code: Code, wanted: Iterable[Node]) -> list[str]:
    """Text of all that some names in straight code need."""
    writer = Writer(code.taken, code.items, [*wanted])
    code.names |= writer.functions
    return writer.lines


# --- functions ------------------------------------------------------------------------------------


def bracketed(start: str, text: str, end: str, pad: str = "") -> list[str]:
    """Text within brackets, on one line or on as many as it takes."""
    one, inner = f"{pad}{start}{text}{end}", f"{pad}    "
    if len(one) <= WIDTH:
        return [one]
    wrapper = TextWrapper(
        WIDTH,
        initial_indent=inner,
        subsequent_indent=inner,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [f"{pad}{start}", *wrapper.wrap(text), f"{pad}{end}"]


def assigned(left: str, text: str, pad: str = "") -> list[str]:
    """Lines of an assignment."""
    one = f"{pad}{left} = {text}"
    if len(one) <= WIDTH:
        return [one]
    if len(left) <= WIDTH // 2:
        return bracketed(f"{left} = (", text, ")", pad)
    *head, last = bracketed("(", left, ")", pad)
    first, *tail = bracketed("(", text, ")", pad)
    return [*head, f"{last} = {first.strip()}", *tail]


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
    back = ", ".join(writer.texts) or "()"
    if len(results) == 1 and swept is not None:
        back += ","
    fits = len(back) < WIDTH - 10
    lines = [*writer.lines, *([f"return {back}"] if fits else bracketed("return (", back, ")"))]
    head = bracketed(f"def {name}(", ", ".join(formals), "):")
    if len(says) > WIDTH - 6:
        says = "\n    (".join(says.rsplit(" (", 1))
    return "\n".join([*head, f'    """{says}"""', *indented(lines), ""]), writer.functions


UNNAMED = "00000000"
"""What stands in a function's name until its text is known."""


def named_by_text(name: str, text: str) -> tuple[str, str]:
    """A name for a function that no other has in place of one with `UNNAMED`, and its text."""
    digest = blake2b(text.encode(), digest_size=4).hexdigest()
    return name.replace(UNNAMED, digest), text.replace(UNNAMED, digest, 1)
