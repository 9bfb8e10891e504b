"""The verdict: three answers, each no when it must be and yes when it may."""

from dataclasses import replace

import numpy as np
import pytest
from tests.identification.given import RISE, TIME, bench_run, risen, run_of

from swashplate import Drive
from swashplate.identification import (
    FitSetup,
    Optimum,
    Problem,
    RunQuality,
    Unknown,
    Unknowns,
    Verdict,
    assess_fit,
    solve,
)
from swashplate.identification.optimum import Interval
from swashplate.identification.validation import compared

WAVE = 10.0 * np.sin(2.0 * np.pi * TIME / 4.0)
SWAP = np.where(np.arange(81) % 2, 1.0, -1.0)
"""Noise that has no relation to anything slow."""


def quality(simulated: np.ndarray, name: str = "a", measured: np.ndarray = WAVE) -> RunQuality:
    """A wave of ±10 as measured, under an input of the same shape."""
    run = bench_run(name, 1.0, measured)
    return compared(replace(run, input=replace(run.input, values=WAVE)), "y", simulated)


def worst(found: Verdict) -> float:
    assert found.error is not None
    return found.error.worst.error


def test_a_prediction_is_judged_by_what_is_required() -> None:
    runs = [quality(WAVE + bias, f"run {k}") for k, bias in enumerate((0.2, -0.2, 0.25, -0.15))]
    found = assess_fit(None, runs)
    # a bias of 0.2 of a range of 20 is an error of 1 %; of nine of ten, twice to four times that
    assert 0.01 < worst(found) < 0.05
    assert found.usable
    assert found.headline.startswith("Usable: predicts y within ")
    strict = assess_fit(None, runs, required=0.005)
    assert not strict.usable
    assert strict.predictions == found.predictions
    assert strict.headline.startswith("Not usable: predicts y within ")
    assert strict.headline.endswith("0.5 % is required.")
    assert "NOT MET" in str(strict.table())


@pytest.mark.parametrize("factor", [-1.0, 0.4])
def test_a_drive_that_hardly_simulates_is_not_usable(factor: float) -> None:
    found = assess_fit(None, [quality(factor * WAVE, f"run {k}") for k in range(3)])
    assert not found.usable
    # half of the movement missed is a quarter of its range, and more
    assert worst(found) > 0.2


def test_what_never_moves_is_not_judged() -> None:
    found = assess_fit(None, [quality(np.ones(81), "c", np.zeros(81))])
    assert found.predictions == ()
    assert not found.usable
    assert found.headline.startswith("Not usable: no channel moves")
    assert found.prediction == "Unknown: no channel moves."


def rise(
    bounds: tuple[float, float] = (0.1, 10.0),
    lags: tuple[float, float] = (0.1, 5.0),
    levels: tuple[float, ...] = (1.0, 1.5, 2.0, 2.5, 3.0),
    spoiled: float = 1.0,
) -> Optimum:
    """An exponential rise fitted to some runs, with ±0.02 that nothing explains.

    The third is measured as a multiple of what it was.
    """
    factors = [spoiled if k == 2 else 1.0 for k in range(len(levels))]
    runs = tuple(
        bench_run(f"rise {level:g}", level, factor * risen(level, 2.0, 0.8) + 0.02 * SWAP)
        for level, factor in zip(levels, factors, strict=True)
    )
    gain = Unknown("gain", 0.5 * sum(bounds), *bounds)
    lag = Unknown("lag", 0.5 * sum(lags), *lags)
    problem = Problem(RISE, runs, Unknowns((gain, lag)), ("y",), {"y": 0.02})
    hoist = Drive.preset("hoist").parameters
    return Optimum(
        setup=FitSetup.model_validate({"free": {"Z1": {"relative": [0.5, 2.0]}}}),
        nominal=hoist,
        runs=runs,
        problem=problem,
        solution=solve(problem, problem.start),
        parameters=hoist,
    )


def held_out(error: np.ndarray) -> RunQuality:
    truth = risen(1.2, 2.0, 0.8)
    return compared(bench_run("held", 1.2, truth + 0.02 * SWAP), "y", truth + error)


GOOD = held_out(0.0 * TIME)


def test_a_good_fit_has_three_answers_and_they_are_yes() -> None:
    found = assess_fit(rise(), [GOOD])
    assert found.usable, found.headline
    assert set(found.answers()) == {"Data", "Prediction", "Values"}
    assert found.data.startswith("Sound")
    assert found.values == "All 2 may be quoted with their intervals."
    (error,) = found.predictions
    assert {each.held_out for each in error.classes} <= {0, 1}
    assert max(each.fitted for each in error.classes) == 5
    # white noise of ±0.02 on a range of 6 is no error of the model
    assert worst(found) < 0.01
    assert assess_fit(rise(), []).usable


def test_a_held_out_run_that_is_predicted_badly_widens_what_is_stated() -> None:
    good, bad = (
        assess_fit(rise(), [GOOD]),
        assess_fit(rise(), [held_out(0.3 * np.sqrt(TIME))]),
    )
    assert worst(bad) > 2.0 * worst(good)
    required = 0.5 * (worst(good) + worst(bad))
    assert assess_fit(rise(), [GOOD], required=required).predicts
    assert not assess_fit(rise(), [held_out(0.3 * np.sqrt(TIME))], required=required).predicts


def test_a_run_that_stands_out_makes_the_data_unsound_whatever_it_predicts() -> None:
    found = assess_fit(rise(levels=(1.0, 1.2, 1.5, 1.8, 2.0, 2.4, 3.0), spoiled=1.3), [])
    assert not found.sound
    assert not found.usable
    (finding,) = found.unsound
    assert finding.run == "rise 1.5"
    assert "times as far" in finding.sentence
    assert found.headline.startswith("Not usable, as the data are not sound: rise 1.5")
    # what it predicts is stated all the same
    assert found.predictions


def test_a_current_that_was_not_fitted_does_not_count() -> None:
    run = run_of("held", WAVE, {"rectified_current": WAVE}, time=TIME)
    current = compared(run, "rectified_current", 0.0 * WAVE)
    assert assess_fit(rise(), [GOOD, current]).headline == assess_fit(rise(), [GOOD]).headline
    assert "rectified_current" in assess_fit(None, [current]).headline


def test_values_at_a_bound_are_undetermined_and_never_decide_the_use() -> None:
    found = assess_fit(rise(bounds=(0.1, 1.5), lags=(0.1, 5.0)), [GOOD])
    assert "gain" in found.undetermined
    assert found.quotable + len(found.undetermined) == 2
    assert "not known to within ±10 %: gain" in found.values
    assert found.usable == found.predicts


def test_wide_intervals_are_undetermined() -> None:
    unsure = replace(rise(), stored=(Interval("estimated", 0.5, 0.5, 2.5),) * 2)
    found = assess_fit(unsure, [GOOD])
    assert found.undetermined == ("gain", "lag")
    assert found.usable


@pytest.mark.parametrize("added", [1.0, 1.002, 1.3])
def test_another_sensor_of_the_same_shaft_never_makes_it_worse(added: float) -> None:
    """Angles predicted to 0.1 %, and a tacho beside them that is right, nearly so, or wrong."""
    time = np.arange(2000) * 0.01
    angles, both = [], []
    for k in range(4):
        speed = np.sin((0.8 + 0.1 * k) * time)
        angle = np.cumsum(speed) * 0.01
        channels = {"position": angle, "shaft_speed": added * speed}
        run = run_of(f"run {k}", np.sign(speed), channels, time=time)
        angles.append(compared(run, "position", 1.001 * angle))
        both += [angles[-1], compared(run, "shaft_speed", speed)]
    before, after = assess_fit(None, angles, required=0.02), assess_fit(None, both, required=0.02)
    assert before.usable
    assert after.usable
    assert worst(after) <= worst(before)
    # the tacho's own error is stated all the same
    assert len(after.predictions) == 2


def test_an_interrupted_fit_is_not_usable() -> None:
    whole = rise()
    cut = replace(whole.solution, interrupted=True, converged=False)
    found = assess_fit(replace(whole, solution=cut), [GOOD])
    assert not found.usable
    assert "the search was interrupted" in found.headline
    unfinished = replace(whole.solution, converged=False, message="too many evaluations")
    found = assess_fit(replace(whole, solution=unfinished), [GOOD])
    assert not found.usable
    assert "did not converge (too many evaluations)" in found.headline


@pytest.mark.parametrize("error", [0.15, 0.3, 0.6])
def test_the_stated_error_is_never_below_what_held_out_runs_show(error: float) -> None:
    """An offset of a held-out run, over a range of 6 and its noise, less what noise explains."""
    found = assess_fit(rise(), [GOOD, held_out(error + 0.0 * TIME)])
    (prediction,) = found.predictions
    seen = [stated for stated in prediction.classes if stated.held_out]
    assert seen
    assert all(stated.error >= 0.98 * error / 6.0 for stated in seen)


def test_of_many_held_out_runs_nine_of_ten_must_stay_below() -> None:
    """Of 20 offsets of 0.2 % of range each more than the last, the 19th: one new run in ten."""
    runs = [quality(WAVE + 0.04 * k, f"run {k}") for k in range(1, 20)]
    found = assess_fit(None, [*runs, quality(WAVE + 9.0, "far off")])
    assert worst(found) >= 0.002 * 19 - 1e-9
    assert worst(found) < 0.4


def test_held_out_runs_that_are_all_wrong_are_all_named() -> None:
    """They cannot vouch for each other: what the fitted runs show says what to expect."""
    wrong = [
        compared(
            bench_run(f"held {k}", level, 0.7 * risen(level, 2.0, 0.8) + 0.02 * SWAP),
            "y",
            risen(level, 2.0, 0.8),
        )
        for k, level in enumerate((1.2, 1.8, 2.4, 2.7, 2.9))
    ]
    found = assess_fit(rise(), wrong)
    assert not found.usable
    assert {finding.run for finding in found.unsound} == {f"held {k}" for k in range(5)}
    assert {finding.channel for finding in found.unsound} == {"y"}
    assert "it moves 0.7 times as far" in found.headline
    # beside a verdict on its fit a drive that is only compared with runs is judged by that
    beside = assess_fit(None, wrong, of_fit=assess_fit(rise(), [GOOD]))
    assert {finding.run for finding in beside.unsound} == {f"held {k}" for k in range(5)}
    assert not beside.usable


def test_a_run_beyond_the_fitted_commands_is_no_unsound_log() -> None:
    """The model may be wrong where nothing was fitted; the error is stated all the same."""
    level = 6.0
    beyond = compared(
        bench_run("beyond", level, 0.7 * risen(level, 2.0, 0.8)), "y", risen(level, 2.0, 0.8)
    )
    found = assess_fit(rise(), [beyond])
    assert found.sound
    assert not found.usable
    assert worst(found) > 0.1
