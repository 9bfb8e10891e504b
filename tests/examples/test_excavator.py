"""The excavator's cylinders, end to end; the logs lie beside the checkout, if at all."""

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
DATA = ROOT.parent / "shared" / "data" / "excavator"
PAGE = (ROOT / "docs" / "user-defined-models.md").read_text("utf-8")
RATE = 50.0
logs = pytest.mark.skipif(
    not DATA.exists(), reason="the excavator's logs are not beside this checkout"
)


@pytest.fixture(scope="module")
def excavator(load_example: Callable[[str], ModuleType]) -> ModuleType:
    return load_example("excavator")


@pytest.mark.parametrize(
    ("demand", "boom", "outward", "back"),
    [(0.0, 0.0, 1.0, 1.0), (1.0, 0.0, 0.75, 0.6), (4.0, 0.0, 0.0, 0.0), (0.0, 2.0, 1.2, 0.8)],
)
def test_flow_beyond_the_overlap_and_what_others_take(
    excavator: ModuleType, demand: float, boom: float, outward: float, back: float
) -> None:
    """By hand: 2 s at 20 mm/s (1 - exp(-0.5/0.25)), and back at 30 mm/s (1 - exp(-0.7/0.25))."""
    p = excavator.Valve(
        delay=0.0,
        lag=1e-6,
        overlap_out=1.2,
        overlap_back=1.0,
        width=0.25,
        loss_out=0.25,
        loss_back=0.4,
        rise_out=0.1,
        rise_back=-0.1,
        speed_out=0.02,
        speed_back=0.03,
    )
    moves = {
        1.2: 0.0,
        -1.0: 0.0,
        1.7: outward * 0.04 * (1.0 - np.exp(-2.0)),
        -1.7: -back * 0.06 * (1.0 - np.exp(-2.8)),
    }
    for command, moved in moves.items():
        levels = {"command": command, "demand": demand, "boom": boom}
        record = {name: np.full(201, level) for name, level in levels.items()}
        run = simulate(Machine(excavator.valve, p), record, RATE)
        assert run["position"][200] - run["position"][100] == pytest.approx(moved, abs=1e-12)


def test_speeds_of_a_trial_are_learned_from_its_motion(excavator: ModuleType) -> None:
    columns = np.random.default_rng(1).normal(0.0, 0.02, (5000, 2))
    measured = columns @ [1.2, 0.9]
    assert excavator.speed_factors(columns[:0], measured[:0]) == pytest.approx([1.0, 1.0])
    # fifty windows, each as good as 3 mm of 20 mm, against 15 %
    assert excavator.speed_factors(columns, measured) == pytest.approx([1.2, 0.9], abs=0.01)


def test_an_effect_is_found_beside_the_speeds_of_the_trials(excavator: ModuleType) -> None:
    """Other speeds in each trial, and a cause that takes 30 % of the motion back."""
    random = np.random.default_rng(2)
    trial = np.repeat([0, 1], 200)
    simulated = np.maximum(random.normal(0.0, 1e-2, (400, 2)), 0.0) * [1.0, -1.0]
    cause = (random.random(400) < 0.3).astype(float)
    own = simulated * np.where(trial == 0, 0.1, -0.2)[:, None]
    residual = own.sum(axis=1) - 0.3 * cause * simulated[:, 1]
    residual += random.normal(0.0, 1e-4, 400)
    pieces = excavator.Pieces(residual, simulated, trial, np.arange(400) // 10, {"cause": cause})
    effect = excavator.effect_of(cause, pieces)
    assert effect.change == pytest.approx([0.0, -0.3], abs=0.01)
    assert effect.low[1] < -0.3 < effect.high[1]
    without = excavator.effect_of(random.normal(size=400), pieces)
    assert 0.0 <= without.explained < 0.05 < effect.explained


@logs
def test_traps_of_the_data(excavator: ModuleType) -> None:
    tests = Campaign.from_toml(excavator.CAMPAIGN, logs=DATA)
    assert len(tests) == 16
    for run in tests:
        # each command begins at neutral
        assert run.input.values[0] == pytest.approx(0.0, abs=1e-9)
        assert run.maneuver == "unnamed motion"  # of hands at a joystick
        if run.axis in excavator.CYLINDERS:
            # mm and cm come out alike
            assert 0.0 <= run["position"].values.min() < run["position"].values.max() < 0.13
    # irregular stamps are kept as they are
    stamps = tests["manual_1021_mitch boom"].input.time
    assert stamps[:2].tolist() == [0.00605297088623, 0.0761840343475]


def rows_of(text: str, corner: str) -> dict[str, list[str]]:
    """Cells of a table's rows by their first cell; `corner` is the table's own first cell."""
    (table,) = re.findall(rf"(?s)^\| {corner} \|.*?(?:\n\n|\Z)", text, re.MULTILINE)
    rows = re.findall(r"^\| ([^|]+) \|(.*)\|$", table, re.MULTILINE)
    return {name: [cell.strip() for cell in cells.split("|")] for name, cells in rows}


@logs
@pytest.mark.slow
def test_the_buckets_table_and_its_figure(
    excavator: ModuleType,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    figure = tmp_path / "excavator.png"
    # the other two cylinders take as long again each
    words = [str(DATA), "--cylinder", "bucket", "--figure", str(figure)]
    monkeypatch.setattr(sys, "argv", ["excavator.py", *words])
    excavator.main()
    assert figure.stat().st_size > 20_000
    printed = capsys.readouterr().out
    found, stated = (rows_of(text, "bucket, left out") for text in (printed, PAGE))
    assert list(found) == list(stated)
    for trial, cells in found.items():
        if trial.startswith("manual_"):
            # the last digit, and where the solver stops on another processor
            errors = [float(cell) for cell in cells]
            assert errors == pytest.approx([float(cell) for cell in stated[trial]], abs=0.05)
    ratios = {
        name: [float(number) for number in re.findall(r"[\d.]+", bucket)]
        for name, (bucket, _) in rows_of(printed, f"{excavator.BEST}, error to that of").items()
    }
    assert ratios["straight line"][0] < 0.45
    assert ratios["lag"][0] < 0.65
    # what the residuals show of the boom's height holds on trials that were left out
    _, _, high = ratios["pump, learning"]
    assert high < 1.0
