"""Numbers that HDF5 and netCDF store packed, with marks for missing ones."""

import h5py
import numpy as np
import pytest

from swashplate.logs import open_log

STORED = np.array([0, 100, 7465, -250], np.int16)


def read_back(path, stored, attributes):
    """A dataset with attributes, as it is read."""
    with h5py.File(path, "w") as file:
        file.create_dataset("speed", data=stored).attrs.update(attributes)
    return open_log(path).read(["speed"])["speed"]


@pytest.mark.parametrize(
    ("stored", "attributes", "expected"),
    [
        (STORED, {"scale_factor": 0.02}, [0.0, 2.0, 149.3, -5.0]),
        (STORED, {"scale_factor": np.array([0.5]), "add_offset": 10.0}, [10, 60, 3742.5, -115]),
        (STORED, {"add_offset": np.int16(5)}, [5, 105, 7470, -245]),
        (STORED, {"_FillValue": np.int16(-250)}, [0, 100, 7465, np.nan]),
        (STORED, {"missing_value": np.array([100, -250], np.int16)}, [0, np.nan, 7465, np.nan]),
        (STORED, {"_FillValue": np.int16(100), "scale_factor": 2.0}, [0, np.nan, 14930, -500]),
        (STORED, {"valid_range": np.array([-10, 1000], np.int16)}, [0, 100, np.nan, np.nan]),
        (STORED, {"valid_min": np.int16(0), "scale_factor": 0.1}, [0, 10, 746.5, np.nan]),
        (
            np.array([1, -1, -2], np.int16),
            {"_Unsigned": "true", "_FillValue": np.int16(-1)},
            [1, np.nan, 65534],
        ),
        # the default mark of netCDF, written as a double
        (
            np.array([1.5, 9.969209968386869e36], np.float32),
            {"_FillValue": 9.969209968386869e36},
            [1.5, np.nan],
        ),
        (np.array([1.5, np.nan]), {"_FillValue": np.nan}, [1.5, np.nan]),
    ],
)
def test_packed_numbers(tmp_path, stored, attributes, expected):
    read = read_back(tmp_path / "log.h5", stored, attributes)
    np.testing.assert_allclose(read, np.array(expected, float), rtol=1e-12)


def test_columns_of_a_packed_matrix(tmp_path):
    with h5py.File(tmp_path / "log.h5", "w") as file:
        made = file.create_dataset("x", data=np.stack((STORED, 2 * STORED), axis=1))
        made.attrs["scale_factor"] = 0.02
    read = open_log(tmp_path / "log.h5").read(["/x[:,1]"])
    np.testing.assert_allclose(read["/x[:,1]"], [0.0, 4.0, 298.6, -10.0], rtol=1e-12)


def test_a_scale_that_is_no_number_is_said(tmp_path):
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file.create_dataset("u", data=[1.0, 2.0])
        file.create_dataset("speed", data=STORED).attrs["scale_factor"] = "0.02 deg/s"
    log = open_log(tmp_path / "log.h5")
    assert [column.name for column in log.columns] == ["/u"]
    assert log.left_out == {"/speed": "its attribute scale_factor is not a number"}


def test_times_since_dates_count_from_one_zero(tmp_path):
    numbers = {
        "cmd": (np.arange(5) * 10_000_000, "nanoseconds since 2024-03-11T10:00:00"),
        "enc": (np.arange(5) * 10, "milliseconds since 2024-03-11 10:00:00.5"),
        "gps": (45361.0 + 10.25 / 24 + np.arange(5) / 8640000, "days since 1900-01-00 00:00:00"),
        "day": (19793 + (36001.0 + 0.01 * np.arange(5)) / 86400, "days since 1970-01-01"),
    }
    with h5py.File(tmp_path / "log.h5", "w") as file:
        for name, (stored, unit) in numbers.items():
            file.create_dataset(name, data=stored).attrs["units"] = unit
    log = open_log(tmp_path / "log.h5")
    read = log.read(["/cmd", "/enc", "/day"])
    for name, begin, tolerance in (("/cmd", 0.0, 1e-12), ("/enc", 0.5, 1e-9), ("/day", 1.0, 1e-5)):
        np.testing.assert_allclose(read[name], begin + 0.01 * np.arange(5), atol=tolerance)
    # a date that there is not stays as it is written
    assert {column.name: column.unit for column in log.columns}["/gps"] == numbers["gps"][1]


@pytest.mark.parametrize(
    "attributes",
    [
        {"scale": 0.02},
        {"gain": np.float32(0.02), "offset": 1.0},
        {"Slope": np.array([0.02]), "Intercept": 1.0},
        {"ScaleFactor": 0.02},
        {"offset": 3},
    ],
)
def test_integers_packed_by_no_convention_are_left_out(tmp_path, attributes):
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file.create_dataset("u", data=[1.0, 2.0])
        file.create_dataset("speed", data=STORED).attrs.update({"units": "deg/s", **attributes})
    log = open_log(tmp_path / "log.h5")
    assert [column.name for column in log.columns] == ["/u"]
    assert f"its attribute {next(iter(attributes))} says" in log.left_out["/speed"]


@pytest.mark.parametrize(
    ("stored", "attributes"),
    [
        (STORED, {"units": "deg/s", "scale": 1.0, "offset": 0}),
        (STORED, {"scale": 0.02}),  # counts of an encoder, say
        (np.array([0.5, 1.5]), {"units": "V", "gain": 10.0}),  # of the amplifier before it
    ],
)
def test_attributes_that_pack_nothing_are_passed_over(tmp_path, stored, attributes):
    np.testing.assert_array_equal(read_back(tmp_path / "log.h5", stored, attributes), stored)
