"""An oracle: a model's own equations run on numbers that carry their derivatives, sample by sample.

It shares nothing with the engine but the equations and the meaning of their arguments.
"""

import math
from types import FunctionType
from typing import Any, get_type_hints

import numpy as np

from swashplate.machine import Window
from swashplate.machine.fields import floats_of, value_at
from swashplate.machine.model import arguments_of, linear, mean_over_sample, previous


class Tangent:
    """A number with its derivatives by all parameters."""

    def __init__(self, value: float, by: Any) -> None:
        self.value, self.by = value, by

    def __add__(self, other: Any) -> "Tangent":
        other = lifted(other)
        return Tangent(self.value + other.value, self.by + other.by)

    def __mul__(self, other: Any) -> "Tangent":
        other = lifted(other)
        by = self.by * other.value + self.value * other.by
        return Tangent(self.value * other.value, by)

    def __truediv__(self, other: Any) -> "Tangent":
        other = lifted(other)
        ratio = self.value / other.value
        return Tangent(ratio, (self.by - ratio * other.by) / other.value)

    def __neg__(self) -> "Tangent":
        return Tangent(-self.value, -self.by)

    def __abs__(self) -> "Tangent":
        return self if self.value >= 0.0 else -self

    def __pow__(self, n: int) -> "Tangent":
        return Tangent(self.value**n, n * self.value ** (n - 1) * self.by)

    def __sub__(self, other: Any) -> "Tangent":
        return self + -lifted(other)

    def __rsub__(self, other: Any) -> "Tangent":
        return lifted(other) - self

    def __rtruediv__(self, other: Any) -> "Tangent":
        return lifted(other) / self

    __radd__, __rmul__ = __add__, __mul__

    def __lt__(self, other: Any) -> bool:
        return self.value < lifted(other).value

    def __le__(self, other: Any) -> bool:
        return self.value <= lifted(other).value

    def __gt__(self, other: Any) -> bool:
        return self.value > lifted(other).value

    def __ge__(self, other: Any) -> bool:
        return self.value >= lifted(other).value

    def __eq__(self, other: object) -> bool:
        return bool(self.value == lifted(other).value)

    __hash__ = None  # type: ignore[assignment]


def lifted(number: Any) -> Tangent:
    """A number as one that nothing moves."""
    return number if isinstance(number, Tangent) else Tangent(number, 0.0)


SLOPES = {
    "sqrt": lambda x: 0.5 / math.sqrt(x),
    "exp": math.exp,
    "log": lambda x: 1.0 / x,
    "sin": math.cos,
    "cos": lambda x: -math.sin(x),
    "tan": lambda x: 1.0 + math.tan(x) ** 2,
    "asin": lambda x: 1.0 / math.sqrt(1.0 - x * x),
    "atan": lambda x: 1.0 / (1.0 + x * x),
    "tanh": lambda x: 1.0 - math.tanh(x) ** 2,
}


def function(name: str) -> Any:
    """A function of `math` on tangents."""

    def called(x: Any) -> Any:
        number = getattr(math, name)(lifted(x).value)
        return Tangent(number, SLOPES[name](lifted(x).value) * lifted(x).by)

    return called


def on_tangents(equation: Any, known: dict[Any, Any]) -> Any:
    """An equation, and all that it calls, on tangents."""
    f = getattr(equation, "py_func", equation)
    if not isinstance(f, FunctionType):
        return equation
    if f not in known:
        space = dict(f.__globals__)
        known[f] = FunctionType(f.__code__, space, f.__name__, f.__defaults__, f.__closure__)
        for name in f.__code__.co_names:
            found = space.get(name)
            if name in SLOPES and found is getattr(math, name):
                space[name] = function(name)
            elif isinstance(found, FunctionType):
                space[name] = on_tangents(found, known)
    return known[f]


def nested(kind: Any, numbers: dict[str, Any], prefix: str) -> Any:
    """A named tuple of numbers by path; those that it lacks have their defaults."""
    hints = get_type_hints(kind)
    values = []
    for name in kind._fields:
        inner = hasattr(hints[name], "_fields")
        path = f"{prefix}{name}"
        values.append(
            nested(hints[name], numbers, f"{path}.")
            if inner
            else numbers.get(path, kind._field_defaults.get(name))
        )
    return kind(*values)


def rested(instance: Any, i: int, p: Any, h: float, known: dict[Any, Any]) -> Any:
    """State of a part at rest: every signal is zero, or what its default parameter is."""
    part, numbers = instance.model.parts[i], instance.parts[i]
    if part.rest is None:
        zeros = {path: lifted(0.0) for path in floats_of(part.state)}
        defaults = {n: lifted(float(v)) for n, v in part.state._field_defaults.items()}
        return nested(part.state, zeros | defaults, "")
    have = {"p": p, "h": h, "options": numbers.options, "given": numbers.given}
    inputs = []
    for name in part.input_types:
        width = part.tap(name).width
        value = Window((0.0,) * width, 0.0) if width else lifted(0.0)
        have[name] = value_at(p, part.defaults[name]) if name in part.defaults else value
        inputs.append(have[name])
    if part.inputs is not None:
        have["inputs"] = part.inputs(*inputs)
    rest = on_tangents(part.rest, known)
    found = rest(*(have[each] for each in arguments_of(part.rest)))
    return nested(part.state, {n: lifted(value_at(found, n)) for n in floats_of(part.state)}, "")


def marched(
    instance: Any, records: dict[str, Any], h: float, output: str, *, begins: bool = True
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) signal from rest and (n, k) derivatives by all parameters, in the model's order.

    If not `begins`, the state at rest counts as given, whatever parameters it follows from.
    """
    model, known = instance.model, dict[Any, Any]()
    paths = [
        f"{model.prefix(i)}{path}"
        for i, part in enumerate(model.parts)
        for path in floats_of(part.parameters)
    ]
    unit = np.eye(len(paths))
    numbers = [
        Tangent(float(value_at(instance.parts[i].p, path)), unit[k])
        for k, (i, path) in enumerate(
            (i, path) for i, part in enumerate(model.parts) for path in floats_of(part.parameters)
        )
    ]
    by_path = dict(zip(paths, numbers, strict=True))
    p = [nested(part.parameters, by_path, model.prefix(i)) for i, part in enumerate(model.parts)]
    states = [rested(instance, i, p[i], h, known) for i in range(len(model.parts))]
    if not begins:
        states = [
            nested(
                part.state,
                {path: lifted(value_at(state, path).value) for path in floats_of(part.state)},
                "",
            )
            for part, state in zip(model.parts, states, strict=True)
        ]
    records = {name: [*map(float, record)] for name, record in records.items()}
    holds = {"linear": linear, "previous": previous, "mean": mean_over_sample}
    size = len(next(iter(records.values())))
    values, slopes = np.zeros(size), np.zeros((size, len(paths)))
    between: dict[tuple[int, str], list[Any]] = {}
    for n in range(size):
        signals: dict[tuple[int, str], Any] = {}
        following = []
        for i, part in enumerate(model.parts):
            numbers_of = instance.parts[i]
            have = {"p": p[i], "h": h, "options": numbers_of.options, "given": numbers_of.given}
            have["state"] = states[i]
            inputs = []
            for name in part.input_types:
                link, tap = model.link_of(i, name), part.tap(name)
                past: Any = records.get(tap.signal)
                if link is not None:
                    args = [signals[source.part, source.signal] for source in link.sources]
                    value = args[0] if link.equation is None else link.equation(*args)
                    past = between.setdefault((i, name), [])
                    past.append(value)
                if link is not None and name not in part.taps:
                    pass
                elif past is None:
                    value = value_at(p[i], part.defaults[name])
                elif name not in part.taps:
                    value = float(records[tap.signal][n])
                else:
                    delay = value_at(p[i], tap.delay) if tap.delay else lifted(0.0)
                    late = delay * (1.0 / h)
                    late = late - tap.ahead if late.value > tap.ahead else lifted(0.0)
                    whole = math.floor(late.value)
                    window = tuple(
                        past[n - whole - j] if n >= whole + j else 0.0 for j in range(tap.samples)
                    )
                    value = Window(window, late - whole)
                    if not tap.width:
                        value = on_tangents(holds[tap.hold], known)(value)
                have[name] = value
                inputs.append(value)
            if part.inputs is not None:
                have["inputs"] = part.inputs(*inputs)
            if part.sample is not None:
                equation = on_tangents(part.sample, known)
                have["signals"] = equation(*(have[each] for each in arguments_of(part.sample)))
                for path in floats_of(part.signals):
                    signals[i, path] = value_at(have["signals"], path)
            for path in floats_of(part.state):
                signals.setdefault((i, path), value_at(states[i], path))
            equation = on_tangents(part.step, known)
            following.append(equation(*(have[each] for each in arguments_of(part.step))))
        shown = lifted(next(v for (_, name), v in reversed(signals.items()) if name == output))
        values[n], slopes[n] = shown.value, shown.by
        states = following
    return values, slopes
