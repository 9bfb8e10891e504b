"""Reading expressions of an equation: arithmetic, choices and calls become scalars and items."""

import ast
from collections.abc import Callable
from dataclasses import dataclass, field
from types import FunctionType, ModuleType
from typing import Any

from numba import config

from swashplate.equations import expressions as ex
from swashplate.equations.expressions import Node, make
from swashplate.equations.program import (
    Choice,
    Flag,
    Fork,
    Invoke,
    Item,
    Let,
    Open,
    Primitive,
    Program,
    Shape,
    Tuple,
    Value,
    argument,
    leaves,
    paths,
    rebuilt,
    shape,
)
from swashplate.equations.syntax import (
    ARITHMETIC,
    CHOICES,
    COMPARISONS,
    MATH,
    Parsed,
    is_named_tuple,
    parsed,
    plain,
    whole,
)

ROOT: list[Any] = []
INTERPOLATE: list[Any] = []
REPEATED: list[Any] = []
"""The primitives, entered by the module that defines them."""

Environment = dict[str, Value]


@dataclass
class Terms:
    """Reads expressions; `lower` reads the equations that they call."""

    source: Parsed
    shapes: tuple[Shape, ...]
    lower: Callable[[Any, tuple[Shape, ...]], Program]
    taken: set[str] = field(default_factory=set)
    own: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.local = set(self.source.function.__code__.co_varnames)

    def fresh(self, stem: str) -> str:
        """A name that is not yet taken."""
        name, count = stem, 1
        while name in self.taken or name in ("None", "True", "False"):
            count += 1
            name = f"{stem}_{count}"
        self.taken.add(name)
        self.own.add(name)
        return name

    def named(self, value: Value, stem: str, items: list[Item]) -> Value:
        """The value with a name for each of its scalars that is more than a name or number."""
        if isinstance(value, Node):
            if value.op in ex.LEAVES or stem == "_":
                return value
            name = self.fresh(stem)
            items.append(Let(name, value))
            return ex.name(name, value.kind)
        if isinstance(value, Tuple) and value.text is None:
            parts = zip(value.fields, value.items, strict=True)
            return Tuple(value.cls, tuple(self.named(v, f"{stem}_{n}", items) for n, v in parts))
        return value

    def merged(
        self,
        choice: Choice,
        one: Value,
        two: Value,
        stem: str,
        at: ast.AST,
        meanings: tuple[dict[str, Node], dict[str, Node]] | None,
        items: list[Item],
    ) -> Value:
        """One value for two: a conditional expression where the ways are cheap."""
        if isinstance(one, Node) and isinstance(two, Node):
            if one is two:
                return one
            if meanings is not None and one.cheap and two.cheap:
                first, second = (
                    ex.substitute(n, m) for n, m in zip((one, two), meanings, strict=True)
                )
                return self.named(ex.choose(choice.test, first, second), stem, items)
            name = self.fresh(stem)
            choice.merged.append((name, one, two))
            return ex.name(name, make("if", choice.test, one, two).kind)
        if isinstance(one, Tuple) and isinstance(two, Tuple) and one.fields == two.fields:
            parts = zip(one.fields, one.items, two.items, strict=True)
            return Tuple(
                one.cls,
                tuple(
                    self.merged(choice, a, b, f"{stem}_{n}", at, meanings, items)
                    for n, a, b in parts
                ),
            )
        if shape(one) == shape(two) and isinstance(one, Flag):
            return one
        self.source.refuse(at, f"{stem} of two structures", "give it the same kind of value")

    # -- expressions -------------------------------------------------------------------------------

    def test(self, node: ast.expr, env: Environment, items: list[Item]) -> Node:
        """A decision; an option that is on counts as true."""
        value = self.value(node, env, items, "test")
        if isinstance(value, Flag):
            if value.value == "unknown":
                self.unknown(node, value)
            return ex.number(value.value is not None)
        if isinstance(value, Node):
            return ex.number(bool(value.value)) if value.op == "number" else value
        self.source.refuse(node, "a test of a tuple", "compare its elements")

    def unknown(self, node: ast.AST, option: Flag) -> None:
        """Refuse a test of an option whose value was not said."""
        self.source.refuse(
            node,
            f"a test of the option {option.text}, whose value is not known",
            f'say options={{"{option.text}": None}}, or True',
        )

    def scalar(self, node: ast.expr, env: Environment, items: list[Item], hint: str) -> Node:
        """Value of an expression that has to be a number."""
        value = self.value(node, env, items, hint)
        if isinstance(value, Node):
            return value
        if isinstance(value, Flag):
            self.source.refuse(node, "arithmetic with an option", "test it with `is None`")
        self.source.refuse(node, "arithmetic with a tuple", "name its elements")

    def value(self, node: ast.expr, env: Environment, items: list[Item], hint: Any = None) -> Value:
        """Value of any expression; `hint` names what comes of calls in it."""
        stem = hint if isinstance(hint, str) else "value"
        if isinstance(node, ast.Constant):
            return Flag(None) if node.value is None else ex.number(node.value)  # type: ignore[arg-type]
        if isinstance(node, ast.Name):
            return self.variable(node, env)
        if isinstance(node, ast.Attribute):
            return self.attribute(node, env, items, stem)
        if isinstance(node, ast.Subscript):
            return self.element(node, env, items, stem)
        if isinstance(node, ast.Tuple):
            hints = (
                hint if isinstance(hint, list) else [f"{stem}_{i}" for i in range(len(node.elts))]
            )
            pairs = zip(node.elts, hints, strict=False)
            return Tuple(None, tuple(self.value(e, env, items, h) for e, h in pairs))
        if isinstance(node, ast.BinOp):
            return self.binary(node, env, items, stem)
        if isinstance(node, ast.UnaryOp):
            if isinstance(node.op, ast.Not):
                test = self.test(node.operand, env, items)
                return ex.number(not test.value) if test.op == "number" else make("not", test)
            inner = self.scalar(node.operand, env, items, stem)
            if isinstance(node.op, ast.UAdd):
                return inner
            return ex.number(-inner.value) if inner.op == "number" else make("neg", inner)
        if isinstance(node, ast.Compare):
            return self.comparison(node, env, items)
        if isinstance(node, ast.BoolOp):
            return self.logic(node, env, items)
        if isinstance(node, ast.IfExp):
            return self.conditional(node, env, items, stem)
        assert isinstance(node, ast.Call)
        return self.call(node, env, items, hint)

    def variable(self, node: ast.Name, env: Environment) -> Value:
        """Value of a name."""
        if node.id in env:
            return env[node.id]
        if node.id in self.local:
            self.source.refuse(
                node, f"{node.id} without a value on some way", "give it a value on every way"
            )
        try:
            found = self.source.resolve(node.id)
        except NameError:
            self.source.refuse(node, f"the unknown name {node.id}", "define or import it")
        return self.constant(node, node.id, found)

    def constant(self, node: ast.AST, text: str, found: Any) -> Value:
        """Value of something that stands outside the equation."""
        if found is None:
            return Flag(None)
        if isinstance(found, bool):
            return ex.number(found)
        if isinstance(found, int | float):
            return ex.constant(text, found)
        if isinstance(found, tuple) and all(isinstance(each, int | float) for each in found):
            cls = type(found) if is_named_tuple(type(found)) else None
            return Tuple(cls, tuple(ex.number(float(each)) for each in found))
        self.source.refuse(
            node,
            f"{text}, which is {type(found).__name__}",
            "of what stands outside, an equation reads numbers only",
        )

    def attribute(
        self, node: ast.Attribute, env: Environment, items: list[Item], stem: str
    ) -> Value:
        """Value of a field, or of a constant of a module."""
        base = node.value
        if isinstance(base, ast.Name) and base.id not in env and base.id not in self.local:
            try:
                module = self.source.resolve(base.id)
            except NameError:
                self.source.refuse(node, f"the unknown name {base.id}", "define or import it")
            if isinstance(module, ModuleType):
                found = getattr(module, node.attr, module)
                return self.constant(node, node.attr, found)
        value = self.value(base, env, items, stem)
        if not isinstance(value, Tuple) or value.cls is None or node.attr not in value.fields:
            self.source.refuse(
                node, f"the field {node.attr}, which is unknown", "name a field of the named tuple"
            )
        return value.items[value.fields.index(node.attr)]

    def element(self, node: ast.Subscript, env: Environment, items: list[Item], stem: str) -> Value:
        """Value of an element of a tuple."""
        index = self.index(node.slice, env)
        value = self.value(node.value, env, items, stem)
        if isinstance(value, Open) and index >= 0:
            return ex.name(f"{value.text}[{index}]")
        if not isinstance(value, Tuple) or not -len(value.items) <= index < len(value.items):
            self.source.refuse(node, f"the element {index}, which is not there", "count from 0")
        return value.items[index]

    def index(self, node: ast.expr, env: Environment) -> int:
        """A literal index, or one made of the counters of loops."""
        value = self.scalar(node, env, [], "i")
        if value.op != "number" or type(value.value) is not int:
            self.source.refuse(node, "an index that is no whole number", "write the number")
        return value.value

    def binary(self, node: ast.BinOp, env: Environment, items: list[Item], stem: str) -> Node:
        """Value of an arithmetic operation, exactly as written."""
        op = ARITHMETIC[type(node.op)]
        left = self.scalar(node.left, env, items, stem)
        if op == "**":
            return make("**", left, value=whole(node.right))
        right = self.scalar(node.right, env, items, stem)
        if left.kind == right.kind == "int" and left.op == right.op == "number" and op != "/":
            return ex.number(
                {"+": int.__add__, "-": int.__sub__, "*": int.__mul__}[op](left.value, right.value)
            )
        one = op == "*" and (ex.is_number(left, 1.0) or ex.is_number(right, 1.0))
        if one and left.kind == right.kind == "float":  # a factor that is known to be one
            return right if ex.is_number(left, 1.0) else left
        return make(op, left, right)

    def comparison(self, node: ast.Compare, env: Environment, items: list[Item]) -> Node:
        """A comparison, also of several terms, and `is None`."""
        left = self.value(node.left, env, items, "side")
        tests = []
        for op, right_node in zip(node.ops, node.comparators, strict=True):
            if isinstance(op, ast.Is | ast.IsNot):
                if isinstance(left, Flag) and left.value == "unknown":
                    self.unknown(node, left)
                missing = isinstance(left, Flag) and left.value is None
                tests.append(ex.number(missing == isinstance(op, ast.Is)))
                continue
            right = self.scalar(right_node, env, items, "side")
            if not isinstance(left, Node):
                self.source.refuse(node, "a comparison of a tuple", "compare its elements")
            tests.append(make(COMPARISONS[type(op)], left, right))
            left = right
        return self.all_of(tests)

    @staticmethod
    def all_of(tests: list[Node]) -> Node:
        """Tests joined by `and`; known ones vanish."""
        if any(t.op == "number" and not t.value for t in tests):
            return ex.number(False)
        tests = [t for t in tests if t.op != "number"]
        if not tests:
            return ex.number(True)
        return tests[0] if len(tests) == 1 else make("and", *tests)

    def logic(self, node: ast.BoolOp, env: Environment, items: list[Item]) -> Node:
        """`and` and `or`; what must not be done in vain is put behind the test."""
        conjunction = isinstance(node.op, ast.And)
        tests: list[Node] = []
        for at, each in enumerate(node.values):
            extra: list[Item] = []
            test = self.test(each, env, extra)
            if tests and (extra or not test.cheap):  # may not be done unless it is asked for
                rest = ast.copy_location(
                    ast.BoolOp(node.op, node.values[at:]) if at + 1 < len(node.values) else each,
                    each,
                )
                said = ast.copy_location(ast.Constant(not conjunction), each)
                so_far = self.combined(tests, conjunction)
                one, two = (rest, said) if conjunction else (said, rest)
                value = self.between(so_far, one, two, env, items, "test", node)
                assert isinstance(value, Node)
                return value
            items.extend(extra)
            if test.op == "number":
                if bool(test.value) != conjunction:
                    return self.combined([*tests, test], conjunction)
                continue
            tests.append(test)
        return self.combined(tests, conjunction)

    def combined(self, tests: list[Node], conjunction: bool) -> Node:
        """Tests joined by `and` or `or`; known ones vanish."""
        if conjunction:
            return self.all_of(tests)
        if any(t.op == "number" and t.value for t in tests):
            return ex.number(True)
        tests = [t for t in tests if t.op != "number"]
        if not tests:
            return ex.number(False)
        return tests[0] if len(tests) == 1 else make("or", *tests)

    def conditional(self, node: ast.IfExp, env: Environment, items: list[Item], stem: str) -> Value:
        """Value of a conditional expression."""
        test = self.test(node.test, env, items)
        if test.op == "number":
            return self.value(node.body if test.value else node.orelse, env, items, stem)
        return self.between(test, node.body, node.orelse, env, items, stem, node)

    def between(
        self,
        test: Node,
        one: ast.expr,
        two: ast.expr,
        env: Environment,
        items: list[Item],
        stem: str,
        at: ast.AST,
    ) -> Value:
        """The value of one of two expressions."""
        then: list[Item] = []
        other: list[Item] = []
        first = self.value(one, env, then, stem)
        second = self.value(two, env, other, stem)
        choice = Choice(test, then, other, [])
        meanings: Any = None if then or other else ({}, {})
        if meanings is None or not isinstance(first, Node) or not isinstance(second, Node):
            pass
        elif first.cheap and second.cheap:  # part of what is being read: it needs no name
            return ex.choose(test, first, second)
        value = self.merged(choice, first, second, stem, at, meanings, items)
        if choice.merged:
            items.append(choice)
        return value

    # -- calls -------------------------------------------------------------------------------------

    def callee(self, node: ast.Call, env: Environment) -> Any:
        """What a call calls; nothing for a method."""
        function = node.func
        try:
            if isinstance(function, ast.Name):
                return self.source.resolve(function.id)
            assert isinstance(function, ast.Attribute)
            if isinstance(function.value, ast.Name) and function.value.id not in env:
                module = self.source.resolve(function.value.id)
                return getattr(module, function.attr)
        except (NameError, AttributeError):
            called = ast.unparse(function)
            self.source.refuse(node, f"a call of the unknown {called}", "define or import it")
        return None

    def call(self, node: ast.Call, env: Environment, items: list[Item], hint: Any) -> Value:
        """Value of a call."""
        stem = hint if isinstance(hint, str) else "value"
        found = self.callee(node, env)
        if found is None:
            return self.replaced(node, env, items, stem)
        if found in MATH or found in CHOICES:
            args = [self.scalar(a, env, items, stem) for a in node.args]
            op = MATH.get(found) or CHOICES[found]
            wanted = {"atan2": (2, 2), "hypot": (2, 2), "min": (2, 99), "max": (2, 99)}
            low, high = wanted.get(op, (1, 1))
            if not low <= len(args) <= high or node.keywords:
                self.source.refuse(node, f"{op} of {len(args)} arguments", f"give it {low}")
            return make(op, *args)
        if is_named_tuple(found):
            defaults = found._field_defaults
            given = self.arguments(node, env, items, list(found._fields), defaults, stem)
            return Tuple(found, given)
        if found in ROOT or plain(found) in ROOT:
            return self.root(node, env, items, hint)
        if found in INTERPOLATE or plain(found) in INTERPOLATE:
            return self.interpolation(node, env, items, hint)
        if found in REPEATED or plain(found) in REPEATED:
            return self.repetition(node, env, items, hint)
        f = plain(found)
        if not isinstance(f, FunctionType) or (f is found and not _interpreted()):
            text = ast.unparse(node.func)
            self.source.refuse(node, f"a call of {text}", f"make {text} an @equation")
        callee = parsed(found)
        names = [a.arg for a in callee.arguments]
        given = self.arguments(node, env, items, names, callee.defaults, stem)
        program = self.lower(f, tuple(shape(each) for each in given))
        return self.invoke(program, given, items, hint)

    def invoke(
        self, callee: Program | Primitive, given: tuple[Value, ...], items: list[Item], hint: Any
    ) -> Value:
        """Names for the scalars of a result; those that are numbers need none."""
        structure = callee.result
        called = callee.kind if isinstance(callee, Primitive) else callee.source.name
        stem = hint if isinstance(hint, str) else called
        names: list[Node] = []
        for path, leaf in leaves(structure):
            first, *rest = path.split(".")
            own = first, *rest
            start = stem
            if isinstance(hint, list) and first.isdigit() and int(first) < len(hint):
                start, own = hint[int(first)], tuple(rest)
            parts = [start if start != "_" else "unused", *filter(None, own)]
            names.append(ex.name(self.fresh("_".join(parts)), leaf.kind))
        result = rebuilt(structure, iter(names))
        items.append(Invoke(callee, given, result))
        if isinstance(callee, Program) and not isinstance(callee.body.end, Fork):
            known = [n for _, n in leaves(callee.body.end)]
            fixed = [k if k.op == "number" else n for k, n in zip(known, names, strict=True)]
            return rebuilt(structure, iter(fixed))
        return result

    def arguments(
        self,
        node: ast.Call,
        env: Environment,
        items: list[Item],
        names: list[str],
        defaults: dict[str, Any],
        stem: str,
    ) -> tuple[Value, ...]:
        """Values for arguments of these names, in order."""
        given: dict[str, Value] = {}
        if len(node.args) > len(names):
            self.source.refuse(node, "a call with too many arguments", f"give {len(names)}")
        for name, each in zip(names, node.args, strict=False):
            given[name] = self.value(each, env, items, name)
        for keyword in node.keywords:
            if keyword.arg not in names or keyword.arg in given:
                self.source.refuse(node, f"the argument {keyword.arg}", f"of {', '.join(names)}")
            given[keyword.arg] = self.value(keyword.value, env, items, keyword.arg)
        for name in names:
            if name not in given:
                if name not in defaults:
                    self.source.refuse(node, f"a call without {name}", "give a value for it")
                value = self.constant(node, name, defaults[name])
                if isinstance(value, Node) and value.op == "constant":
                    value = ex.number(value.value[1])
                given[name] = value
        return tuple(given[name] for name in names)

    def replaced(self, node: ast.Call, env: Environment, items: list[Item], stem: str) -> Value:
        """`t._replace(field=value)`."""
        assert isinstance(node.func, ast.Attribute)
        value = self.value(node.func.value, env, items, stem)
        if not isinstance(value, Tuple) or value.cls is None or node.args:
            self.source.refuse(
                node, f"the method {node.func.attr}", "use _replace of a named tuple"
            )
        new = dict(zip(value.fields, value.items, strict=True))
        for keyword in node.keywords:
            if keyword.arg not in new:
                self.source.refuse(
                    node, f"the field {keyword.arg}, which is unknown", "name a field"
                )
            new[keyword.arg] = self.value(keyword.value, env, items, keyword.arg)
        return Tuple(value.cls, tuple(new.values()))

    def given_equation(self, node: ast.Call, what: str) -> FunctionType:
        """The equation that a primitive is given by its name."""
        first = node.args[0]
        call = ast.copy_location(ast.Call(first, [], []), first)
        named = isinstance(first, ast.Attribute)
        named |= isinstance(first, ast.Name) and first.id not in self.local
        found = self.callee(call, env={}) if named else None
        f = plain(found)
        if not isinstance(f, FunctionType) or (f is found and not _interpreted()):
            self.source.refuse(
                node, f"{what} of something else", "give it the name of an @equation"
            )
        parsed(found)
        return f

    def root(self, node: ast.Call, env: Environment, items: list[Item], hint: Any) -> Value:
        """Value of `root`."""
        if len(node.args) < 3 or node.keywords:
            self.source.refuse(
                node, "root with other arguments", "write root(residual, low, high, a, b, ...)"
            )
        f = self.given_equation(node, "root")
        given = tuple(self.value(a, env, items, "value") for a in node.args[1:])
        if len(parsed(f).arguments) != len(given) - 1:
            self.source.refuse(
                node, f"root of {f.__name__} with other arguments", "give it low, high and the rest"
            )
        program = self.lower(f, ("float", *(shape(each) for each in given[2:])))
        if not isinstance(program.result, Node):
            self.source.refuse(node, "a residual that is a tuple", "return one float")
        names = [a.arg for a in parsed(f).arguments]
        low, high = (n if n not in names else n + "_" for n in ("low", "high"))
        formal = tuple(
            (n, argument(shape(v), n)) for n, v in zip([low, high, *names[1:]], given, strict=True)
        )
        moves = {*program.moving[0]} - {names[0]} | {low, high}
        ordered = [p for n, v in formal for p in paths(n, v) if p in moves]
        return self.invoke(
            Primitive("root", ROOT[0], program, formal, (tuple(ordered),)), given, items, hint
        )

    def repetition(self, node: ast.Call, env: Environment, items: list[Item], hint: Any) -> Value:
        """Value of `repeated`."""
        if len(node.args) < 3 or node.keywords:
            self.source.refuse(
                node,
                "repeated with other arguments",
                "write repeated(step, count, state, a, b, ...)",
            )
        f = self.given_equation(node, "repeated")
        count, state, *rest = (self.value(a, env, items, "value") for a in node.args[1:])
        names = [a.arg for a in parsed(f).arguments]
        if len(names) != len(rest) + 2:
            self.source.refuse(
                node,
                f"repeated of {f.__name__} with other arguments",
                "let it take a state, the number of the repetition and the rest",
            )
        flat = (
            isinstance(state, Tuple)
            and state.cls is not None
            and all(isinstance(each, Node) for each in state.items)
        )
        program = self.lower(f, (shape(state), "float", *(shape(each) for each in rest)))
        if not flat or shape(program.result) != shape(state):
            self.source.refuse(
                node,
                f"repeated of {f.__name__}, which does not return a state",
                "let it take and return the same named tuple of floats",
            )
        number = "count" if "count" not in names else "count_"
        formal = tuple(
            (n, argument(shape(v), n))
            for n, v in zip([number, names[0], *names[2:]], [count, state, *rest], strict=True)
        )
        moving = repeated_moving(program)
        return self.invoke(
            Primitive("repeated", REPEATED[0], program, formal, moving, program.result),
            (count, state, *rest),
            items,
            hint,
        )

    def interpolation(
        self, node: ast.Call, env: Environment, items: list[Item], hint: Any
    ) -> Value:
        """Value of `interpolate`."""
        names = ["x", "knots", "values"]
        given = self.arguments(node, env, items, names, {}, "value")
        x, knots, values = given
        if not (
            isinstance(x, Node)
            and isinstance(knots, Tuple)
            and isinstance(values, Tuple)
            and len(knots.items) == len(values.items) > 1
        ):
            self.source.refuse(
                node,
                "interpolate with something else than a number and two tuples of one length",
                "type them tuple[float, float, ...] with every element, or give derive their "
                "lengths",
            )
        formal = tuple((n, argument(shape(v), n)) for n, v in zip(names, given, strict=True))
        moving = tuple(p for n, v in formal for p in paths(n, v))
        return self.invoke(
            Primitive("interpolate", INTERPOLATE[0], None, formal, (moving,)), given, items, hint
        )


def repeated_moving(step: Program) -> tuple[tuple[str, ...], ...]:
    """Of each number of a state what it may follow once a step has been repeated, in order."""
    state, number = (name for name, _ in step.arguments[:2])
    own = paths(state, step.arguments[0][1])
    reach = [
        {own.index(p) for p in moving if p in own} | {i} for i, moving in enumerate(step.moving)
    ]
    for _ in own:
        reach = [set[int]().union(each, *(reach[k] for k in each)) for each in reach]
    order = [p for n, v in step.arguments if n != number for p in paths(n, v)]
    found = []
    for each in reach:
        followed = {own[k] for k in each}.union(*(step.moving[k] for k in each))
        found.append(tuple(p for p in order if p in followed))
    return tuple(found)


def _interpreted() -> bool:
    return bool(config.DISABLE_JIT)  # type: ignore[attr-defined]
