"""A model of equations in a fit: exact derivatives, what a run begins with, what is refused."""

from collections.abc import Callable
from dataclasses import replace
from math import exp
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from swashplate import Channel, DomainError, Experiment, InputError
from swashplate.campaign.experiment import InputSignal, Source
from swashplate.equations import Model, Tap, equation, simulate
from swashplate.identification import OwnModel, Problem, Unknown, Unknowns, solve
from swashplate.identification.model import linearised

SOURCE = Source(Path("log.csv"), "y")
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
OWN = OwnModel(valve, given=Load())


def trial(name: str, load: Load = Load(), begin: float = 0.0, **channels: np.ndarray) -> Experiment:  # noqa: B008
    """A run of the true valve."""
    run = simulate(valve, TRUTH, {"command": COMMAND}, RATE, given=load, begin={"position": begin})
    command = InputSignal("other", "V", TIME, COMMAND, "previous", SOURCE)
    made = {
        each: Channel(each, "other", "1", TIME, values, np.ones(TIME.size), SOURCE)
        for each, values in {"position": run["position"], **channels}.items()
    }
    return Experiment(name, "rod", name, "fit", "rest", None, command, made)


def problem(model: object, *runs: Experiment, free: tuple[Unknown, ...] = FREE, **more) -> Problem:
    return Problem(model, runs, Unknowns(free), ("position",), {"position": 0.01}, **more)


def found(made: Problem) -> dict[str, float]:
    return made.unknowns.values(solve(made, tolerance=1e-14).vector)


def test_a_model_is_fitted_by_the_names_of_its_parameters() -> None:
    values = found(problem(OWN, trial("a"), trial("b")))
    assert values == pytest.approx(TRUTH._asdict(), rel=1e-7)


def test_a_model_without_givens_stands_for_itself() -> None:
    class Tank(NamedTuple):
        gain: float

    class Level(NamedTuple):
        position: float

    @equation
    def filled(state: Level, command: float, p: Tank, h: float) -> Level:
        return Level(state.position + h * p.gain * command)

    tank = Model("tank", Tank, Level, filled)
    level = simulate(tank, Tank(0.3), {"command": COMMAND}, RATE)["position"]
    run = trial("a")
    channel = replace(run["position"], values=level)
    values = found(problem(tank, replace(run, channels={"position": channel}), free=FREE[1:2]))
    assert values == pytest.approx({"gain": 0.3}, rel=1e-9)


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
    for each in (full, small):
        assert each.jacobian.T @ each.residuals == pytest.approx(
            full.jacobian.T @ full.residuals, rel=1e-9
        )


def test_a_run_has_a_load_a_beginning_and_a_zero_of_its_own() -> None:
    loads = {"a": Load(0.2), "b": Load(-0.3, stop=9.0)}
    first, second = trial("a", loads["a"], 0.7), trial("b", loads["b"])
    moved = replace(second["position"], values=second["position"].values + 0.4)
    free = (
        *FREE,
        Unknown("start.position", 0.0, -2.0, 2.0, run="a"),
        Unknown("offset position", 0.0, -2.0, 2.0, run="b"),
    )
    model = OwnModel(valve, given=loads)
    runs = (first, replace(second, channels={"position": moved}))
    values = found(problem(model, *runs, free=free))
    own = {"start.position (a)": 0.7, "offset position (b)": 0.4}
    assert values == pytest.approx({**TRUTH._asdict(), **own}, rel=1e-6)


def test_a_run_begins_where_a_channel_does() -> None:
    model = OwnModel(valve, given=Load(), begin={"position": "position"})
    values = found(problem(model, trial("a", begin=0.7)))
    assert values == pytest.approx(TRUTH._asdict(), rel=1e-7)


@pytest.mark.parametrize("hold", ["previous", "linear"])
def test_uneven_stamps_are_put_on_a_grid(hold) -> None:
    """What was logged at jittered stamps, marched at a rate of one's own."""
    jitter = np.random.default_rng(3).uniform(-0.02, 0.02, TIME.size)
    time = TIME + np.where(np.arange(TIME.size) % 239 == 0, 0.0, jitter)
    command = InputSignal("other", "V", time, np.sin(2.0 * time), hold, SOURCE)
    run = replace(trial("a"), input=command)
    fine = np.arange(int(time[-1] * 200.0) + 1) / 200.0
    level = simulate(valve, TRUTH, {"command": command.at(fine)}, 200.0, given=Load())["position"]
    position = replace(run["position"], time=time, values=np.interp(time, fine, level))
    run = replace(run, channels={"position": position})
    values = found(problem(OwnModel(valve, given=Load(), rate=200.0), run))
    assert values == pytest.approx(TRUTH._asdict(), rel=1e-3)
    with pytest.raises(InputError, match=r"a: the stamps of its input are not even, .* rate=100.0"):
        problem(OWN, run).cost(Unknowns(FREE).start)


def lagging(state: Rod, command: float, p: Valve, h: float) -> Rod:
    """Euler's method, which the step's length shows in."""
    opening = state.opening + h * (command - state.opening) / p.lag
    return Rod(opening, state.position + h * p.gain * opening)


@pytest.mark.parametrize("hold", ["previous", "linear"])
def test_sub_steps_of_a_fit_are_those_of_a_simulation(hold) -> None:
    coarse = Model("coarse", Valve, Rod, equation(lagging))
    way = {"interpolation": hold, "substeps": 3}
    made = simulate(coarse, TRUTH, {"command": COMMAND}, RATE, **way)["position"]
    run = trial("a")
    channels = {"position": replace(run["position"], values=made)}
    run = replace(run, input=replace(run.input, interpolation=hold), channels=channels)
    expected = {"lag": TRUTH.lag, "gain": TRUTH.gain}
    values = found(problem(OwnModel(coarse, substeps=3), run, free=FREE[:2]))
    assert values == pytest.approx(expected, rel=1e-7)
    assert found(problem(coarse, run, free=FREE[:2]))["lag"] != pytest.approx(TRUTH.lag, rel=0.01)
    with pytest.raises(InputError, match="substeps is 0, but must be a whole number"):
        problem(OwnModel(coarse, substeps=0), run).cost(Unknowns(FREE).start)


class Pushed(NamedTuple):
    gain: float


class Cart(NamedTuple):
    position: float


@equation
def pushed(state: Cart, command: float, wind: float, p: Pushed, h: float) -> Cart:
    return Cart(state.position + h * p.gain * (command + wind))


cart = Model("cart", Pushed, Cart, pushed)


def test_a_second_input_is_a_channel() -> None:
    wind = np.cos(TIME)
    inputs = {"command": COMMAND, "wind": wind}
    moved = simulate(cart, Pushed(0.3), inputs, RATE)["position"]
    run = trial("a", wind=wind)
    channels = {**run.channels, "position": replace(run["position"], values=moved)}
    values = found(problem(cart, replace(run, channels=channels), free=FREE[1:2]))
    assert values == pytest.approx({"gain": 0.3}, rel=1e-9)


def windowed(channel: Channel, rows: np.ndarray) -> np.ndarray:
    """Motion since the beginning of each two seconds."""
    windows = channel.time // 2.0
    return rows - rows[np.searchsorted(windows, windows)]


def test_a_position_is_compared_by_its_motion() -> None:
    run = trial("a")
    slipping = run["position"].values + np.floor(TIME / 2.0)
    run = replace(run, channels={"position": replace(run["position"], values=slipping)})
    assert found(problem(OWN, run))["gain"] != pytest.approx(1.5, rel=0.1)
    values = found(problem(OWN, run, compare=windowed))
    assert values == pytest.approx(TRUTH._asdict(), rel=1e-6)


def test_the_domain_takes_a_step_back_and_ends_in_its_sentence() -> None:
    made = problem(OWN, trial("a"), free=(Unknown("gain", 0.2, 0.1, 20.0, log=True),))
    made = replace(made, fixed={"lag": 0.4, "delay": 0.13})
    assert found(made)["gain"] == pytest.approx(1.5)
    with pytest.raises(DomainError, match=r"^valve: the valve has no such gain under this "):
        solve(made, made.unknowns.vector_of({"gain": 6.0}))


def renamed(run: Experiment, name: str) -> Experiment:
    channel = replace(run["position"], name=name)
    return replace(run, channels={name: channel})


REFUSED: dict[str, tuple[Callable[[], Problem], str]] = {
    "unknown parameter": (
        lambda: problem(OWN, trial("a"), free=(*FREE, Unknown("lead", 1.0, 0.0, 2.0))),
        "valve has no parameter 'lead'; it has lag, gain, delay",
    ),
    "unknown start": (
        lambda: problem(OWN, trial("a"), free=(*FREE, Unknown("start.speed", 1.0, 0.0, 2.0))),
        "valve has no state 'speed' to begin at; it has opening, position",
    ),
    "no value": (
        lambda: problem(OWN, trial("a"), free=FREE[:1]),
        "valve has no value of gain: let it be free, or fix it",
    ),
    "no channel": (
        lambda: Problem(OWN, (renamed(trial("a"), "y"),), Unknowns(FREE), ("y",), {"y": 1.0}),
        "a has the channels y, of which valve gives none; it gives opening, position",
    ),
    "another channel": (
        lambda: Problem(
            OWN,
            (trial("a", y=COMMAND),),
            Unknowns(FREE),
            ("y", "position"),
            {"y": 1, "position": 1},
        ),
        "a: the model gives no 'y'; it gives position",
    ),
    "unknown driver": (
        lambda: problem(cart, trial("a"), free=FREE[1:2]),
        "cart needs the signals command, wind; a has one input, for one of them, and the channels",
    ),
    "no given": (
        lambda: problem(OwnModel(valve), trial("a")),
        "Model valve: its given must be a Load, not None",
    ),
    "no given of a run": (
        lambda: problem(OwnModel(valve, given={"b": Load()}), trial("a")),
        "valve has no given numbers for a",
    ),
}


@pytest.mark.parametrize(("make", "sentence"), REFUSED.values(), ids=REFUSED)
def test_what_does_not_fit_the_model_is_refused(make, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        solve(make())
