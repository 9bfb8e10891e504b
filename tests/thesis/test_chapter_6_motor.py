"""Pump flow, motor and load (eqs. 6.39-6.47, 6.69-6.70)."""

from collections.abc import Callable
from math import cos, tan

import numpy as np
import pytest
import sympy as sp

from swashplate import Drive
from swashplate.equations.equation import interpreted
from swashplate.full_order import PhysicalSet
from swashplate.models import machine, pump, refinements
from swashplate.models.machine import Machine

K, K_L, C_i, C_g, C_q, tau = sp.symbols("K_mf K_mL C_i C_g C_q tau", positive=True)
Q, high, low = sp.symbols("Q P_hi P_lo", positive=True)
angle, rate, rise = sp.symbols("alpha alpha_d delta_P_d", real=True)

load_leakage = interpreted(refinements.load_leakage)
motor_drop = interpreted(machine.motor_drop)
motor_pressure_drop = interpreted(refinements.motor_pressure_drop)
motor_torque = interpreted(machine.motor_torque)
pump_flow = interpreted(machine.pump_flow)
shaft_speed = interpreted(pump.shaft_speed)

MACHINE = Machine(**PhysicalSet.preset("hoist").numbers)


def drop_of(stroke: sp.Expr) -> sp.Expr:
    """P_hi - P_lo by 6.39 to 6.43, for a pump whose flow is C_q times a function of α."""
    speed = K * C_q * stroke
    return K * (C_i * sp.diff(speed, angle) * rate + C_g)


def test_eq_6_39_to_6_41_pressure_drop_from_the_work_of_the_motor() -> None:
    """Erratum 17: Q P_hi = Q P_lo + τ K_mf Q gives K_mf τ, K_mf in rad/m³."""
    (solved,) = sp.solve(sp.Eq(Q * high, Q * low + tau * K * Q), high)
    assert sp.expand(solved - low - K * tau) == 0
    for constant, torque in ((250.3, 1000.0), (0.5, -2e4)):
        assert motor_pressure_drop(torque, constant) == constant * torque


def test_erratum_17_motor_constant_is_angle_per_volume() -> None:
    """25.1 l a turn (Hägglunds 84-25100): K_mf = 2π/25.1 l; 4 kN m need 10 bar."""
    hoist = PhysicalSet.preset("hoist")
    assert hoist.numbers["motor_constant"] == pytest.approx(2 * np.pi / 25.1e-3)
    assert motor_pressure_drop(4000.0, hoist.numbers["motor_constant"]) == pytest.approx(
        10.0e5, rel=2e-3
    )


def test_eq_6_42_to_6_46_as_the_package_has_them(points: Callable) -> None:
    """The same chain for a flow that goes with the angle, which the published Z10 belongs to."""
    derived = sp.lambdify((rate, C_i, C_g, K, C_q), drop_of(angle))
    for at in points((-0.5, 0.5), (10, 500), (-5e3, 5e3), (100, 400), (0.02, 0.1)):
        swash_rate, inertia, static, constant, gain = at
        p = MACHINE._replace(
            load_inertia=inertia, load_torque=static, motor_constant=constant, pump_flow_gain=gain
        )
        for found in (
            motor_drop(swash_rate, p),
            motor_pressure_drop(motor_torque(swash_rate, p), constant),
        ):
            assert found == pytest.approx(derived(*at), rel=1e-12)


def test_erratum_18_flow_of_a_swash_plate_pump_goes_with_the_tangent() -> None:
    """A piston at radius r, on a plate inclined by α, moves between ±r tan α along the shaft."""
    r, turn = sp.symbols("r theta", positive=True)
    normal = sp.Matrix([sp.sin(angle), 0, -sp.cos(angle)])
    z = sp.symbols("z", real=True)
    (height,) = sp.solve(normal.dot(sp.Matrix([r * sp.cos(turn), r * sp.sin(turn), z])), z)
    stroke = height.subs(turn, 0) - height.subs(turn, sp.pi)
    assert sp.simplify(stroke - 2 * r * sp.tan(angle)) == 0


def test_eq_6_69_output(points: Callable) -> None:
    for alpha, alpha_rate, Z10, Z11, Z12 in points(
        (-0.3, 0.3), (-0.5, 0.5), (1, 50), (-1, 1), (-2, 2)
    ):
        leakage = load_leakage(tan(alpha), alpha_rate, Z12)
        expected = Z10 * alpha - Z11 - Z12 * cos(alpha) * alpha_rate
        assert shaft_speed(alpha, leakage, Z10, Z11) == pytest.approx(expected, rel=1e-12)


def speed_with_leakage(stroke: sp.Expr) -> sp.Expr:
    """What the flow turns, less K_mL times the load's torque."""
    speed = K * C_q * stroke
    return speed - K_L * (C_i * sp.diff(speed, angle) * rate + C_g)


def test_erratum_22_leakage_goes_with_the_plates_rate(gap: Callable) -> None:
    """6.42 and 6.45 give Z12 cos α dα/dt with the Z12 of 6.70; 6.69 prints cos α δP'."""
    Z11, Z12 = K_L * C_g, K_L * K * C_i * C_q
    derived = speed_with_leakage(sp.sin(angle))
    used, printed = (
        K * C_q * sp.sin(angle) - Z11 - Z12 * sp.cos(angle) * each for each in (rate, rise)
    )
    assert gap(derived, used).largest < 1e-30
    assert gap(derived, printed, {rate: (0.1, 0.2), rise: (0.8, 1.4)}).smallest > 1e-2


def test_erratum_22_no_leakage_by_acceleration_at_a_stop(hoist: Drive) -> None:
    """With 6.69 as printed a pressure that still rises at the stop would slow the shaft."""
    leaking = hoist.replace(Z12=2.0)
    run = leaking.simulate_current(np.full(5000, 0.7))
    at_stop = run.swash_angle == run.swash_angle.max()
    assert at_stop.sum() > 1000
    assert np.all(run.shaft_speed[at_stop] == hoist["Z10"].value * run.swash_angle.max())
    # on the way there the load's acceleration costs speed
    plain = hoist.simulate_current(np.full(5000, 0.7)).shaft_speed
    assert np.all(run.shaft_speed[100:400] < plain[100:400])


def test_eq_6_70_lumps_of_the_motor() -> None:
    physical = PhysicalSet.preset("hoist").replace(
        motor_leakage=1e-6, load_torque=4000.0, load_inertia=300.0
    )
    n = physical.numbers
    lumps = physical.to_lumped()
    assert lumps["Z10"] == pytest.approx(n["motor_constant"] * n["pump_flow_gain"])
    assert lumps["Z11"] == pytest.approx(4e-3)
    assert lumps["Z12"] == pytest.approx(3e-4 * 12.396, rel=1e-9)


def test_erratum_29_a_pump_that_small_turns_no_motor_that_fast() -> None:
    """196 deg/s at 25.1 l a turn is 820 l/min; (250 + 125) cm³ at 1774 rpm give 665 l/min."""
    limit = np.rad2deg(Drive.preset("hoist").steady_speed(10.0))
    needed = limit / 360.0 * 60.0 * 25.1
    assert needed == pytest.approx(820.0, abs=1.0)
    delivered = (0.250 + 0.125) * 1774.0
    assert delivered == pytest.approx(665.0, abs=0.5)
