import re
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest

from swashplate.identification.setup import load_setup

Words = Callable[..., str]
TESTS = (
    "--maneuver",
    "step:2,start=0.5,stop=2.5,length=4",
    "--maneuver",
    "step:9,start=0.5,stop=2.5,length=4",
)
SETUP = """
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


@pytest.fixture
def campaign(done: Words, tmp_path: Path) -> str:
    """Two positive steps of a hoist, of which one reaches the stop."""
    done("rig", "hoist", "--out", "virtual", *TESTS)
    (tmp_path / "setup.toml").write_text(SETUP, "utf-8")
    return "virtual/campaign.toml"


def row(said: str, unknown: str) -> list[str]:
    (line,) = re.findall(rf"^{unknown}  +(.*)$", said, re.MULTILINE)
    return re.split(r"  +", line.strip())


def test_each_unknown_has_a_row(done: Words, campaign: str) -> None:
    said = done("excitation", campaign, "--setup", "setup.toml")
    assert row(said, "J_plus")[-1] == "##"
    needs, seconds, effect, runs = row(said, "J_minus")
    assert (needs, seconds, effect, runs) == ("a command beyond the dead zone", "0", "0", "..")
    # only the step of 9 V reaches the stop
    assert row(said, "Z13_plus")[-1] == ".#"
    said = " ".join(said.split())
    assert "J_minus needs a command beyond the dead zone (minus), which no run has." in said
    assert "* Fix J_minus: no run exercises it." in said
    assert "run 2: hoist_step_9_V" in said
    assert "(--write FILE keeps it)" in said
    assert "J_plus = {relative = [0.5, 2.0]}" in said


def test_the_proposal_can_be_written_and_fitted(done: Words, campaign: str, tmp_path: Path) -> None:
    setup = ("--setup", "setup.toml")
    said = done("excitation", campaign, *setup, "--write", "mine.toml", "--out", "runs.csv")
    assert "Set-up: mine.toml" in said
    card, pump = load_setup(tmp_path / "mine.toml").stages
    assert list(card.free) == ["J_plus", "lim1_plus"]
    assert list(pump.free) == ["Z6", "Z8", "Z13_plus"]
    table = pl.read_csv(tmp_path / "runs.csv")
    assert set(table["stage"]) == {"card", "pump"}
    known = table.filter(pl.col("share") > 0.0)
    shares = known.group_by("stage", "parameter").agg(pl.col("share").sum())
    assert shares["share"].to_list() == pytest.approx([1.0] * shares.height)
    again = done("excitation", campaign, "--setup", "mine.toml")
    assert "The fit configuration can stay as it is." in again
    done("fit", campaign, "--setup", "mine.toml", "--out", "fitted", "--no-report")


def test_doubts_are_said_first(done: Words, tmp_path: Path) -> None:
    idle = ("--maneuver", "step:0.1,start=0.5,stop=1,length=2")
    done("rig", "hoist", "--out", "virtual", "--severity", "clean", *TESTS, *idle)
    (tmp_path / "setup.toml").write_text(SETUP, "utf-8")
    said = done("excitation", "virtual/campaign.toml", "--setup", "setup.toml")
    assert said.startswith("! hoist_step_0.1_V: its command stays between 0 and 0.1 V")


def test_refusals(refused: Words, campaign: str, tmp_path: Path) -> None:
    assert "no axis 'boom'; it has hoist" in refused("excitation", campaign, "--axis", "boom")
    assert "no packaged fit configuration 'boom'" in refused(
        "excitation", campaign, "--setup", "boom"
    )
    (tmp_path / "none.toml").write_text(
        '[[stages]]\nname = "pump"\npart = "pump"\nfree.Z14 = { relative = [0.5, 2.0] }\n', "utf-8"
    )
    said = refused("excitation", campaign, "--setup", "none.toml", "--write", "mine.toml")
    assert "The runs determine none of the parameters" in said
    assert ".txt" in refused("excitation", campaign, "--setup", "setup.toml", "--out", "t.txt")
