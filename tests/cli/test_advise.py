import re
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest

from swashplate import Drive

# --- advise ---------------------------------------------------------------------------------------


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
    words = ("--setup", "setup.toml", *TRIALS, "--tests", "2", "--out", "advice.csv")
    said = done("advise", campaign, *words)
    best = section(said, "For each parameter")
    assert best["Z13_plus"].endswith("step 9 V")
    assert best["Z13_minus"].endswith("step -9 V")
    assert "step -" in best["Z19_minus"]
    tests = section(said, "Tests")
    ranked = list(tests)
    # the large negative one tells of the negative force and the negative stop at once
    assert ranked[0] == "step -9 V"
    assert ranked[-1] == "step 2 V"
    assert list(section(said, "A plan")) == ["step -9 V", "step 9 V"]
    assert "Z13_minus, Z19_minus" in tests["step -9 V"]
    table = pl.read_csv(tmp_path / "advice.csv")
    stop = table.filter(pl.col("first to determine").str.contains("Z13_minus"))
    assert set(stop["test"]) == {"step -9 V"}
    # no other test determines it
    assert table["error of Z13_minus"].is_not_null().sum() == 1


def test_a_fresh_plan_needs_a_drive_alone(done: Words) -> None:
    said = done("advise", "hoist", "--setup", "hoist", *TRIALS, "--top", "2")
    assert len(section(said, "Tests")) >= 2
    assert "encoder_counts: noise 0.000718 rad (rounding of Kruse's encoder)" in said


def test_a_fitted_drive_brings_its_noise(done: Words, campaign: str, tmp_path: Path) -> None:
    Drive.preset("hoist").to_toml(tmp_path / "fitted.toml")
    words = ("--setup", "setup.toml", "--drive", "fitted.toml", *TRIALS[:2])
    assert "(residuals of the drive)" in done("advise", campaign, *words)


def test_refusals(refused: Words) -> None:
    assert "--axis belongs to a campaign" in refused("advise", "hoist", "--axis", "hoist")


# --- excite ---------------------------------------------------------------------------------------


TESTS = (
    "--maneuver",
    "step:2,start=0.5,stop=2.5,length=4",
    "--maneuver",
    "step:9,start=0.5,stop=2.5,length=4",
)


BOTH_PARTS = """
[[stages]]
name = "card"
part = "card"
free.J = { relative = [0.5, 2.0] }
free.lim1_plus = { relative = [0.5, 2.0], log = true }

[[stages]]
name = "pump"
part = "pump"
free.Z6 = { relative = [0.5, 2.0], log = true }
free.Z8 = { relative = [0.5, 2.0], log = true }
free.Z13 = { relative = [0.5, 2.0], log = true }
"""


DETERMINED = """
[[stages]]
name = "pump"
part = "pump"
free.Z8 = { relative = [0.5, 2.0], log = true }
free.Z13_plus = { relative = [0.5, 2.0], log = true }
"""


@pytest.fixture
def steps_up(done: Words, tmp_path: Path) -> str:
    """Two positive steps of a hoist, of which one reaches the stop."""
    done("rig", "hoist", "--out", "virtual", *TESTS)
    (tmp_path / "setup.toml").write_text(BOTH_PARTS, "utf-8")
    return "virtual/campaign.toml"


def row(said: str, unknown: str) -> list[str]:
    (line,) = re.findall(rf"^{unknown}  +(.*)$", said, re.MULTILINE)
    return re.split(r"  +", line.strip())


def test_each_unknown_has_a_row(done: Words, steps_up: str) -> None:
    said = done("excitation", steps_up, "--setup", "setup.toml")
    assert row(said, "J_plus")[-1] == "##"
    assert row(said, "J_minus") == ["a command beyond the dead zone", "0", ".."]
    # only the step of 9 V reaches the stop
    assert row(said, "Z13_plus")[-1] == ".#"
    said = " ".join(said.split())
    assert (
        "J_minus needs a command beyond the dead zone (minus), which no sample shows: fix it"
        in said
    )
    assert "run 2: hoist_step_9_V" in said


def test_the_table_by_run_is_written(done: Words, steps_up: str, tmp_path: Path) -> None:
    said = done("excitation", steps_up, "--setup", "setup.toml", "--out", "runs.csv")
    assert "only Z8/(1+Z6) is determined" not in said
    table = pl.read_csv(tmp_path / "runs.csv")
    assert set(table["stage"]) == {"card", "pump"}
    shares = table["hoist_step_2_V"] + table["hoist_step_9_V"]
    known = shares.filter(shares > 0.0).to_list()
    assert known == pytest.approx([1.0] * len(known))
    (tmp_path / "mine.toml").write_text(DETERMINED, "utf-8")
    again = done("excitation", steps_up, "--setup", "mine.toml")
    assert "The fit configuration can stay as it is." in again


def test_doubts_are_said_first(done: Words, tmp_path: Path) -> None:
    idle = ("--maneuver", "step:0.1,start=0.5,stop=1,length=2")
    done("rig", "hoist", "--out", "virtual", "--severity", "clean", *TESTS, *idle)
    (tmp_path / "setup.toml").write_text(BOTH_PARTS, "utf-8")
    said = done("excitation", "virtual/campaign.toml", "--setup", "setup.toml")
    assert said.startswith("! hoist_step_0.1_V: its command stays between 0 and 0.1 V")
