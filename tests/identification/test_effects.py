"""What estimates follow beside the noise: instruments, hysteresis of the current, runs."""

from collections.abc import Callable
from dataclasses import replace
from math import sqrt

import numpy as np
import pytest
from tests.identification.given import determined_of, run_of, virtual
from tests.identification.test_own_model import FREE, TRUTH, Load, trial, valve

from swashplate import Campaign, Drive, Experiment, ParameterError
from swashplate.campaign import Accuracy, resolution_of_inputs
from swashplate.identification import ModelSetup, Optimum, Search, estimates_of, fit, uncertainty_of
from swashplate.identification.statistics.effects import after_play, changes_of
from swashplate.machine import Machine, simulate
from swashplate.maneuvers import source_tests

RATE = 512.0
TIME = np.arange(2048) / RATE
SETUP = ModelSetup(
    Machine(valve, TRUTH, given=Load()),
    {unknown.name: unknown for unknown in FREE},
    noise={"position": 0.01},
)


def logged(values: np.ndarray, **stated: float | None) -> Experiment:
    """A run of a command, whose instrument is stated."""
    run = run_of("run", values, {"shaft_speed": np.zeros(values.size)}, time=TIME[: values.size])
    return replace(run, input=replace(run.input, accuracy=Accuracy(**stated)))


# --- what is read and assumed ---------------------------------------------------------------------


@pytest.mark.parametrize("bits", [8, 12, 14])
def test_the_step_of_a_converter_is_seen_in_a_command_that_moves(bits: int) -> None:
    step = 20.0 / 2**bits
    volts = np.round(9.0 * np.sin(2.0 * np.pi * TIME) / step) * step
    assert resolution_of_inputs([logged(volts).input]) == pytest.approx(step)


def test_levels_of_steps_alone_say_nothing_of_a_converter() -> None:
    volts = np.where(TIME < 1.0, 0.0, 4.0)
    assert resolution_of_inputs([logged(volts).input, logged(-volts).input]) == 0.0


def test_nothing_is_changed_of_instruments_that_are_said_to_be_right() -> None:
    run = logged(np.linspace(0.0, 5.0, TIME.size), gain=0.0, zero=0.0, time=0.0)
    speed = replace(run["shaft_speed"], accuracy=Accuracy())
    assert not list(changes_of(replace(run, channels={"shaft_speed": speed}), 0.0))


def test_a_change_is_a_rectangular_limit_over_the_root_of_three() -> None:
    run = logged(np.linspace(0.0, 5.0, TIME.size), gain=0.03, zero=0.6, time=0.003)
    changes = {change.effect: change for change in changes_of(run, 0.0)}
    late = changes["instant of the command in run"].experiment.input.time - TIME
    assert late == pytest.approx(0.003 / sqrt(3.0))
    weaker = changes["gain of the command"].experiment.input.values
    assert weaker[-1] == pytest.approx(5.0 * (1.0 - 0.03 / sqrt(3.0)))
    zero = changes["zero of the command in run"]
    assert zero.experiment.input.values[0] == pytest.approx(0.6 / sqrt(3.0))


def test_a_stated_zero_counts_without_the_steps_of_the_converter() -> None:
    run = run_of("run", np.linspace(0.0, 5.0, 100), {}, time=TIME[:100])

    def zero(accuracy: Accuracy | None) -> float:
        given = replace(run, input=replace(run.input, accuracy=accuracy))
        changes = [each for each in changes_of(given, 0.06) if each.effect.startswith("zero")]
        return sum(each.experiment.input.values[0] ** 2 for each in changes)

    # variances of rectangular distributions: a third of the limit's square, a twelfth of a step's
    assert zero(Accuracy(zero=0.03)) == pytest.approx(0.03**2 / 3.0 + 0.06**2 / 12.0)
    assert zero(Accuracy(zero=0.03, rounded=False)) == pytest.approx(0.03**2 / 3.0)
    assert zero(Accuracy(rounded=False)) == 0.0


@pytest.mark.parametrize("rate", [512.0, 50.0])
def test_half_a_sample_is_assumed_of_what_a_command_does_between_two(rate: float) -> None:
    run = run_of("run", np.linspace(0.0, 5.0, 100), {}, time=np.arange(100) / rate)
    (late,) = (change for change in changes_of(run, 0.0) if change.effect.startswith("instant"))
    assert late.experiment.input.time[0] == pytest.approx(0.5 / rate / sqrt(3.0))


def test_a_command_at_full_voltage_stays_within_it() -> None:
    run = run_of("run", np.clip(20.0 * TIME - 20.0, -10.0, 10.0), {}, time=TIME)
    for change in changes_of(run, 0.005):
        assert np.abs(change.experiment.input.values).max() <= 10.0


def campaign_text(accuracy: str) -> str:
    return (
        'title = "t"\n[axes.a]\ntime = { column = "t" }\n'
        'input = { column = "u [V]", accuracy = { zero = 0.002 } }\n'
        f'channels.i = {{ kind = "signed_current", column = "i [mA]", accuracy = {accuracy} }}\n'
        'channels.n = { kind = "shaft_speed", column = "n [rad/s]" }\n'
        '[[runs]]\nfile = "log.csv"\n'
    )


def test_a_campaign_file_states_it_in_its_own_unit_and_leaves_the_rest_as_assumed(tmp_path) -> None:
    rows = "".join(f"{k / 512.0},{k % 7},{k % 5},{k % 3}\n" for k in range(100))
    (tmp_path / "log.csv").write_text(f"t,u [V],i [mA],n [rad/s]\n{rows}", "utf-8")
    path = tmp_path / "campaign.toml"
    path.write_text(campaign_text("{ gain = 0.01, zero = 2.0 }"), "utf-8")
    (run,) = Campaign.from_toml(path).select()
    assert run["i"].instrument == Accuracy(0.01, 0.002, 0.0, rounded=False)
    assert run.input.instrument == Accuracy(0.0005, 0.002, None, rounded=False)
    assert run["n"].instrument == Accuracy(0.005, 0.0, 0.0)
    held = campaign_text("{}").replace("{ zero = 0.002 }", '{}, interpolation = "previous"')
    path.write_text(held, "utf-8")
    (run,) = Campaign.from_toml(path).select()
    assert run.input.instrument == Accuracy(0.0005, 0.001, 0.0)
    path.write_text(campaign_text("{ gain = 1.5 }"), "utf-8")
    with pytest.raises(ParameterError, match=r"channels\.i.*accuracy.*gain"):
        Campaign.from_toml(path)


# --- how estimates follow -------------------------------------------------------------------------


def stated(run: Experiment) -> Experiment:
    """A run of the valve whose instruments err by much, in all ways."""
    position = replace(run["position"], accuracy=Accuracy(0.02))
    command = replace(run.input, accuracy=Accuracy(0.02, 0.05, 0.002))
    return replace(run, input=command, channels={"position": position})


def test_estimates_follow_each_effect_as_a_fit_of_changed_runs_does() -> None:
    runs = [stated(trial("a")), stated(trial("b"))]
    found = fit(SETUP, runs)
    systematic, middle = uncertainty_of(found).systematic, found.solution.vector
    changed: dict[str, list[Experiment]] = {}
    for number, run in enumerate(runs):
        for effect, experiment in changes_of(run, 0.0):
            changed.setdefault(effect, list(runs))[number] = experiment
    assert changed.keys() == systematic.keys()
    assert len(changed) == 6
    for effect, experiments in changed.items():
        expected = fit(SETUP, experiments).solution.vector - middle
        size = max(np.abs(expected).max(), 1e-6)
        assert systematic[effect] == pytest.approx(expected, abs=0.1 * size)


def test_variances_of_effects_add_up_and_the_largest_is_named() -> None:
    runs = [stated(trial("a")), stated(trial("b"))]
    known = uncertainty_of(fit(SETUP, runs))
    added = sum(change**2 for change in known.systematic.values())
    assert np.diag(known.quoted.matrix) == pytest.approx(np.diag(known.own.matrix) + added)
    gain = known.own.variables.names.index("gain")
    shares = known.budget(gain)
    assert list(shares) == sorted(shares, key=shares.get, reverse=True)
    assert sum(shares.values()) <= 1.0 + 1e-12
    # command and position err by 2 % alike: each has its part in the gain's error
    assert shares["gain of position"] == pytest.approx(shares["gain of the command"], rel=0.1)
    assert any("instruments" in sentence for sentence in known.sentences())


def test_a_play_follows_from_its_middle() -> None:
    assert after_play(np.array([0.0, 1.0, 3.0, 2.5, 0.5, 0.5]), 2.0).tolist() == [
        0.0,
        0.0,
        2.0,
        2.0,
        1.5,
        1.5,
    ]


@pytest.mark.slow
def test_a_hysteresis_of_the_current_goes_into_the_pump_alone(tmp_path) -> None:
    """Twice the hysteresis changes twice as much; none changes nothing, and no card."""
    tests = source_tests("slew")
    names = ("ramp +1 V/s", "step +2 V", "sine 4 V 0.1 Hz", "sine 6 V 0.05 Hz")
    campaign = virtual(tmp_path, "slew", {name: tests[name] for name in names}, seed=3)
    drive, effect = Drive.preset("slew"), "hysteresis of the current"

    def of_part(part: str, width: float, drive: Drive = drive) -> Optimum:
        return fit(drive, campaign, determined_of("slew", part, current_hysteresis=width))

    assert effect not in uncertainty_of(of_part("card", 1e-4)).systematic
    none, one, two = (of_part("pump", width) for width in (0.0, 1e-4, 2e-4))
    assert effect not in uncertainty_of(none).systematic
    # one that the drive has is no error of the model
    rough = of_part("pump", 1e-4, drive.replace(solenoid_hysteresis=1e-4))
    assert effect not in uncertainty_of(rough).systematic
    single, double = (uncertainty_of(pump).systematic[effect] for pump in (one, two))
    z8 = one.problem.unknowns.names.index("Z8")
    assert double[z8] == pytest.approx(2.0 * single[z8], rel=0.1)
    # a current that comes late makes a slow plate seem slower
    assert single[z8] > 0.0


# --- runs that differ -----------------------------------------------------------------------------


def scaled_runs(random: np.random.Generator, count: int, deviation: float) -> list[Experiment]:
    """Runs of the valve, each with a gain of its own."""
    runs = []
    for number in range(count):
        whole = trial(f"run {number}")
        gain = TRUTH.gain * (1.0 + deviation * random.standard_normal())
        inputs = {"command": whole.input.values}
        position = simulate(Machine(valve, TRUTH._replace(gain=gain), given=Load()), inputs, 20.0)
        values = position["position"] + random.normal(0.0, 0.002, whole.input.values.size)
        channel = replace(whole["position"], values=values, accuracy=Accuracy())
        runs.append(replace(whole, channels={"position": channel}))
    return runs


def estimated(
    count: int, deviation: float, repeats: int, seed: int, told: Callable[[Optimum], float]
) -> list[float]:
    random = np.random.default_rng(seed)
    # residuals exceed the stated noise, as runs differ: other starts would end where this one does
    once = Search(0)
    return [
        told(fit(SETUP, scaled_runs(random, count, deviation), search=once)) for _ in range(repeats)
    ]


@pytest.mark.slow
def test_the_scale_of_runs_is_found_and_intervals_hold() -> None:
    """Gains that differ by 2 % from run to run: the mean of eight is known to 0.7 %."""

    def deviation(found: Optimum) -> float:
        runs = uncertainty_of(found).runs
        return 0.0 if runs is None else runs.deviation

    assert np.median(estimated(8, 0.02, 20, 1, deviation)) == pytest.approx(0.02, rel=0.25)

    def holds(found: Optimum) -> float:
        gain = next(each for each in estimates_of(found) if each.name == "gain")
        return float(gain.lower <= TRUTH.gain <= gain.upper)

    assert np.mean(estimated(8, 0.02, 60, 2, holds)) >= 0.88
    # of four runs nothing is said
    assert estimated(4, 0.02, 1, 3, deviation) == [0.0]


@pytest.mark.slow
def test_runs_that_do_not_differ_are_not_said_to() -> None:
    def deviation(found: Optimum) -> float:
        runs = uncertainty_of(found).runs
        return 0.0 if runs is None else runs.deviation

    assert max(estimated(8, 0.0, 10, 4, deviation)) < 0.002
