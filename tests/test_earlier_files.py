"""Files that earlier versions wrote are read as they were meant; numbers are from their text."""

import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from swashplate import Campaign, Drive
from swashplate.cli import app
from swashplate.crane import Crane
from swashplate.identification import Identification, load_setup

KEPT = Path(__file__).parent / "fixtures" / "f206f7e8"


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the files, in the current folder."""
    shutil.copytree(KEPT, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def done(*words: str) -> str:
    result = CliRunner().invoke(app, [*words], prog_name="swashplate")
    assert result.exit_code == 0, result.output
    return " ".join(result.stdout.split())


def test_a_campaign() -> None:
    tests = Campaign.from_toml(KEPT / "campaign" / "campaign.toml")
    assert (tests.title, tests.virtual) == ("Virtual tests, hoist", True)
    assert [(run.name, run.role) for run in tests] == [
        ("hoist_up", "fit"),
        ("hoist_down", "fit"),
        ("hoist_held", "validate"),
    ]
    up = tests["hoist_up"]
    assert up.input.kind == "voltage"
    assert (up.input.values[0], up.input.values[50]) == (0.0, 6.0009765625)
    assert up.channels["current"].values[50] == 0.5615
    # a turn has 2526.315789473684 counts
    assert up.channels["counts"].values[-1] == pytest.approx(2028 * 0.00248709418409)


@pytest.mark.parametrize(
    ("file", "jump"),
    [
        ("campaign/drive.toml", (0.27473, 0.2951)),
        ("fitted/drive.toml", (0.2603880540489157, 0.30959937418097794)),
    ],
)
def test_a_drive(file: str, jump: tuple[float, float]) -> None:
    drive = Drive.from_toml(KEPT / file)
    assert drive.name == "hoist"
    assert drive["J"].value == jump
    assert drive["V_dz"].value == (0.12663, 0.097857)
    assert drive["Z9"].value == 10743000.0


@pytest.mark.parametrize("file", ["campaign/setup.toml", "fitted/setup.toml"])
def test_a_fit_setup(file: str) -> None:
    card, pump = load_setup(KEPT / file).stages
    assert (card.name, card.part, list(card.free)) == ("card", "card", ["J", "omega_plus"])
    assert (pump.name, pump.part, list(pump.free)) == ("pump", "pump", ["Z8", "Z16"])
    assert (pump.free["Z16"].relative, pump.free["Z16"].log) == ((0.5, 2.0), True)


def test_a_fit(tmp_path: Path) -> None:
    result = Identification.load(KEPT / "fitted")
    assert [run.name for run in result.fit.runs] == ["hoist_up", "hoist_down"]
    assert [run.name for run in result.held_out] == ["hoist_held"]
    assert result.drive["Z16"].value == (0.00012964254740242595, 0.00013008803015455904)
    result.write(tmp_path / "estimates.csv")
    written = (tmp_path / "estimates.csv").read_text("utf-8")
    assert written == (KEPT / "fitted" / "estimates.csv").read_text("utf-8")
    assert result.verdict.usable


def test_a_crane() -> None:
    crane = Crane.from_toml(KEPT / "crane.toml")
    assert crane.name == "tg3637"
    assert crane.quantities["boom_length"].values == [36.0]
    assert crane.quantities["slew_axis"].values == [40.0, -8.5, 19.0]
    assert crane.limits["dynamic_factor"].values == [1.42]
    assert crane.slew.name == "slew"


def test_commands_take_them(kept: Path) -> None:
    assert "Usable" in done("report", "fitted")
    assert (kept / "fitted" / "report.html").is_file()
    said = done("validate", "fitted", "campaign/campaign.toml", "--out", "again")
    assert "Usable" in said
    # hoist_held in validated/measures.csv: 6.280 mA and 0.0013222 rad, 0.0758 deg
    assert "hoist_held rest nothing 6.28 mA" in said
    assert "hoist_held rest nothing 0.0758 deg" in said
    assert "speed at the end" in done("simulate", "fitted", "step:4")
    assert "boom length" in done("crane", "show", "crane.toml")


def test_a_fit_is_made_again_from_them(kept: Path) -> None:
    words = ("fit", "campaign/campaign.toml", "--setup", "campaign/setup.toml", "--out", "again")
    assert "Usable" in done(*words)
    again = Drive.from_toml(kept / "again" / "drive.toml")
    assert again["J"].value == pytest.approx((0.2603880540489157, 0.30959937418097794), rel=1e-3)
    assert again["Z8"].value == pytest.approx(1654888.5752785797, rel=0.01)
