"""The language of equations: what a function may consist of, checked on its source.

An equation is a pure function of floats and named tuples: assignments, `if`, `return`, loops over
a literal range, arithmetic, comparisons, `min`, `max`, `abs`, functions of `math`, other equations.
Its source is found and checked here, without types and without running anything.
"""

import ast
import builtins
import gc
import linecache
import math
import os
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from types import FunctionType
from typing import Any, NoReturn
from weakref import WeakKeyDictionary

from swashplate.equations.expressions import CALLED
from swashplate.errors import EquationError

MATH: dict[Any, str] = {getattr(math, name): name for name in CALLED}
"""Functions of `math` that an equation may call."""
CHOICES: dict[Any, str] = {min: "min", max: "max", abs: "abs"}
ARITHMETIC = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"}
COMPARISONS = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}

INSTEAD: dict[type[ast.AST], tuple[str, str]] = {
    ast.While: ("a while loop", "write `for i in range(4):` with a literal number of steps"),
    ast.Try: ("try", "test the arguments with if"),
    ast.With: ("with", "an equation only computes"),
    ast.Raise: ("raise", "return a value; models state their domain apart"),
    ast.Assert: ("assert", "models state their domain apart"),
    ast.FunctionDef: ("a function within an equation", "write an equation of its own beside it"),
    ast.AsyncFunctionDef: ("async", "write an ordinary function"),
    ast.ClassDef: ("a class within an equation", "define the named tuple beside the equation"),
    ast.Import: ("an import within an equation", "import at the top of the file"),
    ast.ImportFrom: ("an import within an equation", "import at the top of the file"),
    ast.Global: ("global", "an equation only depends on its arguments and on constants"),
    ast.Nonlocal: ("nonlocal", "an equation only depends on its arguments and on constants"),
    ast.Delete: ("del", "leave the name alone"),
    ast.Break: ("break", "use if within the loop"),
    ast.Continue: ("continue", "use if within the loop"),
    ast.Match: ("match", "use if and elif"),
    ast.Lambda: ("lambda", "write an equation of its own"),
    **dict.fromkeys(
        (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp),
        ("a comprehension", "write the terms out, or a loop over a literal range"),
    ),
    ast.List: ("a list", "use a tuple or a named tuple"),
    ast.Set: ("a set", "use a tuple or a named tuple"),
    ast.Dict: ("a dictionary", "use a named tuple"),
    ast.JoinedStr: ("a string", "an equation knows numbers only; use options for choices"),
    ast.NamedExpr: (":=", "write an assignment of its own"),
    ast.Yield: ("yield", "return a tuple"),
    ast.YieldFrom: ("yield", "return a tuple"),
    ast.Await: ("await", "call the equation"),
    ast.Starred: ("an argument or element with *", "write the elements out"),
}
"""What to write in place of statements and expressions that an equation may not use."""
INSTEAD_OF_OPERATOR: dict[type[ast.AST], tuple[str, str]] = {
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
INSTEAD_OF_BUILTIN = {
    "print": "look at results outside the equation",
    "len": "write the number",
    "sum": "write the terms out",
    "float": "write the number as a float",
    "int": "write floor(x)",
    "round": "write floor(x + 0.5)",
    "pow": "write ** with a whole number, or exp(b * log(a))",
    "range": "write it in a for statement only",
}


PLAIN = (ast.Name, ast.Attribute, ast.IfExp, ast.BoolOp, ast.Tuple, ast.If, ast.Pass)
"""Nodes that need no check of their own."""


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
        a = self.node.args
        return [*a.posonlyargs, *a.args, *a.kwonlyargs]

    @property
    def defaults(self) -> dict[str, Any]:
        """Values of arguments that need not be given."""
        f = self.function
        positional = f.__code__.co_varnames[: f.__code__.co_argcount]
        values = f.__defaults__ or ()
        first = len(positional) - len(values)
        return {**dict(zip(positional[first:], values, strict=True)), **(f.__kwdefaults__ or {})}

    def resolve(self, name: str) -> Any:
        """What a name that is not local stands for; `NameError` if for nothing."""
        return resolved(self.function, name)

    def refuse(self, node: ast.AST | None, what: str, instead: str) -> NoReturn:
        """Refuse a construct in a sentence with file and line."""
        line = getattr(node, "lineno", self.node.lineno)
        raise EquationError(f"{self.file}, line {line}: {what} in {self.name}: {instead}.")


def resolved(function: FunctionType, name: str) -> Any:
    """What a name that is not local stands for in a function; `NameError` if for nothing."""
    free = function.__code__.co_freevars
    if name in free and function.__closure__ is not None:
        try:
            return function.__closure__[free.index(name)].cell_contents
        except ValueError:
            raise NameError(name) from None
    if name in function.__globals__:
        return function.__globals__[name]
    try:
        return getattr(builtins, name)
    except AttributeError:
        raise NameError(name) from None


def plain(function: Any) -> Any:
    """The plain Python function within a compiled one."""
    return getattr(function, "py_func", function)


def is_named_tuple(thing: Any) -> bool:
    """Whether something is a class of named tuples."""
    return isinstance(thing, type) and issubclass(thing, tuple) and hasattr(thing, "_fields")


_parsed: "WeakKeyDictionary[FunctionType, Parsed]" = WeakKeyDictionary()
_files: dict[str, tuple[list[str], dict[int, ast.FunctionDef]]] = {}
"""Functions by the line that they begin in, of files last read."""


def _functions(file: str, module: dict[str, Any]) -> dict[int, ast.FunctionDef]:
    """All functions of a file by the line that they begin in, decorators included."""
    linecache.checkcache(file)
    lines = linecache.getlines(file, module)
    known = _files.get(file)
    if known is not None and known[0] is lines:
        return known[1]
    collecting = gc.isenabled()
    gc.disable()  # a tree is many objects and no garbage: collecting doubles the time
    try:
        found: dict[int, ast.FunctionDef] = {}
        pending: list[ast.AST] = [ast.parse("".join(lines))] if lines else []
        while pending:
            for child in getattr(pending.pop(), "body", ()):
                if isinstance(child, ast.FunctionDef):
                    first = child.decorator_list[0] if child.decorator_list else child
                    found[first.lineno] = child
                pending.append(child)
                if isinstance(child, ast.If | ast.Try):
                    pending.extend(child.orelse)
    finally:
        if collecting:
            gc.enable()
    if len(_files) > 8:
        _files.clear()
    _files[file] = (lines, found)
    return found


def parsed(function: Any, typed: bool = True) -> Parsed:
    """Source of an equation, compiled or plain, checked once.

    Raises
    ------
    EquationError
        If there is no source, or something in it that an equation may not use.
    """
    f = plain(function)
    known = _parsed.get(f) if isinstance(f, FunctionType) else None
    if known is None:
        known = unchecked(f)
        _Check(known).all(typed)
        _parsed[f] = known
    return known


def unchecked(function: Any) -> Parsed:
    """Source of any function, as it stands: for those that equations are built on.

    Raises
    ------
    EquationError
        If there is no source.
    """
    f = plain(function)
    if not isinstance(f, FunctionType):
        raise EquationError(f"{function!r} is not a function that can be an equation.")
    file = f.__code__.co_filename
    try:
        node = _functions(file, f.__globals__).get(f.__code__.co_firstlineno)
    except SyntaxError:
        node = None
    if node is None or node.name != f.__code__.co_name:
        raise EquationError(
            f"The source of {f.__name__} cannot be read from {file}: write the equation in a "
            "file or in a notebook's cell, not at a bare prompt."
        )
    return Parsed(f, node, _short(file))


def _short(file: str) -> str:
    """A file's path from the folder that Python imports from."""
    full = os.path.abspath(file)  # noqa: PTH100 - the name of a notebook's cell is no path
    starts = [os.path.abspath(each) + os.sep for each in sys.path if each]  # noqa: PTH100
    inside = [each for each in starts if full.startswith(each)]
    return full[len(max(inside, key=len)) :].replace(os.sep, "/") if inside else file


class _Check:
    """Goes once through the tree of an equation and refuses what does not belong there."""

    def __init__(self, source: Parsed) -> None:
        self.source, self.refuse = source, source.refuse
        self.local = set(source.function.__code__.co_varnames)
        loops = [each for each in ast.walk(source.node) if isinstance(each, ast.For)]
        self.counters = {each.target.id for each in loops if isinstance(each.target, ast.Name)}
        self.ranges = {each.iter for each in loops}

    def all(self, typed: bool) -> None:
        node, a = self.source.node, self.source.node.args
        if a.vararg or a.kwarg:
            self.refuse(node, "an argument with *", "name every argument")
        for argument in self.source.arguments:
            if typed and argument.annotation is None:
                self.refuse(
                    argument,
                    f"{argument.arg} without a type",
                    f"write `{argument.arg}: float`, or the named tuple that it is",
                )
        body = node.body[1:] if ast.get_docstring(node, clean=False) is not None else node.body
        for statement in body:
            for each in ast.walk(statement):  # what stands outside comes before what is in it
                self.node(each)
        if not _returns(body):
            self.refuse(node, "an end without return", "return a value on every way")

    def node(self, node: ast.AST) -> None:
        kind = type(node)
        if kind in INSTEAD:
            self.refuse(node, *INSTEAD[kind])
        check = getattr(self, f"on_{kind.__name__.lower()}", None)
        if check is not None:
            check(node)
        elif isinstance(node, ast.expr) and kind not in PLAIN:
            self.refuse(node, "this expression", "use arithmetic")
        elif isinstance(node, ast.stmt) and kind not in PLAIN:
            self.refuse(node, "a statement that does nothing to the result", "leave it out")

    # -- statements --------------------------------------------------------------------------------

    def on_assign(self, node: ast.Assign) -> None:
        pending = list(node.targets)
        while pending:
            target = pending.pop()
            if isinstance(target, ast.Tuple):
                pending += target.elts
            elif isinstance(target, ast.Attribute):
                self.refuse(
                    target,
                    "an assignment to a field",
                    "named tuples do not change; make a new one, as in State(t.a, b)",
                )
            elif not isinstance(target, ast.Name):
                self.refuse(target, "an assignment to an element", "assign to a name")

    def on_annassign(self, node: ast.AnnAssign) -> None:
        if node.value is None or not isinstance(node.target, ast.Name):
            self.refuse(node, "a declaration", "assign a value to a name")

    def on_augassign(self, node: ast.AugAssign) -> None:
        if not isinstance(node.target, ast.Name):
            self.refuse(node, "a declaration", "assign a value to a name")
        self.operator(node.op, node, node.value)

    def on_return(self, node: ast.Return) -> None:
        if node.value is None:
            self.refuse(node, "a return of nothing", "return a value")

    def on_for(self, node: ast.For) -> None:
        call = node.iter
        literal = (
            isinstance(call, ast.Call)
            and isinstance(call.func, ast.Name)
            and call.func.id == "range"
            and not call.keywords
            and all(_whole(a) is not None for a in call.args)
        )
        if not literal or not isinstance(node.target, ast.Name) or node.orelse:
            self.refuse(
                node,
                "a loop over anything but a literal range",
                "write `for i in range(4):`, which is unrolled",
            )

    # -- expressions -------------------------------------------------------------------------------

    def operator(self, op: ast.AST, node: ast.AST, right: ast.expr) -> None:
        if type(op) not in ARITHMETIC:
            what, instead = INSTEAD_OF_OPERATOR.get(type(op), ("this operator", "use + - * /"))
            self.refuse(node, what, instead)
        if isinstance(op, ast.Pow) and _whole(right) is None:
            self.refuse(
                right,
                "a power with anything but a whole number",
                "write sqrt(a), or exp(b * log(a))",
            )

    def on_binop(self, node: ast.BinOp) -> None:
        self.operator(node.op, node, node.right)

    def on_unaryop(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.Invert):
            self.refuse(node, *INSTEAD_OF_OPERATOR[ast.Invert])

    def on_constant(self, node: ast.Constant) -> None:
        if not (node.value is None or isinstance(node.value, bool | int | float)):
            what = "a string" if isinstance(node.value, str) else f"{node.value!r}"
            self.refuse(node, what, "an equation knows real numbers only; use options for choices")

    def on_subscript(self, node: ast.Subscript) -> None:
        if not self.is_index(node.slice):
            self.refuse(node, "an index that is no whole number", "write the number, as in s[0]")

    def is_index(self, index: ast.expr) -> bool:
        """Whether an index is arithmetic of whole numbers and counters of loops."""
        if isinstance(index, ast.BinOp):
            known = type(index.op) in (ast.Add, ast.Sub, ast.Mult)
            return known and self.is_index(index.left) and self.is_index(index.right)
        counter = isinstance(index, ast.Name) and index.id in self.counters
        return counter or _whole(index) is not None

    def on_compare(self, node: ast.Compare) -> None:
        for op, right in zip(node.ops, node.comparators, strict=True):
            if isinstance(op, ast.Is | ast.IsNot):
                if not (isinstance(right, ast.Constant) and right.value is None):
                    self.refuse(node, "`is` with anything but None", "write `==`")
            elif type(op) not in COMPARISONS:
                self.refuse(node, "`in`", "compare with == and or")

    def on_call(self, node: ast.Call) -> None:
        function = node.func
        if node in self.ranges:
            return
        if any(each.arg is None for each in node.keywords):
            self.refuse(node, "an argument with **", "write the arguments out")
        if not isinstance(function, ast.Name | ast.Attribute):
            self.refuse(node, "a call of an expression", "call equations by their names")
        base = function if isinstance(function, ast.Name) else function.value
        outside = isinstance(base, ast.Name) and base.id not in self.local
        if isinstance(function, ast.Name) and not outside:
            self.refuse(
                node, f"a call of the argument {function.id}", "call equations by their names"
            )
        if not outside:
            assert isinstance(function, ast.Attribute)
            self.refuse(
                node,
                f"the method {function.attr}",
                "call equations; a named tuple is made anew, as in State(t.a, b)",
            )
        assert isinstance(base, ast.Name)
        try:
            found = self.source.resolve(base.id)
            if isinstance(function, ast.Attribute):
                found = getattr(found, function.attr, None)
        except NameError:
            return  # defined further down, or missing: seen when it is wanted
        if found is not None:
            self.callee(node, ast.unparse(function), found)

    def callee(self, node: ast.Call, name: str, found: Any) -> None:
        """Refuse what certainly is no equation; a name may still be given to one later."""
        if found in MATH or found in CHOICES or is_named_tuple(found):
            return
        if isinstance(plain(found), FunctionType):
            return
        short = name.rpartition(".")[2]
        if getattr(builtins, short, None) is found and short in INSTEAD_OF_BUILTIN:
            self.refuse(node, f"a call of {name}", INSTEAD_OF_BUILTIN[short])
        if getattr(math, short, None) is not None:
            known = ", ".join(MATH.values())
            self.refuse(node, f"a call of {name}", f"of math an equation may call {known}")
        if callable(found):
            self.refuse(node, f"a call of {name}", "call equations and functions of math only")


def _returns(body: list[ast.stmt]) -> bool:
    """Whether every way through some statements ends in a return."""
    return any(
        isinstance(each, ast.Return)
        or (isinstance(each, ast.If) and _returns(each.body) and _returns(each.orelse))
        for each in body
    )


def _whole(node: ast.expr) -> int | None:
    """Value of a literal whole number, or nothing."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        value = _whole(node.operand)
        return None if value is None else -value
    if isinstance(node, ast.Constant) and type(node.value) is int:
        return node.value
    return None


def whole(node: ast.expr) -> int:
    """Value of a literal whole number that has been checked."""
    value = _whole(node)
    assert value is not None
    return value


def has_return(statements: Iterable[ast.stmt]) -> bool:
    """Whether a return stands anywhere in the statements."""
    return any(
        isinstance(each, ast.Return)
        or (isinstance(each, ast.If) and (has_return(each.body) or has_return(each.orelse)))
        or (isinstance(each, ast.For) and has_return(each.body))
        for each in statements
    )
