"""What Numba does not know of named tuples: defaults in a construction, and `_replace`.

An equation that uses them is compiled from a tree in which they are written out; file and lines
stay those of its source.
"""

import ast
import copy
from collections.abc import Callable
from functools import cache
from types import CodeType, FunctionType
from typing import Any

from numba.extending import overload

from swashplate.equations.syntax import Parsed, is_named_tuple


@cache
def _replacing(fields: tuple[str, ...]) -> Callable[..., Any]:
    """A function that replaces some fields of a named tuple, known to Numba."""
    given = ", ".join(f"new_{f}" for f in fields)
    said = ", ".join(f"{f}=new_{f}" for f in fields)
    space: dict[str, Any] = {}
    exec(f"def replaced(t, {given}): return t._replace({said})", space)
    function: Callable[..., Any] = space["replaced"]

    def typed(t: Any, *new: Any) -> Any:
        if not hasattr(t, "instance_class"):
            return None
        items = ", ".join(f"new_{f}" if f in fields else f"t.{f}" for f in t.fields)
        inner: dict[str, Any] = {"cls": t.instance_class}
        exec(f"def build(t, {given}): return cls({items})", inner)
        return inner["build"]

    frame: dict[str, Any] = {"typed": typed}
    exec(f"def typing(t, {given}): return typed(t, {given})", frame)
    overload(function, inline="never")(frame["typing"])
    return function


class _Written(ast.NodeTransformer):
    def __init__(self, source: Parsed) -> None:
        self.source = source
        self.helpers: dict[str, Callable[..., Any]] = {}
        self.changed = False

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        if isinstance(node.func, ast.Name):
            try:
                found = self.source.resolve(node.func.id)
            except NameError:
                return node
            if is_named_tuple(found):
                return self.constructed(node, found)
        elif isinstance(node.func, ast.Attribute) and node.func.attr == "_replace":
            return self.replaced(node, node.func)
        return node

    def constructed(self, node: ast.Call, cls: Any) -> ast.Call:
        given = dict(zip(cls._fields, node.args, strict=False))
        given |= {k.arg: k.value for k in node.keywords}
        if list(given) == list(cls._fields) and not node.keywords:
            return node
        for field in cls._fields:
            if field not in given and field in cls._field_defaults:
                value = cls._field_defaults[field]
                if value is None or isinstance(value, bool | int | float):
                    given[field] = ast.copy_location(ast.Constant(value), node)
        if set(given) != set(cls._fields):
            return node  # refused where the equation is read
        self.changed = True
        arguments: list[ast.expr] = [given[f] for f in cls._fields]
        return ast.copy_location(ast.Call(node.func, arguments, []), node)

    def replaced(self, node: ast.Call, function: ast.Attribute) -> ast.Call:
        fields = tuple(k.arg for k in node.keywords if k.arg is not None)
        if node.args or not fields:
            return node
        name = f"replaced_{'_'.join(fields)}"
        self.helpers[name] = _replacing(fields)
        self.changed = True
        call = ast.copy_location(ast.Name(name, ast.Load()), node)
        arguments = [function.value, *(k.value for k in node.keywords)]
        return ast.copy_location(ast.Call(call, arguments, []), node)


def rewritten(source: Parsed) -> FunctionType:
    """The function that Numba is given for an equation: itself, unless it has to be rewritten."""
    f = source.function
    if not any(n == "_replace" or _is_class(source, n) for n in f.__code__.co_names):
        return f
    writer = _Written(source)
    node = writer.visit(copy.deepcopy(source.node))
    if not writer.changed:
        return f
    node.decorator_list = []
    node.returns = None
    for each in source.arguments:
        each = next(a for a in ast.walk(node) if isinstance(a, ast.arg) and a.arg == each.arg)
        each.annotation = None
    node.args.defaults = [ast.Constant(None) for _ in node.args.defaults]
    node.args.kw_defaults = [d and ast.Constant(None) for d in node.args.kw_defaults]
    free = dict(zip(f.__code__.co_freevars, f.__closure__ or (), strict=True))
    names = [*free, *writer.helpers]
    outer = ast.FunctionDef(
        "make", ast.arguments([], [ast.arg(n) for n in names], None, [], [], None, []),
        [node, ast.Return(ast.Name(node.name, ast.Load()))], [],
    )  # fmt: skip
    if hasattr(outer, "type_params"):
        outer.type_params = []
    module = ast.fix_missing_locations(ast.Module([outer], []))
    space: dict[str, Any] = {}
    exec(compile(module, f.__code__.co_filename, "exec"), space)
    code = next(c for c in space["make"].__code__.co_consts if isinstance(c, CodeType))
    cells = {**free, **{n: _cell(h) for n, h in writer.helpers.items()}}
    new = FunctionType(
        code, f.__globals__, f.__name__, f.__defaults__, tuple(cells[n] for n in code.co_freevars)
    )
    new.__kwdefaults__ = f.__kwdefaults__
    new.__annotations__ = f.__annotations__
    new.__doc__, new.__module__, new.__qualname__ = f.__doc__, f.__module__, f.__qualname__
    return new


def _is_class(source: Parsed, name: str) -> bool:
    try:
        return is_named_tuple(source.resolve(name))
    except NameError:
        return False


def _cell(value: Any) -> Any:
    return (lambda: value).__closure__[0]  # type: ignore[index]
