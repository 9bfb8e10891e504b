"""Spool valve (eqs. 6.11-6.20, 6.57-6.60): motion from the Lagrangian, rest in closed form."""

from collections.abc import Callable
from math import asin, sqrt

import pytest
import sympy as sp

from swashplate import Drive
from swashplate.equations.equation import interpreted
from swashplate.equations.fields import made
from swashplate.full_order import PhysicalSet
from swashplate.models import displacement_control as control
from swashplate.models import machine
from swashplate.models.displacement_control import Pump
from swashplate.models.machine import Machine

d1, d3, J_fa, m_sp, k_f = sp.symbols("d1 d3 J_fa m_sp k_f", positive=True)
x, xd, xdd, F = sp.symbols("x xd xdd F", real=True)
a, ad, add = sp.symbols("alpha alpha_d alpha_dd", real=True)
b, bd, bdd = sp.symbols("beta beta_d beta_dd", real=True)
Z4, Z5 = sp.symbols("Z4 Z5", positive=True)

arm_sine = interpreted(control.arm_sine)
feedback_moment = interpreted(machine.feedback_moment)
feedback_sine = interpreted(machine.feedback_sine)
spool_acceleration = interpreted(machine.spool_acceleration)
spool_balance = interpreted(control.spool_balance)
spool_inertia = interpreted(machine.spool_inertia)

PUMP = made(Pump, Drive.preset("hoist").parameters.numbers)
MACHINE = Machine(**PhysicalSet.preset("hoist").numbers)

AROUND = dict.fromkeys((a, b, x, xd, ad, bd, bdd, add, F), (-0.7, 0.7))

PRINTED_6_14 = k_f * d3**2 * (1 - sp.cos(a + b))
KINETIC = J_fa * ad**2 / 2 + J_fa * bd**2 / 2 + m_sp * (d1 * bd * (1 + sp.tan(b) ** 2)) ** 2 / 2


def spool_of(
    arm: float, mass: float, arm_inertia: float, spring_moment: float, plussing: float
) -> Machine:
    """A machine with an undamped spool; its feedback spring stands at an arm of 1 m."""
    return MACHINE._replace(
        spool_arm=arm,
        spool_mass=mass,
        feedback_arm_inertia=arm_inertia,
        spool_damping=0.0,
        feedback_spring_rate=spring_moment,
        feedback_spring_arm=1.0,
        plussing=plussing,
    )


def in_time(expression: sp.Expr) -> sp.Expr:
    """Total derivative along a motion of both arms."""
    pairs = ((a, ad), (ad, add), (b, bd), (bd, bdd))
    return sum(sp.diff(expression, each) * rate for each, rate in pairs)


def lagrange() -> sp.Expr:
    """Left minus right of eq. 6.15 for β, whose generalised force is F ∂x/∂β."""
    L = KINETIC - PRINTED_6_14
    force = F * sp.diff(d1 * sp.tan(b), b)
    return in_time(sp.diff(L, bd)) - sp.diff(L, b) - force


def printed_6_17(spring: sp.Expr) -> sp.Expr:
    w = 1 + sp.tan(b) ** 2
    left = (J_fa + m_sp * d1**2 * w**2) * bdd + 2 * m_sp * d1**2 * sp.tan(b) * w**2 * bd**2
    return left + spring * sp.sin(a + b) - d1 * F * w


def printed_6_19() -> sp.Expr:
    D = d1**2 + x**2
    left = (m_sp * D**2 + d1**2 * J_fa) / (d1 * D) * xdd - 2 * J_fa * d1 / D**2 * x * xd**2
    spring = k_f * d3**2 / sp.sqrt(D) * (d1 * sp.sin(a) + x * sp.cos(a))
    return left + spring - D / d1 * F


def in_spool_position(expression: sp.Expr) -> sp.Expr:
    """β and its rates by x, from tan β = x/d1 (6.18)."""
    D = d1**2 + x**2
    rate = d1 * xd / D
    second = sp.diff(rate, x) * xd + sp.diff(rate, xd) * xdd
    return expression.subs({bdd: second, bd: rate}).subs(b, sp.atan(x / d1))


def printed_6_57(sin_a: sp.Expr, cos_a: sp.Expr, force: sp.Expr) -> sp.Expr:
    top = -Z5 * Z4 * sin_a * cos_a + Z5**2 * force * sp.sqrt(Z4 - Z5**2 * force**2)
    return top / (Z4 * cos_a**2 - Z5**2 * force**2)


def test_eq_6_11_and_6_12_spool_speed(gap: Callable) -> None:
    printed = d1 * bd * (1 + sp.tan(b) ** 2)
    assert gap(in_time(d1 * sp.tan(b)), printed, AROUND).largest < 1e-30


def test_eq_6_14_spring_energy_of_a_chord(gap: Callable) -> None:
    """A spring between the ends of two arms of length d3 is as long as their chord."""
    ends = [(d3 * sp.sin(angle), d3 * sp.cos(angle)) for angle in (a, -b)]
    stretch = sp.sqrt(sum((one - other) ** 2 for one, other in zip(*ends, strict=True)))
    assert gap(k_f * stretch**2 / 2, PRINTED_6_14, AROUND).largest < 1e-30


def test_eq_6_13_to_6_17_from_the_lagrangian(gap: Callable) -> None:
    assert gap(lagrange(), printed_6_17(k_f * d3**2), AROUND).largest < 1e-30


def test_erratum_08_eq_6_17_needs_d3_squared(gap: Callable) -> None:
    assert gap(lagrange(), printed_6_17(k_f * d3), AROUND).smallest > 1e-3


def test_eq_6_18_and_6_19_spool_lagrangian(gap: Callable) -> None:
    """6.19 as printed is 6.15 in x, its inertia terms included."""
    assert gap(in_spool_position(lagrange()), printed_6_19(), AROUND).largest < 1e-30


def test_eq_6_19_is_what_the_package_integrates(points: Callable) -> None:
    balance = in_spool_position(lagrange())
    acceleration = -balance.subs(xdd, 0) / sp.diff(balance, xdd)
    spring = sp.symbols("spring", positive=True)
    derived = acceleration.subs(k_f, spring / d3**2)
    expected = sp.lambdify((x, xd, F, a, d1, m_sp, J_fa, spring), derived)
    x0 = 2e-5
    for at in points(
        (-3e-3, 3e-3), (-0.5, 0.5), (-8, 8), (-0.6, 0.6), (5e-3, 0.01), (0.01, 0.1), (1e-7, 1e-5),
        (0.1, 0.5),
    ):  # fmt: skip
        position, speed, force, arm, *machine = at
        p = spool_of(*machine, x0)
        found = spool_acceleration(position + x0, speed, force, float(sp.sin(arm)), p)
        assert found == pytest.approx(expected(*at), rel=1e-9)


def test_eq_6_20_and_6_59_arm_follows_the_plate(points: Callable) -> None:
    """The ball of the control arm moves with the stroking piston, d3 sin α = d4 tan α_sw."""
    for pressure, Z1, d4, d3_ in points((-6e5, 6e5), (3e-7, 6e-7), (0.05, 0.1), (0.12, 0.2)):
        piston = d4 * Z1 * pressure
        p = PUMP._replace(Z1=Z1, Z2=0.0, Z3=d4 / d3_)
        assert arm_sine(pressure, p) == pytest.approx(piston / d3_, rel=1e-12)
        machine = MACHINE._replace(swash_arm=d4, control_arm=d3_)
        found = feedback_sine(Z1 * pressure, machine)
        assert found == pytest.approx(piston / d3_, rel=1e-12)


def test_eq_6_57_rests_where_6_19_balances(gap: Callable) -> None:
    """With tan²β neglected beside 1: k_f d3² sin(α + β) = d1 F, Z4 and Z5 as in 6.58."""
    used = printed_6_57(sp.sin(a), sp.cos(a), F)
    balance = printed_6_19().subs({xd: 0, xdd: 0})
    weak = balance + (d1**2 + x**2) / d1 * F - d1 * F
    lumped = weak.subs(k_f, sp.sqrt(Z4) / d3**2).subs(d1, Z5).subs(x, used)
    ranges = AROUND | {F: (-0.3, 0.3), Z4: (0.5, 1.4), Z5: (0.5, 1.2)}
    assert gap(lumped + 1, sp.Integer(1), ranges).largest < 1e-30


@pytest.mark.parametrize("sign", [1, -1])
def test_erratum_21_eq_6_57_has_a_closed_form(gap: Callable, sign: int) -> None:
    """The quadratic's root is Z5 tan(φ - α) for forces of either sign."""
    printed = printed_6_57(sp.sin(a), sp.cos(a), sign * F)
    closed = Z5 * sp.tan(sp.asin(sign * Z5 * F / sp.sqrt(Z4)) - a)
    ranges = {a: (-0.5, 0.5), F: (0.05, 0.4), Z4: (0.8, 1.4), Z5: (0.5, 1.2)}
    assert gap(printed, closed, ranges).largest < 1e-30


def test_eq_6_57_other_root_is_that_of_the_opposite_force(gap: Callable) -> None:
    """Squaring the balance brings in the root of -F, so only one root is physical, as stated."""
    s, c = sp.sin(a), sp.cos(a)
    root = Z5**2 * F * sp.sqrt(Z4 - Z5**2 * F**2)
    other = (-Z5 * Z4 * s * c - root) / (Z4 * c**2 - Z5**2 * F**2)
    ranges = {a: (-0.5, 0.5), F: (0.05, 0.4), Z4: (0.8, 1.4), Z5: (0.5, 1.2)}
    squared = Z4 * (Z5 * s + x * c) ** 2 - Z5**2 * F**2 * (Z5**2 + x**2)
    assert gap(squared.subs(x, other) + 1, sp.Integer(1), ranges).largest < 1e-30
    assert gap(other, printed_6_57(s, c, -F), ranges).largest < 1e-30


def test_eq_6_57_is_what_the_package_computes(points: Callable) -> None:
    """The printed quadratic in floats, over every force and angle of the published drives."""
    printed = sp.lambdify((F, a, Z4, Z5), printed_6_57(sp.sin(a), sp.cos(a), F))
    for moment, sine, square, arm in points((-0.6, 0.6), (-0.5, 0.5), (0.01, 0.3), (7e-3, 0.014)):
        force = moment * sqrt(square) / arm
        found = spool_balance(force, sine, PUMP._replace(Z4=square, Z5=arm, Z18=3e-5))
        assert found - 3e-5 == pytest.approx(printed(force, asin(sine), square, arm), abs=1e-14)


def test_eq_6_58_and_6_60_lumps_of_the_spool() -> None:
    physical = PhysicalSet.preset("hoist").replace(
        feedback_spring_rate=300.0, feedback_spring_arm=0.03, spool_arm=0.008, control_arm=0.1,
        swash_arm=0.07,
    )  # fmt: skip
    lumps = physical.to_lumped()
    assert lumps["Z4"] == pytest.approx(300.0**2 * 0.03**4)
    assert (lumps["Z5"], lumps["Z3"]) == (0.008, pytest.approx(0.7))


def test_erratum_09_fitted_arms_are_no_geometry() -> None:
    """Slew and luff have one type of pump, AA4V250: their Z3 = d4/d3 and Z5 = d1 should agree."""
    slew, luff = Drive.preset("slew"), Drive.preset("luff")
    assert luff["Z3"].value / slew["Z3"].value == pytest.approx(19.3, abs=0.05)
    assert luff["Z5"].value / slew["Z5"].value == pytest.approx(1.19, abs=0.005)
