"""Every component's twin against Richardson-extrapolated differences, over the valid domain.

Points within reach of a switch are drawn again: there the two differences, with the whole step
and with a quarter of it, disagree. What the twins declare at the switches is in test_switches.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite, sqrt, tan

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from swashplate.physics import card_dynamics as dynamics
from swashplate.physics import control_card, motor, solenoid, spool, stroker, swash

pytestmark = pytest.mark.interpreted

STEP = 1.0 / 512.0


def real(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


@dataclass(frozen=True)
class Twin:
    """A component, its twin, how to draw arguments, and which of them have a derivative."""

    value: Callable[..., float]
    partials: Callable[..., tuple[float, ...]]
    arguments: st.SearchStrategy[tuple]
    by: tuple[int, ...]
    sizes: tuple[float, ...]
    """Usual size of each of those arguments, which the differences' steps are taken from."""
    constant: frozenset[int] | set[int] = frozenset()
    """Those of them that the value does not depend on among such arguments."""

    def __str__(self) -> str:
        return self.value.__name__


volts, amperes = real(-10.0, 10.0), real(0.0, 2.0)
card_gains = (real(0.0, 5.0), real(0.0, 0.5), real(0.0, 0.2), real(-0.01, 0.01), real(-1e-3, 1e-3))


@st.composite
def spool_arguments(draw: st.DrawFn) -> tuple:
    """Force and arm anywhere with |sin φ| < 1, |sin α| < 1, as long as tan(φ - α) is finite."""
    sin_force, sin_arm = draw(real(-0.98, 0.98)), draw(real(-0.98, 0.98))
    cos_difference = sqrt(1 - sin_force**2) * sqrt(1 - sin_arm**2) + sin_force * sin_arm
    assume(cos_difference > 0.05)
    Z4, Z5 = draw(real(1e-3, 10.0)), draw(real(1e-3, 0.1))
    return sin_force * sqrt(Z4) / Z5, sin_arm, Z4, Z5, draw(real(-1e-3, 1e-3))


@st.composite
def stroker_arguments(draw: st.DrawFn, leaky: bool, stepped: bool) -> tuple:
    """Pressure below the supply, any opening, both roots."""
    Z9 = draw(real(1e6, 3e7))
    pressure, opening = Z9 * draw(real(-0.9, 0.9)), draw(real(-4e-4, 4e-4))
    assume(abs(opening) > 1e-7)  # at 0 the physical root switches sides
    Z6, Z7, Z8 = draw(real(0.0, 15.0)), draw(real(0.0, 5.0)), draw(real(1e5, 3e6))
    parameters = (Z6, Z7, Z8, Z9) if leaky else (Z6, Z8, Z9)
    root = draw(st.sampled_from([None, True]))
    return (pressure, opening, *parameters, *((STEP,) if stepped else ()), root)


@st.composite
def limiter_arguments(draw: st.DrawFn) -> tuple:
    I_t2 = draw(real(0.0, 0.3))
    I_t1 = I_t2 + draw(real(0.01, 0.5))
    target, previous = draw(real(-0.2, 1.2)), draw(real(1e-3, 1.2))
    steady = draw(st.one_of(st.just(0.0), real(0.05, 1.0)))
    lim1, lim2, decay = draw(real(0.5, 50.0)), draw(real(0.5, 50.0)), draw(real(0.5, 1.0))
    return target, previous, steady, lim1, lim2, I_t1, I_t2, decay, STEP


@st.composite
def split_arguments(draw: st.DrawFn) -> tuple:
    """The same where the output may pass I_t2 within the step, led by the limit or the filter."""
    arguments = draw(limiter_arguments())
    lim2, I_t2 = arguments[4], arguments[6]
    previous = I_t2 + draw(real(-0.5, 1.5)) * lim2 * STEP
    assume(previous > 1e-3)
    target = previous + draw(real(-2.0, 0.5)) * lim2 * STEP
    return target, previous, *arguments[2:], True


@st.composite
def rising_arguments(draw: st.DrawFn) -> tuple:
    """The same where the output passes I_t1 within the step."""
    arguments = draw(limiter_arguments())
    lim1, I_t1 = arguments[3], arguments[5]
    target = I_t1 + draw(real(0.01, 3.0)) * lim1 * STEP
    previous = I_t1 - draw(real(0.01, 3.0)) * lim1 * STEP
    assume(previous > 1e-3)
    return target, previous, *arguments[2:], True


TWINS = [
    Twin(
        control_card.interpolated,
        control_card.interpolated_partials,
        st.tuples(volts, volts, real(0.0, 1.0)),
        (0, 1, 2),
        (1.0, 1.0, 0.1),
    ),
    Twin(
        control_card.jump_share,
        control_card.jump_share_partials,
        st.tuples(volts, volts, volts, real(0.01, 0.99), real(0.0, 5.0)),
        (3, 4),
        (0.01, 0.01),
    ),
    Twin(
        control_card.steady_current,
        control_card.steady_partials,
        st.tuples(volts, real(0.0, 1.0), *card_gains),
        tuple(range(7)),
        (1.0, 0.1, 0.1, 0.1, 0.1, 0.01, 0.001),
    ),
    Twin(
        dynamics.filtered_current,
        dynamics.filter_partials,
        st.one_of(
            st.tuples(
                amperes,
                amperes,
                amperes,
                real(0.1, 2.0),
                real(5.0, 300.0),
                real(0.0, 10.0),
                st.just(STEP),
                st.sampled_from([None, True]),
            ),
            # within the smooth sign's narrow band
            st.tuples(
                st.just(0.5),
                real(0.49999, 0.50001),
                amperes,
                real(0.1, 2.0),
                real(5.0, 300.0),
                real(0.1, 10.0),
                st.just(STEP),
                st.none(),
            ),
        ),
        (0, 1, 2, 3, 4, 5),
        (1e-5, 1e-5, 1e-2, 1.0, 10.0, 1.0),
    ),
    Twin(
        dynamics.limited_current,
        dynamics.limiter_partials,
        limiter_arguments(),
        (0, 1, 3, 4, 5, 6, 7),
        (0.1, 0.1, 1.0, 1.0, 0.1, 0.1, 0.1),
        {6},  # unsplit, I_t2 only switches
    ),
    Twin(
        dynamics.limited_current,
        dynamics.limiter_partials,
        split_arguments(),
        (0, 1, 3, 4, 5, 6, 7),
        (0.01, 0.01, 1.0, 1.0, 0.1, 0.01, 0.1),
        {3, 5},  # near I_t2 no current grows past I_t1
    ),
    Twin(
        dynamics.limited_current,
        dynamics.limiter_partials,
        rising_arguments(),
        (0, 1, 3, 4, 5, 6, 7),
        (0.01, 0.01, 1.0, 1.0, 0.01, 0.1, 0.1),
        {4, 6, 7},  # and the way up knows nothing of the way down
    ),
    Twin(
        dynamics.decay_factor,
        dynamics.decay_partials,
        st.tuples(real(0.0, 50.0), st.just(STEP)),
        (0,),
        (1.0,),
    ),
    Twin(
        solenoid.solenoid_force,
        solenoid.solenoid_partials,
        st.tuples(real(-1.0, 1.0), real(0.01, 0.5), *[real(-20.0, 20.0)] * 8),
        tuple(range(10)),
        (0.1, 0.1, *[1.0] * 8),
    ),
    Twin(
        spool.arm_sine,
        spool.arm_sine_partials,
        st.tuples(real(-1e6, 1e6), real(1e-8, 1e-6), real(-0.1, 0.1), real(0.1, 5.0)),
        (0, 1, 2, 3),
        (1e5, 1e-8, 0.1, 0.1),
    ),
    Twin(
        spool.spool_position,
        spool.spool_partials,
        spool_arguments(),
        (0, 1, 2, 3, 4),
        (0.01, 0.01, 1e-3, 1e-3, 1e-3),
    ),
    Twin(
        spool.orifice_opening,
        spool.opening_partials,
        st.tuples(real(-5e-3, 5e-3), real(1e-3, 4e-3), real(1e-4, 6e-3), real(1e-4, 6e-3)),
        (0, 1, 2, 3),
        (1e-4, 1e-4, 1e-4, 1e-4),
    ),
    Twin(
        swash.swash_tangent,
        swash.swash_tangent_partials,
        st.tuples(real(-1e6, 1e6), real(1e-8, 1e-6), real(-0.1, 0.1)),
        (0, 1, 2),
        (1e5, 1e-8, 0.1),
    ),
    Twin(
        swash.swash_angle,
        swash.swash_angle_partials,
        st.tuples(real(-3.0, 3.0), real(0.05, 1.2), real(0.05, 1.2), st.just(True)),
        (0, 1, 2),
        (0.1, 0.01, 0.01),
    ),
    Twin(
        swash.swash_rate,
        swash.swash_rate_partials,
        st.tuples(real(-1.0, 1.0), real(-1e7, 1e7), real(1e-8, 1e-6)),
        (0, 1, 2),
        (0.1, 1e6, 1e-8),
    ),
    Twin(
        motor.load_leakage,
        motor.load_leakage_partials,
        st.tuples(real(-1.0, 1.0), real(-2.0, 2.0), real(-5.0, 5.0)),
        (0, 1, 2),
        (0.1, 0.1, 1.0),
    ),
    Twin(
        motor.shaft_speed,
        motor.shaft_speed_partials,
        st.tuples(real(-0.5, 0.5), real(-1.0, 1.0), real(0.1, 50.0), real(-1.0, 1.0)),
        (0, 1, 2, 3),
        (0.1, 0.1, 1.0, 0.1),
    ),
    Twin(
        stroker.pressure_rate,
        stroker.pressure_rate_partials,
        stroker_arguments(leaky=True, stepped=False),
        tuple(range(6)),
        (1e4, 1e-5, 0.1, 0.1, 1e4, 1e4),
    ),
    Twin(
        stroker.tight_step,
        lambda *a: stroker.tight_step_partials(*a)[:4] + stroker.tight_step_partials(*a)[5:],
        stroker_arguments(leaky=False, stepped=True),
        tuple(range(5)),
        (1e4, 1e-5, 0.1, 1e4, 1e4),
    ),
    Twin(
        stroker.leaky_step,
        stroker.leaky_step_partials,
        stroker_arguments(leaky=True, stepped=True),
        tuple(range(6)),
        (1e4, 1e-5, 0.1, 0.1, 1e4, 1e4),
    ),
    Twin(
        lambda Z1, Z2, Z13, Z15, up: stroker.pressure_limits(Z1, Z2, Z13, Z13, Z15)[
            3 if up > 0 else 2
        ],
        stroker.pressure_limit_partials,
        st.tuples(
            real(1e-7, 1e-6),
            real(-0.05, 0.05),
            real(0.05, 0.5),
            real(1e5, 5e6),
            st.sampled_from([1.0, -1.0]),
        ),
        (0, 1, 2, 3),
        (1e-8, 0.01, 0.01, 1e4),
    ),
]


def kink(function: Callable[..., float], at: tuple, index: int, h: float) -> float:
    """Slope to the right less slope to the left."""
    above, below = list(at), list(at)
    above[index] += h
    below[index] -= h
    return (function(*above) - 2.0 * function(*at) + function(*below)) / h


@pytest.mark.parametrize("twin", TWINS, ids=lambda twin: str(twin).replace("<lambda>", "limits"))
def test_twin_gives_value_and_derivatives(twin: Twin, derivative: Callable[..., float]) -> None:
    seen = [0.0] * len(twin.by)

    @given(twin.arguments)
    def check(arguments: tuple) -> None:
        value, *partials = twin.partials(*arguments)
        assert value == twin.value(*arguments)
        checked = []
        for place, (index, partial) in enumerate(zip(twin.by, partials, strict=True)):
            size = twin.sizes[place]
            h = 1e-3 * size
            coarse = derivative(twin.value, arguments, index, h)
            fine = derivative(twin.value, arguments, index, 0.25 * h)
            scale = abs(fine) + 1e-3 * abs(value) / size + 1e-30
            if not isfinite(coarse) or abs(coarse - fine) > 1e-6 * scale:
                continue  # a switch or the end of the domain lies within h
            if abs(kink(twin.value, arguments, index, 0.01 * h)) > 1e-3 * scale:
                continue  # a switch lies right here, where all differences agree on its mean
            checked.append(place)
            assert partial == pytest.approx(fine, rel=1e-6, abs=1e-6 * scale)
            seen[place] = max(seen[place], abs(fine))
        assume(checked)

    check()
    for index, largest in zip(twin.by, seen, strict=True):
        assert largest > 0.0 or index in twin.constant, f"argument {index} was never exercised"


def test_stop_pressures_are_tangents_over_the_gain() -> None:
    lower_stop, upper_stop, lower, upper = stroker.pressure_limits(2e-7, 0.01, 0.25, 0.2, 1e6)
    assert lower_stop == pytest.approx((-tan(0.2) + 0.01) / 2e-7, rel=1e-15)
    assert upper_stop == pytest.approx((tan(0.25) + 0.01) / 2e-7, rel=1e-15)
    assert (lower, upper) == (lower_stop, 1e6)
