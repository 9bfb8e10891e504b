import polars as pl
import pytest

FEW = ("--lever", "pump", "--lever", "orifice=0.8/1.5", "--maneuver", "step:9,stop=4,length=5")


def test_one_at_a_time(done, tmp_path):
    words = ("--outcome", "final_speed", "--plot", "t.png", "--out", "s.csv")
    text = done("sensitivity", "hoist", *FEW, *words)
    assert "final speed, 196.00 deg/s as it is" in text
    (line,) = [line for line in text.splitlines() if line.startswith("pump ")]
    assert line.split() == ["pump", "0.9", "1.1", "176.40", "215.60", "20.0", "%"]
    assert "not moved by orifice" in text
    assert (tmp_path / "t.png").read_bytes().startswith(b"\x89PNG")
    table = pl.read_csv(tmp_path / "s.csv")
    assert table["lever"].to_list() == ["pump", "orifice"]
    assert table["upper factor"].to_list() == [1.1, 1.5]
    assert table["at upper factor"][0] == pytest.approx(1.1 * table["as it is"][0], rel=1e-6)


def test_sobol(done, tmp_path):
    words = ("--outcome", "final_speed", "--outcome", "overshoot", "--sobol", "32")
    text = done("sensitivity", "hoist", *FEW, *words, "--plot", "s.png", "--out", "s.parquet")
    assert "by itself  in total" in text
    assert "- 128 simulations; indices are good to" in text
    assert "- None of the levers moves overshoot." in text
    assert (tmp_path / "s.png").exists()
    table = pl.read_parquet(tmp_path / "s.parquet")
    assert table.height == 4
    speed = table.filter(pl.col("outcome") == "final_speed")
    assert speed["total"][0] == pytest.approx(1.0, abs=0.3)
    assert speed["total"][1] == pytest.approx(0.0, abs=1e-3)
    assert table.filter(pl.col("outcome") == "overshoot")["total"].null_count() == 2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--lever", "pumpe"), "no lever 'pumpe' (did you mean pump?)"),
        (("--lever", "pump=2"), "--lever cannot read 'pump=2'; write it as pump or pump=0.8/1.5"),
        (("--lever", "pump=a/b"), "--lever cannot read 'pump=a/b'"),
        (("--lever", "pump=2/1"), "must rise from 0 or more, not 2 to 1"),
        (("--lever", "pump", "--lever", "pump=1/2"), "--lever gives pump twice"),
        (("--span", "2"), "--span is 2, but must lie between 0 and 1"),
        (("--sobol", "100"), "must be a power of 2"),
        (("--outcome", "speed"), "There is no outcome 'speed'"),
        (("--out", "s.txt"), "a table is written as .csv or .parquet"),
    ],
)
def test_refusals(refused, words, said):
    assert said in refused("sensitivity", "hoist", *words)


def test_a_log_is_a_command(done, tmp_path):
    done("simulate", "hoist", "step:9,stop=4,length=5", "--out", "log.csv")
    words = ("--lever", "pump", "--outcome", "final_speed", "--maneuver", "log.csv")
    text = done("sensitivity", "hoist", *words, "--interpolation", "linear")
    assert "hoist, log.csv" in text
    (line,) = [line for line in text.splitlines() if line.startswith("pump ")]
    assert line.split() == ["pump", "0.9", "1.1", "176.40", "215.60", "20.0", "%"]
