import re
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest

from swashplate import Drive

Words = Callable[..., str]
SMALL = (
    "--maneuver",
    "step:1,start=0.5,stop=2.5,length=4",
    "--maneuver",
    "step:2,start=0.5,stop=2.5,length=4",
)
SETUP = """
[[stages]]
name = "pump"
part = "pump"
free.Z10 = { relative = [0.5, 2.0], log = true }
free.Z13 = { relative = [0.5, 2.0], log = true }
free.Z19 = { relative = [0.5, 2.0], log = true }
"""
TRIALS = tuple(
    word
    for volts in ("2", "-2", "9", "-9")
    for word in ("--maneuver", f"step:{volts},start=0.5,stop=2.5,length=4")
)
PRESSURE = ("--sensor", "stroker_pressure")


@pytest.fixture
def campaign(done: Words, tmp_path: Path) -> str:
    """Small positive steps alone."""
    done("rig", "hoist", "--out", "virtual", *SMALL)
    (tmp_path / "setup.toml").write_text(SETUP, "utf-8")
    return "virtual/campaign.toml"


def section(said: str, title: str) -> dict[str, str]:
    """Rows of a table by their first cell."""
    rows = said.split(title, 1)[1].split("─\n", 1)[1].split("\n\n", 1)[0]
    cells = [re.split(r"  +", line.strip(), maxsplit=1) for line in rows.splitlines()]
    return {first: rest[0] if rest else "" for first, *rest in cells}


def test_small_positive_steps_want_large_and_negative_ones(
    done: Words, campaign: str, tmp_path: Path
) -> None:
    words = ("--setup", "setup.toml", *TRIALS, *PRESSURE, "--tests", "2", "--out", "advice.csv")
    said = done("advise", campaign, *words)
    best = section(said, "For each parameter")
    assert best["Z13_plus"].endswith("step 9 V")
    assert best["Z13_minus"].endswith("step -9 V")
    assert "step -" in best["Z19_minus"]
    tests = section(said, "Tests with the present sensors")
    ranked = list(tests)
    # the large negative one tells of the negative force and the negative stop at once
    assert ranked[0] == "step -9 V"
    assert ranked[-1] == "step 2 V"
    assert list(section(said, "A plan")) == ["step -9 V", "step 9 V"]
    assert "Z13_minus, Z19_minus" in tests["step -9 V"]
    table = pl.read_csv(tmp_path / "advice.csv")
    stop = table.filter((pl.col("parameter") == "Z13_minus") & (pl.col("first to determine")))
    assert set(stop["test"]) == {"step -9 V"}
    assert stop["relative error before"].null_count() == stop.height


def test_a_fresh_plan_needs_a_drive_alone(done: Words) -> None:
    said = done("advise", "hoist", "--setup", "hoist", *TRIALS, *PRESSURE, "--top", "2")
    assert len(section(said, "Tests with the present sensors")) >= 2
    assert "encoder_counts: noise 0.000718 rad (rounding of Kruse's encoder)" in said
    assert "Sensors to add, beside the plan" in said


def test_a_fitted_drive_brings_its_noise(done: Words, campaign: str, tmp_path: Path) -> None:
    Drive.preset("hoist").to_toml(tmp_path / "fitted.toml")
    words = ("--setup", "setup.toml", "--drive", "fitted.toml", *TRIALS[:2], *PRESSURE)
    assert "(residuals of the drive)" in done("advise", campaign, *words)


def test_a_stated_noise_and_a_parameter_more(done: Words, campaign: str) -> None:
    words = ("--setup", "setup.toml", *TRIALS[:2], *PRESSURE, "--free", "Z9")
    said = done("advise", campaign, *words, "--noise", "stroker_pressure=0.2bar")
    assert "stroker_pressure: noise 2e+04 Pa (stated)" in said
    assert "Z9" in section(said, "For each parameter")


def test_refusals(refused: Words, campaign: str) -> None:
    said = refused("advise", "hoist", "--sensor", "temperature")
    assert "no sensor 'temperature'; there are" in said
    assert "'swash_angle=much'" in refused("advise", "hoist", "--noise", "swash_angle=much")
    assert "does not measure" in refused("advise", "hoist", "--noise", "swash_angle=1bar")
    assert "--axis belongs to a campaign" in refused("advise", "hoist", "--axis", "hoist")
    assert "Z10 is free" in refused("advise", campaign, "--setup", "setup.toml", "--free", "Z10")
    assert "no parameter 'Z99'" in refused("advise", "hoist", "--free", "Z99")
    assert "no maneuver" in refused("advise", "hoist", "--maneuver", "wobble:3")
    assert ".txt" in refused("advise", campaign, "--setup", "setup.toml", *TRIALS, "--out", "a.txt")
    assert "no packaged" in refused("advise", "boom")
