"""Commands that analyse a drive print and write what the functions behind them find."""

import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from swashplate import Drive, analysis, maneuvers
from swashplate.analysis import performance, with_factors

FULL_ORDER = Path(__file__).parents[2] / "docs" / "full-order.md"


def cells(text: str, row: str) -> list[str]:
    """The words of a table's row, by the words that it begins with."""
    (line,) = [line for line in text.splitlines() if line.startswith(row + "  ")]
    return line.removeprefix(row).split()


# --- limits and changes ---------------------------------------------------------------------------


def test_the_envelope(done, number):
    text = done("limits", "hoist")
    assert [number(text, "speed limit", k) for k in range(2)] == pytest.approx(
        [196, -185], abs=0.05
    )
    assert number(text, "Creep at rest") == pytest.approx(3.09, abs=0.005)
    assert "Top speed" in done("limits", "hoist", "--set", "Z17=5")  # which does not move


def test_what_to_change_first(done, number):
    text = done("limits", "luff", "sine:9,0.1")
    assert "luff, sine 9 V 0.1 Hz: 55.889 deg/s rms from a drive without limits" in text
    rows = [line.split("  ")[0] for line in text.splitlines()]
    assert rows.index("orifice") < rows.index("delay") < rows.index("dead zone")
    assert number(text, "orifice") == pytest.approx(69.5)
    assert "spool stop" not in rows  # it does nothing here
    assert "Change first: in-line orifice: larger bore (Z16)." in text


@pytest.mark.slow
def test_figure_9_1(done, number, tmp_path):
    both = ("--scale", "orifice=1.5", "--scale", "pump=1.5", "--maneuver", "sine:9,0.1")
    text = done("whatif", "hoist", *both, "--plot", "w.png", "--out", "larger.toml")
    assert "hoist, sine 9 V 0.1 Hz" in text
    assert "Z10 (swash plate angle to shaft speed): 12.396 -> 18.594 1/s" in text
    limits = [number(text, "top speed, positive", k) for k in range(2)]
    limits.append(number(text, "top speed, negative", 1))
    assert limits == pytest.approx([196.0, 294.0, -277.5], abs=0.05)
    assert "+50.0 %" in text
    assert (tmp_path / "w.png").read_bytes().startswith(b"\x89PNG")
    assert Drive.from_toml(tmp_path / "larger.toml")["Z10"].value == pytest.approx(18.594)
    text = done("whatif", "--variables")
    for word in ("orifice _plus _minus", "drive_speed", "rate_limit_down", "Z16 by its square"):
        assert word in text


@pytest.mark.slow
def test_bands(done, tmp_path, monkeypatch):
    pumps = 12.396 + 0.12396 * np.random.default_rng(0).normal(size=50)
    hoist = Drive.preset("hoist")
    drawn = analysis.Draws(tuple(hoist.replace(Z10=each) for each in pumps), 0)
    monkeypatch.setattr(analysis, "stored_draws", lambda *_, **__: drawn)
    words = ("--uncertainty", "fitted", "--plot", "w.svg")
    text = done("whatif", "hoist", "--scale", "pump=1.5", "--maneuver", "step:9", *words)
    _, before, _, after, *_ = final = cells(text, "final speed")
    # one per cent of 196 deg/s, about twice that each way
    assert float(before) == pytest.approx(3.8, abs=1.2)
    assert float(after) == pytest.approx(1.5 * float(before), abs=0.02)
    assert cells(text, "top speed, positive")[:4] == final[:4]  # 9 V reaches the stop
    assert "half of the interval that contains 95 % of the drives" in text
    assert "Band of 50 drives, changed: at most" in text
    assert (tmp_path / "w.svg").exists()


@pytest.mark.slow
@pytest.mark.parametrize("levers", [("orifice",), ("orifice", "pump")])
def test_the_change_that_is_proposed_is_enough(done, number, tmp_path, levers):
    words = [word for lever in levers for word in ("--variable", lever)]
    text = done("size", "hoist", "--acceleration-deg-s2", "220", *words, "--out", "larger.toml")
    given = dict(re.findall(r"--scale (\w+)=([\d.]+)", text))
    assert set(given) == set(levers)
    changed = with_factors(
        Drive.preset("hoist"), {name: float(each) for name, each in given.items()}
    )
    assert np.degrees(performance(changed).acceleration) >= 220.0
    assert [*cells(text, "acceleration")[:2]] == [">=", "220.00"]
    assert number(text, "orifice") == pytest.approx(float(given["orifice"]), rel=1e-3)
    written = Drive.from_toml(tmp_path / "larger.toml")
    assert written["Z16"].value == pytest.approx(changed["Z16"].value)


def test_one_at_a_time(done, tmp_path):
    few = (
        "--variable",
        "pump",
        "--variable",
        "orifice=0.8/1.5",
        "--maneuver",
        "step:9,stop=4,length=5",
    )
    words = ("--outcome", "final_speed", "--plot", "t.png", "--out", "s.csv")
    text = done("sensitivity", "hoist", *few, *words)
    assert "final speed, 196.00 deg/s as it is" in text
    assert cells(text, "pump") == ["0.9", "1.1", "176.40", "215.60", "20.0", "%"]
    assert "not changed by orifice" in text
    assert (tmp_path / "t.png").read_bytes().startswith(b"\x89PNG")
    table = pl.read_csv(tmp_path / "s.csv")
    assert table["design variable"].to_list() == ["pump", "orifice"]
    assert table["upper factor"].to_list() == [1.1, 1.5]
    assert table["at upper factor"][0] == pytest.approx(1.1 * table["as it is"][0], rel=1e-6)


def test_the_map_that_is_printed(done):
    text = done("compensate", "hoist", "--speed-deg-s", "97.75", "--speed-deg-s", "-22.16")
    lines = (line.split() for line in text.splitlines())
    rows = {cells[0]: cells[1] for cells in lines if len(cells) in (2, 3)}
    # the static table: 97.75 deg/s at 4 V, -22.16 at -1 V
    expected = {"97.75": 4.0, "-22.16": -1.0, "195.997": 7.87, "-184.996": -7.41}
    assert {k: float(rows[k]) for k in expected} == pytest.approx(expected, abs=0.005)
    assert "11 of 203 points shown" in text  # five of 101 each way, and 0 V
    assert "points shown" not in done("compensate", "hoist", "--points", "5")


# --- other models of a drive ----------------------------------------------------------------------


def test_a_linear_model_and_its_notes(done, number):
    text = done("linearize", "hoist", "--at", "4")
    hoist = Drive.preset("hoist")
    slope = np.degrees(hoist.steady_speed(4.001) - hoist.steady_speed(3.999)) / 0.002
    expected = {"current": 0.4754, "shaft speed": 97.75, "steady gain": slope}
    expected |= {"delay of the card": 14.0, "phase at 0.3 Hz": -17.3}
    for row, value in expected.items():
        assert number(text, row) == pytest.approx(value, rel=4e-3)
    # ω = 56.253 rad/s, ζ = 0.71887: ζω and ω√(1 - ζ²)
    (line,) = [line for line in text.splitlines() if "±" in line]
    assert line.split() == ["rad/s", "-40.439", "±39.104", "8.953", "0.719"]
    assert number(text, "gain at 0.3 Hz") < number(text, "steady gain")
    left_out = "Coulomb term C is left out: it acts only on motions below 0.01 A/s"
    assert left_out in done("linearize", "slew", "--at", "2")
    text = done("linearize", "neutral", "--at", "0", "--set", "G1=0.03")
    assert "One-sided at the card at 0 V: the side of positive voltage." in text
    assert ": 0.015/0.015 -> 0.03/0.03 A/V" in text


def test_gain_and_phase_at_0_3_hz(done):
    text = done("bode", "hoist", "--points", "5", "--out", "a.csv", "--plot", "a.png")
    assert "Gain, phase and distortion, in SI: a.csv\nFigure: a.png" in text
    assert "hoist, sines about 0 V: 6 frequencies from 0.02 to 5 Hz" in text
    rows = [line.split() for line in text.partition("─\n")[2].split("\n\n")[0].splitlines()]
    assert [row[0] for row in rows] == ["1", "4", "6.5", "9"]
    assert "No motion under 1 V at 5 Hz.\n" in text
    phases = [float(row[2]) for row in rows]
    assert phases == sorted(phases, reverse=True)
    assert phases[-1] < -50.0 < -20.0 < phases[0]
    for row in rows:  # 0.3 Hz: 108 degrees a second
        assert float(row[3]) == pytest.approx(-float(row[2]) / 108.0 * 1e3, abs=0.6)


def test_five_states_over_a_run(done, number, tmp_path):
    text = done("full-order", "hoist", "step:9", "--out", "run.parquet", "--plot", "run.png")
    assert text.startswith("hoist, step 9 V, five states versus one: 5121 samples at 512 Hz\n")
    said = " ".join(text.split())
    assert "16 of 16 physical values are assumed, as of the packaged hoist" in said
    assert cells(text, "oil_volume") == ["200", "cm³", "assumed"]
    # Z10 Z13; docs/full-order.md: 0.26 % and 0.12 %
    assert number(text, "step 9 V") == round(float(np.degrees(12.396 * 0.27596)), 2)
    assert cells(text, "step 9 V")[1:] == ["0.26", "0.12", "yes"]
    assert "One state is enough, to 1 % of the top speed." in text
    table = pl.read_parquet(tmp_path / "run.parquet")
    difference = table["reduced_shaft_speed"] - table["shaft_speed"]
    top, largest = map(float, cells(text, "step 9 V")[:2])
    assert np.degrees(difference.abs().max()) == pytest.approx(top * largest / 100.0, rel=0.02)
    assert (tmp_path / "run.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_five_states_over_the_documented_maneuvers(done):
    text = done("full-order", "luff", "--out", "table.csv")
    documented = re.findall(r"^\| luff \| (.*?) \|$", FULL_ORDER.read_text("utf-8"), re.MULTILINE)
    rows = [[cell.strip() for cell in row.split("|")] for row in documented]
    rows = [row for row in rows if re.match("step|ramp|sine", row[0])]
    assert len(rows) == pl.read_csv("table.csv").height == 11
    for maneuver, *numbers, within in rows:
        found = cells(text, maneuver)
        assert [*map(float, found[1:3])] == pytest.approx([*map(float, numbers)], abs=0.011)
        assert " ".join(found[3:]) == within
    said = "One state is enough for 10 of 11, to 1 %; not for sine 6.5 V 3 Hz."
    assert said in " ".join(text.split())


def test_five_states_of_a_drive_of_one_s_own(done, tmp_path):
    drive = Drive.preset("slew").scale(Z8=1.2, Z10=0.9).replace(spool_friction=1.0)
    drive.renamed("mine").to_toml(tmp_path / "mine.toml")
    text = done("full-order", "mine.toml", "step:4", "--like", "slew", "--set", "Z15=5e6")
    lines = text.splitlines()
    assert lines[0].startswith("mine, step 4 V, five states")
    assert lines[1].startswith("Z15 (")
    assert lines[2] == "Neither model has refinements; these are left out: spool_friction."
    assert cells(text, "spool_mass") == ["10", "g", "assumed"]
    text = done("full-order", "hoist", "rest:2", "--set", "Z18=0")
    assert "The shaft does not move, so the one-state model cannot be assessed" in text


# --- files ----------------------------------------------------------------------------------------


def test_numbers_are_those_of_the_functions(done, tmp_path):
    slew = Drive.preset("slew")
    done("compare", "hoist", "slew", "--rate", "100", "--out", "both.csv")
    exact = slew.at_every_rate()  # its filter is a recursion for 512 Hz
    expected = exact.simulate(maneuvers.step(9.0).sample(100.0), 100.0)
    np.testing.assert_array_equal(pl.read_csv("both.csv")["shaft_speed slew"], expected.shaft_speed)
    done("compensate", "luff", "--out", "luff.toml", "--points", "21")
    plus = tomllib.loads((tmp_path / "luff.toml").read_text("utf-8"))["plus"]
    assert len(plus["speed"]) == 21
    steady = Drive.preset("luff").steady_speed(plus["voltage"])
    np.testing.assert_allclose(steady, plus["speed"], rtol=1e-9)
    done("linearize", "slew", "--at", "2", "--sample-time", "0.01", "--out", "slew.toml")
    written = tomllib.loads((tmp_path / "slew.toml").read_text("utf-8"))
    np.testing.assert_array_equal(written["A"], slew.linearize(2.0).discrete(100.0).A)


@pytest.mark.parametrize(
    "command",
    [
        ("simulate", "short.toml", "step:9"),
        ("size", "short.toml", "--speed-deg-s", "200"),
        ("whatif", "short.toml", "--scale", "pump=1.1", "--maneuver", "step:9"),
        ("export", "short.toml", "--c", "c"),
    ],
    ids=lambda words: words[0],
)
def test_what_no_test_reached_is_called_extrapolated(done, tmp_path, command):
    """A swash stop that lies at the end of the tests or beyond decides the speed at 9 V."""
    parameters = replace(Drive.preset("hoist").parameters, unreached={"Z13_plus": 0.2})
    Drive(parameters).to_toml(tmp_path / "short.toml")
    printed = " ".join(done(*command).split())
    assert "No test of this drive reached Z13_plus" in printed
    # who gives the number knows it
    if command[0] != "whatif":
        given = " ".join(
            done(*command[:2], "--force", "--set", "Z13_plus=0.27", *command[2:]).split()
        )
        assert "No test" not in given
