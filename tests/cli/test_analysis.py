import re
import tomllib

import numpy as np
import polars as pl
import pytest

from swashplate import Drive, maneuvers
from swashplate.analysis import monte_carlo, performance, pulled

# --- bode -----------------------------------------------------------------------------------------


def rows(text: str) -> dict[str, list[str]]:
    """The table's rows by amplitude."""
    body = text.partition("─\n")[2].strip("\n").split("\n\n")[0]
    return {line.split()[0]: line.split()[1:] for line in body.splitlines()}


def test_gain_and_phase_at_0_3_hz(done):
    text = done("bode", "hoist", "--points", "5")
    assert "hoist, sines about 0 V: 6 frequencies from 0.02 to 5 Hz" in text
    assert "At 0.3 Hz:" in text
    table = rows(text)
    assert list(table) == ["1", "4", "6.5", "9"]
    phases = [float(row[1]) for row in table.values()]
    assert phases == sorted(phases, reverse=True)
    assert phases[-1] < -50.0 < -20.0 < phases[0]
    for row in table.values():
        # 0.3 Hz: 108 degrees a second
        assert float(row[2]) == pytest.approx(-float(row[1]) / 108.0 * 1e3, abs=0.6)


# --- compare --------------------------------------------------------------------------------------


def test_two_axes(done, number):
    text = done("compare", "hoist", "neutral")
    assert "hoist and neutral, step 9 V" in text
    assert number(text, "peak speed") == number(text, "final speed") == 196.00
    assert number(text, "peak speed", 1) == pytest.approx(
        np.degrees(100.0 * np.arctan(0.09)), abs=0.02
    )
    # the neutral drive: a lag of 0.1 s and the card's two milliseconds twice
    lag = 0.1 * np.log(10.0) + 2.0 / 512.0
    assert number(text, "response time", 1) == pytest.approx(lag, abs=3e-3)


# --- compensate -----------------------------------------------------------------------------------


def test_the_map_that_is_printed(done):
    text = done("compensate", "hoist", "--speed-deg-s", "97.75", "--speed-deg-s", "-22.16")
    assert "hoist: voltage for a wanted speed" in text
    rows = dict(pair for line in text.splitlines() if len(pair := line.split()) == 2)
    # the static table: 97.75 deg/s at 4 V, -22.16 at -1 V
    assert float(rows["97.75"]) == pytest.approx(4.0, abs=5e-4)
    assert float(rows["-22.16"]) == pytest.approx(-1.0, abs=5e-4)
    assert float(rows["195.997"]) == pytest.approx(7.87, abs=0.005)
    assert float(rows["-184.996"]) == pytest.approx(-7.41, abs=0.005)
    assert "11 of 203 points shown" in text  # five of 101 each way, and 0 V
    assert "points shown" not in done("compensate", "hoist", "--points", "5")


# --- limits ---------------------------------------------------------------------------------------


def test_the_envelope_that_is_printed(done, number):
    """The numbers of the model description."""
    text = done("limits", "hoist")
    assert "hoist: what it can do" in text
    for place, (volts, speed, acceleration) in enumerate(
        ((7.87, 196.0, 136.8), (-7.41, -185.0, -177.8))
    ):
        assert number(text, "saturation voltage", place) == volts
        assert number(text, "speed limit", place) == pytest.approx(speed, abs=0.05)
        assert number(text, "acceleration at rest", place) == pytest.approx(acceleration, abs=0.05)
    assert number(text, "creep at 0 V") == pytest.approx(3.09, abs=0.005)


def test_what_to_change_first(done, number):
    text = done("limits", "luff", "sine:9,0.1")
    assert "luff, sine 9 V 0.1 Hz: 55.889 deg/s rms from a drive without limits" in text
    rows = [line.split("  ")[0] for line in text.splitlines()]
    assert rows.index("orifice") < rows.index("delay") < rows.index("dead zone")
    assert number(text, "orifice") == pytest.approx(69.5)
    assert "spool stop" not in rows  # it does nothing here
    assert "Change first: in-line orifice: larger bore (Z16)." in text
    assert "falls by 96.6 %" in " ".join(text.split())


def test_a_drive_that_does_not_move_still_has_an_envelope(done):
    text = done("limits", "hoist", "--set", "Z17=5")
    assert "gain, mean" in text


# --- linearize ------------------------------------------------------------------------------------


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


def test_notes(done):
    assert "Coulomb term C, which only motions below 0.01 A/s see, is left out" in done(
        "linearize", "slew", "--at", "2"
    )
    text = done("linearize", "neutral", "--at", "0", "--set", "G1=0.03")
    assert "One-sided at the card at 0 V: the side of positive voltage." in text
    assert ": 0.015/0.015 -> 0.03/0.03 A/V" in text


# --- sensitivity ----------------------------------------------------------------------------------


FEW = ("--lever", "pump", "--lever", "orifice=0.8/1.5", "--maneuver", "step:9,stop=4,length=5")


def test_one_at_a_time(done, tmp_path):
    words = ("--outcome", "final_speed", "--plot", "t.png", "--out", "s.csv")
    text = done("sensitivity", "hoist", *FEW, *words)
    assert "final speed, 196.00 deg/s as it is" in text
    (line,) = [line for line in text.splitlines() if line.startswith("pump ")]
    assert line.split() == ["pump", "0.9", "1.1", "176.40", "215.60", "20.0", "%"]
    assert "not moved by orifice" in text
    assert (tmp_path / "t.png").read_bytes().startswith(b"\x89PNG")
    table = pl.read_csv(tmp_path / "s.csv")
    assert table["lever"].to_list() == ["pump", "orifice"]
    assert table["upper factor"].to_list() == [1.1, 1.5]
    assert table["at upper factor"][0] == pytest.approx(1.1 * table["as it is"][0], rel=1e-6)


# --- size -----------------------------------------------------------------------------------------


def test_speed_and_acceleration(done, number, tmp_path):
    words = ("--speed-deg-s", "200", "--acceleration-deg-s2", "200", "--out", "larger.toml")
    text = done("size", "hoist", *words)
    # both go with the pump, the acceleration with the orifice too
    assert number(text, "pump") == pytest.approx(1.2094, abs=2e-3)
    assert number(text, "orifice") == pytest.approx(1.2094, abs=2e-3)
    (line,) = [line for line in text.splitlines() if line.startswith("acceleration")]
    assert line.split()[:3] == ["acceleration", ">=", "200.00"]
    assert "See it over a command: swashplate whatif hoist --scale orifice=1.2" in text
    pump = Drive.from_toml(tmp_path / "larger.toml")["Z10"].value
    assert pump == pytest.approx(12.396 * 1.2094, rel=2e-3)


@pytest.mark.parametrize("levers", [("orifice",), ("orifice", "pump")])
def test_the_command_that_is_proposed_is_enough(done, levers):
    wanted = 220.0
    words = [word for lever in levers for word in ("--lever", lever)]
    text = done("size", "hoist", "--acceleration-deg-s2", f"{wanted:g}", *words)
    given = dict(re.findall(r"--scale (\w+)=([\d.]+)", text))
    assert set(given) == set(levers)
    changed = pulled(Drive.preset("hoist"), {name: float(each) for name, each in given.items()})
    assert np.degrees(performance(changed).acceleration) >= wanted


# --- whatif ---------------------------------------------------------------------------------------


BOTH = ("--scale", "orifice=1.5", "--scale", "pump=1.5")


def test_figure_9_1(done, number, tmp_path):
    words = ("--plot", "w.png", "--out", "larger.toml")
    text = done("whatif", "hoist", *BOTH, "--maneuver", "sine:9,0.1", *words)
    assert "hoist, sine 9 V 0.1 Hz" in text
    assert "Z10 (swash plate angle to shaft speed): 12.396 -> 18.594 1/s" in text
    assert number(text, "speed limit, positive") == 196.00
    assert number(text, "speed limit, positive", 1) == pytest.approx(294.0, abs=0.05)
    assert number(text, "speed limit, negative", 1) == pytest.approx(-277.5, abs=0.05)
    assert "+50.0 %" in text
    assert (tmp_path / "w.png").read_bytes().startswith(b"\x89PNG")
    assert Drive.from_toml(tmp_path / "larger.toml")["Z10"].value == pytest.approx(18.594)


def test_the_levers_are_listed(done):
    text = done("whatif", "--levers")
    for word in ("orifice _plus _minus", "drive_speed", "rate_limit_down", "Z16 by its square"):
        assert word in text


def test_bands(done, tmp_path, monkeypatch):
    pumps = 12.396 + 0.12396 * np.random.default_rng(0).normal(size=50)
    hoist = Drive.preset("hoist")
    drawn = monte_carlo.Draws(tuple(hoist.replace(Z10=each) for each in pumps), 0)
    monkeypatch.setattr(monte_carlo, "stored_draws", lambda *_, **__: drawn)
    words = ("--uncertainty", "fitted", "--plot", "w.svg")
    text = done("whatif", "hoist", "--scale", "pump=1.5", "--maneuver", "step:9", *words)
    (line,) = [line for line in text.splitlines() if line.startswith("final speed")]
    # one per cent of 196 deg/s, about twice that each way
    assert float(line.split()[3]) == pytest.approx(3.8, abs=1.2)
    assert float(line.split()[5]) == pytest.approx(1.5 * float(line.split()[3]), abs=0.02)
    (limit,) = [line for line in text.splitlines() if line.startswith("speed limit, positive")]
    assert limit.split()[3:7] == line.split()[2:6]  # 9 V reaches the stop
    assert "Band of 50 drives, changed: at most" in text
    assert (tmp_path / "w.svg").exists()


# --- files ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("typed", "said", "rows"),
    [
        ("bode slew --amplitude 1 --points 4 --linear-at 3", "Gain, phase and distortion", 5),
        ("compensate luff step:2", "Inverse map", 203),
    ],
)
def test_numbers_and_a_figure(done, tmp_path, typed, said, rows):
    text = done(*typed.split(), "--out", "a.csv", "--plot", "a.png")
    assert f"{said}, in SI: a.csv" in text
    assert "Figure: a.png" in text
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert rows in (None, pl.read_csv("a.csv").height)


def test_numbers_are_those_of_the_functions(done, tmp_path):
    done("compare", "hoist", "slew", "--rate", "100", "--out", "both.csv")
    expected = Drive.preset("slew").simulate(maneuvers.step(9.0).sample(100.0), 100.0)
    np.testing.assert_array_equal(pl.read_csv("both.csv")["shaft_speed slew"], expected.shaft_speed)
    done("limits", "slew", "--out", "slew.parquet")
    row = pl.read_parquet("slew.parquet").row(
        by_predicate=pl.col("quantity") == "speed_limit", named=True
    )
    assert np.degrees(row["plus"]) == pytest.approx(4.242, abs=5e-4)
    done("compensate", "luff", "--out", "luff.toml", "--points", "21")
    plus = tomllib.loads((tmp_path / "luff.toml").read_text("utf-8"))["plus"]
    assert len(plus["speed"]) == 21
    steady = Drive.preset("luff").steady_speed(plus["voltage"])
    np.testing.assert_allclose(steady, plus["speed"], rtol=1e-9)
    done("linearize", "slew", "--at", "2", "--sample-time", "0.01", "--out", "slew.toml")
    written = tomllib.loads((tmp_path / "slew.toml").read_text("utf-8"))
    np.testing.assert_array_equal(
        written["A"], Drive.preset("slew").linearize(2.0).discrete(0.01).A
    )
