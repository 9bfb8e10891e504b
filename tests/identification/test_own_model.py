"""A model of one's own in a fit: exact derivatives, starts and loads, and all that drives have."""

import pickle
import re
import sys
from dataclasses import replace
from math import exp, nan, sqrt
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests.identification.given import run_of

from swashplate import (
    Campaign,
    Channel,
    DomainError,
    Experiment,
    FileError,
    InputError,
    ParameterError,
)
from swashplate.executors import Processes
from swashplate.identification import (
    Identification,
    ModelSetup,
    Problem,
    Search,
    Unknown,
    Unknowns,
    assess_fit,
    fit,
    identifiability_of,
    predict,
    solve,
    uncertainty_of,
)
from swashplate.identification.estimation.measured_machine import measured
from swashplate.identification.estimation.model import linearised
from swashplate.identification.estimation.problem import rounded_unknowns
from swashplate.machine import BlackBox, Definition, Machine, Model, Tap, equation, simulate

RATE = 20.0
TIME = np.arange(240) / RATE
COMMAND = np.where(TIME % 4.0 < 2.0, 2.0, -1.0)


class Valve(NamedTuple):
    lag: float
    gain: float
    delay: float = 0.0


class Rod(NamedTuple):
    opening: float
    position: float


class Load(NamedTuple):
    force: float = 0.0
    stop: float = 1e3


@equation
def step(state: Rod, command: float, p: Valve, h: float, given: Load) -> Rod:
    opening = state.opening + (1.0 - exp(-h / p.lag)) * (command - state.opening)
    position = state.position + h * (p.gain * opening - given.force)
    return Rod(opening, min(position, given.stop))


@equation
def room(state: Rod, p: Valve) -> float:
    return 5.0 - p.gain


valve = Model(
    "valve",
    Valve,
    Rod,
    step,
    given=Load,
    taps={"command": Tap("command", delay="delay")},
    domain=room,
    outside="the valve has no such gain",
)
TRUTH = Valve(0.4, 1.5, 0.13)
FREE = (
    Unknown("lag", 0.2, 0.05, 2.0, "s", log=True),
    Unknown("gain", 1.0, 0.1, 20.0, log=True),
    Unknown("delay", 0.05, 0.0, 0.5, "s"),
)
OWN = measured(valve, given=Load())


def trial(name: str, load: Load = Load(), begin: float = 0.0, **channels: np.ndarray) -> Experiment:  # noqa: B008
    """A run of the true valve."""
    run = simulate(
        Machine(valve, TRUTH, given=load), {"command": COMMAND}, RATE, begin={"position": begin}
    )
    channels = {"position": run["position"], **channels}
    return run_of(name, COMMAND, channels, time=TIME, kind="other", hold="previous")


def moved(run: Experiment, values: np.ndarray, **more: object) -> Experiment:
    """A run with other values of its first channel, its position."""
    name, channel = next(iter(run.channels.items()))
    return replace(run, channels={**run.channels, name: replace(channel, values=values, **more)})


def problem(model: object, *runs: Experiment, free: tuple[Unknown, ...] = FREE, **more) -> Problem:
    return Problem(model, runs, Unknowns(free), ("position",), {"position": 0.01}, **more)


def found(made: Problem) -> dict[str, float]:
    return made.unknowns.values(solve(made, tolerance=1e-14).vector)


class Differences:
    """The same model without its derivatives."""

    def simulate(self, values, experiment):
        return OWN.simulate(values, experiment)


def test_derivatives_are_exact_and_the_triangle_is_theirs() -> None:
    run, values = trial("a"), {"lag": 0.3, "gain": 1.1, "delay": 0.12}
    exact = linearised(OWN, values, run, list(values))["position"]
    near = linearised(Differences(), values, run, list(values))["position"]
    assert exact.values == pytest.approx(near.values, abs=1e-12)
    assert exact.by == pytest.approx(near.by, abs=1e-6)
    assert np.abs(exact.by).max(axis=0).min() > 0.01
    made = problem(OWN, run)
    full, small = (made.evaluate(made.start, compressed=each) for each in (False, True))
    assert small.jacobian.shape == (4, 3)
    gradient = full.jacobian.T @ full.residuals
    assert small.jacobian.T @ small.residuals == pytest.approx(gradient, rel=1e-9)


def test_a_run_has_a_load_a_beginning_and_a_zero_of_its_own() -> None:
    loads = {"a": Load(0.2), "b": Load(-0.3, stop=9.0)}
    first, second = trial("a", loads["a"], 0.7), trial("b", loads["b"])
    free = (
        *FREE,
        Unknown("start.position", 0.0, -2.0, 2.0, run="a"),
        Unknown("offset position", 0.0, -2.0, 2.0, run="b", kind="zero", channel="position"),
    )
    runs = (first, moved(second, second["position"].values + 0.4))
    values = found(problem(measured(valve, given=loads), *runs, free=free))
    own = {"start.position (a)": 0.7, "offset position (b)": 0.4}
    assert values == pytest.approx({**TRUTH._asdict(), **own}, rel=1e-6)
    # or it begins where a channel does
    model = measured(valve, given=loads, begin={"position": "position"})
    assert found(problem(model, first)) == pytest.approx(TRUTH._asdict(), rel=1e-7)


@pytest.mark.parametrize("hold", ["previous", "linear"])
def test_uneven_stamps_are_put_on_a_grid(hold: str) -> None:
    """What was logged at jittered stamps, marched at a rate of one's own."""
    jitter = np.random.default_rng(3).uniform(-0.02, 0.02, TIME.size)
    time = TIME + np.where(np.arange(TIME.size) % 239 == 0, 0.0, jitter)
    channels = {"position": np.zeros(time.size)}
    run = run_of("a", np.sin(2.0 * time), channels, time=time, kind="other", hold=hold)
    fine = np.arange(int(time[-1] * 200.0) + 1) / 200.0
    level = simulate(Machine(valve, TRUTH, given=Load()), {"command": run.input.at(fine)}, 200.0)[
        "position"
    ]
    run = moved(run, np.interp(time, fine, level))
    values = found(problem(measured(valve, given=Load(), rate=200.0), run))
    assert values == pytest.approx(TRUTH._asdict(), rel=1e-3)
    with pytest.raises(InputError, match=r"a: .* input .* rate=100.0"):
        problem(OWN, run).cost(Unknowns(FREE).start)


def lagging(state: Rod, command: float, p: Valve, h: float) -> Rod:
    """Euler's method, which the step's length shows in."""
    opening = state.opening + h * (command - state.opening) / p.lag
    return Rod(opening, state.position + h * p.gain * opening)


@pytest.mark.parametrize("hold", ["previous", "linear"])
def test_sub_steps_of_a_fit_are_those_of_a_simulation(hold) -> None:
    coarse = Model("coarse", Valve, Rod, equation(lagging))
    way = {"interpolation": hold, "substeps": 3}
    made = simulate(Machine(coarse, TRUTH), {"command": COMMAND}, RATE, **way)["position"]
    run = moved(trial("a"), made)
    run = replace(run, input=replace(run.input, interpolation=hold))
    expected = {"lag": TRUTH.lag, "gain": TRUTH.gain}
    values = found(problem(measured(coarse, substeps=3), run, free=FREE[:2]))
    assert values == pytest.approx(expected, rel=1e-7)
    assert found(problem(coarse, run, free=FREE[:2]))["lag"] != pytest.approx(TRUTH.lag, rel=0.01)
    with pytest.raises(InputError, match="substeps .* 0, .* whole number"):
        problem(measured(coarse, substeps=0), run).cost(Unknowns(FREE).start)


@equation
def pushed(state: Rod, command: float, load: float, p: Valve, h: float) -> Rod:
    return Rod(load, state.position + h * (p.gain * command - load))


@pytest.mark.parametrize("hold", ["previous", "linear"])
def test_a_channel_that_is_an_input_is_what_its_campaign_says_between_samples(hold) -> None:
    model, slow = Model("pushed", Valve, Rod, pushed), slice(None, None, 5)
    load = np.cos(3.0 * TIME[slow])
    run = run_of("a", COMMAND, {"position": TIME, "load": load}, time=TIME, kind="other")
    logged = replace(run["load"], time=TIME[slow], interpolation=hold)
    run = replace(run, channels={**run.channels, "load": logged})
    held = np.repeat(load, 5)[: TIME.size]
    between = held if hold == "previous" else np.interp(TIME, TIME[slow], load)
    inputs = {"command": COMMAND, "load": between}
    expected = simulate(Machine(model, TRUTH), inputs, RATE)["position"]
    made = measured(model).simulate(TRUTH._asdict(), run)["position"]
    assert made == pytest.approx(expected, abs=1e-12)


def windowed(channel: Channel, rows: np.ndarray) -> np.ndarray:
    """Motion since the beginning of each two seconds."""
    windows = channel.time // 2.0
    return rows - rows[np.searchsorted(windows, windows)]


def test_a_position_is_compared_by_its_motion() -> None:
    run = trial("a")
    run = moved(run, run["position"].values + np.floor(TIME / 2.0))
    assert found(problem(OWN, run))["gain"] != pytest.approx(1.5, rel=0.1)
    values = found(problem(OWN, run, compare=windowed))
    assert values == pytest.approx(TRUTH._asdict(), rel=1e-6)


def test_the_domain_takes_a_step_back_and_ends_in_its_sentence() -> None:
    made = problem(OWN, trial("a"), free=(Unknown("gain", 0.2, 0.1, 20.0, log=True),))
    made = replace(made, fixed={"lag": 0.4, "delay": 0.13})
    assert found(made)["gain"] == pytest.approx(1.5)
    with pytest.raises(DomainError, match=r"^valve: the valve has no such gain under this "):
        solve(made, made.unknowns.vector_of({"gain": 6.0}))


def tried(model: object, *more: Unknown) -> None:
    solve(problem(model, trial("a"), free=(*FREE, *more)))


PLACE = Unknowns(FREE[:2]), ("place",), {"place": 1.0}
BOTH = Unknowns(FREE), ("y", "position"), {"y": 1.0, "position": 1.0}
REFUSED = {
    "'lead'; .* lag": lambda: tried(OWN, Unknown("lead", 1.0, 0.0, 2.0)),
    "state 'speed'": lambda: tried(OWN, Unknown("start.speed", 1.0, 0.0, 2.0)),
    "value of gain": lambda: solve(problem(OWN, trial("a"), free=FREE[:1])),
    "gives no 'y'": lambda: solve(Problem(OWN, (trial("a", y=COMMAND),), *BOTH)),
    "signals command, supply; a ": lambda: solve(Problem(servo, (trial("a", place=TIME),), *PLACE)),
    "given .* a Load": lambda: tried(measured(valve)),
    "given .* for a": lambda: tried(measured(valve, given={"b": Load()})),
}


@pytest.mark.parametrize(("sentence", "make"), REFUSED.items(), ids=REFUSED)
def test_what_does_not_fit_the_model_is_refused(sentence: str, make) -> None:
    with pytest.raises(InputError, match=sentence):
        make()


# --- fitted, predicted, stored and refused as a drive is ------------------------------------------

GAIN, LAG, COUNT = 1.5, 0.3, 400


class Servo(NamedTuple):
    gain: float
    lag: float


class State(NamedTuple):
    place: float


@equation
def servo_step(state: State, command: float, supply: float, p: Servo, h: float) -> State:
    return State(state.place + h / p.lag * (p.gain * command * supply - state.place))


servo = Model("servo", parameters=Servo, state=State, step=servo_step)


class DocumentedServo(NamedTuple):
    gain: float
    lag: Annotated[float, Definition("lag", "s", lower=0.0, plausible=(1e-3, 100.0))]


@equation
def documented_step(
    state: State, command: float, supply: float, p: DocumentedServo, h: float
) -> State:
    return State(state.place + h / p.lag * (p.gain * command * supply - state.place))


documented = Model("servo", parameters=DocumentedServo, state=State, step=documented_step)
"""The same, whose author says which lags can be meant; of the gain nothing is said."""
RANGES = {
    "gain": (0.1, 1.0, 10.0, "mm/V"),
    "lag": (0.05, 0.1, 3.0),
    "start.place": (-9.0, 0.0, 9.0),
}
NOISE = {"place": 0.01}


def run(name: str, seed: int, *, begin: float = 0.0, role: str = "fit") -> Experiment:
    """A test of the servo with two inputs, that begins anywhere."""
    random = np.random.default_rng(seed)
    time = np.arange(COUNT) / 50.0
    command = np.repeat(random.uniform(-1.0, 1.0, COUNT // 20), 20)
    supply = 1.0 + 0.2 * np.sin(0.9 * time + seed)
    given, how = {"command": command, "supply": supply}, {"interpolation": "previous"}
    place = simulate(Machine(servo, Servo(GAIN, LAG)), given, 50.0, begin={"place": begin}, **how)[
        "place"
    ]
    channels = {"place": place + 0.01 * random.standard_normal(COUNT), "supply": supply}
    return run_of(name, command, channels, time=time, kind="other", hold="previous", role=role)


RUNS = (run("one", 1, begin=1.0), run("two", 2, begin=-2.0))
HELD = (run("three", 3, begin=0.5, role="validate"),)


def campaign(*experiments: Experiment) -> Campaign:
    return Campaign(
        Path("campaign.toml"),
        "servo",
        False,
        {each.axis: None for each in experiments},
        experiments,
    )


def test_the_truth_is_found_judged_and_predicted() -> None:
    made = fit(servo, campaign(*RUNS, *HELD), RANGES, noise=NOISE)
    assert made.problem.channels == ("place",)
    assert [each.name for each in made.problem.experiments] == ["one", "two"]
    truth = {"gain": GAIN, "lag": LAG, "start.place (one)": 1.0, "start.place (two)": -2.0}
    assert made.values == pytest.approx(truth, abs=0.02)
    # a range above 0 is searched in the logarithm
    assert [each.log for each in made.problem.unknowns] == [True, True, False, False]
    assert made.problem.unknowns[0].unit == "mm/V"
    for estimate, value in zip(uncertainty_of(made).estimates, truth.values(), strict=True):
        assert estimate.lower < value < estimate.upper
    (quality,) = predict(made.parameters, HELD)
    assert quality.channel == "place"
    assert quality.measures.rmse == pytest.approx(0.01, rel=0.1)  # the noise, nothing else
    assert assess_fit(made, [quality]).headline.startswith("Usable")


def tabled(time, inputs, numbers):
    """The servo as a program of others, with names that mean something to nobody else."""
    place, rows = 0.0, []
    for u, s in zip(inputs["command"], inputs["supply"], strict=True):
        rows.append(place)
        place += (numbers["offset slope"] * u * s - place) / (50.0 * numbers["lag"])
    return {"place": np.array(rows)}


TABLE = BlackBox(
    "table",
    tabled,
    inputs=("command", "supply"),
    outputs=("place",),
    numbers={"offset slope": 1.0, "lag": 0.1},
)


def test_a_name_that_begins_like_a_sensors_zero_is_the_models() -> None:
    made = fit(
        TABLE,
        [run("one", 1), run("two", 2)],
        {"offset slope": (0.1, 10.0), "lag": (0.05, 3.0)},
        noise=NOISE,
    )
    assert made.solution.converged
    assert made.parameters.numbers == pytest.approx({"offset slope": GAIN, "lag": LAG}, abs=0.01)
    assert made.solution.cost == pytest.approx(COUNT, rel=0.1)  # noise of deviation 1


def test_a_fit_comes_back_with_its_model_alone(tmp_path: Path) -> None:
    tests, path = campaign(*RUNS), tmp_path / "fit.json"
    made = fit(servo, tests, RANGES, noise=NOISE)
    result = Identification(tests, made)
    result.save(tmp_path)
    # starts of single runs are in the table of columns, and a sentence says so
    starts = [name for name in result.to_polars()["parameter"] if name.startswith("start.place")]
    assert len(starts) == len(RUNS)
    assert f"{len(RUNS)} numbers of single runs, such as {starts[0]}" in result.summary()
    with pytest.raises(InputError, match=r"user-defined.* model=.*--model FILE"):
        Identification.load(path, tests)
    with pytest.raises(InputError, match="model or other bounds"):
        Identification.load(
            path, tests, model=ModelSetup(servo, {**RANGES, "lag": (0.1, 0.2, 3.0)})
        )
    again = Identification.load(path, tests, model=ModelSetup(servo, RANGES, noise=NOISE)).fit
    assert again.parameters.numbers == made.parameters.numbers
    assert uncertainty_of(again).estimates == uncertainty_of(made).estimates


class Bend(NamedTuple):
    bend: float


class Speed(NamedTuple):
    speed: float


def bent(state: Speed, voltage: float, p: Bend) -> Speed:
    """A speed that has a ridge over `bend` at -1, where a search from the left is caught."""
    return Speed(voltage * (p.bend**3 - 3.0 * p.bend))


@pytest.mark.parametrize(
    ("speed", "tried"),
    [
        pytest.param(5.0, range(2, 7), id="until one explains what was measured"),
        pytest.param(30.0, [7], id="all of them, if none does"),
    ],
)
def test_other_starts_are_tried_where_residuals_are_large(speed, tried, caplog) -> None:
    model = Model("bent", parameters=Bend, state=Speed, step=bent)
    measured = np.full(TIME.size, speed)
    measured[0] = 0.0
    run = run_of("a", np.ones(TIME.size), {"speed": measured}, time=TIME, kind="other", noise=0.01)
    free = {"bend": (-2.2, -1.8, 2.9)}
    with caplog.at_level("INFO", "swashplate"):
        found = fit(model, [run], free)
    assert len(found.starts) in tried
    assert found.solution.cost == min(found.solution.cost, *(each.cost for each in found.starts))
    assert any("starts=0" in message for message in caplog.messages)
    alone = fit(model, [run], free, search=Search(0))
    assert alone.values["bend"] == pytest.approx(-1.0, abs=0.01)
    assert not alone.starts
    if speed == 5.0:
        assert found.values["bend"] == pytest.approx(2.2790, abs=1e-3)  # x³ - 3 x = 5


def narrow(state: Speed, voltage: float, p: Bend) -> Speed:
    """A speed that is a real number only if `bend` is from 4.99 to 5.01."""
    return Speed(voltage * (1.0 + sqrt(1e-4 - (p.bend - 5.0) ** 2)))


def test_a_fit_whose_other_starts_lie_out_of_the_domain() -> None:
    """A speed of 30 is far from all that the model can do, but only the nominal start holds."""
    model = Model("narrow", parameters=Bend, state=Speed, step=narrow)
    measured = np.full(TIME.size, 30.0)
    measured[0] = 0.0
    run = run_of("a", np.ones(TIME.size), {"speed": measured}, time=TIME, kind="other", noise=0.01)
    found = fit(model, [run], {"bend": (-1000.0, 5.002, 1000.0)})
    assert found.values["bend"] == pytest.approx(5.0, abs=0.01)
    assert len(found.starts) < 7


def test_starts_of_other_steps_are_not_resumed(tmp_path: Path) -> None:
    search = Search(1, store=tmp_path, resume=True)
    made = fit(servo, RUNS, RANGES, noise=NOISE, search=search)
    assert len(made.starts) == 2
    with pytest.raises(FileError, match="nominal values"):
        fit(ModelSetup(servo, RANGES, noise=NOISE, substeps=2), RUNS, search=search)


def test_data_are_checked_before_the_search() -> None:
    first, second = RUNS
    holed = np.where(np.arange(COUNT) == 50, np.nan, first["place"].values)
    with pytest.raises(InputError, match="one: 'place' .* 1 sample"):
        fit(servo, [moved(first, holed), second], RANGES, noise=NOISE)
    twice = fit(servo, [*RUNS, replace(first, name="copy")], RANGES, noise=NOISE)
    assert "copy has the samples of one" in twice.doubts[0]
    rest = replace(moved(first, np.zeros(COUNT), noise=0.01), name="still")
    still = fit(servo, [*RUNS, rest], RANGES, noise=NOISE)
    assert "still: 'place' never changes" in still.doubts[0]
    idle = [replace(each, input=replace(each.input, values=np.zeros(COUNT))) for each in RUNS]
    with pytest.raises(InputError, match="no run depends on any of gain"):
        fit(servo, idle, {"gain": RANGES["gain"]}, noise=NOISE, fixed={"lag": 0.3})
    assert fit(servo, RUNS, RANGES, noise=NOISE).doubts == ()


class Turning(NamedTuple):
    place: float
    speed: float


@equation
def turning_step(state: Turning, command: float, supply: float, p: Servo, h: float) -> Turning:
    speed = state.speed + h / p.lag * (p.gain * command * supply - state.speed)
    return Turning(state.place + h * speed, speed)


turning = Model("turning", parameters=Servo, state=Turning, step=turning_step)
"""A model of two signals, so that a fit goes on if a channel of one of them is called otherwise."""


PROGRAM = BlackBox(
    "program",
    lambda time, inputs, numbers: dict.fromkeys(("place", "speed"), 0.0 * time),
    inputs=("command", "supply"),
    outputs=("place", "speed"),
    numbers={"gain": 1.0, "lag": 0.3},
)


@pytest.mark.parametrize("model", [turning, PROGRAM], ids=["equations", "program"])
@pytest.mark.parametrize(
    ("name", "named"),
    [("sped", r"did you mean speed\?"), ("n_motor", "without a channel: speed")],
)
def test_a_channel_that_is_no_signal_of_the_model_is_refused(model, name, named) -> None:
    """Dropped in silence, it would leave what it measures to be guessed."""
    channel = replace(RUNS[0]["place"], name=name)
    tests = [replace(each, channels={**each.channels, name: channel}) for each in RUNS]
    setup = ModelSetup(model, {"gain": (0.1, 1.0, 10.0)}, fixed={"lag": 0.3})
    with pytest.raises(InputError, match=rf"one: the channel '{name}' is no signal.*{named}"):
        setup.nominal(tests)


def test_a_channel_is_left_out_if_that_is_said() -> None:
    tests = [
        replace(each, channels={**each.channels, "oil": replace(RUNS[0]["place"], name="oil")})
        for each in RUNS
    ]
    with pytest.raises(InputError, match=r"'oil' .* channels = \(\"place\",\)"):
        ModelSetup(servo, RANGES).nominal(tests)
    stated = ModelSetup(servo, RANGES, channels=("place",)).nominal(tests)
    assert list(stated.scales) == ["place"]


def late(samples) -> BlackBox:
    """A gain behind a delay, as a program that turns the delay into samples in its own way."""

    def delayed(time, inputs, numbers):
        behind = time - samples(numbers["delay"] * RATE) / RATE
        level = numbers["gain"] * np.interp(behind, time, inputs["command"])
        return {"position": np.clip(level, -numbers["limit"], numbers["limit"])}

    return BlackBox(
        "late",
        delayed,
        inputs=("command",),
        outputs=("position",),
        numbers={"gain": 1.2, "delay": 0.2, "limit": 50.0},
    )


@pytest.mark.parametrize("samples", [int, round, np.ceil], ids=["int", "round", "ceil"])
@pytest.mark.parametrize("nominal", [0.07, 0.1, 0.125])
def test_a_delay_that_the_model_rounds_is_named_as_such(samples, nominal) -> None:
    """A tenth of a sample changes nothing, ten do: no search can move it, wherever it begins."""
    truth = late(samples)
    command = np.interp(TIME, np.arange(0.0, 12.0, 1.5), [0.0, 2.0, -1.0, 1.5, 0.5, -2.0, 1.0, 0.0])
    runs = [run_of("a", command, {"position": np.zeros(TIME.size)}, time=TIME, kind="other")]
    answer = simulate(truth, {"command": command}, RATE)["position"]
    channel = replace(runs[0]["position"], values=answer, noise=0.01)
    runs[0] = replace(runs[0], channels={"position": channel})
    free = {"gain": (0.1, 1.0, 10.0), "delay": (0.0, nominal, 2.0, "s"), "limit": (1.0, 40.0, 80.0)}
    sentences = identifiability_of(fit(truth, runs, free)).sentences()
    assert any(
        re.match("The model rounds delay: a change by [0-9].* s .*np.interp", s) for s in sentences
    )
    unexercised = [sentence for sentence in sentences if "No test exercises" in sentence]
    assert [sentence.partition(":")[0] for sentence in unexercised] == ["No test exercises limit"]


def test_a_delay_that_the_model_follows_is_not_called_rounded() -> None:
    """Nor is a limit that no test reaches, whichever way its bounds lie."""
    model = late(float)
    (each,) = [run_of("a", COMMAND, {"position": COMMAND}, time=TIME, kind="other")]
    each = replace(each, channels={"position": replace(each["position"], noise=0.01)})
    for limit in (3.0, 79.0):
        unknowns = (
            Unknown("gain", 1.0, 0.1, 10.0),
            Unknown("delay", 0.07, 0.0, 2.0, "s"),
            Unknown("limit", limit, 1.0, 80.0),
        )
        made = problem(model, each, free=unknowns)
        assert rounded_unknowns(made, made.start) == ()


def lag_alone(**stated: object) -> None:
    ModelSetup(servo, {"lag": (0.1, 0.3, 1.0)}, **stated).nominal(RUNS)


SENSELESS = {
    r"servo, a bound: lag .* 500 s, .* 0.001 to 100 s: .* ms .* s": lambda: ModelSetup(
        documented, {"lag": (0.1, 1.0, 500.0)}
    ),
    r"servo: lag .* 1e-05 s, .* 0.001 to 100 s": lambda: ModelSetup(
        documented, {"lag": Unknown("lag", 1e-5, 0.0, 10.0)}
    ),
    "servo, fixed: lag .* 500 s, .* 0.001 to 100 s": lambda: ModelSetup(
        documented, {"gain": (0.1, 1.0, 10.0)}, fixed={"lag": 500.0}
    ),
    "dict .* machine": lambda: fit({}, RUNS, RANGES),
    "servo .* free": lambda: fit(servo, RUNS, {}),
    "lag .* 3: .* lower bound": lambda: fit(servo, RUNS, {"lag": 3}),
    "'lagg', .* free .* gain, lag": lambda: fit(
        servo, RUNS, {"lagg": (0.1, 0.2, 3.0)}, fixed={"gain": 1.0, "lag": 1.0}
    ),
    "no run to fit": lambda: fit(servo, [], RANGES),
    "servo .* none": lambda: fit(servo, [run_of("x", TIME, {"y": TIME}, kind="other")], RANGES),
    "noise .* 'speed'": lambda: lag_alone(noise={"speed": 0.1}),
    "noise of 'place' .* 0.0, .* above 0": lambda: lag_alone(noise={"place": 0.0}),
    "noise of 'place' .* nan, .* above 0": lambda: lag_alone(noise={"place": nan}),
    "noise .* 0.1, .* mapping": lambda: lag_alone(noise=0.1),
    r"channels .*\('place',\)": lambda: lag_alone(channels="place"),
    "fixed .* 'gain' .*'1', .* finite": lambda: lag_alone(fixed={"gain": "1"}),
    "servo: standard_uncertainty.gain.* -1.0": lambda: lag_alone(
        fixed={"gain": 1.0}, standard_uncertainty={"gain": -1.0}
    ),
}


@pytest.mark.parametrize(("sentence", "make"), SENSELESS.items(), ids=SENSELESS)
def test_fits_and_statements_without_sense_are_refused(sentence: str, make) -> None:
    with pytest.raises((InputError, ParameterError), match=sentence):
        make()


def test_files_without_a_model_are_refused(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    for name, text, error, sentence in (
        ("bare", "model = 1\n", InputError, "bare.py .* 'free'"),
        ("json", "model = free = 1\n", FileError, "module .* json"),
        ("none", "", FileError, "none.py: .*Python file"),
        ("half", "model = 1\nfree = (\n", FileError, "half.py, line 2: SyntaxError"),
        ("fails", "import math\nmath.sqrt(-1)\n", FileError, "fails.py, line 2: ValueError"),
        ("listed", "model = 1\nfree = ['lag']\n", InputError, "free .*.'lag'., .* map"),
    ):
        if text:
            (tmp_path / f"{name}.py").write_text(text, "utf-8")
        with pytest.raises(error, match=sentence):
            ModelSetup.from_file(tmp_path / f"{name}.py")


class Slow(NamedTuple):
    lag: float


@equation
def slow_step(state: State, command: float, supply: float, p: Slow, h: float) -> State:
    return State(state.place + h / p.lag * (GAIN * command * supply - state.place))


def limited(seed: int) -> Experiment:
    """A test of a servo that has a rate limit in place of a lag."""
    test, place, rows = run(f"run {seed}", seed), 0.0, []
    for u, s in zip(test.input.values, test["supply"].values, strict=True):
        rows.append(place)
        place += np.clip((GAIN * u * s - place) / 2.5, -0.05, 0.05)
    return moved(test, np.array(rows) + 1e-3 * np.random.default_rng(seed).normal(size=COUNT))


@pytest.mark.slow
def test_what_a_model_leaves_out_is_an_error_of_its_prediction() -> None:
    slow = Model("slow", parameters=Slow, state=State, step=slow_step)
    made = fit(slow, campaign(*map(limited, range(40))), {"lag": (0.01, 0.1, 3.0)})
    found = assess_fit(made, predict(made.parameters, [limited(99)]))
    (stated,) = found.predictions
    # the noise is 1e-3 of a range of about 2
    assert stated.worst.error > 0.02
    # the sensor's scale is right, which a refit finds
    assert "scale of place" not in found.cause


@pytest.mark.parametrize(
    ("gain", "late", "said"),
    [(1.15, 0.0, "it moves 1.1"), (1.0, 0.6, "ms late relative to its command")],
)
def test_a_run_with_a_scale_or_a_delay_of_its_own_is_named(gain, late, said) -> None:
    """The third of six runs reads 15 % too much or is 600 ms late, the noise is not stated."""
    random = np.random.default_rng(7)
    runs = [trial(f"run {k}") for k in range(7)]
    read = np.array([each["position"].values for each in runs])
    read[2] = gain * np.interp(TIME - late, TIME, read[2])
    read += random.normal(0.0, 0.005, read.shape)
    runs = [moved(each, own) for each, own in zip(runs, read, strict=True)]
    free = {"lag": (0.05, 0.2, 2.0), "gain": (0.1, 1.0, 20.0)}
    made = fit(ModelSetup(valve, free, given=Load()), campaign(*runs[:6]))
    found = assess_fit(made, predict(made.parameters, runs[6:]))
    assert not found.usable
    assert [each.run for each in found.unsound] == ["run 2"]
    assert said in found.headline


# --- the documented model file, against another solver --------------------------------------------

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "user-defined-model-fit.md"
MACHINE = {"dead_zone": 0.6, "gain": 0.02, "lag": 0.15}


def valve_test(name: str, frequency: float) -> Experiment:
    """The page's valve and rod by SciPy, from one sample to the next, as the command is held."""
    time = 0.02 * np.arange(400)
    command = 4.0 * np.sin(2.0 * np.pi * frequency * time)
    supply = 100.0 + 15.0 * np.sin(2.0 * np.pi * 0.3 * time)
    state, rows = np.array([0.0, 0.0]), [0.0]
    for start, level, pressure in zip(time[:-1], command, supply, strict=False):
        slope = (np.interp(start + 0.01, time, supply) - pressure) / 0.01

        def rates(t, y, start=start, level=level, pressure=pressure, slope=slope):
            root = sqrt((pressure + slope * (t - start)) / 100.0)
            beyond = np.sign(y[0]) * max(abs(y[0]) - MACHINE["dead_zone"], 0.0)
            return (level - y[0]) / MACHINE["lag"], MACHINE["gain"] * beyond * root

        ends = (start, start + 0.02)
        state = solve_ivp(rates, ends, state, method="DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
        rows.append(state[1])
    channels = {"rod": np.array(rows), "supply": supply}
    return run_of(name, command, channels, time=time, kind="other", hold="previous")


@pytest.fixture
def documented_valve(tmp_path: Path, monkeypatch) -> Path:
    """The model file of the page, importable for the length of a test."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    path = tmp_path / "documented_valve.py"
    (text,) = re.findall(r"```python\n(# valve\.py\n.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    path.write_text(text, "utf-8")
    yield path
    sys.modules.pop(path.stem, None)


@pytest.mark.slow
def test_the_documented_model_file_finds_a_lag_in_several_processes(documented_valve: Path) -> None:
    """Workers find the model by its name in the file."""
    setup = ModelSetup.from_file(documented_valve)
    assert pickle.loads(pickle.dumps(setup.model.model)) is setup.model.model
    runs = [valve_test("slow", 0.2), valve_test("fast", 0.6)]
    search = Search(2, executor=Processes(2))
    made = fit(replace(setup, noise={"rod": 1e-5}), runs, search=search)
    assert len(made.starts) == 3
    values = made.values
    assert {name: values[name] for name in MACHINE} == pytest.approx(MACHINE, rel=5e-3)
