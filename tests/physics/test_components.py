"""Components against the equations they stand for, worked out another way."""

from math import asin, atan, cos, exp, inf, pi, sin, sqrt, tan

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from swashplate.physics import card_dynamics as dynamics
from swashplate.physics import control_card as card
from swashplate.physics.solenoid import effective_current, solenoid_force
from swashplate.physics.spool import orifice_opening, spool_position
from swashplate.physics.stroker import leaky_step, pressure_rate, tight_step, tight_step_partials
from swashplate.physics.swash import TAN_22_5, arctangent, small_arctangent, swash_angle

pytestmark = pytest.mark.interpreted

H = 1.0 / 512.0


@given(st.floats(-TAN_22_5, TAN_22_5))
def test_small_arctangent_is_within_one_unit_in_the_last_place(t: float) -> None:
    assert abs(small_arctangent(t) - atan(t)) <= np.spacing(abs(atan(t)))


@given(st.floats(-1e6, 1e6))
def test_arctangent_is_within_two_units_in_the_last_place(t: float) -> None:
    assert abs(arctangent(t) - atan(t)) <= 2.0 * np.spacing(abs(atan(t)))


def test_steep_and_flat_swash_plates_give_the_same_angle() -> None:
    for tangent in np.linspace(-TAN_22_5, TAN_22_5, 101):
        assert swash_angle(tangent, 0.39, 0.39, None) == swash_angle(tangent, 0.39, 0.39, True)


@given(st.floats(-0.95, 0.95), st.floats(-0.95, 0.95), st.floats(-1e-3, 1e-3))
def test_spool_is_the_tangent_of_the_angles_difference(a: float, s: float, plus: float) -> None:
    assume(cos(asin(a) - asin(s)) > 0.05)
    Z4, Z5 = 0.05, 0.008
    expected = Z5 * tan(asin(a) - asin(s)) + plus
    x = spool_position(a * sqrt(Z4) / Z5, s, Z4, Z5, plus)
    assert x == pytest.approx(expected, rel=1e-10, abs=1e-13)


@given(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6))
def test_spool_solves_the_force_balance(a: float, s: float) -> None:
    """Kruse eq. 6.19 at rest: k_f d3² [d1 sin α + x cos α]/√(d1² + x²) = (d1² + x²)/d1 · F ...

    ... where the right-hand side is the moment d1 F once the spool's own tilt is neglected
    (tan²β ≪ 1, the assumption below eq. 6.57).
    """
    spring, d1 = 0.23, 0.008
    force = a * spring / d1
    x = spool_position(force, s, spring**2, d1, 0.0)
    moment = spring * (d1 * s + x * sqrt(1 - s * s)) / sqrt(d1**2 + x**2)
    assert moment == pytest.approx(d1 * force, rel=1e-9, abs=1e-12)


def test_force_keeps_the_sign_of_even_powers() -> None:
    """Erratum 1: -0.5 A, dead zone 0.1: e = -0.4; 10 e + 4 e² + 2 e³ - 50 e⁴ by hand."""
    force = solenoid_force(-0.5, 0.1, 1.0, 10.0, 1.0, 4.0, 1.0, 2.0, 1.0, -50.0)
    assert force == pytest.approx(-4.0 + 0.64 - 0.128 - 1.28, rel=1e-14)


@given(st.floats(-2.0, 2.0), st.floats(0.0, 1.0))
def test_effective_current_is_beyond_a_symmetric_dead_zone(i: float, Z17: float) -> None:
    assert effective_current(i, Z17) == pytest.approx(np.sign(i) * max(abs(i) - Z17, 0.0))


@pytest.mark.parametrize(
    ("position", "opening"),
    [(5e-3, 2e-4), (1e-4, 1e-4), (-1e-4, -1e-4), (-5e-3, -3e-4), (0.0, 0.0)],
)
def test_opening_stops_at_the_orifices(position: float, opening: float) -> None:
    assert orifice_opening(position, 3e-3, 2e-4, 3e-4) == opening


def test_opening_stops_at_the_spool_without_orifices() -> None:
    assert orifice_opening(5e-3, 3e-3, inf, inf) == 3e-3
    assert orifice_opening(-5e-3, 3e-3, inf, inf) == -3e-3


@pytest.mark.parametrize("symmetric", [None, True])
@pytest.mark.parametrize("opening", [1.5e-4, -1.5e-4])
def test_tight_step_integrates_the_rate_exactly(opening: float, symmetric: bool | None) -> None:
    args = (0.1, 0.0, 1.6e6, 1.0e7, symmetric)
    solution = solve_ivp(
        lambda _, p: [pressure_rate(p[0], opening, *args)],
        (0.0, 20 * H),
        [4e5],
        rtol=1e-11,
        atol=1e-3,
    )
    p = 4e5
    for _ in range(20):
        p = tight_step(p, opening, 0.1, 1.6e6, 1.0e7, H, symmetric)
    assert p == pytest.approx(solution.y[0, -1], rel=1e-9)


@pytest.mark.parametrize("symmetric", [None, True])
def test_leaky_step_integrates_the_rate(symmetric: bool | None) -> None:
    args = (0.1, 2.0, 1.6e6, 1.0e7, symmetric)
    solution = solve_ivp(
        lambda _, p: [pressure_rate(p[0], -1e-4, *args)], (0.0, H), [4e5], rtol=1e-12, atol=1e-4
    )
    p = leaky_step(4e5, -1e-4, 0.1, 2.0, 1.6e6, 1.0e7, H, symmetric)
    assert p == pytest.approx(solution.y[0, -1], rel=1e-10)


def test_pressure_cannot_be_pumped_beyond_the_supply() -> None:
    p = 0.0
    for _ in range(5):
        p = tight_step(p, 1.0, 0.0, 1e6, 1e6, H, None)
    assert p == 1e6
    for _ in range(5):
        p = tight_step(p, -1.0, 0.0, 1e6, 1e6, H, True)
    assert p == -1e6


def test_leakage_has_a_derivative_at_zero() -> None:
    """By the second-order forward difference, as negative leakage does not exist."""
    p, x, Z6, Z8, Z9 = 3e5, 2e-4, 0.1, 1.6e6, 1.0e7
    e = 1e-3
    base = tight_step(p, x, Z6, Z8, Z9, H, None)
    one, two = (leaky_step(p, x, Z6, k * e, Z8, Z9, H, None) for k in (1, 2))
    difference = (-3.0 * base + 4.0 * one - two) / (2.0 * e)
    assert tight_step_partials(p, x, Z6, Z8, Z9, H, None)[4] == pytest.approx(difference, rel=1e-6)


def test_share_of_an_interval_above_the_dead_zone() -> None:
    # a ramp from 0 to 2 V over the two intervals; the last 0.5 V lie above 1.5 V
    assert card.share_above(0.0, 2.0, 1.5) == 0.25
    assert card.share_above(2.0, 0.0, 1.5) == 0.25
    assert card.share_above(1.0, 1.0, 1.0) == 0.0
    assert card.share_above(2.0, 3.0, 1.0) == 1.0
    # the interval ends 0.3 samples before the newest: it sees 1.3..2 of 0..1 and 1..2 of 1..2
    assert card.jump_share(2.0, 1.0, 0.0, 0.3, 1.0) == pytest.approx(0.7)


def test_filter_is_the_printed_difference_equation() -> None:
    """Eq. 3.6 with ζ = 0.5, ω = 64, h = 1/64 (ωh = 1), C = 2 by hand."""
    h = 1.0 / 64.0
    # 2(1 - 0.5) 0.3 + (2·0.5 - 1 - 1) 0.2 - 2 h² sign + 1·0.7
    plain = 0.3 - 0.2 + 0.7
    friction = 2.0 / 64.0**2
    assert dynamics.filtered_current(0.3, 0.2, 0.7, 0.5, 64.0, 2.0, h, None) == pytest.approx(
        plain - friction, rel=1e-15
    )
    assert dynamics.filtered_current(0.2, 0.2, 0.7, 0.5, 64.0, 2.0, h, None) == pytest.approx(0.7)
    assert dynamics.coulomb_sign(0.005 * h, h, None) == pytest.approx(0.5)
    assert dynamics.coulomb_sign(0.005 * h, h, True) == 1.0
    assert dynamics.coulomb_sign(-0.005 * h, h, True) == -1.0
    assert dynamics.coulomb_sign(0.0, h, True) == 0.0


LIMITS = {"lim1": 2.0, "lim2": 3.0, "I_t1": 0.3, "I_t2": 0.1, "decay": 0.9, "step": 0.01}


@pytest.mark.parametrize(
    ("target", "previous", "steady", "output", "limited"),
    [
        (0.25, 0.1, 0.5, 0.25, False),  # below I_t1 the filter passes
        (0.9, 0.5, 0.9, 0.52, True),  # above it lim1 counts, from the last output on
        (0.9, 0.1, 0.9, 0.32, True),  # or from I_t1, when a sample jumps over it
        (0.51, 0.5, 0.9, 0.51, False),  # slower than the limit
        (0.2, 0.5, 0.0, 0.47, True),  # towards zero lim2
        (0.49, 0.5, 0.4, 0.49, False),
        (-0.1, 0.08, 0.0, 0.072, False),  # gone below I_t2: decay, whatever the filter does
        (0.05, 0.08, 0.04, 0.072, False),  # still commanded: the higher of filter and decay
        (0.075, 0.08, 0.04, 0.075, False),
    ],
)
def test_limiter_branches(
    target: float, previous: float, steady: float, output: float, limited: bool
) -> None:
    assert dynamics.limited_current(target, previous, steady, **LIMITS) == pytest.approx(output)
    assert dynamics.rate_limit_active(output, target, previous, LIMITS["I_t2"]) is limited


@pytest.mark.parametrize(
    ("target", "previous", "steady", "output"),
    [
        (0.0, 0.14, 0.0, 0.11),  # I_t2 is not reached
        (0.0, 0.12, 0.0, 0.1 * (0.9 + 2 / 3 * 0.1)),  # reached after two thirds of the step
        (0.095, 0.12, 0.0, 0.1 * (0.9 + 0.8 * 0.1)),  # after four fifths, led by the filter
        (0.097, 0.104, 0.5, 0.097),  # still commanded, and the filter is higher than the decay
        (-0.1, 0.1, 0.0, 0.09),  # reached already
        (0.9, 0.1, 0.9, 0.3 + 0.75 * 0.02),  # on the way up I_t1 is passed after a quarter
        (0.31, 0.1, 0.9, 0.3 + 0.02 / 21.0),  # shortly before the step's end
        (0.31, 0.295, 0.9, 0.31),  # the filter is slower than the limit
        (0.9, 0.5, 0.9, 0.52),  # passed already
    ],
)
def test_switches_from_within_a_step(
    target: float, previous: float, steady: float, output: float
) -> None:
    found = dynamics.limited_current(target, previous, steady, **LIMITS, split=True)
    assert found == pytest.approx(output)


def test_limits_can_be_off() -> None:
    off = {"lim1": inf, "lim2": inf, "I_t1": inf, "I_t2": 0.0, "decay": exp(-inf), "step": H}
    assert dynamics.limited_current(1.3, 0.2, 1.0, **off) == 1.3
    assert dynamics.limited_current(0.1, 0.9, 0.0, **off) == 0.1
    assert dynamics.limited_current(-0.1, 0.9, 0.0, **off) == 0.0


def test_the_other_form_of_the_spool_takes_over_where_angles_are_large() -> None:
    a, s = sin(1.2), sin(1.1)
    assert a * a + s * s > 1.0
    x = spool_position(a * sqrt(0.05) / 0.008, s, 0.05, 0.008, 0.0)
    assert x == pytest.approx(0.008 * tan(0.1), rel=1e-12)
    assert pi / 2 < 1.2 + 1.1
