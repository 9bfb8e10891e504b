import numpy as np
import polars as pl
import pytest

from swashplate import Drive, Limit, maneuvers
from swashplate.analysis import outcomes


def test_a_step_prints_the_known_speeds(done, number):
    text = done("simulate", "hoist", "step:9")
    assert "hoist, step 9 V: 5121 samples at 512 Hz, 10 s" in text
    assert number(text, "peak speed, positive") == 196.00
    assert number(text, "peak speed, negative") == 0.0
    assert number(text, "speed at the end") == 3.09  # the hoist creeps at 0 V


def test_the_table_says_what_the_simulation_says(done, number):
    text = done("simulate", "hoist", "sine:9,0.1")
    run = Drive.preset("hoist").simulate(maneuvers.sine(9.0, 0.1).sample())
    travelled = np.degrees(run.shaft_position[-1])
    assert number(text, "peak speed, negative") == pytest.approx(-185.00, abs=0.01)
    assert number(text, "position at the end") == pytest.approx(travelled, abs=0.05)
    assert number(text, "peak current, positive") == pytest.approx(run.current.max(), abs=5e-5)
    assert number(text, "peak current, negative") == pytest.approx(run.current.min(), abs=5e-5)
    stopped = 100.0 * np.mean(run.active(Limit.SWASH_STOP))
    assert number(text, "swash stop") == pytest.approx(stopped, abs=0.05)
    assert "relief         " in text
    assert "never" in text


def test_the_dead_zone_holds_nothing_back_at_rest(done, number):
    still = done("simulate", "hoist", "rest:1")
    assert next(line for line in still.splitlines() if "dead zone" in line).endswith("never")
    moved, judged = done("simulate", "hoist", "step:9"), done("limits", "hoist", "step:9")
    share = number(moved, "dead zone")
    assert share == number(judged, "dead zone")
    run = Drive.preset("hoist").simulate(maneuvers.step(9.0).sample())
    held = run.active(Limit.DEAD_ZONE)
    # half the record is after the step, at 0 V and within the dead zone
    assert share < 1.0 < 100.0 * held.mean()


def test_a_test_of_the_source_by_its_name(done, number):
    text = done("simulate", "hoist", "step -9 V")
    assert "hoist, step -9 V" in text
    assert number(text, "peak speed, negative") == -185.00


@pytest.mark.parametrize(
    ("start", "speed"),
    [("rest", 0.0), ("steady", 3.09)],
)
def test_start(done, start, speed):
    done("simulate", "hoist", "rest:1", "--start", start, "--out", "run.csv")
    first = np.degrees(pl.read_csv("run.csv")["shaft_speed"][0])
    assert first == pytest.approx(speed, abs=0.005)


def test_rate(done):
    text = done("simulate", "slew", "step:4", "--rate", "100", "--out", "run.csv")
    assert "1001 samples at 100 Hz" in text
    table = pl.read_csv("run.csv")
    assert table["time"][1] == 0.01


@pytest.mark.parametrize("name", ["run.csv", "run.parquet"])
def test_out_writes_every_signal(done, name):
    text = done("simulate", "hoist", "step:9", "--out", name)
    assert f"All signals, in SI: {name}" in text
    table = pl.read_csv(name) if name.endswith(".csv") else pl.read_parquet(name)
    expected = Drive.preset("hoist").simulate(maneuvers.step(9.0).sample()).to_polars()
    assert table.columns == expected.columns
    for column in ("time", "voltage", "current", "stroker_pressure", "shaft_position"):
        np.testing.assert_array_equal(table[column], expected[column])


def test_out_writes_over_an_older_file(done, tmp_path):
    (tmp_path / "run.csv").write_text("old")
    done("simulate", "hoist", "rest:1", "--out", "run.csv")
    assert pl.read_csv("run.csv").height == 513


def test_plot(done, tmp_path):
    text = done("simulate", "hoist", "step:9", "--plot", "step.png")
    assert "Figure: step.png" in text
    assert (tmp_path / "step.png").read_bytes().startswith(b"\x89PNG")
    assert [path.name for path in tmp_path.iterdir()] == ["step.png"]


@pytest.mark.parametrize(
    ("words", "changes"),
    [
        (("--set", "Z16=1.2e-4"), {"Z16": 1.2e-4}),
        (("--set", "Z16=1.2e-4/1.5e-4"), {"Z16": (1.2e-4, 1.5e-4)}),
        (("--set", "Z16=.12/.15mm"), {"Z16": (1.2e-4, 1.5e-4)}),
        (("--set", "Z16_plus=0.12mm"), {"Z16_plus": 1.2e-4}),
        (("--set", "Z16 = 0.12 mm"), {"Z16": 1.2e-4}),
        (("--set", "Z9=90 bar", "--set", "tau=20ms"), {"Z9": 9e6, "tau": 0.02}),
        (("--set", "Z10=744 1/min"), {"Z10": 12.4}),
        (("--set", "lim1=5A/s"), {"lim1": 5.0}),
        (("--set", "Z16_minus=inf"), {"Z16_minus": np.inf}),
        (("--scale", "Z10=1.5"), {"Z10": 1.5 * 12.396}),
        (("--scale", "Z13=0.5/0.25"), {"Z13": (0.5 * 0.27596, 0.25 * 0.26047)}),
        (("--set", "Z10=10", "--scale", "Z10=1.5"), {"Z10": 15.0}),
    ],
)
def test_set_and_scale(done, words, changes):
    done("simulate", "hoist", "sine:9,0.1", *words, "--out", "run.parquet")
    drive = Drive.preset("hoist").replace(**changes)
    expected = drive.simulate(maneuvers.sine(9.0, 0.1).sample())
    speed = pl.read_parquet("run.parquet")["shaft_speed"].to_numpy()
    np.testing.assert_allclose(speed, expected.shaft_speed, rtol=1e-9, atol=1e-12)


def test_a_scaled_gain_scales_the_speed(done, number):
    text = done("simulate", "hoist", "step:9", "--scale", "Z10=0.5")
    assert number(text, "peak speed, positive") == 98.00


def test_an_own_set(done, number, tmp_path):
    Drive.preset("hoist").scale(Z10=2.0).renamed("mine").to_toml(tmp_path / "mine.toml")
    text = done("simulate", "mine.toml", "step:9")
    assert text.startswith("mine, step 9 V")
    assert number(text, "peak speed, positive") == pytest.approx(391.99, abs=0.01)


def test_a_start_of_own_axis_keeps_the_tests_of_the_source(done, tmp_path):
    (tmp_path / "mine.toml").write_text(done("show", "hoist", "--toml"), "utf-8")
    assert "mine.toml (hoist), step +9 V" in done("simulate", "mine.toml", "step +9 V")


def test_changes_are_said(done):
    text = done("simulate", "hoist", "step:9", "--set", "Z16=0.18mm", "--scale", "Z10=1.5")
    said = "Z16 (opening at which the orifice limits the flow): 0.00011634/0.00015126 -> "
    assert f"{said}0.00018/0.00018 m" in " ".join(text.split())
    assert "Z10 (swash plate angle to shaft speed): 12.396 -> 18.594 1/s" in " ".join(text.split())
    assert "Z17" not in text


def test_clip(done, number):
    clipped = done("simulate", "hoist", "step:14", "--clip")
    assert "hoist, step 14 V" in clipped
    full = done("simulate", "hoist", "step:10")
    assert clipped.splitlines()[1:] == full.splitlines()[1:]


@pytest.mark.parametrize("words", [("step:9",), ("sine:6.5,0.1", "--plot", "a.png")])
def test_nothing_is_wider_than_80_columns_or_coloured(done, words):
    text = done("simulate", "hoist", *words)
    assert max(map(len, text.splitlines())) <= 80
    assert "\x1b" not in text


def test_the_first_lag_of_a_straight_line_is_read_off_the_speed():
    # 1 V on the neutral drive: a lag of 0.1 s, so 90 % after 0.1 ln 10 s, and the card's two
    # milliseconds twice
    drive = Drive.preset("neutral")
    run = drive.simulate(maneuvers.step(1.0).sample(10_240.0), 10_240.0)
    time = outcomes.time_to_reach(run, 1.0)
    assert time == pytest.approx(0.1 * np.log(10.0) + 2.0 / 512.0, abs=5e-4)
    assert outcomes.time_to_reach(run, 2.0) is None
    assert outcomes.time_to_reach(run, 0.0) is None


def test_peaks_of_what_never_goes_one_way():
    assert outcomes.peaks(np.array([-3.0, -1.0])) == (0.0, -3.0)
    assert outcomes.peaks(np.array([2.0])) == (2.0, 0.0)
