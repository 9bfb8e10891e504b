"""Pint quantities are turned into SI wherever a number with a unit is meant."""

import numpy as np
import pint
import pytest

from swashplate import Drive, InputError, ParameterError, PhysicalSet

UNITS = pint.UnitRegistry()
HOIST = Drive.preset("hoist")
COMMAND = np.r_[0.0, np.full(300, 9.0)]


def test_parameters_with_units() -> None:
    drive = HOIST.replace(Z9=120.0 * UNITS.bar, Z16=(0.12 * UNITS.mm, 150 * UNITS.um))
    assert drive["Z9"].value == pytest.approx(120e5, rel=1e-15)
    assert drive["Z16"].value == pytest.approx((1.2e-4, 1.5e-4), rel=1e-15)
    assert drive.replace(Z16_minus=0.2 * UNITS.mm)["Z16"].value.minus == pytest.approx(2e-4)
    assert HOIST.replace(omega=3.0 * UNITS.Hz)["omega_plus"].value == pytest.approx(6.0 * np.pi)
    with pytest.raises(ParameterError, match=r"Z16 .*'bar'.* in m\."):
        HOIST.replace(Z16=3.0 * UNITS.bar)
    with pytest.raises(ParameterError, match="factor of Z16"):
        HOIST.scale(Z16=3.0 * UNITS.mm)
    machine = PhysicalSet.preset("hoist")
    assert machine.replace(load_torque=2.0 * UNITS.kN * UNITS.m)["load_torque"].value == 2000.0


def test_records_with_units() -> None:
    plain = HOIST.simulate(COMMAND, 512.0, load_torque=2e3, pump_speed=0.98)
    given = HOIST.simulate(
        1e3 * COMMAND * UNITS.mV,
        0.512 * UNITS.kHz,
        load_torque=2.0 * UNITS.kN * UNITS.m,
        pump_speed=98.0 * UNITS.percent,
    )
    np.testing.assert_allclose(given.shaft_speed, plain.shaft_speed, rtol=1e-12)
    time = np.arange(COMMAND.size) / 512.0
    stamped = HOIST.simulate(COMMAND, time=1e3 * time * UNITS.ms, interpolation="linear")
    np.testing.assert_allclose(stamped.time, time, atol=1e-12)
    current = HOIST.simulate_current(COMMAND / 30.0)
    again = HOIST.simulate_current(COMMAND / 30.0 * 1e3 * UNITS.mA)
    np.testing.assert_allclose(again.shaft_speed, current.shaft_speed, rtol=1e-12)
    with pytest.raises(InputError, match=r"voltage .*'A'.* in V"):
        HOIST.simulate(COMMAND * UNITS.A)


def test_settled_and_linear_with_units() -> None:
    assert HOIST.steady_speed(4e3 * UNITS.mV) == pytest.approx(HOIST.steady_speed(4.0), rel=1e-12)
    ours, theirs = HOIST.linearize(4e3 * UNITS.mV), HOIST.linearize(4.0)
    assert ours.gain == pytest.approx(theirs.gain, rel=1e-12)


def test_many_sets_with_units() -> None:
    stops = np.array([0.1, 0.12])
    ours = HOIST.simulate_many({"Z16": stops * UNITS.mm}, voltage=COMMAND)
    theirs = HOIST.simulate_many({"Z16": 1e-3 * stops}, voltage=COMMAND)
    np.testing.assert_allclose(ours.output, theirs.output, rtol=1e-12)
