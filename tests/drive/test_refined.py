"""The march with refinements: each does what it is for, and has exact derivatives."""

from math import inf

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.drive.experiments import ALL, LOAD, RATE, STICTION

from swashplate import Drive, Simulation, maneuvers

pytestmark = pytest.mark.traced

Array = NDArray[np.float64]


def refined(drive: Drive, **changes: float) -> Simulation:
    run = drive.replace(**changes).simulate(maneuvers.step(4.0).sample(RATE))
    assert run.refined
    return run


def overshoot(run: Simulation, settled: float) -> Array:
    """Speed beyond the settled one while the step of 4 V is on, 1 s to 6 s. [%]"""
    return 100.0 * (run.shaft_speed[512 : 6 * 512] / settled - 1.0)


def test_a_drive_without_refinements_is_marched_plainly(hoist: Drive) -> None:
    command = maneuvers.step(4.0).sample(RATE)
    given = hoist.replace(spool_friction=0.0, load_torque=3e4, dither_time=inf)
    run = given.simulate(command)
    assert not run.refined
    assert np.array_equal(run.shaft_speed, hoist.simulate(command).shaft_speed)
    assert given.parameters.refinements == ()
    assert hoist.plain is hoist
    assert hoist.replace(**ALL).plain.parameters == hoist.parameters


def test_stiction_overshoots_by_4_percent_and_decays(hoist: Drive) -> None:
    """The overshoot of Kruse's hoist steps (section 7.6): 4 % at 4 V, gone under dither."""
    settled = hoist.steady_speed(4.0)
    beyond = overshoot(refined(hoist, **STICTION), settled)
    top = int(beyond.argmax())
    assert beyond[top] == pytest.approx(4.0, abs=0.05)
    assert top / RATE == pytest.approx(1.14, abs=0.02)
    assert (np.diff(beyond[top:]) <= 1e-9).all()
    assert abs(beyond[-1]) < 0.01
    assert overshoot(hoist.simulate(maneuvers.step(4.0).sample(RATE)), settled).max() < 1e-9


def test_without_dither_the_spool_stays_where_friction_leaves_it(hoist: Drive) -> None:
    """The spool closes where its balance is a width w short of it: Z5 tan(φ - α) + Z18 = -w."""
    run = refined(hoist, spool_friction=0.1)
    n = hoist.parameters.numbers
    width = 0.1 * n["Z5"] ** 2 / np.sqrt(n["Z4"])
    moment = np.arcsin(n["Z5"] * run.solenoid_force[5 * 512] / np.sqrt(n["Z4"]))
    arm = moment + np.arctan((n["Z18"] + width) / n["Z5"])
    expected = n["Z10"] * np.arctan(np.sin(arm) / n["Z3"])
    assert run.shaft_speed[int(5.9 * 512)] == pytest.approx(expected, rel=1e-9)


def test_hysteresis_opens_a_loop_that_slowness_does_not_close(hoist: Drive) -> None:
    drive = hoist.replace(solenoid_hysteresis=0.01)
    widths = []
    for frequency in (0.05, 0.025):
        current = 0.6 * np.sin(2 * np.pi * frequency * np.arange(0.0, 1.5 / frequency, 1 / RATE))
        force = drive.simulate_current(current, RATE).solenoid_force
        turn = int(1.25 / frequency * RATE)
        up, down = np.flatnonzero(np.diff(np.sign(current - 0.45)))[-2:]
        assert up < turn < down
        widths.append(force[down] - force[up])
    slope = 12.349  # of the force at that current, Z19 alone nearly
    assert widths[0] == pytest.approx(2 * 0.01 * slope, rel=0.05)
    assert widths[1] == pytest.approx(widths[0], rel=0.01)


def test_leakage_is_what_z11_and_z12_say(hoist: Drive) -> None:
    run = refined(hoist, **LOAD)
    Z12 = 1e-6 * 5e3 * hoist["Z10"].values[0]
    by_lumps = hoist.replace(Z11=0.03, Z12=Z12).simulate(maneuvers.step(4.0).sample(RATE))
    np.testing.assert_allclose(run.shaft_speed, by_lumps.shaft_speed, rtol=1e-12, atol=1e-15)
    lost = hoist.steady_speed([4.0, -4.0]) - hoist.replace(**LOAD).steady_speed([4.0, -4.0])
    np.testing.assert_allclose(lost, 0.03, rtol=1e-9)


def test_the_pressure_drop_bears_the_load(hoist: Drive) -> None:
    run = refined(hoist, **LOAD)
    drop = run.motor_pressure_drop
    assert drop is not None
    assert drop[int(5.9 * 512)] == pytest.approx(250.0 * 3e4, rel=1e-3)
    assert run.to_polars()["motor_pressure_drop"].to_numpy() == pytest.approx(drop)
    assert "motor_torque" in run.to_polars().columns
    assert refined(hoist, cam_ripple=0.01).motor_pressure_drop is None


def test_the_cam_ring_swings_five_and_a_half_times_a_turn(hoist: Drive) -> None:
    run = refined(hoist, cam_ripple=0.01, cam_ripple_per_torque=5e-7, load_torque=2e4)
    window = slice(3 * 512, 6 * 512)
    speed, turned = run.shaft_speed[window], run.shaft_position[window]
    settled = hoist.steady_speed(4.0)
    assert speed.max() == pytest.approx(settled / 0.98, rel=1e-4)
    assert speed.min() == pytest.approx(settled / 1.02, rel=1e-4)
    rising = np.flatnonzero((speed[:-1] < settled) & (speed[1:] >= settled))
    assert np.diff(turned[rising]).mean() == pytest.approx(2 * np.pi / 5.5, rel=5e-3)


def test_a_damped_plate_comes_late(hoist: Drive) -> None:
    def delay(**changes: float) -> float:
        run = hoist.replace(**changes).simulate(maneuvers.sine(4.0, 0.3).sample(RATE))
        whole = (run.time > 1 + 2 / 0.3) & (run.time <= 1 + 5 / 0.3)
        turn = np.exp(-2j * np.pi * 0.3 * run.time[whole])
        assert run.voltage is not None
        return float(np.angle((run.shaft_speed[whole] @ turn) / (run.voltage[whole] @ turn)))

    late = delay() - delay(swash_damping=0.03)
    assert late > 0.003  # rad


def test_a_stiff_line_is_no_line(hoist: Drive) -> None:
    """With K_mL J well below the step Kruse's leakage by the flow's acceleration holds."""
    light = {**LOAD, "load_inertia": 500.0}
    stiff = refined(hoist, **light, line_stiffness=1e9)
    none = refined(hoist, **light)
    assert np.abs(stiff.shaft_speed - none.shaft_speed).max() < 1e-3
    assert stiff.motor_torque[5 * 512] == pytest.approx(none.motor_torque[5 * 512], rel=1e-3)


def test_a_soft_line_swings_at_its_frequency(hoist: Drive) -> None:
    run = refined(hoist, **LOAD, line_stiffness=1e6)
    swing = run.shaft_speed[4 * 512 : 6 * 512] - run.shaft_speed[6 * 512 - 1]
    rising = np.flatnonzero((swing[:-1] < 0.0) & (swing[1:] >= 0.0))
    assert RATE / np.diff(rising).mean() == pytest.approx(np.sqrt(1e6 / 5e3) / (2 * np.pi), rel=0.1)


def test_next_to_nothing_of_each_is_next_to_nothing(hoist: Drive) -> None:
    """What a refinement does goes to nothing with its size: the way through it is the same."""
    command = maneuvers.step(4.0).sample(RATE)
    plain = hoist.simulate(command).shaft_speed
    for small in (
        {**STICTION, "spool_friction": 1e-7},
        {"solenoid_hysteresis": 1e-8},
        {"cam_ripple": 1e-9},
        {"cam_ripple_per_torque": 1e-14, "load_torque": 1e4},
        {"motor_leakage": 1e-15, "load_torque": 1e4},
    ):
        run = hoist.replace(**small).simulate(command)
        assert run.refined
        assert 0.0 <= np.abs(run.shaft_speed - plain).max() < 1e-5 * np.abs(plain).max()
