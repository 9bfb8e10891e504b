"""Every construct that an equation may use: value and derivatives against differences."""

import math
from math import acos, asin, atan2, cos, exp, floor, hypot, log, sin, sqrt, tan, tanh
from pathlib import Path
from runpy import run_path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.machine.differences import compared
from tests.machine.printed import assert_printed
from tests.marks import rest_slow

from swashplate.errors import EquationError
from swashplate.machine import declared, derive, equation, interpolate, repeated, root
from swashplate.machine.declaration import JIT_OFF, closure_hash

pytestmark = pytest.mark.interpreted

OFF, ON = None, True
GAIN = 1.5
KNOTS = (-1.0, 0.0, 0.5, 2.0)


class Options(NamedTuple):
    damped: bool | None = OFF
    doubled: bool | None = OFF


class Spring(NamedTuple):
    stiffness: float
    rest: float = 0.25


class Body(NamedTuple):
    mass: float
    spring: Spring
    drag: float = 0.5


class State(NamedTuple):
    position: float
    speed: float


class Pair(NamedTuple):
    left: State
    right: State


def check(
    function: Any,
    by: tuple[str, ...] | str,
    options: dict | None = None,
    lengths: dict | None = None,
    **arguments: Any,
) -> Any:
    """Compare value and partials with the function itself; return what was derived."""
    derived = derive(function, by, options=options, lengths=lengths)
    assert compared(getattr(function, "py_func", function), derived, arguments)
    decided = derive(function, (), options=options, lengths=lengths)
    exact = derived(*arguments.values())[: len(derived.outputs)]
    assert exact == decided(*arguments.values())
    assert_printed(function, derived, arguments, options, lengths)
    return derived


# --- statements -----------------------------------------------------------------------------------


@equation
def unpacked(x: float, y: float) -> tuple[float, float]:
    a, b = x * y, x + y
    a, b = b, a
    (c, d), e = (a * b, a - b), 3.0
    f = g = c * e
    return f + d, g - b


@equation
def looped(x: float, s: tuple[float, float, float]) -> float:
    total = 0.0
    for i in range(3):
        total = total * x + s[i]
        if total > 100.0:
            total = 100.0 / x
    for i in range(1, -1, -1):
        total += s[i + 1] * s[i] * x
    return total


def test_statements() -> None:
    check(unpacked, ("y", "x"), x=0.7, y=1.3)
    check(looped, ("x", "s"), x=0.7, s=(1.0, -0.4, 0.3))
    check(looped, ("x", "s.1"), x=30.0, s=(1.0, -0.4, 0.3))


# --- expressions ----------------------------------------------------------------------------------


@equation
def functions(x: float, y: float) -> tuple[float, float]:
    first = sqrt(x) + exp(-x) * log(y) + sin(x * y) - cos(x) / tan(y) + math.atan(x)
    second = asin(x / 2.0) * acos(y / 3.0) + atan2(y, x) + hypot(x, 2.0 * y) + floor(x) * y
    return first - tanh(x * y), second


@equation
def careful(x: float, y: float) -> float:
    """What must not be done unless the test says so."""
    a = 1.0 / x if x != 0.0 else 5.0 * y
    b = sqrt(x) if x > 0.0 else y
    if x > 0.0 and log(x) > 0.1:
        return a * b + log(x)
    if x <= 0.0 or 1.0 / x < 2.0:
        return a + b
    return a - b


def test_expressions() -> None:
    check(functions, ("x", "y"), x=0.7, y=1.3)
    for x in (2.0, 1.05, 0.7, 0.3, -1.0):
        check(careful, ("x", "y"), x=x, y=0.6)


def test_what_is_not_done_is_not_divided_by() -> None:
    derived = derive(careful, ("x", "y"))
    assert derived(0.0, 0.6) == (3.6, 0.0, 6.0)


# --- tuples ---------------------------------------------------------------------------------------


@equation
def accelerated(s: State, force: float, b: Body) -> float:
    return (force - b.spring.stiffness * (s.position - b.spring.rest) - b.drag * s.speed) / b.mass


@equation
def stepped(s: State, force: float, b: Body, h: float) -> State:
    a = accelerated(s, force, b)
    half = State(s.position + 0.5 * h * s.speed, speed=s.speed + 0.5 * h * a)
    again = accelerated(half, force, Body(b.mass, b.spring, drag=2.0 * b.drag))
    return State(position=s.position + h * half.speed, speed=s.speed + h * again)


@equation
def coupled(p: Pair, b: Body, h: float) -> Pair:
    pull = b.spring.stiffness * (p.right.position - p.left.position)
    left = stepped(p.left, pull, b, h)
    return Pair(
        left, stepped(p.right, -pull, Body(b.mass, Spring(b.spring.stiffness, 0.25), 0.5), h)
    )


def test_named_tuples() -> None:
    body = Body(2.0, Spring(3.0, 0.1), 0.4)
    pair = Pair(State(0.3, -0.2), State(0.5, 0.7))
    derived = check(stepped, ("s", "b"), s=pair.left, force=0.3, b=body, h=0.1)
    assert derived.outputs == ("position", "speed")
    assert derived.inputs[:3] == ("s.position", "s.speed", "b.mass")
    derived = check(coupled, ("p", "b.spring"), p=pair, b=body, h=0.1)
    assert derived.outputs[2] == "right.position"
    assert "b.spring.rest" in derived.inputs
    assert (2, derived.inputs.index("b.spring.rest")) not in derived.entries  # a default there


@equation
def windowed(s: tuple[float, ...], f: float) -> float:
    return s[0] + f * (s[1] - s[0])


@equation
def looked(s: tuple[float, ...], f: float, gain: float) -> float:
    return gain * windowed(s, f)


def test_tuples_of_any_length() -> None:
    with pytest.raises(EquationError, match=r"s .* length: .* lengths="):
        derive(looked, "s")
    lengths = {"s": 3}
    derived = check(looked, "s", lengths=lengths, s=(1.0, 2.0, 3.0), f=0.3, gain=2.0)
    assert derived.inputs == ("s.0", "s.1", "s.2")
    assert derived.entries == ((0, 0), (0, 1))


# --- options --------------------------------------------------------------------------------------


@equation
def optional(x: float, y: float, o: Options, extra: bool | None = None) -> float:
    z = x
    if o.damped is not None:
        z = z * exp(-y)
    factor = 2.0 if o.doubled is None else 4.0
    if extra is None and o.doubled is None:
        return z
    return factor * z * x


@equation
def forwarding(x: float, y: float, o: Options) -> float:
    return optional(x, y, o) + optional(x, y, Options(OFF, doubled=ON), True)


@pytest.mark.parametrize("damped", [OFF, ON])
@pytest.mark.parametrize("doubled", [OFF, ON])
def test_options_decide_what_there_is(damped: bool | None, doubled: bool | None) -> None:
    o = Options(damped, doubled)
    derived = check(optional, ("x", "y"), {"o": o, "extra": None}, x=0.7, y=1.3, o=o, extra=None)
    assert len(derived.entries) == (1 if damped is None else 2)
    said = {"o.damped": damped, "o.doubled": doubled}
    check(forwarding, ("x", "y"), said, x=0.7, y=1.3, o=o)


def test_an_option_that_is_tested_has_to_be_known() -> None:
    with pytest.raises(EquationError, match=r'option o.damped.*options=\{"o.damped": None\}'):
        derive(optional, "x")
    with pytest.raises(EquationError, match=r"option extra .* False"):
        derive(optional, "x", options={"o": Options(), "extra": False})


# --- activity -------------------------------------------------------------------------------------


def test_unknown_paths_are_refused() -> None:
    with pytest.raises(EquationError, match=r"no float at b\.size.*b\.mass"):
        derive(stepped, "b.size")
    with pytest.raises(EquationError, match=r"no float at q.*s, force, b, h"):
        derive(stepped, "q")


# --- rules and primitives -------------------------------------------------------------------------


@equation
def bent(x: float, y: float) -> float:
    return x * abs(x) + y


@declared(bent)
def _(x: float, y: float) -> tuple[float, float]:
    return 2.0 * abs(x), 1.0


def test_declared_rules() -> None:
    assert derive(bent, ("x", "y"))(-0.7, 1.3)[1:] == (1.4, 1.0)


@equation
def misruled(x: float, y: float) -> float:
    return x * y


@declared(misruled)
def _(x: float, y: float) -> float:
    return y


def test_a_rule_has_to_name_all_derivatives() -> None:
    with pytest.raises(EquationError, match=r"is not 2 in _: return those by x, y, in order"):
        derive(misruled, "x")


@equation
def table(x: float, a: float, v: tuple[float, float, float, float]) -> float:
    return a * interpolate(x * a, KNOTS, v)


@equation
def moving_table(x: float, k: tuple[float, float, float], v: tuple[float, float, float]) -> float:
    return interpolate(x, k, v) * x


class Knots(NamedTuple):
    low: float
    middle: float
    high: float


class Map(NamedTuple):
    """A table as parameters of a model hold it: named tuples of floats."""

    knots: Knots
    values: Knots


@equation
def table_of_fields(x: float, p: Map) -> float:
    return interpolate(x, p.knots, p.values) * x


@pytest.mark.parametrize("x", rest_slow([-0.6, -3.0, 0.1, 1.1, 4.0]))
def test_interpolation(x: float) -> None:
    check(table, ("x", "a", "v"), x=x, a=1.1, v=(0.3, -1.0, 2.0, 0.5))
    k, v = (-1.0, 0.5, 2.0), (0.3, -1.0, 2.0)
    check(moving_table, ("x", "k", "v"), x=x, k=k, v=v)
    check(table_of_fields, ("x", "p"), x=x, p=Map(Knots(*k), Knots(*v)))
    assert table_of_fields(x, Map(Knots(*k), Knots(*v))) == moving_table(x, k, v)


def test_a_knot_counts_to_its_right_and_ends_hold() -> None:
    derived = derive(moving_table, "x")
    k, v = (-1.0, 0.5, 2.0), (0.0, 1.5, 1.5)
    assert derived(0.5, k, v) == (0.75, 1.5)
    assert interpolate(-5.0, k, v) == 0.0
    assert interpolate(9.0, k, v) == 1.5


@equation
def excess(x: float, a: float, s: Spring) -> float:
    return x * x * x + s.stiffness * x - a - s.rest


@equation
def balanced(a: float, b: float, s: Spring) -> float:
    return b * root(excess, -b, 2.0 * b, a * a, s)


@equation
def counted_once(a: float, b: float) -> float:
    s, end = Spring(b, a), repeated(swung, 3.0, Swing(a, b), Spring(b, a), a)
    return root(excess, -3.0, 3.0, a, s) + end.angle


@pytest.mark.slow
def test_a_number_that_is_two_arguments_counts_once() -> None:
    check(counted_once, ("a", "b"), a=0.7, b=1.3)


def test_roots() -> None:
    spring = Spring(1.5, 0.1)
    x = root(excess, -3.0, 3.0, 0.7, spring)
    assert abs(excess(x, 0.7, spring)) < 4e-16
    check(balanced, ("a", "b", "s"), a=0.7, b=1.3, s=spring)
    # where there is no change of sign, an end of the bracket
    check(balanced, ("a", "b", "s"), a=9.0, b=1.3, s=spring)


@given(st.floats(-50.0, 50.0), st.floats(0.01, 9.0), st.floats(1e-6, 1e6))
def test_roots_to_the_last_bits(a: float, low: float, stiffness: float) -> None:
    spring = Spring(stiffness, 0.0)
    x = root(excess, -50.0 - low, 60.0, a, spring)
    scale = abs(x) ** 3 + stiffness * abs(x) + abs(a)
    assert abs(excess(x, a, spring)) <= 4e-15 * scale + 1e-30


class Swing(NamedTuple):
    angle: float
    rate: float


@equation
def swung(state: Swing, number: float, s: Spring, h: float) -> Swing:
    rate = state.rate - h * (s.stiffness * sin(state.angle) + s.rest * number)
    return Swing(state.angle + h * rate, min(rate, 0.9))


@equation
def after(count: float, state: Swing, s: Spring, h: float) -> float:
    """What follows behind the steps, from a state that follows an argument."""
    end = repeated(swung, count, Swing(2.0 * state.angle, state.rate), s, h)
    return end.angle * end.rate + s.rest


def test_repeated_is_a_loop() -> None:
    state, spring = Swing(0.3, 0.2), Spring(1.5, 0.1)
    expected = Swing(0.6, 0.2)
    for number in range(5):
        expected = swung(expected, float(number), spring, 0.1)
    assert after(5.0, state, spring, 0.1) == expected.angle * expected.rate + 0.1
    assert after(0.0, state, spring, 0.1) == 0.6 * 0.2 + 0.1
    check(after, ("state", "s", "h"), count=5.0, state=state, s=spring, h=0.1)


def test_what_a_repeated_step_follows_is_structure() -> None:
    """The rate does not depend on what only the angle follows before it has been taken over."""
    derived = derive(swung, ("state", "s", "h"))
    assert derived.outputs == ("angle", "rate")
    many = derive(many_times, ("state", "drag"))
    assert many.entries == ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2))


@equation
def coasting(state: Swing, number: float, drag: float) -> Swing:
    return Swing(state.angle + state.rate, state.rate * drag)


@equation
def many_times(state: Swing, drag: float) -> Swing:
    return repeated(coasting, 3.0, state, drag)


@equation
def cooled(state: float, number: float, share: float) -> float:
    return state - share * sin(state) + number * share


@equation
def cooling(x: float, share: float) -> float:
    return share * repeated(cooled, 3.0, x * x, share)


class Heat(NamedTuple):
    heat: float


@equation
def cooled_tuple(state: Heat, number: float, share: float) -> Heat:
    return Heat(cooled(state.heat, number, share))


@equation
def cooling_tuple(x: float, share: float) -> float:
    return repeated(cooled_tuple, 3.0, Heat(x * x), share).heat


def test_a_repeated_state_may_be_one_float() -> None:
    expected = 0.49
    for number in range(3):
        expected = expected - 0.2 * sin(expected) + number * 0.2
    assert cooling(0.7, 0.2) == 0.2 * expected
    check(cooling, ("x", "share"), x=0.7, share=0.2)
    assert cooling_tuple(0.7, 0.2) == expected
    check(cooling_tuple, ("x", "share"), x=0.7, share=0.2)


# --- conventions ----------------------------------------------------------------------------------


@equation
def ties(x: float, y: float) -> tuple[float, float, float, float]:
    return min(x, y), max(x, y), abs(x - y), max(x, y, x)


def test_at_a_tie_the_last_argument_counts() -> None:
    derived = derive(ties, ("x", "y"))
    values = derived(2.0, 2.0)
    slopes = dict(zip(derived.entries, values[4:], strict=True))
    assert slopes == {
        (0, 0): 0.0, (0, 1): 1.0, (1, 0): 0.0, (1, 1): 1.0, (2, 0): 1.0, (2, 1): -1.0,
        (3, 0): 1.0, (3, 1): 0.0,
    }  # fmt: skip


@equation
def endless(x: float) -> tuple[float, float, float, float, float]:
    return sqrt(x), asin(1.0 - x), acos(1.0 - x), hypot(x, x), atan2(x, x)


def test_an_infinite_slope_counts_as_none() -> None:
    derived = derive(endless, "x")
    assert derived(0.0)[5:] == (0.0, 0.0, 0.0, 0.0, 0.0)[: len(derived.entries)]


@equation
def unlimited(x: float, rate: float) -> float:
    return min(x * 2.0, x + rate * x)


def test_an_infinite_limit_does_no_harm() -> None:
    derived = derive(unlimited, "x")
    assert derived(0.5, math.inf) == (1.0, 2.0)


@equation
def shared_log(x: float) -> float:
    l = log(x)
    return (l if x > 0.0 else 0.0) + (2.0 * l if x > 1.0 else 0.0)


@equation
def shared_root(x: float) -> float:
    r = sqrt(x) * x
    return (r if x > 0.0 else 3.0 * x) + (2.0 * r if x > 1.0 else 0.0)


@equation
def shared_ratio(x: float) -> float:
    q = 1.0 / x
    one = 0.0
    if x > 0.0:
        one = exp(q) if x > 0.5 else x * q
    return one + (q * q if x > 1.0 else 0.0)


@equation
def shared_arc(x: float) -> float:
    a = asin(x)
    return max(0.0, a if x < 1.0 else 0.0) + (a * a if x < -0.5 else x)


@pytest.mark.skipif(JIT_OFF, reason="plain Python refuses log(0) where the equation asks for it")
@pytest.mark.parametrize(
    ("function", "x", "slope"),
    [
        (shared_log, 0.0, 0.0),
        (shared_log, -2.0, 0.0),
        (shared_log, 0.5, 2.0),
        (shared_log, 2.0, 1.5),
        (shared_root, 0.0, 3.0),
        (shared_root, -1.0, 3.0),
        (shared_root, 4.0, 9.0),
        (shared_ratio, 0.0, 0.0),
        (shared_ratio, -0.5, 0.0),
        (shared_ratio, 0.25, 0.0),
        (shared_ratio, 2.0, -math.exp(0.5) / 4.0 - 0.25),
        (shared_arc, 1.0, 1.0),
        (shared_arc, 2.0, 1.0),
        (shared_arc, 0.6, 1.0 / 0.8 + 1.0),
    ],
)
def test_a_value_of_sides_that_are_not_taken_does_no_harm(
    function: Any, x: float, slope: float
) -> None:
    assert derive(function, "x")(x)[1] == pytest.approx(slope, rel=1e-14)


@equation
def guarded_divisor(x: float) -> float:
    s = sqrt(x)
    return s + (1.0 / s if s > 0.0 else 0.0)


@equation
def link_of_a_chain(x: float) -> tuple[float, float]:
    first = 1.0 / x
    return first, first if x > 0.0 else 0.0


@pytest.mark.skipif(JIT_OFF, reason="plain Python refuses 1/0 where the equation asks for it")
def test_a_guard_holds_for_what_is_divided_by_and_along_a_chain() -> None:
    derived = derive(guarded_divisor, "x")
    assert derived(0.0) == (0.0, 0.0)
    assert derived(4.0) == (2.5, 0.25 - 1.0 / 16.0)
    chain = derive(link_of_a_chain, "x")
    slopes = dict(zip(chain.entries, chain(0.0)[2:], strict=True))
    assert slopes[1, 0] == 0.0
    assert chain(2.0)[2:] == (-0.25, -0.25)


@equation
def smoothed(x: float, smooth: bool | None) -> float:
    return abs(x)


@declared(smoothed)
def _smoothed(x: float, smooth: bool | None) -> float:
    if smooth is None:
        return 1.0 if x >= 0.0 else -1.0
    return 2.0 * x


@equation
def both_ways(x: float) -> float:
    return smoothed(x, OFF) + 10.0 * smoothed(x, ON)


def test_a_rule_is_that_of_its_options() -> None:
    assert derive(both_ways, "x")(0.5) == (5.5, 1.0 + 10.0)


@equation
def off_by(x: float, a: float) -> float:
    return x - a


@equation
def between(low: float, high: float, a: float) -> float:
    return root(off_by, low, high, a)


@pytest.mark.parametrize("ends", [(0.0, 1.0), (1.0, 0.0)])
def test_a_bracket_may_fall(ends: tuple[float, float]) -> None:
    derived = derive(between, ("low", "high", "a"))
    assert derived.inputs == ("low", "high", "a")
    value, *slopes = derived(*ends, 0.25)
    assert value == pytest.approx(0.25, rel=1e-15)
    assert slopes == [0.0, 0.0, 1.0]
    value, *slopes = derived(*ends, 3.0)  # beyond: the nearer end
    assert value == 1.0
    assert slopes == [float(ends[0] == 1.0), float(ends[1] == 1.0), 0.0]


FROM_NUMPY = np.float64(0.5)


@equation
def halved(x: float) -> float:
    return FROM_NUMPY * x


def test_a_constant_may_be_numpys() -> None:
    assert derive(halved, "x")(3.0) == (1.5, 0.5)


# --- what comes together --------------------------------------------------------------------------


class Friction(NamedTuple):
    force: float
    width: float


class Rubbing(NamedTuple):
    mass: float
    friction: Friction | None = None
    bias: float | None = None


@equation
def rubbing(v: float, p: Rubbing) -> float:
    a = v / p.mass
    if p.friction is not None:
        a = a - p.friction.force * min(max(v / p.friction.width, -1.0), 1.0)
    return a if p.bias is None else a + p.bias


@equation
def rubbed(v: float, p: Rubbing) -> float:
    return v + 0.1 * rubbing(v, p)


def test_options_that_hold_parameters() -> None:
    """Numba alone would type both ways of such a branch, and one of them has no fields."""
    on, off = Rubbing(2.0, Friction(0.5, 3.0), 0.25), Rubbing(2.0)
    derived = derive(rubbed, ("v", "p"), options={"p": on})
    assert derived.inputs == ("v", "p.mass", "p.friction.force", "p.friction.width", "p.bias")
    slopes = (1.0 + 0.1 * (0.5 - 0.5 / 3.0), -0.025, -0.1 / 3.0, 0.05 / 9.0, 0.1)
    assert derived(1.0, on) == pytest.approx((1.0 + 0.1 * (0.75 - 0.5 / 3.0), *slopes))
    derived = derive(rubbed, ("v", "p"), options={"p.friction": None, "p.bias": None})
    assert derived.inputs == ("v", "p.mass")
    assert derived(1.0, off) == pytest.approx((1.05, 1.05, -0.025))
    decided = derive(rubbed, (), options={"p": on})
    assert decided.entries == ()
    assert decided(1.0, on) == pytest.approx((1.0 + 0.1 * (0.75 - 0.5 / 3.0),))


def scaled(factor: float) -> Any:
    @equation
    def scaling(x: float) -> float:
        return factor * x

    return scaling


double, triple = scaled(2.0), scaled(3.0)


@equation
def both_scaled(x: float) -> float:
    return double(x) * triple(x)


def test_functions_of_one_name_are_kept_apart() -> None:
    assert derive(both_scaled, "x")(2.0) == (24.0, 24.0)
    assert closure_hash(double) != closure_hash(triple)


@pytest.mark.parametrize(
    ("expression", "expected"),
    [(" + ".join(["x", *["0.5"] * 2400]), 1202.0), ("-" * 500 + "x", 2.0)],
    ids=["a sum of 2,401 terms", "500 signs"],
)
def test_what_python_can_read_is_not_too_deep(
    expression: str, expected: float, tmp_path: Path
) -> None:
    text = "\n".join(
        [
            "from swashplate.machine import equation",
            "@equation",
            f"def deep(x: float) -> float:\n    return {expression}",
        ]
    )
    (tmp_path / "deep.py").write_text(text, "utf-8")
    deep = run_path(str(tmp_path / "deep.py"))["deep"]
    assert derive(deep, "x")(2.0) == (expected, 1.0)


# --- what Python runs -----------------------------------------------------------------------------

COUNT, SHARES = 4, (0.5, 0.25, 0.125)


@equation
def first_above(x: float, s: tuple[float, float, float]) -> float:
    """A loop that is left on the way, by a return."""
    for i, value in enumerate(s):
        if value > x:
            return value + i
    return x


@equation
def up_to_gap(x: float, s: tuple[float, float, float]) -> float:
    """A loop with `continue`, `break` and `else`, within another."""
    total = 0.0
    for turn in range(2):
        for value in s:
            if value < 0.0:
                continue
            if value > x:
                total += 10.0 * value
                break
            total = total * x + value
        else:
            total += 100.0 + turn
        if total > 1000.0:
            return total
    return total


@equation
def shared_out(x: float, s: tuple[float, float, float]) -> float:
    """What Python knows ahead: whole numbers, tuples, comprehensions, arguments with `*`."""
    odd = tuple(value for number, value in enumerate(s) if number % 2 == 0)
    weighted = tuple(a * b for a, b in zip(s, SHARES, strict=True))
    first, *others = weighted
    total = first * x ** (len(others) - COUNT + 3)
    for number in range(COUNT // 2):
        total = total + weighted[number + 1] / (number + 1)
    return accelerated(State(*odd), max(weighted), Body(total, Spring(x), drag=min(*s, x)))


@equation
def turned_back(s: State, x: float, mirrored: bool | None = None) -> State:
    """`_replace`, and chains of comparisons."""
    if mirrored:
        s = s._replace(position=-s.position)
    return s._replace(speed=x) if 0.0 < s.position <= x != 1.0 else s


@pytest.mark.parametrize("x", [-2.0, 0.2, 0.55, 3.0])
@pytest.mark.parametrize("s", [(0.3, 0.5, 0.7), (0.6, -0.4, 0.3), (-1.0, -0.8, 9.0)])
def test_what_python_runs(x: float, s: tuple[float, float, float]) -> None:
    for each in (first_above, up_to_gap, shared_out):
        check(each, ("x", "s"), x=x, s=s)
    for mirrored in (OFF, ON):
        said = {"mirrored": mirrored}
        check(turned_back, ("x", "s"), said, s=State(*s[:2]), x=x, mirrored=mirrored)


@equation
def decided_often(x: float) -> float:
    y = x
    if y > 1.0:
        y = y - 0.5
    if y > 2.0:
        y = y * 0.5
    if x > 3.0:
        y += 1.0
    if y > 4.0:
        y = y * y
    if y > 5.0:
        y = y - x
    if x > 6.0:
        y = sqrt(abs(y))
    if y > 0.7:
        y = y + 0.7
    if y > 0.8:
        y = 0.8 * y
    if y > 0.9:
        y = y - 0.9
    if x > 10.0:
        y = y + x
    if y > 11.0:
        y = y / 11.0
    if y > 12.0:
        y = 12.0
    return y


@pytest.mark.parametrize("x", [-1.0, 0.85, 2.9, 4.4, 7.0, 30.0])
def test_decisions_one_after_another(x: float) -> None:
    check(decided_often, "x", x=x)
