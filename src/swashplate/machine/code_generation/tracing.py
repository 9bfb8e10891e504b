"""Equations run on symbols: Python runs them, and what is left is one graph of their operations.

Named tuples come apart, calls are followed, loops are unrolled, options decided if they are known:
all this Python does by itself, see `decisions` for what it cannot. The operations are in the order
of the equations: results keep their last bit.
"""

from __future__ import annotations

import builtins
import math
import operator
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import reduce
from inspect import signature
from types import FunctionType, MethodType, ModuleType
from typing import Any

from swashplate.errors import EquationError
from swashplate.machine import graph
from swashplate.machine.code_generation.decisions import deep, on_symbols
from swashplate.machine.code_generation.loops import (
    FEW_KNOTS,
    called_apart,
    interpolate,
    past,
    repeated,
    repetition,
    root,
    solved,
)
from swashplate.machine.code_generation.runner import Callee
from swashplate.machine.code_generation.symbols import RefusedError, Symbol, Unset, operand
from swashplate.machine.code_generation.values import (
    NotGiven,
    Option,
    Value,
    alike,
    leaves,
    mapped,
    node_of,
    rebuilt,
)
from swashplate.machine.declaration import (
    NO_REPLACEMENTS,
    RULES,
    Replacements,
    closure,
    is_function,
    standing,
)
from swashplate.machine.graph import LEAVES, ONE, ZERO, DerivativeRule, Node, choose, make
from swashplate.machine.language import (
    CHOICES,
    MATH,
    Parsed,
    is_among,
    is_named_tuple,
    parsed,
)

MOST_WAYS = 500
"""Ways through an equation to a return: what follows an `if` with one is done for each."""
OF_PYTHON: dict[Any, None] = dict.fromkeys((enumerate, len, range, reversed, tuple, zip))
"""What of Python's own an equation may call besides: it counts and orders, and computes nothing."""

ARITHMETIC = {
    **{"Add": operator.add, "Sub": operator.sub, "Mult": operator.mul, "Div": operator.truediv},
    **{"FloorDiv": operator.floordiv, "Mod": operator.mod, "Pow": operator.pow},
    **{"MatMult": operator.matmul, "BitAnd": operator.and_, "BitOr": operator.or_},
    **{"BitXor": operator.xor, "LShift": operator.lshift, "RShift": operator.rshift},
}
"""Operations by their names in Python's syntax."""
LOOPS = {
    "root": ("residual, low, high", ("the unknown",), solved),
    "repeated": ("step, count, state", ("a state", "the number of the repetition"), repetition),
}
"""What loops take ahead of the rest, what their equation takes ahead of it, how they are made."""
INSTEAD_OF_BUILTIN = {
    "print": "inspect results outside the equation",
    "sum": "write the terms out: Python's versions add up differently",
    "float": "leave it out, of a test write `1.0 if test else 0.0`",
    "int": "write floor(x), which rounds down",
    "round": "write floor(x + 0.5), which rounds halves up",
    "pow": "write ** with a whole number, or exp(b * log(a))",
}


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
        self._returns: list[int] = []
        """How often each equation under way has come to a decision with a return."""
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
        given = source.defaults | dict(arguments)
        names = [argument.arg for argument in source.arguments]
        values: dict[str, Value] = {name: given[name] for name in names if name in given}
        if source in self.outlined:
            return called_apart(self, callee, [*values.values()])
        with self.running(callee):
            result = self._returned(source, values)
            scalars = tuple(node for value in values.values() for _, node in leaves(value))
            returned = tuple(node for _, node in leaves(result))
            self.calls.setdefault(source, set()).add((scalars, returned))
            rule = RULES.get(source.function)
            if rule is None or _is_changed(callee):
                return result
            return self._ruled(source, parsed(rule), values, result)

    def _returned(self, source: Parsed, values: Mapping[str, Value]) -> Value:
        """What Python makes of an equation."""
        for name, value in values.items():
            self.label(value, name)
        names = [argument.arg for argument in source.arguments]
        symbols = [self._symbols(values[name]) if name in values else Unset(name) for name in names]
        try:
            result = _nodes(on_symbols(source, self)(*symbols), "a result that is")
            if isinstance(result, str):
                raise RefusedError("a result that is text", "return numbers or tuples of them")
            return result
        except EquationError:
            raise
        except RefusedError as refused:
            source.refuse(source.line_of(refused), refused.what, refused.instead)
        except Exception as error:  # whatever the author's text raises: it has a line of theirs
            source.refuse(source.line_of(error), *_said(error))

    def inner(self, source: Parsed) -> Trace:
        """A separate trace for an equation that is run within another, again and again."""
        trace = Trace({*self.outlined} - {source}, self._replacements)
        trace.under_way = [*self.under_way]
        return trace

    @contextmanager
    def running(self, callee: Callee) -> Iterator[None]:
        """While an equation is being run."""
        self.under_way.append(callee)
        self._returns.append(0)
        try:
            with deep():
                yield
        finally:
            self.under_way.pop()
            self._returns.pop()

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

    def _symbols(self, value: Value) -> Any:
        """A value as an equation sees it."""
        return mapped(lambda leaf: Symbol(leaf, self) if isinstance(leaf, Node) else leaf, value)

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
                partials = [node for _, node in leaves(self._returned(rule, arguments))]
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

    # -- decisions, see `decisions` ----------------------------------------------------------------

    def _test(self, value: Any) -> bool | Node:
        """Whether a value counts as true: known, or the node that says so."""
        if isinstance(value, Option | NotGiven):
            return _setting(value)
        if isinstance(value, tuple):
            raise RefusedError("a test of a tuple", "compare its elements")
        if not isinstance(value, Symbol):
            return bool(value)
        node = value.node
        if node.op == "number":
            return bool(node.value)
        if node.kind == "bool":
            return node
        return self.make("!=", node, ZERO if node.kind == "float" else graph.number(0))

    def chosen(self, test: Any, if_true: Callable[[], Any], if_false: Callable[[], Any]) -> Any:
        """`a if test else b`."""
        decision = self._test(test)
        if isinstance(decision, bool):
            return if_true() if decision else if_false()
        return self._one_of(decision, if_true(), if_false())

    def one_return(self, test: Any, if_true: Callable[[], Any], if_false: Callable[[], Any]) -> Any:
        """What an equation returns on one of two ways."""
        if self._returns:
            self._returns[-1] += 1
            if self._returns[-1] > MOST_WAYS:
                what = f"more than {MOST_WAYS} ways to a return"
                raise RefusedError(what, "set a variable on each way, and return it at the end")
        return self.chosen(test, if_true, if_false)

    def either_way(
        self,
        test: Any,
        if_true: Callable[[], tuple[Any, ...]],
        if_false: Callable[[], tuple[Any, ...]],
        names: Sequence[str],
    ) -> tuple[Any, ...]:
        """What names stand for after an `if`."""
        decision = self._test(test)
        if isinstance(decision, bool):
            return if_true() if decision else if_false()
        merged = []
        for name, first, second in zip(names, if_true(), if_false(), strict=True):
            if type(first) is Unset or type(second) is Unset:
                merged.append(Unset(name))  # refused if it is read
                continue
            what = f"{name} of two structures"
            instead = "let both ways set a number, or both the same named tuple or as many elements"
            merged.append(
                first if first is second else self._one_of(decision, first, second, what, instead)
            )
            self.named(**{name: merged[-1]})
        return tuple(merged)

    def _one_of(
        self,
        test: Node,
        if_true: Any,
        if_false: Any,
        what: str = "results of different structure",
        instead: str = "give the same tuple on every path",
    ) -> Any:
        """The value of one of two ways."""
        first, second = _nodes(if_true), _nodes(if_false)
        if not alike(first, second):
            raise RefusedError(what, instead)
        pairs = zip(leaves(first), leaves(second), strict=True)
        choices = (self.noted(choose(test, one, other)) for (_, one), (_, other) in pairs)
        return self._symbols(rebuilt(first, choices))

    def negated(self, value: Any) -> Any:
        """`not` of a test."""
        test = self._test(value)
        if isinstance(test, bool):
            return not test
        return Symbol(self.make("not", test), self)

    def is_none(self, value: Any) -> Any:
        """`value is None`."""
        if isinstance(value, Option | NotGiven):
            return self.negated(Symbol(_setting(value), self))
        return value is None

    def both(self, *operands: tuple[str, Callable[[], Any]]) -> Any:
        """`and`."""
        return self._joined("and", graph.both, operands)

    def either(self, *operands: tuple[str, Callable[[], Any]]) -> Any:
        """`or`."""
        return self._joined("or", graph.either, operands)

    def _joined(
        self,
        word: str,
        join: Callable[[Node, Node], Node],
        operands: Sequence[tuple[str, Callable[[], Any]]],
    ) -> Any:
        """Tests of which each only counts after the ones before it."""
        known = joined = graph.number(word == "and")
        for text, value_of in operands:
            value = value_of()
            number = value.node if isinstance(value, Symbol) else node_of(value)
            if number is not None and number.kind != "bool":
                raise RefusedError(f"{word} of the number {text}", f"compare it, as {text} != 0.0")
            test = self._test(value)
            node = graph.number(test) if isinstance(test, bool) else test
            joined = self.noted(join(joined, node))
            if joined.op == "number" and joined is not known:
                break
        return joined.value if joined.op == "number" else Symbol(joined, self)

    def long_sum(self, value: Any, *steps: tuple[str, Any]) -> Any:
        """Arithmetic from left to right."""
        for operation, term in steps:
            value = ARITHMETIC[operation](value, term)
        return value

    # -- names -------------------------------------------------------------------------------------

    def unset(self, name: str) -> Unset:
        """What a name stands for before it is given a value."""
        return Unset(name)

    def named(self, /, **names: Any) -> None:
        """Remember what an equation calls its values."""
        for name, value in names.items():
            if isinstance(value, list | dict | set):
                kind = type(value).__name__
                raise RefusedError(f"{name}, which is a {kind},", "use a tuple")
            self.label(_nodes(value), name)

    def items(self, values: Any) -> tuple[Any, ...]:
        """What a loop goes through."""
        return tuple(values)

    def member(self, base: Any, name: str, field: str) -> Any:
        """A constant of a module, or a field of a constant."""
        if isinstance(base, ModuleType):
            return self.outside(getattr(base, field), field)
        return getattr(self.outside(base, name), field)

    def outside(self, constant: Any, name: str) -> Any:
        """An equation or a constant from outside, numbers as Python's own."""
        if constant is None or isinstance(constant, str) or is_function(constant):
            return constant
        if isinstance(constant, tuple):
            return mapped(lambda each: self.outside(each, name), constant)
        if isinstance(constant, bool | int | float):
            return float(constant) if isinstance(constant, float) else constant
        instead = "from outside, an equation reads only numbers"
        if type(constant).__module__ == "numpy":
            instead = "make it a float or an int of Python where it is defined"
        raise RefusedError(f"{name}, which is {type(constant).__name__}", instead)

    # -- calls -------------------------------------------------------------------------------------

    def called(self, function: Any, text: str, /, *arguments: Any, **named: Any) -> Any:
        """What a call in an equation returns."""
        if not callable(function):
            what = f"a call of {text}, which is of type {type(function).__name__}"
            raise RefusedError(what, "call an @equation")
        if is_among(function, MATH) or is_among(function, CHOICES):
            op = MATH.get(function) or CHOICES[function]
            return self._function(op, function, arguments, named)
        if is_named_tuple(function) or is_among(function, OF_PYTHON):
            return function(*arguments, **named)
        if isinstance(function, MethodType) and function.__name__ == "_replace":
            return function(*arguments, **named)
        if function is root or function is repeated:
            return self._loop(function.__name__, arguments, named)
        if function is past:
            return self._past(**self._given(past, text, arguments, named))
        if function is interpolate:
            return self._interpolation(**self._given(interpolate, text, arguments, named))
        if not is_function(function):
            _refuse_call(function, text)
        callee = self.callee(function)
        given = self._given(callee.source.function, text, arguments, named)
        values = {name: _nodes(value) for name, value in given.items()}
        return self._symbols(self.run(callee, values))

    def _given(
        self, function: Any, text: str, arguments: Sequence[Any], named: Mapping[str, Any]
    ) -> dict[str, Any]:
        """Values for the arguments of a function by their names, as far as they are given."""
        takes = signature(function)
        try:
            return takes.bind(*arguments, **named).arguments
        except TypeError as error:
            what = f"a call of {text} with {error}"
            raise RefusedError(what, f"it takes {', '.join(takes.parameters)}") from None

    def _function(
        self, op: str, function: Any, arguments: Sequence[Any], named: Mapping[str, Any]
    ) -> Any:
        """Value of a function of numbers."""
        if op in ("min", "max") and len(arguments) == 1 and isinstance(arguments[0], Iterable):
            arguments = tuple(arguments[0])
        least = 2 if op in ("atan2", "hypot", "min", "max") else 1
        exactly = len(arguments) == least or (len(arguments) > least and op in ("min", "max"))
        if not exactly or named:
            raise RefusedError(f"{op} of {len(arguments)} arguments", f"give it {least}")
        nodes = [operand(argument) for argument in arguments]
        if not any(isinstance(argument, Symbol) for argument in arguments):
            return function(*arguments)
        if len(nodes) == 1:
            return Symbol(self.make(op, *nodes), self)
        return Symbol(reduce(lambda first, second: self.make(op, first, second), nodes), self)

    def _loop(self, word: str, arguments: Sequence[Any], named: Mapping[str, Any]) -> Any:
        """Value of `root` or `repeated`: the equation, and the other arguments."""
        takes, own_arguments, make_of = LOOPS[word]
        if len(arguments) < 3 or named:
            raise RefusedError(f"{word} with other arguments", f"write {word}({takes}, a, b, ...)")
        equation, *others = arguments
        if not is_function(equation):
            raise RefusedError(f"{word} of something else", "give it the name of an @equation")
        inner = self.callee(equation)
        if len(inner.source.arguments) != len(own_arguments) + len(others) - 2:
            what = f"{word} of {inner.source.name} with other arguments"
            raise RefusedError(what, f"let it take {', '.join(own_arguments)} and the rest")
        values = [_nodes(value) for value in others]
        return self._symbols(make_of(self, inner, values[0], values[1], values[2:]))

    def _past(self, history: Any, age: Any) -> Any:
        """Value of a call of `past`: ages are those that the history has."""
        fields_of = getattr(history, "_fields", ())
        if fields_of != ("newest", "longest") or isinstance(age, tuple):
            what = "past of something else than an input with its past and a number"
            raise RefusedError(what, "type the input History, and say in its Tap how far it goes")
        newest, longest = map(operand, history)
        inside = self.make("min", self.make("max", operand(age), ZERO), longest)
        return Symbol(self.make("past", newest, inside), self)

    def _interpolation(self, x: Any, knots: Any, values: Any) -> Any:
        """Value of a call of `interpolate`."""
        table = isinstance(knots, tuple) and isinstance(values, tuple)
        if isinstance(x, tuple) or not table or not len(knots) == len(values) > 1:
            raise RefusedError(
                "interpolate with something else than a number and two tuples of one length",
                "type them tuple[float, float, ...] with every element, or give derive their "
                "lengths",
            )
        known = [each for each in knots if isinstance(each, int | float)]
        if len(known) == len(knots) and known != sorted(set(known)):
            raise RefusedError(
                "interpolate with knots that do not ascend", "sort the table by them"
            )
        node = self._interpolated(
            operand(x),
            knots=[node for _, node in leaves(_nodes(knots))],
            values=[node for _, node in leaves(_nodes(values))],
        )
        return Symbol(node, self)

    def _interpolated(self, x: Node, knots: Sequence[Node], values: Sequence[Node]) -> Node:
        """Nodes of `interpolate`: the segment of x is chosen, then a straight line evaluated."""
        if len(knots) > FEW_KNOTS:
            return self._looked_up(x, knots, values)
        make, label = self.make, self.label
        ends = [knots[0], knots[1], values[0], values[1]]
        for segment in range(1, len(knots) - 1):
            beyond = make(">=", x, knots[segment])
            next_ends = knots[segment], knots[segment + 1], values[segment], values[segment + 1]
            ends = [
                choose(beyond, next_end, end) for end, next_end in zip(ends, next_ends, strict=True)
            ]
            for node, name in zip(ends, ("left", "right", "low", "high"), strict=True):
                label(self.noted(node), name)
        return self._between(x, *ends)

    def _looked_up(self, x: Node, knots: Sequence[Node], values: Sequence[Node]) -> Node:
        """The same for a long table: its segment is searched, and looked up."""
        make = self.make
        place = make("segment", x, *knots)
        self.label(place, "segment")
        following = make("+", place, ONE)
        ends = [
            make("element", at, *table) for table in (knots, values) for at in (place, following)
        ]
        return self._between(x, *ends)

    def _between(self, x: Node, left: Node, right: Node, low: Node, high: Node) -> Node:
        """On the straight line between both ends of a segment; beyond them the ends' values."""
        make, label = self.make, self.label
        share = make("/", make("-", x, left), make("-", right, left))
        label(share, "share")
        inside = make("min", make("max", ZERO, share), ONE)
        return make("+", low, make("*", inside, make("-", high, low)))


def _nodes(value: Any, what: str = "a value that is") -> Value:
    """What an equation sees as the engine holds it."""

    def node(leaf: Any) -> Any:
        if isinstance(leaf, Symbol):
            return leaf.node
        if leaf is None or isinstance(leaf, bool | int | float | str | Option | NotGiven):
            return leaf
        raise RefusedError(f"{what} a {type(leaf).__name__}", "use numbers and tuples of them")

    return mapped(node, value)


def _setting(option: Option | NotGiven) -> Node:
    """The node of an option that is decided at run time, refused if it was not given."""
    if isinstance(option, NotGiven):
        what = f"a test of the option {option.path}, whose value is not known"
        raise RefusedError(what, f'say options={{"{option.path}": None}}, or True')
    return option.node


def _said(error: Exception) -> tuple[str, str]:
    """What Python says of an equation, and what to do."""
    if isinstance(error, AttributeError):
        fields = getattr(error.obj, "_fields", ())
        instead = "name a field of the named tuple"
        if fields:
            instead += f": {type(error.obj).__name__} has {', '.join(fields)}"
        return f"the field {error.name}, which is unknown", instead
    if isinstance(error, NameError):
        return f"the unknown name {error.name}", "define or import it"
    if isinstance(error, ValueError) and "unpack" in str(error):
        return "an unpacking of something else", "unpack a tuple of as many values"
    return type(error).__name__, str(error).strip().rstrip(".") or "Python cannot run it"


def _refuse_call(function: Any, text: str) -> None:
    """Refuse to call what is no equation."""
    name = text.rpartition(".")[2]
    if getattr(builtins, name, None) is function:
        instead = INSTEAD_OF_BUILTIN.get(name, "call only equations and functions of math")
        raise RefusedError(f"a call of {text}", instead)
    if hasattr(math, name):
        functions = ", ".join(MATH.values())
        instead = f"an equation may call these functions of math: {functions}"
        raise RefusedError(f"a call of {text}", instead)
    if isinstance(getattr(function, "__self__", None), tuple):
        instead = "call equations; make a new named tuple, as in State(t.a, b)"
        raise RefusedError(f"the method {name}", instead)
    if isinstance(function, FunctionType) and "numpy" not in str(function.__module__):
        raise RefusedError(f"a call of {text}", f"make {text} an @equation")
    raise RefusedError(f"a call of {text}", "call only equations and functions of math")


def _is_changed(callee: Callee) -> bool:
    """Whether an equation reaches one for which another stands, so that no rule of it holds."""
    replaced = {old for old, chain in callee.replacements.items() if chain}
    if not replaced:
        return False
    return any(reached in replaced for reached in closure(callee.source.function).values())


def _options_in(value: Value) -> tuple[Any, ...]:
    """What of a value a rule may decide by besides floats: options, and whole numbers."""
    if isinstance(value, tuple):
        return tuple(map(_options_in, value))
    node = node_of(value)
    return () if node is not None and node.kind == "float" else (value,)


def _part_of(rule: DerivativeRule, index: int) -> DerivativeRule:
    """The rule of one result among several."""
    size = len(rule.arguments)
    return DerivativeRule(rule.arguments, lambda: rule.slopes[index * size : (index + 1) * size])
