"""The excavator's cylinders, end to end; the logs lie beside the checkout, if at all."""

import re
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from swashplate import Campaign
from swashplate.equations import simulate

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data" / "excavator"
PAGE = (ROOT / "docs" / "own-models.md").read_text("utf-8")
RATE = 50.0
logs = pytest.mark.skipif(
    not DATA.exists(), reason="the excavator's logs are not beside this checkout"
)


@pytest.fixture(scope="module")
def excavator(load_example: Callable[[str], ModuleType]) -> ModuleType:
    return load_example("excavator")


def test_beyond_its_overlap_the_flow_saturates(excavator: ModuleType) -> None:
    """By hand: 2 s at 20 mm/s (1 - exp(-0.5/0.25)), and back at 30 mm/s (1 - exp(-0.7/0.25))."""
    p = excavator.Valve(0.0, 1e-6, 1.2, 1.0, 0.25, 0.02, 0.03, 0.0)
    moves = {1.2: 0.0, -1.0: 0.0, 1.7: 0.04 * (1.0 - np.exp(-2.0))}
    for command, moved in (moves | {-1.7: -0.06 * (1.0 - np.exp(-2.8))}).items():
        record, stroke = {"command": np.full(201, command)}, excavator.Stroke(0.08)
        run = simulate(excavator.valve, p, record, RATE, given=stroke, begin={"position": 0.1})
        assert run["position"][200] - run["position"][100] == pytest.approx(moved, rel=1e-9)


@logs
def test_traps_of_the_data(excavator: ModuleType) -> None:
    tests = Campaign.from_toml(excavator.CAMPAIGN, logs=DATA)
    assert len(tests) == 12
    for each in tests:
        # mm and cm come out alike, and each command begins at neutral
        assert 0.0 <= each["position"].values.min() < each["position"].values.max() < 0.13
        assert each.input.values[0] == pytest.approx(0.0, abs=1e-9)
        assert each.maneuver == "unnamed motion"  # of hands at a joystick
    # irregular stamps are kept as they are
    stamps = tests["manual_1021_mitch boom"].input.time
    assert stamps[:2].tolist() == [0.00605297088623, 0.0761840343475]


def table() -> list[list[str]]:
    rows = re.findall(r"^\| (boom|stick|bucket) \|(.*)\|$", PAGE, re.MULTILINE)
    return [[axis, *(cell.strip() for cell in cells.split("|"))] for axis, cells in rows]


@logs
@pytest.mark.slow
def test_a_cylinder_of_the_pages_table_and_its_figure(
    excavator: ModuleType,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    figure = tmp_path / "excavator.png"
    # the boom has a trial that the valve loses; the other two cylinders take as long again each
    words = [str(DATA), "--cylinder", "boom", "--figure", str(figure)]
    monkeypatch.setattr(sys, "argv", ["excavator.py", *words])
    excavator.main()
    assert figure.stat().st_size > 20_000
    printed = capsys.readouterr().out
    rows = re.findall(r"^\| (boom|stick|bucket) \|(.*)\|$", printed, re.MULTILINE)
    assert len(table()) == 12
    boom = [row for row in table() if row[0] == "boom"]
    wins = 0
    for (axis, cells), stated in zip(rows, boom, strict=True):
        trial, moved, line, valve, lost = (cell.strip() for cell in cells.split("|"))
        assert [axis, trial, lost] == [*stated[:2], stated[5]]
        # the last digit, and where the solver stops on another processor
        for number, said in zip((moved, line, valve), stated[2:5], strict=True):
            assert float(number) == pytest.approx(float(said.split(" ")[0]), abs=0.021)
        assert (float(valve) < float(line)) == (lost == "")
        wins += lost == ""
    assert wins == 3
    assert "The valve is the better one in 3 of 4." in printed
