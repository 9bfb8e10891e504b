"""The decisions of an equation as calls, so that Python runs all else of it on symbols.

Where Python asks a value whether it is true, a symbol cannot say. There the trace is asked:

    if test: a           def if_true(x=x): a; return x
    else: b              def if_false(x=x): b; return x
                         x = trace.either_way(test, if_true, if_false)

so that both ways are run, each on names of its own, and what they set is merged. If a way returns,
or leaves a loop, all that comes after the `if` is a function as well, which the other way calls.
Likewise `a if test else b`, `and`, `or`, `not`, `is None`, chains of comparisons. Calls and names
from outside are passed to the trace, too, and it is told what values are called.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterable, Sequence
from contextlib import contextmanager
from itertools import count
from types import CellType, CodeType, FunctionType
from typing import Any, NamedTuple, TypeVar
from weakref import WeakKeyDictionary

from swashplate.machine.language import Parsed

N = TypeVar("N", bound=ast.AST)

TRACE, EQUATION, AROUND = "<trace>", "<equation>", "<around>"
"""Names of the trace, of an equation and of what is around it: none that Python's syntax allows."""
DEEPEST = 50_000
"""Frames of Python within an expression: a sum of 3,000 terms takes some 9,000."""
LONG = 100
"""Terms from which on a sum is long."""
COMPREHENSIONS = ast.ListComp | ast.SetComp | ast.DictComp | ast.GeneratorExp

_codes: WeakKeyDictionary[FunctionType, CodeType] = WeakKeyDictionary()


def on_symbols(source: Parsed, trace: Any) -> FunctionType:
    """An equation whose decisions a trace takes; it takes all arguments by position."""
    function = source.function
    if function not in _codes:
        with deep():
            _codes[function] = _code(source)
    code = _codes[function]
    cells = dict(zip(function.__code__.co_freevars, function.__closure__ or (), strict=True))
    cells[TRACE] = CellType(trace)
    closure = tuple(cells[name] for name in code.co_freevars)
    return FunctionType(code, function.__globals__, function.__name__, None, closure)


@contextmanager
def deep() -> Any:
    """While expressions may be deeper than Python expects."""
    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(max(limit, DEEPEST))
    try:
        yield
    finally:
        sys.setrecursionlimit(limit)


def _code(source: Parsed) -> CodeType:
    """Code of an equation whose decisions are calls, with its own names of file and lines."""
    function = source.function
    arguments = [argument.arg for argument in source.arguments]
    stored = [name for name in _stored(source.node.body) if name not in arguments]
    rewriting = _Rewriting({*arguments, *stored, *_counted(source.node)}, [*arguments, *stored])
    body = source.node.body
    if ast.get_docstring(source.node, clean=False) is not None:
        body = body[1:]
    unset = [_assigned([name], _asked("unset", [ast.Constant(name)])) for name in stored]
    # within another function, whose arguments are what it closes over
    equation = _function(EQUATION, arguments, [*unset, *rewriting.block(body)])
    outer = _function(AROUND, [TRACE, *function.__code__.co_freevars], [equation])
    ast.copy_location(outer, source.node)
    ast.copy_location(equation, source.node)
    module = ast.fix_missing_locations(ast.Module([outer], []))
    code = compile(module, function.__code__.co_filename, "exec", dont_inherit=True)
    code = _code_within(_code_within(code, AROUND), EQUATION)
    return code.replace(co_name=function.__name__)


def _code_within(code: CodeType, name: str) -> CodeType:
    """The code of a function that another one defines."""
    codes = (constant for constant in code.co_consts if isinstance(constant, CodeType))
    return next(inner for inner in codes if inner.co_name == name)


# --- names ----------------------------------------------------------------------------------------


def _stored(statements: Iterable[ast.AST]) -> list[str]:
    """Names that some statements set, in order, those of comprehensions apart."""
    names = dict[str, None]()
    pending = [*statements][::-1]
    while pending:
        node = pending.pop()
        if isinstance(node, COMPREHENSIONS):
            continue
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names[node.id] = None
        pending += [*ast.iter_child_nodes(node)][::-1]
    return [*names]


def _counted(equation: ast.AST) -> set[str]:
    """Names that comprehensions set."""
    targets = (node.target for node in ast.walk(equation) if isinstance(node, ast.comprehension))
    return {name for target in targets for name in _stored([target])}


# --- pieces of syntax -----------------------------------------------------------------------------


def _read(name: str) -> ast.Name:
    return ast.Name(name, ast.Load())


def _function(
    name: str, arguments: Sequence[str], body: list[ast.stmt], *, bound: bool = False
) -> ast.FunctionDef:
    """A function, its arguments `bound` to what they are where it is defined."""
    defaults = map(_read, arguments) if bound else ()
    function = ast.FunctionDef(name, _arguments(arguments, defaults), body or [ast.Pass()], [])
    function.type_params = []  # type: ignore[attr-defined] # which Python 3.12 asks for
    return function


def _arguments(names: Iterable[str], defaults: Iterable[ast.expr] = ()) -> ast.arguments:
    args = [ast.arg(name) for name in names]
    return ast.arguments(
        posonlyargs=[], args=args, kwonlyargs=[], kw_defaults=[], defaults=[*defaults]
    )


def _later(value: ast.expr) -> ast.Lambda:
    """An expression that is evaluated when it is called."""
    return ast.Lambda(_arguments([]), value)


def _call(function: ast.expr, arguments: Iterable[ast.expr]) -> ast.Call:
    return ast.Call(function, [*arguments], [])


def _asked(word: str, arguments: Iterable[ast.expr]) -> ast.Call:
    """A call of the trace."""
    return _call(ast.Attribute(_read(TRACE), word, ast.Load()), arguments)


def _tuple(members: Iterable[ast.expr]) -> ast.Tuple:
    return ast.Tuple(list[ast.expr](members), ast.Load())


def _assigned(names: Sequence[str], value: ast.expr) -> ast.Assign:
    """A value that is given to a name, or to several."""
    targets: list[ast.expr] = [ast.Name(name, ast.Store()) for name in names]
    target = targets[0] if len(targets) == 1 else ast.Tuple(targets, ast.Store())
    return ast.Assign([target], value)


class Exits(NamedTuple):
    """What stands in the place of `break` and `continue` in a loop that is a function."""

    leaving: ast.stmt
    going_on: ast.stmt


def _leaves(statement: ast.stmt) -> bool:
    """Whether a way through a statement may return, or leave a loop or go on with its next turn."""
    exits = ast.Return | ast.Break | ast.Continue
    return any(isinstance(node, exits) for node in ast.walk(statement))


# --- the equation ---------------------------------------------------------------------------------


def _at(old: ast.AST, new: N) -> N:
    """A new node with the place of an old one."""
    return ast.copy_location(new, old)


class _Rewriting(ast.NodeTransformer):
    """Rewrites the statements of one equation.

    `known` are all names that it sets, `names` those but for the ones of comprehensions.
    """

    def __init__(self, known: set[str], names: list[str]) -> None:
        self.known, self.names = known, names
        self._numbers = count(1)

    def generic_visit(self, node: ast.AST) -> Any:
        """The same with what it consists of rewritten; the tree itself stays as it is."""
        parts = {
            name: [self.visit(each) for each in part]
            if isinstance(part, list)
            else (self.visit(part) if isinstance(part, ast.AST) else part)
            for name, part in ast.iter_fields(node)
        }
        return _at(node, type(node)(**parts))

    def _visited(self, node: ast.expr) -> ast.expr:
        rewritten: ast.expr = self.visit(node)
        return rewritten

    # -- statements --------------------------------------------------------------------------------

    def block(
        self,
        statements: Sequence[ast.stmt],
        then: ast.stmt | None = None,
        exits: Exits | None = None,
    ) -> list[ast.stmt]:
        """Statements whose decisions are calls, `then` one for when they end."""
        done = list[ast.stmt]()
        for place, statement in enumerate(statements):
            rest = statements[place + 1 :]
            match statement:
                case ast.Return():
                    return [*done, self.visit(statement)]
                case ast.Break() if exits is not None:
                    return [*done, exits.leaving]
                case ast.Continue() if exits is not None:
                    return [*done, exits.going_on]
                case ast.If() if _leaves(statement):
                    return [*done, *self._forked(statement, rest, then, exits)]
                case ast.For() if _leaves(statement):
                    return [*done, *self._looped(statement, rest, then, exits)]
                case ast.If():
                    done += self._merged(statement)
                case ast.For():
                    iterable = self._visited(statement.iter)
                    body = [*self._called(statement.target), *self.block(statement.body)]
                    orelse = self.block(statement.orelse)
                    loop = ast.For(statement.target, iterable, body, orelse)
                    done.append(_at(statement, loop))
                case ast.AugAssign():
                    left = _at(statement, _read(_stored([statement.target])[0]))
                    term = _at(statement, ast.BinOp(left, statement.op, statement.value))
                    done += self._bound(statement, [statement.target], term)
                case ast.AnnAssign(target=target, value=ast.expr() as value):
                    done += self._bound(statement, [target], value)
                case ast.Assign(targets=targets, value=value):
                    done += self._bound(statement, targets, value)
                case _:
                    done.append(self.visit(statement))
        return done if then is None else [*done, then]

    def _bound(
        self, statement: ast.stmt, targets: list[ast.expr], value: ast.expr
    ) -> list[ast.stmt]:
        """An assignment, and what the trace hears of it."""
        assignment = _at(statement, ast.Assign(targets, self._visited(value)))
        named = [name for target in targets for name in self._called(target)]
        return [assignment, *named]

    def _called(self, target: ast.expr) -> list[ast.stmt]:
        """Tell the trace what values are called; what a `*` has gathered is a tuple."""
        named = _asked("named", [])
        named.keywords = [ast.keyword(name, _read(name)) for name in _stored([target])]
        starred = [node for node in ast.walk(target) if isinstance(node, ast.Starred)]
        gathered = [_assigned([name], _asked("items", [_read(name)])) for name in _stored(starred)]
        return [*(_at(target, each) for each in gathered), _at(target, ast.Expr(named))]

    def _way(
        self, word: str, at: ast.stmt, body: list[ast.stmt], *, bound: bool = True
    ) -> ast.FunctionDef:
        """A way through an equation as a function of all its names."""
        name = f"<{word} {next(self._numbers)}>"
        return _at(at, _function(name, self.names, body, bound=bound))

    def _merged(self, statement: ast.If) -> list[ast.stmt]:
        """A decision both of whose ways go on."""
        names = _stored([*statement.body, *statement.orelse])
        back = ast.Return(_tuple(map(_read, names)))
        if_true = self._way("if", statement, self.block(statement.body, back))
        if_false = self._way("else", statement, self.block(statement.orelse, back))
        ways = [_read(if_true.name), _read(if_false.name)]
        texts = _tuple(map(ast.Constant, names))
        merged = _asked("either_way", [self._visited(statement.test), *ways, texts])
        new: ast.stmt = ast.Expr(merged)
        if names:
            targets = ast.Tuple([ast.Name(name, ast.Store()) for name in names], ast.Store())
            new = ast.Assign([targets], merged)
        return [if_true, if_false, _at(statement, new)]

    def _rest(
        self,
        at: ast.stmt,
        statements: Sequence[ast.stmt],
        then: ast.stmt | None,
        exits: Exits | None,
    ) -> tuple[ast.FunctionDef, ast.Return]:
        """What comes after a statement as a function, and its call."""
        rest = self._way("rest", at, self.block(statements, then, exits), bound=False)
        call = _call(_read(rest.name), map(_read, self.names))
        return rest, _at(at, ast.Return(call))

    def _forked(
        self,
        statement: ast.If,
        following: Sequence[ast.stmt],
        then: ast.stmt | None,
        exits: Exits | None,
    ) -> list[ast.stmt]:
        """A decision of which a way returns or leaves a loop."""
        rest, go_on = self._rest(statement, following, then, exits)
        if_true = self._way("if", statement, self.block(statement.body, go_on, exits))
        if_false = self._way("else", statement, self.block(statement.orelse, go_on, exits))
        ways = [_read(if_true.name), _read(if_false.name)]
        chosen = _asked("one_return", [self._visited(statement.test), *ways])
        return [rest, if_true, if_false, _at(statement, ast.Return(chosen))]

    def _looped(
        self,
        statement: ast.For,
        following: Sequence[ast.stmt],
        then: ast.stmt | None,
        exits: Exits | None,
    ) -> list[ast.stmt]:
        """A loop that a way may leave: a function of what is left to do, which calls itself."""
        rest, go_on = self._rest(statement, following, then, exits)
        name, left = f"<loop {next(self._numbers)}>", "<left>"

        def next_turn(items: ast.expr) -> ast.stmt:
            turn = _call(_read(name), [items, *map(_read, self.names)])
            return _at(statement, ast.Return(turn))

        first = ast.Subscript(_read(left), ast.Constant(0), ast.Load())
        others = ast.Subscript(_read(left), ast.Slice(ast.Constant(1), None, None), ast.Load())
        going_on = next_turn(others)
        body = [
            ast.If(
                ast.UnaryOp(ast.Not(), _read(left)), self.block(statement.orelse, go_on, exits), []
            ),
            _at(statement, ast.Assign([statement.target], first)),
            *self._called(statement.target),
            *self.block(statement.body, going_on, Exits(go_on, going_on)),
        ]
        turn = _at(statement, _function(name, [left, *self.names], body))
        return [rest, turn, next_turn(_asked("items", [self._visited(statement.iter)]))]

    # -- expressions -------------------------------------------------------------------------------

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """A name; one from outside is looked at."""
        if node.id in self.known or not isinstance(node.ctx, ast.Load):
            return node
        return _at(node, _asked("outside", [node, ast.Constant(node.id)]))

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        """A field, or a constant of a module."""
        if isinstance(node.value, ast.Name) and node.value.id not in self.known:
            words = map(ast.Constant, (node.value.id, node.attr))
            return _at(node, _asked("member", [node.value, *words]))
        field: ast.expr = self.generic_visit(node)
        return field

    def visit_Call(self, node: ast.Call) -> ast.expr:
        """A call, which the trace does."""
        function = node.func
        if not self._is_outside(function):
            function = self._visited(function)
        text = ast.Constant(ast.unparse(node.func))
        arguments = [function, text, *map(self._visited, node.args)]
        call = _asked("called", arguments)
        call.keywords = [
            ast.keyword(keyword.arg, self._visited(keyword.value)) for keyword in node.keywords
        ]
        return _at(node, call)

    def _is_outside(self, node: ast.expr) -> bool:
        """Whether an expression is a name from outside, or a name in a module."""
        while isinstance(node, ast.Attribute):
            node = node.value
        return isinstance(node, ast.Name) and node.id not in self.known

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        """Arithmetic; a long sum goes term by term, since Python's compilers have their depth."""
        first, terms = node.left, [(node.op, node.right)]
        while isinstance(first, ast.BinOp):
            terms.append((first.op, first.right))
            first = first.left
        if len(terms) < LONG:
            arithmetic: ast.expr = self.generic_visit(node)
            return arithmetic
        steps = [
            _tuple([ast.Constant(type(op).__name__), self._visited(term)])
            for op, term in reversed(terms)
        ]
        return _at(node, _asked("long_sum", [self._visited(first), *steps]))

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.expr:
        """`not` is a decision."""
        operand = self._visited(node.operand)
        negated = _asked("negated", [operand])
        is_not = isinstance(node.op, ast.Not)
        return _at(node, negated if is_not else ast.UnaryOp(node.op, operand))

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.expr:
        """`and` and `or`, whose second test only counts after the first."""
        word = "both" if isinstance(node.op, ast.And) else "either"
        operands = [
            _tuple([ast.Constant(ast.unparse(each)), _later(self._visited(each))])
            for each in node.values
        ]
        return _at(node, _asked(word, operands))

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        """A comparison; several are joined, and `is None` asks for an option."""
        if len(node.ops) > 1:
            lefts = [node.left, *node.comparators]
            parts: list[ast.expr] = [
                _at(node, ast.Compare(left, [op], [right]))
                for left, op, right in zip(lefts, node.ops, node.comparators, strict=False)
            ]
            return self._visited(_at(node, ast.BoolOp(ast.And(), parts)))
        left, op = self._visited(node.left), node.ops[0]
        if isinstance(op, ast.Is | ast.IsNot):
            missing = _asked("is_none", [left])
            new: ast.expr = missing
            if isinstance(op, ast.IsNot):
                new = _asked("negated", [missing])
        else:
            new = ast.Compare(left, [op], [self._visited(node.comparators[0])])
        return _at(node, new)

    def visit_IfExp(self, node: ast.IfExp) -> ast.expr:
        """A choice between two values, of which only one is evaluated if that is known."""
        ways = [_later(self._visited(way)) for way in (node.body, node.orelse)]
        return _at(node, _asked("chosen", [self._visited(node.test), *ways]))
