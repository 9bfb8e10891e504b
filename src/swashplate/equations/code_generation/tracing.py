"""Equations run on symbols: the statements of a function, done with the nodes of one graph.

Named tuples come apart, calls are followed, loops are unrolled, options decided if they are known.
What is left are operations in the order of the equations: results keep their last bit.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import reduce
from inspect import Parameter, Signature
from types import ModuleType
from typing import Any, TypeVar

from swashplate.equations import graph
from swashplate.equations.code_generation.loops import (
    called_apart,
    interpolate,
    repeated,
    repetition,
    root,
    solved,
)
from swashplate.equations.code_generation.runner import Callee
from swashplate.equations.code_generation.values import (
    Flag,
    Tuple,
    Value,
    alike,
    fixed,
    leaves,
    rebuilt,
)
from swashplate.equations.declaration import (
    NO_REPLACEMENTS,
    RULES,
    Replacements,
    closure,
    is_function,
    standing,
)
from swashplate.equations.graph import (
    FALSE,
    LEAVES,
    ONE,
    TRUE,
    ZERO,
    DerivativeRule,
    Node,
    choose,
    make,
)
from swashplate.equations.language import (
    ARITHMETIC,
    CHOICES,
    COMPARISONS,
    MATH,
    Parsed,
    has_return,
    is_among,
    is_named_tuple,
    parsed,
    plain,
)

Names = dict[str, Value]
DEEPEST = 50_000
"""Frames of Python within an expression: a sum of 3,000 terms takes some 9,000."""
MOST_WAYS = 500
"""Ways through an equation to a return: what follows an `if` with one is done for each."""
LARGEST_WHOLE = 2**63
"""Whole numbers from here on are floats: compiled code has none as large."""
R = TypeVar("R")

LOOPS = {
    "root": ("residual, low, high", ("the unknown",), solved),
    "repeated": ("step, count, state", ("a state", "the number of the repetition"), repetition),
}
"""What loops take ahead of the rest, what their equation takes ahead of it, how they are made."""


def callee_of(equation: Any, replacements: Replacements) -> Callee:
    """What is run if an equation is called."""
    function, within = standing(equation, replacements)
    return Callee(parsed(function), within)


class Trace:
    """Equations that are run on symbols, and what is known of the nodes that this makes.

    Attributes
    ----------
    labels : dict of Node to str
        What equations call a value, the first that does.
    origins : dict of Node to Parsed
        The equation that a value comes from.
    under_way : list of Callee
        Equations that are being run, each called by the one before.
    calls : dict of Parsed to set
        Arguments of each equation that was run, and what it returned for them.

    `outlined` are equations that become functions, which are called: in languages that have no
    derivatives. `replacements` are equations that stand for others, see `declaration.standing`.
    """

    def __init__(
        self, outlined: Collection[Parsed] = (), replacements: Replacements = NO_REPLACEMENTS
    ) -> None:
        self.outlined, self._replacements = outlined, replacements
        self.calls: dict[Parsed, set[tuple[tuple[Node, ...], tuple[Node, ...]]]] = {}
        self.labels: dict[Node, str] = {}
        self.origins: dict[Node, Parsed] = {}
        self.under_way: list[Callee] = []
        self._rules: dict[tuple[Any, ...], DerivativeRule] = {}

    @property
    def replacements(self) -> Replacements:
        """Equations that stand for others in the one that is being run."""
        return self.under_way[-1].replacements if self.under_way else self._replacements

    def callee(self, equation: Any) -> Callee:
        """What is run if an equation is called."""
        return callee_of(equation, self.replacements)

    def call(self, equation: Any, arguments: Mapping[str, Value]) -> Value:
        """What an equation returns; arguments that are left out have their defaults."""
        return self.run(self.callee(equation), arguments)

    def run(self, callee: Callee, arguments: Mapping[str, Value]) -> Value:
        """What an equation returns, and not what might stand for it."""
        source = callee.source
        if callee in self.under_way:
            source.refuse(None, "a recursive call", "write a loop over a literal range")
        values: dict[str, Value] = {}
        for argument in source.arguments:
            name = argument.arg
            default = fixed(source.defaults[name]) if name in source.defaults else None
            if name in arguments:
                values[name] = arguments[name]
            elif default is not None:
                values[name] = default
        if source in self.outlined:
            return called_apart(self, callee, [*values.values()])
        with self.running(callee):
            result = _Tracer(source, self).result(values)
            scalars = tuple(node for value in values.values() for _, node in leaves(value))
            returned = tuple(node for _, node in leaves(result))
            self.calls.setdefault(source, set()).add((scalars, returned))
            rule = RULES.get(source.function)
            if rule is None or _is_changed(callee):
                return result
            return self._ruled(source, parsed(rule), values, result)

    def inner(self, source: Parsed) -> Trace:
        """A separate trace for an equation that is run within another, again and again."""
        trace = Trace({*self.outlined} - {source}, self._replacements)
        trace.under_way = [*self.under_way]
        return trace

    @contextmanager
    def running(self, callee: Callee) -> Iterator[None]:
        """While an equation is being run, whose expressions may be deeper than Python expects."""
        self.under_way.append(callee)
        limit = sys.getrecursionlimit()
        sys.setrecursionlimit(max(limit, DEEPEST))
        try:
            yield
        finally:
            self.under_way.pop()
            sys.setrecursionlimit(limit)

    @contextmanager
    def within(self, chain: Sequence[Callee]) -> Iterator[None]:
        """Back within equations that were under way at some time."""
        outer, self.under_way = self.under_way, [*chain]
        try:
            yield
        finally:
            self.under_way = outer

    def make(self, op: str, *operands: Node, value: Any = None) -> Node:
        """A node that comes from the equation that is being run."""
        return self.noted(make(op, *operands, value=value))

    def noted(self, node: Node) -> Node:
        """A node, with the equation that it comes from."""
        if self.under_way and node.op not in LEAVES:
            self.origins.setdefault(node, self.under_way[-1].source)
        return node

    def label(self, value: Value, stem: str) -> None:
        """Remember what an equation calls a value."""
        for path, node in leaves(value):
            plain_node = graph.plain_value(node)
            if plain_node.op not in LEAVES:
                name = "_".join(filter(None, (stem, path))) or "value"
                self.labels.setdefault(plain_node, name)

    def _ruled(
        self, source: Parsed, rule: Parsed, arguments: Mapping[str, Value], result: Value
    ) -> Value:
        """The result of an equation with declared derivatives."""
        floats = {
            ".".join(filter(None, (name, path))): node
            for name, value in arguments.items()
            for path, node in leaves(value)
            if node.kind == "float"
        }
        results = [*leaves(result)]
        chain = tuple(self.under_way)

        def slopes() -> tuple[Node, ...]:
            # a rule is that of the equation as it is written
            with self.within(chain), self.running(Callee(rule, NO_REPLACEMENTS)):
                partials = [node for _, node in leaves(_Tracer(rule, self).result(arguments))]
            if len(partials) != len(floats) * len(results):
                rule.refuse(
                    None,
                    f"a number of derivatives that is not {len(floats) * len(results)}",
                    f"return those by {', '.join(floats)}, in order",
                )
            return tuple(partials)

        decided = tuple((name, _options_in(value)) for name, value in arguments.items())
        key = (source.function, decided, *floats.values(), *(node for _, node in results))
        rule_of_all = self._rules.setdefault(key, DerivativeRule(tuple(floats.values()), slopes))
        nodes = []
        for index, (path, node) in enumerate(results):
            rule_of_one = self._rules.setdefault((*key, index), _part_of(rule_of_all, index))
            self.label(node, f"{source.name}_{path}" if path else source.name)
            nodes.append(self.make("ruled", node, value=rule_of_one))
        return rebuilt(result, iter(nodes))


def _is_changed(callee: Callee) -> bool:
    """Whether an equation reaches one for which another stands, so that no rule of it holds."""
    replaced = {old for old, chain in callee.replacements.items() if chain}
    if not replaced:
        return False
    return any(plain(reached) in replaced for reached in closure(callee.source.function).values())


def _options_in(value: Value) -> tuple[Any, ...]:
    """What of a value a rule may decide by besides floats: options, and whole numbers."""
    if isinstance(value, Tuple):
        return tuple(map(_options_in, value.items))
    if isinstance(value, Flag):
        return (value.value,)
    return () if value.kind == "float" else (value,)


def _part_of(rule: DerivativeRule, index: int) -> DerivativeRule:
    """The rule of one result among several."""
    size = len(rule.arguments)
    return DerivativeRule(rule.arguments, lambda: rule.slopes[index * size : (index + 1) * size])


class _Tracer:
    """Runs the statements of one equation."""

    def __init__(self, source: Parsed, trace: Trace) -> None:
        self.source, self.trace, self.refuse = source, trace, source.refuse
        self.local = source.local
        self.names: Names = {}
        self.ways = 0
        """How often what follows an `if` that returns was done once more."""

    def result(self, arguments: Mapping[str, Value]) -> Value:
        """What the equation returns for some arguments."""
        self.names = dict(arguments)
        for name, value in arguments.items():
            self.trace.label(value, name)
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
            match statement := pending.pop(0):
                case ast.Return(value=ast.expr() as value):
                    return self.value(value)
                case ast.If():
                    test = self.test(statement.test)
                    if test.op == "number":
                        pending[:0] = statement.body if test.value else statement.orelse
                    elif has_return([statement]):
                        self.ways += 1
                        if self.ways > MOST_WAYS:
                            self.refuse(
                                statement,
                                f"more than {MOST_WAYS} ways to a return",
                                "set a variable on each way, and return it at the end",
                            )
                        if_true, _ = self.in_branch(self.returned, [*statement.body, *pending])
                        if_false, _ = self.in_branch(self.returned, [*statement.orelse, *pending])
                        return self.select(statement, test, if_true, if_false)
                    else:
                        self.merge(test, statement)
                case ast.For(target=target, iter=ast.Call(args=bounds)):
                    for count in reversed(range(*map(ast.literal_eval, bounds))):
                        number = ast.copy_location(ast.Constant(count), statement)
                        set_counter = ast.copy_location(ast.Assign([target], number), statement)
                        pending[:0] = [set_counter, *statement.body]
                case ast.Assign(targets=targets, value=value):
                    assigned = self.value(value)
                    for target in targets:
                        self.bind(target, assigned)
                case ast.AnnAssign(target=target, value=ast.expr() as value):
                    self.bind(target, self.value(value))
                case ast.AugAssign(target=ast.Name(id=name) as target):
                    left = ast.copy_location(ast.Name(name), statement)
                    term = ast.copy_location(
                        ast.BinOp(left, statement.op, statement.value), statement
                    )
                    self.bind(target, self.value(term))
        return None

    def in_branch(self, run: Callable[[Any], R], what: Any) -> tuple[R, Names]:
        """What one way of a decision comes to, and its names; those here stay as they are."""
        outer, self.names = self.names, dict(self.names)
        try:
            return run(what), self.names
        finally:
            self.names = outer

    def merge(self, test: Node, statement: ast.If) -> None:
        """An `if` that does not return: what both of its ways set is merged."""
        _, if_true = self.in_branch(self.block, statement.body)
        _, if_false = self.in_branch(self.block, statement.orelse)
        for name in {**if_true, **if_false}:
            if name not in if_true or name not in if_false:
                self.names.pop(name, None)  # without a value on one way: refused if it is read
                continue
            value_if_true, value_if_false = if_true[name], if_false[name]
            if value_if_true is value_if_false:
                self.names[name] = value_if_true
                continue
            if not alike(value_if_true, value_if_false):
                self.refuse(
                    statement, f"{name} of two structures", "give it the same kind of value"
                )
            self.names[name] = self.select(statement, test, value_if_true, value_if_false)
            self.trace.label(self.names[name], name)

    def select(self, at: ast.AST, test: Node, if_true: Value, if_false: Value) -> Value:
        """The value of one of two ways."""
        if not alike(if_true, if_false):
            self.refuse(at, "results of different structure", "give the same tuple on every path")
        pairs = zip(leaves(if_true), leaves(if_false), strict=True)
        choices = (
            self.trace.noted(choose(test, first, second)) for (_, first), (_, second) in pairs
        )
        return rebuilt(if_true, choices)

    def bind(self, target: ast.expr, value: Value) -> None:
        """Give a name its value, or each of several in a tuple."""
        if isinstance(target, ast.Tuple):
            if not isinstance(value, Tuple) or len(value.items) != len(target.elts):
                self.refuse(
                    target, "an unpacking of something else", "unpack a tuple of as many values"
                )
            for element, element_value in zip(target.elts, value.items, strict=True):
                self.bind(element, element_value)
            return
        assert isinstance(target, ast.Name)
        self.names[target.id] = value
        self.trace.label(value, target.id)

    # -- expressions -------------------------------------------------------------------------------

    def test(self, node: ast.expr) -> Node:
        """A decision; an option that is on counts as true."""
        value = self.value(node)
        if isinstance(value, Flag):
            setting = self.setting_of(node, value)
            return setting if isinstance(setting, Node) else graph.number(setting is not None)
        if isinstance(value, Node):
            if value.op == "number":
                return graph.number(bool(value.value))
            if value.kind == "bool":
                return value
            return self.trace.make("!=", value, ZERO if value.kind == "float" else graph.number(0))
        self.refuse(node, "a test of a tuple", "compare its elements")

    def setting_of(self, node: ast.AST, option: Flag) -> Any:
        """Value of an option, refused if it was not given."""
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
                return graph.number(_whole(number))
            case ast.Tuple(elts=elements):
                return Tuple(None, tuple(map(self.value, elements)))
            case ast.Name(id=name) if name in self.names:
                return self.names[name]
            case ast.Name(id=name):
                if name in self.local:
                    instead = "give it a value on every path"
                    self.refuse(node, f"{name} without a value on some path", instead)
                return self.constant(node, name, self.outside(node))
            case ast.Attribute():
                return self.field(node)
            case ast.Subscript():
                return self.element(node)
            case ast.UnaryOp(op=ast.Not()):
                test = self.test(node.operand)
                return self.negated(test)
            case ast.UnaryOp():
                operand = self.scalar(node.operand)
                if isinstance(node.op, ast.UAdd):
                    return operand
                if operand.op == "number":
                    return graph.number(-operand.value)
                return self.trace.make("neg", operand)
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
                return self.select(node, test, self.value(node.body), self.value(node.orelse))
            case ast.Call():
                return self.call(node)
        self.refuse(node, "this expression", "use arithmetic")

    def outside(self, node: ast.expr) -> Any:
        """What a name, or a name in a module, stands for outside the equation."""
        try:
            return self.source.called(node)
        except (NameError, AttributeError):
            self.refuse(node, f"the unknown name {ast.unparse(node)}", "define or import it")

    def constant(self, node: ast.AST, text: str, constant: Any) -> Value:
        """Value of something that stands outside the equation."""
        value = fixed(constant)
        if value is None:
            what = f"{text}, which is {type(constant).__name__}"
            instead = "from outside, an equation reads only numbers"
            if any(map(_is_of_numpy, constant if isinstance(constant, tuple) else [constant])):
                instead = "make it a float or an int of Python where it is defined"
            self.refuse(node, what, instead)
        return value

    def field(self, node: ast.Attribute) -> Value:
        """Value of a field, or of a constant of a module."""
        base = node.value
        module = isinstance(base, ast.Name) and base.id not in {*self.local, *self.names}
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
            self.refuse(node.slice, "an index that is not a whole number", "write the number")
        if not isinstance(value, Tuple) or not -len(value.items) <= index.value < len(value.items):
            self.refuse(node, f"the element {index.value}, which does not exist", "count from 0")
        element: Value = value.items[index.value]
        return element

    def negated(self, test: Node) -> Node:
        """`not` of a test."""
        if test.op == "number":
            return graph.number(not test.value)
        return self.trace.make("not", test)

    def arithmetic(self, node: ast.BinOp) -> Node:
        """Value of an arithmetic operation, exactly as written."""
        op, left = ARITHMETIC[type(node.op)], self.scalar(node.left)
        if op == "**":
            return self.trace.make("**", left, value=ast.literal_eval(node.right))
        right = self.scalar(node.right)
        if left.kind == right.kind == "int" and left.op == right.op == "number" and op != "/":
            integer_operation = {"+": int.__add__, "-": int.__sub__, "*": int.__mul__}[op]
            return graph.number(_whole(integer_operation(left.value, right.value)))
        if op == "*" and left.kind == right.kind == "float":  # a factor that is known to be one
            for factor, other in ((left, right), (right, left)):
                if graph.is_number(factor, 1.0):
                    return other
        return self.trace.make(op, left, right)

    def comparison(self, node: ast.Compare) -> Node:
        """A comparison, also of several terms, and `is None`."""
        left = self.value(node.left)
        test = TRUE
        for op, right_node in zip(node.ops, node.comparators, strict=True):
            if isinstance(op, ast.Is | ast.IsNot):
                test = graph.both(test, self.missing(node, left, isinstance(op, ast.Is)))
                continue
            right = self.scalar(right_node)
            if not isinstance(left, Node):
                self.refuse(node, "a comparison of a tuple", "compare its elements")
            test = graph.both(test, self.trace.make(COMPARISONS[type(op)], left, right))
            left = right
        return test

    def missing(self, node: ast.AST, value: Value, off: bool) -> Node:
        """Whether a value `is None` (`off`), or is not."""
        setting = self.setting_of(node, value) if isinstance(value, Flag) else True
        if isinstance(setting, Node):
            return self.negated(setting) if off else setting
        return graph.number((setting is None) == off)

    def joined(self, node: ast.BoolOp) -> Node:
        """`and` and `or`, which are choices: the second test only counts after the first."""
        conjunction = isinstance(node.op, ast.And)
        test = TRUE if conjunction else FALSE
        for operand in node.values:
            if test.op == "number" and bool(test.value) != conjunction:
                return test
            join = graph.both if conjunction else graph.either
            value = self.value(operand)
            if isinstance(value, Node) and value.kind != "bool":
                word, text = ("and" if conjunction else "or"), ast.unparse(operand)
                self.refuse(node, f"{word} of the number {text}", f"compare it, as {text} != 0.0")
            test = self.trace.noted(join(test, self.test(operand)))
        return test

    # -- calls -------------------------------------------------------------------------------------

    def call(self, node: ast.Call) -> Value:
        """Value of a call."""
        called = self.outside(node.func)
        if is_among(called, MATH) or is_among(called, CHOICES):
            return self.function(node, MATH.get(called) or CHOICES[called])
        if is_named_tuple(called):
            return Tuple(called, tuple(self.arguments(node, called._fields, ()).values()))
        kind = plain(called)
        if kind is plain(root) or kind is plain(repeated):
            return self.loop(node, kind.__name__)
        if kind is plain(interpolate):
            return self.interpolation(self.arguments(node, ("x", "knots", "values"), ()), node)
        if not _is_equation(called):
            text = ast.unparse(node.func)
            if not callable(called):
                what = f"a call of {text}, which is of type {type(called).__name__}"
                self.refuse(node, what, "call an @equation")
            self.refuse(node, f"a call of {text}", f"make {text} an @equation")
        callee = self.trace.callee(called)
        names = [argument.arg for argument in callee.source.arguments]
        return self.trace.run(callee, self.arguments(node, names, callee.source.defaults))

    def function(self, node: ast.Call, op: str) -> Node:
        """Value of a function of numbers."""
        operands = [self.scalar(argument) for argument in node.args]
        least = 2 if op in ("atan2", "hypot", "min", "max") else 1
        exactly = len(operands) == least or (len(operands) > least and op in ("min", "max"))
        if not exactly or node.keywords:
            self.refuse(node, f"{op} of {len(operands)} arguments", f"give it {least}")
        if len(operands) == 1:
            return self.trace.make(op, operands[0])
        return reduce(lambda first, second: self.trace.make(op, first, second), operands)

    def arguments(self, node: ast.Call, names: Sequence[str], optional: Any) -> Names:
        """Values for arguments of these names, in their order as far as they are given."""
        positional = [self.value(each) for each in node.args]
        by_name = {str(each.arg): self.value(each.value) for each in node.keywords}
        defaults = {name: None if name in optional else Parameter.empty for name in names}
        parameters = [
            Parameter(name, Parameter.POSITIONAL_OR_KEYWORD, default=defaults[name])
            for name in names
        ]
        try:
            return Signature(parameters).bind(*positional, **by_name).arguments
        except TypeError as error:
            what = f"a call of {ast.unparse(node.func)} with {error}"
            self.refuse(node, what, f"it takes {', '.join(names)}")

    def loop(self, node: ast.Call, word: str) -> Value:
        """Value of `root` or `repeated`: the equation by its name, and the other arguments."""
        takes, own_arguments, make_of = LOOPS[word]
        if len(node.args) < 3 or node.keywords:
            self.refuse(node, f"{word} with other arguments", f"write {word}({takes}, a, b, ...)")
        first = node.args[0]
        named = isinstance(first, ast.Name | ast.Attribute) and ast.unparse(first) not in self.local
        equation = self.outside(first) if named else None
        if not _is_equation(equation):
            self.refuse(node, f"{word} of something else", "give it the name of an @equation")
        inner = self.trace.callee(equation)
        values = [self.value(argument) for argument in node.args[1:]]
        if len(inner.source.arguments) != len(own_arguments) + len(values) - 2:
            what = f"{word} of {inner.source.name} with other arguments"
            self.refuse(node, what, f"let it take {', '.join(own_arguments)} and the rest")
        return make_of(self.trace, inner, values[0], values[1], values[2:])

    def interpolation(self, arguments: Mapping[str, Value], node: ast.Call) -> Value:
        """Value of a call of `interpolate`, whose arguments are checked."""
        x, knots, values = arguments.values()
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
        return self.interpolated(
            x,
            knots=[leaf for _, leaf in leaves(knots)],
            values=[leaf for _, leaf in leaves(values)],
        )

    def interpolated(self, x: Node, knots: Sequence[Node], values: Sequence[Node]) -> Node:
        """Nodes of `interpolate`: the segment of x is chosen, then a straight line evaluated."""
        make, label = self.trace.make, self.trace.label
        ends = [knots[0], knots[1], values[0], values[1]]
        for segment in range(1, len(knots) - 1):
            beyond = make(">=", x, knots[segment])
            next_ends = knots[segment], knots[segment + 1], values[segment], values[segment + 1]
            ends = [
                choose(beyond, next_end, end) for end, next_end in zip(ends, next_ends, strict=True)
            ]
            for node, name in zip(ends, ("left", "right", "low", "high"), strict=True):
                label(self.trace.noted(node), name)
        left, right, low, high = ends
        share = make("/", make("-", x, left), make("-", right, left))
        label(share, "share")
        inside = make("min", make("max", ZERO, share), ONE)
        return make("+", low, make("*", inside, make("-", high, low)))


def _is_of_numpy(constant: Any) -> bool:
    """Whether a constant has a type of NumPy's."""
    return type(constant).__module__ == "numpy"


def _whole(number: float) -> float:
    """A literal number, a float if it is too large for a whole number of compiled code."""
    return number if abs(number) < LARGEST_WHOLE else float(number)


def _is_equation(function: Any) -> bool:
    """Whether something may be an equation."""
    return is_function(function)
