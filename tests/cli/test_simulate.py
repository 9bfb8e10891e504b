import re

import numpy as np
import polars as pl
import pytest
import scipy.io

from swashplate import Drive, Limit, maneuvers
from swashplate.parameters.definitions import CATALOGUE
from swashplate.parameters.files import preset_names

# --- simulate -------------------------------------------------------------------------------------


def test_a_step_prints_the_known_speeds(done, number):
    text = done("simulate", "hoist", "step:9")
    assert "hoist, step 9 V: 5121 samples at 512 Hz, 10 s" in text
    assert number(text, "peak speed, positive") == 196.00
    assert number(text, "peak speed, negative") == 0.0
    assert number(text, "speed at the end") == 3.09  # the hoist creeps at 0 V
    assert max(map(len, text.splitlines())) <= 80
    assert "\x1b" not in text


def test_the_table_says_what_the_simulation_says(done, number):
    text = done("simulate", "hoist", "sine:9,0.1")
    run = Drive.preset("hoist").simulate(maneuvers.sine(9.0, 0.1).sample())
    travelled = np.degrees(run.shaft_position[-1])
    assert number(text, "peak speed, negative") == pytest.approx(-185.00, abs=0.01)
    assert number(text, "position at the end") == pytest.approx(travelled, abs=0.05)
    assert number(text, "peak current, positive") == pytest.approx(run.current.max(), abs=5e-5)
    assert number(text, "peak current, negative") == pytest.approx(run.current.min(), abs=5e-5)
    stopped = 100.0 * np.mean(run.active(Limit.SWASH_STOP))
    assert number(text, "swash stop") == pytest.approx(stopped, abs=0.05)
    assert "relief         " in text
    assert "never" in text


def test_the_dead_zone_holds_nothing_back_at_rest(done, number):
    still = done("simulate", "hoist", "rest:1")
    assert next(line for line in still.splitlines() if "dead zone" in line).endswith("never")
    moved, judged = done("simulate", "hoist", "step:9"), done("limits", "hoist", "step:9")
    share = number(moved, "dead zone")
    assert share == number(judged, "dead zone")
    run = Drive.preset("hoist").simulate(maneuvers.step(9.0).sample())
    held = run.active(Limit.DEAD_ZONE)
    # half the record is after the step, at 0 V and within the dead zone
    assert share < 1.0 < 100.0 * held.mean()


@pytest.mark.parametrize("name", ["run.csv", "run.parquet"])
def test_out_writes_every_signal(done, tmp_path, name):
    text = done("simulate", "hoist", "step:9", "--out", name, "--plot", "step.png")
    assert "Figure: step.png" in text
    assert (tmp_path / "step.png").read_bytes().startswith(b"\x89PNG")
    assert f"All signals, in SI: {name}" in text
    table = pl.read_csv(name) if name.endswith(".csv") else pl.read_parquet(name)
    expected = Drive.preset("hoist").simulate(maneuvers.step(9.0).sample()).to_polars()
    assert table.columns == expected.columns
    for column in ("time", "voltage", "current", "stroker_pressure", "shaft_position"):
        np.testing.assert_array_equal(table[column], expected[column])


@pytest.mark.parametrize(
    ("words", "changes"),
    [
        (("--set", "Z16=1.2e-4/1.5e-4"), {"Z16": (1.2e-4, 1.5e-4)}),
        (("--set", "Z9=90 bar", "--set", "tau=20ms"), {"Z9": 9e6, "tau": 0.02}),
        (("--set", "Z10=744 1/min"), {"Z10": 12.4}),
        (("--scale", "Z13=0.5/0.25"), {"Z13": (0.5 * 0.27596, 0.25 * 0.26047)}),
        (("--set", "Z10=10", "--scale", "Z10=1.5"), {"Z10": 15.0}),
    ],
)
def test_set_and_scale(done, words, changes):
    done("simulate", "hoist", "sine:9,0.1", *words, "--out", "run.parquet")
    drive = Drive.preset("hoist").replace(**changes)
    expected = drive.simulate(maneuvers.sine(9.0, 0.1).sample())
    speed = pl.read_parquet("run.parquet")["shaft_speed"].to_numpy()
    np.testing.assert_allclose(speed, expected.shaft_speed, rtol=1e-9, atol=1e-12)


def test_a_rod_is_shown_in_millimetres(done, number, tmp_path):
    """A fit to positions in m writes motion = "rod"; angles inside the machine stay angles."""
    text = done("show", "hoist", "--toml").replace("[model]", '[model]\nmotion = "rod"', 1)
    (tmp_path / "boom.toml").write_text(text, "utf-8")
    assert 'motion = "rod"' in done("show", "boom.toml", "--toml")
    (z13,) = [line for line in done("show", "boom.toml").splitlines() if line.startswith("Z13 ")]
    assert z13.split()[-2] == "rad"
    text = done("simulate", "boom.toml", "step:9")
    fastest = 12.396 * 0.27596
    assert number(text, "peak speed, positive") == pytest.approx(1e3 * fastest, abs=0.1)
    assert "mm/s" in text
    assert "turns" not in text
    text = done("simulate", "boom.toml", "step:9", "--units", "m/s")
    assert number(text, "peak speed, positive") == pytest.approx(fastest, abs=0.01)


def test_a_load_that_nothing_feels_is_said(done):
    text = done("simulate", "hoist", "rest:1", "--set", "load_torque=30kN*m")
    assert "! load_torque changes nothing without motor_leakage or motor_constant" in text


# --- records --------------------------------------------------------------------------------------


TIME = np.arange(1025) / 512.0


VOLTAGE = 9.0 * np.sin(TIME)


def simulated(done, *words):
    done("simulate", "hoist", *words, "--out", "run.parquet", "--force")
    return pl.read_parquet("run.parquet")


def as_matlab(path):
    scipy.io.savemat(path, {"time": TIME, "voltage": VOLTAGE})


def as_text(path):
    table = pl.DataFrame({"time": TIME, "voltage": VOLTAGE, "note": "x"})
    comma = path.suffix == ".txt"
    table.write_csv(path, separator=";" if comma else ",", decimal_comma=comma)


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("log.txt", as_text),
        ("log.mat", as_matlab),
    ],
)
def test_a_record_is_simulated(done, tmp_path, name, write):
    write(tmp_path / name)
    written = simulated(done, name, "--interpolation", "linear")
    expected = Drive.preset("hoist").simulate(VOLTAGE)
    np.testing.assert_allclose(written["shaft_speed"], expected.shaft_speed, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time,voltage\n0,1\n1,x\n2,1\n", "'voltage' holds 'x', which is no number, in data row 2"),
        ("time,voltage\n0,1\n2,1\n1,1\n", "'time' goes back from 2.0 to 1.0 in data row 3"),
        ("time,voltage\n0,1\n1,-10.5\n", "-10.5 V at 1 s, but the card takes ±10 V"),
        (
            "t,u\n0,1\n1,1\n",
            "no column 'time'; it has 't', 'u': name the one to take, with --time-",
        ),
        ("time,u\n0,1\n1,1\n", "it has 'time', 'u': name the one to take, with --column."),
    ],
)
def test_a_bad_record_is_refused(refused, tmp_path, text, said):
    (tmp_path / "log.csv").write_text(text)
    words = ("--interpolation", "previous", "--out", "run.csv", "--plot", "run.png")
    sentence = refused("simulate", "hoist", "log.csv", *words)
    assert "log.csv" in sentence
    assert said in sentence


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("none.csv", "There is no file none.csv"),
        ("log.xlsx", "log.xlsx ends in '.xlsx'; a log is read from .csv, .tsv, .txt"),
    ],
)
def test_a_file_that_is_none(refused, tmp_path, name, said):
    (tmp_path / "log").write_text("time,voltage\n0,1\n1,1\n")
    assert said in refused("simulate", "hoist", name, "--interpolation", "linear")


# --- parameters -----------------------------------------------------------------------------------


def test_axes_lists_drives_and_cards(done):
    text = done("axes")
    for name in preset_names():
        assert f"\n{name} " in text
    assert "rexroth_mdsd_1k_2x_4" in text
    assert max(map(len, text.splitlines())) <= 80


def test_show_lists_every_parameter_in_80_columns(done):
    text = done("show", "slew")
    first_words = [line.split()[0] for line in text.splitlines() if line.strip()]
    assert set(CATALOGUE) <= set(first_words)
    assert max(map(len, text.splitlines())) <= 80
    assert "…" not in text


def test_toml_starts_an_own_set(done, tmp_path):
    (tmp_path / "mine.toml").write_text(done("show", "hoist", "--toml"), "utf-8")
    mine, hoist = Drive.from_toml(tmp_path / "mine.toml"), Drive.preset("hoist")
    assert mine == hoist
    assert done("show", "mine.toml") == done("show", "hoist")


def test_a_part_of_a_run_is_drawn(done, refused, tmp_path):
    done("simulate", "hoist", "step:9", "--plot", "part.svg", "--from", "1", "--to", "2")
    ticks = re.findall(r"<!-- ([\d.]+) -->", (tmp_path / "part.svg").read_text("utf-8"))
    instants = ["1.0", "1.2", "1.4", "1.6", "1.8", "2.0"]
    assert any(ticks[k : k + len(instants)] == instants for k in range(len(ticks)))
    said = refused("simulate", "hoist", "step:9", "--plot", "none.svg", "--from", "90")
    assert "The window from 90 s to 10 s holds 0 samples of hoist" in said
