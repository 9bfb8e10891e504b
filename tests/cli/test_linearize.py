import json
import tomllib

import numpy as np
import pytest

from swashplate import Drive


def test_what_is_printed(done, number):
    text = done("linearize", "hoist", "--at", "4")
    assert "hoist, small motions of the voltage" in text
    assert number(text, "voltage") == 4.0
    assert number(text, "current") == 0.4754
    assert number(text, "shaft speed") == pytest.approx(97.75, abs=0.01)
    # the slope of the steady speed
    hoist = Drive.preset("hoist")
    slope = np.degrees(hoist.steady_speed(4.001) - hoist.steady_speed(3.999)) / 0.002
    assert number(text, "steady gain") == pytest.approx(slope, abs=2e-3)
    assert number(text, "delay of the card") == 14.0
    # ω = 56.253 rad/s, ζ = 0.71887: ζω and ω√(1 - ζ²)
    (line,) = [line for line in text.splitlines() if "±" in line]
    assert line.split() == ["rad/s", "-40.439", "±39.104", "8.953", "0.719"]
    assert number(text, "gain at 0.3 Hz") < number(text, "steady gain")
    assert number(text, "phase at 0.3 Hz") == pytest.approx(-17.3, abs=0.1)


def test_the_source_s_time_constant(done, number):
    words = ("--current", "0", "--input", "solenoid_force", "--frequency", "0.1")
    text = done("linearize", "luff", *words)
    assert number(text, "time constant of the pump") == 0.2015
    assert "no limit" in text
    assert "gain at 0.1 Hz" in text
    assert "Coulomb" not in text


def test_a_speed_and_a_loop(done, number):
    text = done("linearize", "hoist", "--speed-deg-s", "-50", "--loop-gain", "0.1")
    assert number(text, "shaft speed") == -50.0
    assert number(text, "gain margin") == pytest.approx(
        number(text, "largest proportional gain") / 0.1, rel=2e-3
    )
    assert number(text, "delay margin") > 14.0
    assert (
        number(done("linearize", "hoist", "--at", "4", "--loop-gain", "0.01"), "gain margin") > 20
    )


def test_notes(done):
    assert "The card's Coulomb term C is left out" in done("linearize", "slew", "--at", "2")
    assert "left out" not in done("linearize", "slew", "--at", "2", "--coulomb", "tangent")
    text = done("linearize", "neutral", "--at", "0", "--set", "G1=0.03")
    assert "One-sided at the card at 0 V: the side of positive voltage." in text
    assert ": 0.015/0.015 -> 0.03/0.03 A/V" in text


def test_files(done, tmp_path):
    text = done("linearize", "slew", "--at", "2", "--sample-time", "0.01", "--out", "slew.toml")
    assert "sampled at 0.01 s" in text
    assert "Model, in SI: slew.toml" in text
    read = tomllib.loads((tmp_path / "slew.toml").read_text("utf-8"))
    expected = Drive.preset("slew").linearize(2.0).discrete(0.01)
    np.testing.assert_array_equal(read["A"], expected.A)
    done("linearize", "slew", "--at", "2", "--out", "slew.json")
    assert json.loads((tmp_path / "slew.json").read_text("utf-8"))["delay"] == 0.014


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("hoist",), "give one of --at, --current and --speed-deg-s"),
        (("hoist", "--at", "4", "--current", "0.4"), "give one of --at, --current and"),
        (("hoist", "--current", "1", "--input", "voltage"), "needs --at or --speed-deg-s, not"),
        (
            ("hoist", "--at", "0.1"),
            "lies in the card's dead zone, so the gain is 0; linearise at +0.",
        ),
        (("hoist", "--at", "0.15"), "pump alone with --current 0 --input solenoid_force."),
        (("hoist", "--at", "9"), "at its stop, so the gain is 0"),
        (("hoist", "--at", "11"), "the card takes ±10 V"),
        (("hoist", "--speed-deg-s", "300"), "no constant voltage settles at 300 deg/s"),
        (("hoist", "--at", "4", "--loop-gain", "1"), "the closed loop is unstable"),
        (("hoist", "--at", "4", "--loop-gain", "nan"), "not finite"),
        (("hoist", "--at", "4", "--sample-time", "0"), "must be above 0"),
        (("hoist", "--at", "4", "--frequency", "-1"), "from 0 on"),
        (("hoist", "--at", "4", "--out", "none/model.toml"), "cannot be written"),
        (("hoist", "--at", "4", "--out", "model.mat"), "is written as .toml or .json"),
        (("crane", "--at", "4"), "no packaged set, file or folder 'crane'"),
    ],
)
def test_refusals(refused, words, said):
    assert said in refused("linearize", *words)
