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
from types import BuiltinFunctionType, FunctionType
from typing import Any, NoReturn
from weakref import WeakKeyDictionary

from swashplate.errors import EquationError

MATH: dict[Any, str] = {
    getattr(math, name): name
    for name in (
        "sqrt exp log sin cos tan asin acos atan atan2 hypot floor".split()  # noqa: SIM905
    )
}
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

INSTEAD_OF_STATEMENT: dict[type[ast.AST], tuple[str, str]] = {
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
}
INSTEAD_OF_EXPRESSION: dict[type[ast.AST], tuple[str, str]] = {
    ast.Lambda: ("lambda", "write an equation of its own"),
    ast.ListComp: ("a comprehension", "write the terms out, or a loop over a literal range"),
    ast.SetComp: ("a comprehension", "write the terms out, or a loop over a literal range"),
    ast.DictComp: ("a comprehension", "write the terms out, or a loop over a literal range"),
    ast.GeneratorExp: ("a comprehension", "write the terms out, or a loop over a literal range"),
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
_called: "WeakKeyDictionary[FunctionType, Any]" = WeakKeyDictionary()
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


def called(function: FunctionType) -> Any:
    """What others call where they mean a plain function: its compiled form, where there is one."""
    return _called.get(function, function)


def enter(source: Parsed, compiled: Any) -> None:
    """Have the compiled form of an equation known by its source."""
    _called[source.function] = compiled
    _parsed[plain(compiled)] = source


def parsed(function: Any, typed: bool = True) -> Parsed:
    """Source of an equation, compiled or plain, checked once.

    Raises
    ------
    EquationError
        If there is no source, or something in it that an equation may not use.
    """
    f = plain(function)
    if not isinstance(f, FunctionType):
        raise EquationError(f"{function!r} is not a function that can be an equation.")
    if function is not f:
        _called[f] = function
    known = _parsed.get(f)
    if known is None:
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
        known = Parsed(f, node, _short(file))
        _Check(known).all(typed)
        _parsed[f] = known
    return known


def _short(file: str) -> str:
    """A file's path from the folder that Python imports from."""
    full = os.path.abspath(file)  # noqa: PTH100 - the name of a notebook's cell is no path
    starts = [os.path.abspath(each) + os.sep for each in sys.path if each]  # noqa: PTH100
    inside = [each for each in starts if full.startswith(each)]
    return full[len(max(inside, key=len)) :].replace(os.sep, "/") if inside else file


class _Check:
    """Goes once through the tree of an equation and refuses what does not belong there."""

    def __init__(self, source: Parsed) -> None:
        self.source = source
        self.refuse = source.refuse
        self.local = set(source.function.__code__.co_varnames)
        self.loops: list[str] = []

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
        body = node.body
        if self.text(body[0]):
            body = body[1:]
        self.statements(body)
        if not self.returns(body):
            self.refuse(node, "an end without return", "return a value on every way")

    @staticmethod
    def text(statement: ast.stmt) -> bool:
        """Whether a statement is a docstring."""
        return (
            isinstance(statement, ast.Expr)
            and isinstance(statement.value, ast.Constant)
            and isinstance(statement.value.value, str)
        )

    def returns(self, body: list[ast.stmt]) -> bool:
        """Whether every way through the statements ends in a return."""
        for each in body:
            if isinstance(each, ast.Return):
                return True
            if isinstance(each, ast.If) and self.returns(each.body) and self.returns(each.orelse):
                return True
        return False

    def statements(self, body: list[ast.stmt]) -> None:
        for each in body:
            kind = type(each)
            if kind is ast.Assign:
                for target in each.targets:  # type: ignore[attr-defined]
                    self.target(target)
                self.expression(each.value)  # type: ignore[attr-defined]
            elif isinstance(each, ast.AnnAssign | ast.AugAssign):
                if each.value is None or not isinstance(each.target, ast.Name):
                    self.refuse(each, "a declaration", "assign a value to a name")
                if isinstance(each, ast.AugAssign):
                    self.operator(each.op, each)
                    if isinstance(each.op, ast.Pow):
                        self.power(each.value)
                self.expression(each.value)
            elif isinstance(each, ast.If):
                self.expression(each.test)
                self.statements(each.body)
                self.statements(each.orelse)
            elif isinstance(each, ast.Return):
                if each.value is None:
                    self.refuse(each, "a return of nothing", "return a value")
                self.expression(each.value)
            elif isinstance(each, ast.For):
                self.loop(each)
            elif not isinstance(each, ast.Pass):
                what, instead = INSTEAD_OF_STATEMENT.get(
                    kind, ("a statement that does nothing to the result", "leave it out")
                )
                self.refuse(each, what, instead)

    def target(self, target: ast.expr) -> None:
        if isinstance(target, ast.Tuple):
            for each in target.elts:
                self.target(each)
        elif isinstance(target, ast.Attribute):
            self.refuse(
                target,
                "an assignment to a field",
                "named tuples do not change; use `t._replace(field=value)`",
            )
        elif not isinstance(target, ast.Name):
            self.refuse(target, "an assignment to an element", "assign to a name")

    def loop(self, each: ast.For) -> None:
        call = each.iter
        literal = (
            isinstance(call, ast.Call)
            and isinstance(call.func, ast.Name)
            and call.func.id == "range"
            and not call.keywords
            and all(_whole(a) is not None for a in call.args)
        )
        if not literal or not isinstance(each.target, ast.Name) or each.orelse:
            self.refuse(
                each,
                "a loop over anything but a literal range",
                "write `for i in range(4):`, which is unrolled",
            )
        self.loops.append(each.target.id)
        self.statements(each.body)
        self.loops.pop()

    def operator(self, op: ast.AST, node: ast.AST) -> None:
        if type(op) not in ARITHMETIC:
            what, instead = INSTEAD_OF_OPERATOR.get(type(op), ("this operator", "use + - * /"))
            self.refuse(node, what, instead)

    def power(self, exponent: ast.expr) -> None:
        if _whole(exponent) is None:
            self.refuse(
                exponent,
                "a power with anything but a whole number",
                "write sqrt(a), or exp(b * log(a))",
            )

    def expression(self, node: ast.expr) -> None:
        kind = type(node)
        if kind is ast.Name:
            return
        if isinstance(node, ast.Constant):
            if not (node.value is None or isinstance(node.value, bool | int | float)):
                self.refuse(
                    node,
                    "a string" if isinstance(node.value, str) else f"{node.value!r}",
                    "an equation knows real numbers only; use options for choices",
                )
        elif isinstance(node, ast.BinOp):
            self.operator(node.op, node)
            if isinstance(node.op, ast.Pow):
                self.power(node.right)
            self.expression(node.left)
            self.expression(node.right)
        elif kind is ast.Attribute:
            self.expression(node.value)  # type: ignore[attr-defined]
        elif isinstance(node, ast.Call):
            self.call(node)
        elif isinstance(node, ast.UnaryOp):
            if isinstance(node.op, ast.Invert):
                self.refuse(node, *INSTEAD_OF_OPERATOR[ast.Invert])
            self.expression(node.operand)
        elif isinstance(node, ast.Compare):
            self.comparison(node)
        elif isinstance(node, ast.BoolOp):
            for each in node.values:
                self.expression(each)
        elif isinstance(node, ast.IfExp):
            self.expression(node.test)
            self.expression(node.body)
            self.expression(node.orelse)
        elif isinstance(node, ast.Tuple):
            for each in node.elts:
                self.expression(each)
        elif isinstance(node, ast.Subscript):
            index = node.slice
            in_loop = isinstance(index, ast.Name) and index.id in self.loops
            if _whole(index) is None and not in_loop and not self.of_loop(index):
                self.refuse(
                    node, "an index that is no whole number", "write the number, as in s[0]"
                )
            self.expression(node.value)
        else:
            what, instead = INSTEAD_OF_EXPRESSION.get(kind, ("this expression", "use arithmetic"))
            self.refuse(node, what, instead)

    def of_loop(self, index: ast.expr) -> bool:
        """Whether an index is arithmetic of whole numbers and counters of loops."""
        if isinstance(index, ast.BinOp):
            return (
                type(index.op) in (ast.Add, ast.Sub, ast.Mult)
                and self.of_loop(index.left)
                and self.of_loop(index.right)
            )
        return _whole(index) is not None or (isinstance(index, ast.Name) and index.id in self.loops)

    def comparison(self, node: ast.Compare) -> None:
        terms = [node.left, *node.comparators]
        for op, right in zip(node.ops, node.comparators, strict=True):
            if isinstance(op, ast.Is | ast.IsNot):
                if not (isinstance(right, ast.Constant) and right.value is None):
                    self.refuse(node, "`is` with anything but None", "write `==`")
                terms.remove(right)
            elif type(op) not in COMPARISONS:
                self.refuse(node, "`in`", "compare with == and or")
        for each in terms:
            self.expression(each)

    def call(self, node: ast.Call) -> None:
        function = node.func
        if isinstance(function, ast.Name):
            name = function.id
            if name in self.local:
                self.refuse(node, f"a call of the argument {name}", "call equations by their names")
            try:
                found = self.source.resolve(name)
            except NameError:
                found = None  # defined further down, or missing: seen when it is wanted
            if found is not None:
                self.callee(node, name, found)
        elif isinstance(function, ast.Attribute):
            self.expression(function.value)
            if isinstance(function.value, ast.Name) and function.value.id not in self.local:
                try:
                    found = getattr(self.source.resolve(function.value.id), function.attr, None)
                except NameError:
                    found = None
                if found is not None:
                    self.callee(node, f"{function.value.id}.{function.attr}", found)
            elif function.attr != "_replace":
                self.refuse(
                    node, f"the method {function.attr}", "call equations; of methods, _replace"
                )
        else:
            self.refuse(node, "a call of an expression", "call equations by their names")
        for each in node.args:
            self.expression(each)
        for keyword in node.keywords:
            if keyword.arg is None:
                self.refuse(node, "an argument with **", "write the arguments out")
            self.expression(keyword.value)

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
        if isinstance(found, BuiltinFunctionType | type) or callable(found):
            self.refuse(node, f"a call of {name}", "call equations and functions of math only")


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
