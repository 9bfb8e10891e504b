"""Files of ships that are damaged, or have numbers that no ship has: each ends in one sentence."""

import time
from math import inf, nan

import h5py
import numpy as np
import pytest
from tests.fuzz.seeds import MOTIONS, capytaine, ship_table_lines, wamit_lines

from swashplate.crane import Seaway, read_ship, ship_motion
from swashplate.errors import FileError, InputError, SwashplateError
from swashplate.logs import subprocess_reader

WAVES = [(heading, omega) for heading in (0.0, 90.0, 180.0) for omega in (0.1, 0.2, 0.5)]


@pytest.fixture
def refused(tmp_path):
    """The sentence that a file of some lines ends in."""

    def sentence(lines, suffix=".csv", error=FileError):
        path = tmp_path / f"ship{suffix}"
        path.write_text("\n".join(lines), "utf-8")
        with pytest.raises(error) as raised:
            read_ship(path, 1.0 if suffix == ".4" else None)
        assert path.name in str(raised.value)
        return str(raised.value)

    return sentence


def check_ending(path, length=None):
    """Read a damaged file: it ends in a sentence that names it, or in finite numbers."""
    sentence = ""
    try:
        ship = read_ship(path, length)
    except SwashplateError as error:
        sentence = str(error)
    if sentence:
        assert path.name in sentence
        assert sentence.endswith(".")
        assert sentence.isprintable()
    else:
        assert np.isfinite(ship.values).all()
        assert np.isfinite(ship.frequencies).all()


# --- Capytaine ------------------------------------------------------------------------------------


@pytest.fixture
def ship(tmp_path):
    path = tmp_path / "ship.nc"
    capytaine(path, np.linspace(0.0, 180.0, 7).tolist(), np.linspace(0.1, 1.5, 10).tolist())
    return path


# of HDF5 1.14: these flips make its library go round in circles, or leave objects half made
FLIPS = [(2408, 0x80), (2432, 0x20), (2480, 0x20), (1160, 0x20), (1208, 0x08), (6600, 0x08)]


@pytest.mark.slow
@pytest.mark.parametrize(("place", "bit"), FLIPS)
def test_a_flipped_bit_ends_in_a_sentence_in_time(ship, monkeypatch, place, bit):
    read_ship(ship)  # starts the process, which takes its time on a busy machine
    monkeypatch.setattr(subprocess_reader, "_PATIENCE", 2.0)
    content = bytearray(ship.read_bytes())
    content[place] ^= bit
    ship.write_bytes(content)
    begun = time.monotonic()
    check_ending(ship)
    assert time.monotonic() - begun < 20.0


@pytest.mark.slow
def test_the_first_file_ends_in_the_time_that_is_stated(ship, monkeypatch):
    """30 s, here 3 s, and 1 s for each MB, the start of the process included."""
    assert subprocess_reader._PATIENCE == 30.0
    monkeypatch.setattr(subprocess_reader, "_PATIENCE", 3.0)
    monkeypatch.setattr(subprocess_reader._ReaderProcess, "running", None)
    content = bytearray(ship.read_bytes() + bytes(2_000_000))
    content[2408] ^= 0x80  # goes round in circles
    ship.write_bytes(content)
    begun = time.monotonic()
    with pytest.raises(FileError, match="could not be read within 5 s"):
        read_ship(ship)
    assert 4.5 < time.monotonic() - begun < 8.0


@pytest.mark.slow
def test_flipped_bits_end_in_a_sentence_or_in_numbers(ship, monkeypatch):
    read_ship(ship)
    monkeypatch.setattr(subprocess_reader, "_PATIENCE", 2.0)
    whole, random = ship.read_bytes(), np.random.default_rng(34)
    written = np.flatnonzero(np.frombuffer(whole, np.uint8))
    for place in random.choice(written, 100):
        content = bytearray(whole)
        content[place] ^= 1 << random.integers(8)
        ship.write_bytes(content)
        check_ending(ship)


def test_objects_of_another_kind_are_refused(ship):
    with h5py.File(ship, "a") as file:
        del file["RAO"]
        file.create_group("RAO")
    with pytest.raises(FileError, match=r"ship\.nc .*RAO"):
        read_ship(ship)


def test_frequencies_at_the_limits_are_refused(ship):
    for limit in (0.0, inf):
        with h5py.File(ship, "a") as file:
            file["omega"][-1] = limit
        with pytest.raises(FileError, match=rf"ship.nc: omega .* {limit:g} .* 0.001 to 100"):
            read_ship(ship)


def test_a_folder_and_no_file_are_refused(tmp_path):
    (tmp_path / "ship.nc").mkdir()
    with pytest.raises(FileError, match="ship.nc .* folder"):
        read_ship(tmp_path / "ship.nc")
    with pytest.raises(FileError, match=r"none\.nc"):
        read_ship(tmp_path / "none.nc")


# --- text -----------------------------------------------------------------------------------------


def test_a_quotation_mark_that_is_never_closed_is_refused(refused):
    lines = ship_table_lines(WAVES)
    long = [lines[0], '"' + lines[1], *["x" * 100] * 2000]
    assert "quotation mark" in refused(long)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".csv", ".4"])
def test_waves_on_no_grid_are_refused_before_it_is_made(refused, suffix):
    count = 9000
    waves = list(
        zip(
            np.linspace(0.0, 180.0, count).tolist(),
            np.linspace(0.1, 2.0, count).tolist(),
            strict=True,
        )
    )
    lines = ship_table_lines(waves) if suffix == ".csv" else wamit_lines(waves)
    begun = time.process_time()
    sentence = refused(lines, suffix)
    assert time.process_time() - begun < 10.0  # 28 s for 6000 waves, when the grid was made
    for number in ("54000 of the 486000000 amplitudes", "9000 headings and 9000 frequencies"):
        assert number in sentence
    assert "surge for 0.1" in sentence


@pytest.mark.parametrize(
    ("column", "number", "expected"),
    [
        ("period", "5e-324", "0.06 to 6300"),
        ("period", "-1", "0.06 to 6300"),
        ("heading", "1e308", "-720 to 720"),
        ("motion", "5.7", "whole number from 1 to 6"),
        ("motion", "0", "whole number from 1 to 6"),
        ("motion", "-3", "whole number from 1 to 6"),
        ("motion", "7", "whole number from 1 to 6"),
        ("real part", "1e308", "-10000 to 10000"),
        ("imaginary part", "1_0", "-10000 to 10000"),
    ],
)
def test_numbers_of_wamit_that_no_ship_has_are_refused(refused, column, number, expected):
    names = ["period", "heading", "motion", "modulus", "phase", "real part", "imaginary part"]
    lines = wamit_lines(WAVES)
    cells = lines[4].split()
    cells[names.index(column)] = number
    lines[4] = " ".join(cells)
    sentence = refused(lines, ".4")
    for item in (f"line 5: {column} ", f"'{number}'", expected):
        assert item in sentence


@pytest.mark.parametrize("column", ["heading_deg", "omega", "heave_re", "yaw_im"])
@pytest.mark.parametrize("number", ["1e308", "-1e308", "nan"])
def test_numbers_of_a_table_that_no_ship_has_are_refused(refused, column, number):
    lines = ship_table_lines(WAVES)
    cells = lines[3].split(",")
    cells[lines[0].split(",").index(column)] = number
    lines[3] = ",".join(cells)
    sentence = refused(lines)
    assert f"line 4: {column} " in sentence
    assert f"'{number}'" in sentence


def pitching(lowest, factor=1.0):
    """Lines of a ship that follows the waves from a frequency on, [rad/s], with its rotations."""
    names = ["heading_deg", "omega", *(f"{m}_{p}" for m in MOTIONS for p in ("re", "im"))]
    lines = [",".join(names)]
    for heading in (0.0, 90.0, 180.0):
        for omega in np.linspace(lowest, 3.0, 24):
            slope = factor * omega**2 / 9.80665
            along, across = np.cos(np.radians(heading)), np.sin(np.radians(heading))
            motion = [0, -along, 0, -across, 1, 0, 0, -slope * across, 0, slope * along, 0, 0]
            lines.append(",".join(map(repr, map(float, (heading, omega, *motion)))))
    return lines


@pytest.mark.parametrize("lowest", [0.2, 0.3, 0.4, 0.45, 0.8])
def test_rotations_in_degrees_are_refused_wherever_the_file_begins(tmp_path, refused, lowest):
    sentence = refused(pitching(lowest, np.degrees(1.0)), error=InputError)
    assert "rotations must be in rad" in sentence
    path = tmp_path / "good.csv"
    path.write_text("\n".join(pitching(lowest)), "utf-8")
    unchecked = "could not be checked" in " ".join(read_ship(path).unchecked.split())
    assert unchecked == (lowest >= 0.4)
    if lowest == 0.4:
        said = " ".join(Seaway("ss3", ship=read_ship(path)).sentences())
        assert "axes and phases could not be checked" in said


@pytest.mark.parametrize("length", [1e-300, 1e300, nan, -175.0])
def test_lengths_of_wamit_that_no_ship_has_are_refused(tmp_path, length):
    path = tmp_path / "ship.4"
    path.write_text("\n".join(wamit_lines(WAVES)), "utf-8")
    with pytest.raises(InputError, match=r"ship.4: .* ULEN .* 0.01 to 10000 m"):
        read_ship(path, length)


def test_counts_of_veres_are_whole(refused):
    lines = ["VERES", *["text"] * 8, "1 1.5 1 6", "0", "0", "0.5"]
    sentence = refused(lines, ".re1")
    assert "line 10: headings " in sentence
    assert "'1.5'" in sentence


def test_text_at_random_ends_in_a_sentence_or_in_numbers(tmp_path):
    random = np.random.default_rng(7)
    cells = ["", "nan", "-1", "0", "1e308", "5e-324", "7.5", '"', "6", "x", "180", "1e9", "\0", "µ"]
    for suffix, lines in ((".csv", ship_table_lines(WAVES)), (".4", wamit_lines(WAVES))):
        separator = "," if suffix == ".csv" else " "
        for _ in range(150):
            changed = list(lines)
            for _ in range(random.integers(1, 4)):
                row = int(random.integers(len(changed)))
                words = changed[row].split(separator)
                words[int(random.integers(len(words)))] = str(random.choice(cells))
                changed[row] = separator.join(words)
            if random.random() < 0.2:
                del changed[int(random.integers(1, len(changed))) :]
            path = tmp_path / f"ship{suffix}"
            path.write_text("\n".join(changed), "utf-8")
            check_ending(path, 1.0 if suffix == ".4" else None)


# --- measured motion ------------------------------------------------------------------------------


@pytest.fixture
def log(tmp_path):
    """A log of one motion over time."""

    def written(time_, values, column="roll [rad]"):
        path = tmp_path / "log.csv"
        rows = [f"{t!r};{x!r}" for t, x in zip(list(time_), list(values), strict=True)]
        path.write_text("\n".join([f"time [s];{column}", *rows]), "utf-8")
        return path

    return written


TIME = np.arange(0.0, 60.0, 0.5).tolist()
ROLL = (0.1 * np.sin(0.6 * np.array(TIME))).tolist()


@pytest.mark.parametrize("rate", [nan, inf, 0.0, -1.0, 1e9, "512"])
def test_rates_out_of_range_are_refused(log, rate):
    with pytest.raises(InputError, match="rate .* 10 to 100000 Hz"):
        ship_motion(log(TIME, ROLL), {"roll": "roll"}, rate=rate)


def test_motions_that_last_too_long_or_are_sampled_too_seldom_are_refused(log):
    seldom = (1e7 * np.arange(6)).tolist()
    with pytest.raises(InputError, match=r"log.csv: .* roll .* 1e\+07 s"):
        ship_motion(log(seldom, ROLL[:6]), {"roll": "roll"})
    long = np.arange(0.0, 40_000.0, 4.0).tolist()
    with pytest.raises(InputError, match=r"log.csv .* 39996 s: .* 512 Hz .* rate"):
        ship_motion(log(long, [0.0] * len(long)), {"roll": "roll"})


def test_sizes_that_no_ship_has_are_refused_by_their_samples(log):
    values = list(ROLL)
    values[50] = 1e308
    with pytest.raises(InputError, match=r"log.csv: roll .* 1e\+308 rad"):
        ship_motion(log(TIME, values), {"roll": "roll"})
    with pytest.raises(InputError, match=r"log.csv: heave .* 1e\+308 m"):
        ship_motion(log(TIME, values, "heave [m]"), {"heave": "heave"})


def test_a_spike_and_stamps_nearly_alike_are_refused_by_their_rows(log):
    time_, values = list(TIME), list(ROLL)
    time_.insert(41, time_[40] + 1e-9)
    values.insert(41, 0.3)
    with pytest.raises(InputError, match=r"log.csv: .* rows 41 and 42 .* 1e-09 s"):
        ship_motion(log(time_, values), {"roll": "roll"})
    time_[41] = time_[40] + 2e-3
    with pytest.raises(InputError, match=r"log.csv: .* roll .* row 4\d"):
        ship_motion(log(time_, values), {"roll": "roll"})


def test_a_motion_that_stands_is_one(log):
    made = ship_motion(log(TIME, [0.1] * len(TIME)), {"roll": "roll"}, rate=10.0)
    np.testing.assert_allclose(made[:, MOTIONS.index("roll")], 0.1, atol=1e-12)
