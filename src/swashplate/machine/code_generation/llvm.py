"""The graph printed in LLVM's language: of one number, or of many side by side.

`Code` writes one function with loops, and `Code.values` writes nodes into it. If it is `wide`, each
number is a vector, and nothing else changes. Arithmetic is strict: an instruction for each
operation, in the order of the equations, and no branches, as both ways of a decision are computed
and one result is taken.

Whole numbers are floats here as well: up to 2⁵³ they are the same.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager

from swashplate.machine import graph
from swashplate.machine.code_generation.loops import Inner, Loop
from swashplate.machine.code_generation.root_search import ROOT_SEARCH
from swashplate.machine.code_generation.values import leaves
from swashplate.machine.graph import Node, make, ordered, plain_value

TESTS = {"<": "olt", "<=": "ole", ">": "ogt", ">=": "oge", "==": "oeq", "!=": "une"}
"""Comparisons; a number that is none is only unequal."""
ARITHMETIC = {"+": "fadd", "-": "fsub", "*": "fmul", "/": "fdiv"}
OWN = {"sqrt", "exp", "log", "sin", "cos", "fabs", "floor"}
"""Functions that LLVM knows by itself; others are those of C."""
SYMBOL = "code"
"""Name of every function within its own module."""


class Code:
    """A function under way, which returns nothing.

    Parameters
    ----------
    arguments : sequence of (str, str)
        Type in LLVM's words and name of each.
    wide : int
        How many numbers stand side by side; 0 for one.
    """

    def __init__(self, arguments: Sequence[tuple[str, str]], wide: int = 0) -> None:
        self.wide = wide
        self._arguments = arguments
        self._lines: list[str] = []
        self._slots: list[str] = []
        self._declared: set[str] = set()
        self._count = 0
        self._results: dict[Node, list[str]] = {}
        """Of each call."""
        self._arrays: dict[tuple[str, ...], str] = {}
        self.places: dict[Node, tuple[str, int]] = {}
        """Array and place of numbers that stand in one and do not change."""
        self.lines: dict[Node, Callable[[str, int], str]] = {}
        """Of samples what reads those before them: of the whole number of samples, and the lane."""

    @property
    def text(self) -> str:
        """Text of a module with the function alone, by the name of `SYMBOL`."""
        formals = ", ".join(
            f"{kind} {'noalias ' if kind == 'ptr' else ''}%{name}" for kind, name in self._arguments
        )
        return "\n".join(
            [
                f"define void @{SYMBOL}({formals}) nounwind {{",
                "entry:",
                *self._slots,
                *self._lines,
                "  ret void",
                "}",
                *(f"declare {each}" for each in sorted(self._declared)),
                "",
            ]
        )

    @property
    def number(self) -> str:
        """LLVM's type of a number."""
        return f"<{self.wide} x double>" if self.wide else "double"

    @property
    def bit(self) -> str:
        """LLVM's type of a test."""
        return f"<{self.wide} x i1>" if self.wide else "i1"

    @contextmanager
    def side_by_side(self, wide: int) -> Iterator[None]:
        """Write what follows for so many numbers at once."""
        before, self.wide = self.wide, wide
        yield
        self.wide = before

    # -- instructions ------------------------------------------------------------------------------

    def put(self, instruction: str) -> str:
        """Append an instruction; the name of its value."""
        self._count += 1
        name = f"%v{self._count}"
        self._lines.append(f"  {name} = {instruction}")
        return name

    def do(self, instruction: str) -> None:
        """Append an instruction without a value."""
        self._lines.append(f"  {instruction}")

    def constant(self, value: float) -> str:
        """A literal number, or test."""
        if isinstance(value, bool):
            one, kind = "true" if value else "false", "i1"
        else:
            (bits,) = struct.unpack("<Q", struct.pack("<d", float(value)))
            one, kind = f"0x{bits:016X}", "double"
        return f"splat ({kind} {one})" if self.wide else one

    def select(self, test: str, if_true: str, if_false: str, kind: str | None = None) -> str:
        """One of two numbers."""
        kind = kind or self.number
        return self.put(f"select {self.bit} {test}, {kind} {if_true}, {kind} {if_false}")

    def element(self, vector: str, lane: int) -> str:
        """Number of a lane; without lanes the number itself."""
        if not self.wide:
            return vector
        return self.put(f"extractelement {self.number} {vector}, i32 {lane}")

    def joined(self, numbers: Sequence[str]) -> str:
        """Numbers of all lanes as one."""
        if not self.wide:
            return numbers[0]
        vector = "poison"
        for lane, number in enumerate(numbers):
            vector = self.put(f"insertelement {self.number} {vector}, double {number}, i32 {lane}")
        return vector

    def in_all_lanes(self, number: str) -> str:
        """One number for all lanes."""
        return self.vector(number, self.wide) if self.wide else number

    def vector(self, number: str, size: int) -> str:
        """A vector of one number."""
        kind = f"<{size} x double>"
        first = self.put(f"insertelement {kind} poison, double {number}, i32 0")
        return self.put(
            f"shufflevector {kind} {first}, {kind} poison, <{size} x i32> zeroinitializer"
        )

    def transposed(self, vectors: Sequence[str]) -> list[str]:
        """As many vectors as each has numbers, rows as columns."""
        size, result, apart = len(vectors), [*vectors], 1
        kind, lanes = f"<{size} x double>", range(size)
        while apart < size:  # halves of pairs are exchanged
            low = [lane if not lane & apart else size + lane - apart for lane in lanes]
            high = [lane + apart if not lane & apart else size + lane for lane in lanes]
            for i in (i for i in lanes if not i & apart):
                pair = f"{kind} {result[i]}, {kind} {result[i + apart]}"
                for place, mask in ((i, low), (i + apart, high)):
                    text = ", ".join(f"i32 {lane}" for lane in mask)
                    result[place] = self.put(f"shufflevector {pair}, <{size} x i32> <{text}>")
            apart *= 2
        return result

    # -- memory ------------------------------------------------------------------------------------

    def address(self, pointer: str, index: str | int, kind: str = "double") -> str:
        """Address of an element of an array; of a vector, of its first number among all."""
        if index == 0:
            return pointer
        element = kind if kind in ("i64", "ptr") else "double"
        return self.put(f"getelementptr inbounds {element}, ptr {pointer}, i64 {index}")

    def load(self, pointer: str, index: str | int = 0, kind: str | None = None) -> str:
        """A number from an array, by default as many side by side as there are lanes."""
        kind = kind or self.number
        return self.put(f"load {kind}, ptr {self.address(pointer, index, kind)}, align 8")

    def store(self, value: str, pointer: str, index: str | int = 0, kind: str = "") -> None:
        """Put a number into an array, by default as many side by side as there are lanes."""
        kind = kind or self.number
        self.do(f"store {kind} {value}, ptr {self.address(pointer, index, kind)}, align 8")

    def variable(self, value: str, kind: str | None = None) -> str:
        """Address of a number that loops change."""
        kind = kind or self.number
        self._count += 1
        name = f"%v{self._count}"
        self._slots.append(f"  {name} = alloca {kind}, align 64")
        self.do(f"store {kind} {value}, ptr {name}")
        return name

    def named(self, kind: str, name: str, word: str) -> None:
        """Give what a word of 64 bits holds a name, as if it were an argument."""
        made = {"ptr": "inttoptr", "double": "bitcast"}.get(kind)
        text = f"{made} i64 {word} to {kind}" if made else f"add i64 {word}, 0"
        self.do(f"%{name} = {text}")

    def pointer(self, address: str) -> str:
        """A pointer to what is at an address."""
        return self.put(f"inttoptr i64 {address} to ptr")

    # -- control -----------------------------------------------------------------------------------

    def _label(self, name: str) -> None:
        self._lines.append(f"{name}:")

    @contextmanager
    def as_long_as(self, test: Callable[[], str]) -> Iterator[None]:
        """Instructions that are done again and again while a test, computed anew, is true."""
        self._count += 1
        head, body, end = (f"{word}{self._count}" for word in ("while", "do", "end"))
        self.do(f"br label %{head}")
        self._label(head)
        self.do(f"br i1 {test()}, label %{body}, label %{end}")
        self._label(body)
        yield
        self.do(f"br label %{head}")
        self._label(end)

    @contextmanager
    def loop(self, start: str, stop: str, step: str | int = 1) -> Iterator[str]:
        """A loop over whole numbers, `stop` excluded; gives the counter."""
        counter = self.variable(start, "i64")
        at = ""

        def goes_on() -> str:
            nonlocal at
            at = self.load(counter, 0, "i64")
            return self.put(f"icmp slt i64 {at}, {stop}")

        with self.as_long_as(goes_on):
            yield at
            self.store(self.put(f"add nsw i64 {at}, {step}"), counter, 0, "i64")

    @contextmanager
    def only_if(self, test: str) -> Iterator[None]:
        """Instructions that are skipped unless one test, for all lanes, is true."""
        self._count += 1
        body, end = f"only{self._count}", f"end{self._count}"
        self.do(f"br i1 {test}, label %{body}, label %{end}")
        self._label(body)
        yield
        self.do(f"br label %{end}")
        self._label(end)

    def repeated(
        self,
        states: Mapping[Node, str],
        known: Mapping[Node, str],
        going: Node,
        body: Callable[[dict[Node, str]], list[str]],
    ) -> list[str]:
        """Do a body again and again while a test is true in a lane; what becomes of the states.

        A lane whose test is false keeps its states. `states` are their nodes with what they begin
        with; `body` is given what is known, and returns what the states become.
        """
        variables = [self.variable(text) for text in states.values()]
        before, within = list[str](), dict[Node, str]()

        def goes_on() -> str:
            before[:] = [self.load(variable) for variable in variables]
            within.update({**known, **dict(zip(states, before, strict=True))})
            (test,) = self.values([going], within)
            return self._in_any_lane(test)

        with self.as_long_as(goes_on):
            (test,) = self.values([going], within)
            for variable, old, new in zip(variables, before, body(within), strict=True):
                self.store(self.select(test, new, old) if self.wide else new, variable)
        return [self.load(variable) for variable in variables]

    def _in_any_lane(self, test: str) -> str:
        if not self.wide:
            return test
        symbol = f"llvm.vector.reduce.or.v{self.wide}i1"
        self._declared.add(f"i1 @{symbol}({self.bit})")
        return self.put(f"call i1 @{symbol}({self.bit} {test})")

    # -- nodes -------------------------------------------------------------------------------------

    def values(self, ends: Iterable[Node], known: dict[Node, str]) -> list[str]:
        """What computes some nodes.

        `known` has what is there already, and gets what is computed; the texts returned are those
        of the ends.
        """
        ends = [plain_value(end) for end in ends]
        for node in ordered(ends, known, computed_from):
            known[node] = self._value(node, known)
        return [known[end] for end in ends]

    def floats(self, ends: Iterable[Node], known: dict[Node, str]) -> list[str]:
        """What computes some nodes, tests as 0 and 1."""
        ends = [*ends]
        return [
            self._as_float(node, text)
            for node, text in zip(ends, self.values(ends, known), strict=True)
        ]

    def _as_float(self, node: Node, text: str) -> str:
        if node.kind != "bool":
            return text
        return self.put(f"uitofp {self.bit} {text} to {self.number}")

    def as_test(self, node: Node, text: str) -> str:
        """A node's value as a test: whether it is not zero."""
        if node.kind == "bool":
            return text
        return self.put(f"fcmp une {self.number} {text}, {self.constant(0.0)}")

    def _value(self, node: Node, known: Mapping[Node, str]) -> str:
        """What computes one node from its operands."""
        operands = [plain_value(operand) for operand in node.args]
        texts = [known[operand] for operand in operands]
        match node.op:
            case "number":
                return self.constant(node.value)
            case "name":
                raise KeyError(f"'{node.value}' is read, but is not known there.")
            case "call":
                self._results[node] = self._called_loop(node, operands, texts)
                return ""
            case "result":
                index: int = node.value
                return self._results[operands[0]][index]
            case "not":
                test = self.as_test(operands[0], texts[0])
                return self.put(f"xor {self.bit} {test}, {self.constant(True)}")
            case "if":
                return self._choice(node, operands, texts)
            case "element":
                return self._element(operands, texts)
            case "segment":
                return self._segment(operands, texts)
            case "past":
                return self._past(operands[0], *texts)
        floats = [
            self._as_float(operand, text) for operand, text in zip(operands, texts, strict=True)
        ]
        return self._operation(node, floats)

    def _choice(self, node: Node, operands: Sequence[Node], texts: Sequence[str]) -> str:
        """One of two values, which are there both."""
        test = self.as_test(operands[0], texts[0])
        if node.kind == "bool":
            _, if_true, if_false = operands
            if if_false is graph.FALSE:
                return self.put(f"and {self.bit} {test}, {texts[1]}")
            if if_true is graph.TRUE:
                return self.put(f"or {self.bit} {test}, {texts[2]}")
            return self.select(test, texts[1], texts[2], self.bit)
        sides = [
            self._as_float(operand, text)
            for operand, text in zip(operands[1:], texts[1:], strict=True)
        ]
        return self.select(test, *sides)

    def _element(self, operands: Sequence[Node], texts: Sequence[str]) -> str:
        """One of several numbers, by its number."""
        place, *elements = map(self._as_float, operands, texts)
        at = self._one_after_the_other(operands[1:], elements)
        found = []
        for lane in range(self.wide or 1):
            number = self.put(f"fptosi double {self.element(place, lane)} to i64")
            found.append(at(number, lane))
        return self.joined(found)

    def _segment(self, operands: Sequence[Node], texts: Sequence[str]) -> str:
        """The segment of a table that a number is in, walked to from the one before.

        From sample to sample it is most often the same: a processor guesses that, and goes on.
        """
        x, *knots = map(self._as_float, operands, texts)
        at = self._one_after_the_other(operands[1:], knots)
        found = []
        for lane in range(self.wide or 1):
            number, walked = self.element(x, lane), self._lasting()

            def goes_up(number: str = number, walked: str = walked, lane: int = lane) -> str:
                here = self.load(walked, 0, "i32")
                following = self.put(f"add i32 {here}, 1")
                knot = at(self.put(f"zext i32 {following} to i64"), lane)
                beyond = self.put(f"fcmp oge double {number}, {knot}")
                inside = self.put(f"icmp slt i32 {here}, {len(knots) - 2}")
                return self.put(f"and i1 {beyond}, {inside}")

            def goes_down(number: str = number, walked: str = walked, lane: int = lane) -> str:
                here = self.load(walked, 0, "i32")
                knot = at(self.put(f"zext i32 {here} to i64"), lane)
                below = self.put(f"fcmp olt double {number}, {knot}")
                inside = self.put(f"icmp sgt i32 {here}, 0")
                return self.put(f"and i1 {below}, {inside}")

            for goes_on, step in ((goes_up, 1), (goes_down, -1)):
                with self.as_long_as(goes_on):
                    here = self.load(walked, 0, "i32")
                    self.store(self.put(f"add i32 {here}, {step}"), walked, 0, "i32")
            found.append(self.put(f"sitofp i32 {self.load(walked, 0, 'i32')} to double"))
        return self.joined(found)

    def _lasting(self) -> str:
        """Address of a whole number that is 0 where the function begins."""
        self._count += 1
        name = f"%v{self._count}"
        self._slots += [f"  {name} = alloca i32, align 8", f"  store i32 0, ptr {name}"]
        return name

    def _one_after_the_other(
        self, nodes: Sequence[Node], texts: Sequence[str]
    ) -> Callable[[str, int], str]:
        """What loads one of several numbers, by its number and lane.

        From where they stand one after the other, or are put so.
        """
        places, lanes = [self.places.get(node) for node in nodes], self.wide or 1
        first = places[0]
        if first and places == [(first[0], first[1] + k * lanes) for k in range(len(places))]:
            array, begin = first
        else:
            array, begin = self._array(texts), 0

        def at(number: str, lane: int) -> str:
            number = self.put(f"mul i64 {number}, {lanes}") if lanes > 1 else number
            number = self.put(f"add i64 {number}, {begin + lane}")
            return self.load(array, number, "double")

        return at

    def _past(self, newest: Node, now: str, age: str) -> str:
        """What a value was at an age in samples, straight between them."""
        if newest not in self.lines:  # where a record begins nothing has changed yet
            return now
        read = self.lines[newest]
        newer, older = list[str](), list[str]()
        for lane in range(self.wide or 1):
            whole = self.put(f"fptosi double {self.element(age, lane)} to i64")
            newer.append(read(whole, lane))
            older.append(read(self.put(f"add i64 {whole}, 1"), lane))
        kind = self.number
        first, second = self.joined(newer), self.joined(older)
        fraction = self.put(f"fsub {kind} {age}, {self.function('floor', age)}")
        change = self.put(f"fsub {kind} {second}, {first}")
        change = self.put(f"fmul {kind} {fraction}, {change}")
        return self.put(f"fadd {kind} {first}, {change}")

    def _array(self, elements: Sequence[str]) -> str:
        """Address of numbers one after the other, of each all lanes."""
        key = tuple(elements)
        if key not in self._arrays:
            self._count += 1
            name = f"%v{self._count}"
            self._slots.append(f"  {name} = alloca [{len(elements)} x {self.number}], align 64")
            self._arrays[key] = name
        for place, text in enumerate(elements):
            self.store(text, self._arrays[key], place * (self.wide or 1))
        return self._arrays[key]

    def _operation(self, node: Node, floats: Sequence[str]) -> str:
        """An operation on numbers."""
        kind = self.number
        match node.op:
            case "+" | "-" | "*" | "/":
                first, second = floats
                result = self.put(f"{ARITHMETIC[node.op]} {kind} {first}, {second}")
                # a whole zero has no sign
                whole = node.kind == "int" and node.op == "*"
                return self.put(f"fadd {kind} {result}, {self.constant(0.0)}") if whole else result
            case "<" | "<=" | ">" | ">=" | "==" | "!=":
                first, second = floats
                return self.put(f"fcmp {TESTS[node.op]} {kind} {first}, {second}")
            case "neg" if node.kind == "int":
                return self.put(f"fsub {kind} {self.constant(0.0)}, {floats[0]}")
            case "neg":
                return self.put(f"fneg {kind} {floats[0]}")
            case "min" | "max":  # as Python: a later one only counts if it is beyond the first
                first, second = floats
                word = "olt" if node.op == "min" else "ogt"
                beyond = self.put(f"fcmp {word} {kind} {second}, {first}")
                return self.select(beyond, second, first)
            case "**":
                return self._power(floats[0], node.value)
        return self.function({"abs": "fabs"}.get(node.op, node.op), *floats)

    def _power(self, base: str, exponent: int) -> str:
        """By squaring, as compilers do."""
        product, remaining = self.constant(1.0), abs(exponent)
        while remaining:
            if remaining % 2:
                product = self.put(f"fmul {self.number} {product}, {base}")
            base = self.put(f"fmul {self.number} {base}, {base}")
            remaining //= 2
        if exponent >= 0:
            return product
        return self.put(f"fdiv {self.number} {self.constant(1.0)}, {product}")

    def function(self, name: str, *floats: str) -> str:
        """A function of LLVM, or of C lane by lane."""
        if name in OWN:
            symbol = f"llvm.{name}.{f'v{self.wide}' if self.wide else ''}f64"
            self._declared.add(f"{self.number} @{symbol}({', '.join([self.number] * len(floats))})")
            given = ", ".join(f"{self.number} {text}" for text in floats)
            return self.put(f"call {self.number} @{symbol}({given})")
        formals = ", ".join(["double"] * len(floats))
        self._declared.add(f"double @{name}({formals}) nounwind willreturn memory(none)")
        results = []
        for lane in range(self.wide or 1):
            given = ", ".join(f"double {self.element(text, lane)}" for text in floats)
            results.append(self.put(f"call double @{name}({given})"))
        return self.joined(results)

    # -- equations that are called apart -----------------------------------------------------------

    def _called_loop(self, call: Node, operands: Sequence[Node], texts: Sequence[str]) -> list[str]:
        """Results of an equation that is called once, or in a loop."""
        loop: Loop = call.value.loop
        inner = loop.inner
        if loop.kind == "once":
            return self._inner(inner, {}, dict(zip(self._formals(inner), texts, strict=True)))
        write = self._root if loop.kind == "root" else self._repetition
        return write(inner, texts)

    def _inner(
        self, inner: Inner, leading: Mapping[Node, str], formals: Mapping[Node, str]
    ) -> list[str]:
        """What an equation returns for numbers that stand for its arguments."""
        return self.values([node for _, node in leaves(inner.result)], {**leading, **formals})

    def _formals(self, inner: Inner) -> list[Node]:
        return [graph.name(name, kind) for name, kind in inner.formals.items()]

    def _leading(self, inner: Inner) -> list[Node]:
        return [graph.name(name, kind) for name, kind in inner.leading.items()]

    def _repetition(self, inner: Inner, texts: Sequence[str]) -> list[str]:
        """`repeated`: states after a step has been done ``count`` times."""
        *state, number = self._leading(inner)
        formals = dict(zip(self._formals(inner), texts[1 + len(state) :], strict=True))
        count = self.function("floor", texts[0])
        limit = graph.name("repeated$count")
        counter = graph.name("repeated$number")

        def once(known: dict[Node, str]) -> list[str]:
            leading = {node: known[node] for node in state} | {number: known[counter]}
            (following,) = self.values([make("+", counter, graph.ONE)], known)
            return [*self._inner(inner, leading, formals), following]

        begin = dict(zip(state, texts[1 : 1 + len(state)], strict=True))
        states = begin | {counter: self.constant(0.0)}
        going = make("<", counter, limit)
        return self.repeated(states, {limit: count}, going, once)[:-1]

    def _root(self, inner: Inner, texts: Sequence[str]) -> list[str]:
        """`root`: where a residual is zero between low and high."""
        (unknown,) = self._leading(inner)
        formals = dict(zip(self._formals(inner), texts[2:], strict=True))

        def residual(x: str) -> str:
            (value,) = self._inner(inner, {unknown: x}, formals)
            return value

        search = ROOT_SEARCH
        known = {search.low: texts[0], search.high: texts[1]}
        known |= {search.at_low: residual(texts[0]), search.at_high: residual(texts[1])}
        begin = self.values(search.begin, known)

        def once(within: dict[Node, str]) -> list[str]:
            (x,) = self.values([search.next_x], within)
            within[search.residual] = residual(x)
            return self.values(search.following, within)

        states = dict(zip(search.states, begin, strict=True))
        found = self.repeated(states, {}, search.going, once)
        known |= dict(zip(search.states, found, strict=True))
        return self.values([search.root], known)


def computed_from(node: Node) -> Sequence[Node]:
    """What a value is computed from: not its declared derivatives."""
    return [plain_value(operand) for operand in node.args]
