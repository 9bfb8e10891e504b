"""Components of the full-order model: energy, statics and twins."""

from collections.abc import Callable
from math import asin, atan, cos, pi, sin, sqrt, tan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate.physics import spool_mechanism, stroker_flow, swash_mechanism
from swashplate.physics.motor_pressure import load_torque, motor_pressure_drop, pump_flow

pytestmark = pytest.mark.interpreted


def real(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


ARM, MASS, INERTIA, DAMPING, SPRING, PLUSSING = 0.008, 0.04, 1.1e-6, 8.7, 0.23, 2e-5
SPOOL = st.tuples(real(-3e-3, 3e-3), real(-0.5, 0.5), real(-8.0, 8.0), real(-0.6, 0.6))

D4, J_SW, M_ST, B_ST, K_R, A_S, PUMPING = 0.08, 5e-3, 0.4, 180.0, 7.6e4, 2.8e-3, 1e-6
SWASH = st.tuples(real(-1e6, 1e6), real(-0.3, 0.3), real(-0.5, 0.5), real(-1e6, 1e6))


@given(SPOOL, real(-5.0, 5.0))
def test_spool_conserves_energy(state: tuple[float, ...], arm_rate: float) -> None:
    """dT/dt + dV/dt is what solenoids, damper and the driven arm bring, by Lagrange's energies."""
    x, v, force, sine = state
    arm = asin(sine)
    acceleration = spool_mechanism.spool_acceleration(
        x, v, force, sine, ARM, MASS, INERTIA, DAMPING, SPRING, PLUSSING
    )

    def energy(t: float) -> float:
        # a path with these derivatives at t = 0, its energies from eqs. 6.13 and 6.14 in β
        position = x - PLUSSING + v * t + 0.5 * acceleration * t * t
        velocity = v + acceleration * t
        lever = atan(position / ARM)
        turning = velocity / (ARM * (1.0 + tan(lever) ** 2))
        kinetic = 0.5 * INERTIA * turning**2 + 0.5 * MASS * velocity**2
        return kinetic + SPRING * (1.0 - cos(arm + arm_rate * t + lever))

    h = 1e-6
    rate = (8 * (energy(h) - energy(-h)) - (energy(2 * h) - energy(-2 * h))) / (12 * h)
    resisting = SPRING * sin(arm + atan((x - PLUSSING) / ARM))
    brought = force * v - DAMPING * v * v + resisting * arm_rate
    assert rate == pytest.approx(brought, rel=1e-5, abs=1e-6)
    moment = spool_mechanism.feedback_moment(x, sine, ARM, SPRING, PLUSSING)
    assert moment == pytest.approx(resisting, rel=1e-12, abs=1e-15)
    parts = spool_mechanism.spool_energy(x, v, sine, ARM, MASS, INERTIA, SPRING, PLUSSING)
    assert sum(parts) == pytest.approx(energy(0.0), rel=1e-9, abs=1e-12)


@given(SWASH)
def test_swash_plate_conserves_energy(state: tuple[float, ...]) -> None:
    pressure, angle, rate, motor_pressure = state
    acceleration = swash_mechanism.swash_acceleration(
        pressure, tan(angle), rate, motor_pressure, D4, J_SW, M_ST, B_ST, K_R, A_S, PUMPING
    )

    def stretch(t: float) -> float:
        return D4 * tan(angle + rate * t + 0.5 * acceleration * t * t)

    def energy(t: float) -> float:
        speed = D4 * (rate + acceleration * t) * (1.0 + (stretch(t) / D4) ** 2)
        turning = rate + acceleration * t
        kinetic = 0.5 * J_SW * turning**2 + 0.5 * M_ST * speed**2
        return kinetic + 0.5 * K_R * stretch(t) ** 2

    h = 1e-6
    change = (8 * (energy(h) - energy(-h)) - (energy(2 * h) - energy(-2 * h))) / (12 * h)
    speed = D4 * rate / cos(angle) ** 2
    brought = pressure * A_S * speed - B_ST * speed**2
    brought -= motor_pressure * PUMPING * cos(angle) * rate
    assert change == pytest.approx(brought, rel=1e-4, abs=1e-5 * (1.0 + abs(brought)))


def test_holding_pressure_by_hand() -> None:
    # tan α = 0.25, w = 1.0625: spring 76 kN/m · 0.08 m · 0.25 = 1520 N; pumping pistons
    # 1 MPa · 1e-6 m³ · cos α / (0.08 m · w) = 11.41 N
    cosine = 1.0 / sqrt(1.0625)
    expected = (1520.0 + 1e6 * 1e-6 * cosine / (0.08 * 1.0625)) / 2.8e-3
    hold = swash_mechanism.holding_pressure(0.25, 1e6, 0.08, 7.6e4, 2.8e-3, 1e-6)
    assert hold == pytest.approx(expected, rel=1e-14)
    at_rest = swash_mechanism.swash_acceleration(
        hold, 0.25, 0.0, 1e6, 0.08, 5e-3, 0.4, 180.0, 7.6e4, 2.8e-3, 1e-6
    )
    assert at_rest == 0.0


def test_flow_and_pressure_by_hand() -> None:
    # half of 8 MPa - 0 is 4 MPa, whose root is 2000 √Pa
    assert stroker_flow.valve_flow(0.0, 1e-4, 1.6e-4, 8e6, None) == pytest.approx(3.2e-5)
    assert stroker_flow.valve_flow(-8e6, -1e-4, 1.6e-4, 8e6, True) == 0.0
    # 1e-4 m³/s in, 4e-5 swept, 1e-5 leaked: 5e-5 m³/s into 2e-4 m³ at 1 GPa
    rate = stroker_flow.oil_pressure_rate(1e6, 1e-4, 0.02, 2e-3, 1e-11, 2e-4, 1e9)
    assert rate == pytest.approx(2.5e8)


def test_motor_pressure_drop_by_hand() -> None:
    # 25.1 l a turn: 1000 N m need 2π · 1000 / 25.1e-3 m³ = 2.503 bar; Ω' = 250.3 · 0.05 · 0.2
    K = 2.0 * pi / 25.1e-3
    assert motor_pressure_drop(1000.0, K) == pytest.approx(2.503e5, rel=1e-3)
    assert load_torque(0.2, 150.0, 1000.0, K, 0.05) == pytest.approx(1000.0 + 150.0 * K * 0.01)
    assert pump_flow(0.25, 0.05) == pytest.approx(0.0125)


@given(SPOOL)
def test_spool_twin(derivative: Callable[..., float], state: tuple[float, ...]) -> None:
    constants = (ARM, MASS, INERTIA, DAMPING, SPRING, PLUSSING)
    value = spool_mechanism.spool_acceleration
    first, *partials = spool_mechanism.spool_acceleration_partials(*state, *constants)
    assert first == value(*state, *constants)
    for k, (partial, h) in enumerate(zip(partials, (1e-5, 1e-3, 1e-2, 1e-4), strict=True)):
        expected = derivative(value, (*state, *constants), k, h)
        scale = abs(expected) + 1e-4 * abs(first) / h * 1e-2
        assert partial == pytest.approx(expected, rel=1e-5, abs=1e-5 * scale + 1e-8)


@given(SWASH)
def test_swash_twin(derivative: Callable[..., float], state: tuple[float, ...]) -> None:
    constants = (D4, J_SW, M_ST, B_ST, K_R, A_S, PUMPING)
    arguments = (state[0], tan(state[1]), state[2], state[3])
    value = swash_mechanism.swash_acceleration
    first, *partials = swash_mechanism.swash_acceleration_partials(*arguments, *constants)
    assert first == value(*arguments, *constants)
    for k, (partial, h) in enumerate(zip(partials, (1e3, 1e-3, 1e-3, 1e3), strict=True)):
        expected = derivative(value, (*arguments, *constants), k, h)
        # the value is a difference of large moments, whose rounding the quotient magnifies
        assert partial == pytest.approx(expected, rel=1e-5, abs=1e-10 * 1e5 / h)


@given(
    real(-6e6, 6e6), real(1e-6, 4e-4), st.sampled_from([1.0, -1.0]), st.sampled_from([None, True])
)
def test_flow_twins(
    derivative: Callable[..., float], pressure: float, size: float, sign: float, root: bool | None
) -> None:
    arguments = (pressure, sign * size, 1.6e-4, 1e7, root)
    first, by_pressure, by_opening = stroker_flow.valve_flow_partials(*arguments)
    assert first == stroker_flow.valve_flow(*arguments)
    slope = derivative(stroker_flow.valve_flow, arguments, 0, 1e3)
    assert by_pressure == pytest.approx(slope, rel=1e-6)
    assert by_opening == pytest.approx(derivative(stroker_flow.valve_flow, arguments, 1, 1e-7))
    speed, by_tangent, by_rate = swash_mechanism.piston_speed_partials(0.2, 0.3, 0.08)
    assert speed == pytest.approx(0.08 * 1.04 * 0.3)
    assert (by_tangent, by_rate) == pytest.approx((0.08 * 0.4 * 0.3, 0.08 * 1.04))
