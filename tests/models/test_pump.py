"""The pump's equations against what they stand for, worked out another way."""

from math import atan, sin, sqrt, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from swashplate import Drive
from swashplate.machine.library import TAN_22_5, arctangent, faded, small_arctangent, soft_threshold
from swashplate.models import displacement_control as control
from swashplate.models.displacement_control import Pump, Stroking

H = 1.0 / 512.0
interpreted = pytest.mark.interpreted


# --- solenoids and spool -------------------------------------------------------------------------


@interpreted
@given(st.floats(-TAN_22_5, TAN_22_5))
def test_small_arctangent_is_within_one_unit_in_the_last_place(t: float) -> None:
    assert abs(small_arctangent(t) - atan(t)) <= np.spacing(abs(atan(t)))


@interpreted
@given(st.floats(-1e6, 1e6))
def test_arctangent_is_within_two_units_in_the_last_place(t: float) -> None:
    assert abs(arctangent(t) - atan(t)) <= 2.0 * np.spacing(abs(atan(t)))


@interpreted
def test_steep_and_flat_swash_plates_give_the_same_angle(pump: Pump) -> None:
    p = pump._replace(Z13_plus=0.39, Z13_minus=0.39)
    for tangent in np.linspace(-TAN_22_5, TAN_22_5, 101):
        assert control.swash_angle(tangent, p, None) == control.swash_angle(tangent, p, True)


@interpreted
def test_the_other_form_of_the_spool_takes_over_where_angles_are_large(pump: Pump) -> None:
    a, s = sin(1.2), sin(1.1)
    assert a * a + s * s > 1.0
    x = control.spool_balance(a * sqrt(0.05) / 0.008, s, pump._replace(Z4=0.05, Z5=0.008, Z18=0.0))
    assert x == pytest.approx(0.008 * tan(0.1), rel=1e-12)


@interpreted
@given(st.floats(-2.0, 2.0), st.floats(0.0, 1.0))
def test_effective_current_is_beyond_a_symmetric_dead_zone(i: float, Z17: float) -> None:
    found = control.effective_current(i, Z17)
    assert found == pytest.approx(np.sign(i) * max(abs(i) - Z17, 0.0))
    assert faded(found) == pytest.approx(found, abs=1e-30)
    assert soft_threshold(i, 0.0) == i


# --- stroking piston -----------------------------------------------------------------------------


@interpreted
@pytest.mark.parametrize("symmetric", [None, True])
@pytest.mark.parametrize("opening", [1.5e-4, -1.5e-4])
def test_tight_step_integrates_the_rate_exactly(opening: float, symmetric: bool | None) -> None:
    stroking = Stroking(0.1, 0.0, 1.6e6, 1.0e7)
    solution = solve_ivp(
        lambda _, p: [control.pressure_rate(p[0], opening, stroking, symmetric)],
        (0.0, 20 * H),
        [4e5],
        rtol=1e-11,
        atol=1e-3,
    )
    p = 4e5
    for _ in range(20):
        p = control.tight_step(p, opening, stroking, H, symmetric)
    assert p == pytest.approx(solution.y[0, -1], rel=1e-9)


@interpreted
@pytest.mark.parametrize("symmetric", [None, True])
def test_leaky_step_integrates_the_rate(symmetric: bool | None) -> None:
    stroking = Stroking(0.1, 2.0, 1.6e6, 1.0e7)
    solution = solve_ivp(
        lambda _, p: [control.pressure_rate(p[0], -1e-4, stroking, symmetric)],
        (0.0, H),
        [4e5],
        rtol=1e-12,
        atol=1e-4,
    )
    p = control.leaky_step(4e5, -1e-4, stroking, H, symmetric)
    assert p == pytest.approx(solution.y[0, -1], rel=1e-10)


@interpreted
def test_pressure_cannot_be_pumped_beyond_the_supply() -> None:
    p, stroking = 0.0, Stroking(0.0, 0.0, 1e6, 1e6)
    for _ in range(5):
        p = control.tight_step(p, 1.0, stroking, H, None)
    assert p == 1e6
    for _ in range(5):
        p = control.tight_step(p, -1.0, stroking, H, True)
    assert p == -1e6


# --- measured inputs ------------------------------------------------------------------------------


def test_measured_inputs_act_as_they_should(hoist: Drive) -> None:
    """The prime mover's speed scales the flow; the supply's root the rate; a stiff load neither."""
    rigid = hoist.replace(motor_constant=250.0)
    current = np.full(300, 0.6)
    plain = rigid.simulate_current(current)
    fast = rigid.simulate_current(current, pump_speed=1.5)
    np.testing.assert_allclose(fast.shaft_speed, 1.5 * plain.shaft_speed, rtol=1e-14)
    loaded = rigid.simulate_current(current, load_torque=3e4)
    np.testing.assert_array_equal(loaded.shaft_speed, plain.shaft_speed)
    np.testing.assert_allclose(loaded.motor_torque - plain.motor_torque, 3e4)
    weak = rigid.simulate_current(current, supply_pressure=0.5 * hoist["Z9"].value)
    assert weak.stroker_pressure[1] / plain.stroker_pressure[1] == pytest.approx(0.5**0.5, rel=1e-3)
