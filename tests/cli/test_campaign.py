import json
from collections.abc import Callable
from pathlib import Path

import pytest

from swashplate import Campaign, Drive

# --- campaign -------------------------------------------------------------------------------------


Done = Callable[..., str]


COUNTS = ("--counts-per-turn", "1000")


ROWS = [
    f"{k / 100},{4 if k > 20 else 0},{0.4 if k > 20 else 0},{7 * max(k - 20, 0)}"
    for k in range(100)
]


@pytest.fixture
def logs(tmp_path: Path) -> list[str]:
    names = ["lift.csv", "lower.csv"]
    for name in names:
        text = "\n".join(["time [s],voltage [V],current [A],counts", *ROWS]) + "\n"
        (tmp_path / name).write_text(text, "utf-8")
    return names


def test_from_logs_to_a_check(done: Done, logs: list[str], tmp_path: Path) -> None:
    said = done("campaign", "init", *logs, *COUNTS, "--drive", "hoist")
    assert "Draft: campaign.toml" in said
    said = done("campaign", "check")
    assert "2 experiments (2 to fit)" in said
    assert "step +4 V" in said
    # the logs are made up: a hoist turns at 98 deg/s, these counts at 252
    assert "'encoder_counts' moves" in " ".join(said.split())
    assert "1 finding, marked" in said


def test_strict_fails_on_findings(
    run: Callable[..., object], done: Done, logs: list[str], tmp_path: Path
) -> None:
    done("campaign", "init", *logs, *COUNTS)
    path = tmp_path / "campaign.toml"
    path.write_text(
        path.read_text("utf-8").replace("counts_per_turn", "sign = -1\ncounts_per_turn"), "utf-8"
    )
    said = " ".join(done("campaign", "check").split())
    assert "moves against the input: should its sign be -1? " in said
    result = run("campaign", "check", "--strict")
    assert result.exit_code == 1  # type: ignore[attr-defined]


def test_the_schema_is_json(done: Done) -> None:
    schema = json.loads(done("campaign", "schema"))
    assert {"axes", "runs", "title"} <= set(schema["properties"])
    assert "counts_per_turn" in schema["$defs"]["Channel"]["properties"]


def test_a_close_look(done: Done, refused: Callable[..., str], logs: list[str]) -> None:
    done("campaign", "init", *logs, *COUNTS, "--drive", "hoist")
    look = ("campaign", "plot", "--run", "lift", "--channel")
    for channel in ("encoder_counts", "rectified_current"):
        assert f"Figure: {channel}.svg" in done(
            *look, channel, "--to", "0.5", "--out", f"{channel}.svg"
        )
    assert "go together" in refused("campaign", "plot", "--run", "lift")
    assert "no channel 'speed'" in refused(*look, "speed")


TACHO = """
[axes.hoist]
drive = "hoist"
time = { column = "time" }
input = { column = "u", unit = "V" }
channels.tacho = { column = "n", kind = "shaft_speed", unit = "deg/s" }
[[runs]]
file = "log.csv"
"""


def test_a_close_look_at_a_tacho_beside_the_drive_before_any_fit(
    done: Done, tmp_path: Path
) -> None:
    rows = [f"{k / 100},{4 if k > 20 else 0},{98 if k > 40 else 0}" for k in range(300)]
    (tmp_path / "log.csv").write_text("\n".join(["time,u,n", *rows]) + "\n", "utf-8")
    look = ("campaign", "plot", "--run", "log", "--channel", "tacho", "--to", "2")
    for name, text in (("with", TACHO), ("without", TACHO.replace('drive = "hoist"', ""))):
        (tmp_path / "campaign.toml").write_text(text, "utf-8")
        done(*look, "--out", f"{name}.svg")
    shown, alone = ((tmp_path / f"{name}.svg").read_text("utf-8") for name in ("with", "without"))
    assert "measured less simulated" in shown
    assert "measured less simulated" not in alone


def test_volts_that_were_declared_as_millivolts(
    refused: Callable[..., str], tmp_path: Path
) -> None:
    rows = [f"{k / 100},{4 if k > 20 else 0},{98 if k > 40 else 0}" for k in range(300)]
    (tmp_path / "log.csv").write_text("\n".join(["time,u,n", *rows]) + "\n", "utf-8")
    (tmp_path / "campaign.toml").write_text(TACHO.replace('"V"', '"mV"'), "utf-8")
    said = " ".join(refused("fit", "campaign.toml", "--setup", "hoist", "--out", "fit").split())
    assert 'if the log is in V, write unit = "V": it then reaches 4 V' in said


def test_what_a_draft_leaves_out_stands_before_the_command_to_run(
    done: Done, tmp_path: Path
) -> None:
    rows = [f"{k},{row}" for k, row in enumerate(ROWS)]
    text = "\n".join(["Nr,time [s],voltage [V],current [A],Geber", *rows]) + "\n"
    (tmp_path / "log.csv").write_text(text, "utf-8")
    said = done("campaign", "init", "log.csv", *COUNTS, "--drive", "hoist").splitlines()
    assert said[2:] == [
        "  Columns that are not used: Nr, Geber",
        "  No column looks like an encoder's counts among Nr, Geber; counts_per_turn = 1000 is "
        "left out",
        "Then run",
        "  swashplate campaign check campaign.toml",
    ]
    assert "! axis 'hoist': no channel measures its motion" in done("campaign", "check")


def _below(text: str, line: str) -> list[str]:
    """The line below one."""
    lines = text.splitlines()
    return [lines[lines.index(line) + 1].strip()]


def test_long_names_are_not_cut(done: Done, logs: list[str], tmp_path: Path) -> None:
    done("campaign", "init", *logs, *COUNTS)
    path, name = tmp_path / "campaign.toml", "encoder_counts_of_the_drum_behind_the_gear"
    path.write_text(path.read_text("utf-8").replace("channels.encoder_counts", f"channels.{name}"))
    said = done("campaign", "check")
    assert "…" not in said
    # folded, so that the columns behind it are there: the last one counts lost counts
    rows = [line for line in said.splitlines() if line.startswith("encoder_counts_of")]
    assert [line.split()[0] + rest for line in rows for rest in _below(said, line)] == [name] * 2
    assert all(line.split()[-1] == "0" for line in rows)


def test_a_drive_out_of_a_folder(done: Done, logs: list[str], tmp_path: Path) -> None:
    (tmp_path / "fitted").mkdir()
    done("whatif", "hoist", "--scale", "pump=1.1", "--out", "fitted/drive.toml")
    done("campaign", "init", *logs, *COUNTS, "--drive", "fitted")
    assert 'drive = "fitted/drive.toml"' in (tmp_path / "campaign.toml").read_text("utf-8")
    done("campaign", "check")


# --- rig ------------------------------------------------------------------------------------------


Words = Callable[..., str]


SHORT = ("--maneuver", "step:4,start=0.5,stop=1,length=2")


def test_refinements_and_backlash_change_the_logs(done: Words, tmp_path: Path) -> None:
    done("rig", "slew", "--out", "a", "--severity", "clean", *SHORT)
    done("rig", "slew", "--out", "b", "--severity", "clean", "--backlash-deg", "0.1", *SHORT)
    done("rig", "slew", "--out", "c", "--severity", "clean", "--set", "cam_ripple=0.02", *SHORT)
    first, *others = (
        next(iter(Campaign.from_toml(tmp_path / name / "campaign.toml"))) for name in "abc"
    )
    for each in others:
        assert (first["counts"].values != each["counts"].values).any()
        assert (first["current"].values == each["current"].values).all()
    # a fit starts from the drive that was named, and only the truth has what was set
    nominal = Campaign.from_toml(tmp_path / "c" / "campaign.toml").drive("slew")
    assert nominal == Drive.preset("slew")
    truth = Drive.from_toml(tmp_path / "c" / "truth" / "drive.toml")
    assert truth.parameters.refinements == ("cam_ripple",)


def test_rig_refusals(refused: Words, done: Words) -> None:
    assert "no parameter 'wobble'" in refused("rig", "hoist", "--out", "x", "--set", "wobble=1")
    assert "backlash must be 0 or more" in refused(
        "rig", "hoist", "--out", "x", "--backlash-deg", "-1"
    )
    assert "no packaged set, file or folder 'crane'" in refused("rig", "crane", "--out", "x")
    done("rig", "slew", "--out", "y", *SHORT)
    assert "empty" in refused("rig", "slew", "--out", "y", *SHORT)
