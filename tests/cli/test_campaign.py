import json
from collections.abc import Callable
from pathlib import Path

import pytest

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
    assert "1 findings" in said


def test_a_check_without_findings(done: Done, logs: list[str]) -> None:
    done("campaign", "init", *logs, *COUNTS)
    assert "Nothing to look into." in done("campaign", "check")


def test_a_draft_replaces_no_file(done: Done, refused: Callable[..., str], logs: list[str]) -> None:
    done("campaign", "init", *logs, *COUNTS)
    assert "campaign.toml exists already" in refused("campaign", "init", *logs)
    done("campaign", "init", *logs, "--force")


def test_strict_fails_on_findings(
    run: Callable[..., object], done: Done, logs: list[str], tmp_path: Path
) -> None:
    done("campaign", "init", *logs, *COUNTS)
    path = tmp_path / "campaign.toml"
    path.write_text(
        path.read_text("utf-8").replace("counts_per_turn", "sign = -1\ncounts_per_turn"), "utf-8"
    )
    assert "moves against the input" in " ".join(done("campaign", "check").split())
    result = run("campaign", "check", "--strict")
    assert result.exit_code == 1  # type: ignore[attr-defined]


def test_the_schema_is_json(done: Done) -> None:
    schema = json.loads(done("campaign", "schema"))
    assert {"axes", "runs", "title"} <= set(schema["properties"])
    assert "counts_per_turn" in schema["$defs"]["Channel"]["properties"]


def test_a_picture(done: Done, logs: list[str], tmp_path: Path) -> None:
    done("campaign", "init", *logs, *COUNTS)
    done("campaign", "plot", "--out", "tests.png")
    assert (tmp_path / "tests.png").stat().st_size > 10_000


def test_a_close_look(done: Done, refused: Callable[..., str], logs: list[str]) -> None:
    done("campaign", "init", *logs, *COUNTS, "--drive", "hoist")
    look = ("campaign", "plot", "--run", "lift", "--channel")
    for channel in ("encoder_counts", "rectified_current"):
        assert f"Figure: {channel}.svg" in done(
            *look, channel, "--to", "0.5", "--out", f"{channel}.svg"
        )
    assert "go together" in refused("campaign", "plot", "--run", "lift")
    assert "no channel 'speed'" in refused(*look, "speed")


def test_refusals(refused: Callable[..., str], tmp_path: Path) -> None:
    assert "There is no file campaign.toml" in refused("campaign", "check")
    assert "There is no file nothing.csv" in refused("campaign", "init", "nothing.csv")
