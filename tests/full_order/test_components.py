"""Equations of the five-state machine by hand.

Energies and printed equations are compared in tests/thesis, derivatives in tests/equations.
"""

from collections.abc import Callable
from math import pi, sqrt
from typing import Any

import pytest

from swashplate import PhysicalSet
from swashplate.equations.equation import interpreted
from swashplate.models import machine
from swashplate.models.machine import ATMOSPHERE

pytestmark = pytest.mark.interpreted


def plainly(name: str) -> Callable[..., Any]:
    """An equation of the machine in plain Python."""
    return interpreted(getattr(machine, name))


MACHINE = PhysicalSet.preset("hoist").machine._replace(
    swash_arm=0.08,
    return_spring_rate=7.6e4,
    piston_area=2.8e-3,
    pumping_area=5e-4,
    pumping_arm=2e-3,
)


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
