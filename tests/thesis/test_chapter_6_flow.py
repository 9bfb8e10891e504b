"""Flow and stroker pressure (eqs. 6.21-6.37)."""

from collections.abc import Callable
from dataclasses import replace
from math import inf

import numpy as np
import pytest
import sympy as sp

from swashplate import Drive, PhysicalSet, maneuvers
from swashplate.equations.equation import interpreted
from swashplate.equations.fields import made
from swashplate.models import displacement_control as control
from swashplate.models import machine
from swashplate.models.displacement_control import Pump
from swashplate.models.machine import Machine

A_A, A_S, rho, C_d, k = sp.symbols("A_A A_S rho C_d k", positive=True)
supply, tank, port_a, port_b = sp.symbols("supply tank port_a port_b", real=True)
speed_wide, speed_narrow = sp.symbols("speed_wide speed_narrow", positive=True)
P, Delta, x = sp.symbols("P Delta_P x", real=True)

oil_pressure_rate = interpreted(machine.oil_pressure_rate)
orifice_opening = interpreted(control.orifice_opening)
piston_speed = interpreted(machine.piston_speed)
flow_head = interpreted(control.flow_head)
valve_flow = interpreted(machine.valve_flow)
valve_opening = interpreted(machine.valve_opening)

MACHINE = Machine(**PhysicalSet.preset("hoist").numbers)
UNLIMITED = MACHINE._replace(spool_stroke=inf, orifice_opening_plus=inf, orifice_opening_minus=inf)

PRESSURES = {supply: (8.0, 9.0), port_a: (5.0, 7.0), port_b: (3.0, 4.0), tank: (0.1, 1.0)}
AREAS = {A_A: (0.1, 0.5), A_S: (0.8, 1.4)}


def orifice_flow(before: sp.Expr, behind: sp.Expr, wide: sp.Expr, narrow: sp.Expr) -> sp.Expr:
    """Flow from a wide into a narrow section, by energy (6.21) and continuity (6.22)."""
    energy = sp.Eq(speed_wide**2 / 2 + before / rho, speed_narrow**2 / 2 + behind / rho)
    speed = sp.solve(energy.subs(speed_wide, speed_narrow * narrow / wide), speed_narrow)
    (positive,) = [each for each in speed if each.subs(NUMBERS).is_positive]
    return positive * narrow


NUMBERS = {supply: 9, port_a: 5, port_b: 4, tank: 1, rho: 1, A_A: sp.Rational(1, 2), A_S: 1}


def printed_6_24(area: sp.Expr, drop: sp.Expr) -> sp.Expr:
    return C_d * area / sp.sqrt(1 - (A_A / A_S) ** 2) * sp.sqrt(2 / rho * drop)


def test_eq_6_21_to_6_23_orifice_flow(gap: Callable) -> None:
    derived = orifice_flow(supply, port_a, A_S, A_A)
    printed = printed_6_24(A_A, supply - port_a) / C_d
    assert gap(derived, printed, PRESSURES | AREAS).largest < 1e-30


def test_eq_6_24_and_erratum_10_return_flow_has_the_orifices_area(gap: Callable) -> None:
    """6.25 and 6.29 print A_S in the numerator; the return orifice is as wide as the other."""
    derived = C_d * orifice_flow(port_b, tank, A_S, A_A)
    used, printed = (printed_6_24(area, port_b - tank) for area in (A_A, A_S))
    assert gap(derived, used, PRESSURES | AREAS).largest < 1e-30
    assert gap(derived, printed, PRESSURES | AREAS).smallest > 0.3


def test_eq_6_26_equal_flows_halve_the_pressure() -> None:
    flows = sp.Eq(printed_6_24(A_A, supply - port_a) ** 2, printed_6_24(A_A, port_b - tank) ** 2)
    (solved,) = sp.solve(flows, port_b)
    assert sp.expand(solved - (supply - port_a + tank)) == 0


def test_erratum_11_eq_6_27_stroker_pressure_is_a_less_b() -> None:
    """6.28 says port_b = port_a - P, which is P = port_a - port_b; 6.27 prints the opposite."""
    (used,) = sp.solve(sp.Eq(port_b, port_a - P), P)
    assert sp.expand(used - (port_a - port_b)) == 0
    assert sp.expand(used - (port_b - port_a)) != 0


def heads() -> tuple[sp.Expr, sp.Expr]:
    """Pressure drop over each orifice, the spool open forwards and backwards, by ΔP and P."""
    ports = [port_a, port_b, tank]
    given = [supply - tank - Delta, port_a - port_b - P]  # 6.27, with the sign of 6.28
    forward = sp.solve([supply - port_a - (port_b - tank), *given], ports)
    back = sp.solve([supply - port_b - (port_a - tank), *given], ports)
    return sp.expand(supply - forward[port_a]), sp.expand(supply - back[port_b])


def test_eq_6_28_to_6_30_both_orifices_share_what_the_piston_leaves() -> None:
    forward, _ = heads()
    assert sp.expand(forward - (Delta - P) / 2) == 0


def test_erratum_12_eq_6_31_flow_is_larger_by_root_2(gap: Callable) -> None:
    """Printed √((ΔP - P)/(2ρ)), right √((ΔP - P)/ρ); the lump C_o takes the factor up."""
    forward, _ = heads()
    true = printed_6_24(A_A, forward).subs(A_A, k * x)
    printed = C_d * k * x * sp.sqrt((Delta - P) / (2 * rho)) / sp.sqrt(1 - (k * x / A_S) ** 2)
    ranges = {Delta: (2.0, 3.0), P: (-1.0, 1.0), x: (0.1, 0.3), A_S: (0.8, 1.4)}
    assert gap(true, sp.sqrt(2) * printed, ranges).largest < 1e-30
    # 6.35 with C_o: the root over (ΔP - P)/2 stays, 6.37 becomes C_d k √(2/ρ)/√(1 - (k x/A_S)²)
    C_o = C_d * k * sp.sqrt(2 / rho) / sp.sqrt(1 - (k * x / A_S) ** 2)
    assert gap(true, C_o * sp.sqrt((Delta - P) / 2) * x, ranges).largest < 1e-30


def test_erratum_13_backwards_the_head_grows_with_the_pressure(points: Callable) -> None:
    """√((ΔP - sgn(x) P)/2): with the ports exchanged the piston's pressure helps the flow."""
    _, back = heads()
    assert sp.expand(back - (Delta + P) / 2) == 0
    for pressure, ahead in points((-5e6, 5e6), (6e6, 2e7)):
        assert flow_head(pressure, -1e-4, ahead, True)[0] == pytest.approx((ahead + pressure) / 2)
        assert flow_head(pressure, 1e-4, ahead, True)[0] == pytest.approx((ahead - pressure) / 2)
        assert flow_head(pressure, -1e-4, ahead, None)[0] == pytest.approx((ahead - pressure) / 2)


@pytest.mark.parametrize(
    ("test", "deg_s"), [("sine 9 V 0.1 Hz", 0.7), ("ramp +1 V/s", 0.7), ("step +9 V", 5.6)]
)
def test_erratum_13_what_the_root_changes_on_the_hoist(
    hoist: Drive, test: str, deg_s: float
) -> None:
    """The right root with parameters that were fitted with the other one."""
    right = Drive(replace(hoist.parameters, pressure_root="symmetric"))
    voltage = maneuvers.source_tests("hoist")[test].sample(512.0)
    change = right.simulate(voltage).shaft_speed - hoist.simulate(voltage).shaft_speed
    assert np.rad2deg(np.abs(change).max()) == pytest.approx(deg_s, abs=0.05)


def test_eq_6_32_to_6_35_stroker_pressure(points: Callable) -> None:
    """q = A_s x_st' + V/B P' + K_L P solved for P', with x_st' of 6.34, which is d/dt d4 tan α."""
    q, rate, B, V, K_L, d4, area, angle, turning = sp.symbols("q P_d B V K_L d4 A_s alpha alpha_d")
    swept = sp.diff(d4 * sp.tan(angle), angle) * turning
    (derived,) = sp.solve(sp.Eq(q, area * swept + V / B * rate + K_L * P), rate)
    expected = sp.lambdify((P, q, angle, turning, d4, area, K_L, V, B), derived)
    for at in points(
        (-2e6, 2e6), (-1e-4, 1e-4), (-0.3, 0.3), (-0.5, 0.5), (0.05, 0.1), (1e-3, 4e-3),
        (0, 1e-11), (1e-4, 4e-4), (5e8, 2e9),
    ):  # fmt: skip
        pressure, flow, alpha, alpha_rate, lever, *oil = at
        piston_area, leakage, volume, bulk = oil
        p = MACHINE._replace(
            swash_arm=lever,
            piston_area=piston_area,
            piston_leakage=leakage,
            oil_volume=volume,
            bulk_modulus=bulk,
        )
        speed = piston_speed(float(np.tan(alpha)), alpha_rate, p)
        found = oil_pressure_rate(pressure, flow, speed, p, None)
        assert found == pytest.approx(expected(*at), rel=1e-9)


def test_eq_6_35_valve_flow(points: Callable) -> None:
    for pressure, opening, gain, ahead in points(
        (-5e6, 5e6), (-2e-4, 2e-4), (1e-4, 2e-4), (6e6, 1e7)
    ):
        expected = gain * np.sqrt((ahead - pressure) / 2.0) * opening
        p = UNLIMITED._replace(valve_flow_gain=gain, supply_pressure=ahead)
        assert valve_flow(opening, pressure, p, None) == pytest.approx(expected)


def test_erratum_14_swept_flow_needs_the_stroking_pistons_area() -> None:
    """6.33 and 6.35 print A_p; 6.48 and Z6 = A_s² B/(k_r V) have the piston that 6.34 moves."""
    A_p, A_s, d4, B, V, k_r = sp.symbols("A_p A_s d4 B V k_r", positive=True)
    Z1 = A_s / (k_r * d4)
    swept = [area * B / V * d4 * Z1 for area in (A_p, A_s)]
    lump = A_s**2 * B / (k_r * V)
    assert sp.simplify(swept[1] - lump) == 0
    assert sp.simplify(swept[0] - lump) != 0


def test_eq_6_36_opening_is_limited_both_ways(hoist: Drive) -> None:
    lumped = made(Pump, hoist.parameters.numbers)._replace(Z14=1e-4, Z16_plus=1.0, Z16_minus=1.0)
    physical = UNLIMITED._replace(spool_stroke=1e-4)
    for x_, expected in ((-3e-4, -1e-4), (-5e-5, -5e-5), (0.0, 0.0), (5e-5, 5e-5), (3e-4, 1e-4)):
        assert orifice_opening(x_, lumped) == expected
        assert valve_opening(x_, physical) == expected
