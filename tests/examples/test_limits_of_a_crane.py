"""examples/limits_of_a_crane.py: reference numbers of the hoist, closed forms of the sizing."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from swashplate import Drive


@pytest.fixture(scope="module")
def run(run_example: Callable[..., Any]) -> Any:
    return run_example("limits_of_a_crane", "--figure", "limits.png")


def numbers(line: str) -> list[float]:
    return [float(each) for each in re.findall(r"-?\d+\.?\d*", line)]


def test_the_page(run: Any, matches_page: Callable[[str, str], None]) -> None:
    matches_page("limits_of_a_crane", run.printed)


def test_the_envelope_is_the_source_s(run: Any) -> None:
    up, down = run.printed.splitlines()[:2]
    # saturation voltage, speed limit, acceleration with the orifice fully open
    assert numbers(up)[1:4] == [7.87, 196.0, 136.8]
    assert numbers(down)[1:4] == [-7.41, -185.0, -177.8]


def test_speed_needs_the_pump_and_acceleration_the_product(run: Any) -> None:
    # speed goes with the pump alone, acceleration with pump times orifice: 1.1, and 1.2/1.1
    assert "pump x 1.100, by itself x 1.200" in run.printed
    assert "orifice x 1.091, by itself never" in run.printed


def test_a_set_of_one_s_own(run_example: Callable[..., Any], tmp_path: Path) -> None:
    Drive.preset("slew").to_toml(tmp_path / "mine.toml")
    printed = run_example("limits_of_a_crane", str(tmp_path / "mine.toml")).printed
    assert numbers(printed.splitlines()[0])[1:4] == [5.3, 4.2, 5.8]
    assert "swash stop" in printed
