"""Parameter sets: change, rules, files."""

import copy
import pickle
from math import inf, nan, pi
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate import Drive, FileError, Pair, ParameterError
from swashplate.parameters import CATALOGUE, REFINEMENTS, dump_set, preset_names, read_set


def test_presets() -> None:
    assert preset_names() == ("hoist", "slew", "luff", "neutral")
    with pytest.raises(ParameterError, match="hoist, slew, luff, neutral"):
        Drive.preset("crane")


def test_a_parameter_knows_where_it_comes_from(hoist: Drive) -> None:
    Z16 = hoist["Z16"]
    assert Z16.value == Pair(plus=1.1634e-4, minus=1.5126e-4)
    assert (Z16.unit, Z16.source, Z16.status) == ("m", "table 7.2", "fitted")
    assert Z16.name == "opening at which the orifice limits the flow"
    assert Z16.definition.range == "above 0, or inf for none"
    assert Z16.own_bounds is None


def test_replace_and_scale(hoist: Drive) -> None:
    changed = hoist.replace(Z16=1.2e-4, Z13_minus=0.2, V_dz=(0.1, 0.2), Z10=13.0)
    assert changed["Z16"].value == Pair(1.2e-4, 1.2e-4)
    assert changed["Z13"].value == Pair(0.27596, 0.2)
    assert changed["V_dz"].value == Pair(0.1, 0.2)
    assert changed["Z10"].value == 13.0
    assert changed["Z16"].status == "user"
    assert changed["Z1"].status == "fitted"
    assert hoist["Z10"].value == 12.396  # the drive itself never changes
    scaled = hoist.scale(Z16=1.5, Z10=2.0, J=(1.0, 0.5), Z19_plus=1.1)
    assert scaled["Z16"].value == Pair(1.5 * 1.1634e-4, 1.5 * 1.5126e-4)
    assert scaled["Z10"].value == 24.792
    assert scaled["J"].value == Pair(0.27473, 0.5 * 0.2951)
    assert scaled["Z19"].value == Pair(1.1 * 12.349, 10.019)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"Z99": 1.0}, r"'Z99' .*Z22"),
        ({"Z_16": 1.0}, r"mean Z16"),
        ({"Z10": (1.0, 2.0)}, "Z10 .* one value"),
        ({"Z16_plus": (1.0, 2.0)}, "Z16_plus .* one value"),
        ({"Z16": (1.0, 2.0, 3.0)}, "Z16 .* one value or two"),
        ({"Z16": "0.18mm"}, "Z16 .* in m, .* '0.18mm'"),
        ({"Z13_minus": -0.26}, r"Z13_minus .* -0.26 rad, .* above 0 .*magnitudes"),
        ({"Z13": pi / 2}, "Z13_plus .* 1.5708"),
        ({"Z13_plus": 1.2}, r"Z3·tan Z13_plus .* 1.609, .* 1"),
        ({"Z19_plus": 120.0}, r"Z5·F/√Z4 .* 10 V \(plus\), .* 1"),
        ({"Z4": 1e-4}, r"Z5·F/√Z4"),
        ({"G3_plus": -0.01}, "current of the plus channel"),
        ({"Z2": 10.0}, "Z2/Z1"),
        ({"Z1": 0.0}, "Z1 .* 0 1/Pa, .* above 0"),
        ({"Z1": nan}, "Z1 .* nan .* above 0"),
        ({"Z1": inf}, "Z1 .* inf .* above 0"),
        ({"Z14": -inf}, "Z14 .*-inf.* inf for none"),
        ({"tau": -0.01}, "tau .*-0.01 s.* at least 0"),
        ({"tau": 10.0}, "tau .* below 10"),
        # refinements
        ({"spool_friction": -0.1}, r"spool_friction .* -0.1 N, .* at least 0"),
        ({"spool_friction": (0.1, 0.2)}, "spool_friction .* one value"),
        ({"dither_time": 0.0}, "dither_time .* above 0, or inf for none"),
        ({"spool_friction": 0.1, "dither_time": 0.6}, "spool_presliding .* 0.* travel"),
        ({"line_stiffness": 1e6}, "line_stiffness .* 1e.06 N m/rad, .* load_inertia .* 0"),
        ({"cam_ripple": 1.0}, "cam_ripple .* at least 0 and below 1"),
        (
            {"cam_ripple": 0.5, "cam_ripple_per_torque": 1e-5, "load_torque": -6e4},
            r"cam_ripple \+ cam_ripple_per_torque·\|load_torque\| .* 1.1, .* below 1",
        ),
        ({"spool_frction": 0.1}, "mean spool_friction"),
    ],
)
def test_broken_rules_are_sentences(hoist: Drive, changes: dict, sentence: str) -> None:
    with pytest.raises(ParameterError, match=sentence) as caught:
        hoist.replace(**changes)
    assert "\n" not in str(caught.value)


def test_limits_can_be_off(hoist: Drive) -> None:
    off = hoist.replace(lim1=inf, lim2=inf, I_t1=inf, I_t2=0.0, Z14=inf, Z15=inf, Z16=inf, a=inf)
    assert off.simulate([0.0, 5.0, 5.0]).shaft_speed.shape == (3,)


@pytest.mark.parametrize("name", ["hoist", "slew", "luff", "neutral"])
def test_toml_gives_an_equal_drive_back(name: str, tmp_path: Path) -> None:
    drive = Drive.preset(name)
    drive.to_toml(tmp_path / "set.toml")
    assert Drive.from_toml(tmp_path / "set.toml") == drive


@pytest.mark.slow
@given(st.floats(1e-8, 0.1), st.floats(1e-8, 0.1))
def test_toml_keeps_every_bit(plus: float, minus: float) -> None:

    drive = Drive.preset("hoist").replace(Z16=(plus, minus))
    assert read_set(dump_set(drive.parameters), "text")["Z16"].value == Pair(plus, minus)


def test_drives_can_be_copied_compared_and_hashed(hoist: Drive) -> None:
    for same in (pickle.loads(pickle.dumps(hoist)), copy.deepcopy(hoist), Drive.preset("hoist")):
        assert same == hoist
        assert hash(same) == hash(hoist)
    assert hoist.replace(Z10=13.0) != hoist
    with pytest.raises(TypeError):
        hoist.parameters.numbers["Z1"] = 1.0


HOIST = """
format = 1
name = "mine"
control_card = "rexroth_mdsd_1k_2x_2"

[pump_motor]
"""
REFINED = "[refinements]\n"


@pytest.fixture
def lines() -> dict[str, str]:
    """The hoist's pump and motor, a line a parameter."""

    text = dump_set(Drive.preset("hoist").parameters).split("[pump_motor]\n")[1]
    return {line.split(" = ")[0]: line for line in text.strip().splitlines()}


def load(lines: dict[str, str], tmp_path: Path, head: str = HOIST) -> Drive:
    path = tmp_path / "mine.toml"
    path.write_text(head + "\n".join(lines.values()), "utf-8")
    return Drive.from_toml(path)


def test_users_units_are_converted(lines: dict[str, str], tmp_path: Path) -> None:
    lines["Z13"] = 'Z13 = { value = [15.0, 14.0], unit = "deg" }'
    lines["Z9"] = 'Z9 = { value = 107.43, unit = "bar", bounds = [50.0, 200.0] }'
    lines["Z16"] = 'Z16 = { value = 0.12, unit = "mm" }'
    drive = load(lines, tmp_path)
    assert drive["Z13"].value.plus == pytest.approx(0.2617993877991494, rel=1e-15)
    assert drive["Z9"].value == pytest.approx(1.0743e7, rel=1e-15)
    assert drive["Z9"].own_bounds == pytest.approx((5e6, 2e7))
    assert drive["Z16"].value == pytest.approx((1.2e-4, 1.2e-4))


@pytest.mark.parametrize(
    ("symbol", "line", "sentence"),
    [
        ("Z13", 'Z13 = { value = 1.0, unit = "m" }', r"mine.toml: Z13 .* 'm', .* same as rad"),
        ("Z13", 'Z13 = { value = 1.0, unit = "wheel" }', "Z13.*unit 'wheel'"),
        ("Z13", 'Z13 = { value = 1.0, unit = "3 **" }', "Z13.*unit '3"),
        ("Z13", "Z13 = { value = 0.2 }", r"\[pump_motor.Z13\] .* 'unit'"),
        ("Z13", 'Z13 = { value = "x", unit = "rad" }', r"pump_motor.Z13.value"),
        ("Z13", 'Z13 = { value = [0.2, 0.2, 0.2], unit = "rad" }', r"pump_motor.Z13.value"),
        ("Z1", 'Z1 = { value = [1e-7, 1e-7], unit = "1/Pa" }', "Z1 .* one value"),
        ("Z13", "", "value for Z13"),
        ("Z23", 'Z23 = { value = 1.0, unit = "1" }', "parameter 'Z23'"),
        ("tau", 'tau = { value = 1.0, unit = "s" }', r"\[pump_motor\] .* 'tau'"),
        (
            "Z1",
            'Z1 = { value = 1e-7, unit = "1/Pa", sauce = "" }',
            "'sauce'.* 'source'",
        ),
        ("Z1", 'Z1 = { value = 1e-7, unit = "1/Pa", status = "good" }', "pump_motor.Z1.status"),
        ("Z9", 'Z9 = { value = 1e7, unit = "Pa", bounds = [1e6, 2e6] }', "Z9.* bounds"),
        ("Z1", "Z1 = = 3", "TOML"),
        # a table behind the pump's
        ("", REFINED + 'Z1 = { value = 1.0, unit = "1/Pa" }', r"\[refinements\] .* 'Z1'"),
        ("", REFINED + 'spool_friction = { value = 1.0, unit = "m" }', "spool_friction"),
        (
            "",
            REFINED + 'spool_friction = { value = [0.1, 0.2], unit = "N" }',
            "spool_friction .* one value",
        ),
        ("", REFINED + 'friction = { value = 1.0, unit = "N" }', "parameter 'friction'"),
    ],
)
def test_files_with_errors(
    lines: dict[str, str], tmp_path: Path, symbol: str, line: str, sentence: str
) -> None:
    lines[symbol] = line
    with pytest.raises((ParameterError, FileError), match=sentence) as caught:
        load(lines, tmp_path)
    assert "mine" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_file_and_card(lines: dict[str, str], tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"nothing\.toml"):
        Drive.from_toml(tmp_path / "nothing.toml")
    with pytest.raises(FileError, match="drive.toml in .*: give a folder"):
        Drive.from_toml(tmp_path)
    with pytest.raises(ParameterError, match="rexroth_mdsd_1k_2x_4"):
        load(lines, tmp_path, HOIST.replace("2x_2", "9x_9"))


def test_neutral_set_is_a_straight_line_with_one_lag() -> None:
    """Unit gain each way; the step answer is 1 - exp(-t/T), T = 208333 s/Z8.

    Straight are the tangents of the plate's angle, 0.01 a volt: the speed is 100 of its angles.
    """

    neutral = Drive.preset("neutral").replace(Z8=1e6 / 4.8 / 0.3)
    volts = np.array([-10.0, 0.0, 0.1, 7.0])
    expected = 100.0 * np.arctan(0.01 * volts)
    np.testing.assert_allclose(neutral.steady_speed(volts), expected, rtol=1e-6)
    np.testing.assert_allclose(expected, volts, rtol=4e-3)
    voltage = np.full(1024, 2.0)
    t = np.arange(1024) / 512.0
    ideal = 2.0 * (1.0 - np.exp(-t / 0.3))
    speed = neutral.simulate(voltage).shaft_speed
    assert np.abs(speed - ideal).max() < 0.04  # two samples of the current filter


def test_a_limit_that_no_test_reached_must_be_a_parameter(tmp_path: Path) -> None:
    path = tmp_path / "drive.toml"
    Drive.preset("neutral").to_toml(path)
    text = path.read_text("utf-8")
    path.write_text(text.replace("[model]", "[model]\nunreached = { Z99_plus = 0.1 }"), "utf-8")
    with pytest.raises(ParameterError, match="Z99_plus"):
        Drive.from_toml(path)


# --- numbers that can be meant --------------------------------------------------------------------


WRONG_UNIT = [
    ({"Z9": 107.0}, r"Z9 .* 107 Pa, .* 10000 to 1e\+09 Pa: .* bar .* Pa"),
    ({"Z16": 0.12}, r"Z16_plus .* 0\.12 m, .* 1e-08 to 0\.1 m: .* mm .* m"),
    ({"Z16_minus": 0.15}, r"Z16_minus .* 0\.15 m, .* mm .* m"),
    ({"Z13": 15.8}, r"Z13_plus .* 15\.8 rad, .* deg .* rad"),
    ({"J": 275.0}, r"J_plus .* 275 A, .* 100 A: .* mA .* A"),
    ({"Z1": 0.046}, r"Z1 .* 0\.046 1/Pa, .* 1/bar .* 1/Pa"),
    ({"tau": 14.0}, r"tau .* 14 s, .* 10 s: .* ms .* s"),
    ({"cam_ripple": 3.0}, r"cam_ripple .* 3, .* 1: .* per cent"),
    ({"motor_leakage": 3.19}, r"motor_leakage .* 3\.19 rad/\(s N m\), .* 1 rad/\(s N"),
    ({"load_torque": -1e300}, r"load_torque .* -1e\+300 N m, .* 1e\+10 N m"),
    ({"Z10": 1e-300}, r"Z10 .* 1e-300 1/s, .* 1e-06 to 1e\+06 1/s"),
]
"""Numbers in a unit that people write, or in none: value, unit, range and likely slip are named."""


@pytest.mark.parametrize(("changes", "sentence"), WRONG_UNIT)
def test_a_number_that_can_hardly_be_meant_is_refused(
    hoist: Drive, lines: dict[str, str], tmp_path: Path, changes: dict, sentence: str
) -> None:
    """In Python, as a factor, and in a file; what a search leads to is not judged."""
    ((name, value),) = changes.items()
    with pytest.raises(ParameterError, match=sentence):
        hoist.replace(**changes)
    number = hoist.parameters.numbers.get(f"{name}_plus", hoist.parameters.numbers.get(name))
    if number:
        with pytest.raises(ParameterError, match=name):
            hoist.scale(**{name: value / number})
    if name in lines:
        lines[name] = f'{name} = {{ value = {value}, unit = "{hoist[name].unit}" }}'
        with pytest.raises(ParameterError, match=rf"mine\.toml: {sentence}"):
            load(lines, tmp_path)


def test_a_bound_that_can_hardly_be_meant_is_refused(lines: dict[str, str], tmp_path: Path) -> None:
    lines["Z9"] = 'Z9 = { value = 1e7, unit = "Pa", bounds = [50.0, 2e7] }'
    with pytest.raises(ParameterError, match=r"mine\.toml: .*bound of Z9 .* 50 Pa, .* bar"):
        load(lines, tmp_path)


def test_a_search_may_go_where_nobody_would_write_a_number(hoist: Drive) -> None:
    gone = hoist.parameters.with_numbers({"Z16_plus": 1e300, "motor_leakage": 3.19})
    assert gone.numbers["Z16_plus"] == 1e300
    assert gone.refinements == ("motor_leakage",)


def test_every_number_of_every_packaged_set_is_decades_within_its_range() -> None:
    """And every parameter has a range; that of Z13 is geometry."""
    ranges = {each.symbol: each.plausible for each in (CATALOGUE | REFINEMENTS).values()}
    assert None not in ranges.values()
    for name in preset_names():
        for parameter in Drive.preset(name).parameters.values():
            low, high = ranges[parameter.symbol]
            for value in map(abs, parameter.values):
                if value not in (0.0, inf) and parameter.symbol != "Z13":
                    assert 100.0 * low <= value <= high / 20.0, (name, parameter.symbol)
