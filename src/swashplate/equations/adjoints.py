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

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from swashplate.equations import expressions as ex
from swashplate.equations.code import Call, Choice, Code, Function, Item, Let, fresh_name
from swashplate.equations.expressions import ONE, ZERO, Node, make, minus, negative, times
from swashplate.equations.writing import function_text, named_by_text
from swashplate.errors import EquationError

Bars = dict[str, Node]
"""Adjoints by the names of what they belong to."""
Guards = tuple[tuple[Node, bool], ...]
Moved = dict[str, list[tuple[Node, Node]]]
"""Names that get their values together: partials of each, and what they are by."""
Tape = list["Moved | tuple[Choice, list[Tape]]"]
"""What moves, in the order in which it is done; of a choice its two sides."""


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
        self.taken, self.active = {*code.taken}, set(by)
        self.links: dict[str, Bars] = {}
        """Results that are names, with their derivatives."""
        self.divisors: set[Node] = set()
        self.said: set[Node] = set()
        """Expressions of the forward sweep."""
        self.hints: dict[Node, str] = {}
        self.items: list[Item] = []
        tape = self.forward(code.kept(results), self.items)
        for node in results:
            self.note(node)
        defined = [name for each in tape for name in _defined(each)] if chained else []
        place = {name: k for k, name in enumerate(defined)}
        found: dict[int, Bars] = {}
        # links first: a name that is defined earlier may be met on the way from a later one
        for o in sorted(range(len(results)), key=lambda o: place.get(results[o].value, len(place))):
            result, bars = results[o], Bars()
            stem = result.value if result.op == "name" else f"{o}"
            label = "" if len(results) == 1 else f"{_word(stem)}_"
            self.push(result, ONE, (), bars)
            self.sweep(tape, bars, self.items, label)
            found[o] = bars
            for name in by:
                self.suggest(bars.get(name, ZERO), f"d_{label}{_word(name)}")
            if result.op == "name" and result.value in place:
                # by names, so that what is multiplied with them is written once
                self.links[result.value] = bars
        self.entries = tuple(
            (o, i)
            for o in range(len(results))
            for i, n in enumerate(by)
            if found[o].get(n, ZERO) is not ZERO
        )
        self.partials = [found[o][by[i]] for o, i in self.entries]

    def note(self, node: Node) -> None:
        """Remember what the forward sweep says, and divides by: that may be done again."""
        self.said.add(node.same)
        if node.op == "/":
            self.divisors.add(node.args[1])
        for each in node.args:
            self.note(each)

    def suggest(self, node: Node, name: str) -> None:
        """Remember a name for an expression, unless the forward sweep has said it."""
        if node.same not in self.said and node.op not in ex.LEAVES:
            self.hints.setdefault(node.same, name)

    def moving(self, node: Node) -> bool:
        """Whether an expression follows what is differentiated by."""
        return not self.active.isdisjoint(node.moves)

    # -- forward -----------------------------------------------------------------------------------

    def forward(self, items: Sequence[Item], out: list[Item]) -> Tape:
        """Do what is written, and remember what moves."""
        tape: Tape = []
        for each in items:
            if isinstance(each, Choice):
                made = Choice(each.test, [], [], each.merged)
                sides = [self.forward(each.then, made.then), self.forward(each.other, made.other)]
                for name, *ends in each.merged:
                    for node in ends:
                        self.note(node)
                    if any(map(self.moving, ends)):
                        self.active.add(name)
                out.append(made)
                tape.append((made, sides))
                continue
            if isinstance(each, Let):
                self.note(each.node)
                out.append(each)
                moved: Moved = {each.name: [(ONE, each.node)]}
            elif isinstance(each, Call):
                moved = self.call(each, out)
            else:
                out += each.items
                pairs = zip(each.results, each.slopes, strict=True)
                moved = {name: [(b, a) for a, b in slopes] for name, slopes in pairs}
            moved = {n: [each for each in m if self.moving(each[1])] for n, m in moved.items()}
            self.active |= {name for name, each in moved.items() if each}
            tape.append(moved)
        return tape

    def call(self, call: Call, out: list[Item]) -> Moved:
        """Call a function with its derivatives, where its arguments move."""
        by = tuple(k for k, node in enumerate(call.arguments) if self.moving(node))
        if not by or call.derivative is None:
            out.append(call)
            return {}
        derived = call.derivative(by)
        partials: list[str] = []
        moved: Moved = {name: [] for name in call.results}
        for o, i in derived.entries:
            result = call.results[o]
            partials.append(fresh_name(f"{result}_by_{_word(derived.inputs[i])}", self.taken))
            moved[result].append((ex.name(partials[-1]), call.arguments[by[i]]))
        out.append(Call(derived, call.arguments, (*call.results, *partials)))
        return moved

    # -- backward ----------------------------------------------------------------------------------

    def sweep(self, tape: Tape, bars: Bars, out: list[Item], label: str) -> None:
        """Carry adjoints backwards over what has been computed, down to the inputs."""
        for each in reversed(tape):
            for known in [n for n in _defined(each) if n in self.links and n in bars]:
                weight = bars.pop(known)
                self.suggest(weight, f"d_{label}{known}")
                for name, slope in self.links[known].items():
                    bars[name] = ex.plus(bars.get(name, ZERO), times(weight, slope))
            if isinstance(each, tuple):
                self.choice(*each, bars, out, label)
                continue
            for name, moved in each.items():
                weight = bars.pop(name, ZERO)
                self.suggest(weight, f"d_{label}{name}")
                for partial, argument in moved:
                    self.push(argument, times(weight, partial), (), bars)

    def choice(
        self, choice: Choice, tapes: list[Tape], bars: Bars, out: list[Item], label: str
    ) -> None:
        """Carry adjoints back through both sides of a choice."""
        weights = {n: bars.pop(n) for n, _, _ in choice.merged if n in bars}
        if not weights:
            return
        made = Choice(choice.test, [], [], [], again=choice.number)
        ways: list[Bars] = []
        for side, arm in enumerate((made.then, made.other)):
            ways.append(dict(bars))
            for name, *nodes in choice.merged:
                self.push(nodes[side], weights.get(name, ZERO), (), ways[side])
            self.sweep(tapes[side], ways[side], arm, label)
        for name in {**ways[0], **ways[1]}:
            first, second = (way.get(name, ZERO) for way in ways)
            if first is not second:
                merged = fresh_name(f"d_{label}{_word(name)}", self.taken)
                made.merged.append((merged, first, second))
                first = ex.name(merged)
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
        elif op in ("min", "max", "if"):
            if op == "if":
                test, one, two = args
            else:
                one, two = args[0] if len(args) == 2 else make(op, *args[:-1]), args[-1]
                test = make("<" if op == "min" else ">", one, two)
            self.push(one, weight, (*guards, (test, True)), bars)
            self.push(two, weight, (*guards, (test, False)), bars)
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
        elif op == "**" and node.value:
            n = node.value
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
        elif op in FUNCTIONS:
            slope = FUNCTIONS[op](a, node, self.over)
            yield a, lambda w: times(w, slope)

    def over(self, node: Node) -> Node:
        """1 over something not negative; 0 where it is zero, if it can be."""
        return ex.inverse(node) if node in self.divisors else ex.finite_inverse(node)


def _arc(a: Node, over: Callable[[Node], Node]) -> Node:
    return over(make("sqrt", minus(ONE, make("*", a, a))))


FUNCTIONS: dict[str, Callable[[Node, Node, Callable[[Node], Node]], Node]] = {
    "sqrt": lambda a, value, over: times(ex.number(0.5), over(value)),
    "exp": lambda a, value, over: value,
    "log": lambda a, value, over: ex.inverse(a),
    "sin": lambda a, value, over: make("cos", a),
    "cos": lambda a, value, over: negative(make("sin", a)),
    "tan": lambda a, value, over: ex.plus(ONE, make("*", value, value)),
    "atan": lambda a, value, over: ex.inverse(ex.plus(ONE, make("*", a, a))),
    "tanh": lambda a, value, over: minus(ONE, make("*", value, value)),
    "asin": lambda a, value, over: _arc(a, over),
    "acos": lambda a, value, over: negative(_arc(a, over)),
}
"""Derivatives of functions of one number, from its argument, its value and `Derivatives.over`."""


def _defined(each: Moved | tuple[Choice, list[Tape]]) -> list[str]:
    """Names that get their values in a place of the tape."""
    return [name for name, _, _ in each[0].merged] if isinstance(each, tuple) else [*each]


def _light(node: Node) -> bool:
    """Whether nothing but signs and literal factors lie between an expression and its names."""
    if node.op == "*" and not any(ex.is_number(a) for a in node.args):
        return False
    return node.op in ("number", "name", "+", "-", "*", "neg") and all(map(_light, node.args))


def _word(path: str) -> str:
    """A path as part of a name."""
    return path.replace(".", "_").replace("[", "_").replace("]", "")


def listing(inputs: Sequence[str]) -> str:
    """Inputs, as far as one wants to read them."""
    return ", ".join(inputs) if len(inputs) <= 6 else f"{len(inputs)} inputs"
