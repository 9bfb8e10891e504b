"""Commands from files, right ones and wrong ones."""

import h5py
import numpy as np
import polars as pl
import pytest
import scipy.io

from swashplate import Drive

TIME = np.arange(1025) / 512.0
VOLTAGE = 9.0 * np.sin(TIME)


def simulated(done, *words):
    done("simulate", "hoist", *words, "--out", "run.parquet")
    return pl.read_parquet("run.parquet")


def as_matlab(path):
    scipy.io.savemat(path, {"time": TIME, "voltage": VOLTAGE})


def as_hdf5(path):
    with h5py.File(path, "w") as file:
        file["run/time"], file["run/voltage"] = TIME, VOLTAGE


def as_text(path):
    table = pl.DataFrame({"time": TIME, "voltage": VOLTAGE, "note": "x"})
    comma = path.suffix == ".txt"
    table.write_csv(path, separator=";" if comma else ",", decimal_comma=comma)


def as_parquet(path):
    pl.DataFrame({"time": TIME, "voltage": VOLTAGE, "note": "x"}).write_parquet(path)


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("log.csv", as_text),
        ("log.txt", as_text),
        ("log.parquet", as_parquet),
        ("log.mat", as_matlab),
        ("log.h5", as_hdf5),
    ],
)
def test_a_record_is_simulated(done, tmp_path, name, write):
    write(tmp_path / name)
    written = simulated(done, name, "--interpolation", "linear")
    expected = Drive.preset("hoist").simulate(VOLTAGE)
    np.testing.assert_allclose(written["shaft_speed"], expected.shaft_speed, atol=1e-12)


def test_units_in_the_header(done, tmp_path):
    table = pl.DataFrame({"time [ms]": 1e3 * TIME, "voltage_mV": 1e3 * VOLTAGE})
    table.write_csv(tmp_path / "log.csv")
    written = simulated(done, "log.csv", "--interpolation", "linear")
    expected = Drive.preset("hoist").simulate(VOLTAGE)
    np.testing.assert_allclose(written["shaft_speed"], expected.shaft_speed, atol=1e-9)


def test_other_columns(done, tmp_path):
    table = pl.DataFrame({"t": TIME, "time": 0.0, "voltage": 0.0, "joystick": VOLTAGE})
    table.write_csv(tmp_path / "log.csv")
    words = ("--interpolation", "linear", "--time-column", "t", "--column", "joystick")
    written = simulated(done, "log.csv", *words)
    np.testing.assert_allclose(written["voltage"], VOLTAGE, atol=1e-12)


def test_interpolation(done, tmp_path):
    (tmp_path / "log.csv").write_text("time,voltage\n0,0\n1,8\n2,8\n")
    held = simulated(done, "log.csv", "--interpolation", "previous", "--rate", "100")
    line = simulated(done, "log.csv", "--interpolation", "linear", "--rate", "100")
    assert held["voltage"][50] == 0.0
    assert line["voltage"][50] == 4.0


def test_clip(done, refused, tmp_path):
    (tmp_path / "log.csv").write_text("time,voltage\n0,0\n1,12\n2,-15\n")
    words = ("simulate", "hoist", "log.csv", "--interpolation", "previous")
    sentence = refused(*words)
    assert "log.csv: The voltage is 12 V at 1 s, but the card takes ±10 V" in sentence
    written = simulated(done, "log.csv", "--interpolation", "previous", "--clip")
    assert written["voltage"].unique().sort().to_list() == [-10.0, 0.0, 10.0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time,voltage\n0,1\n1,nan\n2,1\n", "'voltage' is empty or NaN in data row 2"),
        ("time,voltage\n0,1\n1,inf\n2,1\n", "'voltage' holds inf in data row 2"),
        ("time,voltage\n0,1\nnan,1\n2,1\n", "'time' is empty or NaN in data row 2"),
        ("time,voltage\n0,1\n1,\n2,1\n", "'voltage' is empty or NaN in data row 2"),
        ("time,voltage\n0,1\n1,x\n2,1\n", "'voltage' holds 'x', which is no number, in data row 2"),
        ("", "log.csv is empty"),
        ("time,voltage\n", "log.csv has no rows of numbers"),
        ("time,voltage\n0,1\n2,1\n1,1\n", "'time' goes back from 2.0 to 1.0 in data row 3"),
        ("time,voltage\n0,1\n1,1\n1,1\n", "'time' has 1.0 twice, in data rows 2 and 3"),
        ("time,voltage\n0,1\n1,-10.5\n", "-10.5 V at 1 s, but the card takes ±10 V"),
        ("time,voltage\n0,1\n4e9,1\n", "check the unit of the time"),
        (
            "t,u\n0,1\n1,1\n",
            "no column 'time'; it has 't', 'u': name the one to take, with --time-",
        ),
        ("time,u\n0,1\n1,1\n", "it has 'time', 'u': name the one to take, with --column."),
        ("time,voltage [bar]\n0,1\n1,1\n", "'bar', which does not measure the same as V"),
        ("time,voltage_furlongs\n0,1\n1,1\n", "'furlongs', which does not measure the same as V"),
        ("time [blinks],voltage\n0,1\n1,1\n", "unknown unit 'blinks'; give it in s"),
        ("time,voltage\n0,1\n1\n2,3,4\n", "data row 2 (line 3) has 1 field instead of 2"),
    ],
)
def test_a_bad_record_is_refused(refused, tmp_path, text, said):
    (tmp_path / "log.csv").write_text(text)
    words = ("--interpolation", "previous", "--out", "run.csv", "--plot", "run.png")
    sentence = refused("simulate", "hoist", "log.csv", *words)
    assert "log.csv" in sentence
    assert said in sentence


def test_a_broken_parquet_is_refused(refused, tmp_path):
    (tmp_path / "log.parquet").write_text("not parquet")
    sentence = refused("simulate", "hoist", "log.parquet", "--interpolation", "linear")
    assert "log.parquet is no Parquet file" in sentence


def test_interpolation_must_be_chosen(refused, tmp_path):
    (tmp_path / "log.csv").write_text("time,voltage\n0,1\n1,1\n")
    sentence = refused("simulate", "hoist", "log.csv", "--out", "run.csv")
    assert "log.csv needs --interpolation linear" in sentence
    assert "or --interpolation previous" in sentence


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("none.csv", "There is no file none.csv"),
        ("sub/none.parquet", "There is no file sub/none.parquet"),
        ("none.txt", "There is no file none.txt"),
        ("log.xlsx", "log.xlsx ends in '.xlsx'; a log is read from .csv, .tsv, .txt"),
        ("sub/log", "sub/log ends in ''"),
        ("log", "log ends in ''"),
    ],
)
def test_a_file_that_is_none(refused, tmp_path, name, said):
    (tmp_path / "log").write_text("time,voltage\n0,1\n1,1\n")
    assert said in refused("simulate", "hoist", name, "--interpolation", "linear")


def test_a_folder_is_no_record(refused, tmp_path):
    (tmp_path / "log.csv").mkdir()
    sentence = refused("simulate", "hoist", "log.csv", "--interpolation", "linear")
    assert "log.csv is a folder, not a log." in sentence
