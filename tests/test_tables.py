"""Tables in and out."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from swashplate import FileError, InputError
from swashplate.tables import read_series, write_table


def written(path: Path, text: str) -> Path:
    path.write_text(text, "utf-8")
    return path


def test_plain_columns_are_si(tmp_path: Path) -> None:
    path = written(tmp_path / "log.csv", "time,voltage,note\n0,1.5,a\n0.1,2,b\n")
    series = read_series(path, "voltage", "V")
    assert list(series.time) == [0.0, 0.1]
    assert list(series.values) == [1.5, 2.0]


@pytest.mark.parametrize("header", ["time [ms],voltage [mV]", "time_ms,voltage_mV"])
def test_units_in_the_header_are_converted(tmp_path: Path, header: str) -> None:
    path = written(tmp_path / "log.csv", f"{header}\n0,1500\n100,2000\n")
    series = read_series(path, "voltage", "V")
    np.testing.assert_allclose(series.time, [0.0, 0.1])
    np.testing.assert_allclose(series.values, [1.5, 2.0])


def test_columns_by_their_full_name(tmp_path: Path) -> None:
    path = written(tmp_path / "log.csv", "t,u [mV]\n0,1500\n1,1\n")
    series = read_series(path, "u [mV]", "V", time_column="t")
    np.testing.assert_allclose(series.values, [1.5, 0.001])


def test_parquet(tmp_path: Path) -> None:
    table = pl.DataFrame({"time": [0.0, 0.5], "voltage": [1, 2]})
    write_table(table, tmp_path / "log.parquet")
    assert list(read_series(tmp_path / "log.parquet", "voltage", "V").values) == [1.0, 2.0]


@pytest.mark.parametrize(
    ("text", "error", "sentence"),
    [
        ("", FileError, "log.csv is empty"),
        ("time,volts\n0,1\n", InputError, "no column 'voltage'; it has 'time', 'volts'"),
        ("t,voltage\n0,1\n", InputError, "no column 'time'"),
        ("time,voltage [m]\n0,1\n", InputError, "'m', which does not measure the same as V"),
        ("time,voltage\n0,1\n1,x\n", FileError, "'voltage' holds 'x', .* in data row 2"),
        ("time,voltage\n0,1\n1,\n", FileError, "'voltage' is empty in data row 2"),
        ("time,voltage\n0,1\n1,2,3\n", FileError, "cannot be read as a table"),
    ],
)
def test_bad_files_are_refused_in_a_sentence(
    tmp_path: Path, text: str, error: type[Exception], sentence: str
) -> None:
    with pytest.raises(error, match=sentence) as caught:
        read_series(written(tmp_path / "log.csv", text), "voltage", "V")
    assert "\n" not in str(caught.value)


def test_missing_file_and_unknown_ending(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="There is no file"):
        read_series(tmp_path / "log.csv", "voltage", "V")
    with pytest.raises(FileError, match=r"read from \.csv or \.parquet"):
        read_series(tmp_path / "log.xlsx", "voltage", "V")
