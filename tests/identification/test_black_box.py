"""A fit takes a machine: of equations, whose numbers are where it begins, or a black box."""

from dataclasses import replace
from math import exp
from typing import Annotated, NamedTuple

import numpy as np
import pytest
from scipy.signal import lfilter
from tests.identification.given import run_of

from swashplate import (
    BlackBox,
    DomainError,
    Drive,
    Experiment,
    InputError,
    Machine,
    Model,
    ParameterError,
    equation,
    join,
)
from swashplate import identification as face
from swashplate.identification import (
    ModelSetup,
    Problem,
    Unknown,
    Unknowns,
    estimates_of,
    fit,
    fixed_table,
    identify,
    predict,
    solve,
    uncertainty_of,
)
from swashplate.machine import Definition

RATE, COUNT = 50.0, 600
TIME = np.arange(COUNT) / RATE
TRUTH = {"gain": 2.0, "lag": 0.3}
NOISE = {"level": 0.01}


class Tank(NamedTuple):
    gain: Annotated[float, Definition("gain of the valve", "bar/V", above=0.0)]
    lag: Annotated[float, Definition("time constant", "s", above=0.0)]
    leak: Annotated[float, Definition("what runs out", "bar")] = 0.0


class State(NamedTuple):
    level: float


class Depth(NamedTuple):
    depth: float = 0.0


@equation
def step(state: State, valve: float, supply: float, p: Tank, h: float, given: Depth) -> State:
    aim = p.gain * valve * supply - p.leak - given.depth
    return State(aim + exp(-h / p.lag) * (state.level - aim))


tank = Model("tank", Tank, State, step, given=Depth)
MACHINE = Machine(tank, Tank(gain=1.0, lag=0.1), given=Depth())


def level_of(time, inputs, numbers):
    """The same as a program."""
    if numbers["lag"] <= 0.0:
        raise DomainError("A tank lags.")
    level = np.full(time.size, numbers["start.level"])
    aim = numbers["gain"] * inputs["valve"] * inputs["supply"]
    left = np.exp(-np.diff(time) / numbers["lag"])
    for k in range(time.size - 1):
        level[k + 1] = aim[k] + left[k] * (level[k] - aim[k])
    return {"level": level}


BOX = BlackBox(
    "tank",
    level_of,
    inputs=("valve", "supply"),
    outputs=("level",),
    numbers={"gain": 1.0, "lag": 0.1, "start.level": 0.0},
    definitions={"gain": Definition("gain of the valve", "bar/V")},
)
FREE = {"gain": (0.1, 10.0), "lag": (0.01, 3.0), "start.level": (-5.0, 0.0, 5.0)}


def trial(seed: int, begin: float = 0.0, role: str = "fit") -> Experiment:
    """A run of the true tank, by SciPy's recursion over each held sample."""
    random = np.random.default_rng(seed)
    valve = np.repeat(random.uniform(-1.0, 1.0, COUNT // 30), 30)
    supply = 1.0 + 0.2 * np.sin(0.9 * TIME + seed)
    left = exp(-1.0 / RATE / TRUTH["lag"])
    aim = TRUTH["gain"] * valve * supply
    # level[k] = left level[k-1] + (1 - left) aim[k-1], from `begin` on
    forced = lfilter([0.0, 1.0 - left], [1.0, -left], aim)
    level = forced + begin * left ** np.arange(COUNT)
    channels = {"level": level + NOISE["level"] * random.standard_normal(COUNT), "supply": supply}
    name = f"run {seed}"
    return run_of(name, valve, channels, time=TIME, kind="other", hold="previous", role=role)


RUNS = (trial(1, 1.0), trial(2, -2.0))


@pytest.mark.parametrize("machine", [MACHINE, BOX], ids=["equations", "black box"])
def test_the_truth_is_found_and_predicted(machine) -> None:
    made = fit(machine, RUNS, FREE, noise=NOISE)
    starts = {"start.level (run 1)": 1.0, "start.level (run 2)": -2.0}
    assert made.values == pytest.approx(TRUTH | starts, abs=0.02)
    estimates = uncertainty_of(made).estimates
    for estimate, truth in zip(estimates, (TRUTH | starts).values(), strict=True):
        assert estimate.lower < truth < estimate.upper
    (quality,) = predict(made.parameters, [trial(3, 0.5)])
    assert quality.measures.rmse == pytest.approx(NOISE["level"], rel=0.1)


def test_a_black_box_has_the_intervals_of_its_equations() -> None:
    box, equations = (fit(each, RUNS, FREE, noise=NOISE) for each in (BOX, MACHINE))
    for one, other in zip(
        uncertainty_of(box).estimates, uncertainty_of(equations).estimates, strict=True
    ):
        assert one.value == pytest.approx(other.value, abs=1e-6)
        assert one.standard_error == pytest.approx(other.standard_error, rel=1e-4)


def test_a_fit_begins_at_the_machines_numbers_and_holds_the_others() -> None:
    biased = MACHINE.replace(leak=0.25)
    setup = ModelSetup(biased, {"gain": (0.1, 10.0), "lag": (0.01, 0.2, 3.0, "h")})
    assert setup.free["gain"] == Unknown("gain", 1.0, 0.1, 10.0, "bar/V", log=True)
    assert setup.free["lag"] == Unknown("lag", 0.2, 0.01, 3.0, "h", log=True)
    assert setup.held == {"leak": 0.25}
    assert replace(setup, fixed={"leak": 0.5}).held == {"leak": 0.5}
    tests = [trial(4)]
    leaking = replace(tests[0]["level"], values=tests[0]["level"].values - 0.25)
    # from its rest, exp(-t/T) of the leak is missing at the start: too little to matter here
    late = replace(leaking, weight=(TIME > 3.0).astype(float))
    tests[0] = replace(tests[0], channels={**tests[0].channels, "level": late})
    made = fit(replace(setup, noise=NOISE), tests)
    assert made.values == pytest.approx(TRUTH, abs=0.02)
    assert made.parameters.numbers["leak"] == 0.25
    assert made.estimates["leak"].status == "fixed"
    (row,) = fixed_table(made).rows
    assert row.cells[:3] == ("leak", "what runs out", 0.25)
    assert row.unit == "bar"


def test_what_a_machine_holds_may_be_uncertain() -> None:
    held = MACHINE.replace(lag=TRUTH["lag"])
    known = {"noise": NOISE, "standard_uncertainty": {"lag": "5 %"}}
    for machine in (held, BOX.replace(lag=TRUTH["lag"])):
        setup = ModelSetup(machine, {"gain": (0.1, 10.0)}, **known)
        (doubtful,) = estimates_of(fit(setup, [trial(5)]))
        (certain,) = estimates_of(fit(replace(setup, standard_uncertainty={}), [trial(5)]))
        assert doubtful.upper - doubtful.lower > certain.upper - certain.lower


def test_the_givens_of_a_machine_hold_unless_a_run_has_its_own() -> None:
    deep = MACHINE.with_given(Depth(0.4))
    made = trial(6)
    lower = replace(made["level"], values=made["level"].values - 0.4, weight=(TIME > 3.0) * 1.0)
    runs = [replace(made, channels={**made.channels, "level": lower})]
    free = {"gain": (0.1, 10.0), "lag": (0.01, 3.0)}
    assert fit(deep, runs, free, noise=NOISE).values == pytest.approx(TRUTH, abs=0.02)
    by_run = ModelSetup(MACHINE, free, noise=NOISE, given={"run 6": Depth(0.4)})
    assert fit(by_run, runs).values == pytest.approx(TRUTH, abs=0.02)
    with pytest.raises(InputError, match="its given must be a Depth, not 3"):
        fit(replace(by_run, given=3), runs)


class Filter(NamedTuple):
    time: float


class Out(NamedTuple):
    out: float


@equation
def smoothed(state: Out, command: float, p: Filter, h: float) -> Out:
    return Out(command + exp(-h / p.time) * (state.out - command))


def test_a_joined_machine_is_fitted_by_last_words() -> None:
    """A filter before the tank, whose channels and numbers are called by their last words."""
    before = Machine(Model("filter", Filter, Out, smoothed), Filter(0.1))
    members = {"filter": before, "tank": MACHINE}
    row = join("row", members, links={"tank.valve": "filter.out"})
    test = trial(9)
    shares = {name: exp(-1.0 / RATE / lag) for name, lag in (("filter", 0.5), ("tank", 0.3))}
    out, level = test.input.values, np.zeros(COUNT)
    out = lfilter([0.0, 1.0 - shares["filter"]], [1.0, -shares["filter"]], out)
    aim = TRUTH["gain"] * out * test["supply"].values
    level = lfilter([0.0, 1.0 - shares["tank"]], [1.0, -shares["tank"]], aim)
    level += NOISE["level"] * np.random.default_rng(9).standard_normal(COUNT)
    channels = {**test.channels, "level": replace(test["level"], values=level)}
    free = {"gain": (0.1, 10.0), "tank.lag": (0.01, 3.0), "time": (0.01, 3.0)}
    made = fit(row, [replace(test, channels=channels)], free, noise=NOISE)
    expected = {"tank.gain": 2.0, "tank.lag": 0.3, "filter.time": 0.5}
    assert made.values == pytest.approx(expected, abs=0.03)
    assert made.parameters.numbers["tank.leak"] == 0.0


def test_a_drive_is_a_machine_too() -> None:
    """By paths, at half the rate that its equations bear: two steps a sample."""
    drive = Drive.preset("hoist")
    command = 9.0 * np.sin(2.0 * np.pi * 0.4 * np.arange(512) / 256.0)
    speed = drive.simulate(command, 256.0, substeps=2).shaft_speed
    time = np.arange(speed.size) / 256.0
    run = run_of("sine", command, {"shaft_speed": speed}, time=time)
    setup = ModelSetup(drive.scale(Z8=0.7), {"Z8": (1e5, 1e7)}, noise={"shaft_speed": 0.01})
    made = fit(setup, [run])
    assert made.values["pump.Z8"] == pytest.approx(drive["Z8"].value, rel=1e-6)


def test_a_problem_takes_either_machine() -> None:
    unknowns = Unknowns((Unknown("gain", 1.0, 0.1, 10.0), Unknown("lag", 0.1, 0.01, 3.0, "s")))
    for machine in (MACHINE, BOX):
        problem = Problem(machine, (trial(7),), unknowns, ("level",), NOISE)
        assert unknowns.values(solve(problem).vector) == pytest.approx(TRUTH, abs=0.02)


@pytest.mark.parametrize("rate", [None, 500.0])
def test_a_black_box_takes_uneven_stamps_or_a_rate(rate) -> None:
    """A log that lacks samples: the program is given its own stamps, or a grid."""
    whole = trial(8, 0.7)
    kept = np.sort(np.random.default_rng(0).permutation(COUNT)[:500])
    kept = np.unique([0, *kept, COUNT - 1])
    # held inputs: what lacks is a repeated value, but for the changes
    kept = np.union1d(kept, np.flatnonzero(np.diff(whole.input.values)) + 1)
    cut = {
        name: replace(
            each, time=each.time[kept], values=each.values[kept], weight=np.ones(kept.size)
        )
        for name, each in whole.channels.items()
    }
    drive = replace(whole.input, time=TIME[kept], values=whole.input.values[kept])
    run = replace(whole, channels=cut, input=drive)
    made = fit(ModelSetup(BOX, FREE, noise=NOISE, rate=rate), [run])
    assert made.values == pytest.approx({**TRUTH, "start.level (run 8)": 0.7}, abs=0.05)


def test_a_step_out_of_the_programs_domain_is_taken_back() -> None:
    made = fit(BOX, RUNS, {**FREE, "lag": (-1.0, 0.1, 3.0)}, noise=NOISE)
    assert made.values["lag"] == pytest.approx(TRUTH["lag"], abs=0.02)


class Old:
    """What a fit took once."""

    def simulate(self, values, experiment):
        return {"level": values["gain"] * experiment.input.values}


def setup_of(machine=BOX, free=FREE, **stated) -> object:
    return ModelSetup(machine, free, **stated).nominal(RUNS)


REFUSED = {
    "tank is a black box, which knows of no substeps": lambda: setup_of(substeps=4),
    "tank is a black box, which knows of no begin": lambda: setup_of(begin={"level": "level"}),
    "tank is a black box, which knows of no given": lambda: setup_of(given={"run 1": 1}),
    "rate is -1, .* above 0": lambda: setup_of(rate=-1),
    "rate is 'fast', .* above 0": lambda: setup_of(MACHINE, rate="fast"),
    "tank has no parameter 'gian', .* mean gain": lambda: setup_of(free={"gian": (0.1, 1.0)}),
    "gain begins at 1, outside its bounds": lambda: setup_of(free={"gain": (2.0, 3.0)}),
    "start.level is free as .* Machine needs no nominal": lambda: setup_of(
        MACHINE, {"start.level": (-1.0, 1.0)}
    ),
    "gain is free as .* nominal value": lambda: setup_of(tank, {"gain": (0.1, 1.0)}),
    "lag has a standard uncertainty but no value": lambda: setup_of(
        MACHINE, standard_uncertainty={"lag": 0.1}
    ),
    "An? Old is not a machine: give a Machine, .* BlackBox": lambda: setup_of(Old()),
    "has the channels .* gives none; it gives level": lambda: ModelSetup(BOX, FREE).nominal(
        [run_of("x", TIME, {"supply": TIME}, time=TIME, kind="other")]
    ),
    "needs the signals valve, supply; run 1 has one input": lambda: (
        ModelSetup(BOX, FREE)
        .nominal([replace(RUNS[0], channels={"level": RUNS[0]["level"]})])
        .predicted(replace(RUNS[0], channels={"level": RUNS[0]["level"]}))
    ),
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_what_a_fit_of_a_machine_refuses(sentence) -> None:
    with pytest.raises((InputError, ParameterError), match=sentence):
        REFUSED[sentence]()


def test_identify_refuses_what_is_no_machine(tmp_path) -> None:
    from swashplate import maneuvers, rig

    file = rig.write(rig.run("hoist", {"sine": maneuvers.sine(9.0, 0.1)}), tmp_path)
    with pytest.raises(TypeError, match="a Machine or Model of your own"):
        identify(file, Old(), {"gain": (0.1, 1.0, 3.0)})


@pytest.mark.parametrize("name", ["UserModel", "MachineModel"])
def test_a_name_that_is_gone_says_what_to_write(name) -> None:
    with pytest.raises(ImportError, match=f"no {name} any more: give a fit a "):
        getattr(face, name)
