"""The stated error: maneuvers left out without a refit, and a bound that holds as often as said."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.identification.given import TIME, bench_run, linear_fit, unknowns_of

from swashplate.identification import RunQuality
from swashplate.identification.diagnostics.discrepancy import (
    ChannelErrors,
    PredictionError,
    WindowCell,
    bound_of_variance,
    cells_of,
    channel_errors,
    left_out,
    over_window,
    prediction_errors,
    variance_function,
)
from swashplate.identification.estimation.problem import LinearisedRun
from swashplate.identification.validation import compared

STEP = 0.01


def linear_runs(
    rng: np.random.Generator, count: int, size: int
) -> tuple[list[LinearisedRun], list[np.ndarray]]:
    """Residuals at the least-squares optimum of a straight line over all runs."""
    rows = [rng.normal(size=(size, 2)) for _ in range(count)]
    measured = [row @ [1.0, -2.0] + rng.normal(size=size) for row in rows]
    found = np.linalg.lstsq(np.vstack(rows), np.concatenate(measured), rcond=None)[0]
    time = np.arange(size) * STEP
    runs = [
        LinearisedRun(f"run {k}", "y", time, row @ found - y, None)
        for k, (row, y) in enumerate(zip(rows, measured, strict=True))
    ]
    return runs, rows


def test_maneuvers_left_out_are_those_of_a_refit_without_them() -> None:
    """Exact for a model that is linear in its unknowns."""
    rng = np.random.default_rng(1)
    runs, rows = linear_runs(rng, 5, 12)
    names = {"run 0": "ramp", "run 1": "step", "run 2": "ramp", "run 3": "sine", "run 4": "stair"}
    fit = linear_fit(runs, rows, unknowns_of(["a", "b"], [1.0, -2.0]))
    found = {run.name: error for run, error in left_out(fit, names)}
    for maneuver in set(names.values()):
        kept = [k for k, run in enumerate(runs) if names[run.name] != maneuver]
        # the unknowns' change if the others alone are fitted
        change = np.linalg.lstsq(
            np.vstack([rows[k] for k in kept]),
            -np.concatenate([runs[k].residual for k in kept]),
            rcond=None,
        )[0]
        for k, run in enumerate(runs):
            if names[run.name] == maneuver:
                np.testing.assert_allclose(found[run.name], run.residual + rows[k] @ change)


def record(run: str, error: np.ndarray, signal: np.ndarray, maneuver: str = "") -> ChannelErrors:
    command = np.ones(error.size)
    rate = 0.1 * np.gradient(signal, STEP)
    return ChannelErrors(
        run,
        maneuver or run,
        False,
        0.0,
        STEP,
        signal,
        error,
        0.0,
        np.zeros(error.size),
        signal,
        rate,
        command,
        False,
    )


def test_a_window_takes_the_slope_of_a_position_and_the_mean_of_anything_else() -> None:
    time = np.arange(1000) * STEP
    drifting = record("a", 3.0 + 0.2 * time, time)._replace(is_position=True, noise=1.0)
    errors, noise = over_window(drifting, 0.5)
    inner = np.isfinite(errors)
    assert inner.sum() == 1000 - 50
    np.testing.assert_allclose(errors[inner], 0.2)
    # the variance of a least-squares slope over 51 samples
    apart = STEP * np.arange(-25, 26)
    assert noise == pytest.approx(1.0 / np.sum(apart**2))
    errors, noise = over_window(drifting._replace(is_position=False), 0.5)
    np.testing.assert_allclose(errors[inner], (3.0 + 0.2 * time)[inner])
    assert noise == pytest.approx(1.0 / 51)


def drawn(rng: np.random.Generator, count: int, spread: float) -> list[ChannelErrors]:
    """Maneuvers whose error has the variance 0.01² (1 + (3 s)²) times exp(2 spread z)."""
    made = []
    for k in range(count):
        time = np.arange(2000) * STEP
        signal = rng.uniform(0.3, 1.0) * np.sin(0.5 * time + rng.uniform(0.0, 6.0))
        scale = 0.01 * np.sqrt(1.0 + (3.0 * signal) ** 2) * np.exp(spread * rng.normal())
        # one error over each window
        error = scale * np.repeat(rng.normal(size=40), 50)
        made.append(record(f"maneuver {k}", error, signal))
    return made


def variance_of(cells: Sequence[WindowCell], coefficients: np.ndarray) -> float:
    return float(np.mean(np.vstack([cell.terms for cell in cells]) @ coefficients))


def test_the_variance_function_finds_how_the_error_grows_with_the_signal() -> None:
    cells, reach = cells_of(drawn(np.random.default_rng(2), 200, 0.0))
    constant, by_signal, _ = variance_function(cells)
    # a mean over a window that lies across two errors is smaller than either
    assert constant * reach**2 == pytest.approx(0.7e-4, rel=0.3)
    assert by_signal == pytest.approx(9.0 * 0.7e-4, rel=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("count", [4, pytest.param(12, marks=pytest.mark.slow)])
def test_nine_of_ten_new_maneuvers_stay_below_the_stated_error(count: int) -> None:
    rng, held = np.random.default_rng(count), 0
    for _ in range(150):
        first, *others = drawn(rng, count + 1, 0.6)
        cells, _ = cells_of(others)
        mine, _ = cells_of([first, *others])
        mine = [cell for cell in mine if cell.run == first.run]
        square = float(np.mean(np.concatenate([cell.squares for cell in mine])))
        held += square <= variance_of(mine, bound_of_variance(cells))
    # five standard deviations of a share of 150 either way, and what the usual spread adds
    assert 0.78 < held / 150 < 0.99


def qualities(errors: Sequence[np.ndarray], noise: float | None = None) -> list[RunQuality]:
    """Runs that are simulated with some errors; the last two are held out."""
    made = []
    for k, error in enumerate(errors):
        truth = np.sin((1.0 + 0.3 * k) * TIME)
        made.append(compared(bench_run(f"run {k}", 1.0, truth, noise=noise), "y", truth + error))
    return made


def stated(runs: Sequence[RunQuality]) -> PredictionError:
    (found,) = prediction_errors(None, runs)
    return found


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.floats(1e-4, 10.0))
def test_what_is_known_of_the_noise_changes_nothing(seed: int, noise: float) -> None:
    rng = np.random.default_rng(seed)
    errors = [0.01 * rng.normal() + 0.01 * rng.normal(size=TIME.size) for _ in range(5)]
    assert stated(qualities(errors)) == stated(qualities(errors, noise))


def _error(prediction: PredictionError) -> float:
    """Stated error of a sine, root mean square over the range."""
    squares = prediction.squares(np.sin(TIME), np.cos(TIME))
    return float(np.sqrt(np.mean(squares))) / prediction.reach


@pytest.mark.slow
def test_another_run_narrows_what_is_stated_in_the_median() -> None:
    rng, ratios, required, turned = np.random.default_rng(4), [], 0.05, 0
    for _ in range(100):
        errors = [0.02 * rng.normal() + 0.002 * rng.normal(size=TIME.size) for _ in range(7)]
        before, after = (_error(stated(qualities(some))) for some in (errors[:-1], errors))
        ratios.append(after / before)
        turned += before <= required < after
    assert np.median(ratios) < 1.0
    # what was enough for a requirement stays enough
    assert turned <= 2


def test_white_noise_is_not_an_error_of_the_model() -> None:
    rng = np.random.default_rng(5)
    loud = [0.05 * rng.normal(size=TIME.size) for _ in range(6)]
    assert stated(qualities(loud)).worst.error < 0.03
    biased = [error + 0.2 for error in loud]
    assert stated(qualities(biased)).worst.error > 0.1


def test_a_channel_that_never_moves_has_no_error_to_state() -> None:
    still = compared(bench_run("still", 1.0, np.zeros(TIME.size)), "y", np.zeros(TIME.size))
    assert prediction_errors(None, [still]) == ()
    short = bench_run("short", 1.0, np.zeros(TIME.size), weight=0.0)
    assert (
        channel_errors(compared(bench_run("a", 1.0, np.sin(TIME)), "y", np.sin(TIME))) is not None
    )
    assert short["y"].used.sum() == 0


def test_classes_are_of_samples_and_a_class_without_any_is_missing() -> None:
    """A slow ramp through zero is small and large, and never fast."""
    ramps = [np.linspace(-1.0, 1.0, TIME.size) * k for k in (1.0, 0.9, 0.8)]
    runs = [
        compared(bench_run(f"ramp {k}", 1.0, ramp), "y", ramp + 0.01 * (k + 1.0))
        for k, ramp in enumerate(ramps)
    ]
    found = stated(runs)
    assert {each.motion for each in found.classes} == {"large"} | {
        each.motion for each in found.classes if each.motion == "small"
    }
    assert all(each.held_out == 3 for each in found.classes if each.motion == "large")
