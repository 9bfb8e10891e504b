import numpy as np
import polars as pl
import pytest

from swashplate import Drive, maneuvers


def test_two_axes(done, number):
    text = done("compare", "hoist", "neutral")
    assert "hoist and neutral, step 9 V" in text
    assert number(text, "peak speed, positive") == 196.00
    assert number(text, "peak speed, positive", 1) == pytest.approx(
        np.degrees(100.0 * np.arctan(0.09)), abs=0.02
    )
    assert number(text, "settled speed at 9 V") == 196.00
    # the neutral drive: a lag of 0.1 s and the card's two milliseconds twice
    lag = 0.1 * np.log(10.0) + 2.0 / 512.0
    assert number(text, "time to 90 % of it", 1) == pytest.approx(lag, abs=3e-3)


def test_rms_difference(done):
    text = done("compare", "hoist", "slew", "--maneuver", "sine:6.5,0.1")
    voltage = maneuvers.sine(6.5, 0.1).sample()
    speeds = [Drive.preset(name).simulate(voltage).shaft_speed for name in ("hoist", "slew")]
    rms = np.degrees(np.sqrt(np.mean((speeds[0] - speeds[1]) ** 2)))
    assert f"rms difference of the speeds: {rms:.2f} deg/s" in text


def test_a_speed_never_reached(done):
    text = done("compare", "hoist", "luff", "--maneuver", "step:9,start=1,stop=1.1,length=3")
    (line,) = [line for line in text.splitlines() if line.startswith("time to 90 %")]
    assert line.split()[-3:] == ["never", "never", "s"]


def test_a_set_and_its_change(done, number, tmp_path):
    Drive.preset("hoist").scale(Z10=0.5).to_toml(tmp_path / "mine.toml")
    text = done("compare", "hoist", "mine.toml", "--maneuver", "step -9 V")
    assert "hoist and mine.toml, step -9 V" in text
    assert number(text, "peak speed, negative") == -185.00
    assert number(text, "peak speed, negative", 1) == -92.50


def test_a_set_with_itself(done):
    text = done("compare", "hoist", "hoist")
    assert "hoist and hoist (2), step 9 V" in text
    assert "rms difference of the speeds: 0.00 deg/s" in text


def test_out_and_plot(done, tmp_path):
    done("compare", "hoist", "slew", "--rate", "100", "--out", "both.csv", "--plot", "both.png")
    table = pl.read_csv("both.csv")
    assert table.columns == ["time", "voltage", "shaft_speed hoist", "shaft_speed slew"]
    assert table.height == 1001
    expected = Drive.preset("slew").simulate(maneuvers.step(9.0).sample(100.0), 100.0)
    np.testing.assert_array_equal(table["shaft_speed slew"], expected.shaft_speed)
    assert (tmp_path / "both.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("hoist", "crane"), "no packaged set, file or folder 'crane'"),
        (("hoist", "slew", "--maneuver", "hop:9"), "'hop' is no maneuver"),
        (("hoist", "slew", "--maneuver", "hop"), "one of the tests of hoist"),
        (("hoist", "slew", "--maneuver", "step:11"), "the card takes ±10 V"),
        (("hoist", "slew", "--maneuver", "rest:1e20"), "simulated at once"),
        (("hoist", "slew", "--rate", "1"), "must be between 10 and 100000 Hz"),
    ],
)
def test_refusals(refused, words, said):
    assert said in refused("compare", *words, "--out", "both.csv")
