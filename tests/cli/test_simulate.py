"""Drives are simulated, compared and shown as the functions behind have it, from any input."""

import re
import zipfile
from importlib.util import find_spec
from pathlib import Path
from shutil import which

import numpy as np
import polars as pl
import pytest
import scipy.io

from swashplate import Drive, Limit, maneuvers
from swashplate.parameters import CATALOGUE, preset_names

NUMBER = re.compile(r"(?<!\S)[-+]?\d[\d.e+-]*(?!\S)")

# --- simulate -------------------------------------------------------------------------------------

STICKS = {
    "offset": ({"unit": "V", "offset": -5.0}, lambda volts: volts + 5.0),
    "reversed": ({"offset": 5.0, "sign": -1, "unit": "V"}, lambda volts: -volts - 5.0),
    "per cent": ({"scale": 0.1, "unit": "V"}, lambda volts: 10.0 * volts),
    "millivolts": ({"unit": "mV", "offset": -2500.0}, lambda volts: 1e3 * volts + 2500.0),
}
"""How a campaign states its command, and the number of the log for a voltage at the card."""


def fitted_drive(path: Path, **command: object) -> None:
    """A parameter file as a fit writes it, with what its campaign states of the command."""
    Drive.preset("hoist").to_toml(path)
    lines = ["[command]", 'column = "Joystick"']
    lines += [f"{name} = {value!r}".replace("'", '"') for name, value in command.items()]
    path.write_text(path.read_text("utf-8") + "\n" + "\n".join(lines) + "\n", "utf-8")


@pytest.mark.parametrize("stick", STICKS)
def test_the_column_of_the_fit_is_read_as_the_fit_read_it(done, number, tmp_path, stick):
    """The stick of a machine rests at 5 V: without the campaign's offset that is half speed."""
    stated, numbers = STICKS[stick]
    fitted_drive(tmp_path / "mine.toml", **stated)
    volts = maneuvers.step(6.0).sample()
    time = np.arange(volts.size) / 512.0
    pl.DataFrame({"time": time, "Joystick": numbers(volts), "card": volts}).write_csv("log.csv")
    words = ("simulate", "mine.toml", "log.csv", "--interpolation", "previous", "--column")
    text = done(*words, "Joystick", "--out", "run.csv")
    assert "Joystick" in text
    assert pl.read_csv("run.csv")["voltage"].to_numpy() == pytest.approx(volts, abs=1e-9)
    # another column holds the card's volts, which is said
    assert "'card' is taken as volts at the card" in done(*words, "card", "--out", "other.csv")
    assert pl.read_csv("other.csv")["voltage"].to_numpy() == pytest.approx(volts, abs=1e-9)


@pytest.mark.parametrize("stick", STICKS)
def test_compensation_is_told_in_the_numbers_of_the_stick(done, tmp_path, stick):
    stated, numbers = STICKS[stick]
    fitted_drive(tmp_path / "mine.toml", **stated)
    text = done("compensate", "mine.toml", "--speed-deg-s", "100", "--out", "map.csv")
    assert "the voltage at the card is" in text
    table = pl.read_csv("map.csv")
    expected = [float(numbers(volts)) for volts in table["voltage"]]
    assert table["Joystick, as logged"].to_list() == pytest.approx(expected, rel=1e-9)
    # without a campaign's offset nothing is added
    assert "as logged" not in done("compensate", "hoist", "--speed-deg-s", "100")


def test_a_drive_keeps_how_its_logs_hold_the_command(done, tmp_path):
    fitted_drive(tmp_path / "mine.toml", **STICKS["offset"][0])
    drive = Drive.from_toml(tmp_path / "mine.toml")
    drive.replace(Z10=11.0).to_toml(tmp_path / "changed.toml")
    changed = Drive.from_toml(tmp_path / "changed.toml").parameters.command
    assert changed == ("Joystick", "V", 1.0, -5.0, 1)
    assert Drive.preset("hoist").parameters.command is None


def test_a_step_prints_the_known_speeds(done, number):
    text = done("simulate", "hoist", "step:9")
    assert "hoist, step 9 V: 5121 samples at 512 Hz, 10 s" in text
    assert number(text, "peak speed, positive") == 196.00
    assert number(text, "peak speed, negative") == 0.0
    assert number(text, "speed at the end") == 3.09  # the hoist creeps at 0 V
    assert max(map(len, text.splitlines())) <= 80
    # half the record is after the step, at 0 V and within the dead zone, which holds nothing back
    share = number(text, "dead zone")
    assert share == number(done("limits", "hoist", "step:9"), "dead zone")
    run = Drive.preset("hoist").simulate(maneuvers.step(9.0).sample())
    assert share < 1.0 < 100.0 * run.active(Limit.DEAD_ZONE).mean()


def test_the_table_and_the_files_say_what_the_simulation_says(done, number, tmp_path):
    words = ("--out", "run.csv", "--plot", "run.png")
    text = done("simulate", "hoist", "sine:9,0.1", *words)
    run = Drive.preset("hoist").simulate(maneuvers.sine(9.0, 0.1).sample())
    assert number(text, "peak speed, negative") == pytest.approx(-185.00, abs=0.01)
    travelled = np.degrees(run.shaft_position[-1])
    assert number(text, "position at the end") == pytest.approx(travelled, abs=0.05)
    assert number(text, "peak current, positive") == pytest.approx(run.current.max(), abs=5e-5)
    assert number(text, "peak current, negative") == pytest.approx(run.current.min(), abs=5e-5)
    stopped = 100.0 * np.mean(run.active(Limit.SWASH_STOP))
    assert number(text, "swash stop") == pytest.approx(stopped, abs=0.05)
    assert "never" in text
    assert "All signals, in SI: run.csv\nFigure: run.png" in text
    assert (tmp_path / "run.png").read_bytes().startswith(b"\x89PNG")
    assert pl.read_csv("run.csv").equals(run.to_polars())


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


@pytest.mark.parametrize(
    ("words", "row", "value"),
    [
        (
            ("linearize", "hoist", "--at", "4", "--units", "m/min", "--drum", "0.8"),
            "swash angle",
            "deg",
        ),
        (("linearize", "hoist", "--at", "4", "--units", "rpm"), "steady gain", "rpm/V"),
        (("simulate", "hoist", "step:9", "--units", "rpm"), "position at the end", "turns"),
        (("show", "hoist", "--units", "m/min", "--drum", "0.8"), "omega", "56.253 61.833 rad/s"),
        (("show", "hoist", "--units", "rpm"), "Z13", "0.27596 0.26047 rad"),
        (("full-order", "hoist", "step:2", "--units", "rpm"), "spool_frequency", "40 Hz"),
        (("full-order", "hoist", "step:2"), "motor_constant", "rad/m³"),
        (("show", "hoist", "--set", "cam_ripple=0.01"), "cam_ripple (", ": 0.01"),
    ],
)
def test_only_the_shafts_motion_is_shown_in_its_unit(done, words, row, value):
    line = next(each for each in done(*words).splitlines() if each.startswith(row))
    assert value in " ".join(line.split())
    assert not line.endswith(" 1")  # a pure number has no unit


def test_a_load_that_nothing_feels_is_said(done):
    text = done("simulate", "hoist", "rest:1", "--set", "load_torque=30kN*m")
    assert "! load_torque changes nothing without motor_leakage or motor_constant" in text
    assert next(line for line in text.splitlines() if "dead zone" in line).endswith("never")


@pytest.mark.slow
def test_a_part_of_a_run_is_drawn(done, refused, tmp_path):
    done("simulate", "hoist", "step:9", "--plot", "part.svg", "--from", "1", "--to", "2")
    ticks = re.findall(r"<!-- ([\d.]+) -->", (tmp_path / "part.svg").read_text("utf-8"))
    instants = ["1.0", "1.2", "1.4", "1.6", "1.8", "2.0"]
    assert any(ticks[k : k + len(instants)] == instants for k in range(len(ticks)))
    said = refused("simulate", "hoist", "step:9", "--plot", "none.svg", "--from", "90")
    assert "90 s to 10 s holds 0 samples of hoist" in said


# --- records --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["log.txt", "log.mat"])
def test_a_record_is_simulated(done, name):
    time = np.arange(1025) / 512.0
    columns = {"time": time, "voltage": 9.0 * np.sin(time)}
    if name.endswith(".mat"):
        scipy.io.savemat(name, columns)
    else:
        pl.DataFrame({**columns, "note": "x"}).write_csv(name, separator=";", decimal_comma=True)
    done("simulate", "hoist", name, "--interpolation", "linear", "--out", "run.parquet")
    expected = Drive.preset("hoist").simulate(columns["voltage"])
    written = pl.read_parquet("run.parquet")["shaft_speed"]
    np.testing.assert_allclose(written, expected.shaft_speed, atol=1e-12)


def test_what_was_measured_beside_the_voltage_counts(done, refused):
    time = np.arange(2561) / 512.0
    voltage, speed, supply = 9.0 * np.sin(time), 1.0 - 0.1 * np.sin(time) ** 2, 95.0 + np.cos(time)
    columns = {"time": time, "voltage": voltage, "n": speed, "p [bar]": supply}
    pl.DataFrame(columns).write_csv("log.csv")
    words = ("hoist", "log.csv", "--interpolation", "linear", "--measured", "pump_speed=n")
    words = (*words, "--measured", "supply_pressure=p")
    done("simulate", *words, "--out", "run.parquet")
    given = {"pump_speed": speed, "supply_pressure": 1e5 * supply}
    expected = Drive.preset("hoist").simulate(voltage, **given)
    written = pl.read_parquet("run.parquet")["shaft_speed"]
    np.testing.assert_allclose(written, expected.shaft_speed, atol=1e-12)
    assert "pump speed" in done("limits", *words)
    slower = done("simulate", "hoist", "step:9", "--measured", "pump_speed=0.8")
    assert "156.80" in slower  # 0.8 times 196.00 deg/s, at the plate's stop
    for wrong, said in (
        ("pump_speed=n", "number in SI"),
        ("speed=1", "NAME=COLUMN"),
        ("supply_pressure=-3", "1 to 1e+09 Pa"),
        ("pump_speed=1e308", "1e+308"),
    ):
        sentence = refused("simulate", "hoist", "step:9", "--measured", wrong)
        assert wrong.partition("=")[0] in sentence
        assert said in sentence


def test_a_recursion_for_another_rate_becomes_its_equation(done):
    text = done("simulate", "hoist", "step:9", "--rate", "1000", "--out", "run.parquet")
    assert "a recursion for 512 Hz; at 1000 Hz the differential equation" in text
    slow = " ".join(done("simulate", "hoist", "step:9", "--rate", "100").split())
    assert "at 100 Hz, computed in steps of 1/600 s, the differential equation" in slow
    exact = Drive.preset("hoist").at_every_rate()
    run = exact.simulate(maneuvers.step(9.0).sample(1000.0), 1000.0)
    assert np.array_equal(pl.read_parquet("run.parquet")["shaft_speed"], run.shaft_speed)
    for words in (("hoist", "step:9"), ("neutral", "step:9", "--rate", "1000")):
        assert "recursion" not in done("simulate", *words)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "time,voltage\n0,1\n1,x\n2,1\n",
            "'voltage' ... 'x'",
        ),
        ("time,voltage\n0,1\n2,1\n1,1\n", "'time' ... 2.0 ... 1.0 ... row 3"),
        ("time,voltage\n0,1\n1,-10.5\n", "-10.5 V ... 1 s... ±10 V"),
        (
            "t,u\n0,1\n1,1\n",
            "'time'... 't', 'u'... --time-",
        ),
        ("time,u\n0,1\n1,1\n", "'time', 'u'... --column."),
    ],
)
def test_a_bad_record_is_refused(refused, tmp_path, text, said):
    (tmp_path / "log.csv").write_text(text)
    words = ("--interpolation", "previous", "--out", "run.csv", "--plot", "run.png")
    sentence = refused("simulate", "hoist", "log.csv", *words)
    assert "log.csv" in sentence
    for part in said.split("..."):
        assert part in sentence


# --- compare, axes and show -----------------------------------------------------------------------


def test_two_axes(done, number):
    text = done("compare", "hoist", "neutral")
    assert "hoist and neutral, step 9 V" in text
    neutral = np.degrees(100.0 * np.arctan(0.09))
    speeds = [number(text, "peak speed", k) for k in range(2)]
    assert speeds == pytest.approx([196.00, neutral], abs=0.02)
    assert number(text, "final speed") == 196.00
    # the neutral drive: a lag of 0.1 s and the card's two milliseconds twice
    lag = 0.1 * np.log(10.0) + 2.0 / 512.0
    assert number(text, "response time", 1) == pytest.approx(lag, abs=3e-3)


def test_drives_and_parameters_are_listed_in_80_columns(done):
    text = done("show")
    for name in preset_names():
        assert f"\n{name} " in text
    assert "rexroth_mdsd_1k_2x_4" in text
    assert max(map(len, text.splitlines())) <= 80
    text = done("show", "slew")
    first_words = [line.split()[0] for line in text.splitlines() if line.strip()]
    assert set(CATALOGUE) <= set(first_words)
    assert max(map(len, text.splitlines())) <= 80


# --- drives ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "words",
    [
        ("show", "fitted"),
        ("compare", "hoist", "fitted"),
        ("whatif", "fitted", "--scale", "pump=1.1", "--maneuver", "step:4"),
    ],
)
def test_a_fit_s_folder_stands_for_its_drive(done, words):
    Path("fitted").mkdir()
    done("whatif", "hoist", "--scale", "pump=1.1", "--out", "fitted/drive.toml")
    by_file = ["fitted/drive.toml" if word == "fitted" else word for word in words]
    first, second = (NUMBER.findall(done(*each)) for each in (words, by_file))
    assert len(first) > 5
    assert first == second


def test_a_packaged_name_goes_before_a_folder(done, refused, tmp_path):
    (tmp_path / "hoist").mkdir()
    (tmp_path / "hoist" / "drive.TOML").write_text(done("show", "slew", "--toml"), "utf-8")
    assert done("show", "hoist/drive.TOML") == done("show", "slew") != done("show", "hoist")
    assert "drive.toml in hoist: give a folder" in refused("limits", "./hoist")
    Path("hoist/parameters.toml").touch()
    assert "user-defined model" in refused("limits", "./hoist")
    said = refused("export", "./hoist", "--fmu", "hoist.fmu")
    assert "hoist is the fit of a user-defined model" in said
    assert "--model valve.py" in said


# --- export ---------------------------------------------------------------------------------------


def test_writes_fmi_3_for_chosen_platforms(done, tmp_path):
    words = ("--fmi", "3", "--platforms", "linux64, win64", "--scale", "Z16=1.5")
    said = done("export", "hoist", "--fmu", "a.fmu", *words)
    assert "FMU 3.0: a.fmu" in said
    assert "Z16" in said
    with zipfile.ZipFile(tmp_path / "a.fmu") as made:
        libraries = [name for name in made.namelist() if name.startswith("binaries/")]
        text = made.read("modelDescription.xml").decode()
    assert [each.split("/")[1] for each in libraries] == ["x86_64-linux", "x86_64-windows"]
    assert repr(1.5 * Drive.preset("hoist")["Z16"].value.plus) in text


def test_says_what_it_warns_of(done):
    said = done("export", "hoist", "--step", "0.001", "--fmu", "a.fmu", "--platforms", "linux64")
    assert said.endswith("FMU 2.0: a.fmu\n")
    assert "Note: hoist: the card's filter is a recursion for another rate" in " ".join(
        said.split()
    )
    assert "below 1.5 steps" in done("export", "neutral", "--fmu", "b.fmu")


def test_writes_c_and_compiles_it(done, tmp_path):
    if not which("cc") and find_spec("ziglang") is None:
        pytest.skip("there is no C compiler")
    said = done("export", "slew", "--c", "folder", "--compile")
    (header,) = (tmp_path / "folder").glob("*drive.h")
    library = tmp_path / "folder" / f"{header.stem}.so"
    assert library.exists()
    assert f"C: folder/{library.name}" in said
