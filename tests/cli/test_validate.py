import csv
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import Result

from swashplate import Drive

Words = Callable[..., str]
TESTS = (
    "--maneuver",
    "step:4,start=0.5,stop=2.5,length=4",
    "--maneuver",
    "step:-5,start=0.5,stop=2.5,length=4",
)


@pytest.fixture
def campaign(done: Words, tmp_path: Path) -> Path:
    """Virtual tests of the published hoist; the second run is held back."""
    done("rig", "hoist", "--out", "virtual", *TESTS)
    path = tmp_path / "virtual" / "campaign.toml"
    before, _, after = path.read_text("utf-8").rpartition('role = "fit"')
    path.write_text(f'{before}role = "validate"{after}', "utf-8")
    return path


def test_a_drive_is_held_against_the_runs_that_were_held_back(
    done: Words, campaign: Path, tmp_path: Path
) -> None:
    said = done("validate", "hoist", "virtual/campaign.toml", "--out", "found", "--figures", "svg")
    assert "hoist_step_-5_V" in said
    assert "hoist_step_4_V" not in said
    assert re.search(r"\ncurrent +\n.* mA ", said, re.DOTALL)
    assert re.search(r"\nspeed from counts +\n.* deg/s ", said, re.DOTALL)
    assert "NRMSE is the RMSE over" in said
    assert "'of its range' below means" in " ".join(said.split())
    assert "Predicts speed from counts to 0." in said
    assert "<svg" in (tmp_path / "found" / "report.html").read_text("utf-8")
    assert [each.suffix for each in (tmp_path / "found" / "figures").iterdir()] == [".svg"]
    with (tmp_path / "found" / "measures.csv").open(encoding="utf-8") as file:
        rows = {row["channel"]: row for row in csv.DictReader(file)}
    assert set(rows) == {"current", "counts", "speed from counts"}
    # the published drive itself: what is left is the instruments' error
    assert float(rows["speed from counts"]["fit_percent"]) > 97.0
    assert rows["counts"]["unit"] == "rad"
    assert rows["current"]["initial_state"] == "rest"
    assert rows["speed from counts"]["correlation_with_input"] == ""


def test_a_correlation_beyond_its_band_is_marked(
    run: Callable[..., Result], campaign: Path
) -> None:
    """A drive of too low a gain misses the more the larger the command."""
    Drive.preset("hoist").scale(J=0.4).to_toml("wrong.toml")
    for drive, marks in (("hoist", {False}), ("wrong.toml", {True})):
        said = run("validate", drive, "virtual/campaign.toml").stdout
        table = said[said.index("Residuals: correlation") : said.index("'own' is how long")]
        rows = [line for line in table.splitlines() if line.startswith("hoist_step")]
        assert {"*" in row for row in rows if " current " in row} == marks
        assert "* marks what lies beyond" in " ".join(said.split())


def test_roles(done: Words, campaign: Path) -> None:
    said = done("validate", "hoist", "virtual/campaign.toml", "--role", "all")
    assert "hoist_step_-5_V" in said
    assert "hoist_step_4_V" in said
    assert "hoist_step_-5_V" not in done(
        "validate", "hoist", "virtual/campaign.toml", "--role", "fit"
    )


def test_ignored_windows_stand_beside_the_fit(done: Words, campaign: Path) -> None:
    text = campaign.read_text("utf-8")
    campaign.write_text(f"{text}ignore = [{{ to = 0.5, why = 'noise' }}]\n", "utf-8")
    assert "0 to 0.5 s (noise)" in done("validate", "hoist", "virtual/campaign.toml")


def test_a_drive_that_is_not_usable_ends_with_1(
    run: Callable[..., Result], campaign: Path, tmp_path: Path
) -> None:
    Drive.preset("hoist").scale(Z10=0.4, J=0.4, G1=0.4).to_toml(tmp_path / "wrong.toml")
    result = run("validate", "wrong.toml", "virtual/campaign.toml")
    assert result.exit_code == 1
    assert result.stderr.startswith("Not usable: ")
    assert "Residuals" in result.stdout


def test_refusals(refused: Words, campaign: Path) -> None:
    command = ("validate", "hoist", "virtual/campaign.toml")
    assert "give --out DIR" in refused(*command, "--figures", "svg")
    assert "no axis 'boom'; it has hoist" in refused(*command, "--axis", "boom")
    assert "There is no file none.toml" in refused("validate", "none.toml", str(campaign))
    text = campaign.read_text("utf-8").replace('role = "validate"', 'role = "ignore"')
    campaign.write_text(text, "utf-8")
    assert "no run of the axis 'hoist' has the role 'validate'; another" in refused(*command)
