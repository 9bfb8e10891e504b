"""Functions of numbers and addresses in LLVM's language, written from their text in Python.

What is generated from equations, and the loops around it, is a small part of Python: numbers and
pointers, arithmetic, comparisons, branches, loops over ranges. Types of all variables follow from
those of the arguments, and a function that is called is written out where it is. So nothing has to
be found out about it, and the same text runs uncompiled.

Arithmetic is strict, operation by operation as the text has it.
"""

from __future__ import annotations

import ast
import builtins
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple, TypeVar

from swashplate.equations.language import ARITHMETIC, COMPARISONS, MATH, plain, unchecked

F = TypeVar("F", bound=Callable[..., Any])

TYPES = {"bool": "i1", "int": "i64", "float": "double"}
"""LLVM's types of numbers, the wider ones later. A pointer is of the kind of what it points to,
with a star before it."""
KINDS = [*TYPES]
TESTS = {"<": "lt", "<=": "le", ">": "gt", ">=": "ge", "==": "eq", "!=": "ne"}
OPERATIONS = {"+": "add", "-": "sub", "*": "mul", "/": "div"}
OWN = {"sqrt", "exp", "log", "sin", "cos", "fabs", "floor"}
"""Functions that LLVM knows by itself; others are those of C."""


@dataclass(frozen=True, slots=True)
class Operand:
    """A number or a pointer: its kind, and what stands for it in the text."""

    kind: str
    text: str


class FunctionDefinition(NamedTuple):
    """A function that can be called: its tree, and what the names in it stand for."""

    tree: ast.FunctionDef
    space: Mapping[str, Any]


class _WidenedError(Exception):
    """A variable turned out to be of a wider kind than was assumed."""


LOWERED: dict[Any, Callable[..., Any]] = {}
"""What is written for a call of some functions, by these: it takes the `Lowering` and operands."""


def lowers(function: Any) -> Callable[[F], F]:
    """Declare what is written for a call of a function."""

    def declared(write: F) -> F:
        LOWERED[function] = write
        return write

    return declared


def function_definition_of(function: Any) -> FunctionDefinition:
    """A Python function, by its source."""
    function = plain(function)
    return FunctionDefinition(unchecked(function).node, function.__globals__)


def definition_in(text: str, name: str, library: Mapping[str, Any]) -> FunctionDefinition:
    """A function of a module's text, in which other names stand for what is in a library."""
    space = dict(library)
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef):
            space[node.name] = FunctionDefinition(node, space)
    definition: FunctionDefinition = space[name]
    return definition


def lowered(function: FunctionDefinition, kinds: Sequence[str], symbol: str) -> str:
    """Text of a module in LLVM's language with a function that returns nothing.

    Parameters
    ----------
    function : FunctionDefinition
        The function.
    kinds : sequence of str
        Of its arguments: "float", "int", or "*float" for a pointer to floats.
    symbol : str
        Its name in the module.
    """
    variable_kinds: dict[str, str] = {}
    while True:
        try:
            return Lowering(variable_kinds).function(function, kinds, symbol)
        except _WidenedError:
            continue


def not_lowered(node: ast.AST) -> TypeError:
    """An error for what no generated text may have: the writer of the text, not its user, reads it.

    What users write is checked by `language` long before, in sentences.
    """
    return TypeError(
        f"'{ast.unparse(node)}' cannot be lowered to LLVM: generate other text, or add it to "
        "swashplate.equations.code_generation.lowering."
    )


def llvm_type(kind: str) -> str:
    """LLVM's type of a kind."""
    return "ptr" if kind.startswith("*") else TYPES[kind]


def number(value: float) -> Operand:
    """A literal number."""
    if isinstance(value, bool):
        return Operand("bool", "true" if value else "false")
    if isinstance(value, int):
        return Operand("int", str(value))
    (bits,) = struct.unpack("<Q", struct.pack("<d", value))
    return Operand("float", f"0x{bits:016X}")


@dataclass
class Scope:
    """The names of a function while it is written out."""

    number: int
    space: Mapping[str, Any]
    end: str
    """Label after the function."""
    local: dict[str, Any] = field(default_factory=dict)
    """Names of what is not an operand: functions, tuples, fields."""
    result: Any = None
    """What it returns: an operand, or a tuple of them; None if nothing."""

    def key(self, name: str) -> str:
        """Name of a variable among those of all functions."""
        return f"{name}.{self.number}"

    def find(self, name: str) -> Any:
        """Meaning of a name that is not a variable."""
        if name in self.local:
            return self.local[name]
        return self.space[name] if name in self.space else getattr(builtins, name)


class Lowering:
    """Writes a function. `kinds` are those of its variables, as far as they are known."""

    def __init__(self, kinds: dict[str, str]) -> None:
        self._kinds = kinds
        self._variables: dict[str, str] = {}
        self._declared: dict[str, str] = {}
        self._lines: list[str] = []
        self._values = self._labels = self._scopes = 0
        self._block = "entry"
        self._loops: list[tuple[str, str]] = []
        """Of each loop around, where it goes on and where it ends."""

    def function(self, function: FunctionDefinition, kinds: Sequence[str], symbol: str) -> str:
        """Text of the module."""
        scope, formals = Scope(0, function.space, "return"), list[str]()
        for argument, kind in zip(function.tree.args.args, kinds, strict=True):
            value = Operand(kind, f"%argument{len(formals)}")
            formals.append(f"{llvm_type(kind)} {value.text}")
            self._store(scope.key(argument.arg), value)
        if self._body(function.tree.body, scope):
            self._jump(scope.end)
        self._begin(scope.end)
        lines = [
            f"define void @{symbol}({', '.join(formals)}) nounwind {{",
            "entry:",
            *self._variables.values(),
            *self._lines,
            "  ret void",
            "}",
            *self._declared.values(),
        ]
        return "\n".join([*lines, ""])

    # -- text --------------------------------------------------------------------------------------

    def emit(self, line: str) -> None:
        """Append an instruction without a value."""
        self._lines.append(f"  {line}")

    def operand(self, kind: str, text: str) -> Operand:
        """Append an instruction, and name its value."""
        self._values += 1
        name = f"%_{self._values}"
        self.emit(f"{name} = {text}")
        return Operand(kind, name)

    def declare(self, symbol: str, text: str) -> None:
        """Declare a function that is called."""
        self._declared[symbol] = f"declare {text}"

    def load(self, pointer: Operand, index: Operand) -> Operand:
        """An element of what a pointer points to."""
        kind = pointer.kind[1:]
        return self.operand(kind, f"load {llvm_type(kind)}, ptr {self.offset(pointer, index).text}")

    def offset(self, pointer: Operand, index: Operand) -> Operand:
        """A pointer to an element."""
        kind = llvm_type(pointer.kind[1:])
        text = f"getelementptr inbounds {kind}, ptr {pointer.text}, i64 {index.text}"
        return self.operand(pointer.kind, text)

    def _label(self, stem: str) -> str:
        """A name that no other label has, nor a variable: of one that is kept it has a dollar."""
        # counted apart from values, whose number changes if a variable turns out wider
        self._labels += 1
        return f"{stem}{self._labels}"

    def _begin(self, label: str) -> None:
        self._lines.append(f"{label}:")
        self._block = label

    def _jump(self, label: str) -> None:
        self.emit(f"br label %{label}")

    def _fork(self, test: Operand, if_true: str, if_false: str) -> None:
        self.emit(f"br i1 {test.text}, label %{if_true}, label %{if_false}")

    # -- variables ---------------------------------------------------------------------------------

    def _store(self, key: str, value: Operand) -> None:
        kind = self._kinds.setdefault(key, value.kind)
        if kind != value.kind and KINDS.index(value.kind) > KINDS.index(kind):
            self._kinds[key] = value.kind
            raise _WidenedError
        self._allocate(key, llvm_type(kind))
        self.emit(f'store {llvm_type(kind)} {self.cast(value, kind).text}, ptr %"{key}"')

    def _load(self, key: str) -> Operand:
        kind = self._kinds[key]
        self._allocate(key, llvm_type(kind))
        return self.operand(kind, f'load {llvm_type(kind)}, ptr %"{key}"')

    def _allocate(self, key: str, kind: str) -> None:
        # in quotes, as Python knows other letters, too
        self._variables.setdefault(key, f'  %"{key}" = alloca {kind}')

    def room(self, size: int) -> Operand:
        """Memory for some floats, all zero."""
        key = self._label("room$")
        self._allocate(key, f"[{size} x double]")
        self.declare("llvm.memset.p0.i64", "void @llvm.memset.p0.i64(ptr, i8, i64, i1)")
        room = Operand("*float", f'%"{key}"')
        self.emit(f"call void @llvm.memset.p0.i64(ptr {room.text}, i8 0, i64 {8 * size}, i1 false)")
        return room

    # -- statements --------------------------------------------------------------------------------

    def _body(self, statements: Sequence[ast.stmt], scope: Scope) -> bool:
        """Write statements; whether their end is reached."""
        return all(self._statement(statement, scope) for statement in statements)

    def _statement(self, node: ast.stmt, scope: Scope) -> bool:
        match node:
            case ast.Expr(value):
                if not isinstance(value, ast.Constant):
                    self._value(value, scope)
            case ast.Assign([target], value) | ast.AnnAssign(target, _, ast.expr() as value):
                self._put(target, self._value(value, scope), scope)
            case ast.AugAssign(target, op, value):
                self._put(target, self._value(ast.BinOp(target, op, value), scope), scope)
            case ast.If(test, then, other):
                return self._if(test, then, other, scope)
            case ast.For(ast.Name(name), ast.Call(ast.Name("range"), bounds), body):
                self._for(name, bounds, body, scope)
            case ast.While(test, body):
                self._while(test, body, scope)
            case ast.Break() | ast.Continue():
                self._jump(self._loops[-1][isinstance(node, ast.Break)])
                return False
            case ast.Return(value):
                self._return(None if value is None else self._value(value, scope), scope)
                return False
            case _:
                raise not_lowered(node)
        return True

    def _put(self, target: ast.expr, value: Any, scope: Scope) -> None:
        match target:
            case ast.Tuple(targets):
                for element, element_value in zip(targets, value, strict=True):
                    self._put(element, element_value, scope)
            case ast.Name(name) if isinstance(value, Operand):
                self._store(scope.key(name), value)
            case ast.Name(name):
                scope.local[name] = value
            case ast.Subscript(array, index):
                address = self.offset(self._value(array, scope), self._value(index, scope))
                kind = address.kind[1:]
                value = self.cast(value, kind)
                self.emit(f"store {llvm_type(kind)} {value.text}, ptr {address.text}")
            case _:
                raise not_lowered(target)

    def _if(
        self, test: ast.expr, then: list[ast.stmt], otherwise: list[ast.stmt], scope: Scope
    ) -> bool:
        then_label, else_label, end = self._label("then"), self._label("else"), self._label("end")
        self._fork(self._test(test, scope), then_label, else_label)
        reached = False
        for label, statements in ((then_label, then), (else_label, otherwise)):
            self._begin(label)
            if self._body(statements, scope):
                self._jump(end)
                reached = True
        if reached:
            self._begin(end)
        return reached

    def _for(self, name: str, bounds: list[ast.expr], body: list[ast.stmt], scope: Scope) -> None:
        values = [self._value(bound, scope) for bound in bounds]
        start = values[0] if len(values) > 1 else number(0)
        stop = values[min(len(values), 2) - 1]
        step = values[2].text if len(values) > 2 else "1"
        counter, head = self._label("counter$"), self._label("for")
        inside, onwards, end = self._label("do"), self._label("next"), self._label("end")
        self._store(counter, start)
        self._jump(head)
        self._begin(head)
        at = self._load(counter)
        self._fork(self.compared(">" if step.startswith("-") else "<", at, stop), inside, end)
        self._begin(inside)
        self._store(scope.key(name), at)
        self._loop(body, onwards, end, scope)
        self._begin(onwards)
        following = self.operand("int", f"add nsw i64 {self._load(counter).text}, {step}")
        self._store(counter, following)
        self._jump(head)
        self._begin(end)

    def _while(self, test: ast.expr, body: list[ast.stmt], scope: Scope) -> None:
        """Write a ``while`` loop: a block that tests, one that does the body and one after it."""
        head, inside, end = self._label("while"), self._label("do"), self._label("end")
        self._jump(head)
        self._begin(head)
        self._fork(self._test(test, scope), inside, end)
        self._begin(inside)
        self._loop(body, head, end, scope)
        self._begin(end)

    def _loop(self, body: list[ast.stmt], onwards: str, end: str, scope: Scope) -> None:
        """Write a loop's body, from which ``continue`` jumps `onwards` and ``break`` to `end`."""
        self._loops.append((onwards, end))
        if self._body(body, scope):
            self._jump(onwards)
        self._loops.pop()

    def _return(self, value: Any, scope: Scope) -> None:
        if value is not None:
            scope.result = value
            self._keep(scope.key("result$"), value)
        self._jump(scope.end)

    # -- expressions -------------------------------------------------------------------------------

    def _value(self, node: ast.expr, scope: Scope) -> Any:
        match node:
            case ast.Constant(bool() | int() | float() as value):
                return number(value)
            case ast.Name(name):
                key = scope.key(name)
                return self._load(key) if key in self._kinds else _constant(scope.find(name))
            case ast.Tuple(elements):
                return tuple(self._values_of(elements, scope))
            case ast.UnaryOp(ast.Not(), operand):
                return self.operand("bool", f"xor i1 {self._test(operand, scope).text}, true")
            case ast.UnaryOp(ast.USub(), ast.Constant(int() | float() as value)):
                return number(-value)
            case ast.UnaryOp(ast.USub(), operand):
                return self._negative(self._value(operand, scope))
            case ast.BinOp(base, ast.Pow(), exponent):
                return self._power(self._value(base, scope), ast.literal_eval(exponent))
            case ast.BinOp(left, op, right):
                return self._operation(op, self._value(left, scope), self._value(right, scope))
            case ast.Compare(left, [op], [right]):
                first, second = self._value(left, scope), self._value(right, scope)
                return self.compared(COMPARISONS[type(op)], first, second)
            case ast.BoolOp(op, tests):
                return self._joined(tests, scope, every=isinstance(op, ast.And))
            case ast.IfExp(test, then, other):
                return self._conditional(test, then, other, scope)
            case ast.Subscript(array, index):
                return self.load(self._value(array, scope), self._value(index, scope))
            case ast.Attribute(value, name):
                return self._value(value, scope).field(self, name)
            case ast.Call(ast.Name(name), arguments, []):
                return self._call(scope.find(name), self._values_of(arguments, scope))
        raise not_lowered(node)

    def _values_of(self, nodes: Sequence[ast.expr], scope: Scope) -> list[Any]:
        values: list[Any] = []
        for node in nodes:
            if isinstance(node, ast.Starred):
                values += self._value(node.value, scope)
            else:
                values.append(self._value(node, scope))
        return values

    def _test(self, node: ast.expr, scope: Scope) -> Operand:
        return self.cast(self._value(node, scope), "bool")

    def cast(self, value: Operand, kind: str) -> Operand:
        """A number as one of another kind."""
        if value.kind == kind:
            return value
        if kind == "bool":
            return self.compared("!=", value, number(0))
        if kind == "int":
            instruction = "fptosi double" if value.kind == "float" else "zext i1"
        else:
            instruction = "sitofp i64" if value.kind == "int" else "uitofp i1"
        return self.operand(kind, f"{instruction} {value.text} to {TYPES[kind]}")

    def alike(
        self, first: Operand, second: Operand, least: str = "bool"
    ) -> tuple[Operand, Operand]:
        """Two numbers as the wider one of their kinds, or one that is at least as wide."""
        kind = KINDS[max(map(KINDS.index, (first.kind, second.kind, least)))]
        return self.cast(first, kind), self.cast(second, kind)

    def compared(self, op: str, first: Operand, second: Operand) -> Operand:
        """A comparison."""
        first, second = self.alike(first, second)
        if first.kind == "float":  # NaN is only `!=`
            instruction = f"fcmp {'u' if op == '!=' else 'o'}{TESTS[op]}"
        else:
            # a test is one bit, which is -1 if it has a sign
            sign = "u" if first.kind == "bool" else "s"
            instruction = f"icmp {'' if op in ('==', '!=') else sign}{TESTS[op]}"
        return self.operand(
            "bool", f"{instruction} {TYPES[first.kind]} {first.text}, {second.text}"
        )

    def _negative(self, value: Operand) -> Operand:
        if value.kind == "float":
            return self.operand("float", f"fneg double {value.text}")
        return self.operand("int", f"sub i64 0, {self.cast(value, 'int').text}")

    def _operation(self, op: ast.operator, first: Operand, second: Operand) -> Operand:
        if isinstance(op, ast.BitAnd | ast.BitOr):
            first, second = self.alike(first, second)
            instruction = "and" if isinstance(op, ast.BitAnd) else "or"
        elif isinstance(op, ast.FloorDiv):  # of whole numbers that are not negative
            instruction = "sdiv"
        else:
            first, second = self.alike(first, second, "float" if isinstance(op, ast.Div) else "int")
            instruction = OPERATIONS[ARITHMETIC[type(op)]]
            instruction = f"f{instruction}" if first.kind == "float" else instruction
        return self.operand(
            first.kind, f"{instruction} {TYPES[first.kind]} {first.text}, {second.text}"
        )

    def _power(self, base: Operand, exponent: int) -> Operand:
        """By squaring, as compilers do."""
        product, remaining = number(1), abs(exponent)
        while remaining:
            if remaining % 2:
                product = self._operation(ast.Mult(), product, base)
            base, remaining = self._operation(ast.Mult(), base, base), remaining // 2
        one = number(1.0)
        return product if exponent >= 0 else self._operation(ast.Div(), one, product)

    def _joined(self, tests: list[ast.expr], scope: Scope, *, every: bool) -> Operand:
        """Tests that are made until one decides."""
        key, onwards, end = self._label("test$"), "", self._label("end")
        for index, test in enumerate(tests):
            decision = self._test(test, scope)
            self._store(key, decision)
            if index < len(tests) - 1:
                onwards = self._label("and" if every else "or")
                self._fork(decision, *((onwards, end) if every else (end, onwards)))
                self._begin(onwards)
        self._jump(end)
        self._begin(end)
        return self._load(key)

    def _conditional(
        self, test: ast.expr, then: ast.expr, otherwise: ast.expr, scope: Scope
    ) -> Any:
        """One of two numbers, or tuples of them, of which only that one is computed."""
        key = self._label("chosen$")
        then_label, else_label, end = self._label("then"), self._label("else"), self._label("end")
        self._fork(self._test(test, scope), then_label, else_label)
        result: Any = None
        for label, node in ((then_label, then), (else_label, otherwise)):
            self._begin(label)
            result = self._value(node, scope)
            self._keep(key, result)
            self._jump(end)
        self._begin(end)
        return self._stored_value(key, result)

    def _keep(self, key: str, value: Any) -> None:
        """Store a number, or each of a tuple."""
        if isinstance(value, Operand):
            self._store(key, value)
            return
        for index, element in enumerate(value):
            self._store(f"{key}.{index}", element)

    def _stored_value(self, key: str, like: Any) -> Any:
        """What was stored: a number, or a tuple as long as another."""
        if isinstance(like, Operand):
            return self._load(key)
        return tuple(self._load(f"{key}.{index}") for index in range(len(like)))

    def choice(self, test: Operand, if_true: Operand, if_false: Operand) -> Operand:
        """One of two numbers that both have been computed."""
        if_true, if_false = self.alike(if_true, if_false)
        kind, test = TYPES[if_true.kind], self.cast(test, "bool")
        text = f"select i1 {test.text}, {kind} {if_true.text}, {kind} {if_false.text}"
        return self.operand(if_true.kind, text)

    # -- calls -------------------------------------------------------------------------------------

    def _call(self, function: Any, arguments: list[Any]) -> Any:
        if isinstance(function, FunctionDefinition):
            return self._written_out(function, arguments)
        if function in LOWERED:
            return LOWERED[function](self, *arguments)
        return self._written_out(function_definition_of(function), arguments)

    def _written_out(self, function: FunctionDefinition, arguments: list[Any]) -> Any:
        """A function in the place of its call."""
        self._scopes += 1
        scope, formals = Scope(self._scopes, function.space, self._label("end")), function.tree.args
        for index, argument in enumerate(formals.args):
            self._put(ast.Name(argument.arg), arguments[index], scope)
        if formals.vararg is not None:
            scope.local[formals.vararg.arg] = tuple(arguments[len(formals.args) :])
        if self._body(function.tree.body, scope):
            self._jump(scope.end)
        self._begin(scope.end)
        return (
            None if scope.result is None else self._stored_value(scope.key("result$"), scope.result)
        )

    def called(self, name: str, *arguments: Operand) -> Operand:
        """A function of floats, of LLVM or of C."""
        symbol = f"llvm.{name}.f64" if name in OWN else name
        effect = "" if name in OWN else " nounwind willreturn memory(none)"
        formals = ", ".join("double" for _ in arguments)
        self.declare(symbol, f"double @{symbol}({formals}){effect}")
        texts = ", ".join(f"double {self.cast(argument, 'float').text}" for argument in arguments)
        return self.operand("float", f"call double @{symbol}({texts})")


def _constant(meaning: Any) -> Any:
    """A number that a name stands for; anything else as it is."""
    return number(meaning) if isinstance(meaning, bool | int | float) else meaning


# --- what Python has by itself --------------------------------------------------------------------


def _whole(code: Lowering, value: Operand) -> Operand:
    return code.cast(value, "int")


def _float(code: Lowering, value: Operand) -> Operand:
    return code.cast(value, "float")


def _floor(code: Lowering, value: Operand) -> Operand:
    return code.cast(code.called("floor", value), "int")


def _magnitude(code: Lowering, value: Operand) -> Operand:
    if value.kind == "float":
        return code.called("fabs", value)
    value = code.cast(value, "int")
    negative = code.operand("int", f"sub i64 0, {value.text}")
    return code.choice(code.compared("<", value, number(0)), negative, value)


def _extreme(op: str, code: Lowering, first: Operand, *others: Operand) -> Operand:
    """As Python does it: a later one only counts if it is beyond those before it."""
    for other in others:
        earlier, later = code.alike(first, other)
        first = code.choice(code.compared(op, later, earlier), later, earlier)
    return first


for _function, _name in MATH.items():
    LOWERED[_function] = lambda code, *operands, name=_name: code.called(name, *operands)
LOWERED |= {int: _whole, float: _float, abs: _magnitude}
LOWERED |= {min: partial(_extreme, "<"), max: partial(_extreme, ">")}
LOWERED |= {function: _floor for function, name in MATH.items() if name == "floor"}
