"""Runs stand in the order in which they were recorded, by their clocks."""

import os
import tomllib
from pathlib import Path

import numpy as np
import pytest
from tests.drafting.conftest import Drafted

from swashplate import Campaign, ParameterError
from swashplate.drafting import draft_campaign

NAMES = "ramp", "sine", "step"
"""As a folder lists them; recorded were step, ramp and sine."""
BEGAN = {"ramp": 1_770_003_600.0, "sine": 1_770_007_200.0, "step": 1_770_000_000.0}
"""Seconds since 1970."""
LENGTH = 2.0
AXIS = """
[axes.winch]
time = { column = "time", unit = "s" }
input = { kind = "voltage", column = "u", unit = "V" }
channels.speed = { kind = "shaft_speed", column = "n", unit = "rad/s" }
"""


def written(folder: Path, *, calendar: bool, drop: str = "") -> list[Path]:
    """Logs of the three runs, in the order of their names."""
    paths = []
    for name in NAMES:
        since = np.linspace(0.0, LENGTH, 201)
        time = since + BEGAN[name] if calendar and name != drop else since
        rows = [f"{t:.3f},{min(t, 1.0):.3f},{t:.4f}" for t in time]
        path = folder / f"{name}.csv"
        path.write_text("\n".join(["time,u,n", *rows]) + "\n", "utf-8")
        paths.append(path)
    return paths


def file_of(folder: Path, entries: dict[str, str]) -> Path:
    runs = [f'[[runs]]\nfile = "{name}.csv"\n{entries.get(name, "")}\n' for name in NAMES]
    path = folder / "campaign.toml"
    path.write_text("\n".join([AXIS, *runs]), "utf-8")
    return path


def test_stamps_of_a_calendar_put_runs_in_order(tmp_path: Path) -> None:
    written(tmp_path, calendar=True)
    tests = Campaign.from_toml(file_of(tmp_path, {}))
    assert [each.name for each in tests] == ["step", "ramp", "sine"]
    assert [each.recorded for each in tests] == pytest.approx(sorted(BEGAN.values()), abs=1e-3)


def test_the_campaign_file_may_say_when(tmp_path: Path) -> None:
    written(tmp_path, calendar=False)
    said = {
        "ramp": "recorded = 2026-02-02T10:00:00",
        "sine": "recorded = 2026-02-02T12:00:00+01:00",
        "step": "recorded = 2026-02-02T09:59:59Z",
    }
    tests = Campaign.from_toml(file_of(tmp_path, said))
    assert [each.name for each in tests] == ["step", "ramp", "sine"]
    with pytest.raises(ParameterError, match="recorded"):
        Campaign.from_toml(file_of(tmp_path, {"ramp": 'recorded = "yesterday"'}))


def test_without_the_time_of_one_run_the_file_s_order_stays(tmp_path: Path) -> None:
    written(tmp_path, calendar=True, drop="sine")
    tests = Campaign.from_toml(file_of(tmp_path, {}))
    assert [each.name for each in tests] == [*NAMES]
    assert tests["sine"].recorded is None


def test_a_draft_takes_the_files_times_if_no_runs_overlap(tmp_path: Path) -> None:
    paths = written(tmp_path, calendar=False)
    for path in paths:
        ended = BEGAN[path.stem] + LENGTH
        os.utime(path, (ended, ended))
    text = draft_campaign(paths, tmp_path)
    runs = tomllib.loads(text)["runs"]
    assert [run["file"] for run in runs] == ["step.csv", "ramp.csv", "sine.csv"]
    stated = {Path(run["file"]).stem: run["recorded"].timestamp() for run in runs}
    assert stated == BEGAN
    assert text.count("guessed: time of writing of its file") == 3


def test_copies_say_nothing_of_their_order(drafted: Drafted, tmp_path: Path) -> None:
    """They were written within an instant, while each run lasts two seconds."""
    paths = written(tmp_path, calendar=False)
    for late, path in enumerate(paths):
        os.utime(path, (BEGAN["step"] - 0.1 * late,) * 2)
    text = draft_campaign(paths, tmp_path)
    content = tomllib.loads(text)
    assert [run["file"] for run in content["runs"]] == [f"{name}.csv" for name in NAMES]
    assert not any("recorded" in run for run in content["runs"])
    assert "state recorded" in text
