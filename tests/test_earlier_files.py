"""Files that earlier versions wrote are read as they were meant; numbers are from their text."""

import json
import shutil
import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

from swashplate import Campaign, Drive, ParameterError
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


def printed(*words: str) -> str:
    """What a command prints that succeeds."""
    result = CliRunner().invoke(app, [*words], prog_name="swashplate")
    assert result.exit_code == 0, result.output
    return result.stdout


def done(*words: str) -> str:
    """The same, its words one blank apart."""
    return " ".join(printed(*words).split())


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


@pytest.mark.slow
def test_a_fit_is_made_again_from_them(kept: Path) -> None:
    words = ("fit", "campaign/campaign.toml", "--setup", "campaign/setup.toml", "--out", "again")
    assert "Usable" in done(*words)
    again = Drive.from_toml(kept / "again" / "drive.toml")
    assert again["J"].value == pytest.approx((0.2603880540489157, 0.30959937418097794), rel=1e-3)
    assert again["Z8"].value == pytest.approx(1654888.5752785797, rel=0.01)


# --- the number of a file's layout ----------------------------------------------------------------

READERS = {
    "campaign/campaign.toml": Campaign.from_toml,
    "campaign/drive.toml": Drive.from_toml,
    "campaign/setup.toml": load_setup,
    "crane.toml": Crane.from_toml,
    "fitted/fit.json": Identification.load,
}


def numbered(path: Path, number: str, rest: str = "") -> None:
    """State the layout of a file, with something else at its beginning."""
    text = path.read_text("utf-8").replace("format = 1\n", "")
    if path.suffix == ".json":
        path.write_text(text.replace("{", f'{{"schema": {number},{rest}', 1), "utf-8")
    else:
        path.write_text(f"schema = {number}\n{rest}\n{text}", "utf-8")


@pytest.mark.parametrize("file", READERS)
def test_the_first_layout_may_be_stated(kept: Path, file: str) -> None:
    numbered(kept / file, "1")
    READERS[file](kept / file)


@pytest.mark.parametrize("file", READERS)
@pytest.mark.parametrize("number", ["2", "17"])
def test_a_newer_layout_is_refused_before_what_it_brings(
    kept: Path, file: str, number: str
) -> None:
    numbered(kept / file, number, '"titel": 1,' if file.endswith("json") else "titel = 1")
    with pytest.raises(ParameterError) as refusal:
        READERS[file](kept / file)
    said = str(refusal.value)
    assert said.startswith(f"{kept / file}: schema: {number} ")
    assert "reads up to 1: update swashplate" in said


@pytest.mark.parametrize("file", READERS)
@pytest.mark.parametrize("number", ['"1"', "true", "1.0", "0", "-1", "[1]"])
def test_a_layout_is_a_whole_number(kept: Path, file: str, number: str) -> None:
    numbered(kept / file, number)
    with pytest.raises(ParameterError) as refusal:
        READERS[file](kept / file)
    assert str(refusal.value).startswith(f"{kept / file}: schema: ")
    assert "a whole number from 1 up" in str(refusal.value)


@pytest.mark.parametrize("file", READERS)
def test_the_inner_name_of_the_number_is_no_entry(kept: Path, file: str) -> None:
    numbered(kept / file, "1", '"layout": 1,' if file.endswith("json") else "layout = 1")
    with pytest.raises(ParameterError, match="no entry 'layout'"):
        READERS[file](kept / file)


@pytest.mark.parametrize("file", ["campaign/drive.toml", "crane.toml"])
def test_format_as_it_was_called_is_checked_too(kept: Path, file: str) -> None:
    text = (kept / file).read_text("utf-8")
    (kept / file).write_text(text.replace("format = 1\n", "format = 2\n"), "utf-8")
    with pytest.raises(ParameterError, match="2 is the layout of a newer swashplate"):
        READERS[file](kept / file)


def test_whatever_is_written_states_its_layout(kept: Path) -> None:
    Drive.from_toml("campaign/drive.toml").to_toml("written.toml")
    Identification.load("fitted").save("saved")
    done("rig", "hoist", "--out", "virtual", "--maneuver", "step:4,start=0.5,stop=2.5,length=4")
    done("campaign", "init", "campaign/hoist_up.csv", "--out", "drafted.toml")
    Path("crane.toml").write_text(printed("crane", "show", "tg3637", "--toml"), "utf-8")
    Path("hoist.toml").write_text(printed("show", "hoist", "--toml"), "utf-8")
    for file in (
        "written.toml",
        "saved/drive.toml",
        "saved/setup.toml",
        "virtual/campaign.toml",
        "drafted.toml",
        "crane.toml",
        "hoist.toml",
    ):
        assert tomllib.loads(Path(file).read_text("utf-8"))["schema"] == 1, file
    assert json.loads(Path("saved/fit.json").read_text("utf-8"))["schema"] == 1
    assert Identification.load("saved").drive == Identification.load("fitted").drive


@pytest.mark.parametrize(
    ("stages", "setup", "said"),
    [(0, 2, "0 stages of the 2"), (0, 0, "setup.stages is []"), (2, 1, "2 stages of the 1")],
)
def test_a_fit_without_its_stages_is_one_sentence(
    kept: Path, stages: int, setup: int, said: str
) -> None:
    file = kept / "fitted" / "fit.json"
    content = json.loads(file.read_text("utf-8"))
    del content["stages"][stages:], content["setup"]["stages"][setup:]
    file.write_text(json.dumps(content), "utf-8")
    result = CliRunner().invoke(app, ["report", "fitted", "campaign/campaign.toml"])
    assert result.exit_code == 2
    assert said in result.stderr
    assert result.stderr.startswith("Error: fitted/fit.json: ")
    assert result.stderr.count("\n") == 1
