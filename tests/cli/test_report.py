from collections.abc import Callable
from pathlib import Path

import pytest

from swashplate import Campaign, Drive
from swashplate.identification.assessment import save_fit
from swashplate.identification.fitting import Fit, fit
from swashplate.identification.setup import Setup

Words = Callable[..., str]
TESTS = (
    "--maneuver",
    "step:4,start=0.5,stop=2.5,length=4",
    "--maneuver",
    "step:-5,start=0.5,stop=2.5,length=4",
)
SETUP = Setup.model_validate(
    {
        "stages": [
            {"name": "card", "part": "card", "free": {"J_plus": {"relative": (0.5, 2.0)}}},
            {"name": "pump", "part": "pump", "free": {"Z10": {"relative": (0.8, 1.25)}}},
        ]
    }
)


@pytest.fixture
def fitted(done: Words, tmp_path: Path) -> Fit:
    """A fit and what it keeps of itself, in the folder fitted."""
    done("rig", "hoist", "--out", "virtual", *TESTS)
    path = tmp_path / "virtual" / "campaign.toml"
    before, _, after = path.read_text("utf-8").rpartition('role = "fit"')
    path.write_text(f'{before}role = "validate"{after}', "utf-8")
    campaign = Campaign.from_toml(path)
    runs = campaign.select(role="fit")
    found = fit(Drive.preset("hoist").parameters, runs, SETUP)
    (tmp_path / "fitted").mkdir()
    Drive(found.parameters).to_toml(tmp_path / "fitted" / "drive.toml")
    save_fit(found, runs, tmp_path / "fitted" / "fit.json", campaign=path, notes={"seed": "7"})
    return found


def test_the_report_is_written_again(done: Words, fitted: Fit, tmp_path: Path) -> None:
    said = done("report", "fitted", "virtual/campaign.toml", "--truth", "virtual/truth")
    assert "Report:    fitted/report.html" in said
    assert "Usable: predicts held-out speed from counts to 0." in said
    page = (tmp_path / "fitted" / "report.html").read_text("utf-8")
    assert f"{fitted.stages[1].values['Z10']:.2f}" in page
    assert '<th class="n">truth</th>' in page
    assert '<th scope="row">seed</th><td>7</td>' in page
    first = done("report", "fitted/drive.toml", "virtual/campaign.toml", "--out", "again")
    assert "again/report.html" in first
    assert '<th class="n">truth</th>' not in (tmp_path / "again" / "report.html").read_text("utf-8")


def test_figures_stand_beside_it(done: Words, fitted: Fit, tmp_path: Path) -> None:
    done("report", "fitted", "virtual/campaign.toml", "--figures", "pdf", "--out", "print")
    names = sorted(each.name for each in (tmp_path / "print" / "figures").iterdir())
    assert names == ["overlay-01-hoist_step_4_V.pdf", "overlay-02-hoist_step_-5_V.pdf"]


def test_refusals(refused: Words, fitted: Fit, tmp_path: Path) -> None:
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
