"""A command, a current or a motion with the wrong sign, and what is said to do about it."""

import re
from pathlib import Path

import numpy as np
import pytest
from tests.drafting.conftest import TIME, Drafted
from tests.drafting.conftest import drafted as drafted

from swashplate import Campaign, Drive
from swashplate.campaign import campaign_findings, examine
from swashplate.drafting import guess_drive
from swashplate.errors import InputError
from swashplate.identification.diagnostics.data_checks import check_runs

BOTH_WAYS = 4.0 * ((TIME > 1.0) & (TIME < 3.0)) - 6.0 * ((TIME > 4.0) & (TIME < 6.0))


def lagged(driven: np.ndarray) -> np.ndarray:
    """What follows by a lag of 0.2 s."""
    share = 1.0 - np.exp(-(TIME[1] - TIME[0]) / 0.2)
    values = np.zeros(driven.size)
    for k in range(1, driven.size):
        values[k] = values[k - 1] + share * (driven[k - 1] - values[k - 1])
    return values


def log(command: float = 1.0, current: float = 1.0, speed: float = 1.0) -> dict[str, np.ndarray]:
    """Columns of a test, each with a sign."""
    flowing = current * BOTH_WAYS
    return {
        "time": TIME,
        "voltage": command * BOTH_WAYS,
        "I plus [A]": 0.1 * np.maximum(flowing, 0.0),
        "I minus [A]": 0.1 * np.maximum(-flowing, 0.0),
        "speed [rpm]": np.round(speed * lagged(5.0 * BOTH_WAYS), 3),
    }


def said(tests: Campaign) -> list[str]:
    of_signals = [text for run in tests for each in examine(run) for text in each.findings]
    return [*of_signals, *campaign_findings(tests)]


SIGNS = {
    "sound": ({}, []),
    "command": ({"command": -1.0}, [r"In log the current flows in the solenoid opposite .*input"]),
    "speed": ({"speed": -1.0}, ["moves against the input: should its sign be -1"]),
    "currents": ({"current": -1.0}, ["swap the columns of current_plus and current_minus"]),
}


@pytest.mark.parametrize(("signs", "expected"), SIGNS.values(), ids=SIGNS)
def test_what_has_the_wrong_sign_is_named(
    drafted: Drafted, signs: dict[str, float], expected: list[str]
) -> None:
    found = said(drafted({"log.csv": log(**signs)}))
    assert len(found) == len(expected)
    for text, pattern in zip(found, expected, strict=True):
        assert re.search(pattern, text)


@pytest.mark.slow
def test_guess_and_fit_reverse_a_command_that_all_logs_have_reversed(
    drafted: Drafted, tmp_path: Path
) -> None:
    tests = drafted({f"{name}.csv": log(command=-1.0) for name in "ab"})
    (sentence,) = said(tests)
    assert sentence.startswith(
        "In all 2 runs of the axis 'drive' the current flows in the solenoid"
    )
    assert sentence.endswith("reverse the input with sign = -1 in [axes.drive.input]")
    with pytest.raises(InputError, match=r"sign = -1 in \[axes.drive.input\]"):
        guess_drive(tests)
    refused = check_runs([*tests], Drive.preset("hoist").parameters)
    assert refused[0].severity == "refuse"
    assert sentence in refused[0].sentence

    path = tmp_path / "campaign.toml"
    text = path.read_text("utf-8").replace("[axes.drive.input]", "[axes.drive.input]\nsign = -1")
    path.write_text(text, "utf-8")
    mended = Campaign.from_toml(path)
    assert said(mended) == []
    assert guess_drive(mended).fit_percent > 90.0


def test_one_reversed_run_is_mended_by_the_printed_entry(drafted: Drafted, tmp_path: Path) -> None:
    logs = {f"{name}.csv": log(command=-1.0 if name == "c" else 1.0) for name in "abc"}
    (sentence,) = said(drafted(logs))
    (entry,) = re.findall(r"axes\.drive\.input\.sign = -1", sentence)
    assert sentence.startswith("In c the current")
    path = tmp_path / "campaign.toml"
    text = path.read_text("utf-8")
    file = next(line for line in text.splitlines() if line.startswith('file = "c.csv"'))
    path.write_text(text.replace(file, f"{file}\n{entry}"), "utf-8")
    assert said(Campaign.from_toml(path)) == []
