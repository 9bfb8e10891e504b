import numpy as np
import polars as pl
import pytest

from swashplate import InputError, maneuvers
from swashplate.logs import TextOptions


def test_recorded_holds_the_previous_row():
    m = maneuvers.recorded([5.0, 6.0, 8.0], [1.0, 3.0, -1.0], interpolation="previous")
    assert m.length == 3.0
    assert m([0.0, 0.999, 1.0, 2.999, 3.0]).tolist() == [1.0, 1.0, 3.0, 3.0, -1.0]
    assert not m.slope([0.0, 1.0, 2.0, 3.0]).any()


def test_recorded_joins_its_rows():
    m = maneuvers.recorded([0.0, 1.0, 3.0], [1.0, 3.0, -1.0], interpolation="linear")
    assert m([0.0, 0.5, 1.0, 2.0, 3.0]).tolist() == [1.0, 2.0, 3.0, 1.0, -1.0]
    assert m.slope([0.0, 0.5, 1.0, 2.0, 3.0]).tolist() == [2.0, 2.0, -2.0, -2.0, -2.0]


def test_recorded_gives_back_its_rows_at_their_stamps():
    # 3·0.1 is more than 3/10: the row must be found all the same.
    log = pl.DataFrame({"time": np.arange(50) * 0.1, "voltage": np.arange(50.0)})
    m = maneuvers.recorded(log["time"], log["voltage"], interpolation="previous")
    assert m.sample(10.0).tolist() == log["voltage"].to_list()


def test_recorded_keeps_a_copy():
    voltage = np.array([1.0, 2.0])
    m = maneuvers.recorded([0.0, 1.0], voltage, interpolation="linear")
    voltage[:] = 7.0
    assert m(0.0) == 1.0


def test_recorded_wants_to_be_told_how_to_interpolate():
    with pytest.raises(TypeError, match="interpolation"):
        maneuvers.recorded([0, 1], [0, 1])


def test_recorded_can_end_at_a_whole_sample():
    m = maneuvers.recorded([0.0, 1.0, 1.37], [1.0, 2.0, 3.0], interpolation="previous", length=1.5)
    assert m.sample(10.0).tolist() == [1.0] * 10 + [2.0] * 4 + [3.0] * 2
    cut = maneuvers.recorded([0.0, 1.37], [1.0, 3.0], interpolation="previous", length=1.0)
    assert cut.sample(10.0).tolist() == [1.0] * 11


def test_recorded_file(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t [ms],stick [mV]\n0,0\n500,4000\n2000,-1500\n", "utf-8")
    m = maneuvers.recorded_file(path, interpolation="linear", column="stick", time_column="t")
    assert m.name == "log.csv"
    assert m.length == 2.0
    assert m([0.25, 2.0]).tolist() == [2.0, -1.5]


def test_recorded_file_with_options(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time;voltage\n0;1,250\n1;2,500\n", "utf-8")
    options = TextOptions(decimal=",")
    m = maneuvers.recorded_file(path, interpolation="previous", options=options)
    assert m([0.0, 1.0]).tolist() == [1.25, 2.5]


def test_a_manoeuvre_of_months_is_refused():
    with pytest.raises(InputError, match=r"5\.12e\+09 samples, more than the 1e\+08"):
        maneuvers.rest(1e7).sample(512.0)
