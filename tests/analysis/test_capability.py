"""What a drive can do: Kruse's limits, closed forms, and the simulation itself."""

from math import sqrt

import numpy as np
import pytest

from swashplate import Drive
from swashplate.analysis import Envelope, acceleration_curve, envelope, speed_limits


@pytest.fixture(scope="module")
def found() -> dict[str, Envelope]:
    return {name: envelope(Drive.preset(name)) for name in ("hoist", "slew", "luff")}


@pytest.mark.parametrize(
    ("name", "limits", "digit", "saturated", "at_rest"),
    [
        ("hoist", (196.0, -185.0), 0.05, (7.87, -7.41), (136.8, -177.8)),
        ("slew", (4.242, -4.292), 5e-4, (5.30, -5.62), (5.81, -5.87)),
        ("luff", (155.9, -190.8), 0.05, (None, None), (35.9, -88.9)),
    ],
)
def test_kruse_s_limits(found, name, limits, digit, saturated, at_rest) -> None:
    each, drive = found[name], Drive.preset(name)
    Z, ways = drive.parameters.numbers, (each.plus, each.minus)
    assert np.degrees([way.speed_limit for way in ways]) == pytest.approx(limits, abs=digit)
    assert speed_limits(drive) == (each.minus.speed_limit, each.plus.speed_limit)
    close = max(0.1 * digit, 0.005) if name == "slew" else 0.05
    assert np.degrees([way.acceleration for way in ways]) == pytest.approx(at_rest, abs=close)
    closed = Z["Z10"] * Z["Z1"] * Z["Z8"] * sqrt(Z["Z9"] / 2.0) / (1.0 + Z["Z6"])
    assert each.plus.acceleration == pytest.approx(closed * Z["Z16_plus"], rel=1e-12)
    assert each.minus.acceleration == pytest.approx(-closed * Z["Z16_minus"], rel=1e-12)
    assert np.degrees(each.creep) == pytest.approx(3.09 if name == "hoist" else 0.0, abs=0.005)
    for way, expected in zip(ways, saturated, strict=True):
        assert way.accelerated_by == "orifice"
        assert way.saturation_voltage == (expected and pytest.approx(expected, abs=0.005))
        assert expected is None or way.top_speed == way.speed_limit


def test_dead_zone_and_gain(found, hoist: Drive) -> None:
    """V_dz where the jump is larger than Z17, otherwise where the current has grown to Z17."""
    Z, way = hoist.parameters.numbers, found["hoist"].plus
    assert found["hoist"].minus.dead_zone == -Z["V_dz_minus"]
    missing = Z["J_plus"] - Z["Z17"]
    roots = np.roots([Z["G3_plus"], Z["G2_plus"], Z["G1_plus"], missing])
    (d,) = (root.real for root in roots if abs(root.imag) < 1e-12 and 0.0 < root.real < 1.0)
    assert way.dead_zone == pytest.approx(Z["V_dz_plus"] + d, abs=1e-9)
    # force sets in without a jump, so the drive begins at its creep
    assert way.smallest_speed == pytest.approx(found["hoist"].creep, abs=1e-9)
    # model.md's currents at the jump of the luff axis: 31.3 deg/s at once
    assert np.degrees(found["luff"].plus.smallest_speed) == pytest.approx(31.33, abs=0.01)
    # the static table: from 22.25 deg/s at 1 V to 161.67 at 6.5 V
    low, mean, high = np.degrees([way.smallest_gain, way.gain, way.largest_gain])
    assert low < 25.35 < high
    assert mean == pytest.approx((196.0 - 3.09) / (7.87 - 0.206), abs=0.03)


def test_times_are_those_of_a_step(found, hoist: Drive) -> None:
    creep, plus = found["hoist"].creep, found["hoist"].plus
    rising = hoist.simulate(np.concatenate([[0.0], np.full(2048, 10.0)]), start="steady")
    falling = hoist.simulate(np.concatenate([[10.0], np.zeros(2048)]), start="steady")
    for run, rise, reach, first, last in (
        (rising, plus.starting_rise, plus.starting_reach, creep, plus.top_speed),
        (falling, plus.stopping_rise, plus.stopping_reach, plus.top_speed, creep),
    ):
        done = (run.shaft_speed - first) / (last - first)
        low, high = np.interp([0.1, 0.9], done, run.time)
        assert reach == pytest.approx(high, abs=1.01 / 512)
        assert rise == pytest.approx(high - low, abs=1.01 / 512)


@pytest.mark.parametrize(
    "refined",
    [
        {},
        {"motor_leakage": 1e-6, "load_torque": 3e4},
        {"spool_friction": 0.1, "solenoid_hysteresis": 0.005},
    ],
)
def test_accelerations_are_those_of_a_simulation(hoist: Drive, refined: dict[str, float]) -> None:
    """Under a held current the speed grows by acceleration times step."""
    drive = hoist.replace(**refined)
    run = drive.simulate_current(np.full(700, drive.steady_current(10.0)))
    curve = acceleration_curve(drive, 10.0, points=501)
    middle = 0.5 * (run.shaft_speed[1:] + run.shaft_speed[:-1])
    found = np.interp(middle, curve.speed, curve.acceleration)
    moving = (middle < 0.99 * curve.speed[-1]) & (middle > 0.0)
    np.testing.assert_allclose(found[moving], 512.0 * np.diff(run.shaft_speed)[moving], rtol=2e-4)
    assert set(curve.by) == {"orifice"}


def test_other_drives(hoist: Drive) -> None:
    wide = hoist.replace(Z16=np.inf)
    assert envelope(wide.replace(Z14=1e-4)).plus.accelerated_by == "spool stop"
    assert envelope(wide.replace(Z14=np.inf)).plus.accelerated_by == "valve"
    let_go = acceleration_curve(hoist, 0.0)
    assert let_go.by[0] == "orifice"
    assert "valve" in let_go.by  # near standstill the feedback has almost closed it
    Z = hoist.parameters.numbers
    limit = Z["Z10"] * np.arctan(Z["Z1"] * 0.3e6)
    assert envelope(hoist.replace(Z15=0.3e6)).plus.speed_limit == pytest.approx(limit, rel=1e-9)
    dead = envelope(hoist.replace(Z17=5.0))  # never leaves its dead zone
    for way in (dead.plus, dead.minus):
        assert abs(way.dead_zone) == 10.0
        assert way.gain is way.saturation_voltage is way.starting_rise is None
        assert way.top_speed == dead.creep
