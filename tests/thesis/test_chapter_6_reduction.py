"""From five states to one, and to small motions (eqs. 6.52-6.74), and stated frequencies."""

from dataclasses import replace
from math import sqrt, tan
from types import SimpleNamespace

import numpy as np
import pint
import pytest

from swashplate import Drive, maneuvers
from swashplate.full_order import QUANTITIES, FullOrderDrive, PhysicalSet
from swashplate.machine import derive
from swashplate.machine.fields import tuple_from
from swashplate.models import displacement_control as control
from swashplate.models import machine
from swashplate.models.displacement_control import Pump
from swashplate.models.machine import Hydrostat
from swashplate.parameters import CATALOGUE

LOADED = PhysicalSet.preset("hoist").replace(load_torque=4000.0, motor_leakage=1e-6)
SYMBOLS = {each.stands_for.replace("'", "_"): name for name, each in QUANTITIES.items()}


def lumps(q: SimpleNamespace) -> dict[str, object]:
    """Eqs. 6.56 to 6.70 from the physical quantities, as numbers or as units."""
    stiffness = q.B / q.V
    return {
        "Z1": q.A_s / (q.k_r * q.d4),
        "Z2": q.K_mf * q.C_g * q.A_p * q.d5 / (q.k_r * q.d4**2),  # less Z1 P0
        "Z3": q.d4 / q.d3_,
        "Z4": q.k_f**2 * q.d3**4,
        "Z5": q.d1,
        "Z6": q.A_s**2 * stiffness / q.k_r,
        "Z7": q.K_L * stiffness,
        "Z8": q.C_o * stiffness,
        "Z9": q.ΔP,
        "Z10": q.K_mf * q.C_q,
        "Z11": q.K_mL * q.C_g,
        "Z12": q.K_mL * q.K_mf * q.C_i * q.C_q,
    }


def test_eq_6_56_to_6_70_and_erratum_20_lumps() -> None:
    """The static pressure P0 moves Z9 alone, and Z2 = load - Z1 P0 (printed P0) is zero."""
    n = LOADED.numbers
    found = LOADED.to_lumped()
    expected = lumps(SimpleNamespace(**{key: n.get(name) for key, name in SYMBOLS.items()}))
    P0 = machine.static_pressure(Hydrostat(**n))
    expected["Z9"] -= P0
    expected["Z2"] -= expected["Z1"] * P0
    assert {each: found[each] for each in expected} == pytest.approx(expected, abs=1e-15)
    assert P0 > 1e3


def test_lumps_have_the_units_of_the_tables() -> None:
    u = pint.UnitRegistry()

    def unit(text: str) -> pint.Quantity:
        return u.Quantity(1.0, text.replace("sqrt(Pa)", "Pa**0.5").replace("^", "**"))

    quantities = {key: unit(QUANTITIES[name].unit) for key, name in SYMBOLS.items()}
    for symbol, lump in lumps(SimpleNamespace(**quantities)).items():
        assert lump.check(unit(CATALOGUE[symbol].unit).dimensionality), symbol


@pytest.mark.parametrize("changes", [{"piston_leakage": 3e-12}, {"load_torque": 4000.0}])
def test_eq_6_61_to_6_68_and_erratum_15_the_plate_follows_the_pressure(changes: dict) -> None:
    """The rate of 6.65 with the lumps is that of 6.32 to 6.35 with the plate's own motion in it.

    Without leakage a static load enters as Z9 = ΔP - P0 and nowhere else, which counts it once.
    """
    physical = PhysicalSet.preset("hoist").replace(**changes)
    p = Hydrostat(**physical.numbers)
    open_valve = p._replace(spool_stroke=1.0, orifice_opening_plus=1.0, orifice_opening_minus=1.0)
    Z = physical.to_lumped()
    oil, flow, speed, static = (
        getattr(machine, name)
        for name in ("oil_pressure_rate", "valve_flow", "piston_speed", "static_pressure")
    )
    for rise, opening in ((5e5, 2e-4), (-5e5, 1e-4), (2e5, -2e-4), (0.0, -1e-4)):
        rate = control.pressure_rate(
            rise, opening, control.Stroking(*(Z[f"Z{n}"] for n in (6, 7, 8, 9))), None
        )
        pressure, tangent = static(p) + rise, Z["Z1"] * rise
        turning = control.swash_rate(tangent, rate, Z["Z1"])
        fed = flow(opening, pressure, open_valve, None)
        assert oil(pressure, fed, speed(tangent, turning, p), p, None) == pytest.approx(rate)


def test_erratum_15_eq_6_65_the_valve_feeds_the_leak_at_rest() -> None:
    """K_L B P0/V = C_o B/V √((ΔP - P0)/2) x0, printed with a β and without B on the left."""
    n = LOADED.replace(piston_leakage=3e-12).numbers
    p = Hydrostat(**n)
    P0 = machine.static_pressure(p)
    x0 = n["piston_leakage"] * P0 / n["valve_flow_gain"] / sqrt((n["supply_pressure"] - P0) / 2.0)
    fed = machine.valve_flow(x0, P0, p, None)
    left = machine.oil_pressure_rate(P0, fed, 0.0, p, None)
    assert abs(left) < 1e-9 * fed * n["bulk_modulus"] / n["oil_volume"]


def test_erratum_01_eq_6_61_on_the_signed_current() -> None:
    """Printed, the force of every current below Z17 is none, that of the other solenoid too."""
    plus, minus = (12.0, 0.3, 0.2, 0.0), (10.0, 3.7, 1.7, -54.0)
    p = tuple_from(Pump, Drive.preset("hoist").parameters.numbers)._replace(
        Z17=0.27,
        **{f"Z{n}_plus": each for n, each in enumerate(plus, 19)},
        **{f"Z{n}_minus": each for n, each in enumerate(minus, 19)},
    )
    force = control.solenoid_force
    for sign, (c1, c2, c3, c4) in ((1.0, plus), (-1.0, minus)):
        assert force(sign * 0.2, p) == 0.0
        for current in (0.28, 0.5, 0.7):
            e = sign * (current - 0.27)
            expected = c1 * e + c2 * e**2 + c3 * e**3 + c4 * e**4
            assert force(sign * current, p) == pytest.approx(expected, rel=1e-12)


HOIST = Drive.preset("hoist")
ODD = HOIST.replace(Z20_minus=-3.7297, Z22_minus=54.153)
"""-poly(|i|) in place of poly(i): the same as even coefficients of the other sign."""
SYMMETRIC = Drive(replace(HOIST.parameters, pressure_root="symmetric"))
"""The right root with parameters that were fitted with the other one."""


@pytest.mark.parametrize(
    ("other", "test", "deg_s"),
    [
        (ODD, "sine 9 V 0.1 Hz", 68.9),
        (ODD, "step -9 V", 69.5),
        (ODD, "ramp -1 V/s", 75.8),
        (SYMMETRIC, "sine 9 V 0.1 Hz", 0.7),
        (SYMMETRIC, "ramp +1 V/s", 0.7),
        (SYMMETRIC, "step +9 V", 5.6),
    ],
)
def test_erratum_01_and_erratum_13_on_the_hoist(other: Drive, test: str, deg_s: float) -> None:
    voltage = maneuvers.source_tests("hoist")[test].sample(512.0)
    change = other.simulate(voltage).shaft_speed - HOIST.simulate(voltage).shaft_speed
    assert np.rad2deg(np.abs(change).max()) == pytest.approx(deg_s, abs=0.05)


def test_erratum_15_eq_6_68_prints_an_empty_branch(hoist: Drive) -> None:
    """-α_max ≥ α ≥ α_max holds for no angle; used is |α| ≥ α_max, at the pressure of the stop.

    At the stop Z6 is gone, so that a closing valve takes the pressure down 1 + Z6 times faster.
    """
    run = hoist.simulate_current(np.concatenate([np.full(3000, 0.75), np.full(100, -0.75)]))
    pressure = run.stroker_pressure
    n = int(np.flatnonzero(np.diff(pressure) < 0.0)[0])
    assert pressure[n] == pytest.approx(tan(0.27596) / hoist["Z1"].value, rel=1e-12)
    first, second = pressure[n] - pressure[n + 1], pressure[n + 1] - pressure[n + 2]
    assert first / second == pytest.approx(1.0 + hoist["Z6"].value, rel=2e-3)


# --- small motions --------------------------------------------------------------------------------


def test_eq_6_72_to_6_74_and_erratum_23_slopes_at_rest(hoist: Drive) -> None:
    """Printed without Z5 in the force's and Z3 in the angle's term, and without 1 + Z6.

    6.74 has α_sw in place of the opening, on which alone the rate depends.
    """
    p = tuple_from(Pump, hoist.replace(Z18=0.0).parameters.numbers)
    spool = derive(control.spool_balance, by=("force", "arm_sine"))(0.0, 0.0, p)[1:]
    assert spool == pytest.approx((p.Z5**2 / sqrt(p.Z4), -p.Z5))
    (sine,) = derive(control.arm_sine, by=("pressure",))(0.0, p)[1:]
    (plate,) = derive(control.swash_tangent, by=("pressure",))(0.0, p)[1:]
    assert (plate, sine) == pytest.approx((p.Z1, p.Z3 * p.Z1))
    rate = derive(control.pressure_rate, by=("pressure", "opening"), options={"symmetric": None})(
        0.0, 0.0, control.Stroking(p.Z6, 0.0, p.Z8, p.Z9), None
    )[1:]
    assert rate == pytest.approx((0.0, p.Z8 * sqrt(p.Z9 / 2.0) / (1.0 + p.Z6)))


@pytest.mark.parametrize(("name", "lag"), [("hoist", 0.1214), ("slew", 0.2066), ("luff", 0.2015)])
def test_erratum_04_lag_and_gain_from_force_to_speed(name: str, lag: float) -> None:
    """Without 1 + Z6, as printed, the luff would be fourteen times as fast as it is."""
    drive = Drive.preset(name).replace(Z18=0.0)
    Z = drive.parameters.numbers
    model = drive.linearize(current=0.0, input="solenoid_force")
    printed = 1.0 / (Z["Z1"] * Z["Z3"] * Z["Z5"] * Z["Z8"] * sqrt(Z["Z9"] / 2.0))
    assert model.time_constant == pytest.approx((1.0 + Z["Z6"]) * printed, rel=1e-12)
    assert model.time_constant == pytest.approx(lag, abs=5e-5)
    assert name != "luff" or printed == pytest.approx(0.0142, abs=5e-5)
    gain = Z["Z10"] * Z["Z5"] / (Z["Z3"] * sqrt(Z["Z4"]))
    assert model.gain == pytest.approx(gain, rel=1e-12)


def test_stated_five_states_and_40_hz() -> None:
    """Section 6.2.4: five states, spool and plate at about 40 Hz (the plate at held pressure)."""
    modes = FullOrderDrive.preset("hoist").modes(0.0)
    assert modes.eigenvalues.size == 5
    for mode in (modes.spool, modes.swash_at_held_pressure):
        assert modes.frequency_hz(mode) == pytest.approx(40.0, abs=0.5)


def test_stated_roll_off_at_0_3_hz_is_that_of_large_motions(hoist: Drive) -> None:
    """Small motions of the hoist fall by 3 dB at 1.3 Hz; at 6.5 V the orifice makes it 0.28 Hz."""
    swept = hoist.frequency_response(np.geomspace(0.1, 0.6, 13), [6.5])
    gain = np.abs(swept.ratio[0]) / abs(hoist.frequency_response([0.01], [6.5]).ratio[0, 0])
    corner = np.interp(-sqrt(0.5), -gain, swept.frequencies)
    assert corner == pytest.approx(0.28, abs=0.01)
    assert hoist.linearize(2.0).bandwidth == pytest.approx(1.30, abs=0.005)
