"""C99 from equations: each function of Python becomes one of C, with its names and its docstring.

The translator reads the very functions that Numba compiles. Options are run-time flags in C, named
tuples are structs, and every operation stays where the equation has it, so that a strict compiler
gives the same bits.
"""

from __future__ import annotations

import ast
import copy
import typing
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from swashplate.equations.c_source.expressions import Expressions, constant_of, pointed
from swashplate.equations.c_source.text import DOUBLE, INT, Kind, Text, c_name, comment, wrapped
from swashplate.equations.language import Parsed

if typing.TYPE_CHECKING:
    from swashplate.equations.c_source.unit import Unit


class Function(Expressions):
    """One function of C: its statements, with the kinds of all names found on the way."""

    def __init__(
        self, unit: Unit, source: Parsed, name: str, kinds: dict[str, Kind], calls: dict[str, Any]
    ) -> None:
        super().__init__(unit, source, kinds, calls)
        self.name = name
        body = copy.deepcopy(source.node.body)
        if ast.get_docstring(source.node, clean=False) is not None:
            body = body[1:]
        self.body = list(_unrolled(body, body))
        stored = set().union(*(_stored(each) for each in body)) if body else set[str]()
        self.copied = {n for n, kind in self.formals.items() if kind.whole and n in stored}

    def text(self) -> str:
        """Comment, head and statements."""
        self.blocks: dict[str, tuple[Any, ...]] = {}
        self.counts: dict[str, int] = {}
        for name, path, stored in _references(self.body, ()):
            if name in self.formals and not stored:
                continue
            self.blocks[name] = _common(self.blocks.get(name, path), path)
            self.counts[name] = self.counts.get(name, 0) + stored
        self.blocks = {name: path for name, path in self.blocks.items() if self.counts[name]}
        self.promoted = True
        while self.promoted:
            self.promoted, self.temporaries, self.declared = False, 0, set(self.formals)
            lines = self.block(self.body, ())
        used = {each.id for s in self.source.node.body for each in ast.walk(s)
                if isinstance(each, ast.Name)}  # fmt: skip
        used |= set(self.star)
        idle = [f"    (void){c_name(n)};" for n in self.formals if n not in used]
        arguments = []
        for n, kind in self.formals.items():
            given = f"{n}_given" if n in self.copied else c_name(n)
            arguments.append(self.unit.declaration(kind, given, formal=True))
            if n in self.copied:
                idle.append(f"    {self.unit.declaration(kind, c_name(n))} = *{given};")
        head = f"static {self.unit.declared(self.returns)} {self.name}({', '.join(arguments)})"
        doc = ast.get_docstring(self.source.node) or ""
        said = comment(doc) if doc else []
        body = (each for line in lines for each in wrapped(line))
        return "\n".join([*said, *wrapped(head), "{", *idle, *body, "}"])

    # -- statements --------------------------------------------------------------------------------

    def block(self, statements: Sequence[ast.stmt], path: tuple[Any, ...]) -> list[str]:
        """Lines of statements, moved in by where they stand."""
        lines: list[str] = []
        pad = "    " * (len(path) + 1)
        for each in statements:
            self.before = []
            made = self.statement(each, path)
            lines += [f"{pad}{line}" for line in self.before]
            lines += made
        return lines

    def statement(self, each: ast.stmt, path: tuple[Any, ...]) -> list[str]:
        """Lines of one statement."""
        pad = "    " * (len(path) + 1)
        if isinstance(each, ast.Return):
            assert each.value is not None
            value = self.converted(self.value(each.value, self.returns), self.returns, each)
            return [f"{pad}return {value};"]
        if isinstance(each, ast.If | ast.For):
            test = self.value(each.test) if isinstance(each, ast.If) else None
            ahead, self.before = self.before, []
            inside = self.compound(each, test, path)
            ahead += [
                f"{self.unit.declared(self.kinds[name])} {c_name(name)};"
                for name, block in self.blocks.items()
                if block == path and name not in self.declared and name in _stored(each)
                and not self.declared.add(name)  # type: ignore[func-returns-value]
            ]  # fmt: skip
            self.before = ahead
            return inside
        if isinstance(each, ast.Break):
            return [f"{pad}break;"]
        if isinstance(each, ast.AugAssign):
            assert isinstance(each.target, ast.Name)
            term = ast.BinOp(ast.Name(each.target.id, ast.Load()), each.op, each.value)
            return self.assigned(each.target, ast.copy_location(term, each), path)
        if isinstance(each, ast.Assign | ast.AnnAssign) and each.value is not None:
            targets = each.targets if isinstance(each, ast.Assign) else [each.target]
            return [line for t in targets for line in self.assigned(t, each.value, path)]
        if isinstance(each, ast.Pass):
            return []
        self.refuse(each, ast.unparse(each).splitlines()[0])

    def compound(
        self, each: ast.If | ast.For, test: Text | None, path: tuple[Any, ...]
    ) -> list[str]:
        """Lines of an `if` or a loop."""
        pad = "    " * (len(path) + 1)
        if isinstance(each, ast.For):
            head, counter = self.head(each)
            self.kinds[counter] = INT
            self.declared.add(counter)
            ahead, self.before = self.before, []
            inner = self.block(each.body, (*path, (id(each), 0)))
            return [*(f"{pad}{line}" for line in ahead), f"{pad}{head} {{", *inner, f"{pad}}}"]
        assert test is not None
        lines = [f"{pad}if ({test.text}) {{", *self.block(each.body, (*path, (id(each), 0)))]
        if not each.orelse:
            return [*lines, f"{pad}}}"]
        other = self.block(each.orelse, (*path, (id(each), 1)))
        first = other[0].strip() if other else ""
        if len(each.orelse) == 1 and isinstance(each.orelse[0], ast.If) and first.startswith("if "):
            moved = [line[4:] for line in other]
            return [*lines, f"{pad}}} else {first}", *moved[1:]]
        return [*lines, f"{pad}}} else {{", *other, f"{pad}}}"]

    def head(self, each: ast.For) -> tuple[str, str]:
        """Head of a loop, and its counter."""
        assert isinstance(each.iter, ast.Call)
        assert isinstance(each.target, ast.Name)
        args = [self.value(a).text for a in each.iter.args]
        start, end = ("0", args[0]) if len(args) == 1 else (args[0], args[1])
        step = ast.literal_eval(each.iter.args[2]) if len(args) == 3 else 1
        counter = each.target.id
        name = "turn" if counter == "_" else c_name(counter)
        sign, move = ("<", f"+= {step}") if step > 0 else (">", f"-= {-step}")
        move = f"{name}++" if step == 1 else f"{name} {move}"
        return f"for (long long {name} = {start}; {name} {sign} {end}; {move})", counter

    def assigned(self, target: ast.expr, value: ast.expr, path: tuple[Any, ...]) -> list[str]:
        """Lines of an assignment."""
        if isinstance(target, ast.Tuple):
            return self.unpacked(target.elts, value, path)
        assert isinstance(target, ast.Name)
        if target.id == "_":
            return []
        return [self.bound(target.id, self.value(value), path, value)]

    def bound(self, name: str, value: Text, path: tuple[Any, ...], node: ast.AST) -> str:
        """The line that gives a name its value."""
        old = self.kinds.get(name)
        if old is None or (old == INT and value.kind == DOUBLE):
            self.kinds[name] = DOUBLE if old else value.kind
            self.promoted |= old is not None  # what was written so far takes it for a whole number
        elif {old, value.kind} - {INT, DOUBLE} and old != value.kind:
            self.refuse(node, f"{name} of two kinds")
        pad, kind = "    " * (len(path) + 1), self.kinds[name]
        text = self.converted(value, kind, node)
        if name in self.declared:
            return f"{pad}{c_name(name)} = {text};"
        self.declared.add(name)
        if self.blocks[name] != path:  # belongs to a block further out
            self.declared.discard(name)
            return f"{pad}{c_name(name)} = {text};"
        const = "const " if self.counts[name] == 1 else ""
        return f"{pad}{const}{self.unit.declared(kind)} {c_name(name)} = {text};"

    def unpacked(
        self, targets: Sequence[ast.expr], value: ast.expr, path: tuple[Any, ...]
    ) -> list[str]:
        """Lines that give several names their values at once."""
        if isinstance(value, ast.IfExp) and all(
            isinstance(way, ast.Tuple) and len(way.elts) == len(targets)
            for way in (value.body, value.orelse)
        ):
            ways = zip(value.body.elts, value.orelse.elts, strict=True)  # type: ignore[attr-defined]
            elements: list[ast.expr] = [ast.IfExp(value.test, one, two) for one, two in ways]
            value = ast.copy_location(ast.Tuple(elements, ast.Load()), value)
        pad = "    " * (len(path) + 1)
        if isinstance(value, ast.Tuple) and len(value.elts) == len(targets):
            lines, late = [], []
            for i, (target, each) in enumerate(zip(targets, value.elts, strict=True)):
                names = _stored(target)
                read = {n.id for later in value.elts[i + 1 :] for n in ast.walk(later)
                        if isinstance(n, ast.Name)}  # fmt: skip
                if not names & read:
                    lines += self.assigned(target, each, path)
                    continue
                assert isinstance(target, ast.Name)
                made = self.value(each)
                kept = self.temporary()
                declared = self.unit.declared(made.kind)
                lines.append(f"{pad}const {declared} {kept} = {pointed(made)};")
                late.append((target.id, made._replace(text=kept, level=13, pointer=False)))
            return [*lines, *(self.bound(name, made, path, value) for name, made in late)]
        made = self.value(value)
        if not made.kind.whole:
            self.refuse(value, "an unpacking of something else than a tuple")
        parts = self.parts(self.held(made))
        if len(parts) != len(targets):
            self.refuse(value, f"an unpacking of {len(parts)} values into {len(targets)}")
        targeted = [t.id if isinstance(t, ast.Name) else "_" for t in targets]
        return [self.bound(name, part, path, value)
                for name, part in zip(targeted, parts, strict=True) if name != "_"]  # fmt: skip


def _stored(node: ast.AST) -> set[str]:
    """Names that get a value somewhere in it."""
    return {
        n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)
    }


def _common(one: tuple[Any, ...], two: tuple[Any, ...]) -> tuple[Any, ...]:
    """The block around both."""
    n = next((i for i, (a, b) in enumerate(zip(one, two, strict=False)) if a != b),
             min(len(one), len(two)))  # fmt: skip
    return one[:n]


def _references(
    statements: Iterable[ast.stmt], path: tuple[Any, ...]
) -> Iterator[tuple[str, tuple[Any, ...], bool]]:
    """Every name with the block that it stands in, and whether it gets a value there."""
    for each in statements:
        inner: list[ast.AST] = [each]
        if isinstance(each, ast.If | ast.For):
            inner = [each.test] if isinstance(each, ast.If) else [each.iter]
            yield from _references(each.body, (*path, (id(each), 0)))
            yield from _references(each.orelse, (*path, (id(each), 1)))
        for node in (n for part in inner for n in ast.walk(part)):
            if isinstance(node, ast.Name):
                yield node.id, path, isinstance(node.ctx, ast.Store)
        if isinstance(each, ast.AugAssign):
            yield each.target.id, path, False  # type: ignore[union-attr]


def _unrolled(statements: Iterable[ast.stmt], whole_body: Sequence[ast.stmt]) -> Iterator[ast.stmt]:
    """Statements with the loops written out whose counter is an index or is read behind them."""
    for each in statements:
        if isinstance(each, ast.If):
            each.body = list(_unrolled(each.body, whole_body))
            each.orelse = list(_unrolled(each.orelse, whole_body))
        if not isinstance(each, ast.For):
            yield each
            continue
        assert isinstance(each.iter, ast.Call)
        assert isinstance(each.target, ast.Name)
        name = each.target.id
        inside = {
            id(n)
            for s in whole_body
            for loop in ast.walk(s)
            if isinstance(loop, ast.For) and loop.target.id == name  # type: ignore[attr-defined]
            for n in ast.walk(loop)
        }
        outside = any(
            isinstance(n, ast.Name) and n.id == name and id(n) not in inside
            for s in whole_body
            for n in ast.walk(s)
        )
        ends = [constant_of(a) for a in each.iter.args]
        if None in ends or not (
            outside or any(isinstance(n, ast.Subscript) for n in ast.walk(each))
        ):
            each.body = list(_unrolled(each.body, whole_body))
            yield each
            continue
        for number in range(*(end for end in ends if end is not None)):
            value = ast.copy_location(ast.Constant(number), each)
            body = [_Counted(name, number).visit(copy.deepcopy(s)) for s in each.body]
            if outside:
                yield ast.copy_location(ast.Assign([each.target], value), each)
            yield from _unrolled(body, whole_body)


class _Counted(ast.NodeTransformer):
    """A counter's value in place of its name."""

    def __init__(self, name: str, number: int) -> None:
        self.name, self.number_node = name, ast.Constant(number)

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if node.id == self.name and isinstance(node.ctx, ast.Load):
            return ast.copy_location(ast.Constant(self.number_node.value), node)
        return node
