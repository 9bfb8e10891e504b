"""Reading equations: the statements of a function, done with names and numbers as straight code."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from inspect import Parameter, Signature
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

from swashplate.equations import expressions as ex
from swashplate.equations.code import (
    Choice,
    Code,
    Flag,
    Item,
    Let,
    Rule,
    Tuple,
    Value,
    alike,
    fixed,
    leaves,
    rebuilt,
)
from swashplate.equations.declaration import JIT_OFF
from swashplate.equations.expressions import Node, make
from swashplate.equations.loops import interpolate, interpolated, repeated, repetition, root, solved
from swashplate.equations.syntax import (
    ARITHMETIC,
    CHOICES,
    COMPARISONS,
    MATH,
    Parsed,
    has_return,
    is_named_tuple,
    parsed,
    plain,
)

Way = tuple[list[Item], Value]
"""What is done one way of a decision, and what comes of it."""

Names = dict[str, Value]
R = TypeVar("R")

RULES: WeakKeyDictionary[FunctionType, Any] = WeakKeyDictionary()
"""Equations that return the derivatives of others."""
LOOPS = {
    "root": ("residual, low, high", ("the unknown",), solved),
    "repeated": ("step, count, state", ("a state", "the number of the repetition"), repetition),
}
"""What loops take ahead of the rest, what their equation takes ahead of it, how they are made."""
FEW = 8
"""Operations that may be done in vain, so that a branch becomes a conditional expression."""


def read(code: Code, equation: Any, given: Mapping[str, Value]) -> Value:
    """Append what an equation does to some code, and return its result.

    Arguments that are not `given` by name have their defaults.
    """
    source = parsed(equation)
    if source in code.under_way:
        source.refuse(None, "a call of itself", "write a loop over a literal range")
    defaults = {name: fixed(each) for name, each in source.defaults.items()}
    known = {name: each for name, each in defaults.items() if each is not None} | dict(given)
    known = {each.arg: known[each.arg] for each in source.arguments if each.arg in known}
    code.under_way.append(source)
    try:
        rule = RULES.get(plain(equation)) if code.ruled else None
        if rule is not None:
            return _ruled(code, source, parsed(rule), known)
        return _Reader(source, code).result(known)
    finally:
        code.under_way.pop()


def _ruled(code: Code, source: Parsed, rule: Parsed, known: Mapping[str, Value]) -> Value:
    """An equation with declared derivatives: both are done, and stay together."""
    given = {name: code.named(value, name) for name, value in known.items()}
    code.ruled = False  # what is declared is not differentiated
    try:
        items, (result, slopes) = code.aside(
            lambda: (_Reader(source, code).result(given), _Reader(rule, code).result(given))
        )
    finally:
        code.ruled = True
    below = [(name, *leaf) for name, value in given.items() for leaf in leaves(value)]
    by = {".".join(filter(None, (a, b))): node for a, b, node in below if node.kind == "float"}
    nodes, found = [*leaves(result)], [node for _, node in leaves(slopes)]
    if len(found) != len(by) * len(nodes):
        rule.refuse(
            None,
            f"a number of derivatives that is not {len(by) * len(nodes)}",
            f"return those by {', '.join(by)}, in order",
        )
    results = {}
    for path, node in nodes:
        name = code.fresh(f"{source.name}_{path}" if path else source.name)
        items.append(Let(name, node))
        pairs = [(argument, found.pop(0)) for argument in by.values()]
        moved = [(a, b) for a, b in pairs if a.op != "number" and not ex.is_number(b, 0.0)]
        results[name] = (ex.name(name, node.kind), moved)
    code.items.append(Rule(items, (*results,), [moved for _, moved in results.values()]))
    return rebuilt(result, iter([node for node, _ in results.values()]))


class _Reader:
    """Does the statements of one equation."""

    def __init__(self, source: Parsed, code: Code) -> None:
        self.source, self.code, self.refuse = source, code, source.refuse
        self.local = source.local
        self.env: Names = {}

    def result(self, given: Mapping[str, Value]) -> Value:
        """What the equation returns for some arguments."""
        self.env = {name: self.code.named(value, name) for name, value in given.items()}
        return self.returned(self.source.node.body)

    def returned(self, statements: Sequence[ast.stmt]) -> Value:
        """What statements return that certainly do."""
        value = self.block(statements)
        assert value is not None  # a checked equation ends in a return
        return value

    # -- statements --------------------------------------------------------------------------------

    def block(self, statements: Sequence[ast.stmt]) -> Value | None:
        """Do statements; what they return, if they do."""
        pending = [*statements]
        while pending:
            match each := pending.pop(0):
                case ast.Return(value=ast.expr() as value):
                    return self.value(value)
                case ast.If():
                    test = self.test(each.test)
                    if test.op == "number":
                        pending[:0] = each.body if test.value else each.orelse
                    elif has_return([each]):
                        one, _ = self.way(self.returned, [*each.body, *pending])
                        two, _ = self.way(self.returned, [*each.orelse, *pending])
                        return self.either(each, test, one, two, "value")
                    else:
                        self.merge(test, each)
                case ast.For(target=target, iter=ast.Call(args=args)):
                    for i in reversed(range(*map(ast.literal_eval, args))):
                        number = ast.copy_location(ast.Constant(i), each)
                        set_counter = ast.copy_location(ast.Assign([target], number), each)
                        pending[:0] = [set_counter, *each.body]
                case ast.Assign(targets=targets, value=value):
                    made = self.value(value)
                    for target in targets:
                        self.bind(target, made)
                case ast.AnnAssign(target=target, value=ast.expr() as value):
                    self.bind(target, self.value(value))
                case ast.AugAssign(target=ast.Name(id=name) as target):
                    left = ast.copy_location(ast.Name(name), each)
                    term = ast.copy_location(ast.BinOp(left, each.op, each.value), each)
                    self.bind(target, self.value(term))
        return None

    def way(self, read: Callable[[Any], R], what: Any) -> tuple[tuple[list[Item], R], Names]:
        """What one way of a decision comes to, and its names; those here stay as they are."""
        outer, self.env = self.env, dict(self.env)
        try:
            return self.code.aside(lambda: read(what)), self.env
        finally:
            self.env = outer

    def merge(self, test: Node, each: ast.If) -> None:
        """An `if` that does not return: what both of its ways set is merged."""
        (then, _), one = self.way(self.block, each.body)
        (other, _), two = self.way(self.block, each.orelse)
        changed = [n for n in {**one, **two} if one.get(n) is not two.get(n)]
        for name in [n for n in changed if n not in one or n not in two]:
            self.env.pop(name, None)  # without a value one way: refused where it is read
            changed.remove(name)
        for name in changed:
            if not alike(one[name], two[name]):
                self.refuse(each, f"{name} of two structures", "give it the same kind of value")
        names = SimpleNamespace(_fields=tuple(changed))
        first, second = (Tuple(names, tuple(env[n] for n in changed)) for env in (one, two))
        found = self.code.named(self.either(each, test, (then, first), (other, second), ""), "")
        assert isinstance(found, Tuple)
        self.env.update(zip(changed, found.items, strict=True))

    def either(self, at: ast.AST, test: Node, one: Way, two: Way, stem: str) -> Value:
        """The value of one of two ways: conditional expressions where both are cheap."""
        (then, first), (other, second) = one, two
        if not alike(first, second):
            self.refuse(at, "results of different structure", "give the same tuple on every way")
        pairs = [(*a, b) for a, (_, b) in zip(leaves(first), leaves(second), strict=True)]
        flat, more = _flat(then, [a for _, a, _ in pairs]), _flat(other, [b for _, _, b in pairs])
        if flat is not None and more is not None:
            return rebuilt(
                first, iter([ex.choose(test, *ab) for ab in zip(flat, more, strict=True)])
            )
        choice, nodes = Choice(test, then, other, []), []
        for path, a, b in pairs:
            if a is not b:
                name = self.code.fresh("_".join(filter(None, (stem, path))))
                choice.merged.append((name, a, b))
                a = ex.name(name, make("if", test, a, b).kind)
            nodes.append(a)
        if choice.merged:
            self.code.items.append(choice)
        return rebuilt(first, iter(nodes))

    def bind(self, target: ast.expr, value: Value) -> None:
        """Give a name its value, or each of several in a tuple."""
        if isinstance(target, ast.Tuple):
            if not isinstance(value, Tuple) or len(value.items) != len(target.elts):
                self.refuse(
                    target, "an unpacking of something else", "unpack a tuple of as many values"
                )
            for each, item in zip(target.elts, value.items, strict=True):
                self.bind(each, item)
            return
        assert isinstance(target, ast.Name)
        self.env[target.id] = self.code.named(value, target.id)

    # -- expressions -------------------------------------------------------------------------------

    def test(self, node: ast.expr) -> Node:
        """A decision; an option that is on counts as true."""
        value = self.value(node)
        if isinstance(value, Flag):
            return ex.number(self.known(node, value) is not None)
        if isinstance(value, Node):
            return ex.number(bool(value.value)) if value.op == "number" else value
        self.refuse(node, "a test of a tuple", "compare its elements")

    def known(self, node: ast.AST, option: Flag) -> Any:
        """Value of an option, refused where it was not said."""
        if option.value == "unknown":
            what = f"a test of the option {option.text}, whose value is not known"
            self.refuse(node, what, f'say options={{"{option.text}": None}}, or True')
        return option.value

    def scalar(self, node: ast.expr) -> Node:
        """Value of an expression that has to be a number."""
        value = self.value(node)
        if isinstance(value, Node):
            return value
        if isinstance(value, Flag):
            self.refuse(node, "arithmetic with an option", "test it with `is None`")
        self.refuse(node, "arithmetic with a tuple", "name its elements")

    def value(self, node: ast.expr) -> Value:
        """Value of any expression."""
        match node:
            case ast.Constant(value=None):
                return Flag(None)
            case ast.Constant(value=int(number) | float(number)):
                return ex.number(number)
            case ast.Tuple(elts=items):
                return Tuple(None, tuple(map(self.value, items)))
            case ast.Name(id=name) if name in self.env:
                return self.env[name]
            case ast.Name(id=name):
                if name in self.local:
                    instead = "give it a value on every way"
                    self.refuse(node, f"{name} without a value on some way", instead)
                return self.constant(node, name, self.outside(node))
            case ast.Attribute():
                return self.field(node)
            case ast.Subscript():
                return self.element(node)
            case ast.UnaryOp(op=ast.Not()):
                test = self.test(node.operand)
                return ex.number(not test.value) if test.op == "number" else make("not", test)
            case ast.UnaryOp():
                inner = self.scalar(node.operand)
                if isinstance(node.op, ast.UAdd):
                    return inner
                return ex.number(-inner.value) if inner.op == "number" else make("neg", inner)
            case ast.BinOp():
                return self.arithmetic(node)
            case ast.Compare():
                return self.comparison(node)
            case ast.BoolOp():
                return self.joined(node)
            case ast.IfExp():
                test = self.test(node.test)
                if test.op == "number":
                    return self.value(node.body if test.value else node.orelse)
                one, _ = self.way(self.value, node.body)
                two, _ = self.way(self.value, node.orelse)
                return self.either(node, test, one, two, "chosen")
            case ast.Call():
                return self.call(node)
        self.refuse(node, "this expression", "use arithmetic")

    def outside(self, node: ast.expr) -> Any:
        """What a name, or a name in a module, stands for outside the equation."""
        try:
            return self.source.called(node)
        except (NameError, AttributeError):
            self.refuse(node, f"the unknown name {ast.unparse(node)}", "define or import it")

    def constant(self, node: ast.AST, text: str, found: Any) -> Value:
        """Value of something that stands outside the equation."""
        value = fixed(found)
        if value is None:
            what = f"{text}, which is {type(found).__name__}"
            self.refuse(node, what, "of what stands outside, an equation reads numbers only")
        return value

    def field(self, node: ast.Attribute) -> Value:
        """Value of a field, or of a constant of a module."""
        base = node.value
        module = isinstance(base, ast.Name) and base.id not in {*self.local, *self.env}
        if module and isinstance(self.outside(base), ModuleType):
            return self.constant(node, node.attr, self.outside(node))
        value = self.value(base)
        if not isinstance(value, Tuple) or value.cls is None or node.attr not in value.fields:
            what = f"the field {node.attr}, which is unknown"
            self.refuse(node, what, "name a field of the named tuple")
        return value.items[value.fields.index(node.attr)]

    def element(self, node: ast.Subscript) -> Value:
        """Value of an element of a tuple."""
        index, value = self.scalar(node.slice), self.value(node.value)
        if index.op != "number" or index.kind != "int":
            self.refuse(node.slice, "an index that is no whole number", "write the number")
        if not isinstance(value, Tuple) or not -len(value.items) <= index.value < len(value.items):
            self.refuse(node, f"the element {index.value}, which is not there", "count from 0")
        found: Value = value.items[index.value]
        return found

    def arithmetic(self, node: ast.BinOp) -> Node:
        """Value of an arithmetic operation, exactly as written."""
        op, left = ARITHMETIC[type(node.op)], self.scalar(node.left)
        if op == "**":
            return make("**", left, value=ast.literal_eval(node.right))
        right = self.scalar(node.right)
        if left.kind == right.kind == "int" and left.op == right.op == "number" and op != "/":
            counted = {"+": int.__add__, "-": int.__sub__, "*": int.__mul__}[op]
            return ex.number(counted(left.value, right.value))
        if op == "*" and left.kind == right.kind == "float":  # a factor that is known to be one
            for one, other in ((left, right), (right, left)):
                if ex.is_number(one, 1.0):
                    return other
        return make(op, left, right)

    def comparison(self, node: ast.Compare) -> Node:
        """A comparison, also of several terms, and `is None`."""
        left, found = self.value(node.left), ex.number(True)
        for op, right_node in zip(node.ops, node.comparators, strict=True):
            if isinstance(op, ast.Is | ast.IsNot):
                missing = isinstance(left, Flag) and self.known(node, left) is None
                found = _joined(found, ex.number(missing == isinstance(op, ast.Is)), True)
                continue
            right = self.scalar(right_node)
            if not isinstance(left, Node):
                self.refuse(node, "a comparison of a tuple", "compare its elements")
            found = _joined(found, make(COMPARISONS[type(op)], left, right), True)
            left = right
        return found

    def joined(self, node: ast.BoolOp) -> Node:
        """`and` and `or`; what must not be done in vain is put behind the test."""
        conjunction = isinstance(node.op, ast.And)
        test = ex.number(conjunction)
        for each in node.values:
            if test.op == "number" and bool(test.value) != conjunction:
                return test
            (items, more), _ = self.way(self.test, each)
            if test.op == "number" or (not items and more.cheap):
                self.code.items += items
                test = _joined(test, more, conjunction)
                continue
            one: Way = (items, more)
            two: Way = ([], ex.number(not conjunction))
            one, two = (one, two) if conjunction else (two, one)
            found = self.either(node, test, one, two, "test")
            assert isinstance(found, Node)
            test = found
        return test

    # -- calls -------------------------------------------------------------------------------------

    def call(self, node: ast.Call) -> Value:
        """Value of a call."""
        found = self.outside(node.func)
        if found in MATH or found in CHOICES:
            return self.function(node, MATH.get(found) or CHOICES[found])
        if is_named_tuple(found):
            return Tuple(found, tuple(self.arguments(node, found._fields, ()).values()))
        kind = plain(found)
        if kind is plain(root) or kind is plain(repeated):
            return self.loop(node, kind.__name__)
        if kind is plain(interpolate):
            return self.table(self.arguments(node, ("x", "knots", "values"), ()), node)
        if not _is_equation(found):
            text = ast.unparse(node.func)
            self.refuse(node, f"a call of {text}", f"make {text} an @equation")
        callee = parsed(found)
        names = [each.arg for each in callee.arguments]
        return read(self.code, found, self.arguments(node, names, callee.defaults))

    def function(self, node: ast.Call, op: str) -> Node:
        """Value of a function of numbers."""
        args = [self.scalar(each) for each in node.args]
        least = 2 if op in ("atan2", "hypot", "min", "max") else 1
        exactly = len(args) == least or (len(args) > least and op in ("min", "max"))
        if not exactly or node.keywords:
            self.refuse(node, f"{op} of {len(args)} arguments", f"give it {least}")
        return make(op, *args)

    def arguments(self, node: ast.Call, names: Sequence[str], optional: Any) -> Names:
        """Values for arguments of these names, in their order as far as they are given."""
        positional = [self.value(each) for each in node.args]
        by_name = {str(each.arg): self.value(each.value) for each in node.keywords}
        defaults = {name: None if name in optional else Parameter.empty for name in names}
        taken = [
            Parameter(name, Parameter.POSITIONAL_OR_KEYWORD, default=defaults[name])
            for name in names
        ]
        try:
            return Signature(taken).bind(*positional, **by_name).arguments
        except TypeError as error:
            what = f"a call of {ast.unparse(node.func)} with {error}"
            self.refuse(node, what, f"it takes {', '.join(names)}")

    def loop(self, node: ast.Call, word: str) -> Value:
        """Value of `root` or `repeated`: the equation by its name, and the other arguments."""
        takes, own, make_of = LOOPS[word]
        if len(node.args) < 3 or node.keywords:
            self.refuse(node, f"{word} with other arguments", f"write {word}({takes}, a, b, ...)")
        first = node.args[0]
        named = isinstance(first, ast.Name | ast.Attribute) and ast.unparse(first) not in self.local
        found = self.outside(first) if named else None
        if not _is_equation(found):
            self.refuse(node, f"{word} of something else", "give it the name of an @equation")
        inner, values = parsed(found), [self.value(each) for each in node.args[1:]]
        if len(inner.arguments) != len(own) + len(values) - 2:
            what = f"{word} of {inner.name} with other arguments"
            self.refuse(node, what, f"let it take {', '.join(own)} and the rest")
        return make_of(self.code, inner, values[0], values[1], values[2:], read)

    def table(self, given: Mapping[str, Value], node: ast.Call) -> Value:
        """Value of `interpolate`."""
        x, knots, values = (self.code.named(value, name) for name, value in given.items())
        if not (
            isinstance(x, Node)
            and isinstance(knots, Tuple)
            and isinstance(values, Tuple)
            and len(knots.items) == len(values.items) > 1
        ):
            self.refuse(
                node,
                "interpolate with something else than a number and two tuples of one length",
                "type them tuple[float, float, ...] with every element, or give derive their "
                "lengths",
            )
        numbers = [[node for _, node in leaves(each)] for each in (knots, values)]
        return interpolated(self.code, x, *numbers)


def _joined(one: Node, two: Node, conjunction: bool) -> Node:
    """Two tests joined by `and` or `or`; known ones vanish."""
    for known, rest in ((one, two), (two, one)):
        if known.op == "number":
            return rest if bool(known.value) == conjunction else known
    word = "and" if conjunction else "or"
    parts = [part for each in (one, two) for part in (each.args if each.op == word else (each,))]
    return make(word, *parts)


def _flat(items: Sequence[Item], ends: Sequence[Node]) -> list[Node] | None:
    """Ends with the items in them, nothing if they cannot be done whatever a test says."""
    meanings: dict[str, Node] = {}
    operations = sum(map(ex.size, ends)) if items else 0
    for each in items:
        if not isinstance(each, Let) or not each.node.cheap:
            return None
        operations += ex.size(each.node)
        meanings[each.name] = ex.substitute(each.node, meanings)
    if operations > FEW or not all(node.cheap for node in ends):
        return None
    return [ex.substitute(node, meanings) for node in ends]


def _is_equation(found: Any) -> bool:
    """Whether something may be an equation: a function that is compiled, if any is."""
    return isinstance(plain(found), FunctionType) and (plain(found) is not found or JIT_OFF)
