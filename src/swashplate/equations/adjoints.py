"""Derivatives of straight code: a forward sweep as written, then adjoints backwards.

A choice that merges carries the adjoints of both its sides. What a result follows nowhere is a
structural zero: it has no entry.

Conventions where a derivative does not exist:

- Of `min` and `max` at a tie the last argument counts; `abs` at zero counts as rising.
- A conditional expression has the derivative of the side that is taken; decisions and `floor`
  have none.
- Where `sqrt`, `asin`, `acos`, `hypot` or `atan2` have an infinite slope or none, it counts as 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from swashplate.equations import expressions as ex
from swashplate.equations.code import Call, Choice, Code, Function, Item, Let, Rule, fresh_name
from swashplate.equations.expressions import ONE, ZERO, Node, make, minus, negative, times
from swashplate.equations.writing import function_text, named_by_text
from swashplate.errors import EquationError

Bars = dict[str, Node]
"""Adjoints by the names of what they belong to."""
Guards = tuple[tuple[Node, bool], ...]


@dataclass(frozen=True, eq=False, repr=False)
class Derived(Function):
    """A function that returns the values of an equation, then its partial derivatives.

    It takes the arguments of the equation and returns one flat tuple.

    Attributes
    ----------
    outputs, inputs : tuple of str
        Dotted paths of the wanted results and of what they are differentiated by.
    entries : tuple of (int, int)
        Numbers of output and input of each partial derivative that is not structurally zero, in
        the order in which they follow the values.
    """

    outputs: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    entries: tuple[tuple[int, int], ...] = ()


def derived_function(
    name: str,
    says: str,
    formals: Sequence[str],
    code: Code,
    results: Sequence[tuple[str, Node]],
    by: Sequence[tuple[str, str]],
    *,
    chained: bool = False,
) -> Derived:
    """The function of some results of ruled straight code, with their derivatives.

    `formals` are its arguments, `results` and `by` paths of what is returned and differentiated by,
    with nodes and names of them in the code; `name` may have `UNNAMED` in it.
    """
    found = Derivatives(code, [n for _, n in results], [n for _, n in by], chained=chained)
    values = [node for _, node in results]
    text, functions = function_text(name, says, formals, code, [*values, *found.partials], found)
    for each in formals:
        if each in ex.CALLED and f"{each}(" in text:
            raise EquationError(
                f"An argument is called {each}, and so is the function that its derivatives need: "
                "give the argument another name."
            )
    outputs, inputs = tuple(path for path, _ in results), tuple(path for path, _ in by)
    return Derived(*named_by_text(name, text), dict(functions), outputs, inputs, found.entries)


class Derivatives:
    """Some results of ruled straight code with their derivatives by some names, as straight code.

    `chained` is shorter where the results are links of one chain: one that others follow is swept
    once, their adjoints end at it, and go on with its derivatives. `items` lead to the results and
    to `partials`, of which `entries` has the numbers of result and name; what is structurally zero
    is not among them. `hints` are names for expressions, should they need one.
    """

    def __init__(
        self, code: Code, results: Sequence[Node], by: Sequence[str], *, chained: bool = False
    ) -> None:
        self.taken = {*code.taken}
        self.active = set(by)
        self.links: dict[str, Bars] = {}
        """Results that are names, with their derivatives."""
        self.meaning: dict[str, Node] = {}
        self.divisors: set[Node] = set()
        self.said: set[Node] = set()
        """Expressions of the forward sweep."""
        self.hints: dict[Node, str] = {}
        self.items: list[Item] = []
        tape: list[Any] = []
        self.forward(code.kept(results), self.items, tape)
        for node in results:
            self.divide(node)
        defined = [name for each in tape for name in _defined(each)] if chained else []
        place = {name: k for k, name in enumerate(defined)}
        found: dict[int, Bars] = {}
        # links first: a name that is defined earlier may be met on the way from a later one
        for o in sorted(range(len(results)), key=lambda o: place.get(results[o].value, len(place))):
            bars: Bars = {}
            stem = results[o].value if results[o].op == "name" else f"{o}"
            label = "" if len(results) == 1 else f"{_word(stem)}_"
            self.push(results[o], ONE, (), bars)
            self.sweep(tape, bars, self.items, label)
            found[o] = bars
            for name in by:
                if name in bars:
                    self.suggest(bars[name], f"d_{label}{_word(name)}")
            if results[o].op == "name" and results[o].value in place:
                # by names, so that what is multiplied with them is written once
                self.links[results[o].value] = bars
        self.entries = tuple(
            (o, i)
            for o in range(len(results))
            for i, n in enumerate(by)
            if found[o].get(n, ZERO) is not ZERO
        )
        self.partials = [found[o][by[i]] for o, i in self.entries]

    def divide(self, node: Node) -> None:
        """Note what the forward sweep says, and what it divides by: that may be done again."""
        self.said.add(node.same)
        if node.op == "/":
            self.divisors.add(node.args[1])
        for each in node.args:
            self.divide(each)

    def suggest(self, node: Node, name: str) -> None:
        """Remember a name for an expression, unless the forward sweep has said it."""
        if node.same not in self.said and node.op not in ex.LEAVES:
            self.hints.setdefault(node.same, name)

    def moving(self, node: Node) -> bool:
        """Whether an expression follows what is differentiated by."""
        return not self.active.isdisjoint(node.moves)

    # -- forward -----------------------------------------------------------------------------------

    def forward(self, items: Sequence[Item], out: list[Item], tape: list[Any]) -> None:
        """Do what is written, and remember what moves."""
        for each in items:
            if isinstance(each, Let):
                self.divide(each.node)
                self.meaning[each.name] = each.node
                out.append(each)
                if self.moving(each.node):
                    self.active.add(each.name)
                    tape.append(each)
            elif isinstance(each, Rule):
                out += [*each.items, *(Let(name, node) for name, node in each.results)]
                moved = {}
                for (name, _), slopes in zip(each.results, each.slopes, strict=True):
                    moved[name] = [(b, a) for a, b in slopes if self.moving(a)]
                    self.active |= {name} if moved[name] else set()
                tape.append(moved)
            elif isinstance(each, Choice):
                made = Choice(each.test, [], [], each.merged)
                tapes: tuple[list[Any], list[Any]] = ([], [])
                self.forward(each.then, made.then, tapes[0])
                self.forward(each.other, made.other, tapes[1])
                for name, one, two in each.merged:
                    self.divide(one)
                    self.divide(two)
                    if self.moving(one) or self.moving(two):
                        self.active.add(name)
                out.append(made)
                tape.append((made, tapes))
            else:
                self.call(each, out, tape)

    def call(self, call: Call, out: list[Item], tape: list[Any]) -> None:
        """Call a function with its derivatives, where its arguments move."""
        by = tuple(k for k, node in enumerate(call.arguments) if self.moving(node))
        if not by or call.derivative is None:
            out.append(call)
            return
        derived = call.derivative(by)
        partials: list[str] = []
        moved: dict[str, list[tuple[Node, Node]]] = {name: [] for name in call.results}
        for o, i in derived.entries:
            result = call.results[o]
            partials.append(fresh_name(f"{result}_by_{_word(derived.inputs[i])}", self.taken))
            moved[result].append((ex.name(partials[-1]), call.arguments[by[i]]))
            self.active.add(result)
        out.append(Call(derived, call.arguments, (*call.results, *partials)))
        tape.append(moved)

    # -- backward ----------------------------------------------------------------------------------

    def sweep(self, tape: list[Any], bars: Bars, out: list[Item], label: str) -> None:
        """Carry adjoints backwards over what has been computed, down to the inputs."""
        for each in reversed(tape):
            for known in [n for n in _defined(each) if n in self.links and n in bars]:
                weight = bars.pop(known)
                self.suggest(weight, f"d_{label}{known}")
                for name, slope in self.links[known].items():
                    bars[name] = ex.plus(bars.get(name, ZERO), times(weight, slope))
            if isinstance(each, Let):
                weight = bars.pop(each.name, ZERO)
                self.suggest(weight, f"d_{label}{each.name}")
                self.push(each.node, weight, (), bars)
            elif isinstance(each, dict):
                for name, moved in each.items():
                    weight = bars.pop(name, ZERO)
                    self.suggest(weight, f"d_{label}{name}")
                    for partial, argument in moved:
                        self.push(argument, times(weight, partial), (), bars)
            else:
                choice, tapes = each
                self.choice(choice, tapes, bars, out, label)

    def choice(
        self,
        choice: Choice,
        tapes: tuple[list[Any], list[Any]],
        bars: Bars,
        out: list[Item],
        label: str,
    ) -> None:
        """Carry adjoints back through both sides of a choice."""
        weights = {n: bars.pop(n) for n, _, _ in choice.merged if n in bars}
        if not weights:
            return
        made = Choice(choice.test, [], [], [], again=choice.number)
        ways: list[Bars] = []
        for side, arm in enumerate((made.then, made.other)):
            own = dict(bars)
            for name, *nodes in choice.merged:
                if name in weights:
                    self.push(nodes[side], weights[name], (), own)
            self.sweep(tapes[side], own, arm, label)
            ways.append(own)
        one, two = ways
        for name in {**one, **two}:
            first, second = one.get(name, ZERO), two.get(name, ZERO)
            if first is not second:
                merged = fresh_name(f"d_{label}{_word(name)}", self.taken)
                made.merged.append((merged, first, second))
                bars[name] = ex.name(merged)
            else:
                bars[name] = first
        out.append(made)

    def push(self, node: Node, weight: Node, guards: Guards, bars: Bars) -> None:
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
        a, b = args[0], args[-1]
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


def _defined(each: Any) -> Iterable[str]:
    """Names that get their values in a place of the tape."""
    if isinstance(each, Let):
        return (each.name,)
    return each if isinstance(each, dict) else (name for name, _, _ in each[0].merged)


def _light(node: Node) -> bool:
    """Whether nothing but signs and literal factors lie between an expression and its names."""
    if node.op in ex.LEAVES:
        return True
    if node.op == "*":
        return any(ex.is_number(a) for a in node.args) and all(_light(a) for a in node.args)
    return node.op in ("+", "-", "neg") and all(_light(a) for a in node.args)


def _word(path: str) -> str:
    """A path as part of a name."""
    return path.replace(".", "_").replace("[", "_").replace("]", "")


def listing(inputs: Sequence[str]) -> str:
    """Inputs, as far as one wants to read them."""
    return ", ".join(inputs) if len(inputs) <= 6 else f"{len(inputs)} inputs"
