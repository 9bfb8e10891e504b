"""From five states to one (eqs. 6.52-6.71): equilibria, lumps, limits, stated frequencies."""

from collections.abc import Callable
from math import pi, sqrt, tan

import numpy as np
import pint
import pytest
import sympy as sp

from swashplate import Drive, maneuvers
from swashplate.equations.equation import interpreted
from swashplate.equations.fields import made
from swashplate.full_order import QUANTITIES, FullOrderDrive, PhysicalSet
from swashplate.models import displacement_control as control
from swashplate.models import machine
from swashplate.models.displacement_control import Pump, Stroking
from swashplate.models.machine import Machine
from swashplate.parameters import CATALOGUE

holding_pressure = interpreted(machine.holding_pressure)
static_pressure = interpreted(machine.static_pressure)
orifice_opening = interpreted(control.orifice_opening)
pressure_rate = interpreted(control.pressure_rate)
solenoid_force = interpreted(control.solenoid_force)
swash_angle = interpreted(control.swash_angle)
swash_rate = interpreted(control.swash_rate)
swash_tangent = interpreted(control.swash_tangent)

A_s, A_p, B, V, k_r, d4, d5 = sp.symbols("A_s A_p B V k_r d4 d5", positive=True)
C_o, K_L, K, C_g, Delta, P0 = sp.symbols("C_o K_L K_mf C_g Delta_P P0", positive=True)
rise, rise_rate, tangent, x = sp.symbols("delta_P delta_P_d tan_alpha x_eff", real=True)

Z1_OF = A_s / (k_r * d4)
STATIC = K * C_g * A_p * d5 / (A_s * d4)

PUMP = made(Pump, Drive.preset("hoist").parameters.numbers)


def equilibrium(static: sp.Expr) -> sp.Expr:
    """tan α that 6.53 gives with cos α = 1."""
    balance = k_r * d4**2 * tangent - ((static + rise) * A_s * d4 - K * C_g * A_p * d5)
    (solved,) = sp.solve(balance, tangent)
    return sp.expand(solved)


def pressure_equation() -> sp.Expr:
    """δP' of 6.35 with 6.52 and 6.63 put in: the plate follows the pressure."""
    P = P0 + rise
    turning = Z1_OF * rise_rate / (1 + tangent**2)
    swept = A_s * B / V * d4 * (1 + tangent**2) * turning
    balance = rise_rate + K_L * B / V * P + swept - C_o * B / V * sp.sqrt((Delta - P) / 2) * x
    (solved,) = sp.solve(balance, rise_rate)
    return solved


def test_eq_6_52_to_6_54_static_pressure() -> None:
    """P0 holds the load with the plate upright and no δP."""
    (solved,) = sp.solve(equilibrium(P0).subs(rise, 0), P0)
    assert sp.simplify(solved - STATIC) == 0
    physical = PhysicalSet.preset("hoist").replace(load_torque=4000.0)
    n = physical.numbers
    found = static_pressure(Machine(**n))
    assert found == pytest.approx(
        n["motor_constant"] * 4000.0 * 5e-4 * 2e-3 / (n["piston_area"] * 0.08), rel=1e-12
    )
    held = holding_pressure(0.0, n["motor_constant"] * 4000.0, Machine(**n))
    assert held == pytest.approx(found, rel=1e-12)


def test_eq_6_55_follows_from_6_53() -> None:
    """Erratum 20: tan α = Z1 δP, by the force balance and not, as the text says, by 6.46."""
    assert sp.simplify(equilibrium(STATIC) - Z1_OF * rise) == 0


def test_erratum_20_eq_6_56_offset_is_zero_and_a_ratio() -> None:
    """Z2 = K_mf C_g A_p d5/(k_r d4²) - Z1 P0; printed is P0, a pressure, in place of Z1 P0."""
    offset = -equilibrium(P0).subs(rise, 0)
    load = K * C_g * A_p * d5 / (k_r * d4**2)
    assert sp.simplify(offset - (load - Z1_OF * P0)) == 0
    assert sp.simplify((load - Z1_OF * P0).subs(P0, STATIC)) == 0
    assert sp.simplify((load - P0).subs(P0, STATIC)) != 0


def test_erratum_01_eq_6_61_on_the_signed_current() -> None:
    """Printed, the force of every current below Z17 is none, that of the other solenoid too."""
    plus, minus = (12.0, 0.3, 0.2, 0.0), (10.0, 3.7, 1.7, -54.0)
    p = PUMP._replace(
        Z17=0.27,
        **{f"Z{n}_plus": each for n, each in enumerate(plus, 19)},
        **{f"Z{n}_minus": each for n, each in enumerate(minus, 19)},
    )
    for current in (0.28, 0.5, 0.7):
        e = current - 0.27
        expected = 12.0 * e + 0.3 * e**2 + 0.2 * e**3
        assert solenoid_force(current, p) == pytest.approx(expected, rel=1e-12)
        e = -e
        expected = 10.0 * e + 3.7 * e**2 + 1.7 * e**3 - 54.0 * e**4
        assert solenoid_force(-current, p) == pytest.approx(expected, rel=1e-12)
    assert solenoid_force(0.2, p) == 0.0
    assert solenoid_force(-0.2, p) == 0.0


@pytest.mark.parametrize(
    ("test", "deg_s"), [("sine 9 V 0.1 Hz", 68.9), ("step -9 V", 69.5), ("ramp -1 V/s", 75.8)]
)
def test_erratum_01_what_odd_symmetry_would_cost_on_the_hoist(
    hoist: Drive, test: str, deg_s: float
) -> None:
    """-poly(|i|) in place of poly(i) is the same as even coefficients of the other sign."""
    odd = hoist.replace(Z20_minus=-3.7297, Z22_minus=54.153)
    voltage = maneuvers.source_tests("hoist")[test].sample(512.0)
    change = odd.simulate(voltage).shaft_speed - hoist.simulate(voltage).shaft_speed
    assert np.rad2deg(np.abs(change).max()) == pytest.approx(deg_s, abs=0.05)


def test_eq_6_62_to_6_68_lumps_of_the_pressure(points: Callable) -> None:
    """δP' derived with physical quantities is the package's with its lumps, at no static load."""
    derived = sp.lambdify(
        (rise, x, A_s, B, V, k_r, C_o, K_L, Delta), pressure_equation().subs({P0: 0, d4: 0.08})
    )
    physical = PhysicalSet.preset("hoist").replace(piston_leakage=3e-12)
    n, lumps = physical.numbers, physical.to_lumped()
    names = ["piston_area", "bulk_modulus", "oil_volume", "return_spring_rate"]
    names += ["valve_flow_gain", "piston_leakage", "supply_pressure"]
    quantities = [n[each] for each in names]
    stroking = Stroking(*(lumps[name] for name in Stroking._fields))
    for pressure, opening in points((-6e5, 6e5), (-2e-4, 2e-4)):
        found = pressure_rate(pressure, opening, stroking, None)
        assert found == pytest.approx(derived(pressure, opening, *quantities), rel=1e-9)


def test_eq_6_66_and_6_67_static_load_moves_the_supply_alone(gap: Callable) -> None:
    """Without leakage P0 enters as Z9 = ΔP - P0, and nowhere else."""
    moved = pressure_equation().subs(K_L, 0)
    Z6, Z8 = A_s**2 * B / (k_r * V), C_o * B / V
    lumped = Z8 * sp.sqrt((Delta - P0 - rise) / 2) * x / (1 + Z6)
    ranges = {Delta: (3.0, 4.0), rise: (-1.0, 1.0), P0: (0.2, 0.8)}
    assert gap(moved, lumped, ranges).largest < 1e-30


def test_erratum_15_eq_6_65_has_no_beta(gap: Callable) -> None:
    """At rest the valve feeds the leak: K_L B P0/V = C_o B/V √((ΔP - P0)/2) x0."""
    (x0,) = sp.solve(pressure_equation().subs(rise, 0), x)
    ranges = {Delta: (3.0, 4.0), P0: (0.2, 0.8), B: (2.0, 3.0)}
    fed = C_o / V * sp.sqrt((Delta - P0) / 2) * x0
    assert gap(K_L * B * P0 / V, B * fed, ranges).largest < 1e-30
    assert gap(K_L * P0 / V, B * fed, ranges).smallest > 0.3  # as printed, with B for its β


def test_erratum_15_eq_6_68_prints_an_empty_branch(hoist: Drive) -> None:
    """-α_max ≥ α ≥ α_max holds for no angle; used is |α| ≥ α_max, at the pressure of the stop."""
    stop = 0.27596
    angles = np.linspace(-0.5, 0.5, 1001)
    assert not np.any((-stop >= angles) & (angles >= stop))
    # at the stop Z6 is gone, so that a closing valve takes the pressure down 1 + Z6 times faster
    run = hoist.simulate_current(np.concatenate([np.full(3000, 0.75), np.full(100, -0.75)]))
    pressure = run.stroker_pressure
    n = int(np.flatnonzero(np.diff(pressure) < 0.0)[0])
    assert pressure[n] == pytest.approx(tan(stop) / hoist["Z1"].value, rel=1e-12)
    first, second = pressure[n] - pressure[n + 1], pressure[n + 1] - pressure[n + 2]
    assert first / second == pytest.approx(1.0 + hoist["Z6"].value, rel=2e-3)


def test_erratum_15_eq_6_71_needs_a_negative_branch() -> None:
    """x_eff = x for every x ≤ Z16, as printed, would leave the other direction without orifice."""
    p = PUMP._replace(Z14=1.0, Z16_plus=1e-4, Z16_minus=1.5e-4)
    assert orifice_opening(-3e-4, p) == -1.5e-4
    assert orifice_opening(3e-4, p) == 1e-4
    assert orifice_opening(-1.2e-4, p) == -1.2e-4


def test_lumps_have_the_units_of_the_tables() -> None:
    """Eqs. 6.56 to 6.70 in units: every Z from the physical quantities' units alone."""
    u = pint.UnitRegistry()

    def unit(text: str) -> pint.Quantity:
        return u.Quantity(1.0, text.replace("sqrt(Pa)", "Pa**0.5").replace("^", "**"))

    meanings = list(QUANTITIES.values())
    q = {each.stands_for: unit(each.unit) for each in meanings}
    stiffness = q["B"] / q["V"]
    lumps = {
        "Z1": q["A_s"] / (q["k_r"] * q["d4"]),
        "Z2": q["K_mf"] * q["C_g"] * q["A_p"] * q["d5"] / (q["k_r"] * q["d4"] ** 2),
        "Z3": q["d4"] / q["d3'"],
        "Z4": q["k_f"] ** 2 * q["d3"] ** 4,
        "Z5": q["d1"],
        "Z6": q["A_s"] ** 2 * stiffness / q["k_r"],
        "Z7": q["K_L"] * stiffness,
        "Z8": q["C_o"] * stiffness,
        "Z9": q["ΔP"],
        "Z10": q["K_mf"] * q["C_q"],
        "Z11": q["K_mL"] * q["C_g"],
        "Z12": q["K_mL"] * q["K_mf"] * q["C_i"] * q["C_q"],
    }
    for symbol, lump in lumps.items():
        assert lump.check(unit(CATALOGUE[symbol].unit).dimensionality), symbol


def test_stated_five_states_and_40_hz() -> None:
    """Section 6.2.4: five states, spool and plate at about 40 Hz (the plate at held pressure)."""
    modes = FullOrderDrive.preset("hoist").modes(0.0)
    assert modes.eigenvalues.size == 5
    for mode in (modes.spool, modes.swash_at_held_pressure):
        assert modes.frequency_hz(mode) == pytest.approx(40.0, abs=0.5)


def test_stated_roll_off_at_0_3_hz_is_that_of_large_motions() -> None:
    """Small motions of the hoist fall by 3 dB at 1.3 Hz; at 6.5 V the orifice makes it 0.28 Hz."""
    hoist = Drive.preset("hoist")
    swept = hoist.frequency_response(np.geomspace(0.1, 0.6, 13), [6.5])
    gain = np.abs(swept.ratio[0]) / abs(hoist.frequency_response([0.01], [6.5]).ratio[0, 0])
    corner = np.interp(-sqrt(0.5), -gain, swept.frequencies)
    assert corner == pytest.approx(0.28, abs=0.01)
    assert hoist.linearize(2.0).bandwidth == pytest.approx(1.30, abs=0.005)
    tau = 0.1214
    assert 1.0 / (2.0 * pi * tau) == pytest.approx(1.31, abs=0.005)
