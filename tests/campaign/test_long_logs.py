"""Logs of more rows than are held: their windows with motion, read in parts of a Parquet table."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from tests.logs.writing import write_log

from swashplate import FileError, InputError
from swashplate.campaign import Campaign

TOML = """
[axes.winch]
time = { column = "time" }
input = { column = "u", unit = "V", interpolation = "linear" }
channels.speed = { column = "n", kind = "shaft_speed", unit = "rad/s" }
[[runs]]
file = "log.csv"
"""
RATE = 100.0
ROWS = 12_000


def signals() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two minutes, the command away from rest from 20 to 25 s, from 60 to 62 s and from 64 on."""
    time = np.arange(ROWS) / RATE
    moves = ((time >= 20) & (time < 25)) | ((time >= 60) & (time < 62)) | (time >= 64) & (time < 66)
    noise = np.random.default_rng(4).normal(size=ROWS)
    return time, 4.0 * moves + 0.01 * noise, 0.3 * moves


@pytest.fixture
def long(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Campaign]:
    """Read a campaign of one log for which a thousand rows are long."""
    for name, size in (("LONG", 1000), ("GRAIN", 10), ("BLOCK", 1500)):
        monkeypatch.setattr(f"swashplate.campaign.reading.{name}", size)
    monkeypatch.setattr("swashplate.logs.apart.LONG", 1000)
    monkeypatch.setattr("swashplate.logs.text.PIECE", 1 << 14)

    def read(text: str | None = None, toml: str = TOML) -> Campaign:
        if text is not None:
            (tmp_path / "log.csv").write_text(text, "utf-8")
        (tmp_path / "campaign.toml").write_text(toml, "utf-8")
        return Campaign.from_toml(tmp_path / "campaign.toml")

    return read


def table(separator: str = ",", comma: bool = False) -> str:
    time, u, n = signals()
    frame = pl.DataFrame({"time": time, "u": u.round(4), "n": n, "note": ["x"] * ROWS})
    return frame.write_csv(separator=separator, decimal_comma=comma)


@pytest.mark.parametrize("layout", [(",", False), (";", True)])
def test_windows_with_motion_are_runs_of_their_own(long, tmp_path, layout):
    campaign = long(table(*layout))
    assert [each.name for each in campaign] == ["log from 18 s", "log from 58 s"]
    time, u, n = signals()
    for each, (begin, end) in zip(campaign, ((18.0, 30.0), (58.0, 71.0)), strict=True):
        rows = (time >= each.input.time[0] - 1e-9) & (time <= each.input.time[-1] + 1e-9)
        np.testing.assert_allclose(each.input.time[[0, -1]], [begin, end], atol=0.2)
        np.testing.assert_allclose(each.input.values, u[rows].round(4), atol=1e-12)
        np.testing.assert_array_equal(each["speed"].values, n[rows])
        assert each.start == "rest"
    said = "of 12000; the log has 2 windows with motion; its 12000 rows are read from "
    assert campaign[0].notes[0].endswith(f"{said}log.csv.parquet, written beside it")


def test_the_table_serves_until_the_log_changes(long, tmp_path):
    long(table())
    beside = tmp_path / "log.csv.parquet"
    written = beside.stat().st_mtime_ns
    assert [each.name for each in long()] == ["log from 18 s", "log from 58 s"]
    assert beside.stat().st_mtime_ns == written
    later = table().replace("\n20.", "\n20.0").replace("time,", "time ,")
    long(later.replace(".01,", ".010,"))
    assert beside.stat().st_mtime_ns > written
    assert pl.read_parquet_schema(beside).names() == ["0", "1", "2"]  # what is asked for


@pytest.mark.parametrize("suffix", ["parquet", "h5", "tdms", "mf4"])
def test_a_span_of_a_log_that_can_be_read_in_parts(long, tmp_path, suffix):
    time, u, n = signals()
    write_log(tmp_path / f"log.{suffix}", {"a": {"time": time, "u": u, "n": n}}, segments=3)
    toml = TOML.replace("log.csv", f"log.{suffix}") + "span = { from = 50.0 }\n"
    (found,) = long(toml=toml)
    assert found.name == "log from 58 s"
    rows = (time >= found.input.time[0] - 1e-9) & (time <= found.input.time[-1] + 1e-9)
    np.testing.assert_array_equal(found.input.values, u[rows])
    np.testing.assert_array_equal(found["speed"].values, n[rows])
    assert {each.name for each in tmp_path.iterdir()} == {f"log.{suffix}", "campaign.toml"}


def test_a_long_log_whose_columns_differ_in_length(long, tmp_path, monkeypatch):
    time, u, n = signals()
    groups = {"fast": {"time": time, "u": u}, "slow": {"stamp": time[::2], "n": n[::2]}}
    write_log(tmp_path / "log.tdms", groups)
    toml = TOML.replace("log.csv", "log.tdms").replace('"n",', '"n", time = { column = "stamp" },')
    (found,) = long(toml=toml)
    assert found.input.time.size == 2 * found["speed"].time.size == ROWS
    monkeypatch.setattr("swashplate.logs.log.MOST", 3 * ROWS - 1)
    with pytest.raises(FileError, match="has 36000 numbers in the 4 columns that are wanted, more"):
        long(toml=toml)


def test_so_much_motion_that_not_all_is_taken(long, monkeypatch):
    monkeypatch.setattr("swashplate.campaign.reading.HELD", 1300)
    monkeypatch.setattr("swashplate.campaign.reading.PIECE", 600)
    campaign = long(table())
    sizes = {each.name: each.input.time.size for each in campaign}
    assert sizes.keys() == {"log from 18 s", "log from 58 s", "log from 70 s"}
    assert sizes["log from 18 s"] == sizes["log from 58 s"] == 600
    assert "has 5 windows with motion, of which 1 in 2 is taken" in campaign.experiments[0].notes[0]
    monkeypatch.setattr("swashplate.campaign.reading.HELD", 3000)
    starts = {each.name: each.start for each in long()}
    assert starts["log from 58 s"] == "rest"
    assert starts["log from 64 s"] == "estimated"  # cut in the midst of the motion


def test_stamps_of_a_calendar_count_from_the_first_of_the_file(long):
    time, u, n = signals()
    epoch = [f"{1.7e9 + each:.2f}" for each in time]
    text = "time,u,n\n" + "\n".join(map("{},{:.4f},{}".format, epoch, u, n)) + "\n"
    assert [each.name for each in long(text)] == ["log from 18 s", "log from 58 s"]


@pytest.mark.parametrize(
    ("old", "new", "error", "said"),
    [
        ("\n90.0,", "\nx,", FileError, "'time' holds 'x', .* in data row 9001"),
        ("\n75.0,", "\n1.0,", FileError, "'time' goes back from 74.99 to 1.0 in data row 7501"),
        ("\n21.0,", "\n21.0,,", FileError, "data row 2101 .* has 5 fields instead of 4"),
    ],
)
def test_what_is_wrong_names_its_row_in_the_file(long, tmp_path, old, new, error, said):
    with pytest.raises(error, match=said):
        long(table().replace(old, new, 1))
    assert {each.name for each in tmp_path.iterdir()} >= {"log.csv"}
    assert not list(tmp_path.glob("*.part"))


def test_a_log_without_motion_and_a_table_that_cannot_be_written(long, tmp_path):
    rest = "time,u,n\n" + "".join(f"{k / RATE},0,0\n" for k in range(ROWS))
    with pytest.raises(InputError, match="12000 rows, in none of which the input moves"):
        long(rest)
    beside = tmp_path / "log.csv.parquet"
    beside.unlink()
    beside.mkdir()
    with pytest.raises(FileError, match=r"its table log.csv.parquet cannot be written beside it"):
        long(table())
    beside.rmdir()
    pl.DataFrame({"a": [1]}).write_parquet(beside)
    with pytest.raises(FileError, match="where the table of a long log belongs; rename it"):
        long(table())
