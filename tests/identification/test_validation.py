"""Measures, what is left in residuals, and runs predicted from the command alone."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter
from tests.identification.given import bench_run, first_order, run_of, virtual

from swashplate import Campaign, Drive, InputError, maneuvers, rig
from swashplate.identification import (
    assess_fit,
    ignored_windows,
    pooled_measures,
    predict,
    with_speeds,
)
from swashplate.identification.validation import compared, measures, residual_test

MEASURED = np.array([0.0, 2.0, 4.0, 6.0])
SIMULATED = np.array([1.0, 2.0, 4.0, 5.0])


def test_by_hand() -> None:
    found = measures((MEASURED, SIMULATED, None))
    assert found.rmse == pytest.approx(np.sqrt(0.5))
    assert found.spread == pytest.approx(np.sqrt(5.0))
    assert found.nrmse == pytest.approx(np.sqrt(0.1))
    assert found.fit_percent == pytest.approx(68.377223)
    # several runs are pooled about one mean
    parts = (MEASURED[:2], SIMULATED[:2], None), (MEASURED[2:], SIMULATED[2:], np.ones(2))
    assert measures(*parts) == found


def test_ignored_samples_do_not_count() -> None:
    weight = np.array([1.0, 9.0, 0.0, 1.0])
    found = measures((MEASURED, np.array([1.0, 2.0, np.nan, 5.0]), weight))
    assert found.samples == 3
    assert found.rmse == pytest.approx(np.sqrt(2.0 / 3.0))


def test_a_channel_that_rests_has_no_fit(hoist: Drive) -> None:
    """Noise of an idle solenoid is no failure; a signal that moves where none should is one."""
    command = np.linspace(0.0, 5.0, 2000)
    noise = 1e-3 * np.random.default_rng(5).standard_normal(2000)
    still = np.zeros(2000)
    run = run_of("ramp", command, {"shaft_speed": noise})
    idle = compared(run, "shaft_speed", still).measures
    assert (idle.nrmse, idle.fit_percent) == (None, None)
    assert idle.rmse == pytest.approx(noise.std(), rel=0.01)
    for measured, simulated in ((noise + 1e-2 * command, still), (noise, 1e-2 * command)):
        run = run_of("ramp", command, {"shaft_speed": measured})
        assert compared(run, "shaft_speed", simulated).measures.fit_percent < 50.0


@pytest.mark.parametrize(("level", "count"), [(0.0, 7), (0.1, 7), (1e6 / 3.0, 7), (3.0, 1)])
def test_a_constant_has_no_fit(level: float, count: int) -> None:
    found = measures((np.full(count, level), np.full(count, level) + 1.0, None))
    assert (found.nrmse, found.fit_percent) == (None, None)
    assert found.rmse == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("run", "said"),
    [
        ((MEASURED, SIMULATED, np.zeros(4)), "No sample"),
        ((MEASURED, np.full(4, np.nan), None), "Sample 1 .* simulated"),
    ],
)
def test_what_cannot_be_measured_is_refused(run: tuple, said: str) -> None:
    with pytest.raises(InputError, match=said):
        measures(run)


# --- residuals ------------------------------------------------------------------------------------


N = 4000
TIME = np.arange(N) / 512.0
RNG = np.random.default_rng(7)
WHITE = RNG.normal(size=N)
COMMAND = np.sin(2.0 * np.pi * 0.5 * TIME) + lfilter([0.05], [1, -0.95], RNG.normal(size=N))


def test_white_noise_passes() -> None:
    found = residual_test(TIME, WHITE, COMMAND)
    assert found.duration == 0.0
    assert not found.follows
    assert found.verdict.startswith("The residuals are white and do not follow the input.")
    assert np.mean(np.abs(found.correlation) < found.band) > 0.9


@pytest.mark.parametrize("kept", [TIME >= 0.0, (TIME < 2.0) | (TIME > 3.0)], ids=["all", "a gap"])
def test_a_missed_delay_is_found_where_it_is(kept: np.ndarray) -> None:
    late = np.interp(TIME - 0.1, TIME, COMMAND)
    found = residual_test(TIME[kept], (0.5 * late + 0.2 * WHITE)[kept], COMMAND[kept])
    assert found.peak[0] == pytest.approx(0.1, abs=0.01)
    assert found.follows
    assert "+0.1 s after it" in found.verdict


def test_unrelated_slow_signals_are_rarely_called_related() -> None:
    """With the band of white noise nearly every one would be."""
    pairs = first_order(0.98, np.random.default_rng(0), (60, 2, N), 500)
    found = [residual_test(TIME, *pair) for pair in pairs]
    assert sum(each.follows for each in found) <= 9  # 5 % of 60 is 3, and its deviation 1.7
    assert sum(abs(each.peak[1]) > 1.96 / np.sqrt(N) for each in found) >= 57


@pytest.mark.parametrize(
    ("residual", "command"), [(np.zeros(N), COMMAND), (WHITE, np.full(N, 3.0))]
)
def test_constants_follow_nothing(residual: np.ndarray, command: np.ndarray) -> None:
    found = residual_test(TIME, residual, command)
    assert not found.follows
    assert np.isfinite(found.correlation).all()


# --- predictions ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    step = [maneuvers.step(4.0)]
    return virtual(tmp_path_factory.mktemp("rig"), "hoist", step, seed=1, severity="clean")


def test_a_prediction_is_the_simulation_of_the_command(campaign: Campaign) -> None:
    drive = Drive.preset("hoist")
    (run,) = campaign
    found = {each.channel: each for each in predict(drive.parameters, [run])}
    simulated = drive.simulate(
        run.input.values, time=run.input.time, interpolation=run.input.interpolation
    )
    both = simulated.fine("current_positive") + simulated.fine("current_negative")
    expected = np.interp(run["current"].time, simulated.time, both)
    assert found["current"].simulated == pytest.approx(expected, abs=2e-3)
    assert found["current"].measures.fit_percent > 95.0


def test_the_zero_of_a_position_is_free(campaign: Campaign) -> None:
    (run,) = campaign
    channel = run["counts"]
    moved = replace(channel, values=channel.values + 100.0)
    parameters = Drive.preset("hoist").parameters
    shifted = replace(run, channels={"counts": moved})
    first, second = (
        {each.channel: each.measures for each in predict(parameters, [each])}
        for each in (run, shifted)
    )
    assert second["counts"].rmse == pytest.approx(first["counts"].rmse, rel=1e-6)


def test_a_speed_stands_beside_its_position(campaign: Campaign) -> None:
    (run,) = campaign
    channel = run["counts"]
    qualities = with_speeds([compared(run, "counts", channel.values + 3.0)])
    assert [each.channel for each in qualities] == ["counts", "speed from counts"]
    assert qualities[0].measures.rmse == pytest.approx(3.0)
    # a constant has no speed
    assert qualities[1].measures.rmse == pytest.approx(0.0, abs=1e-9)
    assert qualities[1].experiment["speed from counts"].unit == "rad/s"


@pytest.mark.parametrize("noise", [1e-3, 1e-2])
def test_noise_of_a_position_is_no_error_of_the_speed_predicted(noise: float) -> None:
    """1 % of error in the gain beside noise that, differentiated, is up to a quarter of the range.

    Expected values: (1 - 0.99) of a speed of π cos(π t), behind filters that leave 0.997 of it.
    """
    time = np.arange(4096) / 512.0
    place = np.sin(np.pi * time)
    noisy = place + noise * np.random.default_rng(3).normal(size=time.size)
    run = run_of("a", time, {"position": noisy}, time=time)
    qualities = with_speeds([compared(run, "position", 0.99 * place)])
    error = 0.01 * np.pi / np.sqrt(2.0)
    found = pooled_measures(qualities, without_noise=True)["speed from position"]
    shown = pooled_measures(qualities)["speed from position"]
    # the noise's mean square over 8 s, 480 independent values, is known to within 6 %
    scatter = 2.0 * (0.06 * (shown.rmse**2 - error**2)) ** 0.5
    assert found.rmse == pytest.approx(error, rel=0.02, abs=scatter)
    assert found.rmse < 0.7 * shown.rmse or noise < 2e-3
    assert found.spread == pytest.approx(np.pi / np.sqrt(2.0), rel=0.02)
    assert assess_fit(None, [compared(run, "position", place)]).usable
    assert not assess_fit(None, [compared(run, "position", 0.4 * place)]).usable


def test_rounding_to_counts_is_no_error_of_the_speed_predicted(tmp_path: Path) -> None:
    """The drive that was simulated predicts an encoder of 60 counts a turn as well as one can."""
    hoist, rounded = Drive.preset("hoist"), replace(rig.SEVERITIES["clean"], encoder_step=1)
    tests, coarse = [maneuvers.step(6.0)], {"instruments": rounded, "counts_per_turn": 60.0}
    runs = virtual(tmp_path, hoist, tests, **coarse).select(axis="hoist")
    predicted = predict(hoist, runs)
    (seen,) = (q for q in with_speeds(predicted) if q.channel == "speed from counts")
    assert seen.measures.rmse > 0.02 * np.ptp(seen.simulated)
    (stated,) = (
        each for each in assess_fit(None, predicted).predictions if each.channel == "counts"
    )
    # one run alone, of counts of 6 degrees: of a new one several times as much may be expected
    assert all(each.error < 0.2 for each in stated.classes)


@pytest.mark.parametrize(("noise", "error"), [(0.02, 0.0), (0.02, 0.05), (0.0, 0.05), (0.2, 0.0)])
def test_what_a_model_leaves_out_is_told_from_white_noise(noise: float, error: float) -> None:
    """A tacho of ±1 under slow sines, and a model that has a twentieth of its gain too much."""
    time, random, runs = np.arange(5120) / 512.0, np.random.default_rng(5), []
    for k in range(4):
        speed = np.sin((1.0 + 0.1 * k) * time)
        tacho = speed + noise * random.normal(size=time.size)
        run = run_of(f"run {k}", time, {"shaft_speed": tacho}, time=time)
        runs.append(compared(run, "shaft_speed", (1.0 + error) * speed))
    (stated,) = assess_fit(None, runs).predictions
    (large,) = (each.error for each in stated.classes if each.motion == "large")
    left = error * np.sqrt(0.5) / 2.0
    # of nine of ten new maneuvers: more than what was seen, and at most four times
    assert left <= large < 5.0 * left + 0.1 * noise + 1e-3


def test_a_rounded_tacho_has_its_rounding_as_noise() -> None:
    time = np.arange(5120) / 512.0
    rounded = np.round(np.sin(time), 1)
    run = run_of("a", time, {"shaft_speed": rounded}, time=time)
    (stated,) = assess_fit(None, [compared(run, "shaft_speed", np.sin(time))]).predictions
    assert all(each.error < 0.02 for each in stated.classes)


def test_windows_that_do_not_count() -> None:
    time = np.arange(0.0, 10.0, 0.01)
    current = run_of("a", time, {"rectified_current": time}, time=time)["rectified_current"]
    weight = np.where((time < 0.495) | (time > 9.0), 0.0, 1.0)
    first, second = ignored_windows(replace(current, weight=weight))
    assert first == pytest.approx((0.0, 0.49))
    assert second == pytest.approx((9.01, 9.99))
    assert ignored_windows(current) == ()


def test_a_run_that_no_drive_simulates_is_refused() -> None:
    run = bench_run("bench", 1.0, np.zeros(81))
    with pytest.raises(InputError, match="bench .* channel"):
        predict(Drive.preset("hoist").parameters, [run])
