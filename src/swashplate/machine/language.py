"""The sources of equations, and what no equation may contain.

An equation is a pure function of floats and named tuples, which Python runs on symbols. What would
do something besides, or what Python would do in silence otherwise than its author thinks, is
refused when it is declared; all else, such as a decision that cannot be taken, when it is run.
"""

import ast
import builtins
import linecache
import math
import os
import sys
import traceback
import typing
from collections.abc import Callable, Collection, Hashable
from dataclasses import dataclass
from functools import lru_cache
from types import FunctionType, SimpleNamespace
from typing import Any, NoReturn
from weakref import WeakKeyDictionary

from swashplate.errors import EquationError
from swashplate.machine.graph import MATH_FUNCTIONS

MATH: dict[Any, str] = {getattr(math, name): name for name in MATH_FUNCTIONS}
"""Functions of `math` that an equation may call."""
CHOICES: dict[Any, str] = {min: "min", max: "max", abs: "abs"}
# --- what is refused ------------------------------------------------------------------------------

ABOVE = "import at the top of the file"
GLOBAL = "an equation depends only on its arguments and on constants"
TURNS = "write `for i in range(4):` with a number of turns that is known"

INSTEAD: dict[type[ast.AST], tuple[str, str]] = {
    ast.While: ("a while loop", TURNS),
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
    ast.Match: ("match", "use if and elif"),
    ast.Expr: ("a statement that sets nothing", "give its value to a name, or leave it out"),
    ast.Lambda: ("lambda", "write a separate equation"),
    ast.NamedExpr: (":=", "write a separate assignment"),
    ast.Yield: ("yield", "return a tuple"),
    ast.YieldFrom: ("yield", "return a tuple"),
    ast.Await: ("await", "call the equation"),
}
"""What to write in place of statements and expressions that an equation may not use."""


def _refused(node: ast.AST) -> tuple[str, str] | None:
    """What is wrong with a node, and what to write in its place; nothing if it may stand."""
    match node:
        case ast.AnnAssign(value=None):
            return "a declaration", "assign a value to a name"
        case ast.Return(value=None):
            return "a return without a value", "return a value"
        case ast.Attribute(ctx=ast.Store()):
            instead = "named tuples cannot be changed; make a new one, as in State(t.a, b)"
            return "an assignment to a field", instead
        case ast.Attribute(attr=attribute) if attribute.startswith("__"):
            return f"{attribute}, which is Python's own", "name a field of the named tuple"
        case ast.Subscript(ctx=ast.Store()):
            return "an assignment to an element", "assign to a name"
        case ast.Compare(ops=ops, comparators=rights):
            for op, right in zip(ops, rights, strict=True):
                none = isinstance(right, ast.Constant) and right.value is None
                if isinstance(op, ast.Is | ast.IsNot) and not none:
                    return "`is` with something other than None", "write `==`"
                if isinstance(op, ast.In | ast.NotIn):
                    return "`in`", "compare with == and or"
    return INSTEAD.get(type(node))


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

    def line_of(self, error: BaseException) -> int:
        """The line in which an error came up while the equation was run."""
        file = self.function.__code__.co_filename
        frames = traceback.walk_tb(error.__traceback__)
        lines = [line for frame, line in frames if frame.f_code.co_filename == file]
        return lines[-1] if lines else self.node.lineno

    def refuse(self, line: int | None, what: str, instead: str) -> NoReturn:
        """Refuse something in a sentence with file and line, by itself that of the equation."""
        place = f"{self.file}, line {line or self.node.lineno}"
        raise EquationError(f"{place}: {what} in {self.name}: {instead}.") from None


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


def type_of(function: Callable[..., Any], argument: str) -> Any:
    """Type of an argument; None if it has none, or one that only an enclosing function knows."""
    hint = function.__annotations__.get(argument)
    if not isinstance(hint, str):
        return hint
    try:
        annotated = SimpleNamespace(__annotations__={argument: hint})
        return typing.get_type_hints(annotated, function.__globals__, include_extras=True)[argument]
    except NameError:
        return None


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


def unchecked(f: Any) -> Parsed:
    """Source of any function, as it stands: for those that equations are built on."""
    if not isinstance(f, FunctionType):
        raise EquationError(f"{f!r} is not a function that can be an equation.")
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


def parsed(f: Any) -> Parsed:
    """Source of an equation, checked once."""
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
        refuse(node.lineno, "an argument with *", "name every argument")
    for argument in source.arguments:
        if argument.annotation is None:
            name = argument.arg
            instead = f"write `{name}: float`, `{name}: tuple[float, float]` or its named tuple"
            refuse(argument.lineno, f"{argument.arg} without a type", instead)
    body = node.body[1:] if ast.get_docstring(node, clean=False) is not None else node.body
    for statement in body:
        for inner in ast.walk(statement):  # what stands outside comes before what is in it
            if (refused := _refused(inner)) is not None:
                refuse(getattr(inner, "lineno", None), *refused)
    if not _returns(body):
        refuse(node.lineno, "an end without return", "return a value on every path")


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
