"""Logs of other people's machines, as their loggers wrote them."""

from pathlib import Path

import numpy as np
import pytest
import scipy.io

from swashplate import FileError
from swashplate.logs import check_stamps, open_log, read_series

SHARED = Path(__file__).parents[3] / "shared" / "data"


@pytest.fixture
def shared():
    def path(*names: str) -> Path:
        found = SHARED.joinpath(*names)
        if not found.exists():
            pytest.skip(f"{'/'.join(names)} is not beside this checkout")
        return found

    return path


@pytest.mark.parametrize(
    ("name", "rows"),
    [
        ("manual_1021_mitch.csv", 2199),
        ("steps_boom_0928_0851.csv", 158),
    ],
)
def test_excavator(shared, name, rows):
    path = shared("excavator", name)
    log = open_log(path)
    assert log.format == "CSV, commas, decimal point"
    names = [column.name for column in log.columns]
    expected = np.loadtxt(path, delimiter=",", skiprows=1)
    assert expected.shape == (rows, len(names))
    np.testing.assert_array_equal(np.column_stack(list(log.read(names).values())), expected)
    check_stamps(log, "Time", log.read(["Time"])["Time"])
    assert read_series(path, "Boom Cmd", "1", time_column="Time").values.size == rows


@pytest.mark.parametrize("name", ["exp_data_1_3.csv", "exp_data_3_3.csv"])
def test_electro_hydraulic_actuator(shared, name):
    path = shared("eha", name)
    log = open_log(path)
    assert log.format == "CSV, semicolons, decimal point"
    names = [column.name for column in log.columns]
    expected = np.loadtxt(path, delimiter=";", skiprows=1)
    np.testing.assert_array_equal(np.column_stack(list(log.read(names).values())), expected)


def test_actuator(shared):
    path = shared("actuator", "actuator.mat")
    log = open_log(path)
    assert log.format == "MATLAB 4"
    expected = scipy.io.loadmat(path)
    for name in ("u", "p", "x"):
        np.testing.assert_array_equal(log.read([name])[name], expected[name].ravel())


MATLAB = Path(scipy.io.__file__).parent / "matlab" / "tests" / "data"


@pytest.mark.skipif(not MATLAB.exists(), reason="SciPy is installed without the files of its tests")
def test_files_that_matlab_wrote():
    """SciPy's collection, from version 4 to 7.4 on several machines, read as SciPy reads it."""
    compared = 0
    refused = []
    for path in sorted(MATLAB.glob("test*.mat")):
        try:
            log = open_log(path)
            names = [column.name for column in log.columns]
            read = log.read(names)
        except FileError as error:
            refused.append(str(error))
            continue
        if log.format == "MATLAB 7.3":
            continue
        expected = scipy.io.loadmat(path)
        for name in names:
            variable, _, place = name.partition("(")
            if "." in variable:
                continue
            array = expected[variable]
            if place:
                row, column = place.rstrip(")").split(",")
                array = array[:, int(column) - 1] if row == ":" else array[int(row) - 1]
            np.testing.assert_array_equal(read[name], np.ravel(array))
            compared += 1
    assert compared > 30
    said = ("has no vectors of numbers", "it holds complex numbers")
    assert all(any(words in sentence for words in said) for sentence in refused)
