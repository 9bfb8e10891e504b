"""Reading equations: the statements of a function, done with names and numbers as straight code."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from types import FunctionType, ModuleType
from typing import Any
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
from swashplate.equations.equation import JIT_OFF
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
    whole,
)

Environment = dict[str, Value]

RULES: WeakKeyDictionary[FunctionType, Any] = WeakKeyDictionary()
"""Equations that return the derivatives of others."""
FEW = 8
"""Operations that may be done in vain, so that a branch becomes a conditional expression."""
ARGUMENTS = {"atan2": (2, 2), "hypot": (2, 2), "min": (2, 99), "max": (2, 99)}
"""Least and largest number of arguments of functions that take more than one."""
LOOPS = {
    "root": ("residual, low, high", "give it low, high and the rest"),
    "repeated": (
        "step, count, state",
        "let it take a state, the number of the repetition and the rest",
    ),
}
"""What loops take before the arguments of their equation, and what such an equation must take."""


def read(code: Code, equation: Any, given: Mapping[str, Value]) -> Value:
    """Append what an equation does to some code, and return its result.

    Arguments that are not `given` by name have their defaults.

    Raises
    ------
    EquationError
        If the equation does what equations may not, or its arguments are none that it takes.
    """
    source = parsed(equation)
    if source in code.under_way:
        source.refuse(None, "a call of itself", "write a loop over a literal range")
    environment = {each.arg: given[each.arg] for each in source.arguments if each.arg in given}
    for name, default in source.defaults.items():
        value = fixed(default)
        if value is not None:
            environment.setdefault(name, value)
    code.under_way.append(source)
    try:
        rule = RULES.get(plain(equation)) if code.ruled else None
        if rule is not None:
            return _ruled(code, source, parsed(rule), environment)
        return _Reader(source, code).result(environment)
    finally:
        code.under_way.pop()


def _ruled(code: Code, source: Parsed, rule: Parsed, environment: Environment) -> Value:
    """An equation with declared derivatives: both are done, and stay together."""
    given = {name: code.named(value, name) for name, value in environment.items()}
    code.ruled = False  # what is declared is not differentiated
    try:
        items, (result, slopes) = code.aside(
            lambda: (
                _Reader(source, code).result(given),
                _Reader(rule, code).result({**given}),
            )
        )
    finally:
        code.ruled = True
    by = [node for value in given.values() for _, node in leaves(value) if node.kind == "float"]
    nodes, found = list(leaves(result)), [node for _, node in leaves(slopes)]
    if len(found) != len(by) * len(nodes):
        names = [
            f"{name}.{path}" if path else name
            for name, value in given.items()
            for path, node in leaves(value)
            if node.kind == "float"
        ]
        rule.refuse(
            None,
            f"a number of derivatives that is not {len(by) * len(nodes)}",
            f"return those by {', '.join(names)}, in order",
        )
    results, each = [], []
    for i, (path, node) in enumerate(nodes):
        results.append((code.fresh(f"{source.name}_{path}" if path else source.name), node))
        pairs = zip(by, found[i * len(by) : (i + 1) * len(by)], strict=True)
        each.append([(a, b) for a, b in pairs if a.op != "number" and not ex.is_number(b, 0.0)])
    code.items.append(Rule(items, results, each))
    return rebuilt(result, iter([ex.name(name, node.kind) for name, node in results]))


class _Reader:
    """Does the statements of one equation."""

    def __init__(self, source: Parsed, code: Code) -> None:
        self.source, self.code, self.refuse = source, code, source.refuse
        self.local = set(source.function.__code__.co_varnames)

    def result(self, given: Environment) -> Value:
        """What the equation returns for some arguments."""
        named = {name: self.code.named(value, name) for name, value in given.items()}
        value = self.block(self.source.node.body, named)
        assert value is not None  # a checked equation ends in a return
        return value

    # -- statements --------------------------------------------------------------------------------

    def block(self, statements: Sequence[ast.stmt], env: Environment) -> Value | None:
        """Do statements; what they return, if they do."""
        pending = list(statements)
        while pending:
            each = pending.pop(0)
            if isinstance(each, ast.Return):
                assert each.value is not None
                return self.value(each.value, env)
            if isinstance(each, ast.If):
                test = self.test(each.test, env)
                if test.op == "number":
                    pending[:0] = each.body if test.value else each.orelse
                elif has_return([each]):
                    return self.returned(test, each, pending, env)
                else:
                    self.merge(test, each, env)
            elif isinstance(each, ast.For):
                pending[:0] = self.unrolled(each)
            else:
                self.assignment(each, env)
        return None

    def returned(
        self, test: Node, each: ast.If, behind: Sequence[ast.stmt], env: Environment
    ) -> Value:
        """What either way of an `if` that returns leads to, with all that stands behind it."""
        then, one = self.code.aside(lambda: self.block([*each.body, *behind], dict(env)))
        other, two = self.code.aside(lambda: self.block([*each.orelse, *behind], dict(env)))
        assert one is not None
        assert two is not None
        if not alike(one, two):
            self.refuse(
                None, "results of different structure", "return the same tuple on every way"
            )
        return self.either(test, (then, one), (other, two), "value")

    def merge(self, test: Node, each: ast.If, env: Environment) -> None:
        """An `if` that does not return: what both of its ways set is merged."""
        one, two = dict(env), dict(env)
        then, _ = self.code.aside(lambda: self.block(each.body, one))
        other, _ = self.code.aside(lambda: self.block(each.orelse, two))
        changed = [n for n in {**one, **two} if one.get(n) is not two.get(n)]
        for name in [n for n in changed if n not in one or n not in two]:
            env.pop(name, None)  # without a value one way: refused where it is read
            changed.remove(name)
        for name in changed:
            if not alike(one[name], two[name]):
                self.refuse(each, f"{name} of two structures", "give it the same kind of value")
        values = (Tuple(None, tuple(way[n] for n in changed)) for way in (one, two))
        first, second = values
        found = self.either(test, (then, first), (other, second), changed)
        assert isinstance(found, Tuple)
        env.update(zip(changed, found.items, strict=True))

    def either(
        self,
        test: Node,
        one: tuple[list[Item], Value],
        two: tuple[list[Item], Value],
        stems: str | Sequence[str],
    ) -> Value:
        """The value of one of two ways: conditional expressions where both are cheap."""
        (then, first), (other, second) = one, two
        pairs = [
            (path, a, b) for (path, a), (_, b) in zip(leaves(first), leaves(second), strict=True)
        ]
        ends = [a for _, a, _ in pairs], [b for _, _, b in pairs]
        if _cheap(then, ends[0]) and _cheap(other, ends[1]):
            meanings = _meanings(then), _meanings(other)
            flat = [
                ex.choose(test, ex.substitute(a, meanings[0]), ex.substitute(b, meanings[1]))
                for _, a, b in pairs
            ]
            made = rebuilt(first, iter(flat))
            if isinstance(stems, str):
                return made
            assert isinstance(made, Tuple)
            items = zip(made.items, stems, strict=True)
            return Tuple(None, tuple(self.code.named(value, stem) for value, stem in items))
        choice = Choice(test, then, other, [])
        nodes = []
        for path, a, b in pairs:
            if a is not b:
                where, _, rest = path.partition(".")
                stem = stems if isinstance(stems, str) else stems[int(where)]
                tail = path if isinstance(stems, str) else rest
                name = self.code.fresh(f"{stem}_{tail}" if tail else stem)
                choice.merged.append((name, a, b))
                a = ex.name(name, make("if", test, a, b).kind)
            nodes.append(a)
        if choice.merged:
            self.code.items.append(choice)
        return rebuilt(first, iter(nodes))

    def unrolled(self, loop: ast.For) -> list[ast.stmt]:
        """The statements of a loop, once for each number of its range."""
        assert isinstance(loop.iter, ast.Call)
        out: list[ast.stmt] = []
        for i in range(*(whole(a) for a in loop.iter.args)):
            number = ast.copy_location(ast.Constant(i), loop)
            out += [ast.copy_location(ast.Assign([loop.target], number), loop), *loop.body]
        return out

    def assignment(self, each: ast.stmt, env: Environment) -> None:
        if isinstance(each, ast.Assign):
            value = self.value(each.value, env)
            for target in each.targets:
                self.bind(target, value, env)
        elif isinstance(each, ast.AnnAssign):
            assert each.value is not None
            self.bind(each.target, self.value(each.value, env), env)
        elif isinstance(each, ast.AugAssign):
            assert isinstance(each.target, ast.Name)
            left = ast.copy_location(ast.Name(each.target.id, ast.Load()), each)
            term = ast.copy_location(ast.BinOp(left, each.op, each.value), each)
            self.bind(each.target, self.value(term, env), env)

    def bind(self, target: ast.expr, value: Value, env: Environment) -> None:
        if isinstance(target, ast.Tuple):
            if not isinstance(value, Tuple) or len(value.items) != len(target.elts):
                self.refuse(
                    target, "an unpacking of something else", "unpack a tuple of as many values"
                )
            for each, item in zip(target.elts, value.items, strict=True):
                self.bind(each, item, env)
            return
        assert isinstance(target, ast.Name)
        env[target.id] = self.code.named(value, target.id)

    # -- expressions -------------------------------------------------------------------------------

    def test(self, node: ast.expr, env: Environment) -> Node:
        """A decision; an option that is on counts as true."""
        value = self.value(node, env)
        if isinstance(value, Flag):
            return ex.number(self.known(node, value) is not None)
        if isinstance(value, Node):
            return ex.number(bool(value.value)) if value.op == "number" else value
        self.refuse(node, "a test of a tuple", "compare its elements")

    def known(self, node: ast.AST, option: Flag) -> Any:
        """Value of an option, refused where it was not said."""
        if option.value == "unknown":
            self.refuse(
                node,
                f"a test of the option {option.text}, whose value is not known",
                f'say options={{"{option.text}": None}}, or True',
            )
        return option.value

    def scalar(self, node: ast.expr, env: Environment) -> Node:
        """Value of an expression that has to be a number."""
        value = self.value(node, env)
        if isinstance(value, Node):
            return value
        if isinstance(value, Flag):
            self.refuse(node, "arithmetic with an option", "test it with `is None`")
        self.refuse(node, "arithmetic with a tuple", "name its elements")

    def value(self, node: ast.expr, env: Environment) -> Value:
        """Value of any expression."""
        made: Value = getattr(self, f"on_{type(node).__name__.lower()}")(node, env)
        return made

    def on_constant(self, node: ast.Constant, env: Environment) -> Value:
        return Flag(None) if node.value is None else ex.number(node.value)  # type: ignore[arg-type]

    def on_tuple(self, node: ast.Tuple, env: Environment) -> Value:
        return Tuple(None, tuple(self.value(each, env) for each in node.elts))

    def on_unaryop(self, node: ast.UnaryOp, env: Environment) -> Value:
        if isinstance(node.op, ast.Not):
            test = self.test(node.operand, env)
            return ex.number(not test.value) if test.op == "number" else make("not", test)
        inner = self.scalar(node.operand, env)
        if isinstance(node.op, ast.UAdd):
            return inner
        return ex.number(-inner.value) if inner.op == "number" else make("neg", inner)

    def on_name(self, node: ast.Name, env: Environment) -> Value:
        if node.id in env:
            return env[node.id]
        if node.id in self.local:
            self.refuse(
                node, f"{node.id} without a value on some way", "give it a value on every way"
            )
        try:
            return self.constant(node, node.id, self.source.resolve(node.id))
        except NameError:
            self.refuse(node, f"the unknown name {node.id}", "define or import it")

    def constant(self, node: ast.AST, text: str, found: Any) -> Value:
        """Value of something that stands outside the equation."""
        value = fixed(found)
        if value is None:
            self.refuse(
                node,
                f"{text}, which is {type(found).__name__}",
                "of what stands outside, an equation reads numbers only",
            )
        return value

    def on_attribute(self, node: ast.Attribute, env: Environment) -> Value:
        """Value of a field, or of a constant of a module."""
        base = node.value
        if isinstance(base, ast.Name) and base.id not in env and base.id not in self.local:
            try:
                module = self.source.resolve(base.id)
            except NameError:
                self.refuse(node, f"the unknown name {base.id}", "define or import it")
            if isinstance(module, ModuleType):
                return self.constant(node, node.attr, getattr(module, node.attr, module))
        value = self.value(base, env)
        if not isinstance(value, Tuple) or value.cls is None or node.attr not in value.fields:
            self.refuse(
                node, f"the field {node.attr}, which is unknown", "name a field of the named tuple"
            )
        return value.items[value.fields.index(node.attr)]

    def on_subscript(self, node: ast.Subscript, env: Environment) -> Value:
        """Value of an element of a tuple."""
        index = self.scalar(node.slice, env)
        if index.op != "number" or type(index.value) is not int:
            self.refuse(node.slice, "an index that is no whole number", "write the number")
        value = self.value(node.value, env)
        if not isinstance(value, Tuple) or not -len(value.items) <= index.value < len(value.items):
            self.refuse(node, f"the element {index.value}, which is not there", "count from 0")
        return value.items[index.value]

    def on_binop(self, node: ast.BinOp, env: Environment) -> Node:
        """Value of an arithmetic operation, exactly as written."""
        op = ARITHMETIC[type(node.op)]
        left = self.scalar(node.left, env)
        if op == "**":
            return make("**", left, value=whole(node.right))
        right = self.scalar(node.right, env)
        if left.kind == right.kind == "int" and left.op == right.op == "number" and op != "/":
            return ex.number(
                {"+": int.__add__, "-": int.__sub__, "*": int.__mul__}[op](left.value, right.value)
            )
        one = op == "*" and (ex.is_number(left, 1.0) or ex.is_number(right, 1.0))
        if one and left.kind == right.kind == "float":  # a factor that is known to be one
            return right if ex.is_number(left, 1.0) else left
        return make(op, left, right)

    def on_compare(self, node: ast.Compare, env: Environment) -> Node:
        """A comparison, also of several terms, and `is None`."""
        left = self.value(node.left, env)
        found = ex.number(True)
        for op, right_node in zip(node.ops, node.comparators, strict=True):
            if isinstance(op, ast.Is | ast.IsNot):
                missing = isinstance(left, Flag) and self.known(node, left) is None
                found = _both(found, ex.number(missing == isinstance(op, ast.Is)))
                continue
            right = self.scalar(right_node, env)
            if not isinstance(left, Node):
                self.refuse(node, "a comparison of a tuple", "compare its elements")
            found = _both(found, make(COMPARISONS[type(op)], left, right))
            left = right
        return found

    def on_boolop(self, node: ast.BoolOp, env: Environment) -> Node:
        """`and` and `or`; what must not be done in vain is put behind the test."""
        conjunction = isinstance(node.op, ast.And)
        test = ex.number(conjunction)
        for each in node.values:
            if test.op == "number" and bool(test.value) != conjunction:
                return test
            items, more = self.code.aside(lambda each=each: self.test(each, env))  # type: ignore[misc]
            if test.op == "number" or (not items and more.cheap):
                self.code.items += items
                test = _joined(test, more, conjunction)
                continue
            none: tuple[list[Item], Value] = ([], ex.number(not conjunction))
            way: tuple[list[Item], Value] = (items, more)
            one, two = (way, none) if conjunction else (none, way)
            found = self.either(test, one, two, "test")
            assert isinstance(found, Node)
            test = found
        return test

    def on_ifexp(self, node: ast.IfExp, env: Environment) -> Value:
        """Value of a conditional expression."""
        test = self.test(node.test, env)
        if test.op == "number":
            return self.value(node.body if test.value else node.orelse, env)
        one = self.code.aside(lambda: self.value(node.body, env))
        two = self.code.aside(lambda: self.value(node.orelse, env))
        if not alike(one[1], two[1]):
            self.refuse(node, "a value of two structures", "give it the same kind of value")
        return self.either(test, one, two, "chosen")

    # -- calls -------------------------------------------------------------------------------------

    def callee(self, function: ast.expr) -> Any:
        """What a call calls."""
        try:
            if isinstance(function, ast.Name):
                return self.source.resolve(function.id)
            assert isinstance(function, ast.Attribute)
            assert isinstance(function.value, ast.Name)
            return getattr(self.source.resolve(function.value.id), function.attr)
        except (NameError, AttributeError):
            called = ast.unparse(function)
            self.refuse(function, f"a call of the unknown {called}", "define or import it")

    def on_call(self, node: ast.Call, env: Environment) -> Value:
        """Value of a call."""
        found = self.callee(node.func)
        if found in MATH or found in CHOICES:
            args = [self.scalar(each, env) for each in node.args]
            op = MATH.get(found) or CHOICES[found]
            low, high = ARGUMENTS.get(op, (1, 1))
            if not low <= len(args) <= high or node.keywords:
                self.refuse(node, f"{op} of {len(args)} arguments", f"give it {low}")
            return make(op, *args)
        if is_named_tuple(found):
            given = self.arguments(node, env, found._fields, {})
            return Tuple(found, tuple(given[name] for name in found._fields))
        special = {plain(root): self.root, plain(repeated): self.repeated}
        special[plain(interpolate)] = self.interpolate
        if plain(found) in special:
            return special[plain(found)](node, env)
        if not _is_equation(found):
            text = ast.unparse(node.func)
            self.refuse(node, f"a call of {text}", f"make {text} an @equation")
        callee = parsed(found)
        names = [each.arg for each in callee.arguments]
        return read(self.code, found, self.arguments(node, env, names, callee.defaults))

    def arguments(
        self, node: ast.Call, env: Environment, names: Sequence[str], defaults: Mapping[str, Any]
    ) -> Environment:
        """Values for arguments of these names."""
        given: Environment = {}
        if len(node.args) > len(names):
            self.refuse(node, "a call with too many arguments", f"give {len(names)}")
        for name, each in zip(names, node.args, strict=False):
            given[name] = self.value(each, env)
        for keyword in node.keywords:
            if keyword.arg is None or keyword.arg not in names or keyword.arg in given:
                self.refuse(node, f"the argument {keyword.arg}", f"of {', '.join(names)}")
            given[keyword.arg] = self.value(keyword.value, env)
        for name in names:
            if name not in given:
                if name not in defaults:
                    self.refuse(node, f"a call without {name}", "give a value for it")
                given[name] = self.constant(node, name, defaults[name])
        return given

    def root(self, node: ast.Call, env: Environment) -> Value:
        """Value of `root`."""
        residual, (low, high, *rest) = self.inner(node, env, "root", 1)
        found = solved(self.code, residual, low, high, rest, read)
        if found is None:
            self.refuse(node, "a residual that is a tuple", "return one float")
        return found

    def repeated(self, node: ast.Call, env: Environment) -> Value:
        """Value of `repeated`."""
        step, (count, state, *rest) = self.inner(node, env, "repeated", 2)
        found = repetition(self.code, step, count, state, rest, read)
        if found is None:
            what = f"repeated of {step.name}, which does not return a state"
            self.refuse(node, what, "let it take and return the same named tuple of floats")
        return found

    def inner(
        self, node: ast.Call, env: Environment, word: str, leading: int
    ) -> tuple[Parsed, list[Any]]:
        """The equation that a loop is given by its name, and the loop's other arguments.

        `leading` are the arguments of the equation that the loop itself gives it.
        """
        taken, takes = LOOPS[word]
        if len(node.args) < 3 or node.keywords:
            self.refuse(node, f"{word} with other arguments", f"write {word}({taken}, a, b, ...)")
        first = node.args[0]
        named = isinstance(first, ast.Attribute)
        named |= isinstance(first, ast.Name) and first.id not in self.local
        found = self.callee(first) if named else None
        if not _is_equation(found):
            self.refuse(node, f"{word} of something else", "give it the name of an @equation")
        numbers = [self.scalar(each, env) for each in node.args[1 : 4 - leading]]
        rest = [self.value(each, env) for each in node.args[4 - leading :]]
        inner = parsed(found)
        if len(inner.arguments) != leading + len(node.args) - 3:
            self.refuse(node, f"{word} of {inner.name} with other arguments", takes)
        return inner, [*numbers, *rest]

    def interpolate(self, node: ast.Call, env: Environment) -> Value:
        """Value of `interpolate`."""
        given = self.arguments(node, env, ("x", "knots", "values"), {})
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


def _both(one: Node, two: Node) -> Node:
    return _joined(one, two, True)


def _joined(one: Node, two: Node, conjunction: bool) -> Node:
    """Two tests joined by `and` or `or`; known ones vanish."""
    for known, rest in ((one, two), (two, one)):
        if known.op == "number":
            return rest if bool(known.value) == conjunction else known
    word = "and" if conjunction else "or"
    parts = [part for each in (one, two) for part in (each.args if each.op == word else (each,))]
    return make(word, *parts)


def _cheap(items: Sequence[Item], ends: Sequence[Node]) -> bool:
    """Whether items are so few operations that they can be done whatever a test says."""
    if not all(isinstance(each, Let) and each.node.cheap for each in items):
        return False
    if not all(node.cheap for node in ends):
        return False
    nodes = [*(each.node for each in items if isinstance(each, Let)), *ends]
    return not items or sum(map(ex.size, nodes)) <= FEW


def _meanings(items: Sequence[Item]) -> dict[str, Node]:
    """What the names of cheap items stand for, all told."""
    meanings: dict[str, Node] = {}
    for each in items:
        assert isinstance(each, Let)
        meanings[each.name] = ex.substitute(each.node, meanings)
    return meanings


def _is_equation(found: Any) -> bool:
    """Whether something may be an equation: a function that is compiled, if any is."""
    interpreted = JIT_OFF
    return isinstance(plain(found), FunctionType) and (plain(found) is not found or interpreted)
