"""Files that earlier versions wrote are read as they were meant; numbers are from their text."""

import json
import shutil
import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

from swashplate import Campaign, Drive, ParameterError, identify
from swashplate.cli import app
from swashplate.crane import Crane
from swashplate.identification import Identification, load_setup, read_verdict

KEPT = Path(__file__).parent / "fixtures" / "f206f7e8"


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the files, in the current folder."""
    shutil.copytree(KEPT, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def one_stage(file: Path, number: int) -> Path:
    """The file of one stage of a fit setup, beside it."""
    text = "[[stages]]" + file.read_text("utf-8").split("[[stages]]")[1 + number]
    path = file.with_name(f"stage-{number}.toml")
    path.write_text(text, "utf-8")
    return path


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
def test_a_fit_setup_of_several_stages_is_refused(file: str) -> None:
    with pytest.raises(ParameterError) as refusal:
        load_setup(KEPT / file)
    said = str(refusal.value)
    assert said.startswith(f"{KEPT / file}: a fit has no stages any more: ")
    assert "fit them one after another, each --from the folder of the one before" in said
    assert said.count("\n") == 0


@pytest.mark.parametrize("file", ["campaign/setup.toml", "fitted/setup.toml"])
def test_a_fit_setup_of_one_stage(kept: Path, file: str) -> None:
    card, pump = (load_setup(one_stage(kept / file, number)) for number in (0, 1))
    assert (card.part, list(card.free)) == ("card", ["J", "omega_plus"])
    assert (pump.part, list(pump.free)) == ("pump", ["Z8", "Z16"])
    assert (pump.free["Z16"].relative, pump.free["Z16"].log) == ((0.5, 2.0), True)


@pytest.mark.parametrize("stages", ['"a"', "[1]", "3", "{}", "[]", '["a"]'])
def test_stages_that_are_none_are_one_sentence(tmp_path: Path, stages: str) -> None:
    (tmp_path / "setup.toml").write_text(f"stages = {stages}\n", "utf-8")
    with pytest.raises(ParameterError, match=r"setup\.toml: a fit has no stages any more"):
        load_setup(tmp_path / "setup.toml")


def test_a_fit_in_stages_is_to_be_made_again() -> None:
    with pytest.raises(ParameterError) as refusal:
        Identification.load(KEPT / "fitted")
    said = str(refusal.value)
    assert said.startswith(f"{KEPT / 'fitted' / 'fit.json'}: ")
    assert "of an earlier version: fit again" in said
    assert said.count("\n") == 0


def test_a_crane() -> None:
    crane = Crane.from_toml(KEPT / "crane.toml")
    assert crane.name == "tg3637"
    assert crane.quantities["boom_length"].values == [36.0]
    assert crane.quantities["slew_axis"].values == [40.0, -8.5, 19.0]
    assert crane.limits["dynamic_factor"].values == [1.42]
    assert crane.slew.name == "slew"


def test_commands_take_them(kept: Path) -> None:
    """Of the fit they need its drive and its verdict, but for a report."""
    refused = CliRunner().invoke(app, ["report", "fitted", "campaign/campaign.toml"])
    assert refused.exit_code == 2
    assert refused.stderr.startswith("Error: fitted/fit.json: ")
    assert "fit again" in refused.stderr
    assert refused.stderr.count("\n") == 1
    assert read_verdict("fitted/fit.json").verdict.usable
    said = done("validate", "fitted", "campaign/campaign.toml", "--out", "again")
    assert "Usable" in said
    # hoist_held in validated/measures.csv: 6.280 mA and 0.0013222 rad, 0.0758 deg
    assert "hoist_held rest nothing 6.28 mA" in said
    assert "hoist_held rest nothing 0.0758 deg" in said
    assert "speed at the end" in done("simulate", "fitted", "step:4")
    assert "boom length" in done("crane", "show", "crane.toml")


@pytest.mark.slow
def test_a_fit_is_made_again_from_them(kept: Path) -> None:
    """As the sentence says that refuses the setup: one stage after another."""
    setup = kept / "campaign" / "setup.toml"
    card, pump = (str(one_stage(setup, number)) for number in (0, 1))
    words = ("fit", "campaign/campaign.toml", "--no-report")
    done(*words, "--setup", card, "--out", "card")
    assert "Usable" in done(*words, "--setup", pump, "--from", "card", "--out", "again")
    again = Drive.from_toml(kept / "again" / "drive.toml")
    assert again["J"].value == pytest.approx((0.2603880540489157, 0.30959937418097794), rel=1e-3)
    # half of its standard error then: the instants of the jumps, which the first stage handed on,
    # are estimated again
    assert again["Z8"].value == pytest.approx(1654888.5752785797, abs=0.5 * 97559.56832577931)


# --- the number of a file's layout ----------------------------------------------------------------

READERS = {
    "campaign/campaign.toml": Campaign.from_toml,
    "campaign/drive.toml": Drive.from_toml,
    "campaign/setup.toml": load_setup,
    "crane.toml": Crane.from_toml,
    "fitted/fit.json": Identification.load,
}


@pytest.fixture(scope="module")
def made_again(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files, those in stages as this version has them."""
    folder = tmp_path_factory.mktemp("made_again")
    shutil.copytree(KEPT, folder, dirs_exist_ok=True)
    setup = folder / "campaign" / "setup.toml"
    one_stage(setup, 1).replace(setup)
    shutil.rmtree(folder / "fitted")
    identify(folder / "campaign" / "campaign.toml", free=setup).save(folder / "fitted")
    return folder


@pytest.fixture
def current(made_again: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of these files, in the current folder."""
    shutil.copytree(made_again, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def numbered(path: Path, number: str, rest: str = "") -> None:
    """State the layout of a file, with something else at its beginning."""
    text = path.read_text("utf-8").replace("format = 1\n", "")
    if path.suffix == ".json":
        text = text.replace('"schema": 1,', "", 1)
        path.write_text(text.replace("{", f'{{"schema": {number},{rest}', 1), "utf-8")
    else:
        path.write_text(f"schema = {number}\n{rest}\n{text}", "utf-8")


@pytest.mark.parametrize("file", READERS)
def test_the_first_layout_may_be_stated(current: Path, file: str) -> None:
    numbered(current / file, "1")
    READERS[file](current / file)


@pytest.mark.parametrize("file", READERS)
@pytest.mark.parametrize("number", ["2", "17"])
def test_a_newer_layout_is_refused_before_what_it_brings(
    current: Path, file: str, number: str
) -> None:
    numbered(current / file, number, '"titel": 1,' if file.endswith("json") else "titel = 1")
    with pytest.raises(ParameterError) as refusal:
        READERS[file](current / file)
    said = str(refusal.value)
    assert said.startswith(f"{current / file}: schema: {number} ")
    assert "reads up to 1: update swashplate" in said


@pytest.mark.parametrize("file", READERS)
@pytest.mark.parametrize("number", ['"1"', "true", "1.0", "0", "-1", "[1]"])
def test_a_layout_is_a_whole_number(current: Path, file: str, number: str) -> None:
    numbered(current / file, number)
    with pytest.raises(ParameterError) as refusal:
        READERS[file](current / file)
    assert str(refusal.value).startswith(f"{current / file}: schema: ")
    assert "a whole number from 1 up" in str(refusal.value)


@pytest.mark.parametrize("file", READERS)
def test_the_inner_name_of_the_number_is_no_entry(current: Path, file: str) -> None:
    numbered(current / file, "1", '"layout": 1,' if file.endswith("json") else "layout = 1")
    with pytest.raises(ParameterError, match="no entry 'layout'"):
        READERS[file](current / file)


@pytest.mark.parametrize("file", ["campaign/drive.toml", "crane.toml"])
def test_format_as_it_was_called_is_checked_too(current: Path, file: str) -> None:
    text = (current / file).read_text("utf-8")
    (current / file).write_text(text.replace("format = 1\n", "format = 2\n"), "utf-8")
    with pytest.raises(ParameterError, match="2 is the layout of a newer swashplate"):
        READERS[file](current / file)


def test_whatever_is_written_states_its_layout(current: Path) -> None:
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
    ("entry", "value", "said"),
    [("unknowns", [], "fit again"), ("runs", {}, "no run that was fitted"), ("setup", {}, "free")],
)
def test_a_fit_without_a_part_of_it_is_one_sentence(
    current: Path, entry: str, value: object, said: str
) -> None:
    file = current / "fitted" / "fit.json"
    content = json.loads(file.read_text("utf-8")) | {entry: value}
    file.write_text(json.dumps(content), "utf-8")
    result = CliRunner().invoke(app, ["report", "fitted", "campaign/campaign.toml"])
    assert result.exit_code == 2
    assert said in result.stderr
    assert result.stderr.startswith("Error: fitted/fit.json")
    assert result.stderr.count("\n") == 1
