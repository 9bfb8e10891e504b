"""Physical sets: their lumps, completed for any drive, their files, and what is refused."""

import pickle
from math import atan, pi, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate import (
    Drive,
    FullOrderDrive,
    InputError,
    ParameterError,
    PhysicalSet,
)
from swashplate.full_order import QUANTITIES, from_lumped

AXES = ("hoist", "slew", "luff")
SCALED = ("Z1", "Z3", "Z4", "Z5", "Z6", "Z8", "Z9", "Z10", "Z13", "Z14", "Z15", "Z16", "Z18")
LIGHT = {"spool_mass": 1e-3, "piston_mass": 0.05}
"""Masses that leave something for the rest of what swings, whatever the lumps."""


@pytest.mark.parametrize("name", AXES)
def test_preset_lands_on_the_published_lumps(name: str, source_parameters: dict) -> None:
    """Against Kruse's tables, all but the gauge Z6↔Z8."""
    published = source_parameters["pump_motor"][name]
    lumps = PhysicalSet.preset(name).to_lumped()
    for symbol, value in lumps.items():
        if symbol in ("Z6", "Z7", "Z8"):
            continue
        assert value == pytest.approx(_pair(value, published[symbol]), rel=1e-14, abs=0.0), symbol
    rate = published["Z8"] / (1.0 + published["Z6"])
    assert lumps["Z8"] / (1.0 + lumps["Z6"]) == pytest.approx(rate, rel=1e-14)
    assert lumps["Z7"] == 0.0
    moved = PhysicalSet.preset(name).to_lumped(published["Z6"])
    assert moved["Z8"] == pytest.approx(published["Z8"], rel=1e-14)


def _pair(value: object, published: object) -> object:
    if isinstance(value, tuple) and not isinstance(published, list):
        return (published, published)
    return tuple(published) if isinstance(published, list) else published


@pytest.mark.parametrize("name", AXES)
def test_a_packaged_drive_gives_the_packaged_set(name: str) -> None:
    full, packaged = FullOrderDrive.from_drive(Drive.preset(name)), PhysicalSet.preset(name)
    assert full.physical.numbers == packaged.numbers
    assert list(packaged) == list(QUANTITIES)
    assert {entry.status for entry in full.physical.values()} == {"assumed"}
    assert {entry.status for entry in packaged.values()} == {"assumed"}
    assert packaged.numbers["air_fraction"] == 0.0  # not in the file
    assert full.physical["oil_volume"].source == "stroking cylinder and lines"


def test_gravity_moves_the_pressures_reference_and_nothing_else() -> None:
    hoist = PhysicalSet.preset("hoist")
    loaded = hoist.replace(load_torque=5e3, motor_leakage=1e-6)
    n = loaded.numbers
    # P0 A_s d4 = K_mf C_g A_p d5
    P0 = n["motor_constant"] * 5e3 * 1e-6 / (n["piston_area"] * 0.08)
    before, after = hoist.to_lumped(), loaded.to_lumped()
    assert after["Z9"] == pytest.approx(before["Z9"] - P0, rel=1e-14)
    assert after["Z11"] == pytest.approx(5e-3)
    assert after["Z12"] == pytest.approx(1e-6 * 12.396 * n["load_inertia"])
    assert {k for k in before if before[k] != after[k]} == {"Z9", "Z11", "Z12"}


def lumps_by_hand(n: dict, Z6: float) -> dict[str, float]:
    """Kruse eqs. 6.56 to 6.70, written out from the symbols of Kruse (2001)."""
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


def test_an_inertia_takes_the_place_of_its_frequency() -> None:
    hoist = Drive.preset("hoist")
    chosen = {"feedback_arm_inertia": 2e-6, "piston_damping": 90.0, "swash_inertia": 0.02}
    full = FullOrderDrive.from_drive(hoist, **chosen)
    assert {name: full.physical.numbers[name] for name in chosen} == chosen
    # ω = √(k_f d3²/J) with √Z4 = k_f d3²
    swings = 2e-6 + 0.04 * 0.0079568**2
    modes = full.modes()
    hertz = sqrt(sqrt(0.053604) / swings) / (2.0 * pi)
    assert modes.frequency_hz(modes.spool) == pytest.approx(hertz, rel=0.02)
    # ζ = b/(2 √(k m)) in the angle of the plate
    n = from_lumped(hoist.parameters, swash_inertia=0.02).numbers
    spring, inertia = n["return_spring_rate"] * 0.08**2, 0.02 + n["piston_mass"] * 0.08**2
    ratio = n["piston_damping"] * 0.08**2 / (2.0 * (spring * inertia) ** 0.5)
    assert ratio == pytest.approx(0.3)
    # one that follows from the lumps may be given where it agrees
    agreeing = from_lumped(hoist.parameters, control_arm=0.08 / 0.62542).numbers
    assert agreeing == pytest.approx(from_lumped(hoist.parameters).numbers)
    with pytest.raises(ParameterError, match="feedback_arm_inertia and spool_frequency "):
        FullOrderDrive.from_drive(hoist, feedback_arm_inertia=2e-6, spool_frequency=250.0)
    with pytest.raises(ParameterError, match="piston_damping and swash_damping_ratio "):
        from_lumped(hoist.parameters, piston_damping=90.0, swash_damping_ratio=0.2)


@pytest.mark.parametrize(
    ("changes", "chosen", "sentence"),
    [
        ({}, {"spool_mas": 0.1}, "'spool_mas'"),
        ({}, {"spool_mass": 0.0}, r"mine: spool_mass .* 0 kg"),
        ({}, {"oil_volume": "big"}, r"oil_volume .* m\^3"),
        ({}, {"spool_mass": 0.1}, "spool_mass .* spool_arm .* 6.331e-06 kg m², .* spool_f"),
        ({}, {"control_arm": 0.2}, "control_arm .* 0.2 m, .* 0.127914042"),
        ({}, {"load_torque": 1e8}, "load .* stroking pressure of .* Pa"),
        ({"Z2": 0.01}, {}, "mine: Z2 .* 0.01, .* Z2 = 0"),
        ({"Z11": 0.01}, {}, "Z11 .* 0.01, .* load_torque"),
    ],
)
def test_what_no_machine_has_is_refused(changes: dict, chosen: dict, sentence: str) -> None:
    drive = Drive.preset("hoist").replace(**changes).renamed("mine")
    with pytest.raises(ParameterError, match=sentence):
        FullOrderDrive.from_drive(drive, **chosen)


def test_the_inertia_that_agrees_is_said() -> None:
    drive = Drive.preset("hoist").replace(Z7=0.5, Z11=0.01, Z12=0.03)
    with pytest.raises(ParameterError, match=r"load_inertia = [\d.]+ kg") as refusal:
        FullOrderDrive.from_drive(drive, load_torque=2e3)
    said = float(str(refusal.value).partition("load_inertia = ")[2].split()[0])
    # K_mL = Z11/C_g and Z12 = K_mL Z10 C_i
    assert said == pytest.approx(0.03 / (0.01 / 2e3 * 12.396), rel=1e-11)
    full = FullOrderDrive.from_drive(drive, load_torque=2e3, load_inertia=said)
    assert full.physical.numbers["motor_leakage"] == pytest.approx(5e-6)


def test_a_set_is_changed_copied_and_refused_in_words() -> None:
    hoist = PhysicalSet.preset("hoist")
    stops = hoist.replace(swash_stop=0.2)
    assert (stops["swash_stop"].value, stops["swash_stop"].status) == ((0.2, 0.2), "user")
    assert pickle.loads(pickle.dumps(hoist)) == hoist
    n = hoist.numbers
    past = atan(n["control_arm"] / n["swash_arm"]) + 0.01  # where the arm lies at 90°
    for changes, said in (
        ({"swash_stop": (past, 0.2)}, "feedback arm .* 90°"),
        ({"spool_frequency": 200.0}, "spool_frequency.* completed"),
        ({"air_fraction": 1.0}, "air_fraction .* 1, .* below 1"),
        ({"air_fraction": 1.5}, "air_fraction .* 1.5, .* 1: .* per cent"),
        ({"bulk_modulus": 1.4}, "bulk_modulus .* 1.4 Pa, .* 1e.11 Pa: .* GPa"),
    ):
        with pytest.raises(ParameterError, match=said):
            hoist.replace(**changes)
    with pytest.raises(ParameterError, match="physical set 'winch'; .* hoist"):
        PhysicalSet.preset("winch")
    rough = Drive.preset("hoist").replace(spool_friction=1.0)
    with pytest.raises(InputError, match="refinements, .* spool_friction"):
        FullOrderDrive.from_drive(rough)
