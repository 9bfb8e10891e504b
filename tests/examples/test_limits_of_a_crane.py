"""examples/limits_of_a_crane.py: reference numbers of the hoist, closed forms of the sizing."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swashplate import Drive, maneuvers


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


def test_the_orifice_comes_first_and_a_larger_one_shortens_the_step(run: Any) -> None:
    assert run.names["first"] == "orifice"

    def rise(drive: Drive) -> float:
        speed = drive.simulate(maneuvers.step(9.0).sample()).shaft_speed[512:2560]
        first, last = (int(np.argmax(speed >= part * speed[-1])) for part in (0.1, 0.9))
        return (last - first) / 512.0

    hoist = Drive.preset("hoist")
    found = re.search(r"in ([\d.]+) -> ([\d.]+) s", run.printed)
    assert found is not None
    assert float(found[1]) == pytest.approx(rise(hoist), abs=0.01)
    assert float(found[2]) == pytest.approx(rise(hoist.scale(Z16=1.5)), abs=0.01)


def test_slow_sines_reach_the_speed_limit(run: Any) -> None:
    rows = [numbers(line) for line in run.printed.splitlines() if "Hz:" in line]
    assert [row[0] for row in rows] == [0.05, 0.1, 0.2, 0.5]
    assert rows[0][2] == rows[1][2] == 185.0  # the smaller of the two limits
    # a sine of amplitude A needs 2 pi f A; the smaller acceleration is 136.8 deg/s², and a
    # triangle of that slope is within 10 % of a sine of 1.22 times the amplitude it could follow
    assert rows[3][2] < 1.3 * 136.8 / (2.0 * np.pi * 0.5)


def test_speed_needs_the_pump_and_acceleration_the_product(run: Any) -> None:
    # speed goes with the pump alone, acceleration with pump times orifice: 1.1, and 1.2/1.1
    assert "pump x 1.100, by itself x 1.200" in run.printed
    assert "orifice x 1.091, by itself never" in run.printed


def test_the_figure(run: Any) -> None:
    assert (run.folder / "limits.png").stat().st_size > 20_000


def test_a_set_of_one_s_own(run_example: Callable[..., Any], tmp_path: Path) -> None:
    Drive.preset("slew").to_toml(tmp_path / "mine.toml")
    printed = run_example("limits_of_a_crane", str(tmp_path / "mine.toml")).printed
    assert numbers(printed.splitlines()[0])[1:4] == [5.3, 4.2, 5.8]
    assert "swash stop" in printed
