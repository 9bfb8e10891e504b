"""Columns by name, their units, and time series that can be computed with."""

from pathlib import Path

import numpy as np
import pytest
import scipy.io

from swashplate import FileError, InputError
from swashplate.logs import (
    Log,
    LogColumn,
    TextOptions,
    check_stamps,
    read_series,
)


def log_of(*columns: LogColumn, **left_out: str) -> Log:
    def load(positions, first, last):
        return [np.full(3, float(position)) for position in positions]

    return Log(Path("log.xyz"), "test", columns, load, left_out=left_out)


COLUMNS = [
    LogColumn("time [ms]", "ms"),
    LogColumn("speed (1/min)", "1/min"),
    LogColumn("voltage_mV"),
    LogColumn("x(1,:)"),
    LogColumn("fast/pressure [bar]", "bar"),
    LogColumn("fast/count"),
    LogColumn("slow/count"),
    LogColumn("u #1"),
    LogColumn("u #2"),
]


@pytest.mark.parametrize(
    ("wanted", "name"),
    [
        ("time [ms]", "time [ms]"),
        ("time", "time [ms]"),
        ("speed", "speed (1/min)"),
        ("voltage", "voltage_mV"),
        ("x(1,:)", "x(1,:)"),
        ("pressure", "fast/pressure [bar]"),
        ("pressure [bar]", "fast/pressure [bar]"),
        ("slow/count", "slow/count"),
    ],
)
def test_a_column_is_found_by_its_name(wanted, name):
    log = log_of(*COLUMNS)
    assert log.find(wanted).name == name
    assert log.read([wanted])[wanted].tolist() == [COLUMNS.index(log.find(wanted))] * 3


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        ("x", r"log.xyz .* 'x'; .* 'time \[ms\]', .*: name the one"),
        ("Time", "log.xyz .* 'Time'"),
        ("count", "'count': 'fast/count', 'slow/count'; name the one"),
        ("u", "log.xyz .* 'u'"),
    ],
)
def test_no_column_or_several_are_refused(wanted, said):
    with pytest.raises(InputError, match=said):
        log_of(*COLUMNS).find(wanted)


def written(folder: Path, text: str) -> Path:
    (folder / "log.csv").write_text(text, "utf-8")
    return folder / "log.csv"


@pytest.mark.parametrize(
    ("text", "column", "unit", "options", "time", "values"),
    [
        ("time,voltage,note\n0,1.5,a\n0.1,2,b\n", "voltage", "V", {}, [0.0, 0.1], [1.5, 2.0]),
        *(
            (f"{header}\n0,1500\n100,2000\n", "voltage", "V", {}, [0.0, 0.1], [1.5, 2.0])
            for header in (
                "time [ms],voltage [mV]",
                "time (ms),voltage (mV)",
                "time_ms,voltage_mV",
                "time,voltage\nms,mV",
            )
        ),
        ("time,oil [degC]\n0,0\n1,20.5\n", "oil", "K", {}, [0.0, 1.0], [273.15, 293.65]),
        ("time,n [-]\n0,1\n1,2\n", "n", "1", {}, [0, 1], [1, 2]),
        ("time_ms,u\n0,1\n1,2\n", "u", "V", {"time_column": "time_ms"}, [0, 1e-3], [1, 2]),
        ("time_start,u\n0,1\n1,2\n", "u", "V", {"time_column": "time_start"}, [0, 1], [1, 2]),
        # phase A: amperes measure no voltage
        ("time,voltage_A\n0,1\n1,2\n", "voltage_A", "V", {}, [0, 1], [1, 2]),
        ("t,u [mV]\n0,1500\n1,1\n", "u [mV]", "V", {"time_column": "t"}, [0, 1], [1.5, 0.001]),
        (
            "t;u\n0;1,500\n1;2,500\n",
            "u",
            "V",
            {"time_column": "t", "options": TextOptions(decimal=",")},
            [0, 1],
            [1.5, 2.5],
        ),
    ],
)
def test_series_are_si(tmp_path, text, column, unit, options, time, values):
    series = read_series(written(tmp_path, text), column, unit, **options)
    np.testing.assert_allclose(series.time, time, rtol=1e-14)
    np.testing.assert_allclose(series.values, values, rtol=1e-14)


@pytest.mark.parametrize(
    ("text", "error", "sentence"),
    [
        ("time,volts\n0,1\n", InputError, "'voltage'; .* 'time', 'volts'"),
        ("t,voltage\n0,1\n", InputError, "column 'time'"),
        ("time,voltage [m]\n0,1\n", InputError, "'m', .* V"),
        ("time,voltage\n0,1\n1e-320,1\n", FileError, "2 rows .* 1e-320 s .* 'time'"),
        (None, FileError, "'time' .* 5 .* 'voltage' .* 4"),
    ],
)
def test_bad_files_are_refused_in_a_sentence(tmp_path, text, error, sentence):
    path = tmp_path / "log.mat"
    scipy.io.savemat(path, {"time": np.arange(5.0), "voltage": np.arange(4.0)})
    with pytest.raises(error, match=sentence) as caught:
        read_series(written(tmp_path, text) if text else path, "voltage", "V")
    assert "\n" not in str(caught.value)


NAN = float("nan")


@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        ([0.0, NAN, NAN, NAN, 4.0], "'time' .* rows 2 to 4"),
        ([NAN, 1.0, NAN, NAN, 4.0], "'time' .* row 1 and 2 more"),
        ([0.0, 1.0, 2.0, 3.0, NAN], "'time' .* row 5"),
        ([0.0, 1.0, -np.inf, 3.0, 4.0], "'time' .* -inf .* row 3"),
        ([0.0, 1.0, 1.0, 1.0, 4.0], "1.0 twice, .* rows 2 and 3, .* 2 "),
        ([4.0, 3.0, 2.0, 1.0, 0.0], "4.0 to 3.0 .* row 2, .* 4 "),
        ([], "'time' .*rows"),
    ],
)
def test_stamps(numbers, said):
    with pytest.raises(FileError, match=f"log.xyz: column .*{said}"):
        check_stamps(log_of(), "time", np.array(numbers))
