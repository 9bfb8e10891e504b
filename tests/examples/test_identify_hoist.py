"""examples/identify_hoist.py: what it found is held against the truth that the rig wrote."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from swashplate import Drive

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def run(run_example: Callable[..., Any]) -> Any:
    return run_example("identify_hoist", "--figure", "identified.png")


@pytest.fixture(scope="module")
def truth(run: Any) -> Drive:
    (path,) = [
        each
        for each in (run.folder / "identified" / "virtual" / "truth").glob("*.toml")
        if each.name != "truth.toml"
    ]
    return Drive.from_toml(path)


def test_the_page(run: Any, matches_page: Callable[[str, str], None]) -> None:
    matches_page("identify_hoist", run.printed)


def test_the_truth_stands_beside_the_estimates(run: Any, truth: Drive) -> None:
    rows = re.findall(r"^(\w+) +(\S+) +(\S+) +(\S+) +(\S+)$", run.printed, re.MULTILINE)
    shown = {
        row[0]: [float(each) for each in row[1:]] for row in rows if row[0] in truth_names(truth)
    }
    assert len(shown) == len(run.names["SHOWN"])
    for name, (true, estimate, lower, upper) in shown.items():
        assert true == pytest.approx(truth.parameters.numbers[name], rel=1e-3)
        # 12 bits and an encoder of 2526 counts a turn: half a per cent is what is left
        assert estimate == pytest.approx(true, rel=5e-3)
        assert lower < estimate < upper
    # by chance 37 of 39 intervals of 95 % hold the truth, and with 1 % chance fewer than 34
    ((held, counted),) = re.findall(r"(\d+) of (\d+) intervals", run.printed)
    assert int(held) >= int(counted) - 5


def truth_names(truth: Drive) -> set[str]:
    return set(truth.parameters.numbers)


def test_the_set_drives_as_the_truth_does(run: Any, truth: Drive) -> None:
    fitted = Drive.from_toml(run.folder / "identified" / "drive.toml")
    assert fitted.name == "identified"
    volts = 6.0 * np.sin(2.0 * np.pi * 0.2 * np.arange(0.0, 10.0, 1.0 / 512.0))
    true, found = truth.simulate(volts).shaft_speed, fitted.simulate(volts).shaft_speed
    assert np.sqrt(np.mean((true - found) ** 2)) < 2e-3 * np.ptp(true)
    limits = re.findall(r"limits: (\S+) (\S+) deg/s", run.printed)
    expected = np.degrees(truth.parameters.numbers["Z10"] * np.array(truth["Z13"].values))
    for low, high in limits:
        assert [float(high), -float(low)] == pytest.approx(expected, rel=2e-3)
