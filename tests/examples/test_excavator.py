"""The excavator's cylinders, end to end; the logs lie beside the checkout, if at all."""

import re
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from swashplate.campaign.experiment import Channel, Experiment, InputSignal, Source
from swashplate.identification.model import Differentiable, Linearised
from swashplate.identification.problem import Problem
from swashplate.identification.solving import solve
from swashplate.identification.unknowns import Unknown, Unknowns

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data" / "excavator"
PAGE = (ROOT / "docs" / "own-models.md").read_text("utf-8")
logs = pytest.mark.skipif(
    not DATA.exists(), reason="the excavator's logs are not beside this checkout"
)


@pytest.fixture(scope="module")
def excavator(load_example: Callable[[str], ModuleType]) -> ModuleType:
    return load_example("excavator")


def rod(excavator: ModuleType, command: float, slope: float = 0.0, seconds: float = 2.0) -> float:
    steps = round(seconds / excavator.STEP)
    return float(
        excavator.rod_position(
            np.full(steps, command), 1e-6, (1.2, 1.0), 0.25, (0.02, 0.03), slope, 0.1, 0.08
        )[-1]
    )


def test_within_the_overlap_the_rod_stays(excavator: ModuleType) -> None:
    assert rod(excavator, 1.2) == rod(excavator, -1.0) == 0.1


def test_beyond_it_the_flow_saturates(excavator: ModuleType) -> None:
    # by hand: 2 s at 20 mm/s (1 - exp(-0.5/0.25)), and back at 30 mm/s (1 - exp(-0.7/0.25))
    assert rod(excavator, 1.7) == pytest.approx(0.1 + 0.04 * (1.0 - np.exp(-2.0)), rel=1e-9)
    assert rod(excavator, -1.7) == pytest.approx(0.1 - 0.06 * (1.0 - np.exp(-2.8)), rel=1e-9)


def test_a_load_slows_what_extends_and_helps_it_back(excavator: ModuleType) -> None:
    # 20 mm beyond the middle, half of 40 mm: speeds change by half of the slope, to first order
    out, back = rod(excavator, 9.0, 0.2, 0.02) - 0.1, rod(excavator, -9.0, 0.2, 0.02) - 0.1
    assert out == pytest.approx(0.02 * 0.02 * 0.9, rel=1e-6)
    assert back == pytest.approx(-0.02 * 0.03 * 1.1, rel=1e-6)


def test_the_mean_of_a_held_command(excavator: ModuleType) -> None:
    command = InputSignal(
        "voltage",
        "V",
        np.array([0.0, 1.0, 3.0]),
        np.array([2.0, -1.0, 4.0]),
        "previous",
        Source(Path("none.csv"), "u"),
    )
    edges = np.array([-1.0, 0.0, 0.5, 1.5, 3.0, 4.0])
    # before the log nothing is commanded; from 0.5 to 1.5 s half a second of 2 and half of -1
    assert excavator.mean_command(command, edges) == pytest.approx([0.0, 2.0, 0.5, -1.0, 4.0])


def position(time: list[float], values: list[float], weight: list[float]) -> Channel:
    arrays = (np.array(each, dtype=float) for each in (time, values, weight))
    return Channel("position", "position", "m", *arrays, Source(Path("none.csv"), "x"))


def test_each_window_is_anchored_by_its_first_sample_that_counts(excavator: ModuleType) -> None:
    time = [0.5, 1.0, 5.4, 5.5, 7.6, 19.0, 19.1]
    channel = position(time, time, [1, 1, 1, 1, 1, 0, 1])
    moved = excavator.since_anchor(channel, channel.values)
    assert moved == pytest.approx([0.0, 0.5, 4.9, 0.0, 2.1, -0.1, 0.0])
    # nothing counts in the second window, or nowhere
    channel = position(time, time, [0, 1, 0, 0, 0, 0, 0])
    moved = excavator.since_anchor(channel, channel.values)
    assert moved == pytest.approx([-0.5, 0.0, 4.4, 0.0, 2.1, 0.0, 0.1])
    ignored = excavator.since_anchor(position(time, time, [0] * 7), np.array(time))
    assert ignored == pytest.approx([0.0, 0.5, 4.9, 0.0, 2.1, 0.0, 0.1])


class Ramp:
    """A position that grows by a speed, from a zero of its own."""

    def simulate(self, values, experiment):
        return {"position": 3.0 + values["speed"] * experiment["position"].time}


class KnownRamp(Ramp):
    """The same, with derivatives."""

    def linearise(self, values, experiment, names):
        by = np.column_stack([experiment["position"].time for _ in names])
        return {"position": Linearised(self.simulate(values, experiment)["position"], by)}


@pytest.mark.parametrize("model", [Ramp(), KnownRamp()])
def test_a_position_that_slips_between_windows_does_not_spoil_the_speed(
    excavator: ModuleType, model: Ramp
) -> None:
    time = np.arange(0.0, 20.0, 0.25)
    channel = position(time, 0.7 * time + 2.0 * np.floor(time / 5.0), np.ones(time.size))
    command = InputSignal("other", "1", time, time, "linear", channel.source)
    parts = ("run", "axis", "run", "fit", "rest", None, command, {"position": channel})
    made = excavator.anchored_model(model)
    assert isinstance(made, Differentiable) == isinstance(model, Differentiable)
    problem = Problem(
        made,
        (excavator.anchored(Experiment(*parts)),),
        Unknowns((Unknown("speed", 1.0, 0.1, 5.0),)),
        ("position",),
        {"position": 1.0},
    )
    found = problem.unknowns.values(solve(problem).vector)
    assert found["speed"] == pytest.approx(0.7, abs=1e-9)


@logs
def test_traps_of_the_data(excavator: ModuleType) -> None:
    tests = excavator.load(DATA)
    assert len(tests) == 12
    for each in tests:
        # mm and cm come out alike, and each command begins at neutral
        assert 0.0 <= each["position"].values.min() < each["position"].values.max() < 0.13
        assert each.input.values[0] == pytest.approx(0.0, abs=1e-9)


def table() -> list[list[str]]:
    rows = re.findall(r"^\| (boom|stick|bucket) \|(.*)\|$", PAGE, re.MULTILINE)
    return [[axis, *(cell.strip() for cell in cells.split("|"))] for axis, cells in rows]


@logs
@pytest.mark.slow
def test_the_table_of_the_page(
    excavator: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["excavator.py", str(DATA)])
    excavator.main()
    printed = capsys.readouterr().out
    rows = re.findall(r"^\| (boom|stick|bucket) \|(.*)\|$", printed, re.MULTILINE)
    assert len(rows) == len(table()) == 12
    wins = 0
    for (axis, cells), stated in zip(rows, table(), strict=True):
        trial, moved, line, valve, lost = (cell.strip() for cell in cells.split("|"))
        assert [axis, trial, lost] == [*stated[:2], stated[5]]
        # the last digit, and where the solver stops on another processor
        for number, said in zip((moved, line, valve), stated[2:5], strict=True):
            assert float(number) == pytest.approx(float(said), abs=0.021)
        assert (float(valve) < float(line)) == (lost == "")
        wins += lost == ""
    assert f"The valve is the better one in {wins} of 12." in printed
    assert wins == 10


@logs
def test_the_figure(excavator: ModuleType, tmp_path: Path) -> None:
    figure = tmp_path / "excavator.png"
    excavator.draw(excavator.load(DATA), "manual_ol_1010_2055", figure)
    assert figure.stat().st_size > 20_000
