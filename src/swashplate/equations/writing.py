"""Writing of derived functions as text: what is live, what gets a name, how lines are broken.

Every expression that is needed twice gets a name where it is first needed; what nobody needs is
left out.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from swashplate.equations import expressions as ex
from swashplate.equations.expressions import Node
from swashplate.equations.program import Flag, Open, Primitive, Program, Tuple, Value, leaves
from swashplate.equations.syntax import CHOICES, MATH, plain
from swashplate.errors import EquationError

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


# --- what is written ------------------------------------------------------------------------------


@dataclass(eq=False)
class Define:
    """`name = node`."""

    name: str
    node: Node

    def nodes(self) -> list[Node]:
        """Expressions in it."""
        return [self.node]

    def sets(self) -> list[str]:
        """Names that it gives values."""
        return [self.name]


@dataclass(eq=False)
class Call:
    """A call; its result is unpacked into a structure of names, or into a flat list of them."""

    function: str
    first: tuple[str, ...]
    arguments: tuple[Value, ...]
    result: Value | None
    targets: list[str]

    def nodes(self) -> list[Node]:
        """Expressions in it."""
        return [n for v in self.arguments for n in _given(v)]

    def sets(self) -> list[str]:
        """Names that it gives values."""
        if self.result is None:
            return self.targets
        return [n.value for _, n in leaves(self.result)]


@dataclass(eq=False)
class Result:
    """`return` of expressions."""

    values: list[Node]

    def nodes(self) -> list[Node]:
        """Expressions in it."""
        return self.values

    def sets(self) -> list[str]:
        """Names that it gives values."""
        return []


class Region:
    """Statements that are done together; `behind` is a region whose names it knows too."""

    count = 0

    def __init__(self, parent: "Region | None" = None, behind: "Region | None" = None) -> None:
        Region.count += 1
        self.id = Region.count
        self.parent, self.behind = parent, behind
        self.items: list[Define | Call | Cond | Result] = []
        self.owner: Cond | None = None
        self.ancestors: frozenset[int] = frozenset((self.id,))
        for each in (parent, behind):
            self.ancestors |= each.ancestors if each else frozenset()
        self.seen: set[Node] = set()
        self.known: dict[Node, str] = {}

    def child(self, behind: "Region | None" = None) -> "Region":
        """A region of one side of a test here."""
        return Region(self, behind)

    def add(self, item: "Define | Call | Cond | Result") -> None:
        """Another statement."""
        self.items.append(item)


@dataclass(eq=False)
class Cond:
    """`if` and `else`; `last` where both sides return."""

    test: Node
    then: Region
    other: Region
    last: bool = False

    def __post_init__(self) -> None:
        self.then.owner = self.other.owner = self

    def nodes(self) -> list[Node]:
        """Expressions in it, but for those of its sides."""
        return [self.test]

    def sets(self) -> list[str]:
        """Names that it gives values itself."""
        return []


Line = Define | Call | Cond | Result


def _given(value: Value) -> Iterator[Node]:
    """Expressions in an argument that have to be written out."""
    if isinstance(value, Node):
        yield value
    elif isinstance(value, Tuple) and value.text is None:
        for each in value.items:
            yield from _given(each)


# --- names ----------------------------------------------------------------------------------------

_owners: dict[str, list[Any]] = {}


def _alias(thing: Any, text: str) -> str:
    """A name for something, the same in all texts and of nothing else."""
    f = plain(thing)
    number = isinstance(f, int | float | tuple) and not isinstance(f, type)
    owner = repr(f) if number else (f.__module__, f.__qualname__)
    if not number and "<locals>" in f.__qualname__:
        owner = f  # one of many, perhaps, that a function makes
    owners = _owners.setdefault(text, [])
    if owner not in owners:
        owners.append(owner)
    at = owners.index(owner)
    return text if at == 0 else f"{text}_{at + 1}"


class Names:
    """Names in one text: of its variables, and of what it refers to."""

    def __init__(self, program: Program | Primitive) -> None:
        self.arguments = [n for n, _ in program.arguments]
        self.taken = set(self.arguments) | getattr(program, "taken", set())
        self.references: dict[str, Any] = {}
        self.hints: dict[Node, str] = {}
        self.used: set[str] = set()

    def fresh(self, stem: str) -> str:
        """A name that is not yet taken."""
        stem = f"value_{stem}" if stem[0].isdigit() else stem
        name, count = stem, 1
        while name in self.taken or name in self.references:
            count += 1
            name = f"{stem}_{count}"
        self.taken.add(name)
        return name

    def of(self, thing: Any, text: str) -> str:
        """Name for something outside the text."""
        name = _alias(thing, text)
        while name in self.taken:
            name += "_"
        self.references[name] = thing
        return name

    def inner(self, callee: Program | Primitive) -> str | None:
        """Name of the function that a primitive is given."""
        if isinstance(callee, Primitive) and callee.inner is not None:
            return self.of(callee.inner.function, callee.inner.source.name)
        return None

    def suggest(self, node: Node, name: str) -> None:
        """A name for an expression, should it need one."""
        if node.op not in ex.LEAVES:
            self.hints.setdefault(node.same, name)

    def objects(self) -> dict[str, Any]:
        """What the text that was written refers to, by name."""
        return {n: v for n, v in self.references.items() if n in self.used}


# --- text -----------------------------------------------------------------------------------------


def call_text(function: str, arguments: list[str]) -> str:
    """A call."""
    return f"{function}({', '.join(arguments)})"


def listed(start: str, parts: list[str], end: str, pad: str) -> list[str]:
    """Parts within brackets, on one line or on as many as it takes."""
    one = f"{pad}{start}{', '.join(parts)}{end}"
    if len(one) <= WIDTH:
        return [one]
    return [f"{pad}{start}", *filled(parts, pad), f"{pad}{end}"]


def filled(parts: list[str], pad: str) -> list[str]:
    """Parts on lines of their own within brackets."""
    lines, line = list[str](), f"{pad}    "
    for part in parts:
        start, bracket, rest = part.partition("(")
        if len(pad) + len(part) + 5 > WIDTH and bracket:  # a tuple, in lines of its own
            lines += [line.rstrip()] if line.strip() else []
            *more, last = listed(f"{start}(", rest[:-1].split(", "), ")", f"{pad}    ")
            lines += [*more, f"{last},"]
            line = f"{pad}    "
            continue
        if len(line) + len(part) + 1 > WIDTH and line.strip():
            lines.append(line.rstrip())
            line = f"{pad}    "
        line += f"{part}, "
    return [*lines, line.rstrip()] if line.strip() else lines


class _Writer:
    def __init__(self, names: Names) -> None:
        self.names = names
        self.live: set[int] = set()
        self.uses: dict[Node, list[Region]] = {}

    # -- what is needed ----------------------------------------------------------------------------

    def mark(self, top: Region) -> None:
        """Find the statements that the results need."""
        definers: dict[str, list[tuple[Line, Region]]] = {}
        pending: list[tuple[Line, Region]] = []
        regions = [top]
        while regions:
            region = regions.pop()
            for each in region.items:
                for name in each.sets():
                    definers.setdefault(name, []).append((each, region))
                if isinstance(each, Cond):
                    regions += [each.then, each.other]
                if isinstance(each, Result):
                    pending.append((each, region))
        while pending:
            item, region = pending.pop()
            if id(item) in self.live:
                continue
            self.live.add(id(item))
            for node in item.nodes():
                for name in node.reads:
                    pending += definers.get(name, ())
            if region.owner is not None and region.parent is not None:
                pending.append((region.owner, region.parent))
        self.needed: set[str] = set()
        regions = [top]
        while regions:
            region = regions.pop()
            region.items = [each for each in region.items if id(each) in self.live]
            for each in region.items:
                for node in each.nodes():
                    self.needed |= node.reads
                if isinstance(each, Cond):
                    regions += [each.then, each.other]

    def count(self, region: Region, seen: set[Node]) -> None:
        """Count how often expressions are needed, and where."""

        def visit(node: Node) -> None:
            same = node.same
            self.uses.setdefault(same, []).append(region)
            if same not in seen:
                seen.add(same)
                for each in node.args:
                    visit(each)

        for item in region.items:
            for node in item.nodes():
                visit(node)
            if isinstance(item, Cond):
                for side in (item.then, item.other):
                    behind = side.behind.seen if side.behind else set()
                    self.count(side, seen | behind)
        region.seen = seen

    # -- lines -------------------------------------------------------------------------------------

    def shared(self, node: Node, region: Region) -> bool:
        uses = self.uses.get(node.same, ())
        return sum(region.id in each.ancestors for each in uses) > 1

    def text(self, node: Node, region: Region) -> str:
        def known(each: Node) -> str | None:
            if each.op == "constant":
                name = self.names.of(each.value[1], each.value[0])
                self.names.used.add(name)
                return name
            return region.known.get(each.same)

        self.functions(node, region)
        return ex.render(node, known)

    def functions(self, node: Node, region: Region) -> None:
        """Enter the functions of `math` that an expression calls."""
        if node.same in region.known:
            return
        if node.op in FUNCTIONS:
            if node.op in self.names.taken and node.op in self.names.arguments:
                raise EquationError(
                    f"An argument is called {node.op}, and so is the function that its "
                    "derivatives need: give the argument another name."
                )
            self.names.references[node.op] = FUNCTIONS[node.op]
            self.names.used.add(node.op)
        for each in node.args:
            self.functions(each, region)

    def define(self, node: Node, region: Region, pad: str, name: str | None = None) -> list[str]:
        """Lines that give an expression a name."""
        if name is None:
            stem = self.names.hints.get(node.same) or STEMS.get(node.op, "part")
            name = self.names.fresh(stem)
        lines: list[str] = []
        text = self.fitted(node, region, pad, lines, len(name))
        region.known.setdefault(node.same, name)
        if len(pad) + len(name) + len(text) + 3 > WIDTH:  # names alone are too long
            return [*lines, f"{pad}{name} = (", f"{pad}    {text}", f"{pad})"]
        return [*lines, f"{pad}{name} = {text}"]

    def fitted(self, node: Node, region: Region, pad: str, lines: list[str], used: int = 0) -> str:
        """Text of an expression; what is in it more than once, or too long, gets names."""
        if node.same not in region.known:
            for each in node.args:
                self.settle(each, region, pad, lines)
        room = max(TERM - used - max(len(pad) - 8, 0), 32)
        text = self.text(node, region)
        while len(text) > room:
            best = self._longest(node, region, room) or self._longest(node, region, TERM)
            if best is None:
                break
            lines += self.define(best, region, pad)
            text = self.text(node, region)
        return text

    def _longest(self, node: Node, region: Region, room: int) -> Node | None:
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

    def settle(self, node: Node, region: Region, pad: str, lines: list[str]) -> None:
        """Names for the parts of an expression that are needed again."""
        if node.op in ex.LEAVES or node.same in region.known:
            return
        for each in node.args:
            self.settle(each, region, pad, lines)
        trivial = node.op == "neg" and node.args[0].op in ex.LEAVES
        if not trivial and self.shared(node, region):
            lines += self.define(node, region, pad)

    def argument(self, value: Value, region: Region, pad: str, lines: list[str]) -> str:
        if isinstance(value, Node):
            self.settle(value, region, pad, lines)
            return self.fitted(value, region, pad, lines)
        if isinstance(value, Flag):
            return value.text or repr(value.value)
        if isinstance(value, Open):
            return value.text
        if value.text is not None:
            return value.text
        parts = [self.argument(each, region, pad, lines) for each in value.items]
        if value.cls is None:
            return f"({', '.join(parts)}{',' if len(parts) == 1 else ''})"
        name = self.names.of(value.cls, value.cls.__name__)
        self.names.used.add(name)
        return call_text(name, parts)

    def pattern(self, value: Value) -> str:
        """Names to unpack a result into."""
        if isinstance(value, Node):
            return str(value.value) if value.value in self.needed else "_"
        if isinstance(value, Tuple):
            parts = [self.pattern(each) for each in value.items]
            return f"({', '.join(parts)}{',' if len(parts) == 1 else ''})"
        return "_"

    def call(self, item: Call, region: Region, pad: str) -> list[str]:
        lines: list[str] = []
        given = [*item.first, *(self.argument(v, region, pad, lines) for v in item.arguments)]
        self.names.used.update((item.function, *item.first))
        if item.result is None:
            targets = [t if t in self.needed else "_" for t in item.targets]
            left = ", ".join(targets) + ("," if len(targets) == 1 else "")
        else:
            targets = []
            left = self.pattern(item.result)
            if (
                left.startswith("(")
                and isinstance(item.result, Tuple)
                and len(item.result.items) > 1
            ):
                left = left[1:-1]
        whole = f"{pad}{left} = {call_text(item.function, given)}"
        if len(whole) <= WIDTH:
            return [*lines, whole]
        if len(pad) + len(left) + len(item.function) + 4 <= WIDTH:
            return [*lines, *listed(f"{left} = {item.function}(", given, ")", pad)]
        head = [f"{pad}{left}"]
        if targets:
            head = [f"{pad}(", *filled(targets, pad), f"{pad})"]
        tail = listed(f"{item.function}(", given, ")", pad)
        return [*lines, *head[:-1], f"{head[-1]} = {tail[0].strip()}", *tail[1:]]

    def region(self, region: Region, pad: str) -> list[str]:
        lines: list[str] = []
        for item in region.items:
            if isinstance(item, Define):
                lines += self.define(item.node, region, pad, item.name)
            elif isinstance(item, Call):
                lines += self.call(item, region, pad)
            elif isinstance(item, Result):
                lines += self.result(item, region, pad)
            else:
                lines += self.cond(item, region, pad)
        return lines

    def result(self, item: Result, region: Region, pad: str) -> list[str]:
        lines: list[str] = []
        for node in item.values:
            self.settle(node, region, pad, lines)
            trivial = node.op == "neg" and node.args[0].op in ex.LEAVES
            if node.op in ex.LEAVES or trivial or node.same in region.known:
                continue
            if node.same in self.names.hints or len(self.text(node, region)) > 30:
                lines += self.define(node, region, pad)
        parts = [self.fitted(node, region, pad, lines) for node in item.values]
        one = f"{pad}return {', '.join(parts)}{',' if len(parts) == 1 else ''}"
        return (
            [*lines, one] if len(one) <= WIDTH else [*lines, *listed("return (", parts, ")", pad)]
        )

    def cond(self, item: Cond, region: Region, pad: str) -> list[str]:
        lines: list[str] = []
        self.settle(item.test, region, pad, lines)
        text = self.fitted(item.test, region, pad, lines)
        for side in (item.then, item.other):
            side.known = {**region.known, **(side.behind.known if side.behind else {})}
        then = self.region(item.then, pad + "    ")
        if item.last:
            other = self.region(item.other, pad)
            return [*lines, f"{pad}if {text}:", *then, *other]
        other = self.region(item.other, pad + "    ")
        if not then:
            return [*lines, f"{pad}if not ({text}):", *other]
        return [*lines, f"{pad}if {text}:", *then, *([f"{pad}else:", *other] if other else [])]


def written(name: str, program: Program, top: Region, names: Names, says: str, where: str) -> str:
    """Text of a function."""
    writer = _Writer(names)
    writer.mark(top)
    writer.count(top, set())
    lines = writer.region(top, "    ")
    defaults = getattr(program.source, "defaults", {})
    formal: list[str] = []
    for each in reversed(names.arguments):  # defaults as far as they are numbers, from the end
        value = defaults.get(each, ...)
        defaults = defaults if value is None or isinstance(value, bool | int | float) else {}
        formal.insert(0, f"{each}={value!r}" if each in defaults else each)
    heading = listed(f"def {name}(", formal, "):", "")
    summary = f'    """{says} ({where})."""'
    doc = [summary] if len(summary) <= WIDTH + 4 else [f'    """{says}', f'    ({where})."""']
    return "\n".join([*heading, *doc, *lines, ""])


FUNCTIONS = {name: function for function, name in [*MATH.items(), *CHOICES.items()]}
