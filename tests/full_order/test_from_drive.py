"""A full-order drive for any parameters: its lumps, what is assumed, what is refused."""

from dataclasses import replace
from math import pi, sqrt
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate import Drive, FullOrderDrive, InputError, ParameterError, PhysicalSet, maneuvers
from swashplate.full_order import comparison, from_lumped

AXES = ("hoist", "slew", "luff")
SCALED = ("Z1", "Z3", "Z4", "Z5", "Z6", "Z8", "Z9", "Z10", "Z13", "Z14", "Z15", "Z16", "Z18")
LIGHT = {"spool_mass": 1e-3, "piston_mass": 0.05}
"""Masses that leave something for the rest of what swings, whatever the lumps."""


def lumps_by_hand(n: dict, Z6: float) -> dict[str, float]:
    """Kruse eqs. 6.56 to 6.70, written out from the symbols of the source."""
    A, d4, k_r, V, B = (
        n[each]
        for each in ("piston_area", "swash_arm", "return_spring_rate", "oil_volume", "bulk_modulus")
    )
    gauge = (1.0 + Z6) / (1.0 + A**2 * B / (k_r * V))
    P0 = n["motor_constant"] * n["load_torque"] * n["pumping_area"] * n["pumping_arm"] / (A * d4)
    gain = n["motor_constant"] * n["pump_flow_gain"]
    return {
        "Z1": A / (k_r * d4),
        "Z3": d4 / n["control_arm"],
        "Z4": (n["feedback_spring_rate"] * n["feedback_spring_arm"] ** 2) ** 2,
        "Z5": n["spool_arm"],
        "Z7": n["piston_leakage"] * B / V * gauge,
        "Z8": n["valve_flow_gain"] * B / V * gauge,
        "Z9": n["supply_pressure"] - P0,
        "Z10": gain,
        "Z11": n["motor_leakage"] * n["load_torque"],
        "Z12": n["motor_leakage"] * gain * n["load_inertia"],
        "Z13_plus": n["swash_stop_plus"],
        "Z13_minus": n["swash_stop_minus"],
        "Z14": n["spool_stroke"],
        "Z15": n["relief_pressure"],
        "Z16_plus": n["orifice_opening_plus"],
        "Z16_minus": n["orifice_opening_minus"],
        "Z18": n["plussing"],
    }


@pytest.mark.parametrize("name", AXES)
def test_a_packaged_drive_gives_the_packaged_set(name: str) -> None:
    full = FullOrderDrive.from_drive(Drive.preset(name))
    packaged = PhysicalSet.preset(name)
    assert full.physical.numbers == packaged.numbers
    assert full.physical.to_lumped() == packaged.to_lumped()
    assert {entry.status for entry in full.physical.values()} == {"assumed"}
    assert full.physical["oil_volume"].source == "stroking cylinder and lines"


@given(
    st.dictionaries(
        st.sampled_from(SCALED),
        st.floats(0.8, 1.25),
    ),
    st.sampled_from(AXES),
)
def test_a_fitted_like_set_lands_on_its_own_lumps(factors: dict, like: str) -> None:
    drive = Drive.preset("hoist").scale(**factors).replace(Z7=0.4).renamed("mine")
    full = FullOrderDrive.from_drive(drive, like, oil_volume=1e-4, **LIGHT)
    n = drive.parameters.numbers
    for column, value in lumps_by_hand(full.physical.numbers, n["Z6"]).items():
        assert value == pytest.approx(n[column], rel=1e-9, abs=0.0), column
    assert full.drive is drive
    reduced = full.reduced.parameters.numbers
    assert {each: reduced[each] for each in n} == pytest.approx(dict(n), rel=1e-9, abs=0.0)
    assert full.physical.name == "mine"


def test_what_is_chosen_is_marked_and_the_rest_assumed() -> None:
    hoist = Drive.preset("hoist")
    chosen = {"oil_volume": 1e-4, "motor_constant": 200.0, "load_torque": 2e3}
    full = FullOrderDrive.from_drive(hoist, **chosen)
    of_user = {name for name, entry in full.physical.items() if entry.status == "user"}
    assert of_user == set(chosen)
    assert {entry.status for entry in full.physical.values()} == {"user", "assumed"}
    # half the oil is twice as stiff: Z6 = A_s² B/(k_r V)
    before = PhysicalSet.preset("hoist").to_lumped()["Z6"]
    assert full.physical.to_lumped()["Z6"] == pytest.approx(2.0 * before, rel=1e-12)
    # the load is held by the motor's pressure: K_mf C_g
    run = full.simulate(np.zeros(64))
    assert run.motor_pressure_drop[0] == pytest.approx(200.0 * 2e3, rel=1e-12)


def test_like_is_the_axis_of_the_name_or_the_hoist() -> None:
    slew = Drive.preset("slew")
    mass = PhysicalSet.preset("slew").numbers["spool_mass"]
    assert FullOrderDrive.from_drive(slew).physical.numbers["spool_mass"] == mass == 0.01
    hoist = Drive.preset("hoist").renamed("winch 7")
    assert FullOrderDrive.from_drive(hoist).physical.numbers["spool_mass"] == 0.04
    assert FullOrderDrive.from_drive(hoist, "slew").physical.numbers["spool_mass"] == mass
    with pytest.raises(ParameterError, match="no packaged physical set 'crane'; there are hoist"):
        FullOrderDrive.from_drive(hoist, "crane")


def test_an_inertia_takes_the_place_of_its_frequency() -> None:
    hoist = Drive.preset("hoist")
    full = FullOrderDrive.from_drive(hoist, feedback_arm_inertia=2e-6, piston_damping=90.0)
    n = full.physical.numbers
    assert (n["feedback_arm_inertia"], n["piston_damping"]) == (2e-6, 90.0)
    # ω = √(k_f d3²/J) with √Z4 = k_f d3²
    swings = 2e-6 + 0.04 * 0.0079568**2
    modes = full.modes()
    hertz = sqrt(sqrt(0.053604) / swings) / (2.0 * pi)
    assert modes.frequency_hz(modes.spool) == pytest.approx(hertz, rel=0.02)
    with pytest.raises(ParameterError, match="feedback_arm_inertia and spool_frequency are both"):
        FullOrderDrive.from_drive(hoist, feedback_arm_inertia=2e-6, spool_frequency=250.0)
    with pytest.raises(ParameterError, match="piston_damping and swash_damping_ratio are both"):
        from_lumped(hoist.parameters, piston_damping=90.0, swash_damping_ratio=0.2)


@pytest.mark.parametrize(
    ("changes", "chosen", "sentence"),
    [
        ({}, {"spool_mas": 0.1}, "no quantity 'spool_mas'"),
        ({}, {"oil_volume": -1.0}, r"mine: oil_volume .* is -1 m\^3, but must be above 0"),
        ({}, {"spool_mass": 0.2}, "choose a smaller mass or a lower frequency"),
        ({}, {"control_arm": 0.2}, "control_arm is given as 0.2 m, but 0.127914042 follows"),
        ({}, {"load_torque": 1e8}, "the load holds a stroker pressure of .* Pa at rest"),
        ({"Z2": 0.01}, {}, "mine: Z2 is 0.01, but a physical set has Z2 = 0"),
        ({"Z11": 0.01}, {}, "Z11 is 0.01, but without load_torque no speed is lost to it"),
        ({"Z14": float("inf")}, {}, "spool_stroke .* is inf m, but must be above 0"),
    ],
)
def test_what_no_machine_has_is_refused(changes: dict, chosen: dict, sentence: str) -> None:
    drive = Drive.preset("hoist").replace(**changes).renamed("mine")
    with pytest.raises(ParameterError, match=sentence):
        FullOrderDrive.from_drive(drive, **chosen)


def test_the_inertia_that_agrees_is_said() -> None:
    drive = Drive.preset("hoist").replace(Z11=0.01, Z12=0.03)
    with pytest.raises(ParameterError, match=r"for example load_inertia = [\d.]+ kg") as refusal:
        FullOrderDrive.from_drive(drive, load_torque=2e3)
    said = float(str(refusal.value).partition("load_inertia = ")[2].split()[0])
    # K_mL = Z11/C_g and Z12 = K_mL Z10 C_i
    assert said == pytest.approx(0.03 / (0.01 / 2e3 * 12.396), rel=1e-11)
    full = FullOrderDrive.from_drive(drive, load_torque=2e3, load_inertia=said)
    assert full.physical.numbers["motor_leakage"] == pytest.approx(5e-6)


def test_refinements_are_refused() -> None:
    rough = Drive.preset("hoist").replace(spool_friction=1.0)
    with pytest.raises(InputError, match="Full-order drives do not know refinements, but spool_f"):
        FullOrderDrive.from_drive(rough)
    with pytest.raises(InputError, match="hoist: Full-order drives .* spool_friction is on; take"):
        FullOrderDrive(rough, PhysicalSet.preset("hoist"))
    assert FullOrderDrive.from_drive(rough.plain).drive == Drive.preset("hoist")


def test_a_file_s_hertz_are_turns(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(
        'name = "own"\nlumps = "hoist"\n[physical]\n'
        'spool_frequency = { value = 40, unit = "Hz" }\nspool_mass = { value = 40, unit = "g" }\n',
        "utf-8",
    )
    own, packaged = PhysicalSet.from_toml(path).numbers, PhysicalSet.preset("hoist").numbers
    assert own["feedback_arm_inertia"] == pytest.approx(packaged["feedback_arm_inertia"])
    path.write_text(path.read_text("utf-8").replace('"Hz"', '"kHz/bar"'), "utf-8")
    with pytest.raises(ParameterError, match="own.toml: spool_frequency .* does not measure"):
        PhysicalSet.from_toml(path)


def test_following_a_run_is_simulating_it() -> None:
    hoist = FullOrderDrive.preset("hoist")
    step = maneuvers.step(4.0, start=0.2, stop=1.0, length=1.5).sample(100.0)
    time = 3.0 + np.arange(step.size) / 100.0
    run = hoist.drive.simulate(step, 100.0, time=time, interpolation="linear")
    followed = hoist.follow(run)
    assert followed.time[0] == 3.0
    simulated = hoist.simulate(step, 100.0)
    assert followed.shaft_speed == pytest.approx(simulated.shaft_speed, abs=1e-9)
    by_current = hoist.drive.simulate_current(np.full(100, 0.5))
    assert np.array_equal(
        hoist.follow(by_current).shaft_speed,
        hoist.simulate_current(np.full(100, 0.5)).shaft_speed,
    )


@pytest.fixture(scope="module")
def compared() -> comparison.Comparison:
    hoist = FullOrderDrive.preset("hoist")
    step = maneuvers.step(4.0, start=0.5, stop=2.0, length=3.0).sample(512.0)
    return comparison.compare(hoist, hoist.drive.simulate(step))


def test_the_lag_is_that_of_the_spool() -> None:
    """Small motions: the spool's lag T = 2 ζ/ω turns 1/(1 + jωτ) into 1/(1 + jωτ(1 + jωT)).

    To first order in T the speed then comes T ω²τ²/(1 + ω²τ²) later, and that explains the share
    ω²τ²/(1 + ω²τ²) of the difference; the rest is a gain.
    """
    hoist = FullOrderDrive.preset("hoist")
    omega, time = 2.0 * pi * 3.0, np.arange(3073) / 512.0
    small = 0.45 + 0.01 * np.sin(omega * time)
    run = hoist.drive.simulate_current(small, start="steady")
    lag = comparison.compare(hoist, run, start="steady").lag
    assert lag is not None
    squared = (omega * 0.1214) ** 2  # τ of the reduced model, model.md section 9
    expected = 2.0 * 0.3 / (2.0 * pi * 40.0) * squared / (1.0 + squared)
    # first order in ωT = 0.045, and the coupled spool has ζ = 0.286 in place of 0.3
    assert lag.time == pytest.approx(expected, rel=0.1)
    assert 0.5 < lag.share < squared / (1.0 + squared)


def test_the_difference_is_that_of_the_speeds(compared: comparison.Comparison) -> None:
    error = compared.reduced_speed - compared.full.shaft_speed
    difference = compared.difference
    assert difference.largest == np.abs(error).max()
    assert difference.rms == pytest.approx(np.sqrt(np.mean(error**2)))
    assert difference.within == 0.01  # docs/full-order.md: 0.56 %


def test_a_speed_that_comes_earlier_by_3_ms_is_told(compared: comparison.Comparison) -> None:
    hoist = FullOrderDrive.preset("hoist")
    time = np.arange(2049) / 512.0
    amplitude, omega = 0.2, 2.0 * pi * 0.5
    run = hoist.simulate_current(0.4 + amplitude * np.sin(omega * time), start="steady")
    earlier = np.interp(time + 3e-3, time, run.shaft_speed)
    made = replace(compared, full=run, reduced_speed=earlier)
    lag = made.lag
    assert lag is not None
    assert lag.time == pytest.approx(3e-3, rel=0.01)
    assert lag.share > 0.98


def test_without_motion_there_is_nothing_to_tell() -> None:
    slew = Drive.preset("slew").replace(Z17=5.0)  # a dead zone that no current leaves
    full = FullOrderDrive.from_drive(slew)
    found = comparison.compare(full, slew.simulate(maneuvers.step(2.0).sample()))
    assert not found.difference.moves
    assert found.lag is None
    begun: list[str] = []
    table = comparison.validity(full, begin=begun.append)
    assert begun == [title for title, _ in comparison.TABLE_MANEUVERS]
    assert table["largest_percent"].null_count() == table.height
    assert table["within_1_percent"].null_count() == table.height
    assert table["top_speed"].max() < 1e-6


def test_a_table_of_both(compared: comparison.Comparison, tmp_path: Path) -> None:
    compared.write(tmp_path / "run.parquet")
    table = pl.read_parquet(tmp_path / "run.parquet")
    assert table.columns[:3] == ["time", "voltage", "current"]
    error = (table["reduced_shaft_speed"] - table["shaft_speed"]).abs().max()
    assert error == compared.difference.largest
    hoist = FullOrderDrive.preset("hoist")
    by_current = comparison.compare(hoist, hoist.drive.simulate_current(np.full(32, 0.5)))
    assert "voltage" not in by_current.to_polars().columns


def test_steps_of_the_reduced_march() -> None:
    assert comparison.fine_steps(512.0, 5000) == 64
    assert comparison.fine_steps(1024.0, 5000) == 32
    assert comparison.fine_steps(512.0, 1_000_000) == 20
    assert comparison.fine_steps(100_000.0, 5000) == 4
