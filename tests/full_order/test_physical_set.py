"""Physical sets: their lumps, their files, and what is refused."""

import pickle
from math import inf, pi, tan
from pathlib import Path

import pytest

from swashplate import Drive, FileError, ParameterError
from swashplate.full_order import PhysicalSet, from_lumped
from swashplate.full_order.physical_set import QUANTITIES

AXES = ("hoist", "slew", "luff")


@pytest.mark.parametrize("name", AXES)
def test_preset_lands_on_the_published_lumps(name: str, source_parameters: dict) -> None:
    """Against the source's tables, all but the gauge Z6↔Z8."""
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
def test_everything_in_a_preset_is_marked_assumed(name: str) -> None:
    physical = PhysicalSet.preset(name)
    assert list(physical) == list(QUANTITIES)
    assert {entry.status for entry in physical.values()} == {"assumed"}
    assert physical.numbers["air_fraction"] == 0.0  # not in the file


def test_hoist_by_hand() -> None:
    n = PhysicalSet.preset("hoist").numbers
    assert n["piston_area"] == pytest.approx(pi * 0.06**2 / 4.0)
    # Z1 = A_s/(k_r d4)
    assert n["return_spring_rate"] == pytest.approx(2.82743e-3 / (4.6441e-7 * 0.08), rel=1e-5)
    # what swings at 40 Hz: model.md's 3.66e-6 and 7.7e-3 kg m²
    spool = n["feedback_arm_inertia"] + n["spool_mass"] * n["spool_arm"] ** 2
    assert spool == pytest.approx(3.66e-6, rel=2e-3)
    plate = n["swash_inertia"] + n["piston_mass"] * n["swash_arm"] ** 2
    assert plate == pytest.approx(7.7e-3, rel=2e-3)
    # 100 < Z6 < 1000 with some 1e-4 m³ of oil
    Z6 = PhysicalSet.preset("hoist").to_lumped()["Z6"]
    stiffness = n["piston_area"] ** 2 * 1e9 / 2e-4
    assert pytest.approx(stiffness / n["return_spring_rate"]) == Z6
    assert 1e2 < Z6 < 1e3


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


def check_lumps(physical: PhysicalSet, drive: Drive) -> None:
    """The lumps at the drive's own Z6 are the drive's."""
    numbers = drive.parameters.numbers
    for symbol, lump in physical.to_lumped(numbers["Z6"]).items():
        values = lump if isinstance(lump, tuple) else (lump,)
        for column, value in zip(drive[symbol].definition.columns, values, strict=False):
            assert value == pytest.approx(numbers[column], rel=1e-9, abs=0.0), column


def test_completing_keeps_leakages() -> None:
    drive = Drive.preset("hoist").replace(Z7=0.5, Z11=0.01, Z12=0.03)
    load = {"load_torque": 2e3, "load_inertia": 0.03 / 12.396 / (0.01 / 2e3)}
    physical = from_lumped(drive.parameters, **load)
    check_lumps(physical, drive)
    with pytest.raises(ParameterError, match="Z11 makes motor_leakage 5e-06 .* but Z12 makes"):
        from_lumped(drive.parameters, **{**load, "load_inertia": 100.0})
    with pytest.raises(ParameterError, match="Z12 is 0.03, but without load_inertia"):
        from_lumped(drive.parameters, load_torque=2e3, load_inertia=0.0)


def test_completing_with_inertias_in_place_of_frequencies() -> None:
    parameters = Drive.preset("hoist").parameters
    physical = from_lumped(parameters, feedback_arm_inertia=2e-6, swash_inertia=0.02)
    n = physical.numbers
    assert (n["feedback_arm_inertia"], n["swash_inertia"]) == (2e-6, 0.02)
    # ζ = b/(2 √(k m)) in the angle of the plate
    spring = n["return_spring_rate"] * 0.08**2
    inertia = 0.02 + n["piston_mass"] * 0.08**2
    ratio = n["piston_damping"] * 0.08**2 / (2.0 * (spring * inertia) ** 0.5)
    assert ratio == pytest.approx(0.3)
    assert physical["swash_inertia"].status == "user"
    assert from_lumped(parameters, control_arm=0.08 / 0.62542).numbers == pytest.approx(
        from_lumped(parameters).numbers
    )


@pytest.mark.parametrize(
    ("chosen", "sentence"),
    [
        (
            {"spool_mass": 0.0},
            r"hoist: spool_mass \(mass of the spool\) is 0 kg, but must be above",
        ),
        ({"oil_volume": -1e-4}, r"oil_volume .* is -0.0001 m\^3, but must be above 0"),
        ({"bulk_modulus": inf}, "bulk_modulus .* is inf Pa, but must be above 0"),
        ({"spool_mass": 0.1}, "spool_mass on spool_arm alone has 6.331e-06 kg m², but spool_freq"),
        ({"piston_mass": 2.0}, "choose a smaller mass or a lower frequency"),
        ({"control_arm": 0.2}, "control_arm is given as 0.2 m, but 0.127914042 follows from Z3"),
        ({"load_torque": 1e9}, "the load holds a stroker pressure of .* Pa at rest"),
        ({"valve_gain": 1.0}, r"no quantity 'valve_gain' \(did you mean valve_flow_gain\?\)"),
        ({"oil_volume": (1e-4, 2e-4)}, "oil_volume has one value, not a plus and a minus one"),
        ({"oil_volume": "big"}, r"oil_volume must be a number in m\^3"),
    ],
)
def test_contradictions_are_one_sentence(chosen: dict, sentence: str) -> None:
    with pytest.raises(ParameterError, match=sentence):
        from_lumped(Drive.preset("hoist").parameters, **chosen)


def test_lumps_that_no_machine_has() -> None:
    hoist = Drive.preset("hoist")
    with pytest.raises(ParameterError, match="Z2 is 0.01, but a physical set has Z2 = 0"):
        from_lumped(hoist.replace(Z2=0.01).parameters)
    with pytest.raises(ParameterError, match="spool_stroke .* is inf m, but must be above 0"):
        from_lumped(hoist.replace(Z14=inf).parameters)


def test_changes() -> None:
    hoist = PhysicalSet.preset("hoist")
    stops = hoist.replace(swash_stop=0.2)
    assert stops["swash_stop"].value == (0.2, 0.2)
    assert stops["swash_stop"].status == "user"
    small = hoist.scaled(0.01)
    assert small.numbers["swash_inertia"] == pytest.approx(0.01 * hoist.numbers["swash_inertia"])
    assert small.numbers["spool_damping"] == pytest.approx(0.1 * hoist.numbers["spool_damping"])
    assert pickle.loads(pickle.dumps(hoist)) == hoist
    with pytest.raises(ParameterError, match="epsilon is 0, but must be above 0"):
        hoist.scaled(0.0)
    with pytest.raises(ParameterError, match="turn the feedback arm past 90°"):
        hoist.replace(swash_stop=(atan_of_control(hoist) + 0.01, 0.2))
    with pytest.raises(ParameterError, match="no value for spool_arm"):
        PhysicalSet("mine", "", {})


def atan_of_control(physical: PhysicalSet) -> float:
    """Angle at which the feedback arm lies at 90°: tan α = control_arm/swash_arm."""
    from math import atan

    angle = atan(physical.numbers["control_arm"] / physical.numbers["swash_arm"])
    assert tan(angle) > 1.0
    return angle


def test_files(tmp_path: Path) -> None:
    slew = PhysicalSet.preset("slew")
    slew.to_toml(tmp_path / "slew.toml")
    again = PhysicalSet.from_toml(tmp_path / "slew.toml")
    assert again == slew
    text = (tmp_path / "slew.toml").read_text("utf-8")
    own = tmp_path / "own.toml"
    for old, new, sentence in (
        ("spool_mass =", "spool_mas =", "own.toml: A physical set has no quantity 'spool_mas'"),
        ('unit = "kg"', 'unit = "Pa"', "own.toml: .* is given in 'Pa', which does not measure"),
        ("oil_volume = {value = 0.0002", "oil_volume = {value = -1.0", "but must be above 0"),
        (
            'status = "assumed"}',
            'status = "assumed", bounds = [0, 1]}',
            "spool_arm has bounds; leave them out",
        ),
        ("piston_mass =", "spool_frequency =", "chosen only where a set is completed"),
        ("air_fraction = {value = 0.0", "air_fraction = {value = 1.5", "at least 0 and below 1"),
    ):
        assert old in text
        own.write_text(text.replace(old, new, 1), "utf-8")
        with pytest.raises(ParameterError, match=sentence):
            PhysicalSet.from_toml(own)
    with pytest.raises(FileError, match="There is no file"):
        PhysicalSet.from_toml(tmp_path / "none.toml")
    with pytest.raises(ParameterError, match="no packaged physical set 'winch'; there are hoist"):
        PhysicalSet.preset("winch")
    own.write_text(
        'name = "mine"\nlumps = "hoist"\n[physical]\noil_volume = { value = 0.1, unit = "l" }\n',
        "utf-8",
    )
    mine = PhysicalSet.from_toml(own)
    assert mine.numbers["oil_volume"] == pytest.approx(1e-4)
    check_lumps(mine, Drive.preset("hoist"))
