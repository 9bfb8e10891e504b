"""The language of equations: what a function may consist of, checked on its source.

An equation is a pure function of floats and named tuples: assignments, `if`, `return`, loops over
a literal range, arithmetic, comparisons, `min`, `max`, `abs`, functions of `math`, other equations.
Its source is found and checked here, without types and without running anything.
"""

import ast
import builtins
import linecache
import math
import os
import sys
import typing
from collections.abc import Collection, Hashable, Iterable
from dataclasses import dataclass
from functools import lru_cache
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any, NoReturn
from weakref import WeakKeyDictionary

from swashplate.equations.graph import MATH_FUNCTIONS
from swashplate.errors import EquationError

MATH: dict[Any, str] = {getattr(math, name): name for name in MATH_FUNCTIONS}
"""Functions of `math` that an equation may call."""
CHOICES: dict[Any, str] = {min: "min", max: "max", abs: "abs"}
ARITHMETIC = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"}
COMPARISONS = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip


# --- what is refused ------------------------------------------------------------------------------

TUPLES, ABOVE = "use a tuple or a named tuple", "import at the top of the file"
GLOBAL = "an equation depends only on its arguments and on constants"
NUMBERS = "an equation handles only real numbers; use options for choices"
TERMS = "write the terms out, or a loop over a literal range"

INSTEAD: dict[type[ast.AST], tuple[str, str]] = {
    ast.While: ("a while loop", "write `for i in range(4):` with a literal number of steps"),
    ast.Try: ("try", "test the arguments with if"),
    ast.With: ("with", "an equation only computes"),
    ast.Raise: ("raise", "return a value; models state their domain separately"),
    ast.Assert: ("assert", "models state their domain separately"),
    ast.FunctionDef: ("a function within an equation", "write a separate equation next to it"),
    ast.AsyncFunctionDef: ("async", "write an ordinary function"),
    ast.ClassDef: ("a class within an equation", "define the named tuple next to the equation"),
    ast.Import: ("an import within an equation", ABOVE),
    ast.ImportFrom: ("an import within an equation", ABOVE),
    ast.Global: ("global", GLOBAL),
    ast.Nonlocal: ("nonlocal", GLOBAL),
    ast.Delete: ("del", "leave the name alone"),
    ast.Break: ("break", "use if within the loop"),
    ast.Continue: ("continue", "use if within the loop"),
    ast.Match: ("match", "use if and elif"),
    ast.Expr: ("a statement without effect on the result", "leave it out"),
    ast.Lambda: ("lambda", "write a separate equation"),
    ast.ListComp: ("a comprehension", TERMS),
    ast.SetComp: ("a comprehension", TERMS),
    ast.DictComp: ("a comprehension", TERMS),
    ast.GeneratorExp: ("a comprehension", TERMS),
    ast.List: ("a list", TUPLES),
    ast.Set: ("a set", TUPLES),
    ast.Dict: ("a dictionary", "use a named tuple"),
    ast.JoinedStr: ("a string", NUMBERS),
    ast.NamedExpr: (":=", "write a separate assignment"),
    ast.Yield: ("yield", "return a tuple"),
    ast.YieldFrom: ("yield", "return a tuple"),
    ast.Await: ("await", "call the equation"),
    ast.Starred: ("an argument or element with *", "write the elements out"),
    ast.FloorDiv: ("//", "write floor(a / b)"),
    ast.Mod: ("%", "write a - b * floor(a / b)"),
    ast.MatMult: ("@", "write the products out"),
    ast.BitAnd: ("&", "write `and`"),
    ast.BitOr: ("|", "write `or`"),
    ast.BitXor: ("^", "write `!=` of two tests, or ** for a power"),
    ast.LShift: ("<<", "multiply"),
    ast.RShift: (">>", "divide"),
    ast.Invert: ("~", "write `not`"),
}
"""What to write in place of statements, expressions and operators that an equation may not use."""
INSTEAD_OF_BUILTIN = {
    "print": "inspect results outside the equation",
    "len": "write the number",
    "sum": "write the terms out",
    "float": "write the number as a float",
    "int": "write floor(x)",
    "round": "write floor(x + 0.5)",
    "pow": "write ** with a whole number, or exp(b * log(a))",
    "range": "write it in a for statement only",
}


def _refused(node: ast.AST) -> tuple[str, str] | None:
    """What is wrong with a node, and what to write in its place; nothing if it may stand."""
    match node:
        case ast.AnnAssign(value=None):
            return "a declaration", "assign a value to a name"
        case ast.AnnAssign(target=target) | ast.AugAssign(target=target) if not isinstance(
            target, ast.Name
        ):
            return "a declaration", "assign a value to a name"
        case ast.BinOp(op=ast.Pow(), right=power) | ast.AugAssign(op=ast.Pow(), value=power) if (
            whole(power) is None
        ):
            what = "a power other than a whole number"
            return what, "write sqrt(a), or exp(b * log(a))"
        case ast.Return(value=None):
            return "a return without a value", "return a value"
        case ast.For() if not is_range(node):
            what = "a loop over something other than a literal range"
            return what, "write `for i in range(4):`, which is unrolled"
        case ast.Attribute(ctx=ast.Store()):
            instead = "named tuples cannot be changed; make a new one, as in State(t.a, b)"
            return "an assignment to a field", instead
        case ast.Subscript(ctx=ast.Store()):
            return "an assignment to an element", "assign to a name"
        case ast.Constant(value=value) if not isinstance(value, int | float | None):
            return "a string" if isinstance(value, str) else repr(value), NUMBERS
        case ast.Compare(ops=ops, comparators=rights):
            for op, right in zip(ops, rights, strict=True):
                none = isinstance(right, ast.Constant) and right.value is None
                if isinstance(op, ast.Is | ast.IsNot) and not none:
                    return "`is` with something other than None", "write `==`"
                if type(op) not in (*COMPARISONS, ast.Is, ast.IsNot):
                    return "`in`", "compare with == and or"
        case ast.Call(keywords=keywords) if any(keyword.arg is None for keyword in keywords):
            return "an argument with **", "write the arguments out"
        case ast.Call(func=called) if not isinstance(called, ast.Name | ast.Attribute):
            return "a call of an expression", "call equations by their names"
    return INSTEAD.get(type(node))


def whole(node: ast.expr) -> int | None:
    """Value of a literal whole number, or nothing."""
    match node:
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            value = whole(operand)
            return None if value is None else -value
        case ast.Constant(value=int(value)) if type(value) is int:
            return value
    return None


def is_range(node: ast.For) -> bool:
    """Whether a loop counts in a literal range."""
    match node:
        case ast.For(ast.Name(), ast.Call(ast.Name("range"), args, []), orelse=[]):
            bounds = [whole(arg) for arg in args]
            return None not in bounds and 1 <= len(bounds) <= 3 and bounds[2:] != [0]
    return False


def is_among(thing: Any, table: Collection[Any]) -> bool:
    """Whether something stands in a table of functions; lists and their like never do."""
    return isinstance(thing, Hashable) and thing in table


# --- sources --------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Parsed:
    """An equation's source, checked."""

    function: FunctionType
    node: ast.FunctionDef
    file: str

    @property
    def name(self) -> str:
        """Name of the function."""
        return self.function.__name__

    @property
    def arguments(self) -> list[ast.arg]:
        """Its arguments, in order."""
        arguments = self.node.args
        return [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]

    @property
    def defaults(self) -> dict[str, Any]:
        """Values of arguments that need not be given."""
        values = self.function.__defaults__ or ()
        positional = [*self.node.args.posonlyargs, *self.node.args.args]
        with_default = positional[len(positional) - len(values) :]
        by_position = {
            argument.arg: value for argument, value in zip(with_default, values, strict=True)
        }
        return by_position | (self.function.__kwdefaults__ or {})

    @property
    def local(self) -> set[str]:
        """Names of its arguments and of what it assigns."""
        return set(self.function.__code__.co_varnames)

    def called(self, function: ast.expr) -> Any:
        """What a call calls; `NameError` or `AttributeError` if nothing."""
        if isinstance(function, ast.Attribute):
            return getattr(self.called(function.value), function.attr)
        if not isinstance(function, ast.Name):
            raise NameError(ast.unparse(function))
        return resolved(self.function, function.id)

    def refuse(self, node: ast.AST | None, what: str, instead: str) -> NoReturn:
        """Refuse a construct in a sentence with file and line."""
        line = getattr(node, "lineno", self.node.lineno)
        raise EquationError(f"{self.file}, line {line}: {what} in {self.name}: {instead}.")


def resolved(function: FunctionType, name: str) -> Any:
    """What a name that is not local stands for in a function; `NameError` if for nothing."""
    free = function.__code__.co_freevars
    try:
        if name in free and function.__closure__ is not None:
            return function.__closure__[free.index(name)].cell_contents
        space = function.__globals__
        return space[name] if name in space else getattr(builtins, name)
    except (ValueError, AttributeError):  # a cell without content yet, or no such name
        raise NameError(name) from None


def hints_of(function: FunctionType) -> dict[str, Any]:
    """Types of a function's arguments and of its result, those that it closes over among them."""
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=False)
    free = {name: cell.cell_contents for name, cell in cells}
    return typing.get_type_hints(function, None, free or None, include_extras=True)


def type_of(function: FunctionType, argument: str) -> Any:
    """Type of an argument; None if it has none, or one that only an enclosing function knows."""
    hint = function.__annotations__.get(argument)
    if not isinstance(hint, str):
        return hint
    try:
        annotated = SimpleNamespace(__annotations__={argument: hint})
        return typing.get_type_hints(annotated, function.__globals__, include_extras=True)[argument]
    except NameError:
        return None


def plain(function: Any) -> Any:
    """The plain Python function within a compiled one."""
    return getattr(function, "py_func", function)


def is_named_tuple(thing: Any) -> bool:
    """Whether something is a class of named tuples."""
    return isinstance(thing, type) and issubclass(thing, tuple) and hasattr(thing, "_fields")


@lru_cache(maxsize=8)
def _functions(text: str) -> dict[int, ast.FunctionDef]:
    """All functions of a file's text by the line that they begin in, decorators included."""
    nodes = [
        function for function in ast.walk(ast.parse(text)) if isinstance(function, ast.FunctionDef)
    ]
    return {
        min([function.lineno, *(mark.lineno for mark in function.decorator_list)]): function
        for function in nodes
    }


def unchecked(function: Any) -> Parsed:
    """Source of any function, as it stands: for those that equations are built on."""
    f = plain(function)
    if not isinstance(f, FunctionType):
        raise EquationError(f"{function!r} is not a function that can be an equation.")
    file = f.__code__.co_filename
    linecache.checkcache(file)
    try:
        text = "".join(linecache.getlines(file, f.__globals__))
        node = _functions(text).get(f.__code__.co_firstlineno)
    except SyntaxError:
        node = None
    if node is None or node.name != f.__code__.co_name:
        raise EquationError(
            f"The source of {f.__name__} cannot be read from {file}: write the equation in a "
            "file or in a notebook's cell, not at a bare prompt."
        )
    full = os.path.abspath(file)  # noqa: PTH100 - the name of a notebook's cell is not a path
    starts = [os.path.abspath(folder) + os.sep for folder in sys.path if folder]  # noqa: PTH100
    longest = max((folder for folder in starts if full.startswith(folder)), key=len, default="")
    return Parsed(f, node, full[len(longest) :].replace(os.sep, "/") if longest else file)


_parsed: "WeakKeyDictionary[FunctionType, Parsed]" = WeakKeyDictionary()


def parsed(function: Any) -> Parsed:
    """Source of an equation, compiled or plain, checked once."""
    f = plain(function)
    source = _parsed.get(f) if isinstance(f, FunctionType) else None
    if source is None:
        source = unchecked(f)
        _check(source)
        _parsed[f] = source
    return source


def _check(source: Parsed) -> None:
    """Go once through the tree of an equation and refuse what does not belong there."""
    node, refuse = source.node, source.refuse
    if node.args.vararg or node.args.kwarg:
        refuse(node, "an argument with *", "name every argument")
    for argument in source.arguments:
        if argument.annotation is None:
            instead = f"write `{argument.arg}: float`, or the named tuple that it is"
            refuse(argument, f"{argument.arg} without a type", instead)
    body = node.body[1:] if ast.get_docstring(node, clean=False) is not None else node.body
    nodes = [inner for statement in body for inner in ast.walk(statement)]
    loops = [inner for inner in nodes if isinstance(inner, ast.For) and is_range(inner)]
    ranges = {loop.iter for loop in loops}
    counters = {loop.target.id for loop in loops if isinstance(loop.target, ast.Name)}
    for inner in nodes:  # what stands outside comes before what is in it
        marks = [part for part in ast.iter_child_nodes(inner) if not hasattr(part, "lineno")]
        for part in (inner, *marks):  # operators have no line of their own
            if (refused := _refused(part)) is not None:
                refuse(inner, *refused)
        if isinstance(inner, ast.Subscript) and not _is_index(inner.slice, counters):
            refuse(inner, "an index that is not a whole number", "write the number, as in s[0]")
        if isinstance(inner, ast.Call) and inner not in ranges:
            if isinstance(inner.func, ast.Name) and inner.func.id == source.node.name:
                refuse(inner, "a recursive call", "write a loop over a literal range")
            _check_call(source, inner)
    if not _returns(body):
        refuse(node, "an end without return", "return a value on every path")


def _check_call(source: Parsed, node: ast.Call) -> None:
    """Refuse a call of what is certainly not an equation; a name may be given to one later."""
    function = node.func
    base = function.value if isinstance(function, ast.Attribute) else function
    if not isinstance(base, ast.Name) or base.id in source.local:
        if isinstance(function, ast.Attribute) and _is_module(source, base):
            name = ast.unparse(function)
            instead = f"import {function.attr} itself, or the module {ast.unparse(base)}, by a name"
            source.refuse(node, f"a call of {name}", instead)
        if isinstance(function, ast.Attribute):
            instead = "call equations; make a new named tuple, as in State(t.a, b)"
            source.refuse(node, f"the method {function.attr}", instead)
        name = ast.unparse(function)
        source.refuse(node, f"a call of the argument {name}", "call equations by their names")
    try:
        called = source.called(function)
    except (NameError, AttributeError):
        return  # defined further down, or missing: seen when it is wanted
    if not callable(called) or is_named_tuple(called):
        return
    if is_among(called, MATH) or is_among(called, CHOICES):
        return
    if isinstance(plain(called), FunctionType):
        return
    instead, short = "call only equations and functions of math", ast.unparse(function)
    short = short.rpartition(".")[2]
    if hasattr(math, short):
        instead = f"an equation may call these functions of math: {', '.join(MATH.values())}"
    if getattr(builtins, short, None) is called:
        instead = INSTEAD_OF_BUILTIN.get(short, instead)
    source.refuse(node, f"a call of {ast.unparse(function)}", instead)


def _is_module(source: Parsed, node: ast.expr) -> bool:
    """Whether an expression is a module within a module."""
    root = node
    while isinstance(root, ast.Attribute):
        root = root.value
    if not isinstance(root, ast.Name) or root.id in source.local:
        return False
    try:
        member = source.called(root)
        for name in ast.unparse(node).split(".")[1:]:
            member = getattr(member, name)
    except (NameError, AttributeError):
        return False
    return isinstance(member, ModuleType)


def _is_index(index: ast.expr, counters: set[str]) -> bool:
    """Whether an index is arithmetic of whole numbers and counters of loops."""
    if isinstance(index, ast.BinOp):
        is_arithmetic = isinstance(index.op, ast.Add | ast.Sub | ast.Mult)
        return (
            is_arithmetic and _is_index(index.left, counters) and _is_index(index.right, counters)
        )
    return whole(index) is not None or (isinstance(index, ast.Name) and index.id in counters)


def _returns(body: list[ast.stmt]) -> bool:
    """Whether every way through some statements ends in a return."""
    return any(
        isinstance(statement, ast.Return)
        or (
            isinstance(statement, ast.If)
            and _returns(statement.body)
            and _returns(statement.orelse)
        )
        for statement in body
    )


def has_return(statements: Iterable[ast.stmt]) -> bool:
    """Whether a return stands anywhere in the statements."""
    return any(isinstance(node, ast.Return) for body in statements for node in ast.walk(body))
