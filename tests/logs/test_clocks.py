"""Clocks of one log: a common zero, units of their stamps, calendars told by the number."""

import datetime

import h5py
import numpy as np
import polars as pl
import pytest
from nptdms import ChannelObject, TdmsWriter

from swashplate import Campaign
from swashplate.campaign import examine
from swashplate.drafting import draft_campaign
from swashplate.errors import InputError
from swashplate.logs import open_log, read_series

BEGIN = datetime.datetime(2024, 3, 11, 10, 0, 0)
LATER = BEGIN + datetime.timedelta(milliseconds=500)
STEP = datetime.timedelta(milliseconds=10)


def dates(begin, rows=5):
    """Even dates."""
    return [begin + number * STEP for number in range(rows)]


def first_stamps(path, *names):
    """First stamps of some columns."""
    read = open_log(path).read(names)
    return [round(float(read[name][0]), 9) for name in names]


def waveform(date, **changed):
    """Properties of a channel that begins at a date."""
    start = {} if date is None else {"wf_start_time": np.datetime64(date)}
    return {"wf_increment": 0.01, "wf_start_offset": 0.0, "wf_samples": 1, **start, **changed}


def write_tdms(path, channels):
    """Channels of five numbers by group and name, with their properties."""
    with TdmsWriter(path) as writer:
        writer.write_segment(
            [
                ChannelObject(group, name, np.arange(5.0), properties)
                for (group, name), properties in channels.items()
            ]
        )
    return path


@pytest.mark.parametrize(
    ("groups", "first", "second"),
    [
        (("cmd", "enc"), "cmd/time", "enc/time"),
        (("log", "log"), "u time", "n time"),
    ],
    ids=["two groups", "one group"],
)
def test_waveforms_that_begin_apart(tmp_path, groups, first, second):
    channels = {(groups[0], "u"): waveform(BEGIN), (groups[1], "n"): waveform(LATER)}
    path = write_tdms(tmp_path / "log.tdms", channels)
    assert first_stamps(path, first, second) == [0.0, 0.5]


def test_each_waveform_of_a_group_has_its_clock_if_they_differ(tmp_path):
    # the third channel goes with the second, not with the first
    channels = {
        ("log", "u"): waveform(LATER),
        ("log", "n"): waveform(BEGIN),
        ("log", "i"): waveform(BEGIN, wf_start_offset=0.25),
        ("log", "p"): waveform(BEGIN),
    }
    path = write_tdms(tmp_path / "log.tdms", channels)
    names = [f"{name} time" for name in "unip"]
    assert first_stamps(path, *names) == [0.5, 0.0, 0.25, 0.0]


def test_a_start_that_labview_leaves_at_its_zero_is_none(tmp_path):
    unset = datetime.datetime(1904, 1, 1)
    channels = {("cmd", "u"): waveform(unset), ("enc", "n"): waveform(unset, wf_start_offset=0.5)}
    path = write_tdms(tmp_path / "log.tdms", channels)
    assert first_stamps(path, "cmd/time", "enc/time") == [0.0, 0.5]


@pytest.mark.parametrize("unset", [None, datetime.datetime(1904, 1, 1)])
def test_a_waveform_without_a_start_beside_dated_ones_has_no_clock(tmp_path, unset):
    channels = {("cmd", "u"): waveform(BEGIN), ("enc", "n"): waveform(unset)}
    log = open_log(write_tdms(tmp_path / "log.tdms", channels))
    assert "enc/time" not in [column.name for column in log.columns]
    assert "no wf_start_time as others have" in log.left_out["enc/time"]


def test_a_channel_whose_clock_is_left_out_has_no_other_s(tmp_path):
    channels = {("cmd", "voltage"): waveform(BEGIN), ("enc", "speed"): waveform(None)}
    path = write_tdms(tmp_path / "log.tdms", channels)
    text = draft_campaign([path], tmp_path)
    assert "# FIXME: 'enc/time': it has no wf_start_time as others have" in text


@pytest.mark.parametrize(
    ("changed", "end"),
    [
        ({"wf_increment": 10.0, "wf_xunit_string": "ms"}, 0.04),
        ({"wf_increment": 10_000.0, "wf_xunit_string": "us"}, 0.04),
        ({"wf_increment": 0.5, "wf_xunit_string": "min"}, 120.0),
        ({"wf_increment": 1}, 4.0),
        ({"wf_increment": 10, "wf_xunit_string": "ms", "wf_start_offset": 20}, 0.06),
        ({"wf_increment": 0.01, "wf_xunit_string": "Sec"}, 0.04),
    ],
)
def test_increments_of_a_waveform_in_any_unit(tmp_path, changed, end):
    path = write_tdms(tmp_path / "log.tdms", {("log", "u"): waveform(BEGIN, **changed)})
    assert open_log(path).read(["time"])["time"][-1] == pytest.approx(end, rel=1e-12)


def test_an_increment_that_is_not_of_time_is_said(tmp_path):
    spectrum = waveform(BEGIN, wf_increment=0.5, wf_xunit_string="Hz")
    log = open_log(write_tdms(tmp_path / "log.tdms", {("log", "u"): spectrum}))
    assert [column.name for column in log.columns] == ["u"]
    assert "'Hz', which is not a unit of time" in log.left_out["time"]


def test_dates_of_columns_that_begin_apart(tmp_path):
    table = {"u_time": dates(BEGIN), "n_time": [None, *dates(LATER, 4)], "day": [BEGIN.date()] * 5}
    pl.DataFrame(table).write_parquet(tmp_path / "log.parquet")
    read = open_log(tmp_path / "log.parquet").read(["u_time", "n_time", "day"])
    assert read["u_time"][0] == 0.0
    np.testing.assert_allclose(read["n_time"][1:], [0.5, 0.51, 0.52, 0.53], atol=1e-12)
    assert read["day"].tolist() == [0.0] * 5


def test_dates_of_tdms_that_begin_apart(tmp_path):
    path = tmp_path / "log.tdms"
    with TdmsWriter(path) as writer:
        for group, begin in (("enc", LATER), ("cmd", BEGIN)):
            stamps = np.array(dates(begin), "M8[us]")
            writer.write_segment([ChannelObject(group, "t", stamps)])
    assert first_stamps(path, "cmd/t", "enc/t") == [0.0, 0.5]


@pytest.mark.parametrize(
    ("first", "second", "apart"),
    [
        ("2024-03-11 10:00:00.0", "2024-03-11 10:00:00.5", 0.5),
        ("2024-03-11T10:00:00.5Z", "2024-03-11T11:00:00.0+01:00", -0.5),
        ("11.03.2024 10:00:00,0", "11.03.2024 10:00:00,0293", 0.0293),
        ("10:00:00.0", "10:00:00.5", 0.5),
        ("23:59:59.75", "00:00:00.25", 0.5),
    ],
)
@pytest.mark.parametrize("empty", [0, 3], ids=["", "second begins further down"])
def test_dates_of_text_that_begin_apart(tmp_path, first, second, apart, empty):
    rows = [f"{first};1;{second if number >= empty else ''};2" for number in range(5)]
    (tmp_path / "log.csv").write_text("\n".join(["a;u;b;n", *rows]), "utf-8")
    read = open_log(tmp_path / "log.csv").read(["a", "b"])
    assert read["b"][-1] - read["a"][-1] == pytest.approx(apart, abs=1e-9)
    assert min(read["a"][0], read["b"][empty]) == 0.0
    # a column reads the same without the other
    assert open_log(tmp_path / "log.csv").read(["b"])["b"][-1] == read["b"][-1]


def test_one_date_column_counts_from_its_first(tmp_path):
    rows = [f"2024-03-11 10:00:00.{number};1" for number in range(5, 9)]
    (tmp_path / "log.csv").write_text("\n".join(["t;u", *rows]), "utf-8")
    np.testing.assert_allclose(
        open_log(tmp_path / "log.csv").read(["t"])["t"], [0.0, 0.1, 0.2, 0.3]
    )


CALENDARS = {
    # the number of 2024-03-11 10:00, and of a second; by Excel, MATLAB (datenum), .NET, Windows
    "100 ns": (133_546_248_000_000_000, 10_000_000),
    "100 ns of .NET": (638_457_480_000_000_000, 10_000_000),
    "ns": (1_710_151_200_000_000_000, 1_000_000_000),
    "us": (1_710_151_200_000_000, 1_000_000),
    "ms": (1_710_151_200_000, 1_000),
    "d of Excel": (45362.4166666667, 1 / 86400),
    "d of datenum": (739322.416666667, 1 / 86400),
    "microday": (45362416666.6667, 1e6 / 86400),
}


def write_stamps(path, header, first, second, rate=100):
    """A step of a log at some rate, its stamps as numbers of a calendar."""
    whole = isinstance(first, int)
    lines = [f"{header};voltage [V];speed [rad/s]"]
    for number in range(201):
        stamp = first + number * second / rate
        text = str(first + number * second // rate) if whole else f"{stamp:.10f}"
        lines.append(f"{text};{6.0 * (number > 50)};{max(number - 60, 0)}")
    path.write_text("\n".join(lines), "utf-8")
    return path


@pytest.mark.parametrize("header", ["time", "Time_ms", "Time [s]", "stamp of the PLC"])
@pytest.mark.parametrize("calendar", CALENDARS)
def test_calendars_are_told_by_the_number(tmp_path, calendar, header):
    if calendar == "ms" and header == "Time_ms":
        pytest.skip("right as it is")
    log = write_stamps(tmp_path / "log.csv", header, *CALENDARS[calendar])
    text = draft_campaign([log], tmp_path)
    unit = calendar.partition(" of ")[0]
    assert f'unit = "{unit}" }}    # from its numbers' in text
    (tmp_path / "campaign.toml").write_text(text, "utf-8")
    (run,) = Campaign.from_toml(tmp_path / "campaign.toml").experiments
    # a double of 7e5 days is 10 us coarse
    np.testing.assert_allclose(run.input.time, np.arange(201) / 100, atol=2e-5)
    assert run.recorded == pytest.approx(1_710_151_200.0, abs=1e-3)
    (tmp_path / "campaign.toml").write_text(text.replace(f'"{unit}"', '"h"'), "utf-8")
    with pytest.raises(InputError, match=f'write unit = "{unit}" for it'):
        Campaign.from_toml(tmp_path / "campaign.toml")


@pytest.mark.parametrize(
    ("first", "second", "rate", "unit"),
    [
        (0, 1000, 100, "ms"),
        (864_000_000, 1000, 100, "ms"),  # ten days since a start
        (0, 1_000_000, 100, "us"),
        (1_200_000_000, 1_000_000, 100, "us"),  # 20 minutes since a start
        (1_710_151_200_000_000_000, 1_000_000_000, 1000, "ns"),
        (40_000.0, 1.0, 100, "s"),  # of a day
        (40_000.0, 1.0, 900, "s"),
    ],
)
def test_other_stamps_are_as_they_were(tmp_path, first, second, rate, unit):
    log = write_stamps(tmp_path / "log.csv", "time", first, second, rate)
    text = draft_campaign([log], tmp_path)
    assert f'column = "time", unit = "{unit}"' in text
    (tmp_path / "campaign.toml").write_text(text, "utf-8")
    (run,) = Campaign.from_toml(tmp_path / "campaign.toml").experiments
    assert np.ptp(run.input.time) == pytest.approx(200 / rate, rel=1e-6)


def test_ticks_since_a_start_that_may_be_of_100_ns_stay_open(tmp_path):
    log = write_stamps(tmp_path / "log.csv", "time", 0, 10_000_000)
    line = next(line for line in draft_campaign([log], tmp_path).splitlines() if "time =" in line)
    assert "FIXME" in line
    assert "10 Hz in us, 100 Hz in 100 ns" in line


def test_two_calendars_in_one_log_keep_their_alignment(tmp_path):
    ticks, ns = CALENDARS["100 ns"][0], CALENDARS["ns"][0]
    lines = ["Time_cmd;voltage [V];Time_enc;speed [rad/s]"]
    lines += [f"{ticks + n * 100_000};{n % 7};{ns + (50 + n) * 10_000_000};{n}" for n in range(100)]
    (tmp_path / "log.csv").write_text("\n".join(lines), "utf-8")
    (tmp_path / "campaign.toml").write_text(
        """\
[axes.hoist]
time = { column = "Time_cmd", unit = "100 ns" }
[axes.hoist.input]
kind = "voltage"
column = "voltage"
[axes.hoist.channels.speed]
kind = "shaft_speed"
column = "speed"
time = { column = "Time_enc", unit = "ns" }
[[runs]]
file = "log.csv"
""",
        "utf-8",
    )
    (run,) = Campaign.from_toml(tmp_path / "campaign.toml").experiments
    assert run.input.time[0] == 0.0
    assert run.channels["speed"].time[0] == pytest.approx(0.5, abs=1e-5)


def test_each_signal_of_a_draft_has_its_clock(tmp_path):
    lines = ["t_cmd,cmd [V],speed_time,speed [rpm]"]
    lines += [f"{0.01 * n},{n % 5},{0.5 + 0.01 * n},{n}" for n in range(100)]
    (tmp_path / "log.csv").write_text("\n".join(lines), "utf-8")
    text = draft_campaign([tmp_path / "log.csv"], tmp_path, units={"t_cmd": "s", "speed_time": "s"})
    (tmp_path / "campaign.toml").write_text(text, "utf-8")
    (run,) = Campaign.from_toml(tmp_path / "campaign.toml").experiments
    assert (run.input.time[0], run.channels["shaft_speed"].time[0]) == (0.0, 0.5)


def test_the_unit_of_a_series_is_checked(tmp_path):
    log = write_stamps(tmp_path / "log.csv", "time [us]", *CALENDARS["100 ns"])
    with pytest.raises(InputError, match="FILETIME"):
        read_series(log, "speed", "rad/s")


def test_single_floats_of_a_late_clock_are_rounded_stamps(tmp_path):
    stamps = (1e5 + np.arange(801) / 100.0).astype(np.float32)
    steps = np.where(np.arange(801) > 100, 6.0, 0.0)
    with h5py.File(tmp_path / "log.h5", "w") as file:
        for name, values in (("time", stamps), ("voltage", steps), ("speed", 2.0 * steps)):
            file[name] = values
    text = draft_campaign([tmp_path / "log.h5"], tmp_path)
    assert "8 s at 100 Hz" in text
    (tmp_path / "campaign.toml").write_text(text, "utf-8")
    (run,) = Campaign.from_toml(tmp_path / "campaign.toml").experiments
    findings = " ".join(sentence for signal in examine(run) for sentence in signal.findings)
    assert "rounded to 7.8 ms, of an even 100 Hz" in findings
    assert "missing" not in findings


def test_stamps_rounded_until_they_repeat_are_to_be_left_out(tmp_path):
    stamps = np.float32(2e5 + np.arange(801) / 100.0)
    with h5py.File(tmp_path / "log.h5", "w") as file:
        for name, values in (("time", stamps), ("voltage", np.ones(801)), ("speed", np.ones(801))):
            file[name] = values
    assert "write time = { rate = ... }" in draft_campaign([tmp_path / "log.h5"], tmp_path)
