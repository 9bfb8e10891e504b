import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from swashplate import Drive, FileError, maneuvers
from swashplate.campaign import Campaign, rig

STEP = maneuvers.step(4.0)
SINE = maneuvers.sine(4.0, 0.2, length=12.0)


def content(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture(scope="module")
def harsh() -> rig.VirtualTests:
    return rig.run("hoist", [STEP, SINE], severity="harsh", seed=4)


def test_csv_logs_read_back_as_they_were(harsh: rig.VirtualTests, tmp_path: Path) -> None:
    rig.write(harsh, tmp_path)
    path = tmp_path / "hoist_step_4_V.csv"
    assert path.read_text("utf-8").startswith("# virtual: simulated by swashplate ")
    table = pl.read_csv(path, comment_prefix="#")
    columns = harsh.runs[STEP.name].columns
    assert table.columns == ["time", "voltage", "current", "counts"]
    assert table["counts"].dtype == pl.Int64
    for name, values in columns.items():
        read = table[name].cast(pl.Float64).fill_null(np.nan).to_numpy()
        np.testing.assert_array_equal(read, values)


def test_the_same_seed_gives_the_same_files(harsh: rig.VirtualTests, tmp_path: Path) -> None:
    again = rig.run("hoist", [SINE, STEP], severity="harsh", seed=4)
    rig.write(harsh, tmp_path / "one")
    rig.write(again, tmp_path / "two")
    one, two = content(tmp_path / "one"), content(tmp_path / "two")
    assert one.keys() == two.keys()
    assert [name for name in one if one[name] != two[name]] == ["campaign.toml", "truth/truth.toml"]


@pytest.mark.parametrize("severity", ["clean", "realistic", "harsh"])
def test_a_campaign_reads_what_is_written(severity: rig.Severity, tmp_path: Path) -> None:
    tests = rig.run("hoist", [STEP, SINE], severity=severity, validate=[SINE.name])
    read = Campaign.from_toml(rig.write(tests, tmp_path / "new" / "folder"))
    assert read.virtual
    assert "Virtual" in read.title
    assert [each.maneuver for each in read] == ["step +4 V", "sine 4 V 0.2 Hz"]
    assert [each.role for each in read] == ["fit", "validate"]
    for experiment, run in zip(read, tests.runs.values(), strict=True):
        channel = experiment["counts"]
        truth = np.interp(channel.time, run.truth.time, run.truth.shaft_position)
        # a count is 2.5 mrad
        bound = {"clean": 1e-12, "realistic": 2.6e-3, "harsh": 2.6e-3}[severity]
        assert np.abs(channel.values - truth).max() < bound


def test_the_truth_lies_apart_and_complete(tmp_path: Path) -> None:
    tools = replace(rig.SEVERITIES["realistic"], backlash=0.01)
    tests = rig.run("hoist", [STEP], perturb=0.1, instruments=tools, seed=12)
    assert tests.severity == "custom"
    rig.write(tests, tmp_path)
    truth = tomllib.loads((tmp_path / "truth" / "truth.toml").read_text("utf-8"))
    assert truth["virtual"] is True
    assert truth["seed"] == 12
    assert rig.Instruments(**truth["instruments"]) == tools
    assert {"swashplate", "numpy"} <= truth["versions"].keys()
    assert Drive.from_toml(tmp_path / "truth" / truth["drive"]) == tests.drive
    assert tests.drive != Drive.preset("hoist")


def test_a_drive_of_ones_own_lies_beside_the_campaign(tmp_path: Path) -> None:
    crane = Drive.preset("hoist").scale(Z10=0.9).renamed('my "crane"')
    tests = rig.run(crane, {"a/b": STEP}, counts_per_turn=2500.0)
    path = rig.write(tests, tmp_path)
    read = Campaign.from_toml(path)
    assert list(read.axes) == ['my "crane"']
    assert read.axes['my "crane"'].drive == "drive.toml"
    assert Drive.from_toml(tmp_path / "drive.toml") == crane
    assert (tmp_path / "my_crane_a-b.csv").exists()


def test_a_folder_that_holds_something_is_kept(harsh: rig.VirtualTests, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(FileError, match="is not empty; name a new folder, or allow overwriting"):
        rig.write(harsh, tmp_path)
    assert content(tmp_path) == {"notes.txt": b"mine"}
    rig.write(harsh, tmp_path, overwrite=True)
    rig.write(harsh, tmp_path, overwrite=True)
    assert (tmp_path / "notes.txt").read_text() == "mine"
    with pytest.raises(FileError, match="is a file; name a folder"):
        rig.write(harsh, tmp_path / "notes.txt")
