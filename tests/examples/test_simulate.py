"""examples/simulate.py: what it prints is what Kruse's equations say."""

import re
from collections.abc import Callable
from math import asin, atan, degrees, sin, sqrt
from typing import Any

import pytest

from swashplate import Drive


@pytest.fixture(scope="module")
def run(run_example: Callable[..., Any]) -> Any:
    return run_example("simulate", "--figure", "simulate.png")


def test_the_page(run: Any, matches_page: Callable[[str, str], None]) -> None:
    matches_page("simulate", run.printed)


def test_without_its_stop_the_plate_is_where_the_spool_balances(run: Any) -> None:
    p = Drive.preset("hoist").parameters.numbers
    i = 0.7452 - p["Z17"]  # the current at 9 V
    force = sum(p[f"Z{18 + k}_plus"] * i**k for k in (1, 2, 3, 4))
    angle = asin(p["Z5"] * force / sqrt(p["Z4"])) + atan(p["Z18"] / p["Z5"])
    speed = degrees(p["Z10"] * atan(sin(angle) / p["Z3"]))
    shown = re.search(r"without swash stop +([\d.]+) deg/s", run.printed)
    assert shown is not None
    assert float(shown[1]) == pytest.approx(speed, abs=0.1)


def test_the_orifice_sets_the_acceleration(run: Any) -> None:
    assert "orifice and pump + 50 %: 294.0 deg/s" in run.printed  # as in Kruse's figure 9.1
    found = dict(re.findall(r"orifice x ([\d.]+): +([\d.]+) deg/s half", run.printed))
    soon = {float(factor): float(speed) - 3.09 for factor, speed in found.items()}
    # 136.8 deg/s² from when the delay of 14 ms and the card's filter are through
    assert 0.44 < soon[1.0] / 136.8 < 0.486
    for factor, speed in soon.items():
        assert speed / soon[1.0] == pytest.approx(factor, rel=0.02)
