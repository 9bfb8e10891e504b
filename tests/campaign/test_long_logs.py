"""Logs of more rows than a run may have: their windows with motion, and all of them at a glance."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from tests.logs.writing import write_log

from swashplate import FileError, InputError
from swashplate.campaign import Campaign, campaign_findings

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
    """Read a campaign of one log for which a thousand rows are long, and too many to be held."""
    for name, size in (("LONG", 1000), ("GRAIN", 10), ("BLOCK", 1500)):
        monkeypatch.setattr(f"swashplate.campaign.reading.{name}", size)
    monkeypatch.setattr("swashplate.logs.long_logs.MOST_HELD", 1000)
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
    (overview,) = campaign.overviews
    assert "12,000 rows" in overview.sentence
    assert "2 windows with motion, which are all used" in overview.sentence
    assert "log.csv.parquet, written next to it" in overview.sentence
    assert not any(each.notes for each in campaign)


@pytest.mark.slow
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
    with pytest.raises(FileError, match="36000 numbers .* 4 "):
        long(toml=toml)


def test_so_much_motion_that_not_all_is_taken(long, monkeypatch):
    monkeypatch.setattr("swashplate.campaign.reading.HELD", 1300)
    monkeypatch.setattr("swashplate.campaign.reading.PIECE", 600)
    campaign = long(table())
    sizes = {each.name: each.input.time.size for each in campaign}
    assert sizes.keys() == {"log from 18 s", "log from 58 s", "log from 70 s"}
    assert sizes["log from 18 s"] == sizes["log from 58 s"] == 600
    (overview,) = campaign.overviews
    assert "5 windows with motion; 3 of them, 1," in overview.sentence
    assert [each.used for each in overview.windows] == [True, False, True, False, True]
    monkeypatch.setattr("swashplate.campaign.reading.HELD", 3000)
    starts = {each.name: each.start for each in long()}
    assert starts["log from 58 s"] == "rest"
    assert starts["log from 64 s"] == "estimated"  # cut in the midst of the motion


def test_many_short_windows_are_not_all_taken(long, monkeypatch):
    monkeypatch.setattr("swashplate.campaign.reading.MOST_WINDOWS", 1)
    campaign = long(table())
    assert [each.name for each in campaign] == ["log from 18 s"]
    assert "2 windows with motion; 1 of them, 1," in campaign.overviews[0].sentence


def test_stamps_of_a_calendar_count_from_the_first_of_the_file(long):
    time, u, n = signals()
    epoch = [f"{1.7e9 + each:.2f}" for each in time]
    text = "time,u,n\n" + "\n".join(map("{},{:.4f},{}".format, epoch, u, n)) + "\n"
    assert [each.name for each in long(text)] == ["log from 18 s", "log from 58 s"]


@pytest.mark.parametrize(
    ("old", "new", "error", "said"),
    [
        ("\n90.0,", "\nx,", FileError, "'time' .*'x'.* row 9001"),
        ("\n75.0,", "\n1.0,", FileError, "'time' .*74.99 .*1.0 .* row 7501"),
        ("\n21.0,", "\n21.0,,", FileError, "row 2101 .* 5 .* 4"),
    ],
)
def test_what_is_wrong_names_its_row_in_the_file(long, tmp_path, old, new, error, said):
    with pytest.raises(error, match=said):
        long(table().replace(old, new, 1))
    assert {each.name for each in tmp_path.iterdir()} >= {"log.csv"}
    assert not list(tmp_path.glob("*.part"))


def test_a_log_without_motion_and_a_table_that_cannot_be_written(long, tmp_path):
    rest = "time,u,n\n" + "".join(f"{k / RATE},0,0\n" for k in range(ROWS))
    with pytest.raises(InputError, match="12000 rows.* input"):
        long(rest)
    beside = tmp_path / "log.csv.parquet"
    beside.unlink()
    beside.mkdir()
    with pytest.raises(FileError, match=r"log\.csv\.parquet"):
        long(table())
    beside.rmdir()
    pl.DataFrame({"a": [1]}).write_parquet(beside)
    with pytest.raises(FileError, match="table .*rename"):
        long(table())


# --- a long log as a whole, at its real size ------------------------------------------------------

HOUR = """
title = "Harbour"
[axes.winch]
time = { column = "time", unit = "s" }
input = { column = "u", unit = "mV", scale = 2.0, interpolation = "linear" }
[axes.winch.channels.speed]
column = "n"
kind = "shaft_speed"
unit = "deg/s"
sign = -1
missing = "drop"
[axes.winch.channels.angle]
column = "c"
kind = "encoder_counts"
counts_per_turn = 1000
rolls_over_at = 4096
[[runs]]
file = "log.csv"
"""
HOUR_ROWS = 300_000


def hour() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """3000 s at 100 Hz: a slow sine from 500 to 560 s and one twice as large from 2000 to 2600 s.

    Stamps [s], volts, turning speed [deg/s] and counts.
    """
    time = np.arange(HOUR_ROWS) / 100.0
    size = 2.0 * ((time >= 500.0) & (time < 560.0)) + 4.0 * ((time >= 2000.0) & (time < 2600.0))
    volts = size * np.sin(2.0 * np.pi * time / 20.0)
    counts = np.floor(10.0 * np.maximum(time - 2000.0, 0.0)).astype(int)
    return time, volts, 3.0 * volts, counts


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign of one log of 300,000 rows, of which some speeds are missing."""
    made = tmp_path_factory.mktemp("hour")
    time, volts, speed, counts = hour()
    speed = -speed
    speed[[7, 8, 210_000]] = np.nan
    frame = pl.DataFrame({"time": time, "u": 500.0 * volts, "n": speed, "c": counts % 4096})
    frame.with_columns(pl.col("n").fill_nan(None)).write_csv(made / "log.csv")
    (made / "campaign.toml").write_text(HOUR, "utf-8")
    return made


@pytest.fixture(scope="module")
def campaign(folder: Path) -> Campaign:
    return Campaign.from_toml(folder / "campaign.toml")


def test_the_overview_holds_all_extremes_of_a_log(campaign):
    (overview,) = campaign.overviews
    time, volts, speed, counts = hour()
    speed[[7, 8, 210_000]] = np.nan
    angle = 2.0 * np.pi / 1000.0 * (counts % 4096)  # as recorded, begun anew
    expected = {"input": volts, "speed": np.deg2rad(speed), "angle": angle}
    assert [each.name for each in overview.signals] == [*expected]
    for envelope in overview.signals:
        starts = np.searchsorted(time, envelope.time - 1e-9)
        np.testing.assert_allclose(time[starts], envelope.time, atol=1e-9)
        for found, extreme in ((envelope.low, np.fmin), (envelope.high, np.fmax)):
            wanted = extreme.reduceat(expected[envelope.name], starts)
            np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12)
    assert [each.missing for each in overview.signals] == [0, 3, 0]
    assert (overview.rows, overview.begin, overview.end) == (HOUR_ROWS, 0.0, 2999.99)


def test_windows_of_a_long_log_hold_its_samples(campaign):
    time, volts, _, counts = hour()
    assert [each.name.split(" from ")[0] for each in campaign] == ["log"] * 3
    for experiment, (begin, end) in zip(
        campaign, ((498.0, 565.0), (1998.0, 2598.0), (2598.0, 2605.0)), strict=True
    ):
        stamps = experiment.input.time
        # whole grains of 256 rows, 2.56 s
        np.testing.assert_allclose(stamps[[0, -1]], [begin, end], atol=2.6)
        rows = (time >= stamps[0] - 1e-9) & (time <= stamps[-1] + 1e-9)
        np.testing.assert_allclose(experiment.input.values, volts[rows], atol=1e-12)
        turned = experiment["angle"].values - experiment["angle"].values[0]
        expected = 2.0 * np.pi / 1000.0 * (counts[rows] - counts[rows][0])
        np.testing.assert_allclose(turned, expected, atol=1e-9)
    assert [each.start for each in campaign] == ["rest", "rest", "estimated"]


def test_a_log_that_is_held_needs_no_table_beside_it(campaign, folder):
    assert {each.name for each in folder.iterdir()} == {"log.csv", "campaign.toml"}


@pytest.mark.slow
def test_ignored_windows_of_a_long_log_may_lie_where_no_run_is(folder):
    toml = folder / "ignoring.toml"
    lines = ['ignore = [{ from = 1000.0, to = 1001.0, why = "hook caught" }]']
    toml.write_text(HOUR + "\n".join(lines), "utf-8")
    assert not any("ignore" in each for each in campaign_findings(Campaign.from_toml(toml)))
    toml.write_text(HOUR + "ignore = [{ from = 4000.0, to = 4001.0 }]", "utf-8")
    (finding,) = (each for each in campaign_findings(Campaign.from_toml(toml)) if "ignore" in each)
    assert "4000 s to 4001 s" in finding
    toml.unlink()


@pytest.mark.slow
def test_the_figure_of_a_whole_log_shades_its_windows(campaign):
    first, second = campaign.plot()
    assert first.get_suptitle() == "Harbour: log, the whole log"
    assert [ax.get_ylabel() for ax in first.axes] == ["input (V)", "speed (deg/s)", "angle (deg)"]
    names = [text.get_text() for text in first.axes[0].get_legend().get_texts()]
    assert names == ["window that is used"]
    for ax in first.axes:
        assert ax.get_xlim() == (0.0, 2999.99)
        (shaded,) = (each for each in ax.collections if each.get_label() == names[0])
        edges = [path.vertices[:, 0] for path in shaded.get_paths()]
        ends = [(each.min(), each.max()) for each in edges]
        np.testing.assert_allclose(ends, [(498, 565), (1998, 2598), (2598, 2605)], atol=2.6)
    assert second.get_suptitle() == "Harbour: winch"
