"""What was written is what is read, to the last bit; logs of other people's machines too."""

import datetime
from pathlib import Path

import h5py
import numpy as np
import polars as pl
import pytest
import scipy.io
from asammdf import MDF, Signal
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

from swashplate.logs import TextOptions, open_log

TIME = np.arange(60) / 7.0
NOISE = np.random.default_rng(3).normal(size=(60, 3))
MISSING = st.just(float("nan"))
tables = st.integers(2, 4).flatmap(
    lambda width: st.lists(
        st.tuples(*[st.one_of(st.floats(), MISSING)] * width), min_size=1, max_size=20
    )
)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("logs") / "log.csv"


def same(read, written):
    """Equal to the last bit, signs of zeros included; any NaN for any NaN."""
    read, written = np.asarray(read), np.asarray(written, np.float64)
    assert read.dtype == np.float64
    assert read.shape == written.shape
    missing = np.isnan(written)
    assert np.array_equal(np.isnan(read), missing)
    assert np.array_equal(read[~missing].view(np.int64), written[~missing].view(np.int64))


@settings(max_examples=100)
@given(
    rows=tables,
    layout=st.sampled_from(
        [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), (" ", "."), ("|", ",")]
    ),
    end=st.sampled_from(["\n", "\r\n"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"]),
    form=st.sampled_from(["{!r}", "{:.6g}", "{:.3f}", "{:+.17e}"]),
    empty=st.booleans(),
    quoted=st.booleans(),
    # rows of plain numbers are read at once, others are looked at line by line
    last=st.sampled_from(["", "# the end"]),
)
def test_text(path, rows, layout, end, encoding, form, empty, quoted, last):
    delimiter, decimal = layout
    quote = '"' if quoted else ""
    assume(not np.isnan(rows).all())
    blank = empty and delimiter != " "  # between spaces nothing cannot be told from nothing at all

    def cell(number: float) -> str:
        word = "" if blank and np.isnan(number) else form.format(number).replace(".", decimal)
        return f"{quote}{word}{quote}"

    names = [f"c{i} [µs]" if delimiter != " " else f"c{i}" for i in range(len(rows[0]))]
    lines = [delimiter.join(names), *(delimiter.join(map(cell, row)) for row in rows), last]
    path.write_bytes(end.join(lines).encode(encoding))
    options = TextOptions(delimiter=delimiter, decimal=decimal, header_row=1)
    read = open_log(path, options=options).read(names)
    for name, column in zip(names, zip(*rows, strict=True), strict=True):
        same(read[name], [float(form.format(number)) for number in column])


KINDS = [np.float64, np.float32, np.int8, np.int16, np.int32, np.uint8, np.uint16, np.uint32, bool]


@settings(max_examples=25)
@given(
    arrays=st.integers(1, 20).flatmap(
        lambda size: st.lists(
            st.sampled_from(KINDS).flatmap(lambda kind: hnp.arrays(kind, size)),
            min_size=1,
            max_size=3,
        )
    ),
    compression=st.sampled_from(["uncompressed", "zstd", "snappy", "lz4", "gzip"]),
)
def test_parquet(path, arrays, compression):
    log = path.with_suffix(".parquet")
    table = {f"c{i}": array for i, array in enumerate(arrays)}
    pl.DataFrame(table).write_parquet(log, compression=compression)
    for name, read in open_log(log).read(list(table)).items():
        same(read, table[name])


def test_parquet_of_dates(tmp_path):
    begin = datetime.datetime(2024, 1, 1)
    table = {
        "date [s]": [begin, None, begin + datetime.timedelta(seconds=1, microseconds=5)],
        "lasted": [datetime.timedelta(milliseconds=1500), None, datetime.timedelta(0)],
    }
    pl.DataFrame(table).write_parquet(tmp_path / "log.parquet")
    expected = {"date [s]": [0.0, np.nan, 1.000005], "lasted": [1.5, np.nan, 0.0]}
    holds(tmp_path / "log.parquet", expected, units=dict.fromkeys(table, "s"))


STRUCTURE = {
    "t": TIME,
    "column": TIME[:, None],
    "x": NOISE,
    "y": NOISE.T,
    "one": 2.5,
    "whole": np.arange(60, dtype=np.int16) - 7,
    "single": NOISE[:, 0].astype(np.float32),
    "on": NOISE[:, 0] > 0.0,
}


def matrix(name: str, form: str, array: np.ndarray, first: int = 0) -> dict[str, np.ndarray]:
    """Columns of a matrix by their names."""
    return {name + form.format(k + first): array[:, k] for k in range(array.shape[1])}


def holds(file, expected, *, units=None, form=None, left_out=None):
    """Check what a file holds: all of its columns and, where given, what else it says."""
    log = open_log(file)
    read = log.read([column.name for column in log.columns])
    assert read.keys() == expected.keys()
    for name, array in expected.items():
        same(read[name], array)
    assert {c.name: c.unit for c in log.columns if c.unit} == (units or {})
    assert log.left_out == (left_out or {})
    assert form in (None, log.format)


@pytest.mark.parametrize("form", ["4", "5", "5 packed"])
def test_matlab(tmp_path, form):
    deep = {"s": {"t": TIME, "deep": {"x": NOISE}}} if form != "4" else {}
    file = tmp_path / "log.mat"
    packed = "packed" in form
    contents = STRUCTURE | deep
    scipy.io.savemat(file, contents, format=form[0], do_compression=packed, oned_as="row")
    vectors = ("t", "column", "one", "whole", "single", "on")
    expected = {name: np.ravel(STRUCTURE[name]) for name in vectors}
    expected |= matrix("x", "(:,{})", NOISE, 1) | matrix("y", "({},:)", NOISE, 1)
    if deep:
        expected |= {"s.t": TIME} | matrix("s.deep.x", "(:,{})", NOISE, 1)
    holds(file, expected, form=f"MATLAB {form[0]}")


def test_matlab_73(tmp_path):
    """As MATLAB writes it: HDF5 behind a header of 512 bytes, dimensions in reverse."""
    file = tmp_path / "log.mat"
    arrays = {"t": TIME[:, None], "x": NOISE.T, "y": NOISE, "s/u": TIME[None]}
    with h5py.File(file, "w", userblock_size=512) as written:
        for name, array in arrays.items():
            written.create_dataset(name, data=array, chunks=True, compression="gzip")
            written[name].attrs["MATLAB_class"] = np.bytes_("double")
        written["s"].attrs["MATLAB_class"] = np.bytes_("struct")
        written["n"] = np.frombuffer(b"a\0b\0", np.uint16)[:, None]
        written["n"].attrs["MATLAB_class"] = np.bytes_("char")
        written["e"] = np.array([0, 0], np.uint64)
        written["e"].attrs["MATLAB_class"] = np.bytes_("double")
        written["e"].attrs["MATLAB_empty"] = np.uint8(1)
        written["#refs#/a"] = TIME
    content = bytearray(file.read_bytes())
    content[:128] = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    file.write_bytes(content)
    expected = {"t": TIME, "s.u": TIME}
    expected |= matrix("x", "(:,{})", NOISE, 1) | matrix("y", "({},:)", NOISE, 1)
    left_out = {"n": "it is a MATLAB char", "e": "it is empty"}
    holds(file, expected, form="MATLAB 7.3", left_out=left_out)


@pytest.mark.parametrize(
    "options", [{}, {"chunks": (3, 2), "compression": "gzip", "shuffle": True}]
)
def test_hdf5(tmp_path, options):
    file = tmp_path / "log.h5"
    with h5py.File(file, "w") as written:
        written.attrs["operator"] = "me"
        written["run/time [ms]"] = TIME
        written["run/counts"] = np.arange(60, dtype=np.uint16)
        written["run/counts"].attrs["unit"] = "1"
        written.create_dataset("run/x", data=NOISE, **options).attrs["units"] = ["V", "A", "bar"]
        written.create_dataset("y", data=np.ascontiguousarray(NOISE.T), **options)
        written["on"] = NOISE[:, 0] > 0.0
    expected = {"/run/time [ms]": TIME, "/run/counts": np.arange(60), "/on": NOISE[:, 0] > 0.0}
    expected |= matrix("/run/x", "[:,{}]", NOISE) | matrix("/y", "[{},:]", NOISE)
    units = {"/run/time [ms]": "ms", "/run/counts": "1"}
    units |= {"/run/x[:,0]": "V", "/run/x[:,1]": "A", "/run/x[:,2]": "bar"}
    holds(file, expected, units=units)


def test_tdms(tmp_path):
    file = tmp_path / "log.tdms"
    waveform = {"unit_string": "V", "wf_increment": 0.125, "wf_start_offset": 2.0}
    with TdmsWriter(file) as writer:
        for part in (slice(0, 25), slice(25, 60)):
            writer.write_segment(
                [
                    RootObject({"operator": "me"}),
                    GroupObject("run"),
                    ChannelObject("run", "voltage", NOISE[part, 0], waveform),
                    ChannelObject("run", "counts", np.arange(60, dtype=np.int16)[part]),
                    ChannelObject("run", "single", NOISE[part, 1].astype(np.float32)),
                    ChannelObject("run", "note", ["a"]),
                ]
            )
    expected = {
        "voltage": NOISE[:, 0],
        "counts": np.arange(60),
        "single": NOISE[:, 1].astype(np.float32),
        "time": 2.0 + 0.125 * np.arange(60),
    }
    left_out, units = {"note": "it holds text"}, {"voltage": "V", "time": "s"}
    holds(file, expected, units=units, left_out=left_out)


def test_tdms_of_several_groups_and_dates(tmp_path):
    file = tmp_path / "log.tdms"
    dates = np.datetime64("2024-01-01") + np.arange(60) * np.timedelta64(125, "ms")
    with TdmsWriter(file) as writer:
        writer.write_segment(
            [
                ChannelObject("fast", "voltage", NOISE[:, 0]),
                ChannelObject("fast", "stamp", dates.astype("M8[us]")),
                ChannelObject("slow", "voltage", NOISE[:9, 1]),
            ]
        )
    expected = {"fast/voltage": NOISE[:, 0], "fast/stamp": np.arange(60) / 8.0}
    expected |= {"slow/voltage": NOISE[:9, 1]}
    holds(file, expected, units={"fast/stamp": "s"})


def test_mdf(tmp_path):
    file, whole = tmp_path / "log.mf4", np.arange(60, dtype=np.uint8)
    invalid = whole % 7 == 0
    with MDF(version="4.10") as written:
        written.append(
            [
                Signal(NOISE[:, 0], TIME, name="voltage", unit="V"),
                Signal(whole.astype(np.uint16), TIME, name="counts"),
                Signal(whole, TIME, name="scaled", conversion={"a": 0.5, "b": 1.0}),
                Signal(NOISE[:, 2], TIME, name="gaps", invalidation_bits=invalid),
                Signal(np.array([b"on"] * 60), TIME, name="note", encoding="utf-8"),
            ]
        )
        written.save(file, overwrite=True, compression=2)
    expected = {
        "time": TIME,
        "voltage": NOISE[:, 0],
        "counts": whole,
        "scaled": 0.5 * whole + 1.0,
        "gaps": np.where(invalid, np.nan, NOISE[:, 2]),
    }
    left_out = {"note": "it holds text or bytes"}
    holds(file, expected, units={"time": "s", "voltage": "V"}, left_out=left_out)


SHARED = Path(__file__).parents[3] / "shared" / "data"


@pytest.mark.skipif(not SHARED.exists(), reason="other people's logs are not beside this checkout")
@pytest.mark.parametrize(
    ("name", "form"),
    [
        ("excavator/manual_1021_mitch.csv", "CSV, commas, decimal point"),
        ("excavator/steps_boom_0928_0851.csv", "CSV, commas, decimal point"),
        ("eha/exp_data_1_3.csv", "CSV, semicolons, decimal point"),
        ("eha/exp_data_3_3.csv", "CSV, semicolons, decimal point"),
        ("actuator/actuator.mat", "MATLAB 4"),
    ],
)
def test_logs_of_other_machines(name, form):
    path = SHARED / name
    if path.suffix == ".csv":
        delimiter = "," if "commas" in form else ";"
        rows = np.loadtxt(path, delimiter=delimiter, skiprows=1)
        header = path.read_text("utf-8").partition("\n")[0].strip().split(delimiter)
        expected = dict(zip(header, rows.T, strict=True))
    else:
        contents = scipy.io.loadmat(path)
        expected = {key: np.ravel(contents[key]) for key in ("u", "p", "x")}
    log = open_log(path)
    assert log.format == form
    for key, read in log.read(list(expected)).items():
        np.testing.assert_array_equal(read, expected[key])
