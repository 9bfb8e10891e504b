"""Derivatives of equations: from the source of a value, the source of value and partials.

Reverse mode within a function: a forward sweep as written, with calls replaced by the callee's
value and partials, then adjoints backwards. A branch that returns ends its own sweep; a branch that
merges carries both. What the result follows nowhere is a structural zero: it has no entry.

Conventions where a derivative does not exist:

- Of `min` and `max` at a tie the last argument counts; `abs` at zero counts as rising.
- A conditional expression has the derivative of the side that is taken; decisions and `floor`
  have none.
- Where `sqrt`, `asin`, `acos`, `hypot` or `atan2` have an infinite slope or none, it counts as 0.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar

from swashplate.equations import expressions as ex
from swashplate.equations.derived import Derived, function_name, listing, result_paths, word
from swashplate.equations.equation import inlined, module_of
from swashplate.equations.expressions import ONE, ZERO, Node, make, minus, negative, times
from swashplate.equations.lowering import GENERATING, declare, lower
from swashplate.equations.program import (
    Body,
    Choice,
    Fork,
    Invoke,
    Item,
    Let,
    Open,
    Primitive,
    Program,
    Tuple,
    Value,
    actual,
    leaves,
    paths,
    shapes_of,
)
from swashplate.equations.rules import of_repeated, of_root, of_rule, of_table
from swashplate.equations.syntax import parsed
from swashplate.equations.writing import Call, Cond, Define, Names, Region, Result, written

F = TypeVar("F", bound=Callable[..., Any])


# --- declared rules -------------------------------------------------------------------------------


def declared(function: Any) -> Callable[[F], F]:
    """Declare the derivatives of an equation, where the generated ones would not do.

    Parameters
    ----------
    function : equation
        Whose derivatives they are.

    Returns
    -------
    decorator
        Of an equation with the same arguments that returns the partials by every float among them,
        in order (for several results one result after the other). A literal 0.0 is a structural
        zero.

    Examples
    --------
    >>> @declared(small_arctangent)  # doctest: +SKIP
    ... def _(t: float) -> float:
    ...     return 1.0 / (1.0 + t * t)
    """

    def decorate(rule: F) -> F:
        parsed(rule, typed=False)
        compiled: F = inlined(rule)
        declare(function, compiled)
        _made.clear()
        return compiled

    return decorate


# --- derive ---------------------------------------------------------------------------------------


def derive(
    function: Any,
    by: str | tuple[str, ...],
    outputs: str | tuple[str, ...] | None = None,
    options: Mapping[str, Any] | None = None,
    lengths: Mapping[str, int] | None = None,
) -> Derived:
    """Value and partial derivatives of an equation, as a function made from its source.

    Parameters
    ----------
    function : equation
        What is differentiated.
    by : str or tuple of str
        Dotted paths of arguments; a path to a tuple means all floats below it. Without any, the
        function has the values alone, with the options decided.
    outputs : str or tuple of str, optional
        Dotted paths of the wanted results; all if omitted. A single float is called "value".
    options : mapping, optional
        Of argument paths to None or True, or to a tuple of options. Branches on them are decided
        here, so that the structure of zeros is exact.
    lengths : mapping, optional
        Lengths of arguments of type ``tuple[float, ...]``.

    Returns
    -------
    Derived

    Raises
    ------
    EquationError
        If a path is unknown, an option that is tested has no value, or the equation uses what
        equations may not.
    """
    with GENERATING:
        shapes = shapes_of(function, dict(options or {}), dict(lengths or {}))
        program = lower(function, shapes)
        inputs = _expanded(program, (by,) if isinstance(by, str) else tuple(by))
        wanted = _wanted(program, (outputs,) if isinstance(outputs, str) else outputs)
        return _derived(program, inputs, wanted)


def _expanded(program: Program, by: tuple[str, ...]) -> tuple[str, ...]:
    """Paths of floats below some paths of arguments."""
    floats = {
        p: n.kind
        for name, v in program.arguments
        for p, (_, n) in zip(paths(name, v), leaves(v), strict=True)
    }
    followed = {p for moving in program.moving for p in moving}
    for path in sorted(followed - floats.keys(), key=lambda p: (len(p), p)):
        floats[path] = "float"  # an element of a tuple of unknown length
    out: list[str] = []
    for path in by:
        below = [p for p in floats if p == path or p.startswith(path + ".")]
        below = [p for p in below if floats[p] == "float"]
        if not below:
            first = path.split(".")[0]
            known = [n for n, _ in program.arguments]
            offer = [p for p in floats if p.startswith(first + ".")] if first in known else known
            program.source.refuse(
                None, f"no float at {path}", f"there are {', '.join(offer) or 'none below it'}"
            )
        out += [p for p in below if p not in out]
    return tuple(out)


def _wanted(program: Program, outputs: tuple[str, ...] | None) -> tuple[int, ...]:
    """Numbers of the wanted results."""
    known = result_paths(program)
    if outputs is None:
        return tuple(range(len(known)))
    out: list[int] = []
    for path in outputs:
        found = [i for i, p in enumerate(known) if p == path or p.startswith(path + ".")]
        if not found:
            program.source.refuse(None, f"no result {path}", f"there are {', '.join(known)}")
        out += [i for i in found if i not in out]
    return tuple(out)


_made: dict[tuple[Any, tuple[str, ...], tuple[int, ...], bool], Derived] = {}


def _derived(
    program: Program | Primitive,
    inputs: tuple[str, ...],
    outputs: tuple[int, ...] | None = None,
    chained: bool = False,
) -> Derived:
    if outputs is None:
        outputs = tuple(range(len(result_paths(program))))
    if isinstance(program, Primitive):
        if program.kind == "interpolate":
            return of_table(program, inputs)
        if program.kind == "root":
            return of_root(program, inputs, _derived)
        return of_repeated(program, inputs, lambda step, by: _derived(step, by, chained=True))
    key = program, inputs, outputs, chained
    if key not in _made:
        if program.rule is not None:
            _made[key] = of_rule(program, inputs, outputs)
        else:
            _made[key] = _Derivation(program, inputs, outputs, chained).derived()
    return _made[key]


class _Derivation:
    """One function's forward sweep and adjoints.

    With `chained` a result that others follow is swept once: their adjoints end at it, and go on
    with its derivatives. That is shorter where the results are links of one chain.
    """

    def __init__(
        self,
        program: Program,
        inputs: tuple[str, ...],
        outputs: tuple[int, ...],
        chained: bool = False,
    ) -> None:
        self.program, self.inputs, self.outputs = program, inputs, outputs
        self.chained = chained
        self.links: dict[str, dict[str, Node]] = {}
        """Results that are names, with their derivatives."""
        self.texts = {path: _text_of(program, path) for path in inputs}
        self.active = set(self.texts.values())
        self.meaning: dict[str, Node] = {}
        self.divisors: set[Node] = set()
        self.said: set[Node] = set()
        """Expressions of the forward sweep."""
        self.callees: dict[str, Derived] = {}
        self.names = Names(program)
        self.results: list[tuple[Result, list[Node], list[dict[str, Node]]]] = []

    def derived(self) -> Derived:
        program = self.program
        base = self.names.of(program.function, program.source.name)
        name = function_name(base, program, self.inputs, self.outputs)
        self.names.taken.add(name)
        top = Region()
        self.body(program.body, top, [])
        known = result_paths(program)
        entries = tuple(
            (o, i)
            for o in range(len(self.outputs))
            for i, path in enumerate(self.inputs)
            if any(g[o].get(self.texts[path], ZERO) is not ZERO for _, _, g in self.results)
        )
        for result, values, slopes in self.results:
            partials = [slopes[o].get(self.texts[self.inputs[i]], ZERO) for o, i in entries]
            result.values = [*values, *partials]
        says = f"{program.source.name} with its options decided"
        if self.inputs:
            says = f"{program.source.name} with its derivatives by {listing(self.inputs)}"
        where = f"{module_of(program.source.function)}, line {program.source.node.lineno}"
        source = written(name, program, top, self.names, says, where)
        callees = [d for n, d in self.callees.items() if n in self.names.used]
        return Derived(
            name,
            tuple(known[o] for o in self.outputs),
            self.inputs,
            entries,
            source,
            tuple(callees),
            self.names.objects(),
        )

    # -- forward -----------------------------------------------------------------------------------

    def body(self, body: Body, region: Region, tape: list[Any]) -> None:
        self.forward(body.items, region, tape)
        if isinstance(body.end, Fork):
            cond = Cond(body.end.test, region.child(), region.child(), last=True)
            self.divide(body.end.test)
            self.body(body.end.then, cond.then, list(tape))
            self.body(body.end.other, cond.other, list(tape))
            region.add(cond)
        else:
            self.finish(body.end, region, tape)

    def divide(self, node: Node) -> None:
        """Note what the forward sweep says, and what it divides by: that may be done again."""
        self.said.add(node.same)
        if node.op == "/":
            self.divisors.add(node.args[1])
        for each in node.args:
            self.divide(each)

    def suggest(self, node: Node, name: str) -> None:
        if node.same not in self.said:
            self.names.suggest(node, name)

    def moving(self, node: Node) -> bool:
        return not self.active.isdisjoint(node.moves)

    def forward(self, items: list[Item], region: Region, tape: list[Any]) -> None:
        for each in items:
            if isinstance(each, Let):
                self.divide(each.node)
                self.meaning[each.name] = each.node
                region.add(Define(each.name, each.node))
                if self.moving(each.node):
                    self.active.add(each.name)
                    tape.append(each)
            elif isinstance(each, Choice):
                cond = Cond(each.test, region.child(), region.child())
                tapes: tuple[list[Any], list[Any]] = ([], [])
                self.forward(each.then, cond.then, tapes[0])
                self.forward(each.other, cond.other, tapes[1])
                for name, one, two in each.merged:
                    self.divide(one)
                    self.divide(two)
                    cond.then.add(Define(name, one))
                    cond.other.add(Define(name, two))
                    if self.moving(one) or self.moving(two):
                        self.active.add(name)
                region.add(cond)
                tape.append((each, cond, tapes))
            else:
                self.invoke(each, region, tape)

    def invoke(self, call: Invoke, region: Region, tape: list[Any]) -> None:
        callee = call.callee
        results = [n for _, n in leaves(call.result)]
        order = dict.fromkeys(p for moving in callee.moving for p in moving)
        given = {p: actual(call, p) for p in order}
        by = tuple(p for p, n in given.items() if n is not None and self.moving(n))
        derived = _derived(callee, by) if by or _decided(callee) else None
        if derived is None or not (derived.entries or _decided(callee)):
            function = self.names.of(callee.function, _called(callee))
            inner = self.names.inner(callee)
            first = () if inner is None else (inner,)
            region.add(Call(function, first, call.arguments, call.result, []))
            return
        self.callees[derived.name] = derived
        partials: list[str] = []
        moved: dict[str, list[tuple[Node, Node]]] = {n.value: [] for n in results}
        for o, i in derived.entries:
            path = derived.inputs[i]
            tail = path.rpartition(".")[2]
            tail = path.replace(".", "_") if tail.isdigit() else tail
            partial = self.names.fresh(f"{results[o].value}_by_{tail}")
            partials.append(partial)
            argument = given[path]
            assert argument is not None
            moved[results[o].value].append((ex.name(partial), argument))
            self.active.add(results[o].value)
        flat = [n.value for n in results]
        region.add(Call(derived.name, (), call.arguments, None, [*flat, *partials]))
        tape.append((call, moved))

    # -- backward ----------------------------------------------------------------------------------

    def finish(self, end: Value, region: Region, tape: list[Any]) -> None:
        nodes = [n for _, n in leaves(end)]
        known = result_paths(self.program)
        for node in nodes:
            self.divide(node)
        found: dict[int, dict[str, Node]] = {}
        self.links = {}
        defined = [each.name for each in tape if isinstance(each, Let)] if self.chained else []
        place = {name: k for k, name in enumerate(defined)}
        # links first: a name that is defined earlier may be met on the way from a later one
        for o in sorted(self.outputs, key=lambda o: place.get(nodes[o].value, len(place))):
            bars: dict[str, Node] = {}
            label = "" if len(self.outputs) == 1 else known[o].replace(".", "_") + "_"
            self.push(nodes[o], ONE, (), bars)
            self.sweep(tape, bars, region, label)
            found[o] = bars
            for text in self.texts.values():
                if text in bars:
                    self.suggest(bars[text], f"d_{label}{word(text)}")
            if nodes[o].op == "name" and nodes[o].value in place:
                # by names, so that what is multiplied with them is written once
                self.links[nodes[o].value] = bars
        slopes = [found[o] for o in self.outputs]
        result = Result([])
        region.add(result)
        self.results.append((result, [nodes[o] for o in self.outputs], slopes))

    def sweep(self, tape: list[Any], bars: dict[str, Node], region: Region, label: str) -> None:
        """Carry adjoints backwards over what has been computed, down to the inputs."""
        for each in reversed(tape):
            if isinstance(each, Let):
                weight = bars.pop(each.name, ZERO)
                self.suggest(weight, f"d_{label}{each.name}")
                if each.name in self.links and weight is not ZERO:
                    for text, slope in self.links[each.name].items():
                        bars[text] = ex.plus(bars.get(text, ZERO), times(weight, slope))
                    continue
                self.push(each.node, weight, (), bars)
            elif isinstance(each[0], Invoke):
                for name, moved in each[1].items():
                    weight = bars.pop(name, ZERO)
                    self.suggest(weight, f"d_{label}{name}")
                    for partial, argument in moved:
                        self.push(argument, times(weight, partial), (), bars)
            else:
                choice, forward, tapes = each
                self.choice(choice, forward, tapes, bars, region, label)

    def choice(
        self,
        choice: Choice,
        forward: Cond,
        tapes: tuple[list[Any], list[Any]],
        bars: dict[str, Node],
        region: Region,
        label: str,
    ) -> None:
        weights = {n: bars.pop(n) for n, _, _ in choice.merged if n in bars}
        if not weights:
            return
        cond = Cond(choice.test, region.child(forward.then), region.child(forward.other))
        ways: list[dict[str, Node]] = []
        for side, arm in enumerate((cond.then, cond.other)):
            own = dict(bars)
            for name, first, second in choice.merged:
                if name in weights:
                    self.push(second if side else first, weights[name], (), own)
            self.sweep(tapes[side], own, arm, label)
            ways.append(own)
        one, two = ways
        for text in [*one, *(t for t in two if t not in one)]:
            first, second = one.get(text, ZERO), two.get(text, ZERO)
            if first is not second:
                name = self.names.fresh(f"d_{label}{word(text)}")
                cond.then.add(Define(name, first))
                cond.other.add(Define(name, second))
                bars[text] = ex.name(name)
            else:
                bars[text] = first
        region.add(cond)

    def push(
        self,
        node: Node,
        weight: Node,
        guards: tuple[tuple[Node, bool], ...],
        bars: dict[str, Node],
    ) -> None:
        """Add `weight` times the derivatives of an expression to the adjoints of its names.

        `guards` are tests on which that depends. They are applied last, because what an untaken
        side computes may be infinite, unless nothing but signs comes in between.
        """
        if weight is ZERO or not self.moving(node):
            return
        if guards and _light(node):
            weight, guards = ex.masked(guards, weight), ()
        op, args = node.op, node.args
        if op == "name":
            amount = ex.masked(guards, weight)
            bars[node.value] = ex.plus(bars.get(node.value, ZERO), amount)
        elif op in ("min", "max"):
            first = args[0] if len(args) == 2 else make(op, *args[:-1])
            test = make("<" if op == "min" else ">", first, args[-1])
            self.push(first, weight, (*guards, (test, True)), bars)
            self.push(args[-1], weight, (*guards, (test, False)), bars)
        elif op == "if":
            self.push(args[1], weight, (*guards, (args[0], True)), bars)
            self.push(args[2], weight, (*guards, (args[0], False)), bars)
        else:
            for argument, slope in self.slopes(node):
                if self.moving(argument):
                    self.push(argument, slope(weight), guards, bars)

    def slopes(self, node: Node) -> Iterator[tuple[Node, Callable[[Node], Node]]]:
        """Operands of an operation, each with what the weight becomes on the way to it."""
        op, args = node.op, node.args
        a = args[0]
        b = args[-1]
        if op == "neg":
            yield a, negative
        elif op in ("+", "-"):
            yield a, lambda w: w
            yield b, (lambda w: w) if op == "+" else negative
        elif op == "*" and a is b:
            yield a, lambda w: times(ex.number(2.0), times(w, a))
        elif op == "*":
            yield a, lambda w: times(w, b)
            yield b, lambda w: times(w, a)
        elif op == "/":
            by = ex.inverse(b)
            yield a, lambda w: times(w, by)
            yield b, lambda w: negative(times(times(w, by), node))
        elif op == "**":
            n = node.value
            if n:
                rest = ONE if n == 1 else a if n == 2 else make("**", a, value=n - 1)
                yield a, lambda w: times(times(ex.number(float(n)), w), rest)
        elif op == "abs":
            test = make(">=", a, ZERO)
            yield a, lambda w: ex.choose(test, w, negative(w))
        elif op == "atan2":
            by = self.over(ex.plus(make("*", a, a), make("*", b, b)))
            yield a, lambda w: times(w, times(b, by))
            yield b, lambda w: negative(times(w, times(a, by)))
        elif op == "hypot":
            by = self.over(node)
            yield a, lambda w: times(w, times(a, by))
            yield b, lambda w: times(w, times(b, by))
        elif op != "floor":
            slope = self.slope(op, a, node)
            yield a, lambda w: times(w, slope)

    def slope(self, op: str, a: Node, node: Node) -> Node:
        """Derivative of a function of one number, from its argument and its value."""
        square = make("*", a, a)
        if op == "sqrt":
            return times(ex.number(0.5), self.over(node))
        if op == "exp":
            return node
        if op == "log":
            return ex.inverse(a)
        if op == "sin":
            return make("cos", a)
        if op == "cos":
            return negative(make("sin", a))
        if op == "tan":
            return ex.plus(ONE, make("*", node, node))
        if op == "atan":
            return ex.inverse(ex.plus(ONE, square))
        arc = self.over(make("sqrt", minus(ONE, square)))
        return negative(arc) if op == "acos" else arc

    def over(self, node: Node) -> Node:
        """1 over something not negative; 0 where it is zero, if it can be."""
        if node in self.divisors or ex.positive(node, self.meaning.get):
            return ex.inverse(node)
        return ex.finite_inverse(node)


def _light(node: Node) -> bool:
    """Whether nothing but signs and literal factors lie between an expression and its names."""
    if node.op in ex.LEAVES:
        return True
    if node.op == "*":
        return any(ex.is_number(a) for a in node.args) and all(_light(a) for a in node.args)
    return node.op in ("+", "-", "neg") and all(_light(a) for a in node.args)


def _decided(callee: Program | Primitive) -> bool:
    """Whether an equation takes options, so that a form of it in which they are decided is less."""
    return isinstance(callee, Program) and "Flag(" in repr(callee.shapes)


def _called(callee: Program | Primitive) -> str:
    return callee.kind if isinstance(callee, Primitive) else callee.source.name


def _text_of(program: Program, path: str) -> str:
    """Text of an argument's scalar from its dotted path."""
    first, *rest = path.split(".")
    value: Value = dict(program.arguments)[first]
    for each in rest:
        if isinstance(value, Open):
            return f"{value.text}[{each}]"
        assert isinstance(value, Tuple)
        value = value.items[value.fields.index(each)]
    assert isinstance(value, Node)
    return str(value.value)
