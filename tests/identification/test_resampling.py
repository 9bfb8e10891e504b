"""Estimates from other runs: cross-validation; profiles of a linear model."""

from dataclasses import replace
from math import ceil

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.identification.given import TIME as LINE_TIME
from tests.identification.given import (
    TWO_STAGES,
    Backwards,
    bench_run,
    model_of,
)

from swashplate import Campaign, Drive, Experiment, InputError
from swashplate.identification import (
    CrossValidation,
    Problem,
    Stage,
    StageFit,
    Unknown,
    Unknowns,
    cross_validate,
    fit,
    predict,
    profiles_of,
    solve,
    uncertainty_of,
)
from swashplate.identification.estimation.setup import Free
from swashplate.identification.resampling import Fold, deal
from swashplate.parameters import load_preset


@pytest.fixture
def assessed() -> StageFit:
    """A line fitted to four runs with white noise of 0.1."""
    rng = np.random.default_rng(7)
    runs = tuple(
        bench_run(f"run {k}", 1.0, 2.0 * LINE_TIME + 1.0 + 0.1 * rng.normal(size=81))
        for k in range(4)
    )
    unknowns = Unknowns((Unknown("slope", 1.5, 0.0, 4.0), Unknown("level", 0.5, -3.0, 3.0)))
    line = model_of(lambda values, time, _: values["slope"] * time + values["level"])
    problem = Problem(line, runs, unknowns, ("y",), {"y": 0.1})
    stage = Stage(name="line", part="chain", free={"J": Free(relative=(0.5, 2.0))})
    return StageFit(stage, problem, solve(problem), load_preset("neutral"))


def test_profiles_of_a_linear_model_are_its_intervals(assessed: StageFit) -> None:
    found = profiles_of(assessed, executor=Backwards())
    assert list(found) == ["slope", "level"]
    variables = uncertainty_of(assessed).own.variables
    for k, (name, each) in enumerate(found.items()):
        estimate = uncertainty_of(assessed).estimates[k]
        assert (estimate.name, each.index) == (name, k)
        ends = variables.to_values(np.array([[each.lower] * 2, [each.upper] * 2]))[:, k]
        np.testing.assert_allclose(ends, [estimate.lower, estimate.upper], rtol=2e-3)


def run_of(number: int, kind: str, low: float, high: float) -> Experiment:
    values = np.where(np.arange(81) < 40, high, low)
    run = bench_run(f"run {number}", 0.0, np.zeros(81), maneuver=f"{kind} x")
    return replace(run, input=replace(run.input, values=values))


KINDS = st.lists(
    st.tuples(
        st.sampled_from(["step", "ramp", "sine", "free"]),
        st.sampled_from([(0.0, 4.0), (-4.0, 0.0), (-4.0, 4.0)]),
    ),
    min_size=2,
    max_size=20,
)


@given(kinds=KINDS, folds=st.integers(2, 20), seed=st.integers(0, 1000))
def test_runs_of_a_kind_are_dealt_apart(kinds, folds, seed) -> None:
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
    for number, said in ((1, "2 folds, .* 1"), (21, "21 folds")):
        with pytest.raises(InputError, match=said):
            deal(runs, number, seed)


@pytest.fixture(scope="module")
def found(short_campaign: Campaign) -> CrossValidation:
    """By an executor whose results come in another order."""
    nominal, how = Drive.preset("hoist"), {"folds": 4, "executor": Backwards()}
    return cross_validate(short_campaign.experiments, nominal.parameters, TWO_STAGES, **how)


@pytest.mark.slow
def test_each_fold_is_predicted_by_a_fit_to_the_others(short_campaign, found) -> None:
    assert [fold.number for fold in found.folds] == [0, 1, 2, 3]
    held = [name for fold in found.folds for name in fold.held]
    assert sorted(held) == sorted(each.name for each in short_campaign)
    others = [each for each in short_campaign if each.name != held[0]]
    alone = fit(Drive.preset("hoist").parameters, others, TWO_STAGES)
    for quality in predict(alone.parameters, [short_campaign[held[0]]]):
        assert found.folds[0].measures[quality.channel] == quality.measures
    samples = [each.measures["current"].samples for each in found.folds]
    squares = [each.measures["current"].rmse ** 2 for each in found.folds]
    pooled = np.average(squares, weights=samples) ** 0.5
    assert found.measures["current"].rmse == pytest.approx(pooled)
    assert found.measures["current"].fit_percent > 90.0


@pytest.mark.slow
def test_a_fold_that_loses_an_unknown_says_so(found: CrossValidation) -> None:
    losing = [fold for fold in found.folds if fold.lost]
    (fold,) = losing
    assert fold.lost == ("J_minus",)
    assert fold.held[0].endswith("-4_V")
    assert any("loses J_minus, on which no other run depends" in s for s in found.sentences())


def test_folds_that_are_done_survive_ctrl_c(short_campaign: Campaign) -> None:
    def stop(fold: Fold, done: int) -> None:
        raise KeyboardInterrupt

    nominal = Drive.preset("hoist").parameters
    kept = cross_validate(short_campaign.experiments, nominal, TWO_STAGES, folds=4, watch=stop)
    assert len(kept.folds) == 1
    assert kept.planned == 4


@pytest.mark.slow
def test_a_fold_that_cannot_be_fitted_says_why(short_campaign: Campaign) -> None:
    first, *others = short_campaign.experiments
    bare = [replace(each, channels={"counts": each["counts"]}) for each in others]
    nominal = Drive.preset("hoist").parameters
    found = cross_validate([first, *bare], nominal, TWO_STAGES, folds=4)
    (failed,) = [fold for fold in found.folds if fold.failure]
    assert failed.held == (first.name,)
    assert "The stage 'card' fits" in failed.failure
    assert any("could not be fitted: The stage 'card'" in s for s in found.sentences())
