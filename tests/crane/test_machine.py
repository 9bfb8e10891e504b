"""The crane as a machine: bits of a run in open loop, other drives, modes."""

from math import cos, pi, sqrt
from typing import NamedTuple

import numpy as np
import pytest
from tests.crane.open_loop import SHIP, SIGNALS, command, inputs_of
from tests.marks import rest_slow

from swashplate import FullOrderDrive, linearize, simulate
from swashplate.crane import AXES, Crane, Seaway, Suspension, body, plant
from swashplate.crane import simulate as simulate_crane
from swashplate.errors import DomainError, InputError
from swashplate.machine import Machine, Model, equation

G = 9.80665
SPEEDS = [f"{axis}_speed" for axis in AXES]
ELASTIC = Suspension(stiffness=6e7)
HOOK = Suspension(hook=2000.0, sling=6.0)
BOTH = Suspension(stiffness=6e7, hook=2000.0, sling=6.0)
THROWN = {
    "drag_area": 12.0,
    "wind": (10.0, -5.0),
    "load_offset": (1.0, 0.5),
    "load_velocity": (0.2, -0.1),
}


@pytest.fixture(scope="module")
def crane():
    return Crane.preset("tg3637")


CASES = [
    ({}, None),
    ({"rope_m": 27.0}, "ss3"),
    ({"brake": False}, None),
    ({"suspension": ELASTIC}, "ss3"),
    ({"suspension": HOOK}, "ss3"),
    ({"suspension": BOTH, "swing_damping": 0.0}, "ss3"),
    (THROWN, None),
]


@pytest.mark.parametrize(("how", "sea"), rest_slow(CASES, 2))
def test_machine_has_the_bits_of_a_run_in_open_loop(crane, how, sea):
    waters = None if sea is None else Seaway(sea, seed=1)
    run = simulate_crane(crane, command(), sea=waters, **how)
    found = simulate(plant(crane, **how), inputs_of(run), 512.0)
    for name in SIGNALS:
        np.testing.assert_array_equal(found[f"body.{name}"], run[name], name)
    for axis in ("slew", "luff"):
        np.testing.assert_array_equal(found[f"{axis}.shaft_speed"], run[f"speed_{axis}"])
    np.testing.assert_allclose(found["swing"], np.radians(run.swing_deg), atol=1e-14)
    np.testing.assert_array_equal(np.degrees(found["off_lead"]), run.off_lead_deg)
    np.testing.assert_array_equal(np.degrees(found["side_lead"]), run.side_lead_deg)
    np.testing.assert_array_equal(found["tension"], run.tension)
    assert np.ptp(run["load_x"]) > 0.5


# --- load on the drives ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def leaking(crane):
    return crane.with_drive(
        hoist=crane.hoist.replace(motor_leakage=1e-6), luff=crane.luff.replace(motor_leakage=1e-6)
    )


LOADED = [({}, None), ({"suspension": BOTH}, "ss3"), ({"loaded": False, "brake": False}, None)]


@pytest.mark.parametrize(("how", "sea"), rest_slow(LOADED, 1))
def test_loaded_machine_has_the_bits_of_a_run_in_open_loop(leaking, how, sea):
    waters = None if sea is None else Seaway(sea, seed=1)
    run = simulate_crane(leaking, command(6.0), sea=waters, **how)
    machine = plant(leaking, **how)
    found = simulate(machine, inputs_of(run), 512.0)
    for name in SIGNALS:
        np.testing.assert_array_equal(found[f"body.{name}"], run[name], name)
    taken = "hoist.load_torque" in machine.ports.external
    assert taken == (how.get("loaded") is False)
    if not taken:
        for axis in AXES:
            given = found[f"carried.load_torque_{axis}"]
            np.testing.assert_array_equal(given, run[f"torque_{axis}"])
            np.testing.assert_array_equal(given[1:], found[f"body.torque_{axis}"][:-1])
    # 35 t on two falls of a drum of 0.4 m
    mass = leaking.safe_load + how.get("suspension", Suspension()).hook
    assert run["torque_hoist"][0] == (0.0 if taken else pytest.approx(mass * G * 0.2, rel=1e-12))


def test_a_bouncing_load_is_damped_by_what_the_hoist_leaks(crane):
    leakage, stiffness, rope = 1e-6, 6e7, 20.0
    leaking = crane.with_drive(hoist=crane.hoist.replace(motor_leakage=leakage))
    bounce = Suspension(stiffness=stiffness, bounce_damping=0.0)
    how = {"rope_m": rope, "swing_damping": 0.0, "suspension": bounce, "brake": False}
    at = {f"{axis}.voltage": 0.0 for axis in AXES} | STILL
    by_load = {}
    for loaded in (False, True):
        model = linearize(plant(leaking, loaded=loaded, **how), at, 512.0)
        poles = model.poles[(np.abs(model.poles) > 1e-3) & (np.abs(model.poles - 1.0) > 1e-6)]
        s = np.log(poles) * 512.0
        k, arm = stiffness / rope, crane.geometry.hoist
        own = sqrt(k / crane.safe_load)
        near = s[np.abs(np.abs(s) - own) < 0.01 * own]
        assert near.size == 2
        by_load[loaded] = -near.real / np.abs(near)
    np.testing.assert_allclose(by_load[False], 0.0, atol=1e-9)
    # m x'' = -T and T' = k (x' - r² K T): s² + k r² K s + k/m = 0; the torque is a sample late
    damping = 0.5 * arm**2 * leakage * sqrt(k * crane.safe_load)
    np.testing.assert_allclose(by_load[True], damping, rtol=0.01)


def test_drives_that_a_load_moves_are_one_group_with_the_body(crane):
    line = crane.hoist.replace(motor_leakage=1e-6, line_stiffness=1e6, load_inertia=5e3)
    at = {f"{axis}.voltage": 0.0 for axis in AXES} | STILL
    elastic = crane.with_drive(hoist=line)
    groups = []
    for loaded in (False, True):
        machine = plant(elastic, loaded=loaded, suspension=ELASTIC, brake=False)
        groups.append(linearize(machine, at, 512.0).groups_of((*AXES, "body")))
    assert groups[0] == [("hoist",), ("slew",), ("luff",), ("body",)]
    assert groups[1] == [("hoist", "body"), ("slew",), ("luff",)]


@pytest.mark.slow
def test_loads_that_no_drive_takes_are_refused(crane):
    with pytest.raises(InputError, match=r"tg3637 .* load: .* motor_leakage"):
        plant(crane, loaded=True)
    worn = crane.with_drive(hoist=crane.hoist.replace(motor_leakage=3e-6))
    with pytest.raises(InputError, match=r"hoist of tg3637 .* 35000 kg .* rigid rope"):
        plant(worn)
    assert "carried" in plant(worn, suspension=ELASTIC).model.every_signal[0]


# --- other drives ---------------------------------------------------------------------------------


class Winch(NamedTuple):
    gain: float
    lag: float


class Turning(NamedTuple):
    shaft_speed: float = 0.0


@equation
def turn(state: Turning, voltage: float, p: Winch, h: float) -> Turning:
    return Turning(state.shaft_speed + h / p.lag * (p.gain * voltage - state.shaft_speed))


winch = Model("winch", Winch, Turning, turn)
FULL = {"body.surge": 0.0, "body.sway": 0.0, "body.heave": 0.0}
STILL = dict.fromkeys((f"body.{name}" for name in SHIP), 0.0)


def test_a_winch_of_ones_own_lifts_the_load(crane):
    machine = plant(crane, drives={"hoist": Machine(winch, Winch(0.5, 0.2))})
    volts = {"hoist.voltage": np.full(1024, 4.0), "slew.voltage": 0.0, "luff.voltage": 0.0}
    run = simulate(machine, volts | STILL, 512.0)
    # 2 rad/s after a lag: the load rises by r/n times the angle
    angle = run["shaft_hoist"][-1]
    assert angle == pytest.approx(2.0 * (1023 / 512 - 0.2), rel=1e-2)
    rise = run["load_z"][-1] - run["load_z"][0]
    assert rise == pytest.approx(crane.geometry.hoist * angle, abs=5e-3)


class Slipping(NamedTuple):
    shaft_speed: float


class Turned(NamedTuple):
    speed: float = 0.0


@equation
def turn_and_slip(state: Turned, voltage: float, load_torque: float, p: Winch) -> Slipping:
    return Slipping(state.speed - 1e-6 * load_torque)


@equation
def turned(state: Turned, voltage: float, p: Winch, h: float) -> Turned:
    return Turned(state.speed + h / p.lag * (p.gain * voltage - state.speed))


slipping = Model("winch", Winch, Turned, turned, turn_and_slip)


def test_a_winch_of_ones_own_takes_the_load_if_it_has_an_input_for_it(crane):
    winch = Machine(slipping, Winch(0.5, 0.2))
    volts = {"hoist.voltage": np.full(1024, 4.0), "slew.voltage": 0.0, "luff.voltage": 0.0}
    run = simulate(plant(crane, drives={"hoist": winch}), volts | STILL, 512.0)
    # 2 rad/s less what 35 t on two falls of a drum of 0.4 m take
    assert run["hoist.shaft_speed"][-1] == pytest.approx(2.0 - 1e-6 * 35000.0 * G * 0.2, rel=1e-3)
    free = plant(crane, drives={"hoist": winch}, loaded=False)
    assert "hoist.load_torque" in free.ports.external


@pytest.mark.slow
def test_drives_of_five_states_move_the_crane_nearly_as_identified_ones(crane):
    five = {axis: FullOrderDrive.preset(axis) for axis in AXES}
    run = simulate_crane(crane, command(20.0), brake=False)
    inputs = inputs_of(run)
    found = simulate(plant(crane, drives=five), inputs, 512.0)
    turned = run["shaft_slew"][-1]
    assert found["shaft_slew"][-1] == pytest.approx(turned, rel=0.05)
    assert (found["shaft_slew"] != run["shaft_slew"]).any()


def test_refusals_say_what_to_give(crane):
    with pytest.raises(InputError, match="no drive 'boom'"):
        plant(crane, drives={"boom": crane.luff})
    with pytest.raises(InputError, match="luff of tg3637 is .*'shaft_speed'"):
        plant(crane, drives={"luff": body(crane)})
    with pytest.raises(InputError, match="rope of tg3637 is 200 m"):
        plant(crane, rope_m=200.0)
    with pytest.raises(InputError, match="load is 90000 kg"):
        body(crane, load=9e4)
    bouncing = body(crane, suspension=ELASTIC)
    with pytest.raises(InputError, match="bounce on .* too fast for 20 samples"):
        simulate(bouncing, dict.fromkeys(bouncing.ports.external, np.zeros(9)), 20.0)


def test_ends_of_the_travel_are_limits_and_a_jump_leaves_the_domain(crane):
    machine = body(crane, boom_deg=45.0)
    still = dict.fromkeys(machine.ports.external, 0.0)
    run = simulate(machine, still | {"luff_speed": np.full(1200, -60.0)}, 512.0)
    lowest = crane.boom_limits[0]
    np.testing.assert_array_equal(run.active("boom_end"), run["boom"] < lowest)
    assert run.active("boom_end").any()
    assert not run.active("boom_end").all()
    jump = np.zeros(64)
    jump[30:] = 40.0
    with pytest.raises(DomainError, match="tip moves within one sample"):
        simulate(machine, still | {"surge": jump}, 512.0)


# --- small motion ---------------------------------------------------------------------------------


def modes(model, member):
    """Poles of a member that are neither gone after one step nor integrate. [rad/s]"""
    poles = model.poles_of(*[name for name in model.states if name.startswith(member)])
    left = poles[(np.abs(poles) > 1e-3) & (np.abs(poles - 1.0) > 1e-6)]
    return np.log(left) * model.rate


def test_load_swings_at_the_root_of_g_over_l_with_its_damping(crane):
    machine = plant(crane, rope_m=25.0, swing_damping=0.01)
    at = {f"{axis}.voltage": 0.0 for axis in AXES} | STILL
    model = linearize(machine, at, 512.0)
    swing = modes(model, "body")
    assert swing.size == 4  # along the boom and across it
    omega = sqrt(G / 25.0)
    np.testing.assert_allclose(np.abs(swing), omega, rtol=1e-5)
    np.testing.assert_allclose(-swing.real / np.abs(swing), 0.01, rtol=1e-3)
    assert model.units["body.swing"] == "rad"
    assert model.units["body.tip_x"] == model.units["body.surge"] == "m"


def test_hook_and_load_swing_as_a_double_pendulum(crane):
    machine = body(crane, rope_m=20.0, swing_damping=0.0, suspension=HOOK)
    at = dict.fromkeys(machine.ports.external, 0.0)
    model = linearize(machine, at, 512.0)
    found = np.abs(modes(model, ""))
    # of two masses on lines of 20 and 6 m, by their stiffness and mass matrices
    load, hook, rope, sling = crane.safe_load, 2000.0, 20.0, 6.0
    upper, lower = (load + hook) * G / rope, load * G / sling
    stiffness = np.array([[upper + lower, -lower], [-lower, lower]])
    squares = np.linalg.eigvals(np.linalg.solve(np.diag([hook, load]), stiffness))
    np.testing.assert_allclose(np.unique(found.round(4)), np.sqrt(np.sort(squares)), rtol=1e-4)


def test_linear_body_swings_as_the_whole_one_does_by_little(crane):
    place = {"boom_deg": 50.0, "rope_m": 25.0, "swing_damping": 0.0}
    machine = body(crane, **place)
    at = dict.fromkeys(machine.ports.external, 0.0)
    names = ("off_lead", "side_lead", "rope", "slew", "boom")
    model = linearize(machine, at, 512.0, inputs=SPEEDS, outputs=names)
    time = np.arange(20 * 512 + 1) / 512.0
    wave = 0.01 * np.sin(2.0 * pi * time / 8.0) ** 2 * (time < 8.0)
    speeds = np.stack([-2.0 * wave, 0.05 * wave, -wave], axis=1)
    state, made = np.zeros(model.A.shape[0]), np.empty((time.size, len(names)))
    for n, u in enumerate(speeds):
        made[n] = model.C @ state + model.D @ u
        state = model.A @ state + model.B @ u
    inputs = dict(zip(SPEEDS, speeds.T, strict=True)) | dict.fromkeys(SHIP, 0.0)
    run = simulate(machine, inputs, 512.0)
    for column, name in enumerate(names):
        change = run[name] - run[name][0]
        largest = np.abs(change).max()
        assert largest > 1e-7
        np.testing.assert_allclose(change, made[:, column], atol=0.015 * largest, err_msg=name)


def test_tip_moves_by_the_kinematics_of_the_boom(crane):
    machine = body(crane, boom_deg=50.0, slew_deg=0.0)
    at = dict.fromkeys(machine.ports.external, 0.0)
    model = linearize(machine, at, 512.0, inputs=["slew_speed"], outputs=["tip_x", "tip_y"])
    step = model.C @ model.B + model.D
    # half of the step's speed now, all of it a sample later: the trapezoidal rule
    radius = crane.geometry.foot + crane.geometry.boom * cos(50.0 * pi / 180.0)
    np.testing.assert_allclose(model.D[:, 0], [0.0, -0.5 * radius / 512.0], atol=1e-12)
    assert step[1, 0] == pytest.approx(-radius / 512.0, rel=0.6)


# --- exports --------------------------------------------------------------------------------------
