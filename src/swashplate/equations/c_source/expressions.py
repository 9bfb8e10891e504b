"""Expressions of an equation in C: values with their kinds, fields, operators and calls."""

from __future__ import annotations

import ast
import math
import re
import typing
from collections.abc import Iterator, Sequence
from types import ModuleType
from typing import Any, NoReturn

from swashplate.equations import loops
from swashplate.equations.c_source.text import (
    BOOL,
    DOUBLE,
    FLAG,
    INT,
    LEVELS,
    Kind,
    Text,
    c_name,
    fields_of,
    literal,
)
from swashplate.equations.language import (
    ARITHMETIC,
    COMPARISONS,
    MATH,
    Parsed,
    hints_of,
    is_named_tuple,
    parsed,
    plain,
    unchecked,
)
from swashplate.errors import EquationError

if typing.TYPE_CHECKING:
    from swashplate.equations.c_source.unit import Unit


class Expressions:
    """Expressions within one function, whose names have kinds."""

    def __init__(
        self, unit: Unit, source: Parsed, kinds: dict[str, Kind], calls: dict[str, Any]
    ) -> None:
        self.unit, self.source, self.calls = unit, source, calls
        kinds = kinds or self.hints(source)
        self.returns = kinds["return"]
        self.formals = {n: kind for n, kind in kinds.items() if n != "return"}
        own = {each.arg for each in source.arguments}
        self.star = [n for n in self.formals if n not in own]
        """Arguments behind a star, by the names that they have in C."""
        self.kinds = dict(self.formals)
        """Kinds of all local names."""
        self.copied: set[str] = set()
        """Arguments with parts that get new values."""
        self.temporaries = 0
        self.before: list[str] = []
        """Lines that a statement needs ahead of it."""

    def refuse(self, node: ast.AST | None, what: str) -> NoReturn:
        """Refuse what has no counterpart in C."""
        line = getattr(node, "lineno", self.source.node.lineno)
        raise EquationError(
            f"{self.source.file}, line {line}: {what} in {self.source.name}, which has no "
            "counterpart in C: write it with numbers and named tuples."
        )

    # -- values with parts -------------------------------------------------------------------------

    def temporary(self) -> str:
        """A new name for a value on its way."""
        self.temporaries += 1
        return f"value_{self.temporaries}"

    def held(self, made: Text) -> Text:
        """A value with parts as something that has an address."""
        if made.pointer or made.place:
            return made
        name = self.temporary()
        line = f"const {self.unit.declared(made.kind)} {name} = {made.text};"
        self.before.append(line)
        return Text(name, LEVELS["atom"], made.kind)

    def parts(self, made: Text) -> list[Text]:
        """All parts of a value."""
        kind = made.kind
        if kind.word == "struct":
            return [self.part(made, name) for name in kind.cls._fields]
        return [self.element(made, i) for i in range(len(kind.items))]

    def part(self, made: Text, name: str) -> Text:
        """A field."""
        cls = made.kind.cls
        kind = self.unit.kind(dict(fields_of(cls))[name], f"{cls.__name__}.{name}")
        dot = "->" if made.pointer else "."
        return Text(f"{_grouped(made, 13)}{dot}{c_name(name)}", 13, kind, place=made.place)

    def element(self, made: Text, index: int | str) -> Text:
        """An element of a tuple."""
        made, items = self.held(made), made.kind.items
        dot = "->" if made.pointer else "."
        if all(item in (DOUBLE, INT) for item in items):
            return Text(f"{_grouped(made, 13)}{dot}v[{index}]", 13, DOUBLE)
        assert isinstance(index, int)
        return Text(f"{_grouped(made, 13)}{dot}v{index}", 13, items[index])

    def numbered(self, made: Text) -> Text:
        """A value whose elements have numbers: a named tuple as a tuple."""
        if made.kind.word != "struct":
            return made
        parts = self.parts(self.held(made))
        kind = Kind("tuple", None, tuple(each.kind for each in parts))
        return Text(self.composed(kind, [pointed(each) for each in parts]), 12, kind)

    def given(self, made: Text) -> str:
        """A value as a function takes it."""
        if not made.kind.whole:
            return made.text
        made = self.held(made)
        return made.text if made.pointer else f"&{_grouped(made, 13)}"

    def converted(self, made: Text, kind: Kind, node: ast.AST) -> str:
        """A value where another kind is wanted."""
        if kind == DOUBLE and made.kind == INT:
            return _double(made)
        if made.kind != kind and {made.kind, kind} != {BOOL, FLAG}:
            if kind.whole and kind.word == made.kind.word == "tuple":
                pairs = zip(self.parts(self.held(made)), kind.items, strict=False)
                return self.composed(kind, [self.converted(p, k, node) for p, k in pairs])
            self.refuse(node, f"a value of kind {made.kind.word} for one of {kind.word}")
        return pointed(made)

    def composed(self, kind: Kind, inner: Sequence[str]) -> str:
        """A tuple of values."""
        array = all(item in (DOUBLE, INT) for item in kind.items)
        listed = ", ".join(inner)
        return f"({self.unit.declared(kind)}){{{f'{{{listed}}}' if array else listed}}}"

    # -- expressions -------------------------------------------------------------------------------

    def value(self, node: ast.expr, wanted: Kind | None = None) -> Text:
        """Any expression."""
        method = getattr(self, f"on_{type(node).__name__.lower()}", None)
        if method is None:
            self.refuse(node, ast.unparse(node))
        made: Text = method(node, wanted) if isinstance(node, ast.Tuple) else method(node)
        return made

    def number(self, node: ast.expr) -> Text:
        """An expression that has to be a scalar."""
        made = self.value(node)
        if made.kind.whole:
            self.refuse(node, f"arithmetic with {ast.unparse(node)}")
        return made

    def on_constant(self, node: ast.Constant) -> Text:
        """A literal number."""
        value: Any = node.value
        if value is None:
            return Text("false", 13, FLAG)
        kind = BOOL if isinstance(value, bool) else INT if isinstance(value, int) else DOUBLE
        return Text(literal(value), 13, kind)

    def on_tuple(self, node: ast.Tuple, wanted: Kind | None = None) -> Text:
        """A tuple of the kinds that are wanted, or of its own."""
        made = [self.value(each) for each in node.elts]
        items = wanted.items if wanted and len(wanted.items) == len(made) else ()
        kinds = [w if w == DOUBLE and m.kind == INT else m.kind
                 for m, w in zip(made, items or [m.kind for m in made], strict=True)]  # fmt: skip
        kind = Kind("tuple", None, tuple(kinds))
        inner = [self.converted(m, k, node) for m, k in zip(made, kinds, strict=True)]
        return Text(self.composed(kind, inner), 12, kind)

    def on_name(self, node: ast.Name) -> Text:
        """A local value, or a constant of the module."""
        if node.id in self.kinds:
            local = node.id not in self.formals or node.id in self.copied
            pointer = self.kinds[node.id].whole and not local
            return Text(c_name(node.id), 13, self.kinds[node.id], pointer)
        return self.outside(node, node.id, self.resolved(node))

    def resolved(self, node: ast.expr) -> Any:
        """What a name of the module, or one in another module, stands for."""
        try:
            return self.source.called(node)
        except (NameError, AttributeError):
            self.refuse(node, f"the unknown name {ast.unparse(node)}")

    def outside(self, node: ast.AST, name: str, value: Any) -> Text:
        """A constant of a module."""
        if value is None or isinstance(value, bool):
            return Text(literal(bool(value)), 13, FLAG if value is None else BOOL)
        if type(value) is float and not math.isfinite(value):
            return Text(literal(value), 13 if value > 0.0 else 12, DOUBLE)
        if type(value) in (int, float):
            return Text(self.unit.constant(name, value), 13, INT if type(value) is int else DOUBLE)
        if isinstance(value, tuple) and value and all(type(v) in (int, float) for v in value):
            kind = Kind("tuple", None, (DOUBLE,) * len(value))
            return Text(self.unit.constant(name, tuple(value)), 13, kind)
        self.refuse(node, f"{name}, which is {type(value).__name__}")

    def on_attribute(self, node: ast.Attribute) -> Text:
        """A field, or a constant of a module."""
        base = node.value
        if isinstance(base, ast.Name) and base.id not in self.kinds:
            module = self.resolved(base)
            if isinstance(module, ModuleType):
                return self.outside(node, node.attr, getattr(module, node.attr))
        made = self.value(base)
        if made.kind.word != "struct" or node.attr not in made.kind.cls._fields:
            self.refuse(node, f"the field {node.attr}, which is unknown")
        return self.part(made, node.attr)

    def on_subscript(self, node: ast.Subscript) -> Text:
        """An element of a tuple."""
        made = self.value(node.value)
        if made.kind.word == "struct":
            made = self.held(made)
        try:
            index: Any = ast.literal_eval(node.slice)
        except ValueError:
            index = constant_of(node.slice)
        if index is None:
            return self.element(self.numbered(made), self.value(node.slice).text)
        length = len(made.kind.items if made.kind.word == "tuple" else made.kind.cls._fields)
        if not -length <= index < length:
            self.refuse(node, f"the element {index}, which is not there")
        index %= length
        return self.element(made, index) if made.kind.word == "tuple" else self.parts(made)[index]

    def on_unaryop(self, node: ast.UnaryOp) -> Text:
        """A sign or `not`."""
        made = self.number(node.operand)
        if isinstance(node.op, ast.Not):
            return Text(f"!{_grouped(made, 12)}", 12, BOOL)
        if isinstance(node.op, ast.UAdd):
            return made
        text = _grouped(made, 12)
        return Text(f"-({text})" if text.startswith("-") else f"-{text}", 12, made.kind)

    def on_binop(self, node: ast.BinOp) -> Text:
        """An arithmetic operation, in the order of the equation."""
        left = self.number(node.left)
        op = ARITHMETIC[type(node.op)]
        if op == "**":
            power = ast.literal_eval(node.right)
            if left.kind == INT:
                self.refuse(node, "a power of a whole number")
            if power == 2 and left.level == 13:
                return Text(f"{left.text} * {left.text}", 11, DOUBLE)
            return Text(f"whole_power({_double(left)}, {power})", 13, DOUBLE)
        right = self.number(node.right)
        kind = INT if left.kind == right.kind == INT and op != "/" else DOUBLE
        level = LEVELS[op]
        one = Text(_double(left), 12, DOUBLE) if kind == DOUBLE and left.kind == INT else left
        two = Text(_double(right), 12, DOUBLE) if kind == DOUBLE and right.kind == INT else right
        return Text(f"{_grouped(one, level)} {op} {_grouped(two, level + 1)}", level, kind)

    def on_compare(self, node: ast.Compare) -> Text:
        """A comparison, also of several terms, and `is None`."""
        left, found = self.value(node.left), list[Text]()
        for op, right_node in zip(node.ops, node.comparators, strict=True):
            if isinstance(op, ast.Is | ast.IsNot):
                if left.kind == FLAG:
                    off = isinstance(op, ast.Is)
                    text = f"!{_grouped(left, 12)}" if off else left.text
                    found.append(Text(text, 12 if off else left.level, BOOL))
                else:
                    found.append(Text(literal(isinstance(op, ast.IsNot)), 13, BOOL))
                continue
            right = self.number(right_node)
            if left.kind.whole:
                self.refuse(node, f"a comparison of {ast.unparse(node.left)}")
            word = COMPARISONS[type(op)]
            sides = [Text(_double(each), 12, DOUBLE) if DOUBLE in (left.kind, right.kind)
                     and each.kind == INT else each for each in (left, right)]  # fmt: skip
            text = f"{_grouped(sides[0], 9)} {word} {_grouped(sides[1], 9)}"
            found.append(Text(text, LEVELS[word], BOOL))
            left = right
        return found[0] if len(found) == 1 else self.joined(found, "&&")

    def joined(self, found: Sequence[Text], op: str) -> Text:
        """Tests joined by one operator."""
        # an `and` within an `or` keeps its brackets, as compilers and readers like it
        level = LEVELS["<="] - 2 if op == "||" else LEVELS["&&"] + 1
        return Text(f" {op} ".join(_grouped(each, level) for each in found), LEVELS[op], BOOL)

    def on_boolop(self, node: ast.BoolOp) -> Text:
        """`and` and `or` of tests."""
        found = [self.number(each) for each in node.values]
        if any(each.kind not in (BOOL, FLAG) for each in found):
            self.refuse(node, "`and` or `or` of numbers")
        return self.joined(found, "&&" if isinstance(node.op, ast.And) else "||")

    def on_ifexp(self, node: ast.IfExp) -> Text:
        """A conditional expression."""
        test, one, two = self.number(node.test), self.value(node.body), self.value(node.orelse)
        kind = DOUBLE if {one.kind, two.kind} == {INT, DOUBLE} else one.kind
        texts = [self.converted(each, kind, node) for each in (one, two)]
        sides = [text if each.level > 1 else f"({text})" for text, each in
                 zip(texts, (one, two), strict=True)]  # fmt: skip
        return Text(f"{_grouped(test, 4)} ? {sides[0]} : {sides[1]}", 1, kind, place=False)

    # -- calls -------------------------------------------------------------------------------------

    def on_call(self, node: ast.Call) -> Text:
        """A call of an equation, a function of `math` or a named tuple."""
        function = node.func
        name = function.id if isinstance(function, ast.Name) else ""
        if name in self.calls:
            return self.called(node, self.calls[name])
        found = self.resolved(function)
        if found in (min, max):
            return self.least(node, "lesser_of" if found is min else "greater_of")
        if found is len:
            return Text(str(len(self.value(node.args[0]).kind.items)), 13, INT)
        if found is float:
            return Text(_double(self.number(node.args[0])), 12, DOUBLE)
        if found is int or found is math.floor:
            inner = _double(self.number(node.args[0]))
            inner = f"floor({inner})" if found is math.floor else inner
            return Text(f"whole_number({inner})", 13, INT)
        if found is abs:
            return Text(f"fabs({_double(self.number(node.args[0]))})", 13, DOUBLE)
        if found in MATH:
            inner = ", ".join(_double(self.number(each)) for each in node.args)
            return Text(f"{MATH[found]}({inner})", 13, DOUBLE)
        if is_named_tuple(found):
            return self.constructed(node, found)
        if plain(found) in _BUILT_ON:
            return self.specialised(node, found)
        return self.called(node, found)

    def least(self, node: ast.Call, function: str) -> Text:
        """`min` or `max` of any number of values."""
        made = [self.number(each) for each in node.args]
        text = _double(made[0])
        for each in made[1:]:
            text = f"{function}({text}, {_double(each)})"
        return Text(text, 13, DOUBLE)

    def bind(self, node: ast.Call, names: Sequence[str], defaults: dict[str, Any]) -> list[Text]:
        """Values for arguments, in their order."""
        given = dict(zip(names, self.spread(node.args), strict=False))
        given |= {each.arg: self.value(each.value) for each in node.keywords if each.arg}
        for name in names:
            if name not in given:
                if name not in defaults:
                    self.refuse(node, f"a call without {name}")
                given[name] = self.outside(node, name, defaults[name])
        if len(given) != len(names):
            self.refuse(node, f"{ast.unparse(node)} with arguments that are not taken")
        return [given[name] for name in names]

    def spread(self, args: Sequence[ast.expr]) -> Iterator[Text]:
        """Arguments, those behind a star one by one."""
        for each in args:
            if isinstance(each, ast.Starred):
                for name in self.star:
                    yield self.value(ast.Name(name, ast.Load()))
            else:
                yield self.value(each)

    def constructed(self, node: ast.Call, cls: Any) -> Text:
        """A named tuple."""
        hints, kind = dict(fields_of(cls)), Kind("struct", cls)
        made = self.bind(node, cls._fields, cls._field_defaults)
        kinds = [self.unit.kind(hints[n], f"{cls.__name__}.{n}") for n in cls._fields]
        texts = [self.converted(m, k, node) for m, k in zip(made, kinds, strict=True)]
        if node.keywords:
            pairs = zip(cls._fields, texts, strict=True)
            texts = [f".{c_name(name)} = {text}" for name, text in pairs]
        return Text(f"({self.unit.declared(kind)}){{{', '.join(texts)}}}", 12, kind)

    def called(self, node: ast.Call, function: Any) -> Text:
        """A call of an equation."""
        source = parsed(function)
        name = self.unit.add(function)
        if name in map(c_name, self.kinds):
            self.refuse(node, f"a call of {name} beside a value of that name")
        hints = self.hints(source)
        names = [each.arg for each in source.arguments]
        texts = []
        for made, formal in zip(self.bind(node, names, source.defaults), names, strict=True):
            kind = hints[formal]
            texts.append(
                self.given(made) if made.kind == kind and kind.whole
                else self.given(Text(self.converted(made, kind, node), 12, kind))
            )  # fmt: skip
        return Text(f"{name}({', '.join(texts)})", 13, hints["return"], place=False)

    def hints(self, source: Parsed) -> dict[str, Kind]:
        """Kinds of what an equation takes and returns."""
        hints = hints_of(source.function).items()
        return {name: self.unit.kind(hint, name) for name, hint in hints}

    def specialised(self, node: ast.Call, function: Any) -> Text:
        """A call of `root`, `repeated` or `interpolate`, made for what it is given."""
        source = unchecked(function)
        formals = [each.arg for each in source.arguments]
        calls, args = {}, list(node.args)
        if formals[0] in ("residual", "step"):
            found = self.resolved(args.pop(0))
            calls = {formals.pop(0): found}
            inner = parsed(found)
            own = [each.arg for each in inner.arguments]
            leading = len(own) - (len(args) - len(formals))
            formals += own[leading:]
        made = [self.value(each) for each in args]
        if formals[-1] == "values":  # of `interpolate`, which counts them
            made = [made[0], *(self.numbered(each) for each in made[1:])]
        made = [Text(_double(m), 12, DOUBLE) if m.kind == INT else m for m in made]
        kinds = {name: each.kind for name, each in zip(formals, made, strict=True)}
        kinds["return"] = kinds.get("state", DOUBLE)
        key = (*(plain(each) for each in calls.values()), *kinds.values())
        name = self.unit.made(source, key, kinds, calls)
        texts = ", ".join(self.given(each) for each in made)
        return Text(f"{name}({texts})", 13, kinds["return"], place=False)


_BUILT_ON = {plain(each) for each in (loops.root, loops.repeated, loops.interpolate)}
"""Functions of the engine that equations call, written with more than equations may use."""


def _grouped(made: Text, level: int) -> str:
    return made.text if made.level >= level else f"({made.text})"


def pointed(made: Text) -> str:
    """A value, not its address."""
    return f"*{made.text}" if made.pointer else made.text


def _double(made: Text) -> str:
    """A scalar as a double."""
    if made.kind != INT:
        return made.text
    if re.fullmatch(r"-?\d+", made.text):
        return f"{made.text}.0"
    return f"(double){_grouped(made, 12)}"


def constant_of(node: ast.expr) -> int | None:
    """Value of arithmetic of whole numbers, nothing if it is none."""
    if any(not isinstance(n, ast.Constant | ast.BinOp | ast.UnaryOp | ast.operator | ast.unaryop)
           for n in ast.walk(node)):  # fmt: skip
        return None
    return int(eval(compile(ast.Expression(node), "", "eval"), {}))
