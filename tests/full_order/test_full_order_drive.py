"""The full-order drive: paths against each other, stops, balances, modes, loads."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from swashplate import DomainError, InputError, maneuvers
from swashplate.full_order.drive import FullOrderDrive
from swashplate.full_order.result import SIGNALS, FullOrderSimulation

STOP = 1e-6
"""What a stop may be passed by. [rad]"""


@pytest.fixture(scope="module")
def hoist() -> FullOrderDrive:
    return FullOrderDrive.preset("hoist")


@pytest.fixture(scope="module")
def step() -> np.ndarray:
    """Hard enough to reach a stop, and off again."""
    return maneuvers.step(9.0, start=0.25, stop=2.5, length=4.0).sample(512.0)


@pytest.fixture(scope="module")
def marched(hoist: FullOrderDrive, step: np.ndarray) -> FullOrderSimulation:
    return hoist.simulate(step)


@pytest.mark.traced
@pytest.mark.parametrize("method", ["radau", "lsoda"])
def test_march_agrees_with_stiff_solver(
    hoist: FullOrderDrive, step: np.ndarray, marched: FullOrderSimulation, method: str
) -> None:
    run = hoist.simulate(step, method=method)
    # 1e-6 of the top speed 3.42 rad/s: the march resolves the 920 Hz of the trapped oil with six
    # steps a turn, of which 5e-7 rad are left in the swash angle
    assert np.abs(run.shaft_speed - marched.shaft_speed).max() < 2e-5
    assert np.abs(run.spool_position - marched.spool_position).max() < 2e-8
    assert np.abs(run.shaft_position - marched.shaft_position).max() < 1e-5
    assert run.events == marched.events


def test_stop_is_not_passed_and_nothing_chatters(
    hoist: FullOrderDrive, marched: FullOrderSimulation
) -> None:
    n = hoist.physical.numbers
    assert marched.swash_angle.max() <= n["swash_stop_plus"] + STOP
    # relief valve and stop: each takes hold once and lets go once
    assert marched.events == 4
    at_stop = marched.plate_hold == 1
    assert np.count_nonzero(np.diff(at_stop.astype(int))) == 2
    assert np.all(marched.swash_rate[at_stop] == 0.0)
    # (6.53): P A_s = k_r d4 tan α at the stop
    limit = n["return_spring_rate"] * n["swash_arm"] * np.tan(n["swash_stop_plus"])
    assert marched.stroker_pressure.max() == pytest.approx(limit / n["piston_area"], rel=1e-12)


@pytest.mark.traced
@pytest.mark.parametrize("name", ["hoist", "slew", "luff"])
@pytest.mark.parametrize("frequency", [0.3, 1.0])
def test_every_axis_at_both_stops(name: str, frequency: float) -> None:
    full = FullOrderDrive.preset(name)
    run = full.simulate(maneuvers.sine(10.0, frequency, settle=None, length=8.0).sample(512.0))
    n = full.physical.numbers
    assert run.swash_angle.max() <= n["swash_stop_plus"] + STOP
    assert run.swash_angle.min() >= -n["swash_stop_minus"] - STOP
    cycles = 7.0 * frequency
    assert run.events <= 8 * np.ceil(cycles)  # relief and stop, on and off, at two stops a turn
    # the march resolves the oil's own mode with six steps a turn: its energy errs by about 1e-7
    assert run.balances().worst < 1e-6
    assert np.isfinite(run.rows).all()


@pytest.mark.traced
def test_balances_close(
    hoist: FullOrderDrive, step: np.ndarray, marched: FullOrderSimulation
) -> None:
    assert marched.balances().worst < 1e-6
    tight = hoist.simulate(step, method="radau", tolerance=1e-8)
    assert tight.balances().worst < 1e-7
    found = marched.balances()
    # the pump turned the empty drum to 3.42 rad/s: C_i Ω²/2
    assert found.load.turnover == pytest.approx(0.5 * 150.0 * marched.shaft_speed.max() ** 2)
    assert marched.losses[-1, 1] > 0.0


@pytest.mark.traced
def test_balances_with_everything_on(hoist: FullOrderDrive, step: np.ndarray) -> None:
    loaded = hoist.replace(
        load_torque=3e3, motor_leakage=1e-6, piston_leakage=1e-12, relief_pressure=3e5
    )
    for run in (loaded.simulate(step), loaded.simulate(step, method="radau")):
        found = run.balances()
        assert found.worst < 1e-6
        assert run.relief_hold.max() == 1
        assert run.plate_hold.max() == 0  # the relief valve opens before the stop
        assert run.account("leakage_volume")[-1] > 0.0
        assert run.account("relief_volume").max() > 0.0


@pytest.mark.traced
def test_spool_at_its_stroke(hoist: FullOrderDrive, step: np.ndarray) -> None:
    short = hoist.replace(spool_stroke=1e-4)
    run = short.simulate(step)
    assert np.abs(run.spool_position).max() <= 1e-4
    assert {-1, 0, 1} == set(run.spool_hold.tolist())
    assert run.balances().worst < 1e-6
    assert run.losses[-1, 0] > 0.0


def test_modes_stand_where_the_source_says(hoist: FullOrderDrive) -> None:
    modes = hoist.modes(0.35)
    hertz, ratio = modes.frequency_hz, modes.damping_ratio
    assert hertz(modes.spool) == pytest.approx(40.0, rel=0.02)
    assert ratio(modes.spool) == pytest.approx(0.3, rel=0.06)
    assert hertz(modes.swash_at_held_pressure) == pytest.approx(40.0, rel=0.02)
    # behind the closed valve the trapped oil stiffens the return spring 1 + Z6 times
    Z6 = hoist.physical.to_lumped()["Z6"]
    assert hertz(modes.swash) == pytest.approx(40.0 * (1.0 + Z6) ** 0.5, rel=0.01)
    # τ of the reduced model, 0.1214 s (model.md section 9), less the modes' lags of about 2 ms
    assert -1.0 / modes.slow.real == pytest.approx(0.1214, rel=0.03)
    assert len(hoist.eigenvalues()) == 5
    assert np.all(hoist.eigenvalues().real < 0.0)


@pytest.mark.traced
def test_modes_against_differences_of_the_rates(hoist: FullOrderDrive) -> None:
    """The Jacobian that solvers and modes use, against differences through the whole model."""
    from swashplate.full_order.march import N_STATES, jacobian_at, rates_at
    from swashplate.simulation.instance import pump_of

    loaded = hoist.replace(load_torque=3e3, piston_leakage=1e-12)
    machine, pump = loaded.machine, pump_of(hoist.drive.parameters)
    current, free = np.array([0.5, 0.5]), (0, 0, 0)
    row = np.zeros(16)
    row[:5] = 6e-5, 0.01, 2e5, 0.12, 0.08
    jacobian = jacobian_at(0.0, row, current, True, 1.0, free, machine, pump)
    for k, h in enumerate((1e-6, 1e-4, 1e3, 1e-4, 1e-4)):
        ahead, behind = row.copy(), row.copy()
        ahead[k] += h
        behind[k] -= h
        rates = [
            rates_at(0.0, each, current, True, 1.0, free, machine, pump) for each in (ahead, behind)
        ]
        expected = (rates[0] - rates[1])[:N_STATES] / (2.0 * h)
        assert jacobian[:N_STATES, k] == pytest.approx(expected, rel=1e-5, abs=1e-4)


@pytest.mark.traced
def test_load_acts_through_the_motors_pressure(hoist: FullOrderDrive, step: np.ndarray) -> None:
    n = hoist.physical.numbers
    heavy = hoist.replace(load_torque=4e3, load_inertia=600.0).simulate(step)
    # at rest, and held at the stop, gravity alone: K_mf C_g
    static = n["motor_constant"] * 4e3
    assert heavy.motor_pressure_drop[0] == pytest.approx(static)
    assert heavy.motor_pressure_drop[heavy.plate_hold == 1] == pytest.approx(static)
    # accelerating: K_mf C_i dΩ/dt, by differences of the speed
    between = np.gradient(heavy.shaft_speed, 1.0 / 512.0)
    expected = static + n["motor_constant"] * 600.0 * between
    moving = slice(300, 600)
    assert heavy.motor_pressure_drop[moving] == pytest.approx(expected[moving], rel=5e-3)
    light = hoist.replace(load_inertia=0.0).simulate(step)
    assert np.all(light.motor_pressure_drop == 0.0)


@pytest.mark.traced
def test_steady_start_stays(hoist: FullOrderDrive) -> None:
    level = np.full(513, 4.0)
    run = hoist.replace(load_torque=2e3).simulate(level, start="steady")
    assert np.ptp(run.shaft_speed) < 1e-9
    # α from sin α = Z3 tan α_sw and the closed valve; against the reduced model's closed form
    assert run.shaft_speed[0] == pytest.approx(hoist.drive.steady_speed(4.0), rel=1e-4)
    full = hoist.simulate_current(np.full(100, 2.0), start="steady")
    assert full.swash_angle[-1] == hoist.physical.numbers["swash_stop_plus"]


@pytest.mark.traced
def test_rest_is_rest_until_the_valve_opens() -> None:
    slew = FullOrderDrive.preset("slew")  # no plussing
    run = slew.simulate(np.zeros(512))
    assert np.all(run.shaft_speed == 0.0)
    assert run.events == 0


def test_symmetric_root_is_taken_from_the_drive(hoist: FullOrderDrive, step: np.ndarray) -> None:
    from dataclasses import replace

    from swashplate import Drive

    parameters = replace(hoist.drive.parameters, pressure_root="symmetric")
    other = FullOrderDrive(Drive(parameters), hoist.physical)
    change = np.degrees(other.simulate(step).shaft_speed - hoist.simulate(step).shaft_speed)
    fine = 32
    reduced = [each.reduced.simulate(step, substeps=fine).shaft_speed for each in (other, hoist)]
    expected = np.degrees(reduced[0] - reduced[1])
    assert np.abs(expected).max() > 5.0
    # both changes by themselves differ in time by the modes' lag of some 2 ms
    assert np.abs(change - expected).max() < 0.2


@pytest.mark.traced
def test_records(hoist: FullOrderDrive) -> None:
    current = np.zeros(257)
    current[26:] = 0.5
    held = hoist.simulate_current(current, interpolation="previous")
    stamps = np.array([0.0, 26.0 / 512.0])
    sparse = hoist.simulate_current([0.0, 0.5, 0.5], time=[*stamps, 0.5], interpolation="previous")
    assert sparse.shaft_speed == pytest.approx(held.shaft_speed, abs=1e-12)
    slow = hoist.simulate_current(current[::4], 128.0)
    assert slow.time.size == 65
    assert slow.shaft_speed[-1] == pytest.approx(held.shaft_speed[-1], rel=0.02)


@pytest.mark.traced
def test_table(marched: FullOrderSimulation, tmp_path: Path) -> None:
    marched.write(tmp_path / "run.parquet")
    table = pl.read_parquet(tmp_path / "run.parquet")
    assert table.columns == ["time", *SIGNALS, "spool_hold", "relief_hold", "plate_hold"]
    assert table["swash_angle"].to_numpy() == pytest.approx(marched.swash_angle)
    assert not marched.shaft_speed.flags.writeable
    # at its stop the plate stands still, and all that passes the orifice leaves by the relief valve
    held = marched.plate_hold == 1
    fine = marched.account("relief_volume")[held]
    flow = table["valve_flow"].to_numpy()[held]
    assert fine[-1] - fine[0] == pytest.approx(np.trapezoid(flow, dx=1.0 / 512.0), rel=1e-3)
    assert "2049 samples, march" in repr(marched)


def test_wrong_options_are_sentences(hoist: FullOrderDrive, step: np.ndarray) -> None:
    with pytest.raises(InputError, match="method is 'euler'; it is 'march', 'radau' or 'lsoda'"):
        hoist.simulate(step, method="euler")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="tolerance is 0, but must be above 0"):
        hoist.simulate(step, method="radau", tolerance=0.0)
    with pytest.raises(InputError, match="start is 'warm'"):
        hoist.simulate_current([0.1, 0.1], start="warm")  # type: ignore[arg-type]
    with pytest.raises(DomainError, match="more than 20000; use method='radau'"):
        hoist.scaled(1e-9).simulate(step)
    with pytest.raises(InputError, match="substeps is 3, but .* needs at least 5 to be stable"):
        hoist.simulate(step, substeps=3)
    with pytest.raises(InputError, match="The current is nan"):
        hoist.modes(float("nan"))
    with pytest.raises(InputError, match="not finite"):
        hoist.simulate_current([0.1, float("nan")])


def test_limits_that_come_and_go_within_a_step(hoist: FullOrderDrive) -> None:
    """A noisy current throws an overdamped spool from stop to stop; no path may miss one."""
    rough = hoist.replace(spool_damping=130.0, spool_stroke=2e-4, oil_volume=1.4e-4)
    noise = np.random.default_rng(3).normal(size=513)
    current = np.repeat([0.9, -0.9, 0.5], 171) + 0.1 * noise
    exact = rough.simulate_current(current, substeps=100)
    solved = rough.simulate_current(current, method="radau")
    top = np.abs(exact.shaft_speed).max()
    assert exact.events > 10
    assert np.abs(solved.shaft_speed - exact.shaft_speed).max() < 1e-5 * top
    assert np.abs(solved.spool_position).max() <= 2e-4 * (1.0 + 1e-6)
    # the default resolution, six steps a turn of the fastest mode
    marched = rough.simulate_current(current)
    assert np.abs(marched.shaft_speed - exact.shaft_speed).max() < 1e-4 * top


@pytest.mark.traced
def test_a_pulse_of_one_sample_is_seen(hoist: FullOrderDrive) -> None:
    current = np.zeros(400)
    current[201] = 0.8
    calm = hoist.simulate_current(np.zeros(400)).shaft_speed
    for method in ("march", "radau", "lsoda"):
        run = hoist.simulate_current(current, method=method)
        assert np.abs(run.shaft_speed - calm).max() > 0.01


@pytest.mark.traced
def test_one_sample(hoist: FullOrderDrive) -> None:
    for method in ("march", "radau"):
        run = hoist.simulate_current([0.4], method=method)
        assert run.time.size == 1
        assert run.swash_angle[0] == 0.0


def test_a_stop_that_is_left_slowly_is_left() -> None:
    """Luff's spool leaves its stroke at next to no speed; interpolation once found it there again
    and again, until the limits were said to chatter."""
    luff = FullOrderDrive.preset("luff")
    command = maneuvers.sine(6.5, 0.3, settle=None, length=6.0).sample(512.0)
    run, march = luff.simulate(command, method="radau"), luff.simulate(command)
    assert run.events == march.events == 2
    assert np.abs(run.shaft_speed - march.shaft_speed).max() < 2e-6
    assert (
        np.abs(run.spool_position).max() < luff.machine.p.spool_stroke + 1e-9
    )  # the solver's tolerance
