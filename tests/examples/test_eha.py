"""The electro-hydrostatic actuator, end to end; the logs lie beside the checkout, if at all."""

import re
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from swashplate import Campaign
from swashplate.machine import Machine, simulate

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data" / "eha"
PAGE = (ROOT / "docs" / "user-defined-models.md").read_text("utf-8")
RATE = 1000.0
logs = pytest.mark.skipif(
    not DATA.exists(), reason="the actuator's logs are not beside this checkout"
)


@pytest.fixture(scope="module")
def eha(load_example: Callable[[str], ModuleType]) -> ModuleType:
    return load_example("eha")


def rod(eha: ModuleType, pump: float, pressure_a: np.ndarray, pressure_b: np.ndarray) -> np.ndarray:
    """Position at a constant speed of the pump. [m]"""
    p = eha.Actuator(stroke=6e-4, area_ratio=1.5, slip=2.0, air_a=3.0, air_b=2.0)
    record = {
        "pump": np.full(pressure_a.size, pump),
        "pressure_a": pressure_a,
        "pressure_b": pressure_b,
    }
    return simulate(Machine(eha.ACTUATOR.model, p), record, RATE)["position"]


@pytest.mark.parametrize(
    ("pump", "a", "b", "speed"),
    [
        # by hand: 6e-4 m a turn, 1.5 times that back, less 2 1/min of slip for each bar
        (600.0, 30.0, 5.0, 6e-4 * (600.0 - 50.0) / 60.0),
        (-600.0, 5.0, 30.0, -9e-4 * (600.0 - 50.0) / 60.0),
        (0.0, 30.0, 5.0, 0.0),
        (40.0, 30.0, 5.0, 0.0),  # the pump slips as fast as it turns, and a check valve holds
    ],
)
def test_speed_at_constant_pressures(
    eha: ModuleType, pump: float, a: float, b: float, speed: float
) -> None:
    position = rod(eha, pump, np.full(1001, a), np.full(1001, b))
    assert position[1000] - position[500] == pytest.approx(0.5 * speed, abs=1e-12)


def test_a_rising_pressure_takes_turns_of_the_pump(eha: ModuleType) -> None:
    """Three turns while the absolute pressure grows e-fold."""
    grid = np.arange(4001) / RATE
    rising = 5.0 * np.exp(np.clip(grid - 1.0, 0.0, 1.0)) - 1.0
    level = np.full(grid.size, 4.0)
    moved = rod(eha, 600.0, rising, rising) - rod(eha, 600.0, level, level)
    assert moved[-1] - moved[500] == pytest.approx(-3.0 * 6e-4, rel=1e-6)


@logs
@pytest.mark.slow
def test_the_page_states_what_each_load_case_gives_of_the_other(
    eha: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tests = Campaign.from_toml(eha.CAMPAIGN, logs=DATA)
    assert [run.name for run in tests] == ["light load", "heavy load"]
    monkeypatch.setattr(sys, "argv", ["eha.py", str(DATA)])
    eha.main()
    printed = capsys.readouterr().out
    pattern = r"^\| ([a-z ]+) \| ([\d.]+) \| ([\d.]+) \| (\S+) .*? \| (\S+) .*\|$"
    found = {name: cells for name, *cells in re.findall(pattern, printed, re.MULTILINE)}
    stated = {name: cells for name, *cells in re.findall(pattern, PAGE, re.MULTILINE)}
    assert list(found) == ["straight line", "lag", "without slip", "without air", eha.FULL]
    for name, cells in found.items():
        # the last digit, and where the solver stops on another processor
        numbers = [float(cell) for cell in cells]
        assert numbers == pytest.approx([float(cell) for cell in stated[name]], abs=0.05)
    to_heavy, to_light, _, to_lag = map(float, found[eha.FULL])
    assert max(to_heavy, to_light) < 0.5
    assert to_lag < 0.6
