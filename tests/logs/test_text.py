"""How text is written: delimiters, decimal signs, headers, units, comments, encodings."""

import math

import numpy as np
import pytest

from swashplate import FileError, InputError
from swashplate.logs import LogColumn, TextOptions, open_log

ROWS = {"time": [0.0, 0.5], "voltage": [1.5, 2.5]}


@pytest.mark.parametrize(
    ("content", "form"),
    [
        ("time,voltage\n0,1.5\n0.5,2.5\n", "CSV, commas, decimal point"),
        ("time,voltage\r\n0,1.5\r\n0.5,2.5\r\n", "CSV, commas, decimal point"),
        ("time,voltage\r0,1.5\r0.5,2.5\r", "CSV, commas, decimal point"),
        ("time,voltage\n0,1.5\n0.5,2.5", "CSV, commas, decimal point"),
        ("time , voltage\n 0 , 1.5 \n 0.5 , 2.5 \n", "CSV, commas, decimal point"),
        ("time;voltage\n0;1.5\n0.5;2.5\n", "CSV, semicolons, decimal point"),
        ("time;voltage\n0;1,5\n0,5;2,5\n", "CSV, semicolons, decimal comma"),
        ("time\tvoltage\n0\t1.5\n0.5\t2.5\n", "CSV, tabs, decimal point"),
        ("time\tvoltage\n0\t1,5\n0,5\t2,5\n", "CSV, tabs, decimal comma"),
        ("time voltage\n0 1.5\n0.5 2.5\n", "CSV, spaces, decimal point"),
        ("  time  \t voltage\n  0    1.5  \n  0.5\t2.5\n", "CSV, spaces, decimal point"),
        ("time voltage\n0,0 1,5\n0,5 2,5\n", "CSV, spaces, decimal comma"),
        ("time|voltage\n0|1.5\n0.5|2.5\n", "CSV, bars, decimal point"),
        ('"time","voltage"\n"0","1.5"\n"0.5","2.5"\n', "CSV, commas, decimal point"),
        ('"time","voltage"\n"0,0","1,5"\n"0,5","2,5"\n', "CSV, commas, decimal comma"),
        ("time,voltage\n+0e0,.15e1\n5.E-1,2.5e+00\n", "CSV, commas, decimal point"),
        ("# time,voltage\n0,1.5\n0.5,2.5\n", "CSV, commas, decimal point"),
        (
            "% by hand\n\ntime,voltage\n\n0,1.5\n// a pause\n\n0.5,2.5\n\n",
            "CSV, commas, decimal point",
        ),
        (
            "Hoist, harbour\nRate\t512\n\ntime\tvoltage\n0\t1.5\n0.5\t2.5\n",
            "CSV, tabs, decimal point",
        ),
        ("time;voltage;\n0;1,5;\n0,5;2,5;\n", "CSV, semicolons, decimal comma"),
        ("time;voltage\n0;1,5;\n0,5;2,5;\n", "CSV, semicolons, decimal comma"),
        ("time,voltage\n0,1.5\n0.5,2.5\n\x1a", "CSV, commas, decimal point"),
    ],
)
def test_layout_is_told_from_the_rows(text, all_of, content, form):
    log = text(content)
    assert log.format == form
    read = all_of(log)
    assert {name: read[name] for name in ROWS} == ROWS


@pytest.mark.parametrize(
    ("encoding", "said"),
    [("utf-8", ""), ("utf-8-sig", ""), ("utf-16", ", UTF-16"), ("latin-1", ", Latin-1")],
)
def test_encodings(text, all_of, encoding, said):
    log = text("time [µs];α\n0;1,5\n0,5;2,5\n".replace("α", "é"), encoding=encoding)
    assert log.columns == (LogColumn("time [µs]", "µs"), LogColumn("é"))
    assert log.format == f"CSV, semicolons, decimal comma{said}"
    assert all_of(log) == {"time [µs]": [0.0, 0.5], "é": [1.5, 2.5]}


def test_an_encoding_that_must_be_given(text, all_of):
    log = text("α,β\n0,1.5\n", encoding="iso8859-7")
    assert [column.name for column in log.columns] == ["á", "â"]  # as Latin-1, for want of better
    for names, encoding in (("αβ", "iso8859-7"), ("あい", "cp932")):
        content = f"{','.join(names)}\n0,1.5\n".encode(encoding)
        log = open_log(text(content).path, options=TextOptions(encoding=encoding))
        assert all_of(log) == {names[0]: [0.0], names[1]: [1.5]}


@pytest.mark.parametrize(
    ("content", "units"),
    [
        ("time [s],voltage (mV),n\n0,1.5,2\n", ["s", "mV", None]),
        ("time,voltage,n\ns,mV,-\n0,1.5,2\n", ["s", "mV", "-"]),
        ("time,voltage,n\n[s],[mV],\n0,1.5,2\n", ["s", "mV", None]),
        ("time,voltage,n\ns,mV,1\n0,1.5,2\n", ["s", "mV", "1"]),
        ("time,speed,pressure\nms,1/min,N/mm²\n0,1.5,2\n", ["ms", "1/min", "N/mm²"]),
        ("t;u;n\ns;V;U/min\n0;1,5;2\n", ["s", "V", "U/min"]),
        ("t;u;n\ns;V;tr/min\n0;1,5;2\n", ["s", "V", "tr/min"]),
        ("time [s] voltage [mV]\n0 1.5\n", ["s", "mV"]),
        ("# time,voltage\n# s,mV\n0,1.5\n", ["s", "mV"]),
        ("time_ms,voltage_mV\n0,1.5\n", [None, None]),
    ],
)
def test_units_of_the_header(text, content, units):
    assert [column.unit for column in text(content).columns] == units


def test_missing_and_infinite_numbers(text):
    nan, inf = math.nan, math.inf
    marks = ["", " ", "NaN", "nan", "-NAN", "n/a", "#N/A", "null", "1.#QNAN", "-1.#IND"]
    for words, expected in (
        ([*marks, "-nan(ind)", "1"], [nan] * 11 + [1.0]),
        # no mark of a comment among them
        (["1", "", "n/a", "inf", "--", "-Infinity", " "], [1.0, nan, nan, inf, nan, -inf, nan]),
        (["inf", "-Infinity", "1.#INF", "-1.#INF", "1"], [inf, -inf, inf, -inf, 1.0]),
    ):
        log = text("time,u,n\n" + "".join(f"{i},{w},{w}\n" for i, w in enumerate(words)))
        for numbers in log.read(["u", "n"]).values():
            np.testing.assert_array_equal(numbers, expected)


def test_only_what_is_asked_for_must_be_numbers_and_quotes_may_hold_delimiters(text):
    log = text('time,"note, left",voltage\n0,"on, off",1\n1,,2\n')
    assert log.columns[1].name == "note, left"
    assert log.read(["voltage"])["voltage"].tolist() == [1.0, 2.0]
    with pytest.raises(FileError, match="'on, off', .* row 1"):
        log.read(["note, left"])


@pytest.mark.parametrize(
    ("content", "options", "expected"),
    [
        ("0,1\n1,2\n", {"delimiter": ","}, {"column 1": [0.0, 1.0], "column 2": [1.0, 2.0]}),
        ("a;b\n1,234;5\n", {"decimal": ","}, {"a": [1.234], "b": [5.0]}),
        ("a~b\n1~2\n", {"delimiter": "~"}, {"a": [1.0], "b": [2.0]}),
        ("a\tb\n1\t2\n", {"delimiter": "tab"}, {"a": [1.0], "b": [2.0]}),
        ("a b\n1 2\n", {"delimiter": "space"}, {"a": [1.0], "b": [2.0]}),
        ("! a,b\na,b\n1,2\n! x\n3,4\n", {"comment": "!"}, {"a": [1.0, 3.0], "b": [2.0, 4.0]}),
        ("0,1.5\n0.5,2.5\n", {}, {"column 1": [0.0, 0.5], "column 2": [1.5, 2.5]}),
        ("# by me\n# t u\n0.0 1.0\n1.0 2.0\n", {}, {"t": [0.0, 1.0], "u": [1.0, 2.0]}),
        ("#a,%b\n1,2\n", {"comment": ""}, {"#a": [1.0], "%b": [2.0]}),
        ("1;2\n3;4\n5;6\n", {"header_row": 1}, {"1": [3.0, 5.0], "2": [4.0, 6.0]}),
        ("# 1;2\n3;4\n", {"header_row": 1}, {"1": [3.0], "2": [4.0]}),
        ("a,b\ns,V\n3,4\n", {"header_row": 1}, {"a": [3.0], "b": [4.0]}),
        ("a,b\n1,2\n", {"header_row": 0}, {"column 1": [1.0], "column 2": [2.0]}),
    ],
)
def test_options(text, all_of, content, options, expected):
    assert all_of(text(content, **options)) == expected


@pytest.mark.parametrize(
    "option",
    [("delimiter", ",,"), ("delimiter", "1"), ("decimal", ";"), ("header_row", -1),
     ("encoding", "zlib")],
)  # fmt: skip
def test_options_that_make_no_sense(option):
    with pytest.raises(InputError, match=option[0]):
        TextOptions(**dict([option]))


@pytest.mark.slow
def test_a_large_file_is_read_in_pieces(tmp_path, text, all_of, monkeypatch):
    monkeypatch.setattr("swashplate.logs.text.PIECE", 64)
    rows = "".join(f"{i},{i}.5\r\n" for i in range(200))
    expected = {"time": [float(i) for i in range(200)], "u": [i + 0.5 for i in range(200)]}
    assert all_of(text("time,u\r\n" + rows)) == expected
    assert all_of(text("time,u\r\n" + rows, encoding="utf-16")) == expected
    ended = "time,u\r\n" + rows.rstrip()
    for spare in range(64):  # the mark of the end is in a block of its own, once
        content = ended + " " * spare + "\x1a"
        assert all_of(text(content)) == expected
    paused = rows.replace("\r\n7,", "\r\n\r\n# pause, here\r\n7,")
    assert all_of(text("time,u\r\n" + paused)) == expected
    with pytest.raises(FileError, match=r"'u' .*'x', .* row 151 \(line 152\)"):
        all_of(text("time,u\r\n" + rows.replace("150.5", "x")))
