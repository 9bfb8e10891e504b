"""Lack of fit on virtual campaigns: silent where all is sound, and each fault by its name."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.identification.given import bench_run

from swashplate import Campaign, Drive
from swashplate.campaign import rig
from swashplate.identification import faults
from swashplate.identification.criteria import Verdict, verdict
from swashplate.identification.determination import identifiability_of
from swashplate.identification.faults import clipped_channels
from swashplate.identification.fitting import fit
from swashplate.identification.misfit import lack_of_fit
from swashplate.identification.setup import load_setup
from swashplate.identification.stage_fit import StageFit
from swashplate.identification.validation import predict
from swashplate.maneuvers import ramp, sine, step

TESTS = {
    "ramp": ramp(1.0, settle=4.5),
    "step": step(2.0),
    "slow": sine(4.0, 0.1, settle=4.5, length=20.0),
    "large": sine(6.0, 0.1, settle=4.5, length=20.0),
    "middle": sine(5.0, 0.1, settle=4.5, length=20.0),
}
Logs = Callable[[dict[str, np.ndarray]], None]


NOMINAL = Drive.preset("slew")
MISFIT = "lack of fit of counts"
DRIFT = "drift of counts"


def fitted(
    folder: Path,
    drive: Drive = NOMINAL,
    logs: Logs = lambda columns: None,
    each: tuple[float, ...] = (0.0,) * 5,
    days: tuple[int, ...] = (),
    counts: float | None = None,
) -> tuple[list[StageFit], Verdict]:
    """A slew campaign of five tests, each with a machine that much faster, and its judgement.

    Recorded on these days of a month, if any are given.
    """
    runs = {}
    for faster, (name, maneuver) in zip(each, TESTS.items(), strict=True):
        truth, held = drive.scale(Z10=1.0 + faster), [name] * (name == "middle")
        made = rig.run(
            NOMINAL, {name: maneuver}, truth=truth, validate=held, counts_per_turn=counts
        )
        columns = {key: values.copy() for key, values in made.runs[name].columns.items()}
        logs(columns)
        runs[name] = replace(made.runs[name], columns=columns)
    path = rig.write(replace(made, runs=runs), folder / "virtual")
    text = path.read_text("utf-8")
    for day, name in zip(days, runs, strict=bool(days)):
        entry = f'file = "slew_{name}.csv"'
        assert text.count(entry) == 1
        text = text.replace(entry, f"{entry}\nrecorded = 2026-05-{day:02}")
    path.write_text(text, "utf-8")
    campaign = Campaign.from_toml(path)
    result = fit(NOMINAL.parameters, campaign.select(role="fit"), load_setup("slew"))
    predicted = predict(result.parameters, campaign.select(role="validate"))
    return [*result.stages], verdict(result.stages, predicted)


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[StageFit], Verdict]:
    """With an encoder of a tenth of the real one's counts.

    Their rounding is less than what the second order of the card's errors leaves in the pump.
    """
    return fitted(tmp_path_factory.mktemp("sound"), counts=60_000.0)


def failed(found: Verdict) -> set[str]:
    return {each.name for each in found.criteria if each.failure}


def test_a_sound_campaign_passes_every_criterion(sound) -> None:
    stages, found = sound
    assert found.grade == "Usable", found.headline
    assert not failed(found)
    assert lack_of_fit(stages).ratios["counts"] == pytest.approx(1.0, abs=0.05)
    assert found.validity.startswith("Holds for ramps, steps and sines of up to 0.1 Hz from -6 to")
    assert "never reached" in found.validity
    moving = [e.scale.size for e in lack_of_fit(stages).runs if e.channel == "counts"]
    assert moving == pytest.approx([0.0] * 4, abs=3e-3)


def test_the_units_of_the_estimates_are_found_by_computation(sound) -> None:
    units = lack_of_fit(sound[0]).units
    # each stands for a scale that no speed tells: pressure, force, travel, piston motion
    assert {"Z9", "Z4", "Z5", "Z6"} <= set(units)
    assert "V_dz" not in units
    assert any(words.startswith("The estimates are in units of") for words in sound[1].assumed)


@pytest.mark.slow
def test_an_estimate_at_its_bound_is_a_unit_like_a_fixed_one(tmp_path: Path) -> None:
    # Z8 could make up for a sixth of the supply pressure, and may go down to a half
    stages, found = fitted(tmp_path, NOMINAL.scale(Z9=0.15))
    assert "Z8" in identifiability_of(stages[-1]).at_bounds
    assert {"Z8", "Z9"} <= set(lack_of_fit(stages).units)
    assert found.grade == "Not usable"
    assert "Z8 by -" in found.headline


def test_late_stamps_of_the_command_are_the_fixed_delay(sound) -> None:
    fault = lack_of_fit(sound[0]).fault("time stamps of the command")
    assert fault is not None
    assert fault.hidden
    assert fault.outside < 0.01
    assert "equal to other values of the fixed tau" in " ".join(sound[1].assumed)


@pytest.mark.slow
def test_a_longer_delay_than_the_fixed_one_is_named(tmp_path: Path) -> None:
    tau = NOMINAL.parameters.numbers["tau"]
    stages, found = fitted(tmp_path, NOMINAL.replace(tau=tau + 0.02))
    assert found.grade == "Usable for prediction", found.headline
    assert {MISFIT, "time stamps of counts"} <= failed(found)
    causes = {each.name: each for each in lack_of_fit(stages).causes}
    # after one step: the other estimates have moved to make up for a part of it
    assert causes["time stamps of counts"].size == pytest.approx(20.0, rel=0.2)
    assert "parameter values not to be trusted because residuals of counts are" in found.headline


@pytest.mark.slow
def test_a_load_is_named(tmp_path: Path) -> None:
    lost = float(np.radians(0.08))
    loaded = NOMINAL.replace(load_torque=3e4, motor_leakage=lost / 3e4)
    stages, found = fitted(tmp_path, loaded)
    assert MISFIT in failed(found)
    first = lack_of_fit(stages).causes[0]
    assert first.name == "load or leakage, as a loss of counts,"
    assert first.size == pytest.approx(0.08, rel=0.1)


def test_a_drift_is_named_and_rules_out_the_use(tmp_path: Path) -> None:
    stages, found = fitted(tmp_path, each=(-0.04, -0.02, 0.0, 0.02, 0.04))
    assert found.grade == "Not usable"
    assert {MISFIT, DRIFT} <= failed(found)
    # 8 % over five runs, of which the fourth of five is held out
    assert lack_of_fit(stages).causes[0].name.startswith(DRIFT)
    assert lack_of_fit(stages).causes[0].size == pytest.approx(6.0, abs=2.0)


def test_a_drift_is_found_in_the_order_of_time(tmp_path: Path) -> None:
    """In the order of the file the machine only differs between runs."""
    drifting = {3: -0.04, 5: -0.02, 8: 0.0, 9: 0.02, 12: 0.04}
    days = 9, 3, 12, 8, 5
    stages, found = fitted(tmp_path, each=tuple(drifting[day] for day in days), days=days)
    assert {MISFIT, DRIFT} <= failed(found)
    assert lack_of_fit(stages).causes[0].name.startswith(DRIFT)


def test_runs_that_differ_in_no_order_are_no_drift(tmp_path: Path) -> None:
    stages, found = fitted(tmp_path, each=(0.04, -0.04, -0.04, 0.0, 0.04))
    assert MISFIT in failed(found)
    assert DRIFT not in failed(found)
    assert not any(each.name.startswith(DRIFT) for each in lack_of_fit(stages).causes)


def test_a_clipped_ammeter_is_found_with_the_limits_to_state(tmp_path: Path) -> None:
    def clip(columns: dict[str, np.ndarray]) -> None:
        columns["current"] = np.minimum(columns["current"], 0.2)

    stages, found = fitted(tmp_path, logs=clip)
    assert found.grade == "Not usable"
    assert "clipped channels" in failed(found)
    said = lack_of_fit(stages).clipped
    assert len(said) == 1
    assert "'current' stands at exactly 0.2 A" in said[0]
    assert ", 0.2] in its channel" in said[0]


@pytest.mark.parametrize("rate", [50.0, 100.0, 512.0])
def test_a_lag_keeps_a_full_command_within_its_range(rate: float) -> None:
    time = np.arange(int(20.0 * rate)) / rate
    for full in (10.0, -10.0):
        command = np.where(time > 1.0, full, 0.0)
        assert np.abs(faults._lagged(time, command)).max() <= 10.0


@pytest.mark.parametrize(
    ("kind", "size", "near"),
    [
        (faults.SCALE, 20.0, True),
        (faults.SCALE, 93.0, False),
        (faults.LATE, -40.0, True),
        (faults.LATE, 400.0, False),
        (faults.LOSS, 600.0, True),
        (faults.LOSS, -1240.0, False),
        (faults.SLOW, -5.0, False),
        (faults.FIXED, 93.0, True),
        (faults.FIXED, 125.0, False),
    ],
)
def test_one_step_says_how_large_a_fault_is_or_nothing(kind, size: float, near: bool) -> None:
    fault = faults.Fault(kind, kind.words.format("counts"), size, 0.5, 0.8, 1e-3, ())
    assert fault.near is near


@pytest.mark.slow
def test_a_counter_that_does_not_follow_is_no_stop_of_the_machine(tmp_path: Path) -> None:
    def lose(columns: dict[str, np.ndarray]) -> None:
        apart = np.diff(columns["time"])
        rate = np.convolve(np.diff(columns["counts"]) / apart, np.ones(32) / 32.0, "same")
        kept = np.cumsum(np.clip(rate, -5000.0, 5000.0) * apart)
        columns["counts"] = np.floor(columns["counts"][0] + np.append(0.0, kept))

    stages, found = fitted(tmp_path, logs=lose)
    assert found.grade == "Not usable"
    assert "loss at the largest speeds of counts" in failed(found)
    assert "counts does not follow the largest speeds" in found.headline
    assert lack_of_fit(stages).causes[0].name == "loss at the largest speeds of counts"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "said"),
    [("counts", "scale of counts, or of the fixed Z10, off by"), ("current", "scale of current")],
)
def test_a_scale_that_is_off_is_named_with_the_fixed_value_that_looks_like_it(
    tmp_path: Path, name: str, said: str
) -> None:
    def off(columns: dict[str, np.ndarray]) -> None:
        columns["current"] *= 1.05

    # 3 % more counts are a shaft that is 3 % faster
    change = {"drive": NOMINAL.scale(Z10=1.03)} if name == "counts" else {"logs": off}
    stages, found = fitted(tmp_path, **change, counts=300_000.0)
    assert found.grade == "Usable for prediction", found.headline
    assert re.search(f"{said}.* [+][0-9.]+ %", found.headline)
    fault = lack_of_fit(stages).fault(f"scale of {name}")
    assert fault is not None
    # one step from where the estimates have made up for a part of it
    assert 2.0 < fault.size < 5.0
    if name == "counts":
        assert fault.hidden


def lagged(time: np.ndarray, values: np.ndarray, lag: float) -> np.ndarray:
    """A first-order lag, step by step."""
    made = values.astype(np.float64)
    for n, kept in enumerate(np.exp(-np.diff(time) / lag)):
        made[n + 1] = kept * made[n] + (1.0 - kept) * values[n + 1]
    return made


@pytest.mark.slow
def test_lag_and_late_stamps_are_named_together(tmp_path: Path) -> None:
    def slow(columns: dict[str, np.ndarray]) -> None:
        columns["counts"] = np.floor(lagged(columns["time"], columns["counts"], 0.03))

    stages, found = fitted(tmp_path, logs=slow)
    assert MISFIT in failed(found)
    misfit = lack_of_fit(stages)
    causes = {each.name: each.size for each in misfit.causes}
    # a lag and a delay are the same to first order
    assert causes["lag of counts"] == pytest.approx(30.0, rel=0.1)
    assert "time stamps of counts" in causes
    assert "hardly tell apart" in misfit.likely
    assert misfit.likely in found.headline


def test_what_was_not_judged_says_what_would_allow_it(sound) -> None:
    (said,) = sound[1].not_judged
    assert said.startswith("Not judged: lack of fit of current")
    assert "noise = ... in [axes.slew.channels.current]" in said


@pytest.mark.slow
def test_a_run_of_another_machine_is_named(tmp_path: Path) -> None:
    runs = 0

    def stranger(columns: dict[str, np.ndarray]) -> None:
        nonlocal runs
        runs += 1
        if runs == 1:
            columns["counts"] = np.floor(0.2 * columns["counts"])

    _, found = fitted(tmp_path, logs=stranger)
    assert found.grade == "Not usable"
    assert "slew_ramp contradicts the other runs" in found.headline.replace("\n", " ")


@pytest.mark.parametrize("rounding", [0.001, 0.5])
def test_a_rounded_channel_that_lags_is_not_clipped(rounding: float) -> None:
    """It stands at its largest value through a pulse, and 0.3 s longer than that."""
    time = np.linspace(0.0, 4.0, 81)
    pulse = np.where((time > 0.5) & (time < 3.0), 5.0, 0.0) + 2.0 * np.sin(time) * (time >= 3.0)
    late = np.where((time > 0.8) & (time < 3.3), 4.0, 0.0) + np.sin(time - 0.3) * (time >= 3.3)
    run = bench_run("pulse", 1.0, np.round(late / rounding) * rounding)
    run = replace(run, input=replace(run.input, values=pulse))
    assert clipped_channels([run]) == ()
    assert clipped_channels([bench_run("still", 1.0, np.zeros(81))]) == ()
    cut = bench_run("cut", 1.0, np.minimum(3.0 * np.sin(time), 1.5))
    cut = replace(cut, input=replace(cut.input, values=3.0 * np.sin(time)))
    (said,) = clipped_channels([cut])
    assert "'y' stands at exactly 1.5 1" in said
    for upper, count in ((1.5, 0), (1.495, 0), (1.6, 1)):
        stated = replace(cut["y"], limits=(-3.5, upper))
        assert len(clipped_channels([replace(cut, channels={"y": stated})])) == count


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
    found = clipped_channels(runs)
    assert len(found) == (cut and noise > 0.0)
    if found:
        assert "'y' stands at exactly 1 1 at inputs that differ by 2 1" in found[0]


@pytest.mark.parametrize(
    ("error", "said"),
    [(0.004, "smaller than 0.8 % would not be noticed"), (0.6, "do not check it at all")],
)
def test_how_small_an_error_stays_unseen(error: float, said: str) -> None:
    """Two standard errors; of one as large as the signal a number says nothing."""
    kind = faults.SCALE._replace(plausible=1e3)
    scale = faults.Fault(kind, "scale of counts", 0.0, 100.0 * error, 0.0, 0.0, ())
    assert said in scale.assumption
