"""Swash plate and stroking piston in motion (eqs. 6.38, 6.47-6.51)."""

from collections.abc import Callable
from math import tan

import pytest
import sympy as sp

from swashplate import PhysicalSet
from swashplate.equations.equation import interpreted
from swashplate.models import machine
from swashplate.models.machine import Machine

swash_acceleration = interpreted(machine.swash_acceleration)
plate_inertia = interpreted(machine.plate_inertia)
plate_moment = interpreted(machine.plate_moment)

MACHINE = Machine(**PhysicalSet.preset("hoist").numbers)

J, m, b, k, d4, d5, A_s, A_p = sp.symbols("J_sw m_st b_st k_r d4 d5 A_s A_p", positive=True)
K, C_i, C_g, C_q = sp.symbols("K_mf C_i C_g C_q", positive=True)
P, drop = sp.symbols("P drop", real=True)
q, qd, qdd = sp.symbols("alpha alpha_d alpha_dd", real=True)

AROUND = dict.fromkeys((q, qd, qdd, P, drop), (-0.7, 0.7))
TILTED = AROUND | {q: (0.2, 0.6), P: (1.0, 2.0)}
W = 1 + sp.tan(q) ** 2

PRINTED_6_49 = (d4 * qd * W, d4 * qdd * W + 2 * d4 * sp.tan(q) * W * qd**2)


def in_time(expression: sp.Expr) -> sp.Expr:
    return sp.diff(expression, q) * qd + sp.diff(expression, qd) * qdd


def acceleration_of(balance: sp.Expr) -> sp.Expr:
    """The acceleration at which a balance, linear in it, is zero."""
    return -balance.subs(qdd, 0) / sp.diff(balance, qdd)


def piston_force() -> sp.Expr:
    """F_st of 6.48, with the piston's place d4 tan α and its rates."""
    place = d4 * sp.tan(q)
    speed = in_time(place)
    return P * A_s - (m * in_time(speed) + b * speed + k * place)


def plate_balance(lever: sp.Expr) -> sp.Expr:
    """6.38, left minus right, with the load of 6.46 in place of the pressure drop."""
    load = K * (C_i * C_q * K * qd * sp.cos(q) + C_g)
    return J * qdd + load * A_p * d5 * sp.cos(q) - piston_force() * lever


def printed_6_51(arm: sp.Expr) -> sp.Expr:
    """6.51, left minus right; `arm` stands in the load's damping, where d_s is printed."""
    inertia = (J + m * d4**2 * W) * qdd + 2 * m * d4**2 * sp.tan(q) * W * qd**2
    damping = (K**2 * C_i * C_q * A_p * arm * sp.cos(q) ** 2 + b * d4**2 * W) * qd
    right = P * A_s * d4 - K * C_g * A_p * d5 * sp.cos(q)
    return inertia + damping + k * d4**2 * sp.tan(q) - right


def lagrange() -> sp.Expr:
    """The plate with its piston and spring by energies: left minus right.

    Work is done on it by pressure and damper at the piston, by the pumping pistons at the plate.
    """
    speed = in_time(d4 * sp.tan(q))
    kinetic = J * qd**2 / 2 + m * speed**2 / 2
    spring = k * (d4 * sp.tan(q)) ** 2 / 2
    lever = sp.diff(d4 * sp.tan(q), q)
    force = (P * A_s - b * speed) * lever - drop * A_p * d5 * sp.cos(q)
    return in_time(sp.diff(kinetic, qd)) - sp.diff(kinetic - spring, q) - force


def test_eq_6_49_piston_kinematics(gap: Callable) -> None:
    speed = in_time(d4 * sp.tan(q))
    for derived, printed in zip((speed, in_time(speed)), PRINTED_6_49, strict=True):
        assert gap(derived, printed, AROUND).largest < 1e-30


def test_eq_6_50_piston_force_in_the_plates_angle(gap: Callable) -> None:
    printed = m * d4 * W * qdd + 2 * m * d4 * sp.tan(q) * W * qd**2
    printed += b * d4 * W * qd + k * d4 * sp.tan(q) - P * A_s
    assert gap(-piston_force(), printed, AROUND).largest < 1e-30


def test_eq_6_51_from_6_38_and_6_48(gap: Callable) -> None:
    """6.38 as printed, with the lever d4, and 6.47, 6.48, 6.50 give 6.51 with d5."""
    assert gap(plate_balance(d4), printed_6_51(d5), AROUND).largest < 1e-30


def test_erratum_19_eq_6_51_needs_d5(gap: Callable) -> None:
    d_s = sp.symbols("d_s", positive=True)
    assert gap(plate_balance(d4), printed_6_51(d_s), AROUND | {d_s: (2, 3)}).smallest > 1e-4


def test_erratum_16_lever_that_conserves_energy(gap: Callable) -> None:
    """By Lagrange the piston's force has the lever ∂x_st/∂α = d4 (1 + tan²α), not d4."""
    load = K * (C_i * C_q * K * qd * sp.cos(q) + C_g)
    derived = lagrange().subs(drop, load)
    assert gap(plate_balance(d4 * W), derived, AROUND).largest < 1e-30
    assert gap(plate_balance(d4), derived, TILTED).smallest > 1e-4


def test_erratum_16_balance_without_a_load_is_the_same(gap: Callable) -> None:
    """At rest the factor cancels, and 6.53 loses nothing by the printed lever; a load's stays."""
    still = {qd: 0, qdd: 0}
    pressures = []
    for lever in (d4, d4 * W):
        (held,) = sp.solve(plate_balance(lever).subs(still), P)
        pressures.append(held)
    empty = [each.subs(C_g, 0) for each in pressures]
    assert gap(*empty, TILTED).largest < 1e-30
    assert gap(*pressures, TILTED).smallest > 1e-4


def test_eq_6_51_is_what_the_package_integrates(points: Callable) -> None:
    """With the lever of erratum 16, the pressure drop across the motor as an input.

    The plate turns so fast here that every term counts.
    """
    derived = acceleration_of(lagrange())
    pumping = sp.symbols("pumping", positive=True)
    derived = derived.subs(A_p, pumping / d5)
    expected = sp.lambdify((P, q, qd, drop, d4, J, m, b, k, A_s, pumping), derived)
    for at in points(
        (-2e5, 2e5), (-0.3, 0.3), (-50, 50), (-1e6, 1e6), (0.05, 0.1), (1e-3, 1e-2), (0.1, 0.5),
        (0, 300), (5e4, 1e5), (1e-3, 4e-3), (1e-7, 1e-5),
    ):  # fmt: skip
        pressure, angle, rate, across, arm, plate, piston, damping, spring, area, moment = at
        p = MACHINE._replace(
            swash_arm=arm,
            swash_inertia=plate,
            piston_mass=piston,
            piston_damping=damping,
            return_spring_rate=spring,
            piston_area=area,
            pumping_area=moment,
            pumping_arm=1.0,
        )
        found = swash_acceleration(pressure, tan(angle), rate, across, p)
        assert found == pytest.approx(expected(*at), rel=1e-9)
