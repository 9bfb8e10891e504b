"""Positions re-anchored to the measurement: windows, differences and their derivatives."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate.campaign.experiment import Channel, Experiment, InputSignal, Source
from swashplate.errors import InputError
from swashplate.identification.anchoring import (
    anchor_rows,
    anchored,
    anchored_model,
    since_anchor,
)
from swashplate.identification.model import Differentiable, Linearised
from swashplate.identification.problem import Problem
from swashplate.identification.solving import solve
from swashplate.identification.unknowns import Unknown, Unknowns

Array = np.ndarray
NOWHERE = Source(Path("none.csv"), "x")


def channel(time: Sequence[float], values: Sequence[float], weight: Sequence[float]) -> Channel:
    arrays = (np.array(each, dtype=float) for each in (time, values, weight))
    return Channel("position", "position", "m", *arrays, NOWHERE)


def experiment(measured: Channel) -> Experiment:
    command = InputSignal("other", "1", measured.time, measured.values, "linear", NOWHERE)
    return Experiment("run", "axis", "run", "fit", "rest", None, command, {"position": measured})


class Ramp:
    """A position that grows by a speed, from a zero of its own."""

    def simulate(self, values: Mapping[str, float], experiment: Experiment) -> Mapping[str, Array]:
        return {"position": 3.0 + values["speed"] * experiment["position"].time}


class KnownRamp(Ramp):
    """The same, with derivatives."""

    def linearise(
        self, values: Mapping[str, float], experiment: Experiment, names: Sequence[str]
    ) -> Mapping[str, Linearised]:
        by = {"speed": experiment["position"].time}
        output = self.simulate(values, experiment)["position"]
        return {"position": Linearised(output, np.column_stack([by[name] for name in names]))}


def test_a_window_is_anchored_by_its_first_sample() -> None:
    stamps = [0.5, 1.0, 2.4, 2.5, 2.6, 9.0, 9.1]
    assert anchor_rows(channel(stamps, stamps, [1] * 7), 2.0).tolist() == [0, 0, 0, 3, 3, 5, 5]


def test_samples_that_do_not_count_anchor_nothing_if_others_do() -> None:
    stamps = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    rows = anchor_rows(channel(stamps, stamps, [0, 1, 0, 0, 1, 1]), 2.0)
    assert rows.tolist() == [1, 1, 2, 2, 4, 4]
    assert anchor_rows(channel(stamps, stamps, [0] * 6), 2.0).tolist() == [0, 0, 2, 2, 4, 4]


@given(
    st.lists(st.floats(1e-3, 3.0), min_size=1, max_size=40),
    st.lists(st.booleans(), min_size=40, max_size=40),
    st.floats(0.1, 10.0),
)
def test_anchors_by_a_plain_loop(gaps: list[float], used: list[bool], every: float) -> None:
    stamps = np.cumsum(gaps)
    windows = [int((t - stamps[0]) // every) for t in stamps]
    counts = used[: len(gaps)]
    expected = []
    for window in windows:
        held = [k for k, each in enumerate(windows) if each == window]
        expected.append(next((k for k in held if counts[k]), held[0]))
    assert anchor_rows(channel(stamps, stamps, counts), every).tolist() == expected


def test_rows_of_vectors_and_of_matrices() -> None:
    anchors = np.array([0, 0, 2])
    assert since_anchor(np.array([5.0, 7.0, 4.0]), anchors).tolist() == [0.0, 2.0, 0.0]
    matrix = np.array([[5.0, 1.0], [7.0, 0.0], [4.0, 2.0]])
    assert since_anchor(matrix, anchors).tolist() == [[0.0, 0.0], [2.0, -1.0], [0.0, 0.0]]


@pytest.mark.parametrize("every", [0.0, -1.0, np.nan, np.inf])
def test_windows_without_length_are_refused(every: float) -> None:
    with pytest.raises(InputError, match="give a positive number of seconds"):
        anchor_rows(channel([0.0, 1.0], [0.0, 1.0], [1, 1]), every)


def test_an_unknown_channel_is_refused() -> None:
    with pytest.raises(InputError, match="has no channel 'angle'; it has position"):
        anchored(experiment(channel([0.0, 1.0], [0.0, 1.0], [1, 1])), ["angle"], 1.0)


def test_an_experiment_is_left_as_it_was() -> None:
    run = experiment(channel([0.0, 1.0, 2.0, 3.0], [5.0, 6.0, 8.0, 11.0], [1] * 4))
    moved = anchored(run, ["position"], 2.0)
    assert moved["position"].values.tolist() == [0.0, 1.0, 0.0, 3.0]
    assert run["position"].values.tolist() == [5.0, 6.0, 8.0, 11.0]


@pytest.mark.parametrize("model", [Ramp(), KnownRamp()])
def test_a_model_is_as_differentiable_as_before(model: Ramp) -> None:
    run = experiment(channel([0.0, 1.0, 2.0, 3.0], [0.0] * 4, [1] * 4))
    made = anchored_model(model, ["position"], 2.0)
    assert isinstance(made, Differentiable) == isinstance(model, Differentiable)
    assert made.simulate({"speed": 2.0}, run)["position"].tolist() == [0.0, 2.0, 0.0, 2.0]
    if isinstance(made, Differentiable):
        output = made.linearise({"speed": 2.0}, run, ["speed"])["position"]
        assert output.values.tolist() == [0.0, 2.0, 0.0, 2.0]
        assert output.by.tolist() == [[0.0], [1.0], [0.0], [1.0]]


@pytest.mark.parametrize("model", [Ramp(), KnownRamp()])
def test_a_position_that_slips_between_windows_does_not_spoil_the_speed(model: Ramp) -> None:
    time = np.arange(0.0, 20.0, 0.25)
    slipped = 0.7 * time + 2.0 * np.floor(time / 5.0)
    run = experiment(channel(time, slipped, np.ones(time.size)))
    problem = Problem(
        anchored_model(model, ["position"], 5.0),
        (anchored(run, ["position"], 5.0),),
        Unknowns((Unknown("speed", 1.0, 0.1, 5.0),)),
        ("position",),
        {"position": 1.0},
    )
    found = problem.unknowns.values(solve(problem).vector)
    assert found["speed"] == pytest.approx(0.7, abs=1e-9)
