"""The pump's equations against what they stand for, worked out another way."""

from math import atan, sin, sqrt, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from swashplate.equations.equation import interpreted as plainly
from swashplate.equations.library import (
    TAN_22_5,
    arctangent,
    faded,
    small_arctangent,
    soft_threshold,
)
from swashplate.models import displacement_control as control
from swashplate.models import pump as model
from swashplate.models.displacement_control import Pump, PumpOptions
from swashplate.models.pump import PumpInputs
from swashplate.parameters import definitions

H = 1.0 / 512.0
interpreted = pytest.mark.interpreted


def options_of(p: Pump) -> PumpOptions:
    """Options that the values of a pump ask for."""
    return PumpOptions(**dict.fromkeys(definitions.options_of(p._asdict()), True))


def inputs_of(p: Pump, current: float, **others: float) -> PumpInputs:
    given = {"pump_speed": p.pump_speed, "load_torque": p.load_torque, "supply_pressure": p.Z9}
    return PumpInputs(current, **{**given, **others})


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
@given(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6))
def test_spool_solves_the_force_balance(pump: Pump, a: float, s: float) -> None:
    """Kruse eq. 6.19 at rest: k_f d3² [d1 sin α + x cos α]/√(d1² + x²) = (d1² + x²)/d1 · F ...

    ... where the right-hand side is the moment d1 F once the spool's own tilt is neglected
    (tan²β ≪ 1, the assumption below eq. 6.57).
    """
    spring, d1 = 0.23, 0.008
    force = a * spring / d1
    x = control.spool_balance(force, s, pump._replace(Z4=spring**2, Z5=d1, Z18=0.0))
    moment = spring * (d1 * s + x * sqrt(1 - s * s)) / sqrt(d1**2 + x**2)
    assert moment == pytest.approx(d1 * force, rel=1e-9, abs=1e-12)


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
    args = (0.1, 0.0, 1.6e6, 1.0e7)
    solution = solve_ivp(
        lambda _, p: [control.pressure_rate(p[0], opening, *args, symmetric)],
        (0.0, 20 * H),
        [4e5],
        rtol=1e-11,
        atol=1e-3,
    )
    p = 4e5
    for _ in range(20):
        p = control.tight_step(p, opening, *args, H, symmetric)
    assert p == pytest.approx(solution.y[0, -1], rel=1e-9)


@interpreted
@pytest.mark.parametrize("symmetric", [None, True])
def test_leaky_step_integrates_the_rate(symmetric: bool | None) -> None:
    args = (0.1, 2.0, 1.6e6, 1.0e7)
    solution = solve_ivp(
        lambda _, p: [control.pressure_rate(p[0], -1e-4, *args, symmetric)],
        (0.0, H),
        [4e5],
        rtol=1e-12,
        atol=1e-4,
    )
    p = control.leaky_step(4e5, -1e-4, *args, H, symmetric)
    assert p == pytest.approx(solution.y[0, -1], rel=1e-10)


@interpreted
def test_pressure_cannot_be_pumped_beyond_the_supply() -> None:
    p = 0.0
    for _ in range(5):
        p = control.tight_step(p, 1.0, 0.0, 0.0, 1e6, 1e6, H, None)
    assert p == 1e6
    for _ in range(5):
        p = control.tight_step(p, -1.0, 0.0, 0.0, 1e6, 1e6, H, True)
    assert p == -1e6


# --- the pump ------------------------------------------------------------------------------------


def test_the_prime_movers_speed_scales_flow_and_speed(pump: Pump) -> None:
    p = pump._replace(Z12=0.02, load_inertia=5e3, motor_leakage=1e-6)
    options = options_of(p)
    k = plainly(model.pump_constants)(p, H, options)
    state = model.PumpState(4e5)
    slow = plainly(model.pump_sample)(state, inputs_of(p, 0.6), p, k, H, options)
    fast = plainly(model.pump_sample)(state, inputs_of(p, 0.6, pump_speed=1.5), p, k, H, options)
    assert fast.shaft_speed == pytest.approx(1.5 * slow.shaft_speed, rel=1e-14)
    assert fast.motor_torque == pytest.approx(1.5 * slow.motor_torque, rel=1e-14)
    assert fast.swash_angle == slow.swash_angle


def test_a_load_alone_moves_torque_and_pressure_drop_but_no_speed(pump: Pump) -> None:
    """With a stiff line and no leakage the flow sets the speed, whatever the load."""
    p = pump._replace(load_torque=3e4, motor_constant=250.0)
    options = options_of(p)
    k = plainly(model.pump_constants)(p, H, options)
    state = model.PumpState(4e5)
    loaded = plainly(model.pump_sample)(state, inputs_of(p, 0.6), p, k, H, options)
    free = plainly(model.pump_sample)(state, inputs_of(p, 0.6, load_torque=0.0), p, k, H, options)
    assert loaded.shaft_speed == free.shaft_speed
    assert loaded.motor_torque - free.motor_torque == pytest.approx(3e4)
    assert loaded.motor_pressure_drop == pytest.approx(250.0 * 3e4)


def test_a_weaker_supply_makes_the_pump_slower(pump: Pump) -> None:
    options = PumpOptions()
    k = plainly(model.pump_constants)(pump, H, options)
    rises = []
    for share in (1.0, 0.5):
        inputs = inputs_of(pump, 0.7, supply_pressure=share * pump.Z9)
        state = plainly(model.pump_rest)(pump, k, options, inputs)
        signals = plainly(model.pump_sample)(state, inputs, pump, k, H, options)
        rises.append(plainly(model.pump_step)(state, signals, inputs, pump, k, H, options).pressure)
    assert rises[1] / rises[0] == pytest.approx(sqrt(0.5), rel=1e-3)
