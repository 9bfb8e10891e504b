"""A drive in a fit: fit setups, weights, what drives the pump, and what runs begin with."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.identification.given import FEW, run_of, virtual

from swashplate import Campaign, Drive, Experiment, InputError
from swashplate.campaign import InputSignal
from swashplate.identification import (
    DriveModel,
    FitSetup,
    Unknown,
    at_instants,
    fit,
    load_setup,
    predict,
)
from swashplate.identification.estimation import at_rate_of, smooth
from swashplate.identification.estimation.drive_model import measured_current
from swashplate.identification.estimation.fit_problem import problem_of
from swashplate.identification.estimation.setup import Free
from swashplate.identification.statistics.determination import bounds_reached
from swashplate.maneuvers import source_tests, step
from swashplate.parameters import DEFINITIONS

THESIS_SETUPS = Path(__file__).parents[2] / "reproduction" / "setups"


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    tests = source_tests("hoist")
    chosen = {name: tests[name] for name in ("step +4 V", "sine 9 V 0.3 Hz", "ramp +1 V/s")}
    what = {"severity": "clean", "channels": ("rectified_current", "shaft_speed")}
    return virtual(tmp_path_factory.mktemp("t"), "hoist", chosen, **what)


def test_the_sources_weights_of_the_pump(campaign: Campaign) -> None:
    """campaign.md: 400 samples ignored; 4 V steps 64.4, ten times that on 1.0-1.8 and 6.0-6.7 s;
    0.3 Hz sines 0.1; ramps 2."""
    setup = load_setup(THESIS_SETUPS / "hoist-pump.toml")
    problem = problem_of(setup, smooth(Drive.preset("hoist").parameters), campaign.experiments)
    (speed,) = problem.channels
    weight = {
        each.maneuver: dict(zip(each[speed].time.round(3), each[speed].weight, strict=True))
        for each in problem.experiments
    }
    step, sine, ramp = (weight[name] for name in ("step +4 V", "sine 9 V 0.3 Hz", "ramp +1 V/s"))
    assert (step[0.5], step[0.875], step[1.5], step[3.0], step[6.5], step[8.0]) == pytest.approx(
        (0.0, 64.4, 644.0, 64.4, 644.0, 64.4)
    )
    assert (sine[0.5], sine[5.0]) == pytest.approx((0.0, 0.1))
    assert (ramp[0.5], ramp[5.0]) == pytest.approx((0.0, 2.0))


def test_what_is_freed_is_on_and_stays_above_off(campaign: Campaign) -> None:
    """Whatever the values on the way, the equations are those that the fit began with."""
    free = {
        "solenoid_hysteresis": Free(bounds=(0.0, 0.05)),
        "cam_ripple": Free(relative=(0.0, 2.0)),
        "Z12": Free(bounds=(-0.1, 0.1)),
    }
    nominal = Drive.preset("hoist").replace(cam_ripple=0.02).parameters
    problem = problem_of(FitSetup(free=free), nominal, campaign.experiments)
    by_name = dict(zip(problem.unknowns.names, problem.unknowns, strict=True))
    assert by_name["solenoid_hysteresis"].start == by_name["solenoid_hysteresis"].low == 1e-8
    assert by_name["solenoid_hysteresis"].scale == pytest.approx(0.25 * 0.05)
    assert by_name["cam_ripple"].low == 1e-9
    model = problem.model
    assert isinstance(model, DriveModel)
    on = {"hysteresis", "ripple", "loaded"}
    assert model.parameters.options == on
    for number in (-0.05, 0.0, 0.05):
        assert model.parameters_at({"Z12": number, "cam_ripple": 1e-9}).options == on
    assert nominal.options == {"ripple"}


@pytest.mark.slow
def test_a_recursion_of_another_rate_gives_way_to_its_equation() -> None:
    """Runs of 200 Hz are marched at 600 Hz: ζ and ω are found as they mean at every rate."""
    truth = Drive.preset("hoist").at_every_rate().scale(omega=1.05, zeta=0.95)
    maneuver = source_tests("hoist")["sine 9 V 0.3 Hz"]
    voltage, time = maneuver.sample(200.0), maneuver.time(200.0)
    truth = Drive(smooth(truth.parameters))
    current = truth.simulate(voltage, 200.0).current_positive
    run = run_of("slow", voltage, {"current_plus": current}, time=time)
    names = ("zeta_plus", "omega_plus")
    free = {name: Free(relative=(0.5, 2.0)) for name in names}
    setup = FitSetup(part="card", free=free, card_filter="recursion")
    found = fit(Drive.preset("hoist").parameters, [run], setup, tolerance=1e-12)
    assert found.parameters.rate is found.nominal.rate is None
    for name in names:
        assert found.parameters.numbers[name] == pytest.approx(truth.parameters.numbers[name])
    (said,) = found.doubts
    assert "slow is simulated at 600 Hz" in said
    own = Drive.preset("neutral").parameters
    assert at_rate_of([run], own) == (own, ())


def test_a_held_command_acts_half_a_sample_later_than_a_straight_one() -> None:
    """At the logger's own rate: the same samples, of a sine that hardly curves between two."""
    time = np.arange(0.0, 8.0, 1.0 / 512.0)
    command = 5.0 * np.sin(2.0 * np.pi * 0.4 * time)
    model, found = DriveModel(Drive.preset("hoist").parameters, "card"), {}
    for way in ("linear", "previous"):
        run = run_of("run", command, {"signed_current": np.zeros(time.size)}, hold=way)
        found[way] = model.simulate({}, run)["signed_current"]
    late = np.interp(time - 0.5 / 512.0, time, found["linear"])
    assert np.abs(found["previous"] - late).max() < 1e-3 * np.abs(late).max()
    assert np.abs(found["previous"] - found["linear"]).max() > 1e-3 * np.abs(late).max()


def test_a_run_cut_out_of_a_motion_begins_with_a_settled_card() -> None:
    """Cut at 3 s out of a sine whose command then is 8.6 V: at rest its card would be far off."""
    hoist = Drive.preset("hoist")
    whole = hoist.simulate(9.0 * np.sin(2.0 * np.pi * 0.1 * np.arange(0.0, 8.0, 1.0 / 512.0)))
    cut, channels = slice(1536, None), {"signed_current": whole.current[1536:]}
    model, off = DriveModel(hoist.parameters, "card"), {}
    for start in ("rest", "estimated"):
        run = run_of("run", whole.voltage[cut], channels, time=whole.time[cut], start=start)
        found = model.simulate({}, run)["signed_current"]
        off[start] = np.abs(found - whole.current[cut]).max()
    assert off["rest"] > 0.1
    assert off["estimated"] < 0.005


@pytest.mark.parametrize("rate", [512.0, pytest.param(None, marks=pytest.mark.slow)])
def test_a_run_cut_out_of_a_rising_current_has_a_current_of_its_own(rate: float | None) -> None:
    """From 0.1 s after a step of 9 V on the rate limit acts: no settled card begins like that."""
    drive = Drive(replace(smooth(Drive.preset("hoist").parameters), rate=rate))
    random, runs = np.random.default_rng(1), []
    for name, volts, first in (("cut", 9.0, 563), ("whole", 9.0, 0)):
        simulated = drive.simulate(step(volts, start=1.0, stop=4.0, length=6.0).sample(512.0))
        time, true = simulated.time[first:], simulated.current[first:]
        current = {"signed_current": true + random.normal(0.0, 1e-3, time.size)}
        more = {"noise": 1e-3, "start": "estimated" if first else "rest"}
        runs.append(run_of(name, simulated.voltage[first:], current, time=time, **more))
    assert 0.1 < simulated.current[563] < 0.6
    free = {name: Free(relative=(0.5, 2.0), log=True) for name in ("lim1_plus", "omega_plus")}
    found = fit(drive, runs, FitSetup(part="card", free=free))
    assert found.values["start_current_plus (cut)"] == pytest.approx(
        simulated.current[563], abs=0.005
    )
    samples = found.problem.samples
    assert 2.0 * found.solution.cost == pytest.approx(samples, abs=5.0 * np.sqrt(2.0 * samples))


def test_a_chain_that_begins_with_a_current_has_intervals() -> None:
    """The pump alone, by which a hysteresis of the current is judged, has no such unknown."""
    drive = Drive(smooth(Drive.preset("hoist").parameters))
    simulated = drive.simulate(step(9.0, start=1.0, stop=4.0, length=6.0).sample(512.0))
    random, kept = np.random.default_rng(1), slice(563, None)
    channels = {
        "signed_current": simulated.current[kept] + random.normal(0.0, 1e-3, 2510),
        "shaft_speed": simulated.shaft_speed[kept] + random.normal(0.0, 1e-3, 2510),
    }
    run = run_of(
        "cut",
        simulated.voltage[kept],
        channels,
        time=simulated.time[kept],
        noise=1e-3,
        start="estimated",
    )
    found = fit(drive, [run], {"lim1_plus": (0.5, 2.0), "Z10": (0.5, 2.0)})
    assert found.values["start_current_plus (cut)"] == pytest.approx(
        simulated.current[563], abs=0.01
    )
    assert found["Z10"].status == "estimated"


@pytest.mark.slow
def test_a_bound_that_was_reached_is_said_with_the_entry_that_states_it(campaign: Campaign) -> None:
    drive = Drive(smooth(campaign.drive("hoist").parameters)).scale(lim1=0.6)
    runs = campaign.select(role="fit")
    said = {}
    for upper in (1.3, 2.6):
        free = {"lim1": Free(relative=(0.5, upper), log=True)}
        found = fit(drive, runs, FitSetup(part="card", free=free))
        said[upper] = [each for each in bounds_reached(found) if "lim1_plus" in each]
    assert found.values["lim1_plus"] == pytest.approx(2.2841, rel=0.01)
    (line,) = said[1.3]
    assert "widen lim1 under [free] of the fit setup" in line
    assert said[2.6] == []
    unknown = Unknown("V_dz_plus", 0.5, 0.0, 5.0, "V")
    stated = FitSetup(part="card", free={"V_dz": Free(bounds=(0.0, 5.0))})
    assert stated.beyond(unknown, -1, DEFINITIONS) == "the least value that it may have"
    assert "widen V_dz under" in stated.beyond(unknown, 1, DEFINITIONS)


# --- the measured current as what drives the pump -------------------------------------------------

TIME = np.arange(1025) / 512.0
CURRENT = np.where(TIME < 1.0, 0.3, -0.2)
"""0.3 A forwards for a second, then 0.2 A backwards."""
BELOW = np.where(np.arange(TIME.size) == 3, 0.001, 0.0)
"""A sample of noise below zero, which is no current backwards."""


CURRENTS = {
    "signed": ({"signed_current": CURRENT}, CURRENT),
    "of each way": (
        {
            "current_plus": np.maximum(CURRENT, 0.0) + 0.05,
            "current_minus": np.maximum(-CURRENT, 0.0) + 0.05,
        },
        CURRENT,
    ),
    "rectified": (
        {"rectified_current": np.where(BELOW > 0.0, -BELOW, np.abs(CURRENT))},
        np.where(BELOW > 0.0, 0.0, CURRENT),
    ),
}


@pytest.mark.parametrize(("channels", "expected"), CURRENTS.values(), ids=CURRENTS)
def test_a_measured_current_drives_the_pump(channels: dict, expected: np.ndarray) -> None:
    command = run_of("step", 4.0 * np.sign(CURRENT), channels, hold="previous")
    np.testing.assert_allclose(measured_current(command).values, expected, atol=1e-15)
    np.testing.assert_allclose(measured_current(command, 1.5).values, 1.5 * expected, atol=1e-15)
    driven = run_of("step", CURRENT, {}, kind="current")
    np.testing.assert_allclose(measured_current(driven).values, CURRENT)
    with pytest.raises(InputError, match="step .* signed_current"):
        measured_current(run_of("step", CURRENT, {}))


# --- jumps of a command between two samples -------------------------------------------------------


def command(rate: float, *levels: float, hold: str = "linear", noise: float = 0.0) -> InputSignal:
    """A second at each level, with samples in the middle of each interval."""
    time = (np.arange(round(len(levels) * rate)) + 0.5) / rate
    values = np.asarray(levels)[time.astype(int)]
    values = values + noise * np.random.default_rng(1).normal(size=time.size)
    return run_of("run", values, {}, time=time, hold=hold).input


@pytest.mark.parametrize(
    ("signal", "instants"),
    [
        (command(100.0, 0.0, 4.0, -2.0, noise=0.01), [1.0, 2.0]),
        (command(100.0, 0.0, 4.0, hold="previous"), []),
        (command(512.0, 0.0, 4.0), []),  # as it is logged
        (command(100.0, 0.0, 4.0, 4.2), [1.0]),  # small beside the range
        (run_of("ramp", np.linspace(0.0, 9.0, 10), {}, time=np.arange(10) / 10.0).input, []),
    ],
)
def test_jumps_between_two_samples(signal: InputSignal, instants: list[float]) -> None:
    assert [each.middle for each in signal.edges] == pytest.approx(instants)


def thinned(run: Experiment, first: int) -> Experiment:
    """Every fifth sample of a run."""
    kept, names = slice(first, None, 5), ("time", "values", "weight", "counts")
    channels = {}
    for name, each in run.channels.items():
        rows = {part: getattr(each, part) for part in names}
        left = {part: row[kept] for part, row in rows.items() if row is not None}
        channels[name] = replace(each, **left)
    signal = replace(run.input, time=run.input.time[kept], values=run.input.values[kept])
    return replace(run, input=signal, channels=channels)


@pytest.mark.slow
def test_a_slow_log_of_steps_is_fitted_as_well_as_a_fast_one(short_campaign: Campaign) -> None:
    """At 102 Hz; without the instants Z10 would be 0.07 % off, and J 0.1 %."""
    runs = [thinned(each, k) for k, each in enumerate(short_campaign.select(role="fit"))]
    found = fit(Drive.preset("hoist"), runs, FEW)
    numbers = found.drive.parameters.numbers
    assert numbers["J_plus"] == pytest.approx(0.26, rel=2e-5)
    assert numbers["J_minus"] == pytest.approx(0.31, rel=2e-5)
    assert numbers["Z10"] == pytest.approx(13.0, rel=1e-4)
    assert "Commands jump 8 times between two samples: the instant is estimated." in found.sentences
    instants = [
        edge.middle + found.values[f"edge at {edge.middle:.6g} s ({run.name})"]
        for run in runs
        for edge in run.input.edges
    ]
    # all at 0.5 s and 2.5 s of the commands, and all with the same rounding off
    assert np.diff(np.reshape(instants, (-1, 2)), axis=0) == pytest.approx(0.0, abs=3e-4)


@pytest.mark.parametrize("first", [0, 2])
def test_a_slow_log_is_predicted_as_well_as_a_fast_one(short_campaign, first) -> None:
    """By the true drive, of which these logs have no noise; with jumps halfway it is far off."""
    truth = Drive.preset("hoist").replace(J=(0.26, 0.31), Z10=13.0)
    for run in short_campaign.experiments:
        found = {each.channel: each for each in predict(truth, [thinned(run, first)])}
        rounding = run["counts"].resolution / np.sqrt(12.0)
        assert found["counts"].measures.rmse < 0.2 * rounding
        assert found["current"].measures.rmse < 4e-4


def test_a_run_without_a_channel_of_a_drive_has_its_command_as_it_is() -> None:
    time = (np.arange(300) + 0.5) / 100.0
    run = run_of("run", np.where(time < 1.0, 0.0, 5.0), {"depth": np.zeros(300)}, time=time)
    assert len(run.input.edges) == 1
    assert at_instants(Drive.preset("hoist").parameters, run) is run
