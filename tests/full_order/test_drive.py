"""Five states: march against referee, balances, modes, loads, and one state as their limit."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from tests.full_order.referee import solved

from swashplate import DomainError, Drive, InputError, UnknownParameterError, maneuvers
from swashplate.full_order import (
    TABLE_MANEUVERS,
    FullOrderDrive,
    FullOrderSimulation,
    compare,
    validity,
    validity_table,
    validity_verdict,
)
from swashplate.models.machine import machine_speed, static_pressure


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


def referee(full: FullOrderDrive, command: np.ndarray, tolerance: float = 1e-8) -> np.ndarray:
    """Speed by SciPy's stiff solver."""
    run = full.drive.simulate(command)
    states = solved(full, run, tolerance)[:: run.record.substeps]
    speed, m = machine_speed, full.plant.machine
    return np.array([speed(angle, rate, m) for angle, rate in states[:, 3:].tolist()])


@pytest.mark.slow  # SciPy's solver takes its steps in Python
@pytest.mark.parametrize("name", ["hoist", "slew", "luff"])
def test_march_agrees_with_the_referee(name: str) -> None:
    """At its usual sub-steps, over a stop: 5e-5 rad/s is 0.003 deg/s of a hoist's 196."""
    full = FullOrderDrive.preset(name)
    command = maneuvers.step(9.0, start=0.1, stop=0.9, length=1.25).sample(512.0)
    assert np.abs(referee(full, command) - full.simulate(command).shaft_speed).max() < 5.5e-5


@pytest.mark.slow  # SciPy's solver takes its steps in Python
@pytest.mark.parametrize("kind", ["free", "stops", "relief", "stroke", "air"])
def test_march_converges_to_the_referee(hoist: FullOrderDrive, kind: str) -> None:
    """With order two where nothing is hit, and no less than one with limits that come and go."""
    full = {
        "relief": hoist.replace(load_torque=3e3, motor_leakage=1e-6, relief_pressure=3e5),
        "stroke": hoist.replace(spool_stroke=1e-4),
        "air": hoist.replace(air_fraction=0.01, piston_leakage=1e-12),
    }.get(kind, hoist)
    volts = 4.0 if kind in ("free", "air") else 9.0
    command = maneuvers.step(volts, start=0.1, stop=0.9, length=1.25).sample(512.0)
    exact, counts = referee(full, command, 1e-9), (16, 32, 64, 128)
    found = [full.simulate(command, substeps=n).shaft_speed for n in counts]
    errors = np.array([np.abs(each - exact).max() for each in found])
    assert errors[-1] < 1e-6
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert order > (1.8 if kind in ("free", "air") else 1.0)


def test_stop_is_not_passed_and_nothing_chatters(
    hoist: FullOrderDrive, marched: FullOrderSimulation
) -> None:
    n = hoist.physical.numbers
    assert marched.swash_angle.max() == n["swash_stop_plus"]
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
    assert run.swash_angle.max() <= n["swash_stop_plus"]
    assert run.swash_angle.min() >= -n["swash_stop_minus"]
    # each stop is taken hold of and let go once a turn
    assert np.count_nonzero(np.diff(run.plate_hold)) <= 4 * np.ceil(7.0 * frequency)
    assert all(np.isfinite(run[name]).all() for name in run.names)


def test_oil_and_energy_are_kept(hoist: FullOrderDrive) -> None:
    """What came through the valve is swept, compressed or leaked; what the pump sent moved the
    load. By quadrature of fine samples, so that the equations of the parts are seen together."""
    loaded = hoist.replace(load_torque=3e3, piston_leakage=1e-12)
    command = maneuvers.step(4.0, start=0.1, stop=0.6, length=1.0).sample(8192.0)
    run, m = loaded.simulate(command, 8192.0), loaded.physical.machine
    pressure = run.stroker_pressure + static_pressure(m)

    def passed(rate: np.ndarray) -> float:
        return float(np.trapezoid(rate, run.time))

    came = passed(run.valve_flow - m.piston_leakage * pressure)
    swept = m.piston_area * m.swash_arm * np.ptp(np.tan(run.swash_angle[[0, -1]]))
    squeezed = m.oil_volume / m.bulk_modulus * (pressure[-1] - pressure[0])
    turnover = passed(np.abs(run.valve_flow))
    assert came == pytest.approx(
        np.sign(run.swash_angle[-1]) * swept + squeezed, abs=1e-4 * turnover
    )
    sent = passed(run.motor_pressure_drop * run.pump_flow)
    ideal = m.motor_constant * run.pump_flow  # the motor's speed but for its leakage
    stored = 0.5 * m.load_inertia * (ideal[-1] ** 2 - ideal[0] ** 2)
    assert sent == pytest.approx(stored + m.load_torque * passed(ideal), rel=1e-4)


@pytest.mark.traced
def test_air_makes_the_drive_slower(hoist: FullOrderDrive) -> None:
    """Free air softens the oil: nothing at 1e-9 of it, and off it costs no bit."""
    command = maneuvers.step(4.0, start=0.1, stop=0.6, length=1.0).sample(512.0)
    plain = hoist.simulate(command).shaft_speed
    assert np.array_equal(hoist.replace(air_fraction=0.0).simulate(command).shaft_speed, plain)
    hint = hoist.replace(air_fraction=1e-9).simulate(command).shaft_speed
    assert 0.0 < np.abs(hint - plain).max() < 1e-6 * plain.max()
    soft = hoist.replace(air_fraction=0.05)
    assert np.abs(soft.simulate(command).shaft_speed - plain).max() > 1e-4 * plain.max()
    assert soft.physical.to_lumped()["Z6"] < hoist.physical.to_lumped()["Z6"]
    # trapped oil that is softer swings slower
    assert abs(soft.modes().swash) < abs(hoist.modes().swash)


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
    assert len(hoist.modes().eigenvalues) == 5
    assert np.all(hoist.modes().eigenvalues.real < 0.0)


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
    held = hoist.drive.simulate_current(np.full(100, 0.9), start="steady")
    full = hoist.follow(held, start="steady")
    assert full.swash_angle[-1] == hoist.physical.numbers["swash_stop_plus"]


def test_wrong_options_are_sentences(hoist: FullOrderDrive, step: np.ndarray) -> None:
    with pytest.raises(DomainError, match="20000; .*mass"):
        hoist.replace(spool_mass=1e-20, feedback_arm_inertia=0.0).simulate(step)
    with pytest.raises(InputError, match="substeps .* 5, .* 6 "):
        hoist.simulate(step, substeps=5)
    with pytest.raises(UnknownParameterError, match="'spool_weight'.*; .* spool_mass"):
        hoist.sensitivities(step, parameters=["spool_weight"])


@pytest.mark.slow  # SciPy's solver takes its steps in Python
def test_limits_that_come_and_go_within_a_step(hoist: FullOrderDrive) -> None:
    """A noisy command throws an overdamped spool from stop to stop; no path may miss one."""
    rough = hoist.replace(spool_damping=130.0, spool_stroke=2e-4, oil_volume=1.4e-4)
    noise = np.random.default_rng(3).normal(size=513)
    command = np.repeat([5.0, -5.0, 3.5], 171) + 0.5 * noise
    exact, run = referee(rough, command), rough.simulate(command)
    assert np.count_nonzero(np.diff(run.spool_hold)) > 4
    assert np.abs(exact - run.shaft_speed).max() < 2e-3 * np.abs(exact).max()
    assert np.abs(run.spool_position).max() <= 2e-4 * (1.0 + 1e-6)


DOCUMENT = Path(__file__).parents[2] / "docs" / "full-order.md"
AXES = ("hoist", "slew", "luff")
STEP = maneuvers.step(4.0, start=0.5, stop=2.0, length=3.0).sample(512.0)
INERTIAS = ("spool_mass", "feedback_arm_inertia", "swash_inertia", "piston_mass")
DAMPINGS = ("spool_damping", "piston_damping", "load_inertia")
"""Which act on a rate; the load's inertia on that of the plate."""


@pytest.mark.parametrize("name", AXES)
def test_difference_shrinks_like_the_root_of_epsilon(name: str) -> None:
    """With inertias times ε and dampings times √ε five states lead to one."""
    full, epsilons, sizes = FullOrderDrive.preset(name), (1 / 64, 1 / 256, 1 / 1024), []
    for e in epsilons:
        parts = dict.fromkeys(INERTIAS, e) | dict.fromkeys(DAMPINGS, e**0.5)
        small = full.replace(**{k: part * full.physical.numbers[k] for k, part in parts.items()})
        largest, rms = compare(small, small.drive.simulate(STEP)).relative
        assert largest < 1e-3
        sizes.append(rms)
    slope = np.polyfit(np.log(epsilons), np.log(sizes), 1)[0]
    # but for the next order, ε, and the reduced march's own error, 1/64 of that at 512 Hz
    assert slope == pytest.approx(0.5, abs=0.06)


def test_without_damping_the_spool_rings() -> None:
    """Kruse's eq. 6.19 has no damping: tens of deg/s off on a hoist step of 4 V."""
    hoist = FullOrderDrive.preset("hoist").replace(spool_damping=0.0)
    step = maneuvers.step(4.0).sample(512.0)
    reduced = hoist.reduced.simulate(step, substeps=16).shaft_speed
    off = np.degrees(np.abs(hoist.simulate(step).shaft_speed - reduced)).max()
    assert 30.0 < off < 60.0


@pytest.mark.slow
def test_documented_table_is_what_the_function_gives() -> None:
    table = pl.concat([validity(FullOrderDrive.preset(name)).to_polars() for name in AXES])
    assert table.height == 3 * len(TABLE_MANEUVERS)
    lines = DOCUMENT.read_text("utf-8").split("<!-- validity: begin -->")[1]
    lines = lines.split("<!-- validity: end -->")[0].strip().splitlines()[2:]
    documented = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert len(documented) == table.height
    for row, cells in zip(table.iter_rows(named=True), documented, strict=True):
        assert cells[:2] == [row["axis"], row["maneuver"]]
        assert float(cells[2]) == pytest.approx(row["largest_percent"], abs=0.006)
        assert float(cells[3]) == pytest.approx(row["rms_percent"], abs=0.006)
        assert cells[4] == ("yes" if row["within_1_percent"] else "no")


def test_following_a_run_is_simulating_it() -> None:
    hoist = FullOrderDrive.preset("hoist")
    step = maneuvers.step(4.0, start=0.2, stop=1.0, length=1.5).sample(100.0)
    time = 3.0 + np.arange(step.size) / 100.0
    followed = hoist.follow(hoist.drive.simulate(step, 100.0, time=time, interpolation="linear"))
    assert followed.time[0] == 3.0
    assert followed.shaft_speed == pytest.approx(hoist.simulate(step, 100.0).shaft_speed, abs=1e-9)
    current = np.full(100, 0.5)
    by_current = hoist.follow(hoist.drive.simulate_current(current))
    assert np.array_equal(by_current.current, current)


def test_the_difference_is_that_of_the_speeds(tmp_path: Path) -> None:
    hoist = FullOrderDrive.preset("hoist")
    found = compare(hoist, hoist.drive.simulate(STEP))
    error = found.reduced_speed - found.full.shaft_speed
    top = np.abs(found.full.shaft_speed).max()
    rms = np.sqrt(np.mean(error**2))
    assert found.relative == pytest.approx((np.abs(error).max() / top, rms / top))
    found.write(tmp_path / "run.parquet")
    table = pl.read_parquet(tmp_path / "run.parquet")
    assert table.columns[:3] == ["time", "voltage", "current"]
    np.testing.assert_array_equal(table["reduced_shaft_speed"] - table["shaft_speed"], error)
    by_current = compare(hoist, hoist.drive.simulate_current(np.full(32, 0.5)))
    assert "voltage" not in by_current.to_polars().columns
    made = validity_table("hoist", [("step", found)])
    assert validity_verdict(made) == "One state is enough, to 1 % of the top speed."


@pytest.mark.slow
def test_without_motion_there_is_nothing_to_tell() -> None:
    full = FullOrderDrive.from_drive(Drive.preset("slew").replace(Z17=5.0))  # never leaves it
    made = validity(full)
    table = made.to_polars()
    for column in ("largest_percent", "within_1_percent"):
        assert table[column].null_count() == table.height
    assert table["top_speed"].max() < 1e-6
    assert validity_verdict(made).startswith("The shaft does not move")
