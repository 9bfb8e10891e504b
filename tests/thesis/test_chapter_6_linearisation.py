"""Small motions (section 6.2.6, eqs. 6.72-6.74): the nonlinear model differentiated at rest."""

from collections.abc import Callable
from math import sqrt

import pytest
import sympy as sp

from swashplate import Drive
from swashplate.equations import derive
from swashplate.equations.fields import made
from swashplate.models.displacement_control import Pump, Stroking, pressure_rate, spool_balance

d1, d3, d4, k_f, A_s, k_r, C_o, B, V = sp.symbols("d1 d3 d4 k_f A_s k_r C_o B V", positive=True)
F, plate, rise, x, Delta, P0 = sp.symbols("F alpha_sw delta_P x_eff Delta_P P0", real=True)
Z = {n: sp.symbols(f"Z{n}", positive=True) for n in (1, 3, 4, 5, 6, 8, 9, 10)}

LUMPS = {Z[3]: d4 / d3, Z[4]: k_f**2 * d3**4, Z[5]: d1}

SPOOL = Z[5] * sp.tan(sp.asin(Z[5] * F / sp.sqrt(Z[4])) - sp.asin(Z[3] * sp.tan(plate)))
RATE = Z[8] * sp.sqrt((Z[9] - rise) / 2) * x / (1 + Z[6])
PLATE = sp.atan(Z[1] * rise)

REST = {F: 0, plate: 0, rise: 0, x: 0}

TAU = {"hoist": 0.1214, "slew": 0.2066, "luff": 0.2015}


def slope(expression: sp.Expr, by: sp.Symbol) -> sp.Expr:
    return sp.diff(expression, by).subs(REST)


def printed_6_72() -> sp.Expr:
    top = -d1 * d3**4 * k_f**2 * plate + d1 * F * sp.sqrt(k_f**2 * d3**4 - d1**2 * F**2)
    return top / (k_f**2 * d3**4 - d1**2 * F**2)


def time_constant(Z6: float, numbers: dict) -> float:
    head = sqrt(numbers["Z9"] / 2.0)
    loop = numbers["Z1"] * numbers["Z3"] * numbers["Z5"] * numbers["Z8"] * head
    return (1.0 + Z6) / loop


def test_eq_6_72_spool_by_lumps(gap: Callable) -> None:
    """x ≈ (Z5²/√Z4) F - Z3 Z5 α_sw."""
    assert gap(slope(SPOOL, F), Z[5] ** 2 / sp.sqrt(Z[4])).largest < 1e-30
    assert gap(slope(SPOOL, plate), -Z[3] * Z[5]).largest < 1e-30


def test_erratum_23_eq_6_72_lacks_an_arm_and_the_ratio_of_arms(gap: Callable) -> None:
    """Printed -d1 α_sw + F d1/(k_f d3²), right -(d4/d3) d1 α_sw + F d1²/(k_f d3²)."""
    for by, missing in ((F, d1), (plate, d4 / d3)):
        right = slope(SPOOL.subs(LUMPS), by)
        printed = slope(printed_6_72(), by)
        assert gap(right, printed * missing).largest < 1e-30


def test_eq_6_73_plate(gap: Callable) -> None:
    printed = A_s / (k_r * d4)
    assert gap(slope(PLATE, rise).subs(Z[1], printed), printed).largest < 1e-30


def test_erratum_23_eq_6_74_goes_with_the_opening(gap: Callable) -> None:
    """δP' = C_o B/V √((ΔP - P0)/2)/(1 + Z6) x_eff; printed with α_sw and without 1 + Z6."""
    lumps = {Z[8]: C_o * B / V, Z[9]: Delta - P0, Z[6]: A_s**2 * B / (k_r * V)}
    by_opening = slope(RATE, x).subs(lumps)
    printed = C_o * B / V * sp.sqrt((Delta - P0) / 2)
    ranges = {Delta: (3.0, 4.0), P0: (0.2, 0.8)}
    assert gap(by_opening, printed / (1 + A_s**2 * B / (k_r * V)), ranges).largest < 1e-30
    assert gap(by_opening, printed, ranges).smallest > 1e-2
    assert slope(RATE, plate) == 0
    assert slope(RATE, rise) == 0


def test_first_order_transfer_function_from_force_to_speed(gap: Callable) -> None:
    """Section 6.2.6: gain Z10 Z5/(Z3 √Z4), lag (1 + Z6)/(Z1 Z3 Z5 Z8 √(Z9/2))."""
    s, pressure = sp.symbols("s pressure")
    opening = slope(SPOOL, F) * F + slope(SPOOL, plate) * slope(PLATE, rise) * pressure
    (solved,) = sp.solve(s * pressure - slope(RATE, x) * opening, pressure)
    transfer = Z[10] * slope(PLATE, rise) * solved / F
    lag = (1 + Z[6]) / (Z[1] * Z[3] * Z[5] * Z[8] * sp.sqrt(Z[9] / 2))
    expected = Z[10] * Z[5] / (Z[3] * sp.sqrt(Z[4])) / (1 + lag * s)
    assert gap(transfer, expected).largest < 1e-30


@pytest.mark.parametrize("name", TAU)
def test_linear_model_of_the_package_at_rest(name: str) -> None:
    """Gain and lag of the package's own linearisation, by the formulas derived above."""
    drive = Drive.preset(name).replace(Z18=0.0)
    numbers = drive.parameters.numbers
    model = drive.linearize(current=0.0, input="solenoid_force")
    assert model.time_constant == pytest.approx(time_constant(numbers["Z6"], numbers), rel=1e-12)
    assert model.time_constant == pytest.approx(TAU[name], abs=5e-5)
    gain = numbers["Z10"] * numbers["Z5"] / (numbers["Z3"] * sqrt(numbers["Z4"]))
    assert model.gain == pytest.approx(gain, rel=1e-12)


def test_erratum_04_time_constant_needs_1_plus_z6() -> None:
    """Without it the luff would be fourteen times as fast as it is."""
    luff = Drive.preset("luff").parameters.numbers
    assert time_constant(luff["Z6"], luff) == pytest.approx(0.2015, abs=5e-5)
    assert time_constant(0.0, luff) == pytest.approx(0.0142, abs=5e-5)


def test_slopes_away_from_rest(points: Callable, hoist: Drive) -> None:
    """The partial derivatives that a linear model is made of, by SymPy at any point."""
    s = sp.symbols("s", real=True)
    free = Z[5] * sp.tan(sp.asin(Z[5] * F / sp.sqrt(Z[4])) - sp.asin(s))
    arguments = (F, s, Z[4], Z[5])
    derived = sp.lambdify(arguments, [sp.diff(free, each) for each in arguments])
    spool = derive(spool_balance, by=("force", "arm_sine", "p.Z4", "p.Z5"))
    assert spool.entries == tuple((0, n) for n in range(4))
    pump = made(Pump, hoist.parameters.numbers)
    for moment, sine, square, arm in points((-0.6, 0.6), (-0.5, 0.5), (0.01, 0.3), (7e-3, 0.014)):
        force = moment * sqrt(square) / arm
        found = spool.python(force, sine, pump._replace(Z4=square, Z5=arm, Z18=0.0))[1:]
        assert found == pytest.approx(derived(force, sine, square, arm), rel=1e-9)
    rates = (rise, x, Z[6], Z[8], Z[9])
    derived = sp.lambdify(rates, [sp.diff(RATE, each) for each in rates])
    by = ("pressure", "opening", "p.Z6", "p.Z8", "p.Z9")
    oil = derive(pressure_rate, by=by, options={"symmetric": None})
    assert oil.entries == tuple((0, n) for n in range(5))
    for at in points((-6e5, 6e5), (-2e-4, 2e-4), (0.05, 15), (5e5, 2e6), (8e6, 3e7)):
        found = oil.python(*at[:2], Stroking(at[2], 0.0, *at[3:]), None)[1:]
        assert found == pytest.approx(derived(*at), rel=1e-12)
