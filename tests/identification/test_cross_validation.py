"""Cross-validation: how runs are dealt, and what each fold's fit predicts."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate import Campaign, Channel, Drive, Experiment, InputError, maneuvers
from swashplate.campaign import rig
from swashplate.campaign.experiment import InputSignal, Source
from swashplate.identification.fitting import fit
from swashplate.identification.resampling import (
    CrossValidation,
    Fold,
    cross_validate,
    deal,
)
from swashplate.identification.setup import Setup
from swashplate.identification.validation import predict

SOURCE = Source(Path("log.csv"), "column")
SETUP = Setup.model_validate(
    {
        "stages": [
            {"name": "card", "part": "card", "free": {"J": {"relative": (0.5, 2.0)}}},
            {
                "name": "pump",
                "part": "pump",
                "free": {"Z10": {"relative": (0.8, 1.25), "log": True}},
            },
        ]
    }
)


def run_of(number: int, kind: str, low: float, high: float) -> Experiment:
    time = np.linspace(0.0, 1.0, 11)
    values = np.concatenate([np.zeros(5), [high, low], np.zeros(4)])
    drive = InputSignal("voltage", "V", time, values, "previous", SOURCE)
    channel = Channel("y", "other", "1", time, time, np.ones(11), SOURCE)
    name = f"run {number}"
    return Experiment(name, "hoist", name, "fit", "rest", None, drive, {"y": channel}, f"{kind} x")


KINDS = st.lists(
    st.tuples(
        st.sampled_from(["step", "ramp", "sine", "free"]),
        st.sampled_from([(0.0, 4.0), (-4.0, 0.0), (-4.0, 4.0)]),
    ),
    min_size=2,
    max_size=20,
)


@given(kinds=KINDS, folds=st.integers(2, 20), seed=st.integers(0, 1000))
def test_runs_of_a_kind_are_dealt_apart(
    kinds: list[tuple[str, tuple[float, float]]], folds: int, seed: int
) -> None:
    folds = min(folds, len(kinds))
    runs = [run_of(k, kind, *ends) for k, (kind, ends) in enumerate(kinds)]
    parts = deal(runs, folds, seed)
    assert sorted(place for part in parts for place in part) == list(range(len(runs)))
    sizes = [len(part) for part in parts]
    assert max(sizes) - min(sizes) <= 1
    for stratum in set(kinds):
        alike = [k for k, each in enumerate(kinds) if each == stratum]
        most = max(sum(place in part for place in alike) for part in parts)
        assert most <= ceil(len(alike) / folds)
    assert deal(runs, folds, seed) == parts


def test_too_few_runs_or_folds_are_refused() -> None:
    runs = [run_of(k, "step", 0.0, 4.0) for k in range(3)]
    with pytest.raises(InputError, match="5 folds need at least as many runs; there are 3"):
        deal(runs, 5, 0)
    with pytest.raises(InputError, match="needs at least 2 folds, not 1"):
        deal(runs, 1, 0)


def test_what_folds_lack_is_said() -> None:
    folds = tuple(
        Fold(number, (f"run {number}",), ("a",) if number < 2 else (), {}, number != 1)
        for number in range(3)
    )
    said = " ".join(CrossValidation(0, 4, folds, {}, {}).sentences())
    assert "Interrupted: 3 of 4 folds were fitted." in said
    assert "Fold 1 (without run 0) loses a" in said
    assert "Fold 2 (without run 1) did not converge." in said


class Backwards:
    """An executor whose results come in another order."""

    def run(
        self, function: Callable[[Any, Any], Any], shared: Any, items: Sequence[Any]
    ) -> Iterator[tuple[int, Any]]:
        for position in reversed(range(len(items))):
            yield position, function(shared, items[position])


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """Three short steps up and one down."""
    commands = [
        maneuvers.step(level, start=0.5, stop=2.5, length=4.0) for level in (3.0, 4.0, 5.0, -4.0)
    ]
    truth = Drive.preset("hoist").replace(J=(0.26, 0.31), Z10=13.0)
    tests = rig.run("hoist", commands, seed=2, truth=truth, severity="clean")
    path = rig.write(tests, tmp_path_factory.mktemp("rig") / "tests")
    text = path.read_text("utf-8").replace('role = "validate"', 'role = "fit"')
    path.write_text(text, "utf-8")
    return Campaign.from_toml(path)


@pytest.fixture(scope="module")
def found(campaign: Campaign) -> CrossValidation:
    nominal = Drive.preset("hoist").parameters
    return cross_validate(campaign.experiments, nominal, SETUP, folds=4)


def test_each_fold_is_predicted_by_a_fit_to_the_others(
    campaign: Campaign, found: CrossValidation
) -> None:
    assert sorted(name for fold in found.folds for name in fold.held) == sorted(
        each.name for each in campaign
    )
    fold = found.folds[0]
    others = [each for each in campaign if each.name not in fold.held]
    alone = fit(Drive.preset("hoist").parameters, others, SETUP)
    (held,) = fold.held
    predicted = {each.channel: each for each in predict(alone.parameters, [campaign[held]])}
    for channel, quality in predicted.items():
        assert fold.measures[channel] == quality.measures
    samples = [each.measures["current"].samples for each in found.folds]
    squares = [each.measures["current"].rmse ** 2 for each in found.folds]
    pooled = np.average(squares, weights=samples) ** 0.5
    assert found.measures["current"].rmse == pytest.approx(pooled)
    assert found.measures["current"].fit_percent > 90.0


def test_a_fold_that_loses_an_unknown_says_so(found: CrossValidation) -> None:
    losing = [fold for fold in found.folds if fold.lost]
    (fold,) = losing
    assert fold.lost == ("J_minus",)
    assert fold.held[0].endswith("-4_V")
    assert any("loses J_minus, on which no other run depends" in s for s in found.sentences())


def test_the_result_does_not_depend_on_where_it_is_computed(
    campaign: Campaign, found: CrossValidation
) -> None:
    nominal = Drive.preset("hoist").parameters
    again = cross_validate(campaign.experiments, nominal, SETUP, folds=4, executor=Backwards())
    assert again == found


def test_folds_that_are_done_survive_ctrl_c(campaign: Campaign) -> None:
    def stop(fold: Fold, done: int) -> None:
        raise KeyboardInterrupt

    nominal = Drive.preset("hoist").parameters
    kept = cross_validate(campaign.experiments, nominal, SETUP, folds=4, watch=stop)
    assert len(kept.folds) == 1
    assert kept.planned == 4


def test_a_fold_that_cannot_be_fitted_says_why(campaign: Campaign) -> None:
    first, *others = campaign.experiments
    bare = [replace(each, channels={"counts": each["counts"]}) for each in others]
    nominal = Drive.preset("hoist").parameters
    found = cross_validate([first, *bare], nominal, SETUP, folds=4)
    (failed,) = [fold for fold in found.folds if fold.failure]
    assert failed.held == (first.name,)
    assert "The stage 'card' fits" in failed.failure
    assert any("could not be fitted: The stage 'card'" in s for s in found.sentences())
