"""Equations of the full-order model: energy, statics, derivatives."""

from collections.abc import Callable
from math import asin, atan, cos, pi, sin, sqrt, tan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate import PhysicalSet
from swashplate.equations import derive
from swashplate.equations.equation import interpreted
from swashplate.models import full_order, machine
from swashplate.models.full_order import Motion, PlantOptions
from swashplate.models.machine import ATMOSPHERE

pytestmark = pytest.mark.interpreted


def real(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


def plainly(name: str) -> Callable[..., Any]:
    """An equation of the machine in plain Python."""
    return interpreted(getattr(machine, name))


HOIST = PhysicalSet.preset("hoist").machine
D1, MASS, INERTIA, DAMPING, X0 = 0.008, 0.04, 1.1e-6, 8.7, 2e-5
D4, J_SW, M_ST, B_ST, K_R, A_S, PUMPING = 0.08, 5e-3, 0.4, 180.0, 7.6e4, 2.8e-3, 1e-6
MACHINE = HOIST._replace(
    spool_arm=D1,
    spool_mass=MASS,
    feedback_arm_inertia=INERTIA,
    spool_damping=DAMPING,
    feedback_spring_rate=230.0,
    feedback_spring_arm=sqrt(1e-3),
    plussing=X0,
    swash_arm=D4,
    swash_inertia=J_SW,
    piston_mass=M_ST,
    piston_damping=B_ST,
    return_spring_rate=K_R,
    piston_area=A_S,
    pumping_area=5e-4,
    pumping_arm=2e-3,
)
SPRING = 0.23
"""k_f d3². [N m]"""
SPOOL = st.tuples(real(-3e-3, 3e-3), real(-0.5, 0.5), real(-8.0, 8.0), real(-0.6, 0.6))
SWASH = st.tuples(real(-1e6, 1e6), real(-0.3, 0.3), real(-0.5, 0.5), real(-1e6, 1e6))


@given(SPOOL, real(-5.0, 5.0))
def test_spool_conserves_energy(state: tuple[float, ...], arm_rate: float) -> None:
    """dT/dt + dV/dt is what solenoids, damper and the driven arm bring, by Lagrange's energies."""
    x, v, force, sine = state
    arm = asin(sine)
    acceleration = plainly("spool_acceleration")(x, v, force, sine, MACHINE)

    def energy(t: float) -> float:
        # a path with these derivatives at t = 0, its energies from eqs. 6.13 and 6.14 in β
        position = x - X0 + v * t + 0.5 * acceleration * t * t
        velocity = v + acceleration * t
        lever = atan(position / D1)
        turning = velocity / (D1 * (1.0 + tan(lever) ** 2))
        kinetic = 0.5 * INERTIA * turning**2 + 0.5 * MASS * velocity**2
        return kinetic + SPRING * (1.0 - cos(arm + arm_rate * t + lever))

    h = 1e-6
    rate = (8 * (energy(h) - energy(-h)) - (energy(2 * h) - energy(-2 * h))) / (12 * h)
    resisting = SPRING * sin(arm + atan((x - X0) / D1))
    brought = force * v - DAMPING * v * v + resisting * arm_rate
    assert rate == pytest.approx(brought, rel=1e-5, abs=1e-6)
    moment = plainly("feedback_moment")(x, sine, MACHINE)
    assert moment == pytest.approx(resisting, rel=1e-12, abs=1e-15)


@given(SWASH)
def test_swash_plate_conserves_energy(state: tuple[float, ...]) -> None:
    pressure, angle, rate, motor_pressure = state
    acceleration = plainly("swash_acceleration")(
        pressure, tan(angle), rate, motor_pressure, MACHINE
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
    hold = plainly("holding_pressure")(0.25, 1e6, MACHINE)
    assert hold == pytest.approx(expected, rel=1e-14)
    assert plainly("swash_acceleration")(hold, 0.25, 0.0, 1e6, MACHINE) == 0.0


def test_flow_and_pressure_by_hand() -> None:
    # half of 8 MPa - 0 is 4 MPa, whose root is 2000 √Pa
    valve = MACHINE._replace(valve_flow_gain=1.6e-4, supply_pressure=8e6)
    flow = plainly("valve_flow")
    assert flow(1e-4, 0.0, valve, None) == pytest.approx(3.2e-5)
    assert flow(-1e-4, -8e6, valve, True) == 0.0
    # 1e-4 m³/s in, 4e-5 swept, 1e-5 leaked: 5e-5 m³/s into 2e-4 m³ at 1 GPa
    oil = MACHINE._replace(
        piston_area=2e-3, piston_leakage=1e-11, oil_volume=2e-4, bulk_modulus=1e9
    )
    assert plainly("oil_pressure_rate")(1e6, 1e-4, 0.02, oil, None) == pytest.approx(2.5e8)


def test_air_makes_the_oil_soft_by_hand() -> None:
    # 1 % of air at 1.01325 MPa is 0.1 % of the oil's volume; 1/B_e = (1/1 GPa + 0.001/1.01325 MPa)
    # over 1.001: 1.987e-9/Pa
    oil = MACHINE._replace(bulk_modulus=1e9, air_fraction=0.01)
    mixture = plainly("mixture_modulus")
    compressed = (1e-9 + 1e-3 / (10.0 * ATMOSPHERE)) / 1.001
    assert mixture(10.0 * ATMOSPHERE, oil) == pytest.approx(1.0 / compressed, rel=1e-14)
    assert mixture(1e12, oil) == pytest.approx(1e9, rel=1e-6)
    assert mixture(ATMOSPHERE, oil._replace(air_fraction=1.0)) == pytest.approx(
        2.0 * ATMOSPHERE, rel=1e-3
    )
    # the mean of both ends of the cylinder, the same for both signs
    modulus = plainly("oil_modulus")
    valve = oil._replace(supply_pressure=8e6)
    ends = [mixture(4e6 + half + ATMOSPHERE, valve) for half in (1e6, -1e6)]
    assert modulus(2e6, valve, True) == pytest.approx(sum(ends) / 2.0, rel=1e-14)
    assert modulus(-2e6, valve, True) == modulus(2e6, valve, True)
    assert modulus(2e6, valve, None) == 1e9
    # ends cannot fall below the reservoir
    assert modulus(9e6, valve, True) > mixture(ATMOSPHERE, valve) / 2.0


def test_motor_pressure_drop_by_hand() -> None:
    # 25.1 l a turn: 1000 N m need 2π · 1000 / 25.1e-3 m³ = 2.503 bar; Ω' = 250.3 · 0.05 · 0.2
    K = 2.0 * pi / 25.1e-3
    motor = MACHINE._replace(
        motor_constant=K, load_inertia=150.0, load_torque=1000.0, pump_flow_gain=0.05
    )
    assert plainly("motor_drop")(0.0, motor) == pytest.approx(2.503e5, rel=1e-3)
    assert plainly("motor_torque")(0.2, motor) == pytest.approx(1000.0 + 150.0 * K * 0.01)
    assert plainly("pump_flow")(0.25, motor) == pytest.approx(0.0125)


@given(SPOOL, SWASH, st.sampled_from([None, True]), st.sampled_from([None, True]))
def test_slopes_of_the_rates(
    derivative: Callable[..., float],
    spool: tuple[float, ...],
    swash: tuple[float, ...],
    root: bool | None,
    air: bool | None,
) -> None:
    """Generated derivatives by the states against differences, away from the orifices' edges."""
    x, v, force, _ = spool
    pressure, angle, rate, _ = swash
    edges = (MACHINE.orifice_opening_plus, -MACHINE.orifice_opening_minus, 0.0)
    if min(abs(x - edge) for edge in (*edges, MACHINE.spool_stroke, -MACHINE.spool_stroke)) < 2e-6:
        return
    options, oil = PlantOptions(root, air), MACHINE._replace(air_fraction=0.01)
    slopes = derive(full_order.free_rates, by="state", options={"options": options})
    state = Motion(x, v, pressure, angle, rate)
    values = slopes.python(state, force, oil, options)
    rates = interpreted(full_order.free_rates)
    assert values[:3] == rates(state, force, oil, options)
    steps = (1e-6, 1e-3, 1e3, 1e-4, 1e-3)
    for place, (row, column) in enumerate(slopes.entries):

        def one(*state: float, row: int = row) -> float:
            return float(rates(Motion(*state), force, oil, options)[row])

        expected = derivative(one, state, column, steps[column])
        noise = 1e-10 * (abs(values[row]) + 1e3) / steps[column]
        assert values[3 + place] == pytest.approx(expected, rel=1e-5, abs=noise)
