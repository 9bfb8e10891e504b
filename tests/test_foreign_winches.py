"""The generator of foreign winches: apart from the package, and right about its own numbers."""

import ast
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
DEGREES = 180.0 / np.pi
WINCH = {
    "dead_zone": [0.35, 0.42],
    "jump": [400.0, 420.0],
    "full": [900.0, 900.0],
    "rate_up": 1500.0,
    "rate_down": 3000.0,
    "current_lag": 0.015,
    "onset": [420.0, 405.0],
    "gain": [0.1375, 0.128],
    "top": [60.0, 55.0],
    "delay": 0.04,
    "omega": 14.0,
    "damping": 0.85,
    "acceleration": [70.0, 80.0],
}
"""A truck crane's winch whose numbers were worked out by hand: 88.7 and 80.5 deg/s per V beyond
0.536 and 0.42 V."""


@pytest.fixture(scope="module")
def winches() -> ModuleType:
    """The benchmark as a module."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        import foreign_winches

        return foreign_winches


def test_it_shares_no_line_with_the_package() -> None:
    tree = ast.parse((BENCHMARKS / "foreign_winches.py").read_text("utf-8"))
    imported = set[str]()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            imported |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            imported.add(str(node.module).partition(".")[0])
    assert "numpy" in imported
    assert "swashplate" not in imported


def test_the_numbers_that_matter_are_those_worked_out_by_hand(winches: ModuleType) -> None:
    found = winches.true_numbers(WINCH)
    assert found["dead_zone_plus"] == pytest.approx(0.536, abs=5e-4)
    assert found["dead_zone_minus"] == pytest.approx(-0.42)
    assert DEGREES * found["gain_plus"] == pytest.approx(88.7, abs=0.05)
    assert DEGREES * found["gain_minus"] == pytest.approx(80.5, abs=0.05)
    assert DEGREES * found["top_speed_plus"] == pytest.approx(360.0)
    assert DEGREES * found["top_speed_minus"] == pytest.approx(-330.0)
    # 70 rpm/s while the speed rises, 80 while it falls, whatever its sign
    assert DEGREES * found["acceleration_plus"] == pytest.approx(420.0, rel=1e-6)
    assert DEGREES * found["acceleration_minus"] == pytest.approx(-480.0, rel=1e-6)
    # 0.02 of 60 rpm takes 17 ms at 70 rpm/s, after 40 ms of delay and what the lags add
    assert 0.057 < found["delay_plus"] < 0.157


def test_a_march_settles_where_the_line_says(winches: ModuleType) -> None:
    """2.5 V from rest: 651 mA, 231 mA beyond the onset, 31.8 rpm."""
    current, speed = winches.marched(WINCH, np.full(round(6.0 / winches.STEP), 2.5))
    wanted = 400.0 + 500.0 * (2.5 - 0.35) / (5.0 - 0.35)
    assert current[0, -1] == pytest.approx(wanted, abs=0.01)
    assert current[1].max() == 0.0
    assert speed[-1] == pytest.approx(0.1375 * (wanted - 420.0), abs=0.01)


def test_draws_keep_their_ranges(winches: ModuleType) -> None:
    for seed in winches.DEVELOPMENT:
        winch = winches.drawn(seed)
        low, high = winches.DELAY
        assert low <= winch["delay"] <= high
        assert winch["rate"] in winches.LOG_RATES
        for plus, minus in (winch["dead_zone"], winch["jump"], winch["top"]):
            assert abs(plus - minus) <= winches.BETWEEN_WAYS * 0.5 * (plus + minus) + 1e-9
        assert winch == winches.drawn(seed)
