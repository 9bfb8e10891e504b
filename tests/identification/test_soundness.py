"""Runs that cannot be right are found by name, with the line to write; sound ones are not."""

from dataclasses import replace

import numpy as np
import pytest
from tests.identification.given import bench_run, run_of

from swashplate.identification import RunQuality
from swashplate.identification.diagnostics.data_checks import Finding, clipped_channels
from swashplate.identification.diagnostics.soundness import outlying_runs
from swashplate.identification.validation import compared

TIME = np.arange(2000) * 0.01
LEVELS = (0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2)


def motion(level: float, late: float = 0.0) -> np.ndarray:
    """A speed that follows a sine of its own frequency; at rest at first."""
    time = np.maximum(TIME - 1.0 - late, 0.0)
    return level * np.sin(level * time)


def predicted(
    spoiled: np.ndarray | None = None, number: int = 3, seed: int = 0, maneuver: str = ""
) -> list[RunQuality]:
    """Runs that a model predicts to 0.3 %, one of them with other samples."""
    rng, made = np.random.default_rng(seed), []
    for k, level in enumerate(LEVELS):
        simulated = motion(level)
        error = 0.003 * rng.normal() * simulated + 0.001 * rng.normal(size=TIME.size)
        measured = simulated + error
        if k == number and spoiled is not None:
            measured = spoiled
        run = run_of(
            f"run {k}",
            np.sign(simulated),
            {"shaft_speed": measured},
            time=TIME,
            maneuver=maneuver or f"sine {k}",
        )
        made.append(compared(run, "shaft_speed", simulated))
    return made


def found_in(runs: list[RunQuality]) -> list[Finding]:
    return list(outlying_runs(None, runs))


@pytest.mark.parametrize("seed", range(20))
def test_runs_that_differ_a_little_are_sound(seed: int) -> None:
    assert found_in(predicted(seed=seed)) == []


@pytest.mark.parametrize(
    ("spoiled", "said"),
    [
        (1.15 * motion(LEVELS[3]), "it moves 1.15 times as far"),
        (motion(LEVELS[3], 0.2), "it comes 200 ms late relative to its command"),
        (motion(LEVELS[5]), "follows the command of run 5: are their logs swapped?"),
        (np.cos(5.0 * TIME), "Is it a log of this axis and this command?"),
    ],
)
def test_a_run_that_stands_out_is_named_with_what_is_wrong(spoiled: np.ndarray, said: str) -> None:
    (finding,) = found_in(predicted(spoiled))
    assert finding.run == "run 3"
    assert finding.severity == "refuse"
    assert said in finding.sentence
    assert 'role = "ignore"' in finding.sentence


def test_a_position_that_stands_still_for_a_while_is_named_with_the_window() -> None:
    runs = predicted()
    for k, quality in enumerate(runs):
        angle = np.cumsum(quality.simulated) * 0.01
        measured = np.cumsum(quality.experiment["shaft_speed"].values) * 0.01
        if k == 2:
            dead = (TIME >= 8.0) & (TIME < 9.5)
            measured[dead] = measured[np.argmax(dead)]
        experiment = quality.experiment
        channel = replace(experiment["shaft_speed"], name="angle", kind="position", unit="rad")
        run = replace(experiment, channels={"angle": replace(channel, values=measured)})
        runs[k] = compared(run, "angle", angle)
    (finding,) = found_in(runs)
    assert finding.run == "run 2"
    assert "it does not move from 8.0" in finding.sentence
    assert "ignore this window" in finding.sentence


def test_a_maneuver_of_which_every_run_stands_out_shows_what_the_model_lacks() -> None:
    runs = predicted()
    lacking = [
        compared(
            run_of(
                f"step {k}",
                np.sign(motion(0.8)),
                {"shaft_speed": 1.2 * motion(0.8)},
                time=TIME,
                maneuver="step",
            ),
            "shaft_speed",
            motion(0.8),
        )
        for k in range(2)
    ]
    assert found_in([*runs, *lacking]) == []
    # one that has a sound twin is unsound all the same
    (finding,) = found_in(predicted(1.2 * motion(LEVELS[3]), maneuver="sine"))
    assert finding.run == "run 3"


def test_two_runs_do_not_tell_which_of_them_is_wrong() -> None:
    runs = predicted(3.0 * motion(LEVELS[3]))
    assert found_in([runs[2], runs[3]]) == []


@pytest.mark.parametrize("rounding", [0.001, 0.5])
def test_a_rounded_channel_that_lags_is_not_clipped(rounding: float) -> None:
    """It stands at its largest value through a pulse, and 0.3 s longer than that."""
    time = np.linspace(0.0, 4.0, 81)
    pulse = np.where((time > 0.5) & (time < 3.0), 5.0, 0.0) + 2.0 * np.sin(time) * (time >= 3.0)
    late = np.where((time > 0.8) & (time < 3.3), 4.0, 0.0) + np.sin(time - 0.3) * (time >= 3.3)
    run = bench_run("pulse", 1.0, np.round(late / rounding) * rounding)
    run = replace(run, input=replace(run.input, values=pulse))
    assert list(clipped_channels([run])) == []
    assert list(clipped_channels([bench_run("still", 1.0, np.zeros(81))])) == []
    cut = bench_run("cut", 1.0, np.minimum(3.0 * np.sin(time), 1.5))
    cut = replace(cut, input=replace(cut.input, values=3.0 * np.sin(time)))
    (found,) = clipped_channels([cut])
    assert "'y' reads exactly 1.5 1" in found.sentence
    for upper, count in ((1.5, 0), (1.495, 0), (1.6, 1)):
        stated = replace(cut["y"], limits=(-3.5, upper))
        assert len(list(clipped_channels([replace(cut, channels={"y": stated})]))) == count


@pytest.mark.parametrize("noise", [0.0, 0.02])
@pytest.mark.parametrize("cut", [True, False])
def test_a_channel_that_is_clipped_at_several_steps(noise: float, cut: bool) -> None:
    """Read in hundredths; cut at 1, or of a machine that stands at its stop there itself."""
    time, random, runs = np.linspace(0.0, 4.0, 81), np.random.default_rng(2), []
    for level in (0.5, 2.0, 4.0):
        rise = np.minimum(level * (1.0 - np.exp(-time / 0.2)), np.inf if cut else 1.0)
        read = np.round(rise + random.normal(0.0, noise, 81), 2)
        runs.append(bench_run(f"step {level}", level, np.minimum(read, 1.0) if cut else read))
        command = np.where(time > 0.0, level, 0.0)
        runs[-1] = replace(runs[-1], input=replace(runs[-1].input, values=command))
    found = list(clipped_channels(runs))
    assert len(found) == (cut and noise > 0.0)
    if found:
        assert "'y' reads exactly 1 1 at inputs that differ by 2 1" in found[0].sentence
