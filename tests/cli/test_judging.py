import csv
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import Result

from swashplate import Campaign, Drive
from swashplate.identification.assessment import Judged
from swashplate.identification.fitting import Fit, fit
from swashplate.identification.setup import Setup

# --- validate -------------------------------------------------------------------------------------


Words = Callable[..., str]


def test_a_drive_is_held_against_the_runs_that_were_held_back(
    done: Words, held_out: Path, tmp_path: Path
) -> None:
    said = done("validate", "hoist", "virtual/campaign.toml", "--out", "found")
    assert "hoist_step_-5_V" in said
    assert "hoist_step_4_V" not in said
    assert re.search(r"\ncurrent +\n.* mA ", said, re.DOTALL)
    assert re.search(r"\nspeed from counts +\n.* deg/s ", said, re.DOTALL)
    assert "NRMSE is the RMSE over" in said
    assert "'of its range' below means" in " ".join(said.split())
    assert "Predicts speed from counts to 0." in said
    assert "<svg" in (tmp_path / "found" / "report.html").read_text("utf-8")
    with (tmp_path / "found" / "measures.csv").open(encoding="utf-8") as file:
        rows = {row["channel"]: row for row in csv.DictReader(file)}
    assert set(rows) == {"current", "counts", "speed from counts"}
    # the published drive itself: what is left is the instruments' error
    assert float(rows["speed from counts"]["fit_percent"]) > 97.0
    assert rows["counts"]["unit"] == "rad"
    assert rows["current"]["initial_state"] == "rest"
    assert rows["speed from counts"]["correlation_with_input"] == ""


def test_a_correlation_that_is_a_model_error_is_said(
    run: Callable[..., Result], held_out: Path, tmp_path: Path
) -> None:
    """A drive of too low a gain misses the more the larger the command."""
    Drive.preset("hoist").scale(J=0.4).to_toml("wrong.toml")
    for drive, follow in (("hoist", False), ("wrong.toml", True)):
        said = run("validate", drive, "virtual/campaign.toml", "--out", drive.split(".")[0]).stdout
        assert ("current: the residuals of 1 of 1 runs follow the input" in said) == follow
        with (tmp_path / drive.split(".")[0] / "measures.csv").open(encoding="utf-8") as file:
            (current,) = [row for row in csv.DictReader(file) if row["channel"] == "current"]
        assert (abs(float(current["correlation_with_input"])) > 0.5) == follow


def test_a_drive_that_is_not_usable_ends_with_1(
    run: Callable[..., Result], held_out: Path, tmp_path: Path
) -> None:
    Drive.preset("hoist").scale(Z10=0.4, J=0.4, G1=0.4).to_toml(tmp_path / "wrong.toml")
    result = run("validate", "wrong.toml", "virtual/campaign.toml")
    assert result.exit_code == 1
    assert result.stderr.startswith("Not usable: ")
    assert "NOT MET" in result.stdout


def test_refusals(refused: Words, held_out: Path) -> None:
    command = ("validate", "hoist", "virtual/campaign.toml")
    assert "no axis 'boom'; it has hoist" in refused(*command, "--axis", "boom")
    assert "There is no file none.toml" in refused("validate", "none.toml", str(held_out))
    text = held_out.read_text("utf-8").replace('role = "validate"', 'role = "ignore"')
    held_out.write_text(text, "utf-8")
    assert "no run of the axis 'hoist' has the role 'validate'; another" in refused(*command)


# --- report ---------------------------------------------------------------------------------------


SETUP = Setup.model_validate(
    {
        "stages": [
            {"name": "card", "part": "card", "free": {"J_plus": {"relative": (0.5, 2.0)}}},
            {"name": "pump", "part": "pump", "free": {"Z10": {"relative": (0.8, 1.25)}}},
        ]
    }
)


@pytest.fixture
def fitted(held_out: Path, tmp_path: Path) -> Fit:
    """A fit and what it keeps of itself, in the folder fitted."""
    campaign = Campaign.from_toml(held_out)
    runs = campaign.select(role="fit")
    found = fit(Drive.preset("hoist").parameters, runs, SETUP)
    (tmp_path / "fitted").mkdir()
    Drive(found.parameters).to_toml(tmp_path / "fitted" / "drive.toml")
    Judged(campaign, found, runs, notes={"seed": "7"}).store(tmp_path / "fitted" / "fit.json")
    return found


def test_the_report_is_written_again(done: Words, fitted: Fit, tmp_path: Path) -> None:
    said = done("report", "fitted", "virtual/campaign.toml", "--truth", "virtual/truth")
    assert "Report:    fitted/report.html" in said
    assert "Usable: predicts held-out speed from counts to 0." in said
    page = (tmp_path / "fitted" / "report.html").read_text("utf-8")
    assert f"{fitted.stages[1].values['Z10']:.2f}" in page
    assert '<th class="n">truth</th>' in page
    assert '<th scope="row">seed</th><td>7</td>' in page
    words = ("fitted/drive.toml", "virtual/campaign.toml", "--data", "all.parquet")
    assert "Samples, in SI: all.parquet" in done("report", *words)
    assert '<th class="n">truth</th>' not in (tmp_path / "fitted/report.html").read_text("utf-8")


def test_report_refusals(refused: Words, fitted: Fit, tmp_path: Path) -> None:
    command = ("report", "fitted", "virtual/campaign.toml")
    assert "There is no fit.json in virtual" in refused("report", "virtual", command[2])
    assert "There is no file truth.toml" in refused(*command, "--truth", "truth.toml")
    Drive.preset("hoist").replace(Z10=9.0).to_toml(tmp_path / "fitted" / "mine.toml")
    said = refused("report", "fitted/mine.toml", "virtual/campaign.toml")
    assert "mine.toml is not the drive that fitted/fit.json found" in said
    path = tmp_path / "virtual" / "campaign.toml"
    text = path.read_text("utf-8")
    path.write_text(text.replace("virtual = true", "virtual = false"), "utf-8")
    assert "nobody knows its truth" in refused(*command, "--truth", "virtual/truth")
    path.write_text(text.replace('role = "fit"', 'role = "fit"\nweight = 2.0', 1), "utf-8")
    assert "is not as it was when fitted/fit.json was fitted" in refused(*command)
