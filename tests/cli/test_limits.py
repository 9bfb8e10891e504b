import shlex

import numpy as np
import polars as pl
import pytest


def test_the_envelope_that_is_printed(done, number):
    """The numbers of the model description."""
    text = done("limits", "hoist", "--frequency", "0.3")
    assert "hoist: what it can do" in text
    for place, (volts, speed, acceleration) in enumerate(
        ((7.87, 196.0, 136.8), (-7.41, -185.0, -177.8))
    ):
        assert number(text, "saturation voltage", place) == volts
        assert number(text, "speed limit", place) == pytest.approx(speed, abs=0.05)
        assert number(text, "acceleration at rest", place) == pytest.approx(acceleration, abs=0.05)
    assert number(text, "creep at 0 V") == pytest.approx(3.09, abs=0.005)
    assert "Largest sine followed within 10 %" in text
    assert number(text, "0.3") > 50.0
    assert text.rstrip().endswith("none")


def test_what_to_change_first(done, number):
    text = done("limits", "luff", "sine:9,0.1")
    assert "luff, sine 9 V 0.1 Hz: 55.889 deg/s rms from a drive without limits" in text
    rows = [line.split("  ")[0] for line in text.splitlines()]
    assert rows.index("orifice") < rows.index("delay") < rows.index("dead zone")
    assert number(text, "orifice") == pytest.approx(69.5)
    assert "spool stop" not in rows  # it does nothing here
    assert "Change first: in-line orifice: larger bore (Z16)." in text
    assert "falls by 96.6 %" in " ".join(text.split())
    assert (
        "\nSee more of it: swashplate whatif luff --scale orifice=1.5 --maneuver sine:9,0.1\n"
        in text
    )


def test_what_is_to_be_tried_is_the_same_command(done, tmp_path):
    done("simulate", "hoist", "step:9,stop=3,length=5", "--out", "a log.csv")
    words = ("a log.csv", "--interpolation", "linear", "--rate", "256")
    tried = done("limits", "hoist", *words).rstrip().splitlines()[-1]
    assert tried.endswith("--maneuver 'a log.csv' --rate 256 --interpolation linear")
    text = done(*shlex.split(tried.removeprefix("See more of it: swashplate ")))
    assert "hoist, a log.csv" in text
    for changed in (("--set", "Z16=1e-4"), ("--start", "steady"), ("--clip",)):
        assert "See more" not in done("limits", "hoist", "step:9,stop=3,length=5", *changed)


def test_nothing_to_change(done):
    text = done("limits", "neutral", "step:9")
    assert "No single change makes the error smaller." in text


def test_a_drive_that_does_not_move_still_has_an_envelope(done):
    text = done("limits", "hoist", "--set", "Z17=5")
    assert "gain, mean" in text
    assert "No sine can be commanded: No positive command up to 10 V moves hoist" in text


def test_changes_are_said_and_count(done, number):
    text = done("limits", "hoist", "--scale", "Z16=1.5", "--scale", "Z10=1.5", "--error", "0.2")
    assert "Z16 (opening at which the orifice limits the flow)" in text
    # figure 9.1: orifice and pump half as large again
    assert number(text, "speed limit") == pytest.approx(294.0, abs=0.5)
    assert "within 20 %" in text


def test_files(done, tmp_path):
    text = done("limits", "slew", "--out", "slew.csv", "--plot", "slew.png")
    assert "Envelope, in SI: slew.csv" in text
    table = pl.read_csv("slew.csv")
    row = table.row(by_predicate=pl.col("quantity") == "speed_limit", named=True)
    assert np.degrees(row["plus"]) == pytest.approx(4.242, abs=5e-4)
    assert (tmp_path / "slew.png").read_bytes().startswith(b"\x89PNG")
    text = done("limits", "slew", "step:9", "--out", "shares.parquet", "--plot", "when.svg")
    assert "Shares of each limit, in SI: shares.parquet" in text
    assert pl.read_parquet("shares.parquet")["limit"][0] == "swash stop"
    assert "<svg" in (tmp_path / "when.svg").read_text()


def test_a_log(done, tmp_path):
    rows = "\n".join(f"{t / 10},{9 if 10 <= t < 60 else 0}" for t in range(100))
    (tmp_path / "log.csv").write_text(f"time [s],stick [V]\n{rows}\n")
    words = ("--interpolation", "previous", "--column", "stick")
    text = done("limits", "hoist", "log.csv", *words)
    assert "hoist, log.csv: " in text
    assert "Change first: in-line orifice" in text


def test_the_units_of_the_errors(done):
    said = done("limits", "hoist", "step:9")
    (head,) = [line for line in said.splitlines() if line.startswith("Limit ")]
    assert " ".join(head.split()) == "Limit share of time deg/s share of error deg/s"
    assert max(len(line) for line in said.splitlines() if "whatif" not in line) <= 80


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("hoist", "--error", "0"), "The error is 0, but must be above 0 and below 1"),
        (("hoist", "--frequency", "300"), "from 0.001 to 64 Hz"),
        (("hoist", "--frequency", "nan"), "from 0.001 to 64 Hz"),
        (("hoist", "sine:4,0.2", "--frequency", "-1"), "leave them out, or 'sine:4,0.2'"),
        (("hoist", "step:9", "--error", "0.1"), "--error and --frequency belong to the sines"),
        (("hoist", "step:11"), "The voltage is 11 V"),
        (("hoist", "stepp:1"), "is no maneuver"),
        (("hoist", "none.csv"), "none.csv"),
        (("crane",), "no packaged set, file or folder 'crane'"),
        (("hoist", "--out", "e.txt"), "a table is written as .csv or .parquet"),
        (("hoist", "--plot", "e.bmp"), "a figure is written as .png"),
        (("hoist", "step:9", "--plot", "none/e.png"), "cannot be written"),
    ],
)
def test_refusals(refused, words, said):
    assert said in refused("limits", *words)
