"""Separators of thousands: read if they are stated, refused if they may be a decimal sign."""

import numpy as np
import pytest

from swashplate.errors import FileError, InputError
from swashplate.logs import TextOptions, open_log

SPEED = np.arange(480.0, 1680.0, 4.0)


def grouped(number, mark, decimals=0, decimal="."):
    """A number with a mark between thousands."""
    text = f"{number:,.{decimals}f}"
    return text.replace(",", "?").replace(".", decimal).replace("?", mark)


def write(path, delimiter, text_of, time="{:d}", first=0):
    """A log of time and speed; a cell that holds the delimiter is quoted."""
    lines = [delimiter.join(["time_ms", "stick", "speed_rpm"])]
    for row, speed in enumerate(SPEED[first:]):
        cell = text_of(speed)
        cell = f'"{cell}"' if delimiter in cell else cell
        lines.append(delimiter.join([time.format(row), str(row % 9), cell]))
    path.write_text("\n".join(lines), "utf-8")
    return path


WRITTEN = {
    # delimiter, mark, decimals, decimal sign, time: as programs of these countries write
    "US, quoted": (",", ",", 0, ".", "{:d}"),
    "US, tabs": ("\t", ",", 0, ".", "{:d}"),
    "US, fractions": (",", ",", 2, ".", "{:.3f}"),
    "US, whole beside fractions": (",", ",", 0, ".", "{:.3f}"),
    "German, tabs": ("\t", ".", 0, ",", "{:d}"),
    "German, semicolons": (";", ".", 0, ",", "{:d}"),
    "German, fractions": (";", ".", 1, ",", "{:d}"),
    "Swiss": (";", "'", 2, ".", "{:d}"),
    "Swiss, typographic": (";", "\u2019", 0, ".", "{:d}"),
    "French, narrow space": (";", "\u202f", 2, ",", "{:d}"),
    "French, no-break space": ("\t", "\u00a0", 0, ",", "{:d}"),
    "space": (";", " ", 1, ",", "{:d}"),
}
OPTION = {"\u2019": "'", "\u202f": "space", "\u00a0": "space", " ": "space"}


@pytest.mark.parametrize("first", [0, 200], ids=["from 480 on", "all above 1000"])
@pytest.mark.parametrize("written", WRITTEN)
def test_thousands_are_refused_or_read_as_stated(tmp_path, written, first):
    delimiter, mark, decimals, decimal, time = WRITTEN[written]
    option = OPTION.get(mark, mark)
    log = write(
        tmp_path / "log.csv",
        delimiter,
        lambda speed: grouped(speed, mark, decimals, decimal),
        time,
        first,
    )
    with pytest.raises(FileError, match="thousands = ") as refused:
        open_log(log).read(["speed_rpm"])
    assert f'thousands = "{option}"' in str(refused.value)
    read = open_log(log, options=TextOptions(thousands=option)).read(["time_ms", "speed_rpm"])
    np.testing.assert_array_equal(read["speed_rpm"], SPEED[first:])
    np.testing.assert_array_equal(read["time_ms"], np.arange(SPEED.size - first))


def test_thousands_far_below_the_first_rows_are_refused(tmp_path):
    # whole numbers below 1000 for longer than the rows that tell the layout
    numbers = [*range(900), *range(1000, 1003), *range(900)]
    lines = ["time\tspeed", *(f"{row}\t{grouped(n, '.')}" for row, n in enumerate(numbers))]
    (tmp_path / "log.txt").write_text("\n".join(lines), "utf-8")
    log = open_log(tmp_path / "log.txt")
    with pytest.raises(FileError, match=r"'speed' holds '1\.000' in data row 901 \(line 902\)"):
        log.read(["speed"])
    assert log.read(["time"])["time"].size == 1803
    log = open_log(tmp_path / "log.txt", options=TextOptions(decimal="."))
    assert log.read(["speed"])["speed"][900] == 1.0


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
@pytest.mark.parametrize(
    "text_of",
    [
        lambda speed: f"{speed / 500:.3f}",  # 0.960 first
        lambda speed: f"{speed / 500:g}",
        lambda speed: f"{speed:.0f}",
        lambda speed: f"{speed:.4f}",
    ],
)
def test_decimal_points_are_read_as_before(tmp_path, delimiter, text_of):
    log = write(tmp_path / "log.csv", delimiter, text_of)
    expected = [float(text_of(speed)) for speed in SPEED]
    np.testing.assert_array_equal(open_log(log).read(["speed_rpm"])["speed_rpm"], expected)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"thousands": ";"}, "thousands must be one of"),
        ({"thousands": ",", "decimal": ","}, "cannot both be ','"),
    ],
)
def test_options_that_make_no_sense(options, said):
    with pytest.raises(InputError, match=said):
        TextOptions(**options)
