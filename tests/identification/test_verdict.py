"""The verdict: what is hopeless is called that, what is good has numbers."""

from dataclasses import replace

import numpy as np
import pytest
from tests.identification.given import RISE, TIME, bench_run, risen, run_of

from swashplate import Drive
from swashplate.identification import Verdict, verdict
from swashplate.identification.criteria import Criterion
from swashplate.identification.problem import Problem
from swashplate.identification.setup import Stage
from swashplate.identification.solving import solve
from swashplate.identification.stage_fit import Interval, StageFit
from swashplate.identification.unknowns import Unknown, Unknowns
from swashplate.identification.validation import RunQuality, compared, part_of_range

WAVE = 10.0 * np.sin(2.0 * np.pi * TIME[:-1] / 4.0)
WAVE = np.append(WAVE, 0.0)
SWAP = np.where(np.arange(81) % 2, 1.0, -1.0)
"""Noise that has no relation to anything slow."""


def quality(simulated: np.ndarray, name: str = "a", measured: np.ndarray = WAVE) -> RunQuality:
    """A wave of ±10 as measured, under an input of the same shape."""
    run = bench_run(name, 1.0, measured)
    return compared(replace(run, input=replace(run.input, values=WAVE)), "y", simulated)


def criterion(found: Verdict, name: str) -> Criterion:
    return next(each for each in found.criteria if each.name == name)


def test_a_good_prediction_has_its_numbers_and_what_is_required_decides() -> None:
    runs = [quality(WAVE + 0.24 * SWAP)]
    found = verdict((), runs)
    # 0.24 of a range of 20
    assert found.headline == "Predicts y to 1.2 % of its range over 1 run."
    assert found.usable
    assert not found.sentences
    strict = verdict((), runs, required=0.01)
    assert strict.headline == "Not usable: predicts y to 1.2 % of its range only."
    assert criterion(strict, "error / range, runs predicted").limit == "1 %"


def test_the_range_is_that_of_all_runs() -> None:
    runs = [quality(WAVE + 0.3, "a"), quality(WAVE + 30.3, "b", WAVE + 30.0)]
    # from -10 to 40
    assert part_of_range(runs, "y") == pytest.approx(0.3 / 50.0)
    constant = quality(np.ones(81), "c", np.zeros(81))
    assert part_of_range([constant], "y") is None
    found = verdict((), [constant])
    assert "never moves" in " ".join(found.sentences)
    assert found.headline == "Predicts channels that never move over 1 run."


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (-1.0, "no better than by its mean in the predicted runs (fit -100 %)"),
        (0.4, "misses at least half of the movement in the predicted runs (fit 40 %)"),
    ],
)
def test_a_drive_that_hardly_simulates_is_not_usable(factor: float, words: str) -> None:
    found = verdict((), [quality(factor * WAVE)])
    assert not found.usable
    assert found.headline.startswith("Not usable: y ")
    assert words in found.headline


def test_one_run_that_contradicts_the_others_is_named() -> None:
    runs = [quality(WAVE + 0.1 * SWAP, f"run {k}") for k in range(20)]
    assert criterion(verdict((), runs), "predicted runs worse than mean").state == "met"
    found = verdict((), [*runs, quality(-WAVE, "turned")])
    assert not found.usable
    failed = criterion(found, "predicted runs worse than mean")
    assert failed.value == "1"
    assert "mean of the run: y in turned, which contradicts the other runs" in failed.failure


def test_large_residuals_that_follow_the_input_are_a_model_error() -> None:
    found = verdict((), [quality(0.7 * WAVE)])
    assert not found.usable
    assert "the residuals of y follow the input and are 30 % of its movement" in found.headline
    small = verdict((), [quality(0.95 * WAVE)])
    assert small.usable
    assert "1 of 1 runs follow the input (correlation up to -1.00)" in small.sentences[-1]


def stage(
    bounds: tuple[float, float] = (0.1, 10.0), lags: tuple[float, float] = (0.1, 5.0)
) -> StageFit:
    """An exponential rise fitted to two runs, with ±0.02 that nothing explains."""
    runs = tuple(
        bench_run(f"rise {level:g}", level, risen(level, 2.0, 0.8) + 0.02 * SWAP)
        for level in (1.0, 2.0)
    )
    gain = Unknown("gain", 0.5 * sum(bounds), *bounds)
    lag = Unknown("lag", 0.5 * sum(lags), *lags)
    problem = Problem(RISE, runs, Unknowns((gain, lag)), ("y",), {"y": 0.02})
    given = Stage.model_validate(
        {"name": "rise", "part": "chain", "free": {"Z1": {"relative": [0.5, 2.0]}}}
    )
    solution = solve(problem, problem.start)
    return StageFit(given, problem, solution, Drive.preset("hoist").parameters)


def held_out(error: np.ndarray) -> RunQuality:
    truth = risen(1.5, 2.0, 0.8)
    return compared(bench_run("held", 1.5, truth + 0.02 * SWAP), "y", truth + error)


GOOD = held_out(0.0 * TIME)


def test_a_fit_that_carries_over_is_usable_and_one_without_runs_held_out_says_so() -> None:
    fitted = stage()
    found = verdict([fitted], [GOOD])
    assert found.usable, found.headline
    # 0.02 of what 1.5 · 2 · (1 - exp(-5)) with the noise comes to
    assert found.headline == "Usable: predicts held-out y to 0.66 % of its range."
    assert not any("larger errors" in each for each in found.sentences)
    found = verdict([fitted], [])
    assert found.usable
    assert found.headline.endswith("no run was held out.")
    assert "no run was held out" in found.not_judged[0]


def test_a_current_that_was_not_fitted_is_not_judged() -> None:
    run = run_of("held", WAVE, {"rectified_current": WAVE}, time=TIME)
    current = compared(run, "rectified_current", 0.0 * WAVE)
    assert verdict([stage()], [GOOD, current]).headline == verdict([stage()], [GOOD]).headline
    assert "rectified_current" in verdict((), [current]).headline


def test_a_fit_that_does_not_carry_over_is_not_usable() -> None:
    spoiled = 0.25 * np.std(risen(1.5, 2.0, 0.8)) * SWAP
    found = verdict([stage()], [held_out(spoiled)])
    assert not found.usable
    assert "times the RMSE of the fitted runs" in found.headline
    # ten times the noise, but small for the movement: usable all the same
    slightly = verdict([stage()], [held_out(0.08 * SWAP)])
    assert slightly.usable
    assert any("larger errors on other tests" in each for each in slightly.sentences)


def test_wide_intervals_ask_for_attention() -> None:
    fitted = stage()
    # gain and lag are known to about a per cent
    assert not any("not determined" in each for each in verdict([fitted], []).sentences)
    unsure = replace(fitted, stored=(Interval("estimated", 0.5, 0.5, 2.5),) * 2)
    wide = verdict([unsure], []).sentences
    assert "rise: not determined to within ±10 %: gain and lag." in wide


def test_most_unknowns_at_bounds_is_hopeless() -> None:
    found = verdict([stage(bounds=(0.1, 1.5), lags=(1.2, 5.0))], [GOOD])
    assert not found.usable
    assert "2 of 2 parameters are at a bound or not determined" in found.headline


def test_an_interrupted_fit_is_not_usable() -> None:
    whole = stage()
    cut = replace(whole.solution, interrupted=True, converged=False)
    found = verdict([replace(whole, solution=cut)], [GOOD], planned=["rise", "brake"])
    assert not found.usable
    assert "stage rise was interrupted" in found.headline
    assert "brake was never fitted" in found.headline
    unfinished = replace(whole.solution, converged=False, message="too many evaluations")
    found = verdict([replace(whole, solution=unfinished)], [GOOD])
    assert not found.usable
    assert "did not converge (too many evaluations)" in found.headline
